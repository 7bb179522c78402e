"""Bands of heights that leave no room are named, with the figure; those that leave some are not."""

from collections.abc import Callable
from typing import Any

import pytest

from aircraft.path_limits import Limits
from planner.evaluation.problem import CERTIFIED_BUFFER, make_problem
from planner.search.explain_failure import what_blocks
from planner.search.narrow_bands import highest_allowed, narrow_bands
from planner.search.plan_path import plan_path
from world.scenario import Scenario

GROUND: dict[str, Any] = {"terrain": {"kind": "flat", "amsl_m": 0}, "threats": []}
MakeLimits = Callable[[Scenario], Limits]
Small = Callable[..., Scenario]


@pytest.mark.parametrize(("more", "said"), [(0.5, []), (-0.5, ["0.5 m more than there is"])])
def test_a_band_of_the_limits(more: float, said: list[str], small: Small, make_limits: MakeLimits) -> None:
    limits = {"min_clearance_m": 145.0, "max_height_m": 145.0 + 2.0 * CERTIFIED_BUFFER + more}
    scenario = small(**GROUND, limits=limits)
    lines = narrow_bands(make_problem(scenario, make_limits(scenario)))
    assert [line[-len(end) :] for line, end in zip(lines, said, strict=True)] == said
    assert all("min_clearance_m 145 m" in line and "max_height_m" in line for line in lines)


def test_an_inclusions_band_is_named_where_the_plan_cannot_keep_both_edges(
    small: Small, make_limits: MakeLimits
) -> None:
    zone = {"name": "corridor", "kind": "inclusion", "east_m": 3000, "north_m": 0, "radius_m": 8000}
    scenario = small(**GROUND, limits={"min_clearance_m": 148.0}, zones=[zone | {"ceiling_agl_m": 151.0}])
    (line,) = narrow_bands(make_problem(scenario, make_limits(scenario)))
    assert "corridor is too narrow a band: above the clearance of 148 m and below its ceiling at 151 m" in line
    wide = small(**GROUND, limits={"min_clearance_m": 100.0}, zones=[zone | {"ceiling_agl_m": 200.0}])
    assert narrow_bands(make_problem(wide, make_limits(wide))) == []


def test_the_lowest_ceiling_is_named(small: Small, make_limits: MakeLimits) -> None:
    zone = {"name": "shelf", "kind": "inclusion", "east_m": 3000, "north_m": 0, "radius_m": 8000}
    scenario = small(**GROUND, zones=[zone | {"ceiling_amsl_m": 300.0}])
    assert highest_allowed(make_problem(scenario, make_limits(scenario))) == (
        300.0 - CERTIFIED_BUFFER,
        "the ceiling of shelf",
    )


@pytest.mark.parametrize(("more", "said"), [(-2.0, True), (40.0, False)])
def test_ground_clearance_and_reserve_against_the_ceiling(
    more: float, said: bool, small: Small, make_limits: MakeLimits
) -> None:
    """A ridge across the whole map, 30 m of clearance and 5 m in reserve."""
    hills = [{"east_m": 3000, "north_m": north, "height_m": 92, "sigma_m": 400} for north in range(-8000, 8001, 400)]
    tables: dict[str, Any] = {
        "terrain": {"kind": "peaks", "peak": hills},
        "area": {"east_m": [-1500, 7500], "north_m": [-4000, 4000]},
        "threats": [],
        "limits": {"min_clearance_m": 30.0},
        "planner": {"waypoints": 6, "population": 20, "generations": 3},
    }
    ground = small(**tables).terrain
    assert ground is not None
    # The ridge is level but for its waves.
    top = max(float(ground.height(3000.0, north)) for north in range(-4000, 4001, 50))
    tables["area"] |= {"ceiling_amsl_m": top + 30.0 + 5.0 + more}
    scenario = small(**tables)
    limits = make_limits(scenario)
    lines = what_blocks(plan_path(scenario, limits, seed=1, algorithm="umda"), limits)
    assert any("the heights left are too narrow" in line and "reserve of 5.0 m" in line for line in lines) is said
    assert not any("terrain closes the way" in line for line in lines)
