"""Timing functions of the benchmarks."""

import statistics
import time
from collections.abc import Callable

# Default number of runs.
ROUNDS = 5


def median_time(work: Callable[[], object], rounds: int = ROUNDS) -> float:
    """Return the median wall-clock time of a few runs, s."""
    spent = []
    for _ in range(rounds):
        started = time.perf_counter()
        work()
        spent.append(time.perf_counter() - started)
    return statistics.median(spent)


def median_cpu(work: Callable[[], object], rounds: int = ROUNDS) -> float:
    """Return the median CPU time of this process in a few runs, s."""
    spent = []
    for _ in range(rounds):
        started = time.process_time()
        work()
        spent.append(time.process_time() - started)
    return statistics.median(spent)
