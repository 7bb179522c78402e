"""How the flights at fixed winds are read, that `planfly winds` is held against."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from benchmarks.campaigns.sobol_samples import SOBOL_FLIGHTS, sobol_draw
from benchmarks.campaigns.winds_reference import agreement, is_within, reference_interval
from planfly.campaigns.dispersions import default_dispersions
from tests.soak import scaled


def point(speed: float, flights: int, flyable: int) -> dict[str, Any]:
    return {"speed": speed, "flights": flights, "flyable": flyable}


def test_the_boundary_is_that_of_the_law_the_points_lie_on() -> None:
    """One in a hundred fails at 10 m/s, and a probit grows by a half a metre a second."""
    exact = [(speed, norm.sf(norm.isf(0.01) + 0.5 * (10.0 - speed))) for speed in (9.5, 10.5)]
    points = [point(speed, 1_000_000, round(1_000_000 * (1.0 - failing))) for speed, failing in exact]
    assert reference_interval(points, 0.0) == pytest.approx((10.0, 10.0), abs=0.051)
    low, high = reference_interval(points, 0.95)
    assert 9.9 < low <= 10.0 <= high < 10.1
    assert is_within(9.6, points, 0.0)
    assert is_within(10.4, points, 0.0)
    assert not is_within(9.4, points, 0.0)
    assert not is_within(10.6, points, 0.0)
    assert agreement(points, scaled(100, 20)) == 1.0


def test_flights_at_one_wind_count_together() -> None:
    points = [point(8.0, 1000, 995), point(9.0, 1000, 985)]
    parts = [point(8.0, 400, 397), point(8.0, 600, 598), point(9.0, 1000, 985)]
    for confidence in (0.0, 0.95):
        assert reference_interval(parts, confidence) == reference_interval(points, confidence)
    # Few flights leave much open, also for another such reference.
    low, high = reference_interval(points, 0.95)
    assert high - low > 1.0
    assert agreement(points) < 0.95


@pytest.mark.parametrize(("flyable", "low", "high"), [(990, 19.5, 20.0), (989, 0.0, 19.45)])
def test_a_single_wind_tells_on_which_side_the_boundary_is(flyable: int, low: float, high: float) -> None:
    assert reference_interval([point(19.5, 1000, flyable)], 0.95) == (low, high)
    assert reference_interval([point(19.5, 400, 400), point(19.5, 600, flyable - 400)], 0.95) == (low, high)


def test_sobol_samples_have_as_many_of_each_kind_as_there_are_to_be() -> None:
    spread = default_dispersions()
    draws = [sobol_draw(spread, 5, index) for index in range(SOBOL_FLIGHTS)]
    assert len({draw.seed for draw in draws}) == SOBOL_FLIGHTS
    assert draws[7] == sobol_draw(spread, 5, 7) != sobol_draw(spread, 6, 7)
    for one in spread.varying:
        values = np.array([draw.values[one.quantity.name] for draw in draws])
        if len(set(values)) < 10:
            continue
        for share in (0.01, 0.25, 0.5):
            # One of each cell of a thousand: a share of them to within the cell that it cuts.
            assert (values < one.value(share)).sum() == pytest.approx(share * SOBOL_FLIGHTS, abs=1.0)
    still = {one.quantity.name for one in spread.varying}
    nominal = {name: value for name, value in draws[0].values.items() if name not in still}
    assert all(value in (0.0, 1.0) for value in nominal.values())
