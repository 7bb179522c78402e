"""Where the flights went: how high above ground along the way, and where they crossed each waypoint."""

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from numpy.typing import NDArray

from logs.figures.elements.style import BLUE, FAIL, INK, LIMIT, PLANNED, QUIET, clean_style, new_figure

Floats = NDArray[np.float64]
# Of the flights, the shares between which a band is drawn, the widest first.
_BANDS = ((0.0, 1.0, 0.18), (0.05, 0.95, 0.30), (0.25, 0.75, 0.45))
# Chi-square of two degrees of freedom at 95 %: half axes of the ellipse, in standard deviations, squared.
_CHI2 = -2.0 * math.log(0.05)
_COLUMNS = 5


def draw_clearance_fan(
    clearance: Floats, failed: NDArray[np.bool_], ground: Floats, length: float, least: float
) -> Figure:
    """Height above ground along the way over all flights, over the ground's own profile.

    clearance: (n, s) least of each flight on each of s equal pieces of the way, m, NaN where it did not get.
    failed: (n,) flights that are not flyable: at most 30 are drawn.  ground: (s,) m AMSL on the way.  length: m.
    least: clearance required, m.
    """
    with clean_style():
        figure = new_figure(5.4)
        top = figure.add_axes((0.08, 0.36, 0.89, 0.56))
        low = figure.add_axes((0.08, 0.10, 0.89, 0.20), sharex=top)
        stations = clearance.shape[1]
        along = (np.arange(stations) + 0.5) / stations * length / 1000.0
        some = np.isfinite(clearance).any(axis=0)
        for below, above, alpha in _BANDS:
            ends = np.full((2, stations), np.nan)
            ends[:, some] = np.nanquantile(clearance[:, some], (below, above), axis=0)
            label = "all flights" if below == 0.0 else f"{100 * (above - below):.0f} % of them"
            top.fill_between(along, ends[0], ends[1], color=PLANNED, alpha=alpha + 0.15, linewidth=0.0, label=label)
        middle = np.full(stations, np.nan)
        middle[some] = np.nanmedian(clearance[:, some], axis=0)
        top.plot(along, middle, color=BLUE, linewidth=1.4, label="median")
        for k, row in enumerate(clearance[failed][:30]):
            top.plot(along, row, color=FAIL, linewidth=0.7, alpha=0.8, label="not flyable" if k == 0 else None)
        top.axhline(least, color=LIMIT, linewidth=1.4, linestyle="--", label=f"required, {least:g} m")
        top.set_ylim(bottom=0.0)
        top.set_ylabel("above ground (m)")
        top.set_title("Clearance along the way, over all flights")
        # Over the panel, where it covers no band.
        top.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=6, columnspacing=1.0, borderaxespad=0.2)
        top.tick_params(labelbottom=False)
        low.fill_between(along, ground, np.nanmin(ground) - 10.0, color="#cfd8b0", linewidth=0.0)
        low.plot(along, ground, color=QUIET, linewidth=0.8)
        low.set_xlim(0.0, length / 1000.0)
        low.set_ylabel("ground (m AMSL)")
        low.set_xlabel("along the way (km)")
        for axes in (top, low):
            axes.grid(visible=True, color="#e2e2e2", linewidth=0.5)
            axes.set_axisbelow(True)
            for side in ("top", "right"):
                axes.spines[side].set_visible(False)
    return figure


def draw_crossings(crossings: Floats, failed: NDArray[np.bool_]) -> Figure:
    """Where flights crossed the waypoints, seen along the way: a panel each, with the ellipse of 95 %.

    crossings: (n, w, 2) right of and above each waypoint, m, NaN where a flight did not get.  failed: (n,).
    """
    count = crossings.shape[1]
    columns = min(_COLUMNS, count)
    lines = -(-count // columns)
    with clean_style():
        figure = new_figure(0.7 + 2.0 * lines)
        panels = figure.subplots(lines, columns, squeeze=False)
        tall = 0.7 + 2.0 * lines
        figure.subplots_adjust(
            left=0.07, right=0.98, bottom=0.4 / tall, top=1.0 - 0.65 / tall, wspace=0.22, hspace=0.35
        )
        for k, axes in enumerate(panels.ravel()):
            if k >= count:
                axes.set_axis_off()
                continue
            here = crossings[:, k]
            good = np.isfinite(here).all(axis=1)
            axes.axhline(0.0, color="#cccccc", linewidth=0.6)
            axes.axvline(0.0, color="#cccccc", linewidth=0.6)
            axes.plot(*here[good & ~failed].T, ".", color=BLUE, markersize=2.2, alpha=0.5)
            axes.plot(*here[good & failed].T, "x", color=FAIL, markersize=3.5)
            reach = _reach(here)
            if good.sum() > 2:
                ellipse = covariance_ellipse(here[good])
                # Its extents are in metres as long as it stands on no axes.
                reach = max(reach, 1.05 * float(np.abs(ellipse.get_extents().get_points()).max()))
                axes.add_patch(ellipse)
            axes.set_title(f"waypoint {k}", fontsize=8.5, pad=3.0)
            axes.set_xlim(-reach, reach)
            axes.set_ylim(-reach, reach)
            axes.tick_params(labelsize=7)
        title = "Crossings of the waypoints, m right of and above each, with the ellipse of 95 %"
        figure.text(0.07, 1.0 - 0.3 / tall, title, fontsize=11, color=INK)
        figure.text(0.98, 1.0 - 0.3 / tall, "dots flyable, crosses not", fontsize=8, color=QUIET, ha="right")
    return figure


def covariance_ellipse(points: Floats) -> Ellipse:
    """The ellipse that holds 95 % of a normal distribution with these points' (n, 2) mean and covariance.

    >>> points = np.array([[3.0, 0.0], [-3.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    >>> ellipse = covariance_ellipse(points)
    >>> round(ellipse.width, 2), round(ellipse.height, 2)
    (11.99, 4.0)
    """
    spread = np.cov(points.T)
    values, vectors = np.linalg.eigh(spread)
    wide, narrow = (2.0 * math.sqrt(_CHI2 * max(0.0, float(value))) for value in values[::-1])
    angle = math.degrees(math.atan2(vectors[1, 1], vectors[0, 1]))
    east, up = (float(value) for value in points.mean(axis=0))
    return Ellipse((east, up), wide, narrow, angle=angle, fill=False, edgecolor=INK, linewidth=0.9)


def _reach(crossings: Floats) -> float:
    known = np.abs(crossings[np.isfinite(crossings)])
    return max(5.0, 1.1 * float(np.quantile(known, 0.995))) if known.size else 10.0
