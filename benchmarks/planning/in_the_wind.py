"""Compare plans for least time and least energy in a wind of 10 m/s with plans for the shortest path, in flight.

``python -m benchmarks.planning.in_the_wind [--missions N] [--from NUMBER] [--setting TEXT] [--planned] [--json FILE]``
plans missions (`tests.autopilot_plans`: measured and synthetic terrain, ten missiles each) three times, in a wind of
10 m/s at the altitude of the start from a random direction: for length, for time and for energy. Each plan is flown by
the simulated autopilot in JSBSim, and its flight time and energy are compared with the flight of the shortest path.
Settings are the wind's increase with altitude (none; 1 m/s every 100 m, similar to a power law with exponent 1/4
between 100 m and 500 m) and the aircraft (the Aerosonde at 25 m/s, the X8 at 18 m/s).

``--bound`` instead prints two lower bounds of the time relative to the shortest path, for the same wind at every
altitude and ignoring obstacles: straight to the destination at the true airspeed of the ceiling; and the fastest
straight path that climbs to the ceiling and descends again.
"""

import argparse
import json
import time
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from aircraft.path_limits import Limits, PerformanceTable, ground_speed_on
from flight.mission.from_plan import plan_mission
from planfly.workflow.make_plan import make_plan
from planfly.workflow.open_flight import make_setup
from planfly.workflow.pipeline import fly_and_judge
from planfly.workflow.uav import load_uav
from planner.evaluation.travel_cost import make_energy_cost, make_time_cost, path_cost
from tests.autopilot_plans import plan_scenario
from world.arrays import Floats
from world.scenario import Scenario, scenario_from_spec

# Number of the first mission; no other benchmark or test uses numbers this high.
FIRST = 3900
# Seed of the wind directions.
SEED = 3904
# Wind speed, m/s.
WIND = 10.0
SETTINGS: dict[str, dict[str, Any]] = {
    "aerosonde, 1 m/s more every 100 m": {"aircraft": "aerosonde", "gradient": 0.01},
    "aerosonde, same wind at every height": {"aircraft": "aerosonde", "gradient": 0.0},
    "x8, 1 m/s more every 100 m": {"aircraft": "x8", "gradient": 0.01},
    "x8, same wind at every height": {"aircraft": "x8", "gradient": 0.0},
}
OBJECTIVES = ("length", "time", "energy")


@dataclass(frozen=True, slots=True)
class Flown:
    """Plan and its flight.

    seconds, energy: flight time, s, and energy, Wh.
    length_ratio: length of the plan relative to the straight line.
    cpu: CPU time of the plan, s.
    wrong: what went wrong, "" if nothing did.
    """

    seconds: float
    energy: float
    length_ratio: float
    cpu: float
    wrong: str


def mission(number: int, aircraft: str, gradient: float, objective: str) -> Scenario:
    """Return the mission of this number in 10 m/s of wind from its own random direction."""
    spec = plan_scenario(number).to_json()
    spec["wind"] = {
        "speed_mps": WIND,
        "from_deg": float(np.random.default_rng([SEED, number]).uniform(0.0, 360.0)),
        "gradient": gradient,
    }
    spec["flight"]["aircraft"] = aircraft
    spec["planner"]["objective"] = objective
    return scenario_from_spec(spec, spec["name"])


def fly(scenario: Scenario, seed: int, *, planned: bool) -> Flown:
    """Plan a scenario and fly the plan in JSBSim.

    planned: True to compute time and energy from the legs of the plan instead, without a flight.
    """
    uav = load_uav(scenario)
    began = time.process_time()
    plan = make_plan(scenario, uav, seed)
    cpu = time.process_time() - began
    if not plan.safe:
        return Flown(np.nan, np.nan, np.nan, cpu, f"no plan: {'; '.join(plan.certificate.problems[:2])}")
    if planned:
        table = uav.limits.performance()
        values = _by_legs(uav.limits, table, np.array(plan.waypoints))
        return Flown(*values, float(plan.objectives[0]), cpu, "")
    items = plan_mission(plan, uav.airspeed, uav.max_bank, tracking=uav.limits.tracking)
    judged = fly_and_judge(make_setup(scenario, uav, items, seed, plan=plan))
    wrong = [] if judged.ended == "completed" else [judged.ended]
    wrong += [f"{found.rule}: {found.reason}" for found in judged.verdict.findings if found.ok is False]
    seconds, energy = float(judged.track.time[-1]), float(judged.track.energy.max())
    return Flown(seconds, energy, float(plan.objectives[0]), cpu, "; ".join(wrong))


def _by_legs(limits: Limits, table: PerformanceTable, path: Floats) -> tuple[float, float]:
    """Return the time (s) and energy (Wh) of a path (w, 3) by its legs."""
    energy = make_energy_cost(limits.envelope, table)
    joules = np.nan if energy is None else path_cost(energy, table, path) / energy.energy
    return path_cost(make_time_cost(table), table, path) / float(table.airspeed), joules / 3600.0


def measure(name: str, first: int, count: int, *, planned: bool) -> list[dict[str, Any]]:
    """Fly every mission in one setting; print a line for each mission, and medians and extremes of the ratios."""
    rows = []
    print(f"\n{name}: ratios to the shortest path")
    for number in range(first, first + count):
        worlds = {goal: mission(number, objective=goal, **SETTINGS[name]) for goal in OBJECTIVES}
        flown = {goal: fly(world, number, planned=planned) for goal, world in worlds.items()}
        rows.append({"mission": number} | {goal: asdict(one) for goal, one in flown.items()})
        short, fast, thrifty = (flown[goal] for goal in OBJECTIVES)
        print(
            f"  {number}  {short.seconds:6.1f} s {short.energy:6.2f} Wh"
            f"   for time: time x {fast.seconds / short.seconds:.4f}"
            f" length x {fast.length_ratio / short.length_ratio:.4f}"
            f"   for energy: energy x {thrifty.energy / short.energy:.4f}"
            f"   {'; '.join(f'{goal}: {one.wrong[:70]}' for goal, one in flown.items() if one.wrong)}",
            flush=True,
        )
    for goal, column in (("time", "seconds"), ("energy", "energy")):
        ratios = np.array([row[goal][column] / row["length"][column] for row in rows])
        ratios = ratios[np.isfinite(ratios)]
        low, middle, high = np.min(ratios), np.median(ratios), np.max(ratios)
        print(f"  {goal} / {goal} of the shortest path: median {middle:.4f}, least {low:.4f}, most {high:.4f}", end="")
        print(f", of {len(ratios)}; {int((ratios > 1.002).sum())} are more than 1.002")
    for goal in OBJECTIVES:
        wrong = sum(row[goal]["wrong"] != "" for row in rows)
        cpu = float(np.median([row[goal]["cpu"] for row in rows]))
        print(f"  for {goal}: {wrong} of {len(rows)} not planned or not flyable; plan {cpu:.2f} s of CPU, median")
    return rows


def bounds(name: str, first: int, count: int) -> Floats:
    """Print and return lower bounds of the flight time, (n, 2).

    They are relative to the time of the shortest path by its legs.

    The columns are the two bounds that the module describes; the rows of missions without a safe plan are NaN.
    """
    assert SETTINGS[name]["gradient"] == 0.0
    ratios, detours = np.full((count, 2), np.nan), np.full(count, np.nan)
    for row, number in enumerate(range(first, first + count)):
        scenario = mission(number, objective="length", **SETTINGS[name])
        uav = load_uav(scenario)
        plan, table = make_plan(scenario, uav, SEED), uav.limits.performance()
        if not plan.safe:
            continue
        seconds, _ = _by_legs(uav.limits, table, np.array(plan.waypoints))
        step = scenario.destination[:2] - scenario.start[:2]
        run, course = float(np.hypot(*step)), float(np.arctan2(*step))
        level = float(0.5 * (scenario.start[2] + scenario.ceiling))
        fastest = run / ground_speed_on(table, course, float(scenario.ceiling))
        # The least time of straight paths that climb, stay level and descend, ignoring obstacles.
        climb, dive = (np.tan(slope) for slope in uav.limits.slopes(course, level))
        start, destination, least = np.array(scenario.start), np.array(scenario.destination), np.inf
        tops = np.linspace(max(start[2], destination[2]), scenario.ceiling, 20)
        for top, share in product(tops, (0.1, 0.2, 0.35, 0.5, 0.75, 1.0)):
            up, down = (top - start[2]) / (share * climb * run), 1.0 - (top - destination[2]) / (share * dive * run)
            if up < down:
                path = start + np.array([0.0, up, down, 1.0])[:, None] * (destination - start)
                path[1:3, 2] = top
                least = min(least, _by_legs(uav.limits, table, path)[0])
        ratios[row] = fastest / seconds, least / seconds
        detours[row] = plan.objectives[0]
        print(f"  {number}  {ratios[row, 0]:.4f}  {ratios[row, 1]:.4f}  length ratio {detours[row]:.4f}", flush=True)
    middle = np.nanmedian(ratios, axis=0)
    print(f"{name}: no path beats {middle[0]:.4f}, nor a straight one {middle[1]:.4f}, medians of {count}")
    print(f"  shortest path / straight line, median {np.nanmedian(detours):.4f}")
    return ratios


def main() -> None:
    """Measure every setting."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planning.in_the_wind")
    parser.add_argument("--missions", type=int, default=20)
    parser.add_argument("--from", dest="first", type=int, default=FIRST, help="number of the first mission")
    parser.add_argument("--json", type=Path, help="file for the rows")
    parser.add_argument("--setting", default="", help="only settings whose name contains this")
    parser.add_argument("--planned", action="store_true", help="by the legs of the plans alone, without flights")
    parser.add_argument("--bound", action="store_true", help="what no path can beat in the same wind at every height")
    args = parser.parse_args()
    if args.bound:
        for name in SETTINGS:
            if args.setting in name and SETTINGS[name]["gradient"] == 0.0:
                bounds(name, args.first, args.missions)
        return
    record = {
        name: measure(name, args.first, args.missions, planned=args.planned)
        for name in SETTINGS
        if args.setting in name
    }
    if args.json:
        args.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
