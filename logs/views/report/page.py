"""The report of a flight: one HTML page that needs no other file, and its pictures as files.

The page holds its pictures, its style, its data and two scripts, its own and plotly.js, which its policy names by
hash; it asks no network for anything.  Without the scripts and on paper, still pictures stand in place of 3-D view and
charts.
"""

import base64
import gzip
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.findings import Verdict
from logs.verdict.measures.route_requirements import with_fence_zones
from logs.verdict.measures.track_alignment import with_legs
from logs.views.failures import failures
from logs.views.report import tables
from logs.views.report.text import badge_of, count_sentence, finding_rows, level_rows, rule_rows
from logs.views.scene import scene_data, script_json
from world.files import write_whole

if TYPE_CHECKING:
    from logs.recording.reader import LogEvent


# ----------------------------------------------------------------------
# Captions of the report's pictures: heading, alternative text, and how to read each.

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


@dataclass(frozen=True, slots=True)
class _Caption:
    title: str
    alternative: str
    caption: str


def report_pictures(setup: FlightSetup, flown: bool, pictures: Mapping[str, bytes]) -> list[ReportPicture]:
    """List the page's pictures in its order; what was not drawn is left out.

    pictures: PNG bytes by file name.
    """
    return [
        ReportPicture(
            identifier=name,
            title=caption.title,
            alternative=caption.alternative,
            caption=caption.caption,
            data=picture_address(pictures[f"{name}.png"]),
        )
        for name, caption in _captions(setup, flown).items()
        if f"{name}.png" in pictures
    ]


def picture_address(png: bytes) -> str:
    """A picture as an address that holds it; one that is large with few colours, as it is seen on paper alone.

    >>> picture_address(b"PNG")
    'data:image/png;base64,UE5H'
    """
    # Imported here, as in `page`: matplotlib is not loaded before a drawing.
    from logs.views.drawing import few_colours

    small = png if len(png) <= _LARGE else few_colours(png)
    return "data:image/png;base64," + base64.b64encode(small).decode("ascii")


def _captions(setup: FlightSetup, flown: bool) -> dict[str, _Caption]:
    """Captions by the picture's name, in the page's order."""
    return _route_captions(setup, flown) | _FLIGHT_CAPTIONS


def _route_captions(setup: FlightSetup, flown: bool) -> dict[str, _Caption]:
    """Captions of the pictures of route and terrain, which a plan has, too, that was not flown."""
    legs, threats = setup.route.legs, len(setup.scenario.threats)
    ground = "shaded terrain" if setup.scenario.terrain is not None else "no terrain"
    track = " and the flown track" if flown else ""
    heights = "planned and flown heights" if flown else "planned heights"
    progress = "Flown heights stand at the flight's progress along the planned path. " if flown else ""
    return {
        "map": _Caption(
            "Map",
            f"Map, north up: {ground}, {threats} threats, the planned path of {legs} legs{track}.",
            "The broad line is the plan, the thin line on it the flight."
            + (
                " Where they part, at corners, the aircraft flies an arc inside the waypoint."
                if setup.source is None
                else ""
            )
            if flown
            else "Nothing was flown: the line is the plan.",
        ),
        "profile": _Caption(
            "Profile",
            f"Heights along the path: terrain, required clearance, {heights}, the ceiling, and the missile and radar "
            "spheres that stand over the path.",
            f"{progress}A sphere is cut where the path runs through its column of air; the path is within reach only "
            "where its line lies inside the cut.",
        ),
        "scene": _Caption(
            "3-D view",
            f"View from aside: {ground}, {threats} threats, the planned path of {legs} legs{track}.",
            "Domes are the missiles' reach, dashed the radars'; thin poles stand from the ground to the waypoints. "
            "What a ridge hides shows faintly.",
        ),
    }


_FLIGHT_CAPTIONS = {
    "turns": _Caption(
        "Turn by turn, leg by leg",
        "Bars, dots and dashes: planned, flown and limit of each turn, slope, height above ground, waypoint, and of "
        "the distance from the legs.",
        "Bar: planned. Dot: flown. Dash: the limit, the tighter of scenario's and aircraft's, and of a waypoint what "
        "counts as reached. Ringed: fails.",
    ),
    "time": _Caption(
        "Over time",
        "Plots over time: airspeed, bank, load factor, cross-track error, height error, height above ground.",
        "Cross-track and height error are what guidance saw, against the path with its corners rounded. Height "
        "above ground is computed from track and terrain.",
    ),
    "exposure": _Caption(
        "Exposure",
        "Plots along the flown distance: strength and sum of the exposure to missiles and to radars.",
        "Strength is the sum over all units of (scale/distance)⁴ inside their reach: 1 at one scale's distance "
        "(Yang, Tang and Lozano 2014, eq. 9 and 10, as a density). So far: its sum over time.",
    ),
    "controls": _Caption(
        "Controls",
        "Plots over time: elevator, aileron, rudder and throttle, commanded and as they stood, with their limits.",
        "Shaded: the command stands at the control's limit, and the aircraft can give no more.",
    ),
    "energy": _Caption(
        "Energy",
        "Plots over time: battery energy used, power, current, and the aircraft's energy as a height.",
        "Energy as height: height and airspeed²/2g. Its slope is climb that the motor pays for.",
    ),
    "envelope": _Caption(
        "Envelope",
        "Path angle over airspeed with the steepest climbs and descents, and bank over airspeed with its limit.",
        "Lines: the steepest steady climb and descent of the aircraft, from trims of its model. A dot may stand "
        "outside for a moment, in a gust or a pull-up; a leg may not.",
    ),
}


# ----------------------------------------------------------------------
# What the pages carry beside their words: style, scripts and plotly.js, and the policy that lets in no others.

# The scripts in the order in which they stand; the comparison has charts and no view.
CHART_SCRIPTS = (
    "page_data", "theme", "ground", "chart_library", "chart_layout", "chart_panels", "chart_map", "charts",
)  # fmt: skip
VIEW_SCRIPTS = (
    "moments", "clock", "player", "view_gl", "view_shapes", "view_aircraft", "view_camera", "view_labels", "view_hands",
    "view",
)  # fmt: skip


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


def script_text(names: tuple[str, ...]) -> str:
    """Scripts as one, each from its own file of ``templates/scripts``; ``start`` comes last, whatever is asked for."""
    files = resources.files("logs.views.report").joinpath("templates", "scripts")
    parts = [files.joinpath(f"{name}.js").read_text(encoding="utf-8") for name in (*names, "start")]
    return '\n(function () {\n"use strict";\n' + "\n".join(parts) + "})();\n"


def style_text(*names: str) -> str:
    """Style sheets of ``templates`` as one: "style" is what both pages share."""
    files = resources.files("logs.views.report").joinpath("templates")
    return "\n".join(files.joinpath(f"{name}.css").read_text(encoding="utf-8") for name in names)


def script_digest(text: str) -> str:
    """A script as a policy names it (Content Security Policy Level 3, "hash-source").

    >>> script_digest("")
    'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='
    """
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")


@cache
def page_library() -> PageLibrary:
    """plotly.js of the installed package, a third of its size; the same text gives the same bytes."""
    from plotly.offline import get_plotlyjs, get_plotlyjs_version

    text = get_plotlyjs()
    packed = gzip.compress(text.encode("utf-8"), mtime=0, compresslevel=6)
    return PageLibrary(base64.b64encode(packed).decode("ascii"), script_digest(text), get_plotlyjs_version())


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
) -> list[Path]:
    """Write the figures of `logs.views.figures.FIGURE_FILES` and ``report.html`` into a folder, made if missing.

    track: None for a plan that was not flown.
    ended: how the flight ended, as in its log; None where unknown.
    versions: of planfly and the packages it depends on.
    command: the command line that makes the same flight again.
    events: the log's lines, shown with their times.
    svg: the figures as SVG, too.

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
    from logs.views.figures import FIGURE_FILES, draw_pictures

    track = None if track is None or not len(track) else with_legs(track, verdict.leg_ends)
    pictures = draw_pictures(setup, track, verdict, svg=svg)
    page = _page(setup, track, verdict, pictures, ended=ended, versions=versions, command=command, events=events)
    out_dir.mkdir(parents=True, exist_ok=True)
    as_files = {f"{name}.{kind}" for name in FIGURE_FILES for kind in ("png", "svg")}
    files = {name: data for name, data in pictures.items() if name in as_files}
    files["report.html"] = page.encode("utf-8")
    for name, data in files.items():
        write_whole(out_dir / name, data)
    return [out_dir / name for name in files]


def _page(
    setup: FlightSetup,
    track: Track | None,
    verdict: Verdict,
    pictures: Mapping[str, bytes],
    *,
    ended: str | None,
    versions: Mapping[str, str],
    command: str,
    events: Sequence["LogEvent"] = (),
) -> str:
    failed = failures(verdict, len(setup.route.waypoints))
    rows = finding_rows(verdict.findings, verdict.deciding)
    environment = Environment(
        loader=PackageLoader("logs.views.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html").render(
        name=setup.scenario.name,
        badge=badge_of(verdict),
        summary=verdict.lines or [""],
        flown=track is not None,
        failing=[row for row in rows if row.state == "fail"],
        counts=count_sentence(rows),
        flight_line=tables.flight_sentence(setup, track),
        levels=level_rows(verdict),
        rules=rule_rows(verdict.findings),
        findings=rows,
        notes=[note for note in tables.notes_of(setup) if note not in verdict.notes],
        pictures=report_pictures(setup, track is not None, pictures),
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
        **_page_data(setup, track, verdict),
    )


def _page_data(setup: FlightSetup, track: Track | None, verdict: Verdict) -> dict[str, Any]:
    """What the page's scripts read, made safe for where it stands, and the scripts themselves."""
    # Imported here: charts share the figures' lines and colours, and matplotlib is not loaded before a drawing.
    from logs.views.report.page_charts import report_charts, report_flight

    failed = failures(verdict, len(setup.route.waypoints))
    drawn, script = with_fence_zones(setup), script_text((*CHART_SCRIPTS, *VIEW_SCRIPTS))
    flight = report_flight(setup, track)
    return {
        "style": Markup(style_text("style", "report")),
        "scene": Markup(script_json(scene_data(drawn, track, failed))),
        "flight_data": Markup(script_json(flight)),
        "chart_data": Markup(script_json(report_charts(drawn, track, verdict, failed))),
        "threats": len(setup.scenario.threats),
        "moments": bool(flight["flights"]),
        "timed": ("time", "controls", "energy") if flight["flights"] else (),
        "library": page_library(),
        "script": Markup(script),
        "script_digest": script_digest(script),
    }
