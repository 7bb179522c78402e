"""What stands around a map or a profile: the legend below, and the compass with the wind."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch

from logs.figures.elements import style
from logs.figures.elements.failures import Failures
from world.scenario import Scenario


def draw_legend(figure: Figure, handles: list[Any], left: float, top: float) -> None:
    """Write the legend below the picture, where it hides nothing.

    left: inches from the figure's edge.  top: its upper edge as a share of the figure's height.
    """
    figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(left / style.WIDTH - 0.01, top),
        ncols=4,
        columnspacing=1.4,
        handlelength=2.0,
        borderaxespad=0.0,
        borderpad=0.2,
        labelspacing=0.45,
    )


def failing_handles(failed: Failures) -> list[Any]:
    """List the legend's entries for the marks of failing legs and waypoints, as far as there are any."""
    handles: list[Any] = []
    if failed.legs:
        handles.append(Line2D([], [], color=style.FAIL, linewidth=6, alpha=0.9, label="leg that fails a rule"))
    if failed.waypoints:
        ring: dict[str, Any] = {"marker": "o", "linestyle": "", "markersize": 9, "mfc": "none", "markeredgewidth": 2.0}
        handles.append(Line2D([], [], color=style.FAIL, label="waypoint that fails a rule", **ring))
    if failed.threats:
        handles.append(Patch(facecolor="none", edgecolor=style.FAIL, linewidth=2.2, label="threat that is entered"))
    return handles


def draw_compass(figure: Figure, scenario: Scenario, column: float) -> None:
    """Show north, and where the wind blows to, in the column (its left edge in inches) beside the map."""
    total = float(figure.get_figheight())
    side = 1.0
    base = 1.35
    dial = figure.add_axes((column / style.WIDTH - 0.01, base / total, side / style.WIDTH, side / total))
    dial.set(xlim=(-1.25, 1.25), ylim=(-1.25, 1.25), aspect="equal")
    dial.axis("off")
    dial.add_patch(Circle((0, 0), 1.0, fill=False, edgecolor="#999999", linewidth=0.8))
    dial.text(0, 1.05, "N", ha="center", va="bottom", fontsize=8.5, fontweight="bold")
    dial.plot([0, 0], [0.82, 1.0], color=style.INK, linewidth=1.2)
    wind = scenario.wind
    if wind.speed > 0.0:
        east, north = np.sin(wind.from_course), np.cos(wind.from_course)
        arrow: dict[str, Any] = {"arrowstyle": "-|>", "color": style.BLUE, "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0}
        dial.annotate("", (-0.8 * east, -0.8 * north), (0.8 * east, 0.8 * north), arrowprops=arrow)
        note = f"wind {wind.speed:.1f} m/s\nfrom {np.degrees(wind.from_course) % 360:03.0f}°"
    else:
        dial.text(0, 0, "calm", ha="center", va="center", fontsize=7.5, color=style.QUIET)
        note = "no mean wind"
    if wind.turbulence != "none":
        note += f"\n{wind.turbulence} turbulence"
    figure.text(
        (column + 0.4) / style.WIDTH,
        (base - 0.02) / total,
        note,
        ha="center",
        va="top",
        fontsize=7.5,
        color=style.INK,
    )
