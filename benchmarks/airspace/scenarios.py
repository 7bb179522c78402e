"""Random scenarios among zones in a band of heights over the Jacksboro tile, and an independent grid search.

Each scenario depends on its number only.  Draws without a path of the grid search are skipped, so that a plan must
exist. Seed and margins were fixed before any planner ran on them.
"""

import math
from typing import Any

import numpy as np

from planfly.workflow.uav import load_uav
from world.arrays import Flags, Floats
from world.scenario import Scenario, scenario_from_spec

# Seed of all scenarios.
SEED = 2026
# Half the side of the area, m.
HALF = 13_000.0
# Lower edge of the band, m above ground.
LOWEST = 100.0
# Upper edge of the band, m above ground.
HIGHEST = 200.0
# Shortest distance between start and destination, m.
SHORTEST = 5000.0
# Longest distance between start and destination, m.
LONGEST = 8000.0
# Length of the path per interval between waypoints, m.
INTERVAL = 350.0
# Smallest distance of a zone from an end, m.
AWAY = 250.0
# Pitch of the grid search along and across, m.
PITCH = 100.0
# Height of a layer of the grid search, m.
LAYER = 2.5
# Distance of the grid search from zones, m.
ZONE_ROOM = 40.0
# Distance of the grid search from the edges of the band, m.
BAND_ROOM = 15.0
# Turbulence levels of the scenarios.
_TURBULENCE = ("none", "light")


def airspace_scenario(number: int) -> Scenario:
    """Return the scenario of this number: the first draw in which the grid search finds a path."""
    draw = 0
    while True:
        scenario = draw_scenario(number, draw)
        if scenario is not None and passable(scenario):
            return scenario
        draw += 1


def draw_scenario(number: int, draw: int) -> Scenario | None:
    """Draw a scenario; return None if its ends are outside the area."""
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
    return scenario_from_spec(spec, spec["name"])


def _zones(rng: np.random.Generator, ends: Floats) -> list[dict[str, Any]]:
    """Draw exclusion zones along the path, some with a floor or ceiling.

    About every third scenario also has an inclusion zone around the path.
    """
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
    """Draw a ring of corners around a place.

    The corners are at distances between `least` times the radius and the radius, m.
    """
    turns = (np.arange(corners) + rng.uniform(-0.35, 0.35, corners)) * 2.0 * math.pi / corners
    away = radius * rng.uniform(least, 1.0, corners)
    return [
        [float(place[0] + r * math.cos(t)), float(place[1] + r * math.sin(t))] for t, r in zip(turns, away, strict=True)
    ]


def passable(scenario: Scenario) -> bool:
    """Return True if a search on a grid finds a path, so that a plan must exist.

    The search goes in stages along the line from start to destination, by one pitch of the grid each. A path goes
    straight on or turns by 45 degrees, keeps within the slopes and the reduced band of heights, and stays outside all
    enlarged zones. ``state[course + 1, across, layer]`` is True if a path reaches the place across the line and the
    layer of altitude on a course of -45, 0 or +45 degrees from the line.
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
    # The smallest climb and dive limits of all courses, reduced by a tenth for turbulence and by half a degree.
    limits = load_uav(scenario).limits
    up = float(max(start[2], destination[2])) + 100.0
    found = np.array([limits.slopes(course, up) for course in np.radians(np.arange(0, 360, 15))])
    climb, dive = 0.9 * found.min(axis=0) - math.radians(0.5)
    if limits.tracking is not None:
        speed = limits.airspeed + scenario.wind.speed
        climb = min(climb, math.atan(limits.tracking.climb_rate / speed) - math.radians(0.5))
        dive = min(dive, math.atan(limits.tracking.sink_rate / speed) - math.radians(0.5))
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
            # Layers that a climb or dive over one stage reaches.
            climbed_layers, dived_layers = rises[abs(side)]
            spread = before.copy()
            for step in range(1, climbed_layers + 1):
                spread[:, step:] |= before[:, :-step]
            for step in range(1, dived_layers + 1):
                spread[:, :-step] |= before[:, step:]
            moved = np.zeros_like(spread)
            to, of = slice(max(0, side), across.size + min(0, side)), slice(max(0, -side), across.size - max(0, side))
            moved[to] = spread[of]
            after[side + 1] = moved & cells
        state = after
        if not state.any():
            return False
    return bool(state[:, half, np.argmin(np.abs(layers - destination[2]))].any())


def _band(scenario: Scenario, places: Floats, pitch: float) -> tuple[Floats, Floats]:
    """Return the lowest and highest altitude of a path at each place, m AMSL, (s, y) each.

    The lowest altitude is counted from the highest ground within half a pitch of the place, the highest altitude from
    the lowest ground there.

    places: east and north of the places, m, (s, y, 2): stages along the line, and places across it.
    """
    terrain = scenario.terrain
    assert terrain is not None
    low, high = np.full(places.shape[:2], -np.inf), np.full(places.shape[:2], np.inf)
    for east in (-0.5 * pitch, 0.0, 0.5 * pitch):
        for north in (-0.5 * pitch, 0.0, 0.5 * pitch):
            ground = terrain.height(places[..., 0] + east, places[..., 1] + north)
            low, high = np.maximum(low, ground + LOWEST), np.minimum(high, ground + HIGHEST)
    return low + BAND_ROOM, high - BAND_ROOM


def _open(scenario: Scenario, places: Floats) -> Flags:
    """Return a mask (s, y): True for places (s, y, 2) that are on the map and in no zone, with margins.

    Zones count at all heights.
    """
    free = (np.abs(places) < HALF - ZONE_ROOM).all(axis=-1)
    for zone in scenario.spec.zones or ():
        if zone.radius_m is not None:
            away = np.hypot(places[..., 0] - zone.east_m, places[..., 1] - zone.north_m) - zone.radius_m
        else:
            away = ring_distance(np.array(zone.polygon_m), places)
        free &= (away > ZONE_ROOM) if zone.kind == "exclusion" else (away < -ZONE_ROOM)
    return np.asarray(free)


def ring_distance(ring: Floats, places: Floats) -> Floats:
    """Return the distance of places (..., 2) from a ring (k, 2), m; negative inside."""
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
