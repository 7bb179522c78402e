"""What a command leaves: lines on the terminal, and files."""

import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from flight.mission.items import Mission
from flight.mission_files.formats import mission_kind, mission_text
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import FlightLog, LogEvent
from logs.verdict.findings import Finding, Verdict, verdict_json
from logs.verdict.judge_flight import judge_flight
from logs.verdict.rule import Rule
from logs.verdict.rules.registry import RULES
from logs.verdict.wording import place_text, quantity_text, suggestions_text
from planfly.terminal.command_parser import coloured
from world.errors import PlanflyError
from world.files import write_whole

# ----------------------------------------------------------------------
# Targets on disk: refused where they exist, cleared where they are ours.

RESULTS = Path("runs")
RUN_FILES = (
    "plan.json",
    "mission.waypoints",
    "mission.plan",
    "flight.mcap",
    "flight.BIN",
    "verdict.json",
    "map.png",
    "profile.png",
    "scene.png",
    "turns.png",
    "envelope.png",
    "report.html",
)


_FIGURES = ("map", "profile", "scene", "turns", "envelope")
# What `report` and `compare` may write, figures as SVG included.
LOG_FIGURES = ("report.html", *(f"{name}.{kind}" for name in _FIGURES for kind in ("png", "svg")))
# Stretches of a flight that are flown again, and what is written of each: of those after the first with its number.
REFLOWN = 9
REFLY_FILES = tuple(
    name
    for ending in ("", *(f"-{number}" for number in range(2, REFLOWN + 1)))
    for name in (
        f"simulated{ending}.mcap",
        *(f"refly-{kind}{ending}.png" for kind in ("cross-track", "height", "ground-speed", "bank", "energy")),
    )
)
COMPARE_FILES = (
    "compare.html",
    *(f"compare-{name}.{kind}" for name in ("map", "profile") for kind in ("png", "svg")),
)


def refuse_existing(path: Path, overwrite: bool, source: Path | None = None, *, ask: str = "--overwrite") -> None:
    """Refuse a named target file that exists, is a folder, cannot be made, or is the input.  Raises PlanflyError.

    ask: what a person writes to have it replaced.
    """
    if source is not None and path.exists() and source.exists() and path.samefile(source):
        raise PlanflyError(f"{path}: is the input itself; name another file to write", file=path)
    if path.is_dir():
        raise PlanflyError(f"{path}: is a folder; a file name is expected", file=path)
    if path.exists() and not overwrite:
        raise PlanflyError(f"{path}: exists; {ask} replaces it", file=path)
    if not path.parent.exists():
        raise PlanflyError(f"{path}: its folder {path.parent} does not exist", file=path)


def refuse_folder(folder: Path, overwrite: bool, *, ask: str = "--overwrite") -> None:
    """Refuse a named target folder that is a file or holds anything; ask: as above.  Raises PlanflyError."""
    if folder.exists() and not folder.is_dir():
        raise PlanflyError(f"{folder}: is a file; a folder is expected", file=folder)
    if not overwrite and folder.is_dir() and any(folder.iterdir()):
        raise PlanflyError(f"{folder}: exists and is not empty; {ask} replaces its results", file=folder)


def prepare_folder(folder: Path, files: tuple[str, ...] = RUN_FILES) -> None:
    """Make a folder and clear old results of ours: what the command writes, never anything else that lies there."""
    folder.mkdir(parents=True, exist_ok=True)
    rounds = sorted(folder.glob("round-[0-9]*")) if files is RUN_FILES else []
    if files is RUN_FILES:
        (folder / "rounds.json").unlink(missing_ok=True)
    for directory in (folder, *rounds):
        for name in files:
            (directory / name).unlink(missing_ok=True)
        if directory != folder and not any(directory.iterdir()):
            directory.rmdir()


def default_folder(name: str, seed: int) -> Path:
    """Where results go that nobody named a folder for: ``runs/<name>-seed<N>``."""
    safe = "".join(letter if letter.isalnum() or letter in "-_." else "-" for letter in name).lstrip(".") or "run"
    return RESULTS / f"{safe}-seed{seed}"


def named_or_default(named: str | None, default: Path, overwrite: bool, source: Path) -> Path:
    """The target file that was named, or the default, which is replaced.

    source: the input, which no target may be.  Raises PlanflyError for a named one that `refuse_existing` refuses.
    """
    if named is None:
        return default
    target = Path(named)
    refuse_existing(target, overwrite, source)
    return target


# Failed findings that are listed one by one.
_LISTED = 12
# Sources of a limit that are named beside it; any other limit is a check of planfly's own.
_LIMIT_SOURCES = ("scenario", "aircraft", "autopilot", "mission")
# Width of the column of rules.
_TITLES = 2 + max(len(rule.title) for rule in RULES.values())


def print_verdict(verdict: Verdict, notes: Iterable[str]) -> None:
    """The verdict on the terminal: the summary, then what fails, then what is closest to each rule's limit."""
    first, *rest = verdict.lines or ("",)
    print(coloured(first, "good" if verdict.flyable else "bad"))
    for line in rest:
        print(line)
    failed = [finding for finding in verdict.findings if finding.ok is False]
    for finding in failed[:_LISTED]:
        print(coloured("  failed  ", "bad") + f"{_noun(finding)} at {place_text(finding.place)}: {finding.reason}")
        if finding.suggestions:
            print(coloured("          would pass: ", "hint") + suggestions_text(finding.suggestions))
    if len(failed) > _LISTED:
        print(coloured("  failed  ", "bad") + f"and {len(failed) - _LISTED} more")
    for rule in RULES.values():
        mine = [finding for finding in verdict.findings if finding.rule == rule.name]
        if mine:
            print(f"  {rule.title:<{_TITLES}}{_state(rule, mine)}")
    for note in notes:
        print(f"  note    {note}")


def _noun(finding: Finding) -> str:
    rule = RULES[finding.rule]
    return rule.noun or rule.name


def _state(rule: Rule, findings: list[Finding]) -> str:
    """How the findings of a rule stand, and the one closest to its limit."""
    failed = sum(finding.ok is False for finding in findings)
    unknown = [finding for finding in findings if finding.ok is None]
    judged = len(findings) - len(unknown)
    if not judged:
        return f"not judged: {unknown[0].reason}"
    text = f"{judged - failed} of {judged} ok"
    with_margin = [(one.margin, one) for one in findings if one.margin is not None and one.ok is not None]
    if not with_margin or rule.margin is None:
        return text
    closest = min(with_margin, key=lambda one: one[0])[1]
    value = closest.planned if closest.flown is None else closest.flown
    if value is None or closest.limit is None:
        return text
    where = "" if closest.place.kind == "flight" else f"closest to its limit at {place_text(closest.place)}: "
    limit = quantity_text(closest.limit, closest.unit)
    whose = (
        f", {closest.limit_source}" if closest.limit_source in ("scenario", "aircraft", "autopilot", "mission") else ""
    )
    return f"{text}; {where}{rule.margin.of} {quantity_text(value, closest.unit)} (limit {limit}{whose})"


def print_warnings(warnings: Iterable[str]) -> None:
    """Warnings, on standard error."""
    for warning in warnings:
        print(coloured("warning:", "warning", sys.stderr) + f" {warning}", file=sys.stderr)


def write_missions(mission: Mission, targets: Iterable[Path]) -> None:
    """A mission in the form that each target's suffix names."""
    for target in targets:
        write_whole(target, mission_text(mission, mission_kind(target)))


def write_verdict(path: Path, verdict: Verdict) -> None:
    """``verdict.json``."""
    write_whole(path, verdict_json(verdict))


def write_pictures(
    folder: Path,
    setup: FlightSetup,
    track: Track,
    verdict: Verdict,
    ended: str | None,
    command: str,
    versions: Mapping[str, str] | None = None,
    events: Sequence[LogEvent] = (),
    *,
    svg: bool = False,
) -> list[Path]:
    """The figures and report.html; svg: the figures as SVG, too."""
    from logs.recording.setup_attachments import package_versions
    from logs.views.report.page import write_report

    flown_with = package_versions() if versions is None else versions
    return write_report(
        folder, setup, track, verdict, ended=ended, versions=flown_with, command=command, events=events, svg=svg
    )


# ----------------------------------------------------------------------
# A flight log as commands meet it: judged as it stands, with a warning where it is cut short.

# How a flight ended whose log does not hold its end.
CUT_SHORT = "the log ends before the flight does"


def judge_log(log: FlightLog) -> Verdict:
    """The verdict on a log's flight, of the rows it holds."""
    return judge_flight(log.setup, log.track, log.ended or CUT_SHORT, whole=log.complete, reference=log.reference)


def warn_of_loss(log: FlightLog) -> None:
    """What is missing in a log that is not complete, on standard error."""
    print_warnings([f"{log.source}: incomplete: {log.problem}; it ends at {log.end_time:.1f} s"])
