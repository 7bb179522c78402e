"""The sample of a distribution that is known by its density alone, against scipy's distributions."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import gamma, gumbel_l, norm

from planfly.campaigns.statistics.importance_sampling import importance_sample

Floats = NDArray[np.float64]
PARTS = (0.05, 0.16, 0.5, 0.84, 0.95)


@pytest.mark.parametrize(("law", "mode"), [(norm(3.0, 2.0), 3.0), (gamma(3.0), 2.0), (gumbel_l(1.0, 2.0), 1.0)])
@pytest.mark.parametrize("wide", [0.5, 1.0, 2.0])
def test_quantiles_are_the_laws_wherever_it_was_looked_for(law: Any, mode: float, wide: float) -> None:
    """About the mode, with half, all or twice the deviation: skewed laws, too, and one that is none below 0."""
    sample = importance_sample(lambda x: law.logpdf(x[:, 0]), np.array([mode]), wide * law.var() * np.eye(1), 512)
    assert sample.shape == (512, 1)
    assert np.quantile(sample[:, 0], PARTS) == pytest.approx(law.ppf(PARTS), abs=0.15 * law.std())


def test_a_quantity_that_bends_with_another_is_followed() -> None:
    """x normal, y normal about x^2: looked for along a straight line."""

    def log_density(points: Floats) -> Floats:
        x, y = points.T
        out: Floats = -0.5 * x * x - 2.0 * (y - x * x) ** 2
        return out

    x, y = importance_sample(log_density, np.zeros(2), np.diag([1.0, 2.0]), 512).T
    assert np.corrcoef(x * x, y)[0, 1] > 0.85
    assert [x.mean(), y.mean()] == pytest.approx([0.0, 1.0], abs=0.15)


def test_eleven_dimensions_are_as_good() -> None:
    """Of the t distribution's points few are near the middle there; quantiles hold all the same, and correlations."""
    size = 11
    root = np.tril(np.random.default_rng(5).normal(size=(size, size)), -1) / 3.0 + np.eye(size)
    covariance = root @ root.T
    inverse = np.linalg.inv(covariance)
    sample = importance_sample(
        lambda x: -0.5 * np.einsum("ni,ij,nj->n", x, inverse, x), np.zeros(size), 1.2 * covariance, 512
    )
    deviations = np.sqrt(np.diag(covariance))
    assert sample.mean(axis=0) / deviations == pytest.approx(np.zeros(size), abs=0.15)
    assert sample.std(axis=0) / deviations == pytest.approx(np.ones(size), abs=0.15)
    assert np.corrcoef(sample.T)[0] == pytest.approx(covariance[0] / deviations[0] / deviations, abs=0.12)


def test_the_same_comes_again_and_in_no_order() -> None:
    one, other = (importance_sample(lambda x: -0.5 * x[:, 0] ** 2, np.zeros(1), np.eye(1), 256)[:, 0] for _ in range(2))
    assert (one == other).all()
    assert abs(np.corrcoef(one, np.arange(256))[0, 1]) < 0.2
