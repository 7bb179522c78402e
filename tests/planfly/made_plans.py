"""Seeded plans with numbers of our choosing."""

import numpy as np

from planfly.paper import SeededPlan


def made_plan(algorithm: str, seed: int, length: float, kill: float, bad: int = 0) -> SeededPlan:
    """A plan of the paper's problem of seven threats; bad: violations of the first kind.  Half a second a seed."""
    numbers = ((bad, 0, 0, 0), (length, kill, 2.0 * seed, 5.0), kill == 0.0, 0.1 * (kill > 0), 0.2)
    return SeededPlan(7, algorithm, seed, np.zeros((3, 3)), *numbers, 100, np.zeros((2, 3)), 0.5 * seed)
