"""ArduPlane itself as an autopilot: its program, built for software in the loop, in lockstep with our physics."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from aircraft.catalog import Aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.autopilot import AutopilotProgram, StoredAutopilot, describe_program
from flight.autopilots.program import ProgramAutopilot, ProgramFlight
from flight.autopilots.sitl.servos import SERVO_FILE, load_servo_map
from flight.simulation.setup import FlightSetup


@dataclass(frozen=True)
class ArduPlaneSitl(ProgramAutopilot, ArduPlane):
    """ArduPlane itself.  What is asked of it beforehand, its law answers.

    program: that flew; None before the flight.
    binary: the program's file; None for a flight that a log holds.
    """

    own: ClassVar[np.dtype[np.record] | None] = None
    flies_ground: ClassVar[bool] = True
    flies_both_ends: ClassVar[bool] = True
    log_suffix: ClassVar = ".BIN"
    program: AutopilotProgram | None = None
    binary: Path | None = field(default=None, compare=False)

    @classmethod
    def restore(cls, stored: StoredAutopilot) -> Self:
        """With the parameters and the program that a log stores."""
        return cls(ArduPlane.restore(stored).parameters, stored.program)

    @classmethod
    def recognises(cls, program: Path) -> bool:
        """Any program: which release it is, it says itself when it has started."""
        return True

    @classmethod
    def flying(cls, law: ArduPlane, binary: Path) -> Self:
        """The program in the place of its law."""
        return cls(law.parameters, binary=binary)

    @classmethod
    def missing_files(cls, aircraft: Aircraft) -> list[str]:
        """The servo map, if it is missing."""
        if (aircraft.folder / SERVO_FILE).exists():
            load_servo_map(aircraft)
            return []
        return [f"{aircraft.folder / SERVO_FILE}: missing: --autopilot needs to know which servo moves what"]

    @property
    def law(self) -> ArduPlane:
        """ArduPlane's law with the same parameters."""
        return ArduPlane(self.parameters)

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
        from flight.autopilots.arduplane_sitl.flight import AutopilotFlight

        if self.binary is None:
            raise ValueError("the program of a recorded flight is not at hand")
        return AutopilotFlight(setup, aircraft, self.binary)
