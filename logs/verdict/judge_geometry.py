"""Judge without a flight: a route by its geometry, a flight that never began, or a plan that is not feasible."""

import math
from collections.abc import Sequence
from dataclasses import replace

from flight.guidance.path import reversals
from flight.simulation.setup import FlightSetup
from logs.verdict.conditions import Conditions, autopilot_line, condition_lines, judging_conditions
from logs.verdict.findings import (
    NOT_FLOWN,
    UNKNOWN_AIRCRAFT,
    Finding,
    finding_reason,
    make_finding,
    message,
    undecided_findings,
    worst_first_key,
)
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT, PLAN, LevelAnswer, LevelName, TriedSuggestions
from logs.verdict.rule import Judge, Rule
from logs.verdict.rules.registry import RULES
from logs.verdict.summary import headline, setup_notes, summary_lines, undecided_text
from logs.verdict.verdict import Verdict
from logs.verdict.wording import place_text
from planner.plan import Plan, Violation

# ----------------------------------------------------------------------
# The findings of each level, rule by rule in the order of `RULES`.


def mission_findings(setup: FlightSetup) -> list[Finding]:
    """Return the findings on mission items, for any autopilot."""
    return [finding for rule in RULES.values() if rule.judge_items is not None for finding in rule.judge_items(setup)]


def blocking_item_findings(setup: FlightSetup) -> list[Finding]:
    """Return the findings on mission items that fail or leave the verdict undecided.

    The items of a plan are judged only if PX4 is to fly them, because planfly wrote them.
    """
    items_are_judged = setup.plan is None or setup.autopilot.checks.dialect == "px4"
    findings = mission_findings(setup) if items_are_judged else []
    return [finding for finding in findings if finding.ok is False or undecided_findings([finding])]


def geometric_findings(
    requirements: RouteRequirements, flight_findings: Sequence[Finding] | None = None
) -> tuple[Finding, ...]:
    """Return the findings on a route's geometry, compared with the aircraft's envelope.

    flight_findings: findings on a flight of the route.  Findings of rules with `Rule.is_same_for_plan` are copied from
        them; None to run these rules, too.
    """
    return _run_rules(requirements, None, (), geometric=True, flight_findings=flight_findings)


def place_findings(requirements: RouteRequirements) -> tuple[Finding, ...]:
    """Return only those geometric findings that judge legs, corners, threats and zones, not the route as a whole."""
    return _run_rules(requirements, None, (), geometric=True, includes_whole_flight=False)


def track_findings(requirements: RouteRequirements, aligned: AlignedTrack | None) -> tuple[Finding, ...]:
    """Return the findings on a flown track, compared with its route and the aircraft's envelope.

    The end of the flight is not judged here; see `flown_findings`.
    """
    return (*blocking_item_findings(requirements.setup), *_run_rules(requirements, aligned, (), geometric=False))


def flown_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, end_reason: str, log_complete: bool
) -> tuple[Finding, ...]:
    """Return findings on the track of a flight and on how the flight ended.

    end_reason: "completed", or the reason why the flight ended early.
    log_complete: True if the log is not cut off.
    """
    end_judges = [rule.judge_end for rule in RULES.values() if rule.judge_end is not None]
    end_findings = tuple(
        finding for judge in end_judges for finding in judge(requirements, aligned, end_reason, log_complete)
    )
    return (
        *blocking_item_findings(requirements.setup),
        *_run_rules(requirements, aligned, end_findings, geometric=False),
    )


def _run_rules(
    requirements: RouteRequirements,
    aligned: AlignedTrack | None,
    end_findings: Sequence[Finding],
    *,
    geometric: bool,
    includes_whole_flight: bool = True,
    flight_findings: Sequence[Finding] | None = None,
) -> tuple[Finding, ...]:
    """Run all rules, add `end_findings`, and let the rules merge the findings.

    end_findings: findings on how the flight ended.
    includes_whole_flight: True to include rules that judge the whole flight, and to keep only the worst findings of
        each stop.
    flight_findings: as in `geometric_findings`.
    """

    def rule_findings(rule: Rule, judge: Judge) -> Sequence[Finding]:
        """Run one rule, or take its findings from the flight's findings if they are the same for the plan."""
        if rule.is_same_for_plan and flight_findings is not None:
            return [finding for finding in flight_findings if finding.rule == rule.name]
        return judge(requirements, aligned, geometric=geometric)

    findings: tuple[Finding, ...] = tuple(
        finding
        for rule in RULES.values()
        if rule.judge is not None and (includes_whole_flight or not rule.judges_whole_flight)
        for finding in rule_findings(rule, rule.judge)
    )
    findings = (*findings, *end_findings)
    for rule in RULES.values():
        if rule.merge is not None:
            findings = rule.merge(requirements, aligned, findings)
    if includes_whole_flight:
        findings = (*worst_finding_per_stop(findings), *_other_side_findings(requirements, findings))
    return findings


# Rules that judge the aircraft's position, which depends on the side to which it turns at a course reversal.
_POSITION_RULES = ("clearance", "threat", "fence")


def _other_side_findings(requirements: RouteRequirements, findings: Sequence[Finding]) -> list[Finding]:
    """Return undecided findings on places that fail only for one direction of a turn at a course reversal.

    A flight shows only one direction, which depends on its navigation error: of 12 ArduPlane flights through a turn of
    180 degrees, 4 turned left.  Return [] for an imported flight, and for a route without a course reversal.
    """
    setup = requirements.setup
    corners = reversals(setup.route)
    if setup.source is not None or not corners.size:
        return []
    failures_by_side = [
        {
            (finding.rule, finding.place): finding
            for name in _POSITION_RULES
            if (judge := RULES[name].judge) is not None
            for finding in judge(side_requirements, None, geometric=True)
            if finding.ok is False
        }
        for side_requirements in (route_requirements(setup), route_requirements(setup.with_long_reversals()))
    ]
    failed_keys = {(finding.rule, finding.place) for finding in findings if finding.ok is False}
    corners_text = ", ".join(place_text(requirements.waypoint(int(i))) for i in corners)
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
    """Keep each rule's worst finding on the corners of each stop, and its worst on the legs to the stop.

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


def with_suggestions(
    requirements: RouteRequirements, aligned: AlignedTrack | None, findings: Sequence[Finding]
) -> tuple[Finding, ...]:
    """Add ``suggestions`` to the failed or undecided findings that a change could fix.

    Findings on the legs of a return to launch get no suggestions, because the autopilot chooses the path of a return.
    If more than `MAX_SUGGESTED_FINDINGS` findings need suggestions, no finding gets any.
    """
    return_legs = {requirements.leg(i) for i in requirements.setup.route.rtl_legs}
    places = [
        k
        for k, finding in enumerate(findings)
        if (finding.ok is False or (finding.ok is None and finding.check == UNKNOWN_AIRCRAFT))
        and RULES[finding.rule].suggest is not None
        and finding.place not in return_legs
    ]
    results = list(findings)
    for k in places if len(places) <= MAX_SUGGESTED_FINDINGS else ():
        if (suggest := RULES[results[k].rule].suggest) is not None:
            results[k] = replace(results[k], suggestions=suggest(requirements, aligned, results[k]))
    return tuple(results)


def with_passing_suggestions(
    findings: tuple[Finding, ...], trials: Sequence[TriedSuggestions] | None
) -> tuple[Finding, ...]:
    """Remove the suggestions that passed no trial from failed findings.

    trials: suggestions that passed their trials; None to keep all suggestions.

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


# ----------------------------------------------------------------------
# The verdicts.


def judge_geometry(setup: FlightSetup, requirements: RouteRequirements | None = None) -> Verdict:
    """Judge a route by its geometry and the aircraft's envelope, without a flight, at the level "geometric".

    requirements: the setup's route requirements if already known.

    >>> from aircraft.catalog import find_aircraft
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from flight.mission.items import Mission, MissionItem
    >>> from flight.mission.route import make_route
    >>> from flight.simulation.setup import make_limits
    >>> from world.scenario import load_scenario
    >>> scenario, envelope = load_scenario("tight"), load_envelope(find_aircraft("aerosonde"))
    >>> way = [MissionItem(k, 16, 0, (0.0,) * 4, 46.0, 8.0 + 0.001 * k, 60.0 + 20.0 * k) for k in range(2)]
    >>> mission, limits = Mission(None, tuple(way)), make_limits(scenario, envelope, 25.0, 0.5)
    >>> route = make_route(mission, scenario.origin, scenario.terrain, 25.0, False, limits)
    >>> verdict = judge_geometry(FlightSetup(scenario, mission, route, limits, "aerosonde", 888.0, seed=1))
    >>> verdict.headline
    'not flyable: slope on leg 0, to item 1 (14.5° > 14.2°)'
    >>> [[change.what for change in one] for finding in verdict.findings for one in finding.suggestions]
    [['airspeed'], ['rise'], ['length']]
    """
    requirements = requirements or route_requirements(setup)
    findings = (
        *mission_findings(setup),
        *with_suggestions(requirements, None, geometric_findings(requirements)),
        *([_infeasible_finding(setup.plan)] if setup.plan is not None and setup.plan.failures else []),
    )
    complete = setup.plan is None or not setup.plan.failures
    unjudged, has_failed = undecided_text(findings), any(finding.ok is False for finding in findings)
    flyable = complete and not unjudged and not has_failed
    headline_text = headline(findings, flyable, setup_notes(setup, findings))
    levels = (LevelAnswer("geometry", flyable, headline_text, undecided=bool(unjudged) and not has_failed),)
    conditions = judging_conditions(setup)
    return Verdict(
        findings,
        flyable,
        complete,
        summary_lines(findings, setup, "geometric", levels, conditions),
        "geometric",
        levels,
        notes=setup.notes,
        unjudged=unjudged,
        conditions=conditions,
    )


def flown_level(setup: FlightSetup) -> LevelName:
    """Return the level at which a flight of a setup is judged."""
    return setup.autopilot.level


def judge_unflown(requirements: RouteRequirements, end_reason: str, *, log_complete: bool = True) -> Verdict:
    """Judge a flight without rows by its route's geometry; the verdict is never complete.

    end_reason: reason why nothing was flown.
    log_complete: True if the log is not cut off.

    >>> from logs.recording.example_log import example_log
    >>> verdict = judge_unflown(route_requirements(example_log().setup), "not started: no progress against the wind")
    >>> verdict.level, verdict.headline
    ('geometric', 'not flyable: completion (not started: no progress against the wind), ...')
    """
    setup = requirements.setup
    faults = [message(end_reason), *([] if log_complete else [message("the log is damaged or unfinished")])]
    end_finding = make_finding(
        "completion", FLIGHT, ok=False, reason=finding_reason(faults), faults=faults, method="nothing was flown"
    )
    route_findings = geometric_findings(requirements)
    passes = not any(finding.ok is False for finding in route_findings)
    findings = (*with_suggestions(requirements, None, route_findings), end_finding)
    notes = setup_notes(setup, findings)
    levels = (
        LevelAnswer("geometry", passes, headline(route_findings, passes, notes)),
        LevelAnswer(flown_level(setup), False, headline(findings, False, notes)),
    )
    conditions = judging_conditions(setup)
    lines = summary_lines(findings, setup, "geometric", levels, conditions)
    return Verdict(findings, False, False, lines, "geometric", levels, notes=setup.notes, conditions=conditions)


# Statements that a plan exceeds a limit, by rule.
_EXCEEDED_TEXTS = {
    "turn": "the plan turns too sharply",
    "slope": "the plan is too steep",
    "clearance": "the plan is too close to the ground",
    "bounds": "the plan leaves the area",
}


def judge_plan_only(plan: Plan, conditions: Conditions | None = None) -> Verdict:
    """Judge a search that found no feasible plan by the certificate of its best path.

    The verdict's level is "plan", and the verdict is never complete, because nothing was flown.

    conditions: conditions for which the plan was made.

    >>> import numpy as np
    >>> from planner.plan import Certificate
    >>> from world.scenario import load_scenario
    >>> certificate = Certificate(0.1, math.inf, -0.05, 12.0, 100.0, 50.0, ("leg 2: climbs 16.6 deg, allowed 13.7",))
    >>> way, none = np.zeros((2, 3)), np.zeros((0, 3))
    >>> plan = Plan(load_scenario("tight"), way, np.array([0, 2, 0, 0]), np.zeros(4), certificate, 1, "umda", 1, none)
    >>> print(judge_plan_only(plan).headline)
    not flyable: no feasible plan was found: slope (the plan is too steep: smallest margin -2.86 deg, 2 violations)
    """
    margins = (
        ("turn", plan.certificate.turn, Violation.TURN, "deg", 180.0 / math.pi),
        ("slope", plan.certificate.slope, Violation.SLOPE, "deg", 180.0 / math.pi),
        ("clearance", plan.certificate.clearance, Violation.TERRAIN, "m", 1.0),
        ("bounds", plan.certificate.bounds, Violation.BOUNDS, "m", 1.0),
    )
    findings = []
    for rule, margin, violation, unit, factor in margins:
        count = int(plan.violations[violation])
        missing_length = max(0.0, -plan.certificate.available_length) if rule == "turn" else 0.0
        is_exceeded = bool(count) or margin < 0.0 or missing_length > 0.0
        is_known = math.isfinite(margin)
        reason = f"smallest margin {margin * factor:.2f} {unit}" if is_known else "no margin is known"
        if missing_length > 0.0 and margin >= 0.0:
            reason = f"a leg is {missing_length:.0f} m too short for its turns"
        if is_exceeded:
            reason = f"{_EXCEEDED_TEXTS[rule]}: {reason}" + (f", {count} violations" if count else "")
        findings.append(
            make_finding(
                rule,
                PLAN,
                ok=False if is_exceeded else (True if is_known else None),
                reason=reason,
                source="plan",
                margin=margin * factor,
                unit=unit,
                method="certificate",
            )
        )
    findings.append(_infeasible_finding(plan))
    lines = _plan_lines(findings, plan, conditions)
    return Verdict(tuple(findings), False, False, lines, "plan", conditions=conditions)


def _infeasible_finding(plan: Plan) -> Finding:
    """Return the failed finding on a plan that is not feasible, with the problems of its certificate."""
    first_problem, *other_problems = plan.failures
    fault = message(
        f"no feasible plan was found: {first_problem}", "".join(f"; {problem}" for problem in other_problems)
    )
    return make_finding(
        "completion", PLAN, ok=False, reason=fault.text, faults=[fault], source="plan", method="certificate"
    )


def _plan_lines(findings: list[Finding], plan: Plan, conditions: Conditions | None) -> tuple[str, ...]:
    """Return the summary lines of a run without a feasible plan, the headline first."""
    failed = [finding for finding in findings if finding.ok is False and finding.rule != "completion"]
    headline_text, further_lines = headline(findings, False), []
    if failed:
        text = ", ".join(f"{finding.rule} ({finding.reason})" for finding in failed)
        headline_text = f"not flyable: no feasible plan was found: {text}"
        further_lines = ["Nothing was flown", *(f"Problem: {problem}" for problem in plan.certificate.problems)]
    condition_texts = (
        [] if conditions is None else [*condition_lines(conditions), autopilot_line(conditions, is_flown=False)]
    )
    return (headline_text, *condition_texts, *further_lines)
