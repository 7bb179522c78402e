"""The physics' end of the exchange with an autopilot: a datagram socket on this machine, a frame at a time."""

import socket
import struct
from collections.abc import Callable

from flight.live.running_clock import RunningClock
from flight.real_autopilot.json_physics import ServoPacket, parse_servo_packet
from world.errors import FlightError

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
