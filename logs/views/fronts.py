"""Chart a front of plans: all plans from above, and the objectives of each plan over its length.

In a front (Pareto front), no plan is better than another plan in every objective.
"""

import math
from dataclasses import dataclass

import numpy as np

from logs.views.charts import Chart, Label, Layer, Panel
from logs.views.map import MapChart, NamedWind, end_labels, map_extent, scenario_map
from planner.search.plan_front import Front
from world.wording import count_text

# One watt hour, J.
_WATT_HOUR = 3600.0
# Smallest range of an axis, s, m or Wh; smaller differences between plans do not matter.
LEAST_SPAN = 1.0
# Smallest range of the axis of lengths, as a fraction of the shortest length.
LEAST_LENGTH = 0.01


@dataclass(frozen=True, slots=True)
class _NamedPlan:
    """A plan of a front that is best in one objective.

    row: index of the plan in the front.
    name: name after the objective, e.g. "shortest".
    role: role in `logs.theme` that gives its style.
    """

    row: int
    name: str
    role: str


def _find_best_plans(front: Front) -> list[_NamedPlan]:
    """Return the best plan in each objective, each plan once.

    A plan that is best in several objectives is named after the first of them.  An objective in which all plans are
    equal is ignored, except the length, which comes first.
    """
    objectives = front.objectives()
    names = ("shortest", "least exposed", "highest above ground", f"least {front.fourth}")
    roles = ("front-shortest", "front-unseen", "front-high", "front-sparing")
    named_plans: dict[int, _NamedPlan] = {}
    for k, (name, role) in enumerate(zip(names, roles, strict=True)):
        if np.ptp(objectives[:, k]) > 0.0 or k == 0:
            row = int(np.argmin(objectives[:, k]))
            named_plans.setdefault(row, _NamedPlan(row, name, role))
    return list(named_plans.values())


def front_map(front: Front) -> MapChart:
    """Make a map of all plans of a front of at least one plan.

    The best plan in each objective is emphasized and labelled with its number in the front, counted from 1.
    """
    scenario, named_plans = front.plans[0].plan.scenario, _find_best_plans(front)
    named_rows = {plan.row for plan in named_plans}
    layers, labels = [], []
    for row, plan in enumerate(front.plans):
        if row not in named_rows:
            path = plan.plan.waypoints
            layers.append(Layer("line", "other plans", "front-other", path[:, 0], path[:, 1], quiet=True))
    for named_plan in named_plans:
        path = front.plans[named_plan.row].plan.waypoints
        name = f"{named_plan.row + 1}: {named_plan.name}"
        layers.append(Layer("line", name, named_plan.role, path[:, 0], path[:, 1], quiet=True))
        middle = path[len(path) // 2]
        labels.append(Label(str(named_plan.row + 1), float(middle[0]), float(middle[1]), "number", named_plan.role))
    paths = [plan.plan.waypoints for plan in front.plans]
    shortest = paths[0]
    return scenario_map(
        scenario,
        f"front of {count_text(len(paths), 'plan')} from above",
        layers,
        [*labels, *end_labels(scenario, route=None, numbers_of_waypoints=())],
        map_extent(scenario, route=None, paths=paths),
        route=shortest,
        winds=(NamedWind(scenario.wind),),
    )


def front_chart(front: Front) -> Chart:
    """Chart exposure, height above ground, energy and time of each plan of a front over its length, km."""
    named_plans, plans = _find_best_plans(front), front.plans
    lengths = np.array([plan.length for plan in plans]) / 1e3
    other_rows = np.setdiff1d(np.arange(len(plans)), [plan.row for plan in named_plans])
    columns = [
        ("exposure to radars", "s", np.array([plan.exposure for plan in plans])),
        ("height above ground", "m", np.array([plan.clearance for plan in plans])),
        ("energy", "Wh", np.array([plan.energy for plan in plans]) / _WATT_HOUR),
        ("time of flight", "s", np.array([plan.time for plan in plans])),
    ]
    panels = []
    for title, unit, values in columns:
        layers = (
            [Layer("dots", "other plans", "front-other", lengths[other_rows], values[other_rows])]
            if len(other_rows)
            else []
        )
        layers += [
            Layer("dots", f"{plan.row + 1}: {plan.name}", plan.role, lengths[[plan.row]], values[[plan.row]])
            for plan in named_plans
        ]
        labels = tuple(
            Label(str(row + 1), float(lengths[row]), float(values[row]), "number")
            for row in [*(plan.row for plan in named_plans), *other_rows]
            if math.isfinite(values[row])
        )
        panels.append(Panel(title, unit, tuple(layers), min_span=LEAST_SPAN, labels=labels))
    margin = 0.03 * max(float(np.ptp(lengths)), LEAST_LENGTH * float(lengths.min()))
    length_range = (float(lengths.min()) - margin, float(lengths.max()) + margin)
    name = plans[0].plan.scenario.name
    return Chart(
        f"{name}: objectives of each plan of the front, over its length",
        "length",
        "km",
        tuple(panels),
        axis_range=length_range,
        page_height=220,
        print_height=1.9,
    )
