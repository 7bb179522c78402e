"""A chart's data keep their numbers, as fine as a screen can show, and nothing that JSON cannot hold."""

import json
import math

import numpy as np

from logs.report.charts.chart import Chart, ChartPanel, Layer, chart_json, numbers, telling_digits


def test_numbers_are_rounded_and_what_is_none_is_null() -> None:
    assert numbers([1.26, -0.04, math.nan, math.inf], 1) == [1.3, 0.0, None, None]
    assert math.copysign(1.0, numbers([-0.04], 1)[0] or 0.0) == 1.0


def test_digits_show_a_ten_thousandth_of_the_range() -> None:
    for span in (0.003, 1.0, 85.0, 25_000.0):
        step = 10.0 ** -telling_digits(np.array([5.0, 5.0 + span]))
        assert span / 1e5 <= step <= max(span / 1e3, 1.0)
    assert telling_digits(np.array([np.nan])) == 4
    assert telling_digits(np.array([200.0, 200.0])) == 2


def test_layers_without_values_and_limits_that_are_none_are_left_out() -> None:
    x = np.array([0.0, 1.0])
    shown = Layer("band", "ground", "terrain", x, np.array([2.0, np.nan]), np.zeros(2), dashed=True, legend="all")
    hidden = Layer("line", "lost", "flown", x, np.full(2, np.nan))
    panel = ChartPanel("height", "m", (shown, hidden), (("floor", math.nan), ("ceiling", 9.0)), span=(0.0, 3.0))
    made = chart_json(Chart("way", "km", (panel,), marks=((0.12345, "leg 0"),)))
    (found,) = made["panels"]
    assert found["limits"] == [["ceiling", 9.0]]
    (layer,) = found["layers"]
    assert (layer["y"], layer["low"]) == ([2.0, None], [0.0, 0.0])
    assert (layer["dashed"], layer["legend"], "quiet" in layer) == (True, "all", False)
    assert made["marks"] == [[0.123, "leg 0"]]
    json.dumps(made, allow_nan=False)
