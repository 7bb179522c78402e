"""Panels show their series, limits and legs where the data has them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from logs.views import drawing
from logs.views.time_series import Axis, Panel, Series, doubles, draw_panels, time_axis
from tests.logs.views.figure_data import make_track

ALONG = np.linspace(0.0, 100.0, 5001)


def test_a_peak_of_one_row_is_still_drawn_and_inside_the_panel() -> None:
    values = np.zeros(ALONG.size)
    values[1234] = 9.0
    panel = Panel("bank (°)", [Series("flown", values)], limits=[("limit", 12.0), ("", -12.0)])
    (axes,) = draw_panels("title", [panel], Axis("distance (km)", ALONG), None).axes
    line = next(line for line in axes.lines if line.get_label() == "flown")
    assert len(line.get_xdata()) < 2000
    assert line.get_xdata()[np.argmax(line.get_ydata())] == ALONG[1234]
    assert line.get_ydata().max() == 9.0
    assert axes.get_ylim()[0] < -12.0
    assert axes.get_ylim()[1] > 12.0
    assert axes.get_xlim() == (0.0, 100.0)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("distance (km)", "bank (°)")


def test_a_quiet_series_is_not_blown_up() -> None:
    panel = Panel("airspeed (m/s)", [Series("flown", np.full(ALONG.size, 25.0))], least_span=4.0)
    (axes,) = draw_panels("title", [panel], Axis("", ALONG), None).axes
    low, high = axes.get_ylim()
    assert high - low == pytest.approx(4.0 * 1.16)
    assert (low + high) / 2.0 == pytest.approx(25.0)


def test_rows_at_a_limit_are_shaded() -> None:
    held = (ALONG > 20.0) & (ALONG < 40.0)
    panels = [Panel("throttle (%)", [Series("commanded", ALONG)], held=mask) for mask in (held, held & False, None)]
    shaded, *plain = draw_panels("title", panels, Axis("", ALONG), None).axes
    (band,) = shaded.collections
    corners = band.get_paths()[0].vertices
    assert corners[:, 0].min() == pytest.approx(20.0, abs=0.05)
    assert corners[:, 0].max() == pytest.approx(40.0, abs=0.05)
    assert [len(axes.collections) for axes in plain] == [0, 0]


def test_legs_are_parted_where_they_change_and_numbered_once() -> None:
    track = make_track()
    panels = [Panel(name, [Series("x", doubles(track.airspeed))]) for name in ("upper", "lower")]
    upper, lower = draw_panels("title", panels, time_axis(track), track).axes
    changes = track.time[1:][np.diff(track.leg) > 0]
    for axes in (upper, lower):
        uprights = [line.get_xdata()[0] for line in axes.lines if len(set(line.get_xdata())) == 1]
        assert uprights == changes.tolist()
    assert [text.get_text() for text in upper.texts] == ["leg 0", "1", "2"]
    assert [text.get_text() for text in lower.texts] == []
    assert lower.get_xlabel() == "time since the start (s)"


def legend_texts(holder: Any) -> list[str]:
    return [text.get_text() for text in holder.get_texts()]


def test_what_all_panels_share_is_told_once() -> None:
    def pair(scale: float) -> list[Series]:
        return [Series("first", scale * ALONG), Series("second", ALONG, color=drawing.MISSILE)]

    panels = [Panel(str(k), pair(k)) for k in range(1, 7)]
    figure = draw_panels("title", panels, Axis("", ALONG), None)
    assert [legend_texts(legend) for legend in figure.legends] == [["first", "second"]]
    assert [axes.get_legend() for axes in figure.axes] == [None] * 6
    # The legend stands above the topmost panel and inside the picture.
    figure.canvas.draw()
    box = figure.legends[0].get_window_extent()
    assert figure.axes[0].bbox.y1 < box.y0 < box.y1 < figure.bbox.y1


@pytest.mark.parametrize("other", [Series("third", ALONG), Series("first", ALONG, color=drawing.MISSILE)])
def test_a_look_with_two_meanings_and_a_meaning_with_two_looks_are_told_apart(other: Series) -> None:
    panels = [Panel("a", [Series("first", ALONG)]), Panel("b", [Series("first", ALONG)]), Panel("c", [other])]
    figure = draw_panels("title", panels, Axis("", ALONG), None)
    assert figure.legends == []
    assert [legend_texts(axes.get_legend()) for axes in figure.axes] == [["first"], ["first"], [other.label]]


def test_a_panel_without_values_is_left_out() -> None:
    unknown = Panel("unknown", [Series("x", np.full(ALONG.size, np.nan))], limits=[("limit", 1.0)])
    axes = draw_panels("title", [unknown, Panel("known", [Series("x", ALONG)])], Axis("", ALONG), None).axes
    assert [one.get_ylabel() for one in axes] == ["known"]


def test_unknown_values_leave_a_panel_that_can_be_drawn() -> None:
    track = make_track()
    lost = replace(track, airspeed=np.full_like(track.airspeed, np.nan))
    (axes,) = draw_panels("title", [Panel("v", [Series("x", doubles(lost.airspeed))])], time_axis(lost), lost).axes
    assert np.isfinite(axes.get_ylim()).all()
    assert doubles(track.airspeed).dtype == np.float64
