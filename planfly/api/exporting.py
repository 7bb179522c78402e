"""Export a plan, a mission or a flight log in the formats that the suffixes of the files name."""

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from aircraft.catalog import load_aircraft
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.parameter_files import parameters_text
from flight.autopilots.parameter_origin import TITLES, read_origin, read_parameters_for
from flight.autopilots.parts import PX4_DEFAULT_LIMITS, FeasibilityLimits
from flight.mission.fences import number_items, zone_fences
from flight.mission.items import Command, Mission
from flight.mission_files.formats import KINDS, mission_kind, mission_text, read_mission
from flight.mission_files.qgc_plan import stated_cruise_speed
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import FlightLog, read_log
from logs.verdict.measures.mission_ends import missing_ends_text
from logs.views.exports.map_files import (
    MapLine,
    MapZone,
    glide_shapes,
    gpx_text,
    kml_text,
    map_zones,
    plan_line,
    return_lines,
    track_line,
)
from planfly.api.api_function import api_function
from planfly.arguments import check_arguments
from planfly.flight_logs import is_log, loss_text
from planfly.flight_options import FencePaths, MissionOptions, read_named_fences
from planfly.plan_fence import add_plan_fence
from planfly.runtime.stages import stage
from planfly.workflow.open_flight import PLAN_FILE, open_flight
from planfly.workflow.output_paths import check_output_file
from planfly.workflow.pipeline import FlownMission, return_summary
from planner.plan import Plan, plan_json
from world.errors import MissionError, ParameterError, PlanflyError
from world.extras import require_extra
from world.files import missing_text, temporary_folder, write_atomically
from world.scenario import Scenario
from world.scenario_tables import DEFAULT_AUTOPILOT, FlightTable
from world.wording import count_text

# Function that returns the text of a map, by suffix.
MAP_WRITERS = {".kml": kml_text, ".gpx": gpx_text}
# Suffixes of files with the autopilot parameters for judging returns, rally points, take-off and landing.
PARAMETER_SUFFIXES = (".parm",)
# Prefixes of the names of these parameters.
_JUDGED_PREFIXES = ("RTL_", "RALLY_", "LAND_", "TECS_LAND_", "TKOFF_", "FW_LND_", "FW_TKO_", "NAV_DLL_ACT")
# Suffixes of formats for flight logs only.
LOG_SUFFIXES = (".csv", ".parquet", ".tlog", ".ulg")
# Suffixes of files that contain the fence of a mission.
_FENCE_SUFFIXES = (".plan", ".fence")
# Names of contents in messages, keyed by the kind of the file.
_CONTENT_NAMES = {"fence": "fence item", "rally": "rally point"}
# Suffixes of files that contain the items of a mission.
_MISSION_SUFFIXES = tuple(suffix for suffix, kind in KINDS.items() if kind not in _CONTENT_NAMES)


@dataclass(frozen=True, slots=True)
class ExportedFiles:
    """Files that `planfly.export` wrote.

    files: paths in the order of the request.
    contents: description of the content of each file.
    notes: one line for each part of the source that the files do not contain, and for each part of a mission for PX4
    that PX4 would reject.
    loss: description of the part of a flight log that could not be read, also in `notes`; "" if nothing is missing.
    """

    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()
    contents: tuple[str, ...] = ()
    loss: str = ""


@dataclass(frozen=True, slots=True)
class _SourceContent:
    """Content of the plan, mission or log that is exported.

    mission: the mission; its fences include the threats of a plan.
    name: title of a map.
    lines: lines on a map, keyed by their meaning; empty if no target is a map.
    zones: zones on a map; empty if no target is a map.
    returns, footprint: coloured lines and shapes on a KML map.
    fence_notes: parts of the plan that a fence does not contain.
    notes: parts of the source that a .plan does not contain, and parts of the mission that PX4 would reject.
    log: the input, if it is a flight log.
    autopilot: the autopilot that flies the mission; None if no target needs it.
    has_own_parameters: True if the parameters are those of a log, a plan, a scenario or a parameter file.
    airspeed: airspeed until the mission sets one, m/s; None if no target needs it.
    aircraft: name of the aircraft with this airspeed; "" if no target needs it.
    """

    mission: Mission
    name: str
    lines: dict[str, MapLine] = field(default_factory=dict)
    zones: list[MapZone] = field(default_factory=list)
    returns: list[MapLine] = field(default_factory=list)
    footprint: list[MapZone] = field(default_factory=list)
    fence_notes: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    log: FlightLog | None = None
    autopilot: Autopilot | None = None
    has_own_parameters: bool = True
    airspeed: float | None = None
    aircraft: str = ""

    def of_plan(self) -> "_SourceContent":
        """Return the content with the name "the plan" in messages, in place of the plan's temporary file."""
        return replace(self, mission=replace(self.mission, source="the plan"))


@api_function()
def export(
    source: FlightLog | FlownMission | Plan | str | Path,
    *files: str | Path,
    fence: FencePaths = (),
    at: str | None = None,
    autopilot: str | None = None,
    scenario: Scenario | str | Path | None = None,
    params: str | Path | None = None,
    aircraft: str | Path | None = None,
    overwrite: bool = False,
) -> ExportedFiles:
    """Write a plan, a mission or a flight in the formats that the suffixes of the files name.

    source: a plan, a flight with a log, or the path of a plan.json, mission file or log.
    files: .waypoints, .plan, .fence, .rally, .kml, .gpx, and .parm with the parameters for judging take-off, landing
    and returns; for a flight also .csv, .parquet, .tlog (MAVLink), .ulg (PX4).
    fence: files of fences or zones in addition to those of the source.
    at: time of the flight, see `planfly.plan`; the files omit zones that are inactive at that time.
    scenario: scenario of a mission or plan, as for `planfly.fly`.
    aircraft: name or folder of the aircraft, whose cruise speed a .plan states, and to which the parameters apply.
    autopilot: autopilot of a .plan (its firmwareType) and of the parameters in a .parm; None for the source's one.
    params: a file of this autopilot's parameters, which replaces the parameters of the source.
    overwrite: True replaces existing files.
    Raises a `planfly.PlanflyError` for bad input; then nothing is written.

    >>> import planfly, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = planfly.export(planfly.plan("tight", seed=1), f"{folder}/m.waypoints", Path(folder) / "m.kml")
    ...     [file.suffix for file in written.files], written.contents[0]
    (['.waypoints', '.kml'], '23 items')
    """
    if not files:
        raise PlanflyError("export: expected at least one file", field="files")
    targets = tuple(Path(file) for file in files)
    chosen_autopilot = _find_chosen_autopilot(autopilot, params)
    with contextlib.ExitStack() as temporary_folders:
        if isinstance(source, Plan):
            path = temporary_folders.enter_context(temporary_folder("planfly-export-")) / PLAN_FILE
            write_atomically(path, plan_json(source))
        elif isinstance(source, FlownMission):
            if source.log is None:
                raise PlanflyError("export: the flight has no log; fly(..., log=FILE) writes one", field="source")
            path = source.log
        else:
            path = Path(source.source if isinstance(source, FlightLog) else source)
        for target in targets:
            suffixes = (*KINDS, *MAP_WRITERS, *PARAMETER_SUFFIXES, *LOG_SUFFIXES)
            if target.suffix.lower() not in suffixes:
                allowed = f"expected one of {', '.join(suffixes)}"
                message = f"{target}: suffix {target.suffix!r}: {allowed}"
                raise MissionError(message, file=target, field="suffix", value=target.suffix, allowed=allowed)
            check_output_file(target, overwrite, path)
        options = MissionOptions(
            fence=fence, at=at, scenario=scenario, autopilot=autopilot, params=params, aircraft=aircraft
        )
        read_content = _read_source(path, targets, options)
        source_content = read_content.of_plan() if isinstance(source, Plan) else read_content
        if any(target.suffix.lower() == ".plan" for target in targets):
            source_content = _with_plan_notes(source_content, chosen_autopilot, fence)
        source_content = _with_missing_ends_note(source_content, targets, chosen_autopilot, params)
        contents = [_make_target_content(source_content, target) for target in targets]
    for target, (data, _) in zip(targets, contents, strict=True):
        write_atomically(target, data)
    loss = "" if source_content.log is None else loss_text(source_content.log)
    notes = (
        *source_content.mission.warnings,
        *(source_content.fence_notes if any(target.suffix.lower() in _FENCE_SUFFIXES for target in targets) else ()),
        *source_content.notes,
        *([loss] if loss else []),
    )
    return ExportedFiles(targets, notes, tuple(description for _, description in contents), loss)


def _find_chosen_autopilot(autopilot: str | None, params: str | Path | None) -> str:
    """Return the name of the autopilot that the user named, directly or by its parameter file.

    Returns "" if the user gave neither.  Raises ArgumentError for an unknown autopilot, and ParameterError for a file
    that belongs to no autopilot.
    """
    check_arguments(autopilot=autopilot)
    if autopilot is not None:
        return autopilot.partition("-")[0]
    if params is None:
        return ""
    origin = read_origin(Path(params))
    if not origin.autopilot:
        allowed = "name the autopilot with --autopilot"
        message = f"{params}: {origin.evidence or 'not clearly the file of one autopilot'}: {allowed}"
        raise ParameterError(message, file=params, field="autopilot", value=origin.evidence, allowed=allowed)
    return origin.autopilot


def _with_plan_notes(source: _SourceContent, autopilot: str, fence: FencePaths) -> _SourceContent:
    """Return a source with the autopilot for a .plan, and with notes on lost content.

    The .plan will not have this content.

    The .plan has the autopilot that the user named, or else the source's autopilot, or else `DEFAULT_AUTOPILOT`.

    autopilot: name of the autopilot; "" if the user named none.
    fence: files of fences that the user named.
    """
    notes = list(source.notes)
    source_autopilot = source.mission.autopilot if source.autopilot is None else source.autopilot.name
    if not (autopilot or source_autopilot):
        notes.append(
            f"{source.mission.source} names no autopilot: the .plan is for {TITLES[DEFAULT_AUTOPILOT]};"
            " name another with --autopilot or --params"
        )
    fence_files = [fence] if isinstance(fence, str | Path) else fence
    notes += [
        f"{file}: {count_text(len(rally), 'rally point')} not exported: --fence reads only the fence"
        for file in fence_files
        if not source.mission.rally
        and Path(file).suffix.lower() == ".plan"
        and (rally := read_mission(Path(file)).rally)
    ]
    mission = replace(source.mission, autopilot=autopilot or source_autopilot or DEFAULT_AUTOPILOT)
    return replace(source, mission=mission, notes=tuple(notes))


def _with_missing_ends_note(
    source: _SourceContent, targets: tuple[Path, ...], autopilot: str, params: str | Path | None
) -> _SourceContent:
    """Return a source with a note if PX4 would refuse its mission, because take-off or landing is missing.

    A log, and a mission for another autopilot, get no note.

    autopilot: name of the autopilot that the user named, which replaces the source's autopilot; "" if none was named.
    params: parameter file of the named autopilot, whose requirement applies.
    targets: files to write; without a mission file among them there is no note.
    """
    source_autopilot = source.mission.autopilot if source.autopilot is None else source.autopilot.checks.dialect
    has_items = any(target.suffix.lower() in _MISSION_SUFFIXES for target in targets)
    if source.log is not None or not has_items or (autopilot or source_autopilot) != "px4":
        return source
    limits = PX4_DEFAULT_LIMITS
    if params is not None:
        entry = read_parameters_for(Path(params), "px4").get("MIS_TKO_LAND_REQ")
        limits = limits if entry is None else FeasibilityLimits(requires=int(entry.value), stated=True)
    elif source.autopilot is not None and source_autopilot == "px4":
        limits = source.autopilot.checks.feasibility
    missing_ends = missing_ends_text(source.mission, limits)
    return replace(source, notes=(*source.notes, missing_ends)) if missing_ends else source


def _read_source(path: Path, targets: tuple[Path, ...], options: MissionOptions) -> _SourceContent:
    """Read those parts of a log, a plan or a mission that the target files need.

    Raises MissionError for options that do not apply to a log, and for targets that need a log.
    """
    if path.is_file() and is_log(path):
        if (at := options["at"]) is not None:
            allowed = "not allowed: a log is exported with the zones at the time of its flight"
            raise MissionError.of_argument("at", at, allowed, file=path)
        if options["fence"]:
            allowed = "not allowed: a log is exported with the fence of its flight"
            raise MissionError.of_argument("fence", options["fence"], allowed, shown="", file=path)
        for name in ("scenario", "autopilot", "params", "aircraft"):
            if (value := options.get(name)) is not None:
                word = "parameters" if name == "params" else name
                allowed = f"not allowed: a log is exported with the {word} of its flight"
                raise MissionError.of_argument(name, value, allowed, file=path)
        log = read_log(path)
        setup = log.setup
        lines = {"plan": plan_line(setup)}
        if len(log.track):
            lines["flown"] = track_line(setup, log.track)
        source = _SourceContent(
            *(setup.mission, setup.scenario.name, lines, map_zones(setup)),
            log=log,
            autopilot=setup.autopilot,
            airspeed=setup.airspeed,
            aircraft=Path(setup.aircraft).name,
        )
        return _with_returns(source, setup, log.track) if _needs_kml(targets) else source
    has_aircraft = options.get("aircraft") is not None
    if not has_aircraft and not any(target.suffix.lower() in PARAMETER_SUFFIXES for target in targets):
        # Only the parameters of a .parm file need the autopilot itself; a .plan states its name.
        options = options | {"autopilot": None, "params": None}
    for target in targets:
        suffix = target.suffix
        if suffix.lower() in LOG_SUFFIXES:
            message = f"{target}: only a flight log (.mcap) can be exported as {suffix}, not a plan or a mission"
            raise MissionError(message, file=target, field="suffix", value=suffix)
    needs_world = has_aircraft or any(
        target.suffix.lower() in (*MAP_WRITERS, *PARAMETER_SUFFIXES) for target in targets
    )
    return _read_mission(path, options, needs_world=needs_world, needs_returns=_needs_kml(targets))


def _needs_kml(targets: tuple[Path, ...]) -> bool:
    """Return True if one of the targets is a KML file."""
    return any(target.suffix.lower() == ".kml" for target in targets)


def _with_returns(source: _SourceContent, setup: FlightSetup, track: Track | None) -> _SourceContent:
    """Return a source with simulated returns and glides from a few points of the flight, for a map.

    track: rows of the flight; None for returns from the planned path.

    The source is returned unchanged if returns cannot be judged.
    """
    with stage("flying returns for the map"):
        drawn_returns = return_summary(setup, track).data_for_pictures()
    if drawn_returns is None:
        return source
    return replace(
        source, returns=return_lines(setup, drawn_returns, track), footprint=glide_shapes(setup, drawn_returns)
    )


def _read_mission(path: Path, options: MissionOptions, *, needs_world: bool, needs_returns: bool) -> _SourceContent:
    """Read the parts of a plan or a mission file that the target files need.

    The scenario is loaded only if a target, a plan, a fence or a time needs it.  Raises MissionError for a missing
    file.

    needs_world: True if a target needs the scenario.
    needs_returns: True to add returns from a few points of the planned path.
    """
    if not path.is_file():
        raise MissionError(f"{path}: {missing_text(path)}; expected a plan.json, mission file or log", file=path)
    is_plan, fences = path.suffix.lower() == ".json", read_named_fences(options["fence"])
    has_own_parameters = is_plan or options["scenario"] is not None or options["params"] is not None
    if not (needs_world or has_own_parameters or fences.zones or options["at"] is not None):
        mission = fences.add_to_mission(read_mission(path))
        return _SourceContent(mission, path.stem)
    # Fence items have no times, so only the zones that are active during the flight are exported.
    setup = open_flight(path, options)
    lines, zones = {"plan": plan_line(setup)}, map_zones(setup)
    source = _SourceContent(
        *(setup.mission, setup.scenario.name, lines, zones),
        autopilot=setup.autopilot,
        has_own_parameters=has_own_parameters,
        airspeed=setup.airspeed,
        aircraft=Path(setup.aircraft).name,
    )
    source = _with_returns(source, setup, track=None) if needs_returns else source
    if is_plan:
        mission, notes = add_plan_fence(setup)
    else:
        fence_items, zone_notes = zone_fences(setup.scenario.zones, setup.scenario.origin)
        mission = replace(source.mission, fences=number_items([*source.mission.fences, *fence_items]))
        notes = tuple(zone_notes)
    return replace(source, mission=mission, fence_notes=notes)


def _make_target_content(source: _SourceContent, target: Path) -> tuple[str | bytes, str]:
    """Return the content of a target file, and a description of the content, such as "23 items".

    The suffix of the target decides its format.  Raises MissionError if the source has no fence or rally points to
    write.
    """
    suffix, mission = target.suffix.lower(), source.mission
    if suffix in LOG_SUFFIXES and source.log is not None:
        description = f"{count_text(len(source.log.track), 'row')}, {source.log.end_time:.0f} s"
        if suffix == ".tlog":
            require_extra("live", ".tlog needs")
            from logs.views.exports.telemetry_file import telemetry_bytes

            return telemetry_bytes(source.log), description
        from logs.views.exports.log_files import csv_text, parquet_bytes, px4_log_bytes

        writers: Mapping[str, Callable[[FlightLog], str | bytes]] = {
            ".csv": csv_text,
            ".parquet": parquet_bytes,
            ".ulg": px4_log_bytes,
        }
        return writers[suffix](source.log), description
    if suffix in MAP_WRITERS:
        descriptions = [*source.lines, *([count_text(len(source.zones), "zone")] if source.zones else [])]
        lines, zones = list(source.lines.values()), source.zones
        if suffix == ".kml" and source.returns:
            lines, zones = lines + source.returns, zones + source.footprint
            descriptions.append("returns")
        return MAP_WRITERS[suffix](source.name, lines, zones), " and ".join(descriptions)
    if suffix in PARAMETER_SUFFIXES and source.autopilot is not None:
        return format_judging_parameters(mission, source.autopilot, has_own_parameters=source.has_own_parameters)
    kind = mission_kind(target)
    if kind in _CONTENT_NAMES:
        count = len(mission.fences if kind == "fence" else mission.rally)
        if not count:
            raise MissionError(
                f"{mission.source}: contains no {_CONTENT_NAMES[kind]}s to write to {target}", file=mission.source
            )
        return mission_text(mission, kind), count_text(count, _CONTENT_NAMES[kind])
    extra = ""
    if kind == "plan" and (mission.fences or mission.rally):
        extra = f", {count_text(len(mission.fences), 'fence item')}, {count_text(len(mission.rally), 'rally point')}"
    if kind == "plan":
        if (mission_speed := stated_cruise_speed(mission)) is not None:
            airspeed, origin = mission_speed, "from the mission"
        elif source.airspeed is not None:
            airspeed, origin = source.airspeed, f"from {source.aircraft}"
        else:
            aircraft = load_aircraft(FlightTable().aircraft)
            airspeed = aircraft.airspeed
            origin = f"from the default aircraft {aircraft.name}; name yours with --aircraft"
        mission, extra = replace(mission, cruise_speed=airspeed), f"{extra}, cruiseSpeed {airspeed:.0f} m/s {origin}"
    return mission_text(mission, kind), f"{count_text(len(mission.items), 'item')}{extra}"


def format_judging_parameters(
    mission: Mission, autopilot: Autopilot, *, has_own_parameters: bool = True
) -> tuple[str, str]:
    """Return a parameter file for take-off, landing and returns, and a description of its content.

    Values with which the autopilot would refuse to arm are left out.

    has_own_parameters: False if no parameter was given, and the values are planfly's defaults for the mission.

    Raises MissionError for an autopilot without such parameters.
    """
    parameters = () if autopilot.parameters is None else autopilot.parameters.values
    values = {name: value for name, value, _ in parameters if name.startswith(_JUDGED_PREFIXES)}
    if not values:
        reason = f"{autopilot.title} has no parameters of take-off, landing and returns"
        raise MissionError(f"{mission.source}: {reason}", file=mission.source, field="autopilot")
    omitted = ""
    if values.get("RTL_AUTOLAND") == 0.0 and any(item.command == Command.DO_LAND_START for item in mission.items):
        del values["RTL_AUTOLAND"]
        omitted = ", without RTL_AUTOLAND 0, because the autopilot does not arm with that value"
    title = f"{autopilot.title}: take-off, landing and returns "
    title += (
        "with which planfly judges the mission"
        if has_own_parameters
        else "by planfly's defaults for this mission; name your own parameter file with export ... --params FILE"
    )
    return parameters_text(values, title), f"{count_text(len(values), 'parameter')} of {autopilot.title}{omitted}"
