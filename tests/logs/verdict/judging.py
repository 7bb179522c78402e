"""What the verdict tests share: a route, judging it, places, and finding one finding."""

import math
from typing import Any

import numpy as np

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_flight
from logs.verdict.places import Change, Place
from logs.verdict.verdict import Verdict, verdict_json
from planner.plan import Certificate, Plan

ROUTE = [[0, 0, 300], [0, 2000, 300], [1500, 3500, 380], [1500, 6000, 300], [3500, 6500, 300]]
# Rules that find nothing to judge on a plain route: no loiter, fence, take-off, landing or return, no faulty item.
SILENT_ON_WAYPOINTS = frozenset(
    {"mission", "loiter", "takeoff", "climbout", "landing", "approach", "go_around", "return", "height", "fence"}
    | {"survey", "launch", "touchdown", "link"}
)


def judge(setup: FlightSetup, track: Track, **how: Any) -> Verdict:
    verdict = judge_flight(setup, track, "completed", **how)
    verdict_json(verdict)  # refuses NaN
    return verdict


def leg(number: int) -> Place:
    return Place("leg", number)


def waypoint(number: int) -> Place:
    return Place("waypoint", number)


def missile(name: str) -> Place:
    return Place("missile", name=name)


def radar(name: str) -> Place:
    return Place("radar", name=name)


def bare(place: Place) -> Place:
    """A place without its mission item, a threat by its name alone."""
    return Place(place.kind, None if place.name else place.index, name=place.name)


def of(verdict: Verdict, rule: str, place: Place | None = None) -> Finding:
    found = [item for item in verdict.findings if item.rule == rule and place in (None, bare(item.place))]
    assert found, f"no finding {rule} {place}"
    return found[0]


def failing(verdict: Verdict) -> set[tuple[str, Place]]:
    return {(item.rule, bare(item.place)) for item in verdict.findings if item.ok is False}


def suggested(item: Finding, what: str, place: Place | None = None) -> Change:
    """The first change of this quantity that a finding suggests."""
    found = [
        change
        for suggestion in item.suggestions
        for change in suggestion
        if change.what == what and place in (None, bare(change.place))
    ]
    assert found, f"no {what} in {item.suggestions}"
    return found[0]


def bad_plan(setup: FlightSetup) -> Plan:
    return Plan(
        scenario=setup.scenario,
        waypoints=setup.route.positions,
        violations=np.array([0, 2, 0, 0]),
        objectives=np.zeros(4),
        certificate=Certificate(0.1, math.inf, -0.05, 12.0, 100.0, 50.0, ("leg 2: slope 16.6 deg beyond 13.7 deg",)),
        seed=1,
        algorithm="umda",
        evaluations=1,
        history=np.zeros((0, 3)),
    )
