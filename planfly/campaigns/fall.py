"""Fall of an aircraft that has lost control, to the ground: without drag, and with the drag of its wing across the air.

A fall without drag goes farthest ahead, and one with the wing across the air drifts farthest with the wind; the impact
of any other fall lies between.
"""

from collections.abc import Callable

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.envelope import GRAVITY
from world.arrays import Floats
from world.terrain import Terrain

# Air density at sea level, kg/m3; it is lower higher up, which lies between the two falls.
_AIR_DENSITY = 1.225
# Drag coefficient of a flat plate across the air, on the wing's area.
_PLATE_DRAG_COEFFICIENT = 1.2
# Time step of a fall, s.
_TIME_STEP_S = 0.05
# Longest fall, s.
_MAX_FALL_S = 600.0


def plate_drag(aircraft: Aircraft) -> float:
    """Return the drag per mass and airspeed squared of a fall with the wing broadside to the air, 1/m."""
    return 0.5 * _AIR_DENSITY * _PLATE_DRAG_COEFFICIENT * aircraft.wing_area / aircraft.mass


def impact_points(
    position: Floats, velocity: Floats, drag: float, wind_at: Callable[[Floats], Floats], terrain: Terrain
) -> Floats:
    """Return the positions (east, north) at which falls hit the ground, m, (n, 2).

    Where the terrain is unknown, the lowest known terrain below the falls is used.

    position, velocity: at the start of the falls, over the ground, m and m/s, (n, 3).
    drag: drag per mass and square of the airspeed, 1/m.
    wind_at: function from positions, m, (n, 3), to the wind there, m/s, (n, 2) east and north.
    """
    place, speed = position.astype(np.float64), velocity.astype(np.float64)
    start_ground = terrain.height(place[:, 0], place[:, 1])
    lowest_ground = float(np.nanmin(start_ground)) if np.isfinite(start_ground).any() else float(place[:, 2].min())
    half_pull = np.array([0.0, 0.0, 0.5 * GRAVITY * _TIME_STEP_S])
    is_falling = np.ones(len(place), dtype=np.bool_)
    for _ in range(int(_MAX_FALL_S / _TIME_STEP_S)):
        rows = np.flatnonzero(is_falling)
        if not rows.size:
            break
        wind_velocity = np.column_stack([wind_at(place[rows]), np.zeros(rows.size)])
        # Half of the step's gravity, the exact loss of speed by drag alone, and the other half.
        airspeed = speed[rows] - wind_velocity - half_pull
        slowed = airspeed / (1.0 + drag * np.linalg.norm(airspeed, axis=1)[:, None] * _TIME_STEP_S)
        new_speed = wind_velocity + slowed - half_pull
        place[rows] += 0.5 * (speed[rows] + new_speed) * _TIME_STEP_S
        speed[rows] = new_speed
        ground = terrain.height(place[rows, 0], place[rows, 1])
        is_falling[rows] = place[rows, 2] > np.where(np.isfinite(ground), ground, lowest_ground)
    return np.asarray(place[:, :2])
