"""The moments that a motion needs, by hand from Euler's equations."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from aircraft.identification.base_model import BaseModel
from aircraft.identification.electric_motor import ElectricMotor
from aircraft.identification.moments import fit_moments, required_moments
from planfly.identification.base_numbers import base_model
from tests.aircraft.identification.made_signals import steady

STILL = ElectricMotor((1e-6, 0.0, 0.0), (0.0, 0.0, 0.0), 0.06, 0.04, 0.0, 40.0)


def signals(rates: tuple[float, ...], changes: tuple[float, ...]) -> Any:
    one = np.ones(1)
    return SimpleNamespace(
        rates=np.array([rates]), rate_changes=np.array([changes]), airspeed=25.0 * one, throttle=0.0 * one, density=one
    )


def moments(base: BaseModel, rates: tuple[float, ...], changes: tuple[float, ...]) -> list[float]:
    found = required_moments(signals(rates, changes), base, STILL)
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


def test_the_propellers_torque_rolls_it_to_the_left() -> None:
    """What the motion does not show, the ailerons hold: as much to the right as the propeller's torque."""
    base = base_model(load_aircraft("aerosonde"))
    running: Any = SimpleNamespace(
        rates=np.zeros((1, 3)),
        rate_changes=np.zeros((1, 3)),
        airspeed=np.full(1, 25.0),
        throttle=np.full(1, 0.8),
        density=np.full(1, 1.2),
    )
    torque = float(base.motor.propeller_torque(running.airspeed, running.throttle, running.density)[0])
    assert 0.5 < torque < 3.0
    assert required_moments(running, base, base.motor)["roll"] == pytest.approx([torque])


def test_what_nothing_moves_keeps_its_prior() -> None:
    """40 % of damping and surfaces, 50 % of stiffness and of the roll from sideslip, 60 % of the rest (moments)."""
    base = base_model(load_aircraft("aerosonde"))
    still = steady()
    flat = np.zeros(len(still.airspeed))
    fits = fit_moments(still, base, flat, flat, STILL)
    sds = {axis: np.sqrt(np.diag(fit.covariance)) for axis, fit in fits.items()}
    # The constant of the pitching moment is seen in any flight.
    assert sds["pitch"][1:] == pytest.approx([0.5, 0.4, 0.4])
    assert sds["roll"][:4] == pytest.approx([0.5, 0.4, 0.4, 0.4])
    assert sds["yaw"][:5] == pytest.approx([0.4, 0.6, 0.4, 0.6, 0.4])
