"""Hold the setup of a flight: all its inputs, fixed before the flight starts."""

import copy
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from aircraft.envelope import Envelope
from aircraft.path_limits import Limits
from aircraft.tracking import corridor_half_width
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.guidance.path import FlyByPath, fly_by_path
from flight.mission.fences import describe_rally_violations
from flight.mission.ground_phases import GroundPhases, display_waypoints, find_ground_phases, route_notes
from flight.mission.items import Mission
from flight.mission.route import Route
from planner.plan import Plan
from world.arrays import Floats
from world.scenario import Scenario
from world.scenario_tables import Navigation

# ----------------------------------------------------------------------
# Source of a flight that planfly did not fly: an imported log, and its contents.

# "amsl": above mean sea level according to the vehicle. "ellipsoid": above the WGS 84 ellipsoid. "pressure": above the
# 1013.25 hPa level. "unstated": the log does not say.
VerticalDatum = Literal["amsl", "ellipsoid", "pressure", "unstated"]

# Kinds of data that rules require in addition to time and position.
DataKind = Literal["attitude", "airspeed", "wind", "battery", "throttle", "heights", "velocity"]

# End reason of a stretch: a mode change, the end of the log, or the landing.
StretchEnd = Literal["mode", "log", "landed"]


@dataclass(frozen=True, slots=True)
class MissionStretch:
    """Part of a log in which the vehicle flew the mission.

    start, end: s on the log's clock.
    mode: the vehicle's name for the mode, "" for a log without modes.
    ended: reason for the end.
    next_mode: next mode; "" without a next mode.
    """

    start: float
    end: float
    mode: str
    ended: StretchEnd
    next_mode: str = ""


@dataclass(frozen=True, slots=True)
class HeightOffset:
    """One other altitude in the log, and its offset from the altitude in use at the flight's start, m."""

    name: str
    offset: float


@dataclass(frozen=True, slots=True)
class Heights:
    """Altitude source of a log.

    source: message and field.
    datum: vertical datum.
    offsets: offsets of the log's other altitudes.
    """

    source: str
    datum: VerticalDatum
    offsets: tuple[HeightOffset, ...] = ()


@dataclass(frozen=True, slots=True)
class Damage:
    """Parts of a file that could not be read.

    places: number of unreadable stretches.
    size: total size of these stretches, bytes.
    cut: True if the file ends within a message.
    unreadable: number of complete messages without usable numbers.
    """

    places: int = 0
    size: int = 0
    cut: bool = False
    unreadable: int = 0

    @property
    def lossy(self) -> bool:
        """True if a part of the file other than its end is lost."""
        return self.places > 0 or self.unreadable > 0


@dataclass(frozen=True, slots=True)
class RowFaults:
    """Number of faults of each kind in a log's rows.

    doubled: duplicate rows.
    unordered: rows out of time order.
    unusable: rows without a position or a time.
    glitches: positions that the aircraft cannot have reached.
    clock_jumps: times at which the clock jumped, s.
    """

    doubled: int = 0
    unordered: int = 0
    unusable: int = 0
    glitches: int = 0
    clock_jumps: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Gap:
    """A pause between two rows, s."""

    start: float
    end: float


@dataclass(frozen=True, slots=True)
class MissingItems:
    """Items of a mission that its log lacks, or stores in an unusable form.

    numbers: numbers of the missing items, increasing, as in the judged mission.
    total: number of the mission's items, including home if the autopilot counts it; 0 if the log does not say.
    first, last: numbers of the first and last judged item; all items between them are judged.
    end: highest known number of an item.
    """

    numbers: tuple[int, ...]
    total: int
    first: int
    last: int
    end: int

    @property
    def beyond(self) -> bool:
        """True if the mission continues beyond the items that are judged."""
        return self.last < self.end


@dataclass(frozen=True, slots=True)
class ImportedLog:
    """An imported log as the source of a flight.

    file: name of the file.
    sha256: SHA-256 of its bytes.
    format: title of the file format.
    program: program that flew; "" if the log does not say.
    utc_start: s since 1970 at time 0; NaN if unknown.
    holds: kinds of data that the log contains in addition to times and positions.
    stretches: the judged stretches; other parts are only shown.
    heights: source of the altitude in use.
    wind: source of the wind: "XKF2", "" for none.
    mission: source of the mission: "CMD of the log, at 22.4 s", or a file.
    missing: items of that mission that the log lacks; None if the whole mission is judged.
    plan_heights: True if the mission states altitudes.
    aircraft_known: True if the aircraft was named; otherwise no aircraft limits apply.
    begins_in_flight: True if the log starts during the flight.
    gaps: pauses between rows, over all imported data.
    faults: faults of its rows.
    damage: unreadable parts of the file.
    notes: further facts for the user, in sentences.

    >>> ImportedLog("a.BIN", "", "ArduPilot dataflash log", "ArduPlane V4.6.0", holds=("attitude",)).holds
    ('attitude',)
    """

    file: str
    sha256: str
    format: str
    program: str = ""
    utc_start: float = math.nan
    holds: tuple[DataKind, ...] = ()
    stretches: tuple[MissionStretch, ...] = ()
    heights: Heights = field(default_factory=lambda: Heights("", "unstated"))
    wind: str = ""
    mission: str = ""
    plan_heights: bool = True
    aircraft_known: bool = False
    gaps: tuple[Gap, ...] = ()
    faults: RowFaults = field(default_factory=RowFaults)
    damage: Damage = field(default_factory=Damage)
    notes: tuple[str, ...] = ()
    missing: MissingItems | None = None
    begins_in_flight: bool = False


# JSBSim steps per second, except in campaigns.
FDM_HZ: Literal[120] = 120
# Flight model to use: "auto" is the compiled model if it equals JSBSim, "jsbsim" is JSBSim.
EngineChoice = Literal["auto", "jsbsim"]


@dataclass(frozen=True, slots=True)
class FlightSetup:
    """Inputs of a flight, which are mission, aircraft, autopilot and world; the log stores all of them.

    scenario: the world, and the requirements for the flight.
    mission: the mission, as read or exported.
    route: the waypoints that result from the mission.
    limits: limits of scenario and aircraft together.
    aircraft: name in the catalog, or folder.
    battery: energy that the aircraft carries, Wh.
    seed: seed of the flight, and of the turbulence unless the scenario's wind has its own seed.
    plan: plan of the mission; None for a mission from elsewhere.
    autopilot: the autopilot with its settings.
    nav: accuracy of the navigation, a key of `flight.guidance.navigation_error.ERRORS`.
    guidance_hz: guidance ticks per second, and track rows per second.
    fdm_hz: steps of JSBSim per second.
    engine: flight model to use; both give the same flight.
    imported_log: the imported log that the flight comes from; None for a flight by planfly.
    demanded_route: route with the airspeeds that are demanded in flight, where the autopilot ignores or limits a
        command. An imported flight keeps the commanded airspeeds: the limits of its autopilot may be unknown.
    path: reference path from the demanded route and the limits.
    """

    scenario: Scenario
    mission: Mission
    route: Route
    limits: Limits
    aircraft: str
    battery: float
    seed: int
    plan: Plan | None = None
    autopilot: Autopilot = field(default_factory=PlanflyGuidance)
    nav: Navigation = "perfect"
    guidance_hz: Literal[30, 60] = 60
    fdm_hz: Literal[60, 120] = FDM_HZ
    engine: EngineChoice = field(default="auto", compare=False)
    imported_log: ImportedLog | None = None
    demanded_route: Route = field(init=False, repr=False, compare=False)
    path: FlyByPath = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Compute the demanded airspeeds and, with them, the reference path."""
        airspeed = self.autopilot.speeds.flown_airspeeds(self.route.leg_airspeeds, self.airspeed)
        keeps_commands = self.imported_log is not None or np.array_equal(airspeed, self.route.leg_airspeeds)
        demanded_route = self.route if keeps_commands else self.route.with_fields(airspeed=airspeed)
        object.__setattr__(self, "demanded_route", demanded_route)
        object.__setattr__(self, "path", fly_by_path(self.demanded_route, self.limits, self.scenario.terrain))

    @property
    def name(self) -> str:
        """Stem for file names: the name of a plan's scenario, or the name of a mission's file."""
        return self.scenario.name if self.plan is not None else Path(self.mission.source).stem

    @property
    def envelope(self) -> Envelope:
        """Table of the aircraft's climbs, descents, speeds and powers."""
        return self.limits.envelope

    @property
    def corridor(self) -> float:
        """Half width of the corridor along the legs, which the flight must not leave, m."""
        return corridor_half_width(self.scenario.limits.corridor_m, self.autopilot.turns.acceptance_radius)

    @property
    def airspeed(self) -> float:
        """Airspeed until the mission sets another one, m/s."""
        return self.limits.airspeed

    @property
    def min_ground_speeds(self) -> Floats:
        """Minimum ground speed on the leg to each waypoint, m/s, (w,); 0 or less for no minimum."""
        stated_speeds = self.route.points["min_ground_speed"]
        return np.where(np.isnan(stated_speeds), self.autopilot.speeds.min_ground_speed, stated_speeds)

    @property
    def max_bank(self) -> float:
        """Maximum bank in turns, rad."""
        return self.limits.max_bank

    @property
    def ground_phases(self) -> GroundPhases:
        """Take-off and landing that the flight simulates; empty for an autopilot that flies neither."""
        has_ground_ends = self.scenario.launch is not None or self.scenario.landing is not None
        if self.imported_log is not None or not has_ground_ends:
            return GroundPhases()
        ground_rules = self.autopilot.ground
        if ground_rules.control_law is None:
            title = self.autopilot.title
            return GroundPhases(notes=(f"{title} flies no take-off and no landing: both are judged only by geometry",))
        ground_phases = find_ground_phases(self.scenario, self.mission, self.route, self.default_launch_speed)
        if (
            ground_rules.needs_both_ends
            and ground_phases
            and (ground_phases.take_off is None or ground_phases.approach is None)
        ):
            missing_end = "take-off" if ground_phases.take_off is None else "landing"
            text = (
                f"the {missing_end} is not simulated on the ground, so the flight of the program starts in the air, on"
                " a rail"
            )
            return GroundPhases(notes=(*ground_phases.notes, text))
        return ground_phases

    @property
    def default_launch_speed(self) -> float:
        """Minimum level-flight speed at the start of the route, m/s: the default launch speed."""
        return self.envelope.level_speeds(float(self.route.positions[0, 2]))[0]

    @property
    def display_waypoints(self) -> Floats:
        """Waypoints for pictures and tables, (w, 3) m; on the ground at a flown take-off or landing."""
        return display_waypoints(self.route, self.ground_phases)

    @property
    def started(self) -> str:
        """Text on the flight's start, with the reason why the scenario's launch or landing is not flown."""
        ground_phases, description = self.ground_phases, self.route.started
        if ground_phases.take_off is not None:
            description = ground_phases.take_off.description()
        return "; ".join([*([description] if description else []), *ground_phases.notes])

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on parts of the mission not flown as written, and on rally points beyond its fence."""
        any_suffices = self.autopilot.checks.any_inclusion_suffices
        rally_notes = describe_rally_violations(self.mission, self.scenario.origin, any_inclusion_suffices=any_suffices)
        return (*route_notes(self.route, self.ground_phases), *rally_notes)

    def in_scenario(self, scenario: Scenario) -> "FlightSetup":
        """Return a copy of the setup in another scenario, with the same route, limits and path."""
        setup = copy.copy(self)
        object.__setattr__(setup, "scenario", scenario)
        return setup

    def with_long_reversals(self) -> "FlightSetup":
        """Return a copy of the setup that takes the longer turn at each course reversal."""
        setup = copy.copy(self)
        path = fly_by_path(self.demanded_route, self.limits, self.scenario.terrain, fly_over_turn="long")
        object.__setattr__(setup, "path", path)
        return setup


def make_limits(
    scenario: Scenario, envelope: Envelope, airspeed: float, max_bank: float, autopilot: Autopilot | None = None
) -> Limits:
    """Return the limits of a path from the scenario; limits that it does not state are the aircraft's.

    airspeed: m/s.
    max_bank: rad; the limit of the envelope applies if it is smaller.
    autopilot: autopilot whose tracking error in the scenario's wind and navigation is taken into account; None for an
        autopilot that follows its path exactly.

    >>> from aircraft.catalog import load_aircraft
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from world.scenario import load_scenario
    >>> limits = make_limits(load_scenario("tight"), load_envelope(load_aircraft("aerosonde")), 25.0, 0.5)
    >>> limits.min_clearance, limits.max_bank, limits.max_turn is None
    (60.0, 0.5, False)
    """

    def limit_in_rad(value: float | str) -> float | None:
        """Return an angle limit in rad; None for a limit that is a word."""
        return None if isinstance(value, str) else math.radians(value)

    scenario_limits, flight = scenario.limits, scenario.flight
    tracking = None
    if autopilot is not None:
        tracking = autopilot.deviations.tracking_error(
            airspeed, flight.steering.nav, fly_over=flight.fly_over, turbulence=scenario.wind.turbulence
        )
    return Limits(
        max_turn=limit_in_rad(scenario_limits.max_turn_deg),
        max_climb=limit_in_rad(scenario_limits.max_climb_deg),
        max_dive=limit_in_rad(scenario_limits.max_dive_deg),
        min_clearance=scenario_limits.min_clearance_m,
        envelope=envelope,
        airspeed=airspeed,
        max_bank=min(max_bank, envelope.max_bank),
        wind=scenario.wind,
        tracking=tracking,
    )
