"""Where a finding lies, what of a plan could be changed, and where two levels differ, as data.

`logs.verdict.wording` makes words of it.
"""

from dataclasses import dataclass, field
from typing import Literal

# "flight", "mission" and "plan" are the whole of it; "missile" and "radar" are a threat's two spheres; "exclusion" and
# "inclusion" are zones of airspace.
PlaceKind = Literal[
    "flight", "mission", "plan", "leg", "waypoint", "missile", "radar", "exclusion", "inclusion"
]  # fmt: skip

# What a change is of.  To another value: a leg's "length", its "rise" (negative: it falls), "airspeed", a "turn" at
# most.  By a step: "height" or "descent" (higher, lower) of a leg, or of the path at a zone; "inset" of the path from
# the area's edges, "distance" from a missile, "north", "east", "south" or "west" at a zone, "duration" of the flight.
# By a factor: the "battery" or the "tank".
Quantity = Literal[
    "length", "rise", "airspeed", "turn", "height", "descent", "inset", "distance", "north", "east", "south", "west",
    "duration", "battery", "tank",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Place:
    """Where something was judged.

    kind: what it is.
    index: of the leg, waypoint, threat or zone, from 0 as the route and the scenario have them, the zones of a
    mission's fence after the scenario's; None for the whole.
    item: number of the mission item that a waypoint comes from, or that a check names; None where there is none.
    name: that the scenario gives the threat or the zone; "" where it gives none, and for every other kind.
    to_item: of a leg, the mission item that it leads to, None where it leads to none; a mission that jumps has several
    legs to one item.  It is no part of what makes two places the same: the index is enough, and older logs have none.

    >>> Place("waypoint", 3, item=4)
    Place(kind='waypoint', index=3, item=4, name='', to_item=None)
    >>> Place("leg", 3, to_item=5) == Place("leg", 3)
    True
    """

    kind: PlaceKind
    index: int | None = None
    item: int | None = None
    name: str = ""
    to_item: int | None = field(default=None, compare=False)


FLIGHT, MISSION, PLAN = Place("flight"), Place("mission"), Place("plan")


@dataclass(frozen=True, slots=True)
class Change:
    """One change of a plan: of what, where, from which value, to which.

    what: the quantity.
    place: where it is to change.
    current: its value now; None where `wanted` is a step or a factor, or the value now does not matter.
    wanted: the value that passes, the step (higher, further, shorter, positive), or the factor.
    unit: of both.
    most: where a range passes, its upper end; `wanted` is then the lower one.

    >>> Change("length", Place("leg", 1), 300.0, 400.0, "m").wanted
    400.0
    """

    what: Quantity
    place: Place
    current: float | None
    wanted: float
    unit: str
    most: float | None = None


# Changes to make together; a finding holds alternatives of these, any of which would pass.
Suggestion = tuple[Change, ...]


@dataclass(frozen=True, slots=True)
class Disagreement:
    """A rule at a place that another level and the verdict judge differently.

    level: the other level, a name of `logs.verdict.levels.LevelName`.
    there, here: whether it passes at that level, and in the verdict.
    """

    rule: str
    place: Place
    level: str
    there: bool
    here: bool
