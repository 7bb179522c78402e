"""An autopilot that is a program of its own, and the flight that it steers."""

from abc import abstractmethod
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, ClassVar, Self

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import Autopilot
from flight.simulation.airborne import Airborne
from flight.simulation.setup import FlightSetup


class ProgramFlight(Airborne, AbstractContextManager["ProgramFlight"]):
    """A flight that a program steers, in lockstep with our physics; on leaving it the program has ended."""

    @abstractmethod
    def prepare(self) -> None:
        """Have the program take the mission and fly to the first waypoint.  Raises FlightError."""

    @abstractmethod
    def keep_log(self, target: Path) -> bool:
        """End the program in order, and move its own log to a file; whether there was one."""


class ProgramAutopilot(Autopilot):
    """An autopilot that is a program of its own; `law` is the autopilot that models it.

    log_suffix: of the log that the program itself writes.
    """

    log_suffix: ClassVar[str]
    # Whatever its law does: unless its own class says otherwise, a program is put into the air on a rail.
    flies_ground: ClassVar[bool] = False

    @property
    def follows_ground(self) -> bool:
        """False: heights above terrain are sent to a program as altitudes above sea level."""
        return False

    @classmethod
    @abstractmethod
    def flying(cls, law: Any, binary: Path) -> Self:
        """The program, with the settings of its law.  binary: its file."""

    @abstractmethod
    def start(self, setup: FlightSetup, aircraft: Aircraft) -> ProgramFlight:
        """Start the program for a flight.  Raises FlightError."""
