"""Remove unnecessary waypoints from a plan, for an autopilot that may not continue after each of them."""

from dataclasses import replace

import numpy as np

from aircraft.path_limits import Limits
from planner.evaluation.certify import certify
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import CERTIFIED_KILL_MARGIN_M, make_problem
from planner.plan import Objectives, Plan, Violations
from planner.search.algorithms import find_algorithm, limits_for


def drop_waypoints(plan: Plan, limits: Limits) -> Plan:
    """Remove the waypoints that a plan's safety does not need; this never makes the path longer.

    limits: limits of the plan's path, without those of its algorithm.

    The waypoints with the smallest detours are removed first. The path keeps the distance from missiles that plans
    require, or the plan's own distance if that is smaller.

    >>> from planfly.workflow.uav import load_uav
    >>> from planner.search.plan_path import plan_path
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("hard-07")
    >>> limits = load_uav(scenario).limits
    >>> plan = plan_path(scenario, limits, seed=1)
    >>> fewer = drop_waypoints(plan, limits)
    >>> fewer.safe, len(fewer.waypoints) < len(plan.waypoints)
    (True, True)
    """
    scenario = plan.scenario
    problem = make_problem(scenario, limits_for(find_algorithm(plan.algorithm, scenario.name), limits))
    min_kill_distance = min(plan.certificate.kill_distance, CERTIFIED_KILL_MARGIN_M)
    has_dropped = True
    while has_dropped:
        has_dropped = False
        legs, chords = np.diff(plan.waypoints, axis=0), plan.waypoints[2:] - plan.waypoints[:-2]
        lengths = np.linalg.norm(legs, axis=1)
        detours = lengths[:-1] + lengths[1:] - np.linalg.norm(chords, axis=1)
        for i in 1 + np.argsort(detours, kind="stable"):
            waypoints = np.delete(plan.waypoints, i, axis=0)
            certificate = certify(problem, waypoints)
            violations, objectives = paper_scores(problem.certified, waypoints[None])
            if certificate.ok and certificate.kill_distance >= min_kill_distance and not violations.any():
                plan = replace(
                    plan,
                    waypoints=waypoints,
                    certificate=certificate,
                    violations=Violations(*violations[0]),
                    objectives=Objectives(*objectives[0]),
                )
                has_dropped = True
                break
    return plan
