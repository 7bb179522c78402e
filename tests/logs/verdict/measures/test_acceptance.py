"""What counts as reached, how far turns lead off their legs, and distances from a chain of legs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from logs.verdict.measures.acceptance import (
    corner_depths,
    corridor_limit,
    farthest_from_legs,
    position_error,
    reach,
)
from logs.verdict.measures.route_demands import route_demands
from tests.synthetic import bank_radius, make_setup

RIGHT_ANGLE = [[0, 0, 300], [0, 3000, 300], [3000, 3000, 300], [6000, 3000, 300]]


def test_a_stated_radius_comes_before_the_paths_own() -> None:
    setup = make_setup(RIGHT_ANGLE, fly_over=(2,))
    own = bank_radius() * (math.sqrt(2.0) - 1.0)
    found = [reach(route_demands(setup), i) for i in range(4)]
    assert [item.radius for item in found] == pytest.approx([10.0, own + 10.0, 10.0, 10.0])
    assert [item.source for item in found] == ["fly-by path", "fly-by path", "fly-over", "fly-by path"]
    stated = replace(setup, route=replace(setup.route, acceptance=np.array([0.0, 25.0, 7.0, 0.0])))
    found = [reach(route_demands(stated), i) for i in range(4)]
    assert [(item.radius, item.source) for item in found[1:3]] == [(25.0, "mission"), (7.0, "mission")]


def test_navigation_is_off_by_three_standard_deviations() -> None:
    setup = make_setup(RIGHT_ANGLE)
    assert [position_error(replace(setup, nav=nav)) for nav in ("perfect", "rtk", "gnss")] == pytest.approx(
        [0.0, 0.15, 4.5]
    )


def test_a_turn_leads_off_its_legs_by_its_own_arc() -> None:
    """R (1 - cos 45) inside a right angle; R beyond the next leg where the waypoint is flown over; 0 straight on."""
    by, over = make_setup(RIGHT_ANGLE), make_setup(RIGHT_ANGLE, fly_over=(1,))
    inside = bank_radius() * (1.0 - math.sqrt(0.5))
    assert corner_depths(route_demands(by)).tolist() == pytest.approx([0.0, inside, 0.0, 0.0], abs=1e-9)
    assert corner_depths(route_demands(over)).tolist() == pytest.approx([0.0, bank_radius(), 0.0, 0.0], abs=1e-9)
    assert [corridor_limit(route_demands(by), leg) for leg in (0, 2)] == [
        (pytest.approx(inside + 10.0), "fly-by path"),
        (30.0, "default"),
    ]


def test_distance_is_to_the_nearest_point_of_the_nearest_leg() -> None:
    legs = np.array([[0.0, 0.0, 0.0], [0.0, 100.0, 50.0], [100.0, 100.0, 0.0]])
    points = {(-7.0, 50.0): 7.0, (3.0, -4.0): 5.0, (60.0, 130.0): 30.0, (103.0, 104.0): 5.0, (20.0, 70.0): 20.0}
    for (east, north), away in points.items():
        assert farthest_from_legs(np.array([[east, north, 999.0]]), legs) == (pytest.approx(away), 0)
    assert farthest_from_legs(np.array([[*point, 0.0] for point in points]), legs) == (pytest.approx(30.0), 2)
