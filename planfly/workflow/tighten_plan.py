"""Tighten the limits of a scenario after the failures of a flight, for the next round of planning.

The tightened limits apply to planning only.  Each round is judged against the original scenario.
"""

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from logs.verdict.findings import Finding
from logs.verdict.tolerances import ROUNDING_M, SUGGESTION_LENGTH_MARGIN_M
from logs.verdict.verdict import Verdict
from logs.verdict.wording import threat_text
from planfly.workflow.uav import load_uav
from planner.evaluation.problem import CERTIFIED_ZONE_MARGIN_M
from world.scenario import Scenario, scenario_from_spec

# Content of a scenario file.
Spec = dict[str, Any]

# Margin added to the shortfall of clearance in a flight, m.
CLEARANCE_BUFFER_M = 5.0
# Margin added to the depth to which a flight entered a missile's sphere, m.
MISSILE_BUFFER_M = 10.0
# Margin added to the distance by which a flight violated a zone, m.
ZONE_BUFFER_M = 5.0
# Factor on a limit that is already the limit of the aircraft, if the flight fails nevertheless.
TIGHTENING_FACTOR = 0.9
# Minimum bank to which a plan is tightened, degrees.
MIN_BANK_DEG = 5.0
# Remark on a round that is followed by another.
NEXT_ROUND_REMARK = "tightened and planned again"

# Keys of the scenario's numbers that can be tightened.
TightenedKey = Literal[
    "max_climb_deg",
    "max_dive_deg",
    "max_turn_deg",
    "max_bank_deg",
    "min_clearance_m",
    "max_height_m",
    "kill_radius_m",
    "zone_margin_m",
]


@dataclass(frozen=True, slots=True)
class Tightening:
    """Change of one number in the scenario used for planning.

    what: key of the number.
    current, wanted: old and new value, in the unit of the key, or "aircraft" for the limit of the aircraft.
    name: the threat to which the number belongs, or "" if it belongs to the scenario itself.
    """

    what: TightenedKey
    current: float | str
    wanted: float | str
    name: str = ""


def tightening_text(change: Tightening) -> str:
    """Return a text on one tightening, as in ``rounds.json`` and on the terminal.

    >>> tightening_text(Tightening("min_clearance_m", 60.0, 72.5))
    'limits.min_clearance_m: 60 to 72.5'
    """
    match change.what:
        case "max_bank_deg":
            return f"flight.max_bank_deg (of the plan): {change.current:g} to {change.wanted:g}"
        case "kill_radius_m":
            return f"kill radius of {change.name}: {change.current:g} to {change.wanted:g} m"
        case "min_clearance_m" | "max_height_m":
            return f"limits.{change.what}: {change.current:g} to {change.wanted:g}"
        case "zone_margin_m":
            return f"planner.zone_margin_m: {change.current:g} to {change.wanted:g}"
    return f"limits.{change.what}: {change.current} to {change.wanted}"


def tighten_limits(scenario: Scenario, verdict: Verdict) -> tuple[Scenario, list[Tightening]]:
    """Return the scenario for the next round of planning, and the list of its changes.

    It is tightened after failures.

    verdict: verdict on the flight of the last round.
    If nothing can be tightened, the scenario is returned unchanged and the list is empty.
    """
    spec = copy.deepcopy(scenario.to_json())
    failed_findings = [finding for finding in verdict.findings if finding.ok is False]
    changes = _tighten_slopes(spec, failed_findings) + _tighten_turns(spec, scenario, failed_findings)
    if not changes:
        # These limits are tightened only if the flight followed slopes and turns.  A flight that cannot follow its plan
        # is also too low or too close, which is not a separate cause.
        # By how much the flight exceeded each limit, by rule; without zones that the plan itself violates.
        limits, excesses = scenario.limits, dict[str, list[float]]()
        for finding in failed_findings:
            is_planned = finding.rule == "fence" and (finding.planned or 0.0) > ROUNDING_M
            if finding.margin is not None and not is_planned:
                excesses.setdefault(finding.rule, []).append(-finding.margin)
        if "clearance" in excesses:
            min_clearance = round(limits.min_clearance_m + max(0.0, *excesses["clearance"]) + CLEARANCE_BUFFER_M, 1)
            _limits_table(spec)["min_clearance_m"] = min_clearance
            changes.append(Tightening("min_clearance_m", limits.min_clearance_m, min_clearance))
        changes += _enlarge_missile_spheres(spec, failed_findings)
        if limits.max_height_m is not None and "height" in excesses:
            max_height = round(limits.max_height_m - max(0.0, *excesses["height"]) - CLEARANCE_BUFFER_M, 1)
            if max_height > float(_limits_table(spec).get("min_clearance_m", limits.min_clearance_m)):
                _limits_table(spec)["max_height_m"] = max_height
                changes.append(Tightening("max_height_m", limits.max_height_m, max_height))
        if "fence" in excesses:
            stated_margin = scenario.planner.zone_margin_m
            current_margin = CERTIFIED_ZONE_MARGIN_M if stated_margin is None else stated_margin
            zone_margin = round(current_margin + max(excesses["fence"]) + ZONE_BUFFER_M, 1)
            spec.setdefault("planner", {})["zone_margin_m"] = zone_margin
            changes.append(Tightening("zone_margin_m", current_margin, zone_margin))
    if not changes:
        return scenario, []
    return scenario_from_spec(spec, scenario.name, ground=scenario.terrain), changes


def _limits_table(spec: Spec) -> Spec:
    """Return the [limits] table of a scenario's content; add an empty one if it is missing."""
    return spec.setdefault("limits", {})


def _tighten_slopes(spec: Spec, failed_findings: list[Finding]) -> list[Tightening]:
    """Tighten the climb and descent limits in `spec` if slopes failed; return the changes.

    The new limit is less than the flattest failed slope.

    A limit of the scenario that exceeds the limit of the aircraft is first replaced by "aircraft".
    """
    changes = []
    keys: tuple[tuple[TightenedKey, float], ...] = (("max_climb_deg", 1.0), ("max_dive_deg", -1.0))
    for key, sign in keys:
        planned_angles = [
            sign * finding.planned
            for finding in failed_findings
            if finding.rule == "slope" and finding.planned is not None
        ]
        steep_angles = [angle for angle in planned_angles if angle > 0.0]
        if not steep_angles:
            continue
        current = _limits_table(spec).get(key, "aircraft")
        exceeds_aircraft = any(
            finding.limit_source == "aircraft" and finding.margin and finding.margin < 0.0
            for finding in failed_findings
        )
        tightened: float | str = "aircraft"
        if current == "aircraft" or not exceeds_aircraft:
            tightened = round(
                TIGHTENING_FACTOR * min([*steep_angles, *([current] if isinstance(current, float) else [])]), 2
            )
        _limits_table(spec)[key] = tightened
        changes.append(Tightening(key, current, tightened))
    return changes


def _tighten_turns(spec: Spec, scenario: Scenario, failed_findings: list[Finding]) -> list[Tightening]:
    """Tighten the turns in `spec` if turns, waypoints or the corridor failed; return the changes.

    A limit that the scenario states is replaced by the limit of the aircraft.  If the limit is already the aircraft's,
    the bank limit is lowered, but not below `MIN_BANK_DEG`.
    """
    if not any(finding.rule in ("turn", "waypoint", "corridor") for finding in failed_findings):
        return []
    current = _limits_table(spec).get("max_turn_deg", "aircraft")
    if current != "aircraft":
        _limits_table(spec)["max_turn_deg"] = "aircraft"
        return [Tightening("max_turn_deg", current, "aircraft")]
    # A lower bank limit makes the planned arcs larger; the flight keeps its maximum bank.
    bank = math.degrees(load_uav(scenario).max_bank)
    tightened = round(TIGHTENING_FACTOR * bank, 2)
    if tightened < MIN_BANK_DEG:
        return []
    spec.setdefault("flight", {})["max_bank_deg"] = tightened
    return [Tightening("max_bank_deg", bank, tightened)]


def _enlarge_missile_spheres(spec: Spec, failed_findings: list[Finding]) -> list[Tightening]:
    """Enlarge the kill radii in `spec` of missiles that the flight, but not the plan, came too close to.

    Return the changes.  Failed findings without a nearest missile are ignored.
    """
    changes = []
    for finding in failed_findings:
        if finding.planned:
            # The plan itself enters the sphere, because the planner found no path outside it.  It would find none
            # outside a larger sphere either.
            continue
        # The nearest distance is negative inside the sphere.
        depth = None if finding.nearest_distance is None else -finding.nearest_distance
        if depth is None:
            continue
        threat = spec["threats"][finding.place.index]
        current = threat["kill_radius_m"]
        threat["kill_radius_m"] = current + round(depth + SUGGESTION_LENGTH_MARGIN_M) + MISSILE_BUFFER_M
        changes.append(Tightening("kill_radius_m", current, threat["kill_radius_m"], threat_text(finding.place)))
    return changes


# Changes and results of each round.
Rounds = list[dict[str, Any]]
# Function that plans and flies one round in a scenario; it returns the verdict, and True if the plan was flown.
FlyRound = Callable[[Scenario], tuple[Verdict, bool]]


def refine(
    scenario: Scenario, max_rounds: int, fly_round: FlyRound, keep_results: Callable[[int], None]
) -> tuple[Verdict, Rounds]:
    """Plan and fly in rounds.

    The last round is flyable, has no limit that can be tightened, or is number `max_rounds`.

    Each further round tightens the limits that the last flight violated.

    max_rounds: maximum number of rounds after the first.
    fly_round: function that plans in a scenario and flies; it returns the verdict, and True if the plan was flown.
    keep_results: function called with a round's number before the next round replaces its results.

    Returns the last verdict, and the changes and results of each round in the format of ``rounds.json``.
    """
    rounds: Rounds = []
    planning_scenario, changes = scenario, list[Tightening]()
    for number in range(max_rounds + 1):
        verdict, was_flown = fly_round(planning_scenario)
        rounds.append(
            {
                "round": number,
                "changes": [tightening_text(change) for change in changes],
                "flown": was_flown,
                "flyable": verdict.flyable,
                "summary": verdict.headline,
                "next": "",
            }
        )
        planning_scenario, changes = tighten_limits(planning_scenario, verdict)
        rounds[-1]["next"] = _next_step_remark(verdict, was_flown, number == max_rounds, changes)
        if rounds[-1]["next"] != NEXT_ROUND_REMARK:
            break
        keep_results(number)
    return verdict, rounds


def _next_step_remark(verdict: Verdict, was_flown: bool, is_last: bool, changes: list[Tightening]) -> str:
    """Return the remark on the step after a round: `NEXT_ROUND_REMARK` or the reason to end.

    verdict, was_flown: verdict on the round's plan, and True if the plan was flown.
    is_last: True if no further round is allowed.
    changes: limits that were tightened after the round.
    """
    if verdict.flyable:
        return "done: the plan is flyable"
    if verdict.undecided:
        return "ended: no rule failed, but the aircraft is not known well enough to judge all findings"
    if not was_flown:
        return "ended: no feasible plan was found within the tightened limits"
    if not changes:
        return "ended: no limit can be tightened further, and the planner finds no path that meets the failed rules"
    return "ended: no rounds left" if is_last else NEXT_ROUND_REMARK
