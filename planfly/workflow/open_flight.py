"""Make the `FlightSetup` of a plan or a mission file with the options of its flight.

Preflight notes are added.
"""

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from flight.autopilots.autopilot import Autopilot
from flight.autopilots.parts import RtlSettings
from flight.mission.altitude_frames import find_misread_altitudes
from flight.mission.fences import fence_zones
from flight.mission.from_plan import plan_mission
from flight.mission.ground_phases import landing_slopes
from flight.mission.items import OTHER_VEHICLES, Command, Mission, command_name
from flight.mission.itinerary import stated_loiter
from flight.mission.placing import PlacedMission, home_point, implied_scenario, place_stops, return_points
from flight.mission.return_path import ReturnPoint, ReturnRules
from flight.mission.route import Route, route_through_stops, with_end_courses
from flight.mission.surveys import camera_notes
from flight.mission_files.formats import read_mission
from flight.simulation.setup import FDM_HZ, EngineChoice, FlightSetup
from planfly.flight_options import (
    MissionOptions,
    NamedFences,
    apply_options,
    load_scenario_with_options,
    read_named_fences,
)
from planfly.workflow.uav import Uav, choose_seed, load_uav
from planner.plan import Plan, parse_plan, plan_json, read_plan
from world.airfield import STEEPEST_STRIP_SLOPE, LandingStrip
from world.errors import ForecastError, MissionError, ScenarioError, TerrainError
from world.files import did_you_mean, missing_text
from world.forecast.scenario_wind import check_coverage
from world.frames import to_geo, to_map
from world.geometry import leg_courses
from world.scenario import Scenario, embedded_names, with_ground_at

# Name of a plan without a file, in messages about its mission.
PLAN_FILE = "plan.json"
# Largest difference between the capacity that an autopilot assumes and the battery's charge, as a fraction of this
# charge; a larger one is noted.
MAX_CAPACITY_DIFFERENCE = 0.2
_MAH_PER_AH = 1000.0


def open_flight(
    plan_or_file: Plan | str | Path, options: MissionOptions, program: Path | None = None, engine: EngineChoice = "auto"
) -> FlightSetup:
    """Make the setup of a plan, or of a plan.json, .waypoints or .plan file.

    The scenario is the named scenario, the scenario of the plan, or for a mission file a scenario implied by its items.

    program: executable of the autopilot that flies; None for a simulated autopilot.
    engine: flight model that flies.
    Raises MissionError, ScenarioError, ParameterError or TerrainError.

    >>> from planfly.workflow.make_plan import make_plan
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("paper-07")
    >>> setup = open_flight(make_plan(scenario, load_uav(scenario), 1), {"wind": (4.0, 270.0)})
    >>> setup.name, setup.mission.source, setup.scenario.wind.speed
    ('paper-07', 'plan.json', 4.0)
    """
    fence_files = options.get("fence")
    fences = read_named_fences(fence_files) if fence_files else NamedFences()
    named_world = options.get("scenario")
    terrain = None if options.get("terrain") is None else str(options.get("terrain"))
    if isinstance(plan_or_file, Plan) or Path(plan_or_file).suffix.lower() == ".json":
        return _open_plan(plan_or_file, options, program, engine, fences, terrain)
    mission = fences.add_to_mission(read_mission(check_mission_exists(Path(plan_or_file))))
    for item in mission.items:
        if item.command in OTHER_VEHICLES:
            name = command_name(item.command)
            allowed = f"a command for {OTHER_VEHICLES[Command(item.command)]}; planfly flies only fixed-wing aircraft"
            raise MissionError.at(mission.source, f"item {item.seq}", name, allowed, shown=name)
    if named_world is not None:
        scenario = load_scenario_with_options(named_world, options, program, mission)
        if scenario.link is not None:
            scenario = with_ground_at_station(scenario, mission)
        placed = place_stops(mission, scenario.origin, scenario.terrain, vertical_legs=True)
    else:
        implied_world = implied_scenario(mission, terrain, vertical_legs=True)
        scenario, placed = apply_options(implied_world.scenario, options, program, mission), implied_world.placed
    scenario = fences.add_to_scenario(scenario)
    seed = choose_seed(scenario, options.get("seed"))
    return make_setup(scenario, load_uav(scenario), mission, seed, placed=placed, engine=engine)


def with_ground_at_station(scenario: Scenario, mission: Mission) -> Scenario:
    """Return a scenario with its terrain extended to the mission's home.

    This is done if the link's ground station stands there.

    The terrain is unchanged if its elevation file cannot be read, or has no data at home.
    """
    home = home_point(mission, scenario.origin, scenario.terrain)
    if home is None or scenario.link is None or scenario.link.station is not None:
        return scenario
    try:
        return with_ground_at(scenario, (home.east, home.north))
    except (TerrainError, ScenarioError):
        # Such as a log whose elevation file is on another machine.
        return scenario


def _open_plan(
    plan_or_file: Plan | str | Path,
    options: MissionOptions,
    program: Path | None,
    engine: EngineChoice,
    fences: NamedFences,
    terrain: str | None,
) -> FlightSetup:
    """Make the flight setup of a plan, in its own scenario or in another scenario that the options name.

    program: executable of the autopilot that flies the mission; None for a simulated autopilot.
    engine: choice between the compiled flight model and JSBSim.
    fences: fences and zones in addition to those of the plan.
    terrain: elevation file that replaces the terrain of the plan; None keeps the terrain.
    """
    named_world = options.get("scenario")
    if not isinstance(plan_or_file, Plan):
        plan, file = read_plan(check_mission_exists(Path(plan_or_file)), terrain=terrain), str(plan_or_file)
    else:
        plan, file = plan_or_file, PLAN_FILE
        if terrain is not None:
            plan = parse_plan(plan_json(plan), PLAN_FILE, terrain=terrain)
    scenario = fences.add_to_scenario(apply_options(plan.scenario, options, program))
    uav, seed = load_uav(scenario), options.get("seed")
    mission = fences.add_to_mission(mission_of_plan(plan, uav, file))
    chosen_seed = plan.seed if seed is None else seed
    if named_world is None:
        return make_setup(scenario, uav, mission, chosen_seed, plan=plan, engine=engine)
    # The plan's waypoints are in the map coordinates of its own scenario.  Therefore its mission items are flown in
    # another scenario.
    scenario = fences.add_to_scenario(load_scenario_with_options(named_world, options, program))
    return make_setup(scenario, load_uav(scenario), mission, chosen_seed, engine=engine)


def check_mission_exists(path: Path) -> Path:
    """Return the path unchanged, after checking that it is an existing file.

    Raises MissionError for a missing file, with the most similar name as a suggestion, and for a scenario.
    """
    if path.suffix.lower() == ".toml" or (str(path) in embedded_names() and not path.exists()):
        text = "a scenario, which has to be planned first: `planfly run` or planfly.plan_then_fly plan and fly it"
        raise MissionError(f"{path}: {text}; expected a plan.json, .waypoints or .plan file", file=path)
    if not path.is_file():
        names: list[str] = []
        # A folder that cannot be read has no names to suggest.
        with suppress(OSError):
            names = sorted(
                file.name for file in path.parent.iterdir() if file.suffix in (".json", ".waypoints", ".plan", ".txt")
            )
        hint = "" if path.exists() else did_you_mean(path.name, names, path.parent)
        expected = "expected a plan.json, .waypoints or .plan file"
        one_text = ", one at a time" if path.is_dir() else ""
        raise MissionError(f"{path}: {missing_text(path)}; {expected}{one_text}{hint}", file=path)
    return path


def mission_of_plan(plan: Plan, uav: Uav, source: str = PLAN_FILE) -> Mission:
    """Make a mission without fences from the waypoints of a plan.

    source: the plan's file name, for messages.
    """
    return plan_mission(plan, uav.airspeed, uav.max_bank, source, uav.limits.tracking)


# Number of items that a common board stores, with the name of the board, by dialect: 724 on a Pixhawk
# (`StorageManager` of ArduPilot), and `NUM_MISSIONS_SUPPORTED` of PX4.
_STORED_ITEMS = {"ardupilot": (724, "a Pixhawk with ArduPlane"), "px4": (500, "a flight controller with PX4")}


def make_setup(
    scenario: Scenario,
    uav: Uav,
    mission: Mission,
    seed: int,
    *,
    plan: Plan | None = None,
    placed: PlacedMission | None = None,
    fdm_hz: Literal[60, 120] = FDM_HZ,
    engine: EngineChoice = "auto",
) -> FlightSetup:
    """Make the setup of a mission's flight in a scenario.

    placed: the mission placed on the map of the scenario, if already computed.
    seed: seed of the turbulence and the navigation error.
    plan: plan from which the mission was made; None for a mission from a file.
    fdm_hz: step rate of JSBSim, Hz.
    engine: flight model that flies.
    Raises MissionError for a mission without a valid route, and for a fence without valid zones; and ForecastError if
    the route leaves the area, altitude levels or times of the wind's forecast.
    """
    if mission.fences:
        # A fence without valid zones could not be judged.
        fence_zones(mission.fences, scenario.origin, mission.source)
    limits, airspeed, fly_over = uav.limits, uav.airspeed, scenario.flight.fly_over
    autopilot = with_landing_parameters(uav.autopilot, mission)
    mission = replace(mission, autopilot=autopilot.name)
    resets = autopilot.checks.resets_jump_counters
    if placed is None:
        placed = place_stops(mission, scenario.origin, scenario.terrain, resets_jump_counters=resets)
    elif resets and placed.itinerary.passes_exhausted_jump:
        placed = place_stops(
            mission, scenario.origin, scenario.terrain, vertical_legs=True, resets_jump_counters=resets
        )
    route = route_through_stops(placed, airspeed, fly_over, limits, autopilot.route_rules)
    if scenario.start_course is not None or scenario.destination_course is not None:
        route = with_end_courses(route, scenario, limits)
    if (forecast := scenario.wind.forecast) is not None:
        positions, file = route.positions, str(scenario.spec.wind.forecast)
        latitudes, longitudes = to_geo(scenario.origin, positions[:, 0], positions[:, 1])
        check_coverage(scenario.wind, file, latitudes, longitudes, positions[:, 2])
        duration = planned_duration(route, mission)
        if duration > (forecast.last_time - forecast.departure).total_seconds():
            allowed = (
                f"the flight takes {duration / 60.0:.1f} min,"
                f" but the forecast ends at {forecast.last_time:%Y-%m-%d %H:%M} UTC"
            )
            raise ForecastError.at(file, "time", f"{forecast.departure:%Y-%m-%d %H:%M} UTC", allowed)
    file_parameters, assumed_parameters = (
        {} if autopilot.parameters is None else autopilot.parameters.by_origin(origin) for origin in ("file", "assumed")
    )
    notes = autopilot.checks.parameter_notes
    notes += preflight_notes(mission, route, scenario, autopilot.returns.rules, file_parameters, assumed_parameters)
    notes += camera_notes(mission, route, scenario.wind, autopilot.speeds.true_airspeed_factor)
    envelope = uav.limits.envelope
    is_battery_known = scenario.flight.battery_wh is not None or not envelope.battery_guessed
    notes += (*_autopilot_notes(mission, autopilot, uav.battery, envelope.volts if is_battery_known else 0.0),)
    route = replace(route, notes=(*route.notes, *notes)) if notes else route
    return FlightSetup(
        scenario=scenario,
        mission=mission,
        route=route,
        limits=limits,
        aircraft=uav.aircraft.name,
        battery=uav.battery,
        seed=seed,
        plan=plan,
        autopilot=autopilot,
        nav=scenario.flight.steering.nav,
        guidance_hz=scenario.flight.guidance_hz,
        fdm_hz=fdm_hz,
        engine=engine,
    )


def planned_duration(route: Route, mission: Mission) -> float:
    """Return the duration of a mission's flight without wind, s.

    A loiter takes at least the time that its item states.

    route: route of the mission.
    """
    leg_times = np.linalg.norm(np.diff(route.positions, axis=0), axis=1) / route.leg_airspeeds
    stops = route.stops
    is_loiter = stops[1:] == stops[:-1]
    times_at_stops = np.bincount(stops[1:][is_loiter], leg_times[is_loiter], minlength=int(stops[-1]) + 1)
    stated_times = {item.seq: loiter.seconds for item in mission.items if (loiter := stated_loiter(item)) is not None}
    for stop, item in set(zip(stops.tolist(), route.items.tolist(), strict=True)):
        times_at_stops[stop] = max(times_at_stops[stop], stated_times.get(item, 0.0))
    return float(leg_times[~is_loiter].sum() + times_at_stops.sum())


def with_landing_parameters(autopilot: Autopilot, mission: Mission) -> Autopilot:
    """Return the autopilot with parameters by which an RTL uses the mission's landing sequence.

    Without a DO_LAND_START the autopilot is unchanged.  Parameters that a parameter file or the scenario states are
    kept; the others are assumed.
    """
    if all(item.command != Command.DO_LAND_START for item in mission.items):
        return autopilot
    values = autopilot.returns.make_parameters(RtlSettings(lands=True))
    return autopilot.with_parameters("assumed", **values) if values else autopilot


def _autopilot_notes(mission: Mission, autopilot: Autopilot, battery: float, volts: float) -> Iterator[str]:
    """Yield notes on what an autopilot ignores or refuses in a mission, and on its battery failsafes.

    An airspeed beyond the autopilot's limits is noted.  ArduPlane interprets DO_CHANGE_SPEED as an airspeed only if the
    speed type is 0, and ignores values beyond its limits.  PX4 interprets it as an airspeed for any type, and flies the
    nearest limit.  Also noted are more items than a common flight controller stores, and battery failsafes that assume
    another capacity than the aircraft's battery has, because they act too early or too late.  If several monitors share
    the load, each has its own battery, so nothing is noted.

    battery: energy of the battery, Wh.
    volts: voltage of the battery, V; 0 if unknown.

    >>> from flight.autopilots.arduplane.autopilot import ArduPlane
    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> from flight.mission.items import MissionItem
    >>> faster = MissionItem(2, 178, 2, (0.0, 60.0, -1.0, 0.0), 0.0, 0.0, 0.0)
    >>> autopilot = ArduPlane(ArduPilotParameters.defaults())
    >>> list(_autopilot_notes(Mission(None, (faster,)), autopilot, 888.0, 0.0))
    ['item 2: DO_CHANGE_SPEED to 60 m/s is outside AIRSPEED_MIN 9 to AIRSPEED_MAX 22 m/s; ArduPlane ignores it']
    """
    limits = autopilot.speeds.limits
    for item in mission.items:
        if (
            limits is not None
            and item.command == Command.DO_CHANGE_SPEED
            and (limits.nearest or item.params[0] == 0.0)
            and item.params[1] > 0.0
            and not limits.min <= item.params[1] <= limits.max
        ):
            behaviour = "flies the nearest limit instead" if limits.nearest else "ignores it"
            range_text = f"{limits.min_name} {limits.min:g} to {limits.max_name} {limits.max:g} m/s"
            yield (
                f"item {item.seq}: DO_CHANGE_SPEED to {item.params[1]:g} m/s is outside {range_text};"
                f" {autopilot.title} {behaviour}"
            )
    stored_count, board = _STORED_ITEMS.get(autopilot.checks.dialect, (len(mission.items), ""))
    if len(mission.items) > stored_count:
        yield f"{len(mission.items)} items: {board} stores {stored_count}, and refuses more"
    charge = _MAH_PER_AH * battery / volts if volts else math.nan
    for failsafe in autopilot.checks.battery_failsafes:
        if not failsafe.shares_charge and abs(failsafe.capacity - charge) > MAX_CAPACITY_DIFFERENCE * charge:
            yield (
                f"{failsafe.capacity_parameter} {failsafe.capacity:g} mAh, but the aircraft's battery has"
                f" {charge:.0f} mAh ({battery:g} Wh at {volts:g} V). The failsafe {failsafe.parameter}"
                f" {failsafe.threshold:g} ends the mission with {max(0.0, charge - failsafe.used_charge):.0f} mAh left"
            )


# ----------------------------------------------------------------------
# Preflight notes on a mission's take-off, landing, home, altitudes, rally points and return.
#
# The verdict judges collisions. These notes cover what a pilot would find out on the field: tail wind, a wrong home, an
# altitude in a wrong frame, a rally point below ground or out of range, an RTL below the hills around home, a landing
# sequence that prevents arming, and the ground under a landing without a stated strip.

# Minimum wind component that a note mentions, m/s.
MIN_NOTED_WIND_MPS = 0.05
# Maximum distance of a mission's home from the scenario's home without a note, m.
MAX_HOME_DISTANCE_M = 50.0
# Minimum radius about home within which the ground is checked for an RTL, m: with WP_LOITER_RAD 60, ArduPlane flew
# loiters of up to 260 m.
MIN_RTL_LOITER_RADIUS_M = 260.0
# Largest depth below the ground of a rally point that was set on the ground, m.
RALLY_ALTITUDE_ERROR_M = 10.0
# Number of rings about home on which the ground is checked.
_RING_COUNT = 13
# Number of directions on each ring.
_DIRECTION_COUNT = 72


def preflight_notes(
    mission: Mission,
    route: Route,
    scenario: Scenario,
    rules: ReturnRules,
    parameters: Mapping[str, float],
    assumed_parameters: Mapping[str, float],
) -> tuple[str, ...]:
    """Return notes on a mission's launch, landing, home, rally points and RTL.

    rules: RTL rules of the autopilot.
    parameters: parameters of the autopilot that are stated, by name.
    assumed_parameters: parameters that are assumed for the mission's landing, by name.
    """
    rally_problems: tuple[str, ...] = ()
    try:
        return_targets = return_points(mission, scenario.origin, scenario.terrain)
    except MissionError as error:
        # The rally points belong to another airfield: only an RTL would fly to them, and that RTL is refused elsewhere.
        return_targets, rally_problems = (), (str(error),)
    notes = list(rally_problems)
    # Tailwind at the scenario's launch and landing.
    courses, launch, ends = leg_courses(route.positions), scenario.launch, []
    if launch is not None and route.takeoff_ground is not None:
        course = float(courses[0]) if launch.course is None else launch.course
        ends.append(("launch", course, route.takeoff_ground))
    if scenario.landing is not None and route.landing_ground is not None:
        ends.append(("landing", float(courses[-1]), route.landing_ground))
    for name, course, altitude in ends:
        tail_wind = scenario.wind.components_on_course(course, altitude)[0]
        if tail_wind > MIN_NOTED_WIND_MPS:
            notes.append(f"{name}: {tail_wind:.1f} m/s of tailwind on course {round(math.degrees(course)) % 360}°")
    home, scenario_home = mission.home, scenario.home
    if home is not None and scenario_home is not None:
        east, north = to_map(scenario.origin, home.lat_deg, home.lon_deg)
        distance = math.dist((float(east), float(north)), scenario_home[:2])
        if distance > MAX_HOME_DISTANCE_M:
            notes.append(
                f"the mission's home is {distance:.0f} m from the scenario's home: after a launch at the scenario's"
                " home, heights are relative to the scenario's home"
            )
    # Items whose altitudes fit the terrain only in the other altitude frame.
    below_ground, too_high = find_misread_altitudes(mission, scenario.origin, scenario.terrain)
    amsl, over_home = "altitudes above mean sea level (frame 0)", "heights above home (frame 3)"
    for readings, stated_as, other in ((below_ground, amsl, over_home), (too_high, over_home, amsl)):
        if readings:
            numbers = [str(mission.items[reading.item_index].seq) for reading in readings]
            notes.append(
                f"item{'s' if len(numbers) > 1 else ''} {', '.join(numbers)}: flown as {stated_as},"
                f" {_heights_text([reading.height for reading in readings])}; read as {other}:"
                f" {_heights_text([reading.other_height for reading in readings])}. Check the frame"
            )
    notes += _note_rally_points(return_targets[1:], route, scenario, rules)
    # An RTL to home must not end at or below the ground anywhere on its loiter.
    if return_targets and scenario.terrain is not None and not math.isnan(rules.height):
        radius, home_point = max(MIN_RTL_LOITER_RADIUS_M, abs(rules.radius)), return_targets[0]
        angles = np.linspace(0.0, 2.0 * math.pi, _DIRECTION_COUNT, endpoint=False)
        distances = np.linspace(0.0, radius, _RING_COUNT)[:, None]
        ground = scenario.terrain.height(
            home_point.east + distances * np.sin(angles), home_point.north + distances * np.cos(angles)
        )
        ground_height = float(np.nanmax(ground, initial=-math.inf)) - home_point.up
        if ground_height >= rules.height:
            notes.append(
                f"an RTL loiters {rules.height:.0f} m above home, but the ground within {radius:.0f} m of home rises to"
                f" {ground_height:.0f} m above home"
            )
    # ArduPlane refuses to arm with a landing sequence and RTL_AUTOLAND 0 (AP_Arming.cpp).  An assumed value is noted
    # only without a landing of the scenario, because planfly writes RTL_AUTOLAND for its plan.
    start_numbers = [item.seq for item in mission.items if item.command == Command.DO_LAND_START]
    if start_numbers and parameters.get("RTL_AUTOLAND") == 0.0:
        notes.append(f"item {start_numbers[0]}: ArduPlane does not arm with DO_LAND_START and RTL_AUTOLAND 0")
    elif start_numbers and scenario.landing is None and "RTL_AUTOLAND" in assumed_parameters:
        notes.append(
            f"item {start_numbers[0]}: RTL_AUTOLAND {assumed_parameters['RTL_AUTOLAND']:g} is assumed for"
            " DO_LAND_START, because ArduPlane does not arm with the default 0"
        )
    return (*notes, *_note_landing_ground(mission, route, scenario))


def _heights_text(heights: list[float]) -> str:
    """Describe the range of heights above ground (m, negative below it) in rounded numbers.

    >>> _heights_text([-20.4, -330.0]), _heights_text([12.3])
    ('330 to 20 m below ground', '12 m above ground')
    """
    low, high = round(min(heights)), round(max(heights))
    side = "below" if high < 0 else "above"
    if low < 0 <= high:
        return f"from {-low} m below to {high} m above ground"
    return f"{abs(low)} m {side} ground" if low == high else f"{abs(low)} to {abs(high)} m {side} ground"


def _note_rally_points(
    points: tuple[ReturnPoint, ...], route: Route, scenario: Scenario, rules: ReturnRules
) -> Iterator[str]:
    """Yield notes on rally points that are below ground, or too far away for an RTL from the route.

    points: the rally points on the map.
    rules: RTL rules of the autopilot.
    """
    leg_starts, leg_vectors = route.positions[:-1, :2], np.diff(route.positions[:, :2], axis=0)
    for point in points:
        name = f"rally point {point.number}"
        ground = math.nan if scenario.terrain is None else float(scenario.terrain.height(point.east, point.north))
        # A return that ends above the rally point may use a point on the ground, whose altitude has errors.
        tolerance = RALLY_ALTITUDE_ERROR_M if rules.rally_height > 0.0 else 0.0
        if point.up <= ground - tolerance:
            yield (
                f"{name} is {ground - point.up:.0f} m below the ground"
                f" ({point.up:.0f} m AMSL; the ground there is at {ground:.0f} m AMSL)"
            )
        # The minimum horizontal distance from the legs.
        squared_lengths = np.maximum(1e-12, (leg_vectors**2).sum(axis=1))
        offsets = np.array((point.east, point.north)) - leg_starts
        fractions = np.clip((offsets * leg_vectors).sum(axis=1) / squared_lengths, 0.0, 1.0)
        distance = float(np.hypot(*(leg_starts + fractions[:, None] * leg_vectors - (point.east, point.north)).T).min())
        if 0.0 < rules.rally_limit < distance:
            limit = f"RALLY_LIMIT_KM {rules.rally_limit / 1000.0:g}"
            yield (
                f"no RTL flies to {name}, because it is at least {distance / 1000.0:.1f} km from the mission,"
                f" beyond {limit}"
            )


# Text for level ground.
_LEVEL_TEXT = "is level"


def _note_landing_ground(mission: Mission, route: Route, scenario: Scenario) -> Iterator[str]:
    """Yield one note on wind and ground at the mission's landing.

    There is no note if the scenario states its landing strip.
    """
    last_item = int(route.items[-1])
    slopes = landing_slopes(mission, route, scenario)
    if slopes is None:
        return
    course = float(leg_courses(route.positions)[-1])
    wind = ""
    if route.landing_ground is not None:
        tail_wind = scenario.wind.components_on_course(course, route.landing_ground)[0]
        wind = f", with {tail_wind:.1f} m/s of tailwind" if tail_wind > MIN_NOTED_WIND_MPS else wind
        wind = f", against {-tail_wind:.1f} m/s of wind" if tail_wind < -MIN_NOTED_WIND_MPS else wind
    ground = "The terrain there is unknown"
    length = LandingStrip(0.0, 0.0).length
    if not any(math.isnan(slope) for slope in slopes):
        along, across = (
            _LEVEL_TEXT
            if f"{abs(slope):.1%}" == "0.0%"
            else f"{'rises' if slope > 0.0 else 'falls'} by {abs(slope):.1%}"
            for slope in slopes
        )
        ground = (
            f"Over {length:.0f} m around the landing point the ground {along} in the landing direction and {across} to"
            " the right"
        )
        if along == across == _LEVEL_TEXT:
            ground = f"Over {length:.0f} m around the landing point the ground {_LEVEL_TEXT}"
        if max(abs(slope) for slope in slopes) > STEEPEST_STRIP_SLOPE:
            ground += f" (planfly plan accepts landing slopes up to {STEEPEST_STRIP_SLOPE:.0%})"
    strip_text = "Touchdown and roll-out are not judged, because the scenario has no [landing]"
    yield f"item {last_item}: landing on course {round(math.degrees(course)) % 360}°{wind}. {ground}. {strip_text}"
