"""ArduPilot's JSON physics interface in lockstep: packets, the socket, servo outputs as controls, and the exchange."""

import math
import socket
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

from aircraft.catalog import Aircraft
from aircraft.envelope import GRAVITY
from flight.dynamics.fdm import Fdm, LoopAccess
from flight.dynamics.state import Commands
from flight.mission.items import Home
from flight.simulation.tick import READ_FIELDS, Workspace
from world.errors import FlightError
from world.files import read_toml
from world.kernels import Record
from world.running_clock import RunningClock

# ----------------------------------------------------------------------
# ArduPilot's JSON physics interface: the packets that pass between an autopilot and the physics it flies in.
#
# The autopilot sends the state of its servo outputs as a binary datagram, and waits for one JSON object about the
# aircraft a step later; so both keep step.  Published by ArduPilot as "JSON interface" for software in the loop
# (https://github.com/ArduPilot/ardupilot/tree/master/libraries/SITL/examples/JSON).

# The first number of a packet, by how many outputs it carries.
MAGIC = {18458: 16, 29569: 32}
_HEAD = struct.Struct("<HHI")
_OUTPUTS = {magic: struct.Struct(f"<HHI{count}H") for magic, count in MAGIC.items()}

# Metres that ArduPilot counts for a degree of latitude: it knows the Earth as a sphere.
METRES_A_DEGREE = 111318.845
_METRES_A_RADIAN = math.degrees(METRES_A_DEGREE)

# The parser looks for each key as it stands here: no blanks.
_ANSWER = (
    b'\n{"timestamp":%.6f,"imu":{"gyro":[%.7f,%.7f,%.7f],"accel_body":[%.6f,%.6f,%.6f]},'
    b'"position":[%.4f,%.4f,%.4f],"attitude":[%.7f,%.7f,%.7f],"velocity":[%.5f,%.5f,%.5f],"airspeed":%.5f'
)
_BATTERY = b',"battery":{"voltage":%.3f,"current":%.4f}'
_END = b"}\n"


class ServoPacket(NamedTuple):
    """What the autopilot asks for: the number of its frame, and the pulse of each output, microseconds."""

    frame: int
    pulses: tuple[int, ...]


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


def parse_servo_packet(data: bytes) -> ServoPacket:
    """The servo outputs in a datagram.  Raises FlightError for one of another version of the interface.

    >>> packet = parse_servo_packet(struct.pack("<HHI16H", 18458, 120, 7, *range(1500, 1516)))
    >>> packet.frame, packet.pulses[:2], len(packet.pulses)
    (7, (1500, 1501), 16)
    """
    magic = int.from_bytes(data[:2], "little")
    form = _OUTPUTS.get(magic)
    if form is None or len(data) != form.size:
        allowed = " or ".join(f"{known} with {count} outputs" for known, count in MAGIC.items())
        raise FlightError(
            f"speaks another version of the physics interface: a packet of {len(data)} bytes that begins with {magic};"
            f" allowed: {allowed}",
            field="packet", value=magic, allowed=allowed,
        )  # fmt: skip
    numbers = form.unpack(data)
    return ServoPacket(numbers[2], numbers[3:])


def encode_motion(motion: BodyMotion | tuple[float, ...], battery: tuple[float, float] | None = None) -> bytes:
    r"""The datagram that tells the autopilot how the aircraft moves.

    battery: its volts and amperes; None for an aircraft without one.

    >>> encode_motion(BodyMotion(0.5, *[0.0] * 5, -9.81, *[0.0] * 9, 25.0))[:44]
    b'\n{"timestamp":0.500000,"imu":{"gyro":[0.0000'
    """
    return _ANSWER % motion + (b"" if battery is None else _BATTERY % battery) + _END


def offset_on_sphere(lat: float, lon: float, from_lat: float, from_lon: float) -> tuple[float, float]:
    """North and east (m) of a position from another, all in rad, as ArduPilot takes it back to degrees.

    >>> north, east = offset_on_sphere(math.radians(36.01), -1.5, math.radians(36.0), -1.5)
    >>> round(north, 3), east
    (1113.188, 0.0)
    """
    east = math.remainder(lon - from_lon, 2.0 * math.pi) * math.cos(0.5 * (lat + from_lat))
    return (lat - from_lat) * _METRES_A_RADIAN, east * _METRES_A_RADIAN


# ----------------------------------------------------------------------
# The physics' end of the exchange with an autopilot: a datagram socket on this machine, a frame at a time.

LOOPBACK = "127.0.0.1"
# An autopilot that sends no new frame for so long (s, by the clock) has failed.
SILENCE = 10.0
# How often (s) a wait looks whether the program still runs.
_LOOK = 0.25
_LARGEST = 1024
# A question that comes sooner after the answer (s, by the clock) was asked before it: ArduPilot waits for a second.
_ON_ITS_WAY = 0.1


class PhysicsPort:
    """The socket that an autopilot sends its servo outputs to.

    port: its number.
    watch: called while nothing comes; raises FlightError where the program has ended.

    Nothing is answered unless it was asked for: who asks for a frame again, because it has waited in vain, is told
    again, and the aircraft does not move for it.
    """

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((LOOPBACK, 0))
        self.port = int(self._socket.getsockname()[1])
        # The kernel's own timeout: one system call a frame.
        look = struct.pack("@ll", int(_LOOK), int(_LOOK % 1.0 * 1e6))
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, look)
        self.watch: Callable[[], None] = _nothing
        self._frame = -1
        self._last = b""
        self._answered = 0.0
        # A sleeping laptop is no silence.
        self._clock = RunningClock()
        self._connected = False

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def receive(self) -> ServoPacket:
        """The next frame.

        Raises FlightError for a program that ends, falls silent, begins anew, or speaks another version.
        """
        waiting_since = 0.0
        while True:
            data = self._next_datagram()
            if data:
                packet = parse_servo_packet(data)
                if packet.frame > self._frame:
                    self._frame = packet.frame
                    return packet
                if packet.frame < self._frame:
                    message = f"began anew in the air: frame {packet.frame} after frame {self._frame}"
                    raise FlightError(message, field="frame", value=packet.frame)
                # What was asked while the answer was on its way has had it.
                if self._clock() - self._answered > _ON_ITS_WAY:
                    self._send(self._last)
            now = self._clock()
            waiting_since = waiting_since or now
            self.watch()
            if now - waiting_since > SILENCE:
                if data:
                    raise FlightError(
                        f"does not understand the physics it is sent: asked for frame {self._frame} again for"
                        f" {SILENCE:.0f} s (another version of the interface?)",
                        field="frame", value=self._frame,
                    )  # fmt: skip
                raise FlightError(f"silent for {SILENCE:.0f} s; ended", field="frame", value=self._frame)

    def answer(self, data: bytes) -> None:
        """Tell the autopilot of the aircraft after the frame received last."""
        self._last = data
        self._answered = self._clock()
        self._send(data)

    def _next_datagram(self) -> bytes:
        """A datagram, or nothing after `_LOOK` seconds."""
        try:
            if self._connected:
                return self._socket.recv(_LARGEST)
            data, sender = self._socket.recvfrom(_LARGEST)
        except (BlockingIOError, ConnectionRefusedError):
            return b""
        self._socket.connect(sender)
        self._connected = True
        return data

    def _send(self, data: bytes) -> None:
        if not data:
            return
        try:
            self._socket.send(data)
        except ConnectionRefusedError:
            # Nobody is there any more: the next wait finds out why.
            return


def _nothing() -> None:
    """Watch nothing."""


# ----------------------------------------------------------------------
# Which servo output of an autopilot moves what on an aircraft, and how far: its folder's `ardupilot.toml`.

SERVO_FILE = "ardupilot.toml"
# What each control is to ArduPilot: SERVOn_FUNCTION (its parameter reference).
FUNCTIONS = {"elevator": 19, "aileron": 4, "rudder": 21, "throttle": 70}
# Its values carry this unit, and this takes them to SI.
_UNITS = {"elevator": "deg", "aileron": "deg", "rudder": "deg", "throttle": ""}
_SERVO_OUTPUTS = 32


@dataclass(frozen=True, slots=True)
class ServoOutput:
    """One control's servo: the value is linear in the pulse between its knots, and stays beyond them.

    number: of the output, from 1.
    pulses: (k,) microseconds, increasing.
    values: (k,) the control at these pulses: rad as `flight.dynamics.state.Commands` has them, or 0..1 of the throttle.
    """

    number: int
    pulses: tuple[float, ...]
    values: tuple[float, ...]

    @property
    def rest(self) -> float:
        """Pulse in the middle of the throw: of the knot whose value is nearest to zero."""
        return min(zip(self.pulses, self.values, strict=True), key=lambda knot: abs(knot[1]))[0]

    def value(self, pulse: float) -> float:
        """The control at a pulse, microseconds; at rest where there is none (0).

        >>> ServoOutput(2, (1100.0, 1500.0, 1900.0), (0.5, 0.0, -0.5)).value(1700)
        -0.25
        """
        if pulse <= 0.0:
            pulse = self.rest
        pulses, values = self.pulses, self.values
        if pulse <= pulses[0]:
            return values[0]
        for k in range(1, len(pulses)):
            if pulse < pulses[k]:
                share = (pulse - pulses[k - 1]) / (pulses[k] - pulses[k - 1])
                return values[k - 1] + share * (values[k] - values[k - 1])
        return values[-1]


@dataclass(frozen=True, slots=True)
class ServoMap:
    """The servos of the four controls."""

    elevator: ServoOutput
    aileron: ServoOutput
    rudder: ServoOutput
    throttle: ServoOutput

    def commands(self, pulses: Sequence[int]) -> Commands:
        """The controls that an autopilot's pulses (outputs,) ask for, microseconds."""
        elevator, aileron, rudder, throttle = self.elevator, self.aileron, self.rudder, self.throttle
        return Commands(
            elevator.value(pulses[elevator.number - 1]),
            aileron.value(pulses[aileron.number - 1]),
            rudder.value(pulses[rudder.number - 1]),
            throttle.value(pulses[throttle.number - 1]),
        )

    def parameters(self) -> dict[str, float]:
        """ArduPilot's parameters that make its outputs these."""
        found: dict[str, float] = {}
        for name, function in FUNCTIONS.items():
            output: ServoOutput = getattr(self, name)
            prefix = f"SERVO{output.number}_"
            found[f"{prefix}FUNCTION"] = float(function)
            found[f"{prefix}MIN"], found[f"{prefix}MAX"] = output.pulses[0], output.pulses[-1]
            found[f"{prefix}TRIM"] = output.rest
        return found


def load_servo_map(aircraft: Aircraft) -> ServoMap:
    """Read an aircraft's servos.  Raises FlightError, in one line, for a missing, unknown or bad entry.

    >>> from aircraft.catalog import load_aircraft
    >>> servos = load_servo_map(load_aircraft("aerosonde"))
    >>> servos.throttle.number, servos.throttle.value(1500)
    (3, 0.5)
    """
    file = aircraft.folder / SERVO_FILE
    try:
        table = read_toml(file, "servos")
    except OSError as error:
        raise FlightError(
            f"{file}: {error.strerror}: a real autopilot needs to know which servo moves what on {aircraft.name}",
            file=file,
        ) from error
    except ValueError as error:
        raise FlightError(f"{file}: {' '.join(str(error).split())}", file=file) from error
    if set(table) != set(FUNCTIONS):
        raise FlightError(f"{file}: tables {', '.join(sorted(table))}: {', '.join(FUNCTIONS)} are expected", file=file)
    try:
        outputs = {name: _output(name, entry) for name, entry in table.items()}
    except ValueError as error:
        raise FlightError(f"{file}: {error}", file=file) from None
    return ServoMap(**outputs)


def _output(name: str, entry: Any) -> ServoOutput:
    unit = _UNITS[name]
    key = f"value_{unit}" if unit else "value"
    if not isinstance(entry, dict) or set(entry) != {"output", "pulse_us", key}:
        raise ValueError(f"{name}: keys output, pulse_us and {key} are expected")
    number, pulses, values = entry["output"], entry["pulse_us"], entry[key]
    if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number <= _SERVO_OUTPUTS:
        raise ValueError(f"{name}.output = {number!r}: allowed 1..{_SERVO_OUTPUTS}")
    for label, numbers in (("pulse_us", pulses), (key, values)):
        if not (isinstance(numbers, list) and len(numbers) >= 2 and all(map(_is_number, numbers))):
            raise ValueError(f"{name}.{label} = {numbers!r}: two finite numbers or more are expected")
    if len(pulses) != len(values) or any(b <= a for a, b in pairwise(pulses)):
        raise ValueError(f"{name}.pulse_us = {pulses!r}: increasing, and as many as {key}, are expected")
    factor = math.radians(1.0) if unit else 1.0
    return ServoOutput(number, tuple(map(float, pulses)), tuple(factor * value for value in values))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


# ----------------------------------------------------------------------
# The rail in the air that an autopilot's flight starts on, before the aircraft flies by itself.
#
# The autopilot's estimator has to settle with the aircraft at rest, and no aircraft rests in the air.  So it stands on
# a rail, level, at the attitude of its trimmed flight, until the autopilot is ready; then it is pushed along the rail
# to the speed of that flight, and let go.

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


# ----------------------------------------------------------------------
# The exchange with an autopilot in lockstep: its servo outputs move the controls, and it is told what came of it.

# Of JSBSim and of the autopilot's simulated sensors: one frame is one step.
FRAME_HZ = 120.0
# Frames from one look at the link to the next: a tenth of a second.
LOOK_FRAMES = 12
_MOTION = (
    *("latitude", "longitude", "amsl", "velocity_north", "velocity_east", "velocity_down", "roll", "pitch", "yaw"),
    *("roll_rate", "pitch_rate", "yaw_rate", "airspeed"),
)
_NO_ERROR = (0.0,) * 6


class Lockstep:
    """One aircraft's exchange with an autopilot, frame by frame.

    home: what positions count from.
    look: called every `LOOK_FRAMES` frames.
    time: of the exchange, s.
    error: what its satellites mistake, m and m/s: north, east, up, and the same of the velocity.
    """

    def __init__(
        self,
        port: PhysicsPort,
        servos: ServoMap,
        fdm: Fdm,
        workspace: Workspace,
        home: Home,
        look: Callable[[], None],
    ) -> None:
        self._port, self._servos, self._fdm, self._workspace = port, servos, fdm, workspace
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
        self._port.answer(
            encode_motion(
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
        self._port.answer(
            encode_motion(
                (
                    *(self._next_time(), p, q, r, *self._fdm.specific_force()),
                    *(north + dn, east + de, home_amsl - amsl - du),
                    *(roll, pitch, yaw, vn + dvn, ve + dve, vd - dvu, airspeed),
                ),
                self._battery(),
            )
        )

    def make_loop(self, tick: Callable[[], int], steps: int, *, gusts: bool, ground: bool) -> Callable[[int], int]:
        """Make what flies up to a number of ticks and returns the last status, as `flight.simulation.simulate` does.

        tick: `flight.autopilots.arduplane_sitl.flight.autopilot_tick` on the workspace.  steps: frames of a tick.
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
                commands = take()
                pack_commands(asked, 0, *commands)
                pack(readings, 0, *[getter() for getter in read])
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

    def _take(self) -> Commands:
        """Wait for the next frame: the controls that it asks for."""
        return self._servos.commands(self._port.receive().pulses)

    def _next_time(self) -> float:
        self._frame += 1
        if self._frame % LOOK_FRAMES == 0:
            self._look()
        return self._frame / FRAME_HZ
