"""What ``verdict.json`` holds, as data that a JSON schema is made of; `planfly check` answers with it."""

import json
from dataclasses import asdict
from typing import Literal

from pydantic import ConfigDict, TypeAdapter
from pydantic.dataclasses import dataclass

from logs.verdict.conditions import Conditions
from logs.verdict.findings import Verdict, verdict_json

STRICT = ConfigDict(extra="forbid", use_attribute_docstrings=True, json_schema_serialization_defaults_required=True)


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class PlaceDocument:
    """Where something was judged."""

    kind: str
    """flight, mission, plan, leg, waypoint, missile, radar, exclusion or inclusion."""
    index: int | None
    """Of the leg, waypoint, threat or zone, from 0; null for the whole."""
    item: int | None
    """The mission item that a waypoint comes from."""
    name: str
    """That the scenario gives a threat or a zone."""
    to_item: int | None
    """Of a leg: the mission item that it leads to."""
    number: int | None
    """Of a leg or waypoint, as the text counts them: corners of one loiter are one stop."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ChangeDocument:
    """One change of the plan."""

    what: str
    place: PlaceDocument
    current: float | None
    wanted: float
    unit: str
    most: float | None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class FactDocument:
    """A number that was measured and is not judged."""

    what: str
    value: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class FindingDocument:
    """One rule at one place."""

    rule: str
    where: str
    """The place in words."""
    place: PlaceDocument
    planned: float | None
    flown: float | None
    limit: float | None
    limit_source: str
    """Whose the limit is: scenario, aircraft, mission, autopilot, default, ..."""
    tolerance: float | None
    margin: float | None
    """How far inside the limit; negative: beyond."""
    unit: str
    """Of planned, flown, limit, tolerance and margin."""
    method: str
    ok: bool | None
    """null: not judged, and the reason says why."""
    reason: str
    suggestions: list[list[ChangeDocument]]
    """Alternatives, each of changes to make together; any would pass."""
    brief: str
    placed: bool
    check: str
    facts: list[FactDocument]
    suggestion: str
    """The suggestions in words."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class DifferenceDocument:
    """What another level and the verdict judge differently."""

    rule: str
    place: PlaceDocument
    level: str
    there: bool
    here: bool


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class LevelDocument:
    """What one level says: geometry, airframe or autopilot."""

    name: str
    flyable: bool
    undecided: bool
    headline: str
    disagreements: list[str]
    differences: list[DifferenceDocument]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class DecidingDocument:
    """The parameter of the autopilot that decides."""

    name: str
    current: float
    passing: float
    unit: str
    rule: str
    place: PlaceDocument
    off: float | None
    text: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ParameterDocument:
    """A parameter in ArduPlane's unit, and who states it."""

    name: str
    value: float
    origin: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ParametersDocument:
    """Parameters of the ArduPlane that flew."""

    file: str
    values: list[ParameterDocument]
    unused: list[str]
    not_flown: list[str]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ProgramDocument:
    """The SITL program that flew."""

    version: str
    sha256: str
    parameters: dict[str, float]
    changed: dict[str, float]
    unused: list[str]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ConditionsDocument:
    """What a verdict or a plan is for; of an imported flight as far as its log tells."""

    aircraft: str
    """Its name or folder; empty for an imported flight whose aircraft nobody named."""
    mass_kg: float | None
    aircraft_named: bool
    """Whether anybody named it; if not, it is the default."""
    airspeed_mps: float
    """Until the mission sets another."""
    airspeed_kind: str
    """true or equivalent."""
    airspeed_source: str
    """scenario (or an option), parameters, aircraft (its cruise speed) or flight (as it was flown)."""
    wind_mps: float | None
    wind_from_deg: float | None
    """Both null where the wind is what is asked for."""
    turbulence: str | None
    """null where it was not simulated, as navigation."""
    navigation: str | None
    """perfect, rtk or gnss."""
    autopilot: str
    """With the settings that decide most."""
    autopilot_version: str
    """Empty for planfly's own guidance, and where a log's program states it."""
    terrain: str | None
    height_datum: str | None
    zones: int
    """Of airspace that it is judged by: the scenario's and the mission's fence's."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class VerdictDocument:
    """Whether a plan really flies: also the content of verdict.json."""

    schema: Literal["planfly.verdict/3"]
    level: str
    """flown, geometric (without a flight) or plan (no feasible plan, so nothing was flown)."""
    flyable: bool
    complete: bool
    answer: str
    """flyable, not flyable, incomplete or not judged in full; of an imported flight flown as planned or not."""
    undecided: bool
    """Whether nothing failed, and something was not judged that had to be."""
    summary: str
    """Lines for a person, of which the first answers the question."""
    conditions: ConditionsDocument | None
    """What it is for; null where that is not known."""
    flown_by: ProgramDocument | None
    parameters: ParametersDocument | None
    levels: list[LevelDocument]
    deciding_parameter: DecidingDocument | None
    findings: list[FindingDocument]


def conditions_document(conditions: Conditions) -> ConditionsDocument:
    """What a plan is for as an answer has it."""
    return ConditionsDocument(**asdict(conditions))


def verdict_document(verdict: Verdict) -> VerdictDocument:
    """A verdict as its file has it."""
    return TypeAdapter(VerdictDocument).validate_python(json.loads(verdict_json(verdict)))


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class VerdictsDocument:
    """planfly check --for: whether a mission really flies, by each autopilot."""

    schema: Literal["planfly.verdicts/1"] = "planfly.verdicts/1"
    exit_code: int
    mission: str
    verdicts: dict[str, VerdictDocument]
    """By the name of the autopilot's law."""


CheckDocument = VerdictDocument | VerdictsDocument
