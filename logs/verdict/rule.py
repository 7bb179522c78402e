"""A rule of the verdict: how it judges on each level, what it needs of a log, its tolerances.

Each file in `logs/verdict/rules/` makes its own `Rule`; `logs.verdict.rules.registry.RULES` lists them.  What judges
goes by that list; what shows a verdict reads `logs.verdict.rule_words.RULE_WORDS`.
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

    name: of its words in `logs.verdict.rule_words.RULE_WORDS`.
    tolerances: names of the constants of `logs.verdict.tolerances` that it and its measures judge with.

    How it judges, each None where it does not:
    judge: planned path and flown track.  judge_items, judge_end, judge_imported_end, merge: as their types say.
    An imported flight is judged by `judge`, stretch by stretch, as far as the log holds what ``log`` asks for.
    suggest: what would make a failed finding pass.
    whole: whether it judges the flight as one, and says nothing of a leg, a corner, a threat or a zone.
    of_route: whether it says the same of a flight as of its planned path, and so is asked once for both.
    """

    name: str
    tolerances: tuple[str, ...] = ()
    judge: Judge | None = None
    judge_items: ItemsJudge | None = None
    judge_end: EndJudge | None = None
    judge_imported_end: ImportedEndJudge | None = None
    merge: Merge | None = None
    suggest: Suggest | None = None
    log: LogNeeds = LogNeeds()
    whole: bool = False
    of_route: bool = False
