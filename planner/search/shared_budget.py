"""Several searches for one plan, which share the evaluations that the scenario allows."""

from collections.abc import Callable
from dataclasses import replace

from aircraft.path_limits import Limits
from planner.plan import Plan
from world.scenario import Scenario

# Plans a scenario within limits.
Search = Callable[[Scenario, Limits], Plan]


class SharedBudget:
    """A search that may be made again for the same plan, in another scenario or within other limits.

    Each search has what those before it left of the scenario's budget of evaluations. With less left than a population
    none is made.
    """

    def __init__(self, search: Search) -> None:
        """Begin with nothing spent."""
        self._search, self._made = search, list[Plan]()
        self._ended = "completed"

    def __call__(self, scenario: Scenario, limits: Limits) -> Plan:
        """The plan that a search finds, or, where the budget allows no other search, that of the last one."""
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
        """The plan that was settled on, with the evaluations of all searches.

        A plan that is not safe has ended as the first search that did not complete: without its end another might be.
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
