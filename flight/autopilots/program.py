"""Define the interface of an autopilot that is an external program, and of its flight."""

from abc import abstractmethod
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Self

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import Autopilot, AutopilotProgram, describe_program
from flight.autopilots.parts import MissionChecks, MissionParts
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import RunningFlight


class ProgramFlight(RunningFlight, AbstractContextManager["ProgramFlight"]):
    """Flight of an external program in lockstep with planfly's physics.

    It is a context manager that ends the program.
    """

    @abstractmethod
    def prepare(self) -> None:
        """Upload the mission to the program, and fly to the first waypoint.

        Raises FlightError if the program refuses or fails.
        """

    @abstractmethod
    def save_log(self, target: Path) -> bool:
        """End the program cleanly and move its log to the file ``target``; return True if there was a log."""


@dataclass(frozen=True)
class ProgramAutopilot(Autopilot):
    """Autopilot that is an external program; `model` is the simulated autopilot that models it.

    log_suffix: suffix of the log that the program itself writes.
    program: the program that flew; None before the flight.
    binary: the program's file; None for a flight from a log.
    """

    log_suffix: ClassVar[str]
    program: AutopilotProgram | None = None
    binary: Path | None = field(default=None, compare=False)

    @classmethod
    @abstractmethod
    def accepts_program(cls, program: Path) -> bool:
        """Return True if a program file that --sitl names is this autopilot."""

    @classmethod
    @abstractmethod
    def with_model(cls, model: Any, binary: Path) -> Self:
        """Return the autopilot that runs an external program, with the settings of its simulated model.

        model: simulated autopilot that models the program.
        binary: the program's file.
        """

    @cached_property
    def checks(self) -> MissionChecks:
        """Mission checks of the simulated autopilot, with the settings that the program's flight ignores.

        Heights above terrain are sent to a program as altitudes above sea level.
        """
        return replace(
            super().checks,
            follows_terrain=False,
            describe_unsimulated_settings=self.describe_settings_ignored_by_program,
        )

    @abstractmethod
    def describe_settings_ignored_by_program(self, mission: MissionParts) -> list[str]:
        """Describe the settings that would change the flight path, but have no effect in the program's flight."""

    def describe(self, aircraft: str) -> str:
        """Describe the program and the parameters that the user changed.

        Before the flight, describe the simulated autopilot instead.
        """
        return super().describe(aircraft) if self.program is None else describe_program(self.program, aircraft)

    @property
    def version(self) -> str:
        """Version that the program reports; before the flight, the release of the simulated autopilot."""
        return super().version if self.program is None else self.program.version

    @property
    def file(self) -> Path:
        """File of the program.

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
