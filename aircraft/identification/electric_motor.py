"""Model an electric motor with a fixed propeller.

The model gives thrust and current by airspeed, throttle and density.

Beard and McLain, Small Unmanned Aircraft, second edition, section 4.3: the motor's torque KQ ((V_in - KV w) / R - i0)
equals the propeller's torque q2 w^2 + q1 w + q0. A motor that does not brake windmills at zero current.
"""

from dataclasses import dataclass, replace

import numpy as np

from world.arrays import Floats


@dataclass(frozen=True, slots=True)
class ElectricMotor:
    """Constants of a motor and its propeller, SI.

    torque: (3,) coefficients of rho w^2, rho V w and rho V^2 in the propeller's torque.
    thrust: (3,) coefficients of the same terms in its thrust.
    back_voltage: KV, V s/rad, which is also the torque constant KQ.
    resistance: ohm.
    idle_current: i0, A.
    voltage: battery voltage, V.
    windmill: fraction of the formula's thrust that is applied below zero.
    power_ratio: ratio of the battery's power for the drive to the power of these formulas.
    avionics: power of autopilot, radios and servos, W.
    """

    torque: tuple[float, float, float]
    thrust: tuple[float, float, float]
    back_voltage: float
    resistance: float
    idle_current: float
    voltage: float
    windmill: float = 1.0
    power_ratio: float = 1.0
    avionics: float = 0.0

    def with_factors(
        self, thrust: float = 1.0, speed: float = 1.0, torque: float = 1.0, resistance: float = 1.0, idle: float = 1.0
    ) -> "ElectricMotor":
        """Return a copy of the motor with scaled properties, as `Motor.with_factors` describes."""
        return replace(
            self,
            thrust=_scale_coefficients(thrust, self.thrust),
            torque=_scale_coefficients(torque, self.torque),
            back_voltage=self.back_voltage / speed,
            resistance=self.resistance * resistance,
            idle_current=self.idle_current * idle,
        )

    def for_voltage(self, volts: float) -> "ElectricMotor":
        """Return a motor wound for another voltage, with the same torque and power at the same speed."""
        ratio = volts / self.voltage
        return replace(
            self,
            voltage=volts,
            back_voltage=self.back_voltage * ratio,
            resistance=self.resistance * ratio * ratio,
            idle_current=self.idle_current / ratio,
        )

    def speed(self, airspeed: Floats, throttle: Floats, density: Floats, voltage: Floats | float) -> Floats:
        """Return the propeller speed, rad/s, (n,).

        throttle: 0..1.
        voltage: battery voltage, V.
        airspeed: m/s, (n,).
        density: kg/m^3, (n,).
        """
        q2, q1, q0 = self._torque_coefficients(airspeed, density)
        kv = self.back_voltage
        motor_torque = kv * voltage * throttle / self.resistance
        driven_speed = _larger_roots(q2, q1 + kv * kv / self.resistance, q0 - motor_torque + kv * self.idle_current)
        windmill_speed = _larger_roots(q2, q1, q0 + kv * self.idle_current)
        return np.maximum(0.0, np.maximum(driven_speed, windmill_speed))

    def thrust_and_current(
        self, airspeed: Floats, throttle: Floats, density: Floats, voltage: Floats | float | None = None
    ) -> tuple[Floats, Floats]:
        """Return the thrust, N, and the current from the battery, A, two arrays (n,).

        voltage: voltage of the battery, V; None for the motor's own `voltage`.

        >>> motor = ElectricMotor((4.48e-6, 5.27e-5, -2.18e-3), (1.58e-4, -1.26e-3, -2.78e-2), 0.0659, 0.042, 1.5, 44.4)
        >>> still, full, sea = np.zeros(1), np.ones(1), np.full(1, 1.225)
        >>> thrust, current = motor.thrust_and_current(still + 25.0, full, sea)
        >>> round(float(thrust[0])), round(float(current[0]))
        (37, 28)
        """
        volts = self.voltage if voltage is None else voltage
        speed = self.speed(airspeed, throttle, density, volts)
        a, b, c = self.thrust
        thrust = density * (a * speed * speed + b * airspeed * speed + c * airspeed * airspeed)
        thrust = np.where(thrust < 0.0, self.windmill * thrust, thrust)
        current = np.maximum(0.0, (volts * throttle - self.back_voltage * speed) / self.resistance)
        return thrust, self.power_ratio * throttle * current + self.avionics / volts

    def propeller_torque(self, airspeed: Floats, throttle: Floats, density: Floats) -> Floats:
        """Return the propeller torque, N m, (n,); the reaction to a positive torque rolls to the left."""
        speed = self.speed(airspeed, throttle, density, self.voltage)
        q2, q1, q0 = self._torque_coefficients(airspeed, density)
        return np.asarray(q2 * speed * speed + q1 * speed + q0)

    def _torque_coefficients(self, airspeed: Floats, density: Floats) -> tuple[Floats, Floats, Floats]:
        """Return q2, q1 and q0 of the propeller's torque q2 w^2 + q1 w + q0, three arrays (n,)."""
        a, b, c = self.torque
        return density * a, density * b * airspeed, density * c * airspeed * airspeed


def _scale_coefficients(factor: float, coefficients: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return three coefficients multiplied by a factor."""
    return factor * coefficients[0], factor * coefficients[1], factor * coefficients[2]


def _larger_roots(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return the larger root of a x^2 + b x + c, (n,); without a real root, the position of the minimum."""
    return np.asarray((np.sqrt(np.maximum(0.0, b * b - 4.0 * a * c)) - b) / (2.0 * a))
