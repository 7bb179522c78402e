"""Draws: of the index alone, independent, and one quantity's the same whatever else varies."""

import numpy as np
from scipy import stats

from planfly.campaigns.spread.draws import draw_flight
from planfly.campaigns.spread.spread_file import default_spread


def test_a_draw_is_numpys_own_stream_of_seed_and_index() -> None:
    random = np.random.default_rng(np.random.SeedSequence(7, spawn_key=(123,)))
    draw = draw_flight(default_spread(), 7, 123)
    assert draw.values["wind_speed"] == float(stats.norm.ppf(random.random(12)[0], scale=1.95))
    assert draw.seed == int(random.integers(2**63))


def test_other_quantities_leave_a_draw_alone() -> None:
    whole, less = default_spread(), default_spread().without(("wind_speed", "drag"))
    one, other = draw_flight(whole, 1, 5), draw_flight(less, 1, 5)
    assert other.values["wind_speed"] == 0.0
    assert other.values["drag"] == 1.0
    assert {name: value for name, value in one.values.items() if name not in ("wind_speed", "drag")} == {
        name: value for name, value in other.values.items() if name not in ("wind_speed", "drag")
    }


def test_flights_are_independent_and_spread_as_stated() -> None:
    spread = default_spread()
    draws = [draw_flight(spread, 1, k) for k in range(400)]
    speed = np.array([draw.values["wind_speed"] for draw in draws])
    assert stats.kstest(speed / 1.95, "norm").pvalue > 0.001
    assert abs(np.corrcoef(speed[:-1], speed[1:])[0, 1]) < 0.15
    assert abs(np.corrcoef(speed, [draw.values["mass"] for draw in draws])[0, 1]) < 0.15
    assert len({draw.seed for draw in draws}) == 400
