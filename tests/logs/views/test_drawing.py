"""Thinned series keep their extremes, and axis steps are round."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from logs.views.drawing import nice_step, outline_rows


@given(st.lists(st.floats(-1e6, 1e6) | st.just(float("nan")), min_size=1, max_size=400), st.integers(1, 40))
def test_thinning_keeps_the_extremes(values: list[float], count: int) -> None:
    series = np.array(values)
    rows = outline_rows(series, count)
    assert (np.diff(rows) > 0).all()
    assert len(rows) <= max(2 * count + 2, 1)
    assert rows[0] == 0
    assert rows[-1] == len(series) - 1
    if np.isfinite(series).any():
        assert np.nanmax(series[rows]) == np.nanmax(series)
        assert np.nanmin(series[rows]) == np.nanmin(series)


@given(st.floats(1e-3, 1e7), st.integers(2, 30))
def test_steps_are_round_and_fine_enough(span: float, parts: int) -> None:
    step = nice_step(span, parts)
    assert span / step <= parts * (1 + 1e-9)
    assert span / step > parts / 2.6
    lead = step / 10 ** np.floor(np.log10(step) + 1e-9)
    assert min(abs(lead - nice) for nice in (1.0, 2.0, 5.0)) < 1e-6
