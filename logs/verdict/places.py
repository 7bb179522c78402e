"""Define the places of findings, changes of a plan, and the three levels of a verdict, as data."""

from dataclasses import dataclass, field, replace
from typing import Literal

from world.json_schema import DocumentConfig

# ----------------------------------------------------------------------
# Places of findings, changes of a plan, and disagreements between levels, as data.
#
# `logs.verdict.wording` writes them in words.

# "flight", "mission" and "plan" mean the whole of each; "missile" and "radar" are a threat's two spheres; "exclusion"
# and "inclusion" are zones of airspace.
PlaceKind = Literal["flight", "mission", "plan", "leg", "waypoint", "missile", "radar", "exclusion", "inclusion"]

# Kind of a change: the quantity that it changes.
# - Changes to another value: "length" or "rise" of a leg (a negative rise is a descent), "airspeed", largest "turn",
#   "radius" that a loiter's item states, "home altitude", "altitude frame" of the items below ground, "end loiter"
#   instead of the last waypoint, "landing course", "launch course" and "launch speed" of the scenario,
#   "parameter" of the autopilot, which `Change.parameter` names.
# - Changes by a step: "height" (higher) or "descent" (lower) of a leg, a waypoint or the path at a zone; "inset" of the
#   path from the area's edges; "distance" from a missile; "north", "east", "south" or "west" of the path at a zone;
#   "duration" of the flight.
# - Changes by a factor: "battery" or "tank".
# - Knowledge about the aircraft instead of changes of the plan: duration of a flight at "full throttle" or with "no
#   throttle" that measures its ability, and a "stated climb" or a "stated bank" that the user should state.
ChangeKind = Literal[
    "length",
    "rise",
    "airspeed",
    "turn",
    "radius",
    "home altitude",
    "altitude frame",
    "terrain height",
    "end loiter",
    "landing course",
    "launch course",
    "launch speed",
    "parameter",
    "height",
    "descent",
    "inset",
    "distance",
    "north",
    "east",
    "south",
    "west",
    "duration",
    "battery",
    "tank",
    "full throttle",
    "no throttle",
    "stated climb",
    "stated bank",
]


@dataclass(frozen=True, slots=True)
class Place(DocumentConfig):
    """Place of a finding."""

    # Places are compared without `to_item` and `number`: the index is enough, and older logs have neither.

    kind: PlaceKind
    """flight, mission, plan, leg, waypoint, missile, radar, exclusion or inclusion."""
    index: int | None = None
    """Index of the leg, waypoint, threat or zone, from 0; fence zones follow the scenario's. Null for anything else."""
    item: int | None = None
    """Mission item of a waypoint, or the item that a check names."""
    name: str = ""
    """Name of a threat or a zone in the scenario; empty for none."""
    to_item: int | None = field(default=None, compare=False)
    """Mission item to which a leg leads; several legs may lead to one item."""
    number: int | None = field(default=None, compare=False)
    """Number of a leg or waypoint in the texts, where all corners of one loiter are one stop."""


def numbered_place(place: Place) -> Place:
    """Replace a place's index by the number that texts show, which all corners of a loiter share.

    A place without a number is returned unchanged.

    >>> numbered_place(Place("waypoint", 11, item=4, number=3)).index
    3
    """
    return place if place.number is None else replace(place, index=place.number)


# Horizontal move of an item that is suggested only if no smaller move passes, m; the detour is up to twice as long.
FAR_MOVE_DISTANCE_M = 300.0

FLIGHT = Place("flight")
MISSION = Place("mission")
PLAN = Place("plan")


@dataclass(frozen=True, slots=True)
class ItemMove(DocumentConfig):
    """Move of one mission item."""

    item: int
    """Number of the mission item."""
    east: float
    """Move east, m."""
    north: float
    """Move north, m."""
    up: float
    """Change of the altitude, m."""


@dataclass(frozen=True, slots=True)
class RemainingFinding(DocumentConfig):
    """Finding that still fails or is undecided after a change, on a part not judged or failed before."""

    rule: str
    place: Place
    fails: bool
    """True if it fails, false if it is undecided."""


@dataclass(frozen=True, slots=True)
class Change(DocumentConfig):
    """One change of the plan."""

    what: ChangeKind
    place: Place
    current: float | None
    """Current value; null if wanted is a step or a factor, or if the current value does not matter."""
    wanted: float
    """Value that passes, or the step (positive for higher, further and shorter), or the factor."""
    unit: str
    most: float | None = None
    """Upper end of the range of passing values; `wanted` is its lower end."""
    moves: tuple[ItemMove, ...] = field(default=(), compare=False)
    """Moves of items with which the suggestion passed its trial, stated with its last change; all else is unmoved."""
    remaining: tuple[RemainingFinding, ...] = field(default=(), compare=False)
    """Findings that remain open after the suggestion, stated with its last change."""
    not_flown: bool = field(default=False, compare=False)
    """True, with the last change, if the suggestion was tried by geometry only, because the flight ended before it."""
    parameter: str = ""
    """Name of the autopilot parameter that is changed; empty for any other change."""


# Changes to make together.  A finding has alternative suggestions, any of which would make it pass.
Suggestion = tuple[Change, ...]


@dataclass(frozen=True, slots=True)
class Disagreement(DocumentConfig):
    """Rule and place that another level and the verdict judge differently."""

    rule: str
    place: Place
    level: str
    """Name of the other level."""
    there: bool
    """True if the place passes at the other level."""
    here: bool
    """True if the place passes in the verdict."""


# ----------------------------------------------------------------------
# The three levels of a verdict, as data: geometry, airframe, autopilot.
#
# - geometry: the path stays within the envelope, judged without a flight.
# - airframe: this aircraft can follow the path at all, with planfly's guidance and exact navigation.
# - autopilot: the flight passes with the autopilot that will fly, its parameters and its navigation error.
# The verdict is the answer of the last level that was judged.

LevelName = Literal["geometry", "airframe", "autopilot"]


@dataclass(frozen=True, slots=True)
class LevelAnswer:
    """Answer of one level.

    headline: the answer in one line.
    disagreements: findings that this level and the verdict judge differently; empty for the verdict's own level.
    undecided: True if nothing failed, but a required part was not judged.
    """

    name: LevelName
    flyable: bool
    headline: str
    disagreements: tuple[Disagreement, ...] = ()
    undecided: bool = False


@dataclass(frozen=True, slots=True)
class AirframeAnswer(DocumentConfig):
    """Result of the reference flight by planfly's guidance, as stored in the log of the judged flight.

    failed: rule and place of each finding that failed.
    """

    flyable: bool
    headline: str
    failed: tuple[tuple[str, Place], ...] = ()


@dataclass(frozen=True, slots=True)
class DecidingParameter(DocumentConfig):
    """Autopilot parameter that decides the verdict: the flight passes if only this parameter is changed.

    name: name of the parameter, or of two equal ones that are changed together, joined by "and".
    current: value as flown, in ``unit``.
    passing: nearest value with which a flight passed, in ``unit``.
    rule, place: rule and place of the finding that failed first with the current value.
    off: error at that place, m: positive above for a height error, to the side for the corridor; None if unknown.
    """

    name: str
    current: float
    passing: float
    unit: str
    rule: str
    place: Place
    off: float | None = None


@dataclass(frozen=True, slots=True)
class TriedSuggestions(DocumentConfig):
    """Suggestions for a failed finding that passed a trial."""

    rule: str
    place: Place
    suggestions: tuple[Suggestion, ...]


@dataclass(frozen=True, slots=True)
class ReferenceFlights(DocumentConfig):
    """Results of reference flights, stored in the log of the judged flight because they are not repeated.

    airframe: result of the airframe's reference flight; None if it was not flown.
    deciding: parameter that decides; None if no parameter decides, or if none was searched.
    tried: suggestions that passed their trials; None if no suggestion was tried.
    """

    airframe: AirframeAnswer | None = None
    deciding: DecidingParameter | None = None
    tried: tuple[TriedSuggestions, ...] | None = None
