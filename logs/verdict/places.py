"""Where a finding lies, what of a plan could be changed, and the three levels of a verdict, as data."""

from dataclasses import dataclass, field
from typing import Literal

from world.json_schema import DocumentConfig

# ----------------------------------------------------------------------
# Where a finding lies, what of a plan could be changed, and where two levels differ, as data.
#
# `logs.verdict.wording` makes words of it.

# "flight", "mission" and "plan" are the whole of it; "missile" and "radar" are a threat's two spheres; "exclusion" and
# "inclusion" are zones of airspace.
PlaceKind = Literal[
    "flight", "mission", "plan", "leg", "waypoint", "missile", "radar", "exclusion", "inclusion"
]  # fmt: skip

# What a change is of.  To another value: a leg's "length", its "rise" (negative: it falls), "airspeed", a "turn" at
# most.  By a step: "height" or "descent" (higher, lower) of a leg, or of the path at a zone; "inset" of the path from
# the area's edges, "distance" from a missile, "north", "east", "south" or "west" at a zone, "duration" of the flight.
# By a factor: the "battery" or the "tank".  Not of a plan, but of what is known of the aircraft: so long a flight at
# "full throttle" or with "no throttle" would tell.
Quantity = Literal[
    "length", "rise", "airspeed", "turn", "height", "descent", "inset", "distance", "north", "east", "south", "west",
    "duration", "battery", "tank", "full throttle", "no throttle",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Place(DocumentConfig):
    """Where something was judged."""

    # Which leg an item or a number names is no part of what makes two places the same: the index is enough, and older
    # logs have neither.

    kind: PlaceKind
    """flight, mission, plan, leg, waypoint, missile, radar, exclusion or inclusion."""
    index: int | None = None
    """Of the leg, waypoint, threat or zone, from 0, a fence's zones after the scenario's; null for the whole."""
    item: int | None = None
    """The mission item that a waypoint comes from, or that a check names."""
    name: str = ""
    """The name that the scenario gives a threat or a zone; empty for none."""
    to_item: int | None = field(default=None, compare=False)
    """Of a leg: the mission item that it leads to; several legs may lead to one item."""
    number: int | None = field(default=None, compare=False)
    """Of a leg or waypoint, as the text counts them: corners of one loiter are one stop."""


FLIGHT, MISSION, PLAN = Place("flight"), Place("mission"), Place("plan")


@dataclass(frozen=True, slots=True)
class Change(DocumentConfig):
    """One change of the plan."""

    what: Quantity
    place: Place
    current: float | None
    """The value now; null where wanted is a step or a factor, or the value now does not matter."""
    wanted: float
    """The value that passes, the step (higher, further, shorter: positive), or the factor."""
    unit: str
    most: float | None = None
    """The upper end of a range that passes, of which wanted is the lower end."""


# Changes to make together; a finding holds alternatives of these, any of which would pass.
Suggestion = tuple[Change, ...]


@dataclass(frozen=True, slots=True)
class Disagreement(DocumentConfig):
    """A rule at a place that another level and the verdict judge differently."""

    rule: str
    place: Place
    level: str
    """The other level."""
    there: bool
    """True if the place passes at the other level."""
    here: bool
    """True if the place passes in the verdict."""


# ----------------------------------------------------------------------
# The three levels of a verdict, as data: geometry, airframe, autopilot.
#
# geometry: does the path ask for more than the envelope gives; nobody flies.  airframe: can this aircraft follow it at
# all, flown by planfly's guidance that knows exactly where it is.  autopilot: does it go well with the autopilot that
# will fly, its parameters and its error of navigation.  The verdict is that of the last one that was asked.

LevelName = Literal["geometry", "airframe", "autopilot"]


@dataclass(frozen=True, slots=True)
class LevelAnswer:
    """What one level says.

    headline: its answer in a line.
    disagreements: the findings that it and the verdict judge differently; none of the verdict's own level.
    undecided: whether nothing failed, and something was not judged that had to be.
    """

    name: LevelName
    flyable: bool
    headline: str
    disagreements: tuple[Disagreement, ...] = ()
    undecided: bool = False


@dataclass(frozen=True, slots=True)
class AirframeAnswer:
    """What the flight of the aircraft by planfly's guidance gave, as the log of the autopilot's flight carries it.

    failed: rule and place of each finding that failed.
    """

    flyable: bool
    headline: str
    failed: tuple[tuple[str, Place], ...] = ()


@dataclass(frozen=True, slots=True)
class DecidingParameter:
    """The one parameter of the autopilot by which a flight fails: with another value of it alone the flight passes.

    name: the autopilot's own.
    current, passing: its values, in ``unit``: as flown, and the nearest to it with which the flight was flown and
    passed.
    rule, place: of the finding that failed first with the current value.
    off: how far off it was there, m: below (negative) or above for a height, aside for the corridor; None where no
    such number is known.
    """

    name: str
    current: float
    passing: float
    unit: str
    rule: str
    place: Place
    off: float | None = None


@dataclass(frozen=True, slots=True)
class ReferenceFlights:
    """What other flights than the one that is judged have to say of it; they are not flown again to judge a log.

    airframe: None where it was not flown.
    deciding: None where none decides, or none was looked for.
    """

    airframe: AirframeAnswer | None = None
    deciding: DecidingParameter | None = None
