"""``planfly export``: a plan, a mission or a log as the files that its targets' suffixes name."""

import argparse
from dataclasses import dataclass, field, replace
from pathlib import Path

from flight.mission.fences import numbered, zone_fences
from flight.mission.items import Mission
from flight.mission_files.formats import KINDS, mission_kind, mission_text, read_mission
from logs.recording.reader import FlightLog, read_log
from logs.views.exports.map_files import MapLine, MapZone, gpx_text, kml_text, map_zones, plan_line, track_line
from planfly.open_mission import NamedFences, fence_of_plan, is_log, open_mission, read_named_fences
from planfly.terminal.answers.giving import give_answer
from planfly.terminal.exit_codes import FLYABLE, LOSS
from planfly.terminal.results import print_warnings, refuse_existing, warn_of_loss
from world.errors import MissionError
from world.files import write_whole
from world.scenario import Scenario

MAPS = {".kml": kml_text, ".gpx": gpx_text}
# What a flight log alone can be written as.
LOGS = (".csv", ".parquet", ".tlog", ".ulg")
_HOLDS = {"fence": "fence items", "rally": "rally points"}


@dataclass(frozen=True, slots=True)
class _Source:
    """What an input holds.

    mission: its items, and a plan's threats as fences.
    name: a map's title.
    lines, zones: on a map, lines by what they are; none where no target asks for one.
    notes: what the mission does not hold of the plan.
    log: the input, where it is a flight log.
    """

    mission: Mission
    name: str
    lines: dict[str, MapLine] = field(default_factory=dict)
    zones: list[MapZone] = field(default_factory=list)
    notes: tuple[str, ...] = ()
    log: FlightLog | None = None


def export(args: argparse.Namespace) -> int:
    """Read the source, then write every target; 3 for a log that is cut short."""
    path, targets = Path(args.plan), [Path(name) for name in args.files]
    for target in targets:
        if target.suffix.lower() not in (*MAPS, *LOGS):
            _refuse_unknown(target)
        refuse_existing(target, args.overwrite, path)
    maps = any(target.suffix.lower() in MAPS for target in targets)
    fences = read_named_fences(args.fence)
    if path.is_file() and is_log(path):
        if args.fence:
            allowed = "a log is exported with the fence that it was flown with"
            raise MissionError.at(path, "--fence", args.fence, allowed, shown="")
        source = _read_log(path)
    else:
        _refuse_flown(path, targets)
        source = _read_mission(path, maps, fences)
    texts = [(target, *_text(source, target)) for target in targets]
    print_warnings([*source.mission.warnings, *source.notes])
    for target, text, content in texts:
        write_whole(target, text)
        print(f"{_kind(target):<9} {target} ({content})")
    code = FLYABLE
    if source.log is not None and not source.log.complete:
        warn_of_loss(source.log)
        code = LOSS

    def answer() -> object:
        from planfly.terminal.answers.answer_data import ExportAnswer, ExportedFile

        files = [ExportedFile(file=str(target), content=content) for target, _, content in texts]
        return ExportAnswer(exit_code=code, files=files, warnings=[*source.mission.warnings, *source.notes])

    give_answer(args, answer)
    return code


def _refuse_unknown(target: Path) -> None:
    try:
        mission_kind(target)
    except MissionError:
        allowed = f"allowed {', '.join([*KINDS, *MAPS, *LOGS])}"
        message = f"{target}: suffix {target.suffix!r}: {allowed}"
        raise MissionError(message, file=target, field="suffix", value=target.suffix, allowed=allowed) from None


def _refuse_flown(path: Path, targets: list[Path]) -> None:
    """Refuse to write of a plan or a mission what is about a flight."""
    for target in targets:
        suffix = target.suffix
        if suffix.lower() in LOGS:
            message = f"{target}: {suffix} is written of a flight log (.mcap), and {path} is none"
            raise MissionError(message, file=target, field="suffix", value=suffix)


def _kind(target: Path) -> str:
    suffix = target.suffix.lower()
    return "map" if suffix in MAPS else "flight" if suffix in LOGS else "mission"


def _flown(log: FlightLog, suffix: str) -> tuple[str | bytes, str]:
    """A flight's rows in another program's form, and what that holds; each form loads what it alone needs."""
    content = f"{len(log.track):,} rows, {log.end_time:.0f} s"
    if suffix == ".tlog":
        from logs.views.exports.log_files import telemetry_bytes

        return telemetry_bytes(log), content
    if suffix == ".ulg":
        from logs.views.exports.log_files import px4_log_bytes

        return px4_log_bytes(log), content
    from logs.views.exports.log_files import csv_text, parquet_bytes

    return (csv_text(log) if suffix == ".csv" else parquet_bytes(log)), content


def _read_log(path: Path) -> _Source:
    log = read_log(path)
    lines = {"plan": plan_line(log.setup)}
    if len(log.track):
        lines["flown"] = track_line(log.setup, log.track)
    return _Source(log.setup.mission, log.setup.scenario.name, lines, map_zones(log.setup), log=log)


def _read_mission(path: Path, maps: bool, fences: NamedFences) -> _Source:
    """A plan or a mission file; a map, zones and a plan's fence want its place, too, which not every mission has."""
    if not path.is_file():
        raise MissionError(f"{path}: no such file; a plan.json, mission file or log is expected", file=path)
    is_plan = path.suffix.lower() == ".json"
    if not (maps or is_plan or fences.zones):
        return _Source(fences.on_mission(read_mission(path)), path.stem)
    setup = open_mission(path, None, None, fences=fences).setup
    source = _Source(setup.mission, setup.scenario.name, {"plan": plan_line(setup)}, map_zones(setup))
    if not is_plan:
        return _with_zones(source, setup.scenario)
    mission, notes = fence_of_plan(setup)
    return replace(source, mission=mission, notes=notes)


def _with_zones(source: _Source, scenario: Scenario) -> _Source:
    """The zones named as fence items, beside the mission's own."""
    items, notes = zone_fences(scenario.zones, scenario.origin)
    fenced = replace(source.mission, fences=numbered([*source.mission.fences, *items]))
    return replace(source, mission=fenced, notes=tuple(notes))


def _text(source: _Source, target: Path) -> tuple[str | bytes, str]:
    """Text of a target, and what it holds."""
    suffix, mission = target.suffix.lower(), source.mission
    if suffix in LOGS and source.log is not None:
        return _flown(source.log, suffix)
    if suffix in MAPS:
        held = [*source.lines, *([f"{len(source.zones)} zones"] if source.zones else [])]
        return MAPS[suffix](source.name, list(source.lines.values()), source.zones), " and ".join(held)
    kind = mission_kind(target)
    if kind in _HOLDS:
        count = len(mission.fences if kind == "fence" else mission.rally)
        if not count:
            raise MissionError(f"{mission.source}: no {_HOLDS[kind]} to write to {target}", file=mission.source)
        return mission_text(mission, kind), f"{count} {_HOLDS[kind]}"
    extra = ""
    if kind == "plan" and (mission.fences or mission.rally):
        extra = f", {len(mission.fences)} fence items, {len(mission.rally)} rally points"
    return mission_text(mission, kind), f"{len(mission.items)} items{extra}"
