"""Implement ArduPilot's JSON physics interface in lockstep, with packets, socket and exchange."""

import socket
import struct
from collections.abc import Callable
from typing import NamedTuple

from flight.autopilots.sitl.exchange import LOOPBACK, SILENCE_TIMEOUT_S, BodyMotion, Lockstep
from flight.autopilots.sitl.servos import ServoMap
from flight.dynamics.fdm import Fdm
from flight.dynamics.state import Commands
from flight.mission.items import Home
from flight.simulation.tick import Workspace
from world.errors import FlightError
from world.running_clock import RunningClock

# ----------------------------------------------------------------------
# ArduPilot's JSON physics interface: the packets between an autopilot and its physics.
#
# The autopilot sends its servo outputs as a binary datagram, and waits for one JSON object with the aircraft's motion a
# step later. Published by ArduPilot as "JSON interface" for software in the loop
# (https://github.com/ArduPilot/ardupilot/tree/master/libraries/SITL/examples/JSON).

# Number of outputs by the first number of a packet.
MAGIC = {18458: 16, 29569: 32}
_HEADER_FORMAT = struct.Struct("<HHI")
_PACKET_FORMATS = {magic: struct.Struct(f"<HHI{count}H") for magic, count in MAGIC.items()}

# The parser looks for each key exactly as it stands here: no blanks.
_MOTION_FORMAT = (
    b'\n{"timestamp":%.6f,"imu":{"gyro":[%.7f,%.7f,%.7f],"accel_body":[%.6f,%.6f,%.6f]},'
    b'"position":[%.4f,%.4f,%.4f],"attitude":[%.7f,%.7f,%.7f],"velocity":[%.5f,%.5f,%.5f],"airspeed":%.5f'
)
_BATTERY_FORMAT = b',"battery":{"voltage":%.3f,"current":%.4f}'
_CLOSING_BYTES = b"}\n"


class ServoPacket(NamedTuple):
    """Outputs of the autopilot, with the number of its frame and the pulse of each output in microseconds."""

    frame: int
    pulses: tuple[int, ...]


def parse_servo_packet(data: bytes) -> ServoPacket:
    """Return the servo outputs in a datagram of ArduPlane.

    Raises FlightError if the datagram is of another version of the interface.

    >>> packet = parse_servo_packet(struct.pack("<HHI16H", 18458, 120, 7, *range(1500, 1516)))
    >>> packet.frame, packet.pulses[:2], len(packet.pulses)
    (7, (1500, 1501), 16)
    """
    magic = int.from_bytes(data[:2], "little")
    packet_format = _PACKET_FORMATS.get(magic)
    if packet_format is None or len(data) != packet_format.size:
        allowed = " or ".join(f"{number} with {count} outputs" for number, count in MAGIC.items())
        raise FlightError(
            f"uses another version of the physics interface: a packet of {len(data)} bytes that begins with {magic};"
            f" allowed: {allowed}",
            field="packet",
            value=magic,
            allowed=allowed,
        )
    numbers = packet_format.unpack(data)
    return ServoPacket(numbers[2], numbers[3:])


def encode_motion(motion: BodyMotion | tuple[float, ...], battery: tuple[float, float] | None = None) -> bytes:
    r"""Encode the aircraft's motion as a datagram for ArduPlane.

    battery: volts and amperes; None for an aircraft without a battery.

    >>> encode_motion(BodyMotion(0.5, *[0.0] * 5, -9.81, *[0.0] * 9, 25.0))[:44]
    b'\n{"timestamp":0.500000,"imu":{"gyro":[0.0000'
    """
    return _MOTION_FORMAT % motion + (b"" if battery is None else _BATTERY_FORMAT % battery) + _CLOSING_BYTES


# ----------------------------------------------------------------------
# planfly's socket for the exchange with an autopilot.

# Interval at which a wait checks whether the program still runs, s.
_CHECK_INTERVAL_S = 0.25
_MAX_DATAGRAM_BYTES = 1024
# ArduPilot repeats a request only after a second. A repeated request that arrives within this time after an answer was
# sent before that answer arrived, s by the clock.
_CROSSING_TIME_S = 0.1


class PhysicsPort:
    """Socket to which an autopilot sends its servo outputs.

    port: its number.
    check_program: function that is called while nothing arrives; it raises FlightError if the program has ended.

    It sends nothing without a request. A repeated request for a frame, which the program sends after a timeout, gets
    the same answer again, and the aircraft does not move.
    """

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((LOOPBACK, 0))
        self.port = int(self._socket.getsockname()[1])
        # The kernel's own timeout: one system call a frame.
        check_interval = struct.pack("@ll", int(_CHECK_INTERVAL_S), int(_CHECK_INTERVAL_S % 1.0 * 1e6))
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, check_interval)
        self.check_program: Callable[[], None] = lambda: None
        self._frame = -1
        self._last_answer = b""
        self._answered = 0.0
        # A sleeping laptop is not a silent program.
        self._clock = RunningClock()
        self._connected = False

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def receive(self) -> ServoPacket:
        """Return the next frame of servo outputs from the program.

        Raises FlightError if the program ends, stops sending, restarts, or uses another version of the interface.
        """
        waiting_since = 0.0
        while True:
            # b"" if no datagram arrives within `_CHECK_INTERVAL_S`.
            try:
                data, sender = self._socket.recvfrom(_MAX_DATAGRAM_BYTES)
                if not self._connected:
                    self._socket.connect(sender)
                    self._connected = True
            except (BlockingIOError, ConnectionRefusedError):
                data = b""
            if data:
                packet = parse_servo_packet(data)
                if packet.frame > self._frame:
                    self._frame = packet.frame
                    return packet
                if packet.frame < self._frame:
                    message = f"restarted in the air: frame {packet.frame} after frame {self._frame}"
                    raise FlightError(message, field="frame", value=packet.frame)
                # A request that was sent before the answer arrived needs no second answer.
                if self._clock() - self._answered > _CROSSING_TIME_S:
                    self._send(self._last_answer)
            now = self._clock()
            waiting_since = waiting_since or now
            self.check_program()
            if now - waiting_since > SILENCE_TIMEOUT_S:
                if data:
                    raise FlightError(
                        f"does not understand planfly's answers: it requested frame {self._frame} again for"
                        f" {SILENCE_TIMEOUT_S:.0f} s (another version of the physics interface?)",
                        field="frame",
                        value=self._frame,
                    )
                raise FlightError(
                    f"sent no outputs for {SILENCE_TIMEOUT_S:.0f} s; the flight is ended",
                    field="frame",
                    value=self._frame,
                )

    def answer(self, data: bytes) -> None:
        """Send ArduPlane the aircraft's motion in the step after the last received frame.

        data: the motion as `encode_motion` returns it.
        """
        self._last_answer = data
        self._answered = self._clock()
        self._send(data)

    def _send(self, data: bytes) -> None:
        """Send bytes to the program, if there are any."""
        if not data:
            return
        try:
            self._socket.send(data)
        except ConnectionRefusedError:
            # The program is gone: the next wait finds out why.
            return


class JsonLockstep(Lockstep):
    """Exchange over a `PhysicsPort`: servo outputs request a frame, and the motion answers it.

    port: socket of the exchange.
    servos: servos of the controls.
    fdm, workspace, home, poll: see `Lockstep`.
    """

    def __init__(
        self,
        port: PhysicsPort,
        servos: ServoMap,
        fdm: Fdm,
        workspace: Workspace,
        home: Home,
        poll: Callable[[], None],
    ) -> None:
        super().__init__(fdm, workspace, home, poll)
        self._port, self._servos = port, servos

    def _next_commands(self) -> Commands:
        """Wait for the next servo packet of the program, and return its commands."""
        return self._servos.commands(self._port.receive().pulses)

    def _send_motion(self, motion: tuple[float, ...], battery: tuple[float, float] | None) -> None:
        """Send the motion of the aircraft to the program."""
        self._port.answer(encode_motion(motion, battery))
