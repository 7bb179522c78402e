"""Navigate as PX4 does: choose and accept waypoints, and set the altitude setpoint on a leg.

Follows PX4's `src/modules/navigator/mission_block.cpp` (`is_mission_item_reached_or_completed`) and
`src/modules/fw_mode_manager` (to 1.16 `fw_pos_control`). A waypoint is reached within a radius of it, or past the plane
through it across the leg, but only within NAV_FW_ALT_RAD of its altitude. An aircraft that arrives too high or too low
circles at the waypoint until it is within that tolerance. The radius is NAV_ACC_RAD or, up to 1.16, the switch distance
of the guidance if it is larger. PX4 ignores an item's own radius (its second parameter) for fixed wings.

From the start of a loiter's leg PX4 guides the aircraft onto the circle (`control_auto_loiter`): from a distance it
flies straight to the center. The loiter is reached within that radius of its rim and near its altitude, and its time
runs from then on. When the time is over, the aircraft at once joins the line from the center to the next waypoint. If
the item says so, it leaves on the course to the next waypoint, or joins a line that begins at the tangent point on the
rim. LOITER_TIME demands its altitude from the start; LOITER_TO_ALT demands the altitude at the start of its leg until
the rim is reached, and its own altitude from then on.

The aircraft does not fly to a gate (CONDITION_GATE), but to the waypoint after it. A change of speed between the two
items takes effect where the aircraft crosses the plane through the gate. Once the last waypoint is reached, PX4
circles with NAV_LOITER_RAD: about that waypoint, up to 1.16 about the aircraft's position at that time
(`setEndOfMissionItems`).
"""

import math

from flight.autopilots.px4.lateral import follow_leg, follow_loiter, switch_distance
from world.geometry import wrap
from world.kernels import Record, Records, inlined, inner

# Delay from reaching a waypoint to the turn, s: the navigator's loop, its message to the position controller and the
# controller's turn. At 33 waypoints of the stored flights it was 0.13 s on average, 0.02 to 0.26. PX4 1.17 and 1.18,
# which turn by the same rule, differ from each other by up to 5.9 m at the same waypoints; a simulation without that
# delay is never closer than 3 m.
SWITCH_DELAY_S = 0.13
# Course tolerance for leaving a loiter on the course to the next waypoint, rad (`kCosineExitCourseThreshold`).
EXIT_COURSE_TOLERANCE_RAD = math.radians(5.0)
# Minimum distance of the next waypoint from the loiter's center, in radii, for an exit on course: the course of the
# loiter never points to a closer waypoint.
_MIN_EXIT_DISTANCE_RATIO = 1.05


@inner
def acceptance_radius_at(ground_speed: float, parameters: Record) -> float:
    """Return the acceptance radius of a waypoint at a ground speed (m/s), m (`get_acceptance_radius`).

    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    """
    radius: float = parameters.acceptance_radius
    if parameters.uses_switch_distance:
        radius = max(radius, switch_distance(ground_speed, parameters))
    return radius


@inner
def _altitude_acceptance_radius(target: Record, parameters: Record) -> float:
    """Return the altitude tolerance within which a waypoint or a loiter is accepted, m.

    The tolerance is infinite in a landing sequence (`setActiveMissionItems`), NAV_FW_ALTL_RAD before a landing, and
    otherwise NAV_FW_ALT_RAD. Follows `Navigator::get_altitude_acceptance_radius`.

    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    """
    if target.ignores_altitude:
        return math.inf
    radius: float = parameters.altitude_acceptance_radius
    return parameters.landing_altitude_acceptance_radius if target.precedes_landing else radius


@inner
def is_past_waypoint(estimated: Record, target: Record, memory: Record) -> bool:
    """Return True if the aircraft is past the end of the leg.

    It is past the end if it has crossed the vertical plane through the end that is perpendicular to the leg. The result
    is False for a leg without length.

    estimated: estimated position and velocity over the ground, a `MOTION` record.
    memory: internal state of the control law, a `PX4_MEMORY` record.
    """
    leg_east, leg_north = target.east - memory.from_east, target.north - memory.from_north
    distance_past = (estimated.east - target.east) * leg_east + (estimated.north - target.north) * leg_north
    return leg_east * leg_east + leg_north * leg_north > 1e-6 and distance_past > 0.0


@inner
def navigate(
    estimated: Record,
    waypoints: Records,
    wind_east: float,
    wind_north: float,
    target_airspeed: float,
    parameters: Record,
    memory: Record,
    dt: float,
) -> None:
    """Follow the current leg, and set the altitude setpoint.

    The next leg begins once the target is reached.

    The target is the next waypoint, loiter or RTL. Gates before it only divide the way to it into legs.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    waypoints: (w,) of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    wind_east, wind_north: velocity of the air, m/s.
    target_airspeed: m/s.
    parameters: a record of `flight.autopilots.px4.parameters.PX4_PARAMETERS`.
    memory: a record of `flight.autopilots.px4.law.PX4_MEMORY`.
    dt: s.
    """
    target_index = find_target(waypoints, memory)
    target = waypoints[target_index]
    if target_index > memory.leg + 1:
        # A gate is passed in the vertical plane through it, perpendicular to the course from the gate to the target.
        gate = waypoints[memory.leg + 1]
        normal_east, normal_north = target.east - gate.east, target.north - gate.north
        if (estimated.east - gate.east) * normal_east + (estimated.north - gate.north) * normal_north >= 0.0:
            memory.leg += 1
    if target.is_rtl:
        # An RTL is one leg, which lasts until the flight ends.
        _navigate_rtl(estimated, target, wind_east, wind_north, target_airspeed, parameters, memory)
        return
    if target.loiter_radius != 0.0:
        _navigate_loiter(estimated, waypoints, target, wind_east, wind_north, target_airspeed, parameters, memory, dt)
    else:
        _navigate_waypoint(
            estimated, waypoints, target_index, wind_east, wind_north, target_airspeed, parameters, memory, dt
        )


@inner
def find_target(waypoints: Records, memory: Record) -> int:
    """Return the index of the target: the next waypoint that is not a gate.

    waypoints: `WAYPOINT` records of the route, (w,).
    memory: internal state of the control law, a `PX4_MEMORY` record.
    """
    target_index: int = memory.leg + 1
    while waypoints[target_index].is_gate:
        target_index += 1
    return target_index


@inlined
def _update_time_since_reached(memory: Record, is_reached: bool, dt: float) -> None:
    """Add a tick to the time since a target was reached, s; the time is 0 until the target is reached.

    memory: `PX4_MEMORY` record with the time.
    is_reached: True if the aircraft is at the target in this tick.
    dt: duration of a tick, s.
    """
    has_reached = memory.time_since_reached > 0.0 or is_reached
    memory.time_since_reached = memory.time_since_reached + dt if has_reached else 0.0


@inner
def _navigate_waypoint(
    estimated: Record,
    waypoints: Records,
    target_index: int,
    wind_east: float,
    wind_north: float,
    target_airspeed: float,
    parameters: Record,
    memory: Record,
    dt: float,
) -> None:
    """Follow the leg to a waypoint, and begin the next leg once the waypoint is reached.

    If the aircraft is too high or too low at the waypoint, it loiters there first. At the last waypoint of a mission it
    loiters indefinitely: about the waypoint, or up to 1.16 about the position at which it reached the waypoint.

    estimated: position and velocity over the ground, a `MOTION` record.
    waypoints, target_index: `WAYPOINT` records of the route, (w,), and the index of the waypoint.
    wind_east, wind_north, target_airspeed: velocity of the air and airspeed to fly at, m/s.
    parameters, memory: PX4's parameters, and the control law's internal state, which is updated.
    dt: duration of a tick, s.
    """
    target = waypoints[target_index]
    ground_speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    turn_distance, loiter_radius = switch_distance(ground_speed, parameters), parameters.loiter_radius
    distance = math.hypot(target.east - estimated.east, target.north - estimated.north)
    memory.min_distance_to_end = min(memory.min_distance_to_end, distance)
    altitude_error = abs(estimated.up - target.up)
    is_off_altitude = altitude_error > parameters.altitude_acceptance_radius and not target.ignores_altitude
    is_accepted_altitude = altitude_error <= _altitude_acceptance_radius(target, parameters)
    # A circle continues even if the aircraft drifts far outside it.
    memory.is_loitering = memory.mission_finished or (
        is_off_altitude and (memory.is_loitering or distance < turn_distance)
    )
    if memory.is_loitering:
        east, north = target.east, target.north
        if memory.mission_finished and parameters.uses_switch_distance:
            east, north = memory.from_east, memory.from_north
        follow_loiter(estimated, east, north, loiter_radius, wind_east, wind_north, target_airspeed, parameters, memory)
        memory.altitude_setpoint = target.up
    else:
        follow_leg(estimated, target.east, target.north, wind_east, wind_north, target_airspeed, parameters, memory)
        memory.altitude_setpoint = foh_altitude(
            target.east, target.north, target.up, max(turn_distance, abs(loiter_radius)), memory
        )
    is_end = target_index + 1 >= waypoints.shape[0]
    if is_end and not target.is_mission_end:
        return
    is_reached = distance <= acceptance_radius_at(ground_speed, parameters) or is_past_waypoint(
        estimated, target, memory
    )
    _update_time_since_reached(memory, is_reached and is_accepted_altitude, dt)
    if memory.time_since_reached <= SWITCH_DELAY_S:
        return
    if is_end:
        if parameters.uses_switch_distance and not memory.mission_finished:
            memory.from_east, memory.from_north = estimated.east, estimated.north
        memory.mission_finished = True
    else:
        begin_leg(estimated, waypoints, target_index, memory)


@inner
def _navigate_loiter(
    estimated: Record,
    waypoints: Records,
    loiter: Record,
    wind_east: float,
    wind_north: float,
    target_airspeed: float,
    parameters: Record,
    memory: Record,
    dt: float,
) -> None:
    """Fly to a loiter and around it until the loiter's end condition is met, then begin the next leg.

    A loiter to an altitude first keeps the altitude at the start of the leg until the aircraft is on the circle.

    estimated: position and velocity over the ground, a `MOTION` record.
    waypoints, loiter: `WAYPOINT` records of the route, (w,), and the one on the loiter.
    wind_east, wind_north, target_airspeed: velocity of the air and airspeed to fly at, m/s.
    parameters, memory: PX4's parameters, and the control law's internal state, which is updated.
    dt: duration of a tick, s.
    """
    ground_speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    distance = math.hypot(loiter.centre_east - estimated.east, loiter.centre_north - estimated.north)
    memory.is_loitering = True
    follow_loiter(
        estimated,
        loiter.centre_east,
        loiter.centre_north,
        loiter.loiter_radius,
        wind_east,
        wind_north,
        target_airspeed,
        parameters,
        memory,
    )
    is_on_rim = distance <= abs(loiter.loiter_radius) + acceptance_radius_at(ground_speed, parameters)
    altitude_radius = _altitude_acceptance_radius(loiter, parameters)
    if loiter.loiters_to_altitude and not memory.rim_reached:
        memory.altitude_setpoint = memory.leg_start_altitude
        memory.rim_reached = is_on_rim and abs(estimated.up - memory.leg_start_altitude) <= altitude_radius
        return
    memory.altitude_setpoint = loiter.up
    is_at_altitude = abs(estimated.up - loiter.up) <= altitude_radius
    _update_time_since_reached(memory, is_on_rim and is_at_altitude, dt)
    exit_index = memory.leg + 2
    if math.isnan(loiter.loiter_time):
        # PX4 refuses loiters by turns; leave it at the same point as the route.
        if exit_index < waypoints.shape[0] and is_on_rim and is_past_corner(estimated, loiter):
            begin_leg(estimated, waypoints, memory.leg + 1, memory)
        return
    while exit_index < waypoints.shape[0] and waypoints[exit_index].stop == loiter.stop:
        exit_index += 1
    if exit_index >= waypoints.shape[0] or memory.time_since_reached <= loiter.loiter_time + SWITCH_DELAY_S:
        return
    # A loiter may be left only on the course to the next waypoint, unless this waypoint is so close to the loiter's
    # center that the course never points to it.
    next_east, next_north = _setpoint_position(waypoints[exit_index])
    next_distance = math.hypot(next_east - loiter.centre_east, next_north - loiter.centre_north)
    bearing = math.atan2(next_east - estimated.east, next_north - estimated.north)
    course_error = abs(wrap(bearing - math.atan2(estimated.velocity_east, estimated.velocity_north)))
    if (
        not loiter.exits_on_course
        or next_distance <= _MIN_EXIT_DISTANCE_RATIO * abs(loiter.loiter_radius)
        or course_error < EXIT_COURSE_TOLERANCE_RAD
    ):
        begin_leg(estimated, waypoints, exit_index - 1, memory)


@inner
def is_last_target(waypoints: Records, memory: Record) -> bool:
    """Return True if the target is the last target of the route; waypoints on one loiter are one target.

    waypoints: `WAYPOINT` records of the route, (w,).
    memory: internal state of the control law, a `PX4_MEMORY` record.
    """
    target_index = find_target(waypoints, memory)
    target = waypoints[target_index]
    return target_index + 1 >= waypoints.shape[0] or (target.loiter_radius != 0.0 and waypoints[-1].stop == target.stop)


@inner
def _setpoint_position(waypoint: Record) -> tuple[float, float]:
    """Return the position setpoint of a waypoint: east and north, m.

    It is the waypoint, or the center of its loiter.
    """
    return (
        (waypoint.centre_east, waypoint.centre_north)
        if waypoint.loiter_radius != 0.0
        else (waypoint.east, waypoint.north)
    )


@inner
def climb_before_return(
    estimated: Record,
    lowest_return_altitude: float,
    wind_east: float,
    wind_north: float,
    target_airspeed: float,
    parameters: Record,
    memory: Record,
) -> bool:
    """Climb in a loiter where the RTL began; return True until the aircraft is at the return altitude.

    During the climb ``memory.from_east`` and ``from_north`` are the position at which the RTL began; after it, the
    position at which the climb ended. ``memory.from_up`` always is the altitude at which the RTL began.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    lowest_return_altitude: return altitude of an RTL that begins lower, m AMSL.
    wind_east, wind_north: velocity of the air, m/s.
    target_airspeed: m/s.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: internal state of the control law, a `PX4_MEMORY` record; updated.
    """
    if not memory.is_in_rtl:
        memory.is_in_rtl, memory.is_loitering = True, False
        memory.from_east, memory.from_north, memory.from_up = estimated.east, estimated.north, estimated.up
    if memory.rtl_climb_complete:
        return False
    return_altitude = max(memory.from_up, lowest_return_altitude)
    memory.rtl_climb_complete = estimated.up >= return_altitude - parameters.altitude_acceptance_radius
    if memory.rtl_climb_complete:
        memory.from_east, memory.from_north = estimated.east, estimated.north
        return False
    memory.altitude_setpoint = return_altitude
    follow_loiter(
        estimated,
        memory.from_east,
        memory.from_north,
        parameters.loiter_radius,
        wind_east,
        wind_north,
        target_airspeed,
        parameters,
        memory,
    )
    return True


@inner
def _navigate_rtl(
    estimated: Record,
    rtl: Record,
    wind_east: float,
    wind_north: float,
    target_airspeed: float,
    parameters: Record,
    memory: Record,
) -> None:
    """Fly an RTL: climb in a loiter if necessary, fly straight to the target, and descend there.

    Follows PX4's `src/modules/navigator/rtl.cpp` and `rtl_direct.cpp`. The return altitude is RTL_RETURN_ALT above the
    destination, or the altitude at the start of the RTL if that is higher. The aircraft does not descend on the way.
    Over its target it descends to RTL_DESCEND_ALT.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    rtl: waypoint of the RTL's loiter.
    wind_east, wind_north: velocity of the air, m/s.
    target_airspeed: m/s.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: internal state of the control law, a `PX4_MEMORY` record; updated.
    """
    # The target is RTL_DESCEND_ALT above the destination, but no higher than the return altitude.
    lowest_return_altitude = rtl.up + max(0.0, parameters.rtl_altitude - parameters.rtl_descend_altitude)
    if climb_before_return(
        estimated, lowest_return_altitude, wind_east, wind_north, target_airspeed, parameters, memory
    ):
        return
    speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    distance = math.hypot(rtl.centre_east - estimated.east, rtl.centre_north - estimated.north)
    memory.is_loitering = memory.is_loitering or distance < abs(rtl.loiter_radius) + switch_distance(speed, parameters)
    memory.altitude_setpoint = rtl.up if memory.is_loitering else max(memory.from_up, lowest_return_altitude)
    # The leg to the target is flown as a loiter, whose guidance leads straight to the center from a distance.
    follow_loiter(
        estimated,
        rtl.centre_east,
        rtl.centre_north,
        rtl.loiter_radius,
        wind_east,
        wind_north,
        target_airspeed,
        parameters,
        memory,
    )


@inner
def begin_leg(estimated: Record, waypoints: Records, leg: int, memory: Record) -> None:
    """Make ``leg`` the current leg, and set the start of the line that the aircraft follows.

    The line leads to the end of the leg. It starts at the leg's first waypoint. After a loiter it starts at the
    loiter's center, or at the tangent point on the circle if the item states an exit on the tangent. After a loiter by
    turns, which PX4 refuses, it starts at the aircraft's position.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    waypoints: `WAYPOINT` records of the route, (w,).
    leg: index of the leg's first waypoint.
    memory: internal state of the control law, a `PX4_MEMORY` record; updated.
    """
    start, end = waypoints[leg], waypoints[leg + 1]
    memory.leg = leg
    memory.from_east, memory.from_north = _setpoint_position(start)
    memory.from_up = start.up
    if start.loiter_radius != 0.0 and math.isnan(start.loiter_time):
        memory.from_east, memory.from_north = estimated.east, estimated.north
    if start.loiter_radius != 0.0 and start.exits_on_tangent and not math.isnan(start.loiter_time):
        end_east, end_north = _setpoint_position(end)
        bearing = math.atan2(end_east - start.centre_east, end_north - start.centre_north)
        cosine = abs(start.loiter_radius) / max(
            1e-3, math.hypot(end_east - start.centre_east, end_north - start.centre_north)
        )
        exit_bearing = bearing - math.copysign(math.acos(min(1.0, cosine)), start.loiter_radius)
        memory.from_east += abs(start.loiter_radius) * math.sin(exit_bearing)
        memory.from_north += abs(start.loiter_radius) * math.cos(exit_bearing)
    if not (start.loiter_radius != 0.0 and start.stop == end.stop):
        memory.is_loitering, memory.rim_reached, memory.leg_start_altitude = False, False, estimated.up
        memory.time_since_reached = 0.0
    memory.min_distance_to_end = math.inf


@inner
def is_past_corner(estimated: Record, corner: Record) -> bool:
    """Return True if the aircraft is 0 to 90 degrees past a waypoint on its loiter circle.

    The sign of the circle's radius gives the direction of flight.

    estimated: estimated position and velocity over the ground, a `MOTION` record.
    corner: the waypoint on the circle, with the circle's center and radius, a `WAYPOINT` record.
    """
    corner_bearing = math.atan2(corner.east - corner.centre_east, corner.north - corner.centre_north)
    bearing = math.atan2(estimated.east - corner.centre_east, estimated.north - corner.centre_north)
    angle_past = wrap(bearing - corner_bearing) * math.copysign(1.0, corner.loiter_radius)
    return 0.0 <= angle_past < 0.5 * math.pi


@inner
def foh_altitude(end_east: float, end_north: float, end_up: float, lead_distance: float, memory: Record) -> float:
    """Return the altitude setpoint on the slope of a leg, m AMSL, by PX4's first-order hold (FOH).

    The slope ends ``lead_distance`` m before the end of the leg. The setpoint depends on the minimum horizontal
    distance to the end so far. On a leg no longer than ``lead_distance``, the setpoint is the altitude of the leg's
    end.

    end_east, end_north, end_up: end of the leg, m.
    memory: internal state of the control law, a `PX4_MEMORY` record.
    """
    leg_length = math.hypot(end_east - memory.from_east, end_north - memory.from_north)
    min_distance = min(memory.min_distance_to_end, leg_length)
    if leg_length <= lead_distance or min_distance <= lead_distance:
        return end_up
    return memory.from_up + (end_up - memory.from_up) * (leg_length - min_distance) / (leg_length - lead_distance)
