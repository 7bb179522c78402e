"""The 3-D picture: a parallel projection, seen from aside of the route."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.mission.itinerary import NO_ITEM
from logs import theme
from logs.verdict.places import Place
from logs.views.draw_scene import Projection, draw_scene
from logs.views.drawing import png_bytes
from logs.views.failures import collect_failures
from logs.views.scene import SceneView
from tests.logs.views.figure_data import make_verdict
from tests.logs.views.report.report_data import make_setup, make_track

# The viewer looks down by this much.
DOWN = math.radians(36.0)


def test_seen_from_the_south_east_is_right_and_north_is_up_and_away() -> None:
    projection = Projection(-math.pi / 2.0, np.array([100.0, 200.0, 300.0]), 2.0)
    middle = np.array([100.0, 200.0, 300.0])
    east, north, up = projection.project(middle + np.eye(3))
    np.testing.assert_allclose(projection.project(middle), 0.0, atol=1e-12)
    np.testing.assert_allclose(east, [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(north, [0.0, math.sin(DOWN), -math.cos(DOWN)], atol=1e-12)
    # Heights are stretched twofold.
    np.testing.assert_allclose(up, [0.0, 2.0 * math.cos(DOWN), 2.0 * math.sin(DOWN)], atol=1e-12)


@pytest.mark.parametrize("azimuth", [-2.5, -0.7, 1.9])
@pytest.mark.parametrize("stretch", [1.0, 3.0])
def test_a_step_to_the_viewer_stays_on_its_spot_and_comes_nearer(azimuth: float, stretch: float) -> None:
    projection = Projection(azimuth, np.zeros(3), stretch)
    point = np.array([[120.0, -40.0, 77.0], [0.0, 9.0, 5.0]])
    here, there = projection.project(point), projection.project(point + 50.0 * projection.toward)
    np.testing.assert_allclose(there[:, :2], here[:, :2], atol=1e-9)
    assert (there[:, 2] > here[:, 2]).all()
    # One metre on the ground.
    assert math.hypot(*projection.toward[:2]) == pytest.approx(1.0)


def drawn(setup: Any, track: Any, verdict: Any) -> Any:
    return draw_scene(SceneView(setup, track, collect_failures(verdict, len(setup.route.points))))


def legend(figure: Any) -> set[str]:
    return {text.get_text() for text in figure.legends[0].get_texts()}


def test_waypoints_have_the_numbers_of_their_mission_items() -> None:
    """As in a suggestion, "move item 3 up": a loiter of two waypoints is one item, and home is none."""
    setup = make_setup()
    setup = replace(setup, route=setup.route.with_fields(stop=[0, 1, 1, 2], item=[NO_ITEM, 3, 3, 7]))
    names = {text.get_text() for text in drawn(setup, make_track(), None).axes[0].texts}
    assert {"start", "3", "7 destination"} <= names
    assert not {"0 start", "1", "2", "2 destination"} & names


def test_what_is_there_is_drawn_and_named() -> None:
    flown = drawn(make_setup(), make_track(), make_verdict(("slope", Place("leg", 1))))
    # From (-900, -400) to (700, 400): seen from the south-south-east, the nearest of eight names of which is the south.
    assert flown.axes[0].get_title(loc="left").startswith("small: seen from the south")
    assert {"planned path", "flown track", "missile's reach", "waypoint above the ground"} <= legend(flown)
    assert "leg that fails a rule" in legend(flown)
    names = {text.get_text() for text in flown.axes[0].texts}
    assert {"0 start", "3 destination", "1", "2"} <= names
    planned = drawn(make_setup(terrain={"kind": "none"}, threats=[]), None, None)
    assert "no terrain: level at mid height" in legend(planned)
    assert not {"flown track", "missile's reach", "leg that fails a rule"} & legend(planned)
    assert png_bytes(planned).startswith(b"\x89PNG")


def test_a_path_behind_a_ridge_is_drawn_dashed() -> None:
    """A ridge of 400 m stands 500 m south of a path at 120 m: from the south, 36 degrees down, it is hidden."""
    ridge = [{"east_m": east, "north_m": -900, "height_m": 400, "sigma_m": 200} for east in range(-1200, 1201, 150)]

    def dashed(setup: Any) -> int:
        lines = drawn(setup, None, None).axes[0].lines
        thin = [line for line in lines if line.get_linewidth() == pytest.approx(1.8)]
        return sum(int(np.isfinite(line.get_ydata()).sum()) for line in thin)

    area = {"east_m": [-1200, 1200], "north_m": [-1500, 800], "ceiling_amsl_m": 900}
    hidden = make_setup(area=area, terrain={"kind": "peaks", "peak": ridge}, threats=[])
    way = hidden.route.positions.copy()
    way[:, 1], way[:, 2] = -500.0, 120.0
    way[:, 0] = np.linspace(-900.0, 900.0, 4)
    assert dashed(replace(hidden, route=hidden.route.with_fields(position=way))) > 100
    assert dashed(make_setup(terrain={"kind": "flat", "amsl_m": 0}, threats=[])) == 0


def test_zones_are_bodies_from_the_ground_up() -> None:
    square = [[-300, -300], [300, -300], [300, 300], [-300, 300]]
    zone = {"name": "town", "kind": "exclusion", "polygon_m": square, "ceiling_amsl_m": 500}
    setup = make_setup(zones=[zone], terrain={"kind": "flat", "amsl_m": 40})
    figure = drawn(setup, None, None)
    edges = [line for line in figure.axes[0].lines if line.get_color() == theme.colour("zone")]
    assert len(edges) == 2
    lower, upper = (line.get_ydata() for line in edges)
    # All of it is 460 m high, seen from 36 degrees above; the title says how much heights are stretched.
    title = figure.axes[0].get_title(loc="left")
    stretch = 1.0 if "true to scale" in title else float(title.split("×")[1])
    np.testing.assert_allclose(upper - lower, 460.0 * stretch * math.cos(DOWN))
    assert "zone to keep out of" in legend(figure)


def ground_corners(figure: Any) -> np.ndarray:
    """The level ground's corners where no terrain was given, (4, 2) in the picture's metres."""
    (ground,) = [item for item in figure.axes[0].collections if item.get_zorder() == 1]
    return np.asarray(ground.get_paths()[0].vertices[:4])


def test_a_long_and_narrow_scene_is_no_strip() -> None:
    """A route of 4 km in an area 300 m wide: ground 30 % as wide as it is long, seen half from its end."""
    strip = {"east_m": [-2100, 2100], "north_m": [-150, 150], "ceiling_amsl_m": 500}
    ends = {"start": {"east_m": -2000, "north_m": 0, "amsl_m": 300}}
    ends["destination"] = {"east_m": 2000, "north_m": 0, "amsl_m": 300}
    setup = make_setup(area=strip, terrain={"kind": "none"}, threats=[], **ends)
    straight = np.array([[-2000.0, 0.0, 300.0], [0.0, 0.0, 300.0], [2000.0, 0.0, 300.0]])
    straight = np.vstack([straight, [[2050.0, 0.0, 300.0]]])
    setup = replace(setup, route=setup.route.with_fields(position=straight))
    figure = drawn(setup, None, None)
    west_south, east_south, east_north, _ = ground_corners(figure)
    # Seen from 45 degrees round: each metre east is cos 45 degrees to the right, each metre north as much to the right.
    turned = math.sqrt(0.5)
    assert east_south[0] - west_south[0] == pytest.approx(4200.0 * turned)
    assert east_north[0] - east_south[0] == pytest.approx(0.3 * 4200.0 * turned)
    wide, tall = figure.axes[0].bbox.width, figure.axes[0].bbox.height
    assert tall > 0.5 * wide


def test_entered_missiles_are_outlined_and_named() -> None:
    def outlined(*bad: tuple[str, Place]) -> int:
        figure = drawn(make_setup(), make_track(), make_verdict(*bad))
        return sum(patch.get_linewidth() == 2.2 for patch in figure.axes[0].patches)

    assert outlined(("slope", Place("leg", 1))) == 0
    assert outlined(("threat", Place("missile", 0, name="M one"))) == 1
