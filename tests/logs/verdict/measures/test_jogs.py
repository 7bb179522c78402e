"""Corners that the way without them passes closely, and steps."""

import math
from typing import Any

import pytest

from logs.verdict.measures.jogs import jog, step
from logs.verdict.measures.route_demands import RouteDemands, route_demands
from tests.synthetic import make_setup


def demands_of(points: list[list[float]], **how: Any) -> RouteDemands:
    return route_demands(make_setup(points, **how))


def test_a_sidestep_is_passed_at_half_its_width() -> None:
    demands = demands_of([[0, 0, 300], [0, 1000, 300], [6, 1000, 300], [6, 2000, 300]])
    # Without the first corner alone the way passes it at 6 m, and hardly turns at the second.
    assert jog(demands, 1) == pytest.approx(6.0, abs=0.01)
    wide = demands_of([[0, 0, 300], [0, 1000, 300], [12, 1000, 300], [12, 2000, 300]])
    assert jog(wide, 1) == pytest.approx(6.0, abs=0.01)
    assert jog(demands_of([[0, 0, 300], [0, 1000, 300], [16, 1000, 300], [16, 2000, 300]]), 1) is None


def test_the_way_without_a_corner_has_to_have_room_for_its_own_turns() -> None:
    # A right angle with a bevel of 7 m: without it, the right angle itself, which has room with 1000 m and not with 50.
    for run, room in ((1000.0, True), (50.0, False)):
        demands = demands_of([[0, 0, 300], [0, 1000, 300], [5, 1005, 300], [5 + run, 1005, 300], [5 + run, 3000, 300]])
        assert (jog(demands, 1) is not None) is room


def test_the_corners_of_a_circle_are_no_jog() -> None:
    demands = demands_of([[0, 0, 300], [0, 1000, 300], [6, 1000, 300], [6, 2000, 300]])
    arcs = demands.setup.route.arcs.copy()
    arcs[1:3] = 3.0
    object.__setattr__(demands.setup.route, "arcs", arcs)
    assert jog(demands, 1) is None


@pytest.mark.parametrize(("rise", "height"), [(9.9, 9.9), (-9.9, 9.9), (10.1, None), (-10.1, None)])
def test_a_step_is_as_high_as_its_leg(rise: float, height: float | None) -> None:
    demands = demands_of([[0, 0, 300], [0, 1000, 300], [0, 1010, 300 + rise], [0, 2000, 300 + rise]])
    assert step(demands, 1) == (None if height is None else pytest.approx(height))


def test_all_that_is_too_steep_in_a_row_is_one_step() -> None:
    points = [[0.0, 0.0, 300.0], [0.0, 1000.0, 300.0]]
    for _ in range(3):
        points.append([0.0, points[-1][1] + 10.0, points[-1][2] + 3.0])
    demands = demands_of([*points, [0.0, 3000.0, 309.0]])
    assert [step(demands, leg) for leg in (1, 2, 3)] == pytest.approx([9.0, 9.0, 9.0])
    points.append([0.0, points[-1][1] + 10.0, points[-1][2] + 3.0])
    demands = demands_of([*points, [0.0, 3000.0, 312.0]])
    assert [step(demands, leg) for leg in (1, 2, 3, 4)] == [None] * 4
    assert math.degrees(demands.slopes[1]) == pytest.approx(math.degrees(math.atan2(3, 10)))


@pytest.mark.parametrize("circle", [1, 2])
def test_a_way_past_one_corner_of_a_circle_is_no_jog(circle: int) -> None:
    """12 m aside, so that both corners have to be left out."""
    demands = demands_of([[0, 0, 300], [0, 1000, 300], [12, 1000, 300], [12, 2000, 300]])
    arcs = demands.setup.route.arcs.copy()
    arcs[circle] = 3.0
    object.__setattr__(demands.setup.route, "arcs", arcs)
    assert jog(demands, 1) is None
