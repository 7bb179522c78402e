"""Frames of a flight: times in step, a map that stands still, an aircraft that moves as the track does."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from logs import theme
from logs.recording.reader import FlightLog, read_log
from logs.views.replay.movie_frames import MovieFrames, format_signed_number

AIRCRAFT = [round(255 * part) for part in theme.rgb(theme.colour("aircraft"))]


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [(-0.4, 0, "0"), (0.4, 0, "0"), (-0.6, 0, "−1"), (-0.04, 1, "0.0"), (-0.06, 1, "−0.1"), (float("nan"), 0, "?")],
)
def test_nothing_is_written_as_less_than_nought(value: float, digits: int, text: str) -> None:
    assert format_signed_number(value, digits) == text


@pytest.fixture(scope="module")
def log(log_file: Path) -> FlightLog:
    return read_log(log_file)


def test_the_aircraft_moves_over_a_map_that_stands_still(log: FlightLog) -> None:
    film = MovieFrames(log.setup, log.track, 0.0, log.end_time, 24.0)
    frames = list(film.frames())
    assert len(frames) == len(film) == 5
    np.testing.assert_allclose(film.times(), [0.0, 2.0, 4.0, 6.0, log.end_time])
    assert {frame.shape for frame in frames} == {frames[0].shape}
    assert frames[0].shape[0] % 2 == frames[0].shape[1] % 2 == 0
    changed = [(a != b).any(axis=2) for a, b in itertools.pairwise(frames)]
    assert all(100 < part.sum() < 0.1 * part.size for part in changed)
    # The aircraft's colour moves from the lower left to the upper right, as the waypoints do.
    middles = []
    for frame in frames:
        rows, columns = np.nonzero(np.abs(frame.astype(int) - AIRCRAFT).max(axis=2) < 8)
        middles.append((columns.mean(), -rows.mean()))
    assert all(a[0] < b[0] and a[1] < b[1] for a, b in itertools.pairwise(middles))
    again = list(film.frames())
    assert all((a == b).all() for a, b in zip(frames, again, strict=True))
