"""Distribute the states of findings to legs, corners, threats and zones; a place has its worst state."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from logs.verdict.findings import Finding
from logs.verdict.measures.acceptance import position_error
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.violated_legs import legs_near_missiles, violated_legs
from logs.verdict.presentation import FindingRow, PlaceState, near_threat_text

# Distance from a missile's sphere that is near it, if the navigation error is not larger, m.
_NEAR_SPHERE_M = 10.0
_SEVERITY_ORDER = {"fail": 0, "open": 1, "near": 2, "ok": 3}


class PlaceStates(NamedTuple):
    """States of the legs and corners of a route that have findings, and failed threats and zones.

    legs: states by leg.
    corners: states by waypoint.
    threats, zones: numbers of the failed threats and zones.
    """

    legs: dict[int, PlaceState]
    corners: dict[int, PlaceState]
    threats: frozenset[int]
    zones: frozenset[int]


def place_states(requirements: RouteRequirements, findings: Sequence[Finding], *, shift: int = 0) -> PlaceStates:
    """Return the states of legs, corners, threats and zones according to findings.

    If a threat or zone is violated, the legs that enter it fail, too.  Legs that pass a missile's sphere closely have
    the state "near".
    shift: number added to the numbers of legs and corners, for the findings on a part of a route.
    """
    legs: dict[int, PlaceState] = {}
    corners: dict[int, PlaceState] = {}
    threats: set[int] = set()
    zones: set[int] = set()
    for finding in findings:
        place = finding.place
        state = FindingRow(finding).place_state
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
    for leg, (distance, number) in legs_near_missiles(requirements, max_distance).items():
        text = near_threat_text(names[number], distance, navigation_error)
        _set_worse_state(legs, (leg + shift,), PlaceState("near", distance / max_distance, text))
    return PlaceStates(legs, corners, frozenset(threats), frozenset(zones))


def _set_worse_state(states: dict[int, PlaceState], numbers: Iterable[int], state: PlaceState) -> None:
    """Set the state of the legs or corners with the given numbers, unless their present state is worse."""
    for number in numbers:
        previous = states.get(number)
        if previous is None or (_SEVERITY_ORDER[state.state], state.closeness) < (
            _SEVERITY_ORDER[previous.state],
            previous.closeness,
        ):
            states[number] = state
