"""What a route asks: turns with their arcs, legs with their limits, and the path that is planned along it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aircraft.path_limits import BLEND_ACCELERATION
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


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_apex_lies_inside_its_corner_halfway_between_the_heights_at_its_arcs_ends(side: float) -> None:
    turn = math.radians(60.0)
    east, north = side * 2000.0 * math.sin(turn), 2000.0 + 2000.0 * math.cos(turn)
    setup = make_setup([[0, 0, 300], [0, 2000, 300 + 2000 * 0.10], [east, north, 300 + 2000 * 0.04]])
    tangent = bank_radius() * math.tan(0.5 * turn)
    inside = bank_radius() * (1.0 / math.cos(0.5 * turn) - 1.0)
    # The bisector of the corner's inside points 120 degrees to the right, or left, of north.
    toward = math.radians(120.0)
    apex = route_demands(setup).apexes()[1]
    assert apex[:2] == pytest.approx([side * inside * math.sin(toward), 2000.0 + inside * math.cos(toward)], abs=1e-6)
    # The second leg falls by 0.06: 120 m in 2 km.
    ends = 500.0 - 0.10 * tangent, 500.0 - 0.06 * tangent
    assert apex[2] == pytest.approx(0.5 * sum(ends), abs=1e-6)


def test_an_apex_of_a_corner_without_room_has_the_slopes_of_its_shorter_leg() -> None:
    points = [[0, 0, 300], [0, 2000, 300], [40, 2000, 304], [40, 4000, 304]]
    apex = route_demands(make_setup(points)).apexes()[1]
    assert apex[2] == pytest.approx(300.0 + 0.5 * 40.0 * 0.1, abs=1e-6)


def test_a_slopes_blend_is_a_parabola_about_the_waypoint_or_about_each_end_of_its_arc() -> None:
    """Of v^2 / (2 a) times the change of slope, at the highest ground speed: 25 + 5 m/s."""
    parabola = 30.0**2 / (2.0 * BLEND_ACCELERATION)
    wind = {"speed_mps": 5.0, "from_deg": 180.0}
    straight = make_setup([[0, 0, 300], [0, 2000, 380], [0, 4000, 340]], wind=wind)
    assert route_demands(straight).blend.tolist() == pytest.approx([0.0, 0.06 * parabola, 0.0])
    # Both tangents, of 0.04 and -0.01, are joined by an arc that is shorter than they are.
    turning = make_setup([[0, 0, 300], [0, 2000, 380], [2000, 2000, 360]], wind=wind)
    demands = route_demands(turning)
    radius = float(demands.radius[1])
    on_arc = (0.04 - 0.01) * radius / (radius * 0.5 * math.pi)
    assert demands.blend[1] == pytest.approx(max(abs(on_arc - 0.04), abs(on_arc + 0.01)) * parabola)


def test_a_leg_names_the_item_that_it_leads_to_and_none_of_ours() -> None:
    setup = make_setup(RIGHT_ANGLE)
    # As after a jump back to item 4, and along a lead-out that no item asks for.
    items = np.array([4, 4, -1])
    demands = route_demands(replace(setup, route=replace(setup.route, items=items)))
    assert [(demands.leg(k).index, demands.leg(k).to_item) for k in range(2)] == [(0, 4), (1, None)]
    assert [demands.waypoint(k).item for k in range(3)] == [4, 4, None]


def test_limits_of_a_mission_without_a_scenario_are_not_the_scenarios() -> None:
    setup = make_setup(RIGHT_ANGLE)
    assert route_demands(setup).limits_source == "scenario"
    alone = replace(setup, scenario=replace(setup.scenario, external=True))
    assert route_demands(alone).limits_source == "default"
