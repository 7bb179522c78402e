"""Compare the model of ArduPlane with ArduPlane itself on the same random plans, in the same wind and gusts.

``python -m benchmarks.against_arduplane [--plans N] [--from SEED] [--steep] [--json FILE] [--keep FILE]`` plans
across the ridges near Jacksboro (random ends, winds of 0 to 10 m/s from any direction, light or moderate turbulence),
flies each plan with the model and with the program that PLANFLY_ARDUPLANE names (default: ``arduplane`` in the working
folder), and prints the overshoots of both at all sufficiently sharp corners, and the ground clearance of both.
--steep plans climbs at full throttle; other plans leave a part of it for gusts.  --keep writes the program's flights,
with their missions, in the form of `tests.authorities`.
"""

import argparse
import hashlib
import json
import math
import os
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane_sitl.autopilot import ArduPlaneSitl
from flight.autopilots.arduplane_sitl.flight import fly_autopilot
from flight.mission.from_plan import plan_mission
from flight.mission_files.formats import mission_text
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.track import Track
from planfly.workflow.make_plan import make_plan
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import Uav, load_uav
from planner.evaluation.problem import SLOPE_FRACTION_BY_TURBULENCE
from world.arrays import Floats
from world.errors import ScenarioError
from world.scenario import Scenario, load_scenario, scenario_from_spec

# Program of a real ArduPlane; without the variable, the one in the working folder.
BINARY = Path(os.environ.get("PLANFLY_ARDUPLANE", "arduplane"))
# Smallest turn of a compared corner, rad.
MIN_TURN = math.radians(10.0)
# Shortest leg after a compared corner, m.
MIN_LEG = 250.0
# Fraction of the leg after a corner that is used; the next corner begins on the rest.
LOOKED_AT = 0.75
# Climb rate of plans as a fraction of TECS_CLMB_MAX; turbulence reduces it further.
PLANNED_CLIMB = 0.9
# Spacing along the legs at which two tracks are compared, m.
STEP = 20.0
# Allowed range of the median ratio of overshoots.
RATIO_MEDIAN = (0.95, 1.05)
# Allowed range of the spread of the ratios.
RATIO_SPREAD = (0.8, 1.25)
# Allowed difference of clearances, m.
CLEARANCE = 3.0


@dataclass(frozen=True, slots=True)
class Corner:
    """Flown corner: turn (degrees), and how far the flight overshot the leg after it, m."""

    waypoint: int
    turn_deg: float
    overshoot: float


@dataclass(frozen=True, slots=True)
class Flown:
    """Figures of a flight: smallest clearance, extremes of altitude error, largest cross-track error, m."""

    ended: str
    clearance: float
    height_error: tuple[float, float]
    off_legs: float
    corners: tuple[Corner, ...]


@dataclass(frozen=True, slots=True)
class Compared:
    """Flights of one plan by the model and by ArduPlane, and the distance between both.

    law, real: figures of the model's flight and of ArduPlane's.
    apart_across, apart_up: RMS and largest distance across the legs and in altitude, m.
    """

    seed: int
    wind: float
    turbulence: str
    law: Flown
    real: Flown
    apart_across: tuple[float, float]
    apart_up: tuple[float, float]


def random_setup(seed: int, *, steep: bool = False) -> tuple[FlightSetup, Uav]:
    """Make the first feasible plan between random ends in a random wind.

    The plan is for ArduPlane with exact navigation.

    The same seed gives the same plan.  steep: True to allow the climbs of `_climbing`.
    """
    for draw in range(50):
        rng = np.random.default_rng([seed, draw])
        spec: dict[str, Any] = load_scenario("jacksboro-air").to_json()
        side = 1.0 if rng.random() < 0.5 else -1.0
        for end, sign in (("start", side), ("destination", -side)):
            spec[end] = {
                "east_m": round(float(sign * rng.uniform(5000.0, 10_500.0))),
                "north_m": round(float(rng.uniform(-7500.0, 7500.0))),
                "height_m": 150.0,
            }
        spec["wind"] = {
            "speed_mps": round(float(rng.uniform(0.0, 10.0)), 1),
            "from_deg": round(float(rng.uniform(0.0, 360.0))),
            "turbulence": ("light", "moderate")[int(rng.integers(2))],
        }
        spec["flight"] = {"autopilot": "ardupilot", "nav": "perfect"}
        try:
            scenario = scenario_from_spec(spec, f"random {seed}")
            uav = load_uav(scenario)
            plan = make_plan(scenario, _climbing(uav, scenario) if steep else uav, seed)
        except ScenarioError:  # an end within a missile's reach
            continue
        if plan.feasible:
            mission = plan_mission(plan, uav.airspeed, uav.max_bank)
            return make_setup(scenario, uav, mission, seed), uav
    raise ValueError(f"seed {seed}: no feasible plan")


def _climbing(uav: Uav, scenario: Scenario) -> Uav:
    """Return a UAV whose plans climb more steeply than ArduPlane's plans in turbulence.

    The throttle then saturates at times, which is the hardest case for the control law.
    """
    limits, parameters = uav.limits, uav.autopilot.parameters
    assert limits.tracking is not None
    assert isinstance(parameters, ArduPilotParameters)
    rate = PLANNED_CLIMB * SLOPE_FRACTION_BY_TURBULENCE[scenario.wind.turbulence] * parameters.tecs_climb_max
    return replace(uav, limits=replace(limits, tracking=replace(limits.tracking, climb_rate=rate)))


def _legs(setup: FlightSetup) -> tuple[Floats, Floats, Floats]:
    """Return starts (l, 2), unit courses (l, 2) and lengths (l,) of a route's legs, m."""
    points = setup.route.positions[:, :2]
    steps = np.diff(points, axis=0)
    runs = np.hypot(steps[:, 0], steps[:, 1])
    return points[:-1], steps / runs[:, np.newaxis], runs


def _along_legs(setup: FlightSetup, track: Track) -> tuple[Floats, Floats]:
    """Return cross-track distance (right positive) and altitude at steps along every leg, m, (n,) each."""
    across, up = [], []
    begin = 0
    for start, course, run in zip(*_legs(setup), strict=True):
        rows = track.position[begin:]
        along = (rows[:, :2] - start) @ course
        # The leg begins when the flight is first abeam of its start and ends when it is abeam of its end.
        first = int(np.argmax(along >= 0.0))
        last = first + int(np.argmax(along[first:] >= run)) if (along[first:] >= run).any() else len(along) - 1
        stretch = np.maximum.accumulate(along[first : last + 1])
        right = (rows[first : last + 1, :2] - start) @ np.array([course[1], -course[0]])
        at = np.arange(STEP, run - STEP, STEP)
        if len(stretch) > 1 and len(at):
            across.append(np.interp(at, stretch, right))
            up.append(np.interp(at, stretch, rows[first : last + 1, 2]))
        begin += first
    return np.concatenate(across), np.concatenate(up)


def flown_figures(setup: FlightSetup, track: Track, ended: str) -> Flown:
    """Return the figures of one flight."""
    across, _ = _along_legs(setup, track)
    error = track.height_error
    # Overshoot at each corner that is sharp enough and has a long enough leg after it.
    starts, courses, runs = _legs(setup)
    corners = []
    for i in range(1, len(runs)):
        turn = math.atan2(
            courses[i - 1, 0] * courses[i, 1] - courses[i - 1, 1] * courses[i, 0], float(courses[i - 1] @ courses[i])
        )
        if abs(turn) < MIN_TURN or runs[i] < MIN_LEG:
            continue
        away = track.position[:, :2] - starts[i]
        passed = int(np.argmin(np.hypot(away[:, 0], away[:, 1])))
        along = away[passed:] @ courses[i]
        left = away[passed:] @ np.array([-courses[i, 1], courses[i, 0]])
        on_leg = (along > 0.0) & (along < LOOKED_AT * runs[i])
        # A turn to the left (positive here) overshoots to the right.
        over = float((-math.copysign(1.0, turn) * left[on_leg]).max()) if on_leg.any() else math.nan
        corners.append(Corner(i, -math.degrees(turn), over))
    return Flown(
        ended,
        float(np.nanmin(track.clearance)),
        (float(error.min()), float(error.max())),
        float(np.abs(across).max()),
        tuple(corners),
    )


def compare(seed: int, *, steep: bool = False) -> tuple[Compared, FlightSetup]:
    """Fly one random plan with ArduPlane and with its model."""
    setup, uav = random_setup(seed, steep=steep)
    law = fly_to_end(Flight(setup, uav.aircraft))
    assert isinstance(setup.autopilot, ArduPlane)
    autopilot = ArduPlaneSitl.with_model(setup.autopilot, BINARY)
    real, _ = fly_autopilot(setup, uav.aircraft, autopilot)
    (law_across, law_up), (across, up) = (_along_legs(setup, flown.track) for flown in (law, real))
    wind = setup.scenario.wind
    compared = Compared(
        seed,
        wind.speed,
        wind.turbulence,
        flown_figures(setup, law.track, law.ended),
        flown_figures(setup, real.track, real.ended),
        _differences(law_across - across),
        _differences(law_up - up),
    )
    return compared, setup


def _differences(values: Floats) -> tuple[float, float]:
    """Return the RMS and the largest absolute value of differences."""
    return math.sqrt(float((values**2).mean())), float(np.abs(values).max())


def summary(all_compared: list[Compared]) -> dict[str, Any]:
    """Return the ratios of overshoots and the differences of clearances, over all plans."""
    ratios = [
        law.overshoot / real.overshoot
        for one in all_compared
        for law, real in zip(one.law.corners, one.real.corners, strict=True)
    ]
    clearance = [one.law.clearance - one.real.clearance for one in all_compared]
    low, median, high = (float(value) for value in np.nanpercentile(ratios, (5.0, 50.0, 95.0)))
    return {
        "plans": len(all_compared),
        "corners": len(ratios),
        "overshoot ratio, median": median,
        "overshoot ratio, 5 to 95 %": (low, high),
        "least clearance, model minus ArduPlane, m": (min(clearance), max(clearance)),
        "apart across, RMS and most, m": [max(one.apart_across[k] for one in all_compared) for k in (0, 1)],
        "apart in height, RMS and most, m": [max(one.apart_up[k] for one in all_compared) for k in (0, 1)],
        "completed, model and ArduPlane": [
            sum(flown.ended == "completed" for flown in (one.law if k else one.real for one in all_compared))
            for k in (1, 0)
        ],
    }


def kept_flight(compared: Compared, setup: FlightSetup) -> dict[str, Any]:
    """Return the record of a real flight for `tests.authorities`: program, scenario, mission and figures."""
    return {
        "arduplane_sha256": hashlib.sha256(BINARY.read_bytes()).hexdigest(),
        "seed": setup.seed,
        "scenario": setup.scenario.to_json(),
        "mission": mission_text(setup.mission, "waypoints"),
        "real": asdict(compared.real),
    }


def main() -> None:
    """Compare, print, and write the results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.against_arduplane")
    parser.add_argument("--plans", type=int, default=40)
    parser.add_argument("--from", dest="first", type=int, default=1, help="seed of the first plan")
    parser.add_argument("--steep", action="store_true", help="plan climbs at full throttle")
    parser.add_argument("--json", default="runs/against-arduplane.json", help="file for the figures")
    parser.add_argument("--keep", help="file for ArduPlane's flights, for tests")
    args = parser.parse_args()
    found, kept = [], []
    for seed in range(args.first, args.first + args.plans):
        begun = time.monotonic()
        compared, setup = compare(seed, steep=args.steep)
        law, real = compared.law, compared.real
        over = " ".join(
            f"{corner.turn_deg:.0f}°:{corner.overshoot:.1f}/{other.overshoot:.1f}"
            for corner, other in zip(law.corners, real.corners, strict=True)
        )
        print(
            f"{compared.seed:4d} {compared.wind:4.1f} {compared.turbulence:8s}"
            f" clearance {law.clearance:6.1f} {real.clearance:6.1f} {law.clearance - real.clearance:+.1f}"
            f" height {law.height_error[0]:.1f}..{law.height_error[1]:.1f}"
            f" {real.height_error[0]:.1f}..{real.height_error[1]:.1f}"
            f" apart {compared.apart_across[0]:.2f} {compared.apart_up[0]:.2f}  {over}"
            f"  {time.monotonic() - begun:.0f} s",
            flush=True,
        )
        found.append(compared)
        kept.append(kept_flight(compared, setup))
    figures = summary(found)
    for name, value in figures.items():
        print(f"{name}: {value}")
    target = Path(args.json)
    target.parent.mkdir(parents=True, exist_ok=True)
    record = {"figures": figures, "flights": [asdict(one) for one in found]}
    target.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    if args.keep:
        Path(args.keep).write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
