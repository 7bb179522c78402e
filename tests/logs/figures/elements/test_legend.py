"""The legend names only what failed; the compass points where the wind blows."""

import numpy as np
import pytest

from logs.figures.elements import style
from logs.figures.elements.failures import Failures
from logs.figures.elements.legend import draw_compass, draw_legend, failing_handles
from tests.logs.figures.figure_data import make_scenario


def test_failing_marks_are_explained_where_there_are_any() -> None:
    def labels(legs: tuple[int, ...], waypoints: tuple[int, ...]) -> list[str]:
        failed = Failures(dict.fromkeys(legs, ("slope",)), dict.fromkeys(waypoints, ("turn",)))
        return [handle.get_label() for handle in failing_handles(failed)]

    assert labels((), ()) == []
    assert labels((1, 2), ()) == ["leg that fails a rule"]
    assert labels((), (3,)) == ["waypoint that fails a rule"]
    assert labels((1,), (3,)) == ["leg that fails a rule", "waypoint that fails a rule"]


@pytest.mark.parametrize(("from_deg", "to"), [(270.0, (1.0, 0.0)), (0.0, (0.0, -1.0)), (45.0, (-1.0, -1.0))])
def test_the_arrow_points_to_where_the_wind_blows(from_deg: float, to: tuple[float, float]) -> None:
    figure = style.new_figure(6.0)
    draw_compass(figure, make_scenario(wind={"speed_mps": 5, "from_deg": from_deg, "turbulence": "light"}), 8.7)
    (arrow,) = [text for text in figure.axes[0].texts if hasattr(text, "arrow_patch")]
    head, tail = np.array(arrow.xy), np.array(arrow.xyann)
    assert (head - tail) / np.linalg.norm(head - tail) == pytest.approx(np.array(to) / np.hypot(*to), abs=1e-9)
    (note,) = [text.get_text() for text in figure.texts]
    assert note == f"wind 5.0 m/s\nfrom {from_deg:03.0f}°\nlight turbulence"


def test_calm_air_has_no_arrow() -> None:
    figure = style.new_figure(6.0)
    draw_compass(figure, make_scenario(wind={"speed_mps": 0}), 8.7)
    assert not any(hasattr(text, "arrow_patch") for text in figure.axes[0].texts)
    assert [text.get_text() for text in figure.texts] == ["no mean wind"]


def test_the_legend_stands_where_it_is_put() -> None:
    figure = style.new_figure(6.0)
    failed = Failures({1: ("slope",)}, {})
    draw_legend(figure, failing_handles(failed), 0.8, 0.3)
    figure.canvas.draw()
    box = figure.legends[0].get_window_extent()
    assert box.y1 == pytest.approx(0.3 * figure.bbox.height, abs=1.0)
    # 0.01 of the width further left, for its own frame.
    assert box.x0 == pytest.approx((0.8 / style.WIDTH - 0.01) * figure.bbox.width, abs=1.0)
