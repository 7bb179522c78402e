"""Explain the flight of an autopilot by reference flights.

They use planfly's guidance and other parameters.
"""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Literal

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import Autopilot
from flight.autopilots.parts import Candidate
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import (
    FULL_THROTTLE_TIME,
    GROUND_FOLLOWING_ERROR,
    LOWEST_POINT_ERROR,
    PITCH_LIMIT_TIME,
    Finding,
    undecided_findings,
)
from logs.verdict.judge_flight import with_reference
from logs.verdict.measures.route_requirements import RouteRequirements, true_airspeed_route
from logs.verdict.places import FLIGHT, AirframeAnswer, Change, DecidingParameter, ReferenceFlights
from logs.verdict.summary import most_urgent_failure
from logs.verdict.trials import least_change
from logs.verdict.verdict import Verdict
from planfly.workflow.mission_context import JudgedMission, MissionContext
from planfly.workflow.suggestion_trials import (
    ALTITUDE_ERROR_M,
    MAX_TRIED_LEGS,
    AbortCheck,
    PassedTrial,
    SuggestionTrials,
    Trial,
    TrialAborted,
    max_explaining_flights,
    never_abort,
    tried_suggestions,
)

# ----------------------------------------------------------------------
# Find the autopilot parameter that decides a failed flight, by flying again with one parameter changed at a time.


# Rules that an altitude error violates, not a cross-track error.
_VERTICAL_RULES = ("clearance", "height", "bounds", "slope", "energy", "stall", "speed")

# Number of flights of a usual search for the deciding parameter.
_MAX_PARAMETER_FLIGHTS = 20
# Function that flies with an autopilot and returns True if the flight passes.
PassesWithAutopilot = Callable[[Autopilot], bool]


def find_passing_parameter(
    autopilot: Autopilot,
    findings: tuple[Finding, ...],
    passes: PassesWithAutopilot,
    *,
    only_reached_limits: bool = False,
) -> DecidingParameter | None:
    """Find an autopilot parameter with which a failed flight passes.

    Also find the passing value nearest to its own value.

    The autopilot lists the parameters to try, the candidates.  Returns None if none of them makes the flight pass.

    findings: findings of the flight that failed.
    passes: function that flies with the given autopilot and returns True if the flight passes; called about 20 times.
    only_reached_limits: True to try only the limits of pitch and throttle that the flight reached.

    Candidates for the kind of the failure, vertical or lateral, are tried first.  Pitch limits are tried before the
    other vertical candidates, and only if the flight reached them.  The farthest value of each candidate is flown
    first, and the value halfway if that fails; if one passes, bisection finds the nearest passing value.  The returned
    value was flown and passed.

    >>> from flight.autopilots.arduplane.autopilot import ArduPlane
    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import Place
    >>> low = make_finding("clearance", Place("leg", 4), ok=False, reason="", flown=52.0, limit=60.0, margin=-8.0)
    >>> quick = lambda law: law.parameters.tecs_height_demand_time < 1.3
    >>> found = find_passing_parameter(ArduPlane(ArduPilotParameters.defaults()), (low,), quick)
    >>> found.name, found.current, found.passing
    ('TECS_HDEM_TCONST', 3.0, 1.2)
    """
    failed_finding = most_urgent_failure(findings)
    if failed_finding is None or autopilot.parameters is None or failed_finding.rule == "mission":
        # No flight parameter changes the rejection of a mission.
        return None
    values = {parameter.name: parameter.value for parameter in autopilot.parameters.values}
    deviations = autopilot.deviations
    vertical_candidates, lateral_candidates = deviations.altitude_candidates, deviations.track_candidates
    measured = {fact.what for finding in findings for fact in finding.facts}
    if only_reached_limits:
        throttle_parameter = autopilot.speeds.max_throttle_name.split(" ")[0] if FULL_THROTTLE_TIME in measured else ""
        vertical_candidates = tuple(one for one in vertical_candidates if one.name == throttle_parameter)
        lateral_candidates = ()
    if PITCH_LIMIT_TIME in measured:
        vertical_candidates = (*deviations.pitch_candidates, *vertical_candidates)
    candidates = (*lateral_candidates, *vertical_candidates)
    if failed_finding.rule in _VERTICAL_RULES:
        candidates = (*vertical_candidates, *lateral_candidates)
    for candidate in candidates:
        current = values[candidate.name]

        def passes_with_value(value: float, candidate: Candidate = candidate) -> bool:
            """Return True if the flight passes with this value of the candidate's parameters."""
            return passes(autopilot.with_parameters(**dict.fromkeys((candidate.name, *candidate.others), value)))

        # Do not suggest values below the documented range.
        start = max(current, candidate.least - candidate.step)
        passing_value = _nearest_passing_value(start, candidate.step, candidate.far, passes_with_value)
        if passing_value is not None:
            deviation = _deviation_at_failure(failed_finding, findings)
            return DecidingParameter(
                candidate.title,
                current,
                passing_value,
                candidate.unit,
                failed_finding.rule,
                failed_finding.place,
                deviation,
            )
    return None


def _nearest_passing_value(
    current: float, step: float, farthest: float, passes: Callable[[float], bool]
) -> float | None:
    """Return the passing value nearest to the current value.

    Return None if neither the farthest nor the middle value passes.

    Values are tried in steps from `current` to `farthest`.  The search begins at `farthest`; if this value fails, it
    begins halfway, because a parameter can also be changed too much.

    passes: function that flies with a value of the parameter and returns True if the flight passes.
    """
    step_count = int(abs(farthest - current) / step + 1e-6)
    sign = 1.0 if farthest > current else -1.0
    values = [round(current + sign * k * step, 6) for k in range(1, step_count + 1)]
    for count in dict.fromkeys((step_count, step_count // 2)):
        if count > 0 and passes(values[count - 1]):
            nearest_value = least_change(values[: count - 1], passes)
            return values[count - 1] if nearest_value is None else nearest_value
    return None


def _deviation_at_failure(failed_finding: Finding, findings: tuple[Finding, ...]) -> float | None:
    """Return the cross-track or altitude error at the place of the failure, m, or None if unknown.

    The result is also None for an altitude error in the other direction, which does not explain the failure: an
    aircraft that is too near to the ground may be above its leg.

    findings: all findings of the flight, whose facts state the errors.
    """
    place, rule = failed_finding.place, failed_finding.rule
    if rule == "corridor":
        return failed_finding.flown
    if place.kind != "leg" or rule not in ("clearance", "height"):
        return None
    names = (LOWEST_POINT_ERROR,) if rule == "clearance" else ("height error", GROUND_FOLLOWING_ERROR)
    source_rule = "clearance" if rule == "clearance" else "slope"
    errors = [
        fact.value
        for finding in findings
        for fact in finding.facts
        if (finding.rule, finding.place) == (source_rule, place) and fact.what in names
    ]
    is_explained = bool(errors) and (errors[0] < 0.0 if rule == "clearance" else errors[0] > 0.0)
    return errors[0] if is_explained else None


def judge_airframe_flight(
    setup: FlightSetup, aircraft: Aircraft, should_abort: AbortCheck = never_abort
) -> AirframeAnswer:
    """Fly a setup with planfly's guidance and no navigation error.

    This shows if the airframe can fly the mission.

    The flight has the same true airspeeds as a flight by ArduPlane.  ArduPlane treats airspeeds as equivalent
    airspeeds, which are higher true airspeeds at a higher altitude.
    should_abort: called throughout the flight; once it returns True, the flight is aborted with TrialAborted.
    """
    airframe_route = true_airspeed_route(setup)
    trial = Trial(
        replace(setup, autopilot=PlanflyGuidance(), nav="perfect", route=airframe_route), aircraft, should_abort
    )
    track, end_reason = trial.flight
    if not len(track):
        return AirframeAnswer(False, f"not flyable: {end_reason}", (("completion", FLIGHT),))
    verdict = trial.flight_verdict
    failed_places = tuple((finding.rule, finding.place) for finding in verdict.findings if finding.ok is False)
    # Undecided findings on take-off and landing do not apply to this flight.
    answer = "flyable in the air" if verdict.flies and not verdict.flyable else verdict.headline
    return AirframeAnswer(verdict.flies, answer, failed_places)


def find_deciding_parameter(
    setup: FlightSetup, aircraft: Aircraft, verdict: Verdict, should_abort: AbortCheck = never_abort
) -> DecidingParameter | None:
    """Find an autopilot parameter that makes a failed flight pass if it has another value.

    Return None if none is found.

    The result is also None for a flight that passes, and for an autopilot without parameters.

    verdict: verdict on the flight with the setup's own parameters.
    should_abort: called throughout the flights; once it returns True, they are aborted with TrialAborted.

    This takes up to about twenty flights with the simulated autopilot.  If the flight is too long for so many, only the
    limits of pitch and throttle that it reached are tried, with about five flights each.  For the flight of an
    autopilot program, the result is None unless the simulated autopilot fails, too.

    Findings that are undecided at all values, such as slopes of an uncertain aircraft, do not prevent a value from
    passing.
    """
    if setup.autopilot.parameters is None or not verdict.failed:
        return None
    findings = verdict.findings
    if setup.autopilot.program is not None:
        simulated_verdict = Trial(
            replace(setup, autopilot=setup.autopilot.model), aircraft, should_abort
        ).flight_verdict
        if not simulated_verdict.failed:
            return None
        findings = simulated_verdict.findings
    # A tried acceptance radius would also change the width of the corridor: keep the width of the failed flight.  A
    # stated width replaces that of all legs, also of legs that are wider because of a loiter: it is stated only then.
    scenario = setup.scenario
    limits = scenario.limits.model_copy(update={"corridor_m": setup.corridor})
    spec = scenario.spec.model_copy(update={"limits": limits})
    same_setup = setup.in_scenario(replace(scenario, spec=spec, limits=limits))

    def passes(autopilot: Autopilot) -> bool:
        """Return True if a flight with the parameters of an autopilot fails no rule, with margin, to its end."""
        trial_setup = replace(setup, autopilot=autopilot)
        if trial_setup.corridor != setup.corridor:
            trial_setup = replace(same_setup, autopilot=autopilot)
        trial_verdict = Trial(trial_setup, aircraft, should_abort).flight_verdict
        has_passed = trial_verdict.complete and not trial_verdict.failed
        return has_passed and passes_with_margin(trial_verdict.findings, findings)

    is_long = max_explaining_flights(setup) < _MAX_PARAMETER_FLIGHTS
    return find_passing_parameter(setup.autopilot, findings, passes, only_reached_limits=is_long)


# Cross-track error of the simulated autopilot compared with the real one, as a fraction of the distance from the legs.
# Nine in ten corners that ArduPlane flew within the corridor are within this error.
CROSS_TRACK_ERROR_FRACTION = 0.1


def passes_with_margin(trial_findings: Sequence[Finding], failed_findings: Sequence[Finding]) -> bool:
    """Return True if no failed finding fails or is undecided in a trial.

    The margin that simulation errors need is kept.

    trial_findings: findings of a flight with another parameter value.
    failed_findings: findings of the flight that failed.
    Margins are required for the lateral distance from the legs and for the height above ground.
    """
    failed_keys = {(finding.rule, finding.place) for finding in failed_findings if finding.ok is False}
    undecided_keys = {(finding.rule, finding.place) for finding in undecided_findings(failed_findings)}
    for finding in trial_findings:
        key = finding.rule, finding.place
        if key in failed_keys - undecided_keys and finding.state == "open":
            return False
        if key not in failed_keys or finding.margin is None:
            continue
        required_margins = {
            "corridor": CROSS_TRACK_ERROR_FRACTION * abs(finding.flown or 0.0),
            "clearance": ALTITUDE_ERROR_M,
            "height": ALTITUDE_ERROR_M,
        }
        if finding.margin < required_margins.get(finding.rule, -math.inf):
            return False
    return True


def _suggested_parameter(verdict: Verdict, passed_trials: Sequence[PassedTrial]) -> DecidingParameter | None:
    """Return the parameter that a passed suggestion changes, if it changes nothing else; otherwise None.

    Such a parameter acts on the failing leg, so it is better advice than a parameter found by other flights.  The
    verdict must have exactly one failed finding.
    """
    if len(verdict.failed) != 1:
        return None
    finding = verdict.failed[0]
    for trial in passed_trials:
        match trial.suggestion:
            case (Change(what="parameter", current=float(current)) as change,):
                values = (current, change.wanted, change.unit)
                return DecidingParameter(change.parameter, *values, finding.rule, finding.place)
    return None


# Cases in which reference flights are flown: "failed" if a finding of the flight fails, "always" also if all pass.
FlyReference = Literal["never", "failed", "always"]


def explain_verdict(
    requirements: RouteRequirements,
    aircraft: Aircraft,
    verdict: Verdict,
    *,
    is_requested: bool = False,
    should_abort: AbortCheck = never_abort,
) -> tuple[Verdict, ReferenceFlights | None]:
    """Explain the verdict on a flight by reference flights, and try its suggestions.

    The reference flights do not change the verdict's answer.

    requirements: the route requirements of the flown setup.
    is_requested: True to fly the reference flight regardless of its length.  Otherwise there is none for a flight that
        is too long for `max_explaining_flights`, or has more than `MAX_TRIED_LEGS` legs.
        A flight by planfly's own guidance never has a reference flight, but its suggestions are tried.
    should_abort: called throughout the reference flights; once it returns True, they are aborted, and the verdict
    contains the results up to that moment.
    """
    setup = requirements.setup
    reference = ReferenceFlights(tried=() if verdict.failed else None)
    with suppress(TrialAborted):
        # If only the autopilot's return fails, a flight with planfly's guidance explains nothing: it never returns.
        is_only_return = bool(verdict.failed) and all(finding.rule == "return" for finding in verdict.failed)
        is_affordable = is_requested or (max_explaining_flights(setup) > 1 and requirements.legs <= MAX_TRIED_LEGS)
        if setup.autopilot.answer_name != "airframe" and not is_only_return and is_affordable:
            reference = replace(reference, airframe=judge_airframe_flight(setup, aircraft, should_abort))
        passed_trials: list[PassedTrial] = []
        if verdict.failed:
            judged_mission = JudgedMission(setup.mission, setup, requirements, verdict)
            passed_trials = SuggestionTrials(
                MissionContext.from_setup(setup), judged_mission, should_abort
            ).find_passing()
            reference = replace(reference, tried=tried_suggestions(passed_trials))
        # The flight of an aircraft with uncertain limits is undecided, but it fails nothing.
        if reference.airframe is not None and not reference.airframe.failed:
            deciding = _suggested_parameter(verdict, passed_trials)
            deciding = deciding or find_deciding_parameter(setup, aircraft, verdict, should_abort)
            reference = replace(reference, deciding=deciding)
    if reference == ReferenceFlights():
        return verdict, None
    return with_reference(verdict, requirements, reference), reference
