"""The clock of a log put right: jumps back for good are taken out, and rows that came late find their place."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# A clock that is behind by this (s) over this many rows in a row has jumped; less is a row out of order.
BEHIND, ROWS_BEHIND = 1.0, 8


@dataclass(frozen=True, slots=True)
class SteadyClock:
    """Times as a steady clock would have them.

    time: (n,) s, those after a jump moved on.
    jumps: s, of the steady clock, at which the clock went back for good.
    """

    time: Floats
    jumps: tuple[float, ...]


def steady_clock(time: Floats, usual: float = 0.1) -> SteadyClock:
    """Times (n,) of a log's rows in the order of the file, without jumps back.

    A clock that goes back and stays there has been set anew: what follows is moved on, so that it comes ``usual`` s
    after what was before.  A row that alone is out of order keeps its time.

    >>> steady_clock(np.array([10.0, 11.0, *range(2, 14)]), usual=1.0).time.tolist()
    [10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0, 19.0, 20.0, 21.0, 22.0, 23.0]
    >>> float(steady_clock(np.array([10.0, 11.0, 5.0, *range(12, 24)])).time[2])
    5.0
    """
    moved = np.array(time, dtype=np.float64)
    jumps: list[float] = []
    begin = 0
    while begin < moved.size:
        latest = np.maximum.accumulate(moved[begin:])
        behind = np.flatnonzero(moved[begin:] < latest - BEHIND)
        jump = _first_for_good(behind, moved[begin:], latest)
        if jump < 0:
            break
        at = begin + jump
        jumps.append(float(latest[jump - 1]))
        moved[at:] += latest[jump - 1] + usual - moved[at]
        begin = at
    return SteadyClock(moved, tuple(jumps))


def _first_for_good(behind: Ints, time: Floats, latest: Floats) -> int:
    """The first row from which on as many rows are behind as make a jump, or all to the end; -1 for none."""
    for k in behind.tolist():
        until = min(k + ROWS_BEHIND, time.size)
        if until - k >= min(ROWS_BEHIND, 2) and (time[k:until] < latest[k - 1] - BEHIND).all():
            return int(k)
    return -1
