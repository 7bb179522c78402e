"""Compute positions on the ellipsoid of the earth as JSBSim does."""

import math

from flight.dynamics.vectors import Vector
from world.kernels import inner

# Rotation rate of the earth, rad/s.
EARTH_RATE = 0.00007292115
# Semi-major axis of the earth's ellipsoid, ft.
SEMI_MAJOR = 20925646.32546
# Semi-minor axis of the earth's ellipsoid, ft.
SEMI_MINOR = 20855486.5951
# Ratio of the axes.
AXES_RATIO = SEMI_MINOR / SEMI_MAJOR
AXES_RATIO_2 = AXES_RATIO * AXES_RATIO
# Square of the first eccentricity.
ECCENTRICITY_2 = 1.0 - AXES_RATIO_2
_FOCUS = SEMI_MAJOR * ECCENTRICITY_2


@inner
def geodetic(position: Vector) -> tuple[float, float, float, float]:
    """Convert a position to geodetic latitude (rad), altitude (ft), and sine and cosine of the latitude.

    The method is one iteration of Fukushima's method (Journal of Geodesy 79, 2006), with the variable names of the
    paper.

    position: position in axes fixed to the earth, ft.
    """
    x, y, z = position
    axis_distance = math.sqrt(x * x + y * y)
    s0 = abs(z)
    zc, c0 = AXES_RATIO * s0, AXES_RATIO * axis_distance
    c02, s02 = c0 * c0, s0 * s0
    a02 = c02 + s02
    a0 = math.sqrt(a02)
    a03 = a02 * a0
    s1 = zc * a03 + _FOCUS * s02 * s0
    c1 = axis_distance * a03 - _FOCUS * c02 * c0
    cs0c0 = _FOCUS * c0 * s0
    b0 = 1.5 * cs0c0 * ((axis_distance * s0 - zc * c0) * a0 - cs0c0)
    s1 = s1 * a03 - b0 * s0
    cc = AXES_RATIO * (c1 * a03 - b0 * c0)
    s12, cc2 = s1 * s1, cc * cc
    norm = math.sqrt(s12 + cc2)
    sign = 1.0 if z >= 0.0 else -1.0
    altitude = (axis_distance * cc + s0 * s1 - SEMI_MAJOR * math.sqrt(AXES_RATIO_2 * s12 + cc2)) / norm
    return sign * math.atan(s1 / cc), altitude, sign * s1 / norm, cc / norm
