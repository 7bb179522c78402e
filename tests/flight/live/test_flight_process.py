"""The process that flies: orders in, events out, and a log that is closed however the flight ends."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing import Pipe
from threading import Thread

import pytest

from aircraft.catalog import load_aircraft
from flight.live.flight_process import (
    STOPPED,
    DivertFlight,
    EndFlight,
    FlightDiverted,
    FlightEnded,
    FlightJudged,
    JudgeMission,
    MissionJudged,
    PreparedFlight,
    StartFlight,
    read_event,
    serve_flights,
)
from flight.live.telemetry import AUTO, RTL, Snapshot
from flight.mission.items import Mission
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import LocalMap
from flight.simulation.track import Track
from tests.mission_lines import setup_of, wp
from world.errors import FlightError


@dataclass
class MemoryLog:
    """A log that keeps its rows; ``full``: whose disk is."""

    full: bool = False
    rows: int = 0
    # How often it asks whether to abort before it closes.
    patience: int = 0
    looks: int = 0
    closed: list[str] = field(default_factory=list)

    def write(self, block: Track) -> None:
        if self.full:
            raise OSError(28, "No space left on device")
        self.rows += len(block)

    def finish(self, ended: str, should_abort: Callable[[], bool]) -> FlightJudged:
        for _ in range(self.patience):
            if should_abort():
                break
            self.looks += 1
            time.sleep(0.01)
        self.closed.append(ended)
        return FlightJudged(ended == "completed", ())

    def abandon(self) -> None:
        self.closed.append("abandoned")


@dataclass
class OneSetup:
    """Flies one setup, whatever the mission is."""

    setup: FlightSetup
    log: MemoryLog
    speed: float = 100.0

    def __post_init__(self) -> None:
        self.aircraft = load_aircraft("aerosonde")

    def prepare(self, order: JudgeMission) -> tuple[PreparedFlight | None, MissionJudged]:
        return PreparedFlight(self.setup, LocalMap.around(self.setup)), MissionJudged(order.number, True, True, ())

    def prepare_diversion(self, request: DivertFlight, here: object) -> PreparedFlight:
        raise FlightError("no way there")

    def open_log(self, setup: FlightSetup, mode: int) -> MemoryLog:
        return self.log


def events_of(log: MemoryLog, *, after: int | None = None, then: object = EndFlight()) -> list[object]:
    """Events of one mission judged and flown, with a request after so many snapshots."""
    ours, theirs = Pipe()
    factory = OneSetup(setup_of(wp(0, 0), wp(0, 1500)), log)
    thread = Thread(target=serve_flights, args=(theirs, factory))
    thread.start()
    ours.send(JudgeMission(Mission(None, ()), 7))
    ours.send(StartFlight())
    found: list[object] = []
    while not (found and isinstance(found[-1], FlightJudged)):
        found.append(read_event(ours.recv_bytes()))
        if sum(isinstance(event, Snapshot) for event in found) == after:
            ours.send(then)
            after = None
    ours.send(EndFlight(quit=True))
    thread.join(20.0)
    assert not thread.is_alive()
    ours.close()
    theirs.close()
    return found


def test_a_flight_is_judged_flown_and_judged() -> None:
    log = MemoryLog()
    events = events_of(log)
    assert events[0] == MissionJudged(7, True, True, ())
    assert events[-2:] == [FlightEnded("completed"), FlightJudged(True, ())]
    snapshots = [event for event in events if isinstance(event, Snapshot)]
    assert [one.time for one in snapshots] == sorted(one.time for one in snapshots)
    assert log.closed == ["completed"]
    assert log.rows > 3000


def test_a_station_ends_the_flight() -> None:
    log = MemoryLog()
    assert events_of(log, after=3)[-2:] == [FlightEnded(STOPPED), FlightJudged(False, ())]
    assert log.closed == [STOPPED]


def test_a_full_disk_ends_the_flight_and_not_the_process() -> None:
    log = MemoryLog(full=True)
    ended, judged = events_of(log)[-2:]
    assert ended == FlightEnded("ended: its log cannot be written: No space left on device")
    assert isinstance(judged, FlightJudged)
    assert "cannot be written" in judged.texts[0].text
    assert log.closed == ["abandoned"]


def test_a_way_that_there_is_not_leaves_the_flight_as_it_is() -> None:
    """`OneSetup` has no other way; the ways themselves are flown in tests/planfly/commands/test_serve_modes.py."""
    log = MemoryLog()
    events = events_of(log, after=1, then=DivertFlight(RTL, Mission(None, ())))
    assert FlightDiverted(AUTO, "no way there") in events
    assert events[-2:] == [FlightEnded("completed"), FlightJudged(True, ())]


@pytest.mark.parametrize("gone", [False, True])
def test_a_judgement_is_hurried_when_the_process_is_to_end(gone: bool) -> None:
    """By an order behind another that waits, or by a link that is gone; nothing else hurries it."""
    ours, theirs = Pipe()
    log = MemoryLog(patience=60_000)
    factory = OneSetup(setup_of(wp(0, 0), wp(0, 500)), log, speed=500.0)
    thread = Thread(target=serve_flights, args=(theirs, factory))
    thread.start()
    ours.send(JudgeMission(Mission(None, ()), 7))
    ours.send(StartFlight())
    while not isinstance(read_event(ours.recv_bytes()), FlightEnded):
        pass
    ours.send(JudgeMission(Mission(None, ()), 8))
    time.sleep(0.1)
    assert log.closed == []
    if gone:
        ours.close()
    else:
        ours.send(EndFlight(quit=True))
    thread.join(120.0)
    assert not thread.is_alive()
    assert log.looks < log.patience
    assert log.closed == ["completed"]
    if not gone:
        # What waited is answered in its turn, before the end.
        assert isinstance(read_event(ours.recv_bytes()), FlightJudged)
        assert read_event(ours.recv_bytes()) == MissionJudged(8, True, True, ())
        ours.close()
    theirs.close()


@pytest.mark.parametrize("order", [EndFlight(quit=True), None])
def test_the_process_ends_when_it_is_to_or_its_link_is_gone(order: EndFlight | None) -> None:
    ours, theirs = Pipe()
    if order is not None:
        ours.send(order)
    ours.close()
    log = MemoryLog()
    thread = Thread(target=serve_flights, args=(theirs, OneSetup(setup_of(wp(0, 0), wp(0, 1500)), log)))
    thread.start()
    thread.join(20.0)
    assert not thread.is_alive()
    assert log.rows == 0
    assert log.closed == []
    theirs.close()
