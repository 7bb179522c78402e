import math

import numpy as np
import pytest

from aircraft.identification.alignment import align, invert_first_order_lag
from aircraft.identification.estimate import _log_unexplained, estimate_clocks
from aircraft.identification.flight_record import GRID_HZ, apply_lag
from aircraft.identification.regression import Fit
from tests.aircraft.identification.flown_truth import flown_truth
from tests.instrumented_flights import drawn_sensors


def test_accelerometers_are_found_to_be_as_late_as_they_were_made() -> None:
    sensors = drawn_sensors(3)
    (clock, *_) = flown_truth().estimate.clocks
    assert clock.total_lag == pytest.approx(sensors.lag + sensors.delay, abs=0.012)
    # The servo's own lag, and what the pulses wait at 25 Hz before they are seen.
    assert 0.04 < clock.servo_lag < 0.09


def test_stretches_stand_behind_each_other_and_are_smoothed_apart() -> None:
    flown = flown_truth()
    record = flown.records[0].central_part(40.0)
    signals = align([record, record], [flown.estimate.clocks[0]] * 2, 0.1)
    half = round(40.0 * GRID_HZ)
    assert signals.edges == (0, half, 2 * half)
    steps = np.where(np.arange(2 * half) < half, 0.0, 1.0)
    assert signals.smooth(steps, 0.1) == pytest.approx(steps)
    # 500 m of flight through the air are a block.
    way = float(record.airspeed.mean()) * 40.0
    assert len(set(signals.block.tolist())) == 2 * math.ceil(way / 500.0)
    assert len(signals.thin(10, {}).airspeed) == 2 * half // 10


def test_the_clocks_of_one_log_are_one() -> None:
    flown = flown_truth()
    part = flown.records[0].central_part(60.0)
    first, second = estimate_clocks([part, part], flown.base)
    assert first == second


def test_what_a_lag_took_is_put_back() -> None:
    """A swing of 1 Hz behind 0.05 s is smaller by the root of 1 + (2 pi 0.05)^2, and led it is itself again."""
    time = np.arange(0.0, 20.0, 1.0 / GRID_HZ)
    swing = np.sin(2.0 * np.pi * time)
    late = apply_lag(swing, 0.05)
    middle = slice(200, -200)
    assert np.abs(late[middle]).max() == pytest.approx(1.0 / np.hypot(1.0, 2.0 * np.pi * 0.05), rel=0.01)
    assert invert_first_order_lag(late, 0.05, GRID_HZ)[middle] == pytest.approx(swing[middle], abs=0.02)


def test_what_a_lag_smooths_away_still_counts_as_unexplained() -> None:
    """Of a motion of 0.5 Hz a tenth is left at 3 Hz: behind 0.05 s the one is 0.99 as large, the other 0.73."""
    time = np.arange(0.0, 40.0, 1.0 / 25.0)

    def late(hertz: float) -> np.ndarray:
        turn = 2.0 * np.pi * hertz
        return np.asarray(np.sin(turn * time - np.arctan(0.05 * turn)) / np.hypot(1.0, 0.05 * turn))

    predicted, residual = late(0.5), 0.1 * late(3.0)
    fit = Fit(np.zeros(1), np.eye(1), predicted, residual, 0.0)
    assert _log_unexplained(fit, 0.05) == pytest.approx(np.log(0.01 / 1.01), abs=0.15)
    assert np.log(residual.var() / (predicted + residual).var()) < np.log(0.01 / 1.01) - 0.5


def test_the_lag_is_not_taken_for_a_smoother() -> None:
    """Where the motion is as fast as the noise, the longest lag would explain most of what is left."""
    sensors = drawn_sensors(3)
    (clock, *_) = flown_truth().estimate.clocks
    assert clock.lag == pytest.approx(sensors.lag, abs=0.02)
