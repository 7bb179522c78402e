"""Make the `FlightSetup` of a plan or a mission file with the options of its flight."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from flight.autopilots.autopilot import Autopilot
from flight.autopilots.parts import BatteryFailsafe, MissionDialect, RtlSettings, SpeedLimits
from flight.mission.fences import fence_zones
from flight.mission.from_plan import plan_mission
from flight.mission.implied_scenario import implied_scenario
from flight.mission.items import OTHER_VEHICLES, Command, Mission, command_name
from flight.mission.itinerary import stated_loiter
from flight.mission.placing import PlacedMission, home_point, place_stops
from flight.mission.preflight_notes import preflight_notes
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
from world.errors import ForecastError, MissionError, ScenarioError, TerrainError
from world.files import did_you_mean, missing_text
from world.forecast.scenario_wind import check_coverage
from world.frames import to_geo
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

    program: the autopilot program that flies, or None for a simulated autopilot.
    engine: flight model that flies.
    Raises MissionError, ScenarioError, ParameterError or TerrainError.

    >>> from planfly.workflow.make_plan import make_plan
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("paper-07")
    >>> setup = open_flight(make_plan(scenario, load_uav(scenario), 1), {"wind": (4.0, 270.0)})
    >>> setup.name, setup.mission.source, setup.scenario.wind.speed
    ('paper-07', 'plan.json', 4.0)
    """
    fences = read_named_fences(options.get("fence") or ())
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
    """Extend a scenario's terrain to the mission's home, if the link's ground station stands there.

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

    program: autopilot program that flies the mission; None for a simulated autopilot.
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
    """Check that a mission file exists, and return its path.

    Raises MissionError with the most similar name as a suggestion, and for a scenario.
    """
    if path.suffix.lower() == ".toml" or (str(path) in embedded_names() and not path.exists()):
        text = "a scenario, which has to be planned first: `planfly run` or planfly.plan_then_fly plan and fly it"
        raise MissionError(f"{path}: {text}; expected a plan.json, .waypoints or .plan file", file=path)
    if not path.is_file():
        hint = "" if path.exists() else did_you_mean(path.name, _mission_file_names(path.parent), path.parent)
        expected = "expected a plan.json, .waypoints or .plan file"
        one_text = ", one at a time" if path.is_dir() else ""
        raise MissionError(f"{path}: {missing_text(path)}; {expected}{one_text}{hint}", file=path)
    return path


def _mission_file_names(folder: Path) -> list[str]:
    """List the names of a folder's possible mission files; empty if the folder cannot be read."""
    try:
        return sorted(file.name for file in folder.iterdir() if file.suffix in (".json", ".waypoints", ".plan", ".txt"))
    except OSError:
        return []


def mission_of_plan(plan: Plan, uav: Uav, source: str = PLAN_FILE) -> Mission:
    """Make a mission without fences from the waypoints of a plan.

    source: the plan's file name, for messages.
    """
    return plan_mission(plan, uav.airspeed, uav.max_bank, source, uav.limits.tracking)


# Number of items that a common board stores, with the name of the board, by dialect: 724 on a Pixhawk
# (`StorageManager` of ArduPilot), and `NUM_MISSIONS_SUPPORTED` of PX4.
_STORED_ITEMS = {"ardupilot": (724, "a Pixhawk with ArduPlane"), "px4": (500, "a flight controller with PX4")}


def _item_count_notes(mission: Mission, dialect: MissionDialect) -> tuple[str, ...]:
    """Note that a mission has more items than a common flight controller of the autopilot stores.

    The result is empty otherwise.
    """
    limit, board = _STORED_ITEMS.get(dialect, (len(mission.items), ""))
    if len(mission.items) <= limit:
        return ()
    return (f"{len(mission.items)} items: {board} stores {limit}, and refuses more",)


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
    fdm_hz: step rate of JSBSim, Hz.  engine: flight model that flies.
    Raises MissionError for a mission without a valid route, and for a fence without valid zones.
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
    route = with_end_courses(route, scenario, limits)
    _check_forecast(scenario, route, mission)
    file_parameters, assumed_parameters = (
        {} if autopilot.parameters is None else autopilot.parameters.by_origin(origin) for origin in ("file", "assumed")
    )
    notes = autopilot.checks.parameter_notes
    notes += preflight_notes(mission, route, scenario, autopilot.returns.rules, file_parameters, assumed_parameters)
    notes += camera_notes(mission, route, scenario.wind, autopilot.speeds.true_airspeed_factor)
    notes += _speed_limit_notes(mission, autopilot.speeds.limits, autopilot.title)
    notes += _item_count_notes(mission, autopilot.checks.dialect)
    envelope, stated_battery = limits.envelope, scenario.flight.battery_wh
    if envelope.volts and (stated_battery is not None or not envelope.battery_guessed):
        notes += _capacity_notes(autopilot.checks.battery_failsafes, uav.battery, envelope.volts)
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
    """Return the duration of a flight without wind, s.

    A loiter takes at least the time that its item states.
    """
    leg_times = np.linalg.norm(np.diff(route.positions, axis=0), axis=1) / route.leg_airspeeds
    stops = route.stops
    is_loiter = stops[1:] == stops[:-1]
    times_at_stops = np.bincount(stops[1:][is_loiter], leg_times[is_loiter], minlength=int(stops[-1]) + 1)
    stated_times = {item.seq: loiter.seconds for item in mission.items if (loiter := stated_loiter(item)) is not None}
    for stop, item in set(zip(stops.tolist(), route.items.tolist(), strict=True)):
        times_at_stops[stop] = max(times_at_stops[stop], stated_times.get(item, 0.0))
    return float(leg_times[~is_loiter].sum() + times_at_stops.sum())


def _check_forecast(scenario: Scenario, route: Route, mission: Mission) -> None:
    """Raise ForecastError if a route leaves the area, altitude levels or times of the wind's forecast."""
    facts = scenario.wind.forecast
    if facts is None:
        return
    positions, file = route.positions, str(scenario.spec.wind.forecast)
    latitudes, longitudes = to_geo(scenario.origin, positions[:, 0], positions[:, 1])
    check_coverage(scenario.wind, file, latitudes, longitudes, positions[:, 2])
    duration = planned_duration(route, mission)
    if duration > (facts.last_time - facts.departure).total_seconds():
        raise ForecastError.at(
            file,
            "time",
            f"{facts.departure:%Y-%m-%d %H:%M} UTC",
            f"the flight takes {duration / 60.0:.1f} min,"
            f" but the forecast ends at {facts.last_time:%Y-%m-%d %H:%M} UTC",
        )


def with_landing_parameters(autopilot: Autopilot, mission: Mission) -> Autopilot:
    """Return the autopilot with an RTL that uses the mission's landing sequence.

    Without a landing sequence the autopilot is unchanged.  Parameters that a parameter file or the scenario states are
    kept; the others are assumed.
    """
    if all(item.command != Command.DO_LAND_START for item in mission.items):
        return autopilot
    values = autopilot.returns.make_parameters(RtlSettings(lands=True))
    return autopilot.with_parameters("assumed", **values) if values else autopilot


def _capacity_notes(failsafes: Iterable[BatteryFailsafe], battery: float, volts: float) -> tuple[str, ...]:
    """Note the battery failsafes that assume another capacity than the aircraft's battery has.

    Such a failsafe acts too early or too late.  If several monitors share the load, each has its own battery, so
    nothing is noted.

    battery: energy of the battery, Wh.  volts: its voltage, V.

    >>> import math
    >>> early = BatteryFailsafe("BATT_LOW_MAH", 800.0, 1200.0, False, math.nan, "BATT_CAPACITY", 2000.0)
    >>> _capacity_notes([early], 59.2, 14.8)[0].partition(". ")[2]
    'The failsafe BATT_LOW_MAH 800 ends the mission with 2800 mAh left'
    """
    charge = _MAH_PER_AH * battery / volts
    return tuple(
        f"{failsafe.capacity_parameter} {failsafe.capacity:g} mAh, but the aircraft's battery has {charge:.0f} mAh"
        f" ({battery:g} Wh at {volts:g} V). The failsafe {failsafe.parameter} {failsafe.threshold:g} ends the"
        " mission with"
        f" {max(0.0, charge - failsafe.used_charge):.0f} mAh left"
        for failsafe in failsafes
        if not failsafe.shares_charge and abs(failsafe.capacity - charge) > MAX_CAPACITY_DIFFERENCE * charge
    )


def _speed_limit_notes(mission: Mission, limits: SpeedLimits | None, title: str) -> tuple[str, ...]:
    """Return a note on each commanded airspeed beyond the autopilot's limits; () without limits.

    ArduPlane interprets DO_CHANGE_SPEED as an airspeed only if the speed type is 0, and ignores values beyond its
    limits.  PX4 interprets it as an airspeed for any type, and flies the nearest limit.

    >>> from flight.mission.items import MissionItem
    >>> faster = MissionItem(2, 178, 2, (0.0, 60.0, -1.0, 0.0), 0.0, 0.0, 0.0)
    >>> _speed_limit_notes(Mission(None, (faster,)), SpeedLimits(9.0, 22.0, "MIN", "MAX"), "ArduPlane")
    ('item 2: DO_CHANGE_SPEED to 60 m/s is outside MIN 9 to MAX 22 m/s; ArduPlane ignores it',)
    """
    if limits is None:
        return ()
    behaviour = "flies the nearest limit instead" if limits.nearest else "ignores it"
    range_text = f"outside {limits.min_name} {limits.min:g} to {limits.max_name} {limits.max:g} m/s"
    return tuple(
        f"item {item.seq}: DO_CHANGE_SPEED to {item.params[1]:g} m/s is {range_text}; {title} {behaviour}"
        for item in mission.items
        if item.command == Command.DO_CHANGE_SPEED
        and (limits.nearest or item.params[0] == 0.0)
        and item.params[1] > 0.0
        and not limits.min <= item.params[1] <= limits.max
    )
