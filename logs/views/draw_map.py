"""Draw the map: relief with contours, layers of the chart, compass, colour bar and legend."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.ticker import FuncFormatter, MultipleLocator

from logs import theme
from logs.views.charts import legend_entries, nice_step, shorten
from logs.views.drawing import (
    WIDTH,
    clean_style,
    draw_layers,
    draw_legend,
    make_legend_handle,
    new_figure,
    write_labels,
)
from logs.views.map import MapChart, NamedWind
from logs.views.relief import relief
from world.terrain import Terrain

# Margin left of the map, inches.
_LEFT = 0.72
# Width of the map, inches.
_MAP_WIDTH = 7.72
# Margin above the map, inches.
_TOP = 0.5
# Margin below the map, inches.
_BOTTOM = 0.55
# Smallest height of the legend, inches.
_LEGEND = 1.0
# Left edge of the column right of the map, inches.
_COLUMN = 8.72
# Height of a line of the legend, inches.
_LEGEND_LINE = 0.165
# Smallest height of the map, inches.
_MIN_HEIGHT = 3.6
# Line spacing of the notes on winds, inches.
_LINE = 0.145


def draw_map(chart: MapChart) -> Figure:
    """Draw the map of a flight from above: north up, equal scales, axes in km from the scenario's origin."""
    with clean_style():
        handles = [make_legend_handle(entry) for entry in legend_entries([chart.panel])]
        # A legend of four columns.
        line_counts = [1 + str(handle.get_label()).count("\n") for handle in handles] + [1]
        legend_height = max(
            _LEGEND, 0.08 + _LEGEND_LINE * max(int(column.sum()) for column in np.array_split(line_counts, 4))
        )
        figure, axes = make_map_axes(chart.east, chart.north, legend_height)
        axes.set_xlabel(f"east of {chart.origin} (km)")
        axes.set_ylabel("north (km)")
        axes.set_title(chart.title, fontweight="bold")
        ground_handles = draw_ground(figure, axes, chart.terrain, _COLUMN, _TOP)
        draw_layers(axes, chart.panel)
        write_labels(axes, chart.panel)
        draw_compass(figure, chart.winds, _COLUMN, legend_height)
        draw_legend(figure, handles + ground_handles, _LEFT, (legend_height - 0.02) / figure.get_figheight())
    return figure


def make_map_axes(east: tuple[float, float], north: tuple[float, float], legend_height: float) -> tuple[Figure, Any]:
    """Make a figure with the axes of a map, which show km.

    east, north: range of the map, (min, max) m.
    legend_height: height left free below the map for the legend, inches.
    """
    height = _MAP_WIDTH * (north[1] - north[0]) / (east[1] - east[0])
    frame_height = max(height, _MIN_HEIGHT)
    figure_height = _TOP + frame_height + _BOTTOM + legend_height
    figure = new_figure(figure_height)
    axes_bottom = legend_height + _BOTTOM + 0.5 * (frame_height - height)
    axes = figure.add_axes((_LEFT / WIDTH, axes_bottom / figure_height, _MAP_WIDTH / WIDTH, height / figure_height))
    axes.set(xlim=east, ylim=north, aspect="equal", facecolor=theme.colour("unknown"))
    step = nice_step(max(east[1] - east[0], north[1] - north[0]), 14)
    kilometres = FuncFormatter(lambda value, _: f"{value / 1000.0:g}".replace("-", "\N{MINUS SIGN}"))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(step))
        axis.set_major_formatter(kilometres)
    return figure, axes


def draw_ground(figure: Figure, axes: Any, terrain: Terrain | None, column: float, top: float) -> list[Any]:
    """Draw shaded relief with labelled contours and a colour bar within the limits of the axes.

    Without known terrain, write a note instead.  Level ground gets one colour and a note.  Return the legend handle of
    the contours, [] without contours.

    column: left edge of the column right of the map, for the colour bar and the notes, inches.
    top: margin above the map, inches.
    """
    note: dict[str, Any] = {"x": column / WIDTH, "y": 0.6, "color": theme.colour("quiet")}
    east_range, north_range = axes.get_xlim(), axes.get_ylim()
    if terrain is None:
        figure.text(s="no terrain\nwas given", **note)
        return []
    sample_spacing = max(terrain.spacing * 0.5, np.ptp(east_range) / 900.0)
    east = np.linspace(east_range[0], east_range[1], 2 + int(np.ptp(east_range) / sample_spacing))
    north = np.linspace(north_range[0], north_range[1], 2 + int(np.ptp(north_range) / sample_spacing))
    heights = terrain.height(east[None, :], north[:, None])
    if not np.isfinite(heights).any():
        figure.text(s="no terrain\nhere", **note)
        return []
    min_height, max_height = float(np.nanmin(heights)), float(np.nanmax(heights))
    is_level = max_height - min_height < 1.0
    colours = LinearSegmentedColormap.from_list("ground", theme.GROUND)
    norm = Normalize(min_height - 0.5, max_height + 0.5) if is_level else Normalize(min_height, max_height)
    picture = colours(norm(heights))
    picture[..., :3] *= (
        1.0 if is_level else relief(heights, float(north[1] - north[0]), max_height - min_height)[..., None]
    )
    picture[np.isnan(heights)] = theme.rgba("unknown")
    extent = (*east_range, *north_range)
    axes.imshow(picture, extent=extent, origin="lower", interpolation="bilinear", zorder=1, aspect="equal")
    if is_level:
        figure.text(s=f"level ground,\n{min_height:.0f} m AMSL", **note)
        return []
    step = nice_step(max_height - min_height, 10)
    levels = np.arange(np.ceil(min_height / step) * step, max_height, step)
    lines = axes.contour(
        east, north, heights, levels=levels, colors=theme.colour("contour"), linewidths=0.45, alpha=0.75, zorder=2
    )
    axes.clabel(
        lines, levels[1::2], fmt="%.0f", fontsize=5.5, colors=theme.colour("contour"), inline_spacing=1, zorder=2.1
    )
    # The colour bar stands in the column right of the map; some of the contours label it.
    figure_height = float(figure.get_figheight())
    bar_height = min(2.6, figure_height - 3.4)
    bar_bottom = (figure_height - top - bar_height - 0.25) / figure_height
    frame = (column / WIDTH, bar_bottom, 0.16 / WIDTH, bar_height / figure_height)
    bar = figure.colorbar(ScalarMappable(norm, colours), cax=figure.add_axes(frame))
    bar.set_ticks(levels[:: max(1, len(levels) // 8)].tolist())
    bar.set_label("ground elevation (m AMSL)", fontsize=8)
    bar.ax.tick_params(labelsize=7.5)
    return [Line2D([], [], color=theme.colour("contour"), linewidth=0.8, label=f"contours every {step:g} m AMSL")]


def draw_compass(figure: Figure, winds: Sequence[NamedWind], column: float, legend_height: float = 0.0) -> None:
    """Draw a compass with an arrow for each wind, and notes on the winds below it.

    They are in the column right of the map.

    column: left edge of the column, inches.
    legend_height: height of the legend below the map, inches; the notes stay above its upper edge.
    """
    figure_height = float(figure.get_figheight())
    dial_size = 1.0
    # Note on each wind, and its colour: flight, speed, direction and turbulence.
    notes = []
    for named_wind in winds:
        wind = named_wind.wind
        note = f"{shorten(named_wind.name, 22)}:\n" if named_wind.name else ""
        direction_text = f"from {round(np.degrees(wind.from_course)) % 360:03d}°"
        note += f"wind {wind.speed:.1f} m/s\n{direction_text}" if wind.speed > 0.0 else "no mean wind"
        note += "\n(mean of the forecast)" if wind.forecast is not None else ""
        note += f"\n{wind.turbulence} turbulence" if wind.turbulence != "none" else ""
        notes.append((note, theme.colour(named_wind.role if len(winds) > 1 else "ink")))
    lines = sum(text.count("\n") + 1 for text, _ in notes)
    dial_bottom = max(1.35, max(0.2, legend_height + 0.04) + _LINE * (lines + len(notes) - 1))
    dial = figure.add_axes(
        (column / WIDTH - 0.01, dial_bottom / figure_height, dial_size / WIDTH, dial_size / figure_height)
    )
    dial.set(xlim=(-1.25, 1.25), ylim=(-1.25, 1.25), aspect="equal")
    dial.axis("off")
    dial.add_patch(Circle((0, 0), 1.0, fill=False, edgecolor=theme.colour("rim"), linewidth=0.8))
    dial.text(0, 1.05, "N", ha="center", va="bottom", fontsize=8.5, fontweight="bold")
    dial.plot([0, 0], [0.82, 1.0], color=theme.colour("ink"), linewidth=1.2)
    winds_with_arrows = [named_wind for named_wind in winds if named_wind.wind.speed > 0.0]
    for k, named_wind in enumerate(winds_with_arrows):
        east = np.sin(named_wind.wind.from_course)
        north = np.cos(named_wind.wind.from_course)
        # The second arrow is dashed and shorter, so that both show if they overlap.
        arrow: dict[str, Any] = {"arrowstyle": "-|>", "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0}
        arrow |= {"color": theme.colour(named_wind.role), "linestyle": (0, (3, 1.5)) if k else "-"}
        length = 0.8 - 0.25 * k
        dial.annotate("", (-length * east, -length * north), (length * east, length * north), arrowprops=arrow)
    if not winds_with_arrows:
        dial.text(0, 0, "calm", ha="center", va="center", fontsize=7.5, color=theme.colour("quiet"))
    note_top = dial_bottom - 0.02
    for text, colour in notes:
        style: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": 7.5, "color": colour}
        figure.text((column + 0.4) / WIDTH, note_top / figure_height, text, **style)
        note_top -= _LINE * (text.count("\n") + 2)
