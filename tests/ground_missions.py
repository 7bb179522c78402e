"""Missions from the ground to the ground from a number: home, field, wind and threats, over measured and made hills.

`draw_field` gives a scenario with a home near its start and a landing place that is level enough to land on; nothing
else is known of it, so that some can be planned and some cannot.
"""

import math
from typing import Any

import numpy as np

from world.arrays import Floats
from world.scenario import Scenario, scenario_from_spec
from world.terrain import Terrain

SEED = 3535
# m.  How far the aircraft comes from, and how far the destination is before the field.
_WAY, _BEFORE = (3500.0, 6000.0), 2200.0
# Steepest ground along and across the field, m per m.
LEVEL = 0.05
_HALF = 6500.0


def draw_field(number: int, launch: str = "catapult", flight: dict[str, str] | None = None) -> Scenario:
    """The scenario of a number: every other one over the tile that planfly ships.

    launch: its method.  flight: what its `[flight]` states.
    """
    rng = np.random.default_rng([SEED, number])
    measured = number % 2 == 0
    terrain: dict[str, Any] = {"kind": "dem", "path": "jacksboro"}
    if not measured:
        hills = [_hill(rng) for _ in range(14)]
        terrain = {"kind": "peaks", "peak": hills}
    middle = np.array([5500.0, -1000.0]) if measured else np.zeros(2)
    from_deg = float(rng.uniform(0.0, 360.0))
    spec: dict[str, Any] = {
        "name": f"field-{number}",
        "origin": {"lat_deg": 36.30625, "lon_deg": -84.24569},
        "terrain": terrain,
        "area": {
            "east_m": [middle[0] - _HALF, middle[0] + _HALF],
            "north_m": [middle[1] - _HALF, middle[1] + _HALF],
            "ceiling_amsl_m": 1500.0,
        },
        "limits": {"min_clearance_m": float(rng.choice([30.0, 45.0, 60.0]))},
        "planner": {"waypoints": 8},
        "wind": {"speed_mps": float(rng.uniform(0.0, 8.0)), "from_deg": from_deg, "turbulence": "light"},
    }
    spec |= {"flight": flight} if flight else {}
    ends = {
        "start": {"east_m": 0, "north_m": 0, "amsl_m": 3000},
        "destination": {"east_m": 50, "north_m": 0, "amsl_m": 3000},
    }
    ground = scenario_from_spec(
        spec | {"area": spec["area"] | {"ceiling_amsl_m": 9000.0}} | _around(ends, middle), "ground"
    ).terrain
    assert ground is not None
    places = _places(rng, ground, middle, math.radians(from_deg))
    return scenario_from_spec(spec | places | {"launch": {"method": launch}}, f"field-{number}")


def _hill(rng: np.random.Generator) -> dict[str, float]:
    east, north = rng.uniform(-_HALF, _HALF, 2)
    return {
        "east_m": float(east),
        "north_m": float(north),
        "height_m": float(rng.uniform(60.0, 320.0)),
        "sigma_m": float(rng.uniform(300.0, 900.0)),
    }


def _around(ends: dict[str, dict[str, float]], middle: Floats) -> dict[str, Any]:
    return {
        name: end | {"east_m": end["east_m"] + float(middle[0]), "north_m": end["north_m"] + float(middle[1])}
        for name, end in ends.items()
    }


def _places(rng: np.random.Generator, ground: Terrain, middle: Floats, upwind: float) -> dict[str, Any]:
    """Field, destination, start and home, and up to two missiles beside the way."""
    into = np.array([math.sin(upwind), math.cos(upwind)])
    while True:
        field = middle + rng.uniform(-0.5 * _HALF, 0.5 * _HALF, 2)
        destination = field - _BEFORE * into + rng.uniform(-600.0, 600.0, 2)
        course = rng.uniform(0.0, 2.0 * math.pi)
        start = destination + rng.uniform(*_WAY) * np.array([math.sin(course), math.cos(course)])
        home = start + rng.uniform(-700.0, 700.0, 2)
        inside = all((np.abs(place - middle) < _HALF - 900.0).all() for place in (field, destination, start, home))
        if inside and _slope(ground, field, into) < LEVEL and _slope(ground, field, into[::-1] * [1.0, -1.0]) < LEVEL:
            break
    threats = []
    for _ in range(int(rng.integers(0, 3))):
        place = 0.5 * (start + destination) + rng.uniform(-1500.0, 1500.0, 2)
        reach = float(rng.uniform(200.0, 600.0))
        if min(math.dist(place, other) for other in (start, destination, field, home)) > reach + 900.0:
            threats.append(_at(place) | {"kill_radius_m": reach, "kill_scale_m": reach / 4.0})
    return {
        "start": _at(start) | {"height_m": float(rng.uniform(90.0, 250.0))},
        "destination": _at(destination) | {"height_m": float(rng.uniform(90.0, 250.0))},
        "home": _at(home),
        "landing": _at(field),
        "threats": threats,
    }


def _at(place: Floats) -> dict[str, float]:
    return {"east_m": float(place[0]), "north_m": float(place[1])}


def _slope(ground: Terrain, field: Floats, toward: Floats) -> float:
    """Slope of the ground over 200 m about a place, m per m."""
    low, high = (float(ground.height(*(field + away * toward))) for away in (-100.0, 100.0))
    return abs(high - low) / 200.0
