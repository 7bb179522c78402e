"""Tracks and their rows: types, and a resolution that is kept once and for all."""

from dataclasses import fields

import numpy as np

from flight.simulation.track import (
    COLUMNS,
    DIGITS,
    TRACK_ROW,
    Rows,
    Track,
    as_track,
    join_tracks,
    quantised,
    track_rows,
)


def _rows() -> Rows:
    rng = np.random.default_rng(5)
    numbers = rng.normal(scale=30.0, size=(200, sum(COLUMNS.values())))
    rows = numbers.view(TRACK_ROW).reshape(200)
    rows["time"] = np.arange(200) / 60.0
    rows["velocity"][3, 1], rows["velocity"][4, 2], rows["attitude"][5, 0] = -1e-7, np.nan, np.inf
    return rows


def test_each_column_is_rounded_to_its_step_and_time_is_not() -> None:
    rows = _rows()
    kept = quantised(rows)
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
    kept = quantised(_rows())
    assert quantised(kept).tobytes() == kept.tobytes()
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
