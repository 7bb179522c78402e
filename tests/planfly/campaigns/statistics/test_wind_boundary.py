"""The boundary's estimate, against distributions of which the quantile is known."""

import numpy as np
import pytest
from scipy.stats import norm

from planfly.campaigns.statistics.wind_boundary import BATCH, Direction, WindBoundary, needs_more


def search(mean: float, spread: float, seed: int, flights: int = 300) -> WindBoundary:
    direction, random = Direction(20.0, 0.99), np.random.default_rng(seed)
    while len(direction.speeds) < flights:
        for speed in direction.next_speeds():
            direction.add(speed, bool(speed < random.normal(mean, spread)))
        if len(direction.speeds) % 30 == 0 and not needs_more(direction.boundary(), len(direction.speeds), 0.4, 30):
            break
    return direction.boundary()


@pytest.mark.parametrize(("mean", "spread"), [(12.0, 0.3), (7.0, 0.5), (12.0, 1.0)])
def test_it_finds_the_quantile(mean: float, spread: float) -> None:
    truth = norm.ppf(0.01, mean, spread)
    found = [search(mean, spread, seed) for seed in range(4)]
    assert np.median([abs(one.estimate - truth) for one in found]) < 0.5
    assert sum(one.low - 0.2 <= truth <= one.high + 0.2 for one in found) >= 3


def test_what_always_flies_lies_beyond_what_was_looked_at() -> None:
    direction = Direction(10.0, 0.9)
    for _ in range(40):
        for speed in direction.next_speeds():
            direction.add(speed, True)
    assert max(direction.speeds) == 10.0
    found = direction.boundary()
    assert found.beyond
    assert found.estimate == found.high == 10.0


def test_what_never_flies_has_no_wind() -> None:
    direction = Direction(10.0, 0.9)
    for _ in range(20):
        for speed in direction.next_speeds():
            direction.add(speed, False)
    assert direction.boundary().estimate == 0.0


def test_more_is_flown_until_the_interval_is_narrow() -> None:
    wide, narrow = WindBoundary(9.0, 8.5, 9.51, False), WindBoundary(9.0, 8.5, 9.5, False)
    assert needs_more(wide, 100, 0.5, 30)
    assert not needs_more(narrow, 30, 0.5, 30)
    assert needs_more(narrow, 29, 0.5, 30)
    assert len(Direction(20.0, 0.99).next_speeds()) == BATCH
