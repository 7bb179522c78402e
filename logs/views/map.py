"""The map: terrain, threats, the planned path and the flown track from above."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Rectangle
from matplotlib.ticker import FuncFormatter, MultipleLocator
from numpy.typing import NDArray

from flight.simulation.track import Track
from logs.verdict.findings import Verdict
from logs.views import drawing
from logs.views.failures import (
    Failures,
    LabelPlacer,
    draw_inside,
    failures,
    inside_threats,
    paths_differ,
    radius_of,
    write_fail_labels,
)
from logs.views.threats_and_zones import draw_threat_circles, draw_zone_shapes, name_zones
from world.scenario import Scenario
from world.terrain import Terrain
from world.threats import Threats
from world.wind import Wind

Floats = NDArray[np.float64]


# ----------------------------------------------------------------------
# The ground under a map: shaded heights, contours and their colour bar.


def draw_ground(figure: Figure, axes: Any, terrain: Terrain | None, column: float, top: float) -> list[Any]:
    """Shaded heights with labelled contours and a colour bar, or a note where there is no terrain.

    column: left edge (inches) of the column beside the map.  top: inches above it.  Returns what the legend shows.
    """
    note: dict[str, Any] = {"x": column / drawing.WIDTH, "y": 0.6, "color": drawing.QUIET}
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
    colours = LinearSegmentedColormap.from_list("ground", drawing.GROUND)
    norm = Normalize(low - 0.5, high + 0.5) if flat else Normalize(low, high)
    picture = colours(norm(heights))
    picture[..., :3] *= 1.0 if flat else _shade(heights, float(north[1] - north[0]), high - low)[..., None]
    picture[np.isnan(heights)] = (0.93, 0.93, 0.93, 1.0)
    extent = (*east_range, *north_range)
    axes.imshow(picture, extent=extent, origin="lower", interpolation="bilinear", zorder=1, aspect="equal")
    if flat:
        figure.text(s=f"level ground,\n{low:.0f} m AMSL", **note)
        return []
    step = drawing.nice_step(high - low, 10)
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
    frame = (column / drawing.WIDTH, (total - top - tall - 0.25) / total, 0.16 / drawing.WIDTH, tall / total)
    bar = figure.colorbar(ScalarMappable(norm, colours), cax=figure.add_axes(frame))
    bar.set_ticks(levels[:: max(1, len(levels) // 8)].tolist())
    bar.set_label("ground height (m AMSL)", fontsize=8)
    bar.ax.tick_params(labelsize=7.5)


# ----------------------------------------------------------------------
# What stands around a map or a profile: the legend below, and the compass with the wind.

# Inches from a line of the wind's note to the next.
_LINE = 0.145


def draw_legend(figure: Figure, handles: list[Any], left: float, top: float) -> None:
    """Write the legend below the picture, where it hides nothing.

    left: inches from the figure's edge.  top: its upper edge as a share of the figure's height.
    """
    figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(left / drawing.WIDTH - 0.01, top),
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
        handles.append(Line2D([], [], color=drawing.FAIL, linewidth=6, alpha=0.9, label="leg that fails a rule"))
    if failed.waypoints:
        ring: dict[str, Any] = {"marker": "o", "linestyle": "", "markersize": 9, "mfc": "none", "markeredgewidth": 2.0}
        handles.append(Line2D([], [], color=drawing.FAIL, label="waypoint that fails a rule", **ring))
    if failed.threats:
        handles.append(Patch(facecolor="none", edgecolor=drawing.FAIL, linewidth=2.2, label="threat that is entered"))
    return handles


@dataclass(frozen=True, slots=True)
class NamedWind:
    """A wind of the compass; name: of the flight that it belongs to, "" where there is one wind alone."""

    wind: Wind
    name: str = ""
    colour: str = drawing.BLUE


def draw_compass(figure: Figure, winds: Sequence[NamedWind], column: float) -> None:
    """Show north, and where each wind blows to, in the column (its left edge in inches) beside the map."""
    total = float(figure.get_figheight())
    side = 1.0
    notes = [(_wind_text(named), named.colour if len(winds) > 1 else drawing.INK) for named in winds]
    lines = sum(text.count("\n") + 1 for text, _ in notes)
    base = max(1.35, 0.2 + _LINE * (lines + len(notes) - 1))
    dial = figure.add_axes((column / drawing.WIDTH - 0.01, base / total, side / drawing.WIDTH, side / total))
    dial.set(xlim=(-1.25, 1.25), ylim=(-1.25, 1.25), aspect="equal")
    dial.axis("off")
    dial.add_patch(Circle((0, 0), 1.0, fill=False, edgecolor="#999999", linewidth=0.8))
    dial.text(0, 1.05, "N", ha="center", va="bottom", fontsize=8.5, fontweight="bold")
    dial.plot([0, 0], [0.82, 1.0], color=drawing.INK, linewidth=1.2)
    blowing = [named for named in winds if named.wind.speed > 0.0]
    for k, named in enumerate(blowing):
        east, north = np.sin(named.wind.from_course), np.cos(named.wind.from_course)
        # A second arrow is dashed and shorter, so that both show where they lie on each other.
        arrow: dict[str, Any] = {"arrowstyle": "-|>", "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0}
        arrow |= {"color": named.colour, "linestyle": (0, (3, 1.5)) if k else "-"}
        length = 0.8 - 0.25 * k
        dial.annotate("", (-length * east, -length * north), (length * east, length * north), arrowprops=arrow)
    if not blowing:
        dial.text(0, 0, "calm", ha="center", va="center", fontsize=7.5, color=drawing.QUIET)
    top = base - 0.02
    for text, colour in notes:
        look: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": 7.5, "color": colour}
        figure.text((column + 0.4) / drawing.WIDTH, top / total, text, **look)
        top -= _LINE * (text.count("\n") + 2)


def _wind_text(named: NamedWind) -> str:
    wind = named.wind
    note = f"{drawing.shorten(named.name, 22)}:\n" if named.name else ""
    if wind.speed > 0.0:
        note += f"wind {wind.speed:.1f} m/s\nfrom {round(np.degrees(wind.from_course)) % 360:03d}°"
    else:
        note += "no mean wind"
    return note + (f"\n{wind.turbulence} turbulence" if wind.turbulence != "none" else "")


# Inches: the map's own width, and what stands around it.
_LEFT, _MAP_WIDTH, _TOP, _BOTTOM = 0.72, 7.72, 0.5, 0.55
_RIGHT_COLUMN = 8.72
_MIN_HEIGHT = 3.6
# Height over width of the map: a longer or flatter area is drawn with ground around it.
_ASPECTS = (0.4, 1.25)
# Beyond these numbers, labels would be a grey mat: names of threats go, waypoints are numbered in steps.
_MAX_NAMES, _MAX_NUMBERS, _MAX_DOTS = 80, 40, 80


@dataclass(frozen=True, slots=True)
class MapExtent:
    """The rectangle that the map shows, m."""

    east: tuple[float, float]
    north: tuple[float, float]

    @property
    def aspect(self) -> float:
        """Height over width."""
        return (self.north[1] - self.north[0]) / (self.east[1] - self.east[0])


@dataclass(frozen=True, slots=True)
class DrawnTrack:
    """A flown track, and how its line looks, in matplotlib's terms."""

    label: str
    track: Track
    color: str = drawing.FLOWN
    width: float = 1.0
    dashes: Any = "-"


def draw_map(
    scenario: Scenario,
    *,
    plan_waypoints: Floats | None,
    route_waypoints: Floats | None,
    track: Track | None,
    verdict: Verdict | None,
) -> Figure:
    """Top view, north up, equal scales, axes in km from the scenario's origin.

    plan_waypoints: (p, 3) m or None; route_waypoints: (w, 3) m as flown, or None for a plan alone.  The route is
    numbered and carries the verdict's marks; a plan that differs from it by more than 1 m is drawn beside it.
    Missiles are drawn as the sphere's circle (line) and as its cut at the height of the path nearest to it (fill).
    """
    return draw_tracks_on_map(
        scenario,
        f"{'plan' if track is None else 'plan and flight'} from above",
        plan_waypoints=plan_waypoints,
        route_waypoints=route_waypoints,
        tracks=(DrawnTrack("flown track", track),) if track is not None else (),
        winds=(NamedWind(scenario.wind),),
        verdict=verdict,
    )


def draw_tracks_on_map(
    scenario: Scenario,
    subject: str,
    *,
    plan_waypoints: Floats | None,
    route_waypoints: Floats | None,
    tracks: Sequence[DrawnTrack],
    winds: Sequence[NamedWind],
    verdict: Verdict | None,
) -> Figure:
    """As `draw_map`, with any number of tracks and winds.  subject: of the title, after the scenario's name."""
    route = route_waypoints if route_waypoints is not None else plan_waypoints
    with drawing.clean_style():
        extent = _extent(scenario, route, tracks)
        figure, axes, legend_top = _frame(extent, scenario, subject)
        around = draw_ground(figure, axes, scenario.terrain, _RIGHT_COLUMN, _TOP)
        around += _area(axes, scenario)
        around += draw_threat_circles(axes, scenario.threats, route)
        around += draw_zone_shapes(axes, scenario.zones)
        placer = LabelPlacer(axes)
        failed = failures(verdict, len(route) if route is not None else 0)
        handles: list[Any] = []
        if route is not None:
            handles += _paths(axes, route, plan_waypoints, placer)
        for drawn in tracks:
            if len(drawn.track):
                handles += _flown(axes, drawn, placer)
        if route is not None:
            handles += _failing_lines(axes, route, failed, scenario.threats)
        for drawn in tracks if failed.threats else ():
            east, north, _ = drawn.track.position.T
            handles += draw_inside(axes, east, north, inside_threats(failed, scenario.threats, drawn.track))
        handles += _ends(axes, scenario, route, placer)
        if route is not None:
            _number_waypoints(scenario, route, failed, placer)
            centres = {k: (float(east), float(north)) for k, (east, north, _) in enumerate(scenario.threats.position)}
            write_fail_labels(failed, route[:, :2], centres, placer, gap=16.0)
        _name_threats(axes, scenario.threats, failed, placer)
        name_zones(axes, scenario.zones, placer)
        draw_compass(figure, winds, _RIGHT_COLUMN)
        draw_legend(figure, handles + around, _LEFT, legend_top)
    return figure


def _extent(scenario: Scenario, route: Floats | None, tracks: Sequence[DrawnTrack]) -> MapExtent:
    """Area of the scenario, widened to what lies outside it, with a rim, inside the allowed aspects."""
    points = [scenario.bounds.T, scenario.start[None, :2], scenario.destination[None, :2]]
    if route is not None:
        points.append(route[:, :2])
    flown = [drawn.track.position for drawn in tracks]
    points += [position[np.isfinite(position).all(axis=1), :2] for position in flown]
    together = np.vstack(points)
    low, high = together.min(axis=0), together.max(axis=0)
    padding = 0.015 * float((high - low).max())
    low, high = low - padding, high + padding
    width, height = (high - low).tolist()
    grown = np.array([max(width, height / _ASPECTS[1]), max(height, width * _ASPECTS[0])])
    middle = 0.5 * (low + high)
    low, high = middle - 0.5 * grown, middle + 0.5 * grown
    return MapExtent((float(low[0]), float(high[0])), (float(low[1]), float(high[1])))


def _frame(extent: MapExtent, scenario: Scenario, subject: str) -> tuple[Figure, Any, float]:
    """Figure, axes, and the height (inches) under which the legend stands."""
    height = _MAP_WIDTH * extent.aspect
    tall = max(height, _MIN_HEIGHT)
    legend_height = 1.0
    total = _TOP + tall + _BOTTOM + legend_height
    figure = drawing.new_figure(total)
    base = legend_height + _BOTTOM + 0.5 * (tall - height)
    axes = figure.add_axes((_LEFT / drawing.WIDTH, base / total, _MAP_WIDTH / drawing.WIDTH, height / total))
    axes.set(xlim=extent.east, ylim=extent.north, aspect="equal", facecolor="#f4f4f4")
    step = drawing.nice_step(max(np.ptp(extent.east), np.ptp(extent.north)), 14)
    kilometres = FuncFormatter(lambda value, _: f"{value / 1000.0:g}".replace("-", "\N{MINUS SIGN}"))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(step))
        axis.set_major_formatter(kilometres)
    origin = scenario.origin
    place = f"{origin.lat_deg:.4f}°, {origin.lon_deg:.4f}°".replace("-", "\N{MINUS SIGN}")
    axes.set_xlabel(f"east of {place} (km)")
    axes.set_ylabel("north (km)")
    axes.set_title(f"{drawing.shorten(scenario.name, 60)}: {subject}", fontweight="bold")
    return figure, axes, (legend_height - 0.02) / total


def _area(axes: Any, scenario: Scenario) -> list[Any]:
    """Edge of the scenario's area; bounds made around an external mission limit nothing and are not drawn."""
    if scenario.external:
        return []
    look: dict[str, Any] = {"linewidth": 0.9, "linestyle": (0, (8, 3))}
    corner = (float(scenario.bounds[0, 0]), float(scenario.bounds[1, 0]))
    width, height = (float(np.ptp(side)) for side in scenario.bounds)
    axes.add_patch(Rectangle(corner, width, height, fill=False, edgecolor="#555555", zorder=2.5, **look))
    return [Line2D([], [], color="#555555", label="edge of the area", **look)]


def _paths(axes: Any, route: Floats, plan: Floats | None, placer: LabelPlacer) -> list[Any]:
    handles = []
    halo = [patheffects.Stroke(linewidth=4.8, foreground="white", alpha=0.8), patheffects.Normal()]
    differs = plan is not None and paths_differ(plan, route, 1.0)
    if differs and plan is not None:
        line = axes.plot(
            plan[:, 0], plan[:, 1], "-.", color="#555555", linewidth=1.2, zorder=4.9, label="plan as searched"
        )
        handles.append(line[0])
    label = "route of the mission" if plan is None or differs else "planned path"
    line = axes.plot(
        route[:, 0],
        route[:, 1],
        color=drawing.PLANNED,
        linewidth=3.6,
        solid_joinstyle="round",
        zorder=5,
        path_effects=halo,
    )
    line[0].set_label(label)
    placer.avoid(route[:, 0], route[:, 1])
    inner = route[1:-1]
    axes.plot(
        inner[:, 0],
        inner[:, 1],
        "o",
        color="white",
        markeredgecolor=drawing.BLUE,
        markersize=4.2 if len(route) <= _MAX_DOTS else 1.5,
        markeredgewidth=1.0 if len(route) <= _MAX_DOTS else 0.5,
        zorder=7,
    )
    marker = Line2D(
        [],
        [],
        marker="o",
        linestyle="",
        color="white",
        markeredgecolor=drawing.BLUE,
        markersize=4.2,
        label="waypoint, numbered",
    )
    return [line[0], *handles, marker]


def _flown(axes: Any, drawn: DrawnTrack, placer: LabelPlacer) -> list[Any]:
    track = drawn.track
    shown = np.union1d(np.arange(0, len(track), max(1, len(track) // 6000)), [len(track) - 1])
    rows = track.position[shown]
    look: dict[str, Any] = {"color": drawn.color, "linewidth": drawn.width, "linestyle": drawn.dashes}
    line = axes.plot(rows[:, 0], rows[:, 1], zorder=6, label=drawn.label, **look)
    placer.avoid(rows[:, 0], rows[:, 1])
    return [line[0]]


def _failing_lines(axes: Any, route: Floats, failed: Failures, threats: Threats) -> list[Any]:
    """Draw a broad band under each failing leg, a ring about each failing waypoint, a circle about entered threats."""
    for place in failed.threats:
        east, north, _ = threats.position[place.index or 0].tolist()
        radius = radius_of(threats, place)
        axes.add_patch(Circle((east, north), radius, fill=False, edgecolor=drawing.FAIL, linewidth=2.2, zorder=5.5))
    for leg in failed.legs:
        run = np.hypot(*(route[leg + 1, :2] - route[leg, :2]))
        # A leg too short to see shows as a blot.
        short = run < 0.02 * np.ptp(axes.get_xlim())
        axes.plot(
            route[leg : leg + 2, 0],
            route[leg : leg + 2, 1],
            color=drawing.FAIL,
            linewidth=10.0,
            alpha=0.9,
            zorder=4.8,
            solid_capstyle="round" if short else "butt",
        )
    for waypoint in failed.waypoints:
        axes.plot(
            *route[waypoint, :2],
            "o",
            markersize=12,
            markerfacecolor="none",
            markeredgecolor=drawing.FAIL,
            markeredgewidth=2.2,
            zorder=7.5,
        )
    return failing_handles(failed)


def _ends(axes: Any, scenario: Scenario, route: Floats | None, placer: LabelPlacer) -> list[Any]:
    """Start and destination; the route's first and last number stand in their labels where they coincide."""
    handles = []
    for point, row, marker, size, name in (
        (scenario.start, 0, "^", 9.0, "start"),
        (scenario.destination, -1, "*", 13.0, "destination"),
    ):
        look: dict[str, Any] = {
            "markersize": size,
            "markerfacecolor": drawing.MARKER,
            "markeredgecolor": "black",
            "markeredgewidth": 1.0,
        }
        handles += axes.plot(*point[:2], marker, zorder=8, linestyle="", label=name, **look)
        text = f"{row % len(route)} {name}" if route is not None and _same(route[row], point) else name
        placer.place(text, float(point[0]), float(point[1]), size=8.0, gap=12.0, fontweight="bold")
    return handles


def _same(a: Floats, b: Floats) -> bool:
    """Two points lie within 50 m on the ground: one marker stands for both."""
    return float(np.hypot(*(a[:2] - b[:2]))) < 50.0


def _number_waypoints(scenario: Scenario, route: Floats, failed: Failures, placer: LabelPlacer) -> None:
    step = max(1, -(-len(route) // _MAX_NUMBERS))
    last = len(route) - 1
    hidden = {k for k, end in ((0, scenario.start), (last, scenario.destination)) if _same(route[k], end)}
    for number in range(len(route)):
        if number not in hidden and (number % step == 0 or number in failed.waypoints):
            east, north = float(route[number, 0]), float(route[number, 1])
            placer.place(str(number), east, north, size=7.5, gap=8.0, color=drawing.BLUE, fontweight="bold")


def _name_threats(axes: Any, threats: Threats, failed: Failures, placer: LabelPlacer) -> None:
    """Name each threat in the picture, as far as there is room; those that fail have labels of their own."""
    if len(threats) > _MAX_NAMES:
        return
    labelled = failed.threat_names()
    size = 6.0 if len(threats) <= 30 else 5.0
    for k, (name, point) in enumerate(zip(threats.names, threats.position, strict=True)):
        inside = (
            axes.get_xlim()[0] < point[0] < axes.get_xlim()[1] and axes.get_ylim()[0] < point[1] < axes.get_ylim()[1]
        )
        if inside and k not in labelled:
            placer.place(drawing.shorten(name, 20), float(point[0]), float(point[1]), size=size, gap=4.0, optional=True)
