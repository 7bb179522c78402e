"""The controls' limits, and the rows at which one is asked for all that it gives."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.guidance.gains import load_gains
from flight.simulation.airborne import PATIENCE, PATIENCE_SECONDS, Airborne, LocalMap, control_limits, held_at_limit
from flight.simulation.track import AILERON, ELEVATOR, RUDDER, THROTTLE, TRACK_ROW, Track, as_track
from tests.setups import MakeSetup, setup_maker
from world.errors import FlightError
from world.frames import GeoOrigin, to_map


def commanded(column: int, *values: float) -> Track:
    rows: Any = np.zeros(len(values), TRACK_ROW)
    rows["commands"][:, column] = values
    return as_track(rows)


def test_limits_stand_in_the_order_of_the_commands() -> None:
    # 30 degrees of each surface: aircraft/aerosonde/aerosonde.toml.
    named = control_limits("aerosonde")
    assert [name for name, _ in named] == ["elevator", "aileron", "rudder", "throttle"]
    assert [limit for _, limit in named[:3]] == pytest.approx([math.radians(30.0)] * 3, abs=1e-3)
    assert named[THROTTLE] == ("throttle", 1.0)


def test_an_unknown_aircraft_has_a_throttle_and_no_limits() -> None:
    named = dict(control_limits("zeppelin"))
    assert named["throttle"] == 1.0
    assert all(math.isnan(named[name]) for name in ("elevator", "aileron", "rudder"))


@pytest.mark.parametrize("column", [ELEVATOR, AILERON, RUDDER])
def test_a_surface_is_held_at_either_limit_or_beyond(column: int) -> None:
    # Within a thousandth of the range, which is 1 here.
    track = commanded(column, -0.6, -0.5, -0.4995, -0.498, 0.0, 0.498, 0.4995, 0.5, 0.6)
    assert held_at_limit(track, column, -0.5, 0.5).tolist() == [True] * 3 + [False] * 3 + [True] * 3
    other = AILERON if column == ELEVATOR else ELEVATOR
    assert not held_at_limit(track, other, -0.5, 0.5).any()


def test_a_throttle_is_held_closed_and_open() -> None:
    track = commanded(THROTTLE, 0.0, 0.002, 0.5, 0.998, 1.0)
    assert held_at_limit(track, THROTTLE, 0.0, 1.0).tolist() == [True, False, False, False, True]


def test_unknown_limits_hold_nothing() -> None:
    assert not held_at_limit(commanded(ELEVATOR, -9.0, 0.0, 9.0), ELEVATOR, math.nan, math.nan).any()


# ----------------------------------------------------------------------
# The local map projection against the map that it copies.


@pytest.mark.parametrize("origin", [GeoOrigin(36.6, -84.2), GeoOrigin(70.0, 179.0), GeoOrigin(-45.0, 10.0)])
def test_positions_and_the_course_of_north_are_the_maps(make_setup: MakeSetup, origin: GeoOrigin) -> None:
    at = {"lat_deg": origin.lat_deg, "lon_deg": origin.lon_deg}
    setup = make_setup([[-15000, 0, 500], [15000, 9000, 500]], origin=at)
    local = LocalMap.around(setup)
    lat = origin.lat_deg + np.linspace(-0.05, 0.1, 40)
    lon = origin.lon_deg + np.linspace(-0.2, 0.15, 40)
    east, north = to_map(origin, lat, lon)
    got = local.position(np.radians(lat), np.radians(lon))
    assert np.hypot(got[0] - east, got[1] - north).max() < 1e-3
    # Map course of true north, by a step of a hundredth of a second of arc to the north.
    ahead_e, ahead_n = to_map(origin, lat + 1e-4, lon)
    back_e, back_n = to_map(origin, lat - 1e-4, lon)
    turn = local.angle(np.radians(lat), np.radians(lon))[0]
    assert turn == pytest.approx(np.arctan2(ahead_e - back_e, ahead_n - back_n), abs=1e-7)


# ----------------------------------------------------------------------
# An aircraft in the air: where its route has it start, and how long it may take.

AEROSONDE = load_aircraft("aerosonde")
MAKE = setup_maker(AEROSONDE)


class Gliding(Airborne):
    """Nobody steers it."""

    def _fly(self, count: int) -> int:
        return 0


def airborne(points: object, **keywords: object) -> Gliding:
    setup = MAKE(points, **keywords)
    return Gliding(setup, AEROSONDE, load_gains(AEROSONDE))


def test_a_route_starts_at_its_first_waypoint_on_its_first_leg() -> None:
    points = [[0.0, 0.0, 500.0], [1000.0, 1000.0, 600.0]]
    setup = MAKE(points, wind=(6.0, 270.0))
    start = Gliding(setup, AEROSONDE, load_gains(AEROSONDE))._start(setup)
    assert (start.amsl, start.ground, start.airspeed) == (500.0, 100.0, 25.0)
    assert start.course == pytest.approx(math.pi / 4.0, abs=1e-6)
    assert start.slope == pytest.approx(math.atan2(100.0, math.hypot(1000.0, 1000.0)))
    # From the west: the air moves east.
    assert start.wind == pytest.approx((0.0, 6.0, 0.0), abs=1e-6)


def test_a_start_in_the_ground_is_refused() -> None:
    setup = MAKE([[0.0, 0.0, 150.0], [1000.0, 0.0, 200.0]])
    low = setup.route.waypoints - [0.0, 0.0, 51.0]
    setup = replace(setup, route=replace(setup.route, waypoints=low))
    with pytest.raises(FlightError, match="start at 99 m AMSL: not above the terrain, which is at 100 m"):
        Gliding(setup, AEROSONDE, load_gains(AEROSONDE))._start(setup)


def test_a_flight_may_take_its_length_at_its_slowest_ground_speed_and_more() -> None:
    flight = airborne([[0.0, 0.0, 500.0], [0.0, 3000.0, 500.0]], wind=(5.0, 0.0))
    seconds = PATIENCE * 3000.0 / 20.0 + PATIENCE_SECONDS
    assert flight.max_ticks == pytest.approx(seconds / flight.dt, abs=60)


def test_a_block_ends_with_the_time() -> None:
    flight = airborne([[0.0, 0.0, 500.0], [0.0, 300.0, 500.0]])
    flight._disturb(MAKE(np.array([[0.0, 0.0, 500.0], [0.0, 300.0, 500.0]])))
    flight.max_ticks = 0
    rows, ended = flight.block(10)
    assert len(rows) == 0
    assert ended == "time limit: not finished after 0 s"
