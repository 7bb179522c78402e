"""The leg of each row is worked out from route and track, whatever was recorded."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.track_alignment import find_leg_ends, with_legs
from tests.logs.made_flight import make_setup, make_track


def numbered(setup: FlightSetup, track: Track) -> NDArray[np.int32]:
    return with_legs(track, find_leg_ends(setup, track)).leg


def test_a_leg_ends_where_the_track_is_nearest_to_its_waypoint() -> None:
    setup, track = make_setup(), make_track()
    found = numbered(setup, track)
    # The flight goes through each waypoint, 5.7 m a row; a leg ends within a few rows of it, at the fly-by's apex.
    for index, waypoint in enumerate(setup.route.positions[1:-1], 1):
        nearest = int(np.argmin(np.linalg.norm(track.position - waypoint, axis=1)))
        assert abs(int(np.searchsorted(found, index)) - nearest) < 12
    assert (np.diff(found) >= 0).all()
    lying = dataclasses.replace(track, leg=np.full(len(track), 2, dtype=np.int32))
    np.testing.assert_array_equal(numbered(setup, lying), found)


def test_what_was_never_reached_begins_no_leg() -> None:
    """And a track of nothing is on the first."""
    setup, track = make_setup(), make_track()
    found = numbered(setup, track)
    half = track.rows(0, len(track) // 2)
    assert numbered(setup, half).max() == found[: len(half)].max()
    assert not numbered(setup, track.rows(0, 1)).any()
    gone = dataclasses.replace(track, position=np.full((len(track), 3), math.nan))
    assert not numbered(setup, gone).any()
