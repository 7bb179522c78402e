"""What a margin is measured by where flights are put in order, or a pass is called narrow; it decides no verdict."""

from logs.verdict.findings import RULES

# Of each rule, a difference that a person would call noticeable, in the rule's unit.
SCALES = dict.fromkeys(RULES, 10.0) | {
    "turn": 5.0, "slope": 1.0, "clearance": 10.0, "height": 10.0, "speed": 1.0, "stall": 1.0, "energy": 50.0,
    "waypoint": 10.0, "corridor": 10.0, "departure": 10.0, "completion": 1.0,
}  # fmt: skip
# Of a missile's sphere, by the distance outside it, m.
SPHERE_SCALE = 10.0
# Rules whose margin is a count or a time, and tells nothing of how close a flight was.
COUNTS = ("completion", "threat", "mission", "takeoff", "landing", "turn")
