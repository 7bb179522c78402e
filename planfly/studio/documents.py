"""Open documents in the studio, and save the edited mission, with a list of the contents that each format loses."""

import contextlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from flight.mission.items import AMSL, LANDINGS, TAKEOFFS, Command, Mission
from flight.mission_files.formats import mission_text, parse_mission
from flight.simulation.setup import FlightSetup
from logs.importers.open_log import is_imported_log
from logs.recording.mcap_reader import MAGIC, PARSE_ERRORS, Container, read_chunks
from logs.recording.reader import read_log
from logs.recording.setup_attachments import PLAN_FILE, SCENARIO_FILE
from logs.views.exports.map_files import kml_text, map_zones, plan_line
from planfly.api.imported import read_imported
from planfly.flight_logs import MCAP_MAGIC, is_log
from planfly.flight_options import LogOptions, MissionOptions, apply_options, named_scenario
from planfly.studio.edit_context import EditContext
from planfly.workflow.airframe import Airframe, choose_seed, load_airframe
from planfly.workflow.imported_flights import ImportedFlight
from planfly.workflow.mission_context import JudgedMission
from planfly.workflow.open_flight import make_setup, mission_of_plan, open_flight
from planner.evaluation.certify import certify
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import make_problem
from planner.plan import Certificate, Objectives, Plan, Violations, plan_json
from world.arrays import Floats
from world.elevation_formats import EMBEDDED
from world.errors import LogError, MissionError, PlanflyError
from world.files import temporary_folder
from world.scenario import Scenario, embedded_names

# Maximum size of a file dropped on the page, bytes.
MAX_DROPPED = 16 * 2**20
# File types that may be dropped.  They are those that `planfly check` reads and that do not name other files.
DROPPED = (".waypoints", ".txt", ".plan", ".json", ".mcap", ".bin", ".tlog", ".ulg", ".gpx", ".igc", ".kml", ".kmz")
# File types that a mission can be opened from and saved as.
KINDS = {"waypoints": ".waypoints", "plan": ".plan", "plan.json": ".json", "kml": ".kml"}
# All file types that can be saved.
SAVED = KINDS | {"parm": ".parm"}
# Latitudes and longitudes within this difference are the same place, degrees; files round to 1e-7 degrees.
_SAME_PLACE_DEG = 2e-7
# Altitudes within this difference are the same, m.
_SAME_ALTITUDE_M = 0.02


@dataclass(frozen=True, slots=True)
class Document:
    """Opened mission and its origin.

    name: name shown to the user.
    stem: stem of the names of saved files.
    setup: setup of the opened mission.
    kind: key in `KINDS`, or "" if the document was not a mission file.
    data: bytes of the file, which an unchanged mission is saved as.
    path: the file that the command named; None for any other document.
    on_disk: bytes of this file, as last known.
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
    """Open a scenario, a plan, a mission or a log, by name or path.  Raises PlanflyError."""
    if target in embedded_names() or target.lower().endswith(".toml"):
        return _scenario_document(named_scenario(target, options), options.get("seed"))
    path = Path(target)
    setup = _open_file(path, options)
    kind = next((kind for kind, suffix in KINDS.items() if suffix == path.suffix.lower()), "")
    kind = "waypoints" if path.suffix.lower() == ".txt" else "" if kind == "kml" else kind
    data = path.read_bytes() if kind else b""
    return Document(path.name, path.stem, setup, kind, data, path, data)


def open_dropped(name: str, data: bytes, options: MissionOptions) -> Document:
    """Open a file that was dropped on the page, by its bytes and the suffix of its name.  Raises PlanflyError."""
    suffix = Path(name).suffix.lower()
    shown = "".join(ch if ch.isprintable() and ch not in "/\\" else "_" for ch in name)[-60:] or "dropped"
    if suffix not in DROPPED:
        raise MissionError.at(shown, "suffix", suffix, f"allowed {', '.join(DROPPED)}", shown=repr(suffix))
    if suffix == ".json":
        _refuse_other_files(shown, data)
    with temporary_folder("planfly-studio-") as folder:
        file = folder / f"dropped{suffix}"
        file.write_bytes(data)
        if data.startswith(MCAP_MAGIC):
            _refuse_log_naming_files(shown, file)
        try:
            opened = open_document(str(file), options)
        except PlanflyError as error:
            raise PlanflyError(str(error).replace(str(file), shown), file=shown) from None
    return replace(opened, name=shown, stem=Path(shown).stem, path=None)


def _refuse_log_naming_files(name: str, file: Path) -> None:
    """Raise PlanflyError for a log whose scenario, or whose plan's scenario, names files of this machine."""
    found = Container()
    with file.open("rb") as stream, contextlib.suppress(PlanflyError, *PARSE_ERRORS):
        stream.seek(len(MAGIC))
        # Errors in the log are reported when the log is read; here the attachments before an error are checked.
        for _ in read_chunks(stream, found):
            pass
    if SCENARIO_FILE in found.attachments:
        _refuse_other_files(name, b'{"scenario": ' + found.attachments[SCENARIO_FILE] + b"}")
    _refuse_other_files(name, found.attachments.get(PLAN_FILE, b""))


def _refuse_other_files(name: str, data: bytes) -> None:
    """Raise PlanflyError for a plan whose scenario names files of this machine, which a page must not read."""
    try:
        scenario = json.loads(data)["scenario"]
        named = [scenario.get("terrain", {}).get("path"), scenario.get("flight", {}).get("params")]
        named += [scenario.get("zones_file"), _aircraft_folder(scenario.get("flight", {}).get("aircraft"))]
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        # Errors in the plan are reported when the plan is read.
        return
    for one in named:
        if one is not None and str(one) not in EMBEDDED:
            allowed = "a plan that names other files is opened by the command: planfly studio plan.json"
            raise MissionError.at(name, "scenario", str(one)[:60], allowed)


def _aircraft_folder(aircraft: Any) -> str | None:
    return aircraft if isinstance(aircraft, str) and ("/" in aircraft or "\\" in aircraft) else None


def _open_file(path: Path, options: MissionOptions) -> FlightSetup:
    """Return the setup of a plan, of a mission, or of the mission in a log."""
    if path.is_file() and is_imported_log(path):
        setup = _read_imported_log(path, options).setup
        return _log_mission_setup(setup.scenario, setup.mission, setup.seed)
    if path.is_file() and is_log(path):
        setup = read_log(path).setup
        return _log_mission_setup(apply_options(setup.scenario, options), setup.mission, setup.seed)
    return open_flight(path, options)


def _read_imported_log(path: Path, options: MissionOptions) -> ImportedFlight:
    """Read the flight of another program's log.

    Raises PlanflyError; for a track without a mission, its message fits the studio.
    """
    world: LogOptions = {
        "scenario": options.get("scenario"),
        "terrain": options.get("terrain"),
        "fence": options.get("fence") or (),
    }
    try:
        return read_imported(path, **world)
    except LogError as error:
        if "contains no mission" not in str(error):
            raise
        alone = "a flight's track without a mission: open the file of its mission"
        raise MissionError(f"{path}: {alone}", file=path) from None


def _log_mission_setup(scenario: Scenario, mission: Mission, seed: int) -> FlightSetup:
    """Return the setup to fly the mission of a log again."""
    return make_setup(scenario, load_airframe(scenario), mission, seed)


def _scenario_document(scenario: Scenario, seed: int | None) -> Document:
    """Return a document of a scenario, with a straight line from start to destination until a path is planned."""
    airframe, number = load_airframe(scenario), choose_seed(scenario, seed)
    mission = planned_mission(straight_plan(scenario, number), airframe)
    setup = make_setup(scenario, airframe, mission, number)
    return Document(scenario.name, scenario.name, setup, to_plan=True)


def straight_plan(scenario: Scenario, seed: int) -> Plan:
    """Return the straight line from start to destination as a plan that is not certified."""
    line = np.stack([scenario.start, scenario.destination])
    certificate = Certificate(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, ("not planned yet",))
    counts, objectives = Violations(0, 0, 0, 0), Objectives(1.0, 0.0, 0.0, 0.0)
    return Plan(scenario, line, counts, objectives, certificate, seed, "", 0, np.zeros((0, 3)))


def planned_mission(plan: Plan, airframe: Airframe) -> Mission:
    """Return the mission of a plan, named after the scenario."""
    return mission_of_plan(plan, airframe, plan.scenario.name)


# ----------------------------------------------------------------------
# Save a document.


@dataclass(frozen=True, slots=True)
class Saved:
    """Name and bytes of a saved file, and one line for each content that the format cannot store."""

    name: str
    data: bytes
    losses: tuple[str, ...] = ()


def save_document(document: Document, desk: EditContext, judged: JudgedMission, kind: str) -> Saved:
    """Return the mission under edit in one of `KINDS`.  Raises PlanflyError if the format cannot hold it.

    An unchanged mission in its original format is saved as the original bytes.
    """
    mission, name = judged.mission, f"{document.stem}{SAVED[kind]}"
    if kind == "parm":
        return _saved_parameters(name, desk)
    before = document.setup.scenario
    same = kind != "plan.json" or desk.scenario is before
    if kind == document.kind and mission is document.setup.mission and same:
        return Saved(name, document.data, _lost_settings(before, desk))
    if kind == "plan.json":
        return _saved_plan(name, desk, judged)
    if kind == "kml":
        text = kml_text(desk.scenario.name, [plan_line(judged.setup)], map_zones(judged.setup))
        return Saved(
            name, _to_bytes(text), ("only a map: it does not contain the commands, speeds and frames of the items",)
        )
    mission = replace(mission, autopilot=judged.setup.autopilot.name)
    text = mission_text(mission, "waypoints" if kind == "waypoints" else "plan")
    losses = (*_format_losses(desk, mission, text, name, kind), *_lost_settings(before, desk))
    return Saved(name, text.encode(), losses)


def _to_bytes(text: str | bytes) -> bytes:
    return text.encode() if isinstance(text, str) else text


def _format_losses(desk: EditContext, mission: Mission, text: str, name: str, kind: str) -> tuple[str, ...]:
    """List the contents of a mission and its world that a ground station's file cannot store."""
    kept, found = parse_mission(text, name), []
    apart: Mapping[str, tuple[int, str]] = {
        "fence items": (len(mission.fences) - len(kept.fences), "a .plan contains them"),
        "rally points": (len(mission.rally) - len(kept.rally), "a .plan contains them"),
        "survey plans": (
            len(mission.survey_plans),
            "their items stay; other data of the ground station is lost",
        ),
    }
    found += [f"{count} {what}: {how}" for what, (count, how) in apart.items() if count > 0]
    if kind == "waypoints" and mission.cruise_speed != kept.cruise_speed and mission.cruise_speed is not None:
        found.append("the ground station's cruise speed")
    threats, zones = len(desk.scenario.threats), len(desk.scenario.zones)
    world = [f"{count} {what}" for count, what in ((threats, "threats"), (zones, "zones")) if count]
    if world:
        found.append(f"the scenario's {' and '.join(world)}: planfly export writes them as a fence")
    return tuple(found)


def _lost_settings(before: Scenario, desk: EditContext) -> tuple[str, ...]:
    """List the settings changed in the studio, which a ground station's file cannot store."""
    now = desk.scenario
    differs = {
        "wind": before.spec.wind != now.spec.wind,
        "aircraft, autopilot or airspeed": before.spec.flight != now.spec.flight,
        "limits": before.spec.limits != now.spec.limits or before.ceiling != now.ceiling,
    }
    names = [name for name, other in differs.items() if other]
    lost = (f"the settings changed here: {', '.join(names)}",) if names else ()
    return (*lost, *_lost_parameters(desk))


def _lost_parameters(desk: EditContext) -> tuple[str, ...]:
    """Return a line on the autopilot parameters set in the studio, which only a parameter file stores, or nothing."""
    count = len(desk.parameters.values)
    return (f"{count} parameter{'s' if count != 1 else ''} set here: a .parm contains them",) if count else ()


def _saved_parameters(name: str, desk: EditContext) -> Saved:
    """Return a file of the parameters set in the studio.  Raises PlanflyError if no parameter was set."""
    if not desk.parameters.values:
        raise PlanflyError("no parameter was set here: Settings sets them", field="form")
    return Saved(name, desk.parameters.text(f"set in planfly studio for {desk.airframe.autopilot.title}").encode())


def _saved_plan(name: str, desk: EditContext, judged: JudgedMission) -> Saved:
    """Return the mission as a plan of its scenario, with the present certificate of its path."""
    plan = judged.setup.plan
    if plan is not None:
        return Saved(name, plan_json(plan).encode())
    made = certified_plan(desk, judged)
    changed = not desk.planned or planned_mission(made, desk.airframe).items != judged.mission.items
    losses = ["the items: a plan contains only positions, from which its mission is made again"] if changed else []
    if not made.feasible:
        problem = (made.certificate.problems or ("violations are counted",))[0]
        losses.append(f"it is a plan that is not feasible: {problem}")
    return Saved(name, plan_json(made).encode(), (*losses, *_lost_parameters(desk)))


def _require_plain_waypoints(mission: Mission) -> None:
    """Raise MissionError for items that a plan would drop, which are take-off, landing and speed changes en route."""
    first = next((k for k, item in enumerate(mission.items) if item.has_position), 0)
    for k, item in enumerate(mission.items):
        lost = "its take-off" if item.command in TAKEOFFS else "its landing" if item.command in LANDINGS else ""
        if item.command == Command.DO_CHANGE_SPEED and k > first:
            lost = "a change of speed along its path"
        if lost:
            why = (
                f"a plan.json of edited waypoints cannot contain {lost} (item {item.seq}): save a .plan, or plan again"
            )
            raise MissionError(f"{mission.source}: {why}", file=mission.source, field=f"item {item.seq}")


def certified_plan(desk: EditContext, judged: JudgedMission) -> Plan:
    """Make a plan of the waypoints of the route, scored and certified like plans of the planner.

    Raises MissionError for a mission without a scenario, and for a mission with items other than plain waypoints,
    because a plan cannot store it.
    """
    mission, route, scenario = judged.mission, judged.setup.route, desk.scenario
    name = mission.source
    if scenario.external:
        raise MissionError(
            f"{name}: a plan needs a scenario, and this mission came without one (--scenario)", file=name
        )
    plain = not route.arcs.any() and len(set(route.items[route.items >= 0].tolist())) == (route.items >= 0).sum()
    if (
        not plain
        or route.return_to is not None
        or any(one.frame not in AMSL and one.has_position for one in mission.items)
    ):
        raise MissionError(
            f"{name}: a plan contains only plain waypoints with altitudes above mean sea level, each once", file=name
        )
    if (made := _plan_with_ground_phases(desk, mission)) is not None:
        return made
    _require_plain_waypoints(mission)
    return _scored_plan(desk, np.array(route.waypoints)[route.items >= 0])


def _scored_plan(desk: EditContext, waypoints: Floats) -> Plan:
    problem = make_problem(desk.scenario, desk.airframe.limits.surely())
    certificate = certify(problem, waypoints)
    counts, objectives = paper_scores(problem.certified, waypoints[None])
    scores = Violations(*counts[0]), Objectives(*objectives[0])
    return Plan(desk.scenario, waypoints, *scores, certificate, desk.seed, "edited", 0, np.zeros((0, 3)))


def _plan_with_ground_phases(desk: EditContext, mission: Mission) -> Plan | None:
    """Return the edited plan with its unchanged departure and approach, or None if it has neither.

    Departure and approach were certified with the turns at their ends, so the adjacent legs in the air must be
    unchanged.  Raises MissionError if these legs were changed.
    """
    base = desk.opened.plan
    if base is None or base.ways is None or (base.ways.climb, base.ways.descent) == (None, None):
        return None
    climb, descent, points = base.ways.climb, base.ways.descent, desk.points(mission)
    before = 0 if climb is None else 1 + len(climb.waypoints)
    after = 0 if descent is None else len(descent.waypoints) + len(descent.line_up) + 1
    waypoints = points[before : len(points) - after]
    kept = len(waypoints) > 1 and all(
        way is None or np.allclose(waypoints[ends], base.waypoints[ends], atol=_SAME_ALTITUDE_M)
        for way, ends in ((climb, slice(2)), (descent, slice(-2, None)))
    )
    if kept:
        made = replace(_scored_plan(desk, waypoints), ways=base.ways)
        own = [one for one in base.certificate.problems if one.startswith(("climb-out: ", "landing: "))]
        made = replace(made, certificate=replace(made.certificate, problems=(*made.certificate.problems, *own)))
        if _have_same_places(planned_mission(made, desk.airframe), mission):
            return made
    why = "its departure or landing, or a leg next to them, is no longer that of its plan: save a .plan, or plan again"
    raise MissionError(f"{mission.source}: {why}", file=mission.source)


def _have_same_places(one: Mission, other: Mission) -> bool:
    """Return True if two missions have the same commands at the same places."""
    done = [[(item.command, item.has_position or item.params) for item in mission.items] for mission in (one, other)]
    if done[0] != done[1]:
        return False
    here, there = (np.array([(item.lat_deg, item.lon_deg, item.alt) for item in it.items]) for it in (one, other))
    return bool((np.abs(here - there) <= (_SAME_PLACE_DEG, _SAME_PLACE_DEG, _SAME_ALTITUDE_M)).all())
