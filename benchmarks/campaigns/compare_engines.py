"""Compare a campaign's flights by the compiled flight model with the same flights by JSBSim, byte for byte.

``python -m benchmarks.campaigns.compare_engines [--flights N]`` flies the flights of three campaigns with both engines
and prints, for each campaign, the number of flights whose tracks and rows are identical, and the largest resident size
of a worker process with each engine.
"""

import argparse
import hashlib
import multiprocessing
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import cast

from benchmarks.campaigns.campaign_rows import mission_13_km
from flight.simulation.setup import EngineChoice
from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.track import track_rows
from planfly.campaigns.campaign_base import CampaignBase, open_campaign, vary_flight
from planfly.campaigns.dispersions import default_dispersions, draw_flight
from planfly.campaigns.flight_row import fly_one

ENGINES: tuple[EngineChoice, ...] = ("auto", "jsbsim")
# Campaigns by name, and the fraction of the flights that each of them flies.
_CAMPAIGNS = {"13 km": 0.5, "jacksboro-air": 0.25, "jacksboro": 0.25}


def open_base(name: str, engine: EngineChoice) -> CampaignBase:
    """Open one of the campaigns, flown by an engine."""
    if name != "13 km":
        return open_campaign(name, default_dispersions(), {"seed": 1, "engine": engine})
    with tempfile.TemporaryDirectory() as folder:
        return mission_13_km(Path(folder), engine)


def describe_flight(base: CampaignBase, index: int) -> tuple[str, str, bool]:
    """Fly one flight; return digests of its track and of its row, and True if the compiled model flew."""
    varied = vary_flight(base, draw_flight(base.dispersions, base.seed, index))
    flight = Flight(
        varied.setup,
        varied.uav.aircraft,
        varied.off_nominal.variation,
        start_offset=varied.off_nominal.start_offset,
    )
    flown = fly_to_end(flight)
    row = replace(fly_one(base, index), seconds=0.0)
    track = track_rows(flown.track).tobytes() + flown.ended.encode()
    digests = (hashlib.sha256(data).hexdigest() for data in (track, repr(row).encode()))
    return (*cast("tuple[str, str]", tuple(digests)), flight.engine.startswith("compiled"))


def fly_campaign_flights(name: str, engine: EngineChoice, flights: int) -> tuple[list[tuple[str, str, bool]], float]:
    """Fly flights of a campaign in this process; return descriptions and the peak resident size, MB."""
    base = open_base(name, engine)
    described = [describe_flight(base, index) for index in range(flights)]
    status = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return described, next(int(line.split()[1]) / 1024.0 for line in status if line.startswith("VmHWM"))


def main() -> int:
    """Print the table; return 1 if any flight differs or was not flown by the engine under test."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=200, help="number of flights of all campaigns together")
    flights = parser.parse_args().flights
    has_difference = False
    for name, fraction in _CAMPAIGNS.items():
        count = max(1, round(flights * fraction))
        with multiprocessing.get_context("spawn").Pool(2, maxtasksperchild=1) as pool:
            (compiled, compiled_mb), (jsbsim, jsbsim_mb) = pool.starmap(
                fly_campaign_flights, [(name, engine, count) for engine in ENGINES], chunksize=1
            )
        same = sum(one[:2] == other[:2] for one, other in zip(compiled, jsbsim, strict=True))
        by_compiled = sum(one[2] for one in compiled)
        has_difference |= same < count or by_compiled < count or any(one[2] for one in jsbsim)
        print(
            f"{name}: {same} of {count} flights identical ({by_compiled} by the compiled model); "
            f"worker {compiled_mb:.0f} MB, with JSBSim {jsbsim_mb:.0f} MB"
        )
    return int(has_difference)


if __name__ == "__main__":
    sys.exit(main())
