"""Random scenarios among zones in a band of heights over the Jacksboro tile, and a grid search that knows no planner.

Each comes from its number alone.  Draws that the grid search cannot pass are skipped: it says where a plan must be
found.  Seed and margins were fixed before any planner ran on them.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planfly.airframe import load_airframe
from world.scenario import Scenario, from_spec

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

SEED = 2026
# Half the area's sides, m, and the band of heights above ground, m.
HALF, LOWEST, HIGHEST = 13_000.0, 100.0, 200.0
# Between start and destination, m, and of path an interval between waypoints, m.
SHORTEST, LONGEST, INTERVAL = 5000.0, 8000.0, 350.0
# No zone is nearer to an end than this, m.
AWAY = 250.0
# The grid search: pitch along and across, layers, room kept from zones and from the band's edges, m.
PITCH, LAYER, ZONE_ROOM, BAND_ROOM = 100.0, 2.5, 40.0, 15.0
# Of the steepest slopes in still air and light turbulence, what it climbs and sinks by, rad.
_TURBULENCE = ("none", "light")


def airspace_scenario(number: int) -> Scenario:
    """The scenario of this number: its first draw that the grid search can pass."""
    draw = 0
    while True:
        scenario = draw_scenario(number, draw)
        if scenario is not None and passable(scenario):
            return scenario
        draw += 1


def draw_scenario(number: int, draw: int) -> Scenario | None:
    """One draw of a scenario; None for one whose ends leave the area."""
    rng = np.random.default_rng([SEED, number, draw])
    length, course = rng.uniform(SHORTEST, LONGEST), rng.uniform(0.0, 2.0 * math.pi)
    start = rng.uniform(-0.9 * HALF, 0.9 * HALF, 2)
    destination = start + length * np.array([math.sin(course), math.cos(course)])
    if np.abs(destination).max() > 0.9 * HALF:
        return None
    ends = np.stack([start, destination])
    spec: dict[str, Any] = {
        "name": f"airspace {number}.{draw}",
        "terrain": {"kind": "dem", "path": "jacksboro"},
        "area": {"east_m": [-HALF, HALF], "north_m": [-HALF, HALF], "ceiling_amsl_m": 1300.0},
        "limits": {"min_clearance_m": LOWEST, "max_height_m": HIGHEST},
        "planner": {"waypoints": 2 + round(length / INTERVAL)},
        "wind": {
            "speed_mps": float(rng.uniform(0.0, 6.0)),
            "from_deg": float(rng.uniform(0.0, 360.0)),
            "turbulence": str(rng.choice(_TURBULENCE)),
        },
        "flight": {"autopilot": "ardupilot"},
        "zones": _zones(rng, ends),
    }
    for name, place in zip(("start", "destination"), ends, strict=True):
        spec[name] = {
            "east_m": float(place[0]),
            "north_m": float(place[1]),
            "height_m": float(rng.uniform(135.0, 165.0)),
        }
    return from_spec(spec, spec["name"])


def _zones(rng: np.random.Generator, ends: Floats) -> list[dict[str, Any]]:
    """Exclusions along the way, of which some can be passed above or below; in every third an inclusion about it."""
    made: list[dict[str, Any]] = []
    step, side = ends[1] - ends[0], np.array([ends[0, 1] - ends[1, 1], ends[1, 0] - ends[0, 0]])
    for k in range(int(rng.integers(4, 13))):
        while True:
            place = ends[0] + rng.uniform(0.0, 1.0) * step + rng.uniform(-0.35, 0.35) * side
            radius = float(rng.uniform(200.0, 800.0))
            if np.linalg.norm(ends - place, axis=1).min() > radius + AWAY:
                break
        zone: dict[str, Any] = {"name": f"zone {k + 1}", "kind": "exclusion"}
        if rng.random() < 0.5:
            zone |= {"east_m": float(place[0]), "north_m": float(place[1]), "radius_m": radius}
        else:
            zone["polygon_m"] = star(rng, place, radius, int(rng.integers(3, 10)))
        levels = rng.random()
        if levels < 0.15:
            zone["floor_agl_m"] = float(rng.uniform(150.0, 190.0))
        elif levels < 0.3:
            zone["ceiling_agl_m"] = float(rng.uniform(110.0, 150.0))
        made.append(zone)
    if rng.random() < 1.0 / 3.0:
        middle, half = ends.mean(axis=0), 0.5 * float(np.linalg.norm(step))
        ring = star(rng, middle, 1.35 * half, 12, least=0.9)
        made.append({"name": "fence", "kind": "inclusion", "polygon_m": ring})
    return made


def star(rng: np.random.Generator, place: Floats, radius: float, corners: int, least: float = 0.4) -> list[list[float]]:
    """A ring of corners about a place, none further than the radius nor nearer than `least` of it, m."""
    turns = (np.arange(corners) + rng.uniform(-0.35, 0.35, corners)) * 2.0 * math.pi / corners
    away = radius * rng.uniform(least, 1.0, corners)
    return [
        [float(place[0] + r * math.cos(t)), float(place[1] + r * math.sin(t))] for t, r in zip(turns, away, strict=True)
    ]


def passable(scenario: Scenario) -> bool:
    """Whether a grid way exists: monotone along, within slopes, 45 degree turns, the band, and outside the zones.

    States are (course of -45, 0 or +45 degrees from the line, place across, layer); each stage goes one pitch along.  A
    cell is open if it and the places about it are within the band, less its room, and outside all zones, grown.
    """
    start, destination = scenario.start, scenario.destination
    span = destination[:2] - start[:2]
    length = math.hypot(*span)
    stages = math.ceil(length / PITCH)
    pitch, (c, s) = length / stages, span / length
    half = stages // 2
    across = np.arange(-half, half + 1) * pitch
    stage = np.arange(stages + 1)[:, None] * pitch
    places = np.stack([start[0] + c * stage - s * across, start[1] + s * stage + c * across], axis=-1)
    low, high = _band(scenario, places, pitch)
    low, high = np.where(_open(scenario, places), low, np.inf), np.where(_open(scenario, places), high, -np.inf)
    layers = start[2] + np.arange(-400, 401) * LAYER
    layers = layers[
        (layers > np.nanmin(low) - LAYER) & (layers < np.max(high[np.isfinite(high)], initial=start[2]) + LAYER)
    ]
    climb, dive = _slopes(scenario)
    rises = [(int(pitch * k * math.tan(climb) / LAYER), int(pitch * k * math.tan(dive) / LAYER)) for k in (1.0, 1.414)]
    state = np.zeros((3, across.size, layers.size), dtype=bool)
    state[:, half, np.argmin(np.abs(layers - start[2]))] = True
    for k in range(1, stages + 1):
        cells = (layers >= low[k][:, None]) & (layers <= high[k][:, None])
        if k == stages:
            cells[half, np.argmin(np.abs(layers - destination[2]))] = True
        after = np.zeros_like(state)
        for side in (-1, 0, 1):
            before = state[max(0, side) : min(3, side + 3)].any(axis=0) if side else state.any(axis=0)
            spread = _climbed(before, *rises[abs(side)])
            moved = np.zeros_like(spread)
            to, of = slice(max(0, side), across.size + min(0, side)), slice(max(0, -side), across.size - max(0, side))
            moved[to] = spread[of]
            after[side + 1] = moved & cells
        state = after
        if not state.any():
            return False
    return bool(state[:, half, np.argmin(np.abs(layers - destination[2]))].any())


def _band(scenario: Scenario, places: Floats, pitch: float) -> tuple[Floats, Floats]:
    """Lowest and highest that a path may be at places (s, y, 2), by the ground about them, m AMSL."""
    terrain = scenario.terrain
    assert terrain is not None
    low, high = np.full(places.shape[:2], -np.inf), np.full(places.shape[:2], np.inf)
    for east in (-0.5 * pitch, 0.0, 0.5 * pitch):
        for north in (-0.5 * pitch, 0.0, 0.5 * pitch):
            ground = terrain.height(places[..., 0] + east, places[..., 1] + north)
            low, high = np.maximum(low, ground + LOWEST), np.minimum(high, ground + HIGHEST)
    return low + BAND_ROOM, high - BAND_ROOM


def _open(scenario: Scenario, places: Floats) -> Flags:
    """Whether places (s, y, 2) are on the map and outside every zone, whatever its heights, with room to spare."""
    free = (np.abs(places) < HALF - ZONE_ROOM).all(axis=-1)
    for zone in scenario.spec.zones or ():
        if zone.radius_m is not None:
            away = np.hypot(places[..., 0] - zone.east_m, places[..., 1] - zone.north_m) - zone.radius_m
        else:
            away = ring_distance(np.array(zone.polygon_m), places)
        free &= (away > ZONE_ROOM) if zone.kind == "exclusion" else (away < -ZONE_ROOM)
    return np.asarray(free)


def ring_distance(ring: Floats, places: Floats) -> Floats:
    """Distance of places (..., 2) from a ring (k, 2), m; negative inside."""
    nearest, inside = np.full(places.shape[:-1], np.inf), np.zeros(places.shape[:-1], dtype=bool)
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        step, off = b - a, places - a
        share = np.clip((off @ step) / (step @ step), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(off - share[..., None] * step, axis=-1))
        spans = (a[1] > places[..., 1]) != (b[1] > places[..., 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = a[0] + (places[..., 1] - a[1]) / step[1] * step[0]
        inside ^= spans & (crossing > places[..., 0])
    return np.where(inside, -nearest, nearest)


def _slopes(scenario: Scenario) -> tuple[float, float]:
    """Steepest climb and dive on any course, rad, with a tenth to spare for turbulence and half a degree beside."""
    limits = load_airframe(scenario).limits
    up = float(max(scenario.start[2], scenario.destination[2])) + 100.0
    found = np.array([limits.slopes(course, up) for course in np.radians(np.arange(0, 360, 15))])
    climb, dive = 0.9 * found.min(axis=0) - math.radians(0.5)
    if limits.tracking is not None:
        speed = limits.airspeed + scenario.wind.speed
        climb = min(climb, math.atan(limits.tracking.climb_rate / speed) - math.radians(0.5))
        dive = min(dive, math.atan(limits.tracking.sink_rate / speed) - math.radians(0.5))
    return float(climb), float(dive)


def _climbed(cells: Flags, climb: int, dive: int) -> Flags:
    """Layers that one stage reaches from the given ones (across, layers)."""
    out = cells.copy()
    for step in range(1, climb + 1):
        out[:, step:] |= cells[:, :-step]
    for step in range(1, dive + 1):
        out[:, :-step] |= cells[:, step:]
    return out
