"""Rows are kept at a stated resolution, once and for all."""

import numpy as np

from flight.simulation.simulate import as_track
from flight.simulation.track import COLUMNS, DIGITS, quantised, track_rows


def _rows() -> np.ndarray:
    rng = np.random.default_rng(5)
    rows = rng.normal(scale=30.0, size=(200, sum(COLUMNS.values())))
    rows[:, 0] = np.arange(200) / 60.0
    rows[3, 5], rows[4, 6], rows[5, 7] = -1e-7, np.nan, np.inf
    return rows


def test_each_column_is_rounded_to_its_step_and_time_is_not() -> None:
    rows = _rows()
    kept = quantised(rows)
    assert (kept[:, 0] == rows[:, 0]).all()
    at = 1
    for name, columns in list(COLUMNS.items())[1:]:
        step = 2.0 ** -DIGITS.get(name, 0)
        part, was = kept[:, at : at + columns], rows[:, at : at + columns]
        known = np.isfinite(was)
        assert (np.abs(part[known] - was[known]) <= step / 2.0).all(), name
        assert (part[known] % step == 0.0).all(), name
        np.testing.assert_array_equal(part[~known], was[~known])
        at += columns
    assert not np.signbit(kept[3, 5])


def test_once_is_enough_and_a_track_holds_it_exactly() -> None:
    kept = quantised(_rows())
    assert quantised(kept).tobytes() == kept.tobytes()
    # Columns that are float32 in a track are too small here to lose a digit.
    np.testing.assert_array_equal(track_rows(as_track(kept)), kept)
