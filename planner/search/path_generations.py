"""Generations of whole paths: an optimiser of vectors, its samples ranked by the preference between scores."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from planner.optimisers.differential_evolution import DifferentialEvolution
from planner.optimisers.emna import Emna
from planner.optimisers.markov_chain import MarkovChain
from planner.optimisers.preference import NO_GOAL, Level, ranks
from planner.optimisers.umda import Umda
from planner.search.score_table import CONSTRAINTS, DETECTION, HEIGHT, KILL, LENGTH, best_first
from planner.search.search_state import Search
from planner.seeding.first_samples import bridge_basis, first_samples

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# A seeded search ends when this many generations have shortened its best path by less than this share of the straight
# line: the pattern search at the end is faster at the rest.
STALLED_GENERATIONS, LEAST_GAIN = 10, 2e-4
# Of the evaluations that the paper's planner makes, the share that a seeded search's generations spend: while it has no
# safe path, and once it has.
SEARCH_SHARE, SAFE_SHARE = 0.3, 0.1


def path_generations(search: Search, population: int, generations: int, starts: Floats) -> Floats:
    """Search with this many paths and generations; the best vector (d,) of the last.

    starts: vectors (s, d) that the first population is drawn around.
    """
    encoding, algorithm = search.encoding, search.algorithm
    levels, before = _levels(search), search.evaluations
    initial = (
        first_samples(search.problem.space, encoding, population, starts, search.rng) if algorithm.smooth else None
    )
    optimiser = _make_optimiser(search, lambda scores: ranks(scores, levels), population, initial)
    optimiser.tell(search.evaluate(optimiser.ask()))
    search.note()
    bests = [_best_row(optimiser.scores)]
    whole = population + generations * (population // 2)
    for generation in range(generations):
        if search.over() or search.safe_already():
            break
        share = SAFE_SHARE if search.best_is_safe() else SEARCH_SHARE
        if algorithm.seeded and (_stagnant(bests) or search.evaluations >= before + share * whole):
            break
        optimiser.tell(search.evaluate(optimiser.ask()))
        search.note()
        bests.append(_best_row(optimiser.scores))
        search.done += 1
        search.report(generations - generation - 1)
    return np.asarray(optimiser.samples[best_first(optimiser.scores)[0]])


def _levels(search: Search) -> tuple[Level, ...]:
    """Preference that ranks a population; goals are the scenario's, none by default."""
    goals = search.problem.scenario.planner.goals
    length = NO_GOAL if goals.length_ratio is None else goals.length_ratio
    kill = NO_GOAL if goals.kill_exposure is None else goals.kill_exposure
    if search.algorithm.graded:
        return CONSTRAINTS, Level((KILL,), (kill,)), Level((LENGTH,), (length,))
    return CONSTRAINTS, Level((LENGTH, KILL), (length, kill)), Level((DETECTION, HEIGHT), (NO_GOAL, NO_GOAL))


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
