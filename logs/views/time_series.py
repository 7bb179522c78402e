"""Time plots of a flight: speed, bank, tracking errors and clearance; controls and their limits; energy."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from flight.simulation.airborne import control_limits, held_at_limit
from flight.simulation.setup import FlightSetup
from flight.simulation.track import COLUMNS, Track
from logs.views import drawing
from world.geometry import segment_exposure
from world.kernels import compiled

Floats = NDArray[np.float64]


# ----------------------------------------------------------------------
# Stacked panels over one axis: series, limits and legs, as the time, control and energy pictures share them.


_LEFT, _RIGHT, _TOP, _BOTTOM, _PANEL, _GAP = 0.85, 2.15, 0.72, 0.55, 1.12, 0.2
# Inches: right of the panels where no legends stand there, and the height of the one legend above them.
_EDGE, _LEGEND = 0.25, 0.28
# Inches from the panels to the middle of their labels.
_LABEL = 0.44
# Blocks that a series is thinned to; each keeps its lowest and highest row.
_BLOCKS = 700


@dataclass(frozen=True, slots=True)
class Series:
    """One series of a panel.

    label: in the legend.
    values: (t,) in the panel's unit.
    color, width, dashes: how its line looks, in matplotlib's terms.
    filled: from the line down to zero.
    """

    label: str
    values: Floats
    color: str = drawing.FLOWN
    width: float = 0.9
    dashes: Any = "-"
    filled: bool = False


@dataclass(frozen=True, slots=True)
class Panel:
    """One quantity.

    title: the axis label, with the unit.
    series: its lines.
    limits: level lines, label and value.
    least_span: the least range of values that it shows.
    held: (t,) rows that are shaded, where a control stands at its limit.
    """

    title: str
    series: Sequence[Series]
    limits: Sequence[tuple[str, float]] = ()
    least_span: float = 1.0
    held: NDArray[np.bool_] | None = None


@dataclass(frozen=True, slots=True)
class Axis:
    """The common axis of the panels: its label and values (t,), which never fall."""

    label: str
    values: Floats


@dataclass(frozen=True, slots=True)
class Stack:
    """What a picture of stacked panels shows, for a figure and for the page's chart alike.

    title: of the whole.
    panels: from the top.
    axis: common to all.
    track: with as many rows as the axis; None where no legs are parted.
    """

    title: str
    panels: Sequence[Panel]
    axis: Axis
    track: Track | None

    def shown(self) -> list[Panel]:
        """The panels that have a value; the first where none has any."""
        return [panel for panel in self.panels if _has_values(panel)] or list(self.panels[:1])


def draw_stack(stack: Stack) -> Figure:
    """Draw a stack, as `draw_panels` does."""
    return draw_panels(stack.title, stack.panels, stack.axis, stack.track)


def time_axis(track: Track) -> Axis:
    """Time since the start."""
    return Axis("time since the start (s)", track.time)


def doubles(values: NDArray[np.float32]) -> Floats:
    """Widen a column of the track to float64, so that what is computed from it is not rounded again."""
    return values.astype(np.float64)


def draw_panels(title: str, panels: Sequence[Panel], axis: Axis, track: Track | None) -> Figure:
    """Stack panels over one axis; those without a value are left out, as far as another has any.

    track: with as many rows as the axis; grey lines with numbers then part its legs.
    Where each look means one thing in all panels, and some mean it in several, one legend stands above them.
    """
    panels = Stack(title, panels, axis, track).shown()
    top, right = (_TOP, _RIGHT)
    if shared := shares_legend(panels):
        top, right = _TOP + _LEGEND, _EDGE
    total = top + _BOTTOM + len(panels) * _PANEL + (len(panels) - 1) * _GAP
    with drawing.clean_style():
        figure = drawing.new_figure(total)
        for row, panel in enumerate(panels):
            base = _BOTTOM + (len(panels) - 1 - row) * (_PANEL + _GAP)
            frame = (_LEFT / drawing.WIDTH, base / total, 1 - (_LEFT + right) / drawing.WIDTH, _PANEL / total)
            axes = figure.add_axes(frame)
            _draw(axes, panel, axis.values)
            if not shared:
                axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), handlelength=1.6, borderaxespad=0.2)
            if track is not None:
                _legs(axes, axis.values, track, numbered=row == 0)
            if row < len(panels) - 1:
                axes.tick_params(labelbottom=False)
            else:
                axes.set_xlabel(axis.label)
        figure.text(_LEFT / drawing.WIDTH, 1 - 0.3 / total, title, fontsize=11, fontweight="bold", va="center")
        if shared:
            _legend_above(figure, 1 - 0.45 / total)
    return figure


def _has_values(panel: Panel) -> bool:
    return any(np.isfinite(line.values).any() for line in panel.series)


def shares_legend(panels: Sequence[Panel]) -> bool:
    """Whether one legend can stand for all panels: no look has two meanings, no meaning two looks, some repeat.

    >>> flown, asked = Series("flown", np.zeros(2)), Series("commanded", np.zeros(2), color=drawing.LIMIT)
    >>> shares_legend([Panel("bank", [asked, flown]), Panel("speed", [asked, flown])])
    True
    >>> shares_legend([Panel("bank", [flown]), Panel("height", [Series("from terrain", np.zeros(2))])])
    False
    """
    entries: list[tuple[str, Any]] = [
        (line.label, (line.color, line.width, line.dashes)) for panel in panels for line in panel.series
    ]
    entries += [(label, "limit") for panel in panels for label, _ in panel.limits if label]
    different = set(entries)
    labels, looks = ({entry[side] for entry in different} for side in (0, 1))
    return len(labels) == len(looks) == len(different) < len(entries)


def _legend_above(figure: Figure, top: float) -> None:
    """Write each entry of the panels once, in a row.  top: its upper edge, of the figure's height."""
    entries = {
        str(label): handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        entries.values(),
        entries.keys(),
        loc="upper left",
        bbox_to_anchor=(_LEFT / drawing.WIDTH - 0.01, top),
        ncols=len(entries),
        handlelength=2.2,
        borderaxespad=0.0,
        borderpad=0.2,
    )


def _draw(axes: Any, panel: Panel, along: Floats) -> None:
    for label, value in panel.limits:
        axes.axhline(value, color=drawing.MISSILE, linewidth=1.0, linestyle=(0, (5, 2)), label=label or None, zorder=2)
    if panel.held is not None and panel.held.any():
        frame = axes.get_xaxis_transform()
        look: dict[str, Any] = {"color": drawing.FAIL, "alpha": 0.25, "linewidth": 0, "zorder": 0.5}
        axes.fill_between(along, 0.0, 1.0, where=panel.held, transform=frame, label="held at its limit", **look)
    extremes = [value for _, value in panel.limits]
    for line in panel.series:
        rows = drawing.outline_rows(line.values, _BLOCKS)
        axes.plot(
            along[rows],
            line.values[rows],
            linestyle=line.dashes,
            color=line.color,
            linewidth=line.width,
            label=line.label,
        )
        if line.filled:
            axes.fill_between(along[rows], 0.0, line.values[rows], color=line.color, alpha=0.25, linewidth=0)
        finite = line.values[np.isfinite(line.values)]
        extremes += [float(finite.min()), float(finite.max())] if finite.size else []
    low, high = (min(extremes), max(extremes)) if extremes else (0.0, 1.0)
    widening = max(0.0, panel.least_span - (high - low)) / 2
    padding = 0.08 * (high - low + 2 * widening)
    axes.set_ylim(low - widening - padding, high + widening + padding)
    axes.set_xlim(float(along[0]), float(max(along[-1], along[0] + 1e-3)))
    axes.xaxis.set_major_locator(MultipleLocator(drawing.nice_step(float(np.ptp(axes.get_xlim())), 14)))
    axes.set_ylabel(panel.title)
    axes.yaxis.set_label_coords(-_LABEL / (drawing.WIDTH * axes.get_position().width), 0.5)
    axes.grid(color="#e4e4e4", linewidth=0.5)
    axes.set_axisbelow(True)


def _legs(axes: Any, along: Floats, track: Track, *, numbered: bool) -> None:
    """Part the legs by thin lines; number them above the topmost panel, as far as the numbers fit."""
    changes = np.flatnonzero(np.diff(track.leg)) + 1
    for row in changes:
        axes.axvline(float(along[row]), color="#b5b5b5", linewidth=0.6, zorder=1)
    if not numbered:
        return
    span = float(np.ptp(axes.get_xlim()))
    starts = np.concatenate([[0], changes]).astype(int)
    ends = np.concatenate([changes, [len(track) - 1]]).astype(int)
    last = -np.inf
    for start, end in zip(starts, ends, strict=True):
        middle = 0.5 * float(along[start] + along[end])
        if middle - last < 0.022 * span:
            continue
        text = f"leg {track.leg[start]}" if last == -np.inf else str(track.leg[start])
        anchor: dict[str, Any] = {
            "xycoords": ("data", "axes fraction"),
            "textcoords": "offset points",
            "ha": "center",
            "fontsize": 7,
        }
        axes.annotate(text, (middle, 1.0), (0, 3), color=drawing.QUIET, annotation_clip=False, **anchor)
        last = middle


# Power is the battery's energy over this long, s: less would show its float32 steps.
_POWER_WINDOW = 2.0


def draw_time_plots(setup: FlightSetup, track: Track) -> Figure:
    """Seven or eight panels over time (s), those of `time_stack`.  Grey lines with numbers part the legs."""
    return draw_stack(time_stack(setup, track))


def time_stack(setup: FlightSetup, track: Track) -> Stack:
    """Airspeed, bank, climb, load factor, wind, cross-track error, height error and clearance over time.

    Clearance is computed from track and terrain, not read from the log; its panel is missing without terrain.
    """
    return Stack(_title(setup, "the flight over time"), _panels(setup, track), time_axis(track), track)


def draw_controls(setup: FlightSetup, track: Track) -> Figure:
    """Four panels over time, those of `control_stack`.  Shaded where a command is at or beyond its control's limit."""
    return draw_stack(control_stack(setup, track))


def control_stack(setup: FlightSetup, track: Track) -> Stack:
    """Elevator, aileron, rudder and throttle over time, as commanded and as they stood.

    Held: the command is at or beyond the control's limit, and the aircraft can give no more.
    """
    commanded: dict[str, Any] = {"color": drawing.LIMIT, "width": 2.0}
    panels = []
    limits = control_limits(setup.aircraft)
    for k, ((name, limit), asked, stood) in enumerate(zip(limits, track.commands.T, track.controls.T, strict=True)):
        unit, scale = ("%", 100.0) if name == "throttle" else ("°", 180.0 / np.pi)
        series = [
            Series("commanded", scale * doubles(asked), **commanded),
            Series("as it stood", scale * doubles(stood)),
        ]
        low, high = (0.0, 1.0) if name == "throttle" else (-limit, limit)
        known = np.isfinite([low, high]).all()
        edges = [("limits", scale * low), ("", scale * high)] if known else []
        panels.append(Panel(f"{name}\n({unit})", series, edges, held=held_at_limit(track, k, low, high)))
    return Stack(_title(setup, "controls and their limits"), panels, time_axis(track), track)


def draw_energy(setup: FlightSetup, track: Track) -> Figure:
    """Four panels over time, those of `energy_stack`."""
    return draw_stack(energy_stack(setup, track))


def energy_stack(setup: FlightSetup, track: Track) -> Stack:
    """Battery energy used, power, current, and the aircraft's specific energy as a height, over time.

    Of an aircraft that burns fuel, its heat is shown, and no current.
    """
    burns = setup.envelope.power_level.size > 0 and not setup.envelope.volts
    store, unit, power_unit, scale = (
        ("heat of fuel", "kWh", "kW", 1e-3) if burns else ("battery energy", "Wh", "W", 1.0)
    )
    seconds = track.time
    used = doubles(track.energy)
    late = np.searchsorted(seconds, seconds - _POWER_WINDOW)
    span = np.maximum(seconds - seconds[late], 1e-9)
    power = np.where(late < np.arange(len(track)), 3600.0 * (used - used[late]) / span, np.nan)
    height = track.position[:, 2]
    kinetic = doubles(track.airspeed) ** 2 / (2.0 * GRAVITY)
    panels = [
        Panel(f"{store}\nused ({unit})", [Series("used", scale * used, filled=True)]),
        Panel(f"power\n({power_unit})", [Series(f"mean of {_POWER_WINDOW:g} s", scale * power)]),
        *([] if burns else [Panel("battery\ncurrent (A)", [Series("current", doubles(track.current))])]),
        Panel(
            "energy as\nheight (m)",
            [
                Series("height and speed", height + kinetic, color=drawing.BLUE, width=1.6),
                Series("height alone", height),
            ],
        ),
    ]
    whole = f"{scale * setup.battery:.0f} {unit} {'in full tanks' if burns else 'in a full battery'}"
    return Stack(_title(setup, f"energy, of {whole}"), panels, time_axis(track), track)


def _title(setup: FlightSetup, subject: str) -> str:
    return f"{drawing.shorten(setup.scenario.name, 60)}: {subject}"


def _panels(setup: FlightSetup, track: Track) -> list[Panel]:
    roll, _, _ = track.attitude.T
    bank = np.degrees(doubles(roll))
    limit = float(np.degrees(min(setup.max_bank, setup.envelope.max_bank)))
    commanded: dict[str, Any] = {"color": drawing.LIMIT, "width": 1.8}
    panels = [
        Panel(
            "airspeed\n(m/s)",
            [Series("commanded", doubles(track.speed_command), **commanded), Series("flown", doubles(track.airspeed))],
            least_span=4.0,
        ),
        Panel(
            "bank, right +\n(°)",
            [Series("flown", bank)],
            [("limit of planned turns;\ncorrections may pass it", limit), ("", -limit)],
        ),
        Panel("climb rate\n(m/s)", [Series("flown", doubles(_up(track.velocity)))], least_span=1.0),
        Panel("load factor\n(g)", [Series("flown", doubles(track.load_factor))], least_span=0.2),
        Panel("wind, with\ngusts (m/s)", [Series("flown", _wind_speed(track))], least_span=1.0),
        Panel("cross-track,\nright + (m)", [Series("as guidance saw it", doubles(track.cross_track))], least_span=0.1),
        Panel("height error,\nhigh + (m)", [Series("as guidance saw it", doubles(track.height_error))], least_span=0.1),
    ]
    terrain = setup.scenario.terrain
    if terrain is not None:
        ground = terrain.height(track.position[:, 0], track.position[:, 1])
        above = Series("from track and terrain", track.position[:, 2] - ground)
        panels.append(Panel("height above\nground (m)", [above], [("required", setup.scenario.limits.min_clearance_m)]))
    return panels


def _up(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    up: NDArray[np.float32]
    _, _, up = vectors.T
    return up


def _wind_speed(track: Track) -> NDArray[np.float64]:
    """Speed of the air over the ground, level part, (t,) m/s."""
    east, north, _ = doubles(track.wind).T
    speed: NDArray[np.float64] = np.hypot(east, north)
    return speed


# ----------------------------------------------------------------------
# Exposure along the flown track: its strength, from missiles and from radars, and its sum over time.

# Segments that the track is joined to for the curve; the sums stay those of straight segments.
_MAX_ROWS = 12_000


def exposure_rates(position: Floats, centres: Floats, radii: Floats, scales: Floats) -> Floats:
    """Mean of (scale/d)^4 inside each of m spheres on each segment (paper eq. 9 and 10), summed over the spheres.

    position: (t, 3) m.  centres: (m, 3).  radii, scales: (m,).  Returns (t - 1,), 1 at one scale's
    distance; NaN where the track is not a number.
    """
    return _rates(
        np.ascontiguousarray(position), np.ascontiguousarray(centres), np.ascontiguousarray(radii), scales.copy()
    )


@compiled
def _rates(position: Floats, centres: Floats, radii: Floats, scales: Floats) -> Floats:  # pragma: no cover - compiled
    count = position.shape[0] - 1
    out = np.zeros(max(0, count))
    for k in range(count):
        for m in range(centres.shape[0]):
            if radii[m] > 0.0:
                _, rate = segment_exposure(position[k], position[k + 1], centres[m], radii[m], scales[m])
                out[k] += rate
    return out


def draw_exposure(setup: FlightSetup, track: Track) -> Figure | None:
    """Panels along the flown distance, those of `exposure_stack`; None where the flight was exposed to nothing."""
    stack = exposure_stack(setup, track)
    return None if stack is None else draw_stack(stack)


def exposure_stack(setup: FlightSetup, track: Track) -> Stack | None:
    """Strength and sum of kill and of detection along the flown distance (km), of those that the flight was exposed to.

    None where it was exposed to nothing.
    """
    threats = setup.scenario.threats
    if not len(threats) or len(track) < 2:
        return None
    rows = np.unique(np.linspace(0, len(track) - 1, min(len(track), _MAX_ROWS)).astype(np.intp))
    rows = rows[np.isfinite(track.position[rows]).all(axis=1)]
    if rows.size < 2:
        return None
    time, position = track.time[rows], track.position[rows]
    steps = np.hypot(*np.diff(position[:, :2], axis=0).T)
    kilometres = np.concatenate([[0.0], np.cumsum(steps)]) / 1000.0
    panels: list[Panel] = []
    for name, colour, radii, scales in (
        ("kill", drawing.MISSILE, threats.kill_radius, threats.kill_scale),
        ("detection", drawing.RADAR, threats.detection_radius, threats.detection_scale),
    ):
        if not (radii > 0.0).any():
            continue
        rate = exposure_rates(position, threats.position, radii, scales)
        if not np.nansum(rate):
            continue
        total = np.concatenate([[0.0], np.cumsum(np.nan_to_num(rate) * np.diff(time))])
        strength = Series("strength", np.append(rate, rate[-1]), color=colour, filled=True)
        panels.append(Panel(f"{name}\nstrength (1)", [strength]))
        panels.append(Panel(f"{name}\nso far (s)", [Series("sum over time", total, color=colour, width=1.6)]))
    if not panels:
        return None
    whole = Track(*(getattr(track, item)[rows] for item in COLUMNS))
    title = f"{drawing.shorten(setup.scenario.name, 60)}: exposure along the flown track"
    return Stack(title, panels, Axis("distance flown over the ground (km)", kilometres), whole)
