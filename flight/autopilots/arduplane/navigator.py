"""Navigate as ArduPlane does, with L1 guidance along legs, changes of leg, loiters, and RTL.

L1 guidance follows Park, Deyst and How ("A New Nonlinear Guidance Logic for Trajectory Tracking", AIAA 2004-4900) with
the parameters of ArduPlane's documentation (ardupilot.org, Plane, "Navigation Tuning") and the formulas of
`flight.guidance.lateral_reference_laws`. ArduPlane navigates ten times a second and holds its demands in between.

Loiters follow ArduPlane's `Plane::update_loiter`, `verify_loiter_*` and `ModeLoiter::isHeadingLinedUp`. The aircraft
follows the line to the center of the loiter until it is within three radii, then steers to the center until the loiter
demands the sharper turn, and then flies around. Turns, time and altitude are measured from there on. Once they are
complete, it keeps loitering until the tangent at its position leads to the next waypoint, within ten degrees plus ten
for each lap of waiting. The next leg's line begins at the loiter's center, or at the aircraft if the item says so.
The radius grows with altitude as the square of the ratio of true to equivalent airspeed
(`AP_L1_Control::loiter_radius`).
"""

import math

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.parameters import CLIMB_BEFORE_TURN
from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.guidance.lateral_reference_laws import l1_acceleration, l1_angles, l1_integrate, l1_length
from world.geometry import wrap
from world.kernels import Record, Records, compiled, inner

# Upper limit of an acceptance radius, m: it is sent as whole metres in a byte.
MAX_ACCEPTANCE_M = 255.0
# Distance from the center, in radii, up to which the line to a loiter is followed.
_APPROACH_LINE_RADII_RATIO = 3.0
# Altitude tolerance within which a loiter to an altitude is complete, m.
LOITER_ALTITUDE_TOLERANCE_M = 5.0
# A loiter to an altitude is also complete if the altitude changes by less than that tolerance in this many laps.
_ALTITUDE_CHECK_INTERVAL_LAPS = 3.0
# Heading tolerance for leaving a loiter towards the next waypoint, rad ...
_EXIT_HEADING_TOLERANCE_RAD = math.radians(10.0)
# ... and its growth for each lap of waiting, rad.
_EXIT_HEADING_GROWTH_RAD = math.radians(10.0)
# Altitude tolerance for leaving the RTL loiter to join the landing sequence, m.
LANDING_JOIN_ALTITUDE_TOLERANCE_M = 10.0
# L1 keeps the side of a turn while its angle exceeds this, rad ...
_INDECISION_ANGLE_RAD = 0.9 * math.pi
# ... and the target is further from the course than this, rad.
_TARGET_BEHIND_ANGLE_RAD = math.radians(120.0)
# Items closer than this have the same position, which ArduPlane stores in 1e-7 degrees, m.
_SAME_PLACE_M = 0.01
# Square of the length below which ArduPlane takes a leg as flown (`Location::line_path_proportion`), m².
_SHORT_LEG_LENGTH_SQUARED_M2 = 0.001


@compiled
def turn_distance(acceptance: float, turn_angle: float, wp_radius: float, l1_distance: float, eas2tas: float) -> float:
    """Return the distance before a waypoint at which ArduPlane turns to the next leg, m.

    This is the acceptance radius that the mission states. Without one it is the smaller of WP_RADIUS and the L1
    distance, reduced in proportion for a turn of less than 90 degrees.

    Follows `AP_L1_Control::turn_distance`.

    acceptance: acceptance radius that the mission states, in whole metres; 0 if it states none.
    turn_angle: rad, positive.
    wp_radius: WP_RADIUS, m.
    l1_distance: L1 distance, m.
    eas2tas: ratio of true to equivalent airspeed; the distance for a turn grows as its square.
    """
    acceptance_m = math.floor(min(MAX_ACCEPTANCE_M, acceptance))
    if acceptance_m > 0.0:
        return acceptance_m
    right_angle_distance: float = min(wp_radius * eas2tas * eas2tas, l1_distance)
    return right_angle_distance * min(1.0, turn_angle / (0.5 * math.pi))


@inner
def is_past_finish_line(estimated: Record, from_east: float, from_north: float, east: float, north: float) -> bool:
    """Return True if the aircraft is past the line across the leg's end, or the leg is under 3 cm long.

    Follows `Location::past_interval_finish_line`.

    from_east, from_north: start of the leg, m.
    east, north: end of the leg, m.
    estimated: estimated position and velocity over the ground, a `MOTION` record.
    """
    leg_e, leg_n = east - from_east, north - from_north
    remaining_e, remaining_n = east - estimated.east, north - estimated.north
    is_short = leg_e * leg_e + leg_n * leg_n < _SHORT_LEG_LENGTH_SQUARED_M2
    return is_short or remaining_e * leg_e + remaining_n * leg_n <= 0.0


@inner
def navigate_legs(
    estimated: Record,
    waypoints: Records,
    parameters: Record,
    memory: Record,
    eas2tas: float,
    dt: float,
) -> None:
    """Set the lateral acceleration demand on the current leg; begin the next leg once this leg is over.

    A leg to a waypoint follows the line to it, a leg to a loiter also flies around the loiter, and an RTL lasts until
    it joins the landing sequence. The last leg of the route never ends here.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    waypoints: (w,) of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    parameters: of `flight.autopilots.arduplane.parameters.ARDUPILOT_PARAMETERS`.
    memory: of `flight.autopilots.arduplane.law.ARDUPILOT_MEMORY`.
    eas2tas: ratio of true to equivalent airspeed.
    dt: time since the last update, s.
    """
    target = waypoints[memory.leg + 1]
    ground_speed = max(0.1, math.hypot(estimated.velocity_east, estimated.velocity_north))
    l1_distance = l1_length(ground_speed, parameters.navl1_period, parameters.navl1_damping)
    if target.is_rtl:
        # An RTL is one leg, which lasts until the flight ends or joins the mission's landing sequence.
        _navigate_rtl(estimated, target, parameters, memory, eas2tas)
        # It leaves the loiter once the aircraft loiters near the target altitude, and begins the next leg at the
        # aircraft's position (`ModeRTL::navigate` of ArduPlane 4.6 with RTL_AUTOLAND 1). Without a landing sequence the
        # aircraft stays on the loiter.
        landing_index = memory.leg + 2
        while landing_index < waypoints.shape[0] and waypoints[landing_index].is_rtl:
            landing_index += 1
        is_near_altitude = abs(estimated.up - target.up) < LANDING_JOIN_ALTITUDE_TOLERANCE_M
        if landing_index < waypoints.shape[0] and memory.reached_loiter_target and is_near_altitude:
            memory.leg_after_loiter = landing_index - 1
            memory.is_in_rtl, memory.rtl_climb_complete = False, False
            _begin_leg(estimated, waypoints, landing_index - 1, memory)
            memory.from_east, memory.from_north, memory.from_up = estimated.east, estimated.north, estimated.up
        return
    if target.loiter_radius != 0.0:
        _update_loiter(estimated, waypoints, target, parameters, memory, l1_distance, ground_speed, eas2tas, dt)
        return
    memory.reached_loiter_target = False
    # `Plane::verify_nav_wp` moves the waypoint along the leg by the pass-by distance.
    leg_e, leg_n = target.east - memory.from_east, target.north - memory.from_north
    leg_length = math.hypot(leg_e, leg_n)
    end_e, end_n = target.east, target.north
    if target.pass_by > 0.0 and leg_length > 0.0:
        end_e += target.pass_by * leg_e / leg_length
        end_n += target.pass_by * leg_n / leg_length
    _follow_line(estimated, end_e, end_n, parameters, memory, l1_distance, ground_speed, dt, target.without_crosstrack)
    turn_angle = _turn_angle(waypoints, target, memory)
    if memory.leg + 2 < waypoints.shape[0] and _is_leg_over(
        estimated, target, end_e, end_n, turn_angle, parameters, memory, l1_distance, eas2tas
    ):
        _begin_leg(estimated, waypoints, memory.leg + 1, memory)


@inner
def target_position(waypoint: Record) -> tuple[float, float]:
    """Return the position to which ArduPlane flies: east and north, m.

    It is the center of a loiter, or the waypoint itself.

    For an RTL the waypoint itself is returned.
    """
    return (
        (waypoint.centre_east, waypoint.centre_north)
        if waypoint.loiter_radius != 0.0 and not waypoint.is_rtl
        else (waypoint.east, waypoint.north)
    )


@inner
def _follow_line(
    estimated: Record,
    end_e: float,
    end_n: float,
    parameters: Record,
    memory: Record,
    l1_distance: float,
    ground_speed: float,
    dt: float,
    without_crosstrack: bool,
) -> None:
    """Set the lateral acceleration demand to follow the line from the leg's start to its end.

    Follows `AP_L1_Control::update_waypoint`.

    end_e, end_n: end of the leg, m.
    without_crosstrack: True for a line from the aircraft itself (`Plane::verify_nav_wp` without crosstrack).
    l1_distance: L1 distance, m.
    ground_speed: m/s.
    dt: s.
    estimated: estimated position and velocity over the ground, a `MOTION` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record.
    """
    from_e, from_n = (estimated.east, estimated.north) if without_crosstrack else (memory.from_east, memory.from_north)
    angle, aim_angle = l1_angles(estimated, from_e, from_n, end_e, end_n, l1_distance)
    memory.cross_track_integrator = l1_integrate(
        aim_angle, memory.cross_track_integrator, parameters.navl1_xtrack_i, dt
    )
    if not math.isnan(aim_angle):
        angle += aim_angle + memory.cross_track_integrator
    angle = keep_turn_side(estimated, angle, end_e, end_n, memory)
    memory.lateral_acceleration = l1_acceleration(angle, ground_speed, l1_distance, parameters.navl1_damping)


@inner
def keep_turn_side(estimated: Record, angle: float, target_e: float, target_n: float, memory: Record) -> float:
    """Return L1's angle, or the last angle if the new one would reverse a turn of almost 180 degrees; rad.

    The result is stored as the last angle. Follows `AP_L1_Control::_prevent_indecision`, with the course instead of the
    heading.

    angle: angle from the direction to the L1 point to the ground velocity, rad (`-Nu`).
    target_e, target_n: position that the aircraft flies to, m.
    estimated: estimated position and velocity over the ground, a `MOTION` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record.
    """
    course = math.atan2(estimated.velocity_east, estimated.velocity_north)
    bearing = math.atan2(target_e - estimated.east, target_n - estimated.north)
    if (
        min(abs(angle), abs(memory.l1_angle)) > _INDECISION_ANGLE_RAD
        and abs(wrap(bearing - course)) > _TARGET_BEHIND_ANGLE_RAD
        and angle * memory.l1_angle < 0.0
    ):
        angle = memory.l1_angle
    memory.l1_angle = angle
    return angle


@inner
def _turn_angle(waypoints: Records, target: Record, memory: Record) -> float:
    """Return the turn angle at the target that ArduPlane uses, rad, positive.

    Follows `Plane::setup_turn_angle`. The course of a leg that begins or ends on a loiter is measured from or to the
    center of the loiter. A leg to an item that repeats the position of the item before it begins at the aircraft.

    waypoints: `WAYPOINT` records of the route, (w,).
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record.
    """
    turn_angle: float = target.turn
    if memory.leg + 2 >= waypoints.shape[0]:
        return turn_angle
    start, next_waypoint = waypoints[memory.leg], waypoints[memory.leg + 2]
    next_e, next_n = target_position(next_waypoint)
    is_next_here = (next_e - target.east) ** 2 + (next_n - target.north) ** 2 < _SHORT_LEG_LENGTH_SQUARED_M2
    is_here_already = (target.east - start.east) ** 2 + (target.north - start.north) ** 2 < _SHORT_LEG_LENGTH_SQUARED_M2
    has_loiter = start.loiter_radius != 0.0 or next_waypoint.loiter_radius != 0.0
    if next_waypoint.is_rtl or not (has_loiter or is_next_here or is_here_already):
        return turn_angle
    # The bearing between two identical positions is east (`Location::get_bearing`).
    next_course = 0.5 * math.pi if is_next_here else math.atan2(next_e - target.east, next_n - target.north)
    return abs(wrap(next_course - math.atan2(target.east - memory.from_east, target.north - memory.from_north)))


@inner
def _begin_leg(estimated: Record, waypoints: Records, leg: int, memory: Record) -> None:
    """Begin the leg with the index ``leg``, and reset the progress of the last loiter.

    The line to follow usually starts at the first waypoint of the leg. It starts at the aircraft's position if the
    aircraft leaves a loiter on a tangent, or if the aircraft is already past the leg's end.

    estimated: estimated position and velocity over the ground, a `MOTION` record.
    waypoints: `WAYPOINT` records of the route, (w,).
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record.
    """
    start, target = waypoints[leg], waypoints[leg + 1]
    memory.leg = leg
    # The next loiter has not been captured yet, even if the current one was.
    memory.reached_loiter_target = False
    memory.loiter_started, memory.loiter_complete, memory.reached_target_altitude = False, False, False
    memory.loiter_time, memory.loiter_angle_sum, memory.exit_wait_angle, memory.next_sum_lap = 0.0, 0.0, 0.0, 0.0
    memory.from_up = start.up
    memory.from_item_height = start.above_ground if start.follows_terrain else 0.0
    memory.from_east, memory.from_north = target_position(start)
    if start.loiter_radius != 0.0 and start.exits_on_tangent:
        memory.from_east, memory.from_north, memory.from_up = estimated.east, estimated.north, estimated.up
        memory.from_item_height = 0.0
    target_e, target_n = target_position(target)
    if not target.is_rtl and is_past_finish_line(estimated, memory.from_east, memory.from_north, target_e, target_n):
        memory.from_east, memory.from_north, memory.from_up = estimated.east, estimated.north, estimated.up
        memory.from_item_height = 0.0


@inner
def _is_leg_over(
    estimated: Record,
    target: Record,
    end_e: float,
    end_n: float,
    turn_angle: float,
    parameters: Record,
    memory: Record,
    l1_distance: float,
    eas2tas: float,
) -> bool:
    """Return True if the leg's end is within the turn distance, or if the aircraft is past the end.

    Follows `Plane::verify_nav_wp`. The aircraft must be past the end of a leg to a fly-over waypoint. A leg is never
    over while the aircraft is further than WP_MAX_RADIUS from the target; an aircraft that passes the target at such a
    distance turns back to it.

    end_e, end_n: end of the leg, m, to which the aircraft flies; with a pass-by distance it lies beyond the target.
    turn_angle: turn of the route at the target, rad.
    l1_distance: L1 distance, m.
    eas2tas: ratio of true to equivalent airspeed.
    estimated: estimated position and velocity over the ground, a `MOTION` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record.
    """
    is_past_end = is_past_finish_line(estimated, memory.from_east, memory.from_north, end_e, end_n)
    if (
        parameters.wp_max_radius > 0.0
        and math.hypot(target.east - estimated.east, target.north - estimated.north) > parameters.wp_max_radius
    ):
        if is_past_end and target.pass_by <= 0.0:
            # The aircraft has passed the waypoint beyond WP_MAX_RADIUS, and turns back to it.
            memory.from_east, memory.from_north = estimated.east, estimated.north
        return False
    if target.fly_over or (target.pass_by > 0.0 and target.acceptance < 1.0):
        return is_past_end
    distance = math.hypot(end_e - estimated.east, end_n - estimated.north)
    acceptance_distance = turn_distance(target.acceptance, turn_angle, parameters.wp_radius, l1_distance, eas2tas)
    return is_past_end or distance <= acceptance_distance


@inner
def _update_loiter(
    estimated: Record,
    waypoints: Records,
    loiter: Record,
    parameters: Record,
    memory: Record,
    l1_distance: float,
    ground_speed: float,
    eas2tas: float,
    dt: float,
) -> None:
    """Fly to a loiter and around it.

    The loiter ends when it is complete and the aircraft heads for the next waypoint.

    Follows `Plane::update_loiter`: far from the circle the aircraft flies straight to its center, then around it. The
    next leg begins once the loiter is complete and the course leads to the next waypoint outside this loiter.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    waypoints: `WAYPOINT` records of the route, (w,).
    loiter: waypoint on the loiter; its loiter_radius (m) is the radius at the altitude of the waypoint. The radius
        grows with the square of the true airspeed.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record; updated.
    l1_distance, ground_speed: L1 distance, m, and ground speed, m/s.
    eas2tas, dt: ratio of true to equivalent airspeed, and duration of a tick, s.
    """
    eas2tas_ratio = eas2tas / eas_to_tas_ratio(loiter.up)
    radius = abs(loiter.loiter_radius) * eas2tas_ratio * eas2tas_ratio
    distance = math.hypot(loiter.centre_east - estimated.east, loiter.centre_north - estimated.north)
    if not memory.loiter_started and distance > _APPROACH_LINE_RADII_RATIO * radius:
        memory.reached_loiter_target = False
        _follow_line(
            estimated,
            loiter.centre_east,
            loiter.centre_north,
            parameters,
            memory,
            l1_distance,
            ground_speed,
            dt,
            loiter.without_crosstrack,
        )
        return
    memory.lateral_acceleration = _loiter_acceleration(
        estimated, loiter, radius, parameters, memory, l1_distance, ground_speed
    )
    _update_loiter_angle(estimated, loiter, memory, dt)
    if not memory.loiter_complete and _is_loiter_done(estimated, loiter, memory):
        memory.loiter_complete, memory.exit_wait_angle = True, 0.0
    exit_index = memory.leg + 2
    while exit_index < waypoints.shape[0] and waypoints[exit_index].stop == loiter.stop:
        exit_index += 1
    if exit_index >= waypoints.shape[0]:
        return
    if (
        memory.loiter_complete
        and (memory.reached_loiter_target or loiter.loiter_turns == 0.0)
        and _is_heading_lined_up(estimated, waypoints[exit_index], loiter, radius, memory)
    ):
        memory.leg_after_loiter = exit_index - 1
        _begin_leg(estimated, waypoints, exit_index - 1, memory)


@inner
def _update_loiter_angle(estimated: Record, loiter: Record, memory: Record, dt: float) -> None:
    """Update the time on a loiter and the angle flown around it.

    Both are measured from the moment when the aircraft reaches the circle.

    Also record whether the aircraft has reached the loiter's altitude. Follows `Plane::loiter_angle_update`.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    loiter: waypoint on the loiter, a `WAYPOINT` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record; updated.
    dt: duration of a tick, s.
    """
    bearing = math.atan2(estimated.east - loiter.centre_east, estimated.north - loiter.centre_north)
    if memory.loiter_started:
        memory.loiter_time += dt
        angle_change = wrap(bearing - memory.old_loiter_bearing) * math.copysign(1.0, loiter.loiter_radius)
        memory.loiter_angle_sum += angle_change
        memory.exit_wait_angle += angle_change
    elif memory.reached_loiter_target:
        memory.loiter_started = True
        memory.next_sum_lap, memory.start_lap_altitude = _ALTITUDE_CHECK_INTERVAL_LAPS * 2.0 * math.pi, estimated.up
    memory.old_loiter_bearing = bearing
    if memory.reached_loiter_target and abs(estimated.up - loiter.up) < LOITER_ALTITUDE_TOLERANCE_M:
        memory.reached_target_altitude = True


@inner
def _is_loiter_done(estimated: Record, loiter: Record, memory: Record) -> bool:
    """Return True once a loiter's turns or time are complete, or its altitude is reached.

    The altitude is treated as reached if three laps hardly change the aircraft's altitude. Follows
    `Plane::verify_loiter_turns`, `verify_loiter_time` and `verify_loiter_to_alt`.

    estimated: estimated position and velocity over the ground, a `MOTION` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record.
    """
    if not memory.loiter_started:
        return False
    if loiter.loiters_to_altitude:
        if not memory.reached_target_altitude and memory.loiter_angle_sum >= memory.next_sum_lap:
            memory.reached_target_altitude = abs(estimated.up - memory.start_lap_altitude) < LOITER_ALTITUDE_TOLERANCE_M
            memory.next_sum_lap += _ALTITUDE_CHECK_INTERVAL_LAPS * 2.0 * math.pi
            memory.start_lap_altitude = estimated.up
        return memory.reached_target_altitude
    if math.isnan(loiter.loiter_time):
        return memory.loiter_angle_sum > loiter.loiter_turns * 2.0 * math.pi
    return memory.loiter_time > loiter.loiter_time


@inner
def _is_heading_lined_up(
    estimated: Record, next_waypoint: Record, loiter: Record, radius: float, memory: Record
) -> bool:
    """Return True if an aircraft on a loiter heads for the next waypoint, within a tolerance.

    The tolerance grows with each lap. From a loiter with an exit bearing, the aircraft leaves on this bearing. If the
    next waypoint is inside the circle, no tangent leads to it, and the aircraft leaves on a tangent that passes the
    waypoint. If the next waypoint is the loiter's center, the aircraft leaves at once. Follows
    `ModeLoiter::isHeadingLinedUp`, whose tangent touches the circle in the direction of the aircraft from the center.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    next_waypoint: `WAYPOINT` record of the next leg's end.
    loiter: `WAYPOINT` record on the circle; its exit bearing (rad) is 0 if it states none.
    radius: radius of the circle, m.
    memory: `ARDUPILOT_MEMORY` record with the angle flown since the loiter was complete.
    """
    next_e, next_n = (
        (next_waypoint.centre_east, next_waypoint.centre_north)
        if next_waypoint.is_rtl
        else target_position(next_waypoint)
    )
    side = math.copysign(1.0, loiter.loiter_radius)
    aircraft_bearing = math.atan2(estimated.east - loiter.centre_east, estimated.north - loiter.centre_north)
    offset_e, offset_n = next_e - loiter.centre_east, next_n - loiter.centre_north
    distance = math.hypot(offset_e, offset_n)
    if loiter.exit_bearing > 0.0:
        exit_course = loiter.exit_bearing
    elif radius <= 0.0 or distance < _SAME_PLACE_M:
        return True
    elif distance >= radius:
        exit_course = math.atan2(
            offset_e - radius * math.sin(aircraft_bearing), offset_n - radius * math.cos(aircraft_bearing)
        )
    else:
        segment_angle = 2.0 * math.asin((radius - distance) / (2.0 * radius))
        exit_course = math.atan2(offset_e, offset_n) + side * (0.5 * math.pi - segment_angle)
    heading_error = abs(wrap(exit_course - aircraft_bearing - side * 0.5 * math.pi))
    return heading_error <= _EXIT_HEADING_TOLERANCE_RAD + _EXIT_HEADING_GROWTH_RAD * math.floor(
        abs(memory.exit_wait_angle) / (2.0 * math.pi)
    )


@inner
def _navigate_rtl(estimated: Record, rtl: Record, parameters: Record, memory: Record, eas2tas: float) -> None:
    """Set the lateral acceleration demand of an RTL (`ModeRTL::update`, ArduPlane/mode_rtl.cpp).

    The aircraft turns to the center of the RTL loiter at once. The loiter's radius grows with altitude as the square of
    the ratio of true to equivalent airspeed (`AP_L1_Control::loiter_radius`). During the initial climb, the bank is
    limited to LEVEL_ROLL_LIMIT. The altitude slope begins where that climb ends.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    rtl: loiter at the RTL's end, a `WAYPOINT` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record; updated.
    eas2tas: ratio of true to equivalent airspeed.
    """
    if not memory.is_in_rtl:
        memory.is_in_rtl, memory.reached_loiter_target = True, False
        memory.from_east, memory.from_north, memory.from_up = estimated.east, estimated.north, estimated.up
    ground_speed = max(0.1, math.hypot(estimated.velocity_east, estimated.velocity_north))
    l1_distance = l1_length(ground_speed, parameters.navl1_period, parameters.navl1_damping)
    radius = abs(rtl.loiter_radius) * eas2tas * eas2tas
    memory.lateral_acceleration = _loiter_acceleration(
        estimated, rtl, radius, parameters, memory, l1_distance, ground_speed
    )
    if memory.rtl_climb_complete:
        return
    if int(parameters.flight_options) & CLIMB_BEFORE_TURN:
        memory.rtl_climb_complete = estimated.up > rtl.up
    else:
        memory.rtl_climb_complete = (
            parameters.rtl_climb_min <= 0.0 or estimated.up - memory.from_up > parameters.rtl_climb_min
        )
    if memory.rtl_climb_complete:
        memory.from_east, memory.from_north, memory.from_up = estimated.east, estimated.north, estimated.up
        return
    max_acceleration = GRAVITY * math.tan(parameters.level_roll_limit)
    memory.lateral_acceleration = min(max_acceleration, max(-max_acceleration, memory.lateral_acceleration))


@inner
def _loiter_acceleration(
    estimated: Record,
    loiter: Record,
    radius: float,
    parameters: Record,
    memory: Record,
    l1_distance: float,
    ground_speed: float,
) -> float:
    """Return the lateral acceleration that a loiter demands, m/s^2 (`AP_L1_Control::update_loiter`).

    The aircraft steers straight to the center until the circle demands the sharper turn; then it flies around the
    circle. From that moment the loiter is treated as reached, even if a gust or too small a radius takes the aircraft
    outside the circle.

    radius: radius of the circle, m.
    l1_distance: L1 distance, m.
    ground_speed: m/s.
    estimated: estimated position and velocity over the ground, a `MOTION` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record.
    """
    direction = math.copysign(1.0, loiter.loiter_radius)
    offset_e, offset_n = estimated.east - loiter.centre_east, estimated.north - loiter.centre_north
    distance = max(0.1, math.hypot(offset_e, offset_n))
    course = math.atan2(estimated.velocity_east, estimated.velocity_north)
    capture_angle = wrap(course - math.atan2(-offset_e, -offset_n))
    turn_angle = keep_turn_side(estimated, capture_angle, loiter.centre_east, loiter.centre_north, memory)
    capture_acceleration = l1_acceleration(turn_angle, ground_speed, l1_distance, parameters.navl1_damping)
    # Components of the ground velocity: outwards, and around the circle in the loiter's direction.
    outward_velocity = -ground_speed * math.cos(capture_angle)
    tangential_velocity = -direction * ground_speed * math.sin(capture_angle)
    omega = 2.0 * math.pi / parameters.navl1_period
    radial_error = distance - radius
    pd_correction = omega * (omega * radial_error + 2.0 * parameters.navl1_damping * outward_velocity)
    if outward_velocity > 0.0 and tangential_velocity < 0.0:
        # Flying outwards against the loiter's direction, the aircraft turns in the loiter's direction.
        pd_correction = max(pd_correction, 0.0)
    circle_acceleration = direction * (
        pd_correction + tangential_velocity * tangential_velocity / max(0.5 * radius, distance)
    )
    if radial_error > 0.0 and direction * capture_acceleration < direction * circle_acceleration:
        return capture_acceleration
    memory.reached_loiter_target = True
    return circle_acceleration
