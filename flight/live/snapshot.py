"""State snapshot of a flight for ground stations, packed to pass between processes."""

import math
import struct
from dataclasses import astuple, dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.local_map import LocalMap
from flight.simulation.track import THROTTLE, TRACK_ROW
from world.frames import GeoOrigin, to_geo
from world.kernels import Record

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Where the aircraft is and what it does at one time; SI and radians, north and east true, heights AMSL.

    height: above ground, NaN where unknown.  v_north, v_east, v_down: over the ground.  p, q, r: body rates.
    throttle: 0..1.  wind_north, wind_east: the way the air moves.  current: A.  energy: Wh used.  leg: the active one,
    -1 before the start.
    """

    time: float
    lat_deg: float
    lon_deg: float
    amsl: float
    height: float
    v_north: float = 0.0
    v_east: float = 0.0
    v_down: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    p: float = 0.0
    q: float = 0.0
    r: float = 0.0
    airspeed: float = 0.0
    throttle: float = 0.0
    wind_north: float = 0.0
    wind_east: float = 0.0
    current: float = 0.0
    energy: float = 0.0
    leg: float = -1.0

    def pack(self) -> bytes:
        """Bytes of the snapshot, always as many.

        >>> parked = Snapshot(time=0.0, lat_deg=46.0, lon_deg=8.0, amsl=500.0, height=100.0)
        >>> Snapshot.unpack(parked.pack()) == parked
        True
        """
        return _FORM.pack(*astuple(self))

    @staticmethod
    def unpack(data: bytes) -> "Snapshot":
        """Snapshot of the bytes that `pack` gave.  Raises struct.error for another number of bytes."""
        return Snapshot(*_FORM.unpack(data))

    @property
    def finite(self) -> bool:
        """Whether it can be sent to a station: a flight may end in numbers that are none."""
        return all(math.isfinite(value) for value in astuple(replace(self, height=0.0)))


_FORM = struct.Struct(f"<{len(fields(Snapshot))}d")


class SnapshotMaker:
    """Makes snapshots of the rows of one flight.

    Positions become latitude and longitude, and vectors and courses on the map become true ones.

    local_map: around the setup's flight.
    """

    def __init__(self, setup: FlightSetup, local_map: LocalMap) -> None:
        self._origin: GeoOrigin = setup.scenario.origin
        self._map = local_map

    def before_start(self, setup: FlightSetup) -> Snapshot:
        """Snapshot of an aircraft that waits at the route's start, on the course of its first leg."""
        points = setup.route.waypoints
        step = points[1] - points[0]
        terrain = setup.scenario.terrain
        ground = math.nan if terrain is None else float(terrain.height(points[0, 0], points[0, 1]))
        row: Record = np.zeros(1, TRACK_ROW)[0]
        row.position = points[0]
        row.attitude[2] = math.atan2(step[0], step[1])
        row.clearance = points[0, 2] - ground
        row.leg = -1.0
        return self.snapshot(row)

    def snapshot(self, row: Record) -> Snapshot:
        """Snapshot of a flown row, a record of `flight.simulation.track.TRACK_ROW`."""
        east, north, amsl = (float(value) for value in row.position)
        lat, lon = (float(value) for value in to_geo(self._origin, east, north))
        # A map course is the true course and this.
        turn = self._map.convergence(lat, lon) if math.isfinite(lat) and math.isfinite(lon) else 0.0
        v_east, v_north, v_up = _turned(row.velocity, turn)
        wind_east, wind_north, _ = _turned(row.wind, turn)
        roll, pitch, yaw = (float(value) for value in row.attitude)
        p, q, r = (float(value) for value in row.rates)
        return Snapshot(
            time=float(row.time),
            lat_deg=lat,
            lon_deg=lon,
            amsl=amsl,
            height=float(row.clearance),
            v_north=v_north,
            v_east=v_east,
            v_down=-v_up,
            roll=roll,
            pitch=pitch,
            yaw=_wrapped(yaw - turn),
            p=p,
            q=q,
            r=r,
            airspeed=float(row.airspeed),
            throttle=float(row.controls[THROTTLE]),
            wind_north=wind_north,
            wind_east=wind_east,
            current=float(row.current),
            energy=float(row.energy),
            leg=float(row.leg),
        )


def _turned(vector: Floats, turn: float) -> tuple[float, float, float]:
    """East, north and up on the map as true east, north and up."""
    east, north, up = (float(value) for value in vector)
    cos, sin = math.cos(turn), math.sin(turn)
    return east * cos - north * sin, north * cos + east * sin, up


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)
