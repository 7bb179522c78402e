"""Running an algorithm on a scenario: evaluation, archive, escalation, and the plan that comes of it."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from planner.algorithms import Algorithm, find_algorithm
from planner.certify import certify, kill_distance
from planner.criteria import paper_scores
from planner.encoding import ENCODINGS, Encoding, rotated_vectors
from planner.graded import graded_scores
from planner.plan import Certificate, Plan
from planner.polish import polish
from planner.preference import NO_GOAL, Level, ranks
from planner.problem import CERTIFIED_KILL_MARGIN, Problem, make_problem
from planner.sampling import bridge_basis, first_samples
from planner.seeding import seeds
from planner.umda import Umda
from world.errors import ScenarioError
from world.limits import Limits
from world.scenario import Scenario
from world.streams import PLANNER, stream

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Progress = Callable[[int, int, str], None]

# Columns of the scores that a search ranks: four violations, then the four objectives.
VIOLATIONS = Level((0, 1, 2, 3), (0.0, 0.0, 0.0, 0.0))
LENGTH, KILL, DETECTION, HEIGHT = 4, 5, 6, 7
# The order of the archive: what meets the constraints, then least kill exposure, then the shortest.
ARCHIVE_LEVELS = (VIOLATIONS, Level((KILL,), (NO_GOAL,)), Level((LENGTH,), (NO_GOAL,)))
ARCHIVE_SIZE = 24
# Of each attempt: stages of its grids, routes from each, and the population's growth.
ATTEMPTS = (((36, 52, 80), 2, 1), ((24, 66, 110), 3, 2), ((44, 96, 160), 3, 3))
# A seeded search ends when this many generations have not shortened its best path by 1e-5.
PATIENCE = 10
# Evaluations that each seed, and the best path at the end, are polished with, at most.
SEED_POLISH, LAST_POLISH = 500, 2500
# Numbers a population may hold.
MOST_NUMBERS = 30_000_000


@dataclass(slots=True)
class _Archive:
    """The best paths of all that were evaluated, best first."""

    vectors: Floats
    scores: Floats

    def take(self, vectors: Floats, scores: Floats) -> None:
        """Let new rows in; equal ranks keep their order, older first."""
        fit = len(self.scores) == ARCHIVE_SIZE and not self.scores[:, :4].any()
        if fit:
            # Among rows that meet the constraints the order is by exposure, then by length.
            last = self.scores[-1]
            better = (scores[:, KILL] < last[KILL]) | ((scores[:, KILL] == last[KILL]) & (scores[:, LENGTH] < last[LENGTH]))
            rows = np.flatnonzero(better & ~scores[:, :4].any(axis=1))
            if not rows.size:
                return
            vectors, scores = vectors[rows], scores[rows]
        every = np.concatenate([self.scores, scores])
        joined = np.concatenate([self.vectors, vectors])
        if fit:
            order = np.lexsort((every[:, LENGTH], every[:, KILL]))[:ARCHIVE_SIZE]
        else:
            order = np.argsort(ranks(every, ARCHIVE_LEVELS), kind="stable")[:ARCHIVE_SIZE]
        self.vectors, self.scores = joined[order], every[order]


@dataclass(slots=True)
class _Run:
    """What attempts share: how much was evaluated, and what was seen after each generation."""

    problem: Problem
    algorithm: Algorithm
    encoding: Encoding
    rng: np.random.Generator
    progress: Progress | None
    archive: _Archive
    evaluations: int = 0
    done: int = 0
    history: list[tuple[float, float, float]] = field(default_factory=list)

    def evaluate(self, vectors: Floats) -> Floats:
        """Scores (n, 8) of vectors (n, d); the archive sees them."""
        paths = np.ascontiguousarray(self.encoding.decode(vectors))
        violations: NDArray[np.generic]
        if self.algorithm.graded:
            violations, objectives = graded_scores(self.problem.search, paths)
        else:
            violations, objectives = paper_scores(self.problem.search, paths)
        scores = np.concatenate([violations.astype(np.float64), objectives], axis=1)
        self.evaluations += len(vectors)
        self.archive.take(vectors, scores)
        return scores

    def polish(self, vector: Floats, most: int) -> None:
        """Tighten a vector (d,) by a local search; the archive sees what it finds."""
        left = self.budget() - self.evaluations
        if min(most, left) < 2:
            return
        found, made = polish(self.problem.search, self.encoding, vector, int(min(most, left)))
        self.evaluate(found)
        # What is found was counted when it was found.
        self.evaluations += made - len(found)

    def budget(self) -> float:
        """Evaluations that the scenario allows; no limit by default."""
        most = self.problem.scenario.planner.budget
        return math.inf if most is None else most

    def note(self) -> None:
        """Add the archive's best to the history."""
        best = self.archive.scores[0]
        missed = np.count_nonzero(best[:4]) if self.algorithm.graded else best[:4].sum()
        self.history.append((best[LENGTH], best[KILL], float(missed)))


def plan_path(
    scenario: Scenario,
    limits: Limits,
    *,
    seed: int,
    algorithm: str | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Plan a path.  The same scenario, limits, algorithm and seed give the same plan.

    algorithm: a name of `planner.algorithms`; None takes the scenario's, or the default.  progress: called with
    generations done, generations in all, and a short text.  No feasible path is a plan that says so.
    Raises ScenarioError for options that cannot work.
    """
    chosen = find_algorithm(algorithm or scenario.planner.algorithm, scenario.name)
    _check_options(scenario)
    problem = make_problem(scenario, limits)
    encoding = ENCODINGS[chosen.encoding](problem.space, scenario.planner.waypoints)
    empty = _Archive(np.empty((0, encoding.lower.size)), np.empty((0, 8)))
    run = _Run(problem, chosen, encoding, stream(seed, PLANNER), progress, empty)
    # No path is further from a missile's sphere than its own ends are.
    ends = kill_distance(problem.certified, np.stack([scenario.start, scenario.start]))
    ends = min(ends, kill_distance(problem.certified, np.stack([scenario.destination, scenario.destination])))
    wanted = min(CERTIFIED_KILL_MARGIN, ends - 1e-6)
    attempts = ATTEMPTS if chosen.seeded else ATTEMPTS[:1]
    best: tuple[Floats, Certificate] | None = None
    for number in range(len(attempts)):
        if number > 0:
            _retry(run, number)
        _attempt(run, number)
        best = _best_certified(run)
        if best[1].ok and best[1].kill_distance >= wanted:
            break
        if _spent(run):
            break
    if best is None:  # pragma: no cover - the loop always runs
        raise ScenarioError(f"{scenario.name}: planner: nothing was tried")
    waypoints, certificate = best
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
    )


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


def _spent(run: _Run) -> bool:
    return run.evaluations >= run.budget()


def _levels(run: _Run) -> tuple[Level, ...]:
    """Preference that ranks a population; goals are the scenario's, none by default."""
    goals = run.problem.scenario.planner.goals
    length = NO_GOAL if goals.length_ratio is None else goals.length_ratio
    kill = NO_GOAL if goals.kill_exposure is None else goals.kill_exposure
    if run.algorithm.graded:
        return VIOLATIONS, Level((KILL,), (kill,)), Level((LENGTH,), (length,))
    return VIOLATIONS, Level((LENGTH, KILL), (length, kill)), Level((DETECTION, HEIGHT), (NO_GOAL, NO_GOAL))


def _retry(run: _Run, number: int) -> None:
    """Take more reserve, and judge again what the archive holds."""
    run.problem = make_problem(run.problem.scenario, run.problem.limits, number)
    vectors = run.archive.vectors
    run.archive = _Archive(vectors[:0], np.empty((0, 8)))
    run.evaluate(vectors)


def _attempt(run: _Run, number: int) -> None:
    """One search from its first population to its last generation."""
    table = run.problem.scenario.planner
    stages, each, growth = ATTEMPTS[number]
    population = table.population * growth
    encoding, algorithm = run.encoding, run.algorithm
    starts = np.empty((0, encoding.lower.size))
    if algorithm.seeded:
        if run.progress is not None:
            run.progress(run.done, run.done + table.generations, "grid routes")
        span = (float(encoding.lower[1::3].min()), float(encoding.upper[1::3].max()))
        paths = seeds(run.problem.search, span, table.waypoints, stages, each)
        if paths:
            starts = rotated_vectors(run.problem.space, encoding, np.array(paths))
        for vector in starts:
            run.polish(vector, SEED_POLISH)
        # Marginals over several routes at once fit none of them: the best one leads.
        starts = _best(run, np.concatenate([starts, run.archive.vectors]), 1)
    levels = _levels(run)
    basis = bridge_basis(table.waypoints - 2) if algorithm.smooth else None
    initial = first_samples(run.problem.space, encoding, population, starts, run.rng) if algorithm.smooth else None
    lower, upper = encoding.lower, encoding.upper
    search = Umda(lower, upper, lambda scores: ranks(scores, levels), population, run.rng, initial=initial, basis=basis)
    search.tell(run.evaluate(search.ask()))
    run.note()
    stale = 0
    for generation in range(table.generations):
        if _spent(run) or (algorithm.seeded and stale >= PATIENCE):
            break
        before = run.archive.scores[0].copy()
        search.tell(run.evaluate(search.ask()))
        run.note()
        stale = stale + 1 if _settled(before, run.archive.scores[0]) else 0
        run.done += 1
        if run.progress is not None:
            run.progress(run.done, run.done + table.generations - generation - 1, _status(run.archive.scores[0]))
    if algorithm.seeded:
        run.polish(run.archive.vectors[0], LAST_POLISH)
        run.note()


def _best(run: _Run, vectors: Floats, count: int) -> Floats:
    """Best rows of some vectors, in the archive's order."""
    if not len(vectors):
        return vectors
    order = np.argsort(ranks(run.evaluate(vectors), ARCHIVE_LEVELS), kind="stable")
    return np.asarray(vectors[order[:count]])


def _settled(before: Floats, after: Floats) -> bool:
    same = np.array_equal(before[:4], after[:4]) and before[KILL] == after[KILL]
    return bool(same and before[LENGTH] - after[LENGTH] < 1e-5)


def _status(best: Floats) -> str:
    if best[:4].any():
        return "no feasible path yet"
    return f"length ratio {best[LENGTH]:.4f}, kill exposure {best[KILL]:.3g}"


def _best_certified(run: _Run) -> tuple[Floats, Certificate]:
    """First of the archive that is certified and out of reach; or certified and farthest; or the first."""
    paths = np.ascontiguousarray(run.encoding.decode(run.archive.vectors))
    first: tuple[Floats, Certificate] | None = None
    reachable: tuple[Floats, Certificate] | None = None
    for path in paths:
        certificate = certify(run.problem, path)
        if certificate.ok and certificate.kill_distance >= CERTIFIED_KILL_MARGIN:
            return path, certificate
        first = first or (path, certificate)
        least = -math.inf if reachable is None else reachable[1].kill_distance
        if certificate.ok and certificate.kill_distance > least:
            reachable = (path, certificate)
    result = reachable or first
    if result is None:  # pragma: no cover - an archive is never empty after an attempt
        raise ScenarioError(f"{run.problem.scenario.name}: planner: nothing was evaluated")
    return result
