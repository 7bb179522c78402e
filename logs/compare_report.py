"""The comparison of two flights as pictures and a page."""

import base64
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flight.track import Track
from logs import figure_style as style
from logs.compare import Comparison, difference_rows
from logs.figure_map import draw_map
from logs.figure_panels import Axis, Line, Panel, draw_panels, singles
from logs.figure_style import png_bytes, svg_bytes
from logs.reader import FlightLog
from world.files import write_whole

Floats = NDArray[np.float64]

_SECOND = "#D55E00"
_POINTS = 3000
_WORDS = {
    "compare-map.png": "Both flights from above, over the first one's map",
    "compare-profile.png": "Height, height above ground, airspeed, bank, cross-track and throttle of both flights",
}


def write_comparison(out_dir: Path, comparison: Comparison, *, svg: bool = False) -> list[Path]:
    """Write ``compare-map.png``, ``compare-profile.png`` and ``compare.html`` into a folder, made if it is missing.

    svg: the pictures as SVG, too.  Returns the paths written.  Raises OSError.
    """
    figures = {"compare-profile": draw_overlay(comparison)}
    if comparison.logs[0].setup.scenario.origin == comparison.logs[1].setup.scenario.origin:
        figures = {"compare-map": draw_both_on_map(comparison), **figures}
    files = {f"{name}.png": png_bytes(figure) for name, figure in figures.items()}
    page = _page(comparison, files)
    if svg:
        files |= {f"{name}.svg": svg_bytes(figure) for name, figure in figures.items()}
    files["compare.html"] = page.encode("utf-8")
    out_dir.mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        write_whole(out_dir / name, data)
    return [out_dir / name for name in files]


def _page(comparison: Comparison, files: dict[str, bytes]) -> str:
    """The page, its pictures inside."""
    pictures = [
        ("data:image/png;base64," + base64.b64encode(data).decode("ascii"), _WORDS[name])
        for name, data in files.items()
    ]
    verdicts = [
        (name, verdict.flyable, (verdict.summary.splitlines() or [""])[0])
        for name, verdict in zip(comparison.names, comparison.verdicts, strict=True)
    ]
    environment = Environment(
        loader=PackageLoader("logs"), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("compare.html").render(
        names=comparison.names,
        verdicts=verdicts,
        rows=difference_rows(comparison),
        notes=comparison.notes,
        pictures=pictures,
    )


def draw_both_on_map(comparison: Comparison) -> Figure:
    """Draw the first flight's map with the second's route and track over it."""
    first, second = comparison.logs
    both = Track(
        *(np.concatenate([getattr(log.track, name) for log in (first, second)]) for name in Track.__dataclass_fields__)
    )
    setup = first.setup
    paths: dict[str, Any] = {"plan_waypoints": None, "route_waypoints": setup.route.waypoints}
    # The view holds both tracks; the line that joins them is taken out again.
    figure = draw_map(setup.scenario, **paths, track=both, verdict=None)
    axes = figure.axes[0]
    next(line for line in axes.lines if line.get_label() == "flown track").remove()
    looks: tuple[dict[str, Any], dict[str, Any]] = (
        {"color": style.FLOWN, "linewidth": 1.6},
        {"color": _SECOND, "linewidth": 1.6, "linestyle": (0, (5, 2))},
    )
    with style.clean_style():
        for log, name, look in zip((first, second), comparison.names, looks, strict=True):
            rows = log.track.position[:: max(1, len(log.track) // 6000)]
            axes.plot(rows[:, 0], rows[:, 1], zorder=6, label=style.shorten(name, 40), **look)
        handles = axes.lines[-2:]
        axes.legend(handles=handles, loc="best", frameon=True, framealpha=0.9)
        axes.set_title(f"{style.shorten(setup.scenario.name, 40)}: two flights from above", fontweight="bold")
    return figure


def draw_overlay(comparison: Comparison) -> Figure:
    """Six panels over the distance flown: height, height above ground, airspeed, bank, cross-track, throttle."""
    flown = [_distance(log.track) for log in comparison.logs]
    along = np.linspace(0.0, max(float(distance[-1]) for distance in flown), _POINTS)

    def lines(values: list[Floats]) -> list[Line]:
        looks: tuple[dict[str, Any], dict[str, Any]] = (
            {"color": style.FLOWN, "width": 1.6},
            {"color": _SECOND, "width": 1.1, "dashes": (0, (4, 1.2))},
        )
        return [
            Line(style.shorten(name, 22), np.interp(along, distance, value, right=np.nan), **look)
            for name, distance, value, look in zip(comparison.names, flown, values, looks, strict=True)
        ]

    tracks = [log.track for log in comparison.logs]
    panels = [
        Panel("height\n(m AMSL)", lines([track.position[:, 2] for track in tracks])),
        Panel("height above\nground (m)", lines([_above(log) for log in comparison.logs])),
        Panel("airspeed\n(m/s)", lines([singles(track.airspeed) for track in tracks]), least_span=4.0),
        Panel("bank, right +\n(°)", lines([np.degrees(singles(track.attitude[:, 0])) for track in tracks])),
        Panel("cross-track,\nright + (m)", lines([singles(track.cross_track) for track in tracks]), least_span=2.0),
        Panel("throttle\n(%)", lines([100.0 * singles(track.controls[:, 3]) for track in tracks])),
    ]
    return draw_panels(
        "Two flights along their way", panels, Axis("distance flown over the ground (km)", along / 1e3), None
    )


def _distance(track: Track) -> Floats:
    steps = np.nan_to_num(np.hypot(*np.diff(track.position[:, :2], axis=0).T))
    return np.concatenate([[0.0], np.cumsum(steps)])


def _above(log: FlightLog) -> Floats:
    terrain, position = log.setup.scenario.terrain, log.track.position
    if terrain is None:
        return np.full(len(position), np.nan)
    return np.asarray(position[:, 2] - terrain.height(position[:, 0], position[:, 1]))
