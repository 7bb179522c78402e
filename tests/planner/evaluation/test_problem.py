"""The share of climb and descent that turbulence leaves to a plan."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.problem import (
    ANGLE_MARGIN,
    CERTIFIED_BUFFER,
    SEARCH_BUFFER,
    TURBULENCE_SHARE,
    make_problem,
)
from planner.plan import Violation
from tests.planner.evaluation.violations import violations_of
from world.scenario import Scenario

Make = Callable[[Scenario], Limits]
Small = Callable[..., Scenario]


@pytest.mark.parametrize(("turbulence", "count"), [("none", 0), ("light", 0), ("moderate", 1)])
def test_turbulence_leaves_a_share_of_climb_and_descent(
    make_limits: Make, small: Small, turbulence: str, count: int
) -> None:
    scenario = small(wind={"speed_mps": 0, "from_deg": 0, "turbulence": turbulence})
    limits = make_limits(scenario)
    data = make_problem(scenario, limits).search
    assert TURBULENCE_SHARE == {"none": 1.0, "light": 0.9, "moderate": 0.8}
    for way in (0, 1):
        # 0.87 of the aircraft's own angle, and half a degree in reserve: within 0.9 of it, and not within 0.8.
        steepest = limits.slopes(0.0, 200.0)[way]
        rise = math.tan(0.87 * steepest - ANGLE_MARGIN) * (1.0 if way == 0 else -1.0)
        path = np.array([[0.0, -2500.0, 200.0], [300.0, -2500.0, 200.0 + 300.0 * rise]])
        assert violations_of(data, path, Violation.SLOPE)[0] == count
        # Just within the share, and just beyond it.
        for beyond, more in ((-1e-4, 0), (1e-4, 1)):
            angle = TURBULENCE_SHARE[turbulence] * steepest - ANGLE_MARGIN + beyond
            path = np.array([[0.0, -2500.0, 200.0], [1.0, -2500.0, 200.0 + math.copysign(math.tan(angle), rise)]])
            assert violations_of(data, path, Violation.SLOPE)[0] == more


@pytest.mark.parametrize(("most", "kept"), [(200.0, SEARCH_BUFFER), (60.0 + 2.0 * CERTIFIED_BUFFER + 8.0, 7.0)])
def test_a_search_leaves_half_of_a_narrow_band_to_the_path(
    make_limits: Make, small: Small, most: float, kept: float
) -> None:
    """Between the certificate's 5 m on either side are 8 m: a search keeps 2 m more on either."""
    flat = {"kind": "flat", "amsl_m": 0}
    ends = {
        name: {"east_m": east, "north_m": 0, "height_m": 69} for name, east in (("start", 0), ("destination", 6000))
    }
    scenario = small(terrain=flat, threats=[], limits={"min_clearance_m": 60, "max_height_m": most}, **ends)
    problem = make_problem(scenario, make_limits(scenario))
    assert problem.certified.airspace.buffer == problem.certified.buffer == CERTIFIED_BUFFER
    assert (problem.search.buffer, problem.search.airspace.buffer) == pytest.approx((kept, kept))
