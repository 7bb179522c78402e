"""Map an autopilot's servo outputs to the controls that they move.

The map is in the aircraft's `ardupilot.toml`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from aircraft.catalog import Aircraft
from flight.dynamics.state import Commands
from world.errors import FlightError
from world.files import read_toml

SERVO_FILE = "ardupilot.toml"
# SERVOn_FUNCTION of each control (ArduPilot's parameter reference).
FUNCTIONS = {"elevator": 19, "aileron": 4, "rudder": 21, "throttle": 70}
# Unit of each control's values in the file; "" for a fraction.
_UNITS = {"elevator": "deg", "aileron": "deg", "rudder": "deg", "throttle": ""}
_MAX_OUTPUT = 32


@dataclass(frozen=True, slots=True)
class ServoOutput:
    """One servo of a control, which is linear in the pulse between knots, and constant beyond them.

    number: number of the output, from 1.
    pulses: (k,) microseconds, increasing.
    values: (k,) control at these pulses, in the units of `flight.dynamics.state.Commands`: rad, or throttle 0..1.
    """

    number: int
    pulses: tuple[float, ...]
    values: tuple[float, ...]

    @property
    def center_pulse(self) -> float:
        """Pulse of the knot whose control value is nearest to zero, microseconds."""
        return min(zip(self.pulses, self.values, strict=True), key=lambda knot: abs(knot[1]))[0]

    def value(self, pulse: float) -> float:
        """Return the control (rad, or throttle 0..1) at a pulse in microseconds.

        Without a pulse (0) it is the control at the center pulse.

        >>> ServoOutput(2, (1100.0, 1500.0, 1900.0), (0.5, 0.0, -0.5)).value(1700)
        -0.25
        """
        if pulse <= 0.0:
            pulse = self.center_pulse
        pulses, values = self.pulses, self.values
        if pulse <= pulses[0]:
            return values[0]
        for knot in range(1, len(pulses)):
            if pulse < pulses[knot]:
                fraction = (pulse - pulses[knot - 1]) / (pulses[knot] - pulses[knot - 1])
                return values[knot - 1] + fraction * (values[knot] - values[knot - 1])
        return values[-1]

    def value_at_fraction(self, fraction: float) -> float:
        """Return the control (rad, or throttle 0..1) at a fraction of the servo's throw, from -1 to 1.

        The fraction is -1 and 1 at the end pulses, and 0 at the center pulse. A servo with only two knots has its
        center halfway between the end pulses.

        >>> ServoOutput(2, (1100.0, 1500.0, 1900.0), (0.5, 0.0, -0.5)).value_at_fraction(0.5)
        -0.25
        """
        first_pulse, last_pulse = self.pulses[0], self.pulses[-1]
        center = self.center_pulse if len(self.pulses) > 2 else 0.5 * (first_pulse + last_pulse)
        return self.value(center + fraction * (last_pulse - center if fraction > 0.0 else center - first_pulse))


@dataclass(frozen=True, slots=True)
class ServoMap:
    """The servos of the four controls."""

    elevator: ServoOutput
    aileron: ServoOutput
    rudder: ServoOutput
    throttle: ServoOutput

    def commands(self, pulses: Sequence[int]) -> Commands:
        """Return the controls for the pulses of an autopilot's outputs, microseconds, (outputs,)."""
        elevator = self.elevator
        aileron = self.aileron
        rudder = self.rudder
        throttle = self.throttle
        return Commands(
            elevator.value(pulses[elevator.number - 1]),
            aileron.value(pulses[aileron.number - 1]),
            rudder.value(pulses[rudder.number - 1]),
            throttle.value(pulses[throttle.number - 1]),
        )

    def parameters(self) -> dict[str, float]:
        """Return ArduPilot's parameters that describe these servo outputs."""
        parameters: dict[str, float] = {}
        for name, function in FUNCTIONS.items():
            output: ServoOutput = getattr(self, name)
            prefix = f"SERVO{output.number}_"
            parameters[f"{prefix}FUNCTION"] = float(function)
            parameters[f"{prefix}MIN"], parameters[f"{prefix}MAX"] = output.pulses[0], output.pulses[-1]
            parameters[f"{prefix}TRIM"] = output.center_pulse
        return parameters


def load_servo_map(aircraft: Aircraft) -> ServoMap:
    """Read the servos of an aircraft's controls from its folder.

    Raises FlightError, in one line, if an entry is missing, unknown or invalid.

    >>> from aircraft.catalog import load_aircraft
    >>> servos = load_servo_map(load_aircraft("aerosonde"))
    >>> servos.throttle.number, servos.throttle.value(1500)
    (3, 0.5)
    """
    file = aircraft.folder / SERVO_FILE
    try:
        table = read_toml(file, "servos")
    except OSError as error:
        raise FlightError(
            f"{file}: {error.strerror}; the autopilot's program needs this file, which states the control that each"
            f" servo of {aircraft.name} moves",
            file=file,
        ) from error
    except ValueError as error:
        raise FlightError(f"{file}: {' '.join(str(error).split())}", file=file) from error
    if set(table) != set(FUNCTIONS):
        raise FlightError(
            f"{file}: tables {', '.join(sorted(table))}: expected the tables {', '.join(FUNCTIONS)}", file=file
        )
    try:
        outputs = {name: _parse_output(name, entry) for name, entry in table.items()}
    except ValueError as error:
        raise FlightError(f"{file}: {error}", file=file) from None
    return ServoMap(**outputs)


def _parse_output(name: str, entry: Any) -> ServoOutput:
    """Return the servo of a control from its table in the file.

    Raises ValueError with the name of the entry.
    """
    unit = _UNITS[name]
    key = f"value_{unit}" if unit else "value"
    if not isinstance(entry, dict) or set(entry) != {"output", "pulse_us", key}:
        raise ValueError(f"{name}: expected keys output, pulse_us and {key}")
    number, pulses, values = entry["output"], entry["pulse_us"], entry[key]
    if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number <= _MAX_OUTPUT:
        raise ValueError(f"{name}.output = {number!r}: allowed 1..{_MAX_OUTPUT}")
    for label, numbers in (("pulse_us", pulses), (key, values)):
        are_finite = isinstance(numbers, list) and all(
            isinstance(number, int | float) and not isinstance(number, bool) and math.isfinite(number)
            for number in numbers
        )
        if not are_finite or len(numbers) < 2:
            raise ValueError(f"{name}.{label} = {numbers!r}: expected two finite numbers or more")
    if len(pulses) != len(values) or any(later <= earlier for earlier, later in pairwise(pulses)):
        raise ValueError(f"{name}.pulse_us = {pulses!r}: expected increasing numbers, as many as in {key}")
    factor = math.radians(1.0) if unit else 1.0
    return ServoOutput(number, tuple(map(float, pulses)), tuple(factor * value for value in values))
