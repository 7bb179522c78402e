"""Hold the state of a search.

It has scores, an archive of the best paths, an evaluation budget and a stop condition.

`Search` is the interface that seeding and generations share. It scores paths, keeps the best in an `Archive`, counts
evaluations against the budget, applies local searches, and decides when the search is finished.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from planner.airspace.zone_limits import is_limited
from planner.evaluation.airspace_scores import count_airspace_violations
from planner.evaluation.certify import certify
from planner.evaluation.encoding import Encoding, rotated_vectors
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import CERTIFIED_KILL_MARGIN_M, Problem
from planner.optimisers.preference import NO_GOAL, Level, ranks
from planner.plan import Certificate, Objective, Violation
from planner.search.algorithms import Algorithm
from planner.seeding.pattern_search import search_patterns
from planner.seeding.shortening import MAX_MODELS, resample, shorten_path
from planner.seeding.side_routes import closest_places
from planner.seeding.waypoint_fitting import move_all_waypoints
from world.arrays import Flags, Floats, Ints
from world.errors import ScenarioError
from world.geometry import path_length

# --- Scores: one row per path, violations followed by objectives ---


SCORE_COLUMNS = len(Violation) + len(Objective)
# Columns of the objectives in a row of scores.
LENGTH = len(Violation) + Objective.LENGTH_RATIO
KILL = len(Violation) + Objective.KILL_EXPOSURE
DETECTION = len(Violation) + Objective.DETECTION_EXPOSURE
HEIGHT = len(Violation) + Objective.HEIGHT_SUM
CONSTRAINTS = Level(tuple(Violation), (0.0,) * len(Violation))
# Order of the archive: feasible paths first, then the lowest kill exposure, then the shortest.
ARCHIVE_LEVELS = (CONSTRAINTS, Level((KILL,), (NO_GOAL,)), Level((LENGTH,), (NO_GOAL,)))


def score_table(violations: NDArray[np.generic], objectives: Floats) -> Floats:
    """Join violations (n, 4) and objectives (n, 4) into a table of scores (n, 8)."""
    return np.concatenate([violations.astype(np.float64), objectives], axis=1)


def no_scores() -> Floats:
    """Return an empty table of scores, (0, 8)."""
    return np.empty((0, SCORE_COLUMNS))


def are_violated(scores: Floats) -> Flags:
    """Return a mask (...,) of the paths whose scores (..., 8) show a violated constraint."""
    return np.asarray(scores[..., : len(Violation)].any(axis=-1))


def are_safe(scores: Floats) -> Flags:
    """Return a mask (...,) of the paths without violation and without exposure to missiles.

    The scores have the shape (..., 8).
    """
    return np.asarray(~are_violated(scores) & ~(scores[..., KILL] > 0.0))


def best_first(scores: Floats) -> Ints:
    """Return the rows of scores (n, 8) in the order of the archive, best first; the sort is stable."""
    return np.argsort(ranks(scores, ARCHIVE_LEVELS), kind="stable")


SearchProgress = Callable[[int, int, str], None]
StopCondition = Callable[[], str]
Improved = Callable[[Floats], None]
# Route (k, 3), m, over each searched lattice, and the number of states expanded; by the index of the lattice, and by
# whether its search was guided.
LatticeRoutes = dict[tuple[int, bool], tuple[Floats, int]]

# Maximum number of paths in an archive.
ARCHIVE_SIZE = 24
# Additional margins to spheres and ground, m, with which a path is shortened until it is certified.
EXTRA_MARGINS_M = (0.1, 2.0)
# Additional margins, m, of further attempts from the first path, with corners as flown, if legs must hold their turns.
CORNER_MARGINS_M = (2.0, 5.0)
# Additional margins of slopes, rad, of last attempts with a path that fails only by its slopes: if a leg climbs at the
# limit, shortening ends some hundredths of a degree beyond it.
SLOPE_MARGINS_RAD = (math.radians(0.2), math.radians(0.6))
# Distance to missiles, m, that a shortened path may lack to be tried with larger margins; these add at most this
# distance.
MAX_MISSING_DISTANCE_M = max(*EXTRA_MARGINS_M, *CORNER_MARGINS_M)
# Distance from missiles in addition to the certificate's margin, m, in gaps too narrow for the search's usual margin.
NARROW_KILL_MARGIN_M = 1.0
# Maximum height in addition to the clearance of a search for which the usual height leaves no path, m. With a tracking
# error of 10 m, only ground steeper than 75 degrees requires more.
LOW_BUFFER_M = 60.0
# Shortening by which a path must improve the best path to pass missiles more closely than usual, as a fraction.
NARROW_GAIN_FRACTION = 0.002
# Evaluations that must be left for `move_all_waypoints`; otherwise it is skipped.
MIN_MOVE_BUDGET = 600
# Waypoints evaluated between two checks of the stop condition: some 10 ms.
WAYPOINTS_PER_CHECK = 4000
# Checks after which a stopped search ends even if it has not found its first route: some 100 ms.
GRACE_CHECKS = 10
# Certificates made before the stop condition is checked: some 10 ms if none passes.
CERTIFICATES_PER_CHECK = 4


def with_narrow_margins(problem: Problem) -> Problem:
    """Return a problem whose search may pass missiles at little more than the certificate's margin.

    The lateral tracking error and the reserve for gusts are still kept.
    """
    data = problem.search
    margin = data.tracking.across + problem.certified.kill_margin + NARROW_KILL_MARGIN_M
    return replace(problem, search=data._replace(kill_margin=min(data.kill_margin, margin)))


def with_low_buffer(problem: Problem) -> Problem:
    """Return a problem whose search keeps at most `LOW_BUFFER_M` in addition to the clearance.

    The usual buffer includes the rise of the map's steepest ground across the tracking error. A single cliff may
    therefore close the whole map, although the certificate considers the ground only where a path passes it.
    """
    data = problem.search
    low_data = data._replace(
        buffer=min(data.buffer, LOW_BUFFER_M),
        start_buffer=min(data.start_buffer, LOW_BUFFER_M),
        destination_buffer=min(data.destination_buffer, LOW_BUFFER_M),
    )
    return replace(problem, search=low_data)


class SearchEnded(Exception):
    """Raised within a search to stop it; the search's archive contains the results."""


@dataclass(slots=True)
class Archive:
    """Best of all evaluated paths, best first: vectors (k, d) and scores (k, 8)."""

    vectors: Floats
    scores: Floats

    def is_feasible(self) -> bool:
        """Return True if the best path meets the constraints; False if the archive is empty."""
        return len(self.scores) > 0 and not are_violated(self.scores[0])

    def insert(self, vectors: Floats, scores: Floats) -> None:
        """Insert new paths in the order of their rank; of equal paths, older ones stay first.

        vectors, scores: (n, d) paths and (n, 8) their scores.

        Once a path is feasible, infeasible paths are dropped, because there may be thousands of them to rank. A full
        archive accepts only paths that are better than its last path.
        """
        is_kept = ~are_violated(scores)
        if self.is_feasible():
            if len(self.scores) == ARCHIVE_SIZE:
                last_scores = self.scores[-1]
                is_shorter = (scores[:, KILL] == last_scores[KILL]) & (scores[:, LENGTH] < last_scores[LENGTH])
                is_kept &= is_shorter | (scores[:, KILL] < last_scores[KILL])
            if not is_kept.any():
                return
        elif is_kept.any():
            self.vectors, self.scores = self.vectors[:0], self.scores[:0]
        all_scores = np.concatenate([self.scores, scores[is_kept] if is_kept.any() else scores])
        all_vectors = np.concatenate([self.vectors, vectors[is_kept] if is_kept.any() else vectors])
        order = best_first(all_scores)[:ARCHIVE_SIZE]
        self.vectors, self.scores = all_vectors[order], all_scores[order]


@dataclass(slots=True)
class Search:
    """State shared by all attempts of a search.

    problem: the problem with the margins of the current attempt.
    algorithm, encoding, rng: settings and random generator of the search.
    progress: called with the number of generations done, the total number, and a short text.
    stop_condition: called after each generation and each start; a returned text ends the search and gives the reason.
    first_safe: True to end with the first safe path.
    required_distance: distance (m) from missiles that the certificate of a finished path requires.
    improved: called with each path (w, 3) that meets the constraints and is better than all earlier ones.
    archive: the best paths.
    evaluations: paths evaluated, or equivalent work.
    legs: legs evaluated between candidates for single waypoints.
    done: generations done.
    end_reason: reason why the search ended.
    history: per generation, length ratio, kill exposure and violations of the best path.
    certificates: certificates by the path's vector.
    shortest: the shortest finished path (w, 3) from shortening and its certificate; its waypoints need not lie in their
        intervals.
    furthest_shortened: the certified path (w, 3) from shortening that is furthest from missiles among those outside all
        spheres but closer than the goal allows, and its certificate.
    narrow_places: places (3,) where shortened paths remain too close to missiles, deepest first for each path.
    budget_exhausted: True if the budget is too small for another shortening.
    is_closed: True if it is proven that no safe path exists.
    grace: number of further calls of `check_stop` that a stopped search without a result is allowed.
    lattice_routes: routes over lattices that were found so far; searches of the same problem share them.
    """

    problem: Problem
    algorithm: Algorithm
    encoding: Encoding
    rng: np.random.Generator
    progress: SearchProgress | None
    stop_condition: StopCondition | None
    first_safe: bool
    required_distance: float
    improved: Improved | None = None
    archive: Archive = field(init=False)
    evaluations: int = 0
    legs: int = 0
    done: int = 0
    end_reason: str = "completed"
    history: list[tuple[float, float, float]] = field(default_factory=list)
    certificates: dict[bytes, Certificate] = field(default_factory=dict)
    shortest: tuple[Floats, Certificate] | None = None
    narrow_places: list[Floats] = field(default_factory=list)
    furthest_shortened: tuple[Floats, Certificate] | None = None
    budget_exhausted: bool = False
    is_closed: bool = False
    grace: int = GRACE_CHECKS
    lattice_routes: LatticeRoutes = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Create an empty archive."""
        self.archive = Archive(np.empty((0, self.encoding.lower.size)), no_scores())

    def score(self, vectors: Floats) -> Floats:
        """Return the scores (n, 8) of vectors (n, d); the archive and the budget stay unchanged."""
        paths = np.ascontiguousarray(self.encoding.decode(vectors))
        data = self.problem.search
        if self.algorithm.graded:
            return score_table(*graded_scores(data, paths))
        counts, objectives = paper_scores(data, paths)
        if is_limited(data.airspace):
            counts[:, Violation.BOUNDS] += count_airspace_violations(data, paths)
        return score_table(counts, objectives)

    def evaluate(self, vectors: Floats) -> Floats:
        """Return the scores (n, 8) of vectors (n, d), and insert them into the archive.

        Raises SearchEnded if the search is asked to stop.
        """
        batch_size, scores = max(1, WAYPOINTS_PER_CHECK // self.encoding.waypoints), no_scores()
        for batch_start in range(0, len(vectors), batch_size):
            scores = np.concatenate([scores, self.score(vectors[batch_start : batch_start + batch_size])])
            if len(scores) < len(vectors) and self.should_stop():
                break
        self.evaluations += len(scores)
        old_best = self.archive.vectors[:1]
        self.archive.insert(vectors[: len(scores)], scores)
        new_best = self.archive.vectors[:1]
        if self.improved is not None and self.archive.is_feasible() and not np.array_equal(old_best, new_best):
            ratio = self.archive.scores[0][LENGTH]
            if self.shortest is None or ratio * self._straight_length() < path_length(self.shortest[0]):
                self.improved(self.encoding.decode(new_best)[0])
        if len(scores) < len(vectors):
            raise SearchEnded
        return scores

    def check_stop(self) -> None:
        """Raise SearchEnded if the search has been asked to stop.

        A search without a result may continue for the next few calls to find its first route. If it finds none, the
        straight line becomes its result.
        """
        if not self.should_stop():
            return
        if not len(self.archive.scores):
            self.grace -= 1
            if self.grace > 0:
                return
            self.evaluate(self.straight_vectors())
        raise SearchEnded

    def straight_vectors(self, *, has_equal_legs: bool = False) -> Floats:
        """Return the straight line from start to destination as a vector (1, d) of the rotated encoding.

        has_equal_legs: True for legs of equal length. False for waypoints in the middle of their intervals, so that the
            first and last leg have half the length of the others.
        """
        encoding, space = self.encoding, self.problem.space
        edges = encoding.lower[0::3], encoding.upper[0::3]
        fractions = 0.5 * (edges[0] + edges[1]) / edges[1][-1]
        if has_equal_legs:
            fractions = np.arange(1, encoding.waypoints - 1) / (encoding.waypoints - 1)
        path = space.start + np.concatenate([[0.0], fractions, [1.0]])[:, None] * (space.destination - space.start)
        return rotated_vectors(space, encoding, path[None])

    def should_stop(self) -> bool:
        """Return True if there is a reason to stop the search, and record the reason."""
        reason = self.stop_condition() if self.stop_condition is not None else ""
        self.end_reason = reason or self.end_reason
        return bool(reason)

    def improve(self, vector: Floats, max_evaluations: int) -> Floats:
        """Improve a vector (d,) by a pattern search; insert the result in the archive; return its scores (8,).

        max_evaluations: maximum number of evaluations.

        If the budget allows less than two evaluations, the vector is only evaluated.
        """
        evaluation_limit = min(max_evaluations, self._evaluation_budget() - self.evaluations)
        if evaluation_limit < 2:
            return np.asarray(self.evaluate(vector[None])[0])
        vectors, evaluations = search_patterns(
            self.problem.search, self.encoding, vector, int(evaluation_limit), self.should_stop
        )
        scores = self.evaluate(vectors)
        # The pattern search has already included these vectors in its evaluations.
        self.evaluations += evaluations - len(vectors)
        return np.asarray(scores[0])

    def move_and_improve(self, vector: Floats, rounds: int, scale: float, max_evaluations: int) -> Floats:
        """Move all waypoints of a vector (d,) at once, then `improve` it; return the resulting scores (8,).

        If the budget is almost used up, the vector is only improved. `max_evaluations` limits `improve`.

        rounds, scale: number and relative size of the moves, as in `move_all_waypoints`.
        """
        if self._evaluation_budget() - self.evaluations < MIN_MOVE_BUDGET:
            return self.improve(vector, max_evaluations)
        moved_vector, evaluations = move_all_waypoints(self.problem.search, self.encoding, vector, rounds, scale)
        self.evaluations += evaluations
        return self.improve(moved_vector, max_evaluations)

    @property
    def can_shorten(self) -> bool:
        """True if shortening may move waypoints out of their intervals; False if there are zones.

        Shortening ignores zones.
        """
        return self.algorithm.final_shortening and not is_limited(self.problem.search.airspace)

    def shorten(self, path: Floats) -> bool:
        """Shorten a path (w, 3); keep the result and return True if it is the shortest finished path.

        A path is finished if it is certified and has the required distance from missiles. A shortened path that is not
        finished is shortened again with larger margins: first with margins to spheres and ground, then with corners as
        flown, last with margins of slopes. Shortening is given up as soon as the result is longer than the best path,
        lies too far inside a missile's margin, or the budget is used up.
        """
        data = self.problem.search
        # Additional margin, m; True to model the corners as flown; additional margin of slopes, rad.
        attempts = [(margin, False, 0.0) for margin in EXTRA_MARGINS_M]
        if data.legs_hold_turns:
            attempts += [(margin, True, 0.0) for margin in CORNER_MARGINS_M]
        attempts += [(EXTRA_MARGINS_M[-1], False, slope_margin) for slope_margin in SLOPE_MARGINS_RAD]
        first_path, certificate = path, None
        for extra_margin, corners_too, slope_margin in attempts:
            path = first_path if corners_too else path
            if slope_margin > 0.0:
                # Such a margin helps only a path that violates the slope limits and nothing else, missiles' margins
                # included.
                if certificate is None or not certificate.slope < 0.0:
                    break
                other_margins = replace(certificate, slope=0.0).margins
                keeps_distance = certificate.kill_distance >= self.required_distance
                if not keeps_distance or not all(margin >= 0.0 for margin in other_margins):
                    break
            if self._evaluation_budget() - self.evaluations < MAX_MODELS:
                self.budget_exhausted = True
                return False
            # Keep the same problem if possible: a new one must be laid out in memory for kernels again.
            stricter_data = data._replace(angle_margin=data.angle_margin + slope_margin) if slope_margin > 0.0 else data
            path, evaluations = shorten_path(
                stricter_data, path, extra_margin=extra_margin, corners_too=corners_too, check_stop=self.check_stop
            )
            self.evaluations += evaluations
            if self.has_safe() and path_length(path) >= self.length_ratio() * self._straight_length():
                return False
            certificate = certify(self.problem, path)
            if self.keep_if_finished(path, certificate):
                return True
            least_distance = 0.0 if self.furthest_shortened is None else self.furthest_shortened[1].kill_distance
            if certificate.ok and certificate.kill_distance > least_distance:
                self.furthest_shortened = path, certificate
            if certificate.kill_distance < self.required_distance - MAX_MISSING_DISTANCE_M:
                break
        self.narrow_places += list(closest_places(data, path, self.required_distance + data.tracking.across))
        # Shorten the path once more, from equal legs, and then with narrow margins, if it is clearly shorter than the
        # best safe path. Without a safe path nothing is done, because the search then tries narrow margins later.
        if not self.has_safe():
            return False
        max_length = (1.0 - NARROW_GAIN_FRACTION) * self.length_ratio() * self._straight_length()
        for problem in (self.problem, with_narrow_margins(self.problem)):
            if path_length(path) >= max_length:
                break
            if self._evaluation_budget() - self.evaluations < MAX_MODELS:
                self.budget_exhausted = True
                break
            path, evaluations = shorten_path(problem.search, resample(path, len(path)), check_stop=self.check_stop)
            self.evaluations += evaluations
            if path_length(path) < max_length and self.keep_if_finished(path, certify(self.problem, path)):
                return True
        return False

    def keep_if_finished(self, path: Floats, certificate: Certificate) -> bool:
        """If a path (w, 3) meets the goal, store it as the shortest path, report it, and return True."""
        if not self.meets_goal(certificate):
            return False
        self.shortest = path, certificate
        if self.improved is not None:
            self.improved(path)
        return True

    def must_end(self) -> bool:
        """Return True if the search is stopped or its budget is exhausted, and record the reason."""
        if self.budget_exhausted or self.evaluations >= self._evaluation_budget():
            self.end_reason = "budget"
        elif self.stop_condition is not None:
            self.end_reason = self.stop_condition() or "completed"
        return self.end_reason != "completed"

    def best_is_safe(self) -> bool:
        """Return True if the best path in the archive violates nothing and is not exposed to missiles."""
        return bool(are_safe(self.archive.scores[0]))

    def first_safe_found(self) -> bool:
        """Return True if the search ends with the first safe path and has found one."""
        if not self.first_safe or (self.shortest is None and not self.archive.is_feasible()):
            return False
        return self.shortest is not None or self.meets_goal(self.best_certified()[1])

    def has_safe(self) -> bool:
        """Return True if a path is known that violates nothing and is not exposed to missiles."""
        return self.shortest is not None or (len(self.archive.scores) > 0 and self.best_is_safe())

    def _straight_length(self) -> float:
        """Return the distance between start and destination, m."""
        return math.dist(self.problem.space.start, self.problem.space.destination)

    def length_ratio(self) -> float:
        """Return the length of the best path, divided by the straight distance.

        The best path is the shorter of two: the archive's best path, if it is safe, and the shortest finished path.
        """
        ratio = float(self.archive.scores[0][LENGTH])
        if self.shortest is None:
            return ratio
        shortened_ratio = float(path_length(self.shortest[0])) / self._straight_length()
        return min(ratio, shortened_ratio) if self.best_is_safe() else shortened_ratio

    def meets_goal(self, certificate: Certificate) -> bool:
        """Return True if a path meets the goal: it is certified, at the required distance from missiles."""
        return certificate.ok and certificate.kill_distance >= self.required_distance

    def _evaluation_budget(self) -> float:
        """Return the maximum number of evaluations; inf if the scenario states none."""
        budget = self.problem.scenario.planner.budget
        return math.inf if budget is None else budget

    def record_history(self) -> None:
        """Append length ratio, kill exposure and violations of the best path to the history.

        With graded scores the kinds of violations are counted, otherwise all violations.
        """
        best_scores = self.archive.scores[0]
        violations = best_scores[: len(Violation)]
        count = np.count_nonzero(violations) if self.algorithm.graded else violations.sum()
        has_shortened = self.shortest is not None
        row = (
            (self.length_ratio(), 0.0, 0.0) if has_shortened else (best_scores[LENGTH], best_scores[KILL], float(count))
        )
        self.history.append(row)

    def report_progress(self, remaining_generations: int) -> None:
        """Report the progress and the best path to `progress`.

        remaining_generations: number of generations that may follow.
        """
        if self.progress is not None:
            best_scores = self.archive.scores[0]
            remark = f"{self.length_ratio():.4f} times the straight line, kill exposure {best_scores[KILL]:.3g}"
            if self.shortest is not None:
                remark = f"{self.length_ratio():.4f} times the straight line, kill exposure 0"
            is_infeasible = self.shortest is None and are_violated(best_scores)
            self.progress(
                self.done, self.done + remaining_generations, "no feasible path yet" if is_infeasible else remark
            )

    def report_path(self, path: Floats, certificate: Certificate) -> None:
        """Report a path (w, 3) from outside the search's archive to `progress`, if it meets the goal."""
        if self.progress is not None and self.meets_goal(certificate):
            ratio = float(path_length(path)) / self._straight_length()
            self.progress(self.done, self.done, f"{ratio:.4f} times the straight line, kill exposure 0")

    def best_certified(self) -> tuple[Floats, Certificate]:
        """Return the best certified path in the archive, and its certificate.

        The certificate has the full kill margin.

        Without such a path, return the certified path furthest from missiles, or the best path if none is certified. A
        search that is asked to stop examines only the first few paths.
        """
        first_path: tuple[Floats, Certificate] | None = None
        furthest_path: tuple[Floats, Certificate] | None = None
        for index, vector in enumerate(self.archive.vectors):
            if index >= CERTIFICATES_PER_CHECK and self.should_stop():
                break
            path = np.ascontiguousarray(self.encoding.decode(vector[None])[0])
            # The certificate is the same in all attempts.
            key = vector.tobytes()
            certificate = self.certificates.get(key)
            if certificate is None:
                certificate = self.certificates[key] = certify(self.problem, path)
            if certificate.ok and certificate.kill_distance >= CERTIFIED_KILL_MARGIN_M:
                return path, certificate
            first_path = first_path or (path, certificate)
            max_distance = -math.inf if furthest_path is None else furthest_path[1].kill_distance
            if certificate.ok and certificate.kill_distance > max_distance:
                furthest_path = (path, certificate)
        result = furthest_path or first_path
        if result is None:  # pragma: no cover - an archive is never empty after an attempt
            raise ScenarioError(
                f"{self.problem.scenario.name}: planner: nothing was evaluated",
                file=self.problem.scenario.name,
                field="planner",
            )
        return result

    def best_path(self) -> tuple[Floats, Certificate]:
        """Return the better of the archive's best path and the shortened path, and its certificate.

        The shortened path is better if it is shorter, or if only it meets the goal. If neither path meets the goal, a
        certified path is better, and of two certified paths the one further from missiles.
        """
        path, certificate = self.best_certified()
        if self.shortest is None and self.furthest_shortened is not None and not self.meets_goal(certificate):
            is_further = self.furthest_shortened[1].kill_distance > certificate.kill_distance
            return self.furthest_shortened if is_further or not certificate.ok else (path, certificate)
        if self.shortest is None or (
            self.meets_goal(certificate) and path_length(path) <= path_length(self.shortest[0])
        ):
            return path, certificate
        return self.shortest
