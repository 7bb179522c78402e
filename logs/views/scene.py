"""Build the 3-D scene as JSON data for the page: ground, threats, zones and plan."""

import base64
import json
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.views.failures import Failures, stop_start_indices
from world.airspace.zones_on_map import zone_walls
from world.arrays import Floats
from world.terrain import Terrain

# Largest number of vertices along a side of the ground, so that indices of the mesh stay below 65,536.
MAX_GROUND = 250
# 16-bit value of an unknown height.
MISSING = 65535


@dataclass(frozen=True, slots=True)
class SceneView:
    """Data for the 3-D picture and for the 3-D view of the page.

    setup: setup whose scenario includes the zones of the mission's fence.
    track: flown track; None for a plan that was not flown.
    failed: places at which rules failed.
    """

    setup: FlightSetup
    track: Track | None
    failed: Failures


@dataclass(frozen=True, slots=True)
class GroundGrid:
    """Altitudes of the ground on a grid.

    east, north: coordinates of the columns and of the rows, m, (e,) and (n,).
    heights: altitude at each grid point, m AMSL, (n, e); NaN where unknown.
    """

    east: Floats
    north: Floats
    heights: Floats


def scene_bounds(setup: FlightSetup, track: Track | None) -> Floats:
    """Return the horizontal range that contains the scenario's area, the route and the flight, m, (2, 2).

    The rows are east and north, the columns minimum and maximum.
    """
    points = [setup.scenario.bounds.T, setup.route.positions[:, :2]]
    if track is not None:
        points.append(track.position[np.isfinite(track.position).all(axis=1), :2])
    all_points = np.vstack(points)
    return np.stack([all_points.min(axis=0), all_points.max(axis=0)], axis=1)


def ground_grid(terrain: Terrain | None, bounds: Floats, max_samples: int) -> GroundGrid | None:
    """Sample the altitude of the ground on a grid of nearly square cells.

    Return None without terrain, or if no altitude is known.

    bounds: range of the grid, m, (2, 2), as returned by `scene_bounds`.
    max_samples: largest number of samples along a side; fewer if the terrain data is coarser.
    """
    if terrain is None:
        return None
    spans = np.ptp(bounds, axis=1)
    spacing = max(float(spans.max()) / (max_samples - 1), terrain.spacing, 1.0)
    axes = [
        np.linspace(float(start), float(end), int(np.clip(np.ceil((end - start) / spacing) + 1, 2, max_samples)))
        for start, end in bounds
    ]
    heights = np.asarray(terrain.height(axes[0][None, :], axes[1][:, None]), dtype=np.float64)
    return GroundGrid(axes[0], axes[1], heights) if np.isfinite(heights).any() else None


def exaggeration(setup: FlightSetup, bounds: Floats, grid: GroundGrid | None) -> float:
    """Return the factor by which heights are exaggerated so that they are visible: 1, 1.5, 2 or 3.

    bounds: range of the scene, m, (2, 2), as returned by `scene_bounds`.
    grid: ground of the scene; None without terrain.
    """
    altitudes = setup.route.positions[:, 2]
    min_altitude, max_altitude = float(altitudes.min()), float(altitudes.max())
    if grid is not None:
        min_altitude = min(min_altitude, float(np.nanmin(grid.heights)))
        max_altitude = max(max_altitude, float(np.nanmax(grid.heights)))
    requested_factor = 0.09 * float(np.ptp(bounds, axis=1).max()) / max(max_altitude - min_altitude, 50.0)
    return max(factor for factor in (1.0, 1.5, 2.0, 3.0) if factor <= max(requested_factor, 1.0))


def select_drawn_rows(track: Track, max_rows: int) -> NDArray[np.intp]:
    """Select at most `max_rows` rows of a track that have a position, evenly, with first and last row.

    Return the indices of the rows.
    """
    finite_rows = np.flatnonzero(np.isfinite(track.position).all(axis=1))
    return finite_rows[
        np.unique(np.linspace(0, max(len(finite_rows) - 1, 0), min(len(finite_rows), max_rows)).astype(np.intp))
    ]


def script_json(data: object) -> str:
    """Encode data as JSON text that is safe within an HTML script element.

    "<", ">" and "&" are escaped, because "</script>" in a name would end the element early.

    >>> "<" in script_json({"name": "</script>"}), json.loads(script_json({"name": "</script>"}))
    (False, {'name': '</script>'})
    """
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def scene_data(view: SceneView) -> dict[str, object]:
    """Convert a scene to JSON data for the page, lengths in m.

    The flight is not included; it only extends the range of the scene.  "numbers" lists the index and the number of
    each numbered waypoint.  The heights of the ground are 16-bit fractions of their range, little-endian, in base64.
    """
    setup, failed = view.setup, view.failed
    bounds = scene_bounds(setup, view.track)
    grid = ground_grid(setup.scenario.terrain, bounds, MAX_GROUND)
    threats, stops = setup.scenario.threats, setup.route.stops.tolist()
    ground: dict[str, object] | None = None
    if grid is not None:
        min_height, max_height = float(np.nanmin(grid.heights)), float(np.nanmax(grid.heights))
        fraction = (grid.heights - min_height) / max(max_height - min_height, 1e-6)
        codes = np.where(np.isfinite(fraction), np.round(fraction * (MISSING - 1)), MISSING).astype("<u2")
        ground = {
            "columns": len(grid.east),
            "rows": len(grid.north),
            "low": min_height,
            "high": max_height,
            "heights": base64.b64encode(codes.tobytes()).decode("ascii"),
        }
    # Rings with floor and ceiling at each corner.
    altitudes = setup.route.positions[:, 2]
    min_altitude, max_altitude = float(altitudes.min()), float(altitudes.max()) + 50.0
    zones = [
        {
            "name": zone.name,
            "keep_out": zone.kind == "exclusion",
            "rings": [
                np.round(ring, 1).tolist()
                for ring in zone_walls(zone, setup.scenario.terrain, min_altitude, max_altitude)
            ],
        }
        for zone in setup.scenario.zones
    ]
    return {
        "name": setup.scenario.name,
        "bounds": np.round(bounds, 1).tolist(),
        "stretch": exaggeration(setup, bounds, grid),
        "ground": ground,
        "threats": [
            {
                "name": name,
                "at": np.round(threats.position[k], 1).tolist(),
                "kill": round(float(threats.kill_radius[k]), 1),
                "detection": round(float(threats.detection_radius[k]), 1),
            }
            for k, name in enumerate(threats.names)
        ],
        **({"zones": zones} if zones else {}),
        "plan": np.round(setup.display_waypoints, 1).tolist(),
        "numbers": [[k, stops[k]] for k in stop_start_indices(stops)],
        "failing": {"legs": list(failed.legs), "waypoints": list(failed.waypoints)},
    }
