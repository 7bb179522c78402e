import numpy as np
import pytest

from aircraft.identification.electric_motor import ElectricMotor

MOTOR = ElectricMotor((4.48e-6, 5.27e-5, -2.18e-3), (1.58e-4, -1.26e-3, -2.78e-2), 0.0659, 0.042, 1.5, 44.4)


@pytest.mark.parametrize("speed", [1.0, 1.08])
def test_the_motors_torque_is_the_propellers(speed: float) -> None:
    motor = MOTOR.with_factors(speed=speed)
    airspeed, throttle, density = (np.array([value]) for value in (25.0, 0.9, 1.2))
    turning = motor.speed(airspeed, throttle, density, 44.4)
    a, b, c = motor.torque
    needed = 1.2 * (a * turning**2 + b * 25.0 * turning + c * 25.0**2)
    kv = 0.0659 / speed
    given = kv * ((0.9 * 44.4 - kv * turning) / 0.042 - 1.5)
    assert given == pytest.approx(needed, rel=1e-9)
    _, current = motor.thrust_and_current(airspeed, throttle, density)
    assert current[0] == pytest.approx(0.9 * (0.9 * 44.4 - kv * turning[0]) / 0.042)


def test_without_throttle_it_windmills_and_takes_no_current() -> None:
    one = np.ones(1)
    thrust, current = MOTOR.thrust_and_current(25.0 * one, 0.0 * one, 1.2 * one)
    assert thrust[0] < 0.0
    assert current[0] == 0.0


def test_factors_act_where_they_belong() -> None:
    one = np.ones(1)
    thrust, current = MOTOR.thrust_and_current(25.0 * one, one, 1.2 * one)
    more, same = MOTOR.with_factors(thrust=1.3).thrust_and_current(25.0 * one, one, 1.2 * one)
    assert (more[0], same[0]) == (pytest.approx(1.3 * thrust[0]), current[0])
    assert MOTOR.with_factors(torque=1.2).thrust_and_current(25.0 * one, one, 1.2 * one)[1][0] > current[0]
