"""Call the planner's kernels on small problems with the argument types of a search, to compile them ahead of use."""

from typing import NamedTuple

import numpy as np

from aircraft.path_limits import Limits
from planner.evaluation.certify import certify
from planner.evaluation.encoding import ENCODINGS, Encoding, RotatedFrame, rotated_frame, rotated_vectors
from planner.evaluation.front_scores import front_values
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import Problem, make_problem
from planner.evaluation.travel_cost import make_energy_cost
from planner.optimisers.hypervolume import covering_order
from planner.search.search_state import best_first, score_table
from planner.seeding.grids import GridRoute, grid_route, make_grid
from planner.seeding.pattern_search import search_patterns
from planner.seeding.shortening import resample, shorten_path
from planner.seeding.side_routes import optimistic_grid, side_routes
from planner.seeding.waypoint_fitting import fit_waypoints
from world.arrays import Floats
from world.scenario import Scenario

# Parts of a search for one plan.
PARTS = ("scores", "certificates", "shortening", "routes", "sides", "paper")
# Additional part of a Pareto front of plans.
FRONT = "fronts"
# Number of waypoints of the path.
WAYPOINTS = 8
# Number of stages of the grids.
STAGES = 12
# Maximum number of routes.
MAX_ROUTES = 2
# Evaluations of a pattern search, and size of a set of objectives.
SAMPLE_COUNT = 4
# Offset of the path's middle point to the side, m.
LATERAL_OFFSET_M = 300.0
# Offset of the path's middle point upwards, m.
VERTICAL_OFFSET_M = 20.0


class _Task(NamedTuple):
    """Small problem, and a path (w, 3) near its direct line."""

    problem: Problem
    encoding: Encoding
    path: Floats


def call_kernels(part: str, scenario: Scenario, limits: Limits) -> None:
    """Call the kernels of one part of planning once, so that they get compiled.

    part: a name in `PARTS`, or `FRONT`.

    scenario: a small scenario is sufficient, because the result is discarded.

    >>> from planfly.workflow.uav import load_uav
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("hard-07")
    >>> call_kernels("paper", scenario, load_uav(scenario).limits)
    """
    problem = make_problem(scenario, limits)
    space = problem.space
    middle = 0.5 * (space.start + space.destination) + [0.0, LATERAL_OFFSET_M, VERTICAL_OFFSET_M]
    path = resample(np.array([space.start, middle, space.destination]), WAYPOINTS)
    _CALLS[part](_Task(problem, ENCODINGS["rotated"](space, WAYPOINTS), path))


def _call_scores(task: _Task) -> None:
    """Call the kernels that score and rank paths, and the kernels of a pattern search."""
    scores = score_table(*graded_scores(task.problem.search, np.stack([task.path, task.path])))
    best_first(scores)
    vector = rotated_vectors(task.problem.space, task.encoding, task.path[None])[0]
    search_patterns(task.problem.search, task.encoding, vector, SAMPLE_COUNT)


def _call_certify(task: _Task) -> None:
    """Call the kernels that certify a path."""
    certify(task.problem, task.path)


def _call_shortening(task: _Task) -> None:
    """Call the kernels that shorten a path."""
    shorten_path(task.problem.search, task.path)


def _call_routes(task: _Task) -> None:
    """Call the kernels that find the best route over a grid, and fit waypoints to it."""
    data, (frame, span) = task.problem.search, _frame_and_span(task)
    best_route = grid_route(data, frame, make_grid(data, frame, span, STAGES))
    for route in [best_route] if isinstance(best_route, GridRoute) else []:
        fit_waypoints(data, frame, route.points, WAYPOINTS)


def _call_side_routes(task: _Task) -> None:
    """Call the kernels that find routes on the other sides of the obstacles."""
    data, (frame, span) = task.problem.search, _frame_and_span(task)
    grid = optimistic_grid(data, frame, span, STAGES, shrink=0.5, spread=0.2, ratio=0.5)
    side_routes(data, frame, grid, 2.0 * frame.length, MAX_ROUTES)


def _frame_and_span(task: _Task) -> tuple[RotatedFrame, tuple[float, float]]:
    """Return the frame of the direct line, and the smallest and largest offset of waypoints across it, m."""
    space, lower, upper = task.problem.space, task.encoding.lower, task.encoding.upper
    return rotated_frame(space.start, space.destination), (float(lower[1::3].min()), float(upper[1::3].max()))


def _call_paper_scores(task: _Task) -> None:
    """Call the kernels that score a path as the paper does."""
    paper_scores(task.problem.certified, task.path[None])


def _call_front(task: _Task) -> None:
    """Call the kernels that compute the values of paths for a front, and those that select rows by hypervolume."""
    data = task.problem.search
    front_values(
        data, make_energy_cost(task.problem.limits.envelope, data.aircraft, data.travel.winds), task.path[None]
    )
    covering_order(np.eye(SAMPLE_COUNT), np.full(SAMPLE_COUNT, 2.0), SAMPLE_COUNT)


_PART_CALLS = (_call_scores, _call_certify, _call_shortening, _call_routes, _call_side_routes, _call_paper_scores)
_CALLS = {**dict(zip(PARTS, _PART_CALLS, strict=True)), FRONT: _call_front}
