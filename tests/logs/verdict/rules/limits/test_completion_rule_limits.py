"""Pauses and contradictions in a record, just inside and just outside what counts as one."""

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from tests.logs.verdict.judging import judge, of
from tests.synthetic import edited, fly_path, make_setup

STRAIGHT = [[0, 0, 300], [0, 3000, 300]]


@pytest.fixture(scope="module")
def setup() -> FlightSetup:
    return make_setup(STRAIGHT)


def paused(track: Track, seconds: float) -> Track:
    """A track without the rows of this long in its middle."""
    kept = (track.time <= 60.0) | (track.time >= 60.0 + seconds - 1e-6)
    return Track(*(getattr(track, name)[kept] for name in Track.__dataclass_fields__))


@pytest.mark.parametrize(
    ("rate", "pause", "whole"),
    # At 60 rows a second half a second is a pause; at 5, five steps of 0.2 s.
    [(60.0, 0.45, True), (60.0, 0.55, False), (5.0, 1.0, True), (5.0, 1.2, False)],
)
def test_a_pause_between_rows_is_a_loss(setup: FlightSetup, rate: float, pause: float, whole: bool) -> None:
    item = of(judge(setup, paused(fly_path(setup, rate=rate), pause)), "completion")
    assert item.ok is whole
    assert ("the log has no rows" in item.reason) is not whole


@pytest.mark.parametrize(("off", "ok"), [(9.8, True), (10.2, False)])
def test_position_and_velocity_may_differ_by_ten_metres_a_second(setup: FlightSetup, off: float, ok: bool) -> None:
    track = fly_path(setup)
    velocity = np.asarray(track.velocity, dtype=np.float64) + np.array([off, 0.0, 0.0])
    item = of(judge(setup, edited(track, velocity=velocity)), "completion")
    assert item.ok is ok
    assert ("contradict" in item.reason) is not ok
