"""Compute the place where an aircraft that has lost control hits the ground.

It falls without drag, or with its wing broadside to the air.

A fall without drag goes farthest ahead.  A fall with the wing broadside to the air drifts farthest with the wind.  The
impact point of any other fall lies between these two.
"""

from collections.abc import Callable

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.envelope import GRAVITY
from world.arrays import Floats
from world.terrain import Terrain

# Air density at sea level, kg/m3.  With the lower density at altitude, an impact lies between those of the two falls.
_AIR_DENSITY = 1.225
# Drag coefficient of a flat plate broadside to the air, relative to the wing area.
_PLATE_DRAG_COEFFICIENT = 1.2
# Time step of a fall, s.
_TIME_STEP_S = 0.05
# Maximum duration of a fall, s.
_MAX_FALL_S = 600.0


def plate_drag(aircraft: Aircraft) -> float:
    """Return drag / (mass * airspeed^2) of a fall with the wing broadside to the air, 1/m."""
    return 0.5 * _AIR_DENSITY * _PLATE_DRAG_COEFFICIENT * aircraft.wing_area / aircraft.mass


def impact_points(
    position: Floats, velocity: Floats, drag: float, find_wind: Callable[[Floats], Floats], terrain: Terrain
) -> Floats:
    """Return the positions (east, north) at which falls hit the ground, m, (n, 2).

    Where the terrain is unknown, the lowest known terrain below the falls is used.

    position, velocity: position, m, and ground velocity, m/s, at the start of each fall, (n, 3).
    drag: drag / (mass * airspeed^2), 1/m; 0 for a fall without drag.
    find_wind: function from positions, m, (n, 3), to the wind there, m/s, (n, 2) east and north.
    """
    positions, velocities = position.astype(np.float64), velocity.astype(np.float64)
    start_ground = terrain.height(positions[:, 0], positions[:, 1])
    lowest_ground = float(np.nanmin(start_ground)) if np.isfinite(start_ground).any() else float(positions[:, 2].min())
    half_step_gravity = np.array([0.0, 0.0, 0.5 * GRAVITY * _TIME_STEP_S])
    is_falling = np.ones(len(positions), dtype=np.bool_)
    for _ in range(int(_MAX_FALL_S / _TIME_STEP_S)):
        rows = np.flatnonzero(is_falling)
        if not rows.size:
            break
        wind_velocity = np.column_stack([find_wind(positions[rows]), np.zeros(rows.size)])
        # Apply half of the step's gravity, then the exact solution for drag alone, then the other half of the gravity.
        air_velocity = velocities[rows] - wind_velocity - half_step_gravity
        slowed_velocity = air_velocity / (1.0 + drag * np.linalg.norm(air_velocity, axis=1)[:, None] * _TIME_STEP_S)
        new_velocities = wind_velocity + slowed_velocity - half_step_gravity
        positions[rows] += 0.5 * (velocities[rows] + new_velocities) * _TIME_STEP_S
        velocities[rows] = new_velocities
        ground = terrain.height(positions[rows, 0], positions[rows, 1])
        is_falling[rows] = positions[rows, 2] > np.where(np.isfinite(ground), ground, lowest_ground)
    return np.asarray(positions[:, :2])
