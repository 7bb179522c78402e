"""A chart's data keep their numbers, as fine as a screen can show; thinned series their extremes; steps are round."""

import json
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from logs.views.charts import (
    Chart,
    Layer,
    Panel,
    chart_json,
    find_outline_rows,
    json_numbers,
    nice_step,
    screen_decimals,
)


def test_numbers_are_rounded_and_what_is_none_is_null() -> None:
    assert json_numbers([1.26, -0.04, math.nan, math.inf], 1) == [1.3, 0.0, None, None]
    assert math.copysign(1.0, json_numbers([-0.04], 1)[0] or 0.0) == 1.0


def test_digits_show_a_ten_thousandth_of_the_range() -> None:
    for span in (0.003, 1.0, 85.0, 25_000.0):
        step = 10.0 ** -screen_decimals(np.array([5.0, 5.0 + span]))
        assert span / 1e5 <= step <= max(span / 1e3, 1.0)
    assert screen_decimals(np.array([np.nan])) == 4
    assert screen_decimals(np.array([200.0, 200.0])) == 2


def test_layers_without_values_and_limits_that_are_none_are_left_out() -> None:
    x = np.array([0.0, 1.0])
    shown = Layer("band", "ground", "terrain", x, np.array([2.0, np.nan]), np.zeros(2), dashed=True, legend="all")
    hidden = Layer("line", "lost", "flown", x, np.full(2, np.nan))
    panel = Panel("height", "m", (shown, hidden), (("floor", math.nan), ("ceiling", 9.0)), span=(0.0, 3.0))
    made = chart_json(Chart("", "way", "km", (panel,), marks=((0.12345, "leg 0"),)))
    (found,) = made["panels"]
    assert found["limits"] == [["ceiling", 9.0]]
    (layer,) = found["layers"]
    assert (layer["y"], layer["low"]) == ([2.0, None], [0.0, 0.0])
    assert (layer["dashed"], layer["legend"], "quiet" in layer) == (True, "all", False)
    assert made["marks"] == [[0.123, "leg 0"]]
    json.dumps(made, allow_nan=False)


@given(st.lists(st.floats(-1e6, 1e6) | st.just(float("nan")), min_size=1, max_size=400), st.integers(1, 40))
def test_thinning_keeps_the_extremes(values: list[float], count: int) -> None:
    series = np.array(values)
    rows = find_outline_rows(series, count)
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
