"""Ways from the ground and to it, past walls of known height: just over them, and just into them."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import GROUND_PATH, Finding
from logs.verdict.judge_geometry import judge_geometry
from logs.verdict.verdict import Verdict
from tests.logs.verdict.judging import of
from tests.mission_lines import ORIGIN, setup_of, wp
from tests.soak import scaled
from world.airfield import Launch
from world.airspace.zones import Cylinder, Zone, ZoneLevel
from world.arrays import Floats
from world.frames import to_geo
from world.scenario import load_scenario
from world.terrain import Terrain, make_gridded_terrain

Ground = Callable[[Floats, Floats], Floats]

HOME = "36.5 -84.2 100"
# m between nodes of the ground.
GRID = 10.0
FAR = (wp(0, 3000, 300), wp(1500, 3000, 300))
# By a take-off, and without one: 300 m over home.
TAKEOFF = ("3 22 15 0 0 0 0 0 300", *FAR)


def terrain_of(heights: Ground) -> Terrain:
    axis = np.arange(-4000.0, 4000.0 + GRID, GRID)
    made = np.broadcast_to(heights(axis[None, :], axis[:, None]), (axis.size, axis.size))
    return make_gridded_terrain(np.array(made), axis, axis, source="walls", sha256="", datum="mean sea level")


def wall(north: float, top: float, width: float = 1500.0, base: float = 100.0) -> Ground:
    """Level ground, and a wall across the way to the north, its top (m AMSL) on one row of nodes."""
    return lambda east, at: np.where((at == north) & (np.abs(east) <= width), top, base)


def over(heights: Ground, *lines: str, home: str = HOME, **tables: Any) -> FlightSetup:
    setup = setup_of(*lines, home=home, **tables)
    return replace(setup, scenario=replace(setup.scenario, terrain=terrain_of(heights)))


def with_arduplane(setup: FlightSetup) -> FlightSetup:
    return replace(setup, autopilot=ArduPlane(ArduPilotParameters.load(load_aircraft("aerosonde"))))


@cache
def climb() -> float:
    """Steepest climb of the Aerosonde at 25 m/s in still air, m per m."""
    return math.tan(setup_of(*FAR).envelope.air_angles(25.0, 100.0)[0])


def judged(rule: str, heights: Ground, *lines: str, **tables: Any) -> tuple[Finding, Verdict]:
    verdict = judge_geometry(over(heights, *lines, **tables))
    return of(verdict, rule), verdict


# ----------------------------------------------------------------------
# The climb-out.


def test_the_way_to_the_first_waypoint_is_left_open_where_a_wall_stands_in_it() -> None:
    # 300 m over home are reached after 1.2 km; after 1 km the climb is at 1,000 m times the climb.
    up = 100.0 + 1000.0 * climb()
    over_it, verdict = judged("climbout", wall(1000.0, up - 2.0), *FAR)
    assert (over_it.ok, over_it.planned) == (True, pytest.approx(2.0, abs=0.3))
    assert verdict.headline.startswith("flyable")
    into_it, verdict = judged("climbout", wall(1000.0, up + 2.0), *FAR)
    assert into_it.ok is None
    assert verdict.undecided
    assert (
        verdict.headline
        == "not judged in full: the flight starts in the air, but a straight climb from home to item 1 hits the ground"
    )
    assert into_it.reason.endswith(" even at the maximum climb angle: 1000 m from home it is 2 m below the surface")


def test_beyond_the_climb_the_way_to_the_first_waypoint_is_level() -> None:
    for top, ok in ((398.0, True), (402.0, None)):
        assert judged("climbout", wall(2500.0, top), *FAR)[0].ok is ok


def test_a_first_waypoint_that_is_too_near_to_be_reached_has_the_whole_way_climb() -> None:
    # 300 m over home 600 m away, twice as steep as it can: the rest is climbed there.
    up = 100.0 + 500.0 * climb()
    for top, ok in ((up - 2.0, True), (up + 2.0, None)):
        assert judged("climbout", wall(500.0, top), wp(0, 600, 300), *FAR)[0].ok is ok


def test_to_a_first_waypoint_below_home_it_climbs_20_metres_and_sinks() -> None:
    def hilltop(top: float) -> Ground:
        return lambda east, at: np.where(at == 500.0, top, np.where(at < 60.0, 100.0, 0.0)) + 0.0 * east

    # Up 20 m, and from there down to 50 m at 1 km.
    reached = 20.0 / climb()
    up = 120.0 - 70.0 * (500.0 - reached) / (1000.0 - reached)
    way = (wp(0, 1000, -50), wp(0, 2500, -50))
    assert judged("climbout", hilltop(up - 0.3), *way)[0].ok is True
    assert judged("climbout", hilltop(up + 0.3), *way)[0].ok is None


def test_a_take_off_into_a_wall_fails_and_one_that_only_its_steepest_climb_clears_is_left_open() -> None:
    steepest = 100.0 + 500.0 * climb()
    least = 100.0 + 0.7 * 500.0 * climb()
    for top, ok in ((steepest + 1.0, False), (steepest - 1.0, None), (least + 1.0, None), (least - 1.0, True)):
        found, verdict = judged("climbout", wall(500.0, top), *TAKEOFF)
        assert found.ok is ok, top
        # The take-off item states no course, which leaves the verdict open by itself.
        assert [item.rule for item in verdict.findings if item.check == GROUND_PATH and item.ok is None] == [
            "takeoff",
            *(["climbout"] if ok is None else []),
        ]
    failed, verdict = judged("climbout", wall(500.0, steepest + 30.0), *TAKEOFF)
    assert "the climb from home towards item 2 hits the ground" in verdict.headline
    assert failed.planned == pytest.approx(-30.0, abs=0.5)
    assert (
        " even at the maximum climb angle: 500 m from home it is 30 m below the surface. The climb angle is 14.1°. A "
    ) in failed.reason


@pytest.mark.parametrize("deviation_deg", [0.0, 3.1])
def test_a_climb_past_its_item_states_its_angle_and_its_end(deviation_deg: float) -> None:
    """An item 300 m away, a wall of 80 m after 400 m, and 100 m to climb: with 0.7 of 14.1°, or of 9.0°."""
    setup = over(wall(400.0, 180.0), "3 22 15 0 0 0 0 0 100", wp(0, 300, 100), wp(1500, 300, 100))
    envelope = replace(setup.envelope, climb_sd=math.radians(deviation_deg))
    found = of(judge_geometry(replace(setup, limits=replace(setup.limits, envelope=envelope))), "climbout")
    # 95 % of the aircraft climb more steeply than 1.645 standard deviations below the mean.
    certain = math.degrees(math.atan(climb())) - 1.645 * deviation_deg
    slope = 0.7 * math.tan(math.radians(certain))
    certain_text = "certain " if deviation_deg else ""
    reason = ". The steepest climb is 14.1°, but only 9.0° is certain"
    assert found.ok is None
    assert found.reason == (
        f"the climb from home towards item 2, at 70 % of the steepest {certain_text}climb, hits the ground: 400 m from"
        f" home it is {80.0 - 400.0 * slope:.0f} m below the surface. The climb angle is"
        f" {math.degrees(math.atan(slope)):.1f}°, and the climb ends 100 m above home after {100.0 / slope:.0f} m."
        f" Item 2 is only 300 m from home{f'{reason} for this aircraft' if deviation_deg else ''}"
    )


def test_courses_are_named_on_which_a_launch_would_climb_free() -> None:
    # On the course q the wall 500 m to the north is 500 / cos(q) m away: a climb that is 3 % short of it ahead clears
    # it from acos(1 / 1.03) = 13.9 degrees on.
    top = 100.0 + 1.03 * 500.0 * climb()
    assert judged("climbout", wall(500.0, top), *TAKEOFF)[0].reason.endswith(
        "A launch course of 020° to 340° would be clear of obstacles"
    )

    def basin(east: Floats, at: Floats) -> Floats:
        return np.where(np.hypot(east, at) > 300.0, 2000.0, 100.0)

    assert judged("climbout", basin, *TAKEOFF)[0].reason.endswith("No launch course is clear of obstacles")


def test_no_ground_stands_in_the_way_for_the_first_50_metres() -> None:
    for north, ok in ((40.0, True), (60.0, False)):
        assert judged("climbout", wall(north, 150.0), *TAKEOFF)[0].ok is ok


def test_a_take_off_climbs_on_until_it_is_on_its_first_leg() -> None:
    # From 100 m over home a leg climbs to 400 m at 3 km, by a tenth; the climb meets it at 100 / (climb - 0.1) m.
    lines = ("3 22 15 0 0 0 0 0 100", wp(0, 3000, 400), wp(1500, 3000, 400))
    joins = 100.0 / (0.7 * climb() - 0.1)
    assert 600.0 < joins < 3000.0
    # At 600 m the leg itself is at 160 m, and the least climb at 600 times it.
    up = 100.0 + 0.7 * 600.0 * climb()
    assert 100.0 < up - 100.0 < 160.0
    for top, ok in ((up + 1.0, None), (up - 1.0, True)):
        assert judged("climbout", wall(600.0, top), *lines)[0].ok is ok


@pytest.mark.parametrize(("home", "ok"), [(90.1, True), (89.9, None)])
def test_a_climb_out_from_a_home_below_the_ground_is_not_called_ok(home: float, ok: bool | None) -> None:
    """The ground is at 100 m; whether the legs are high enough is judged with this home."""
    found = of(judge_geometry(over(wall(2000.0, 100.0), *TAKEOFF, home=f"36.5 -84.2 {home}")), "climbout")
    assert (found.ok, found.check) == (ok, "")
    assert (found.reason == "home is 10 m below the ground there") is (ok is None)


def test_what_stands_in_the_first_leg_is_no_matter_of_the_climb_out() -> None:
    # At its steepest it is on the leg after 1.2 km, at its least after 1.7 km.
    found, verdict = judged("climbout", wall(2000.0, 900.0), *TAKEOFF)
    assert found.ok is True
    assert of(verdict, "clearance").ok is False


def test_a_take_off_with_a_place_of_its_own_climbs_towards_it() -> None:
    lines = (wp(1500, 0, 300, command=22), wp(1500, 3000, 300))
    heights = wall(500.0, 2000.0)
    assert judged("climbout", heights, *lines)[0].ok is True
    assert (
        judged("climbout", lambda east, north: np.where(east == 500.0, 2000.0, 100.0) + 0.0 * north, *lines)[0].ok
        is False
    )


def zoned(zone: Zone, *lines: str) -> Finding:
    setup = over(wall(0.0, 100.0), *lines)
    return of(judge_geometry(replace(setup, scenario=replace(setup.scenario, zones=(zone,)))), "climbout")


def test_a_zone_in_the_way_up_counts_as_ground_does() -> None:
    low = ZoneLevel(200.0, "amsl")
    town = Zone("town", "exclusion", Cylinder(0.0, 300.0, 100.0), ceiling=low)
    assert zoned(town, *TAKEOFF).ok is False
    assert zoned(town, *FAR).ok is None
    assert "a straight climb from home to item 1 enters town (exclusion)" in zoned(town, *FAR).reason
    # Below the climb, beside it, or around home: nothing.
    for free in (
        replace(town, ceiling=ZoneLevel(100.0 + 0.7 * 180.0 * climb(), "amsl")),
        replace(town, shape=Cylinder(200.0, 300.0, 100.0)),
        replace(town, shape=Cylinder(0.0, 0.0, 100.0)),
    ):
        assert zoned(free, *TAKEOFF).ok is True
    # A zone to stay in that begins at a height is no matter of the ground; one that the climb leaves is.
    field = Zone("field", "inclusion", Cylinder(0.0, 1000.0, 3500.0), floor=ZoneLevel(30.0, "ground"))
    assert zoned(field, *TAKEOFF).ok is True
    assert zoned(Zone("field", "inclusion", Cylinder(0.0, 0.0, 250.0)), *TAKEOFF).ok is False


def test_a_missile_in_the_way_up_counts_as_ground_does() -> None:
    threats = [
        {"name": "Alfa", "east_m": 0.0, "north_m": 300.0, "amsl_m": 100.0, "kill_radius_m": 90.0, "kill_scale_m": 90.0}
    ]
    for lines, ok in ((TAKEOFF, False), (FAR, None)):
        setup = over(wall(0.0, 100.0), *lines, threats=threats)
        assert of(judge_geometry(setup), "climbout").ok is True, "the mission came without a scenario"
        known = replace(setup, scenario=replace(setup.scenario, external=False))
        found = of(judge_geometry(known), "climbout")
        assert (found.ok, "enters Alfa (missile)" in found.reason) == (ok, True)


def test_ground_that_is_met_counts_where_that_beyond_it_is_not_known() -> None:
    def cut(top: float, known: float) -> Ground:
        return lambda east, at: np.where(at > known, np.nan, np.where(at == 500.0, top, 100.0)) + 0.0 * east

    # At its steepest it climbs to 300 m over home in 1.2 km, at the least in 1.7 km.
    steepest, least = 100.0 + 500.0 * climb(), 100.0 + 0.7 * 500.0 * climb()
    assert judged("climbout", cut(steepest + 5.0, 800.0), *TAKEOFF)[0].ok is False
    left_open, _ = judged("climbout", cut(least + 5.0, 1450.0), *TAKEOFF)
    assert (left_open.ok, left_open.check) == (None, "ground way")
    unknown, _ = judged("climbout", cut(100.0, 1450.0), *TAKEOFF)
    assert (unknown.ok, unknown.check) == (None, "")
    assert unknown.reason.endswith("at 70 % of the steepest climb, leads to where the terrain is unknown")


def test_where_no_way_up_is_known_there_is_no_finding_or_it_is_not_judged() -> None:
    level = wall(0.0, 100.0)

    def rules(setup: FlightSetup) -> set[str]:
        return {item.rule for item in judge_geometry(setup).findings}

    assert "climbout" in rules(over(level, *FAR))
    # Over home; straight up; no home; no ground.
    assert "climbout" not in rules(over(level, wp(0, 0, 300), *FAR))
    assert "climbout" not in rules(over(level, "3 84 0 0 0 0 0 0 300", *FAR))
    setup = over(level, *FAR)
    assert "climbout" not in rules(replace(setup, mission=replace(setup.mission, home=None)))
    assert "climbout" not in rules(setup_of(*(line.replace("3 16", "0 16") for line in FAR), terrain={"kind": "none"}))
    # Home, or a part of the way, off the elevation file: not judged, and said.
    away, verdict = judged("climbout", level, *FAR, home="36.5 -84.1 100")
    assert (away.ok, away.check, away.reason) == (None, "", "the terrain at home is unknown")
    assert verdict.headline == "flyable; climb-out not judged"
    beside, _ = judged("climbout", lambda east, north: np.where(north == 1000.0, np.nan, 100.0) + 0.0 * east, *TAKEOFF)
    assert (beside.ok, beside.check) == (None, "")


@pytest.mark.parametrize(("course_deg", "ok"), [(None, False), (0.0, False), (90.0, True), (185.0, True)])
def test_a_stated_launch_course_replaces_the_guess_towards_the_first_place(course_deg: float | None, ok: bool) -> None:
    setup = over(wall(500.0, 100.0 + 500.0 * climb() + 30.0, width=300.0), *TAKEOFF)
    course = None if course_deg is None else math.radians(course_deg)
    stated = replace(setup, scenario=replace(setup.scenario, launch=Launch("catapult", course)))
    found = of(judge_geometry(stated), "climbout")
    assert found.ok is ok
    way = "towards item 2" if course_deg is None else f"on the launch course {course_deg:.0f}°"
    assert (way if not ok else way.replace("towards item 2", "towards the next waypoint")) in found.reason


# ----------------------------------------------------------------------
# The approach: 5 degrees from 100 m over the landing point, which is 1,143 m.

SLOPE = math.tan(math.radians(5.0))
RUN = 100.0 / SLOPE
POINT = 3500.0


def landing(alt: float = 0.0, p: str = "0 0 0 0") -> tuple[str, ...]:
    return (wp(0, 0), wp(0, POINT - RUN), wp(0, POINT, alt, command=21, p=p))


def test_a_glide_into_a_wall_fails_and_one_that_only_just_clears_it_is_left_open() -> None:
    up = 100.0 + 600.0 * SLOPE
    for top, ok in ((up + 1.0, False), (up - 1.0, None), (up - 4.0, None), (up - 6.0, True)):
        found, verdict = judged("approach", wall(POINT - 600.0, top), *landing())
        assert (found.ok, verdict.undecided) == (ok, ok is None), top
    failed, verdict = judged("approach", wall(POINT - 600.0, up + 60.0), *landing())
    assert "approach at waypoint 2, item 3 (the glide to item 3 hits the ground)" in verdict.headline
    assert failed.reason == (
        "the glide to item 3 hits the ground: 600 m before the landing point it is 60 m below the surface"
    )
    _, verdict = judged("approach", wall(POINT - 600.0, up - 3.0), *landing())
    assert verdict.headline == "not judged in full: the glide to item 3 clears the ground by only 3.0 m"


def test_what_is_met_in_the_last_60_metres_is_the_landing() -> None:
    for before, ok in ((50.0, True), (70.0, False)):
        assert judged("approach", wall(POINT - before, 130.0), *landing())[0].ok is ok


def test_below_15_metres_the_glide_may_come_nearer_to_the_ground() -> None:
    # 14 m over the point 160 m before it, 16 m 183 m before it.
    for before, ok in ((160.0, True), (190.0, None)):
        up = 100.0 + before * SLOPE
        assert judged("approach", wall(POINT - before, up - 2.0), *landing())[0].ok is ok


@pytest.mark.parametrize(("alt", "ok"), [(-8.0, None), (-5.0, True), (9.5, True), (10.5, None)])
def test_a_landing_point_below_or_far_above_the_ground_is_left_open(alt: float, ok: bool | None) -> None:
    # 8 m below it the glide meets the ground 85 m early, 5 m below it 55 m.
    found, _ = judged("approach", wall(0.0, 100.0), *landing(alt))
    assert found.ok is ok
    side = "below" if alt < 0.0 else "above"
    assert (f"the landing point of item 3 is {abs(alt):.0f} m {side} the ground" in found.reason) is (ok is None)


@pytest.mark.parametrize(("alt", "ok"), [(-15.5, None), (-17.5, False)])
def test_far_below_the_ground_a_landing_point_has_the_glide_fail(alt: float, ok: bool | None) -> None:
    # 60 m before the point the glide is 6 m over it: 10 m in the ground where the point is 16 m below.
    assert judged("approach", wall(0.0, 100.0), *landing(alt))[0].ok is ok


def test_a_landing_point_below_the_ground_excuses_no_wall() -> None:
    up = 92.0 + 600.0 * (108.0 / RUN)
    assert judged("approach", wall(POINT - 600.0, up + 9.0), *landing(-8.0))[0].ok is False
    assert judged("approach", wall(POINT - 600.0, up + 7.0), *landing(-8.0))[0].ok is None


def test_arduplanes_glide_is_lower_than_the_straight_line_and_its_flare_is_told() -> None:
    # Laid out to a point before and above the landing point: in between it is lower by metres.
    setup = with_arduplane(over(wall(POINT - 600.0, 100.0 + 600.0 * SLOPE - 5.5), *landing()))
    plain = of(judge_geometry(replace(setup, autopilot=setup_of(*FAR).autopilot)), "approach")
    found = of(judge_geometry(setup), "approach")
    assert (plain.ok, found.ok) == (True, None)
    free = of(judge_geometry(with_arduplane(over(wall(0.0, 100.0), *landing()))), "approach")
    assert "flares 3." in free.reason


def test_a_zone_in_the_glide_fails() -> None:
    zone = Zone("town", "exclusion", Cylinder(0.0, POINT - 500.0, 100.0), ceiling=ZoneLevel(160.0, "amsl"))
    setup = over(wall(0.0, 100.0), *landing())
    for ceiling, ok in ((zone.ceiling, False), (ZoneLevel(130.0, "amsl"), True)):
        inside = replace(setup, scenario=replace(setup.scenario, zones=(replace(zone, ceiling=ceiling),)))
        assert of(judge_geometry(inside), "approach").ok is ok


def test_a_vertical_landing_has_no_glide() -> None:
    lines = (wp(0, 0), wp(0, POINT - RUN), wp(0, POINT, 0, command=85))
    assert not {item.rule for item in judge_geometry(over(wall(0.0, 100.0), *lines)).findings} & {
        "approach",
        "go_around",
    }


# ----------------------------------------------------------------------
# On real ground, against the same ways sampled metre by metre.

# What is left out beside a limit, m: samples are a metre apart, and places in files are rounded.
UNSURE = 0.5


def on_real_ground(home: tuple[float, float, float], *lines: str) -> Verdict:
    lat, lon = to_geo(ORIGIN, home[0], home[1])
    setup = setup_of(*lines, home=f"{float(lat):.7f} {float(lon):.7f} {home[2]:.3f}")
    return judge_geometry(replace(setup, scenario=replace(setup.scenario, terrain=real_ground())))


@cache
def real_ground() -> Terrain:
    ground = load_scenario("jacksboro-air").terrain
    assert ground is not None
    return ground


def test_ways_up_over_real_ground_meet_it_where_samples_do() -> None:
    rng, seen = np.random.default_rng(35), {True: 0, False: 0}
    for _ in range(scaled(600, 60)):
        (east, north), course = rng.uniform(-7000.0, 7000.0, 2).tolist(), rng.uniform(0.0, 2.0 * math.pi)
        run, up = float(rng.uniform(300.0, 2500.0)), float(round(rng.uniform(30.0, 250.0)))
        low = float(real_ground().height(east, north))
        able = math.tan(setup_of(*FAR).envelope.air_angles(25.0, low)[0])
        along = np.arange(50.0, run, 1.0)
        way = np.minimum(low + able * along, low + up)
        below = real_ground().height(east + along * math.sin(course), north + along * math.cos(course))
        least = float((way - below).min())
        if abs(least) < UNSURE:
            continue
        ends = (east + run * math.sin(course), north + run * math.cos(course))
        verdict = on_real_ground((east, north, low), wp(*ends, up), wp(ends[0] + 3000.0, ends[1], up))
        found = of(verdict, "climbout")
        assert found.ok is (True if least > 0.0 else None), (east, north, course, run, up)
        assert found.planned == pytest.approx(least, abs=UNSURE)
        seen[least > 0.0] += 1
    assert min(seen.values()) > 5


def test_glides_over_real_ground_meet_it_where_samples_do() -> None:
    rng, seen = np.random.default_rng(36), {True: 0, False: 0, None: 0}
    for _ in range(scaled(600, 60)):
        (east, north), course = rng.uniform(-7000.0, 7000.0, 2).tolist(), rng.uniform(0.0, 2.0 * math.pi)
        low, run = float(real_ground().height(east, north)), float(rng.uniform(400.0, 2000.0))
        slope = math.tan(rng.uniform(math.radians(3.0), math.radians(7.0)))
        begin = (east - run * math.sin(course), north - run * math.cos(course))
        before = np.arange(60.0, run, 1.0)
        clear = (
            slope * before
            + low
            - real_ground().height(east - before * math.sin(course), north - before * math.cos(course))
        )
        high = clear[slope * before >= 15.0]
        least, room = float(clear.min()), float(high.min()) if high.size else math.inf
        if min(abs(least), abs(room - 5.0)) < UNSURE:
            continue
        lines = (wp(begin[0] - 3000.0, begin[1], run * slope), wp(*begin, run * slope), wp(east, north, 0, command=21))
        expected = False if least < 0.0 else None if room < 5.0 else True
        assert of(on_real_ground((east, north, low), *lines), "approach").ok is expected, (east, north, course, run)
        seen[expected] += 1
    assert min(seen[True], seen[False]) > 5
