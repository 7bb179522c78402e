"""The three levels of a verdict, as data: geometry, airframe, autopilot.

geometry: does the path ask for more than the envelope gives; nobody flies.  airframe: can this aircraft follow it at
all, flown by planfly's guidance that knows exactly where it is.  autopilot: does it go well with the autopilot that
will fly, its parameters and its error of navigation.  The verdict is that of the last one that was asked.
"""

from dataclasses import dataclass
from typing import Literal

from logs.verdict.places import Disagreement, Place

LevelName = Literal["geometry", "airframe", "autopilot"]


@dataclass(frozen=True, slots=True)
class LevelAnswer:
    """What one level says.

    headline: its answer in a line.
    disagreements: the findings that it and the verdict judge differently; none of the verdict's own level.
    """

    name: LevelName
    flyable: bool
    headline: str
    disagreements: tuple[Disagreement, ...] = ()


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
class FlownBeside:
    """What other flights than the one that is judged have to say of it; they are not flown again to judge a log.

    airframe: None where it was not flown.
    deciding: None where none decides, or none was looked for.
    """

    airframe: AirframeAnswer | None = None
    deciding: DecidingParameter | None = None
