"""The run that a fly-over turn takes, against flying it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aircraft.path_limits import fly_over_run
from planner.evaluation.corners import fly_by_radii, fly_by_vertices
from planner.evaluation.problem import Problem


def overshoot(turn: float) -> float:
    """Run after a fly-over turn, in radii, by flying it: past the course and back until the track is on the leg."""

    def beside(extra: float) -> tuple[float, float]:
        """Along and beside the leg, after the turn and `extra` past it, and back by as much."""
        course, along, aside, steps = -turn, 0.0, 0.0, 4000
        for side, angle in ((1.0, turn + extra), (-1.0, extra)):
            for _ in range(steps):
                middle = course + side * angle / (2 * steps)
                along += math.cos(middle) * angle / steps
                aside += math.sin(middle) * angle / steps
                course += side * angle / steps
        return along, aside

    low, high = 0.0, math.pi / 2
    for _ in range(50):
        extra = 0.5 * (low + high)
        low, high = (extra, high) if beside(extra)[1] < 0.0 else (low, extra)
    return beside(low)[0]


@pytest.mark.parametrize("degrees", [10.0, 45.0, 90.0, 105.0])
def test_run_after_a_fly_over(degrees: float) -> None:
    assert fly_over_run(math.radians(degrees)) == pytest.approx(overshoot(math.radians(degrees)), rel=1e-5)


def test_run_after_a_fly_over_never_falls_with_the_angle() -> None:
    runs = [fly_over_run(angle) for angle in np.linspace(0.0, math.pi, 200)]
    assert np.diff(runs).min() >= 0.0
    assert runs[-1] == pytest.approx(2.0 * math.sqrt(2.0))


# ----------------------------------------------------------------------
# Corners as flown: tangent arcs on one circle, and none where they cannot be flown.


@settings(max_examples=60)
@given(st.floats(5, 140), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.booleans())
def test_corner_arc(problem: Problem, degrees: float, slope_in: float, slope_out: float, left: bool) -> None:
    """Tangent to both legs, on one circle, R(1/cos(theta/2) - 1) inside the corner, never above the path's crest."""
    turn = math.radians(degrees) * (1 if left else -1)
    before, at = np.array([-900.0, 0.0, 300.0 - 900.0 * slope_in]), np.array([0.0, 0.0, 300.0])
    after = np.array([900.0 * math.cos(turn), 900.0 * math.sin(turn), 300.0 + 900.0 * slope_out])
    radius = 110.0
    vertices = fly_by_vertices(problem.search.aircraft, before, at, after, radius)
    arc = vertices[1:-1]
    tangent = radius * math.tan(abs(turn) / 2)
    np.testing.assert_allclose(arc[0, :2], [-tangent, 0.0], atol=1e-9)
    np.testing.assert_allclose(arc[-1, :2], tangent * np.array([math.cos(turn), math.sin(turn)]), atol=1e-9)
    centre = np.array([-tangent, radius * (1 if left else -1)])
    np.testing.assert_allclose(np.hypot(*(arc[:, :2] - centre).T), radius, atol=1e-9)
    assert np.hypot(*centre) - radius == pytest.approx(radius * (1 / math.cos(turn / 2) - 1))
    # Entry and exit lie on the legs.
    for point, end in ((vertices[0], before), (vertices[-1], after)):
        np.testing.assert_allclose(np.cross(point - at, end - at), 0.0, atol=1e-4)
    if slope_in > 0.0 > slope_out:
        assert arc[:, 2].max() <= 300.0 + 1e-9


def test_no_arcs_where_a_number_alone_limits_turns_and_a_leg_is_short(problem: Problem) -> None:
    path = np.array([[0, 0, 200], [1000, 0, 200], [1050, 120, 200], [1100, 0, 200], [3000, 0, 200]], dtype=np.float64)
    loose = problem.search._replace(legs_hold_turns=False)
    assert not fly_by_radii(loose, path).any()
    path[2, 1], path[2, 0], path[3, 0] = 800.0, 1500.0, 2000.0
    radius = 25.0**2 / (9.80665 * math.tan(math.radians(30)))
    np.testing.assert_allclose(fly_by_radii(loose, path)[1:-1], radius, rtol=1e-6)
