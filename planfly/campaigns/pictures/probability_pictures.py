"""The probability against the wind's speed, and what the deciding margin depends on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from logs.figures.elements.style import BLUE, FAIL, INK, LIMIT, PLANNED, QUIET, clean_style, new_figure
from planfly.campaigns.statistics.proportions import Interval, wilson

Floats = NDArray[np.float64]

# Speeds are put together in steps of so many m/s, or wider where that would make more than so many.
_STEP, _MOST_BINS = 1.0, 20


@dataclass(frozen=True)
class SpeedBin:
    """Flights in a range of wind speeds (m/s), how many of them are flyable, and Wilson's interval of that share."""

    low: float
    high: float
    flights: int
    flyable: int
    interval: Interval


@dataclass(frozen=True)
class Bar:
    """A quantity's title, its first-order index (0 to 1), and which way the margin goes with it (-1 to 1)."""

    title: str
    index: float
    slope: float


def speed_bins(speed: Floats, flyable: NDArray[np.bool_], confidence: float = 0.95) -> list[SpeedBin]:
    """Flights by wind speed (n,) m/s; ranges without a flight are left out.

    >>> [one.flights for one in speed_bins(np.array([0.2, 0.7, 2.5]), np.array([True, False, True]))]
    [2, 1]
    """
    if not speed.size:
        return []
    width = max(_STEP, float(np.ptp(speed)) / _MOST_BINS)
    group = np.floor(speed / width).astype(int)
    bins = []
    for number in np.unique(group):
        mine = flyable[group == number]
        whole, good = int(mine.size), int(mine.sum())
        bins.append(SpeedBin(number * width, (number + 1) * width, whole, good, wilson(good, whole, confidence)))
    return bins


def draw_probability(bins: Sequence[SpeedBin], target: float | None) -> Figure:
    """P against wind speed, with its band and the number of flights in each range."""
    with clean_style():
        figure = new_figure(4.2)
        axes = figure.add_axes((0.08, 0.16, 0.89, 0.70))
        middle = [0.5 * (one.low + one.high) for one in bins]
        share = [one.flyable / one.flights for one in bins]
        for one, x, p in zip(bins, middle, share, strict=True):
            axes.fill_between(
                [one.low, one.high], one.interval.low, one.interval.high, color=PLANNED, alpha=0.35, linewidth=0.0
            )
            axes.plot([one.low, one.high], [p, p], color=BLUE, linewidth=2.0)
            axes.annotate(
                f"{one.flights}",
                (x, 0.0),
                xytext=(0, 3),
                textcoords="offset points",
                ha="center",
                fontsize=7,
                color=QUIET,
            )
        if target is not None:
            axes.axhline(target, color=LIMIT, linewidth=1.2, linestyle="--")
            axes.annotate(f"target {target:g}", (1.0, target), xycoords=("axes fraction", "data"), xytext=(-4, -11),
                          textcoords="offset points", ha="right", color=INK, fontsize=8)  # fmt: skip
        axes.set_ylim(-0.02, 1.05)
        axes.set_xlabel("mean wind at the start's height (m/s)")
        axes.set_ylabel("share of flyable flights")
        axes.set_title("Probability against wind speed: line its share, band Wilson's interval, below how many flew")
        _light(axes)
    return figure


def draw_tornado(bars: Sequence[Bar], of_what: str) -> Figure:
    """What the deciding margin's variance comes from: to the right more of the quantity helps, to the left it harms."""
    with clean_style():
        tall = 1.2 + 0.3 * max(1, len(bars))
        figure = new_figure(tall)
        axes = figure.add_axes((0.17, 0.5 / tall, 0.79, 1.0 - 1.1 / tall))
        rows = range(len(bars))
        for row, bar in zip(rows, bars, strict=True):
            length = bar.index * (1.0 if bar.slope >= 0.0 else -1.0)
            axes.barh(row, length, height=0.62, color=BLUE if length >= 0.0 else FAIL)
            axes.annotate(
                f"{100.0 * bar.index:.0f} %", (length, row), xytext=(4 if length >= 0.0 else -4, 0),
                textcoords="offset points", va="center", ha="left" if length >= 0.0 else "right", fontsize=8,
            )  # fmt: skip
        axes.axvline(0.0, color=INK, linewidth=0.8)
        axes.set_yticks(list(rows), [bar.title for bar in bars])
        axes.invert_yaxis()
        reach = max([0.2, *(1.25 * bar.index for bar in bars)])
        axes.set_xlim(-reach, reach)
        axes.set_xlabel("share of the margin's variance   (left: more of it leaves less margin; right: more)")
        axes.set_title(f"What decides: first-order sensitivity of the margin of {of_what}")
        axes.set_xticks([])
        for side in ("top", "right", "left"):
            axes.spines[side].set_visible(False)
        axes.tick_params(left=False)
    return figure


def _light(axes: object) -> None:
    from matplotlib.axes import Axes

    if isinstance(axes, Axes):
        axes.grid(visible=True, color="#dddddd", linewidth=0.6)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
