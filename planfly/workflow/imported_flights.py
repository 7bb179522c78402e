"""Import flight logs of other programs, and judge each in its scenario, mission and wind.

Its mission is flown again.
"""

import contextlib
import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flight.autopilots.autopilot import Autopilot
from flight.autopilots.catalog import autopilot_from_log
from flight.autopilots.parameter_origin import TITLES
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.dynamics.envelope_tables import load_envelope
from flight.dynamics.fdm import Variation
from flight.mission.commands import Command
from flight.mission.items import TAKEOFFS, Frame, Mission
from flight.mission.placing import PlacedMission, implied_scenario, place_stops
from flight.mission.route import route_through_stops
from flight.mission_files.formats import read_mission
from flight.simulation.setup import FlightSetup, ImportedLog, make_limits
from flight.simulation.simulate import BLOCK_DURATION_S, Flight
from flight.simulation.track import Track, TrackBuilder
from logs.importers.clean_positions import MAX_STEP_S
from logs.importers.imported_flight import LoggedFlight, make_flight, make_track, mean_wind, with_flown_altitudes
from logs.importers.open_log import open_log
from logs.recording.reader import LogEvent
from logs.verdict.imported.flown_legs import FlownLegs, flown_legs, plan_mismatch
from logs.verdict.imported.judge_imported_flight import missing_items_text
from logs.verdict.imported.model_comparison import Reflight, compare_with_model
from logs.verdict.judge_flight import judge_flight
from logs.verdict.verdict import Verdict
from planfly.flight_options import (
    LogOptions,
    apply_options,
    flight_entries,
    load_scenario_with_options,
    read_named_fences,
    with_file_autopilot,
)
from planfly.workflow.make_plan import Advance
from planfly.workflow.open_flight import check_mission_exists, mission_of_plan
from planfly.workflow.uav import carried_energy, load_uav, max_turn_bank, scenario_aircraft
from planner.plan import read_plan
from world.errors import LogError, MissionError, StartError
from world.frames import to_geo
from world.scenario import Scenario, with_flight, with_wind
from world.scenario_tables import FlightTable
from world.wording import count_text

# Minimum number of items of a mission.
_MIN_ITEMS = 2


@dataclass(frozen=True, slots=True, repr=False)
class ImportedFlight:
    """Imported flight with its verdict.

    setup: setup with which the flight is judged, with the log as its source.
    track: rows of the flight.
    events: messages of the vehicle.
    ended: description of the flight's end, according to the log.
    """

    setup: FlightSetup
    track: Track
    events: tuple[LogEvent, ...]
    verdict: Verdict
    ended: str

    @property
    def lossy(self) -> bool:
        """True if part of the log could not be read."""
        return self.setup.imported_log is not None and self.setup.imported_log.damage.lossy

    def __repr__(self) -> str:
        """Describe the flight in a line: scenario, end, track and verdict."""
        return f"<ImportedFlight {self.setup.scenario.name}: {self.ended}; {self.track!r}, {self.verdict!r}>"

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows."""
        return self.verdict._repr_html_() + self.track._repr_html_()


def import_flight(path: Path, options: LogOptions) -> ImportedFlight:
    """Read a log, place the flight in its scenario and judge it.

    Raises LogError for a file that is not the log of an aeroplane's flight, and for a log without a mission if the
    options name no mission.  Raises MissionError for a plan that was not flown.
    """
    plan, fences = options.get("plan"), read_named_fences(options.get("fence") or ())
    flight = make_flight(open_log(path), options.get("flight"))
    mission, mission_origin, plan_scenario = _read_mission(path, flight, options)
    mission = fences.add_to_mission(mission)
    has_plan_heights = plan is not None or flight.mission is None or flight.mission.with_heights
    if not has_plan_heights:
        mission = with_flown_altitudes(mission, flight.lat, flight.lon, flight.up)
    program = flight.raw.program
    flown_autopilot = next(
        (name for name, title in TITLES.items() if program.lower().startswith(title[:5].lower())), ""
    )
    if mission.autopilot and flown_autopilot and mission.autopilot != flown_autopilot:
        allowed = f"the log {path} is from {program}; `plan` must name the mission that was flown"
        message = f"{mission.source}: written for {TITLES[mission.autopilot]}, but {allowed}"
        raise MissionError(message, file=mission.source, field="autopilot", value=mission.autopilot, allowed=allowed)
    scenario, placed = _choose_scenario_and_place_mission(mission, options, plan_scenario)
    scenario, wind_source = _with_wind_of_log(fences.add_to_scenario(apply_options(scenario, options)), flight, options)
    aircraft_options = (options.get("aircraft"), options.get("scenario"), plan_scenario)
    aircraft_known = any(option is not None for option in aircraft_options)
    logged_autopilot = autopilot_from_log(program, flight.raw.parameters, flight.raw.source)
    # A flight by an unknown autopilot is judged with planfly's guidance, which shows what the aircraft can fly.
    autopilot, autopilot_notes = logged_autopilot or (PlanflyGuidance(scenario.flight.steering.guidance), ())
    setup = _flight_setup(scenario, placed, mission, autopilot, flight)
    heights = flight.heights
    if (datum := options.get("datum")) is not None and heights.datum == "unstated":
        heights = replace(heights, datum=datum)
    notes = (
        *_describe_log(flight),
        *autopilot_notes,
        *mission.warnings,
        *_describe_mission_change(flight, mission, options),
    )
    sha256 = flight.raw.sha256
    if not sha256:
        with path.open("rb") as file:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
    imported_log = ImportedLog(
        missing=None if plan is not None or flight.mission is None else flight.mission.missing,
        file=path.name,
        sha256=sha256,
        format=flight.raw.format,
        program=program,
        utc_start=flight.raw.utc_start,
        holds=flight.holds,
        stretches=flight.stretches,
        heights=heights,
        wind=wind_source,
        mission=mission_origin,
        plan_heights=has_plan_heights,
        aircraft_known=aircraft_known,
        begins_in_flight=flight.begins_in_flight,
        gaps=flight.gaps,
        faults=flight.faults,
        damage=flight.raw.damage,
        notes=notes,
    )
    setup = replace(setup, imported_log=imported_log)
    track = make_track(flight, scenario.origin)
    if plan is not None and (mismatch := plan_mismatch(setup, track)) is not None:
        raise MissionError(f"{path}: not a flight of {plan}: {mismatch.text}", file=path)
    verdict = judge_flight(setup, track, "")
    end_reason = "completed"
    if not verdict.complete:
        end_reason = next((found.brief for found in verdict.findings if found.rule == "completion"), "not judged")
    return ImportedFlight(setup, track, _vehicle_events(flight), verdict, end_reason)


def _read_mission(path: Path, flight: LoggedFlight, options: LogOptions) -> tuple[Mission, str, Scenario | None]:
    """Return the planned mission, a description of its source, and the scenario of its plan.

    The mission is the one that the options name, or else the mission in the log.  The scenario is None without a
    plan.json.

    path: path of the log, for messages.
    Raises LogError if the options name no mission, and the log contains none or too few of its items.
    """
    if (named_plan := options.get("plan")) is not None:
        plan_path, terrain = check_mission_exists(Path(named_plan)), options.get("terrain")
        if plan_path.suffix.lower() != ".json":
            return read_mission(plan_path), f"of {plan_path.name}", None
        plan = read_plan(plan_path, terrain=None if terrain is None else str(terrain))
        scenario = with_file_autopilot(plan.scenario)
        mission = mission_of_plan(plan, load_uav(scenario), str(plan_path))
        return mission, f"of {plan_path.name}", scenario
    if flight.mission is None:
        raise LogError(f"{path}: contains no mission; name the planned mission with `plan`", file=path)
    logged = flight.mission
    if logged.missing is not None and len(logged.mission.items) < _MIN_ITEMS:
        problems = [missing_items_text(logged.missing), *logged.mission.warnings[:1]]
        problems.append("name the planned mission with `plan`")
        raise LogError(f"{path}: {'; '.join(problems)}", file=path)
    time_text = f", at {logged.time:.1f} s" if logged.time > 0.0 else ""
    return (
        logged.mission,
        f"{count_text(len(logged.mission.items), 'item')} from {logged.origin} of the log{time_text}",
        None,
    )


def _choose_scenario_and_place_mission(
    mission: Mission, options: LogOptions, plan_scenario: Scenario | None
) -> tuple[Scenario, PlacedMission]:
    """Choose the scenario for judging a flight; return it, and the mission placed on its map.

    The scenario is (in order) the named scenario, the scenario of the plan, or a scenario implied by the mission.
    """
    scenario, named_scenario = plan_scenario, options.get("scenario")
    terrain = None if options.get("terrain") is None else str(options["terrain"])
    if named_scenario is not None:
        scenario = load_scenario_with_options(named_scenario, {"terrain": terrain})
    if scenario is None:
        # The vertical legs are those that ArduPlane flies, so that the flight can be compared with a simulated flight.
        aircraft = flight_entries(options)["aircraft"]
        table = FlightTable() if aircraft is None else FlightTable(aircraft=str(aircraft))
        implied = implied_scenario(mission, terrain, table, vertical_legs=True)
        return implied.scenario, implied.placed
    return scenario, place_stops(mission, scenario.origin, scenario.terrain, vertical_legs=True)


def _with_wind_of_log(scenario: Scenario, flight: LoggedFlight, options: LogOptions) -> tuple[Scenario, str]:
    """Return the scenario with the log's mean wind, and a text on the source of the wind for the notes.

    The wind of the scenario is kept if the options state a wind or the log contains none.  The text is "" if neither a
    log nor a named scenario states a wind.
    """
    if options.get("wind") is not None:
        return scenario, "as given"
    wind = mean_wind(flight)
    if wind is None:
        source_text = "from the scenario, because the log contains no wind" if options.get("scenario") else ""
        return scenario, source_text
    windy_scenario = with_wind(scenario, wind.speed, wind.from_course, turbulence=None)
    course_text = f"{round(math.degrees(wind.from_course)) % 360:03d}°"
    return windy_scenario, f"from {course_text}, according to {wind.source} of the log"


def _flight_setup(
    scenario: Scenario,
    placed: PlacedMission,
    mission: Mission,
    autopilot: Autopilot,
    flight: LoggedFlight,
) -> FlightSetup:
    """Return the setup for judging an imported flight.

    placed: the mission placed on the map of the scenario.

    The cruise airspeed is (in order) the autopilot's parameter, the scenario's airspeed, the median airspeed of the
    log, or the aircraft's cruise airspeed.  The bank limit is the autopilot's parameter; without it, the lower one of
    the scenario's and the autopilot's usual limit.
    """
    aircraft = scenario_aircraft(scenario)
    envelope = load_envelope(aircraft, motor_braking=scenario.flight.motor_braking)
    airspeed = scenario.flight.airspeed_mps or aircraft.airspeed
    stated_airspeed = autopilot.stated_value(autopilot.speeds.cruise_parameter)
    if stated_airspeed is not None:
        airspeed = stated_airspeed
    elif scenario.flight.airspeed_mps is None and np.isfinite(flight.columns["airspeed"]).any():
        airspeed = float(np.nanmedian(flight.columns["airspeed"]))
    is_bank_stated = autopilot.stated_value(autopilot.turns.bank_parameter) is not None
    bank = autopilot.turns.max_bank if is_bank_stated else max_turn_bank(scenario, autopilot)
    limits = make_limits(scenario, envelope, max(5.0, airspeed), bank)
    return FlightSetup(
        scenario=scenario,
        mission=mission,
        route=route_through_stops(placed, limits.airspeed, scenario.flight.fly_over, limits, autopilot.route_rules),
        limits=limits,
        aircraft=aircraft.name,
        battery=carried_energy(scenario, aircraft),
        seed=1,
        autopilot=autopilot,
        nav=scenario.flight.steering.nav,
        guidance_hz=scenario.flight.guidance_hz,
    )


def _describe_log(flight: LoggedFlight) -> tuple[str, ...]:
    """Return notes on a log with deficiencies.

    It is incomplete, contains several flights, or has a throttle that never moves.
    """
    notes = []
    if flight.begins_in_flight:
        notes.append(f"the log begins in flight, at {flight.time[0]:.1f} s")
    if flight.ends_in_flight:
        notes.append(f"the log ends in flight, at {flight.time[-1]:.1f} s")
    usual_step = float(np.median(np.diff(flight.time)))
    if usual_step > MAX_STEP_S:
        notes.append(
            f"the log has a position only every {usual_step:.1f} s; the flight between the positions is unknown"
        )
    if flight.count > 1:
        other_flights = ", ".join(
            f"at {start:.0f} s (followed a mission for {mission_time:.0f} s)" for start, mission_time in flight.others
        )
        notes.append(
            f"flight {flight.number} of {flight.count} is judged; the others began {other_flights}. --flight N judges"
            " another flight"
        )
    throttle = flight.raw.series.get("throttle")
    if throttle is not None and len(throttle.values) > 1 and not np.ptp(throttle.values) > 0.0:
        notes.append(f"the throttle never moves: {abs(float(throttle.values.flat[0])):.3g} in all rows")
    return tuple(notes)


def _describe_mission_change(flight: LoggedFlight, mission: Mission, options: LogOptions) -> tuple[str, ...]:
    """Return one note on the differences between the log's mission and the named plan.

    Return () if they agree, if no plan is named, or if the log contains no mission.
    """
    if options.get("plan") is None or flight.mission is None:
        return ()
    logged_items = flight.mission.mission.items
    pairs = zip(logged_items, mission.items, strict=False)
    changed = [
        logged_item.seq
        for logged_item, planned_item in pairs
        if (logged_item.x, logged_item.y, logged_item.alt) != (planned_item.x, planned_item.y, planned_item.alt)
    ]
    if len(logged_items) == len(mission.items) and not changed:
        return ()
    if len(logged_items) != len(mission.items):
        return (f"the mission of the log has {count_text(len(logged_items), 'item')}, the plan {len(mission.items)}",)
    verb, noun = ("has", "another position") if len(changed) == 1 else ("have", "other positions")
    return (
        f"{count_text(len(changed), 'item')} of the mission in the log {verb} {noun} than in the plan; the first is"
        f" item {changed[0]}",
    )


def _vehicle_events(flight: LoggedFlight) -> tuple[LogEvent, ...]:
    """Return the vehicle's messages and mode changes in the flight and the 60 s before, in time order.

    Events before the first row get the time of the first row.  A flight without rows has no events.
    """
    if not len(flight.time):
        return ()
    start_time, end_time = float(flight.time[0]), float(flight.time[-1])
    messages = [(time, text) for time, text in flight.raw.events if text]
    messages += [(mode.time, f"mode {mode.name}") for mode in flight.raw.modes]
    clock = flight.clock
    times = np.array([time for time, _ in messages])
    if clock is not None and messages:
        times = clock.to_steady_clock(times)
    events = zip(times.tolist(), messages, strict=True)
    events_in_flight = [
        LogEvent(max(start_time, time), text, "info")
        for time, (_, text) in events
        if start_time - 60.0 <= time <= end_time
    ]
    return tuple(sorted(events_in_flight, key=lambda event: event.time))


# ----------------------------------------------------------------------
# Fly the mission of an imported flight again with the model of its aircraft.


def fly_again(
    setup: FlightSetup,
    track: Track,
    aircraft: str | None,
    turbulence: str | None,
    advance: Advance,
    max_stretches: int = 9,
) -> tuple[Reflight, ...]:
    """Simulate each sequence of legs that the flight followed, and compare it with the log.

    The simulation has the wind of the log.

    Return the comparisons, the longest sequence first.

    setup, track: setup of the imported flight, with `imported_log`, and its rows.
    aircraft: aircraft of the simulated flight; None for the setup's aircraft.
    turbulence: turbulence of the simulated flight; None for the scenario's turbulence.
    max_stretches: maximum number of sequences; if there are more, the longest are flown.

    Raises LogError for a flight that followed no part of its mission, and StartError if the model cannot start.
    """
    return tuple(
        _refly_followed_legs(setup, legs, aircraft, turbulence, advance)
        for legs in _followed_legs(setup, track)[:max_stretches]
    )


@dataclass(frozen=True, slots=True)
class DrawnFlight:
    """Draw for one simulated flight.

    It has deviations from the nominal aircraft, the log's wind and the logged positions.

    variation: deviation of the aircraft from its model.
    wind: velocity added to the log's mean wind, towards north and east, m/s.
    turbulence: level of the turbulence.
    seed: seed of the turbulence.
    offset: offset added to the simulated positions, east, north and up, m.
    """

    variation: Variation
    wind: tuple[float, float]
    turbulence: str
    seed: int
    offset: tuple[float, float, float]


def fly_draws(
    setup: FlightSetup, track: Track, aircraft: str, draws: Sequence[DrawnFlight], advance: Advance
) -> tuple[Reflight, ...]:
    """Simulate the longest sequence of legs that the flight followed once per draw.

    Return the comparisons.

    A draw is left out if its aircraft cannot start or flies none of the legs.

    setup, track: setup and track of the logged flight.
    aircraft: name or folder of the aircraft that is varied.
    advance: called after each draw with the number of draws done, their total and a text.

    Raises LogError for a flight that followed no part of its mission, or if no draw flies.
    """
    setup = start_after_takeoff(setup, track)
    legs = _followed_legs(setup, track)[0]
    flights = []
    for number, draw in enumerate(draws, 1):
        # The aircraft of a draw may have no steady flight at the start, or lose it at once.
        with contextlib.suppress(StartError, LogError):
            flights.append(_refly_followed_legs(setup, legs, aircraft, draw.turbulence, advance=None, draw=draw))
        advance(number, len(draws), f"flight {number} of {len(draws)}")
    if not flights:
        name = setup.scenario.name
        message = f"none of the {len(draws)} sampled variants of {aircraft} could fly the mission"
        raise LogError(f"{name}: {message}", file=name)
    return tuple(flights)


def start_after_takeoff(setup: FlightSetup, track: Track) -> FlightSetup:
    """Return the setup with a first take-off item replaced by a waypoint.

    The flight reached the item's altitude at this waypoint.

    A model's flight starts in the air, and a mission does not state the course of its take-off: the autopilot chooses
    it.  The setup is returned unchanged if the mission has no take-off, or if the first segment of the flight did not
    reach this altitude.
    """
    imported_log, route, mission, scenario = setup.imported_log, setup.route, setup.mission, setup.scenario
    first_item = next((item for item in mission.items if item.seq == route.items[0]), None)
    if imported_log is None or not imported_log.stretches or first_item is None or first_item.command not in TAKEOFFS:
        return setup
    stretch, *later_stretches = imported_log.stretches
    is_inside = (track.time >= stretch.start) & (track.time <= stretch.end)
    rows = np.flatnonzero(is_inside & (track.position[:, 2] >= route.positions[0, 2]))
    if not rows.size:
        return setup
    east, north, up = track.position[rows[0]].tolist()
    lat_deg, lon_deg = to_geo(scenario.origin, east, north)
    start_item = replace(
        first_item,
        command=Command.NAV_WAYPOINT,
        frame=Frame.GLOBAL,
        lat_deg=float(lat_deg),
        lon_deg=float(lon_deg),
        alt=up,
    )
    items = tuple(start_item if item.seq == first_item.seq else item for item in mission.items)
    mission = replace(mission, items=items)
    placed = place_stops(mission, scenario.origin, scenario.terrain, vertical_legs=True)
    return replace(
        setup,
        mission=mission,
        route=route_through_stops(
            placed, setup.limits.airspeed, scenario.flight.fly_over, setup.limits, setup.autopilot.route_rules
        ),
        imported_log=replace(
            imported_log, stretches=(replace(stretch, start=float(track.time[rows[0]])), *later_stretches)
        ),
    )


def _refly_followed_legs(
    setup: FlightSetup,
    legs: FlownLegs,
    aircraft: str | None,
    turbulence: str | None,
    advance: Advance | None,
    draw: DrawnFlight | None = None,
) -> Reflight:
    """Simulate a sequence of legs with an aircraft's model.

    Compare the simulated flight with the log.

    legs: the sequence of legs, as the logged flight followed it.
    aircraft, turbulence: replace the aircraft and the turbulence of the setup unless None.
    advance: called with the distance flown, the total (m) and a text; None to report nothing.
    draw: variations of aircraft, wind and start of one sampled flight, or None.
    Raises LogError if the model flies none of the legs.
    """
    scenario = with_wind(
        with_flight(setup.scenario, aircraft=aircraft), speed=None, from_course=None, turbulence=turbulence
    )
    if draw is not None:
        wind = scenario.wind
        # The wind blows from `from_course`; the drawn wind is a velocity towards north and east.
        north = -wind.speed * math.cos(wind.from_course) + draw.wind[0]
        east = -wind.speed * math.sin(wind.from_course) + draw.wind[1]
        scenario = with_wind(scenario, math.hypot(north, east), math.atan2(-east, -north) % (2.0 * math.pi), turbulence)
    model = scenario_aircraft(scenario)
    limits = setup.limits
    if model.name != setup.aircraft:
        envelope = load_envelope(model, motor_braking=scenario.flight.motor_braking)
        limits = make_limits(scenario, envelope, setup.airspeed, min(setup.max_bank, envelope.max_bank))
    model_setup = replace(
        legs.requirements.setup,
        scenario=scenario,
        limits=limits,
        aircraft=model.name,
        battery=carried_energy(scenario, model),
        imported_log=None,
        nav="perfect",
    )

    if draw is not None:
        model_setup = replace(model_setup, seed=draw.seed)
    flight = Flight(model_setup, model, None if draw is None else draw.variation)
    builder, end_reason, length = TrackBuilder(), "", flight.path.length
    while not end_reason:
        rows, end_reason = flight.fly_block(round(BLOCK_DURATION_S / flight.dt))
        builder.add(rows)
        if advance is not None:
            advance(flight.distance, length, f"{flight.distance / 1000:.1f} of {length / 1000:.1f} km")
    track = builder.track()
    if len(track) < 2:
        message = f"the model of {model.name} flew no part of the mission: {end_reason}"
        raise LogError(f"{scenario.name}: {message}", file=scenario.name)
    if draw is not None:
        track = replace(track, position=track.position + np.array(draw.offset))
    is_assumed_aircraft = setup.imported_log is not None and not setup.imported_log.aircraft_known and aircraft is None
    return compare_with_model(model_setup, legs, track, end_reason, stands_in=is_assumed_aircraft)


def _followed_legs(setup: FlightSetup, track: Track) -> list[FlownLegs]:
    """Return the sequence of legs followed in each segment of a flight, the longest first.

    Raises LogError if the flight followed no leg of its mission.
    """
    imported_log = setup.imported_log
    stretches = () if imported_log is None else imported_log.stretches
    stretch_legs = [legs for stretch in stretches if (legs := flown_legs(setup, track, stretch)) is not None]
    if not stretch_legs:
        name = "the log" if imported_log is None else imported_log.file
        raise LogError(
            f"{name}: the flight followed no leg of its mission, so there is nothing to fly again", file=name
        )
    # The difference is the number of legs, negated.
    return sorted(stretch_legs, key=lambda legs: legs.first - legs.last)
