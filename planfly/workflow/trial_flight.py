"""One trial: a setup with its geometric verdict, its flight, and the verdict on its flight."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aircraft.catalog import Aircraft
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, simulate, track_of
from flight.simulation.track import Track, join_tracks
from logs.verdict.judge_flight import judge_flight
from logs.verdict.judge_geometry import judge_geometry
from logs.verdict.measures.energy import predicted_energy
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.verdict import Verdict
from world.errors import StartError

# A mission predicted to need more than this many times the energy carried is not flown: it would show nothing more.
MAX_ENERGY_RATIO = 2.0


class TrialAborted(Exception):
    """Raised when a trial flight is aborted in a hurry."""


# Function that returns True if trial flights should be aborted.
Hurry = Callable[[], bool]


def no_hurry() -> bool:
    """Return False: fly trials to their end."""
    return False


@dataclass(eq=False)
class Trial:
    """A setup that is judged and flown when its verdicts are first requested, each once.

    hurry: called throughout the flight; once it returns True the flight is aborted with TrialAborted.
    """

    setup: FlightSetup
    aircraft: Aircraft
    hurry: Hurry = no_hurry

    @cached_property
    def requirements(self) -> RouteRequirements:
        """Route requirements of the setup."""
        return route_requirements(self.setup)

    @cached_property
    def geometric(self) -> Verdict:
        """Verdict without a flight."""
        return judge_geometry(self.setup, self.requirements)

    @cached_property
    def flight(self) -> tuple[Track, str]:
        """Track of the flight and how it ended; the track of a flight that cannot begin has no row."""
        reason = reason_not_to_start(self.requirements)
        if reason:
            return join_tracks([]), reason
        blocks = []
        try:
            for block in simulate(Flight(self.setup, self.aircraft)):
                blocks.append(block)
                if self.hurry():
                    raise TrialAborted
        except StartError as error:
            return join_tracks([]), f"not started: {error.reason}"
        return track_of(blocks), blocks[-1].ended

    @cached_property
    def flown(self) -> Verdict:
        """Verdict on the flight."""
        return judge_flight(self.setup, *self.flight, requirements=self.requirements)


def reason_not_to_start(requirements: RouteRequirements) -> str:
    """Return why a flight is not begun, "" if it is: it is predicted to need several times the energy carried.

    Full power throughout that needs less than `MAX_ENERGY_RATIO` times the energy carried is no reason.
    """
    setup = requirements.setup
    seconds, full = setup.path.length / float(setup.route.airspeed.min()), setup.envelope.power_full
    full_energy = float(np.nanmax(full, initial=0.0)) * seconds / 3600.0
    if full_energy <= MAX_ENERGY_RATIO * setup.battery:
        return ""
    ratio = predicted_energy(requirements)[0] / setup.battery
    return f"not started: it takes {ratio:.0f} times the energy carried" if ratio > MAX_ENERGY_RATIO else ""
