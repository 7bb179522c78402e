"""Where the boundary is said to lie, against plain sums over the samples of what the coefficients may be."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.stats import gumbel_l, norm

from planfly.campaigns.statistics.censored_regression import CLOGLOG, LINKS, PROBIT, BinaryLink
from planfly.campaigns.statistics.failure_modes import FailureMode
from planfly.campaigns.statistics.wind_boundary import (
    Direction,
    DrawnNumbers,
    WeightedModes,
    WindBoundary,
    boundary_quantiles,
    needs_more_flights,
    next_flights,
)
from tests.planfly.campaigns.statistics.made_directions import above, fly, no_numbers, normal_numbers
from tests.soak import SOAK, scaled, some

NOTHING = np.zeros((1, 0))
PARTS = (0.025, 0.5, 0.975)


def one_mode(mean: list[float], deviations: list[float], link: BinaryLink = PROBIT, count: int = 4096) -> FailureMode:
    """Coefficients that are normal and independent; the wind's from 10 m/s on."""
    sample = np.random.default_rng(1).normal(mean, deviations, size=(count, len(mean)))
    return FailureMode(link, np.array(mean), np.diag(deviations) ** 2, lambda: sample, 0.0)


def alone(mode: FailureMode) -> list[WeightedModes]:
    return [WeightedModes((mode,), 1.0)]


@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize(("share", "most"), [(0.01, 20.0), (0.2, 40.0), (1e-4, 10.0)])
def test_quantiles_are_those_of_the_samples_boundaries(link: BinaryLink, share: float, most: float) -> None:
    """Of a constant and a wind's coefficient, from 10 m/s on: boundary = 10 + (limit - a) / b."""
    limit = norm.ppf(share) if link is PROBIT else np.log(-np.log(1.0 - share))
    mode = one_mode([-4.0, 0.6], [0.4, 0.08], link)
    a, b = mode.sample().T
    expected = np.quantile(np.clip(10.0 + (limit - a) / b, 0.0, most), PARTS)
    assert boundary_quantiles(alone(mode), NOTHING, share, most, PARTS) == pytest.approx(expected, abs=0.02)


def test_links_weigh_as_they_do() -> None:
    sure, other = one_mode([-4.0, 1.0], [1e-3, 1e-3]), one_mode([-2.0, 1.0], [1e-3, 1e-3], CLOGLOG, 64)
    first, second = 14.0 + norm.ppf(0.01), 12.0 + np.log(-np.log(0.99))
    for weight, expected in ((0.6, first), (0.4, second)):
        mixed = [WeightedModes((sure,), weight), WeightedModes((other,), 1.0 - weight)]
        assert boundary_quantiles(mixed, NOTHING, 0.01, 20.0, (0.5,)) == pytest.approx([expected], abs=0.01)


@pytest.mark.parametrize(("at_10", "by_wind", "by_draw"), [(-4.0, 0.5, 1.0), (-20.0, 3.0, 8.0), (-3.0, 0.1, 0.5)])
def test_draws_spread_the_share_that_fails(at_10: float, by_wind: float, by_draw: float) -> None:
    """By a normal draw on a normal law: both together are normal.  Also where draws decide nearly all of it."""
    draws = norm.ppf((np.random.default_rng(2).permutation(4096)[:, None] + 0.5) / 4096)
    mode = one_mode([at_10, by_wind, by_draw], [1e-6] * 3, count=64)
    found = boundary_quantiles(alone(mode), draws, 0.01, 20.0, (0.5,))
    expected = 10.0 + (np.hypot(1.0, by_draw) * norm.ppf(0.01) - at_10) / by_wind
    assert 5.0 < expected < 20.0
    assert found == pytest.approx([expected], abs=0.01)


def test_modes_are_known_apart_from_each_other() -> None:
    """Two ways that are alike, each as little known: what the least is known of, by plain sums over both samples.

    Samples that went together would have both ways' luck at once, and the interval wider by a fifth.
    """
    mode = one_mode([-4.0, 0.6], [0.4, 1e-6])
    two = [WeightedModes((mode, mode), 1.0)]
    random = np.random.default_rng(3)
    one, other = random.normal(-4.0, 0.4, (2, 4096))
    winds = np.arange(4.0, 20.0, 0.02)[:, None]
    fails = 1.0 - norm.sf(one + 0.6 * (winds - 10.0)) * norm.sf(other + 0.6 * (winds - 10.0))
    expected = np.quantile(winds[(fails < 0.01).sum(axis=0), 0], PARTS)
    assert boundary_quantiles(two, NOTHING, 0.01, 20.0, PARTS) == pytest.approx(expected, abs=0.08)


def test_what_lies_beyond_is_the_largest_wind_and_what_never_flies_none() -> None:
    assert boundary_quantiles(alone(one_mode([-9.0, 0.3], [0.1, 0.01])), NOTHING, 0.01, 20.0, PARTS) == [20.0] * 3
    assert boundary_quantiles(alone(one_mode([9.0, 0.3], [0.1, 0.01])), NOTHING, 0.01, 20.0, PARTS) == [0.0] * 3
    # In no wind that can be told from none; and in all, however steep.
    assert boundary_quantiles(alone(one_mode([-900.0, 0.3], [0.1, 0.01])), NOTHING, 0.01, 20.0, PARTS) == [20.0] * 3
    assert boundary_quantiles(alone(one_mode([900.0, 40.0], [0.1, 0.01])), NOTHING, 0.01, 20.0, PARTS) == [0.0] * 3


@pytest.mark.parametrize("by_wind", [0.02, 20.0, 60.0])
def test_flat_and_steep_laws_are_met_where_they_are(by_wind: float) -> None:
    """Laws that go from few to most within a few metres a second that are far apart, or within a tenth."""
    found = boundary_quantiles(alone(one_mode([-2.4, by_wind], [1e-6, 1e-6])), NOTHING, 0.01, 20.0, (0.5,))
    assert found == pytest.approx([10.0 + (2.4 + norm.ppf(0.01)) / by_wind], abs=0.02)


# ----------------------------------------------------------------------
# The boundary's estimate, against distributions of which the quantile is known.


def search(draw: Callable[[], float], flights: int = 300) -> WindBoundary:
    """The boundary after flights that begin to fail at winds that are drawn, one each."""
    direction = Direction(20.0, 0.99, no_numbers())
    while len(direction.speeds) < flights:
        fly(direction, 30, above(draw))
        if not needs_more_flights(direction.boundary(), len(direction.speeds), 0.25, 150):
            break
    return direction.boundary()


@pytest.mark.parametrize(
    ("law", "within"),
    some([(norm(12.0, 0.3), 0.3), (norm(7.0, 0.5), 0.5), (norm(12.0, 1.0), 0.5), (gumbel_l(12.0, 0.5), 0.8)], 3),
)
def test_it_finds_the_quantile(law: Any, within: float) -> None:
    """Of either law, without being told which, and with nothing known of what is drawn."""
    truth = float(law.ppf(0.01))
    found = [search(partial(law.rvs, random_state=np.random.default_rng(seed))) for seed in range(scaled(20, 1))]
    assert np.median([abs(one.estimate - truth) for one in found]) < within
    assert sum(one.low - 0.1 <= truth <= one.high + 0.1 for one in found) >= 0.75 * len(found)


def test_ways_of_failing_that_draws_decide_are_told_apart() -> None:
    """Two ways: little of the first quantity, as much of it.  As many flights that tell no more leave it open."""
    truth = _quantile_of_two()
    known, unknown = [], []
    for seed in range(scaled(20, 1)):
        for numbers, found in ((normal_numbers(5, seed), known), (no_numbers(), unknown)):
            direction, random = Direction(20.0, 0.99, numbers), np.random.default_rng(seed)
            fly(direction, 300, partial(_two_ways, random), together=10 if SOAK else 30)
            found.append(direction.boundary())
    assert np.median([abs(one.estimate - truth) for one in known]) < 0.5
    assert sum(one.low - 0.1 <= truth <= one.high + 0.1 for one in known) >= 0.75 * len(known)
    assert np.median([one.width for one in known]) < np.median([one.width for one in unknown])


def _two_ways(random: np.random.Generator, speed: float, drawn: np.ndarray) -> frozenset[str]:
    first = drawn[0] if drawn.size else random.normal()
    much, little = -5.0 + 0.7 * (speed - 10.0) + 2.0 * first, -6.0 + 0.9 * (speed - 10.0) - 2.5 * first
    return frozenset(name for name, x in (("threat", much), ("slope", little)) if random.normal() < x)


def _quantile_of_two() -> float:
    """Where one in a hundred of these flights fails, m/s, by a sum over a fine grid of the draw."""
    first = norm.ppf((np.arange(20_000) + 0.5) / 20_000)
    speeds = np.arange(5.0, 15.0, 0.05)
    shares = []
    for speed in speeds:
        flies = norm.sf(-5.0 + 0.7 * (speed - 10.0) + 2.0 * first) * norm.sf(-6.0 + 0.9 * (speed - 10.0) - 2.5 * first)
        shares.append(1.0 - float(flies.mean()))
    return float(np.interp(0.01, shares, speeds))


def test_narrow_passes_that_no_failing_follows_from_do_not_move_it() -> None:
    """Flights fail by the first quantity in a wind that suffices; with what margin others pass is up to gusts alone.

    One in a hundred fails at 2 (the quantity's law is normal): 10 + 4 * (2 - 2.33) m/s, but for a little chance.
    """
    truth = _limit_of(0.01)
    found = []
    for seed in range(scaled(20, 1)):
        direction, random = Direction(20.0, 0.99, normal_numbers(3, seed)), np.random.default_rng(seed)
        together = 12 if SOAK else 30
        for _ in range(300 // together):
            for speed, draw in next_flights(direction, together):
                drawn = direction.numbers.first_draws(draw + 1)[draw]
                failed = drawn[0] + 0.1 * random.normal() > 2.0 - 0.25 * (speed - 10.0)
                margin = abs(random.normal(0.8, 0.2))
                direction.add(
                    speed, draw, frozenset({"slope"} if failed else ()), {} if failed else {"slope": min(1.0, margin)}
                )
        found.append(direction.boundary())
    assert np.median([abs(one.estimate - truth) for one in found]) < 0.4
    assert sum(one.low - 0.1 <= truth <= one.high + 0.1 for one in found) >= 0.75 * len(found)


def _limit_of(share: float) -> float:
    """The wind in which this share fails, m/s: of a quantity and a little chance the sum is normal."""
    return 10.0 + 4.0 * (2.0 - float(norm.isf(share)) * np.hypot(1.0, 0.1))


@pytest.mark.parametrize(
    "counts",
    [
        {10.0: (6, 0), 15.0: (6, 0), 20.0: (137, 1)},
        {10.0: (6, 0), 15.0: (6, 0), 20.0: (299, 1)},
        {10.0: (6, 0), 15.0: (6, 0), 20.0: (298, 2)},
        {10.0: (100, 0), 15.0: (99, 1), 20.0: (98, 2)},
        {19.0: (3, 0), 20.0: (0, 3)},
        {8.0: (50, 0), 10.0: (48, 2), 12.0: (30, 20)},
    ],
)
def test_few_failures_leave_open_what_they_do(counts: dict[float, tuple[int, int]]) -> None:
    """Flights that flew and failed by wind, m/s: quantiles of the posterior itself, by a sum over a grid."""
    direction = Direction(20.0, 0.99, no_numbers())
    for speed, (flew, failed) in counts.items():
        for k in range(flew + failed):
            direction.add(speed, len(direction.speeds), frozenset({"slope"} if k < failed else ()))
    found = direction.boundary()
    assert [found.low, found.estimate, found.high] == pytest.approx(_summed(counts), abs=0.6)


def _summed(counts: dict[float, tuple[int, int]]) -> list[float]:
    """Of a constant at 10 m/s, normal (20), and a wind's coefficient, log-normal about 0.5 per m/s, by either law."""
    a, b = np.meshgrid(np.linspace(-40.0, 10.0, 1001), np.exp(np.linspace(-4.7, 3.3, 201)), indexing="ij")
    speeds, logs = [], []
    for law in (norm, gumbel_l):
        density = norm.logpdf(a, scale=20.0) + norm.logpdf(np.log(b), loc=np.log(0.5))
        for speed, (flew, failed) in counts.items():
            x = a + b * (speed - 10.0)
            density = density + flew * law.logsf(x) + failed * law.logcdf(x)
        speeds.append(np.clip(10.0 + (law.ppf(0.01) - a) / b, 0.0, 20.0).ravel())
        logs.append(density.ravel())
    every, weights = np.concatenate(speeds), np.exp(np.concatenate(logs) - max(one.max() for one in logs))
    order = np.argsort(every)
    return [
        float(np.interp(part, np.cumsum(weights[order]) / weights.sum(), every[order])) for part in (0.025, 0.5, 0.975)
    ]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("seed", range(scaled(500, 5)))
def test_any_flights_have_an_answer(seed: int) -> None:
    """Of few flights or many, that fail by chance, by wind, against it, by a draw or once; in one way or several."""
    random = np.random.default_rng(seed)
    quantities, target = int(random.integers(0, 4)), float(random.choice([0.5, 0.9, 0.99, 0.9999]))
    draws, population = random.normal(size=(5000, quantities)), random.normal(size=(256, quantities))
    direction = Direction(20.0, target, DrawnNumbers(population, lambda start, stop: draws[start:stop]))
    for k in range(int(random.integers(2, 60))):
        speed = float(random.choice([0.0, 20.0, random.uniform(0.0, 20.0)]))
        by_a_draw = bool(quantities and draws[k, 0] > 1.0)
        failed = (random.random() < 0.5, speed > 10.0, speed < 10.0, by_a_draw, k == 0)[seed % 5]
        ways = random.choice(["a", "b", "c"], size=random.integers(1, 3)).tolist() if failed else ()
        margin = {way: float(random.choice([0.0, 1e-9, 0.5, random.random()])) for way in "ab" if random.random() < 0.5}
        direction.add(speed, k, frozenset(ways), None if random.random() < 0.2 else margin)
    found = direction.boundary()
    assert 0.0 <= found.low <= found.estimate <= found.high <= 20.0
    assert all(0.0 <= speed <= 20.0 for speed, _ in next_flights(direction, 3))


def test_a_wind_that_is_none_is_not_taken_in() -> None:
    for speed in (-0.1, 20.1, float("nan")):
        with pytest.raises(ValueError, match="expected 0 to 20 m/s"):
            Direction(20.0, 0.99, no_numbers()).add(speed, 0, frozenset())


def test_a_long_tail_is_seen_where_it_is() -> None:
    """With the flights of Gumbel's law its own half of the weights grows, and the boundary lies lower."""
    law = gumbel_l(13.0, 1.5)
    speeds = np.repeat(np.arange(4.0, 16.0, 0.5), 60)
    direction, outcome = Direction(20.0, 0.99, no_numbers()), np.random.default_rng(3)
    for draw, (speed, limit) in enumerate(zip(speeds, law.rvs(speeds.size, random_state=outcome), strict=True)):
        direction.add(float(speed), draw, frozenset() if speed < limit else frozenset({"slope"}))
    found = direction.boundary()
    assert found.low < law.ppf(0.01) < found.high
    # A normal law of the same mean and standard deviation would have it there.
    assert found.estimate < norm(law.mean(), law.std()).ppf(0.01) - 0.5


def test_what_always_flies_lies_beyond_what_was_looked_at() -> None:
    direction = Direction(10.0, 0.9, no_numbers())
    fly(direction, 120, lambda *_: frozenset())
    assert max(direction.speeds) == 10.0
    found = direction.boundary()
    assert found.is_beyond_search
    assert found.estimate == found.high == 10.0


@pytest.mark.parametrize(("law", "which"), [(norm(12.0, 1.0), 0), (gumbel_l(12.0, 1.0), 1)])
def test_the_law_that_flights_follow_weighs_more(law: Any, which: int) -> None:
    speeds = np.tile(np.arange(7.0, 15.0, 0.02), 8)
    direction = Direction(20.0, 0.99, no_numbers())
    for draw, (speed, limit) in enumerate(zip(speeds, law.rvs(speeds.size, random_state=4), strict=True)):
        direction.add(float(speed), draw, frozenset() if speed < limit else frozenset({"slope"}))
    assert direction.fits()[which].weight > 0.95


def test_a_boundary_surely_beyond_all_that_was_looked_at_is_settled() -> None:
    """Some fail in the largest wind, 10 m/s, but fewer than one in ten: one in ten does in 10.7 m/s."""
    direction, random = Direction(10.0, 0.9, no_numbers()), np.random.default_rng(5)
    for draw in range(1200):
        speed = 8.0 + 2.0 * (draw % 6) / 5.0
        direction.add(speed, draw, frozenset() if speed < random.normal(12.0, 1.0) else frozenset({"slope"}))
    assert any(direction.failed_modes)
    found = direction.boundary()
    assert found.is_beyond_search
    assert found.width < 0.2


def test_what_never_flies_has_no_wind() -> None:
    direction = Direction(10.0, 0.9, no_numbers())
    fly(direction, 60, lambda *_: frozenset({"slope"}))
    assert direction.boundary().estimate == 0.0


def test_more_is_flown_until_the_interval_is_narrow() -> None:
    wide, narrow = WindBoundary(9.0, 8.5, 9.51, False), WindBoundary(9.0, 8.5, 9.5, False)
    assert needs_more_flights(wide, 100, 0.5, 30)
    assert not needs_more_flights(narrow, 30, 0.5, 30)
    assert needs_more_flights(narrow, 29, 0.5, 30)
