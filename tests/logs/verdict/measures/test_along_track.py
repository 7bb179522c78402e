"""Stays in spheres and heights above ground along a track are those of its segments."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from logs.verdict.measures.along_track import passages, segment_clearances
from world.terrain import flat_terrain


@given(
    speed=st.floats(10.0, 60.0),
    offset=st.floats(0.0, 390.0),
    rate=st.sampled_from([1.0, 7.0, 60.0]),
)
@settings(max_examples=40, deadline=None)
def test_passage_times_are_the_spheres_chord(speed: float, offset: float, rate: float) -> None:
    time = np.arange(round(3000.0 / speed * rate) + 2) / rate
    position = np.stack([-1500.0 + speed * time, np.full(time.size, offset), np.full(time.size, 100.0)], axis=1)
    (stay,) = passages(time, position, np.array([0.0, 0.0, 100.0]), 400.0)
    half = math.sqrt(400.0**2 - offset**2)
    assert stay.start == pytest.approx((1500.0 - half) / speed, abs=1e-6)
    assert stay.end == pytest.approx((1500.0 + half) / speed, abs=1e-6)
    assert stay.closest == pytest.approx(offset, abs=1e-6)
    assert stay.whole


def test_a_flight_that_starts_and_ends_inside() -> None:
    time = np.array([0.0, 1.0, 2.0, 3.0])
    position = np.array([[0.0, 0.0, 0.0], [200.0, 0.0, 0.0], [200.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    first, last = passages(time, position, np.zeros(3), 100.0)
    assert (first.start, first.end, first.whole) == (0.0, 0.5, True)
    assert (last.start, last.end, last.whole) == (2.5, 3.0, False)
    assert passages(time, position, np.array([0.0, 0.0, 500.0]), 100.0) == []
    assert passages(time, position, np.zeros(3), 0.0) == []


def test_garbage_positions_meet_nothing() -> None:
    ground = flat_terrain(np.array([[-1e3, 1e3], [-1e3, 1e3]]), 5.0, 100.0)
    position = np.array(
        [[0.0, 0.0, 50.0], [10.0, 0.0, 40.0], [math.nan, 0.0, 0.0], [1e300, 0.0, 0.0], [0.0, 0.0, 20.0]]
    )
    low, at = segment_clearances(ground, position)
    assert low[0] == pytest.approx(35.0)
    assert at[0] == pytest.approx(1.0)
    assert np.isnan(low[1:]).all()
    stays = passages(np.arange(5.0), position, np.zeros(3), 60.0)
    assert [(stay.start, stay.end) for stay in stays] == [(0.0, 1.0)]


def test_no_sphere_and_no_way_have_no_stay() -> None:
    way = np.array([[-100.0, 0.0, 0.0], [100.0, 0.0, 0.0]])
    assert len(passages(np.arange(2.0), way, np.zeros(3), 50.0)) == 1
    for radius in (0.0, -50.0, math.nan):
        assert passages(np.arange(2.0), way, np.zeros(3), radius) == []
    for rows in (0, 1):
        assert passages(np.arange(2.0)[:rows], np.zeros((rows, 3)), np.zeros(3), 50.0) == []
    ground = flat_terrain(np.array([[-1e3, 1e3], [-1e3, 1e3]]), 5.0, 100.0)
    for rows in (0, 1):
        assert [one.size for one in segment_clearances(ground, np.zeros((rows, 3)))] == [0, 0]
