"""Run generations of two kinds of evolutionary search, over whole paths and over single waypoints.

`run_path_generations` runs an optimiser on vectors of whole paths, ranked by the preference between their scores.

`run_waypoint_generations` is a factorised distribution algorithm (Mühlenbein and Mahnig, "FDA - a scalable evolutionary
algorithm for the optimization of additively decomposed functions", Evolutionary Computation 7, 1999) over the paper's
subspaces: "to find one optimal waypoint in each subspace, so that the line segments from itself to its two adjacent
    waypoints satisfy all the constraints and objectives" (Yang, Tang and Lozano, CEC 2014, section I).

UMDA ranks whole paths, so that a good waypoint is lost with a bad path. Here every interval has a population of
candidates. Dynamic programming evaluates all their combinations at once (`planner.seeding.waypoint_chains`), and each
candidate is ranked by the best path through it. The best candidates of each niche form the interval's next density
(`planner.optimisers.niche_sampling`), so that routes on several sides of the obstacles coexist until one is shorter.
"""

import math
from collections.abc import Callable

import numpy as np

from planner.evaluation.encoding import rotated_frame
from planner.optimisers.differential_evolution import DifferentialEvolution
from planner.optimisers.emna import Emna
from planner.optimisers.markov_chain import MarkovChain
from planner.optimisers.niche_sampling import NicheSampling
from planner.optimisers.preference import NO_GOAL, Level, ranks
from planner.optimisers.umda import Umda
from planner.search.search_state import CONSTRAINTS, DETECTION, HEIGHT, KILL, LENGTH, Search, best_first
from planner.seeding.first_samples import bridge_basis, first_samples
from planner.seeding.waypoint_chains import ALL_LEGS, WaypointChains, free_points, waypoint_chains
from world.arrays import Floats, Ints

# --- Whole paths ---


# Number of generations over which the gain of a seeded search is measured.
STALLED_GENERATIONS = 10
# Gain in these generations, as a fraction of the straight line, below which the search ends: from there the final
# pattern search is more efficient.
MIN_GAIN_FRACTION = 2e-4
# Evaluations of a seeded search without a safe path, as a fraction of the paper's number.
UNSAFE_SEARCH_FRACTION = 0.3
# Evaluations of a seeded search with a safe path, as a fraction of the paper's number.
SAFE_SEARCH_FRACTION = 0.1


def run_path_generations(search: Search, population: int, generations: int, starts: Floats) -> Floats:
    """Run an optimiser on whole paths; return the best vector (d,) of the last generation.

    population: number of samples of the first generation.
    generations: maximum number of further generations, each of half as many samples.
    starts: vectors (s, d) around which the first population is sampled.

    A search with seeds ends earlier if it no longer improves, or after a fraction of these evaluations.
    """
    encoding, algorithm = search.encoding, search.algorithm
    previous_evaluations = search.evaluations
    # Paths are ranked with the goals of the scenario, if it states any.
    goals = search.problem.scenario.planner.goals
    length_goal = NO_GOAL if goals.length_ratio is None else goals.length_ratio
    kill_goal = NO_GOAL if goals.kill_exposure is None else goals.kill_exposure
    levels: tuple[Level, ...] = (
        (CONSTRAINTS, Level((KILL,), (kill_goal,)), Level((LENGTH,), (length_goal,)))
        if algorithm.graded
        else (
            CONSTRAINTS,
            Level((LENGTH, KILL), (length_goal, kill_goal)),
            Level((DETECTION, HEIGHT), (NO_GOAL, NO_GOAL)),
        )
    )
    initial = (
        first_samples(search.problem.space, encoding, population, starts, search.rng) if algorithm.smooth else None
    )
    optimiser = _make_optimiser(search, lambda scores: ranks(scores, levels), population, initial)
    optimiser.tell(search.evaluate(optimiser.ask()))
    search.record_history()
    best_scores = [_best_row(optimiser.scores)]
    full_evaluations = population + generations * (population // 2)
    for generation in range(generations):
        if search.must_end() or search.first_safe_found():
            break
        max_fraction = SAFE_SEARCH_FRACTION if search.best_is_safe() else UNSAFE_SEARCH_FRACTION
        is_stagnant = False
        if len(best_scores) > STALLED_GENERATIONS:
            earlier, latest = best_scores[-1 - STALLED_GENERATIONS], best_scores[-1]
            has_same_violations = np.array_equal(earlier[:LENGTH], latest[:LENGTH]) and earlier[KILL] == latest[KILL]
            is_stagnant = has_same_violations and earlier[LENGTH] - latest[LENGTH] < MIN_GAIN_FRACTION
        if algorithm.seeded and (
            is_stagnant or search.evaluations >= previous_evaluations + max_fraction * full_evaluations
        ):
            break
        optimiser.tell(search.evaluate(optimiser.ask()))
        search.record_history()
        best_scores.append(_best_row(optimiser.scores))
        search.done += 1
        search.report_progress(generations - generation - 1)
    return np.asarray(optimiser.samples[best_first(optimiser.scores)[0]])


def _best_row(scores: Floats) -> Floats:
    """Return the scores (8,) of the best path among scores (n, 8)."""
    return np.asarray(scores[best_first(scores)[0]])


def _make_optimiser(
    search: Search, rank: Callable[[Floats], Ints], population: int, initial: Floats | None
) -> Umda | DifferentialEvolution:
    """Make the optimiser that the algorithm names.

    rank: function of scores (n, c) that returns their ranks (n,); smaller is better.
    population: number of samples.
    initial: (population, d) first samples; None for uniform ones.
    """
    lower, upper = search.encoding.lower, search.encoding.upper
    if search.algorithm.optimiser == "differential":
        return DifferentialEvolution(lower, upper, rank, population, search.rng, initial=initial)
    if search.algorithm.optimiser == "emna":
        return Emna(lower, upper, rank, population, search.rng, initial=initial)
    if search.algorithm.optimiser == "chain":
        return MarkovChain(lower, upper, rank, population, search.rng, initial=initial)
    basis = bridge_basis(search.encoding.waypoints - 2) if search.algorithm.smooth else None
    return Umda(lower, upper, rank, population, search.rng, initial=initial, basis=basis)


# --- Single waypoints ---

# Maximum number of generations; the last ones move waypoints by decimetres.
MAX_GENERATIONS = 10
# Maximum number of generations of a seeded search: fewer, because the best path is shortened afterwards.
SEEDED_GENERATIONS = 6
# Population of a seeded search, as a fraction of the usual population.
SEEDED_POPULATION_FRACTION = 0.4
# Population of later generations, as a fraction of the first.
LATER_POPULATION_FRACTION = 0.2
# Minimum population of later generations.
MIN_POPULATION = 24
# Maximum number of legs between the candidates of one generation: limits memory.
MAX_LEGS = 6_000_000
# Maximum number of legs that all attempts of a search evaluate if the scenario states no budget, relative to the legs
# between all candidates of the first attempt.
MAX_LEG_RATIO = 2.0
# Remaining legs that another attempt requires, relative to the legs between all candidates of the first attempt.
RETRY_LEG_FRACTION = 0.75
# Fraction of the remaining legs that one generation without a bound on the cost may evaluate: without a bound, hardly
# any leg can be skipped.
UNBOUNDED_LEG_FRACTION = 0.5
# Initial sampling deviation around a selected waypoint along, as a fraction of the interval.
FIRST_DEVIATION_ALONG_FRACTION = 0.4
# Initial sampling deviation across, as a fraction of the interval.
FIRST_DEVIATION_ACROSS_FRACTION = 0.5
# Initial sampling deviation up, m.
FIRST_DEVIATION_UP_M = 60.0
# Factor on these deviations per generation.
DEVIATION_FACTOR = 0.5
# Fraction of the height range by which samples extend above the ceiling before they are clipped, as spheres are
# smallest there.
ABOVE_CEILING_FRACTION = 0.3
# Maximum excess of a path through a selected waypoint over the best path in the first generation, as a fraction.
FIRST_EXCESS_FRACTION = 0.1
# Maximum excess in the last generation, as a fraction.
LAST_EXCESS_FRACTION = 0.003
# Maximum excess in the first generation of a seeded search, whose best path is closer to the optimum.
SEEDED_EXCESS_FRACTION = 0.05
# Bounds on the first path's cost relative to the straight line, tried in this order: lower bounds are faster.
FIRST_COST_RATIO_BOUNDS = (1.15, 1.3, 1.6, 2.5, math.inf)
# Number of best candidates per interval whose paths are evaluated as a whole.
BEST_PER_INTERVAL = 3
# Every n-th interval is used for these paths.
INTERVAL_STEP = 3
# Maximum evaluations of a pattern search on a generation's best path while no path is feasible.
REPAIR_EVALUATIONS = 100


def run_waypoint_generations(search: Search, population: int, generations: int) -> None:
    """Run the factorised distribution algorithm, and insert the paths that it finds into the archive.

    Each interval of the axis has a set of candidates for its waypoint. In each generation the best path through every
    candidate is found by dynamic programming, and new candidates are drawn around those with the best paths.

    population: number of candidates per interval in the first generation.
    generations: number of generations, at most `MAX_GENERATIONS`, or `SEEDED_GENERATIONS` with seeds.
    """
    encoding, space = search.encoding, search.problem.space
    inner_count = encoding.waypoints - 2
    frame = rotated_frame(space.start, space.destination)
    lower, upper = encoding.lower.reshape(inner_count, 3), encoding.upper.reshape(inner_count, 3)
    data = search.problem.search
    sampling = NicheSampling(lower, upper, lambda rows, _: free_points(data, frame.to_world(rows)), search.rng)
    is_seeded, first_count = search.algorithm.seeded, _first_candidate_count(search, population)
    later_count = _later_candidate_count(first_count)
    interval = frame.length / inner_count
    deviation = np.array(
        [FIRST_DEVIATION_ALONG_FRACTION * interval, FIRST_DEVIATION_ACROSS_FRACTION * interval, FIRST_DEVIATION_UP_M]
    )
    rows = sampling.draw_first(first_count, np.array([0.0, 0.0, ABOVE_CEILING_FRACTION]))
    if not len(search.archive.vectors):
        # The archive must contain a path whenever the search is stopped.
        search.evaluate(_as_vectors(rows[:, :1]))
    generation_count = _limit_generations(search, generations)
    first_slack = SEEDED_EXCESS_FRACTION if is_seeded else FIRST_EXCESS_FRACTION
    for generation in range(generation_count):
        rows[:, 0] = search.archive.vectors[0].reshape(inner_count, 3)
        slack = first_slack * (LAST_EXCESS_FRACTION / first_slack) ** (generation / max(1, generation_count - 1))
        chains = _join_candidates(search, encoding.decode(_as_vectors(rows)), slack)
        rows = rows[:, : chains.cost.shape[1]]
        search.legs += chains.legs
        search.evaluations += math.ceil(chains.legs / (inner_count + 1))
        # Evaluate whole paths through some of the best candidates of some intervals; without any, the path of the first
        # candidates. If no path in the archive is feasible, a pattern search tries to repair the best one.
        candidate_chains = {
            tuple(chains.path_through(i, int(k))[1:-1].tolist())
            for i in range(1, len(chains.cost) - 1, INTERVAL_STEP)
            for k in np.argsort(chains.cost[i], kind="stable")[:BEST_PER_INTERVAL]
            if chains.cost[i, k] < math.inf
        }
        if candidate_chains:
            chain_rows = [rows[np.arange(len(rows)), list(chain)].ravel() for chain in sorted(candidate_chains)]
            search.evaluate(np.array(chain_rows))
            if not search.archive.is_feasible():
                search.improve(search.archive.vectors[0], REPAIR_EVALUATIONS)
        else:
            search.evaluate(_as_vectors(rows[:, :1]))
        search.record_history()
        search.done += 1
        search.report_progress(generation_count - generation - 1)
        if search.must_end() or search.first_safe_found() or count_remaining_legs(search) <= 0:
            break
        if generation < generation_count - 1:
            cost = chains.cost[1:-1]
            elite = search.archive.vectors[0].reshape(inner_count, 3)
            rows = sampling.draw_next(rows, cost, later_count, deviation, float(cost.min()) * (1.0 + slack), elite)
            deviation = DEVIATION_FACTOR * deviation


def _first_candidate_count(search: Search, population: int) -> int:
    """Return the number of candidates per interval in the first generation.

    A seeded search has fewer candidates. The memory for the legs between them limits the number.

    population: requested number of candidates.
    """
    max_count = int(math.sqrt(MAX_LEGS / (search.encoding.waypoints - 1)))
    return max(2, min(int(population * (SEEDED_POPULATION_FRACTION if search.algorithm.seeded else 1.0)), max_count))


def _later_candidate_count(first_count: int) -> int:
    """Return the number of candidates per interval in later generations."""
    return min(first_count, max(MIN_POPULATION, int(LATER_POPULATION_FRACTION * first_count)))


def _limit_generations(search: Search, generations: int) -> int:
    """Return the requested number of generations, at most the maximum of `run_waypoint_generations`."""
    return min(generations, SEEDED_GENERATIONS if search.algorithm.seeded else MAX_GENERATIONS)


def count_remaining_legs(search: Search) -> int:
    """Return the number of legs that the search may still evaluate.

    If the scenario states a budget of evaluations, legs are not limited, and the result is `ALL_LEGS`.
    """
    settings = search.problem.scenario.planner
    if settings.budget is not None:
        return ALL_LEGS
    return int(MAX_LEG_RATIO * _count_attempt_legs(search)) - search.legs


def may_try_again(search: Search) -> bool:
    """Return True if the remaining number of legs is sufficient for another attempt."""
    return count_remaining_legs(search) >= RETRY_LEG_FRACTION * _count_attempt_legs(search)


def _count_attempt_legs(search: Search) -> int:
    """Return the number of legs between neighbouring intervals that a first attempt evaluates.

    The legs join candidates of these intervals.

    The legs of all generations are counted, without the savings of a bound on the cost.
    """
    settings = search.problem.scenario.planner
    first_count = _first_candidate_count(search, settings.population)
    candidate_pairs = (
        first_count**2
        + max(0, _limit_generations(search, settings.generations) - 1) * _later_candidate_count(first_count) ** 2
    )
    return (search.encoding.waypoints - 1) * candidate_pairs


def _as_vectors(rows: Floats) -> Floats:
    """Convert k candidates per interval, (i, k, 3), to k vectors, (k, 3 i).

    Each vector has one candidate per interval.
    """
    return rows.transpose(1, 0, 2).reshape(rows.shape[1], -1)


def _join_candidates(search: Search, paths: Floats, slack: float) -> WaypointChains:
    """Find the best path through each waypoint of some paths (k, w, 3), also across different paths.

    slack: fraction by which the first bound exceeds the cost of the best safe path, if there is one.

    Only paths below an upper bound on the cost are searched, because without a bound almost every leg would have to be
    evaluated. If no path is below the bound, a larger bound is tried. If few legs may still be evaluated, the last
    search, without a bound, only joins the first candidates.
    """
    data, space = search.problem.search, search.problem.space
    straight_length = math.dist(space.start, space.destination)
    candidates = np.ascontiguousarray(paths.transpose(1, 0, 2))
    bounds: tuple[float, ...] = FIRST_COST_RATIO_BOUNDS
    if len(search.archive.scores) and search.best_is_safe():
        bounds = (float(search.archive.scores[0, LENGTH]) * (1.0 + slack), *FIRST_COST_RATIO_BOUNDS)
    legs, remaining_legs = 0, count_remaining_legs(search)
    for bound in bounds:
        if math.isinf(bound):
            max_candidates = max(
                1, math.isqrt(int(UNBOUNDED_LEG_FRACTION * max(0, remaining_legs - legs)) // (len(candidates) - 1))
            )
            candidates = np.ascontiguousarray(candidates[:, :max_candidates])
        chains = waypoint_chains(
            data, candidates, bound * straight_length, search.check_stop, max(1, remaining_legs - legs)
        )
        legs += chains.legs
        if chains.cost[1:-1].min() <= bound * straight_length < math.inf or legs >= remaining_legs:
            break
        search.check_stop()
    return chains._replace(legs=legs)
