"""Model a propeller as a disc that accelerates the air.

The model gives thrust and current by airspeed, throttle and density.

Beard and McLain, Small Unmanned Aircraft, first edition, section 4.3; the throttle sets the speed of the air behind the
disc. Published models of flying wings have this form.
"""

from dataclasses import dataclass, replace

import numpy as np

from world.arrays import Floats


@dataclass(frozen=True, slots=True)
class PropellerDisc:
    """Constants of a disc, SI.

    thrust_area: half of the disc's area times C_prop, m^2.
    exit_speed: speed of the air behind the disc at full throttle and nominal voltage, m/s.
    ducted: True if the exit speed rises from the airspeed, False if it rises from 0.
    losses: losses of motor and propeller, as a ratio to the power of the air.
    voltage: battery voltage, V.
    nominal: voltage of the stated exit speed, V.
    power: factor on all power.

    The thrust is thrust_area rho (v_e^2 - V^2), or thrust_area rho v_e (v_e - V) for a ducted disc; it is never
    negative.
    """

    thrust_area: float
    exit_speed: float
    ducted: bool
    losses: float
    voltage: float
    nominal: float
    power: float = 1.0

    def with_factors(
        self, thrust: float = 1.0, speed: float = 1.0, torque: float = 1.0, resistance: float = 1.0, idle: float = 1.0
    ) -> "PropellerDisc":
        """Return a copy of the disc with scaled properties, as `Motor.with_factors` describes.

        idle: has no effect, because a disc has no idle current.
        """
        del idle
        return replace(
            self,
            thrust_area=thrust * self.thrust_area,
            exit_speed=speed * self.exit_speed,
            power=torque * self.power,
            losses=resistance * self.losses,
        )

    def for_voltage(self, volts: float) -> "PropellerDisc":
        """Return a disc for another battery voltage, with the same thrust and power."""
        return replace(self, voltage=volts, nominal=volts)

    def thrust_and_current(
        self, airspeed: Floats, throttle: Floats, density: Floats, voltage: Floats | float | None = None
    ) -> tuple[Floats, Floats]:
        """Return the thrust, N, and the current from the battery, A, two arrays (n,).

        >>> disc = PropellerDisc(0.0157, 20.0, False, 2.0 / 3.0, 10.0, 10.0)
        >>> thrust, current = disc.thrust_and_current(np.full(1, 15.0), np.ones(1), np.full(1, 1.2))
        >>> round(float(thrust[0]), 3), round(float(current[0]), 2)
        (3.297, 9.62)
        """
        volts = self.voltage if voltage is None else voltage
        full_exit_speed = self.exit_speed * volts / self.nominal
        exit_speed = airspeed + throttle * (full_exit_speed - airspeed) if self.ducted else throttle * full_exit_speed
        first_factor = exit_speed if self.ducted else exit_speed + airspeed
        thrust = np.maximum(0.0, self.thrust_area * density * first_factor * (exit_speed - airspeed))
        power = self.power * (1.0 + self.losses) * 0.5 * thrust * (exit_speed + airspeed)
        return thrust, np.asarray(power / volts)

    def propeller_torque(self, airspeed: Floats, throttle: Floats, density: Floats) -> Floats:
        """Return zeros (n,): a disc has no torque."""
        del throttle, density
        return np.zeros_like(airspeed)
