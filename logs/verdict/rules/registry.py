"""List all judging rules of the verdict, and run them.

To add a rule, write its words in `logs.verdict.rule_words`, its file, and its line here.
"""

from collections.abc import Sequence
from dataclasses import replace

from flight.guidance.path import reversals
from logs.verdict.findings import (
    GROUND_PATH,
    NOT_FLOWN,
    UNKNOWN_AIRCRAFT,
    Finding,
    make_finding,
    message,
    worst_first_key,
)
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import Place, TriedSuggestions
from logs.verdict.rule import Rule
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.rules import (
    bounds_rule,
    clearance_rule,
    climbout_approach_rule,
    completion_rule,
    corridor_rule,
    energy_rule,
    fence_rule,
    go_around_rule,
    height_rule,
    launch_rule,
    link_rule,
    loiter_rule,
    loss_of_control_rule,
    mission_rule,
    return_rule,
    slope_rule,
    speed_rule,
    stall_rule,
    survey_rule,
    takeoff_landing_rule,
    threat_rule,
    touchdown_rule,
    turn_rule,
    waypoint_rule,
)
from logs.verdict.wording import place_text

_RULES = (
    mission_rule.RULE,
    turn_rule.RULE,
    loiter_rule.RULE,
    slope_rule.RULE,
    clearance_rule.RULE,
    height_rule.RULE,
    fence_rule.RULE,
    threat_rule.RULE,
    bounds_rule.RULE,
    waypoint_rule.RULE,
    corridor_rule.RULE,
    survey_rule.RULE,
    speed_rule.RULE,
    stall_rule.RULE,
    takeoff_landing_rule.TAKEOFF,
    climbout_approach_rule.CLIMBOUT,
    launch_rule.RULE,
    takeoff_landing_rule.LANDING,
    climbout_approach_rule.APPROACH,
    touchdown_rule.RULE,
    go_around_rule.RULE,
    return_rule.RULE,
    link_rule.RULE,
    energy_rule.RULE,
    loss_of_control_rule.RULE,
    completion_rule.RULE,
)

# All rules by name, in the order of `RULE_WORDS`, which is the order in which a verdict judges and lists them.
RULES: dict[str, Rule] = {name: next(rule for rule in _RULES if rule.name == name) for name in RULE_WORDS}

# ----------------------------------------------------------------------
# The findings of each level, rule by rule in the order of `RULES`.


def run_rules(
    requirements: RouteRequirements,
    aligned: AlignedTrack | None,
    *,
    geometric: bool = False,
    end_reason: str | None = None,
    log_complete: bool = True,
    includes_whole_flight: bool = True,
    flight_findings: Sequence[Finding] | None = None,
    suggests: bool = False,
) -> tuple[Finding, ...]:
    """Judge a flown track or a route by all rules, and return the findings after all merges.

    geometric: True to judge the route by its geometry, False to judge the flight.  The mission's items are judged with
        a flight, and by `logs.verdict.judge_geometry.judge_geometry`.
    end_reason: "completed", or the reason why the flight ended early; None if the end of the flight is not judged.
    log_complete: True if the log is not cut off.
    includes_whole_flight: True to include rules that judge the whole flight, and to keep only the worst findings of
        each stop; False for only the findings on legs, corners, threats and zones.
    flight_findings: findings on a flight of a route that is judged by its geometry.  Findings of rules with
        `Rule.is_same_for_plan` are copied from them; None to run these rules, too.
    suggests: True to add ``suggestions`` to the failed or undecided findings that a change could fix.  If there are
        more than `MAX_SUGGESTED_FINDINGS` such findings, none of them gets suggestions.
    """
    findings: list[Finding] = []
    for rule in RULES.values():
        if rule.judge is None or (rule.judges_whole_flight and not includes_whole_flight):
            continue
        if rule.is_same_for_plan and flight_findings is not None:
            findings += [finding for finding in flight_findings if finding.rule == rule.name]
        else:
            findings += rule.judge(requirements, aligned, geometric=geometric)
    if end_reason is not None:
        for rule in RULES.values():
            if rule.judge_end is not None:
                findings += rule.judge_end(requirements, aligned, end_reason, log_complete)
    merged = tuple(findings)
    for rule in RULES.values():
        if rule.merge is not None:
            merged = rule.merge(requirements, aligned, merged)
    if includes_whole_flight:
        merged = (*worst_finding_per_stop(merged), *_other_side_findings(requirements, merged))
    if not geometric or flight_findings is not None:
        merged = (*mission_rule.blocking_findings(requirements.setup), *merged)
    if not suggests:
        return merged
    return_legs = {requirements.leg_place(i) for i in requirements.setup.route.rtl_legs}
    places = [k for k, finding in enumerate(merged) if _needs_suggestions(finding, return_legs)]
    results = list(merged)
    for k in places if len(places) <= MAX_SUGGESTED_FINDINGS else ():
        if (suggest := RULES[results[k].rule].suggest) is not None:
            results[k] = replace(results[k], suggestions=suggest(requirements, aligned, results[k]))
    return tuple(results)


# Rules that judge the aircraft's position, which depends on the side to which it turns at a course reversal.
_POSITION_RULES = ("clearance", "threat", "fence")


def _other_side_findings(requirements: RouteRequirements, findings: Sequence[Finding]) -> list[Finding]:
    """Return an undecided finding for each place that fails only if the aircraft reverses to one side.

    At a corner of 180 degrees the autopilot may turn left or right, so the route is judged for both directions.
    A flight shows only one direction, which depends on its navigation error: of 12 ArduPlane flights through a turn of
    180 degrees, 4 turned left.  Return [] for an imported flight, and for a route without a course reversal.
    """
    setup = requirements.setup
    corners = reversals(setup.route)
    if setup.imported_log is not None or not corners.size:
        return []
    other_side = route_requirements(setup.with_long_reversals(), envelope=requirements.envelope)
    failures_by_side = [
        {
            (finding.rule, finding.place): finding
            for name in _POSITION_RULES
            if (judge := RULES[name].judge) is not None
            for finding in judge(side_requirements, None, geometric=True)
            if finding.ok is False
        }
        for side_requirements in (replace(requirements, ground_phases=None), other_side)
    ]
    failed_keys = {(finding.rule, finding.place) for finding in findings if finding.ok is False}
    corners_text = ", ".join(place_text(requirements.waypoint_place(int(i))) for i in corners)
    one_sided_findings = []
    for key in (failures_by_side[0].keys() ^ failures_by_side[1].keys()) - failed_keys:
        finding = failures_by_side[0].get(key) or failures_by_side[1][key]
        brief = f"the autopilot may turn left or right at {corners_text}, and on one side the flight fails"
        fault = message(brief, f": {finding.reason}")
        one_sided_findings.append(
            make_finding(finding.rule, finding.place, ok=None, reason=fault.text, faults=[fault], check=NOT_FLOWN)
        )
    return sorted(one_sided_findings, key=lambda finding: (finding.rule, str(finding.place)))


def worst_finding_per_stop(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Keep each rule's worst finding on the corners and on the legs of each stop.

    The legs are those to the stop.

    A stop is a waypoint or a loiter of the mission; a loiter is flown as several corners and legs.

    >>> from logs.verdict.places import Place
    >>> legs = [Place("leg", k, to_item=4, number=2) for k in (2, 3, 4)]
    >>> margins = zip(legs, (9.0, 4.0, 7.0))
    >>> heights = [make_finding("clearance", leg, ok=True, reason="", margin=margin) for leg, margin in margins]
    >>> [item.place.index for item in worst_finding_per_stop(heights)]
    [3]
    """
    worst_by_stop: dict[tuple[object, ...], Finding] = {}
    for k, finding in enumerate(findings):
        place = finding.place
        has_stop = place.kind in ("leg", "waypoint") and place.number is not None
        key = (finding.rule, finding.check, place.kind, place.number, place.item, place.to_item) if has_stop else (k,)
        if key not in worst_by_stop or worst_first_key(finding) < worst_first_key(worst_by_stop[key]):
            worst_by_stop[key] = finding
    return tuple(worst_by_stop.values())


# Greatest number of findings for which suggestions are made; if more fail, no single change mends the mission.
MAX_SUGGESTED_FINDINGS = 200


def _needs_suggestions(finding: Finding, return_legs: set[Place]) -> bool:
    """Return True for a finding that gets suggestions: a failed or undecided one that a change could fix.

    On the legs of a return to launch only findings on clearance get suggestions: the autopilot chooses the path of a
    return, and the mission and a parameter decide only its start and its altitude.

    return_legs: legs of the route's return to launch.
    """
    # A change decides an undecided finding on the aircraft or on home's altitude.
    is_on_home = finding.rule == "clearance" and finding.check == GROUND_PATH
    is_open = finding.ok is None and (finding.check == UNKNOWN_AIRCRAFT or is_on_home)
    return (
        (finding.ok is False or is_open)
        and RULES[finding.rule].suggest is not None
        and (finding.place not in return_legs or finding.rule == "clearance")
    )


def with_passing_suggestions(
    findings: tuple[Finding, ...], trials: Sequence[TriedSuggestions] | None
) -> tuple[Finding, ...]:
    """Keep only those suggestions of failed findings that passed their trials.

    trials: suggestions that passed their trials, by rule and place; None to keep all suggestions.

    >>> from logs.verdict.places import Change, Place
    >>> higher = ((Change("height", Place("leg", 2), None, 12.0, "m"),),)
    >>> low = [
    ...     replace(make_finding("clearance", Place("leg", k), ok=False, reason=""), suggestions=higher) for k in (1, 2)
    ... ]
    >>> passing = with_passing_suggestions(tuple(low), [TriedSuggestions("clearance", Place("leg", 2), higher)])
    >>> [bool(item.suggestions) for item in passing]
    [False, True]
    """
    if trials is None:
        return findings
    passing_suggestions = {(trial.rule, trial.place): trial.suggestions for trial in trials}
    return tuple(
        replace(finding, suggestions=passing_suggestions.get((finding.rule, finding.place), ()))
        if finding.ok is False
        else finding
        for finding in findings
    )
