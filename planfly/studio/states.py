"""States of legs, corners, threats and zones according to a verdict, each with the closest limit.

A state is "fail", "open" (not judged, therefore not flyable), "near" a limit, or "ok".  Numbers and words are taken
from the finding that is closest to its limit.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from logs.verdict.findings import Finding, undecided_findings
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.tolerances import ROUNDING_M
from world.arrays import Floats
from world.threats import Threats

# Fraction of the limit that is near the limit, for a rule whose margin has no scale, such as turns.
_NEAR_FRACTION = 0.1
_ORDER = {"fail": 0, "open": 1, "near": 2, "ok": 3}


class State(NamedTuple):
    """State of a place.

    closeness: margin as a multiple of a noticeable difference; below 1 is near the limit, below 0 beyond it.
    text: the finding in a few words, shown at the pointer.
    """

    state: str
    closeness: float = math.inf
    text: str = ""


class PlaceStates(NamedTuple):
    """States by the numbers of the route; places without findings have none.

    legs: states by leg.
    corners: states by waypoint.
    threats, zones: numbers of the failed threats and zones.
    """

    legs: dict[int, State]
    corners: dict[int, State]
    threats: frozenset[int]
    zones: frozenset[int]


def place_states(requirements: RouteRequirements, findings: Sequence[Finding], *, shift: int = 0) -> PlaceStates:
    """Return the states of all places; a failed threat, zone or bound also sets the state of the legs that violate it.

    shift: number added to the legs and corners of a part of a route.
    """
    legs: dict[int, State] = {}
    corners: dict[int, State] = {}
    threats: set[int] = set()
    zones: set[int] = set()
    is_open = {id(item) for item in undecided_findings(findings)}
    for item in findings:
        state = state_of(item, unjudged=id(item) in is_open)
        if state is None:
            continue
        place = item.place
        if place.kind == "leg" and place.index is not None:
            _set_worse_state(legs, (place.index + shift,), state)
        elif place.kind == "waypoint" and place.index is not None:
            _set_worse_state(corners, (place.index + shift,), state)
        elif state.state == "fail":
            _set_worse_state(legs, (leg + shift for leg in violated_legs(requirements, item)), state)
            if place.index is not None:
                (threats if place.kind in ("missile", "radar") else zones).add(place.index)
    return PlaceStates(legs, corners, frozenset(threats), frozenset(zones))


def _set_worse_state(states: dict[int, State], numbers: Iterable[int], state: State) -> None:
    for number in numbers:
        old = states.get(number)
        if old is None or (_ORDER[state.state], state.closeness) < (_ORDER[old.state], old.closeness):
            states[number] = state


def state_of(item: Finding, *, unjudged: bool = False) -> State | None:
    """Return the state of a place according to one finding, or None for a finding that does not affect it.

    unjudged: True if the verdict is withheld because of this finding.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import Place
    >>> slope = make_finding(
    ...     "slope", Place("leg", 1), ok=True, reason="", planned=13.5, limit=14.2, margin=0.7, unit="deg"
    ... )
    >>> state_of(slope)
    State(state='near', closeness=0.7, text='slope 13.5° (≤ 14.2°)')
    """
    if item.ok is None:
        return State("open", 0.0, f"{_rule_name(item)}: {item.brief or item.reason}") if unjudged else None
    if item.ok is False:
        return State("fail", -math.inf if item.margin is None else item.margin, f"{_rule_name(item)}: {item.brief}")
    if item.margin is None or item.planned is None:
        return None
    closeness = _closeness(item)
    return State("near" if closeness < 1.0 else "ok", closeness, _value_text(item))


def _rule_name(item: Finding) -> str:
    return RULE_WORDS[item.rule].word


def _closeness(item: Finding) -> float:
    scale, margin = RULE_WORDS[item.rule].scale, item.margin or 0.0
    if scale is None:
        if item.limit is None or not item.limit:
            return math.inf
        scale = _NEAR_FRACTION * abs(item.limit)
    return margin / scale


def _value_text(item: Finding) -> str:
    value, limit = item.compared_texts()
    return f"{_rule_name(item)} {value}" + (f" ({limit})" if limit else "")


# ----------------------------------------------------------------------
# Find the legs that violate a threat, a zone or the area, because findings name only the violated object.


def violated_legs(requirements: RouteRequirements, item: Finding) -> tuple[int, ...]:
    """Return the legs of the planned path that violate the threat, zone or area of a failed finding."""
    path, place = requirements.path, item.place
    scenario = requirements.setup.scenario
    if place.kind in ("missile", "radar") and place.index is not None:
        near = sphere_segments(path.points, scenario.threats, place.index, missile=place.kind == "missile")
        return tuple(np.unique(path.legs[near]).tolist())
    facts = {fact.what: fact.value for fact in item.facts}
    if "entry leg" in facts and "exit leg" in facts:
        return tuple(range(int(facts["entry leg"]), int(facts["exit leg"]) + 1))
    if item.rule == "bounds":
        (west, east), (south, north) = scenario.bounds.tolist()
        low, high = np.array([west, south, scenario.floor]), np.array([east, north, scenario.ceiling])
        beyond = np.asarray(((path.points < low - ROUNDING_M) | (path.points > high + ROUNDING_M)).any(axis=1))
        return tuple(np.unique(path.legs[beyond[:-1] | beyond[1:]]).tolist())
    return ()


def sphere_segments(points: Floats, threats: Threats, number: int, *, missile: bool) -> NDArray[np.bool_]:
    """Flag each segment of a path that enters the sphere of a threat, (n - 1,).  points: path points, (n, 3), m."""
    radius = float((threats.kill_radius if missile else threats.detection_radius)[number])
    start, step = points[:-1] - threats.position[number], np.diff(points, axis=0)
    length2 = (step**2).sum(axis=1)
    share = np.clip(
        np.divide(-(start * step).sum(axis=1), length2, out=np.zeros_like(length2), where=length2 > 0), 0, 1
    )
    nearest = start + share[:, None] * step
    return np.asarray((nearest**2).sum(axis=1) <= radius**2)
