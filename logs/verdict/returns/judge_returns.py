"""Judge whether every return to launch (RTL) is safe: simulate the autopilot's RTL from each start.

If the RTL, or a battery failsafe, leads to a landing sequence of the mission, the path to the sequence is judged.

A return is simulated with a point mass (`flight.autopilots.parts.ReturnBehaviour.fly`), in the mean wind or, with a
forecast, in the wind at each place, height and time of its path.  Returns whose simulation could be wrong are flown
again in JSBSim if the caller provides a function for it.  The JSBSim result replaces the result of the point mass for
that return, and corrects similar returns if it is worse.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import groupby
from typing import Literal, NamedTuple, get_args

import numpy as np

from aircraft.catalog import Aircraft, find_logged_aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.parts import Cause, ReturnMission
from flight.autopilots.point_mass import PointMass, make_point_mass
from flight.autopilots.px4.parameters import FROM_ARDUPILOT, Px4Parameters
from flight.autopilots.simulated_returns import (
    RETURN_ARRIVED,
    RETURN_GROUND_IMPACT,
    RETURN_OFF_TERRAIN,
    RETURN_TIMEOUT,
    ReturnEnvironment,
    SimulatedReturns,
    make_return_environment,
)
from flight.mission.placing import landing_starts, return_points
from flight.mission.return_path import (
    LandingStart,
    ReturnPoint,
    ReturnTarget,
    choose_target,
    nearest_landing_sequence,
)
from flight.simulation.setup import FlightSetup
from logs.verdict.measures.path_moves import MOVE
from logs.verdict.measures.route_requirements import Airspace, judged_airspace
from logs.verdict.measures.zone_visits import path_zones
from logs.verdict.returns.return_starts import ReturnStarts
from logs.verdict.suggestions import home_height, home_height_text
from logs.verdict.tolerances import (
    CLEARANCE_TOLERANCE_M,
    ENERGY_RESERVE_FRACTION,
    HOME_ERROR_M,
    UNDECIDED_FRACTION,
)
from world.arrays import Flags, Floats
from world.errors import MissionError
from world.kernels import Record, Records
from world.scenario import Scenario

# Outcome of a simulated return to launch, the worst first:
# - "ground": it hits the ground; "threat": enters a missile's sphere; "zone": violates a zone; "lost": does not arrive;
# - "energy": uses more energy than available; "unknown": leaves the elevation data;
# - "power", "used": may use more energy than available, because the power is uncertain, or because the energy used
#   before is unknown;
# - "unsure": differs too much between the point mass and JSBSim; "low": goes below the required height above ground;
# - "safe": none of these.
Kind = Literal["ground", "threat", "zone", "lost", "energy", "unknown", "power", "used", "unsure", "low", "safe"]
KINDS: tuple[Kind, ...] = get_args(Kind)
# Outcomes that are not judged.
UNJUDGED: tuple[Kind, ...] = ("unknown", "power", "used", "unsure")
# Outcomes that are failures of the return.
UNSAFE = frozenset(KINDS[:5])

# End of a return: it stays in a loiter there; it goes on from the loiter to a landing sequence (RTL_AUTOLAND 1 of
# ArduPlane); or it flies straight to a landing sequence (RTL_AUTOLAND 2, and "land" as a battery failsafe action).
Ending = Literal["circle", "on to land", "straight to land"]

# Possible error of the point mass's minimum clearance, m.  The clearance differed by at most 7 m from 38 flights of
# ArduPlane.  In JSBSim (`benchmarks.return_differences`) it differed by at most 4.5 m from 254 flights of the simulated
# ArduPlane, and by at most 5.1 m from 555 flights of the simulated PX4.
POINT_MASS_ERROR_M = 10.0
# Possible error of the point mass's minimum distance from a kill sphere, m.  The distance differed by at most 32 m from
# 57 flights of the simulated ArduPlane in JSBSim, and by at most 18 m if it was below 100 m.  It differed by at most
# 35 m from 97 of 111 flights of the simulated PX4; the other 14 turned back to the other side.
POINT_MASS_POSITION_ERROR_M = 35.0
# Distance to a limit within which the difference between point mass and JSBSim matters, m.
_DECISIVE_MARGIN_M = 50.0
# Height lost in the turn of a return, m.  A return that begins in a take-off or a landing, below the required height
# above ground, has to keep the flight's own height minus this loss.
TURN_HEIGHT_LOSS_M = 2.0
# Fraction of its starting height that a return from a flown take-off or landing has to keep: it may be sinking.
_LOW_START_FRACTION = 0.5
# Minimum height above ground from which returns in a take-off or a landing are judged, m: no autopilot turns below it.
MIN_JUDGED_HEIGHT_M = 10.0
# Returns from a greater height in a take-off or a landing are omitted if they sink below `_LOW_START_FRACTION` of the
# starting height within this horizontal distance, m.
_SINK_DISTANCE_M = 500.0
# Largest bank of a start from which JSBSim can fly a return, rad, because its flight reaches the start on a straight.
_MAX_START_BANK_RAD = math.radians(10.0)


@dataclass(frozen=True, slots=True)
class SimulatedReturn:
    """One simulated return.

    time: flight time at the start, s.
    start: position of the start, m, (3,).
    target: destination, and the reason for its choice.
    kind: outcome.
    clearance: minimum height above ground, m; NaN if unknown.
    lowest_position: position of the minimum height above ground, m, (3,).
    sphere_distance: minimum distance outside a kill sphere, m; inf without spheres.
    threat: index of that sphere; -1 for none.
    zone: index in `Returns.airspace` of the violated zone; -1 for none.
    energy: energy used in the return, Wh.
    energy_left: energy left at the end of the return, Wh; NaN if unknown.
    time_to_loiter: time from the start to the return's loiter, s; NaN if the loiter is not reached.
    required_height: required height above ground, m; see `required_heights`.
    energy_used: energy used before the return, Wh; NaN if unknown.
    starts_too_low: True if the flight itself is lower than the required height at the start.
    violation: where and how deep the zone is violated; None without a violated zone.
    """

    time: float
    start: tuple[float, float, float]
    target: ReturnTarget
    kind: Kind
    clearance: float
    lowest_position: tuple[float, float, float]
    sphere_distance: float
    threat: int
    zone: int
    energy: float
    energy_left: float
    time_to_loiter: float
    required_height: float = math.nan
    energy_used: float = math.nan
    starts_too_low: bool = False
    violation: "ZoneViolation | None" = None

    @property
    def safe(self) -> bool:
        """True if the outcome of the return is "safe"."""
        return self.kind == "safe"


class ZoneViolation(NamedTuple):
    """Deepest violation of a zone by a return.

    zone: index of the zone in `Returns.airspace`.
    name: name of the zone.
    is_inclusion: True for a zone to stay in.
    depth: depth of the violation, m.
    position: position of the deepest violation, m east and m north.
    """

    zone: int
    name: str
    is_inclusion: bool
    depth: float
    position: tuple[float, float]


@dataclass(frozen=True, slots=True)
class ReturnRange:
    """Time range whose returns have the same destination and the same outcome.

    first, last: times of the first and the last start, s.
    count: number of returns.
    worst: the worst return.
    """

    first: float
    last: float
    count: int
    worst: SimulatedReturn


# Kind of the point of no return by energy: none ("never"); after some start ("later"); before the first start ("at
# once"); or unknown, because the battery is unknown, because the energy used is unknown, because the aircraft's power
# is too uncertain, because no return arrives, or because no return was simulated ("not flown").
NoReturnKind = Literal["never", "later", "at once", "battery", "used", "power", "arrives", "not flown"]


class PointOfNoReturn(NamedTuple):
    """Last start from which a return leaves the energy reserve.

    kind: kind of the point, or the reason why it is unknown.
    time: time of that start, s; NaN if there is no point of no return, or if it is unknown.
    remaining_energy: minimum energy left after the returns up to that start, Wh.
    skipped_count: number of earlier returns that do not arrive, so that their energy is unknown.
    """

    kind: NoReturnKind
    time: float = math.nan
    remaining_energy: float = math.nan
    skipped_count: int = 0


@dataclass(frozen=True, slots=True)
class Returns:
    """Returns from all starts on the path.

    each: the returns in order of time.
    interval: time between two starts, s.
    causes: events that can take the aircraft off its mission, and the action on each.
    limit: required minimum height above ground, m.
    airspace: the zones.
    reserve: energy that has to be left, Wh.
    flown: True if the returns begin on a flown track, False for the planned path.
    jsbsim_differences: for each return flown again in JSBSim, its clearance minus the clearance of the point mass, m.
    stands_in: True if ArduPlane's return is simulated because the autopilot has no return law.
    unjudged_parts: parts that are not judged, whatever the simulation shows: each a key of
        `logs.verdict.returns.returns_text.UNJUDGED_PART_TEXTS`, or a clause by the autopilot.
    autoland: RTL_AUTOLAND; None for returns of another autopilot.
    autoland_assumed: True if RTL_AUTOLAND is assumed, because ArduPlane does not arm with 0.
    autopilot: title of the autopilot whose return is simulated.
    path_text: the autopilot's sentence on the path of its returns; "" if there is nothing to say.
    trials_text: names of the autopilot's parameters that may make its returns safe.
    landings: the mission's landing sequences.
    omitted_count: number of further returns while the aircraft is on the ground, or so low in a take-off or a landing
        that it sinks to the ground before it can return.
    """

    each: tuple[SimulatedReturn, ...]
    interval: float
    causes: tuple[Cause, ...]
    limit: float
    airspace: Airspace
    reserve: float
    flown: bool
    jsbsim_differences: tuple[float, ...] = ()
    stands_in: bool = False
    unjudged_parts: tuple[str, ...] = ()
    autoland: int | None = None
    autoland_assumed: bool = False
    autopilot: str = ArduPlane.title
    path_text: str = ""
    trials_text: str = ""
    landings: tuple[LandingStart, ...] = ()
    omitted_count: int = 0

    @property
    def safe(self) -> bool:
        """True if there are returns, all are safe, and `unjudged_parts` is empty.

        A landing at the end of a return is not judged.
        """
        return bool(self.each) and not self.unjudged_parts and all(ret.safe for ret in self.each)

    @property
    def undecided(self) -> bool:
        """True if no return is known to be unsafe or too low, but something is not judged."""
        has_failures = bool(self.unsafe) or self.count("low") > 0
        return not has_failures and (bool(self.unjudged_parts) or any(self.count(kind) > 0 for kind in UNJUDGED))

    @property
    def lands(self) -> bool:
        """True if any return goes to a landing sequence."""
        return any(ret.target.landing is not None for ret in self.each)

    @property
    def unsafe(self) -> tuple[SimulatedReturn, ...]:
        """Returns whose outcome is in `UNSAFE`."""
        return tuple(ret for ret in self.each if ret.kind in UNSAFE)

    @property
    def too_low_start_count(self) -> int:
        """Number of returns that begin where the flight itself is lower than the required height."""
        return sum(ret.starts_too_low for ret in self.each)

    def count(self, kind: Kind) -> int:
        """Return the number of returns whose outcome is `kind`."""
        return sum(ret.kind == kind for ret in self.each)

    @property
    def point_of_no_return(self) -> PointOfNoReturn:
        """Last start from which an RTL leaves the energy reserve; RTLs that do not arrive are skipped."""
        last_time, min_energy_left, skipped_count = math.nan, math.inf, 0
        if not self.each:
            return PointOfNoReturn("not flown")
        if all(math.isnan(ret.energy_left) for ret in self.each):
            return PointOfNoReturn("used" if any(ret.kind == "used" for ret in self.each) else "battery")
        if any(ret.kind == "power" for ret in self.each) and not any(ret.kind == "energy" for ret in self.each):
            return PointOfNoReturn("power")
        for k, ret in enumerate(self.each):
            if k and ret.time <= self.each[k - 1].time:
                # The following returns begin at the first start again, with another ending.
                break
            if math.isnan(ret.energy_used):
                return PointOfNoReturn("used")
            if ret.kind == "ground" or math.isnan(ret.time_to_loiter) or math.isnan(ret.energy_left):
                # A return may reach its loiter and hit the ground on the way from there to the landing.
                skipped_count += 1
            elif ret.energy_left < self.reserve:
                return PointOfNoReturn(
                    "at once" if math.isnan(last_time) else "later", last_time, min_energy_left, skipped_count
                )
            else:
                last_time, min_energy_left = ret.time, min(min_energy_left, ret.energy_left)
        return PointOfNoReturn(
            "arrives" if math.isnan(last_time) else "never", math.nan, min_energy_left, skipped_count
        )

    @property
    def ranges(self) -> tuple[ReturnRange, ...]:
        """Time ranges of consecutive returns with the same destination and outcome, the worst first."""
        ranges = []
        for _, group in groupby(self.each, _grouping_key):
            returns = list(group)
            ranges.append(
                ReturnRange(returns[0].time, returns[-1].time, len(returns), min(returns, key=worst_first_key))
            )
        return tuple(
            sorted(ranges, key=lambda return_range: (*worst_first_key(return_range.worst), return_range.first))
        )


def _grouping_key(ret: SimulatedReturn) -> tuple[object, ...]:
    """Return the key by which returns are grouped: outcome, destination, and the entered sphere or zone.

    For returns that are too low, the key also contains `starts_too_low`.
    """
    key = (ret.kind, ret.target.name)
    if ret.kind == "low":
        return (*key, ret.starts_too_low)
    return (*key, ret.threat, ret.zone) if ret.kind in ("threat", "zone") else key


def worst_first_key(ret: SimulatedReturn) -> tuple[int, float]:
    """Return a sort key that puts the worst return first: by outcome, then by margin."""
    margin = ret.sphere_distance if ret.kind == "threat" else ret.energy_left if ret.kind == "energy" else ret.clearance
    return KINDS.index(ret.kind), math.inf if math.isnan(margin) else margin


@dataclass(frozen=True, slots=True, eq=False)
class ReturnWorld:
    """Setting in which returns to launch are simulated.

    It holds autopilot, destinations, aircraft, ground, spheres and zones.

    autopilot: simulated autopilot that returns; it has an RTL.
    home, rally: positions on the map.
    aircraft: point-mass model.
    environment: ground and spheres.
    stands_in: as in `Returns`.
    uses_other_autopilot: True if ArduPlane's return replaces the return of an autopilot with parameters of its own.
    landings: the mission's landing sequences.
    fly: simulates RTLs from starts to targets, as `flight.autopilots.parts.FlyReturns` with this aircraft and
        environment.
    """

    setup: FlightSetup
    autopilot: Autopilot
    home: ReturnPoint
    rally: tuple[ReturnPoint, ...]
    aircraft: PointMass
    environment: ReturnEnvironment
    airspace: Airspace
    stands_in: bool = False
    uses_other_autopilot: bool = False
    landings: tuple[LandingStart, ...] = ()
    fly: "partial[SimulatedReturns]" = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Bind the autopilot's simulation of RTLs to aircraft and environment."""
        fly = self.autopilot.returns.fly
        if fly is None:
            raise ValueError(f"{self.autopilot.title} has no RTL")
        object.__setattr__(self, "fly", partial(fly, aircraft=self.aircraft, environment=self.environment))

    @property
    def scenario(self) -> Scenario:
        """Scenario of the setup."""
        return self.setup.scenario

    @property
    def limit(self) -> float:
        """Required minimum height above ground, m."""
        return self.setup.limits.min_clearance

    @property
    def min_airspeed(self) -> float:
        """Equivalent airspeed of a glide, m/s: the lowest airspeed that the autopilot accepts."""
        limits = self.autopilot.speeds.limits
        return self.setup.airspeed if limits is None else limits.min

    @property
    def min_airspeed_name(self) -> str:
        """Parameter of `min_airspeed`; "" if no parameter states it."""
        limits = self.autopilot.speeds.limits
        return "" if limits is None else limits.min_name

    @property
    def is_energy_known(self) -> bool:
        """True if battery and power are known; otherwise energy is not judged."""
        return not unknown_energy_text(self.setup)

    @property
    def mission(self) -> ReturnMission:
        """Properties of the mission on which the returns depend."""
        distances = (math.hypot(point.east - self.home.east, point.north - self.home.north) for point in self.rally)
        mission = self.setup.mission
        return ReturnMission(
            frozenset(item.command for item in mission.items),
            bool(mission.fences),
            min(distances, default=math.inf),
            self.landings,
        )

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Events that can take the aircraft off its mission; empty for an autopilot without an RTL."""
        return () if self.uses_other_autopilot else self.autopilot.returns.causes(self.mission)

    @property
    def rtl_ending(self) -> Ending:
        """End of an RTL: a loiter, a loiter followed by a landing, or a direct landing."""
        ending_by_join: dict[str, Ending] = {"circle": "on to land", "straight": "straight to land"}
        return ending_by_join.get(self.autopilot.returns.rules.landing_join, "circle") if self.landings else "circle"

    @property
    def return_endings(self) -> tuple[Ending, ...]:
        """Ways in which returns end: `rtl_ending`, and a direct landing if an event can cause one."""
        has_landing = any(cause.action == "land" for cause in self.causes) and self.rtl_ending != "straight to land"
        return (self.rtl_ending, "straight to land") if has_landing else (self.rtl_ending,)

    @property
    def is_simulated(self) -> bool:
        """True if returns are simulated; False if the autopilot's RTL cannot be simulated for this mission."""
        return not self.autopilot.returns.unsimulated_text(self.mission)

    @property
    def unjudged_parts(self) -> tuple[str, ...]:
        """Parts of the returns that cannot be judged, as in `Returns`."""
        behaviour = self.autopilot.returns
        parts = []
        if unsimulated_text := behaviour.unsimulated_text(self.mission):
            parts.append(unsimulated_text)
        if self.uses_other_autopilot:
            parts.append("law")
        if any(cause.action == "autoland" for cause in self.causes):
            parts.append("autoland")
        parts += behaviour.unsimulated_part_texts(self.mission)
        begins_with_landing = any(landing.is_landing for landing in self.landings)
        if begins_with_landing and any(ending != "circle" for ending in self.return_endings):
            parts.append("landing")
        if self.setup.imported_log is None and home_height(self.setup) > HOME_ERROR_M:
            parts.append(
                f"{home_height_text(self.setup)}; after arming on that ground, every return is lower by this height"
            )
        return tuple(parts)

    def target(self, row: Record, ending: Ending | None = None) -> ReturnTarget:
        """Return the destination of an RTL.

        row: start of the RTL, with the fields `east`, `north` and `up`, m.
        ending: how the RTL ends; by default `rtl_ending`.
        """
        rules = self.autopilot.returns.rules
        position = (float(row["east"]), float(row["north"]), float(row["up"]))
        ending = ending or self.rtl_ending
        if ending == "straight to land" and (landing := nearest_landing_sequence(position, self.landings)) is not None:
            distance = math.dist(position[:2], landing.position[:2])
            name, reason = f"the landing sequence at item {landing.item}", self._choice_reason(landing)
            return ReturnTarget(landing.position, name, reason, distance, landing=landing, straight=True)
        target = choose_target(rules, position, self.home, self.rally, self.landings)
        return self.with_landing(target) if ending == "on to land" else target

    def with_landing(self, target: ReturnTarget) -> ReturnTarget:
        """Add to an RTL's target the landing sequence that follows the RTL's loiter.

        The target is returned unchanged if no landing follows.
        """
        landing = nearest_landing_sequence(target.position, self.landings) if self.rtl_ending == "on to land" else None
        if landing is None:
            return target
        reasons = [reason for reason in (target.reason, self._choice_reason(landing)) if reason]
        name = f"{target.name}, and on to the landing sequence at item {landing.item}"
        return target._replace(name=name, reason=", ".join(reasons), landing=landing)

    def _choice_reason(self, landing: LandingStart) -> str:
        """Explain why a landing sequence was chosen; return "" if the mission has only one."""
        if len(self.landings) == 1:
            return ""
        return f"item {landing.item} begins the nearest of {len(self.landings)} landing sequences"

    def with_parameters(self, **values: float) -> "ReturnWorld":
        """Return a copy with other parameters, by the autopilot's names and in its units."""
        return replace(self, autopilot=self.autopilot.with_parameters(**values))

    def with_rally(self, rally: Sequence[ReturnPoint]) -> "ReturnWorld":
        """Return a copy with other rally points."""
        return replace(self, rally=tuple(rally))


def unknown_energy_text(setup: FlightSetup) -> str:
    """Explain why the energy of simulated returns to launch is not judged; return "" if it is judged."""
    is_stated = setup.scenario.flight.battery_wh is not None
    if setup.imported_log is not None and not setup.imported_log.aircraft_known:
        return "the log names no aircraft, so energy is not judged"
    if setup.envelope.battery_guessed and not is_stated:
        return "the battery capacity is guessed, so energy is not judged; state battery_wh in the scenario"
    return "" if setup.envelope.power_level.size else "the aircraft's model states no power, so energy is not judged"


def rtl_autopilot_title(setup: FlightSetup) -> str:
    """Return the title of the autopilot whose RTL is simulated.

    It is the setup's autopilot, or ArduPlane if that has no RTL.
    """
    autopilot = setup.autopilot.model
    return ArduPlane.title if autopilot.returns.fly is None else autopilot.title


def make_return_world(setup: FlightSetup, rtl_autopilot: Autopilot | None = None) -> ReturnWorld:
    """Collect the data for simulating returns to launch from a setup's mission.

    rtl_autopilot: autopilot whose RTL is simulated; None for the setup's autopilot, or ArduPlane if that has no RTL.
    Raises MissionError for a mission without a home, and FlightError for an aircraft that cannot be loaded.
    """
    aircraft: Aircraft = find_logged_aircraft(setup.aircraft, setup.scenario.flight.aircraft)
    simulated_autopilot, uses_other_autopilot = rtl_autopilot or setup.autopilot.model, rtl_autopilot is not None
    if simulated_autopilot.returns.fly is None:
        simulated_autopilot, uses_other_autopilot = (
            ArduPlane(ArduPilotParameters.load(aircraft)),
            simulated_autopilot.parameters is not None,
        )
    return_positions = return_points(setup.mission, setup.scenario.origin, setup.scenario.terrain)
    if not return_positions:
        source = setup.mission.source
        message = f"{source}: home: missing, so no return can be simulated"
        raise MissionError(message, file=source, field="home")
    return ReturnWorld(
        setup,
        simulated_autopilot,
        return_positions[0],
        return_positions[1:],
        make_point_mass(aircraft, setup.envelope, setup.airspeed, setup.scenario.wind, setup.scenario.geo_map),
        make_return_environment(setup.scenario),
        judged_airspace(setup),
        stands_in=rtl_autopilot is not None or setup.autopilot.model.returns.fly is None,
        uses_other_autopilot=uses_other_autopilot,
        landings=landing_starts(setup.mission, setup.scenario.origin, setup.scenario.terrain),
    )


def engine_out_world(world: ReturnWorld) -> ReturnWorld:
    """Return the world for simulating returns to launch without thrust.

    It is the given world if its autopilot's RTL can be simulated without thrust.  Otherwise ArduPlane's RTL replaces
    it, with ArduPlane's parameters for the aircraft, and the airspeeds of the user's PX4 parameter file.
    """
    if world.autopilot.returns.flies_without_engine:
        return world
    aircraft = find_logged_aircraft(world.setup.aircraft, world.scenario.flight.aircraft)
    # ArduPlane's parameters, with the airspeeds of the user's PX4 parameter file.
    own_parameters = ArduPilotParameters.load(aircraft)
    user_parameters = world.autopilot.parameters
    parameters = own_parameters
    if isinstance(user_parameters, Px4Parameters):
        file_parameters = user_parameters.by_origin("file")
        names = {name: FROM_ARDUPILOT[name][0] for name in ("AIRSPEED_MIN", "AIRSPEED_CRUISE", "AIRSPEED_MAX")}
        parameters = own_parameters.changed(
            **{name: file_parameters[px4_name] for name, px4_name in names.items() if px4_name in file_parameters}
        )
    return make_return_world(world.setup, ArduPlane(parameters))


# Function that flies a return in JSBSim and returns the minimum height above ground and the minimum distance outside a
# kill sphere, m; None if the return cannot be flown.
FlyAgain = Callable[[ReturnWorld, Record], tuple[float, float] | None]
# Maximum number of returns that are flown again in JSBSim; each takes about 0.2 s.
MAX_JSBSIM_FLIGHTS = 100


def judge_returns(
    world: ReturnWorld,
    starts: ReturnStarts,
    interval: float,
    fly_again: FlyAgain | None = None,
    max_flights: int = MAX_JSBSIM_FLIGHTS,
    advance: Callable[[float, float], None] = lambda done, total: None,
) -> Returns:
    """Simulate and judge the RTL from each start, once for each ending in `ReturnWorld.return_endings`.

    Returns from low starts that only sink to the ground are left out; `Returns.omitted_count` states their number.

    interval: time between starts, s.
    fly_again: function that flies an uncertain return again in JSBSim; None for no such flights.
    max_flights: maximum number of JSBSim flights.
    advance: called with the number of judged returns and the total; an exception that it raises ends the work.
    """
    returns: list[SimulatedReturn] = []
    differences: list[float] = []
    omitted_count, total_count = 0, len(world.return_endings) * len(starts)
    start_heights, min_heights = heights_above_ground(world, starts), required_heights(world, starts)
    for number, ending in enumerate(world.return_endings):
        advance(number * len(starts), total_count)
        if not world.is_simulated or ("landing" in world.unjudged_parts and ending == "straight to land"):
            continue
        targets = [world.target(row, ending) for row in starts.rows]
        simulated = world.fly(starts.rows, targets, store_positions=bool(world.airspace.zones))
        results, paths = exclude_approaches(world, starts, targets, simulated.results, min_heights), simulated.tracks
        judged_returns = []
        for k, row in enumerate(results):
            advance(number * len(starts) + k, total_count)
            ret = _judge_return(
                world, starts, k, targets[k], row, paths[k] if paths else _NO_PATH, float(min_heights[k])
            )
            starts_too_low = bool(start_heights[k] < min_heights[k] - CLEARANCE_TOLERANCE_M)
            judged_returns.append(replace(ret, starts_too_low=starts_too_low))
        if fly_again is not None and ending == "circle":
            judged_returns, new_differences = _recheck_in_jsbsim(
                world, starts, judged_returns, results, fly_again, max_flights
            )
            differences += new_differences
        reported_returns = [
            ret
            for k, ret in enumerate(judged_returns)
            if not (starts.is_low[k] and sinks_to_ground(ret, float(start_heights[k])))
        ]
        omitted_count += starts.grounded_count + len(judged_returns) - len(reported_returns)
        returns += reported_returns
    parameters, trials = world.autopilot.parameters, world.autopilot.returns.trials
    ending_names = {name for ending in trials.endings for name in ending if world.rtl_ending == "straight to land"}
    autoland = int(parameters.rtl_autoland) if isinstance(parameters, ArduPilotParameters) else None
    return Returns(
        each=tuple(returns),
        interval=interval,
        causes=world.causes,
        limit=world.limit,
        airspace=world.airspace,
        reserve=ENERGY_RESERVE_FRACTION * world.setup.battery,
        flown=starts.is_flown,
        jsbsim_differences=tuple(differences),
        omitted_count=omitted_count,
        stands_in=world.stands_in,
        unjudged_parts=world.unjudged_parts,
        autoland=None if world.uses_other_autopilot else autoland,
        autoland_assumed=parameters is not None and "RTL_AUTOLAND" in parameters.by_origin("assumed"),
        landings=world.landings,
        autopilot=world.autopilot.title,
        path_text=world.autopilot.returns.path_text,
        trials_text=", ".join([*ending_names, trials.text]),
    )


def sinks_to_ground(ret: SimulatedReturn, height: float) -> bool:
    """Return True if an RTL from a low start sinks to the ground before the aircraft can return.

    Low starts are those in a take-off or a landing; the path of such a return is not at fault.  The result is False for
    a return that flies into rising ground, or that hits a hill later.

    height: height of the start above ground, m.  From `MIN_JUDGED_HEIGHT_M` on, the return must also lose at least half
        of this height.
    """
    distance = math.dist(ret.start[:2], ret.lowest_position[:2])
    is_sinking = (
        height < MIN_JUDGED_HEIGHT_M or ret.start[2] - ret.lowest_position[2] >= (1.0 - _LOW_START_FRACTION) * height
    )
    return ret.kind in ("ground", "low", "unsure") and is_sinking and distance <= _SINK_DISTANCE_M


_NO_PATH: Floats = np.zeros((0, 3))


def flies_landing_approach(targets: Sequence[ReturnTarget]) -> Flags:
    """Return a mask of the targets whose return continues along an approach to a landing, (n,).

    The approach is the mission's.
    """
    return np.array([target.landing is not None and bool(target.landing.next_stops) for target in targets], np.bool_)


def exclude_approaches(
    world: ReturnWorld, starts: ReturnStarts, targets: Sequence[ReturnTarget], results: Records, min_heights: Floats
) -> Records:
    """Correct the clearances of simulated returns so that they exclude the approach to a landing.

    After the first item of a landing sequence, a return flies the mission's approach, which descends to the landing.
    The clearance of a return that becomes too low on the approach is therefore measured only up to the first item.

    starts, targets: start and target of each return, n of each.
    results: simulated returns, (n,) of dtype `RETURN_RESULT`.
    min_heights: required heights above ground, m, (n,).
    """
    indices = np.flatnonzero((results["clearance"] < min_heights) & flies_landing_approach(targets))
    if not indices.size:
        return results
    short_targets = [
        targets[k]._replace(landing=landing._replace(next_stops=()))
        for k in indices.tolist()
        if (landing := targets[k].landing) is not None
    ]
    short_results = world.fly(starts.subset(indices).rows, short_targets).results
    results = results.copy()
    for name in ("clearance", "clearance_east", "clearance_north", "clearance_up"):
        values = results[name]
        # A return that hits the ground keeps the position of the impact.
        is_airborne = results["outcome"][indices] != RETURN_GROUND_IMPACT
        values[indices[is_airborne]] = short_results[name][is_airborne]
    return results


def required_heights(world: ReturnWorld, starts: ReturnStarts) -> Floats:
    """Return the required height above ground of the RTL from each start, m, (n,).

    This is `ReturnWorld.limit`, even where the flight itself is lower.  In a take-off or a landing, it is only the
    height that the flight's own height permits (`possible_heights`).
    """
    return np.where(starts.is_ground_phase, possible_heights(world, starts), world.limit)


def possible_heights(world: ReturnWorld, starts: ReturnStarts) -> Floats:
    """Return the height above ground that the RTL from each start can keep, m, (n,).

    It is at most `ReturnWorld.limit`.

    It is less than this limit from a start at which the flight itself is below the limit, or soon will be.  From a low
    start in a take-off or landing, it is at most `_LOW_START_FRACTION` of the height of the start.
    """
    start_heights = heights_above_ground(world, starts)
    flight_heights = start_heights - starts.height_loss
    air_heights = np.where(flight_heights < world.limit, flight_heights - TURN_HEIGHT_LOSS_M, world.limit)
    return np.where(starts.is_low, np.minimum(_LOW_START_FRACTION * start_heights, world.limit), air_heights)


def heights_above_ground(world: ReturnWorld, starts: ReturnStarts) -> Floats:
    """Return the heights above ground of starts, m, (n,); NaN if the ground is unknown."""
    if world.scenario.terrain is None:
        return np.full(len(starts), math.nan)
    rows = starts.rows
    return np.asarray(rows["up"] - world.scenario.terrain.height(rows["east"], rows["north"]), dtype=np.float64)


def classify_return(world: ReturnWorld, result: Record, zone: int, energy_left: float, required_height: float) -> Kind:
    """Classify the outcome of a simulated return.

    result: record of dtype `RETURN_RESULT`.
    zone: index of the violated zone, -1 for none.
    energy_left: energy left at the end, Wh; NaN if unknown.
    required_height: required height above ground, m.
    """
    if result["outcome"] == RETURN_GROUND_IMPACT:
        return "ground"
    if result["threat"] >= 0 and result["sphere_distance"] <= 0.0:
        return "threat"
    if zone >= 0:
        return "zone"
    if result["outcome"] == RETURN_TIMEOUT:
        return "lost"
    if energy_left < ENERGY_RESERVE_FRACTION * world.setup.battery:
        return "energy"
    if result["clearance"] < required_height - CLEARANCE_TOLERANCE_M:
        # A return that was too low fails even if the rest of its path is unknown.
        return "low"
    if result["outcome"] == RETURN_OFF_TERRAIN or math.isnan(result["clearance"]):
        return "unknown"
    battery = world.setup.battery
    if math.isnan(energy_left):
        return "used" if world.is_energy_known else "safe"
    max_energy_used = (battery - energy_left) * math.exp(UNDECIDED_FRACTION * world.setup.envelope.power_sd)
    return "power" if max_energy_used > (1.0 - ENERGY_RESERVE_FRACTION) * battery else "safe"


def _judge_return(
    world: ReturnWorld,
    starts: ReturnStarts,
    start_index: int,
    target: ReturnTarget,
    result: Record,
    path: Floats,
    required_height: float,
) -> SimulatedReturn:
    """Judge one simulated return from the start with index `start_index`.

    result: record of dtype `RETURN_RESULT`.
    path: positions of the return, m, (t, 3); empty without zones.
    required_height: required height above ground, m.
    """
    violation = deepest_violation(world, path) if len(path) > 1 else None
    zone = -1 if violation is None else violation.zone
    energy_used = float(starts.energy_used[start_index])
    energy_left = float(world.setup.battery - energy_used - result["energy"]) if world.is_energy_known else math.nan
    row = starts.rows[start_index]
    return SimulatedReturn(
        time=float(starts.time[start_index]),
        start=(float(row["east"]), float(row["north"]), float(row["up"])),
        target=target,
        kind=classify_return(world, result, zone, energy_left, required_height),
        clearance=float(result["clearance"]),
        lowest_position=(
            float(result["clearance_east"]),
            float(result["clearance_north"]),
            float(result["clearance_up"]),
        ),
        sphere_distance=float(result["sphere_distance"]),
        threat=int(result["threat"]),
        zone=zone,
        energy=float(result["energy"]),
        energy_left=energy_left,
        time_to_loiter=float(result["arrival_time"]),
        required_height=required_height,
        energy_used=energy_used,
        violation=violation,
    )


def deepest_violation(world: ReturnWorld, path: Floats) -> ZoneViolation | None:
    """Return the deepest violation of a zone by a path, or None if it violates none.

    path: positions at intervals of one second, m, (t, 3).
    """
    steps = np.diff(path, axis=0)
    moves: Records = np.zeros(len(steps), MOVE)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    for axis, name in enumerate(("east", "north", "up")):
        moves[name] = path[:-1, axis]
    moves["course_east"] = np.divide(steps[:, 0], lengths, out=np.zeros_like(lengths), where=lengths > 0.0)
    moves["course_north"] = np.divide(steps[:, 1], lengths, out=np.zeros_like(lengths), where=lengths > 0.0)
    moves["length"], moves["climb"], moves["lasts"] = lengths, steps[:, 2], 1.0
    moves["time"] = np.arange(len(steps))
    visits = path_zones(moves, world.airspace.records, world.scenario.terrain)
    zone = int(np.argmax(visits["depth"]))
    visit = visits[zone]
    if not visit["depth"] > 0.0:
        return None
    return ZoneViolation(
        zone,
        world.airspace.zones[zone].name,
        world.airspace.zones[zone].kind == "inclusion",
        float(visit["depth"]),
        (float(visit["at_east"]), float(visit["at_north"])),
    )


# ----------------------------------------------------------------------
# Returns whose point-mass simulation could be wrong, flown again in JSBSim.


def _recheck_in_jsbsim(
    world: ReturnWorld,
    starts: ReturnStarts,
    returns: list[SimulatedReturn],
    results: Records,
    fly_again: FlyAgain,
    max_flights: int,
) -> tuple[list[SimulatedReturn], list[float]]:
    """Fly doubtful returns again in JSBSim, the most doubtful first, and correct the point-mass results.

    A return is doubtful if the error of the point mass may change its outcome.  Doubtful returns that begin in a turn
    or too slowly, that end with a landing, or that exceed `max_flights`, are not flown in JSBSim.  They get the
    correction of the nearest flown return in the same run of consecutive doubtful returns, if JSBSim made that return
    worse.

    starts: starts of the returns, in the order of `returns`.
    results: point-mass results of the returns, (n,) of dtype `RETURN_RESULT`.
    fly_again: function that flies a return in JSBSim, see `FlyAgain`.
    max_flights: maximum number of JSBSim flights.

    Returns the corrected returns, and for each flown return the difference in clearance (JSBSim minus point mass, m).
    """
    limit_ratios = [limit_ratio(ret) for ret in returns]
    candidates = [
        k
        for k, row in enumerate(starts.rows)
        if limit_ratios[k] < 1.0 and returns[k].target.landing is None and can_start_in_jsbsim(world, row)
    ]
    offsets: dict[int, tuple[float, float]] = {}
    differences = []
    for k in sorted(candidates, key=lambda k: limit_ratios[k])[:max_flights]:
        jsbsim_minima = fly_again(world, starts.rows[k])
        if jsbsim_minima is None:
            continue
        # A JSBSim flight ends at the ground, and the point mass flies on below it.
        is_ground_impact = jsbsim_minima[0] <= 0.0 and returns[k].clearance <= 0.0
        height_offset = 0.0 if is_ground_impact else jsbsim_minima[0] - returns[k].clearance
        distance_offset = jsbsim_minima[1] - returns[k].sphere_distance
        if math.isfinite(height_offset) and not is_ground_impact:
            differences.append(height_offset)
        # The offset is 0 if one of the two values is unknown.
        offsets[k] = (
            height_offset if math.isfinite(height_offset) else 0.0,
            distance_offset if math.isfinite(distance_offset) else 0.0,
        )
    corrected_returns = list(returns)
    for is_doubtful, group in groupby(range(len(returns)), lambda k: limit_ratios[k] < 1.0):
        members = list(group)
        flown_members = [k for k in members if k in offsets]
        if not is_doubtful or not flown_members:
            continue
        for k in members:
            nearest = min(flown_members, key=lambda j: abs(j - k))
            corrected_returns[k] = _corrected_return(
                world, returns[k], results[k], offsets[nearest], returns[nearest], is_flown=nearest == k
            )
    return corrected_returns, differences


def _corrected_return(
    world: ReturnWorld,
    ret: SimulatedReturn,
    result: Record,
    offsets: tuple[float, float],
    flown_return: SimulatedReturn,
    *,
    is_flown: bool,
) -> SimulatedReturn:
    """Correct a doubtful return by the differences between JSBSim and the point mass on a flown return.

    If these differences are large and matter, the outcome becomes "unsure", unless a failure is certain.

    ret, result: the doubtful return by the point mass, and its record of dtype `RETURN_RESULT`.
    offsets: differences (JSBSim minus point mass) in clearance and in distance outside kill spheres, m.
    flown_return: result of the point mass for the return that JSBSim flew.
    is_flown: True if the return that JSBSim flew is the doubtful return itself.
    """
    height_offset, distance_offset = offsets
    is_low = (
        min(flown_return.clearance, flown_return.clearance + height_offset)
        < flown_return.required_height + _DECISIVE_MARGIN_M
    )
    is_close = min(flown_return.sphere_distance, flown_return.sphere_distance + distance_offset) < _DECISIVE_MARGIN_M
    simulations_disagree = (is_low and abs(height_offset) > POINT_MASS_ERROR_M) or (
        is_close and abs(distance_offset) > POINT_MASS_POSITION_ERROR_M
    )
    if is_flown:
        corrected = _with_offsets(world, ret, result, height_offset, distance_offset)
        is_undecided = simulations_disagree and corrected.kind not in ("ground", "threat")
        return replace(corrected, kind="unsure") if is_undecided else corrected
    if simulations_disagree:
        return replace(ret, kind="unsure") if ret.kind in ("low", "safe") else ret
    # A JSBSim flight that is better than the point mass does not improve other returns.
    return _with_offsets(world, ret, result, min(0.0, height_offset), min(0.0, distance_offset))


def _with_offsets(
    world: ReturnWorld, ret: SimulatedReturn, result: Record, height_offset: float, distance_offset: float
) -> SimulatedReturn:
    """Add offsets (m) to a return's clearance and sphere distance, and classify its outcome again."""
    corrected_result = result.copy()
    corrected_result["clearance"] += height_offset
    corrected_result["sphere_distance"] += distance_offset
    if corrected_result["clearance"] <= 0.0:
        corrected_result["outcome"] = RETURN_GROUND_IMPACT
    elif corrected_result["outcome"] == RETURN_GROUND_IMPACT:
        # The simulation continued after it grazed the ground: energy and zones cover the whole path.
        corrected_result["outcome"] = RETURN_TIMEOUT if math.isnan(ret.time_to_loiter) else RETURN_ARRIVED
    kind = classify_return(world, corrected_result, ret.zone, ret.energy_left, ret.required_height)
    return replace(
        ret,
        clearance=float(corrected_result["clearance"]),
        sphere_distance=float(corrected_result["sphere_distance"]),
        kind=kind,
    )


def can_start_in_jsbsim(world: ReturnWorld, row: Record) -> bool:
    """Return True if a JSBSim flight can begin at a start.

    Its bank must be small, and its airspeed sufficient.

    row: the start, of dtype `RETURN_START`.
    """
    place = [float(row[name]) for name in ("east", "north", "up")]
    wind_east, wind_north = world.scenario.wind_velocity(place, float(row["time"]))
    east = float(row["velocity_east"]) - wind_east
    north = float(row["velocity_north"]) - wind_north
    airspeed = math.hypot(east, north, float(row["velocity_up"]))
    return abs(float(row["roll"])) <= _MAX_START_BANK_RAD and airspeed >= float(world.aircraft.record.first_airspeed)


def limit_ratio(ret: SimulatedReturn) -> float:
    """Return a return's smallest distance from a limit, divided by the error of the point mass.

    The limits are the ground, the required height and the kill spheres.  Below 1, the error of the point mass may
    change the outcome.  Return inf for a violated zone or unknown ground, and if all distances are unknown.
    """
    if ret.kind in ("zone", "unknown"):
        # These outcomes do not depend on a distance.
        return math.inf
    ratios = [abs(ret.clearance) / POINT_MASS_ERROR_M]
    if ret.kind != "ground":
        ratios.append(abs(ret.clearance - ret.required_height) / POINT_MASS_ERROR_M)
        ratios.append(abs(ret.sphere_distance) / POINT_MASS_POSITION_ERROR_M)
    return min((ratio for ratio in ratios if not math.isnan(ratio)), default=math.inf)
