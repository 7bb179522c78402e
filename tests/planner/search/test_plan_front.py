"""Fronts of plans: each certified, none better than another, the same from the same seed."""

from dataclasses import replace

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.plan import Plan, plan_json
from planner.search import plan_front as fronts
from planner.search.plan_front import Front, fitted_task, front_task, plan_front
from world.scenario import Scenario

GENERATIONS = 4


@pytest.fixture(scope="module")
def front(scenario: Scenario, limits: Limits) -> Front:
    return plan_front(scenario, limits, 6, seed=3, generations=GENERATIONS)


def test_every_plan_is_safe_and_has_a_certificate_of_its_own(front: Front) -> None:
    assert 3 <= len(front.plans) <= 6
    assert all(one.plan.safe for one in front.plans)
    assert len({one.plan.certificate for one in front.plans}) == len(front.plans)
    for one in front.plans:
        legs = np.linalg.norm(np.diff(one.plan.waypoints, axis=0), axis=1)
        assert one.length == pytest.approx(legs.sum())
        # Over 30 m that the scenario requires.
        assert one.clearance == pytest.approx(one.plan.certificate.clearance + 30.0)


def test_no_plan_is_better_than_another_in_everything(front: Front) -> None:
    rows = front.objectives()
    for k, row in enumerate(rows):
        others = np.delete(rows, k, axis=0)
        assert not ((others <= row).all(axis=1) & (others < row).any(axis=1)).any()
    assert (rows < front.reference).all()
    # The envelope written by hand knows no power.
    assert front.fourth == "time"
    assert [one.length for one in front.plans] == sorted(one.length for one in front.plans)


def test_the_front_offers_what_the_shortest_plan_does_not(front: Front) -> None:
    rows, default = front.objectives(), front.default
    assert rows[:, 0].min() < 1.001 * default.length
    assert rows[:, 1].min() < 0.5 * default.exposure
    assert -rows[:, 2].min() > default.clearance + 10.0


def test_the_same_seed_gives_the_same_front(scenario: Scenario, limits: Limits, front: Front) -> None:
    again = plan_front(scenario, limits, 6, seed=3, generations=GENERATIONS)
    assert [plan_json(one.plan) for one in again.plans] == [plan_json(one.plan) for one in front.plans]


def test_a_plan_that_is_not_safe_when_it_is_finished_is_left_out(scenario: Scenario, limits: Limits) -> None:
    def refuse_long(plan: Plan) -> Plan:
        if plan.objectives[0] < 1.04:
            return plan
        return replace(plan, certificate=replace(plan.certificate, problems=("too long",)))

    found = plan_front(scenario, limits, 6, seed=3, generations=1, finish=refuse_long)
    assert found.plans
    straight = float(np.linalg.norm(scenario.destination - scenario.start))
    assert all(one.length < 1.04 * straight for one in found.plans)


def test_without_a_safe_plan_there_is_no_front(scenario: Scenario, limits: Limits) -> None:
    def refuse(plan: Plan) -> Plan:
        return replace(plan, certificate=replace(plan.certificate, problems=("no way down",)))

    found = plan_front(scenario, limits, 6, seed=3, generations=1, finish=refuse)
    assert found.plans == ()
    assert not found.default.plan.safe


def test_a_path_that_breaks_a_constraint_has_no_objectives(scenario: Scenario, limits: Limits, front: Front) -> None:
    task = front_task(scenario, limits)
    met = front.default.plan.waypoints
    under = np.array(met)
    under[1:-1, 2] = 0.0
    objectives, violations = task.scores(np.array([under, met]))
    assert violations[0].max() > 0.0
    assert violations[1].max() <= 0.0
    assert np.isinf(objectives[0]).all()
    first = front.default
    # Above the ground as sampled, which is the certificate's to a metre or two.
    assert objectives[1, [0, 1, 3]].tolist() == pytest.approx([first.length, first.exposure, first.time])
    assert objectives[1, 2] == pytest.approx(-first.clearance, abs=2.0)


def test_the_search_keeps_more_solutions_than_plans_are_asked_for(
    scenario: Scenario, limits: Limits, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fronts, "ARCHIVE", 1)
    assert len(plan_front(scenario, limits, 6, seed=3, generations=2).plans) > 2


def test_margins_are_halved_and_given_up_where_the_default_plan_does_not_keep_them(
    scenario: Scenario, limits: Limits, front: Front
) -> None:
    task, path = front_task(scenario, limits), front.default.plan.waypoints
    search, certified = task.problem.search, task.problem.certified
    assert search.kill_margin > certified.kill_margin
    under = np.array(path)
    under[1:-1, 2] = 0.0
    for given, share in ((path, 0.5), (under, 0.0)):
        scored = fitted_task(task, given).scored
        for name in ("kill_margin", "buffer", "start_buffer", "destination_buffer"):
            low, high = getattr(certified, name), getattr(search, name)
            assert getattr(scored, name) == pytest.approx((1.0 - share) * low + share * high)
