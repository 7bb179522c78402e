"""Define the data classes of ``verdict.json``: a verdict with its texts.

The JSON schema is made from these classes.

`logs.verdict.verdict.Verdict.document` fills them.
"""

from dataclasses import dataclass, fields
from typing import Final, Literal

from flight.autopilots.autopilot import AutopilotProgram, Parameters
from logs.verdict.conditions import Conditions
from logs.verdict.findings import Fact, Finding
from logs.verdict.places import DecidingParameter, Disagreement, LevelAnswer, Place, Suggestion
from logs.verdict.wording import deciding_text, disagreement_text
from world.json_schema import DocumentConfig

SCHEMA: Final = "planfly.verdict/3"


@dataclass(frozen=True, slots=True, kw_only=True)
class FindingDocument(DocumentConfig):
    """One rule at one place."""

    rule: str
    where: str
    """The place in words."""
    place: Place
    planned: float | None
    flown: float | None
    limit: float | None
    limit_source: str
    """Source of the limit: scenario, aircraft, mission, autopilot, default, ..."""
    at_least: bool
    """True if values of at least the limit pass; false if values of at most the limit pass."""
    passes: str
    """The values that pass in words, with the tolerance: "≤ 8.29 m"; "" without a limit."""
    tolerance: float | None
    margin: float | None
    """Distance inside the limit, without the tolerance; negative beyond the limit, even within the tolerance."""
    unit: str
    """Unit of planned, flown, limit, tolerance and margin."""
    method: str
    ok: bool | None
    """Null if not judged; the reason then says why."""
    reason: str
    suggestions: tuple[Suggestion, ...]
    """Alternative suggestions, each a list of changes to make together; each alternative would pass."""
    brief: str
    placed: bool
    check: str
    facts: tuple[Fact, ...]
    suggestion: str
    """The suggestions in words."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelDocument(DocumentConfig):
    """The answer of one level: geometry, airframe or autopilot."""

    name: str
    flyable: bool
    undecided: bool
    headline: str
    disagreements: tuple[str, ...]
    differences: tuple[Disagreement, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class DecidingDocument(DocumentConfig):
    """The autopilot parameter that decides the verdict."""

    name: str
    current: float
    passing: float
    unit: str
    rule: str
    place: Place
    off: float | None
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterDocument(DocumentConfig):
    """A parameter in the autopilot's unit, and the source of its value."""

    name: str
    value: float
    origin: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ParametersDocument(DocumentConfig):
    """Parameters of the autopilot that flew."""

    file: str
    values: tuple[ParameterDocument, ...]
    unused: tuple[str, ...]
    not_flown: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictDocument(DocumentConfig):
    """The verdict on a plan, a mission or a flight; the content of verdict.json."""

    schema: Literal["planfly.verdict/3"]
    level: str
    """flown, geometric (without a flight) or plan (no feasible plan, so nothing was flown)."""
    flyable: bool
    complete: bool
    answer: str
    """flyable, not flyable or not judged in full; of an imported flight flown, or not flown, as planned."""
    undecided: bool
    """True if nothing failed, but something that had to be judged was not."""
    summary: str
    """Lines for a person; the first line is the answer."""
    conditions: Conditions | None
    """Conditions for which the verdict holds; null if they are not known."""
    flown_by: AutopilotProgram | None
    parameters: ParametersDocument | None
    levels: tuple[LevelDocument, ...]
    deciding_parameter: DecidingDocument | None
    findings: tuple[FindingDocument, ...]


def finding_document(finding: Finding) -> FindingDocument:
    """Convert a finding to a document, with its place, its passing values and its suggestions as texts."""
    data = {field.name: getattr(finding, field.name) for field in fields(finding)}
    return FindingDocument(**data, where=finding.where, passes=finding.limit_text, suggestion=finding.suggestion)


def level_document(level: LevelAnswer) -> LevelDocument:
    """Convert the answer of a level to a document, with its disagreements with the verdict as texts."""
    return LevelDocument(
        name=level.name,
        flyable=level.flyable,
        undecided=level.undecided,
        headline=level.headline,
        disagreements=tuple(map(disagreement_text, level.disagreements)),
        differences=level.disagreements,
    )


def deciding_document(deciding: DecidingParameter) -> DecidingDocument:
    """Convert the deciding parameter to a document, with a sentence that describes it."""
    data = {field.name: getattr(deciding, field.name) for field in fields(deciding)}
    return DecidingDocument(**data, text=deciding_text(deciding))


def parameters_document(parameters: Parameters) -> ParametersDocument:
    """Convert the autopilot's parameters to a document.

    It lists values with their origins, names in the file that have no effect, and names that are not simulated.
    """
    return ParametersDocument(
        file=parameters.source,
        values=tuple(ParameterDocument(**value._asdict()) for value in parameters.values),
        unused=tuple(parameters.unused),
        not_flown=tuple(parameters.not_simulated),
    )
