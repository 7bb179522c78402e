"""Return to launch on the map: choose its destination, and lay out the path for the route.

An autopilot returns by its own control law, which no mission spells out: it turns at once, flies straight to the
nearest rally point or home, descends on a straight slope or climbs as fast as it can, and loiters there. `ReturnRules`
states that law in numbers. The path uses the same pieces as any other: an arc, a straight leg, a loiter.

The rules follow ArduPlane 4.6 (`ModeRTL` in ArduPlane/mode_rtl.cpp, `Plane::do_RTL` in commands_logic.cpp,
`AP_Rally::calc_best_rally_or_home_location` in libraries/AP_Rally/AP_Rally.cpp, `Plane::setup_glide_slope` in
ArduPlane/altitude.cpp), and messages use ArduPlane's parameter names.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from flight.mission.itinerary import UNLIMITED, ItineraryStop
from flight.mission.loiter_circles import CORNER, Node, RoutePoint, circle_corners, is_joined, on_rim, tangent_course
from world.geometry import wrap

# East, north, up, m.
Place = tuple[float, float, float]


class ReturnPlace(NamedTuple):
    """Home or a rally point on the map.

    east, north, up: m, up AMSL; home's altitude is the ground altitude there.
    base: altitude that the stated altitude is relative to, m AMSL: home's altitude, or 0 for one stated AMSL.
    number: number of a rally point in its file, from 1; 0 if it has none.
    """

    east: float
    north: float
    up: float
    base: float = 0.0
    number: int = 0


class ReturnCircle(NamedTuple):
    """Loiter at the end of a return, as the autopilot reads it.

    east, north, up: center, m, up AMSL.
    radius: m at sea level, negative for a left-hand loiter.
    slope_base: offset by which the autopilot draws the descent slope below the true target, m; 0 except for ArduPlane's
        rally points.
    """

    east: float
    north: float
    up: float
    radius: float
    slope_base: float = 0.0


class LandingStart(NamedTuple):
    """Start of a mission's landing sequence: the first item to fly to after a DO_LAND_START.

    item: number of that mission item.
    place: its east, north, up, m AMSL.
    mark: east, north, up that the distance to the sequence is measured to: the place that DO_LAND_START states, if any.
    circles: True if the item is a loiter.
    radius: loiter radius, m, negative to the left, 0 if none is stated.
    lands: True if the item is the landing itself.
    onward: the places after it up to the landing; their own ``onward`` is empty.
    pass_by: distance that ArduPlane flies on beyond the place, m.
    home_up: altitude of home, m AMSL, NaN if unknown.
    """

    item: int
    place: Place
    mark: Place
    circles: bool = False
    radius: float = 0.0
    lands: bool = False
    onward: tuple["LandingStart", ...] = ()
    pass_by: float = 0.0
    home_up: float = math.nan


def nearest_landing(here: Place, landings: Sequence[LandingStart]) -> LandingStart | None:
    """Return the landing sequence that ArduPlane chooses at a position (east, north, up), the nearest in 3D.

    It follows `AP_Mission::get_landing_sequence_start` (libraries/AP_Mission/AP_Mission.cpp). Return None without any.

    >>> far, near = (LandingStart(k, (x, 0.0, 50.0), (x, 0.0, 50.0)) for k, x in ((8, 900.0), (12, -500.0)))
    >>> nearest_landing((0.0, 0.0, 50.0), [far, near]).item, nearest_landing((0.0, 0.0, 50.0), [])
    (12, None)
    """
    return min(landings, key=lambda one: math.dist(here, one.mark), default=None)


# Note on a return that the autopilot continues to a landing sequence, and that the route does not.
RETURN_NOT_FLOWN_ON = "the return does not continue to it"
# A turn with a tangent shorter than this is omitted, m.
_MIN_TANGENT_M = 1.0
# Altitude tolerance for leaving the loiter to join the landing sequence, m.
_LANDING_JOIN_TOLERANCE_M = 10.0
# A turn by more than this angle to one side is flown as a smaller turn to the other side, rad.
_MAX_TURN_ANGLE_RAD = 1.5 * math.pi


@dataclass(frozen=True, slots=True)
class ReturnRules:
    """Rules by which an autopilot returns to launch.

    height: height above home at the end of the return, m; NaN to keep the altitude at which it turns back.
    radius: loiter radius there, m, negative to the left; 0 for the aircraft's own radius.
    climb_first: height gain before it turns with its full bank limit, m, even above its target; inf for the whole
        missing height, 0 for none.
    first_bank: bank limit during that climb, rad.
    sink: maximum descent rate, m/s.
    least_slope: height difference below which a descent is flown as a step, at once, m.
    rally_limit: maximum distance to the nearest rally point that is flown to, m; 0 for no limit.
    includes_home: True if home is chosen where it is nearer than every rally point.
    slope_to_stated_height: True if the slope down to a rally point is drawn as if its height above home were an
        altitude AMSL, and flown no higher than its start. ArduPlane 4.6-dev does that: it holds its altitude first, and
        descends later than on a straight slope to the point.
    rally_height: height above a rally point's own altitude at the end of the return, m.
    landing_counts: True if a mission's landing is a place to return to, which is noted and not flown.
    instead: note for people on which of the autopilot's rules are flown differently; "" for none.
    lands: "circle" if it continues to a landing sequence by a loiter at home or a rally point, "straight" if it does so
        at once, "" if it stays in its loiter.
    holds_height: True if it holds its altitude until it is over its target and descends in circles there, and climbs,
        if necessary, in circles at its start, as PX4 does.

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


# Slope base that puts the target of a slope far below, m: a slope flown no higher than its start is then level.
_LEVEL_SLOPE_BASE_M = 1e6
# Rules of an autopilot without its own: planfly's guidance returns as ArduPlane does with its default parameters.
USUAL_RULES = ReturnRules()


class ReturnTarget(NamedTuple):
    """Destination of a return.

    position: east, north, up of the loiter's center, m.
    name: "home" or "rally point 2", numbered from 1 in the order of the file.
    reason: reason for this choice, a clause for people; "" if there is no choice.
    distance: horizontal distance, m.
    slope_base: see `ReturnCircle`.
    landing: landing sequence that it continues to, or None.
    straight: True if it goes there at once, and ``position`` is the start of the sequence.
    """

    position: Place
    name: str
    reason: str
    distance: float
    slope_base: float = 0.0
    landing: LandingStart | None = None
    straight: bool = False


class ReturnAbility(NamedTuple):
    """Abilities of the aircraft that the return path depends on.

    turn_radius: radius of an arc at the bank limit between two courses (rad) at an altitude (m AMSL), m.
    circle: smallest loiter radius, m.
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
    """Return the destination of a return from ``here``: the nearest rally point, or home.

    The distance limit applies to the nearest rally point only: beyond it the return goes home, at any distance.
    here: east, north, up, m AMSL.

    >>> home, near, far = (ReturnPlace(*at) for at in ((300.0, 0.0, 400.0), (1000.0, 0.0, 500.0), (0.0, 5000.0, 500.0)))
    >>> choose_target(ReturnRules(), (0.0, 0.0, 700.0), home, [far, near])[:3]
    ((1000.0, 0.0, 500.0), 'rally point 2', 'the nearest of 2 rally points')
    >>> choose_target(ReturnRules(rally_limit=900.0), (0.0, 0.0, 700.0), home, [near])[:2]
    ((300.0, 0.0, 500.0), 'home')
    """
    height = here[2] if math.isnan(rules.height) else home.up + rules.height
    to_home = _distance(here, home)
    go_home = ReturnTarget(
        (home.east, home.north, height), "home", "", to_home, _LEVEL_SLOPE_BASE_M * rules.holds_height
    )
    if not rally:
        return go_home
    nearest = min(range(len(rally)), key=lambda k: _distance(here, rally[k]))
    away = _distance(here, rally[nearest])
    name = f"rally point {rally[nearest].number or nearest + 1}"
    if 0.0 < rules.rally_limit < away:
        reason = (
            f"{name}, the nearest, is {_distance_text(away)} away, beyond RALLY_LIMIT_KM {rules.rally_limit / 1000.0:g}"
        )
        return go_home._replace(reason=reason)
    if rules.includes_home and to_home <= away:
        why = "" if rules.holds_height else " (RALLY_INCL_HOME 1)"
        return go_home._replace(reason=f"nearer than {name}, which is {_distance_text(away)} away{why}")
    count = f"of {len(rally)} rally points" if len(rally) > 1 else "rally point"
    point = rally[nearest]
    base = point.base if rules.slope_to_stated_height else _LEVEL_SLOPE_BASE_M * rules.holds_height
    return ReturnTarget(
        (point.east, point.north, point.up + rules.rally_height), name, f"the nearest {count}", away, base
    )


def described_return(target: ReturnTarget, rules: ReturnRules, up: float, onward: str = "") -> str:
    """Describe a return in a note for people.

    up: altitude at which it begins, m AMSL.
    onward: what it continues to from its loiter, "" if it stays.

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
        gain = rise if math.isinf(rules.climb_first) else rules.climb_first
        first = f"; banks no more than {bank:.0f} degrees before it has climbed {gain:.0f} m"
        if math.isinf(rules.climb_first) and rise <= 1.0:
            first = f"; banks no more than {bank:.0f} degrees until it is above that height"
        if gain > max(0.0, rise):
            first += ", even above that height"
    ends = f"from its circle on to {onward}" if onward else f"circles for {UNLIMITED:.0f} s; the mission ends there"
    return (
        f"NAV_RETURN_TO_LAUNCH: to {target.name}, {_distance_text(target.distance)} away{reason}, {way}"
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
    """Return the waypoints of a return's turn, its straight leg, and the loiter at its end.

    before: the route up to the return, which begins at its last point, on the course of its last leg.
    stop: the itinerary stop of the return.
    onward: where it continues to from its loiter as soon as it has its altitude there; None if it stays.

    The turn takes the shorter direction. Altitudes of a descent lie on the straight slope from the start of the turn to
    the target, by the position along that line, no steeper than the aircraft can fly; a climb or a small descent begins
    at once. The remaining height difference is flown in the loiter, which then lasts
    `flight.mission.itinerary.UNLIMITED` s.  A climb before the turn is flown whatever the target's altitude is.
    """
    here = before[-1].position
    course = _course(before[-2].position, here) if len(before) > 1 else _course(here, target.position)
    radius = math.copysign(max(abs(rules.radius), ability.circle), rules.radius)
    circle = Node(stop, *target.position, radius)
    dive = min(ability.dive, rules.sink / ability.airspeed)
    plan = _ReturnBuilder(circle, target.slope_base, rules.least_slope, ability, dive, here, onward)
    if _distance(here, target.position) <= abs(radius) + _MIN_TANGENT_M:
        # The return starts inside the loiter: fly straight on to its circle.
        plan.circle_from(*_rim_ahead(here, course, circle))
        return plan.points
    course = plan.turn_gently(course, rules)
    plan.turn(course)
    return plan.points


class _ReturnBuilder:
    """Builder of the waypoints of a return."""

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
        # Altitude of the climb before the turn, m; it may lie above the target.
        self._first_climb_to = -math.inf

    @property
    def _is_step(self) -> bool:
        return abs(self._slope_from[2] - self._circle.up + self._slope_base) < self._least_slope

    @property
    def _height_difference(self) -> float:
        return self._circle.up - self._at[2]

    def turn_gently(self, course: float, rules: ReturnRules) -> float:
        """Fly the arc at the first bank limit while that limit applies, and return the course at its end."""
        climb = max(0.0, self._height_difference) if math.isinf(rules.climb_first) else rules.climb_first
        if climb <= 0.0:
            return course
        wide = self._ability.turn_radius(course, course + math.pi, self._at[2])
        wide *= math.tan(self._ability.max_bank) / math.tan(max(1e-3, rules.first_bank))
        arc = self._turn_to_tangent(course, wide)
        if arc is None:
            return course
        node, part, onward = arc
        sweep = min(part, climb / self._ability.climb / wide)
        self._first_climb_to = self._at[2] + climb
        self._add_arc(node, course, sweep)
        end = course + math.copysign(sweep, node.turn)
        self._add_waypoint(*on_rim(node, end), 0.0)
        if sweep == part and self._first_climb_to > self._circle.up:
            self._climb_on(onward)
        self._first_climb_to, self._slope_from = -math.inf, self._at
        return onward if sweep == part else end

    def _climb_on(self, course: float) -> None:
        """Fly straight on to the end of the first climb, or to the loiter if that is nearer."""
        east, north = on_rim(self._circle, course)
        run = (self._first_climb_to - self._at[2]) / self._ability.climb
        run = min(run, math.hypot(east - self._at[0], north - self._at[1]) - _MIN_TANGENT_M)
        if run > _MIN_TANGENT_M:
            self._add_waypoint(self._at[0] + run * math.sin(course), self._at[1] + run * math.cos(course), 0.0)

    def turn(self, course: float) -> None:
        """Fly the turn to the target, the straight leg, and the loiter there."""
        bearing = _course(self._at, (self._circle.east, self._circle.north, 0.0))
        arc = self._turn_to_tangent(course, self._ability.turn_radius(course, bearing, self._at[2]))
        point = Node(self._stop, *self._at)
        if arc is None:
            # No tangent leads from the turn to the loiter: the corner stays sharp.
            onward = tangent_course(point, self._circle)
        else:
            node, part, onward = arc
            if abs(node.turn) * math.tan(0.5 * min(part, CORNER)) > _MIN_TANGENT_M:
                self._add_arc(node, course, part)
                self._add_waypoint(*on_rim(node, onward), 0.0)
            else:
                onward = tangent_course(point, self._circle)
        self._add_slope_break(onward)
        self.circle_from(*on_rim(self._circle, onward), onward)

    def _add_slope_break(self, onward: float) -> None:
        """Add a waypoint on the straight leg where a climb or step ends, or a held altitude begins to fall."""
        join = on_rim(self._circle, onward)
        run = math.hypot(join[0] - self._at[0], join[1] - self._at[1])
        if self._height_difference > 0.0:
            needed = self._height_difference / self._ability.climb
        elif self._is_step:
            needed = -self._height_difference / self._dive
        else:
            fall = self._slope_from[2] - self._circle.up
            begins = self._slope_base / max(1e-6, fall + self._slope_base)
            first, last = self._slope_fraction(*self._at[:2]), self._slope_fraction(*join)
            needed = run * (begins - first) / max(1e-6, last - first)
        if _MIN_TANGENT_M < needed < run - _MIN_TANGENT_M:
            east, north = (a + needed / run * (b - a) for a, b in zip(self._at[:2], join, strict=True))
            self._add_waypoint(east, north, 0.0)

    def circle_from(self, east: float, north: float, course: float) -> None:
        """Fly to a point on the circle, and around it until its altitude is reached and its time is over."""
        if math.hypot(east - self._at[0], north - self._at[1]) > _MIN_TANGENT_M:
            self._add_waypoint(east, north, 0.0)
        radius = abs(self._circle.turn)
        missing = self._height_difference
        spiral = abs(missing) / (self._ability.climb if missing > 0.0 else self._dive) / radius
        if self._onward is not None:
            self._continue_to(course, spiral if abs(missing) > _LANDING_JOIN_TOLERANCE_M else 0.0, self._onward)
            return
        sweep = spiral + max(2.0 * math.pi, UNLIMITED * self._ability.airspeed / radius)
        self._add_circle(course, sweep)

    def _add_circle(self, course: float, sweep: float) -> None:
        self._add_arc(self._circle, course, sweep, on_circle=True)
        self._add_waypoint(*on_rim(self._circle, course + math.copysign(sweep, self._circle.turn)), 0.0, on_circle=True)

    def _continue_to(self, course: float, spiral: float, onward: Place) -> None:
        """Fly around the circle until its altitude is reached, and turn towards a place.

        The turn takes the shorter direction.
        """
        if spiral > 0.0:
            self._add_circle(course, spiral)
            course += math.copysign(spiral, self._circle.turn)
        self._circle = Node(self._stop, onward[0], onward[1], self._at[2])
        radius = self._ability.turn_radius(course, _course(self._at, onward), self._at[2])
        arc = self._turn_to_tangent(course, radius)
        if arc is not None and radius * math.tan(0.5 * min(arc[1], CORNER)) > _MIN_TANGENT_M:
            node, part, end = arc
            self._add_arc(node, course, part, on_circle=True)
            self._add_waypoint(*on_rim(node, end), 0.0, on_circle=True)

    def _turn_to_tangent(self, course: float, radius: float) -> tuple[Node, float, float] | None:
        """Return the circle, angle and final course of the arc that leads to a tangent of the target's loiter.

        Choose the shorter direction; return None if no tangent leads on.
        """
        off = float(wrap(_course(self._at, (self._circle.east, self._circle.north, 0.0)) - course))
        side = math.copysign(1.0, off)
        found = [
            one
            for one in (self._turn_on_side(course, side * radius), self._turn_on_side(course, -side * radius))
            if one
        ]
        return next((one for one in found if one[1] < _MAX_TURN_ANGLE_RAD), None)

    def _turn_on_side(self, course: float, turn: float) -> tuple[Node, float, float] | None:
        east, north, up = self._at
        node = Node(self._stop, east + turn * math.cos(course), north - turn * math.sin(course), up, turn)
        if not is_joined(node, self._circle):
            return None
        onward = tangent_course(node, self._circle)
        return node, (math.copysign(1.0, turn) * (onward - course)) % (2.0 * math.pi), onward

    def _add_arc(self, node: Node, course: float, sweep: float, *, on_circle: bool = False) -> None:
        for east, north in circle_corners(node, course, sweep):
            self._add_waypoint(east, north, abs(node.turn), on_circle=on_circle)

    def _add_waypoint(self, east: float, north: float, arc: float, *, on_circle: bool = False) -> None:
        """Add a waypoint at the altitude that the return has at this position."""
        run = math.hypot(east - self._at[0], north - self._at[1])
        up, top = self._at[2], max(self._circle.up, self._first_climb_to)
        if top >= up:
            up = min(top, up + self._ability.climb * run)
        else:
            wanted = self._circle.up if on_circle else self._slope_altitude(east, north)
            up = max(min(up, wanted), up - self._dive * run)
        self._at = (east, north, up)
        self.points.append(RoutePoint(self._stop, self._at, arc))

    def _slope_altitude(self, east: float, north: float) -> float:
        """Return the altitude of the slope to the target at a point, or the target's altitude for a step."""
        start, end = self._slope_from[2], self._circle.up
        if self._is_step:
            return end
        left = 1.0 - min(1.0, max(0.0, self._slope_fraction(east, north)))
        return min(start, end + left * (start - end + self._slope_base))

    def _slope_fraction(self, east: float, north: float) -> float:
        """Return the fraction of the sloping line that lies behind a point."""
        from_e, from_n, _ = self._slope_from
        along_e, along_n = self._circle.east - from_e, self._circle.north - from_n
        return ((east - from_e) * along_e + (north - from_n) * along_n) / max(1e-6, along_e**2 + along_n**2)


def _rim_ahead(here: Place, course: float, circle: Node) -> tuple[float, float, float]:
    """Return the point where a straight path from inside a circle meets the circle, and its course on the circle."""
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


def _distance_text(distance: float) -> str:
    return f"{distance / 1000.0:.1f} km" if distance >= 1000.0 else f"{distance:.0f} m"
