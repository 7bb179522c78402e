"""Clearance and crossings of a track, by plain sums."""

import numpy as np
import pytest

from flight.simulation.track import TRACK_ROW, as_track
from planfly.campaigns.flights.track_shape import STATIONS, clearance_profile, waypoint_crossings
from tests.setups import route_along

# North for 300 m, then east for 300 m.
ROUTE = route_along([[0.0, 0.0, 100.0], [0.0, 300.0, 100.0], [300.0, 300.0, 100.0]], 25.0)


def flown(points: list[tuple[float, float, float]], legs: list[int], clearance: list[float]) -> object:
    rows = np.zeros(len(points), TRACK_ROW)
    rows["position"], rows["leg"], rows["clearance"] = points, legs, clearance
    return as_track(rows)


def test_the_profile_has_the_least_of_each_piece() -> None:
    track = flown(
        [(0.0, 1.0, 100.0), (0.0, 1.5, 100.0), (5.0, 150.0, 100.0), (299.0, 300.0, 100.0)], [0, 0, 0, 1], [9, 8, 7, 6]
    )
    profile = clearance_profile(ROUTE, track)
    # Pieces of 600 / STATIONS = 4 m.
    assert STATIONS == 150
    assert (profile[0], profile[37], profile[149]) == (8.0, 7.0, 6.0)
    assert np.isnan(profile).sum() == STATIONS - 3


def test_crossings_are_right_of_and_above() -> None:
    track = flown([(2.0, 0.0, 101.0), (4.0, 296.0, 97.0), (300.0, 295.0, 100.0)], [0, 0, 1], [1, 1, 1])
    crossings = waypoint_crossings(ROUTE, track)
    # At the first, right of north is east; at the corner the mean course is north-east: (4, -4) is 4 sqrt 2 right.
    assert crossings[0] == pytest.approx((2.0, 1.0))
    assert crossings[1] == pytest.approx((4.0 * 2.0**0.5, -3.0), abs=1e-5)
    # Right of east is south.
    assert crossings[2] == pytest.approx((5.0, 0.0), abs=1e-5)


def test_what_was_not_reached_has_no_crossing() -> None:
    crossings = waypoint_crossings(ROUTE, flown([(0.0, 0.0, 100.0), (0.0, 100.0, 100.0)], [0, 0], [1, 1]))
    assert np.isfinite(crossings[0]).all()
    assert np.isnan(crossings[1]).all()
