"""Mission files over the ridges near Jacksboro that fail a rule or two, drawn from a seed.

A mission has five to eight legs, most of them level, of 25 to 60 s of flight, above all ground around them.  One or two
flaws of `FLAWS` are then drawn into it.
"""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from flight.mission.items import Command, Frame, Home, Mission, MissionItem, round_to_grid
from flight.mission_files.formats import waypoints_text
from world.arrays import Floats
from world.frames import to_geo
from world.scenario import load_scenario

WORLD = load_scenario("jacksboro-air")
# Cruise airspeed of each aircraft, m/s, and an airspeed that is beyond its envelope or close to the limit.
CRUISE_MPS = {"aerosonde": 25.0, "x8": 18.0, "zagi": 15.0, "ultrastick25e": 17.0}
AUTOPILOTS = ("ardupilot", "px4", "ardupilot", "planfly")
# m.  Height of a mission above the highest ground around it.
HEIGHT_M = (70.0, 160.0)


@dataclass
class Draft:
    """A mission while it is drawn.

    points: (w, 3) m, home first, altitude AMSL.  speeds: airspeed to each waypoint, m/s.
    """

    rng: np.random.Generator
    cruise: float
    points: Floats
    speeds: Floats
    limits: dict[str, Any] = field(default_factory=lambda: {"min_clearance_m": 30})
    area: dict[str, Any] = field(default_factory=dict)
    flight: dict[str, Any] = field(default_factory=dict)
    zones: list[dict[str, Any]] = field(default_factory=list)
    threats: list[dict[str, Any]] = field(default_factory=list)

    def leg(self) -> int:
        """Draw an inner leg: number of its first waypoint."""
        return int(self.rng.integers(2, len(self.points) - 1))

    def beside(self, reach: float, depth: float) -> Floats:
        """Return a place whose surroundings, out to a reach, a leg's middle part enters by a depth."""
        leg = self.leg()
        a, b = self.points[leg, :2], self.points[leg + 1, :2]
        side = np.array([b[1] - a[1], a[0] - b[0]]) / math.dist(a, b) * self.rng.choice((-1.0, 1.0))
        return np.asarray(a + self.rng.uniform(0.25, 0.75) * (b - a) + (reach - depth) * side)


def ground(points: Floats) -> Floats:
    assert WORLD.terrain is not None
    return np.asarray(WORLD.terrain.height(points[:, 0], points[:, 1]))


def highest_ground(points: Floats) -> float:
    """Return the highest ground along legs and within 150 m of them, m AMSL."""
    places = np.concatenate([np.linspace(a, b, 60) for a, b in zip(points[:-1, :2], points[1:, :2], strict=True)])
    around = [places + 150.0 * np.array(side) for side in ((0, 0), (0, 1), (1, 0), (0, -1), (-1, 0))]
    return float(max(np.nanmax(ground(near)) for near in around))


# ----------------------------------------------------------------------
# Flaws.


def low(draft: Draft) -> None:
    """Lower one leg to a height around the clearance, or into the ground."""
    leg = draft.leg()
    top = float(np.nanmax(ground(np.linspace(draft.points[leg, :2], draft.points[leg + 1, :2], 60))))
    draft.points[leg : leg + 2, 2] = top + draft.rng.uniform(-15.0, 27.0)


def steep(draft: Draft) -> None:
    """Raise one waypoint by 1.2 to 2 times the climb of a small aircraft."""
    leg = draft.leg()
    run = math.dist(draft.points[leg, :2], draft.points[leg - 1, :2])
    draft.points[leg, 2] += run * math.tan(math.radians(draft.rng.uniform(8.0, 16.0)))


def sharp(draft: Draft) -> None:
    """Turn back on a short leg."""
    leg = draft.leg()
    here, way = draft.points[leg, :2], draft.points[leg, :2] - draft.points[leg - 1, :2]
    course = math.atan2(*way) + draft.rng.choice((-1.0, 1.0)) * math.radians(draft.rng.uniform(80.0, 130.0))
    run = draft.rng.uniform(3.0, 9.0) * draft.cruise
    corner = [*(here + run * np.array([math.sin(course), math.cos(course)])), draft.points[leg, 2]]
    draft.points = np.insert(draft.points, leg + 1, corner, axis=0)
    draft.speeds = np.insert(draft.speeds, leg + 1, draft.speeds[leg])


def fast(draft: Draft) -> None:
    leg = draft.leg()
    draft.speeds[leg : leg + 2] = round(draft.cruise * draft.rng.uniform(1.5, 2.2), 1)


def slow(draft: Draft) -> None:
    leg = draft.leg()
    draft.speeds[leg : leg + 2] = round(draft.cruise * draft.rng.uniform(0.45, 0.7), 1)


def zone(draft: Draft) -> None:
    """Forbid a circle that a leg enters, away from both ends of the mission."""
    while True:
        radius = float(draft.rng.uniform(80.0, 300.0))
        place = draft.beside(radius, draft.rng.uniform(0.1, 0.9) * radius)
        if np.hypot(*(draft.points[[1, -1], :2] - place).T).min() > radius + 20.0:
            break
    circle = {"east_m": float(place[0]), "north_m": float(place[1]), "radius_m": radius}
    draft.zones.append({"name": "zone", "kind": "exclusion"} | circle)


def missile(draft: Draft) -> None:
    radius = draft.rng.uniform(150.0, 400.0)
    east, north = draft.beside(radius, draft.rng.uniform(0.1, 0.6) * radius)
    reach = {"kill_radius_m": float(radius), "kill_scale_m": 0.25 * float(radius)}
    up = float(draft.points[:, 2].mean())
    draft.threats.append({"name": "unit", "east_m": float(east), "north_m": float(north), "amsl_m": up} | reach)


def high(draft: Draft) -> None:
    """Limit the height above ground to less than the highest waypoint has."""
    heights = draft.points[1:, 2] - ground(draft.points[1:, :2])
    draft.limits["max_height_m"] = max(60.0, round(float(heights.max() - draft.rng.uniform(3.0, 30.0))))


def edge(draft: Draft) -> None:
    """Draw the eastern edge of the area inside of the easternmost waypoint."""
    east = np.sort(draft.points[:, 0])
    draft.area["east_m"] = [-12000.0, round(float(max(east[-1] - draft.rng.uniform(5.0, 80.0), east[-2] + 40.0)), 1)]


def ceiling(draft: Draft) -> None:
    """Raise one waypoint gently, and draw the ceiling below it and above both ends."""
    leg = draft.leg()
    draft.points[leg, 2] = draft.points[[1, -1], 2].max() + 30.0
    draft.area["ceiling_amsl_m"] = round(float(draft.points[leg, 2] - draft.rng.uniform(2.0, 20.0)), 1)


def empty(draft: Draft) -> None:
    """Carry too small a battery."""
    length = float(np.hypot(*np.diff(draft.points[:, :2], axis=0).T).sum())
    draft.flight["battery_wh"] = round(length / draft.cruise * draft.rng.uniform(0.005, 0.03), 2)


FLAWS: tuple[Callable[[Draft], None], ...] = (
    low, steep, sharp, fast, slow, zone, missile, high, edge, ceiling, empty,
)  # fmt: skip


# ----------------------------------------------------------------------


def draw_failing_mission(seed: int, number: int, folder: Path) -> tuple[Path, Path]:
    """Write a mission file and its scenario; every third mission has two flaws."""
    rng = np.random.default_rng([seed, number])
    aircraft = list(CRUISE_MPS)[int(rng.integers(len(CRUISE_MPS)))]
    draft = _draw_sound_mission(rng, CRUISE_MPS[aircraft])
    for flaw in (FLAWS[number % len(FLAWS)], *rng.choice(np.array(FLAWS), 1 if number % 3 == 2 else 0)):
        flaw(draft)
    scenario = folder / "drawn.toml"
    speed = float(rng.uniform(0.0, 0.3 * draft.cruise))
    tables: dict[str, dict[str, Any]] = {
        "terrain": {"kind": "dem", "path": "jacksboro"},
        "area": {"east_m": [-12000, 12000], "north_m": [-9000, 9000], "ceiling_amsl_m": 1500} | draft.area,
        "start": _end(draft.points[1]),
        "destination": _end(draft.points[-1]),
        "limits": draft.limits,
        "flight": {"aircraft": aircraft, "autopilot": str(rng.choice(AUTOPILOTS))} | draft.flight,
        "wind": {
            "speed_mps": round(speed, 1),
            "from_deg": float(rng.integers(0, 360)),
            "turbulence": str(rng.choice(["none", "light"])),
        },
    }
    lines = ['name = "drawn"', *(line for name, table in tables.items() for line in _toml(f"[{name}]", table))]
    lines += [line for table in draft.zones for line in _toml("[[zones]]", table)]
    lines += [line for table in draft.threats for line in _toml("[[threats]]", table)]
    scenario.write_text("\n".join([*lines, ""]), encoding="utf-8")
    mission = folder / "drawn.waypoints"
    mission.write_text(waypoints_text(_as_mission(draft)), encoding="utf-8")
    return mission, scenario


def _draw_sound_mission(rng: np.random.Generator, cruise: float) -> Draft:
    (west, east), (south, north) = WORLD.bounds[0] * 0.8, WORLD.bounds[1] * 0.8
    while True:
        places = [rng.uniform((west, south), (east, north))]
        course = rng.uniform(0.0, 2.0 * math.pi)
        for _ in range(int(rng.integers(6, 9))):
            run = cruise * rng.uniform(25.0, 60.0)
            places.append(places[-1] + run * np.array([math.sin(course), math.cos(course)]))
            course += math.radians(rng.uniform(-60.0, 60.0))
        drawn = np.array(places)
        if (drawn > (west, south)).all() and (drawn < (east, north)).all():
            break
    up = highest_ground(drawn) + rng.uniform(*HEIGHT_M)
    points = np.column_stack([drawn, up + rng.uniform(-10.0, 10.0, len(drawn))])
    return Draft(rng, cruise, points, np.full(len(drawn), cruise))


def _as_mission(draft: Draft) -> Mission:
    lat, lon = to_geo(WORLD.origin, draft.points[:, 0], draft.points[:, 1])
    home = Home(
        round_to_grid(float(lat[0])), round_to_grid(float(lon[0])), round(float(ground(draft.points[:1])[0]), 1)
    )
    items: list[MissionItem] = []
    speed = draft.cruise
    for k in range(1, len(draft.points)):
        if draft.speeds[k] != speed:
            speed = float(draft.speeds[k])
            params = (0.0, speed, -1.0, 0.0)
            items.append(
                MissionItem(len(items) + 1, int(Command.DO_CHANGE_SPEED), int(Frame.MISSION), params, 0.0, 0.0, 0.0)
            )
        place = round_to_grid(float(lat[k])), round_to_grid(float(lon[k])), round(float(draft.points[k, 2]), 1)
        items.append(MissionItem(len(items) + 1, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0,) * 4, *place))
    return Mission(home, tuple(items), source="drawn.waypoints")


def _end(point: Floats) -> dict[str, float]:
    return {"east_m": float(point[0]), "north_m": float(point[1]), "amsl_m": float(point[2])}


def _toml(head: str, table: dict[str, Any]) -> list[str]:
    return ["", head, *(f"{key} = {json.dumps(value)}" for key, value in table.items())]
