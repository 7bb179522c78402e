import numpy as np
import pytest

from aircraft.identification.alignment import align
from aircraft.identification.estimate import align_clocks
from aircraft.identification.flight_record import GRID_HZ
from tests.aircraft.identification.flown_truth import flown_truth
from tests.instrumented_flights import drawn_sensors


def test_accelerometers_are_found_to_be_as_late_as_they_were_made() -> None:
    sensors = drawn_sensors(3)
    (clock, *_) = flown_truth().estimate.clocks
    assert clock.behind == pytest.approx(sensors.lag + sensors.delay, abs=0.012)
    # The servo's own lag, and what the pulses wait at 25 Hz before they are seen.
    assert 0.04 < clock.servo_lag < 0.09


def test_stretches_stand_behind_each_other_and_are_smoothed_apart() -> None:
    flown = flown_truth()
    record = flown.records[0].part(40.0)
    signals = align([record, record], [flown.estimate.clocks[0]] * 2, 0.1)
    half = round(40.0 * GRID_HZ)
    assert signals.edges == (0, half, 2 * half)
    steps = np.where(np.arange(2 * half) < half, 0.0, 1.0)
    assert signals.smooth(steps, 0.1) == pytest.approx(steps)
    assert len(set(signals.block.tolist())) == 4
    assert len(signals.thinned(10, {}).airspeed) == 2 * half // 10


def test_the_clocks_of_one_log_are_one() -> None:
    flown = flown_truth()
    part = flown.records[0].part(60.0)
    first, second = align_clocks([part, part], flown.base)
    assert first == second
