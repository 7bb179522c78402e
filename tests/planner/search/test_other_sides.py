"""The shorter side is found where the grids that know obstacles as they are do not propose it."""

from collections.abc import Callable
from pathlib import Path

import pytest

import planner.search.plan_path as whole
from aircraft.path_limits import Limits
from planner.search.other_sides import LEAST_DETOUR, search_other_sides
from planner.search.plan_path import plan_path
from planner.search.search_state import Search
from tests.instances import random_scenario
from world.scenario import Scenario, from_spec, load_scenario
from world.scenario_file import parse_scenario


def fresh(seed: int, folder: Path) -> Scenario:
    return from_spec(parse_scenario(random_scenario(seed), "random"), "random", base=folder)


def without_other_sides(_search: Search) -> None:
    """What the search was before."""


@pytest.mark.parametrize("seed", [1, 2])
def test_paths_get_no_longer_by_other_sides(
    seed: int, make_limits: Callable[[Scenario], Limits], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = fresh(seed, tmp_path)
    limits = make_limits(scenario)
    now = plan_path(scenario, limits, seed=1)
    monkeypatch.setattr(whole, "search_other_sides", without_other_sides)
    before = plan_path(scenario, limits, seed=1)
    assert now.safe
    assert now.objectives[0] <= (1.001 * before.objectives[0] if before.safe else 9.0)


def test_where_the_way_is_nearly_straight_no_other_side_is_looked_for(
    make_limits: Callable[[Scenario], Limits], monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = load_scenario("paper-07")
    seen: list[int] = []

    def counted(search: Search) -> None:
        before = search.evaluations
        search_other_sides(search)
        seen.append(search.evaluations - before)
        assert search.archive.scores[0][4] >= 1.0 + LEAST_DETOUR or seen[-1] == 0

    monkeypatch.setattr(whole, "search_other_sides", counted)
    assert plan_path(scenario, make_limits(scenario), seed=1).safe
