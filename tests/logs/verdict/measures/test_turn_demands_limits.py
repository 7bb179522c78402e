"""Which turn is a reversal, that no length of leg is enough for."""

import math

import pytest

from logs.verdict.measures.turn_demands import turn_lengths


@pytest.mark.parametrize(("short", "ends"), [(5e-7, False), (2e-6, True)])
def test_a_turn_within_a_millionth_of_a_half_circle_has_no_tangent(short: float, ends: bool) -> None:
    before, after = turn_lengths(math.pi - short, 100.0, fly_over=False)
    assert before == after
    assert math.isfinite(before) is ends
    if ends:
        # R tan((pi - e) / 2) = 2 R / e
        assert before == pytest.approx(2.0 * 100.0 / short, rel=1e-6)
