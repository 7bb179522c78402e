"""The flown track: one row a guidance tick."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int32]

# Binary digits after the point that a flown row keeps of each column: finer than any instrument, and a third of the log
# less than with all that a float32 holds.  Positions are the finest: courses and slopes are taken between rows that are
# 0.4 m apart, and 0.06 mm turns those by 0.01 degrees.  Time and leg are as they are.
DIGITS = {
    "position": 14,  # 0.06 mm
    "velocity": 10,  # 1 mm/s
    "attitude": 16,  # 0.0009 degrees
    "rates": 13,  # 0.007 degrees/s
    "airspeed": 10,
    "flow": 16,
    "controls": 14,  # 0.0035 degrees
    "commands": 14,
    "wind": 10,
    "load_factor": 10,
    "current": 10,
    "energy": 14,  # 0.06 mWh, a twentieth of what a tick takes
    "cross_track": 10,
    "height_error": 10,
    "speed_command": 10,
    "clearance": 10,
}


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


def _digits() -> Floats:
    kept = [DIGITS.get(name, 0) for name, columns in COLUMNS.items() if name != "time" for _ in range(columns)]
    return np.array(kept, dtype=np.float64)


_STEPS, _STEP = np.exp2(_digits()), np.exp2(-_digits())


def quantised(rows: Floats) -> Floats:
    """Copy of flown rows (t, columns) at the resolution of `DIGITS`, to the nearest, and without a negative zero.

    It is done as a row is flown, so that whoever judges the flight and whoever reads its log see the same numbers.
    """
    out = rows.copy()
    with np.errstate(over="ignore", invalid="ignore"):
        out[:, 1:] *= _STEPS
        np.rint(out[:, 1:], out=out[:, 1:])
        out[:, 1:] *= _STEP
        out[:, 1:] += 0.0
    return out


def track_rows(track: Track) -> Floats:
    """(t, columns) of a track, in the order of `COLUMNS`."""
    return np.column_stack([getattr(track, name) for name in COLUMNS]).astype(np.float64, copy=False)
