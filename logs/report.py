"""The report of a flight: one HTML page that needs nothing else, and its pictures as files.

The page holds its pictures, its style and no script; it asks no network for anything.
"""

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader, StrictUndefined

from flight.setup import FlightSetup
from flight.track import Track
from logs import report_tables as tables
from logs.figure_marks import failures
from logs.report_text import badge_of, count_sentence, finding_rows, rule_rows
from logs.verdict import Verdict
from world.files import write_whole

if TYPE_CHECKING:
    from logs.figures import Pictures
    from logs.reader import LogEvent


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
) -> list[Path]:
    """Write ``map.png``, ``profile.png`` and ``report.html`` into a folder, which is made if it is missing.

    Everything is drawn before the first file is written; each file is written whole or not at all.
    Returns the paths written.  Raises OSError.
    """
    from logs.figures import draw_pictures

    pictures = draw_pictures(setup, track, verdict)
    page = _page(setup, track, verdict, pictures, ended=ended, versions=versions, command=command, events=events)
    out_dir.mkdir(parents=True, exist_ok=True)
    files = {"map.png": pictures.map, "profile.png": pictures.profile, "report.html": page.encode("utf-8")}
    for name, data in files.items():
        write_whole(out_dir / name, data)
    return [out_dir / name for name in files]


def report_html(
    setup: FlightSetup,
    track: Track | None,
    verdict: Verdict,
    *,
    ended: str | None,
    versions: Mapping[str, str],
    command: str,
    events: Sequence["LogEvent"] = (),
) -> str:
    """Make the page.

    track: None for a plan that was not flown.  ended: how the flight ended, in the log's words; None where unknown.
    versions: of planfly and what it stands on.  command: the command line that makes the same flight again.
    events: the log's lines, shown with their times.
    """
    from logs.figures import draw_pictures

    pictures = draw_pictures(setup, track, verdict)
    return _page(setup, track, verdict, pictures, ended=ended, versions=versions, command=command, events=events)


def _page(
    setup: FlightSetup,
    track: Track | None,
    verdict: Verdict,
    pictures: "Pictures",
    *,
    ended: str | None,
    versions: Mapping[str, str],
    command: str,
    events: Sequence["LogEvent"] = (),
) -> str:
    track = track if track is not None and len(track) else None
    failed = failures(verdict, len(setup.route.waypoints))
    rows = finding_rows(verdict.findings)
    environment = Environment(
        loader=PackageLoader("logs"), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("report.html").render(
        name=setup.scenario.name,
        badge=badge_of(verdict),
        summary=verdict.summary.splitlines() or [""],
        flown=track is not None,
        failing=[row for row in rows if row.state == "fail"],
        counts=count_sentence(rows),
        rules=rule_rows(verdict.findings),
        findings=rows,
        notes=[note for note in tables.notes_of(setup) if note not in verdict.summary],
        pictures=_pictures(setup, track is not None, pictures),
        leg_columns=tables.LEG_COLUMNS,
        legs=tables.leg_rows(setup, track, frozenset(failed.legs)),
        scenario=tables.scenario_facts(setup),
        flight=tables.flight_facts(setup, track, ended or ""),
        events=tables.event_rows(events),
        more_events=max(0, len(events) - tables.MOST_EVENTS),
        energy=tables.energy_facts(setup, track),
        command=command,
        origin=tables.origin_facts(setup, versions),
    )


def _pictures(setup: FlightSetup, flown: bool, pictures: "Pictures") -> list[dict[str, str]]:
    """List identifier, heading, alternative text, caption and data address of each picture, in the page's order."""
    legs, threats = setup.route.legs, len(setup.scenario.threats)
    ground = "shaded terrain" if setup.scenario.terrain is not None else "no terrain"
    track = " and the flown track" if flown else ""
    heights = "planned and flown heights" if flown else "planned heights"
    progress = "Flown heights stand at the flight's progress along the planned path. " if flown else ""
    shown = [
        (
            "map",
            "Map",
            f"Map, north up: {ground}, {threats} threats, the planned path of {legs} legs{track}.",
            "The broad line is the plan, the thin line on it the flight. Where they part, at corners, the aircraft "
            "flies an arc inside the waypoint."
            if flown
            else "Nothing was flown: the line is the plan.",
            pictures.map,
        ),
        (
            "profile",
            "Profile",
            f"Heights along the path: terrain, required clearance, {heights}, the ceiling, and the missile and radar "
            "spheres that stand over the path.",
            f"{progress}A sphere is cut where the path runs through its column of air; the path is within reach only "
            "where its line lies inside the cut.",
            pictures.profile,
        ),
    ]
    if pictures.time_plots is not None:
        shown.append(
            (
                "time",
                "Over time",
                "Plots over time: airspeed, bank, throttle, cross-track error, height error, height above ground.",
                "Cross-track and height error are what guidance saw, against the path with its corners rounded. Height "
                "above ground is computed from track and terrain.",
                pictures.time_plots,
            )
        )
    return [
        {
            "id": identifier,
            "title": title,
            "alt": alternative,
            "caption": caption,
            "data": "data:image/png;base64," + base64.b64encode(data).decode("ascii"),
        }
        for identifier, title, alternative, caption, data in shown
    ]
