"""Plan a path: run an algorithm on a scenario and return the plan with its certificate.

A seeded search tries the straight line first. Then it fits waypoints to grid routes, shortens the best path, tries
other sides of the obstacles, and runs generations of samples if no path is safe. If the certificate fails, up to two
more attempts use finer grids, larger populations, a larger clearance buffer and a smaller margin to missiles. If the
search finds no safe path along the straight line, or only a long one, a lattice search looks for routes that turn back.
If it is proven that no path exists, the search ends. Among zones, the whole search may be repeated with another number
of waypoints.
"""

import math

import numpy as np

from aircraft.path_limits import Limits
from planner.airspace.zone_limits import is_limited
from planner.evaluation.certify import certify, required_kill_distance
from planner.evaluation.encoding import ENCODINGS
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import make_problem
from planner.plan import GIVEN_WAYPOINTS, Certificate, Objectives, Plan, Violations
from planner.search.algorithms import find_algorithm, limits_for
from planner.search.generations import may_try_again, run_path_generations, run_waypoint_generations
from planner.search.infeasibility_proof import is_closed
from planner.search.search_cheapest import make_objective_cost, search_cheapest_path
from planner.search.search_state import (
    Archive,
    Improved,
    LatticeRoutes,
    Search,
    SearchEnded,
    SearchProgress,
    StopCondition,
    no_scores,
    with_narrow_margins,
)
from planner.search.seeds import (
    MIN_DETOUR_FRACTION,
    halve_longest_legs,
    may_turn_back,
    search_other_sides,
    search_turning_back,
    shorten_best,
    starting_vectors,
    try_straight_line,
)
from world.arrays import Floats
from world.errors import ScenarioError
from world.geometry import path_length
from world.random_streams import PLANNER, stream
from world.scenario import Scenario
from world.scenario_tables import PlannerTable

# Per attempt: (stages, number of routes) of its grids, and the factor on the population.
ATTEMPTS = (
    (((36, 2), (66, 1), (130, 1)), 1),
    (((24, 3), (52, 3), (80, 3), (110, 2)), 2),
    (((44, 3), (96, 3), (160, 2)), 3),
)
# The same among zones, where grids take the longest: the second attempt only moves waypoints, with narrower margins.
# Of 2,000 random scenarios 24 needed this attempt, and one was solved by it.
ATTEMPTS_AMONG_ZONES = (ATTEMPTS[0], ((), 1))
# Maximum evaluations of the final pattern search.
FINAL_SEARCH_EVALUATIONS = 200
# Scales of the final moves of the waypoints of the best path, relative to the moves that fit a seed.
FINAL_MOVE_SCALES = (1.0, 0.5, 0.25, 0.12)
# Rounds of each of these moves.
FINAL_MOVE_ROUNDS = 4
# Maximum wind speed as a fraction of the airspeed.
MAX_WIND_FRACTION = 0.8
# Maximum number of values in a population.
MAX_POPULATION_VALUES = 30_000_000


# Number of waypoints of a plan if the scenario states none.
DEFAULT_WAYPOINTS = PlannerTable.model_fields["waypoints"].default
# Number of waypoints with which a search among zones is repeated, if the scenario states none and no path is safe.
MORE_WAYPOINTS = 24

# A search, its path (w, 3) and the certificate of the path.
_Result = tuple[Search, Floats, Certificate]


def plan_path(
    scenario: Scenario,
    limits: Limits,
    *,
    seed: int,
    algorithm: str | None = None,
    progress: SearchProgress | None = None,
    stop: StopCondition | None = None,
    improved: Improved | None = None,
    first_safe: bool = False,
    previous: Floats | None = None,
) -> Plan:
    """Plan a path through a scenario; the same scenario, limits, algorithm and seed give the same plan.

    algorithm: a name of `planner.search.algorithms.ALGORITHMS`; None for the algorithm of the scenario, or the default.
    progress: called with the number of generations done, the total number, and a short text.
    stop: called every few hundredths of a second; a text that it returns ends the search, and the plan records it.
    improved: called with each path (w, 3), not yet certified, that meets the constraints better than all earlier paths.
    first_safe: True to end the search with the first safe path.
    previous: older path (w, 3) with the same ends and number of waypoints, from which the search starts.

    The certificate of a plan that is not safe states its problems. Raises ScenarioError for options that cannot work.

    >>> from planfly.workflow.uav import load_uav
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("hard-07")
    >>> plan = plan_path(scenario, load_uav(scenario).limits, seed=1)
    >>> plan.safe, plan.waypoints.shape
    (True, (10, 3))
    """
    found_algorithm = find_algorithm(algorithm or scenario.planner.algorithm, scenario.name)
    _check_options(scenario, limits.airspeed)
    problem = make_problem(scenario, limits_for(found_algorithm, limits))
    cost = make_objective_cost(scenario, limits, problem)
    lattice_routes: LatticeRoutes = {}

    def search_with(count: int, evaluations: int) -> _Result:
        """Search with `count` waypoints; if the scenario requires more, halve the longest legs of the path."""
        encoding = ENCODINGS[found_algorithm.encoding](problem.space, count)
        settings = (progress, stop, first_safe, required_kill_distance(problem), improved)
        search = Search(problem, found_algorithm, encoding, stream(seed, PLANNER), *settings, evaluations=evaluations)
        search.lattice_routes = lattice_routes
        path, path_certificate = search_cheapest_path(search, _search_repeatedly(search, previous), cost)
        if count < scenario.planner.waypoints:
            path = halve_longest_legs(path, scenario.planner.waypoints)
            path_certificate = certify(problem, path)
        return search, path, path_certificate

    # A path with more waypoints may turn more often; fewer waypoints are easier to place. If the scenario states a
    # large number, a search with the default number is repeated, and legs of its path are halved to get the stated one.
    other_counts: tuple[int, ...] = ()
    if previous is None and found_algorithm.seeded and found_algorithm.encoding == "rotated":
        if "waypoints" not in scenario.planner.model_fields_set:
            other_counts = (MORE_WAYPOINTS,)
        elif scenario.planner.waypoints > DEFAULT_WAYPOINTS:
            other_counts = (DEFAULT_WAYPOINTS,)
    result = best = search_with(scenario.planner.waypoints, 0)
    for count in other_counts:
        if not result[0].must_end() and _needs_other_count(best, count):
            result = search_with(count, result[0].evaluations)
            best = result if _is_better(result, best) else best
    search, waypoints, certificate = best
    violations, objectives = paper_scores(problem.certified, waypoints[None])
    return Plan(
        scenario,
        waypoints,
        Violations(*violations[0]),
        Objectives(*objectives[0]),
        certificate,
        seed=seed,
        algorithm=found_algorithm.name,
        evaluations=result[0].evaluations,
        history=np.array(search.history).reshape(-1, 3),
        ended=result[0].end_reason,
    )


def _needs_other_count(best: _Result, count: int) -> bool:
    """Return True if a search with another number of waypoints may find a better path.

    The path is compared with the best path so far.

    best: the best result so far.
    count: the other number of waypoints.

    This is only the case among zones, where paths are not shortened. Another number is tried there if no path is safe,
    unless it is proven that there is none. If the shortest path is sought, a smaller number is also tried if the best
    path is longer than the straight line.
    """
    search, waypoints, certificate = best
    if search.is_closed or not is_limited(search.problem.search.airspace):
        return False
    if not search.meets_goal(certificate):
        return True
    if search.first_safe or (search.problem.scenario.planner.objective or "length") != "length":
        return False
    max_length = (1.0 + MIN_DETOUR_FRACTION) * math.dist(waypoints[0], waypoints[-1])
    return count < search.encoding.waypoints and bool(path_length(waypoints) > max_length)


def _is_better(result: _Result, other: _Result) -> bool:
    """Return True if the path of one search is better than the path of another search.

    A path that meets the goal of its search is better than one that does not; of two such paths the shorter one is
    better. If neither meets the goal, a certified path is better; if both or neither are certified, the path further
    from missiles.
    """
    (search, waypoints, certificate), (_, other_waypoints, other_certificate) = result, other
    meets, other_meets = search.meets_goal(certificate), search.meets_goal(other_certificate)
    if meets and other_meets:
        return bool(path_length(waypoints) < path_length(other_waypoints))
    if meets or other_meets:
        return meets
    key, other_key = ((item.ok, item.kill_distance) for item in (certificate, other_certificate))
    return key > other_key


def certify_waypoints(scenario: Scenario, limits: Limits, waypoints: Floats, *, seed: int) -> Plan:
    """Make a plan from given waypoints (w, 3), m, with scores and certificate, without a search.

    The limits are those of the scenario's algorithm.

    >>> from planfly.workflow.uav import load_uav
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("hard-07")
    >>> limits = load_uav(scenario).limits
    >>> plan = plan_path(scenario, limits, seed=1)
    >>> certify_waypoints(scenario, limits, plan.waypoints, seed=1).certificate == plan.certificate
    True
    """
    algorithm = find_algorithm(scenario.planner.algorithm, scenario.name)
    problem = make_problem(scenario, limits_for(algorithm, limits))
    violations, objectives = paper_scores(problem.certified, np.array(waypoints)[None])
    return Plan(
        scenario=scenario,
        waypoints=waypoints,
        violations=Violations(*violations[0]),
        objectives=Objectives(*objectives[0]),
        certificate=certify(problem, waypoints),
        seed=seed,
        algorithm=GIVEN_WAYPOINTS,
        evaluations=0,
        history=np.empty((0, 3)),
    )


def _search_repeatedly(search: Search, previous_path: Floats | None) -> tuple[Floats, Certificate]:
    """Search for a path, and repeat with other grids and more samples while the certificate fails.

    Returns the best path (w, 3) and its certificate.
    """
    attempts = ATTEMPTS_AMONG_ZONES if is_limited(search.problem.search.airspace) else ATTEMPTS
    best_result: tuple[Floats, Certificate] | None = None
    if search.lattice_routes and search.encoding.waypoints > search.problem.scenario.planner.waypoints:
        # An earlier search had too few waypoints for these routes. With more waypoints, only lattice routes have led to
        # a safe path (in 2,000 random scenarios).
        straight_path = search.encoding.decode(search.straight_vectors())[0]
        best_result = search_turning_back(search, (straight_path, certify(search.problem, straight_path)))
        search.report_path(*best_result)
        return best_result
    attempt_count = len(attempts) if search.algorithm.seeded else 1
    for attempt, (grids, population_factor) in enumerate(attempts[:attempt_count]):
        if attempt > 0:
            # With each attempt the clearance buffer grows, and paths may pass missiles more closely. The samples in the
            # archive are evaluated again.
            search.problem = with_narrow_margins(make_problem(search.problem.scenario, search.problem.limits, attempt))
            vectors = search.archive.vectors
            search.archive = Archive(vectors[:0], no_scores())
            search.evaluate(vectors)
        try:
            _run_attempt(search, attempt, grids, population_factor, previous_path)
        except SearchEnded:
            search.record_history()
        result = search.best_path()
        # A later attempt replaces an earlier result only if it is better.
        if best_result is None or (result[1].ok, result[1].kill_distance) > (
            best_result[1].ok,
            best_result[1].kill_distance,
        ):
            best_result = result
        if attempt == 0 and not search.is_closed and may_turn_back(search, best_result[1]):
            best_result = search_turning_back(search, best_result)
            search.report_path(*best_result)
        if search.meets_goal(best_result[1]) or search.is_closed or search.must_end() or not may_try_again(search):
            break
    if best_result is None:  # pragma: no cover - the loop always runs
        raise ScenarioError(
            f"{search.problem.scenario.name}: planner: nothing was tried",
            file=search.problem.scenario.name,
            field="planner",
        )
    return best_result


def _check_options(scenario: Scenario, airspeed: float) -> None:
    """Raise ScenarioError if a search with these options makes no sense; the first reason found is stated.

    airspeed: m/s.

    The reasons are a wind that is too strong for the airspeed, a population that is too large or larger than the
    budget, and a start or destination inside a missile's kill radius.
    """
    if scenario.wind.speed > MAX_WIND_FRACTION * airspeed:
        raise ScenarioError.at(
            scenario.name,
            "wind.speed_mps",
            scenario.wind.speed,
            f"allowed at most {MAX_WIND_FRACTION:.0%} of the airspeed of {airspeed:g} m/s, so that every course can be"
            " flown",
            shown=f"{scenario.wind.speed:g}",
        )
    settings = scenario.planner
    if settings.population * 3 * settings.waypoints > MAX_POPULATION_VALUES:
        raise ScenarioError(
            f"{scenario.name}: planner.population: {settings.population} is too large for "
            f"{settings.waypoints} waypoints; allowed: population x 3 x waypoints up to {MAX_POPULATION_VALUES:,}",
            file=scenario.name,
            field="planner.population",
        )
    if settings.budget is not None and settings.budget < settings.population:
        allowed = f"allowed at least the population, {settings.population}"
        raise ScenarioError.at(scenario.name, "planner.budget", settings.budget, allowed)
    threats = scenario.threats
    for field, end in (("start", scenario.start), ("destination", scenario.destination)):
        distances = np.sqrt(((threats.position - end) ** 2).sum(axis=1)) - threats.kill_radius
        indices = np.flatnonzero((threats.kill_radius > 0.0) & (distances <= 0.0))
        if indices.size:
            missile = int(indices[0])
            raise ScenarioError(
                f"{scenario.name}: {field}: {-distances[missile]:.0f} m inside the kill radius of"
                f" {threats.names[missile]} "
                f"({threats.kill_radius[missile]:.0f} m): no path from there is safe",
                file=scenario.name,
                field=field,
            )


def _run_attempt(
    search: Search,
    attempt: int,
    grids: tuple[tuple[int, int], ...],
    population_factor: int,
    previous_path: Floats | None,
) -> None:
    """Search once: try seeds, run generations, shorten the best path; store the results in `search`.

    It ends earlier if the straight line is safe, the search must end, or it is proven that there is no path.

    attempt: number of the attempt, from 0.
    grids, population_factor: as in `ATTEMPTS`.
    previous_path: older path to start from, or None.
    """
    settings = search.problem.scenario.planner
    population, algorithm = settings.population * population_factor, search.algorithm
    if algorithm.seeded and attempt == 0 and try_straight_line(search):
        search.record_history()
        search.report_progress(0)
        return
    starts = starting_vectors(search, grids, previous_path)
    if len(search.archive.scores) and (search.first_safe_found() or search.must_end()):
        search.record_history()
        return
    if algorithm.seeded:
        # Without a safe path the first attempt has tried other sides with the margins of later attempts, too.
        if attempt == 0 or search.has_safe():
            search_other_sides(search)
        if attempt == 0 and not search.has_safe() and is_closed(search.problem.certified):
            search.is_closed = True
            search.record_history()
            search.report_progress(0)
            return
    last_vector = None
    if algorithm.optimiser == "waypoints":
        # Generations would shorten a safe path by only 1e-4. A second attempt among zones only moves waypoints.
        if not (algorithm.seeded and (search.has_safe() or not grids)):
            run_waypoint_generations(search, population, settings.generations)
    else:
        last_vector = run_path_generations(search, population, settings.generations, starts)
    if algorithm.final_shortening and search.end_reason == "completed":
        # Shorten the best path and the path of the last generation; move waypoints if this finds no finished path.
        if search.can_shorten:
            if last_vector is not None:
                search.shorten(search.encoding.decode(last_vector[None])[0])
            shorten_best(search)
        # Among zones, moves in the first attempt made no path safe (in 33 random scenarios).
        is_left_to_others = attempt == 0 and not search.has_safe() and is_limited(search.problem.search.airspace)
        if search.shortest is None and not is_left_to_others:
            # The result of the generations may take another route than the improved seed.
            if last_vector is not None:
                search.move_and_improve(last_vector, FINAL_MOVE_ROUNDS, 0.5, FINAL_SEARCH_EVALUATIONS)
            for scale in FINAL_MOVE_SCALES:
                if search.must_end():
                    break
                search.move_and_improve(search.archive.vectors[0], FINAL_MOVE_ROUNDS, scale, FINAL_SEARCH_EVALUATIONS)
        search.record_history()
        search.report_progress(0)
