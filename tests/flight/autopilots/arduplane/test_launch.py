"""When ArduPlane starts a launched aircraft's motor: the closed form v^2 / 2 L, the delay, and what stops it."""

import math

import pytest

from flight.autopilots.arduplane.launch import motor_start_time, takeoff_slew
from flight.autopilots.arduplane.parameters import ArduPilotParameters

RAIL = 6.0


def made(**values: float) -> ArduPilotParameters:
    return ArduPilotParameters.defaults().changed(**values)


@pytest.mark.parametrize(("speed", "starts"), [(13.5, True), (13.4, False), (20.0, True), (10.0, False)])
def test_a_rail_has_to_push_as_much_as_minacc_asks(speed: float, starts: bool) -> None:
    """13.416 m/s over 6 m is 15 m/s^2; 10 m/s are 8.3, with which a launched ArduPlane never got its motor."""
    started = motor_start_time(speed**2 / (2.0 * RAIL), speed, 0.2, made(TKOFF_THR_MINACC=15.0))
    assert math.isfinite(started) is starts


@pytest.mark.parametrize("delay", [0.0, 2.0, 10.0])
def test_the_motor_waits_for_its_delay_from_when_the_push_is_felt(delay: float) -> None:
    """20 m/s over 6 m takes 0.6 s: a delay of 1 s ends 0.4 s after the release."""
    parameters = made(TKOFF_THR_MINACC=15.0, TKOFF_THR_DELAY=delay)
    assert motor_start_time(20.0**2 / 12.0, 20.0, 0.2, parameters) == pytest.approx(-0.6 + 0.1 * delay, abs=0.021)


@pytest.mark.parametrize(("speed", "starts"), [(19.0, True), (20.0, False)])
def test_the_ground_speed_has_to_be_above_minspd(speed: float, starts: bool) -> None:
    """On a level rail to 20 m/s, with a delay that ends after it: then the speed is 20 m/s and no more."""
    parameters = made(TKOFF_THR_MINACC=15.0, TKOFF_THR_DELAY=10.0, TKOFF_THR_MINSPD=speed)
    assert math.isfinite(motor_start_time(20.0**2 / 12.0, 20.0, 0.0, parameters)) is starts


@pytest.mark.parametrize(("incline", "starts"), [(44.0, True), (46.0, False)])
def test_a_nose_that_points_too_high_is_no_launch(incline: float, starts: bool) -> None:
    started = motor_start_time(33.0, 20.0, math.radians(incline), made(TKOFF_THR_MINACC=15.0))
    assert math.isfinite(started) is starts


def test_on_a_runway_nothing_pushes() -> None:
    assert motor_start_time(0.0, 0.0, 0.0, made()) == -math.inf
    assert motor_start_time(0.0, 0.0, 0.0, made(TKOFF_THR_MINACC=1.0)) == math.inf


def test_the_throttle_opens_by_its_own_slew_or_that_of_flight() -> None:
    assert takeoff_slew(made(THR_SLEWRATE=50.0)) == 0.5
    assert takeoff_slew(made(THR_SLEWRATE=50.0, TKOFF_THR_SLEW=25.0)) == 0.25
    assert takeoff_slew(made(THR_SLEWRATE=0.0)) == math.inf
