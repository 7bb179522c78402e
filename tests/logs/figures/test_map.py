"""The map's marks stand where the data puts them."""

import numpy as np
import pytest

from logs.figures.draw_all import draw_map
from logs.figures.elements.style import FLOWN
from tests.logs.figures.figure_data import ALL, FAILED, ROUTE, make_scenario, make_track


def test_labels_do_not_cover_each_other() -> None:
    crowd = [
        {"name": f"unit {k}", "east_m": 40 * (k % 3), "north_m": 40 * (k // 3), "kill_radius_m": 90, "kill_scale_m": 9}
        for k in range(9)
    ]
    figure = draw_map(make_scenario(threats=crowd), **ALL, track=make_track(), verdict=FAILED)
    renderer = figure.canvas.get_renderer()
    boxes = [text.get_window_extent(renderer) for text in figure.axes[0].texts if text.get_zorder() == 9]
    assert len(boxes) == 15  # two ends, two inner waypoints, two failures, nine threats
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[k + 1 :])


def test_missiles_are_filled_as_far_as_they_reach_at_the_height_of_the_path() -> None:
    """Over level ground at 100 m, the path passes 220 m above the first unit and 260 m above the second."""
    units = [{"east_m": -400, "north_m": -400}, {"east_m": 100, "north_m": 0}]
    threats = [{**unit, "kill_radius_m": 250, "kill_scale_m": 50} for unit in units]
    scenario = make_scenario(terrain={"kind": "flat", "amsl_m": 100}, threats=threats)
    fills, outlines = draw_map(scenario, **ALL, track=None, verdict=None).axes[0].collections
    reach = [path.get_extents().width / 2 for path in fills.get_paths()]
    assert reach == [pytest.approx(np.sqrt(250.0**2 - 220.0**2), rel=0.01)]
    assert [path.get_extents().width / 2 for path in outlines.get_paths()] == [pytest.approx(250.0, rel=0.001)] * 2


def test_map_shows_the_track_where_it_was_flown() -> None:
    track = make_track()
    figure = draw_map(make_scenario(), **ALL, track=track, verdict=None)
    (line,) = [line for line in figure.axes[0].lines if line.get_label() == "flown track"]
    assert line.get_color() == FLOWN
    np.testing.assert_allclose(line.get_xydata()[0], track.position[0, :2])
    np.testing.assert_allclose(line.get_xydata()[-1], track.position[-1, :2])
    assert figure.axes[0].get_aspect() == 1.0


def test_map_widens_to_a_flight_that_left_the_area() -> None:
    outside = ROUTE.copy()
    outside[2] = [3000.0, 900.0, 400.0]
    figure = draw_map(
        make_scenario(), plan_waypoints=ROUTE, route_waypoints=ROUTE, track=make_track(outside), verdict=None
    )
    axes = figure.axes[0]
    assert axes.get_xlim()[0] < -1200
    assert axes.get_xlim()[1] > 3000
    assert axes.get_ylim()[1] > 900


def test_zones_are_drawn_and_named() -> None:
    zones = [{"name": "town", "kind": "exclusion", "east_m": 0, "north_m": -500, "radius_m": 150}]
    figure = draw_map(make_scenario(zones=zones), **ALL, track=None, verdict=None)
    boxes = [path.get_extents() for item in figure.axes[0].collections for path in item.get_paths()]
    assert any((box.x0, box.x1, box.y0, box.y1) == pytest.approx((-150, 150, -650, -350)) for box in boxes)
    assert "town" in {text.get_text() for text in figure.axes[0].texts}
    assert "zone to keep out of" in {text.get_text() for text in figure.legends[0].get_texts()}
