"""What both evaluations say of one constraint."""

import numpy as np

from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import ProblemArrays
from planner.plan import Violation


def violations_of(data: ProblemArrays, path: np.ndarray, kind: Violation) -> tuple[int, float]:
    """Count of the paper's scores, and how far the graded ones say the constraint is exceeded."""
    counts, graded = paper_scores(data, path[None])[0], graded_scores(data, path[None])[0]
    return int(counts[0, kind]), float(graded[0, kind])
