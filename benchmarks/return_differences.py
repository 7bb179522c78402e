"""Compare returns of the point mass with the same returns flown by the simulated autopilot in six degrees of freedom.

``python -m benchmarks.return_differences [--returns N] [--autopilot NAME]``: flies the plan of `jacksboro-air` with
four aircraft in three winds, draws N returns in all (300) from places where the aircraft is level and steady, and
prints the differences of least clearance and of least distance outside a kill sphere: six degrees of freedom minus
point mass.  The lead-in to each return is straight, so that returns which begin in a turn are not compared.  A return
that begins with its back to its target may turn to either side; such returns are counted apart in the distances outside
kill spheres.
"""

import argparse
import json
import math
from pathlib import Path

import numpy as np

import planfly
from logs.verdict.returns.judge_returns import (
    POINT_MASS_ERROR_M,
    POINT_MASS_POSITION_ERROR_M,
    SimulatedReturn,
    can_start_in_jsbsim,
    judge_returns,
    make_return_world,
)
from logs.verdict.returns.return_starts import flown_starts
from planfly.rtl.jsbsim_returns import fly_return
from world.arrays import Floats
from world.kernels import Record

# Airspeed of each aircraft, m/s.
CRUISE_MPS = {"aerosonde": 25.0, "x8": 18.0, "zagi": 15.0, "ultrastick25e": 17.0}
# Wind speed, m/s, and direction the wind blows from, degrees.
WINDS = ((0.0, 0.0), (5.0, 250.0), (8.0, 90.0))
# Interval of the places among which returns are drawn, s.
_INTERVAL_S = 1.0
_SEED = 67
# First turn from which a return may turn to either side, degrees.
_AMBIGUOUS_TURN_DEG = 170.0
_TARGET = Path("runs") / "return-differences.json"


def compare_returns(
    aircraft: str, wind: tuple[float, float], count: int, seed: int, autopilot: str
) -> list[tuple[float, ...]]:
    """Compare the returns of the point mass with those of JSBSim.

    Each row has the start time, clearance and distance outside a sphere of both, and the first turn.

    The turn is the angle between the start's course and the bearing of the target, degrees, 0 to 180.  Returns that
    cannot be flown in JSBSim are omitted.
    """
    flown = planfly.fly(
        planfly.plan("jacksboro-air", seed=1),
        aircraft=aircraft,
        airspeed=CRUISE_MPS[aircraft],
        wind=wind,
        turbulence="none",
        autopilot=autopilot,
    )
    world, starts = make_return_world(flown.setup), flown_starts(flown.setup, flown.track, _INTERVAL_S)
    reachable = np.array([k for k in range(len(starts)) if can_start_in_jsbsim(world, starts.rows[k])])
    chosen = np.random.default_rng(seed).choice(reachable, size=min(count, len(reachable)), replace=False)
    chosen_starts = starts.subset(np.sort(chosen))
    point_mass = judge_returns(world, chosen_starts, 0.0)
    rows: list[tuple[float, ...]] = []
    for k, ret in enumerate(point_mass.each):
        minima = fly_return(world, chosen_starts.rows[k])
        if minima is not None:
            rows.append((ret.time, ret.clearance, ret.sphere_distance, *minima, first_turn(chosen_starts.rows[k], ret)))
    return rows


def first_turn(start: Record, ret: SimulatedReturn) -> float:
    """Return the angle between the course at a start and the bearing of its target, degrees, 0 to 180."""
    course = math.atan2(float(start["velocity_east"]), float(start["velocity_north"]))
    east, north = ret.target.position[0] - ret.start[0], ret.target.position[1] - ret.start[1]
    return abs(math.degrees(math.remainder(math.atan2(east, north) - course, math.tau)))


def describe(name: str, differences: Floats, error: float = POINT_MASS_ERROR_M) -> None:
    """Print quantiles of some differences, m, and the number beyond the stated error."""
    low, median, high = np.quantile(differences, (0.025, 0.5, 0.975))
    print(
        f"{name:34s} {len(differences):4d} returns: {differences.min():+7.1f} to {differences.max():+6.1f} m, "
        f"median {median:+5.1f}, 95 % {low:+6.1f} to {high:+5.1f}; "
        f"beyond {error:.0f} m: {int((np.abs(differences) > error).sum())}",
        flush=True,
    )


def main() -> None:
    """Measure and print, and write all returns to ``runs/return-differences.json``."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.return_differences")
    parser.add_argument("--returns", type=int, default=300)
    parser.add_argument("--autopilot", default="ardupilot")
    args = parser.parse_args()
    cases = [(aircraft, wind) for aircraft in CRUISE_MPS for wind in WINDS]
    found = {}
    for number, (aircraft, wind) in enumerate(cases):
        rows = compare_returns(aircraft, wind, args.returns // len(cases), _SEED + number, args.autopilot)
        found[f"{aircraft}, {wind[0]:.0f} m/s from {wind[1]:.0f}"] = rows
        table = np.array(rows)
        describe(f"{aircraft}, {wind[0]:.0f} m/s from {wind[1]:.0f}: clearance", table[:, 3] - table[:, 1])
    table = np.array([row for rows in found.values() for row in rows])
    above_ground = (table[:, 1] > 0.0) & (table[:, 3] > 0.0)
    describe("all", table[:, 3] - table[:, 1])
    describe("of these above the ground", (table[:, 3] - table[:, 1])[above_ground])
    outside = (table[:, 2] > 0.0) & (table[:, 4] > 0.0) & np.isfinite(table[:, 2]) & np.isfinite(table[:, 4])
    describe("distance outside spheres", (table[:, 4] - table[:, 2])[outside], POINT_MASS_POSITION_ERROR_M)
    sideways = outside & (table[:, 5] < _AMBIGUOUS_TURN_DEG)
    describe("of these turning in one direction", (table[:, 4] - table[:, 2])[sideways], POINT_MASS_POSITION_ERROR_M)
    _TARGET.parent.mkdir(exist_ok=True)
    _TARGET.write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
