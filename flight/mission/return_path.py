"""Choose the destination of an RTL (return to launch), and lay out its path for the route.

An autopilot flies an RTL by its own rules, which no mission states: it turns at once, flies straight to the nearest
rally point or home, descends on a straight slope or climbs as fast as it can, and loiters there. `ReturnRules` holds
these rules as numbers. The path consists of the usual pieces: an arc, a straight leg, a loiter.

The rules follow ArduPlane 4.6 (`ModeRTL` in ArduPlane/mode_rtl.cpp, `Plane::do_RTL` in commands_logic.cpp,
`AP_Rally::calc_best_rally_or_home_location` in libraries/AP_Rally/AP_Rally.cpp, `Plane::setup_glide_slope` in
ArduPlane/altitude.cpp), and messages use ArduPlane's parameter names.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from flight.mission.itinerary import ENDLESS_LOITER_TIME_S, Position, RoutePoint
from flight.mission.loiter_circles import (
    MAX_CORNER_ANGLE_RAD,
    circle_corners,
    is_joined,
    point_on_circle,
    tangent_course,
)
from world.geometry import wrap


class ReturnPoint(NamedTuple):
    """Home or a rally point on the map.

    east, north, up: m, up AMSL; home's altitude is the ground altitude there.
    base: reference of the stated altitude, m AMSL: home's altitude, or 0 for an altitude AMSL.
    number: number of a rally point in its file, from 1; 0 without a number.
    """

    east: float
    north: float
    up: float
    base: float = 0.0
    number: int = 0


class ReturnCircle(NamedTuple):
    """Loiter at the end of an RTL, as the autopilot reads it.

    east, north, up: center, m, up AMSL.
    radius: m at sea level, negative for a left-hand loiter.
    slope_base: height of the loiter above the end of ArduPlane's descent slope, m. It is not 0 only at a rally point
        whose height above home ArduPlane reads as an altitude AMSL (see `ReturnRules.slope_to_stated_height`); it is
        then home's altitude.
    """

    east: float
    north: float
    up: float
    radius: float
    slope_base: float = 0.0


class LandingStart(NamedTuple):
    """Start of a mission's landing sequence: the first navigation item after a DO_LAND_START.

    item: number of that mission item.
    position: east, north, up of the item, m AMSL.
    reference_position: east, north, up to which the distance of the sequence is measured: the position of
        DO_LAND_START, or of the item if DO_LAND_START states none.
    is_loiter: True if the item is a loiter.
    radius: loiter radius, m, negative to the left; 0 if not stated.
    is_landing: True if the item is the landing itself.
    next_stops: the next items up to the landing; their own ``next_stops`` is empty.
    pass_by: distance that ArduPlane flies past the item, m.
    home_up: altitude of home, m AMSL, NaN if unknown.
    to_altitude: True if the item is a loiter to an altitude.
    exits_on_course, exits_on_tangent: True if the loiter's item states such an exit to the next item.
    landing: east, north, up of the landing to which the sequence leads, m AMSL; None if it leads to none.
    """

    item: int
    position: Position
    reference_position: Position
    is_loiter: bool = False
    radius: float = 0.0
    is_landing: bool = False
    next_stops: tuple["LandingStart", ...] = ()
    pass_by: float = 0.0
    home_up: float = math.nan
    to_altitude: bool = False
    exits_on_course: bool = False
    exits_on_tangent: bool = False
    landing: Position | None = None


def nearest_landing_sequence(position: Position, landings: Sequence[LandingStart]) -> LandingStart | None:
    """Return the landing sequence that ArduPlane chooses at a position (east, north, up), or None.

    The result is None if there is no landing sequence. ArduPlane chooses the sequence with the shortest distance in
    three dimensions (`AP_Mission::get_landing_sequence_start` in libraries/AP_Mission/AP_Mission.cpp).

    >>> far, near = (LandingStart(k, (x, 0.0, 50.0), (x, 0.0, 50.0)) for k, x in ((8, 900.0), (12, -500.0)))
    >>> nearest_landing_sequence((0.0, 0.0, 50.0), [far, near]).item, nearest_landing_sequence((0.0, 0.0, 50.0), [])
    (12, None)
    """
    return min(landings, key=lambda landing: math.dist(position, landing.reference_position), default=None)


# End of a note on a landing sequence to which the autopilot continues after its RTL, but not the simulated flight.
RTL_NOT_CONTINUED_TEXT = "the return does not continue to it"
# Minimum tangent length of a turn, m; a smaller turn is omitted.
_MIN_TANGENT_M = 1.0
# Altitude tolerance for leaving the loiter to join the landing sequence, m.
_LANDING_JOIN_TOLERANCE_M = 10.0
# Maximum turn to one side, rad; a larger turn becomes a smaller turn to the other side.
_MAX_TURN_ANGLE_RAD = 1.5 * math.pi


@dataclass(frozen=True, slots=True)
class ReturnRules:
    """Rules by which an autopilot flies an RTL.

    height: height above home at the end of the RTL, m; NaN to keep the altitude of its start.
    radius: loiter radius at the end, m, negative to the left; 0 for the default radius of the aircraft.
    initial_climb: altitude gain, m, before which the aircraft does not bank further than ``initial_climb_bank``; inf
        for a climb to the target's altitude, 0 for none. A finite climb is flown even if it ends above the target.
    initial_climb_bank: bank limit during that climb, rad.
    max_sink_rate: m/s.
    min_slope_height: altitude difference below which a descent is a step instead of a slope, m.
    rally_limit: maximum distance to the nearest rally point, m, beyond which the RTL goes home; 0 for no limit.
    includes_home: True if home is chosen when it is nearer than any rally point, or the landing.
    slope_to_stated_height: True if the slope down to a rally point treats its height above home as an altitude AMSL,
        and is never higher than its start. ArduPlane 4.6-dev does that: it holds its altitude first, and
        descends later than on a straight slope to the point.
    transit_height: height above its target to which an RTL that holds its altitude climbs first, m; it then ends no
        higher than it flew.
    rally_height: height above a rally point's own altitude at the end of the RTL, m.
    may_use_landing: True if the RTL may go to a mission's landing, as PX4's may; an RTL that is an item of the mission
        is simulated without it, which is noted.
    deviation_note: note on rules of the autopilot that are simulated differently; "" for none.
    landing_join: "circle" if the RTL continues to a landing sequence from a loiter at home or a rally point, "straight"
        if it flies to the sequence directly, "" if it stays in its loiter.
    holds_height: True if the RTL holds its altitude until it is over its target and descends in circles there, and
        climbs, if necessary, in circles at its start, as PX4 does.

    >>> ReturnRules().height, ReturnRules().rally_limit
    (100.0, 5000.0)
    """

    height: float = 100.0
    radius: float = 0.0
    initial_climb: float = 0.0
    initial_climb_bank: float = math.radians(5.0)
    max_sink_rate: float = math.inf
    min_slope_height: float = 15.0
    rally_limit: float = 5000.0
    includes_home: bool = False
    slope_to_stated_height: bool = False
    holds_height: bool = False
    transit_height: float = 0.0
    rally_height: float = 0.0
    may_use_landing: bool = False
    deviation_note: str = ""
    landing_join: Literal["", "circle", "straight"] = ""


# Rules for an autopilot without RTL rules: planfly's guidance flies an RTL like ArduPlane with its default parameters.
DEFAULT_RETURN_RULES = ReturnRules()


class ReturnTarget(NamedTuple):
    """Destination of an RTL.

    position: east, north, up of the loiter's center, m.
    name: "home" or "rally point 2", numbered from 1 in the order of the file.
    reason: clause with the reason for this choice; "" without a choice.
    distance: horizontal distance, m.
    slope_base: see `ReturnCircle`.
    landing: landing sequence to which the RTL continues, or None.
    straight: True if the RTL flies there directly, and ``position`` is the start of the sequence.
    transit_altitude: altitude at which an RTL that holds its altitude flies there, m AMSL; NaN for a slope.
    """

    position: Position
    name: str
    reason: str
    distance: float
    slope_base: float = 0.0
    landing: LandingStart | None = None
    straight: bool = False
    transit_altitude: float = math.nan


class ReturnAbility(NamedTuple):
    """Abilities of the aircraft for the path of an RTL.

    turn_radius: radius of an arc at the bank limit between two courses (rad) at an altitude (m AMSL), m.
    min_loiter_radius: radius of the tightest circle that the aircraft can fly in the wind, m.
    climb_slope, dive_slope: steepest slopes (tangents) that the aircraft can hold in any direction and in turns.
    max_bank: rad.
    airspeed: m/s.
    loiter_radius_scale: ratio of the flown radius of the loiter to its stated radius.
    """

    turn_radius: Callable[[float, float, float], float]
    min_loiter_radius: float
    climb_slope: float
    dive_slope: float
    max_bank: float
    airspeed: float
    loiter_radius_scale: float = 1.0


def choose_target(
    rules: ReturnRules,
    start: Position,
    home: ReturnPoint,
    rally: Sequence[ReturnPoint],
    landings: Sequence[LandingStart] = (),
) -> ReturnTarget:
    """Choose the destination of an RTL: the nearest rally point, or home.

    If the nearest rally point is beyond the distance limit, the RTL goes home, however far away home is. An autopilot
    that may return to a mission's landing chooses the first landing if it is nearer than both.

    start: east, north, up at the start of the RTL, m AMSL.
    rally: the rally points.
    landings: the mission's landing sequences; sequences without a landing are ignored.

    >>> positions = (300.0, 0.0, 400.0), (1000.0, 0.0, 500.0), (0.0, 5000.0, 500.0)
    >>> home, near, far = (ReturnPoint(*position) for position in positions)
    >>> choose_target(ReturnRules(), (0.0, 0.0, 700.0), home, [far, near])[:3]
    ((1000.0, 0.0, 500.0), 'rally point 2', 'the nearest of 2 rally points')
    >>> choose_target(ReturnRules(rally_limit=900.0), (0.0, 0.0, 700.0), home, [near])[:2]
    ((300.0, 0.0, 500.0), 'home')
    """
    landing = None
    if rules.may_use_landing:
        landing = next((sequence for sequence in landings if sequence.landing is not None), None)
    transit, end = _transit_and_end_altitudes(rules, start, home.up, rules.height)
    position, home_distance = (home.east, home.north, end), _distance(start, home)
    home_target = ReturnTarget(position, "home", "", home_distance, transit_altitude=transit)
    if landing is not None:
        return _nearest_return_target(rules, start, home_target, rally, landing)
    if not rally:
        return home_target
    index = min(range(len(rally)), key=lambda k: _distance(start, rally[k]))
    distance = _distance(start, rally[index])
    name = f"rally point {rally[index].number or index + 1}"
    if 0.0 < rules.rally_limit < distance:
        reason = (
            f"{name}, the nearest, is {_distance_text(distance)} away,"
            f" {_distance_text(distance - rules.rally_limit)} beyond RALLY_LIMIT_KM {rules.rally_limit / 1000.0:g}"
        )
        return home_target._replace(reason=reason)
    if rules.includes_home and home_target.distance <= distance:
        parameter_text = "" if rules.holds_height else " (RALLY_INCL_HOME 1)"
        # Distances that round to the same text differ in the reason.
        nearer_by = distance - home_target.distance
        nearer_text = f"{_distance_text(nearer_by)} nearer than" if nearer_by >= 0.5 else "as near as"
        return home_target._replace(
            reason=f"{nearer_text} {name}, which is {_distance_text(distance)} away{parameter_text}"
        )
    rally_text = f"of {len(rally)} rally points" if len(rally) > 1 else "rally point"
    return rally_target(rules, start, rally[index])._replace(name=name, reason=f"the nearest {rally_text}")


def rally_target(rules: ReturnRules, start: Position, point: ReturnPoint) -> ReturnTarget:
    """Return a rally point as the destination of an RTL, even if the autopilot would choose another.

    >>> rules = ReturnRules(holds_height=True, transit_height=300.0, rally_height=100.0)
    >>> target = rally_target(rules, (0.0, 0.0, 700.0), ReturnPoint(1000.0, 0.0, 500.0))
    >>> target.position, target.transit_altitude
    ((1000.0, 0.0, 600.0), 800.0)
    """
    transit, end = _transit_and_end_altitudes(rules, start, point.up, rules.rally_height)
    slope_base = point.base if rules.slope_to_stated_height else 0.0
    return ReturnTarget(
        (point.east, point.north, end), "", "", _distance(start, point), slope_base, transit_altitude=transit
    )


def _transit_and_end_altitudes(rules: ReturnRules, start: Position, base: float, height: float) -> tuple[float, float]:
    """Return the altitude of an RTL on its way to the destination, and its altitude at the end, m AMSL.

    The first altitude is NaN for an RTL that does not hold its altitude.

    base: altitude of the destination, m AMSL.
    height: height above the destination at the end, m; NaN to keep the altitude of the start.
    """
    end = start[2] if math.isnan(height) else base + height
    if not rules.holds_height:
        return math.nan, end
    # The aircraft never descends before it is over its destination (PX4's `rtl.cpp` and `rtl_direct.cpp`).
    transit = max(start[2], base + rules.transit_height)
    return transit, min(end, transit)


def _nearest_return_target(
    rules: ReturnRules,
    start: Position,
    home_target: ReturnTarget,
    rally: Sequence[ReturnPoint],
    landing: LandingStart,
) -> ReturnTarget:
    """Return the nearest destination: the landing, a rally point or, if the rules include it, home.

    The distance to the mission's landing is measured to its landing point (`RTL::findRtlDestination` in PX4's
    `rtl.cpp`).

    start: east, north, up at the start of the RTL, m AMSL.
    home_target: home as a destination.
    """
    point = ReturnPoint(*(landing.landing or landing.position))
    transit, _ = _transit_and_end_altitudes(rules, start, point.up, 0.0)
    name = f"the landing sequence at item {landing.item}"
    targets = [
        ReturnTarget(
            landing.position,
            name,
            "",
            _distance(start, point),
            landing=landing,
            straight=True,
            transit_altitude=transit,
        ),
        *([home_target] if rules.includes_home else []),
        *(
            rally_target(rules, start, place)._replace(name=f"rally point {place.number or k}")
            for k, place in enumerate(rally, 1)
        ),
    ]
    nearest = min(targets, key=lambda target: target.distance)
    return nearest._replace(reason=f"the nearest of {len(targets)} places") if len(targets) > 1 else nearest


def rtl_note(target: ReturnTarget, rules: ReturnRules, start_altitude: float, continuation: str = "") -> str:
    """Describe an RTL in one note: destination, distance, altitude change, and what follows.

    start_altitude: altitude at the start of the RTL, m AMSL.
    continuation: name of the sequence after the loiter; "" if the RTL stays in the loiter.

    >>> rtl_note(ReturnTarget((0.0, 0.0, 435.0), "home", "", 3210.0), ReturnRules(), 1090.0)
    'NAV_RETURN_TO_LAUNCH returns to home, 3.2 km away, descending 655 m on a straight slope to 435 m AMSL; ...'
    """
    altitude_gain = target.position[2] - start_altitude
    reason = f" ({target.reason})" if target.reason else ""
    altitude_text = (
        f"descending {-altitude_gain:.0f} m on a straight slope to"
        if altitude_gain <= -1.0
        else f"climbing {altitude_gain:.0f} m at once to"
    )
    if -altitude_gain >= 1.0 and abs(target.slope_base - altitude_gain) < rules.min_slope_height:
        altitude_text = f"descending {-altitude_gain:.0f} m at once to"
    if rules.holds_height:
        # The RTL descends only at its destination; the end altitude follows the text.
        first_climb, sink = target.transit_altitude - start_altitude, target.transit_altitude - target.position[2]
        sink_text = f"descending {sink:.0f} m in a loiter there, to" if sink >= 1.0 else ""
        if first_climb < 1.0:
            altitude_text = f"level, and {sink_text}" if sink_text else "at"
        else:
            altitude_text = f"climbing {first_climb:.0f} m first, to"
            altitude_text += f" {target.transit_altitude:.0f} m AMSL, and {sink_text}" if sink_text else ""
    elif abs(altitude_gain) < 1.0:
        altitude_text = "at"
    climb_text = ""
    if rules.initial_climb > 0.0 and not (math.isinf(rules.initial_climb) and altitude_gain < -1.0):
        bank = math.degrees(rules.initial_climb_bank)
        first_gain = altitude_gain if math.isinf(rules.initial_climb) else rules.initial_climb
        climb_text = f"; banks no more than {bank:.0f} degrees before it has climbed {first_gain:.0f} m"
        if math.isinf(rules.initial_climb) and altitude_gain <= 1.0:
            climb_text = f"; banks no more than {bank:.0f} degrees until it is above that height"
        if first_gain > max(0.0, altitude_gain):
            climb_text += ", even above that height"
    end_text = (
        f"then from the loiter to {continuation}"
        if continuation
        else f"the simulated flight ends after {ENDLESS_LOITER_TIME_S:.0f} s of the loiter there"
    )
    return (
        f"NAV_RETURN_TO_LAUNCH returns to {target.name}, {_distance_text(target.distance)} away{reason},"
        f" {altitude_text}"
        f" {target.position[2]:.0f} m AMSL{climb_text}; {end_text}"
    )


def rtl_waypoints(
    previous_points: Sequence[RoutePoint],
    stop: RoutePoint,
    target: ReturnTarget,
    rules: ReturnRules,
    ability: ReturnAbility,
    next_position: Position | None = None,
) -> list[RoutePoint]:
    """Return the waypoints of an RTL: its turn, its straight leg, and the loiter at its end.

    previous_points: route points up to the RTL, which starts at the last point on the course of the last leg.
    stop: itinerary stop of the RTL.
    next_position: position to which the RTL continues once the loiter has reached its altitude; None if the RTL stays
        in the loiter.

    The turn takes the shorter direction. A descent follows the straight slope from the start of the turn to the target,
    but is no steeper than the aircraft can fly. A climb or a small descent begins at once. The aircraft covers the
    remaining altitude difference in the loiter, which then lasts `flight.mission.itinerary.ENDLESS_LOITER_TIME_S`. The
    initial climb of the rules comes before the turn, even if the target is lower. An RTL that holds its altitude
    descends only in the loiter. An RTL that starts inside its loiter has neither turn nor leg.
    """
    start = previous_points[-1].map_position
    course = (
        _course(previous_points[-2].map_position, start)
        if len(previous_points) > 1
        else _course(start, target.position)
    )
    stated_radius = ability.loiter_radius_scale * abs(rules.radius)
    radius = math.copysign(max(stated_radius, ability.min_loiter_radius), rules.radius)
    circle = stop.placed_at(target.position, radius)
    transit_circle = (
        circle.placed_at((circle.east, circle.north, target.transit_altitude), radius) if rules.holds_height else circle
    )
    dive = min(ability.dive_slope, rules.max_sink_rate / ability.airspeed)
    builder = _ReturnBuilder(
        transit_circle, circle.up, target.slope_base, rules.min_slope_height, ability, dive, start, next_position
    )
    if _distance(start, target.position) <= abs(radius) + _MIN_TANGENT_M:
        # The RTL starts inside its loiter: fly straight on to the circle.
        offset_east, offset_north = start[0] - circle.east, start[1] - circle.north
        distance_past_center = offset_east * math.sin(course) + offset_north * math.cos(course)
        distance = -distance_past_center + math.sqrt(
            max(
                0.0,
                distance_past_center * distance_past_center
                + circle.arc_radius * circle.arc_radius
                - offset_east * offset_east
                - offset_north * offset_north,
            )
        )
        east, north = start[0] + distance * math.sin(course), start[1] + distance * math.cos(course)
        bearing = math.atan2(east - circle.east, north - circle.north)
        builder.add_loiter(east, north, bearing + math.copysign(0.5 * math.pi, circle.arc_radius))
        return builder.points
    course = builder.add_gentle_turn(course, rules)
    builder.add_turn(course)
    return builder.points


class _ReturnBuilder:
    """Builder of the waypoints of an RTL, piece by piece from its current position and altitude."""

    def __init__(
        self,
        circle: RoutePoint,
        end_altitude: float,
        slope_base: float,
        min_slope_height: float,
        ability: ReturnAbility,
        dive_slope: float,
        start: Position,
        next_position: Position | None,
    ) -> None:
        """Start the RTL at a position, without waypoints.

        circle: loiter at the end, at the altitude of the way there.
        end_altitude: altitude of the loiter's end, m AMSL.
        slope_base, min_slope_height: see `ReturnTarget` and `ReturnRules`.
        dive_slope: steepest descent (tangent).
        next_position: position to which the RTL continues after the loiter, or None.
        """
        self.points: list[RoutePoint] = []
        self._stop, self._circle, self._slope_base = circle, circle, slope_base
        self._end_altitude = end_altitude
        self._min_slope_height = min_slope_height
        self._ability = ability
        self._dive_slope = dive_slope
        self._next_position = next_position
        self._position = self._slope_start = start
        # Altitude of the climb before the turn, m; it may lie above the target.
        self._first_climb_altitude = -math.inf

    @property
    def _is_altitude_step(self) -> bool:
        """True if the descent is too small for a slope, so that the altitude changes in one step."""
        return abs(self._slope_start[2] - self._circle.up + self._slope_base) < self._min_slope_height

    @property
    def _altitude_difference(self) -> float:
        """Height of the loiter above the current position, m."""
        return self._circle.up - self._position[2]

    def add_gentle_turn(self, course: float, rules: ReturnRules) -> float:
        """Add the turn with the bank limit of the initial climb; return the course at its end, rad.

        The turn ends where the climb ends, or where the aircraft points to the target. Without an initial climb,
        nothing is added.
        """
        first_climb = max(0.0, self._altitude_difference) if math.isinf(rules.initial_climb) else rules.initial_climb
        if first_climb <= 0.0:
            return course
        radius = self._ability.turn_radius(course, course + math.pi, self._position[2])
        radius *= math.tan(self._ability.max_bank) / math.tan(max(1e-3, rules.initial_climb_bank))
        arc_to_tangent = self._arc_to_tangent(course, radius)
        if arc_to_tangent is None:
            return course
        node, full_sweep, tangent = arc_to_tangent
        sweep = min(full_sweep, first_climb / self._ability.climb_slope / radius)
        self._first_climb_altitude = self._position[2] + first_climb
        self._add_arc(node, course, sweep)
        end_course = course + math.copysign(sweep, node.arc_radius)
        self._add_waypoint(*point_on_circle(node, end_course), 0.0)
        if sweep == full_sweep and self._first_climb_altitude > self._circle.up:
            # The straight leg on which the first climb ends, or the leg to the loiter if that is nearer.
            east, north = point_on_circle(self._circle, tangent)
            length = (self._first_climb_altitude - self._position[2]) / self._ability.climb_slope
            length = min(length, math.hypot(east - self._position[0], north - self._position[1]) - _MIN_TANGENT_M)
            if length > _MIN_TANGENT_M:
                east = self._position[0] + length * math.sin(tangent)
                self._add_waypoint(east, self._position[1] + length * math.cos(tangent), 0.0)
        self._first_climb_altitude, self._slope_start = -math.inf, self._position
        return tangent if sweep == full_sweep else end_course

    def add_turn(self, course: float) -> None:
        """Add the turn to the target, the straight leg to the target, and the loiter there."""
        bearing = _course(self._position, (self._circle.east, self._circle.north, 0.0))
        arc = self._arc_to_tangent(course, self._ability.turn_radius(course, bearing, self._position[2]))
        point = self._stop.placed_at(self._position)
        if arc is None:
            # No tangent leads from the turn to the loiter: use a sharp corner.
            leg_course = tangent_course(point, self._circle)
        else:
            node, sweep, leg_course = arc
            if abs(node.arc_radius) * math.tan(0.5 * min(sweep, MAX_CORNER_ANGLE_RAD)) > _MIN_TANGENT_M:
                self._add_arc(node, course, sweep)
                self._add_waypoint(*point_on_circle(node, leg_course), 0.0)
            else:
                leg_course = tangent_course(point, self._circle)
        # A waypoint on the straight leg where a climb or altitude step ends, or where the descent starts.
        join_point = point_on_circle(self._circle, leg_course)
        leg_length = math.hypot(join_point[0] - self._position[0], join_point[1] - self._position[1])
        if self._altitude_difference > 0.0:
            break_distance = self._altitude_difference / self._ability.climb_slope
        elif self._is_altitude_step:
            break_distance = -self._altitude_difference / self._dive_slope
        else:
            descent = self._slope_start[2] - self._circle.up
            break_fraction = self._slope_base / max(1e-6, descent + self._slope_base)
            start_fraction, end_fraction = self._slope_fraction(*self._position[:2]), self._slope_fraction(*join_point)
            break_distance = leg_length * (break_fraction - start_fraction) / max(1e-6, end_fraction - start_fraction)
        if _MIN_TANGENT_M < break_distance < leg_length - _MIN_TANGENT_M:
            east, north = (
                start + break_distance / leg_length * (end - start)
                for start, end in zip(self._position[:2], join_point, strict=True)
            )
            self._add_waypoint(east, north, 0.0)
        self.add_loiter(*join_point, leg_course)

    def add_loiter(self, east: float, north: float, course: float) -> None:
        """Add the leg to a point on the circle, and the loiter until its altitude and its time are reached.

        east, north: point on the circle, m.
        course: course along the circle at this point, rad.
        """
        if math.hypot(east - self._position[0], north - self._position[1]) > _MIN_TANGENT_M:
            self._add_waypoint(east, north, 0.0)
        self._circle = self._circle.placed_at(
            (self._circle.east, self._circle.north, self._end_altitude), self._circle.arc_radius
        )
        radius = abs(self._circle.arc_radius)
        altitude_change = self._altitude_difference
        spiral_angle = (
            abs(altitude_change) / (self._ability.climb_slope if altitude_change > 0.0 else self._dive_slope) / radius
        )
        if self._next_position is not None:
            self._add_exit(
                course, spiral_angle if abs(altitude_change) > _LANDING_JOIN_TOLERANCE_M else 0.0, self._next_position
            )
            return
        sweep = spiral_angle + max(2.0 * math.pi, ENDLESS_LOITER_TIME_S * self._ability.airspeed / radius)
        self._add_circle(course, sweep)

    def _add_circle(self, course: float, sweep: float) -> None:
        """Add the part of the loiter that begins at a course and sweeps an angle, both rad."""
        self._add_arc(self._circle, course, sweep, on_circle=True)
        self._add_waypoint(
            *point_on_circle(self._circle, course + math.copysign(sweep, self._circle.arc_radius)),
            0.0,
            on_circle=True,
        )

    def _add_exit(self, course: float, spiral_angle: float, next_position: Position) -> None:
        """Add the loiter until its altitude is reached, then the turn towards the next position.

        course: course at which the aircraft joins the loiter, rad.
        spiral_angle: angle around the loiter until its altitude is reached, rad.
        next_position: east, north, up, m.
        """
        if spiral_angle > 0.0:
            self._add_circle(course, spiral_angle)
            course += math.copysign(spiral_angle, self._circle.arc_radius)
        self._circle = self._stop.placed_at((next_position[0], next_position[1], self._position[2]))
        radius = self._ability.turn_radius(course, _course(self._position, next_position), self._position[2])
        arc = self._arc_to_tangent(course, radius)
        if arc is not None and radius * math.tan(0.5 * min(arc[1], MAX_CORNER_ANGLE_RAD)) > _MIN_TANGENT_M:
            node, sweep, exit_course = arc
            self._add_arc(node, course, sweep, on_circle=True)
            self._add_waypoint(*point_on_circle(node, exit_course), 0.0, on_circle=True)

    def _arc_to_tangent(self, course: float, radius: float) -> tuple[RoutePoint, float, float] | None:
        """Return the arc from the current position to the tangent that leads to the target's loiter.

        course: course at the start of the arc, rad.
        radius: radius of the arc, m.

        The turn takes the shorter direction, unless that arc exceeds 270 degrees. Returns the circle of the arc, the
        angle of the arc (rad), and the course at its end (rad). Returns None if there is no such tangent.
        """
        course_error = float(wrap(_course(self._position, (self._circle.east, self._circle.north, 0.0)) - course))
        turn_sign = math.copysign(1.0, course_error)
        arcs = [
            arc
            for arc in (self._arc_on_side(course, turn_sign * radius), self._arc_on_side(course, -turn_sign * radius))
            if arc
        ]
        return next((arc for arc in arcs if arc[1] < _MAX_TURN_ANGLE_RAD), None)

    def _arc_on_side(self, course: float, signed_radius: float) -> tuple[RoutePoint, float, float] | None:
        """Return the arc to the tangent that leads to the target's loiter, for a turn to one side.

        course: course at the start of the arc, rad.
        signed_radius: radius of the arc, m, positive for a turn to the right.

        Returns the circle, angle and end course as `_arc_to_tangent` does, or None without a tangent.
        """
        east, north, up = self._position
        center = (east + signed_radius * math.cos(course), north - signed_radius * math.sin(course), up)
        node = self._stop.placed_at(center, signed_radius)
        if not is_joined(node, self._circle):
            return None
        tangent = tangent_course(node, self._circle)
        return node, (math.copysign(1.0, signed_radius) * (tangent - course)) % (2.0 * math.pi), tangent

    def _add_arc(self, node: RoutePoint, course: float, sweep: float, *, on_circle: bool = False) -> None:
        """Add the corners of an arc, as in `circle_corners`.

        node: center of the arc, with its radius.
        course, sweep: course at the start of the arc and angle flown around its center, rad.
        on_circle: True for an arc of the loiter, on which no slope applies.
        """
        for east, north in circle_corners(node, course, sweep):
            self._add_waypoint(east, north, abs(node.arc_radius), on_circle=on_circle)

    def _add_waypoint(self, east: float, north: float, arc: float, *, on_circle: bool = False) -> None:
        """Add a waypoint at a position on the map (m), at the altitude that the RTL reaches there.

        arc: radius of the turn at the waypoint, m; 0 for a sharp corner.
        on_circle: True for a waypoint of the loiter, on which no slope applies.
        """
        distance = math.hypot(east - self._position[0], north - self._position[1])
        altitude, climb_altitude = self._position[2], max(self._circle.up, self._first_climb_altitude)
        if climb_altitude >= altitude:
            altitude = min(climb_altitude, altitude + self._ability.climb_slope * distance)
        else:
            target_altitude = self._circle.up
            if not on_circle and not self._is_altitude_step:
                # On the slope to the target.
                remaining_fraction = 1.0 - min(1.0, max(0.0, self._slope_fraction(east, north)))
                slope_height = self._slope_start[2] - target_altitude + self._slope_base
                target_altitude = min(self._slope_start[2], target_altitude + remaining_fraction * slope_height)
            altitude = max(min(altitude, target_altitude), altitude - self._dive_slope * distance)
        self._position = (east, north, altitude)
        self.points.append(self._stop.placed_at(self._position, arc))

    def _slope_fraction(self, east: float, north: float) -> float:
        """Return the fraction of the slope to the target that is already flown at a position.

        It is negative before the start of the slope, and above 1 beyond the target.
        """
        start_east, start_north, _ = self._slope_start
        slope_east, slope_north = self._circle.east - start_east, self._circle.north - start_north
        return ((east - start_east) * slope_east + (north - start_north) * slope_north) / max(
            1e-6, slope_east**2 + slope_north**2
        )


def _course(start: Position, end: Position) -> float:
    """Return the course from a start to an end, rad."""
    return math.atan2(end[0] - start[0], end[1] - start[1])


def _distance(start: Position, end: Position | ReturnPoint) -> float:
    """Return the horizontal distance between two positions, m."""
    return math.hypot(end[0] - start[0], end[1] - start[1])


def _distance_text(distance: float) -> str:
    """Return a distance as text, in km from 1 km on, else in m."""
    return f"{distance / 1000.0:.1f} km" if distance >= 1000.0 else f"{distance:.0f} m"
