"""The process that flies, as ``planfly serve`` sets it up: scenario, verdicts in words, and logs."""

import contextlib
import math
import signal
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from flight.live.downlink import CRITICAL, INFO, NOTICE, WARNING
from flight.live.flight_process import Judge, Landed, Ready, Up, Words, answer, serve_flights
from flight.live.snapshot import Watcher
from flight.mission.items import Command, Frame, Home, Mission, MissionItem, on_grid
from flight.simulation.flight_setup import FlightSetup
from flight.simulation.simulate import Flight, as_track
from flight.simulation.track import Track, join_tracks
from logs.recording.recorder import Recorder
from logs.verdict.findings import Finding, Verdict
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.wording import place_text
from planfly.airframe import Airframe, load_airframe
from planfly.open_mission import open_mission
from planfly.pipeline import make_setup
from world.errors import PlanflyError
from world.frames import to_geo
from world.scenario import Scenario, load_scenario

DEFAULT_SCENARIO = "jacksboro"
# Most words about one verdict; the log has the rest.
_MOST_WORDS = 4


@dataclass(frozen=True, slots=True)
class Served:
    """What is served, in words that both processes understand.

    mission: "" for none.  scenario, terrain: None where not named.  logs: the folder of the flight logs.
    """

    mission: str
    scenario: str | None
    terrain: str | None
    speed: float
    logs: Path


@dataclass(frozen=True, slots=True)
class World:
    """The scenario, the aircraft in it, the seed, and the mission to begin with."""

    scenario: Scenario
    airframe: Airframe
    seed: int
    mission: Mission | None


def open_world(served: Served) -> World:
    """Load what is served.  Raises PlanflyError."""
    if served.mission:
        opened = open_mission(Path(served.mission), served.scenario, served.terrain)
        return World(opened.setup.scenario, opened.airframe, opened.setup.seed, opened.setup.mission)
    scenario = load_scenario(served.scenario or DEFAULT_SCENARIO, served.terrain)
    return World(scenario, load_airframe(scenario), scenario.planner.seed or 1, None)


def fly_process(connection: Connection, served: Served) -> None:
    """Run the process that flies."""
    # Ctrl-C reaches the whole group; the link tells this process when to end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    hangar = ServedHangar(served)
    hangar.warm()
    answer(connection, Up())
    serve_flights(connection, hangar)


class ServedHangar:
    """Judges missions in the served scenario, and logs flights into the served folder."""

    def __init__(self, served: Served) -> None:
        self._world = open_world(served)
        self._logs = served.logs
        self.aircraft = self._world.airframe.aircraft
        self.speed = served.speed

    def warm(self) -> None:
        """Fly half a second and judge it, so that no station waits for compilers later."""
        scenario = self._world.scenario
        points = np.linspace(scenario.start, scenario.destination, 3)
        lats, lons = to_geo(scenario.origin, points[:, 0], points[:, 1])
        none, amsl = (0.0, 0.0, 0.0, 0.0), float(points[0, 2])
        items = tuple(
            MissionItem(k, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), none, on_grid(lat), on_grid(lon), amsl)
            for k, (lat, lon) in enumerate(zip(lats.tolist(), lons.tolist(), strict=True), 1)
        )
        with contextlib.suppress(PlanflyError):
            setup = make_setup(scenario, self._world.airframe, Mission(None, items), self._world.seed)
            judge_geometry(setup)
            rows, _ = Flight(setup, self.aircraft).block(30)
            judge_flight(setup, as_track(rows), "warm")

    def prepare(self, order: Judge) -> tuple[FlightSetup | None, Ready]:
        """Judge a mission on its geometry, and see that it can be started."""
        world = self._world
        try:
            setup = make_setup(world.scenario, world.airframe, order.mission, world.seed)
            # Its first tick says whether it can start, and has the loop compiled.
            Flight(setup, self.aircraft).block(1)
            watcher = Watcher(setup)
        except PlanflyError as error:
            return None, Ready(order.number, False, False, ((CRITICAL, f"mission cannot be flown: {error}"),))
        verdict = judge_geometry(setup)
        home = order.mission.home
        start = watcher.before_start(setup)
        if home is None:
            home = Home(start.lat_deg, start.lon_deg, start.amsl - (0.0 if math.isnan(start.height) else start.height))
        items = tuple(int(item) for item in setup.route.items)
        words = mission_words(setup, verdict)
        return setup, Ready(order.number, True, verdict.flyable, words, home, items, start)

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
        return ServedLog(path, setup)


class ServedLog:
    """The log of one served flight."""

    def __init__(self, path: Path, setup: FlightSetup) -> None:
        self._path, self._setup = path, setup
        self._recorder = Recorder(path, setup)
        self._blocks: list[Track] = []

    def write(self, block: Track) -> None:
        """Append rows, and leave none in our hands."""
        self._blocks.append(block)
        self._recorder.write(block)
        self._recorder.flush()

    def finish(self, ended: str) -> Landed:
        """Judge the flight and close the log."""
        track = join_tracks(self._blocks)
        verdict = judge_flight(self._setup, track, ended)
        end = float(track.time[-1]) if len(track) else 0.0
        self._recorder.event(end, f"flight ended: {ended}", "info" if ended == "completed" else "error")
        self._recorder.finish(ended, verdict)
        return Landed(verdict.flyable, (*verdict_words("flown", verdict), (INFO, f"log {self._path}")))

    def abandon(self) -> None:
        """Close the log as it is."""
        self._recorder.__exit__(OSError, None, None)


def mission_words(setup: FlightSetup, verdict: Verdict) -> tuple[Words, ...]:
    """What stations are told of a mission: verdict, size, and what is not flown as written."""
    route = setup.route
    length = float(np.linalg.norm(np.diff(route.waypoints[:, :2], axis=0), axis=1).sum()) / 1000.0
    size = (INFO, f"mission: {len(route.waypoints)} waypoints, {length:.1f} km; {route.started}")
    notes = tuple((NOTICE, f"note: {note}") for note in route.notes[:_MOST_WORDS])
    return (size, *verdict_words("geometry", verdict), *notes)


def verdict_words(level: str, verdict: Verdict) -> tuple[Words, ...]:
    """A verdict in a few lines, the worst first."""
    failed = [finding for finding in verdict.findings if finding.ok is False]
    if verdict.flyable:
        return ((INFO, f"verdict ({level}): FLYABLE"),)
    lines = [(WARNING, f"{_heading(item)}: {item.reason}") for item in failed[:_MOST_WORDS]]
    if len(failed) > _MOST_WORDS:
        lines.append((WARNING, f"and {len(failed) - _MOST_WORDS} more findings"))
    return ((WARNING, f"verdict ({level}): NOT FLYABLE"), *lines)


def _heading(item: Finding) -> str:
    """Rule and place, the place once."""
    return item.rule if item.placed else f"{item.rule} at {place_text(item.place)}"
