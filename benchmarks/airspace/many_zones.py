"""Time planning among 1,000 zones of 50 corners on the Jacksboro tile.

``python -m benchmarks.airspace.many_zones [--zones N] [--corners N] [--runs N]`` reads the scenario and plans it, each
timed after a first untimed run, and prints the medians.
"""

import argparse
import math
import time
from statistics import median
from typing import Any

import numpy as np

from benchmarks.airspace.scenarios import HALF, SEED, star
from planfly.workflow.make_plan import make_plan
from planfly.workflow.uav import load_uav
from world.scenario import Scenario, scenario_from_spec


def crowded_scenario(zones: int, corners: int) -> Scenario:
    """Make a scenario of 22 km among random exclusions, of which none is within 500 m of its ends."""
    rng = np.random.default_rng([SEED, zones, corners])
    ends = np.array([[-9000.0, -6000.0], [9000.0, 6500.0]])
    made: list[dict[str, Any]] = []
    while len(made) < zones:
        place, radius = rng.uniform(-0.95 * HALF, 0.95 * HALF, 2), float(rng.uniform(100.0, 300.0))
        if np.linalg.norm(ends - place, axis=1).min() > radius + 500.0:
            ring = star(rng, place, radius, corners, least=0.75)
            made.append({"name": f"zone {len(made) + 1}", "kind": "exclusion", "polygon_m": ring})
    spec: dict[str, Any] = {
        "name": f"{zones} zones",
        "terrain": {"kind": "dem", "path": "jacksboro"},
        "area": {"east_m": [-HALF, HALF], "north_m": [-HALF, HALF], "ceiling_amsl_m": 1300.0},
        "limits": {"min_clearance_m": 60.0},
        "planner": {"waypoints": 30},
        "zones": made,
    }
    for name, place in zip(("start", "destination"), ends, strict=True):
        spec[name] = {"east_m": float(place[0]), "north_m": float(place[1]), "height_m": 150.0}
    return scenario_from_spec(spec, spec["name"])


def main() -> None:
    """Time and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.airspace.many_zones")
    parser.add_argument("--zones", type=int, default=1000)
    parser.add_argument("--corners", type=int, default=50)
    parser.add_argument("--runs", type=int, default=5)
    args = parser.parse_args()
    read, planned, ratio = [], [], math.nan
    for run in range(args.runs + 1):
        begin = time.process_time()
        scenario = crowded_scenario(args.zones, args.corners)
        middle = time.process_time()
        plan = make_plan(scenario, load_uav(scenario), 1)
        if run:
            read.append(middle - begin)
            planned.append(time.process_time() - middle)
        ratio = float(plan.objectives[0]) if plan.safe else math.nan
    print(
        f"{args.zones} zones of {args.corners} corners: made and checked in {median(read):.2f} s,"
        f" planned in {median(planned):.2f} s of CPU (medians of {args.runs}), length ratio {ratio:.4f}"
    )


if __name__ == "__main__":
    main()
