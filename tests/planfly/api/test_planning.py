"""`planfly.plan` and `planfly.scenarios`: the planner's own plans, by every way to name a scenario."""

from pathlib import Path

import numpy as np
import pytest

import planfly
from planfly.airframe import load_airframe
from planner.plan import plan_json, read_plan
from planner.search.plan_path import plan_path
from tests.planfly.conftest import FIELD
from tests.setups import small_scenario
from world.scenario import embedded_names, load_scenario
from world.scenario_variants import with_wind


def test_it_is_the_planners_plan(path: planfly.Plan) -> None:
    scenario = load_scenario("paper-07")
    assert plan_json(path) == plan_json(plan_path(scenario, load_airframe(scenario).limits, seed=1))


@pytest.mark.parametrize("kind", [str, Path])
def test_a_file_is_named_as_text_or_path_and_the_plan_is_written(kind: type, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(FIELD)
    made = planfly.plan(kind(tmp_path / "mine.toml"), budget=400, out=kind(tmp_path / "plan.json"))
    assert (tmp_path / "plan.json").read_text() == plan_json(made)
    assert plan_json(read_plan(tmp_path / "plan.json")) == plan_json(made)


def test_options_change_the_scenario_that_is_planned_in() -> None:
    made = planfly.plan(small_scenario(), wind=(6, 90), turbulence="light", airspeed=28, seed=3, budget=300)
    scenario = made.scenario
    assert (scenario.wind.speed, np.degrees(scenario.wind.from_course)) == (6.0, 90.0)
    assert (scenario.wind.turbulence, scenario.flight.airspeed_mps, made.seed) == ("light", 28.0, 3)
    asked = with_wind(small_scenario(), 6.0, np.radians(90.0), "light")
    assert asked.wind == scenario.wind


def test_a_budget_in_evaluations_and_one_in_seconds_end_it() -> None:
    # A generation of 250 paths is evaluated whole.
    assert planfly.plan("hard-60", algorithm="umda", budget=600).evaluations == 750
    assert planfly.plan("hard-60", algorithm="umda", budget=2000).evaluations == 2000
    assert planfly.plan("hard-60", algorithm="umda", seconds=0.001).ended == "budget"


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"algorithm": "ga"}, "planner.algorithm"),
        ({"wind": (50, 0)}, "speed_mps"),
        ({"turbulence": "severe"}, "turbulence"),
        ({"budget": 1}, "budget"),
        ({"nav": "dead reckoning"}, "nav"),
    ],
)
def test_bad_input_is_one_line_and_its_data(options: dict[str, object], field: str) -> None:
    with pytest.raises(planfly.PlanflyError) as caught:
        planfly.plan("tight", **options)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    assert field in caught.value.field


def test_nothing_is_written_for_bad_input(tmp_path: Path) -> None:
    with pytest.raises(planfly.ScenarioError):
        planfly.plan("tight", algorithm="ga", out=tmp_path / "plan.json")
    assert list(tmp_path.iterdir()) == []


def test_the_scenarios_are_those_embedded() -> None:
    found = planfly.scenarios()
    assert tuple(found) == tuple(embedded_names())
    assert found["tight"] == load_scenario("tight").spec.description
