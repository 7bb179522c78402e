"""The flown track: one row a guidance tick."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world.kernels import compiled, field_names, record_dtype

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int32]
Rows = NDArray[np.record]

ROLL, PITCH, YAW = range(3)  # columns of `Track.attitude`
# Columns of `Track.controls` and `Track.commands`.
ELEVATOR, AILERON, RUDDER, THROTTLE = range(4)

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


@dataclass(frozen=True, slots=True, repr=False)
class Track:
    """What was flown, as it is logged: float64 time and position, float32 for the rest, so that a log loses nothing.

    All arrays have t rows.  World axes east, north, up; SI and radians.

    >>> rows = np.zeros(3, TRACK_ROW)
    >>> rows["time"] = 0.0, 0.5, 1.0
    >>> as_track(rows)
    <Track: 3 rows, 0.0 to 1.0 s>
    """

    time: Floats  # (t,) s since the start
    position: Floats  # (t, 3) m, up is AMSL
    velocity: Singles  # (t, 3) m/s over the ground
    attitude: Singles  # (t, 3) roll, pitch, yaw
    rates: Singles  # (t, 3) p, q, r
    airspeed: Singles  # (t,) m/s, true
    flow: Singles  # (t, 2) alpha, beta
    controls: Singles  # (t, 4) elevator, aileron, rudder (rad), throttle (0..1), after the actuators
    commands: Singles  # (t, 4) elevator, aileron, rudder, throttle, as guidance asked
    wind: Singles  # (t, 3) m/s, the way the air moves, gusts included
    load_factor: Singles  # (t,) g
    current: Singles  # (t,) A from the battery
    energy: Singles  # (t,) Wh used since the start
    leg: Ints  # (t,) the active leg: leg i goes from waypoint i to i + 1
    cross_track: Singles  # (t,) m right of the fly-by path, of the estimated state
    height_error: Singles  # (t,) m above the fly-by path
    speed_command: Singles  # (t,) m/s
    clearance: Singles  # (t,) m above ground as the flight measured it; the verdict computes its own

    def __post_init__(self) -> None:
        """Give each array its type, and lock it."""
        for item, kind in zip(fields(self), _KINDS, strict=True):
            given = getattr(self, item.name)
            array = np.ascontiguousarray(given, dtype=kind)
            if array.flags.writeable:
                if np.may_share_memory(array, given):
                    array = array.copy()
                array.setflags(write=False)
            object.__setattr__(self, item.name, array)

    def __len__(self) -> int:
        """How many rows there are."""
        return int(self.time.size)

    def rows(self, start: int, stop: int) -> "Track":
        """Rows start..stop as a track of their own."""
        return Track(*(getattr(self, item.name)[start:stop] for item in fields(self)))

    def to_pandas(self) -> Any:
        """A `pandas.DataFrame`: a row a tick, columns with units in their names.

        Raises ImportError where pandas is not installed.
        """
        from flight.simulation.track_table import track_frame

        return track_frame(self)

    def to_csv(self, path: Path | str) -> None:
        """Write it as comma-separated text, whole or not at all; numbers read back as they were.  Raises OSError."""
        from flight.simulation.track_table import write_track_csv

        write_track_csv(self, Path(path))

    def to_parquet(self, path: Path | str) -> None:
        """Write it as Parquet.  Raises ImportError where pyarrow is not installed, and OSError."""
        from flight.simulation.track_table import write_track_parquet

        write_track_parquet(self, Path(path))

    def __repr__(self) -> str:
        from flight.simulation.track_table import track_title

        return f"<{track_title(self)}>"

    def _repr_html_(self) -> str:
        """How a notebook shows it."""
        from flight.simulation.track_table import track_html

        return track_html(self)


_KINDS = [np.float64, np.float64, *([np.float32] * 11), np.int32, *([np.float32] * 4)]

# A row as it is flown: the fields of `Track`, all of them float64.
TRACK_ROW = record_dtype(
    "time",
    ("position", np.float64, (3,)),
    ("velocity", np.float64, (3,)),
    ("attitude", np.float64, (3,)),
    ("rates", np.float64, (3,)),
    "airspeed",
    ("flow", np.float64, (2,)),
    ("controls", np.float64, (4,)),
    ("commands", np.float64, (4,)),
    ("wind", np.float64, (3,)),
    "load_factor",
    "current",
    "energy",
    "leg",
    "cross_track",
    "height_error",
    "speed_command",
    "clearance",
)
# Columns of each field, in order; 1 means a plain (t,) array.
COLUMNS = {name: math.prod(TRACK_ROW[name].shape) for name in field_names(TRACK_ROW)}


def join_tracks(parts: list[Track]) -> Track:
    """One track of parts that follow each other; an empty track for no parts.

    >>> rows = np.zeros(5, TRACK_ROW)
    >>> whole = join_tracks([as_track(rows[:2]), as_track(rows[2:])])
    >>> len(whole), len(join_tracks([]))
    (5, 0)
    """
    if not parts:
        return as_track(_NO_ROWS)
    return Track(*(np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS))


_NO_ROWS = np.zeros(0, TRACK_ROW)
_STEPS = np.exp2([DIGITS.get(name, 0) for name, width in COLUMNS.items() if name != "time" for _ in range(width)])


def quantised(rows: Rows) -> Rows:
    """Copy of flown rows (t,) at the resolution of `DIGITS`, to the nearest, and without a negative zero.

    It is done as a row is flown, so that whoever judges the flight and whoever reads its log see the same numbers.
    """
    numbers = _numbers(rows).copy()
    _round_to_steps(numbers[:, 1:], _STEPS)
    return numbers.view(TRACK_ROW)[:, 0]


def _numbers(rows: Rows) -> Floats:
    """The numbers of each row side by side, the time first: a view, (t, columns)."""
    return rows[:, np.newaxis].view(np.float64)


@compiled
def _round_to_steps(values: Floats, steps: Floats) -> None:  # pragma: no cover - compiled
    """Round (t, n) to whole steps; (n,) of them make one."""
    for row in range(values.shape[0]):
        for k in range(steps.size):
            # + 0.0 for a negative zero.
            values[row, k] = np.rint(values[row, k] * steps[k]) / steps[k] + 0.0


def join_rows(parts: Sequence[Rows]) -> Rows:
    """Rows that follow each other as one array (t,); none for no parts.

    >>> rows = np.zeros(6, TRACK_ROW)
    >>> rows["time"] = np.arange(6)
    >>> join_rows([rows[:2], rows[2::2]])["time"]
    array([0., 1., 2., 4.])
    >>> join_rows([rows[4:5], rows[5:]])["time"]
    array([4., 5.])
    """
    # As numbers: numpy copies a record field by field, which takes a hundred times as long.
    numbers = np.concatenate([_numbers(part) for part in (_NO_ROWS, *parts)])
    # Of parts of one row each numpy makes columns that follow each other.
    return np.ascontiguousarray(numbers).view(TRACK_ROW)[:, 0]


def as_track(rows: Rows) -> Track:
    """The track of flown rows, (t,) of `TRACK_ROW`.

    >>> rows = np.zeros(2, TRACK_ROW)
    >>> rows["time"] = 0.0, 0.5
    >>> rows["position"][1] = 12.0, 0.0, 300.0
    >>> track = as_track(rows)
    >>> track.position[1]
    array([ 12.,   0., 300.])
    >>> track.leg.dtype
    dtype('int32')
    """
    return Track(**{name: rows[name] for name in COLUMNS})


def track_rows(track: Track) -> Rows:
    """The rows of a track, (t,) of `TRACK_ROW`.

    >>> rows = np.zeros(3, TRACK_ROW)
    >>> rows["airspeed"] = 25.0
    >>> bool((track_rows(as_track(rows)) == rows).all())
    True
    """
    rows: Rows = np.empty(len(track), TRACK_ROW)
    for name in COLUMNS:
        rows[name] = getattr(track, name)
    return rows
