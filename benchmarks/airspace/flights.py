"""Fly default plans among zones and in a height band with the model of ArduPlane, and count violations.

``python -m benchmarks.airspace.flights [--plans N] [--from NUMBER]`` plans the random scenarios of
`benchmarks.airspace.scenarios`, flies each, and prints the margins of plan and flight, and at the end the numbers of
plans and of violations.
"""

import argparse
import math
import time
from dataclasses import dataclass

import numpy as np

from benchmarks.airspace.scenarios import airspace_scenario, ring_distance
from flight.mission.from_plan import plan_mission
from planfly.workflow.make_plan import make_plan
from planfly.workflow.open_flight import make_setup
from planfly.workflow.pipeline import fly_and_judge
from planfly.workflow.uav import load_uav
from world.arrays import Floats
from world.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Kept:
    """Margins of positions, m: negative if violated.

    low, high: to the band's lower and upper edge.  zones: to the nearest zone, on the map or in height.
    """

    low: float
    high: float
    zones: float

    @property
    def least(self) -> float:
        """Smallest of the margins."""
        return min(self.low, self.high, self.zones)


@dataclass(frozen=True, slots=True)
class Flown:
    """Plan and its flight: fault, "" without one; margins; and planning time, s."""

    wrong: str
    kept: Kept | None
    seconds: float


def kept_by(scenario: Scenario, position: Floats) -> Kept:
    """Compute the margins of positions (n, 3) to a scenario's band and zones from its tables."""
    terrain, limits = scenario.terrain, scenario.limits
    assert terrain is not None
    assert limits.max_height_m is not None
    over = position[:, 2] - terrain.height(position[:, 0], position[:, 1])
    zones = []
    for zone in scenario.spec.zones or ():
        if zone.radius_m is not None:
            away = np.hypot(position[:, 0] - zone.east_m, position[:, 1] - zone.north_m) - zone.radius_m
        else:
            away = ring_distance(np.array(zone.polygon_m), position[:, :2])
        if zone.kind == "inclusion":
            zones.append(float(-away.max()))
            continue
        if zone.floor_agl_m is not None:
            away = np.maximum(away, zone.floor_agl_m - over)
        if zone.ceiling_agl_m is not None:
            away = np.maximum(away, over - zone.ceiling_agl_m)
        zones.append(float(away.min()))
    return Kept(
        float(over.min()) - limits.min_clearance_m,
        limits.max_height_m - float(over.max()),
        min(zones, default=math.inf),
    )


def fly(number: int) -> Flown:
    """Plan and fly the scenario of this number, and print a line about it."""
    scenario = airspace_scenario(number)
    uav = load_uav(scenario)
    before = time.perf_counter()
    plan = make_plan(scenario, uav, number + 1)
    seconds = time.perf_counter() - before
    name = f"{scenario.name:15s} {len(scenario.zones):2d} zones, {len(plan.waypoints)} waypoints, {seconds:4.1f} s"
    if not plan.safe:
        print(f"{name}  no plan: {'; '.join(plan.certificate.problems[:3])}", flush=True)
        return Flown("no plan", None, seconds)
    mission = plan_mission(plan, uav.airspeed, uav.max_bank, tracking=uav.limits.tracking)
    setup = make_setup(scenario, uav, mission, number + 1, plan=plan)
    judged = fly_and_judge(setup)
    kept = kept_by(scenario, judged.track.position)
    parts = ["" if judged.ended == "completed" else judged.ended, "" if kept.least >= 0.0 else "not inside"]
    parts += [f"{found.rule}: {found.reason}" for found in judged.verdict.findings if found.ok is False]
    wrong = "; ".join(part for part in parts if part)
    promised = plan.certificate
    print(
        f"{name}  length {plan.objectives[0]:.4f}  above {promised.clearance:5.1f} {kept.low:5.1f}  below"
        f" {promised.headroom:5.1f} {kept.high:5.1f}  zones {promised.zone_distance:6.1f} {kept.zones:6.1f}  {wrong}",
        flush=True,
    )
    return Flown(wrong, kept, seconds)


def main() -> None:
    """Fly, print, and sum up."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.airspace.flights")
    parser.add_argument("--plans", type=int, default=30)
    parser.add_argument("--from", dest="first", type=int, default=0, help="number of the first scenario")
    args = parser.parse_args()
    flown = [fly(number) for number in range(args.first, args.first + args.plans)]
    made = [one.kept for one in flown if one.kept is not None]
    print(
        f"{len(made)} of {len(flown)} planned, {sum(kept.least >= 0.0 for kept in made)} flown inside all,"
        f" {sum(one.wrong == '' for one in flown)} flyable; least kept {min(kept.least for kept in made):.1f} m;"
        f" planned in {np.median([one.seconds for one in flown]):.1f} s (median)"
    )


if __name__ == "__main__":
    main()
