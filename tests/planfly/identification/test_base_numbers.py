"""Numbers off a JSBSim model are those of the book that it was written from."""

from pathlib import Path

import pytest

from aircraft.catalog import load_aircraft
from planfly.identification.base_numbers import base_model, scaled
from tests.instrumented_flights import Truth, changed_aerosonde
from world.errors import FlightError

# Beard and McLain, Small Unmanned Aircraft, second edition, appendix E.2.
BOOK = {
    "drag_zero": 0.043, "drag_elevator": 0.0135, "lift_zero": 0.23, "lift_alpha": 5.61, "lift_rate": 7.95,
    "lift_elevator": 0.13, "side_beta": -0.98, "side_aileron": 0.075, "side_rudder": 0.19, "roll_beta": -0.13,
    "roll_roll": -0.51, "roll_yaw": 0.25, "roll_aileron": 0.17, "roll_rudder": 0.0024, "pitch_zero": 0.0135,
    "pitch_alpha": -2.74, "pitch_rate": -38.21, "pitch_elevator": -0.99, "yaw_beta": 0.073, "yaw_roll": 0.069,
    "yaw_yaw": -0.095, "yaw_aileron": -0.011, "yaw_rudder": -0.069,
}  # fmt: skip


def test_the_aerosondes_are_the_books() -> None:
    numbers = base_model(load_aircraft("aerosonde"))
    for name, value in BOOK.items():
        assert getattr(numbers.coefficients, name) == pytest.approx(value, rel=1e-4), name
    assert numbers.inertia == pytest.approx((0.8244, 1.135, 1.759, 0.1204), rel=1e-4)
    motor = numbers.motor
    assert (motor.resistance, motor.idle_current) == (pytest.approx(0.042), pytest.approx(1.5))
    assert motor.back_voltage == pytest.approx(60.0 / (2.0 * 3.14159265 * 145.0), rel=1e-6)


def test_a_changed_aircraft_gives_changed_numbers(tmp_path: Path) -> None:
    truth = Truth(lift_slope=0.9, lift_offset=0.05, thrust=0.8, motor_speed=1.1, zero_lift_drag=1.5, pitch_offset=0.01)
    numbers = base_model(changed_aerosonde(tmp_path / "own", truth))
    c = numbers.coefficients
    assert (c.lift_alpha, c.lift_zero) == (pytest.approx(5.049, rel=1e-3), pytest.approx(0.28, rel=1e-3))
    assert (c.drag_zero, c.pitch_zero) == (pytest.approx(0.0645, rel=1e-3), pytest.approx(0.0235, rel=1e-3))
    assert numbers.motor.back_voltage == pytest.approx(0.0658572 / 1.1, rel=1e-5)
    assert (numbers.motor.resistance, numbers.motor.idle_current) == (pytest.approx(0.042), pytest.approx(1.5))


def test_scaling_takes_mass_and_lengths() -> None:
    base = base_model(load_aircraft("aerosonde"))
    made = scaled(base, 22.0, 2.0 * base.span, 2.0 * base.area)
    assert made.inertia[0] == pytest.approx(8.0 * base.inertia[0], rel=1e-6)
    assert made.chord == pytest.approx(base.chord)


def test_an_engine_that_burns_fuel_is_refused_in_one_line() -> None:
    with pytest.raises(FlightError, match="its motor cannot be identified") as refused:
        base_model(load_aircraft("c172x"))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", ["x8", "zagi"])
def test_a_flying_wing_is_refused_in_one_line(name: str) -> None:
    with pytest.raises(FlightError, match="a flying wing, or without the propeller's torque") as refused:
        base_model(load_aircraft(name))
    assert "\n" not in str(refused.value)


def test_a_motor_like_the_aerosondes_without_its_torque_is_refused(tmp_path: Path) -> None:
    """As `planfly aircraft --new --layout wing` writes it: the motor can be read, and no trim would be left."""
    aircraft = changed_aerosonde(tmp_path / "own", Truth())
    text = aircraft.model_file.read_text(encoding="utf-8")
    start, end = text.index("<moment name"), text.index("</moment>") + len("</moment>")
    aircraft.model_file.write_text(text[:start] + text[end:], encoding="utf-8")
    with pytest.raises(FlightError, match="a flying wing, or without the propeller's torque"):
        base_model(aircraft)
