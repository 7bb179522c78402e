"""States of legs, corners, threats and zones according to a verdict.

A state is "fail", "open" (not judged, therefore not flyable), "near" (close to a limit) or "ok". Its text describes
the finding that is closest to its limit.
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
_SEVERITY_ORDER = {"fail": 0, "open": 1, "near": 2, "ok": 3}


class State(NamedTuple):
    """State of a place.

    state: "fail", "open", "near" or "ok".
    closeness: margin as a multiple of a noticeable difference; below 1 is near the limit, below 0 beyond the limit.
    text: short text of the finding, shown at the pointer.
    """

    state: str
    closeness: float = math.inf
    text: str = ""


class PlaceStates(NamedTuple):
    """States of the legs and corners of a route that have findings, and failed threats and zones.

    legs: states by leg.
    corners: states by waypoint.
    threats, zones: numbers of the failed threats and zones.
    """

    legs: dict[int, State]
    corners: dict[int, State]
    threats: frozenset[int]
    zones: frozenset[int]


def place_states(requirements: RouteRequirements, findings: Sequence[Finding], *, shift: int = 0) -> PlaceStates:
    """Return the states of legs, corners, threats and zones according to findings.

    A violated threat or zone also fails the legs that enter it.
    shift: number added to the numbers of legs and corners, for the findings on a part of a route.
    """
    legs: dict[int, State] = {}
    corners: dict[int, State] = {}
    threats: set[int] = set()
    zones: set[int] = set()
    open_ids = {id(finding) for finding in undecided_findings(findings)}
    for finding in findings:
        state = finding_state(finding, unjudged=id(finding) in open_ids)
        if state is None:
            continue
        place = finding.place
        if place.kind == "leg" and place.index is not None:
            _set_worse_state(legs, (place.index + shift,), state)
        elif place.kind == "waypoint" and place.index is not None:
            _set_worse_state(corners, (place.index + shift,), state)
        elif state.state == "fail":
            _set_worse_state(legs, (leg + shift for leg in violated_legs(requirements, finding)), state)
            if place.index is not None:
                (threats if place.kind in ("missile", "radar") else zones).add(place.index)
    return PlaceStates(legs, corners, frozenset(threats), frozenset(zones))


def _set_worse_state(states: dict[int, State], numbers: Iterable[int], state: State) -> None:
    """Set the state of the legs or corners with the given numbers, unless their present state is worse."""
    for number in numbers:
        previous = states.get(number)
        if previous is None or (_SEVERITY_ORDER[state.state], state.closeness) < (
            _SEVERITY_ORDER[previous.state],
            previous.closeness,
        ):
            states[number] = state


def finding_state(finding: Finding, *, unjudged: bool = False) -> State | None:
    """Return the state of a place according to one finding.

    Returns None if the finding does not affect the state.

    unjudged: True if the verdict is withheld because of this finding.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import Place
    >>> slope = make_finding(
    ...     "slope", Place("leg", 1), ok=True, reason="", planned=13.5, limit=14.2, margin=0.7, unit="deg"
    ... )
    >>> finding_state(slope)
    State(state='near', closeness=0.7, text='slope 13.5° (≤ 14.2°)')
    """
    if finding.ok is None:
        return State("open", 0.0, f"{_rule_name(finding)}: {finding.brief or finding.reason}") if unjudged else None
    if finding.ok is False:
        return State(
            "fail", -math.inf if finding.margin is None else finding.margin, f"{_rule_name(finding)}: {finding.brief}"
        )
    if finding.margin is None or finding.planned is None:
        return None
    closeness = _closeness(finding)
    return State("near" if closeness < 1.0 else "ok", closeness, _value_text(finding))


def _rule_name(finding: Finding) -> str:
    """Return the name of a finding's rule for the page."""
    return RULE_WORDS[finding.rule].word


def _closeness(finding: Finding) -> float:
    """Return the margin of a finding, relative to the margin below which it is shown as near its limit."""
    scale, margin = RULE_WORDS[finding.rule].scale, finding.margin or 0.0
    if scale is None:
        if finding.limit is None or not finding.limit:
            return math.inf
        scale = _NEAR_FRACTION * abs(finding.limit)
    return margin / scale


def _value_text(finding: Finding) -> str:
    """Return the rule, the value and the limit of a finding, such as "slope 5.2° (6.0°)"."""
    value, limit = finding.compared_texts()
    return f"{_rule_name(finding)} {value}" + (f" ({limit})" if limit else "")
