"""Search for the path with the minimum time or energy.

It is used if a scenario requires this path instead of the shortest path.

The search for the shortest path comes first, with its certificate. From that path, from the straight line and from
routes on other sides of the obstacles, all waypoints then move at once so that the path costs less under the same
constraints: to altitudes and courses with a more favourable wind (`planner.seeding.shortening` with
    `planner.evaluation.travel_cost`). A result replaces the shortest path if its certificate is as good and it costs
    less, so that a plan never costs more than the shortest path.
"""

import math
from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from aircraft.path_limits import Limits
from planner.airspace.zone_limits import is_limited
from planner.evaluation.certify import certify
from planner.evaluation.encoding import rotated_frame
from planner.evaluation.problem import Problem, ProblemArrays
from planner.evaluation.travel_cost import TravelCost, make_travel_cost, path_cost
from planner.plan import Certificate
from planner.search.search_state import Search, SearchEnded
from planner.seeding.shortening import resample, shorten_path
from planner.seeding.side_routes import optimistic_grid, side_routes
from world.arrays import Floats
from world.errors import ScenarioError
from world.geometry import path_length
from world.scenario import Scenario

# Grids for routes on other sides. Number of stages.
GRID_STAGE_COUNT = 50
# Size of the area of highest ground, as a fraction of a step.
GROUND_SPREAD_STEPS = 0.2
# Spacing across, as a fraction of a step.
GRID_SPACING_RATIO = 1.0 / 3.0
# Reductions of the spheres, one for each grid.
SPHERE_REDUCTION_FACTORS = (0.2, 0.5)
# Maximum number of routes per grid.
MAX_ROUTES = 8
# Maximum length of a route relative to the shortest path.
MAX_LENGTH_RATIO = 1.2
# Maximum repetitions from equidistant waypoints.
MAX_REPEATS = 4
# Minimum gain for another repetition, as a fraction of the cost.
MIN_GAIN_FRACTION = 2e-5
# Additional margins that are tried in turn until a path is certified: to spheres and ground, m, and of slopes, rad. The
# steepest climb of a leg is at its strongest wind, which changes with the leg's altitudes.
EXTRA_MARGINS = ((0.1, 0.0), (2.0, math.radians(0.2)), (2.0, math.radians(0.6)))
# Fractions of the step from the best path to a cheaper path, which may violate the airspace, because shortening ignores
# the airspace.
STEP_FRACTIONS = (1.0, 0.75, 0.5, 0.25, 0.1)

_CertifiedPath = tuple[Floats, Certificate]


def make_objective_cost(scenario: Scenario, limits: Limits, problem: Problem) -> TravelCost:
    """Make the cost that a plan of the scenario minimises.

    Raises ScenarioError for energy if the power is unknown.
    """
    objective = scenario.planner.objective or "length"
    travel_cost = make_travel_cost(objective, limits.envelope, problem.search.aircraft, problem.search.travel.winds)
    if travel_cost is None:
        allowed = 'the power of this aircraft is unknown; "length" and "time" can be planned for'
        raise ScenarioError.at(scenario.name, "planner.objective", objective, allowed)
    return travel_cost


def search_cheapest_path(search: Search, shortest_path: _CertifiedPath, weights: TravelCost) -> _CertifiedPath:
    """Find the path with the lowest time or energy; return it and its certificate.

    shortest_path: the shortest path and its certificate.
    weights: weights of length, time and energy in the cost.

    The shortest path itself is returned if the length is to be minimised, if it does not meet the goal of the search,
    or if no path that meets this goal is cheaper.
    """
    minimises_length = weights.time == 0.0 and weights.energy == 0.0
    if minimises_length or not search.meets_goal(shortest_path[1]):
        return shortest_path
    evaluation_data = search.problem.search._replace(travel=weights)
    cheapest_path = shortest_path
    with suppress(SearchEnded):
        for start in _start_paths(search, shortest_path[0]):
            if search.must_end():
                return cheapest_path
            cheapest_path = _choose_cheaper(search, evaluation_data, start, cheapest_path)
    for _ in range(MAX_REPEATS):
        previous_cost = _cost_or_inf(evaluation_data, cheapest_path[0])
        for start in (resample(cheapest_path[0], len(cheapest_path[0])), cheapest_path[0]):
            if search.must_end():
                return cheapest_path
            cheapest_path = _choose_cheaper(search, evaluation_data, start, cheapest_path)
        if _cost_or_inf(evaluation_data, cheapest_path[0]) > (1.0 - MIN_GAIN_FRACTION) * previous_cost:
            break
    return cheapest_path


def _cost_or_inf(evaluation_data: ProblemArrays, path: Floats) -> float:
    """Return the cost of a path (w, 3), m; inf if a leg is not flyable against the wind."""
    return float(path_cost(evaluation_data.travel, evaluation_data.aircraft, np.array(path, dtype=np.float64)))


def _start_paths(search: Search, shortest_path: Floats) -> Iterator[Floats]:
    """Yield paths (w, 3) from which the search for a cheaper path starts.

    They are the shortest path, the shortest path with equal legs, and the straight line. With the encoding "rotated",
    and without zones and a maximum height, routes on other sides of the obstacles follow.

    Raises SearchEnded if the search must stop.
    """
    count, space, evaluation_data = len(shortest_path), search.problem.space, search.problem.search
    yield shortest_path
    yield resample(shortest_path, count)
    yield resample(np.stack([space.start, space.destination]), count)
    if is_limited(evaluation_data.airspace) or search.encoding.name != "rotated":
        return
    frame = rotated_frame(space.start, space.destination)
    span = (float(search.encoding.lower[1::3].min()), float(search.encoding.upper[1::3].max()))
    bound = MAX_LENGTH_RATIO * float(path_length(shortest_path))
    for shrink in SPHERE_REDUCTION_FACTORS:
        grid = optimistic_grid(
            evaluation_data,
            frame,
            span,
            GRID_STAGE_COUNT,
            shrink=shrink,
            spread=GROUND_SPREAD_STEPS,
            ratio=GRID_SPACING_RATIO,
        )
        for route in side_routes(evaluation_data, frame, grid, bound, MAX_ROUTES, search.check_stop):
            yield resample(frame.to_world(route.points), count)


def _choose_cheaper(
    search: Search, evaluation_data: ProblemArrays, start: Floats, best_path: _CertifiedPath
) -> _CertifiedPath:
    """Reduce the cost of a start path; return the result if it is better than the best path so far.

    It has to be certified and cheaper. Otherwise the best path so far is returned.

    Larger margins are tried until a path of lower cost is certified. For each margin, paths between the best path and
    this path are also tried if the airspace has zones or a maximum height.

    evaluation_data: the planning problem with the cost to minimise.
    start: (w, 3) path to begin with, m.
    best_path: the best certified path so far, and its certificate.
    """
    path = start
    for extra_margin, slope_margin in EXTRA_MARGINS:
        stricter_data = evaluation_data._replace(angle_margin=evaluation_data.angle_margin + slope_margin)
        try:
            path, evaluations = shorten_path(
                stricter_data, path, extra_margin=extra_margin, check_stop=search.check_stop
            )
        except SearchEnded:
            return best_path
        search.evaluations += evaluations
        best_cost = _cost_or_inf(evaluation_data, best_path[0])
        if not _cost_or_inf(evaluation_data, path) < best_cost:
            return best_path
        for fraction in STEP_FRACTIONS if is_limited(evaluation_data.airspace) else STEP_FRACTIONS[:1]:
            candidate = np.ascontiguousarray(best_path[0] + fraction * (path - best_path[0]))
            certificate = certify(search.problem, candidate)
            if search.meets_goal(certificate) and _cost_or_inf(evaluation_data, candidate) < best_cost:
                if search.improved is not None:
                    search.improved(candidate)
                return candidate, certificate
    return best_path
