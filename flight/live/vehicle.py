"""Run the live vehicle, which connects the stations' link with the flight process."""

import contextlib
import errno
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.arming import ACCEPTED, DENIED, ArmingState, CommandResult
from flight.live.flight_process import (
    DivertFlight,
    EndFlight,
    Event,
    FlightDiverted,
    FlightEnded,
    FlightJudged,
    FlightRequest,
    JudgeMission,
    LoiterCenter,
    MissionJudged,
    ProcessReady,
    StartFlight,
    read_event,
)
from flight.live.link import Link, Peer
from flight.live.mission_server import (
    MissionServer,
    MissionType,
    Station,
    mission_from_item,
    mission_lists,
    start_problem,
    uploaded_mission,
)
from flight.live.station_requests import PARAMETERS_PER_SECOND, Parameters, Requests, Response
from flight.live.telemetry import (
    ACTIVE,
    AUTO,
    COMPLETE,
    CRITICAL,
    INFO,
    MODE_NAMES,
    PAUSED,
    WARNING,
    Snapshot,
    Status,
    StatusText,
    heartbeat,
    status_texts,
    telemetry_message,
)
from flight.mission.items import Home, Mission, MissionItem

# ----------------------------------------------------------------------
# Messages that a live vehicle sends without a request: heartbeats, telemetry, texts, parameter streams.

# Maximum delay of a message, s; a later one is skipped.
_MAX_DELAY_S = 0.5
# Interval of heartbeats, and of checks of a message that a station has switched off, s.
_HEARTBEAT_PERIOD_S = 1.0

# Function that shows a text at the terminal.
ShowText = Callable[[str], None]


class Downlink:
    """Sender of messages to every station that has sent a heartbeat.

    show: function that shows each text at the terminal.
    max_tick_interval: maximum time between two calls of `tick`, s, which bounds the number of parameters sent at once.
    """

    def __init__(
        self, link: Link, status: Status, parameters: Parameters, show: ShowText, max_tick_interval: float
    ) -> None:
        """Make the first heartbeat due at once.

        status: state of the vehicle, which telemetry reports.
        """
        self._link = link
        self._status = status
        self._parameters = parameters
        self._show = show
        self._max_tick_interval = max_tick_interval
        self._text_count = 0
        self._next_heartbeat = link.clock()

    def send_text(self, text: str, severity: int = INFO) -> None:
        """Send a text to every station, and show it at the terminal."""
        self._show(text)
        self._text_count = self._text_count % 65535 + 1
        for peer in self._link.peers.values():
            for piece in status_texts(text, severity, self._text_count):
                self._link.send(piece, peer)

    def send_to_all(self, message: Any) -> None:
        """Send one message to every station."""
        for peer in self._link.peers.values():
            self._link.send(message, peer)

    def request_heartbeat(self) -> None:
        """Make the next heartbeat due at once, for contents that have changed."""
        self._next_heartbeat = self._link.clock()

    def wait_time(self, now: float, max_wait: float) -> float:
        """Return the time until the next message is due, s; at most ``max_wait``."""
        due_time = min(
            (time for peer in self._link.peers.values() for time in peer.due.values()), default=now + max_wait
        )
        return max(0.0, min(max_wait, due_time - now, self._next_heartbeat - now))

    def tick(self, now: float) -> None:
        """Send all messages that are due."""
        if now >= self._next_heartbeat:
            self._next_heartbeat = (
                now + _HEARTBEAT_PERIOD_S
                if now - self._next_heartbeat > _MAX_DELAY_S
                else self._next_heartbeat + _HEARTBEAT_PERIOD_S
            )
            self._link.remove_silent_peers()
            self._link.send_heartbeat(heartbeat(self._status))
        for peer in self._link.peers.values():
            # Send the telemetry that is due. A message that the station has switched off becomes due again after a
            # heartbeat's period.
            for name, due_time in peer.due.items():
                if now < due_time:
                    continue
                period = peer.periods[name]
                if period is None:
                    peer.due[name] = now + _HEARTBEAT_PERIOD_S
                    continue
                self._link.send(telemetry_message(name, self._status), peer)
                peer.due[name] = due_time + period if now - due_time < _MAX_DELAY_S else now + period
            # Send the next parameters to a station that requested all of them.
            if peer.next_parameter is not None:
                first_number, entries = int(peer.next_parameter), self._parameters.entries
                peer.next_parameter += max(1.0, PARAMETERS_PER_SECOND * self._max_tick_interval)
                for number in range(first_number, min(int(peer.next_parameter), len(entries))):
                    self._link.send(self._parameters.message(number), peer)
                if peer.next_parameter >= len(entries):
                    peer.next_parameter = None


# ----------------------------------------------------------------------
# Progress of a flight along its mission, in the stations' numbers of its items.


class MissionProgress:
    """Reporter of the current item and the reached items to stations.

    shift: offset from an item's seq to the station's number.
    first: the station's number of the item at which the next flight starts; 0 for the whole mission.
    """

    def __init__(self, server: MissionServer, arming: ArmingState, status: Status, downlink: Downlink) -> None:
        """Start with a whole mission, from its first item.

        status: state of the vehicle, whose mission fields are updated.
        """
        self._server = server
        self._arming = arming
        self._status = status
        self._downlink = downlink
        self._leg = -1
        # Seq of the item at each waypoint of a diverted route, or None on the judged mission.
        self._route_items: tuple[int, ...] | None = None
        self.shift = 0
        self.first = 0

    def start_flight(self) -> None:
        """Reset the progress for a new flight."""
        self._leg, self._route_items = -1, None

    def start_route(self, items: tuple[int, ...]) -> None:
        """Reset the progress for another route.

        items: seq of the mission's item at each waypoint; empty for a route outside the mission.
        """
        self._leg, self._route_items = -1, items

    def reset_current_item(self) -> None:
        """Set the current item to the item at which the next flight starts."""
        self._status.current = self.first or (self._station_number(0) if self._arming.last_verdict is not None else 0)

    def refresh(self) -> None:
        """Update the mission fields of the status."""
        items = self._server.lists[MissionType.MISSION]
        self._status.total = max(0, len(items) - 1) if items else 0
        if self._arming.mission_state not in (ACTIVE, PAUSED, COMPLETE):
            self.reset_current_item()

    def report_leg(self, leg: int) -> None:
        """Report to stations the items that were reached since the last call, and the new current item.

        leg: index of the active leg; the waypoint at its start was reached last.
        """
        if leg == self._leg or leg < 0 or not self._waypoint_items():
            return
        for waypoint in range(max(0, self._leg + 1), leg + 1):
            self._report_reached(waypoint)
        self._leg = leg
        self._status.current = self._station_number(leg + 1)
        self.send_mission_current()

    def report_completion(self) -> None:
        """Report the last waypoint as reached."""
        self._report_reached(len(self._waypoint_items()) - 1)

    def send_mission_current(self) -> None:
        """Send MISSION_CURRENT, the number of the current item, to all stations."""
        message: Any = telemetry_message("MISSION_CURRENT", self._status)
        self._downlink.send_to_all(message)

    def _report_reached(self, waypoint: int) -> None:
        """Report the item at a waypoint as reached, if the waypoint has an item."""
        items = self._waypoint_items()
        if 0 <= waypoint < len(items) and items[waypoint] >= 0:
            self._downlink.send_to_all(mavlink.MAVLink_mission_item_reached_message(self._station_number(waypoint)))

    def _waypoint_items(self) -> tuple[int, ...]:
        """Return the item number (seq) at each waypoint of the flown mission; -1 without an item.

        Before a flight they are the numbers of the judged mission; () if none was judged.
        """
        if self._route_items is not None:
            return self._route_items
        return () if self._arming.last_verdict is None else self._arming.last_verdict.items

    def _station_number(self, waypoint: int) -> int:
        """Return the number that stations use for a waypoint's item, or for the next waypoint with an item.

        After the last item the result is the number of that item; it is 0 without any item.
        """
        items = self._waypoint_items()
        next_items = [item for item in items[waypoint:] if item >= 0] or [item for item in items if item >= 0][-1:]
        return next_items[0] + self.shift if next_items else 0


# Maximum wait for the network or the flight, s.
_MAX_WAIT_S = 0.02
# Time for the flight process to close its log when the vehicle is shut down, s.
CLOSE_TIMEOUT_S = 0.8
# Number of crashes in a row after which the vehicle gives up.
_MAX_CRASHES = 3
# Time within which the same text is sent only once, s.
_REPEATED_TEXT_TIME_S = 3.0


class Standby(NamedTuple):
    """An aircraft without a mission, and its home."""

    snapshot: Snapshot
    home: Home


class Vehicle:
    """A vehicle on the ground that accepts missions, and flies them on a station's command."""

    def __init__(
        self,
        link: Link,
        spawn: Callable[[], Connection],
        parameters: Parameters,
        standby: Standby,
        battery: float,
        volts: float,
        show: ShowText,
    ) -> None:
        """Start the flight process.

        link: link to the stations.
        spawn: function that starts a flight process, and returns this end of its pipe.
        parameters: parameters that stations may read, and partly set.
        standby: aircraft before it has a mission.
        battery: energy of the full battery, Wh.
        volts: battery voltage, V; 0 without a battery.
        show: function that shows a text at the terminal.
        """
        self.link = link
        self.arming = ArmingState()
        self.server = MissionServer(
            # Fly to the item's position, and loiter there.
            go_to=lambda item: self.arming.go_to(LoiterCenter(item.lat_deg, item.lon_deg, item.alt, item.frame)).text
        )
        self.status = Status(standby.snapshot, standby.home, battery=battery, volts=volts)
        self.downlink = Downlink(link, self.status, parameters, show, _MAX_WAIT_S)
        self.requests = Requests(self.arming, parameters, self.status, self._set_start_item)
        self._standby = standby
        self._spawn = spawn
        # Number of crashes since the process was last ready.
        self._crash_count = 0
        self._flight = spawn()
        self._ready = False
        self._parameters = parameters
        self._show = show
        self._clock = link.clock
        self._start_time = self._clock()
        # Number of the mission that is judged or flown.
        self._mission_number = 0
        self._awaits_verdict = self._is_brief = False
        # Upload for which the start item of the next flight was chosen.
        self._start_item_upload: tuple[MissionItem, ...] = ()
        # Parameters of the autopilot with which the mission is judged and flown.
        self._autopilot_parameters: tuple[tuple[str, float], ...] = ()
        self._last_text, self._last_text_time = "", 0.0
        self._progress = MissionProgress(self.server, self.arming, self.status, self.downlink)

    def load(self, mission: Mission) -> None:
        """Load a mission with its fence and rally points, as if a ground station had uploaded them."""
        for kind, items in zip(MissionType, mission_lists(mission), strict=True):
            self.server.lists[kind] = items
        self.server.changed.add(MissionType.MISSION)

    def load_fence_and_rally(self, fences: Sequence[MissionItem], rally: Sequence[MissionItem] = ()) -> None:
        """Load fence items and rally points, as if a ground station had uploaded them.

        They apply to missions that are loaded later.
        """
        for kind, items in ((MissionType.FENCE, fences), (MissionType.RALLY, rally)):
            if items:
                self.server.lists[kind] = tuple(items)
                self.server.changed.add(kind)

    def run(self, stop: Callable[[], bool]) -> None:
        """Serve stations until ``stop`` returns True; `close` then ends the flight and its process."""
        while not stop():
            self.step(_MAX_WAIT_S)

    def close(self) -> None:
        """End the flight and its process; show the process's last texts at the terminal."""
        deadline = self._clock() + CLOSE_TIMEOUT_S
        with contextlib.suppress(OSError, EOFError):
            if self._ready:
                self._flight.send(EndFlight(quit=True))
            while self._ready and self._flight.poll(max(0.0, deadline - self._clock())):
                event = read_event(self._flight.recv_bytes())
                if isinstance(event, FlightJudged):
                    self._send_texts(event.texts)
        self._flight.close()

    def step(self, max_wait: float) -> None:
        """Wait for events, at most ``max_wait`` s, and handle them."""
        sources: list[Any] = [self.link, self._flight]
        ready_sources: list[Any] = wait(sources, self.downlink.wait_time(self._clock(), max_wait))
        now = self._clock()
        self.status.boot, self.status.wall = now - self._start_time, time.time()
        if self._flight in ready_sources:
            # A flight process that has died is started again.
            try:
                while self._flight.poll():
                    self._handle_event(read_event(self._flight.recv_bytes()))
            except (EOFError, BrokenPipeError, ConnectionResetError):
                self._restart_process()
        if self.link in ready_sources:
            for message, peer in self.link.receive():
                self._handle_message(message, peer, now)
            for notice in self.link.pop_notices():
                self._show(notice)
        for reply in self.server.tick(now):
            self._send_reply(reply.station, reply.message, reply.text)
        self._judge_changes()
        self.downlink.tick(now)
        busy_time = self._clock() - now
        self.status.load += 0.01 * (busy_time / max(busy_time, max_wait) - self.status.load)

    def _handle_message(self, message: Any, peer: Peer, now: float) -> None:
        """Handle a message of a station: mission protocol, commands and parameters."""
        self.server.locked = "in flight: the mission cannot change" if self.arming.flying else ""
        station = Station(peer.address, message.get_srcSystem(), message.get_srcComponent())
        for reply in self.server.handle(message, station, now):
            self._send_reply(reply.station, reply.message, reply.text)
        self._judge_changes()
        self._send_responses(self.requests.handle(message, peer, now))
        if (
            self._autopilot_parameters != tuple(self._parameters.stated.items())
            and self.server.lists[MissionType.MISSION]
        ):
            self.server.changed.add(MissionType.MISSION)
            self._judge_changes()
        self._apply_state()

    def _send_responses(self, responses: list[Response]) -> None:
        """Send messages to their stations, and texts to all stations."""
        for response in responses:
            if not isinstance(response, StatusText):
                self.link.send(response.message, response.peer)
                continue
            now = self._clock()
            # Send a text only once if the station soon repeats its request.
            if self._last_text != response.text or now - self._last_text_time > _REPEATED_TEXT_TIME_S:
                self.downlink.send_text(*response)
            self._last_text, self._last_text_time = response.text, now

    def _send_texts(self, texts: tuple[StatusText, ...]) -> None:
        """Send texts with their severities to all stations."""
        for text in texts:
            self.downlink.send_text(*text)

    def _send_reply(self, station: Station, message: Any, text: str) -> None:
        """Send a reply of the mission protocol to its station, and its text, if any, to all stations."""
        peer = next((peer for address, peer in self.link.peers.items() if address == station.address), None)
        if peer is not None:
            self.link.send(message, peer)
        if text:
            self.downlink.send_text(text, WARNING)

    def _apply_state(self) -> None:
        """Act on the requests in the arming state: end, divert or start the flight."""
        if self.arming.end_requested:
            self.arming.end_requested = False
            self._send_request(EndFlight())
        if self.arming.loiter_center is not None:
            # Divert to the mission's current item, to home, or to a loiter.
            mission, shift = uploaded_mission(self.server.lists, self._standby.home)
            mission = replace(mission, home=self.status.home)
            if self.arming.mode == AUTO:
                mission = mission_from_item(mission, self.status.current - shift)
            self._send_request(DivertFlight(self.arming.mode, mission, self.arming.loiter_center))
            self.arming.loiter_center = None
        if self.arming.should_start:
            self.arming.on_flight_started()
            self._progress.start_flight()
            self.downlink.send_text("mission started")
            self._send_request(StartFlight())
        self._refresh_status()

    def _judge_changes(self) -> None:
        """Request a verdict if mission, fence, rally points or autopilot parameters have changed."""
        # One request at a time, so that stations that upload faster than missions are judged do not fill the pipe.
        if not self.server.changed or self.arming.flying or self._awaits_verdict:
            return
        changed_lists = set(self.server.changed)
        self.server.changed.clear()
        totals = {"MIS_TOTAL": MissionType.MISSION, "FENCE_TOTAL": MissionType.FENCE, "RALLY_TOTAL": MissionType.RALLY}
        for name, kind in totals.items():
            self._parameters.set_value(name, float(len(self.server.lists[kind])))
        self._mission_number += 1
        if not self.server.lists[MissionType.MISSION]:
            self.arming.on_mission_cleared()
            self.status.snapshot, self.status.home = self._standby
            self._send_responses(self.requests.answer_waiting_arm_commands())
            self._refresh_status()
            return
        if self.server.lists[MissionType.MISSION] is not self._start_item_upload:
            self._progress.first = 0
        mission, self._progress.shift = uploaded_mission(self.server.lists, self._standby.home)
        mission = mission_from_item(mission, self._progress.first - self._progress.shift)
        # A changed fence or changed rally points need not repeat the texts about the mission.
        self._is_brief = MissionType.MISSION not in changed_lists and (self._is_brief or not self.arming.is_judging)
        self.arming.on_mission_uploaded()
        self._awaits_verdict = True
        self._autopilot_parameters = tuple(self._parameters.stated.items())
        self._send_request(JudgeMission(mission, self._mission_number, self._autopilot_parameters))
        self._refresh_status()

    def _set_start_item(self, seq: int) -> CommandResult:
        """Set the item from which the next flight starts or, in flight, at which the flight continues.

        seq: number that the station uses for the item.

        On the ground, the mission is judged again from the new item on.
        """
        mission, shift = uploaded_mission(self.server.lists, self._standby.home)
        problem = start_problem(mission, seq - shift, in_flight=self.arming.flying)
        if self.arming.flying and not problem:
            self.status.current = seq
            if self.arming.mode == AUTO:
                self.arming.continue_from_current_item()
            return CommandResult(ACCEPTED)
        if problem:
            return CommandResult(DENIED, f"item {seq} refused: {problem}")
        start_item = 0 if seq - shift <= mission.items[0].seq else seq
        if start_item != self._progress.first:
            self._progress.first, self._start_item_upload = start_item, self.server.lists[MissionType.MISSION]
            self.server.changed.add(MissionType.MISSION)
            self._judge_changes()
        return CommandResult(ACCEPTED)

    def _send_request(self, request: FlightRequest) -> None:
        """Send a request to the flight process; restart the process if it has died."""
        try:
            self._flight.send(request)
        except (BrokenPipeError, ConnectionResetError):
            self._restart_process()

    def _restart_process(self) -> None:
        """Start another flight process after a crash, because an abort of JSBSim must not end the vehicle.

        A flight in progress is lost, and stations must upload the mission again. Raises ChildProcessError after
        `_MAX_CRASHES` crashes in a row.
        """
        self._flight.close()
        self._crash_count += 1
        if self._crash_count >= _MAX_CRASHES:
            raise ChildProcessError(errno.ECHILD, "keeps dying", "the flight process")
        self._flight = self._spawn()
        self._ready = False
        if self.arming.flying:
            self._handle_flight_end("lost: the flight process has died")
        if self.server.lists[MissionType.MISSION]:
            text = StatusText("the flight process has died; upload the mission again", CRITICAL)
            self._handle_verdict(MissionJudged(self._mission_number, False, False, (text,)))

    def _handle_event(self, event: Snapshot | Event) -> None:
        """Handle an event of the flight process."""
        if isinstance(event, Snapshot):
            if event.is_finite:
                self.status.snapshot = event
                self._progress.report_leg(int(event.leg))
        elif isinstance(event, MissionJudged):
            self._handle_verdict(event)
        elif isinstance(event, FlightDiverted):
            # Without a diversion, the previous mode is restored.
            if event.problem:
                requested_mode, self.arming.mode = self.arming.mode, event.mode
                self.arming.set_flight_mode(event.mode)
                self.downlink.send_text(f"{MODE_NAMES[requested_mode]} refused: {event.problem}", WARNING)
            else:
                self._progress.start_route(event.items if event.mode == AUTO else ())
                self.downlink.send_text(f"flying in {MODE_NAMES[event.mode]}")
            self._refresh_status()
        elif isinstance(event, FlightEnded):
            self._handle_flight_end(event.end_reason)
        elif isinstance(event, ProcessReady):
            self._crash_count = 0
            self._ready = True
            self._show("ready")
        else:
            self._send_texts(event.texts)

    def _handle_verdict(self, verdict: MissionJudged) -> None:
        """Report the verdict on the current mission, and disarm if it forbids flight.

        A verdict on an earlier mission is ignored.
        """
        if verdict.number != self._mission_number:
            return
        self._awaits_verdict = False
        if self.server.changed:
            # The verdict is about a mission that was replaced.
            self._judge_changes()
            return
        previous_verdict = self.arming.last_verdict
        if not self._is_brief or previous_verdict is None or previous_verdict.texts != verdict.texts:
            self._send_texts(verdict.texts)
        disarm_reason = self.arming.on_mission_judged(verdict)
        if disarm_reason:
            self.downlink.send_text(disarm_reason, WARNING)
        if verdict.start is not None and verdict.home is not None:
            self.status.snapshot, self.status.home = verdict.start, verdict.home
        self._progress.reset_current_item()
        self._send_responses(self.requests.answer_waiting_arm_commands())
        self._apply_state()

    def _handle_flight_end(self, end_reason: str) -> None:
        """Disarm after a flight, and report its end to stations."""
        is_completed = end_reason == "completed"
        if is_completed and self.arming.mode == AUTO:
            self._progress.report_completion()
        self.arming.on_flight_ended(is_completed)
        self._refresh_status()
        self.downlink.send_text(f"flight {end_reason}; disarmed", INFO if is_completed else CRITICAL)
        self._progress.send_mission_current()
        if self._progress.first:
            # The next flight flies the whole mission again.
            self._progress.first = 0
            self.server.changed.add(MissionType.MISSION)

    def _refresh_status(self) -> None:
        """Copy the arming state to the status, and send a heartbeat at once if mode or arming has changed."""
        arming, status = self.arming, self.status
        if (status.mode, status.armed, status.flying) != (arming.mode, arming.armed, arming.flying):
            # Send a change immediately.
            self.downlink.request_heartbeat()
        status.mode, status.armed, status.flying = arming.mode, arming.armed, arming.flying
        status.ready, status.mission_state = arming.can_arm or arming.armed, arming.mission_state
        self._progress.refresh()
