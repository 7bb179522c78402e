"""Play a log to ground stations as a live flight."""

import time
from collections.abc import Callable

import numpy as np

from flight.live.link import Access, Link
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
from flight.simulation.simulate import LocalMap
from flight.simulation.track import track_rows
from logs.recording.reader import FlightLog
from logs.views.exports.log_files import battery_voltage
from planfly.flight_logs import CUT_SHORT
from world.errors import FlightError

ShouldStop = Callable[[], bool]
OnMessage = Callable[[str], None]


def play_to_stations(
    log: FlightLog, access: Access, *, speed: float, wait: float, should_stop: ShouldStop, on_message: OnMessage
) -> None:
    """Play a log to ground stations as if the flight were live.

    speed: multiple of real time.
    wait: maximum time to wait for the first station, s; FlightError is raised if none answers.
    should_stop: polled continuously; the replay ends when it returns True.
    on_message: called with each message of the replay.
    """
    link = Link(access)
    snapshots = SnapshotMaker(log.setup, LocalMap.around(log.setup))
    track = log.track
    rows = track_rows(track)
    start = snapshots.start_snapshot(log.setup)
    home = log.setup.mission.home or Home(start.lat_deg, start.lon_deg, start.amsl)
    status = Status(start, home, battery=log.setup.battery, mode=AUTO, armed=True, flying=True, mission_state=ACTIVE)
    status.volts = battery_voltage(log)
    items = log.setup.route.items
    status.total = int(max(items.max(), 0))
    player = _Player(link, status, on_message)
    try:
        player.wait(wait, should_stop)
        if not link.peers:
            addresses = ",".join(f"{host}:{port}" for host, port in access.to)
            raise FlightError.of_argument("to", addresses, f"no ground station has answered within {wait:g} s")
        start_time, row = link.clock(), 0
        player.announce(f"replay of {log.source} at {speed:g}x")
        while row < len(rows) - 1 and not should_stop():
            log_time = (link.clock() - start_time) * speed
            row = min(len(rows) - 1, int(np.searchsorted(track.time, log_time, side="right")))
            snapshot = snapshots.snapshot(rows[row])
            if snapshot.is_finite:
                status.snapshot = snapshot
                status.current = max(0, int(items[min(int(snapshot.leg) + 1, len(items) - 1)]))
            player.step(pause=0.01)
        if log.ended == "completed" and row == len(rows) - 1:
            status.mission_state = COMPLETE
        status.armed = status.flying = False
        player.announce(f"replay ended: {log.ended or CUT_SHORT}")
        player.continue_sending(seconds=1.5, should_stop=should_stop)
    finally:
        link.close()


class _Player:
    """Sender of a log's telemetry to ground stations, in place of a vehicle."""

    def __init__(self, link: Link, status: Status, on_message: OnMessage) -> None:
        """Take over a link to stations.

        status: state of the vehicle, which the stations see.
        on_message: called with each text for the user.
        """
        self._link, self._status, self._on_message = link, status, on_message
        self._start_time = link.clock()
        self._next_heartbeat = 0.0
        self._text_count = 0

    def announce(self, text: str) -> None:
        """Send a text to all stations, and pass it to `on_message`."""
        self._on_message(text)
        self._text_count += 1
        for peer in self._link.peers.values():
            for piece in status_texts(text, INFO, self._text_count):
                self._link.send(piece, peer)

    def wait(self, timeout: float, should_stop: ShouldStop) -> None:
        """Send heartbeats until a station answers.

        The wait ends after `timeout` seconds, or when `should_stop` returns True.
        """
        end = self._link.clock() + timeout
        while not self._link.peers and self._link.clock() < end and not should_stop():
            self.step(pause=0.05)

    def continue_sending(self, seconds: float, should_stop: ShouldStop) -> None:
        """Keep sending the last snapshot for a number of seconds, or until `should_stop` returns True."""
        end = self._link.clock() + seconds
        while self._link.clock() < end and not should_stop():
            self.step(pause=0.02)

    def step(self, pause: float) -> None:
        """Handle messages from the stations, send the messages that are due, and sleep for `pause` seconds."""
        now = self._link.clock()
        self._status.boot, self._status.wall = now - self._start_time, time.time()
        self._link.receive()
        for notice in self._link.pop_notices():
            self._on_message(notice)
        if now >= self._next_heartbeat:
            self._next_heartbeat = now + 1.0
            self._link.send_heartbeat(heartbeat(self._status))
        for peer in self._link.peers.values():
            for name, due in peer.due.items():
                if now >= due:
                    self._link.send(telemetry_message(name, self._status), peer)
                    peer.due[name] = max(due + PERIODS[name], now - PERIODS[name])
        time.sleep(pause)
