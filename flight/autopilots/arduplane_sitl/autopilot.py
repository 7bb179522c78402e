"""Implement ArduPlane itself as an autopilot, by its SITL program in lockstep with planfly's physics."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Self

from aircraft.catalog import Aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.autopilot import StoredAutopilot
from flight.autopilots.parts import GroundRules, MissionChecks, MissionParts
from flight.autopilots.program import ProgramAutopilot, ProgramFlight
from flight.autopilots.sitl.servos import SERVO_FILE, load_servo_map
from flight.simulation.setup import FlightSetup

# Parameters that the program flies, in contrast to the simulated control law.
_FLOWN_BY_PROGRAM = ("ARSPD_USE", "RLL_RATE_P", "PTCH_RATE_P")


@dataclass(frozen=True)
class ArduPlaneSitl(ProgramAutopilot, ArduPlane):
    """ArduPlane itself. Before the flight, the simulated ArduPlane stands in for the program."""

    log_suffix: ClassVar = ".BIN"

    @classmethod
    def restore(cls, stored: StoredAutopilot) -> Self:
        """Return the autopilot with the parameters and the program that a log stores."""
        return cls(ArduPlane.restore(stored).parameters, stored.program)

    @classmethod
    def accepts_program(cls, program: Path) -> bool:
        """Return True: any program may be ArduPlane, which reports its version only after it has started."""
        return True

    @classmethod
    def with_model(cls, model: ArduPlane, binary: Path) -> Self:
        """Return the autopilot that runs the ArduPlane program with the simulated ArduPlane's parameters."""
        return cls(model.parameters, binary=binary)

    @classmethod
    def missing_files(cls, aircraft: Aircraft) -> list[str]:
        """Return a sentence on the servo map if the aircraft's folder lacks it; an empty list otherwise.

        Raises FlightError if the servo map is invalid.
        """
        if (aircraft.folder / SERVO_FILE).exists():
            load_servo_map(aircraft)
            return []
        return [
            f"{aircraft.folder / SERVO_FILE}: missing; a flight with --sitl needs this file, which states"
            " the control that each servo moves"
        ]

    @cached_property
    def checks(self) -> MissionChecks:
        """Checks of the simulated ArduPlane, but without battery failsafes, which are off in the program."""
        return replace(super().checks, battery_failsafes=())

    def describe_settings_ignored_by_program(self, mission: MissionParts) -> list[str]:
        """Describe the settings that the program does not receive, or that do not affect its simulated flight."""
        settings = self.describe_unsimulated_settings(mission, by_program=True)
        return [text for text in settings if not text.startswith(_FLOWN_BY_PROGRAM)]

    @property
    def ground(self) -> GroundRules:
        """Rules of take-off and landing; the program flies either both or neither."""
        return replace(super().ground, needs_both_ends=True)

    @property
    def model(self) -> ArduPlane:
        """Simulated ArduPlane with the same parameters."""
        return ArduPlane(self.parameters)

    def start(self, setup: FlightSetup, aircraft: Aircraft) -> ProgramFlight:
        """Start the program.

        Raises FlightError if the program does not start, and ParameterError if a file is invalid.
        """
        # Imported here: only this needs MAVLink.
        from flight.autopilots.arduplane_sitl.flight import AutopilotFlight

        return AutopilotFlight(setup, aircraft, self)
