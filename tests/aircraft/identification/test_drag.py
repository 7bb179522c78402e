"""The forward force by hand, and what drag and motor are before any log."""

import math

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from aircraft.identification.drag import AlphaUncertainty, drag_priors, forward_forces
from aircraft.identification.flow import Flow
from aircraft.identification.parameters import prior_means
from planfly.identification.base_numbers import base_model
from tests.aircraft.identification.made_signals import steady


def test_priors_are_as_stated() -> None:
    """Drag 40 %, induced 30 %, thrust 20 %, motor speed 7 %, torque 10 %; then what is estimated beside them."""
    stated = [0.4, 0.3, 0.2, 0.07, 0.1, 0.01, 0.2, 0.3, 0.02, 0.5, 1.0, 1.0]
    means, sds = drag_priors(with_current=False)
    assert sds == pytest.approx(stated)
    assert means.tolist() == [1.0] * 5 + [0.0] * 7
    # A logged voltage is known four times as well.
    stated[8] = 0.005
    assert drag_priors(with_current=True)[1] == pytest.approx(stated)


def test_the_forward_force_is_lift_drag_and_thrust_summed_by_hand() -> None:
    base = base_model(load_aircraft("aerosonde"))
    alpha, elevator, speed, density = 0.07, -0.1, 25.0, 1.2
    signals = steady(surfaces=(elevator, 0.0, 0.0), airspeed=speed, density=density)
    flat = np.full(len(signals.airspeed), alpha)
    forces = forward_forces(signals, base, prior_means(), Flow(flat, 0.0 * flat, 0.0 * flat), AlphaUncertainty())
    # Zero-lift drag 1.2, induced drag 0.8, thrust 0.9 times the base's; then all but the elevator's drag as it is.
    unknown = np.array([1.2, 0.8, 0.9, 1.0, 1.0, 0.02, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0])
    found, _ = forces.predict(unknown)
    pressure = 0.5 * density * speed**2 * 0.55
    thrust, _ = base.motor.thrust_and_current(np.full(1, speed), np.full(1, 0.6), np.full(1, density))
    own = 0.23 + 5.61 * alpha
    lift = pressure * (own + 0.13 * elevator)
    induced = 1.0 / (math.pi * 0.9 * 2.8956**2 / 0.55)
    drag = pressure * (1.2 * 0.043 + 0.8 * induced * own**2 + 1.5 * 0.0135 * elevator)
    ahead = lift * math.sin(alpha) - drag * math.cos(alpha) + 0.9 * float(thrust[0])
    assert found == pytest.approx(ahead / 11.0 + 0.02, rel=2e-3)


def test_a_steeper_flow_tilts_the_lift_forward() -> None:
    """One standard deviation of the angle, 0.3 degrees, at the middle of the curve: lift times it, over the mass."""
    base = base_model(load_aircraft("aerosonde"))
    signals = steady()
    flat = np.zeros(len(signals.airspeed))
    forces = forward_forces(signals, base, prior_means(), Flow(flat, flat, flat), AlphaUncertainty(mean_lift=0.23))
    nothing, one = np.array([1.0] * 5 + [0.0] * 7), np.array([1.0] * 5 + [0.0] * 5 + [1.0, 0.0])
    off = forces.predict(one)[0] - forces.predict(nothing)[0]
    lift = 0.5 * 1.2 * 25.0**2 * 0.55 * 0.23
    assert off == pytest.approx(lift * math.radians(0.3) / 11.0, rel=1e-3)
