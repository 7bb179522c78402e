"""Define the answers of the commands with ``--json``.

Paths are written as the user named them; the names of numbers contain their units.
"""

import math
from typing import Any, Literal

from pydantic.dataclasses import dataclass

from aircraft.catalog import Aircraft
from logs.verdict.conditions import Conditions
from logs.verdict.document import VerdictDocument
from planfly.api.aircraft import AircraftNumbers
from planfly.terminal.verdict_answers import STRICT

# ----------------------------------------------------------------------
# Answer of ``planfly aircraft`` with ``--json``.


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class TrimEntry:
    """Level flight at one airspeed."""

    airspeed_mps: float
    alpha_deg: float
    elevator_deg: float
    throttle: float
    power_w: float
    endurance_s: float | None
    """Flight time on 80 % of the energy carried, s."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ModeEntry:
    """A dynamic mode in cruise, with its root.

    Of a conjugate pair, the root has the positive imaginary part.
    """

    name: str
    root_real_1_s: float
    root_imaginary_1_s: float


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class AircraftDetail:
    """Quantities computed for one aircraft."""

    model_sha256: str
    level_speed_min_mps: float
    """Lowest airspeed of level flight at sea level, m/s."""
    level_speed_max_mps: float
    trims: list[TrimEntry]
    modes: list[ModeEntry]
    lacking: list[str]
    """Files that a flight needs, but that the aircraft's folder does not contain."""
    files: list[str]
    """Pictures that were written."""


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
    """Null in a list of aircraft."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class AircraftAnswer:
    """planfly aircraft: the named or made aircraft, or all built-in ones."""

    schema: Literal["planfly.aircraft/1"] = "planfly.aircraft/1"
    exit_code: int
    aircraft: list[AircraftEntry]


def aircraft_entry(aircraft: Aircraft, detail: AircraftDetail | None) -> AircraftEntry:
    """Return the JSON entry of an aircraft, with its metadata.

    detail: quantities computed for the aircraft; None in a list of aircraft.
    """
    return AircraftEntry(
        name=aircraft.name,
        title=aircraft.title,
        folder=str(aircraft.folder),
        mass_kg=aircraft.mass,
        wing_area_m2=aircraft.wing_area,
        wing_span_m=aircraft.wing_span,
        airspeed_mps=aircraft.airspeed,
        airspeed_min_mps=aircraft.airspeed_min,
        airspeed_max_mps=aircraft.airspeed_max,
        stall_speed_mps=aircraft.stall_speed,
        max_bank_deg=round(math.degrees(aircraft.max_bank), 9),
        detail=detail,
    )


def aircraft_detail(numbers: AircraftNumbers) -> AircraftDetail:
    """Return the JSON entry of the quantities computed for an aircraft."""
    min_speed, max_speed = numbers.envelope.level_speeds(0.0)
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
        level_speed_min_mps=float(min_speed),
        level_speed_max_mps=float(max_speed),
        trims=trims,
        modes=modes,
        lacking=list(numbers.lacking),
        files=[str(file) for file in numbers.files],
    )


# ----------------------------------------------------------------------
# Answers of ``planfly campaign`` and ``planfly winds``: the exit code, and the content of summary.json or winds.json.


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class FailedPlace:
    """Number of flights that failed a rule at a place; the place is stated as in a finding of a verdict."""

    where: str
    flights: int
    kind: str
    index: int | None
    item: int | None
    name: str
    to_item: int | None = None
    number: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class FailedRule:
    """Number of flights that failed a rule, in total and at each place."""

    rule: str
    flights: int
    places: list[FailedPlace]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class DispersedFlights:
    """Flights of a finished plan with the default dispersions (``--flights N``)."""

    flights: int
    flyable: int
    probability: float
    """Fraction of flyable flights."""
    interval: list[float]
    """Two-sided interval of the probability at 95 %."""
    holds: bool
    """False if the upper end of the interval is below 0.95."""
    deciding_rule: str
    """Rule that the most flights failed; if none failed, the rule with the smallest margin relative to its scatter."""
    failed_by_rule: list[FailedRule]
    remedies: list[str]
    """Changes that would raise the probability."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class SensitivityEntry:
    """Fraction of the deciding margin's variance that a quantity explains."""

    quantity: str
    first_order: float | None
    rank_slope: float | None
    p_value: float | None
    """Probability of such a dependence by chance."""
    shown: bool
    """True if the index is distinguishable from zero, with all quantities considered."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class TiedRule:
    """Rule that as many flights failed as the deciding rule."""

    deciding_rule: str
    margin_of_one_in_twenty: float | None
    margin_unit: str
    sensitivities: list[SensitivityEntry]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ClosestRule:
    """Rule in the ranking by how close the flights came to failing it."""

    rule: str
    failed: int
    """Number of flights that failed the rule."""
    smallest_margin: float | None
    """Smallest margin of all flights; it may be negative without a failure, within the rule's tolerance."""
    margin_of_one_in_twenty: float | None
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class CampaignDocument:
    """planfly campaign: the probability that a mission is flyable."""

    schema: Literal["planfly.campaign-summary/1"]
    exit_code: int
    name: str
    seed: int
    target: float | None
    """Requested probability."""
    answer: str
    """reached, missed, undecided, or "no target" if no probability was requested."""
    deciding_flights: int | None
    """Number of flights that would decide an undecided target with the same fraction of flyable flights."""
    unjudged_return: str
    """Reason why the return after the last item is not judged in any flight; empty if it is judged."""
    flights: int
    flyable: int
    not_flyable: int
    undecided: int
    """Flights that are not judged in full; the lower bound counts them as not flyable, the upper bound as flyable."""
    not_judged: str
    """Reason why the first undecided flight is not judged in full; empty if there is none."""
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
    tied_rules: list[TiedRule]
    """Other rules that as many flights failed as the deciding rule."""
    closest_rules: list[ClosestRule]
    """Rules that flights failed, the most flights first, then the others, the closest to their limits first."""
    worst: list[dict[str, Any]]
    spread: dict[str, Any]
    conditions: Conditions
    """Nominal conditions, which the draws of each flight vary."""
    made_of: str
    """Hash of the inputs of all flights of the campaign."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class WindFlights:
    """Flights in one wind."""

    speed_mps: float
    flights: int
    flyable: int


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class WindDirection:
    """Boundary of the wind from one direction."""

    from_deg: float
    boundary_mps: float
    interval_mps: list[float]
    beyond: bool
    """True if the mission is flyable in every wind that was flown."""
    flown_bounds_mps: list[float | None]
    """Strongest wind without a failure up to it, and weakest wind with a failure; null if there is none."""
    judged: bool
    """False if the boundary depends mostly on assumptions, because there are too few flights."""
    reason: str
    """Reason why the boundary is not judged; "" if it is judged."""
    flown: list[WindFlights]
    failed_by_rule: list[FailedRule]
    """Failures of the flights in winds up to the upper bound of the interval; the rule with most flights decides."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class CalmFlights:
    """Flights in the weakest wind that was flown.

    They are from the directions in which the mission fails even in calm air.
    """

    speed_mps: float
    flights: int
    not_flyable: int
    failed_by_rule: list[FailedRule]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class WindsDocument:
    """planfly winds: the largest wind from each direction."""

    schema: Literal["planfly.winds/2"]
    exit_code: int
    name: str
    seed: int
    target: float
    answer: str
    """judged, not judged in full, not judged, or "not flyable" if the mission misses the target even in calm air."""
    reason: str
    """Reason why the search or some of its directions are not judged; "" if all are judged."""
    confidence: float
    most: float
    """Strongest wind that was flown, m/s."""
    flights: int
    lost: list[int]
    """Flights without an outcome, numbered from 0 in the order of their requests; counted as not flyable."""
    directions: list[WindDirection]
    calm: CalmFlights | None
    """Failures in calm air, if the mission is not flyable in calm air with the target probability."""
    spread: dict[str, Any]
    conditions: Conditions
    """Nominal conditions, except the wind, which is the result."""


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
    headline: str
    """The verdict in one line."""
    seed: int
    folder: str
    """Folder of the written files."""
    files: list[str]
    """Names of the written files in the folder."""
    rounds: list[RoundAnswer]
    """With --refine: each round; the results of the last round are in the folder itself."""
    verdict: VerdictDocument
    dispersed: DispersedFlights | None
    """Dispersed flights of the plan (--flights); null without this option or without a feasible plan."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ExportedFile:
    """A written file."""

    file: str
    content: str
    """Description of the contents."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ExportAnswer:
    """planfly export: the written files."""

    schema: Literal["planfly.export/1"] = "planfly.export/1"
    exit_code: int
    files: list[ExportedFile]
    warnings: list[str]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class TimelineEvent:
    """One event of a flight."""

    time_s: float
    kind: str
    """Kind of the event: leg, turn, threat, ..."""
    text: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ReplayAnswer:
    """planfly replay: the timeline."""

    schema: Literal["planfly.replay/1"] = "planfly.replay/1"
    exit_code: int
    log: str
    complete: bool
    """True if the log is complete to its end."""
    end_s: float
    """Time of the last entry, s."""
    timeline: list[TimelineEvent]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class RecoverAnswer:
    """planfly recover: the new log."""

    schema: Literal["planfly.recover/1"] = "planfly.recover/1"
    exit_code: int
    log: str | None
    """Path of the new log; null if the old log is complete."""
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
    """One quantity of two flights; null if a flight does not have it."""

    name: str
    unit: str
    first: float | None
    second: float | None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class CompareAnswer:
    """planfly compare: the quantities of both flights."""

    schema: Literal["planfly.compare/1"] = "planfly.compare/1"
    exit_code: int
    names: list[str]
    flyable: list[bool]
    quantities: list[QuantityPair]
    notes: list[str]
    files: list[str]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ComparedCampaignEntry:
    """One of two campaigns."""

    name: str
    flights: int
    flyable: int
    probability: float
    interval: list[float]
    """Two-sided interval of the probability, at 95 % confidence."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ChangedRule:
    """Number of flights of each campaign that failed a rule."""

    rule: str
    first: int
    second: int


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class CompareCampaignsAnswer:
    """planfly compare: the probabilities of two campaigns."""

    schema: Literal["planfly.compare-campaigns/1"] = "planfly.compare-campaigns/1"
    exit_code: int
    answer: str
    """Flights of the second campaign are "more likely" or "less likely" to be flyable, or "no difference shown"."""
    campaigns: list[ComparedCampaignEntry]
    difference: float
    """Probability of the second campaign minus that of the first."""
    interval: list[float]
    """Two-sided interval of the difference, at 95 % confidence."""
    p_value: float
    """p-value of McNemar's exact test if the flights are pairs, otherwise of Fisher's exact test."""
    pairs: int
    """Number of flights with the same draws in both campaigns; 0 if the draws differ."""
    only_first: int
    """Number of pairs that are flyable only in the first campaign."""
    only_second: int
    rules: list[ChangedRule]
    """The largest change first."""
    inputs: list[str]
    """Options that differ."""
    notes: list[str]


# Answer of ``planfly compare``, of two logs or of two campaigns.
CompareDocument = CompareAnswer | CompareCampaignsAnswer


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ImportAnswer:
    """planfly import: the log, and the verdict on its flight."""

    schema: Literal["planfly.import/1"] = "planfly.import/1"
    exit_code: int
    log: str
    headline: str
    """The verdict in one line."""
    rows: int
    verdict: VerdictDocument


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ReflyAnswer:
    """planfly refly: the differences between model and flight, in lines, and the files."""

    schema: Literal["planfly.refly/1"] = "planfly.refly/1"
    exit_code: int
    lines: list[str]
    files: list[str]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class PredictedQuantity:
    """A quantity of a prediction; the numbers are null for a quantity that the log does not contain."""

    name: str
    unit: str
    inside: float | None
    half_width: float | None
    unchanged_half_width: float | None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class PredictAnswer:
    """planfly predict: how much of the flight is inside each band of 95 %, and the files."""

    schema: Literal["planfly.predict/1"] = "planfly.predict/1"
    exit_code: int
    by: Literal["controls", "mission"]
    aircraft: str
    start_s: float
    end_s: float
    draws: int
    windows: int
    quantities: list[PredictedQuantity]
    files: list[str]


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

    schema: Literal["planfly.planning.paper-answer/1"] = "planfly.planning.paper-answer/1"
    exit_code: int
    folder: str
    rows: list[PaperRow]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class NewAnswer:
    """planfly new: the file of the scenario, and the result of planning it."""

    schema: Literal["planfly.new/1"] = "planfly.new/1"
    exit_code: int
    file: str
    safe: bool
    waypoints: int


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class TerrainAnswer:
    """planfly terrain: the file, and its source."""

    schema: Literal["planfly.terrain/1"] = "planfly.terrain/1"
    exit_code: int
    file: str
    rows: int
    columns: int
    tiles: list[str]
    absent: list[list[int]]
    """South-west corners, degrees, of the tiles that the server does not have."""
    empty_pixels: int
    """Number of pixels without data."""
    fetched_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ScenarioEntry:
    """A built-in scenario."""

    name: str
    description: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ScenariosAnswer:
    """planfly scenarios: the built-in scenarios."""

    schema: Literal["planfly.scenarios/1"] = "planfly.scenarios/1"
    exit_code: int
    scenarios: list[ScenarioEntry]
