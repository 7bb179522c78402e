"""Panels show their series, limits and legs where the data has them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from logs.views.charts import Chart, Layer, Panel, make_leg_marks, make_saturation_band, series
from logs.views.drawing import draw_chart
from tests.logs.views.figure_data import make_track

ALONG = np.linspace(0.0, 100.0, 5001)


def drawn(*panels: Panel, **more: Any) -> Any:
    return draw_chart(Chart("title", "distance", "km", panels, **more))


def one(title: str, values: np.ndarray, unit: str = "", **more: Any) -> Panel:
    return Panel(title, unit, (series("x", "flown", ALONG, values),), **more)


def test_a_peak_of_one_row_is_still_drawn_and_inside_the_panel() -> None:
    values = np.zeros(ALONG.size)
    values[1234] = 9.0
    (axes,) = drawn(one("bank", values, "°", limits=(("limit", 12.0), ("", -12.0)))).axes
    line = next(line for line in axes.lines if line.get_label() == "x")
    assert len(line.get_xdata()) < 2000
    assert line.get_xdata()[np.argmax(line.get_ydata())] == ALONG[1234]
    assert line.get_ydata().max() == 9.0
    assert axes.get_ylim()[0] < -12.0
    assert axes.get_ylim()[1] > 12.0
    assert axes.get_xlim() == (0.0, 100.0)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("distance (km)", "bank (°)")


def test_a_quiet_series_is_not_blown_up() -> None:
    (axes,) = drawn(one("airspeed", np.full(ALONG.size, 25.0), min_span=4.0)).axes
    low, high = axes.get_ylim()
    assert high - low == pytest.approx(4.0 * 1.16)
    assert (low + high) / 2.0 == pytest.approx(25.0)


def test_rows_at_a_limit_are_shaded() -> None:
    panel = one("throttle", ALONG)
    band = make_saturation_band((ALONG > 20.0) & (ALONG < 40.0), ALONG, panel.shown_span())
    shaded, plain = drawn(replace(panel, layers=(band, *panel.layers)), panel).axes
    (area,) = shaded.collections
    corners = area.get_paths()[0].vertices
    assert corners[:, 0].min() == pytest.approx(20.0, abs=0.05)
    assert corners[:, 0].max() == pytest.approx(40.0, abs=0.05)
    assert len(plain.collections) == 0


def test_legs_are_parted_where_they_change_and_numbered_once() -> None:
    track = make_track()
    panels = [Panel(name, "", (series("x", "flown", track.time, track.airspeed),)) for name in ("upper", "lower")]
    upper, lower = drawn(*panels, marks=make_leg_marks(track.leg, track.time)).axes
    changes = track.time[1:][np.diff(track.leg) > 0]
    for axes in (upper, lower):
        uprights = [line.get_xdata()[0] for line in axes.lines if len(set(line.get_xdata())) == 1]
        assert uprights == changes.tolist()
    assert [text.get_text() for text in upper.texts] == ["leg 0", "1", "2"]
    assert [text.get_text() for text in lower.texts] == []


def legend_texts(holder: Any) -> list[str]:
    return [text.get_text() for text in holder.get_texts()]


def test_what_all_panels_share_is_told_once() -> None:
    def pair(scale: float) -> tuple[Layer, ...]:
        return series("first", "flown", ALONG, scale * ALONG), series("second", "other", ALONG, ALONG)

    figure = drawn(*(Panel(str(k), "", pair(k)) for k in range(1, 7)))
    assert [legend_texts(legend) for legend in figure.legends] == [["first", "second"]]
    assert [axes.get_legend() for axes in figure.axes] == [None] * 6
    # The legend stands above the topmost panel and inside the picture.
    figure.canvas.draw()
    box = figure.legends[0].get_window_extent()
    assert figure.axes[0].bbox.y1 < box.y0 < box.y1 < figure.bbox.y1


@pytest.mark.parametrize(("name", "role"), [("third", "flown"), ("first", "other")])
def test_a_look_with_two_meanings_and_a_meaning_with_two_looks_are_told_apart(name: str, role: str) -> None:
    first = series("first", "flown", ALONG, ALONG)
    panels = [Panel("a", "", (first,)), Panel("b", "", (first,)), Panel("c", "", (series(name, role, ALONG, ALONG),))]
    figure = drawn(*panels)
    assert figure.legends == []
    assert [legend_texts(axes.get_legend()) for axes in figure.axes] == [["first"], ["first"], [name]]


def test_a_long_name_beside_a_panel_is_inside_the_picture() -> None:
    panels = [
        one("a", ALONG),
        Panel("b", "", (series("corrections may pass the limit of planned turns", "flown", ALONG, ALONG),)),
    ]
    figure = drawn(*panels)
    figure.canvas.draw()
    assert all(axes.get_legend().get_window_extent().x1 <= figure.bbox.x1 for axes in figure.axes)


def test_a_panel_without_values_is_left_out_and_one_without_any_can_be_drawn() -> None:
    unknown = one("unknown", np.full(ALONG.size, np.nan), limits=(("limit", 1.0),))
    assert [axes.get_ylabel() for axes in drawn(unknown, one("known", ALONG)).axes] == ["known"]
    (axes,) = drawn(one("v", np.full(ALONG.size, np.nan))).axes
    assert np.isfinite(axes.get_ylim()).all()
