"""Corners and circles that ArduPlane itself flew, as `kept_circles/` holds them, and the same by planfly's law."""

import csv
import functools
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.mission.items import Mission
from flight.mission.itinerary import stated_loiter
from flight.mission_files.formats import parse_mission
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, SimulatedFlight, fly_to_end
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import load_uav
from world.arrays import Floats
from world.frames import GeoOrigin, to_map
from world.scenario import scenario_from_spec

FOLDER = Path(__file__).with_name("kept_circles")

CORNERS = ("corners-30", "corners-35")
CIRCLES = ("turns-500", "turns-1300", "turns-2000", "time", "time-left", "to-height", "circles-wind")
_ROLL_LIMITS = {"corners-35": 35.0}
_WINDS = {"circles-wind": {"speed_mps": 4.0, "from_deg": 300.0}}
# A waypoint is passed where the aircraft, this near to it, comes no nearer, m.
_NEAR = 250.0
# On a circle the distance from its middle changes no faster than this, m/s.
_HELD = 1.0


@dataclass(frozen=True)
class Flown:
    """A flight of a mission.  time: (t,) s.  position: (t, 3) m.  waypoints: (w, 2) m, its items' places."""

    time: Floats
    position: Floats
    waypoints: Floats
    ended: str = ""

    def overshoot(self, k: int) -> float:
        """How far beyond the leg after waypoint k it swung before it came to waypoint k + 1, m."""
        course, after = self.waypoints[k] - self.waypoints[k - 1], self.waypoints[k + 1] - self.waypoints[k]
        along = after / np.hypot(*after)
        side = math.copysign(1.0, course[0] * along[1] - course[1] * along[0])
        away = self.position[self._passes(k) : self._passes(k + 1) + 1, :2] - self.waypoints[k]
        return float((side * (away[:, 0] * along[1] - away[:, 1] * along[0])).max())

    def _passes(self, k: int) -> int:
        """Row of its first pass of waypoint k, after those of the ones before."""
        begin = self._passes(k - 1) if k > 1 else 0
        away = np.hypot(*(self.position[begin:, :2] - self.waypoints[k]).T)
        nearest = (away[1:-1] <= away[:-2]) & (away[1:-1] < away[2:]) & (away[1:-1] < _NEAR)
        return begin + 1 + int(np.argmax(nearest)) if nearest.any() else len(self.position) - 1

    def away(self, middle: Floats) -> Floats:
        """(t,) m from a circle's middle (2,)."""
        away: Floats = np.hypot(*(self.position[:, :2] - middle).T)
        return away

    def radius(self, middle: Floats) -> float:
        """Median distance from a circle's middle where that hardly changes, m."""
        away = self.away(middle)
        held = away[(np.abs(np.gradient(away, self.time)) < _HELD) & (away < 1000.0)]
        return float(np.median(held)) if held.size else math.nan

    def widest(self, middle: Floats) -> float:
        """Greatest distance from a circle's middle at which it came back, m."""
        away = self.away(middle)
        peaks = away[1:-1][(away[1:-1] > away[:-2]) & (away[1:-1] >= away[2:])]
        return float(peaks[peaks < 1000.0].max(initial=-math.inf))

    def left(self, middle: Floats) -> float:
        """When it was last within 500 m of a circle's middle, s."""
        return float(self.time[np.flatnonzero(self.away(middle) < 500.0)[-1]])


@functools.cache
def kept(flight: str) -> Flown:
    """A flight by ArduPlane itself."""
    with (FOLDER / "tracks.csv").open(encoding="utf-8") as file:
        rows = [list(map(float, list(row.values())[1:])) for row in csv.DictReader(file) if row["flight"] == flight]
    track = np.array(rows)
    return Flown(track[:, 0], track[:, 1:], places(flight))


def _text(flight: str) -> str:
    return (FOLDER / f"{flight}.waypoints").read_text(encoding="utf-8")


def places(flight: str) -> Floats:
    """East and north (w, 2) of a mission's items from its home, m."""
    mission = parse_mission(_text(flight), flight)
    assert mission.home is not None
    east, north = to_map(
        GeoOrigin(mission.home.lat_deg, mission.home.lon_deg),
        [item.lat_deg for item in mission.items],
        [item.lon_deg for item in mission.items],
    )
    return np.column_stack([east, north])


def middles(flight: str) -> list[Floats]:
    """The middles of a mission's circles, (2,) each."""
    mission = parse_mission(_text(flight), flight)
    return [place for place, item in zip(places(flight), mission.items, strict=True) if stated_loiter(item) is not None]


@functools.cache
def kept_setup(flight: str) -> FlightSetup:
    """A flight's setup for the law, with exact navigation."""
    return setup_by_law(parse_mission(_text(flight), f"{flight}.waypoints"), flight)


def setup_by_law(mission: Mission, flight: str = "") -> FlightSetup:
    """A mission's setup for the law, as the kept flights have theirs; flight: one of them, for its wind and limits."""
    assert mission.home is not None
    ends = {"east_m": 0.0, "north_m": -3000.0, "amsl_m": 500.0}
    spec = {
        "name": flight or "circles",
        "origin": {"lat_deg": mission.home.lat_deg, "lon_deg": mission.home.lon_deg},
        "terrain": {"kind": "flat", "amsl_m": 0.0},
        "area": {"east_m": [-20000, 20000], "north_m": [-20000, 20000], "ceiling_amsl_m": 4000},
        "start": ends,
        "destination": ends | {"north_m": 4000.0},
        "wind": _WINDS.get(flight, {}),
    }
    scenario = scenario_from_spec(spec, flight or "circles")
    uav = load_uav(scenario)
    law = ArduPlane(ArduPilotParameters.load(uav.aircraft, None, "4.6"))
    if flight in _ROLL_LIMITS:
        law = law.with_parameters(ROLL_LIMIT_DEG=_ROLL_LIMITS[flight])
    return replace(make_setup(scenario, replace(uav, autopilot=law), mission, 1), nav="perfect")


@functools.cache
def simulated(flight: str) -> SimulatedFlight:
    """The same mission by planfly's law, as it was recorded."""
    setup = kept_setup(flight)
    return fly_to_end(Flight(setup, load_uav(setup.scenario).aircraft))


def by_law(flight: str) -> Flown:
    """The same mission by planfly's law, with rows as often as those that are kept, or oftener."""
    done = simulated(flight)
    track = done.track
    return Flown(track.time[::20], track.position[::20], places(flight), done.ended)
