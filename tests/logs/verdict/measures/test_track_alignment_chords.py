"""Rows laid to waypoints: the assignment against all others tried one by one, and what the table is thinned to."""

import math
from itertools import combinations_with_replacement, pairwise
from typing import Any

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from logs.verdict.measures import track_alignment
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track, closest_approaches, project_onto_leg
from tests.synthetic import fly_path, make_setup, waypoint_stations

CAPTURE = 500.0


def distance2(a: np.ndarray, b: np.ndarray, mark: np.ndarray) -> float:
    """Squared distance of a point from a segment."""
    leg, out = b - a, mark - a
    along = min(1.0, max(0.0, float(leg @ out) / float(leg @ leg)))
    return float(((out - along * leg) ** 2).sum())


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("step", [1, 3])
def test_of_all_assignments_in_order_of_time_the_least_is_found(seed: int, step: int) -> None:
    rng = np.random.default_rng(seed)
    position = np.cumsum(rng.normal(0.0, 150.0, (25, 3)), axis=0)
    marks = position[np.sort(rng.integers(0, 25, 3))] + rng.normal(0.0, 300.0, (3, 3))
    ends = [*range(0, 24, step), 24]
    costs = [[min(distance2(position[a], position[b], mark), CAPTURE**2) for a, b in pairwise(ends)] for mark in marks]
    every = combinations_with_replacement(range(len(ends) - 1), len(marks))
    least = min(sum(costs[i][j] for i, j in enumerate(chosen)) for chosen in every)
    all_rows = np.zeros(3, dtype=np.int64), np.full(3, 24)
    chords, capped = track_alignment._match_chords(position, marks, *all_rows, step, CAPTURE)
    assert (np.diff(chords) >= 0).all()
    assert sum(costs[i][j] for i, j in enumerate(chords)) == pytest.approx(least, rel=1e-9)
    for i, j in enumerate(chords):
        rows = position[j * step : min(24, (j + 1) * step) + 1]
        assert capped[i] == (((rows - marks[i]) ** 2).sum(axis=1).min() >= CAPTURE**2)


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many rows a chord had, each time that rows were laid to waypoints."""
    seen, align = [], track_alignment._match_chords

    def watched(position: Any, marks: Any, first: Any, until: Any, step: int, capture: float) -> Any:
        seen.append(step)
        return align(position, marks, first, until, step, capture)

    monkeypatch.setattr(track_alignment, "_match_chords", watched)
    return seen


LONG = [[0, 0, 300], [0, 3000, 300], [0, 6000, 300]]


@pytest.mark.parametrize(("rate", "rows"), [(50.0, 12), (10.0, 2), (2.0, 1)])
def test_a_chord_lasts_as_long_at_any_rate(steps: list[int], rate: float, rows: int) -> None:
    setup = make_setup(LONG)
    assert align_track(route_requirements(setup), fly_path(setup, rate=rate)) is not None
    # As many whole rows as a quarter of a second has, or one.
    assert steps == [rows]


def test_a_long_tracks_table_is_thinned_to_its_size(steps: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    setup = make_setup(LONG)
    track = fly_path(setup)
    monkeypatch.setattr(track_alignment, "_CELLS", 600)
    aligned = align_track(route_requirements(setup), track)
    assert aligned is not None
    # 14,400 rows and three waypoints in 600 cells.
    assert steps == [math.ceil(len(track) * 3 / 600)]
    assert aligned.track.time[aligned.rows] == pytest.approx([0.0, 120.0, 240.0], abs=0.02)


def test_a_waypoint_that_was_missed_lies_between_its_neighbours() -> None:
    """2 km beside the way from its neighbour at 4 km to that at 6 km; a later part of the flight comes nearer."""
    points = [[0, 0, 300], [0, 4000, 300], [2000, 5000, 300], [0, 6000, 300], [0, 9000, 300], [1500, 9000, 300]]
    setup = make_setup([*points, [1500, 4000, 300]])
    flown = make_setup([*points[:2], *points[3:], [1500, 4000, 300]])
    aligned = align_track(route_requirements(setup), fly_path(flown))
    assert aligned is not None
    assert aligned.track.time[aligned.rows[1:4]] == pytest.approx([160.0, 200.0, 240.0], abs=0.5)
    assert aligned.apex_distance[2] == pytest.approx(2000.0, rel=0.1)
    assert aligned.passed.all()


def test_the_first_rows_end_of_a_flight_that_met_nothing() -> None:
    far = make_setup([[9000, 0, 300], [9000, 3000, 300]])
    track = fly_path(make_setup([[0, 0, 300], [0, 3000, 300]]))
    aligned = align_track(route_requirements(far), track)
    assert aligned is not None
    assert aligned.rows.tolist() == [0, len(track) - 1]
    assert aligned.passed.tolist() == [True, False]


@pytest.mark.parametrize("course_deg", [0.0, 37.0, 130.0, 250.0])
def test_along_and_to_the_right_of_a_leg(course_deg: float) -> None:
    course = math.radians(course_deg)
    ahead, right = np.array([math.sin(course), math.cos(course)]), np.array([math.cos(course), -math.sin(course)])
    start = np.array([120.0, -40.0])
    setup = make_setup([[*start, 300], [*(start + 900.0 * ahead), 300], [*(start + 1800.0 * ahead), 300]])
    wanted = np.array([[0.0, 0.0], [500.0, 30.0], [-20.0, -70.0]])
    position = np.column_stack([start + wanted[:, :1] * ahead + wanted[:, 1:] * right, np.full(3, 300.0)])
    along, across = project_onto_leg(route_requirements(setup), 0, position)
    np.testing.assert_allclose(np.column_stack([along, across]), wanted, atol=1e-9)


def test_the_approach_of_each_segment() -> None:
    position = np.array([[0.0, 0.0, 5.0], [10.0, 0.0, 9.0], [10.0, 0.0, 9.0], [10.0, 30.0, 0.0]])
    away, fraction = closest_approaches(position, np.array([4.0, 3.0]))
    assert away == pytest.approx([3.0, math.sqrt(45.0), 6.0])
    assert fraction == pytest.approx([0.4, 0.0, 0.1])


def test_the_course_and_run_of_a_track_are_its_steps() -> None:
    setup: FlightSetup = make_setup([[0, 0, 300], [2000, 0, 300], [2000, -3000, 300]])
    track = fly_path(setup, radius=100.0, rate=10.0)
    aligned = align_track(route_requirements(setup), track)
    assert aligned is not None
    at = int(waypoint_stations(setup, 100.0)[1] / 2.5)
    assert np.degrees(aligned.course[[0, at - 70, at + 70, -1]]) == pytest.approx([90.0, 90.0, 180.0, 180.0], abs=0.01)
    length = 5000.0 - 200.0 + 50.0 * math.pi
    assert aligned.distance_run[-1] == pytest.approx(length, abs=0.5)
    assert len(aligned.course) == len(aligned.distance_run) == len(track)
