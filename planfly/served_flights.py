"""The process that flies, as ``planfly serve`` sets it up: scenario, verdicts as texts, and logs."""

import contextlib
import math
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from aircraft.catalog import Aircraft
from flight.live.flight_process import (
    FlightJudged,
    JudgeMission,
    MissionJudged,
    PreparedFlight,
    ProcessReady,
    send_event,
    serve_flights,
)
from flight.live.telemetry import CRITICAL, INFO, NOTICE, WARNING, SnapshotMaker, StatusText
from flight.mission.items import Command, Frame, Home, Mission, MissionItem, on_grid
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight
from flight.simulation.track import Track, as_track, join_tracks
from logs.recording.recorder import Recorder
from logs.verdict.findings import Finding, Verdict
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.wording import deciding_text, place_text
from planfly.airframe import Airframe, choose_seed, load_airframe
from planfly.open_mission import NamedFences, open_mission
from planfly.pipeline import make_setup
from planfly.reference_flights import judge_with_reference_flights
from world.errors import PlanflyError
from world.frames import to_geo
from world.interruption import end_with_parent
from world.scenario import Scenario, at_time, load_scenario, with_flight

DEFAULT_SCENARIO = "jacksboro"
# Most texts about one verdict; the log has the rest.
_MAX_TEXTS = 4


@dataclass(frozen=True, slots=True)
class ServeOptions:
    """What the command line asks to serve; both processes load it for themselves.

    mission: a file's path, "" for none.
    scenario, terrain: None where not named.
    flight: entries of the scenario's [flight] that take the place of its own; None for those it keeps.
    speed: times real time.
    logs: the folder of the flight logs.
    at: when it is flown, None where not stated.
    fences: named beside the mission; a station that uploads another fence replaces the items, not the zones.
    """

    mission: str
    scenario: str | None
    terrain: str | None
    speed: float
    logs: Path
    flight: dict[str, str | float | None] = field(default_factory=dict)
    fences: NamedFences = field(default_factory=NamedFences)
    at: str | None = None


@dataclass(frozen=True, slots=True)
class ServedScenario:
    """The scenario, the aircraft in it, the seed, and the mission to begin with."""

    scenario: Scenario
    airframe: Airframe
    seed: int
    mission: Mission | None


def open_served(options: ServeOptions) -> ServedScenario:
    """Load what is served.  Raises PlanflyError."""

    def change(scenario: Scenario) -> Scenario:
        return with_flight(at_time(scenario, options.at), **options.flight)

    if options.mission:
        opened = open_mission(
            Path(options.mission), options.scenario, options.terrain, change=change, fences=options.fences
        )
        return ServedScenario(opened.setup.scenario, opened.airframe, opened.setup.seed, opened.setup.mission)
    scenario = change(load_scenario(options.scenario or DEFAULT_SCENARIO, options.terrain))
    scenario = options.fences.on_scenario(scenario)
    return ServedScenario(scenario, load_airframe(scenario), choose_seed(scenario, None), None)


def fly_process(connection: Connection, options: ServeOptions) -> None:
    """Run the process that flies."""
    in_service = threading.Event()
    end_with_parent(in_service)
    factory = ServedFlights(options)
    factory.warm()
    # A signal to the whole group reaches the link too, which orders this process to end: its log is closed first.
    in_service.set()
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    send_event(connection, ProcessReady())
    serve_flights(connection, factory)
    # The link waits for this, and not for the interpreter to be taken down.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    connection.close()


class ServedFlights:
    """Judges missions in the served scenario, and logs flights into the served folder."""

    def __init__(self, options: ServeOptions) -> None:
        self._served = open_served(options)
        self._logs = options.logs
        self.aircraft = self._served.airframe.aircraft
        self.speed = options.speed

    def warm(self) -> None:
        """Fly half a second and judge it, so that no station waits for compilers later."""
        scenario = self._served.scenario
        points = np.linspace(scenario.start, scenario.destination, 3)
        lats, lons = to_geo(scenario.origin, points[:, 0], points[:, 1])
        none, amsl = (0.0, 0.0, 0.0, 0.0), float(points[0, 2])
        items = tuple(
            MissionItem(k, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), none, on_grid(lat), on_grid(lon), amsl)
            for k, (lat, lon) in enumerate(zip(lats.tolist(), lons.tolist(), strict=True), 1)
        )
        with contextlib.suppress(PlanflyError):
            setup = make_setup(scenario, self._served.airframe, Mission(None, items), self._served.seed)
            judge_geometry(setup)
            rows, _ = Flight(setup, self.aircraft).block(30)
            judge_flight(setup, as_track(rows), "warm")

    def prepare(self, request: JudgeMission) -> tuple[PreparedFlight | None, MissionJudged]:
        """Judge a mission on its geometry, and see that it can be started."""
        served = self._served
        try:
            setup = make_setup(served.scenario, served.airframe, request.mission, served.seed)
            # Its first tick says whether it can start, and has the loop compiled.
            flight = Flight(setup, self.aircraft)
            flight.block(1)
        except PlanflyError as error:
            text = StatusText(f"mission cannot be flown: {error}", CRITICAL)
            return None, MissionJudged(request.number, False, False, (text,))
        verdict = judge_geometry(setup)
        home = request.mission.home
        start = SnapshotMaker(setup, flight.map).before_start(setup)
        if home is None:
            home = Home(start.lat_deg, start.lon_deg, start.amsl - (0.0 if math.isnan(start.height) else start.height))
        items = tuple(int(item) for item in setup.route.items)
        texts = mission_texts(setup, verdict)
        judged = MissionJudged(request.number, True, verdict.flyable, texts, home, items, start)
        return PreparedFlight(setup, flight.map), judged

    def open_log(self, setup: FlightSetup) -> "ServedLog":
        """Open the next free ``flight-NNN.mcap``."""
        self._logs.mkdir(parents=True, exist_ok=True)
        number = 1
        while True:
            path = self._logs / f"flight-{number:03d}.mcap"
            try:
                path.touch(exist_ok=False)
                break
            except FileExistsError:
                number += 1
        return ServedLog(path, setup, self.aircraft)


class ServedLog:
    """The log of one served flight."""

    def __init__(self, path: Path, setup: FlightSetup, aircraft: Aircraft) -> None:
        self._path, self._setup, self._aircraft = path, setup, aircraft
        self._recorder = Recorder(path, setup)
        self._blocks: list[Track] = []

    def write(self, block: Track) -> None:
        """Append rows, and leave none in our hands."""
        self._blocks.append(block)
        self._recorder.write(block)
        self._recorder.flush()

    def finish(self, ended: str, hurry: Callable[[], bool]) -> FlightJudged:
        """Judge the flight and close the log; hurry: as of `planfly.reference_flights.judge_with_reference_flights`."""
        track = join_tracks(self._blocks)
        if ended == "completed":
            verdict, reference = judge_with_reference_flights(self._setup, self._aircraft, track, ended, hurry)
        else:
            verdict, reference = judge_flight(self._setup, track, ended), None
        end = float(track.time[-1]) if len(track) else 0.0
        self._recorder.event(end, f"flight ended: {ended}", "info" if ended == "completed" else "error")
        self._recorder.finish(ended, verdict, reference)
        return FlightJudged(verdict.flyable, (*verdict_texts("flown", verdict), StatusText(f"log {self._path}", INFO)))

    def abandon(self) -> None:
        """Close the log as it is."""
        self._recorder.abandon()


def mission_texts(setup: FlightSetup, verdict: Verdict) -> tuple[StatusText, ...]:
    """Texts about a mission for stations: verdict, size, and what is not flown as written."""
    route = setup.route
    length = float(np.linalg.norm(np.diff(route.waypoints[:, :2], axis=0), axis=1).sum()) / 1000.0
    size = StatusText(f"mission: {len(route.waypoints)} waypoints, {length:.1f} km; {route.started}", INFO)
    notes = tuple(StatusText(f"note: {note}", NOTICE) for note in route.notes[:_MAX_TEXTS])
    return (size, *verdict_texts("geometry", verdict), *notes)


def verdict_texts(level: str, verdict: Verdict) -> tuple[StatusText, ...]:
    """A verdict in a few lines, the worst first."""
    failed = [finding for finding in verdict.findings if finding.ok is False]
    if verdict.flyable:
        return (StatusText(f"verdict ({level}): FLYABLE", INFO),)
    if verdict.undecided:
        return (StatusText(f"verdict ({level}): NOT JUDGED IN FULL: {verdict.unjudged}", WARNING),)
    deciding = () if verdict.deciding is None else (StatusText(deciding_text(verdict.deciding), WARNING),)
    lines = [StatusText(f"{_heading(item)}: {item.reason}", WARNING) for item in failed[:_MAX_TEXTS]]
    if len(failed) > _MAX_TEXTS:
        lines.append(StatusText(f"and {len(failed) - _MAX_TEXTS} more findings", WARNING))
    return (StatusText(f"verdict ({level}): NOT FLYABLE", WARNING), *deciding, *lines)


def _heading(item: Finding) -> str:
    """Rule and place, the place once."""
    return item.rule if item.placed else f"{item.rule} at {place_text(item.place)}"
