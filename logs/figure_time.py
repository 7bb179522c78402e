"""Time plots of a flight: speed, bank, throttle, tracking errors and clearance over one time axis."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from flight.setup import FlightSetup
from flight.track import Track
from logs import figure_style as style

Floats = NDArray[np.float64]

_LEFT, _RIGHT, _TOP, _BOTTOM, _PANEL, _GAP = 0.85, 2.15, 0.72, 0.55, 1.12, 0.2
# Runs that a line is thinned to; each keeps its lowest and highest row.
_RUNS = 700


@dataclass(frozen=True, slots=True)
class _Line:
    """One series of a panel: values (t,), and how it looks in panel and legend."""

    label: str
    values: Floats
    color: str = style.FLOWN
    width: float = 0.9
    dashes: Any = "-"


@dataclass(frozen=True, slots=True)
class _Panel:
    """One quantity: its axis label with unit, its lines, level limits (label, value), and the least span it shows."""

    title: str
    lines: Sequence[_Line]
    limits: Sequence[tuple[str, float]] = ()
    least_span: float = 1.0


def draw_time_plots(setup: FlightSetup, track: Track) -> Figure:
    """Six panels over time (s): airspeed, bank, throttle, cross-track error, height error, clearance.

    Clearance is computed from track and terrain, not read from the log; its panel is missing without terrain.  Grey
    lines with numbers part the legs.
    """
    panels = _panels(setup, track)
    total = _TOP + _BOTTOM + len(panels) * _PANEL + (len(panels) - 1) * _GAP
    with style.clean_style():
        figure = style.new_figure(total)
        for row, panel in enumerate(panels):
            base = _BOTTOM + (len(panels) - 1 - row) * (_PANEL + _GAP)
            place = (_LEFT / style.WIDTH, base / total, 1 - (_LEFT + _RIGHT) / style.WIDTH, _PANEL / total)
            axes = figure.add_axes(place)
            _draw(axes, panel, track.time)
            _legs(axes, track, numbered=row == 0)
            if row < len(panels) - 1:
                axes.tick_params(labelbottom=False)
            else:
                axes.set_xlabel("time since the start (s)")
        name = style.shorten(setup.scenario.name, 60)
        where = (_LEFT / style.WIDTH, 1 - 0.3 / total)
        figure.text(*where, f"{name}: the flight over time", fontsize=11, fontweight="bold", va="center")
    return figure


def _panels(setup: FlightSetup, track: Track) -> list[_Panel]:
    bank = np.degrees(track.attitude[:, 0].astype(np.float64))
    limit = float(np.degrees(min(setup.max_bank, setup.envelope.max_bank)))
    commanded: dict[str, Any] = {"color": style.LIMIT, "width": 1.8}
    panels = [
        _Panel(
            "airspeed\n(m/s)",
            [_Line("commanded", _of(track.speed_command), **commanded), _Line("flown", _of(track.airspeed))],
            least_span=4.0,
        ),
        _Panel("bank, right +\n(°)", [_Line("flown", bank)], [("limit", limit), ("", -limit)]),
        _Panel("throttle\n(%)", [_Line("flown", 100.0 * _of(track.controls[:, 3]))], [("limits", 0.0), ("", 100.0)]),
        _Panel("cross-track,\nright + (m)", [_Line("as guidance saw it", _of(track.cross_track))], least_span=2.0),
        _Panel("height error,\nhigh + (m)", [_Line("as guidance saw it", _of(track.height_error))], least_span=2.0),
    ]
    terrain = setup.scenario.terrain
    if terrain is not None:
        ground = terrain.height(track.position[:, 0], track.position[:, 1])
        above = _Line("from track and terrain", track.position[:, 2] - ground)
        panels.append(
            _Panel("height above\nground (m)", [above], [("required", setup.scenario.limits.min_clearance_m)])
        )
    return panels


def _of(values: NDArray[np.float32]) -> Floats:
    return values.astype(np.float64)


def _draw(axes: Any, panel: _Panel, time: Floats) -> None:
    for label, value in panel.limits:
        axes.axhline(value, color=style.MISSILE, linewidth=1.0, linestyle=(0, (5, 2)), label=label or None, zorder=2)
    seen = [value for _, value in panel.limits]
    for line in panel.lines:
        rows = style.outline_rows(line.values, _RUNS)
        axes.plot(time[rows], line.values[rows], line.dashes, color=line.color, linewidth=line.width, label=line.label)
        finite = line.values[np.isfinite(line.values)]
        seen += [float(finite.min()), float(finite.max())] if finite.size else []
    low, high = (min(seen), max(seen)) if seen else (0.0, 1.0)
    spare = max(0.0, panel.least_span - (high - low)) / 2
    rim = 0.08 * (high - low + 2 * spare)
    axes.set_ylim(low - spare - rim, high + spare + rim)
    axes.set_xlim(float(time[0]), float(max(time[-1], time[0] + 1.0)))
    axes.xaxis.set_major_locator(MultipleLocator(style.nice_step(float(np.ptp(axes.get_xlim())), 14)))
    axes.set_ylabel(panel.title)
    axes.yaxis.set_label_coords(-0.062, 0.5)
    axes.grid(color="#e4e4e4", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), handlelength=1.6, borderaxespad=0.2)


def _legs(axes: Any, track: Track, *, numbered: bool) -> None:
    """Part the legs by thin lines; number them above the topmost panel, as far as the numbers have room."""
    changes = np.flatnonzero(np.diff(track.leg)) + 1
    for row in changes:
        axes.axvline(float(track.time[row]), color="#b5b5b5", linewidth=0.6, zorder=1)
    if not numbered:
        return
    span = float(np.ptp(axes.get_xlim()))
    starts = np.concatenate([[0], changes]).astype(int)
    ends = np.concatenate([changes, [len(track) - 1]]).astype(int)
    last = -np.inf
    for start, end in zip(starts, ends, strict=True):
        middle = 0.5 * float(track.time[start] + track.time[end])
        if middle - last < 0.022 * span:
            continue
        text = f"leg {track.leg[start]}" if last == -np.inf else str(track.leg[start])
        place: dict[str, Any] = {
            "xycoords": ("data", "axes fraction"),
            "textcoords": "offset points",
            "ha": "center",
            "fontsize": 7,
        }
        axes.annotate(text, (middle, 1.0), (0, 3), color=style.QUIET, annotation_clip=False, **place)
        last = middle
