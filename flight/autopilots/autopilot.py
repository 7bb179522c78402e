"""What steers a flight, as an interface: everything that the rest of planfly asks of an autopilot.

An `Autopilot` carries its own settings: a `FlightSetup` holds one, and whoever plans, flies, judges or records asks it
and never tests which one it is.  Each has a folder beside this file; `flight.autopilots.catalog.AUTOPILOTS` lists them.

The base class answers for an autopilot that flies the fly-by path as it was planned, at the true airspeeds that it is
told, without parameters, and returns to launch as ArduPlane does by its defaults.  An autopilot overrides what it does
otherwise.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import Aircraft
from aircraft.contacts import Contact
from aircraft.tracking import TrackingError
from flight.mission.ground_ways import GroundWays
from flight.mission.loiter_circles import USUAL_LOITERS, LoiterRules
from flight.mission.return_path import USUAL_RULES, ReturnRules
from flight.mission.route import RouteRules
from world.errors import ScenarioError
from world.json_schema import DocumentConfig
from world.kernels import Record
from world.scenario_tables import FlightTable, Guidance, Navigation
from world.terrain import Heights
from world.wind import Turbulence

Floats = NDArray[np.float64]

# One tick of the compiled loop, on the block of a `flight.simulation.tick.Workspace`: a key of `ENDS`, 0 to fly on.
Tick = Callable[[Floats, Heights], int]

# What a flight answers: whether the aircraft can fly it at all, or whether it goes well with an autopilot.
Level = Literal["airframe", "autopilot"]

# ----------------------------------------------------------------------
# Parameters: what a person's file, the aircraft's folder or the autopilot itself states.

Origin = Literal["file", "aircraft", "default"]


class ParameterValue(NamedTuple):
    """A parameter's value in the autopilot's unit, and who states it."""

    name: str
    value: float
    origin: Origin


# Who states a value, in words.
_STATED_BY: dict[Origin, str] = {"file": "the file", "aircraft": "the aircraft", "default": "the defaults"}


def find_misfits(values: Iterable[ParameterValue], orders: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
    """Name the values of a file that are above or below a parameter that has to be the other way round.

    orders: names of parameters whose values must not fall from one to the next.

    >>> made = [ParameterValue("THR_MIN", 74.0, "aircraft"), ParameterValue("TRIM_THROTTLE", 60.0, "file")]
    >>> find_misfits(made, [("THR_MIN", "TRIM_THROTTLE")])
    ('TRIM_THROTTLE 60 of the file is below THR_MIN 74 of the aircraft',)
    """
    known = {value.name: value for value in values}
    found = []
    for order in orders:
        for low, high in pairwise(known[name] for name in order if name in known):
            if low.value <= high.value or "file" not in (low.origin, high.origin):
                continue
            first, word, second = (high, "below", low) if high.origin == "file" else (low, "above", high)
            texts = (f"{one.name} {one.value:g} of {_STATED_BY[one.origin]}" for one in (first, second))
            found.append(f" is {word} ".join(texts))
    return tuple(found)


class Parameters(Protocol):
    """An autopilot's parameters by its own names and in its own units.

    values: every parameter that its law knows.  unused: names that the file states and the law has no use for.
    source: the file that a person gave, "" for none.  not_flown: read, but no flight shows them.
    beyond: values of the file outside their documented ranges, which are flown all the same, with those ranges.
    misfits: values of the file that contradict another parameter, in words; the autopilot flies with them all the same.
    """

    not_flown: ClassVar[tuple[str, ...]]

    @property
    def values(self) -> tuple[ParameterValue, ...]:
        """As above."""

    @property
    def unused(self) -> tuple[str, ...]:
        """As above."""

    @property
    def source(self) -> str:
        """As above."""

    @property
    def beyond(self) -> tuple[str, ...]:
        """As above."""

    @property
    def misfits(self) -> tuple[str, ...]:
        """As above."""

    def changed(self, **values: float) -> Self:
        """The same parameters but for these."""

    def by_origin(self, origin: Origin) -> dict[str, float]:
        """The values that one source states, by name."""


class SpeedLimits(NamedTuple):
    """Airspeeds (m/s) that an autopilot takes from a mission, and the parameters that set them.

    nearest: whether it flies the nearest of them for a command of another, which it else ignores.
    """

    min: float
    max: float
    min_name: str
    max_name: str
    nearest: bool = False


class MissionChecks(NamedTuple):
    """What PX4's feasibility checks go by, by default as its fixed wings do.

    acceptance: NAV_ACC_RAD, m.
    landing_angle: FW_LND_ANG, rad.
    requires: MIS_TKO_LAND_REQ: 0 nothing, 1 a takeoff, 2 a landing, 3 both, 4 and 5 both or neither.
    stated: whether a person's file decides what it requires.
    """

    acceptance: float = 10.0
    landing_angle: float = math.radians(5.0)
    requires: int = 2
    stated: bool = False


class LandingGlide(NamedTuple):
    """The way down to a landing point: straight to where the flare begins, and from there to the ground.

    slope: m of height per m of way.
    flare_height: of the flare's beginning over the landing point, m; 0 where none is known of.
    flare_distance: of the flare's beginning before the landing point, m.
    """

    slope: float
    flare_height: float = 0.0
    flare_distance: float = 0.0


class Candidate(NamedTuple):
    """A parameter that may decide a flight that fails.

    name: the autopilot's.
    step: the increment that its parameter reference gives, or a few of them.
    far: the farthest value that is tried, within the range that the reference gives.
    unit: of both.
    least: what is named as passing at the least, in steps from here where the present value is below it.
    """

    name: str
    step: float
    far: float
    unit: str
    least: float = -math.inf


@dataclass(frozen=True, slots=True)
class AutopilotProgram(DocumentConfig):
    """The SITL program that flew."""

    version: str
    """The version that the program states."""
    sha256: str
    """Of its file."""
    parameters: Mapping[str, float]
    """Values that the program was given over its own defaults, as it had them."""
    changed: Mapping[str, float]
    """Those of the parameters for which a person's file states another value than the aircraft's."""
    unused: tuple[str, ...] = ()
    """Names in the person's file that the program does not know, or that belong to other hardware."""


class StoredParameters(NamedTuple):
    """Parameters as a log stores them: the fields of `Parameters`."""

    values: tuple[ParameterValue, ...]
    unused: tuple[str, ...]
    source: str


class StoredAutopilot(NamedTuple):
    """An autopilot's settings as a log stores them.

    guidance: the law of planfly's guidance, "path" for every other autopilot.
    version: of an autopilot whose releases have laws of their own, "" for any other.
    """

    guidance: Guidance = "path"
    parameters: StoredParameters | None = None
    program: AutopilotProgram | None = None
    version: str = ""


# ----------------------------------------------------------------------


class Autopilot(ABC):
    """What steers a flight, with its settings; subclasses are frozen dataclasses.

    name: as `[flight] autopilot` states it.
    title: as texts name it.
    level: which question its flight answers.  At "airframe" it stands for the aircraft alone; at "autopilot" its
    verdict is set beside a reference flight by planfly's guidance.
    parameters: None for an autopilot that has none.
    program: that flew it, None for a law and before the flight.
    own: type of the record that its law keeps beside `flight.guidance.inner_loops.GUIDANCE_MEMORY`; None for none.
    cruise_parameter: that states its cruise airspeed; "" for none.
    equivalent_airspeeds: whether commanded airspeeds count as equivalent ones, which are less than true ones at height;
    it then takes over in level flight.
    acceptance_limit: largest acceptance radius that it reads of an item, m.
    refuses: whether it takes no mission that PX4's feasibility checks refuse.
    refuses_as_arduplane: whether it takes no mission with a command that ArduPlane refuses.
    reads_as_px4: whether it reads nothing but the value of a mission's change of speed, goes back to its own airspeed
        for any that is not positive, and reads gates.
    flies_ground: whether it flies take-offs and landings, see `from_ground`.
    flies_both_ends: whether it does so only in a mission that has both.
    height_parameter: says how far off a waypoint's height it circles there; "" for one that flies on.
    height_candidates, side_candidates: parameters that may decide a flight which fails by its height or its track.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    level: ClassVar[Level] = "autopilot"
    own: ClassVar[np.dtype[np.record] | None] = None
    cruise_parameter: ClassVar[str] = ""
    equivalent_airspeeds: ClassVar[bool] = False
    acceptance_limit: ClassVar[float] = math.inf
    refuses: ClassVar[bool] = False
    refuses_as_arduplane: ClassVar[bool] = False
    reads_as_px4: ClassVar[bool] = False
    flies_ground: ClassVar[bool] = False
    flies_both_ends: ClassVar[bool] = False
    height_parameter: ClassVar[str] = ""
    height_candidates: ClassVar[tuple[Candidate, ...]] = ()
    side_candidates: ClassVar[tuple[Candidate, ...]] = ()
    parameters: Parameters | None = None
    program: AutopilotProgram | None = None

    # How it is made: of a scenario, of a log.

    @classmethod
    def load(cls, table: FlightTable, aircraft: Aircraft, scenario: str) -> Self:
        """The autopilot of a scenario's [flight] table, which `scenario` names in messages.

        Raises ScenarioError for an entry that it does not take, and ParameterError for a bad file of parameters.
        """
        if table.params is not None:
            allowed = f'not a key of autopilot = "{cls.name}", which has no parameters'
            raise ScenarioError.at(scenario, "flight.params", table.params, allowed)
        return cls()

    @classmethod
    def restore(cls, stored: StoredAutopilot) -> Self:
        """The autopilot that a log stores.  Raises ParameterError for a value that is not allowed."""
        return cls()

    def store(self) -> StoredAutopilot:
        """Its settings as a log stores them: what `restore` takes."""
        return StoredAutopilot()

    @classmethod
    def of_flight_log(
        cls, program: str, parameters: Mapping[str, float], source: str
    ) -> tuple[Self, tuple[str, ...]] | None:
        """The autopilot that wrote a log, and what of its parameters could not be used; None for another's log.

        program: as the log names what flew.  parameters: by name.  source: the log's file.
        """
        return None

    @classmethod
    def recognises(cls, program: Path) -> bool:
        """Whether it is flown by such a program, which --autopilot names; False for a law."""
        return False

    @classmethod
    def missing_files(cls, aircraft: Aircraft) -> list[str]:
        """What an aircraft's folder lacks to be flown by it, in sentences.  Raises PlanflyError for a broken file."""
        return []

    # What flies.

    @property
    def law(self) -> "Autopilot":
        """The autopilot whose law flies where no program does: itself, but for a program."""
        return self

    @property
    @abstractmethod
    def tick(self) -> Tick:
        """One tick of its law, compiled."""

    def begin(self, memory: Record, own: Record) -> None:
        """Set what its law needs to know before the first tick.

        memory: of `flight.guidance.inner_loops.GUIDANCE_MEMORY`.  own: of the type `own`, None where that is None.
        """
        return

    def from_ground(self, ways: GroundWays, aircraft: Aircraft, contacts: Sequence[Contact]) -> "GroundAutopilot":
        """The autopilot that flies these ways from the ground and to it as well; only of one that `flies_ground`.

        contacts: of the aircraft.
        """
        raise ValueError(f"{self.title} flies no take-off and no landing")

    def take_over(self, before: Record, own: Record, here: Floats) -> None:
        """Begin another way where the aircraft is, and keep what the law has learnt of the aircraft.

        before: the record that the law kept on the way it was on.  own: the one for this way, which `begin` has seen.
        here: (3,) where it begins, m.
        """
        return

    # What a plan, a mission and a verdict have to know of it.

    def described(self, aircraft: str) -> str:
        """Who steers, in words, with the settings that decide most of the flight."""
        return self.title

    @property
    def version(self) -> str:
        """The release that flies, or whose law does; "" for planfly's own guidance, which has planfly's version."""
        return ""

    @property
    def acceptance_radius(self) -> float | None:
        """Distance (m) from a waypoint at which it turns to the next leg where the mission states none.

        None for an autopilot that follows the fly-by path.  Any other flies from leg to leg, and has reached a
        waypoint too where it passes the line across the leg there.
        """
        return None

    @property
    def reads_acceptance(self) -> bool:
        """Whether the radius that a mission states at a waypoint decides when it turns to the next leg."""
        return True

    @property
    def follows_path(self) -> bool:
        """Whether it follows the fly-by path, and does not turn by an acceptance radius."""
        return self.acceptance_radius is None

    def settings_not_flown(self, *, returns: bool) -> list[str]:
        """Return the settings that change the flight path and that no flight shows, as sentences without a full stop.

        returns: True if the mission returns to launch.
        """
        return []

    @property
    def follows_ground(self) -> bool:
        """True if it follows the ground along a leg to a height above terrain."""
        return True

    @property
    def keeps_to_arcs(self) -> bool:
        """Whether how closely it passes a waypoint tells the radius of its turn."""
        return True

    def turn_distance(self, turn: float, amsl: float) -> float:
        """How far (m) before a waypoint it turns to the next leg at most; 0 for one that follows the fly-by path.

        turn: rad, positive; pi at the mission's end.  amsl: height of the waypoint, m.
        """
        return 0.0

    def airspeed_factor(self, amsl: float) -> float:
        """True airspeed that it flies by the commanded one, at a height (m AMSL)."""
        return 1.0

    def landing_glide(self, height: float, run: float, tail_wind: float, amsl: float) -> LandingGlide:
        """The way down to a landing point from the waypoint before it: straight to the point, and no flare is told.

        height, run: of that waypoint over the landing point and before it, m, both positive.
        tail_wind: m/s, negative from ahead.  amsl: height of the landing point, m.

        >>> from flight.autopilots.planfly.autopilot import PlanflyGuidance
        >>> PlanflyGuidance().landing_glide(50.0, 1000.0, 0.0, 0.0)
        LandingGlide(slope=0.05, flare_height=0.0, flare_distance=0.0)
        """
        return LandingGlide(height / run)

    def landing_airspeed(self, cruise: float, tail_wind: float, amsl: float) -> float:
        """True airspeed on the glide to a landing point, m/s: that of the cruise, m/s.

        tail_wind: m/s, negative from ahead.  amsl: height of the landing point, m.
        """
        return cruise

    def as_asked(
        self, rtl_altitude: float | None, rtl_autoland: int | None, *, lands: bool, lower: float = 0.0
    ) -> "Autopilot":
        """The autopilot with what a scenario sets of its returns; as it is where it has no parameters for it.

        rtl_altitude: over home, m.  rtl_autoland: ArduPlane's; None where the scenario leaves them as they are.
        lands: whether the scenario's missions end with a landing sequence.  lower: by so much than home, m.
        """
        return self

    def go_around_height(self, asked: float, takeoff: float) -> float | None:
        """Height over home (m) that it climbs to on its landing course before it goes around; None where that is open.

        asked: by the landing item, m, 0 for nothing.  takeoff: of the mission's take-off over home, m, 0 for none.
        """
        return None

    @property
    def launch_trigger(self) -> tuple[float, str] | None:
        """Least acceleration of a launch that starts its motor, m/s^2, and the parameter; None where none is needed."""
        return None

    @property
    def speed_limits(self) -> SpeedLimits | None:
        """Airspeeds that it takes from a mission; None for no limits."""
        return None

    def speeds_flown(self, commanded: Floats, cruise: float) -> Floats:
        """Airspeeds (l,) that it flies on each leg, of those commanded (l,), m/s.

        cruise: its airspeed until it takes up the first.
        """
        return commanded

    @property
    def return_rules(self) -> ReturnRules:
        """How it returns to launch: where to, how high, how it turns and circles."""
        return USUAL_RULES

    @property
    def loiter_rules(self) -> LoiterRules:
        """How it flies loiters: how wide where the mission does not say, how it joins and leaves them."""
        return USUAL_LOITERS

    @property
    def route_rules(self) -> RouteRules:
        """Rules by which it flies the route of a mission."""
        turn_distance = None if self.follows_path else self.turn_distance
        limit = self.acceptance_limit
        return RouteRules(self.return_rules, self.loiter_rules, self.reads_as_px4, turn_distance, limit)

    @property
    def mission_checks(self) -> MissionChecks:
        """What PX4's feasibility checks go by: with its default parameters where it is another autopilot."""
        return MissionChecks()

    @property
    def stated_airspeed(self) -> tuple[float, str] | None:
        """Cruise airspeed (m/s) that a person's file of parameters states, and the parameter; None for none."""
        stated = {} if self.parameters is None else self.parameters.by_origin("file")
        return (stated[self.cruise_parameter], self.cruise_parameter) if self.cruise_parameter in stated else None

    @property
    def stated_bank(self) -> float | None:
        """Bank limit (rad) that a person's file of parameters states; None for none."""
        return None

    @property
    def bank_limit(self) -> float:
        """Steepest bank that it demands, rad; inf for whatever the aircraft's limits allow."""
        return math.inf

    def tracking_error(
        self, airspeed: float, nav: Navigation, *, fly_over: bool = False, turbulence: Turbulence = "none"
    ) -> TrackingError | None:
        """How far it strays from the legs it is given, which a plan has to leave free; None where it holds its path.

        airspeed: commanded, m/s.  nav: how well it knows where it is.  fly_over: whether it flies on to each waypoint
        before it turns.  turbulence: of the wind.
        """
        return None

    def off_height_chance(self, climb: float, sink: float, turbulence: Turbulence) -> float:
        """Chance (0..1) that gusts have it so far off a waypoint's height that it circles there; 0 if it flies on.

        climb, sink: what the aircraft has in hand against gusts, m/s.
        """
        return 0.0

    def gust_sink(self, climb: float, turbulence: Turbulence) -> float:
        """How far (m) below its path downdrafts of one in a hundred take it; 0 if its tracking error allows for them.

        climb: rate of climb that the aircraft has unused against them, m/s.
        """
        return 0.0

    def gust_rise(self, sink: float, turbulence: Turbulence) -> float:
        """How far (m) above its path updrafts of one in a hundred lift it; 0 if it holds its height against them.

        sink: rate of sink that the aircraft has unused against them, m/s.
        """
        return 0.0

    def with_parameters(self, **values: float) -> "Autopilot":
        """The same law with other values of parameters, by its own names and in its own units."""
        raise ValueError(f"{self.title} has no parameters")


class GroundAutopilot(Autopilot):
    """An autopilot that takes off, or lands, or both."""

    @property
    @abstractmethod
    def released_throttle(self) -> float:
        """Throttle (0..1) where rail or hand lets go of the aircraft, or where it stands on the runway."""


def describe_program(program: AutopilotProgram, aircraft: str, named: int = 8) -> str:
    """A program in words; every parameter stands in the verdict's data.

    named: changed parameters that are named.
    """
    changed = [f"{name} {value:g}" for name, value in program.changed.items()]
    more = f", +{len(changed) - named} more" if len(changed) > named else ""
    return (
        f"{program.version} (sha256 {program.sha256[:8]}...), {len(program.parameters)} parameters set for"
        f" {Path(aircraft).name}, changed: {', '.join(changed[:named]) or 'none'}{more}"
    )
