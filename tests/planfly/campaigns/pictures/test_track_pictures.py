"""The fan and the crossings."""

import math

import numpy as np
import pytest
from matplotlib.text import Text

from planfly.campaigns.pictures.track_pictures import covariance_ellipse, draw_clearance_fan, draw_crossings


def test_the_fan_shows_the_median_the_failures_and_what_is_required() -> None:
    clearance = np.array([[80.0, 100.0], [90.0, 110.0], [50.0, np.nan]])
    figure = draw_clearance_fan(clearance, np.array([False, False, True]), np.array([10.0, 20.0]), 2000.0, 60.0)
    top = figure.axes[0]
    lines = {str(line.get_label()): np.asarray(line.get_ydata(), dtype=float) for line in top.lines}
    assert lines["median"].tolist() == [80.0, 105.0]
    assert lines["required, 60 m"].tolist() == [60.0, 60.0]
    np.testing.assert_array_equal(lines["not flyable"], clearance[2])
    assert figure.axes[1].get_xlim() == (0.0, 2.0)


def test_the_fans_legend_covers_no_band() -> None:
    figure = draw_clearance_fan(np.full((9, 30), 80.0), np.zeros(9, dtype=bool), np.full(30, 10.0), 2000.0, 60.0)
    figure.canvas.draw()
    top = figure.axes[0]
    box = top.get_legend().get_window_extent()
    assert box.y0 >= top.bbox.y1
    assert box.y1 <= figure.bbox.y1
    # The title stands left of it.
    (title,) = [text for text in top.findobj(Text) if text.get_text().startswith("Clearance along")]
    assert title.get_window_extent().x1 < box.x0


def test_the_ellipse_holds_95_percent_of_normal_points() -> None:
    points = np.random.default_rng(1).multivariate_normal([3.0, -1.0], [[4.0, 1.5], [1.5, 1.0]], 4000)
    ellipse = covariance_ellipse(points)
    off = points - np.array(ellipse.get_center())
    turn = math.radians(ellipse.angle)
    along = off[:, 0] * math.cos(turn) + off[:, 1] * math.sin(turn)
    across = off[:, 1] * math.cos(turn) - off[:, 0] * math.sin(turn)
    inside = (2 * along / ellipse.width) ** 2 + (2 * across / ellipse.height) ** 2 <= 1.0
    assert inside.mean() == pytest.approx(0.95, abs=0.01)


def test_a_panel_a_waypoint() -> None:
    crossings = np.random.default_rng(2).normal(size=(20, 7, 2))
    crossings[3, 5:] = np.nan
    figure = draw_crossings(crossings, np.arange(20) == 4)
    shown = [axes for axes in figure.axes if axes.axison]
    assert [axes.get_title(loc="left") for axes in shown] == [f"waypoint {k}" for k in range(7)]
    dots, crosses = shown[0].lines[2], shown[0].lines[3]
    assert (len(dots.get_xdata()), len(crosses.get_xdata())) == (19, 1)


def test_ellipses_are_whole() -> None:
    """Few points of a wide spread: the ellipse reaches further than they do."""
    crossings = np.random.default_rng(3).normal(size=(8, 1, 2)) * [3.0, 9.0]
    (axes,) = [axes for axes in draw_crossings(crossings, np.zeros(8, dtype=bool)).figure.axes if axes.axison]
    points = crossings[:, 0]
    # Half the height of an ellipse of the covariance C and the quantile q of chi squared: sqrt(q C22); 5.991 for 95 %.
    high = points[:, 1].mean() + np.sqrt(5.991 * np.cov(points.T)[1, 1])
    low = points[:, 1].mean() - np.sqrt(5.991 * np.cov(points.T)[1, 1])
    assert max(high, -low) > 1.1 * np.abs(points).max()
    assert axes.get_ylim()[0] < low < high < axes.get_ylim()[1]
