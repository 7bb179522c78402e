"""Replan in flight: keep the flown legs, and plan the rest again around newly known threats."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aircraft.path_limits import Limits
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import make_problem
from planner.plan import Objectives, Plan, Violations
from planner.search.algorithms import find_algorithm, limits_for
from planner.search.explain_failure import violated_zones
from planner.search.plan_path import plan_path
from planner.search.search_state import SearchProgress, StopCondition
from planner.search.seeds import halve_longest_legs
from planner.search.shared_budget import Search, SharedBudget
from world.errors import MissionError
from world.geometry import leg_courses
from world.scenario import Scenario

# Function of a plan and a search that returns the completed plan. It may call the search to plan again, for a changed
# scenario or within other limits.
Settle = Callable[[Plan, Search], Plan]

# Minimum number of waypoints of the path ahead; with fewer it cannot avoid anything.
MIN_WAYPOINTS = 8


def replan(
    scenario: Scenario,
    limits: Limits,
    old_plan: Plan,
    leg: int,
    *,
    seed: int,
    algorithm: str | None = None,
    progress: SearchProgress | None = None,
    stop: StopCondition | None = None,
    settle: Settle | None = None,
) -> Plan:
    """Plan again from the start of leg `leg` of an old plan; keep the legs before it, which are flown.

    scenario: the scenario with the threats known now (`world.scenario.with_threats`).
    settle: function that completes the plan of the path ahead, before the flown legs are prepended.

    The turn at the first new waypoint is measured from the course of the last flown leg. The search starts from the
    rest of the old plan and from its usual grid routes. The certificate is for the path ahead, the violations and
    objectives are for the whole path.

    >>> from planfly.workflow.uav import load_uav
    >>> from world.scenario import load_scenario
    >>> from world.scenario import with_threats
    >>> scenario = load_scenario("hard-07")
    >>> limits = load_uav(scenario).limits
    >>> old = plan_path(scenario, limits, seed=1)
    >>> east, north, _ = old.waypoints[6]
    >>> now = with_threats(scenario, [{"east_m": east, "north_m": north, "kill_radius_m": 300.0}], "threats")
    >>> new = replan(now, limits, old, 3, seed=1)
    >>> new.safe, new.flown_legs, np.array_equal(new.waypoints[:4], old.waypoints[:4])
    (True, 3, True)

    Raises MissionError if the old plan does not have the leg, if the leg starts in a missile's kill sphere or violates
    a zone, or if the old plan belongs to another mission. Raises ScenarioError as `plan_path` does.
    """
    waypoint_count = len(old_plan.waypoints)
    if not 0 <= leg < waypoint_count - 1:
        raise MissionError.of_argument("at_leg", leg, f"the plan has legs 0..{waypoint_count - 2}", file=scenario.name)
    check_same_mission(scenario, old_plan)
    _check_first_waypoint(scenario, old_plan, leg)
    remaining_path = halve_longest_legs(old_plan.waypoints[leg:], max(MIN_WAYPOINTS, waypoint_count - leg))
    course = scenario.start_course if leg == 0 else float(leg_courses(old_plan.waypoints)[leg - 1])
    settings = scenario.planner.model_copy(update={"waypoints": len(remaining_path)})
    remaining_scenario = replace(scenario, start=remaining_path[0], start_course=course, planner=settings)

    def search(changed_scenario: Scenario, changed_limits: Limits) -> Plan:
        """Plan the path ahead; start from the rest of the old path if both have the same number of waypoints."""
        previous_path = remaining_path if changed_scenario.planner.waypoints == len(remaining_path) else None
        return plan_path(
            changed_scenario,
            changed_limits,
            seed=seed,
            algorithm=algorithm,
            progress=progress,
            stop=stop,
            previous=previous_path,
        )

    budget = SharedBudget(search)
    new_plan = budget(remaining_scenario, limits)
    if settle is not None:
        new_plan = budget.with_total_evaluations(settle(new_plan, budget))
    waypoints = np.concatenate([old_plan.waypoints[:leg], new_plan.waypoints])
    algorithm_limits = limits_for(find_algorithm(new_plan.algorithm, scenario.name), limits)
    violations, objectives = paper_scores(make_problem(scenario, algorithm_limits).certified, waypoints[None])
    return replace(
        new_plan,
        scenario=scenario,
        waypoints=waypoints,
        violations=Violations(*violations[0]),
        objectives=Objectives(*objectives[0]),
        flown_legs=leg,
    )


def check_same_mission(scenario: Scenario, old_plan: Plan) -> None:
    """Raise MissionError if a plan and a scenario have different ends.

    >>> from planfly.workflow.uav import load_uav
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("hard-07")
    >>> plan = plan_path(scenario, load_uav(scenario).limits, seed=1)
    >>> check_same_mission(scenario, plan)
    >>> check_same_mission(load_scenario("tight"), plan)
    Traceback (most recent call last):
    world.errors.MissionError: tight: start: 742 m from the plan's start: the plan is for another mission
    """
    for name, plan_end, scenario_end in (
        ("start", old_plan.waypoints[0], scenario.start),
        ("destination", old_plan.waypoints[-1], scenario.destination),
    ):
        distance = math.dist(plan_end, scenario_end)
        if distance > 1.0:
            raise MissionError(
                f"{scenario.name}: {name}: {distance:.0f} m from the plan's {name}: the plan is for another mission",
                file=scenario.name,
                field=name,
            )


def _check_first_waypoint(scenario: Scenario, old_plan: Plan, leg: int) -> None:
    """Raise MissionError if the first waypoint of the new plan is in a kill radius or violates a zone.

    leg: number of the leg of the old plan at whose start this waypoint is.
    """
    threats = scenario.threats
    depths = threats.kill_radius - np.sqrt(((threats.position - old_plan.waypoints[leg]) ** 2).sum(axis=1))
    missile = int(np.argmax(np.where(threats.kill_radius > 0.0, depths, -math.inf))) if len(depths) else -1
    if missile >= 0 and threats.kill_radius[missile] > 0.0 and depths[missile] >= 0.0:
        raise MissionError(
            f"{scenario.name}: leg {leg}: it starts at waypoint {leg}, {depths[missile]:.0f} m inside the kill "
            f"radius of {threats.names[missile]} ({threats.kill_radius[missile]:.0f} m): no path from there is safe",
            file=scenario.name,
            field="leg",
            value=leg,
        )
    zone_names = violated_zones(scenario, old_plan.waypoints[[leg, leg]])
    if zone_names:
        reason = f"it starts at waypoint {leg}, which violates {zone_names[0]}"
        message = f"{scenario.name}: leg {leg}: {reason}; every path from there violates this zone"
        raise MissionError(message, file=scenario.name, field="leg", value=leg)
