"""Seeded plans of the paper's problems: what is planned, and the table and probabilities that they come to."""

import numpy as np
import pytest

from planfly.paper.seeded_plans import (
    PROBLEMS,
    STRIP,
    STRIP_ACROSS,
    exposure_probability,
    plan_once,
    plan_section,
    problem_name,
    table,
)
from tests.planfly.paper.made_plans import made_plan
from tests.setups import small_scenario
from world.scenario import load_scenario


def test_the_table_counts_plans_in_the_order_they_were_made() -> None:
    rows = table(
        [
            made_plan("a", 1, 1.2, 0.0),
            made_plan("a", 2, 1.1, 0.0),
            made_plan("a", 3, 1.0, 0.5),
            made_plan("b", 1, 1.0, 0.0, bad=1),
        ]
    )
    assert [(row.algorithm, row.runs, row.safe, row.certified) for row in rows] == [("a", 3, 2, 2), ("b", 1, 0, 1)]
    assert rows[0].length_median == pytest.approx(1.15)
    assert (rows[0].length_worst, rows[0].kill_worst, rows[0].detection_median) == (1.2, 0.5, 4.0)
    assert rows[1].length_median is None
    assert problem_name(7) == "paper-07"


def test_probability_of_one_unit_by_hand() -> None:
    unit = {"east_m": 0, "north_m": 500, "amsl_m": 150, "kill_radius_m": 700, "kill_scale_m": 250}
    scenario = small_scenario(threats=[unit], start={"east_m": 0, "north_m": 0, "amsl_m": 150})
    far = np.array([[0.0, 0.0, 150.0], [60_000.0, 0.0, 150.0]])
    # One of the seven points lies within reach, at 500 m: (250 / 500)^4.
    assert exposure_probability(scenario, far, "kill") == pytest.approx(1 / 16)
    assert exposure_probability(scenario, far, "detection") == 0.0
    # Two points at that distance.
    assert exposure_probability(scenario, far[[0, 0]], "kill") == pytest.approx(1 - (15 / 16) ** 7)


def test_runs_of_another_algorithm_stand_beside_the_baselines() -> None:
    done = plan_section([7], 1, "umda-polar", jobs=1)
    assert [item.algorithm for item in done] == [
        "umda-polar",
        "umda-strip",
        "umda-cartesian",
        "umda-polar-45",
        "umda-bearing",
    ]


@pytest.mark.parametrize("threats", PROBLEMS)
def test_only_the_strip_has_a_strip(threats: int) -> None:
    scenario = load_scenario(problem_name(threats))
    assert scenario.planner.algorithm == "umda"
    assert scenario.planner.across_m is None
    start, span = scenario.start[:2], (scenario.destination - scenario.start)[:2]
    aside = plan_once(threats, STRIP, 1).waypoints[:, :2] - start
    across = np.abs(span[0] * aside[:, 1] - span[1] * aside[:, 0]) / np.hypot(*span)
    assert across.max() <= STRIP_ACROSS[threats] + 1e-6
