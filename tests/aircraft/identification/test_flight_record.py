import numpy as np
import pytest

from aircraft.identification.flight_record import GRID_HZ, apply_delay, apply_lag, derivative, low_pass


def test_a_lag_answers_a_step_as_its_time_constant_says() -> None:
    time = np.arange(200) / GRID_HZ
    answer = apply_lag((time > 0.5).astype(float), 0.2)
    after = time > 0.55
    assert answer[after] == pytest.approx(1.0 - np.exp(-(time[after] - 0.51) / 0.2), abs=0.01)


def test_a_delay_moves_what_happens_to_later() -> None:
    time = np.arange(500) / GRID_HZ
    wave = np.sin(2.0 * time)
    moved = apply_delay(wave, 0.13)
    assert moved[20:-20] == pytest.approx(np.sin(2.0 * (time - 0.13))[20:-20], abs=1e-3)


def test_smoothing_delays_nothing_and_takes_out_what_is_fast() -> None:
    time = np.arange(2000) / GRID_HZ
    slow, fast = np.sin(2.0 * np.pi * 0.05 * time), np.sin(2.0 * np.pi * 6.0 * time)
    kept = low_pass(slow + fast, 0.5)[300:-300]
    assert kept == pytest.approx(slow[300:-300], abs=0.03)


def test_rates_of_change_are_a_second() -> None:
    assert derivative(np.arange(10.0)) == pytest.approx(np.full(10, GRID_HZ))
