"""``planfly export``: a plan, a mission or a log as the files that its targets' suffixes name."""

import argparse
from pathlib import Path

from flight.mission.fences import with_fences
from flight.mission.from_plan import plan_mission
from flight.mission.items import Mission
from flight.mission_files.formats import KINDS, mission_kind, mission_text, read_mission
from logs.recording.reader import read_log
from logs.replay.kml_gpx import MapLine, gpx_text, kml_text, plan_line, track_line
from planfly.airframe import load_airframe
from planfly.open_mission import open_mission
from planfly.terminal.exit_codes import FLYABLE, LOSS
from planfly.terminal.results import print_warnings
from planfly.terminal.targets import refuse_existing
from planner.plan import read_plan
from world.atomic_files import write_whole
from world.errors import MissionError

MAPS = {".kml": kml_text, ".gpx": gpx_text}
_HOLDS = {"fence": "fence items", "rally": "rally points"}


def export(args: argparse.Namespace, *, log: bool) -> int:
    """Read the source, then write every target; ``log``: the source is a flight log."""
    source, targets = Path(args.plan), [Path(name) for name in args.files]
    for target in targets:
        if target.suffix.lower() not in MAPS:
            _known(target)
        refuse_existing(target, args.overwrite, Path(args.plan))
    maps = any(target.suffix.lower() in MAPS for target in targets)
    mission, notes, lines, problem = _from_log(source) if log else _from_mission(source, maps)
    texts = [(target, *_text(mission, lines, target, str(source))) for target in targets]
    print_warnings([*mission.warnings, *notes])
    for target, text, what in texts:
        write_whole(target, text)
        print(f"{'map' if target.suffix.lower() in MAPS else 'mission':<9} {target} ({what})")
    if problem:
        print_warnings([problem])
        return LOSS
    return FLYABLE


def _known(target: Path) -> None:
    try:
        mission_kind(target)
    except MissionError:
        allowed = ", ".join([*KINDS, *MAPS])
        raise MissionError(f"{target}: suffix {target.suffix!r}: allowed {allowed}") from None


_Read = tuple[Mission, tuple[str, ...], list[MapLine], str]


def _from_log(source: Path) -> _Read:
    log = read_log(source)
    problem = "" if log.complete else f"{source}: incomplete: {log.problem}; it ends at {log.end_time:.1f} s"
    lines = [plan_line(log.setup)]
    if len(log.track):
        lines.append(track_line(log.setup, log.track))
    return log.setup.mission, (), lines, problem


def _from_mission(source: Path, maps: bool) -> _Read:
    if not source.is_file():
        raise MissionError(f"{source}: no such file; a plan.json, mission file or log is expected")
    lines = [plan_line(open_mission(source, None, None).setup)] if maps else []
    if source.suffix.lower() != ".json":
        return read_mission(source), (), lines, ""
    made = read_plan(source)
    airframe = load_airframe(made.scenario)
    mission = plan_mission(made, airframe.airspeed, airframe.max_bank, source=str(source))
    fenced, notes = with_fences(mission, made.scenario)
    return fenced, notes, lines, ""


def _text(mission: Mission, lines: list[MapLine], target: Path, title: str) -> tuple[str, str]:
    """Text of a target, and what it holds."""
    suffix = target.suffix.lower()
    if suffix in MAPS:
        return MAPS[suffix](title, lines), " and ".join(line.name.rsplit(" ", 1)[-1] for line in lines)
    kind = mission_kind(target)
    if kind in _HOLDS:
        count = len(mission.fences if kind == "fence" else mission.rally)
        if not count:
            raise MissionError(f"{mission.source}: no {_HOLDS[kind]} to write to {target}")
        return mission_text(mission, kind), f"{count} {_HOLDS[kind]}"
    extra = ""
    if kind == "plan" and (mission.fences or mission.rally):
        extra = f", {len(mission.fences)} fence items, {len(mission.rally)} rally points"
    return mission_text(mission, kind), f"{len(mission.items)} items{extra}"
