"""What a route asks: turns with their arcs, legs with their limits, and the path that is planned along it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.flight_setup import FlightSetup
from logs.verdict.measures.route_demands import route_demands
from logs.verdict.places import Place
from tests.synthetic import bank_radius, make_setup

RIGHT_ANGLE = [[0, 0, 300], [0, 2000, 300], [2000, 2000, 300]]


def test_a_right_angle_in_calm_air_has_the_bank_limits_arc() -> None:
    demands = route_demands(make_setup(RIGHT_ANGLE))
    radius = bank_radius()
    assert demands.turns[1] == pytest.approx(math.pi / 2)
    assert demands.radius[1] == demands.tightest[1] == pytest.approx(radius)
    assert demands.before[1] == demands.after[1] == pytest.approx(radius)
    assert demands.fly_by_offset[1] == pytest.approx((math.sqrt(2.0) - 1.0) * radius)
    apex = demands.apexes()[1]
    assert math.hypot(apex[0] - 0.0, apex[1] - 2000.0) == pytest.approx(float(demands.fly_by_offset[1]))


def test_the_planned_path_passes_the_apexes_in_time() -> None:
    demands = route_demands(make_setup(RIGHT_ANGLE))
    path = demands.path
    assert len(path.points) == len(path.times) == len(path.legs) + 1
    assert (np.diff(path.times) > 0.0).all()
    assert sorted(set(path.legs.tolist())) == [0, 1]
    # The arc is shorter than its two tangents.
    saved = (2.0 - math.pi / 2) * bank_radius()
    assert path.times[-1] == pytest.approx((4000.0 - saved) / 25.0, rel=1e-4)
    nearest = np.sqrt(((path.points - demands.apexes()[1]) ** 2).sum(axis=1)).min()
    assert nearest < 10.0


def test_without_the_envelope_the_aircraft_limits_nothing() -> None:
    demands = route_demands(make_setup(RIGHT_ANGLE), envelope=False)
    for limits in (demands.climb, demands.dive, demands.turn_limit):
        assert np.isinf(limits).all()


def test_a_leg_that_the_wind_leaves_no_way_along_has_no_ground_speed() -> None:
    demands = route_demands(make_setup(RIGHT_ANGLE, wind={"speed_mps": 30.0, "from_deg": 0.0}))
    assert np.isnan(demands.ground_speed[0])
    assert np.isfinite(demands.path.times).all()


def test_waypoints_are_places_with_their_items(setup: FlightSetup) -> None:
    items = setup.route.items.copy()
    items[1] = -1
    demands = route_demands(replace(setup, route=replace(setup.route, items=items)))
    assert [demands.waypoint(k) for k in (1, 2)] == [Place("waypoint", 1), Place("waypoint", 2, item=2)]
