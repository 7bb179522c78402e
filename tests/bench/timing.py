"""How the benchmarks take time."""

import time
from collections.abc import Callable

ROUNDS = 5


def best(work: Callable[[], object], rounds: int = ROUNDS) -> float:
    """The shortest of a few runs, s: the one that the machine disturbed least."""
    spent = []
    for _ in range(rounds):
        started = time.perf_counter()
        work()
        spent.append(time.perf_counter() - started)
    return min(spent)


def best_cpu(work: Callable[[], object], rounds: int = ROUNDS) -> float:
    """The shortest of a few runs in CPU seconds of this process, s."""
    spent = []
    for _ in range(rounds):
        started = time.process_time()
        work()
        spent.append(time.process_time() - started)
    return min(spent)
