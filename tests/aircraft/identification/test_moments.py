"""The moments that a motion needs, by hand from Euler's equations."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from aircraft.identification.base_model import BaseModel
from aircraft.identification.electric_motor import ElectricMotor
from aircraft.identification.moments import _turning
from planfly.identification.base_numbers import base_model

STILL = ElectricMotor((1e-6, 0.0, 0.0), (0.0, 0.0, 0.0), 0.06, 0.04, 0.0, 40.0)


def signals(rates: tuple[float, ...], changes: tuple[float, ...]) -> Any:
    one = np.ones(1)
    return SimpleNamespace(
        rates=np.array([rates]), rate_changes=np.array([changes]), airspeed=25.0 * one, throttle=0.0 * one, density=one
    )


def moments(base: BaseModel, rates: tuple[float, ...], changes: tuple[float, ...]) -> list[float]:
    found = _turning(signals(rates, changes), base, STILL)
    return [float(found[axis][0]) for axis in ("roll", "pitch", "yaw")]


def test_a_product_of_inertia_couples_roll_and_yaw() -> None:
    base = base_model(load_aircraft("aerosonde"))
    ixx, iyy, izz, ixz = base.inertia
    still = (0.0, 0.0, 0.0)
    assert moments(base, still, (1.0, 0.0, 0.0)) == pytest.approx([ixx, 0.0, -ixz], abs=1e-4)
    assert moments(base, still, (0.0, 1.0, 0.0)) == pytest.approx([0.0, iyy, 0.0], abs=1e-4)
    assert moments(base, still, (0.0, 0.0, 1.0)) == pytest.approx([-ixz, 0.0, izz], abs=1e-4)


def test_turning_about_two_axes_needs_a_moment_about_the_third() -> None:
    base = base_model(load_aircraft("aerosonde"))
    inertia = np.array(
        [[base.inertia[0], 0, -base.inertia[3]], [0, base.inertia[1], 0], [-base.inertia[3], 0, base.inertia[2]]]
    )
    for rates in ((0.3, 0.2, 0.0), (0.0, 0.2, 0.4), (0.3, 0.0, 0.4)):
        turning = np.array(rates)
        assert moments(base, rates, (0.0, 0.0, 0.0)) == pytest.approx(np.cross(turning, inertia @ turning), abs=1e-4)
