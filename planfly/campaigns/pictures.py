"""Draw the pictures of a campaign.

They show failures by place, probability against wind, tracks, and the go/no-go chart.
"""

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.patches import Ellipse
from matplotlib.text import Text
from numpy.typing import NDArray

from logs import theme
from logs.views.charts import shorten
from logs.views.drawing import clean_style, new_figure
from planfly.campaigns.statistics.decision import Interval, wilson
from world.arrays import Floats
from world.wording import count_range_text

PLANNED = theme.colour("planned")
BLUE = theme.colour("second")
FAIL = theme.colour("fail")
LIMIT_COLOUR = theme.colour("limit")
INTERVAL_COLOUR = theme.colour("commanded")
INK_COLOUR = theme.colour("ink")
QUIET_COLOUR = theme.colour("quiet")
GRID_COLOUR = theme.colour("grid")
PAPER = theme.colour("paper")


# ----------------------------------------------------------------------
# Failures by rule and place.

# Maximum number of bars; the most frequent failures are shown.
MAX_BARS = 14


def draw_failures(counts: Sequence[tuple[str, str, int]], flights: int) -> Figure:
    """Draw a bar chart of the failed flights for each rule and place.

    The most frequent come first; there are at most `MAX_BARS`.

    counts: for each rule and place, the rule's title, the place in words, and the number of flights that failed there.
    flights: total number of flights.
    """
    with clean_style():
        bars = sorted(counts, key=lambda count: -count[2])[:MAX_BARS]
        height = 1.4 + 0.32 * max(1, len(bars))
        figure = new_figure(height)
        axes = figure.add_axes((0.27, 0.6 / height, 0.69, 1.0 - 1.1 / height))
        axes.set_title("Failures by rule and place")
        for spine in ("top", "right"):
            axes.spines[spine].set_visible(False)
        if not bars:
            axes.set_axis_off()
            axes.text(
                0.0, 0.5, f"No flight of {flights} failed.", transform=axes.transAxes, fontsize=11, color=QUIET_COLOUR
            )
            return figure
        rows = list(range(len(bars)))
        numbers = [count[2] for count in bars]
        axes.barh(rows, numbers, height=0.62, color=FAIL)
        for row, number in zip(rows, numbers, strict=True):
            axes.annotate(
                f"{number}  ({100.0 * number / max(1, flights):.1f} %)",
                (number, row),
                xytext=(4, 0),
                textcoords="offset points",
                va="center",
                fontsize=8,
                color=INK_COLOUR,
            )
        axes.set_yticks(rows, [shorten(f"{rule}, {place}", 38) for rule, place, _ in bars])
        axes.invert_yaxis()
        axes.set_xlim(0.0, 1.2 * max(numbers))
        axes.set_xlabel(f"flights, of {flights}")
    return figure


# ----------------------------------------------------------------------
# Probability against wind speed, and sensitivities of the deciding margin.


# Width of a bin of wind speeds, m/s; bins are wider if there would be more than `_MAX_BINS`.
_BIN_WIDTH_MPS = 1.0
# Maximum number of bins.
_MAX_BINS = 20


@dataclass(frozen=True)
class SpeedBin:
    """Flights in a range of wind speeds.

    low, high: range of wind speeds, m/s.
    flights, flyable: number of flights and of flyable flights.
    interval: Wilson's interval of the flyable fraction.
    """

    low: float
    high: float
    flights: int
    flyable: int
    interval: Interval


@dataclass(frozen=True)
class Bar:
    """Bar of the tornado chart, for one quantity.

    title: title of the quantity.
    index: fraction of the margin's variance that the quantity explains (first-order index), 0 to 1.
    slope: rank correlation of the quantity with the margin, -1 to 1.
    """

    title: str
    index: float
    slope: float


def group_by_speed(speed: Floats, flyable: NDArray[np.bool_], confidence: float = 0.95) -> list[SpeedBin]:
    """Count the flights and the flyable flights in each range of wind speeds.

    Ranges without a flight are omitted.

    speed: wind speed of each flight, m/s, (n,).
    flyable: True for a flyable flight, (n,).
    confidence: confidence of the interval of the flyable fraction.

    >>> [one.flights for one in group_by_speed(np.array([0.2, 0.7, 2.5]), np.array([True, False, True]))]
    [2, 1]
    """
    if not speed.size:
        return []
    width = max(_BIN_WIDTH_MPS, float(np.ptp(speed)) / _MAX_BINS)
    groups = np.floor(speed / width).astype(int)
    bins = []
    for number in np.unique(groups):
        is_flyable = flyable[groups == number]
        flight_count, flyable_count = int(is_flyable.size), int(is_flyable.sum())
        bins.append(
            SpeedBin(
                number * width,
                (number + 1) * width,
                flight_count,
                flyable_count,
                wilson(flyable_count, flight_count, confidence),
            )
        )
    return bins


def draw_probability(bins: Sequence[SpeedBin], target: float | None) -> Figure:
    """Draw the fraction of flyable flights against wind speed.

    Its interval and the numbers of flights are shown.

    target: required probability, drawn as a line, or None.
    bins: flights by ranges of wind speed, see `group_by_speed`.
    """
    with clean_style():
        figure = new_figure(4.2)
        axes = figure.add_axes((0.08, 0.16, 0.89, 0.70))
        centres = [0.5 * (speed_bin.low + speed_bin.high) for speed_bin in bins]
        fractions = [speed_bin.flyable / speed_bin.flights for speed_bin in bins]
        for speed_bin, centre, fraction in zip(bins, centres, fractions, strict=True):
            # The interval is a thin bar, because a band of few flights would dominate the fraction itself.
            interval = speed_bin.interval
            axes.vlines(centre, interval.low, interval.high, color=PLANNED, linewidth=1.5)
            axes.plot([speed_bin.low, speed_bin.high], [fraction, fraction], color=BLUE, linewidth=3.5)
            axes.annotate(
                f"{speed_bin.flyable}/{speed_bin.flights}",
                (centre, -0.10),
                xytext=(0, 3),
                textcoords="offset points",
                ha="center",
                fontsize=7,
                color=QUIET_COLOUR,
            )
        if target is not None:
            axes.axhline(target, color=LIMIT_COLOUR, linewidth=1.2, linestyle="--")
            axes.annotate(
                f"target {target:g}",
                (1.0, target),
                xycoords=("axes fraction", "data"),
                xytext=(-4, -11),
                textcoords="offset points",
                ha="right",
                color=INK_COLOUR,
                fontsize=8,
            )
        axes.set_ylim(-0.10, 1.05)
        axes.set_xlabel("mean wind at the start's height (m/s)")
        axes.set_ylabel("share of flyable flights")
        axes.set_title(
            "Flyable flights against wind speed (line: their share; bar: its Wilson interval; below: flyable/flown)"
        )
        # A grid behind the data, and no top and right edge of the axes.
        axes.grid(visible=True, color=GRID_COLOUR, linewidth=0.6)
        axes.set_axisbelow(True)
        for spine in ("top", "right"):
            axes.spines[spine].set_visible(False)
    return figure


def draw_tornado(bars: Sequence[Bar], rule_title: str) -> Figure:
    """Draw a tornado chart: the fraction of the deciding margin's variance that each quantity explains.

    A bar points to the right if an increase of the quantity increases the margin.
    bars: the quantities, from top to bottom.
    rule_title: title of the rule with the deciding margin.
    """
    with clean_style():
        height = 1.2 + 0.3 * max(1, len(bars))
        figure = new_figure(height)
        axes = figure.add_axes((0.17, 0.5 / height, 0.79, 1.0 - 1.1 / height))
        rows = range(len(bars))
        for row, bar in zip(rows, bars, strict=True):
            length = bar.index * (1.0 if bar.slope >= 0.0 else -1.0)
            axes.barh(row, length, height=0.62, color=BLUE if length >= 0.0 else FAIL)
            axes.annotate(
                f"{100.0 * bar.index:.0f} %",
                (length, row),
                xytext=(4 if length >= 0.0 else -4, 0),
                textcoords="offset points",
                va="center",
                ha="left" if length >= 0.0 else "right",
                fontsize=8,
            )
        axes.axvline(0.0, color=INK_COLOUR, linewidth=0.8)
        axes.set_yticks(list(rows), [bar.title for bar in bars])
        axes.invert_yaxis()
        half_range = max([0.2, *(1.25 * bar.index for bar in bars)])
        axes.set_xlim(-half_range, half_range)
        axes.set_xlabel("share of the margin's variance   (left: an increase reduces the margin; right: increases it)")
        axes.set_title(f"What decides: first-order sensitivity of the margin of {rule_title}")
        axes.set_xticks([])
        for spine in ("top", "right", "left"):
            axes.spines[spine].set_visible(False)
        axes.tick_params(left=False)
    return figure


# ----------------------------------------------------------------------
# Draw the tracks of the flights, as height above ground along the path and as crossings of each waypoint.

# Lower quantile, upper quantile and opacity of each band of flights, the widest first.
_QUANTILE_BANDS = ((0.0, 1.0, 0.18), (0.05, 0.95, 0.30), (0.25, 0.75, 0.45))
# Chi-square of two degrees of freedom at 95 %, which gives the squared half axes of the ellipse in standard deviations.
_CHI2 = -2.0 * math.log(0.05)
# Number of panels in a row.
_PANELS_PER_ROW = 5


def draw_clearance_fan(
    clearance: Floats, has_failed: NDArray[np.bool_], terrain_altitudes: Floats, length: float, min_clearance: float
) -> Figure:
    """Draw quantile bands of the flights' heights along the path, above the ground.

    clearance: minimum clearance of each flight on each of s equal pieces of the path, m, (n, s); NaN if not reached.
    has_failed: True for a flight that is not flyable, (n,); at most 30 of them are drawn.
    terrain_altitudes: terrain altitude, m AMSL, (s,).
    length: length of the path, m.
    min_clearance: required clearance, m.
    """
    with clean_style():
        figure = new_figure(5.4)
        upper_axes = figure.add_axes((0.08, 0.36, 0.89, 0.56))
        lower_axes = figure.add_axes((0.08, 0.10, 0.89, 0.20), sharex=upper_axes)
        stations = clearance.shape[1]
        distance_km = (np.arange(stations) + 0.5) / stations * length / 1000.0
        has_data = np.isfinite(clearance).any(axis=0)
        for lower_quantile, upper_quantile, alpha in _QUANTILE_BANDS:
            band = np.full((2, stations), np.nan)
            band[:, has_data] = np.nanquantile(clearance[:, has_data], (lower_quantile, upper_quantile), axis=0)
            label = (
                "all flights"
                if lower_quantile == 0.0
                else f"{100 * (upper_quantile - lower_quantile):.0f} % of flights"
            )
            upper_axes.fill_between(
                distance_km, band[0], band[1], color=PLANNED, alpha=alpha + 0.15, linewidth=0.0, label=label
            )
        median = np.full(stations, np.nan)
        median[has_data] = np.nanmedian(clearance[:, has_data], axis=0)
        upper_axes.plot(distance_km, median, color=BLUE, linewidth=1.4, label="median")
        for number, row in enumerate(clearance[has_failed][:30]):
            upper_axes.plot(
                distance_km, row, color=FAIL, linewidth=0.7, alpha=0.8, label="not flyable" if number == 0 else None
            )
        upper_axes.axhline(
            min_clearance, color=LIMIT_COLOUR, linewidth=1.4, linestyle="--", label=f"required, {min_clearance:g} m"
        )
        upper_axes.set_ylim(bottom=0.0)
        upper_axes.set_ylabel("above ground (m)")
        # The legend is above the panel, where it covers no band, and the title above the legend.
        upper_axes.set_title("Clearance along the path, over all flights", pad=20.0)
        upper_axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=6, columnspacing=1.0, borderaxespad=0.2)
        upper_axes.tick_params(labelbottom=False)
        lower_axes.fill_between(
            distance_km, terrain_altitudes, np.nanmin(terrain_altitudes) - 10.0, color=theme.GROUND[1], linewidth=0.0
        )
        lower_axes.plot(distance_km, terrain_altitudes, color=QUIET_COLOUR, linewidth=0.8)
        lower_axes.set_xlim(0.0, length / 1000.0)
        lower_axes.set_ylabel("ground (m AMSL)")
        lower_axes.set_xlabel("along the path (km)")
        for axes in (upper_axes, lower_axes):
            axes.grid(visible=True, color=GRID_COLOUR, linewidth=0.5)
            axes.set_axisbelow(True)
            for spine in ("top", "right"):
                axes.spines[spine].set_visible(False)
    return figure


def draw_crossings(crossings: Floats, has_failed: NDArray[np.bool_]) -> Figure:
    """Draw a panel for each waypoint with the positions at which flights passed it, seen along the path.

    Each panel shows the 95 % ellipse of `covariance_ellipse`.

    crossings: distance right of and above each waypoint, m, (n, w, 2); NaN if not reached.
    has_failed: True for a flight that is not flyable, (n,).
    """
    count = crossings.shape[1]
    columns = min(_PANELS_PER_ROW, count)
    row_count = -(-count // columns)
    with clean_style():
        figure = new_figure(0.7 + 2.0 * row_count)
        panels = figure.subplots(row_count, columns, squeeze=False)
        height = 0.7 + 2.0 * row_count
        figure.subplots_adjust(
            left=0.07, right=0.98, bottom=0.4 / height, top=1.0 - 0.65 / height, wspace=0.22, hspace=0.35
        )
        for waypoint, axes in enumerate(panels.ravel()):
            if waypoint >= count:
                axes.set_axis_off()
                continue
            points = crossings[:, waypoint]
            is_reached = np.isfinite(points).all(axis=1)
            axes.axhline(0.0, color=GRID_COLOUR, linewidth=0.6)
            axes.axvline(0.0, color=GRID_COLOUR, linewidth=0.6)
            # Thousands of points, drawn as pixels, in a colour that is visible on light and on dark paper.
            axes.plot(
                *points[is_reached & ~has_failed].T, ".", color=PLANNED, markersize=2.6, alpha=0.8, rasterized=True
            )
            axes.plot(*points[is_reached & has_failed].T, "x", color=FAIL, markersize=3.5)
            # The panel contains 99.5 % of the distances.
            distances = np.abs(points[np.isfinite(points)])
            half_size = max(5.0, 1.1 * float(np.quantile(distances, 0.995))) if distances.size else 10.0
            if is_reached.sum() > 2:
                ellipse = covariance_ellipse(points[is_reached])
                # The ellipse's extents are in metres until it is added to axes.
                half_size = max(half_size, 1.05 * float(np.abs(ellipse.get_extents().get_points()).max()))
                axes.add_patch(ellipse)
            axes.set_title(f"waypoint {waypoint}", fontsize=8.5, pad=3.0)
            axes.set_xlim(-half_size, half_size)
            axes.set_ylim(-half_size, half_size)
            axes.tick_params(labelsize=7)
        title = "Flights at each waypoint, m to the right and above, with the 95 % ellipse"
        figure.text(0.07, 1.0 - 0.3 / height, title, fontsize=11, color=INK_COLOUR)
        figure.text(0.98, 1.0 - 0.3 / height, "dot: flyable, cross: not", fontsize=8, color=QUIET_COLOUR, ha="right")
    return figure


def covariance_ellipse(points: Floats) -> Ellipse:
    """Return the 95 % ellipse of the normal distribution fitted to points, (n, 2).

    >>> points = np.array([[3.0, 0.0], [-3.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    >>> ellipse = covariance_ellipse(points)
    >>> round(ellipse.width, 2), round(ellipse.height, 2)
    (11.99, 4.0)
    """
    covariance = np.cov(points.T)
    values, vectors = np.linalg.eigh(covariance)
    major_axis, minor_axis = (2.0 * math.sqrt(_CHI2 * max(0.0, float(value))) for value in values[::-1])
    angle = math.degrees(math.atan2(vectors[1, 1], vectors[0, 1]))
    right, height = (float(value) for value in points.mean(axis=0))
    return Ellipse(
        (right, height), major_axis, minor_axis, angle=angle, fill=False, edgecolor=INK_COLOUR, linewidth=0.9
    )


# ----------------------------------------------------------------------
# Draw the go/no-go chart of the strongest wind from each direction in which a mission flies.


@dataclass(frozen=True)
class ChartDirection:
    """Wind direction of the chart.

    from_deg: direction from which the wind blows, degrees.
    boundary: estimate of the strongest wind with the target probability, m/s.
    low, high: interval of the boundary, m/s.
    is_beyond_search: True if the boundary is beyond the maximum wind of the search.
    flights: for each mark, the wind speed, m/s, the number of flights and the number of flyable flights.
    is_judged: True if the boundary of the direction is judged.
    """

    from_deg: float
    boundary: float
    low: float
    high: float
    is_beyond_search: bool
    flights: tuple[tuple[float, int, int], ...]
    is_judged: bool = True

    @property
    def flight_count(self) -> int:
        """Number of flights of the direction."""
        return sum(count for _, count, _ in self.flights)


def draw_go_no_go(
    directions: Sequence[ChartDirection],
    max_speed: float,
    target: float,
    confidence: float,
    name: str,
    wind: tuple[float, float] | None,
) -> Figure:
    """Draw a polar chart, north up, of the winds in which a mission is flyable.

    directions: boundary and flights of each wind direction, clockwise from north.
    max_speed: maximum wind of the search, at the edge of the chart, m/s.
    target, confidence: required probability of a flyable flight, and confidence of the boundaries' intervals.
    name: name of the mission, for the title.
    wind: speed, m/s, and direction, degrees, of the scenario's wind, which is drawn as a star; or None.
    """
    with clean_style():
        figure = new_figure(7.6)
        axes = figure.add_axes((0.06, 0.07, 0.64, 0.80), projection="polar")
        axes.set_theta_zero_location("N")  # type: ignore[attr-defined]  # of polar axes
        axes.set_theta_direction(-1)  # type: ignore[attr-defined]  # of polar axes
        _draw_wind_areas(axes, directions, max_speed)
        for direction in directions:
            if direction.is_judged and direction.is_beyond_search:
                axes.plot(
                    np.radians(direction.from_deg),
                    max_speed,
                    marker=(3, 0, -direction.from_deg),
                    color=QUIET_COLOUR,
                    markersize=7,
                    linewidth=0.0,
                    clip_on=False,
                )
            for speed, flights, flyable in direction.flights:
                all_flyable = flights == flyable
                axes.plot(
                    np.radians(direction.from_deg),
                    speed,
                    marker="o" if all_flyable else "x",
                    color=BLUE if all_flyable else FAIL,
                    markersize=2.6 if all_flyable else 3.6,
                    linewidth=0.0,
                    alpha=0.75,
                )
        if wind is not None:
            axes.plot(np.radians(wind[1]), wind[0], marker="*", color=INK_COLOUR, markersize=13, markeredgecolor=PAPER)
        axes.set_ylim(0.0, max_speed)
        axes.set_xticks(np.radians(np.arange(0, 360, 45)), ["N", "NE", "E", "SE", "S", "SW", "W", "NW"])
        axes.set_rlabel_position(11.0)  # type: ignore[attr-defined]  # of polar axes
        axes.tick_params(axis="y", labelsize=8)
        axes.grid(color=GRID_COLOUR, linewidth=0.6)
        figure.text(0.03, 0.955, f"{name}: wind in which it is flyable", fontsize=14, color=INK_COLOUR)
        figure.text(
            0.03,
            0.922,
            f"wind from each direction, m/s; flyable with a probability of {target:g} or more",
            fontsize=9,
            color=QUIET_COLOUR,
        )
        is_open = any(direction.is_judged and direction.is_beyond_search for direction in directions)
        open_edge = max_speed if is_open else None
        _draw_legend(figure, directions, target, confidence, wind, open_edge)
    return figure


def _draw_wind_areas(axes: Any, directions: Sequence[ChartDirection], max_speed: float) -> None:
    """Draw the areas of winds in which a mission is and is not flyable, and the boundary between them.

    The sectors next to a direction that is not judged are grey.

    max_speed: maximum wind of the search, m/s.
    """
    angle = np.radians([direction.from_deg for direction in directions] + [directions[0].from_deg + 360.0])
    circle = [*directions, directions[0]]
    fine_angles = np.linspace(angle[0], angle[-1], 720)

    def interpolate(values: Sequence[float]) -> np.ndarray:
        """Interpolate values at the directions to the fine grid of angles."""
        return np.interp(fine_angles, angle, values)

    lower = interpolate([point.low for point in circle])
    upper = interpolate([point.high for point in circle])
    boundary = interpolate([point.boundary for point in circle])
    is_known = interpolate([float(point.is_judged) for point in circle]) > 1.0 - 1e-9
    for start, end, mask, colour, alpha in (
        (0.0, lower, is_known, PLANNED, 0.45),
        (boundary, max_speed, is_known, FAIL, 0.13),
        (lower, upper, is_known, INTERVAL_COLOUR, 0.45),
        (0.0, max_speed, ~is_known, GRID_COLOUR, 0.5),
    ):
        axes.fill_between(fine_angles, start, end, where=mask, color=colour, alpha=alpha, linewidth=0.0)
    # The largest wind of the search is not a limit of the mission.
    is_drawn = is_known & (boundary < max_speed - 1e-6)
    axes.plot(fine_angles, np.where(is_drawn, boundary, np.nan), color=INK_COLOUR, linewidth=1.8)


def _draw_legend(
    figure: Figure,
    directions: Sequence[ChartDirection],
    target: float,
    confidence: float,
    wind: tuple[float, float] | None,
    open_edge: float | None,
) -> None:
    """Draw the legend of the go/no-go chart, with entries only for what the chart shows.

    directions, target, confidence, wind: as in `draw_go_no_go`.
    open_edge: maximum wind of the search, m/s, if a judged boundary is beyond it, otherwise None.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles_and_labels: list[tuple[Artist, str]] = []
    if any(direction.is_judged for direction in directions):
        handles_and_labels += [
            (Patch(color=PLANNED, alpha=0.45), f"go: P >= {target:g} also at the\nlow end of the interval"),
            (Line2D([], [], color=INK_COLOUR, linewidth=1.8), f"boundary, P = {target:g}"),
            (Patch(color=INTERVAL_COLOUR, alpha=0.45), f"interval of the\nboundary, {100 * confidence:g} %"),
            (Patch(color=FAIL, alpha=0.13), f"no-go: P < {target:g}"),
        ]
    counts = [direction.flight_count for direction in directions if not direction.is_judged]
    if counts:
        label = f"not judged, {count_range_text(counts, 'flight')}\nfrom each direction"
        handles_and_labels.append((Patch(color=GRID_COLOUR, alpha=0.5), label))
    handles_and_labels += [
        (Line2D([], [], color=BLUE, marker="o", markersize=3, linewidth=0), "flown, all flyable"),
        (Line2D([], [], color=FAIL, marker="x", markersize=4, linewidth=0), "flown, some not flyable"),
    ]
    if open_edge is not None:
        handles_and_labels.append(
            (
                Line2D([], [], color=QUIET_COLOUR, marker="^", markersize=7, linewidth=0),
                f"no limit found up to\n{open_edge:g} m/s",
            )
        )
    if wind is not None:
        handles_and_labels.append(
            (Line2D([], [], color=INK_COLOUR, marker="*", markersize=11, linewidth=0), "the scenario's wind")
        )
    figure.legend(
        [handle for handle, _ in handles_and_labels],
        [label for _, label in handles_and_labels],
        loc="center left",
        bbox_to_anchor=(0.735, 0.45),
        fontsize=9,
        labelspacing=1.0,
    )


# ----------------------------------------------------------------------
# Lay out the pictures for phones, with readable text.

# Width of a picture, in.
NARROW_WIDTH_IN = 5.0
# Margin at an edge, in.
_EDGE_IN = 0.15
# Height of a line of a legend, in.
_LEGEND_LINE_IN = 0.34
# Height of a line of a map's legend, which has one column, in.
_MAP_LEGEND_LINE_IN = 0.21
# Number of panels in a row.
_NARROW_PANELS_PER_ROW = 3
# Size of a panel, in.
_PANEL_IN = 1.1
# Size of a panel with its title and numbers, in.
_PANEL_STEP_IN = 1.6
# Left edge of a map, in.
_MAP_LEFT_IN = 0.6
# Distance between a map, what is below it, and the legend, in.
_MAP_GAP_IN = 0.55
# Distance between colour bar, compass and notes, in.
_MAP_COLUMN_GAP_IN = 0.75
# Width of a letter, relative to the font size.
_LETTER_WIDTH_RATIO = 0.57
# Line spacing, relative to the font size.
_LINE_SPACING_RATIO = 1.3


def narrow_figure(figure: Figure) -> Figure:
    """Change a figure of this module to a narrow layout for phones, `NARROW_WIDTH_IN` wide, and return it.

    >>> float(narrow_figure(draw_failures([("slopes", "leg 2", 3)], 9)).get_figwidth())
    5.0
    """
    if figure.axes[0].get_aspect() != "auto" and len(figure.axes[0].images) > 0:
        return _narrow_map(figure)
    old_width, old_height = figure.get_size_inches().tolist()
    panels = [axes for axes in figure.axes if axes.axison]
    legends = [*figure.legends, *(legend for axes in panels if (legend := axes.get_legend()) is not None)]
    legend_height = _LEGEND_LINE_IN * sum(-(-len(legend.get_texts()) // 2) for legend in legends)
    # Distance of the next text of the figure from the top, in.
    text_height = _EDGE_IN
    texts = []
    for text in figure.texts:
        texts.append((text, text_height))
        text_height += _wrap_text(text, NARROW_WIDTH_IN - 2.0 * _EDGE_IN)
    boxes: list[tuple[float, float, float, float]] = []  # left, top from the picture's top, width, height, in
    if any(axes.name == "polar" for axes in panels):
        chart_size = NARROW_WIDTH_IN - 1.0
        boxes = [(0.5, text_height + 0.4, chart_size, chart_size)]
        height = text_height + chart_size + 0.9 + legend_height
    elif any(axes.get_subplotspec() is not None for axes in panels):
        step = (NARROW_WIDTH_IN - _EDGE_IN) / _NARROW_PANELS_PER_ROW
        for number in range(len(panels)):
            row, column = divmod(number, _NARROW_PANELS_PER_ROW)
            boxes.append((0.4 + step * column, text_height + 0.3 + _PANEL_STEP_IN * row, _PANEL_IN, _PANEL_IN))
        height = text_height + 0.3 + _PANEL_STEP_IN * -(-len(panels) // _NARROW_PANELS_PER_ROW)
    else:
        title_height = label_height = 0.0
        for axes in figure.axes:
            box = axes.get_position()
            box_left = box.x0 * old_width
            width = NARROW_WIDTH_IN - box_left - 2.0 * _EDGE_IN
            title_height = max(title_height, sum(_wrap_text(handle, width) for handle in _left_title(axes)))
            label_height = max(label_height, _wrap_text(axes.xaxis.label, width))
            if axes.patches and axes.get_xlim()[0] == 0.0:
                # Leave room for the number after the longest bar.
                axes.set_xlim(0.0, 1.5 * axes.get_xlim()[1])
            boxes.append((box_left, (1.0 - box.y1) * old_height, width, box.height * old_height))
        boxes = [
            (box_left, box_top + title_height, width, box_height) for box_left, box_top, width, box_height in boxes
        ]
        height = old_height + title_height + label_height + legend_height
    figure.set_size_inches(NARROW_WIDTH_IN, height)
    for axes, (box_left, box_top, width, box_height) in zip(panels or figure.axes, boxes, strict=True):
        axes.set_position(
            (
                box_left / NARROW_WIDTH_IN,
                1.0 - (box_top + box_height) / height,
                width / NARROW_WIDTH_IN,
                box_height / height,
            )
        )
    for text, box_top in texts:
        text.update({"x": _EDGE_IN / NARROW_WIDTH_IN, "y": 1.0 - box_top / height, "ha": "left", "va": "top"})
    _move_legends(figure, legends, 2)
    return figure


def _move_legends(figure: Figure, legends: Sequence[Legend], columns: int) -> None:
    """Replace each legend by one with the same entries in the lower left corner of the figure.

    columns: number of columns of the new legend.
    """
    for legend in legends:
        labels = [text.get_text() for text in legend.get_texts()]
        handles = [handle for handle in legend.legend_handles if handle is not None]
        with clean_style():
            figure.legend(handles, labels, loc="lower left", ncols=columns, fontsize=9)
        legend.remove()


def _narrow_map(figure: Figure) -> Figure:
    """Change a map to a narrow layout, and return it.

    Colour bar, compass and notes form a row below the map, with the legends below it.
    """
    map_axes, *side_axes = figure.axes
    old_width, old_height = figure.get_size_inches().tolist()
    map_box = map_axes.get_position()
    map_width = NARROW_WIDTH_IN - _MAP_LEFT_IN - 2.0 * _EDGE_IN
    map_height = map_width * (map_box.height * old_height) / (map_box.width * old_width)
    title_height = sum(_wrap_text(title, map_width) for title in _left_title(map_axes))
    sizes = [(box.width * old_width, box.height * old_height) for box in (axes.get_position() for axes in side_axes)]
    side_top = _EDGE_IN + title_height + map_height + _MAP_GAP_IN
    side_height = max((height for _, height in sizes), default=0.0)
    legends = list(figure.legends)
    legend_texts = [text.get_text() for legend in legends for text in legend.get_texts()]
    legend_height = _MAP_LEGEND_LINE_IN * sum(text.count("\n") + 1 for text in legend_texts)
    height = side_top + side_height + _MAP_GAP_IN + legend_height
    figure.set_size_inches(NARROW_WIDTH_IN, height)
    boxes = [(_MAP_LEFT_IN, _EDGE_IN + title_height, map_width, map_height)]
    left = _MAP_LEFT_IN
    for width, box_height in sizes:
        boxes.append((left, side_top, width, box_height))
        left += width + _MAP_COLUMN_GAP_IN
    for axes, (box_left, top, width, box_height) in zip(figure.axes, boxes, strict=True):
        position = box_left / NARROW_WIDTH_IN, 1.0 - (top + box_height) / height
        axes.set_position((*position, width / NARROW_WIDTH_IN, box_height / height))
    for number, text in enumerate(figure.texts):
        text.update(
            {"x": left / NARROW_WIDTH_IN, "y": 1.0 - (side_top + number * 0.7) / height, "ha": "left", "va": "top"}
        )
    _move_legends(figure, legends, 1)
    return figure


def _left_title(axes: Axes) -> list[Text]:
    """Return the text objects of a panel's left title: one, or none if the title is empty."""
    title = axes.get_title("left")
    return [child for child in axes.get_children() if isinstance(child, Text) and title and child.get_text() == title]


def _wrap_text(text: Text, width: float) -> float:
    """Break a text object into lines of at most `width` inches; return the height of all lines, inches."""
    size = float(text.get_fontsize()) / 72.0
    lines = textwrap.wrap(text.get_text(), max(10, int(width / (_LETTER_WIDTH_RATIO * size))))
    text.set_text("\n".join(lines))
    return _LINE_SPACING_RATIO * size * len(lines)
