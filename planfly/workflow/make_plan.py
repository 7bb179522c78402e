"""Make the plan of a scenario for its aircraft and autopilot, in the same way for every command."""

import math
from collections.abc import Callable
from dataclasses import replace

from aircraft.path_limits import Limits
from logs.verdict.conditions import Conditions, plan_conditions
from logs.verdict.measures.circle_reach import end_loiter_hazards
from logs.verdict.measures.route_requirements import route_requirements
from planfly.planning.gust_altitude_margin import ensure_altitude_margin
from planfly.planning.gust_orbits import limit_waypoint_orbits
from planfly.planning.local_wind import ensure_local_wind
from planfly.workflow.open_flight import make_setup, mission_of_plan
from planfly.workflow.uav import Uav, with_departure_and_approach
from planner.plan import Plan
from planner.search.plan_path import certify_waypoints, plan_path
from planner.search.replan import replan
from planner.search.search_state import StopCondition
from planner.search.shared_budget import Search, SharedBudget
from world.arrays import Floats
from world.scenario import Scenario

# Function called with the progress of a stage: amount done, total amount, and a remark.
Advance = Callable[[float, float, str], None]


def planning_conditions(scenario: Scenario, uav: Uav) -> Conditions:
    """Return the conditions for which a path is planned: scenario, aircraft, airspeed and autopilot."""
    return plan_conditions(scenario, uav.aircraft.name, uav.airspeed, uav.autopilot)


def make_plan(
    scenario: Scenario,
    uav: Uav,
    seed: int,
    algorithm: str | None = None,
    advance: Advance | None = None,
    *,
    stop: StopCondition | None = None,
    flown_plan_and_leg: tuple[Plan, int] | None = None,
    continues: bool = False,
) -> Plan:
    """Plan a path within the limits of scenario and aircraft.

    A margin for the uncertainty of the limits is kept.

    All commands use this function, so that they agree on which plan is safe.  A plan may take several searches, which
    share the scenario's budget of evaluations.  In gusts, the plan has few waypoints at which the autopilot may orbit
    (`planfly.planning.gust_orbits`), and a margin in altitude (`planfly.planning.gust_altitude_margin`).  Slopes and
    turns also hold in the local wind of a forecast (`planfly.planning.local_wind`).  Departure and approach are added.
    If the autopilot loiters at the end of the mission, the certificate names hazards that may be close to the loiter.

    seed: seed of the search.
    algorithm: name of the algorithm; None for the default.
    stop: stop condition of `planner.search.plan_path.plan_path`.
    flown_plan_and_leg: the plan being flown, and the leg from which it is replanned; None for a new plan.
    continues: True if the mission continues beyond the destination of the plan.

    Raises ForecastError if the flight of the plan leaves the box, the levels or the times of the forecast.
    """
    limits = uav.limits.with_margin()

    def complete_plan(plan: Plan, search: Search) -> Plan:
        """Make a plan safe in gusts and in local wind, by other searches if necessary."""

        def search_for(other_uav: Uav) -> Plan:
            """Search for a plan with another UAV, and make it safe in gusts."""
            other_plan = search(plan.scenario, other_uav.limits.with_margin())
            return _complete_in_gusts(other_plan, other_uav, search)

        return ensure_local_wind(_complete_in_gusts(plan, uav, search), uav, search_for)

    if flown_plan_and_leg is not None:
        old_plan, leg = flown_plan_and_leg
        new_plan = replan(
            scenario,
            limits,
            old_plan,
            leg,
            seed=seed,
            algorithm=algorithm,
            progress=advance,
            stop=stop,
            settle=complete_plan,
        )
        return _add_ground_phases(new_plan, uav, old_plan, continues=continues)

    def search(searched_scenario: Scenario, search_limits: Limits) -> Plan:
        """Plan a path within limits by the chosen algorithm."""
        return plan_path(searched_scenario, search_limits, seed=seed, algorithm=algorithm, progress=advance, stop=stop)

    searches = SharedBudget(search)
    plan = searches.with_total_evaluations(complete_plan(searches(scenario, limits), searches))
    return _add_ground_phases(plan, uav, continues=continues)


def _complete_in_gusts(plan: Plan, uav: Uav, search: Search) -> Plan:
    """Return a plan that is safe in gusts, or the given plan marked as not safe.

    search: plans a path in a scenario within limits.
    """

    def limit_orbits(candidate: Plan, search_limits: Limits) -> Plan:
        """Return a plan whose waypoints are few enough to avoid orbits in gusts."""
        return limit_waypoint_orbits(
            candidate, uav, lambda other_scenario: search(other_scenario, search_limits), search_limits
        )

    def search_within(search_limits: Limits) -> Plan:
        """Plan a path within limits, with few enough waypoints to avoid orbits in gusts."""
        return limit_orbits(search(plan.scenario, search_limits), search_limits)

    return ensure_altitude_margin(limit_orbits(plan, uav.limits.with_margin()), uav, search_within)


def make_given_plan(scenario: Scenario, uav: Uav, seed: int, waypoints: Floats) -> Plan:
    """Make a plan from given waypoints, and certify it by all checks of `make_plan`.

    waypoints: positions, m, (w, 3), all of which are kept.
    """
    return finish_plan(
        certify_waypoints(scenario, uav.limits.with_margin(), waypoints, seed=seed), uav, keeps_waypoints=True
    )


def finish_plan(plan: Plan, uav: Uav, *, continues: bool = False, keeps_waypoints: bool = False) -> Plan:
    """Complete a plan without another search, by the steps that `make_plan` takes after its search.

    continues: True if the mission continues beyond the destination of the plan.
    keeps_waypoints: True to keep the waypoints of the plan even if gusts make orbits at them too likely.
    """
    limited_plan = limit_waypoint_orbits(plan, uav, keeps_waypoints=keeps_waypoints)
    return _add_ground_phases(ensure_altitude_margin(limited_plan, uav), uav, continues=continues)


def _add_ground_phases(plan: Plan, uav: Uav, old_plan: Plan | None = None, *, continues: bool) -> Plan:
    """Add to a plan the departure and the approach that the scenario requires.

    Complete the plan's certificate.

    The certificate then names the hazards near the final loiter, and the slopes and turns that cannot be flown in the
    local wind.

    old_plan: the plan being flown, or None.
    continues: True if the mission continues beyond the destination, so that there is no final loiter.
    """
    plan = ensure_local_wind(with_departure_and_approach(plan, uav, old_plan), uav)
    if continues or not uav.autopilot.loiters.ends_in_circle:
        return plan
    setup = make_setup(plan.scenario, uav, mission_of_plan(plan, uav), plan.seed, plan=plan)
    loiter_hazards = end_loiter_hazards(route_requirements(setup))
    if loiter_hazards is None or not loiter_hazards[1]:
        return plan
    max_distance, hazard_texts = loiter_hazards
    loiter_text = f"{uav.autopilot.title} circles around the destination"
    # The distance is infinite if the wind is too strong to fly a circle.
    loiter_text += f", up to {max_distance:.0f} m from it" if math.isfinite(max_distance) else ""
    problems = (*plan.certificate.problems, f"{loiter_text}: {', '.join(hazard_texts)}")
    return replace(plan, certificate=replace(plan.certificate, problems=problems))
