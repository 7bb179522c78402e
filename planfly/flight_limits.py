"""How long a simulated flight may take, how large its log may grow, and what both come to by prediction."""

from dataclasses import dataclass

from flight.simulation.flight_setup import FlightSetup
from world.geometry import leg_runs

# Longer than the aircraft that planfly has can stay up; a log of 60 rows a second grows by some 20 MB an hour.
MOST_HOURS, MOST_MEGABYTES = 6.0, 256.0


@dataclass(frozen=True, slots=True)
class FlightLimits:
    """Where a flight ends that would go on.

    hours: simulated.  megabytes: of its log, 10^6 bytes.

    >>> FlightLimits(megabytes=20.0).log_full(20_000_001)
    'log limit: 20 MB are written; --max-log raises it'
    """

    hours: float = MOST_HOURS
    megabytes: float = MOST_MEGABYTES

    def most_ticks(self, dt: float) -> int:
        """Guidance ticks of dt s that are flown at most."""
        return round(3600.0 * self.hours / dt)

    def log_full(self, size: int) -> str:
        """How a flight ends whose log has so many bytes, "" where it goes on."""
        if size <= 1e6 * self.megabytes:
            return ""
        return f"log limit: {self.megabytes:g} MB are written; --max-log raises it"


def predicted_seconds(setup: FlightSetup) -> float:
    """Time that a setup's path takes at its legs' airspeeds in still air, s.

    >>> from logs.recording.example_log import example_log
    >>> flown = example_log()
    >>> bool(abs(predicted_seconds(flown.setup) - flown.track.time[-1]) < 5.0)
    True
    """
    runs = leg_runs(setup.route.waypoints)
    speed = runs.sum() / (runs / setup.route.airspeed).sum()
    return float(setup.path.length / speed)


def flight_text(setup: FlightSetup) -> str:
    """What is about to be flown: its length and, by prediction, its time."""
    seconds = predicted_seconds(setup)
    time = f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
    if seconds >= 2.0 * 3600.0:
        time = f"{seconds / 3600.0:.1f} h"
    return f"{setup.path.length / 1000.0:.1f} km, about {time}"
