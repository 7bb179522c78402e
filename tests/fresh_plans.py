"""Random scenarios over ground from 0 to 4,000 m, for each shipped fixed wing and each autopilot.

Each comes from its number alone.  Limits and planner are the defaults; nothing here is tuned on.
"""

import math
from typing import Any

import numpy as np

from world.arrays import Floats
from world.scenario import Scenario, scenario_from_spec

SEED = 39
AIRCRAFT = ("aerosonde", "x8", "zagi", "ultrastick25e")
AUTOPILOTS = ("ardupilot", "px4", "planfly")
# Cruise speeds, m/s, which winds are shares of.
_CRUISE = {"aerosonde": 25.0, "x8": 18.0, "zagi": 15.0, "ultrastick25e": 17.0}
_HIGHEST = 4000.0
_CLEARANCE = 50.0


def fresh_scenario(number: int) -> Scenario:
    """The scenario of this number: each aircraft with each autopilot in turn."""
    rng = np.random.default_rng([SEED, number])
    aircraft = AIRCRAFT[number % len(AIRCRAFT)]
    autopilot = AUTOPILOTS[number // len(AIRCRAFT) % len(AUTOPILOTS)]
    speed = _CRUISE[aircraft]
    # As long as 5 to 12 minutes in still air.
    length = float(rng.uniform(300.0, 720.0)) * speed
    course = float(rng.uniform(0.0, 2.0 * math.pi))
    reach = 0.5 * length * np.array([math.sin(course), math.cos(course)])
    ends = np.array([-reach, reach])
    half = 0.5 * length + 2000.0
    base = float(rng.uniform(0.0, _HIGHEST - 800.0))
    spec: dict[str, Any] = {
        "name": f"{aircraft} {autopilot} {number}",
        "terrain": _terrain(rng, base, half),
        "area": {"east_m": [-half, half], "north_m": [-half, half], "ceiling_amsl_m": base + 1500.0},
        "limits": {"min_clearance_m": _CLEARANCE},
        "wind": {
            "speed_mps": float(rng.uniform(0.0, 0.4 * speed)),
            "from_deg": float(rng.uniform(0.0, 360.0)),
            "turbulence": str(rng.choice(["none", "light", "moderate"])),
        },
        "flight": {"aircraft": aircraft, "autopilot": autopilot},
        "threats": _threats(rng, ends, length),
        "zones": _zones(rng, ends, length),
    }
    if rng.random() < 0.3:
        spec["limits"]["max_height_m"] = float(rng.uniform(250.0, 500.0))
    for name, place in zip(("start", "destination"), ends, strict=True):
        spec[name] = {
            "east_m": float(place[0]),
            "north_m": float(place[1]),
            "height_m": float(rng.uniform(90.0, 200.0)),
        }
    return scenario_from_spec(spec, spec["name"])


def _terrain(rng: np.random.Generator, base: float, half: float) -> dict[str, Any]:
    if rng.random() < 0.3:
        return {"kind": "flat", "amsl_m": base}
    # One so wide that it lifts all the others.
    wide = {"east_m": 0.0, "north_m": 0.0, "height_m": base, "sigma_m": 100_000.0}
    peaks = [
        {
            "east_m": float(rng.uniform(-half, half)),
            "north_m": float(rng.uniform(-half, half)),
            "height_m": float(rng.uniform(100.0, 600.0)),
            "sigma_m": float(rng.uniform(400.0, 1500.0)),
        }
        for _ in range(int(rng.integers(3, 15)))
    ]
    return {"kind": "peaks", "peak": [wide, *peaks] if base > 0.0 else peaks}


def _away(rng: np.random.Generator, ends: Floats, length: float, reach: float) -> Floats | None:
    """A place between the ends, from which neither is within reach; None where a draw finds none."""
    along, across = float(rng.uniform(-0.45, 0.45)), float(rng.uniform(-0.25, 0.25))
    way = (ends[1] - ends[0]) / length
    place: Floats = length * (along * way + across * np.array([way[1], -way[0]]))
    return place if np.linalg.norm(ends - place, axis=1).min() > reach + 600.0 else None


def _threats(rng: np.random.Generator, ends: Floats, length: float) -> list[dict[str, Any]]:
    made: list[dict[str, Any]] = []
    for number in range(int(rng.integers(0, 8))):
        radius = float(rng.uniform(0.03, 0.08)) * length
        if (place := _away(rng, ends, length, radius)) is not None:
            east, north = (float(one) for one in place)
            reach = {"kill_radius_m": radius, "kill_scale_m": radius / 3.0}
            made.append({"name": f"unit {number}", "east_m": east, "north_m": north, **reach})
    return made


def _zones(rng: np.random.Generator, ends: Floats, length: float) -> list[dict[str, Any]]:
    made: list[dict[str, Any]] = []
    for number in range(int(rng.integers(0, 4))):
        radius = float(rng.uniform(0.02, 0.06)) * length
        if (place := _away(rng, ends, length, radius)) is not None:
            east, north = (float(one) for one in place)
            made.append(
                {"name": f"zone {number}", "kind": "exclusion", "east_m": east, "north_m": north, "radius_m": radius}
            )
    return made
