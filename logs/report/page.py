"""The report of a flight: one HTML page that needs no other file, and its pictures as files.

The page holds its pictures, its style, its data and two scripts, its own and plotly.js, which its policy names by
hash; it asks no network for anything.  Without the scripts and on paper, still pictures stand in place of 3-D view and
charts.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.figures.elements.failures import failures
from logs.figures.elements.scene_data import scene_data, script_json
from logs.report import tables
from logs.report.captions import report_pictures
from logs.report.page_parts import CHART_SCRIPTS, VIEW_SCRIPTS, page_library, script_digest, script_text, style_text
from logs.report.text import badge_of, count_sentence, finding_rows, level_rows, rule_rows
from logs.verdict.findings import Verdict
from logs.verdict.measures.airspace import with_fence_zones
from logs.verdict.measures.leg_numbers import with_legs
from world.atomic_files import write_whole

if TYPE_CHECKING:
    from logs.recording.reader import LogEvent


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
    """Write the figures of `logs.figures.draw_all.FIGURE_FILES` and ``report.html`` into a folder, made if missing.

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
    from logs.figures.draw_all import FIGURE_FILES, draw_pictures

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
        loader=PackageLoader("logs.report"),
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
        more_events=max(0, len(events) - tables.MOST_EVENTS),
        energy=tables.energy_facts(setup, track),
        command=command,
        origin=tables.origin_facts(setup, versions),
        **_page_data(setup, track, verdict),
    )


def _page_data(setup: FlightSetup, track: Track | None, verdict: Verdict) -> dict[str, Any]:
    """What the page's scripts read, made safe for where it stands, and the scripts themselves."""
    # Imported here: charts share the figures' lines and colours, and matplotlib is not loaded before a drawing.
    from logs.report.charts.page_charts import report_charts, report_flight

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
