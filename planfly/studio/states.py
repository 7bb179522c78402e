"""States of legs, corners, threats and zones according to a verdict.

A state is "fail", "open" (not judged, therefore not flyable), "near" (close to a limit) or "ok". Its text describes
the finding that is closest to its limit.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from logs.verdict.findings import Finding
from logs.verdict.measures.acceptance import position_error
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.violated_legs import legs_near_missiles, violated_legs
from logs.verdict.presentation import short_text
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.wording import quantity_text

# Fraction of the limit within which a value is near the limit, if the margin's scale is not smaller.
_NEAR_FRACTION = 0.1
# Distance from a missile's sphere that is near it, if the navigation error is not larger, m.
_NEAR_SPHERE_M = 10.0
_SEVERITY_ORDER = {"fail": 0, "open": 1, "near": 2, "ok": 3}


class State(NamedTuple):
    """State of a place.

    state: "fail", "open", "near" or "ok".
    closeness: margin divided by the margin below which a value is near its limit; negative beyond the limit.
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

    If a threat or zone is violated, the legs that enter it fail, too.  Legs that pass a missile's sphere closely have
    the state "near".
    shift: number added to the numbers of legs and corners, for the findings on a part of a route.
    """
    legs: dict[int, State] = {}
    corners: dict[int, State] = {}
    threats: set[int] = set()
    zones: set[int] = set()
    for finding in findings:
        place = finding.place
        # The height of a leg is unknown where the leg leaves the terrain data.
        is_unknown = finding.ok is None and finding.planned is None
        leaves_terrain = is_unknown and finding.rule == "clearance" and place.kind == "leg"
        state = finding_state(finding, unjudged=finding.state == "open" or leaves_terrain)
        if state is None:
            continue
        if place.kind == "leg" and place.index is not None:
            _set_worse_state(legs, (place.index + shift,), state)
        elif place.kind == "waypoint" and place.index is not None:
            _set_worse_state(corners, (place.index + shift,), state)
        elif state.state == "fail":
            _set_worse_state(legs, (leg + shift for leg in violated_legs(requirements, finding)), state)
            if place.index is not None:
                (threats if place.kind in ("missile", "radar") else zones).add(place.index)
    # Legs near a missile's sphere.
    navigation_error, names = position_error(requirements.setup), requirements.setup.scenario.threats.names
    max_distance = max(_NEAR_SPHERE_M, navigation_error)
    error_text = f" (navigation error {quantity_text(navigation_error, 'm')})" if navigation_error > 0.0 else ""
    for leg, (distance, number) in legs_near_missiles(requirements, max_distance).items():
        text = f"{RULE_WORDS['threat'].word} {names[number]} {quantity_text(distance, 'm')} away{error_text}"
        _set_worse_state(legs, (leg + shift,), State("near", distance / max_distance, text))
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

    unjudged: True if the place is not judged because of this finding.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import Place
    >>> slope = make_finding(
    ...     "slope", Place("leg", 1), ok=True, reason="", planned=13.5, limit=14.2, margin=0.7, unit="deg"
    ... )
    >>> finding_state(slope)
    State(state='near', closeness=0.7, text='slope 13.5° (≤ 14.2°)')
    """
    if finding.ok is None:
        return State("open", 0.0, short_text(finding)) if unjudged else None
    if finding.ok is False:
        return State("fail", -math.inf if finding.margin is None else finding.margin, short_text(finding))
    if finding.margin is None or finding.planned is None:
        return None
    is_tolerated = (finding.limit or 0.0) <= (finding.tolerance or 0.0)
    if finding.rule == "waypoint" and finding.limit_source == "autopilot" and is_tolerated:
        # At a nearly straight waypoint, ArduPlane's acceptance radius is about zero: no value is near it or beyond it.
        return State("ok", text=short_text(finding))
    closeness = _closeness(finding)
    # The tolerance and its purpose are stated if the value is near its limit only without the tolerance.
    with_tolerance = closeness < 1.0 <= _closeness(finding, finding.tolerance or 0.0)
    text = short_text(finding, with_tolerance=with_tolerance)
    return State("near" if closeness < 1.0 else "ok", closeness, text)


def _closeness(finding: Finding, tolerance: float = 0.0) -> float:
    """Return the margin of a finding divided by the margin below which a value is near its limit.

    A value is near its limit within a tenth of the limit, but at most within the scale of the rule's margin.  Returns
    infinity for a rule that has neither.

    tolerance: added to the margin, in the finding's unit.
    """
    scale = RULE_WORDS[finding.rule].scale or math.inf
    near_margin = min(scale, _NEAR_FRACTION * abs(finding.limit)) if finding.limit else scale
    return ((finding.margin or 0.0) + tolerance) / near_margin if math.isfinite(near_margin) else math.inf
