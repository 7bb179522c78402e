"""The prior of drag and power against real aircraft: each predicted from all others."""

import math

import numpy as np
import pytest

from aircraft import power_prior
from aircraft.power_prior import MAX_EFFICIENCY, POWER_PRIOR
from benchmarks.real_power import Prediction, fit_prior, geometric_mean_ratio, predictions, read_table


@pytest.fixture(scope="module")
def predicted() -> list[Prediction]:
    return predictions(leave_out=True)


def test_intervals_contain_the_power_of_real_aircraft(predicted: list[Prediction]) -> None:
    assert len(predicted) == 22
    # Of 22, an interval of 95 % contains 20.9.
    assert sum(one.inside for one in predicted) >= 20
    # An interval that spans less than a factor of 4 is of use.
    assert np.median([one.high / one.low for one in predicted]) < 4.0
    errors = np.log([one.power / one.real.power for one in predicted])
    deviations = np.log([one.high / one.low for one in predicted]) / (2.0 * 1.96)
    assert math.sqrt(np.mean((errors / deviations) ** 2)) == pytest.approx(1.0, abs=0.06)


def test_small_foam_aircraft_are_not_flattered(predicted: list[Prediction]) -> None:
    foam = [one for one in predicted if one.real.kind == "foam<3kg"]
    assert len(foam) == 7
    assert sum(one.inside for one in foam) >= 6
    assert 0.8 < geometric_mean_ratio(foam) < 1.25


def test_narrower_deviations_contain_too_few(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("INDUCED_DRAG_LOG_SD", "EFFICIENCY_LOG_SD", "AVIONICS_LOG_SD"):
        monkeypatch.setattr(power_prior, name, 0.5 * getattr(power_prior, name))
    assert sum(one.inside for one in predictions(leave_out=True)) < 20


def test_the_shipped_prior_is_the_fit_to_the_table() -> None:
    fitted = fit_prior(read_table())
    for name in ("tail_drag", "wing_drag", "aspect_power", "loss_mass", "avionics"):
        assert getattr(POWER_PRIOR, name) == pytest.approx(getattr(fitted, name), rel=0.02), name


def test_a_large_drive_is_efficient_and_a_slender_wing_has_less_drag() -> None:
    assert POWER_PRIOR.propulsive_efficiency(POWER_PRIOR.loss_mass) == pytest.approx(0.5 * MAX_EFFICIENCY)
    # 8 times the mass has a quarter of the losses per output.
    assert POWER_PRIOR.propulsive_efficiency(8.0 * POWER_PRIOR.loss_mass) == pytest.approx(MAX_EFFICIENCY / 1.25)
    assert POWER_PRIOR.min_drag_coefficient("vtail", 8.0, 3.2e5) == POWER_PRIOR.tail_drag
    # Twice the aspect ratio: 2^-0.42 = 0.747; 32 times the Reynolds number: 32^-0.2 = 0.5.
    assert POWER_PRIOR.min_drag_coefficient("wing", 16.0, 3.2e5) == pytest.approx(
        0.747 * POWER_PRIOR.wing_drag, rel=1e-3
    )
    assert POWER_PRIOR.min_drag_coefficient("wing", 8.0, 32.0 * 3.2e5) == pytest.approx(0.5 * POWER_PRIOR.wing_drag)
