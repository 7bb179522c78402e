"""The rail in the air that an autopilot's flight starts on, before the aircraft flies by itself.

The autopilot's estimator has to settle with the aircraft at rest, and no aircraft rests in the air.  So it stands on a
rail, level, at the attitude of its trimmed flight, until the autopilot is ready; then it is pushed along the rail to
the speed of that flight, and let go.
"""

import math
from dataclasses import dataclass

from aircraft.envelope import GRAVITY
from flight.real_autopilot.json_physics import BodyMotion, offset_on_sphere
from world.kernels import Record

# Along the rail, m/s^2.
PUSH = 5.0
_EARTH = 6_371_000.0


@dataclass(frozen=True, slots=True)
class RailEnd:
    """The trimmed flight that the rail leads to, from level flight over the ground.

    lat, lon: rad.  amsl: m.  roll, pitch, yaw: rad.  course: of the rail, rad.  ground_speed: m/s.
    wind_north, wind_east: m/s.
    """

    lat: float
    lon: float
    amsl: float
    roll: float
    pitch: float
    yaw: float
    course: float
    ground_speed: float
    wind_north: float
    wind_east: float

    @property
    def push_time(self) -> float:
        """How long the push takes, s."""
        return self.ground_speed / PUSH


def rail_end(state: Record, wind: tuple[float, float, float]) -> RailEnd:
    """Rail to a trimmed flight; state: a record of `flight.dynamics.state.STATE`.  wind: north, east, down, m/s."""
    return RailEnd(
        lat=float(state.latitude),
        lon=float(state.longitude),
        amsl=float(state.amsl),
        roll=float(state.roll),
        pitch=float(state.pitch),
        yaw=float(state.yaw),
        course=math.atan2(state.velocity_east, state.velocity_north),
        ground_speed=math.hypot(state.velocity_east, state.velocity_north),
        wind_north=wind[0],
        wind_east=wind[1],
    )


def motion_on_rail(end: RailEnd, time: float, pushed: float, origin: tuple[float, float, float]) -> BodyMotion:
    """How the aircraft moves, ``pushed`` s after the push began (0 or less: at rest), at ``time`` s of the exchange.

    origin: latitude and longitude (rad) and height (m) that positions count from.
    """
    pushed = min(max(0.0, pushed), end.push_time)
    along_north, along_east = math.cos(end.course), math.sin(end.course)
    push = PUSH if 0.0 < pushed < end.push_time else 0.0
    speed = PUSH * pushed
    left = 0.5 * PUSH * (end.push_time**2 - pushed**2)
    lat = end.lat - left * along_north / _EARTH
    lon = end.lon - left * along_east / (_EARTH * math.cos(end.lat))
    north, east = offset_on_sphere(lat, lon, origin[0], origin[1])
    velocity_north, velocity_east = speed * along_north, speed * along_east
    force = _to_body(end, push * along_north, push * along_east, -GRAVITY)
    airspeed = math.hypot(velocity_north - end.wind_north, velocity_east - end.wind_east)
    return BodyMotion(
        time, 0.0, 0.0, 0.0, *force, north, east, origin[2] - end.amsl,
        end.roll, end.pitch, end.yaw, velocity_north, velocity_east, 0.0, airspeed,
    )  # fmt: skip


def _to_body(end: RailEnd, north: float, east: float, down: float) -> tuple[float, float, float]:
    """A vector in the body's axes: turned by yaw, then pitch, then roll."""
    cos, sin = math.cos(end.yaw), math.sin(end.yaw)
    ahead, right = cos * north + sin * east, cos * east - sin * north
    cos, sin = math.cos(end.pitch), math.sin(end.pitch)
    x, below = cos * ahead - sin * down, sin * ahead + cos * down
    cos, sin = math.cos(end.roll), math.sin(end.roll)
    return x, cos * right + sin * below, cos * below - sin * right
