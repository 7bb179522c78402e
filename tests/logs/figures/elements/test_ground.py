"""The ground under a map: lit from the north-west, with contours at round heights, or a note instead."""

from typing import Any

import numpy as np
import pytest

from logs.figures.elements import style
from logs.figures.elements.ground import draw_ground
from tests.logs.figures.figure_data import make_scenario


def drawn(**changes: Any) -> tuple[Any, Any, list[Any]]:
    figure = style.new_figure(6.0)
    axes = figure.add_axes((0.1, 0.1, 0.7, 0.8))
    axes.set(xlim=(-1200.0, 1200.0), ylim=(-800.0, 800.0))
    return figure, axes, draw_ground(figure, axes, make_scenario(threats=[], **changes).terrain, 8.7, 0.5)


@pytest.mark.parametrize(
    ("terrain", "note"),
    [({"kind": "none"}, "no terrain\nwas given"), ({"kind": "flat", "amsl_m": 100}, "level ground,\n100 m AMSL")],
)
def test_ground_without_shape_has_a_note(terrain: dict[str, Any], note: str) -> None:
    figure, axes, handles = drawn(terrain=terrain)
    assert [text.get_text() for text in figure.texts] == [note]
    assert handles == []
    assert not axes.collections


def test_a_hill_is_brighter_where_it_faces_north_west() -> None:
    _, axes, _ = drawn()
    picture = np.asarray(axes.images[0].get_array())[..., :3].sum(axis=-1)
    rows, columns = picture.shape
    # figure_data's hill stands in the middle: what is 300 m up and 300 m aside of it is of one height.
    up, aside = round(300.0 / 1600.0 * rows), round(300.0 / 2400.0 * columns)
    north_west = picture[rows // 2 + up, columns // 2 - aside]
    south_east = picture[rows // 2 - up, columns // 2 + aside]
    assert north_west > 1.1 * south_east


def test_contours_stand_at_round_heights_within_the_hill() -> None:
    figure, axes, handles = drawn()
    (handle,) = handles
    (contours,) = [item for item in axes.collections if hasattr(item, "levels")]
    step = float(np.diff(contours.levels)[0])
    assert handle.get_label() == f"contours every {step:g} m AMSL"
    assert step in (10.0, 20.0, 25.0, 50.0)
    np.testing.assert_allclose(contours.levels % step, 0.0, atol=1e-9)
    assert contours.levels[0] >= 0.0
    assert contours.levels[-1] < 250.0
    # A contour of the hill 250 exp(-r^2 / (2 400^2)) is a circle of this radius.
    level = float(contours.levels[len(contours.levels) // 2])
    radius = 400.0 * np.sqrt(2.0 * np.log(250.0 / level))
    points = contours.get_paths()[len(contours.levels) // 2].vertices
    np.testing.assert_allclose(np.hypot(*points.T), radius, rtol=0.03)
    assert any("ground height" in other.get_ylabel() for other in figure.axes)
