"""Is this flight evidence that its plan is flyable?  Every number is worked out again from the track.

What guidance noted about itself (leg, cross-track, height error, clearance) and any verdict that was recorded are
not read.
"""

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.findings import Finding, Prediction, Verdict
from logs.verdict.judge_geometry import geometric_findings, judge_geometry, judge_plan_only, judge_unflown
from logs.verdict.measures.route_demands import RouteDemands, route_demands
from logs.verdict.measures.track_alignment import lay_track
from logs.verdict.places import Disagreement
from logs.verdict.rules.bounds_rule import bounds_findings
from logs.verdict.rules.clearance_rule import clearance_findings
from logs.verdict.rules.completion_rule import completion_findings
from logs.verdict.rules.corridor_rule import corridor_findings
from logs.verdict.rules.departure_rule import departure_findings
from logs.verdict.rules.energy_rule import energy_findings
from logs.verdict.rules.loiter_rule import fold_loiters
from logs.verdict.rules.slope_rule import slope_findings
from logs.verdict.rules.speed_rule import speed_findings
from logs.verdict.rules.stall_rule import stall_findings
from logs.verdict.rules.takeoff_landing_rule import takeoff_landing_findings
from logs.verdict.rules.threat_rule import threat_findings
from logs.verdict.rules.turn_rule import turn_findings
from logs.verdict.rules.waypoint_rule import waypoint_findings
from logs.verdict.suggestions import with_suggestions
from logs.verdict.summary import headline, summary_lines

__all__ = ["judge_flight", "judge_geometry", "judge_plan_only"]


def judge_flight(setup: FlightSetup, track: Track, ended: str, *, whole: bool = True, envelope: bool = True) -> Verdict:
    """Judge a flown track: level "flown".

    Any track is judged, however short or damaged: what cannot be known makes it incomplete.  One without a row is a
    flight that never began: its route is judged, level "geometric".

    ended: how the flight ended, "completed" or what stopped it.
    whole: the record has its end.
    envelope: whether the aircraft's envelope counts beside what the flight showed; False judges by flown evidence and
    the scenario's numbers alone.

    >>> from aircraft.catalog import find_aircraft
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from flight.mission.items import Mission, MissionItem
    >>> from flight.mission.routing import make_route
    >>> from flight.simulation.flight_setup import make_limits
    >>> from flight.simulation.simulate import simulate
    >>> from world.scenario import load_scenario
    >>> scenario, aerosonde = load_scenario("tight"), find_aircraft("aerosonde")
    >>> way = [MissionItem(k, 16, 0, (0.0,) * 4, 46.0, 8.0 + 0.01 * k, 75.0) for k in range(2)]
    >>> mission, limits = Mission(None, tuple(way)), make_limits(scenario, load_envelope(aerosonde), 25.0, 0.5)
    >>> route = make_route(mission, scenario.origin, scenario.terrain, 25.0, False, limits)
    >>> setup = FlightSetup(scenario, mission, "", route, limits, "aerosonde", 888.0, seed=1)
    >>> flown = simulate(setup, aerosonde)
    >>> verdict = judge_flight(setup, flown.track, flown.ended)
    >>> verdict.headline
    'flyable'
    """
    demands = route_demands(setup, envelope=envelope)
    if not len(track):
        return judge_unflown(demands, ended, whole=whole)
    aligned = lay_track(demands, track)
    findings: tuple[Finding, ...] = (
        *turn_findings(demands, aligned),
        *slope_findings(demands, aligned),
        *clearance_findings(demands, aligned),
        *threat_findings(demands, aligned),
        *bounds_findings(demands, aligned),
        *waypoint_findings(demands, aligned),
        *corridor_findings(demands, aligned),
        *speed_findings(demands, aligned),
        *(stall_findings(demands, aligned) if envelope else ()),
        *takeoff_landing_findings(demands),
        *energy_findings(demands, aligned),
        *departure_findings(demands, aligned),
        *completion_findings(demands, aligned, ended, whole),
    )
    findings = fold_loiters(demands, aligned, findings)
    complete = all(item.ok is True for item in findings if item.rule == "completion")
    flyable = complete and not any(item.ok is False for item in findings)
    findings = with_suggestions(demands, aligned, findings)
    prediction = _predict(demands, findings) if envelope else None
    lines = summary_lines(findings, flyable, setup, "flown", prediction)
    ends = () if aligned is None else aligned.leg_ends()
    return Verdict(findings, flyable, complete, lines, "flown", prediction, setup.route.notes, ends, setup.program)


def _predict(demands: RouteDemands, flown: tuple[Finding, ...]) -> Prediction:
    """What the geometric level says, and where it and the flight differ."""
    predicted = geometric_findings(demands)
    judged = {(item.rule, item.place): item.ok for item in flown}
    disagreements = []
    for item in predicted:
        other = judged.get((item.rule, item.place))
        if item.ok is not None and other is not None and item.ok != other:
            disagreements.append(Disagreement(item.rule, item.place, item.ok, other))
    flyable = not any(item.ok is False for item in predicted)
    return Prediction(flyable, headline(predicted, flyable), tuple(disagreements))
