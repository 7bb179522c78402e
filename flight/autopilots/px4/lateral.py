"""Implement PX4's lateral guidance, NPFG with its wind triangle, on the paths of a mission.

NPFG is by Furieri, Stastny, Marconi, Siegwart and Gilitschenski, "Gone with the wind: Nonlinear guidance for small
fixed-wing aircraft in arbitrarily strong windfields" (ACC 2017), extended to any path in Stastny's "On Flying
Backwards" (2019). In PX4's form (`src/lib/npfg/`) it has three steps: a course that closes in on the track and turns
along it, the heading with which the aircraft flies this course in the wind, and a lateral acceleration proportional to
the heading error.

A track is a path over the ground. Courses and headings are angles from the map's north, clockwise; a signed error is
positive to the right.
"""

import math

from aircraft.envelope import GRAVITY
from world.kernels import Record, inner

# Excess of the airspeed over the wind across a course with which the course is fully feasible, m/s.
_AIRSPEED_BUFFER_MPS = 1.5
# Gain on a heading error, 1/s: fixed in 1.17 at the value of the default period and damping (constant of
# `AirspeedDirectionController`; PX4's main branch uses the parameters again since commit 89af91dbdb, March 2026).
_HEADING_GAIN_PER_S = 0.8885
# Upper limit of the switch distance before a waypoint, m.
MAX_SWITCH_DISTANCE_M = 500.0
# Ground speed below which the bound of the track error is a parabola of the ground speed, m/s.
_MIN_GROUND_SPEED_MPS = 1.0


@inner
def bearing_feasibility(airspeed: float, wind_cross_bearing: float, wind_dot_bearing: float) -> float:
    """Return the feasibility of a course in wind, 0..1 (`bearingFeasibility`).

    The result is 1 if the airspeed is sufficient for the course, and 0 if the wind is too strong for it. It falls
    smoothly from 1 to 0 over the last `_AIRSPEED_BUFFER_MPS` of airspeed.

    wind_cross_bearing, wind_dot_bearing: wind components across and along the course, m/s.
    """
    headwind = abs(wind_cross_bearing) if wind_dot_bearing >= 0.0 else math.hypot(wind_cross_bearing, wind_dot_bearing)
    airspeed_fraction = min(1.0, max(0.0, (airspeed - headwind) / _AIRSPEED_BUFFER_MPS))
    return math.sin(0.5 * math.pi * airspeed_fraction) ** 2


@inner
def track_error_bound(ground_speed: float, time_constant: float) -> float:
    """Return the track error (m) beyond which guidance steers at a right angle to the track.

    time_constant: NPFG's time constant, s.
    """
    if ground_speed > _MIN_GROUND_SPEED_MPS:
        return ground_speed * time_constant
    return 0.5 * time_constant * (ground_speed * ground_speed + 1.0)


@inner
def straight_track_period(parameters: Record) -> float:
    """Return NPFG's period on a straight track, s: NPFG_PERIOD, or more if the roll lag requires it.

    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    """
    period: float = parameters.npfg_period
    if parameters.npfg_enables_period_lower_bound > 0.0:
        period_lower_bound = (
            math.pi
            * parameters.npfg_roll_time_constant
            / parameters.npfg_damping
            * parameters.npfg_period_safety_factor
        )
        period = max(period, period_lower_bound)
    return period


@inner
def switch_distance(ground_speed: float, parameters: Record) -> float:
    """Return the distance before a waypoint at which guidance would turn to the next leg, m.

    The distance is NPFG_SW_DST_MLT times `track_error_bound`, but at most `MAX_SWITCH_DISTANCE_M`.

    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    """
    time_constant = straight_track_period(parameters) * parameters.npfg_damping
    return min(
        MAX_SWITCH_DISTANCE_M,
        parameters.npfg_switch_distance_multiplier * track_error_bound(ground_speed, time_constant),
    )


@inner
def adapted_period(
    airspeed: float,
    wind_speed: float,
    curvature: float,
    track_feasibility: float,
    track_proximity: float,
    parameters: Record,
) -> float:
    """Return NPFG's period on a track, s.

    The period is NPFG_PERIOD, raised to a lower bound for the roll lag. On a curved track in wind an upper bound also
    applies near the track, but never below the lower bound. PX4's parameters can disable both bounds.

    curvature: curvature of the track, 1/m.
    track_feasibility: feasibility of the track's course, 0..1; see `bearing_feasibility`.
    track_proximity: 0 far from the track, 1 on the track.
    airspeed, wind_speed: m/s.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    """
    # Without wind or curvature the period of a straight track applies.
    wind_factor = 2.0 * (1.0 - math.sqrt(1.0 - min(1.0, wind_speed / max(0.1, airspeed))))
    turn_rate = abs(curvature) * airspeed
    damping = parameters.npfg_damping
    if turn_rate * wind_factor <= 0.0 or damping < 0.5:
        return straight_track_period(parameters)
    period: float = parameters.npfg_period
    straight_period_lower_bound = math.pi * parameters.npfg_roll_time_constant / damping
    if parameters.npfg_enables_period_lower_bound > 0.0:
        curved_period_lower_bound = (
            4.0 * math.pi * parameters.npfg_roll_time_constant * damping * track_feasibility
            + (1.0 - track_feasibility) * straight_period_lower_bound
        )
        period_lower_bound = (
            curved_period_lower_bound * track_proximity + straight_period_lower_bound * (1.0 - track_proximity)
        ) * parameters.npfg_period_safety_factor
        period = max(period, period_lower_bound)
        if parameters.npfg_enables_period_upper_bound > 0.0:
            period_upper_bound = 4.0 * math.pi * damping / (turn_rate * wind_factor * max(1e-3, track_feasibility))
            period += (max(period_lower_bound, min(period, period_upper_bound)) - period) * track_proximity
    return period


@inner
def reference_air_velocity(
    bearing_east: float, bearing_north: float, wind_east: float, wind_north: float, airspeed: float
) -> tuple[float, float]:
    """Return the velocity through the air that gives a course over ground in a wind: east and north, m/s.

    If the wind is too strong for the course, the ground course of the result is as close to the course as possible.

    bearing_east, bearing_north: unit vector of the course.
    wind_east, wind_north: velocity of the air, m/s.
    airspeed: m/s.
    """
    wind_cross_bearing = wind_east * bearing_north - wind_north * bearing_east
    wind_dot_bearing = wind_east * bearing_east + wind_north * bearing_north
    wind_speed = math.hypot(wind_east, wind_north)
    if abs(wind_cross_bearing) < airspeed and (wind_dot_bearing > 0.0 or wind_speed < airspeed):
        ground_speed = wind_dot_bearing + math.sqrt(airspeed * airspeed - wind_cross_bearing * wind_cross_bearing)
        return ground_speed * bearing_east - wind_east, ground_speed * bearing_north - wind_north
    remaining_speed = math.sqrt(max(0.0, wind_speed * wind_speed - airspeed * airspeed))
    air_east, air_north = remaining_speed * bearing_east - wind_east, remaining_speed * bearing_north - wind_north
    air_speed = max(1e-6, math.hypot(air_east, air_north))
    return airspeed * air_east / air_speed, airspeed * air_north / air_speed


@inner
def heading_error_sine(air_east: float, air_north: float, reference_east: float, reference_north: float) -> float:
    """Return the sine of the angle from the air velocity to its reference, positive to the right.

    Beyond 90 degrees the result is 1 or -1.

    air_east, air_north: velocity through the air, m/s.
    reference_east, reference_north: reference of this velocity, m/s.
    """
    speed_product = max(1e-6, math.hypot(air_east, air_north) * math.hypot(reference_east, reference_north))
    sine = (air_north * reference_east - air_east * reference_north) / speed_product
    if air_north * reference_north + air_east * reference_east < 0.0:
        return math.copysign(1.0, sine)
    return sine


@inner
def _look_ahead_angle(track_error: float, error_bound: float) -> float:
    """Return the angle of the commanded bearing from the perpendicular to the track, rad.

    It is 0 far from the track, where the bearing points to the track, and pi/2 on it, where the bearing leads along it.

    track_error: distance from the track, m.
    error_bound: result of `track_error_bound`, m.
    """
    return 0.5 * math.pi * (1.0 - min(1.0, abs(track_error) / error_bound)) ** 2


@inner
def guide_to_path(
    estimated: Record,
    path_east: float,
    path_north: float,
    tangent_east: float,
    tangent_north: float,
    curvature: float,
    wind_east: float,
    wind_north: float,
    target_airspeed: float,
    parameters: Record,
    memory: Record,
) -> None:
    """Set ``memory.lateral_acceleration`` to join and follow a track (`guideToPath`).

    Far from the track the commanded course points to it, on the track along it.

    path_east, path_north, curvature: the track's nearest point, m, and curvature there, 1/m, positive to the right.
    tangent_east, tangent_north, wind_east, wind_north: unit vector along the track there; velocity of the air, m/s.
    target_airspeed: m/s. If the ground speed would be too low at this airspeed, ``memory.min_airspeed`` is set.
    estimated, parameters, memory: `MOTION`, `PX4_PARAMETERS` and `PX4_MEMORY` records.
    """
    air_east, air_north = estimated.velocity_east - wind_east, estimated.velocity_north - wind_north
    airspeed = max(0.1, math.hypot(air_east, air_north))
    ground_speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    wind_speed = math.hypot(wind_east, wind_north)
    offset_east, offset_north = estimated.east - path_east, estimated.north - path_north
    track_error = tangent_north * offset_east - tangent_east * offset_north
    wind_cross_track = wind_east * tangent_north - wind_north * tangent_east
    wind_dot_track = wind_east * tangent_east + wind_north * tangent_north
    track_feasibility = bearing_feasibility(airspeed, wind_cross_track, wind_dot_track)
    damping = parameters.npfg_damping
    # The period depends on the proximity to the track, and the proximity on the period: begin with the straight period.
    straight_error_bound = track_error_bound(ground_speed, straight_track_period(parameters) * damping)
    straight_proximity = math.sin(_look_ahead_angle(track_error, straight_error_bound)) ** 2
    period = adapted_period(airspeed, wind_speed, curvature, track_feasibility, straight_proximity, parameters)
    error_bound = track_error_bound(ground_speed, period * damping)
    look_ahead_angle = _look_ahead_angle(track_error, error_bound)
    proximity = math.sin(look_ahead_angle) ** 2
    # The bearing points to the track at a right angle far from it, and along the track on it.
    side = math.copysign(1.0, track_error)
    bearing_east = -math.cos(look_ahead_angle) * side * tangent_north + math.sin(look_ahead_angle) * tangent_east
    bearing_north = math.cos(look_ahead_angle) * side * tangent_east + math.sin(look_ahead_angle) * tangent_north
    wind_cross_bearing = wind_east * bearing_north - wind_north * bearing_east
    wind_dot_bearing = wind_east * bearing_east + wind_north * bearing_north
    course_feasibility = bearing_feasibility(airspeed, wind_cross_bearing, wind_dot_bearing)
    # Airspeed at which the ground speed on the bearing is its minimum.
    min_airspeed = math.hypot(parameters.min_ground_speed - wind_dot_bearing, wind_cross_bearing)
    ground_speed_on_bearing = wind_dot_bearing + math.sqrt(
        max(0.0, target_airspeed * target_airspeed - wind_cross_bearing * wind_cross_bearing)
    )
    memory.min_airspeed = min_airspeed if ground_speed_on_bearing < parameters.min_ground_speed else 0.0
    reference_airspeed = max(target_airspeed, memory.min_airspeed)
    reference_east, reference_north = reference_air_velocity(
        bearing_east, bearing_north, wind_east, wind_north, reference_airspeed
    )
    error_sine = heading_error_sine(air_east, air_north, reference_east, reference_north)
    gain = 4.0 * math.pi * damping / period if parameters.uses_switch_distance else _HEADING_GAIN_PER_S
    # Feed-forward for the curvature of the track, at the aircraft's distance from the track.
    track_speed = max(0.0, estimated.velocity_east * tangent_east + estimated.velocity_north * tangent_north)
    local_curvature = curvature / max(1.0 - curvature * track_error, max(1e-6, 0.5 * abs(curvature)))
    speed_ratio = 1.0 + wind_dot_track / math.sqrt(max(1e-6, airspeed * airspeed - wind_cross_track * wind_cross_track))
    feedforward = (
        airspeed * speed_ratio * local_curvature * track_speed * course_feasibility * track_feasibility * proximity
    )
    memory.lateral_acceleration = gain * airspeed * error_sine + feedforward


@inner
def follow_leg(
    estimated: Record,
    end_east: float,
    end_north: float,
    wind_east: float,
    wind_north: float,
    target_airspeed: float,
    parameters: Record,
    memory: Record,
) -> None:
    """Guide the aircraft onto the line from the leg's start to its end (`navigateWaypoints`).

    An aircraft past the end flies straight back to the end. An aircraft before the start, and further from it than the
    switch distance, flies straight to the start.
    end_east, end_north: end of the leg, m. Its start is in the memory, where the lateral acceleration is set.
    wind_east, wind_north, target_airspeed: velocity of the air and airspeed to fly at, m/s.
    estimated, parameters, memory: `MOTION`, `PX4_PARAMETERS` and `PX4_MEMORY` records.
    """
    leg_east, leg_north = end_east - memory.from_east, end_north - memory.from_north
    length = math.hypot(leg_east, leg_north)
    from_start_east, from_start_north = estimated.east - memory.from_east, estimated.north - memory.from_north
    to_end_east, to_end_north = end_east - estimated.east, end_north - estimated.north
    is_before_start = from_start_east * leg_east + from_start_north * leg_north < 0.0
    ground_speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    target_east, target_north, flies_to_point = 0.0, 0.0, False
    if length < 1e-3 or to_end_east * leg_east + to_end_north * leg_north < 0.0:
        target_east, target_north, flies_to_point = to_end_east, to_end_north, True
    elif is_before_start and math.hypot(from_start_east, from_start_north) > switch_distance(ground_speed, parameters):
        target_east, target_north, flies_to_point = -from_start_east, -from_start_north, True
    if flies_to_point:
        distance = max(1e-3, math.hypot(target_east, target_north))
        guide_to_path(
            estimated,
            estimated.east,
            estimated.north,
            target_east / distance,
            target_north / distance,
            0.0,
            wind_east,
            wind_north,
            target_airspeed,
            parameters,
            memory,
        )
        return
    tangent_east, tangent_north = leg_east / length, leg_north / length
    distance_along = from_start_east * tangent_east + from_start_north * tangent_north
    guide_to_path(
        estimated,
        memory.from_east + distance_along * tangent_east,
        memory.from_north + distance_along * tangent_north,
        tangent_east,
        tangent_north,
        0.0,
        wind_east,
        wind_north,
        target_airspeed,
        parameters,
        memory,
    )


@inner
def follow_loiter(
    estimated: Record,
    center_east: float,
    center_north: float,
    radius: float,
    wind_east: float,
    wind_north: float,
    target_airspeed: float,
    parameters: Record,
    memory: Record,
) -> None:
    """Guide the aircraft onto a loiter circle (`navigateLoiter`).

    At the center of the circle, where no radius leads to the aircraft, the direction of its ground velocity is used.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    center_east, center_north: center of the circle, m.
    radius: m, positive to the right.
    wind_east, wind_north: velocity of the air, m/s.
    target_airspeed: m/s.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: `PX4_MEMORY` record; its lateral acceleration is set.
    """
    radial_east, radial_north = estimated.east - center_east, estimated.north - center_north
    distance = math.hypot(radial_east, radial_north)
    if distance < 0.1:
        ground_speed = max(1e-3, math.hypot(estimated.velocity_east, estimated.velocity_north))
        radial_east, radial_north = estimated.velocity_east / ground_speed, estimated.velocity_north / ground_speed
    else:
        radial_east, radial_north = radial_east / distance, radial_north / distance
    turn_direction, abs_radius = math.copysign(1.0, radius), max(1.0, abs(radius))
    guide_to_path(
        estimated,
        center_east + abs_radius * radial_east,
        center_north + abs_radius * radial_north,
        turn_direction * radial_north,
        -turn_direction * radial_east,
        turn_direction / abs_radius,
        wind_east,
        wind_north,
        target_airspeed,
        parameters,
        memory,
    )


@inner
def roll_setpoint(lateral_acceleration: float, parameters: Record) -> float:
    """Return the roll setpoint (rad) that gives a lateral acceleration (m/s^2), limited to FW_R_LIM.

    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    """
    roll = math.atan(lateral_acceleration / GRAVITY)
    return min(parameters.roll_limit, max(-parameters.roll_limit, roll))
