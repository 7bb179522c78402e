"""Implement PX4 itself as an autopilot, by its SITL program in lockstep with planfly's physics."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Self

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import StoredAutopilot
from flight.autopilots.parts import MissionParts
from flight.autopilots.program import ProgramAutopilot, ProgramFlight
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4_sitl.process import startup_folder
from flight.simulation.setup import FlightSetup


@dataclass(frozen=True)
class Px4Sitl(ProgramAutopilot, Px4):
    """PX4 itself. Before the flight, the simulated PX4 stands in for the program."""

    log_suffix: ClassVar = ".ulg"

    @classmethod
    def restore(cls, stored: StoredAutopilot) -> Self:
        """Return the autopilot with the parameters and the program that a log stores."""
        return cls(Px4.restore(stored).parameters, program=stored.program)

    @classmethod
    def accepts_program(cls, program: Path) -> bool:
        """Return True if a program's name begins with "px4", or if PX4's start-up files are next to it."""
        return program.name.lower().startswith("px4") or startup_folder(program) is not None

    @classmethod
    def with_model(cls, model: Px4, binary: Path) -> Self:
        """Return the autopilot that runs the PX4 program, with the parameters of the simulated PX4."""
        return cls(model.parameters, binary=binary)

    @classmethod
    def missing_files(cls, aircraft: Aircraft) -> list[str]:
        """Return an empty list, because `ArduPlaneSitl.missing_files` already reports a missing servo map."""
        return []

    @property
    def model(self) -> Px4:
        """Simulated PX4 with the same parameters."""
        return Px4(self.parameters)

    def describe_settings_ignored_by_program(self, mission: MissionParts) -> list[str]:
        """Describe the settings that do not affect a flight of the PX4 program in planfly's physics."""
        return self.describe_unsimulated_settings(mission, by_program=True)

    def store(self) -> StoredAutopilot:
        """Return the settings of the simulated PX4, and the program, for a log."""
        return super().store()._replace(program=self.program)

    def start(self, setup: FlightSetup, aircraft: Aircraft) -> ProgramFlight:
        """Start the program.

        Raises FlightError if the program does not start, and ParameterError if a file is invalid.
        """
        # Imported here: only this needs MAVLink.
        from flight.autopilots.px4_sitl.flight import Px4Flight

        return Px4Flight(setup, aircraft, self)
