"""Ways from the ground and to it, over level ground and past walls of known height: what is found, and what is said."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planfly.workflow.uav import load_uav
from planner.plan import Certificate, Plan
from planner.search.lay_ground_ways import FinalModel, add_departure_and_approach
from tests.setups import spec_around
from world.arrays import Floats
from world.geometry import leg_courses, leg_runs
from world.scenario import Scenario, scenario_from_spec
from world.terrain import Terrain, make_gridded_terrain

Ground = Callable[[Floats, Floats], Floats]

BASE, HALF, GRID = 100.0, 6000.0, 20.0
PATH = np.array([[0.0, 0.0, 300.0], [0.0, 2500.0, 300.0], [0.0, 5000.0, 300.0]])
FIELD = {"east_m": 2000.0, "north_m": 2500.0}
CALM = {"speed_mps": 0.0, "from_deg": 0.0}
# A glide flown as it is laid out, at 22 m/s.
LAW = FinalModel(airspeed=lambda tail, amsl: 22.0, slope=lambda height, run, tail, amsl: height / run)


def level(east: Floats, north: Floats) -> Floats:
    return np.full(np.broadcast(east, north).shape, BASE)


def terrain_of(heights: Ground) -> Terrain:
    axis = np.arange(-HALF - 1000.0, HALF + 1000.0 + GRID, GRID)
    made = np.broadcast_to(heights(axis[None, :], axis[:, None]), (axis.size, axis.size))
    return make_gridded_terrain(np.array(made), axis, axis, source="walls", sha256="", datum="mean sea level")


def scenario_of(heights: Ground = level, **tables: Any) -> Scenario:
    made: dict[str, Any] = {
        "area": {"east_m": [-HALF, HALF], "north_m": [-HALF, HALF], "ceiling_amsl_m": 2000.0},
        "limits": {"min_clearance_m": 30.0},
        "flight": {"guidance": "path"},
        "wind": CALM,
        "home": {"east_m": 0.0, "north_m": 0.0},
    }
    spec = spec_around(PATH, buffer=0.0, ceiling=2000.0, **made | tables)
    return scenario_from_spec(spec, "made", ground=terrain_of(heights))


@cache
def limits() -> Limits:
    return load_uav(scenario_of(launch={"method": "hand"})).limits


def laid(heights: Ground = level, law: FinalModel = LAW, **tables: Any) -> Plan:
    scenario = scenario_of(heights, **tables)
    certificate = Certificate(0.1, 100.0, 0.1, 50.0, 500.0, 100.0, ())
    zeros = np.zeros(4)
    plan = Plan(scenario, PATH, zeros, zeros, certificate, 1, "umda", 10, np.zeros((1, 3)))
    return add_departure_and_approach(plan, replace(limits(), wind=scenario.wind), law)


def degrees(course: float) -> float:
    return math.degrees(course) % 360.0


CATAPULT = {"launch": {"method": "catapult"}}
NORTH = {"launch": {"method": "catapult", "course_deg": 0.0}}


def test_a_plan_that_stays_in_the_air_stays_as_it_is() -> None:
    plan = laid()
    assert plan.procedures is None
    assert plan.feasible


def test_the_climb_is_flown_from_the_ground_at_seven_tenths_of_the_steepest() -> None:
    plan = laid(**NORTH)
    assert plan.feasible
    assert plan.procedures is not None
    climb = plan.procedures.climb
    assert climb is not None
    assert climb.home.tolist() == [0.0, 0.0, BASE]
    # 30 m of clearance, 5 m that the certificate keeps, and 2 m: below the 40 m that a take-off climbs at the least.
    assert climb.up == BASE + 40.0
    steepest = math.tan(limits().with_margin().slopes(climb.course, 300.0)[0])
    assert climb.gradient <= 0.7 * steepest + 1e-9
    way = np.concatenate([climb.home[None], climb.waypoints, PATH[:1]])
    assert degrees(float(leg_courses(way)[0])) == pytest.approx(degrees(climb.course), abs=1e-6)
    reached = BASE + np.cumsum(climb.gradient * leg_runs(way))
    assert (reached >= way[1:, 2] - 1e-6).all()
    # Never below the take-off's height, and no first leg that is over before that is reached.
    assert (climb.waypoints[:, 2] >= climb.up).all()
    assert leg_runs(way)[0] * climb.gradient > 40.0


@pytest.mark.parametrize("course_deg", [60.0, 120.0, 180.0, 215.0, 270.0, 330.0])
def test_what_the_take_off_leaves_of_its_leg_holds_the_turn_at_its_end(course_deg: float) -> None:
    """It is over after four fifths of the way to its height; a turn by 90 degrees takes its radius of the leg."""
    plan = laid(launch={"method": "catapult", "course_deg": course_deg})
    assert plan.procedures is not None
    climb = plan.procedures.climb
    assert climb is not None
    way = np.concatenate([climb.home[None], climb.waypoints, PATH[:1]])
    left = leg_runs(way)[0] - 0.8 * (climb.up - BASE) / climb.gradient
    turn = abs(math.remainder(float(np.diff(leg_courses(way))[0]), math.tau))
    made = limits()
    radius = made.airspeed**2 / (9.80665 * math.tan(made.max_bank))
    assert left >= radius * math.tan(0.5 * turn)


@pytest.mark.parametrize("course_deg", [0.0, 60.0, 120.0, 180.0, 215.0, 270.0, 330.0])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_what_a_drifting_take_off_leaves_of_its_leg_holds_the_turn_at_its_end(course_deg: float, side: float) -> None:
    """A slow take-off climbs 40 m at 0.16 of 25 m/s, in 10 s, and drifts by 0.8 of a crosswind of 8 m/s.

    The forecast is wrong by 1.95 m/s either way.
    """
    wind = {"speed_mps": 8.0, "from_deg": (course_deg + side * 90.0) % 360.0}
    ways = laid(launch={"method": "catapult", "course_deg": course_deg}, wind=wind).procedures
    assert ways is not None
    climb = ways.climb
    assert climb is not None
    assert climb.up == BASE + 40.0
    course, made = math.radians(course_deg), limits()
    along, right = (
        np.array([math.sin(course), math.cos(course)]),
        np.array([math.cos(course), -math.sin(course)]),
    )
    way = np.concatenate([climb.home[None], climb.waypoints, PATH[:1]])[:, :2]
    radius = made.airspeed**2 / (9.80665 * math.tan(made.max_bank))
    for crosswind in (8.0 - 1.95, 8.0 + 1.95):
        # Wind from the right drifts the aircraft to the left.
        drifted = 10.0 * 25.0 * along - side * 0.8 * 10.0 * crosswind * right
        leg = way[1] - drifted
        turn = abs(math.remainder(float(np.diff(leg_courses(np.stack([drifted, *way[1:3]])))[0]), math.tau))
        assert turn <= math.radians(120.0) + 1e-9
        assert math.hypot(*leg) >= radius * math.tan(0.5 * turn)


def test_the_way_to_the_line_up_leaves_room_for_the_error_of_the_elevation_file() -> None:
    """30 m of clearance, 5 m that the certificate keeps, and 1.645 standard deviations of 5.5 m: 44 m."""
    ways = laid(landing=FIELD | {"course_deg": 90.0}).procedures
    assert ways is not None
    assert ways.descent is not None
    heights = np.concatenate([ways.descent.waypoints, ways.descent.final_waypoints])[:, 2] - BASE
    assert heights.min() >= 44.0


def test_an_approach_without_room_for_the_error_of_the_elevation_file_is_still_laid_out() -> None:
    """A stated final that begins 37.5 m above the ground leaves 7.5 m above the clearance, and no other is tried."""
    ways = laid(
        landing=FIELD | {"course_deg": 90.0, "approach_m": 500.0, "slope_deg": math.degrees(math.atan(0.075))}
    ).procedures
    assert ways is not None
    assert ways.descent is not None
    assert float(ways.descent.final_waypoints[0, 2]) - BASE == pytest.approx(37.5)


def test_a_stated_launch_course_is_flown_and_an_own_one_has_no_wind_from_behind() -> None:
    stated = laid(launch={"method": "catapult", "course_deg": 215.0}).procedures
    assert stated is not None
    assert stated.climb is not None
    assert degrees(stated.climb.course) == pytest.approx(215.0)
    for from_deg in (90.0, 270.0):
        windy = laid(wind={"speed_mps": 6.0, "from_deg": from_deg}, **CATAPULT).procedures
        assert windy is not None
        assert windy.climb is not None
        assert math.cos(windy.climb.course - math.radians(from_deg)) >= -0.1


def ring(top: float, gap: float = math.inf) -> Ground:
    """A wall about home, 300 m away, but where the bearing is within 25 degrees of a gap (degrees)."""

    def heights(east: Floats, north: Floats) -> Floats:
        away, bearing = np.hypot(east, north), np.degrees(np.arctan2(east, north))
        off = np.abs((bearing - (0.0 if math.isinf(gap) else gap) + 180.0) % 360.0 - 180.0)
        is_wall = (np.abs(away - 300.0) < 45.0) & ((off > 25.0) | math.isinf(gap))
        return np.where(is_wall, top, BASE)

    return heights


def test_a_launch_towards_unknown_terrain_is_refused_for_that() -> None:
    """The stated launch course leads north; the terrain is known only south of 100 m north of home."""
    known = laid(
        lambda east, north: np.where(north > 100.0, np.nan, BASE), launch={"method": "hand", "course_deg": 0.0}
    )
    assert known.certificate.problems[0].endswith(": course 0° (leads over unknown terrain)")


def test_out_of_a_ring_the_launch_leads_through_its_gap_and_without_one_the_plan_says_so() -> None:
    through = laid(ring(200.0, gap=120.0), **CATAPULT)
    assert through.feasible, through.certificate.problems
    assert through.procedures is not None
    assert through.procedures.climb is not None
    assert degrees(through.procedures.climb.course) == pytest.approx(120.0, abs=12.0)
    none = laid(ring(200.0), **CATAPULT)
    assert not none.feasible
    assert none.procedures is not None
    assert none.procedures.climb is None
    assert len(none.certificate.problems) == 1
    said = none.certificate.problems[0]
    assert said.startswith("climb-out: none of 36 launch courses is clear of ground, missiles and zones at 70% of the")
    assert "m too low above the ground" in said
    # A stated course is the only one that is tried.
    assert (
        laid(ring(200.0, gap=120.0), launch={"method": "hand", "course_deg": 300.0})
        .certificate.problems[0]
        .startswith("climb-out: the launch course is not clear")
    )


def test_a_wall_just_under_the_climb_is_passed_and_one_just_into_it_is_not() -> None:
    steepest = math.tan(limits().with_margin().slopes(0.0, 300.0)[0])
    # Of the height that was climbed half is to be left.
    clear = BASE + 0.5 * 0.7 * steepest * 255.0
    for top, free in ((clear - 2.0, True), (clear + 3.0, False)):
        assert laid(ring(top), **NORTH).feasible is free, top


def test_a_launch_into_a_missile_is_none() -> None:
    battery = {"east_m": 0.0, "north_m": 0.0, "amsl_m": 50.0, "kill_radius_m": 120.0, "kill_scale_m": 30.0}
    plan = laid(threats=[battery], **CATAPULT)
    assert not plan.feasible
    assert "inside a missile's reach" in plan.certificate.problems[0]


def test_what_is_flown_stays_and_is_not_laid_out_again() -> None:
    before = laid(**NORTH)
    assert before.procedures is not None
    # Meanwhile walls stand about home.
    flown = replace(before, scenario=scenario_of(ring(200.0), **NORTH), flown_legs=1, procedures=None)
    again = add_departure_and_approach(flown, limits(), LAW, before.procedures.climb)
    assert again.procedures is not None
    assert again.procedures.climb is before.procedures.climb
    assert again.feasible


def test_a_high_start_is_climbed_to_in_laps() -> None:
    high = {"start": {"east_m": 0.0, "north_m": 0.0, "amsl_m": 900.0}}
    scenario = scenario_of(**NORTH, **high, destination={"east_m": 0.0, "north_m": 5000.0, "amsl_m": 900.0})
    path = PATH + np.array([0.0, 0.0, 600.0])
    certificate, zeros = Certificate(0.1, 100.0, 0.1, 50.0, 500.0, 100.0, ()), np.zeros(4)
    plan = Plan(scenario, path, zeros, zeros, certificate, 1, "umda", 10, np.zeros((1, 3)))
    found = add_departure_and_approach(plan, limits(), LAW)
    assert found.feasible, found.certificate.problems
    assert found.procedures is not None
    assert found.procedures.climb is not None
    way = np.concatenate([found.procedures.climb.home[None], found.procedures.climb.waypoints, path[:1]])
    assert leg_runs(way).sum() * found.procedures.climb.gradient >= 800.0 - 1e-6


# ----------------------------------------------------------------------
# The descent.


def test_the_final_is_flown_into_the_wind_to_the_ground_below_the_field() -> None:
    for from_deg in (0.0, 200.0):
        plan = laid(landing=FIELD, wind={"speed_mps": 5.0, "from_deg": from_deg})
        assert plan.feasible, plan.certificate.problems
        assert plan.procedures is not None
        down = plan.procedures.descent
        assert down is not None
        assert degrees(down.course) == pytest.approx(from_deg, abs=1e-6)
        assert down.point.tolist() == [2000.0, 2500.0, BASE]
        begin, last = down.final_waypoints
        assert begin[2] == last[2]
        run = math.dist(last[:2], down.point[:2])
        assert (last[2] - BASE) / run == pytest.approx(down.slope)
        for place in (begin, last):
            bearing = math.atan2(down.point[0] - place[0], down.point[1] - place[1])
            assert degrees(bearing - down.course + 1.0) == pytest.approx(math.degrees(1.0), abs=1e-6)
        # No steeper than PX4 takes by default, and over the ground as high as the scenario asks for.
        assert down.slope <= math.tan(math.radians(5.0))
        assert last[2] >= BASE + 30.0


def test_a_stated_final_is_kept_and_one_that_is_too_steep_is_named() -> None:
    stated = FIELD | {"course_deg": 45.0, "approach_m": 1100.0, "slope_deg": 4.0}
    plan = laid(landing=stated)
    assert plan.procedures is not None
    down = plan.procedures.descent
    assert down is not None
    assert degrees(down.course) == pytest.approx(45.0)
    assert math.dist(down.final_waypoints[1, :2], down.point[:2]) == pytest.approx(1100.0)
    assert math.degrees(math.atan(down.slope)) == pytest.approx(4.0)
    able = GLIDE_SHARE * math.tan(limits().slopes(math.radians(45.0), BASE, 22.0)[1])
    most = math.degrees(math.atan(able))
    for slope, ok in ((most - 0.05, True), (most + 0.05, False)):
        tried = laid(landing=stated | {"slope_deg": slope})
        assert tried.feasible is ok, slope
    assert "the approach needs a descent angle of" in tried.certificate.problems[0]


# The share of the steepest dive that a glide takes.
GLIDE_SHARE = 0.85


def ridge(top: float) -> Ground:
    """A ridge across the final from the south, 400 m before the field."""
    return lambda east, north: np.where(np.abs(north - 2100.0) < 25.0, top, BASE) + 0.0 * east


def test_a_ridge_under_the_final_makes_it_steeper_or_is_named() -> None:
    into = {"landing": FIELD | {"course_deg": 0.0}}
    low, high = laid(ridge(BASE + 10.0), **into), laid(ridge(BASE + 38.0), **into)
    assert low.feasible, low.certificate.problems
    assert low.procedures is not None
    assert low.procedures.descent is not None
    # 375 m before the point the glide is 10 m over a ridge of 10 m, at 3.1 degrees or more.
    assert low.procedures.descent.slope * 375.0 > 20.0
    assert not high.feasible
    assert high.certificate.problems[0].startswith("landing: on a course of 0°, a final approach of")
    assert "too low above the ground" in high.certificate.problems[0]


def test_a_strip_that_slopes_too_much_is_named_with_the_side() -> None:
    for along, slope, ok in ((True, 0.095, True), (True, 0.105, False), (False, 0.095, True), (False, 0.105, False)):

        def tilted(east: Floats, north: Floats, along: bool = along, slope: float = slope) -> Floats:
            off = (north - 2500.0) if along else (east - 2000.0)
            return BASE + slope * np.clip(off, -150.0, 150.0) + 0.0 * (east + north)

        plan = laid(tilted, landing=FIELD | {"course_deg": 0.0})
        said = " ".join(plan.certificate.problems)
        assert ("landings are planned on slopes" in said) is not ok, (along, slope, said)
        if not ok:
            assert ("along its course" in said) is along


def test_the_go_around_is_higher_over_a_mound_behind_the_field() -> None:
    def mound(east: Floats, north: Floats) -> Floats:
        # Below the climb, 400 m beyond the landing point, and within 30 m of the way back at 80 m.
        return np.where((np.abs(east - 2400.0) < 15.0) & (np.abs(north - 2500.0) < 200.0), BASE + 54.0, BASE)

    into = {"landing": FIELD | {"course_deg": 90.0}}
    found = []
    for heights in (level, mound):
        ways = laid(heights, **into).procedures
        assert ways is not None
        assert ways.descent is not None
        found.append(ways.descent.go_around)
        # Field and home are at one height; it climbs 30 m over the line-up, in steps of 10 m.
        up = float(ways.descent.final_waypoints[0, 2]) - BASE
        assert up + 30.0 <= found[0] < up + 40.0
    assert (found[0], found[1]) == (80.0, 90.0)


def test_a_field_higher_than_home_has_its_go_around_count_from_home() -> None:
    def plateau(east: Floats, north: Floats) -> Floats:
        return np.where(east > 800.0, 180.0, BASE) + 0.0 * north

    ways = laid(plateau, landing=FIELD | {"course_deg": 0.0}).procedures
    assert ways is not None
    assert ways.descent is not None
    assert ways.descent.go_around >= 80.0 + 50.0
