"""The charts over time and distance: the panels of the drawn pictures, to be pointed at."""

import numpy as np
from numpy.typing import NDArray

from flight.simulation.track import Track
from logs.figures.elements import style
from logs.figures.elements.panels import Axis, Panel, Series, Stack
from logs.report.charts.chart import Chart, ChartPanel, Floats, Layer, LayerKind

# What a colour of the pictures stands for.
LOOKS = {
    style.FLOWN: "flown", style.PLANNED: "planned", style.LIMIT: "commanded", style.MISSILE: "missile",
    style.RADAR: "radar", style.BLUE: "second", style.FAIL: "fail",
}  # fmt: skip
# Blocks that a series is thinned to; each keeps its lowest and highest row.
_BLOCKS = 600


def stack_chart(stack: Stack) -> Chart:
    """Make a chart of a stack of panels; those without a value are left out.

    >>> from logs.figures.elements.panels import Axis, Panel, Series
    >>> along = Axis("time since the start (s)", np.array([0.0, 1.0]))
    >>> chart = stack_chart(Stack("a flight", [Panel("bank (°)", [Series("flown", along.values)])], along, None))
    >>> chart.along, chart.unit, chart.panels[0].title, chart.panels[0].unit
    ('time since the start', 's', 'bank', '°')
    """
    along, unit = parted_unit(stack.axis.label)
    panels = tuple(_panel(panel, stack.axis) for panel in stack.shown())
    marks = () if stack.track is None else _legs(stack.track, stack.axis.values)
    return Chart(along, unit, panels, marks=marks, timed=unit == "s")


def parted_unit(label: str) -> tuple[str, str]:
    """An axis' label as words and unit, which stands in parentheses at its end; "" for a unit of 1.

    >>> parted_unit("bank, right + (°)"), parted_unit("kill strength (1)"), parted_unit("name")
    (('bank, right +', '°'), ('kill strength', ''), ('name', ''))
    """
    words, bracket, unit = " ".join(label.split()).rpartition(" (")
    if not bracket:
        return unit, ""
    unit = unit.removesuffix(")")
    return words, "" if unit == "1" else unit


def _panel(panel: Panel, axis: Axis) -> ChartPanel:
    title, unit = parted_unit(panel.title)
    layers = [_layer(line, axis.values) for line in panel.series]
    held = panel.held
    if held is not None and held.any():
        layers.insert(0, _held(held, panel, axis.values))
    limits = tuple((" ".join(label.split()), value) for label, value in panel.limits)
    return ChartPanel(title, unit, tuple(layers), limits, span=_span(panel))


def _layer(line: Series, along: Floats) -> Layer:
    rows = style.outline_rows(line.values, _BLOCKS)
    x, y = along[rows], line.values[rows]
    look = LOOKS[line.color]
    low = np.zeros(len(y)) if line.filled else None
    kind: LayerKind = "band" if line.filled else "line"
    dashed = line.dashes != "-"
    return Layer(kind, line.label, look, x, y, low, width=max(1.2, line.width), dashed=dashed)


def _held(held: NDArray[np.bool_], panel: Panel, along: Floats) -> Layer:
    """The stretches at the limit as a band over the whole panel; not-a-number parts them."""
    low, high = _span(panel)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(np.int8)))
    starts, ends = along[edges[::2]], along[edges[1::2] - 1]
    gap = np.full(len(starts), np.nan)
    x = np.column_stack([starts, ends, ends]).ravel()
    y = np.column_stack([np.full(len(starts), high), np.full(len(starts), high), gap]).ravel()
    return Layer("band", "held at its limit", "fail", x, y, np.full(len(x), low), width=0.0, quiet=True)


def _span(panel: Panel) -> tuple[float, float]:
    """The range of values and limits, no less than the panel's least, with some room."""
    values = [value for _, value in panel.limits if np.isfinite(value)]
    for line in panel.series:
        finite = line.values[np.isfinite(line.values)]
        values += [float(finite.min()), float(finite.max())] if finite.size else []
    low, high = (min(values), max(values)) if values else (0.0, 1.0)
    widening = max(0.0, panel.least_span - (high - low)) / 2
    room = 0.08 * (high - low + 2 * widening)
    return low - widening - room, high + widening + room


def _legs(track: Track, along: Floats) -> tuple[tuple[float, str], ...]:
    """Where each leg begins along the axis, and its name."""
    starts = [0, *(np.flatnonzero(np.diff(track.leg)) + 1).tolist()]
    return tuple((float(along[row]), f"leg {track.leg[row]}") for row in starts)
