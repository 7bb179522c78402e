"""Everything that decides a flight, fixed before it starts."""

import copy
import math
from dataclasses import dataclass, field
from typing import Literal

from aircraft.corridor import corridor_half_width
from aircraft.envelope import Envelope
from aircraft.path_limits import Limits
from flight.ardupilot.parameters import ArduPilotParameters
from flight.guidance.fly_by_path import FlyByPath, fly_by_path
from flight.mission.items import Mission
from flight.mission.route import Route
from flight.simulation.autopilot_program import AutopilotProgram
from flight.simulation.field_source import FieldSource
from planner.plan import Plan
from world.scenario import Scenario
from world.scenario_types import Guidance, Navigation

# Steps of JSBSim a second, but for campaigns.
FDM_HZ: Literal[120] = 120


@dataclass(frozen=True, slots=True)
class FlightSetup:
    """What is flown, by what, in which world; the log carries all of it.

    scenario: the world, and what it asks of the flight.
    mission: its items, as read or exported.
    mission_text: the same as a .waypoints file, as flown.
    route: the waypoints that the mission comes to.
    limits: of scenario and aircraft together, made where the aircraft is loaded.
    aircraft: its name in the catalog, or its folder.
    battery: energy carried, Wh.
    seed: of the flight; the turbulence's stream comes from it unless the scenario's wind has its own.
    plan: None for a mission that a person brought.
    guidance: the law that steers where ``parameters`` is None.
    nav: how well it knows where it is, a key of `flight.guidance.navigation_error.ERRORS`.
    guidance_hz: how often it steers, and how many rows the track has a second.
    fdm_hz: steps of JSBSim a second.
    parameters: of the ArduPlane that flies; None where planfly's guidance does.
    program: the real autopilot that flies; None where planfly's guidance or its law of ArduPlane does.
    source: the log of the field that the flight is from; None for a flight of planfly's own.
    path: that is to be followed, of route and limits.
    """

    scenario: Scenario
    mission: Mission
    mission_text: str
    route: Route
    limits: Limits
    aircraft: str
    battery: float
    seed: int
    plan: Plan | None = None
    guidance: Guidance = "path"
    nav: Navigation = "perfect"
    guidance_hz: Literal[30, 60] = 60
    fdm_hz: Literal[60, 120] = FDM_HZ
    parameters: ArduPilotParameters | None = None
    program: AutopilotProgram | None = None
    source: FieldSource | None = None
    path: FlyByPath = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Draw the path here, where it cannot differ from route and limits."""
        object.__setattr__(self, "path", fly_by_path(self.route, self.limits))

    @property
    def envelope(self) -> Envelope:
        """Table of the aircraft's climbs, descents, speeds and powers."""
        return self.limits.envelope

    @property
    def corridor(self) -> float:
        """Half width of the corridor about the legs that the flight has to stay in, m."""
        radius = None if self.parameters is None else self.parameters.wp_radius
        return corridor_half_width(self.scenario.limits.corridor_m, radius)

    @property
    def airspeed(self) -> float:
        """Airspeed until the mission sets another, m/s."""
        return self.limits.airspeed

    @property
    def max_bank(self) -> float:
        """Steepest bank in turns, rad."""
        return self.limits.max_bank

    def in_scenario(self, scenario: Scenario) -> "FlightSetup":
        """Set the same flight in another scenario; route, limits and path stay as they are."""
        moved = copy.copy(self)
        object.__setattr__(moved, "scenario", scenario)
        return moved


def make_limits(scenario: Scenario, envelope: Envelope, airspeed: float, max_bank: float) -> Limits:
    """Limits of a path: the scenario's, with the aircraft's where the scenario leaves them to it.

    airspeed: m/s.  max_bank: rad; the envelope's is used where it is less.

    >>> from aircraft.catalog import load_aircraft
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from world.scenario import load_scenario
    >>> limits = make_limits(load_scenario("tight"), load_envelope(load_aircraft("aerosonde")), 25.0, 0.5)
    >>> limits.min_clearance, limits.max_bank, limits.max_turn is None
    (60.0, 0.5, False)
    """

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
