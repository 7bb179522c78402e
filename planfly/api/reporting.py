"""Figures, reports and comparisons of flights, and their missions in other files' forms."""

import argparse
import contextlib
import io
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import FlightLog, LogEvent, read_log
from logs.verdict.findings import Verdict
from logs.verdict.judge_geometry import judge_geometry
from logs.views.report.compare import Comparison, compare_logs
from planfly.api.flying import ExportedFiles, FlownMission, WrittenReport
from planfly.open_mission import open_planned
from planfly.terminal.results import (
    COMPARE_FILES,
    LOG_FIGURES,
    judge_log,
    prepare_folder,
    refuse_existing,
    refuse_folder,
)
from planner.plan import Plan, plan_json
from world.errors import PlanflyError
from world.files import temporary_folder, write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Source = FlightLog | FlownMission | Plan | str | Path
# What a script writes to have results replaced.
_ASK = "overwrite=True"


class _Shown(NamedTuple):
    """What pictures and pages are made of; the versions are those of the packages that flew it, none for today's."""

    setup: FlightSetup
    verdict: Verdict
    track: Track | None = None
    ended: str | None = None
    events: tuple[LogEvent, ...] = ()
    versions: dict[str, str] | None = None


def figures(source: Source) -> "dict[str, Figure]":
    """The pictures of a flight, or of a plan that was not flown, as matplotlib figures by name.

    source: a flight log or its path, what `planfly.fly` gave, or a `Plan`.
    "map", "profile", "scene", "turns", "envelope", and of a flight "time", "exposure", "controls" and "energy".
    Raises a `planfly.PlanflyError` for bad input.

    >>> import planfly
    >>> drawn = planfly.figures(planfly.plan("tight", seed=1))
    >>> type(drawn["map"])
    <class 'matplotlib.figure.Figure'>
    """
    # matplotlib loads for pictures alone.
    from logs.views.figures import draw_figures

    shown = _shown(source)
    return draw_figures(shown.setup, shown.track, shown.verdict)


def report(source: Source, out: str | Path, *, svg: bool = False, overwrite: bool = False) -> WrittenReport:
    """Write ``report.html`` and its figures into a folder, made if it is missing.

    source: as of `planfly.figures`.  out: the folder.  svg: the figures as SVG, too.
    overwrite: whether results that lie there may be replaced.
    Raises a `planfly.PlanflyError` for bad input, and for a folder that holds anything.

    >>> import planfly, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = planfly.report(planfly.plan("tight", seed=1), folder)
    >>> written.page.name, len(written.files)
    ('report.html', 6)
    """
    from logs.recording.setup_attachments import package_versions
    from logs.views.report.page import write_report

    shown = _shown(source)
    folder = _prepared(out, LOG_FIGURES, overwrite)
    files = write_report(
        folder, shown.setup, shown.track, shown.verdict, ended=shown.ended, events=shown.events, svg=svg,
        versions=shown.versions or package_versions(), command="planfly.report",
    )  # fmt: skip
    return WrittenReport(folder / "report.html", tuple(files))


def compare(first: FlightLog | str | Path, second: FlightLog | str | Path, out: str | Path | None = None, *,
            svg: bool = False, overwrite: bool = False) -> Comparison:  # fmt: skip
    """Two flights judged and measured alike.

    first, second: flight logs, or their paths.
    out: a folder for ``compare.html`` and its pictures; None draws none.  svg, overwrite: as of `planfly.report`.
    Raises a `planfly.PlanflyError` for bad input.

    >>> import planfly, tempfile
    >>> from logs.recording.example_log import write_example_log
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     log = write_example_log(Path(folder) / "example.mcap")
    ...     print(planfly.compare(log, log).notes[0])
    tracks: 0.00 m apart on average, 0.00 m at most
    """
    logs = [log if isinstance(log, FlightLog) else read_log(log) for log in (first, second)]
    found = compare_logs(*logs, names=(Path(logs[0].source).name, Path(logs[1].source).name))
    if out is not None:
        from logs.views.report.compare import write_comparison

        write_comparison(_prepared(out, COMPARE_FILES, overwrite), found, svg=svg)
    return found


def export(source: FlightLog | FlownMission | Plan | str | Path, *files: str | Path, fence: str | Path | None = None,
           overwrite: bool = False) -> ExportedFiles:  # fmt: skip
    """Write a plan, a mission or a flight in the forms that the files' suffixes name.

    source: a plan, a flight with a log, or the path of a plan.json, mission file or log.
    files: .waypoints, .plan, .fence, .rally, .kml, .gpx.  fence: a file of fences or zones beside its own.
    overwrite: whether files that are there may be replaced.
    Raises a `planfly.PlanflyError` for bad input; nothing is written then.

    >>> import planfly, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = planfly.export(planfly.plan("tight", seed=1), f"{folder}/m.waypoints", Path(folder) / "m.kml")
    ...     [file.suffix for file in written.files]
    ['.waypoints', '.kml']
    """
    if not files:
        raise PlanflyError("export: no file: one at least is expected", field="files")
    targets = tuple(Path(file) for file in files)
    for target in targets:
        refuse_existing(target, overwrite, ask=_ASK)
    with contextlib.ExitStack() as place:
        path = _as_file(source, place)
        options = argparse.Namespace(
            plan=str(path), files=[str(file) for file in targets], fence=[] if fence is None else [str(fence)],
            overwrite=overwrite,
        )  # fmt: skip
        # One road for both doors; what it prints are the notes.
        from planfly.commands.export import export as export_command

        notes = place.enter_context(contextlib.redirect_stderr(io.StringIO()))
        with contextlib.redirect_stdout(io.StringIO()):
            export_command(options)
        return ExportedFiles(targets, tuple(notes.getvalue().splitlines()))


def _as_file(source: FlightLog | FlownMission | Plan | str | Path, place: contextlib.ExitStack) -> Path:
    """The file that a source is, or one made for it while the place is open."""
    if isinstance(source, Plan):
        file = place.enter_context(temporary_folder("planfly-export-")) / "plan.json"
        write_whole(file, plan_json(source))
        return file
    if isinstance(source, FlightLog):
        return Path(source.source)
    if isinstance(source, FlownMission):
        if source.log is None:
            raise PlanflyError("export: a flight without a log: fly(..., log=FILE) writes one", field="source")
        return source.log
    return Path(source)


def _shown(source: Source) -> _Shown:
    if isinstance(source, Plan):
        setup = open_planned(source).setup
        return _Shown(setup, judge_geometry(setup))
    if isinstance(source, FlownMission):
        return _Shown(source.setup, source.verdict, source.track, source.ended, source.events)
    log = source if isinstance(source, FlightLog) else read_log(source)
    return _Shown(log.setup, judge_log(log), log.track, log.ended, log.events, log.versions)


def _prepared(out: str | Path, files: tuple[str, ...], overwrite: bool) -> Path:
    folder = Path(out)
    refuse_folder(folder, overwrite, ask=_ASK)
    prepare_folder(folder, files)
    return folder
