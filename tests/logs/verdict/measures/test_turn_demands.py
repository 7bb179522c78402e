"""A leg between a left and a right turn holds the roll from one bank into the other, for planner and verdict alike."""

import math

import numpy as np
import pytest

from aircraft.path_limits import ROLL_TIME
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_demands import route_demands
from logs.verdict.measures.turn_demands import available_lengths, turn_lengths
from planner.evaluation.certify_kernels import turn_and_roll_lengths
from planner.evaluation.problem import make_problem
from tests.logs.verdict.judging import of, waypoint
from tests.synthetic import (
    bank_radius,
    make_scenario,
    make_setup,
)


def zigzag(turn_deg: float, run: float, *, same_way: bool, course_deg: float = 20.0) -> np.ndarray:
    """Two turns of this angle with a leg of this length between them."""
    turn = math.radians(turn_deg)
    courses = math.radians(course_deg) + np.array([0.0, turn, 2.0 * turn if same_way else 0.0])
    steps = np.array([1500.0, run, 1500.0])[:, None] * np.stack([np.sin(courses), np.cos(courses), 0.0 * courses], 1)
    return np.array([0.0, 0.0, 500.0]) + np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


def test_calm_the_roll_takes_the_bank_limit_over_the_rate() -> None:
    s_turn, same = (route_demands(make_setup(zigzag(60.0, 300.0, same_way=way))) for way in (False, True))
    # 30 degrees into 30 degrees, less the 30 that any turn rolls in.
    assert s_turn.reversal[1] == pytest.approx(25.0 * ROLL_TIME * math.radians(30.0), rel=1e-6)
    assert same.reversal.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("turn", [30.0, 60.0, 90.0, 120.0])
@pytest.mark.parametrize("wind", [0.0, 10.0])
@pytest.mark.parametrize("same_way", [True, False])
def test_planner_and_check_need_the_same(turn: float, wind: float, same_way: bool) -> None:
    for from_deg in (20.0, 110.0, 245.0):
        points = zigzag(turn, 900.0, same_way=same_way)
        scenario = make_scenario(points, wind={"speed_mps": wind, "from_deg": from_deg})
        setup = make_setup(points, scenario=scenario)
        demands = route_demands(setup)
        needs, rolls = turn_and_roll_lengths(make_problem(scenario, setup.limits).certified, points)
        np.testing.assert_allclose(needs, demands.after[:-1] + demands.before[1:], atol=1e-6)
        np.testing.assert_allclose(rolls, demands.reversal, atol=1e-6)
        assert (rolls.max() == 0.0) or not same_way


def test_a_leg_a_little_short_of_the_roll_fails_and_one_longer_passes() -> None:
    arcs = 2.0 * bank_radius() * math.tan(math.radians(30.0))
    roll = 25.0 * ROLL_TIME * math.radians(30.0)
    for spare, ok in ((-1.0, False), (1.0, True)):
        setup = make_setup(zigzag(60.0, arcs + roll + spare, same_way=False))
        assert of(judge_geometry(setup), "turn", waypoint(1)).ok is ok
    assert judge_geometry(make_setup(zigzag(60.0, arcs + 1.0, same_way=True))).flyable


@pytest.mark.parametrize("climb", [200.0, -200.0])
def test_the_roll_is_measured_at_the_lower_end_of_its_leg(climb: float) -> None:
    """Behind the leg the wind grows by 1 m/s each 50 m, from 4 m/s at the start's 500 m: 25 + 4 m/s, or 25 + 0."""
    points = zigzag(60.0, 900.0, same_way=False, course_deg=-60.0)
    points[2:, 2] += climb
    wind = {"speed_mps": 4.0, "from_deg": 180.0, "gradient": 0.02}
    demands = route_demands(make_setup(points, wind=wind))
    lower = 500.0 + min(0.0, climb)
    speed = 25.0 + 4.0 + 0.02 * (lower - 500.0)
    bank = [math.atan(speed**2 / (9.80665 * float(radius))) for radius in demands.radius[1:3]]
    assert demands.reversal[1] == pytest.approx(speed * ROLL_TIME * (sum(bank) - math.radians(30.0)), rel=1e-6)


@pytest.mark.parametrize(
    ("after", "before", "room"),
    [
        # What the neighbours leave of 400 and 300 m, less the rolls' 20 and 10 m.
        (100.0, 60.0, (280.0, 230.0)),
        # Half of a leg is left in any case.
        (250.0, 60.0, (180.0, 230.0)),
        (100.0, 290.0, (280.0, 140.0)),
        (math.inf, math.inf, (180.0, 140.0)),
    ],
)
def test_a_turn_may_use_what_its_neighbours_leave_of_its_legs(
    after: float, before: float, room: tuple[float, float]
) -> None:
    runs, reversal = np.array([400.0, 300.0]), np.array([20.0, 10.0])
    found = available_lengths(runs, np.array([0.0, 7.0, before]), np.array([after, 9.0, 0.0]), reversal, 1)
    assert found == pytest.approx(room)


@pytest.mark.parametrize(("first", "second"), [(90.0, 300.0), (300.0, 90.0)])
def test_the_sharpest_turn_fits_the_shorter_of_its_legs(first: float, second: float) -> None:
    """R tan(turn / 2) of 90 m."""
    demands = route_demands(make_setup([[0, 0, 300], [0, first, 300], [second, first, 300]]))
    assert demands.turn_limit[1] == pytest.approx(2.0 * math.atan(90.0 / bank_radius()))


@pytest.mark.parametrize("run", [60.0, 150.0, 250.0])
def test_the_sharpest_turn_over_a_waypoint_takes_the_leg_after_it(run: float) -> None:
    """As long as the leg, and within a thousandth of it a little sharper does not fit."""
    demands = route_demands(make_setup([[0, 0, 300], [0, 50, 300], [run, 50, 300]], fly_over=(1,)))
    sharpest = float(demands.turn_limit[1])
    assert turn_lengths(sharpest, bank_radius(), fly_over=True)[1] == pytest.approx(run, rel=1e-6)
    assert turn_lengths(1.001 * sharpest, bank_radius(), fly_over=True)[1] > run


def test_any_turn_over_a_waypoint_fits_a_long_leg() -> None:
    demands = route_demands(make_setup([[0, 0, 300], [0, 50, 300], [5000, 50, 300]], fly_over=(1,)))
    assert demands.turn_limit[1] == math.pi


@pytest.mark.parametrize(("speeds", "fastest"), [([20.0, 30.0], 30.0), ([30.0, 20.0], 30.0)])
def test_a_turns_arc_is_that_of_its_faster_leg(speeds: list[float], fastest: float) -> None:
    demands = route_demands(make_setup([[0, 0, 300], [0, 1000, 300], [1000, 1000, 300]], speeds=speeds))
    assert demands.radius[1] == pytest.approx(bank_radius(fastest))
