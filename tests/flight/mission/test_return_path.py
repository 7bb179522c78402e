"""Where a return to launch goes and the way that is drawn for it, by plain sums."""

import math

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.mission.items import Command
from flight.mission.itinerary import ENDLESS_LOITER_TIME_S, RoutePoint
from flight.mission.return_path import (
    DEFAULT_RETURN_RULES,
    ReturnAbility,
    ReturnPoint,
    ReturnRules,
    ReturnTarget,
    choose_target,
    rtl_note,
    rtl_waypoints,
)
from flight.mission.route import RouteRules, make_route
from tests.mission_lines import ORIGIN, mission, refusal, route, setup_of, wp
from world.frames import to_geo

HOME = ReturnPoint(0.0, 0.0, 300.0)
RALLY = [ReturnPoint(0.0, 4000.0, 400.0, 300.0), ReturnPoint(3000.0, 6000.0, 500.0)]
STOP = RoutePoint(7, int(Command.NAV_RETURN_TO_LAUNCH), 0.0, 0.0, math.nan, 0, 25.0)
ABLE = ReturnAbility(lambda a, b, up: 100.0, 120.0, 0.1, 0.08, math.radians(30.0), 25.0)


@pytest.mark.parametrize(
    ("here", "rules", "name", "up"),
    [
        # 2 km and 3 km from the rally points, 6 km from home.
        ((0.0, 6000.0, 900.0), ReturnRules(), "rally point 1", 400.0),
        ((2500.0, 6000.0, 900.0), ReturnRules(), "rally point 2", 500.0),
        # The nearest is 2 km away: within a limit of 2 km, beyond one of 1.9 km, and then home, however far.
        ((0.0, 6000.0, 900.0), ReturnRules(rally_limit=2000.0), "rally point 1", 400.0),
        ((0.0, 6000.0, 900.0), ReturnRules(rally_limit=1900.0), "home", 400.0),
        ((0.0, 60_000.0, 900.0), ReturnRules(), "home", 400.0),
        ((0.0, 60_000.0, 900.0), ReturnRules(rally_limit=0.0), "rally point 2", 500.0),
        # Home is the nearest of all, and counts only where it is to.
        ((0.0, 1500.0, 900.0), ReturnRules(), "rally point 1", 400.0),
        ((0.0, 1500.0, 900.0), ReturnRules(includes_home=True), "home", 400.0),
        ((0.0, 2500.0, 900.0), ReturnRules(includes_home=True), "rally point 1", 400.0),
        # At 250 m over home, or at the present height.
        ((0.0, 1500.0, 900.0), ReturnRules(height=250.0, includes_home=True), "home", 550.0),
        ((0.0, 1500.0, 900.0), ReturnRules(height=math.nan, includes_home=True), "home", 900.0),
    ],
)
def test_the_nearest_rally_point_or_home(
    here: tuple[float, float, float], rules: ReturnRules, name: str, up: float
) -> None:
    target = choose_target(rules, here, HOME, RALLY)
    assert (target.name, target.position[2]) == (name, up)
    assert target.slope_base == 0.0


def test_without_rally_points_it_goes_home() -> None:
    target = choose_target(ReturnRules(rally_limit=1.0), (3000.0, 4000.0, 900.0), HOME, [])
    assert target == ReturnTarget((0.0, 0.0, 400.0), "home", "", 5000.0)


def test_the_height_of_a_rally_point_may_be_counted_from_the_sea_for_the_slope() -> None:
    rules = ReturnRules(slope_to_stated_height=True, rally_limit=0.0)
    assert choose_target(rules, (0.0, 5000.0, 900.0), HOME, RALLY).slope_base == 300.0
    # One that is stated above the sea is not.
    assert choose_target(rules, (3000.0, 6000.0, 900.0), HOME, RALLY).slope_base == 0.0


def test_why_it_goes_there_is_said() -> None:
    far = choose_target(ReturnRules(rally_limit=1900.0), (0.0, 6000.0, 900.0), HOME, RALLY)
    assert rtl_note(far, ReturnRules(), 900.0) == (
        "NAV_RETURN_TO_LAUNCH returns to home, 6.0 km away (rally point 1, the nearest, is 2.0 km away, 100 m"
        " beyond RALLY_LIMIT_KM 1.9), descending 500 m on a straight slope to 400 m AMSL;"
        " the simulated flight ends after 60 s of the loiter there"
    )
    climb = choose_target(ReturnRules(includes_home=True), (0.0, 1500.0, 380.0), HOME, RALLY)
    told = rtl_note(climb, ReturnRules(initial_climb=50.0), 380.0)
    assert "1.0 km nearer than rally point 1, which is 2.5 km away (RALLY_INCL_HOME 1)" in told
    first = "banks no more than 5 degrees before it has climbed 50 m, even above that height;"
    assert f"climbing 20 m at once to 400 m AMSL; {first}" in told
    assert f"descending 500 m on a straight slope to 400 m AMSL; {first}" in rtl_note(
        climb, ReturnRules(initial_climb=50.0), 900.0
    )
    assert "before it has climbed 20 m" in rtl_note(climb, ReturnRules(initial_climb=math.inf), 380.0)
    assert "banks" not in rtl_note(far, ReturnRules(initial_climb=math.inf), 900.0)
    # At its height already, give or take what a height is known to: how long it banks little is anybody's guess.
    for up in (399.6, 400.0, 400.4):
        level = rtl_note(climb, ReturnRules(initial_climb=math.inf), up)
        assert "at 400 m AMSL; banks no more than 5 degrees until it is above that height;" in level


@pytest.mark.parametrize(
    ("north", "text"),
    [
        # Between home and rally point 1, 4 km from home: the distances differ by 2 * 17 m = 34 m, and by 0.4 m.
        (1983.0, "home, 2.0 km away (34 m nearer than rally point 1, which is 2.0 km away"),
        (1999.8, "home, 2.0 km away (as near as rally point 1, which is 2.0 km away"),
    ],
)
def test_distances_that_round_to_the_same_text_are_told_apart(north: float, text: str) -> None:
    rules = ReturnRules(includes_home=True)
    assert text in rtl_note(choose_target(rules, (0.0, north, 900.0), HOME, RALLY), rules, 900.0)


# ----------------------------------------------------------------------
# The way.


def laid(
    course: float, target: tuple[float, float, float], rules: ReturnRules = DEFAULT_RETURN_RULES, base: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Waypoints (n, 3) from 500 m up at the origin, flown to on a course (degrees), and their arcs (n,)."""
    back = math.radians(course)
    before = [
        STOP.placed_at((-1000.0 * math.sin(back), -1000.0 * math.cos(back), 500.0)),
        STOP.placed_at((0.0, 0.0, 500.0)),
    ]
    there = ReturnTarget(target, "home", "", math.hypot(*target[:2]), base)
    points = rtl_waypoints(before, STOP, there, rules, ABLE)
    return np.array([(0.0, 0.0, 500.0), *(p.map_position for p in points)]), np.array(
        [0.0, *(p.arc_radius for p in points)]
    )


@pytest.mark.parametrize("course", [-170.0, -90.0, -30.0, -2.0, 0.0, 2.0, 30.0, 90.0, 170.0])
def test_the_turn_goes_the_short_way_and_touches_both_ends(course: float) -> None:
    way, arcs = laid(course, (0.0, 8000.0, 500.0))
    turning = np.flatnonzero(arcs == 100.0)
    courses = np.arctan2(*np.diff(way[:, :2], axis=0).T)
    turned = np.degrees(np.abs(np.unwrap(courses)[: turning.size + 1] - math.radians(course)))
    # To the left circle's or the right one's tangent: 8 km away that is a degree or two off the bearing.
    assert turned.max() < abs(course) + 3.0
    if turning.size:
        # Each corner's arc touches the legs beside it: they are as long as two tangents.
        steps = np.hypot(*np.diff(way[: turning.size + 1, :2], axis=0).T)
        assert steps[0] == pytest.approx(0.5 * steps[1] if turning.size > 1 else steps[0], rel=1e-6)
    # The straight way ends on the circle, 120 m from the target, and goes on around it to the right.
    circle = way[arcs == 120.0]
    out = np.hypot(circle[:, 0], circle[:, 1] - 8000.0)
    assert np.allclose(out, out[0])
    assert np.allclose(out * math.cos(math.radians(22.5)), 120.0, rtol=0.02)
    around = np.diff(np.unwrap(np.arctan2(circle[:, 0], circle[:, 1] - 8000.0)))
    assert (around > 0.0).all()
    assert around.sum() * 120.0 == pytest.approx(ENDLESS_LOITER_TIME_S * 25.0, rel=0.08)


def test_a_radius_below_the_aircrafts_is_flown_as_its_own_and_to_its_side() -> None:
    for radius, flown in ((60.0, 120.0), (-60.0, 120.0), (-300.0, 300.0)):
        way, arcs = laid(0.0, (0.0, 8000.0, 500.0), ReturnRules(radius=radius))
        circle = way[arcs == flown]
        around = np.diff(np.unwrap(np.arctan2(circle[:, 0], circle[:, 1] - 8000.0)))
        assert (np.sign(around) == math.copysign(1.0, radius)).all()


def test_a_descent_is_straight_in_distance_and_no_steeper_than_can_be_flown() -> None:
    way, arcs = laid(0.0, (0.0, 8000.0, 100.0))
    straight = way[arcs == 0.0]
    assert straight[:, 2] == pytest.approx(500.0 - 400.0 * straight[:, 1] / 8000.0, abs=0.5)
    # 400 m in 2 km are more than 0.08: what is left is sunk on the circle, to the target's height and not below.
    way, arcs = laid(0.0, (0.0, 2000.0, 100.0))
    joins = int(np.flatnonzero(arcs == 120.0)[0])
    assert way[joins, 2] == pytest.approx(500.0 - 0.08 * 2000.0, abs=5.0)
    steps = np.hypot(*np.diff(way[:, :2], axis=0).T)
    assert (-np.diff(way[:, 2]) <= 0.08 * steps + 1e-9).all()
    assert way[-1, 2] == 100.0
    assert (np.diff(way[:, 2]) <= 0.0).all()
    # A sink rate of 1 m/s at 25 m/s is 0.04.
    slow, _ = laid(0.0, (0.0, 2000.0, 100.0), ReturnRules(max_sink_rate=1.0))
    assert (-np.diff(slow[:, 2]) <= 0.04 * np.hypot(*np.diff(slow[:, :2], axis=0).T) + 1e-9).all()


def test_a_climb_begins_at_once_and_ends_on_the_way() -> None:
    way, arcs = laid(0.0, (0.0, 8000.0, 700.0))
    top = way[(arcs == 0.0) & (way[:, 2] == 700.0)][0]
    assert top[1] == pytest.approx(2000.0, abs=20.0)
    assert (way[1:, 2] >= way[:-1, 2]).all()
    # One that is not over at the circle goes on there.
    way, arcs = laid(0.0, (0.0, 1000.0, 700.0))
    assert way[int(np.flatnonzero(arcs == 120.0)[0]), 2] < 620.0
    assert way[-1, 2] == 700.0


def test_the_slope_to_a_rally_point_holds_the_height_first() -> None:
    # 200 m too high at its beginning, of 400 m: level until (1 - p) 600 = 400.
    level, arcs = laid(90.0, (8000.0, 0.0, 100.0), base=200.0)
    plain, _ = laid(90.0, (8000.0, 0.0, 100.0))
    held = level[arcs == 0.0][1]
    assert (held[0], held[2]) == (pytest.approx(8000.0 / 3.0, abs=1.0), pytest.approx(500.0))
    assert plain[-1, 2] == level[-1, 2] == 100.0
    way, arcs = laid(-90.0, (8000.0, 0.0, 100.0), base=200.0)
    assert (way[arcs == 100.0][:, 2] == 500.0).all()


def test_a_climb_before_the_turn_is_a_wide_arc() -> None:
    wide = 100.0 * math.tan(math.radians(30.0)) / math.tan(math.radians(5.0))
    # 30 m at a slope of 0.1: 300 m of it.
    way, arcs = laid(180.0, (0.0, 8000.0, 700.0), ReturnRules(initial_climb=30.0))
    gentle = np.isclose(arcs, wide)
    assert gentle.any()
    end = int(np.flatnonzero(gentle)[-1]) + 1
    angle = 2.0 * math.asin(math.hypot(*way[end, :2]) / (2.0 * wide))
    assert angle * wide == pytest.approx(300.0, abs=1.0)
    assert (arcs == 100.0).any()
    # All that is missing, 200 m, is 2 km of it: most of the turn.
    assert not (laid(90.0, (0.0, 8000.0, 700.0), ReturnRules(initial_climb=math.inf))[1] == 100.0).any()
    # Nothing is climbed on the way down to a height that is below already.
    assert not np.isclose(laid(90.0, (0.0, 8000.0, 300.0), ReturnRules(initial_climb=math.inf))[1], wide).any()


@pytest.mark.parametrize("target", [510.0, 300.0])
@pytest.mark.parametrize("course", [90.0, 3.0])
def test_a_climb_before_the_turn_is_flown_to_a_lower_target_too(course: float, target: float) -> None:
    """ArduPlane demands RTL_CLIMB_MIN and 10 m above its start (`Plane::update_alt`), and turns from there as usual."""
    way, arcs = laid(course, (0.0, 8000.0, target), ReturnRules(initial_climb=30.0))
    flown = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way[:, :2], axis=0).T))])
    top = int(np.argmax(way[:, 2]))
    assert way[top, 2] == pytest.approx(530.0, abs=0.1)
    # 30 m at a slope of 0.1, be it within the turn or, where that is short, on the straight leg after it.
    # The corners of an arc lie outside it, by up to 2 %.
    assert flown[top] == pytest.approx(300.0, rel=0.02)
    assert (arcs[top:] == 100.0).any() == (course == 90.0)
    # From there on the slope leads down to the target.
    middle = float(np.interp(0.5 * (flown[top] + flown[arcs == 120.0][0]), flown, way[:, 2]))
    assert middle == pytest.approx(0.5 * (530.0 + target), abs=5.0 if target == 300.0 else 11.0)
    assert way[-1, 2] == target


@pytest.mark.parametrize("away", [0.0, 30.0, 119.0, 125.0, 180.0, 260.0, 400.0])
@pytest.mark.parametrize("course", [0.0, 90.0, 179.0])
def test_a_target_near_by_is_circled_whatever_the_course(away: float, course: float) -> None:
    way, arcs = laid(course, (0.0, away, 450.0))
    legs = np.hypot(*np.diff(way[:, :2], axis=0).T)
    assert legs.min() > 0.5
    circle = way[arcs == 120.0]
    assert np.hypot(circle[:, 0], circle[:, 1] - away).max() < 135.0
    assert way[-1, 2] == 450.0


def test_a_small_fall_is_a_step_at_once() -> None:
    # 14 m at 0.08 are 175 m; 16 m are a slope of 8 km.
    way, arcs = laid(0.0, (0.0, 8000.0, 486.0))
    down = way[(arcs == 0.0) & (way[:, 2] == 486.0)][0]
    assert down[1] == pytest.approx(14.0 / 0.08, abs=20.0)
    # What counts is the slope that is drawn.
    lower = ReturnRules(min_slope_height=10.0)
    for up, rules, base in (
        (484.0, DEFAULT_RETURN_RULES, 0.0),
        (486.0, lower, 0.0),
        (486.0, DEFAULT_RETURN_RULES, 5.0),
    ):
        slope, _ = laid(0.0, (0.0, 8000.0, up), rules, base)
        assert not ((slope[:, 1] < 7000.0) & (slope[:, 2] < up + 2.0)).any()
    step = choose_target(ReturnRules(), (0.0, 6000.0, 414.0), HOME, [])
    assert "descending 14 m at once to 400 m AMSL" in rtl_note(step, ReturnRules(), 414.0)


# ----------------------------------------------------------------------
# In a route.


def rally_line(east: float, north: float, alt: float) -> str:
    lat, lon = to_geo(ORIGIN, east, north)
    return f"3 5100 0 0 0 0 {float(lat):.7f} {float(lon):.7f} {alt}"


RTL = "0 20 0 0 0 0 0 0 0"


def test_a_route_goes_back_where_its_rules_say() -> None:
    flown = route(wp(0, 3000, 400), wp(2000, 3000, 400), RTL)
    assert (flown.rtl_start, flown.items.tolist()[:3]) == (1, [1, 2, 3])
    assert flown.rtl_loiter is not None
    assert flown.rtl_loiter[:4] == pytest.approx((0.0, 0.0, 400.0, 80.0), abs=0.01)
    assert flown.positions[-1, 2] == pytest.approx(400.0, abs=0.01)


@pytest.mark.parametrize("radius", [50.0, -200.0])
def test_the_circle_of_a_return_is_drawn_with_its_stated_radius_as_flown_at_its_height(radius: float) -> None:
    """`AP_L1_Control::loiter_radius`: the radius grows with the square of the ratio of true to equivalent airspeed."""
    law = ArduPlane(ArduPilotParameters.defaults().changed(WP_LOITER_RAD=50.0, RTL_RADIUS=radius, RTL_ALTITUDE=100.0))
    setup = setup_of(wp(0, 3000, 400), wp(2000, 3000, 400), RTL)
    for limits in (None, setup.limits):
        laid_out = make_route(setup.mission, ORIGIN, setup.scenario.terrain, 25.0, False, limits, law.route_rules)
        # The standard atmosphere at 400 m AMSL; an aircraft that flies 25 m/s turns no tighter than 110 m.
        expected = abs(radius) * (1.0 - 2.25577e-5 * 400.0) ** -4.25588
        if limits is not None:
            expected = max(expected, limits.turn_radius(0.0, math.pi, 400.0, 25.0))
        assert laid_out.arc_radii[-2] == pytest.approx(expected, rel=1e-4)
        assert laid_out.rtl_loiter is not None
        assert laid_out.rtl_loiter.radius == radius


def test_a_rally_point_is_named_by_its_place_in_the_file() -> None:
    # The first, at 0, 0, is none.
    nowhere = "3 5100 0 0 0 0 0 0 90"
    flown = route(wp(0, 3000, 400), wp(2000, 3000, 400), RTL, nowhere, rally_line(2000, 2000, 90))
    assert any("to rally point 2, 1.0 km away (the nearest rally point)" in note for note in flown.notes), flown.notes
    two = route(wp(0, 3000), wp(2000, 3000), RTL, nowhere, rally_line(-5000, 0, 90), rally_line(2000, 2000, 90))
    assert any("to rally point 3, 1.0 km away (the nearest of 2 rally points)" in note for note in two.notes), two.notes


def test_a_speed_that_was_set_does_not_count_on_the_way_back() -> None:
    flown = route(wp(0, 500), "2 178 0 22 -1 0 0 0 0", wp(0, 2500), RTL)
    assert flown.leg_airspeeds[0] == 22.0
    assert (flown.leg_airspeeds[1:] == 25.0).all()


def test_a_return_from_over_home_is_flown() -> None:
    flown = route(wp(0, 0, 300), wp(0, 900, 300), wp(0, 0, 300), RTL)
    assert flown.rtl_start == 2
    assert flown.positions[-1, 2] == pytest.approx(400.0, abs=0.01)


def test_a_height_that_is_never_flown_is_refused() -> None:
    message = refusal(wp(0, 500, 100, frame=0), wp(0, 2500, 100, frame=0), RTL, home="36.5 -84.2 8950")
    assert message == "a.waypoints: item 3: return to home: 9050.0 m AMSL: allowed -500..9000"


def test_a_return_that_holds_its_height_comes_down_over_its_target() -> None:
    rules = ReturnRules(holds_height=True, transit_height=100.0)
    begin = [STOP.placed_at((0.0, 9000.0, 900.0)), STOP.placed_at((0.0, 8000.0, 900.0))]
    target = choose_target(rules, begin[-1].map_position, HOME, ())
    ups = [point.map_position[2] for point in rtl_waypoints(begin, STOP, target, rules, ABLE)]
    # Level until the circle about home, down to 100 m over it there.
    assert (ups[0], ups[-1]) == (900.0, 400.0)
    assert rtl_note(target, rules, 900.0).startswith(
        "NAV_RETURN_TO_LAUNCH returns to home, 8.0 km away, level, and descending 500 m in a loiter there, to"
        " 400 m AMSL; the"
    )
    low = choose_target(rules, (0.0, 8000.0, 350.0), HOME, ())
    assert ", climbing 50 m first, to 400 m AMSL" in rtl_note(low, rules, 350.0)


def test_a_return_climbs_first_and_descends_over_its_target_to_another_height() -> None:
    """Home is 300 m up: it climbs to 300 m over it, and descends to 100 m; it never ends higher than it flew."""
    rules = ReturnRules(holds_height=True, transit_height=300.0)
    begin = [STOP.placed_at((0.0, 9000.0, 350.0)), STOP.placed_at((0.0, 8000.0, 350.0))]
    target = choose_target(rules, begin[-1].map_position, HOME, ())
    assert (target.transit_altitude, target.position[2]) == (600.0, 400.0)
    ups = [point.map_position[2] for point in rtl_waypoints(begin, STOP, target, rules, ABLE)]
    assert (max(ups), ups[-1]) == (600.0, 400.0)
    assert ", climbing 250 m first, to 600 m AMSL, and descending 200 m in a loiter there, to 400 m AMSL;" in rtl_note(
        target, rules, 350.0
    )
    lower = choose_target(
        ReturnRules(height=200.0, holds_height=True, transit_height=50.0), (0.0, 8000.0, 320.0), HOME, ()
    )
    assert (lower.transit_altitude, lower.position[2]) == (350.0, 350.0)


def test_a_landing_that_counts_as_a_place_to_return_to_is_noted() -> None:
    lines = wp(0, 3000), wp(2000, 3000), RTL, wp(0, 0, 0, command=21)
    told = (
        "item 3: the autopilot may also return to the mission's landing, which is not simulated. The simulated RTL goes"
        " to home"
    )

    def notes(rules: ReturnRules, *items: str) -> tuple[str, ...]:
        return make_route(mission(*items), ORIGIN, None, 25.0, False, rules=RouteRules(rules)).notes

    assert told in notes(ReturnRules(may_use_landing=True), *lines)
    assert told not in notes(ReturnRules(may_use_landing=True), *lines[:3])
    assert told not in notes(ReturnRules(), *lines)
