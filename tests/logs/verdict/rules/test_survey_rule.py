"""Photo lines of known quality: three of 1,000 m, 200 m apart, with leads of 300 m, at 100 m over level ground.

25 m/s at 30 degrees of bank turn with 110 m; what a line loses is known before it is measured.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import default_parameters
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding, Verdict
from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import failing, judge, leg
from tests.mission_lines import setup_of, wp
from tests.synthetic import bank_radius, fly_path, make_setup

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
    """A corner of 90 degrees takes 110 m of the 200 m between lines at either end: too much for the turn rule."""
    setup = survey()
    verdict = judge(setup, fly_path(setup))
    assert [item.ok for item in photo_lines(verdict)] == [True] * 3
    assert [item.flown for item in photo_lines(verdict)] == pytest.approx([100.0] * 3, abs=0.2)
    judged = {(item.rule, item.place.index) for item in verdict.findings if item.rule in ("turn", "waypoint", "slope")}
    # Waypoints 2 to 5 and 6 to 9 are the turn-arounds, legs 2 to 4 and 6 to 8 theirs.
    assert {i for rule, i in judged if rule == "turn"} == {1, 10}
    assert {i for rule, i in judged if rule == "waypoint"} == {0, 1, 10, 11}
    assert {i for rule, i in judged if rule == "slope"} == {0, 1, 5, 9, 10}
    assert not [item for item in verdict.findings if item.rule == "corridor" and item.place.index not in (0, 10)]


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
        assert "30 % not along it within 50 m" in first.reason


@pytest.mark.parametrize(("off", "lost"), [(9.0, 0.0), (-9.0, 0.0), (11.0, 20.0), (-11.0, 20.0)])
def test_a_tenth_of_the_height_over_ground_is_lost(off: float, lost: float) -> None:
    setup = survey()
    track = fly_path(setup, up=lambda s: np.where((s > LEAD + 100.0) & (s < LEAD + 300.0), off, 0.0))
    first = photo_lines(judge(setup, track))[0]
    assert first.flown == pytest.approx(100.0 - lost, abs=1.0)
    if lost:
        assert "20 % more than 10 m off its height over ground" in first.reason


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


def test_a_climb_between_lines_that_cannot_be_flown_fails_without_a_flight() -> None:
    """From 100 m to 500 m on 400 m between the first two lines: geometry does not know where that leads."""
    points = np.array(lines(apart=400.0))
    points[4:, 2] = 500.0
    setup = make_setup(points, limits={"surveys": "lines"})
    assert ("slope", leg(3)) in failing(judge_geometry(setup))


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
    law = ArduPlane(default_parameters()).with_parameters(WP_RADIUS=90.0)
    items = []
    # Each line ends at a right angle, before which ArduPlane turns by all of WP_RADIUS.
    for k, (east, north, _) in enumerate(lines(lead=0.0)):
        items += [wp(east, north, 100.0), f"2 206 {0 if k % 2 else 50} 0 1 0 0 0 0"]
    setup = replace(setup_of(*items, home="36.5 -84.2 100"), autopilot=law, nav="perfect")
    first = photo_lines(judge(setup, fly_path(setup, radius=1.0)))[0]
    assert "2 of 21 photos missed" in first.reason
    assert "its first 0 m and last 91 m are lost" in first.reason


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
        assert "the missile m reaches it: only a flight tells" in found.reason
        assert verdict.headline.startswith("not judged in full: where the turn-around on leg 2")


def test_a_turn_around_that_fits_is_where_it_is_drawn() -> None:
    """Lines 400 m apart leave room for arcs of 110 m: their way is known, however near the missile stands."""
    setup = make_setup(lines(apart=400.0), limits={"surveys": "lines"}, **beside(-15.0))
    assert not judge_geometry(setup).undecided
