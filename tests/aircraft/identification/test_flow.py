import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from aircraft.identification.flow import alpha_from_attitude, flow_from_forces
from aircraft.identification.parameters import prior_means
from planfly.identification.base_numbers import base_model
from tests.aircraft.identification.made_signals import steady


def signals(
    roll: float, pitch: float, yaw: float, velocity: tuple[float, ...], wind: tuple[float, ...] = (0.0, 0.0)
) -> Any:
    return SimpleNamespace(
        attitude=np.radians([[roll, pitch, yaw]]), velocity=np.array([velocity]), wind=np.array([wind])
    )


def degrees(one: Any, level: float = 0.0) -> float:
    return math.degrees(float(alpha_from_attitude(one, math.radians(level))[0]))


def test_level_flight_has_its_pitch_as_angle_of_attack() -> None:
    assert degrees(signals(0.0, 3.0, 0.0, (25.0, 0.0, 0.0))) == pytest.approx(3.0)
    assert degrees(signals(0.0, 3.0, 90.0, (0.0, 25.0, 0.0)), level=0.5) == pytest.approx(3.5)


def test_a_climb_takes_its_slope_off_and_wind_does_not_count() -> None:
    rise = 25.0 * math.sin(math.radians(2.0))
    along = 25.0 * math.cos(math.radians(2.0))
    assert degrees(signals(0.0, 5.0, 0.0, (along, 0.0, -rise))) == pytest.approx(3.0)
    assert degrees(signals(0.0, 5.0, 0.0, (along - 8.0, 0.0, -rise), (-8.0, 0.0))) == pytest.approx(3.0)


def test_on_its_side_the_flow_from_below_is_the_flow_from_aside() -> None:
    """Banked 90 degrees to the right and yawed 4 to the right of its way: the wing meets the air at 4 degrees."""
    assert degrees(signals(90.0, 0.0, 4.0, (25.0, 0.0, 0.0))) == pytest.approx(4.0)


def test_a_wing_that_rolls_has_side_force_without_sideslip() -> None:
    """Gryte et al. 2018, the X8: CY of the roll and yaw rates -0.1374 and 0.0839, times rate b / 2 V."""
    base = base_model(load_aircraft("x8"))
    p, r, speed, density = 0.6, -0.2, 18.0, 1.225
    pressure = 0.5 * density * speed**2 * base.area
    side = (-0.1374 * p + 0.0839 * r) * base.span / (2.0 * speed)
    one = np.ones(4)
    turning: Any = SimpleNamespace(
        acceleration=np.outer(one, [0.0, side * pressure / base.mass, -9.81]),
        rates=np.outer(one, [p, 0.0, r]),
        surfaces=np.zeros((4, 3)),
        airspeed=speed * one,
        density=density * one,
        throttle=0.5 * one,
        voltage=np.nan * one,
        smooth=lambda values, band: values,
    )
    assert flow_from_forces(turning, base, prior_means()).beta == pytest.approx(np.zeros(4), abs=1e-4)


def test_the_vane_tells_the_flow_that_made_the_forces() -> None:
    """Lift, drag, side force and thrust of a flow, summed by hand with the book's coefficients of the Aerosonde."""
    base = base_model(load_aircraft("aerosonde"))
    alpha, beta, elevator, aileron, rudder, q = 0.06, 0.05, -0.08, 0.2, -0.15, 0.3
    speed, density = 25.0, 1.2
    thrust, _ = base.motor.thrust_and_current(np.full(1, speed), np.full(1, 0.6), np.full(1, density))
    pressure = 0.5 * density * speed**2 * 0.55
    along = 0.18994 / (2.0 * speed)
    lift = pressure * (0.23 + 5.61 * alpha + 7.95 * q * along + 0.13 * elevator)
    drag = pressure * 0.06
    side = pressure * (-0.98 * beta + 0.075 * aileron + 0.19 * rudder)
    force = (
        lift * math.sin(alpha) - drag * math.cos(alpha) + float(thrust[0]),
        side,
        -lift * math.cos(alpha) - drag * math.sin(alpha),
    )
    made = steady(
        acceleration=np.array(force) / base.mass,
        rates=(0.0, q, 0.0),
        surfaces=(elevator, aileron, rudder),
        airspeed=speed,
        density=density,
    )
    found = flow_from_forces(made, base, prior_means())
    assert found.alpha == pytest.approx(alpha, abs=2e-4)
    assert found.beta == pytest.approx(beta, abs=1e-4)
    assert found.lift == pytest.approx(0.23 + 5.61 * alpha, abs=1e-3)
