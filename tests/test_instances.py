"""The hard set: its files are what the generator makes, and its grid search answers known cases."""

import numpy as np
import pytest

from tests.instances import (
    KILL_RADIUS,
    SCENARIOS,
    SIZES,
    START,
    hard_scenario,
    make_instance,
    passable,
    random_scenario,
)
from tests.soak import some
from world.scenario import load_scenario, scenario_from_spec
from world.scenario_file import parse_scenario


@pytest.mark.parametrize("threats", some(SIZES, 2))
def test_the_hard_files_are_what_the_generator_makes(threats: int) -> None:
    committed = (SCENARIOS / f"hard-{threats:02d}.toml").read_text(encoding="utf-8")
    assert committed == hard_scenario(threats)
    scenario = load_scenario(f"hard-{threats:02d}")
    assert len(scenario.threats) == threats
    assert scenario.ceiling == 600
    low, high = KILL_RADIUS
    assert scenario.threats.kill_radius.min() >= low
    assert scenario.threats.kill_radius.max() <= high
    np.testing.assert_allclose(scenario.threats.detection_radius, 1.5 * scenario.threats.kill_radius)
    for paper in ("terrain", "start", "destination"):
        assert getattr(scenario.spec, paper) == getattr(load_scenario("paper-60").spec, paper)
    # On the ground that the generator has in closed form.
    np.testing.assert_allclose(scenario.threats.position, make_instance(0, threats).positions, atol=1.0)


def test_random_instances_are_scenarios_that_differ() -> None:
    texts = [random_scenario(seed) for seed in (1, 2, 1)]
    one, two = (scenario_from_spec(parse_scenario(text, f"{k}"), f"{k}") for k, text in enumerate(texts[:2]))
    assert not np.array_equal(one.threats.position, two.threats.position)
    assert texts[2] == texts[0]


def test_the_grid_search_passes_open_country_and_no_wall() -> None:
    assert passable(np.zeros((0, 3)), np.zeros(0))
    line = np.linspace(0.0, 10_000.0, 41)
    wall = np.column_stack([line, line[::-1], np.full(41, 300.0)])
    assert not passable(wall, np.full(41, 700.0))
    # A gap of 600 m in the same wall is a way.
    gap = np.abs(np.hypot(wall[:, 0] - 5400.0, wall[:, 1] - 4600.0)) > 1000.0
    assert passable(wall[gap], np.full(int(gap.sum()), 700.0))
    assert not passable(np.array([START]), np.array([500.0]))
