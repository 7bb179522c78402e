"""The bound that holds at every number of flights: against the definition, and 1,000 campaigns of known probability."""

import math

import numpy as np
import pytest
from scipy.special import betaln, gammaln
from scipy.stats import binom

from planfly.campaigns.statistics.proportions import Tally
from planfly.campaigns.statistics.stopping_bound import StoppingBound
from tests.soak import SOAK, note, scaled

# A tight bound errs in just a twentieth: of so many campaigns more than expected, one test in a thousand by chance.
CHANCE = 0.999


@pytest.mark.parametrize(("target", "flights"), [(0.9, 29), (0.95, 59), (0.99, 299)])
def test_without_a_failure_it_takes_no_more_flights_than_a_fixed_number(target: float, flights: int) -> None:
    bound = StoppingBound(target)
    assert bound.fewest == flights == math.ceil(math.log(0.05) / math.log(target))
    assert bound.interval(flights, 0).low >= target > bound.interval(flights - 1, 0).low


@pytest.mark.parametrize("target", [0.9, 0.99, 0.999])
def test_what_the_fewest_flights_leave_is_kept_for_failures(target: float) -> None:
    bound = StoppingBound(target)
    assert 0.0 <= bound.evidence(bound.fewest, 0, target) - math.log(20.0) < 1e-3


def test_a_probability_is_excluded_on_the_side_that_is_asked() -> None:
    bound = StoppingBound(0.99)
    assert not bound.excludes(0, 300, 0.99, above=True)
    assert bound.excludes(0, 300, 0.99, above=False)
    assert bound.excludes(300, 0, 0.5, above=True)
    assert not bound.excludes(300, 0, 0.5, above=False)


def test_the_mixture_is_a_martingale_that_begins_at_one() -> None:
    """From any s and f, the mean of E over the next flight is E itself: the sum that all of it rests on."""
    bound, p = StoppingBound(0.99), 0.93
    assert bound.evidence(0, 0, p) == pytest.approx(0.0, abs=1e-12)
    for s, f in ((0, 0), (5, 0), (40, 3), (300, 1)):
        mean = p * math.exp(bound.evidence(s + 1, f, p)) + (1 - p) * math.exp(bound.evidence(s, f + 1, p))
        assert mean == pytest.approx(math.exp(bound.evidence(s, f, p)), rel=1e-9)


def test_its_edges_are_where_the_evidence_is_twenty() -> None:
    bound = StoppingBound(0.95)
    low, high = bound.interval(180, 20)
    assert 0.0 < low < 0.9 < high < 1.0
    for edge in (low, high):
        terms = [w * math.exp(betaln(180 + a, 20 + b) - betaln(a, b)) for w, a, b in bound.parts]
        assert sum(terms) / (edge**180 * (1 - edge) ** 20) == pytest.approx(20.0, rel=1e-6)


def left_out(p: float, target: float, most: int) -> tuple[float, float]:
    """The exact probabilities that p is left out at any of the first numbers of flights, and that `--prove` errs.

    By the law of the number of failures after each flight, of the campaigns that go on: no draws.
    """
    parts = StoppingBound(target).parts
    count = np.arange(most + 1)
    logs = [
        (math.log(w) - betaln(a, b), gammaln(count + a), gammaln(count + b), gammaln(count + a + b))
        for w, a, b in parts
    ]

    def first_time(q: float, failures_from: float) -> tuple[float, float]:
        """That q is excluded at all, and with failures of a share above, or not above, this."""
        law = np.array([1.0])
        # More failures than 12 standard deviations beyond the mean: not one campaign in 1e15.
        widest = math.ceil(most * (1.0 - p) + 12.0 * math.sqrt(most * p * (1.0 - p)) + 12.0)
        above = below = 0.0
        for n in range(1, most + 1):
            law = (np.append(law, 0.0) * p + np.append(0.0, law) * (1.0 - p))[: widest + 1]
            f = count[: law.size]
            mixture = np.logaddexp.reduce([head + sa[n - f] + fb[f] - both[n] for head, sa, fb, both in logs], axis=0)
            out = mixture - (n - f) * math.log(q) - f * math.log1p(-q) >= math.log(20.0)
            high = f / n > failures_from
            above, below = above + law[out & high].sum(), below + law[out & ~high].sum()
            law[out] = 0.0
        return above, below

    above, below = first_time(target, 1.0 - target)
    return sum(first_time(p, 0.5)), above if p >= target else below


@pytest.mark.parametrize(("p", "flights"), [(0.5, 3000), (0.9, 3000), (0.9899, 3000), (0.99, 3000), (0.999, 20_000)])
def test_it_leaves_out_the_truth_in_at_most_a_twentieth(p: float, flights: int) -> None:
    """Ville's inequality, counted out: no chance in it.  Just below the target `--prove` errs most."""
    flights = scaled(20_000, flights) if p > 0.5 else flights
    never, erred = left_out(p, 0.99, flights)
    note(f"campaign: exact bound at p = {p}", flights=flights, left_out=round(never, 5), erred=round(erred, 5))
    assert 0.001 < never <= 0.05
    assert erred <= 0.05


def looks(most: int) -> list[int]:
    """Numbers of flights at which the campaigns are looked at: each up to 60, then a twentieth more; in a soak each."""
    out = list(range(1, most + 1 if SOAK else 61))
    while out[-1] < most:
        out.append(math.ceil(1.05 * out[-1]))
    return out


@pytest.mark.parametrize("p", [0.5, 0.9, 0.99, 0.999])
def test_it_covers_at_all_stopping_times_and_prove_errs_in_at_most_a_twentieth(p: float) -> None:
    """Campaigns as they are led: some 50 of 1,000 left out is what 5 % are."""
    campaigns, most = (1000, 20_000) if SOAK else (300, 3000)
    bound, enough = StoppingBound(0.99), -math.log(0.05)
    random = np.random.default_rng(7)
    parts = np.array(bound.parts)
    left = erred = 0
    when = np.array([n for n in looks(most) if n <= most])
    for _ in range(campaigns):
        success = np.cumsum(random.random(most) < p)[when - 1]
        failure = when - success

        def evidence(q: float, s: np.ndarray = success, f: np.ndarray = failure) -> np.ndarray:
            terms = [math.log(w) + betaln(s + a, f + b) - betaln(a, b) for w, a, b in parts]
            return np.logaddexp.reduce(terms, axis=0) - s * math.log(q) - f * math.log1p(-q)

        left += bool((evidence(p) >= enough).any())
        # As --prove: the first time that the target is excluded, on the side where the share lies.
        decided = np.flatnonzero(evidence(0.99) >= enough)
        if decided.size:
            reached = success[decided[0]] / when[decided[0]] > 0.99
            erred += bool(reached) != (p >= 0.99)
    note(f"campaign: bound at p = {p}", campaigns=campaigns, flights_each=most, not_covered=left, erred=erred)
    few = binom.ppf(CHANCE, campaigns, 0.05)
    assert left <= few
    assert erred <= few


def test_a_target_far_off_is_refuted_soon() -> None:
    bound = StoppingBound(0.99)
    # Half of the flights fail: by hand 0.01^10 0.99^10 is 9e-21 of what Beta(1/2, 1/2) makes of it.
    assert bound.interval(10, 10).high < 0.99


def test_lost_flights_count_against_both_ways() -> None:
    bound = StoppingBound(0.9)
    low, high = bound.bounds(Tally(200, 5, 10))
    assert low == bound.interval(200, 15).low
    assert high == bound.interval(210, 5).high
    assert bound.interval(0, 0) == (0.0, 1.0)
