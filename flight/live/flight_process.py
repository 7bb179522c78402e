"""The process that flies: JSBSim holds the interpreter's lock while it steps, so the link lives in another one.

Orders come in over a pipe and answers go back: a moment of flight as packed bytes, everything else pickled.  Both ends
are ours; nothing that a station sends is ever unpickled.
"""

import pickle
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Protocol

import numpy as np

from aircraft.catalog import Aircraft
from flight.live.snapshot import Moment, Watcher
from flight.mission.items import Home, Mission
from flight.simulation.flight_setup import FlightSetup
from flight.simulation.simulate import TICK, Flight
from flight.simulation.track import Rows, Track, as_track
from world.errors import PlanflyError

# Moments a second that are told; the log is handed to the operating system this often, s.
MOMENTS = 60.0
FLUSH = 0.2
# A machine that falls this far behind the clock (s) lets the flight run late rather than in one leap.
_BEHIND = 0.5
_MOMENT, _ANSWER = b"M", b"A"
STOPPED, SHUT = "stopped by the ground station", "stopped: the vehicle was shut down"

# Words for the stations: MAV_SEVERITY and text.
Words = tuple[int, str]


@dataclass(frozen=True, slots=True)
class Judge:
    """Order: judge a mission in the vehicle's scenario.  number: comes back with the answer."""

    mission: Mission
    number: int


@dataclass(frozen=True, slots=True)
class Fly:
    """Order: fly the mission that was judged last."""


@dataclass(frozen=True, slots=True)
class Stop:
    """Order: end the flight; with ``quit`` the process too."""

    quit: bool = False


@dataclass(frozen=True, slots=True)
class Ready:
    """Answer to `Judge`.

    possible: it can be started at all.  flyable: the verdict on its geometry.  items: seq of the item at each
    waypoint, -1 for none.  start: where it starts; None if it is not possible.
    """

    number: int
    possible: bool
    flyable: bool
    words: tuple[Words, ...]
    home: Home | None = None
    items: tuple[int, ...] = ()
    start: Moment | None = None


@dataclass(frozen=True, slots=True)
class Up:
    """The process is there, and its compiled code loaded."""


@dataclass(frozen=True, slots=True)
class Ended:
    """The flight is over: "completed" or why not."""

    ended: str


@dataclass(frozen=True, slots=True)
class Landed:
    """The flight has been judged and its log closed."""

    flyable: bool
    words: tuple[Words, ...]


class LogSink(Protocol):
    """Where a flight is recorded."""

    def write(self, block: Track) -> None:
        """Append rows and hand them to the operating system."""

    def finish(self, ended: str) -> Landed:
        """Judge the flight and close the log."""

    def abandon(self) -> None:
        """Close the log of a flight that could not go on."""


class Hangar(Protocol):
    """What the application gives the process that flies."""

    aircraft: Aircraft
    speed: float

    def prepare(self, order: Judge) -> tuple[FlightSetup | None, Ready]:
        """Judge a mission; the setup is None where it cannot be flown."""

    def open_log(self, setup: FlightSetup) -> LogSink:
        """Open the log of the next flight."""


def serve_flights(connection: Connection, hangar: Hangar) -> None:
    """Judge and fly as ordered, until the other end closes or says so."""
    setup: FlightSetup | None = None
    try:
        while True:
            order = connection.recv()
            if isinstance(order, Judge):
                setup, ready = hangar.prepare(order)
                answer(connection, ready)
            elif isinstance(order, Fly) and setup is not None:
                if not _fly(connection, setup, hangar):
                    return
            elif isinstance(order, Stop) and order.quit:
                return
    except (EOFError, BrokenPipeError, ConnectionResetError):
        # The link is gone, and with it all who watched; the log is closed on the way here.
        return


def answer(connection: Connection, what: Up | Ready | Ended | Landed) -> None:
    """Send an answer to the link."""
    connection.send_bytes(_ANSWER + pickle.dumps(what))


def read_answer(data: bytes) -> Moment | Up | Ready | Ended | Landed:
    """Read what the flying process sent."""
    if data[:1] == _MOMENT:
        return Moment.unpack(data[1:])
    found: Up | Ready | Ended | Landed = pickle.loads(data[1:])
    return found


def _fly(connection: Connection, setup: FlightSetup, hangar: Hangar) -> bool:
    """Fly in step with the clock; False when the process is to end."""
    try:
        flight = Flight(setup, hangar.aircraft)
        log = hangar.open_log(setup)
    except (PlanflyError, OSError) as error:
        answer(connection, Ended(f"not started: {error}"))
        answer(connection, Landed(False, ((2, f"flight not started: {error}"),)))
        return True
    watcher = Watcher(setup)
    try:
        ended, go_on = _in_step(connection, flight, watcher, log, hangar.speed)
        if go_on:
            answer(connection, Ended(ended))
        landed = log.finish(ended)
    except OSError as error:
        log.abandon()
        # A pipe that broke ends the process; a full disk ends the flight.
        if isinstance(error, BrokenPipeError | ConnectionResetError):
            raise
        answer(connection, Ended(f"log: {error.strerror}"))
        landed = Landed(False, ((2, f"flight ended: its log cannot be written: {error.strerror}"),))
        go_on = True
    answer(connection, landed)
    return go_on


def _in_step(connection: Connection, flight: Flight, watcher: Watcher, log: LogSink, speed: float) -> tuple[str, bool]:
    """Step the flight by the clock: how it ended, and whether the process goes on."""
    clock = time.monotonic
    started = begun = clock()
    pending: list[Rows] = []
    ticks, flushed, beat = 0, started, 0
    ended, go_on = "", True
    while not ended:
        now = clock()
        due = int((now - started) * speed / TICK) - ticks
        most = max(1, int(_BEHIND * speed / TICK))
        if due > most:
            started += (due - most) * TICK / speed
            due = most
        if due > 0:
            rows, ended = flight.block(due)
            ticks += due
            if len(rows):
                pending.append(rows)
                connection.send_bytes(_MOMENT + watcher.moment(rows[-1]).pack())
        if connection.poll():
            order = _order(connection)
            if isinstance(order, Stop):
                ended = ended or (SHUT if order.quit else STOPPED)
                go_on = not order.quit
        if pending and (ended or now - flushed >= FLUSH):
            log.write(as_track(np.concatenate(pending)))
            pending.clear()
            flushed = now
        if not ended:
            beat += 1
            time.sleep(max(0.0, begun + beat / MOMENTS - clock()))
            beat = max(beat, int((clock() - begun) * MOMENTS))
    return ended, go_on


def _order(connection: Connection) -> object:
    try:
        return connection.recv()
    except EOFError:
        return Stop(quit=True)
