"""Which rows are usable, and which waypoints a flight has passed, just inside and just outside."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import airspeed_gain_in_rising_air, align_track
from tests.synthetic import edited, fly_path, make_setup, waypoint_stations

GRAVITY = 9.80665
STRAIGHT = [[0, 0, 300], [0, 3000, 300], [0, 6000, 300]]


@pytest.fixture(scope="module")
def setup() -> FlightSetup:
    return make_setup(STRAIGHT)


@pytest.mark.parametrize(
    ("column", "value", "bad"),
    [
        ("position", 9e6, 0),
        ("position", -1.1e7, 1),
        ("velocity", 9e3, 0),
        ("velocity", -1.1e4, 1),
        ("attitude", 900.0, 0),
        ("attitude", -1100.0, 1),
        ("controls", 900.0, 0),
        ("controls", 1100.0, 1),
        ("wind", -900.0, 0),
        ("wind", 1100.0, 1),
        ("airspeed", 1e9, 0),
        ("airspeed", np.inf, 1),
        ("energy", np.nan, 1),
    ],
)
def test_a_row_with_a_number_that_no_flight_has_is_bad(setup: FlightSetup, column: str, value: float, bad: int) -> None:
    track = fly_path(setup)
    values = np.asarray(getattr(track, column), dtype=np.float64).copy()
    values[1000] = value
    aligned = align_track(route_requirements(setup), edited(track, **{column: values}))
    assert aligned is not None
    assert aligned.bad_rows == bad


@pytest.mark.parametrize(
    ("acceptance", "short", "arrived"),
    # Where the mission states no radius, and where it states a smaller or a larger one.
    [
        (0.0, 9.7, True),
        (0.0, 10.3, False),
        (3.0, 9.7, True),
        (3.0, 10.3, False),
        (30.0, 29.7, True),
        (30.0, 30.3, False),
    ],
)
def test_a_flight_that_ends_ten_metres_short_has_arrived(
    setup: FlightSetup, acceptance: float, short: float, arrived: bool
) -> None:
    stated = replace(setup, route=setup.route.with_fields(acceptance_radius=acceptance))
    aligned = align_track(route_requirements(stated), fly_path(setup, stop=6000.0 - short))
    assert aligned is not None
    assert aligned.passed.tolist() == [True, True, arrived]


@pytest.mark.parametrize(("aside", "passed"), [(490.0, True), (510.0, False)])
def test_a_waypoint_further_than_half_a_kilometre_aside_is_none_of_the_flights(
    setup: FlightSetup, aside: float, passed: bool
) -> None:
    """Past the last waypoint and 3 km on, at this distance beside it."""
    longer = make_setup([*STRAIGHT[:2], [0, 9000, 300]])
    track = fly_path(longer, across=lambda s: aside * np.clip((s - 3200.0) / 2000.0, 0.0, 1.0))
    aligned = align_track(route_requirements(setup), track)
    assert aligned is not None
    assert aligned.passed.tolist() == [True, True, passed]


def test_a_place_passed_twice_has_each_time_the_rows_of_its_own_passage() -> None:
    """Two rounds of a square at one height, the first 3 m aside: the rows nearest to its waypoints are the second's."""
    square = [[0.0, 0.0, 300.0], [0.0, 1500.0, 300.0], [1500.0, 1500.0, 300.0], [1500.0, 0.0, 300.0]]
    setup = make_setup(square + square)
    stations = waypoint_stations(setup)
    between = 0.5 * float(stations[3] + stations[4])
    track = fly_path(setup, rate=20.0, across=lambda s: 3.0 * (s < between))
    aligned = align_track(route_requirements(setup), track)
    assert aligned is not None
    assert aligned.track.time[aligned.rows] == pytest.approx(stations / 25.0, abs=1.0)


def test_speed_from_rising_air_fades_within_twelve_seconds() -> None:
    time = np.arange(0.0, 60.0, 0.01)
    rising = np.where(time < 5.0, 1.0, 0.0).astype(np.float32)
    gained = airspeed_gain_in_rising_air(time, np.full(time.size, 25.0, dtype=np.float32), rising)
    ended = int(np.argmax(gained))
    assert gained[ended + 1200] / gained[ended] == pytest.approx(math.exp(-1.0), rel=0.01)


@pytest.mark.parametrize(("speed", "gains_as"), [(2.0, 10.0), (9.0, 10.0), (11.0, 11.0)])
def test_an_aircraft_that_has_nearly_stopped_gains_as_one_at_ten_metres_a_second(speed: float, gains_as: float) -> None:
    time = np.arange(0.0, 0.2, 0.01)
    airspeed = np.full(time.size, speed, dtype=np.float32)
    gained = airspeed_gain_in_rising_air(time, airspeed, np.ones(time.size, dtype=np.float32))
    assert gained[-1] == pytest.approx(GRAVITY * 0.19 / gains_as, rel=0.02)
