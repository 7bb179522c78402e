"""Run many searches with one Gaussian each, from starts of many widths and places.

Only promising searches continue.

A single Gaussian follows one valley.  If a narrow gap leads to a better valley, a wider Gaussian does not find the gap,
but a start as wide as the gap does.  The width of the gap is unknown, so that starts are drawn with widths of all
orders of magnitude.  Each start is searched for a slice of evaluations, and continues as long as it is among the better
half of the searches that became equally narrow, by their results at that width (after the median rule of Golovin et
al., "Google Vizier", KDD 2017).  Half of the evaluations go to the best waiting search, so that it converges, too.

The Gaussian is adapted as in CMA-ES (Hansen and Ostermeier, "Completely derandomized self-adaptation in evolution
strategies", Evolutionary Computation 9, 2001; Hansen, "The CMA evolution strategy: a tutorial", arXiv:1604.00772), with
a Cholesky factor in place of its eigenvectors (Krause, Arbones and Igel, NIPS 2016).  Only ranks are used.
"""

import math
from collections.abc import Callable

import numpy as np

from planner.optimisers.box_search import BoxSearch
from planner.optimisers.linear_algebra import cholesky, covariance, multiply_by_lower
from world.arrays import Floats, Ints

# Minimum and maximum standard deviation of a start, as fractions of the box; drawn log-uniformly.
WIDTH_RANGE = 0.003, 0.3
# Standard deviation of the first start, as a fraction of the box.
FIRST_WIDTH = 0.2
# Number of evaluations of a slice, per variable.
SLICE_EVALUATIONS = 25
# Fraction of the searches that start from the centre of the box, where users put expected values; the other searches
# start anywhere.
CENTRE_START_FRACTION = 0.5
# Fraction of all evaluations after which a search waits unless it is the best.
MAX_EVALUATION_FRACTION = 0.1
# Number of first evaluations of equal rank after which a start is abandoned.
MAX_BLIND_START_EVALUATIONS = 100
# Number of later evaluations of equal rank after which a search is abandoned.
MAX_BLIND_EVALUATIONS = 1000
# Factor on the width of a search in each generation of equal rank.
NARROWING_FACTOR = 0.9
# Standard deviation at which a search has converged, as a fraction of the box.
CONVERGED_DEVIATION = 1e-10
# Ratio of the largest to the smallest standard deviation at which a search has converged.
MAX_DEVIATION_RATIO = 1e7


class Gaussian:
    """Gaussian in the unit box, reflected at its sides, with the best point that it has found.

    mean: (d,) centre of the first samples.
    deviation: standard deviation of the first samples, as a fraction of the box.
    population: number of samples per generation.
    scale: (d,) relative standard deviations of the variables at the start; None for equal ones.
    """

    def __init__(self, mean: Floats, deviation: float, population: int, scale: Floats | None = None) -> None:
        """Set the learning rates of CMA-ES for this population and number of variables.

        mean: (d,) centre of the first samples.
        deviation: standard deviation of the first samples.
        population: number of samples per generation.
        scale: (d,) factors on the deviation along each axis; None for 1.
        """
        size = mean.size
        self.mean, self.deviation, self.population = mean.copy(), deviation, population
        weights = np.log(population / 2.0 + 0.5) - np.log(np.arange(1, population // 2 + 1))
        self.weights = weights / weights.sum()
        parent_count = 1.0 / float((self.weights**2).sum())
        self._effective_parent_count = parent_count
        # Rates of table 1 of the tutorial.
        self._step_rate = (parent_count + 2.0) / (size + parent_count + 5.0)
        self._damping = 1.0 + 2.0 * max(0.0, math.sqrt((parent_count - 1.0) / (size + 1.0)) - 1.0) + self._step_rate
        self._path_rate = (4.0 + parent_count / size) / (size + 4.0 + 2.0 * parent_count / size)
        self._rank_one_rate = 2.0 / ((size + 1.3) ** 2 + parent_count)
        rate = 2.0 * (parent_count - 2.0 + 1.0 / parent_count) / ((size + 2.0) ** 2 + parent_count)
        self._rank_mu_rate = min(1.0 - self._rank_one_rate, rate)
        # Mean length of a vector of standard normal variables.
        self._expected_length = math.sqrt(size) * (1.0 - 1.0 / (4.0 * size) + 1.0 / (21.0 * size**2))
        self._matrix = np.diag(np.ones(size) if scale is None else scale**2)
        self._factor = cholesky(self._matrix, 0.0)
        self._step_path, self._path = np.zeros(size), np.zeros(size)
        self._draws: Floats = np.empty((0, size))
        self._generations = 0
        self._blind_evaluations, self._stalled_generations = 0, 0
        self.evaluations = 0
        self.is_done = False
        # The best point (d,) in the unit box and its scores (c,), once a generation has points of different rank.
        self.best: tuple[Floats, Floats] | None = None
        # Width and best scores after each slice.
        self.curve: list[tuple[float, Floats]] = []

    @property
    def width(self) -> float:
        """Root mean square of the standard deviations of the variables, as a fraction of the box."""
        return self.deviation * math.sqrt(float(np.diag(self._matrix).mean()))

    def draw(self, rng: np.random.Generator) -> Floats:
        """Draw a generation of points (population, d) in the unit box."""
        self._draws = rng.standard_normal((self.population, self.mean.size))
        return reflect_into_box(self.mean + self.deviation * multiply_by_lower(self._draws, self._factor))

    def update(self, points: Floats, scores: Floats, rank: Callable[[Floats], Ints], noise: Floats) -> None:
        """Update the Gaussian with its last generation of points (n, d) and their scores (n, c).

        rank: function that ranks scores, as for `BoxSearch`.
        noise: (n,) random numbers that break ties.

        If all points have the same rank, they show no direction. The Gaussian then only becomes narrower (once it has a
        best point), and it is done after too many such evaluations.
        """
        self.evaluations += len(points)
        ranks = rank(scores)
        if not ranks.any():
            self._blind_evaluations += len(points)
            self.deviation *= 1.0 if self.best is None else NARROWING_FACTOR
            self.is_done = self._blind_evaluations >= (
                MAX_BLIND_START_EVALUATIONS if self.best is None else MAX_BLIND_EVALUATIONS
            )
            return
        self._blind_evaluations = 0
        order = np.lexsort((noise, ranks))
        best_row = order[0]
        self._stalled_generations += 1
        if self.best is None or rank(np.stack([self.best[1], scores[best_row]]))[1] == 0:
            if self.best is None or not np.array_equal(self.best[1], scores[best_row]):
                self._stalled_generations = 0
            self.best = points[best_row].copy(), scores[best_row].copy()
        self._update_distribution(self._draws[order[: self.weights.size]])
        factor_diagonal = np.diag(self._factor)
        # Smaller generations learn less, so that more of them may pass without a better point.
        max_stalled_generations = 30 + round(60 * self.mean.size / self.population)
        max_deviation = self.deviation * math.sqrt(float(np.diag(self._matrix).max()))
        self.is_done = (
            max_deviation < CONVERGED_DEVIATION
            or float(factor_diagonal.max()) > MAX_DEVIATION_RATIO * float(factor_diagonal.min())
            or self._stalled_generations > max_stalled_generations
        )

    def _update_distribution(self, draws: Floats) -> None:
        """Update mean, deviation and covariance as CMA-ES does.

        draws: (m, d) standard normal numbers from which the better half of the last points was made, best first.
        """
        self._generations += 1
        steps = multiply_by_lower(draws, self._factor)
        mean_draw, mean_step = (self.weights[:, None] * draws).sum(axis=0), (self.weights[:, None] * steps).sum(axis=0)
        self.mean = reflect_into_box(self.mean + self.deviation * mean_step)
        rate = self._step_rate
        self._step_path = (1.0 - rate) * self._step_path + math.sqrt(
            rate * (2.0 - rate) * self._effective_parent_count
        ) * mean_draw
        length = math.sqrt(float((self._step_path**2).sum()))
        expected_length = self._expected_length * math.sqrt(1.0 - (1.0 - rate) ** (2 * self._generations))
        # The test h_sigma of the tutorial: a long step path stalls the path of the covariance.
        is_steady = float(length < (1.4 + 2.0 / (self.mean.size + 1.0)) * expected_length)
        rate = self._path_rate
        path_factor = is_steady * math.sqrt(rate * (2.0 - rate) * self._effective_parent_count)
        self._path = (1.0 - rate) * self._path + path_factor * mean_step
        size, parent_count = self.mean.size, self.weights.size
        rank_mu_update = covariance(np.sqrt(self.weights * parent_count)[:, None] * steps, 0, 0, size)
        rank_one_update = np.outer(self._path, self._path) + (1.0 - is_steady) * rate * (2.0 - rate) * self._matrix
        decay = 1.0 - self._rank_one_rate - self._rank_mu_rate
        self._matrix = (
            decay * self._matrix + self._rank_one_rate * rank_one_update + self._rank_mu_rate * rank_mu_update
        )
        self._factor = cholesky(self._matrix, 0.0)
        self.deviation *= math.exp(min(1.0, self._step_rate / self._damping * (length / self._expected_length - 1.0)))


class Multistart(BoxSearch):
    """Many searches with one Gaussian each, from starts of many places and widths.

    The searches share the evaluations, in slices: after each slice the same search continues, or another one gets its
    turn.

    The arguments are the same as for `BoxSearch`; population is the largest generation, reached after many starts.
    First samples, if given, are evaluated first; the mean and the deviations of their better half replace the centre of
    the box and its scale.

    samples and scores are the best sample of all and the last generation, (n, d) and (n, c), best first; empty before
    the first `tell`.

    >>> def rank(scores):
    ...     return np.argsort(np.argsort(scores[:, 0]))
    >>> search = Multistart(np.full(3, -2.0), np.full(3, 6.0), rank, 40, np.random.default_rng(1))
    >>> for generation in range(200):
    ...     samples = search.ask()
    ...     search.tell((samples**2).sum(axis=1)[:, None])
    >>> bool(search.scores.min() < 1e-6)
    True
    """

    def __init__(
        self,
        lower: Floats,
        upper: Floats,
        rank: Callable[[Floats], Ints],
        population: int,
        rng: np.random.Generator,
        *,
        initial: Floats | None = None,
    ) -> None:
        """Start the first search if there are no first samples.

        lower, upper: (d,) box.
        rank: function of scores (n, c) that returns their ranks (n,); smaller is better.
        population: size of the largest generation.
        rng: generator of random numbers.
        initial: (n, d) first samples, which are evaluated before the first search; None for none.
        """
        super().__init__(lower, upper, rank, population, rng, initial=initial)
        self._population = population
        self._centre, self._scale = np.full(lower.size, 0.5), None
        self._searches: list[Gaussian] = []
        # Evaluations at the beginning of the slice; evaluations spent on new starts and on continued searches.
        self._slice_start, self._is_continued = 0, False
        self._spent_evaluations = {False: 0, True: 0}
        self._search: Gaussian | None = None
        if initial is None:
            self._search = self._start_search()
            self._draw_generation(self._search)

    def tell(self, scores: Floats) -> None:
        """Process the scores (n, c) of the last samples of `ask`, and draw the next generation.

        The best sample of all is kept. The search that drew the samples is updated. At the end of its slice of
        evaluations, the same search continues or another one gets the next slice. The scores of first samples, which
        no search has drawn, set the centre and the scale of all searches instead.
        """
        ranks, noise = self._rank(scores), self._rng.random(len(scores))
        order = np.lexsort((noise, ranks))
        # The best sample of all generations, then this generation.
        points, sorted_scores = self._pending_samples[order], scores[order]
        if len(self.scores) and self._rank(np.stack([self.scores[0], sorted_scores[0]]))[0] == 0:
            points = np.concatenate([self.samples[:1], points])
            sorted_scores = np.concatenate([self.scores[:1], sorted_scores])
        self.samples, self.scores = points, sorted_scores
        if self._search is None:
            better_half = (self._pending_samples[order[: self._half]] - self.lower) / (self.upper - self.lower)
            self._centre, deviations = better_half.mean(axis=0), np.maximum(better_half.std(axis=0), WIDTH_RANGE[0])
            self._scale = deviations / math.sqrt(float((deviations**2).mean()))
            self._search = self._start_search()
        else:
            self._search.update(self._pending_unit_samples, scores, self._rank, noise)
            if (
                self._search.is_done
                or self._search.evaluations - self._slice_start >= SLICE_EVALUATIONS * self.lower.size
            ):
                # The next slice of evaluations continues this search, or goes to another one, so that new and continued
                # searches share the evaluations equally: the best waiting search, or a new search.
                spent_evaluations = self._spent_evaluations
                spent_evaluations[self._is_continued] += self._search.evaluations - self._slice_start
                if not self._may_continue(self._search):
                    waiting = [search for search in self._searches if search.curve and not search.is_done]
                    self._is_continued = bool(waiting) and spent_evaluations[True] <= spent_evaluations[False]
                    if self._is_continued:
                        waiting_ranks = self._rank(np.stack([search.curve[-1][1] for search in waiting]))
                        self._search = waiting[int(np.argmin(waiting_ranks))]
                    else:
                        self._search = self._start_search()
                self._slice_start = self._search.evaluations
        self._draw_generation(self._search)

    def _draw_generation(self, search: Gaussian) -> None:
        """Draw the next generation of a search; store it scaled to the unit box and to the search box."""
        self._pending_unit_samples = search.draw(self._rng)
        self._pending_samples = np.clip(
            self.lower + self._pending_unit_samples * (self.upper - self.lower), self.lower, self.upper
        )

    def _may_continue(self, search: Gaussian) -> bool:
        """Return True if a search may continue at once with another slice of evaluations.

        It must be in the better half of the searches that have reached the same width, by their results at that width.
        The best search of all always waits for its turn, so that half of the evaluations go to other searches. A search
        also waits if it is done, is the only one, or has used more than `MAX_EVALUATION_FRACTION` of all evaluations.

        The width and the best scores of the search are added to its curve, unless it has found nothing yet.
        """
        if search.best is None:
            return False
        search.curve.append((search.width, search.best[1]))
        other_curves = [
            other_search.curve for other_search in self._searches if other_search is not search and other_search.curve
        ]
        if (
            search.is_done
            or not other_curves
            or search.evaluations > MAX_EVALUATION_FRACTION * sum(self._spent_evaluations.values())
        ):
            return False
        if self._rank(np.stack([search.best[1], *(curve[-1][1] for curve in other_curves)]))[0] == 0:
            return False
        other_scores = [
            next((scores for width, scores in curve if width <= search.width), None) for curve in other_curves
        ]
        equally_narrow_scores = [scores for scores in other_scores if scores is not None]
        ranks = self._rank(np.stack([search.best[1], *equally_narrow_scores]))
        return 2 * int((ranks[1:] < ranks[0]).sum()) <= len(equally_narrow_scores)

    def _start_search(self) -> Gaussian:
        """Start a search: the first one at the centre with a typical width, later ones at random.

        Later searches have a random width and generation size, and start at the centre or at a random place.
        """
        size = self.lower.size
        min_population = min(self._population, 4 + int(3.0 * math.log(size)))
        if not self._searches:
            search = Gaussian(self._centre, FIRST_WIDTH, min_population, self._scale)
        else:
            min_log, max_log = (math.log(width) for width in WIDTH_RANGE)
            width = math.exp(self._rng.uniform(min_log, max_log))
            mean = self._centre if self._rng.random() < CENTRE_START_FRACTION else self._rng.random(size)
            # The size of generations grows with the number of starts.
            growth = max(1.0, min(self._population / min_population, 1.0 + len(self._searches) / 4.0))
            search = Gaussian(mean, width, int(min_population * growth ** self._rng.random()), self._scale)
        self._searches.append(search)
        return search


def reflect_into_box(points: Floats) -> Floats:
    """Reflect points (n, d) or (d,) at the sides of the unit box until they are inside."""
    folded_points = np.mod(points, 2.0)
    return np.where(folded_points > 1.0, 2.0 - folded_points, folded_points)
