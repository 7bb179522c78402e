"""The live vehicle: stations on one side, the process that flies on the other, and the state between them."""

import contextlib
import errno
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any, NamedTuple

from flight.live.arming import ACCEPTED, DENIED, REJECTED, ArmingState, CommandResult
from flight.live.downlink import Downlink, ShowText
from flight.live.flight_process import (
    EndFlight,
    Event,
    FlightEnded,
    FlightJudged,
    JudgeMission,
    MissionJudged,
    Order,
    ProcessReady,
    StartFlight,
    read_event,
)
from flight.live.link import Link, Peer
from flight.live.mavlink_items import MissionType
from flight.live.mission_progress import MissionProgress
from flight.live.mission_server import MissionServer, Station
from flight.live.parameters import Parameters
from flight.live.snapshot import Snapshot
from flight.live.station_missions import flown_from, listed, start_problem, uploaded
from flight.live.station_requests import Requests, Response
from flight.live.status_text import CRITICAL, INFO, WARNING, StatusText
from flight.live.telemetry import Status
from flight.mission.items import Home, Mission, MissionItem

# Longest wait for the network or the flight, s.
_NAP = 0.02
# Time that the process that flies has to close its log when the vehicle is shut down, s.
CLOSING = 0.8
_MOST_DEATHS = 3
# Within this time (s) the same text is sent once.
_SAME_TEXT = 3.0


class Standby(NamedTuple):
    """An aircraft without a mission, and its home."""

    snapshot: Snapshot
    home: Home


class Vehicle:
    """A vehicle that stands ready, takes missions, and flies them on a station's command."""

    def __init__(
        self,
        link: Link,
        spawn: Callable[[], Connection],
        parameters: Parameters,
        standby: Standby,
        battery: float,
        show: ShowText,
    ) -> None:
        """Start the process that flies.

        link: the stations.
        spawn: starts a process that flies, and returns the link's end of its pipe.
        parameters: what stations may read and set.
        standby: the aircraft before it has a mission.
        battery: Wh when full.
        show: gets what a person at the terminal should read.
        """
        self.link = link
        self.server = MissionServer()
        self.arming = ArmingState()
        self.status = Status(standby.snapshot, standby.home, battery=battery)
        self.down = Downlink(link, self.status, parameters, show, _NAP)
        self.requests = Requests(self.arming, parameters, self.status, self._start_at)
        self._standby = standby
        self._spawn = spawn
        # In a row, without being ready in between.
        self._deaths = 0
        self._flight = spawn()
        self._ready = False
        self._parameters = parameters
        self._show = show
        self._clock = link.clock
        self._born = self._clock()
        # Which mission is judged or flown.
        self._number = 0
        self._outstanding = self._brief = False
        # The upload in which the item that the next flight starts at was chosen.
        self._chosen_in: tuple[MissionItem, ...] = ()
        self._last_text, self._last_text_at = "", 0.0
        self._progress = MissionProgress(self.server, self.arming, self.status, self.down)

    def load(self, mission: Mission) -> None:
        """Take a mission from a file, as if a station had uploaded it."""
        for kind, items in zip(MissionType, listed(mission), strict=True):
            self.server.lists[kind] = items
        self.server.changed.add(MissionType.MISSION)

    def load_fence(self, fences: Sequence[MissionItem]) -> None:
        """Take a fence from a file, as if a station had uploaded it; missions that follow are judged by it."""
        self.server.lists[MissionType.FENCE] = tuple(fences)
        self.server.changed.add(MissionType.FENCE)

    def run(self, stop: Callable[[], bool]) -> None:
        """Serve until ``stop`` says so, then end the flight and its process."""
        while not stop():
            self.step(_NAP)

    def close(self) -> None:
        """Have the process that flies end its flight, if it has begun to serve; its last texts go to the terminal."""
        until = self._clock() + CLOSING
        with contextlib.suppress(OSError, EOFError):
            if self._ready:
                self._flight.send(EndFlight(quit=True))
            while self._ready and self._flight.poll(max(0.0, until - self._clock())):
                found = read_event(self._flight.recv_bytes())
                if isinstance(found, FlightJudged):
                    self._send_texts(found.texts)
        self._flight.close()

    def step(self, patience: float) -> None:
        """Wait for something to do, at most ``patience`` s, and do it."""
        watched: list[Any] = [self.link, self._flight]
        readable: list[Any] = wait(watched, self.down.wait(self._clock(), patience))
        now = self._clock()
        self.status.boot, self.status.wall = now - self._born, time.time()
        if self._flight in readable:
            self._from_flight()
        if self.link in readable:
            for message, peer in self.link.receive():
                self._from_station(message, peer, now)
            for notice in self.link.notices():
                self._show(notice)
        for reply in self.server.tick(now):
            self._send_reply(reply.station, reply.message, reply.text)
        self._changes()
        self.down.tick(now)
        used = self._clock() - now
        self.status.load += 0.01 * (used / max(used, patience) - self.status.load)

    def _from_station(self, message: Any, peer: Peer, now: float) -> None:
        self.server.locked = "in flight: the mission cannot change" if self.arming.flying else ""
        station = Station(peer.address, message.get_srcSystem(), message.get_srcComponent())
        for reply in self.server.handle(message, station, now):
            self._send_reply(reply.station, reply.message, reply.text)
        self._changes()
        self._pass_on(self.requests.handle(message, peer, now))
        self._after_command()

    def _pass_on(self, responses: list[Response]) -> None:
        for response in responses:
            if not isinstance(response, StatusText):
                self.link.send(response.message, response.peer)
                continue
            now = self._clock()
            # A station that tries again soon gets the text once.
            if self._last_text != response.text or now - self._last_text_at > _SAME_TEXT:
                self.down.send_text(*response)
            self._last_text, self._last_text_at = response.text, now

    def _send_texts(self, texts: tuple[StatusText, ...]) -> None:
        for text in texts:
            self.down.send_text(*text)

    def _send_reply(self, station: Station, message: Any, text: str) -> None:
        peer = next((peer for address, peer in self.link.peers.items() if address == station.address), None)
        if peer is not None:
            self.link.send(message, peer)
        if text:
            self.down.send_text(text, WARNING)

    def _after_command(self) -> None:
        if self.arming.end_requested:
            self.arming.end_requested = False
            self._order(EndFlight())
        if self.arming.starts:
            self.arming.flight_started()
            self._progress.started()
            self.down.send_text("mission started")
            self._order(StartFlight())
        self._refresh()

    def _changes(self) -> None:
        """Have a changed mission judged; a fence or rally points that change belong to it."""
        # One order at a time: stations that upload faster than missions are judged must not fill the pipe.
        if not self.server.changed or self.arming.flying or self._outstanding:
            return
        changed = set(self.server.changed)
        self.server.changed.clear()
        totals = {"MIS_TOTAL": MissionType.MISSION, "FENCE_TOTAL": MissionType.FENCE, "RALLY_TOTAL": MissionType.RALLY}
        for name, kind in totals.items():
            self._parameters.put(name, float(len(self.server.lists[kind])))
        self._number += 1
        if not self.server.lists[MissionType.MISSION]:
            self.arming.mission_cleared()
            self.status.snapshot, self.status.home = self._standby
            self._pass_on(self.requests.verdict_came())
            self._refresh()
            return
        if self.server.lists[MissionType.MISSION] is not self._chosen_in:
            self._progress.first = 0
        mission, self._progress.shift = uploaded(self.server.lists, self._standby.home)
        mission = flown_from(mission, self._progress.first - self._progress.shift)
        # A fence or rally points that are changed need not repeat the texts about the mission.
        self._brief = MissionType.MISSION not in changed and (self._brief or not self.arming.judging)
        self.arming.mission_uploaded()
        self._outstanding = True
        self._order(JudgeMission(mission, self._number))
        self._refresh()

    def _start_at(self, seq: int) -> CommandResult:
        """Have the next flight start at an item, by the station's number: it is judged as what is flown."""
        if self.arming.flying:
            return CommandResult(REJECTED, f"item {seq} refused: in flight the mission is flown as it stands")
        mission, shift = uploaded(self.server.lists, self._standby.home)
        problem = start_problem(mission, seq - shift)
        if problem:
            return CommandResult(DENIED, f"item {seq} refused: {problem}")
        first = 0 if seq - shift <= mission.items[0].seq else seq
        if first != self._progress.first:
            self._progress.first, self._chosen_in = first, self.server.lists[MissionType.MISSION]
            self.server.changed.add(MissionType.MISSION)
            self._changes()
        return CommandResult(ACCEPTED)

    def _order(self, order: Order) -> None:
        try:
            self._flight.send(order)
        except (BrokenPipeError, ConnectionResetError):
            self._lost()

    def _from_flight(self) -> None:
        try:
            while self._flight.poll():
                self._take(read_event(self._flight.recv_bytes()))
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self._lost()

    def _lost(self) -> None:
        """Start another process in place of one that has died: JSBSim can abort, and that must not end the vehicle."""
        self._flight.close()
        self._deaths += 1
        if self._deaths >= _MOST_DEATHS:
            raise ChildProcessError(errno.ECHILD, "keeps dying", "the process that flies")
        self._flight = self._spawn()
        self._ready = False
        if self.arming.flying:
            self._ended("lost: the process that flew it has died")
        if self.server.lists[MissionType.MISSION]:
            text = StatusText("the process that flies has died; upload the mission again", CRITICAL)
            self._judged(MissionJudged(self._number, False, False, (text,)))

    def _take(self, event: Snapshot | Event) -> None:
        if isinstance(event, Snapshot):
            if event.finite:
                self.status.snapshot = event
                self._progress.on_leg(int(event.leg))
        elif isinstance(event, MissionJudged):
            self._judged(event)
        elif isinstance(event, FlightEnded):
            self._ended(event.ended)
        elif isinstance(event, ProcessReady):
            self._deaths = 0
            self._ready = True
            self._show("ready")
        else:
            self._send_texts(event.texts)

    def _judged(self, judged: MissionJudged) -> None:
        if judged.number != self._number:
            return
        self._outstanding = False
        if self.server.changed:
            # It is about a mission that is no longer here.
            self._changes()
            return
        before = self.arming.judged
        if not self._brief or before is None or before.texts != judged.texts:
            self._send_texts(judged.texts)
        disarmed = self.arming.mission_judged(judged)
        if disarmed:
            self.down.send_text(disarmed, WARNING)
        if judged.start is not None and judged.home is not None:
            self.status.snapshot, self.status.home = judged.start, judged.home
        self._progress.at_start()
        self._pass_on(self.requests.verdict_came())
        self._after_command()

    def _ended(self, ended: str) -> None:
        completed = ended == "completed"
        if completed:
            self._progress.completed()
        self.arming.flight_ended(completed)
        self._refresh()
        self.down.send_text(f"flight {ended}; disarmed", INFO if completed else CRITICAL)
        self._progress.send_current()
        if self._progress.first:
            # The next flight is of the whole mission again.
            self._progress.first = 0
            self.server.changed.add(MissionType.MISSION)

    def _refresh(self) -> None:
        arming, status = self.arming, self.status
        if (status.mode, status.armed, status.flying) != (arming.mode, arming.armed, arming.flying):
            # A change is sent at once.
            self.down.heartbeat_now()
        status.mode, status.armed, status.flying = arming.mode, arming.armed, arming.flying
        status.ready, status.mission_state = arming.armable or arming.armed, arming.mission_state
        self._progress.refresh()
