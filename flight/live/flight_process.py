"""Run the flight of the live vehicle in its own process, because JSBSim holds the interpreter's lock.

Requests arrive over a pipe and events go back: a state snapshot as packed bytes, everything else pickled. Both ends
belong to planfly; nothing from a station is ever unpickled.

| request | meaning |
|---|---|
| `JudgeMission` | return a verdict on a mission, without a flight |
| `StartFlight` | fly the mission that was judged last |
| `DivertFlight` | take another route from the aircraft's position, in the current flight |
| `EndFlight` | end the flight, or the process |

| event | time |
|---|---|
| `ProcessReady` | once, before the first request is read |
| `MissionJudged` | for each `JudgeMission` |
| `flight.live.telemetry.Snapshot` | in flight, `SNAPSHOT_RATE_HZ` times a second |
| `FlightDiverted` | for each `DivertFlight` in flight |
| `FlightEnded` | when the aircraft stops |
| `FlightJudged` | for each log that is closed: one, and one more for each diversion |

A diversion ends one flight and begins the next in the air; each flight has its own setup, log and verdict.
"""

import math
import pickle
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Protocol

from aircraft.catalog import Aircraft
from flight.live.telemetry import AUTO, CRITICAL, GUIDED, LOITER, MODE_NAMES, Snapshot, SnapshotMaker, StatusText
from flight.mission.items import Frame, Home, Mission
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import TICK_S, Flight, LocalMap
from flight.simulation.track import Rows, Track, as_track, join_rows
from world.arrays import Floats
from world.errors import PlanflyError

# Rate of the snapshots, 1/s.
SNAPSHOT_RATE_HZ = 60.0
# Interval at which the log is flushed, s.
FLUSH_PERIOD_S = 0.2
# Maximum delay of the flight behind the clock that is made up, s; a longer delay remains.
_MAX_DELAY_S = 0.5
# First byte of a packed snapshot.
_PACKED_MARK = b"S"
# First byte of a pickled event.
_PICKLED_MARK = b"E"
# End reason of a flight that a station stopped.
STOPPED = "stopped by the ground station"
# End reason of a flight at the shutdown of the vehicle.
SHUT_DOWN = "stopped: the vehicle was shut down"
# Beginning of the end reason of a route that a diversion left; the name of the new mode follows.
DIVERTED_TEXT = "left at a ground station's request for "
# End reason of a log that ends while the loiter continues.
STILL_LOITERING_TEXT = "the log ends here; the aircraft continues to loiter"
# Maximum number of logs of one loiter.
_MAX_LOITER_LOGS = 16


@dataclass(frozen=True, slots=True)
class JudgeMission:
    """Request: judge a mission in the vehicle's scenario.

    number: number that the event repeats.
    parameters: parameters of the simulated autopilot by name, as set by stations.
    """

    mission: Mission
    number: int
    parameters: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, slots=True)
class StartFlight:
    """Request: fly the mission that was judged last."""


@dataclass(frozen=True, slots=True)
class LoiterCenter:
    """Center of a loiter that a ground station requests.

    lat_deg, lon_deg: NaN for the aircraft's position.
    alt: m in the frame, NaN for the aircraft's altitude.
    frame: MAV_FRAME.
    radius: m, 0 for the autopilot's own radius.
    """

    lat_deg: float = math.nan
    lon_deg: float = math.nan
    alt: float = math.nan
    frame: int = int(Frame.GLOBAL)
    radius: float = 0.0


@dataclass(frozen=True, slots=True)
class DivertFlight:
    """Request: leave the current route for another one, from the aircraft's position.

    mode: ArduPlane's number: AUTO flies the mission's items, RTL returns, LOITER and GUIDED loiter at ``center``.
    mission: home, rally points and fence; in AUTO with the remaining items.
    """

    mode: int
    mission: Mission
    center: LoiterCenter = LoiterCenter()


@dataclass(frozen=True, slots=True)
class EndFlight:
    """Request: end the flight, and with ``quit`` also the process."""

    quit: bool = False


@dataclass(frozen=True, slots=True)
class ProcessReady:
    """Event: the process runs, and its compiled code is loaded."""


@dataclass(frozen=True, slots=True)
class MissionJudged:
    """Event: a mission has been judged.

    number: number of the request.
    possible: True if the mission can be started at all.
    flyable: False if a finding of its geometry failed.
    texts: texts on the mission for stations.
    home: home of the mission, or the ground at its start; None if not possible.
    items: seq of the item at each waypoint, -1 without an item.
    start: aircraft at the start of the flight; None if not possible.
    """

    number: int
    possible: bool
    flyable: bool
    texts: tuple[StatusText, ...]
    home: Home | None = None
    items: tuple[int, ...] = ()
    start: Snapshot | None = None


@dataclass(frozen=True, slots=True)
class FlightDiverted:
    """Event: the aircraft flies another route, or stays on its route because it cannot be diverted.

    mode: current mode of the flight.
    problem: reason why the flight cannot be diverted, or "".
    items: seq of the item at each waypoint, -1 for no item.
    """

    mode: int
    problem: str
    items: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class FlightEnded:
    """Event: the flight is over.

    end_reason: "completed", or the reason for the end.
    """

    end_reason: str


@dataclass(frozen=True, slots=True)
class FlightJudged:
    """Event: the flight has been judged and its log closed.

    texts: texts on the flight for stations.
    """

    flyable: bool
    texts: tuple[StatusText, ...]


FlightRequest = JudgeMission | StartFlight | DivertFlight | EndFlight
Event = ProcessReady | MissionJudged | FlightDiverted | FlightEnded | FlightJudged


class LogSink(Protocol):
    """Interface of a flight's log, which stores the rows and finally the verdict."""

    def write(self, block: Track) -> None:
        """Append rows, and flush them."""

    def finish(self, end_reason: str, should_abort: Callable[[], bool]) -> FlightJudged:
        """Judge the flight and close the log.

        should_abort: function that returns True if the process must end; it is called during long work.
        """

    def abandon(self) -> None:
        """Close the log of a flight that could not continue."""


@dataclass(frozen=True, slots=True)
class PreparedFlight:
    """Setup of a mission that can be started, and the local map of its flight."""

    setup: FlightSetup
    local_map: LocalMap


class FlightFactory(Protocol):
    """Interface of the application for the flight process: judge missions, find routes, open logs.

    speed: speed of the flight relative to real time.
    """

    aircraft: Aircraft
    speed: float

    def prepare(self, request: JudgeMission) -> tuple[PreparedFlight | None, MissionJudged]:
        """Judge a mission, and prepare its flight; the flight is None if the mission cannot be flown."""

    def prepare_diversion(self, request: DivertFlight, position: Floats) -> PreparedFlight:
        """Prepare a flight of the requested route that starts at a position on the map, (3,).

        Raises PlanflyError if there is no such route.
        """

    def open_log(self, setup: FlightSetup, mode: int) -> LogSink:
        """Open the log of the next flight.

        mode: ArduPlane's number, see `DivertFlight`.
        """


def serve_flights(connection: Connection, factory: FlightFactory) -> None:
    """Serve requests until the other end of the pipe closes, or until it requests the end of the process.

    connection: this end of a `multiprocessing.Pipe`; requests are pickled into the other end, and `read_event` reads
    its output.

    >>> from multiprocessing import Pipe
    >>> link_end, flying_end = Pipe()
    >>> link_end.send(EndFlight(quit=True))
    >>> serve_flights(flying_end, factory=None)  # a request to quit asks nothing of the factory
    """
    prepared: PreparedFlight | None = None
    requests = _RequestQueue(connection)
    try:
        while True:
            request = requests.next()
            if isinstance(request, JudgeMission):
                prepared, verdict = factory.prepare(request)
                send_event(connection, verdict)
            elif isinstance(request, StartFlight) and prepared is not None:
                if not _run_flight(connection, requests, prepared, factory):
                    return
            elif isinstance(request, EndFlight) and request.quit:
                return
    except (EOFError, BrokenPipeError, ConnectionResetError):
        # The link process has ended; the log is already closed.
        return


def send_event(connection: Connection, event: Event) -> None:
    """Send an event to the link; `read_event` reads it there.

    >>> from multiprocessing import Pipe
    >>> link_end, flying_end = Pipe()
    >>> send_event(flying_end, FlightEnded("completed"))
    >>> read_event(link_end.recv_bytes())
    FlightEnded(end_reason='completed')
    """
    connection.send_bytes(_PICKLED_MARK + pickle.dumps(event))


def read_event(data: bytes) -> Snapshot | Event:
    """Return the event or the snapshot in bytes that the flight process has sent."""
    if data[:1] == _PACKED_MARK:
        return Snapshot.unpack(data[1:])
    return pickle.loads(data[1:])


class _RequestQueue:
    """Queue of the requests in the order of their arrival."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._queued: deque[object] = deque()

    def next(self) -> object:
        """Wait for the next request, and return it.

        Raises EOFError if the link is gone.
        """
        return self._queued.popleft() if self._queued else self._connection.recv()

    def poll(self) -> object:
        """Return the next request without waiting; None if there is none.

        A closed link is returned as a request to end the process.
        """
        if not self._queued and not self._connection.poll():
            return None
        try:
            return self.next()
        except EOFError:
            return EndFlight(quit=True)

    def is_ending(self) -> bool:
        """Return True if the process must end, because of a request or a closed link.

        Requests that have arrived are moved to the queue, and none is removed from it.
        """
        try:
            while self._connection.poll():
                self._queued.append(self._connection.recv())
        except (EOFError, BrokenPipeError, ConnectionResetError):
            return True
        return any(isinstance(request, EndFlight) and request.quit for request in self._queued)


def _run_flight(
    connection: Connection, requests: _RequestQueue, prepared: PreparedFlight, factory: FlightFactory
) -> bool:
    """Fly a prepared mission in real time, log it and judge it; return False if the process must end.

    connection: this end of the pipe to the link, for events.
    requests: requests that arrive during the flight.
    """
    try:
        # A diverted flight continues in the same instance of JSBSim.
        flight = Flight(prepared.setup, factory.aircraft, local_map=prepared.local_map, engine="jsbsim")
        log = factory.open_log(prepared.setup, AUTO)
    except (PlanflyError, OSError) as error:
        send_event(connection, FlightEnded(f"not started: {error}"))
        send_event(connection, FlightJudged(False, (StatusText(f"flight not started: {error}", CRITICAL),)))
        return True
    logged_flight = _LoggedFlight(connection, requests, factory, flight, log)
    try:
        end_reason, should_continue = logged_flight.run_in_real_time()
        if should_continue:
            send_event(connection, FlightEnded(end_reason))
        events = logged_flight.finish(end_reason, requests.is_ending if should_continue else lambda: True)
    except OSError as error:
        logged_flight.abandon()
        # A broken pipe ends the process; a full disk ends only the flight.
        if isinstance(error, BrokenPipeError | ConnectionResetError):
            raise
        send_event(connection, FlightEnded(f"ended: its log cannot be written: {error.strerror}"))
        text = f"flight ended: its log cannot be written: {error.strerror}"
        events = [FlightJudged(False, (StatusText(text, CRITICAL),))]
        should_continue = True
    for event in events:
        send_event(connection, event)
    return should_continue


class _LoggedFlight:
    """A flight in progress, and the log of each route that it has flown."""

    def __init__(
        self, connection: Connection, requests: _RequestQueue, factory: FlightFactory, flight: Flight, log: LogSink
    ) -> None:
        self._connection, self._requests, self._factory = connection, requests, factory
        self._flight, self._mode = flight, AUTO
        self._snapshots = SnapshotMaker(flight.setup, flight.map)
        # Rows go to the last log; the earlier logs are judged after the flight, with the reasons in `_end_reasons`.
        self._logs, self._end_reasons = [log], list[str]()
        self._unwritten_rows: list[Rows] = []
        # The current loiter, or None, and the number of its logs.
        self._loiter: DivertFlight | None = None
        self._loiter_logs = 0

    def run_in_real_time(self) -> tuple[str, bool]:
        """Fly in real time until the flight ends, and serve the requests that arrive.

        Returns the end reason, and False if the process must end afterwards. If the flight falls behind the clock by
        more than `_MAX_DELAY_S`, the excess is not made up. A completed loiter of a diversion is flown again, with
        another log, up to `_MAX_LOITER_LOGS` times.
        """
        clock, speed = time.monotonic, self._factory.speed
        time_origin = start_time = clock()
        ticks, last_flush, snapshot_count = 0, time_origin, 0
        end_reason, should_continue = "", True
        while not end_reason:
            now = clock()
            due_ticks = int((now - time_origin) * speed / TICK_S) - ticks
            max_due_ticks = max(1, int(_MAX_DELAY_S * speed / TICK_S))
            if due_ticks > max_due_ticks:
                time_origin += (due_ticks - max_due_ticks) * TICK_S / speed
                due_ticks = max_due_ticks
            if due_ticks > 0:
                rows, end_reason = self._flight.fly_block(due_ticks)
                ticks += due_ticks
                if len(rows):
                    self._unwritten_rows.append(rows)
                    self._connection.send_bytes(_PACKED_MARK + self._snapshots.snapshot(rows[-1]).pack())
            if end_reason == "completed" and self._loiter is not None and self._loiter_logs < _MAX_LOITER_LOGS:
                self._loiter_logs += 1
                end_reason = "" if self._start_route(self._loiter, STILL_LOITERING_TEXT) else end_reason
            request = self._requests.poll()
            if isinstance(request, EndFlight):
                end_reason = end_reason or (SHUT_DOWN if request.quit else STOPPED)
                should_continue = not request.quit
            elif isinstance(request, DivertFlight) and not end_reason:
                mode = request.mode
                if self._start_route(request, DIVERTED_TEXT + MODE_NAMES[mode]):
                    self._mode, self._loiter, self._loiter_logs = mode, None, 1
                    if mode in (LOITER, GUIDED):
                        item = self._flight.setup.mission.items[-1]
                        center = LoiterCenter(item.lat_deg, item.lon_deg, item.alt, item.frame, item.params[2])
                        self._loiter = replace(request, center=center)
                    items = tuple(int(item) for item in self._flight.setup.route.items)
                    send_event(self._connection, FlightDiverted(mode, "", items))
            if self._unwritten_rows and (end_reason or now - last_flush >= FLUSH_PERIOD_S):
                self._write()
                last_flush = now
            if not end_reason:
                snapshot_count += 1
                time.sleep(max(0.0, start_time + snapshot_count / SNAPSHOT_RATE_HZ - clock()))
                snapshot_count = max(snapshot_count, int((clock() - start_time) * SNAPSHOT_RATE_HZ))
        return end_reason, should_continue

    def finish(self, end_reason: str, should_abort: Callable[[], bool]) -> list[FlightJudged]:
        """Judge each route that was flown, and close its log.

        should_abort: see `LogSink.finish`.
        """
        end_reasons = (*self._end_reasons, end_reason)
        return [log.finish(reason, should_abort) for log, reason in zip(self._logs, end_reasons, strict=True)]

    def abandon(self) -> None:
        """Close the logs as they are, without a verdict."""
        for log in self._logs:
            log.abandon()

    def _write(self) -> None:
        """Write the rows since the last call to the current log, which flushes them."""
        self._logs[-1].write(as_track(join_rows(self._unwritten_rows)))
        self._unwritten_rows.clear()

    def _start_route(self, request: DivertFlight, end_reason: str) -> bool:
        """Start another route at the aircraft's position, with its own log.

        Return False if the route does not exist.

        In that case the flight stays on its route, and an event reports the reason.

        end_reason: reason for the end of the current route, for its log.
        """
        try:
            prepared = self._factory.prepare_diversion(request, self._flight.position)
        except PlanflyError as error:
            send_event(self._connection, FlightDiverted(self._mode, str(error)))
            return False
        log = self._factory.open_log(prepared.setup, request.mode)
        if self._unwritten_rows:
            self._write()
        self._flight.divert(prepared.setup, prepared.local_map)
        self._snapshots = SnapshotMaker(prepared.setup, prepared.local_map)
        self._logs.append(log)
        self._end_reasons.append(end_reason)
        return True
