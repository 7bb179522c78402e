"""Open documents in the studio, and save the edited mission.

The contents that each format loses are listed.
"""

import contextlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flight.mission.items import AMSL, LANDINGS, TAKEOFFS, Command, Mission
from flight.mission_files.formats import mission_text, parse_mission
from flight.simulation.setup import FlightSetup
from logs.importers.open_log import is_imported_log
from logs.recording.mcap_reader import MAGIC, PARSE_ERRORS, Container, read_chunks
from logs.recording.reader import read_log
from logs.recording.setup_attachments import PLAN_FILE, SCENARIO_FILE
from logs.verdict.wording import count_text
from logs.views.exports.map_files import kml_text, map_zones, plan_line
from planfly.api.imported import read_imported
from planfly.flight_logs import MCAP_MAGIC, is_log
from planfly.flight_options import LogOptions, MissionOptions, apply_options, load_scenario_with_options
from planfly.studio.edit_context import EditContext
from planfly.studio.settings import changed_settings, settings_json
from planfly.workflow.mission_context import JudgedMission
from planfly.workflow.open_flight import make_setup, mission_of_plan, open_flight
from planfly.workflow.uav import Uav, choose_seed, load_uav, uav_of_setup
from planner.plan import GROUND_PROBLEMS, Certificate, Objectives, Plan, Violations, plan_json
from planner.search.plan_path import certify_waypoints
from world.arrays import Floats
from world.elevation_formats import EMBEDDED
from world.errors import LogError, MissionError, PlanflyError
from world.files import temporary_folder
from world.scenario import Scenario, embedded_names

# Maximum size of a file dropped on the page, bytes.
MAX_DROPPED = 16 * 2**20
# File types that may be dropped: the types that `planfly check` reads and that do not name other files.
DROPPED_SUFFIXES = (
    ".waypoints",
    ".txt",
    ".plan",
    ".json",
    ".mcap",
    ".bin",
    ".tlog",
    ".ulg",
    ".gpx",
    ".igc",
    ".kml",
    ".kmz",
)
# File types of maps, which contain no mission.
MAP_SUFFIXES = (".kml", ".kmz")
# File types that a mission can be opened from and saved as.
KINDS = {"waypoints": ".waypoints", "plan": ".plan", "plan.json": ".json", "kml": ".kml"}
# All file types that can be saved.
SAVED_SUFFIXES = KINDS | {"parm": ".parm"}
# Latitudes and longitudes within this difference are equal, degrees; files round to 1e-7 degrees.
_POSITION_TOLERANCE_DEG = 2e-7
# Altitudes within this difference are equal, m.
_ALTITUDE_TOLERANCE_M = 0.02


@dataclass(frozen=True, slots=True)
class Document:
    """Opened mission and its origin.

    name: name shown to the user.
    stem: stem of the file names under which it is saved.
    setup: setup of the opened mission.
    kind: key in `KINDS`, or "" if the document was not a mission file that the studio can write.
    data: bytes of the file, which are saved again if an unchanged mission is saved in the same format; empty if `kind`
        is "".
    path: the file that the command named, which the page may overwrite; None for any other document.
    on_disk: bytes of this file when it was last read or written.
    to_plan: True for a scenario that has no path yet.
    """

    name: str
    stem: str
    setup: FlightSetup
    kind: str = ""
    data: bytes = b""
    path: Path | None = None
    on_disk: bytes = b""
    to_plan: bool = False


def open_document(target: str, options: MissionOptions) -> Document:
    """Open a scenario, a plan, a mission or a log.

    target: name of a scenario, or path of a file.

    Raises PlanflyError if the target cannot be opened.
    """
    if target in embedded_names() or target.lower().endswith(".toml"):
        # The mission is a straight line until a path is planned.
        scenario = load_scenario_with_options(target, options)
        uav, seed = load_uav(scenario), choose_seed(scenario, options.get("seed"))
        mission = planned_mission(straight_plan(scenario, seed), uav)
        return Document(scenario.name, scenario.name, make_setup(scenario, uav, mission, seed), to_plan=True)
    path = Path(target)
    if path.is_file() and is_imported_log(path):
        world: LogOptions = {
            "scenario": options.get("scenario"),
            "terrain": options.get("terrain"),
            "fence": options.get("fence") or (),
        }
        try:
            setup = read_imported(path, **world).setup
        except LogError as error:
            has_track = "contains no mission" in str(error)
            if not has_track and path.suffix.lower() not in MAP_SUFFIXES:
                raise
            reason = f"contains {'a track' if has_track else 'a map'} but no mission: open the mission file instead"
            raise MissionError(f"{path}: {reason}", file=path) from None
        setup = _log_mission_setup(setup.scenario, setup.mission, setup.seed)
    elif path.is_file() and is_log(path):
        setup = read_log(path).setup
        setup = _log_mission_setup(apply_options(setup.scenario, options), setup.mission, setup.seed)
    else:
        setup = open_flight(path, options)
    kind = next((kind for kind, suffix in KINDS.items() if suffix == path.suffix.lower()), "")
    kind = "waypoints" if path.suffix.lower() == ".txt" else "" if kind == "kml" else kind
    data = path.read_bytes() if kind else b""
    return Document(path.name, path.stem, setup, kind, data, path, data)


def open_dropped(name: str, data: bytes, options: MissionOptions) -> Document:
    """Open a file that was dropped on the page.

    name: name of the file; the suffix is its type.
    data: content of the file.

    Raises PlanflyError if the file cannot be opened, or names other files of this machine.
    """
    suffix = Path(name).suffix.lower()
    shown_name = (
        "".join(character if character.isprintable() and character not in "/\\" else "_" for character in name)[-60:]
        or "dropped"
    )
    if suffix not in DROPPED_SUFFIXES:
        raise MissionError.at(
            shown_name, "suffix", suffix, f"expected one of {', '.join(DROPPED_SUFFIXES)}", shown=repr(suffix)
        )
    if suffix == ".json":
        _check_plan_names_no_files(shown_name, data)
    with temporary_folder("planfly-studio-") as folder:
        file = folder / f"dropped{suffix}"
        file.write_bytes(data)
        if data.startswith(MCAP_MAGIC):
            # A log may name files in its scenario, or in the scenario of its plan.
            container = Container()
            with file.open("rb") as stream, contextlib.suppress(PlanflyError, *PARSE_ERRORS):
                stream.seek(len(MAGIC))
                # Errors in the log are reported when the log is read; only the attachments before an error are checked.
                for _ in read_chunks(stream, container):
                    pass
            attachments = container.attachments
            if SCENARIO_FILE in attachments:
                _check_plan_names_no_files(shown_name, b'{"scenario": ' + attachments[SCENARIO_FILE] + b"}")
            _check_plan_names_no_files(shown_name, attachments.get(PLAN_FILE, b""))
        try:
            document = open_document(str(file), options)
        except PlanflyError as error:
            raise PlanflyError(str(error).replace(str(file), shown_name), file=shown_name) from None
    return replace(document, name=shown_name, stem=Path(shown_name).stem, path=None)


def _check_plan_names_no_files(name: str, data: bytes) -> None:
    """Raise PlanflyError if the scenario of a plan names files of this machine.

    A page must not read these files.
    """
    try:
        scenario = json.loads(data)["scenario"]
        named_files = [scenario.get("terrain", {}).get("path"), scenario.get("flight", {}).get("params")]
        aircraft = scenario.get("flight", {}).get("aircraft")
        # An aircraft is a name or the path of a folder.
        is_path = isinstance(aircraft, str) and ("/" in aircraft or "\\" in aircraft)
        named_files += [scenario.get("zones_file"), aircraft if is_path else None]
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        # Errors in the plan are reported when the plan is read.
        return
    for file in named_files:
        if file is not None and str(file) not in EMBEDDED:
            allowed = "a plan that names other files can only be opened by the command: planfly studio plan.json"
            raise MissionError.at(name, "scenario", str(file)[:60], allowed)


def _log_mission_setup(scenario: Scenario, mission: Mission, seed: int) -> FlightSetup:
    """Return the flight setup of the mission in a log, with the UAV of its scenario.

    seed: seed of the flight.
    """
    return make_setup(scenario, load_uav(scenario), mission, seed)


def straight_plan(scenario: Scenario, seed: int) -> Plan:
    """Return a placeholder plan, the straight line from start to destination.

    No check has certified this plan.

    seed: seed that the plan states.
    """
    line = np.stack([scenario.start, scenario.destination])
    certificate = Certificate(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, ("not planned yet",))
    counts, objectives = Violations(0, 0, 0, 0), Objectives(1.0, 0.0, 0.0, 0.0)
    return Plan(scenario, line, counts, objectives, certificate, seed, "", 0, np.zeros((0, 3)))


def planned_mission(plan: Plan, uav: Uav) -> Mission:
    """Return the mission that flies a plan, named after the scenario of the plan."""
    return mission_of_plan(plan, uav, plan.scenario.name)


# ----------------------------------------------------------------------
# Save a document.


@dataclass(frozen=True, slots=True)
class SavedFile:
    """Name and bytes of a saved file.

    It has a line for each part of the mission that the format cannot store.
    """

    name: str
    data: bytes
    losses: tuple[str, ...] = ()


def save_document(document: Document, context: EditContext, judged_mission: JudgedMission, kind: str) -> SavedFile:
    """Return the edited mission as a file.

    An unchanged mission in its original format is saved as the original bytes.

    kind: one of `SAVED_SUFFIXES`.

    Raises PlanflyError if this kind of file cannot store the mission.
    """
    mission, name = judged_mission.mission, f"{document.stem}{SAVED_SUFFIXES[kind]}"
    if kind == "parm":
        if not context.parameters.values:
            raise PlanflyError("no parameter was set in the studio: set one under Settings", field="form")
        parameter_text = context.parameters.text(f"set in planfly studio for {context.uav.autopilot.title}")
        return SavedFile(name, parameter_text.encode())
    has_same_world = kind != "plan.json" or context.scenario is document.setup.scenario
    if kind == document.kind and mission is document.setup.mission and has_same_world:
        return SavedFile(name, document.data, _lost_settings(document.setup, context))
    if kind == "plan.json":
        # A plan whose certificate still applies is saved as it is; a new plan is certified.
        if (plan := judged_mission.setup.plan) is not None:
            return SavedFile(name, plan_json(plan).encode())
        plan = make_certified_plan(context, judged_mission)
        keeps_items = context.planned and planned_mission(plan, context.uav).items == mission.items
        plan_losses = [] if keeps_items else ["the items, because a plan stores only positions"]
        if plan.failures:
            plan_losses.append(f"the plan is not feasible: {plan.failures[0]}")
        elif plan.unmet_margins:
            plan_losses.append(f"planner's margins not met: {plan.unmet_margins[0]}")
        return SavedFile(name, plan_json(plan).encode(), (*plan_losses, *_lost_parameters(context)))
    if kind == "kml":
        text = kml_text(context.scenario.name, [plan_line(judged_mission.setup)], map_zones(judged_mission.setup))
        data = text.encode() if isinstance(text, str) else text
        return SavedFile(name, data, ("the commands, speeds and frames of the items, because the file is only a map",))
    start_airspeed = float(judged_mission.setup.route.leg_airspeeds[0])
    is_stated_in_file = document.kind == "plan" and start_airspeed == document.setup.route.leg_airspeeds[0]
    if kind == "plan" and not is_stated_in_file:
        mission = replace(mission, cruise_speed=start_airspeed)
    mission = replace(mission, autopilot=judged_mission.setup.autopilot.name)
    text = mission_text(mission, "waypoints" if kind == "waypoints" else "plan")
    # Parts of the mission that a ground station's file cannot store.
    parsed, losses = parse_mission(text, name), []
    lost_counts: Mapping[str, tuple[int, str]] = {
        "fence item": (len(mission.fences) - len(parsed.fences), "only in a .plan"),
        "rally point": (len(mission.rally) - len(parsed.rally), "only in a .plan"),
        "survey plan": (len(mission.survey_plans), "the items are kept; other data of the ground station is lost"),
    }
    losses += [
        f"{count_text(count, noun)}: {explanation}" for noun, (count, explanation) in lost_counts.items() if count > 0
    ]
    if kind == "waypoints" and mission.cruise_speed != parsed.cruise_speed and mission.cruise_speed is not None:
        losses.append("the ground station's cruise speed")
    threats, zones = len(context.scenario.threats), len(context.scenario.zones)
    world_contents = [count_text(count, noun) for count, noun in ((threats, "threat"), (zones, "zone")) if count]
    if world_contents:
        losses.append(f"the scenario's {' and '.join(world_contents)}: planfly export writes them as a fence")
    return SavedFile(name, text.encode(), (*losses, *_lost_settings(document.setup, context)))


def _lost_settings(opened_setup: FlightSetup, context: EditContext) -> tuple[str, ...]:
    """Return lines on changed settings and parameters that a mission file cannot store.

    They were changed in the studio.

    opened_setup: setup as opened, with the settings before the changes.
    """
    opened, current = (
        settings_json(scenario, uav, context.parameters, {})
        for scenario, uav in (
            (opened_setup.scenario, uav_of_setup(opened_setup)),
            (context.scenario, context.uav),
        )
    )
    names = changed_settings(opened, current)
    losses = (f"the settings changed in the studio: {', '.join(names)}",) if names else ()
    return (*losses, *_lost_parameters(context))


def _lost_parameters(context: EditContext) -> tuple[str, ...]:
    """Return one line on the autopilot parameters set in the studio, which only a .parm file stores.

    Return () without any.
    """
    count = len(context.parameters.values)
    return (f"{count_text(count, 'parameter')} set in the studio: only a .parm contains them",) if count else ()


def make_certified_plan(context: EditContext, judged_mission: JudgedMission) -> Plan:
    """Make a plan from the waypoints of an edited route, and certify it as the planner does.

    An opened plan that was not changed is returned with its certificate.

    Raises MissionError for a mission without a scenario, and for items that a plan cannot store.
    """
    mission, route, scenario = judged_mission.mission, judged_mission.setup.route, context.scenario
    name = mission.source
    if scenario.external:
        raise MissionError(
            f"{name}: a plan needs a scenario, but this mission was opened without one (--scenario)", file=name
        )
    has_unique_waypoints = (
        not route.arc_radii.any() and len(set(route.items[route.items >= 0].tolist())) == (route.items >= 0).sum()
    )
    if (
        not has_unique_waypoints
        or route.rtl_loiter is not None
        or any(item.frame not in AMSL and item.has_position for item in mission.items)
    ):
        raise MissionError(
            f"{name}: a plan can contain only plain waypoints with altitudes above mean sea level, each flown once",
            file=name,
        )
    if (plan := _plan_with_ground_phases(context, mission)) is not None:
        return plan
    # A plan cannot store a take-off, a landing, or a change of speed along the path.
    first = next((index for index, item in enumerate(mission.items) if item.has_position), 0)
    for index, item in enumerate(mission.items):
        lost_content = "its take-off" if item.command in TAKEOFFS else "its landing" if item.command in LANDINGS else ""
        if item.command == Command.DO_CHANGE_SPEED and index > first:
            lost_content = "a change of speed along its path"
        if lost_content:
            reason = (
                f"a plan.json of edited waypoints cannot contain {lost_content} (item {item.seq}):"
                " save a .plan, or plan again"
            )
            raise MissionError(f"{name}: {reason}", file=name, field=f"item {item.seq}")
    return _certified_plan(context, np.array(route.positions)[route.items >= 0])


def _certified_plan(context: EditContext, waypoints: Floats) -> Plan:
    """Return a plan with the given waypoints (w, 3), m, certified in the scenario of the editing context."""
    return certify_waypoints(context.scenario, context.uav.limits.with_margin(), waypoints, seed=context.seed)


def _plan_with_ground_phases(context: EditContext, mission: Mission) -> Plan | None:
    """Return a plan of the edited waypoints with the opened plan's departure and approach.

    Returns None without an opened plan, and if it has neither departure nor approach.

    Departure and approach were certified together with the turns at their ends, so the adjacent legs must be unchanged.
    Raises MissionError if these legs were changed.
    """
    opened_plan = context.opened_setup.plan
    if (
        opened_plan is None
        or opened_plan.procedures is None
        or (opened_plan.procedures.climb, opened_plan.procedures.descent) == (None, None)
    ):
        return None
    climb, descent, points = (
        opened_plan.procedures.climb,
        opened_plan.procedures.descent,
        context.item_positions(mission),
    )
    departure_count = 0 if climb is None else 1 + len(climb.waypoints)
    approach_count = 0 if descent is None else len(descent.waypoints) + len(descent.final_waypoints) + 1
    waypoints = points[departure_count : len(points) - approach_count]
    is_unchanged = len(waypoints) > 1 and all(
        procedure is None or np.allclose(waypoints[ends], opened_plan.waypoints[ends], atol=_ALTITUDE_TOLERANCE_M)
        for procedure, ends in ((climb, slice(2)), (descent, slice(-2, None)))
    )
    if is_unchanged:
        plan = replace(_certified_plan(context, waypoints), procedures=opened_plan.procedures)
        ground_problems = [
            problem for problem in opened_plan.certificate.problems if problem.startswith(GROUND_PROBLEMS)
        ]
        plan = replace(
            plan, certificate=replace(plan.certificate, problems=(*plan.certificate.problems, *ground_problems))
        )
        # The plan must have the commands of the mission, at positions that differ only by rounding.  Commands without a
        # position must also have the same parameters.
        missions = (planned_mission(plan, context.uav), mission)
        commands, other_commands = (
            [(item.command, item.has_position or item.params) for item in one.items] for one in missions
        )
        if commands == other_commands:
            positions, other_positions = (
                np.array([(item.lat_deg, item.lon_deg, item.alt) for item in one.items]) for one in missions
            )
            tolerances = (_POSITION_TOLERANCE_DEG, _POSITION_TOLERANCE_DEG, _ALTITUDE_TOLERANCE_M)
            if (np.abs(positions - other_positions) <= tolerances).all():
                return plan
    reason = (
        "its departure or landing, or a leg next to them, differs from the opened plan: save a .plan, or plan again"
    )
    raise MissionError(f"{mission.source}: {reason}", file=mission.source)
