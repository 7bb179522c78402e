"""What the planner reads of an aircraft's packed limits beside the functions of `aircraft.path_limits`."""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import Limits, wind_speed_at
from world.kernels import compiled, inlined

Floats = NDArray[np.float64]

# Of the aircraft's steepest climb and dive, the share that a plan uses: holding a path in gusts takes the rest.
TURBULENCE_SHARE = {"none": 1.0, "light": 0.9, "moderate": 0.8}


def aircraft_with_share(limits: Limits, turbulence: str) -> Floats:
    """Packed limits of the aircraft with the share of climb and dive that turbulence leaves to a plan."""
    packed = limits.packed()
    angles = packed[1:, 8:]
    # What is below 0 is a loss of height, of which no share helps.
    packed[1:, 8:] = np.where(angles > 0.0, TURBULENCE_SHARE[turbulence] * angles, angles)
    return packed


@inlined
def airspeed_of(aircraft: Floats) -> float:  # pragma: no cover - compiled
    """Airspeed at which paths are flown, m/s."""
    speed: float = aircraft[0, 0]
    return speed


@compiled
def least_air_angles(aircraft: Floats) -> tuple[float, float]:  # pragma: no cover - compiled
    """Steepest climb and dive through the air, rad, that the aircraft has at every height of its table."""
    climb, dive = math.inf, math.inf
    for k in range(int(aircraft[0, 6])):
        climb, dive = min(climb, aircraft[1, 8 + k]), min(dive, aircraft[2, 8 + k])
    return climb, dive


@inlined
def half_blend_length(aircraft: Floats, amsl: float, acceleration: float) -> float:  # pragma: no cover - compiled
    """Half the length of the parabola that blends two slopes, m per unit of their difference, with the wind behind.

    acceleration: vertical, m/s^2.
    """
    speed = airspeed_of(aircraft) + wind_speed_at(aircraft, amsl)
    length: float = speed * speed / (2.0 * acceleration)
    return length
