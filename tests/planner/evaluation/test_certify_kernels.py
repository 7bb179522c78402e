"""The pieces that a certificate looks at cover the path, and say how far from them a flight may be."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from aircraft.envelope import turn_radius
from aircraft.path_limits import Limits
from planner.evaluation.certify_kernels import (
    add_end_course_points,
    heights_above_ground,
    leg_slope_limits,
    missile_distance,
    tracked_pieces,
    turn_and_roll_lengths,
)
from planner.evaluation.problem import ANGLE_MARGIN_RAD, BUFFER_GROWTH_RATIO, ProblemArrays, make_problem
from tests.planner.tracking_limits import with_tracking_error
from world.scenario import Scenario

Make = Callable[[Scenario], Limits]
FLAT = {"kind": "flat", "amsl_m": 20}
# East for 2 km, then north for 1.5 km: a right angle.
CORNER = np.array([[0.0, 0.0, 150.0], [2000.0, 0.0, 150.0], [2000.0, 1500.0, 150.0]])
CLIMB = CORNER + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 100.0], [0.0, 0.0, 100.0]])


@pytest.fixture
def make(small: Callable[..., Scenario], make_limits: Make) -> Callable[..., ProblemArrays]:
    def made(numbers: dict[str, float], **tables: Any) -> ProblemArrays:
        scenario = small(**({"terrain": FLAT, "threats": []} | tables))
        return make_problem(scenario, with_tracking_error(make_limits(scenario), **numbers)).certified

    return made


def test_pieces_follow_each_leg_and_both_sides_of_a_corner(make: Callable[..., ProblemArrays]) -> None:
    ends = {"east_m": 2000, "north_m": 1500, "amsl_m": 150}
    pieces = tracked_pieces(make({"across": 4.0, "lag": 3.0, "before": 150.0}, destination=ends), CORNER)
    along = pieces[~pieces["of_corner"]]
    for leg in range(2):
        own = along[along["number"] == leg]
        assert own["begin"][0] == pytest.approx(CORNER[leg])
        assert own["end"][-1] == pytest.approx(CORNER[leg + 1])
        assert own["begin"][1:] == pytest.approx(own["end"][:-1])
    about = pieces[pieces["of_corner"]]
    assert about["begin"][0] == pytest.approx([1850.0, 0.0, 150.0])
    assert about["end"][1] == pytest.approx([2000.0, 200.0, 150.0])
    # 20 m at a right angle, and 4 m as on a straight leg; nothing where the plan is fixed.
    assert about["lateral"] == pytest.approx([24.0, 24.0])
    assert along["lateral_begin"][0] == 0.0
    assert along["lateral_begin"][1:-1] == pytest.approx(4.0, abs=4.0)
    assert along["lateral_end"][-1] == 0.0


def test_missiles_are_nearer_by_what_it_strays(make: Callable[..., ProblemArrays]) -> None:
    """Beside a leg by 4 m, and beside the corner by 24 m."""
    beside = {"east_m": 1000, "north_m": -900, "amsl_m": 150, "kill_radius_m": 400, "kill_scale_m": 40}
    outside = {"east_m": 2700, "north_m": 0, "amsl_m": 150, "kill_radius_m": 400, "kill_scale_m": 40}
    for unit, away in ((beside, 500.0 - 4.0), (outside, 300.0 - 24.0)):
        assert missile_distance(make({"across": 4.0}, threats=[unit]), CORNER) == pytest.approx(away, abs=0.01)


def test_a_climb_is_flown_lower_than_it_is_drawn(make: Callable[..., ProblemArrays]) -> None:
    """100 m in 2,000 at 25.3 m/s, 3 s late: 3.8 m; and the level leg after it begins as low."""
    exact, late = (heights_above_ground(make({"lag": lag}), CLIMB) for lag in (0.0, 3.0))
    legs = late[~late["of_arc"]]
    first = exact[~exact["of_arc"]][0]["height"]
    assert first == pytest.approx(130.0)
    assert legs[0]["height"] > 126.0
    after = legs[legs["number"] == 1]
    assert after["height"][0] == pytest.approx(230.0 - 3.8, abs=0.1)
    assert after["height"][-1] == pytest.approx(230.0, abs=0.3)


def test_ground_beside_the_way_counts(make: Callable[..., ProblemArrays]) -> None:
    """A hill of 300 m half a kilometre beside the first leg: the less clearance the wider it strays."""
    hill = {"kind": "peaks", "peak": [{"east_m": 1000, "north_m": 500, "height_m": 300, "sigma_m": 250}]}
    heights = [heights_above_ground(make({"across": across}, terrain=hill), CORNER) for across in (0.0, 20.0, 40.0)]
    least = [float(pieces["height"].min()) for pieces in heights]
    # It is 300 exp(-(500 - across)^2 / (2 x 250^2)) high there.
    high = [300.0 * math.exp(-((500.0 - across) ** 2) / (2.0 * 250.0**2)) for across in (0.0, 20.0, 40.0)]
    assert least[0] - least[1] == pytest.approx(high[1] - high[0], rel=0.02)
    assert least[0] - least[2] == pytest.approx(high[2] - high[0], rel=0.02)


# ----------------------------------------------------------------------
# What a certificate measures, on level ground and with plain geometry.

MISSILE = {"east_m": 3000, "north_m": 1000, "amsl_m": 250, "kill_radius_m": 400, "kill_scale_m": 40}
RADAR = {"east_m": 3000, "north_m": 0, "amsl_m": 150, "detection_radius_m": 400, "detection_scale_m": 40}


@pytest.fixture
def make_certified(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> Callable[..., ProblemArrays]:
    """Arrays of the certificate, over level ground at 20 m, in still air."""

    def made(**tables: Any) -> ProblemArrays:
        scenario = small(**({"terrain": FLAT, "threats": []} | tables))
        return make_problem(scenario, make_limits(scenario)).certified

    return made


def test_a_straight_leg_keeps_its_distance_from_a_missile(
    make_certified: Callable[..., ProblemArrays],
) -> None:
    data = make_certified(threats=[RADAR, MISSILE])
    east = np.array([[0.0, 0.0, 150.0], [6000.0, 0.0, 150.0]])
    # It passes 1000 m beside and 100 m below the missile.
    assert missile_distance(data, east) == pytest.approx(math.hypot(1000.0, 100.0) - 400.0)
    # A leg that ends before the missile is nearest at its end.
    short = np.array([[0.0, 0.0, 150.0], [2700.0, 0.0, 150.0]])
    assert missile_distance(data, short) == pytest.approx(math.sqrt(300.0**2 + 1000.0**2 + 100.0**2) - 400.0)
    # Inside the sphere the distance is negative; at the missile itself it is the radius.
    through = np.array([[0.0, 1000.0, 250.0], [6000.0, 1000.0, 250.0]])
    assert missile_distance(data, through) == pytest.approx(-400.0)
    still = np.array([[3000.0, 1300.0, 250.0], [3000.0, 1300.0, 250.0]])
    assert missile_distance(data, still) == pytest.approx(-100.0)


def test_a_radar_is_no_missile(make_certified: Callable[..., ProblemArrays]) -> None:
    assert missile_distance(make_certified(threats=[RADAR]), CORNER) == math.inf
    assert missile_distance(make_certified(), CORNER) == math.inf


def test_the_arc_inside_a_corner_counts_too(make_certified: Callable[..., ProblemArrays]) -> None:
    # The arc cuts the corner off on the side of a missile there, by (sqrt(2) - 1) radii.
    inside = {"east_m": 1000, "north_m": 1000, "amsl_m": 150, "kill_radius_m": 400, "kill_scale_m": 40}
    radius = turn_radius(25.0, math.radians(30.0))
    # From the missile to the arc's centre, and on to its middle: 1.4 m for the chords (15 degrees each).
    centre = math.hypot(1000.0 - radius, 1000.0 - radius)
    wanted = min(1000.0, centre + radius) - 400.0
    assert missile_distance(make_certified(threats=[inside]), CORNER) == pytest.approx(wanted, abs=1.5)
    near = inside | {"east_m": 1990, "north_m": 10, "kill_radius_m": 1, "kill_scale_m": 1}
    # 14 m from the corner, along the diagonal, a leg is nearer than the arc, which passes 0.414 radii from the corner.
    assert missile_distance(make_certified(threats=[near]), CORNER) == pytest.approx(10.0 - 1.0)
    far = near | {"east_m": 1970, "north_m": 30}
    away = (math.sqrt(2.0) - 1.0) * radius - math.hypot(30.0, 30.0)
    assert 0.0 < away < 30.0
    assert missile_distance(make_certified(threats=[far]), CORNER) == pytest.approx(away - 1.0, abs=1.5)


def test_courses_asked_for_become_far_points_on_them(make_certified: Callable[..., ProblemArrays]) -> None:
    start, destination = make_ends(course_deg=0), make_ends(east=6000, course_deg=90)
    out = add_end_course_points(make_certified(start=start, destination=destination), CORNER)
    np.testing.assert_array_equal(out[1:-1], CORNER)
    # It comes from the south, and leaves to the east, level.
    assert out[0].tolist() == pytest.approx([0.0, -1e4, 150.0])
    assert out[-1].tolist() == pytest.approx([12_000.0, 1500.0, 150.0])
    free = add_end_course_points(make_certified(), CORNER)
    # On the legs' own lines.
    assert free[0].tolist() == [-2000.0, 0.0, 150.0]
    assert free[-1].tolist() == [2000.0, 3000.0, 150.0]


def make_ends(east: float = 0.0, **more: float) -> dict[str, float]:
    """[start] or [destination] on the middle line."""
    return {"east_m": east, "north_m": 0.0, "amsl_m": 150.0} | more


def test_a_turn_uses_its_tangent_of_both_legs(make_certified: Callable[..., ProblemArrays]) -> None:
    # At right angles the tangent is as long as the radius.
    radius = turn_radius(25.0, math.radians(30.0))
    turns, rolls = turn_and_roll_lengths(make_certified(), CORNER)
    assert turns.tolist() == pytest.approx([radius, radius], rel=1e-6)
    assert rolls.tolist() == [0.0, 0.0]


def test_only_an_s_turn_rolls_over(make_certified: Callable[..., ProblemArrays]) -> None:
    data, radius = make_certified(), turn_radius(25.0, math.radians(30.0))
    for side, rolling in ((1.0, False), (-1.0, True)):
        end = [2000.0 - side * 1500.0, 1500.0, 150.0]
        turns, rolls = turn_and_roll_lengths(data, np.vstack([CORNER, end]))
        assert turns.tolist() == pytest.approx([radius, 2.0 * radius, radius], rel=1e-6)
        assert [roll > 0.0 for roll in rolls] == [False, rolling, False]


def test_slopes_are_the_numbers_of_the_scenario_less_their_margin(
    make_certified: Callable[..., ProblemArrays],
) -> None:
    data = make_certified(limits={"max_climb_deg": 5, "max_dive_deg": 7})
    climbs, dives = leg_slope_limits(data, CORNER)
    assert climbs.tolist() == pytest.approx([math.radians(5.0) - ANGLE_MARGIN_RAD] * 2)
    assert dives.tolist() == pytest.approx([math.radians(7.0) - ANGLE_MARGIN_RAD] * 2)


def test_heights_stand_above_the_ground_for_legs_and_arcs(
    make_certified: Callable[..., ProblemArrays],
) -> None:
    data = make_certified()
    climbing = CORNER + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 50.0], [0.0, 0.0, 100.0]])
    pieces = heights_above_ground(data, climbing)
    legs, arcs = pieces[~pieces["of_arc"]], pieces[pieces["of_arc"]]
    assert legs["number"].tolist() == [0, 1]
    assert legs["height"].tolist() == pytest.approx([130.0, 180.0], abs=1e-3)
    assert set(arcs["number"].tolist()) == {1}
    # About the corner at 200 m, whose arc begins lower.
    assert (np.abs(arcs["height"] - 180.0) < 10.0).all()
    assert arcs["height"].min() < 179.0
    assert (pieces["buffer"] == data.buffer).all()


def test_off_the_terrain_there_is_no_height(make_certified: Callable[..., ProblemArrays]) -> None:
    away = np.array([[0.0, 0.0, 150.0], [99_000.0, 0.0, 150.0]])
    assert np.isnan(heights_above_ground(make_certified(), away)["height"]).all()


def test_the_buffer_grows_from_an_end_that_leaves_none(make_certified: Callable[..., ProblemArrays]) -> None:
    data = make_certified()._replace(buffer=5.0, start_buffer=1.0)
    for away, wanted in ((0.0, 1.0), (40.0, 1.0 + 0.5 * BUFFER_GROWTH_RATIO * 40.0), (1000.0, 5.0)):
        leg = np.array([[away, 0.0, 150.0], [3000.0, 0.0, 150.0]])
        assert heights_above_ground(data, leg)["buffer"][0] == pytest.approx(wanted), away
    far = data._replace(start_buffer=5.0, destination_buffer=2.0)
    leg = np.array([[3000.0, 0.0, 150.0], [5980.0, 0.0, 150.0]])
    assert heights_above_ground(far, leg)["buffer"][0] == pytest.approx(2.0 + 0.5 * BUFFER_GROWTH_RATIO * 20.0)
