"""What each command does.  Results go to standard output, progress to standard error."""

import argparse
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from planfly.commands import log_commands
from planfly.commands.aircraft import aircraft
from planfly.terminal.exit_codes import FLYABLE, LOSS, NOT_FLYABLE
from planfly.terminal.progress import progress
from planfly.terminal.targets import default_folder, prepare_folder, refuse_existing, refuse_folder
from world.atomic_files import write_whole
from world.errors import PlanflyError, ScenarioError
from world.scenario import Scenario, embedded_scenarios, load_scenario
from world.scenario_variants import over_terrain, with_flight, with_wind

if TYPE_CHECKING:
    pass

MCAP_MAGIC = b"\x89MCAP"


def scenarios(_args: argparse.Namespace) -> int:
    """``planfly scenarios``."""
    for name, spec in embedded_scenarios().items():
        print(f"{name:<12} {spec.description}")
    return FLYABLE


def run(args: argparse.Namespace) -> int:
    """``planfly run``: the whole chain."""
    from planfly.commands.run import run as run_chain

    return FLYABLE if run_chain(args).flyable else NOT_FLYABLE


def plan(args: argparse.Namespace) -> int:
    """``planfly plan``, and planning again with ``--from``."""
    from planfly.airframe import choose_seed, load_airframe
    from planfly.commands.plan_options import make_plan, prepare, print_plan
    from planner.plan import plan_json

    scenario, old = prepare(args, load_scenario(args.scenario))
    seed = choose_seed(scenario, args.seed)
    default = default_folder(scenario.name, seed) / ("plan.json" if old is None else "replan.json")
    target = _target(args.out, default, args, Path(args.scenario))
    airframe = load_airframe(scenario)
    with progress(f"planning {scenario.name}") as advance:
        made = make_plan(args, scenario, old, airframe, seed, advance)
    target.parent.mkdir(parents=True, exist_ok=True)
    write_whole(target, plan_json(made))
    print_plan(made)
    print(f"plan      {target}")
    return FLYABLE if made.safe else NOT_FLYABLE


def paper(args: argparse.Namespace) -> int:
    """``planfly paper``: a table whatever it says; no path in it is an answer too."""
    from planfly.commands.paper import PROBLEMS, run_section, table
    from planfly.commands.paper_files import file_names, table_text, write_figures, write_tables
    from planfly.terminal.targets import RUNS

    folder = Path(args.out) if args.out else RUNS / "paper"
    if args.out:
        refuse_folder(folder, args.overwrite)
    with progress("planning") as advance:
        done = run_section(args.problems, args.runs, args.algorithm, args.jobs, advance)
    rows = table(done)
    prepare_folder(folder, tuple(file_names(PROBLEMS)))
    write_tables(folder, rows, done)
    with progress("drawing"):
        write_figures(folder, done)
    print(table_text(rows))
    print(f"results   {folder}/ (table.csv, runs.csv, runs.json, times.csv, paths-, encodings-, convergence.png)")
    return FLYABLE


def export(args: argparse.Namespace) -> int:
    """``planfly export``."""
    from planfly.commands.export import export as export_files

    return export_files(args, log=Path(args.plan).is_file() and is_log(Path(args.plan)))


def fly(args: argparse.Namespace) -> int:
    """``planfly fly``."""
    from planfly.open_mission import open_mission
    from planfly.pipeline import fly as fly_setup
    from planfly.terminal.results import print_verdict, print_warnings

    opened = open_mission(Path(args.mission), args.scenario, args.terrain, seed=args.seed, change=_change(args))
    default = default_folder(opened.name, opened.setup.seed) / "flight.mcap"
    target = _target(args.log, default, args, Path(args.mission))
    print_warnings(opened.setup.mission.warnings)
    target.parent.mkdir(parents=True, exist_ok=True)
    with progress("flying") as advance:
        _, _, verdict = fly_setup(opened.setup, opened.airframe, target, advance, every=60 // args.log_hz)
    print_verdict(verdict, opened.setup.route.notes)
    print(f"log       {target}")
    return FLYABLE if verdict.flyable else NOT_FLYABLE


def check(args: argparse.Namespace) -> int:
    """``planfly check`` of a log or a mission."""
    from logs.verdict.judge_flight import judge_geometry
    from planfly.open_mission import open_mission
    from planfly.terminal.results import print_verdict, print_warnings, write_verdict

    source = Path(args.file)
    target = None
    if args.json:
        target = Path(args.json)
        refuse_existing(target, args.overwrite, source)
    if is_log(source):
        return _check_log(source, args, target)
    opened = open_mission(source, args.scenario, args.terrain, change=_change(args))
    print_warnings(opened.setup.mission.warnings)
    verdict = judge_geometry(opened.setup)
    if target:
        write_verdict(target, verdict)
    print_verdict(verdict, opened.setup.route.notes)
    return FLYABLE if verdict.flyable else NOT_FLYABLE


def _check_log(source: Path, args: argparse.Namespace, target: Path | None) -> int:
    from logs.recording.reader import read_log
    from logs.verdict.judge_flight import judge_flight
    from planfly.terminal.results import print_verdict, print_warnings, write_verdict

    given = [name for name in ("aircraft", "airspeed") if getattr(args, name) is not None]
    if given:
        raise ScenarioError(
            f"{source}: --{given[0]}: a log is judged with the aircraft and the speeds it was flown with"
        )
    if args.scenario:
        raise ScenarioError(
            f"{source}: --scenario: a log is judged in the scenario it carries; only --terrain replaces it"
        )
    log = read_log(source)
    setup = log.setup
    if args.terrain:
        setup = replace(setup, scenario=over_terrain(setup.scenario, args.terrain))
    verdict = judge_flight(setup, log.track, log.ended or "the log ends before the flight does", whole=log.complete)
    if target:
        write_verdict(target, verdict)
    if not log.complete:
        print_warnings([f"{source}: incomplete: {log.problem}; it ends at {log.end_time:.1f} s"])
    print_verdict(verdict, setup.route.notes)
    if not log.complete:
        return LOSS
    return FLYABLE if verdict.flyable else NOT_FLYABLE


def serve(args: argparse.Namespace) -> int:
    """``planfly serve``."""
    from planfly.commands.serve import serve as serve_vehicle

    return serve_vehicle(args)


def is_log(path: Path) -> bool:
    """Whether a file is a flight log, by its first bytes or, failing those, its name."""
    try:
        with path.open("rb") as file:
            head = file.read(len(MCAP_MAGIC))
    except OSError as error:
        raise PlanflyError(f"{path}: cannot be read: {error.strerror}") from error
    return head == MCAP_MAGIC or path.suffix.lower() == ".mcap"


def _target(named: str | None, default: Path, args: argparse.Namespace, source: Path) -> Path:
    if named is None:
        return default
    target = Path(named)
    refuse_existing(target, args.overwrite, source)
    return target


def _change(args: argparse.Namespace) -> Callable[[Scenario], Scenario]:
    """What the command's options change in a scenario: aircraft, airspeed, and for a flight the wind."""

    def change(scenario: Scenario) -> Scenario:
        given = {
            "aircraft": args.aircraft,
            "airspeed_mps": args.airspeed,
            "guidance": getattr(args, "guidance", None),
            "nav": getattr(args, "nav", None),
        }
        speed, source = getattr(args, "wind", None) or (None, None)
        turbulence = getattr(args, "turbulence", None)
        return with_wind(
            with_flight(scenario, **given), speed, None if source is None else math.radians(source), turbulence
        )

    return change


COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "run": run,
    "plan": plan,
    "export": export,
    "fly": fly,
    "check": check,
    "paper": paper,
    "serve": serve,
    "replay": log_commands.replay,
    "recover": log_commands.recover,
    "report": log_commands.report,
    "compare": log_commands.compare,
    "scenarios": scenarios,
    "aircraft": aircraft,
}
