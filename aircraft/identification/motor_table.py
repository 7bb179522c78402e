"""Model a motor with its propeller by tables of thrust, battery power and torque.

The tables fit an aircraft model of any form.

The tables hold for one density and the nominal battery voltage. A motor that runs faster by a factor s at the same
throttle and advance ratio V / (n D) has s squared times the thrust and torque, and s cubed times the power, at s times
the airspeed (similarity of propellers: McCormick, Aerodynamics, Aeronautics, and Flight Mechanics, section 6.5).
"""

from dataclasses import dataclass, replace

import numpy as np

from world.arrays import Floats, Ints

# Smallest voltage for a current, V; without a battery the voltage is 0, and the current is the power.
_MIN_VOLTS = 1.0


@dataclass(frozen=True, slots=True)
class MotorTable:
    """Tables by airspeed and throttle, SI.

    airspeeds: (m,) rising.
    throttles: (k,) rising.
    thrusts, powers, torques: (m, k) thrust, N, power from the battery, W, and torque of the propeller, N m.
    density: density of the tables, kg/m^3.
    voltage: battery voltage, V.
    nominal: battery voltage of the tables, V; 0 for an engine, whose tables do not depend on a voltage.
    thrust_factor: factor on the thrust.
    speed: factor on the speed of the motor.
    load: factor on power and torque.
    """

    airspeeds: Floats
    throttles: Floats
    thrusts: Floats
    powers: Floats
    torques: Floats
    density: float
    voltage: float
    nominal: float
    thrust_factor: float = 1.0
    speed: float = 1.0
    load: float = 1.0

    def with_factors(
        self, thrust: float = 1.0, speed: float = 1.0, torque: float = 1.0, resistance: float = 1.0, idle: float = 1.0
    ) -> "MotorTable":
        """Return a copy with scaled thrust, speed and torque; the factor of the torque also scales the power.

        resistance, idle: no effect, because a table does not separate the losses of the motor.
        """
        del resistance, idle
        return replace(
            self, thrust_factor=self.thrust_factor * thrust, speed=self.speed * speed, load=self.load * torque
        )

    def for_voltage(self, volts: float) -> "MotorTable":
        """Return a motor for another battery voltage, with the same thrust and power."""
        return replace(self, voltage=volts, nominal=volts if self.nominal > 0.0 else 0.0)

    def thrust_and_current(
        self, airspeed: Floats, throttle: Floats, density: Floats, voltage: Floats | float | None = None
    ) -> tuple[Floats, Floats]:
        """Return the thrust, N, and the current from the battery, A, two arrays (n,).

        >>> table = np.array([[0.0, 10.0], [-1.0, 8.0]])
        >>> motor = MotorTable(np.array([0.0, 10.0]), np.array([0.0, 1.0]), table, 20.0 * table, table, 1.2, 10.0, 10.0)
        >>> thrust, current = motor.thrust_and_current(np.full(1, 5.0), np.ones(1), np.full(1, 1.2))
        >>> float(thrust[0]), float(current[0])
        (9.0, 18.0)
        """
        volts = self.voltage if voltage is None else voltage
        speed = self.speed * (volts / self.nominal if self.nominal > 0.0 else 1.0)
        thrust = self._interpolate(self.thrusts, airspeed / speed, throttle)
        power = self._interpolate(self.powers, airspeed / speed, throttle)
        ratio = density / self.density
        current = self.load * ratio * speed**3 * power / np.maximum(volts, _MIN_VOLTS)
        return np.asarray(self.thrust_factor * ratio * speed**2 * thrust), np.asarray(np.maximum(0.0, current))

    def propeller_torque(self, airspeed: Floats, throttle: Floats, density: Floats) -> Floats:
        """Return the propeller torque, N m, (n,); the reaction to a positive torque rolls to the left."""
        torque = self._interpolate(self.torques, airspeed / self.speed, throttle)
        return np.asarray(self.load * density / self.density * self.speed**2 * torque)

    def _interpolate(self, table: Floats, airspeed: Floats, throttle: Floats) -> Floats:
        """Interpolate a table (m, k) linearly; outside the table, the value at its edge applies."""
        row, row_fraction = _find_cells(self.airspeeds, airspeed)
        column, column_fraction = _find_cells(self.throttles, throttle)
        slow_values = table[row, column] * (1.0 - column_fraction) + table[row, column + 1] * column_fraction
        fast_values = table[row + 1, column] * (1.0 - column_fraction) + table[row + 1, column + 1] * column_fraction
        return np.asarray(slow_values * (1.0 - row_fraction) + fast_values * row_fraction)


def _find_cells(grid: Floats, values: Floats) -> tuple[Ints, Floats]:
    """Return the index of the grid point below each value, and the value's fraction of the grid step.

    A value beyond an end of the grid is clipped to the end.
    """
    clipped = np.clip(values, grid[0], grid[-1])
    lower = np.clip(np.searchsorted(grid, clipped, side="right") - 1, 0, len(grid) - 2)
    return lower, (clipped - grid[lower]) / (grid[lower + 1] - grid[lower])
