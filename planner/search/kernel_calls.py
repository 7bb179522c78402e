"""Call the planner's kernels on small problems, to compile them ahead of use.

The argument types are those of a search.
"""

import numpy as np

from aircraft.path_limits import Limits
from planner.evaluation.certify import certify
from planner.evaluation.encoding import ENCODINGS, rotated_frame, rotated_vectors
from planner.evaluation.front_scores import front_values
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import make_problem
from planner.evaluation.travel_cost import make_energy_cost
from planner.optimisers.hypervolume import covering_order
from planner.search.search_state import best_first, score_table
from planner.seeding.grids import GridRoute, grid_route, make_grid
from planner.seeding.pattern_search import search_patterns
from planner.seeding.shortening import resample, shorten_path
from planner.seeding.side_routes import optimistic_grid, side_routes
from planner.seeding.waypoint_fitting import fit_waypoints
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


def call_kernels(part: str, scenario: Scenario, limits: Limits) -> None:
    """Call the kernels of one part of planning once, so that they get compiled.

    part: a name in `PARTS`, or `FRONT`; KeyError is raised for any other.
    scenario, limits: any small problem; the results are discarded.

    >>> from planfly.workflow.uav import load_uav
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("hard-07")
    >>> call_kernels("paper", scenario, load_uav(scenario).limits)
    """
    problem = make_problem(scenario, limits)
    space, data = problem.space, problem.search
    middle = 0.5 * (space.start + space.destination) + [0.0, LATERAL_OFFSET_M, VERTICAL_OFFSET_M]
    path = resample(np.array([space.start, middle, space.destination]), WAYPOINTS)
    encoding = ENCODINGS["rotated"](space, WAYPOINTS)
    # The frame of the direct line, and the smallest and largest offset of waypoints across it, m.
    frame = rotated_frame(space.start, space.destination)
    span = float(encoding.lower[1::3].min()), float(encoding.upper[1::3].max())
    match part:
        case "scores":
            best_first(score_table(*graded_scores(data, np.stack([path, path]))))
            search_patterns(data, encoding, rotated_vectors(space, encoding, path[None])[0], SAMPLE_COUNT)
        case "certificates":
            certify(problem, path)
        case "shortening":
            shorten_path(data, path)
        case "routes":
            best_route = grid_route(data, frame, make_grid(data, frame, span, STAGES))
            for route in [best_route] if isinstance(best_route, GridRoute) else []:
                fit_waypoints(data, frame, route.points, WAYPOINTS)
        case "sides":
            grid = optimistic_grid(data, frame, span, STAGES, shrink=0.5, spread=0.2, ratio=0.5)
            side_routes(data, frame, grid, 2.0 * frame.length, MAX_ROUTES)
        case "paper":
            paper_scores(problem.certified, path[None])
        case "fronts":
            cost = make_energy_cost(limits.envelope, data.aircraft, data.travel.winds)
            front_values(data, cost, path[None])
            covering_order(np.eye(SAMPLE_COUNT), np.full(SAMPLE_COUNT, 2.0), SAMPLE_COUNT)
        case _:
            raise KeyError(part)
