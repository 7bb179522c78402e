"""Predictions of a simulated flight: what biases, trims and a wrong sign do to them."""

from dataclasses import replace

import numpy as np
import pytest

from aircraft.identification.alignment import Signals, align
from aircraft.identification.level import gyro_and_lateral_biases, remove_sensor_biases
from aircraft.identification.parameters import INDEX
from aircraft.identification.prediction import QUANTITIES, GustFilter, Predictor, predict_log, whiteness
from tests.aircraft.identification.flown_truth import flown_truth
from tests.aircraft.identification.made_signals import steady

HORIZON = 0.5


def raw_signals() -> Signals:
    """One minute of the flight with its sensors' biases."""
    flown = flown_truth()
    return align([flown.records[0].central_part(60.0)], flown.estimate.clocks[:1], 0.1)


def rms(signals: Signals, values: np.ndarray, model: int = 1) -> np.ndarray:
    predicted = predict_log(signals, {"one": (flown_truth().base, values)})
    return predicted.predictions[model].rms[HORIZON]


def test_an_identified_model_predicts_far_better_than_constant_rates() -> None:
    signals, values = remove_sensor_biases(raw_signals()), flown_truth().estimate.values
    # Roll, pitch and yaw rate: the pitch rate is small, and much of it is light turbulence.
    assert (rms(signals, values) < np.array([0.2, 0.95, 0.4, 0.2, 1.0, 1.0]) * rms(signals, values, model=0))[:4].all()


@pytest.mark.parametrize("name", ["aileron-power", "elevator-power", "weathercock"])
def test_a_changed_sign_predicts_worse_than_constant_rates(name: str) -> None:
    signals, values = remove_sensor_biases(raw_signals()), flown_truth().estimate.values.copy()
    values[INDEX[name]] *= -1.0
    assert (rms(signals, values) / rms(signals, values, model=0))[:3].max() > 1.0


def test_biases_of_gyros_and_accelerometers_are_found_and_leave_the_predictions() -> None:
    raw, values = raw_signals(), flown_truth().estimate.values
    gyro, right = np.array([0.03, -0.02, 0.02]), 0.3
    biased = replace(raw, rates=raw.rates + gyro, acceleration=raw.acceleration + np.array([0.0, right, 0.0]))
    assert (gyro_and_lateral_biases(biased) - gyro_and_lateral_biases(raw))[0] == pytest.approx(
        [*gyro, right], abs=1e-9
    )
    clean, mended = remove_sensor_biases(raw), remove_sensor_biases(biased)
    assert rms(mended, values) == pytest.approx(rms(clean, values), rel=0.02)
    # Without this, half a second of the roll gyro's bias is 0.9 degrees of bank.
    bank = QUANTITIES.index("bank")
    left_in = replace(clean, rates=clean.rates + gyro)
    assert rms(left_in, values)[bank] > 1.5 * rms(clean, values)[bank]


def test_trimmed_surfaces_leave_the_predictions() -> None:
    signals, values = remove_sensor_biases(raw_signals()), flown_truth().estimate.values
    trimmed = replace(signals, surfaces=signals.surfaces + np.radians([1.5, 2.0, 1.0]))
    # The force of the surfaces remains; their moments are trimmed away.
    assert (rms(trimmed, values) < 1.3 * rms(signals, values))[:4].all()


def test_a_steady_roll_moment_is_trimmed_away_in_each_stretch() -> None:
    """Two stretches with ailerons 1 degree to either side, and no motion: each has its own trim offset."""
    flown = flown_truth()
    both = steady(rows=1000, attitude=(0.0, 0.0, 0.0), acceleration=(0.0, 0.0, -9.8))
    both.surfaces[:500, 1] = np.radians(1.0)
    both.surfaces[500:, 1] = np.radians(-1.0)
    stretches = replace(both, edges=(0, 500, 1000))
    trims = Predictor(stretches, flown.base, flown.estimate.values).trims[:, 0]
    assert trims[0] < -1.0
    assert trims[999] - trims[0] == pytest.approx(2.0 * -trims[0], rel=0.1)


def test_a_filter_whitens_the_process_that_it_is_made_for() -> None:
    """A first-order process of 0.1 s, seen without noise: its innovations are what drives it."""
    draw, decay = np.random.default_rng(4).normal(size=6000), float(np.exp(-0.02 / 0.1))
    process = np.zeros(6000)
    for k in range(1, 6000):
        process[k] = decay * process[k - 1] + draw[k]
    signals = steady(rows=6000)
    innovations = process - GustFilter(decay, 1.0).estimate(process, signals)
    assert innovations[1:] == pytest.approx(draw[1:])
    assert whiteness(innovations, 25) > 0.8
    assert whiteness(process, 25) < 0.5
