"""How fast flights come in, and when to tell of it again."""

import time

# Seconds between two lines of progress.
TOLD_EVERY = 0.5


class FlightRate:
    """Flights a second since it was made; known: flights that were there before."""

    def __init__(self, known: int) -> None:
        self._known = known
        self._started = self._told = time.monotonic()

    def due(self) -> bool:
        """Whether it is time to tell again; asked for by what then tells."""
        now = time.monotonic()
        if now - self._told < TOLD_EVERY:
            return False
        self._told = now
        return True

    def a_second(self, flights: int) -> float:
        """Flights a second, with so many flights there by now; 0 before the first."""
        return (flights - self._known) / max(time.monotonic() - self._started, 1e-3)
