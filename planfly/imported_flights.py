"""Import flights logged by other programs: place them in a scenario, judge them, and fly them again."""

import hashlib
import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import Limits
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.catalog import autopilot_of_log
from flight.autopilots.parameter_origin import TITLES
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.dynamics.envelope_tables import load_envelope
from flight.mission.implied_scenario import implied_scenario
from flight.mission.items import Mission
from flight.mission.placing import PlacedMission, place_stops
from flight.mission.route import lay_route
from flight.mission_files.formats import mission_text, read_mission
from flight.simulation.setup import FlightSetup, ImportedLog, VerticalDatum, make_limits
from flight.simulation.simulate import simulate
from flight.simulation.track import Track
from logs.importers.clean_places import LONGEST_STEP
from logs.importers.imported_flight import LoggedFlight, make_flight, mean_wind, track_of_flight, with_flown_heights
from logs.importers.open_log import open_log
from logs.recording.reader import LogEvent
from logs.verdict.imported.flown_legs import FlownLegs, flown_legs, plan_mismatch
from logs.verdict.imported.judge_imported_flight import missing_text
from logs.verdict.imported.model_comparison import Reflight, compare_with_model
from logs.verdict.judge_flight import judge_flight
from logs.verdict.verdict import Verdict
from planfly.airframe import find_airframe
from planfly.make_plan import Advance
from planfly.open_mission import NamedFences, ScenarioChange, open_plan
from world.errors import LogError, MissionError
from world.scenario import Scenario, load_scenario, with_flight, with_wind
from world.scenario_tables import FlightTable

Floats = NDArray[np.float64]

# Bytes that are hashed at a time.
_HASH_BLOCK_BYTES = 2**20
# Least number of items of a mission.
_MIN_MISSION_ITEMS = 2


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """Options for an imported flight, in addition to its log; None if an option is not given.

    plan: mission file or plan.json that was to be flown.
    scenario: scenario to judge the flight in.  terrain: elevation file.
    aircraft: name or folder; without an aircraft none of its limits apply.
    datum: vertical datum of the altitudes of the log, if the log states none.
    number: number of the flight in the log, from 1.
    wind_given: true if the wind is given instead of taken from the log.
    fences: fences that apply in addition to the fences of the mission and the scenario.
    """

    plan: Path | None = None
    scenario: str | None = None
    terrain: str | None = None
    aircraft: str | None = None
    datum: VerticalDatum | None = None
    number: int | None = None
    wind_given: bool = False
    fences: NamedFences = field(default_factory=NamedFences)


@dataclass(frozen=True, slots=True, repr=False)
class ImportedFlight:
    """Imported flight with its verdict.

    setup: setup with its source.  track: rows of the track.  events: messages of the vehicle.
    ended: how the flight ended, according to the log.
    """

    setup: FlightSetup
    track: Track
    events: tuple[LogEvent, ...]
    verdict: Verdict
    ended: str

    @property
    def lossy(self) -> bool:
        """True if some of the log could not be read."""
        return self.setup.source is not None and self.setup.source.damage.lossy

    def __repr__(self) -> str:
        return f"<ImportedFlight {self.setup.scenario.name}: {self.ended}; {self.track!r}, {self.verdict!r}>"

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook."""
        return self.verdict._repr_html_() + self.track._repr_html_()


def import_flight(path: Path, options: ImportOptions, change: ScenarioChange) -> ImportedFlight:
    """Read a log, place it in its scenario and judge the flight.

    change: makes another scenario of the one that the flight is judged in.  Raises LogError for a file that is no log
    of an aeroplane's flight, MissionError if no mission is known or the plan is not the one flown.
    """
    flight = make_flight(open_log(path), options.number)
    mission, origin_of_mission, planned_in = _find_mission(path, flight, options)
    mission = options.fences.on_mission(mission)
    plan_heights = options.plan is not None or flight.mission is None or flight.mission.with_heights
    if not plan_heights:
        mission = with_flown_heights(mission, flight.lat, flight.lon, flight.up)
    _require_same_autopilot(path, mission, flight.raw.program)
    scenario, placed = _place_mission(mission, options, planned_in)
    scenario, wind_source = _with_logged_wind(options.fences.on_scenario(change(scenario)), flight, options)
    known = options.aircraft is not None or options.scenario is not None or planned_in is not None
    logged = autopilot_of_log(flight.raw.program, flight.raw.parameters, flight.raw.source)
    # Judge a flight by an autopilot unknown to planfly by the limits of the aircraft.
    autopilot, refused = logged or (PlanflyGuidance(scenario.flight.steering.guidance), ())
    setup = _make_logged_setup(scenario, placed, mission, autopilot, flight)
    heights = flight.heights
    if options.datum is not None and heights.datum == "unstated":
        heights = replace(heights, datum=options.datum)
    notes = (
        *_coverage_notes(flight),
        *_other_flight_notes(flight),
        *refused,
        *mission.warnings,
        *_plan_difference_notes(flight, mission, options),
    )
    source = ImportedLog(
        missing=None if options.plan is not None or flight.mission is None else flight.mission.missing,
        file=path.name,
        sha256=_sha256(path),
        format=flight.raw.format,
        program=flight.raw.program,
        utc_start=flight.raw.utc_start,
        holds=flight.holds,
        stretches=flight.stretches,
        heights=heights,
        wind=wind_source,
        mission=origin_of_mission,
        plan_heights=plan_heights,
        aircraft_known=known,
        begins_in_flight=flight.begins,
        gaps=flight.gaps,
        faults=flight.faults,
        damage=flight.raw.damage,
        notes=notes,
    )
    setup = replace(setup, source=source)
    track = track_of_flight(flight, scenario.origin)
    if options.plan is not None:
        mismatch = plan_mismatch(setup, track)
        if mismatch is not None:
            raise MissionError(f"{path}: not flown by {options.plan}: {mismatch.text}", file=path)
    verdict = judge_flight(setup, track, "")
    ended = "completed" if verdict.complete else _completion_text(verdict)
    return ImportedFlight(setup, track, _flight_events(flight), verdict, ended)


def _require_same_autopilot(path: Path, mission: Mission, program: str) -> None:
    """Raise MissionError for a plan that was written for another autopilot than the one in the log."""
    flown = next((name for name, title in TITLES.items() if program.lower().startswith(title[:5].lower())), "")
    if mission.autopilot and flown and mission.autopilot != flown:
        allowed = f"the flight of {path} is {program}'s: `plan` names the mission that was flown"
        message = f"{mission.source}: written for {TITLES[mission.autopilot]}: {allowed}"
        raise MissionError(message, file=mission.source, field="autopilot", value=mission.autopilot, allowed=allowed)


def _find_mission(path: Path, flight: LoggedFlight, options: ImportOptions) -> tuple[Mission, str, Scenario | None]:
    """Return the mission that was to be flown, its origin, and the scenario of its plan."""
    if options.plan is not None:
        if options.plan.suffix.lower() == ".json":
            opened = open_plan(options.plan, options.terrain)
            return opened.mission, f"of {options.plan.name}", opened.scenario
        if not options.plan.is_file():
            raise MissionError(
                f"{options.plan}: no such file; a plan.json, .waypoints or .plan file is expected", file=options.plan
            )
        return read_mission(options.plan), f"of {options.plan.name}", None
    if flight.mission is None:
        raise LogError(f"{path}: holds no mission: `plan` names the one that was to be flown", file=path)
    found = flight.mission
    if found.missing is not None and len(found.mission.items) < _MIN_MISSION_ITEMS:
        lacking = [missing_text(found.missing), *found.mission.warnings[:1]]
        lacking.append("`plan` names the mission that was to be flown")
        raise LogError(f"{path}: {'; '.join(lacking)}", file=path)
    when = f", at {found.time:.1f} s" if found.time > 0.0 else ""
    return found.mission, f"{found.origin} of the log{when}, {len(found.mission.items)} items", None


def _place_mission(
    mission: Mission, options: ImportOptions, planned_in: Scenario | None
) -> tuple[Scenario, PlacedMission]:
    """Return the scenario that a flight is judged in, and the mission placed in it."""
    scenario = planned_in
    if options.scenario is not None:
        scenario = load_scenario(options.scenario, options.terrain)
    if scenario is None:
        # Place the mission as ArduPlane flies it, so that a simulated flight can be compared with the log.
        table = FlightTable() if options.aircraft is None else FlightTable(aircraft=options.aircraft)
        implied = implied_scenario(mission, options.terrain, table, vertical_legs=True)
        return implied.scenario, implied.placed
    return scenario, place_stops(mission, scenario.origin, scenario.terrain, vertical_legs=True)


def _with_logged_wind(scenario: Scenario, flight: LoggedFlight, options: ImportOptions) -> tuple[Scenario, str]:
    """Return the scenario with the mean wind of the mission parts, and the source of the wind."""
    if options.wind_given:
        return scenario, "as given"
    found = mean_wind(flight)
    if found is None:
        own = "as the scenario has it: the log holds no wind" if options.scenario else ""
        return scenario, own
    blown = with_wind(scenario, found.speed, found.from_course, None)
    return blown, f"from {round(math.degrees(found.from_course)) % 360:03d}°, by {found.source} of the log"


def _make_logged_setup(
    scenario: Scenario,
    placed: PlacedMission,
    mission: Mission,
    autopilot: Autopilot,
    flight: LoggedFlight,
) -> FlightSetup:
    aircraft, battery = find_airframe(scenario)
    limits = _logged_limits(scenario, autopilot, flight, aircraft.airspeed)
    return FlightSetup(
        scenario=scenario,
        mission=mission,
        mission_text=mission_text(mission, "waypoints"),
        route=lay_route(placed, limits.airspeed, scenario.flight.fly_over, limits, autopilot.route_rules),
        limits=limits,
        aircraft=aircraft.name,
        battery=battery,
        seed=1,
        autopilot=autopilot,
        nav=scenario.flight.steering.nav,
        guidance_hz=scenario.flight.guidance_hz,
    )


def _logged_limits(scenario: Scenario, autopilot: Autopilot, flight: LoggedFlight, usual: float) -> Limits:
    """Return limits at the airspeed of the autopilot or the scenario, or the median of the flight."""
    aircraft, _ = find_airframe(scenario)
    envelope = load_envelope(aircraft, motor_braking=scenario.flight.motor_braking)
    airspeed, bank = scenario.flight.airspeed_mps or usual, math.radians(scenario.flight.max_bank_deg)
    if autopilot.stated_airspeed is not None:
        airspeed, _ = autopilot.stated_airspeed
    elif scenario.flight.airspeed_mps is None and np.isfinite(flight.columns["airspeed"]).any():
        airspeed = float(np.nanmedian(flight.columns["airspeed"]))
    if autopilot.stated_bank is not None:
        bank = autopilot.stated_bank
    return make_limits(scenario, envelope, max(5.0, airspeed), bank)


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_HASH_BLOCK_BYTES):
            digest.update(block)
    return digest.hexdigest()


def _coverage_notes(flight: LoggedFlight) -> tuple[str, ...]:
    """Describe the parts of the flight that the log lacks: before it, after it, between its rows."""
    notes = []
    if flight.begins:
        notes.append(f"the log begins in flight, at {flight.time[0]:.1f} s")
    if flight.ends:
        notes.append(f"the log ends in flight, at {flight.time[-1]:.1f} s")
    usual = float(np.median(np.diff(flight.time)))
    if usual > LONGEST_STEP:
        notes.append(f"the log has a place every {usual:.1f} s: what was between them it does not show")
    return tuple(notes)


def _other_flight_notes(flight: LoggedFlight) -> tuple[str, ...]:
    """Note the other flights of a log."""
    if flight.count == 1:
        return ()
    others = ", ".join(f"at {start:.0f} s ({along:.0f} s along its mission)" for start, along in flight.others)
    return (f"flight {flight.number} of {flight.count} is judged; the others began {others} (--flight N)",)


def _plan_difference_notes(flight: LoggedFlight, mission: Mission, options: ImportOptions) -> tuple[str, ...]:
    """Describe the differences between the plan and the mission of the log."""
    if options.plan is None or flight.mission is None:
        return ()
    own = flight.mission.mission.items
    pairs = zip(own, mission.items, strict=False)
    changed = [one.seq for one, other in pairs if (one.x, one.y, one.alt) != (other.x, other.y, other.alt)]
    if len(own) == len(mission.items) and not changed:
        return ()
    if len(own) != len(mission.items):
        return (f"the mission of the log has {len(own)} items, the plan {len(mission.items)}",)
    return (f"{len(changed)} items of the log's own mission lie elsewhere than the plan's, item {changed[0]} first",)


def _flight_events(flight: LoggedFlight) -> tuple[LogEvent, ...]:
    """Return the messages of the vehicle during the flight, and its modes."""
    if not len(flight.time):
        return ()
    low, high = float(flight.time[0]), float(flight.time[-1])
    said = [(time, text) for time, text in flight.raw.events if text]
    said += [(mode.time, f"mode {mode.name}") for mode in flight.raw.modes]
    clock = flight.clock
    moved = np.array([time for time, _ in said])
    if clock is not None and said:
        moved = clock.on_clock(moved)
    events = zip(moved.tolist(), said, strict=True)
    inside = [LogEvent(max(low, time), text, "info") for time, (_, text) in events if low - 60.0 <= time <= high]
    return tuple(sorted(inside, key=lambda event: event.time))


def _completion_text(verdict: Verdict) -> str:
    found = next((item for item in verdict.findings if item.rule == "completion"), None)
    return "not judged" if found is None else found.brief


# ----------------------------------------------------------------------


def fly_again(
    setup: FlightSetup, track: Track, aircraft: str | None, turbulence: str | None, advance: Advance, most: int = 9
) -> tuple[Reflight, ...]:
    """Fly the logged parts of the mission again in simulation and compare the flights, the longest first.

    setup: setup with its source.  aircraft: flown in place of the aircraft of the setup.  turbulence: in place of the
    scenario's turbulence.  most: greatest number of parts, the longest are chosen.

    Raises LogError for a flight that followed none of its mission, and StartError if the model cannot begin.
    """
    return tuple(
        _fly_part_again(setup, legs, aircraft, turbulence, advance) for legs in _flown_parts(setup, track)[:most]
    )


def _fly_part_again(
    setup: FlightSetup, legs: FlownLegs, aircraft: str | None, turbulence: str | None, advance: Advance
) -> Reflight:
    scenario = with_wind(with_flight(setup.scenario, aircraft=aircraft), None, None, turbulence)
    model, battery = find_airframe(scenario)
    limits = setup.limits
    if model.name != setup.aircraft:
        envelope = load_envelope(model, motor_braking=scenario.flight.motor_braking)
        limits = make_limits(scenario, envelope, setup.airspeed, min(setup.max_bank, envelope.max_bank))
    own = replace(
        legs.requirements.setup,
        scenario=scenario,
        limits=limits,
        aircraft=model.name,
        battery=battery,
        source=None,
        nav="perfect",
    )

    def report(done: float, whole: float) -> None:
        advance(done, whole, f"{done / 1000:.1f} of {whole / 1000:.1f} km")

    flown = simulate(own, model, progress=report)
    if len(flown.track) < 2:
        raise LogError(f"{scenario.name}: {model.name} flew none of the mission: {flown.ended}", file=scenario.name)
    stands_in = setup.source is not None and not setup.source.aircraft_known and aircraft is None
    return compare_with_model(own, legs, flown.track, flown.ended, stands_in=stands_in)


def _flown_parts(setup: FlightSetup, track: Track) -> list[FlownLegs]:
    source = setup.source
    stretches = () if source is None else source.stretches
    found = [legs for stretch in stretches if (legs := flown_legs(setup, track, stretch)) is not None]
    if not found:
        name = "the log" if source is None else source.file
        raise LogError(f"{name}: none of its mission's legs was flown: there is nothing to fly again", file=name)
    return sorted(found, key=lambda legs: legs.first - legs.last)
