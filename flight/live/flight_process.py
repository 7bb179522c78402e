"""The process that flies: JSBSim holds the interpreter's lock while it steps, so the link lives in another one.

Requests come in over a pipe and events go back: a state snapshot as packed bytes, everything else pickled.  Both ends
are ours; nothing that a station sends is ever unpickled.

| request | what it asks for |
|---|---|
| `JudgeMission` | a verdict on a mission, without a flight |
| `StartFlight` | the flight of the mission that was judged last |
| `DivertFlight` | another way from where the aircraft is, in the flight that goes on |
| `EndFlight` | the end of the flight, or of the process |

| event | when it is sent |
|---|---|
| `ProcessReady` | once, before the first request is read |
| `MissionJudged` | for each `JudgeMission` |
| `flight.live.telemetry.Snapshot` | in flight, `SNAPSHOT_RATE` times a second |
| `FlightDiverted` | for each `DivertFlight` in flight |
| `FlightEnded` | when the aircraft stops |
| `FlightJudged` | for each log that is closed: one, and one more for each diversion |

A diversion ends one flight and begins the next in the air: each has its setup, its log and its verdict.
"""

import math
import pickle
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import Aircraft
from flight.live.telemetry import AUTO, CRITICAL, GUIDED, LOITER, MODE_NAMES, Snapshot, SnapshotMaker, StatusText
from flight.mission.items import Frame, Home, Mission
from flight.simulation.local_map import LocalMap
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import TICK, Flight
from flight.simulation.track import Rows, Track, as_track, join_rows
from world.errors import PlanflyError

Floats = NDArray[np.float64]

# Snapshots a second that are sent; the log is handed to the operating system this often, s.
SNAPSHOT_RATE = 60.0
FLUSH_PERIOD = 0.2
# A machine that falls this far behind the clock (s) lets the flight run late rather than in one leap.
_BEHIND = 0.5
# First byte of what is sent: what follows is packed, or pickled.
_PACKED, _PICKLED = b"S", b"E"
STOPPED, SHUT_DOWN = "stopped by the ground station", "stopped: the vehicle was shut down"
# How a way ends that the aircraft was sent on from; the mode follows.  How a circle ends that is flown on.
LEFT_FOR, HELD_ON = "left, as a ground station asked, for ", "logged until here, and circling on"
# Circles without end are logged in pieces, and end after so many.
_MAX_PIECES = 16


@dataclass(frozen=True, slots=True)
class JudgeMission:
    """Request: judge a mission in the vehicle's scenario.

    number: comes back with the event.  parameters: of the law, by name, which stations have set.
    """

    mission: Mission
    number: int
    parameters: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, slots=True)
class StartFlight:
    """Request: fly the mission that was judged last."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where to circle.

    lat_deg, lon_deg: NaN for where the aircraft is.  alt: m in the frame, NaN for the height that it is at.
    frame: MAV_FRAME.  radius: m, 0 for the autopilot's own.
    """

    lat_deg: float = math.nan
    lon_deg: float = math.nan
    alt: float = math.nan
    frame: int = int(Frame.GLOBAL)
    radius: float = 0.0


@dataclass(frozen=True, slots=True)
class DivertFlight:
    """Request: leave the way that is flown for another, from where the aircraft is.

    mode: ArduPlane's number: AUTO flies the mission's items, RTL returns, LOITER and GUIDED circle at the place.
    mission: home, rally points and fence; in AUTO with the items that are left.
    """

    mode: int
    mission: Mission
    place: Place = Place()


@dataclass(frozen=True, slots=True)
class EndFlight:
    """Request: end the flight; with ``quit`` the process too."""

    quit: bool = False


@dataclass(frozen=True, slots=True)
class ProcessReady:
    """Event: the process runs, and its compiled code is loaded."""


@dataclass(frozen=True, slots=True)
class MissionJudged:
    """Event: a mission has been judged.

    number: of the request.
    possible: whether the mission can be started at all.
    flyable: False if a finding of its geometry failed.
    texts: what stations are sent about it.
    home: the mission's, or the ground at its start; None if it is not possible.
    items: seq of the item at each waypoint, -1 for none.
    start: the aircraft where the flight starts; None if it is not possible.
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
    """Event: the aircraft is on another way, or cannot be and flies on.

    mode: that it is flown in now.  problem: why it cannot, "" if it is on its way.
    items: seq of the item at each waypoint, -1 for none.
    """

    mode: int
    problem: str
    items: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class FlightEnded:
    """Event: the flight is over.  ended: "completed" or why not."""

    ended: str


@dataclass(frozen=True, slots=True)
class FlightJudged:
    """Event: the flight has been judged and its log closed.  texts: what stations are sent about it."""

    flyable: bool
    texts: tuple[StatusText, ...]


FlightRequest = JudgeMission | StartFlight | DivertFlight | EndFlight
Event = ProcessReady | MissionJudged | FlightDiverted | FlightEnded | FlightJudged


class LogSink(Protocol):
    """Where a flight is recorded."""

    def write(self, block: Track) -> None:
        """Append rows and hand them to the operating system."""

    def finish(self, ended: str, hurry: Callable[[], bool]) -> FlightJudged:
        """Judge the flight and close the log; hurry: whether the process is to end, asked wherever it takes long."""

    def abandon(self) -> None:
        """Close the log of a flight that could not go on."""


@dataclass(frozen=True, slots=True)
class PreparedFlight:
    """A mission that can be started, and the map fitted around it."""

    setup: FlightSetup
    local_map: LocalMap


class FlightFactory(Protocol):
    """What the application gives the process that flies.  speed: times real time."""

    aircraft: Aircraft
    speed: float

    def prepare(self, request: JudgeMission) -> tuple[PreparedFlight | None, MissionJudged]:
        """Judge a mission; None in place of the flight where it cannot be flown."""

    def divert(self, request: DivertFlight, here: Floats) -> PreparedFlight:
        """The way that is asked for, from a position (3,) on the map.  Raises PlanflyError where there is none."""

    def open_log(self, setup: FlightSetup, mode: int) -> LogSink:
        """Open the log of the next flight.  mode: as of `DivertFlight`."""


def serve_flights(connection: Connection, factory: FlightFactory) -> None:
    """Judge and fly as asked, until the other end closes or asks the process to end.

    connection: the flying end of a `multiprocessing.Pipe`; requests are pickled into the other end, and `read_event`
    reads what comes out of it.

    >>> from multiprocessing import Pipe
    >>> link_end, flying_end = Pipe()
    >>> link_end.send(EndFlight(quit=True))
    >>> serve_flights(flying_end, factory=None)  # a request to quit asks nothing of the factory
    """
    prepared: PreparedFlight | None = None
    requests = _Requests(connection)
    try:
        while True:
            request = requests.next()
            if isinstance(request, JudgeMission):
                prepared, judged = factory.prepare(request)
                send_event(connection, judged)
            elif isinstance(request, StartFlight) and prepared is not None:
                if not _fly(connection, requests, prepared, factory):
                    return
            elif isinstance(request, EndFlight) and request.quit:
                return
    except (EOFError, BrokenPipeError, ConnectionResetError):
        # The link is gone, and with it all who watched; the log is closed on the way here.
        return


def send_event(connection: Connection, event: Event) -> None:
    """Send an event to the link; `read_event` reads it there.

    >>> from multiprocessing import Pipe
    >>> link_end, flying_end = Pipe()
    >>> send_event(flying_end, FlightEnded("completed"))
    >>> read_event(link_end.recv_bytes())
    FlightEnded(ended='completed')
    """
    connection.send_bytes(_PICKLED + pickle.dumps(event))


def read_event(data: bytes) -> Snapshot | Event:
    """Read what the flying process sent."""
    if data[:1] == _PACKED:
        return Snapshot.unpack(data[1:])
    found: Event = pickle.loads(data[1:])
    return found


class _Requests:
    """Requests in the order in which they came."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._early: deque[object] = deque()

    def next(self) -> object:
        """The next request, waited for.  Raises EOFError where the link is gone."""
        return self._early.popleft() if self._early else self._connection.recv()

    def waiting(self) -> object:
        """The next request if one is there; None where none is."""
        if not self._early and not self._connection.poll():
            return None
        try:
            return self.next()
        except EOFError:
            return EndFlight(quit=True)

    def ending(self) -> bool:
        """Whether the process is to end, by a request that has come or because the link is gone; none is taken out."""
        try:
            while self._connection.poll():
                self._early.append(self._connection.recv())
        except (EOFError, BrokenPipeError, ConnectionResetError):
            return True
        return any(isinstance(request, EndFlight) and request.quit for request in self._early)


def _fly(connection: Connection, requests: _Requests, prepared: PreparedFlight, factory: FlightFactory) -> bool:
    """Fly in step with the clock; False when the process is to end."""
    try:
        flight = Flight(prepared.setup, factory.aircraft, local_map=prepared.local_map)
        log = factory.open_log(prepared.setup, AUTO)
    except (PlanflyError, OSError) as error:
        send_event(connection, FlightEnded(f"not started: {error}"))
        send_event(connection, FlightJudged(False, (StatusText(f"flight not started: {error}", CRITICAL),)))
        return True
    flown = _Flown(connection, requests, factory, flight, log)
    try:
        ended, go_on = flown.in_step()
        if go_on:
            send_event(connection, FlightEnded(ended))
        judged = flown.finish(ended, requests.ending if go_on else lambda: True)
    except OSError as error:
        flown.abandon()
        # A pipe that broke ends the process; a full disk ends the flight.
        if isinstance(error, BrokenPipeError | ConnectionResetError):
            raise
        send_event(connection, FlightEnded(f"log: {error.strerror}"))
        text = f"flight ended: its log cannot be written: {error.strerror}"
        judged = [FlightJudged(False, (StatusText(text, CRITICAL),))]
        go_on = True
    for one in judged:
        send_event(connection, one)
    return go_on


class _Flown:
    """An aircraft in the air, and the log of each way that it has been sent on."""

    def __init__(
        self, connection: Connection, requests: _Requests, factory: FlightFactory, flight: Flight, log: LogSink
    ) -> None:
        self._connection, self._requests, self._factory = connection, requests, factory
        self._flight, self._mode = flight, AUTO
        self._snapshots = SnapshotMaker(flight.setup, flight.map)
        # The last is written; the others wait to be judged until nothing flies, and how each ended stands beside them.
        self._logs, self._left = [log], list[str]()
        self._pending: list[Rows] = []
        # The circle that is flown, None for none, and how often it was begun.
        self._circled: DivertFlight | None = None
        self._pieces = 0

    def in_step(self) -> tuple[str, bool]:
        """Step the flight by the clock: how it ended, and whether the process goes on."""
        clock, speed = time.monotonic, self._factory.speed
        started = begun = clock()
        ticks, flushed, beat = 0, started, 0
        ended, go_on = "", True
        while not ended:
            now = clock()
            due = int((now - started) * speed / TICK) - ticks
            max_due = max(1, int(_BEHIND * speed / TICK))
            if due > max_due:
                started += (due - max_due) * TICK / speed
                due = max_due
            if due > 0:
                rows, ended = self._flight.block(due)
                ticks += due
                if len(rows):
                    self._pending.append(rows)
                    self._connection.send_bytes(_PACKED + self._snapshots.snapshot(rows[-1]).pack())
            if ended == "completed" and self._circled is not None and self._pieces < _MAX_PIECES:
                self._pieces += 1
                ended = "" if self._lay_out(self._circled, HELD_ON) else ended
            request = self._requests.waiting()
            if isinstance(request, EndFlight):
                ended = ended or (SHUT_DOWN if request.quit else STOPPED)
                go_on = not request.quit
            elif isinstance(request, DivertFlight) and not ended:
                self._divert(request)
            if self._pending and (ended or now - flushed >= FLUSH_PERIOD):
                self._write()
                flushed = now
            if not ended:
                beat += 1
                time.sleep(max(0.0, begun + beat / SNAPSHOT_RATE - clock()))
                beat = max(beat, int((clock() - begun) * SNAPSHOT_RATE))
        return ended, go_on

    def finish(self, ended: str, hurry: Callable[[], bool]) -> list[FlightJudged]:
        """Judge each way, and close its log; hurry: as of `LogSink.finish`."""
        endings = (*self._left, ended)
        return [log.finish(how, hurry) for log, how in zip(self._logs, endings, strict=True)]

    def abandon(self) -> None:
        """Close the logs as they are."""
        for log in self._logs:
            log.abandon()

    def _write(self) -> None:
        self._logs[-1].write(as_track(join_rows(self._pending)))
        self._pending.clear()

    def _divert(self, request: DivertFlight) -> None:
        if not self._lay_out(request, LEFT_FOR + MODE_NAMES[request.mode]):
            return
        route = self._flight.setup.route
        self._mode, self._circled, self._pieces = request.mode, None, 1
        if request.mode in (LOITER, GUIDED):
            item = self._flight.setup.mission.items[-1]
            place = Place(item.lat_deg, item.lon_deg, item.alt, item.frame, item.params[2])
            self._circled = replace(request, place=place)
        send_event(self._connection, FlightDiverted(request.mode, "", tuple(int(item) for item in route.items)))

    def _lay_out(self, request: DivertFlight, left: str) -> bool:
        """Begin a way where the aircraft is, with a log of its own; left: how the present one ends."""
        try:
            prepared = self._factory.divert(request, self._flight.position)
        except PlanflyError as error:
            send_event(self._connection, FlightDiverted(self._mode, str(error)))
            return False
        log = self._factory.open_log(prepared.setup, request.mode)
        if self._pending:
            self._write()
        self._flight.divert(prepared.setup, prepared.local_map)
        self._snapshots = SnapshotMaker(prepared.setup, prepared.local_map)
        self._logs.append(log)
        self._left.append(left)
        return True
