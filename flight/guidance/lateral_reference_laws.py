"""The lateral laws that other autopilots fly, as formulas: L1 and the vector field.

L1 is the law of Park, Deyst and How ("A New Nonlinear Guidance Logic for Trajectory Tracking", AIAA 2004-4900) in the
form that ArduPlane gives it: period and damping as parameters, a capture angle of 45 degrees, an integrator, and
switching legs at a turn distance.  The field is that of Beard and McLain, *Small Unmanned Aircraft*, chapter 10.
"""

import math

import numpy as np

from world.geometry import wrap
from world.kernels import Record, Records, inner, record_dtype

# A waypoint, and the leg that begins there.
WAYPOINT = record_dtype(
    "east",  # m
    "north",
    "turn",  # rad, positive whichever way round
    ("fly_over", np.bool_),
    "acceptance",  # m; 0 where the mission states none
    "airspeed",  # m/s, of the leg
    "up",  # m AMSL
    "circle",  # m, radius of the loiter that it is a corner of, positive to the right; 0 for none
    "centre_east",  # m, of that circle
    "centre_north",
    ("item", np.int64),  # seq of the mission item that it belongs to, -1 for none
    "stays",  # s, of a loiter once it is reached: inf without end, NaN for one of so many turns
    "turns",  # of a loiter of so many, 0 for any other
    ("to_height", np.bool_),  # whether the loiter is one to a height
    ("leaves_on_course", np.bool_),  # whether its item asks to leave it on the course to what follows
    ("leaves_on_tangent", np.bool_),  # whether the line to what follows is to begin on its rim, not in its middle
    ("returns", np.bool_),  # whether the leg to it stands for a return; circle, centre and up are then of its target
    ("stop", np.int64),  # which of the route's stops it belongs to: a jump back leads to another of the same item
    ("gate", np.bool_),  # whether it is a CONDITION_GATE, which is passed and not flown to
    ("ends", np.bool_),  # whether the mission ends there and goes no further: not to land, not home
    ("straight", np.bool_),  # whether the leg to it leads from wherever the aircraft is, along no line
    "slope_base",  # m, as of `flight.mission.return_path.ReturnCircle`
    ("over_ground", np.bool_),  # whether the leg to it follows the ground
    "above_ground",  # m, height above ground at the end of such a leg
)


def waypoint_column(count: int) -> Records:
    """`WAYPOINT` records (count,), all 0, as apart from each other in memory as those of a flight's path.

    Records side by side are another type to numba, for which every law would be compiled a second time.

    >>> waypoint_column(3).shape, waypoint_column(3).flags.c_contiguous
    ((3,), False)
    """
    return np.zeros(2 * count, WAYPOINT)[::2]


# ArduPlane's WP_RADIUS where a mission states no acceptance, m.
WAYPOINT_RADIUS = 90.0
# L1 integrates only this near to its line (rad), and up to this much (rad).
_INTEGRATES, _MAX_INTEGRAL = math.radians(5.0), 0.1
# Steepest that L1 closes in on its line: sine of 45 degrees.
_CAPTURE = math.sqrt(0.5)
# L1 heads back to a waypoint that it passed this long ago, s.
_PASSED = 3.0


@inner
def l1_length(speed: float, period: float, damping: float) -> float:  # pragma: no cover - compiled
    """How far ahead L1 aims, m, at a ground speed (m/s)."""
    return period * damping * speed / math.pi


@inner
def l1_angles(
    estimated: Record, a_east: float, a_north: float, b_east: float, b_north: float, length: float
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Angle from the ground velocity to the leg or the waypoint it heads for, and from there to its aim, rad.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.  a, b: the leg's ends, m.  The second angle is NaN
    while it heads straight for a waypoint.  Both are positive where the aircraft has to turn left.
    """
    leg_e, leg_n = b_east - a_east, b_north - a_north
    run = max(1e-6, math.hypot(leg_e, leg_n))
    leg_e, leg_n = leg_e / run, leg_n / run
    from_e, from_n = estimated.east - a_east, estimated.north - a_north
    along = from_e * leg_e + from_n * leg_n
    cross = from_e * leg_n - from_n * leg_e
    distance = math.hypot(from_e, from_n)
    course = math.atan2(estimated.velocity_east, estimated.velocity_north)
    if distance > length and along < -_CAPTURE * max(1.0, distance):
        return wrap(course - math.atan2(-from_e, -from_n)), math.nan
    if along > run + _PASSED * math.hypot(estimated.velocity_east, estimated.velocity_north):
        return wrap(course - math.atan2(b_east - estimated.east, b_north - estimated.north)), math.nan
    aim = math.asin(min(_CAPTURE, max(-_CAPTURE, cross / max(0.1, length))))
    return wrap(course - math.atan2(leg_e, leg_n)), aim


@inner
def l1_integrate(aim: float, total: float, gain: float, dt: float) -> float:  # pragma: no cover - compiled
    """The integral after a tick, rad."""
    if math.isnan(aim) or abs(aim) >= _INTEGRATES:
        return total
    return min(_MAX_INTEGRAL, max(-_MAX_INTEGRAL, total + aim * gain * dt))


@inner
def l1_acceleration(angle: float, speed: float, length: float, damping: float) -> float:  # pragma: no cover - compiled
    """Acceleration to the right, m/s^2, for a total angle that the velocity stands right of the aim, rad."""
    angle = min(0.5 * math.pi, max(-0.5 * math.pi, angle))
    return -4.0 * damping * damping * speed * speed / length * math.sin(angle)


@inner
def l1_reached(
    estimated: Record, a: Record, b: Record, length: float, radius: float
) -> bool:  # pragma: no cover - compiled
    """Whether L1 turns to the next leg: within its turn distance of b, or past the line square to the leg there.

    estimated: as `l1_angles` takes it.  a, b: the leg's ends, of `WAYPOINT`.  radius: m, for a right angle; smaller
    turns start later.
    """
    leg_e, leg_n = b.east - a.east, b.north - a.north
    to_e, to_n = b.east - estimated.east, b.north - estimated.north
    if to_e * leg_e + to_n * leg_n <= 0.0:
        return True
    distance = min(radius, length) * min(1.0, b.turn / (0.5 * math.pi))
    within: bool = not b.fly_over and math.hypot(to_e, to_n) <= distance
    return within


@inner
def field_course(
    course: float, cross: float, curvature: float, approach: float, path_gain: float, orbit_gain: float
) -> float:  # pragma: no cover - compiled
    """Course that the vector field commands beside a path, rad.

    course: of the path here, rad.  cross: m right of it.  curvature: 1/m, positive to the right.
    """
    if curvature == 0.0:
        return course - approach * 2.0 / math.pi * math.atan(path_gain * cross)
    # Outside a right turn is left of it: cross is then negative, and the distance over the radius -cross * curvature.
    side = math.copysign(1.0, curvature)
    return course + side * math.atan(-orbit_gain * cross * curvature)
