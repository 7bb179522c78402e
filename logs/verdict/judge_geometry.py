"""Verdicts without a flight: of a route's geometry, and of a plan that was not feasible."""

import math

from flight.simulation.flight_setup import FlightSetup
from logs.verdict.findings import Finding, Verdict, make_finding
from logs.verdict.measures.route_demands import RouteDemands, route_demands
from logs.verdict.rules.energy_rule import energy_findings
from logs.verdict.rules.flight_rules import speed_findings
from logs.verdict.rules.loiter_rule import fold_loiters
from logs.verdict.rules.px4_rule import mission_findings
from logs.verdict.rules.slope_rule import slope_findings
from logs.verdict.rules.turn_rule import turn_findings
from logs.verdict.rules.world_rules import bounds_findings, clearance_findings, threat_findings
from logs.verdict.suggestions import with_suggestions
from logs.verdict.summary import headline, summary_text
from planner.plan import Plan, Violation


def geometric_findings(shape: RouteDemands) -> tuple[Finding, ...]:
    """Findings of a route's geometry against the aircraft's envelope."""
    findings: tuple[Finding, ...] = (
        *turn_findings(shape, None, geometric=True),
        *slope_findings(shape, None, geometric=True),
        *clearance_findings(shape, None, geometric=True),
        *threat_findings(shape, None, geometric=True),
        *bounds_findings(shape, None, geometric=True),
        *speed_findings(shape, None, geometric=True),
        *energy_findings(shape, None, geometric=True),
    )
    return fold_loiters(shape, None, findings)


def judge_geometry(setup: FlightSetup) -> Verdict:
    """Judge a route by its geometry and the aircraft's envelope, without flying it: level "geometric"."""
    shape = route_demands(setup)
    findings = (
        *mission_findings(setup),
        *with_suggestions(shape, None, geometric_findings(shape)),
        *([_not_feasible(setup.plan)] if setup.plan is not None and not setup.plan.feasible else []),
    )
    complete = setup.plan is None or setup.plan.feasible
    flyable = complete and not any(item.ok is False for item in findings)
    return Verdict(findings, flyable, complete, summary_text(findings, flyable, setup, "geometric"), "geometric")


def judge_plan_only(plan: Plan) -> Verdict:
    """Judge a run that found no feasible plan, so that nothing was flown: never complete."""
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
                "plan",
                ok=False if bad else (True if known else None),
                reason=reason,
                source="plan",
                margin=margin * factor,
                unit=unit,
                method="certificate",
            )
        )
    findings.append(_not_feasible(plan))
    return Verdict(tuple(findings), False, False, _plan_summary(findings, plan), "plan")


def _not_feasible(plan: Plan) -> Finding:
    problems = "; ".join(plan.certificate.problems) or "the search still counts violations"
    return make_finding(
        "completion",
        "plan",
        ok=False,
        reason=f"no feasible plan was found: {problems}",
        source="plan",
        method="certificate",
    )


def _plan_summary(findings: list[Finding], plan: Plan) -> str:
    failed = [item for item in findings if item.ok is False and item.rule != "completion"]
    if not failed:
        return headline(findings, False)
    text = ", ".join(f"{item.rule} ({item.reason})" for item in failed)
    lines = [f"not flyable: no feasible plan was found: {text}", "Nothing was flown"]
    return "\n".join(lines + [f"Problem: {problem}" for problem in plan.certificate.problems])
