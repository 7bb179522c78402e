"""Define the interface of a motor with its propeller, for identification."""

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
        """Return a copy of the motor with scaled properties.

        thrust: factor on the thrust of the propeller.
        speed: factor on the speed per volt, or on the exit speed of a propeller disc.
        torque: factor on the torque of the propeller, or on the power at a given thrust.
        resistance: factor on the resistance of the winding, or on other losses.
        idle: factor on the current without load.
        """

    def for_voltage(self, volts: float) -> Self:
        """Return a motor for another battery voltage, with the same thrust and power at full throttle."""

    def thrust_and_current(
        self, airspeed: Floats, throttle: Floats, density: Floats, voltage: Floats | float | None = None
    ) -> tuple[Floats, Floats]:
        """Return the thrust, N, and the current from the battery, A, two arrays (n,)."""

    def propeller_torque(self, airspeed: Floats, throttle: Floats, density: Floats) -> Floats:
        """Return the propeller torque, N m, (n,).

        A positive torque rolls the aircraft to the left by its reaction.
        """
