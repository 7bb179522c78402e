"""What each command does.  Results go to standard output, progress to standard error."""

import argparse
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from planfly.aircraft_command import aircraft
from planfly.cli import FLYABLE, LOSS, NOT_FLYABLE
from planfly.files import prepare_folder, refuse_existing
from planfly.progress import progress
from world.errors import PlanflyError, ScenarioError
from world.files import write_whole
from world.scenario import Scenario, embedded_scenarios, load_scenario, with_flight, with_wind

RUNS = Path("runs")
MCAP_MAGIC = b"\x89MCAP"


def scenarios(_args: argparse.Namespace) -> int:
    """``planfly scenarios``."""
    for name, spec in embedded_scenarios().items():
        print(f"{name:<12} {spec.description}")
    return FLYABLE


def run(args: argparse.Namespace) -> int:
    """``planfly run``: the whole chain."""
    from flight.export import plan_mission
    from logs.check import judge_plan_only
    from planfly.pipeline import choose_seed, fly, load_vehicle, make_plan, make_setup
    from planfly.results import print_verdict, write_missions, write_pictures, write_verdict
    from planner.plan import plan_json

    scenario = with_flight(load_scenario(args.scenario), guidance=args.guidance, nav=args.nav)
    seed = choose_seed(scenario, args.seed)
    vehicle = load_vehicle(scenario)
    folder = Path(args.out) if args.out else _default_folder(scenario.name, seed)
    with progress(f"planning {scenario.name}") as advance:
        plan = make_plan(scenario, vehicle, seed, advance=advance)
    prepare_folder(folder, named=bool(args.out), overwrite=args.overwrite)
    write_whole(folder / "plan.json", plan_json(plan))
    mission = plan_mission(plan, vehicle.airspeed, vehicle.max_bank, source="mission.waypoints")
    write_missions(mission, [folder / "mission.waypoints", folder / "mission.plan"])
    setup = make_setup(scenario, vehicle, mission, seed, plan=plan)
    if not plan.feasible:
        verdict = judge_plan_only(plan)
        write_verdict(folder / "verdict.json", verdict)
        print_verdict(verdict, [])
        print(f"results   {folder}/ (plan.json, mission.waypoints, mission.plan, verdict.json; nothing was flown)")
        return NOT_FLYABLE
    with progress("flying") as advance:
        track, ended, verdict = fly(setup, vehicle, folder / "flight.mcap", advance)
    write_verdict(folder / "verdict.json", verdict)
    with progress("drawing"):
        write_pictures(folder, setup, track, verdict, ended, f"planfly run {args.scenario} --seed {seed}")
    print_verdict(verdict, setup.route.notes)
    print(f"results   {folder}/ (report.html, map.png, profile.png, flight.mcap, verdict.json, plan.json, missions)")
    return FLYABLE if verdict.flyable else NOT_FLYABLE


def plan(args: argparse.Namespace) -> int:
    """``planfly plan``."""
    from planfly.pipeline import choose_seed, load_vehicle, make_plan
    from planfly.results import print_plan
    from planner.plan import plan_json

    scenario = load_scenario(args.scenario)
    seed = choose_seed(scenario, args.seed)
    target = _target(args.out, _default_folder(scenario.name, seed) / "plan.json", args.overwrite)
    vehicle = load_vehicle(scenario)
    with progress(f"planning {scenario.name}") as advance:
        made = make_plan(scenario, vehicle, seed, args.algorithm, advance)
    target.parent.mkdir(parents=True, exist_ok=True)
    write_whole(target, plan_json(made))
    print_plan(made)
    print(f"plan      {target}")
    return FLYABLE if made.feasible else NOT_FLYABLE


def export(args: argparse.Namespace) -> int:
    """``planfly export``."""
    from flight.export import plan_mission
    from flight.mission_files import mission_kind
    from planfly.pipeline import load_vehicle
    from planfly.results import write_missions
    from planner.plan import read_plan

    targets = [Path(name) for name in args.files]
    for target in targets:
        mission_kind(target)
        refuse_existing(target, args.overwrite)
    made = read_plan(Path(args.plan))
    vehicle = load_vehicle(made.scenario)
    mission = plan_mission(made, vehicle.airspeed, vehicle.max_bank, source=args.plan)
    write_missions(mission, targets)
    for target in targets:
        print(f"mission   {target} ({len(mission.items)} items)")
    return FLYABLE


def fly(args: argparse.Namespace) -> int:
    """``planfly fly``."""
    from planfly.missions import open_mission
    from planfly.pipeline import fly as fly_setup
    from planfly.results import print_verdict, print_warnings

    opened = open_mission(Path(args.mission), args.scenario, args.terrain, seed=args.seed, change=_changes(args))
    default = _default_folder(opened.name, opened.setup.seed) / "flight.mcap"
    target = _target(args.log, default, args.overwrite)
    print_warnings(opened.setup.mission.warnings)
    target.parent.mkdir(parents=True, exist_ok=True)
    with progress("flying") as advance:
        _, _, verdict = fly_setup(opened.setup, opened.vehicle, target, advance)
    print_verdict(verdict, opened.setup.route.notes)
    print(f"log       {target}")
    return FLYABLE if verdict.flyable else NOT_FLYABLE


def check(args: argparse.Namespace) -> int:
    """``planfly check`` of a log or a mission."""
    from logs.check import judge_geometry
    from planfly.missions import open_mission
    from planfly.results import print_verdict, print_warnings, write_verdict

    source = Path(args.file)
    target = None
    if args.json:
        target = Path(args.json)
        refuse_existing(target, args.overwrite)
    if is_log(source):
        return _check_log(source, args, target)
    opened = open_mission(source, args.scenario, args.terrain)
    print_warnings(opened.setup.mission.warnings)
    verdict = judge_geometry(opened.setup)
    if target:
        write_verdict(target, verdict)
    print_verdict(verdict, opened.setup.route.notes)
    return FLYABLE if verdict.flyable else NOT_FLYABLE


def _check_log(source: Path, args: argparse.Namespace, target: Path | None) -> int:
    from logs.check import judge_flight
    from logs.reader import read_log
    from planfly.results import print_verdict, print_warnings, write_verdict

    if args.scenario:
        raise ScenarioError(
            f"{source}: --scenario: a log is judged in the scenario it carries; only --terrain replaces it"
        )
    log = read_log(source)
    setup = log.setup
    if args.terrain:
        from world.raster import open_raster, read_terrain
        from world.scenario import MARGIN

        ground = read_terrain(open_raster(args.terrain), setup.scenario.origin, setup.scenario.bounds, MARGIN)
        setup = replace(setup, scenario=replace(setup.scenario, terrain=ground))
    verdict = judge_flight(setup, log.track, log.ended or "the log ends before the flight does", whole=log.complete)
    if target:
        write_verdict(target, verdict)
    if not log.complete:
        print_warnings([f"{source}: incomplete: {log.problem}; it ends at {log.end_time:.1f} s"])
    print_verdict(verdict, setup.route.notes)
    if not log.complete:
        return LOSS
    return FLYABLE if verdict.flyable else NOT_FLYABLE


def replay(args: argparse.Namespace) -> int:
    """``planfly replay``."""
    import time

    from logs.reader import read_log
    from logs.replay import entry_lines, timeline
    from planfly.results import print_warnings

    log = read_log(Path(args.log))
    started = time.monotonic()
    for entry in timeline(log):
        if args.speed:
            time.sleep(max(0.0, entry.time / args.speed - (time.monotonic() - started)))
        print("\n".join(entry_lines(entry)), flush=bool(args.speed))
    if not log.complete:
        print_warnings([f"{args.log}: incomplete: {log.problem}; it ends at {log.end_time:.1f} s"])
        return LOSS
    return FLYABLE


def report(args: argparse.Namespace) -> int:
    """``planfly report``."""
    from logs.check import judge_flight
    from logs.reader import read_log
    from planfly.results import print_warnings, write_pictures

    source = Path(args.log)
    log = read_log(source)
    folder = Path(args.out) if args.out else source.with_name(f"{source.stem}-report")
    verdict = judge_flight(log.setup, log.track, log.ended or "the log ends before the flight does", whole=log.complete)
    prepare_folder(folder, named=bool(args.out), overwrite=args.overwrite)
    with progress("drawing"):
        files = write_pictures(
            folder, log.setup, log.track, verdict, log.ended, f"planfly report {args.log}", log.versions, log.events
        )
    for file in files:
        print(f"report    {file}")
    if not log.complete:
        print_warnings([f"{source}: incomplete: {log.problem}; it ends at {log.end_time:.1f} s"])
        return LOSS
    return FLYABLE if verdict.flyable else NOT_FLYABLE


def is_log(path: Path) -> bool:
    """Whether a file is a flight log, by its first bytes or, failing those, its name."""
    try:
        with path.open("rb") as file:
            head = file.read(len(MCAP_MAGIC))
    except OSError as error:
        raise PlanflyError(f"{path}: cannot be read: {error.strerror}") from error
    return head == MCAP_MAGIC or path.suffix.lower() == ".mcap"


def _target(named: str | None, default: Path, overwrite: bool) -> Path:
    if named is None:
        return default
    target = Path(named)
    refuse_existing(target, overwrite)
    return target


def _default_folder(name: str, seed: int) -> Path:
    safe = "".join(letter if letter.isalnum() or letter in "-_." else "-" for letter in name).lstrip(".") or "run"
    return RUNS / f"{safe}-seed{seed}"


def _changes(args: argparse.Namespace) -> Callable[[Scenario], Scenario]:
    def change(scenario: Scenario) -> Scenario:
        speed, source = args.wind if args.wind else (None, None)
        blown = with_wind(scenario, speed, None if source is None else math.radians(source), args.turbulence)
        return with_flight(blown, guidance=args.guidance, nav=args.nav)

    return change


COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "run": run,
    "plan": plan,
    "export": export,
    "fly": fly,
    "check": check,
    "replay": replay,
    "report": report,
    "scenarios": scenarios,
    "aircraft": aircraft,
}
