"""Draw figures of flights, write reports, and compare flights."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.foxglove_scene import layout_text
from logs.recording.reader import FlightLog, LogEvent, read_log
from logs.verdict.verdict import Verdict
from logs.views.report.compare import Comparison, compare_logs, write_comparison
from planfly.api.api_function import api_function
from planfly.flight_logs import judge_log
from planfly.runtime.stages import stage
from planfly.workflow.open_flight import open_flight
from planfly.workflow.output_paths import COMPARE_FILES, LOG_FIGURES, check_output_file, clean_folder
from planfly.workflow.pipeline import FlownMission, return_summary
from planfly.workflow.suggestion_trials import judge_mission_geometry
from planner.plan import Plan
from world.argument_types import checks_types
from world.files import write_atomically
from world.html_table import html_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Flight or plan to report on.
Source = FlightLog | FlownMission | Plan | str | Path


@dataclass(frozen=True, slots=True)
class WrittenReport:
    """Files that `planfly.report` wrote.

    page: the HTML page, which needs no other file.
    files: the page and the separate pictures.
    verdict: verdict on the reported flight or plan.
    """

    page: Path
    files: tuple[Path, ...]
    verdict: Verdict | None = None

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows."""
        return html_table(f"Report {self.page}", [(file.name,) for file in self.files])


class _ReportContent(NamedTuple):
    """Flight or plan that a report shows.

    track: rows of the flight; None for a plan.
    ended: reason for the end of the flight; None for a plan.
    versions: versions of the packages that simulated the flight; None for the installed versions.
    """

    setup: FlightSetup
    verdict: Verdict
    track: Track | None = None
    ended: str | None = None
    events: tuple[LogEvent, ...] = ()
    versions: dict[str, str] | None = None


@api_function()
def figures(source: Source) -> "dict[str, Figure]":
    """Return the pictures of a flight, or of a plan that was not flown, as matplotlib figures by name.

    source: a flight log or its path, a result of `planfly.fly`, or a `Plan`.
    A notebook shows each figure as a picture.
    The names are "map", "profile", "scene", "turns", "envelope", for a flight also "time", "exposure", "controls" and
    "energy", and for a scenario with a radio link "link-map" and "link".
    Raises a `planfly.PlanflyError` for bad input.

    >>> import planfly
    >>> drawn = planfly.figures(planfly.plan("tight", seed=1))
    >>> drawn["map"]._repr_png_()[1:4]
    b'PNG'
    """
    # Imported here: only pictures need matplotlib.
    from logs.views.figures import draw_figures

    content = _read_report_content(source)
    return draw_figures(content.setup, content.track, content.verdict)


@api_function()
def report(
    source: Source,
    out: str | Path,
    *,
    pictures: bool = False,
    svg: bool = False,
    overwrite: bool = False,
    command: str = "planfly.report",
) -> WrittenReport:
    """Write ``report.html``, ``map.png`` and ``profile.png`` into a folder, made if missing.

    source: see `planfly.figures`.
    out: the folder.
    pictures: True writes every figure of the page as PNG.
    svg: True also writes the same figures as SVG.
    overwrite: True replaces results in the folder.
    command: the command line that repeats the report, shown on the page.
    Raises a `planfly.PlanflyError` for bad input, and without `overwrite` for a folder that is not empty.

    >>> import planfly, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = planfly.report(planfly.plan("tight", seed=1), folder)
    >>> written.page.name, len(written.files)
    ('report.html', 3)
    """
    from logs.recording.setup_attachments import package_versions
    from logs.views.report.page import write_report

    content = _read_report_content(source)
    folder = clean_folder(out, LOG_FIGURES, overwrite=overwrite)
    with stage("drawing", "drawing a report"):
        files = write_report(
            folder,
            content.setup,
            content.track,
            content.verdict,
            ended=content.ended,
            events=content.events,
            every_picture=pictures,
            svg=svg,
            versions=content.versions or package_versions(),
            command=command,
            returns=return_summary(content.setup, content.track).data_for_pictures(),
        )
    return WrittenReport(folder / "report.html", tuple(files), content.verdict)


@checks_types
def foxglove_layout(file: str | Path, *, overwrite: bool = False) -> Path:
    """Write the layout file with which Foxglove shows flight logs.

    overwrite: True replaces an existing file.
    Raises a `planfly.PlanflyError` for a file that cannot be written.

    >>> import planfly, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     planfly.foxglove_layout(Path(folder) / "layout.json").name
    'layout.json'
    """
    check_output_file(Path(file), overwrite)
    write_atomically(Path(file), layout_text())
    return Path(file)


@api_function()
def compare(
    first: FlightLog | str | Path,
    second: FlightLog | str | Path,
    out: str | Path | None = None,
    *,
    svg: bool = False,
    overwrite: bool = False,
) -> Comparison:
    """Judge and measure two flights in the same way, and compare them.

    first, second: flight logs, or their paths.
    out: a folder for ``compare.html`` and its pictures; None writes no files.
    svg, overwrite: see `planfly.report`.
    Raises a `planfly.PlanflyError` for bad input.

    >>> import planfly, tempfile
    >>> from logs.recording.example_log import write_example_log
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     log = write_example_log(Path(folder) / "example.mcap")
    ...     print(planfly.compare(log, log).notes[0])
    tracks: 0.00 m apart on average, 0.00 m at most
    """
    logs = [log if isinstance(log, FlightLog) else read_log(log) for log in (first, second)]
    comparison = compare_logs(*logs, names=(Path(logs[0].source).name, Path(logs[1].source).name))
    if out is not None:
        folder = clean_folder(out, COMPARE_FILES, overwrite=overwrite)
        with stage("drawing", "drawing a comparison"):
            write_comparison(folder, comparison, svg=svg)
    return comparison


def _read_report_content(source: Source) -> _ReportContent:
    """Return the setup, track and verdict of a flight or plan, for a report.

    A plan is judged by its geometry, a log by its rows.
    """
    if isinstance(source, Plan):
        setup = open_flight(source, {})
        return _ReportContent(setup, judge_mission_geometry(setup))
    if isinstance(source, FlownMission):
        return _ReportContent(source.setup, source.verdict, source.track, source.ended, source.events)
    log = source if isinstance(source, FlightLog) else read_log(source)
    return _ReportContent(log.setup, judge_log(log), log.track, log.ended, log.events, log.versions)
