"""The ground under a map: lit from the north-west, with contours at round heights, or a note instead."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.mission.itinerary import NO_ITEM
from logs import theme
from logs.verdict.places import Place
from logs.views.charts import Layer, legend_entries
from logs.views.draw_map import draw_compass, draw_ground, draw_map
from logs.views.drawing import WIDTH, draw_legend, make_legend_handle, new_figure
from logs.views.map import NamedWind, end_labels, flight_map, map_json
from tests.logs.views.figure_data import ALL, FAILED, ROUTE, drawn_map, make_scenario, make_track, make_verdict
from world.wind import Wind


def drawn(**changes: Any) -> tuple[Any, Any, list[Any]]:
    figure = new_figure(6.0)
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
    assert any("ground elevation" in other.get_ylabel() for other in figure.axes)


# ----------------------------------------------------------------------
# The legend names only what failed; the compass points where the wind blows.


def test_failing_marks_are_explained_where_there_are_any() -> None:
    def marked(*bad: tuple[str, Place]) -> list[str]:
        chart = flight_map(make_scenario(), **ALL, track=None, verdict=make_verdict(*bad))
        return [entry.text for entry in legend_entries([chart.panel]) if "fails" in entry.text]

    leg, waypoint = ("slope", Place("leg", 1)), ("turn", Place("waypoint", 2, 3))
    assert marked() == []
    assert marked(leg, ("slope", Place("leg", 2))) == ["leg that fails a rule"]
    assert marked(waypoint) == ["waypoint that fails a rule"]
    assert marked(leg, waypoint) == ["leg that fails a rule", "waypoint that fails a rule"]


def wind(speed: float, from_deg: float, turbulence: str = "none") -> Wind:
    return make_scenario(wind={"speed_mps": speed, "from_deg": from_deg, "turbulence": turbulence}).wind


@pytest.mark.parametrize(("from_deg", "to"), [(270.0, (1.0, 0.0)), (0.0, (0.0, -1.0)), (45.0, (-1.0, -1.0))])
def test_the_arrow_points_to_where_the_wind_blows(from_deg: float, to: tuple[float, float]) -> None:
    figure = new_figure(6.0)
    draw_compass(figure, [NamedWind(wind(5.0, from_deg, "light"))], 8.7)
    (arrow,) = [text for text in figure.axes[0].texts if hasattr(text, "arrow_patch")]
    head, tail = np.array(arrow.xy), np.array(arrow.xyann)
    assert (head - tail) / np.linalg.norm(head - tail) == pytest.approx(np.array(to) / np.hypot(*to), abs=1e-9)
    (note,) = [text.get_text() for text in figure.texts]
    assert note == f"wind 5.0 m/s\nfrom {from_deg:03.0f}°\nlight turbulence"


def test_calm_air_has_no_arrow() -> None:
    figure = new_figure(6.0)
    draw_compass(figure, [NamedWind(wind(0.0, 0.0))], 8.7)
    assert not any(hasattr(text, "arrow_patch") for text in figure.axes[0].texts)
    assert [text.get_text() for text in figure.texts] == ["no mean wind"]


def test_two_winds_are_both_drawn_and_told_apart() -> None:
    figure = new_figure(6.0)
    winds = [NamedWind(wind(5.0, 270.0), "a.mcap", "flown"), NamedWind(wind(8.0, 0.0), "b.mcap", "other")]
    draw_compass(figure, winds, 8.7)
    arrows = [text for text in figure.axes[0].texts if hasattr(text, "arrow_patch")]
    assert [np.sign(np.round(np.array(arrow.xy), 9)).tolist() for arrow in arrows] == [[1.0, 0.0], [0.0, -1.0]]
    notes = [(text.get_text(), text.get_color()) for text in figure.texts]
    assert notes == [
        ("a.mcap:\nwind 5.0 m/s\nfrom 270°", theme.colour("flown")),
        ("b.mcap:\nwind 8.0 m/s\nfrom 000°", theme.colour("other")),
    ]
    figure.canvas.draw()
    upper, lower = (text.get_window_extent() for text in figure.texts)
    assert upper.y0 > lower.y1 > lower.y0 > 0.0


def test_a_wind_from_just_west_of_north_is_no_360() -> None:
    figure = new_figure(6.0)
    draw_compass(figure, [NamedWind(wind(5.0, 359.7))], 8.7)
    assert figure.texts[0].get_text().endswith("from 000°")


def test_the_legend_stands_where_it_is_put() -> None:
    figure = new_figure(6.0)
    chart = flight_map(make_scenario(), **ALL, track=None, verdict=FAILED)
    draw_legend(figure, [make_legend_handle(entry) for entry in legend_entries([chart.panel])], 0.8, 0.3)
    figure.canvas.draw()
    box = figure.legends[0].get_window_extent()
    assert box.y1 == pytest.approx(0.3 * figure.bbox.height, abs=1.0)
    # 0.01 of the width further left, for its own frame.
    assert box.x0 == pytest.approx((0.8 / WIDTH - 0.01) * figure.bbox.width, abs=1.0)


def test_a_legend_of_many_long_names_is_whole() -> None:
    chart = flight_map(make_scenario(), **ALL, track=None, verdict=FAILED)
    corners = np.array([0.0, 1.0, 1.0]), np.array([0.0, 0.0, 1.0])
    areas = [Layer("area", f"home in reach from {k}50 m above the ground", "landable", *corners) for k in range(16)]
    figure = draw_map(replace(chart, panel=replace(chart.panel, layers=(*chart.panel.layers, *areas))))
    figure.canvas.draw()
    legend = figure.legends[0].get_window_extent()
    assert legend.y0 >= 0.0
    # The note on the wind stands above it.
    note = next(text for text in figure.texts if "wind" in text.get_text())
    assert note.get_window_extent().y0 >= legend.y1


# ----------------------------------------------------------------------
# The map's marks stand where the data puts them.


def test_labels_do_not_cover_each_other() -> None:
    crowd = [
        {"name": f"unit {k}", "east_m": 40 * (k % 3), "north_m": 40 * (k // 3), "kill_radius_m": 90, "kill_scale_m": 9}
        for k in range(9)
    ]
    figure = drawn_map(make_scenario(threats=crowd), **ALL, track=make_track(), verdict=FAILED)
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
    layers = flight_map(scenario, **ALL, track=None, verdict=None).panel.layers
    radii = {
        role: [np.ptp(layer.x) / 2 for layer in layers if layer.role == role] for role in ("missile-reach", "missile")
    }
    assert radii["missile-reach"] == [pytest.approx(np.sqrt(250.0**2 - 220.0**2), rel=0.01)]
    assert radii["missile"] == [pytest.approx(250.0, rel=0.001)] * 2


def test_map_shows_the_track_where_it_was_flown() -> None:
    track = make_track()
    figure = drawn_map(make_scenario(), **ALL, track=track, verdict=None)
    (line,) = [line for line in figure.axes[0].lines if line.get_label() == "flown track"]
    assert line.get_color() == theme.colour("flown")
    np.testing.assert_allclose(line.get_xydata()[0], track.position[0, :2])
    np.testing.assert_allclose(line.get_xydata()[-1], track.position[-1, :2])
    assert figure.axes[0].get_aspect() == 1.0


def test_map_widens_to_a_flight_that_left_the_area() -> None:
    outside = ROUTE.copy()
    outside[2] = [3000.0, 900.0, 400.0]
    figure = drawn_map(
        make_scenario(), plan_waypoints=ROUTE, route_waypoints=ROUTE, track=make_track(outside), verdict=None
    )
    axes = figure.axes[0]
    assert axes.get_xlim()[0] < -1200
    assert axes.get_xlim()[1] > 3000
    assert axes.get_ylim()[1] > 900


def test_map_of_a_mission_without_an_area_is_as_large_as_its_way() -> None:
    """1,600 m by 800 m with a tenth of 1,600 m around, in an area of 2,400 m by 1,600 m that somebody made up."""

    def shown(**changes: Any) -> list[float]:
        world = make_scenario(threats=[], external=True, **changes)
        chart = flight_map(world, plan_waypoints=None, route_waypoints=ROUTE, track=None, verdict=None)
        return [*chart.east, *(chart.panel.span or ())]

    assert shown() == pytest.approx([-1060.0, 860.0, -560.0, 560.0])
    # A zone counts as far as it lies in the area: to 800 m north of 900 m.
    zone = {"name": "town", "kind": "exclusion", "east_m": 0, "north_m": 700, "radius_m": 200}
    assert shown(zones=[zone]) == pytest.approx([-1060.0, 860.0, -560.0, 960.0], abs=0.5)


def test_zones_are_drawn_and_named() -> None:
    zones = [{"name": "town", "kind": "exclusion", "east_m": 0, "north_m": -500, "radius_m": 150}]
    figure = drawn_map(make_scenario(zones=zones), **ALL, track=None, verdict=None)
    boxes = [patch.get_path().get_extents() for patch in figure.axes[0].patches]
    assert any((box.x0, box.x1, box.y0, box.y1) == pytest.approx((-150, 150, -650, -350), rel=0.02) for box in boxes)
    assert "town" in {text.get_text() for text in figure.axes[0].texts}
    assert "zone to keep out of" in {text.get_text() for text in figure.legends[0].get_texts()}


def test_a_plan_is_told_from_a_route_that_differs_by_over_a_metre() -> None:
    def paths(plan: np.ndarray | None) -> list[str]:
        chart = flight_map(make_scenario(), plan_waypoints=plan, route_waypoints=ROUTE, track=None, verdict=None)
        return [layer.name for layer in chart.panel.layers if layer.role in ("planned", "searched")]

    assert paths(None) == ["route of the mission"]
    assert paths(ROUTE + np.array([0.0, 0.5, 0.0])) == ["planned path"]
    assert paths(ROUTE + np.array([0.0, 2.0, 0.0])) == ["plan as searched", "route of the mission"]


def test_the_page_has_the_flights_moments_instead_of_its_points() -> None:
    made = map_json(flight_map(make_scenario(), **ALL, track=make_track(), verdict=None))
    flown = [layer for layer in made["layers"] if "flight" in layer]
    assert [(layer["role"], layer["flight"], "x" in layer) for layer in flown] == [("flown", 0, False)]
    assert [label[0] for label in made["labels"]] == ["0 start", "3 destination", "1", "2"]


def test_waypoints_have_the_numbers_of_their_mission_items() -> None:
    """A suggestion names items, so that the number beside a waypoint is its item's; home is no item."""
    arguments = ALL | {"items": [NO_ITEM, 3, 4, 7]}
    made = map_json(flight_map(make_scenario(), **arguments, track=make_track(), verdict=None))
    assert [label[0] for label in made["labels"]] == ["start", "7 destination", "3", "4"]
    assert "waypoint, with the number of its mission item" in [layer["name"] for layer in made["layers"]]


def test_a_way_that_ends_where_it_began_has_one_label_there() -> None:
    there = make_scenario()
    back = replace(there, destination=there.start + np.array([49.0, 0.0, 0.0]))
    loop = np.concatenate([ROUTE, ROUTE[:1]])
    made = map_json(flight_map(back, plan_waypoints=None, route_waypoints=loop, track=None, verdict=None))
    assert [label[0] for label in made["labels"]] == ["0 start, 4 destination", "1", "2", "3"]


def test_ends_have_the_numbers_of_their_stops() -> None:
    """The last of five waypoints is the third stop of a mission with a loiter of three corners."""
    scenario = make_scenario()
    middle = np.linspace(scenario.start, scenario.destination, 5)
    labels = end_labels(scenario, middle, [0, 1, 1, 1, 2])
    assert [label.text for label in labels] == ["0 start", "2 destination"]


def test_the_ends_of_a_mission_are_its_own_wherever_the_scenario_begins() -> None:
    scenario = make_scenario()
    mission = ROUTE + np.array([300.0, -200.0, 0.0])
    made = map_json(flight_map(scenario, plan_waypoints=None, route_waypoints=mission, track=None, verdict=None))
    ends = {
        layer["name"]: (layer["x"], layer["y"]) for layer in made["layers"] if layer["name"] in ("start", "destination")
    }
    for name, end in (("start", mission[0]), ("destination", mission[-1])):
        assert np.allclose(np.ravel(ends[name]), end[:2])
    labels = {text: (x, y) for text, x, y, *_ in made["labels"]}
    assert np.allclose(labels["0 start"], mission[0, :2])
    assert np.allclose(labels[f"{len(mission) - 1} destination"], mission[-1, :2])
