"""Turn by turn: each finding's numbers stand at its place's number, and what fails is ringed."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from logs import theme
from logs.verdict.findings import Finding
from logs.verdict.places import FLIGHT, Place
from logs.verdict.verdict import Verdict
from logs.views.drawing import draw_chart
from logs.views.turns import list_place_values, turn_chart


def slope(leg: int, planned: float, flown: float | None, ok: bool | None) -> Finding:
    return Finding("slope", Place("leg", leg), planned, flown, 8.0, "aircraft", 0.1, None, "deg", "fit", ok, "")


FINDINGS = (
    slope(2, 7.0, None, None),
    slope(0, 4.0, 4.5, True),
    Finding("slope", FLIGHT, 1.0, 1.0, 8.0, "aircraft", 0.1, None, "deg", "fit", True, ""),
    Finding("turn", Place("waypoint", 1, 5), 40.0, 41.0, 45.0, "scenario", 0.1, 4.0, "deg", "fit", True, ""),
    slope(1, 6.0, 9.0, False),
)


def test_values_are_in_the_order_of_their_places_and_the_flights_own_are_left_out() -> None:
    values = list_place_values(FINDINGS, "slope")
    assert [value.number for value in values] == [0, 1, 2]
    assert [value.planned for value in values] == [4.0, 6.0, 7.0]
    assert [value.flown for value in values[:2]] == [4.5, 9.0]
    assert math.isnan(values[2].flown)
    assert [value.ok for value in values] == [True, False, None]
    assert [value.number for value in list_place_values(FINDINGS, "turn")] == [1]
    assert list_place_values(FINDINGS, "threat") == []


def test_places_have_the_numbers_of_the_texts() -> None:
    """Leg 7 of a route with a loiter is what the texts call leg 2."""
    place = Place("leg", 7, to_item=5, number=2)
    (value,) = list_place_values([replace(slope(7, 4.0, 4.5, True), place=place)], "slope")
    assert value.number == 2


def test_numbers_of_many_places_do_not_touch() -> None:
    """Of 120 legs each third fails: the labels keep a gap of half a digit, in the picture as in print."""
    findings = tuple(slope(k, 9.0 if k % 3 else 4.0, None, bool(k % 3 == 0)) for k in range(120))
    figure = draw_chart(turn_chart("a flight", Verdict(findings, False, True, ("not flyable",), "plan")))
    figure.canvas.draw()
    boxes = [label.get_window_extent() for label in figure.axes[0].get_xticklabels() if label.get_text()]
    assert len(boxes) > 15
    assert all(second.x0 - first.x1 > 1.0 for first, second in pairwise(boxes))


def test_bars_dots_and_dashes_stand_at_the_findings_numbers() -> None:
    figure = draw_chart(turn_chart("a flight", Verdict(FINDINGS, False, True, ("not flyable",), "flown")))
    turn, slopes = figure.axes
    assert (turn.get_xlabel(), slopes.get_xlabel()) == ("waypoint", "leg")
    heights = {round(bar.get_x() + bar.get_width() / 2.0): bar.get_height() for bar in slopes.patches}
    assert heights == {0: 4.0, 1: 6.0, 2: 7.0}
    dots = next(line for line in slopes.lines if line.get_color() == theme.colour("flown"))
    np.testing.assert_array_equal(dots.get_xydata(), [[0.0, 4.5], [1.0, 9.0], [2.0, np.nan]])
    (dashes,) = [item.get_segments() for item in slopes.collections if hasattr(item, "get_segments")]
    # The limit of 8.0 and its tolerance of 0.1, as the verdict compares; without a margin the failure has none.
    assert [segment[0][1] for segment in dashes] == [8.1, 8.0, 8.1]
    ring = next(line for line in slopes.lines if line.get_markeredgecolor() == theme.colour("fail"))
    np.testing.assert_array_equal(ring.get_xydata(), [[1.0, 9.0]])
    red = [label.get_text() for label in slopes.get_xticklabels() if label.get_color() == theme.colour("fail")]
    assert red == ["1"]
    assert "fails" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_highest_bar_dot_and_ring_are_whole() -> None:
    """A clearance 30 times the least, a turn that fails at ten times its limit, and a slope beyond its own."""
    found = [
        Finding("clearance", Place("leg", k), high, high, 60.0, "scenario", 0.1, 1.0, "m", "fit", True, "")
        for k, high in enumerate((70.0, 1800.0))
    ]
    found += [
        Finding("turn", Place("waypoint", 1), 134.0, 134.0, 15.0, "aircraft", 0.1, -1.0, "deg", "fit", False, ""),
        Finding("slope", Place("leg", 0), -20.0, -21.0, -8.0, "aircraft", 0.1, -1.0, "deg", "fit", False, ""),
    ]
    figure = draw_chart(turn_chart("a flight", Verdict(tuple(found), False, True, ("not flyable",), "flown")))
    figure.canvas.draw()
    turn, slopes, clearance = figure.axes
    for axes, value in ((turn, 134.0), (slopes, -21.0)):
        _, at = axes.transData.transform((0.0, value))
        # The ring's radius: half its size and its edge, in points of 150/72 pixels.
        radius = (0.5 * 12.0 + 1.1) * 150.0 / 72.0
        assert axes.bbox.y0 <= at - radius
        assert at + radius <= axes.bbox.y1
    assert clearance.get_ylim()[1] > 1800.0
    assert clearance.get_ylim()[0] == 0.0


def test_limits_far_above_all_turns_are_named_instead() -> None:
    far = Finding("turn", Place("waypoint", 1), 10.0, 10.0, 152.0, "aircraft", 0.1, 1.0, "deg", "fit", True, "")
    near = Finding("turn", Place("waypoint", 2), 10.0, 12.0, 45.0, "aircraft", 0.1, 1.0, "deg", "fit", True, "")
    (axes,) = draw_chart(turn_chart("a flight", Verdict((far, near), True, True, ("flyable",), "flown"))).axes
    assert 45.0 < axes.get_ylim()[1] < 60.0
    assert [text.get_text() for text in axes.texts] == ["other limits from 152°"]


def test_nothing_is_ringed_where_nothing_fails() -> None:
    figure = draw_chart(turn_chart("a flight", Verdict(FINDINGS[:4], True, True, ("flyable",), "flown")))
    assert "fails" not in [text.get_text() for text in figure.legends[0].get_texts()]
    for axes in figure.axes:
        assert all(
            not len(line.get_xdata()) for line in axes.lines if line.get_markeredgecolor() == theme.colour("fail")
        )
    assert draw_chart(turn_chart("nothing", Verdict((), True, True, ("flyable",), "flown"))).axes == []


def test_panel_titles_are_inside_the_picture() -> None:
    """The longest one, "lowest height above ground (m)", was cut off at the left edge."""
    clearance = Finding("clearance", Place("leg", 0), 70.0, 70.0, 60.0, "scenario", 0.1, 1.0, "m", "fit", True, "")
    figure = draw_chart(turn_chart("a flight", Verdict((clearance,), True, True, ("flyable",), "flown")))
    figure.canvas.draw()
    (axes,) = figure.axes
    extent = axes.yaxis.label.get_window_extent()
    assert "above ground" in axes.get_ylabel()
    assert extent.x0 > 0.0
    assert extent.x1 < axes.get_window_extent().x0
