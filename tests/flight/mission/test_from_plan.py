"""Plans as missions: waypoints come back from either file form, and corners have their acceptance radius."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aircraft.catalog import load_aircraft
from aircraft.tracking import SPEED_RATIOS, TURNS, TrackingError
from flight.dynamics.envelope_tables import load_envelope
from flight.mission.fences import with_fences
from flight.mission.from_plan import plan_mission
from flight.mission.items import item_problem
from flight.mission.route import make_route
from flight.mission_files.formats import mission_text, parse_mission
from flight.simulation.setup import make_limits
from planner.procedures import ClimbOut, DepartureAndApproach, Descent
from tests.mission_lines import a_plan
from tests.soak import scaled
from world.frames import to_map
from world.scenario import load_scenario, with_wind


@settings(max_examples=scaled(40, 20), deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(-12_000, 12_000), st.floats(-9000, 9000), st.floats(300, 1100)),
        min_size=2,
        max_size=20,
        unique_by=lambda p: (round(p[0] / 10), round(p[1] / 10)),
    )
)
def test_an_exported_plan_comes_back(points: list[tuple[float, float, float]]) -> None:
    """Through both forms, with equal numbers, to the planned waypoints within the grid's 8 mm."""
    plan = a_plan(points)
    exported = plan_mission(plan, 25.0, math.radians(30.0))
    assert all(item_problem(item) is None for item in exported.items)
    assert parse_mission(mission_text(exported, "waypoints"), "a.waypoints") == exported
    assert parse_mission(mission_text(exported, "plan"), "a.plan") == exported
    assert parse_mission(mission_text(exported, "plan"), "a.plan").cruise_speed == 25.0
    flown = make_route(exported, plan.scenario.origin, plan.scenario.terrain, 18.0, False)
    assert flown.positions.shape == plan.waypoints.shape
    assert np.abs(flown.positions - plan.waypoints).max() < 0.008
    assert set(flown.leg_airspeeds.tolist()) == {25.0}
    assert flown.notes == ()
    assert (flown.points["acceptance_radius"] >= 10.0).all()


def test_a_corner_has_its_fly_by_offset_as_acceptance() -> None:
    """R = 625 / (9.80665 tan 30) = 110.39 m; at 60 degrees the arc passes R(1/cos 30 - 1) = 17.08 m from the corner."""
    corner = [(0.0, 0.0, 700.0), (0.0, 1000.0, 700.0), (866.0, 1500.0, 700.0)]
    exported = plan_mission(a_plan(corner), 25.0, math.radians(30.0))
    assert [item.params[1] for item in exported.items] == [25.0, 10.0, 28.0, 10.0]
    assert exported.home is not None
    terrain = load_scenario("jacksboro-air").terrain
    assert terrain is not None
    assert exported.home.alt == pytest.approx(float(terrain.height(0.0, 0.0)), abs=0.001)


@pytest.mark.parametrize("turbulence", ["none", "moderate"])
@pytest.mark.parametrize("turn_deg", [20.0, 90.0, 140.0, 149.0, 151.0, 170.0])
def test_no_arc_of_the_flight_misses_the_radius_that_is_exported(turn_deg: float, turbulence: str) -> None:
    turn = math.radians(turn_deg)
    corner = [(0.0, 0.0, 700.0), (0.0, 5000.0, 700.0), (5000 * math.sin(turn), 5000 + 5000 * math.cos(turn), 700.0)]
    plan = a_plan(corner)
    # The turn begins downwind, where its ground speed is highest.
    plan = replace(plan, scenario=with_wind(plan.scenario, 8.0, math.pi, turbulence))
    limits = make_limits(plan.scenario, load_envelope(load_aircraft("aerosonde")), 25.0, math.radians(30.0))
    exported = plan_mission(plan, 25.0, math.radians(30.0))
    route = make_route(exported, plan.scenario.origin, plan.scenario.terrain, 25.0, False, limits)
    assert not route.fly_over.any()
    # By plain sums: 25 m/s, 8 of wind, and a tenth of the 15.4 m/s (30 kn) at 6 m.
    gust = 0.1 * 15.4 if turbulence == "moderate" else 0.0
    radius = (25.0 + 8.0 + gust) ** 2 / (9.80665 * math.tan(math.radians(30.0)))
    assert exported.items[2].params[1] >= radius / math.cos(turn / 2.0) - radius


def test_a_corner_has_the_acceptance_that_its_autopilot_strays_least_with() -> None:
    """Of a table that is 100 m a radian and 2 m for each m/s over 25: at 60 degrees, 25.8 m/s at 700 m, 106.4 m."""
    turns, speeds = np.meshgrid(TURNS, SPEED_RATIOS * 25.0, indexing="ij")
    acceptance = 15.0 + 100.0 * turns + 2.0 * (speeds - 25.0)
    nothing = np.zeros(turns.shape)
    error = TrackingError(25.0, acceptance, nothing, nothing, nothing, across=0.0, up=0.0, lag=3.0, step=15.0)
    corner = [(0.0, 0.0, 700.0), (0.0, 1000.0, 700.0), (866.0, 1500.0, 700.0)]
    exported = plan_mission(a_plan(corner), 25.0, math.radians(30.0), tracking=error)
    assert [item.params[1] for item in exported.items] == [25.0, 15.0, 121.0, 15.0]
    windy = replace(a_plan(corner), scenario=with_wind(load_scenario("jacksboro-air"), 8.0, math.radians(240.0), None))
    # On the second leg, at 60 degrees, the wind is from behind: 33.8 m/s.
    blown = plan_mission(windy, 25.0, math.radians(30.0), tracking=error)
    assert blown.items[2].params[1] == pytest.approx(15.0 + 104.7 + 2.0 * 8.85, abs=1.0)


def test_a_plan_from_the_ground_begins_with_a_take_off_and_ends_with_a_landing() -> None:
    plan = a_plan([(0.0, 0.0, 700.0), (0.0, 2000.0, 700.0)])
    up = ClimbOut(np.array([-500.0, -900.0, 400.0]), 0.6, 470.0, np.array([[-100.0, -400.0, 500.0]]), 0.15)
    line_up = np.array([[3000.0, 2000.0, 520.0], [3000.0, 1200.0, 520.0]])
    down = Descent(
        np.array([[2000.0, 2500.0, 640.0]]), line_up, np.array([3000.0, 400.0, 450.0]), math.pi, 0.0875, 130.0
    )
    scenario = load_scenario("jacksboro-field")
    returns = scenario.returns
    assert returns is not None
    plan = replace(
        plan,
        procedures=DepartureAndApproach(up, down),
        scenario=replace(plan.scenario, home=up.home, returns=returns, landing=scenario.landing),
    )
    mission = plan_mission(plan, 25.0, math.radians(30.0))
    assert [item.command for item in mission.items] == [22, 178, 16, 16, 16, 16, 189, 16, 16, 21]
    assert all(item_problem(item) is None for item in mission.items)
    takeoff, land = mission.items[0], mission.items[-1]
    east, north = to_map(plan.scenario.origin, takeoff.lat_deg, takeoff.lon_deg)
    assert (float(east), float(north), takeoff.alt) == pytest.approx((-500.0, -900.0, 470.0), abs=0.01)
    assert takeoff.params[0] > 0.0
    east, north = to_map(plan.scenario.origin, land.lat_deg, land.lon_deg)
    assert (float(east), float(north), land.alt) == pytest.approx((3000.0, 400.0, 450.0), abs=0.01)
    # A go-around's height over home is the landing's first number.
    assert land.params[0] == 130.0
    assert mission.home is not None
    terrain = plan.scenario.terrain
    assert terrain is not None
    assert mission.home.alt == pytest.approx(float(terrain.height(-500.0, -900.0)), abs=0.001)
    # Rally points at heights over home, whatever is below them.
    (rally,) = mission.rally
    assert rally.frame == 3
    assert rally.alt == pytest.approx(returns.rally[0, 2] - mission.home.alt, abs=0.001)
    for kind in ("waypoints", "plan"):
        assert parse_mission(mission_text(mission, kind), f"a.{kind}").items == mission.items
    assert parse_mission(mission_text(mission, "plan"), "a.plan").rally == mission.rally
    # The fence of a plan leaves its rally points alone, and has none at the landing point.
    assert with_fences(mission, plan.scenario, lambda shape: False)[0].rally == mission.rally
    assert with_fences(replace(mission, rally=()), plan.scenario, lambda shape: False)[0].rally == ()
