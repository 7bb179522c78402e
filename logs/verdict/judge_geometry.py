"""Judge without a flight: a route, a flight that never began, or a plan that was not feasible."""

import math
from collections.abc import Sequence
from dataclasses import replace

from flight.guidance.path import reversals
from flight.simulation.setup import FlightSetup
from logs.verdict.conditions import Conditions, autopilot_line, condition_lines, setup_conditions
from logs.verdict.findings import (
    NOT_FLOWN,
    UNKNOWN_AIRCRAFT,
    Finding,
    badness,
    make_finding,
    message,
    reason_of,
    undecided_findings,
)
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT, PLAN, LevelAnswer, LevelName, TriedSuggestions
from logs.verdict.rule import Judge, Rule
from logs.verdict.rules.registry import RULES
from logs.verdict.summary import headline, summary_lines, undecided_text
from logs.verdict.verdict import Verdict
from logs.verdict.wording import place_text
from planner.plan import Plan, Violation

# ----------------------------------------------------------------------
# The findings of each level, rule by rule in the order of `RULES`.


def mission_findings(setup: FlightSetup) -> list[Finding]:
    """Return findings on the mission's items alone, for any autopilot."""
    return [item for rule in RULES.values() if rule.judge_items is not None for item in rule.judge_items(setup)]


def deciding_items(setup: FlightSetup) -> list[Finding]:
    """Return the findings on a mission's items alone that fail or leave the verdict undecided.

    Items of a plan come from planfly, so only PX4's requirements on them are judged.
    """
    asked = setup.plan is None or setup.autopilot.refuses
    found = mission_findings(setup) if asked else []
    return [item for item in found if item.ok is False or undecided_findings([item])]


def geometric_findings(requirements: RouteRequirements, flown: Sequence[Finding] | None = None) -> tuple[Finding, ...]:
    """Return findings on a route's geometry, judged by the aircraft's envelope.

    flown: findings on the route's flight, from which the findings of rules with `Rule.of_route` are copied.
    """
    return _run_rules(requirements, None, (), geometric=True, flown=flown)


def place_findings(requirements: RouteRequirements) -> tuple[Finding, ...]:
    """Return the findings of `geometric_findings` on legs, corners, threats or zones, without those on the whole."""
    return _run_rules(requirements, None, (), geometric=True, whole=False)


def track_findings(requirements: RouteRequirements, aligned: AlignedTrack | None) -> tuple[Finding, ...]:
    """Return findings on a flown track, judged by its route and the aircraft's envelope, except on how it ended."""
    return (*deciding_items(requirements.setup), *_run_rules(requirements, aligned, (), geometric=False))


def flown_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, ended: str, log_complete: bool
) -> tuple[Finding, ...]:
    """Return findings on the track of a flight and on how the flight ended.

    ended: "completed", or the reason why the flight ended early.
    log_complete: True if the record has its end.
    """
    ends = [rule.judge_end for rule in RULES.values() if rule.judge_end is not None]
    at_end = tuple(item for judge in ends for item in judge(requirements, aligned, ended, log_complete))
    return (*deciding_items(requirements.setup), *_run_rules(requirements, aligned, at_end, geometric=False))


def _run_rules(
    requirements: RouteRequirements,
    aligned: AlignedTrack | None,
    at_end: Sequence[Finding],
    *,
    geometric: bool,
    whole: bool = True,
    flown: Sequence[Finding] | None = None,
) -> tuple[Finding, ...]:
    """Run all rules and return their findings, followed by `at_end`, merged.

    at_end: findings on how the flight ended.
    whole: True to include rules that judge the flight as a whole.
    flown: as in `geometric_findings`.
    """

    def asked(rule: Rule, judge: Judge) -> Sequence[Finding]:
        if rule.of_route and flown is not None:
            return [item for item in flown if item.rule == rule.name]
        return judge(requirements, aligned, geometric=geometric)

    findings: tuple[Finding, ...] = tuple(
        item
        for rule in RULES.values()
        if rule.judge is not None and (whole or not rule.whole)
        for item in asked(rule, rule.judge)
    )
    findings = (*findings, *at_end)
    for rule in RULES.values():
        if rule.merge is not None:
            findings = rule.merge(requirements, aligned, findings)
    if whole:
        findings = (*one_per_stop(findings), *_other_side_findings(requirements, findings))
    return findings


# Rules that judge where the aircraft is, and so depend on the side to which it turns at a course reversal.
_RULES_OF_PLACE = ("clearance", "threat", "fence")


def _other_side_findings(requirements: RouteRequirements, findings: Sequence[Finding]) -> list[Finding]:
    """Return undecided findings on course reversals that fail if the aircraft turns to the other side.

    A flight shows only one side, which depends on the navigation error of the day: of 12 ArduPlane flights through a
    turn of 180 degrees, 4 turned left.
    """
    setup = requirements.setup
    corners = reversals(setup.route)
    if setup.source is not None or not corners.size:
        return []
    sides = [
        {
            (item.rule, item.place): item
            for name in _RULES_OF_PLACE
            if (judge := RULES[name].judge) is not None
            for item in judge(side, None, geometric=True)
            if item.ok is False
        }
        for side in (route_requirements(setup), route_requirements(setup.turned_to_other_side()))
    ]
    failed = {(item.rule, item.place) for item in findings if item.ok is False}
    where = ", ".join(place_text(requirements.waypoint(int(i))) for i in corners)
    out = []
    for key in (sides[0].keys() ^ sides[1].keys()) - failed:
        item = sides[0].get(key) or sides[1][key]
        brief = f"a reversal of the course at {where} may turn to either side, and one side fails"
        fault = message(brief, f": {item.reason}")
        out.append(make_finding(item.rule, item.place, ok=None, reason=fault.text, faults=[fault], check=NOT_FLOWN))
    return sorted(out, key=lambda item: (item.rule, str(item.place)))


def one_per_stop(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Keep only each rule's worst finding of those at the corners of one stop, and of those at its legs.

    >>> from logs.verdict.places import Place
    >>> legs = [Place("leg", k, to_item=4, number=2) for k in (2, 3, 4)]
    >>> margins = zip(legs, (9.0, 4.0, 7.0))
    >>> heights = [make_finding("clearance", leg, ok=True, reason="", margin=margin) for leg, margin in margins]
    >>> [item.place.index for item in one_per_stop(heights)]
    [3]
    """
    worst: dict[tuple[object, ...], Finding] = {}
    for k, item in enumerate(findings):
        place = item.place
        known = place.kind in ("leg", "waypoint") and place.number is not None
        key = (item.rule, item.check, place.kind, place.number, place.item, place.to_item) if known else (k,)
        if key not in worst or badness(item) < badness(worst[key]):
            worst[key] = item
    return tuple(worst.values())


def with_suggestions(
    requirements: RouteRequirements, aligned: AlignedTrack | None, findings: Sequence[Finding]
) -> tuple[Finding, ...]:
    """Return findings with ``suggestions`` for failed or undecided findings that a change of the plan could fix.

    Findings on the legs of a return to launch get none, because the autopilot chooses its path.
    """
    out, first = [], requirements.setup.route.return_from
    last = min(requirements.legs, requirements.setup.route.return_until)
    back = {requirements.leg(i) for i in range(first, last)} if first >= 0 else set()
    for item in findings:
        suggest = RULES[item.rule].suggest
        asked = item.ok is False or (item.ok is None and item.check == UNKNOWN_AIRCRAFT)
        if asked and suggest is not None and item.place not in back:
            item = replace(item, suggestions=suggest(requirements, aligned, item))
        out.append(item)
    return tuple(out)


def with_passing_suggestions(
    findings: tuple[Finding, ...], tried: Sequence[TriedSuggestions] | None
) -> tuple[Finding, ...]:
    """Replace the suggestions of failed findings by those that passed their trials; keep all if ``tried`` is None.

    >>> from logs.verdict.places import Change, Place
    >>> higher = ((Change("height", Place("leg", 2), None, 12.0, "m"),),)
    >>> low = [
    ...     replace(make_finding("clearance", Place("leg", k), ok=False, reason=""), suggestions=higher) for k in (1, 2)
    ... ]
    >>> passing = with_passing_suggestions(tuple(low), [TriedSuggestions("clearance", Place("leg", 2), higher)])
    >>> [bool(item.suggestions) for item in passing]
    [False, True]
    """
    if tried is None:
        return findings
    passed = {(one.rule, one.place): one.suggestions for one in tried}
    return tuple(
        replace(item, suggestions=passed.get((item.rule, item.place), ())) if item.ok is False else item
        for item in findings
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
        *([_infeasible_finding(setup.plan)] if setup.plan is not None and not setup.plan.feasible else []),
    )
    complete = setup.plan is None or setup.plan.feasible
    unjudged, fails = undecided_text(findings), any(item.ok is False for item in findings)
    flyable = complete and not unjudged and not fails
    said = headline(findings, flyable, setup.envelope.source)
    levels = (LevelAnswer("geometry", flyable, said, undecided=bool(unjudged) and not fails),)
    conditions = setup_conditions(setup)
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


def judge_unflown(requirements: RouteRequirements, ended: str, *, log_complete: bool = True) -> Verdict:
    """Judge a flight without rows by its route's geometry and the reason why nothing was flown; never complete.

    ended: reason why nothing was flown.
    log_complete: True if the record has its end.

    >>> from logs.recording.example_log import example_log
    >>> verdict = judge_unflown(route_requirements(example_log().setup), "not started: no way made against the wind")
    >>> verdict.level, verdict.headline
    ('geometric', 'not flyable: completion (not started: no way made against the wind), ...')
    """
    setup = requirements.setup
    faults = [message(ended), *([] if log_complete else [message("the log is damaged or unfinished")])]
    stopped = make_finding(
        "completion", FLIGHT, ok=False, reason=reason_of(faults), faults=faults, method="nothing was flown"
    )
    predicted = geometric_findings(requirements)
    passes = not any(item.ok is False for item in predicted)
    findings = (*with_suggestions(requirements, None, predicted), stopped)
    levels = (
        LevelAnswer("geometry", passes, headline(predicted, passes)),
        LevelAnswer(flown_level(setup), False, headline(findings, False)),
    )
    conditions = setup_conditions(setup)
    lines = summary_lines(findings, setup, "geometric", levels, conditions)
    return Verdict(findings, False, False, lines, "geometric", levels, notes=setup.notes, conditions=conditions)


def judge_plan_only(plan: Plan, conditions: Conditions | None = None) -> Verdict:
    """Judge a run that found no feasible plan, so that nothing was flown, at the level "plan"; never complete.

    conditions: conditions for which the plan was made.

    >>> import numpy as np
    >>> from planner.plan import Certificate
    >>> from world.scenario import load_scenario
    >>> certificate = Certificate(0.1, math.inf, -0.05, 12.0, 100.0, 50.0, ("leg 2: climbs 16.6 deg, allowed 13.7",))
    >>> way, none = np.zeros((2, 3)), np.zeros((0, 3))
    >>> plan = Plan(load_scenario("tight"), way, np.array([0, 2, 0, 0]), np.zeros(4), certificate, 1, "umda", 1, none)
    >>> print(judge_plan_only(plan).headline)
    not flyable: no feasible plan was found: slope (the plan's slope limit is exceeded, least margin -2.86 deg, ...)
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
        bad = bool(count) or margin < 0.0
        if rule == "turn":
            bad = bad or plan.certificate.available_length < 0.0
        known = math.isfinite(margin)
        reason = f"least margin {margin * factor:.2f} {unit}" if known else "no margin is known"
        if bad:
            reason = f"the plan's {rule} limit is exceeded, {reason}" + (f", {count} violations" if count else "")
        findings.append(
            make_finding(
                rule,
                PLAN,
                ok=False if bad else (True if known else None),
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
    problems = plan.certificate.problems or ("the search still counts violations",)
    first, *others = problems
    fault = message(f"no feasible plan was found: {first}", "".join(f"; {problem}" for problem in others))
    return make_finding(
        "completion", PLAN, ok=False, reason=fault.text, faults=[fault], source="plan", method="certificate"
    )


def _plan_lines(findings: list[Finding], plan: Plan, conditions: Conditions | None) -> tuple[str, ...]:
    failed = [item for item in findings if item.ok is False and item.rule != "completion"]
    first, more = headline(findings, False), []
    if failed:
        text = ", ".join(f"{item.rule} ({item.reason})" for item in failed)
        first = f"not flyable: no feasible plan was found: {text}"
        more = ["Nothing was flown", *(f"Problem: {problem}" for problem in plan.certificate.problems)]
    said = [] if conditions is None else [*condition_lines(conditions), autopilot_line(conditions, flown=False)]
    return (first, *said, *more)
