"""A propeller as a disc that speeds the air up: thrust and current at an airspeed, a throttle and a density.

Beard and McLain, Small Unmanned Aircraft, first edition, section 4.3; the throttle goes with the speed of the air
behind the disc.  Published models of flying wings have this form.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PropellerDisc:
    """Constants of a disc, SI.

    pull: half of its area times C_prop, m^2.
    exit_speed: of the air behind it at full throttle and the stated voltage, m/s.
    ducted: whether the exit speed goes from the airspeed up, or from 0.
    losses: what motor and propeller lose beside the air's own power, as a share of that.
    voltage: of the battery, V.  nominal: at which the exit speed is as stated, V.
    power: factor on all power.

    The thrust is pull rho (v_e^2 - V^2), of a ducted one pull rho v_e (v_e - V), and never brakes.
    """

    pull: float
    exit_speed: float
    ducted: bool
    losses: float
    voltage: float
    nominal: float
    power: float = 1.0

    def changed(
        self, thrust: float = 1.0, speed: float = 1.0, torque: float = 1.0, resistance: float = 1.0, idle: float = 1.0
    ) -> "PropellerDisc":
        """With factors on thrust, exit speed, the power that a thrust takes, and losses.

        idle: of no effect; a disc has no idle current.
        """
        del idle
        return replace(
            self,
            pull=thrust * self.pull,
            exit_speed=speed * self.exit_speed,
            power=torque * self.power,
            losses=resistance * self.losses,
        )

    def for_voltage(self, volts: float) -> "PropellerDisc":
        """The same thrust and power with a battery of another voltage."""
        return replace(self, voltage=volts, nominal=volts)

    def thrust_and_current(
        self, airspeed: Floats, throttle: Floats, density: Floats, voltage: Floats | float | None = None
    ) -> tuple[Floats, Floats]:
        """Thrust (n,), N, and current from the battery (n,), A.

        >>> disc = PropellerDisc(0.0157, 20.0, False, 2.0 / 3.0, 10.0, 10.0)
        >>> thrust, current = disc.thrust_and_current(np.full(1, 15.0), np.ones(1), np.full(1, 1.2))
        >>> round(float(thrust[0]), 3), round(float(current[0]), 2)
        (3.297, 9.62)
        """
        volts = self.voltage if voltage is None else voltage
        full = self.exit_speed * volts / self.nominal
        behind = airspeed + throttle * (full - airspeed) if self.ducted else throttle * full
        first = behind if self.ducted else behind + airspeed
        thrust = np.maximum(0.0, self.pull * density * first * (behind - airspeed))
        power = self.power * (1.0 + self.losses) * 0.5 * thrust * (behind + airspeed)
        return thrust, np.asarray(power / volts)

    def reaction(self, airspeed: Floats, throttle: Floats, density: Floats) -> Floats:
        """Torque (n,), N m: none, of a disc."""
        del throttle, density
        return np.zeros_like(airspeed)
