"""A search under way: what it has evaluated, the best of it, and when it is to end."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from planner.airspace.zone_limits import is_limited
from planner.evaluation.airspace_scores import airspace_counts
from planner.evaluation.certify import certify
from planner.evaluation.encoding import Encoding
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import CERTIFIED_KILL_MARGIN, Problem
from planner.optimisers.preference import NO_GOAL, Level, ranks
from planner.plan import Certificate, Objective, Violation
from planner.search.algorithms import Algorithm
from planner.seeding.pattern_search import search_patterns
from planner.seeding.shortening import MOST_MODELS, shorten_path
from planner.seeding.waypoint_fitting import tighten
from world.errors import ScenarioError
from world.geometry import path_length

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


# ----------------------------------------------------------------------
# The table of scores that a search ranks: a row a path, its violations and then its objectives, and their order.


SCORE_COLUMNS = len(Violation) + len(Objective)
LENGTH, KILL, DETECTION, HEIGHT = (len(Violation) + item for item in Objective)
CONSTRAINTS = Level(tuple(Violation), (0.0,) * len(Violation))
# The order of an archive: what meets the constraints, then least kill exposure, then the shortest.
ARCHIVE_LEVELS = (CONSTRAINTS, Level((KILL,), (NO_GOAL,)), Level((LENGTH,), (NO_GOAL,)))


def score_table(violations: NDArray[np.generic], objectives: Floats) -> Floats:
    """Scores (n, 8) of violations (n, 4) and objectives (n, 4)."""
    return np.concatenate([violations.astype(np.float64), objectives], axis=1)


def no_scores() -> Floats:
    """A table without rows."""
    return np.empty((0, SCORE_COLUMNS))


def violated(scores: Floats) -> Flags:
    """Whether paths with these scores (..., 8) violate a constraint, (...,)."""
    return np.asarray(scores[..., : len(Violation)].any(axis=-1))


def safe(scores: Floats) -> Flags:
    """Whether paths with these scores (..., 8) violate nothing and are exposed to no missile, (...,)."""
    return np.asarray(~violated(scores) & ~(scores[..., KILL] > 0.0))


def best_first(scores: Floats) -> Ints:
    """Rows of scores (n, 8) in the archive's order; equal ranks keep their order."""
    return np.argsort(ranks(scores, ARCHIVE_LEVELS), kind="stable")


SearchProgress = Callable[[int, int, str], None]
StopCondition = Callable[[], str]
Improved = Callable[[Floats], None]

# Paths that are kept.
ARCHIVE_SIZE = 24
# Room beside spheres and above ground that a path is shortened with until it is certified, m.
SPARES = (0.1, 2.0)
# Evaluations that moving all waypoints may take: with less left of a budget they are not moved.
MAX_TIGHTENING = 600
# Waypoints of paths that are evaluated before the search may end: some 10 ms.
WAYPOINTS_AT_ONCE = 4000
# Certificates that are made of the archive before the search may end: some 10 ms where none is to be had.
CERTIFICATES_AT_ONCE = 4


class SearchEnded(Exception):
    """Raised in the midst of a search that is asked to end; its archive holds what it has found."""


@dataclass(slots=True)
class Archive:
    """The best paths of all that were evaluated, best first: vectors (k, d) and scores (k, 8)."""

    vectors: Floats
    scores: Floats

    def feasible(self) -> bool:
        """Whether the best path meets the constraints; not where there is none."""
        return len(self.scores) > 0 and not violated(self.scores[0])

    def take(self, vectors: Floats, scores: Floats) -> None:
        """Let new rows in; equal ranks keep their order, older first.

        Once a row meets the constraints, those that do not are let go: there can be thousands of them to rank.
        """
        fit = ~violated(scores)
        if self.feasible():
            if len(self.scores) == ARCHIVE_SIZE:
                last = self.scores[-1]
                shorter = (scores[:, KILL] == last[KILL]) & (scores[:, LENGTH] < last[LENGTH])
                fit &= shorter | (scores[:, KILL] < last[KILL])
            if not fit.any():
                return
        elif fit.any():
            self.vectors, self.scores = self.vectors[:0], self.scores[:0]
        every = np.concatenate([self.scores, scores[fit] if fit.any() else scores])
        joined = np.concatenate([self.vectors, vectors[fit] if fit.any() else vectors])
        order = best_first(every)[:ARCHIVE_SIZE]
        self.vectors, self.scores = joined[order], every[order]


@dataclass(slots=True)
class Search:
    """What attempts share: how much was evaluated, and what was found after each generation.

    problem: with the margins of the present attempt.
    algorithm, encoding, rng: how it searches.
    progress: called with generations done, generations in all, and a short text.
    stop: asked after each generation and each start; a text ends the search and says why.
    first_safe: whether it ends with the first safe path.
    wanted: distance (m) from missiles that the certificate of a finished path has.
    improved: called with each path (w, 3) that is the best yet of those that meet the constraints.
    archive: the best paths of all.
    evaluations: paths evaluated, or as much work.
    done: generations done.
    ended: why the search ended.
    history: after each generation length ratio, kill exposure and violations of the best path yet.
    certificates: by the path's vector.
    shortest: the shortest finished path (w, 3) that shortening came to, and its certificate; no interval holds it.
    spent: whether the budget leaves too little for another shortening.
    """

    problem: Problem
    algorithm: Algorithm
    encoding: Encoding
    rng: np.random.Generator
    progress: SearchProgress | None
    stop: StopCondition | None
    first_safe: bool
    wanted: float
    improved: Improved | None = None
    archive: Archive = field(init=False)
    evaluations: int = 0
    done: int = 0
    ended: str = "completed"
    history: list[tuple[float, float, float]] = field(default_factory=list)
    certificates: dict[bytes, Certificate] = field(default_factory=dict)
    shortest: tuple[Floats, Certificate] | None = None
    spent: bool = False

    def __post_init__(self) -> None:
        """Begin with nothing."""
        self.archive = Archive(np.empty((0, self.encoding.lower.size)), no_scores())

    def score(self, vectors: Floats) -> Floats:
        """Scores (n, 8) of vectors (n, d), of which neither archive nor budget takes note."""
        paths = np.ascontiguousarray(self.encoding.decode(vectors))
        data = self.problem.search
        if self.algorithm.graded:
            return score_table(*graded_scores(data, paths))
        counts, objectives = paper_scores(data, paths)
        if is_limited(data.airspace):
            counts[:, Violation.BOUNDS] += airspace_counts(data, paths)
        return score_table(counts, objectives)

    def evaluate(self, vectors: Floats) -> Floats:
        """Scores (n, 8) of vectors (n, d); the archive takes them.  Raises SearchEnded when asked to end."""
        at_once, scores = max(1, WAYPOINTS_AT_ONCE // self.encoding.waypoints), no_scores()
        for first in range(0, len(vectors), at_once):
            scores = np.concatenate([scores, self.score(vectors[first : first + at_once])])
            if len(scores) < len(vectors) and self._asked_to_end():
                break
        self._take(vectors[: len(scores)], scores)
        if len(scores) < len(vectors):
            raise SearchEnded
        return scores

    def pause(self) -> None:
        """Raise SearchEnded if the search is asked to end and has anything to show."""
        if len(self.archive.scores) and self._asked_to_end():
            raise SearchEnded

    def _asked_to_end(self) -> bool:
        reason = self.stop() if self.stop is not None else ""
        self.ended = reason or self.ended
        return bool(reason)

    def _take(self, vectors: Floats, scores: Floats) -> None:
        """Count what was evaluated, and let it into the archive."""
        self.evaluations += len(vectors)
        before = self.archive.vectors[:1]
        self.archive.take(vectors, scores)
        best = self.archive.vectors[:1]
        if self.improved is None or not self.archive.feasible() or np.array_equal(before, best):
            return
        ratio = self.archive.scores[0][LENGTH]
        if self.shortest is None or ratio * self._straight() < path_length(self.shortest[0]):
            self.improved(self.encoding.decode(best)[0])

    def improve(self, vector: Floats, most: int) -> Floats:
        """Tighten a vector (d,) by a pattern search; the archive takes what it finds.  Gives the best scores (8,)."""
        left = min(most, self._budget() - self.evaluations)
        if left < 2:
            return np.asarray(self.evaluate(vector[None])[0])
        found, made = search_patterns(self.problem.search, self.encoding, vector, int(left))
        scores = self.evaluate(found)
        # What is found was counted when it was found.
        self.evaluations += made - len(found)
        return np.asarray(scores[0])

    def tighten(self, vector: Floats, rounds: int, scale: float, most: int) -> Floats:
        """Move all waypoints of a vector (d,) at once, then `improve` it.  Gives the best scores (8,)."""
        if self._budget() - self.evaluations < MAX_TIGHTENING:
            return self.improve(vector, most)
        moved, made = tighten(self.problem.search, self.encoding, vector, rounds, scale)
        self.evaluations += made
        return self.improve(moved, most)

    @property
    def shortens(self) -> bool:
        """Whether paths are shortened free of their intervals: not among zones, which shortening does not see."""
        return self.algorithm.tightened and not is_limited(self.problem.search.airspace)

    def shorten(self, path: Floats) -> bool:
        """Shorten a path (w, 3) and keep what comes of it if it is the shortest finished one; whether it is."""
        for spare in SPARES:
            if self._budget() - self.evaluations < MOST_MODELS:
                self.spent = True
                return False
            path, made = shorten_path(self.problem.search, path, spare=spare, pause=self.pause)
            self.evaluations += made
            if self.has_safe() and path_length(path) >= self.length_ratio() * self._straight():
                return False
            certificate = certify(self.problem, path)
            if self.finished(certificate):
                self.shortest = path, certificate
                if self.improved is not None:
                    self.improved(path)
                return True
        return False

    def over(self) -> bool:
        """Whether the search is to end now."""
        if self.spent or self.evaluations >= self._budget():
            self.ended = "budget"
        elif self.stop is not None:
            self.ended = self.stop() or "completed"
        return self.ended != "completed"

    def best_is_safe(self) -> bool:
        """Whether the best path yet violates nothing and is exposed to no missile."""
        return bool(safe(self.archive.scores[0]))

    def safe_already(self) -> bool:
        """Whether the first safe path was asked for, and is there."""
        if not self.first_safe or (self.shortest is None and not self.archive.feasible()):
            return False
        return self.shortest is not None or self.finished(self.best_certified()[1])

    def has_safe(self) -> bool:
        """Whether a path is known that violates nothing and is exposed to no missile."""
        return self.shortest is not None or (len(self.archive.scores) > 0 and self.best_is_safe())

    def _straight(self) -> float:
        return math.dist(self.problem.space.start, self.problem.space.destination)

    def length_ratio(self) -> float:
        """Length ratio of the best path yet."""
        ratio = float(self.archive.scores[0][LENGTH])
        if self.shortest is None:
            return ratio
        shortest = float(path_length(self.shortest[0])) / self._straight()
        return min(ratio, shortest) if self.best_is_safe() else shortest

    def finished(self, certificate: Certificate) -> bool:
        """Whether a path of this certificate is what the search is for."""
        return certificate.ok and certificate.kill_distance >= self.wanted

    def _budget(self) -> float:
        most = self.problem.scenario.planner.budget
        return math.inf if most is None else most

    def note(self) -> None:
        """Add the archive's best to the history."""
        best = self.archive.scores[0]
        violations = best[: len(Violation)]
        count = np.count_nonzero(violations) if self.algorithm.graded else violations.sum()
        safe_one = self.shortest is not None
        row = (self.length_ratio(), 0.0, 0.0) if safe_one else (best[LENGTH], best[KILL], float(count))
        self.history.append(row)

    def report(self, left: int) -> None:
        """Tell how far the search has come; left: generations that may follow."""
        if self.progress is not None:
            best = self.archive.scores[0]
            remark = f"length ratio {self.length_ratio():.4f}, kill exposure {best[KILL]:.3g}"
            if self.shortest is not None:
                remark = f"length ratio {self.length_ratio():.4f}, kill exposure 0"
            none_yet = self.shortest is None and violated(best)
            self.progress(self.done, self.done + left, "no feasible path yet" if none_yet else remark)

    def best_certified(self) -> tuple[Floats, Certificate]:
        """First of the archive that is certified and out of range; or certified and farthest; or the first.

        Of a search that is asked to end, the first few of the archive alone are looked at.
        """
        first: tuple[Floats, Certificate] | None = None
        exposed: tuple[Floats, Certificate] | None = None
        for number, vector in enumerate(self.archive.vectors):
            if number >= CERTIFICATES_AT_ONCE and self._asked_to_end():
                break
            path = np.ascontiguousarray(self.encoding.decode(vector[None])[0])
            certificate = self._certificate(vector, path)
            if certificate.ok and certificate.kill_distance >= CERTIFIED_KILL_MARGIN:
                return path, certificate
            first = first or (path, certificate)
            least = -math.inf if exposed is None else exposed[1].kill_distance
            if certificate.ok and certificate.kill_distance > least:
                exposed = (path, certificate)
        result = exposed or first
        if result is None:  # pragma: no cover - an archive is never empty after an attempt
            raise ScenarioError(
                f"{self.problem.scenario.name}: planner: nothing was evaluated",
                file=self.problem.scenario.name,
                field="planner",
            )
        return result

    def best_path(self) -> tuple[Floats, Certificate]:
        """The shortest of the certified path of the archive and of the shortened one."""
        found = self.best_certified()
        if self.shortest is None or (
            self.finished(found[1]) and path_length(found[0]) <= path_length(self.shortest[0])
        ):
            return found
        return self.shortest

    def _certificate(self, vector: Floats, path: Floats) -> Certificate:
        """Certificate of a vector's path: the same in all attempts, so it is made once."""
        key = vector.tobytes()
        known = self.certificates.get(key)
        if known is None:
            known = self.certificates[key] = certify(self.problem, path)
        return known
