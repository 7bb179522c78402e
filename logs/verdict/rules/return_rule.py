"""The return rule: judge the destination of a return to launch (RTL), and how far the RTL was flown.

A mission only states that the aircraft is to return.  The autopilot chooses the path back, so the path has no required
corridor, waypoint or slope, and the RTL is not compared with its placeholder in the route.  Ground, threats, zones,
area, speed, stall and energy are judged on the RTL as on every other leg.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from flight.mission.items import Command
from flight.mission.return_path import RTL_NOT_CONTINUED_TEXT
from logs.verdict.findings import NO_HOME, UNKNOWN_RETURN, Finding, Message, make_finding, message
from logs.verdict.measures.mission_ends import (
    judged_return_text,
    judges_return_after_last_item,
    missing_home_text,
)
from logs.verdict.measures.route_progress import return_loiter_reach
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT, Change, Suggestion
from logs.verdict.returns.glides_text import glides_headline
from logs.verdict.returns.judge_glides import GLIDE_CLEARANCE_M, judge_glides
from logs.verdict.returns.judge_returns import (
    UNJUDGED,
    ReturnWorld,
    heights_above_ground,
    judge_returns,
    make_return_world,
    rtl_autopilot_title,
)
from logs.verdict.returns.return_starts import (
    ReturnStarts,
    flown_starts,
    planned_starts,
    return_start_at_path_end,
    return_start_at_track_end,
)
from logs.verdict.returns.returns_text import measured_text, outcome_text, returns_headline
from logs.verdict.rule import Rule
from world.errors import MissionError
from world.scenario_tables import ReturnDemand

# Maximum number of simulated returns to launch if the scenario requires all to be safe.  Up to this number, one begins
# each second of flight; each takes 2 ms.
_MAX_RETURNS = 3000
# Rules that judge how well a flight follows its legs.
_LEG_RULES = frozenset({"turn", "waypoint", "corridor", "slope", "loiter"})


def return_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the planned returns to launch, and whether an imported flight completed its RTL.

    The planned returns are the mission's RTL, the RTL after its last item, and the returns that the scenario requires.
    Return [] for a flight simulated by planfly, which `flown_return_findings` judges because the track does not show
    how the flight ended.

    geometric: True to judge the planned path only.
    """
    if geometric:
        required_findings = _requirement_findings(
            requirements, partial(planned_starts, requirements.setup, requirements=requirements)
        )
        end_findings = _automatic_return_findings(requirements, return_start_at_path_end(requirements))
        return [*_rtl_findings(requirements, ok=None, outcome="not flown yet"), *end_findings, *required_findings]
    if requirements.setup.imported_log is None:
        return []
    continues_to_landing = requirements.setup.route.rtl_end <= requirements.legs
    has_arrived = (
        aligned is not None
        and bool(aligned.passed[-1])
        and (continues_to_landing or return_loiter_reach(requirements.setup.route, aligned.track) is not None)
    )
    return _flown_rtl_findings(requirements, has_arrived)


def flown_return_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, end_reason: str, log_complete: bool
) -> list[Finding]:
    """Judge a flight's RTL, the RTL after its last item, and the requirements on returns.

    The scenario states the requirements.

    end_reason: "completed" if the flight ended after its RTL loiter, otherwise the reason for its end.
    log_complete: not used, because the completion rule reports it.
    """
    has_arrived = aligned is not None and bool(aligned.passed[-1]) and end_reason == "completed"
    reason = "" if end_reason == "completed" else f": {end_reason}"
    track = None if aligned is None else aligned.track
    starts = partial(planned_starts, requirements.setup, requirements=requirements)
    if track is not None:
        starts = partial(flown_starts, requirements.setup, track)
    end = return_start_at_track_end(track) if track is not None and has_arrived else None
    return [
        *_flown_rtl_findings(requirements, has_arrived, reason),
        *_automatic_return_findings(requirements, end),
        *_requirement_findings(requirements, starts),
    ]


def _automatic_return_findings(requirements: RouteRequirements, end: ReturnStarts | None) -> list[Finding]:
    """Judge the return to launch that ArduPlane begins by itself after the last item.

    Return [] if the mission ends in another way.

    end: state at the end of the mission, from which this return starts; None if the flight did not reach it.
    """
    setup = requirements.setup
    if not judges_return_after_last_item(setup):
        return []
    end_waypoint = requirements.waypoint_place(requirements.legs)
    if reason := missing_home_text(setup):
        return [make_finding("return", end_waypoint, ok=None, reason=reason, check=NO_HOME)]
    ok: bool | None = None
    check, brief = "", "the flight did not reach the end of the mission"
    text = brief
    if end is not None:
        world = make_return_world(setup)
        returns = judge_returns(world, end, 1.0)
        # The first ending is the one by RTL_AUTOLAND; the others are those of failsafes.
        simulated = returns.each[0] if returns.each else None
        if simulated is None or simulated.target.landing is not None:
            brief = "the return after the last item is not judged"
            text = f"{brief}: {returns_headline(returns)}"
        else:
            brief = f"return after the last item ({outcome_text(simulated, world.limit)})"
            text = f"the return after the last item {measured_text(simulated, world.limit, setup.scenario)}"
            # The clearance and energy rules already report missing terrain data and an empty battery.
            is_reported = simulated.kind == "used" or (simulated.kind == "unknown" and setup.scenario.terrain is None)
            ok = simulated.safe or is_reported or (None if simulated.kind in UNJUDGED else False)
            text += "" if ok else f". {judged_return_text(setup)}"
        check = UNKNOWN_RETURN if ok is None else ""
    fault = Message(text, brief)
    return [
        make_finding(
            "return",
            end_waypoint,
            ok=ok,
            reason=fault.text,
            faults=[] if ok else [fault],
            method=_method_text(rtl_autopilot_title(setup)),
            check=check,
        )
    ]


def _requirement_findings(requirements: RouteRequirements, starts: Callable[[float], ReturnStarts]) -> list[Finding]:
    """Judge with one finding if RTLs and glides meet the scenario's requirements.

    Return [] without requirements.

    starts: function that samples the starts of RTLs at an interval, s.
    """
    setup = requirements.setup
    requirement = setup.scenario.returns
    judges = [] if requirement is None else [_JUDGES[name] for name in requirement.require if name in _JUDGES]
    if requirement is None or not judges:
        return []
    interval = float(max(1, math.ceil(setup.path.length / setup.airspeed / _MAX_RETURNS)))
    try:
        world, return_starts = make_return_world(setup), starts(interval)
        answers = [judge(world, return_starts, interval) for judge in judges]
    except MissionError as error:
        # Without a home no RTL is safe, and the places that a glide reaches are unknown.
        ok_without_home = False if "rtl" in requirement.require else None
        answers = [_RequirementResult(ok_without_home, str(error), _method_text(rtl_autopilot_title(setup)))]
    results = {answer.ok for answer in answers}
    ok = False if False in results else None if None in results else True
    # Failures come first, then unknown answers.
    answers.sort(key=lambda answer: (answer.ok is not False, answer.ok is not None))
    reason = "; ".join(answer.reason for answer in answers)
    method = "; ".join(answer.method for answer in answers)
    method = f"one return every {interval:.0f} s of the route, {method}"
    # An unknown answer to a requirement leaves the verdict undecided.
    faults, check = ([Message(reason, _NOT_KNOWN)], UNKNOWN_RETURN) if ok is None else ([], "")
    return [
        make_finding(
            "return", FLIGHT, ok=ok, reason=reason, faults=faults, source="scenario", method=method, check=check
        )
    ]


_NOT_KNOWN = "it is not fully known whether the aircraft gets home as the scenario requires"


def _method_text(autopilot: str) -> str:
    """Describe how simulated returns to launch are judged.

    autopilot: title of the autopilot that returns.
    """
    return f"by the simulated {autopilot} flying a point-mass model"


class _RequirementResult(NamedTuple):
    """Answer to a requirement on returns.

    ok: True if the requirement is met, False if not, None if unknown.
    reason: explanation of the answer.
    method: description of how the returns were judged.
    """

    ok: bool | None
    reason: str
    method: str


def _judge_rtl(world: ReturnWorld, starts: ReturnStarts, interval: float) -> _RequirementResult:
    """Answer the requirement that the RTL from every start is safe.

    interval: time between the starts, s.
    """
    judged_returns = judge_returns(world, starts, interval)
    return _RequirementResult(
        None if judged_returns.undecided else judged_returns.safe,
        returns_headline(judged_returns),
        _method_text(judged_returns.autopilot),
    )


def _judge_glides(world: ReturnWorld, starts: ReturnStarts, _: float) -> _RequirementResult:
    """Judge if a glide from every start reaches a destination, as the scenario requires.

    Destinations are home, rally points, landing sites and flat ground.

    Starts below the minimum height above ground are omitted.  The aircraft is taking off or landing there, and would
    descend straight ahead.
    """
    is_low = heights_above_ground(world, starts) < world.limit
    glides = judge_glides(world, starts.subset(np.flatnonzero(~is_low)))
    omitted_text = (
        f"; {is_low.sum()} starts lower than {world.limit:.0f} m above ground are omitted" if is_low.any() else ""
    )
    reason = f"without the engine: {glides_headline(glides)}{omitted_text}"
    return _RequirementResult(
        glides.always_reaches_ground, reason, f"glides that keep {GLIDE_CLEARANCE_M:.0f} m above ground"
    )


# The go-around has its own rule.
_JUDGES: dict[ReturnDemand, Callable[[ReturnWorld, ReturnStarts, float], _RequirementResult]] = {
    "rtl": _judge_rtl,
    "glide": _judge_glides,
}


def _flown_rtl_findings(requirements: RouteRequirements, has_arrived: bool, reason: str = "") -> list[Finding]:
    """Return one finding on the mission's RTL in a flight, or [] for a mission without an RTL.

    The finding passes if the aircraft arrived; otherwise it is not judged.

    reason: text on the end of the flight, which is appended if the aircraft did not arrive.
    """
    outcome = "flown to its end" if has_arrived else f"the flight did not reach its end{reason}"
    return _rtl_findings(requirements, True if has_arrived else None, outcome)


def _rtl_findings(requirements: RouteRequirements, ok: bool | None, outcome: str) -> list[Finding]:
    """Return one finding on the path of the mission's RTL, or [] for a mission without an RTL.

    ok: result of the finding; replaced by None if the destination of the RTL is unknown.
    outcome: text on how far the RTL was flown.
    """
    route = requirements.setup.route
    if route.rtl_start is None:
        return []
    name = f"{Command.NAV_RETURN_TO_LAUNCH.name} "
    note_text = next((note.partition(name)[2] for note in route.notes if name in note), "")
    reason = f"the simulated {requirements.setup.autopilot.title} {note_text or 'returns'}; {outcome}"
    unknown_reason = next((note.partition(": ")[2] for note in route.notes if RTL_NOT_CONTINUED_TEXT in note), "")
    faults = []
    if unknown_reason and requirements.setup.imported_log is None:
        # The simulated path does not show where the real autopilot flies.
        faults, ok = [message("the destination of the return is unknown", f": {unknown_reason}")], None
        reason = f"{faults[0].text}; {reason}"
    return [
        make_finding(
            "return",
            requirements.waypoint_place(route.rtl_start + 1),
            ok=ok,
            reason=reason,
            faults=faults,
            method="the autopilot's own return path",
            check=UNKNOWN_RETURN if faults else "",
        )
    ]


def without_path_following_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, findings: Sequence[Finding]
) -> tuple[Finding, ...]:
    """Remove the findings on how well the RTL follows its drawn path.

    If the finding on the RTL passes, also remove the unjudged findings on drawn legs that were not flown.

    findings: all findings, including the finding on the RTL itself.
    """
    first_leg = requirements.setup.route.rtl_start
    if first_leg is None:
        return tuple(findings)
    # The corner where the return begins belongs to the return; the waypoint there belongs to the mission.
    end_waypoint = requirements.setup.route.rtl_end
    return_points = {
        requirements.waypoint_place(i) for i in range(first_leg + 1, min(end_waypoint, requirements.legs + 1))
    }
    legs = requirements.setup.route.rtl_legs
    return_points |= {requirements.leg_place(i) for i in legs}
    first_corner = requirements.waypoint_place(first_leg)
    kept_findings = [
        finding
        for finding in findings
        if not (
            (finding.rule in _LEG_RULES and finding.place in return_points)
            or (finding.rule == "turn" and finding.place == first_corner)
        )
    ]
    if aligned is None or not any(
        finding.rule == "return" and finding.place != FLIGHT and finding.ok for finding in kept_findings
    ):
        return tuple(kept_findings)
    # Each part of the flown return belongs to a drawn leg.  A drawn leg without such a part was not flown.
    unflown_places = {requirements.leg_place(i) for i in legs if not aligned.has_flown(i)}
    return tuple(finding for finding in kept_findings if finding.ok is not None or finding.place not in unflown_places)


def _suggest_end_loiter(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest an unlimited loiter at the last waypoint, if the automatic return from there fails."""
    setup, end = requirements.setup, requirements.waypoint_place(requirements.legs)
    commands = {item.seq: item.command for item in setup.mission.items}
    is_waypoint = commands.get(-1 if end.item is None else end.item) == Command.NAV_WAYPOINT
    if finding.place != end or not is_waypoint or not judges_return_after_last_item(setup):
        return ()
    return ((Change("end loiter", end, current=None, wanted=float(Command.NAV_LOITER_UNLIM), unit=""),),)


RULE = Rule(
    name="return",
    judge=return_findings,
    judge_end=flown_return_findings,
    merge=without_path_following_findings,
    suggest=_suggest_end_loiter,
)
