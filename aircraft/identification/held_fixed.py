"""What an identification holds fixed and does not know: each with the standard deviation by which it is changed."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aircraft.identification.alignment import Signals
from aircraft.identification.base_model import BaseModel
from aircraft.identification.flow import VANE_BAND

Floats = NDArray[np.float64]
Changed = tuple[Signals, BaseModel]


@dataclass(frozen=True, slots=True)
class Held:
    """One thing that is held fixed.

    name: for people, with its standard deviation.
    change: signals and model with it one standard deviation further.
    level: rad, by which the autopilot's level is changed.
    air: m/s, by which air that rises is changed.
    of_current: whether it only counts where the battery's current was logged.
    """

    name: str
    change: Callable[[Signals, BaseModel], Changed]
    level: float = 0.0
    air: float = 0.0
    of_current: bool = False

    def tilt(self, signals: Signals) -> float:
        """By how much the flow's angle to the level is changed, rad."""
        return self.level + (self.air / float(signals.airspeed.mean()) if self.air else 0.0)

    def applies(self, *, with_current: bool) -> bool:
        """Whether it counts for logs with or without the battery's current."""
        return with_current or not self.of_current


def _further(value: float, share: float, least: float) -> float:
    """A value one standard deviation further from 0: a share of it, and no less than what its class has.

    >>> _further(-2.0, 0.5, 0.1), _further(0.0, 0.5, 0.1)
    (-3.0, 0.1)
    """
    return value + float(np.copysign(max(share * abs(value), least), value))


def _coefficient(name: str, share: float, least: float = 0.0) -> Callable[[Signals, BaseModel], Changed]:
    def change(signals: Signals, base: BaseModel) -> Changed:
        value = _further(getattr(base.coefficients, name), share, least)
        return signals, replace(base, coefficients=replace(base.coefficients, **{name: value}))

    return change


def _product_of_inertia(share: float, least: float) -> Callable[[Signals, BaseModel], Changed]:
    """least: of the geometric mean of Ixx and Izz."""

    def change(signals: Signals, base: BaseModel) -> Changed:
        ixx, iyy, izz, ixz = base.inertia
        changed = _further(ixz, share, least * float(np.sqrt(ixx * izz)))
        return signals, replace(base, inertia=(ixx, iyy, izz, changed))

    return change


def _airspeed(signals: Signals, base: BaseModel) -> Changed:
    return replace(signals, airspeed=signals.airspeed * (1.0 + signals.airspeed_sd)), base


def _acceleration(axis: int, bias: float) -> Callable[[Signals, BaseModel], Changed]:
    def change(signals: Signals, base: BaseModel) -> Changed:
        return replace(signals, acceleration=signals.acceleration + bias * np.eye(3)[axis]), base

    return change


def _noise(axes: tuple[int, ...]) -> Callable[[Signals, BaseModel], Changed]:
    """As much noise of the accelerometers again as there is: what it hides of a slope, more of it hides as much again.

    Cook and Stefanski 1994 (SIMEX).  The noise is what is faster than the vane, taken as white.
    """

    def change(signals: Signals, base: BaseModel) -> Changed:
        made, draw = signals.acceleration.copy(), np.random.default_rng(1)

        def fast(values: Floats) -> float:
            return float((values - signals.smooth(values, VANE_BAND)).std())

        for axis in axes:
            white = draw.standard_normal(len(made))
            made[:, axis] += fast(made[:, axis]) / fast(white) * white
        return replace(signals, acceleration=made), base

    return change


def _late_force(seconds: float) -> Callable[[Signals, BaseModel], Changed]:
    return lambda signals, base: (
        replace(signals, acceleration=signals.delayed(signals.acceleration, seconds)),
        base,
    )


def _late_surfaces(seconds: float) -> Callable[[Signals, BaseModel], Changed]:
    return lambda signals, base: (replace(signals, surfaces=signals.delayed(signals.surfaces, seconds)), base)


def _current(factor: float) -> Callable[[Signals, BaseModel], Changed]:
    return lambda signals, base: (replace(signals, current=signals.current * factor), base)


def _same(signals: Signals, base: BaseModel) -> Changed:
    return signals, base


NOISE = "noise of the accelerometers"
_LEVEL = float(np.radians(0.2))
# Doubts are shares of the base's value.  Bases leave out what is small, and a value of 0 is no more certain than the
# Aerosonde's (Beard and McLain, Small Unmanned Aircraft, second edition, table E.2): its doubt is the least.
HELD_FIXED = (
    Held("lift of the elevator (50 %)", _coefficient("lift_elevator", 0.5)),
    Held("lift of the pitch rate (50 %)", _coefficient("lift_rate", 0.5)),
    Held("side force of sideslip (30 %)", _coefficient("side_beta", 0.3)),
    Held("side force of the rudder (50 %)", _coefficient("side_rudder", 0.5, 0.095)),
    Held("side force of the ailerons (100 %)", _coefficient("side_aileron", 1.0, 0.075)),
    Held("roll of the rudder (100 %)", _coefficient("roll_rudder", 1.0, 0.0024)),
    Held("product of inertia (50 %)", _product_of_inertia(0.5, 0.05)),
    Held("clock of the accelerometers (15 ms)", _late_force(0.015)),
    Held("clock of the servos (15 ms)", _late_surfaces(0.015)),
    Held("airspeed (as the wind triangle has it)", _airspeed),
    # A level that is off shows as a bias of the forward accelerometer as well, which is taken off.
    Held("level of the autopilot (0.2 deg)", _acceleration(0, _LEVEL * 9.80665), level=_LEVEL),
    Held("mean vertical air (0.04 m/s)", _same, air=0.04),
    Held("downward accelerometer (0.03 m/s2)", _acceleration(2, 0.03)),
    Held(NOISE, _noise((1, 2))),
    Held("scale of the current (2 %)", _current(1.02), of_current=True),
)
