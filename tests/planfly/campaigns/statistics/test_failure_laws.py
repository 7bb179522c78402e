"""The laws of one wind at which flights begin to fail, against scipy's, and what they say of few flights."""

import numpy as np
import pytest
from scipy.stats import gumbel_l, norm

from planfly.campaigns.statistics.failure_laws import FailureLaws

PARTS = np.array([0.025, 0.5, 0.975])


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


def test_a_law_that_flights_follow_is_found() -> None:
    law = norm(9.0, 1.0)
    speeds = np.repeat(np.arange(4.0, 14.0, 0.5), 100)
    flew = speeds < law.rvs(speeds.size, random_state=np.random.default_rng(2))
    low, middle, high = FailureLaws.up_to(20.0).quantile_at(0.1, speeds, flew, PARTS)
    assert low < law.ppf(0.1) < high
    assert middle == pytest.approx(law.ppf(0.1), abs=0.25)


def test_the_more_flew_the_further_the_boundary() -> None:
    laws = FailureLaws.up_to(20.0)
    few, many = (laws.quantile_at(0.01, np.full(n, 20.0), np.full(n, True), PARTS) for n in (10, 300))
    assert (many > few).all()
    # 299 of 299 show a share of 1 % with 95 % confidence: by any law the boundary is beyond, or as good as.
    assert many[0] > 19.5
