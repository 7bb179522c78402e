"""Waypoints that a plan does not need: which are left out, and what keeps the others."""

from dataclasses import replace

import numpy as np

from aircraft.path_limits import Limits
from planner.evaluation.certify import certify
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import Problem, make_problem
from planner.plan import Plan
from planner.search.fewer_waypoints import drop_waypoints
from tests.setups import small_scenario
from world.arrays import Floats
from world.scenario import Scenario

# Past the hill at (2000, 200) and the missile of 700 m at (4200, -200): the straight line meets both.
AROUND = [[0.0, 0.0, 150.0], [2000.0, 1400.0, 180.0], [6000.0, 0.0, 150.0]]


def planned(scenario: Scenario, problem: Problem, waypoints: Floats) -> Plan:
    counts, objectives = paper_scores(problem.certified, waypoints[None])
    certificate = certify(problem, waypoints)
    return Plan(scenario, waypoints, counts[0], objectives[0], certificate, 1, "umda", 0, np.zeros((0, 3)))


def halved(waypoints: Floats) -> Floats:
    """With a waypoint in the middle of each leg."""
    made = np.empty((2 * len(waypoints) - 1, 3))
    made[::2], made[1::2] = waypoints, 0.5 * (waypoints[1:] + waypoints[:-1])
    return made


def test_what_lies_on_a_leg_goes_and_what_keeps_clear_stays(
    scenario: Scenario, problem: Problem, limits: Limits
) -> None:
    plan = planned(scenario, problem, halved(np.array(AROUND)))
    assert plan.safe
    fewer = drop_waypoints(plan, limits)
    assert fewer.waypoints.tolist() == AROUND
    assert (fewer.safe, fewer.certificate) == (True, certify(problem, np.array(AROUND)))


def test_a_straight_way_keeps_its_ends(limits: Limits) -> None:
    clear = small_scenario(terrain={"kind": "flat", "amsl_m": 0.0}, threats=[])
    way = np.linspace([0.0, 0.0, 150.0], [6000.0, 0.0, 150.0], 8)
    plan = planned(clear, make_problem(clear, limits), way)
    assert drop_waypoints(plan, limits).waypoints.tolist() == [[0.0, 0.0, 150.0], [6000.0, 0.0, 150.0]]


def test_missiles_stay_as_far_away_as_plans_keep_them(limits: Limits) -> None:
    """The straight way passes 5 m from the missile's reach, sqrt(689^2 + 150^2) = 705 m from it: less than 10 m."""
    near = small_scenario(
        terrain={"kind": "flat", "amsl_m": 0.0},
        threats=[{"east_m": 3000, "north_m": 689, "kill_radius_m": 700, "kill_scale_m": 200}],
    )
    problem = make_problem(near, limits)
    bent = np.array([[0.0, 0.0, 150.0], [3000.0, -20.0, 150.0], [6000.0, 0.0, 150.0]])
    plan = planned(near, problem, bent)
    assert len(drop_waypoints(plan, limits).waypoints) == 3
    # A plan that is as near itself gets no nearer by it.
    close = replace(plan, certificate=replace(plan.certificate, kill_distance=4.0))
    assert len(drop_waypoints(close, limits).waypoints) == 2
