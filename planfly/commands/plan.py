"""``planfly plan``: a path alone, within a budget or until Ctrl-C, anew or again in flight."""

import argparse
import math
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from aircraft.path_limits import Limits
from planfly.airframe import Airframe, choose_seed, load_airframe
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE, NOT_FLYABLE
from planfly.terminal.options import scenario_change
from planfly.terminal.output import progress
from planfly.terminal.results import default_folder, named_or_default
from planner.plan import Objective, Plan, plan_json, read_plan
from planner.search.explain_failure import explain_failure
from planner.search.plan_path import plan_path
from planner.search.replan import replan, same_mission
from planner.search.search_state import SearchProgress, StopCondition
from world.errors import ScenarioError
from world.files import write_whole
from world.interruption import interrupt
from world.scenario import Scenario, load_scenario, with_planner, with_threats


def plan(args: argparse.Namespace) -> int:
    """Plan, and write the plan file; 4 where the plan is not safe."""
    scenario, old = _prepare(args, scenario_change(args)(load_scenario(args.scenario)))
    seed = choose_seed(scenario, args.seed)
    default = default_folder(scenario.name, seed) / ("plan.json" if old is None else "replan.json")
    target = named_or_default(args.out, default, args.overwrite, Path(args.scenario))
    airframe = load_airframe(scenario)
    with progress(f"planning {scenario.name}") as advance:
        made = _make_plan(args, scenario, old, airframe, seed, advance)
    target.parent.mkdir(parents=True, exist_ok=True)
    write_whole(target, plan_json(made))
    _print_plan(made, airframe.limits)
    print(f"plan      {target}")
    code = FLYABLE if made.safe else NOT_FLYABLE
    give_answer(args, lambda: _answer(made, target, seed, code))
    return code


def _answer(made: Plan, target: Path, seed: int, code: int) -> object:
    from planfly.terminal.answers.answer_data import PlanAnswer

    return PlanAnswer(
        exit_code=code,
        scenario=made.scenario.name,
        seed=seed,
        file=str(target),
        safe=made.safe,
        feasible=made.feasible,
        waypoints=len(made.waypoints),
        length_ratio=float(made.objectives[Objective.LENGTH_RATIO]),
        algorithm=made.algorithm,
        evaluations=made.evaluations,
        ended=made.ended,
        problems=list(made.certificate.problems),
    )


@contextmanager
def _best_so_far(seconds: float | None) -> Iterator[StopCondition]:
    """Give what a search asks between generations: "interrupted" after Ctrl-C, "budget" after so many seconds.

    A second Ctrl-C ends the command without a plan.
    """
    deadline = None if seconds is None else time.monotonic() + seconds
    pressed = False

    def press(_signal: int, _frame: FrameType | None) -> None:
        nonlocal pressed
        if pressed:
            interrupt(signal.SIGINT)
        pressed = True

    def stop() -> str:
        if pressed:
            return "interrupted"
        return "budget" if deadline is not None and time.monotonic() >= deadline else ""

    before = signal.signal(signal.SIGINT, press)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)


def _prepare(args: argparse.Namespace, scenario: Scenario) -> tuple[Scenario, Plan | None]:
    """Scenario with what the command line adds to it, and the plan to start from, if any.

    Threats that the old plan knew stay known.  Raises ScenarioError or MissionError.
    """
    evaluations, _ = args.budget if args.budget else (None, None)
    if evaluations is not None:
        scenario = with_planner(scenario, "--budget", budget=evaluations)
    if args.old is None:
        if args.at_leg is not None or args.add_threat:
            option, value = ("--at-leg", args.at_leg) if args.at_leg is not None else ("--add-threat", args.add_threat)
            allowed = "only with --from PLAN.json, the plan that is being flown"
            raise ScenarioError(f"{option}: {allowed}", field=option, value=value, allowed=allowed)
        return scenario, None
    if args.at_leg is None:
        message = "--from: --at-leg K is missing: the leg that is about to be flown"
        raise ScenarioError(message, field="--from", value=args.old)
    old = read_plan(Path(args.old))
    same_mission(scenario, old)
    for east, north, _, _ in args.add_threat or ():
        if scenario.terrain is not None and math.isnan(scenario.terrain.height(east, north)):
            message = f"--add-threat: east {east:g} m, north {north:g} m: outside the terrain that is known"
            raise ScenarioError(message, field="--add-threat", value=(east, north))
    kept = [table for table in old.scenario.spec.threats if table not in scenario.spec.threats]
    return with_threats(scenario, args.add_threat or [], "--add-threat", kept), old


def _make_plan(
    args: argparse.Namespace,
    scenario: Scenario,
    old: Plan | None,
    airframe: Airframe,
    seed: int,
    advance: SearchProgress,
) -> Plan:
    """Plan as the command line asks."""
    limits = airframe.limits
    with _best_so_far(args.budget[1] if args.budget else None) as stop:
        if old is None:
            return plan_path(scenario, limits, seed=seed, algorithm=args.algorithm, progress=advance, stop=stop)
        return replan(
            scenario, limits, old, args.at_leg, seed=seed, algorithm=args.algorithm, progress=advance, stop=stop
        )


def _print_plan(made: Plan, limits: Limits) -> None:
    """A plan on the terminal."""
    state = "safe" if made.safe else "feasible, but inside a missile's reach" if made.feasible else "no feasible plan"
    length = float(made.objectives[Objective.LENGTH_RATIO])
    print(f"{state}: {len(made.waypoints)} waypoints, {length:.3f} times the straight line, algorithm {made.algorithm}")
    if made.ended != "completed":
        why = "at its budget" if made.ended == "budget" else "by Ctrl-C"
        print(f"  note    the search was ended {why}, after {made.evaluations:,} evaluations: the best plan so far")
    if made.flown_legs:
        print(f"  note    legs 0..{made.flown_legs - 1} are flown and kept; judged is what follows them")
    for problem in made.certificate.problems:
        print(f"  failed  {problem}")
    if not made.feasible:
        for line in explain_failure(made, limits):
            print(f"  note    {line}")
