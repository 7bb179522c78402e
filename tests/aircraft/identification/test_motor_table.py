"""Tests of a motor as tables: against the motor's own formulas, and its similarity laws."""

import numpy as np

from aircraft.catalog import load_aircraft
from aircraft.identification.motor_table import MotorTable
from flight.dynamics.fdm import Variation
from planfly.identification.base_numbers import read_motor, varied_model

_AIRSPEEDS = np.array([15.0, 20.0, 25.0, 30.0])
_THROTTLES = np.array([0.6, 0.7, 0.8, 1.0])
_DENSITIES = np.full(4, 1.1)


def test_the_tables_of_the_aerosonde_agree_with_its_formulas() -> None:
    """Linear interpolation between 15 airspeeds and 15 throttles is within 2 % of full throttle's values."""
    aircraft = load_aircraft("aerosonde")
    motor, table = read_motor(aircraft), varied_model(aircraft, Variation()).motor
    by_formula = motor.thrust_and_current(_AIRSPEEDS, _THROTTLES, _DENSITIES)
    by_table = table.thrust_and_current(_AIRSPEEDS, _THROTTLES, _DENSITIES)
    for expected, got in zip(by_formula, by_table, strict=True):
        assert np.abs(got - expected).max() < 0.02 * np.abs(expected).max()
    torques = (
        motor.propeller_torque(_AIRSPEEDS, _THROTTLES, _DENSITIES),
        table.propeller_torque(_AIRSPEEDS, _THROTTLES, _DENSITIES),
    )
    assert np.abs(torques[1] - torques[0]).max() < 0.02 * torques[0].max()


def test_a_faster_motor_follows_the_similarity_of_propellers() -> None:
    """At twice the speed and airspeed, thrust is 4 times and power 8 times as large."""
    table = np.array([[0.0, 10.0], [-2.0, 6.0]])
    motor = MotorTable(np.array([0.0, 20.0]), np.array([0.0, 1.0]), table, 5.0 * table, table, 1.2, 10.0, 10.0)
    slow = motor.thrust_and_current(np.full(1, 8.0), np.ones(1), np.full(1, 1.2))
    fast = motor.with_factors(speed=2.0).thrust_and_current(np.full(1, 16.0), np.ones(1), np.full(1, 1.2))
    assert np.allclose([fast[0] / slow[0], fast[1] / slow[1]], [[4.0], [8.0]])


def test_half_the_density_halves_thrust_and_current() -> None:
    """Thrust and power are proportional to the density."""
    table = np.array([[0.0, 10.0], [-2.0, 6.0]])
    motor = MotorTable(np.array([0.0, 20.0]), np.array([0.0, 1.0]), table, 5.0 * table, table, 1.2, 10.0, 10.0)
    whole, half = (motor.thrust_and_current(np.full(1, 8.0), np.ones(1), np.full(1, rho)) for rho in (1.2, 0.6))
    assert np.allclose([half[0] / whole[0], half[1] / whole[1]], 0.5)
