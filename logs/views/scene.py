"""Build the data of the 3-D scene: ground, threats, zones and plan, as JSON data for the page."""

import base64
import json
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.views.failures import Failures
from world.airspace.zones_on_map import zone_walls
from world.arrays import Floats
from world.terrain import Terrain

# Largest number of vertices along a side of the ground: indices of the mesh stay below 65,536.
MAX_GROUND = 250
# Value of an unknown height.
MISSING = 65535


@dataclass(frozen=True, slots=True)
class SceneView:
    """Data of the 3-D picture and the 3-D view of the page.

    setup: setup with the mission's fence among the zones.  track: None for a plan that was not flown.
    """

    setup: FlightSetup
    track: Track | None
    failed: Failures


@dataclass(frozen=True, slots=True)
class GroundGrid:
    """Heights (n, e) m AMSL at the crossings of ``north`` (n,) and ``east`` (e,) m; NaN where unknown."""

    east: Floats
    north: Floats
    heights: Floats


def scene_bounds(setup: FlightSetup, track: Track | None) -> Floats:
    """Return the east and north range (2, 2) m of area, route and flight."""
    points = [setup.scenario.bounds.T, setup.route.waypoints[:, :2]]
    if track is not None:
        points.append(track.position[np.isfinite(track.position).all(axis=1), :2])
    together = np.vstack(points)
    return np.stack([together.min(axis=0), together.max(axis=0)], axis=1)


def ground_grid(terrain: Terrain | None, bounds: Floats, most: int) -> GroundGrid | None:
    """Sample the ground at up to ``most`` crossings a side, with nearly square cells; None without ground."""
    if terrain is None:
        return None
    spans = np.ptp(bounds, axis=1)
    pitch = max(float(spans.max()) / (most - 1), terrain.spacing, 1.0)
    axes = [
        np.linspace(float(low), float(high), int(np.clip(np.ceil((high - low) / pitch) + 1, 2, most)))
        for low, high in bounds
    ]
    heights = np.asarray(terrain.height(axes[0][None, :], axes[1][:, None]), dtype=np.float64)
    return GroundGrid(axes[0], axes[1], heights) if np.isfinite(heights).any() else None


def exaggeration(setup: FlightSetup, bounds: Floats, grid: GroundGrid | None) -> float:
    """Return the factor by which heights are stretched to be visible: 1, 1.5, 2 or 3."""
    up = setup.route.waypoints[:, 2]
    low, high = float(up.min()), float(up.max())
    if grid is not None:
        low, high = min(low, float(np.nanmin(grid.heights))), max(high, float(np.nanmax(grid.heights)))
    wanted = 0.09 * float(np.ptp(bounds, axis=1).max()) / max(high - low, 50.0)
    return max(value for value in (1.0, 1.5, 2.0, 3.0) if value <= max(wanted, 1.0))


def drawn_rows(track: Track, max_rows: int) -> NDArray[np.intp]:
    """Return at most ``max_rows`` rows of the track with a known position, including the first and last."""
    is_finite = np.flatnonzero(np.isfinite(track.position).all(axis=1))
    return is_finite[
        np.unique(np.linspace(0, max(len(is_finite) - 1, 0), min(len(is_finite), max_rows)).astype(np.intp))
    ]


def script_json(data: object) -> str:
    """Return JSON for an HTML script element, with "<" escaped: in a name it could end the element early.

    >>> "<" in script_json({"name": "</script>"}), json.loads(script_json({"name": "</script>"}))
    (False, {'name': '</script>'})
    """
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def scene_data(view: SceneView) -> dict[str, object]:
    """Return the scene as JSON data; the flight only determines the extent of the scene.

    Lengths are in m; heights of the ground are 16-bit fractions of their range, little-endian, in base64.
    """
    setup, failed = view.setup, view.failed
    bounds = scene_bounds(setup, view.track)
    grid = ground_grid(setup.scenario.terrain, bounds, MAX_GROUND)
    threats = setup.scenario.threats
    return {
        "name": setup.scenario.name,
        "bounds": np.round(bounds, 1).tolist(),
        "stretch": exaggeration(setup, bounds, grid),
        "ground": None if grid is None else _ground_data(grid),
        "threats": [
            {
                "name": name,
                "at": np.round(threats.position[k], 1).tolist(),
                "kill": round(float(threats.kill_radius[k]), 1),
                "detection": round(float(threats.detection_radius[k]), 1),
            }
            for k, name in enumerate(threats.names)
        ],
        **_zone_walls(setup),
        "plan": np.round(setup.shown_waypoints, 1).tolist(),
        "failing": {"legs": list(failed.legs), "waypoints": list(failed.waypoints)},
    }


def _zone_walls(setup: FlightSetup) -> dict[str, object]:
    """Return names, kinds and rings of zones, with lower and upper end of each corner.

    The result is empty without zones.
    """
    zones, up = setup.scenario.zones, setup.route.waypoints[:, 2]
    if not zones:
        return {}
    walls = [zone_walls(zone, setup.scenario.terrain, float(up.min()), float(up.max()) + 50.0) for zone in zones]
    return {
        "zones": [
            {"name": zone.name, "keep_out": zone.kind == "exclusion", "rings": [np.round(w, 1).tolist() for w in rings]}
            for zone, rings in zip(zones, walls, strict=True)
        ]
    }


def _ground_data(grid: GroundGrid) -> dict[str, object]:
    low, high = float(np.nanmin(grid.heights)), float(np.nanmax(grid.heights))
    share = (grid.heights - low) / max(high - low, 1e-6)
    steps = np.where(np.isfinite(share), np.round(share * (MISSING - 1)), MISSING).astype("<u2")
    return {
        "columns": len(grid.east),
        "rows": len(grid.north),
        "low": low,
        "high": high,
        "heights": base64.b64encode(steps.tobytes()).decode("ascii"),
    }
