"""Turns as flown, by each hand and on each course: angle, bank, radius, overshoot, and which flights got past them."""

import math

import numpy as np
import pytest

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track, join_tracks
from logs.verdict.measures.route_demands import route_demands
from logs.verdict.measures.track_alignment import lay_track
from logs.verdict.measures.turns import TurnMeasure, measure_turn
from tests.synthetic import bank_radius, bump, copied, fly_path, make_setup, waypoint_stations

TURN = math.radians(70.0)
# Half of the arc's length, m.
HALF = 0.5 * bank_radius() * TURN


def corner(course_deg: float, side: float = 1.0) -> FlightSetup:
    """A corner of 70 degrees between legs of 2 km, the first on this course.  side: 1 to the right, -1 to the left."""
    course = math.radians(course_deg)
    courses = np.array([course, course + side * TURN])
    steps = 2000.0 * np.column_stack([np.sin(courses), np.cos(courses), np.zeros(2)])
    return make_setup(np.array([0.0, 0.0, 300.0]) + np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]))


def measured(setup: FlightSetup, track: Track, i: int = 1) -> TurnMeasure:
    demands = route_demands(setup)
    aligned = lay_track(demands, track)
    assert aligned is not None
    return measure_turn(demands, aligned, i)


@pytest.mark.parametrize("course", [0.0, 50.0, 200.0, 290.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("outside", "seen"), [(8.0, 8.0), (-8.0, 0.0), (0.0, 0.0)])
@pytest.mark.parametrize("after", [-0.5 * HALF, 0.5 * HALF, HALF + 90.0])
def test_what_lies_outside_the_arc_or_the_next_leg_is_overshoot(
    course: float, side: float, outside: float, seen: float, after: float
) -> None:
    """Before and after the arc's middle, and on the next leg; the outside of a turn to the right is the left."""
    setup = corner(course, side)
    at = float(waypoint_stations(setup)[1]) + after
    measure = measured(setup, fly_path(setup, across=bump(at, -side * outside, 20.0)))
    assert measure.overshoot == pytest.approx(seen, abs=0.05)
    assert (measure.over, measure.full_circles) == (True, 0)
    assert measure.settled == pytest.approx(0.0, abs=0.01)


def test_an_overshoot_is_watched_for_ten_seconds_after_the_arc() -> None:
    setup = corner(30.0)
    end = float(waypoint_stations(setup)[1]) + HALF
    for seconds, seen in ((9.0, 8.0), (13.0, 0.0)):
        measure = measured(setup, fly_path(setup, across=bump(end + 25.0 * seconds, -8.0, 15.0)))
        assert measure.overshoot == pytest.approx(seen, abs=0.1)


def test_what_was_flown_before_the_arc_is_no_overshoot() -> None:
    setup = corner(200.0)
    begin = float(waypoint_stations(setup)[1]) - HALF
    measure = measured(setup, fly_path(setup, across=bump(begin - 100.0, -8.0, 20.0)))
    assert measure.overshoot == pytest.approx(0.0, abs=0.01)


def circling(track: Track, rounds: int, at: float) -> Track:
    """A track with whole circles to the right of 80 m radius flown at a time (s) of it."""
    columns = copied(track)
    k = int(np.searchsorted(columns["time"], at))
    ticks = int(rounds * 2.0 * math.pi * 80.0 / 25.0 * 60.0)
    angle = np.linspace(0.0, rounds * 2.0 * math.pi, ticks, endpoint=False)
    ring = {name: np.repeat(column[k : k + 1], ticks, axis=0) for name, column in columns.items()}
    step = columns["position"][k + 1] - columns["position"][k]
    along = step / np.linalg.norm(step)
    right = np.array([along[1], -along[0], 0.0])
    ring["position"] = columns["position"][k] + 80.0 * (
        np.outer(np.sin(angle), along) + np.outer(1.0 - np.cos(angle), right)
    )
    ring["time"] = columns["time"][k] + np.arange(ticks) / 60.0
    late = {name: column[k:].copy() for name, column in columns.items()}
    late["time"] += ticks / 60.0
    return join_tracks([Track(**{name: column[:k] for name, column in columns.items()}), Track(**ring), Track(**late)])


@pytest.mark.parametrize("course", [0.0, 200.0])
@pytest.mark.parametrize("rounds", [1, 2])
def test_whole_circles_at_a_corner_are_counted(course: float, rounds: int) -> None:
    setup = corner(course)
    at = float(waypoint_stations(setup)[1]) / 25.0
    assert measured(setup, circling(fly_path(setup), rounds, at)).full_circles == rounds


@pytest.mark.parametrize(("beyond", "over"), [(-8.0, False), (8.0, True)])
def test_a_turn_is_over_at_the_end_of_its_arc(beyond: float, over: bool) -> None:
    setup = corner(200.0)
    stop = float(waypoint_stations(setup)[1]) + HALF + beyond
    assert measured(setup, fly_path(setup, stop=stop)).over is over


def test_a_flight_that_ended_before_a_waypoint_has_not_flown_its_turn() -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300], [2000, 2000, 300], [2000, 4000, 300]])
    track = fly_path(setup, stop=3000.0)
    assert measured(setup, track, 1).over
    assert measured(setup, track, 2) == TurnMeasure()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_least_radius_and_the_largest_bank_over_a_second(side: float) -> None:
    """An arc of 150 m: tan b = v^2 / (g R)."""
    setup = corner(310.0, side)
    measure = measured(setup, fly_path(setup, radius=150.0))
    assert measure.radius == pytest.approx(150.0, rel=0.005)
    assert measure.held_bank == pytest.approx(math.atan(25.0**2 / (9.80665 * 150.0)), rel=0.01)
    assert measure.angle == pytest.approx(TURN, abs=1e-3)


@pytest.mark.parametrize(("early", "seen"), [(27.0, 0.0), (13.0, 0.24)])
def test_a_turn_is_settled_over_the_last_second_before_the_next(early: float, seen: float) -> None:
    """Half a metre off until so near to the next turn: 12 of the last second's 25 m."""
    setup = make_setup([[0, 0, 300], [0, 2000, 300], [2000, 2000, 300], [2000, 4000, 300]])
    begin = float(waypoint_stations(setup)[2]) - 0.25 * math.pi * bank_radius()
    track = fly_path(setup, across=lambda s: 0.5 * ((s > begin - 300.0) & (s < begin - early)), rate=120.0)
    assert measured(setup, track).settled == pytest.approx(seen, abs=0.015)


def test_a_clean_turn_is_measured_as_it_was_flown(setup: FlightSetup, track: Track) -> None:
    demands = route_demands(setup)
    aligned = lay_track(demands, track)
    assert aligned is not None
    for i in (1, 2, 3):
        measure = measure_turn(demands, aligned, i)
        assert measure.fitted
        assert measure.over
        assert measure.full_circles == 0
        assert measure.angle == pytest.approx(abs(demands.turns[i]), abs=1e-4)
        assert measure.radius == pytest.approx(bank_radius(), rel=0.02)
        assert measure.held_bank == pytest.approx(math.radians(30.0), abs=0.01)
        assert measure.passed == pytest.approx(demands.fly_by_offset[i], abs=0.1)


def test_a_turn_that_was_not_reached_has_no_numbers(setup: FlightSetup) -> None:
    demands = route_demands(setup)
    aligned = lay_track(demands, fly_path(setup, stop=2500.0))
    assert aligned is not None
    assert measure_turn(demands, aligned, 3) == TurnMeasure()
