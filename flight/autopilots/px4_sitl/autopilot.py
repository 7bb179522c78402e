"""PX4 itself as an autopilot: its program, built for software in the loop, in lockstep with our physics."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import AutopilotProgram, StoredAutopilot, describe_program
from flight.autopilots.program import ProgramAutopilot, ProgramFlight
from flight.autopilots.px4.autopilot import Px4
from flight.simulation.setup import FlightSetup

# Beside its program (or one folder up, as a build leaves it), and in there the script that it starts with.
STARTUP, _SCRIPT = "etc", Path("init.d-posix", "rcS")


def startup_files(program: Path) -> Path | None:
    """The folder of a program's start-up files; None where there is none."""
    beside = program.resolve().parent
    places = (beside / STARTUP, beside.parent / STARTUP)
    return next((place for place in places if (place / _SCRIPT).is_file()), None)


@dataclass(frozen=True)
class Px4Sitl(ProgramAutopilot, Px4):
    """PX4 itself.  What is asked of it beforehand, its law answers.

    program: that flew; None before the flight.
    binary: the program's file; None for a flight that a log holds.
    """

    own: ClassVar[np.dtype[np.record] | None] = None
    log_suffix: ClassVar = ".ulg"
    program: AutopilotProgram | None = None
    binary: Path | None = field(default=None, compare=False)

    @classmethod
    def restore(cls, stored: StoredAutopilot) -> Self:
        """With the parameters and the program that a log stores."""
        return cls(Px4.restore(stored).parameters, stored.program)

    @classmethod
    def recognises(cls, program: Path) -> bool:
        """By its name, or the start-up files beside it."""
        return program.name.lower().startswith("px4") or startup_files(program) is not None

    @classmethod
    def flying(cls, law: Px4, binary: Path) -> Self:
        """The program in the place of its law."""
        return cls(law.parameters, binary=binary)

    @classmethod
    def missing_files(cls, aircraft: Aircraft) -> list[str]:
        """None of its own: the servo map is the one that ArduPlane's program needs, and names."""
        return []

    @property
    def law(self) -> Px4:
        """PX4's law with the same parameters."""
        return Px4(self.parameters)

    def store(self) -> StoredAutopilot:
        """As its law, and the program."""
        return super().store()._replace(program=self.program)

    def described(self, aircraft: str) -> str:
        """The program, and the parameters that a person changed."""
        return super().described(aircraft) if self.program is None else describe_program(self.program, aircraft)

    @property
    def version(self) -> str:
        """What the program calls itself, or the release of the law before the flight."""
        return super().version if self.program is None else self.program.version

    def start(self, setup: FlightSetup, aircraft: Aircraft) -> ProgramFlight:
        """Start the program.  Raises FlightError for one that does not start, and ParameterError for a bad file."""
        # Imported here: nobody else needs MAVLink.
        from flight.autopilots.px4_sitl.flight import Px4Flight

        if self.binary is None:
            raise ValueError("the program of a recorded flight is not at hand")
        return Px4Flight(setup, aircraft, self.binary)
