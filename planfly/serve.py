"""``planfly serve``: a vehicle that ground stations fly; and ``planfly replay --to``: a log played into one."""

import argparse
import contextlib
import ipaddress
import math
import multiprocessing
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType

import numpy as np

from flight.flight_process import Judge, Landed, Ready, Up, Words, answer, serve_flights
from flight.link import SYSTEM, Access, Link, check_access
from flight.mission import Command, Frame, Home, Mission, MissionItem, on_grid
from flight.parameters import vehicle_parameters
from flight.setup import FlightSetup
from flight.signing import read_key
from flight.simulate import Flight, as_track
from flight.telemetry import ACTIVE, AUTO, COMPLETE, PERIODS, Status, heartbeat, status_texts, telemetry_message
from flight.track import COLUMNS, Track, join_tracks
from flight.vehicle import CRITICAL, INFO, NOTICE, WARNING, Vehicle
from flight.watch import Moment, Watcher
from logs.check import judge_flight, judge_geometry
from logs.reader import FlightLog as ReadLog
from logs.recorder import Recorder
from logs.verdict import Verdict
from planfly.missions import open_mission
from planfly.pipeline import Vehicle as Airframe
from planfly.pipeline import load_vehicle, make_setup
from world.errors import FlightError, PlanflyError
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
        return World(opened.setup.scenario, opened.vehicle, opened.setup.seed, opened.setup.mission)
    scenario = load_scenario(served.scenario or DEFAULT_SCENARIO, served.terrain)
    return World(scenario, load_vehicle(scenario), scenario.planner.seed or 1, None)


def serve(args: argparse.Namespace) -> int:
    """``planfly serve``."""
    access = _access(args)
    served = Served(args.mission or "", args.scenario, args.terrain, args.speed, Path(args.log))
    world = open_world(served)
    if served.logs.exists() and not served.logs.is_dir():
        raise PlanflyError(f"--log {served.logs}: is a file; a folder is expected")
    link = Link(access)
    parameters = vehicle_parameters(
        airspeed=world.airframe.airspeed,
        slowest=world.airframe.aircraft.airspeed_min,
        fastest=world.airframe.aircraft.airspeed_max,
        max_bank_deg=math.degrees(world.airframe.max_bank),
        system=SYSTEM,
        speed=served.speed,
    )
    nursery = _Nursery(served)
    with stop_signals() as stopped:
        vehicle = Vehicle(link, nursery.spawn, parameters, standing(world.scenario), world.airframe.battery, _tell)
        host, port = link.address
        targets = ", ".join(f"{to}:{number}" for to, number in access.to)
        print(f"vehicle {SYSTEM} at {host}:{port}, calling {targets}; scenario {world.scenario.name}", flush=True)
        print(f"flight logs go to {served.logs}/; Ctrl-C ends", flush=True)
        if world.mission is not None:
            vehicle.load(world.mission)
        try:
            vehicle.run(stopped)
        finally:
            vehicle.close()
            link.close()
            nursery.join()
    return 0


class _Nursery:
    """Starts processes that fly."""

    def __init__(self, served: Served) -> None:
        self._served = served
        self._context = multiprocessing.get_context("spawn")
        self._children: list[multiprocessing.process.BaseProcess] = []

    def spawn(self) -> Connection:
        """Start one: the pipe to it."""
        for child in self._children:
            child.join(timeout=0.0)
        self._children = [child for child in self._children if child.is_alive()]
        ours, theirs = self._context.Pipe()
        child = self._context.Process(target=fly_process, args=(theirs, self._served), daemon=True)
        child.start()
        theirs.close()
        self._children.append(child)
        return ours

    def join(self) -> None:
        """Wait for them to end."""
        for child in self._children:
            child.join(timeout=5.0)


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
    lines = [(WARNING, f"{item.rule} at {item.where}: {item.reason}") for item in failed[:_MOST_WORDS]]
    if len(failed) > _MOST_WORDS:
        lines.append((WARNING, f"and {len(failed) - _MOST_WORDS} more findings"))
    return ((WARNING, f"verdict ({level}): NOT FLYABLE"), *lines)


def standing(scenario: Scenario) -> tuple[Moment, Home]:
    """Where the aircraft stands without a mission: the scenario's start, on a course to its destination."""
    east, north, amsl = (float(value) for value in scenario.start)
    lat, lon = (float(value) for value in to_geo(scenario.origin, east, north))
    ground = math.nan if scenario.terrain is None else float(scenario.terrain.height(east, north))
    step = scenario.destination - scenario.start
    course = math.atan2(float(step[0]), float(step[1]))
    zero = 0.0
    moment = Moment(
        zero, lat, lon, amsl, amsl - ground, zero, zero, zero, zero, zero, course, zero, zero, zero, zero, zero, zero,
        zero, zero, zero, -1.0,
    )  # fmt: skip
    return moment, Home(lat, lon, amsl if math.isnan(ground) else ground)


def play(log: ReadLog, args: argparse.Namespace) -> None:
    """Play a log to ground stations, as if it were flown now."""
    link = Link(_access(args))
    watcher = Watcher(log.setup)
    track = log.track
    rows = np.concatenate(
        [np.asarray(getattr(track, name), dtype=np.float64).reshape(len(track), -1) for name in COLUMNS], axis=1
    )
    start = watcher.before_start(log.setup)
    home = log.setup.mission.home or Home(start.lat_deg, start.lon_deg, start.amsl)
    status = Status(start, home, battery=log.setup.battery, mode=AUTO, armed=True, flying=True, mission_state=ACTIVE)
    items = log.setup.route.items
    status.total = int(max(items.max(), 0))
    player = _Player(link, status)
    try:
        with stop_signals() as stopped:
            player.wait(args.wait, stopped)
            begun, k = time.monotonic(), 0
            player.say(f"replay of {args.log} at {args.speed or 1.0:g}x")
            while k < len(rows) - 1 and not stopped():
                k = min(
                    len(rows) - 1,
                    int(np.searchsorted(track.time, (time.monotonic() - begun) * (args.speed or 1.0), side="right")),
                )
                moment = watcher.moment(rows[k])
                if moment.finite:
                    status.moment = moment
                    status.current = max(0, int(items[min(int(moment.leg) + 1, len(items) - 1)]))
                player.step(0.01)
            if log.ended == "completed" and k == len(rows) - 1:
                status.mission_state = COMPLETE
            status.armed = status.flying = False
            player.say(f"replay over: {log.ended or 'the log ends before the flight does'}")
            player.rest(1.5, stopped)
    finally:
        link.close()


class _Player:
    """Telemetry of a log, without a vehicle behind it."""

    def __init__(self, link: Link, status: Status) -> None:
        self._link, self._status = link, status
        self._born = time.monotonic()
        self._hello = 0.0
        self._texts = 0

    def say(self, text: str) -> None:
        """Tell the stations and the terminal."""
        print(text, flush=True)
        self._texts += 1
        for peer in self._link.peers.values():
            for piece in status_texts(text, INFO, self._texts):
                self._link.send(piece, peer)

    def wait(self, patience: float, stopped: "_Stopped") -> None:
        """Call stations until one answers, or ``patience`` seconds are over."""
        end = time.monotonic() + patience
        while not self._link.peers and time.monotonic() < end and not stopped():
            self.step(0.05)

    def rest(self, seconds: float, stopped: "_Stopped") -> None:
        """Go on telling the last moment."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and not stopped():
            self.step(0.02)

    def step(self, nap: float) -> None:
        """Read what stations say, send what is due, sleep a little."""
        now = time.monotonic()
        self._status.boot, self._status.wall = now - self._born, time.time()
        self._link.receive()
        if now >= self._hello:
            self._hello = now + 1.0
            self._link.hello(heartbeat(self._status))
        for peer in self._link.peers.values():
            for name, due in peer.due.items():
                if now >= due:
                    self._link.send(telemetry_message(name, self._status), peer)
                    peer.due[name] = max(due + PERIODS[name], now - PERIODS[name])
        time.sleep(nap)


class _Stopped:
    """Whether a signal has asked the command to end."""

    def __init__(self) -> None:
        self._asked = False

    def __call__(self) -> bool:
        """Say whether to stop."""
        return self._asked

    def ask(self, _number: int, _frame: FrameType | None) -> None:
        """Handle the signal."""
        self._asked = True


@contextlib.contextmanager
def stop_signals() -> Iterator[_Stopped]:
    """Turn SIGINT and SIGTERM into a question, so that logs are closed in order."""
    stopped = _Stopped()
    kept = {number: signal.signal(number, stopped.ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stopped
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)


def _tell(text: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {text}", flush=True)


def _access(args: argparse.Namespace) -> Access:
    """Who may talk to us, from the command line.  Raises FlightError or PlanflyError."""
    allowed = frozenset(_ip("--allow", part.strip()) for part in (args.allow or "").split(",") if part.strip())
    key = read_key(Path(args.sign_key)) if args.sign_key else None
    access = Access(
        _address("--bind", args.bind), tuple(_address("--to", text) for text in args.to.split(",")), allowed, key
    )
    check_access(access)
    return access


def _address(option: str, text: str) -> tuple[str, int]:
    host, _, port = text.strip().rpartition(":")
    if not port.isdigit() or not 0 <= int(port) <= 65535:
        raise FlightError(f"{option} {text}: IP:PORT is expected, with a port 0..65535")
    return _ip(option, host.strip("[]")), int(port)


def _ip(option: str, text: str) -> str:
    try:
        return str(ipaddress.ip_address(text))
    except ValueError as error:
        raise FlightError(f"{option} {text}: an IP address is expected") from error
