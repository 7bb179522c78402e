"""The flown rows as tables: read back by other people's readers to the very numbers."""

import csv
import io
import sys
from pathlib import Path

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pyproj
import pytest

from logs.exports.flight_table import csv_text, flight_columns, parquet_bytes
from logs.recording.reader import read_log
from world.errors import PlanflyError


def test_csv_reads_back_to_the_logged_numbers(log_file: Path) -> None:
    log = read_log(log_file)
    table = pyarrow.csv.read_csv(io.BytesIO(csv_text(log).encode()))
    assert table.num_rows == len(log.track)
    assert table["time_s"].to_numpy().tobytes() == log.track.time.tobytes()
    assert table["up_amsl_m"].to_numpy().tobytes() == log.track.position[:, 2].tobytes()
    roll = table["roll_rad"].to_numpy().astype(np.float32)
    assert roll.tobytes() == log.track.attitude[:, 0].tobytes(), "a float32's own digits"
    assert table["leg_index"].to_numpy().tolist() == log.track.leg.tolist()
    assert len(csv_text(log).splitlines()) == len(log.track) + 1
    assert {len(row) for row in csv.reader(io.StringIO(csv_text(log)))} == {table.num_columns}


def test_parquet_keeps_types_and_says_what_it_is(log_file: Path) -> None:
    log = read_log(log_file)
    table = pyarrow.parquet.read_table(io.BytesIO(parquet_bytes(log)))
    assert table.column_names == list(flight_columns(log))
    assert (str(table.schema.field("time_s").type), str(table.schema.field("roll_rad").type)) == ("double", "float")
    assert table["airspeed_mps"].to_numpy().tobytes() == log.track.airspeed.tobytes()
    about = {key.decode(): value.decode() for key, value in table.schema.metadata.items()}
    assert about["planfly.scenario"] == log.setup.scenario.name
    assert about["planfly.ended"] == log.ended
    origin = log.setup.scenario.origin
    place = pyproj.Proj(proj="aeqd", lat_0=origin.lat_deg, lon_0=origin.lon_deg, ellps="WGS84")
    lon, lat = place(*log.track.position[:, :2].T, inverse=True)
    assert table["latitude_deg"].to_numpy() == pytest.approx(lat, abs=1e-9)
    assert table["longitude_deg"].to_numpy() == pytest.approx(lon, abs=1e-9)


def test_without_pyarrow_the_extra_is_named(log_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = read_log(log_file)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(PlanflyError, match=r"pyarrow is not installed \(extra: planfly\[tables\]\)"):
        parquet_bytes(log)
