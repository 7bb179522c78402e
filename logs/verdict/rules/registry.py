"""List all judging rules of the verdict in one place.

To add a rule, write its words in `logs.verdict.rule_words`, its file, and its line here.
"""

from logs.verdict.rule import Rule
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.rules import (
    bounds_rule,
    clearance_rule,
    climbout_approach_rule,
    completion_rule,
    corridor_rule,
    energy_rule,
    fence_rule,
    go_around_rule,
    height_rule,
    launch_rule,
    link_rule,
    loiter_rule,
    loss_of_control_rule,
    mission_rule,
    return_rule,
    slope_rule,
    speed_rule,
    stall_rule,
    survey_rule,
    takeoff_landing_rule,
    threat_rule,
    touchdown_rule,
    turn_rule,
    waypoint_rule,
)

_RULES = (
    mission_rule.RULE,
    turn_rule.RULE,
    loiter_rule.RULE,
    slope_rule.RULE,
    clearance_rule.RULE,
    height_rule.RULE,
    fence_rule.RULE,
    threat_rule.RULE,
    bounds_rule.RULE,
    waypoint_rule.RULE,
    corridor_rule.RULE,
    survey_rule.RULE,
    speed_rule.RULE,
    stall_rule.RULE,
    takeoff_landing_rule.TAKEOFF,
    climbout_approach_rule.CLIMBOUT,
    launch_rule.RULE,
    takeoff_landing_rule.LANDING,
    climbout_approach_rule.APPROACH,
    touchdown_rule.RULE,
    go_around_rule.RULE,
    return_rule.RULE,
    link_rule.RULE,
    energy_rule.RULE,
    loss_of_control_rule.RULE,
    completion_rule.RULE,
)

# All rules by name, in the order of `RULE_WORDS`, which is the order in which a verdict judges and lists them.
RULES: dict[str, Rule] = {name: next(rule for rule in _RULES if rule.name == name) for name in RULE_WORDS}
