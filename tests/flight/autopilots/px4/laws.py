"""Records that PX4's law works on, as a test wants them."""

import math
from typing import Any

import numpy as np

from flight.autopilots.px4.law import PX4_MEMORY
from flight.autopilots.px4.parameters import Px4Parameters
from flight.dynamics.state import STATE
from flight.guidance.lateral_reference_laws import strided_waypoints
from flight.guidance.navigation_error import MOTION
from world.kernels import Record
from world.scenario_tables import Px4Version


def record(dtype: np.dtype[np.record], **values: Any) -> Record:
    """A record of zeros but for these fields."""
    made: Record = np.zeros(1, dtype)[0]
    for name, value in values.items():
        setattr(made, name, value)
    return made


def flying(
    east: float = 0.0,
    north: float = 0.0,
    up: float = 500.0,
    course: float = 0.0,
    climb: float = 0.0,
    speed: float = 25.0,
) -> Record:
    """At a place, at a speed over the ground (m/s) on a course (rad)."""
    return record(
        MOTION,
        east=east,
        north=north,
        up=up,
        velocity_east=speed * math.sin(course),
        velocity_north=speed * math.cos(course),
        velocity_up=climb,
    )


def waypoints(*points: tuple[float, float, float], **fields: Any) -> np.ndarray:
    """Waypoints (w,) at east, north, up, flown to at 25 m/s; fields: of all of them."""
    made = strided_waypoints(len(points))
    made["east"], made["north"], made["up"] = np.array(points).T
    made["airspeed"] = 25.0
    made["stop"], made["loiter_time"] = np.arange(len(points)), math.nan
    for name, value in fields.items():
        made[name] = value
    return made


def parameters(version: Px4Version = "1.16", /, **values: float) -> Record:
    """Of PX4, but for these, by its names and in its units."""
    return Px4Parameters.defaults(version).changed(**values).record()


def memory(**values: Any) -> Record:
    """At the beginning of the first leg, in level flight at 500 m and 25 m/s."""
    usual: dict[str, Any] = {
        "is_initialised": True,
        "from_up": 500.0,
        "leg_start_altitude": 500.0,
        "min_distance_to_end": math.inf,
        "altitude_setpoint": 500.0,
        "altitude_reference": 500.0,
        "tas": 25.0,
        "tas_setpoint": 25.0,
        "throttle_setpoint": 0.6,
    }
    return record(PX4_MEMORY, **(usual | values))


def state(**values: Any) -> Record:
    """Level, heading north at 25 m/s."""
    return record(STATE, **({"airspeed": 25.0, "velocity_north": 25.0} | values))
