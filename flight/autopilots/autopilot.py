"""Define the interface of an autopilot, through which the rest of planfly uses what controls a flight.

An `Autopilot` carries its own settings.  A `FlightSetup` contains an autopilot; planning, flights, verdicts and
recordings call its methods, and never test which autopilot it is.  Each autopilot has a folder next to this file;
`flight.autopilots.catalog.AUTOPILOTS` lists all of them.

The base class describes an autopilot without parameters that flies the fly-by path as it was planned, at the commanded
true airspeeds, and returns to launch as ArduPlane does by its defaults.  An autopilot overrides the methods in which it
differs.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple, Protocol, Self

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.contacts import Contact
from aircraft.tracking import TrackingError
from flight.dynamics.instructions import Code
from flight.mission.ground_ways import GroundPhases
from flight.mission.loiter_circles import USUAL_LOITERS, LoiterRules
from flight.mission.return_path import USUAL_RULES, ReturnRules
from flight.mission.route import RouteRules
from world.arrays import Floats, Heights
from world.errors import ScenarioError
from world.json_schema import DocumentConfig
from world.kernels import Record, Records
from world.scenario_tables import FlightTable, Guidance, Navigation
from world.wind import Turbulence

# One tick of the compiled loop on the block of a `flight.simulation.tick.Workspace`; returns a key of `ENDS`, or 0 to
# fly on.
Tick = Callable[[Floats, Heights], int]

# A number of ticks, each followed by the steps of a compiled model.  The arguments are block, heights, frames, numbers,
# code, contacts and frictions of a `flight.dynamics.compiled_model.CompiledModel`, and the number of ticks; returns the
# status of the last tick.
Loop = Callable[[Floats, Heights, Records, Floats, Code, Records, Records, int], int]

# Question that a flight answers: can the aircraft itself fly the mission, or can the aircraft with its autopilot.
Level = Literal["airframe", "autopilot"]

# ----------------------------------------------------------------------
# Parameters, from the user's file, the aircraft's folder or the autopilot's defaults.

Origin = Literal["file", "aircraft", "default"]


class ParameterValue(NamedTuple):
    """A parameter's value in the autopilot's unit, with its source."""

    name: str
    value: float
    origin: Origin


# Texts for the sources of a value.
_SOURCE_NAMES: dict[Origin, str] = {"file": "the file", "aircraft": "the aircraft", "default": "the defaults"}


def find_misfits(values: Iterable[ParameterValue], orders: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
    """Describe the values of a file that contradict the order of two parameters.

    orders: names of parameters whose values must not decrease from one parameter to the next.

    >>> made = [ParameterValue("THR_MIN", 74.0, "aircraft"), ParameterValue("TRIM_THROTTLE", 60.0, "file")]
    >>> find_misfits(made, [("THR_MIN", "TRIM_THROTTLE")])
    ('TRIM_THROTTLE 60 of the file is below THR_MIN 74 of the aircraft',)
    """
    value_by_name = {value.name: value for value in values}
    misfits = []
    for order in orders:
        for lower, higher in pairwise(value_by_name[name] for name in order if name in value_by_name):
            if lower.value <= higher.value or "file" not in (lower.origin, higher.origin):
                continue
            file_value, relation, other_value = (
                (higher, "below", lower) if higher.origin == "file" else (lower, "above", higher)
            )
            texts = (
                f"{parameter.name} {parameter.value:g} of {_SOURCE_NAMES[parameter.origin]}"
                for parameter in (file_value, other_value)
            )
            misfits.append(f" is {relation} ".join(texts))
    return tuple(misfits)


class Parameters(Protocol):
    """An autopilot's parameters by its own names and in its own units.

    values: every parameter that the control law uses.
    unused: names in the file that the control law does not use.
    source: the user's file, "" if there is no file.
    not_flown: parameters that are read but have no effect on the simulated flight.
    beyond: values of the file outside their documented ranges, with those ranges; they are used nevertheless.
    misfits: texts on values of the file that contradict another parameter; they are used nevertheless.
    """

    not_flown: ClassVar[tuple[str, ...]]

    @property
    def values(self) -> tuple[ParameterValue, ...]:
        """See the class."""

    @property
    def unused(self) -> tuple[str, ...]:
        """See the class."""

    @property
    def source(self) -> str:
        """See the class."""

    @property
    def beyond(self) -> tuple[str, ...]:
        """See the class."""

    @property
    def misfits(self) -> tuple[str, ...]:
        """See the class."""

    def changed(self, **values: float) -> Self:
        """Return a copy with other values for some parameters."""

    def by_origin(self, origin: Origin) -> dict[str, float]:
        """Return the values that one source states, by name."""


class SpeedLimits(NamedTuple):
    """Airspeeds (m/s) that an autopilot accepts from a mission, and the parameters that set them.

    nearest: True if the autopilot flies the nearest limit for a command outside the limits, False if it ignores such a
        command.
    """

    min: float
    max: float
    min_name: str
    max_name: str
    nearest: bool = False


class MissionChecks(NamedTuple):
    """Settings of PX4's feasibility checks; the defaults are those of its fixed wings.

    landing_angle: FW_LND_ANG, rad.
    requires: MIS_TKO_LAND_REQ: 0 nothing, 1 a takeoff, 2 a landing, 3 both, 4 and 5 both or neither.
    stated: True if the user's file decides ``requires``.
    """

    landing_angle: float = math.radians(5.0)
    requires: int = 2
    stated: bool = False


class LandingGlide(NamedTuple):
    """Glide to a landing point: a straight line to the start of the flare, then the flare.

    slope: m of altitude per m of distance.
    flare_height: height of the start of the flare above the landing point, m; 0 if unknown.
    flare_distance: distance of the start of the flare before the landing point, m.
    """

    slope: float
    flare_height: float = 0.0
    flare_distance: float = 0.0


class Candidate(NamedTuple):
    """A parameter that may cause a flight to fail.

    name: the autopilot's name for the parameter.
    step: increment of the autopilot's parameter reference, or a few increments.
    far: value to try that is furthest from the present value, within the range of the reference.
    unit: unit of step and value.
    least: minimum value that may be suggested; the steps start there if the present value is lower.
    """

    name: str
    step: float
    far: float
    unit: str
    least: float = -math.inf


class BatteryFailsafe(NamedTuple):
    """A failsafe that leaves the mission at a state of the battery.

    parameter: name of the parameter of its threshold.
    threshold: value of that parameter, mAh that remain or V.
    used_charge: used charge at which it leaves the mission, mAh; NaN for a threshold of the voltage.
    """

    parameter: str
    threshold: float
    used_charge: float = math.nan


class MissionParts(NamedTuple):
    """Parts of a mission that decide which of an autopilot's settings change the flight.

    returns: True if the mission returns to launch.
    has_return_path: True if the mission marks a return path (DO_RETURN_PATH_START).
    takes_off, lands: True if the take-off or the landing is flown from or to the ground.
    loiters_to_land: True if the last item before a landing is a loiter.
    has_fence: True if the mission carries a fence.
    enables_fence: True if the mission switches the fence on (DO_FENCE_ENABLE).
    throttled_airspeeds: airspeeds that the mission commands together with a throttle, m/s.
    moves_payload: True if the mission commands a gripper, a winch or a gimbal, after which PX4 may wait.
    wind: highest mean wind speed on the route, m/s.
    """

    returns: bool = False
    has_return_path: bool = False
    takes_off: bool = False
    lands: bool = False
    loiters_to_land: bool = False
    has_fence: bool = False
    enables_fence: bool = False
    throttled_airspeeds: tuple[float, ...] = ()
    moves_payload: bool = False
    wind: float = 0.0


@dataclass(frozen=True, slots=True)
class AutopilotProgram(DocumentConfig):
    """SITL program of a flight."""

    version: str
    """Version that the program reports."""
    sha256: str
    """SHA-256 of the program's file."""
    parameters: Mapping[str, float]
    """Values that replaced the program's own defaults, as the program stored them."""
    changed: Mapping[str, float]
    """Parameters for which the user's file states a different value from the aircraft's."""
    unused: tuple[str, ...] = ()
    """Names in the user's file that the program does not know, or that belong to other hardware."""


class StoredParameters(NamedTuple):
    """Parameters as a log stores them: the fields of `Parameters`."""

    values: tuple[ParameterValue, ...]
    unused: tuple[str, ...]
    source: str


class StoredAutopilot(NamedTuple):
    """An autopilot's settings as a log stores them.

    guidance: control law of planfly's guidance; "path" for every other autopilot.
    version: release of an autopilot whose releases fly differently; "" for any other autopilot.
    """

    guidance: Guidance = "path"
    parameters: StoredParameters | None = None
    program: AutopilotProgram | None = None
    version: str = ""


# ----------------------------------------------------------------------


class Autopilot(ABC):
    """Autopilot of a flight, with its settings; subclasses are frozen dataclasses.

    name: name in `[flight] autopilot`.
    title: name in texts.
    level: question that its flight answers.  "airframe": the autopilot stands only for the aircraft.  "autopilot": its
        verdict is compared with a reference flight by planfly's guidance.
    parameters: None for an autopilot without parameters.
    program: program that flew; None for a simulated autopilot and before the flight.
    own: type of the autopilot's own record, in addition to `flight.guidance.inner_loops.GUIDANCE_MEMORY`, or None.
    cruise_parameter: parameter of the cruise airspeed; "" without such a parameter.
    equivalent_airspeeds: True if commanded airspeeds are equivalent airspeeds, which at altitude are lower than true
        airspeeds; the autopilot then takes over in level flight.
    acceptance_limit: maximum acceptance radius that the autopilot reads from an item, m.
    refuses: True if the autopilot refuses missions that fail PX4's feasibility checks.
    refuses_as_arduplane: True if the autopilot refuses missions with a command that ArduPlane refuses.
    reads_as_px4: True if the autopilot reads only the value of a mission's change of speed, goes back to its own
        airspeed for any value that is not positive, and reads gates.
    flies_ground: True if the autopilot flies take-offs and landings, see `from_ground`.
    flies_both_ends: True if the autopilot flies them only in a mission that has both.
    is_program: True for an external program, which reads its own parameters.
    height_parameter: altitude tolerance outside which the autopilot circles at a waypoint; "" if it flies on.
    height_candidates, side_candidates: parameters that may cause an altitude or a track to fail.
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
    is_program: ClassVar[bool] = False
    height_parameter: ClassVar[str] = ""
    height_candidates: ClassVar[tuple[Candidate, ...]] = ()
    side_candidates: ClassVar[tuple[Candidate, ...]] = ()
    parameters: Parameters | None = None
    program: AutopilotProgram | None = None

    # Construction from a scenario or a log.

    @classmethod
    def load(cls, table: FlightTable, aircraft: Aircraft, scenario: str) -> Self:
        """Return the autopilot of a scenario's [flight] table.

        scenario: name of the scenario in messages.

        Raises ScenarioError if the autopilot does not accept an entry, and ParameterError if the parameter file is
        invalid.
        """
        if table.params is not None:
            allowed = f'not a key of autopilot = "{cls.name}", which has no parameters'
            raise ScenarioError.at(scenario, "flight.params", table.params, allowed)
        return cls()

    @classmethod
    def restore(cls, stored: StoredAutopilot) -> Self:
        """Return the autopilot that a log stores.

        Raises ParameterError if a value is not allowed.
        """
        return cls()

    def store(self) -> StoredAutopilot:
        """Return the settings of the autopilot as a log stores them, for `restore`."""
        return StoredAutopilot()

    @classmethod
    def of_flight_log(
        cls, program: str, parameters: Mapping[str, float], source: str
    ) -> tuple[Self, tuple[str, ...]] | None:
        """Return the autopilot that wrote a log, and notes on its parameters; None for another autopilot's log.

        program: name of the flown program in the log.
        parameters: values by name.
        source: the log's file.

        The notes name the parameters that could not be used.
        """
        return None

    @classmethod
    def recognises(cls, program: Path) -> bool:
        """Return True if the program of --sitl is this autopilot; False for a simulated autopilot."""
        return False

    @classmethod
    def missing_files(cls, aircraft: Aircraft) -> list[str]:
        """Return a sentence for each file that the autopilot requires and that an aircraft's folder lacks.

        Raises PlanflyError if a file is invalid.
        """
        return []

    # Flight.

    @property
    def law(self) -> "Autopilot":
        """The autopilot itself; for a program, the simulated autopilot that models it."""
        return self

    @property
    @abstractmethod
    def tick(self) -> Tick:
        """Compiled function for one tick of the autopilot's control law."""

    @property
    def loop(self) -> Loop | None:
        """Compiled simulation loop of the control law and the aircraft model; None if only JSBSim flies it."""
        return None

    def initialise_records(self, guidance: Record, record: Record) -> None:
        """Initialise the records of the control law before the first tick.

        guidance: a `flight.guidance.inner_loops.GUIDANCE_MEMORY` record.
        record: a record of the type `own`, or None if that type is None.
        """
        return

    def from_ground(
        self, ground_phases: GroundPhases, aircraft: Aircraft, contacts: Sequence[Contact]
    ) -> "GroundAutopilot":
        """Return the autopilot that also flies a take-off and a landing; only for an autopilot that `flies_ground`.

        contacts: contact points of the aircraft.
        """
        raise ValueError(f"{self.title} flies neither take-off nor landing")

    def transfer_state(self, previous_record: Record, record: Record, start: Floats) -> None:
        """Start another route at the aircraft's position, and keep the state of the control law.

        previous_record: record of the autopilot on the previous route.
        record: record for the new route, after `initialise_records`.
        start: (3,) start of the route, m.
        """
        return

    # Properties for planning, missions and verdicts.

    def described(self, aircraft: str) -> str:
        """Return a description of the autopilot with the settings that matter most in a flight."""
        return self.title

    @property
    def version(self) -> str:
        """Release of the program or of the simulated autopilot; "" for planfly's own guidance."""
        return ""

    @property
    def acceptance_radius(self) -> float | None:
        """Default distance from a waypoint at which the autopilot turns to the next leg, m.

        None for an autopilot that follows the fly-by path.  Any other autopilot flies from leg to leg, and has reached
        a waypoint also if it passes the line across the leg there.
        """
        return None

    @property
    def reads_acceptance(self) -> bool:
        """True if the acceptance radius in a waypoint's item decides where the autopilot turns to the next leg."""
        return True

    @property
    def follows_path(self) -> bool:
        """True if the autopilot follows the fly-by path, and does not turn by an acceptance radius."""
        return self.acceptance_radius is None

    def settings_not_flown(self, mission: MissionParts) -> list[str]:
        """Describe the settings that change the flight path but are not simulated, in sentences without full stop."""
        return []

    @property
    def follows_ground(self) -> bool:
        """True if the autopilot follows the ground along a leg to a height above terrain."""
        return True

    @property
    def keeps_to_arcs(self) -> bool:
        """True if the radius of a turn follows from its distance to the waypoint."""
        return True

    def turn_distance(self, turn: float, amsl: float) -> float:
        """Return the maximum distance before a waypoint at which the autopilot turns to the next leg, m.

        The distance is 0 for an autopilot that follows the fly-by path.

        turn: turn at the waypoint, rad, positive; pi at the mission's end.
        amsl: altitude of the waypoint, m.
        """
        return 0.0

    def airspeed_factor(self, amsl: float) -> float:
        """Return the ratio of flown true airspeed to commanded airspeed, at an altitude (m AMSL)."""
        return 1.0

    def landing_glide(self, height: float, run: float, tail_wind: float, amsl: float) -> LandingGlide:
        """Return the glide from the last waypoint before the landing point: straight and without a flare.

        height: height of that waypoint above the landing point, m, positive.
        run: horizontal distance of that waypoint before the landing point, m, positive.
        tail_wind: m/s, negative for a head wind.
        amsl: altitude of the landing point, m.

        >>> from flight.autopilots.planfly.autopilot import PlanflyGuidance
        >>> PlanflyGuidance().landing_glide(50.0, 1000.0, 0.0, 0.0)
        LandingGlide(slope=0.05, flare_height=0.0, flare_distance=0.0)
        """
        return LandingGlide(height / run)

    def landing_airspeed(self, cruise: float, tail_wind: float, amsl: float) -> float:
        """Return the true airspeed on the glide to a landing point, m/s; by default the cruise airspeed.

        cruise: m/s.
        tail_wind: m/s, negative for a head wind.
        amsl: altitude of the landing point, m.
        """
        return cruise

    def with_scenario_rtl_settings(
        self, rtl_altitude: float | None, rtl_autoland: int | None, *, lands: bool, lower: float = 0.0
    ) -> "Autopilot":
        """Return the autopilot with a scenario's RTL settings; an autopilot without such parameters is unchanged.

        rtl_altitude: height above home, m; None leaves the setting unchanged.
        rtl_autoland: ArduPlane's parameter; None leaves the setting unchanged.
        lands: True if the scenario's missions end with a landing sequence.
        lower: depth of the landing field below home, m.
        """
        return self

    def go_around_height(self, stated_height: float, takeoff_height: float) -> float | None:
        """Return the height above home to which the autopilot climbs in a go-around, m, or None if unknown.

        stated_height: height that the landing item states, m; 0 if it states none.
        takeoff_height: height above home of the mission's take-off item, m; 0 without a take-off.
        """
        return None

    @property
    def launch_trigger(self) -> tuple[float, str] | None:
        """Minimum launch acceleration that starts the motor, m/s^2, and its parameter; None without a minimum."""
        return None

    @property
    def speed_limits(self) -> SpeedLimits | None:
        """Limits of the airspeeds that the autopilot accepts from a mission; None without limits."""
        return None

    @property
    def min_ground_speed(self) -> float:
        """Minimum ground speed until the mission sets another one, m/s; 0 for none.

        The autopilot raises its airspeed to keep this ground speed.
        """
        return 0.0

    def speeds_flown(self, commanded: Floats, cruise: float) -> Floats:
        """Return the airspeed that the autopilot flies on each leg, (l,) m/s.

        commanded: (l,) m/s.
        cruise: airspeed until the autopilot accepts the first command, m/s.
        """
        return commanded

    @property
    def return_rules(self) -> ReturnRules:
        """Rules of an RTL: target, altitude, turn and loiter."""
        return USUAL_RULES

    @property
    def loiter_rules(self) -> LoiterRules:
        """Rules of loiters: default radius, entry and exit."""
        return USUAL_LOITERS

    @property
    def route_rules(self) -> RouteRules:
        """Rules by which the autopilot flies the route of a mission."""
        turn_distance = None if self.follows_path else self.turn_distance
        limit = self.acceptance_limit
        return RouteRules(self.return_rules, self.loiter_rules, self.reads_as_px4, turn_distance, limit)

    @property
    def parameter_notes(self) -> tuple[str, ...]:
        """Notes on its parameter file, for the verdict."""
        return ()

    @property
    def battery_failsafes(self) -> tuple[BatteryFailsafe, ...]:
        """Failsafes that leave the mission at a state of the battery."""
        return ()

    @property
    def resets_jump_counters(self) -> bool:
        """True if an exhausted counter of a jump is reset, so that a later pass takes the jump again."""
        return False

    @property
    def mission_checks(self) -> MissionChecks:
        """Settings of PX4's feasibility checks; PX4's defaults for another autopilot."""
        return MissionChecks()

    @property
    def stated_airspeed(self) -> tuple[float, str] | None:
        """Cruise airspeed in the user's parameter file, m/s, and its parameter; None if not stated."""
        file_values = {} if self.parameters is None else self.parameters.by_origin("file")
        return (
            (file_values[self.cruise_parameter], self.cruise_parameter)
            if self.cruise_parameter in file_values
            else None
        )

    @property
    def stated_bank(self) -> float | None:
        """Bank limit in the user's parameter file, rad, or None if not stated."""
        return None

    @property
    def bank_limit(self) -> float:
        """Maximum bank that the autopilot demands, rad; inf if only the aircraft's limits apply."""
        return math.inf

    def tracking_error(
        self, airspeed: float, nav: Navigation, *, fly_over: bool = False, turbulence: Turbulence = "none"
    ) -> TrackingError | None:
        """Return the deviations from the legs, for which a plan reserves margins; None for an exact autopilot.

        airspeed: commanded airspeed, m/s.
        nav: accuracy of navigation.
        fly_over: True if the autopilot flies over each waypoint before it turns.
        turbulence: turbulence of the wind.
        """
        return None

    def altitude_miss_probability(self, climb_reserve: float, sink_reserve: float, turbulence: Turbulence) -> float:
        """Return the probability that gusts make the autopilot circle at a waypoint; 0 if it flies on.

        climb_reserve, sink_reserve: unused climb and sink rates, m/s.
        """
        return 0.0

    def gust_sink(self, climb_reserve: float, turbulence: Turbulence) -> float:
        """Return the altitude loss in a downdraft with an exceedance probability of 1 %, m.

        The result is 0 if the autopilot's tracking error includes this loss.

        climb_reserve: unused climb rate, m/s.
        """
        return 0.0

    def gust_rise(self, sink_reserve: float, turbulence: Turbulence) -> float:
        """Return the altitude gain in an updraft with an exceedance probability of 1 %, m.

        The result is 0 if the autopilot holds its altitude.

        sink_reserve: unused sink rate, m/s.
        """
        return 0.0

    def with_parameters(self, **values: float) -> "Autopilot":
        """Return a copy with other values for some parameters, by the autopilot's names and in its units."""
        raise ValueError(f"{self.title} has no parameters")


class GroundAutopilot(Autopilot):
    """An autopilot that takes off, or lands, or both."""

    @property
    @abstractmethod
    def released_throttle(self) -> float:
        """Throttle (0..1) at the end of the rail, at the hand launch, or at rest on the runway."""


def describe_program(program: AutopilotProgram, aircraft: str, named: int = 8) -> str:
    """Return a description of a program; the verdict's data contains every parameter.

    named: maximum number of changed parameters in the description.
    """
    changed = [f"{name} {value:g}" for name, value in program.changed.items()]
    remainder = f", +{len(changed) - named} more" if len(changed) > named else ""
    return (
        f"{program.version} (sha256 {program.sha256[:8]}...), {len(program.parameters)} parameters set for"
        f" {Path(aircraft).name}, changed: {', '.join(changed[:named]) or 'none'}{remainder}"
    )
