"""Define the parts of which an autopilot is composed.

The defaults of a part describe an autopilot without that part.

An autopilot returns its parts from the properties of `flight.autopilots.autopilot.Autopilot`. A part contains values
and functions; an autopilot states only the fields that differ from the defaults: `TurnRules(acceptance_radius=90.0)`.

`flight.mission` defines two further parts, because they also lay out the route: `ReturnRules` and `LoiterRules`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple, Protocol

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.contacts import Contact
from aircraft.tracking import TrackingError
from flight.dynamics.instructions import Code
from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.mission.ground_phases import GroundPhases
from flight.mission.return_path import DEFAULT_RETURN_RULES, LandingStart, ReturnRules, ReturnTarget
from world.arrays import Floats, Heights
from world.kernels import Record, Records
from world.scenario_tables import LinkUse, Navigation
from world.wind import Turbulence

if TYPE_CHECKING:
    from flight.autopilots.point_mass import PointMass
    from flight.autopilots.simulated_returns import ReturnEnvironment, SimulatedReturns

# ----------------------------------------------------------------------
# Control law.

# One tick of the compiled loop on the block of a `flight.simulation.tick.Workspace`; returns a key of `ENDS` if the
# flight ends, otherwise 0.
Tick = Callable[[Floats, Heights], int]

# A number of ticks, each followed by the steps of a compiled model. The arguments are block, heights, frames, numbers,
# code, contacts and frictions of a `flight.dynamics.compiled_model.CompiledModel`, and the number of ticks; returns the
# status of the last tick.
Loop = Callable[[Floats, Heights, Records, Floats, Code, Records, Records, int], int]


@dataclass(frozen=True)
class ControlLaw:
    """Compiled control law of an autopilot.

    tick: compiled function for one tick.
    loop: compiled simulation loop of the control law and the aircraft model; None if the autopilot flies only in
        JSBSim.
    memory: type of the law's own record, in addition to `flight.guidance.inner_loops.GUIDANCE_MEMORY`, or None.
    initialise: initialises the records before the first tick; the arguments are a `GUIDANCE_MEMORY` record and a record
        of the type ``memory``, or None.
    transfer_state: copies the state of the control law when the flight changes to another route. The arguments are the
        record on the previous route, the record for the new route after ``initialise``, and the start (3,) of the new
        route, m.
    throttle_at_release: throttle (0..1) at the end of the rail, at the hand launch, or at rest on the runway, of a law
        that takes off.
    """

    tick: Tick
    loop: Loop | None = None
    memory: np.dtype[np.record] | None = None
    initialise: Callable[[Record, Record], None] = lambda guidance, record: None
    transfer_state: Callable[[Record, Record, Floats], None] = lambda previous_record, record, start: None
    throttle_at_release: float = 0.0


# ----------------------------------------------------------------------
# Turns and speeds.


@dataclass(frozen=True)
class TurnRules:
    """Rules by which an autopilot turns to the next leg; by default it follows the fly-by path.

    acceptance_radius: default distance from a waypoint at which the autopilot turns to the next leg, m; None for an
        autopilot that follows the fly-by path. An autopilot with a radius also turns when it passes the line through
        the waypoint perpendicular to the leg.
    distance: returns the maximum distance before a waypoint at which the autopilot turns, m; the arguments are the turn
        at the waypoint, rad, positive (pi at the mission's end), and its altitude, m AMSL.
    radii_at: returns the acceptance radii at ground speeds (n,), m/s, as (n,) m; None if the radius does not depend on
        the ground speed.
    reads_acceptance: True if the acceptance radius in a waypoint's item decides where the autopilot turns.
    acceptance_limit: maximum acceptance radius that the autopilot reads from an item, m.
    acceptance_parameter: parameter of the default acceptance radius; "" without such a parameter.
    keeps_to_arcs: True if the autopilot flies each turn as an arc whose radius follows from the turn distance.
    max_bank: maximum bank that the autopilot demands, rad; inf if only the aircraft's limits apply.
    bank_parameter: parameter of that bank; "" without such a parameter.
    """

    acceptance_radius: float | None = None
    distance: Callable[[float, float], float] = lambda turn, amsl: 0.0
    radii_at: Callable[[Floats], Floats] | None = None
    reads_acceptance: bool = True
    acceptance_limit: float = math.inf
    acceptance_parameter: str = ""
    keeps_to_arcs: bool = True
    max_bank: float = math.inf
    bank_parameter: str = ""

    @property
    def follows_path(self) -> bool:
        """True if the autopilot follows the fly-by path instead of turning at an acceptance radius."""
        return self.acceptance_radius is None


class SpeedLimits(NamedTuple):
    """Airspeeds (m/s) that an autopilot accepts from a mission, and the parameters that set them.

    nearest: True if the autopilot flies the nearest limit on a command outside the limits; False if it ignores the
        command, and keeps its airspeed.
    """

    min: float
    max: float
    min_name: str
    max_name: str
    nearest: bool = False


class RateLimit(NamedTuple):
    """Largest climb or sink rate that an autopilot demands, m/s, and its parameter; "" for no parameter."""

    rate: float = math.inf
    name: str = ""

    @classmethod
    def from_parameters(cls, **values: float) -> "RateLimit":
        """Return the rate limit that the smallest of several parameters sets, m/s; 0 means no limit.

        >>> RateLimit.from_parameters(FW_T_CLMB_R_SP=3.0, FW_T_CLMB_MAX=5.0)
        RateLimit(rate=3.0, name='FW_T_CLMB_R_SP 3 m/s')
        """
        name = min(values, key=lambda parameter_name: values[parameter_name] or math.inf)
        return cls(values[name], f"{name} {values[name]:g} m/s") if values[name] else cls()


# Limit of an autopilot that limits no rate.
_NO_RATE_LIMIT = RateLimit()


@dataclass(frozen=True)
class SpeedRules:
    """Rules by which an autopilot flies commanded airspeeds.

    By default commanded airspeeds are true airspeeds without limits.

    limits: limits of the airspeeds that the autopilot accepts from a mission, or None.
    equivalent: True if commanded airspeeds are equivalent airspeeds, which at altitude are lower than true airspeeds.
    min_ground_speed: minimum ground speed until the mission sets another one, m/s; 0 for none. The autopilot raises
        its airspeed to keep this ground speed.
    cruise_parameter: parameter of the cruise airspeed; "" without such a parameter.
    max_throttle: upper limit of the throttle in flight, 0..1; 1 for full throttle.
    max_throttle_name: parameter of this limit with its value in the autopilot's unit; "" for full throttle.
    climb_limit, sink_limit: largest rates at which the autopilot changes its altitude.
    max_pitch: largest pitch that the autopilot demands, rad; inf without a limit.
    max_pitch_name: parameter of this limit with its value; "" without a limit.
    """

    limits: SpeedLimits | None = None
    equivalent: bool = False
    min_ground_speed: float = 0.0
    cruise_parameter: str = ""
    max_throttle: float = 1.0
    max_throttle_name: str = ""
    climb_limit: RateLimit = _NO_RATE_LIMIT
    sink_limit: RateLimit = _NO_RATE_LIMIT
    max_pitch: float = math.inf
    max_pitch_name: str = ""

    def true_airspeed_factor(self, amsl: float) -> float:
        """Return the ratio of true to commanded airspeed at an altitude (m AMSL)."""
        return float(eas_to_tas_ratio(amsl)) if self.equivalent else 1.0

    def flown_airspeeds(self, commanded: Floats, cruise: float) -> Floats:
        """Return the airspeed that the autopilot flies on each leg, m/s, (l,).

        commanded: airspeed commanded for each leg, true or equivalent like the result, m/s, (l,).
        cruise: airspeed until the autopilot accepts the first command, m/s.

        >>> ignoring = SpeedRules(SpeedLimits(9.0, 22.0, "MIN", "MAX"))
        >>> ignoring.flown_airspeeds(np.array([8.0, 15.0, 30.0, 10.0]), 12.0).tolist()
        [12.0, 15.0, 15.0, 10.0]
        >>> clipping = SpeedRules(SpeedLimits(9.0, 22.0, "MIN", "MAX", nearest=True))
        >>> clipping.flown_airspeeds(np.array([8.0, 15.0, 30.0, 10.0]), 12.0).tolist()
        [9.0, 15.0, 22.0, 10.0]
        """
        limits = self.limits
        if limits is None:
            return commanded
        if limits.nearest:
            return np.clip(commanded, limits.min, limits.max)
        flown_speeds = []
        current = cruise
        for command in commanded.tolist():
            current = command if limits.min <= command <= limits.max else current
            flown_speeds.append(current)
        return np.array(flown_speeds)


# ----------------------------------------------------------------------
# Return to launch.


class RtlSettings(NamedTuple):
    """A scenario's settings of the RTL.

    altitude: height above home, m; None if not stated.
    autoland: value of ArduPlane's RTL_AUTOLAND; None if not stated.
    lands: True if the scenario's missions end with a landing sequence.
    field_depth: altitude of home minus altitude of the landing field, m.
    """

    altitude: float | None = None
    autoland: int | None = None
    lands: bool = False
    field_depth: float = 0.0


# Reaction of an autopilot to a failure. "return": RTL; "land": the mission's landing sequence; "land here": a landing
# where the aircraft is; "autoland": mode AUTOLAND, or RTL without that mode; "on": continue the mission; "landed":
# none, because the aircraft is on the ground; "never": none, because nothing can trigger the cause; the other reactions
# do not lead home.
FailsafeAction = Literal[
    "return",
    "land",
    "land here",
    "autoland",
    "on",
    "circle",
    "glide",
    "parachute",
    "terminate",
    "disarm",
    "level",
    "guided",
    "landed",
    "never",
]


class LinkLossReaction(NamedTuple):
    """One reaction of an autopilot to the loss of a radio link in a mission.

    action: reaction of the autopilot; "on" if it continues the mission.
    delay: time from the loss of the link to the reaction, s; inf for "on".
    parameter, value: the parameter that decides the reaction, and its value.
    """

    action: FailsafeAction
    delay: float
    parameter: str
    value: float


class Cause(NamedTuple):
    """An event that can end the mission, and the autopilot's reaction.

    name: name of the event in messages.
    action: reaction.
    parameter, value: the parameter that decides the reaction, and its value; "" if no parameter decides.
    """

    name: str
    action: FailsafeAction
    parameter: str = ""
    value: int = 0

    @property
    def is_return(self) -> bool:
        """True if the reaction is an RTL; a landing is not an RTL."""
        return self.action == "return"


class ReturnMission(NamedTuple):
    """Properties of a mission on which its RTLs depend.

    commands: commands of its items.
    has_fence: True if the mission carries a fence.
    rally_distance: distance of the nearest rally point from home, m; infinite without one.
    landings: its landing sequences.
    """

    commands: frozenset[int] = frozenset()
    has_fence: bool = False
    rally_distance: float = math.inf
    landings: tuple[LandingStart, ...] = ()


class FlyReturns(Protocol):
    """Function that simulates an autopilot's RTLs with a point mass."""

    def __call__(
        self,
        starts: Records,
        targets: Sequence[ReturnTarget],
        aircraft: "PointMass",
        environment: "ReturnEnvironment",
        *,
        store_positions: bool = False,
        abort_limits: tuple[Floats, Floats] | None = None,
        engine_out: bool = False,
    ) -> "SimulatedReturns":
        """Simulate the RTL from each of n starts to its target.

        starts: (n,) of `flight.autopilots.simulated_returns.RETURN_START`.
        store_positions: True to store the positions.
        abort_limits: heights above ground, (n,), and distances outside spheres, (n,), m, below which an RTL is aborted.
        engine_out: True after an engine failure, for an autopilot whose `ReturnBehaviour.flies_without_engine` is True.
        """


class ReturnTrials(NamedTuple):
    """Changes of parameters that may make an autopilot's RTLs safe, in the order in which they are tried.

    altitudes: groups of parameters of the RTL's height, with their present values, m. A trial sets all parameters of a
        group to the same height, but lowers none. The tried heights begin at the present value of the first parameter.
    others: other changes, as values by name; each is tried alone and together with a greater height.
    endings: changes with which RTLs do not fly straight to a landing sequence, so that the RTL's height has an effect.
    text: names of all these parameters, in messages.
    """

    altitudes: tuple[Mapping[str, float], ...] = ()
    others: tuple[Mapping[str, float], ...] = ()
    text: str = ""
    endings: tuple[Mapping[str, float], ...] = ()


NO_TRIALS = ReturnTrials()


@dataclass(frozen=True)
class ReturnBehaviour:
    """Behaviour of an autopilot in an RTL.

    The defaults are ArduPlane's behaviour with its default parameters.

    rules: rules of the RTL's target, altitude, turn and loiter.
    make_parameters: returns the autopilot's parameters, by name and in its units, for a scenario's settings of the RTL.
    after_link_loss: returns the reactions to the loss of a radio link, in order of time. If the mission continues, it
        is the reaction "on" alone, or () for an autopilot without parameters.
    fly: simulates RTLs; None for an autopilot without an RTL, for which ArduPlane's RTLs are simulated.
    flies_without_engine: True if ``fly`` also simulates RTLs after an engine failure.
    causes: returns the events that can end a mission, with the autopilot's reaction to each.
    unsimulated_text: returns the reason why no RTL of a mission is simulated; "" if RTLs are simulated.
    unsimulated_part_texts: returns the parts of RTLs that are not simulated, although the rest of them is.
    path_text: sentence on the path of an RTL; "" if there is nothing to say.
    trials: changes of parameters that may make RTLs safe.
    """

    rules: ReturnRules = DEFAULT_RETURN_RULES
    make_parameters: Callable[[RtlSettings], Mapping[str, float]] = lambda settings: {}
    after_link_loss: Callable[[LinkUse], tuple[LinkLossReaction, ...]] = lambda use: ()
    fly: FlyReturns | None = None
    flies_without_engine: bool = False
    causes: Callable[[ReturnMission], tuple[Cause, ...]] = lambda mission: ()
    unsimulated_text: Callable[[ReturnMission], str] = lambda mission: ""
    unsimulated_part_texts: Callable[[ReturnMission], tuple[str, ...]] = lambda mission: ()
    path_text: str = ""
    trials: ReturnTrials = NO_TRIALS


# ----------------------------------------------------------------------
# Take-off, landing and go-around.


class LandingGlide(NamedTuple):
    """Glide to a landing point: a straight line to the start of the flare, then the flare.

    slope: m of altitude per m of distance.
    flare_height: height of the start of the flare above the landing point, m; 0 if unknown.
    flare_distance: distance of the start of the flare before the landing point, m.
    """

    slope: float
    flare_height: float = 0.0
    flare_distance: float = 0.0


def straight_glide(height: float, run: float, tail_wind: float, amsl: float) -> LandingGlide:
    """Return a straight glide without a flare to the landing point.

    height: height of the last waypoint above the landing point, m.
    run: horizontal distance of the last waypoint from the landing point, m.
    tail_wind, amsl: unused; see `GroundRules.glide`.

    >>> straight_glide(50.0, 1000.0, 0.0, 0.0)
    LandingGlide(slope=0.05, flare_height=0.0, flare_distance=0.0)
    """
    return LandingGlide(height / run)


@dataclass(frozen=True)
class GroundRules:
    """Rules of take-off, landing and go-around.

    By default the autopilot flies neither a take-off nor a landing.

    control_law: returns the control law that also flies a take-off and a landing; None for an autopilot that flies
        neither. The arguments are the take-off and landing, the aircraft, and its contact points.
    needs_both_ends: True if the autopilot flies a take-off or a landing only in a mission that has both.
    glide: returns the glide from the last waypoint before the landing point. The arguments are height (m, positive)
        and horizontal distance (m, positive) of that waypoint from the landing point, the tail wind (m/s, negative for
        a head wind), and the altitude of the landing point (m AMSL).
    airspeed: returns the true airspeed on that glide, m/s; the arguments are the cruise airspeed, m/s, the tail wind,
        and the altitude of the landing point.
    go_around_height: returns the height above home to which the autopilot climbs in a go-around, m, or None if unknown.
        The arguments are the height that the landing item states, m (0 if it states none), and the height above home of
        the take-off item, m (0 without a take-off).
    launch_trigger: minimum launch acceleration that starts the motor, m/s^2, and its parameter; None without a minimum.
    """

    control_law: Callable[[GroundPhases, Aircraft, Sequence[Contact]], ControlLaw] | None = None
    needs_both_ends: bool = False
    glide: Callable[[float, float, float, float], LandingGlide] = straight_glide
    airspeed: Callable[[float, float, float], float] = lambda cruise, tail_wind, amsl: cruise
    go_around_height: Callable[[float, float], float | None] = lambda stated_height, takeoff_height: None
    launch_trigger: tuple[float, str] | None = None


# ----------------------------------------------------------------------
# Checks of missions and settings.


class FeasibilityLimits(NamedTuple):
    """Settings of PX4's feasibility checks; the defaults are PX4's defaults for fixed wings.

    landing_angle: FW_LND_ANG, rad.
    requires: MIS_TKO_LAND_REQ: 0 nothing, 1 a takeoff, 2 a landing, 3 both, 4 and 5 both or neither.
    stated: True if the user's file decides ``requires``.
    """

    landing_angle: float = math.radians(5.0)
    requires: int = 2
    stated: bool = False


class BatteryFailsafe(NamedTuple):
    """A failsafe that ends the mission at a threshold of the battery's charge or voltage.

    parameter: name of the parameter that states the threshold.
    threshold: value of this parameter: remaining charge, mAh, or voltage, V, or remaining fraction.
    used_charge: used charge at which the autopilot leaves the mission, mAh; NaN for a threshold of the voltage.
    shares_charge: True if several batteries are monitored: the share of this battery in the used charge is unknown.
    remaining_fraction: remaining fraction of the energy, estimated from the voltage, at which the autopilot leaves the
        mission; NaN for a threshold of the charge or of the voltage itself.
    capacity_parameter: name of the parameter that states the battery's capacity; "" for a threshold of the voltage.
    capacity: value of this parameter, mAh.
    """

    parameter: str
    threshold: float
    used_charge: float = math.nan
    shares_charge: bool = False
    remaining_fraction: float = math.nan
    capacity_parameter: str = ""
    capacity: float = math.nan


class ReturnTimeFailsafe(NamedTuple):
    """A failsafe that starts an RTL once the battery is estimated to last hardly longer than the RTL.

    parameter: name and value of the parameter that enables it.
    remedy: text on the parameter value that switches the failsafe off.
    capacity: capacity of the battery, mAh.
    initial_current: first value of the autopilot's running average of the current in level flight, A.
    time_factor, time_margin: the failsafe acts when the battery lasts no longer than the estimated time of the return,
        multiplied by the factor, plus the margin (s).
    airspeed, climb_rate, sink_rate: speeds of the return, m/s.
    altitude: transit altitude of the return above its destination, m.
    delay: time that the return waits before it lands, s.
    follows_mission: True if a return may follow the whole mission.
    """

    parameter: str
    remedy: str
    capacity: float
    initial_current: float
    time_factor: float
    time_margin: float
    airspeed: float
    climb_rate: float
    sink_rate: float
    altitude: float
    delay: float
    follows_mission: bool


class MissionParts(NamedTuple):
    """Properties of a mission that decide which settings of an autopilot affect the flight.

    returns: True if the mission returns to launch.
    has_return_path: True if the mission marks a return path (DO_RETURN_PATH_START).
    takes_off, lands: True if the take-off or the landing is flown from or to the ground.
    loiters_to_land: True if the last item before a landing is a loiter.
    has_fence: True if the mission carries a fence.
    fence_at_home: description of the mission's fence that home violates; "" for none.
    smallest_inclusion: radius of the fence's smallest inclusion circle, m; infinite without one.
    rally_distance: distance of the nearest rally point from home, m; infinite without one, NaN without a home.
    enables_fence: True if the mission switches the fence on (DO_FENCE_ENABLE).
    throttled_airspeeds: airspeeds that the mission commands together with a throttle, m/s.
    follows_terrain: True if the mission has a position above terrain.
    moves_payload: True if the mission commands a gripper, a winch or a gimbal, after which PX4 may wait.
    wind: highest mean wind speed on the route, m/s.
    full_voltage: voltage of the aircraft's full battery, V; infinite if it is not known.
    commands: commands of the mission's items.
    aircraft: the aircraft; None if it is not known here.
    """

    returns: bool = False
    has_return_path: bool = False
    takes_off: bool = False
    lands: bool = False
    loiters_to_land: bool = False
    has_fence: bool = False
    fence_at_home: str = ""
    smallest_inclusion: float = math.inf
    rally_distance: float = math.inf
    enables_fence: bool = False
    throttled_airspeeds: tuple[float, ...] = ()
    follows_terrain: bool = False
    moves_payload: bool = False
    wind: float = 0.0
    full_voltage: float = math.inf
    commands: frozenset[int] = frozenset()
    aircraft: Aircraft | None = None


PX4_DEFAULT_LIMITS = FeasibilityLimits()

# Autopilot whose rules of reading and refusing mission items apply; "planfly" reads items as ArduPlane does, and
# refuses none.
MissionDialect = Literal["planfly", "ardupilot", "px4"]


# No lambda, because an autopilot keeps its `checks`, and is pickled for the processes of a campaign.
def _no_unsimulated_settings(mission: MissionParts) -> list[str]:
    """Return no sentence, because all settings are simulated."""
    return []


@dataclass(frozen=True)
class MissionChecks:
    """Rules by which an autopilot reads and checks missions; by default nothing is refused.

    dialect: "ardupilot" refuses missions with a command that ArduPlane refuses. "px4" refuses missions that fail PX4's
        feasibility checks. Of a change of speed PX4 reads only the value, and returns to its own airspeed for a value
        that is not positive; it also reads gates.
    feasibility: settings of PX4's feasibility checks; PX4's defaults for another autopilot.
    resets_jump_counters: True if the autopilot resets a jump's counter when it is exhausted: a later pass over the jump
        item jumps again.
    follows_terrain: True if the autopilot follows the ground along a leg to a height above terrain.
    any_inclusion_suffices: True if a position inside any inclusion of the mission's fence is inside the fence; False if
        a position must be inside all of them.
    battery_failsafes: failsafes that leave the mission at a state of the battery.
    return_time_failsafe: failsafe that returns when the battery lasts only for the return; None without it.
    describe_unsimulated_settings: function that returns a sentence, without a full stop, for each setting that changes
        the flight path of a mission but is not simulated.
    parameter_notes: notes on the parameter file, for the verdict.
    """

    dialect: MissionDialect = "planfly"
    feasibility: FeasibilityLimits = PX4_DEFAULT_LIMITS
    resets_jump_counters: bool = False
    follows_terrain: bool = True
    any_inclusion_suffices: bool = False
    battery_failsafes: tuple[BatteryFailsafe, ...] = ()
    return_time_failsafe: ReturnTimeFailsafe | None = None
    describe_unsimulated_settings: Callable[[MissionParts], list[str]] = _no_unsimulated_settings
    parameter_notes: tuple[str, ...] = ()


# ----------------------------------------------------------------------
# Deviations from the plan.


class Candidate(NamedTuple):
    """A parameter that may cause a flight to fail.

    name: the autopilot's name for the parameter.
    step: increment of the autopilot's parameter reference, or a few increments.
    far: value to try that is furthest from the present value, within the range of the reference.
    unit: unit of step and value.
    least: minimum value that may be suggested; the steps start there if the present value is lower.
    others: names of parameters with the same present value that are changed together with it.
    """

    name: str
    step: float
    far: float
    unit: str
    least: float = -math.inf
    others: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Names of all parameters that are changed."""
        return " and ".join((self.name, *self.others))


class TrackingErrorFunction(Protocol):
    """Function that returns an autopilot's deviations from the legs; a plan reserves margins for them."""

    def __call__(
        self, airspeed: float, nav: Navigation, *, fly_over: bool = False, turbulence: Turbulence = "none"
    ) -> TrackingError | None:
        """Return the deviations; None for an exact autopilot.

        airspeed: commanded airspeed, m/s.
        nav: accuracy of navigation.
        fly_over: True if the autopilot flies over each waypoint before it turns.
        turbulence: turbulence of the wind.
        """


def _no_tracking_error(
    airspeed: float, nav: Navigation, *, fly_over: bool = False, turbulence: Turbulence = "none"
) -> TrackingError | None:
    """Return None, because the autopilot follows its path exactly."""
    return None


def _no_displacement(reserve: float, turbulence: Turbulence) -> float:
    """Return a displacement of 0 m, because the autopilot holds its altitude in gusts."""
    return 0.0


@dataclass(frozen=True)
class Deviations:
    """Deviations of an autopilot from the plan; by default it is exact and holds its altitude in gusts.

    tracking_error: returns the deviations from the legs.
    gust_sink: returns the altitude loss in a downdraft with an exceedance probability of 1 %, m; 0 if the tracking
        error includes it. The arguments are the unused climb rate, m/s, and the turbulence.
    gust_rise: returns the altitude gain in an updraft with an exceedance probability of 1 %, m; 0 if the autopilot
        holds its altitude. The arguments are the unused sink rate, m/s, and the turbulence.
    altitude_miss_probability: returns the probability that gusts make the autopilot circle at a waypoint because of its
        altitude; 0 if it always flies on. The arguments are the unused climb and sink rates, m/s, and the turbulence.
    altitude_parameter: name of the parameter of the altitude tolerance, outside which the autopilot circles at a
        waypoint; "" if it always flies on.
    altitude_candidates, track_candidates: parameters that may cause an altitude or a track to fail.
    pitch_candidates: parameters that may cause an altitude to fail if the flight reached the limit of the pitch.
    """

    tracking_error: TrackingErrorFunction = _no_tracking_error
    gust_sink: Callable[[float, Turbulence], float] = _no_displacement
    gust_rise: Callable[[float, Turbulence], float] = _no_displacement
    altitude_miss_probability: Callable[[float, float, Turbulence], float] = (
        lambda climb_reserve, sink_reserve, turbulence: 0.0
    )
    altitude_parameter: str = ""
    altitude_candidates: tuple[Candidate, ...] = ()
    track_candidates: tuple[Candidate, ...] = ()
    pitch_candidates: tuple[Candidate, ...] = ()
