"""Draw the chart of a battery.

It shows the share of the flights that keep the reserve, by the battery's capacity.
"""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from logs import theme
from logs.views.drawing import clean_style, new_figure
from planfly.campaigns.find_battery import BatteryResult
from world.arrays import Floats

# Largest ratio of the aircraft's own capacity to the other capacities at which the axis still includes it.
_MAX_OWN_RATIO = 2.5


def draw_battery(result: BatteryResult) -> Figure:
    """Draw the share of the flights that keep the reserve over the battery capacity.

    The found capacity and the aircraft's own capacity are marked.  A flight keeps no reserve if it does not complete
    the mission, or if one of its returns does not arrive.
    """
    goal = result.goal
    required_capacities = np.sort([row.required_capacity(goal.reserve) for row in result.known])
    required_capacities = required_capacities[np.isfinite(required_capacities)]
    with clean_style():
        figure = new_figure(4.6)
        axes = figure.add_axes((0.08, 0.27, 0.89, 0.62))
        axes.set_title(f"{result.base.name}: flights that keep {goal.reserve:.0%} of the battery, by its capacity")
        axes.set_xlabel("capacity (Wh)")
        axes.set_ylabel("share of the flights")
        axes.set_ylim(0.0, 1.05)
        axes.grid(color=theme.colour("grid"), linewidth=0.6)
        axes.set_axisbelow(True)
        for spine in ("top", "right"):
            axes.spines[spine].set_visible(False)
        if not required_capacities.size:
            axes.text(
                0.5,
                0.5,
                "no flight keeps the reserve" if result.known else "no flight completed with a known energy",
                ha="center",
                color=theme.colour("quiet"),
                fontsize=9,
            )
            return figure
        _draw_capacities(axes, result, required_capacities)
        figure.legend(loc="lower left", bbox_to_anchor=(0.07, 0.0), ncols=3, fontsize=9)
    return figure


def _draw_capacities(axes: Axes, result: BatteryResult, needed: Floats) -> None:
    """Draw the needed capacities as steps, and the required probability.

    The found capacity and the aircraft's capacity are marked.

    needed: finite capacities that the flights need, Wh, ascending, (n,).
    """
    goal = result.goal
    shares = np.arange(1, len(needed) + 1) / len(result.rows)
    ends = [
        float(needed[-1]),
        *(value for value in (result.capacity, result.interval.high) if math.isfinite(value)),
    ]
    right = max(ends)
    if not result.is_guessed and result.own_capacity <= _MAX_OWN_RATIO * right:
        right = max(right, result.own_capacity)
    left = min(float(needed[0]), result.own_capacity)
    margin = 0.05 * max(right - left, 1.0)
    edges = left - margin, right + margin
    axes.step(
        [edges[0], *needed, edges[1]],
        [0.0, *shares, shares[-1]],
        where="post",
        color=theme.colour("second"),
        linewidth=1.8,
        label="flights that keep the reserve",
    )
    axes.axhline(
        goal.probability,
        color=theme.colour("limit"),
        linewidth=1.2,
        linestyle="--",
        label=f"P = {goal.probability:g}",
    )
    if math.isfinite(result.capacity):
        low, high = result.interval
        high_end = high if math.isfinite(high) else edges[1]
        axes.axvspan(
            low,
            high_end,
            color=theme.colour("commanded"),
            alpha=0.3,
            linewidth=0.0,
            label=f"{goal.confidence:.0%} interval",
        )
        axes.axvline(
            result.capacity, color=theme.colour("ink"), linewidth=1.8, label=f"found: {result.capacity:.0f} Wh"
        )
    if not result.is_guessed:
        is_beyond = result.own_capacity > edges[1]
        axes.axvline(
            min(result.own_capacity, edges[1]),
            color=theme.colour("good" if result.is_enough else "fail"),
            linewidth=1.8,
            linestyle=":",
            label=f"the aircraft's: {result.own_capacity:.0f} Wh{' →' if is_beyond else ''}",
        )
    axes.set_xlim(*edges)
