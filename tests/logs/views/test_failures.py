"""Labels keep off each other and off the lines, as far as there is room."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight.simulation.track import COLUMNS, Track
from logs import theme
from logs.verdict.places import Place
from logs.views.drawing import new_figure
from logs.views.failures import (
    Failures,
    collect_failures,
    find_rows_inside_threats,
    make_fail_labels,
    paths_differ,
    route_distance,
    threat_radius,
    track_distance,
)
from logs.views.labels import LabelPlacer
from tests.logs.views.figure_data import ALL, ROUTE, drawn_map, drawn_profile, make_scenario, make_track, make_verdict


@pytest.fixture
def axes() -> Any:
    figure = new_figure(6.0)
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
    frame = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": theme.colour("fail")}
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
    placer.points.append((point[0], point[1]))
    placer.place("12", 50.0, 50.0)
    (leader,) = axes.lines
    np.testing.assert_allclose(leader.get_xydata()[-1], (50.0, 50.0))


@pytest.mark.parametrize("east", [1.0, -1.0])
def test_labels_of_near_points_stand_in_the_order_of_their_points(axes: Any, east: float) -> None:
    placer = LabelPlacer(axes)
    placer.place("2", 50.0, 50.0)
    placer.place("3", 50.0 + east, 50.0)
    second, third = boxes(axes)
    assert not second.overlaps(third)
    assert np.sign(third.x0 + third.x1 - second.x0 - second.x1) == np.sign(east)


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
    placer.points.append((0.0, 0.0))
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


# ----------------------------------------------------------------------
# Failures are found at their legs and waypoints, and progress along a route never falls.


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 200.0))
def test_progress_never_falls_and_finds_the_legs(seed: int, spread: float) -> None:
    track = make_track()
    rng = np.random.default_rng(seed)
    position = track.position + np.column_stack([rng.normal(0.0, spread, (len(track), 2)), np.zeros(len(track))])
    position[rng.integers(0, len(track), 3)] = np.nan
    columns = {name: getattr(track, name) for name in COLUMNS} | {"position": position}
    noisy = Track(**columns)
    progress = track_distance(ROUTE, noisy)
    at = route_distance(ROUTE)
    assert (np.diff(progress) >= 0.0).all()
    known = np.isfinite(position[:, 0])
    assert (progress[known] >= at[noisy.leg][known]).all()
    assert (progress <= at[noisy.leg + 1]).all()
    if spread == 0.0:
        straight = np.linspace(0.0, at[-1], len(track))
        np.testing.assert_allclose(progress[known], straight[known], atol=1e-6)


def test_paths_that_lie_on_each_other_do_not_differ() -> None:
    more_points = np.insert(ROUTE, 2, 0.5 * (ROUTE[1] + ROUTE[2]), axis=0)
    assert not paths_differ(ROUTE, more_points, 1.0)
    assert not paths_differ(np.repeat(ROUTE, 2, axis=0), ROUTE, 1.0)
    moved = ROUTE.copy()
    moved[1, 0] += 1.5
    assert paths_differ(ROUTE, moved, 1.0)
    assert paths_differ(ROUTE, ROUTE[:-1], 1.0)


def test_failures_are_found_at_their_legs_and_waypoints() -> None:
    bad = ("slope", Place("leg", 1)), ("clearance", Place("leg", 1)), ("turn", Place("waypoint", 3, 7))
    found = collect_failures(make_verdict(*bad), 4)
    assert found.legs == {1: ("slope", "clearance")}
    assert found.waypoints == {3: ("turn",)}
    assert not collect_failures(make_verdict(("slope", Place("leg", 3)), ("turn", Place("waypoint", 4))), 4)


# ----------------------------------------------------------------------
# Entered threats are marked and named where they stand, on the map and over the flight's heights.

# The second leg runs north along east 100 m at 340 to 380 m: the missile's centre is 200 m beside its middle, at 300 m.
UNIT = {"name": "post 25", "east_m": 300, "north_m": 0, "amsl_m": 300, "kill_radius_m": 250, "kill_scale_m": 50}
SCENARIO = make_scenario(threats=[UNIT])
MISSILE = Place("missile", 0, name="post 25")
ENTERED = make_verdict(("threat", MISSILE), ("slope", Place("leg", 1, to_item=9)))


def inside_rows() -> Any:
    track = make_track()
    away = track.position - [300.0, 0.0, 300.0]
    return track, np.sqrt((away**2).sum(axis=1)) < 250.0


def texts(figure: Any) -> set[str]:
    return {text.get_text() for text in figure.axes[0].texts}


def broad_line(figure: Any) -> Any:
    return next(
        line
        for line in figure.axes[0].lines
        if line.get_color() == theme.colour("fail") and line.get_linewidth() == 3.6
    )


def test_an_entered_missile_is_ringed_and_named_on_the_map() -> None:
    track, inside = inside_rows()
    figure = drawn_map(SCENARIO, **ALL, track=track, verdict=ENTERED)
    (ring,) = [line.get_xydata() for line in figure.axes[0].lines if line.get_label() == "threat that is entered"]
    np.testing.assert_allclose(np.hypot(*(ring - [300.0, 0.0]).T), 250.0)
    assert {"post 25 (missile): threat", "leg 1 (to item 9): slope"} <= texts(figure)
    assert "post 25" not in texts(figure)
    assert 4 < inside.sum() < len(track) // 2
    np.testing.assert_array_equal(np.isfinite(broad_line(figure).get_xdata()), inside)
    shown = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"threat that is entered", "flown inside a threat's reach"} <= set(shown)


def test_an_entered_missile_stands_over_the_flown_heights() -> None:
    track, inside = inside_rows()
    figure = drawn_profile(SCENARIO, **ALL, track=track, verdict=ENTERED)
    assert {"post 25 (missile): threat", "leg 1 (to item 9): slope"} <= texts(figure)
    np.testing.assert_array_equal(np.isfinite(broad_line(figure).get_ydata()), inside)
    # Its foot and its top over the path, 200 m beside the centre: 300 m less and more of sqrt(250^2 - 200^2) = 150 m.
    (cut,) = [band for band in figure.axes[0].collections if band.get_label() == "threat that is entered"]
    amsl = cut.get_paths()[0].vertices[:, 1]
    assert (amsl.min(), amsl.max()) == (pytest.approx(150.0, abs=1.0), pytest.approx(450.0, abs=1.0))


def test_a_plan_that_was_not_flown_shows_its_own_entry() -> None:
    figure = drawn_profile(SCENARIO, **ALL, track=None, verdict=ENTERED)
    assert "post 25 (missile): threat" in texts(figure)
    assert not texts(drawn_profile(SCENARIO, **ALL, track=None, verdict=make_verdict())) & {"post 25 (missile): threat"}


def test_a_sphere_is_the_one_that_the_place_names() -> None:
    both = make_scenario(threats=[{**UNIT, "detection_radius_m": 700, "detection_scale_m": 90}]).threats
    assert threat_radius(both, MISSILE) == 250.0
    assert threat_radius(both, Place("radar", 0)) == 700.0
    track, inside = inside_rows()
    assert find_rows_inside_threats(collect_failures(ENTERED, 4), both, track).tolist() == inside.tolist()
    assert not find_rows_inside_threats(Failures({}, {}), both, track).any()


def test_threats_without_a_place_in_the_picture_get_no_label() -> None:
    labels = make_fail_labels(collect_failures(ENTERED, 4), ROUTE[:, :2], {})
    assert [label.text for label in labels] == ["leg 1 (to item 9): slope"]
