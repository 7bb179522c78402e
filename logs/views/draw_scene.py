"""Draw the 3-D picture for paper and pages without scripts: ground, threats, plan and flight."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from flight.mission.itinerary import NO_ITEM
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs import theme
from logs.views.charts import Label, LabelRank, Layer, LayerKind, LegendEntry, shorten
from logs.views.drawing import WIDTH, clean_style, draw_legend, make_legend_handle, new_figure, write_label
from logs.views.failures import Failures, route_distance, route_samples, stop_start_indices
from logs.views.labels import LabelPlacer
from logs.views.scene import GroundGrid, SceneView, exaggeration, ground_grid, scene_bounds, select_drawn_rows
from world.airspace.zones_on_map import zone_walls
from world.arrays import Floats
from world.terrain import Terrain

# Margin left of the picture, inches.
_LEFT = 0.15
# Margin right of the picture, inches.
_RIGHT = 0.15
# Margin above the picture, inches.
_TOP = 0.5
# Margin below the picture, inches.
_BOTTOM = 0.8
# Elevation of the view, rad.
_ELEVATION = math.radians(36.0)
# Largest number of ground samples along a side.
_MAX_CELLS = 130
# Largest number of drawn points of the track.
_MAX_TRACK = 1600
# Smallest ratio of the shorter to the longer side of the drawn ground.
_MIN_SIDE_RATIO = 0.3
# Angle by which the viewer moves towards the end of a narrower scene, rad.
_NARROW_SCENE_AZIMUTH_RAD = math.radians(45.0)
# With more waypoints than this, only every n-th waypoint is numbered.
_MAX_NUMBERS = 40
# Largest number of threats with a name in the picture.
_MAX_NAMES = 30


@dataclass(frozen=True, slots=True)
class Projection:
    """Parallel projection of positions to the picture; the viewer looks down at the angle `_ELEVATION`.

    azimuth: direction from the center to the viewer, rad, counter-clockwise from east.
    center: position shown at the center of the picture, m, (3,).
    stretch: factor by which heights are exaggerated.
    """

    azimuth: float
    center: Floats
    stretch: float

    def project(self, points: Floats) -> Floats:
        """Project points (..., 3), m, into the picture.

        Return right, up and depth towards the viewer, m, (..., 3).
        """
        east, north, up = np.moveaxis(points - self.center, -1, 0)
        cos_azimuth, sin_azimuth = math.cos(self.azimuth), math.sin(self.azimuth)
        across = -sin_azimuth * east + cos_azimuth * north
        toward = cos_azimuth * east + sin_azimuth * north
        height = self.stretch * up
        sin_elevation, cos_elevation = math.sin(_ELEVATION), math.cos(_ELEVATION)
        return np.stack(
            [across, cos_elevation * height - sin_elevation * toward, sin_elevation * height + cos_elevation * toward],
            axis=-1,
        )

    @property
    def toward(self) -> Floats:
        """Vector towards the viewer, the same at every position: east, north and up, (3,), m.

        Its horizontal length is 1 m.
        """
        return np.array([math.cos(self.azimuth), math.sin(self.azimuth), math.tan(_ELEVATION) / self.stretch])


def draw_scene(view: SceneView) -> Figure:
    """Draw the 3-D scene of a flight, viewed at right angles to the line from start to destination.

    The title states the factor by which heights are exaggerated.  Lines are dashed and thin behind a ridge.  A long and
    narrow scene is widened and viewed obliquely from its end, so that it does not appear as a strip.
    """
    setup, track, failed = view.setup, view.track, view.failed
    scene_limits = scene_bounds(setup, track)
    # A narrow scene is widened to the smallest allowed ratio of the sides.
    sides = np.ptp(scene_limits, axis=1)
    widening = 0.5 * np.maximum(_MIN_SIDE_RATIO * sides.max() - sides, 0.0)
    bounds = np.asarray(scene_limits + np.stack([-widening, widening], axis=1))
    is_narrow = not np.array_equal(bounds, scene_limits)
    terrain = setup.scenario.terrain
    grid = ground_grid(terrain, bounds, _MAX_CELLS)
    route = setup.display_waypoints
    # Look across the route from its south side, about the middle of the bounds.
    step = route[-1] - route[0]
    azimuth = math.atan2(step[1], step[0]) - math.pi / 2.0
    if math.sin(azimuth) > 0.0:
        azimuth += math.pi
    azimuth += _NARROW_SCENE_AZIMUTH_RAD if is_narrow else 0.0
    projection = Projection(
        azimuth, np.array([*bounds.mean(axis=1), float(route[:, 2].mean())]), exaggeration(setup, bounds, grid)
    )
    with clean_style():
        figure, axes = _make_axes(setup, projection, bounds, grid)
        handles = _draw_ground(axes, projection, grid, bounds)
        handles += _draw_threats(axes, projection, setup, failed)
        handles += _draw_zones(axes, projection, setup)
        placer = LabelPlacer(axes)
        handles += _draw_paths(axes, projection, terrain, route, track, failed, placer)
        _draw_labels(setup, projection, route, failed, placer)
        name = shorten(setup.scenario.name, 60)
        scale_text = "true to scale" if projection.stretch == 1.0 else f"heights × {projection.stretch:g}"
        # Side from which the viewer looks; the azimuth is counter-clockwise from east.
        names = ("east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east")
        viewer_side = names[round(projection.azimuth / (math.pi / 4.0)) % 8]
        axes.set_title(f"{name}: seen from the {viewer_side}, {scale_text}", fontweight="bold")
        draw_legend(figure, handles, _LEFT + 0.1, (_BOTTOM - 0.08) / float(figure.get_figheight()))
    return figure


def _make_axes(
    setup: FlightSetup, projection: Projection, bounds: Floats, grid: GroundGrid | None
) -> tuple[Figure, Any]:
    """Make a figure whose axes have equal scales and contain route, threats and ground.

    bounds: range of the scene, (2, 2), m: rows east and north, columns minimum and maximum.
    grid: heights of the ground; None without terrain.
    """
    min_altitude = float(np.nanmin(grid.heights)) if grid is not None else float(setup.route.positions[:, 2].min())
    corners = np.array([[east, north, min_altitude] for east in bounds[0] for north in bounds[1]])
    threats = setup.scenario.threats
    sphere_tops = threats.position + np.maximum(threats.kill_radius, threats.detection_radius)[:, None] * np.array(
        [0, 0, 1.0]
    )
    projected_parts = [
        projection.project(corners),
        projection.project(setup.route.positions),
        projection.project(sphere_tops),
    ]
    if grid is not None:
        east, north = np.meshgrid(grid.east, grid.north)
        surface = projection.project(np.stack([east, north, grid.heights], axis=-1)).reshape(-1, 3)
        projected_parts.append(surface[np.isfinite(surface).all(axis=1)])
    projected_points = np.vstack(projected_parts)[:, :2]
    min_corner, max_corner = projected_points.min(axis=0), projected_points.max(axis=0)
    padding = 0.03 * float((max_corner - min_corner).max())
    min_corner, max_corner = min_corner - padding, max_corner + padding
    figure_width = WIDTH - _LEFT - _RIGHT
    # Add space above and below a flat scene.
    missing_height = max(0.0, 3.0 / figure_width * (max_corner[0] - min_corner[0]) - (max_corner[1] - min_corner[1]))
    min_corner[1], max_corner[1] = min_corner[1] - 0.5 * missing_height, max_corner[1] + 0.5 * missing_height
    figure_height = float(
        np.clip(figure_width * (max_corner[1] - min_corner[1]) / (max_corner[0] - min_corner[0]), 3.0, 8.0)
    )
    total_height = figure_height + _TOP + _BOTTOM
    figure = new_figure(total_height)
    axes = figure.add_axes((_LEFT / WIDTH, _BOTTOM / total_height, figure_width / WIDTH, figure_height / total_height))
    axes.set(xlim=(min_corner[0], max_corner[0]), ylim=(min_corner[1], max_corner[1]), facecolor=theme.colour("sky"))
    axes.set_aspect("equal", adjustable="box")
    axes.set(xticks=[], yticks=[])
    for spine in axes.spines.values():
        spine.set_color(theme.colour("rule"))
    return figure, axes


def _draw_ground(axes: Any, projection: Projection, grid: GroundGrid | None, bounds: Floats) -> list[Any]:
    """Draw the cells of the ground from the farthest to the nearest, shaded by light from the north-west.

    Without terrain, draw a level plane at mid height.  Return the legend handle of the plane, [] with terrain.
    """
    if grid is None:
        level_altitude = float(projection.center[2])
        corners = np.array(
            [
                [east, north, level_altitude]
                for east, north in zip(bounds[0][[0, 1, 1, 0]], bounds[1][[0, 0, 1, 1]], strict=True)
            ]
        )
        axes.add_collection(
            PolyCollection(
                [projection.project(corners)[:, :2]],
                facecolor=theme.colour("unknown"),
                edgecolor=theme.colour("rim"),
                zorder=1,
            )
        )
        return [_make_legend_handle("band", "level-ground", "no terrain: level at mid height")]
    east, north = np.meshgrid(grid.east, grid.north)
    corners = projection.project(np.stack([east, north, grid.heights], axis=-1))
    cells = np.stack([corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]], axis=2).reshape(-1, 4, 3)
    up_north, up_east = np.gradient(
        np.nan_to_num(grid.heights, nan=float(np.nanmin(grid.heights))), grid.north, grid.east
    )
    # The cosine between the ground's normal and the direction to the light, (-0.5, 0.5, 0.8) of length sqrt(1.14).
    slope_e, slope_n = projection.stretch * up_east, projection.stretch * up_north
    brightness = (0.5 * slope_e - 0.5 * slope_n + 0.8) / np.sqrt(1.14 * (1.0 + slope_e**2 + slope_n**2))
    min_height, max_height = float(np.nanmin(grid.heights)), float(np.nanmax(grid.heights))
    colours = LinearSegmentedColormap.from_list("ground", theme.GROUND)(
        (grid.heights - min_height) / max(max_height - min_height, 1.0)
    )
    colours[..., :3] *= np.clip(0.55 + 0.5 * brightness, 0.35, 1.0)[..., None]
    cell_colours = 0.25 * (colours[:-1, :-1] + colours[:-1, 1:] + colours[1:, 1:] + colours[1:, :-1]).reshape(-1, 4)
    is_known = np.isfinite(cells).all(axis=(1, 2))
    draw_order = np.flatnonzero(is_known)[np.argsort(cells[is_known][:, :, 2].mean(axis=1), kind="stable")]
    # Draw edges in the colour of the cells, to close the seams left by antialiasing.
    axes.add_collection(
        PolyCollection(
            list(cells[draw_order][:, :, :2]),
            facecolor=cell_colours[draw_order],
            edgecolor=cell_colours[draw_order],
            linewidth=0.4,
            zorder=1,
            rasterized=True,
        )
    )
    return []


def _draw_threats(axes: Any, projection: Projection, setup: FlightSetup, failed: Failures) -> list[Any]:
    """Draw the reach of missiles and radars as domes (upper halves of spheres); return the legend handles.

    Domes of threats that fail a rule have a broad outline.
    """
    threats = setup.scenario.threats
    handles: list[Any] = []
    # Stretched dome of radius 1: far half of its outline, and near half of its base.
    top_height = math.hypot(math.sin(_ELEVATION), projection.stretch * math.cos(_ELEVATION))
    angles = np.linspace(0.0, 2.0 * math.pi, 97)
    vertical = np.where(angles < math.pi, top_height, math.sin(_ELEVATION)) * np.sin(angles)
    shape = np.column_stack([np.cos(angles), vertical])
    threat_styles: tuple[tuple[str, Floats, dict[str, Any]], ...] = (
        ("missile", threats.kill_radius, {"facecolor": theme.rgba("missile", theme.ROLE_STYLES["missile"].fill)}),
        ("radar", threats.detection_radius, {"facecolor": "none", "linestyle": (0, (4, 2.5))}),
    )
    for kind, radii, style in threat_styles:
        style |= {"edgecolor": theme.colour(kind)}
        indices = np.flatnonzero(radii > 0.0)
        for k in indices:
            dome = projection.project(threats.position[k])[:2] + float(radii[k]) * shape
            axes.add_patch(Polygon(dome, linewidth=0.9, zorder=3, **style))
        for entered_index in (place.index or 0 for place in failed.threats if place.kind == kind):
            dome = projection.project(threats.position[entered_index])[:2] + float(radii[entered_index]) * shape
            axes.add_patch(Polygon(dome, fill=False, edgecolor=theme.colour("fail"), linewidth=2.2, zorder=4.6))
        if indices.size:
            handles.append(_make_legend_handle("band", kind, f"{kind}'s reach"))
    return handles


def _draw_zones(axes: Any, projection: Projection, setup: FlightSetup) -> list[Any]:
    """Draw the walls of the zones, and return their legend handles.

    A wall reaches from the zone's floor, or else the ground, to the zone's ceiling, or else 50 m above the highest
    waypoint.
    """
    zones, route = setup.scenario.zones, setup.route.positions
    min_altitude, max_altitude = float(route[:, 2].min()), float(route[:, 2].max()) + 50.0
    for zone in zones:
        fill = theme.rgba("zone", 0.10 if zone.kind == "exclusion" else 0.03)
        for wall in zone_walls(zone, setup.scenario.terrain, min_altitude, max_altitude):
            projected_wall = projection.project(wall)[:, :, :2]
            sides = np.concatenate([projected_wall[:-1], projected_wall[1:, ::-1]], axis=1)
            axes.add_collection(PolyCollection(list(sides), facecolor=fill, edgecolor="none", zorder=3.2))
            width = 1.1 if zone.kind == "exclusion" else 2.0
            for edge in (0, 1):
                axes.plot(
                    *projected_wall[:, edge].T,
                    color=theme.colour("zone"),
                    linewidth=width,
                    alpha=0.4 + 0.6 * edge,
                    zorder=3.3,
                )
    kinds = {zone.kind for zone in zones}
    handles = [_make_legend_handle("area", "zone", "zone to keep out of")] if "exclusion" in kinds else []
    return handles + (
        [_make_legend_handle("line", "stay-in", "edge of a zone to stay in")] if "inclusion" in kinds else []
    )


def _make_legend_handle(kind: LayerKind, role: str, text: str) -> Any:
    """Return a legend handle for a layer of this kind and role, with a text."""
    empty = np.zeros(0)
    return make_legend_handle(LegendEntry(text, (Layer(kind, text, role, empty, empty),)))


def _draw_paths(
    axes: Any,
    projection: Projection,
    terrain: Terrain | None,
    route: Floats,
    track: Track | None,
    failed: Failures,
    placer: LabelPlacer,
) -> list[Any]:
    """Draw route, waypoints on poles, track and failures, and keep labels away from the route.

    Return the legend handles.

    route: waypoints, m, (w, 3).
    track: flown track; None to draw only the plan.
    placer: places the labels of the picture.
    """
    _, samples = route_samples(route, max(float(route_distance(route)[-1]) / 600.0, 1.0))
    if terrain is not None:
        ground = terrain.height(route[:, 0], route[:, 1])
        feet = np.column_stack([route[:, :2], np.where(np.isfinite(ground), ground, route[:, 2])])
        poles = np.stack([projection.project(route)[:, :2], projection.project(feet)[:, :2]], axis=1)
        axes.add_collection(LineCollection(list(poles), colors=theme.colour("pole"), linewidths=0.7, zorder=4))
    for leg in failed.legs:
        leg_points = projection.project(route[leg : leg + 2])
        axes.plot(
            leg_points[:, 0],
            leg_points[:, 1],
            color=theme.colour("fail"),
            linewidth=9.0,
            alpha=0.9,
            zorder=4.5,
            solid_capstyle="butt",
        )
    _draw_path(axes, projection, terrain, samples, theme.colour("planned"), 3.6, 5)
    handles: list[Any] = [_make_legend_handle("line", "planned", "planned path")]
    if track is not None:
        flown_positions = track.position[select_drawn_rows(track, _MAX_TRACK)]
        _draw_path(axes, projection, terrain, flown_positions, theme.colour("flown"), 1.2, 6)
        handles.append(_make_legend_handle("line", "flown", "flown track"))
    corners = projection.project(route)
    placer.avoid(*projection.project(samples)[:, :2].T)
    axes.plot(
        corners[:, 0],
        corners[:, 1],
        "o",
        color=theme.colour("paper"),
        markeredgecolor=theme.colour("second"),
        markersize=3.8,
        zorder=7,
    )
    for waypoint in failed.waypoints:
        axes.plot(*corners[waypoint, :2], "o", markersize=12, mfc="none", mec=theme.colour("fail"), mew=2.2, zorder=7.5)
    if terrain is not None:
        handles.append(_make_legend_handle("line", "pole", "waypoint above the ground"))
    failure_entries: tuple[tuple[object, LayerKind, str, str], ...] = (
        (failed.legs, "line", "failing-leg", "leg that fails a rule"),
        (failed.waypoints, "rings", "fail", "waypoint that fails a rule"),
        (failed.threats, "line", "fail", "threat that is entered"),
    )
    return handles + [
        _make_legend_handle(kind, role, text)
        for failing_elements, kind, role, text in failure_entries
        if failing_elements
    ]


def _draw_path(
    axes: Any, projection: Projection, terrain: Terrain | None, points: Floats, colour: str, width: float, order: float
) -> None:
    """Draw a path, thin and dashed where the ground hides it.

    points: positions on the path, m, (n, 3).
    width: line width, typographic points.
    order: matplotlib's zorder.
    """
    projected = projection.project(points)
    # Points that the ground hides from the viewer.
    is_hidden = np.zeros(len(points), dtype=bool)
    if terrain is not None:
        for distance in np.geomspace(2.0 * terrain.spacing, 15_000.0, 70):
            sight_points = points + distance * projection.toward
            is_hidden |= terrain.height(sight_points[:, 0], sight_points[:, 1]) > sight_points[:, 2]
    visible_part = np.where(is_hidden[:, None], np.nan, projected[:, :2])
    # Include the neighbours of hidden rows, so that the two parts meet.
    is_near_hidden = is_hidden | np.roll(is_hidden, 1) | np.roll(is_hidden, -1)
    hidden_part = np.where(is_near_hidden[:, None], projected[:, :2], np.nan)
    axes.plot(*visible_part.T, color=colour, linewidth=width, zorder=order, solid_capstyle="round")
    axes.plot(*hidden_part.T, color=colour, linewidth=0.5 * width, alpha=0.6, linestyle=(0, (2, 1.5)), zorder=order)


def _draw_labels(
    setup: FlightSetup, projection: Projection, route: Floats, failed: Failures, placer: LabelPlacer
) -> None:
    """Label start, destination, waypoints and threats; names of threats without a free place are left out.

    If there are more than `_MAX_NUMBERS` waypoints, only every n-th and the failed ones are numbered.  Threats that
    fail a rule are labelled before the other threats.
    """
    corners, items = projection.project(route), setup.route.items.tolist()
    last = len(route) - 1

    def write(text: str, point: Floats, rank: LabelRank, role: str = "ink") -> None:
        """Write a label at a point in the picture, as returned by `Projection.project`."""
        write_label(placer, Label(text, float(point[0]), float(point[1]), rank, role))

    # The same words as on the map.
    for k, name in ((0, "start"), (last, "destination")):
        write(name if items[k] == NO_ITEM else f"{items[k]} {name}", corners[k], "end")
    stop_starts = stop_start_indices(setup.route.stops.tolist())
    step = max(1, -(-len(stop_starts) // _MAX_NUMBERS))
    numbered_waypoints = {k for n, k in enumerate(stop_starts) if n % step == 0} | set(failed.waypoints)
    for k in sorted(k for k in numbered_waypoints - {0, last} if items[k] != NO_ITEM):
        write(str(items[k]), corners[k], "number", "fail" if k in failed.waypoints else "waypoint")
    threats = setup.scenario.threats
    failing_threats = failed.threat_names()
    labels = list(zip(threats.names, projection.project(threats.position), strict=True))
    # Label failing threats first: they get the best places.
    for k in sorted(range(min(len(labels), _MAX_NAMES)), key=lambda k: k not in failing_threats):
        name, point = labels[k]
        write(
            shorten(name, 20),
            point,
            "number" if k in failing_threats else "name",
            "fail" if k in failing_threats else "ink",
        )
