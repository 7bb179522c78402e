"""Draw the chart of a departure window.

It shows the probability of a flyable flight, the wind and the energy by departure.
"""

import itertools
import math
from datetime import datetime
from typing import Any

from matplotlib import dates
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from logs import theme
from logs.views.drawing import clean_style, new_figure
from planfly.campaigns.find_window import WindowResult
from planfly.campaigns.window_text import rules_text

# matplotlib.dates, which has no types.
_DATES: Any = dates
_OPEN_COLOUR = theme.colour("good")
_CLOSED_COLOUR = theme.colour("bad")
_UNKNOWN_COLOUR = theme.colour("quiet")
_GRID_COLOUR = theme.colour("grid")
_INK_COLOUR = theme.colour("ink")
_WIND_COLOUR = theme.colour("second")
# Largest number of times on the axis; more times would overlap on a narrow page.
_MAX_TIME_TICKS = 7
# Largest number of departures for which each bar is labelled with its deciding rules.
_MAX_LABELS = 26


def draw_window(result: WindowResult) -> Figure:
    """Draw the chart of each departure.

    It shows the fraction of flyable flights, the deciding rules, the wind and the least energy.
    """
    with clean_style():
        figure = new_figure(6.4)
        probability = figure.add_axes((0.08, 0.54, 0.89, 0.37))
        wind = figure.add_axes((0.08, 0.30, 0.89, 0.17), sharex=probability)
        energy = figure.add_axes((0.08, 0.09, 0.89, 0.15), sharex=probability)
        departures = result.departures
        times = [_to_matplotlib_days(departure.time) for departure in departures]
        width = 0.8 * min((later - earlier for earlier, later in itertools.pairwise(times)), default=1.0 / 24.0)
        _draw_probability(probability, result, times, width)
        # Hatch the columns of the departures that are not judged.
        for axes, (time, departure) in itertools.product(
            (probability, wind, energy), zip(times, departures, strict=True)
        ):
            if not departure.rows:
                axes.axvspan(
                    time - 0.5 * width,
                    time + 0.5 * width,
                    facecolor="none",
                    edgecolor=_GRID_COLOUR,
                    hatch="///",
                    linewidth=0,
                )
        wind.plot(times, [departure.wind[0] for departure in departures], color=_WIND_COLOUR, marker="o", markersize=3)
        for time, departure in zip(times, departures, strict=True):
            speed, from_deg = departure.wind
            if not math.isnan(speed):
                # An arrow that points where the wind blows to.
                wind.annotate(
                    "↓",
                    (time, speed),
                    rotation=-from_deg,
                    ha="center",
                    va="bottom",
                    xytext=(0, 3),
                    textcoords="offset points",
                    fontsize=9,
                    color=_INK_COLOUR,
                )
        wind.set_ylim(bottom=0.0)
        wind.margins(y=0.35)
        wind.set_ylabel("wind at start (m/s)")
        energy.bar(times, [departure.energy_left for departure in departures], width, color=_GRID_COLOUR)
        energy.set_ylabel("least energy (Wh)")
        energy.set_xlabel("take-off (UTC)")
        for axes in (probability, wind, energy):
            axes.grid(axis="y", color=_GRID_COLOUR, linewidth=0.6)
            axes.set_axisbelow(True)
            for spine in ("top", "right"):
                axes.spines[spine].set_visible(False)
            axes.tick_params(labelbottom=axes is energy)
        locator = _DATES.AutoDateLocator(minticks=3, maxticks=_MAX_TIME_TICKS)
        energy.xaxis.set_major_locator(locator)
        energy.xaxis.set_major_formatter(_DATES.ConciseDateFormatter(locator))
    return figure


def _to_matplotlib_days(time: datetime) -> float:
    """Convert a time to matplotlib's number of days since 1970."""
    return time.timestamp() / 86_400.0


def _draw_probability(axes: Axes, result: WindowResult, times: list[float], width: float) -> None:
    """Draw the fraction of flyable flights of each departure, with its interval and the deciding rule.

    times: departures in days since 1970, (d,).
    width: width of a bar, days.
    """
    colours = {True: _OPEN_COLOUR, False: _CLOSED_COLOUR, None: _UNKNOWN_COLOUR}
    for time, departure in zip(times, result.departures, strict=True):
        if not departure.rows:
            axes.text(
                time, 0.5, "not judged", rotation=90, ha="center", va="center", color=_UNKNOWN_COLOUR, fontsize=7.5
            )
            continue
        is_known = departure.is_judged_in_full(result.goal.probability)
        colour = colours[result.is_open(departure) if is_known else None]
        axes.bar(time, departure.share, width, color=colour, alpha=0.75)
        low, high = departure.interval
        axes.plot([time, time], [low, high], color=_INK_COLOUR, linewidth=1.0)
        if departure.rules and len(times) <= _MAX_LABELS:
            text = f"{rules_text(departure)}  "
            axes.text(time, 0.03, text, rotation=90, ha="right", va="bottom", color=_INK_COLOUR, fontsize=7.5)
    axes.axhline(result.goal.probability, color=_INK_COLOUR, linewidth=1.0, linestyle="--")
    if result.goal.asked is not None:
        position = (_to_matplotlib_days(result.goal.asked), 1.03)
        axes.annotate(
            "requested", position, color=_WIND_COLOUR, ha="center", va="bottom", fontsize=8, fontweight="bold"
        )
    axes.set_ylim(0.0, 1.15)
    axes.set_yticks([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    axes.set_ylabel("flyable flights")
    axes.set_title(
        f"{result.base.name}: {result.goal.flights} flights at each take-off, green with at least"
        f" {result.goal.probability:.0%} flyable\n"
        "(thin line: 95 % interval; text at a bar: rules that fail the most flights; grey: not judged in full)",
        fontsize=9.5,
        pad=8,
    )
