import numpy as np
import pytest
from scipy.signal import lfilter

from aircraft.identification.regression import correlation_samples, fit_with_prior

FREE = np.full(2, np.inf)


def coloured(draw: np.random.Generator, n: int, decay: float) -> np.ndarray:
    return np.asarray(lfilter([np.sqrt(1.0 - decay**2)], [1.0, -decay], draw.normal(size=n)))


def test_samples_that_hang_together_are_counted_as_the_theory_does() -> None:
    """A first-order process: the sum of its autocorrelations is (1 + a) / (1 - a)."""
    found = correlation_samples(coloured(np.random.default_rng(2), 60_000, 0.8))
    assert found == pytest.approx(9.0, rel=0.15)


def test_stated_deviations_are_those_of_many_fits_to_coloured_noise() -> None:
    draw = np.random.default_rng(5)
    x = np.column_stack([coloured(draw, 6000, 0.95), np.ones(6000)])
    off = []
    for _ in range(60):
        fit = fit_with_prior(x, x @ [2.0, 1.0] + coloured(draw, 6000, 0.9), np.zeros(2), FREE, np.arange(6000) // 200)
        off.append((fit.estimate - [2.0, 1.0]) / np.sqrt(np.diag(fit.covariance)))
    assert np.std(off, axis=0) == pytest.approx([1.0, 1.0], abs=0.3)


def test_data_that_say_nothing_leave_the_prior() -> None:
    x = np.column_stack([np.linspace(-1.0, 1.0, 400), np.zeros(400)])
    noisy = x[:, 0] + 0.1 * np.random.default_rng(1).normal(size=400)
    fit = fit_with_prior(x, noisy, np.array([0.0, 0.7]), np.array([5.0, 0.2]), np.arange(400) // 20)
    assert fit.estimate[1] == pytest.approx(0.7)
    assert np.sqrt(fit.covariance[1, 1]) == pytest.approx(0.2)
    assert fit.explained > 0.9


def test_a_floor_of_what_no_model_gets_right_keeps_exact_data_from_being_believed() -> None:
    x = np.linspace(-1.0, 1.0, 200)[:, None]
    fit = fit_with_prior(x, 2.0 * x[:, 0], np.zeros(1), np.ones(1), np.arange(200) // 10, floor=1.0)
    # By hand: the sum of squares s, weight 1: s / (s + 1) of 2.
    s = float((x * x).sum())
    assert fit.estimate[0] == pytest.approx(2.0 * s / (s + 1.0))
