"""How the benchmarks take time."""

import statistics
import time
from collections.abc import Callable

ROUNDS = 5


def median_time(work: Callable[[], object], rounds: int = ROUNDS) -> float:
    """The median of a few runs, s."""
    spent = []
    for _ in range(rounds):
        started = time.perf_counter()
        work()
        spent.append(time.perf_counter() - started)
    return statistics.median(spent)


def median_cpu(work: Callable[[], object], rounds: int = ROUNDS) -> float:
    """The median of a few runs in CPU seconds of this process, s."""
    spent = []
    for _ in range(rounds):
        started = time.process_time()
        work()
        spent.append(time.process_time() - started)
    return statistics.median(spent)
