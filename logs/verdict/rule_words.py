"""Define the texts and units of each rule, without its judging.

They are name, title, question, unit, scale and urgency.

`logs.verdict.rules.registry.RULES` contains the judging functions.  All code that shows a verdict reads this table.
"""

from dataclasses import dataclass

from logs.verdict.headline_phrases import (
    HeadlinePhrase,
    event_phrase,
    excess_phrase,
    missed_waypoint_phrase,
    missile_phrase,
    photo_line_phrase,
    reason_phrase,
    return_phrase,
    shortfall_phrase,
    slope_phrase,
    small_circle_phrase,
    zone_phrase,
)
from logs.verdict.wording import RULE_NOUNS


@dataclass(frozen=True, slots=True)
class Margin:
    """Quantity that a rule compares with a limit, and the scale by which flights are ranked.

    quantity: name of the quantity that is compared with the limit.
    unit: unit of the quantity, the limit and the margin.
    scale: difference that a person would call noticeable, in this unit.  It ranks flights and marks a narrow pass, but
        decides no verdict.  None for a count, a time or a geometric limit, which do not show how close a flight was.
    """

    quantity: str
    unit: str
    scale: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleWords:
    """Texts of a rule.

    name: name in findings, in file formats, and in the columns of a campaign's table.
    title: heading of the rule's findings in tables.
    noun: name of the rule within a sentence; "" to use `name`.
    question: question that the rule answers, one sentence.
    margin: quantity of the rule's margin; None for a rule without a number of its own.
    urgency: rank in a headline, which names failures of a higher urgency first.
    phrase: function that makes the phrase of a failed finding in a headline.
    unjudged: name of the unjudged part in the headline of a flyable verdict; "" to omit it.
    unjudged_unit: noun, in the singular, with which the headline counts findings that were not judged.
    explains_unjudged: True if the summary states why the rule was not judged.
    is_warning: True if the rule's findings are warnings, which decide no verdict.
    tolerance_purpose: purpose of the tolerance, such as "navigation and gusts"; "" to omit it.
    """

    name: str
    title: str
    noun: str = ""
    question: str
    margin: Margin | None
    urgency: int = 0
    phrase: HeadlinePhrase = excess_phrase
    unjudged: str = ""
    unjudged_unit: str = "leg"
    explains_unjudged: bool = False
    is_warning: bool = False
    tolerance_purpose: str = ""

    @property
    def word(self) -> str:
        """Name of the rule in sentences and tables; `name` is its name in data."""
        return self.noun or self.name

    @property
    def scale(self) -> float | None:
        """Scale of the margin, in its unit; None if flights are not ranked by this margin."""
        return None if self.margin is None else self.margin.scale

    @property
    def margin_column(self) -> str:
        """Column of a campaign's table with the smallest margin of each flight."""
        return f"margin_{self.name}"

    @property
    def place_column(self) -> str:
        """Column of a campaign's table with the place of the smallest margin."""
        return f"place_{self.name}"


# Check of the rule "survey" that judges the overlap of photos along the lines.
FRONT_OVERLAP = "front overlap"
# Check of the rule "survey" that judges the overlap of photos across the lines.
SIDE_OVERLAP = "side overlap"

# Rules of take-off and landing, which the airframe's reference flight does not fly.
GROUND_RULES = ("takeoff", "climbout", "launch", "landing", "approach", "touchdown")

# Rules of `GROUND_RULES` that judge the part before the first waypoint.
TAKE_OFF_RULES = ("takeoff", "climbout", "launch")

# The words of every rule by its name, in the order in which a verdict judges and lists the rules.
RULE_WORDS: dict[str, RuleWords] = {
    words.name: words
    for words in (
        RuleWords(
            name="mission",
            title="mission",
            question="Would the autopilot accept the mission, and does the route stay inside the mission's fence?",
            margin=None,
            urgency=2,
        ),
        RuleWords(
            name="turn",
            title="turns",
            question="Can the aircraft turn at each corner, and did it?",
            margin=Margin("course change", "deg"),
        ),
        RuleWords(
            name="loiter",
            title="loiters",
            question="Can each loiter circle be held within the bank limit in this wind, and was it completed?",
            margin=Margin("radius", "m", 10.0),
            phrase=small_circle_phrase,
        ),
        RuleWords(
            name="slope",
            title="slopes",
            question="Can each leg be climbed or descended at its airspeed in this wind, and was it?",
            margin=Margin("slope", "deg", 1.0),
            phrase=slope_phrase,
            urgency=1,
        ),
        RuleWords(
            name="clearance",
            title="clearance",
            question="Does each leg stay the required height above the ground?",
            margin=Margin("height above ground", "m", 10.0),
            phrase=shortfall_phrase,
            unjudged="terrain",
            explains_unjudged=True,
        ),
        RuleWords(
            name="height",
            title="heights",
            question="Does each leg stay below the maximum height above ground and the ceiling?",
            margin=Margin("height above ground", "m", 10.0),
            unjudged="heights above ground",
            explains_unjudged=True,
        ),
        RuleWords(
            name="fence",
            title="zones",
            question="Do the path and the flight stay outside exclusion zones and inside inclusion zones?",
            margin=Margin("depth of the violation", "m", 10.0),
            phrase=zone_phrase,
            unjudged="airspace",
            unjudged_unit="zone",
            explains_unjudged=True,
        ),
        RuleWords(
            name="threat",
            title="threats",
            question="Do the path and the flight stay outside each missile's sphere?",
            margin=Margin("time in range", "s"),
            phrase=missile_phrase,
            explains_unjudged=True,
        ),
        RuleWords(
            name="bounds",
            title="bounds",
            question="Does the flight stay inside the area's box, above its floor and below its ceiling?",
            margin=Margin("distance inside the edge", "m", 10.0),
            phrase=shortfall_phrase,
            explains_unjudged=True,
        ),
        RuleWords(
            name="waypoint",
            title="waypoints",
            question="Was each waypoint reached, within the radius that the mission or the autopilot sets for it?",
            margin=Margin("closest approach", "m", 10.0),
            phrase=missed_waypoint_phrase,
            tolerance_purpose="navigation and gusts",
        ),
        RuleWords(
            name="corridor",
            title="corridor",
            question="How far did the flight deviate from the legs, including its turns?",
            margin=Margin("distance from the legs", "m", 10.0),
        ),
        RuleWords(
            name="survey",
            title="photo lines",
            noun=RULE_NOUNS["survey"],
            question="How much of each photo line of a survey is flown so that its photos can be used?",
            margin=Margin("usable share of the line", "%", 5.0),
            phrase=photo_line_phrase,
        ),
        RuleWords(
            name="speed",
            title="airspeed",
            question="Can the aircraft fly level at each leg's commanded airspeed, and hold the leg's course in this"
            " wind?",
            margin=Margin("airspeed", "m/s", 1.0),
            phrase=reason_phrase,
            unjudged="airspeed",
        ),
        RuleWords(
            name="stall",
            title="stall",
            question="Is the airspeed above the stall speed at the bank angle that is flown?",
            margin=Margin("airspeed", "m/s", 1.0),
        ),
        RuleWords(
            name="takeoff",
            title="take-off",
            noun=RULE_NOUNS["takeoff"],
            question="Can the aircraft climb from the ground at home to the position of the take-off item?",
            margin=Margin("slope", "deg"),
            unjudged="take-off",
            explains_unjudged=True,
        ),
        RuleWords(
            name="climbout",
            title="climb-out",
            noun=RULE_NOUNS["climbout"],
            question="Is the climb from home to the mission's first waypoint clear of ground, missiles and zones?",
            margin=Margin("height above ground", "m", 10.0),
            phrase=reason_phrase,
            unjudged="climb-out",
            explains_unjudged=True,
        ),
        RuleWords(
            name="launch",
            title="launch",
            question="Does the launch start the motor, leave its runway in time, lose no height, and climb out free of"
            " obstacles?",
            margin=Margin("height above ground", "m", 10.0),
            urgency=4,
            phrase=reason_phrase,
            unjudged="launch",
            explains_unjudged=True,
        ),
        RuleWords(
            name="landing",
            title="landing",
            question="Can the aircraft descend from the last waypoint to the landing point?",
            margin=Margin("slope", "deg"),
            unjudged="landing",
            explains_unjudged=True,
        ),
        RuleWords(
            name="approach",
            title="approach",
            question="Is the glide to the landing point clear of ground, missiles and zones?",
            margin=Margin("height above ground", "m", 10.0),
            phrase=reason_phrase,
            unjudged="approach",
            explains_unjudged=True,
        ),
        RuleWords(
            name="touchdown",
            title="touchdown",
            question="Does the aircraft touch down and come to rest on the strip, on a final approach clear of ground,"
            " missiles and zones?",
            margin=Margin("distance from the strip's center", "m", 20.0),
            phrase=reason_phrase,
            unjudged="touchdown",
            explains_unjudged=True,
        ),
        RuleWords(
            name="go_around",
            title="go-around",
            noun=RULE_NOUNS["go_around"],
            question="Would a go-around from anywhere on the glide stay clear of ground, missiles and zones?",
            margin=None,
            phrase=reason_phrase,
            is_warning=True,
        ),
        RuleWords(
            name="return",
            title="return",
            question="Where does the return to launch lead, by which path, and did the flight arrive there?",
            margin=None,
            phrase=return_phrase,
        ),
        RuleWords(
            name="link",
            title="radio link",
            noun=RULE_NOUNS["link"],
            question="Does the radio link to the ground station keep its fade margin along the whole path?",
            margin=Margin("longest outage", "s"),
            explains_unjudged=True,
        ),
        RuleWords(
            name="energy",
            title="energy",
            question="Does the flight leave the required reserve in the battery or the tank?",
            margin=Margin("energy used", "Wh", 50.0),
            explains_unjudged=True,
        ),
        RuleWords(
            name="departure",
            title="loss of control",
            noun=RULE_NOUNS["departure"],
            question="Are all values finite, are bank and airspeed plausible, and is the ground never touched?",
            margin=Margin("largest bank", "deg", 10.0),
            urgency=4,
            phrase=event_phrase,
        ),
        RuleWords(
            name="completion",
            title="completion",
            question="Was the plan feasible, flown to its last waypoint, and recorded completely and consistently?",
            margin=Margin("flown", "legs"),
            urgency=3,
            phrase=event_phrase,
        ),
    )
}


def rule_word(name: str) -> str:
    """Return the name of a rule in texts; a name that is not in `RULE_WORDS` is returned unchanged.

    >>> rule_word("departure"), rule_word("slope")
    ('loss of control', 'slope')
    """
    return RULE_WORDS[name].word if name in RULE_WORDS else name
