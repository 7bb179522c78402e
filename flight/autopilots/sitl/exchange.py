"""The exchange with an autopilot in lockstep: its outputs move the controls, and it is told what came of it."""

import math
import struct
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from aircraft.envelope import GRAVITY
from flight.dynamics.fdm import Fdm, LoopAccess
from flight.dynamics.state import Commands
from flight.mission.items import Home
from flight.simulation.tick import READ_FIELDS, Workspace
from world.kernels import Record

LOOPBACK = "127.0.0.1"
# An autopilot that sends nothing new for so long (s, by the clock) has failed.
SILENCE = 10.0

# Metres that ArduPilot counts for a degree of latitude: it knows the Earth as a sphere.
METRES_A_DEGREE = 111318.845
_METRES_A_RADIAN = math.degrees(METRES_A_DEGREE)


class BodyMotion(NamedTuple):
    """The aircraft as the autopilot's sensors are to measure it.

    time: s.  roll_rate..yaw_rate: rad/s about the body's axes.
    force_x..force_z: specific force along the body's axes, m/s^2; at rest 0, 0, -9.81.
    north, east, down: m from the place that ArduPilot calls home, on its sphere.
    roll, pitch, yaw: rad, from true north.  velocity_*: m/s over the ground.
    airspeed: m/s, true.
    """

    time: float
    roll_rate: float
    pitch_rate: float
    yaw_rate: float
    force_x: float
    force_y: float
    force_z: float
    north: float
    east: float
    down: float
    roll: float
    pitch: float
    yaw: float
    velocity_north: float
    velocity_east: float
    velocity_down: float
    airspeed: float


def offset_on_sphere(lat: float, lon: float, from_lat: float, from_lon: float) -> tuple[float, float]:
    """North and east (m) of a position from another, all in rad, as ArduPilot takes it back to degrees.

    >>> north, east = offset_on_sphere(math.radians(36.01), -1.5, math.radians(36.0), -1.5)
    >>> round(north, 3), east
    (1113.188, 0.0)
    """
    east = math.remainder(lon - from_lon, 2.0 * math.pi) * math.cos(0.5 * (lat + from_lat))
    return (lat - from_lat) * _METRES_A_RADIAN, east * _METRES_A_RADIAN


def place_on_sphere(north: float, east: float, from_lat: float, from_lon: float) -> tuple[float, float]:
    """The position (rad) that `offset_on_sphere` gives this offset (m) from another (rad).

    >>> place = place_on_sphere(*offset_on_sphere(0.63, -1.49, 0.62, -1.5), 0.62, -1.5)
    >>> [round(angle, 12) for angle in place]
    [0.63, -1.49]
    """
    lat = from_lat + north / _METRES_A_RADIAN
    return lat, from_lon + east / (_METRES_A_RADIAN * math.cos(0.5 * (lat + from_lat)))


# ----------------------------------------------------------------------
# The rail that an autopilot's flight starts on, before the aircraft flies by itself: in the air, or a launch's.
#
# The autopilot's estimator has to settle with the aircraft at rest, and no aircraft rests in the air.  So it stands on
# a rail, level, at the attitude of its trimmed flight, until the autopilot is ready; then it is pushed along the rail
# to the speed of that flight, and let go.  From the ground the rail is that of the catapult or the throwing hand, as
# steep and as quick as it is; on a runway the aircraft stands where it begins.

# Along the rail, m/s^2.
PUSH = 5.0
_EARTH = 6_371_000.0


@dataclass(frozen=True, slots=True)
class RailEnd:
    """Where the rail ends, and how the aircraft leaves it: in a trimmed flight, level over the ground, or launched.

    lat, lon: rad.  amsl: m.  roll, pitch, yaw: rad.  course: of the rail, rad.  ground_speed: m/s.
    wind_north, wind_east: m/s.  incline: of the rail above level, rad.  push: along it, m/s^2.
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
    incline: float = 0.0
    push: float = PUSH

    @property
    def push_time(self) -> float:
        """How long the push takes, s."""
        return self.ground_speed / (math.cos(self.incline) * self.push)


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
    level, steep = math.cos(end.incline), math.sin(end.incline)
    along_north, along_east = level * math.cos(end.course), level * math.sin(end.course)
    push = end.push if 0.0 < pushed < end.push_time else 0.0
    speed = end.push * pushed
    left = 0.5 * end.push * (end.push_time**2 - pushed**2)
    lat = end.lat - left * along_north / _EARTH
    lon = end.lon - left * along_east / (_EARTH * math.cos(end.lat))
    north, east = offset_on_sphere(lat, lon, origin[0], origin[1])
    velocity_north, velocity_east, velocity_down = speed * along_north, speed * along_east, -speed * steep
    felt = (push * along_north, push * along_east, -push * steep - GRAVITY)
    force = to_body((end.roll, end.pitch, end.yaw), felt)
    airspeed = math.hypot(velocity_north - end.wind_north, velocity_east - end.wind_east, velocity_down)
    return BodyMotion(
        time, 0.0, 0.0, 0.0, *force, north, east, origin[2] - end.amsl + left * steep,
        end.roll, end.pitch, end.yaw, velocity_north, velocity_east, velocity_down, airspeed,
    )  # fmt: skip


def to_body(attitude: tuple[float, float, float], vector: tuple[float, float, float]) -> tuple[float, float, float]:
    """A vector north, east, down in the axes of a body: turned by yaw, then pitch, then roll.

    attitude: roll, pitch and yaw, rad.

    >>> [round(value, 3) for value in to_body((0.0, 0.0, math.pi / 2), (1.0, 0.0, 9.8))]
    [0.0, -1.0, 9.8]
    """
    (roll, pitch, yaw), (north, east, down) = attitude, vector
    cos, sin = math.cos(yaw), math.sin(yaw)
    ahead, right = cos * north + sin * east, cos * east - sin * north
    cos, sin = math.cos(pitch), math.sin(pitch)
    x, below = cos * ahead - sin * down, sin * ahead + cos * down
    cos, sin = math.cos(roll), math.sin(roll)
    return x, cos * right + sin * below, cos * below - sin * right


# ----------------------------------------------------------------------

# Of JSBSim and of the autopilot's simulated sensors: one frame is one step.
FRAME_HZ = 120.0
# Frames from one look at the link to the next: a tenth of a second.
LOOK_FRAMES = 12
_MOTION = (
    *("latitude", "longitude", "amsl", "velocity_north", "velocity_east", "velocity_down", "roll", "pitch", "yaw"),
    *("roll_rate", "pitch_rate", "yaw_rate", "airspeed"),
)
_NO_ERROR = (0.0,) * 6


class Lockstep(ABC):
    """One aircraft's exchange with an autopilot, frame by frame.

    home: what positions count from.
    look: called every `LOOK_FRAMES` frames.
    time: of the exchange, s.
    error: what its satellites mistake, m and m/s: north, east, up, and the same of the velocity.
    """

    def __init__(self, fdm: Fdm, workspace: Workspace, home: Home, look: Callable[[], None]) -> None:
        self._fdm, self._workspace = fdm, workspace
        self._home = (math.radians(home.lat_deg), math.radians(home.lon_deg), home.alt)
        self._look = look
        self._frame = 0
        self.error = _NO_ERROR
        access = fdm.loop_access()
        self._access: LoopAccess = access
        # An aircraft that burns fuel has no volts.
        self._volts = fdm.aircraft.battery_voltage
        self._current = access.getters["current"], float(access.factors["current"][0])
        self._motion = [(access.getters[name], float(access.factors[name][0])) for name in _MOTION]

    @property
    def time(self) -> float:
        """Time of the exchange, s."""
        return self._frame / FRAME_HZ

    @abstractmethod
    def _take(self) -> Commands:
        """Wait for what it asks for of the next frame.  Raises FlightError for a program that ends or falls silent."""

    @abstractmethod
    def _tell(self, motion: tuple[float, ...], battery: tuple[float, float] | None) -> None:
        """Tell it of the aircraft after that frame.

        motion: the numbers of a `BodyMotion`.  battery: volts and amperes, None for an aircraft without one.
        """

    def _battery(self) -> tuple[float, float] | None:
        """Volts and amperes of the battery; its volts stay what they are."""
        if not self._volts:
            return None
        current, factor = self._current
        return self._volts, current() * factor

    def hold(self, rail: RailEnd, pushed: float = 0.0) -> None:
        """One frame on the rail, ``pushed`` s after the push began."""
        self._workspace.commands[:] = self._take()
        motion = motion_on_rail(rail, self._next_time(), pushed, self._home)
        north, east, up, v_north, v_east, v_up = self.error
        self._tell(
            motion._replace(
                north=motion.north + north,
                east=motion.east + east,
                down=motion.down - up,
                velocity_north=motion.velocity_north + v_north,
                velocity_east=motion.velocity_east + v_east,
                velocity_down=motion.velocity_down - v_up,
            ),
            (self._volts, 0.0) if self._volts else None,
        )

    def step(self) -> None:
        """One frame of flight on the controls that are set: JSBSim steps, and the autopilot is told."""
        self._access.run()
        lat, lon, amsl, vn, ve, vd, roll, pitch, yaw, p, q, r, airspeed = [
            get() * factor for get, factor in self._motion
        ]
        home_lat, home_lon, home_amsl = self._home
        north, east = offset_on_sphere(lat, lon, home_lat, home_lon)
        dn, de, du, dvn, dve, dvu = self.error
        self._tell(
            (
                *(self._next_time(), p, q, r, *self._fdm.specific_force()),
                *(north + dn, east + de, home_amsl - amsl - du),
                *(roll, pitch, yaw, vn + dvn, ve + dve, vd - dvu, airspeed),
            ),
            self._battery(),
        )

    def make_loop(self, tick: Callable[[], int], steps: int, *, gusts: bool, ground: bool) -> Callable[[int], int]:
        """Make what flies up to a number of ticks and returns the last status, as `flight.simulation.simulate` does.

        tick: `flight.autopilots.sitl.flight.autopilot_tick` on the workspace.  steps: frames of a tick.
        gusts, ground: whether the tick's are set in JSBSim.
        """
        space, fdm, take, step = self._workspace, self._fdm, self._take, self.step
        read = [self._access.getters[field] for field in READ_FIELDS]
        pack: Callable[..., None] = struct.Struct(f"{len(READ_FIELDS)}d").pack_into
        pack_commands: Callable[..., None] = struct.Struct("4d").pack_into
        readings, asked, output = space.readings, space.commands, space.output.tolist
        *_, set_north, set_east, set_down, set_ground = self._access.setters

        def fly(count: int) -> int:
            for _ in range(count):
                # Taken while the autopilot computes its answer, which they do not depend on.
                pack(readings, 0, *[getter() for getter in read])
                commands = take()
                pack_commands(asked, 0, *commands)
                if status := tick():
                    return status
                *_, north, east, down, under = output()
                if gusts:
                    set_north(north)
                    set_east(east)
                    set_down(down)
                if ground:
                    set_ground(under)
                fdm.write(commands)
                step()
                for _ in range(steps - 1):
                    fdm.write(take())
                    step()
            return 0

        return fly

    def serve(self) -> None:
        """Answer one more frame, with the controls as the autopilot asks."""
        self._fdm.write(self._take())
        self.step()

    def _next_time(self) -> float:
        self._frame += 1
        if self._frame % LOOK_FRAMES == 0:
            self._look()
        return self._frame / FRAME_HZ
