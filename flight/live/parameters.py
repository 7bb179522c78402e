"""The vehicle's parameters: what a ground station reads, and the one that it may set."""

import math
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

FORCE = "PFLY_FORCE"
# Parameters sent a second to a station that asked for all.
PARAMETERS_PER_SECOND = 200.0


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter; values travel as float32.  high is None where a station may not set it."""

    name: str
    value: float
    low: float = 0.0
    high: float | None = None


@dataclass(slots=True)
class Parameters:
    """Parameters by number and by name; names as ArduPilot's, where it has one for the same thing."""

    entries: list[Parameter]
    _numbers: dict[str, int] = field(init=False)

    def __post_init__(self) -> None:
        """Index the names."""
        self._numbers = {entry.name: k for k, entry in enumerate(self.entries)}

    def __getitem__(self, name: str) -> float:
        """Value of a parameter.  Raises KeyError."""
        return self.entries[self._numbers[name]].value

    def put(self, name: str, value: float) -> None:
        """Change a value from within.  Raises KeyError."""
        k = self._numbers[name]
        old = self.entries[k]
        self.entries[k] = Parameter(name, value, old.low, old.high)

    def message(self, number: int) -> Any:
        """PARAM_VALUE of a parameter, by number."""
        entry = self.entries[number]
        return mavlink.MAVLink_param_value_message(
            entry.name.encode(), entry.value, mavlink.MAV_PARAM_TYPE_REAL32, len(self.entries), number
        )

    def find(self, name: bytes, number: int) -> int | None:
        """Number of the parameter that a PARAM_REQUEST_READ or PARAM_SET names (number -1: by name), None if none."""
        if number >= 0:
            return number if number < len(self.entries) else None
        return self._numbers.get(_text(name))

    def set(self, name: bytes, value: float) -> tuple[int | None, str]:
        """Set a parameter as a station asks: its number (None: no such one), and why it was refused ("" if set)."""
        number = self._numbers.get(_text(name))
        if number is None:
            return None, f"{_text(name)}: no such parameter"
        entry = self.entries[number]
        if entry.high is None:
            return number, f"{entry.name} is fixed by the aircraft or the scenario: {entry.value:g} kept"
        if not (math.isfinite(value) and entry.low <= value <= entry.high):
            return number, f"{entry.name} {value:g}: allowed {entry.low:g}..{entry.high:g}; {entry.value:g} kept"
        self.put(entry.name, value)
        return number, ""


def vehicle_parameters(
    *, airspeed: float, slowest: float, fastest: float, max_bank_deg: float, system: int, speed: float
) -> Parameters:
    """Parameters of a vehicle: ArduPilot's names, in the order of the alphabet.

    airspeed, slowest, fastest: m/s.
    max_bank_deg: degrees.
    system: the vehicle's MAVLink system id.
    speed: times real time.

    >>> parameters = vehicle_parameters(
    ...     airspeed=25.0, slowest=18.0, fastest=31.0, max_bank_deg=30.0, system=1, speed=1.0
    ... )
    >>> parameters["AIRSPEED_CRUISE"]
    25.0
    >>> parameters.set(b"AIRSPEED_MAX", 99.0)
    (1, 'AIRSPEED_MAX is fixed by the aircraft or the scenario: 31 kept')
    """
    return Parameters(
        [
            Parameter("AIRSPEED_CRUISE", airspeed),
            Parameter("AIRSPEED_MAX", fastest),
            Parameter("AIRSPEED_MIN", slowest),
            Parameter("ARMING_CHECK", 1.0),
            Parameter("ARMING_REQUIRE", 1.0),
            Parameter("FENCE_TOTAL", 0.0),
            Parameter("MIS_TOTAL", 0.0),
            Parameter(FORCE, 0.0, 0.0, 1.0),
            Parameter("RALLY_TOTAL", 0.0),
            Parameter("ROLL_LIMIT_DEG", max_bank_deg),
            Parameter("SIM_SPEEDUP", speed),
            Parameter("SYSID_THISMAV", float(system)),
        ]
    )


def _text(name: bytes | str) -> str:
    data = name.encode("latin-1", "replace") if isinstance(name, str) else name
    return data.split(b"\0")[0].decode("ascii", "replace")[:16]
