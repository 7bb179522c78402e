"""What is a survey, and what is not; and its lines laid out otherwise."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from flight.mission import surveys as survey_module
from flight.mission.items import Command, Mission, SurveyPlan
from flight.mission.route import Route, RouteRules, make_route
from flight.mission.survey_layout import SurveyLayout, fixed_layout_reason, min_turn_around, with_layout
from flight.mission.surveys import LineAxis, Survey, camera_spacing, find_surveys, survey_plan
from tests.mission_lines import ORIGIN, mission, wp
from world.errors import MissionError

Place = tuple[float, float]


def grid(
    count: int = 4, length: float = 800.0, apart: float = 60.0, lead: float = 0.0, turned_deg: float = 0.0
) -> list[Place]:
    """Waypoints there and back, turned clockwise."""
    out = []
    for k in range(count):
        along = [-lead, 0.0, length, length + lead] if lead else [0.0, length]
        out += [(apart * k, north) for north in (along if k % 2 == 0 else [length - north for north in along])]
    turn = math.radians(turned_deg)
    return [(e * math.cos(turn) + n * math.sin(turn), n * math.cos(turn) - e * math.sin(turn)) for e, n in out]


def flown(places: Sequence[Place], *more: str) -> tuple[Mission, Route]:
    read = mission(*(wp(east, north) for east, north in places), *more, home="36.5 -84.2 0")
    return read, make_route(read, ORIGIN, None, 15.0, False)


def surveys(places: Sequence[Place]) -> tuple[Survey, ...]:
    read, route = flown(places)
    return find_surveys(route, camera_spacing(read, route))


@pytest.mark.parametrize("turned_deg", [0.0, 37.0, 180.0, 271.0])
def test_parallel_lines_are_a_survey_whatever_their_course(turned_deg: float) -> None:
    [found] = surveys(grid(turned_deg=turned_deg))
    assert [(line.first, line.last) for line in found.lines] == [(0, 1), (2, 3), (4, 5), (6, 7)]
    assert found.offsets == pytest.approx([0.0, 60.0, 120.0, 180.0], abs=0.1)
    assert (found.spacing, math.degrees(found.course) % 360.0) == pytest.approx((60.0, turned_deg), abs=0.1)
    assert found.turn_arounds() == [(1, 2), (3, 4), (5, 6)]


def test_leads_of_one_length_are_no_part_of_a_line() -> None:
    [found] = surveys(grid(lead=100.0))
    assert [(line.first, line.last, line.begins, line.ends) for line in found.lines][:2] == [(1, 2, 0, 3), (5, 6, 4, 7)]
    uneven = grid(lead=100.0)
    uneven[0] = (0.0, -150.0)
    assert [(line.first, line.last) for line in surveys(uneven)[0].lines][:2] == [(0, 3), (4, 7)]


def test_lines_in_any_order_are_one_survey() -> None:
    """Every second line on the way there, the others on the way back."""
    east = [0.0, 120.0, 180.0, 60.0]
    places = [(e, n) for k, e in enumerate(east) for n in ((0.0, 800.0) if k % 2 == 0 else (800.0, 0.0))]
    [found] = surveys(places)
    assert found.offsets == pytest.approx(east, abs=0.1)
    assert found.spacing == pytest.approx(60.0, abs=0.1)


@pytest.mark.parametrize(
    "places",
    [
        grid(count=2),
        [(0, 0), (0, 800), (800, 800), (800, 0), (0, 0), (0, 800)],
        [(0, 0), (0, 800), (60, 800), (60, 0), (0, 0), (0, 800), (60, 800), (60, 0)],
        [(0, 0), (100, 800), (300, 0), (500, 800), (700, 0)],
        [(0, 0), (0, 800), (1600, 800), (1600, 0), (3200, 0), (3200, 800)],
        [(0, 0), (0, 800), (60, 900), (60, 1700), (120, 1800), (120, 2600)],
    ],
    ids=["there and back", "a square", "a racetrack twice", "a zigzag", "far apart", "one behind the other"],
)
def test_what_is_no_survey(places: list[Place]) -> None:
    assert surveys(places) == ()


def test_rounds_flown_many_times_are_looked_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each run is laid beside the 13 that follow it, once, though a survey might begin at each of 240 of them."""
    asked, really = list[tuple[int, int]](), survey_module._Runs._compute_spacing

    def count(runs: survey_module._Runs, one: int, other: int) -> float | None:
        asked.append((one, other))
        return really(runs, one, other)

    monkeypatch.setattr(survey_module._Runs, "_compute_spacing", count)
    assert surveys([(0, 0), (0, 1500), (1500, 1500), (1500, 0)] * 60) == ()
    assert len(asked) == len(set(asked)) <= 240 * 13


def test_a_final_approach_beside_the_lines_is_none_of_them() -> None:
    places = [wp(east, north) for east, north in grid(count=3)]
    landing = [wp(200.0, 900.0, 60.0), wp(200.0, 0.0, 0.0, command=21)]
    read = mission(*places, *landing, home="36.5 -84.2 0")
    route = make_route(read, ORIGIN, None, 15.0, False)
    [found] = find_surveys(route, camera_spacing(read, route))
    assert len(found.lines) == 3
    # The same as waypoints is a line.
    [found] = surveys([*grid(count=3), (200.0, 900.0), (200.0, 0.0)])
    assert len(found.lines) == 4


def test_a_link_that_is_almost_parallel_to_its_lines_is_none() -> None:
    """A field whose edge is 9 degrees off the lines, 30 m apart: links of 192 m go back beside the line before."""
    edge = 30.0 / math.tan(math.radians(9.0))
    lines = [(0.0, 900.0), (0.0, 900.0 - edge), (0.0, 900.0 - 2 * edge), (0.0, 900.0 - 3 * edge)]
    places = [
        (30.0 * k, north) for k, ends in enumerate(lines) for north in (ends if k % 2 == 0 else tuple(reversed(ends)))
    ]
    [found] = surveys(places)
    assert [(line.first, line.last) for line in found.lines] == [(0, 1), (2, 3), (4, 5), (6, 7)]
    assert found.spacing == pytest.approx(30.0, abs=0.1)


def test_spokes_of_a_hub_are_no_survey() -> None:
    """Six degrees apart, as parallel as many a line drawn by hand, but they touch."""
    tips = [(1000.0 * math.sin(math.radians(a)), 1000.0 * math.cos(math.radians(a))) for a in (0, 6, 12, 18)]
    assert surveys([place for tip in tips for place in ((0.0, 0.0), tip)]) == ()


def test_lines_drawn_by_hand_are_a_survey() -> None:
    """While they are off parallel by no more than half of what their middles are apart: 22 m of 49, not 26 of 47."""

    def leaning(metres: float) -> list[Place]:
        return [(east + (metres if k % 4 == 1 else 0.0), north) for k, (east, north) in enumerate(grid())]

    [found] = surveys(leaning(22.0))
    assert len(found.lines) == 4
    assert surveys(leaning(26.0)) == ()


def test_lines_that_are_flown_twice_are_as_far_apart_as_the_others() -> None:
    """Each a second time, 3 m beside: the gaps are 3 and 57 m in turn."""
    east = [0.0, 60.0, 120.0, 123.0, 63.0, 3.0]
    places = [(e, n) for k, e in enumerate(east) for n in ((0.0, 800.0) if k % 2 == 0 else (800.0, 0.0))]
    [found] = surveys(places)
    assert found.spacing == pytest.approx(57.0, abs=0.1)


def test_a_grid_flown_across_another_is_a_survey_of_its_own() -> None:
    """Its first turn-around lies beside the last line of the other, and is none of its lines."""
    along, across = (
        grid(count=3),
        [(250.0, 0.0), (-150.0, 0.0), (-150.0, 60.0), (250.0, 60.0), (250.0, 120.0), (-150.0, 120.0)],
    )
    first, second = surveys([*along, *across])
    assert [(line.first, line.last) for line in first.lines] == [(0, 1), (2, 3), (4, 5)]
    assert [(line.first, line.last) for line in second.lines] == [(6, 7), (8, 9), (10, 11)]


def test_the_way_to_a_first_line_may_lie_beside_the_second() -> None:
    """From the first line's begin back to where its lead begins: as long a list, but of shorter lines."""
    [found] = surveys([(0.0, 0.0), *grid(count=3, lead=150.0)])
    assert [(line.begins, line.ends) for line in found.lines] == [(1, 4), (5, 8), (9, 12)]


def test_a_turn_around_of_many_legs() -> None:
    """Around a bulb, one leg of which is almost parallel to the lines and half as far from the last as it is long."""
    bulb = [(40.0, 860.0), (120.0, 900.0), (200.0, 860.0), (200.0, 810.0), (130.0, 770.0)]
    first = [(0.0, 0.0), (0.0, 800.0), *bulb, (60.0, 800.0), (60.0, 0.0), (120.0, 0.0), (120.0, 800.0)]
    [found] = surveys(first)
    assert [(line.first, line.last) for line in found.lines] == [(0, 1), (7, 8), (9, 10)]


def test_a_short_leg_of_a_turn_around_far_beside_the_lines_is_none() -> None:
    """Of 80 m, 250 m from the last line and 190 m from the next."""
    bulb = [(120.0, 900.0), (250.0, 780.0), (252.0, 700.0), (150.0, 830.0)]
    [found] = surveys([(0.0, 0.0), (0.0, 800.0), *bulb, (60.0, 800.0), (60.0, 0.0), (120.0, 0.0), (120.0, 800.0)])
    assert [(line.first, line.last) for line in found.lines] == [(0, 1), (6, 7), (8, 9)]


def test_lines_at_the_tip_of_a_field_are_short() -> None:
    """Of 15, 30 and 45 m, 25 m apart, with 108 m and 122 m of turn-around between."""
    tip = [(0.0, 0.0), (0.0, 15.0), (12.0, 75.0), (25.0, 30.0), (25.0, 0.0), (37.0, -60.0), (50.0, 0.0), (50.0, 45.0)]
    [found] = surveys(tip)
    assert [(line.first, line.last) for line in found.lines] == [(0, 1), (3, 4), (6, 7)]


def test_a_line_between_long_ways_across_is_a_line() -> None:
    """Every second of eleven lines of 500 m, 250 m apart, then the others: links of 500 m, and 2,250 m back."""
    east = [500.0 * k for k in range(6)] + [250.0 + 500.0 * k for k in range(5)]
    places = [(e, n) for k, e in enumerate(east) for n in ((0.0, 500.0) if k % 2 == 0 else (500.0, 0.0))]
    assert [len(found.lines) for found in surveys(places)] == [6, 5]


def test_the_way_to_a_line_is_no_part_of_it_where_the_next_link_lies_beside_it() -> None:
    """600 m, 30 m beside a link of 60 m, is no bend of the first line."""
    [found] = surveys([(600.0, -30.0), (0.0, -30.0), *grid(count=3)[1:]])
    assert [(line.first, line.last) for line in found.lines] == [(1, 2), (3, 4), (5, 6)]


def bent(count: int = 3, apart: float = 60.0, lead: float = 0.0, second: float = 600.0) -> list[Place]:
    """A corridor: 600 m north, then as far again at 45 degrees to the east, there and back, each line to the right."""
    half = math.sqrt(0.5)
    out: list[Place] = []
    for k in range(count):
        d = apart * k
        # The bend of a line at this distance to the right lies on the bisector.
        corner = (d, 600.0 - d * math.tan(math.radians(22.5)))
        end = (second * half + d * half, 600.0 + second * half - d * half)
        line = [(d, 0.0), corner, end]
        if lead:
            line = [(d, -lead), *line, (end[0] + lead * half, end[1] + lead * half)]
        out += line if k % 2 == 0 else reversed(line)
    return out


def test_lines_that_bend_are_lines_as_a_whole() -> None:
    """Neither their straight parts, with the others for turn-arounds, nor nothing."""
    for second in (300.0, 600.0):
        [found] = surveys(bent(second=second))
        assert [(line.first, line.last) for line in found.lines] == [(0, 2), (3, 5), (6, 8)]
    assert found.offsets == pytest.approx([0.0, 60.0, 120.0], abs=0.5)
    assert (found.spacing, math.degrees(found.course)) == pytest.approx((60.0, 0.0), abs=0.5)
    assert found.turn_arounds() == [(2, 3), (5, 6)]
    assert found.transitions() == [(0, 0), (2, 3), (5, 6), (8, 8)]


def test_places_along_and_beside_a_line_that_bends() -> None:
    axis = LineAxis(np.array(bent(1)))
    places = np.array([[10.0, 300.0], [-20.0, -50.0], [300.0, 900.0], [600.0, 1200.0]])
    along, across, course = axis.project(places)
    half = math.sqrt(0.5)
    assert along == pytest.approx([300.0, -50.0, 600.0 + 600.0 * half, 600.0 + 1200.0 * half])
    assert across == pytest.approx([10.0, -20.0, 0.0, 0.0], abs=1e-9)
    assert np.degrees(course) == pytest.approx([0.0, 0.0, 45.0, 45.0])
    assert axis.points_at(np.array([300.0, 1200.0])) == pytest.approx(np.array([[0.0, 300.0], bent(1)[-1]]))


def test_two_lines_are_a_survey_with_the_camera_on() -> None:
    read, route = with_camera(*grid(count=2))
    [found] = find_surveys(route, camera_spacing(read, route))
    assert found.spacing == pytest.approx(60.0, abs=0.1)
    # A video is none.
    read, route = flown(grid(count=2), "2 2500 0 0 0 0 0 0 0")
    assert find_surveys(route, np.full(4, math.nan)) == ()


@pytest.mark.parametrize(("length", "lines"), [(11.0, 3), (9.0, 0)])
def test_a_line_has_ten_metres(length: float, lines: int) -> None:
    assert sum(len(found.lines) for found in surveys(grid(count=3, length=length, apart=5.0))) == lines


def on_all_along(places: Sequence[Place]) -> tuple[Mission, Route]:
    """The camera is switched on once, as QGroundControl does that is to take photos in turn-arounds, too."""
    (east, north), *others = places
    items = [wp(east, north), "2 206 25 0 1 0 0 0 0", *(wp(*place) for place in others)]
    read = mission(*items, home="36.5 -84.2 0")
    return read, make_route(read, ORIGIN, None, 15.0, False)


def test_leads_are_as_long_as_the_ground_station_says() -> None:
    """Of lines with waypoints each 30 m nobody else could tell."""
    lines = [[(60.0 * k, 30.0 * n) for n in range(-2, 12)] for k in range(3)]
    places = [place for k, line in enumerate(lines) for place in (line if k % 2 == 0 else reversed(line))]
    read, route = on_all_along(places)
    camera = camera_spacing(read, route)
    ends = {
        beyond: [(line.first, line.last) for line in find_surveys(route, camera, [(25.0, beyond)])[0].lines]
        for beyond in (60.0, 0.0, 45.0)
    }
    assert ends[60.0] == [(2, 11), (16, 25), (30, 39)]
    # No waypoint is there: the mission was changed since.
    assert ends[0.0] == ends[45.0] == [(0, 13), (14, 27), (28, 41)]
    read, route = on_all_along(grid(count=3, lead=100.0))
    [found] = find_surveys(route, camera_spacing(read, route), [(25.0, 30.0)])
    assert [(line.first, line.last) for line in found.lines] == [(1, 2), (5, 6), (9, 10)]
    # Of another way between photos nothing is said.
    read, route = on_all_along(places)
    assert find_surveys(route, camera, [(20.0, 60.0)])[0].lines[0].first == 0


def test_leads_between_a_camera_that_goes_on_with_the_first_line_and_off_with_the_last() -> None:
    """QGroundControl's camera for photos in turn-arounds, too, and leads laid out beyond its first line and last."""
    items = [wp(*place) for place in grid(count=3, lead=100.0)]
    items[2:2], items[12:12] = ["2 206 25 0 1 0 0 0 0"], ["2 206 0 0 1 0 0 0 0"]
    read = mission(*items, home="36.5 -84.2 0")
    route = make_route(read, ORIGIN, None, 15.0, False)
    [found] = find_surveys(route, camera_spacing(read, route))
    assert [(line.first, line.last) for line in found.lines] == [(1, 2), (5, 6), (9, 10)]


def test_a_plan_is_its_surveys_by_the_way_between_photos() -> None:
    read, route = with_camera(*grid())
    [found] = find_surveys(route, camera_spacing(read, route))
    mine, other, any_ = SurveyPlan(25.0000004, 30.0), SurveyPlan(20.0, 10.0), SurveyPlan(None)
    for plans, expected in (((other, mine), mine), ((other,), None), ((other, any_), any_), ((any_, mine), mine)):
        assert survey_plan(replace(read, survey_plans=plans), found.lines[0].photo) == expected
    # Two of one way between photos that differ are nobody's.
    assert survey_plan(replace(read, survey_plans=(mine, replace(mine, turn_around=5.0))), found.lines[0].photo) is None


def test_two_surveys_of_one_mission() -> None:
    crossed = [(east + 2000.0, north) for east, north in grid(turned_deg=90.0)]
    first, second = surveys([*grid(), *crossed])
    assert math.degrees(second.course - first.course) == pytest.approx(90.0, abs=0.1)


def _camera(k: int) -> str:
    """The item that switches the camera on at the first place of a line, and off at the second."""
    return f"2 206 {0 if k % 2 else 25} 0 1 0 0 0 0"


def with_camera(*places: Place) -> tuple[Mission, Route]:
    lines: list[str] = []
    for k, (east, north) in enumerate(places):
        lines += [wp(east, north), _camera(k)]
    read = mission(*lines, home="36.5 -84.2 0")
    return read, make_route(read, ORIGIN, None, 15.0, False)


def test_the_camera_between_photos() -> None:
    read, route = with_camera(*grid())
    assert camera_spacing(read, route).tolist() == [25.0, 0.0] * 4
    [found] = find_surveys(route, camera_spacing(read, route))
    assert all((line.photo, line.camera_on_at, line.camera_off_at) == (25.0, *line[:2]) for line in found.lines)


def test_the_course_of_the_first_line_is_not_that_of_the_way_to_it() -> None:
    """From 600 m south and 20 m west the way is on course 1.9 degrees, close enough for one straight run."""
    lines = [wp(-20, -600), *(line for k, place in enumerate(grid(count=3)) for line in (wp(*place), _camera(k)))]
    read = mission(*lines, home="36.5 -84.2 0")
    route = make_route(read, ORIGIN, None, 15.0, False)
    [found] = find_surveys(route, camera_spacing(read, route))
    assert (found.lines[0].begins, found.lines[0].first) == (0, 1)
    assert math.degrees(found.course) == pytest.approx(0.0, abs=0.1)


def gated_grid(photo: float = 25.0, *, in_turns: bool = False) -> tuple[Mission, Route]:
    """Lines of 800 m that QGroundControl begins and ends with gates, between turn-around waypoints 150 m beyond."""
    lines: list[str] = []
    for k, (east, north) in enumerate(grid(count=3, lead=150.0)):
        is_gate = k % 4 in (1, 2)
        lines.append(wp(east, north, command=4501 if is_gate else 16, p="0 1 0 0" if is_gate else "0 0 0 0"))
        if is_gate:
            lines.append(f"2 206 {photo if k % 4 == 1 or in_turns else 0} 0 1 0 0 0 0")
    read = mission(*lines, home="36.5 -84.2 0")
    return read, make_route(read, ORIGIN, None, 15.0, False, rules=RouteRules(reads_as_px4=True))


@pytest.mark.parametrize("in_turns", [False, True], ids=["camera off in turns", "camera on in turns"])
def test_gates_at_which_the_camera_is_switched_end_the_lines(in_turns: bool) -> None:
    """PX4 flies from one turn-around to the next: the gates at 0 m and 800 m bound 800 m of its 1,100 m."""
    read, route = gated_grid(in_turns=in_turns)
    camera = camera_spacing(read, route)
    [found] = find_surveys(route, camera, [(25.0, 150.0)])
    assert [(line.first, line.last, line.begins, line.ends) for line in found.lines] == [
        (1, 2, 0, 3),
        (5, 6, 4, 7),
        (9, 10, 8, 11),
    ]
    assert [line.photo for line in found.lines] == [25.0] * 3
    lengths = [math.dist(route.positions[line.first, :2], route.positions[line.last, :2]) for line in found.lines]
    assert lengths == pytest.approx([800.0] * 3, abs=0.1)
    if not in_turns:
        assert camera.tolist() == [0.0, 25.0, 0.0, 0.0] * 3
        assert [(line.camera_on_at, line.camera_off_at) for line in found.lines] == [(1, 2), (5, 6), (9, 10)]


def test_lines_between_gates_are_laid_out_otherwise() -> None:
    read, route = gated_grid()
    [found] = find_surveys(route, camera_spacing(read, route))
    assert fixed_layout_reason(read, route, found) == ""
    made = with_layout(read, route, found, SurveyLayout(200.0, every=2), ORIGIN)
    assert made is not None
    assert [item.command for item in made.items] == [16, 4501, 206, 4501, 206, 16] * 3
    again = make_route(made, ORIGIN, None, 15.0, False, rules=RouteRules(reads_as_px4=True))
    assert camera_spacing(made, again).tolist() == [0.0, 25.0, 0.0, 0.0] * 3
    assert again.positions[::4, :2] == pytest.approx(np.array([[0, -200], [120, 1000], [60, -200]]), abs=0.1)
    # Without turn-arounds, gates would lead nowhere.
    bare = with_layout(read, route, found, SurveyLayout(0.0, every=2), ORIGIN)
    assert bare is not None
    assert [item.command for item in bare.items] == [16, 206, 16, 206] * 3


def test_where_the_camera_is_switched_lines_are_where_it_is_on() -> None:
    """A way back beside the lines, and the downwind of a landing, are none."""
    lines = []
    for k, (east, north) in enumerate(grid(count=3)):
        lines += [wp(east, north), f"2 206 {0 if k % 2 else 25} 0 1 0 0 0 0"]
    read = mission(*lines, wp(180, 800), wp(180, 0), home="36.5 -84.2 0")
    route = make_route(read, ORIGIN, None, 15.0, False)
    [found] = find_surveys(route, camera_spacing(read, route))
    assert [(line.first, line.last) for line in found.lines] == [(0, 1), (2, 3), (4, 5)]


def test_a_camera_that_is_on_from_the_start_and_one_behind_a_pause() -> None:
    on, off, pause = "2 206 25 0 1 0 0 0 0", "2 206 0 0 1 0 0 0 0", "3 93 5 0 0 0 0 0 0"
    read = mission(on, wp(0, 0), wp(0, 800), pause, off, wp(500, 800), home="36.5 -84.2 0")
    route = make_route(read, ORIGIN, None, 15.0, False)
    assert camera_spacing(read, route).tolist() == [25.0, 0.0, 0.0]


def test_waypoints_at_equal_distances_along_a_line_are_no_leads() -> None:
    places = [(60.0 * k, 200.0 * (n if k % 2 == 0 else 4 - n)) for k in range(3) for n in range(5)]
    [found] = surveys(places)
    assert [(line.first, line.last) for line in found.lines] == [(0, 4), (5, 9), (10, 14)]


def places_of(read: Mission) -> np.ndarray:
    return np.array(make_route(read, ORIGIN, None, 15.0, False).positions)[:, :2]


def test_turn_arounds_are_laid_out_and_each_line_keeps_its_camera() -> None:
    read, route = with_camera(*grid(count=3))
    [found] = find_surveys(route, camera_spacing(read, route))
    assert min_turn_around(route, found) == 0.0
    made = with_layout(read, route, found, SurveyLayout(100.0), ORIGIN)
    assert made is not None
    assert places_of(made) == pytest.approx(np.array(grid(count=3, lead=100.0)), abs=0.05)
    steps = [item.command for item in made.items]
    assert steps == [16, 16, 206, 16, 206, 16] * 3
    assert [item.seq for item in made.items] == list(range(1, 19))
    again = make_route(made, ORIGIN, None, 15.0, False)
    [laid] = find_surveys(again, camera_spacing(made, again))
    assert min_turn_around(again, laid) == pytest.approx(100.0, abs=0.1)
    # From there to another: the old turn-arounds are gone.
    longer = with_layout(made, again, laid, SurveyLayout(150.0), ORIGIN)
    assert longer is not None
    assert places_of(longer) == pytest.approx(np.array(grid(count=3, lead=150.0)), abs=0.05)


def test_a_longer_lead_onto_the_first_line() -> None:
    """And what was laid out so is read as it was meant: leads of 100 m, and a way of 250 m onto the first."""
    read, route = flown(grid(count=3))
    [found] = find_surveys(route, camera_spacing(read, route))
    made = with_layout(read, route, found, SurveyLayout(100.0, lead_in=250.0), ORIGIN)
    assert made is not None
    assert places_of(made) == pytest.approx(np.array([(0.0, -250.0), *grid(count=3, lead=100.0)]), abs=0.05)
    again = make_route(made, ORIGIN, None, 15.0, False)
    [laid] = find_surveys(again, camera_spacing(made, again))
    assert [(line.first, line.last, line.begins, line.ends) for line in laid.lines] == [
        (2, 3, 0, 4),
        (6, 7, 5, 8),
        (10, 11, 9, 12),
    ]
    assert min_turn_around(again, laid) == pytest.approx(100.0, abs=0.1)
    # A shorter one is none.
    same = with_layout(read, route, found, SurveyLayout(100.0, lead_in=60.0), ORIGIN)
    assert same == with_layout(read, route, found, SurveyLayout(100.0), ORIGIN)


def test_every_second_line_goes_first_and_the_others_follow() -> None:
    read, route = flown(grid(count=5))
    [found] = find_surveys(route, camera_spacing(read, route))
    made = with_layout(read, route, found, SurveyLayout(0.0, every=2), ORIGIN)
    assert made is not None
    assert places_of(made)[::2, 0] == pytest.approx([0.0, 120.0, 240.0, 60.0, 180.0], abs=0.05)
    assert places_of(made)[:, 1] == pytest.approx(
        [0.0, 800.0, 800.0, 0.0, 0.0, 800.0, 800.0, 0.0, 0.0, 800.0], abs=0.05
    )


def test_lines_are_flown_from_the_other_side() -> None:
    read, route = with_camera(*grid(count=4))
    [found] = find_surveys(route, camera_spacing(read, route))
    made = with_layout(read, route, found, SurveyLayout(0.0, backwards=True), ORIGIN)
    assert made is not None
    assert places_of(made)[::2, 0] == pytest.approx([180.0, 120.0, 60.0, 0.0], abs=0.05)
    assert places_of(made)[:, 1] == pytest.approx([0.0, 800.0, 800.0, 0.0, 0.0, 800.0, 800.0, 0.0], abs=0.05)
    assert [item.command for item in made.items] == [16, 206, 16, 206] * 4
    # The camera is on along lines, and off between them, whichever way round they are.
    assert camera_spacing(made, make_route(made, ORIGIN, None, 15.0, False)).tolist() == [25.0, 0.0] * 4


def test_lines_on_another_course_cover_the_same_area() -> None:
    """180 m by 800 m: four lines of 800 m, or fourteen of 180 m, 60 m apart but for rounding of their number."""
    read, route = with_camera(*grid())
    [found] = find_surveys(route, camera_spacing(read, route))
    made = with_layout(read, route, found, SurveyLayout(0.0, course=math.radians(90.0)), ORIGIN)
    assert made is not None
    places = places_of(made)
    assert len(places) == 2 * round(800.0 / 60.0)
    assert np.hypot(*(places[1::2] - places[::2]).T) == pytest.approx(180.0, abs=0.5)
    assert np.diff(places[::2, 1]) == pytest.approx(60.0, abs=0.1)
    assert (places.min(axis=0) >= [-0.1, -0.1]).all()
    assert (places.max(axis=0) <= [180.1, 800.1]).all()
    assert [item.command for item in made.items] == [16, 206, 16, 206] * 13


def test_what_stands_around_a_survey_stays() -> None:
    around = [(-500.0, -300.0), *grid(count=3), (-500.0, -300.0), (-900.0, 0.0)]
    read, route = flown(around)
    [found] = find_surveys(route, camera_spacing(read, route))
    made = with_layout(read, route, found, SurveyLayout(50.0), ORIGIN)
    assert made is not None
    places = places_of(made)
    assert places[0] == pytest.approx([-500.0, -300.0], abs=0.05)
    assert places[-2:] == pytest.approx(np.array(around[-2:]), abs=0.05)
    assert len(places) == 12 + 3


def test_nothing_but_waypoints_is_laid_out() -> None:
    """A change of speed between two lines, and a loiter on one, would be lost."""
    for place, line in ((2, "2 178 0 15 -1 0 0 0 0"), (1, wp(0, 800, command=19, p="10 0 0 0"))):
        lines = [wp(east, north) for east, north in grid(lead=50.0)]
        lines[place + 2 : place + 2] = [line]
        read = mission(*lines, home="36.5 -84.2 0")
        route = make_route(read, ORIGIN, None, 15.0, False)
        for found in find_surveys(route, camera_spacing(read, route)):
            assert with_layout(read, route, found, SurveyLayout(100.0), ORIGIN) is None


@pytest.mark.parametrize(
    ("place", "line", "why"),
    [
        (2, "2 178 0 15 -1 0 0 0 0", ""),
        (4, "2 178 0 15 -1 0 0 0 0", "item 5, DO_CHANGE_SPEED, lies between two lines"),
        (4, wp(30, 900, command=17), "item 5, NAV_LOITER_UNLIM, lies between two lines"),
    ],
)
def test_why_a_layout_is_kept(place: int, line: str, why: str) -> None:
    """What is behind a waypoint of a line goes with it."""
    lines = [wp(east, north) for east, north in grid(lead=50.0)]
    lines[place:place] = [line]
    read, (_, route) = mission(*lines, home="36.5 -84.2 0"), flown(grid(lead=50.0))
    [found] = find_surveys(route, np.zeros(16))
    # The route of the plain grid, with the items of this mission: an endless loiter would end it.
    items = [item.seq for item in read.items if item.command == 16]
    route = route.with_fields(item=np.array(items))
    assert fixed_layout_reason(read, route, found) == why


def test_a_line_with_a_waypoint_of_another_kind_on_it_is_kept() -> None:
    commands = [82 if k == 4 else 16 for k in range(9)]
    places = [(60.0 * k, 400.0 * (n if k % 2 == 0 else 2 - n)) for k in range(3) for n in range(3)]
    items = [wp(east, north, command=command) for (east, north), command in zip(places, commands, strict=True)]
    read = mission(*items, home="36.5 -84.2 0")
    route = make_route(read, ORIGIN, None, 15.0, False)
    [found] = find_surveys(route, camera_spacing(read, route))
    assert fixed_layout_reason(read, route, found) == "item 5, NAV_SPLINE_WAYPOINT, lies on a line"


def test_a_take_off_where_the_first_line_begins_stays_before_it() -> None:
    """Its place is the first line's begin, with a waypoint there or without."""
    for more in ([], [wp(0, 0)]):
        items = [wp(0, 0, command=22), *more, *(wp(*place) for place in grid(count=3)[1:])]
        read = mission(*items, home="0 0 0")
        route = make_route(read, ORIGIN, None, 15.0, False)
        [found] = find_surveys(route, camera_spacing(read, route))
        made = with_layout(read, route, found, SurveyLayout(100.0), ORIGIN)
        assert made is not None
        assert [item.command for item in made.items] == [22] + [16] * 12
        assert places_of(made)[1:] == pytest.approx(np.array(grid(count=3, lead=100.0)), abs=0.05)


def test_what_is_at_the_place_of_the_last_lead_goes_with_it() -> None:
    """QGroundControl's survey over terrain ends each line twice."""
    places = [place for k, place in enumerate(grid(count=3, lead=30.0)) for _ in range(2 if k % 4 == 3 else 1)]
    read, route = flown([*places, (500.0, 500.0)])
    [found] = find_surveys(route, camera_spacing(read, route))
    made = with_layout(read, route, found, SurveyLayout(100.0), ORIGIN)
    assert made is not None
    assert places_of(made) == pytest.approx(np.array([*grid(count=3, lead=100.0), (500.0, 500.0)]), abs=0.05)


def test_leads_of_the_first_line_and_the_last_go_though_another_has_none() -> None:
    lines: list[str] = []
    for k, place in enumerate(grid(count=3, lead=30.0)):
        camera = [f"2 206 {25 if k % 4 == 1 else 0} 0 1 0 0 0 0"] if k % 4 in (1, 2) else []
        lines += [] if k == 4 else [wp(*place), *camera]
    read = mission(*lines, home="36.5 -84.2 0")
    route = make_route(read, ORIGIN, None, 15.0, False)
    [found] = find_surveys(route, camera_spacing(read, route))
    assert min_turn_around(route, found) == 0.0
    made = with_layout(read, route, found, SurveyLayout(100.0), ORIGIN)
    assert made is not None
    assert places_of(made) == pytest.approx(np.array(grid(count=3, lead=100.0)), abs=0.05)


def test_lines_that_bend_get_leads_along_their_ends() -> None:
    read, route = flown(bent())
    [found] = find_surveys(route, camera_spacing(read, route))
    made = with_layout(read, route, found, SurveyLayout(100.0), ORIGIN)
    assert made is not None
    assert places_of(made) == pytest.approx(np.array(bent(lead=100.0)), abs=0.05)
    turned = with_layout(read, route, found, SurveyLayout(0.0, backwards=True), ORIGIN)
    assert turned is not None
    assert places_of(turned)[:3] == pytest.approx(np.array(bent()[6:]), abs=0.05)
    # They cannot be laid on another course.
    assert with_layout(read, route, found, SurveyLayout(0.0, course=1.0), ORIGIN) is None


def test_a_mission_that_jumps_keeps_its_layout() -> None:
    read, route = flown(grid(), "2 177 1 1 0 0 0 0 0")
    assert Command.DO_JUMP in {item.command for item in read.items}
    found = find_surveys(route, camera_spacing(read, route))
    assert with_layout(read, route, found[0], SurveyLayout(50.0), ORIGIN) is None
    assert fixed_layout_reason(read, route, found[0]) == "the mission contains jumps"


def test_a_gate_that_is_not_flown_is_no_point_of_a_line() -> None:
    """ArduPlane flies to no gate: the gates on and after its lines are kept like the commands of the camera."""
    items: list[str] = []
    for k, (east, north) in enumerate(grid(count=3)):
        items += [wp(east, north), wp(east, 400, command=4501), f"2 206 {0 if k % 2 else 25} 0 1 0 0 0 0"]
    read = mission(*items, home="36.5 -84.2 0")
    route = make_route(read, ORIGIN, None, 15.0, False)
    [found] = find_surveys(route, camera_spacing(read, route))
    assert fixed_layout_reason(read, route, found) == ""
    for turn_around, commands in ((0.0, [16, 4501, 206] * 2), (100.0, [16, 16, 4501, 206, 16, 4501, 206, 16])):
        made = with_layout(read, route, found, SurveyLayout(turn_around, every=2), ORIGIN)
        assert made is not None
        assert [item.command for item in made.items] == commands * 3
    turned = with_layout(read, route, found, SurveyLayout(0.0, course=math.pi / 2.0), ORIGIN)
    assert turned is not None
    assert [item.command for item in turned.items][:6] == [16, 4501, 206] * 2


def test_a_survey_of_gates_alone_is_told_that_none_is_flown() -> None:
    """QGroundControl writes no waypoints for lines without turn-arounds."""
    gates: list[str] = []
    for k, (east, north) in enumerate(grid(count=3)):
        gates += [wp(east, north, command=4501), f"2 206 {0 if k % 2 else 25} 0 1 0 0 0 0"]
    rules = RouteRules(reads_as_px4=True)
    with pytest.raises(MissionError, match=r"gate \(CONDITION_GATE\): a survey with gates needs turn-arounds$"):
        make_route(mission(*gates, home="36.5 -84.2 0"), ORIGIN, None, 15.0, False, rules=rules)
    between = mission(wp(-300, 0), *gates, wp(-300, 900), home="36.5 -84.2 0")
    notes = make_route(between, ORIGIN, None, 15.0, False, rules=rules).notes
    reason = "no autopilot flies to a gate (CONDITION_GATE): a survey with gates needs turn-arounds"
    assert f"items 2, 4, 6 and 3 more: passed at more than 10 m, because {reason}" in notes
    _, route = gated_grid()
    assert not any("gate" in note for note in route.notes)
