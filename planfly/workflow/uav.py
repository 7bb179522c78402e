"""Load a scenario's aircraft, limits and autopilot for planning, without simulation or logs."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from aircraft.catalog import Aircraft, find_aircraft, find_logged_aircraft, model_hash
from aircraft.envelope import Envelope
from aircraft.path_limits import Limits
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.catalog import load_autopilot
from flight.dynamics.envelope_tables import load_envelope
from flight.simulation.setup import FlightSetup, make_limits
from planner.plan import Plan
from planner.search.lay_ground_ways import FinalModel, add_departure_and_approach
from world.errors import FlightError, ScenarioError
from world.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Uav:
    """Aircraft of a scenario, loaded once for planning, flying and judging.

    aircraft: the aircraft's entry in the catalog.
    limits: limits that scenario and aircraft set together, including the envelope.
    battery: energy carried, Wh.
    autopilot: the autopilot that flies the aircraft, with its settings.
    """

    aircraft: Aircraft
    limits: Limits
    battery: float
    autopilot: Autopilot

    @property
    def airspeed(self) -> float:
        """Initial cruise airspeed, until a mission sets another airspeed, m/s."""
        return self.limits.airspeed

    @property
    def max_bank(self) -> float:
        """Maximum bank angle in turns, rad."""
        return self.limits.max_bank


def with_departure_and_approach(plan: Plan, uav: Uav, flown_plan: Plan | None = None) -> Plan:
    """Return the plan with the departure and the approach that its scenario requires.

    If the scenario requires neither, the plan is returned unchanged.

    flown_plan: the plan being flown, whose departure is reused; None for a new plan.

    >>> import numpy as np
    >>> from planner.plan import Certificate
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> path = np.stack([scenario.start, scenario.destination])
    >>> certificate = Certificate(0.1, math.inf, 0.1, 9.0, 10.0, 50.0, ())
    >>> plan = Plan(scenario, path, np.zeros(4), np.zeros(4), certificate, 7, "umda", 60, np.zeros((0, 3)))
    >>> with_departure_and_approach(plan, load_uav(scenario)) is plan
    True
    """
    autopilot, cruise = uav.autopilot, uav.airspeed
    final_model = FinalModel(
        airspeed=lambda tailwind, amsl: autopilot.ground.airspeed(cruise, tailwind, amsl),
        slope=lambda height, distance, tailwind, amsl: autopilot.ground.glide(height, distance, tailwind, amsl).slope,
    )
    flown_departure = None if flown_plan is None or flown_plan.procedures is None else flown_plan.procedures.climb
    return add_departure_and_approach(plan, uav.limits.with_margin(), final_model, flown_departure)


def choose_seed(scenario: Scenario, seed: int | None) -> int:
    """Return the requested seed, or else the seed of the scenario, or else 1."""
    if seed is not None:
        return seed
    return scenario.planner.seed if scenario.planner.seed is not None else 1


def load_uav(scenario: Scenario, parameters: Mapping[str, float] | None = None) -> Uav:
    """Load a scenario's aircraft and autopilot, and the limits from scenario and aircraft.

    parameters: autopilot parameters that replace the file's parameters, by name and in the units of the autopilot.
    Raises ScenarioError for an unknown aircraft or autopilot, or an airspeed outside the range of the aircraft, and
    ParameterError for an unreadable parameter file, or values that are not allowed.

    >>> from world.scenario import load_scenario
    >>> uav = load_uav(load_scenario("tight"))
    >>> uav.aircraft.name, uav.airspeed, uav.limits.min_clearance
    ('aerosonde', 25.0, 60.0)
    """
    table = scenario.flight
    aircraft = scenario_aircraft(scenario)
    autopilot = load_autopilot(scenario, aircraft)
    if parameters:
        # Parameters stored in a log are checked like those of a file.
        autopilot = autopilot.restore(autopilot.with_parameters(**parameters).store())
    airspeed = cruise_airspeed(scenario, aircraft, autopilot)
    envelope = load_envelope(aircraft, motor_braking=table.motor_braking)
    limits = make_limits(scenario, envelope, airspeed, max_turn_bank(scenario, autopilot), autopilot)
    return Uav(aircraft, limits, carried_energy(scenario, aircraft), autopilot)


def uav_of_setup(setup: FlightSetup) -> Uav:
    """Return the UAV of a flight setup.

    Raises FlightError if the catalog does not contain its aircraft.

    >>> from logs.recording.example_log import example_log
    >>> uav_of_setup(example_log().setup).aircraft.name
    'aerosonde'
    """
    aircraft = find_logged_aircraft(setup.aircraft, setup.scenario.flight.aircraft)
    return Uav(aircraft, setup.limits, setup.battery, setup.autopilot)


def max_turn_bank(scenario: Scenario, autopilot: Autopilot) -> float:
    """Return the bank limit in turns, rad: the lower of scenario and autopilot.

    Return inf if neither has a limit.
    """
    stated_bank = scenario.flight.max_bank_deg
    return min(math.inf if stated_bank is None else math.radians(stated_bank), autopilot.turns.max_bank)


def scenario_aircraft(scenario: Scenario) -> Aircraft:
    """Return the aircraft of a scenario.  Raises ScenarioError for an unknown aircraft.

    >>> from world.scenario import load_scenario
    >>> scenario_aircraft(load_scenario("tight")).name
    'aerosonde'
    """
    table = scenario.flight
    try:
        aircraft = find_aircraft(table.aircraft)
        model_hash(aircraft)
    except FlightError as error:
        raise ScenarioError.from_error(error, scenario.name, "flight.aircraft", table.aircraft) from error
    return aircraft


def carried_energy(scenario: Scenario, aircraft: Aircraft) -> float:
    """Return the energy that an aircraft carries, Wh.

    It is the scenario's battery_wh, or else the aircraft's own battery.
    """
    stated_energy = scenario.flight.battery_wh
    return aircraft.battery_energy / 3600.0 if stated_energy is None else stated_energy


def cruise_airspeed(scenario: Scenario, aircraft: Aircraft, autopilot: Autopilot) -> float:
    """Return the initial cruise airspeed, m/s, from (in order) scenario, parameter file, aircraft.

    Raises ScenarioError for an airspeed outside the range of the aircraft.
    """
    cruise_parameter, parameters = autopilot.speeds.cruise_parameter, autopilot.parameters
    file_airspeed = autopilot.stated_value(cruise_parameter)
    if (airspeed := scenario.flight.airspeed_mps) is not None:
        file, field = scenario.name, "flight.airspeed_mps"
    elif file_airspeed is not None and parameters is not None:
        airspeed, file, field = file_airspeed, parameters.source, cruise_parameter
    else:
        airspeed, file, field = aircraft.airspeed, aircraft.name, "airspeed"
    if not aircraft.airspeed_min <= airspeed <= aircraft.airspeed_max:
        allowed = f"allowed {aircraft.airspeed_min:g}..{aircraft.airspeed_max:g} m/s for {aircraft.name}"
        raise ScenarioError.at(file, field, airspeed, allowed, shown=f"{airspeed:g}")
    return airspeed


def with_tightened_limits(uav: Uav, scenario: Scenario) -> Uav:
    """Return the UAV with the limits of a tightened scenario.

    Envelope, airspeed and tracking error are kept.
    """
    old_limits = uav.limits
    limits = make_limits(scenario, old_limits.envelope, old_limits.airspeed, max_turn_bank(scenario, uav.autopilot))
    return replace(uav, limits=replace(limits, tracking=old_limits.tracking))


def check_level_flight(aircraft: Aircraft, envelope: Envelope) -> None:
    """Raise FlightError if the aircraft cannot fly level at any airspeed and altitude of its envelope."""
    if not np.isfinite(envelope.level_speed_max - envelope.level_speed_min).any():
        amsl = f"{envelope.amsl[0]:.0f} to {envelope.amsl[-1]:.0f} m AMSL"
        message = f"{aircraft.name} cannot fly level: no airspeed is possible at any altitude from {amsl}"
        raise FlightError(message, file=aircraft.name, field="airspeed")
