"""Tightening a scenario's limits by what a flight could not do, for the next round of planning.

Only the planning is tightened: every round is judged against the scenario as it was given.
"""

import copy
import re
from collections.abc import Callable
from typing import Any

from logs.verdict.findings import Finding, Verdict
from world.scenario import Scenario, from_spec

Spec = dict[str, Any]

# Beyond what the flight fell short by, m.
CLEARANCE_RESERVE = 5.0
MISSILE_RESERVE = 10.0
# Where a limit is already the aircraft's and the flight failed all the same, this share of it is left.
SHARE = 0.9
# What follows a round that another follows.
GO_ON = "tightened and planned again"


def tighten(scenario: Scenario, verdict: Verdict) -> tuple[Scenario, list[str]]:
    """The scenario to plan in next, and what was changed in words; no words where nothing can be tightened."""
    spec = copy.deepcopy(scenario.to_json())
    failed = [item for item in verdict.findings if item.ok is False]
    changes: list[str] = []
    for change in (_slopes, _turns):
        changes += change(spec, scenario, failed)
    if not changes:
        # A flight that cannot follow its plan comes down lower and closer too: that is no reason of its own.
        for change in (_clearance, _missiles):
            changes += change(spec, scenario, failed)
    if not changes:
        return scenario, []
    return from_spec(spec, scenario.name, ground=scenario.terrain), changes


def _limits(spec: Spec) -> Spec:
    return spec.setdefault("limits", {})  # type: ignore[no-any-return]  # plain JSON data


def _slopes(spec: Spec, _scenario: Scenario, failed: list[Finding]) -> list[str]:
    changes = []
    for key, sign in (("max_climb_deg", 1.0), ("max_dive_deg", -1.0)):
        mine = [sign * item.planned for item in failed if item.rule == "slope" and item.planned is not None]
        steep = [angle for angle in mine if angle > 0.0]
        if not steep:
            continue
        now = _limits(spec).get(key, "aircraft")
        by_aircraft = any(item.limit_source == "aircraft" and item.margin and item.margin < 0.0 for item in failed)
        tighter: float | str = "aircraft"
        if now == "aircraft" or not by_aircraft:
            tighter = round(SHARE * min([*steep, *([now] if isinstance(now, float) else [])]), 2)
        _limits(spec)[key] = tighter
        changes.append(f"limits.{key}: {now} to {tighter}")
    return changes


def _turns(spec: Spec, scenario: Scenario, failed: list[Finding]) -> list[str]:
    if not any(item.rule in ("turn", "waypoint") for item in failed):
        return []
    now = _limits(spec).get("max_turn_deg", "aircraft")
    if now != "aircraft":
        _limits(spec)["max_turn_deg"] = "aircraft"
        return [f"limits.max_turn_deg: {now} to aircraft"]
    # Larger arcs to plan with, while the flight keeps its bank.
    bank = scenario.flight.max_bank_deg
    tighter = round(SHARE * bank, 2)
    if tighter < 5.0:
        return []
    spec.setdefault("flight", {})["max_bank_deg"] = tighter
    return [f"flight.max_bank_deg (of the plan): {bank:g} to {tighter:g}"]


def _clearance(spec: Spec, scenario: Scenario, failed: list[Finding]) -> list[str]:
    short = [-item.margin for item in failed if item.rule == "clearance" and item.margin is not None]
    if not short:
        return []
    now = scenario.limits.min_clearance_m
    tighter = round(now + max(0.0, *short) + CLEARANCE_RESERVE, 1)
    _limits(spec)["min_clearance_m"] = tighter
    return [f"limits.min_clearance_m: {now:g} to {tighter:g}"]


def _missiles(spec: Spec, _scenario: Scenario, failed: list[Finding]) -> list[str]:
    changes = []
    for item in failed:
        if item.planned:
            # The plan itself enters it: the planner knew no way outside, and a larger sphere leaves none either.
            continue
        depth = re.search(r"pass .* (\d+) m further away", item.suggestion)
        name = item.where.removesuffix(" (missile)")
        if item.rule != "threat" or depth is None:
            continue
        for number, threat in enumerate(spec.get("threats", [])):
            if threat.get("name", f"threat {number + 1}") == name and "kill_radius_m" in threat:
                now = threat["kill_radius_m"]
                threat["kill_radius_m"] = now + float(depth[1]) + MISSILE_RESERVE
                changes.append(f"kill radius of {name}: {now:g} to {threat['kill_radius_m']:g}")
    return changes


Rounds = list[dict[str, Any]]
OneRound = Callable[[Scenario], tuple[Verdict, bool]]


def refine(scenario: Scenario, most: int, one_round: OneRound, keep: Callable[[int], None]) -> tuple[Verdict, Rounds]:
    """Plan and fly in rounds, each tightened by the one before, until flyable or shown not to be.

    most: rounds after the first.  one_round: plans in a scenario and flies; the verdict, and whether it was flown.
    keep: is told the number of a round whose results another will replace.  Returns the last verdict and a list of
    what each round changed and gave.
    """
    rounds: Rounds = []
    planned_in, changes = scenario, list[str]()
    for number in range(most + 1):
        verdict, flown = one_round(planned_in)
        rounds.append(
            {
                "round": number,
                "changes": changes,
                "flown": flown,
                "flyable": verdict.flyable,
                "summary": verdict.summary.splitlines()[0],
                "next": "",
            }
        )
        planned_in, changes = tighten(planned_in, verdict)
        rounds[-1]["next"] = _next(verdict, flown, number == most, changes)
        if rounds[-1]["next"] != GO_ON:
            break
        keep(number)
    return verdict, rounds


def _next(verdict: Verdict, flown: bool, last: bool, changes: list[str]) -> str:
    """What follows from a round."""
    if verdict.flyable:
        return "done: it flies"
    if not flown:
        return "ended: within these limits no feasible plan was found"
    if not changes:
        return "ended: nothing is left to tighten; the planner knows no path that meets what failed"
    return "ended: no rounds left" if last else GO_ON
