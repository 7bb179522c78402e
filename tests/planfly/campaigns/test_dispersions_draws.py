"""Draws: of the index alone, independent, and one quantity's the same whatever else varies."""

import numpy as np
import pytest
from scipy import stats

from planfly.campaigns.dispersions import (
    default_dispersions,
    draw_flight,
    parse_dispersions,
    standard_draws,
    standard_population,
)


def test_a_draw_is_numpys_own_stream_of_seed_and_index() -> None:
    random = np.random.default_rng(np.random.SeedSequence(7, spawn_key=(123,)))
    draw = draw_flight(default_dispersions(), 7, 123)
    assert draw.values["wind_speed"] == float(stats.norm.ppf(random.random(12)[0], scale=1.95))
    assert draw.seed == int(random.integers(2**63))


def test_other_quantities_leave_a_draw_alone() -> None:
    whole, less = default_dispersions(), default_dispersions().without(("wind_speed", "drag"))
    one, other = draw_flight(whole, 1, 5), draw_flight(less, 1, 5)
    assert other.values["wind_speed"] == 0.0
    assert other.values["drag"] == 1.0
    assert {name: value for name, value in one.values.items() if name not in ("wind_speed", "drag")} == {
        name: value for name, value in other.values.items() if name not in ("wind_speed", "drag")
    }


def test_flights_are_independent_and_spread_as_stated() -> None:
    spread = default_dispersions()
    draws = [draw_flight(spread, 1, k) for k in range(400)]
    speed = np.array([draw.values["wind_speed"] for draw in draws])
    assert stats.kstest(speed / 1.95, "norm").pvalue > 0.001
    assert abs(np.corrcoef(speed[:-1], speed[1:])[0, 1]) < 0.15
    assert abs(np.corrcoef(speed, [draw.values["mass"] for draw in draws])[0, 1]) < 0.15
    assert len({draw.seed for draw in draws}) == 400


def test_standard_draws_are_those_that_are_flown() -> None:
    """In standard deviations from the mean, which the spread states: a normal law's and a uniform one's."""
    spread = default_dispersions().without(("wind_speed", "wind_from"))
    names = [one.quantity.name for one in spread.varying]
    numbers = standard_draws(spread, 1, 40, 60)
    for k in range(20):
        values = draw_flight(spread, 1, 40 + k).values
        assert numbers[k, names.index("drag")] == pytest.approx((values["drag"] - 1.0) / 0.1, rel=1e-3, abs=1e-3)
        assert numbers[k, names.index("battery")] == pytest.approx(
            (values["battery"] - 0.9) / (0.2 / 12**0.5), rel=1e-3
        )


def test_the_population_is_spread_as_what_is_drawn() -> None:
    spread = default_dispersions()
    population = standard_population(spread, 4096)
    assert population.shape == (4096, len(spread.varying))
    assert np.isfinite(population).all()
    assert np.abs(population.mean(axis=0)).max() < 0.01
    assert np.abs(population.std(axis=0) - 1.0).max() < 0.01
    # One in a hundred of a normal law lies beyond 2.326, and no two quantities go together.
    assert (population[:, 0] > stats.norm.isf(0.01)).mean() == pytest.approx(0.01, abs=0.001)
    assert np.abs(np.corrcoef(population.T) - np.eye(population.shape[1])).max() < 0.05


def test_what_has_one_value_alone_does_not_vary() -> None:
    spread = parse_dispersions('[turbulence]\ndistribution = "randint"\nlow = 1\nhigh = 2\nsource = "by hand"', "x")
    assert standard_population(spread, 8).shape == (8, 0)
    assert standard_draws(spread, 1, 0, 3).shape == (3, 0)
