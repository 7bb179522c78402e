"""Suggest changes that raise the probability of a planned mission.

They follow from the rules that its flights failed.
"""

import math

from planfly.campaigns.summary import CampaignSummary
from world.scenario import Scenario

# Step of the lengths that are suggested, m.
_LENGTH_STEP_M = 10.0
# Change that helps against the failures of a rule; `_measured_remedies` handles the rules with a length to suggest.
_REMEDIES = {
    "energy": "a larger battery or a shorter mission",
    "fence": "more distance to the fence",
    "launch": "a faster launch, or another launch course",
    "loiter": "a larger loiter radius",
    "slope": "gentler legs (smaller values of [limits] max_climb_deg and max_dive_deg)",
    "speed": "a lower cruise airspeed",
    "stall": "a higher cruise airspeed",
    "threat": "more distance to missiles (plan with larger kill radii than those that judge the flight)",
    "turn": "gentler turns (a smaller value of [limits] max_turn_deg) or fewer waypoints",
}
# Rules whose margin is a height above ground, m.
_HEIGHT_RULES = ("clearance", "approach", "climbout")


def remedies(summary: CampaignSummary, scenario: Scenario) -> tuple[str, ...]:
    """Return texts on changes that would raise the probability, those for the most failed rule first.

    () if no flight failed a rule.

    scenario: scenario of the mission.
    """
    texts: dict[str, None] = {}
    for failures in sorted(summary.by_rule, key=lambda failures: -failures.flights):
        low_margin = next((entry.low_margin for entry in summary.deciding if entry.rule == failures.rule), None)
        texts |= dict.fromkeys(_measured_remedies(failures.rule, low_margin, scenario))
    return (*texts, "less wind or turbulence") if summary.by_rule else ()


def _measured_remedies(rule: str, low_margin: float | None, scenario: Scenario) -> list[str]:
    """Return texts on the changes that would help against the failures of a rule; [] if none is known.

    For a rule whose margin is a length, the text states by how much to change it, if the margin is known.

    low_margin: margin that 5 % of the flights fall below, m; None if it is unknown.
    """
    shortfall = 0.0 if low_margin is None else max(0.0, -low_margin)
    if rule == "touchdown":
        # The strip is longer at both ends.
        added_length = _LENGTH_STEP_M * math.ceil(2.0 * shortfall / _LENGTH_STEP_M)
        texts = [f"a strip that is {added_length:.0f} m longer" if added_length else "a longer strip"]
        if scenario.landing is not None and scenario.landing.height_sd is None:
            texts.insert(0, "a survey of the strip's height ([landing] height_sd_m)")
        return [*texts, "another approach ([landing] course_deg, approach_m, slope_deg)"]
    if rule in _HEIGHT_RULES:
        height_text = f"{math.ceil(shortfall)} m higher" if shortfall else "higher"
        return [f"a path that is {height_text} above ground (plan with a larger [limits] min_clearance_m)"]
    return [_REMEDIES[rule]] if rule in _REMEDIES else []
