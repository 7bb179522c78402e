"""A clock that stands still while this process does: a laptop's sleep, Ctrl-Z and a debugger take no time of it."""

import time
from collections.abc import Callable

# A step longer than this (s) is one in which the process did not run, and counts as this.
LONGEST_STEP = 1.0


class RunningClock:
    """Seconds of real time that this process has run since the clock was made, as far as it is asked all the time.

    What is waited for and what is played goes on where it was.  Whoever waits asks it at least each `LONGEST_STEP` s.

    >>> real = iter((100.0, 100.5, 4000.5, 4000.75))
    >>> clock = RunningClock(lambda: next(real))
    >>> clock(), clock(), clock()
    (0.5, 1.5, 1.75)
    """

    def __init__(self, real: Callable[[], float] | None = None) -> None:
        """real: gives seconds from anywhere; the system's monotonic clock unless told otherwise."""
        self._real = real or time.monotonic
        self._last = self._real()
        self._seconds = 0.0

    def __call__(self) -> float:
        """Return the seconds."""
        now = self._real()
        self._seconds += min(max(now - self._last, 0.0), LONGEST_STEP)
        self._last = now
        return self._seconds
