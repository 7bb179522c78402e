"""A return to launch on the map: which place it goes to, and the way there that stands for it in a route.

An autopilot returns by a law of its own, which no mission spells out: it turns at once, flies straight to the nearest
rally point or home, sinks on a straight slope or climbs as fast as it can, and circles there.  `ReturnRules` states the
law in numbers.  The way is drawn of the same pieces as any other: an arc, a straight leg, a circle.

The rules are those of ArduPlane 4.6 (`ModeRTL` in ArduPlane/mode_rtl.cpp, `Plane::do_RTL` in commands_logic.cpp,
`AP_Rally::calc_best_rally_or_home_location` in libraries/AP_Rally/AP_Rally.cpp, `Plane::setup_glide_slope` in
ArduPlane/altitude.cpp), in its names where sentences name one.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from flight.mission.itinerary import UNLIMITED, ItineraryStop
from flight.mission.loiter_circles import CORNER, Node, RoutePoint, circle_corners, is_joined, on_rim, tangent_course
from world.geometry import wrap

Place = tuple[float, float, float]


class ReturnPlace(NamedTuple):
    """Home or a rally point on the map.

    east, north, up: m, AMSL; home's height is that of its ground.
    base: height that its own counts from as it is stated, m AMSL: home's, or 0 for one above the sea.
    number: a rally point's, counted from 1 as they stand in the file; 0 where nobody counted.
    """

    east: float
    north: float
    up: float
    base: float = 0.0
    number: int = 0


class ReturnCircle(NamedTuple):
    """The circle that a return ends in, as the autopilot is told it.

    east, north, up: of its middle, m AMSL.
    radius: m at sea level, negative to the left.
    slope_base: m by which the autopilot takes the target to be lower than it is when it draws the slope down to it;
        0 but for ArduPlane's rally points.
    """

    east: float
    north: float
    up: float
    radius: float
    slope_base: float = 0.0


class LandingStart(NamedTuple):
    """Where a landing sequence of a mission begins: what follows a DO_LAND_START.

    item: the mission item's number that is flown to first.
    place: its east, north, up, m AMSL.
    mark: east, north, up that its distance is counted to: of DO_LAND_START, where that states a place.
    circles: whether it is a loiter.  radius: of the loiter, m, negative to the left, 0 where none is stated.
    lands: whether it is the landing itself.
    onward: the places after it, up to the landing, without their own.
    """

    item: int
    place: Place
    mark: Place
    circles: bool = False
    radius: float = 0.0
    lands: bool = False
    onward: tuple["LandingStart", ...] = ()


def nearest_landing(here: Place, landings: Sequence[LandingStart]) -> LandingStart | None:
    """The landing sequence that ArduPlane goes to from a place (east, north, up): the nearest, height counted too.

    As `AP_Mission::get_landing_sequence_start` chooses (libraries/AP_Mission/AP_Mission.cpp); None of none.

    >>> far, near = (LandingStart(k, (x, 0.0, 50.0), (x, 0.0, 50.0)) for k, x in ((8, 900.0), (12, -500.0)))
    >>> nearest_landing((0.0, 0.0, 50.0), [far, near]).item, nearest_landing((0.0, 0.0, 50.0), [])
    (12, None)
    """
    return min(landings, key=lambda one: math.dist(here, one.mark), default=None)


# What is noted of a return that the autopilot flies on to a landing sequence, and its route does not.
RETURN_NOT_FLOWN_ON = "the return is not flown on to it"
# A turn whose tangent is shorter than this (m) is none.
_NO_TURN = 1.0
# A return goes on from its circle within so much of its height, m.
_JOINS = 10.0
# A turn by more than this (rad) to one side is one of less to the other.
_TOO_FAR = 1.5 * math.pi


@dataclass(frozen=True, slots=True)
class ReturnRules:
    """How an autopilot returns to launch.

    height: over home, m, at which it comes home; NaN for the height that it has when it turns back.
    radius: of the circle there, m, negative to the left; 0 for a radius of the aircraft's own.
    climb_first: height that it gains before it turns with all its bank, m; inf for all that is missing, 0 for none.
    first_bank: bank limit meanwhile, rad.
    sink: fastest descent, m/s.
    least_slope: m; a slope that falls less is flown as a step, at once.
    rally_limit: m; a nearest rally point further away than this is not flown to; 0 for no limit.
    includes_home: whether home counts where it is nearer than every rally point.
    slope_to_stated_height: whether the slope down to a rally point is drawn to its height over home as if that were a
        height above the sea, and flown no higher than where it begins.  ArduPlane 4.6-dev does that: it holds its
        height at first, and comes down later than a straight slope to the point would have it.
    rally_height: over a rally point's own height, m, at which it comes there.
    landing_counts: whether a mission's landing is a place that it returns to, which is noted and not flown.
    instead: what of its own rules is flown otherwise, a note for people; "" for nothing.
    lands: whether it goes on to a landing sequence of the mission: "circle" for by its circle at home or a rally point,
        "straight" for at once; "" where it stays in its circle.
    holds_height: whether it holds its height until it is over its target and comes down in circles there, and climbs,
        if it has to, in circles where it is, as PX4 does.

    >>> ReturnRules().height, ReturnRules().rally_limit
    (100.0, 5000.0)
    """

    height: float = 100.0
    radius: float = 0.0
    climb_first: float = 0.0
    first_bank: float = math.radians(5.0)
    sink: float = math.inf
    least_slope: float = 15.0
    rally_limit: float = 5000.0
    includes_home: bool = False
    slope_to_stated_height: bool = False
    holds_height: bool = False
    rally_height: float = 0.0
    landing_counts: bool = False
    instead: str = ""
    lands: Literal["", "circle", "straight"] = ""


# A slope drawn to so far (m) below its target, and flown no higher than where it begins, is none until the very end.
_FAR_BELOW = 1e6
# Of an autopilot that has none of its own: planfly's guidance returns as ArduPlane does by its defaults.
USUAL_RULES = ReturnRules()


class ReturnTarget(NamedTuple):
    """Where a return goes.

    position: east, north, up of the circle's middle, m.
    name: "home" or "rally point 2", counted from 1 as they stand in the file.
    reason: why there, a clause for people; "" where there is nothing to choose.
    distance: m, across the ground.
    slope_base: as of `ReturnCircle`.
    landing: the landing sequence that it goes on to, None for none.
    straight: whether it goes there at once, and ``position`` is where that begins.
    """

    position: Place
    name: str
    reason: str
    distance: float
    slope_base: float = 0.0
    landing: LandingStart | None = None
    straight: bool = False


class ReturnAbility(NamedTuple):
    """What the aircraft can, for the way back to be drawn.

    turn_radius: of an arc at the bank limit between two courses (rad) at a height (m AMSL), m.
    circle: least radius of a circle, m.
    climb, dive: tangents of slopes that it can hold in any direction and in turns.
    max_bank: rad.
    airspeed: m/s.
    """

    turn_radius: Callable[[float, float, float], float]
    circle: float
    climb: float
    dive: float
    max_bank: float
    airspeed: float


def choose_target(rules: ReturnRules, here: Place, home: ReturnPlace, rally: Sequence[ReturnPlace]) -> ReturnTarget:
    """The place that a return from ``here`` goes to: the nearest rally point, or home.

    A limit counts for the nearest rally point alone: beyond it the return goes home, however far home is.
    here: east, north, up, m AMSL.

    >>> home, near, far = (ReturnPlace(*at) for at in ((300.0, 0.0, 400.0), (1000.0, 0.0, 500.0), (0.0, 5000.0, 500.0)))
    >>> choose_target(ReturnRules(), (0.0, 0.0, 700.0), home, [far, near])[:3]
    ((1000.0, 0.0, 500.0), 'rally point 2', 'the nearest of 2 rally points')
    >>> choose_target(ReturnRules(rally_limit=900.0), (0.0, 0.0, 700.0), home, [near])[:2]
    ((300.0, 0.0, 500.0), 'home')
    """
    height = here[2] if math.isnan(rules.height) else home.up + rules.height
    to_home = _distance(here, home)
    go_home = ReturnTarget((home.east, home.north, height), "home", "", to_home, _FAR_BELOW * rules.holds_height)
    if not rally:
        return go_home
    nearest = min(range(len(rally)), key=lambda k: _distance(here, rally[k]))
    away = _distance(here, rally[nearest])
    name = f"rally point {rally[nearest].number or nearest + 1}"
    if 0.0 < rules.rally_limit < away:
        reason = f"{name}, the nearest, is {_km(away)} away, beyond RALLY_LIMIT_KM {rules.rally_limit / 1000.0:g}"
        return go_home._replace(reason=reason)
    if rules.includes_home and to_home <= away:
        why = "" if rules.holds_height else " (RALLY_INCL_HOME 1)"
        return go_home._replace(reason=f"nearer than {name}, which is {_km(away)} away{why}")
    count = f"of {len(rally)} rally points" if len(rally) > 1 else "rally point"
    point = rally[nearest]
    base = point.base if rules.slope_to_stated_height else _FAR_BELOW * rules.holds_height
    return ReturnTarget(
        (point.east, point.north, point.up + rules.rally_height), name, f"the nearest {count}", away, base
    )


def described_return(target: ReturnTarget, rules: ReturnRules, up: float, onward: str = "") -> str:
    """What a return does, a note for people.

    up: height (m AMSL) at which it begins.  onward: what it goes on to from its circle, "" where it stays.

    >>> described_return(ReturnTarget((0.0, 0.0, 435.0), "home", "", 3210.0), ReturnRules(), 1090.0)
    'NAV_RETURN_TO_LAUNCH: to home, 3.2 km away, sinking 655 m on a straight slope to 435 m AMSL; circles for 60 s; ...'
    """
    rise = target.position[2] - up
    reason = f" ({target.reason})" if target.reason else ""
    way = f"sinking {-rise:.0f} m on a straight slope to" if rise <= -1.0 else f"climbing {rise:.0f} m at once to"
    if -rise >= 1.0 and abs(target.slope_base - rise) < rules.least_slope:
        way = f"sinking {-rise:.0f} m at once to"
    if rules.holds_height:
        way = f"climbing {rise:.0f} m first, to"
        if rise < 0.0:
            way = f"level, and sinking {-rise:.0f} m in circles there, to"
    if abs(rise) < 1.0:
        way = "at"
    first = ""
    if rules.climb_first > 0.0 and not (math.isinf(rules.climb_first) and rise < -1.0):
        bank = math.degrees(rules.first_bank)
        first = f"; banks no more than {bank:.0f} degrees before it has climbed {min(rules.climb_first, rise):.0f} m"
        if math.isinf(rules.climb_first) and rise <= 1.0:
            first = f"; banks no more than {bank:.0f} degrees until it is above that height"
        if rise < rules.climb_first < math.inf:
            first = (
                f"; banks no more than {bank:.0f} degrees all the way, as it never climbs the"
                f" {rules.climb_first:.0f} m of RTL_CLIMB_MIN"
            )
    ends = f"from its circle on to {onward}" if onward else f"circles for {UNLIMITED:.0f} s; the mission ends there"
    return (
        f"NAV_RETURN_TO_LAUNCH: to {target.name}, {_km(target.distance)} away{reason}, {way}"
        f" {target.position[2]:.0f} m AMSL{first}; {ends}"
    )


def lay_return(
    before: Sequence[RoutePoint],
    stop: ItineraryStop,
    target: ReturnTarget,
    rules: ReturnRules,
    ability: ReturnAbility,
    onward: Place | None = None,
) -> list[RoutePoint]:
    """Waypoints of a return: its turn, its straight way, and the circle at its end.

    before: the route so far; the return begins at its last point, on the course of its last leg.
    stop: the return's.
    onward: where it goes on to from its circle, as soon as it has its height there; None where it stays.

    The turn goes the short way.  Heights of a descent are on the straight slope from where the turn begins to the
    target, by the place along that line, no steeper than the aircraft can; a climb or a small fall begins at once.
    What is missing at the circle is climbed or sunk there, and then the circle is flown for
    `flight.mission.itinerary.UNLIMITED` s.
    """
    here = before[-1].position
    course = _course(before[-2].position, here) if len(before) > 1 else _course(here, target.position)
    radius = math.copysign(max(abs(rules.radius), ability.circle), rules.radius)
    circle = Node(stop, *target.position, radius)
    dive = min(ability.dive, rules.sink / ability.airspeed)
    plan = _Plan(circle, target.slope_base, rules.least_slope, ability, dive, here, onward)
    if _distance(here, target.position) <= abs(radius) + _NO_TURN:
        # So near that it is on the circle as soon as it is across it.
        plan.circle_from(*_rim_ahead(here, course, circle))
        return plan.points
    course = plan.turn_gently(course, rules)
    plan.turn(course)
    return plan.points


class _Plan:
    """The waypoints so far.

    at: the last place.  slope_from: where the slope begins.
    """

    def __init__(
        self,
        circle: Node,
        slope_base: float,
        least_slope: float,
        ability: ReturnAbility,
        dive: float,
        here: Place,
        onward: Place | None,
    ) -> None:
        self.points: list[RoutePoint] = []
        self._stop, self._circle, self._slope_base = circle.stop, circle, slope_base
        self._least_slope, self._ability, self._dive, self._onward = least_slope, ability, dive, onward
        self._at = self._slope_from = here

    @property
    def _is_step(self) -> bool:
        return abs(self._slope_from[2] - self._circle.up + self._slope_base) < self._least_slope

    @property
    def _rise(self) -> float:
        return self._circle.up - self._at[2]

    def turn_gently(self, course: float, rules: ReturnRules) -> float:
        """Fly the arc at the first bank limit, for as long as that counts; returns the course at its end."""
        climb = min(rules.climb_first, max(0.0, self._rise)) if math.isinf(rules.climb_first) else rules.climb_first
        if climb <= 0.0:
            return course
        wide = self._ability.turn_radius(course, course + math.pi, self._at[2])
        wide *= math.tan(self._ability.max_bank) / math.tan(max(1e-3, rules.first_bank))
        arc = self._arc(course, wide)
        if arc is None:
            return course
        node, part, onward = arc
        # A height that is never reached is never climbed.
        length = climb / self._ability.climb if self._rise >= climb else math.inf
        sweep = min(part, length / wide)
        self._add_arc(node, course, sweep)
        end = course + math.copysign(sweep, node.turn)
        self._add(*on_rim(node, end), 0.0)
        self._slope_from = self._at
        return onward if sweep == part else end

    def turn(self, course: float) -> None:
        """Fly the turn to the target, the straight way, and the circle there."""
        bearing = _course(self._at, (self._circle.east, self._circle.north, 0.0))
        arc = self._arc(course, self._ability.turn_radius(course, bearing, self._at[2]))
        point = Node(self._stop, *self._at)
        if arc is None:
            # No way leads from the turn to the circle: the corner stays sharp.
            onward = tangent_course(point, self._circle)
        else:
            node, part, onward = arc
            if abs(node.turn) * math.tan(0.5 * min(part, CORNER)) > _NO_TURN:
                self._add_arc(node, course, part)
                self._add(*on_rim(node, onward), 0.0)
            else:
                onward = tangent_course(point, self._circle)
        self._straight(onward)
        self.circle_from(*on_rim(self._circle, onward), onward)

    def _straight(self, onward: float) -> None:
        """A waypoint where a climb or a step ends on the straight way, or where a height held first begins to fall."""
        join = on_rim(self._circle, onward)
        run = math.hypot(join[0] - self._at[0], join[1] - self._at[1])
        if self._rise > 0.0:
            needed = self._rise / self._ability.climb
        elif self._is_step:
            needed = -self._rise / self._dive
        else:
            fall = self._slope_from[2] - self._circle.up
            begins = self._slope_base / max(1e-6, fall + self._slope_base)
            first, last = self._share(*self._at[:2]), self._share(*join)
            needed = run * (begins - first) / max(1e-6, last - first)
        if _NO_TURN < needed < run - _NO_TURN:
            east, north = (a + needed / run * (b - a) for a, b in zip(self._at[:2], join, strict=True))
            self._add(east, north, 0.0)

    def circle_from(self, east: float, north: float, course: float) -> None:
        """Fly to a place on the circle, and around it until its height is reached and its time is over."""
        if math.hypot(east - self._at[0], north - self._at[1]) > _NO_TURN:
            self._add(east, north, 0.0)
        radius = abs(self._circle.turn)
        missing = self._rise
        spiral = abs(missing) / (self._ability.climb if missing > 0.0 else self._dive) / radius
        if self._onward is not None:
            self._go_on(course, spiral if abs(missing) > _JOINS else 0.0, self._onward)
            return
        sweep = spiral + max(2.0 * math.pi, UNLIMITED * self._ability.airspeed / radius)
        self._add_circle(course, sweep)

    def _add_circle(self, course: float, sweep: float) -> None:
        self._add_arc(self._circle, course, sweep, on_circle=True)
        self._add(*on_rim(self._circle, course + math.copysign(sweep, self._circle.turn)), 0.0, on_circle=True)

    def _go_on(self, course: float, spiral: float, onward: Place) -> None:
        """Fly around the circle until its height is reached, and turn the short way to a place from there."""
        if spiral > 0.0:
            self._add_circle(course, spiral)
            course += math.copysign(spiral, self._circle.turn)
        self._circle = Node(self._stop, onward[0], onward[1], self._at[2])
        radius = self._ability.turn_radius(course, _course(self._at, onward), self._at[2])
        arc = self._arc(course, radius)
        if arc is not None and radius * math.tan(0.5 * min(arc[1], CORNER)) > _NO_TURN:
            node, part, end = arc
            self._add_arc(node, course, part, on_circle=True)
            self._add(*on_rim(node, end), 0.0, on_circle=True)

    def _arc(self, course: float, radius: float) -> tuple[Node, float, float] | None:
        """The arc from here to the tangent of the target's circle: its circle, its angle, and the course it ends on.

        The short way; None where no tangent leads on.
        """
        off = float(wrap(_course(self._at, (self._circle.east, self._circle.north, 0.0)) - course))
        side = math.copysign(1.0, off)
        found = [one for one in (self._arc_to(course, side * radius), self._arc_to(course, -side * radius)) if one]
        return next((one for one in found if one[1] < _TOO_FAR), None)

    def _arc_to(self, course: float, turn: float) -> tuple[Node, float, float] | None:
        east, north, up = self._at
        node = Node(self._stop, east + turn * math.cos(course), north - turn * math.sin(course), up, turn)
        if not is_joined(node, self._circle):
            return None
        onward = tangent_course(node, self._circle)
        return node, (math.copysign(1.0, turn) * (onward - course)) % (2.0 * math.pi), onward

    def _add_arc(self, node: Node, course: float, sweep: float, *, on_circle: bool = False) -> None:
        for east, north in circle_corners(node, course, sweep):
            self._add(east, north, abs(node.turn), on_circle=on_circle)

    def _add(self, east: float, north: float, arc: float, *, on_circle: bool = False) -> None:
        """Add a waypoint at the height that the return has there."""
        run = math.hypot(east - self._at[0], north - self._at[1])
        up, end = self._at[2], self._circle.up
        if end >= up:
            up = min(end, up + self._ability.climb * run)
        else:
            wanted = end if on_circle else self._on_slope(east, north)
            up = max(min(up, wanted), up - self._dive * run)
        self._at = (east, north, up)
        self.points.append(RoutePoint(self._stop, self._at, arc))

    def _on_slope(self, east: float, north: float) -> float:
        """Height of the straight slope to the target beside a place, or that of its end where it is a step."""
        start, end = self._slope_from[2], self._circle.up
        if self._is_step:
            return end
        left = 1.0 - min(1.0, max(0.0, self._share(east, north)))
        return min(start, end + left * (start - end + self._slope_base))

    def _share(self, east: float, north: float) -> float:
        """Share of the slope's line that lies behind a place."""
        from_e, from_n, _ = self._slope_from
        along_e, along_n = self._circle.east - from_e, self._circle.north - from_n
        return ((east - from_e) * along_e + (north - from_n) * along_n) / max(1e-6, along_e**2 + along_n**2)


def _rim_ahead(here: Place, course: float, circle: Node) -> tuple[float, float, float]:
    """Where a straight way from inside a circle meets it, and the course around it there."""
    off_e, off_n = here[0] - circle.east, here[1] - circle.north
    along = off_e * math.sin(course) + off_n * math.cos(course)
    ahead = -along + math.sqrt(max(0.0, along * along + circle.turn * circle.turn - off_e * off_e - off_n * off_n))
    east, north = here[0] + ahead * math.sin(course), here[1] + ahead * math.cos(course)
    outwards = math.atan2(east - circle.east, north - circle.north)
    return east, north, outwards + math.copysign(0.5 * math.pi, circle.turn)


def _course(a: Place, b: Place) -> float:
    return math.atan2(b[0] - a[0], b[1] - a[1])


def _distance(a: Place, b: Place | ReturnPlace) -> float:
    return math.hypot(b[0] - a[0], b[1] - a[1])


def _km(distance: float) -> str:
    return f"{distance / 1000.0:.1f} km" if distance >= 1000.0 else f"{distance:.0f} m"
