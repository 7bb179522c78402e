"""A chart as plain data: panels of lines, bands, bars and dots with names, looks and units; the page's script draws it.

A look is a word ("planned", "missile"), never a colour: the page has one set of colours for light and one for dark.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
LayerKind = Literal["line", "band", "bars", "dots", "rings", "dashes"]
Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Layer:
    """One thing that a panel shows.

    kind: "dashes" are short level strokes, "rings" mark what fails; "band" is filled from `low` up to `y`.
    name: in legend and read-out; "" leaves it out of both.
    look: how it looks, a word of the page's style.
    x, y: (n,) in the panel's units; not-a-number parts a line.
    low: (n,) lower edge of a band.
    width: of a line, pixels.
    dashed: whether a line is.
    quiet: it is in the legend and not in the read-out.
    legend: what the legend calls it, where that stands for several; "" for its name.
    """

    kind: LayerKind
    name: str
    look: str
    x: Floats
    y: Floats
    low: Floats | None = None
    width: float = 1.5
    dashed: bool = False
    quiet: bool = False
    legend: str = ""


@dataclass(frozen=True, slots=True)
class ChartPanel:
    """Layers over one pair of axes.

    title: of the upright axis, without its unit.
    unit: of what is shown upwards; "" for none.
    layers: from the lowest.
    limits: level lines, label and value.
    span: the range shown upwards, (low, high); None for what the layers need.
    along: of the level axis where the panels share none, else "".
    note: what the panel does not show; "" for nothing.
    """

    title: str
    unit: str
    layers: tuple[Layer, ...]
    limits: tuple[tuple[str, float], ...] = ()
    span: tuple[float, float] | None = None
    along: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class Chart:
    """Panels one above the other.

    along, unit: what the level axis shows, and its unit, of panels that share one.
    panels: from the top.
    shared: whether the panels share the level axis: zoomed and read out together.
    marks: where legs begin, as value along the axis and words.
    timed: whether the level axis is the time of flight, so that a click on it can move the aircraft there.
    tall: height of a panel, pixels.
    """

    along: str
    unit: str
    panels: tuple[ChartPanel, ...]
    shared: bool = True
    marks: tuple[tuple[float, str], ...] = ()
    timed: bool = False
    tall: int = 120


def numbers(values: Iterable[float], digits: int) -> list[float | None]:
    """Numbers for JSON: rounded, None for what is not finite.

    >>> numbers([1.26, math.nan], 1)
    [1.3, None]
    """
    rounded = np.round(np.asarray(values, dtype=np.float64), digits) + 0.0
    return [value if math.isfinite(value) else None for value in rounded.tolist()]


def telling_digits(values: Floats) -> int:
    """Decimals that show a ten-thousandth of the range of values: as fine as a screen can.

    >>> telling_digits(np.array([0.0, 90.0])), telling_digits(np.array([0.001, 0.002]))
    (3, 7)
    """
    finite = values[np.isfinite(values)]
    span = float(np.ptp(finite)) if finite.size else 0.0
    span = span or (float(abs(finite[0])) if finite.size else 0.0) or 1.0
    return max(0, min(9, 4 - math.floor(math.log10(span) + 1e-9)))


def chart_json(chart: Chart) -> Json:
    """The chart as what JSON can hold.

    >>> line = Layer("line", "flown", "flown", np.array([0.0, 1.0]), np.array([2.0, np.nan]))
    >>> made = chart_json(Chart("time", "s", (ChartPanel("bank", "°", (line,)),)))
    >>> made["panels"][0]["layers"][0]["y"]
    [2.0, None]
    """
    return {
        "along": chart.along,
        "unit": chart.unit,
        "shared": chart.shared,
        "timed": chart.timed,
        "tall": chart.tall,
        "marks": [[round(value, 3), words] for value, words in chart.marks],
        "panels": [_panel_json(panel) for panel in chart.panels],
    }


def _panel_json(panel: ChartPanel) -> Json:
    found: Json = {
        "title": panel.title,
        "unit": panel.unit,
        "along": panel.along,
        "note": panel.note,
        "limits": [[label, round(value, 4)] for label, value in panel.limits if math.isfinite(value)],
        "layers": [_layer_json(layer) for layer in panel.layers if np.isfinite(layer.y).any()],
    }
    return found if panel.span is None else found | {"span": numbers(panel.span, 4)}


def _layer_json(layer: Layer) -> Json:
    found: Json = {
        "kind": layer.kind,
        "name": layer.name,
        "look": layer.look,
        "x": numbers(layer.x, telling_digits(layer.x)),
        "y": numbers(layer.y, telling_digits(layer.y)),
        "width": layer.width,
    }
    if layer.low is not None:
        found["low"] = numbers(layer.low, telling_digits(layer.low))
    rarer = {"dashed": layer.dashed, "quiet": layer.quiet, "legend": layer.legend}
    return found | {word: value for word, value in rarer.items() if value}
