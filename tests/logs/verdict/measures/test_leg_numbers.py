"""The leg of each row is worked out from route and track, whatever was recorded."""

import dataclasses
import math

import numpy as np

from logs.verdict.measures.leg_numbers import with_legs
from tests.logs.made_flight import make_setup, make_track


def test_a_leg_ends_where_the_track_is_nearest_to_its_waypoint() -> None:
    setup, track = make_setup(), make_track()
    found = with_legs(setup, track).leg
    # The flight goes through each waypoint, 5.7 m a row; a leg ends within a few rows of it, at the fly-by's apex.
    for index, waypoint in enumerate(setup.route.waypoints[1:-1], 1):
        nearest = int(np.argmin(np.linalg.norm(track.position - waypoint, axis=1)))
        assert abs(int(np.searchsorted(found, index)) - nearest) < 12
    assert (np.diff(found) >= 0).all()
    lying = dataclasses.replace(track, leg=np.full(len(track), 2, dtype=np.int32))
    np.testing.assert_array_equal(with_legs(setup, lying).leg, found)


def test_what_was_never_reached_begins_no_leg() -> None:
    """And a track of nothing is on the first."""
    setup, track = make_setup(), make_track()
    found = with_legs(setup, track).leg
    half = track.rows(0, len(track) // 2)
    assert with_legs(setup, half).leg.max() == found[: len(half)].max()
    assert not with_legs(setup, track.rows(0, 1)).leg.any()
    gone = dataclasses.replace(track, position=np.full((len(track), 3), math.nan))
    assert not with_legs(setup, gone).leg.any()
