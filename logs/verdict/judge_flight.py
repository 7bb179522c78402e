"""Judge whether a flight shows that its plan is flyable.

Every number is computed again from the track.

Data that guidance recorded about itself (leg, cross-track, height error, clearance) and any recorded verdict are not
read.
"""

from collections.abc import Sequence
from dataclasses import replace

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.conditions import judging_conditions
from logs.verdict.findings import Finding, undecided_findings, worst_first_key
from logs.verdict.imported.judge_imported_flight import judge_imported_flight
from logs.verdict.judge_geometry import judge_geometry, judge_plan_only, judge_unflown
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.measures.track_alignment import flown_phases, leg_ends
from logs.verdict.places import Disagreement, LevelAnswer, ReferenceFlights, numbered_place
from logs.verdict.rule_words import FRONT_OVERLAP, GROUND_RULES, SIDE_OVERLAP
from logs.verdict.rules.registry import run_rules, with_passing_suggestions
from logs.verdict.summary import failed_at_take_off, headline, setup_notes, summary_lines, undecided_text
from logs.verdict.verdict import Verdict
from logs.verdict.wording import FLOWN_COUNTERPARTS

__all__ = ["judge_flight", "judge_geometry", "judge_plan_only"]


def judge_flight(
    setup: FlightSetup,
    track: Track,
    end_reason: str,
    *,
    log_complete: bool = True,
    envelope: bool = True,
    reference: ReferenceFlights | None = None,
    requirements: RouteRequirements | None = None,
    findings_only: bool = False,
) -> Verdict:
    """Judge a flown track, and return its verdict at the level "flown".

    Any track is judged, even a short or damaged one; missing data makes the verdict incomplete.  A track without rows
    means that the flight never began.  The planned path is then judged instead, at the level "geometric".  An
    imported flight is judged by `logs.verdict.imported.judge_imported_flight.judge_imported_flight`.

    end_reason: "completed", or the reason why the flight ended early.
    log_complete: True if the log is not cut off.
    envelope: True to judge by the aircraft's envelope and by the flight, False to judge by the flight alone.
    reference: results of reference flights.
    requirements: the setup's route requirements if already known.
    findings_only: True to omit suggestions, summary lines and the geometric answer, which a campaign's table does not
        need.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> judge_flight(log.setup, log.track, "completed").headline
    'not flyable: missile Alfa (13.3 s inside its range)'
    """
    if setup.imported_log is not None:
        return judge_imported_flight(setup, track, log_complete=log_complete)
    whole_requirements = requirements or route_requirements(setup, envelope=envelope)
    if not len(track):
        return judge_unflown(whole_requirements, end_reason, log_complete=log_complete)
    air_requirements, aligned = flown_phases(whole_requirements, track)
    findings = run_rules(
        air_requirements, aligned, end_reason=end_reason, log_complete=log_complete, suggests=not findings_only
    )
    complete = all(finding.ok is True for finding in findings if finding.rule == "completion")
    unjudged = undecided_text(findings)
    flyable = complete and not unjudged and not _has_failed(findings)
    if findings_only:
        return Verdict(findings, flyable, complete, (), "flown", unjudged=unjudged)
    notes, levels = setup_notes(setup, findings), list[LevelAnswer]()
    if whole_requirements.envelope:
        # The answer by geometry alone, without the flight.
        route_findings = run_rules(whole_requirements, None, geometric=True, flight_findings=findings)
        has_failed, is_open = _has_failed(route_findings), bool(undecided_findings(route_findings))
        passes = not has_failed and not is_open
        disagreements = _disagreements("geometry", route_findings, findings)
        route_headline = headline(route_findings, passes, notes)
        levels.append(
            LevelAnswer("geometry", passes, route_headline, disagreements, undecided=is_open and not has_failed)
        )
    is_undecided = bool(undecided_findings(findings)) and not _has_failed(findings)
    own_headline = headline(findings, flyable, notes)
    levels.append(LevelAnswer(setup.autopilot.answer_name, flyable, own_headline, undecided=is_undecided))
    conditions = judging_conditions(setup)
    verdict = Verdict(
        findings,
        flyable,
        complete,
        summary_lines(findings, setup, "flown", levels, conditions),
        "flown",
        tuple(levels),
        notes=setup.notes,
        leg_ends=() if aligned is None else leg_ends(air_requirements, aligned),
        program=setup.autopilot.program,
        parameters=setup.autopilot.parameters,
        unjudged=unjudged,
        conditions=conditions,
    )
    return verdict if reference is None else with_reference(verdict, whole_requirements, reference)


def with_reference(verdict: Verdict, requirements: RouteRequirements, reference: ReferenceFlights) -> Verdict:
    """Add the results of reference flights to a verdict, and rewrite its summary.

    The results are the airframe's answer, the suggestions that passed their trials, and, unless the verdict is
    flyable, the deciding parameter.  A verdict on a flight that never began is returned unchanged.
    """
    if verdict.level != "flown":
        return verdict
    setup = requirements.setup
    findings = with_passing_suggestions(verdict.findings, reference.tried)
    *other_levels, own_level = verdict.levels
    airframe = reference.airframe
    if requirements.envelope and airframe is not None:
        # A flight that failed at take-off is not compared, because the reference flight begins in the air.
        is_compared = not failed_at_take_off(findings)
        failed = {(rule, numbered_place(place)) for rule, place in airframe.failed}
        airframe_findings = [
            replace(finding, ok=(finding.rule, numbered_place(finding.place)) not in failed)
            for finding in findings
            if is_compared and finding.rule not in GROUND_RULES
        ]
        disagreements = _disagreements("airframe", airframe_findings, findings)
        # If the answer is not "flyable" although no finding failed, the airframe's flight was undecided.
        is_undecided = not airframe.flyable and not airframe.failed
        other_levels.append(
            LevelAnswer("airframe", airframe.flyable, airframe.headline, disagreements, undecided=is_undecided)
        )
    levels = (*other_levels, own_level)
    deciding = None if verdict.flyable else reference.deciding
    lines = summary_lines(findings, setup, "flown", levels, judging_conditions(setup), deciding)
    return replace(verdict, findings=findings, lines=lines, levels=levels, deciding=deciding)


def _has_failed(findings: Sequence[Finding]) -> bool:
    """Return True if any finding has failed."""
    return any(finding.ok is False for finding in findings)


def _disagreements(
    level: str, level_findings: Sequence[Finding], flight_findings: Sequence[Finding]
) -> tuple[Disagreement, ...]:
    """Return the rules and places that another level and the flight judge differently.

    They are in the order of `level_findings`.  A rule that judges no flight is compared with its counterpart in
    `FLOWN_COUNTERPARTS`.

    level: name of the level, such as "geometric" for the planned path.
    """
    level_outcomes, flight_outcomes = _worst_outcomes(level_findings), _worst_outcomes(flight_findings)
    flown_by_rule = {outcome.rule: outcome for outcome in flight_outcomes.values()}
    disagreements = []
    for key, level_finding in level_outcomes.items():
        flight_finding = flight_outcomes.get(key) or flown_by_rule.get(FLOWN_COUNTERPARTS.get(level_finding.rule, ""))
        if flight_finding is not None and level_finding.ok != flight_finding.ok:
            disagreements.append(
                Disagreement(
                    level_finding.rule, level_finding.place, level, bool(level_finding.ok), bool(flight_finding.ok)
                )
            )
    return tuple(disagreements)


def _worst_outcomes(findings: Sequence[Finding]) -> dict[tuple[object, ...], Finding]:
    """Return each rule's worst judged finding at each place; the keys are the same at all levels.

    The corners of one loiter share a key, because levels may differ in which corner is the worst.  For the same reason
    all front overlaps share a key, and all side overlaps.
    """
    outcomes: dict[tuple[object, ...], Finding] = {}
    for finding in findings:
        if finding.ok is None:
            continue
        is_overlap = finding.check in (FRONT_OVERLAP, SIDE_OVERLAP)
        key = finding.rule, finding.check if is_overlap else numbered_place(finding.place)
        if key not in outcomes or worst_first_key(finding) < worst_first_key(outcomes[key]):
            outcomes[key] = finding
    return outcomes
