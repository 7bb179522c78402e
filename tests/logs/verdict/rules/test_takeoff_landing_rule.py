"""Take-off climbs and landing approaches, just within and just beyond what the aircraft or the scenario allows."""

import math
from dataclasses import replace

import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.simulation.simulate import Flight, fly_to_end
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.rules.takeoff_landing_rule import takeoff_findings
from tests.logs.verdict.judging import of
from tests.mission_lines import setup_of, wp
from world.airfield import Launch

HOME = "36.5 -84.2 100"
FAR = (wp(0, 3000, 300), wp(1500, 3000, 300))


def judged(rule: str, *lines: str, **tables: object) -> Finding:
    return of(judge_geometry(setup_of(*lines, home=HOME, **tables)), rule)


def landing(slope_deg: float) -> tuple[str, ...]:
    """An approach from 100 m over home to the ground, at this slope."""
    run = 100.0 / math.tan(math.radians(slope_deg))
    return (wp(0, 0), wp(0, 2000), wp(0, 2000 + run, 0, command=21))


def climb(slope_deg: float) -> tuple[str, ...]:
    """A take-off from home to 100 m over it, at this slope, and on."""
    return (wp(0, 100.0 / math.tan(math.radians(slope_deg)), 100, command=22), *FAR)


@pytest.mark.parametrize(("rule", "make", "side"), [("takeoff", climb, 0), ("landing", landing, 1)])
def test_a_slope_just_within_and_just_beyond_the_aircrafts(rule: str, make: object, side: int) -> None:
    envelope = setup_of(*FAR).envelope
    # In still air and at 25 m/s; of the ground at 100 m and the place at 200 m the one with less.
    able = math.degrees(min(envelope.air_angles(25.0, amsl)[side] for amsl in (100.0, 200.0)))
    inside, beyond = (judged(rule, *make(able + off)) for off in (-0.05, 0.05))
    # An autopilot climbs on beyond a place that it comes to too low; a landing place is missed.
    assert (inside.ok, beyond.ok) == (True, None if rule == "takeoff" else False)
    assert beyond.planned == pytest.approx(able + 0.05, abs=2e-3)
    assert beyond.limit == pytest.approx(able, abs=1e-6)
    assert beyond.limit_source == "aircraft"
    assert "not flown, because the flight" in inside.reason


@pytest.mark.parametrize(
    ("rule", "make", "key"), [("takeoff", climb, "max_climb_deg"), ("landing", landing, "max_dive_deg")]
)
def test_a_slope_just_within_and_just_beyond_the_scenarios(rule: str, make: object, key: str) -> None:
    # By a hundredth of a degree: 2 cm of the coordinates' grid in 1.9 km are less.
    for slope, ok in ((3.006, True), (3.014, None if rule == "takeoff" else False)):
        item = judged(rule, *make(slope), limits={key: 3.0})
        assert (item.ok, item.limit_source) == (ok, "scenario")


def test_the_wind_makes_an_approach_steeper_from_ahead() -> None:
    # From ahead the same descent through the air covers less ground, and is steeper over it.
    ahead, behind = (
        judged("landing", *landing(5.0), wind={"speed_mps": 8.0, "from_deg": from_deg}).limit
        for from_deg in (0.0, 180.0)
    )
    assert ahead is not None
    assert behind is not None
    assert ahead > judged("landing", *landing(5.0)).limit > behind


def test_a_climb_too_steep_is_said_in_the_first_line() -> None:
    # 30 degrees, as QGroundControl draws a climb-out.
    verdict = judge_geometry(setup_of(*climb(30.0), home=HOME))
    assert verdict.headline == "not judged in full: the take-off climbs 100 m in 173 m, 30.0°"
    assert any(line.startswith("Not judged: take-off (climbs 100 m in 173 m, 30.0°; at ") for line in verdict.lines)


def test_a_landing_of_45_degrees_fails_in_flight_too() -> None:
    from aircraft.catalog import load_aircraft

    setup = setup_of(*landing(45.0), home=HOME)
    flown = fly_to_end(Flight(setup, load_aircraft("aerosonde")))
    verdict = judge_flight(setup, flown.track, flown.ended)
    assert flown.ended == "completed"
    assert not verdict.flyable
    assert "landing at waypoint 2, item 3 (45° > " in verdict.headline


def test_a_climb_over_home_is_not_judged_and_the_first_line_says_so() -> None:
    for line in (wp(0, 0, 200, command=22), "3 22 15 0 0 0 0 0 200"):
        verdict = judge_geometry(setup_of(line, *FAR, home=HOME))
        assert of(verdict, "takeoff").ok is None
        assert verdict.headline == "not judged in full: the take-off at waypoint 0 (item 1) is not judged"


def test_a_landing_without_a_place_or_a_height_is_not_judged() -> None:
    here = judge_geometry(setup_of(wp(0, 0), wp(0, 2000), "3 21 0 0 0 0 0 0 0", home=HOME))
    assert of(here, "landing").ok is None
    assert here.headline.startswith("not judged in full: item 3: NAV_LAND without a position is not flown")
    above_terrain = wp(0, 3000, 0, command=21, frame=10)
    unknown = judge_geometry(setup_of(wp(0, 0, frame=0), wp(0, 2000, frame=0), above_terrain, terrain={"kind": "none"}))
    assert of(unknown, "landing").reason == "the altitude of the terrain there is unknown"


def test_a_take_off_in_the_air_and_a_mission_without_ends_have_no_finding() -> None:
    for lines in (FAR, (wp(0, 0), wp(0, 1500, 100, command=22), *FAR)):
        rules = {item.rule for item in judge_geometry(setup_of(*lines, home=HOME)).findings}
        assert not rules & {"takeoff", "landing"}


@pytest.mark.parametrize(
    ("launch", "ok"),
    [
        # v^2 / 2 L: 13.5^2 / 12 = 15.2, and 13.3^2 / 12 = 14.7 m/s2.
        (Launch("catapult", speed=13.5, length=6.0), True),
        (Launch("catapult", speed=13.3, length=6.0), False),
        # On a runway nothing but the motor pulls, which waits for it.
        (Launch("runway", speed=20.0, length=6.0), False),
    ],
)
def test_a_launch_too_gentle_for_the_motor_to_start(launch: Launch, ok: bool) -> None:
    setup = setup_of("3 22 15 0 0 0 0 0 100", *FAR, home=HOME)
    setup = replace(setup, scenario=replace(setup.scenario, launch=launch))
    requirements = route_requirements(setup)
    asking = ArduPlane(ArduPilotParameters.defaults().changed(TKOFF_THR_MINACC=15.0))
    judged = replace(requirements, setup=replace(setup, autopilot=asking))
    (found,) = takeoff_findings(judged, geometric=True)
    assert found.ok is ok
    if not ok:
        assert found.reason.endswith("less than TKOFF_THR_MINACC 15: the motor never starts")
    # Without the parameter the motor waits for nothing.
    assert takeoff_findings(requirements, geometric=True)[0].ok is True


def test_a_take_off_item_with_a_place_of_its_own_is_launched_as_any_other() -> None:
    """As QGroundControl places it: ahead of home."""
    setup = setup_of(*climb(5.0), home=HOME)
    asking = ArduPlane(ArduPilotParameters.defaults().changed(TKOFF_THR_MINACC=15.0))
    for speed, ok in ((13.5, True), (13.3, False)):
        launch = Launch("catapult", speed=speed, length=6.0)
        made = replace(setup, autopilot=asking, scenario=replace(setup.scenario, launch=launch))
        assert of(judge_geometry(made), "takeoff").ok is ok


def test_a_launch_is_judged_by_its_climb_from_the_ground_to_the_next_place() -> None:
    # 300 m over home, 3 km away: 5.7 degrees.
    setup = setup_of("3 22 15 0 0 0 0 0 100", *FAR, home=HOME)
    found = of(judge_geometry(replace(setup, scenario=replace(setup.scenario, launch=Launch("hand")))), "takeoff")
    assert found.ok is True
    assert found.planned == pytest.approx(math.degrees(math.atan(300.0 / 3000.0)), abs=0.02)
    # And without one it is the autopilot's business.
    assert of(judge_geometry(setup), "takeoff").ok is None


def test_a_landing_close_to_the_limit_of_an_uncertain_aircraft_is_left_open() -> None:
    """1.645 standard deviations of 0.5 degrees below the limit are certain; a certain aircraft has no such range."""
    setup = setup_of(*FAR, home=HOME)
    able = math.degrees(min(setup.envelope.air_angles(25.0, amsl)[1] for amsl in (100.0, 200.0)))
    for slope, ok in ((able - 0.87, True), (able - 0.77, None), (able + 0.05, False)):
        for descent_sd in (0.5, 0.0):
            made = setup_of(*landing(slope), home=HOME)
            limits = replace(made.limits, envelope=replace(made.envelope, descent_sd=math.radians(descent_sd)))
            item = of(judge_geometry(replace(made, limits=limits)), "landing")
            expected = True if descent_sd == 0.0 and ok is None else ok
            assert (item.ok, item.check) == (expected, "unknown aircraft" if expected is None else "")
            if expected is None:
                assert f"only {able - 1.645 * 0.5:.1f}° is certain" in item.reason


def test_a_landing_is_judged_at_the_airspeed_of_the_approach() -> None:
    """ArduPlane glides at TECS_LAND_ARSPD, or midway between AIRSPEED_MIN and AIRSPEED_CRUISE."""
    setup = setup_of(*landing(5.0), home=HOME)
    for values, airspeed in (({"TECS_LAND_ARSPD": 20.0}, 20.0), ({"AIRSPEED_MIN": 19.0}, 22.0)):
        law = ArduPlane(ArduPilotParameters.defaults().changed(AIRSPEED_CRUISE=25.0, **values))
        item = of(judge_geometry(replace(setup, autopilot=law)), "landing")
        # A parameter is an equivalent airspeed; at 100 m the air is 0.48 % thinner in the root of its density.
        true_airspeed = 1.0048 * airspeed
        able = min(setup.envelope.air_angles(true_airspeed, amsl)[1] for amsl in (100.0, 200.0))
        assert item.limit == pytest.approx(math.degrees(able), abs=0.02)
        assert f"at {true_airspeed:.1f} m/s" in item.reason


def test_a_landing_that_is_too_steep_suggests_a_lower_or_a_further_waypoint() -> None:
    setup = setup_of(*landing(45.0), home=HOME)
    item = of(judge_geometry(setup), "landing")
    assert item.limit is not None
    slope = math.tan(math.radians(item.limit - 0.1))
    (lower,), (further,) = item.suggestions
    assert (lower.what, further.what) == ("descent", "length")
    # 100 m in 100 m.
    assert lower.wanted == math.ceil(100.0 - 100.0 * slope)
    assert (lower.place.kind, lower.place.item) == ("waypoint", 2)
    assert further.wanted == math.ceil(100.0 / slope)


def test_a_take_off_close_to_the_limit_of_an_uncertain_aircraft_is_left_open() -> None:
    """1.645 standard deviations of 0.5 degrees below the limit are certain."""
    setup = setup_of(*FAR, home=HOME)
    able = math.degrees(min(setup.envelope.air_angles(25.0, amsl)[0] for amsl in (100.0, 200.0)))
    for slope, ok in ((able - 0.87, True), (able - 0.77, None)):
        made = setup_of(*climb(slope), home=HOME)
        limits = replace(made.limits, envelope=replace(made.envelope, climb_sd=math.radians(0.5)))
        item = of(judge_geometry(replace(made, limits=limits)), "takeoff")
        assert (item.ok, item.check) == (ok, "" if ok else "ground way")


@pytest.mark.parametrize("distance", [459.0, 600.0])
def test_a_landing_after_a_loiter_is_measured_from_the_tangent_point(distance: float) -> None:
    """From the centre to the touchdown d, radius 75 m: the straight part is sqrt(d^2 - 75^2), which sinks 45 m."""
    loiter = wp(0, 2000, 45, command=31, p="0 75 0 1")
    item = judged("landing", wp(0, 0), loiter, wp(distance, 2000, 0, command=21))
    assert item.planned == pytest.approx(math.degrees(math.atan(45.0 / math.sqrt(distance**2 - 75.0**2))), abs=0.01)
