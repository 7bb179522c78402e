"""The flown rows as a table for spreadsheets and data frames: `.csv`, and `.parquet` where pyarrow is installed."""

import csv
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from logs.recording.reader import FlightLog
from logs.recording.state_channel import FIELDS
from world.errors import PlanflyError
from world.frames import to_geo


def flight_columns(log: FlightLog) -> dict[str, NDArray[Any]]:
    """Columns (t,) by name: those of a log's `/state` messages, and after the time where on Earth the aircraft was.

    Each name ends with its unit; courses and the axes east and north are the map's about the scenario's origin.

    >>> from logs.recording.example_log import example_log
    >>> columns = flight_columns(example_log())
    >>> list(columns)[:6], len(columns["time_s"])
    (['time_s', 'latitude_deg', 'longitude_deg', 'east_m', 'north_m', 'up_amsl_m'], 366)
    """
    track = log.track
    lat, lon = to_geo(log.setup.scenario.origin, track.position[:, 0], track.position[:, 1])
    columns: dict[str, NDArray[Any]] = {}
    for field in FIELDS:
        columns[field.name] = field.of(getattr(track, field.source))
        if field.name == "time_s":
            columns["latitude_deg"], columns["longitude_deg"] = np.asarray(lat), np.asarray(lon)
    return columns


def csv_text(log: FlightLog) -> str:
    """The table as CSV: a line of names, then a line a row; each number as short as reads back to the same one.

    >>> from logs.recording.example_log import example_log
    >>> csv_text(example_log()).splitlines()[1].split(",")[:6]
    ['0.0', '45.99999981773182', '7.993545330437746', '-500.0', '0.0', '200.0']
    """
    columns = flight_columns(log)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    # A float32's own shortest digits: as a double it would have sixteen.
    writer.writerows(zip(*(column.astype(np.str_).tolist() for column in columns.values()), strict=True))
    return out.getvalue()


def parquet_bytes(log: FlightLog) -> bytes:
    """The table as a Parquet file, in the types of the log, with the scenario's name and origin as metadata.

    Raises PlanflyError where pyarrow is not installed.

    >>> from logs.recording.example_log import example_log
    >>> parquet_bytes(example_log())[:4]
    b'PAR1'
    """
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError as error:
        allowed = "the package pyarrow is not installed (extra: planfly[tables])"
        raise PlanflyError(f".parquet: {allowed}", field="suffix", value=".parquet", allowed=allowed) from error
    scenario = log.setup.scenario
    about = {
        "planfly.scenario": scenario.name,
        "planfly.origin_lat_deg": repr(scenario.origin.lat_deg),
        "planfly.origin_lon_deg": repr(scenario.origin.lon_deg),
        "planfly.ended": log.ended or "",
    }
    table = pa.table(flight_columns(log)).replace_schema_metadata(about)
    sink = io.BytesIO()
    parquet.write_table(table, sink, compression="zstd")
    return sink.getvalue()
