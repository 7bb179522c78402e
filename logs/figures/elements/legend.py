"""What stands around a map or a profile: the legend below, and the compass with the wind."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch

from logs.figures.elements import style
from logs.figures.elements.failures import Failures
from world.wind import Wind

# Inches from a line of the wind's note to the next.
_LINE = 0.145


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


@dataclass(frozen=True, slots=True)
class NamedWind:
    """A wind of the compass; name: of the flight that it belongs to, "" where there is one wind alone."""

    wind: Wind
    name: str = ""
    colour: str = style.BLUE


def draw_compass(figure: Figure, winds: Sequence[NamedWind], column: float) -> None:
    """Show north, and where each wind blows to, in the column (its left edge in inches) beside the map."""
    total = float(figure.get_figheight())
    side = 1.0
    notes = [(_wind_text(named), named.colour if len(winds) > 1 else style.INK) for named in winds]
    lines = sum(text.count("\n") + 1 for text, _ in notes)
    base = max(1.35, 0.2 + _LINE * (lines + len(notes) - 1))
    dial = figure.add_axes((column / style.WIDTH - 0.01, base / total, side / style.WIDTH, side / total))
    dial.set(xlim=(-1.25, 1.25), ylim=(-1.25, 1.25), aspect="equal")
    dial.axis("off")
    dial.add_patch(Circle((0, 0), 1.0, fill=False, edgecolor="#999999", linewidth=0.8))
    dial.text(0, 1.05, "N", ha="center", va="bottom", fontsize=8.5, fontweight="bold")
    dial.plot([0, 0], [0.82, 1.0], color=style.INK, linewidth=1.2)
    blowing = [named for named in winds if named.wind.speed > 0.0]
    for k, named in enumerate(blowing):
        east, north = np.sin(named.wind.from_course), np.cos(named.wind.from_course)
        # A second arrow is dashed and shorter, so that both show where they lie on each other.
        arrow: dict[str, Any] = {"arrowstyle": "-|>", "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0}
        arrow |= {"color": named.colour, "linestyle": (0, (3, 1.5)) if k else "-"}
        length = 0.8 - 0.25 * k
        dial.annotate("", (-length * east, -length * north), (length * east, length * north), arrowprops=arrow)
    if not blowing:
        dial.text(0, 0, "calm", ha="center", va="center", fontsize=7.5, color=style.QUIET)
    top = base - 0.02
    for text, colour in notes:
        look: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": 7.5, "color": colour}
        figure.text((column + 0.4) / style.WIDTH, top / total, text, **look)
        top -= _LINE * (text.count("\n") + 2)


def _wind_text(named: NamedWind) -> str:
    wind = named.wind
    note = f"{style.shorten(named.name, 22)}:\n" if named.name else ""
    if wind.speed > 0.0:
        note += f"wind {wind.speed:.1f} m/s\nfrom {round(np.degrees(wind.from_course)) % 360:03d}°"
    else:
        note += "no mean wind"
    return note + (f"\n{wind.turbulence} turbulence" if wind.turbulence != "none" else "")
