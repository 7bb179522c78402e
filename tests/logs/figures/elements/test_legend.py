"""The legend names only what failed; the compass points where the wind blows."""

import numpy as np
import pytest

from logs.figures.elements import style
from logs.figures.elements.failures import Failures
from logs.figures.elements.legend import NamedWind, draw_compass, draw_legend, failing_handles
from tests.logs.figures.figure_data import make_scenario
from world.wind import Wind


def test_failing_marks_are_explained_where_there_are_any() -> None:
    def labels(legs: tuple[int, ...], waypoints: tuple[int, ...]) -> list[str]:
        failed = Failures(dict.fromkeys(legs, ("slope",)), dict.fromkeys(waypoints, ("turn",)))
        return [handle.get_label() for handle in failing_handles(failed)]

    assert labels((), ()) == []
    assert labels((1, 2), ()) == ["leg that fails a rule"]
    assert labels((), (3,)) == ["waypoint that fails a rule"]
    assert labels((1,), (3,)) == ["leg that fails a rule", "waypoint that fails a rule"]


def wind(speed: float, from_deg: float, turbulence: str = "none") -> Wind:
    return make_scenario(wind={"speed_mps": speed, "from_deg": from_deg, "turbulence": turbulence}).wind


@pytest.mark.parametrize(("from_deg", "to"), [(270.0, (1.0, 0.0)), (0.0, (0.0, -1.0)), (45.0, (-1.0, -1.0))])
def test_the_arrow_points_to_where_the_wind_blows(from_deg: float, to: tuple[float, float]) -> None:
    figure = style.new_figure(6.0)
    draw_compass(figure, [NamedWind(wind(5.0, from_deg, "light"))], 8.7)
    (arrow,) = [text for text in figure.axes[0].texts if hasattr(text, "arrow_patch")]
    head, tail = np.array(arrow.xy), np.array(arrow.xyann)
    assert (head - tail) / np.linalg.norm(head - tail) == pytest.approx(np.array(to) / np.hypot(*to), abs=1e-9)
    (note,) = [text.get_text() for text in figure.texts]
    assert note == f"wind 5.0 m/s\nfrom {from_deg:03.0f}°\nlight turbulence"


def test_calm_air_has_no_arrow() -> None:
    figure = style.new_figure(6.0)
    draw_compass(figure, [NamedWind(wind(0.0, 0.0))], 8.7)
    assert not any(hasattr(text, "arrow_patch") for text in figure.axes[0].texts)
    assert [text.get_text() for text in figure.texts] == ["no mean wind"]


def test_two_winds_are_both_drawn_and_told_apart() -> None:
    figure = style.new_figure(6.0)
    winds = [NamedWind(wind(5.0, 270.0), "a.mcap", style.FLOWN), NamedWind(wind(8.0, 0.0), "b.mcap", style.MISSILE)]
    draw_compass(figure, winds, 8.7)
    arrows = [text for text in figure.axes[0].texts if hasattr(text, "arrow_patch")]
    assert [np.sign(np.round(np.array(arrow.xy), 9)).tolist() for arrow in arrows] == [[1.0, 0.0], [0.0, -1.0]]
    notes = [(text.get_text(), text.get_color()) for text in figure.texts]
    assert notes == [
        ("a.mcap:\nwind 5.0 m/s\nfrom 270°", style.FLOWN), ("b.mcap:\nwind 8.0 m/s\nfrom 000°", style.MISSILE),
    ]  # fmt: skip
    figure.canvas.draw()
    upper, lower = (text.get_window_extent() for text in figure.texts)
    assert upper.y0 > lower.y1 > lower.y0 > 0.0


def test_a_wind_from_just_west_of_north_is_no_360() -> None:
    figure = style.new_figure(6.0)
    draw_compass(figure, [NamedWind(wind(5.0, 359.7))], 8.7)
    assert figure.texts[0].get_text().endswith("from 000°")


def test_the_legend_stands_where_it_is_put() -> None:
    figure = style.new_figure(6.0)
    failed = Failures({1: ("slope",)}, {})
    draw_legend(figure, failing_handles(failed), 0.8, 0.3)
    figure.canvas.draw()
    box = figure.legends[0].get_window_extent()
    assert box.y1 == pytest.approx(0.3 * figure.bbox.height, abs=1.0)
    # 0.01 of the width further left, for its own frame.
    assert box.x0 == pytest.approx((0.8 / style.WIDTH - 0.01) * figure.bbox.width, abs=1.0)
