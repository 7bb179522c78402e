"""Share the evaluations that a scenario allows between several searches for one plan."""

from collections.abc import Callable
from dataclasses import replace

from aircraft.path_limits import Limits
from planner.plan import Plan
from world.scenario import Scenario

# A function that plans a scenario within limits.
Search = Callable[[Scenario, Limits], Plan]


class SharedBudget:
    """Callable that runs searches for one plan and shares the scenario's evaluation budget between them.

    The searches may differ in the scenario and in the limits. Each search may use the evaluations that earlier searches
    have left. If fewer than one population remain, no further search is run, and the last plan is returned.
    """

    def __init__(self, search: Search) -> None:
        """Start with the whole budget."""
        self._search, self._plans = search, list[Plan]()
        self._end_reason = "completed"

    def __call__(self, scenario: Scenario, limits: Limits) -> Plan:
        """Return the plan of a new search, or the last plan if the budget does not allow another search."""
        settings = scenario.planner
        if settings.budget is None:
            return self._record_plan(self._search(scenario, limits))
        remaining_evaluations = settings.budget - self._count_evaluations()
        if self._plans and remaining_evaluations < settings.population:
            self._end_reason = "budget"
            return self._plans[-1]
        limited_scenario = replace(scenario, planner=settings.model_copy(update={"budget": remaining_evaluations}))
        return self._record_plan(replace(self._search(limited_scenario, limits), scenario=scenario))

    def with_total_evaluations(self, plan: Plan) -> Plan:
        """Return the final plan with the evaluations of all searches.

        A plan that is not safe gets the end reason of the first incomplete search, because a complete search might have
        found a safe plan.
        """
        end_reason = plan.ended if plan.safe or plan.ended != "completed" else self._end_reason
        return replace(plan, evaluations=self._count_evaluations(), ended=end_reason)

    def _count_evaluations(self) -> int:
        """Return the number of evaluations of all searches so far."""
        return sum(plan.evaluations for plan in self._plans)

    def _record_plan(self, plan: Plan) -> Plan:
        """Store a plan and return it.

        If all earlier searches completed, also store why the search for it ended.
        """
        self._plans.append(plan)
        if self._end_reason == "completed":
            self._end_reason = plan.ended
        return plan
