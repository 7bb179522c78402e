"""A route holds copies of what it was given, locked, and knows its legs."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from aircraft.path_limits import Limits
from flight.dynamics.envelope_tables import load_envelope
from flight.mission.itinerary import NO_ITEM
from flight.mission.placing import implied_scenario
from flight.mission.return_path import ReturnCircle
from flight.mission.route import (
    END_LEG_LENGTH_M,
    ROUTE_POINT,
    Route,
    RouteRules,
    fly_over_waypoints,
    make_route,
    part_of_route,
    route_points,
    with_end_courses,
)
from flight.mission_files.formats import mission_text, parse_mission, read_mission
from flight.simulation.setup import make_limits
from tests.mission_lines import ORIGIN, ground, mission, refusal, route, setup_of, wp
from tests.setups import small_scenario
from world.errors import MissionError
from world.geometry import leg_courses
from world.kernels import Records, field_names
from world.scenario import Scenario


def three_points() -> Records:
    """Three waypoints and the two legs between them."""
    return route_points(
        [[0.0, 0.0, 500.0], [0.0, 900.0, 500.0], [800.0, 900.0, 550.0]],
        [25.0, 27.0],
        acceptance_radius=[0.0, 30.0, 0.0],
        fly_over=[False, True, False],
        item=[NO_ITEM, 1, 2],
    )


def test_a_leg_is_between_two_waypoints() -> None:
    route = Route(three_points(), "on the ground")
    assert (route.legs, route.leg_airspeeds.tolist()) == (2, [25.0, 27.0])


def test_what_a_point_does_not_state() -> None:
    points = route_points(np.eye(3), 25.0)
    assert points["item"].tolist() == [NO_ITEM] * 3
    # Points without an item belong to no common stop.
    assert points["stop"].tolist() == [0, 1, 2]
    for name in ("fly_over", "acceptance_radius", "arc_radius"):
        assert not points[name].any()
    for name in ("above_ground", "min_ground_speed", "home_up"):
        assert np.isnan(points[name]).all()


@pytest.mark.parametrize("name", field_names(ROUTE_POINT))
def test_points_are_a_locked_copy(name: str) -> None:
    given = three_points()
    route = Route(given, "on the ground")
    with pytest.raises(ValueError, match="read-only"):
        route.points[name][1] = 1
    given[name] = 1 - given[name].astype(np.int64) if name == "fly_over" else given[name] + 1
    np.testing.assert_array_equal(route.points[name], three_points()[name])


def test_other_values_in_some_fields_are_those_of_another_route() -> None:
    route = Route(three_points(), "on the ground")
    other = route.with_fields(airspeed=[20.0, 21.0], fly_over=True)
    assert (other.leg_airspeeds.tolist(), other.fly_over.tolist()) == ([20.0, 21.0], [True] * 3)
    assert (route.leg_airspeeds.tolist(), route.fly_over.tolist()) == ([25.0, 27.0], [False, True, False])
    assert other.items.tolist() == route.items.tolist()


def test_the_legs_of_an_rtl_end_where_it_joins_the_landing_sequence() -> None:
    way = np.array([[0.0, 1000.0 * k, 300.0] for k in range(5)])
    route = Route(route_points(way, 25.0, item=[1, 2, 3, 3, 4]), "")
    assert list(route.rtl_legs) == []
    circle = ReturnCircle(0.0, 0.0, 300.0, 80.0)
    # Waypoints 2 and 3 are of item 3, the RTL, and waypoint 4 is of the landing sequence.
    joined = replace(route, rtl_start=1, rtl_loiter=circle)
    assert (joined.rtl_end, list(joined.rtl_legs)) == (4, [1, 2, 3])
    alone = part_of_route(joined, 0, 3)
    assert (alone.rtl_end, list(alone.rtl_legs)) == (4, [1, 2])


def test_no_leg_leads_to_the_first_waypoint_of_a_part() -> None:
    part = part_of_route(Route(three_points(), "on the ground"), 1, 2)
    assert (part.leg_airspeeds.tolist(), math.isnan(part.points["airspeed"][0])) == ([27.0], True)


# ----------------------------------------------------------------------
# A waypoint whose fly-by arc would pass beyond its acceptance radius is flown over; by how much is a plain sum.

RADIUS = 25.0**2 / (9.80665 * math.tan(math.radians(30.0)))


@pytest.fixture(scope="module")
def limits() -> Limits:
    return make_limits(small_scenario(), load_envelope(load_aircraft("aerosonde")), 25.0, math.radians(30.0))


def corner(turn: float) -> np.ndarray:
    return np.array([[0, 0, 500], [0, 5000, 500], [5000 * math.sin(turn), 5000 + 5000 * math.cos(turn), 500]], float)


@pytest.mark.parametrize("turn_deg", [30.0, 90.0, 120.0, 150.0, 170.0])
def test_an_acceptance_just_below_and_just_above_where_the_arc_passes(turn_deg: float, limits: Limits) -> None:
    turn = math.radians(turn_deg)
    passes = RADIUS / math.cos(turn / 2.0) - RADIUS
    for acceptance, misses in ((passes - 0.01, True), (passes + 0.01, False), (0.0, turn_deg > 150.0)):
        radii = [1.0, acceptance, 1.0]
        found = fly_over_waypoints(route_points(corner(turn), 25.0, acceptance_radius=radii), limits)
        assert found.tolist() == [False, misses, False]


def test_the_faster_leg_draws_the_arc_and_without_limits_there_is_none(limits: Limits) -> None:
    points = route_points(corner(math.radians(90.0)), [20.0, 30.0])
    passes = 30.0**2 / 25.0**2 * RADIUS * (math.sqrt(2.0) - 1.0)
    for acceptance, misses in ((passes - 0.01, True), (passes + 0.01, False)):
        points["acceptance_radius"][1] = acceptance
        assert fly_over_waypoints(points, limits)[1] == misses
    points["acceptance_radius"] = 1.0
    assert not fly_over_waypoints(points, None).any()


def test_an_autopilot_flies_on_to_its_own_distance_before_a_corner_whose_arc_would_miss_it(limits: Limits) -> None:
    turn = math.radians(120.0)
    passes = RADIUS / math.cos(turn / 2.0) - RADIUS
    for distance, misses in ((passes - 0.01, True), (passes + 0.01, False)):
        asked = []

        def turn_distance(angle: float, amsl: float, distance: float = distance, asked: list = asked) -> float:
            asked.append((round(angle, 9), amsl))
            return distance

        found = fly_over_waypoints(route_points(corner(turn), 25.0), limits, turn_distance)
        assert found.tolist() == [False, misses, False]
        assert asked == [(round(turn, 9), 500.0)]
        rules = RouteRules(turn_distance=turn_distance)
        lines = (wp(0, 0), wp(0, 5000), wp(5000 * math.sin(turn), 5000 + 5000 * math.cos(turn)))
        assert make_route(mission(*lines), ORIGIN, None, 25.0, False, limits, rules).fly_over[1] == misses


@pytest.mark.parametrize("turn_deg", [149.0, 151.0, 165.0, 174.0, 179.9, 180.0, -180.0, -165.0])
def test_guidance_that_follows_the_path_flies_over_reversals(turn_deg: float, limits: Limits) -> None:
    found = fly_over_waypoints(route_points(corner(math.radians(turn_deg)), 25.0), limits)
    assert found.tolist() == [False, abs(turn_deg) > 150.0, False]


def test_a_route_flies_over_what_its_arc_would_miss(limits: Limits) -> None:
    places = (wp(0, 0), wp(0, 3000, p="0 {} 0 0"), wp(3000, 3000))
    for acceptance, over in ((10.0, True), (60.0, False), (0.0, False)):
        lines = [line.format(acceptance) for line in places]
        route = make_route(mission(*lines), ORIGIN, None, 25.0, False, limits)
        assert route.fly_over.tolist() == [False, over, False]


# ----------------------------------------------------------------------
# End courses: a lead-in and a lead-out leg give a route the courses its scenario asks for, and only then.

SETUP = setup_of(wp(0, 0), wp(0, 2000))


def ends(**courses: float) -> tuple[Route, Scenario]:
    """The route north, and a scenario with its ends and these courses."""
    route = SETUP.route
    start, destination = route.positions[0], route.positions[-1]
    return route, replace(SETUP.scenario, start=start, destination=destination, **courses)


@pytest.mark.parametrize("turn_deg", [-90.0, 30.0, 90.0, 135.0])
def test_the_route_starts_on_the_course_far_enough_for_the_turn(turn_deg: float) -> None:
    course = math.radians(turn_deg)
    route, scenario = ends(start_course=course)
    longer = with_end_courses(route, scenario, SETUP.limits)
    assert longer.legs == route.legs + 1
    assert float(leg_courses(longer.positions)[0]) == pytest.approx(course, abs=1e-4)
    assert longer.positions[0, 2] == route.positions[0, 2]
    # R = 625 / (9.80665 tan 30) = 110.39 m; the tangent of a sharp turn counts as two radii at most.
    length = 110.39 * min(math.tan(abs(course) / 2.0), 2.0) + END_LEG_LENGTH_M
    assert math.dist(longer.positions[0], longer.positions[1]) == pytest.approx(length, abs=0.1)
    assert longer.items.tolist() == [-1, *route.items.tolist()]
    assert f"from a lead-in leg of {length:.0f} m" in longer.started


def test_a_return_stays_where_it_began_behind_a_lead_in_leg() -> None:
    route, scenario = ends(start_course=1.0)
    back = replace(route, rtl_start=1, rtl_loiter=ReturnCircle(0.0, 0.0, 400.0, 80.0))
    longer = with_end_courses(back, scenario, SETUP.limits)
    assert (longer.rtl_start, longer.rtl_loiter) == (2, back.rtl_loiter)
    assert with_end_courses(route, scenario, SETUP.limits).rtl_start is None


def test_the_route_ends_on_the_course() -> None:
    route, scenario = ends(destination_course=math.pi / 2.0)
    longer = with_end_courses(route, scenario, SETUP.limits)
    assert float(leg_courses(longer.positions)[-1]) == pytest.approx(math.pi / 2.0, abs=1e-4)
    assert longer.items.tolist() == [*route.items.tolist(), -1]
    assert longer.started == route.started


def test_other_routes_stay_as_they_are() -> None:
    route, scenario = ends(start_course=0.0)
    assert with_end_courses(route, scenario, SETUP.limits) is route, "no turn"
    route, scenario = ends()
    assert with_end_courses(route, scenario, SETUP.limits) is route, "no course"
    away = replace(scenario, start=scenario.start + np.array([50.0, 0.0, 0.0]), start_course=1.0)
    assert with_end_courses(route, away, SETUP.limits) is route, "another start"


# ----------------------------------------------------------------------
# Routes: what is flown, at which heights, where it starts, and what is noted or refused.

SAMPLES = Path(__file__).parents[1] / "missions"


def test_heights_over_an_unknown_home_count_from_sea_level() -> None:
    mission = read_mission(SAMPLES / "endless.waypoints")
    scenario = implied_scenario(mission, None).scenario
    route = make_route(mission, scenario.origin, None, 25.0, False)
    assert route.positions[0, 2] == mission.items[0].alt
    assert any("measured from 0 m AMSL" in note for note in route.notes)


def test_a_route_starts_at_the_first_position_or_over_home() -> None:
    plain = route(wp(0, 500, 120), wp(0, 1500, 150))
    assert plain.positions[0] == pytest.approx([0.0, 500.0, 420.0], abs=0.01)
    assert plain.started.startswith(
        "no take-off item, so the flight starts in the air, trimmed, at the first position (item 1): 36.504"
    )
    assert plain.started.endswith("420.0 m AMSL, on course 0 degrees")
    over_home = route("3 22 15 0 0 0 0 0 80", wp(900, 0))
    assert over_home.positions[0] == pytest.approx([0.0, 0.0, 380.0], abs=0.01)
    assert over_home.items.tolist() == [1, 2]
    assert over_home.started.startswith(
        "NAV_TAKEOFF (item 1) is not flown from the ground: the flight starts in the air, trimmed, over home at this"
        " item's altitude"
    )
    own_place = route(wp(0, 700, 80, command=22), wp(900, 700))
    assert own_place.items.tolist() == [-1, 1, 2]
    assert own_place.positions[:2] == pytest.approx(np.array([[0, 0, 380], [0, 700, 380]]), abs=0.01)
    same_place = route(wp(0, 0, 80, command=84), wp(900, 700))
    assert same_place.items.tolist() == [1, 2]


def test_a_take_off_without_home_starts_at_the_first_position() -> None:
    """Home at 0, 0 means none: the first position item stands for it."""
    flown = route(wp(0, 700, 80, command=22), wp(900, 700), home="0 0 0", terrain=ground())
    assert flown.items.tolist() == [1, 2]
    assert flown.positions[0] == pytest.approx([0.0, 700.0, 380.0], abs=0.01)
    assert "over the first position (there is no home)" in flown.started
    assert re.search(r"home has no altitude, so .* used: .* AMSL at 36\.506", flown.notes[-1])


def test_heights_of_every_frame_are_amsl() -> None:
    flown = route(
        wp(0, 100, 450, frame=0),
        wp(0, 900, 450, frame=5),
        wp(0, 1900, 150, frame=3),
        wp(0, 2900, 150, frame=6),
        wp(0, 3900, 140, frame=10),
        wp(0, 4900, 140, frame=11),
        terrain=ground(310.0),
    )
    assert flown.positions[:, 2].tolist() == pytest.approx([450, 450, 450, 450, 450, 450])
    # Those above terrain are held along the legs to them.
    assert flown.points["above_ground"].tolist() == pytest.approx([math.nan] * 4 + [140.0, 140.0], nan_ok=True)


def test_a_home_off_the_ground_is_noted() -> None:
    flown = route(wp(0, 100), wp(0, 900), home="36.5 -84.2 0", terrain=ground())
    assert "home is at 0.0 m AMSL, but the ground there is at 300.0 m" in flown.notes[0]
    # The difference and the altitude to set, beyond the error of elevation files.
    flown = route(wp(0, 100), wp(0, 900), home="36.5 -84.2 328", terrain=ground())
    assert "After arming on that ground they are 28 m lower than here" in flown.notes[0]
    assert flown.notes[0].endswith("set home to 300.0 m AMSL")
    for home, is_noted in ((310.1, True), (309.9, False), (290.1, False), (289.9, True)):
        flown = route(wp(0, 100), wp(0, 900), home=f"36.5 -84.2 {home}", terrain=ground())
        assert any("the ground there" in note for note in flown.notes) is is_noted


def test_cruise_speed_is_no_command() -> None:
    flown = make_route(read_mission(SAMPLES / "qgc_amsl.plan"), ORIGIN, None, 25.0, False)
    assert set(flown.leg_airspeeds.tolist()) == {25.0}
    assert "cruiseSpeed 15 m/s is only the ground station's planning value" in flown.notes[-1]


def test_stops_at_one_position_are_merged() -> None:
    flown = route(wp(0, 0), wp(0, 900), wp(0.3, 900.3), wp(0, 900), wp(900, 900))
    assert flown.items.tolist() == [1, 2, 5]
    assert flown.notes == ("items 3-4: merged with item 2, which has the same position",)
    assert "item 3: 150.0 m straight above item 2" in refusal(wp(0, 0), wp(0, 900), wp(0, 900, 250), wp(900, 900))


def test_refusals_name_the_item() -> None:
    assert "no item has a position" in refusal("2 178 0 25 -1 0 0 0 0")
    assert "1 position to fly to" in refusal(wp(0, 0))
    assert "1 position to fly to" in refusal(wp(0, 0), wp(0, 0))
    assert (
        "item 1: height above terrain (frame 10) at latitude 36.50000, longitude -84.20000: requires terrain"
    ) in refusal(wp(0, 0, frame=10), wp(0, 900))
    assert "has no data there" in refusal(wp(0, 0), wp(0, 9000, frame=10), terrain=ground())
    assert "item 2: 9400.0 m AMSL: allowed -500..9000" in refusal(wp(0, 0), wp(0, 900, 9100))
    # Swapped columns that are both within range end on another continent.
    assert "item 2: latitude -84" in refusal(wp(0, 0), "3 16 0 0 0 0 -84.2 36.5 100")


def test_null_in_a_plan_keeps_what_is() -> None:
    """NaN means "as it is now": no position is none to fly to, no altitude keeps the last."""
    data = json.loads(mission_text(mission(wp(0, 0), wp(0, 900), wp(900, 900, 180)), "plan"))
    first, second, third = (item["params"] for item in data["mission"]["items"])
    second[4:6] = [None, None]
    third[6] = None
    flown = make_route(parse_mission(json.dumps(data), "a.plan"), ORIGIN, None, 25.0, False)
    assert flown.items.tolist() == [1, 3]
    assert flown.positions[:, 2].tolist() == [400.0, 400.0]
    assert "item 2: NAV_WAYPOINT without a position" in flown.notes[0]
    assert flown.notes[1] == "item 3: NAV_WAYPOINT without an altitude is flown at the altitude of the previous item"
    first[6] = None
    with pytest.raises(MissionError, match="item 1: no altitude, and no earlier item has one to keep"):
        make_route(parse_mission(json.dumps(data), "a.plan"), ORIGIN, None, 25.0, False)


def test_circles_are_flown_by_whatever_the_waypoints_are() -> None:
    read = mission(wp(0, 0, p="0 40 0 0"), wp(0, 900, p="0 -3 0 0"), wp(900, 900, command=18, p="1 2 80 0"))
    flown = make_route(read, ORIGIN, None, 25.0, True)
    assert flown.points["acceptance_radius"][:2].tolist() == [40.0, 0.0]
    assert not flown.points["acceptance_radius"][2:].any()
    assert flown.fly_over.tolist() == (flown.arc_radii == 0.0).tolist()
    assert flown.fly_over[:2].all()
