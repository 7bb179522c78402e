"""The hard set and fresh random instances: every run safe, and each plan checked again at 1 m by other code."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.plan import Plan
from planner.search.algorithms import DEFAULT
from planner.search.plan_path import plan_path
from tests.instances import CLIMB_DEG, DIVE_DEG, ground, random_scenario
from tests.soak import note, scaled
from world.scenario import Scenario, load_scenario, scenario_from_spec
from world.scenario_file import parse_scenario

RUNS = range(1, 1 + scaled(15, 2))
INSTANCES = range(1, 1 + scaled(50, 2))


def check_at_one_metre(plan: Plan) -> None:
    """Turns, slopes, map, ground and missiles on points 1 m apart, with arrays and the peaks' closed form."""
    path, scenario = plan.waypoints, plan.scenario
    np.testing.assert_array_equal(path[[0, -1]], [scenario.start, scenario.destination])
    flat = np.diff(path[:, :2], axis=0)
    runs = np.sqrt((flat**2).sum(axis=1))
    courses = np.unwrap(np.arctan2(flat[:, 0], flat[:, 1]))
    assert np.abs(np.diff(courses)).max() <= math.radians(45.0)
    slopes = np.degrees(np.arctan2(np.diff(path[:, 2]), runs))
    assert slopes.max() <= CLIMB_DEG
    assert slopes.min() >= -DIVE_DEG
    parts = [np.linspace(path[i], path[i + 1], math.ceil(runs[i]) + 1) for i in range(len(runs))]
    points = np.concatenate(parts)
    assert (points[:, :2] >= scenario.bounds[:, 0]).all()
    assert (points[:, :2] <= scenario.bounds[:, 1]).all()
    assert points[:, 2].max() <= scenario.ceiling
    assert (points[:, 2] - ground(points[:, 0], points[:, 1])).min() > 0.0
    for centre, radius in zip(scenario.threats.position, scenario.threats.kill_radius, strict=True):
        assert np.sqrt(((points - centre) ** 2).sum(axis=1)).min() > radius


@pytest.mark.parametrize("threats", ["07", "15", "30", "60"])
def test_hard_set_is_safe_in_every_run(threats: str, make_limits: Callable[[Scenario], Limits]) -> None:
    scenario = load_scenario(f"hard-{threats}")
    table = scenario.planner
    lengths = []
    for seed in RUNS:
        plan = plan_path(scenario, make_limits(scenario), seed=seed, algorithm=DEFAULT)
        assert plan.safe, (seed, plan.certificate.problems)
        check_at_one_metre(plan)
        # The paper's own budget, seeds and pattern search included.
        assert plan.evaluations <= table.population + table.generations * (table.population // 2)
        lengths.append(float(plan.objectives[0]))
    assert max(lengths) <= 1.03 * min(lengths)
    note(f"planner: hard-{threats}", runs=len(lengths), safe=len(lengths), spread=round(max(lengths) / min(lengths), 4))


@pytest.mark.parametrize("seed", INSTANCES)
def test_random_instances_that_a_grid_can_pass_are_solved(
    seed: int, make_limits: Callable[[Scenario], Limits], tmp_path: Path
) -> None:
    scenario = scenario_from_spec(parse_scenario(random_scenario(seed), "random"), "random", base=tmp_path)
    plan = plan_path(scenario, make_limits(scenario), seed=1, algorithm=DEFAULT)
    assert plan.safe, plan.certificate.problems
    check_at_one_metre(plan)
