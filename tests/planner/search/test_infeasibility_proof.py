"""Walls of missiles across the map: closed, with a gap, with a way under them; and the search that ends at them."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import planner.search.plan_path as plan_path_module
from aircraft.path_limits import Limits
from planfly.workflow.uav import load_uav
from planner.evaluation.problem import ProblemArrays, make_problem
from planner.search.explain_failure import explain_failure
from planner.search.infeasibility_proof import blocking_missiles, highest_level_flight, is_closed
from planner.search.plan_path import plan_path
from tests.fresh_plans import fresh_scenario
from world.scenario import Scenario

Small = Callable[..., Scenario]
MakeLimits = Callable[[Scenario], Limits]

FLAT = {"kind": "flat", "amsl_m": 0}
RADIUS, CEILING = 600.0, 450.0
# Radius of a sphere on the ground at the ceiling, m.
ABOVE = (RADIUS**2 - CEILING**2) ** 0.5


def unit(name: str, east: float, north: float, **more: float) -> dict[str, Any]:
    return {"name": name, "east_m": east, "north_m": north, "kill_radius_m": RADIUS, "kill_scale_m": 200.0, **more}


def wall(*without: int) -> list[dict[str, Any]]:
    """Eleven units from the southern to the northern edge of the map."""
    return [unit(f"w{k}", 3000.0, 600.0 * (k - 5)) for k in range(11) if k not in without]


def arrays(small: Small, make_limits: MakeLimits, threats: list[dict[str, Any]], **tables: Any) -> ProblemArrays:
    scenario = small(**({"terrain": FLAT, "threats": threats} | tables))
    return make_problem(scenario, make_limits(scenario)).certified


def test_a_wall_is_closed_and_its_units_are_named(small: Small, make_limits: MakeLimits) -> None:
    beside = [unit("south", 1000.0, -2000.0), unit("north", 5000.0, 2000.0)]
    data = arrays(small, make_limits, [beside[0], *wall(), beside[1]])
    assert is_closed(data)
    assert blocking_missiles(data) == list(range(1, 12))
    # Two walls: either suffices.
    second = [unit(f"v{k}", 4500.0, 600.0 * (k - 5)) for k in range(11)]
    assert blocking_missiles(arrays(small, make_limits, wall() + second)) in (list(range(11)), list(range(11, 22)))


@pytest.mark.parametrize("missing", [0, 5, 10])
def test_a_wall_without_one_unit_is_open(missing: int, small: Small, make_limits: MakeLimits) -> None:
    data = arrays(small, make_limits, wall(missing))
    assert not is_closed(data)
    assert blocking_missiles(data) is None


@pytest.mark.parametrize(("gap", "closed"), [(-60.0, True), (5.0, False)])
def test_a_gap_is_measured_at_the_ceiling(gap: float, closed: bool, small: Small, make_limits: MakeLimits) -> None:
    """Two units whose spheres leave so many m between them at the ceiling, or overlap there; others beyond them."""
    middle = ABOVE + 0.5 * gap
    north = [middle + 600.0 * k for k in range(5)]
    data = arrays(small, make_limits, [unit(f"{y:.0f}", 3000.0, y) for y in (*north, *(-y for y in north))])
    assert is_closed(data) is closed
    # With a margin, the spheres overlap: their radius at the ceiling is 75 m larger.
    assert is_closed(data, margin=50.0)


def test_missiles_are_passed_below(small: Small, make_limits: MakeLimits) -> None:
    """Spheres around 900 m reach down to 300 m."""
    high = [one | {"amsl_m": 900.0} for one in wall()]
    assert not is_closed(arrays(small, make_limits, high))
    hills = [{"east_m": 3000, "north_m": 300 * k, "height_m": 250, "sigma_m": 300} for k in range(-12, 13)]
    # The ground with its clearance is higher than that.
    assert is_closed(arrays(small, make_limits, high, terrain={"kind": "peaks", "peak": hills}))


def test_the_ground_alone_closes(small: Small, make_limits: MakeLimits) -> None:
    hills = [{"east_m": 3000, "north_m": 300 * k, "height_m": 400, "sigma_m": 300} for k in range(-12, 13)]
    ground = {"terrain": {"kind": "peaks", "peak": hills}}
    assert blocking_missiles(arrays(small, make_limits, wall(5), **ground)) == []


def test_the_search_ends_at_a_wall_and_says_what_closes_it(
    small: Small, make_limits: MakeLimits, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise AssertionError("a path was searched for that is proven not to exist")

    monkeypatch.setattr(plan_path_module, "run_waypoint_generations", refused)
    monkeypatch.setattr(plan_path_module, "search_turning_back", refused)
    scenario = small(terrain=FLAT, threats=[*wall(), unit("beside", 1000.0, -2000.0)])
    limits = make_limits(scenario)
    plan = plan_path(scenario, limits, seed=1)
    assert not plan.safe
    assert plan.ended == "completed"
    line = next(line for line in explain_failure(plan, limits) if line.startswith("no path exists"))
    assert all(f"w{k}" in line for k in range(11))
    assert "beside" not in line
    np.testing.assert_array_equal(plan.waypoints[[0, -1]], [scenario.start, scenario.destination])


# ----------------------------------------------------------------------
# Above some height an aircraft is too slow to fly level: that closes like a ceiling.


def in_thin_air(data: ProblemArrays, *climb: float, **more: float) -> ProblemArrays:
    """The arrays with these climbs (rad) at 0 m, 100 m and so on, at an equivalent airspeed of 25 m/s."""
    table = data.aircraft._replace(
        airspeed=25.0,
        equivalent=1.0,
        amsl=100.0 * np.arange(len(climb)),
        climb=np.array(climb),
        descent=np.full(len(climb), 0.2),
    )
    return data._replace(aircraft=table._replace(**more), max_climb=math.nan, max_dive=math.nan)


def test_level_flight_ends_where_the_climb_does(small: Small, make_limits: MakeLimits) -> None:
    data = arrays(small, make_limits, [])
    # From 0.1 rad at 200 m to -0.3 rad at 300 m: none at a quarter of the way.
    falling = (0.2, 0.2, 0.1, -0.3, -0.3, -0.3)
    assert highest_level_flight(in_thin_air(data, *falling)) == pytest.approx(225.0, abs=1e-3)
    assert highest_level_flight(in_thin_air(data, -0.1, -0.1, -0.1, -0.1, -0.1, -0.1)) == -math.inf
    # It need not be known above the ceiling of 450 m, and is no limit if level flight is possible up to there.
    assert highest_level_flight(in_thin_air(data, *falling, math.nan)) == pytest.approx(225.0, abs=1e-3)
    for climb in ((0.2, 0.2, 0.2, 0.2, 0.2, 0.0, -0.1), (0.2, 0.1, -0.3, math.nan, math.nan, math.nan)):
        assert highest_level_flight(in_thin_air(data, *climb)) == math.inf


def test_level_flight_is_no_limit_where_legs_may_lead_without_it(small: Small, make_limits: MakeLimits) -> None:
    data, falling = arrays(small, make_limits, []), (0.2, 0.2, 0.1, -0.3, -0.3, -0.3)
    # At a true airspeed it sinks, but a leg may sink; with slopes stated, these count; a gale blows legs anywhere.
    assert highest_level_flight(in_thin_air(data, *falling, equivalent=0.0)) == math.inf
    assert highest_level_flight(in_thin_air(data, *falling)._replace(max_dive=0.2)) == math.inf
    assert highest_level_flight(in_thin_air(data, *falling)._replace(max_climb=0.2)) == math.inf
    # The slowest airspeed over ground in still air is 25 m/s, a percent more at 225 m, along a slope of 0.3 rad.
    slowest = 25.0 * 1.0110 * math.cos(0.3)
    assert highest_level_flight(in_thin_air(data, *falling, wind_speed=slowest - 0.1)) < math.inf
    assert highest_level_flight(in_thin_air(data, *falling, wind_speed=slowest + 0.1)) == math.inf


@pytest.mark.parametrize(("climb", "closed"), [(0.049, True), (0.051, False)])
def test_an_end_above_level_flight_is_closed(climb: float, closed: bool, small: Small, make_limits: MakeLimits) -> None:
    """Both ends are at 150 m; level flight ends at 149 and at 151 m."""
    data = in_thin_air(arrays(small, make_limits, []), 0.2, climb, climb - 0.1, -0.3, -0.3, -0.3)
    assert is_closed(data) is closed


@pytest.mark.parametrize(
    ("start_up", "wind", "closed"), [(140.0, 0.0, True), (140.0, 15.0, False), (160.0, 0.0, False)]
)
def test_a_destination_to_which_the_aircraft_can_only_climb_too_gently_is_closed(
    start_up: float, wind: float, closed: bool, small: Small, make_limits: MakeLimits
) -> None:
    """The destination is at 150 m, where the aircraft climbs 0.3°; 0.5° remain as a margin to slopes.

    Over the ground it climbs up to 0.3° x 25 / (25 - 15) = 0.75° against a wind of 15 m/s. A path from a start above
    the destination needs no climb.
    """
    data = arrays(small, make_limits, [])
    assert math.degrees(data.angle_margin) == pytest.approx(0.5)
    climb = np.radians([1.3, 0.8, -0.2, -1.2, -2.2, -3.2])
    start, destination = np.array([*data.start[:2], start_up]), np.array([*data.destination[:2], 150.0])
    assert (
        is_closed(in_thin_air(data, *climb, wind_speed=wind)._replace(start=start, destination=destination)) is closed
    )


@pytest.mark.parametrize(("more", "closed"), [(-5.0, True), (15.0, False)])
def test_ground_is_not_passed_above_level_flight(
    more: float, closed: bool, small: Small, make_limits: MakeLimits
) -> None:
    """A ridge across the whole map; level flight ends so many m above what its lowest place and the clearance take."""
    ridge = [{"east_m": 3000, "north_m": 300 * k, "height_m": 120, "sigma_m": 300} for k in range(-14, 15)]
    scenario = small(terrain={"kind": "peaks", "peak": ridge}, threats=[])
    data = make_problem(scenario, make_limits(scenario)).certified
    assert scenario.terrain is not None
    top = float(scenario.terrain.height(3000.0, np.arange(-3000.0, 3001.0, 10.0)).min()) + data.clearance + more
    hundred, share = int(top // 100.0), top % 100.0 / 100.0
    climb = [0.2] * hundred + [0.2 * share, 0.2 * share - 0.2] + [-0.3] * (4 - hundred)
    assert 200.0 < top < 400.0
    assert is_closed(in_thin_air(data, *climb)) is closed


def test_the_search_ends_where_an_end_is_above_level_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise AssertionError("a path was searched for that is proven not to exist")

    monkeypatch.setattr(plan_path_module, "run_waypoint_generations", refused)
    monkeypatch.setattr(plan_path_module, "search_turning_back", refused)
    # A Zagi at 3,348 m, where it climbs 4.5 degrees at sea level.
    scenario = fresh_scenario(1226)
    limits = load_uav(scenario).limits.with_margin()
    plan = plan_path(scenario, limits, seed=1)
    assert not plan.safe
    line = next(line for line in explain_failure(plan, limits) if line.startswith("no path exists"))
    assert line.startswith(f"no path exists: the start is at {scenario.start[2]:.0f} m, higher than 3")
    assert "cannot fly level at 15 m/s" in line
    assert not any("--budget" in line for line in explain_failure(plan, limits))


def test_a_destination_above_the_highest_climb_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """A Zagi from 2,985 m to 3,054 m: it climbs 0.25 degrees at 3,000 m, half of the margin to slopes."""
    scenario = fresh_scenario(2378)
    limits = load_uav(scenario).limits.with_margin()
    plan = plan_path(scenario, limits, seed=1)
    assert not plan.safe
    line = next(line for line in explain_failure(plan, limits) if line.startswith("no path exists"))
    assert line.startswith("no path exists: the destination is at 3054 m, higher than 29")
    assert "with the planner's slope margin of 0.5°" in line
