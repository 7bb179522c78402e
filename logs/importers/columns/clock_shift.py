"""Find the offset between two clocks from two signals that vary together."""

from typing import NamedTuple

import numpy as np

from world.arrays import Floats

# Interval of the samples that are correlated, s.
_GRID_STEP_S = 0.2
# Interval of the coarse search, s.
_COARSE_STEP_S = 0.4
# Interval of the fine search, s.
_FINE_STEP_S = 0.02
# Minimum duration of the common time of both signals, s.
_MIN_OVERLAP_S = 20.0
# Minimum fraction of the shorter signal that the common time must cover.
_MIN_OVERLAP_FRACTION = 0.5


class ClockShift(NamedTuple):
    """The shift between the clocks of two signals.

    shift: time to add to the times of the first signal, s.
    correlation: correlation coefficient of both signals after the shift.
    """

    shift: float
    correlation: float


def find_clock_shift(
    time: Floats, values: Floats, other_time: Floats, other_values: Floats, max_shift: float
) -> ClockShift:
    """Find the time shift at which the first signal correlates best with the second signal.

    Shifts are tried first in coarse steps, then in fine steps around the best shift.  The signals are linearly
    interpolated.  Shift and correlation are 0 if the signals have too little time in common, do not vary, or have no
    positive correlation at any shift.

    time, values: times (s) and values of the first signal, (n,).
    other_time, other_values: times (s) and values of the second signal, (m,).
    max_shift: largest shift in either direction, s.

    >>> time = np.arange(0.0, 100.0, 0.1)
    >>> chirp = np.sin(0.02 * time**2)
    >>> found = find_clock_shift(time, chirp, time + 3.0, chirp, 10.0)
    >>> round(found.shift, 2), round(found.correlation, 3)
    (3.0, 1.0)
    """
    min_overlap = max(_MIN_OVERLAP_S, _MIN_OVERLAP_FRACTION * min(float(np.ptp(time)), float(np.ptp(other_time))))
    grid = np.arange(other_time[0], other_time[-1], _GRID_STEP_S)
    second_values = np.interp(grid, other_time, other_values)
    best = ClockShift(0.0, 0.0)
    for step, reach in ((_COARSE_STEP_S, max_shift), (_FINE_STEP_S, _COARSE_STEP_S)):
        for shift in (best.shift + np.arange(-reach, reach + 0.5 * step, step)).tolist():
            start, end = np.searchsorted(grid, (time[0] + shift, time[-1] + shift)).tolist()
            if (end - start) * _GRID_STEP_S >= min_overlap:
                shifted_values = np.interp(grid[start:end] - shift, time, values)
                correlation = correlate(shifted_values, second_values[start:end])
                best = max(best, ClockShift(shift, correlation), key=lambda clock_shift: clock_shift.correlation)
    return best


def correlate(values: Floats, other_values: Floats) -> float:
    """Return the correlation coefficient of two signals of equal length; 0 if one of them does not vary."""
    values, other_values = values - values.mean(), other_values - other_values.mean()
    norm_product = float(np.sqrt((values @ values) * (other_values @ other_values)))
    return float(values @ other_values) / norm_product if norm_product > 0.0 else 0.0
