"""What the envelope predicts against what flights show (`benchmarks.limits`); every case with PLANFLY_SOAK=1."""

import math

import pytest

from benchmarks.limits import Limit, calm_limits, wind_limits
from tests.soak import SOAK


@pytest.fixture(scope="module")
def calm() -> list[Limit]:
    return calm_limits(whole=SOAK)


@pytest.fixture(scope="module")
def windy() -> list[Limit]:
    return wind_limits(whole=SOAK)


def test_calm_slopes(calm: list[Limit]) -> None:
    slopes = [limit for limit in calm if limit.kind != "leg"]
    assert {limit.kind for limit in slopes} == ({"climb", "dive"} if SOAK else {"climb"})
    for limit in slopes:
        assert abs(math.degrees(limit.optimistic)) <= 1.0, limit
        assert limit.optimistic <= 0.0, limit


def test_calm_legs(calm: list[Limit]) -> None:
    legs = [limit for limit in calm if limit.kind == "leg"]
    assert legs
    for limit in legs:
        assert abs(limit.optimistic) <= 10.0, limit


@pytest.mark.skipif(not SOAK, reason="in calm air it is seen above: in make soak")
def test_in_wind_the_prediction_is_on_the_safe_side_but_not_by_much(windy: list[Limit]) -> None:
    assert {limit.kind for limit in windy} == {"climb", "dive", "leg"}
    for limit in windy:
        assert limit.optimistic <= 0.0, limit
        assert limit.conservative <= 0.30, limit
