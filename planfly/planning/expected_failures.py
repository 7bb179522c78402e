"""Find out without a flight why a safe plan is expected to fail in dispersed flights.

A failure of more than one flight in twenty is reported.

A safe plan meets the limits of its scenario in the wind of the scenario and over the heights of its map.  Two causes of
failures can be found from the plan alone: limits that are looser than the limits of the aircraft or its autopilot, and
a strip that is too short for the uncertainty of its altitude.  `planfly.campaigns.landing_trial` flies the landings of
steep finals.  Other causes can only be found by flights of the whole plan (`planfly plan --flights N`).
"""

import math
from dataclasses import replace

from logs.verdict.tolerances import TOUCHDOWN_ERROR_M
from planfly.workflow.uav import Uav
from planner.evaluation.certify import certify
from planner.evaluation.problem import make_problem
from planner.plan import Plan
from planner.search.lay_ground_ways import MAP_HEIGHT_SD_M
from world.wind import W20

# Fraction of the dispersed flights that a plan should pass.
HOLDING_PROBABILITY = 0.95
# Standard deviation of the touchdown point along the strip in light turbulence, with GNSS errors and a surveyed
# altitude, m.  It is the largest of ten plans of four aircraft, with 24 flights each (16 to 66 m), and is assumed to
# grow with the gusts.
_TOUCHDOWN_SD_IN_LIGHT_TURBULENCE_M = 66.0
# The same standard deviation without turbulence, m: 5 touchdowns of ArduPlane in steady wind were within 15 m of the
# simulated touchdowns.
_TOUCHDOWN_SD_IN_CALM_AIR_M = 8.0
# Number of standard deviations from the mean within which 95 % of normally distributed values are.
_SIGMAS_OF_95_PERCENT = 1.96
# Suggested strip lengths are multiples of this length, m.
_STRIP_STEP_M = 10.0


def expected_failures(plan: Plan, uav: Uav) -> tuple[str, ...]:
    """Return the reasons to expect that flights of a safe plan fail, each with a remedy.

    The result is empty for a plan that is not safe, and if no reason is known.

    >>> from planfly.workflow.uav import load_uav
    >>> from planner.search.plan_path import plan_path
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> uav = load_uav(scenario)
    >>> expected_failures(plan_path(scenario, uav.limits, seed=1), uav)[0][:57]
    'flights are expected to fail: the limits of the scenario '
    """
    if not plan.safe:
        return ()
    return tuple(text for text in (_loose_limits_text(plan, uav), _short_strip_text(plan)) if text)


def _loose_limits_text(plan: Plan, uav: Uav) -> str:
    """Return a warning if a plan has a turn or slope that the aircraft or its autopilot cannot fly.

    Return "" otherwise.

    The plan can have such a turn or slope only because of numbers in [limits].  The aircraft limits turns and slopes.
    The autopilot limits slopes by its climb and sink rates, of which a plan uses only a part: a steeper flight passes
    in some gusts and fails in others.  The text names the first part of the plan that exceeds a limit.
    """
    limits = uav.limits
    slope_limits = replace(limits, max_climb=None, max_dive=None)
    aircraft_limits = replace(slope_limits, max_turn=None, tracking=None)
    if slope_limits == limits and limits.max_turn is None:
        return ""
    for other_limits, claim, owner in (
        (aircraft_limits, "flights are expected to fail", "the aircraft"),
        (slope_limits, "flights may fail", uav.autopilot.title),
    ):
        certificate = certify(make_problem(plan.scenario, other_limits), plan.waypoints)
        # Turns, lengths and slopes are the certificate's first problems.  Others may arise from the autopilot's
        # deviations, for which a plan of some algorithms keeps no margin.
        if min(certificate.turn, certificate.available_length, certificate.slope) < 0.0:
            return (
                f"{claim}: the limits of the scenario are looser than the limits of {owner}"
                f". The first problem is {certificate.problems[0]}."
                ' To plan within both, write "aircraft" instead of the numbers in [limits]'
            )
    return ""


def _short_strip_text(plan: Plan) -> str:
    """Return a text if the strip is too short for the expected touchdowns, with remedies; "" otherwise.

    It is also "" if the plan does not land on a strip.
    """
    strip, descent = (
        plan.scenario.landing,
        None if plan.procedures is None else plan.procedures.descent,
    )
    if strip is None or descent is None:
        return ""
    max_touchdown_error, turbulence = 0.5 * strip.length - TOUCHDOWN_ERROR_M, plan.scenario.wind.turbulence
    height_sd = MAP_HEIGHT_SD_M if strip.height_sd is None else strip.height_sd
    flight_sd = max(_TOUCHDOWN_SD_IN_CALM_AIR_M, _TOUCHDOWN_SD_IN_LIGHT_TURBULENCE_M * W20[turbulence] / W20["light"])
    touchdown_sd = math.hypot(height_sd / descent.slope, flight_sd)
    probability = math.erf(max(0.0, max_touchdown_error) / (math.sqrt(2.0) * touchdown_sd))
    if probability >= HOLDING_PROBABILITY:
        return ""
    remedies = [f"use a strip of {_sufficient_strip_length(touchdown_sd):.0f} m"]
    if strip.height_sd is None:
        surveyed_length = _sufficient_strip_length(flight_sd)
        remedies.insert(
            0, f"survey its altitude and state [landing] height_sd_m (then {surveyed_length:.0f} m are enough)"
        )
    if turbulence != "none":
        remedies.append("fly in less turbulence")
    source = "the elevation file" if strip.height_sd is None else "its survey"
    return (
        f"only {100.0 * probability:.0f} % of the landings are expected to touch down on the strip of"
        f" {strip.length:.0f} m. The standard deviation of the strip's altitude is {height_sd:.1f} m ({source})."
        f" With the largest scatter of measured landings, the standard deviation of the touchdown point along the strip"
        f" is {touchdown_sd:.0f} m."
        f" To improve this, {', or '.join(remedies)}"
    )


def _sufficient_strip_length(touchdown_sd: float) -> float:
    """Return the length of a strip on which 95 % of the landings touch down, m, rounded up.

    touchdown_sd: standard deviation of the touchdown along the strip, m.
    """
    length = 2.0 * (TOUCHDOWN_ERROR_M + _SIGMAS_OF_95_PERCENT * touchdown_sd)
    return _STRIP_STEP_M * math.ceil(length / _STRIP_STEP_M)
