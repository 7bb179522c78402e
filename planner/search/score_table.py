"""The table of scores that a search ranks: a row a path, its violations and then its objectives, and their order."""

import numpy as np
from numpy.typing import NDArray

from planner.optimisers.preference import NO_GOAL, Level, ranks
from planner.plan import Objective, Violation

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

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
