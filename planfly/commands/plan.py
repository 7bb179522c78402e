"""``planfly plan``: plan a path, within a budget or until Ctrl-C, from the start or in flight."""

import argparse
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

from planfly.terminal.arguments import file_completer, number_parser, parse_budget, parse_threat, with_completer
from planfly.terminal.command_parser import FLYABLE, NOT_FLYABLE, LineParser
from planfly.terminal.dispersed_flights import check_flights_option, fly_dispersed
from planfly.terminal.options import (
    add_aircraft_and_wind_options,
    add_autopilot_options,
    add_flights_option,
    add_result_options,
    add_scenario_argument,
    given_options,
)
from planfly.terminal.output import print_warnings, write_json_if_requested
from planfly.workflow.output_paths import RUN_FOLDER, expand_path_pattern
from world.errors import ScenarioError
from world.interruption import interrupt

if TYPE_CHECKING:
    from pathlib import Path

    from planfly import Plan
    from planfly.terminal.answers import DispersedFlights


def add_plan_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly plan``."""
    parser = command_line.add_command(
        "plan",
        "plan a path, or plan again in flight, without flying it",
        "planfly plan jacksboro --seed 3 --out plan.json",
        "planfly plan jacksboro --from plan.json --at-leg 4 --add-threat -2000,1500,800,1500",
        "planfly plan hard-30 --front 20 --out front",
    )
    parser.extra_help = _algorithms_help
    parser.alias_keyword("seconds", "--budget")
    add_scenario_argument(parser, help="TOML file, or name of a built-in scenario")
    planning_group = parser.add_group("planning")
    planning_group.add_argument(
        "--seed", metavar="N", type=number_parser("seed"), help="seed of the planner (default: the scenario's, or 1)"
    )
    planning_group.add_argument(
        "--algorithm", metavar="A", help="algorithm of the planner, listed below (default: the scenario's)"
    )
    planning_group.add_argument(
        "--budget",
        metavar="N|Xs",
        type=parse_budget,
        help="stop after N evaluations, or after X seconds (such as 10s), and keep the best plan so far, as Ctrl-C "
        "does. With a budget in seconds, the plan may differ from run to run",
    )
    planning_group.add_argument(
        "--front",
        metavar="N",
        type=number_parser("front"),
        help=(
            "plan up to N alternatives (2 to 100). None of them is better than another in all four objectives:"
            " length, exposure to radars, height above ground, and energy (or time with [planner] "
            'objective = "time"). --out is then a folder with plan-1.json, plan-2.json and so on, front.csv, '
            "front.json and pictures (default: runs/<name>-seed<N>-front; an existing one is replaced)"
        ),
    )
    add_flights_option(planning_group)
    replanning_group = parser.add_group("planning again in flight")
    with_completer(
        replanning_group.add_argument("--from", dest="old", metavar="PLAN.json", help="plan to change in flight"),
        file_completer("json"),
    )
    replanning_group.add_argument(
        "--at-leg", metavar="K", type=number_parser("at_leg"), help="number of the next leg; earlier legs are kept"
    )
    replanning_group.add_argument(
        "--add-threat",
        dest="threats",
        metavar="EAST,NORTH,KILL,DETECTION",
        type=parse_threat,
        action="append",
        help="a new threat: position east and north, kill radius and detection radius, all in m; repeatable",
    )
    add_aircraft_and_wind_options(parser)
    add_autopilot_options(parser)
    add_result_options(
        parser, "the plan file (default: runs/<name>-seed<N>/plan.json; an existing one is replaced)", "FILE"
    )


def _algorithms_help() -> str:
    """Return the help text that lists the algorithms."""
    from planner.search.algorithms import algorithm_lines

    return f"algorithms:\n{algorithm_lines()}"


def plan(args: argparse.Namespace) -> int:
    """Plan a path, and write the plan file; with --front, plan a Pareto front.

    Returns the exit code: 0, or 4 if the plan is not safe, or if too few of the flights of --flights are flyable.
    """
    from planfly.api import planning

    # The options for planning in flight are allowed only together.
    if args.old is None:
        for option in ("at_leg", "threats"):
            if (value := getattr(args, option)) is not None:
                allowed = "allowed only with `old` PLAN.json, the plan that is being flown"
                raise ScenarioError.of_argument(option, value, allowed, shown="")
    elif args.at_leg is None:
        allowed = "`at_leg` K is missing; it names the leg that is flown next"
        raise ScenarioError.of_argument("old", args.old, allowed, shown="")
    check_flights_option(args, "front")
    if args.front is not None:
        return _plan_front(args)
    name = "plan.json" if args.old is None else "replan.json"
    out = f"{RUN_FOLDER}/{name}" if args.out is None else args.out
    evaluations, seconds = args.budget or (None, None)
    with _stop_on_interrupt() as should_stop:
        make_plan: Callable[..., Plan] = planning.plan if args.old is None else planning.replan
        options = given_options(
            args, make_plan, budget=evaluations, seconds=seconds, out=out, overwrite=args.overwrite or args.out is None
        )
        new_plan = make_plan(**options, stop=should_stop)
    from planfly.api.planning import what_may_fail

    target = expand_path_pattern(out, new_plan.scenario.name, new_plan.seed)
    print_warnings(new_plan.scenario.notes)
    risks = what_may_fail(new_plan)
    _print_plan(new_plan, risks, is_dispersed=args.flights is not None)
    print(f"plan      {target}")
    dispersed = fly_dispersed(args, new_plan) if new_plan.feasible else None
    code = FLYABLE if new_plan.safe and (dispersed is None or dispersed.holds) else NOT_FLYABLE
    write_json_if_requested(args, lambda: _json_answer(new_plan, target, code, risks, dispersed))
    return code


def _plan_front(args: argparse.Namespace) -> int:
    """Plan a Pareto front, and write its folder; return the exit code: 0, or 4 if there is no safe plan."""
    from planfly.api import fronts
    from planfly.api.fronts import FRONT_FOLDER
    from planfly.terminal.plan_answers import front_answer, front_lines

    for name in ("old", "algorithm"):
        if (value := getattr(args, name)) is not None:
            raise ScenarioError.of_argument(name, value, "cannot be combined with `front` N, which has its own search")
    evaluations, seconds = args.budget or (None, None)
    if evaluations is not None:
        allowed = "with `front` N the budget is a number of seconds, such as 10s"
        raise ScenarioError.of_argument("budget", evaluations, allowed)
    out = FRONT_FOLDER if args.out is None else args.out
    with _stop_on_interrupt() as should_stop:
        front = fronts.plan_front(
            **given_options(
                args,
                fronts.plan_front,
                count=args.front,
                seconds=seconds,
                out=out,
                overwrite=args.overwrite or args.out is None,
                stop=should_stop,
            )
        )
    default_plan = front.default.plan
    folder = expand_path_pattern(out, default_plan.scenario.name, default_plan.seed)
    print_warnings(default_plan.scenario.notes)
    print("\n".join(front_lines(front, folder)))
    code = FLYABLE if front.plans else NOT_FLYABLE
    write_json_if_requested(args, lambda: front_answer(front, folder, code))
    return code


def _json_answer(
    plan: "Plan", target: "Path", code: int, risks: tuple[str, ...], dispersed: "DispersedFlights | None"
) -> object:
    """Return the answer of ``planfly plan`` for --json.

    target: file of the plan.
    code: exit code.
    risks: known causes of failures in dispersed flights.
    dispersed: result of the dispersed flights; None if none were flown.
    """
    from planfly.api.planning import conditions_of_plan
    from planfly.terminal.plan_answers import PlanAnswer

    return PlanAnswer(
        exit_code=code,
        scenario=plan.scenario.name,
        seed=plan.seed,
        file=str(target),
        safe=plan.safe,
        feasible=plan.feasible,
        waypoints=len(plan.waypoints),
        length_ratio=plan.objectives.length_ratio,
        algorithm=plan.algorithm,
        evaluations=plan.evaluations,
        ended=plan.ended,
        problems=list(plan.certificate.problems),
        expected_failures=list(risks),
        dispersed=dispersed,
        conditions=conditions_of_plan(plan),
    )


@contextmanager
def _stop_on_interrupt() -> Iterator[Callable[[], bool]]:
    """Yield a function that returns True after Ctrl-C, to stop a search; a second Ctrl-C ends the command."""
    is_interrupted = False

    def handle_signal(_signal: int, _frame: FrameType | None) -> None:
        """Note the first Ctrl-C; interrupt the command at the second."""
        nonlocal is_interrupted
        if is_interrupted:
            interrupt(signal.SIGINT)
        is_interrupted = True

    previous_handler = signal.signal(signal.SIGINT, handle_signal)
    try:
        yield lambda: is_interrupted
    finally:
        signal.signal(signal.SIGINT, previous_handler)


def _print_plan(plan: "Plan", risks: tuple[str, ...], *, is_dispersed: bool) -> None:
    """Print the properties of a plan.

    risks: known causes of failures in dispersed flights.
    is_dispersed: True if such flights follow.
    """
    from logs.verdict.conditions import autopilot_line, condition_lines
    from planfly.api import planning
    from planfly.api.planning import conditions_of_plan

    state = "safe" if plan.safe else "feasible, but inside a missile's reach" if plan.feasible else "no feasible plan"
    length = plan.objectives.length_ratio
    print(
        f"{state}: {len(plan.waypoints)} waypoints, {length:.3f} times as long as the straight line,"
        f" algorithm {plan.algorithm}"
    )
    conditions = conditions_of_plan(plan)
    print("\n".join([*condition_lines(conditions), autopilot_line(conditions, is_flown=False)]))
    if plan.feasible and not is_dispersed:
        print("Judged: in the scenario's wind and over its terrain, without dispersions (--flights 40 flies with them)")
    if plan.ended != "completed":
        reason = "at its budget" if plan.ended == "budget" else "by Ctrl-C"
        print(
            f"  note    the search ended {reason}, after {plan.evaluations:,} evaluations; this is the best plan so far"
        )
    if plan.flown_legs:
        print(
            f"  note    legs 0..{plan.flown_legs - 1} are already flown and unchanged;"
            " only the legs after them are judged"
        )
    for problem in plan.certificate.problems:
        print(f"  failed  {problem}")
    for note in (*planning.what_blocks(plan), *risks):
        print(f"  note    {note}")
