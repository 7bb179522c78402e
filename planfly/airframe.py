"""The aircraft of a scenario and what it can do: what a plan needs of it, without flight and logs."""

import math
from dataclasses import dataclass

from aircraft.catalog import Aircraft, find_aircraft, model_hash
from aircraft.envelope import Envelope
from flight.dynamics.envelope_tables import load_envelope
from world.errors import ScenarioError
from world.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Airframe:
    """The aircraft of a scenario and what it can do.

    airspeed: m/s.  max_bank: rad.  battery: Wh.
    """

    aircraft: Aircraft
    envelope: Envelope
    airspeed: float
    max_bank: float
    battery: float


def choose_seed(scenario: Scenario, seed: int | None) -> int:
    """The seed asked for, else the scenario's, else 1."""
    if seed is not None:
        return seed
    return scenario.planner.seed if scenario.planner.seed is not None else 1


def load_airframe(scenario: Scenario) -> Airframe:
    """The scenario's aircraft.  Raises ScenarioError for an unknown one or a speed it cannot fly."""
    table = scenario.flight
    try:
        aircraft = find_aircraft(table.aircraft)
        model_hash(aircraft)
    except ValueError as error:
        raise ScenarioError(f"{scenario.name}: flight.aircraft: {error}") from error
    airspeed = aircraft.airspeed if table.airspeed_mps is None else table.airspeed_mps
    if not aircraft.airspeed_min <= airspeed <= aircraft.airspeed_max:
        raise ScenarioError(
            f"{scenario.name}: flight.airspeed_mps: {airspeed:g}: {aircraft.name} flies "
            f"{aircraft.airspeed_min:g}..{aircraft.airspeed_max:g}"
        )
    if scenario.wind.speed > 0.8 * airspeed:
        raise ScenarioError(
            f"{scenario.name}: wind.speed_mps: {scenario.wind.speed:g}: at most 80 % of the airspeed {airspeed:g}, "
            "to make way on every course"
        )
    envelope = load_envelope(aircraft, motor_braking=table.motor_braking)
    battery = aircraft.battery_energy / 3600.0 if table.battery_wh is None else table.battery_wh
    return Airframe(aircraft, envelope, airspeed, min(math.radians(table.max_bank_deg), envelope.max_bank), battery)
