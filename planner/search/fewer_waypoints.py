"""Remove unnecessary waypoints from a plan, for an autopilot that may not continue after each of them."""

from dataclasses import replace

import numpy as np

from aircraft.path_limits import Limits
from planner.evaluation.certify import certify
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import CERTIFIED_KILL_MARGIN_M, Problem, make_problem
from planner.plan import Certificate, Objectives, Plan, Violations
from planner.search.algorithms import find_algorithm, limits_for
from world.arrays import Floats


def drop_waypoints(plan: Plan, limits: Limits) -> Plan:
    """Remove the waypoints that are not needed for a plan's safety; this never makes the path longer.

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
    while (shorter := _drop_one_waypoint(problem, plan.waypoints, min_kill_distance)) is not None:
        waypoints, certificate = shorter
        violations, objectives = paper_scores(problem.certified, waypoints[None])
        plan = replace(
            plan,
            waypoints=waypoints,
            certificate=certificate,
            violations=Violations(*violations[0]),
            objectives=Objectives(*objectives[0]),
        )
    return plan


def _drop_one_waypoint(
    problem: Problem, waypoints: Floats, min_kill_distance: float
) -> tuple[Floats, Certificate] | None:
    """Remove one waypoint of a path (w, 3); return the new path and its certificate, or None if impossible.

    min_kill_distance: required distance from missiles, m.

    The new path must meet the certificate's margins. The waypoint with the smallest detour is tried first.
    """
    legs, chords = np.diff(waypoints, axis=0), waypoints[2:] - waypoints[:-2]
    lengths = np.linalg.norm(legs, axis=1)
    detours = lengths[:-1] + lengths[1:] - np.linalg.norm(chords, axis=1)
    for i in 1 + np.argsort(detours, kind="stable"):
        remaining_waypoints = np.delete(waypoints, i, axis=0)
        certificate = certify(problem, remaining_waypoints)
        violations, _ = paper_scores(problem.certified, remaining_waypoints[None])
        if certificate.ok and certificate.kill_distance >= min_kill_distance and not violations.any():
            return remaining_waypoints, certificate
    return None
