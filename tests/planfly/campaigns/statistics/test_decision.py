"""Intervals of a fixed number of flights: against sums of binomial terms, and the table that go/no-go rests on."""

import math

import numpy as np
import pytest
from scipy.special import betaln, gammaln
from scipy.stats import beta, binom

from planfly.campaigns.statistics.decision import (
    Estimator,
    Goal,
    StoppingBound,
    Tally,
    clopper_pearson,
    lower_bound,
    upper_bound,
    wilson,
)
from tests.soak import SOAK, note, scaled, some


@pytest.mark.parametrize(("target", "flights"), [(0.95, 59), (0.99, 299), (0.999, 2995)])
def test_flights_without_failure_that_reach_a_target(target: float, flights: int) -> None:
    # P^n = 0.05, by hand.
    assert flights == math.ceil(math.log(0.05) / math.log(target))
    assert lower_bound(Tally(flights, 0)) >= target > lower_bound(Tally(flights - 1, 0))


@pytest.mark.parametrize(("failures", "flights"), [(1, 473), (3, 773), (5, 1049), (10, 1693)])
def test_flights_with_failures_that_reach_99_percent(failures: int, flights: int) -> None:
    assert lower_bound(Tally(flights - failures, failures)) >= 0.99
    assert lower_bound(Tally(flights - 1 - failures, failures)) < 0.99
    # At P = 0.99 so few failures happen with a probability of 5 % or less.
    assert binom.cdf(failures, flights, 0.01) <= 0.05 < binom.cdf(failures, flights - 1, 0.01)


@pytest.mark.parametrize(("successes", "trials"), [(0, 10), (3, 10), (10, 10), (297, 299)])
def test_clopper_pearson_and_wilson_equal_their_formulas(successes: int, trials: int) -> None:
    low, high = clopper_pearson(successes, trials)
    assert low == pytest.approx(beta.ppf(0.025, successes, trials - successes + 1) if successes else 0.0)
    assert high == pytest.approx(beta.ppf(0.975, successes + 1, trials - successes) if successes < trials else 1.0)
    z, share = 1.959963984540054, successes / trials
    middle = (share + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z / (1 + z * z / trials) * math.sqrt(share * (1 - share) / trials + z * z / (4 * trials**2))
    assert wilson(successes, trials) == pytest.approx((middle - half, middle + half), abs=1e-12)


@pytest.mark.parametrize(("p", "flights"), [(0.5, 200), (0.9, 400), (0.99, 3000), (0.999, 30000)])
def test_the_interval_covers_as_it_says(p: float, flights: int) -> None:
    """1,000 campaigns, and exactly: the sum of the binomial terms whose interval contains p."""
    drawn = np.random.default_rng(1).binomial(flights, p, 1000)
    inside = {k: low <= p <= high for k in set(drawn.tolist()) for low, high in [clopper_pearson(k, flights)]}
    covered = np.mean([inside[k] for k in drawn.tolist()])
    assert 0.95 <= covered <= 0.99
    spread = 8.0 * math.sqrt(flights * p * (1.0 - p))
    terms = range(max(0, int(flights * p - spread)), min(flights, int(flights * p + spread)) + 1)
    exact = sum(binom.pmf(k, flights, p) for k in terms if (ends := clopper_pearson(k, flights)).low <= p <= ends.high)
    assert 0.95 <= exact <= 0.99


def test_lost_flights_widen_the_interval_both_ways() -> None:
    tally = Tally(90, 4, 6)
    assert tally.flown == 100
    assert lower_bound(tally) == lower_bound(Tally(90, 10))
    assert upper_bound(tally) == upper_bound(Tally(96, 4))


def test_nothing_flown_says_nothing() -> None:
    assert (lower_bound(Tally(0, 0)), upper_bound(Tally(0, 0))) == (0.0, 1.0)
    assert clopper_pearson(0, 0) == (0.0, 1.0)
    assert math.isnan(Tally(0, 0).share)


# ----------------------------------------------------------------------
# The bound that holds at every number of flights: against the definition, and 1,000 campaigns of known probability.

# A tight bound errs in just a twentieth: of so many campaigns more than expected, one test in a thousand by chance.
CHANCE = 0.999


@pytest.mark.parametrize(("target", "flights"), [(0.9, 29), (0.95, 59), (0.99, 299)])
def test_without_a_failure_it_takes_no_more_flights_than_a_fixed_number(target: float, flights: int) -> None:
    bound = StoppingBound(target)
    assert bound.min_flights == flights == math.ceil(math.log(0.05) / math.log(target))
    assert bound.interval(flights, 0).low >= target > bound.interval(flights - 1, 0).low


@pytest.mark.parametrize("target", [0.9, 0.99, 0.999])
def test_what_the_fewest_flights_leave_is_kept_for_failures(target: float) -> None:
    bound = StoppingBound(target)
    assert 0.0 <= bound.evidence(bound.min_flights, 0, target) - math.log(20.0) < 1e-3


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
        terms = [w * math.exp(betaln(180 + a, 20 + b) - betaln(a, b)) for w, a, b in bound.components]
        assert sum(terms) / (edge**180 * (1 - edge) ** 20) == pytest.approx(20.0, rel=1e-6)


def left_out(p: float, target: float, most: int) -> tuple[float, float]:
    """The exact probabilities that p is left out at any of the first numbers of flights, and that `--prove` errs.

    By the law of the number of failures after each flight, of the campaigns that go on: no draws.
    """
    parts = StoppingBound(target).components
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


@pytest.mark.parametrize(
    ("p", "flights"), some([(0.5, 3000), (0.9, 3000), (0.9899, 3000), (0.99, 3000), (0.999, 6_000)], 2)
)
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
    parts = np.array(bound.components)
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


def test_lost_flights_widen_the_bound_both_ways() -> None:
    bound = StoppingBound(0.9)
    low, high = bound.bounds(Tally(200, 5, 10))
    assert low == bound.interval(200, 15).low
    assert high == bound.interval(210, 5).high
    assert bound.interval(0, 0) == (0.0, 1.0)


# ----------------------------------------------------------------------
# What is answered to a target, just inside and just outside of it.


@pytest.mark.parametrize(
    ("flyable", "failed", "answer"),
    [(59, 0, "reached"), (58, 0, "undecided"), (0, 4, "missed"), (93, 11, "missed"), (99, 8, "undecided")],
)
@pytest.mark.parametrize("stops", [False, True])
def test_the_answer_to_95_percent(flyable: int, failed: int, answer: str, stops: bool) -> None:
    found = Estimator(Goal(0.95, stops, 1000)).estimate(Tally(flyable, failed))
    if stops and (flyable, failed) == (93, 11):
        # The bound that holds at every number of flights is wider.
        assert found.answer == "undecided"
    else:
        assert found.answer == answer


def test_nothing_is_answered_where_nothing_was_asked() -> None:
    found = Estimator(Goal(None, False, 10)).estimate(Tally(10, 0))
    assert found.answer == "no target"
    # Two-sided: 0.025^(1/10); one-sided: 0.05^(1/10).
    assert found.interval.low == pytest.approx(0.025**0.1)
    assert found.lower == pytest.approx(0.05**0.1)


def test_a_lost_flight_keeps_a_target_from_being_reached_and_from_being_missed() -> None:
    estimator = Estimator(Goal(0.95, False, 100))
    assert estimator.estimate(Tally(59, 0, 1)).answer == "undecided"
    assert estimator.estimate(Tally(0, 1, 3)).answer == "undecided"
    assert estimator.estimate(Tally(0, 5, 0)).answer == "missed"


def test_a_lost_flight_counts_against_either_answer() -> None:
    prove = Estimator(Goal(0.99, True, 5000))
    assert prove.decides(Tally(299, 0))
    assert not prove.decides(Tally(299, 0, 1))
    # Twenty failures of a hundred miss it; twenty that were lost may all have flown.
    assert prove.decides(Tally(80, 20))
    assert not prove.decides(Tally(80, 0, 20))


@pytest.mark.parametrize(
    ("goal", "tally"),
    [
        (Goal(0.8, False, 40), Tally(36, 4)),
        (Goal(0.8, False, 20), Tally(14, 6)),
        (Goal(0.9, True, 20), Tally(20, 0)),
        (Goal(0.99, False, 40), Tally(40, 0)),
    ],
)
def test_one_flight_less_than_those_that_decide_does_not(goal: Goal, tally: Tally) -> None:
    estimator = Estimator(goal)
    assert estimator.estimate(tally).answer == "undecided"
    flights = estimator.deciding_flights(tally)
    assert flights is not None
    assert goal.target is not None
    to_whole = math.floor if tally.share >= goal.target else math.ceil

    def answer(count: int) -> str:
        flyable = to_whole(round(tally.share * count, 9))
        return estimator.estimate(Tally(flyable, count - flyable)).answer

    assert (answer(flights), answer(flights - 1)) == (
        "reached" if tally.share >= goal.target else "missed",
        "undecided",
    )


def test_at_the_target_itself_no_number_decides() -> None:
    assert Estimator(Goal(0.75, False, 4)).deciding_flights(Tally(3, 1)) is None


def test_undecided_flights_count_against_either_bound() -> None:
    """As lost ones do: 30 flyable and 2 failed of 40, the other 8 failed for one bound and flyable for the other."""
    estimate = Estimator(Goal(0.9, False, 40)).estimate(Tally(30, 2, undecided=8))
    assert estimate.lower == lower_bound(Tally(30, 10))
    assert estimate.upper == upper_bound(Tally(38, 2))
    assert estimate.answer == "undecided"
    assert Tally(30, 2, 1, 7).share == 0.75
    # The share of flyable flights is 0.75 or 0.95, however many are flown.
    assert Estimator(Goal(0.9, False, 40)).deciding_flights(Tally(30, 2, undecided=8)) is None
