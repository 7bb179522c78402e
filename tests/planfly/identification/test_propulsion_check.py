"""Tests of the conflict of drag and power."""

import math

import pytest

from planfly.identification.propulsion_check import power_conflict


def test_thors_first_identification_was_a_conflict() -> None:
    """55 W of drag and 60 W of power would be 92 %; the flight took 128 W, which the widened interval holds."""
    conflict = power_conflict(55.0, 60.0, 1.959)
    assert conflict is not None
    # A drive of 2 kg has 0.75 / (1 + (1.959 / 1.32)^(-2/3)) = 0.424, at least 0.424 exp(-1.96 0.29) = 0.240.
    efficiency = 0.75 / (1.0 + (1.959 / 1.32) ** (-2.0 / 3.0)) * math.exp(-1.96 * 0.29)
    assert conflict.largest_power == pytest.approx(55.0 / efficiency + 3.2, rel=1e-6)
    assert conflict.largest_power > 128.0
    assert "efficiency of 92 %" in conflict.text


@pytest.mark.parametrize(("power", "is_conflict"), [(61.0, True), (61.2, False)])
def test_the_limit_is_an_efficiency_of_nine_tenths(power: float, is_conflict: bool) -> None:
    """55 W / 0.9 is 61.1 W."""
    assert (power_conflict(55.0, power, 2.0) is not None) == is_conflict
