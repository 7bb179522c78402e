"""Tighten the limits of a scenario by the failures of a flight, for the next round of planning.

The tightened limits apply to planning only.  Each round is judged against the original scenario.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from logs.verdict.findings import Finding
from logs.verdict.tolerances import ROUNDING_M, SUGGESTION_LENGTH_MARGIN_M
from logs.verdict.verdict import Verdict
from logs.verdict.wording import threat_text
from planner.evaluation.problem import CERTIFIED_ZONE_MARGIN
from world.scenario import Scenario, from_spec

# Content of a scenario file.
Spec = dict[str, Any]

# Margin added to the shortfall of clearance in a flight, m.
CLEARANCE_BUFFER = 5.0
# Margin added to the depth to which a flight entered a missile's sphere, m.
MISSILE_BUFFER = 10.0
# Margin added to the distance by which a flight violated a zone, m.
ZONE_BUFFER = 5.0
# Factor on a limit that is already the limit of the aircraft, if the flight fails nevertheless.
TIGHTENED_SHARE = 0.9
# Minimum bank to which a plan is tightened, degrees.
MIN_BANK_DEG = 5.0
# Remark on a round that is followed by another.
GO_ON = "tightened and planned again"

# Keys of the scenario's numbers that can be tightened.
Tightened = Literal[
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

    what: Tightened
    current: float | str
    wanted: float | str
    name: str = ""


def tightening_text(change: Tightening) -> str:
    """Describe one tightening, as in ``rounds.json`` and on the terminal.

    >>> tightening_text(Tightening("min_clearance_m", 60.0, 72.5))
    'limits.min_clearance_m: 60 to 72.5'
    """
    match change.what:
        case "max_bank_deg":
            return f"flight.max_bank_deg (of the plan): {change.current:g} to {change.wanted:g}"
        case "kill_radius_m":
            return f"kill radius of {change.name}: {change.current:g} to {change.wanted:g}"
        case "min_clearance_m" | "max_height_m":
            return f"limits.{change.what}: {change.current:g} to {change.wanted:g}"
        case "zone_margin_m":
            return f"planner.zone_margin_m: {change.current:g} to {change.wanted:g}"
    return f"limits.{change.what}: {change.current} to {change.wanted}"


def tighten_limits(scenario: Scenario, verdict: Verdict) -> tuple[Scenario, list[Tightening]]:
    """Return the scenario for the next round of planning, and its changes; empty if nothing can be tightened."""
    spec = copy.deepcopy(scenario.to_json())
    failed = [item for item in verdict.findings if item.ok is False]
    changes = _tighten_slopes(spec, failed) + _tighten_turns(spec, scenario, failed)
    if not changes:
        # These limits are tightened only if the flight followed slopes and turns.  A flight that cannot follow its plan
        # is also too low or too close, which is not a separate cause.
        changes = _raise_clearance(spec, scenario, failed) + _enlarge_missiles(spec, failed)
        changes += _lower_max_height(spec, scenario, failed) + _widen_zone_margin(spec, scenario, failed)
    if not changes:
        return scenario, []
    return from_spec(spec, scenario.name, ground=scenario.terrain), changes


def _limits_table(spec: Spec) -> Spec:
    return spec.setdefault("limits", {})


def _tighten_slopes(spec: Spec, failed: list[Finding]) -> list[Tightening]:
    changes = []
    keys: tuple[tuple[Tightened, float], ...] = (("max_climb_deg", 1.0), ("max_dive_deg", -1.0))
    for key, sign in keys:
        mine = [sign * item.planned for item in failed if item.rule == "slope" and item.planned is not None]
        steep = [angle for angle in mine if angle > 0.0]
        if not steep:
            continue
        now = _limits_table(spec).get(key, "aircraft")
        by_aircraft = any(item.limit_source == "aircraft" and item.margin and item.margin < 0.0 for item in failed)
        tighter: float | str = "aircraft"
        if now == "aircraft" or not by_aircraft:
            tighter = round(TIGHTENED_SHARE * min([*steep, *([now] if isinstance(now, float) else [])]), 2)
        _limits_table(spec)[key] = tighter
        changes.append(Tightening(key, now, tighter))
    return changes


def _tighten_turns(spec: Spec, scenario: Scenario, failed: list[Finding]) -> list[Tightening]:
    if not any(item.rule in ("turn", "waypoint", "corridor") for item in failed):
        return []
    now = _limits_table(spec).get("max_turn_deg", "aircraft")
    if now != "aircraft":
        _limits_table(spec)["max_turn_deg"] = "aircraft"
        return [Tightening("max_turn_deg", now, "aircraft")]
    # Plan with larger arcs; the flight keeps its maximum bank.
    bank = scenario.flight.max_bank_deg
    tighter = round(TIGHTENED_SHARE * bank, 2)
    if tighter < MIN_BANK_DEG:
        return []
    spec.setdefault("flight", {})["max_bank_deg"] = tighter
    return [Tightening("max_bank_deg", bank, tighter)]


def _raise_clearance(spec: Spec, scenario: Scenario, failed: list[Finding]) -> list[Tightening]:
    short = [-item.margin for item in failed if item.rule == "clearance" and item.margin is not None]
    if not short:
        return []
    now = scenario.limits.min_clearance_m
    tighter = round(now + max(0.0, *short) + CLEARANCE_BUFFER, 1)
    _limits_table(spec)["min_clearance_m"] = tighter
    return [Tightening("min_clearance_m", now, tighter)]


def _lower_max_height(spec: Spec, scenario: Scenario, failed: list[Finding]) -> list[Tightening]:
    """Lower the maximum height above ground in `spec` if the flight exceeded it and can fly lower."""
    now = scenario.limits.max_height_m
    over = [-item.margin for item in failed if item.rule == "height" and item.margin is not None]
    if now is None or not over:
        return []
    tighter = round(now - max(0.0, *over) - CLEARANCE_BUFFER, 1)
    if tighter <= float(_limits_table(spec).get("min_clearance_m", scenario.limits.min_clearance_m)):
        return []
    _limits_table(spec)["max_height_m"] = tighter
    return [Tightening("max_height_m", now, tighter)]


def _widen_zone_margin(spec: Spec, scenario: Scenario, failed: list[Finding]) -> list[Tightening]:
    """Widen the margin around zones in `spec` if the flight violated a zone and the plan itself did not."""
    mine = [item for item in failed if item.rule == "fence" and not (item.planned or 0.0) > ROUNDING_M]
    deep = [-item.margin for item in mine if item.margin is not None]
    if not deep:
        return []
    asked = scenario.planner.zone_margin_m
    now = CERTIFIED_ZONE_MARGIN if asked is None else asked
    tighter = round(now + max(deep) + ZONE_BUFFER, 1)
    spec.setdefault("planner", {})["zone_margin_m"] = tighter
    return [Tightening("zone_margin_m", now, tighter)]


def _enlarge_missiles(spec: Spec, failed: list[Finding]) -> list[Tightening]:
    changes = []
    for item in failed:
        if item.planned:
            # The plan itself enters the sphere, because the planner found no path outside.  It would find none outside
            # a larger sphere either.
            continue
        depth = next((-fact.value for fact in item.facts if fact.what == "nearest"), None)
        if depth is None:
            continue
        threat = spec["threats"][item.place.index]
        now = threat["kill_radius_m"]
        threat["kill_radius_m"] = now + round(depth + SUGGESTION_LENGTH_MARGIN_M) + MISSILE_BUFFER
        changes.append(Tightening("kill_radius_m", now, threat["kill_radius_m"], threat_text(item.place)))
    return changes


# Changes and results of each round.
Rounds = list[dict[str, Any]]
# Function that plans and flies one round in a scenario; it returns the verdict, and whether the plan was flown.
OneRound = Callable[[Scenario], tuple[Verdict, bool]]


def refine(scenario: Scenario, most: int, one_round: OneRound, keep: Callable[[int], None]) -> tuple[Verdict, Rounds]:
    """Plan and fly in rounds, each with limits tightened by the previous round, until one flies or none can follow.

    most: maximum number of rounds after the first.
    one_round: plans in a scenario and flies; returns the verdict, and whether the plan was flown.
    keep: called with the number of a round before another round replaces its results.

    Returns the last verdict, and the changes and results of each round in the format of ``rounds.json``.
    """
    rounds: Rounds = []
    planned_in, changes = scenario, list[Tightening]()
    for number in range(most + 1):
        verdict, flown = one_round(planned_in)
        rounds.append(
            {
                "round": number,
                "changes": [tightening_text(change) for change in changes],
                "flown": flown,
                "flyable": verdict.flyable,
                "summary": verdict.headline,
                "next": "",
            }
        )
        planned_in, changes = tighten_limits(planned_in, verdict)
        rounds[-1]["next"] = _next_step_remark(verdict, flown, number == most, changes)
        if rounds[-1]["next"] != GO_ON:
            break
        keep(number)
    return verdict, rounds


def _next_step_remark(verdict: Verdict, flown: bool, last: bool, changes: list[Tightening]) -> str:
    """Return the remark on the step after a round, which is `GO_ON` or the reason to end."""
    if verdict.flyable:
        return "done: it flies"
    if verdict.undecided:
        return "ended: nothing failed, and the aircraft is not known well enough for the rest"
    if not flown:
        return "ended: within these limits no feasible plan was found"
    if not changes:
        return "ended: nothing is left to tighten; the planner knows no path that meets what failed"
    return "ended: no rounds left" if last else GO_ON
