"""P against wind speed and the tornado: every mark where the data puts it."""

import numpy as np
import pytest

from logs.figures.elements.style import png_bytes
from planfly.campaigns.pictures.probability_pictures import Bar, draw_probability, draw_tornado, speed_bins
from planfly.campaigns.statistics.proportions import wilson


def test_flights_are_put_together_by_metres_a_second() -> None:
    bins = speed_bins(np.array([0.0, 0.99, 1.0, 5.5, 5.6]), np.array([True, False, True, False, False]))
    assert [(one.low, one.high, one.flights, one.flyable) for one in bins] == [(0, 1, 2, 1), (1, 2, 1, 1), (5, 6, 2, 0)]
    assert bins[0].interval == wilson(1, 2)
    assert speed_bins(np.zeros(0), np.zeros(0, dtype=bool)) == []


def test_lines_lie_at_the_shares() -> None:
    bins = speed_bins(np.array([0.2, 0.7, 2.5]), np.array([True, False, True]))
    figure = draw_probability(bins, 0.9)
    heights = {float(line.get_ydata()[0]) for line in figure.axes[0].lines}
    assert heights == {0.5, 1.0, 0.9}
    assert png_bytes(figure) == png_bytes(draw_probability(bins, 0.9))


def test_bars_point_the_way_the_margin_goes() -> None:
    figure = draw_tornado([Bar("mass", 0.6, -0.7), Bar("drag", 0.2, 0.1)], "clearance")
    widths = [patch.get_width() for patch in figure.axes[0].patches]
    assert widths == [pytest.approx(-0.6), pytest.approx(0.2)]
    assert "clearance" in figure.axes[0].get_title(loc="left")
