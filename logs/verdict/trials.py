"""Search candidate changes for one that passes a trial.

A trial is a flight, a simulated return or a computation.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

Candidate = TypeVar("Candidate")


def first_that_passes(candidates: Iterable[Candidate], passes: Callable[[Candidate], bool]) -> Candidate | None:
    """Return the first candidate that passes, or None if none passes; candidates after it are not tried.

    >>> first_that_passes([3, 8, 9], lambda metres: metres > 5)
    8
    """
    return next(filter(passes, candidates), None)


def least_change(changes: Sequence[Candidate], passes: Callable[[Candidate], bool]) -> Candidate | None:
    """Return the smallest change that passes, by bisection, or None if no tried change passes.

    changes: candidates in increasing order; all changes above a passing change are assumed to pass.

    >>> tried = []
    >>> least_change(range(0, 120, 10), lambda metres: not tried.append(metres) and metres >= 30)
    30
    >>> tried
    [50, 20, 30]
    """
    last_failing, first_passing = -1, len(changes)
    while first_passing - last_failing > 1:
        middle = (last_failing + first_passing) // 2
        last_failing, first_passing = (last_failing, middle) if passes(changes[middle]) else (middle, first_passing)
    return changes[first_passing] if first_passing < len(changes) else None
