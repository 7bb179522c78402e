import numpy as np
import pytest

from logs.importers.columns.clock_shift import find_clock_shift


@pytest.mark.parametrize("shift", [-40.0, -3.3, 0.0, 17.5])
def test_a_signal_at_half_the_rate_is_shifted_onto_the_other(shift: float) -> None:
    random = np.random.default_rng(1)
    time = np.arange(0.0, 300.0, 0.1)
    signal = np.convolve(random.normal(size=len(time)), np.hanning(60), "same")
    own_time = np.arange(0.0, 300.0, 0.5) - shift
    own = 1.2 + 0.5 * np.interp(own_time + shift, time, signal)
    found = find_clock_shift(own_time, own, time, signal, 60.0)
    assert found.shift == pytest.approx(shift, abs=0.05)
    assert found.correlation > 0.98


def test_signals_that_have_nothing_in_common_do_not_correlate() -> None:
    time = np.arange(0.0, 600.0, 0.5)
    first, second = (np.random.default_rng(k).normal(size=len(time)) for k in (1, 2))
    assert find_clock_shift(time, first, time, second, 60.0).correlation < 0.2


def test_a_signal_that_does_not_move_has_no_correlation() -> None:
    time = np.arange(0.0, 100.0, 0.5)
    assert find_clock_shift(time, np.ones(200), time, np.sin(time), 10.0).correlation == 0.0
