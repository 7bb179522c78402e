"""Interface of a motor with its propeller for identification."""

from typing import Protocol, Self

from world.arrays import Floats


class Motor(Protocol):
    """Thrust and current at an airspeed (m/s), a throttle (0..1) and a density (kg/m^3)."""

    @property
    def voltage(self) -> float:
        """Battery voltage, V."""

    def with_factors(
        self, thrust: float = 1.0, speed: float = 1.0, torque: float = 1.0, resistance: float = 1.0, idle: float = 1.0
    ) -> Self:
        """Return a motor with factors on thrust, speed per volt, torque or power for a thrust, and losses."""

    def for_voltage(self, volts: float) -> Self:
        """Return a motor for another battery voltage, with the same thrust and power at full throttle."""

    def thrust_and_current(
        self, airspeed: Floats, throttle: Floats, density: Floats, voltage: Floats | float | None = None
    ) -> tuple[Floats, Floats]:
        """Return thrust (n,), N, and current from the battery (n,), A."""

    def reaction(self, airspeed: Floats, throttle: Floats, density: Floats) -> Floats:
        """Return the propeller's torque (n,), N m, whose reaction rolls the aircraft left."""
