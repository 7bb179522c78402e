"""Search for the path with the minimum time or energy, if a scenario requires it instead of the shortest path.

The search for the shortest path comes first, with its certificate. From that path, from the straight line and from
routes on other sides of the obstacles, all waypoints then move at once so that the path costs less under the same
constraints (`planner.seeding.shortening` with `planner.evaluation.travel_cost`): to altitudes and courses with a more
favourable wind. A result replaces the shortest path if its certificate is as good and it costs less, so that a plan
never costs more than the shortest path.
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
STAGES = 50
# Size of the area of highest ground, as a fraction of a step.
SPREAD = 0.2
# Spacing across, as a fraction of a step.
RATIO = 1.0 / 3.0
# Reductions of the spheres, one for each grid.
SHRINKS = (0.2, 0.5)
# Maximum number of routes per grid.
MAX_ROUTES = 8
# Maximum length of a route relative to the shortest path.
SLACK = 1.2
# Maximum repetitions from equidistant waypoints.
MAX_REPEATS = 4
# Minimum gain for another repetition, as a fraction of the cost.
MIN_GAIN = 2e-5
# Additional margins with which a path is tried until it is certified: to spheres and ground, m, and of slopes, rad. The
# steepest climb of a leg is at its strongest wind, which changes with the leg's altitudes.
EXTRA_MARGINS = ((0.1, 0.0), (2.0, math.radians(0.2)), (2.0, math.radians(0.6)))
# Fractions of the step from the shortest path towards a cheaper one that violates the airspace, which shortening
# ignores.
SHARES = (1.0, 0.75, 0.5, 0.25, 0.1)

_CertifiedPath = tuple[Floats, Certificate]


def objective_cost(scenario: Scenario, limits: Limits, problem: Problem) -> TravelCost:
    """Return the cost that a scenario's plan minimises. Raises ScenarioError for energy if the power is unknown."""
    objective = scenario.planner.objective or "length"
    cost = make_travel_cost(objective, limits.envelope, problem.search.aircraft)
    if cost is None:
        allowed = 'the power of this aircraft is unknown; "length" and "time" can be planned for'
        raise ScenarioError.at(scenario.name, "planner.objective", objective, allowed)
    return cost


def search_cheapest(search: Search, shortest: _CertifiedPath, cost: TravelCost) -> _CertifiedPath:
    """Return the cheapest path and its certificate, or the shortest path if no equally safe path costs less."""
    is_by_length = cost.time == 0.0 and cost.energy == 0.0
    if is_by_length or not search.meets_goal(shortest[1]):
        return shortest
    data = search.problem.search._replace(travel=cost)
    cheapest = shortest
    with suppress(SearchEnded):
        for start in _start_paths(search, shortest[0]):
            if search.must_end():
                return cheapest
            cheapest = _choose_cheaper(search, data, start, cheapest)
    for _ in range(MAX_REPEATS):
        previous_cost = _cost_or_inf(data, cheapest[0])
        for start in (resample(cheapest[0], len(cheapest[0])), cheapest[0]):
            if search.must_end():
                return cheapest
            cheapest = _choose_cheaper(search, data, start, cheapest)
        if _cost_or_inf(data, cheapest[0]) > (1.0 - MIN_GAIN) * previous_cost:
            break
    return cheapest


def _cost_or_inf(data: ProblemArrays, path: Floats) -> float:
    """Return the cost of a path (w, 3), m; inf if a leg cannot be held against the wind."""
    return float(path_cost(data.travel, data.aircraft, np.array(path, dtype=np.float64)))


def _start_paths(search: Search, shortest: Floats) -> Iterator[Floats]:
    """Yield start paths (w, 3): the shortest, also with equal legs, the straight line, and other routes.

    Raises SearchEnded if the search is asked to stop.
    """
    count, space, data = len(shortest), search.problem.space, search.problem.search
    yield shortest
    yield resample(shortest, count)
    yield resample(np.stack([space.start, space.destination]), count)
    if is_limited(data.airspace) or search.encoding.name != "rotated":
        return
    frame = rotated_frame(space.start, space.destination)
    span = (float(search.encoding.lower[1::3].min()), float(search.encoding.upper[1::3].max()))
    bound = SLACK * float(path_length(shortest))
    for shrink in SHRINKS:
        grid = optimistic_grid(data, frame, span, STAGES, shrink=shrink, spread=SPREAD, ratio=RATIO)
        for route in side_routes(data, frame, grid, bound, MAX_ROUTES, search.pause):
            yield resample(frame.restore(route.points), count)


def _choose_cheaper(search: Search, data: ProblemArrays, start: Floats, best: _CertifiedPath) -> _CertifiedPath:
    """Return the cheaper of the best path and the result of shortening a start (w, 3)."""
    path = start
    for extra_margin, slope_margin in EXTRA_MARGINS:
        stricter = data._replace(angle_margin=data.angle_margin + slope_margin)
        try:
            path, evaluations = shorten_path(stricter, path, extra_margin=extra_margin, pause=search.pause)
        except SearchEnded:
            return best
        search.evaluations += evaluations
        best_cost = _cost_or_inf(data, best[0])
        if not _cost_or_inf(data, path) < best_cost:
            return best
        for fraction in SHARES if is_limited(data.airspace) else SHARES[:1]:
            candidate = np.ascontiguousarray(best[0] + fraction * (path - best[0]))
            certificate = certify(search.problem, candidate)
            if search.meets_goal(certificate) and _cost_or_inf(data, candidate) < best_cost:
                if search.improved is not None:
                    search.improved(candidate)
                return candidate, certificate
    return best
