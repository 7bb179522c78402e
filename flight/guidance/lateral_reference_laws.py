"""Implement the lateral control laws L1 and vector field as formulas.

L1 is the law of Park, Deyst and How ("A New Nonlinear Guidance Logic for Trajectory Tracking", AIAA 2004-4900) in
ArduPlane's form: period and damping as parameters, a capture angle of 45 degrees, an integrator, and leg switching at a
turn distance. The vector field is from Beard and McLain, *Small Unmanned Aircraft*, chapter 10.
"""

import math

import numpy as np

from world.geometry import wrap
from world.kernels import Record, Records, inner, record_dtype

# A waypoint, and the leg that starts there.
WAYPOINT = record_dtype(
    "east",  # m
    "north",
    "turn",  # rad, positive in either direction
    ("fly_over", np.bool_),
    "acceptance",  # m; 0 if the mission states none
    "pass_by",  # m that ArduPlane flies past the waypoint along the leg
    "airspeed",  # m/s, of the leg
    "min_ground_speed",  # m/s, on the leg to the waypoint; 0 or less for none
    "up",  # m AMSL
    "loiter_radius",  # m, radius of the loiter of which it is a corner, positive to the right; 0 for none
    "centre_east",  # m, of that loiter
    "centre_north",
    ("item", np.int64),  # seq of its mission item, -1 for none
    "loiter_time",  # s, duration of a loiter once reached: inf without end, NaN for a loiter by turns
    "loiter_turns",  # number of turns of a loiter, 0 for any other
    ("loiters_to_altitude", np.bool_),  # True if the loiter climbs or descends to an altitude
    ("exits_on_course", np.bool_),  # True if the item states an exit on the course to the next waypoint
    ("exits_on_tangent", np.bool_),  # True if the line to the next waypoint starts on the circle, not at its center
    "exit_bearing",  # rad, 0 < it <= 2 pi, to which ArduPlane exits a loiter; 0 for the bearing to the next waypoint
    ("is_rtl", np.bool_),  # True if the leg to it is an RTL; radius, center and up describe the RTL loiter
    ("stop", np.int64),  # its stop of the route: a jump back leads to another stop of the same item
    ("is_gate", np.bool_),  # True for a CONDITION_GATE, which is no target
    ("is_mission_end", np.bool_),  # True if the mission ends there without a landing or an RTL
    ("precedes_landing", np.bool_),  # True if the next item that is flown to is a landing
    ("ignores_altitude", np.bool_),  # True if PX4 accepts it at any altitude, as a waypoint of a mission's landing
    ("without_crosstrack", np.bool_),  # True if the leg to it starts at the aircraft and follows no line
    "slope_base",  # m, see `flight.mission.return_path.ReturnCircle`
    ("follows_terrain", np.bool_),  # True if the leg to it follows the ground
    "above_ground",  # m, height above ground at the end of such a leg
    "home_up",  # m AMSL, altitude of home during the leg to it; NaN if unknown
)


def strided_waypoints(count: int) -> Records:
    """Return ``count`` zeroed `WAYPOINT` records in a strided array, like the waypoints in a `Workspace`.

    Contiguous records would be another type for Numba, which would compile every control law a second time.

    >>> strided_waypoints(3).shape, strided_waypoints(3).flags.c_contiguous
    ((3,), False)
    """
    return np.zeros(2 * count, WAYPOINT)[::2]


# ArduPlane's WP_RADIUS, for a mission without an acceptance radius, m.
DEFAULT_ACCEPTANCE_RADIUS_M = 90.0
# Maximum angle to the line at which L1 integrates, rad.
_INTEGRATION_LIMIT_RAD = math.radians(5.0)
# Maximum magnitude of the L1 integrator, rad.
_MAX_INTEGRATOR_RAD = 0.1
# Sine of the steepest intercept angle of L1, 45 degrees.
_CAPTURE_SINE = math.sqrt(0.5)
# Time after which L1 turns back to a waypoint that it has passed, s.
_PASSED_TIME_S = 3.0


@inner
def l1_length(speed: float, period: float, damping: float) -> float:
    """Return the L1 distance (m) at a ground speed (m/s), `_L1_dist` of AP_L1_Control.

    period, damping: NAVL1_PERIOD, s, and NAVL1_DAMPING.
    """
    return period * damping * speed / math.pi


@inner
def l1_angles(
    motion: Record, a_east: float, a_north: float, b_east: float, b_north: float, l1_distance: float
) -> tuple[float, float]:
    """Return two angles, rad: ground velocity to leg, and leg to L1 point.

    The L1 point is the point of the leg at the L1 distance from the aircraft, at which L1 aims. Far before the leg's
    start and past the leg's end, L1 aims straight at the waypoint there: the first angle is then measured from the
    direction to this waypoint, and the second angle is NaN. The angles are -Nu2 and -Nu1 (without its integrator) of
    AP_L1_Control.

    motion: a record of `flight.guidance.navigation_error.MOTION`.
    a_east, a_north: start of the leg, m.
    b_east, b_north: end of the leg, m.
    """
    leg_east, leg_north = b_east - a_east, b_north - a_north
    leg_length = max(1e-6, math.hypot(leg_east, leg_north))
    leg_east, leg_north = leg_east / leg_length, leg_north / leg_length
    offset_east, offset_north = motion.east - a_east, motion.north - a_north
    distance_along = offset_east * leg_east + offset_north * leg_north
    cross_track = offset_east * leg_north - offset_north * leg_east
    distance = math.hypot(offset_east, offset_north)
    course = math.atan2(motion.velocity_east, motion.velocity_north)
    if distance > l1_distance and distance_along < -_CAPTURE_SINE * max(1.0, distance):
        return wrap(course - math.atan2(-offset_east, -offset_north)), math.nan
    if distance_along > leg_length + _PASSED_TIME_S * math.hypot(motion.velocity_east, motion.velocity_north):
        return wrap(course - math.atan2(b_east - motion.east, b_north - motion.north)), math.nan
    aim_angle = math.asin(min(_CAPTURE_SINE, max(-_CAPTURE_SINE, cross_track / max(0.1, l1_distance))))
    return wrap(course - math.atan2(leg_east, leg_north)), aim_angle


@inner
def l1_integrate(aim_angle: float, integrator: float, gain: float, dt: float) -> float:
    """Return the cross-track integrator of L1 (`_L1_xtrack_i` of AP_L1_Control) after one more tick, rad.

    aim_angle: integrated angle, between the leg and the direction to the L1 point, rad; NaN while L1 aims at a
        waypoint. The integrator changes only while the magnitude of this angle is below 5 degrees.
    integrator: value before this tick, rad.
    gain: NAVL1_XTRACK_I.
    """
    if math.isnan(aim_angle) or abs(aim_angle) >= _INTEGRATION_LIMIT_RAD:
        return integrator
    return min(_MAX_INTEGRATOR_RAD, max(-_MAX_INTEGRATOR_RAD, integrator + aim_angle * gain * dt))


@inner
def l1_acceleration(angle: float, speed: float, l1_distance: float, damping: float) -> float:
    """Return the acceleration to the right that L1 demands (`_latAccDem` of AP_L1_Control), m/s^2.

    angle: angle from the direction to the L1 point to the ground velocity, rad, positive to the right.
    speed: ground speed, m/s.
    l1_distance: L1 distance, m.
    damping: NAVL1_DAMPING.
    """
    angle = min(0.5 * math.pi, max(-0.5 * math.pi, angle))
    return -4.0 * damping * damping * speed * speed / l1_distance * math.sin(angle)


@inner
def has_reached_leg_end(motion: Record, a: Record, b: Record, l1_distance: float, radius: float) -> bool:
    """Return True if the aircraft has reached waypoint b, the end of the leg from a to b.

    The waypoint is reached within the turn distance, or past the line across the leg at b. A fly-over waypoint is
    reached only past this line.

    motion: a record of `flight.guidance.navigation_error.MOTION`.
    a, b: start and end of the leg, records of `WAYPOINT`.
    radius: turn distance for a turn of 90 degrees, m; smaller turns start later.
    l1_distance: L1 distance, m, the upper limit of the turn distance.
    """
    leg_east, leg_north = b.east - a.east, b.north - a.north
    to_b_east, to_b_north = b.east - motion.east, b.north - motion.north
    if to_b_east * leg_east + to_b_north * leg_north <= 0.0:
        return True
    turn_distance = min(radius, l1_distance) * min(1.0, b.turn / (0.5 * math.pi))
    return not b.fly_over and math.hypot(to_b_east, to_b_north) <= turn_distance


@inner
def field_course(
    course: float, cross_track: float, curvature: float, approach: float, path_gain: float, orbit_gain: float
) -> float:
    """Return the course that the vector field commands at a cross-track distance from a path, rad.

    course: course of the path at the nearest point, rad.
    cross_track: distance to the right of the path, m.
    curvature: curvature of the path, 1/m, positive to the right; 0 for a line.
    approach: angle of approach to a line from far away, rad.
    path_gain, orbit_gain: gains of the convergence to a line and to an arc.
    """
    if curvature == 0.0:
        return course - approach * 2.0 / math.pi * math.atan(path_gain * cross_track)
    # The outside of a right turn is on its left, where cross_track is negative: -cross_track * curvature is the
    # distance outside the arc as a ratio to the radius.
    turn_sign = math.copysign(1.0, curvature)
    return course + turn_sign * math.atan(-orbit_gain * cross_track * curvature)
