"""Records that ArduPlane's laws work on, as a test wants them."""

import math
from typing import Any

import numpy as np

from flight.autopilots.arduplane.law import ARDUPILOT_MEMORY
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.dynamics.state import STATE
from flight.guidance.lateral_reference_laws import strided_waypoints
from flight.guidance.navigation_error import MOTION
from world.kernels import Record
from world.scenario_tables import ArduPlaneVersion


def record(dtype: np.dtype[np.record], **values: Any) -> Record:
    """A record of zeros but for these fields."""
    made: Record = np.zeros(1, dtype)[0]
    for name, value in values.items():
        setattr(made, name, value)
    return made


def flying(east: float = 0.0, north: float = 0.0, up: float = 500.0, course: float = 0.0, climb: float = 0.0) -> Record:
    """At a place, at 25 m/s over the ground on a course (rad)."""
    return record(
        MOTION,
        east=east,
        north=north,
        up=up,
        velocity_east=25.0 * math.sin(course),
        velocity_north=25.0 * math.cos(course),
        velocity_up=climb,
    )


def waypoints(*points: tuple[float, float, float], **fields: Any) -> np.ndarray:
    """Waypoints (w,) at east, north, up, flown to at 25 m/s; fields: of all of them."""
    made = strided_waypoints(len(points))
    made["east"], made["north"], made["up"] = np.array(points).T
    made["airspeed"] = 25.0
    for name, value in fields.items():
        made[name] = value
    return made


def parameters(version: ArduPlaneVersion = "4.7", /, **values: float) -> Record:
    """Of ArduPlane, but for these, by its names and in its units."""
    return ArduPilotParameters.defaults(version).changed(**values).record()


def memory(**values: Any) -> Record:
    """At the beginning of the first leg, in level flight at 500 m and 25 m/s."""
    usual: dict[str, Any] = {
        "is_initialised": True,
        "from_up": 500.0,
        "altitude_demand_in": 500.0,
        "altitude_demand_limited": 500.0,
        "altitude_demand": 500.0,
        "max_climb_scaler": 1.0,
        "max_sink_scaler": 1.0,
        "tas": 25.0,
        "tas_demand": 25.0,
        "last_throttle_demand": 0.45,
        "throttle_demand": 0.45,
    }
    return record(ARDUPILOT_MEMORY, **(usual | values))


def state(**values: Any) -> Record:
    """Level, heading north at 25 m/s."""
    return record(STATE, **({"airspeed": 25.0, "velocity_north": 25.0} | values))
