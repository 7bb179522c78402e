"""What counts as reached, how far turns lead off their legs, and distances from a chain of legs."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from logs.verdict.measures.acceptance import (
    acceptance_limit,
    corridor_limit,
    farthest_from_legs,
    negligible_kink_distance,
    negligible_step_height,
    position_error,
    turn_deviations,
)
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from tests.synthetic import bank_radius, make_setup

RIGHT_ANGLE = [[0, 0, 300], [0, 3000, 300], [3000, 3000, 300], [6000, 3000, 300]]


def test_a_stated_radius_comes_before_the_paths_own() -> None:
    setup = make_setup(RIGHT_ANGLE, fly_over=(2,))
    own = bank_radius() * (math.sqrt(2.0) - 1.0)
    radii, sources = zip(*(acceptance_limit(route_requirements(setup), i) for i in range(4)), strict=True)
    assert radii == pytest.approx([10.0, own + 10.0, 10.0, 10.0])
    assert sources == ("fly-by path", "fly-by path", "fly-over", "fly-by path")
    stated = replace(setup, route=setup.route.with_fields(acceptance_radius=np.array([0.0, 25.0, 7.0, 0.0])))
    assert [acceptance_limit(route_requirements(stated), i) for i in (1, 2)] == [(25.0, "mission"), (7.0, "mission")]


def test_navigation_is_off_by_three_standard_deviations() -> None:
    setup = make_setup(RIGHT_ANGLE)
    assert [position_error(replace(setup, nav=nav)) for nav in ("perfect", "rtk", "gnss")] == pytest.approx(
        [0.0, 0.15, 4.5]
    )


def test_a_turn_leads_off_its_legs_by_its_own_arc() -> None:
    """R (1 - cos 45) inside a right angle; R beyond the next leg where the waypoint is flown over; 0 straight on."""
    by, over = make_setup(RIGHT_ANGLE), make_setup(RIGHT_ANGLE, fly_over=(1,))
    inside = bank_radius() * (1.0 - math.sqrt(0.5))
    assert turn_deviations(route_requirements(by), 0).tolist() == pytest.approx([0.0, inside], abs=1e-9)
    assert turn_deviations(route_requirements(over), 1).tolist() == pytest.approx([bank_radius(), 0.0], abs=1e-9)
    assert [corridor_limit(route_requirements(by), leg) for leg in (0, 2)] == [
        (pytest.approx(inside + 10.0), "fly-by path"),
        (30.0, "default"),
    ]


def test_distance_is_to_the_nearest_point_of_the_nearest_leg() -> None:
    legs = np.array([[0.0, 0.0, 0.0], [0.0, 100.0, 50.0], [100.0, 100.0, 0.0]])
    points = {(-7.0, 50.0): 7.0, (3.0, -4.0): 5.0, (60.0, 130.0): 30.0, (103.0, 104.0): 5.0, (20.0, 70.0): 20.0}
    for (east, north), away in points.items():
        assert farthest_from_legs(np.array([[east, north, 999.0]]), legs) == (pytest.approx(away), 0)
    assert farthest_from_legs(np.array([[*point, 0.0] for point in points]), legs) == (pytest.approx(30.0), 2)


# ----------------------------------------------------------------------
# Corners that the way without them passes closely, and steps.


def demands_of(points: list[list[float]], **how: Any) -> RouteRequirements:
    return route_requirements(make_setup(points, **how))


def test_a_sidestep_is_passed_at_half_its_width() -> None:
    requirements = demands_of([[0, 0, 300], [0, 1000, 300], [6, 1000, 300], [6, 2000, 300]])
    # Without the first corner alone the way passes it at 6 m, and hardly turns at the second.
    assert negligible_kink_distance(requirements, 1) == pytest.approx(6.0, abs=0.01)
    wide = demands_of([[0, 0, 300], [0, 1000, 300], [12, 1000, 300], [12, 2000, 300]])
    assert negligible_kink_distance(wide, 1) == pytest.approx(6.0, abs=0.01)
    assert (
        negligible_kink_distance(demands_of([[0, 0, 300], [0, 1000, 300], [16, 1000, 300], [16, 2000, 300]]), 1) is None
    )


def test_the_way_without_a_corner_has_to_have_room_for_its_own_turns() -> None:
    # A right angle with a bevel of 7 m: without it, the right angle itself, which has room with 1000 m and not with 50.
    for run, room in ((1000.0, True), (50.0, False)):
        requirements = demands_of(
            [[0, 0, 300], [0, 1000, 300], [5, 1005, 300], [5 + run, 1005, 300], [5 + run, 3000, 300]]
        )
        assert (negligible_kink_distance(requirements, 1) is not None) is room


def test_a_way_without_a_corner_has_the_room_of_the_routes_first_leg() -> None:
    """A right angle takes some 130 m of the first leg's 200 m, which has no turn at its begin."""
    requirements = demands_of([[0, 0, 300], [0, 200, 300], [1000, 202, 300], [2000, 200, 300], [3000, 200, 300]])
    assert negligible_kink_distance(requirements, 2) is not None


def test_the_corners_of_a_circle_are_no_jog() -> None:
    requirements = demands_of([[0, 0, 300], [0, 1000, 300], [6, 1000, 300], [6, 2000, 300]])
    arcs = requirements.setup.route.arc_radii.copy()
    arcs[1:3] = 3.0
    object.__setattr__(requirements.setup, "route", requirements.setup.route.with_fields(arc_radius=arcs))
    assert negligible_kink_distance(requirements, 1) is None


@pytest.mark.parametrize(("rise", "height"), [(9.9, 9.9), (-9.9, 9.9), (10.1, None), (-10.1, None)])
def test_a_step_is_as_high_as_its_leg(rise: float, height: float | None) -> None:
    requirements = demands_of([[0, 0, 300], [0, 1000, 300], [0, 1010, 300 + rise], [0, 2000, 300 + rise]])
    assert negligible_step_height(requirements, 1) == (None if height is None else pytest.approx(height))


def test_all_that_is_too_steep_in_a_row_is_one_step() -> None:
    points = [[0.0, 0.0, 300.0], [0.0, 1000.0, 300.0]]
    for _ in range(3):
        points.append([0.0, points[-1][1] + 10.0, points[-1][2] + 3.0])
    requirements = demands_of([*points, [0.0, 3000.0, 309.0]])
    assert [negligible_step_height(requirements, leg) for leg in (1, 2, 3)] == pytest.approx([9.0, 9.0, 9.0])
    points.append([0.0, points[-1][1] + 10.0, points[-1][2] + 3.0])
    requirements = demands_of([*points, [0.0, 3000.0, 312.0]])
    assert [negligible_step_height(requirements, leg) for leg in (1, 2, 3, 4)] == [None] * 4
    assert math.degrees(requirements.slopes[1]) == pytest.approx(math.degrees(math.atan2(3, 10)))


@pytest.mark.parametrize("circle", [1, 2])
def test_a_way_past_one_corner_of_a_circle_is_no_jog(circle: int) -> None:
    """12 m aside, so that both corners have to be left out."""
    requirements = demands_of([[0, 0, 300], [0, 1000, 300], [12, 1000, 300], [12, 2000, 300]])
    arcs = requirements.setup.route.arc_radii.copy()
    arcs[circle] = 3.0
    object.__setattr__(requirements.setup, "route", requirements.setup.route.with_fields(arc_radius=arcs))
    assert negligible_kink_distance(requirements, 1) is None
