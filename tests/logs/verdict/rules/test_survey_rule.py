"""Photo lines of known quality: three of 1,000 m, 200 m apart, with leads of 300 m, at 100 m over level ground.

25 m/s at 30 degrees of bank turn with 110 m; what a line loses is known before it is measured.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.mission.items import Camera, SurveyPlan
from flight.mission.route import RouteRules, make_route
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.photo_lines import count_flight_photos, measure_line, measure_overlap
from logs.verdict.measures.route_requirements import judged_surveys, route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.verdict import Verdict
from planfly.surveys.survey_text import overlap_lines
from tests.logs.verdict.judging import failing, judge
from tests.mission_lines import ORIGIN, setup_of, wp
from tests.synthetic import bank_radius, fly_path, make_setup
from world.terrain import make_flat_terrain, make_gridded_terrain

LENGTH, APART, LEAD, UP = 1000.0, 200.0, 300.0, 100.0


def lines(lead: float = LEAD, count: int = 3, apart: float = APART) -> list[list[float]]:
    """Waypoints of a survey that begins to the north, each line to the east of the one before."""
    out: list[list[float]] = []
    for k in range(count):
        along = [-lead, 0.0, LENGTH, LENGTH + lead] if lead else [0.0, LENGTH]
        out += [[apart * k, north, UP] for north in (along if k % 2 == 0 else [LENGTH - north for north in along])]
    return out


def survey(lead: float = LEAD, **world: object) -> FlightSetup:
    """Without a camera: the scenario says that they are photo lines."""
    return make_setup(lines(lead), **({"limits": {"surveys": "lines"}} | world))


def photo_lines(verdict: Verdict) -> list[Finding]:
    return [item for item in verdict.findings if item.rule == "survey"]


def test_lines_flown_as_drawn_are_whole_and_their_turn_arounds_are_nobodys_business() -> None:
    """A corner of 90 degrees takes 110 m of the 200 m between lines at either end: too much for the turn rule.

    So is the turn onto the first line, at waypoint 2, and off the last, at 13, whatever the legs 1 and 13 there have.
    """
    to, off = [[-900.0, -800.0, UP], [-600.0, -800.0, UP]], [[1300.0, 1300.0, UP], [1500.0, 1000.0, UP]]
    setup = make_setup([*to, *lines(), *off], limits={"surveys": "lines"})
    verdict = judge(setup, fly_path(setup))
    assert [item.ok for item in photo_lines(verdict)] == [True] * 3
    assert [item.flown for item in photo_lines(verdict)] == pytest.approx([100.0] * 3, abs=0.2)
    judged = {(item.rule, item.place.index) for item in verdict.findings}
    # Waypoints 5 to 8 and 9 to 12 are between its lines, legs 4 to 7 and 8 to 11 theirs.
    assert {i for rule, i in judged if rule == "turn"} == {1, 14}
    assert {i for rule, i in judged if rule == "waypoint"} == {0, 1, 14, 15}
    assert {i for rule, i in judged if rule == "slope"} == {0, 1, 3, 7, 11, 13, 14}
    assert {i for rule, i in judged if rule == "corridor"} == {0, 14}


@pytest.mark.parametrize("limits", [{"surveys": "path"}, {}])
def test_as_any_path_it_fails_by_its_turns(limits: dict[str, object]) -> None:
    """And so does a patrol: nothing says that its lines are for photos."""
    setup = survey(limits=limits)
    assert photo_lines(judge(setup, fly_path(setup))) == []
    assert {rule for rule, _ in failing(judge_geometry(setup))} >= {"turn"}


@pytest.mark.parametrize(("aside", "lost"), [(45.0, 0.0), (55.0, 30.0)])
def test_a_quarter_of_the_spacing_beside_its_line_is_lost(aside: float, lost: float) -> None:
    """50 m of 200 m: on the first line from 400 m to 700 m."""
    setup = survey()
    track = fly_path(setup, across=lambda s: np.where((s > LEAD + 400.0) & (s < LEAD + 700.0), aside, 0.0))
    first, *others = photo_lines(judge(setup, track))
    assert first.flown == pytest.approx(100.0 - lost, abs=1.0)
    assert first.ok is (lost == 0.0)
    assert all(item.ok for item in others)
    if lost:
        assert "photo line 1 of 3 (items 1 to 2)" in first.reason
        assert "30 % not flown along the line within 50 m" in first.reason


@pytest.mark.parametrize(("off", "lost"), [(9.0, 0.0), (-9.0, 0.0), (11.0, 20.0), (-11.0, 20.0)])
def test_a_tenth_of_the_height_over_ground_is_lost(off: float, lost: float) -> None:
    setup = survey()
    track = fly_path(setup, up=lambda s: np.where((s > LEAD + 100.0) & (s < LEAD + 300.0), off, 0.0))
    first = photo_lines(judge(setup, track))[0]
    assert first.flown == pytest.approx(100.0 - lost, abs=1.0)
    if lost:
        assert "20 % more than 10 m off the planned height above ground" in first.reason


@pytest.mark.parametrize(("bank_deg", "lost"), [(9.0, 0.0), (11.0, 10.0)])
def test_ten_degrees_of_bank_are_lost(bank_deg: float, lost: float) -> None:
    setup = survey()
    track = fly_path(setup)
    north, east = track.position[:, 1], track.position[:, 0]
    banked = (np.abs(east) < 1.0) & (north > 500.0) & (north < 600.0)
    attitude = np.array(track.attitude)
    attitude[banked, 0] = np.radians(bank_deg)
    first = photo_lines(judge(setup, replace(track, attitude=attitude)))[0]
    assert first.flown == pytest.approx(100.0 - lost, abs=1.0)


def test_a_line_of_which_a_twentieth_is_lost_passes() -> None:
    setup = survey()
    for metres, ok in ((40.0, True), (60.0, False)):
        track = fly_path(
            setup, across=lambda s, m=metres: np.where((s > LEAD + 400.0) & (s < LEAD + 400.0 + m), 80.0, 0)
        )
        assert photo_lines(judge(setup, track))[0].ok is ok


def test_without_turn_arounds_geometry_says_what_the_turns_leave() -> None:
    """Arcs of 110 m at both ends of the middle line; the first begins, and the last ends, without a turn."""
    setup = survey(lead=0.0)
    left = [100.0 * (1.0 - count * bank_radius() / LENGTH) for count in (1, 2, 1)]
    found = photo_lines(judge_geometry(setup))
    assert [item.planned for item in found] == pytest.approx(left, abs=0.1)
    assert not any(item.ok for item in found)
    # And that is what a flight along the arcs gives.
    flown = photo_lines(judge(setup, fly_path(setup)))
    assert [item.flown for item in flown] == pytest.approx(left, abs=2.5)


@pytest.mark.parametrize(("lead", "left"), [(50.0, 88.0), (105.0, 99.0), (120.0, 100.0)])
def test_a_lead_saves_what_is_longer_than_the_turn(lead: float, left: float) -> None:
    """Of an arc of 110 m a lead of 50 m leaves 60 m on the line, at either end of the middle one."""
    found = photo_lines(judge_geometry(survey(lead=lead)))
    assert found[1].planned == pytest.approx(left, abs=0.15)


@pytest.mark.parametrize(("height", "left"), [(60.0, 100.0), (220.0, 92.9), (400.0, 26.4)])
def test_a_climb_between_lines_that_cannot_be_flown_takes_the_begin_of_the_line(height: float, left: float) -> None:
    """The slope of a turn-around is judged neither in a flight nor before it, only what it leaves of the line.

    At 13.7 degrees the 400 m between the lines and the lead of 300 m climb 170.6 m.  A photo may be 10 % of its height
    above ground off, 32 m of 320 m: of 220 m the other 17.4 m take 71 m of the line, of 400 m it is 179.4 m and 736 m.
    """
    points = np.array(lines(apart=400.0))
    points[4:, 2] += height
    setup = make_setup(points, limits={"surveys": "lines"})
    verdict = judge_geometry(setup)
    assert [item.planned for item in photo_lines(verdict)] == pytest.approx([100.0, left, 100.0], abs=0.2)
    assert "slope" not in {rule for rule, _ in failing(verdict)}


def test_with_turn_arounds_geometry_finds_lines_whole() -> None:
    assert [item.ok for item in photo_lines(judge_geometry(survey()))] == [True] * 3


def with_camera(first: int, last: int) -> FlightSetup:
    """The same survey as items: the camera takes a photo each 50 m between these waypoints of each line."""
    items = []
    for k, (east, north, _) in enumerate(lines()):
        items.append(wp(east, north, 100.0))
        if k % 4 in (first, last):
            items.append(f"2 206 {50 if k % 4 == first else 0} 0 1 0 0 0 0")
    return setup_of(*items, home="36.5 -84.2 100")


def test_the_camera_tells_where_a_line_begins_and_ends() -> None:
    setup = with_camera(1, 2)
    flown = photo_lines(judge(setup, fly_path(setup)))
    assert [item.ok for item in flown] == [True] * 3
    assert [item.place.index for item in flown] == [1, 5, 9]
    # On the leads, too: a line of 1,300 m, of which an arc of the next turn takes 110 m.
    longer = photo_lines(judge(with_camera(1, 3), fly_path(with_camera(1, 3))))
    assert longer[0].flown == pytest.approx(100.0 * (1.0 - bank_radius() / (LENGTH + LEAD)), abs=2.5)


def test_photos_that_a_waypoint_counted_early_costs() -> None:
    """ArduPlane counts the line's end as reached 90 m before it, so that the camera is off there: two photos of 21."""
    setup = with_camera(1, 2)
    law = ArduPlane(ArduPilotParameters.defaults()).with_parameters(WP_RADIUS=90.0)
    items = []
    # Each line ends at a right angle, before which ArduPlane turns by all of WP_RADIUS.
    for k, (east, north, _) in enumerate(lines(lead=0.0)):
        items += [wp(east, north, 100.0), f"2 206 {0 if k % 2 else 50} 0 1 0 0 0 0"]
    setup = replace(setup_of(*items, home="36.5 -84.2 100"), autopilot=law, nav="perfect")
    first = photo_lines(judge(setup, fly_path(setup, radius=1.0)))[0]
    assert "2 of 21 photos missed" in first.reason
    assert "its first 0 m and last 91 m are lost" in first.reason


@pytest.mark.parametrize(("version", "speed", "lost"), [("1.16", 27.3, 61), ("1.16", 7.4, 17), ("1.17", 27.3, 15)])
def test_px4_switches_the_camera_at_its_ground_speed(version: str, speed: float, lost: float) -> None:
    """2.24 s before the line's end up to 1.16: 61.2 m at 27.3 m/s and 16.6 m at 7.4 m/s; from 1.17 on NAV_ACC_RAD."""
    setup = with_camera(1, 2)
    law = Px4(Px4Parameters.defaults(version)).with_parameters(NAV_ACC_RAD=15.0)
    setup = replace(setup, autopilot=law, nav="perfect")
    track = fly_path(setup, radius=FITS)
    velocity = track.velocity * (speed / np.hypot(*track.velocity[:, :2].T).max())
    requirements = route_requirements(setup)
    aligned = align_track(requirements, replace(track, velocity=velocity))
    assert aligned is not None
    measure = measure_line(requirements, aligned, requirements.surveys[0], requirements.surveys[0].lines[0])
    assert measure is not None
    assert measure.lost_at_end == pytest.approx(lost, abs=2.0)


@pytest.mark.parametrize(("from_deg", "speed"), [(0.0, 15.0), (180.0, 35.0)])
def test_px4_turns_by_the_ground_speed_of_the_planned_line(from_deg: float, speed: float) -> None:
    """North at 25 m/s against and with 10 m/s of wind: the turn at the first line's end begins 2.24 s before it."""
    setup = survey(lead=0.0, wind={"speed_mps": 10.0, "from_deg": from_deg})
    law = Px4(Px4Parameters.defaults("1.16")).with_parameters(FW_AIRSPD_MAX=30.0)
    first = photo_lines(judge_geometry(replace(setup, autopilot=law)))[0]
    assert first.planned == pytest.approx(100.0 * (1.0 - 2.24 * speed / LENGTH), abs=0.2)


@pytest.mark.parametrize(("lead", "lost"), [(LEAD, 0.0), (60.0, 30.0)])
def test_camera_switched_off_behind_the_last_lead_costs_only_what_the_lead_is_too_short(
    lead: float, lost: float
) -> None:
    """ArduPlane counts the end of the last lead as reached 90 m before it: 30 m before the line's end if it is 60 m."""
    law = ArduPlane(ArduPilotParameters.defaults()).with_parameters(WP_RADIUS=90.0)
    items = [wp(east, north, 100.0) for east, north, _ in lines(lead)]
    items = [items[0], "2 206 50 0 1 0 0 0 0", *items[1:], "2 206 0 0 1 0 0 0 0"]
    # One more leg, so that the last lead ends at a right angle, before which ArduPlane turns by all of WP_RADIUS.
    setup = setup_of(*items, wp(1500.0, LENGTH + lead, 100.0), home="36.5 -84.2 100")
    setup = replace(
        setup,
        autopilot=law,
        nav="perfect",
        mission=replace(setup.mission, survey_plans=(SurveyPlan(50.0, lead),)),
    )
    last = photo_lines(judge(setup, fly_path(setup, radius=1.0)))[2]
    assert last.flown == pytest.approx(100.0 - 100.0 * lost / LENGTH, abs=1.0)


# A camera that sees 5 m across and 2 m along for each of its height: of 500 m by 200 m from 100 m above ground.  Of it
# 60 % beside, 200 m apart, and 75 % along, a photo each 50 m.
CAMERA = Camera(across=5.0, along=2.0, front=0.75, side=0.6)


# m.  Arcs that fit between lines 200 m apart, so that these are flown where they are drawn.
FITS = 90.0


def photographed(**changed: float) -> FlightSetup:
    setup = with_camera(1, 2)
    return replace(
        setup, mission=replace(setup.mission, survey_plans=(SurveyPlan(50.0, LEAD, replace(CAMERA, **changed)),))
    )


def overlaps(verdict: Verdict) -> dict[str, Finding]:
    return {item.check: item for item in verdict.findings if item.rule == "survey" and item.check}


def test_overlap_as_drawn_is_what_was_asked_for() -> None:
    setup = photographed()
    for verdict in (judge(setup, fly_path(setup, radius=FITS)), judge_geometry(setup)):
        found = overlaps(verdict)
        front, side = found["front overlap"], found["side overlap"]
        low = [item.planned if item.flown is None else item.flown for item in (front, side)]
        assert low == pytest.approx([75.0, 60.0], abs=0.3)
        assert (front.limit, side.limit) == pytest.approx((65.0, 50.0))
        assert (front.ok, side.ok) == (True, True)
    assert "lowest front overlap 75 % (line 1: photos 50 m apart, 100 m above ground); 75 % is required" in front.reason
    # Without a camera nothing is said of it.
    assert overlaps(judge(with_camera(1, 2), fly_path(with_camera(1, 2)))) == {}


@pytest.mark.parametrize("up", [-99.999, -100.0, -130.0])
def test_photos_from_the_ground_or_below_it_overlap_by_nothing(up: float) -> None:
    """As on a line that ends in a crash: 0 %, not minus any number; the drawn line is as low as that here."""
    setup = photographed()
    low = np.array(lines()) + np.array([0.0, 0.0, 100.0 + up])
    setup = replace(setup, route=setup.route.with_fields(position=low))
    found = overlaps(judge(setup, fly_path(setup, radius=FITS)))
    assert [found[check].flown for check in ("front overlap", "side overlap")] == [0.0, 0.0]
    assert " 0 m above ground); 75 % is required" in found["front overlap"].reason


@pytest.mark.parametrize(("aside", "ok"), [(49.0, True), (51.0, False)])
def test_lines_apart_overlap_less(aside: float, ok: bool) -> None:
    """The first line so far to the left, 250 m from the second: 500 m of photo beside leave 50 % there.

    50 m beside their line photos count: 45 m, and the rest the second line.
    """
    setup = photographed()
    left = lambda s: np.where(s < LEAD + LENGTH + LEAD, -45.0, 0.0) + np.where(second(s), -(aside - 45.0), 0.0)  # noqa: E731
    side = overlaps(judge(setup, fly_path(setup, radius=FITS, across=left)))["side overlap"]
    assert side.flown == pytest.approx(100.0 * (1.0 - (200.0 + aside) / 500.0), abs=0.2)
    assert side.ok is ok
    assert f"lines 1 and 2: {200.0 + aside:.0f} m apart, 100 m above ground); 60 % is required" in side.reason


def second(s: np.ndarray) -> np.ndarray:
    """Whether places along the path are on the second line, or near."""
    arc = (0.5 * math.pi - 2.0) * FITS
    begin = 2.0 * LEAD + LENGTH + APART + LEAD + 2.0 * arc
    return (s > begin - 50.0) & (s < begin + LENGTH + 50.0)


def test_photos_from_lower_show_less() -> None:
    """9 m lower the first line's photos are 455 m by 182 m: the next follows after 50 m, those beside have 500 m."""
    setup = photographed()
    found = overlaps(
        judge(setup, fly_path(setup, radius=FITS, up=lambda s: np.where(s < 2.0 * LEAD + LENGTH - 150.0, -9.0, 0.0)))
    )
    assert found["front overlap"].flown == pytest.approx(100.0 * (1.0 - 50.0 / 182.0), abs=0.2)
    assert found["side overlap"].flown == pytest.approx(100.0 * (1.0 - 200.0 / (0.5 * (455.0 + 500.0))), abs=0.2)


@pytest.mark.parametrize(("interval", "front", "ok"), [(1.9, 75.0, True), (2.75, 65.6, True), (2.85, 64.4, False)])
def test_a_camera_takes_its_time(interval: float, front: float, ok: bool) -> None:
    """At 25 m/s a photo each 50 m is one each 2 s."""
    setup = photographed(interval=interval)
    found = overlaps(judge(setup, fly_path(setup, radius=FITS)))["front overlap"]
    assert found.flown == pytest.approx(front, abs=0.2)
    assert found.ok is ok
    assert ("apart, one every" in found.reason) is (interval > 2.0)


def test_only_photos_that_can_be_used_overlap() -> None:
    """What is flown 80 m beside its line is lost, and was said to be: nothing is asked of the lines beside it."""
    setup = photographed()
    track = fly_path(setup, radius=FITS, across=lambda s: np.where(s < LEAD + 0.5 * LENGTH, -80.0, 0.0))
    assert overlaps(judge(setup, track))["side overlap"].flown == pytest.approx(60.0, abs=0.3)
    # Half of one of three lines.
    requirements = route_requirements(setup)
    (survey,) = judged_surveys(setup)
    measure = measure_overlap(requirements, align_track(requirements, track), survey)
    assert measure is not None
    assert measure.unusable_fraction == pytest.approx(0.5 / 3.0, abs=0.01)


def test_a_lost_line_is_not_compared() -> None:
    """The first line loses its first 100 m of 1,000 m, and is 49 m off on the rest: only the others are compared."""
    setup = photographed()
    left = lambda s: np.where(s < 2.0 * LEAD + LENGTH, -45.0, 0.0) + np.where(s < LEAD + 100.0, -35.0, 0.0)  # noqa: E731
    verdict = judge(setup, fly_path(setup, radius=FITS, across=left))
    assert photo_lines(verdict)[0].ok is False
    assert overlaps(verdict)["side overlap"].flown == pytest.approx(60.0, abs=0.3)


def test_a_line_just_below_its_limit_is_not_rounded_up_to_it() -> None:
    """Of 1,000 m 51 m are lost, in steps of about 5 m that the track touches: less than 95 %, and more than 94 %."""
    setup = survey()
    track = fly_path(setup, across=lambda s: np.where((s > LEAD + 400.0) & (s < LEAD + 452.0), 80.0, 0))
    first = photo_lines(judge(setup, track))[0]
    assert first.ok is False
    assert first.flown is not None
    assert 94.5 <= first.flown < 95.0
    assert f"{first.flown:.1f} % of its 1000 m can be used" in first.reason


@pytest.mark.parametrize(
    ("turned_deg", "is_opposite", "area", "ok"),
    [(5.0, False, 0.549, True), (30.0, False, 0.327, None), (-30.0, False, 0.327, None), (45.0, True, 0.4, None)],
)
def test_photos_turned_by_the_crab_angle_have_less_in_common(
    turned_deg: float, is_opposite: bool, area: float, ok: bool | None
) -> None:
    """Photos of 500 m by 200 m, 200 m apart, overlap by 60 %, at least 50 %.

    Turned alike, they have (1 - 200 cos c / 500) (1 - 200 sin c / 200) in common: 0.602 * 0.913 at 5 degrees
    and 0.654 * 0.5 at 30.  Turned by 45 degrees to either side, one stands across the other: 200 m by 200 m, 0.4.
    """
    setup = photographed()
    track = fly_path(setup, radius=FITS)
    attitude = np.array(track.attitude)
    is_south = np.cos(attitude[:, 2]) < 0.0
    attitude[:, 2] += np.radians(np.where(is_south & is_opposite, -turned_deg, turned_deg))
    track = replace(track, attitude=attitude)
    verdict = judge(setup, track)
    requirements = route_requirements(setup)
    (survey,) = judged_surveys(setup)
    measure = measure_overlap(requirements, align_track(requirements, track), survey)
    assert measure is not None
    assert measure.side == pytest.approx(0.6, abs=0.003)
    assert measure.side_area == pytest.approx(area, abs=0.006)
    side = overlaps(verdict)["side overlap" if ok else "unknown overlap"]
    assert side.ok is ok
    assert verdict.undecided is (ok is None)
    if ok is None:
        assert side.reason.startswith(f"crab angle up to {abs(turned_deg):.0f}°: neighbouring photos have ")


def in_order(*strips: tuple[float, float, float]) -> FlightSetup:
    """Lines at an east position from one north position to another, alternately there and back, with CAMERA."""
    items = []
    for k, (east, south, north) in enumerate(strips):
        along = [south - LEAD, south, north, north + LEAD]
        for corner, place in enumerate(along if k % 2 == 0 else reversed(along)):
            items.append(wp(east, place, 100.0))
            if corner in (1, 2):
                items.append(f"2 206 {50 if corner == 1 else 0} 0 1 0 0 0 0")
    setup = setup_of(*items, home="36.5 -84.2 100")
    return replace(setup, mission=replace(setup.mission, survey_plans=(SurveyPlan(50.0, LEAD, CAMERA),)))


def test_the_largest_gap_between_photos_is_named_with_the_spacing_that_has_none() -> None:
    """Lines of three heights, 200 m apart, photos 50 m apart of 5 m across and 2 m along for each of their height.

    At 30 m, 20 m and 10 m the middles of neighbours are at 25 m and 15 m: photos of 125 m and 75 m leave gaps of 75 m
    and 125 m.  Photos of 20 m along leave 30 m between them.  From 10 m a quarter of 20 m along and 40 % of 50 m across
    leave the overlaps required.
    """
    setup = photographed()
    low = np.array(lines())
    low[:, 2] = 100.0 + np.repeat([30.0, 20.0, 10.0], 4)
    setup = replace(setup, route=setup.route.with_fields(position=low))
    front, side = (overlaps(judge_geometry(setup))[check] for check in ("front overlap", "side overlap"))
    assert (front.planned, side.planned) == (0.0, 0.0)
    assert "0 %, with a gap of 30 m between the photos (line 3: photos 50 m apart, 10 m" in front.reason
    assert "0 %, with a gap of 125 m between the photos (lines 2 and 3: 200 m apart, 15 m" in side.reason
    requirements = route_requirements(setup)
    measure = measure_overlap(requirements, None, requirements.surveys[0])
    assert measure is not None
    assert (measure.needed_photo_spacing, measure.needed_line_spacing) == pytest.approx((5.0, 20.0))


@pytest.mark.parametrize(
    ("ground", "height", "is_named"),
    [
        # 40 m above the hill's foot at one end of each line, and 100 m at the other: photos of 80 m by 200 m.
        ((60.0, 0.0), 0.0, True),
        ((60.0, 0.0), 110.0, True),
        # A level plateau of this height: no line can follow anything.
        ((60.0, 60.0), 0.0, False),
        # Even 35 m above the ground, 50 m leave 29 % of photos of 70 m.
        ((60.0, 0.0), 35.0, False),
    ],
)
def test_lines_at_one_altitude_over_a_slope_do_not_follow_it(
    ground: tuple[float, float], height: float, is_named: bool
) -> None:
    setup = photographed()
    east, north = np.array([-2000.0, 2000.0]), np.linspace(-2.0, 3.0, 6) * LENGTH
    slope = np.repeat(np.array(ground).repeat(3)[:, None], 2, axis=1)
    terrain = make_gridded_terrain(slope, east, north, source="slope", sha256="", datum="mean sea level")
    low = np.array(lines()) * [1.0, 1.0, 0.0] + [0.0, 0.0, 100.0]
    plans = tuple(replace(plan, height=height) for plan in setup.mission.survey_plans)
    setup = replace(
        setup, mission=replace(setup.mission, survey_plans=plans), route=setup.route.with_fields(position=low)
    )
    setup = setup.in_scenario(replace(setup.scenario, terrain=terrain))
    front = overlaps(judge_geometry(setup))["front overlap"]
    assert front.ok is False
    planned = height or 100.0
    text = (
        "; the lines are at one altitude and do not follow the terrain: their height above ground ranges from 40 to"
        f" 100 m, planned {planned:.0f} m; lines that follow the terrain keep the overlap (FollowTerrain of"
        " QGroundControl's survey; for ArduPlane also altitude frame 10)"
    )
    assert (text in front.reason) is is_named
    assert ("follow the terrain" in front.reason) is is_named
    requirements = route_requirements(setup)
    texts = overlap_lines(measure_overlap(requirements, None, requirements.surveys[0]))
    assert any("must be at most" in line for line in texts) is not is_named
    assert (text[2:] in texts) is is_named


def test_lines_on_both_sides_of_a_notch_are_no_neighbors() -> None:
    """Lines 3 and 4 begin 600 m further north: south of them lines 2 and 5 are 600 m apart, beside a notch."""
    setup = in_order(
        *((0.0, 0.0, LENGTH), (200.0, 0.0, LENGTH), (400.0, 600.0, LENGTH), (600.0, 600.0, LENGTH)),
        *((800.0, 0.0, LENGTH), (1000.0, 0.0, LENGTH)),
    )
    assert overlaps(judge_geometry(setup))["side overlap"].planned == pytest.approx(60.0, abs=0.3)


def test_a_missing_line_is_a_gap() -> None:
    """400 m without a line between lines 3 and 4: photos of 500 m overlap by a fifth."""
    strips = [(east, 0.0, LENGTH) for east in (0.0, 200.0, 400.0, 800.0, 1000.0, 1200.0)]
    side = overlaps(judge_geometry(in_order(*strips)))["side overlap"]
    assert side.planned == pytest.approx(20.0, abs=0.3)
    assert "lines 3 and 4: 400 m apart" in side.reason


@pytest.mark.parametrize(("gate", "left"), [(False, 91.0), (True, 100.0)])
def test_a_gate_switches_the_camera_at_its_plane(gate: bool, left: float) -> None:
    """PX4 counts a waypoint as reached within NAV_ACC_RAD, and a gate where it passes it: no photo is missed.

    A waypoint costs 90 m at the end of each line, in flight and by geometry, although the lead saves it from the turn.
    """
    items = []
    for k, (east, north, _) in enumerate(lines()):
        is_end = k % 4 in (1, 2)
        items.append(wp(east, north, 100.0, command=4501 if gate and is_end else 16))
        if is_end:
            items.append(f"2 206 {50 if k % 4 == 1 else 0} 0 1 0 0 0 0")
    setup = setup_of(*items, home="36.5 -84.2 100")
    law = Px4(Px4Parameters.defaults("1.17")).with_parameters(NAV_ACC_RAD=90.0)
    route = make_route(
        setup.mission, ORIGIN, setup.scenario.terrain, 25.0, False, setup.limits, rules=RouteRules(reads_as_px4=True)
    )
    setup = replace(setup, route=route, autopilot=law, nav="perfect")
    flown = photo_lines(judge(setup, fly_path(setup, radius=FITS)))
    assert [one.flown for one in flown] == pytest.approx([left] * 3, abs=0.6)
    assert f"photo line 1 of 3 (items 2 to 4): {left:.0f} % of its 1000 m can be used" in flown[0].reason
    planned = photo_lines(judge_geometry(setup))
    assert [one.planned for one in planned] == pytest.approx([left] * 3, abs=0.1)
    assert [one.ok for one in planned] == [gate] * 3
    camera_text = "the camera, which is switched off before its end, leaves only 91 % of its 1000 m with photos"
    assert (camera_text in planned[0].reason) is not gate


def test_a_gate_that_is_passed_at_an_angle_costs_no_photo() -> None:
    """Photos 49.9 m apart: of 21 on 1,000 m the last is at 998 m.

    The first line is begun 20 m beside its gate, 0.2 m nearer with each metre: nearest to it 4 m behind its plane.
    """
    items = []
    for k, (east, north, _) in enumerate(lines()):
        is_gate = k % 4 in (1, 2)
        items.append(wp(east, north, 100.0, command=4501 if is_gate else 16))
        if is_gate:
            items.append(f"2 206 {49.9 if k % 4 == 1 else 0} 0 1 0 0 0 0")
    setup = setup_of(*items, home="36.5 -84.2 100")
    law = Px4(Px4Parameters.defaults("1.17"))
    route = make_route(
        setup.mission, ORIGIN, setup.scenario.terrain, 25.0, False, setup.limits, rules=RouteRules(reads_as_px4=True)
    )
    setup = replace(setup, route=route, autopilot=law, nav="perfect")
    requirements = route_requirements(setup)
    beside = fly_path(setup, radius=FITS, across=lambda s: np.clip(0.2 * (LEAD + 100.0 - s), 0.0, 40.0))
    aligned = align_track(requirements, beside)
    assert aligned is not None
    (found,) = requirements.surveys
    measures = [measure_line(requirements, aligned, found, line) for line in found.lines]
    assert [measure and measure.taken_photo_count for measure in measures] == [21] * 3
    assert count_flight_photos(requirements, aligned) == 63


def test_lines_that_bend_are_measured_along_their_bends() -> None:
    """Three of 500 m and 500 m at 30 degrees, flown by arcs: 90 m * 30° of each are banked; rolling takes 17 m."""
    half, points = math.radians(15.0), list[list[float]]()
    for k in range(3):
        d = APART * k
        corner = [d, 500.0 - d * math.tan(half)]
        end = [500.0 * 0.5 + d * math.cos(2 * half), 500.0 + 500.0 * math.cos(2 * half) - d * 0.5]
        line = [[d, -LEAD], [d, 0.0], corner, end, [end[0] + LEAD * 0.5, end[1] + LEAD * math.cos(2 * half)]]
        points += [[*place, UP] for place in (line if k % 2 == 0 else reversed(line))]
    setup = make_setup(points, limits={"surveys": "lines"})
    flown = photo_lines(judge(setup, fly_path(setup, radius=FITS)))
    assert [item.place.index for item in flown] == [1, 6, 11]
    arc = FITS * 2.0 * half
    # A line 200 m to the right of another is 2 * 200 m * tan(15°) shorter.
    for k, item in enumerate(flown):
        length = 1000.0 - k * 2.0 * APART * math.tan(half)
        assert 100.0 * (1.0 - (arc + 17.0) / length) <= item.flown <= 100.0 * (1.0 - arc / length)


def test_two_lines_are_no_survey() -> None:
    setup = make_setup(lines(count=2), limits={"surveys": "lines"})
    assert photo_lines(judge(setup, fly_path(setup))) == []


def test_a_stated_corridor_counts_in_a_survey_too() -> None:
    setup = survey(limits={"corridor_m": 30.0, "surveys": "lines"})
    legs = [item.place.index for item in judge(setup, fly_path(setup)).findings if item.rule == "corridor"]
    assert legs == list(range(11))


# From the middle of the turn-around between the first two lines: 180 m to its corners, and 3.25 radii on.
REACH = math.hypot(100.0, 150.0) + 3.25 * bank_radius()


def beside(away: float) -> dict[str, object]:
    """A missile whose sphere of 300 m ends so far within (negative) what that turn-around may get to, to its north."""
    north = LENGTH + 150.0 + REACH + 300.0 + away
    at = {"name": "m", "east_m": 100.0, "north_m": north, "amsl_m": UP, "kill_radius_m": 300.0, "kill_scale_m": 300.0}
    return {"threats": [at]}


@pytest.mark.parametrize(("away", "open_"), [(-15.0, True), (15.0, False)])
def test_a_turn_around_too_tight_to_be_drawn_is_left_open_where_something_is_near(away: float, open_: bool) -> None:
    verdict = judge_geometry(survey(**beside(away)))
    assert verdict.undecided is open_
    assert verdict.flyable is not open_
    if open_:
        [found] = [item for item in photo_lines(verdict) if item.ok is None]
        assert found.place.index == 2
        assert "turn-around 1 is too tight to be flown as drawn" in found.reason
        assert "missile m is in range; only a simulated flight shows" in found.reason
        said = "not judged in full: only a simulated flight shows how the turn-around on leg 2 (to item 3) is flown"
        assert verdict.headline.startswith(said)


def test_a_turn_around_that_fits_is_where_it_is_drawn() -> None:
    """Lines 400 m apart leave room for arcs of 110 m: their way is known, however near the missile stands."""
    setup = make_setup(lines(apart=400.0), limits={"surveys": "lines"}, **beside(-15.0))
    assert not judge_geometry(setup).undecided


@pytest.mark.parametrize(
    ("known_to", "aside_m", "ok"), [(980.0, 0.0, True), (900.0, 0.0, None), (900.0, 40.0, None), (900.0, 80.0, False)]
)
def test_a_line_beyond_the_terrain_data_is_judged_where_the_ground_is_known(
    known_to: float, aside_m: float, ok: bool | None
) -> None:
    """Of 1,000 m a twentieth may be lost: 80 m aside are too many whatever the unknown 100 m are, 40 m may be."""
    ground = make_flat_terrain(np.array([[-1000.0, 1500.0], [-1000.0, known_to]]), 0.0, 2.0)
    setup = make_setup(lines(), limits={"surveys": "lines"}, ground=ground)
    aside = fly_path(setup, across=lambda s: np.where((s > LEAD + 400.0) & (s < LEAD + 400.0 + aside_m), 80.0, 0.0))
    first = photo_lines(judge(setup, aside))[0]
    assert (first.ok, first.check) == (ok, "ground way" if ok is None else "")
    assert "nan" not in first.reason
    # Nothing is lost at its end, where the ground is unknown.
    facts = {fact.what: fact.value for fact in first.facts}
    assert facts["lost at its end"] == pytest.approx(0.0, abs=2.0)
    if ok is None:
        assert (
            first.brief == "photo line 1 of 3 (items 1 to 2): 10 % of its 1000 m lies outside the data of flat at 0 m"
        )
    planned = photo_lines(judge_geometry(setup))[0]
    assert planned.ok is (True if known_to > 950.0 else None)


def test_no_photo_over_unknown_ground_overlaps() -> None:
    """Footprints of 100 m along the track at 100 m, a photo every 50 m; half of each line is unknown."""
    ground = make_flat_terrain(np.array([[-1000.0, 1500.0], [-1000.0, 500.0]]), 0.0, 2.0)
    setup = make_setup(lines(), limits={"surveys": "lines"}, ground=ground)
    camera = SurveyPlan(None, 0.0, Camera(4.0, 1.0, 0.4, 0.4))
    setup = replace(setup, mission=replace(setup.mission, survey_plans=(camera,)))
    requirements = route_requirements(setup)
    for aligned in (None, align_track(requirements, fly_path(setup))):
        measure = measure_overlap(requirements, aligned, requirements.surveys[0])
        assert measure is not None
        assert measure.unknown_fraction == pytest.approx(0.5, abs=0.02)
        assert measure.unusable_fraction == pytest.approx(0.0, abs=0.01)
        # 200 m of 400 m, as drawn; the track is up to 21 m beside its line after a turn.
        assert measure.side == pytest.approx(0.5, abs=0.01 if aligned is None else 0.06)
