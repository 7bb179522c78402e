"""Why no path was found is named."""

from collections.abc import Callable

from aircraft.path_limits import Limits
from planner.search.explain_failure import what_blocks
from planner.search.plan_path import plan_path
from world.scenario import Scenario


def test_what_blocks_a_way_is_named(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> None:
    hills = [{"east_m": 3000, "north_m": n, "height_m": 600, "sigma_m": 300} for n in range(-4000, 4001, 400)]
    table = {"waypoints": 6, "population": 20, "generations": 3}
    walled = small(terrain={"kind": "peaks", "peak": hills}, planner=table)
    plan = plan_path(walled, make_limits(walled), seed=1)
    assert not plan.feasible
    lines = what_blocks(plan)
    assert "terrain closes the way" in lines[0]
    assert "ceiling is 450 m" in lines[0]
    assert "turn back, or go round to climb, were looked for" in lines[-1]
    alone = plan_path(walled, make_limits(walled), seed=1, algorithm="umda")
    assert "a way that must turn back was not looked for" in what_blocks(alone)[-1]
