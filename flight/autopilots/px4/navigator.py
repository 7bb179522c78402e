"""Navigate as PX4 does: choose the waypoint to fly to, accept it, and set the altitude setpoint on a leg.

Follows PX4's `src/modules/navigator/mission_block.cpp` (`is_mission_item_reached_or_completed`) and
`src/modules/fw_mode_manager` (to 1.16 `fw_pos_control`).  A waypoint is reached within a radius of it or past the plane
across the leg at it, and only within NAV_FW_ALT_RAD of its altitude; an aircraft that arrives too high or too low
circles at the waypoint until it is within that tolerance.  The radius is NAV_ACC_RAD, and up to 1.16 guidance's own
switch distance if that is more; an item's own radius (its second parameter) is not read for fixed wing.

A loiter is flown around its center from the start of its leg (`control_auto_loiter`), which from a distance is straight
to the center.  It is reached, once, within that radius of its rim and near its altitude; then its time runs, and it is
left at once for the line from its center to the next waypoint.  Only if its item says so, it is left on the course to
the next waypoint, or for a line that begins at the tangent point on the rim.  LOITER_TIME demands its altitude from the
start; LOITER_TO_ALT demands the altitude at the start of its leg until the rim is reached, and its own from then on.

At a gate (CONDITION_GATE) the aircraft flies to the waypoint after it.  A change of speed that the mission orders
between them applies from where the aircraft crosses the plane through the gate.  Once the last waypoint is reached, PX4
circles with NAV_LOITER_RAD: about that waypoint, up to 1.16 about the place where the aircraft then is
(`setEndOfMissionItems`).
"""

import math

from flight.autopilots.px4.lateral import follow_circle, follow_leg, switch_distance
from world.geometry import wrap
from world.kernels import Record, Records, inner

# Delay from reaching a waypoint to the turn, s: the navigator's loop, its message to the position controller and the
# controller's turn.  At 33 waypoints of the stored flights it was 0.13 s on average, 0.02 to 0.26.  PX4 1.17 and 1.18,
# which turn by the same rule, differ from each other by up to 5.9 m at the same waypoints; a law without that delay is
# never closer than 3 m.
SWITCH_DELAY = 0.13
# Course tolerance for leaving a loiter on the course to what follows, rad (`kCosineExitCourseThreshold`).
EXIT_COURSE_TOLERANCE_RAD = math.radians(5.0)
# A place closer to the center than this, in radii, cannot be headed for from the loiter: no course is awaited.
_MIN_EXIT_DISTANCE_RATIO = 1.05


@inner
def reach_radius(ground_speed: float, parameters: Record) -> float:
    """Return the distance to a waypoint within which it is reached, m."""
    radius: float = parameters.acceptance
    if parameters.anticipates:
        radius = max(radius, switch_distance(ground_speed, parameters))
    return radius


@inner
def past_waypoint(estimated: Record, b: Record, own: Record) -> bool:
    """Return True if the aircraft is past the plane across the leg at its end b; False for a leg without length."""
    leg_east, leg_north = b.east - own.from_east, b.north - own.from_north
    distance_past = (estimated.east - b.east) * leg_east + (estimated.north - b.north) * leg_north
    return leg_east * leg_east + leg_north * leg_north > 1e-6 and distance_past > 0.0


@inner
def navigate(
    estimated: Record,
    waypoints: Records,
    wind_east: float,
    wind_north: float,
    airspeed_demand: float,
    parameters: Record,
    own: Record,
    dt: float,
) -> None:
    """Follow the current leg, demand its altitude, and change to the next leg when it is time.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    waypoints: (w,) of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    wind: velocity of the air, m/s.
    airspeed_demand: m/s.
    parameters: a record of `flight.autopilots.px4.parameters.PX4_PARAMETERS`.
    own: a record of `flight.autopilots.px4.law.PX4_MEMORY`.
    dt: s.
    """
    target = flown_to(waypoints, own)
    b = waypoints[target]
    if target > own.leg + 1 and _past_gate(estimated, waypoints[own.leg + 1], b):
        own.leg += 1
    if b.returns:
        # An RTL is one leg, which lasts until the flight ends.
        _navigate_rtl(estimated, b, wind_east, wind_north, airspeed_demand, parameters, own)
        return
    if b.circle != 0.0:
        _fly_loiter(estimated, waypoints, b, wind_east, wind_north, airspeed_demand, parameters, own, dt)
    else:
        _follow_plain_leg(estimated, waypoints, target, wind_east, wind_north, airspeed_demand, parameters, own, dt)


@inner
def flown_to(waypoints: Records, own: Record) -> int:
    """Return the index of the waypoint that is flown to; gates are passed on the leg to it."""
    target: int = own.leg + 1
    while waypoints[target].gate:
        target += 1
    return target


@inner
def _past_gate(estimated: Record, gate: Record, b: Record) -> bool:
    """Return True past the plane through a gate, perpendicular to the line from the gate to the waypoint b."""
    normal_east, normal_north = b.east - gate.east, b.north - gate.north
    distance_past = (estimated.east - gate.east) * normal_east + (estimated.north - gate.north) * normal_north
    return distance_past >= 0.0


@inner
def _follow_plain_leg(
    estimated: Record,
    waypoints: Records,
    target: int,
    wind_east: float,
    wind_north: float,
    airspeed_demand: float,
    parameters: Record,
    own: Record,
    dt: float,
) -> None:
    """Follow the leg to a waypoint, and circle at it while the aircraft is too high or too low.

    At the last waypoint of a mission the aircraft circles once it is reached.
    """
    b = waypoints[target]
    speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    turn_distance, loiter_radius = switch_distance(speed, parameters), parameters.loiter_radius
    distance = math.hypot(b.east - estimated.east, b.north - estimated.north)
    own.nearest = min(own.nearest, distance)
    is_off_altitude = abs(estimated.up - b.up) > parameters.height_acceptance
    # A circle is kept once begun, even if the aircraft is wide of it.
    own.circling = own.finished or (is_off_altitude and (own.circling or distance < turn_distance))
    if own.circling:
        east, north = b.east, b.north
        if own.finished and parameters.anticipates:
            east, north = own.from_east, own.from_north
        follow_circle(estimated, east, north, loiter_radius, wind_east, wind_north, airspeed_demand, parameters, own)
        own.height_asked = b.up
    else:
        follow_leg(estimated, b.east, b.north, wind_east, wind_north, airspeed_demand, parameters, own)
        own.height_asked = leg_height(b.east, b.north, b.up, max(turn_distance, abs(loiter_radius)), own)
    is_end = target + 1 >= waypoints.shape[0]
    if is_end and not b.ends:
        return
    is_reached = distance <= reach_radius(speed, parameters) or past_waypoint(estimated, b, own)
    own.reached_for = own.reached_for + dt if own.reached_for > 0.0 or (is_reached and not is_off_altitude) else 0.0
    if own.reached_for <= SWITCH_DELAY:
        return
    if is_end:
        if parameters.anticipates and not own.finished:
            own.from_east, own.from_north = estimated.east, estimated.north
        own.finished = True
    else:
        begin_leg(estimated, waypoints, target, own)


@inner
def _fly_loiter(
    estimated: Record,
    waypoints: Records,
    b: Record,
    wind_east: float,
    wind_north: float,
    airspeed_demand: float,
    parameters: Record,
    own: Record,
    dt: float,
) -> None:
    """Fly to a loiter and around it until it is over.

    b: the corner of the route that stands for the loiter.
    """
    speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    distance = math.hypot(b.centre_east - estimated.east, b.centre_north - estimated.north)
    own.circling = True
    follow_circle(
        estimated, b.centre_east, b.centre_north, b.circle, wind_east, wind_north, airspeed_demand, parameters, own
    )
    is_on_rim = distance <= abs(b.circle) + reach_radius(speed, parameters)
    if b.to_height and not own.at_rim:
        own.height_asked = own.begun_up
        own.at_rim = is_on_rim and abs(estimated.up - own.begun_up) <= parameters.height_acceptance
        return
    own.height_asked = b.up
    is_at_altitude = abs(estimated.up - b.up) <= parameters.height_acceptance
    own.reached_for = own.reached_for + dt if own.reached_for > 0.0 or (is_on_rim and is_at_altitude) else 0.0
    exit_waypoint = own.leg + 2
    if math.isnan(b.stays):
        # A loiter by turns, which PX4 does not fly: it is left where the drawn route leaves it.
        if exit_waypoint < waypoints.shape[0] and is_on_rim and past_corner(estimated, b):
            begin_leg(estimated, waypoints, own.leg + 1, own)
        return
    while exit_waypoint < waypoints.shape[0] and waypoints[exit_waypoint].stop == b.stop:
        exit_waypoint += 1
    if exit_waypoint >= waypoints.shape[0] or own.reached_for <= b.stays + SWITCH_DELAY:
        return
    if not b.leaves_on_course or _is_on_exit_course(estimated, waypoints[exit_waypoint], b):
        begin_leg(estimated, waypoints, exit_waypoint - 1, own)


@inner
def is_last(waypoints: Records, own: Record) -> bool:
    """Return True if nothing but corners of the same loiter follows the current target."""
    target = flown_to(waypoints, own)
    b = waypoints[target]
    return target + 1 >= waypoints.shape[0] or (b.circle != 0.0 and waypoints[-1].stop == b.stop)


@inner
def _setpoint_position(b: Record) -> tuple[float, float]:
    """Return east and north (m) of a waypoint's setpoint, which for a loiter is its center."""
    return (b.centre_east, b.centre_north) if b.circle != 0.0 else (b.east, b.north)


@inner
def _is_on_exit_course(estimated: Record, next_waypoint: Record, b: Record) -> bool:
    """Return True if the course leads to the setpoint after loiter b, or if no course can.

    No course is required to a setpoint too close to the loiter's center.

    next_waypoint: the waypoint after the loiter.
    """
    east, north = _setpoint_position(next_waypoint)
    if math.hypot(east - b.centre_east, north - b.centre_north) <= _MIN_EXIT_DISTANCE_RATIO * abs(b.circle):
        return True
    bearing = math.atan2(east - estimated.east, north - estimated.north)
    return (
        abs(wrap(bearing - math.atan2(estimated.velocity_east, estimated.velocity_north))) < EXIT_COURSE_TOLERANCE_RAD
    )


@inner
def _navigate_rtl(
    estimated: Record,
    b: Record,
    wind_east: float,
    wind_north: float,
    airspeed_demand: float,
    parameters: Record,
    own: Record,
) -> None:
    """Fly an RTL: climb in a circle if necessary, go straight to the target at that altitude, and descend there.

    Follows PX4's `src/modules/navigator/rtl_direct.cpp`; the aircraft never descends before it is over its target.
    """
    if not own.returning:
        own.returning, own.circling = True, False
        own.from_east, own.from_north, own.from_up = estimated.east, estimated.north, estimated.up
    return_altitude = max(own.from_up, b.up)
    if not own.climbed:
        own.climbed = estimated.up >= return_altitude - parameters.height_acceptance
        if own.climbed:
            own.from_east, own.from_north = estimated.east, estimated.north
    if not own.climbed:
        own.height_asked = return_altitude
        follow_circle(
            estimated,
            own.from_east,
            own.from_north,
            parameters.loiter_radius,
            wind_east,
            wind_north,
            airspeed_demand,
            parameters,
            own,
        )
        return
    speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    distance = math.hypot(b.centre_east - estimated.east, b.centre_north - estimated.north)
    own.circling = own.circling or distance < abs(b.circle) + switch_distance(speed, parameters)
    own.height_asked = b.up if own.circling else return_altitude
    if own.circling:
        follow_circle(
            estimated, b.centre_east, b.centre_north, b.circle, wind_east, wind_north, airspeed_demand, parameters, own
        )
    else:
        follow_leg(estimated, b.centre_east, b.centre_north, wind_east, wind_north, airspeed_demand, parameters, own)


@inner
def begin_leg(estimated: Record, waypoints: Records, leg: int, own: Record) -> None:
    """Begin a leg, whose line joins both waypoints; after a loiter, the line starts at the loiter's center.

    After a loiter by turns, which PX4 does not fly, it starts where the loiter is left.
    """
    a, b = waypoints[leg], waypoints[leg + 1]
    own.leg = leg
    own.from_east, own.from_north = _setpoint_position(a)
    own.from_up = a.up
    if a.circle != 0.0 and math.isnan(a.stays):
        own.from_east, own.from_north = estimated.east, estimated.north
    if a.circle != 0.0 and a.leaves_on_tangent and not math.isnan(a.stays):
        east, north = _setpoint_position(b)
        bearing = math.atan2(east - a.centre_east, north - a.centre_north)
        cosine = abs(a.circle) / max(1e-3, math.hypot(east - a.centre_east, north - a.centre_north))
        exit_bearing = bearing - math.copysign(math.acos(min(1.0, cosine)), a.circle)
        own.from_east += abs(a.circle) * math.sin(exit_bearing)
        own.from_north += abs(a.circle) * math.cos(exit_bearing)
    if not (a.circle != 0.0 and a.stop == b.stop):
        own.circling, own.at_rim, own.begun_up = False, False, estimated.up
        own.reached_for = 0.0
    own.nearest = math.inf


@inner
def past_corner(estimated: Record, b: Record) -> bool:
    """Return True if an aircraft on a loiter has passed the route's corner for this part of the loiter."""
    corner_bearing = math.atan2(b.east - b.centre_east, b.north - b.centre_north)
    bearing = math.atan2(estimated.east - b.centre_east, estimated.north - b.centre_north)
    angle_past = wrap(bearing - corner_bearing) * math.copysign(1.0, b.circle)
    return 0.0 <= angle_past < 0.5 * math.pi


@inner
def leg_height(end_east: float, end_north: float, end_up: float, lead_distance: float, own: Record) -> float:
    """Return a leg's altitude setpoint at the aircraft, m, on a slope that ends ``lead_distance`` m before the end.

    PX4 calls it a first-order hold.  The slope uses the smallest horizontal distance to the end that was reached on
    this leg; a leg no longer than ``lead_distance`` is a step.
    """
    length = math.hypot(end_east - own.from_east, end_north - own.from_north)
    nearest = min(own.nearest, length)
    if length <= lead_distance or nearest <= lead_distance:
        return end_up
    return own.from_up + (end_up - own.from_up) * (length - nearest) / (length - lead_distance)
