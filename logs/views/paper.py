"""Draw figures of the paper's experiment: paths of searches, paths of encodings, convergence.

The paper is Yang, Tang and Lozano 2014.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from logs import theme
from logs.views.charts import Label, Layer, Panel, legend_entries
from logs.views.draw_map import draw_ground, make_map_axes
from logs.views.drawing import clean_style, draw_layers, draw_legend, make_legend_handle, new_figure, write_label
from logs.views.labels import LabelPlacer
from logs.views.threats_and_zones import threat_circles
from world.arrays import Floats
from world.scenario import Scenario
from world.wording import count_text

# Margin left of the map, inches.
_LEFT = 0.72
# Margin above the map, inches.
_TOP = 0.5
# Height of the legend, inches.
_LEGEND = 0.85
# Height of a legend with two lines for each encoding, inches.
_TALL_LEGEND = 1.2
# Left edge of the column right of the map, inches.
_COLUMN = 8.72
# One line style for each algorithm of a figure, distinct even without colour.
_DASHES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (1.2, 1.2)),
    (0, (4, 1.2, 1, 1.2)),
    (0, (7, 2)),
    (0, (2.5, 1.5)),
)
_STYLES: tuple[dict[str, Any], ...] = tuple(
    {"color": shade, "linestyle": dashes} for shade, dashes in zip(theme.SERIES, _DASHES, strict=True)
)
_MARKERS = ("o", "s", "^", "D", "v", "P")


@dataclass(frozen=True, slots=True)
class PaperPath:
    """One path of the experiment.

    waypoints: waypoints of the path, m, (w, 3).
    length_ratio: path length divided by the length of the straight line from start to destination.
    safe: True if the path is safe at the paper's sample points.
    """

    waypoints: Floats
    length_ratio: float
    safe: bool


def draw_paths(scenario: Scenario, algorithm: str, paths: Sequence[PaperPath]) -> Figure:
    """Draw the paths that an algorithm found over contours and threats, as in the paper's Figs. 5-8.

    The legend states the path length ratio (PLR): path length divided by the straight line from start to destination.

    paths: path of each search.

    >>> from logs.recording.example_log import example_log
    >>> setup = example_log().setup
    >>> figure = draw_paths(setup.scenario, "umda", [PaperPath(setup.route.positions, 1.01, safe=True)])
    >>> figure.axes[0].get_title(loc="left")
    'example: 1 run of umda, 1 safe'
    """
    safe_count = sum(path.safe for path in paths)
    title = f"{scenario.name}: {count_text(len(paths), 'run')} of {algorithm}, {safe_count} safe"
    with clean_style():
        figure, axes, ground_handles = _draw_ground_and_threats(scenario, title, _LEGEND)
        handles: list[Any] = []
        for is_safe, style, label in ((True, _STYLES[0], "safe"), (False, _STYLES[1], "not safe")):
            matching_paths = [path for path in paths if path.safe == is_safe]
            for path in matching_paths:
                axes.plot(*path.waypoints[:, :2].T, linewidth=1.3, alpha=0.85, zorder=5, **style)
                axes.plot(*path.waypoints[1:-1, :2].T, ".", color=style["color"], markersize=3.0, zorder=5.1)
            if matching_paths:
                ratios = [path.length_ratio for path in matching_paths]
                ratio_text = f"{min(ratios):.3f}" + (f" to {max(ratios):.3f}" if len(ratios) > 1 else "")
                text = f"{len(matching_paths)} path{'s' if len(matching_paths) > 1 else ''} {label}\nPLR {ratio_text}"
                handles.append(Line2D([], [], linewidth=1.6, label=text, **style))
        handles += _draw_ends(axes, scenario, [path.waypoints for path in paths])
        draw_legend(figure, handles + ground_handles, _LEFT, (_LEGEND - 0.02) / figure.get_figheight())
    return figure


def draw_encodings(scenario: Scenario, path_by_encoding: Mapping[str, PaperPath], seed: int) -> Figure:
    """Draw one path for each encoding on the same map, as in the paper's Figs. 9-12.

    path_by_encoding: path to draw, keyed by the name of the encoding.
    seed: seed of the searches, for the title.

    >>> from logs.recording.example_log import example_log
    >>> setup = example_log().setup
    >>> path = PaperPath(setup.route.positions, 1.01, safe=True)
    >>> figure = draw_encodings(setup.scenario, {"rotated": path, "cartesian": path}, seed=1)
    >>> figure.axes[0].get_title(loc="left")
    'example: one path of each encoding, seed 1'
    """
    with clean_style():
        title = f"{scenario.name}: one path of each encoding, seed {seed}"
        figure, axes, ground_handles = _draw_ground_and_threats(scenario, title, _TALL_LEGEND)
        handles = []
        for (name, path), style, marker in zip(path_by_encoding.items(), _STYLES, _MARKERS, strict=False):
            axes.plot(
                *path.waypoints[:, :2].T, linewidth=1.8, marker=marker, markersize=3.5, zorder=5, clip_on=True, **style
            )
            text = f"{name}\n{'safe' if path.safe else 'not safe'}, PLR {path.length_ratio:.3f}"
            handles.append(Line2D([], [], linewidth=1.8, marker=marker, markersize=3.5, label=text, **style))
        handles += _draw_ends(axes, scenario, [path.waypoints for path in path_by_encoding.values()])
        draw_legend(figure, handles + ground_handles, _LEFT, (_TALL_LEGEND - 0.02) / figure.get_figheight())
    return figure


def _draw_ground_and_threats(scenario: Scenario, title: str, legend_height: float) -> tuple[Figure, Any, list[Any]]:
    """Make a map with ground and threats.

    Return the figure, its axes, and the legend handles of ground and threats.

    legend_height: height left free below the map for the legend, inches.
    """
    min_corner, max_corner = scenario.bounds[:, 0], scenario.bounds[:, 1]
    padding = 0.02 * float((max_corner - min_corner).max())
    (west, south), (east, north) = (min_corner - padding).tolist(), (max_corner + padding).tolist()
    figure, axes = make_map_axes((west, east), (south, north), legend_height)
    axes.set(xlabel="east (km)", ylabel="north (km)")
    axes.set_title(title, fontweight="bold")
    ground_handles = draw_ground(figure, axes, scenario.terrain, _COLUMN, _TOP)
    # The circles do not depend on altitude: a path inside a circle may pass over the sphere.
    threat_panel = Panel("north", "m", threat_circles(scenario.threats, route=None, failing_threats=frozenset()))
    draw_layers(axes, threat_panel)
    return figure, axes, ground_handles + [make_legend_handle(entry) for entry in legend_entries([threat_panel])]


def _draw_ends(axes: Any, scenario: Scenario, paths: Sequence[Floats]) -> list[Any]:
    """Draw start and destination with labels that avoid the paths; return their legend handles.

    paths: waypoints of each path, m, (w, 3).
    """
    placer = LabelPlacer(axes)
    for path in paths:
        placer.avoid(path[:, 0], path[:, 1])
    endpoints = (("start", scenario.start), ("destination", scenario.destination))
    panel = Panel(
        "north", "m", tuple(Layer("dots", name, name, position[:1], position[1:2]) for name, position in endpoints)
    )
    draw_layers(axes, panel, min_zorder=6.0)
    for name, position in endpoints:
        write_label(placer, Label(name, float(position[0]), float(position[1]), "end"))
    return [make_legend_handle(entry) for entry in legend_entries([panel])]


def draw_convergence(histories: Mapping[int, Mapping[str, Sequence[Floats]]]) -> Figure:
    """Draw the number of searches with a safe path, and the length ratios of these paths.

    Both are drawn over the generations.  There is a column of panels for each number of threats, and a line for each
    algorithm.

    histories: histories of searches, keyed by number of threats and by algorithm: ``histories[30]["umda"]`` has one
        array (g, 3) for each search.  Its rows are generations; its columns are length ratio, kill exposure and
        violations of the best path so far.

    >>> history = np.array([[1.4, 0.2, 1.0], [1.2, 0.0, 0.0], [1.1, 0.0, 0.0]])
    >>> figure = draw_convergence({30: {"umda": [history]}})
    >>> figure.axes[0].get_title(loc="left"), figure.axes[1].get_ylabel()
    ('30 threats', 'length ratio of safe paths')
    """
    count = len(histories)
    with clean_style():
        figure = new_figure(6.0)
        grid = figure.add_gridspec(
            2, count, left=0.075, right=0.985, top=0.9, bottom=0.15, wspace=0.28 if count > 1 else 0.2, hspace=0.16
        )
        names: list[str] = []
        for column, (threats, searches_by_algorithm) in enumerate(histories.items()):
            upper = figure.add_subplot(grid[0, column])
            lower = figure.add_subplot(grid[1, column], sharex=upper)
            for (name, searches), style in zip(searches_by_algorithm.items(), _STYLES, strict=False):
                _draw_progress(upper, lower, searches, style)
                names = names if name in names else [*names, name]
            max_count = max(len(searches) for searches in searches_by_algorithm.values())
            upper.set(ylim=(-0.04 * max_count, 1.06 * max_count), title=f"{threats} threats")
            upper.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=6))
            upper.tick_params(labelbottom=False)
            lower.set(xlabel="generation")
            for axes in (upper, lower):
                axes.grid(linewidth=0.4, color=theme.colour("grid"))
                axes.set_axisbelow(True)
            if not lower.lines:
                lower.set_yticks([])
                lower.text(
                    0.5,
                    0.5,
                    "no run has\na safe path",
                    transform=lower.transAxes,
                    ha="center",
                    color=theme.colour("quiet"),
                )
            if column == 0:
                upper.set_ylabel("runs with a safe path")
                lower.set_ylabel("length ratio of safe paths")
        figure.text(0.012, 0.965, "Convergence over generations", fontsize=11, fontweight="bold")
        handles: list[Any] = [
            Line2D([], [], linewidth=1.8, label=name, **style) for name, style in zip(names, _STYLES, strict=False)
        ]
        handles.append(Patch(facecolor=theme.colour("rule"), label="below: line = median, band = shortest to longest"))
        figure.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.065, 0.005), ncols=4)
    return figure


def _draw_progress(upper: Any, lower: Any, histories: Sequence[Floats], style: Mapping[str, Any]) -> None:
    """Draw how many searches of one algorithm have a safe path, and the length ratios of these paths.

    A search that ended early keeps its last values.  The length ratios are drawn as their median, and as a band from
    the smallest to the largest.

    upper, lower: axes for the number of searches and for the length ratios.
    histories: histories as in `draw_convergence`.
    style: matplotlib's line style of the algorithm.
    """
    length = max(len(history) for history in histories)
    padded_histories = np.stack(
        [np.vstack([history, np.repeat(history[-1:], length - len(history), axis=0)]) for history in histories]
    )
    length_ratio, kill, violations = np.moveaxis(padded_histories, -1, 0)
    is_safe = (violations == 0.0) & (kill == 0.0)
    generation = np.arange(length)
    upper.plot(generation, is_safe.sum(axis=0), linewidth=1.6, **style)
    ratios = np.where(is_safe, length_ratio, np.nan)
    is_known = is_safe.any(axis=0)
    if not is_known.any():
        return
    known_ratios = ratios[:, is_known]
    lower.fill_between(
        generation[is_known],
        np.nanmin(known_ratios, axis=0),
        np.nanmax(known_ratios, axis=0),
        color=style["color"],
        alpha=0.13,
        linewidth=0,
    )
    lower.plot(generation[is_known], np.nanmedian(known_ratios, axis=0), linewidth=1.6, **style)
