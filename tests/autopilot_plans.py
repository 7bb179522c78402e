"""Random scenarios to plan and to fly with an autopilot, on three terrains; and what harm came of a flight.

Each comes from its number alone: the ground (the tile near Jacksboro, made hills, a plain), the ends, missiles between
them, a wind of 0 to 10 m/s from anywhere, and turbulence.  Limits and planner are the defaults.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from flight.simulation.track import Track
from world.arrays import Floats
from world.scenario import Scenario, scenario_from_spec

SEED = 2024
TERRAINS = ("tile", "hills", "plain")
CLEARANCE = 60.0
_TURBULENCE = ("none", "light", "moderate")
# Half the area's sides, m, by terrain: the tile has no more.
_AREA = {"tile": (13_000.0, 13_000.0), "hills": (8000.0, 8000.0), "plain": (8000.0, 8000.0)}


@dataclass(frozen=True, slots=True)
class Harm:
    """What a flight's own positions show.

    clearance: least height above ground, m.  sphere: least distance outside a kill sphere, m, inf without any.
    outside: furthest outside area, floor and ceiling, m, negative inside.  aside: furthest from the legs, m.
    """

    clearance: float
    sphere: float
    outside: float
    aside: float

    def text(self, scenario: Scenario) -> str:
        """What is wrong with it, "" for nothing."""
        parts = []
        if not self.clearance >= scenario.limits.min_clearance_m:
            parts.append(f"{self.clearance:.1f} m above ground")
        if not self.sphere >= 0.0:
            parts.append(f"{-self.sphere:.1f} m inside a sphere")
        if not self.outside <= 0.0:
            parts.append(f"{self.outside:.1f} m outside the area")
        return ", ".join(parts)


def plan_scenario(number: int, autopilot: str = "ardupilot") -> Scenario:
    """The scenario of this number; every third one is on the same terrain."""
    rng = np.random.default_rng([SEED, number])
    kind = TERRAINS[number % len(TERRAINS)]
    half_e, half_n = _AREA[kind]
    course = rng.uniform(0.0, 2.0 * math.pi)
    half = rng.uniform(0.35, 0.42) * 2.0 * min(half_e, half_n)
    reach = np.array([math.sin(course), math.cos(course)]) * half
    middle = rng.uniform(-500.0, 500.0, 2)
    ends = np.clip([middle - reach, middle + reach], -0.97 * half_e, 0.97 * half_e)
    spec: dict[str, Any] = {
        "name": f"{kind} {number}",
        "terrain": _terrain(kind, rng, half_e),
        "area": {"east_m": [-half_e, half_e], "north_m": [-half_n, half_n], **_ceiling(kind)},
        "limits": {"min_clearance_m": CLEARANCE},
        "wind": {
            "speed_mps": float(rng.uniform(0.0, 10.0)),
            "from_deg": float(rng.uniform(0.0, 360.0)),
            "turbulence": str(rng.choice(_TURBULENCE)),
        },
        "flight": {"autopilot": autopilot},
        "threats": _threats(rng, ends, half_e),
    }
    for name, place in zip(("start", "destination"), ends, strict=True):
        spec[name] = {
            "east_m": float(place[0]),
            "north_m": float(place[1]),
            "height_m": float(rng.uniform(90.0, 200.0)),
        }
    return scenario_from_spec(spec, spec["name"])


def _ceiling(kind: str) -> dict[str, float]:
    return {"ceiling_amsl_m": {"tile": 1300.0, "hills": 900.0, "plain": 600.0}[kind]}


def _terrain(kind: str, rng: np.random.Generator, half: float) -> dict[str, Any]:
    if kind == "tile":
        return {"kind": "dem", "path": "jacksboro"}
    if kind == "plain":
        return {"kind": "flat", "amsl_m": 120.0}
    peaks = [
        {
            "east_m": float(rng.uniform(-half, half)),
            "north_m": float(rng.uniform(-half, half)),
            "height_m": float(rng.uniform(150.0, 550.0)),
            "sigma_m": float(rng.uniform(500.0, 1100.0)),
        }
        for _ in range(14)
    ]
    return {"kind": "peaks", "peak": peaks}


def _threats(rng: np.random.Generator, ends: Floats, half: float) -> list[dict[str, Any]]:
    """Missiles on the ground, that reach neither end."""
    made: list[dict[str, Any]] = []
    while len(made) < 10:
        place, radius = rng.uniform(-0.8 * half, 0.8 * half, 2), float(rng.uniform(500.0, 1500.0))
        if np.linalg.norm(ends - place, axis=1).min() < radius + 500.0:
            continue
        made.append(
            {
                "name": f"unit {len(made) + 1}",
                "east_m": float(place[0]),
                "north_m": float(place[1]),
                "kill_radius_m": radius,
                "kill_scale_m": radius / 3.0,
            }
        )
    return made


def harm_of(scenario: Scenario, waypoints: Floats, track: Track) -> Harm:
    """What a flight along waypoints (w, 3) did, by sums of its own rows."""
    place = np.asarray(track.position)
    terrain = scenario.terrain
    assert terrain is not None
    above = place[:, 2] - terrain.height(place[:, 0], place[:, 1])
    armed = scenario.threats.kill_radius > 0.0
    spheres = zip(scenario.threats.position[armed], scenario.threats.kill_radius[armed], strict=True)
    away = [float(np.linalg.norm(place - centre, axis=1).min() - radius) for centre, radius in spheres]
    low = np.array([*scenario.bounds[:, 0], scenario.floor])
    high = np.array([*scenario.bounds[:, 1], scenario.ceiling])
    outside = float(np.maximum(low - place, place - high).max())
    aside = np.full(len(place), math.inf)
    for a, b in zip(waypoints[:-1, :2], waypoints[1:, :2], strict=True):
        leg = b - a
        share = np.clip((place[:, :2] - a) @ leg / (leg @ leg), 0.0, 1.0)
        aside = np.minimum(aside, np.linalg.norm(place[:, :2] - a - share[:, None] * leg, axis=1))
    return Harm(float(above.min()), min(away, default=math.inf), outside, float(aside.max()))
