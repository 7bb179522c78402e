"""Plan a Pareto front for a scenario, with the default plan of every command and alternatives."""

from dataclasses import replace

from planfly.planning.gust_altitude_margin import limits_for_alternatives
from planfly.planning.gust_orbits import max_waypoints_in_gusts
from planfly.workflow.make_plan import Advance, finish_plan, make_plan
from planfly.workflow.uav import Uav
from planner.plan import Plan
from planner.search.plan_front import Front, plan_front
from planner.search.search_state import StopCondition
from world.errors import ForecastError
from world.scenario import Scenario


def make_pareto_plans(
    scenario: Scenario,
    uav: Uav,
    seed: int,
    count: int,
    advance: Advance | None = None,
    *,
    stop: StopCondition | None = None,
    continues: bool = False,
) -> Front:
    """Plan a Pareto front of at most `count` plans, each of which passes all safety checks of `make_plan`.

    The default plan is made by `make_plan`; if it is not safe, the front is empty.  Alternatives that are unsafe with
    their departure and approach are omitted.  If gusts can make the autopilot orbit waypoints, the alternatives have
    few enough waypoints to make this rare.

    advance: function called with the progress.
    stop: stop condition of the searches.
    continues: True if the mission continues beyond the destination of the plans.
    """
    default_plan = make_plan(scenario, uav, seed, advance=advance, stop=stop, continues=continues)

    def finish_alternative(plan: Plan) -> Plan:
        """Complete an alternative plan by `finish_plan`.

        Return it as not safe if its flight leaves the forecast.
        """
        try:
            return finish_plan(plan, uav, continues=continues)
        except ForecastError as error:
            # The default plan is within the forecast; an alternative may take longer, or fly higher.
            certificate = plan.certificate
            return replace(plan, certificate=replace(certificate, problems=(*certificate.problems, str(error))))

    return plan_front(
        scenario,
        limits_for_alternatives(default_plan, uav),
        count,
        seed=seed,
        progress=advance,
        stop=stop,
        default=default_plan,
        waypoints=max_waypoints_in_gusts(default_plan, uav),
        finish=finish_alternative,
    )
