"""Returns that ArduPlane itself flew, as `kept_returns/` holds them, and the same returns by planfly's law."""

import csv
import functools
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.mission.items import Command, Frame, Home, Mission, MissionItem, round_to_grid
from flight.mission.route import Route
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.track import Track
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import load_uav
from world.arrays import Floats
from world.frames import to_geo
from world.scenario import Scenario, load_scenario
from world.wind import Wind

FOLDER = Path(__file__).with_name("kept_returns")
HOME = (9500.0, -5000.0, 335.055)
WIND = Wind(5.0, math.radians(250.0))
# A return is compared up to this far from its target, m; what it does nearer is its circle.
NEAR = 200.0
# From the start in the air to the place where RTL is set, m.
_LEAD = 500.0
# ArduPlane and its law are so late (s) on a slope: TECS_HDEM_TCONST.
_LATE = 3.0


def _rows(name: str) -> list[dict[str, str]]:
    with (FOLDER / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


KEPT = {row["flight"]: row for row in _rows("flights.csv")}


def kept_track(flight: str) -> Floats:
    """Times and places (n, 4) of a kept flight: s, m."""
    rows = [row for row in _rows("tracks.csv") if row["flight"] == flight]
    return np.array([[float(row[name]) for name in ("time_s", "east_m", "north_m", "amsl_m")] for row in rows])


def rally(flight: str) -> list[tuple[float, float, float]]:
    """East, north (m) and height over home of the rally points that a flight had."""
    points = [row for row in _rows("rally.csv") if row["rally_set"] == KEPT[flight]["rally_set"]]
    return [(float(one["east_m"]), float(one["north_m"]), float(one["over_home_m"])) for one in points]


@functools.cache
def jacksboro() -> Scenario:
    """The scenario in the flights' wind."""
    return replace(load_scenario("jacksboro-air"), wind=WIND)


@dataclass(frozen=True)
class Flown:
    """A return by planfly's law, up to the circle at its end.

    time: (t,) s since RTL began.  position: (t, 3) m.  hit: whether the ground ended it.  arrived: s, when it was near
    its target; NaN for never.  low: least height above ground, m.  outside: least distance outside a kill sphere, m.
    """

    route: Route
    time: Floats
    position: Floats
    hit: bool
    arrived: float
    low: float
    outside: float
    ended: str


def _item(
    seq: int, command: int, place: tuple[float, float, float], frame: int = 0, radius: float = 0.0
) -> MissionItem:
    lat, lon = (round_to_grid(float(value)) for value in to_geo(jacksboro().origin, place[0], place[1]))
    return MissionItem(seq, command, frame, (0.0, radius, 0.0, 0.0), lat, lon, place[2])


def return_mission(flight: str) -> Mission:
    """A mission that is where a kept flight was when RTL was set, on its course and slope, and returns from there.

    The waypoint stands on the slope as far ahead in height as the law is late on it.
    """
    row = {name: float(value) for name, value in KEPT[flight].items() if value and name.endswith(("_m", "_mps"))}
    east, north = row["east_m"], row["north_m"]
    ground_speed = math.hypot(row["velocity_east_mps"], row["velocity_north_mps"])
    ue, un, slope = (row[f"velocity_{way}_mps"] / ground_speed for way in ("east", "north", "up"))
    up = row["amsl_m"] + _LATE * row["velocity_up_mps"]
    start = (east - _LEAD * ue, north - _LEAD * un, up - _LEAD * slope)
    items = (
        _item(1, Command.NAV_WAYPOINT, start),
        _item(2, Command.NAV_WAYPOINT, (east, north, up), radius=1.0),
        MissionItem(3, int(Command.NAV_RETURN_TO_LAUNCH), int(Frame.MISSION), (0.0,) * 4, 0.0, 0.0, 0.0),
    )
    points = [_item(k, Command.NAV_RALLY_POINT, point, 3) for k, point in enumerate(rally(flight))]
    lat, lon = (round_to_grid(float(value)) for value in to_geo(jacksboro().origin, *HOME[:2]))
    return Mission(Home(lat, lon, HOME[2]), items, rally=tuple(points), source=f"{flight}.waypoints")


def return_setup(flight: str, **parameters: float) -> FlightSetup:
    """A kept flight's setup with its parameters, and others that are changed."""
    row = KEPT[flight]
    uav = load_uav(jacksboro())
    stated = {
        "RTL_ALTITUDE": float(row["rtl_altitude_m"]),
        "RTL_CLIMB_MIN": float(row["rtl_climb_min_m"]),
        "FLIGHT_OPTIONS": float(row["flight_options"]),
    }
    law = ArduPlane(ArduPilotParameters.load(uav.aircraft, None, "4.6")).with_parameters(**stated | parameters)
    setup = make_setup(jacksboro(), replace(uav, autopilot=law), return_mission(flight), 1)
    return replace(setup, nav="perfect")


@functools.cache
def flown_return(flight: str) -> Flown:
    """A kept flight's return by planfly's law."""
    setup = return_setup(flight)
    done = fly_to_end(Flight(setup, load_uav(jacksboro()).aircraft))
    return _measured(setup, flight, done.track, done.ended)


def _measured(setup: FlightSetup, flight: str, track: Track, ended: str) -> Flown:
    row, target = KEPT[flight], setup.route.rtl_loiter
    assert target is not None
    begin = np.array([float(row["east_m"]), float(row["north_m"])])
    # The first minute holds the way to where it begins.
    first = int(np.argmin(np.hypot(*(track.position[:3600, :2] - begin).T)))
    position, time = track.position[first:], track.time[first:] - track.time[first]
    near = np.flatnonzero(np.hypot(position[:, 0] - target.east, position[:, 1] - target.north) < NEAR)
    stop = int(near[0]) if near.size else len(position)
    way = position[:stop]
    terrain, threats = setup.scenario.terrain, setup.scenario.threats
    assert terrain is not None
    ground = np.array([float(terrain.height(east, north)) for east, north in way[:, :2]])
    kills = np.flatnonzero(threats.kill_radius > 0.0)
    outside = min(
        float((np.linalg.norm(way - threats.position[k], axis=1) - threats.kill_radius[k]).min()) for k in kills
    )
    return Flown(
        setup.route,
        time[:stop],
        way,
        ended == "ground contact" and not near.size,
        float(time[stop]) if near.size else math.nan,
        float((way[:, 2] - ground).min()),
        outside,
        ended,
    )
