"""Check: is this flight evidence that its plan is flyable?  Every number is worked out again from the track.

What guidance noted about itself (leg, cross-track, height error, clearance) and any verdict that was recorded are
not read.
"""

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.findings import Finding, Prediction, Verdict
from logs.verdict.judge_geometry import geometric_findings, judge_geometry, judge_plan_only
from logs.verdict.measures.route_demands import RouteDemands, route_demands
from logs.verdict.measures.track_alignment import lay_track
from logs.verdict.rules.energy_rule import energy_findings
from logs.verdict.rules.flight_rules import (
    completion_findings,
    departure_findings,
    speed_findings,
    waypoint_findings,
)
from logs.verdict.rules.loiter_rule import fold_loiters
from logs.verdict.rules.slope_rule import slope_findings
from logs.verdict.rules.turn_rule import turn_findings
from logs.verdict.rules.world_rules import bounds_findings, clearance_findings, threat_findings
from logs.verdict.suggestions import with_suggestions
from logs.verdict.summary import headline, summary_text

__all__ = ["judge_flight", "judge_geometry", "judge_plan_only"]


def judge_flight(setup: FlightSetup, track: Track, ended: str, *, whole: bool = True, envelope: bool = True) -> Verdict:
    """Judge a flown track: level "flown".

    ended: how the flight ended, "completed" or what stopped it.  whole: the record has its end.  envelope: whether
    the aircraft's envelope counts beside what the flight showed; False judges by flown evidence and the scenario's
    numbers alone.  Any track is judged, however short or damaged: what cannot be known makes it incomplete.
    """
    shape = route_demands(setup, envelope=envelope)
    flown = lay_track(shape, track)
    findings: tuple[Finding, ...] = (
        *turn_findings(shape, flown),
        *slope_findings(shape, flown),
        *clearance_findings(shape, flown),
        *threat_findings(shape, flown),
        *bounds_findings(shape, flown),
        *waypoint_findings(shape, flown),
        *speed_findings(shape, flown),
        *energy_findings(shape, flown),
        *departure_findings(shape, flown),
        *completion_findings(shape, flown, ended, whole),
    )
    findings = fold_loiters(shape, flown, findings)
    complete = all(item.ok is True for item in findings if item.rule == "completion")
    flyable = complete and not any(item.ok is False for item in findings)
    findings = with_suggestions(shape, flown, findings)
    prediction = _predict(shape, findings) if envelope else None
    summary = summary_text(findings, flyable, setup, "flown", prediction)
    return Verdict(findings, flyable, complete, summary, "flown", prediction)


def _predict(shape: RouteDemands, flown: tuple[Finding, ...]) -> Prediction:
    """What the geometric level says, and where it and the flight differ."""
    predicted = geometric_findings(shape)
    judged = {(item.rule, item.where): item.ok for item in flown}
    words = {True: "passes", False: "fails"}
    disagreements = []
    for item in predicted:
        other = judged.get((item.rule, item.where))
        if item.ok is not None and other is not None and item.ok != other:
            disagreements.append(
                f"{item.rule} at {item.where} {words[item.ok]} by geometry and {words[other]} in flight"
            )
    flyable = not any(item.ok is False for item in predicted)
    return Prediction(flyable, headline(predicted, flyable), tuple(disagreements))
