"""How corners of the field were passed, against sums on polylines made by hand."""

from collections.abc import Sequence

import numpy as np
import pytest

from logs.verdict.measures.flown_corners import OF_NEXT_LEG, CornerPass, corner_passes
from logs.verdict.measures.route_demands import route_demands
from logs.verdict.measures.track_alignment import lay_track
from tests.synthetic import edited, fly_path, make_setup

Place = tuple[float, float]
# Two kilometres north, then one to the east, then north again.
ROUTE: tuple[Place, ...] = ((0.0, 0.0), (0.0, 2000.0), (1000.0, 2000.0), (1000.0, 4000.0))


def passes(flown: Sequence[Place], route: Sequence[Place] = ROUTE) -> tuple[CornerPass, ...]:
    """Of a flight along straight lines from place to place."""
    setup = make_setup([(east, north, 300.0) for east, north in route])
    track = fly_path(setup)
    way = np.array(flown)
    marks = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
    along = np.linspace(0.0, marks[-1], len(track))
    level = np.full(len(track), 300.0)
    position = np.column_stack([np.interp(along, marks, way[:, 0]), np.interp(along, marks, way[:, 1]), level])
    demands = route_demands(setup)
    aligned = lay_track(demands, edited(track, position=position))
    assert aligned is not None
    return corner_passes(demands, aligned)


def test_a_flight_over_the_corners_overshoots_none() -> None:
    found = passes(ROUTE)
    assert [one.nearest for one in found] == pytest.approx([0.0] * 4, abs=0.3)
    assert [one.overshoot for one in found[1:-1]] == pytest.approx([0.0, 0.0], abs=0.3)
    assert (found[0].overshoot, found[-1].overshoot) == (None, None)


def test_how_far_past_the_new_leg_a_flight_went() -> None:
    """80 m too far north, back on the leg 400 m along it."""
    found = passes([(0.0, 0.0), (0.0, 2080.0), (400.0, 2000.0), *ROUTE[2:]])
    assert found[1].overshoot == pytest.approx(80.0, abs=0.5)
    assert found[1].nearest == pytest.approx(0.0, abs=0.3)
    # Cut inside, the other side is none.
    inside = passes([(0.0, 0.0), (0.0, 1900.0), (400.0, 1920.0), (600.0, 2000.0), *ROUTE[2:]])
    assert inside[1].overshoot == 0.0
    assert inside[1].nearest == pytest.approx(100.0, abs=0.5)


@pytest.mark.parametrize(("peak", "counts"), [(OF_NEXT_LEG - 0.03, True), (OF_NEXT_LEG + 0.15, False)])
def test_only_the_first_part_of_the_next_leg_is_looked_at(peak: float, counts: bool) -> None:
    """A bulge of 50 m whose foot is 50 m before it, and 100 m after."""
    top = 1000.0 * peak
    found = passes([*ROUTE[:2], (top - 50.0, 2000.0), (top, 2050.0), (top + 100.0, 2000.0), *ROUTE[2:]])
    assert found[1].overshoot == pytest.approx(50.0 if counts else 0.0, abs=0.5)


def test_the_look_ends_at_the_very_place_between_rows() -> None:
    """On a way that leaves the next leg by 0.1 m a metre that is 70 m at seven tenths of it."""
    found = passes([*ROUTE[:2], (1000.0, 2100.0), ROUTE[3]])
    assert found[1].overshoot == pytest.approx(0.1 * OF_NEXT_LEG * 1000.0, abs=1e-6)


def test_each_pass_comes_after_the_one_before() -> None:
    """A route that goes out and back: the flight is as near to its third place on the way out."""
    back: tuple[Place, ...] = ((0.0, 0.0), (0.0, 2000.0), (300.0, 2000.0), (300.0, 0.0))
    found = passes([(0.0, 0.0), (100.0, 2000.0), (300.0, 2000.0), (300.0, 0.0)], back)
    times = [one.time for one in found]
    assert times == sorted(times)
    assert [one.nearest for one in found] == pytest.approx([0.0, 99.9, 0.0, 0.0], abs=0.3)


def test_a_leg_that_was_cut_off_is_not_joined() -> None:
    """Past the second waypoint the aircraft is already 200 m beyond the short leg's end."""
    short: tuple[Place, ...] = ((0.0, 0.0), (0.0, 2000.0), (50.0, 2000.0), (2000.0, 2000.0))
    found = passes([(0.0, 0.0), (250.0, 1800.0), (250.0, 2000.0), (2000.0, 2000.0)], short)
    assert found[1].overshoot is None
    # The nearest place of the first straight to (0, 2000) is its end, or on the next.
    assert found[1].nearest == pytest.approx(250.0, abs=1.0)
    assert found[1].beyond == pytest.approx(200.0, abs=1.0)
