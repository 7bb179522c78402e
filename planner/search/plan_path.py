"""An algorithm on a scenario: seeds, generations, escalation, and the plan that comes of it."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import Limits
from planner.airspace.airspace_arrays import is_limited
from planner.evaluation.certify import kill_distance
from planner.evaluation.encoding import ENCODINGS, rotated_frame, rotated_vectors
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import CERTIFIED_KILL_MARGIN, make_problem
from planner.optimisers.differential_evolution import DifferentialEvolution
from planner.optimisers.emna import Emna
from planner.optimisers.markov_chain import MarkovChain
from planner.optimisers.preference import NO_GOAL, Level, ranks
from planner.optimisers.umda import Umda
from planner.plan import Certificate, Plan
from planner.search.algorithms import find_algorithm
from planner.search.limits_for import limits_for
from planner.search.score_table import CONSTRAINTS, DETECTION, HEIGHT, KILL, LENGTH, best_first, no_scores, safe
from planner.search.search_state import Archive, Improved, Search, SearchProgress, StopCondition
from planner.seeding.airspace_routes import airspace_routes
from planner.seeding.first_samples import bridge_basis, first_samples
from planner.seeding.grid_routes import GridRoute, grid_routes
from planner.seeding.waypoint_fitting import QUICK, fit_waypoints
from world.errors import ScenarioError
from world.random_streams import PLANNER, stream
from world.scenario import Scenario

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Of each attempt: stages of its grids with the routes from each, and the population's growth.
ATTEMPTS = (
    (((36, 2), (66, 1), (130, 1)), 1),
    (((24, 3), (52, 3), (80, 3), (110, 2)), 2),
    (((44, 3), (96, 3), (160, 2)), 3),
)
# A seeded search ends when this many generations have shortened its best path by less than this share of the straight
# line: the pattern search at the end is faster at the rest.
STALLED_GENERATIONS, LEAST_GAIN = 10, 2e-4
# Of the evaluations that the paper's planner makes, the share that a seeded search's generations spend: while it has no
# safe path, and once it has.
SEARCH_SHARE, SAFE_SHARE = 0.3, 0.1
# Evaluations that a quick path, each seed, and the best path at the end are improved with by a pattern search, at most.
QUICK_SEARCH, SEED_SEARCH, LAST_SEARCH = 50, 300, 200
# Times as many for seeds where a path has to stay in a band of heights above ground: hardly a move keeps to it.
BAND_EFFORT = 3
# Moves that tighten the best path at the end, each of so many rounds, as shares of the first that fit a seed.
LAST_MOVES, LAST_ROUNDS = (1.0, 0.5, 0.25, 0.12), 4
# Of the airspeed: in more wind no path is searched for.
MOST_WIND = 0.8
# Numbers a population may hold.
MOST_NUMBERS = 30_000_000


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
    """Plan a path.  The same scenario, limits, algorithm and seed give the same plan.

    >>> from planfly.airframe import load_airframe
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("hard-07")
    >>> plan = plan_path(scenario, load_airframe(scenario).limits, seed=1)
    >>> plan.safe, plan.waypoints.shape
    (True, (10, 3))

    algorithm: a name of `planner.search.algorithms.ALGORITHMS`; None takes the scenario's, or the default.
    progress: called with generations done, generations in all, and a short text.
    stop: asked between generations; a text ("interrupted") ends the search with the best path yet, and stands in it.
    improved: called with each path (w, 3) that meets the constraints better than all before it, not yet certified.
    first_safe: end with the first safe path.
    previous: (w, 3) an older path of the same ends and number of waypoints to start from.

    No feasible path is a plan that says so.  Raises ScenarioError for options that cannot work.
    """
    chosen = find_algorithm(algorithm or scenario.planner.algorithm, scenario.name)
    _check_options(scenario, limits.airspeed)
    problem = make_problem(scenario, limits_for(chosen, limits))
    encoding = ENCODINGS[chosen.encoding](problem.space, scenario.planner.waypoints)
    # No path is further from a missile's sphere than its own ends are.
    ends = min(kill_distance(problem.certified, np.stack([end, end])) for end in (scenario.start, scenario.destination))
    wanted = min(CERTIFIED_KILL_MARGIN, ends - 1e-6)
    search = Search(problem, chosen, encoding, stream(seed, PLANNER), progress, stop, first_safe, wanted, improved)
    waypoints, certificate = _attempts(search, previous)
    counts, objectives = paper_scores(problem.certified, waypoints[None])
    return Plan(
        scenario=scenario,
        waypoints=waypoints,
        violations=counts[0],
        objectives=objectives[0],
        certificate=certificate,
        seed=seed,
        algorithm=chosen.name,
        evaluations=search.evaluations,
        history=np.array(search.history).reshape(-1, 3),
        ended=search.ended,
    )


def _attempts(search: Search, previous: Floats | None) -> tuple[Floats, Certificate]:
    """Search, and search again with finer grids and more samples while the certificate says no."""
    attempts = ATTEMPTS if search.algorithm.seeded else ATTEMPTS[:1]
    best: tuple[Floats, Certificate] | None = None
    for number in range(len(attempts)):
        if number > 0:
            _retry(search, number)
        _attempt(search, number, previous)
        found = search.best_certified()
        # An earlier attempt's is kept where a later one has nothing better.
        if best is None or (found[1].ok, found[1].kill_distance) > (best[1].ok, best[1].kill_distance):
            best = found
        if search.finished(best[1]) or search.over():
            break
    if best is None:  # pragma: no cover - the loop always runs
        raise ScenarioError(f"{search.problem.scenario.name}: planner: nothing was tried")
    return best


def _check_options(scenario: Scenario, airspeed: float) -> None:
    if scenario.wind.speed > MOST_WIND * airspeed:
        raise ScenarioError(
            f"{scenario.name}: wind.speed_mps: {scenario.wind.speed:g}: a path is searched for in at most"
            f" {MOST_WIND:.0%} of the airspeed {airspeed:g}, to make way on every course"
        )
    table = scenario.planner
    if table.population * 3 * table.waypoints > MOST_NUMBERS:
        raise ScenarioError(
            f"{scenario.name}: planner.population: {table.population} of {table.waypoints} waypoints: "
            f"too large; allowed: population x 3 x waypoints up to {MOST_NUMBERS:,}"
        )
    if table.budget is not None and table.budget < table.population:
        allowed = f"at least the population, {table.population}, is evaluated"
        raise ScenarioError(f"{scenario.name}: planner.budget: {table.budget}: {allowed}")
    threats = scenario.threats
    for name, end in (("start", scenario.start), ("destination", scenario.destination)):
        outside = np.sqrt(((threats.position - end) ** 2).sum(axis=1)) - threats.kill_radius
        inside = np.flatnonzero((threats.kill_radius > 0.0) & (outside <= 0.0))
        if inside.size:
            unit = int(inside[0])
            raise ScenarioError(
                f"{scenario.name}: {name}: {-outside[unit]:.0f} m inside the kill radius of {threats.names[unit]} "
                f"({threats.kill_radius[unit]:.0f} m): no path from there is safe"
            )


def _levels(search: Search) -> tuple[Level, ...]:
    """Preference that ranks a population; goals are the scenario's, none by default."""
    goals = search.problem.scenario.planner.goals
    length = NO_GOAL if goals.length_ratio is None else goals.length_ratio
    kill = NO_GOAL if goals.kill_exposure is None else goals.kill_exposure
    if search.algorithm.graded:
        return CONSTRAINTS, Level((KILL,), (kill,)), Level((LENGTH,), (length,))
    return CONSTRAINTS, Level((LENGTH, KILL), (length, kill)), Level((DETECTION, HEIGHT), (NO_GOAL, NO_GOAL))


def _retry(search: Search, number: int) -> None:
    """Take a larger clearance buffer, and evaluate again what the archive holds."""
    search.problem = make_problem(search.problem.scenario, search.problem.limits, number)
    vectors = search.archive.vectors
    search.archive = Archive(vectors[:0], no_scores())
    search.evaluate(vectors)


def _attempt(search: Search, number: int, previous: Floats | None) -> None:
    """One search from its first population to its last generation."""
    table = search.problem.scenario.planner
    grids, growth = ATTEMPTS[number]
    population = table.population * growth
    encoding, algorithm = search.encoding, search.algorithm
    if algorithm.seeded and number == 0 and _straight(search):
        search.note()
        search.report(0)
        return
    starts = _starts(search, grids, previous)
    if len(search.archive.scores) and (search.safe_already() or search.over()):
        search.note()
        return
    levels, before = _levels(search), search.evaluations
    initial = (
        first_samples(search.problem.space, encoding, population, starts, search.rng) if algorithm.smooth else None
    )
    optimiser = _make_optimiser(search, lambda scores: ranks(scores, levels), population, initial)
    optimiser.tell(search.evaluate(optimiser.ask()))
    search.note()
    bests = [_best_row(optimiser.scores)]
    whole = population + table.generations * (population // 2)
    for generation in range(table.generations):
        if search.over() or search.safe_already():
            break
        share = SAFE_SHARE if search.best_is_safe() else SEARCH_SHARE
        if algorithm.seeded and (_stagnant(bests) or search.evaluations >= before + share * whole):
            break
        optimiser.tell(search.evaluate(optimiser.ask()))
        search.note()
        bests.append(_best_row(optimiser.scores))
        search.done += 1
        search.report(table.generations - generation - 1)
    if algorithm.seeded and search.ended == "completed":
        # What the generations came to, tightened, may be another way than the improved seed's.
        order = best_first(optimiser.scores)
        search.tighten(optimiser.samples[order[0]], LAST_ROUNDS, 0.5, LAST_SEARCH)
        for scale in LAST_MOVES:
            if search.over():
                break
            search.tighten(search.archive.vectors[0], LAST_ROUNDS, scale, LAST_SEARCH)
        search.note()
        search.report(0)


def _straight(search: Search) -> bool:
    """Whether the straight line is a safe path: no path is shorter, and there is nothing to search for."""
    encoding, space = search.encoding, search.problem.space
    if encoding.name != "rotated":
        return False
    edges = encoding.lower[0::3], encoding.upper[0::3]
    share = 0.5 * (edges[0] + edges[1]) / edges[1][-1]
    path = space.start + np.concatenate([[0.0], share, [1.0]])[:, None] * (space.destination - space.start)
    vectors = rotated_vectors(space, encoding, path[None])
    scores = search.score(vectors)
    if not safe(scores[0]):
        return False
    search.evaluate(vectors)
    return search.finished(search.best_certified()[1])


def _starts(search: Search, grids: tuple[tuple[int, int], ...], previous: Floats | None) -> Floats:
    """Vectors (n, d) that a search starts from: the seed that comes out best when improved, and the older path.

    Marginals over several routes at once fit none of them: one leads.  It leads as it was: improved it stands so close
    to every limit that hardly a sample near it keeps them.
    """
    encoding, space, waypoints = search.encoding, search.problem.space, search.encoding.waypoints
    if encoding.name != "rotated" or (not search.algorithm.seeded and previous is None):
        return np.empty((0, encoding.lower.size))
    frame, starts = rotated_frame(space.start, space.destination), list(search.archive.vectors[:1])
    older = [] if previous is None else list(rotated_vectors(space, encoding, previous[None]))
    starts += older
    improved_scores = [search.improve(vector, SEED_SEARCH) for vector in starts]
    banded = math.isfinite(search.problem.search.airspace.max_height)
    for route in _routes(search, grids) if search.algorithm.seeded else ():
        if search.over() or search.safe_already():
            break
        path = fit_waypoints(search.problem.search, frame, route.points, waypoints)
        starts.append(rotated_vectors(space, encoding, path[None])[0])
        improved_scores.append(search.improve(starts[-1], SEED_SEARCH * (BAND_EFFORT if banded else 1)))
    if not starts:
        return np.empty((0, encoding.lower.size))
    order = best_first(np.array(improved_scores))
    return np.array([starts[order[0]], *older])


def _routes(search: Search, grids: tuple[tuple[int, int], ...]) -> list[GridRoute]:
    """The grids' routes; the archive takes a path that is quickly fitted to each as soon as it is found.

    Those with the best such paths come first.
    """
    encoding, space, data = search.encoding, search.problem.space, search.problem.search
    if search.progress is not None:
        search.progress(search.done, search.done + search.problem.scenario.planner.generations, "grid routes")
    frame = rotated_frame(space.start, space.destination)
    span = (float(encoding.lower[1::3].min()), float(encoding.upper[1::3].max()))
    found, scores = [], []
    routes = airspace_routes if is_limited(data.airspace) else grid_routes
    for route in routes(data, frame, span, grids):
        found.append(route)
        path = fit_waypoints(data, frame, route.points, encoding.waypoints, QUICK)
        vectors = rotated_vectors(space, encoding, path[None])
        scores.append(search.evaluate(vectors)[0])
        if not search.safe_already():
            scores[-1] = search.improve(vectors[0], QUICK_SEARCH)
        if search.over() or search.safe_already():
            break
    if not found:
        return []
    return [found[k] for k in best_first(np.array(scores))]


def _best_row(scores: Floats) -> Floats:
    """Best of the scores (n, 8), in the archive's order."""
    return np.asarray(scores[best_first(scores)[0]])


def _make_optimiser(
    search: Search, rank: Callable[[Floats], Ints], population: int, initial: Floats | None
) -> Umda | DifferentialEvolution:
    """The optimiser that the algorithm names."""
    lower, upper = search.encoding.lower, search.encoding.upper
    if search.algorithm.optimiser == "differential":
        return DifferentialEvolution(lower, upper, rank, population, search.rng, initial=initial)
    if search.algorithm.optimiser == "emna":
        return Emna(lower, upper, rank, population, search.rng, initial=initial)
    if search.algorithm.optimiser == "chain":
        return MarkovChain(lower, upper, rank, population, search.rng, initial=initial)
    basis = bridge_basis(search.encoding.waypoints - 2) if search.algorithm.smooth else None
    return Umda(lower, upper, rank, population, search.rng, initial=initial, basis=basis)


def _stagnant(bests: list[Floats]) -> bool:
    """Whether the last generations have gained next to nothing."""
    if len(bests) <= STALLED_GENERATIONS:
        return False
    before, after = bests[-1 - STALLED_GENERATIONS], bests[-1]
    same = np.array_equal(before[:LENGTH], after[:LENGTH]) and before[KILL] == after[KILL]
    return bool(same and before[LENGTH] - after[LENGTH] < LEAST_GAIN)
