"""Store the track of a flight, one row per guidance tick."""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import load_aircraft
from world.arrays import Floats, Singles
from world.errors import FlightError
from world.extras import require_extra
from world.files import write_atomically
from world.html_table import html_table
from world.kernels import compiled, field_names, record_dtype
from world.wording import count_text

Ints = NDArray[np.int32]
Rows = NDArray[np.record]


# Column of `Track.attitude`: roll, rad.
ROLL = 0
# Column of `Track.attitude`: pitch, rad.
PITCH = 1
# Column of `Track.attitude`: yaw, rad.
YAW = 2
# Column of `Track.controls` and `Track.commands`: elevator, rad.
ELEVATOR = 0
# Column of `Track.controls` and `Track.commands`: aileron, rad.
AILERON = 1
# Column of `Track.controls` and `Track.commands`: rudder, rad.
RUDDER = 2
# Column of `Track.controls` and `Track.commands`: throttle, 0..1.
THROTTLE = 3

# Upper bound of a row's time, s: the longest flight that a log can store.
MAX_TIME_S = 1e7

# Binary digits after the point that are kept in each column of a row. They are finer than any instrument, and make a
# log a third smaller than full float32 values. Positions are the finest: courses and slopes are computed from rows
# 0.4 m apart, and an error of 0.06 mm turns them by 0.01 degrees. Time and leg are not rounded.
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
    "energy": 14,  # 0.06 mWh, a twentieth of the energy used in a tick
    "cross_track": 10,
    "height_error": 10,
    "speed_command": 10,
    "clearance": 10,
}


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Track:
    """Flown track, as stored in a log.

    Time and position are float64, and all other values float32, so that a log stores them exactly. All arrays have t
    rows. World axes east, north, up; SI and radians, except the energy in Wh.

    Position, velocity, attitude and clearance are the true ones. `cross_track` and `height_error` are the errors as the
    guidance estimates them, from its navigation ("gnss", "rtk") and relative to the path that it follows. For the true
    deviation take `position` and the distance from the legs of `FlightSetup.route.positions`, or the findings of the
    rules `corridor` and `height` of a verdict, which are measured on the true track.

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
    commands: Singles  # (t, 4) elevator, aileron, rudder, throttle commands of the guidance
    wind: Singles  # (t, 3) m/s, direction of air motion, including gusts
    load_factor: Singles  # (t,) g
    current: Singles  # (t,) A from the battery
    energy: Singles  # (t,) Wh used since the start
    leg: Ints  # (t,) the active leg: leg i goes from waypoint i to i + 1
    cross_track: Singles  # (t,) m right of the fly-by path, estimated by the guidance: not the true deviation
    height_error: Singles  # (t,) m above the fly-by path, estimated by the guidance: not the true deviation
    speed_command: Singles  # (t,) m/s
    clearance: Singles  # (t,) m, true height above the scenario's terrain, NaN off it; the verdict computes its own

    def __post_init__(self) -> None:
        """Convert each array to its type, and lock it."""
        for field, dtype in zip(fields(self), _FIELD_TYPES, strict=True):
            values = getattr(self, field.name)
            array = np.ascontiguousarray(values, dtype=dtype)
            if array.flags.writeable:
                if np.may_share_memory(array, values):
                    array = array.copy()
                array.setflags(write=False)
            object.__setattr__(self, field.name, array)

    def __len__(self) -> int:
        """Return the number of rows."""
        return int(self.time.size)

    def rows(self, start: int, stop: int) -> "Track":
        """Return the rows from ``start`` up to ``stop``, which is not included, as a separate track."""
        return Track(*(getattr(self, field.name)[start:stop] for field in fields(self)))

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame`: one row per tick, columns with units in their names.

        Raises `planfly.MissingExtraError`, which is an ImportError, without the extra ``planfly[tables]``.
        """
        return track_dataframe(self)

    def to_csv(self, path: Path | str) -> None:
        """Write the track as comma-separated text, completely or not at all.

        Numbers read back exactly. Raises OSError if the file cannot be written.
        """
        write_track_csv(self, Path(path))

    def to_parquet(self, path: Path | str) -> None:
        """Write the track as Parquet.

        Raises MissingExtraError without the extra ``planfly[tables]``, and OSError if the file cannot be written.
        """
        write_track_parquet(self, Path(path))

    def __repr__(self) -> str:
        return f"<{track_title(self)}>"

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows."""
        return track_html(self)


# Types of the fields of `Track`, in order.
_FIELD_TYPES = [np.float64, np.float64, *([np.float32] * 11), np.int32, *([np.float32] * 4)]

# A row during the flight: the fields of `Track`, all of them float64.
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
# Number of columns of each field, in order; 1 for a plain (t,) array.
COLUMNS = {name: math.prod(TRACK_ROW[name].shape) for name in field_names(TRACK_ROW)}


def join_tracks(parts: list[Track]) -> Track:
    """Join successive tracks to one track; return an empty track for no parts.

    >>> rows = np.zeros(5, TRACK_ROW)
    >>> whole = join_tracks([as_track(rows[:2]), as_track(rows[2:])])
    >>> len(whole), len(join_tracks([]))
    (5, 0)
    """
    if not parts:
        return as_track(_NO_ROWS)
    return Track(*(np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS))


# Empty array of rows, the result of joining no parts.
_NO_ROWS = np.zeros(0, TRACK_ROW)
# Reciprocal resolution of each column but the time. It is a power of two, so that products with it and with its
# reciprocal are exact.
_STEPS_PER_UNIT = np.exp2(
    [DIGITS.get(name, 0) for name, width in COLUMNS.items() if name != "time" for _ in range(width)]
)


def quantise(rows: Rows) -> Rows:
    """Return a copy of track rows, rounded to the resolution of `DIGITS` and without negative zeros.

    Rows are rounded as they are flown, so that the verdict and every reader of the log see the same numbers.
    """
    return _round_to_steps(_as_matrix(rows), _STEPS_PER_UNIT).view(TRACK_ROW)[:, 0]


def _as_matrix(rows: Rows) -> Floats:
    """View rows as a float array (t, columns) without copying; the first column is the time."""
    return rows[:, np.newaxis].view(np.float64)


@compiled
def _round_to_steps(values: Floats, steps: Floats) -> Floats:
    """Return values (t, 1 + n) with each column but the first rounded to multiples of the column's step.

    steps: reciprocal of the step of each rounded column, (n,), a power of two.
    """
    units = 1.0 / steps
    rounded = np.empty(values.shape)
    for row in range(values.shape[0]):
        rounded[row, 0] = values[row, 0]
        for k in range(steps.size):
            # Adding 0.0 removes a negative zero.
            rounded[row, k + 1] = np.rint(values[row, k + 1] * steps[k]) * units[k] + 0.0
    return rounded


def join_rows(parts: Sequence[Rows]) -> Rows:
    """Join successive arrays of track rows to one array, (t,); return an empty array for no parts.

    >>> rows = np.zeros(6, TRACK_ROW)
    >>> rows["time"] = np.arange(6)
    >>> join_rows([rows[:2], rows[2::2]])["time"]
    array([0., 1., 2., 4.])
    >>> join_rows([rows[4:5], rows[5:]])["time"]
    array([4., 5.])
    """
    # Join them as plain numbers: numpy copies a record field by field, which takes a hundred times as long.
    numbers = np.concatenate([_as_matrix(part) for part in (_NO_ROWS, *parts)])
    # For parts of one row each, numpy returns columns in contiguous memory.
    return np.ascontiguousarray(numbers).view(TRACK_ROW)[:, 0]


def as_track(rows: Rows) -> Track:
    """Return the track of a flight from its rows, records of `TRACK_ROW`.

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
    """Return the rows of a track as records of `TRACK_ROW`.

    >>> rows = np.zeros(3, TRACK_ROW)
    >>> rows["airspeed"] = 25.0
    >>> bool((track_rows(as_track(rows)) == rows).all())
    True
    """
    rows: Rows = np.empty(len(track), TRACK_ROW)
    for name in COLUMNS:
        rows[name] = getattr(track, name)
    return rows


# ----------------------------------------------------------------------
# A track as a table: columns with their units in their names, for pandas, CSV and Parquet.

# Column names of each field of `Track`, with units; a log's messages use them too.
COLUMN_NAMES = {
    "time": ("time_s",),
    "position": ("east_m", "north_m", "up_amsl_m"),
    "velocity": ("velocity_east_mps", "velocity_north_mps", "velocity_up_mps"),
    "attitude": ("roll_rad", "pitch_rad", "yaw_rad"),
    "rates": ("roll_rate_rad_per_s", "pitch_rate_rad_per_s", "yaw_rate_rad_per_s"),
    "airspeed": ("airspeed_mps",),
    "flow": ("alpha_rad", "beta_rad"),
    "controls": ("elevator_rad", "aileron_rad", "rudder_rad", "throttle_fraction"),
    "commands": (
        "elevator_command_rad",
        "aileron_command_rad",
        "rudder_command_rad",
        "throttle_command_fraction",
    ),
    "wind": ("wind_east_mps", "wind_north_mps", "wind_up_mps"),
    "load_factor": ("load_factor_g",),
    "current": ("battery_current_a",),
    "energy": ("energy_used_wh",),
    "leg": ("leg_index",),
    "cross_track": ("cross_track_m",),
    "height_error": ("height_error_m",),
    "speed_command": ("speed_command_mps",),
    "clearance": ("clearance_seen_m",),
}
# Number of rows that are converted to text at a time.
_ROWS_PER_WRITE = 10_000


def track_columns(track: Track) -> dict[str, NDArray[Any]]:
    """Return the columns of a track by name, in order, each with the data type that it has in the track.

    >>> from flight.simulation.track import TRACK_ROW, as_track
    >>> columns = track_columns(as_track(np.zeros(3, TRACK_ROW)))
    >>> len(columns), list(columns)[:4], columns["leg_index"].dtype
    (35, ['time_s', 'east_m', 'north_m', 'up_amsl_m'], dtype('int32'))
    """
    columns: dict[str, NDArray[Any]] = {}
    for field, names in COLUMN_NAMES.items():
        values = getattr(track, field)
        columns |= dict(zip(names, (values,) if values.ndim == 1 else values.T, strict=True))
    return columns


def track_dataframe(track: Track) -> Any:
    """Return the track as a `pandas.DataFrame`. Raises MissingExtraError without the extra ``tables``."""
    require_extra("tables", "to_pandas() needs")
    import pandas as pd

    return pd.DataFrame(track_columns(track))


def write_track_csv(track: Track, path: Path) -> None:
    """Write a track as comma-separated text: a row of names, and numbers that read back exactly.

    Raises OSError if the file cannot be written.
    """
    columns = track_columns(track)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for first_row in range(0, len(track), _ROWS_PER_WRITE):
        # Convert each column by its own type: the fewest digits that reproduce a float32.
        writer.writerows(
            zip(
                *(values[first_row : first_row + _ROWS_PER_WRITE].astype(str) for values in columns.values()),
                strict=True,
            )
        )
    write_atomically(path, text.getvalue())


def write_track_parquet(track: Track, path: Path) -> None:
    """Write a track as Parquet.

    Raises MissingExtraError without the extra ``tables``, and OSError if the file cannot be written.
    """
    require_extra("tables", "to_parquet() needs")
    import pyarrow as pa
    from pyarrow import parquet

    sink = pa.BufferOutputStream()
    parquet.write_table(pa.table({name: pa.array(values) for name, values in track_columns(track).items()}), sink)
    write_atomically(path, sink.getvalue().to_pybytes())


def track_html(track: Track) -> str:
    """Return an HTML table of a track's columns with their first, last, smallest and largest values.

    >>> from flight.simulation.track import join_tracks
    >>> track_html(join_tracks([]))
    '<div><strong>Track: no rows</strong><table><tbody></tbody></table></div>'
    """
    if not len(track):
        return html_table("Track: no rows", [])
    rows = []
    for name, values in track_columns(track).items():
        finite = values[np.isfinite(values)]
        min_value, max_value = (finite.min(), finite.max()) if finite.size else (np.nan, np.nan)
        rows.append((name, *(f"{value:.6g}" for value in (values[0], values[-1], min_value, max_value))))
    return html_table(track_title(track), rows, ("column", "first", "last", "smallest", "largest"))


def track_title(track: Track) -> str:
    """Return a title with the number of rows and the time span of a track."""
    if not len(track):
        return "Track: no rows"
    return f"Track: {count_text(len(track), 'row')}, {track.time[0]:.1f} to {track.time[-1]:.1f} s"


# ----------------------------------------------------------------------
# The aircraft's controls: their limits, and rows with saturated commands.

# Tolerance for a command at its limit, as a fraction of its range.
_LIMIT_TOLERANCE_FRACTION = 1e-3


def control_limits(aircraft: str) -> list[tuple[str, float]]:
    """Return the name and the greatest deflection (rad; 1 for the throttle) of each control.

    aircraft: name or folder of the aircraft; the deflections of an unknown aircraft are NaN.

    >>> for name, limit in control_limits("aerosonde"):
    ...     print(f"{name} {limit:.2f}")
    elevator 0.52
    aileron 0.52
    rudder 0.52
    throttle 1.00
    """
    try:
        known_aircraft = load_aircraft(aircraft)
    except FlightError:
        limits = (math.nan, math.nan, math.nan)
    else:
        limits = (known_aircraft.max_elevator, known_aircraft.max_aileron, known_aircraft.max_rudder)
    return list(zip(("elevator", "aileron", "rudder", "throttle"), (*limits, 1.0), strict=True))


def saturated_rows(track: Track, control: int, min_command: float, max_command: float) -> NDArray[np.bool_]:
    """Return a mask of the rows at which the command of a control is at one of its limits, (t,).

    control: column of `Track.commands`.
    min_command, max_command: limits of the control; no row is saturated if they are NaN.

    >>> rows = np.zeros(3, TRACK_ROW)
    >>> rows["commands"][:, THROTTLE] = 0.5, 1.0, 0.9
    >>> saturated_rows(as_track(rows), THROTTLE, 0.0, 1.0)
    array([False,  True, False])
    """
    command = track.commands[:, control].astype(np.float64)
    tolerance = _LIMIT_TOLERANCE_FRACTION * (max_command - min_command)
    return np.asarray((command <= min_command + tolerance) | (command >= max_command - tolerance))


# Smallest number of rows by which a track under construction is enlarged.
_MIN_ADDED_ROWS = 6_000


class TrackBuilder:
    """Builder of a flight's track while it is flown; it needs half the memory of the flown rows.

    >>> import numpy as np
    >>> builder = TrackBuilder()
    >>> for _ in range(2):
    ...     builder.add(np.zeros(60, TRACK_ROW))
    >>> len(builder.track())
    120
    """

    def __init__(self) -> None:
        no_rows = as_track(join_rows([]))
        self._columns = {name: getattr(no_rows, name).copy() for name in COLUMNS}
        self._row_count = 0

    def add(self, rows: Rows) -> None:
        """Append rows, copied into arrays of the track's types."""
        start, self._row_count = self._row_count, self._row_count + len(rows)
        if self._row_count > len(self._columns["time"]):
            self._set_capacity(max(self._row_count + _MIN_ADDED_ROWS, int(1.5 * self._row_count)))
        for name, column in self._columns.items():
            column[start : self._row_count] = rows[name]

    def track(self) -> Track:
        """Return the track of all rows; no rows can be added afterwards."""
        self._set_capacity(self._row_count)
        for column in self._columns.values():
            column.setflags(write=False)
        return Track(**self._columns)

    def _set_capacity(self, row_count: int) -> None:
        """Resize all columns to a number of rows."""
        for column in self._columns.values():
            # Resize the array in place: a copy of a long flight takes as much memory again.
            column.resize((row_count, *column.shape[1:]), refcheck=False)
