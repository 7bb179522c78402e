"""What a rule of the verdict states about itself: its words, how it judges on each level, its margin, its tolerances.

Each file in `logs/verdict/rules/` makes its own `Rule`; `logs.verdict.rules.registry.RULES` lists them.  Everything
that goes rule by rule reads that list: verdicts, headlines, suggestions, imported flights, the campaign's table,
reports, docs.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from flight.simulation.setup import FlightSetup, Quantity
from logs.verdict.findings import Finding
from logs.verdict.imported.flown_legs import FlownLegs
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import Suggestion
from logs.verdict.wording import UNITS, place_text, shortened


class Judge(Protocol):
    """Judges the planned path (``geometric``), or the flown track beside it.

    aligned: None where nothing was flown, and for the planned path.
    """

    def __call__(
        self, requirements: RouteRequirements, aligned: AlignedTrack | None, /, *, geometric: bool = False
    ) -> list[Finding]:
        """Its findings, in the order of the route."""


# Of a mission's items alone, whoever flies them.
ItemsJudge = Callable[[FlightSetup], list[Finding]]
# Of how a flight ended and whether its record has its end.
EndJudge = Callable[[RouteRequirements, AlignedTrack | None, str, bool], list[Finding]]
# Of all stretches of an imported flight together, and whether planfly's own log of it has its end.
ImportedEndJudge = Callable[[FlightSetup, Sequence[FlownLegs], bool], Finding]
# Replaces findings of other rules by its own, after all have judged.
Merge = Callable[[RouteRequirements, AlignedTrack | None, Sequence[Finding]], tuple[Finding, ...]]
# What would make a failed finding pass, the smallest change first.
Suggest = Callable[[RouteRequirements, AlignedTrack | None, Finding], tuple[Suggestion, ...]]


@dataclass(frozen=True, slots=True)
class Margin:
    """What a rule's margin is the distance of, and what it is measured by where flights are ranked.

    of: the quantity that is compared with the limit, in words.
    unit: of quantity, limit and margin.
    scale: a difference that a person would call noticeable, in that unit.  It ranks flights and tells a narrow pass,
    and decides no verdict.  None for a count, a time or a limit of geometry: it says nothing of how close a flight was.
    """

    of: str
    unit: str
    scale: float | None = None


@dataclass(frozen=True, slots=True)
class LogNeeds:
    """What the log of an imported flight has to hold for a rule to judge it, beside times and places.

    quantities: each without which the rule is not judged.
    planned_heights: the plan states heights.
    aircraft: the aircraft is known, unless the scenario sets the limit.
    full_leg: the leg was flown to its end; otherwise only what fails counts.
    no_gap: the log has no gap at the waypoint; a leg with a gap is never passed.
    listed: named as not judged where the rule finds nothing for want of `quantities`.
    """

    quantities: tuple[Quantity, ...] = ()
    planned_heights: bool = False
    aircraft: bool = False
    full_leg: bool = False
    no_gap: bool = False
    listed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """A rule of the verdict.

    name: in findings, in file formats, and in the columns of a campaign's table.
    title: heads its findings in tables.  noun: names it within a sentence; "" for its name.
    asks: the question that it answers, one sentence.
    margin: None of a rule without a number of its own.
    tolerances: names of the constants of `logs.verdict.tolerances` that it and its measures judge with.

    How it judges, each None where it does not:
    judge: planned path and flown track.  judge_items, judge_end, judge_imported_end, merge: as their types say.
    An imported flight is judged by `judge`, stretch by stretch, as far as the log holds what ``log`` asks for.
    suggest: what would make a failed finding pass.
    whole: whether it judges the flight as one, and says nothing of a leg, a corner, a threat or a zone.
    of_route: whether it says the same of a flight as of its planned path, and so is asked once for both.

    In a headline:
    urgency: failures of a greater one are named first.
    phrase: a failed finding in a few words; "" or None for noun, place and numbers.
    unjudged: what was not judged, as a flyable verdict says it; "" for nothing.  unjudged_of: what is counted then.
    explained: whether the summary says why it was not judged.
    warns: whether what it finds is a warning, which decides no verdict.
    """

    name: str
    title: str
    asks: str
    margin: Margin | None
    tolerances: tuple[str, ...] = ()
    noun: str = ""
    judge: Judge | None = None
    judge_items: ItemsJudge | None = None
    judge_end: EndJudge | None = None
    judge_imported_end: ImportedEndJudge | None = None
    merge: Merge | None = None
    suggest: Suggest | None = None
    log: LogNeeds = LogNeeds()
    whole: bool = False
    of_route: bool = False
    urgency: int = 0
    phrase: Callable[[Finding], str] | None = None
    unjudged: str = ""
    unjudged_of: str = "legs"
    explained: bool = False
    warns: bool = False

    @property
    def word(self) -> str:
        """What a person calls it, within a sentence as in a table; `name` is what data calls it."""
        return self.noun or self.name

    @property
    def scale(self) -> float | None:
        """The margin's scale, in the margin's unit; None where the margin ranks no flights."""
        return None if self.margin is None else self.margin.scale

    @property
    def margin_column(self) -> str:
        """Column of a campaign's table with the least margin of each flight."""
        return f"margin_{self.name}"

    @property
    def place_column(self) -> str:
        """Column of a campaign's table with the place of the least margin."""
        return f"place_{self.name}"


# ----------------------------------------------------------------------
# A failed finding as a headline names it: the rule, the place, and the numbers or the reason in brief.


def located(noun: str, item: Finding, text: str) -> str:
    """A rule's noun and where it failed, with a text in brackets; a finding of the flight as a whole has no place."""
    if item.place.kind == "flight":
        return f"{noun} ({text})"
    return f"{noun} {'at' if item.place.kind == 'waypoint' else 'on'} {place_text(item.place)} ({text})"


def short_of_limit(noun: str, item: Finding) -> str:
    """A finding below a limit that is a least value: the flown value, or else the planned one."""
    low = item.planned if item.flown is None else item.flown
    if low is None or item.limit is None:
        return located(noun, item, shortened(item.brief))
    unit = UNITS.get(item.unit, "")
    return located(noun, item, f"{low:.1f}{unit} < {item.limit:.1f}{unit}")


def beyond_limit(noun: str, item: Finding) -> str:
    """A finding beyond a limit: the worse of planned and flown, if that is what failed; else the reason in brief."""
    values = [value for value in (item.flown, item.planned) if value is not None]
    worst = max(values, key=abs, default=None)
    if item.limit is None or worst is None or abs(worst) <= abs(item.limit):
        return located(noun, item, shortened(item.brief))
    unit = UNITS.get(item.unit, "")
    return located(noun, item, f"{worst:.1f}{unit} {'>' if worst > 0.0 else '<'} {item.limit:.1f}{unit}")
