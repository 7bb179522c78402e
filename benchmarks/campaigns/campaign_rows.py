"""Measure campaigns: flights a minute, gain of a second worker, overhead per flight, and duration of a proof.

``python -m benchmarks campaigns [--flights N] [--long]``.  The mission of the first rows is 13 km over the
demo's terrain, in its wind.
"""

import math
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.campaigns.client_memory import client_memory
from benchmarks.campaigns.compare_step_rates import compare_all
from benchmarks.campaigns.winds_reference import winds_row
from flight.simulation.setup import EngineChoice
from flight.simulation.simulate import Flight, fly_to_end
from planfly.campaigns.campaign_base import CampaignBase, open_campaign, vary_flight
from planfly.campaigns.dispersions import default_dispersions, draw_flight
from planfly.campaigns.flight_requests import FlightRequest
from planfly.campaigns.flight_row import fly_one
from planfly.campaigns.worker_pool import Workers, worker_pool
from planfly.flight_options import MissionOptions
from world.scenario import load_scenario

# Number of flights whose rate is measured.
FLIGHTS = 90
# Number of rounds.
ROUNDS = 3
# Corners of the 13 km mission: latitude, longitude.
_CORNERS = ((36.273, -84.28), (36.273, -84.23), (36.309, -84.23), (36.309, -84.28))


def mission_13_km(folder: Path, engine: EngineChoice = "auto") -> CampaignBase:
    """Make a mission of three legs of 4.0 to 4.5 km above the demo's ridges, in its wind."""
    lines = ["QGC WPL 110", "0\t1\t0\t16\t0\t0\t0\t0\t36.293\t-84.25\t1150\t1"]
    lines += [f"{k}\t0\t0\t16\t0\t0\t0\t0\t{lat}\t{lon}\t1200\t1" for k, (lat, lon) in enumerate(_CORNERS, 1)]
    path = folder / "legs.waypoints"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    wind = load_scenario("jacksboro-air").wind

    options: MissionOptions = {
        "terrain": "jacksboro",
        "seed": 1,
        "wind": (wind.speed, math.degrees(wind.from_course)),
        "turbulence": wind.turbulence,
        "engine": engine,
    }
    return open_campaign(str(path), default_dispersions(), options)


def flights_a_minute(base: CampaignBase, workers: int, flights: int) -> float:
    """Return the flights a minute, measured from the first result of each worker on."""
    indices = iter(range(flights))

    def next_request() -> FlightRequest | None:
        """Return the request of the next flight; None if all flights are requested."""
        index = next(indices, None)
        return None if index is None else FlightRequest(index)

    moments: list[float] = []
    with worker_pool(Workers(workers), base) as pool:
        moments += [time.perf_counter() for _ in pool.fly(next_request)]
    return 60.0 * (flights - workers) / (moments[-1] - moments[workers - 1])


def over_simulate(base: CampaignBase, flights: int = 20) -> float:
    """Return the median CPU time of a campaign's flight, relative to `simulate` alone."""
    fly_one(base, 0)
    ratios = []
    for index in range(1, flights + 1):
        started = time.process_time()
        fly_one(base, index)
        between = time.process_time()
        varied = vary_flight(base, draw_flight(base.dispersions, base.seed, index))
        setup_done = time.process_time()
        how = varied.off_nominal
        fly_to_end(Flight(varied.setup, varied.uav.aircraft, how.variation, start_offset=how.start_offset))
        ratios.append((between - started) / (time.process_time() - setup_done))
    return statistics.median(ratios)


def proof(folder: Path, share: float) -> tuple[int, float]:
    """Return flights and seconds of ``planfly campaign jacksboro-air --prove SHARE``.

    The seconds include planning and report.
    """
    started = time.perf_counter()
    command = [sys.executable, "-m", "planfly", "campaign", "jacksboro-air", "--prove", str(share), "--seed", "1"]
    done = subprocess.run(
        [*command, "--workers", "2", "--out", str(folder / "proof")], check=True, capture_output=True, text=True
    )
    spent = time.perf_counter() - started
    line = next(line for line in done.stdout.splitlines() if " flights are flyable" in line)
    return int(line.split(" of ")[1].split()[0]), spent


def run(most: int = FLIGHTS, *, whole: bool = False) -> dict[str, Any]:
    """Measure, print a table, and return it.

    most: number of flights whose rate is measured; with fewer than 90 the proved probability is 0.9.
    whole: include the rows that take an hour: winds of the demo, the client's memory, both step rates.
    """
    share = 0.99 if most >= FLIGHTS else 0.9
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        base = mission_13_km(folder)
        two, one = [], []
        for _ in range(ROUNDS):
            two.append(flights_a_minute(base, 2, most))
            one.append(flights_a_minute(base, 1, max(2, most // 2)))
        scenario_rates = {
            name: statistics.median(
                flights_a_minute(open_campaign(name, default_dispersions(), {"seed": 1}), 2, most)
                for _ in range(ROUNDS)
            )
            for name in ("jacksboro-air", "jacksboro")
        }
        flights, seconds = proof(folder, share)
        found: dict[str, Any] = {
            "flights a minute, 13 km, two workers": statistics.median(two),
            **{f"flights a minute, {name}, two workers": rate for name, rate in scenario_rates.items()},
            "two workers / one": statistics.median(a / b for a, b in zip(two, one, strict=True)),
            "a campaign's flight / simulate alone": over_simulate(base, min(20, most)),
            f"--prove {share} on the demo: flights": flights,
            f"--prove {share} on the demo: seconds": seconds,
        }
        if whole:
            found["client at 100,000 flights, MB"] = client_memory(100_000)
            found |= winds_row()
            found |= compare_all(range(200))
    for label, value in found.items():
        print(f"  {label:<52}{value:10.4g}")
    return found
