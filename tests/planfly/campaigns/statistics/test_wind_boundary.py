"""The boundary's estimate, against distributions of which the quantile is known."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.stats import gumbel_l, norm

from planfly.campaigns.statistics.wind_boundary import BATCH, Direction, FailureLaws, WindBoundary, needs_more
from tests.soak import scaled


def search(draw: Callable[[], float], flights: int = 300) -> WindBoundary:
    """The boundary after flights that begin to fail at winds that are drawn, one each."""
    direction = Direction(20.0, 0.99)
    while len(direction.speeds) < flights:
        speed = direction.next_speed()
        for _ in range(BATCH):
            direction.add(speed, bool(speed < draw()))
        if len(direction.speeds) % 30 == 0 and not needs_more(direction.boundary(), len(direction.speeds), 0.4, 30):
            break
    return direction.boundary()


@pytest.mark.parametrize(
    ("law", "within"),
    [(norm(12.0, 0.3), 0.3), (norm(7.0, 0.5), 0.5), (norm(12.0, 1.0), 0.5), (gumbel_l(12.0, 0.5), 0.8)],
)
def test_it_finds_the_quantile(law: Any, within: float) -> None:
    """Of either law, without being told which."""
    truth = float(law.ppf(0.01))
    found = [search(partial(law.rvs, random_state=np.random.default_rng(seed))) for seed in range(scaled(20, 2))]
    assert np.median([abs(one.estimate - truth) for one in found]) < within
    assert sum(one.low - 0.1 <= truth <= one.high + 0.1 for one in found) >= 0.75 * len(found)


def test_a_long_tail_is_seen_where_it_is() -> None:
    """With the flights of Gumbel's law its own half of the weights grows, and the boundary lies lower."""
    law = gumbel_l(13.0, 1.5)
    speeds = np.repeat(np.arange(4.0, 16.0, 0.5), 60)
    direction = Direction(20.0, 0.99)
    for speed, draw in zip(speeds, law.rvs(speeds.size, random_state=np.random.default_rng(3)), strict=True):
        direction.add(float(speed), bool(speed < draw))
    found = direction.boundary()
    assert found.low < law.ppf(0.01) < found.high
    # A normal law of the same mean and standard deviation would have it there.
    assert found.estimate < norm(law.mean(), law.std()).ppf(0.01) - 0.5


def test_flights_are_put_in_the_tail() -> None:
    """About the boundary, where few are expected to fail, and not above what is looked at."""
    direction, random = Direction(14.0, 0.99), np.random.default_rng(1)
    for _ in range(100):
        speed = direction.next_speed()
        assert 0.0 <= speed <= 14.0
        for _ in range(BATCH):
            direction.add(speed, bool(speed < random.normal(12.0, 1.0)))
    late = np.array(direction.speeds[-150:])
    assert norm(12.0, 1.0).cdf(late).max() < 0.3
    assert 0.0005 < norm(12.0, 1.0).cdf(np.median(late)) < 0.1


@pytest.mark.parametrize("speed", [6.0, 12.0, 19.0])
def test_the_laws_are_scipys(speed: float) -> None:
    """Means, spreads, probabilities and quantiles of both."""
    laws = FailureLaws.up_to(20.0)
    fails, flies = laws.log_shares(speed)
    assert laws.location.size == 2 * laws.normals
    for k in range(0, laws.normals, 997):
        mean, spread = laws.location[k], laws.scale[k]
        assert fails[k] == pytest.approx(norm(mean, spread).logcdf(speed), rel=1e-9)
        assert laws.quantile(0.01)[k] == pytest.approx(norm(mean, spread).ppf(0.01))
        gumbel = gumbel_l(laws.location[k + laws.normals], laws.scale[k + laws.normals])
        assert gumbel.stats() == pytest.approx((mean, spread**2))
        assert flies[k + laws.normals] == pytest.approx(gumbel.logsf(speed), rel=1e-9)
        assert laws.quantile(0.01)[k + laws.normals] == pytest.approx(gumbel.ppf(0.01))


def test_what_always_flies_lies_beyond_what_was_looked_at() -> None:
    direction = Direction(10.0, 0.9)
    for _ in range(40):
        for _ in range(BATCH):
            direction.add(direction.next_speed(), True)
    assert max(direction.speeds) == 10.0
    found = direction.boundary()
    assert found.beyond
    assert found.estimate == found.high == 10.0


def test_what_never_flies_has_no_wind() -> None:
    direction = Direction(10.0, 0.9)
    for _ in range(20):
        for _ in range(BATCH):
            direction.add(direction.next_speed(), False)
    assert direction.boundary().estimate == 0.0


def test_more_is_flown_until_the_interval_is_narrow() -> None:
    wide, narrow = WindBoundary(9.0, 8.5, 9.51, False), WindBoundary(9.0, 8.5, 9.5, False)
    assert needs_more(wide, 100, 0.5, 30)
    assert not needs_more(narrow, 30, 0.5, 30)
    assert needs_more(narrow, 29, 0.5, 30)
