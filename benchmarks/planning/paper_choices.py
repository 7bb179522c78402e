"""Measure the choices that the paper leaves open: ``python -m benchmarks.planning.paper_choices [--runs 15]``.

The paper's UMDAc (Yang, Tang and Lozano, CEC 2014) runs on `paper-07` to `paper-60` with one choice at a time different
from `planner.search`.  docs/what-the-paper-leaves-open.md contains the table.
"""

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.task import exact_uav
from planfly.planning.paper import PROBLEMS, STRIP_HALF_WIDTHS_M, problem_name
from planner.evaluation.encoding import (
    Encoding,
    Space,
    bearing_encoding,
    cartesian_encoding,
    polar_45_encoding,
    polar_encoding,
    rotated_encoding,
)
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import make_problem
from planner.optimisers.preference import NO_GOAL, Level, ranks
from planner.optimisers.umda import Umda
from planner.search.search_state import CONSTRAINTS, DETECTION, HEIGHT, KILL, LENGTH, are_safe, best_first, score_table
from world.arrays import Floats, Ints
from world.random_streams import PLANNER, stream
from world.scenario import load_scenario

# Last level of both orders: detection exposure and height.
LAST = Level((DETECTION, HEIGHT), (NO_GOAL, NO_GOAL))
# Order of preference of the paper: constraints, then length and kill exposure together.
PAPER_LEVELS = (CONSTRAINTS, Level((LENGTH, KILL), (NO_GOAL, NO_GOAL)), LAST)
# The same with kill exposure ahead of length.
KILL_FIRST = (CONSTRAINTS, Level((KILL,), (NO_GOAL,)), Level((LENGTH,), (NO_GOAL,)), LAST)


class ClippedUmda(Umda):
    """UMDA that clips samples outside the box at once."""

    def _redraw_each(self, drawn: Floats, mean: Floats, deviation: Floats) -> Floats:
        return np.clip(drawn, self.lower, self.upper)


class FreeUmda(Umda):
    """UMDA that keeps samples outside the box."""

    def _redraw_each(self, drawn: Floats, mean: Floats, deviation: Floats) -> Floats:
        return drawn


@dataclass(frozen=True, slots=True)
class Choice:
    """Choice of encoding, strip, optimiser, preference, and reported path."""

    name: str
    encode: Callable[[Space, int], Encoding] = rotated_encoding
    strip: bool = False
    optimiser: type[Umda] = Umda
    levels: tuple[Level, ...] = PAPER_LEVELS
    archive: bool = True


def _longer(share: float) -> Callable[[Space, int], Encoding]:
    """Return a polar encoding with steps of up to this multiple of the mean leg."""

    def encode(space: Space, waypoints: int) -> Encoding:
        """Make the polar encoding with longer steps."""
        encoding, upper = polar_encoding(space, waypoints), polar_encoding(space, waypoints).upper.copy()
        upper[0::3] *= 0.5 * share
        return replace(encoding, upper=upper)

    return encode


def _widest(degrees: float) -> Callable[[Space, int], Encoding]:
    """Return a polar encoding with turning angles up to a limit in degrees."""

    def encode(space: Space, waypoints: int) -> Encoding:
        """Make the polar encoding with wider turning angles."""
        encoding = polar_encoding(space, waypoints)
        lower, upper = encoding.lower.copy(), encoding.upper.copy()
        lower[1::3], upper[1::3] = -math.radians(degrees), math.radians(degrees)
        return replace(encoding, lower=lower, upper=upper)

    return encode


def _from_east(space: Space, waypoints: int) -> Encoding:
    """Return a polar encoding within 45 degrees whose first angle is free, and counted from east.

    The first angle cannot be relative, because no leg is before it.
    """
    encoding = polar_45_encoding(space, waypoints)
    lower, upper = encoding.lower.copy(), encoding.upper.copy()
    lower[1], upper[1] = -math.pi, math.pi
    return replace(encoding, lower=lower, upper=upper)


CHOICES = (
    Choice("rotated, as settled"),
    Choice("a strip across (2.5 km; 60 threats 1.5 km)", strip=True),
    Choice("samples outside: clipped at once", optimiser=ClippedUmda),
    Choice("samples outside: left free", optimiser=FreeUmda),
    Choice("path reported: best of the last generation", archive=False),
    Choice("kill exposure ahead of length", levels=KILL_FIRST),
    Choice("Cartesian", cartesian_encoding),
    Choice("polar, theta within 180 deg", polar_encoding),
    Choice("polar, theta within 90 deg", _widest(90.0)),
    Choice("polar, theta within 45 deg", polar_45_encoding),
    Choice("polar, 45 deg, first angle free", _from_east),
    Choice("polar, 180 deg, r up to 1.2 mean legs", _longer(1.2)),
    Choice("polar, 180 deg, r up to 4 mean legs", _longer(4.0)),
    Choice("polar, theta from the straight line", bearing_encoding),
)


def searched(choice: Choice, threats: int, seed: int) -> tuple[bool, float]:
    """Return True if the reported path of a search is safe at the paper's points, and its length ratio."""
    scenario = load_scenario(problem_name(threats))
    problem, table = make_problem(scenario, exact_uav(scenario).limits), scenario.planner
    space = replace(problem.space, across=STRIP_HALF_WIDTHS_M[threats]) if choice.strip else problem.space
    encoding = choice.encode(space, table.waypoints)

    def score(vectors: Floats) -> Floats:
        """Return the scores of paths by the paper's definition."""
        return score_table(*paper_scores(problem.search, np.ascontiguousarray(encoding.decode(vectors))))

    def rank(scores: Floats) -> Ints:
        """Return the ranks of scores by the levels of the choice."""
        return ranks(scores, choice.levels)

    rng = stream(seed, PLANNER)
    search = choice.optimiser(encoding.lower, encoding.upper, rank, table.population, rng)
    best = np.empty((0, CONSTRAINTS.columns[-1] + 5))
    for _ in range(table.generations + 1):
        scores = score(search.ask())
        best = np.concatenate([best, scores])
        best = best[best_first(best)[:1]]
        search.tell(scores)
    row = best[0] if choice.archive else search.scores[0]
    return bool(are_safe(row)), float(row[LENGTH])


def measure(problems: Sequence[int], runs: int) -> None:
    """Print the number of safe runs on each problem, and their median length ratio."""
    print(f"  {'choice':<46}" + "".join(f"{number:>14}" for number in problems))
    for choice in CHOICES:
        line = f"  {choice.name:<46}"
        for threats in problems:
            found = [searched(choice, threats, seed) for seed in range(1, runs + 1)]
            lengths = [length for ok, length in found if ok]
            line += f"{len(lengths):>6} {np.median(lengths) if lengths else math.nan:>7.3f}"
        print(line, flush=True)


def main() -> None:
    """Measure with the options of the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planning.paper_choices")
    parser.add_argument("--runs", type=int, default=15, help="seeds of each")
    measure(PROBLEMS, parser.parse_args().runs)


if __name__ == "__main__":
    main()
