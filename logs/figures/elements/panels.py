"""Stacked panels over one axis: series, limits and legs, as the time, control and energy pictures share them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from flight.simulation.track import Track
from logs.figures.elements import style

Floats = NDArray[np.float64]

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
    color: str = style.FLOWN
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
    with style.clean_style():
        figure = style.new_figure(total)
        for row, panel in enumerate(panels):
            base = _BOTTOM + (len(panels) - 1 - row) * (_PANEL + _GAP)
            frame = (_LEFT / style.WIDTH, base / total, 1 - (_LEFT + right) / style.WIDTH, _PANEL / total)
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
        figure.text(_LEFT / style.WIDTH, 1 - 0.3 / total, title, fontsize=11, fontweight="bold", va="center")
        if shared:
            _legend_above(figure, 1 - 0.45 / total)
    return figure


def _has_values(panel: Panel) -> bool:
    return any(np.isfinite(line.values).any() for line in panel.series)


def shares_legend(panels: Sequence[Panel]) -> bool:
    """Whether one legend can stand for all panels: no look has two meanings, no meaning two looks, some repeat.

    >>> flown, asked = Series("flown", np.zeros(2)), Series("commanded", np.zeros(2), color=style.LIMIT)
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
        bbox_to_anchor=(_LEFT / style.WIDTH - 0.01, top),
        ncols=len(entries),
        handlelength=2.2,
        borderaxespad=0.0,
        borderpad=0.2,
    )


def _draw(axes: Any, panel: Panel, along: Floats) -> None:
    for label, value in panel.limits:
        axes.axhline(value, color=style.MISSILE, linewidth=1.0, linestyle=(0, (5, 2)), label=label or None, zorder=2)
    if panel.held is not None and panel.held.any():
        frame = axes.get_xaxis_transform()
        look: dict[str, Any] = {"color": style.FAIL, "alpha": 0.25, "linewidth": 0, "zorder": 0.5}
        axes.fill_between(along, 0.0, 1.0, where=panel.held, transform=frame, label="held at its limit", **look)
    extremes = [value for _, value in panel.limits]
    for line in panel.series:
        rows = style.outline_rows(line.values, _BLOCKS)
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
    axes.xaxis.set_major_locator(MultipleLocator(style.nice_step(float(np.ptp(axes.get_xlim())), 14)))
    axes.set_ylabel(panel.title)
    axes.yaxis.set_label_coords(-_LABEL / (style.WIDTH * axes.get_position().width), 0.5)
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
        axes.annotate(text, (middle, 1.0), (0, 3), color=style.QUIET, annotation_clip=False, **anchor)
        last = middle
