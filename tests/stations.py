"""Ground stations of our own, for tests: one that speaks through a lossy medium in virtual time, one over UDP."""

import heapq
import math
import random
import socket
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.mission_server import MissionServer, Station


def decode(message: Any, system: int, component: int) -> Any:
    """A message as the other end receives it: packed, sent, decoded."""
    packed = message.pack(mavlink.MAVLink(None, system, component))
    return mavlink.MAVLink(None).decode(bytearray(packed))


def item(
    seq: int, x: int, y: int, z: float, *, frame: int = 0, command: int = 16, kind: int = 0, p1: float = 0.0
) -> Any:
    return mavlink.MAVLink_mission_item_int_message(1, 1, seq, frame, command, 0, 1, p1, 0, 0, 0, x, y, z, kind)


def many_items(count: int, mark: int = 0) -> list[Any]:
    return [item(k, 460_000_000 + k, 80_000_000 + mark, 100.0 + k % 7) for k in range(count)]


@dataclass
class Uploader:
    """The station's side of an upload: sends again what is not answered within ``patience`` s.

    ``mavsdk``: sends only its MISSION_COUNT again, and waits to be asked for the rest, as MAVSDK does: when it has sent
    an item, or waited for 0.5 s, five times, it gives up (result -1).
    """

    station: Station
    items: list[Any]
    kind: int = 0
    patience: float = 0.05
    mavsdk: bool = False
    result: int | None = None
    _last: Any = None
    _sent: float = -math.inf
    _asked: bool = False
    _next: int = 0
    _tries: int = 0

    def tick(self, now: float) -> list[Any]:
        if self.result is not None or now - self._sent < self.patience:
            return []
        self._sent = now
        if self.mavsdk and self._asked:
            self._try_again()
            return []
        if self._last is None:
            self._last = mavlink.MAVLink_mission_count_message(1, 1, len(self.items), self.kind)
        return [self._last]

    def _try_again(self) -> bool:
        self._tries += 1
        self.result = -1 if self._tries > 5 else None
        return self.result is None

    def hear(self, message: Any, now: float) -> list[Any]:
        if self.result is not None or message.mission_type != self.kind:
            return []
        if message.get_type() == "MISSION_ACK":
            self.result = message.type
        elif message.get_type() == "MISSION_REQUEST_INT":
            if self.mavsdk:
                if message.seq > self._next:
                    return []
                if message.seq == self._next:
                    self._tries = 1
                elif not self._try_again():
                    return []
                self._next, self._asked = message.seq + 1, True
            self._last, self._sent = self.items[message.seq], now
            return [self._last]
        return []


@dataclass
class Medium:
    """Carries messages between a server and stations, and loses, doubles and reorders them; time is virtual."""

    server: MissionServer
    uploaders: list[Uploader]
    loss: float = 0.0
    doubled: float = 0.0
    delay: tuple[float, float] = (0.001, 0.001)
    seed: int = 1
    now: float = 0.0
    sent: int = 0
    texts: list[str] = field(default_factory=list)
    whole: Callable[[], None] = lambda: None

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)
        self._queue: list[tuple[float, int, Uploader, bool, Any]] = []

    def run(self, limit: float, step: float = 0.005) -> None:
        """Until every uploader has its result, or ``limit`` s of virtual time are over."""
        while self.now < limit and any(one.result is None for one in self.uploaders):
            self.now += step
            for one in self.uploaders:
                self._carry(one, True, one.tick(self.now))
            self._replies(self.server.tick(self.now))
            while self._queue and self._queue[0][0] <= self.now:
                _, _, one, inward, message = heapq.heappop(self._queue)
                if inward:
                    self._replies(self.server.handle(message, one.station, self.now))
                else:
                    self._carry(one, True, one.hear(message, self.now))
                self.whole()

    def _replies(self, replies: Iterable[Any]) -> None:
        for reply in replies:
            if reply.text:
                self.texts.append(reply.text)
            for one in self.uploaders:
                if one.station == reply.station:
                    self._carry(one, False, [reply.message])

    def _carry(self, one: Uploader, inward: bool, messages: Iterable[Any]) -> None:
        for message in messages:
            # A station's messages are decoded, as from the wire.
            arrived = decode(message, one.station.system, one.station.component) if inward else message
            for _ in range(2 if self._random.random() < self.doubled else 1):
                self.sent += 1
                if self._random.random() >= self.loss:
                    at = self.now + self._random.uniform(*self.delay)
                    heapq.heappush(self._queue, (at, self.sent, one, inward, arrived))


class UdpStation:
    """A ground station over UDP that sends a heartbeat each second while it waits, unless it is ``mute``."""

    def __init__(self, vehicle: int, system: int = 255, port: int = 0, *, mute: bool = False) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", port))
        self.socket.settimeout(0.01)
        self.to = ("127.0.0.1", vehicle)
        self.mav, self.parser = mavlink.MAVLink(None, system, 190), mavlink.MAVLink(None)
        self.log: list[Any] = []
        self._beat = math.inf if mute else -math.inf

    def __enter__(self) -> "UdpStation":
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, message: Any) -> None:
        self.socket.sendto(message.pack(self.mav), self.to)
        self.mav.seq = (self.mav.seq + 1) % 256

    def receive(self) -> list[Any]:
        if time.monotonic() - self._beat > 0.9:
            self._beat = time.monotonic()
            self.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        try:
            data = self.socket.recv(4096)
        except (TimeoutError, ConnectionRefusedError):
            return []
        found = self.parser.parse_buffer(data) or []
        self.log += found
        return list(found)

    def until(self, condition: Callable[[Any], bool], limit: float = 120.0) -> Any:
        """The first message that meets a condition; fails after ``limit`` s."""
        end = time.monotonic() + limit
        while time.monotonic() < end:
            for message in self.receive():
                if condition(message):
                    return message
        raise AssertionError(f"nothing came; texts: {self.texts()}")

    def listen(self, seconds: float) -> list[Any]:
        end, before = time.monotonic() + seconds, len(self.log)
        while time.monotonic() < end:
            self.receive()
        return self.log[before:]

    def texts(self) -> str:
        return "".join(
            message.text + ("" if message.id and len(message.text) == 50 else "\n")
            for message in self.log
            if message.get_type() == "STATUSTEXT"
        )

    def upload(self, items: list[Any], kind: int = 0) -> int:
        uploader = Uploader(Station(self.to, 1, 1), items, kind, patience=0.5)
        end = time.monotonic() + 120.0
        while uploader.result is None and time.monotonic() < end:
            for message in uploader.tick(time.monotonic()):
                self.send(message)
            for heard in self.receive():
                if heard.get_type() in ("MISSION_ACK", "MISSION_REQUEST_INT"):
                    for message in uploader.hear(heard, time.monotonic()):
                        self.send(message)
        assert uploader.result is not None
        return uploader.result

    def command(self, number: int, *params: float) -> int:
        values = [*params, *[0.0] * (7 - len(params))]
        self.send(mavlink.MAVLink_command_long_message(1, 1, number, 0, *values))
        return int(self.until(lambda m: m.get_type() == "COMMAND_ACK" and m.command == number and m.result != 5).result)

    def fly(self) -> None:
        """Arm and start; both must be accepted."""
        assert self.command(400, 1) == 0, self.texts()
        assert self.command(176, 1, 10) == 0, self.texts()
