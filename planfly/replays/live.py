"""A log played as if it were flown now: to Foxglove on this machine, and into ground stations."""

import contextlib
import itertools
import time
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np

from flight.live.link import Access, Link, RunningClock
from flight.live.telemetry import (
    ACTIVE,
    AUTO,
    COMPLETE,
    INFO,
    PERIODS,
    SnapshotMaker,
    Status,
    heartbeat,
    status_texts,
    telemetry_message,
)
from flight.mission.items import Home
from flight.simulation.local_map import LocalMap
from flight.simulation.track import track_rows
from logs.recording.reader import FlightLog, LogChannel, LogMessage, log_channels, log_messages
from logs.recording.state_channel import EPOCH_NS
from planfly.certificates import temporary_certificate
from planfly.open_mission import CUT_SHORT
from planfly.replays.origin_gate import HOST, VIEWERS, OriginGate
from world.errors import FlightError, PlanflyError

Stopped = Callable[[], bool]
OnMessage = Callable[[str], None]

# ----------------------------------------------------------------------
# A log played to Foxglove over a WebSocket that only this machine reaches.
#
# The server is foxglove-sdk's: it speaks the WebSocket subprotocol `foxglove.sdk.v1` alone, and refuses a viewer that
# asks for its older name `foxglove.websocket.v1`.  It asks nobody where he is from: a gate stands before it.

# What the server of foxglove-sdk speaks.
SUBPROTOCOL = "foxglove.sdk.v1"
# Time between looks at the clock and at who is listening, s, and until a new subscription is active, s.
_POLL, _SUBSCRIBING = 0.005, 0.05


def play_to_foxglove(
    log: FlightLog,
    start: float,
    end: float,
    *,
    speed: float,
    port: int,
    allowed: Collection[str],
    wait: float | None,
    stopped: Stopped,
    on_message: OnMessage,
) -> None:
    """Play a log's messages from ``start`` to ``end`` (s) to the clients of a Foxglove server.

    allowed: origins of web pages that are let in beside those of `planfly.replays.origin_gate.VIEWERS`.

    It waits for the first client that subscribes, ``wait`` s at most; a later one is sent the scenes as they are then.
    Raises PlanflyError where foxglove-sdk is not installed, FlightError where nobody comes in time, OSError for a
    port in use.
    """
    try:
        import foxglove
    except ImportError as error:
        message = "the package foxglove-sdk is not installed (extra: planfly[foxglove])"
        raise PlanflyError.of_argument("foxglove", None, message, shown="") from error
    file = Path(log.source)
    broadcast = _Broadcast(foxglove, log_channels(file))
    with contextlib.ExitStack() as opened:
        gate = OriginGate(port, {*VIEWERS, *allowed}, lambda why: on_message(f"foxglove  refused {why}"))
        opened.callback(gate.close)
        server = _start_server(foxglove, f"planfly {file.name}", broadcast, gate)
        opened.callback(server.stop)
        on_message(f"foxglove  ws://{HOST}:{gate.port} (Open connection, Foxglove WebSocket; {SUBPROTOCOL})")
        messages = broadcast.up_to(log_messages(file), round(start * 1e9) + EPOCH_NS)
        _wait(broadcast, wait, stopped)
        _play(broadcast, server, messages, round(end * 1e9) + EPOCH_NS, speed, stopped)


def _start_server(foxglove: Any, name: str, broadcast: "_Broadcast", gate: OriginGate) -> Any:
    """The server behind the gate, which lets any page in: its certificate is one that no browser trusts."""
    certificate = temporary_certificate()
    try:
        server = foxglove.start_server(
            name=name, host=HOST, port=0, server_listener=broadcast, capabilities=[foxglove.Capability.Time],
            context=broadcast.context, tls_cert=certificate.certificate.encode(), tls_key=certificate.key.encode(),
        )  # fmt: skip
    except RuntimeError as error:
        raise OSError(0, str(error), HOST) from error
    gate.open(server.port, certificate)
    return server


def _wait(broadcast: "_Broadcast", timeout: float | None, stopped: Stopped) -> None:
    waited = RunningClock()
    while not broadcast.listeners and not stopped():
        if timeout is not None and waited() > timeout:
            raise FlightError.of_argument("foxglove", timeout, f"nobody has subscribed within {timeout:g} s", shown="")
        time.sleep(_POLL)


def _play(
    broadcast: "_Broadcast", server: Any, messages: Iterator[LogMessage], end_ns: int, speed: float, stopped: Stopped
) -> None:
    played, first, newest = RunningClock(), None, 0
    for message in messages:
        if message.log_time > end_ns:
            break
        first = message.log_time if first is None else first
        while (ahead := (message.log_time - first) / 1e9 / speed - played()) > 0.0 and not stopped():
            broadcast.catch_up()
            time.sleep(min(ahead, _POLL))
        if stopped():
            return
        # An event that was noted afterwards stands later in the file than its time.
        if message.log_time > newest:
            newest = message.log_time
            server.broadcast_time(newest)
        broadcast.show(message)
    # What is under way, and who came last, is served before the server goes.
    time.sleep(2.0 * _SUBSCRIBING)
    broadcast.catch_up()
    time.sleep(_SUBSCRIBING)


class _Broadcast:
    """The log's topics, the newest message of each scene, and who listens: a listener in Foxglove's sense."""

    def __init__(self, foxglove: Any, channels: list[LogChannel]) -> None:
        self.context = foxglove.Context()
        self.listeners = 0
        self._channels = {
            kind.topic: foxglove.Channel(
                kind.topic,
                schema=foxglove.Schema(name=kind.schema, encoding=kind.schema_encoding, data=kind.schema_data),
                message_encoding=kind.encoding,
                context=self.context,
            )
            for kind in channels
        }
        self._scenes: dict[str, LogMessage] = {}
        # Filled by the server's thread: when, and which topic.
        self._arrivals: SimpleQueue[tuple[float, str]] = SimpleQueue()
        self._waiting: list[tuple[float, str]] = []

    def up_to(self, messages: Iterator[LogMessage], start_ns: int) -> Iterator[LogMessage]:
        """Take what was before ``start_ns`` as known, and give the rest."""
        for message in messages:
            if message.log_time >= start_ns:
                return itertools.chain([message], messages)
            self._note(message)
        return iter(())

    def show(self, message: LogMessage) -> None:
        """Send a message to those who listen."""
        self.catch_up()
        self._note(message)
        channel = self._channels.get(message.channel.topic)
        if channel is not None:
            channel.log(message.data, log_time=message.log_time)

    def catch_up(self) -> None:
        """Send those who have just subscribed the scenes as they are."""
        while not self._arrivals.empty():
            self._waiting.append(self._arrivals.get())
        now = time.monotonic()
        for came, topic in self._waiting:
            scene = self._scenes.get(topic)
            if scene is not None and now - came >= _SUBSCRIBING:
                self._channels[topic].log(scene.data, log_time=scene.log_time)
        self._waiting = [item for item in self._waiting if now - item[0] < _SUBSCRIBING]

    def _note(self, message: LogMessage) -> None:
        if message.channel.topic.startswith(("/scene/", "/points/")):
            self._scenes[message.channel.topic] = message

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Note that somebody has come for a topic."""
        self._arrivals.put((time.monotonic(), channel.topic))
        self.listeners += 1

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Count a listener less."""
        self.listeners -= 1


# ----------------------------------------------------------------------
# A log played into ground stations.


def play_to_stations(
    log: FlightLog, access: Access, *, speed: float, wait: float, stopped: Stopped, on_message: OnMessage
) -> None:
    """Play a log to ground stations, as if it were flown now.  Raises FlightError if none answers in ``wait`` s."""
    link = Link(access)
    snapshots = SnapshotMaker(log.setup, LocalMap.around(log.setup))
    track = log.track
    rows = track_rows(track)
    start = snapshots.before_start(log.setup)
    home = log.setup.mission.home or Home(start.lat_deg, start.lon_deg, start.amsl)
    status = Status(start, home, battery=log.setup.battery, mode=AUTO, armed=True, flying=True, mission_state=ACTIVE)
    items = log.setup.route.items
    status.total = int(max(items.max(), 0))
    player = _Player(link, status, on_message)
    try:
        player.wait(wait, stopped)
        if not link.peers:
            asked = ",".join(f"{host}:{port}" for host, port in access.to)
            raise FlightError.of_argument("to", asked, f"no ground station has answered within {wait:g} s")
        begun, k = link.clock(), 0
        player.announce(f"replay of {log.source} at {speed:g}x")
        while k < len(rows) - 1 and not stopped():
            played = (link.clock() - begun) * speed
            k = min(len(rows) - 1, int(np.searchsorted(track.time, played, side="right")))
            snapshot = snapshots.snapshot(rows[k])
            if snapshot.finite:
                status.snapshot = snapshot
                status.current = max(0, int(items[min(int(snapshot.leg) + 1, len(items) - 1)]))
            player.step(0.01)
        if log.ended == "completed" and k == len(rows) - 1:
            status.mission_state = COMPLETE
        status.armed = status.flying = False
        player.announce(f"replay over: {log.ended or CUT_SHORT}")
        player.rest(1.5, stopped)
    finally:
        link.close()


class _Player:
    """Telemetry of a log, without a vehicle behind it."""

    def __init__(self, link: Link, status: Status, on_message: OnMessage) -> None:
        self._link, self._status, self._on_message = link, status, on_message
        self._born = link.clock()
        self._hello = 0.0
        self._texts = 0

    def announce(self, text: str) -> None:
        """Send a text to the stations, and on_message it here."""
        self._on_message(text)
        self._texts += 1
        for peer in self._link.peers.values():
            for piece in status_texts(text, INFO, self._texts):
                self._link.send(piece, peer)

    def wait(self, timeout: float, stopped: Stopped) -> None:
        """Call stations until one answers, or ``timeout`` seconds are over."""
        end = self._link.clock() + timeout
        while not self._link.peers and self._link.clock() < end and not stopped():
            self.step(0.05)

    def rest(self, seconds: float, stopped: Stopped) -> None:
        """Go on sending the last snapshot."""
        end = self._link.clock() + seconds
        while self._link.clock() < end and not stopped():
            self.step(0.02)

    def step(self, pause: float) -> None:
        """Read what stations send, send them what is due, and pause, s."""
        now = self._link.clock()
        self._status.boot, self._status.wall = now - self._born, time.time()
        self._link.receive()
        for notice in self._link.notices():
            self._on_message(notice)
        if now >= self._hello:
            self._hello = now + 1.0
            self._link.send_heartbeat(heartbeat(self._status))
        for peer in self._link.peers.values():
            for name, due in peer.due.items():
                if now >= due:
                    self._link.send(telemetry_message(name, self._status), peer)
                    peer.due[name] = max(due + PERIODS[name], now - PERIODS[name])
        time.sleep(pause)
