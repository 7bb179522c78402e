"""One way of failing as it is fitted, against made flights whose coefficients are known."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import gumbel_l, norm

from planfly.campaigns.statistics.censored_regression import fit_mode
from planfly.campaigns.statistics.links import LEAST_OF_MANY, PROBIT, BinaryLink

Floats = NDArray[np.float64]
# Of the constant, of the wind from 10 m/s on, and of two draws.
TRUTH = np.array([-1.0, 0.6, 1.5, 0.0])
# Of a flight's room, in scales: one over the room's coefficient.
SPREAD = 0.8


class Made(NamedTuple):
    """Flights: (n, 4), and (n,) who failed and by how much the others passed."""

    terms: Floats
    failed: NDArray[np.bool_]
    room: Floats


def made(count: int, seed: int, law: Any = norm) -> Made:
    """Flights that pass by SPREAD * (e - TRUTH . terms), e of a law: they fail where that is below 0."""
    random = np.random.default_rng(seed)
    terms = np.column_stack((np.ones(count), random.uniform(-8.0, 4.0, count), random.normal(size=(count, 2))))
    room = SPREAD * (law.rvs(size=count, random_state=random) - terms @ TRUTH)
    return Made(terms, room < 0.0, room.clip(0.0, 1.0))


def untold(flights: Made) -> Made:
    """The same, but that only who failed is known."""
    return flights._replace(room=np.zeros(len(flights.room)))


@pytest.mark.parametrize(("link", "law"), [(PROBIT, norm), (LEAST_OF_MANY, gumbel_l)])
@pytest.mark.parametrize("known", [True, False])
def test_coefficients_are_found(link: BinaryLink, law: Any, known: bool) -> None:
    flights = made(20_000, 2, law)
    mode = fit_mode(*(flights if known else untold(flights)), link)
    deviations = np.sqrt(np.diag(mode.covariance))
    assert mode.mean == pytest.approx(TRUTH, abs=0.1)
    assert (np.abs(mode.mean - TRUTH) < 4.0 * deviations).all()
    assert deviations.max() < 0.06
    assert mode.by_room == (pytest.approx(1.0 / SPREAD, rel=0.03) if known else 0.0)


@pytest.mark.parametrize("known", [True, False])
def test_the_covariance_is_that_of_repeated_flights(known: bool) -> None:
    sets = [made(500, seed) if known else untold(made(500, seed)) for seed in range(60)]
    means = np.array([fit_mode(*flights, PROBIT).mean for flights in sets])
    told = np.sqrt(np.diag(fit_mode(*sets[1], PROBIT).covariance))
    assert means.std(axis=0) == pytest.approx(told, rel=0.4)


def test_room_makes_each_coefficient_surer() -> None:
    some, none = (np.diag(fit_mode(*flights, PROBIT).covariance) for flights in (made(300, 1), untold(made(300, 1))))
    assert (some < 0.8 * none).all()


def test_the_depth_of_failing_and_the_breadth_of_passing_count_for_nothing() -> None:
    """Whatever room is given for those that failed; and a scale or more is told by 1."""
    flights = made(300, 4)
    plain = fit_mode(*flights, PROBIT)
    deep = flights._replace(room=np.where(flights.failed, 0.5, flights.room))
    assert fit_mode(*deep, PROBIT).mean == pytest.approx(plain.mean)
    # Where all pass by a scale or more, who failed is all there is.
    far = flights._replace(room=np.ones(300))
    assert fit_mode(*far, PROBIT).mean == pytest.approx(fit_mode(*untold(flights), PROBIT).mean)


@pytest.mark.parametrize("known", [True, False])
def test_the_evidence_is_for_the_link_that_flights_follow(known: bool) -> None:
    for law, right, wrong in ((norm, PROBIT, LEAST_OF_MANY), (gumbel_l, LEAST_OF_MANY, PROBIT)):
        flights = made(6000, 3, law)
        by_right, by_wrong = (
            fit_mode(*(flights if known else untold(flights)), link).log_evidence for link in (right, wrong)
        )
        assert by_right > by_wrong + 3.0


def test_the_evidence_is_the_integral_over_the_prior() -> None:
    """Of constant and wind's coefficient, whose prior is normal (20; 1.5 in 1/(m/s)), by a sum over a fine grid."""
    random = np.random.default_rng(6)
    wind = random.uniform(-5.0, 5.0, 300)
    failed = random.normal(size=300) < -0.5 + 0.4 * wind
    mode = fit_mode(np.column_stack((np.ones(300), wind)), failed, np.zeros(300), PROBIT)
    a, b = np.meshgrid(np.arange(-1.5, 0.5, 0.01), np.arange(0.1, 0.8, 0.005), indexing="ij")
    logs = norm.logpdf(a, scale=20.0) + norm.logpdf(b, scale=1.5)
    for sign, speed in zip(np.where(failed, 1.0, -1.0), wind, strict=True):
        logs += norm.logcdf(sign * (a + b * speed))
    assert mode.log_evidence == pytest.approx(logs_sum(logs, 0.01 * 0.005), abs=0.1)


def test_the_evidence_of_room_is_the_integral_over_the_prior() -> None:
    """Of the constant and the room's coefficient (normal, 10 in 1/scale), the wind's having no part."""
    random = np.random.default_rng(7)
    room = 0.5 * (random.normal(size=200) + 1.0)
    failed = room < 0.0
    terms = np.column_stack((np.ones(200), np.zeros(200)))
    mode = fit_mode(terms, failed, room.clip(0.0, 1.0), PROBIT)
    a, k = np.meshgrid(np.arange(-2.0, 0.0, 0.005), np.arange(1.0, 3.5, 0.005), indexing="ij")
    # The wind's coefficient integrates to 1 over its prior.
    logs = norm.logpdf(a, scale=20.0) + norm.logpdf(k, scale=10.0)
    for one in room:
        logs += (
            norm.logcdf(a) if one < 0.0 else norm.logsf(a + k) if one >= 1.0 else norm.logpdf(a + k * one) + np.log(k)
        )
    assert mode.by_room == pytest.approx(2.0, rel=0.15)
    assert mode.log_evidence == pytest.approx(logs_sum(logs, 0.005 * 0.005), abs=0.1)


def logs_sum(logs: Floats, cell: float) -> float:
    """Logarithm of an integral, of logarithms on a grid of cells."""
    return float(np.log(np.exp(logs - logs.max()).sum() * cell) + logs.max())
