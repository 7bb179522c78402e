"""Read the servo outputs of an aircraft's ``ardupilot.toml``, and the controls that they move."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from world.arrays import Floats
from world.errors import FlightError
from world.files import read_toml


@dataclass(frozen=True, slots=True)
class ServoOutput:
    """A servo output and the control that it moves.

    output: number of the output, from 1.
    pulse: pulse lengths, increasing, us.
    value: value of the control at each pulse: deflection, rad, or fraction of full throttle.
    """

    output: int
    pulse: tuple[float, ...]
    value: tuple[float, ...]

    def control(self, pulses: Floats) -> Floats:
        """Return the value of the control for each pulse, (n,).

        It is constant beyond the shortest and the longest pulse.

        pulses: pulse lengths, us, (n,).

        >>> ServoOutput(3, (1000.0, 2000.0), (0.0, 1.0)).control(np.array([900.0, 1250.0]))
        array([0.  , 0.25])
        """
        return np.asarray(np.interp(pulses, self.pulse, self.value))

    @property
    def reversed(self) -> "ServoOutput":
        """The same output with the opposite direction."""
        return ServoOutput(self.output, self.pulse, tuple(-value for value in self.value))


def read_servos(file: Path) -> Mapping[str, ServoOutput]:
    """Read a file of servo outputs; return the output of each control, by name.

    The controls are elevator, aileron, rudder and throttle.

    Raises FlightError for an invalid file.

    >>> from aircraft.catalog import load_aircraft
    >>> outputs = read_servos(load_aircraft("aerosonde").folder / "ardupilot.toml")
    >>> outputs["elevator"].output, outputs["throttle"].value
    (2, (0.0, 1.0))
    """
    try:
        table = read_toml(file, "servo outputs")
        outputs = {}
        for name, entry in table.items():
            angles = entry.get("value") or [math.radians(angle) for angle in entry["value_deg"]]
            pulses = [float(pulse) for pulse in entry["pulse_us"]]
            if len(pulses) != len(angles) or len(pulses) < 2 or any(np.diff(pulses) <= 0.0):
                raise ValueError("pulse_us must increase, and have one value each")
            outputs[name] = ServoOutput(int(entry["output"]), tuple(pulses), tuple(float(angle) for angle in angles))
    except OSError as error:
        raise FlightError(f"{file}: {error.strerror}", file=file) from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        message = f"{file}: {' '.join(str(error).split())}: not a table of servo outputs"
        raise FlightError(message, file=file) from None
    return outputs
