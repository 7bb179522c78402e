"""A choice of plans for a scenario: the default plan as every command makes it, and others beside it."""

from planfly.airframe import Airframe
from planfly.gust_circles import waypoints_in_gusts
from planfly.gust_heights import limits_of_others
from planfly.make_plan import Advance, finish_plan, make_plan
from planner.plan import Plan
from planner.search.plan_front import Front, plan_front
from planner.search.search_state import StopCondition
from world.scenario import Scenario


def make_front(
    scenario: Scenario,
    airframe: Airframe,
    seed: int,
    count: int,
    advance: Advance | None = None,
    *,
    stop: StopCondition | None = None,
    onward: bool = False,
) -> Front:
    """Up to `count` plans of a front, each of which is safe by all that `planfly.make_plan.make_plan` looks at.

    The default plan is that of `make_plan`, and where it is not safe there is no front. Others that are not safe once
    they are finished are left out; where gusts make the autopilot circle, they have no more waypoints than gusts allow.
    stop, onward: as of `make_plan`.
    """
    default = make_plan(scenario, airframe, seed, advance=advance, stop=stop, onward=onward)

    def finish(plan: Plan) -> Plan:
        return finish_plan(plan, airframe, onward=onward)

    return plan_front(
        scenario,
        limits_of_others(default, airframe),
        count,
        seed=seed,
        progress=advance,
        stop=stop,
        default=default,
        waypoints=waypoints_in_gusts(default, airframe),
        finish=finish,
    )
