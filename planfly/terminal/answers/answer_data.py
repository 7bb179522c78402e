"""What each command answers with ``--json``.  Paths are as the command names them; numbers carry their unit."""

from typing import Literal

from pydantic.dataclasses import dataclass

from planfly.terminal.answers.verdict_document import STRICT, VerdictDocument


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
    """A real autopilot's own."""
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
    """The new log, null where the old one is whole."""
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
