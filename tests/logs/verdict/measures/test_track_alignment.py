"""Each leg gets the rows of its own passage."""

from dataclasses import replace

import numpy as np

from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import AlignedTrack, align_track
from tests.logs.verdict.judging import judge
from tests.synthetic import (
    fly_path,
    make_setup,
)


def test_routes_that_come_back_are_laid_leg_by_leg() -> None:
    # Three rounds of one square: each waypoint comes again, and each leg must get its own round's rows.
    square = [[0, 0], [0, 1500], [1500, 1500], [1500, 0]]
    points = [[e, n, 300.0 + 10 * k] for k, (e, n) in enumerate(square * 3)]
    setup = make_setup(points)
    track = fly_path(setup, rate=20.0)
    assert judge(setup, track).flyable
    flown = align_track(route_requirements(setup), track)
    assert flown is not None
    assert (np.diff(flown.rows) > 800).all()
    assert flown.apex_distance.max() < 3.0


def test_a_short_leg_within_a_turn_has_the_segment_at_which_both_of_its_waypoints_are_passed() -> None:
    setup = make_setup([[0, 0, 300], [0, 1500, 300], [0, 3000, 300], [0, 4500, 300]])
    flown = align_track(route_requirements(setup), fly_path(setup, rate=20.0))
    assert flown is not None
    last = len(flown.track) - 1

    def passing(*rows: int) -> AlignedTrack:
        legs = np.searchsorted(rows, np.arange(last + 1), side="right") - 1
        return replace(flown, track=replace(flown.track, leg=legs))

    at = passing(5, 400, 400, last - 3)
    assert at.rows.tolist() == [5, 400, 400, last - 3]
    assert [at.leg_segments(leg) for leg in range(3)] == [(0, 400), (400, 401), (400, last)]
    # A flight that ended on leg 1 never passed its end.
    ended = passing(0, 400)
    assert ended.passed.tolist() == [True, True, False, False]
    assert [ended.leg_segments(leg) for leg in range(3)] == [(0, 400), (400, last), (0, 0)]
