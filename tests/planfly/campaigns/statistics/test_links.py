"""The links of a binary regression, against scipy's laws."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import gumbel_l, norm

from planfly.campaigns.statistics.links import CLOGLOG, LINKS, PROBIT, BinaryLink

CASES = [(PROBIT, norm), (CLOGLOG, gumbel_l)]
X = np.linspace(-6.0, 3.0, 37)


@pytest.mark.parametrize(("link", "law"), CASES)
def test_shares_and_density_are_the_laws(link: BinaryLink, law: Any) -> None:
    assert link.log_cdf(X) == pytest.approx(law.logcdf(X), rel=1e-9)
    assert link.log_survival(X) == pytest.approx(law.logsf(X), rel=1e-9)
    assert link.survival(X) == pytest.approx(law.sf(X), rel=1e-9)
    assert link.density(X) == pytest.approx(law.pdf(X), rel=1e-9)
    assert link.log_density(X) == pytest.approx(law.logpdf(X), rel=1e-9)
    assert link.information(X) == pytest.approx(law.pdf(X) ** 2 / (law.cdf(X) * law.sf(X)), rel=1e-8)


@pytest.mark.parametrize(("link", "law"), CASES)
@pytest.mark.parametrize("failed", [True, False])
def test_derivatives_are_those_of_the_law(link: BinaryLink, law: Any, failed: bool) -> None:
    logs, h = (law.logcdf if failed else law.logsf), 1e-4
    first, second = link.derivatives(X, np.full(X.size, failed))
    assert first == pytest.approx((logs(X + h) - logs(X - h)) / (2.0 * h), rel=1e-5, abs=1e-7)
    assert second == pytest.approx((logs(X + h) - 2.0 * logs(X) + logs(X - h)) / h**2, rel=1e-3, abs=1e-5)


@pytest.mark.parametrize(("link", "law"), CASES)
def test_derivatives_of_the_density_are_the_laws(link: BinaryLink, law: Any) -> None:
    h, logs = 1e-4, law.logpdf
    first, second = link.density_derivatives(X)
    assert first == pytest.approx((logs(X + h) - logs(X - h)) / (2.0 * h), rel=1e-5, abs=1e-7)
    assert second == pytest.approx((logs(X + h) - 2.0 * logs(X) + logs(X - h)) / h**2, rel=1e-3, abs=1e-5)


@pytest.mark.parametrize(("link", "law"), CASES)
@pytest.mark.parametrize("width", [0.5, 3.0])
def test_information_is_the_mean_square_of_the_score(link: BinaryLink, law: Any, width: float) -> None:
    """Of one that fails, one whose room is told, and one that passes by more: by quadrature."""
    h = 1e-5

    def score(logs: Any, z: float) -> float:
        return float(logs(z + h) - logs(z - h)) / (2.0 * h)

    for x in (-4.0, -1.0, 0.0, 1.5):
        more = x + width
        ends = law.cdf(x) * score(law.logcdf, x) ** 2 + law.sf(more) * score(law.logsf, more) ** 2
        between = quad(lambda z: score(law.logpdf, z) ** 2 * law.pdf(z), x, more)[0]
        assert link.information(np.array([x]), width)[0] == pytest.approx(ends + between, rel=1e-6)


@pytest.mark.parametrize("link", LINKS)
def test_far_from_all_flights_numbers_stay_finite(link: BinaryLink) -> None:
    """A search may look at winds and draws that its fit has at no chance whatever."""
    far = np.array([-300.0, -60.0, -35.0, 35.0, 300.0])
    for failed in (True, False):
        for values in link.derivatives(far, np.full(far.size, failed)):
            assert np.isfinite(values).all()
        assert (link.derivatives(far, np.full(far.size, failed))[1] <= 0.0).all()
    for width in (0.0, 2.0):
        assert np.isfinite(link.information(far, width)).all()
        assert (link.information(far, width) >= 0.0).all()
    assert np.isfinite(link.log_density(far[:-1])).all()
    assert np.isfinite(link.density_derivatives(far)).all()
    assert np.isfinite(link.density(far)).all()
