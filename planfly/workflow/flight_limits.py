"""Limit the duration of a simulated flight and the size of its log, and predict the duration."""

from dataclasses import dataclass

from flight.simulation.setup import FlightSetup
from logs.verdict.measures.route_requirements import true_airspeed_route
from planfly.flight_options import MAX_HOURS, MAX_MEGABYTES
from world.geometry import leg_runs


@dataclass(frozen=True, slots=True)
class FlightLimits:
    """Limits of simulated time and log size, at which a flight is ended.

    hours: maximum simulated time, h.
    megabytes: maximum size of the log, 10^6 bytes.

    >>> FlightLimits(megabytes=20.0).log_limit_reason(20_000_001)
    'log limit: the log has reached 20 MB; --max-log raises the limit'
    """

    hours: float = MAX_HOURS
    megabytes: float = MAX_MEGABYTES

    def max_ticks(self, dt: float) -> int:
        """Return the maximum number of guidance ticks of dt seconds each."""
        return round(3600.0 * self.hours / dt)

    def log_limit_reason(self, size: int) -> str:
        """Return the reason to end a flight with a log of `size` bytes, or "" if the flight may continue."""
        if size <= 1e6 * self.megabytes:
            return ""
        return f"log limit: the log has reached {self.megabytes:g} MB; --max-log raises the limit"


def predicted_seconds(setup: FlightSetup) -> float:
    """Predict the duration of a flight in still air, s.

    It is the path length divided by the mean of the legs' demanded true airspeeds, weighted by the time on each leg.

    >>> from logs.recording.example_log import example_log
    >>> flown = example_log()
    >>> bool(abs(predicted_seconds(flown.setup) - flown.track.time[-1]) < 5.0)
    True
    """
    leg_lengths = leg_runs(setup.route.positions)
    speed = leg_lengths.sum() / (leg_lengths / true_airspeed_route(setup).leg_airspeeds).sum()
    return float(setup.path.length / speed)


def length_and_duration_text(setup: FlightSetup) -> str:
    """Return the length and the predicted duration of a flight, such as "12.3 km, about 500 s in the air"."""
    seconds = predicted_seconds(setup)
    time = f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
    if seconds >= 2.0 * 3600.0:
        time = f"{seconds / 3600.0:.1f} h"
    return f"{setup.path.length / 1000.0:.1f} km, about {time} in the air"


def computing_time_key(setup: FlightSetup) -> str:
    """Return the key under which the computing time of a flight is stored.

    Simulations of flights with the same key take similar times per km.
    """
    return f"flying by {setup.autopilot.name}"
