"""Everything that decides a flight, fixed before it starts."""

import math
from dataclasses import dataclass
from typing import Literal

from aircraft.envelope import Envelope
from aircraft.path_limits import Limits
from flight.mission.items import Mission
from flight.mission.route import Route
from planner.plan import Plan
from world.scenario import Scenario
from world.scenario_tables import Guidance, Navigation


@dataclass(frozen=True, slots=True)
class FlightSetup:
    """What is flown, by what, in which world; the log carries all of it.

    airspeed: m/s.  max_bank: rad.  battery: Wh.  mission_text: the mission as a .waypoints file, as flown.
    plan: None for a mission that a person brought.  seed: of the run; the turbulence's stream comes from it
    unless the scenario's wind has its own.  guidance: the law that steers.  nav: how well it knows where it is, a key
    of `flight.guidance.navigation_error.ERRORS`.  guidance_hz: how often it steers, and how many rows the track has a
    second.
    """

    scenario: Scenario
    mission: Mission
    mission_text: str
    route: Route
    envelope: Envelope
    aircraft: str
    airspeed: float
    max_bank: float
    battery: float
    seed: int
    plan: Plan | None = None
    guidance: Guidance = "path"
    nav: Navigation = "perfect"
    guidance_hz: Literal[30, 60] = 60


def limits_of(setup: FlightSetup) -> Limits:
    """Make the limits that this flight is judged against."""
    return make_limits(setup.scenario, setup.envelope, setup.airspeed, setup.max_bank)


def make_limits(scenario: Scenario, envelope: Envelope, airspeed: float, max_bank: float) -> Limits:
    """Make a scenario's limits, with the aircraft's where the scenario leaves them to it."""

    def number(value: float | str) -> float | None:
        return None if isinstance(value, str) else math.radians(value)

    table = scenario.limits
    return Limits(
        max_turn=number(table.max_turn_deg),
        max_climb=number(table.max_climb_deg),
        max_dive=number(table.max_dive_deg),
        min_clearance=table.min_clearance_m,
        envelope=envelope,
        airspeed=airspeed,
        max_bank=min(max_bank, envelope.max_bank),
        wind=scenario.wind,
    )
