"""States of legs, corners, threats and zones according to a verdict, each with the closest limit.

A state is "fail", "open" (not judged, therefore not flyable), "near" a limit, or "ok".  Numbers and words are taken
from the finding that is closest to its limit.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from logs.verdict.findings import Finding, undecided_findings
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.violated_legs import violated_legs
from logs.verdict.rule_words import RULE_WORDS

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
        state = finding_state(item, unjudged=id(item) in is_open)
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


def finding_state(item: Finding, *, unjudged: bool = False) -> State | None:
    """Return the state of a place according to one finding, or None for a finding that does not affect it.

    unjudged: True if the verdict is withheld because of this finding.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import Place
    >>> slope = make_finding(
    ...     "slope", Place("leg", 1), ok=True, reason="", planned=13.5, limit=14.2, margin=0.7, unit="deg"
    ... )
    >>> finding_state(slope)
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
