"""The pieces that a certificate looks at cover the path, and say how far from them a flight may be."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from aircraft.path_limits import Limits
from planner.evaluation.certify_kernels import heights_above_ground, missile_distance
from planner.evaluation.problem import make_problem
from planner.evaluation.problem_arrays import ProblemArrays
from planner.evaluation.strayed_pieces import strayed_pieces
from tests.planner.straying import straying
from world.scenario import Scenario

Floats = NDArray[np.float64]
Make = Callable[[Scenario], Limits]
FLAT = {"kind": "flat", "amsl_m": 20}
# East for 2 km, then north for 1.5 km: a right angle.
CORNER = np.array([[0.0, 0.0, 150.0], [2000.0, 0.0, 150.0], [2000.0, 1500.0, 150.0]])
CLIMB = CORNER + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 100.0], [0.0, 0.0, 100.0]])


@pytest.fixture
def make(small: Callable[..., Scenario], make_limits: Make) -> Callable[..., ProblemArrays]:
    def made(numbers: dict[str, float], **tables: Any) -> ProblemArrays:
        scenario = small(**({"terrain": FLAT, "threats": []} | tables))
        return make_problem(scenario, straying(make_limits(scenario), **numbers)).certified

    return made


def test_pieces_follow_each_leg_and_both_sides_of_a_corner(make: Callable[..., ProblemArrays]) -> None:
    ends = {"east_m": 2000, "north_m": 1500, "amsl_m": 150}
    pieces = strayed_pieces(make({"across": 4.0, "lag": 3.0, "before": 150.0}, destination=ends), CORNER)
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
    assert about["beside"] == pytest.approx([24.0, 24.0])
    assert along["beside_begin"][0] == 0.0
    assert along["beside_begin"][1:-1] == pytest.approx(4.0, abs=4.0)
    assert along["beside_end"][-1] == 0.0


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
