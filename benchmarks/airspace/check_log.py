"""Time the check of an hour's log in an airspace of 1,000 zones of 50 corners.

``python -m benchmarks.airspace.check_log [--zones N] [--corners N] [--hours H]`` records a flight of an hour, 60 rows
a second, along legs of 2 km, with zones on both sides, as near as 20 m, some of them across its path and every tenth
with a ceiling above ground; and times, with compiled kernels, the reading of the log, and its verdict without and with
the zones.  The flight is synthetic, over a grid of hills, as only the check is timed.
"""

import argparse
import math
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import median_cpu, median_time
from flight.simulation.setup import FlightSetup
from logs.recording.reader import read_log
from logs.recording.recorder import Recorder
from logs.verdict.judge_flight import judge_flight
from tests.synthetic import fly_path, make_setup
from world.scenario import scenario_from_spec

# Seed of zones and hills.
SEED = 12
# Length of a leg, m.
LEG = 2000.0
# Airspeed, m/s.
SPEED = 25.0
# Number of zones.
ZONES = 1000
# Number of corners of a zone.
CORNERS = 50


def flown_path(hours: float) -> np.ndarray:
    """Return the waypoints of a flight of some hours at 25 m/s, m, (w, 3).

    The flight follows parallel lanes of ten legs each, alternately to the north and to the south, 1,500 m apart.
    """
    count = math.ceil(hours * 3600.0 * SPEED / LEG)
    points, north, lane, heading = [(0.0, 0.0)], 0.0, 0.0, 1.0
    for k in range(count):
        if k % 11 == 10:
            lane, heading = lane + 1500.0, -heading
        else:
            north += heading * LEG
        points.append((lane, north))
    return np.array([(*point, 500.0) for point in points])


def zone_tables(points: np.ndarray, count: int, corners: int) -> list[dict[str, Any]]:
    """Make star-shaped zones next to the legs; one in fifty extends over its leg."""
    rng, tables = np.random.default_rng(SEED), []
    for k in range(count):
        leg = int(rng.integers(1, len(points) - 1))
        a, b = points[leg, :2], points[leg + 1, :2]
        along, side = float(rng.uniform(0.2, 0.8)), float(rng.choice([-1.0, 1.0]))
        right = np.array([(b - a)[1], -(b - a)[0]]) / np.hypot(*(b - a))
        size = float(rng.uniform(60.0, 300.0))
        off = size + float(rng.uniform(20.0, 150.0)) if k % 50 else 0.5 * size
        centre = a + along * (b - a) + side * off * right
        bearing = (np.arange(corners) + rng.uniform(0.0, 0.8, corners)) * 2.0 * math.pi / corners
        radius = size * rng.uniform(0.6, 1.0, corners)
        ring = centre + radius[:, None] * np.stack([np.sin(bearing), np.cos(bearing)], axis=1)
        band = {} if k % 10 else {"ceiling_agl_m": 900.0}
        tables.append({"name": f"zone {k}", "kind": "exclusion", "polygon_m": ring.tolist(), **band})
    return tables


def setup_of(hours: float, zones: list[dict[str, Any]], points: np.ndarray) -> FlightSetup:
    """Make the setup of the flight, over hills of up to 200 m."""
    rng = np.random.default_rng(SEED)
    spots = points[rng.integers(0, len(points), 25), :2] + rng.uniform(-900.0, 900.0, (25, 2))
    peaks = [{"east_m": float(e), "north_m": float(n), "height_m": 200.0, "sigma_m": 600.0} for e, n in spots]
    setup = make_setup(points, terrain={"kind": "peaks", "peak": peaks}, area_margin=3000.0)
    spec = setup.scenario.to_json() | ({"zones": zones} if zones else {})
    return replace(setup, scenario=scenario_from_spec(spec, "bench", ground=setup.scenario.terrain))


def run(count: int = ZONES, corners: int = CORNERS, hours: float = 1.0) -> dict[str, float]:
    """Measure, print, and return seconds by name."""
    points = flown_path(hours)
    tables = zone_tables(points, count, corners)
    record: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, zones in (("without zones", []), ("with zones", tables)):
            setup = setup_of(hours, zones, points)
            track = fly_path(setup)
            path = Path(folder) / f"{name}.mcap"
            recorder = Recorder(path, setup)
            recorder.write(track)
            recorder.finish("completed", judge_flight(setup, track, "completed"), None)
            log = read_log(path)
            work = {
                f"read, {name}": lambda path=path: read_log(path),
                f"judge, {name}": lambda log=log: judge_flight(log.setup, log.track, "completed"),
            }
            for part, done in work.items():
                record[part], record[f"{part}, CPU"] = median_time(done, 3), median_cpu(done, 3)
            verdict = judge_flight(log.setup, log.track, "completed")
            found = [item for item in verdict.findings if item.rule == "fence"]
            record[f"violated, {name}"] = float(sum(item.ok is False for item in found))
            record["rows"] = float(len(log.track))
    for kind in ("", ", CPU"):
        record[f"check{kind}"] = record[f"read, with zones{kind}"] + record[f"judge, with zones{kind}"]
    print(f"\nCheck of a log of {record['rows']:,.0f} rows, {count:,} zones of {corners} corners")
    for name, value in record.items():
        print(f"  {name:28} {value:8.2f}")
    return record


def main() -> None:
    """Measure with the options of the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--zones", type=int, default=ZONES)
    parser.add_argument("--corners", type=int, default=CORNERS)
    parser.add_argument("--hours", type=float, default=1.0)
    args = parser.parse_args()
    run(args.zones, args.corners, args.hours)


if __name__ == "__main__":
    main()
