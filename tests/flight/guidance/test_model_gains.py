"""Gains that follow from a model: those of the airframe against the Aerosonde's coefficients, and the file."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from aircraft.catalog import load_aircraft
from flight.guidance.gains import load_gains
from flight.guidance.model_gains import airframe_gains, gains_at_airspeed, gains_from_model, gains_text

AEROSONDE = load_aircraft("aerosonde")


def test_the_airframes_own_are_its_coefficients() -> None:
    found = airframe_gains(AEROSONDE)
    # Elevator for an angle of attack: -Cma / Cmde; for a roll rate: -Clp b / 2V by Clda, Jxz left out.
    assert found["elevator_per_alpha"] == pytest.approx(-2.74 / 0.99, rel=0.03)
    assert found["aileron_per_roll_rate"] == pytest.approx(0.51 * 2.8956 / 50.0 / 0.17, rel=0.03)
    # As the committed file has them, which the same sums gave.
    kept = load_gains(AEROSONDE)
    for name, value in found.items():
        assert value == pytest.approx(getattr(kept, name), rel=2e-3), name


def test_round_figures_go_with_the_airspeed() -> None:
    slow, usual = gains_at_airspeed(12.5), gains_at_airspeed(25.0)
    assert slow["roll_frequency"] == 2.0 * usual["roll_frequency"]
    assert slow["turn_lead"] == 0.5 * usual["turn_lead"]
    assert slow["height_integral"] == pytest.approx(8.0 * usual["height_integral"])
    assert slow["roll_gain"] == usual["roll_gain"]


def test_roll_poles_are_where_they_are_placed() -> None:
    gains = gains_from_model(AEROSONDE)
    # 0.4 / 0.05 s is faster than the round 6 rad/s at 25 m/s.
    assert gains.roll_frequency == 6.0
    power = 1.0 / gains.aileron_per_roll_acceleration
    assert gains.roll_gain * power == pytest.approx(36.0)
    # A slow servo sets the pace: 0.4 / 0.2 s.
    assert gains_from_model(replace(AEROSONDE, surface_lag=0.2)).roll_frequency == 2.0


def test_the_idle_throttle_is_where_the_motor_begins_to_push() -> None:
    """The book's disc leaves with 20 m/s times the throttle: at 15 m/s it pushes from 0.75 on."""
    assert 0.73 <= gains_from_model(load_aircraft("zagi")).throttle_idle <= 0.75
    assert load_gains(load_aircraft("zagi")).throttle_idle == 0.74


def test_the_file_is_read_as_written(tmp_path: Path) -> None:
    gains = gains_from_model(AEROSONDE)
    (tmp_path / "gains.toml").write_text(gains_text(gains), encoding="utf-8")
    again = load_gains(replace(AEROSONDE, folder=tmp_path))
    for name in gains.__dataclass_fields__:
        assert getattr(again, name) == pytest.approx(getattr(gains, name), rel=1e-3, abs=1e-12), name
    assert math.degrees(again.intercept) == pytest.approx(35.0)
