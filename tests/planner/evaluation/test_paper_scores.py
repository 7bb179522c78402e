"""The criteria against a plain NumPy copy of the paper's equations, and the graded judge against exact geometry."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aircraft.path_limits import Limits
from planner.evaluation.encoding import rotated
from planner.evaluation.fly_by_corners import corner, corner_radii
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import Problem, make_problem
from planner.plan import Objective, Violation
from world.scenario import Scenario


@pytest.fixture(scope="module")
def problem(scenario: Scenario, limits: Limits) -> Problem:
    return make_problem(scenario, limits)


@pytest.fixture(scope="module")
def numbers(make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]) -> Problem:
    """The small scenario with numbers for all limits, and no reserve: its clearance is the ground."""
    flat = small(limits={"max_turn_deg": 45, "max_climb_deg": 20, "max_dive_deg": 25, "min_clearance_m": 0})
    problem = make_problem(flat, make_limits(flat))
    rules = problem.search._replace(reserve=0.0, bounds=flat.bounds, floor=flat.floor, ceiling=flat.ceiling)
    return Problem(problem.scenario, problem.limits, rules, rules, problem.space)


def by_the_book(problem: Problem, path: np.ndarray) -> tuple[list[int], list[float]]:
    """Equations 1-11, written from the paper with arrays; the destination is added to eq. 5, 9 and 10."""
    scenario, terrain, threats = problem.scenario, problem.scenario.terrain, problem.scenario.threats
    assert terrain is not None
    legs = np.diff(path, axis=0)
    flat = legs[:, :2]
    cosine = (flat[:-1] * flat[1:]).sum(1) / (np.linalg.norm(flat[:-1], axis=1) * np.linalg.norm(flat[1:], axis=1))
    turns = int((np.arccos(np.clip(cosine, -1, 1)) > math.radians(44.5)).sum())
    slope = legs[:, 2] / np.linalg.norm(flat, axis=1)
    slopes = int(((slope > math.tan(math.radians(19.5))) | (slope < -math.tan(math.radians(24.5)))).sum())
    shares = np.arange(6)[:, None] / 6.0
    points = np.concatenate([path[i] + shares * legs[i] for i in range(len(legs))])
    checked = np.concatenate([points, path[-1:]])
    ground = terrain.height(checked[:, 0], checked[:, 1])
    outside = (path[:, :2] < scenario.bounds[:, 0]) | (path[:, :2] > scenario.bounds[:, 1])
    outside = outside.any(1) | (path[:, 2] < scenario.floor) | (path[:, 2] > scenario.ceiling)
    sums = []
    for radius, scale in (
        (threats.kill_radius, threats.kill_scale),
        (threats.detection_radius, threats.detection_scale),
    ):
        distance = np.linalg.norm(checked[:, None] - threats.position[None], axis=2)
        sums.append(float(np.where(distance <= radius, (scale / distance) ** 4, 0.0).sum()))
    ratio = np.linalg.norm(legs, axis=1).sum() / np.linalg.norm(path[-1] - path[0])
    above = points[:, 2] - ground[:-1]
    counts = [turns, slopes, int((checked[:, 2] <= ground).sum()), int(outside.sum())]
    return counts, [float(ratio), *sums, float(np.where(above > 0, above, 0.0).sum() / 6)]


@settings(max_examples=60)
@given(st.integers(0, 10_000), st.sampled_from([4, 8, 12]))
def test_paper_criteria(numbers: Problem, seed: int, waypoints: int) -> None:
    rng = np.random.default_rng(seed)
    encoding = rotated(numbers.space, waypoints)
    path = encoding.decode(rng.uniform(encoding.lower, encoding.upper, (1, encoding.lower.size)))
    path[:, 1:-1] += rng.normal(0, 300, path[:, 1:-1].shape)
    counts, objectives = paper_scores(numbers.search, path)
    expected_counts, expected = by_the_book(numbers, path[0])
    assert counts[0].tolist() == expected_counts
    np.testing.assert_allclose(objectives[0], expected, rtol=1e-9)


def test_a_path_beside_everything_has_no_violation(problem: Problem) -> None:
    path = np.array([[0, 0, 150], [2000, -1500, 200], [4200, -1500, 200], [6000, 0, 150]], dtype=np.float64)
    counts, objectives = paper_scores(problem.search, path[None])
    graded, smooth = graded_scores(problem.search, path[None])
    assert not counts.any()
    assert not graded.any()
    assert objectives[0, Objective.KILL_EXPOSURE] == 0.0
    assert smooth[0, Objective.KILL_EXPOSURE] == 0.0
    assert smooth[0, Objective.LENGTH_RATIO] == objectives[0, Objective.LENGTH_RATIO]


def test_a_sphere_cut_between_points_is_seen_only_by_the_graded_judge(problem: Problem) -> None:
    """Leg points stand 1 km apart; the leg dips 30 m into the sphere between two of them."""
    path = np.array([[0, 0, 150], [0, -870, 150], [6000, -870, 150], [6000, 0, 150]], dtype=np.float64)
    _, paper = paper_scores(problem.search, path[None])
    _, graded = graded_scores(problem.search, path[None])
    distance = math.hypot(670, 150 - problem.search.threats[0, 2])
    assert 600 < distance < 700
    inside = [e for e in range(0, 6001, 1000) if math.dist((e, -870, 150), problem.search.threats[0, :3]) <= 700]
    assert (paper[0, Objective.KILL_EXPOSURE] > 0) == bool(inside)
    assert graded[0, Objective.KILL_EXPOSURE] > 0


def test_short_leg_between_turns_counts_as_a_turn_with_aircraft_limits(problem: Problem) -> None:
    """Two 60 degree turns at R = 25^2 / (g tan 30) = 110 m use 64 m each; 5 % and 20 m are kept on top."""
    for length, count in ((150.0, 1), (170.0, 0)):
        step = length * np.array([math.sin(math.radians(30)), math.cos(math.radians(30))])
        path = np.array(
            [[0, -1500, 200], [2000, -1500, 200], [2000 + step[0], -1500 - step[1], 200], [5000, -1500 - step[1], 200]]
        )
        counts, _ = paper_scores(problem.search, path[None])
        assert counts[0, Violation.TURN] == count
        easy = problem.search._replace(room=False, max_turn=math.radians(60.5))
        assert paper_scores(easy, path[None])[0][0, Violation.TURN] == 0


def test_first_and_last_turn_count_from_the_given_courses(
    scenario: Scenario, make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]
) -> None:
    turned = small(
        start={"east_m": 0, "north_m": 0, "amsl_m": 150, "course_deg": 270},
        destination={"east_m": 6000, "north_m": 0, "amsl_m": 150, "course_deg": 80},
        limits={"max_turn_deg": 90},
    )
    rules = make_problem(turned, make_limits(turned)).search
    path = np.array([[0, 0, 150], [3000, -1500, 200], [6000, 0, 150]], dtype=np.float64)
    counts, _ = paper_scores(rules, path[None])
    assert counts[0, Violation.TURN] == 1
    assert paper_scores(rules._replace(start_course=math.radians(100)), path[None])[0][0, Violation.TURN] == 0
    assert paper_scores(rules._replace(destination_course=math.radians(260)), path[None])[0][0, Violation.TURN] == 2


@settings(max_examples=60)
@given(st.floats(5, 140), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.booleans())
def test_corner_arc(problem: Problem, degrees: float, slope_in: float, slope_out: float, left: bool) -> None:
    """Tangent to both legs, on one circle, R(1/cos(theta/2) - 1) inside the corner, never above the path's crest."""
    turn = math.radians(degrees) * (1 if left else -1)
    before, at = np.array([-900.0, 0.0, 300.0 - 900.0 * slope_in]), np.array([0.0, 0.0, 300.0])
    after = np.array([900.0 * math.cos(turn), 900.0 * math.sin(turn), 300.0 + 900.0 * slope_out])
    radius = 110.0
    vertices = corner(problem.search, before, at, after, radius)
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
    loose = problem.search._replace(room=False)
    assert not corner_radii(loose, path).any()
    path[2, 1], path[2, 0], path[3, 0] = 800.0, 1500.0, 2000.0
    radius = 25.0**2 / (9.80665 * math.tan(math.radians(30)))
    np.testing.assert_allclose(corner_radii(loose, path)[1:-1], radius, rtol=1e-6)


def test_reserve_grows_from_a_low_start(
    make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]
) -> None:
    low = small(start={"east_m": 0, "north_m": 0, "height_m": 31})
    rules = make_problem(low, make_limits(low)).search
    assert 0.9 < rules.start_slack < 1.0
    path = np.array([[0, 0, low.start[2]], [1500, -1500, 200], [4200, -1500, 200], [6000, 0, 150]])
    assert not graded_scores(rules, path[None])[0][0, Violation.TERRAIN]
    path[1, 2] = 30.0
    assert graded_scores(rules, path[None])[0][0, Violation.TERRAIN] > 0
