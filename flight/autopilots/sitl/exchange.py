"""Exchange data with an autopilot in lockstep.

The autopilot sends its outputs to the controls, and receives the aircraft's motion.
"""

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
# Timeout for new data from an autopilot, s by the clock.
SILENCE_TIMEOUT_S = 10.0

# Metres per degree of latitude in ArduPilot, which uses a spherical Earth.
METRES_PER_DEGREE = 111318.845
_METRES_PER_RADIAN = math.degrees(METRES_PER_DEGREE)


class BodyMotion(NamedTuple):
    """Motion of the aircraft, from which the autopilot's simulated sensors are computed.

    time: time since the start of the exchange, s.
    roll_rate..yaw_rate: rad/s about the body's axes.
    force_x..force_z: specific force along the body's axes, m/s^2; at rest 0, 0, -9.81.
    north, east, down: position relative to the home of the exchange, m, by ArduPilot's spherical Earth.
    roll, pitch, yaw: rad, from true north.
    velocity_*: m/s over the ground.
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
    """Return the north and east distances (m) between two positions on ArduPilot's spherical Earth.

    lat, lon: the position, rad.
    from_lat, from_lon: the position from which the offset is measured, rad.

    >>> north, east = offset_on_sphere(math.radians(36.01), -1.5, math.radians(36.0), -1.5)
    >>> round(north, 3), east
    (1113.188, 0.0)
    """
    east = math.remainder(lon - from_lon, 2.0 * math.pi) * math.cos(0.5 * (lat + from_lat))
    return (lat - from_lat) * _METRES_PER_RADIAN, east * _METRES_PER_RADIAN


def position_on_sphere(north: float, east: float, from_lat: float, from_lon: float) -> tuple[float, float]:
    """Return the latitude and longitude (rad) at a distance north and east of a position.

    This inverts `offset_on_sphere`.

    north, east: distances, m.
    from_lat, from_lon: the position from which the offset is measured, rad.

    >>> position = position_on_sphere(*offset_on_sphere(0.63, -1.49, 0.62, -1.5), 0.62, -1.5)
    >>> [round(angle, 12) for angle in position]
    [0.63, -1.49]
    """
    lat = from_lat + north / _METRES_PER_RADIAN
    return lat, from_lon + east / (_METRES_PER_RADIAN * math.cos(0.5 * (lat + from_lat)))


# ----------------------------------------------------------------------
# The rail on which an autopilot's flight starts: a rail in the air, or the rail of a launch.
#
# The autopilot's estimator has to settle with the aircraft at rest. The aircraft therefore stands on a level rail, at
# the attitude of trimmed flight, until the autopilot is ready. Then the aircraft is accelerated along the rail to the
# speed of trimmed flight, and released. For a take-off the rail is the catapult or the throwing hand, with its incline
# and acceleration; on a runway the aircraft stands at the start of its take-off run.

# Acceleration along the rail, m/s^2.
PUSH_ACCELERATION_MPS2 = 5.0
# Mean radius of the Earth.
_EARTH_RADIUS_M = 6_371_000.0


@dataclass(frozen=True, slots=True)
class RailEnd:
    """End of the rail along which the aircraft is accelerated, and its motion there.

    The motion is trimmed level flight, or a launch.

    lat, lon: rad.
    amsl: m.
    roll, pitch, yaw: rad.
    course: course of the rail, rad.
    ground_speed: m/s.
    wind_north, wind_east: m/s.
    incline: slope of the rail above level, rad.
    push_acceleration: acceleration along the rail, m/s^2.
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
    push_acceleration: float = PUSH_ACCELERATION_MPS2

    @property
    def push_time(self) -> float:
        """Duration of the push, s."""
        return self.ground_speed / (math.cos(self.incline) * self.push_acceleration)


def rail_end(state: Record, wind: tuple[float, float, float]) -> RailEnd:
    """Return the end of a level rail that accelerates the aircraft to its trimmed flight.

    state: state of the trimmed flight, a record of `flight.dynamics.state.STATE`.
    wind: mean wind north, east and down, m/s.
    """
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


def motion_on_rail(
    end: RailEnd, time: float, time_since_launch: float, origin: tuple[float, float, float]
) -> BodyMotion:
    """Return the aircraft's motion on the launch rail, along which it accelerates uniformly.

    time: time since the start of the exchange, s.
    time_since_launch: time since the acceleration began, s; at 0 or less the aircraft rests at the start of the rail,
        and after `end.push_time` it stays at the end of the rail.
    origin: latitude and longitude (rad) and altitude (m) from which positions are measured.
    """
    time_on_rail = min(max(0.0, time_since_launch), end.push_time)
    cos_incline, sin_incline = math.cos(end.incline), math.sin(end.incline)
    direction_north, direction_east = cos_incline * math.cos(end.course), cos_incline * math.sin(end.course)
    acceleration = end.push_acceleration if 0.0 < time_on_rail < end.push_time else 0.0
    speed = end.push_acceleration * time_on_rail
    remaining_distance = 0.5 * end.push_acceleration * (end.push_time**2 - time_on_rail**2)
    lat = end.lat - remaining_distance * direction_north / _EARTH_RADIUS_M
    lon = end.lon - remaining_distance * direction_east / (_EARTH_RADIUS_M * math.cos(end.lat))
    north, east = offset_on_sphere(lat, lon, origin[0], origin[1])
    velocity_north, velocity_east, velocity_down = speed * direction_north, speed * direction_east, -speed * sin_incline
    specific_force = (
        acceleration * direction_north,
        acceleration * direction_east,
        -acceleration * sin_incline - GRAVITY,
    )
    force = to_body_axes((end.roll, end.pitch, end.yaw), specific_force)
    airspeed = math.hypot(velocity_north - end.wind_north, velocity_east - end.wind_east, velocity_down)
    return BodyMotion(
        time,
        0.0,
        0.0,
        0.0,
        *force,
        north,
        east,
        origin[2] - end.amsl + remaining_distance * sin_incline,
        end.roll,
        end.pitch,
        end.yaw,
        velocity_north,
        velocity_east,
        velocity_down,
        airspeed,
    )


def to_body_axes(
    attitude: tuple[float, float, float], vector: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Convert a vector from north, east and down to the body axes of an aircraft.

    attitude: roll, pitch and yaw, rad.

    >>> [round(value, 3) for value in to_body_axes((0.0, 0.0, math.pi / 2), (1.0, 0.0, 9.8))]
    [0.0, -1.0, 9.8]
    """
    (roll, pitch, yaw), (north, east, down) = attitude, vector
    cos, sin = math.cos(yaw), math.sin(yaw)
    forward, right = cos * north + sin * east, cos * east - sin * north
    cos, sin = math.cos(pitch), math.sin(pitch)
    body_x, level_down = cos * forward - sin * down, sin * forward + cos * down
    cos, sin = math.cos(roll), math.sin(roll)
    return body_x, cos * right + sin * level_down, cos * level_down - sin * right


# ----------------------------------------------------------------------

# Frame rate of JSBSim and of the autopilot's simulated sensors, Hz: one frame is one step.
FRAME_HZ = 120.0
# Frames between two polls of the MAVLink connection: a tenth of a second.
POLL_INTERVAL_FRAMES = 12
_MOTION_FIELDS = (
    *("latitude", "longitude", "amsl", "velocity_north", "velocity_east", "velocity_down", "roll", "pitch", "yaw"),
    *("roll_rate", "pitch_rate", "yaw_rate", "airspeed"),
)
_NO_ERROR = (0.0,) * 6


class Lockstep(ABC):
    """One aircraft's exchange with an autopilot, frame by frame.

    home: origin of the positions that the autopilot receives.
    poll: function that reads the MAVLink messages; called every `POLL_INTERVAL_FRAMES` frames.
    time: time since the start of the exchange, s.
    error: GNSS error (6,): north, east, up of the position, m, and north, east, up of the velocity, m/s.
    """

    def __init__(self, fdm: Fdm, workspace: Workspace, home: Home, poll: Callable[[], None]) -> None:
        self._fdm, self._workspace = fdm, workspace
        self._home = (math.radians(home.lat_deg), math.radians(home.lon_deg), home.alt)
        self._poll = poll
        self._frame = 0
        self.error = _NO_ERROR
        access = fdm.loop_access()
        self._access: LoopAccess = access
        # An aircraft that burns fuel has no battery voltage.
        self._volts = fdm.aircraft.battery_voltage
        self._current = access.getters["current"], float(access.factors["current"][0])
        self._motion = [(access.getters[name], float(access.factors[name][0])) for name in _MOTION_FIELDS]

    @property
    def time(self) -> float:
        """Time since the start of the exchange, s."""
        return self._frame / FRAME_HZ

    @abstractmethod
    def _next_commands(self) -> Commands:
        """Return the commands of the autopilot for the next frame; wait for them if necessary.

        Raises FlightError if the program ends or stops answering.
        """

    @abstractmethod
    def _send_motion(self, motion: tuple[float, ...], battery: tuple[float, float] | None) -> None:
        """Send the motion of the aircraft after the present frame.

        motion: numbers of a `BodyMotion`.
        battery: volts and amperes; None for an aircraft without a battery.
        """

    def step_on_rail(self, rail: RailEnd, time_since_launch: float = 0.0) -> None:
        """Run one frame with the aircraft on the rail, ``time_since_launch`` s after the acceleration began."""
        self._workspace.commands[:] = self._next_commands()
        motion = motion_on_rail(rail, self._start_frame(), time_since_launch, self._home)
        north, east, up, velocity_north, velocity_east, velocity_up = self.error
        self._send_motion(
            motion._replace(
                north=motion.north + north,
                east=motion.east + east,
                down=motion.down - up,
                velocity_north=motion.velocity_north + velocity_north,
                velocity_east=motion.velocity_east + velocity_east,
                velocity_down=motion.velocity_down - velocity_up,
            ),
            (self._volts, 0.0) if self._volts else None,
        )

    def step(self) -> None:
        """Step JSBSim by one frame with the present controls, and send the motion to the autopilot."""
        self._access.run()
        lat, lon, amsl, velocity_north, velocity_east, velocity_down, roll, pitch, yaw, p, q, r, airspeed = [
            get() * factor for get, factor in self._motion
        ]
        home_lat, home_lon, home_amsl = self._home
        north, east = offset_on_sphere(lat, lon, home_lat, home_lon)
        error_north, error_east, error_up, error_velocity_north, error_velocity_east, error_velocity_up = self.error
        current, current_factor = self._current
        self._send_motion(
            (
                *(self._start_frame(), p, q, r, *self._fdm.specific_force()),
                *(north + error_north, east + error_east, home_amsl - amsl - error_up),
                *(
                    roll,
                    pitch,
                    yaw,
                    velocity_north + error_velocity_north,
                    velocity_east + error_velocity_east,
                    velocity_down - error_velocity_up,
                    airspeed,
                ),
            ),
            # The battery's voltage is constant.
            (self._volts, current() * current_factor) if self._volts else None,
        )

    def make_loop(self, tick: Callable[[], int], steps: int, *, gusts: bool, ground: bool) -> Callable[[int], int]:
        """Return a function that flies up to a number of ticks, and returns the end code or 0.

        `flight.simulation.simulate.RunningFlight` uses it like the compiled loop of a control law.

        tick: `flight.autopilots.sitl.flight.autopilot_tick` on the workspace.
        steps: number of frames in a tick.
        gusts, ground: True to set the tick's gusts and ground in JSBSim.
        """
        workspace = self._workspace
        fdm = self._fdm
        next_commands = self._next_commands
        step = self.step
        getters = [self._access.getters[field] for field in READ_FIELDS]
        pack: Callable[..., None] = struct.Struct(f"{len(READ_FIELDS)}d").pack_into
        pack_commands: Callable[..., None] = struct.Struct("4d").pack_into
        readings, commands_array, output = workspace.readings, workspace.commands, workspace.output.tolist
        *_, set_north, set_east, set_down, set_ground = self._access.setters

        def fly(count: int) -> int:
            """Fly up to ``count`` ticks, and return the end code, or 0."""
            for _ in range(count):
                # Read while the autopilot computes its answer, which does not depend on these values.
                pack(readings, 0, *[getter() for getter in getters])
                commands = next_commands()
                pack_commands(commands_array, 0, *commands)
                if status := tick():
                    return status
                *_, north, east, down, terrain_altitude = output()
                if gusts:
                    set_north(north)
                    set_east(east)
                    set_down(down)
                if ground:
                    set_ground(terrain_altitude)
                fdm.write(commands)
                step()
                for _ in range(steps - 1):
                    fdm.write(next_commands())
                    step()
            return 0

        return fly

    def answer_frame(self) -> None:
        """Answer one more frame of a program that is ending: apply its commands, and send the motion to it."""
        self._fdm.write(self._next_commands())
        self.step()

    def _start_frame(self) -> float:
        """Start the next frame, and return its time since the start of the exchange, s.

        The MAVLink connection is polled in every `POLL_INTERVAL_FRAMES`th frame.
        """
        self._frame += 1
        if self._frame % POLL_INTERVAL_FRAMES == 0:
            self._poll()
        return self._frame / FRAME_HZ
