"""What each command answers with ``--json``.  Paths are as the command names them; numbers carry their unit."""

import json
import math
from dataclasses import asdict
from typing import Any, Literal

from pydantic import ConfigDict, TypeAdapter
from pydantic.dataclasses import dataclass

from aircraft.catalog import Aircraft
from flight.mission.surveys import PhotoLine
from flight.simulation.setup import FlightSetup
from logs.verdict.conditions import Conditions
from logs.verdict.findings import Verdict, verdict_json
from logs.verdict.measures.photo_lines import LineMeasure, OverlapMeasure
from logs.verdict.returns.glides_text import glide_range_text, glides_headline
from logs.verdict.returns.judge_glides import MARGIN
from logs.verdict.returns.judge_returns import ReturnRange
from logs.verdict.returns.returns_text import headline, range_text
from planfly.api.aircraft import AircraftNumbers
from planfly.api.returning import ReturnsFound, Suggested
from planfly.survey_remedies import NearMiss, SurveyRemedy
from world.frames import to_geo

# ----------------------------------------------------------------------
# What ``verdict.json`` holds, as data that a JSON schema is made of.

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


# ----------------------------------------------------------------------
# What ``planfly aircraft`` answers with ``--json``.


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class TrimEntry:
    """Level flight at one airspeed."""

    airspeed_mps: float
    alpha_deg: float
    elevator_deg: float
    throttle: float
    power_w: float
    endurance_s: float | None
    """How long 80 % of what it carries lasts."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ModeEntry:
    """A mode in cruise: its root, of a pair the one with the positive imaginary part."""

    name: str
    root_real_1_s: float
    root_imaginary_1_s: float


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class AircraftDetail:
    """What is worked out of one aircraft."""

    model_sha256: str
    level_speed_min_mps: float
    """At sea level."""
    level_speed_max_mps: float
    trims: list[TrimEntry]
    modes: list[ModeEntry]
    lacking: list[str]
    """What lacks in its folder for a flight."""
    files: list[str]
    """The pictures."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class AircraftEntry:
    """An aircraft."""

    name: str
    title: str
    folder: str
    mass_kg: float
    wing_area_m2: float
    wing_span_m: float
    airspeed_mps: float
    airspeed_min_mps: float
    airspeed_max_mps: float
    stall_speed_mps: float
    max_bank_deg: float
    detail: AircraftDetail | None
    """null in a list."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class AircraftAnswer:
    """planfly aircraft: the one that was named or made, or all that come with planfly."""

    schema: Literal["planfly.aircraft/1"] = "planfly.aircraft/1"
    exit_code: int
    aircraft: list[AircraftEntry]


def aircraft_entry(one: Aircraft, detail: AircraftDetail | None) -> AircraftEntry:
    """An aircraft's metadata, and what was worked out."""
    return AircraftEntry(
        name=one.name,
        title=one.title,
        folder=str(one.folder),
        mass_kg=one.mass,
        wing_area_m2=one.wing_area,
        wing_span_m=one.wing_span,
        airspeed_mps=one.airspeed,
        airspeed_min_mps=one.airspeed_min,
        airspeed_max_mps=one.airspeed_max,
        stall_speed_mps=one.stall_speed,
        max_bank_deg=round(math.degrees(one.max_bank), 9),
        detail=detail,
    )


def aircraft_detail(numbers: AircraftNumbers) -> AircraftDetail:
    """What was worked out, in the answer's units."""
    slow, fast = numbers.envelope.level_speeds(0.0)
    trims = [
        TrimEntry(
            airspeed_mps=row.trim.airspeed,
            alpha_deg=math.degrees(row.trim.alpha),
            elevator_deg=math.degrees(row.trim.elevator),
            throttle=row.trim.throttle,
            power_w=row.power,
            endurance_s=row.endurance if math.isfinite(row.endurance) else None,
        )
        for row in numbers.trims
    ]
    modes = [
        ModeEntry(name=mode.name, root_real_1_s=mode.root.real, root_imaginary_1_s=mode.root.imag)
        for mode in numbers.cruise
    ]
    return AircraftDetail(
        model_sha256=numbers.model_sha256,
        level_speed_min_mps=float(slow),
        level_speed_max_mps=float(fast),
        trims=trims,
        modes=modes,
        lacking=list(numbers.lacking),
        files=[str(file) for file in numbers.files],
    )


# ----------------------------------------------------------------------
# What ``planfly campaign`` and ``planfly winds`` answer: also the content of summary.json and winds.json.


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class FailedPlace:
    """Flights that failed a rule at a place; the place as of a verdict's finding."""

    where: str
    flights: int
    kind: str
    index: int | None
    item: int | None
    name: str
    to_item: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class FailedRule:
    """Flights that failed a rule."""

    rule: str
    flights: int
    places: list[FailedPlace]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class SensitivityEntry:
    """How much of the deciding margin's spread a quantity makes."""

    quantity: str
    first_order: float | None
    rank_slope: float | None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class CampaignDocument:
    """planfly campaign: how likely a mission is to fly."""

    schema: Literal["planfly.campaign-summary/1"]
    name: str
    seed: int
    target: float | None
    """The probability that was asked for."""
    answer: str
    """reached, missed, undecided or none asked."""
    flights: int
    flyable: int
    not_flyable: int
    lost: list[int]
    """Flights without an outcome."""
    probability: float | None
    confidence: float
    lower_bound: float | None
    upper_bound: float | None
    interval: list[float | None]
    method: str
    failed_by_rule: list[FailedRule]
    deciding_rule: str
    margin_of_one_in_twenty: float | None
    margin_unit: str
    sensitivities: list[SensitivityEntry]
    worst: list[dict[str, Any]]
    spread: dict[str, Any]
    conditions: ConditionsDocument
    """What each flight is drawn about."""
    made_of: str
    """What the campaign was made of, as a hash."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class WindFlights:
    """Flights in one wind."""

    speed_mps: float
    flights: int
    flyable: int


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class WindDirection:
    """The boundary of one direction."""

    from_deg: float
    boundary_mps: float
    interval_mps: list[float]
    beyond: bool
    """Whether it flies in every wind that was looked at."""
    flown: list[WindFlights]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class WindsDocument:
    """planfly winds: the largest wind from each direction."""

    schema: Literal["planfly.winds/1"]
    name: str
    seed: int
    target: float
    confidence: float
    most: float
    """The strongest wind that was looked at, m/s."""
    flights: int
    lost: list[int]
    """Flights without an outcome, from 0 in the order in which they were asked for; they count as not flyable."""
    directions: list[WindDirection]
    spread: dict[str, Any]
    conditions: ConditionsDocument
    """Without the wind, which is what is asked for."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class RoundAnswer:
    """A round of --refine."""

    round: int
    changes: list[str]
    summary: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class RunAnswer:
    """planfly run: plan, flight and verdict."""

    schema: Literal["planfly.run/1"] = "planfly.run/1"
    exit_code: int
    scenario: str
    seed: int
    folder: str
    """Where the files are."""
    files: list[str]
    """Their names in the folder."""
    rounds: list[RoundAnswer]
    """With --refine: each round, the last one's results in the folder itself."""
    verdict: VerdictDocument


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class PlanAnswer:
    """planfly plan: the plan file, and what it comes to."""

    schema: Literal["planfly.plan-answer/1"] = "planfly.plan-answer/1"
    exit_code: int
    scenario: str
    seed: int
    file: str
    safe: bool
    feasible: bool
    waypoints: int
    length_ratio: float
    """Length over that of the straight line."""
    algorithm: str
    evaluations: int
    ended: str
    """completed, budget or interrupted."""
    problems: list[str]
    """What of the plan is not feasible."""
    conditions: ConditionsDocument
    """What it is for."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class FlyAnswer:
    """planfly fly: the log and the verdict."""

    schema: Literal["planfly.fly/1"] = "planfly.fly/1"
    exit_code: int
    mission: str
    seed: int
    log: str | None
    """The flight log, null where nothing was flown."""
    autopilot_log: str | None
    """The program's own."""
    warnings: list[str]
    verdict: VerdictDocument


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ExportedFile:
    """A file that was written."""

    file: str
    content: str
    """What it holds, in words."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ExportAnswer:
    """planfly export: what was written."""

    schema: Literal["planfly.export/1"] = "planfly.export/1"
    exit_code: int
    files: list[ExportedFile]
    warnings: list[str]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class TimelineEvent:
    """One thing that happened in a flight."""

    time_s: float
    kind: str
    """leg, turn, threat, ..."""
    text: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ReplayAnswer:
    """planfly replay: the timeline."""

    schema: Literal["planfly.replay/1"] = "planfly.replay/1"
    exit_code: int
    log: str
    complete: bool
    """Whether the log has its end."""
    end_s: float
    """How long it goes."""
    timeline: list[TimelineEvent]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class RecoverAnswer:
    """planfly recover: the new log."""

    schema: Literal["planfly.recover/1"] = "planfly.recover/1"
    exit_code: int
    log: str | None
    """The new log, null where the old one is complete."""
    rows: int | None
    end_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ReportAnswer:
    """planfly report: the files, and the verdict of the log; no verdict with --layout."""

    schema: Literal["planfly.report/1"] = "planfly.report/1"
    exit_code: int
    files: list[str]
    verdict: VerdictDocument | None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class QuantityPair:
    """One quantity of two flights; null where a flight has none."""

    name: str
    unit: str
    first: float | None
    second: float | None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class CompareAnswer:
    """planfly compare: both flights' quantities."""

    schema: Literal["planfly.compare/1"] = "planfly.compare/1"
    exit_code: int
    names: list[str]
    flyable: list[bool]
    quantities: list[QuantityPair]
    notes: list[str]
    files: list[str]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ImportAnswer:
    """planfly import: the log, and the verdict on its flight."""

    schema: Literal["planfly.import/1"] = "planfly.import/1"
    exit_code: int
    log: str
    rows: int
    verdict: VerdictDocument


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ReflyAnswer:
    """planfly refly: where model and flight differ, in lines, and the files."""

    schema: Literal["planfly.refly/1"] = "planfly.refly/1"
    exit_code: int
    lines: list[str]
    files: list[str]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class CauseEntry:
    """What can take the aircraft off its mission."""

    name: str
    does: str
    """return, land, autoland, on, circle, glide, parachute, terminate, level, guided, landed or never."""
    parameter: str
    """That decides it; empty where none does."""
    value: int


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ReturnEntry:
    """Seconds in a row whose returns go to the same place and come to the same; numbers are of the worst of them."""

    first_s: float
    last_s: float
    count: int
    kind: str
    """ground, threat, zone, lost, energy, unknown, unsure, low or safe."""
    target: str
    """home, or a rally point by its number, or a landing sequence by its first item."""
    reason: str
    """Why there; empty where there is nothing to choose."""
    worst_at_s: float
    clearance_m: float | None
    clearance_east_m: float | None
    clearance_north_m: float | None
    outside_m: float | None
    """Least distance outside a missile's sphere; null where there is none."""
    threat: str | None
    zone: str | None
    energy_wh: float | None
    left_wh: float | None
    text: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class RallyEntry:
    """A rally point."""

    lat_deg: float
    lon_deg: float
    over_home_m: float


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ReturnSuggestion:
    """What would help."""

    parameters: dict[str, float]
    rally: list[RallyEntry] | None
    """In place of the mission's rally points; null leaves those."""
    safe: int
    unsafe: int
    headline: str
    """What the returns come to with it."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class GlideEntry:
    """Seconds in a row from which the same can be reached without the engine; numbers are of the one with the least."""

    first_s: float
    last_s: float
    count: int
    reach: str
    """home, site, flat, nothing or unknown."""
    site: int | None
    """Which of the sites; null for none."""
    least_at_s: float
    left_m: float | None
    """Height left over, negative where it is missing; null where no way leads anywhere."""
    flat_east_m: float | None
    """Flat ground that can be reached; null for none."""
    flat_north_m: float | None
    own: str
    """What ArduPlane's own return comes to: arrives, low, ground, threat, unknown or not flown."""
    own_target: str
    own_over_m: float | None
    """Height over the ground at its target; null where it does not arrive."""
    own_short_m: float | None
    """From where it comes down to its target; null where it does not."""
    text: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class GlideSiteEntry:
    """A place that can be glided to."""

    kind: str
    """home, rally or landing."""
    number: int
    """Of the rally point, or the mission item."""
    east_m: float
    north_m: float


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class GlidesEntry:
    """What can be reached without the engine."""

    headline: str
    not_judged: str
    """terrain or far; empty where it is judged."""
    airspeed_mps: float
    """Equivalent, that glides are flown at."""
    margin_m: float
    cell_m: float | None
    sites: list[GlideSiteEntry]
    home: int
    """From how many places home can be reached; the next four are of those from which it cannot."""
    site: int
    flat: int
    nothing: int
    unknown: int
    own_arrives: int
    """From how many ArduPlane's own return arrives."""
    ranges: list[GlideEntry]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ReturnsAnswer:
    """planfly returns: the returns in ranges of seconds, the worst first."""

    schema: Literal["planfly.returns/1"] = "planfly.returns/1"
    exit_code: int
    what: str
    headline: str
    safe: bool
    conditions: ConditionsDocument
    every_s: float
    least_clearance_m: float
    causes: list[CauseEntry]
    rtl_autoland: int | None
    """ArduPlane's parameter; null by another autopilot's law."""
    not_judged: list[str]
    """What leaves the returns open: terrain, law, autoland, return path or landing; empty where nothing does."""
    ranges: list[ReturnEntry]
    no_return: str
    """By energy: never, later (than no_return_s), at once; or why it is not known: battery, used or arrives."""
    no_return_s: float | None
    engine_out: GlidesEntry
    suggestions: list[ReturnSuggestion]
    """Of --suggest."""
    notes: list[str]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class PhotoLineEntry:
    """A photo line, as flown; all but its items null where it was not.  Shares are of its length."""

    first_item: int
    last_item: int
    length_m: float | None
    usable: float | None
    away: float | None
    """Not flown along, or too far beside the line; of the rest, banked too much; then too far off its height over
    ground; then with the camera off."""
    banked: float | None
    high: float | None
    dark: float | None
    lost_m: list[tuple[float, float]]
    """Stretches that cannot be used, from its begin."""
    photos: int | None
    missed: int | None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class SurveyRemedyEntry:
    """A change with which the survey was flown, and all lines can be used."""

    kind: str
    """side, turn-around, every, course, parameter or airspeed."""
    name: str
    """Of the parameter."""
    current: float
    value: float
    unit: str
    turn_around_m: float | None
    """Of another layout."""
    lead_in_m: float
    """Before its first line, where that is more."""
    length_m: float
    """Of the way."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class OverlapEntry:
    """The least overlap of a survey's photos that can be used, as shares of a photo; null where it is not known."""

    front: float | None
    """Of a photo and the next on its line."""
    front_asked: float | None
    front_line: int | None
    """The line's number, from 1."""
    side: float | None
    """Of photos of neighbouring lines."""
    side_asked: float | None
    side_lines: tuple[int, int] | None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class NearMissEntry:
    """What was tried, came nearest, and does not pass."""

    what: str
    usable: int
    lines: int
    headline: str
    """Of the verdict on its flight."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class SurveyAnswer:
    """planfly survey: each survey's photo lines, in flying order."""

    schema: Literal["planfly.survey/1"] = "planfly.survey/1"
    exit_code: int
    what: str
    headline: str
    usable: bool
    conditions: ConditionsDocument
    surveys: list[list[PhotoLineEntry]]
    overlaps: list[OverlapEntry | None]
    """Of each survey; null where its camera is not known."""
    remedies: list[SurveyRemedyEntry]
    """Of --suggest."""
    nearest: NearMissEntry | None
    """Where it found none."""
    files: list[str]


def photo_line_entry(setup: FlightSetup, line: PhotoLine, one: LineMeasure | None) -> PhotoLineEntry:
    """A photo line as an answer has it."""
    first, last = (int(setup.route.items[i]) for i in (line.first, line.last))

    def share(value: float | None) -> float | None:
        return None if value is None else round(value, 4)

    return PhotoLineEntry(
        first_item=first,
        last_item=last,
        length_m=None if one is None else round(one.length, 1),
        usable=share(None if one is None else one.good),
        away=share(None if one is None else one.away),
        banked=share(None if one is None else one.banked),
        high=share(None if one is None else one.high),
        dark=share(None if one is None else one.dark),
        lost_m=[] if one is None else [(round(low, 1), round(high, 1)) for low, high in one.lost],
        photos=None if one is None else one.photos,
        missed=None if one is None else one.missed,
    )


def overlap_entry(one: OverlapMeasure) -> OverlapEntry:
    """A survey's overlap as an answer has it."""
    low, high = sorted(one.pair)
    return OverlapEntry(
        front=None if one.front is None else round(one.front, 4),
        front_asked=one.camera.front,
        front_line=None if one.front is None else one.line + 1,
        side=None if one.side is None else round(one.side, 4),
        side_asked=one.camera.side,
        side_lines=None if one.side is None else (low + 1, high + 1),
    )


def near_miss_entry(one: NearMiss) -> NearMissEntry:
    """What came nearest as an answer has it."""
    return NearMissEntry(what=one.what, usable=one.usable, lines=one.lines, headline=one.verdict.headline)


def survey_remedy_entry(one: SurveyRemedy) -> SurveyRemedyEntry:
    """What would help as an answer has it."""
    return SurveyRemedyEntry(
        kind=one.kind, name=one.name, current=round(one.current, 3), value=round(one.value, 3), unit=one.unit,
        turn_around_m=None if math.isnan(one.turn_around) else round(one.turn_around, 1), lead_in_m=one.lead_in,
        length_m=round(one.length, 1),
    )  # fmt: skip


def suggestion_entry(found: ReturnsFound, one: Suggested) -> ReturnSuggestion:
    """A suggestion as an answer has it."""
    rally = None
    if one.remedy.rally is not None:
        rally = []
        for point in one.remedy.rally:
            lat, lon = (float(value) for value in to_geo(found.setup.scenario.origin, point.east, point.north))
            rally.append(
                RallyEntry(lat_deg=round(lat, 7), lon_deg=round(lon, 7), over_home_m=round(point.up - point.base, 1))
            )
    return ReturnSuggestion(
        parameters=one.remedy.parameters,
        rally=rally,
        safe=one.returns.count("safe"),
        unsafe=len(one.returns.each) - one.returns.count("safe"),
        headline=headline(one.returns),
    )


def _tenths(value: float) -> float | None:
    """A number as an answer has it; None for none."""
    return round(value, 1) if math.isfinite(value) else None


def glides_entry(found: ReturnsFound) -> GlidesEntry:
    """What can be reached without the engine as an answer has it."""
    glides = found.glides
    entries = []
    for group in glides.ranges:
        one = group.least
        entries.append(
            GlideEntry(
                first_s=round(group.first, 2),
                last_s=round(group.last, 2),
                count=group.count,
                reach=one.reach,
                site=group.site if group.site >= 0 else None,
                least_at_s=round(one.time, 2),
                left_m=_tenths(glides.spare(one)),
                flat_east_m=_tenths(one.flat_at[0]),
                flat_north_m=_tenths(one.flat_at[1]),
                own=one.own.end,
                own_target=one.own.target.name,
                own_over_m=_tenths(one.own.over),
                own_short_m=_tenths(one.own.short),
                text=glide_range_text(group, glides),
            )
        )
    return GlidesEntry(
        headline=glides_headline(glides),
        not_judged=glides.not_judged,
        airspeed_mps=glides.airspeed,
        margin_m=MARGIN,
        cell_m=_tenths(glides.cell),
        sites=[
            GlideSiteEntry(kind=one.kind, number=one.number, east_m=round(one.east, 1), north_m=round(one.north, 1))
            for one in glides.sites
        ],
        own_arrives=glides.arrivals,
        home=glides.count("home"),
        site=glides.count("site"),
        flat=glides.count("flat"),
        nothing=glides.count("nothing"),
        unknown=glides.count("unknown"),
        ranges=entries,
    )


def return_entry(found: ReturnsFound, group: ReturnRange) -> ReturnEntry:
    """A range of returns as an answer has it."""
    one, scenario, number = group.worst, found.setup.scenario, _tenths

    return ReturnEntry(
        first_s=round(group.first, 2),
        last_s=round(group.last, 2),
        count=group.count,
        kind=one.kind,
        target=one.target.name,
        reason=one.target.reason,
        worst_at_s=round(one.time, 2),
        clearance_m=number(one.clearance),
        clearance_east_m=number(one.clearance_at[0]),
        clearance_north_m=number(one.clearance_at[1]),
        outside_m=number(one.outside),
        threat=scenario.threats.names[one.threat] if one.kind == "threat" else None,
        zone=found.returns.airspace.zones[one.zone].name if one.zone >= 0 else None,
        energy_wh=number(one.energy),
        left_wh=number(one.left),
        text=range_text(group, found.returns, scenario),
    )


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class PaperRow:
    """The plans of one algorithm for one problem of the paper."""

    threats: int
    algorithm: str
    runs: int
    safe: int
    certified: int
    length_median: float | None
    length_worst: float | None
    kill_median: float
    kill_worst: float
    kill_probability_worst: float
    detection_median: float
    seconds_median: float


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class PaperAnswer:
    """planfly paper: the table."""

    schema: Literal["planfly.paper-answer/1"] = "planfly.paper-answer/1"
    exit_code: int
    folder: str
    rows: list[PaperRow]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class NewAnswer:
    """planfly new: the scenario's file, and what planning it comes to."""

    schema: Literal["planfly.new/1"] = "planfly.new/1"
    exit_code: int
    file: str
    safe: bool
    waypoints: int


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class TerrainAnswer:
    """planfly terrain: the file, and what it is from."""

    schema: Literal["planfly.terrain/1"] = "planfly.terrain/1"
    exit_code: int
    file: str
    rows: int
    columns: int
    tiles: list[str]
    absent: list[list[int]]
    """South-west corners, degrees, of what the server has no tile of."""
    empty_pixels: int
    """Pixels without data."""
    fetched_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ScenarioEntry:
    """An embedded scenario."""

    name: str
    description: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ScenariosAnswer:
    """planfly scenarios: those that there are."""

    schema: Literal["planfly.scenarios/1"] = "planfly.scenarios/1"
    exit_code: int
    scenarios: list[ScenarioEntry]
