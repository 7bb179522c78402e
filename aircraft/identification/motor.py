"""What identification needs of a motor with its propeller, whatever its form."""

from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Motor(Protocol):
    """Thrust and current at an airspeed (m/s), a throttle (0..1) and a density (kg/m^3)."""

    @property
    def voltage(self) -> float:
        """Of the battery, V."""

    def changed(
        self, thrust: float = 1.0, speed: float = 1.0, torque: float = 1.0, resistance: float = 1.0, idle: float = 1.0
    ) -> Self:
        """With factors on thrust, motor speed per volt, the torque or power that a thrust takes, and losses."""

    def for_voltage(self, volts: float) -> Self:
        """One for a battery of another voltage, with the same thrust and power at full throttle."""

    def thrust_and_current(
        self, airspeed: Floats, throttle: Floats, density: Floats, voltage: Floats | float | None = None
    ) -> tuple[Floats, Floats]:
        """Thrust (n,), N, and current from the battery (n,), A."""

    def reaction(self, airspeed: Floats, throttle: Floats, density: Floats) -> Floats:
        """Torque of the propeller (n,), N m, whose reaction rolls the aircraft left."""
