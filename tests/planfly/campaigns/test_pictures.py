"""Failures: the most frequent first."""

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.text import Text

from logs.views.drawing import png_bytes
from planfly.campaigns.pictures import (
    MAX_BARS,
    Bar,
    ChartDirection,
    covariance_ellipse,
    draw_clearance_fan,
    draw_crossings,
    draw_failures,
    draw_go_no_go,
    draw_probability,
    draw_tornado,
    group_by_speed,
    narrow_figure,
)
from planfly.campaigns.statistics.decision import wilson


def test_bars_are_as_long_as_flights_failed() -> None:
    figure = draw_failures([("slopes", "leg 2", 3), ("clearance", "leg 8", 9)], 100)
    assert [patch.get_width() for patch in figure.axes[0].patches] == [9, 3]
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert labels == ["clearance, leg 8", "slopes, leg 2"]


def test_none_is_said_and_many_are_cut() -> None:
    assert "No flight of 7" in draw_failures([], 7).axes[0].texts[0].get_text()
    many = [("turns", f"waypoint {k}", k + 1) for k in range(40)]
    assert len(draw_failures(many, 100).axes[0].patches) == MAX_BARS


# ----------------------------------------------------------------------
# P against wind speed and the tornado: every mark where the data puts it.


def test_flights_are_put_together_by_metres_a_second() -> None:
    bins = group_by_speed(np.array([0.0, 0.99, 1.0, 5.5, 5.6]), np.array([True, False, True, False, False]))
    assert [(one.low, one.high, one.flights, one.flyable) for one in bins] == [(0, 1, 2, 1), (1, 2, 1, 1), (5, 6, 2, 0)]
    assert bins[0].interval == wilson(1, 2)
    assert group_by_speed(np.zeros(0), np.zeros(0, dtype=bool)) == []


def test_lines_lie_at_the_shares() -> None:
    bins = group_by_speed(np.array([0.2, 0.7, 2.5]), np.array([True, False, True]))
    figure = draw_probability(bins, 0.9)
    heights = {float(line.get_ydata()[0]) for line in figure.axes[0].lines}
    assert heights == {0.5, 1.0, 0.9}
    assert png_bytes(figure) == png_bytes(draw_probability(bins, 0.9))


def test_bars_point_the_way_the_margin_goes() -> None:
    figure = draw_tornado([Bar("mass", 0.6, -0.7), Bar("drag", 0.2, 0.1)], "clearance")
    widths = [patch.get_width() for patch in figure.axes[0].patches]
    assert widths == [pytest.approx(-0.6), pytest.approx(0.2)]
    assert "clearance" in figure.axes[0].get_title(loc="left")


# ----------------------------------------------------------------------
# The fan and the crossings.


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


# ----------------------------------------------------------------------
# The go/no-go chart.

SPOKES = [ChartDirection(90.0 * k, 8.0 + k, 7.5 + k, 8.5 + k, False, ((6.0, 3, 3), (9.0, 3, 1))) for k in range(4)]


def test_the_boundary_passes_through_each_direction() -> None:
    figure = draw_go_no_go(SPOKES, 20.0, 0.99, 0.95, "demo", (5.0, 250.0))
    line = next(line for line in figure.axes[0].lines if len(line.get_xdata()) > 100)
    angle, speed = np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)
    for one in SPOKES:
        assert abs(np.interp(np.radians(one.from_deg), angle, speed) - one.boundary) < 0.02
    # A mark for each wind flown in, and the star.
    assert len(figure.axes[0].lines) == 1 + 8 + 1
    assert png_bytes(figure) == png_bytes(draw_go_no_go(SPOKES, 20.0, 0.99, 0.95, "demo", (5.0, 250.0)))


def test_the_edge_of_the_search_is_no_limit() -> None:
    """Where nothing failed the boundary is the largest wind that was looked at: no line is drawn there, but a mark."""
    open_ones = [replace(SPOKES[k], boundary=20.0, low=19.0, high=20.0, is_beyond_search=True) for k in (1, 2)]
    figure = draw_go_no_go([SPOKES[0], *open_ones, SPOKES[3]], 20.0, 0.99, 0.95, "demo", None)
    [axes] = figure.axes
    [outline] = [line for line in axes.lines if len(line.get_xdata()) > 100]
    angle, speed = (np.asarray(data, float) for data in (outline.get_xdata(), outline.get_ydata()))
    beside = (angle > np.radians(91.0)) & (angle < np.radians(179.0))
    assert np.isnan(speed[beside]).all()
    assert np.nanmax(speed) < 20.0
    assert np.isfinite(speed[angle < np.radians(80.0)]).all()
    edge = [line for line in axes.lines if len(line.get_xdata()) == 1 and line.get_ydata()[0] == 20.0]
    assert [round(float(np.degrees(line.get_xdata()[0]))) for line in edge] == [90, 180]
    said = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "no limit found up to\n20 m/s" in said
    without = draw_go_no_go(SPOKES, 20.0, 0.99, 0.95, "demo", None)
    assert not any("no limit" in text.get_text() for text in without.legends[0].get_texts())


def test_nothing_is_known_next_to_a_direction_that_is_not_judged() -> None:
    """Of north, east, south and west the south is not judged: areas and line end at east and west."""
    spokes = [replace(one, is_judged=one.from_deg != 180.0) for one in SPOKES]
    axes = draw_go_no_go(spokes, 20.0, 0.99, 0.95, "demo", None).axes[0]
    [outline] = [line for line in axes.lines if len(line.get_xdata()) > 100]
    angle, speed = (np.asarray(data, float) for data in (outline.get_xdata(), outline.get_ydata()))
    between = (angle > np.radians(91.0)) & (angle < np.radians(269.0))
    assert np.isnan(speed[between]).all()
    assert np.isfinite(speed[(angle < np.radians(90.0)) | (angle > np.radians(270.0))]).all()
    go = axes.collections[0].get_paths()
    corners = np.concatenate([path.vertices for path in go])
    assert not ((corners[:, 0] > np.radians(91.0)) & (corners[:, 0] < np.radians(269.0)) & (corners[:, 1] > 0.1)).any()


def test_without_a_judged_direction_nothing_is_a_go() -> None:
    spokes = [replace(one, is_judged=False, is_beyond_search=True) for one in SPOKES]
    figure = draw_go_no_go(spokes, 20.0, 0.99, 0.95, "demo", None)
    assert not any(path.vertices.size for area in figure.axes[0].collections[:3] for path in area.get_paths())
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == ["not judged, 6 flights\nfrom each direction", "flown, all flyable", "flown, some not flyable"]


def test_the_legend_of_the_fan_leaves_its_title_free() -> None:
    rows = np.linspace(60.0, 90.0, 40 * 50).reshape(40, 50)
    figure = draw_clearance_fan(rows, np.arange(40) > 30, np.full(50, 100.0), 4000.0, 60.0)
    figure.canvas.draw()
    [axes] = [one for one in figure.axes if one.get_legend() is not None]
    title = next(one for one in axes.get_children() if isinstance(one, Text) and one.get_text().startswith("Clearance"))
    assert not title.get_window_extent().overlaps(axes.get_legend().get_window_extent())
    assert title.get_window_extent().y1 < figure.bbox.y1


# ----------------------------------------------------------------------
# On a phone.

RANDOM = np.random.default_rng(1)
FAILED = RANDOM.uniform(size=40) > 0.8
PICTURES = {
    "failures": lambda: draw_failures([("photo lines", f"waypoint {k} (item {k + 2})", 1200) for k in range(14)], 1200),
    "none failed": lambda: draw_failures([], 7),
    "probability": lambda: draw_probability(
        group_by_speed(RANDOM.uniform(0.0, 9.0, 80), RANDOM.uniform(size=80) > 0.5), 0.9
    ),
    "tornado": lambda: draw_tornado([Bar("terrain height", 0.6, -0.7), Bar("drag", 0.2, 0.1)], "loss of control"),
    "fan": lambda: draw_clearance_fan(RANDOM.uniform(60.0, 90.0, (40, 50)), FAILED, np.full(50, 100.0), 4000.0, 60.0),
    "crossings": lambda: draw_crossings(RANDOM.normal(0.0, 3.0, (40, 8, 2)), FAILED),
    "one crossing": lambda: draw_crossings(RANDOM.normal(0.0, 3.0, (40, 2, 2)), FAILED),
    "winds": lambda: draw_go_no_go(
        [replace(SPOKES[0], is_beyond_search=True), *SPOKES[1:]], 20.0, 0.99, 0.95, "demo", (5.0, 9.0)
    ),
}


@pytest.mark.parametrize("name", PICTURES)
def test_all_of_a_picture_is_within_a_phones_width(name: str) -> None:
    """Letters of 8 points on 5 inches are 8.4 pixels on 380."""
    figure = narrow_figure(PICTURES[name]())
    width, height = figure.get_size_inches()
    assert width == 5.0
    # In inches.
    reach = figure.get_tightbbox()
    assert 0.0 <= reach.x0 < reach.x1 <= width
    assert 0.0 <= reach.y0 < reach.y1 <= height
    # No legend covers a panel.
    tops = [legend.get_window_extent().y1 for legend in figure.legends]
    panels = [axes.get_tightbbox() for axes in figure.axes if axes.axison]
    assert not tops or max(tops) <= min(box.y0 for box in panels)
    boxes = [axes.get_window_extent() for axes in figure.axes if axes.axison]
    assert not any(one.overlaps(other) for k, one in enumerate(boxes) for other in boxes[:k])
