"""Implement PX4's lateral guidance, NPFG with its wind triangle, on the paths of a mission.

NPFG is by Furieri, Stastny, Marconi, Siegwart and Gilitschenski, "Gone with the wind: Nonlinear guidance for small
fixed-wing aircraft in arbitrarily strong windfields" (ACC 2017), extended to any path in Stastny's "On Flying
Backwards" (2019), in PX4's form (`src/lib/npfg/`): a course that closes in on the track and turns along it, the heading
that flies this course in the wind, and a lateral acceleration proportional to the heading error.

Tracks are flown over the ground: courses and headings are angles from the map's north, clockwise, and a signed error is
positive to the right.
"""

import math

from aircraft.envelope import GRAVITY
from world.kernels import Record, inner

# A course is fully feasible where the airspeed exceeds the wind across it by this, m/s.
_AIRSPEED_BUFFER_MPS = 1.5
# Gain on a heading error, 1/s: 1.17 fixes it at the value of the default period and damping (the constant of
# `AirspeedDirectionController`; PX4's main branch uses the parameters again since commit 89af91dbdb, March 2026).
_HEADING_GAIN_PER_S = 0.8885
# Upper limit of the distance at which guidance turns before a waypoint, m.
MAX_SWITCH_DISTANCE = 500.0
# Below this ground speed (m/s) the track error's bound is a parabola of the ground speed.
_MIN_GROUND_SPEED_MPS = 1.0


@inner
def feasibility(airspeed: float, wind_across: float, wind_along: float) -> float:
    """Return the feasibility of a course, from 1 with enough airspeed to 0 where the wind prevails.

    wind_across, wind_along: components of the wind across and along the course, m/s.
    """
    headwind = abs(wind_across) if wind_along >= 0.0 else math.hypot(wind_across, wind_along)
    fraction = min(1.0, max(0.0, (airspeed - headwind) / _AIRSPEED_BUFFER_MPS))
    return math.sin(0.5 * math.pi * fraction) ** 2


@inner
def error_bound(ground_speed: float, time_constant: float) -> float:
    """Return the track error (m) beyond which guidance approaches the track at right angles.

    time_constant: NPFG's time constant, s.
    """
    if ground_speed > _MIN_GROUND_SPEED_MPS:
        return ground_speed * time_constant
    return 0.5 * time_constant * (ground_speed * ground_speed + 1.0)


@inner
def straight_period(parameters: Record) -> float:
    """Return the period on a straight track, s: NPFG_PERIOD, or more if the roll lag requires it."""
    period: float = parameters.npfg_period
    if parameters.npfg_lower_bound > 0.0:
        period_min = math.pi * parameters.npfg_roll_time / parameters.npfg_damping * parameters.npfg_period_safety
        period = max(period, period_min)
    return period


@inner
def switch_distance(ground_speed: float, parameters: Record) -> float:
    """Return the distance before a waypoint at which guidance would turn to the next leg, m.

    It is NPFG_SW_DST_MLT times the bound of the track error.
    """
    time_constant = straight_period(parameters) * parameters.npfg_damping
    return min(MAX_SWITCH_DISTANCE, parameters.npfg_switch_share * error_bound(ground_speed, time_constant))


@inner
def adapted_period(
    airspeed: float, wind_speed: float, curvature: float, track_feasibility: float, proximity: float, parameters: Record
) -> float:
    """Return a period that is stable with the roll lag and short enough for a curve in wind, s.

    track_feasibility: feasibility of the track, 0..1.
    proximity: proximity to the track, 0..1.
    """
    wind_factor = 2.0 * (1.0 - math.sqrt(1.0 - min(1.0, wind_speed / max(0.1, airspeed))))
    turn_rate = abs(curvature) * airspeed
    damping = parameters.npfg_damping
    if turn_rate * wind_factor <= 0.0 or damping < 0.5:
        return straight_period(parameters)
    period: float = parameters.npfg_period
    straight_period_min = math.pi * parameters.npfg_roll_time / damping
    if parameters.npfg_lower_bound > 0.0:
        curved_period_min = (
            4.0 * math.pi * parameters.npfg_roll_time * damping * track_feasibility
            + (1.0 - track_feasibility) * straight_period_min
        )
        period_min = (
            curved_period_min * proximity + straight_period_min * (1.0 - proximity)
        ) * parameters.npfg_period_safety
        period = max(period, period_min)
        if parameters.npfg_upper_bound > 0.0:
            period_max = 4.0 * math.pi * damping / (turn_rate * wind_factor * max(1e-3, track_feasibility))
            period += (max(period_min, min(period, period_max)) - period) * proximity
    return period


@inner
def heading_for(
    course_east: float, course_north: float, wind_east: float, wind_north: float, airspeed: float
) -> tuple[float, float]:
    """Return the air velocity (m/s, east and north) that flies a course (a unit vector) in a wind.

    If no heading flies the course, return the velocity whose ground track deviates least from it.
    """
    wind_across = wind_east * course_north - wind_north * course_east
    wind_along = wind_east * course_east + wind_north * course_north
    wind_speed = math.hypot(wind_east, wind_north)
    if abs(wind_across) < airspeed and (wind_along > 0.0 or wind_speed < airspeed):
        ground_speed = wind_along + math.sqrt(airspeed * airspeed - wind_across * wind_across)
        return ground_speed * course_east - wind_east, ground_speed * course_north - wind_north
    remaining_speed = math.sqrt(max(0.0, wind_speed * wind_speed - airspeed * airspeed))
    east, north = remaining_speed * course_east - wind_east, remaining_speed * course_north - wind_north
    length = max(1e-6, math.hypot(east, north))
    return airspeed * east / length, airspeed * north / length


@inner
def turn_share(air_east: float, air_north: float, demand_east: float, demand_north: float) -> float:
    """Return the sine of the angle from the air velocity to a demanded one, positive to the right.

    The result is 1 or -1 beyond 90 degrees.
    """
    product = max(1e-6, math.hypot(air_east, air_north) * math.hypot(demand_east, demand_north))
    sine = (air_north * demand_east - air_east * demand_north) / product
    if air_north * demand_north + air_east * demand_east < 0.0:
        return math.copysign(1.0, sine)
    return sine


@inner
def follow_track(
    estimated: Record,
    near_east: float,
    near_north: float,
    along_east: float,
    along_north: float,
    curvature: float,
    wind_east: float,
    wind_north: float,
    airspeed_demand: float,
    parameters: Record,
    own: Record,
) -> None:
    """Demand the lateral acceleration that leads onto a track, m/s^2 to the right, into ``own``.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    near: point of the track nearest to the aircraft, m.
    along: direction of the track at that point, a unit vector.
    curvature: 1/m, positive to the right.
    wind: velocity of the air, m/s.
    airspeed_demand: m/s; it is raised, into ``own.airspeed_for_ground``, where the ground speed would be too low.
    """
    air_east, air_north = estimated.velocity_east - wind_east, estimated.velocity_north - wind_north
    airspeed = max(0.1, math.hypot(air_east, air_north))
    ground_speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    wind_speed = math.hypot(wind_east, wind_north)
    offset_east, offset_north = estimated.east - near_east, estimated.north - near_north
    error = along_north * offset_east - along_east * offset_north
    wind_across = wind_east * along_north - wind_north * along_east
    wind_along = wind_east * along_east + wind_north * along_north
    track_feasibility = feasibility(airspeed, wind_across, wind_along)
    damping = parameters.npfg_damping
    bound = error_bound(ground_speed, straight_period(parameters) * damping)
    look_ahead_angle = 0.5 * math.pi * (1.0 - min(1.0, abs(error) / bound)) ** 2
    period = adapted_period(
        airspeed, wind_speed, curvature, track_feasibility, math.sin(look_ahead_angle) ** 2, parameters
    )
    bound = error_bound(ground_speed, period * damping)
    look_ahead_angle = 0.5 * math.pi * (1.0 - min(1.0, abs(error) / bound)) ** 2
    proximity = math.sin(look_ahead_angle) ** 2
    # Towards the track at right angles: to the left of its direction if the aircraft is right of it.
    side = math.copysign(1.0, error)
    course_east = -math.cos(look_ahead_angle) * side * along_north + math.sin(look_ahead_angle) * along_east
    course_north = math.cos(look_ahead_angle) * side * along_east + math.sin(look_ahead_angle) * along_north
    course_wind_across = wind_east * course_north - wind_north * course_east
    course_wind_along = wind_east * course_east + wind_north * course_north
    course_feasibility = feasibility(airspeed, course_wind_across, course_wind_along)
    min_airspeed = math.hypot(parameters.ground_speed_min - course_wind_along, course_wind_across)
    ground_speed_on_course = course_wind_along + math.sqrt(
        max(0.0, airspeed_demand * airspeed_demand - course_wind_across * course_wind_across)
    )
    own.airspeed_for_ground = min_airspeed if ground_speed_on_course < parameters.ground_speed_min else 0.0
    airspeed_setpoint = max(airspeed_demand, own.airspeed_for_ground)
    air_demand_east, air_demand_north = heading_for(course_east, course_north, wind_east, wind_north, airspeed_setpoint)
    turn_sine = turn_share(air_east, air_north, air_demand_east, air_demand_north)
    gain = 4.0 * math.pi * damping / period if parameters.anticipates else _HEADING_GAIN_PER_S
    # Feed-forward for the curvature of the track.
    speed_along_track = max(0.0, estimated.velocity_east * along_east + estimated.velocity_north * along_north)
    parallel_curvature = curvature / max(1.0 - curvature * error, max(1e-6, 0.5 * abs(curvature)))
    ratio = 1.0 + wind_along / math.sqrt(max(1e-6, airspeed * airspeed - wind_across * wind_across))
    feed_forward = (
        airspeed * ratio * parallel_curvature * speed_along_track * course_feasibility * track_feasibility * proximity
    )
    own.side_acceleration = gain * airspeed * turn_sine + feed_forward


@inner
def follow_leg(
    estimated: Record,
    b_east: float,
    b_north: float,
    wind_east: float,
    wind_north: float,
    airspeed_demand: float,
    parameters: Record,
    own: Record,
) -> None:
    """Follow the line from the leg's start to its end b (m), or steer straight to one of them.

    Before the start and further away than the switch distance, the aircraft steers to the start; past the end, it
    steers back to the end (`navigateWaypoints`).  The other parameters are those of `follow_track`.
    """
    leg_east, leg_north = b_east - own.from_east, b_north - own.from_north
    length = math.hypot(leg_east, leg_north)
    from_start_east, from_start_north = estimated.east - own.from_east, estimated.north - own.from_north
    to_end_east, to_end_north = b_east - estimated.east, b_north - estimated.north
    is_before_start = from_start_east * leg_east + from_start_north * leg_north < 0.0
    speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    target_east, target_north, heads_to_point = 0.0, 0.0, False
    if length < 1e-3 or to_end_east * leg_east + to_end_north * leg_north < 0.0:
        target_east, target_north, heads_to_point = to_end_east, to_end_north, True
    elif is_before_start and math.hypot(from_start_east, from_start_north) > switch_distance(speed, parameters):
        target_east, target_north, heads_to_point = -from_start_east, -from_start_north, True
    if heads_to_point:
        distance = max(1e-3, math.hypot(target_east, target_north))
        follow_track(
            estimated,
            estimated.east,
            estimated.north,
            target_east / distance,
            target_north / distance,
            0.0,
            wind_east,
            wind_north,
            airspeed_demand,
            parameters,
            own,
        )
        return
    along_east, along_north = leg_east / length, leg_north / length
    along = from_start_east * along_east + from_start_north * along_north
    follow_track(
        estimated,
        own.from_east + along * along_east,
        own.from_north + along * along_north,
        along_east,
        along_north,
        0.0,
        wind_east,
        wind_north,
        airspeed_demand,
        parameters,
        own,
    )


@inner
def follow_circle(
    estimated: Record,
    center_east: float,
    center_north: float,
    radius: float,
    wind_east: float,
    wind_north: float,
    airspeed_demand: float,
    parameters: Record,
    own: Record,
) -> None:
    """Follow a loiter about a center (m).

    radius: m, positive to the right.  The other parameters are those of `follow_track`.
    """
    radial_east, radial_north = estimated.east - center_east, estimated.north - center_north
    distance = math.hypot(radial_east, radial_north)
    if distance < 0.1:
        speed = max(1e-3, math.hypot(estimated.velocity_east, estimated.velocity_north))
        radial_east, radial_north = estimated.velocity_east / speed, estimated.velocity_north / speed
    else:
        radial_east, radial_north = radial_east / distance, radial_north / distance
    direction, abs_radius = math.copysign(1.0, radius), max(1.0, abs(radius))
    follow_track(
        estimated,
        center_east + abs_radius * radial_east,
        center_north + abs_radius * radial_north,
        direction * radial_north,
        -direction * radial_east,
        direction / abs_radius,
        wind_east,
        wind_north,
        airspeed_demand,
        parameters,
        own,
    )


@inner
def bank_demand(lateral_acceleration: float, parameters: Record) -> float:
    """Return the bank demand for a lateral acceleration (m/s^2), within FW_R_LIM, rad."""
    demand = math.atan(lateral_acceleration / GRAVITY)
    return min(parameters.roll_limit, max(-parameters.roll_limit, demand))
