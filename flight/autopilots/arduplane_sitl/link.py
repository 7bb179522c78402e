"""The MAVLink connection to an autopilot's program: messages sent, and what its messages have told so far."""

import socket
import struct
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.autopilots.arduplane_sitl.physics import LOOPBACK

# We are a ground station.
_SYSTEM, _COMPONENT = 255, mavlink.MAV_COMP_ID_MISSIONPLANNER
_LARGEST = 65536


@dataclass(slots=True)
class AutopilotNews:
    """What an autopilot's messages have told; None and empty for what it has not.

    vehicle: MAV_TYPE.  mode: ArduPlane's number.
    ekf: EKF_STATUS_REPORT.flags.
    mission_item: the number of the item that it flies.
    texts: STATUSTEXT, in order.
    parameters: by name, as it has them.
    acknowledged: the result by command, MAV_RESULT.
    requested: the mission item it last asked for.  mission_result: MAV_MISSION_RESULT of the upload.
    version: AUTOPILOT_VERSION.flight_sw_version.
    """

    vehicle: int | None = None
    mode: int | None = None
    armed: bool = False
    ekf: int = 0
    mission_item: int = -1
    texts: list[str] = field(default_factory=list)
    parameters: dict[str, float] = field(default_factory=dict)
    acknowledged: dict[int, int] = field(default_factory=dict)
    requested: int | None = None
    mission_result: int | None = None
    version: int | None = None


class AutopilotLink:
    """A socket that the autopilot's program connects to, on this machine.

    port: its number.  news: what has been told.
    """

    def __init__(self) -> None:
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.bind((LOOPBACK, 0))
        self._listener.listen(1)
        self._listener.setblocking(False)
        self.port = int(self._listener.getsockname()[1])
        self.news = AutopilotNews()
        self._stream: socket.socket | None = None
        self._mav = mavlink.MAVLink(None, _SYSTEM, _COMPONENT)
        self._mav.robust_parsing = True
        self._handlers = {
            "HEARTBEAT": self._heartbeat,
            "STATUSTEXT": self._text,
            "EKF_STATUS_REPORT": self._ekf,
            "MISSION_CURRENT": self._mission_current,
            "PARAM_VALUE": self._parameter,
            "COMMAND_ACK": self._command_ack,
            "MISSION_REQUEST": self._mission_request,
            "MISSION_REQUEST_INT": self._mission_request,
            "MISSION_ACK": self._mission_ack,
            "AUTOPILOT_VERSION": self._version,
        }

    def close(self) -> None:
        """Close the connection."""
        self._listener.close()
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def poll(self) -> None:
        """Take in what has come, without waiting."""
        if self._stream is None:
            try:
                self._stream, _ = self._listener.accept()
            except BlockingIOError:
                return
            self._stream.setblocking(False)
            self._stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            data = self._stream.recv(_LARGEST)
        except (BlockingIOError, ConnectionResetError):
            return
        if not data:
            # Closed by the other side; the physics tells why.
            return
        try:
            messages = self._mav.parse_buffer(data) or []
        except (mavlink.MAVError, struct.error):
            return
        for message in messages:
            handler = self._handlers.get(message.get_type())
            if handler is not None:
                handler(message)

    def send(self, message: Any) -> None:
        """Send a message; what the program no longer takes is lost."""
        if self._stream is None:
            return
        data = message.pack(self._mav)
        self._mav.seq = (self._mav.seq + 1) % 256
        try:
            self._stream.sendall(data)
        except OSError:
            return

    def _heartbeat(self, message: Any) -> None:
        if message.get_srcComponent() != mavlink.MAV_COMP_ID_AUTOPILOT1:
            return
        self.news.vehicle, self.news.mode = int(message.type), int(message.custom_mode)
        self.news.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    def _text(self, message: Any) -> None:
        self.news.texts.append(str(message.text))

    def _ekf(self, message: Any) -> None:
        self.news.ekf = int(message.flags)

    def _mission_current(self, message: Any) -> None:
        self.news.mission_item = int(message.seq)

    def _parameter(self, message: Any) -> None:
        self.news.parameters[str(message.param_id)] = float(message.param_value)

    def _command_ack(self, message: Any) -> None:
        self.news.acknowledged[int(message.command)] = int(message.result)

    def _mission_request(self, message: Any) -> None:
        self.news.requested = int(message.seq)

    def _mission_ack(self, message: Any) -> None:
        self.news.mission_result = int(message.type)

    def _version(self, message: Any) -> None:
        self.news.version = int(message.flight_sw_version)
