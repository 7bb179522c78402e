"""A plan on a terminal's one line, and as a notebook shows it."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from planner.plan import Certificate, Plan
from planner.plan_table import plan_html
from world.scenario import load_scenario

CERTIFICATE = Certificate(np.radians(5.0), np.inf, np.radians(1.25), 9.04, 10.0, 51.0, ())


@pytest.fixture(scope="module")
def plan() -> Plan:
    scenario = load_scenario("tight")
    path = np.stack([scenario.start, scenario.destination])
    return Plan(scenario, path, np.zeros(4), np.array([1.25, 0, 0, 0]), CERTIFICATE, 7, "umda", 60, np.zeros((0, 3)))


def test_a_plan_prints_in_a_line(plan: Plan) -> None:
    assert repr(plan) == "<Plan tight: 2 waypoints, safe, 1.2500 times straight>"


@pytest.mark.parametrize(
    ("change", "state"),
    [
        ({}, "safe"),
        ({"kill_distance": -1.0}, "feasible, but inside a missile's reach"),
        ({"problems": ("slope: 9°",)}, "not feasible"),
    ],
)
def test_its_state_is_said_in_words(plan: Plan, change: dict[str, object], state: str) -> None:
    assert replace(plan, certificate=replace(CERTIFICATE, **change)).state == state  # type: ignore[arg-type]


def test_a_notebook_shows_what_it_keeps_from_its_limits(plan: Plan) -> None:
    page = ElementTree.fromstring(plan._repr_html_())
    rows = {row[0].text: row[1].text for row in page.find("table/tbody") or ()}
    assert page.findtext("strong") == "Plan tight: safe"
    assert rows["length / straight line"] == "1.2500"
    assert rows["clearance to spare"] == "9.0 m"
    assert rows["outside missiles' reach by"] == "51 m"
    assert rows["turns and slopes to spare"] == "5.0°, 1.25°"
    assert rows["algorithm, seed"] == "umda, 7"


def test_problems_are_named_and_no_missile_is_told_so(plan: Plan) -> None:
    text = plan_html(replace(plan, certificate=replace(CERTIFICATE, kill_distance=np.inf, problems=("slope: 9°",))))
    assert "<td>fails</td><td>slope: 9°</td>" in text
    assert "<td>none</td>" in text
