"""Clock that stops while this process is stopped.

A process is stopped during a laptop's sleep, after Ctrl-Z, or in a debugger.
"""

import time
from collections.abc import Callable

# Longest step between two readings, s.  A longer step is cut to this, because the process did not run all the time.
MAX_STEP_S = 1.0


class RunningClock:
    """Clock that returns the real time for which this process has run, s, since the clock was made.

    The clock must be read at least every `MAX_STEP_S` s, because a longer step counts as a pause of the process.
    Timeouts and playback then continue after the pause.

    >>> real = iter((100.0, 100.5, 4000.5, 4000.75))
    >>> clock = RunningClock(lambda: next(real))
    >>> clock(), clock(), clock()
    (0.5, 1.5, 1.75)
    """

    def __init__(self, real: Callable[[], float] | None = None) -> None:
        """Start the clock.

        real: function that returns the real time, s, from any epoch; None for the system's monotonic clock.
        """
        self._real = real or time.monotonic
        self._last = self._real()
        self._seconds = 0.0

    def __call__(self) -> float:
        """Return the time for which this process has run since the clock was made, s."""
        now = self._real()
        self._seconds += min(max(now - self._last, 0.0), MAX_STEP_S)
        self._last = now
        return self._seconds
