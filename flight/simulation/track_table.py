"""A track as a table: columns with their units in their names, for pandas, CSV and Parquet."""

import csv
import io
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight.simulation.track import Track
from world.atomic_files import write_whole
from world.notebooks.html_table import html_table

# Field of `Track`: the names of its columns, each with its unit; a log's messages have them, too.
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
# Rows that are turned into text at a time.
_ROWS = 10_000


def track_columns(track: Track) -> dict[str, NDArray[Any]]:
    """The columns (t,) of a track by name, in order, each of the type that the track has.

    >>> from flight.simulation.track import TRACK_ROW, as_track
    >>> columns = track_columns(as_track(np.zeros(3, TRACK_ROW)))
    >>> len(columns), list(columns)[:4], columns["leg_index"].dtype
    (35, ['time_s', 'east_m', 'north_m', 'up_amsl_m'], dtype('int32'))
    """
    found: dict[str, NDArray[Any]] = {}
    for field, names in COLUMN_NAMES.items():
        values = getattr(track, field)
        found |= dict(zip(names, (values,) if values.ndim == 1 else values.T, strict=True))
    return found


def track_frame(track: Track) -> Any:
    """The track as a `pandas.DataFrame`.  Raises ImportError where pandas is not installed."""
    if find_spec("pandas") is None:
        raise ImportError("pandas is not installed (pip install pandas); to_csv() needs none", name="pandas")
    import pandas as pd

    return pd.DataFrame(track_columns(track))


def write_track_csv(track: Track, path: Path) -> None:
    """Write a track as comma-separated text: a row of names, and numbers that read back as they were.

    Raises OSError.
    """
    columns = track_columns(track)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for first in range(0, len(track), _ROWS):
        # As text each by its own type: the fewest digits that give a float32 back.
        writer.writerows(zip(*(values[first : first + _ROWS].astype(str) for values in columns.values()), strict=True))
    write_whole(path, text.getvalue())


def write_track_parquet(track: Track, path: Path) -> None:
    """Write a track as Parquet.  Raises ImportError where pyarrow is not installed, and OSError."""
    if find_spec("pyarrow") is None:
        raise ImportError("pyarrow is not installed (pip install pyarrow); to_csv() needs none", name="pyarrow")
    import pyarrow as pa
    from pyarrow import parquet

    sink = pa.BufferOutputStream()
    parquet.write_table(pa.table({name: pa.array(values) for name, values in track_columns(track).items()}), sink)
    write_whole(path, sink.getvalue().to_pybytes())


def track_html(track: Track) -> str:
    """A track's columns with their first, last, least and largest values.

    >>> from flight.simulation.track import join_tracks
    >>> track_html(join_tracks([]))
    '<div><strong>Track: no rows</strong><table><tbody></tbody></table></div>'
    """
    if not len(track):
        return html_table("Track: no rows", [])
    rows = []
    for name, values in track_columns(track).items():
        finite = values[np.isfinite(values)]
        least, largest = (finite.min(), finite.max()) if finite.size else (np.nan, np.nan)
        rows.append((name, *(f"{value:.6g}" for value in (values[0], values[-1], least, largest))))
    return html_table(track_title(track), rows, ("column", "first", "last", "least", "largest"))


def track_title(track: Track) -> str:
    """How many rows a track has, and of which times."""
    if not len(track):
        return "Track: no rows"
    return f"Track: {len(track):,} rows, {track.time[0]:.1f} to {track.time[-1]:.1f} s"
