"""Failures are found at their legs and waypoints, and progress along a route never falls."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from flight.simulation.track import COLUMNS, Track
from logs.figures.elements.failures import failures, paths_differ, route_distance, track_distance
from logs.verdict.places import Place
from tests.logs.figures.figure_data import ROUTE, make_track, make_verdict


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 200.0))
def test_progress_never_falls_and_finds_the_legs(seed: int, spread: float) -> None:
    track = make_track()
    rng = np.random.default_rng(seed)
    position = track.position + np.column_stack([rng.normal(0.0, spread, (len(track), 2)), np.zeros(len(track))])
    position[rng.integers(0, len(track), 3)] = np.nan
    columns = {name: getattr(track, name) for name in COLUMNS} | {"position": position}
    noisy = Track(**columns)
    progress = track_distance(ROUTE, noisy)
    at = route_distance(ROUTE)
    assert (np.diff(progress) >= 0.0).all()
    known = np.isfinite(position[:, 0])
    assert (progress[known] >= at[noisy.leg][known]).all()
    assert (progress <= at[noisy.leg + 1]).all()
    if spread == 0.0:
        straight = np.linspace(0.0, at[-1], len(track))
        np.testing.assert_allclose(progress[known], straight[known], atol=1e-6)


def test_paths_that_lie_on_each_other_do_not_differ() -> None:
    more_points = np.insert(ROUTE, 2, 0.5 * (ROUTE[1] + ROUTE[2]), axis=0)
    assert not paths_differ(ROUTE, more_points, 1.0)
    assert not paths_differ(np.repeat(ROUTE, 2, axis=0), ROUTE, 1.0)
    moved = ROUTE.copy()
    moved[1, 0] += 1.5
    assert paths_differ(ROUTE, moved, 1.0)
    assert paths_differ(ROUTE, ROUTE[:-1], 1.0)


def test_failures_are_found_at_their_legs_and_waypoints() -> None:
    bad = ("slope", Place("leg", 1)), ("clearance", Place("leg", 1)), ("turn", Place("waypoint", 3, 7))
    found = failures(make_verdict(*bad), 4)
    assert found.legs == {1: ("slope", "clearance")}
    assert found.waypoints == {3: ("turn",)}
    assert not failures(make_verdict(("slope", Place("leg", 3)), ("turn", Place("waypoint", 4))), 4)
