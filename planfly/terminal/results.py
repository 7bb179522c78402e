"""What a command leaves: lines on the terminal, and files."""

import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from flight.mission.items import Mission
from flight.mission_files.formats import mission_kind, mission_text
from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import LogEvent
from logs.verdict.findings import RULES, Finding, Verdict, verdict_json
from logs.verdict.wording import place_text, suggestions_text
from planfly.terminal.colour import coloured
from world.atomic_files import write_whole

# Failed findings that are listed one by one.
_LISTED = 12


def print_verdict(verdict: Verdict, notes: Iterable[str]) -> None:
    """The verdict on the terminal: the summary first, then what fails, then the tightest finding of each rule."""
    first, *rest = verdict.lines or ("",)
    print(coloured(first, "good" if verdict.flyable else "bad"))
    for line in rest:
        print(line)
    failed = [finding for finding in verdict.findings if finding.ok is False]
    for finding in failed[:_LISTED]:
        print(coloured("  failed  ", "bad") + f"{finding.rule} at {place_text(finding.place)}: {finding.reason}")
        if finding.suggestions:
            print(coloured("          would pass: ", "hint") + suggestions_text(finding.suggestions))
    if len(failed) > _LISTED:
        print(coloured("  failed  ", "bad") + f"and {len(failed) - _LISTED} more")
    for rule, title in RULES.items():
        mine = [finding for finding in verdict.findings if finding.rule == rule]
        if mine:
            print(f"  {title:<13}{_state(mine)}")
    for note in notes:
        print(f"  note    {note}")


def _state(findings: list[Finding]) -> str:
    failed = sum(finding.ok is False for finding in findings)
    unknown = [finding for finding in findings if finding.ok is None]
    judged = len(findings) - len(unknown)
    if not judged:
        return f"not judged: {unknown[0].reason}"
    text = f"{judged - failed} of {judged} ok"
    with_margin = [finding for finding in findings if finding.margin is not None and finding.ok is not None]
    if with_margin:
        tightest = min(with_margin, key=lambda finding: finding.margin if finding.margin is not None else 0.0)
        value = tightest.flown if tightest.flown is not None else tightest.planned
        if value is not None and tightest.limit is not None:
            text += (
                f"; tightest at {place_text(tightest.place)}: {_figures(value)} {tightest.unit}"
                f" against {_figures(tightest.limit)} ({tightest.limit_source})"
            )
    return text


def _figures(value: float) -> str:
    # Four figures, and no power of ten: a tank of fuel holds 1140000 Wh.
    return f"{value:.4g}" if abs(value) < 1e4 else f"{value:.0f}"


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
    from logs.report.page import write_report

    flown_with = package_versions() if versions is None else versions
    return write_report(
        folder, setup, track, verdict, ended=ended, versions=flown_with, command=command, events=events, svg=svg
    )
