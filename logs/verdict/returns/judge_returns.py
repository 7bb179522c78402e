"""Judge whether every return to launch is safe: simulate ArduPlane's RTL from each start.

If RTL_AUTOLAND, or a battery failsafe, leads to a landing sequence of the mission, the path to it is judged.

A return is simulated with a point mass (`flight.autopilots.arduplane.rtl_point_mass`), in the mean wind.  Returns whose
simulation could be wrong are flown again in JSBSim if the caller provides that.  The result replaces the point mass for
the return that was flown again, and if it is worse, for all similar returns.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np

from aircraft.catalog import Aircraft, find_again
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.failsafes import Cause, failsafe_causes
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane.point_mass import PointMass, point_mass
from flight.autopilots.arduplane.rtl_point_mass import (
    RETURN_ARRIVED,
    RETURN_GROUND_IMPACT,
    RETURN_OFF_TERRAIN,
    RETURN_TIMEOUT,
    ReturnEnvironment,
    fly_returns,
    surroundings,
)
from flight.mission.items import LANDINGS, Command
from flight.mission.placing import landing_starts, return_places
from flight.mission.return_path import (
    LandingStart,
    ReturnCircle,
    ReturnPlace,
    ReturnTarget,
    choose_target,
    nearest_landing,
)
from flight.simulation.setup import FlightSetup
from logs.verdict.measures.path_moves import MOVE
from logs.verdict.measures.route_requirements import Airspace, airspace_of
from logs.verdict.measures.zone_visits import path_zones
from logs.verdict.returns.return_starts import ReturnStarts
from logs.verdict.tolerances import CLEARANCE_TOLERANCE_M, ENERGY_RESERVE_FRACTION
from world.arrays import Floats
from world.errors import MissionError
from world.kernels import Record, Records
from world.scenario import Scenario
from world.wind import mean_wind_speed

# Outcome of a return, the worst first: it hits the ground, enters a missile's sphere, violates a zone, does not arrive,
# uses more energy than available, leaves the elevation data, differs too much between the point mass and JSBSim, goes
# below the least height above ground; or is safe.
Kind = Literal["ground", "threat", "zone", "lost", "energy", "unknown", "unsure", "low", "safe"]
KINDS: tuple[Kind, ...] = ("ground", "threat", "zone", "lost", "energy", "unknown", "unsure", "low", "safe")
# Outcomes that are failures of the return.
UNSAFE = frozenset(KINDS[:5])

# End of a return: it stays in a loiter there; it goes on from the loiter to a landing sequence (RTL_AUTOLAND 1); or it
# flies straight to a landing sequence (RTL_AUTOLAND 2, and "land" as a battery failsafe action).
Way = Literal["circle", "on to land", "straight to land"]
# Reasons that leave returns undecided, whatever their simulation shows: they follow the terrain; the autopilot has
# another control law; mode AUTOLAND lands by a pattern of its own; they follow the mission's return path (RTL_AUTOLAND
# 4); or the landing sequence begins with the landing itself.
Open = Literal["terrain", "law", "autoland", "return path", "landing"]

# Closer to a limit than this the point mass could be wrong, m: it is within 7 m of 38 flights of ArduPlane.
UNSURE = 10.0
# The difference between point mass and JSBSim matters only this close to a limit, m.
_DECISIVE_MARGIN_M = 50.0
# Height that the turn of a return costs, m.  A return that begins below the least height above ground, as after a
# take-off, has to keep its starting height less this.
TURN = 2.0
# Fraction of its starting height that a return from a flown take-off or landing has to keep: it may be sinking.
_LOW_START_FRACTION = 0.5
# Least height above ground from which returns in a take-off or a landing are judged, m: nothing turns below it.
MIN_JUDGED_HEIGHT_M = 10.0
# A return from higher up is left out if it hits the ground or gets low within this run, m, because it sinks by the rest
# of that fraction.
_SINK_RUN_M = 500.0
# Bank beyond which a JSBSim flight cannot begin at a start, rad, because it approaches the start straight.
_MAX_START_BANK_RAD = math.radians(10.0)


@dataclass(frozen=True, slots=True)
class ReturnFlown:
    """One simulated return.

    time: s of the flight at which it begins.  start: (3,) m.
    target: its destination, and the reason for it.
    kind: its outcome.
    clearance: least height above ground, m, NaN if unknown; clearance_at: (3,) m, where.
    outside: least distance outside a kill sphere, m, inf for none; threat: index of that sphere, -1 for none.
    zone: the zone that it violates, an index of `Returns.airspace`, -1 for none.
    energy: energy that it uses, Wh; left: energy left at its end, Wh; NaN if unknown.
    seconds: time to its loiter, NaN if it does not get there.
    floor: required height above ground, m: the least height, or the starting height if that is less.
    used: energy that was used before it begins, Wh; NaN if unknown.
    """

    time: float
    start: tuple[float, float, float]
    target: ReturnTarget
    kind: Kind
    clearance: float
    clearance_at: tuple[float, float, float]
    outside: float
    threat: int
    zone: int
    energy: float
    left: float
    seconds: float
    floor: float = math.nan
    used: float = math.nan

    @property
    def safe(self) -> bool:
        """True if the return is safe."""
        return self.kind == "safe"


@dataclass(frozen=True, slots=True)
class ReturnRange:
    """Time range from which returns go to the same place with the same outcome.

    first, last: s.  count: number of returns.  worst: the worst of them.
    """

    first: float
    last: float
    count: int
    worst: ReturnFlown


# Point of no return by energy: none; after some place; before the first place; or unknown, because the battery or the
# energy used is unknown, or because no return arrives.
NoReturn = Literal["never", "later", "at once", "battery", "used", "arrives"]


class PointOfNoReturn(NamedTuple):
    """Last place from which a return leaves the reserve, in the given wind.

    kind: whether there is such a point, or why it is unknown.
    time: s, of the last place with the reserve; NaN if there is no point of no return, or it is unknown.
    left: Wh left after the return from there, or the least left after any return if there is no such point.
    skipped: number of returns before it that do not arrive, so that their energy is unknown.
    """

    kind: NoReturn
    time: float = math.nan
    left: float = math.nan
    skipped: int = 0


@dataclass(frozen=True, slots=True)
class Returns:
    """Returns from all places on the path.

    each: by time.  every: s between two.
    causes: events that can take the aircraft off its mission, and its action then.
    limit: least height above ground that is required, m.
    airspace: the zones.
    reserve: energy that has to be left, Wh.
    flown: True if they begin on a flown track, False for the planned path.
    again: for each return flown again in JSBSim, the clearance there minus the clearance of the point mass, m.
    stands_in: True if ArduPlane's law stands in for an autopilot without a return law.
    open: parts that are not judged.
    autoland: RTL_AUTOLAND; None for the mission of another autopilot.
    landings: the mission's landing sequences.
    left_out: number of further returns while the aircraft is on the ground, or so low in a take-off or a landing that
        it sinks to the ground before it can return.
    """

    each: tuple[ReturnFlown, ...]
    every: float
    causes: tuple[Cause, ...]
    limit: float
    airspace: Airspace
    reserve: float
    flown: bool
    again: tuple[float, ...] = ()
    stands_in: bool = False
    open: tuple[Open, ...] = ()
    autoland: int | None = None
    landings: tuple[LandingStart, ...] = ()
    left_out: int = 0

    @property
    def safe(self) -> bool:
        """True if every return is safe and nothing is left undecided; a landing at the end is not judged."""
        return bool(self.each) and not self.open and all(one.safe for one in self.each)

    @property
    def undecided(self) -> bool:
        """True if no return is known to be unsafe, but some are unknown."""
        has_failures = bool(self.unsafe) or self.count("low") > 0
        return not has_failures and (bool(self.open) or self.count("unknown") > 0 or self.count("unsure") > 0)

    @property
    def lands(self) -> bool:
        """True if any return goes to a landing sequence."""
        return any(one.target.landing is not None for one in self.each)

    @property
    def unsafe(self) -> tuple[ReturnFlown, ...]:
        """Returns whose outcome is in `UNSAFE`."""
        return tuple(one for one in self.each if one.kind in UNSAFE)

    def count(self, kind: Kind) -> int:
        """Return the number of returns with this outcome."""
        return sum(one.kind == kind for one in self.each)

    @property
    def point_of_no_return(self) -> PointOfNoReturn:
        """Point of no return by energy, for RTL returns; returns that do not arrive are left out."""
        last, least, skipped = math.nan, math.inf, 0
        if not self.each or all(math.isnan(one.left) for one in self.each):
            return PointOfNoReturn("battery")
        for k, one in enumerate(self.each):
            if k and one.time <= self.each[k - 1].time:
                # From here on the returns end differently.
                break
            if math.isnan(one.used):
                return PointOfNoReturn("used")
            if math.isnan(one.seconds) or math.isnan(one.left):
                skipped += 1
            elif one.left < self.reserve:
                return PointOfNoReturn("at once" if math.isnan(last) else "later", last, least, skipped)
            else:
                last, least = one.time, min(least, one.left)
        return PointOfNoReturn("arrives" if math.isnan(last) else "never", math.nan, least, skipped)

    @property
    def ranges(self) -> tuple[ReturnRange, ...]:
        """All returns in time ranges, the worst first."""
        found = []
        for _, group in groupby(self.each, _report_key):
            ones = list(group)
            found.append(ReturnRange(ones[0].time, ones[-1].time, len(ones), min(ones, key=badness)))
        return tuple(sorted(found, key=lambda one: (*badness(one.worst), one.first)))


def _report_key(one: ReturnFlown) -> tuple[object, ...]:
    """Return a key that is equal for returns that are reported together."""
    goes = (one.kind, one.target.name)
    return (*goes, one.threat, one.zone) if one.kind in ("threat", "zone") else goes


def badness(one: ReturnFlown) -> tuple[int, float]:
    """Return a sort key that puts the worst return first."""
    measure = one.outside if one.kind == "threat" else one.left if one.kind == "energy" else one.clearance
    return KINDS.index(one.kind), math.inf if math.isnan(measure) else measure


@dataclass(frozen=True, slots=True)
class ReturnWorld:
    """Data on which the result of returns depends, except their starts.

    parameters: of ArduPlane.  home, rally: on the map.
    aircraft: as a point mass.  around: ground and spheres.
    stands_in: as in `Returns`.  other_law: True if it replaces an autopilot with its own return law.
    landings: the mission's landing sequences.
    """

    setup: FlightSetup
    parameters: ArduPilotParameters
    home: ReturnPlace
    rally: tuple[ReturnPlace, ...]
    aircraft: PointMass
    around: ReturnEnvironment
    airspace: Airspace
    stands_in: bool = False
    other_law: bool = False
    landings: tuple[LandingStart, ...] = ()

    @property
    def scenario(self) -> Scenario:
        """Scenario of the setup."""
        return self.setup.scenario

    @property
    def limit(self) -> float:
        """Least height above ground, m."""
        return self.setup.limits.min_clearance

    @property
    def battery_known(self) -> bool:
        """True if the battery's energy is stated; otherwise energy is not judged."""
        return not self.setup.envelope.battery_guessed or self.scenario.flight.battery_wh is not None

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Events that can take the aircraft off its mission; unknown, thus empty, for another autopilot."""
        if self.other_law:
            return ()
        mission = self.setup.mission
        return failsafe_causes(
            self.parameters,
            has_fence=bool(mission.fences),
            has_landing=bool(self.landings),
            ends_landed=any(item.command in LANDINGS for item in mission.items),
        )

    @property
    def way(self) -> Way:
        """End of a return by RTL."""
        named: dict[int, Way] = {1: "on to land", 2: "straight to land"}
        return named.get(int(self.parameters.rtl_autoland), "circle") if self.landings else "circle"

    @property
    def ways(self) -> tuple[Way, ...]:
        """All kinds of ends of returns, RTL's first."""
        lands = any(cause.does == "land" for cause in self.causes) and self.way != "straight to land"
        return (self.way, "straight to land") if lands else (self.way,)

    @property
    def open(self) -> tuple[Open, ...]:
        """Parts of its returns that cannot be judged."""
        found: dict[Open, bool] = {
            "terrain": self.parameters.follows_terrain_home,
            "law": self.other_law,
            "autoland": any(cause.does == "autoland" for cause in self.causes),
            "return path": int(self.parameters.rtl_autoland) == 4 and _has_return_path(self.setup),
            "landing": any(way != "circle" for way in self.ways) and any(one.lands for one in self.landings),
        }
        return tuple(name for name, is_so in found.items() if is_so)

    def target(self, row: Record, way: Way | None = None) -> ReturnTarget:
        """Return the destination of a return from a start.  way: end of the return, RTL's by default."""
        rules = ArduPlane(self.parameters).return_rules
        here = (float(row["east"]), float(row["north"]), float(row["up"]))
        way = way or self.way
        if way == "straight to land" and (landing := nearest_landing(here, self.landings)) is not None:
            away = math.dist(here[:2], landing.place[:2])
            name, why = f"the landing sequence at item {landing.item}", self._choice_reason(landing)
            return ReturnTarget(landing.place, name, why, away, landing=landing, straight=True)
        target = choose_target(rules, here, self.home, self.rally)
        return self.going_on(target) if way == "on to land" else target

    def going_on(self, target: ReturnTarget) -> ReturnTarget:
        """Return the target of a return to a loiter, with the landing sequence to which RTL then goes on."""
        landing = nearest_landing(target.position, self.landings) if self.way == "on to land" else None
        if landing is None:
            return target
        reasons = [one for one in (target.reason, self._choice_reason(landing)) if one]
        name = f"{target.name}, and on to the landing sequence at item {landing.item}"
        return target._replace(name=name, reason=", ".join(reasons), landing=landing)

    def _choice_reason(self, landing: LandingStart) -> str:
        """Return the reason for choosing a landing sequence."""
        return f"item {landing.item} is of the nearest of {len(self.landings)}" if len(self.landings) > 1 else ""

    def with_parameters(self, **values: float) -> "ReturnWorld":
        """Return a copy with other parameters, by ArduPlane's names and in its units."""
        return replace(self, parameters=self.parameters.changed(**values))

    def with_rally(self, rally: Sequence[ReturnPlace]) -> "ReturnWorld":
        """Return a copy with other rally points."""
        return replace(self, rally=tuple(rally))


def _has_return_path(setup: FlightSetup) -> bool:
    """Return True if a mission has a landing sequence or a return path, which RTL_AUTOLAND 4 follows."""
    return any(item.command in (Command.DO_RETURN_PATH_START, Command.DO_LAND_START) for item in setup.mission.items)


def return_world(setup: FlightSetup) -> ReturnWorld:
    """Collect the data that decides the returns of a setup's mission.

    The control law is ArduPlane's, with the setup's parameters if it has any, otherwise with the aircraft's parameters.
    Raises MissionError for a mission without a home, and FlightError for an aircraft that cannot be loaded.
    """
    places = return_places(setup.mission, setup.scenario.origin, setup.scenario.terrain)
    if not places:
        source = setup.mission.source
        message = f"{source}: home: not stated, so there is nowhere to return to"
        raise MissionError(message, file=source, field="home")
    aircraft: Aircraft = find_again(setup.aircraft, setup.scenario.flight.aircraft)
    own = setup.autopilot.law.parameters
    parameters = own if isinstance(own, ArduPilotParameters) else ArduPilotParameters.load(aircraft)
    return ReturnWorld(
        setup,
        parameters,
        places[0],
        places[1:],
        point_mass(aircraft, setup.envelope, setup.airspeed, setup.scenario.wind),
        surroundings(setup.scenario),
        airspace_of(setup),
        own is not parameters,
        own is not None and own is not parameters,
        landing_starts(setup.mission, setup.scenario.origin, setup.scenario.terrain),
    )


# Callable that flies a return in JSBSim: least height above ground and least distance outside a kill sphere, m; None if
# it cannot be flown.
FlyAgain = Callable[[ReturnWorld, Record], tuple[float, float] | None]
# Largest number of returns that are flown again.
MAX_AGAIN = 4


def judge_returns(
    world: ReturnWorld,
    starts: ReturnStarts,
    every: float,
    fly_again: FlyAgain | None = None,
    most: int = MAX_AGAIN,
    advance: Callable[[float, float], None] = lambda done, total: None,
) -> Returns:
    """Simulate and judge the return from each start.

    every: s between them.  fly_again: flies a return in JSBSim; None for no such flights.  most: largest number of
    them.
    advance: called with the number judged and the total; an exception that it raises ends the work.
    """
    each: list[ReturnFlown] = []
    again: list[float] = []
    left_out, total = 0, len(world.ways) * len(starts)
    for number, way in enumerate(world.ways):
        advance(number * len(starts), total)
        if "terrain" in world.open or ("landing" in world.open and way == "straight to land"):
            continue
        ends = [world.target(row, way) for row in starts.rows]
        flown, paths = fly_home(world, starts, ends)
        floor_heights = floors(world, starts)
        ones = []
        for k, row in enumerate(flown):
            advance(number * len(starts) + k, total)
            ones.append(
                _judge_return(world, starts, k, ends[k], row, paths[k] if paths else _NO_PATH, float(floor_heights[k]))
            )
        if fly_again is not None and way == "circle":
            ones, apart = _recheck_in_jsbsim(world, starts, ones, flown, fly_again, most)
            again += apart
        begins = heights_above_ground(world, starts)
        kept = [one for k, one in enumerate(ones) if not (starts.low[k] and sinks_down(one, float(begins[k])))]
        left_out += starts.grounded + len(ones) - len(kept)
        each += kept
    return Returns(
        each=tuple(each),
        every=every,
        causes=world.causes,
        limit=world.limit,
        airspace=world.airspace,
        reserve=ENERGY_RESERVE_FRACTION * world.setup.battery,
        flown=starts.flown,
        again=tuple(again),
        stands_in=world.stands_in,
        open=world.open,
        autoland=None if world.other_law else int(world.parameters.rtl_autoland),
        landings=world.landings,
        left_out=left_out,
    )


def sinks_down(one: ReturnFlown, height: float) -> bool:
    """Return True if a return from a low start in a take-off or landing just sinks to the ground.

    That is no fault of its path.

    height: its starting height above ground, m.  Below `MIN_JUDGED_HEIGHT_M` this is any return that hits the ground
    or gets low
    near its start; higher up, one that loses half of its height by then.  A return that flies into rising ground, or
    hits a hill later, is judged.
    """
    run = math.dist(one.start[:2], one.clearance_at[:2])
    sinks = height < MIN_JUDGED_HEIGHT_M or one.start[2] - one.clearance_at[2] >= (1.0 - _LOW_START_FRACTION) * height
    return one.kind in ("ground", "low", "unsure") and sinks and run <= _SINK_RUN_M


_NO_PATH: Floats = np.zeros((0, 3))


def fly_home(
    world: ReturnWorld,
    starts: ReturnStarts,
    ends: Sequence[ReturnTarget],
    least: tuple[Floats, Floats] | None = None,
    *,
    keep: bool = False,
) -> tuple[Records, tuple[Floats, ...]]:
    """Simulate returns from starts to their targets: (n,) of `RETURN_FLOWN`, and their paths.

    The paths are returned if there are zones.

    least: as in `flight.autopilots.arduplane.rtl_point_mass.fly_returns`.  keep: True to return all paths.
    """
    radius = ArduPlane(world.parameters).return_rules.radius
    circles = [None if end.straight else ReturnCircle(*end.position, radius, end.slope_base) for end in ends]
    # A landing is not simulated: a return that would begin with the landing ends where it would go on to it.
    landings = [end.landing if end.landing and not end.landing.lands else None for end in ends]
    keep = keep or bool(world.airspace.zones)
    found = fly_returns(
        starts.rows, circles, world.parameters, world.aircraft, world.around, landings=landings, keep=keep, least=least
    )
    return found.flown, found.ways


def floors(world: ReturnWorld, starts: ReturnStarts) -> Floats:
    """Return the required height above ground (n,) for the return from each start, m."""
    begins = heights_above_ground(world, starts)
    own = np.where(begins < world.limit, begins - TURN, world.limit)
    return np.where(starts.low, np.minimum(_LOW_START_FRACTION * begins, world.limit), own)


def heights_above_ground(world: ReturnWorld, starts: ReturnStarts) -> Floats:
    """Return the heights above ground of starts (n,), m; NaN if the ground is unknown."""
    if world.scenario.terrain is None:
        return np.full(len(starts), math.nan)
    rows = starts.rows
    return np.asarray(rows["up"] - world.scenario.terrain.height(rows["east"], rows["north"]), dtype=np.float64)


def kind_of(world: ReturnWorld, flown: Record, zone: int, left: float, floor: float) -> Kind:
    """Classify a simulated return.

    zone: the zone that it violates, -1 for none.  left: Wh left at the end, NaN if unknown.
    floor: required height above ground, m.
    """
    if flown["ended"] == RETURN_GROUND_IMPACT:
        return "ground"
    if flown["threat"] >= 0 and flown["outside"] <= 0.0:
        return "threat"
    if zone >= 0:
        return "zone"
    if flown["ended"] == RETURN_TIMEOUT:
        return "lost"
    if left < ENERGY_RESERVE_FRACTION * world.setup.battery:
        return "energy"
    if flown["clearance"] < floor - CLEARANCE_TOLERANCE_M:
        # Applies wherever the return goes after that.
        return "low"
    return "unknown" if flown["ended"] == RETURN_OFF_TERRAIN or math.isnan(flown["clearance"]) else "safe"


def _judge_return(
    world: ReturnWorld, starts: ReturnStarts, k: int, target: ReturnTarget, flown: Record, way: Floats, floor: float
) -> ReturnFlown:
    zone = zone_met(world, way) if len(way) > 1 else -1
    used = 0.0 if math.isnan(starts.used[k]) else float(starts.used[k])
    left = float(world.setup.battery - used - flown["energy"]) if world.battery_known else math.nan
    row = starts.rows[k]
    return ReturnFlown(
        time=float(starts.time[k]),
        start=(float(row["east"]), float(row["north"]), float(row["up"])),
        target=target,
        kind=kind_of(world, flown, zone, left, floor),
        clearance=float(flown["clearance"]),
        clearance_at=(float(flown["clearance_east"]), float(flown["clearance_north"]), float(flown["clearance_up"])),
        outside=float(flown["outside"]),
        threat=int(flown["threat"]),
        zone=zone,
        energy=float(flown["energy"]),
        left=left,
        seconds=float(flown["to_circle"]),
        floor=floor,
        used=float(starts.used[k]),
    )


def zone_met(world: ReturnWorld, way: Floats) -> int:
    """Return the index of the zone that a path (t, 3) violates most, or -1 if it violates none."""
    step = np.diff(way, axis=0)
    moves: Records = np.zeros(len(step), MOVE)
    run = np.hypot(step[:, 0], step[:, 1])
    for axis, name in enumerate(("east", "north", "up")):
        moves[name] = way[:-1, axis]
    moves["course_east"] = np.divide(step[:, 0], run, out=np.zeros_like(run), where=run > 0.0)
    moves["course_north"] = np.divide(step[:, 1], run, out=np.zeros_like(run), where=run > 0.0)
    moves["length"], moves["climb"], moves["lasts"] = run, step[:, 2], 1.0
    moves["time"] = np.arange(len(step))
    visits = path_zones(moves, world.airspace.records, world.scenario.terrain)
    worst = int(np.argmax(visits["depth"]))
    return worst if visits[worst]["depth"] > 0.0 else -1


# ----------------------------------------------------------------------
# Returns that the point mass could have wrong, flown again in JSBSim.


def _recheck_in_jsbsim(
    world: ReturnWorld, starts: ReturnStarts, each: list[ReturnFlown], flown: Records, fly_again: FlyAgain, most: int
) -> tuple[list[ReturnFlown], list[float]]:
    """Fly the most doubtful of each run of doubtful returns in JSBSim, and correct the run by the result."""
    out, differences = list(each), []
    by_doubt = groupby(range(len(each)), lambda k: doubt(each[k]) < UNSURE)
    groups = [[k for k in group if is_steady(world, starts.rows[k])] for unsure, group in by_doubt if unsure]
    stretches = sorted((min(doubt(each[k]) for k in group), group) for group in groups if group)
    for _, group in stretches[:most]:
        k = min(group, key=lambda k: doubt(each[k]))
        found = fly_again(world, starts.rows[k])
        if found is None:
            continue
        # Differences in clearance and in distance outside spheres, m; 0 if there is nothing to compare.
        apart = [new - old for new, old in zip(found, (each[k].clearance, each[k].outside), strict=True)]
        higher, farther = (one if math.isfinite(one) else 0.0 for one in apart)
        if math.isfinite(apart[0]):
            differences.append(higher)
        low = min(each[k].clearance, each[k].clearance + higher) < each[k].floor + _DECISIVE_MARGIN_M
        close = min(each[k].outside, each[k].outside + farther) < _DECISIVE_MARGIN_M
        disagrees = (low and abs(higher) > UNSURE) or (close and abs(farther) > UNSURE)
        out[k] = _with_offsets(world, each[k], flown[k], higher, farther)
        if disagrees and out[k].kind not in ("ground", "threat"):
            out[k] = replace(out[k], kind="unsure")
        for j in group:
            if j != k and disagrees and each[j].kind in ("low", "safe"):
                out[j] = replace(each[j], kind="unsure")
            elif j != k and not disagrees:
                # The flight of one return never improves another one.
                out[j] = _with_offsets(world, each[j], flown[j], min(0.0, higher), min(0.0, farther))
    return out, differences


def _with_offsets(world: ReturnWorld, one: ReturnFlown, flown: Record, higher: float, farther: float) -> ReturnFlown:
    """Return a copy of a return that is higher and farther outside spheres by the given differences, m."""
    moved = flown.copy()
    moved["clearance"] += higher
    moved["outside"] += farther
    if moved["clearance"] <= 0.0:
        moved["ended"] = RETURN_GROUND_IMPACT
    elif moved["ended"] == RETURN_GROUND_IMPACT:
        # It was simulated on from where it grazed the ground: energy and zones cover the whole path.
        moved["ended"] = RETURN_TIMEOUT if math.isnan(one.seconds) else RETURN_ARRIVED
    kind = kind_of(world, moved, one.zone, one.left, one.floor)
    return replace(one, clearance=float(moved["clearance"]), outside=float(moved["outside"]), kind=kind)


def is_steady(world: ReturnWorld, row: Record) -> bool:
    """Return True if a JSBSim flight can be brought to a start: its bank is small, and its airspeed fast enough."""
    wind = world.scenario.wind
    over = mean_wind_speed(wind.speed, wind.gradient, wind.reference_amsl, float(row["up"]))
    east = float(row["velocity_east"]) + over * math.sin(wind.from_course)
    north = float(row["velocity_north"]) + over * math.cos(wind.from_course)
    airspeed = math.hypot(east, north, float(row["velocity_up"]))
    return abs(float(row["roll"])) <= _MAX_START_BANK_RAD and airspeed >= float(world.aircraft.record.slowest)


def doubt(one: ReturnFlown) -> float:
    """Return how close a return came to a deciding limit (ground, required height or a kill sphere), m."""
    if one.kind in ("zone", "unknown"):
        # Neither depends on a distance.
        return math.inf
    near = [abs(one.clearance)]
    if one.kind != "ground":
        near += [abs(one.clearance - one.floor), abs(one.outside)]
    return min((value for value in near if not math.isnan(value)), default=math.inf)
