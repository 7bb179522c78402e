"""The go/no-go chart: from each direction the largest wind in which a mission flies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from logs.figures.elements.style import BLUE, FAIL, INK, LIMIT, PLANNED, QUIET, clean_style, new_figure


@dataclass(frozen=True)
class Spoke:
    """A direction of the chart.

    from_deg: where the wind comes from.
    boundary: largest wind with the probability asked for, m/s, as estimated; low, high: its interval.
    reaches: whether the boundary lies beyond all that was looked at.
    flights: wind speed, flights and flyable ones, for the marks.
    """

    from_deg: float
    boundary: float
    low: float
    high: float
    reaches: bool
    flights: tuple[tuple[float, int, int], ...]


def draw_go_no_go(
    spokes: Sequence[Spoke], most: float, target: float, confidence: float, name: str, wind: tuple[float, float] | None
) -> Figure:
    """A polar chart: north up, wind from the direction that a spoke points to, speed outwards to ``most`` m/s.

    wind: the scenario's own, speed m/s and degrees, drawn as a star.
    """
    with clean_style():
        figure = new_figure(7.6)
        axes = figure.add_axes((0.06, 0.07, 0.64, 0.80), projection="polar")
        axes.set_theta_zero_location("N")  # type: ignore[attr-defined]  # of polar axes
        axes.set_theta_direction(-1)  # type: ignore[attr-defined]  # of polar axes
        angle = np.radians([one.from_deg for one in spokes] + [spokes[0].from_deg + 360.0])
        ring = [*spokes, spokes[0]]
        fine = np.linspace(angle[0], angle[-1], 720)

        def outline(values: Sequence[float]) -> np.ndarray:
            return np.interp(fine, angle, values)

        low, high = outline([one.low for one in ring]), outline([one.high for one in ring])
        boundary = outline([one.boundary for one in ring])
        axes.fill_between(fine, 0.0, low, color=PLANNED, alpha=0.45, linewidth=0.0)
        axes.fill_between(fine, boundary, most, color=FAIL, alpha=0.13, linewidth=0.0)
        axes.fill_between(fine, low, high, color=LIMIT, alpha=0.45, linewidth=0.0)
        axes.plot(fine, boundary, color=INK, linewidth=1.8)
        for one in spokes:
            for speed, flights, flyable in one.flights:
                all_well = flights == flyable
                axes.plot(
                    np.radians(one.from_deg), speed, marker="o" if all_well else "x", color=BLUE if all_well else FAIL,
                    markersize=2.6 if all_well else 3.6, linewidth=0.0, alpha=0.75,
                )  # fmt: skip
        if wind is not None:
            axes.plot(np.radians(wind[1]), wind[0], marker="*", color=INK, markersize=13, markeredgecolor="white")
        axes.set_ylim(0.0, most)
        axes.set_xticks(np.radians(np.arange(0, 360, 45)), ["N", "NE", "E", "SE", "S", "SW", "W", "NW"])
        axes.set_rlabel_position(11.0)  # type: ignore[attr-defined]  # of polar axes
        axes.tick_params(axis="y", labelsize=8)
        axes.grid(color="#cccccc", linewidth=0.6)
        figure.text(0.03, 0.955, f"{name}: in which wind it flies", fontsize=14, color=INK)
        figure.text(
            0.03, 0.922, f"wind from each direction, m/s; flies with a probability of {target:g} or more",
            fontsize=9, color=QUIET,
        )  # fmt: skip
        _legend(figure, target, confidence, wind)
    return figure


def _legend(figure: Figure, target: float, confidence: float, wind: tuple[float, float] | None) -> None:
    from matplotlib.artist import Artist
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[tuple[Artist, str]] = [
        (Patch(color=PLANNED, alpha=0.45), f"go: P >= {target:g} also at the\nlow end of the interval"),
        (Line2D([], [], color=INK, linewidth=1.8), f"boundary, P = {target:g}"),
        (Patch(color=LIMIT, alpha=0.45), f"its interval, {100 * confidence:g} %"),
        (Patch(color=FAIL, alpha=0.13), f"no-go: P < {target:g}"),
        (Line2D([], [], color=BLUE, marker="o", markersize=3, linewidth=0), "flown, all flyable"),
        (Line2D([], [], color=FAIL, marker="x", markersize=4, linewidth=0), "flown, some not"),
    ]
    if wind is not None:
        entries.append((Line2D([], [], color=INK, marker="*", markersize=11, linewidth=0), "the scenario's wind"))
    figure.legend(
        [handle for handle, _ in entries], [label for _, label in entries],
        loc="center left", bbox_to_anchor=(0.735, 0.45), fontsize=9, labelspacing=1.0,
    )  # fmt: skip
