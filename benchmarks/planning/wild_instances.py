"""Draw random instances of 60 threats with random ground, map, ends, ceiling, waypoints and threats.

The instances of `tests.instances` share one ground, one pair of ends, one ceiling, and limits in degrees.  These share
nothing; the aircraft limits turns and slopes, which is the default of a scenario.
"""

import math
from typing import Any

import numpy as np

from world.arrays import Floats
from world.scenario import Scenario, scenario_from_spec

# Seed of all instances.
SEED = 3901
# Number of threats.
THREATS = 60
# Range of heights of the ends above ground, m.
ABOVE = (100.0, 250.0)
# Smallest distance of a threat's sphere from the ends, m.
AWAY = 300.0


def wild_scenario(number: int, autopilot: str) -> Scenario:
    """Make the scenario of this number, for the Aerosonde."""
    rng = np.random.default_rng([SEED, number])
    length, course = float(rng.uniform(8000.0, 16000.0)), float(rng.uniform(0.0, 2.0 * math.pi))
    ends = 0.5 * length * np.array([[-math.sin(course), -math.cos(course)], [math.sin(course), math.cos(course)]])
    half = max(float(rng.uniform(0.38, 0.5)) * length, float(np.abs(ends).max()) + 300.0)
    count = int(rng.integers(0, 13))
    peaks = np.column_stack(
        [rng.uniform(-half, half, (count, 2)), rng.uniform(50.0, 500.0, count), rng.uniform(0.03, 0.09, count) * length]
    )
    heights = _ground(peaks, ends) + rng.uniform(*ABOVE, 2)
    radii = float(rng.uniform(0.85, 1.25)) * rng.uniform(0.035, 0.06, THREATS) * length
    terrain: dict[str, Any] = {"kind": "flat", "amsl_m": 0.0}
    if count:
        names = ("east_m", "north_m", "height_m", "sigma_m")
        terrain = {"kind": "peaks", "peak": [dict(zip(names, peak.tolist(), strict=True)) for peak in peaks]}
    spec: dict[str, Any] = {
        "name": f"wild-{number}",
        "terrain": terrain,
        "area": {
            "east_m": [-half, half],
            "north_m": [-half, half],
            "floor_amsl_m": 0.0,
            "ceiling_amsl_m": float(heights.max() + rng.uniform(50.0, 250.0)),
        },
        "planner": {"waypoints": int(rng.choice([12, 16, 20]))},
        "flight": {"aircraft": "aerosonde", "autopilot": autopilot},
        "threats": _threats(rng, np.column_stack([ends, heights]), peaks, radii, half),
    }
    for name, end, height in zip(("start", "destination"), ends, heights, strict=True):
        spec[name] = {"east_m": float(end[0]), "north_m": float(end[1]), "amsl_m": float(height)}
    return scenario_from_spec(spec, spec["name"])


def _ground(peaks: Floats, places: Floats) -> Floats:
    """Return the ground height (n,) at places (n, 2), m."""
    total = np.zeros(len(places))
    for east, north, height, sigma in peaks:
        total += height * np.exp(-((places[:, 0] - east) ** 2 + (places[:, 1] - north) ** 2) / (2.0 * sigma**2))
    return total


def _threats(rng: np.random.Generator, ends: Floats, peaks: Floats, radii: Floats, half: float) -> list[dict[str, Any]]:
    """Draw units at random places on the ground whose missiles reach neither end."""
    made: list[dict[str, Any]] = []
    while len(made) < len(radii):
        spot, radius = rng.uniform(-half, half, 2), float(radii[len(made)])
        place = np.append(spot, _ground(peaks, spot[None])[0])
        if np.linalg.norm(ends - place, axis=1).min() < radius + AWAY:
            continue
        reach = {"kill_radius_m": radius, "kill_scale_m": radius / 2.0}
        made.append({"name": f"unit {len(made) + 1}", "east_m": float(spot[0]), "north_m": float(spot[1]), **reach})
    return made
