"""Turns as flown, by each hand and on each course: angle, bank, radius, overshoot, and which flights got past them."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track, join_tracks
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.measures.turns import NEXT_LEG_FRACTION, TurnMeasure, measure_turn, measure_turns
from tests.soak import some
from tests.synthetic import bank_radius, bump, copied, edited, fly_path, make_setup, waypoint_stations

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
    requirements = route_requirements(setup)
    aligned = align_track(requirements, track)
    assert aligned is not None
    return measure_turn(requirements, aligned, i)


@pytest.mark.parametrize("course", some([50.0, 0.0, 290.0, 200.0], 2))
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
    assert (measure.is_complete, measure.full_circles) == (True, 0)
    assert measure.settled_distance == pytest.approx(0.0, abs=0.01)


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
    assert measured(setup, fly_path(setup, stop=stop)).is_complete is over


def test_a_flight_that_ended_before_a_waypoint_has_not_flown_its_turn() -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300], [2000, 2000, 300], [2000, 4000, 300]])
    track = fly_path(setup, stop=3000.0)
    assert measured(setup, track, 1).is_complete
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
    assert measured(setup, track).settled_distance == pytest.approx(seen, abs=0.015)


def test_a_clean_turn_is_measured_as_it_was_flown(setup: FlightSetup, track: Track) -> None:
    requirements = route_requirements(setup)
    aligned = align_track(requirements, track)
    assert aligned is not None
    for i in (1, 2, 3):
        measure = measure_turn(requirements, aligned, i)
        assert measure.is_fitted
        assert measure.is_complete
        assert measure.full_circles == 0
        assert measure.angle == pytest.approx(abs(requirements.turns[i]), abs=1e-4)
        assert measure.radius == pytest.approx(bank_radius(), rel=0.02)
        assert measure.held_bank == pytest.approx(math.radians(30.0), abs=0.01)
        assert measure.min_distance == pytest.approx(requirements.fly_by_offset[i], abs=0.1)


def test_a_turn_that_was_not_reached_has_no_numbers(setup: FlightSetup) -> None:
    requirements = route_requirements(setup)
    aligned = align_track(requirements, fly_path(setup, stop=2500.0))
    assert aligned is not None
    assert measure_turn(requirements, aligned, 3) == TurnMeasure()


# ----------------------------------------------------------------------
# How corners of imported flights were passed, against sums on polylines made by hand.

Place = tuple[float, float]
# Two kilometres north, then one to the east, then north again.
ROUTE: tuple[Place, ...] = ((0.0, 0.0), (0.0, 2000.0), (1000.0, 2000.0), (1000.0, 4000.0))


def passes(flown: Sequence[Place], route: Sequence[Place] = ROUTE) -> list[TurnMeasure]:
    """The turns of a flight along straight lines from place to place."""
    setup = make_setup([(east, north, 300.0) for east, north in route])
    track = fly_path(setup)
    way = np.array(flown)
    marks = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
    along = np.linspace(0.0, marks[-1], len(track))
    level = np.full(len(track), 300.0)
    position = np.column_stack([np.interp(along, marks, way[:, 0]), np.interp(along, marks, way[:, 1]), level])
    requirements = route_requirements(setup)
    aligned = align_track(requirements, edited(track, position=position))
    assert aligned is not None
    return measure_turns(requirements, aligned, follows_arcs=False)


def test_a_flight_over_the_corners_overshoots_none() -> None:
    found = passes(ROUTE)
    assert [one.min_distance for one in found] == pytest.approx([0.0, 0.0], abs=0.3)
    assert [one.overshoot for one in found] == pytest.approx([0.0, 0.0], abs=0.3)


def test_how_far_past_the_new_leg_a_flight_went() -> None:
    """80 m too far north, back on the leg 400 m along it."""
    found = passes([(0.0, 0.0), (0.0, 2080.0), (400.0, 2000.0), *ROUTE[2:]])
    assert found[0].overshoot == pytest.approx(80.0, abs=0.5)
    assert found[0].min_distance == pytest.approx(0.0, abs=0.3)
    # Cut inside, the other side is none.
    inside = passes([(0.0, 0.0), (0.0, 1900.0), (400.0, 1920.0), (600.0, 2000.0), *ROUTE[2:]])
    assert inside[0].overshoot == 0.0
    assert inside[0].min_distance == pytest.approx(100.0, abs=0.5)


@pytest.mark.parametrize(("peak", "counts"), [(NEXT_LEG_FRACTION - 0.03, True), (NEXT_LEG_FRACTION + 0.15, False)])
def test_only_the_first_part_of_the_next_leg_is_looked_at(peak: float, counts: bool) -> None:
    """A bulge of 50 m whose foot is 50 m before it, and 100 m after."""
    top = 1000.0 * peak
    found = passes([*ROUTE[:2], (top - 50.0, 2000.0), (top, 2050.0), (top + 100.0, 2000.0), *ROUTE[2:]])
    assert found[0].overshoot == pytest.approx(50.0 if counts else 0.0, abs=0.5)


def test_the_look_ends_at_the_very_place_between_rows() -> None:
    """On a way that leaves the next leg by 0.1 m a metre that is 70 m at seven tenths of it."""
    found = passes([*ROUTE[:2], (1000.0, 2100.0), ROUTE[3]])
    assert found[0].overshoot == pytest.approx(0.1 * NEXT_LEG_FRACTION * 1000.0, abs=1e-6)


def test_each_pass_comes_after_the_one_before() -> None:
    """A route that goes out and back: the flight is as near to its third place on the way out."""
    back: tuple[Place, ...] = ((0.0, 0.0), (0.0, 2000.0), (300.0, 2000.0), (300.0, 0.0))
    found = passes([(0.0, 0.0), (100.0, 2000.0), (300.0, 2000.0), (300.0, 0.0)], back)
    first_time, second_time = (one.pass_time for one in found)
    assert first_time is not None
    assert second_time is not None
    assert first_time < second_time
    assert [one.min_distance for one in found] == pytest.approx([99.9, 0.0], abs=0.3)


def test_a_leg_that_was_cut_off_is_not_joined() -> None:
    """Past the second waypoint the aircraft is already 200 m beyond the short leg's end."""
    short: tuple[Place, ...] = ((0.0, 0.0), (0.0, 2000.0), (50.0, 2000.0), (2000.0, 2000.0))
    found = passes([(0.0, 0.0), (250.0, 1800.0), (250.0, 2000.0), (2000.0, 2000.0)], short)
    assert found[0].overshoot is None
    # The nearest place of the first straight to (0, 2000) is its end, or on the next.
    assert found[0].min_distance == pytest.approx(250.0, abs=1.0)
    assert found[0].overrun == pytest.approx(200.0, abs=1.0)
