"""``planfly check``: a log judged from what it holds, or a mission by its geometry alone."""

import argparse
from dataclasses import replace
from pathlib import Path

from logs.importers.open_log import is_imported_log
from logs.recording.reader import FlightLog, read_log
from logs.verdict.findings import verdict_json
from logs.verdict.judge_flight import judge_geometry
from planfly.open_mission import NamedFences, is_log, open_mission, read_named_fences
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE, LOSS, NOT_FLYABLE
from planfly.terminal.options import scenario_change
from planfly.terminal.results import judge_log, print_verdict, print_warnings, warn_of_loss
from world.errors import ScenarioError
from world.scenario import over_terrain


def check(args: argparse.Namespace) -> int:
    """Judge without flying; the exit code is the verdict's, or 3 for a log that is cut short."""
    source = Path(args.file)
    if is_imported_log(source):
        return _check_imported_log(source, args)
    _refuse_import_options(source, args)
    fences = read_named_fences(args.fence)
    if is_log(source):
        log = _open_log(source, args, fences)
        setup, verdict, loss = log.setup, judge_log(log), not log.complete
    else:
        setup = open_mission(source, args.scenario, args.terrain, change=scenario_change(args), fences=fences).setup
        print_warnings(setup.mission.warnings)
        verdict, loss = judge_geometry(setup), False
    give_answer(args, lambda: verdict_json(verdict))
    if loss:
        warn_of_loss(log)
    print_verdict(verdict, setup.route.notes)
    if loss:
        return LOSS
    return FLYABLE if verdict.flyable else NOT_FLYABLE


def _check_imported_log(source: Path, args: argparse.Namespace) -> int:
    # Imported here: no other check needs the libraries that read imported logs.
    from planfly.commands.imported_logs import import_options
    from planfly.imported_flights import import_flight

    flight = import_flight(source, import_options(args), scenario_change(args))
    give_answer(args, lambda: verdict_json(flight.verdict))
    print_verdict(flight.verdict, flight.setup.route.notes)
    if flight.lossy:
        return LOSS
    return FLYABLE if flight.verdict.flyable else NOT_FLYABLE


def _refuse_import_options(source: Path, args: argparse.Namespace) -> None:
    """Refuse what only an imported log can take.  Raises ScenarioError."""
    for name in ("plan", "flight", "datum"):
        if (value := getattr(args, name, None)) is not None:
            allowed = "goes with an imported log, not with this file"
            raise ScenarioError.at(source, f"--{name}", value, allowed, shown="")


def _open_log(source: Path, args: argparse.Namespace, fences: NamedFences) -> FlightLog:
    """Read a log, over another terrain and with more fences where they are named.

    Raises ScenarioError for options that it cannot take.
    """
    names = ("aircraft", "airspeed", "wind", "turbulence", "params", "guidance")
    given = [name for name in names if getattr(args, name) is not None]
    if given:
        allowed = "a log is judged with the aircraft, the speeds, the wind and the autopilot it was flown with"
        raise ScenarioError.at(source, f"--{given[0]}", getattr(args, given[0]), allowed, shown="")
    if args.scenario:
        allowed = "a log is judged in the scenario it carries; only --terrain replaces its ground"
        raise ScenarioError.at(source, "--scenario", args.scenario, allowed, shown="")
    log = read_log(source)
    setup = log.setup
    if args.terrain:
        setup = setup.in_scenario(over_terrain(setup.scenario, args.terrain))
    if args.fence:
        setup = replace(setup.in_scenario(fences.on_scenario(setup.scenario)), mission=fences.on_mission(setup.mission))
    return replace(log, setup=setup)
