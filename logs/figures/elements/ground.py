"""The ground under a map: shaded heights, contours and their colour bar."""

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from logs.figures.elements import style
from world.terrain import Terrain

Floats = NDArray[np.float64]


def draw_ground(figure: Figure, axes: Any, terrain: Terrain | None, column: float, top: float) -> list[Any]:
    """Shaded heights with labelled contours and a colour bar, or a note where there is no terrain.

    column: left edge (inches) of the column beside the map.  top: inches above it.  Returns what the legend shows.
    """
    note: dict[str, Any] = {"x": column / style.WIDTH, "y": 0.6, "color": style.QUIET}
    east_range, north_range = axes.get_xlim(), axes.get_ylim()
    if terrain is None:
        figure.text(s="no terrain\nwas given", **note)
        return []
    pitch = max(terrain.spacing * 0.5, np.ptp(east_range) / 900.0)
    east = np.linspace(east_range[0], east_range[1], 2 + int(np.ptp(east_range) / pitch))
    north = np.linspace(north_range[0], north_range[1], 2 + int(np.ptp(north_range) / pitch))
    heights = terrain.height(east[None, :], north[:, None])
    if not np.isfinite(heights).any():
        figure.text(s="no terrain\nhere", **note)
        return []
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    flat = high - low < 1.0
    colours = LinearSegmentedColormap.from_list("ground", style.GROUND)
    norm = Normalize(low - 0.5, high + 0.5) if flat else Normalize(low, high)
    picture = colours(norm(heights))
    picture[..., :3] *= 1.0 if flat else _shade(heights, float(north[1] - north[0]), high - low)[..., None]
    picture[np.isnan(heights)] = (0.93, 0.93, 0.93, 1.0)
    extent = (*east_range, *north_range)
    axes.imshow(picture, extent=extent, origin="lower", interpolation="bilinear", zorder=1, aspect="equal")
    if flat:
        figure.text(s=f"level ground,\n{low:.0f} m AMSL", **note)
        return []
    step = style.nice_step(high - low, 10)
    levels = np.arange(np.ceil(low / step) * step, high, step)
    lines = axes.contour(east, north, heights, levels=levels, colors="#6b5a3a", linewidths=0.45, alpha=0.75, zorder=2)
    axes.clabel(lines, levels[1::2], fmt="%.0f", fontsize=5.5, colors="#4d3f25", inline_spacing=1, zorder=2.1)
    _colour_bar(figure, colours, norm, levels, column, top)
    return [Line2D([], [], color="#6b5a3a", linewidth=0.8, label=f"contours every {step:g} m AMSL")]


def _shade(heights: Floats, pitch: float, span: float) -> Floats:
    """Brightness under light from the north-west, about 0.75 to 1.1 clipped at 1; level ground where unknown."""
    filled = np.where(np.isfinite(heights), heights, np.nanmean(heights))
    up_north, up_east = np.gradient(filled, pitch)
    # Gentle country is exaggerated, so that its ridges show.
    gain = float(np.clip(600.0 / span, 0.5, 4.0))
    slope_e, slope_n = gain * up_east, gain * up_north
    lit = (0.5 * slope_e - 0.5 * slope_n + 0.707) / np.sqrt(1.0 + slope_e**2 + slope_n**2)
    return np.asarray(np.clip(0.96 + 0.42 * (lit - 0.707), 0.55, 1.0))


def _colour_bar(figure: Figure, colours: Any, norm: Any, levels: Floats, column: float, top: float) -> None:
    total = float(figure.get_figheight())
    tall = min(2.6, total - 3.4)
    frame = (column / style.WIDTH, (total - top - tall - 0.25) / total, 0.16 / style.WIDTH, tall / total)
    bar = figure.colorbar(ScalarMappable(norm, colours), cax=figure.add_axes(frame))
    bar.set_ticks(levels[:: max(1, len(levels) // 8)].tolist())
    bar.set_label("ground height (m AMSL)", fontsize=8)
    bar.ax.tick_params(labelsize=7.5)
