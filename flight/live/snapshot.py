"""One moment of a flight as a ground station sees it, packed to pass between processes."""

import math
import struct
from dataclasses import astuple, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.local_map import LocalMap
from flight.simulation.track import TRACK_ROW
from world.frames import GeoOrigin, to_geo
from world.kernels import Record

Floats = NDArray[np.float64]

_FORM = struct.Struct("<21d")


@dataclass(frozen=True, slots=True)
class Moment:
    """Where the aircraft is and what it does; SI and radians, north and east true, heights AMSL.

    height: above ground, NaN where unknown.  energy: Wh used.  leg: the active one, -1 before the start.
    """

    time: float
    lat_deg: float
    lon_deg: float
    amsl: float
    height: float
    v_north: float
    v_east: float
    v_down: float
    roll: float
    pitch: float
    yaw: float
    p: float
    q: float
    r: float
    airspeed: float
    throttle: float
    wind_north: float
    wind_east: float
    current: float
    energy: float
    leg: float

    def pack(self) -> bytes:
        """Give the moment as bytes of one size."""
        return _FORM.pack(*astuple(self))

    @staticmethod
    def unpack(data: bytes) -> "Moment":
        """Read what `pack` gave.  Raises struct.error for another size."""
        return Moment(*_FORM.unpack(data))

    @property
    def finite(self) -> bool:
        """Whether it can be told to a station: a flight may end in numbers that are none."""
        return all(math.isfinite(value) for value in astuple(replace(self, height=0.0)))


class Watcher:
    """Makes moments of the rows of one flight, of `flight.simulation.track.TRACK_ROW`."""

    def __init__(self, setup: FlightSetup) -> None:
        self._origin: GeoOrigin = setup.scenario.origin
        self._map = LocalMap.around(setup)

    def moment(self, row: Record) -> Moment:
        """Moment of a row, a record of `flight.simulation.track.TRACK_ROW`."""
        east, north, amsl = (float(value) for value in row.position)
        lat, lon = (float(value) for value in to_geo(self._origin, east, north))
        # A map course is the true course and this.
        turn = self._map.convergence(lat, lon) if math.isfinite(lat) and math.isfinite(lon) else 0.0
        v_east, v_north, v_up = _turned(row.velocity, turn)
        wind_east, wind_north, _ = _turned(row.wind, turn)
        roll, pitch, yaw = (float(value) for value in row.attitude)
        p, q, r = (float(value) for value in row.rates)
        return Moment(
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
            throttle=float(row.controls[3]),
            wind_north=wind_north,
            wind_east=wind_east,
            current=float(row.current),
            energy=float(row.energy),
            leg=float(row.leg),
        )

    def before_start(self, setup: FlightSetup) -> Moment:
        """Moment of an aircraft that waits at the route's start."""
        points = setup.route.waypoints
        step = points[1] - points[0]
        row: Record = np.zeros(1, TRACK_ROW)[0]
        row.position = points[0]
        row.attitude[2] = math.atan2(step[0], step[1])
        terrain = setup.scenario.terrain
        row.clearance = (
            math.nan if terrain is None else points[0, 2] - float(terrain.height(points[0, 0], points[0, 1]))
        )
        row.leg = -1.0
        return self.moment(row)


def _turned(vector: Floats, turn: float) -> tuple[float, float, float]:
    """East, north and up on the map as true east, north and up."""
    east, north, up = (float(value) for value in vector)
    cos, sin = math.cos(turn), math.sin(turn)
    return east * cos - north * sin, north * cos + east * sin, up


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)
