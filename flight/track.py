"""The flown track: one row a guidance tick."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Track:
    """What was flown, as it is logged: float64 time and position, float32 for the rest, so that a log loses nothing.

    All arrays have t rows.  World axes east, north, up; SI and radians.
    """

    time: Floats  # (t,) s since the start
    position: Floats  # (t, 3) m, up is AMSL
    velocity: Singles  # (t, 3) m/s over the ground
    attitude: Singles  # (t, 3) roll, pitch, yaw
    rates: Singles  # (t, 3) p, q, r
    airspeed: Singles  # (t,) m/s, true
    flow: Singles  # (t, 2) alpha, beta
    controls: Singles  # (t, 4) elevator, aileron, rudder (rad), throttle (0..1), after the actuators
    commands: Singles  # (t, 4) the same, as guidance asked
    wind: Singles  # (t, 3) m/s, the way the air moves, gusts included
    load_factor: Singles  # (t,) g
    current: Singles  # (t,) A from the battery
    energy: Singles  # (t,) Wh used since the start
    leg: Ints  # (t,) the active leg: leg i goes from waypoint i to i + 1
    cross_track: Singles  # (t,) m right of the fly-by path, as guidance saw it
    height_error: Singles  # (t,) m above the fly-by path
    speed_command: Singles  # (t,) m/s
    clearance: Singles  # (t,) m above ground as the flight saw it; check computes its own

    def __post_init__(self) -> None:
        """Give each array its type, and lock it."""
        for item, kind in zip(fields(self), _KINDS, strict=True):
            array = np.ascontiguousarray(getattr(self, item.name), dtype=kind)
            if array.flags.writeable:
                array = array.copy()
                array.setflags(write=False)
            object.__setattr__(self, item.name, array)

    def __len__(self) -> int:
        """How many rows there are."""
        return int(self.time.size)

    def rows(self, start: int, stop: int) -> "Track":
        """Rows start..stop as a track of their own."""
        return Track(*(getattr(self, item.name)[start:stop] for item in fields(self)))


_KINDS = [np.float64, np.float64, *([np.float32] * 11), np.int32, *([np.float32] * 4)]

# Columns of each field, in order; 1 means a plain (t,) array.
COLUMNS = {
    "time": 1,
    "position": 3,
    "velocity": 3,
    "attitude": 3,
    "rates": 3,
    "airspeed": 1,
    "flow": 2,
    "controls": 4,
    "commands": 4,
    "wind": 3,
    "load_factor": 1,
    "current": 1,
    "energy": 1,
    "leg": 1,
    "cross_track": 1,
    "height_error": 1,
    "speed_command": 1,
    "clearance": 1,
}


def join_tracks(parts: list[Track]) -> Track:
    """One track of parts that follow each other; an empty track for no parts."""
    if not parts:
        empty = [np.zeros((0, n)) if n > 1 else np.zeros(0) for n in COLUMNS.values()]
        return Track(*empty)  # type: ignore[arg-type]  # Track gives each array its own type
    return Track(*(np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS))
