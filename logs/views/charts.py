"""A chart as plain data: panels of lines, bands, bars and dots with names, units and roles.

Two renderers draw a chart: `logs.views.drawing` with matplotlib, for PNG, SVG and paper, and the script of the page
with plotly.js, from `chart_json`.  A role is a word ("missile", "planned") whose style is in `logs.theme`.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from world.arrays import Floats

Indices = NDArray[np.intp]
Json = dict[str, Any]

LayerKind = Literal["line", "band", "area", "bars", "dots", "rings", "dashes"]
LabelRank = Literal["fail", "end", "number", "name"]
# Number of blocks that a series is thinned to; each block keeps its lowest and highest row.
BLOCKS = 600

# Names of the layer of waypoints, by the number that is shown at each.
NUMBERED_WAYPOINT = "waypoint, numbered"
NUMBERED_ITEM = "waypoint, with the number of its mission item"


@dataclass(frozen=True, slots=True)
class Layer:
    """One graphical layer of a panel.

    kind: "band" is filled from `lower_edge` up to `y`, "area" is the inside of closed outlines, "dashes" are short
        horizontal strokes, "rings" mark failures.
    name: name in legend and read-out; "" leaves the layer out of both.
    role: meaning of the layer; `logs.theme` assigns its style.
    x, y: (n,) in the panel's units; NaN separates parts of a line or an outline.
    lower_edge: (n,) lower edge of a band.
    dashed: True for the second of two lines of one role.
    quiet: True for a layer in the legend but not in the read-out of the page.
    legend: common legend text of several layers; "" for the name.
    hover_texts: text of the page on each point, or one text on the whole layer; empty to show the values.
    flight: number of the flight whose track a map draws by this layer; the page takes its points from the flight's
        moments, which it has anyway.  None for all other layers.
    """

    kind: LayerKind
    name: str
    role: str
    x: Floats
    y: Floats
    lower_edge: Floats | None = None
    dashed: bool = False
    quiet: bool = False
    legend: str = ""
    hover_texts: tuple[str, ...] = ()
    flight: int | None = None


@dataclass(frozen=True, slots=True)
class Label:
    """A text at a position of a panel, moved away from other labels.

    A "name" without free space is omitted.

    rank: "fail" is framed, "end" and "number" are bold; the page writes these two and shows the others on hover.
    prefer: direction tried first; (0, 0) centers the text on the position.
    """

    text: str
    x: float
    y: float
    rank: LabelRank
    role: str = "ink"
    prefer: tuple[int, int] = (1, 1)


@dataclass(frozen=True, slots=True)
class Panel:
    """Layers over one pair of axes.

    title, unit: quantity and unit of the vertical axis; unit "" for none.
    layers: layers from the lowest.
    limits: label and value of horizontal lines.
    min_span: smallest range of values shown if `span` is not given.
    span: range of the vertical axis, (low, high); None for the range that layers and limits need.
    along: title of the horizontal axis if the panels do not share one, else "".
    note: note on values that the panel does not show; "" for none.
    labels: labels, the most important first.
    """

    title: str
    unit: str
    layers: tuple[Layer, ...]
    limits: tuple[tuple[str, float], ...] = ()
    min_span: float = 1.0
    span: tuple[float, float] | None = None
    along: str = ""
    note: str = ""
    labels: tuple[Label, ...] = ()

    @property
    def label(self) -> str:
        """Title and unit."""
        return f"{self.title} ({self.unit})" if self.unit else self.title

    def has_values(self) -> bool:
        """Return True if any layer has a finite value."""
        return any(np.isfinite(layer.y).any() for layer in self.layers)

    def shown_span(self) -> tuple[float, float]:
        """Return the range of the vertical axis that is drawn, (low, high).

        It is `span`, or else the range of values and limits, at least `min_span` wide, with an 8 % margin.
        """
        if self.span is not None:
            return self.span
        values = [value for _, value in self.limits if math.isfinite(value)]
        for layer in self.layers:
            for edge in (layer.y, layer.lower_edge):
                finite = edge[np.isfinite(edge)] if edge is not None else np.zeros(0)
                values += [float(finite.min()), float(finite.max())] if finite.size else []
        min_value, max_value = (min(values), max(values)) if values else (0.0, 1.0)
        widening = max(0.0, self.min_span - (max_value - min_value)) / 2
        margin = 0.08 * (max_value - min_value + 2 * widening)
        return min_value - widening - margin, max_value + widening + margin


@dataclass(frozen=True, slots=True)
class Chart:
    """Panels one above the other, or side by side.

    title: title of a picture; a page has its own headings.
    along, unit: quantity and unit of a shared horizontal axis.
    axis_range: range of that axis; None for the range that the layers need.
    shared: True if the panels share the horizontal axis: they are zoomed and read out together.
    marks: starts of legs, as value along the axis and text.
    timed: True if the horizontal axis is the time of flight, so that a click on it can move the aircraft there.
    page_height: height of a panel on a page, pixels.
    print_height: height of a panel in print, inches.
    widths: widths of panels side by side in print, as fractions of its width; empty for stacked panels.
    legend: position in print: right of each panel (once above all if the panels share it), or below all.
    scaled: True if print states the factor by which heights are stretched against distances.
    """

    title: str
    along: str
    unit: str
    panels: tuple[Panel, ...]
    axis_range: tuple[float, float] | None = None
    shared: bool = True
    marks: tuple[tuple[float, str], ...] = ()
    timed: bool = False
    page_height: int = 120
    print_height: float = 1.12
    widths: tuple[float, ...] = ()
    legend: Literal["beside", "below"] = "beside"
    scaled: bool = False

    def shown_panels(self) -> tuple[Panel, ...]:
        """Return the panels that have a value, or the first panel if none has any."""
        return tuple(panel for panel in self.panels if panel.has_values()) or self.panels[:1]

    def shown_axis_range(self) -> tuple[float, float]:
        """Return `axis_range`, or else the range of the values along the axis; (0, 1) without values."""
        if self.axis_range is not None:
            return self.axis_range
        finite = [layer.x[np.isfinite(layer.x)] for panel in self.panels for layer in panel.layers]
        values = np.concatenate([*finite, np.zeros(0)])
        return (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)


def series(name: str, role: str, along: Floats, values: ArrayLike, **options: Any) -> Layer:
    """Make a line layer from a long series, thinned so that its peaks remain.

    along, values: position along the axis, and value, of each row, (t,).
    options: other fields of `Layer`.
    """
    column = np.asarray(values, dtype=np.float64)
    rows = find_outline_rows(column, BLOCKS)
    return Layer("line", name, role, along[rows], column[rows], **options)


def filled_series(name: str, role: str, along: Floats, values: ArrayLike) -> Layer:
    """Make a layer like `series` does, filled between zero and the values."""
    column = np.asarray(values, dtype=np.float64)
    rows = find_outline_rows(column, BLOCKS)
    return Layer("band", name, role, along[rows], column[rows], np.zeros(len(rows)))


def join_with_gaps(parts: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Join lines into the x and y of one layer, with a gap (NaN) after each line.

    Lines without points are left out.

    parts: points of each line, (k, 2).

    >>> x, y = join_with_gaps([np.zeros((2, 2)), np.ones((1, 2))])
    >>> x.tolist()
    [0.0, 0.0, nan, 1.0, nan]
    """
    gap = np.full((1, 2), np.nan)
    points = np.vstack([lines for part in parts if len(part) for lines in (part, gap)] or [np.zeros((0, 2))])
    return points[:, 0], points[:, 1]


def make_saturation_band(is_saturated: NDArray[np.bool_], axis_positions: Floats, span: tuple[float, float]) -> Layer:
    """Return a layer that shades the parts of the horizontal axis in which a control is at its limit.

    is_saturated: True at rows where the control is at its limit, (t,).
    axis_positions: position of each row along the axis, (t,).
    span: lower and upper edge of the shaded bands.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_saturated, [False]]).astype(np.int8)))
    starts, band_ends = axis_positions[edges[::2]], axis_positions[edges[1::2] - 1]
    gap = np.full(len(starts), np.nan)
    x = np.column_stack([starts, band_ends, band_ends]).ravel()
    y = np.column_stack([np.full(len(starts), span[1]), np.full(len(starts), span[1]), gap]).ravel()
    return Layer("band", "held at its limit", "held", x, y, np.full(len(x), span[0]), quiet=True)


def make_leg_marks(legs: NDArray[Any], axis_positions: Floats) -> tuple[tuple[float, str], ...]:
    """Return a mark at the start of each leg: its position along an axis, and the leg's name.

    legs: leg of each row, by its number in messages, (t,).
    axis_positions: position of each row along the axis, (t,).
    """
    starts = [0, *(np.flatnonzero(np.diff(legs)) + 1).tolist()]
    return tuple((float(axis_positions[row]), f"leg {legs[row]}") for row in starts)


def find_outline_rows(values: ArrayLike, count: int) -> Indices:
    """Return the rows of the lowest and highest value of each of `count` blocks of a long series.

    A line through these rows has the same outline as the series.  The first and the last row are included.  All rows of
    a short series are returned.

    values: (t,); NaN rows are omitted unless a block has no other rows.
    """
    column = np.asarray(values, dtype=np.float64)
    if column.size <= 2 * count:
        return np.arange(column.size)
    edges = np.linspace(0, column.size, count + 1).astype(np.intp)
    starts, block_ends = edges[:-1], edges[1:]
    rows = starts[:, None] + np.arange(np.diff(edges).max())
    blocks = column[np.minimum(rows, column.size - 1)]
    is_known = (rows < block_ends[:, None]) & np.isfinite(blocks)
    # A block without known values keeps its first row.
    min_rows = starts + np.where(is_known, blocks, np.inf).argmin(axis=1)
    max_rows = starts + np.where(is_known, blocks, -np.inf).argmax(axis=1)
    return np.unique(np.concatenate([[0, column.size - 1], min_rows, max_rows]))


def nice_step(span: float, max_count: int) -> float:
    """Return the tick step for at most `max_count` steps in `span`: 1, 2 or 5 times a power of ten."""
    min_step = max(span, 1e-9) / max_count
    power = 10.0 ** np.floor(np.log10(min_step))
    for factor in (1.0, 2.0, 5.0, 10.0):
        if factor * power >= min_step * (1 - 1e-9):
            return float(factor * power)
    return float(10.0 * power)


def shorten(text: str, length: int) -> str:
    """Cut the text with an ellipsis to at most `length` characters.

    >>> shorten("clearance, leg 12", 12)
    'clearance,…'
    """
    return text if len(text) <= length else text[: length - 1].rstrip() + "…"


def numbers(values: Iterable[float], digits: int) -> list[float | None]:
    """Return numbers for JSON: rounded, with None for non-finite values.

    >>> numbers([1.26, math.nan], 1)
    [1.3, None]
    """
    rounded = np.round(np.asarray(values, dtype=np.float64), digits) + 0.0
    return [value if math.isfinite(value) else None for value in rounded.tolist()]


def screen_decimals(values: Floats) -> int:
    """Return the number of decimals that drawing on a screen needs: a ten-thousandth of the values' range.

    >>> screen_decimals(np.array([0.0, 90.0])), screen_decimals(np.array([0.001, 0.002]))
    (3, 7)
    """
    finite = values[np.isfinite(values)]
    span = float(np.ptp(finite)) if finite.size else 0.0
    span = span or (float(abs(finite[0])) if finite.size else 0.0) or 1.0
    return max(0, min(9, 4 - math.floor(math.log10(span) + 1e-9)))


def chart_json(chart: Chart) -> Json:
    """Return the chart as JSON data for the page.

    >>> line = Layer("line", "flown", "flown", np.array([0.0, 1.0]), np.array([2.0, np.nan]))
    >>> made = chart_json(Chart("a flight", "time", "s", (Panel("bank", "°", (line,)),)))
    >>> made["panels"][0]["layers"][0]["y"]
    [2.0, None]
    """
    return {
        "along": chart.along,
        "unit": chart.unit,
        "shared": chart.shared,
        "timed": chart.timed,
        "tall": chart.page_height,
        "marks": [[round(value, 3), text] for value, text in chart.marks],
        "panels": [panel_json(panel) for panel in chart.shown_panels()],
    }


def panel_json(panel: Panel) -> Json:
    """Return a panel as JSON data for the page; layers without a value and NaN limits are omitted."""
    labels = [label for label in panel.labels if label.rank in ("end", "number")]
    layers = []
    for layer in panel.layers:
        if not np.isfinite(layer.y).any():
            continue
        document: Json = {"kind": layer.kind, "name": layer.name, "role": layer.role}
        if layer.flight is None:
            document["x"] = numbers(layer.x, screen_decimals(layer.x))
            document["y"] = numbers(layer.y, screen_decimals(layer.y))
        if layer.lower_edge is not None:
            document["low"] = numbers(layer.lower_edge, screen_decimals(layer.lower_edge))
        optional_keys: Json = {
            "dashed": layer.dashed,
            "quiet": layer.quiet,
            "legend": layer.legend,
            "words": list(layer.hover_texts),
        }
        document |= {key: value for key, value in optional_keys.items() if value}
        if layer.flight is not None:
            document["flight"] = layer.flight
        layers.append(document)
    return {
        "title": panel.title,
        "unit": panel.unit,
        "along": panel.along,
        "note": panel.note,
        "limits": [[label, round(value, 4)] for label, value in panel.limits if math.isfinite(value)],
        "layers": layers,
        "labels": [[label.text, *numbers((label.x, label.y), 3), label.role] for label in labels],
        "span": numbers(panel.shown_span(), 4),
    }


@dataclass(frozen=True, slots=True)
class LegendEntry:
    """One line of a legend: its text, and its layers, the first of which is drawn as the sample."""

    text: str
    layers: tuple[Layer, ...] = field(default=())


def legend_entries(panels: Sequence[Panel]) -> tuple[LegendEntry, ...]:
    """Return the legend of panels: an entry for each text of a layer, then one for each label of a limit.

    Layers with the same legend text share an entry; layers without a name or without values have none.
    """
    layers_by_name: dict[str, list[Layer]] = {}
    for panel in panels:
        for layer in panel.layers:
            if layer.name and np.isfinite(layer.y).any():
                layers_by_name.setdefault(layer.legend or layer.name, []).append(layer)
    for panel in panels:
        for label, _ in panel.limits:
            if label:
                empty = np.zeros(0)
                layers_by_name.setdefault(label, []).append(Layer("line", label, "limit", empty, empty))
    return tuple(LegendEntry(text, tuple(layers)) for text, layers in layers_by_name.items())
