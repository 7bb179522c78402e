"""Minimise any black-box function with the planner's optimisers, by an ask/tell interface."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from planfly.arguments import RANGES, check_arguments
from planner.optimisers.differential_evolution import DifferentialEvolution
from planner.optimisers.emna import Emna
from planner.optimisers.multistart import Multistart
from planner.optimisers.partial_resampling import PartialResampling
from planner.optimisers.preference import NO_GOAL, Level, ranks
from planner.optimisers.umda import Umda
from world.argument_types import checks_types
from world.arrays import Floats
from world.errors import ArgumentError

# "umda" uses independent Gaussians, as in the paper; "emna" one Gaussian with full covariance; "multistart" Gaussians
# with full covariance from many starts; "partial" redraws a part of the variables of each point; "differential" is
# differential evolution, which is not an EDA and is included for comparison.
Model = Literal["umda", "emna", "multistart", "partial", "differential"]
# Optimiser class of each model.
_MODELS = {
    "umda": Umda,
    "emna": Emna,
    "multistart": Multistart,
    "partial": PartialResampling,
    "differential": DifferentialEvolution,
}


@dataclass(frozen=True, slots=True, eq=False)
class BestFound:
    """A point with its objective values and constraint violations.

    x: the point, (d,).
    values: values of the objectives, (m,).
    violations: violations of the constraints, (v,), 0 if met; empty without constraints.
    """

    x: Floats
    values: Floats
    violations: Floats

    @property
    def value(self) -> float:
        """Value of the first objective."""
        return float(self.values[0])

    @property
    def feasible(self) -> bool:
        """True if all constraints are met."""
        return not (self.violations > 0.0).any()


class Optimiser:
    """Optimiser of a function within a box, made by `planfly.optimise`.

    `ask` returns points to evaluate, and `tell` takes the values of the function at these points.
    """

    def __init__(
        self,
        lower: Floats,
        upper: Floats,
        model: Model,
        population: int,
        rng: np.random.Generator,
        initial: Floats | None,
    ) -> None:
        """Start a search; see `optimise` for the arguments."""
        self._scores: Floats = np.empty((0, 0))
        self._points: Floats = np.empty((0, lower.size))
        self._levels: tuple[Level, ...] = ()
        self._violation_count = 0
        self._max_points = population
        # True if the caller knows the points whose values `tell` takes.
        self._is_asked = initial is not None
        self._search = _MODELS[model](
            lower, upper, lambda scores: ranks(scores, self._levels), population, rng, initial=initial
        )
        self.evaluations = 0

    def ask(self) -> Floats:
        """Return points in the box to evaluate, (n, d).

        The first call returns the whole population, later calls return half of it.  "multistart" returns as many points
        as the current generation of its search has, and "partial" as many as its population has, or as the Gaussian
        that refines its best point draws.
        """
        self._is_asked = True
        return np.array(self._search.ask())

    def tell(self, values: ArrayLike, violations: ArrayLike | None = None) -> None:
        """Receive the values of the points from `ask`, and draw the next points from the better half.

        The first call may give the values of the points `initial`, without an earlier call of `ask`.

        values: values to minimise, (n,), or (n, m) for m objectives, which are compared by Pareto dominance.
        violations: amount by which each constraint is violated, (n,) or (n, v), 0 or less if the constraint is met; a
        smaller violation takes precedence over values.

        NaN is treated as the worst value.

        Raises ArgumentError if `ask` was not called since the last values, if the number of rows differs from the
        number of points that `ask` returned, or if the number of columns differs from the previous call.
        """
        if not self._is_asked:
            raise ArgumentError.of_argument(
                "values", values, "call ask() first; it returns the points to evaluate", shown=""
            )
        points = self._search.ask()
        objective_values = _parse_columns("values", values, len(points))
        violation_values = (
            np.empty((len(points), 0)) if violations is None else _parse_columns("violations", violations, len(points))
        )
        if not objective_values.shape[1]:
            raise ArgumentError.of_argument("values", values, "no columns; expected one for each objective", shown="")
        scores = np.concatenate([np.maximum(violation_values, 0.0), objective_values], axis=1)
        if self._levels and (
            scores.shape[1] != self._scores.shape[1] or violation_values.shape[1] != self._violation_count
        ):
            allowed = "the numbers of columns differ from the previous call"
            raise ArgumentError.of_argument("values, violations", values, allowed, shown="")
        if not self._levels:
            self._violation_count = violation_values.shape[1]
            # Constraints with the goal 0, then objectives.
            constraints, objectives = violation_values.shape[1], objective_values.shape[1]
            levels = (Level(tuple(range(constraints, constraints + objectives)), (NO_GOAL,) * objectives),)
            self._levels = (Level(tuple(range(constraints)), (0.0,) * constraints), *levels) if constraints else levels
            self._scores = np.empty((0, scores.shape[1]))
        self.evaluations += len(points)
        # The front keeps only non-dominated points, sorted by the first objective.
        all_points, all_scores = np.concatenate([self._points, points]), np.concatenate([self._scores, scores])
        front = np.flatnonzero(ranks(all_scores, self._levels) == 0)
        order = front[np.argsort(all_scores[front, self._violation_count], kind="stable")][: self._max_points]
        self._points, self._scores = all_points[order], all_scores[order]
        self._search.tell(scores)
        self._is_asked = False

    @property
    def best(self) -> BestFound:
        """Best point evaluated; with several objectives, the point of `front` with the best first objective.

        Raises ValueError before the first `tell`.
        """
        return self.front[0]

    @property
    def front(self) -> tuple[BestFound, ...]:
        """Non-dominated points among all evaluated points; there are at most as many as in the population."""
        if not self._levels:
            raise ValueError("nothing has been evaluated yet: call ask() and tell() first")
        v = self._violation_count
        return tuple(
            BestFound(x.copy(), row[v:].copy(), row[:v].copy())
            for x, row in zip(self._points, self._scores, strict=True)
        )

    def minimise(
        self, objective: Callable[[Floats], ArrayLike], generations: int = 100, *, evaluations: int | None = None
    ) -> BestFound:
        """Minimise an objective, and return the best point found.

        objective: maps points, (n, d), to values, (n,).
        generations: number of generations.
        evaluations: total number of evaluations at which to stop, instead of `generations`.  The last generation is
        evaluated only in part, so that the number is exact.

        Raises ArgumentError for numbers below 1.
        """
        check_arguments(generations=generations, evaluations=evaluations)
        if evaluations is None:
            for _ in range(generations):
                self.tell(objective(self.ask()))
            return self.best
        while (remaining := evaluations - self.evaluations) > 0:
            points = self.ask()
            values = np.asarray(objective(points[:remaining]), dtype=np.float64)
            omitted = max(0, len(points) - remaining)
            self.tell(np.concatenate([values, np.full((omitted, *values.shape[1:]), np.nan)]) if omitted else values)
            self.evaluations -= omitted
        return self.best

    def __repr__(self) -> str:
        name, best_text = type(self._search).__name__, f", best {self.best.value:.6g}" if self._levels else ""
        return f"<Optimiser {name}: {self._points.shape[1]} variables, {self.evaluations:,} evaluations{best_text}>"


@checks_types
def optimise(
    lower: ArrayLike,
    upper: ArrayLike,
    *,
    model: Model = "umda",
    population: int = 100,
    seed: int | np.random.Generator = 1,
    initial: ArrayLike | None = None,
) -> Optimiser:
    """Return an ask/tell optimiser for any function within bounds, with an algorithm of the planner.

    lower, upper: bounds of the box, (d,).
    model: "umda", the paper's univariate Gaussians; "emna", one Gaussian with full covariance; "multistart", Gaussians
    with full covariance from many starts of many widths, for a cost with walls, gaps or several valleys; "partial",
    which redraws parts of points, often neighbouring variables, for few evaluations; "differential", differential
    evolution, for comparison.
    population: even number of points, at least 4, half of them drawn again in each generation; for "multistart" and
    "partial", which draw all points, the size of the largest generation.
    seed: a whole number, or a generator of random numbers.
    initial: first points in the box, (population, d); None draws uniform points.
    Raises a `planfly.PlanflyError`, which is also a ValueError, for invalid bounds or another invalid argument.

    Find the minimum of a bowl, 0 at (1, 2).  A constraint that excludes this point makes it 0.5 at (0.5, 1.5):

    >>> import planfly
    >>> search = planfly.optimise([-5, -5], [5, 5], seed=1)
    >>> for generation in range(40):
    ...     x, y = search.ask().T
    ...     search.tell((x - 1) ** 2 + (y - 2) ** 2)
    >>> search.best.x.round(3).tolist()
    [1.0, 2.0]
    >>> search = planfly.optimise([-5, -5], [5, 5], model="emna", seed=1)
    >>> for generation in range(60):
    ...     x, y = search.ask().T
    ...     search.tell((x - 1) ** 2 + (y - 2) ** 2, violations=x + y - 2)
    >>> search.best.feasible, round(search.best.value, 1)
    (True, 0.5)

    Find a path past a wall with two gaps, each 0.02 wide.  Its length is 1.08 through a gap, and 2.3 around the wall:

    >>> def length(across):
    ...     wall = abs(across[:, 3] + across[:, 4]) / 2
    ...     steps = np.hypot(1 / 9, np.diff(across, prepend=0, append=0))
    ...     return np.where((wall < 1) & (abs(wall - 0.2) > 0.01), np.inf, steps.sum(axis=1))
    >>> search = planfly.optimise([-2] * 8, [2] * 8, model="multistart")
    >>> round(search.minimise(length, evaluations=10_000).value, 2)
    1.08
    """
    check_arguments(population=population, seed=None if isinstance(seed, np.random.Generator) else seed)
    lower_bounds, upper_bounds = _parse_numbers("lower", lower), _parse_numbers("upper", upper)
    if lower_bounds.ndim != 1 or lower_bounds.shape != upper_bounds.shape or not lower_bounds.size:
        shapes = f"of shapes {lower_bounds.shape} and {upper_bounds.shape}"
        raise ArgumentError.of_argument("lower, upper", lower, "expected two arrays of shape (d,)", shown=shapes)
    with np.errstate(over="ignore", invalid="ignore"):
        widths = upper_bounds - lower_bounds
    if not (np.isfinite(widths) & (widths > 0.0)).all():
        allowed = "expected finite numbers, lower below upper by a finite difference"
        raise ArgumentError.of_argument("lower, upper", lower, allowed, shown="")
    if not isinstance(model, str) or model not in _MODELS:
        raise ArgumentError.of_argument("model", model, f"expected {', '.join(_MODELS)}")
    if population % 2:
        raise ArgumentError.of_argument("population", population, RANGES["population"].expected)
    first_points = None if initial is None else _parse_numbers("initial", initial)
    if first_points is not None:
        expected_shape = (population, lower_bounds.size)
        if first_points.shape != expected_shape or not np.isfinite(first_points).all():
            allowed = f"expected finite numbers of shape {expected_shape}"
            raise ArgumentError.of_argument("initial", initial, allowed, shown=f"of shape {first_points.shape}")
        is_inside = ((first_points >= lower_bounds) & (first_points <= upper_bounds)).all(axis=1)
        if not is_inside.all():
            row = int(np.argmin(is_inside))
            place = f"row {row}: {first_points[row].tolist()}"
            raise ArgumentError.of_argument("initial", initial, "outside the box of lower and upper", shown=place)
    return Optimiser(lower_bounds, upper_bounds, model, population, np.random.default_rng(seed), first_points)


def _parse_numbers(name: str, numbers: ArrayLike) -> Floats:
    """Return numbers as an array.  Raises ArgumentError for anything else.

    name: name of the argument, for messages.
    """
    try:
        return np.array(numbers, dtype=np.float64)
    except (TypeError, ValueError):
        raise ArgumentError.of_argument(name, type(numbers).__name__, "expected an array of numbers") from None


def _parse_columns(name: str, numbers: ArrayLike, row_count: int) -> Floats:
    """Return numbers as an array (row_count, columns), with infinity in place of NaN.

    name: name of the argument, for messages.

    Raises ArgumentError for a wrong number of rows.
    """
    columns = _parse_numbers(name, numbers)
    columns = columns[:, np.newaxis] if columns.ndim == 1 else columns
    if columns.ndim != 2 or len(columns) != row_count:
        allowed = f"expected {row_count} rows, one for each requested point"
        raise ArgumentError.of_argument(name, numbers, allowed, shown=f"of shape {np.shape(numbers)}")
    return np.where(np.isnan(columns), np.inf, columns)
