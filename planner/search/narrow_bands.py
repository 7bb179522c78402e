"""Bands of heights that leave a path no room: between what is kept from their lower and from their upper edge."""

import math

from planner.evaluation.problem import Problem
from world.scenario import Scenario


def narrow_bands(problem: Problem) -> list[str]:
    """Lines that name each band, of the limits or of an inclusion, in which a plan's reserves leave no height at all.

    >>> from planfly.airframe import load_airframe
    >>> from planner.evaluation.problem import make_problem
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> narrow_bands(make_problem(scenario, load_airframe(scenario).limits))
    []
    """
    data, lines = problem.certified, []
    space, lowest = data.airspace, data.clearance + data.buffer
    if lowest > space.max_height - space.buffer:
        lines.append(
            f"the band above ground is too narrow: from limits.min_clearance_m {data.clearance:g} m to"
            f" limits.max_height_m {space.max_height:g} m a plan keeps {data.buffer:.1f} m from the lower edge and"
            f" {space.buffer:.1f} m from the upper, {lowest + space.buffer - space.max_height:.1f} m more than there is"
        )
    for keeps in space.zones.kept:
        zone = problem.scenario.zones[int(keeps["number"])]
        ceiling, floor, beyond = zone.ceiling, zone.floor, float(keeps["beyond"])
        if zone.kind != "inclusion" or ceiling is None:
            continue
        bottoms = {f"the clearance of {data.clearance:g} m": lowest} if ceiling.datum == "ground" else {}
        if floor is not None and floor.datum == ceiling.datum:
            bottoms[f"its floor at {floor.height:g} m"] = floor.height + beyond
        name, bottom = max(bottoms.items(), key=lambda item: item[1], default=("", -math.inf))
        if bottom > ceiling.height - beyond:
            lines.append(
                f"{zone.name} is too narrow a band: above {name} and below its ceiling at {ceiling.height:g} m a plan's"
                f" reserves take {bottom + beyond - ceiling.height:.1f} m more than there is"
            )
    return lines


def highest_allowed(problem: Problem) -> tuple[float, str]:
    """The highest that a plan may be anywhere, m AMSL, and what says so: the ceiling, or an inclusion's.

    >>> from planfly.airframe import load_airframe
    >>> from planner.evaluation.problem import make_problem
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> highest_allowed(make_problem(scenario, load_airframe(scenario).limits))[1]
    'the ceiling'
    """
    scenario: Scenario = problem.scenario
    tops = [(float(problem.certified.ceiling), "the ceiling")]
    for keeps in problem.certified.airspace.zones.kept:
        zone = scenario.zones[int(keeps["number"])]
        if zone.kind == "inclusion" and zone.ceiling is not None and zone.ceiling.datum == "amsl":
            tops.append((zone.ceiling.height - float(keeps["beyond"]), f"the ceiling of {zone.name}"))
    return min(tops)
