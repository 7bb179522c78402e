"""What a live vehicle sends without being asked: heartbeats, telemetry, texts, parameters that stream."""

from collections.abc import Callable
from typing import Any

from flight.live.link import Link, Peer
from flight.live.parameters import PARAMETERS_PER_SECOND, Parameters
from flight.live.status_text import INFO, status_texts
from flight.live.telemetry import Status, heartbeat, telemetry_message

# A message that is late by more than this (s) is not made up for.
_LATE = 0.5
# Between heartbeats, and between checks of a message that a station has switched off, s.
_SECOND = 1.0

# Shows a text to a person at the terminal.
ShowText = Callable[[str], None]


class Downlink:
    """Sends to every station that has sent a heartbeat.

    show: gets each text too.  pause: how long the caller sleeps at most, s.
    """

    def __init__(self, link: Link, status: Status, parameters: Parameters, show: ShowText, pause: float) -> None:
        """Send the first heartbeat at once."""
        self._link = link
        self._status = status
        self._parameters = parameters
        self._show = show
        self._pause = pause
        self._texts = 0
        self._next_heartbeat = link.clock()

    def send_text(self, text: str, severity: int = INFO) -> None:
        """Send a text to every station, and show it at the terminal."""
        self._show(text)
        self._texts = self._texts % 65535 + 1
        for peer in self._link.peers.values():
            for piece in status_texts(text, severity, self._texts):
                self._link.send(piece, peer)

    def send_to_all(self, message: Any) -> None:
        """Send one message to every station."""
        for peer in self._link.peers.values():
            self._link.send(message, peer)

    def heartbeat_now(self) -> None:
        """Send the next heartbeat at once: its contents have changed."""
        self._next_heartbeat = self._link.clock()

    def wait(self, now: float, patience: float) -> float:
        """Return the time until something is due, s, at most ``patience``."""
        due = min((at for peer in self._link.peers.values() for at in peer.due.values()), default=now + patience)
        return max(0.0, min(patience, due - now, self._next_heartbeat - now))

    def tick(self, now: float) -> None:
        """Send what is due."""
        if now >= self._next_heartbeat:
            self._next_heartbeat = (
                now + _SECOND if now - self._next_heartbeat > _LATE else self._next_heartbeat + _SECOND
            )
            self._link.forget_silent()
            self._link.send_heartbeat(heartbeat(self._status))
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
        peer.parameter += max(1.0, PARAMETERS_PER_SECOND * self._pause)
        for number in range(last, min(int(peer.parameter), len(entries))):
            self._link.send(self._parameters.message(number), peer)
        if peer.parameter >= len(entries):
            peer.parameter = None
