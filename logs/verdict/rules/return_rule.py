"""The return rule: where a return to launch goes, and how far it was flown.

A mission says no more than that the aircraft is to return.  The way back is the autopilot's: it owes no corridor, no
waypoint and no slope to anybody, and what stands for it in the route is not judged for style.  Ground, threats, zones,
area, speed, stall and energy are judged on it as on every other leg.
"""

from collections.abc import Sequence

from flight.mission.items import Command
from logs.verdict.findings import Finding, make_finding
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.rule import Rule

# Rules that hold a flight to its legs.
_OF_LEGS = frozenset({"turn", "waypoint", "corridor", "slope", "loiter"})


def return_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """One finding of a mission that ends with a return to launch: where to and how, and whether it got there."""
    route = requirements.setup.route
    if route.return_from < 0:
        return []
    name = f"{Command.NAV_RETURN_TO_LAUNCH.name}: "
    told = next((note.partition(name)[2] for note in route.notes if name in note), "")
    ok: bool | None = True
    facts = [f"by {requirements.setup.autopilot.title}'s law: {told}"]
    if not geometric:
        reached = aligned is not None and bool(aligned.passed[-1])
        ok = True if reached else None
        facts.append("flown to its end" if reached else "the flight did not get to its end")
    return [
        make_finding(
            "return",
            requirements.waypoint(route.return_from + 1),
            ok=ok,
            reason="; ".join(facts),
            method="the autopilot's own way back",
        )
    ]


def without_style(
    requirements: RouteRequirements, aligned: AlignedTrack | None, findings: Sequence[Finding]
) -> tuple[Finding, ...]:
    """Findings without those that hold the way back to its drawing."""
    first = requirements.setup.route.return_from
    if first < 0:
        return tuple(findings)
    # The corner where the way back begins is of its making, the waypoint there is the mission's.
    places = {requirements.waypoint(i) for i in range(first + 1, requirements.legs + 1)}
    places |= {requirements.leg(i) for i in range(first, requirements.legs)}
    corner = requirements.waypoint(first)
    kept = [
        item
        for item in findings
        if not ((item.rule in _OF_LEGS and item.place in places) or (item.rule == "turn" and item.place == corner))
    ]
    if aligned is None or not aligned.passed[-1]:
        return tuple(kept)
    # All of the way is on some leg, and one that is drawn and has nothing of it was none.
    unflown = {requirements.leg(i) for i in range(first, requirements.legs) if not aligned.flew(i)}
    return tuple(item for item in kept if item.ok is not None or item.place not in unflown)


RULE = Rule(
    name="return",
    title="return",
    asks="Where does the return to launch go, how, and did the flight get there?",
    margin=None,
    judge=return_findings,
    merge=without_style,
)
