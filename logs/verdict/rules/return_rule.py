"""The return rule: judge where a return to launch goes, and how far it was flown.

A mission only states that the aircraft is to return.  The autopilot chooses the path back, so the path has no required
corridor, waypoint or slope, and is not judged against its stand-in in the route.  Ground, threats, zones, area, speed,
stall and energy are judged on the return as on every other leg.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from flight.guidance.equivalent_airspeed import true_by_equivalent
from flight.mission.items import Command
from flight.mission.itinerary import UNLIMITED
from flight.mission.return_path import RETURN_NOT_FLOWN_ON
from flight.simulation.tick import RTL_ARRIVAL_ALTITUDE_TOLERANCE_M, RTL_ARRIVAL_LOITER_RADII, RTL_ARRIVAL_RADIUS_M
from logs.verdict.findings import UNKNOWN_RETURN, Finding, Message, make_finding, message
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.returns.glides_text import glides_headline
from logs.verdict.returns.judge_glides import MARGIN, judge_glides
from logs.verdict.returns.judge_returns import ReturnWorld, heights_above_ground, judge_returns, return_world
from logs.verdict.returns.return_starts import ReturnStarts, flown_starts, planned_starts
from logs.verdict.returns.returns_text import headline
from logs.verdict.rule import Rule
from world.errors import MissionError
from world.scenario_tables import ReturnDemand

# Maximum number of simulated returns if all have to be safe: one for each second of flight, 2 ms each.
_MAX_RETURNS = 3000
# Angle by which a logged loiter may fall short of a full lap, rad: its rows may miss up to a second at either end, at
# 26 m/s on 260 m.
_LAP_TOLERANCE_RAD = 0.1
# Rules that judge how well a flight follows its legs.
_LEG_RULES = frozenset({"turn", "waypoint", "corridor", "slope", "loiter"})


def return_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge where a planned return to launch goes, and whether an imported flight completed its return.

    `flown_return_findings` judges planfly's own flights, because their track alone does not tell how they ended.
    """
    if geometric:
        demanded = _requirement_findings(requirements, partial(planned_starts, requirements.setup))
        return _finding(requirements, None, "not flown yet") + demanded
    if requirements.setup.source is None:
        return []
    passed = aligned is not None and bool(aligned.passed[-1])
    lands = requirements.setup.route.return_until <= requirements.legs
    return _flown_finding(requirements, passed and (lands or (aligned is not None and circled(requirements, aligned))))


def flown_return_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, ended: str, log_complete: bool
) -> list[Finding]:
    """Judge the path of a flown return to launch, and whether it arrived.

    ended: "completed" if the flight ended after its loiter, otherwise the reason for its end.
    log_complete: not used, because the completion rule reports it.
    """
    arrived = aligned is not None and bool(aligned.passed[-1]) and ended == "completed"
    why = "" if ended == "completed" else f": {ended}"
    track = None if aligned is None else aligned.track
    starts = partial(planned_starts, requirements.setup)
    if track is not None:
        starts = partial(flown_starts, requirements.setup, track)
    return _flown_finding(requirements, arrived, why) + _requirement_findings(requirements, starts)


def _requirement_findings(requirements: RouteRequirements, starts: Callable[[float], ReturnStarts]) -> list[Finding]:
    """Judge the scenario's requirements on returns and glides from the whole path; return [] without requirements.

    starts: function that samples the starts of returns at an interval, s.
    """
    setup = requirements.setup
    demanded = setup.scenario.returns
    demands = [] if demanded is None else [_DEMANDS[name] for name in demanded.require if name in _DEMANDS]
    if demanded is None or not demands:
        return []
    every = float(max(1, math.ceil(setup.path.length / setup.airspeed / _MAX_RETURNS)))
    try:
        world, return_starts = return_world(setup), starts(every)
        found = [judge(world, return_starts, every) for judge in demands]
    except MissionError as error:
        # Without a home nothing returns; what a glide could reach is not known.
        found = [_Answer(False if "rtl" in demanded.require else None, str(error), _METHOD)]
    results = {one.ok for one in found}
    ok = False if False in results else None if None in results else True
    # Failures come first, then what is not known.
    found.sort(key=lambda one: (one.ok is not False, one.ok is not None))
    reason, method = "; ".join(one.reason for one in found), "; ".join(one.method for one in found)
    method = f"one return every {every:.0f} s of the route, {method}"
    # A verdict that requires them is undecided without them.
    faults, check = ([Message(reason, _NOT_KNOWN)], UNKNOWN_RETURN) if ok is None else ([], "")
    return [
        make_finding(
            "return", FLIGHT, ok=ok, reason=reason, faults=faults, source="scenario", method=method, check=check
        )
    ]


_METHOD = "by the simulated ArduPlane on a point mass"
_NOT_KNOWN = "whether the aircraft gets home as the scenario requires is not known in full"


class _Answer(NamedTuple):
    """Answer to a requirement: True if it is met or None if unknown, the reason, and the method of judging."""

    ok: bool | None
    reason: str
    method: str


def _judge_rtl(world: ReturnWorld, starts: ReturnStarts, every: float) -> _Answer:
    """Judge whether every return to launch is safe."""
    returns = judge_returns(world, starts, every)
    return _Answer(None if returns.undecided else returns.safe, headline(returns), _METHOD)


def _judge_glides(world: ReturnWorld, starts: ReturnStarts, _: float) -> _Answer:
    """Judge whether a glide from every start reaches home, a rally point, a landing place or flat ground.

    Starts below the minimum height above ground are left out, because there the aircraft takes off or lands and would
    descend straight ahead.
    """
    low = heights_above_ground(world, starts) < world.limit
    glides = judge_glides(world, starts.at(np.flatnonzero(~low)))
    left_out = f"; {low.sum()} lower than {world.limit:.0f} m above ground are left out" if low.any() else ""
    reason = f"without the engine: {glides_headline(glides)}{left_out}"
    return _Answer(glides.somewhere, reason, f"glides that keep {MARGIN:.0f} m above ground")


# The go-around has its own rule.
_DEMANDS: dict[ReturnDemand, Callable[[ReturnWorld, ReturnStarts, float], _Answer]] = {
    "rtl": _judge_rtl,
    "glide": _judge_glides,
}


def circled(requirements: RouteRequirements, aligned: AlignedTrack) -> bool:
    """Return True if a track flew its return loiter for at least one lap and for the loiter's full duration.

    The time starts when the aircraft is near the center and at the loiter's altitude, as for a simulated flight
    (`flight.simulation.tick.end_return`).
    """
    end = requirements.setup.route.return_to
    if end is None:
        return False
    track = aligned.track
    east, north, up = (track.position - (end.east, end.north, end.up)).T
    # True radii grow with altitude as the square of true airspeed.
    wide = RTL_ARRIVAL_LOITER_RADII * abs(end.radius) * true_by_equivalent(end.up) ** 2
    at_loiter = (np.hypot(east, north) < max(RTL_ARRIVAL_RADIUS_M, wide)) & (
        np.abs(up) < RTL_ARRIVAL_ALTITUDE_TOLERANCE_M
    )
    if not at_loiter.any():
        return False
    first = int(np.argmax(at_loiter))
    bearing = np.unwrap(np.arctan2(east[first:], north[first:]))
    around = abs(float(bearing[-1] - bearing[0])) >= 2.0 * math.pi - _LAP_TOLERANCE_RAD
    return around and float(track.time[-1] - track.time[first]) >= UNLIMITED


def _flown_finding(requirements: RouteRequirements, arrived: bool, why: str = "") -> list[Finding]:
    outcome = "flown to its end" if arrived else f"the flight did not get to its end{why}"
    return _finding(requirements, True if arrived else None, outcome)


def _finding(requirements: RouteRequirements, ok: bool | None, outcome: str) -> list[Finding]:
    """Return one finding if the mission ends with a return to launch, otherwise []."""
    route = requirements.setup.route
    if route.return_from < 0:
        return []
    name = f"{Command.NAV_RETURN_TO_LAUNCH.name}: "
    note_text = next((note.partition(name)[2] for note in route.notes if name in note), "")
    reason = f"by the simulated {requirements.setup.autopilot.title}: {note_text}; {outcome}"
    other = next((note.partition(": ")[2] for note in route.notes if RETURN_NOT_FLOWN_ON in note), "")
    faults = []
    if other and requirements.setup.source is None:
        # What was flown instead does not show where the autopilot goes.
        faults, ok = [message("where the return leads to is not known", f": {other}")], None
        reason = f"{faults[0].text}; {reason}"
    return [
        make_finding(
            "return",
            requirements.waypoint(route.return_from + 1),
            ok=ok,
            reason=reason,
            faults=faults,
            method="the autopilot's own return path",
            check=UNKNOWN_RETURN if faults else "",
        )
    ]


def without_style(
    requirements: RouteRequirements, aligned: AlignedTrack | None, findings: Sequence[Finding]
) -> tuple[Finding, ...]:
    """Remove the findings that judge how well the return follows its drawn path.

    findings: all findings, including the finding on the return itself.
    """
    first = requirements.setup.route.return_from
    if first < 0:
        return tuple(findings)
    # The corner where the return begins belongs to it; the waypoint there belongs to the mission.
    until = requirements.setup.route.return_until
    legs = range(first, min(until, requirements.legs))
    places = {requirements.waypoint(i) for i in range(first + 1, min(until, requirements.legs + 1))}
    places |= {requirements.leg(i) for i in legs}
    corner = requirements.waypoint(first)
    kept = [
        item
        for item in findings
        if not ((item.rule in _LEG_RULES and item.place in places) or (item.rule == "turn" and item.place == corner))
    ]
    if aligned is None or not any(item.rule == "return" and item.place != FLIGHT and item.ok for item in kept):
        return tuple(kept)
    # All of the return is on some leg; a drawn leg without any part of it was not flown.
    unflown = {requirements.leg(i) for i in legs if not aligned.flew(i)}
    return tuple(item for item in kept if item.ok is not None or item.place not in unflown)


RULE = Rule(
    name="return",
    judge=return_findings,
    judge_end=flown_return_findings,
    merge=without_style,
)
