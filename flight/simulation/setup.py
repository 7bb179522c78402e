"""Everything that decides a flight, fixed before it starts."""

import copy
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import Envelope
from aircraft.path_limits import Limits
from aircraft.tracking import corridor_half_width
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.guidance.path import FlyByPath, fly_by_path
from flight.mission.ground_ways import GroundWays, find_ground_ways, flown_notes, shown_waypoints
from flight.mission.items import Mission
from flight.mission.route import Route
from planner.plan import Plan
from world.scenario import Scenario
from world.scenario_tables import Navigation

Floats = NDArray[np.float64]

# ----------------------------------------------------------------------
# Where a flight is from that was not flown by planfly: an imported log, and what that log can carry.

# "amsl": above mean sea level as the vehicle has it.  "ellipsoid": above WGS 84's.  "pressure": above the level of
# 1013.25 hPa.  "unstated": the log does not say.
VerticalDatum = Literal["amsl", "ellipsoid", "pressure", "unstated"]

# What rules ask for beside a time and a place.
Quantity = Literal["attitude", "airspeed", "wind", "battery", "throttle", "heights", "velocity"]

# Why a stretch ended: another mode was set, the log ends, the aircraft had landed.
StretchEnd = Literal["mode", "log", "landed"]


@dataclass(frozen=True, slots=True)
class MissionStretch:
    """A stretch flown along the mission.

    start, end: s of the log's clock.
    mode: the vehicle's name for it, "" of a log that knows no modes.
    ended: why it ended.
    next_mode: the mode that was set, "" where none was.
    """

    start: float
    end: float
    mode: str
    ended: StretchEnd
    next_mode: str = ""


@dataclass(frozen=True, slots=True)
class HeightOffset:
    """How much higher another height of the log was than the one taken, m, at the start of what is judged."""

    name: str
    offset: float


@dataclass(frozen=True, slots=True)
class Heights:
    """Which of a log's heights was taken.

    source: the message and field.  datum: vertical datum.
    offsets: of the log's other heights.
    """

    source: str
    datum: VerticalDatum
    offsets: tuple[HeightOffset, ...] = ()


@dataclass(frozen=True, slots=True)
class Damage:
    """What of a file could not be read.

    places: how many stretches of it.  size: their bytes.  cut: it ends within a message.  unreadable: messages that
    were whole and held no numbers that could be used.
    """

    places: int = 0
    size: int = 0
    cut: bool = False
    unreadable: int = 0

    @property
    def lossy(self) -> bool:
        """Whether anything but the file's end is lost."""
        return self.places > 0 or self.unreadable > 0


@dataclass(frozen=True, slots=True)
class RowFaults:
    """What was wrong with a log's rows, and how often.

    doubled: rows that came twice.  unordered: rows out of the order of their times.
    unusable: rows without a place or a time.
    glitches: places that the aircraft cannot have been at.  clock_jumps: times (s) at which the clock jumped.
    """

    doubled: int = 0
    unordered: int = 0
    unusable: int = 0
    glitches: int = 0
    clock_jumps: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Gap:
    """A pause (s) between two rows."""

    start: float
    end: float


@dataclass(frozen=True, slots=True)
class MissingItems:
    """Items of a mission that its log does not hold, or holds in a form that no autopilot could make sense of.

    numbers: of those items, rising, as the mission that is judged counts.
    total: how many items the mission has, home among them where the autopilot counts it; 0 where the log does not say.
    first, last: numbers of the items that are judged, with all between them.
    end: the highest number that is known of.
    """

    numbers: tuple[int, ...]
    total: int
    first: int
    last: int
    end: int

    @property
    def beyond(self) -> bool:
        """Whether the mission goes on beyond what is judged."""
        return self.last < self.end


@dataclass(frozen=True, slots=True)
class ImportedLog:
    """An imported log as the source of a flight.

    file: its name.  sha256: of its bytes.
    format: for people.  program: what flew, "" where the log does not say.
    utc_start: s since 1970 at time 0; NaN where it is not known.
    holds: what the log holds beside times and places, and the plan of heights.
    stretches: what is judged; the rest is shown.
    heights: which was taken.
    wind: where the wind is from: "XKF2", "" for none.
    mission: where the mission is from: "CMD of the log, at 22.4 s", or a file.
    missing: items of that mission that the log does not hold; None where it is judged in full.
    plan_heights: whether the mission states heights.
    aircraft_known: whether the aircraft was named; if not, none of its limits count.
    begins_in_flight: whether the log begins after the flight did.
    gaps: pauses between rows, over the whole of what was imported.
    faults: of its rows.  damage: of the file.
    notes: what else a person should know, in sentences.

    >>> ImportedLog("a.BIN", "", "ArduPilot dataflash log", "ArduPlane V4.6.0", holds=("attitude",)).holds
    ('attitude',)
    """

    file: str
    sha256: str
    format: str
    program: str = ""
    utc_start: float = math.nan
    holds: tuple[Quantity, ...] = ()
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


# Steps of JSBSim a second, but for campaigns.
FDM_HZ: Literal[120] = 120


@dataclass(frozen=True, slots=True)
class FlightSetup:
    """What is flown, by what, in which world; the log carries all of it.

    scenario: the world, and what it asks of the flight.
    mission: its items, as read or exported.
    route: the waypoints that the mission comes to.
    limits: of scenario and aircraft together, made where the aircraft is loaded.
    aircraft: its name in the catalog, or its folder.
    battery: energy carried, Wh.
    seed: of the flight; the turbulence's stream comes from it unless the scenario's wind has its own.
    plan: None for a mission that a person brought.
    autopilot: what steers, with its settings.
    nav: how well it knows where it is, a key of `flight.guidance.navigation_error.ERRORS`.
    guidance_hz: how often it steers, and how many rows the track has a second.
    fdm_hz: steps of JSBSim a second.
    source: the imported log that the flight is from; None for a flight of planfly's own.
    path: that is to be followed, of route and limits.
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
    source: ImportedLog | None = None
    path: FlyByPath = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Draw the path here, where it cannot differ from route and limits."""
        object.__setattr__(self, "path", fly_by_path(self.route, self.limits, self.scenario.terrain))

    @property
    def name(self) -> str:
        """Stem for names of files: the scenario of a plan, the file of a mission."""
        return self.scenario.name if self.plan is not None else Path(self.mission.source).stem

    @property
    def envelope(self) -> Envelope:
        """Table of the aircraft's climbs, descents, speeds and powers."""
        return self.limits.envelope

    @property
    def corridor(self) -> float:
        """Half width of the corridor about the legs that the flight has to stay in, m."""
        return corridor_half_width(self.scenario.limits.corridor_m, self.autopilot.acceptance_radius)

    @property
    def airspeed(self) -> float:
        """Airspeed until the mission sets another, m/s."""
        return self.limits.airspeed

    @property
    def max_bank(self) -> float:
        """Steepest bank in turns, rad."""
        return self.limits.max_bank

    @property
    def ground_ways(self) -> GroundWays:
        """What of the flight is flown from the ground and to it: nothing by an autopilot that does neither."""
        asked = self.scenario.launch is not None or self.scenario.landing is not None
        if self.source is not None or not asked:
            return GroundWays()
        if not self.autopilot.flies_ground:
            title = self.autopilot.title
            return GroundWays(notes=(f"take-off and landing are not flown, and not judged as flown, by {title}",))
        ways = find_ground_ways(self.scenario, self.mission, self.route, self.slowest_launched)
        if self.autopilot.flies_both_ends and ways and (ways.take_off is None or ways.approach is None):
            lacks = "take-off" if ways.take_off is None else "landing"
            text = f"without a {lacks} that is flown from the ground, the program is put into the air on a rail"
            return GroundWays(notes=(*ways.notes, text))
        return ways

    @property
    def slowest_launched(self) -> float:
        """Slowest level flight at the route's start, m/s: a launch that states no speed goes by it."""
        return self.envelope.level_speeds(float(self.route.waypoints[0, 2]))[0]

    @property
    def shown_waypoints(self) -> Floats:
        """The route's waypoints (w, 3) m as pictures and tables show them: flown ends on the ground."""
        return shown_waypoints(self.route, self.ground_ways)

    @property
    def started(self) -> str:
        """How the flight starts, in words, and why a launch or a landing of its scenario is not flown."""
        ways, started = self.ground_ways, self.route.started
        if ways.take_off is not None:
            started = ways.take_off.described()
        return "; ".join([*([started] if started else []), *ways.notes])

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the mission is not flown as written, in sentences."""
        return flown_notes(self.route, self.ground_ways)

    def in_scenario(self, scenario: Scenario) -> "FlightSetup":
        """Set the same flight in another scenario; route, limits and path stay as they are."""
        moved = copy.copy(self)
        object.__setattr__(moved, "scenario", scenario)
        return moved

    def turned_to_other_side(self) -> "FlightSetup":
        """Set the same flight with its reversals turned to the side of the longer turn; all else stays as it is."""
        turned = copy.copy(self)
        path = fly_by_path(self.route, self.limits, self.scenario.terrain, swing="long")
        object.__setattr__(turned, "path", path)
        return turned


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
