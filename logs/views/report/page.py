"""The report of a flight: one HTML page that needs no other file, and its pictures as files.

The page holds its pictures, its style, its data and two scripts, its own and plotly.js, which its policy names by
hash; it asks no network for anything.  Without the scripts and on paper, still pictures stand in place of 3-D view and
charts.
"""

import base64
import gzip
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs import theme
from logs.verdict.measures.track_alignment import with_legs
from logs.verdict.returns.drawn_returns import DrawnReturns
from logs.verdict.verdict import Verdict
from logs.views import figures
from logs.views.charts import Chart
from logs.views.failures import failures
from logs.views.figures import FIGURES, Subject, View, figure_views, subject_of, view_json
from logs.views.moments import aircraft_model, flight_moments
from logs.views.report import tables
from logs.views.report.text import badge_of, count_sentence, failed_groups, finding_rows, level_rows, rule_rows
from logs.views.scene import script_json
from world.files import write_whole

if TYPE_CHECKING:
    from logs.recording.reader import LogEvent


# Pictures.

# Bytes from which on a picture is kept with few colours.
_LARGE = 200_000


@dataclass(frozen=True, slots=True)
class ReportPicture:
    """One picture of the page.

    identifier: of its section.
    title: its heading.
    alternative: its text for those who cannot see it.
    caption: how to read it.
    data: its address in the page.
    """

    identifier: str
    title: str
    alternative: str
    caption: str
    data: str


def report_pictures(subject: Subject, pictures: Mapping[str, bytes]) -> list[ReportPicture]:
    """List the page's pictures in its order; what was not drawn is left out.

    pictures: PNG bytes by file name.
    """
    return [
        ReportPicture(
            identifier=entry.name,
            title=entry.title,
            alternative=entry.alternative(subject),
            caption=entry.caption(subject),
            data=picture_address(pictures[f"{entry.name}.png"]),
        )
        for entry in FIGURES
        if f"{entry.name}.png" in pictures
    ]


def picture_address(png: bytes) -> str:
    """Return a picture as an address that holds it; one that is large with few colours, as it is seen on paper alone.

    >>> picture_address(b"PNG")
    'data:image/png;base64,UE5H'
    """
    # Imported here, as in `page`: matplotlib is not loaded before a drawing.
    from logs.views.drawing import few_colours

    small = png if len(png) <= _LARGE else few_colours(png)
    return "data:image/png;base64," + base64.b64encode(small).decode("ascii")


# What the pages carry beside their words: style, scripts and plotly.js, and the policy that lets in no others.

# The scripts in the order in which they stand; the comparison has charts and no view.
CHART_SCRIPTS = (
    "page_data",
    "theme",
    "ground",
    "chart_library",
    "chart_layout",
    "chart_layers",
    "chart_panels",
    "chart_map",
    "charts",
)
VIEW_SCRIPTS = (
    "moments",
    "clock",
    "player",
    "view_gl",
    "view_shapes",
    "view_aircraft",
    "view_camera",
    "view_labels",
    "view_hands",
    "view",
)


@dataclass(frozen=True, slots=True)
class PageLibrary:
    """plotly.js as a page carries it.

    packed: compressed (gzip) and in base64.
    digest: of the script, as a policy names it.
    version: its own.
    """

    packed: str
    digest: str
    version: str


@cache
def _templates(package: str) -> Environment:
    return Environment(
        loader=PackageLoader(package),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def page_template(name: str, package: str = "logs.views.report") -> Template:
    """Return a template of a package's folder ``templates``, compiled once in a process.

    What it is rendered with is escaped, and a name in it that is not given is an error.
    """
    return _templates(package).get_template(name)


def script_text(names: tuple[str, ...]) -> str:
    """Scripts as one, each from its own file of ``templates/scripts``; ``start`` comes last, whatever is asked for.

    Before them stand the theme's widths and dashes.
    """
    files = resources.files("logs.views.report").joinpath("templates", "scripts")
    parts = [files.joinpath(f"{name}.js").read_text(encoding="utf-8") for name in (*names, "start")]
    looks = f"const LOOKS = {json.dumps(theme.page_looks(), separators=(',', ':'))};"
    return "\n".join(['\n(function () {\n"use strict";', looks, *parts]) + "})();\n"


def style_text(*names: str) -> str:
    """Return the theme's colours and style sheets of ``templates`` as one: "style" is what both pages share."""
    files = resources.files("logs.views.report").joinpath("templates")
    sheets = [files.joinpath(f"{name}.css").read_text(encoding="utf-8") for name in names]
    return "\n".join([theme.css_variables(), *sheets])


def script_digest(text: str) -> str:
    """Return a script as a policy names it (Content Security Policy Level 3, "hash-source").

    >>> script_digest("")
    'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='
    """
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")


@cache
def page_library() -> PageLibrary:
    """plotly.js, as the build has packed it, a third of its size.  Raises OSError where nothing was built."""
    packed = resources.files("logs.views.report").joinpath("plotly.min.js.gz").read_bytes()
    text = gzip.decompress(packed).decode("utf-8")
    # It begins with a comment that names it: "plotly.js v3.1.0".
    version = text[:200].partition("plotly.js v")[2].splitlines()[0]
    return PageLibrary(base64.b64encode(packed).decode("ascii"), script_digest(text), version)


def write_report(
    out_dir: Path,
    setup: FlightSetup,
    track: Track | None,
    verdict: Verdict,
    *,
    ended: str | None,
    versions: Mapping[str, str],
    command: str,
    events: Sequence["LogEvent"] = (),
    svg: bool = False,
    returns: DrawnReturns | None = None,
) -> list[Path]:
    """Write those of `logs.views.figures.FIGURES` that are files, and ``report.html``, into a folder, made if missing.

    track: None for a plan that was not flown.
    ended: how the flight ended, as in its log; None where unknown.
    versions: of planfly and the packages it depends on.
    command: the command line that makes the same flight again.
    events: the log's lines, shown with their times.
    svg: the figures as SVG, too.
    returns: of the flight or the plan; None draws none.

    Everything is drawn before the first file is written; each file is written whole or not at all.
    Returns the paths written.  Raises OSError.

    >>> import tempfile
    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.judge_geometry import judge_geometry
    >>> setup = example_log().setup
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     paths = write_report(
    ...         Path(folder), setup, None, judge_geometry(setup), ended=None, versions={}, command="planfly check"
    ...     )
    >>> [path.name for path in paths]
    ['map.png', 'profile.png', 'scene.png', 'turns.png', 'envelope.png', 'report.html']
    """
    track = None if track is None or not len(track) else with_legs(track, verdict.leg_ends)
    subject = subject_of(setup, track, verdict, returns)
    views = figure_views(subject)
    pictures = figures.draw_pictures(views, svg=svg)
    page = _page(setup, subject, views, pictures, ended=ended, versions=versions, command=command, events=events)
    out_dir.mkdir(parents=True, exist_ok=True)
    as_files = {f"{entry.name}.{kind}" for entry in FIGURES if entry.file for kind in ("png", "svg")}
    files = {name: data for name, data in pictures.items() if name in as_files}
    files["report.html"] = page.encode("utf-8")
    for name, data in files.items():
        write_whole(out_dir / name, data)
    return [out_dir / name for name in files]


def _page(
    setup: FlightSetup,
    subject: Subject,
    views: Mapping[str, View],
    pictures: Mapping[str, bytes],
    *,
    ended: str | None,
    versions: Mapping[str, str],
    command: str,
    events: Sequence["LogEvent"] = (),
) -> str:
    track, verdict = subject.track, subject.verdict
    failed = failures(verdict, len(setup.route.waypoints))
    rows = finding_rows(verdict.findings, verdict.deciding)
    shown = report_pictures(subject, pictures)
    return page_template("report.html").render(
        name=setup.scenario.name,
        badge=badge_of(verdict),
        summary=verdict.lines or [""],
        flown=track is not None,
        failing=failed_groups(verdict),
        first=next((one for one in shown if one.identifier == "map"), None) if verdict.failed else None,
        counts=count_sentence(rows),
        flight_line=tables.flight_sentence(setup, track),
        levels=level_rows(verdict, setup.autopilot),
        rules=rule_rows(verdict.findings),
        findings=rows,
        notes=[note for note in tables.notes_of(setup) if note not in verdict.notes],
        pictures=shown,
        leg_columns=tables.LEG_COLUMNS,
        legs=tables.leg_rows(setup, track, frozenset(failed.legs)),
        passage_columns=tables.PASSAGE_COLUMNS,
        passages=tables.passage_rows(setup, track),
        saturation=tables.saturation_rows(setup, track),
        scenario=tables.scenario_facts(setup),
        flight=tables.flight_facts(setup, track, ended or ""),
        events=tables.event_rows(events),
        more_events=max(0, len(events) - tables.MAX_EVENTS),
        energy=tables.energy_facts(setup, track),
        command=command,
        origin=tables.origin_facts(setup, versions),
        **_page_data(setup, track, views),
    )


def _page_data(setup: FlightSetup, track: Track | None, views: Mapping[str, View]) -> dict[str, Any]:
    """Return what the page's scripts read, made safe for where it stands, and the scripts themselves."""
    script, flight = script_text((*CHART_SCRIPTS, *VIEW_SCRIPTS)), report_flight(setup, track)
    charts = page_charts(views)
    scene = charts.pop("scene")
    return {
        "style": Markup(style_text("style", "report")),
        "scene": Markup(script_json(scene)),
        "flight_data": Markup(script_json(flight)),
        "chart_data": Markup(script_json(charts)),
        "threats": len(setup.scenario.threats),
        "moments": bool(flight["flights"]),
        "timed": tuple(
            name for name, view in views.items() if isinstance(view, Chart) and view.timed and flight["flights"]
        ),
        "library": page_library(),
        "script": Markup(script),
        "script_digest": script_digest(script),
    }


def page_charts(views: Mapping[str, View]) -> dict[str, Any]:
    """Return what the page's scripts draw by the figure's name; a chart without panels is left to its picture."""
    return {name: view_json(view) for name, view in views.items() if not isinstance(view, Chart) or view.panels}


def report_flight(setup: FlightSetup, track: Track | None) -> dict[str, Any]:
    """Return the flight for slider and map, and the model of the aircraft; no flight of a bare plan."""
    flights = [] if track is None else [flight_moments(setup, track)]
    # A flight of which no place is known cannot be shown at any moment.
    known = [flight for flight in flights if flight["time"]]
    return {"flights": known, "model": aircraft_model()}
