"""Write the report of a flight: one self-contained HTML page, and its pictures as files.

The page contains its data, its style and two scripts (its own and plotly.js), and makes no network requests.  Its
content security policy lists the scripts by hash.  Print shows the charts and the 3-D view as they are on the screen.
In browsers without scripts, the page shows the map and the profile as pictures.
"""

import base64
import gzip
import hashlib
import json
from collections.abc import Collection, Mapping, Sequence
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
from logs.verdict.presentation import RESULT_COLUMNS, count_sentence
from logs.verdict.returns.drawn_returns import DrawnReturns
from logs.verdict.verdict import Verdict
from logs.views import figures
from logs.views.charts import Chart
from logs.views.failures import collect_failures
from logs.views.figures import FIGURES, Subject, View, figure_views, make_subject, view_json
from logs.views.moments import aircraft_model, flight_moments
from logs.views.report import tables
from logs.views.scene import script_json
from world.files import write_atomically

if TYPE_CHECKING:
    from logs.recording.reader import LogEvent


# Pictures.

# Order in which the page lists findings by their state.
STATE_ORDER = ("fail", "open", "ok", "unjudged")
# Size of a PNG above which the picture is embedded as a JPEG, bytes.
_LARGE_PICTURE_BYTES = 200_000


@dataclass(frozen=True, slots=True)
class ReportPicture:
    """One figure of the page.

    identifier: identifier of its section in the HTML.
    title: its heading.
    alternative: description for readers who cannot see it.
    caption: explanation below the figure.
    data: still picture of the figure as a data URL; "" for none.
    """

    identifier: str
    title: str
    alternative: str
    caption: str
    data: str


def report_pictures(subject: Subject, names: Collection[str], stills: Mapping[str, bytes]) -> list[ReportPicture]:
    """Return the figures with these names for the page's template, in the order of the page.

    names: names of figures in `FIGURES`.
    stills: PNG bytes of still pictures, keyed by file name.
    """
    return [
        ReportPicture(
            identifier=entry.name,
            title=entry.title,
            alternative=entry.alternative(subject),
            caption=entry.caption(subject),
            data=picture_data_url(stills[f"{entry.name}.png"]) if entry.still else "",
        )
        for entry in FIGURES
        if entry.name in names
    ]


def picture_data_url(png: bytes) -> str:
    """Convert the bytes of a PNG to a data URL; a large PNG is converted to a JPEG first.

    >>> picture_data_url(b"PNG")
    'data:image/png;base64,UE5H'
    """
    # Imported here, so that matplotlib is loaded only if something is drawn.
    from logs.views.drawing import jpeg_bytes

    kind, data = ("png", png) if len(png) <= _LARGE_PICTURE_BYTES else ("jpeg", jpeg_bytes(png))
    return f"data:image/{kind};base64," + base64.b64encode(data).decode("ascii")


# Style, scripts and plotly.js of the pages, and their hashes for the content security policy.

# Scripts of pages with charts, in the order of the page.
CHART_SCRIPTS = (
    "page_data",
    "theme",
    "ground",
    "chart_library",
    "chart_layout",
    "chart_labels",
    "chart_layers",
    "chart_panels",
    "chart_map",
    "charts",
    "folds",
)
# Scripts that pages with a 3-D view add to them.
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
    """plotly.js as embedded in a page.

    packed: the script, compressed with gzip and encoded in base64.
    digest: hash of the script, as `script_digest` returns it.
    version: version of plotly.js.
    """

    packed: str
    digest: str
    version: str


@cache
def _load_templates(package: str) -> Environment:
    """Return a Jinja environment for a package's folder ``templates``.

    An undefined name in a template is an error.
    """
    return Environment(
        loader=PackageLoader(package),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def page_template(name: str, package: str = "logs.views.report") -> Template:
    """Return a template from the folder ``templates`` of a package.

    It is compiled once in a process.  It escapes the values that it renders, and raises an error for a missing value.

    name: file name of the template.
    """
    return _load_templates(package).get_template(name)


def script_text(names: tuple[str, ...]) -> str:
    """Join the styles of the theme and scripts from ``templates/scripts`` into one script.

    names: names of the scripts, in order; the script ``start``, which starts the page, is added at the end.
    """
    files = resources.files("logs.views.report").joinpath("templates", "scripts")
    parts = [files.joinpath(f"{name}.js").read_text(encoding="utf-8") for name in (*names, "start")]
    styles = f"const LOOKS = {json.dumps(theme.page_styles(), separators=(',', ':'))};"
    return "\n".join(['\n(function () {\n"use strict";', styles, *parts]) + "})();\n"


def style_text(*names: str) -> str:
    """Join the theme's colours and style sheets from ``templates`` into one style sheet.

    names: names of the style sheets, in order.
    """
    files = resources.files("logs.views.report").joinpath("templates")
    sheets = [files.joinpath(f"{name}.css").read_text(encoding="utf-8") for name in names]
    return "\n".join([theme.css_variables(), *sheets])


def script_digest(text: str) -> str:
    """Return the hash of a script in the form "hash-source" of Content Security Policy Level 3.

    >>> script_digest("")
    'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='
    """
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")


@cache
def page_library() -> PageLibrary:
    """Return plotly.js from the compressed file that the build of the package makes.

    Raises OSError if the file is missing.
    """
    packed = resources.files("logs.views.report").joinpath("plotly.min.js.gz").read_bytes()
    text = gzip.decompress(packed).decode("utf-8")
    # The script begins with a comment that states its version: "plotly.js v3.1.0".
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
    every_picture: bool = False,
    svg: bool = False,
    returns: DrawnReturns | None = None,
) -> list[Path]:
    """Write ``report.html``, ``map.png`` and ``profile.png`` into a folder, created if missing.

    Everything is drawn before the first file is written; each file is written completely or not at all.  Return the
    paths of the files.  Raises OSError if a file cannot be written.

    track: flown track; None for a plan that was not flown.
    ended: reason why the flight ended, as in its log; None if unknown.
    versions: versions of planfly and of the packages it depends on, keyed by name.
    command: command line that repeats the flight.
    events: events in the log, shown with their times.
    every_picture: True to write all figures of `logs.views.figures.FIGURES` as PNG, False for only map and profile.
    svg: True to write the same figures as SVG, too.
    returns: judged returns to launch of the flight or the plan; None to draw none.

    >>> import tempfile
    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.judge_geometry import judge_geometry
    >>> setup = example_log().setup
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     paths = write_report(
    ...         Path(folder), setup, None, judge_geometry(setup), ended=None, versions={}, command="planfly check"
    ...     )
    >>> [path.name for path in paths]
    ['map.png', 'profile.png', 'report.html']
    """
    track = None if track is None or not len(track) else with_legs(track, verdict.leg_ends)
    subject = make_subject(setup, track, verdict, returns)
    views = figure_views(subject)
    drawn_names = {entry.name for entry in FIGURES if every_picture or entry.still}
    pictures = figures.draw_pictures({name: view for name, view in views.items() if name in drawn_names}, svg=svg)
    page = _render_page(
        setup, subject, views, pictures, end_reason=ended, versions=versions, command=command, events=events
    )
    out_dir.mkdir(parents=True, exist_ok=True)
    files = {**pictures, "report.html": page.encode("utf-8")}
    for name, data in files.items():
        write_atomically(out_dir / name, data)
    return [out_dir / name for name in files]


def _render_page(
    setup: FlightSetup,
    subject: Subject,
    views: Mapping[str, View],
    pictures: Mapping[str, bytes],
    *,
    end_reason: str | None,
    versions: Mapping[str, str],
    command: str,
    events: Sequence["LogEvent"] = (),
) -> str:
    """Return the HTML of the report: the template filled with verdict, tables, charts and facts.

    subject: track, if any, and verdict.
    views: views of all figures, keyed by figure name.
    pictures: PNG bytes of the still pictures, keyed by file name.
    end_reason, versions, command, events: as in `write_report`, where `end_reason` is `ended`.
    """
    track, verdict = subject.track, subject.verdict
    failed = collect_failures(verdict, len(setup.route.points))
    charts, flight = page_charts(views), report_flight(setup, track)
    shown_pictures = report_pictures(subject, charts, pictures)
    scene = charts.pop("scene")
    script = script_text((*CHART_SCRIPTS, *VIEW_SCRIPTS))
    return page_template("report.html").render(
        name=setup.scenario.name,
        verdict=verdict,
        flown=track is not None,
        counts=count_sentence(verdict.findings),
        flight_line=tables.flight_sentence(setup, track),
        result_columns=RESULT_COLUMNS,
        rules=[rule for rule in verdict.rules if rule.state != "fail"],
        rows=sorted(map(verdict.row, verdict.findings), key=lambda row: STATE_ORDER.index(row.finding.state)),
        notes=[
            note
            for note in tables.mission_notes(setup)
            if not any(note in line for line in (*verdict.notes, *verdict.lines))
        ],
        map=next((picture for picture in shown_pictures if picture.identifier == "map"), None),
        pictures=[picture for picture in shown_pictures if picture.identifier != "map"],
        leg_columns=tables.LEG_COLUMNS,
        legs=tables.leg_rows(setup, track, frozenset(failed.legs)),
        passage_columns=tables.PASSAGE_COLUMNS,
        passages=tables.passage_rows(setup, track),
        saturation=tables.saturation_rows(setup, track),
        scenario=tables.scenario_facts(setup),
        flight=tables.flight_facts(setup, end_reason or ""),
        events=tables.event_rows(events),
        more_events=max(0, len(events) - tables.MAX_EVENTS),
        energy=tables.energy_facts(setup, track),
        command=command,
        reproducibility=tables.reproducibility_facts(setup, versions),
        # Data for the scripts of the page, escaped for HTML, and the scripts.
        style=Markup(style_text("style", "report")),
        scene=Markup(script_json(scene)),
        flight_data=Markup(script_json(flight)),
        chart_data=Markup(script_json(charts)),
        threats=len(setup.scenario.threats),
        moments=bool(flight["flights"]),
        timed=bool(flight["flights"]) and any(isinstance(view, Chart) and view.timed for view in views.values()),
        library=page_library(),
        script=Markup(script),
        script_digest=script_digest(script),
    )


def page_charts(views: Mapping[str, View]) -> dict[str, Any]:
    """Convert views to JSON data for the page's scripts, keyed by figure name.

    Charts without panels are omitted.
    """
    return {name: view_json(view) for name, view in views.items() if not isinstance(view, Chart) or view.panels}


def report_flight(setup: FlightSetup, track: Track | None) -> dict[str, Any]:
    """Return the page's JSON data on the flight: its moments, for slider and map, and the aircraft model.

    A plan that was not flown, and a flight without a known position, has no moments.
    """
    flights = [] if track is None else [flight_moments(setup, track)]
    # A flight without a known position cannot be shown.
    shown_flights = [flight for flight in flights if flight["time"]]
    return {"flights": shown_flights, "model": aircraft_model()}
