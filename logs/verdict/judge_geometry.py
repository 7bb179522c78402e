"""Judge without a flight.

This covers a route by its geometry, a flight that never began, and a plan that is not feasible.
"""

import math

from flight.simulation.setup import FlightSetup
from logs.verdict.conditions import Conditions, autopilot_line, condition_lines, judging_conditions
from logs.verdict.findings import (
    Finding,
    finding_reason,
    make_finding,
    message,
)
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.places import FLIGHT, PLAN, LevelAnswer
from logs.verdict.rules.mission_rule import mission_findings
from logs.verdict.rules.registry import run_rules
from logs.verdict.summary import headline, setup_notes, summary_lines, undecided_text
from logs.verdict.verdict import Verdict
from planner.plan import Plan, Violation
from world.wording import count_text


def judge_geometry(setup: FlightSetup, requirements: RouteRequirements | None = None) -> Verdict:
    """Judge a planned route by its geometry and the aircraft's envelope: the level "geometric".

    requirements: the setup's route requirements if already known.

    >>> from aircraft.catalog import find_aircraft
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from flight.mission.items import Mission, MissionItem
    >>> from flight.mission.route import make_route
    >>> from flight.simulation.setup import make_limits
    >>> from world.scenario import load_scenario
    >>> scenario, envelope = load_scenario("tight"), load_envelope(find_aircraft("aerosonde"))
    >>> items = [MissionItem(k, 16, 0, (0.0,) * 4, 46.0, 8.0 + 0.001 * k, 60.0 + 20.0 * k) for k in range(2)]
    >>> mission, limits = Mission(None, tuple(items)), make_limits(scenario, envelope, 25.0, 0.5)
    >>> route = make_route(mission, scenario.origin, scenario.terrain, 25.0, False, limits)
    >>> setup = FlightSetup(scenario, mission, route, limits, "aerosonde", battery=888.0, seed=1)
    >>> verdict = judge_geometry(setup)
    >>> verdict.headline
    'not flyable: slope on leg 0, to item 1 (14.5° > 14.2°)'
    >>> suggestions = [suggestion for finding in verdict.findings for suggestion in finding.suggestions]
    >>> [[change.what for change in suggestion] for suggestion in suggestions]
    [['airspeed'], ['rise'], ['length']]
    """
    requirements = requirements or route_requirements(setup)
    findings = (
        *mission_findings(setup),
        *run_rules(requirements, None, geometric=True, suggests=True),
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


def judge_unflown(requirements: RouteRequirements, end_reason: str, *, log_complete: bool = True) -> Verdict:
    """Judge a flight whose track has no rows by its route's geometry; the verdict is never complete.

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
    route_findings = run_rules(requirements, None, geometric=True, suggests=True)
    passes = not any(finding.ok is False for finding in route_findings)
    findings = (*route_findings, end_finding)
    notes = setup_notes(setup, findings)
    levels = (
        LevelAnswer("geometry", passes, headline(route_findings, passes, notes)),
        LevelAnswer(
            setup.autopilot.answer_name, flyable=False, headline=headline(findings, flyable=False, setup_notes=notes)
        ),
    )
    conditions = judging_conditions(setup)
    lines = summary_lines(findings, setup, "geometric", levels, conditions)
    return Verdict(
        findings,
        flyable=False,
        complete=False,
        lines=lines,
        level="geometric",
        levels=levels,
        notes=setup.notes,
        conditions=conditions,
    )


# Statements that a plan exceeds a limit, by rule.
_EXCEEDED_TEXTS = {
    "turn": "the plan turns too sharply",
    "slope": "the plan is too steep",
    "clearance": "the plan is too close to the ground",
    "bounds": "the plan leaves the area",
}


def judge_plan_only(plan: Plan, conditions: Conditions | None = None) -> Verdict:
    """Judge an infeasible plan by the margins in the certificate of the best path that the search found.

    The verdict's level is "plan", and the verdict is never complete, because nothing was flown.

    conditions: conditions for which the plan was made.

    >>> import numpy as np
    >>> from planner.plan import Certificate
    >>> from world.scenario import load_scenario
    >>> problems = ("leg 2: climbs at 16.6°; at most 13.7° are allowed",)
    >>> certificate = Certificate(0.1, math.inf, -0.05, 12.0, 100.0, 50.0, problems)
    >>> way, none = np.zeros((2, 3)), np.zeros((0, 3))
    >>> plan = Plan(load_scenario("tight"), way, np.array([0, 2, 0, 0]), np.zeros(4), certificate, 1, "umda", 1, none)
    >>> print(judge_plan_only(plan).headline)
    not flyable: no feasible plan was found: slope (the plan is too steep; smallest margin -2.86 deg, 2 violations)
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
            reason = f"{_EXCEEDED_TEXTS[rule]}; {reason}" + (f", {count_text(count, 'violation')}" if count else "")
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
    failed = [finding for finding in findings if finding.ok is False and finding.rule != "completion"]
    headline_text, further_lines = headline(findings, flyable=False), []
    if failed:
        text = ", ".join(f"{finding.rule} ({finding.reason})" for finding in failed)
        headline_text = f"not flyable: no feasible plan was found: {text}"
        further_lines = ["Nothing was flown", *(f"Problem: {problem}" for problem in plan.certificate.problems)]
    condition_texts = (
        [] if conditions is None else [*condition_lines(conditions), autopilot_line(conditions, is_flown=False)]
    )
    lines = (headline_text, *condition_texts, *further_lines)
    return Verdict(tuple(findings), flyable=False, complete=False, lines=lines, level="plan", conditions=conditions)


def _infeasible_finding(plan: Plan) -> Finding:
    """Return a failed completion finding, whose reason lists the failures of an infeasible plan."""
    first_problem, *other_problems = plan.failures
    fault = message(
        f"no feasible plan was found: {first_problem}", "".join(f"; {problem}" for problem in other_problems)
    )
    return make_finding(
        "completion", PLAN, ok=False, reason=fault.text, faults=[fault], source="plan", method="certificate"
    )
