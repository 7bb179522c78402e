"""Flights that PX4 itself flew, as `kept_tracks/` holds them, and the same missions by planfly's law."""

import csv
import functools
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aircraft.catalog import load_aircraft
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.simulation.simulate import Flight
from flight.simulation.track import as_track, join_rows
from tests.setups import setup_maker
from world.arrays import Floats
from world.scenario_tables import Px4Version

FOLDER = Path(__file__).with_name("kept_tracks")

# Mission, release and parameters of each kept flight.
FLIGHTS: dict[str, tuple[str, Px4Version, dict[str, float]]] = {
    "corners-1.16": ("corners", "1.16", {}),
    "corners-1.17": ("corners", "1.17", {}),
    "jacksboro-1.16": ("jacksboro", "1.16", {}),
    "jacksboro-1.17-rates": (
        "jacksboro",
        "1.17",
        {"FW_T_CLMB_R_SP": 5.5, "FW_T_SINK_R_SP": 4.0, "FW_T_HRATE_FF": 1.0},
    ),
}
# At a waypoint within this, m; and turned there through this (rad), it has begun a circle.
_NEAR, _CIRCLES = 70.0, math.radians(25.0)


@dataclass(frozen=True)
class Flown:
    """A flight along waypoints (w, 3).

    time: (t,) s.  position: (t, 3) m.  switches: by waypoint, when (s) and where (m) it turned to the next leg.
    """

    waypoints: Floats
    time: Floats
    position: Floats
    switches: dict[int, tuple[float, Floats]]

    def leg(self, k: int) -> tuple[Floats, Floats]:
        """Times since it began (t,) and places (t, 3) on the leg to waypoint k."""
        begin = self.switches[k - 1][0] if k > 1 else 0.0
        end = self.switches[k][0] if k in self.switches else math.inf
        rows = (self.time >= begin) & (self.time <= end)
        return self.time[rows] - begin, self.position[rows]

    def switch_distance(self, k: int) -> float:
        """How far from waypoint k it turned to the next leg, m."""
        return float(np.hypot(*(self.switches[k][1] - self.waypoints[k])[:2]))

    def overshoot(self, k: int) -> float:
        """How far it swung over the leg after waypoint k, beyond it, m."""
        a, b = self.waypoints[k], self.waypoints[k + 1]
        before, along = (a - self.waypoints[k - 1])[:2], (b - a)[:2] / np.hypot(*(b - a)[:2])
        side = math.copysign(1.0, before[0] * along[1] - before[1] * along[0])
        away = self.leg(k + 1)[1][:, :2] - a[:2]
        return float((side * (away[:, 0] * along[1] - away[:, 1] * along[0])).max())

    def turned_at(self, k: int) -> float:
        """How far (rad) it turned between its coming to waypoint k and its turn to the next leg."""
        position = self.leg(k)[1][:, :2]
        near = np.flatnonzero(np.hypot(*(position - self.waypoints[k][:2]).T) < _NEAR)
        if not near.size:
            return 0.0
        step = np.diff(position[near[0] :], axis=0)
        step = step[np.hypot(*step.T) > 1.0]
        course = np.unwrap(np.arctan2(step[:, 0], step[:, 1])) if len(step) else np.zeros(1)
        return float(np.abs(course - course[0]).max())

    def circled(self) -> list[int]:
        """Waypoints at which it left the leg's course before it turned to the next: for its height."""
        return [k for k in range(1, len(self.waypoints)) if self.turned_at(k) > _CIRCLES]


def _rows(name: str) -> list[dict[str, str]]:
    with (FOLDER / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _table(name: str, key: str, wanted: str) -> Floats:
    return np.array([[float(value) for value in list(row.values())[1:]] for row in _rows(name) if row[key] == wanted])


@functools.cache
def kept(flight: str) -> Flown:
    """A flight by PX4 itself."""
    waypoints = _table("missions.csv", "mission", FLIGHTS[flight][0])[:, 1:]
    track, switches = _table("tracks.csv", "flight", flight), _table("switches.csv", "flight", flight)
    return Flown(waypoints, track[:, 0], track[:, 1:], {int(row[0]): (float(row[1]), row[2:]) for row in switches})


@functools.cache
def by_law(flight: str) -> Flown:
    """The same mission by planfly's law, with the same parameters."""
    _, version, changed = FLIGHTS[flight]
    aerosonde, waypoints = load_aircraft("aerosonde"), kept(flight).waypoints
    law = Px4(Px4Parameters.load(aerosonde, None, version).changed(**changed))
    setup = setup_maker(aerosonde)(waypoints, bank_deg=30.0)
    flying = Flight(replace(setup, autopilot=law), aerosonde)
    memory = flying._workspace.law_record["memory"]
    blocks, ended, leg, switches = [], "", 0, {}
    while not ended:
        rows, ended = flying.fly_block(2)
        blocks.append(np.array(rows))
        if int(memory["leg"]) != leg and len(rows):
            leg = int(memory["leg"])
            switches[leg] = (float(rows["time"][-1]), np.array(rows["position"][-1]))
    assert ended == "completed"
    track = as_track(join_rows(blocks))
    # A row in a third of a second.
    return Flown(waypoints, track.time[::20], track.position[::20], switches)
