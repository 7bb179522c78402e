"""What is a survey, and what is not; and its lines laid out otherwise."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from flight.mission.items import Command, Mission
from flight.mission.route import Route, make_route
from flight.mission.survey_layout import SurveyLayout, turn_around_of, with_layout
from flight.mission.surveys import Survey, camera_spacing, find_surveys
from tests.mission_lines import ORIGIN, mission, wp

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


def test_two_surveys_of_one_mission() -> None:
    crossed = [(east + 2000.0, north) for east, north in grid(turned_deg=90.0)]
    first, second = surveys([*grid(), *crossed])
    assert math.degrees(second.course - first.course) == pytest.approx(90.0, abs=0.1)


def with_camera(*places: Place) -> tuple[Mission, Route]:
    lines: list[str] = []
    for k, (east, north) in enumerate(places):
        lines += [wp(east, north), f"2 206 {0 if k % 2 else 25} 0 1 0 0 0 0"]
    read = mission(*lines, home="36.5 -84.2 0")
    return read, make_route(read, ORIGIN, None, 15.0, False)


def test_the_camera_between_photos() -> None:
    read, route = with_camera(*grid())
    assert camera_spacing(read, route).tolist() == [25.0, 0.0] * 4
    [found] = find_surveys(route, camera_spacing(read, route))
    assert all((line.photo, line.switched_on, line.switched_off) == (25.0, True, True) for line in found.lines)


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
    return np.array(make_route(read, ORIGIN, None, 15.0, False).waypoints)[:, :2]


def test_turn_arounds_are_laid_out_and_each_line_keeps_its_camera() -> None:
    read, route = with_camera(*grid(count=3))
    [found] = find_surveys(route, camera_spacing(read, route))
    assert turn_around_of(route, found) == 0.0
    made = with_layout(read, route, found, SurveyLayout(100.0), ORIGIN)
    assert made is not None
    assert places_of(made) == pytest.approx(np.array(grid(count=3, lead=100.0)), abs=0.05)
    steps = [item.command for item in made.items]
    assert steps == [16, 16, 206, 16, 206, 16] * 3
    assert [item.seq for item in made.items] == list(range(1, 19))
    again = make_route(made, ORIGIN, None, 15.0, False)
    [laid] = find_surveys(again, camera_spacing(made, again))
    assert turn_around_of(again, laid) == pytest.approx(100.0, abs=0.1)
    # From there to another: the old turn-arounds are gone.
    longer = with_layout(made, again, laid, SurveyLayout(150.0), ORIGIN)
    assert longer is not None
    assert places_of(longer) == pytest.approx(np.array(grid(count=3, lead=150.0)), abs=0.05)


def test_every_second_line_goes_there_and_the_others_come_back() -> None:
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


def test_a_mission_that_jumps_keeps_its_layout() -> None:
    read, route = flown(grid(), "2 177 1 1 0 0 0 0 0")
    assert Command.DO_JUMP in {item.command for item in read.items}
    found = find_surveys(route, camera_spacing(read, route))
    assert with_layout(read, route, found[0], SurveyLayout(50.0), ORIGIN) is None
