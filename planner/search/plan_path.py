"""Running an algorithm on a scenario: seeds, generations, escalation, and the plan that comes of it."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import Limits
from planner.evaluation.certify import kill_distance
from planner.evaluation.encoding import ENCODINGS, rotated_frame, rotated_vectors
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import CERTIFIED_KILL_MARGIN, make_problem
from planner.optimisers.differential_evolution import Differential
from planner.optimisers.emna import Emna
from planner.optimisers.markov_chain import Chain
from planner.optimisers.preference import NO_GOAL, Level, ranks
from planner.optimisers.umda import Umda
from planner.plan import Certificate, Plan
from planner.search.algorithms import find_algorithm
from planner.search.search_state import (
    ARCHIVE_LEVELS,
    DETECTION,
    HEIGHT,
    KILL,
    LENGTH,
    VIOLATIONS,
    Archive,
    Improved,
    Progress,
    Run,
    Stop,
)
from planner.seeding.first_samples import bridge_basis, first_samples
from planner.seeding.grid_routes import Route, grid_routes
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
# line: the polish at the end is faster at the rest.
PATIENCE, GAIN = 10, 2e-4
# Of the evaluations that the paper's planner makes, the share that a seeded search's generations spend: while it has no
# safe path, and once it has.
SHARE, SAFE_SHARE = 0.3, 0.1
# Evaluations that a quick path, each seed, and the best path at the end are polished with, at most.
QUICK_POLISH, SEED_POLISH, LAST_POLISH = 50, 300, 200
# Moves that tighten the best path at the end, each of so many rounds, as shares of the first that fit a seed.
LAST_MOVES, LAST_ROUNDS = (1.0, 0.5, 0.25, 0.12), 4
# Numbers a population may hold.
MOST_NUMBERS = 30_000_000


def plan_path(
    scenario: Scenario,
    limits: Limits,
    *,
    seed: int,
    algorithm: str | None = None,
    progress: Progress | None = None,
    stop: Stop | None = None,
    improved: Improved | None = None,
    first_safe: bool = False,
    previous: Floats | None = None,
) -> Plan:
    """Plan a path.  The same scenario, limits, algorithm and seed give the same plan.

    algorithm: a name of `planner.search.algorithms`; None takes the scenario's, or the default.  progress: called with
    generations done, generations in all, and a short text.  stop: asked between generations; a text such as
    "interrupted" ends the search with the best path yet, and stands in the plan.  improved: called with each path
    (w, 3) that meets the constraints better than all before it, not yet certified.  first_safe: end with the first
    safe path.  previous: (w, 3) an older path of the same ends and number of waypoints to start from.
    No feasible path is a plan that says so.  Raises ScenarioError for options that cannot work.
    """
    chosen = find_algorithm(algorithm or scenario.planner.algorithm, scenario.name)
    _check_options(scenario)
    problem = make_problem(scenario, limits)
    encoding = ENCODINGS[chosen.encoding](problem.space, scenario.planner.waypoints)
    # No path is further from a missile's sphere than its own ends are.
    ends = min(kill_distance(problem.certified, np.stack([end, end])) for end in (scenario.start, scenario.destination))
    wanted = min(CERTIFIED_KILL_MARGIN, ends - 1e-6)
    run = Run(problem, chosen, encoding, stream(seed, PLANNER), progress, stop, first_safe, wanted, improved)
    waypoints, certificate = _attempts(run, previous)
    counts, objectives = paper_scores(problem.certified, waypoints[None])
    return Plan(
        scenario=scenario,
        waypoints=waypoints,
        violations=counts[0],
        objectives=objectives[0],
        certificate=certificate,
        seed=seed,
        algorithm=chosen.name,
        evaluations=run.evaluations,
        history=np.array(run.history).reshape(-1, 3),
        ended=run.ended,
    )


def _attempts(run: Run, previous: Floats | None) -> tuple[Floats, Certificate]:
    """Search, and search again with finer grids and more samples while the certificate says no."""
    attempts = ATTEMPTS if run.algorithm.seeded else ATTEMPTS[:1]
    best: tuple[Floats, Certificate] | None = None
    for number in range(len(attempts)):
        if number > 0:
            _retry(run, number)
        _attempt(run, number, previous)
        found = run.best_certified()
        # An earlier attempt's is kept where a later one has nothing better.
        if best is None or (found[1].ok, found[1].kill_distance) > (best[1].ok, best[1].kill_distance):
            best = found
        if run.finished(best[1]) or run.over():
            break
    if best is None:  # pragma: no cover - the loop always runs
        raise ScenarioError(f"{run.problem.scenario.name}: planner: nothing was tried")
    return best


def _check_options(scenario: Scenario) -> None:
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


def _levels(run: Run) -> tuple[Level, ...]:
    """Preference that ranks a population; goals are the scenario's, none by default."""
    goals = run.problem.scenario.planner.goals
    length = NO_GOAL if goals.length_ratio is None else goals.length_ratio
    kill = NO_GOAL if goals.kill_exposure is None else goals.kill_exposure
    if run.algorithm.graded:
        return VIOLATIONS, Level((KILL,), (kill,)), Level((LENGTH,), (length,))
    return VIOLATIONS, Level((LENGTH, KILL), (length, kill)), Level((DETECTION, HEIGHT), (NO_GOAL, NO_GOAL))


def _retry(run: Run, number: int) -> None:
    """Take more reserve, and judge again what the archive holds."""
    run.problem = make_problem(run.problem.scenario, run.problem.limits, number)
    vectors = run.archive.vectors
    run.archive = Archive(vectors[:0], np.empty((0, 8)))
    run.evaluate(vectors)


def _attempt(run: Run, number: int, previous: Floats | None) -> None:
    """One search from its first population to its last generation."""
    table = run.problem.scenario.planner
    grids, growth = ATTEMPTS[number]
    population = table.population * growth
    encoding, algorithm = run.encoding, run.algorithm
    if algorithm.seeded and number == 0 and _straight(run):
        run.note()
        run.report(0)
        return
    starts = _starts(run, grids, previous)
    if len(run.archive.scores) and (run.safe_already() or run.over()):
        run.note()
        return
    levels, before = _levels(run), run.evaluations
    initial = first_samples(run.problem.space, encoding, population, starts, run.rng) if algorithm.smooth else None
    search = _optimiser(run, lambda scores: ranks(scores, levels), population, initial)
    search.tell(run.evaluate(search.ask()))
    run.note()
    bests = [_first(search.scores)]
    whole = population + table.generations * (population // 2)
    for generation in range(table.generations):
        if run.over() or run.safe_already():
            break
        share = SHARE if run.missed() else SAFE_SHARE
        if algorithm.seeded and (_settled(bests) or run.evaluations >= before + share * whole):
            break
        search.tell(run.evaluate(search.ask()))
        run.note()
        bests.append(_first(search.scores))
        run.done += 1
        run.report(table.generations - generation - 1)
    if algorithm.seeded and run.ended == "completed":
        # What the generations came to, tightened, may be another way than the polished seed's.
        order = np.argsort(ranks(_known(search.scores), ARCHIVE_LEVELS), kind="stable")
        run.tighten(search.samples[order[0]], LAST_ROUNDS, 0.5, LAST_POLISH)
        for scale in LAST_MOVES:
            if run.over():
                break
            run.tighten(run.archive.vectors[0], LAST_ROUNDS, scale, LAST_POLISH)
        run.note()
        run.report(0)


def _straight(run: Run) -> bool:
    """Whether the straight line is a safe path: no path is shorter, and there is nothing to search for."""
    encoding, space = run.encoding, run.problem.space
    if encoding.name != "rotated":
        return False
    edges = encoding.lower[0::3], encoding.upper[0::3]
    share = 0.5 * (edges[0] + edges[1]) / edges[1][-1]
    path = space.start + np.concatenate([[0.0], share, [1.0]])[:, None] * (space.destination - space.start)
    vectors = rotated_vectors(space, encoding, path[None])
    scores = run.judge(vectors)
    if scores[0, :4].any() or scores[0, KILL] > 0.0:
        return False
    run.evaluate(vectors)
    return run.finished(run.best_certified()[1])


def _starts(run: Run, grids: tuple[tuple[int, int], ...], previous: Floats | None) -> Floats:
    """Vectors (n, d) that a search starts from: the seed that comes out best when polished, and the older path.

    Marginals over several routes at once fit none of them: one leads.  It leads as it was: polished it stands so close
    to every limit that hardly a sample near it keeps them.
    """
    encoding, space, waypoints = run.encoding, run.problem.space, run.encoding.waypoints
    if encoding.name != "rotated" or (not run.algorithm.seeded and previous is None):
        return np.empty((0, encoding.lower.size))
    starts = list(run.archive.vectors[:1])
    older = [] if previous is None else list(rotated_vectors(space, encoding, previous[None]))
    starts += older
    polished = [run.polish(vector, SEED_POLISH) for vector in starts]
    for route in _routes(run, grids) if run.algorithm.seeded else ():
        if run.over() or run.safe_already():
            break
        path = fit_waypoints(run.problem.search, rotated_frame(space.start, space.destination), route.points, waypoints)
        starts.append(rotated_vectors(space, encoding, path[None])[0])
        polished.append(run.polish(starts[-1], SEED_POLISH))
    if not starts:
        return np.empty((0, encoding.lower.size))
    order = np.argsort(ranks(np.array(polished), ARCHIVE_LEVELS), kind="stable")
    return np.array([starts[order[0]], *older])


def _routes(run: Run, grids: tuple[tuple[int, int], ...]) -> list[Route]:
    """Find the grids' routes; the archive sees a path that is quickly fitted to each as soon as it is found.

    Those with the best such paths come first.
    """
    encoding, space, rules = run.encoding, run.problem.space, run.problem.search
    if run.progress is not None:
        run.progress(run.done, run.done + run.problem.scenario.planner.generations, "grid routes")
    frame = rotated_frame(space.start, space.destination)
    span = (float(encoding.lower[1::3].min()), float(encoding.upper[1::3].max()))
    found, scores = [], []
    for route in grid_routes(rules, frame, span, grids):
        found.append(route)
        path = fit_waypoints(rules, frame, route.points, encoding.waypoints, QUICK)
        vectors = rotated_vectors(space, encoding, path[None])
        scores.append(run.evaluate(vectors)[0])
        if not run.safe_already():
            scores[-1] = run.polish(vectors[0], QUICK_POLISH)
        if run.over() or run.safe_already():
            break
    if not found:
        return []
    return [found[k] for k in np.argsort(ranks(np.array(scores), ARCHIVE_LEVELS), kind="stable")]


def _known(scores: Floats | None) -> Floats:
    return np.empty((0, 8)) if scores is None else scores


def _first(scores: Floats | None) -> Floats:
    """Best row (8,) of a population's scores, in the archive's order."""
    known = _known(scores)
    return np.asarray(known[int(np.argmin(ranks(known, ARCHIVE_LEVELS)))])


def _optimiser(
    run: Run, rank: Callable[[Floats], Ints], population: int, initial: Floats | None
) -> Umda | Differential:
    """Make the optimiser that the algorithm names."""
    lower, upper = run.encoding.lower, run.encoding.upper
    if run.algorithm.optimiser == "differential":
        return Differential(lower, upper, rank, population, run.rng, initial=initial)
    if run.algorithm.optimiser == "emna":
        return Emna(lower, upper, rank, population, run.rng, initial=initial)
    if run.algorithm.optimiser == "chain":
        return Chain(lower, upper, rank, population, run.rng, initial=initial)
    basis = bridge_basis(run.encoding.waypoints - 2) if run.algorithm.smooth else None
    return Umda(lower, upper, rank, population, run.rng, initial=initial, basis=basis)


def _settled(bests: list[Floats]) -> bool:
    """Whether the last generations have gained next to nothing."""
    if len(bests) <= PATIENCE:
        return False
    before, after = bests[-1 - PATIENCE], bests[-1]
    same = np.array_equal(before[:4], after[:4]) and before[KILL] == after[KILL]
    return bool(same and before[LENGTH] - after[LENGTH] < GAIN)
