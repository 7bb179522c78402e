"""Play a log to Foxglove over a WebSocket that only this machine can reach.

The server is that of foxglove-sdk, which supports only the WebSocket subprotocol `foxglove.sdk.v1` and refuses a viewer
that requests the older name `foxglove.websocket.v1`.  It does not check origins; a gate in front of it does.
"""

import contextlib
import itertools
import time
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from logs.recording.reader import FlightLog, LogChannel, LogMessage, log_channels, log_messages
from logs.recording.state_channel import EPOCH_NS
from planfly.replays.certificates import make_temporary_certificate
from planfly.replays.origin_gate import HOST, VIEWERS, OriginGate
from world.errors import FlightError
from world.running_clock import RunningClock

ShouldStop = Callable[[], bool]
OnMessage = Callable[[str], None]

# Subprotocol of the server of foxglove-sdk.
SUBPROTOCOL = "foxglove.sdk.v1"
# Interval between checks of the clock and of the listeners, s.
_POLL_INTERVAL_S = 0.005
# Time until a new subscription is active, s.
_SUBSCRIPTION_DELAY_S = 0.05


def play_to_foxglove(
    log: FlightLog,
    start: float,
    end: float,
    *,
    speed: float,
    port: int,
    allowed: Collection[str],
    wait: float | None,
    should_stop: ShouldStop,
    on_message: OnMessage,
) -> None:
    """Start a Foxglove server, and play the messages of a log to its clients.

    Clients that subscribe later than the first one receive the current scenes.

    start, end: start and end in flight time, s.
    speed: multiple of real time.
    port: port of the server; 0 for any free port.
    allowed: origins of web pages that are accepted in addition to `planfly.replays.origin_gate.VIEWERS`.
    wait: maximum time to wait for the first client that subscribes, s; None to wait without a limit.
    should_stop: polled continuously; the replay ends when it returns True.
    on_message: called with each line for the user.
    Raises FlightError if no client subscribes in time, and OSError for a port in use.
    """
    import foxglove

    file = Path(log.source)
    broadcast = _Broadcast(foxglove, log_channels(file))
    with contextlib.ExitStack() as exit_stack:
        gate = OriginGate(port, {*VIEWERS, *allowed}, lambda reason: on_message(f"foxglove  refused {reason}"))
        exit_stack.callback(gate.close)
        # No page can bypass the gate, because no browser trusts the certificate of the server.
        certificate = make_temporary_certificate()
        try:
            server = foxglove.start_server(
                name=f"planfly {file.name}",
                host=HOST,
                port=0,
                server_listener=broadcast,
                capabilities=[foxglove.Capability.Time],
                context=broadcast.context,
                tls_cert=certificate.certificate.encode(),
                tls_key=certificate.key.encode(),
            )
        except RuntimeError as error:
            raise OSError(0, str(error), HOST) from error
        exit_stack.callback(server.stop)
        gate.start_forwarding(server.port, certificate)
        on_message(f"foxglove  ws://{HOST}:{gate.port} (Open connection, Foxglove WebSocket; {SUBPROTOCOL})")
        messages = broadcast.record_scenes_until(log_messages(file), round(start * 1e9) + EPOCH_NS)
        clock = RunningClock()
        while not broadcast.listeners and not should_stop():
            if wait is not None and clock() > wait:
                raise FlightError.of_argument("foxglove", wait, f"no viewer has subscribed within {wait:g} s", shown="")
            time.sleep(_POLL_INTERVAL_S)
        _play_messages(broadcast, server, messages, round(end * 1e9) + EPOCH_NS, speed, should_stop)


def _play_messages(
    broadcast: "_Broadcast",
    server: Any,
    messages: Iterator[LogMessage],
    end_ns: int,
    speed: float,
    should_stop: ShouldStop,
) -> None:
    """Send messages at their times until `end_ns` or until `should_stop` returns True.

    speed: multiple of real time.
    """
    playback_clock, first_time, latest_time = RunningClock(), None, 0
    for message in messages:
        if message.log_time > end_ns:
            break
        first_time = message.log_time if first_time is None else first_time
        while (wait := (message.log_time - first_time) / 1e9 / speed - playback_clock()) > 0.0 and not should_stop():
            broadcast.serve_new_subscribers()
            time.sleep(min(wait, _POLL_INTERVAL_S))
        if should_stop():
            return
        # Events written after the flight come later in the file than their time.
        if message.log_time > latest_time:
            latest_time = message.log_time
            server.broadcast_time(latest_time)
        broadcast.send(message)
    # Serve pending messages and the last subscribers before the server ends.
    time.sleep(2.0 * _SUBSCRIPTION_DELAY_S)
    broadcast.serve_new_subscribers()
    time.sleep(_SUBSCRIPTION_DELAY_S)


class _Broadcast:
    """Listener of Foxglove's server, which sends the messages of a log to the subscribers of their topics.

    It stores the newest message of each scene for clients that subscribe later.
    """

    def __init__(self, foxglove: Any, channels: list[LogChannel]) -> None:
        """Make a Foxglove channel for each topic of the log."""
        self.context = foxglove.Context()
        self.listeners = 0
        self._channels = {
            channel.topic: foxglove.Channel(
                channel.topic,
                schema=foxglove.Schema(name=channel.schema, encoding=channel.schema_encoding, data=channel.schema_data),
                message_encoding=channel.encoding,
                context=self.context,
            )
            for channel in channels
        }
        self._scenes: dict[str, LogMessage] = {}
        # Filled by the thread of the server: time and topic.
        self._arrivals: SimpleQueue[tuple[float, str]] = SimpleQueue()
        self._waiting: list[tuple[float, str]] = []

    def record_scenes_until(self, messages: Iterator[LogMessage], start_ns: int) -> Iterator[LogMessage]:
        """Store each topic's last scene before a time, and return the messages from this time on.

        messages: messages of the log in the order of time; those before `start_ns` are consumed.
        start_ns: log time, ns.
        """
        for message in messages:
            if message.log_time >= start_ns:
                return itertools.chain([message], messages)
            self._record_scene(message)
        return iter(())

    def send(self, message: LogMessage) -> None:
        """Send a message to the subscribers of its topic, after the newest scenes to new subscribers."""
        self.serve_new_subscribers()
        self._record_scene(message)
        channel = self._channels.get(message.channel.topic)
        if channel is not None:
            channel.log(message.data, log_time=message.log_time)

    def serve_new_subscribers(self) -> None:
        """Send the newest scenes to clients whose subscription has just become active."""
        while not self._arrivals.empty():
            self._waiting.append(self._arrivals.get())
        now = time.monotonic()
        for arrival_time, topic in self._waiting:
            scene = self._scenes.get(topic)
            if scene is not None and now - arrival_time >= _SUBSCRIPTION_DELAY_S:
                self._channels[topic].log(scene.data, log_time=scene.log_time)
        self._waiting = [
            subscription for subscription in self._waiting if now - subscription[0] < _SUBSCRIPTION_DELAY_S
        ]

    def _record_scene(self, message: LogMessage) -> None:
        """Store a message as the newest scene of its topic; other messages are ignored."""
        if message.channel.topic.startswith(("/scene/", "/points/")):
            self._scenes[message.channel.topic] = message

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Queue a new subscription, and increase the number of subscribers; called in the server's thread."""
        self._arrivals.put((time.monotonic(), channel.topic))
        self.listeners += 1

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Decrease the number of subscribers."""
        self.listeners -= 1
