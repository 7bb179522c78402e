"""A flight that ends early ends where it ended, also where its route comes back to where it began."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.route_progress import _sample_route
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import AlignedTrack, align_track
from tests.logs.verdict.judging import failing, judge, of, waypoint
from tests.logs.verdict.rules.test_return_rule import by_arduplane
from tests.mission_lines import setup_of, wp
from tests.synthetic import fly_path, make_setup

Points = list[list[float]]
TRIANGLE: Points = [[0, 0, 300], [0, 3000, 300], [-2600, 1500, 300], [20, 0, 300]]
# Home lies in the middle of the route and at its end.
EIGHT: Points = [
    [0, 0, 300],
    [0, 2000, 300],
    [2000, 2000, 300],
    [0, 0, 300],
    [-2000, -2000, 300],
    [0, -2000, 300],
    [20, 0, 300],
]
SQUARE: Points = [[0, 0, 300], [0, 1500, 300], [1500, 1500, 300], [1500, 0, 300]]


def cut(points: Points, leg: int, share: float) -> Track:
    """The flight of a route up to a share of one of its legs."""
    whole, (a, b) = fly_path(make_setup(points), rate=10.0), (np.array(points[k][:2]) for k in (leg, leg + 1))
    lengths = [math.dist(points[k][:2], points[k + 1][:2]) for k in range(leg)]
    # The row nearest to the place, of those that are about as far along the route.
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(whole.position[:, :2], axis=0).T))])
    wanted = sum(lengths) + share * math.dist(a, b)
    away = np.hypot(*(whole.position[:, :2] - (a + share * (b - a))).T)
    row = int(np.argmin(np.where(abs(run - wanted) < 0.05 * wanted + 100.0, away, np.inf)))
    assert away[row] < 5.0
    return whole.rows(0, row + 1)


def lay(points: Points, track: Track) -> AlignedTrack:
    aligned = align_track(route_requirements(make_setup(points)), track)
    assert aligned is not None
    return aligned


@pytest.mark.parametrize(
    ("points", "leg", "share"),
    [
        (TRIANGLE, 1, 0.2),
        (TRIANGLE, 1, 0.7),
        (TRIANGLE, 2, 0.5),
        (TRIANGLE, 2, 0.95),
        (EIGHT, 1, 0.5),
        (EIGHT, 3, 0.4),
        (EIGHT, 5, 0.6),
        (SQUARE * 5, 5, 0.5),
        (SQUARE * 5, 11, 0.3),
        (SQUARE * 5, 17, 0.8),
    ],
)
def test_a_flight_that_ends_early_passed_no_waypoint_after_it(points: Points, leg: int, share: float) -> None:
    aligned = lay(points, cut(points, leg, share))
    last = len(aligned.track) - 1
    assert aligned.passed.tolist() == [k <= leg for k in range(len(points))]
    assert aligned.leg_at(last) == leg
    assert (aligned.rows[leg + 1 :] == last).all()
    assert (np.diff(aligned.rows[: leg + 2]) > 0).all()


def test_a_recorded_leg_changes_nothing() -> None:
    track = cut(TRIANGLE, 1, 0.7)
    lying = replace(track, leg=np.full(len(track), 2, dtype=np.int32))
    assert lay(TRIANGLE, lying).passed.tolist() == lay(TRIANGLE, track).passed.tolist() == [True, True, False, False]


def test_what_was_not_reached_is_named_once() -> None:
    setup = make_setup(TRIANGLE)
    verdict = judge(setup, cut(TRIANGLE, 1, 0.5))
    assert ("waypoint", waypoint(2)) in failing(verdict)
    assert of(verdict, "waypoint", waypoint(1)).ok is True
    ahead, after = (of(verdict, "waypoint", waypoint(k)) for k in (2, 3))
    # Half of the leg of 3,002 m was left.
    assert ahead.reason == "not reached: the flight ended on leg 1 (to item 2) 1501 m away"
    assert (after.ok, after.flown, after.reason) == (None, None, "not reached: the flight ended on leg 1 (to item 2)")


def test_a_flight_that_ends_within_reach_of_a_waypoint_is_on_the_next_leg() -> None:
    """With an acceptance radius of 200 m, and 150 m before the waypoint."""
    setup = make_setup(TRIANGLE)
    setup = replace(setup, route=setup.route.with_fields(acceptance_radius=200.0))
    flown = fly_path(make_setup([[0, 0, 300], [0, 4000, 300]]), rate=10.0)
    aligned = align_track(route_requirements(setup), flown.rows(0, int(np.argmax(flown.position[:, 1] > 2850.0))))
    assert aligned is not None
    assert aligned.passed.tolist() == [True, True, False, False]
    assert aligned.leg_at(len(aligned.track) - 1) == 1
    assert aligned.track.position[aligned.rows[1], 1] == pytest.approx(2800.0, abs=3.0)


def test_a_flight_that_ends_within_reach_of_a_turning_point_did_not_fly_back() -> None:
    """The flight ends 50 m before the turning point of a way there and back; ArduPlane's WP_RADIUS is 90 m."""
    there_and_back = [[0, 0, 300], [0, 3000, 300], [0, 0, 300], [1500, 0, 300]]
    setup = make_setup(there_and_back)
    turns_at_waypoint = np.array([False, True, False, False])
    setup = replace(setup, route=setup.route.with_fields(acceptance_radius=90.0, fly_over=turns_at_waypoint))
    flown = fly_path(make_setup([[0, 0, 300], [0, 4000, 300]]), rate=10.0)
    aligned = align_track(route_requirements(setup), flown.rows(0, int(np.argmax(flown.position[:, 1] > 2950.0))))
    assert aligned is not None
    assert aligned.passed.tolist() == [True, True, False, False]
    assert aligned.leg_at(len(aligned.track) - 1) == 1


RTL = "0 20 0 0 0 0 0 0 0"


def return_track(setup: FlightSetup, radius: float, end_bearing_deg: float) -> Track:
    """Straight legs to the waypoint where the return begins, on to home's circle, and twice around to a bearing."""
    corners = setup.route.positions[: (setup.route.rtl_start or 0) + 1]
    arrival = math.atan2(*corners[-1, :2])
    bearings = arrival + np.linspace(0.0, 4.0 * math.pi + (math.radians(end_bearing_deg) - arrival) % math.tau, 500)
    circle = np.column_stack([radius * np.sin(bearings), radius * np.cos(bearings), np.full(500, 200.0)])
    points = np.vstack([corners, circle])
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])
    along = np.arange(0.0, run[-1], 5.0)
    still = np.zeros((len(along), 3), dtype=np.float32)
    level = fly_path(make_setup([[0, 0, 300], [0, 5.0 * len(along) + 500.0, 300]]), rate=5.0).rows(0, len(along))
    position = np.column_stack([np.interp(along, run, points[:, axis]) for axis in range(3)])
    return replace(level, position=position, velocity=still)


@pytest.mark.parametrize("radius", [30.0, 50.0, 95.0, 140.0])
@pytest.mark.parametrize("end_bearing_deg", range(0, 360, 45))
def test_a_return_is_passed_wherever_on_its_circle_it_ends(radius: float, end_bearing_deg: float) -> None:
    # The return begins 320 m from home, which is within the arrival radius of 300 m of its drawn turn.
    setup = by_arduplane(setup_of(wp(1500, -300, 200), wp(200, -250, 200), RTL, home="36.5 -84.2 100"))
    aligned = align_track(route_requirements(setup), return_track(setup, radius, end_bearing_deg))
    assert aligned is not None
    assert aligned.passed.all()


def test_a_return_that_ends_on_its_way_home_is_not_passed() -> None:
    setup = by_arduplane(setup_of(wp(1500, -300, 200), wp(3200, -250, 200), RTL, home="36.5 -84.2 100"))
    track = return_track(setup, 50.0, 0.0)
    # A return has arrived 300 m from home; the track has a row every 5 m.
    distance = np.hypot(*track.position[:, :2].T)
    past_turn = int(np.argmax(distance))
    for away, is_passed in ((306.0, False), (294.0, True)):
        row = past_turn + int(np.argmax(distance[past_turn:] < away))
        aligned = align_track(route_requirements(setup), track.rows(0, row + 1))
        assert aligned is not None
        assert bool(aligned.passed[-1]) is is_passed


def test_a_loiter_is_one_place_at_its_center() -> None:
    """Two turns of 100 m around a place, and the margin of 60 m."""
    lines = (wp(-1000, 1500, 300), wp(500, 1500, 300, command=18, p="2 0 100 0"), wp(2500, 1500, 300))
    route = by_arduplane(setup_of(*lines, home="36.5 -84.2 100")).route
    samples = _sample_route(route, 50.0)
    places = np.unique(samples.sample_of_waypoint[route.arc_radii > 0.0])
    assert places.size == 1
    assert samples.positions[places[0]] == pytest.approx([500.0, 1500.0], abs=15.0)
    assert samples.radii[places[0]] == pytest.approx(160.0, abs=20.0)
