"""Define a rule of the verdict.

A rule states how it judges on each level, what data it needs from a log, and its tolerances.

Each file in `logs/verdict/rules/` makes its own `Rule`; `logs.verdict.rules.registry.RULES` lists them.  Code that
judges uses that list; code that shows a verdict reads `logs.verdict.rule_words.RULE_WORDS`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from flight.simulation.setup import DataKind, FlightSetup
from logs.verdict.findings import Finding
from logs.verdict.imported.flown_legs import FlownLegs
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import Suggestion


class Judge(Protocol):
    """Callable that judges the planned path if ``geometric``, otherwise the flown track.

    aligned: None if nothing was flown, and for the planned path.
    """

    def __call__(
        self, requirements: RouteRequirements, aligned: AlignedTrack | None, /, *, geometric: bool = False
    ) -> list[Finding]:
        """Return the rule's findings, in the order of the route."""


# Function that judges the end of a flight.  Its last two arguments are the reason for the end, and True if the log is
# complete.
EndJudge = Callable[[RouteRequirements, AlignedTrack | None, str, bool], list[Finding]]
# Function that judges all parts of an imported flight that followed the mission together.  Its last argument is True if
# planfly's own log of the flight is complete.
ImportedEndJudge = Callable[[FlightSetup, Sequence[FlownLegs], bool], Finding]
# Function that replaces findings of other rules, or adds to their reasons, after all rules have judged.
Merge = Callable[[RouteRequirements, AlignedTrack | None, Sequence[Finding]], tuple[Finding, ...]]
# Function that suggests changes that would make a failed finding pass, the smallest change first.
Suggest = Callable[[RouteRequirements, AlignedTrack | None, Finding], tuple[Suggestion, ...]]


@dataclass(frozen=True, slots=True)
class LogNeeds:
    """Data that an imported log needs for a rule to judge it, in addition to times and positions.

    quantities: quantities without which the rule is not judged.
    needs_planned_heights: True if the mission must state altitudes.
    needs_aircraft: True if the aircraft must be known, unless the scenario sets the limit.
    needs_full_leg: True if the leg must be flown to its end; otherwise only failures are reported.
    needs_no_gap: True if the log must have no gap at a waypoint.  A leg with a gap passes no rule.
    reports_missing: True to report the rule as not judged if it has no finding because `quantities` are missing.
    """

    quantities: tuple[DataKind, ...] = ()
    needs_planned_heights: bool = False
    needs_aircraft: bool = False
    needs_full_leg: bool = False
    needs_no_gap: bool = False
    reports_missing: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """Rule of the verdict.

    name: name of the rule's words in `logs.verdict.rule_words.RULE_WORDS`.
    tolerances: names of the constants in `logs.verdict.tolerances` that the rule and its measures use.

    Judging functions, each None if the rule has none:
    judge: judges the planned path, the flown track, and each part of an imported flight that followed the mission, as
        far as the log contains the data that ``log`` names.
    judge_end, judge_imported_end, merge, suggest: see their types.

    log: data that the rule needs from an imported log.
    judges_whole_flight: True if the rule judges the flight as a whole, not a leg, a corner, a threat or a zone.
    is_same_for_plan: True if the rule gives the same result for a flight as for its planned path, so that it runs once
        for both.
    """

    name: str
    tolerances: tuple[str, ...] = ()
    judge: Judge | None = None
    judge_end: EndJudge | None = None
    judge_imported_end: ImportedEndJudge | None = None
    merge: Merge | None = None
    suggest: Suggest | None = None
    log: LogNeeds = LogNeeds()
    judges_whole_flight: bool = False
    is_same_for_plan: bool = False
