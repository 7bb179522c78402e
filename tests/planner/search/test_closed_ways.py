"""Walls of missiles across the map: closed, with a gap, with a way under them; and the search that ends at them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import planner.search.plan_path as plan_path_module
from aircraft.path_limits import Limits
from planner.evaluation.problem import ProblemArrays, make_problem
from planner.search.closed_ways import closing_missiles, is_closed
from planner.search.explain_failure import explain_failure
from planner.search.plan_path import plan_path
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
    assert closing_missiles(data) == list(range(1, 12))
    # Two walls: either suffices.
    second = [unit(f"v{k}", 4500.0, 600.0 * (k - 5)) for k in range(11)]
    assert closing_missiles(arrays(small, make_limits, wall() + second)) in (list(range(11)), list(range(11, 22)))


@pytest.mark.parametrize("missing", [0, 5, 10])
def test_a_wall_without_one_unit_is_open(missing: int, small: Small, make_limits: MakeLimits) -> None:
    data = arrays(small, make_limits, wall(missing))
    assert not is_closed(data)
    assert closing_missiles(data) is None


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
    assert closing_missiles(arrays(small, make_limits, wall(5), **ground)) == []


def test_the_search_ends_at_a_wall_and_says_what_closes_it(
    small: Small, make_limits: MakeLimits, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise AssertionError("a path was searched for that is proven not to exist")

    monkeypatch.setattr(plan_path_module, "waypoint_generations", refused)
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
