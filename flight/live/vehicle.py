"""The live vehicle: stations on one side, the process that flies on the other, and the state between them."""

import contextlib
import errno
import select
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.arming import Pilot
from flight.live.downlink import CRITICAL, INFO, WARNING, Downlink, Tell
from flight.live.flight_process import Ended, Fly, Judge, Landed, Ready, Stop, Up, read_answer
from flight.live.link import Link, Peer
from flight.live.mavlink_items import MissionType
from flight.live.mission_server import MissionServer, Station
from flight.live.parameters import Parameters
from flight.live.snapshot import Moment
from flight.live.station_missions import listed, uploaded
from flight.live.station_requests import Reply, Requests
from flight.live.telemetry import ACTIVE, COMPLETE, Status, telemetry_message
from flight.mission.items import Home, Mission

# Longest wait for the network or the flight, s.
_NAP = 0.02
# How long a process that is to end may be silent, s.
_LAST_WORDS = 10.0
_MOST_DEATHS = 3
# Within this time (s) the same answer is said once.
_SAME = 3.0


class Vehicle:
    """A vehicle that stands ready, takes missions, and flies them when it is told to.

    tell: is given what a person at the terminal should read.
    """

    def __init__(
        self,
        link: Link,
        spawn: Callable[[], Connection],
        parameters: Parameters,
        where: tuple[Moment, Home],
        battery: float,
        tell: Tell,
    ) -> None:
        """spawn: starts a process that flies.  where: the aircraft before it has a mission, and home.  battery: Wh."""
        self.link = link
        self.server = MissionServer()
        self.pilot = Pilot()
        self.status = Status(where[0], where[1], battery=battery)
        self.down = Downlink(link, self.status, parameters, tell, _NAP)
        self.requests = Requests(self.pilot, parameters, self.status)
        self._where = where
        self._spawn = spawn
        # In a row, without being ready in between.
        self._deaths = 0
        self._flight = spawn()
        self._parameters = parameters
        self._tell = tell
        self._clock = time.monotonic
        self._born = self._clock()
        # Which mission is judged or flown: the item at each waypoint, and what to add to it for the station's number.
        self._number = 0
        self._outstanding = self._brief = False
        self._said = ("", 0.0)
        self._shift = 0
        self._leg = -1

    def load(self, mission: Mission) -> None:
        """Take a mission from a file, as if a station had uploaded it."""
        for kind, items in zip(MissionType, listed(mission), strict=True):
            self.server.lists[kind] = items
        self.server.changed.add(MissionType.MISSION)

    def run(self, stop: Callable[[], bool]) -> None:
        """Serve until ``stop`` says so, then end the flight and its process."""
        while not stop():
            self.step(_NAP)

    def close(self) -> None:
        """Have the process that flies end its flight and itself; what it still says goes to the terminal."""
        with contextlib.suppress(OSError, EOFError):
            self._flight.send(Stop(quit=True))
            while self._flight.poll(_LAST_WORDS):
                found = read_answer(self._flight.recv_bytes())
                if isinstance(found, Landed):
                    for severity, text in found.words:
                        self.down.say(text, severity)
        self._flight.close()

    def step(self, patience: float) -> None:
        """Wait for something to do, at most ``patience`` s, and do it."""
        wire, flight = self.link.fileno(), self._flight.fileno()
        readable, _, _ = select.select([wire, flight], [], [], self.down.wait(self._clock(), patience))
        now = self._clock()
        self.status.boot, self.status.wall = now - self._born, time.time()
        if flight in readable:
            self._from_flight()
        if wire in readable:
            for message, peer in self.link.receive():
                self._from_station(message, peer, now)
        for reply in self.server.tick(now):
            self._send_reply(reply.station, reply.message, reply.text)
        self._changes()
        self.down.tick(now)
        used = self._clock() - now
        self.status.load += 0.01 * (used / max(used, patience) - self.status.load)

    def _from_station(self, message: Any, peer: Peer, now: float) -> None:
        self.server.locked = "in flight: the mission cannot change" if self.pilot.flying else ""
        station = Station(peer.address, message.get_srcSystem(), message.get_srcComponent())
        for reply in self.server.handle(message, station, now):
            self._send_reply(reply.station, reply.message, reply.text)
        self._changes()
        self._pass_on(self.requests.handle(message, peer, now))
        self._after_command()

    def _pass_on(self, replies: list[Reply]) -> None:
        for peer, content in replies:
            if peer is None:
                severity, text = content
                now = self._clock()
                # A station that tries again within a moment is told once.
                if self._said[0] != text or now - self._said[1] > _SAME:
                    self.down.say(text, severity)
                self._said = (text, now)
            else:
                self.link.send(content, peer)

    def _send_reply(self, station: Station, message: Any, text: str) -> None:
        peer = next((peer for address, peer in self.link.peers.items() if address == station.address), None)
        if peer is not None:
            self.link.send(message, peer)
        if text:
            self.down.say(text, WARNING)

    def _after_command(self) -> None:
        if self.pilot.stop_asked:
            self.pilot.stop_asked = False
            self._order(Stop())
        if self.pilot.starts:
            self.pilot.took_off()
            self._leg = -1
            self.down.say("mission started")
            self._order(Fly())
        self._refresh()

    def _changes(self) -> None:
        """Have a changed mission judged; a fence or rally points that change belong to it."""
        # One order at a time: stations that upload faster than missions are judged must not fill the pipe.
        if not self.server.changed or self.pilot.flying or self._outstanding:
            return
        changed = set(self.server.changed)
        self.server.changed.clear()
        totals = {"MIS_TOTAL": MissionType.MISSION, "FENCE_TOTAL": MissionType.FENCE, "RALLY_TOTAL": MissionType.RALLY}
        for name, kind in totals.items():
            self._parameters.put(name, float(len(self.server.lists[kind])))
        self._number += 1
        if not self.server.lists[MissionType.MISSION]:
            self.pilot.cleared()
            self.status.moment, self.status.home = self._where
            self._pass_on(self.requests.verdict_came())
            self._refresh()
            return
        mission, self._shift = uploaded(self.server.lists, self._where[1])
        # A fence or rally points that are changed need not repeat what was said of the mission.
        self._brief = MissionType.MISSION not in changed and (self._brief or not self.pilot.judging)
        self.pilot.uploaded()
        self._outstanding = True
        self._order(Judge(mission, self._number))
        self._refresh()

    def _order(self, order: Judge | Fly | Stop) -> None:
        try:
            self._flight.send(order)
        except (BrokenPipeError, ConnectionResetError):
            self._lost()

    def _from_flight(self) -> None:
        try:
            while self._flight.poll():
                self._take(read_answer(self._flight.recv_bytes()))
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self._lost()

    def _lost(self) -> None:
        """Start another process in place of one that has died: JSBSim can abort, and that must not end the vehicle."""
        self._flight.close()
        self._deaths += 1
        if self._deaths >= _MOST_DEATHS:
            raise ChildProcessError(errno.ECHILD, "keeps dying", "the process that flies")
        self._flight = self._spawn()
        if self.pilot.flying:
            self._ended("lost: the process that flew it has died")
        if self.server.lists[MissionType.MISSION]:
            words = ((CRITICAL, "the process that flies has died; upload the mission again"),)
            self._judged(Ready(self._number, False, False, words))

    def _take(self, answer: Moment | Up | Ready | Ended | Landed) -> None:
        if isinstance(answer, Moment):
            if answer.finite:
                self.status.moment = answer
                self._progress(int(answer.leg))
        elif isinstance(answer, Ready):
            self._judged(answer)
        elif isinstance(answer, Ended):
            self._ended(answer.ended)
        elif isinstance(answer, Up):
            self._deaths = 0
            self._tell("ready")
        else:
            for severity, text in answer.words:
                self.down.say(text, severity)

    def _judged(self, ready: Ready) -> None:
        if ready.number != self._number:
            return
        self._outstanding = False
        if self.server.changed:
            # It is about a mission that is no longer here.
            self._changes()
            return
        known = self.pilot.ready
        if not self._brief or known is None or known.words != ready.words:
            for severity, text in ready.words:
                self.down.say(text, severity)
        disarmed = self.pilot.judged(ready)
        if disarmed:
            self.down.say(disarmed, WARNING)
        if ready.start is not None and ready.home is not None:
            self.status.moment, self.status.home = ready.start, ready.home
        self.status.current = self._item(0)
        self._pass_on(self.requests.verdict_came())
        self._after_command()

    def _ended(self, ended: str) -> None:
        completed = ended == "completed"
        if completed and self.pilot.ready is not None:
            self._reached(len(self.pilot.ready.items) - 1)
        self.pilot.ended(completed)
        self._refresh()
        self.down.say(f"flight {ended}; disarmed", INFO if completed else CRITICAL)
        self.down.to_all(telemetry_message("MISSION_CURRENT", self.status))

    def _progress(self, leg: int) -> None:
        """Tell the waypoints that were reached since the last moment."""
        if leg == self._leg or leg < 0:
            return
        for waypoint in range(max(0, self._leg + 1), leg + 1):
            self._reached(waypoint)
        self._leg = leg
        self.status.current = self._item(leg + 1)
        self.down.to_all(telemetry_message("MISSION_CURRENT", self.status))

    def _reached(self, waypoint: int) -> None:
        ready = self.pilot.ready
        if ready is None or not 0 <= waypoint < len(ready.items) or ready.items[waypoint] < 0:
            return
        self.down.to_all(mavlink.MAVLink_mission_item_reached_message(self._item(waypoint)))

    def _item(self, waypoint: int) -> int:
        """Station's number of the item at a waypoint, or of the next that is one."""
        ready = self.pilot.ready
        items = ready.items if ready is not None else ()
        following = [item for item in items[waypoint:] if item >= 0] or [item for item in items if item >= 0][-1:]
        return following[0] + self._shift if following else 0

    def _refresh(self) -> None:
        pilot, status = self.pilot, self.status
        if (status.mode, status.armed, status.flying) != (pilot.mode, pilot.armed, pilot.flying):
            # A change is told at once.
            self.down.hello_now()
        status.mode, status.armed, status.flying = pilot.mode, pilot.armed, pilot.flying
        status.ready, status.mission_state = pilot.armable or pilot.armed, pilot.mission_state
        items = self.server.lists[MissionType.MISSION]
        status.total = max(0, len(items) - 1) if items else 0
        if pilot.mission_state not in (ACTIVE, COMPLETE):
            status.current = self._item(0) if pilot.ready is not None else 0
