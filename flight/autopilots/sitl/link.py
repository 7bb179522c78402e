"""Connect to an autopilot's program by MAVLink.

The link sends messages, and collects the state that the program reports.
"""

import socket
import struct
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.autopilots.sitl.exchange import LOOPBACK

# MAVLink system id of planfly, which acts as a ground station.
_SYSTEM = 255
# MAVLink component id of planfly.
_COMPONENT = mavlink.MAV_COMP_ID_MISSIONPLANNER
_MAX_RECEIVE_BYTES = 65536


@dataclass(slots=True)
class ReportedState:
    """State that an autopilot has reported by MAVLink; None, -1 or empty before it is reported.

    vehicle: MAV_TYPE.
    autopilot: MAV_AUTOPILOT.
    mode: custom_mode of the heartbeat, the autopilot's own number of its flight mode.
    ekf: flags of EKF_STATUS_REPORT or ESTIMATOR_STATUS.
    mission_item: number of the item being flown.
    reached: number of the last item reached.
    texts: texts of STATUSTEXT, in the order of their arrival.
    parameters: values of the received parameters by name.
    acknowledged: MAV_RESULT by command.
    requested: number of the mission item that the autopilot requested last.
    mission_result: MAV_MISSION_RESULT of the upload.
    version: AUTOPILOT_VERSION.flight_sw_version.
    """

    vehicle: int | None = None
    autopilot: int | None = None
    mode: int | None = None
    armed: bool = False
    ekf: int = 0
    mission_item: int = -1
    reached: int = -1
    texts: list[str] = field(default_factory=list)
    parameters: dict[str, float] = field(default_factory=dict)
    acknowledged: dict[int, int] = field(default_factory=dict)
    requested: int | None = None
    mission_result: int | None = None
    version: int | None = None


# Formats of integer parameters: PX4 sends the bytes of the integer, ArduPilot a float of the same value.
_INTEGER_FORMATS = {
    mavlink.MAV_PARAM_TYPE_UINT8: "<B3x",
    mavlink.MAV_PARAM_TYPE_INT8: "<b3x",
    mavlink.MAV_PARAM_TYPE_UINT16: "<H2x",
    mavlink.MAV_PARAM_TYPE_INT16: "<h2x",
    mavlink.MAV_PARAM_TYPE_UINT32: "<I",
    mavlink.MAV_PARAM_TYPE_INT32: "<i",
}


class AutopilotLink(ABC):
    """MAVLink connection to the autopilot's program on this machine.

    port: planfly's port of the connection.
    reported: state that the autopilot has reported.
    """

    port: int

    def __init__(self) -> None:
        self.reported = ReportedState()
        self._mav = mavlink.MAVLink(None, _SYSTEM, _COMPONENT)
        self._mav.robust_parsing = True

    @abstractmethod
    def close(self) -> None:
        """Close the connection."""

    @abstractmethod
    def _receive(self) -> bytes:
        """Return the received bytes, without waiting."""

    @abstractmethod
    def _transmit(self, data: bytes) -> None:
        """Send bytes; if the program no longer accepts them, they are lost."""

    def poll(self) -> None:
        """Store what the received messages report, without waiting; ignore messages of other types."""
        reported = self.reported
        while data := self._receive():
            try:
                messages = self._mav.parse_buffer(data) or []
            except (mavlink.MAVError, struct.error):
                continue
            for message in messages:
                match message.get_type():
                    case "HEARTBEAT" if message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1:
                        reported.vehicle, reported.autopilot = int(message.type), int(message.autopilot)
                        reported.mode = int(message.custom_mode)
                        reported.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
                    case "STATUSTEXT":
                        reported.texts.append(str(message.text))
                    case "EKF_STATUS_REPORT" | "ESTIMATOR_STATUS":
                        reported.ekf = int(message.flags)
                    case "MISSION_CURRENT":
                        reported.mission_item = int(message.seq)
                    case "MISSION_ITEM_REACHED":
                        reported.reached = int(message.seq)
                    case "PARAM_VALUE":
                        value, integer_format = float(message.param_value), _INTEGER_FORMATS.get(message.param_type)
                        if integer_format is not None and reported.autopilot == mavlink.MAV_AUTOPILOT_PX4:
                            (value,) = struct.unpack(integer_format, struct.pack("<f", value))
                        reported.parameters[str(message.param_id)] = float(value)
                    case "COMMAND_ACK":
                        reported.acknowledged[int(message.command)] = int(message.result)
                    case "MISSION_REQUEST" | "MISSION_REQUEST_INT":
                        reported.requested = int(message.seq)
                    case "MISSION_ACK":
                        reported.mission_result = int(message.type)
                    case "AUTOPILOT_VERSION":
                        reported.version = int(message.flight_sw_version)

    def send(self, message: Any) -> None:
        """Send a message; if the program no longer accepts it, it is lost."""
        data = message.pack(self._mav)
        self._mav.seq = (self._mav.seq + 1) % 256
        self._transmit(data)


class TcpLink(AutopilotLink):
    """MAVLink connection by TCP: the program connects to planfly's port."""

    def __init__(self) -> None:
        super().__init__()
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.bind((LOOPBACK, 0))
        self._listener.listen(1)
        self._listener.setblocking(False)
        self.port = int(self._listener.getsockname()[1])
        self._stream: socket.socket | None = None

    def close(self) -> None:
        """Close the connection."""
        self._listener.close()
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def _receive(self) -> bytes:
        """Return the bytes that have arrived on the TCP connection; b"" if none have arrived.

        If the program is not yet connected, its connection is accepted first.
        """
        if self._stream is None:
            try:
                self._stream, _ = self._listener.accept()
            except BlockingIOError:
                return b""
            self._stream.setblocking(False)
            self._stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            # Empty if the other side closed it; the physics exchange reports the reason.
            return self._stream.recv(_MAX_RECEIVE_BYTES)
        except (BlockingIOError, ConnectionResetError):
            return b""

    def _transmit(self, data: bytes) -> None:
        """Send bytes on the TCP connection; they are lost without a connection."""
        if self._stream is None:
            return
        try:
            self._stream.sendall(data)
        except OSError:
            return


class UdpLink(AutopilotLink):
    """MAVLink connection by UDP: the program sends to planfly's port, and listens on its own.

    program_port: port on which the program is to listen.
    """

    def __init__(self) -> None:
        super().__init__()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((LOOPBACK, 0))
        self._socket.setblocking(False)
        self.port = int(self._socket.getsockname()[1])
        (self.program_port,) = free_ports(1)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _receive(self) -> bytes:
        """Return the datagram that has arrived from the program; b"" if none has arrived."""
        try:
            data, sender = self._socket.recvfrom(_MAX_RECEIVE_BYTES)
        except (BlockingIOError, ConnectionRefusedError):
            return b""
        # Datagrams from other senders are ignored.
        return data if sender == (LOOPBACK, self.program_port) else b""

    def _transmit(self, data: bytes) -> None:
        """Send a datagram to the program; it is lost if the program does not listen."""
        try:
            self._socket.sendto(data, (LOOPBACK, self.program_port))
        except OSError:
            return


def free_ports(count: int) -> list[int]:
    """Return UDP port numbers that are not in use at the moment, on which a program can listen."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    try:
        for udp_socket in sockets:
            udp_socket.bind((LOOPBACK, 0))
        return [int(udp_socket.getsockname()[1]) for udp_socket in sockets]
    finally:
        for udp_socket in sockets:
            udp_socket.close()
