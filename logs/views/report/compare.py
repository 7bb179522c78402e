"""Compare two flights, judged and measured from their logs in the same way."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from flight.mission_files.formats import mission_text
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track, control_limits, saturated_rows
from logs.recording.reader import FlightLog
from logs.verdict.findings import closest_to_limit
from logs.verdict.judge_flight import judge_flight
from logs.verdict.measures.path_sweeps import path_spheres, segment_clearances
from logs.verdict.measures.route_requirements import with_fence_zones
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.verdict import Verdict
from logs.views.charts import shorten
from logs.views.compare import ROLES, NamedFlight, make_two_flights_chart, make_two_flights_map
from logs.views.failures import Failures
from logs.views.figures import View, draw, view_json
from logs.views.moments import flight_moments
from logs.views.report.page import (
    CHART_SCRIPTS,
    page_library,
    page_template,
    picture_data_url,
    script_digest,
    script_text,
    style_text,
)
from logs.views.report.text import format_columns
from logs.views.scene import SceneView, script_json
from world.arrays import Floats
from world.files import write_atomically
from world.geometry import path_length
from world.html_table import html_table
from world.wording import NOTHING, format_number


@dataclass(frozen=True, slots=True)
class Difference:
    """One quantity, as measured in both flights.

    unit: unit of the quantity; "" for a number of items.
    first, second: value in the first and in the second flight; NaN if unknown.
    """

    name: str
    unit: str
    first: float
    second: float


@dataclass(frozen=True, slots=True, repr=False)
class Comparison:
    """The comparison of two flights.

    logs, names, verdicts: log, name and verdict of the first and the second flight.
    differences: all measured quantities, also those that are equal.
    notes: sentences on differences of the setups, on the distance between the tracks, and on limits that were missed
        within their tolerance.
    """

    logs: tuple[FlightLog, FlightLog]
    names: tuple[str, str]
    verdicts: tuple[Verdict, Verdict]
    differences: tuple[Difference, ...]
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<Comparison {' and '.join(self.names)}: {len(self.differences)} quantities, {len(self.notes)} notes>"

    def _repr_html_(self) -> str:
        """Return the table of differences as HTML for a notebook."""
        return html_table(" and ".join(self.names), difference_rows(self), ("", "", *self.names, "difference"))


def compare_logs(first: FlightLog, second: FlightLog, *, names: tuple[str, str]) -> Comparison:
    """Judge and measure the flights of two logs with the same rules, and list their differences.

    names: names of the flights in tables and legends; "(first)" and "(second)" are added if they are equal.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> comparison = compare_logs(log, log, names=("one", "other"))
    >>> comparison.differences[0]
    Difference(name='time in the air', unit='s', first=36.5, second=36.5)
    >>> comparison.notes
    ('tracks: 0.00 m apart on average, 0.00 m at most',)
    """
    if names[0] == names[1]:
        names = (f"{names[0]} (first)", f"{names[1]} (second)")
    verdicts = (_judge_log(first), _judge_log(second))
    notes = _list_difference_notes(first, second, names)
    measures = []
    for log, log_name, verdict in zip((first, second), names, verdicts, strict=True):
        values = _measure_flight(log.setup, log.track)
        values["findings that fail", ""] = float(sum(finding.ok is False for finding in verdict.findings))
        for rule_name, rule in RULE_WORDS.items():
            closest = closest_to_limit(finding for finding in verdict.findings if finding.rule == rule_name)
            if closest is not None:
                margin = math.nan if closest.margin is None else closest.margin
                values[f"smallest margin: {rule.word}", closest.unit] = margin
        measures.append(values)
        # Smallest margins that are negative, but within the tolerance.
        notes += [
            f"smallest margin: {RULE_WORDS[rule_name].word} of {log_name}: passes, {finding.tolerance_note}"
            for rule_name, finding in verdict.closest.items()
            if finding.tolerance_note
        ]
    keys = list(dict.fromkeys([*measures[0], *measures[1]]))
    differences = [Difference(*key, *(measure.get(key, math.nan) for measure in measures)) for key in keys]
    return Comparison((first, second), names, verdicts, tuple(differences), tuple(notes))


def _judge_log(log: FlightLog) -> Verdict:
    """Judge the flight recorded in a log."""
    end_reason = log.ended or "the log ends before the flight does"
    return judge_flight(log.setup, log.track, end_reason, log_complete=log.complete, reference=log.reference)


def _measure_flight(setup: FlightSetup, track: Track) -> dict[tuple[str, str], float]:
    """Measure the quantities of a flight; return each value keyed by (name, unit), NaN if unknown."""
    has_position = np.isfinite(track.position).all(axis=1)
    position = np.ascontiguousarray(track.position[has_position])
    time = np.ascontiguousarray(track.time[has_position])
    roll, _, _ = track.attitude.T
    values = {
        ("time in the air", "s"): float(track.time[-1] - track.time[0]),
        ("distance flown", "m"): float(path_length(position)) if len(position) > 1 else math.nan,
        ("energy used", "Wh"): float(track.energy[-1]),
        ("mean airspeed", "m/s"): _reduce_finite(np.mean, track.airspeed),
        ("highest", "m AMSL"): _reduce_finite(np.max, position[:, 2]),
        ("largest bank", "deg"): math.degrees(_reduce_finite(np.max, np.abs(roll))),
        ("largest load factor", "g"): _reduce_finite(np.max, track.load_factor),
        ("largest cross-track", "m"): _reduce_finite(np.max, np.abs(track.cross_track)),
        ("typical cross-track (rms)", "m"): math.sqrt(
            _reduce_finite(np.mean, track.cross_track.astype(np.float64) ** 2)
        ),
        ("largest height error", "m"): _reduce_finite(np.max, np.abs(track.height_error)),
    }
    if setup.scenario.terrain is not None and len(position) > 1:
        values["lowest height above ground", "m"] = _reduce_finite(
            np.min, segment_clearances(setup.scenario.terrain, position)[0]
        )
    threats = setup.scenario.threats
    if len(threats) and len(position) > 1:
        for name, radii, scales in (
            ("all missiles", threats.kill_radius, threats.kill_scale),
            ("all radars", threats.detection_radius, threats.detection_scale),
        ):
            visits = path_spheres(position, time, threats.position, radii, scales)
            values[f"time within reach, sum over {name}", "s"] = float(visits.time_inside.sum())
            values[f"exposure, sum over {name}", "s"] = float(visits.exposure.sum())
    durations = np.append(np.diff(track.time), 0.0)
    for k, (name, limit) in enumerate(control_limits(setup.aircraft)):
        if math.isfinite(limit):
            is_at_limit = saturated_rows(track, k, 0.0 if name == "throttle" else -limit, limit)
            values[f"{name} at its limit", "s"] = float(durations[is_at_limit].sum())
    return values


def _reduce_finite(reduce: Callable[[Floats], Any], values: NDArray[np.floating[Any]]) -> float:
    """Apply a function such as `np.mean` or `np.max` to the finite values; return NaN if there are none."""
    finite = values[np.isfinite(values)].astype(np.float64)
    return float(reduce(finite)) if finite.size else math.nan


def _list_difference_notes(first: FlightLog, second: FlightLog, names: tuple[str, str]) -> list[str]:
    """Return notes on differences of the setups, missing quantities, and the tracks' distance."""
    first_setup, second_setup = first.setup, second.setup
    notes = []
    for name, first_value, second_value in (
        ("scenario", first_setup.scenario.name, second_setup.scenario.name),
        ("aircraft", first_setup.aircraft, second_setup.aircraft),
        ("seed", str(first_setup.seed), str(second_setup.seed)),
        ("mission", *(mission_text(setup.mission, "waypoints") for setup in (first_setup, second_setup))),
        ("wind", _describe_wind(first_setup), _describe_wind(second_setup)),
        ("guidance", first_setup.autopilot.store().guidance, second_setup.autopilot.store().guidance),
        ("navigation", first_setup.nav, second_setup.nav),
    ):
        if first_value != second_value:
            notes.append(f"{name}: differs" if name == "mission" else f"{name}: {first_value} and {second_value}")
    for log, name in zip((first, second), names, strict=True):
        if not np.isfinite(log.track.cross_track).any():
            notes.append(
                f"cross-track and height error: the log of {name} does not contain these errors of the guidance; "
                "planfly refly measures an imported flight against its legs"
            )
    if first_setup.scenario.origin == second_setup.scenario.origin:
        first_positions, second_positions = (
            log.track.position[np.isfinite(log.track.position).all(axis=1)] for log in (first, second)
        )
        if len(first_positions) and len(second_positions):
            distances = measure_nearest_distances(second_positions, first_positions)
            notes.append(
                f"tracks: {format_number(float(distances.mean()))} m apart on average,"
                f" {format_number(float(distances.max()))} m at most"
            )
    else:
        notes.append("map origins differ: the distance between the tracks is not computed")
    return notes


# Number of successive points of a track that share a bounding box.
_BLOCK_POINTS = 32


def measure_nearest_distances(points: Floats, track: Floats) -> Floats:
    """Return the distance from each point to the nearest point of a track, m, (n,).

    To be fast, both are divided into blocks of successive points.  For each block of `points`, only those blocks of
    `track` are searched whose bounding box is near enough to contain a nearest point.

    points: points, m, (n, 3).
    track: positions of the track, m, (m, 3).

    >>> points = np.array([[0.0, 3.0, 4.0], [9.0, 0.0, 0.0]])
    >>> measure_nearest_distances(points, np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]]))
    array([5., 1.])
    """
    block_starts = np.arange(0, len(track), _BLOCK_POINTS)
    block_min = np.minimum.reduceat(track, block_starts)
    block_max = np.maximum.reduceat(track, block_starts)
    parts = np.array_split(track, block_starts[1:])
    results = []
    for first in range(0, len(points), _BLOCK_POINTS):
        block = points[first : first + _BLOCK_POINTS]
        min_corner, max_corner = block.min(axis=0), block.max(axis=0)
        min_distances = np.linalg.norm(
            np.maximum(0.0, np.maximum(block_min - max_corner, min_corner - block_max)), axis=1
        )
        max_distances = np.linalg.norm(np.maximum(block_max - min_corner, max_corner - block_min), axis=1)
        candidates = np.concatenate([parts[k] for k in np.flatnonzero(min_distances <= max_distances.min())])
        results.append(np.sqrt(((block[:, None] - candidates[None]) ** 2).sum(axis=2).min(axis=1)))
    return np.concatenate(results)


def _describe_wind(setup: FlightSetup) -> str:
    """Return speed, direction and turbulence of a setup's wind as text."""
    wind = setup.scenario.wind
    direction_text = f" from {round(math.degrees(wind.from_course)) % 360:03d}°" if wind.speed else ""
    forecast_text = "" if wind.forecast is None else f" (mean of {wind.forecast.describe()})"
    return f"{wind.speed:g} m/s{direction_text}{forecast_text}, turbulence {wind.turbulence}"


def difference_rows(comparison: Comparison) -> list[tuple[str, ...]]:
    """Return the rows of the table of differences, each as five texts.

    They are: quantity, unit, value in the first flight, value in the second flight, and second minus first value.  The
    first row has the verdicts.
    """
    first_answer, second_answer = (verdict.answer for verdict in comparison.verdicts)
    rows: list[tuple[str, ...]] = [("verdict", "", first_answer, second_answer, "")]
    for difference in comparison.differences:
        digits = None if difference.unit else 0
        change = format_number(difference.second - difference.first, signed=True, digits=digits)
        values = (format_number(value, digits=digits) for value in (difference.first, difference.second))
        rows.append((difference.name, difference.unit, *values, change))
    return rows


def difference_lines(comparison: Comparison) -> list[str]:
    """Return the table of differences and the notes as lines for a terminal.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> lines = difference_lines(compare_logs(log, log, names=("one", "other")))
    >>> for line in lines[:3]:
    ...     print(line[-42:])
             one        other  difference
      not flyable  not flyable
             36.5         36.5        0.00
    """
    rows: list[tuple[str, ...]] = [("", *comparison.names, "difference")]
    for name, unit, *values in difference_rows(comparison):
        rows.append((f"{name} ({unit})" if unit else name, *values))
    lines = [line.rstrip() for line in format_columns(rows)]
    has_unknown = any(NOTHING in line for line in lines)
    return [*lines, *comparison.notes, *([f"{NOTHING}: unknown"] if has_unknown else [])]


# ----------------------------------------------------------------------
# The comparison of two flights as files: pictures, and a page that holds them.

# Name of the page's chart, and description for readers who cannot see it, by file name of the picture.
_PICTURES = {
    "compare-map": ("map", "Both flights from above, over the map of the first flight"),
    "compare-profile": (
        "along",
        "Height, height above ground, airspeed, bank, cross-track and throttle of both flights",
    ),
}


def write_comparison(out_dir: Path, comparison: Comparison, *, svg: bool = False) -> list[Path]:
    """Write ``compare-map.png``, ``compare-profile.png`` and ``compare.html`` into a folder.

    The folder is created if missing.  The map is omitted if the map origins of the flights differ.  Return the paths of
    the files.  Raises OSError if a file cannot be written.

    svg: True to write the pictures as SVG, too.

    >>> import tempfile
    >>> from logs.recording.example_log import example_log
    >>> from logs.views.report.compare import compare_logs
    >>> log = example_log()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     paths = write_comparison(Path(folder), compare_logs(log, log, names=("one", "other")))
    >>> [path.name for path in paths]
    ['compare-map.png', 'compare-profile.png', 'compare.html']
    """
    first, second = (
        NamedFlight(name, log.setup, log.track) for name, log in zip(comparison.names, comparison.logs, strict=True)
    )
    from logs.views.drawing import png_bytes, svg_bytes

    views = comparison_views((first, second))
    figures = {name: draw(view) for name, view in views.items()}
    files = {f"{name}.png": png_bytes(figure) for name, figure in figures.items()}
    pictures = [(*_PICTURES[name.removesuffix(".png")], picture_data_url(picture)) for name, picture in files.items()]
    data, script = comparison_data((first, second), views), script_text(CHART_SCRIPTS)
    page = page_template("compare.html").render(
        names=comparison.names,
        verdicts=list(zip(comparison.names, comparison.verdicts, strict=True)),
        rows=difference_rows(comparison),
        notes=comparison.notes,
        pictures=pictures,
        style=Markup(style_text("style", "compare")),
        scene=Markup(script_json(data["scene"])),
        flight_data=Markup(script_json(data["flight"])),
        chart_data=Markup(script_json(data["charts"])),
        library=page_library(),
        script=Markup(script),
        script_digest=script_digest(script),
    )
    if svg:
        files |= {f"{name}.svg": svg_bytes(figure) for name, figure in figures.items()}
    files["compare.html"] = page.encode("utf-8")
    out_dir.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        write_atomically(out_dir / name, content)
    return [out_dir / name for name in files]


def comparison_views(flights: tuple[NamedFlight, NamedFlight]) -> dict[str, View]:
    """Build the map and the chart of two flights, keyed by file name; no map if their map origins differ.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> list(comparison_views(tuple(NamedFlight(name, log.setup, log.track) for name in ("one", "other"))))
    ['compare-map', 'compare-profile']
    """
    first, second = flights
    has_same_origin = first.setup.scenario.origin == second.setup.scenario.origin
    views: dict[str, View] = {"compare-map": make_two_flights_map(flights)} if has_same_origin else {}
    return views | {"compare-profile": make_two_flights_chart(flights)}


def comparison_data(flights: tuple[NamedFlight, NamedFlight], views: Mapping[str, View]) -> dict[str, Any]:
    """Return the page's JSON data: "scene", "flight" and "charts".

    The scene is data of a 3-D view, from which the page takes the ground of the map; it is None without a map.

    views: views of `comparison_views`.
    """
    first, _ = flights
    scene = None
    if "compare-map" in views:
        scene = view_json(SceneView(with_fence_zones(first.setup), first.track, Failures({}, {})))
    moments = [
        flight_moments(flight.setup, flight.track, name=shorten(flight.name, 40), role=role)
        for flight, role in zip(flights, ROLES, strict=True)
    ]
    charts = {_PICTURES[name][0]: view_json(view) for name, view in views.items()}
    return {"scene": scene, "flight": {"flights": moments}, "charts": charts}
