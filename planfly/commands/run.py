"""``planfly run``: the whole chain into one folder, once or in rounds."""

import argparse
import contextlib
import json
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flight.mission.from_plan import plan_mission
from logs.verdict.findings import Verdict
from logs.verdict.judge_flight import judge_plan_only
from planfly.airframe import Airframe, choose_seed, load_airframe, tightened_airframe
from planfly.crash_safe_log import FlightLimits, flight_text
from planfly.pipeline import fly_and_judge, make_plan, make_setup
from planfly.refine import refine
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE, NOT_FLYABLE
from planfly.terminal.options import autopilot_program, flight_limits, scenario_change
from planfly.terminal.output import progress
from planfly.terminal.results import (
    RUN_FILES,
    default_folder,
    prepare_folder,
    print_verdict,
    refuse_folder,
    write_missions,
    write_pictures,
    write_verdict,
)
from planner.plan import Plan, plan_json
from world.files import hold, write_whole
from world.scenario import Scenario, load_scenario

# Options that decide what is planned and flown, as the line that repeats it has them.
_REPEATED = (
    *("refine", "terrain", "aircraft", "airspeed", "wind", "turbulence", "params", "guidance", "nav", "autopilot"),
)


@dataclass(frozen=True, slots=True)
class _Task:
    """What every round has in common.

    scenario: what each round is judged in.
    airframe: its aircraft.
    command: the line that repeats it, for the report.
    folder: where the results go.
    program: the real autopilot that flies, None for none.
    most: how long it may fly, and how large its log may grow.
    every: of so many rows one goes into the log.
    """

    scenario: Scenario
    airframe: Airframe
    seed: int
    command: str
    folder: Path
    program: Path | None
    most: FlightLimits
    every: int


def run(args: argparse.Namespace) -> int:
    """Plan, export, fly, record, judge and report; with ``--refine N`` up to N rounds more."""
    program = autopilot_program(args)
    scenario = scenario_change(args)(load_scenario(args.scenario, args.terrain))
    seed = choose_seed(scenario, args.seed)
    airframe = load_airframe(scenario)
    folder = Path(args.out) if args.out else default_folder(scenario.name, seed)
    if args.out:
        refuse_folder(folder, args.overwrite)
    line, every = _command_line(args, seed), 60 // args.log_hz
    task = _Task(scenario, airframe, seed, line, folder, program, flight_limits(args), every)
    with contextlib.ExitStack() as held:
        return _rounds(args, task, held)


def _rounds(args: argparse.Namespace, task: _Task, held: contextlib.ExitStack) -> int:
    """Plan and fly until it flies; held: keeps the folder from the first plan on."""
    scenario, airframe, folder, seed = task.scenario, task.airframe, task.folder, task.seed
    cleared = False

    def one_round(planned_in: Scenario) -> tuple[Verdict, bool]:
        nonlocal cleared
        planned_with = airframe if planned_in is scenario else tightened_airframe(airframe, planned_in)
        with progress(f"planning {scenario.name}") as advance:
            plan = make_plan(planned_in, planned_with, seed, advance=advance)
        if not cleared:
            folder.mkdir(parents=True, exist_ok=True)
            held.enter_context(hold(folder))
            prepare_folder(folder)
            cleared = True
        return _fly_round(task, plan)

    verdict, rounds = refine(scenario, args.refine, one_round, lambda number: _keep(folder, number))
    if args.refine:
        write_whole(folder / "rounds.json", json.dumps(rounds, indent=1) + "\n")
        _print_rounds(rounds, folder)
    code = FLYABLE if verdict.flyable else NOT_FLYABLE
    give_answer(args, lambda: _answer(task, verdict, rounds if args.refine else [], code))
    return code


def _answer(task: _Task, verdict: Verdict, rounds: list[dict[str, Any]], code: int) -> object:
    from planfly.terminal.answers.answer_data import RoundAnswer, RunAnswer, verdict_document

    told = [RoundAnswer(round=one["round"], changes=one["changes"], summary=one["summary"]) for one in rounds]
    return RunAnswer(
        exit_code=code,
        scenario=task.scenario.name,
        seed=task.seed,
        folder=str(task.folder),
        files=[name for name in (*RUN_FILES, "rounds.json") if (task.folder / name).exists()],
        rounds=told,
        verdict=verdict_document(verdict),
    )


def _command_line(args: argparse.Namespace, seed: int) -> str:
    given = {name: getattr(args, name) for name in _REPEATED}
    if args.wind is not None:
        given["wind"] = "{:g},{:g}".format(*args.wind)
    options = [f"--{name} {shlex.quote(format(value))}" for name, value in given.items() if value]
    return " ".join([f"planfly run {shlex.quote(args.scenario)} --seed {seed}", *options])


def _fly_round(task: _Task, plan: Plan) -> tuple[Verdict, bool]:
    """Write a plan and its mission, and fly it if it is feasible: the verdict, and whether it was flown."""
    folder, airframe = task.folder, task.airframe
    write_whole(folder / "plan.json", plan_json(plan))
    tracking = airframe.limits.tracking
    mission = plan_mission(plan, airframe.airspeed, airframe.max_bank, source="mission.waypoints", tracking=tracking)
    write_missions(mission, [folder / "mission.waypoints", folder / "mission.plan"])
    if not plan.feasible:
        verdict = judge_plan_only(plan)
        write_verdict(folder / "verdict.json", verdict)
        print_verdict(verdict, [])
        print(f"results   {folder}/ (plan.json, mission.waypoints, mission.plan, verdict.json; nothing was flown)")
        return verdict, False
    setup = make_setup(task.scenario, airframe, mission, task.seed, plan=plan)
    with progress(f"flying {flight_text(setup)}") as advance:
        flown = fly_and_judge(
            setup, airframe, folder / "flight.mcap", advance, every=task.every, autopilot=task.program, limits=task.most
        )
    write_verdict(folder / "verdict.json", flown.verdict)
    with progress("drawing"):
        write_pictures(folder, flown.setup, flown.track, flown.verdict, flown.ended, task.command, events=flown.events)
    print_verdict(flown.verdict, setup.route.notes)
    flight = "flight.mcap" if len(flown.track) else "no flight"
    print(f"results   {folder}/ (report.html, map.png, profile.png, {flight}, verdict.json, plan.json, missions)")
    return flown.verdict, True


def _keep(folder: Path, number: int) -> None:
    """Move a round's results out of the way of the next."""
    kept = folder / f"round-{number}"
    kept.mkdir(exist_ok=True)
    for name in RUN_FILES:
        if (folder / name).exists():
            (folder / name).replace(kept / name)


def _print_rounds(rounds: list[dict[str, Any]], folder: Path) -> None:
    print("rounds")
    for entry in rounds:
        kept = folder if entry is rounds[-1] else folder / f"round-{entry['round']}"
        changes = "; ".join(entry["changes"]) or "as given"
        print(f"  {entry['round']}  {kept}/  {changes}: {entry['summary']}")
    print(f"  {rounds[-1]['next']}")
