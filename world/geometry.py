"""Path geometry for plans and flown tracks: turning angles, slopes, fly-by arcs, spheres, exposure.

Scalar kernels are compiled and take plain numbers, so that the planner's evaluation, the certificate and the check of
a flown track call the same code.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from world.arrays import Floats
from world.kernels import compiled_inline, inlined

# Lower limit of the distance in the exposure, which grows as 1/d^4, m.
MIN_RANGE_M = 1.0


def turning_angles(waypoints: ArrayLike) -> Floats:
    """Return the course change at each inner waypoint, rad in [0, pi], (..., w - 2) (paper eq. 1).

    waypoints: (..., w, 3) metres; altitudes are ignored.

    A leg with no horizontal length has no course and gives no turn.

    >>> turning_angles([[0, 0, 100], [1000, 0, 100], [1000, 1000, 200]]).round(4).tolist()
    [1.5708]
    """
    # atan2 instead of the paper's arccos: rounding can push the argument of arccos beyond 1 on exact U-turns, and the
    # resulting NaN compares as "within the limit".
    return np.abs(signed_turns(waypoints))


def signed_turns(waypoints: ArrayLike) -> Floats:
    """Return the course change at each inner waypoint, rad in (-pi, pi], (..., w - 2).

    waypoints: (..., w, 3) metres; altitudes are ignored.

    A turn to the right is positive.

    >>> signed_turns([[0, 0, 100], [1000, 0, 100], [1000, 1000, 200]]).round(4).tolist()
    [-1.5708]
    """
    legs = np.diff(np.asarray(waypoints, dtype=np.float64)[..., :2], axis=-2)
    legs_before, legs_after = legs[..., :-1, :], legs[..., 1:, :]
    cross = legs_before[..., 0] * legs_after[..., 1] - legs_before[..., 1] * legs_after[..., 0]
    dot = legs_before[..., 0] * legs_after[..., 0] + legs_before[..., 1] * legs_after[..., 1]
    # + 0.0 turns -0.0 into 0.0: atan2(0, -0.0) is pi, which would make a U-turn of a leg without length.
    return np.asarray(np.arctan2(0.0 - cross, dot + 0.0))


def leg_courses(waypoints: ArrayLike) -> Floats:
    """Return the course of each leg, rad clockwise from north in (-pi, pi], shape (..., w - 1).

    waypoints: (..., w, 3) metres.

    >>> leg_courses([[0, 0, 100], [1000, 0, 100], [1000, 1000, 200]]).round(4).tolist()
    [1.5708, 0.0]
    """
    legs = np.diff(np.asarray(waypoints, dtype=np.float64)[..., :2], axis=-2)
    return np.asarray(np.arctan2(legs[..., 0], legs[..., 1]))


def leg_runs(waypoints: ArrayLike) -> Floats:
    """Return the horizontal length of each leg, m, shape (..., w - 1).

    waypoints: (..., w, 3) metres.

    >>> leg_runs([[0, 0, 100], [1000, 0, 100], [1000, 1000, 200]]).tolist()
    [1000.0, 1000.0]
    """
    legs = np.diff(np.asarray(waypoints, dtype=np.float64)[..., :2], axis=-2)
    return np.asarray(np.hypot(legs[..., 0], legs[..., 1]))


def leg_slopes(waypoints: ArrayLike) -> Floats:
    """Return the slope angle of each leg, rad, climb positive (paper eq. 3), shape (..., w - 1).

    waypoints: (..., w, 3) metres.

    >>> leg_slopes([[0, 0, 100], [1000, 0, 100], [1000, 1000, 200]]).round(4).tolist()
    [0.0, 0.0997]
    """
    altitude_changes = np.diff(np.asarray(waypoints, dtype=np.float64)[..., 2], axis=-1)
    return np.asarray(np.arctan2(altitude_changes, leg_runs(waypoints)))


def path_length(waypoints: ArrayLike) -> Floats:
    """Return the length of each path in three dimensions, m, shape (...,).

    waypoints: (..., w, 3) metres.

    >>> float(path_length([[0, 0, 100], [1000, 0, 100], [1000, 1000, 200]]).round(2))
    2004.99
    """
    legs = np.diff(np.asarray(waypoints, dtype=np.float64), axis=-2)
    return np.asarray(np.sqrt((legs**2).sum(axis=-1)).sum(axis=-1))


def tangent_length(turn: float, radius: float) -> float:
    """Return the distance from a waypoint at which its fly-by arc leaves the first leg, m.

    It is R tan(turn / 2).

    turn: rad, from 0 to below pi.
    radius: m.

    The arc joins the next leg at the same distance.

    >>> round(tangent_length(math.radians(90.0), 100.0), 3)
    100.0
    """
    return radius * math.tan(0.5 * turn)


def fly_by_offset(turn: float, radius: float) -> float:
    """Return the distance between a waypoint and its fly-by arc, R (1 / cos(turn / 2) - 1), m.

    turn: rad, from 0 to below pi.
    radius: m.

    >>> round(fly_by_offset(math.radians(90.0), 100.0), 3)
    41.421
    """
    return radius * (1.0 / math.cos(0.5 * turn) - 1.0)


@compiled_inline
def wrap(angle: float) -> float:
    """Wrap an angle to [-pi, pi), rad."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@inlined
def turning_angle(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Return the course change at b on the path a, b, c, rad in [0, pi].

    It is the angle of Yang, Tang and Lozano 2014, eq. 1, computed by atan2; 0 at a leg without length.

    ax, ay, bx, by, cx, cy: east and north of the three points, m.
    """
    ux = bx - ax
    uy = by - ay
    vx = cx - bx
    vy = cy - by
    # + 0.0 turns -0.0 into 0.0, so that a leg without length gives 0 and not pi.
    return math.atan2(abs(ux * vy - uy * vx), ux * vx + uy * vy + 0.0)


@inlined
def sphere_window(a: Floats, b: Floats, centre: Floats, radius: float) -> tuple[float, float, float]:
    """Intersect the segment a-b with a sphere.

    a, b, centre: (3,) m.
    radius: m.

    Returns the smallest distance from the segment to the centre, m, and the fractions (0..1) of the segment at which it
    enters and leaves the sphere. Both fractions are 0 if the segment stays outside. A point on the surface counts as
    inside (paper eq. 9: d <= R).
    """
    length2 = 0.0
    dot = 0.0
    start2 = 0.0
    for k in range(3):
        step = b[k] - a[k]
        offset = a[k] - centre[k]
        length2 += step * step
        dot += step * offset
        start2 += offset * offset
    if length2 == 0.0:
        is_inside = 1.0 if start2 <= radius * radius else 0.0
        return math.sqrt(start2), 0.0, is_inside
    closest_fraction = min(1.0, max(0.0, -dot / length2))
    closest2 = max(0.0, start2 + 2.0 * closest_fraction * dot + closest_fraction * closest_fraction * length2)
    if closest2 > radius * radius:
        return math.sqrt(closest2), 0.0, 0.0
    mid_fraction = -dot / length2
    half_fraction = math.sqrt(max(0.0, mid_fraction * mid_fraction - (start2 - radius * radius) / length2))
    return math.sqrt(closest2), max(0.0, mid_fraction - half_fraction), min(1.0, mid_fraction + half_fraction)


@inlined
def segment_exposure(a: Floats, b: Floats, centre: Floats, radius: float, scale: float) -> tuple[float, float]:
    """Return the fraction of the segment a-b that is inside a threat's sphere, and the segment's exposure.

    a, b, centre: (3,) m.
    radius: radius of the sphere, m.
    scale: distance at which the exposure density is 1, m.

    The exposure is the mean of (scale/d)^4 over the whole segment, where d is the distance from the centre and the
    value is 0 outside the sphere. It follows the paper's eq. 9 and 10, but as a density along the path instead of a sum
    over six points.

    The result is exact. With the perpendicular distance h (at least `MIN_RANGE_M`) and the path coordinate s from the
    closest point, the integral of ds/(h^2+s^2)^2 is s/(2h^2(h^2+s^2)) + atan(s/h)/(2h^3).
    """
    _, begin_fraction, end_fraction = sphere_window(a, b, centre, radius)
    if end_fraction <= begin_fraction:
        return 0.0, 0.0
    length2 = 0.0
    dot = 0.0
    start2 = 0.0
    for k in range(3):
        step = b[k] - a[k]
        offset = a[k] - centre[k]
        length2 += step * step
        dot += step * offset
        start2 += offset * offset
    return end_fraction - begin_fraction, window_exposure(begin_fraction, end_fraction, length2, dot, start2, scale)


@inlined
def window_exposure(
    begin_fraction: float, end_fraction: float, length2: float, dot: float, start2: float, scale: float
) -> float:
    """Return the exposure to a threat on a part of a segment, averaged over the whole segment.

    begin_fraction, end_fraction: limits of the part, as fractions of the segment.
    length2: squared length of the segment, m^2.
    dot: dot product of the segment's vector and the vector from the centre to the segment's start.
    start2: squared distance of the start from the centre, m^2.
    scale: distance at which the exposure density is 1, m.

    `segment_exposure` defines the exposure.
    """
    if length2 < 1e-12:
        return (end_fraction - begin_fraction) * scale**4 / max(start2, MIN_RANGE_M * MIN_RANGE_M) ** 2
    length = math.sqrt(length2)
    mid_fraction = -dot / length2
    closest = math.sqrt(max(MIN_RANGE_M * MIN_RANGE_M, start2 - mid_fraction * mid_fraction * length2))
    begin_distance, end_distance = (begin_fraction - mid_fraction) * length, (end_fraction - mid_fraction) * length
    # Closed form of the difference: on a short, distant segment the values at its ends agree in nearly all digits.
    part_length = end_distance - begin_distance
    rational_part = (
        part_length
        * (closest * closest - begin_distance * end_distance)
        / ((closest * closest + begin_distance * begin_distance) * (closest * closest + end_distance * end_distance))
    )
    total = (
        rational_part + math.atan2(closest * part_length, closest * closest + begin_distance * end_distance) / closest
    ) / (2.0 * closest * closest)
    return scale**4 * total / length
