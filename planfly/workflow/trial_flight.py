"""Judge a setup by its geometry and by a trial flight, and predict the duration of a flight."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from aircraft.catalog import Aircraft
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import BLOCK_DURATION_S, Flight
from flight.simulation.track import Track, TrackBuilder, join_tracks
from logs.verdict.judge_flight import judge_flight
from logs.verdict.judge_geometry import judge_geometry
from logs.verdict.measures.route_requirements import (
    RouteRequirements,
    check_energy,
    route_requirements,
    true_airspeed_route,
)
from logs.verdict.verdict import Verdict
from world.errors import StartError
from world.geometry import leg_runs

# Altitude error of a simulated autopilot against the real one, m.  The minimum clearances of 20 ArduPlane climbs are
# within this error.
ALTITUDE_ERROR_M = 1.2
# Longest predicted time of all flights that explain one verdict, reference flights and trial flights, s of flight.
MAX_EXPLAINING_TIME_S = 6 * 3600.0


class TrialAborted(Exception):
    """Raised when a trial flight is aborted because `should_abort` returned True."""


# Function that returns True if trial flights should be aborted.
AbortCheck = Callable[[], bool]


def never_abort() -> bool:
    """Return False, so that no trial is aborted."""
    return False


@dataclass(eq=False)
class Trial:
    """A setup that is judged and flown when a verdict is first requested, and only once.

    should_abort: called throughout the flight; once it returns True, the flight is aborted with TrialAborted.
    """

    setup: FlightSetup
    aircraft: Aircraft
    should_abort: AbortCheck = never_abort

    @cached_property
    def requirements(self) -> RouteRequirements:
        """Route requirements of the setup."""
        return route_requirements(self.setup)

    @cached_property
    def geometry_verdict(self) -> Verdict:
        """Verdict without a flight."""
        return judge_geometry(self.setup, self.requirements)

    @cached_property
    def flight(self) -> tuple[Track, str]:
        """Track of the flight and the reason for its end; a flight that cannot start has no row."""
        builder, end_reason = TrackBuilder(), ""
        try:
            check_energy(self.requirements)
            flight = Flight(self.setup, self.aircraft)
            while not end_reason:
                rows, end_reason = flight.fly_block(round(BLOCK_DURATION_S / flight.dt))
                builder.add(rows)
                if self.should_abort():
                    raise TrialAborted
        except StartError as error:
            return join_tracks([]), f"not started: {error.reason}"
        return builder.track(), end_reason

    @cached_property
    def flight_verdict(self) -> Verdict:
        """Verdict on the flight."""
        return judge_flight(self.setup, *self.flight, requirements=self.requirements)


def max_explaining_flights(setup: FlightSetup) -> int:
    """Return the number of flights, reference and trial flights, that may explain a setup's verdict.

    >>> from logs.recording.example_log import example_log
    >>> max_explaining_flights(example_log().setup) > 100
    True
    """
    return int(MAX_EXPLAINING_TIME_S / predicted_seconds(setup))


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
