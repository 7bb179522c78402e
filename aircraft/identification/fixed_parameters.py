"""Define the uncertain quantities that an identification holds fixed, with their standard deviations."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aircraft.identification.alignment import Signals, invert_first_order_lag
from aircraft.identification.base_model import BaseModel
from aircraft.identification.flight_record import apply_delay, apply_lag
from aircraft.identification.flow import VANE_CUTOFF_HZ
from world.arrays import Floats

# Signals and model after a change.
Changed = tuple[Signals, BaseModel]


@dataclass(frozen=True, slots=True)
class FixedParameter:
    """One quantity that is held fixed, and the change by one standard deviation.

    name: name in texts, with the standard deviation.
    change: function that returns the changed signals and model.
    level: change of the autopilot's level, rad.
    vertical_air: change of the vertical air velocity, m/s.
    needs_current: True if the quantity matters only for logs with the battery's current.
    """

    name: str
    change: Callable[[Signals, BaseModel], Changed]
    level: float = 0.0
    vertical_air: float = 0.0
    needs_current: bool = False

    def tilt(self, signals: Signals) -> float:
        """Return the change of the angle between the airflow and the level of the autopilot, rad."""
        return self.level + (self.vertical_air / float(signals.airspeed.mean()) if self.vertical_air else 0.0)

    def applies(self, *, with_current: bool) -> bool:
        """Return True if the quantity matters for a log.

        with_current: True if the log has the battery's current.
        """
        return with_current or not self.needs_current


def _move_one_sd(value: float, relative_sd: float, min_sd: float) -> float:
    """Return a value moved away from 0 by one standard deviation.

    relative_sd, min_sd: standard deviation as a ratio to the value, and smallest standard deviation.

    >>> _move_one_sd(-2.0, 0.5, 0.1), _move_one_sd(0.0, 0.5, 0.1)
    (-3.0, 0.1)
    """
    return value + float(np.copysign(max(relative_sd * abs(value), min_sd), value))


def _coefficient_change(name: str, relative_sd: float, min_sd: float = 0.0) -> Callable[[Signals, BaseModel], Changed]:
    """Return a function that changes a coefficient by one standard deviation, as `_move_one_sd` does.

    name: name of the coefficient in `aircraft.identification.base_model.Coefficients`.
    """

    def change(signals: Signals, base: BaseModel) -> Changed:
        """Return the signals, and the model with the changed coefficient."""
        value = _move_one_sd(getattr(base.coefficients, name), relative_sd, min_sd)
        return signals, replace(base, coefficients=replace(base.coefficients, **{name: value}))

    return change


def _product_of_inertia_change(relative_sd: float, min_sd_ratio: float) -> Callable[[Signals, BaseModel], Changed]:
    """Return a function that changes the product of inertia by one standard deviation.

    relative_sd: standard deviation as a ratio to Ixz.
    min_sd_ratio: smallest standard deviation, as a ratio to the geometric mean of Ixx and Izz.
    """

    def change(signals: Signals, base: BaseModel) -> Changed:
        """Return the signals, and the model with the changed product of inertia."""
        ixx, iyy, izz, ixz = base.inertia
        new_ixz = _move_one_sd(ixz, relative_sd, min_sd_ratio * float(np.sqrt(ixx * izz)))
        return signals, replace(base, inertia=(ixx, iyy, izz, new_ixz))

    return change


def _acceleration_bias(axis: int, bias: float) -> Callable[[Signals, BaseModel], Changed]:
    """Return a function that adds a bias (m/s^2) to an accelerometer.

    axis: 0 forward, 1 right, 2 down.
    """

    def change(signals: Signals, base: BaseModel) -> Changed:
        """Return the signals with the bias, and the model."""
        return replace(signals, acceleration=signals.acceleration + bias * np.eye(3)[axis]), base

    return change


def _noise_doubling(axes: tuple[int, ...]) -> Callable[[Signals, BaseModel], Changed]:
    """Return a function that doubles the noise power of the accelerometers.

    This shows the bias of the slopes, because the noise that is already present has the same effect as the added noise
    (Cook and Stefanski 1994, SIMEX). The noise is the signal above the cutoff of the vane, and is assumed to be white.
    """

    def change(signals: Signals, base: BaseModel) -> Changed:
        """Return the signals with additional noise, and the model."""
        noisy, generator = signals.acceleration.copy(), np.random.default_rng(1)

        def noise_level(values: Floats) -> float:
            """Return the standard deviation of values (n,) above the vane's cutoff."""
            return float((values - signals.smooth(values, VANE_CUTOFF_HZ)).std())

        for axis in axes:
            white_noise = generator.standard_normal(len(noisy))
            noisy[:, axis] += noise_level(noisy[:, axis]) / noise_level(white_noise) * white_noise
        return replace(signals, acceleration=noisy), base

    return change


def _servo_lag_trade(seconds: float) -> Callable[[Signals, BaseModel], Changed]:
    """Return a function that increases the servos' lag and shortens their delay by the same time, s."""

    def change(signals: Signals, base: BaseModel) -> Changed:
        """Return the signals with the changed lag and delay of the surfaces, and the model."""
        surfaces = np.empty_like(signals.surfaces)
        for start_row, end_row in zip(signals.edges[:-1], signals.edges[1:], strict=True):
            commands = invert_first_order_lag(signals.surfaces[start_row:end_row], base.servo_lag, signals.hertz)
            surfaces[start_row:end_row] = apply_delay(apply_lag(commands, base.servo_lag + seconds), -seconds)
        return replace(signals, surfaces=surfaces), base

    return change


# Name of the quantity for the accelerometers' noise.
ACCELEROMETER_NOISE = "noise of the accelerometers"
# Standard deviation of the autopilot's level, rad.
_LEVEL_SD_RAD = float(np.radians(0.2))
# The standard deviation of a coefficient is a ratio to the base model's value, and at least a smallest value. Base
# models omit small coefficients, and their value of 0 is not certain: the smallest standard deviation is from the
# Aerosonde's coefficients (Beard and McLain, Small Unmanned Aircraft, second edition, table E.2).
FIXED_PARAMETERS = (
    FixedParameter("lift of the elevator (50 %)", _coefficient_change("lift_elevator", 0.5)),
    FixedParameter("lift of the pitch rate (50 %)", _coefficient_change("lift_rate", 0.5)),
    FixedParameter("side force of sideslip (30 %)", _coefficient_change("side_beta", 0.3)),
    FixedParameter("side force of the rudder (50 %)", _coefficient_change("side_rudder", 0.5, 0.095)),
    FixedParameter("side force of the ailerons (100 %)", _coefficient_change("side_aileron", 1.0, 0.075)),
    FixedParameter("roll of the rudder (100 %)", _coefficient_change("roll_rudder", 1.0, 0.0024)),
    FixedParameter("product of inertia (50 %)", _product_of_inertia_change(0.5, 0.05)),
    FixedParameter(
        "clock of the accelerometers (15 ms)",
        lambda signals, base: (replace(signals, acceleration=signals.delay(signals.acceleration, 0.015)), base),
    ),
    FixedParameter(
        "clock of the servos (15 ms)",
        lambda signals, base: (replace(signals, surfaces=signals.delay(signals.surfaces, 0.015)), base),
    ),
    FixedParameter("lag of the servos (15 ms, at the same total delay)", _servo_lag_trade(0.015)),
    FixedParameter(
        "airspeed (as the wind triangle has it)",
        lambda signals, base: (replace(signals, airspeed=signals.airspeed * (1.0 + signals.airspeed_sd)), base),
    ),
    # An error of the level also shows as a bias of the forward accelerometer, which is removed.
    FixedParameter(
        "level of the autopilot (0.2 deg)", _acceleration_bias(0, _LEVEL_SD_RAD * 9.80665), level=_LEVEL_SD_RAD
    ),
    FixedParameter("mean vertical air (0.04 m/s)", lambda signals, base: (signals, base), vertical_air=0.04),
    FixedParameter("downward accelerometer (0.03 m/s2)", _acceleration_bias(2, 0.03)),
    FixedParameter(ACCELEROMETER_NOISE, _noise_doubling((1, 2))),
    FixedParameter(
        "scale of the current (2 %)",
        lambda signals, base: (replace(signals, current=signals.current * 1.02), base),
        needs_current=True,
    ),
)
