"""Missions as people fly them, from a seed, and ones that something is nearly or just too much for.

An ordinary mission has six to nine legs of 600 to 1,600 m, turns up to 60 degrees, slopes up to half of what the
aircraft can, winds up to 10 m/s, none or light turbulence, and room on all sides.  A close one is the same, but for one
limit that is set about its own lines: exceeded by a little in half of them, kept by a little in the others.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flight.mission.items import Command, Frame, Mission, MissionItem, round_to_grid
from logs.verdict.tolerances import ENERGY_RESERVE_FRACTION
from world.arrays import Floats
from world.frames import to_geo
from world.scenario import Scenario, scenario_from_spec

GROUND, AIRSPEED = 200.0, 25.0
LEGS, RUNS, MAX_TURN, MAX_SLOPE = (6, 9), (600.0, 1600.0), math.radians(60.0), math.radians(4.0)
# What an ordinary mission has around it, m.
ROOM, LOWEST, HIGHEST = 3000.0, 120.0, 600.0
# What a close mission is close to, and by how much at least and at most: m, and a share of the battery.
CLOSE = {"clearance": (3.0, 15.0), "missile": (3.0, 20.0), "bounds": (3.0, 20.0), "energy": (0.01, 0.05)}


@dataclass(frozen=True, slots=True)
class FieldMission:
    """A mission and the world it is flown in.

    close_to: a key of `CLOSE`, or "" for an ordinary mission.
    exceeded: whether its own lines exceed that limit.
    """

    name: str
    scenario: Scenario
    mission: Mission
    close_to: str
    exceeded: bool


def ordinary_mission(seed: int, **flight: Any) -> FieldMission:
    """An ordinary mission; flight: keys of the scenario's [flight]."""
    random = np.random.default_rng([2026, seed])
    way = _waypoints(random)
    return _made(f"ordinary-{seed}", way, _tables(random, way, flight), "", exceeded=False)


def close_mission(seed: int, energy: Callable[[FieldMission], float], **flight: Any) -> FieldMission:
    """A mission that keeps one limit by a little, or exceeds it.

    energy: gives what an ordinary mission takes, Wh.
    """
    random = np.random.default_rng([2027, seed])
    way = _waypoints(random)
    tables = _tables(random, way, flight)
    close_to = list(CLOSE)[seed % len(CLOSE)]
    exceeded = bool((seed // len(CLOSE)) % 2)
    by = float(random.uniform(*CLOSE[close_to])) * (-1.0 if exceeded else 1.0)
    match close_to:
        case "clearance":
            tables["limits"] = {"min_clearance_m": round(float(way[:, 2].min()) - GROUND - by, 1)}
        case "missile":
            tables["threats"] = [_missile_beside(random, way, by)]
        case "bounds":
            _set_edge(tables["area"], way, by)
        case "energy":
            needed = energy(_made(f"energy-{seed}", way, tables, "", exceeded=False))
            tables["flight"]["battery_wh"] = round(needed / (1.0 - ENERGY_RESERVE_FRACTION) * (1.0 + by), 2)
    return _made(f"{close_to}-{seed}", way, tables, close_to, exceeded=exceeded)


def _waypoints(random: np.random.Generator) -> Floats:
    count = int(random.integers(LEGS[0], LEGS[1] + 1))
    course = float(random.uniform(0.0, 2.0 * math.pi))
    way = [np.array([0.0, 0.0, GROUND + float(random.uniform(200.0, 400.0))])]
    for leg in range(count):
        course += float(random.uniform(-MAX_TURN, MAX_TURN)) if leg else 0.0
        run = float(random.uniform(*RUNS))
        low, high = GROUND + LOWEST - way[-1][2], GROUND + HIGHEST - way[-1][2]
        rise = float(np.clip(run * math.tan(random.uniform(-MAX_SLOPE, MAX_SLOPE)), low, high))
        way.append(way[-1] + np.array([run * math.sin(course), run * math.cos(course), rise]))
    return np.array(way)


def _tables(random: np.random.Generator, way: Floats, flight: dict[str, Any]) -> dict[str, Any]:
    low, high = way.min(axis=0) - ROOM, way.max(axis=0) + ROOM
    return {
        "terrain": {"kind": "flat", "amsl_m": GROUND},
        "area": {
            "east_m": [float(low[0]), float(high[0])],
            "north_m": [float(low[1]), float(high[1])],
            "ceiling_amsl_m": GROUND + HIGHEST + 300.0,
        },
        "limits": {"min_clearance_m": 60.0},
        "flight": {"airspeed_mps": AIRSPEED} | flight,
        "wind": {
            "speed_mps": round(float(random.uniform(0.0, 10.0)), 1),
            "from_deg": round(float(random.uniform(0.0, 359.0))),
            "turbulence": str(random.choice(["none", "light"])),
        },
        "threats": [],
    }


def _set_edge(area: dict[str, Any], way: Floats, by: float) -> None:
    """Draw the edge of the area beside which an inner waypoint stands out most, ``by`` m outside of that waypoint."""
    outs = []
    for axis, key in enumerate(("east_m", "north_m")):
        for end, sign in enumerate((-1.0, 1.0)):
            along = sign * way[:, axis]
            outs.append((float(along[1:-1].max() - max(along[0], along[-1])), float(along[1:-1].max()), sign, key, end))
    ahead, most, sign, key, end = max(outs)
    # Start and destination stay inside.
    area[key][end] = round(sign * (most + max(by, 1.0 - ahead)), 1)


def _missile_beside(random: np.random.Generator, way: Floats, gap: float) -> dict[str, Any]:
    """A missile whose sphere ends ``gap`` m outside of a corner or beside a leg's middle."""
    k = int(random.integers(1, len(way) - 1))
    before, after = way[k, :2] - way[k - 1, :2], way[k + 1, :2] - way[k, :2]
    outward = before / math.hypot(*before) - after / math.hypot(*after)
    place = way[k]
    if random.random() < 0.5 or math.hypot(*outward) < 0.2:
        place = 0.5 * (way[k] + way[k + 1])
        outward = np.array([after[1], -after[0]]) * float(random.choice([-1.0, 1.0]))
    outward = outward / math.hypot(*outward)
    radius = float(round(random.uniform(300.0, 800.0)))
    centre = place[:2] + outward * (radius + gap)
    return {
        "name": "close",
        "east_m": float(centre[0]),
        "north_m": float(centre[1]),
        "amsl_m": float(place[2]),
        "kill_radius_m": radius,
        "kill_scale_m": 0.25 * radius,
    }


def _made(name: str, way: Floats, tables: dict[str, Any], close_to: str, *, exceeded: bool) -> FieldMission:
    ends = {
        key: {"east_m": float(point[0]), "north_m": float(point[1]), "amsl_m": float(point[2])}
        for key, point in (("start", way[0]), ("destination", way[-1]))
    }
    scenario = scenario_from_spec({"name": name} | ends | tables, name)
    lat, lon = to_geo(scenario.origin, way[:, 0], way[:, 1])
    items = [
        MissionItem(
            k + 1,
            int(Command.NAV_WAYPOINT),
            int(Frame.GLOBAL),
            (0.0,) * 4,
            round_to_grid(y),
            round_to_grid(x),
            round(float(up), 2),
        )
        for k, (y, x, up) in enumerate(zip(lat.tolist(), lon.tolist(), way[:, 2], strict=True))
    ]
    return FieldMission(name, scenario, Mission(None, tuple(items), source=name), close_to, exceeded)
