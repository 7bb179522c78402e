"""Share the evaluations that a scenario allows between several searches for one plan."""

from collections.abc import Callable
from dataclasses import replace

from aircraft.path_limits import Limits
from planner.plan import Plan
from world.scenario import Scenario

# A function that plans a scenario within limits.
Search = Callable[[Scenario, Limits], Plan]


class SharedBudget:
    """A search that may be repeated for the same plan, in another scenario or within other limits.

    Each search has the rest of the scenario's budget of evaluations. If less than a population is left, no search is
    made.
    """

    def __init__(self, search: Search) -> None:
        """Begin with no evaluations spent."""
        self._search, self._made = search, list[Plan]()
        self._ended = "completed"

    def __call__(self, scenario: Scenario, limits: Limits) -> Plan:
        """Return the plan of a new search, or of the last search if the budget does not allow another search."""
        table = scenario.planner
        if table.budget is None:
            return self._keep(self._search(scenario, limits))
        left = table.budget - self._spent()
        if self._made and left < table.population:
            self._ended = "budget"
            return self._made[-1]
        within = replace(scenario, planner=table.model_copy(update={"budget": left}))
        return self._keep(replace(self._search(within, limits), scenario=scenario))

    def total(self, plan: Plan) -> Plan:
        """Return the final plan with the evaluations of all searches.

        A plan that is not safe gets the end reason of the first search that did not complete, as a complete search
        might have found a safe plan.
        """
        ended = plan.ended if plan.safe or plan.ended != "completed" else self._ended
        return replace(plan, evaluations=self._spent(), ended=ended)

    def _spent(self) -> int:
        return sum(one.evaluations for one in self._made)

    def _keep(self, plan: Plan) -> Plan:
        self._made.append(plan)
        if self._ended == "completed":
            self._ended = plan.ended
        return plan
