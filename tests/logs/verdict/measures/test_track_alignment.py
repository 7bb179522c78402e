"""Each leg gets the rows of its own passage."""

import numpy as np

from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track
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
