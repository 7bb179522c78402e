"""Draw charts as PNG and SVG with matplotlib, with settings that all pictures share."""

import io
import math
import re
import textwrap
import warnings
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html import escape
from pathlib import Path as FilePath
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib import patheffects
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MultipleLocator
from PIL import Image

from logs import theme
from logs.views.charts import Chart, Label, LegendEntry, Panel, legend_entries, nice_step
from logs.views.labels import DPI, LabelPlacer
from world.files import write_atomically

# Width of every picture, inches; 1500 pixels.
WIDTH = 10.0
_SETTINGS: Any = {
    "font.family": ["DejaVu Sans"],
    "font.size": 8.5,
    "axes.edgecolor": theme.colour("area"),
    "axes.labelcolor": theme.colour("ink"),
    "axes.linewidth": 0.7,
    "axes.titlesize": 11.0,
    "axes.titlelocation": "left",
    "axes.titlepad": 8.0,
    "grid.color": theme.colour("grid"),
    "grid.linewidth": 0.5,
    "text.color": theme.colour("ink"),
    # The name of a scenario or threat may contain a dollar sign; it is never a formula.
    "text.parse_math": False,
    "xtick.color": theme.colour("ink"),
    "ytick.color": theme.colour("ink"),
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "path.simplify": True,
    # Without a salt the names inside an SVG are random.
    "svg.hashsalt": "planfly",
}
# Margin left of the panels, inches.
_LEFT = 0.85
# Margin right of panels without legends there, inches.
_RIGHT = 0.25
# Margin above panels whose legends are at their right or above them, inches.
_TOP = 0.72
# Margin above panels with the legend below, inches.
_PLAIN_TOP = 0.58
# Margin below the panels, inches.
_BOTTOM = 0.6
# Gap between panels with a common axis, inches.
_GAP = 0.2
# Gap between panels with axes of their own, inches.
_OWN_AXIS_GAP = 0.62
# Margin right of panels with legends there, inches.
_LEGENDS = 2.15
# Height of the common legend above the panels, inches.
_SHARED_LEGEND = 0.28
# Height of a line of a legend below the panels, inches.
_LEGEND_LINE = 0.2
# Distance from a panel to the center of its label, inches.
_LABEL = 0.44
# Compression of PNG files, 0 to 9; 6 takes twice the time and saves a tenth of the size.
_PNG_COMPRESSION_LEVEL = 2
# Quality of a JPEG, of 100: letters on the map are free of visible blocks.
_JPEG_QUALITY = 80
# Marker of matplotlib by its name in the theme.
_MARKERS = {"circle": "o", "triangle": "^", "star": "*", "cross": "x"}
# Largest number of waypoints or legs that an axis numbers.
_MAX_TICKS = 45
# Width of a digit of a tick label, in bold, and the gap between two labels, inches.
_DIGIT_WIDTH_IN = 0.085
_LABEL_GAP_IN = 0.06
# Space on either side of the first and the last waypoint or leg, in legs.
_PLACE_MARGIN = 0.8
# Characters in a line of a panel's title left of its axis, if two such lines are enough.
_PANEL_TITLE_WIDTH = 16
# Lines of a panel's title that fit left of the tick labels.
_MAX_PANEL_TITLE_LINES = 2


@contextmanager
def clean_style() -> Iterator[None]:
    """Use planfly's picture settings instead of the user's matplotlibrc in a with block.

    Settings that planfly does not state are matplotlib's defaults.  The previous settings are restored at the end of
    the block.

    >>> with clean_style():
    ...     mpl.rcParams["font.size"]
    8.5
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_SETTINGS)
        yield


class NotebookFigure(Figure):
    """A figure that a notebook displays although pyplot does not manage it."""

    def _repr_png_(self) -> bytes:
        """Return the figure as the PNG that a notebook displays."""
        return png_bytes(self)


def new_figure(height: float) -> Figure:
    """Make an empty figure of the width `WIDTH`, with its own canvas and without pyplot's global state.

    height: height of the figure, inches.

    >>> new_figure(4.0).get_size_inches().tolist()
    [10.0, 4.0]
    """
    figure = NotebookFigure(figsize=(WIDTH, height), dpi=DPI, facecolor=theme.colour("paper"))
    FigureCanvasAgg(figure)
    return figure


def png_bytes(figure: Figure) -> bytes:
    """Render the figure as a PNG without date or version, so that the same figure gives the same bytes.

    >>> figure = new_figure(2.0)
    >>> data = png_bytes(figure)
    >>> int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    (1500, 300)
    """
    canvas: Any = FigureCanvasAgg(figure)
    with _use_picture_settings():
        canvas.draw()
    # Without transparency, at this compression, a map takes half of the time to write that matplotlib's PNG takes.
    picture = Image.frombuffer("RGBA", canvas.get_width_height(), canvas.buffer_rgba()).convert("RGB")
    buffer = io.BytesIO()
    picture.save(buffer, format="png", compress_level=_PNG_COMPRESSION_LEVEL)
    return buffer.getvalue()


def jpeg_bytes(png: bytes) -> bytes:
    """Convert the bytes of a PNG to the bytes of a JPEG.

    For shaded ground, a JPEG has a quarter of the size of the PNG and takes a tenth of the time to encode.

    >>> jpeg_bytes(png_bytes(new_figure(1.0)))[:3].hex()
    'ffd8ff'
    """
    buffer = io.BytesIO()
    with Image.open(io.BytesIO(png)) as picture:
        # Colours at half resolution across only: thin coloured lines stay sharp.
        picture.convert("RGB").save(buffer, format="jpeg", quality=_JPEG_QUALITY, subsampling=1)
    return buffer.getvalue()


def svg_bytes(figure: Figure) -> bytes:
    """Render the figure as an SVG without a date, with letters as outlines.

    The same figure gives the same bytes.
    """
    buffer = io.BytesIO()
    with _use_picture_settings():
        figure.savefig(buffer, format="svg", dpi=DPI, metadata={"Date": None, "Creator": None})
    return buffer.getvalue()


def page_svg(figure: Figure, description: str) -> str:
    """Return the figure as an `<svg>` element for an HTML page.

    Colours are replaced by the variables of `theme.css_variables`, so that they follow the page's light or dark mode.

    description: description for readers who cannot see the figure; it must differ between the figures of a page.

    >>> page_svg(new_figure(2.0), "nothing")[:62]
    '<svg role="img" aria-label="nothing" viewBox="0 0 720 144" xml'
    """
    text = svg_bytes(figure).decode("utf-8")
    text = text[text.index("<svg") :]
    opening, body = text.split(">", 1)
    view_box = re.search(r'viewBox="[^"]*"', opening)
    namespaces = re.findall(r'xmlns(?::\w+)?="[^"]*"', opening)
    # Remove the unused names of groups: they would be duplicates in a page of several pictures.
    content = re.sub(r'<g id="[^"]*"', "<g", re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL))
    # Make the used names unique to the picture.
    prefix = f"p{zlib.crc32(description.encode()):x}-"
    content = re.sub(r'( id="|href="#|url\(#)', rf"\g<1>{prefix}", content)
    head = " ".join(
        ['<svg role="img"', f'aria-label="{escape(description)}"', view_box[0] if view_box else "", *sorted(namespaces)]
    )
    return f"{head}>{theme.replace_colours_by_css_variables(content)}".rstrip()


@contextmanager
def _use_picture_settings() -> Iterator[None]:
    """Use planfly's picture settings in a with block, without warnings about letters that the font lacks."""
    with clean_style(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font", category=UserWarning)
        yield


def write_png(figure: Figure, path: FilePath) -> None:
    """Write the figure as a PNG file, completely or not at all.

    Raises OSError if the file cannot be written.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_png(new_figure(2.0), FilePath(folder) / "empty.png")
    ...     (FilePath(folder) / "empty.png").read_bytes()[1:4]
    b'PNG'
    """
    write_atomically(path, png_bytes(figure))


def draw_chart(chart: Chart) -> Figure:
    """Draw the panels of a chart that have values; the first panel if no panel has values.

    With the legend beside the panels, they get one common legend above them if `can_share_legend` allows it, otherwise
    each panel has its own.
    """
    panels = chart.shown_panels() if chart.panels else ()
    has_shared_legend = chart.legend == "beside" and can_share_legend(panels)
    entries = legend_entries(panels) if chart.legend == "below" else ()
    top_margin = (_TOP if chart.legend == "beside" else _PLAIN_TOP) + (_SHARED_LEGEND if has_shared_legend else 0.0)
    right_margin = _LEGENDS if chart.legend == "beside" and not has_shared_legend else _RIGHT
    columns = _choose_legend_columns(entries)
    legend_height = 0.0
    if entries:
        legend_rows = -(-len(entries) // columns)
        lines = sum(
            max(len(textwrap.wrap(entry.text, 36)) for entry in entries[row::legend_rows]) for row in range(legend_rows)
        )
        legend_height = 0.1 + _LEGEND_LINE * lines
    rows = 1 if chart.widths else len(panels)
    gap = _GAP if chart.shared else _OWN_AXIS_GAP
    total_height = top_margin + _BOTTOM + legend_height + max(1, rows) * chart.print_height + max(0, rows - 1) * gap
    with clean_style():
        figure = new_figure(total_height)
        for k, panel in enumerate(panels):
            row = 0 if chart.widths else k
            panel_bottom = _BOTTOM + legend_height + (rows - 1 - row) * (chart.print_height + gap)
            # Left edge and width of the panel, inches.
            left, width = _LEFT, WIDTH - _LEFT - right_margin
            if chart.widths:
                width -= 0.75 * (len(chart.widths) - 1)
                left += sum(chart.widths[:k]) * width + 0.75 * k
                width *= chart.widths[k]
            extent = (left / WIDTH, panel_bottom / total_height, width / WIDTH, chart.print_height / total_height)
            axes = figure.add_axes(extent)
            _draw_panel(axes, chart, panel, has_leg_numbers=k == 0)
            if chart.legend == "beside" and not has_shared_legend:
                handles, labels = axes.get_legend_handles_labels()
                options: dict[str, Any] = {"loc": "center left", "bbox_to_anchor": (1.01, 0.5), "handlelength": 1.6}
                axes.legend(handles, [textwrap.fill(str(label), 23) for label in labels], borderaxespad=0.2, **options)
            if chart.shared and row < rows - 1:
                axes.tick_params(labelbottom=False)
            else:
                label = f"{chart.along} ({chart.unit})" if chart.along else panel.along
                axis_label = label
                if chart.scaled:
                    frame = axes.get_window_extent()
                    metres_per_pixel = np.ptp(axes.get_xlim()) * 1000.0 / frame.width
                    height_scale = metres_per_pixel / (np.ptp(axes.get_ylim()) / frame.height)
                    axis_label = f"{label}; heights are drawn {height_scale:.2g} times larger than distances"
                axes.set_xlabel(axis_label)
        text_style: dict[str, Any] = {"fontsize": 11, "fontweight": "bold", "va": "center"}
        figure.text(_LEFT / WIDTH, 1 - 0.3 / total_height, chart.title, **text_style)
        if has_shared_legend:
            # One legend for all panels, in a row above them.
            all_handles = {
                str(label): handle
                for axes in figure.axes
                for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
                if label
            }
            figure.legend(
                all_handles.values(),
                all_handles.keys(),
                loc="upper left",
                bbox_to_anchor=(_LEFT / WIDTH - 0.01, 1 - 0.45 / total_height),
                ncols=len(all_handles),
                handlelength=2.2,
                borderaxespad=0.0,
                borderpad=0.2,
            )
        if entries:
            draw_legend(
                figure,
                [make_legend_handle(entry) for entry in entries],
                _LEFT,
                (legend_height - 0.02) / total_height,
                columns,
            )
    return figure


def can_share_legend(panels: Sequence[Panel]) -> bool:
    """Return True if one legend is enough for all panels.

    Each style must have one name and each name one style in all panels, and at least one name must occur twice.

    >>> from logs.views.charts import Layer
    >>> none = np.zeros(2)
    >>> flown, wanted = Layer("line", "flown", "flown", none, none), Layer("line", "command", "commanded", none, none)
    >>> can_share_legend([Panel("bank", "", (wanted, flown)), Panel("speed", "", (wanted, flown))])
    True
    >>> height = Layer("line", "height", "flown", none, none)
    >>> can_share_legend([Panel("bank", "", (flown,)), Panel("height", "", (height,))])
    False
    """
    entries: list[tuple[str, Any]] = [
        (layer.name, (layer.role, layer.dashed, layer.kind))
        for panel in panels
        for layer in panel.layers
        if layer.role != "held"
    ]
    entries += [(label, "limit") for panel in panels for label, _ in panel.limits if label]
    distinct_entries = set(entries)
    labels, looks = ({entry[column] for entry in distinct_entries} for column in (0, 1))
    return len(labels) == len(looks) == len(distinct_entries) < len(entries)


def _draw_panel(axes: Any, chart: Chart, panel: Panel, *, has_leg_numbers: bool) -> None:
    """Draw one panel of a chart: axes, leg marks, layers, labels and note.

    has_leg_numbers: True to write leg numbers above the panel; ignored unless the chart's legend is "beside".
    """
    min_x, max_x = chart.shown_axis_range()
    if chart.shared:
        axes.set_xlim(min_x, max(max_x, min_x + 1e-3))
        axes.xaxis.set_major_locator(MultipleLocator(nice_step(float(np.ptp(axes.get_xlim())), 14)))
        _draw_marks(axes, chart.marks, has_leg_numbers=has_leg_numbers and chart.legend == "beside")
    else:
        # The axis has waypoint or leg numbers; failing ones have the colour of failures.  A label that would touch
        # another label is left out; of two failing labels, the later one.
        positions = np.unique(np.concatenate([layer.x for layer in panel.layers]))
        failing = {float(x) for layer in panel.layers if layer.kind == "rings" for x in layer.x}
        digits = len(f"{positions[-1]:.0f}")
        label_width = (_DIGIT_WIDTH_IN * digits + _LABEL_GAP_IN) / (WIDTH * axes.get_position().width)
        min_distance = label_width * (float(np.ptp(positions)) + 2.0 * _PLACE_MARGIN)
        label_interval = max(-(-len(positions) // _MAX_TICKS), math.ceil(min_distance))
        ticks = list[float]()
        for position in (*sorted(failing), *positions[::label_interval].tolist(), *positions.tolist()):
            if all(abs(position - tick) >= min_distance for tick in ticks):
                ticks.append(position)
        ticks.sort()
        axes.set_xticks(ticks, [f"{tick:.0f}" for tick in ticks])
        for tick_label, tick in zip(axes.get_xticklabels(), ticks, strict=True):
            if tick in failing:
                tick_label.set(color=theme.colour("fail"), fontweight="bold")
        axes.set_xlim(positions[0] - _PLACE_MARGIN, positions[-1] + _PLACE_MARGIN)
    axes.set_ylim(*panel.shown_span())
    if chart.legend == "below" and axes.get_ylim()[0] < 0.0 < axes.get_ylim()[1]:
        axes.axhline(0.0, color=theme.colour("rim"), linewidth=0.7, zorder=1)
    draw_layers(axes, panel)
    write_labels(axes, panel)
    if panel.note:
        text_options: dict[str, Any] = {
            "xycoords": "axes fraction",
            "textcoords": "offset points",
            "ha": "right",
            "fontsize": 7,
        }
        axes.annotate(panel.note, (1.0, 1.0), (0, 3), color=theme.colour("limit"), **text_options)
    axis_label = panel.label
    if chart.print_height <= 2.0:
        # A third line would be cut off at the left edge of the picture.
        title = panel.title.replace(" +", "\N{NO-BREAK SPACE}+")
        text = f"{title} ({panel.unit})" if panel.unit else title
        wrappings = (textwrap.wrap(text, width) for width in range(_PANEL_TITLE_WIDTH, len(text) + _PANEL_TITLE_WIDTH))
        lines = next(lines for lines in wrappings if len(lines) <= _MAX_PANEL_TITLE_LINES)
        axis_label = "\n".join(lines).replace("\N{NO-BREAK SPACE}", " ")
    axes.set_ylabel(axis_label)
    axes.yaxis.set_label_coords(-_LABEL / (WIDTH * axes.get_position().width), 0.5)
    axes.grid(visible=True, axis="both" if chart.shared else "y")
    axes.set_axisbelow(True)


def _draw_marks(axes: Any, marks: Sequence[tuple[float, str]], *, has_leg_numbers: bool) -> None:
    """Separate the legs by thin vertical lines, and write their numbers above the panel.

    marks: start of each leg on the horizontal axis, and its text, such as "leg 3".
    has_leg_numbers: if False, only the lines are drawn.  A number that would overlap the previous number is omitted.
    """
    for value, _ in marks[1:]:
        axes.axvline(value, color=theme.colour("rim"), linewidth=0.6, alpha=0.7, zorder=1)
    if not has_leg_numbers or not marks:
        return
    min_x, max_x = axes.get_xlim()
    last_middle = -math.inf
    mark_ends = [value for value, _ in marks[1:]] + [max_x]
    text_options: dict[str, Any] = {
        "xycoords": ("data", "axes fraction"),
        "textcoords": "offset points",
        "ha": "center",
    }
    for (value, mark_text), end in zip(marks, mark_ends, strict=True):
        middle = 0.5 * (value + end)
        if middle - last_middle < 0.022 * (max_x - min_x):
            continue
        text = mark_text if last_middle == -math.inf else mark_text.removeprefix("leg ")
        axes.annotate(
            text, (middle, 1.0), (0, 3), color=theme.colour("quiet"), annotation_clip=False, fontsize=7, **text_options
        )
        last_middle = middle


# Layers.


def draw_layers(axes: Any, panel: Panel, min_zorder: float = 2.0) -> None:
    """Draw the layers of a panel in their order, and its limit lines between them.

    The limit lines are above bands and areas, but below other layers.

    min_zorder: matplotlib's zorder of the lowest layer.
    """
    for label, value in panel.limits:
        role_style = theme.ROLE_STYLES["limit"]
        axes.axhline(
            value,
            color=role_style.light,
            linewidth=role_style.width,
            linestyle=_make_dash_pattern(role_style),
            label=label or None,
            zorder=min_zorder + 0.95,
        )
    for k, layer in enumerate(panel.layers):
        # Draw bands below the limits, and all other layers above them.
        is_background = layer.kind in ("band", "area") and layer.role != "terrain"
        zorder = min_zorder + (0.0 if is_background else 1.0) + 0.9 * k / len(panel.layers)
        role_style = theme.ROLE_STYLES[layer.role]
        options: dict[str, Any] = {"zorder": zorder, "label": layer.legend or layer.name or None}
        match layer.kind:
            case "line":
                min_extent = 0.02 * np.ptp(axes.get_xlim())
                is_short = layer.role == "failing-leg" and np.hypot(np.ptp(layer.x), np.ptp(layer.y)) < min_extent
                (line,) = axes.plot(
                    layer.x,
                    layer.y,
                    color=role_style.light,
                    linewidth=role_style.width,
                    linestyle=_make_dash_pattern(role_style, layer.dashed),
                    solid_capstyle="round" if is_short or layer.role in ("planned", "inside") else "butt",
                    solid_joinstyle="round",
                    **options,
                )
                if role_style.halo:
                    rim_width, paper = role_style.width + 1.2, theme.colour("paper")
                    rim = patheffects.Stroke(linewidth=rim_width, foreground=paper, alpha=0.8)
                    line.set_path_effects([rim, patheffects.Normal()])
            case "band":
                # The bands have gaps where an edge is unknown; without a lower edge they reach down to 0.
                lower_edge = layer.lower_edge if layer.lower_edge is not None else np.zeros(len(layer.y))
                is_known = np.isfinite(layer.x) & np.isfinite(layer.y) & np.isfinite(lower_edge)
                edges = np.flatnonzero(np.diff(np.concatenate([[False], is_known, [False]]).astype(np.int8)))
                polygons = []
                for start, end in zip(edges[::2], edges[1::2], strict=True):
                    upper = np.column_stack([layer.x[start:end], layer.y[start:end]])
                    lower = np.column_stack([layer.x[start:end], lower_edge[start:end]])
                    polygons.append(np.vstack([upper, lower[::-1]]))
                axes.add_collection(PolyCollection(polygons, **_make_area_style(role_style), **options))
            case "area":
                # The rings are one path, so that the holes of the area stay open.
                points = np.column_stack([layer.x, layer.y])
                gaps = np.flatnonzero(np.isnan(layer.x))
                rings = [ring[np.isfinite(ring[:, 0])] for ring in np.split(points, gaps)]
                shape = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
                axes.add_patch(PathPatch(shape, **_make_area_style(role_style), **options))
            case "bars":
                axes.bar(layer.x, layer.y, width=0.62, color=role_style.light, **options)
            case "dots":
                axes.plot(layer.x, layer.y, **_make_dot_style(role_style, len(layer.x)), **options)
            case "rings":
                axes.plot(layer.x, layer.y, **_make_ring_style(role_style), **options)
            case "dashes":
                left, right = layer.x - 0.42, layer.x + 0.42
                axes.hlines(layer.y, left, right, color=role_style.light, linewidth=2.0, **options)


def _make_dash_pattern(role_style: theme.RoleStyle, dashed: bool = False) -> Any:
    """Return matplotlib's line style of a role: a dash pattern, or "-" for a solid line.

    dashed: True for dashes also if the role's line is solid.
    """
    pattern = role_style.dash or ((8.0, 3.5) if dashed else ())
    return (0, tuple(part / max(role_style.width, 0.1) for part in pattern)) if pattern else "-"


def _make_area_style(role_style: theme.RoleStyle) -> dict[str, Any]:
    """Return matplotlib's options for a filled area in the style of a role."""
    edge = theme.colour(role_style.edge) if role_style.edge else role_style.light
    if not role_style.width and not role_style.hatch:
        edge = "none"
    return {
        "facecolor": (*theme.rgb(role_style.light), role_style.fill),
        "edgecolor": edge,
        "linewidth": role_style.width,
        "linestyle": _make_dash_pattern(role_style),
        "hatch": role_style.hatch or None,
    }


def _make_dot_style(role_style: theme.RoleStyle, count: int = 1) -> dict[str, Any]:
    """Return matplotlib's options for markers in the style of a role.

    count: number of markers; markers of the common size (5.5 points) are smaller if there are more than `_MAX_TICKS`.
    """
    size = 3.0 if count > _MAX_TICKS and role_style.size == 5.5 else role_style.size
    style: dict[str, Any] = {
        "marker": _MARKERS[role_style.marker],
        "linestyle": "",
        "markersize": size,
        "color": role_style.light,
    }
    if role_style.face:
        return style | {"mfc": theme.colour(role_style.face), "mec": role_style.light, "mew": role_style.width}
    is_faint = role_style.size < 3.0
    return style | {"mew": 0.0 if is_faint else 0.8, "alpha": role_style.fill if is_faint else 1.0}


def _make_ring_style(role_style: theme.RoleStyle) -> dict[str, Any]:
    """Return matplotlib's options for hollow circles in the style of a role."""
    return {
        "marker": "o",
        "linestyle": "",
        "markersize": role_style.size,
        "mfc": "none",
        "mec": role_style.light,
        "mew": role_style.width,
        "color": role_style.light,
        "clip_on": False,
    }


# Names and legends.


def write_labels(axes: Any, panel: Panel) -> None:
    """Write a panel's labels, the most important first.

    They overlap neither each other nor the paths if possible.
    """
    placer = LabelPlacer(axes)
    for layer in panel.layers:
        if layer.kind == "line" and layer.role in ("planned", "flown", "other"):
            placer.avoid(layer.x, layer.y)
    for label in panel.labels:
        write_label(placer, label)


def write_label(placer: LabelPlacer, label: Label) -> None:
    """Write one label in the style of its rank at a place that `placer` finds.

    A label of rank "name" is left out if there is no free place.
    """
    size, gap = theme.LABELS[label.rank]
    options: dict[str, Any] = {"size": size, "gap": gap if label.prefer != (0, 0) else 0.0, "prefer": label.prefer}
    options["color"] = theme.colour(label.role)
    if label.rank == "fail":
        frame = {"boxstyle": "round,pad=0.2", "facecolor": theme.colour("paper"), "edgecolor": theme.colour("fail")}
        options["bbox"] = frame | {"linewidth": 0.9}
    elif label.rank == "name":
        options["optional"] = True
    else:
        options["fontweight"] = "bold"
    placer.place(label.text, label.x, label.y, **options)


def make_legend_handle(entry: LegendEntry) -> Any:
    """Return matplotlib's legend handle for an entry.

    It is a patch, marker or line in the style of the entry's first layer.
    """
    layer = entry.layers[0]
    role_style, text = theme.ROLE_STYLES[layer.role], textwrap.fill(entry.text, 36)
    if layer.kind in ("band", "area"):
        return Patch(label=text, **_make_area_style(role_style))
    if layer.kind == "bars":
        return Patch(label=text, color=role_style.light)
    if layer.kind == "dots":
        return Line2D([], [], label=text, **_make_dot_style(role_style) | {"alpha": 1.0})
    if layer.kind == "rings":
        return Line2D([], [], label=text, **_make_ring_style(role_style) | {"markersize": 9.0})
    dashes: Any = "-" if layer.kind == "dashes" else _make_dash_pattern(role_style, layer.dashed)
    return Line2D([], [], label=text, color=role_style.light, linewidth=min(role_style.width, 6.0), linestyle=dashes)


def draw_legend(figure: Figure, handles: list[Any], left: float, top: float, columns: int = 4) -> None:
    """Draw the legend of a figure, with its upper left corner at the given position.

    left: distance of the legend from the figure's left edge, inches.
    top: upper edge of the legend, as a fraction of the figure's height from its lower edge.
    """
    figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(left / WIDTH - 0.01, top),
        ncols=columns,
        columnspacing=1.4,
        handlelength=2.0,
        borderaxespad=0.0,
        borderpad=0.2,
        labelspacing=0.45,
    )


def _choose_legend_columns(entries: Sequence[LegendEntry]) -> int:
    """Return the number of legend columns that fit into the width of a picture, 1 to 4."""
    for columns in (4, 3, 2):
        rows = -(-len(entries) // columns)
        column_widths = [
            max(len(entry.text[:36]) for entry in entries[k : k + rows]) for k in range(0, len(entries), rows or 1)
        ]
        if sum(0.45 + 0.062 * width for width in column_widths) < WIDTH - 1.0:
            return columns
    return 1
