"""The paper's scores against a plain NumPy copy of its equations."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aircraft.path_limits import Limits
from planner.evaluation.encoding import rotated_encoding
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import Problem, make_problem
from world.scenario import Scenario


@pytest.fixture(scope="module")
def numbers(make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]) -> Problem:
    """The small scenario with numbers for all limits, and no reserve: its clearance is the ground."""
    flat = small(limits={"max_turn_deg": 45, "max_climb_deg": 20, "max_dive_deg": 25, "min_clearance_m": 0})
    problem = make_problem(flat, make_limits(flat))
    (west, east), (south, north) = flat.bounds.tolist()
    edges = {"west": west, "east": east, "south": south, "north": north}
    data = problem.search._replace(buffer=0.0, floor=flat.floor, ceiling=flat.ceiling, **edges)
    return Problem(problem.scenario, problem.limits, data, data, problem.space)


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
    encoding = rotated_encoding(numbers.space, waypoints)
    path = encoding.decode(rng.uniform(encoding.lower, encoding.upper, (1, encoding.lower.size)))
    path[:, 1:-1] += rng.normal(0, 300, path[:, 1:-1].shape)
    counts, objectives = paper_scores(numbers.search, path)
    expected_counts, expected = by_the_book(numbers, path[0])
    assert counts[0].tolist() == expected_counts
    np.testing.assert_allclose(objectives[0], expected, rtol=1e-9)
