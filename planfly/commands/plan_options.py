"""Planning at the command line: budgets, Ctrl-C with the best plan so far, and planning again in flight."""

import argparse
import math
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from planfly.airframe import Airframe
from planner.plan import Objective, Plan, read_plan
from planner.search.explain_failure import what_blocks
from planner.search.plan_path import plan_path
from planner.search.replan import replan, same_mission
from planner.search.search_state import Stop
from world.errors import ScenarioError
from world.scenario import Scenario
from world.scenario_variants import with_planner, with_threats

if TYPE_CHECKING:
    from planfly.pipeline import Advance


@contextmanager
def best_so_far(seconds: float | None) -> Iterator[Stop]:
    """Give what a search asks between generations: "interrupted" after Ctrl-C, "budget" after so many seconds.

    A second Ctrl-C ends the process.
    """
    deadline = None if seconds is None else time.monotonic() + seconds
    pressed = False

    def press(_signal: int, _frame: FrameType | None) -> None:
        nonlocal pressed
        pressed = True
        # Python's own handler would wait again for compiled code to come back.
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    def stop() -> str:
        if pressed:
            return "interrupted"
        return "budget" if deadline is not None and time.monotonic() >= deadline else ""

    before = signal.signal(signal.SIGINT, press)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)


def prepare(args: argparse.Namespace, scenario: Scenario) -> tuple[Scenario, Plan | None]:
    """Scenario with what the command line adds to it, and the plan to start from, if any.

    Threats that the old plan knew stay known.  Raises ScenarioError or MissionError.
    """
    evaluations, _ = args.budget if args.budget else (None, None)
    if evaluations is not None:
        scenario = with_planner(scenario, "--budget", budget=evaluations)
    if args.old is None:
        if args.at_leg is not None or args.add_threat:
            option = "--at-leg" if args.at_leg is not None else "--add-threat"
            raise ScenarioError(f"{option}: only with --from PLAN.json, the plan that is being flown")
        return scenario, None
    if args.at_leg is None:
        raise ScenarioError("--from: --at-leg K is missing: the leg that is about to be flown")
    old = read_plan(Path(args.old))
    same_mission(scenario, old)
    for east, north, _, _ in args.add_threat or ():
        if scenario.terrain is not None and math.isnan(scenario.terrain.height(east, north)):
            raise ScenarioError(f"--add-threat: east {east:g} m, north {north:g} m: outside the terrain that is known")
    kept = [table for table in old.scenario.spec.threats if table not in scenario.spec.threats]
    return with_threats(scenario, args.add_threat or [], "--add-threat", kept), old


def make_plan(
    args: argparse.Namespace, scenario: Scenario, old: Plan | None, airframe: Airframe, seed: int, advance: "Advance"
) -> Plan:
    """Plan as the command line asks."""
    limits = airframe.limits
    with best_so_far(args.budget[1] if args.budget else None) as stop:
        if old is None:
            return plan_path(scenario, limits, seed=seed, algorithm=args.algorithm, progress=advance, stop=stop)
        return replan(
            scenario, limits, old, args.at_leg, seed=seed, algorithm=args.algorithm, progress=advance, stop=stop
        )


def print_plan(plan: Plan) -> None:
    """A plan on the terminal."""
    state = "safe" if plan.safe else "feasible, but inside a missile's reach" if plan.feasible else "no feasible plan"
    length = float(plan.objectives[Objective.LENGTH_RATIO])
    print(f"{state}: {len(plan.waypoints)} waypoints, {length:.3f} times the straight line, algorithm {plan.algorithm}")
    if plan.ended != "completed":
        why = "at its budget" if plan.ended == "budget" else "by Ctrl-C"
        print(f"  note    the search was ended {why}, after {plan.evaluations:,} evaluations: the best plan so far")
    if plan.flown_legs:
        print(f"  note    legs 0..{plan.flown_legs - 1} are flown and kept; judged is what follows them")
    for problem in plan.certificate.problems:
        print(f"  failed  {problem}")
    if not plan.feasible:
        for line in what_blocks(plan):
            print(f"  note    {line}")
