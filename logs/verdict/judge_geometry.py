"""Verdicts without a flight: of a route, of a flight that never began, and of a plan that was not feasible."""

import math

from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding, Verdict, make_finding, message, reason_of
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT, PLAN, LevelAnswer, LevelName
from logs.verdict.rules.bounds_rule import bounds_findings
from logs.verdict.rules.clearance_rule import clearance_findings
from logs.verdict.rules.completion_rule import completion_findings
from logs.verdict.rules.corridor_rule import corridor_findings
from logs.verdict.rules.departure_rule import departure_findings
from logs.verdict.rules.energy_rule import energy_findings
from logs.verdict.rules.fence_rule import fence_findings
from logs.verdict.rules.height_rule import height_findings
from logs.verdict.rules.loiter_rule import fold_loiters
from logs.verdict.rules.px4_rule import mission_findings
from logs.verdict.rules.slope_rule import slope_findings
from logs.verdict.rules.speed_rule import speed_findings
from logs.verdict.rules.stall_rule import stall_findings
from logs.verdict.rules.takeoff_landing_rule import takeoff_landing_findings
from logs.verdict.rules.threat_rule import threat_findings
from logs.verdict.rules.turn_rule import turn_findings
from logs.verdict.rules.waypoint_rule import waypoint_findings
from logs.verdict.suggestions import with_suggestions
from logs.verdict.summary import headline, summary_lines
from planner.plan import Plan, Violation


def geometric_findings(requirements: RouteRequirements) -> tuple[Finding, ...]:
    """Findings of a route's geometry against the aircraft's envelope."""
    findings: tuple[Finding, ...] = (
        *turn_findings(requirements, None, geometric=True),
        *slope_findings(requirements, None, geometric=True),
        *clearance_findings(requirements, None, geometric=True),
        *height_findings(requirements, None, geometric=True),
        *fence_findings(requirements, None, geometric=True),
        *threat_findings(requirements, None, geometric=True),
        *bounds_findings(requirements, None, geometric=True),
        *waypoint_findings(requirements, None, geometric=True),
        *corridor_findings(requirements, None, geometric=True),
        *speed_findings(requirements, None, geometric=True),
        *stall_findings(requirements, None, geometric=True),
        *takeoff_landing_findings(requirements),
        *energy_findings(requirements, None, geometric=True),
    )
    return fold_loiters(requirements, None, findings)


def judge_geometry(setup: FlightSetup) -> Verdict:
    """Judge a route by its geometry and the aircraft's envelope, without flying it: level "geometric".

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
    >>> verdict = judge_geometry(FlightSetup(scenario, mission, "", route, limits, "aerosonde", 888.0, seed=1))
    >>> verdict.headline
    'not flyable: slope on leg 0, to item 1 (14.5° > 14.2°)'
    >>> [[change.what for change in one] for finding in verdict.findings for one in finding.suggestions]
    [['airspeed'], ['rise'], ['length']]
    """
    requirements = route_requirements(setup)
    findings = (
        *mission_findings(setup),
        *with_suggestions(requirements, None, geometric_findings(requirements)),
        *([_not_feasible(setup.plan)] if setup.plan is not None and not setup.plan.feasible else []),
    )
    complete = setup.plan is None or setup.plan.feasible
    flyable = complete and not any(item.ok is False for item in findings)
    levels = (LevelAnswer("geometry", flyable, headline(findings, flyable)),)
    lines = summary_lines(findings, setup, "geometric", levels)
    return Verdict(findings, flyable, complete, lines, "geometric", levels, notes=setup.route.notes)


def unflyable_items(setup: FlightSetup) -> list[Finding]:
    """What fails of a person's mission by its items alone, whoever flies it; a plan's own are ours."""
    return [item for item in mission_findings(setup) if item.ok is False] if setup.plan is None else []


def flown_level(setup: FlightSetup) -> LevelName:
    """The level that a flight of a setup answers."""
    return setup.autopilot.level


def judge_unflown(requirements: RouteRequirements, ended: str, *, whole: bool = True) -> Verdict:
    """Judge a flight of which there is no row: its route's geometry, and why nothing was flown; never complete.

    ended: why not.  whole: the record has its end.

    >>> from logs.recording.example_log import example_log
    >>> verdict = judge_unflown(route_requirements(example_log().setup), "not started: no way made against the wind")
    >>> verdict.level, verdict.headline
    ('geometric', 'not flyable: completion (not started: no way made against the wind), ...')
    """
    setup = requirements.setup
    faults = [message(ended), *([] if whole else [message("the log is damaged or unfinished")])]
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
    lines = summary_lines(findings, setup, "geometric", levels)
    return Verdict(findings, False, False, lines, "geometric", levels, notes=setup.route.notes)


def judge_plan_only(plan: Plan) -> Verdict:
    """Judge a run that found no feasible plan, so that nothing was flown: level "plan", never complete.

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
    findings.append(_not_feasible(plan))
    return Verdict(tuple(findings), False, False, _plan_lines(findings, plan), "plan")


def _not_feasible(plan: Plan) -> Finding:
    problems = plan.certificate.problems or ("the search still counts violations",)
    first, *others = problems
    fault = message(f"no feasible plan was found: {first}", "".join(f"; {problem}" for problem in others))
    return make_finding(
        "completion", PLAN, ok=False, reason=fault.text, faults=[fault], source="plan", method="certificate"
    )


def _plan_lines(findings: list[Finding], plan: Plan) -> tuple[str, ...]:
    failed = [item for item in findings if item.ok is False and item.rule != "completion"]
    if not failed:
        return (headline(findings, False),)
    text = ", ".join(f"{item.rule} ({item.reason})" for item in failed)
    problems = (f"Problem: {problem}" for problem in plan.certificate.problems)
    return (f"not flyable: no feasible plan was found: {text}", "Nothing was flown", *problems)


# ----------------------------------------------------------------------
# All findings of a flown track, rule by rule, in the verdict's order.


def flown_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, ended: str, whole: bool, envelope: bool
) -> tuple[Finding, ...]:
    """Findings of a flight against its route and the aircraft's envelope, in the verdict's order."""
    findings = (
        *unflyable_items(requirements.setup),
        *turn_findings(requirements, aligned),
        *slope_findings(requirements, aligned),
        *clearance_findings(requirements, aligned),
        *height_findings(requirements, aligned),
        *fence_findings(requirements, aligned),
        *threat_findings(requirements, aligned),
        *bounds_findings(requirements, aligned),
        *waypoint_findings(requirements, aligned),
        *corridor_findings(requirements, aligned),
        *speed_findings(requirements, aligned),
        *(stall_findings(requirements, aligned) if envelope else ()),
        *takeoff_landing_findings(requirements),
        *energy_findings(requirements, aligned),
        *departure_findings(requirements, aligned),
        *completion_findings(requirements, aligned, ended, whole),
    )
    return fold_loiters(requirements, aligned, findings)
