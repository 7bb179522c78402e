"""Refined moments follow the log, and count the prior of what the log does not show only once."""

from dataclasses import replace

import numpy as np
import pytest

from aircraft.identification.alignment import Signals
from aircraft.identification.estimate import combine_with_prior, make_aligned_signals
from aircraft.identification.parameters import INDEX, NAMES, PARAMETERS, prior_sds
from aircraft.identification.refinement import IS_MOMENT, Refinement, refine_moments, remove_collinear_directions
from aircraft.identification.regression import fit_with_prior
from tests.aircraft.identification.flown_truth import flown_truth

MOMENTS = [name for name in NAMES if IS_MOMENT[INDEX[name]]]


def flown_signals() -> Signals:
    flown = flown_truth()
    return make_aligned_signals(flown.records, flown.estimate.clocks, flown.base)


def refine(signals: Signals, **factors: float) -> Refinement:
    """Refine the moments with some of the base's coefficients changed by factors."""
    flown = flown_truth()
    coefficients = flown.base.coefficients
    changed = {name: factor * getattr(coefficients, name) for name, factor in factors.items()}
    base = replace(flown.base, coefficients=replace(coefficients, **changed))
    return refine_moments(signals, base, flown.estimate.values)


def test_a_base_of_half_the_moments_needs_twice_the_factors() -> None:
    """The moments are the same, so their factors double: 2.3 standard deviations from the prior."""
    signals = flown_signals()
    whole = refine(signals)
    half = refine(signals, roll_roll=0.5, roll_aileron=0.5, yaw_beta=0.5)
    for name in ("roll-damping", "aileron-power", "weathercock"):
        k = MOMENTS.index(name)
        assert half.values[k] / whole.values[k] == pytest.approx(2.0, rel=0.05), name


def test_a_moment_that_the_log_does_not_show_keeps_nine_tenths_of_its_priors_interval() -> None:
    """A rudder without effect has only the prior, in the refinement and in Bayes' rule after it.

    Counted twice, a prior would leave 1 / sqrt(2) of its interval; narrower in the refinement, still less.
    """
    refinement = refine(flown_signals(), yaw_rudder=1e-6)
    covariance = np.diag(np.square(prior_sds()))
    covariance[np.ix_(IS_MOMENT, IS_MOMENT)] = refinement.covariance
    values = flown_truth().estimate.values.copy()
    values[IS_MOMENT] = refinement.values
    combined, spread = combine_with_prior(values, covariance)
    rudder = INDEX["rudder-power"]
    assert combined[rudder] == pytest.approx(1.0, abs=1e-3)
    assert 0.9 < np.sqrt(spread[rudder, rudder]) / PARAMETERS[rudder].sd <= 1.0


def test_a_rudder_that_is_mixed_to_the_ailerons_keeps_its_prior() -> None:
    """The sum of both effects is in the log; what rounding adds to the rudder says nothing of it.

    y = aileron + 1.7 rudder with rudder = 0.15 aileron, logged with an error of 0.005. Of the priors 1 +- 1 of both,
    the nearest pair with this sum is 1 + 0.7 * 0.15 / (1 + 0.15^2) = 1.103 and 1 + 0.103 * 0.15 = 1.015.
    """
    generator = np.random.default_rng(1)
    aileron, noise = generator.normal(size=(2, 2000))
    slopes = np.column_stack([aileron, 0.15 * aileron + 0.005 * noise])
    y = aileron + 1.7 * 0.15 * aileron + 0.01 * generator.normal(size=2000)
    mean, sd, blocks = np.ones(2), np.ones(2), np.arange(2000) // 20
    found = fit_with_prior(remove_collinear_directions(slopes), y, mean, sd, blocks)
    assert found.estimate == pytest.approx([1.103, 1.015], abs=0.01)
    assert np.sqrt(found.covariance[1, 1]) > 0.9
    # With it, the rudder is taken for nothing, and surely so.
    wrong = fit_with_prior(slopes, y, mean, sd, blocks)
    assert abs(wrong.estimate[1] - 1.7) > 5.0 * np.sqrt(wrong.covariance[1, 1])


def test_surfaces_that_move_apart_are_estimated() -> None:
    generator = np.random.default_rng(2)
    slopes = generator.normal(size=(500, 2)) * np.array([1.0, 0.01])
    assert remove_collinear_directions(slopes) == pytest.approx(slopes, abs=1e-12)
