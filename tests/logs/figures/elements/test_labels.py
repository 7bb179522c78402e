"""Labels keep off each other and off the lines, as far as there is room."""

from typing import Any

import numpy as np
import pytest

from logs.figures.elements import style
from logs.figures.elements.labels import LabelPlacer


@pytest.fixture
def axes() -> Any:
    figure = style.new_figure(6.0)
    axes = figure.add_axes((0.1, 0.1, 0.8, 0.8))
    axes.set(xlim=(0.0, 100.0), ylim=(0.0, 100.0))
    return axes


def boxes(axes: Any) -> list[Any]:
    renderer = axes.figure.canvas.get_renderer()
    return [text.get_window_extent(renderer) for text in axes.texts]


def test_labels_of_one_place_do_not_cover_each_other(axes: Any) -> None:
    placer = LabelPlacer(axes)
    for name in ("first", "second", "third", "fourth"):
        placer.place(name, 50.0, 50.0)
    written = boxes(axes)
    assert len(written) == 4
    assert not any(box.overlaps(other) for k, box in enumerate(written) for other in written[k + 1 :])
    # Each is near its point: within a few of its own heights.
    point = axes.transData.transform((50.0, 50.0))
    for box in written:
        assert np.hypot(*(np.array([box.x0 + box.width / 2, box.y0 + box.height / 2]) - point)) < 8.0 * box.height


def test_framed_labels_of_a_crowd_find_room_further_off_and_point_to_their_places(axes: Any) -> None:
    placer = LabelPlacer(axes)
    frame = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": style.FAIL}
    at = [(48.0 + k % 4, 48.0 + k // 4) for k in range(14)]
    for k, (x, y) in enumerate(at):
        placer.place(f"waypoint {k} (item {k + 2}): turn, waypoint", x, y, gap=16.0, bbox=frame)
    axes.figure.canvas.draw()
    written = [text.get_bbox_patch().get_window_extent() for text in axes.texts]
    assert len(written) == 14
    assert not any(box.overlaps(other) for k, box in enumerate(written) for other in written[k + 1 :])
    leaders = [line.get_xydata()[-1] for line in axes.lines if line.get_gid() == "leader"]
    np.testing.assert_allclose(leaders, at)


def test_a_label_that_moved_away_points_to_its_place(axes: Any) -> None:
    placer = LabelPlacer(axes)
    placer.place("near", 20.0, 20.0)
    assert not axes.lines
    point = axes.transData.transform((50.0, 50.0))
    placer.boxes.append((point[0] - 60.0, point[1] - 20.0, point[0] + 60.0, point[1] + 20.0))
    placer.place("12", 50.0, 50.0)
    (leader,) = axes.lines
    np.testing.assert_allclose(leader.get_xydata()[-1], (50.0, 50.0))


def test_a_label_keeps_off_a_line_that_it_is_told_of(axes: Any) -> None:
    # The line runs up and right, where a label would stand first.
    along = np.linspace(50.0, 90.0, 50)
    LabelPlacer(axes).place("free", 50.0, 50.0)
    wary = LabelPlacer(axes)
    wary.avoid(along, along)
    wary.place("wary", 50.0, 50.0)
    pixels = axes.transData.transform(np.column_stack([along, along]))
    free, kept_off = (sum(box.contains(x, y) for x, y in pixels) for box in boxes(axes))
    assert free > 0
    assert kept_off == 0


def test_an_optional_label_gives_way_and_one_without_a_place_is_left_out(axes: Any) -> None:
    placer = LabelPlacer(axes)
    placer.place("nowhere", np.nan, 50.0)
    assert not axes.texts
    placer.boxes.append((-1e6, -1e6, 1e6, 1e6))
    placer.place("optional", 50.0, 50.0, optional=True)
    assert not axes.texts
    placer.place("needed", 50.0, 50.0)
    assert [text.get_text() for text in axes.texts] == ["needed"]


def test_labels_near_an_edge_stay_inside(axes: Any) -> None:
    placer = LabelPlacer(axes)
    for x, y in ((99.9, 99.9), (0.1, 0.1), (99.9, 0.1)):
        placer.place("corner", x, y)
    frame = axes.get_window_extent()
    assert all(frame.x0 <= box.x0 and box.x1 <= frame.x1 for box in boxes(axes))
    assert all(frame.y0 <= box.y0 and box.y1 <= frame.y1 for box in boxes(axes))
