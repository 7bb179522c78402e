"""A propeller as a disc, by the formulas of Beard and McLain, Small Unmanned Aircraft, first edition, section 4.3."""

import numpy as np
import pytest

from aircraft.identification.propeller_disc import PropellerDisc

ZAGI = PropellerDisc(0.5 * 0.0314, 20.0, ducted=False, losses=1.0 / 0.6 - 1.0, voltage=11.1, nominal=11.1)
X8 = PropellerDisc(0.5 * 0.1017876 * 0.248, 37.42, ducted=True, losses=1.0 / 0.6 - 1.0, voltage=14.8, nominal=14.8)


def at(disc: PropellerDisc, airspeed: float, throttle: float, voltage: float | None = None) -> tuple[float, float]:
    thrust, current = disc.thrust_and_current(np.full(1, airspeed), np.full(1, throttle), np.full(1, 1.225), voltage)
    return float(thrust[0]), float(current[0])


def test_thrust_and_power_are_the_books() -> None:
    """0.5 rho S C (v_e^2 - V^2), and T (V + v_e) / 2 by an efficiency of 0.6."""
    thrust, current = at(ZAGI, 15.0, 0.9)
    expected = 0.5 * 1.225 * 0.0314 * (18.0**2 - 15.0**2)
    assert thrust == pytest.approx(expected)
    assert current * 11.1 == pytest.approx(expected * 0.5 * (15.0 + 18.0) / 0.6)


def test_a_ducted_one_goes_from_the_airspeed_up() -> None:
    """v_e = V + t (k - V), and 0.5 rho S C v_e (v_e - V)."""
    thrust, current = at(X8, 18.0, 0.5)
    behind = 18.0 + 0.5 * (37.42 - 18.0)
    expected = 0.5 * 1.225 * 0.1017876 * 0.248 * behind * (behind - 18.0)
    assert thrust == pytest.approx(expected)
    assert current * 14.8 == pytest.approx(expected * 0.5 * (18.0 + behind) / 0.6)


def test_it_does_not_brake_and_does_not_turn_the_aircraft() -> None:
    assert at(ZAGI, 15.0, 0.0) == at(X8, 18.0, 0.0) == (0.0, 0.0)
    assert X8.propeller_torque(np.full(2, 18.0), np.ones(2), np.full(2, 1.2)).tolist() == [0.0, 0.0]


def test_factors_change_what_they_name() -> None:
    thrust, current = at(ZAGI, 15.0, 0.9)
    more, taken = at(ZAGI.with_factors(thrust=1.2, torque=1.5), 15.0, 0.9)
    assert (more, taken) == (pytest.approx(1.2 * thrust), pytest.approx(1.2 * 1.5 * current))
    # As fast at 0.9 of the throttle as before at 0.9 x 1.1 of it.
    assert at(ZAGI.with_factors(speed=1.1), 15.0, 0.9) == pytest.approx(at(ZAGI, 15.0, 0.99))
    # Two thirds of the air's power are lost: half as much again of that is a fifth of all.
    assert at(ZAGI.with_factors(resistance=1.5), 15.0, 0.9)[1] == pytest.approx(1.2 * current)
    assert at(ZAGI.with_factors(idle=3.0), 15.0, 0.9) == (thrust, current)


def test_a_weaker_battery_turns_it_slower_and_another_one_is_wound_for() -> None:
    assert at(ZAGI, 15.0, 1.0, 0.9 * 11.1)[0] == pytest.approx(at(ZAGI, 15.0, 0.9)[0])
    thrust, current = at(ZAGI, 15.0, 0.9)
    assert at(ZAGI.for_voltage(22.2), 15.0, 0.9) == (pytest.approx(thrust), pytest.approx(0.5 * current))
