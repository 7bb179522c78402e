"""A chart as plain data: panels of lines, bands, bars and dots with names, units and roles.

Two renderers draw a chart: `logs.views.drawing` with matplotlib, for PNG, SVG and paper; and the script of the HTML
page with plotly.js, from the data of `chart_json`.  A role is a word for what is drawn ("missile", "planned");
`logs.theme` gives each role its style.
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

# Names of the layer of waypoints, by the number that the chart shows at each waypoint.
NUMBERED_WAYPOINT = "waypoint, numbered"
NUMBERED_ITEM = "waypoint, with the number of its mission item"


@dataclass(frozen=True, slots=True)
class Layer:
    """One graphical layer of a panel.

    The page is the HTML page; its read-out shows the values at the pointer.

    kind: shape of the layer.  A "band" is filled from `lower_edge` up to `y`; an "area" is the inside of closed
        outlines; "dashes" are short horizontal strokes; "rings" mark failures.
    name: name in legend and read-out; "" leaves the layer out of both.
    role: meaning of the layer; `logs.theme` assigns its style.
    x, y: points in the panel's units, (n,) each; NaN separates parts of a line or an outline.
    lower_edge: lower edge of a band, (n,); None for 0.
    dashed: True to draw the line dashed, to tell it from another line of the same role.
    quiet: True for a layer that is in the legend but not in the read-out.
    legend: legend text shared with other layers; "" for the name.
    hover_texts: text that the page shows for each point, or one text for the whole layer; empty to show the values.
    flight: number of the flight whose track this layer of a map draws; the page then takes the points from the moments
        of that flight, so that they are not stored twice.  None for all other layers.
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
    """A text at a position of a panel; it is moved if it would overlap other labels.

    rank: importance and style.  A "fail" is framed; an "end" (start or destination) and a "number" are bold; a "name"
        is omitted if there is no free space.  The page writes only "end" and "number", and shows the others on hover.
    prefer: direction in which the text is moved first, as signs of x and y; (0, 0) centers it on the position.
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
    layers: layers in drawing order, the lowest first.
    limits: label and value of each horizontal limit line.
    min_span: smallest range of the vertical axis, in its unit, if `span` is not given.
    span: range of the vertical axis, (low, high); None for the range that layers and limits need.
    along: title of the horizontal axis if the panels do not share one, else "".
    note: text on values that the panel does not show; "" for none.
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
        """Title followed by the unit in parentheses; only the title if there is no unit."""
        return f"{self.title} ({self.unit})" if self.unit else self.title

    def has_values(self) -> bool:
        """Return True if any layer has a finite value."""
        return any(np.isfinite(layer.y).any() for layer in self.layers)

    def shown_span(self) -> tuple[float, float]:
        """Return the range of the vertical axis, (low, high).

        It is `span` if given.  Otherwise it contains all values and limits, is at least `min_span` wide, and has a
        margin of 8 % on either side.
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
    along, unit: quantity and unit of the horizontal axis that the panels share; "" if each panel has its own.
    axis_range: range of that axis; None for the range that the layers need.
    shared: True if the panels share the horizontal axis: they are zoomed and read out together.
    marks: start of each leg: position on the horizontal axis, and text.
    timed: True if the horizontal axis is the time of flight, so that a click on it can move the aircraft there.
    page_height: height of a panel on a page, pixels.
    print_height: height of a panel in print, inches.
    widths: width of each panel, as a fraction of the print's width, for panels side by side; empty for stacked panels.
    legend: position of the legend in print.  "beside" is right of each panel, or above all panels if one legend is
        enough; "below" is below all panels.
    scaled: True if print states how many times larger heights are drawn than distances.
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
        """Return the panels with a finite value; only the first panel if no panel has one."""
        return tuple(panel for panel in self.panels if panel.has_values()) or self.panels[:1]

    def shown_axis_range(self) -> tuple[float, float]:
        """Return the range of the horizontal axis: `axis_range`, or else the range of all x values.

        It is (0, 1) without values.
        """
        if self.axis_range is not None:
            return self.axis_range
        finite = [layer.x[np.isfinite(layer.x)] for panel in self.panels for layer in panel.layers]
        values = np.concatenate([*finite, np.zeros(0)])
        return (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)


def series(name: str, role: str, along: Floats, values: ArrayLike, **options: Any) -> Layer:
    """Make a line layer from a series of any length, thinned so that its peaks remain.

    along: position of each row on the horizontal axis, (t,).
    values: value of each row, (t,).
    options: other fields of `Layer`.
    """
    column = np.asarray(values, dtype=np.float64)
    rows = find_outline_rows(column, BLOCKS)
    return Layer("line", name, role, along[rows], column[rows], **options)


def filled_series(name: str, role: str, along: Floats, values: ArrayLike) -> Layer:
    """Make a layer like `series`, but a band from zero to the values."""
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

    is_saturated: True for each row in which the control is at its limit, (t,).
    axis_positions: position of each row on the horizontal axis, (t,).
    span: lower and upper edge of the shading on the vertical axis.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_saturated, [False]]).astype(np.int8)))
    starts, band_ends = axis_positions[edges[::2]], axis_positions[edges[1::2] - 1]
    gap = np.full(len(starts), np.nan)
    x = np.column_stack([starts, band_ends, band_ends]).ravel()
    y = np.column_stack([np.full(len(starts), span[1]), np.full(len(starts), span[1]), gap]).ravel()
    return Layer("band", "held at its limit", "held", x, y, np.full(len(x), span[0]), quiet=True)


def make_leg_marks(legs: NDArray[Any], axis_positions: Floats) -> tuple[tuple[float, str], ...]:
    """Return a mark at the start of each leg: its position on the horizontal axis, and its text.

    The text is "leg" with the number of the leg.

    legs: number of the active leg in each row, as in messages to the user, (t,), t >= 1.
    axis_positions: position of each row on the horizontal axis, (t,).
    """
    starts = [0, *(np.flatnonzero(np.diff(legs)) + 1).tolist()]
    return tuple((float(axis_positions[row]), f"leg {legs[row]}") for row in starts)


def find_outline_rows(values: ArrayLike, count: int) -> Indices:
    """Select rows of a long series so that a line through them has the same outline as the series.

    The series is divided into `count` blocks.  Return the indices of the first and the last row and of the lowest and
    the highest value in each block; all rows if the series has at most 2 * `count`.

    values: series, (t,); NaN values are skipped, but a block of only NaN keeps its first row, so that the gap shows.
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
    """Return the smallest round step that divides `span` into at most `max_count` steps.

    A round step is 1, 2 or 5 times a power of ten.
    """
    min_step = max(span, 1e-9) / max_count
    power = 10.0 ** np.floor(np.log10(min_step))
    for factor in (1.0, 2.0, 5.0, 10.0):
        if factor * power >= min_step * (1 - 1e-9):
            return float(factor * power)
    return float(10.0 * power)


def shorten(text: str, length: int) -> str:
    """Cut a text to at most `length` characters, the last of which is then an ellipsis.

    >>> shorten("clearance, leg 12", 12)
    'clearance,…'
    """
    return text if len(text) <= length else text[: length - 1].rstrip() + "…"


def json_numbers(values: Iterable[float], digits: int) -> list[float | None]:
    """Round values to `digits` decimals for JSON, and replace non-finite values by None.

    >>> json_numbers([1.26, math.nan], 1)
    [1.3, None]
    """
    rounded = np.round(np.asarray(values, dtype=np.float64), digits) + 0.0
    return [value if math.isfinite(value) else None for value in rounded.tolist()]


def screen_decimals(values: Floats) -> int:
    """Return the number of decimals that values need on a screen, 0 to 9.

    The last decimal is at most a ten-thousandth of the range of the finite values, or of the value if all are equal.

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
            document["x"] = json_numbers(layer.x, screen_decimals(layer.x))
            document["y"] = json_numbers(layer.y, screen_decimals(layer.y))
        if layer.lower_edge is not None:
            document["low"] = json_numbers(layer.lower_edge, screen_decimals(layer.lower_edge))
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
        "labels": [[label.text, *json_numbers((label.x, label.y), 3), label.role] for label in labels],
        "span": json_numbers(panel.shown_span(), 4),
    }


@dataclass(frozen=True, slots=True)
class LegendEntry:
    """One line of a legend: its text, and the layers with this text.

    The sample is drawn like the first of them.
    """

    text: str
    layers: tuple[Layer, ...] = field(default=())


def legend_entries(panels: Sequence[Panel]) -> tuple[LegendEntry, ...]:
    """Return the legend entries of panels, first those of layers, then those of limits.

    Layers with the same legend text share an entry.  Layers without a name or without values have no entry.
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
