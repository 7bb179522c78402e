"""Implement the lateral control laws of other autopilots, L1 and the vector field, as formulas.

L1 is the law of Park, Deyst and How ("A New Nonlinear Guidance Logic for Trajectory Tracking", AIAA 2004-4900) in
ArduPlane's form: period and damping as parameters, a capture angle of 45 degrees, an integrator, and leg switching at a
turn distance. The vector field is from Beard and McLain, *Small Unmanned Aircraft*, chapter 10.
"""

import math

import numpy as np

from world.geometry import wrap
from world.kernels import Record, Records, inner, record_dtype

# A waypoint, and the leg that begins there.
WAYPOINT = record_dtype(
    "east",  # m
    "north",
    "turn",  # rad, positive in either direction
    ("fly_over", np.bool_),
    "acceptance",  # m; 0 if the mission states none
    "pass_by",  # m that ArduPlane flies on beyond it along the leg
    "airspeed",  # m/s, of the leg
    "min_ground_speed",  # m/s, on the leg to it; 0 or less for none
    "up",  # m AMSL
    "circle",  # m, radius of the loiter that it is a corner of, positive to the right; 0 for none
    "centre_east",  # m, of that circle
    "centre_north",
    ("item", np.int64),  # seq of the mission item that it belongs to, -1 for none
    "stays",  # s, duration of a loiter once it is reached: inf without end, NaN for one with a number of turns
    "turns",  # number of turns of a loiter, 0 for any other
    ("to_height", np.bool_),  # True if the loiter climbs or descends to an altitude
    ("leaves_on_course", np.bool_),  # True if its item states an exit on the course to the next waypoint
    ("leaves_on_tangent", np.bool_),  # True if the line to the next waypoint begins on its circle, not at its center
    ("returns", np.bool_),  # True if the leg to it stands for a return; circle, center and up are then the target's
    ("stop", np.int64),  # stop of the route that it belongs to: a jump back leads to another stop of the same item
    ("gate", np.bool_),  # True for a CONDITION_GATE, which is passed and not flown to
    ("ends", np.bool_),  # True if the mission ends there without a landing or a return
    ("straight", np.bool_),  # True if the leg to it leads from wherever the aircraft is, along no line
    "slope_base",  # m, see `flight.mission.return_path.ReturnCircle`
    ("over_ground", np.bool_),  # True if the leg to it follows the ground
    "above_ground",  # m, height above ground at the end of such a leg
    "home_up",  # m AMSL, home while the leg to it is flown; NaN if unknown
)


def waypoint_column(count: int) -> Records:
    """Return `WAYPOINT` records (count,), all 0, with the memory stride of a flight's path.

    Numba treats contiguous records as another type, and would compile every control law a second time for it.

    >>> waypoint_column(3).shape, waypoint_column(3).flags.c_contiguous
    ((3,), False)
    """
    return np.zeros(2 * count, WAYPOINT)[::2]


# ArduPlane's WP_RADIUS where a mission states no acceptance, m.
WAYPOINT_RADIUS = 90.0
# Largest angle from its line at which L1 integrates, rad.
_INTEGRATION_LIMIT_RAD = math.radians(5.0)
# Largest magnitude of the L1 integrator, rad.
_MAX_INTEGRATOR_RAD = 0.1
# Steepest intercept of L1: sine of 45 degrees.
_CAPTURE_SINE = math.sqrt(0.5)
# Time after passing a waypoint at which L1 heads back to it, s.
_PASSED_TIME_S = 3.0


@inner
def l1_length(speed: float, period: float, damping: float) -> float:
    """Return the L1 distance, m, at a ground speed (m/s)."""
    return period * damping * speed / math.pi


@inner
def l1_angles(
    estimated: Record, a_east: float, a_north: float, b_east: float, b_north: float, length: float
) -> tuple[float, float]:
    """Return the angle from ground velocity to leg or waypoint, and the angle from that to the aim point, rad.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    a_east, a_north, b_east, b_north: the leg's ends, m.

    The second angle is NaN while the aircraft heads straight for a waypoint. Both are positive if it has to turn left.
    """
    leg_east, leg_north = b_east - a_east, b_north - a_north
    leg_length = max(1e-6, math.hypot(leg_east, leg_north))
    leg_east, leg_north = leg_east / leg_length, leg_north / leg_length
    from_a_east, from_a_north = estimated.east - a_east, estimated.north - a_north
    distance_along = from_a_east * leg_east + from_a_north * leg_north
    cross_track = from_a_east * leg_north - from_a_north * leg_east
    distance = math.hypot(from_a_east, from_a_north)
    course = math.atan2(estimated.velocity_east, estimated.velocity_north)
    if distance > length and distance_along < -_CAPTURE_SINE * max(1.0, distance):
        return wrap(course - math.atan2(-from_a_east, -from_a_north)), math.nan
    if distance_along > leg_length + _PASSED_TIME_S * math.hypot(estimated.velocity_east, estimated.velocity_north):
        return wrap(course - math.atan2(b_east - estimated.east, b_north - estimated.north)), math.nan
    aim_angle = math.asin(min(_CAPTURE_SINE, max(-_CAPTURE_SINE, cross_track / max(0.1, length))))
    return wrap(course - math.atan2(leg_east, leg_north)), aim_angle


@inner
def l1_integrate(aim_angle: float, integrator: float, gain: float, dt: float) -> float:
    """Return the cross-track integrator after a tick, rad."""
    if math.isnan(aim_angle) or abs(aim_angle) >= _INTEGRATION_LIMIT_RAD:
        return integrator
    return min(_MAX_INTEGRATOR_RAD, max(-_MAX_INTEGRATOR_RAD, integrator + aim_angle * gain * dt))


@inner
def l1_acceleration(angle: float, speed: float, length: float, damping: float) -> float:
    """Return the acceleration to the right, m/s^2.

    angle: angle of the velocity to the right of the aim, rad.
    """
    angle = min(0.5 * math.pi, max(-0.5 * math.pi, angle))
    return -4.0 * damping * damping * speed * speed / length * math.sin(angle)


@inner
def l1_reached(estimated: Record, a: Record, b: Record, length: float, radius: float) -> bool:
    """Return True if L1 switches to the next leg, within the turn distance of b or past the line across the leg at b.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    a, b: the leg's ends, of `WAYPOINT`.
    radius: turn distance for a right angle, m; smaller turns start later.
    """
    leg_east, leg_north = b.east - a.east, b.north - a.north
    to_b_east, to_b_north = b.east - estimated.east, b.north - estimated.north
    if to_b_east * leg_east + to_b_north * leg_north <= 0.0:
        return True
    turn_distance = min(radius, length) * min(1.0, b.turn / (0.5 * math.pi))
    return not b.fly_over and math.hypot(to_b_east, to_b_north) <= turn_distance


@inner
def field_course(
    course: float, cross_track: float, curvature: float, approach: float, path_gain: float, orbit_gain: float
) -> float:
    """Return the course that the vector field commands next to a path, rad.

    course: course of the path here, rad.
    cross_track: distance to the right of the path, m.
    curvature: 1/m, positive to the right.
    """
    if curvature == 0.0:
        return course - approach * 2.0 / math.pi * math.atan(path_gain * cross_track)
    # Outside a right turn is left of it: cross_track is then negative, and -cross_track * curvature is distance over
    # radius.
    side = math.copysign(1.0, curvature)
    return course + side * math.atan(-orbit_gain * cross_track * curvature)
