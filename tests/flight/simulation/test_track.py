"""Tracks and their rows: types, and a resolution that is kept once and for all."""

import csv
import math
import re
import sys
from dataclasses import fields
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from pyarrow import parquet

from flight.simulation.track import (
    AILERON,
    COLUMN_NAMES,
    COLUMNS,
    DIGITS,
    ELEVATOR,
    RUDDER,
    THROTTLE,
    TRACK_ROW,
    Rows,
    Track,
    as_track,
    control_limits,
    join_tracks,
    quantise,
    saturated_rows,
    track_columns,
    track_rows,
)
from world.errors import MissingExtraError


def _rows() -> Rows:
    rng = np.random.default_rng(5)
    numbers = rng.normal(scale=30.0, size=(200, sum(COLUMNS.values())))
    rows = numbers.view(TRACK_ROW).reshape(200)
    rows["time"] = np.arange(200) / 60.0
    rows["velocity"][3, 1], rows["velocity"][4, 2], rows["attitude"][5, 0] = -1e-7, np.nan, np.inf
    return rows


def test_each_column_is_rounded_to_its_step_and_time_is_not() -> None:
    rows = _rows()
    kept = quantise(rows)
    assert (kept["time"] == rows["time"]).all()
    for name in list(COLUMNS)[1:]:
        step = 2.0 ** -DIGITS.get(name, 0)
        part, was = kept[name], rows[name]
        known = np.isfinite(was)
        assert (np.abs(part[known] - was[known]) <= step / 2.0).all(), name
        assert (part[known] % step == 0.0).all(), name
        np.testing.assert_array_equal(part[~known], was[~known])
    assert not np.signbit(kept["velocity"][3, 1])


def test_once_is_enough_and_a_track_holds_it_exactly() -> None:
    kept = quantise(_rows())
    assert quantise(kept).tobytes() == kept.tobytes()
    # Columns that are float32 in a track are too small here to lose a digit.
    again = track_rows(as_track(kept))
    for name in COLUMNS:
        np.testing.assert_array_equal(again[name], kept[name])


def test_tracks_hold_their_types_and_join() -> None:
    empty = join_tracks([])
    assert len(empty) == 0
    assert list(COLUMNS) == [item.name for item in fields(Track)]
    assert empty.position.shape == (0, 3)
    assert empty.leg.dtype == np.int32


# ----------------------------------------------------------------------
# A track as a table: read back by other readers, each number is the one flown.


@pytest.fixture
def track() -> Track:
    """Three rows of numbers that no two columns share; a gap in one."""
    rows = np.zeros(3, TRACK_ROW)
    rng = np.random.default_rng(1)
    for name in TRACK_ROW.names or ():
        rows[name] = rng.normal(size=rows[name].shape)
    rows["time"] = 0.0, 1.0 / 3.0, 2.0 / 3.0
    rows["leg"] = 0, 0, 1
    rows["clearance"][1] = np.nan
    return as_track(rows)


def test_every_number_of_a_track_has_one_named_column() -> None:
    assert list(COLUMN_NAMES) == list(COLUMNS)
    assert {name: len(names) for name, names in COLUMN_NAMES.items()} == COLUMNS
    every = [name for names in COLUMN_NAMES.values() for name in names]
    assert len(set(every)) == len(every)


def test_columns_are_the_tracks_own(track: Track) -> None:
    columns = track_columns(track)
    np.testing.assert_array_equal(columns["north_m"], track.position[:, 1])
    np.testing.assert_array_equal(columns["yaw_rad"], track.attitude[:, 2])
    np.testing.assert_array_equal(columns["throttle_fraction"], track.controls[:, 3])
    np.testing.assert_array_equal(columns["wind_up_mps"], track.wind[:, 2])
    np.testing.assert_array_equal(columns["leg_index"], [0, 0, 1])


def test_pandas_gets_rows_and_types(track: Track) -> None:
    frame = track.to_pandas()
    assert isinstance(frame, pd.DataFrame)
    assert frame.shape == (3, 35)
    assert [str(frame[name].dtype) for name in ("time_s", "roll_rad", "leg_index")] == ["float64", "float32", "int32"]
    assert frame["up_amsl_m"].iloc[2] == track.position[2, 2]


@pytest.mark.parametrize("kind", [str, Path])
def test_csv_reads_back_to_the_last_bit(track: Track, tmp_path: Path, kind: type[str] | type[Path]) -> None:
    track.to_csv(kind(tmp_path / "a.csv"))
    with (tmp_path / "a.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3
    for name, values in track_columns(track).items():
        back = np.array([row[name] for row in rows]).astype(values.dtype)
        np.testing.assert_array_equal(back, values, err_msg=name)
    # The fewest digits that do.
    assert rows[1]["time_s"] == repr(1.0 / 3.0)
    assert len(rows[0]["roll_rad"].lstrip("-")) <= 13


def test_csv_of_many_rows_is_whole_and_in_order(tmp_path: Path) -> None:
    rows = np.zeros(20_001, TRACK_ROW)
    rows["time"] = np.arange(20_001)
    as_track(rows).to_csv(tmp_path / "a.csv")
    np.testing.assert_array_equal(pd.read_csv(tmp_path / "a.csv")["time_s"], np.arange(20_001))


@pytest.mark.parametrize("kind", [str, Path])
def test_parquet_reads_back_with_its_types(track: Track, tmp_path: Path, kind: type[str] | type[Path]) -> None:
    track.to_parquet(kind(tmp_path / "a.parquet"))
    table = parquet.read_table(tmp_path / "a.parquet")
    for name, values in track_columns(track).items():
        back = table[name].to_numpy()
        assert back.dtype == values.dtype
        np.testing.assert_array_equal(back, values, err_msg=name)


@pytest.mark.parametrize(("library", "method"), [("pandas", "to_pandas"), ("pyarrow", "to_parquet")])
def test_a_missing_extra_is_named(
    library: str, method: str, track: Track, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    line = re.escape(f"{method}() needs the extra 'tables': pip install 'planfly[tables]'")
    with pytest.raises(MissingExtraError, match=f"^{line}$") as caught:
        getattr(track, method)(*([tmp_path / "a"] if method == "to_parquet" else []))
    assert caught.value.name == library
    assert list(tmp_path.iterdir()) == []


def test_a_track_prints_in_a_line(track: Track) -> None:
    assert repr(track) == "<Track: 3 rows, 0.0 to 0.7 s>"
    assert repr(join_tracks([])) == "<Track: no rows>"


def test_a_notebook_shows_what_each_column_spans(track: Track) -> None:
    page = ElementTree.fromstring(track._repr_html_())
    rows = {row[0].text: [cell.text for cell in row[1:]] for row in page.find("table/tbody") or ()}
    assert rows["leg_index"] == ["0", "1", "0", "1"]
    assert rows["time_s"][:2] == ["0", "0.666667"]
    seen = track.clearance[[0, 2]]
    assert rows["clearance_seen_m"][2:] == [f"{seen.min():.6g}", f"{seen.max():.6g}"]
    assert len(rows) == 35
    assert ElementTree.fromstring(join_tracks([])._repr_html_()).findtext("strong") == "Track: no rows"


# ----------------------------------------------------------------------
# The controls' limits, and the rows at which one is asked for all that it gives.


def commanded(column: int, *values: float) -> Track:
    rows: Any = np.zeros(len(values), TRACK_ROW)
    rows["commands"][:, column] = values
    return as_track(rows)


def test_limits_stand_in_the_order_of_the_commands() -> None:
    # 30 degrees of each surface: aircraft/aerosonde/aerosonde.toml.
    named = control_limits("aerosonde")
    assert [name for name, _ in named] == ["elevator", "aileron", "rudder", "throttle"]
    assert [limit for _, limit in named[:3]] == pytest.approx([math.radians(30.0)] * 3, abs=1e-3)
    assert named[THROTTLE] == ("throttle", 1.0)


def test_an_unknown_aircraft_has_a_throttle_and_no_limits() -> None:
    named = dict(control_limits("zeppelin"))
    assert named["throttle"] == 1.0
    assert all(math.isnan(named[name]) for name in ("elevator", "aileron", "rudder"))


@pytest.mark.parametrize("column", [ELEVATOR, AILERON, RUDDER])
def test_a_surface_is_held_at_either_limit_or_beyond(column: int) -> None:
    # Within a thousandth of the range, which is 1 here.
    track = commanded(column, -0.6, -0.5, -0.4995, -0.498, 0.0, 0.498, 0.4995, 0.5, 0.6)
    assert saturated_rows(track, column, -0.5, 0.5).tolist() == [True] * 3 + [False] * 3 + [True] * 3
    other = AILERON if column == ELEVATOR else ELEVATOR
    assert not saturated_rows(track, other, -0.5, 0.5).any()


def test_a_throttle_is_held_closed_and_open() -> None:
    track = commanded(THROTTLE, 0.0, 0.002, 0.5, 0.998, 1.0)
    assert saturated_rows(track, THROTTLE, 0.0, 1.0).tolist() == [True, False, False, False, True]


def test_unknown_limits_hold_nothing() -> None:
    assert not saturated_rows(commanded(ELEVATOR, -9.0, 0.0, 9.0), ELEVATOR, math.nan, math.nan).any()
