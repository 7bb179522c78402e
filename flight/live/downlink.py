"""What a live vehicle sends without being asked: heartbeats, telemetry, texts, parameters that stream."""

import time
from collections.abc import Callable
from typing import Any

from flight.live.link import Link, Peer
from flight.live.parameters import RATE, Parameters
from flight.live.telemetry import Status, heartbeat, status_texts, telemetry_message

INFO, NOTICE, WARNING, CRITICAL = 6, 5, 4, 2
# A message that is late by more than this (s) is not made up for.
_LATE = 0.5
# Between heartbeats, and between looks at a message that nobody wants, s.
_SECOND = 1.0

Tell = Callable[[str], None]


class Downlink:
    """Sends to every station that has been heard.

    tell: is given each text too, for a person at the terminal.  pause: how long the caller sleeps at most, s.
    """

    def __init__(self, link: Link, status: Status, parameters: Parameters, tell: Tell, pause: float) -> None:
        """Send the first heartbeat at once."""
        self._link = link
        self._status = status
        self._parameters = parameters
        self._tell = tell
        self._pause = pause
        self._texts = 0
        self._next_hello = time.monotonic()

    def say(self, text: str, severity: int = INFO) -> None:
        """Tell every station, and the terminal."""
        self._tell(text)
        self._texts = self._texts % 65535 + 1
        for peer in self._link.peers.values():
            for piece in status_texts(text, severity, self._texts):
                self._link.send(piece, peer)

    def to_all(self, message: Any) -> None:
        """Send one message to every station."""
        for peer in self._link.peers.values():
            self._link.send(message, peer)

    def hello_now(self) -> None:
        """Send the next heartbeat at once: what it says has changed."""
        self._next_hello = time.monotonic()

    def wait(self, now: float, patience: float) -> float:
        """Give the time until something is due, s, at most ``patience``."""
        due = min((at for peer in self._link.peers.values() for at in peer.due.values()), default=now + patience)
        return max(0.0, min(patience, due - now, self._next_hello - now))

    def tick(self, now: float) -> None:
        """Send what is due."""
        if now >= self._next_hello:
            self._next_hello = now + _SECOND if now - self._next_hello > _LATE else self._next_hello + _SECOND
            self._link.forget_silent()
            self._link.hello(heartbeat(self._status))
        for peer in self._link.peers.values():
            self._telemetry(peer, now)
            self._stream_parameters(peer)

    def _telemetry(self, peer: Peer, now: float) -> None:
        for name, due in peer.due.items():
            if now < due:
                continue
            period = peer.periods[name]
            if period is None:
                peer.due[name] = now + _SECOND
                continue
            self._link.send(telemetry_message(name, self._status), peer)
            peer.due[name] = due + period if now - due < _LATE else now + period

    def _stream_parameters(self, peer: Peer) -> None:
        if peer.parameter is None:
            return
        last, entries = int(peer.parameter), self._parameters.entries
        peer.parameter += max(1.0, RATE * self._pause)
        for number in range(last, min(int(peer.parameter), len(entries))):
            self._link.send(self._parameters.message(number), peer)
        if peer.parameter >= len(entries):
            peer.parameter = None
