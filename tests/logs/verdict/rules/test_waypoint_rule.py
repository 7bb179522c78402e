"""Waypoints passed and missed."""

import pytest

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from tests.logs.verdict.judging import ROUTE, failing, judge, of, waypoint
from tests.synthetic import (
    bump,
    fly_path,
    make_setup,
    waypoint_stations,
)


def test_a_missed_waypoint(setup: FlightSetup) -> None:
    station = float(waypoint_stations(setup)[1])
    near = judge(setup, fly_path(setup, across=bump(station, 8.0, 150.0)))
    far = judge(setup, fly_path(setup, across=bump(station, 20.0, 150.0)))
    assert of(near, "waypoint", waypoint(1)).ok
    assert ("waypoint", waypoint(1)) in failing(far)
    assert of(far, "waypoint", waypoint(1)).flown == pytest.approx(9.1 + 20.0, abs=0.5)
    high = judge(setup, fly_path(setup, up=bump(station, 20.0, 100.0)))
    assert ("waypoint", waypoint(1)) in failing(high)


def test_fly_over_waypoints_are_flown_over(setup: FlightSetup, track: Track) -> None:
    over = make_setup(ROUTE, fly_over=(3,))
    # The fly-by cuts waypoint 3 by 30 m: good for a fly-by, a miss for a fly-over.
    assert ("waypoint", waypoint(3)) in failing(judge(over, track))
    assert of(judge(over, track), "waypoint", waypoint(3)).limit == pytest.approx(10.0)


def test_a_wide_blend_between_steep_slopes_is_no_miss() -> None:
    # From falling to climbing in a 100 degree turn the fly-by path passes 20 m above the waypoint.
    setup = make_setup([[0, 0, 900], [0, 1500, 750], [1500, 1235, 980]])
    assert judge(setup, fly_path(setup)).flyable
    low = fly_path(setup, up=bump(float(waypoint_stations(setup)[1]), -25.0, 60.0))
    assert ("waypoint", waypoint(1)) in failing(judge(setup, low))
