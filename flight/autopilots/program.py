"""Define the interface of an autopilot that is an external program, and of its flight."""

from abc import abstractmethod
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import Autopilot, AutopilotProgram, describe_program
from flight.simulation.airborne import Airborne
from flight.simulation.setup import FlightSetup


class ProgramFlight(Airborne, AbstractContextManager["ProgramFlight"]):
    """Flight of an external program in lockstep with planfly's physics; leaving the context ends the program."""

    @abstractmethod
    def prepare(self) -> None:
        """Upload the mission to the program, and let it fly to the first waypoint.

        Raises FlightError if the program refuses or fails.
        """

    @abstractmethod
    def keep_log(self, target: Path) -> bool:
        """End the program cleanly, move its own log to a file, and return True if there was a log."""


@dataclass(frozen=True)
class ProgramAutopilot(Autopilot):
    """Autopilot that is an external program; `law` is the simulated autopilot that models it.

    log_suffix: suffix of the log that the program itself writes.
    program: the program that flew; None before the flight.
    binary: the program's file; None for a flight from a log.
    """

    own: ClassVar[np.dtype[np.record] | None] = None
    is_program: ClassVar[bool] = True
    log_suffix: ClassVar[str]
    program: AutopilotProgram | None = None
    binary: Path | None = field(default=None, compare=False)
    # A program starts in the air, at the end of a rail, unless its own class says otherwise.
    flies_ground: ClassVar[bool] = False

    @property
    def follows_ground(self) -> bool:
        """False, because heights above terrain are sent to a program as altitudes above sea level."""
        return False

    @classmethod
    @abstractmethod
    def flying(cls, law: Any, binary: Path) -> Self:
        """Return the program's autopilot with the settings of the simulated autopilot.

        binary: the program's file.
        """

    def described(self, aircraft: str) -> str:
        """Describe the program and the parameters that the user changed; before the flight, the simulated autopilot."""
        return super().described(aircraft) if self.program is None else describe_program(self.program, aircraft)

    @property
    def version(self) -> str:
        """Version that the program reports; before the flight, the release of the simulated autopilot."""
        return super().version if self.program is None else self.program.version

    @property
    def file(self) -> Path:
        """The program's file.

        Raises ValueError if the autopilot belongs to a recorded flight.
        """
        if self.binary is None:
            raise ValueError("the program of a recorded flight is not available here")
        return self.binary

    @abstractmethod
    def start(self, setup: FlightSetup, aircraft: Aircraft) -> ProgramFlight:
        """Start the program for a flight.

        Raises FlightError if it does not start.
        """
