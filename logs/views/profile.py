"""The profile: terrain, plan, flight and threats in the vertical plane along the path."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MultipleLocator
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
    route_distance,
    route_samples,
    track_distance,
    write_fail_labels,
)
from logs.views.map import draw_legend, failing_handles
from logs.views.threats_and_zones import SphereName, draw_entered_cuts, draw_threat_cuts, draw_zone_cuts, zone_handles
from world.scenario import Scenario
from world.threats import Threats

Floats = NDArray[np.float64]

_HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 6.0, 0.78, 0.25, 0.5, 1.45
_GROUND, _BAND = "#cdbf9f", "#E69F00"
_MAX_NUMBERS, _MAX_NAMES, _MAX_DOTS = 40, 24, 80


def draw_profile(
    scenario: Scenario,
    *,
    plan_waypoints: Floats | None,
    route_waypoints: Floats | None,
    track: Track | None,
    verdict: Verdict | None,
) -> Figure:
    """Heights (m AMSL) over the distance along the route (km).

    The route is route_waypoints (w, 3), or plan_waypoints where there is none; without either, the straight line
    from start to destination.  The ground and the spheres' cuts are those under and about the route; flown heights
    stand at the flight's progress along it, which never falls.
    """
    route = route_waypoints if route_waypoints is not None else plan_waypoints
    straight = route is None
    if route is None:
        route = np.vstack([scenario.start, scenario.destination])
    with drawing.clean_style():
        figure = drawing.new_figure(_HEIGHT)
        axes = figure.add_axes(
            (
                _LEFT / drawing.WIDTH,
                _BOTTOM / _HEIGHT,
                1.0 - (_LEFT + _RIGHT) / drawing.WIDTH,
                1.0 - (_TOP + _BOTTOM) / _HEIGHT,
            )
        )
        at = route_distance(route)
        distance, points = route_samples(route, max(float(at[-1]) / 3000.0, 1.0))
        ground = _ground_under(scenario, points)
        _limits(axes, scenario, route, track, ground, float(at[-1]))
        handles = _ground(axes, scenario, distance, ground)
        threat_handles, names = draw_threat_cuts(axes, scenario.threats, distance, points, ground)
        zone_names = draw_zone_cuts(axes, scenario.zones, distance, points, ground)
        threat_handles += zone_handles(scenario.zones)
        lines = [] if straight else _plan(axes, at, route)
        placer = LabelPlacer(axes)
        placer.avoid(at / 1000.0, route[:, 2])
        if track is not None and len(track):
            lines += _flown(axes, route, track, placer)
        failed = failures(verdict, len(route))
        lines += _failing(axes, at, route, failed)
        entered: dict[int, tuple[float, float]] = {}
        if failed.threats:
            places = (distance, points) if track is None else (track_distance(route, track), track.position)
            entered = draw_entered_cuts(axes, scenario.threats, failed, *places, _ground_under(scenario, places[1]))
        if track is not None and failed.threats:
            inside = inside_threats(failed, scenario.threats, track)
            lines += draw_inside(axes, track_distance(route, track) / 1000.0, track.position[:, 2], inside)
        lines += _ceiling(axes, scenario)
        if not straight:
            _numbers(axes, at, route, failed, placer)
        _name_spheres(names, scenario.threats, set(failed.threat_names()), placer)
        for name, middle, amsl in zone_names[:_MAX_NAMES]:
            placer.place(name, middle, amsl, size=6.0, gap=0.0, prefer=(0, 0), optional=True, color=drawing.ZONE)
        write_fail_labels(failed, np.column_stack([at / 1000.0, route[:, 2]]), entered, placer, gap=18.0)
        _label_axes(figure, axes, scenario, straight)
        draw_legend(figure, lines + handles + threat_handles, _LEFT, (_BOTTOM - 0.58) / _HEIGHT)
    return figure


def _ground_under(scenario: Scenario, points: Floats) -> Floats | None:
    """Terrain height (s,) under the points, None where there is none at all."""
    if scenario.terrain is None:
        return None
    heights = scenario.terrain.height(points[:, 0], points[:, 1])
    return heights if np.isfinite(heights).any() else None


def _limits(
    axes: Any, scenario: Scenario, route: Floats, track: Track | None, ground: Floats | None, length: float
) -> None:
    """Show all of ground, plan and flight, and greatest height and ceiling if those do not press them flat."""
    heights = [route[:, 2]]
    if ground is not None:
        heights.append(ground)
    if ground is not None and scenario.limits.max_height_m is not None:
        # As far as it does not press the path flat.
        highest = float(route[:, 2].max()) + scenario.limits.max_height_m
        heights.append(np.minimum(ground + scenario.limits.max_height_m, highest))
    if track is not None:
        heights.append(track.position[:, 2])
    together = np.concatenate(heights)
    together = together[np.isfinite(together)]
    low, high = float(together.min()), float(together.max())
    span = max(high - low, 50.0)
    if high < scenario.ceiling <= high + 1.2 * span:
        high = scenario.ceiling
        span = high - low
    axes.set_ylim(low - 0.12 * span, high + 0.14 * span)
    axes.set_xlim(0.0, max(length, 1.0) / 1000.0)
    axes.xaxis.set_major_locator(MultipleLocator(drawing.nice_step(max(length, 1.0) / 1000.0, 14)))


def _ground(axes: Any, scenario: Scenario, distance: Floats, ground: Floats | None) -> list[Any]:
    """Fill the ground, and the band above it that the path must stay out of."""
    if ground is None:
        return []
    at = distance / 1000.0
    bottom = axes.get_ylim()[0]
    axes.fill_between(at, bottom, ground, color=_GROUND, linewidth=0, zorder=3)
    axes.plot(at, ground, color="#6b5a3a", linewidth=0.9, zorder=3.2)
    handles = [Patch(facecolor=_GROUND, edgecolor="#6b5a3a", label="terrain under the path")]
    required = scenario.limits.min_clearance_m
    if required > 0.0:
        look: dict[str, Any] = {"facecolor": "#f8dfa6", "edgecolor": _BAND, "hatch": "////", "linewidth": 0.0}
        axes.fill_between(at, ground, ground + required, zorder=2.8, **look)
        label = f"required clearance, {required:g} m"
        handles.append(Patch(facecolor="#f8dfa6", edgecolor=_BAND, hatch="////", linewidth=0.0, label=label))
    most = scenario.limits.max_height_m
    if most is not None:
        line = axes.plot(at, ground + most, color=drawing.ZONE, linewidth=1.4, linestyle=(0, (5, 1.5)), zorder=4)
        line[0].set_label(f"greatest height, {most:g} m above ground")
        handles.append(line[0])
    return handles


def _plan(axes: Any, at: Floats, route: Floats) -> list[Any]:
    kilometres = at / 1000.0
    line = axes.plot(kilometres, route[:, 2], color=drawing.PLANNED, linewidth=3.6, zorder=5, label="planned heights")
    look: dict[str, Any] = {
        "color": "white",
        "markeredgecolor": drawing.BLUE,
        "markersize": 4.2 if len(route) <= _MAX_DOTS else 1.5,
    }
    axes.plot(kilometres, route[:, 2], "o", zorder=7, clip_on=False, **look)
    axes.vlines(kilometres, axes.get_ylim()[0], route[:, 2], color="#777777", linewidth=0.4, alpha=0.6, zorder=3.5)
    marker = Line2D([], [], marker="o", linestyle="", label="waypoint, numbered", **look)
    return [line[0], marker]


def _flown(axes: Any, route: Floats, track: Track, placer: LabelPlacer) -> list[Any]:
    heights = track.position[:, 2]
    rows = drawing.outline_rows(heights, 1500)
    progress = track_distance(route, track)[rows] / 1000.0
    line = axes.plot(progress, heights[rows], color=drawing.FLOWN, linewidth=1.1, zorder=6, label="flown heights")
    placer.avoid(progress, heights[rows])
    return [line[0]]


def _failing(axes: Any, at: Floats, route: Floats, failed: Failures) -> list[Any]:
    """Draw a broad band under each failing leg's heights, a strip below the ground, a ring about failing waypoints."""
    kilometres = at / 1000.0
    low, high = axes.get_ylim()
    for leg in failed.legs:
        ends = kilometres[leg : leg + 2]
        axes.plot(
            ends,
            route[leg : leg + 2, 2],
            color=drawing.FAIL,
            linewidth=9.0,
            alpha=0.9,
            zorder=4.8,
            solid_capstyle="butt",
        )
        axes.fill_between(ends, low, low + 0.025 * (high - low), color=drawing.FAIL, linewidth=0, zorder=8)
    for waypoint in failed.waypoints:
        axes.plot(
            kilometres[waypoint],
            route[waypoint, 2],
            "o",
            markersize=12,
            mfc="none",
            mec=drawing.FAIL,
            mew=2.2,
            zorder=7.5,
            clip_on=False,
        )
    return failing_handles(failed)


def _ceiling(axes: Any, scenario: Scenario) -> list[Any]:
    """Ceiling and floor as lines, or as text in the legend where they lie outside the picture."""
    handles: list[Any] = []
    if scenario.external:
        return handles
    low, high = axes.get_ylim()
    look: dict[str, Any] = {"color": "#444444", "linewidth": 1.2, "linestyle": (0, (6, 2, 1, 2))}
    if low < scenario.ceiling < high:
        axes.axhline(scenario.ceiling, zorder=4, **look)
        handles.append(Line2D([], [], label=f"ceiling, {scenario.ceiling:.0f} m AMSL", **look))
    else:
        handles.append(Line2D([], [], linestyle="", label=f"ceiling {scenario.ceiling:.0f} m AMSL, off the picture"))
    if low < scenario.floor < high:
        axes.axhline(scenario.floor, zorder=4, **{**look, "linestyle": (0, (2, 2))})
        handles.append(
            Line2D([], [], label=f"floor, {scenario.floor:.0f} m AMSL", **{**look, "linestyle": (0, (2, 2))})
        )
    return handles


def _numbers(axes: Any, at: Floats, route: Floats, failed: Failures, placer: LabelPlacer) -> None:
    step = max(1, -(-len(route) // _MAX_NUMBERS))
    for number in range(len(route)):
        if number % step == 0 or number in failed.waypoints or number == len(route) - 1:
            point = (float(at[number]) / 1000.0, float(route[number, 2]))
            placer.place(str(number), *point, size=7.5, gap=8.0, color=drawing.BLUE, fontweight="bold")


def _name_spheres(names: list[SphereName], threats: Threats, labelled: set[int], placer: LabelPlacer) -> None:
    """Write each sphere's name at its outline, in its colour; those that fail have labels of their own."""
    for name in names[:_MAX_NAMES]:
        if name.index not in labelled:
            text = drawing.shorten(threats.names[name.index], 20)
            placer.place(text, *name.at, size=6.5, gap=3.0, prefer=name.prefer, optional=True, color=name.colour)


def _label_axes(figure: Figure, axes: Any, scenario: Scenario, straight: bool) -> None:
    frame = axes.get_window_extent()
    across = np.ptp(axes.get_xlim()) * 1000.0 / frame.width
    stretch = across / (np.ptp(axes.get_ylim()) / frame.height)
    path = "the straight line from start to destination" if straight else "the planned path"
    axes.set_xlabel(f"distance along {path} (km); heights are drawn {stretch:.2g} times larger than distances")
    axes.set_ylabel("height (m AMSL)")
    title = f"{drawing.shorten(scenario.name, 60)}: heights along the path"
    axes.set_title(title if scenario.terrain is not None else f"{title} (no terrain was given)", fontweight="bold")
    axes.grid(axis="y", color="#dddddd", linewidth=0.5, zorder=0)
