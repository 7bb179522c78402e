"""A flight that a real autopilot steers, as a program of its own in lockstep with our physics."""

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import TracebackType

import numpy as np

from aircraft.catalog import Aircraft
from flight.guidance.gains import load_gains
from flight.real_autopilot.autopilot_link import AutopilotLink
from flight.real_autopilot.autopilot_parameters import AutopilotParameters, autopilot_parameters
from flight.real_autopilot.autopilot_process import AutopilotProcess, check_binary
from flight.real_autopilot.autopilot_tick import autopilot_tick
from flight.real_autopilot.json_physics import encode_motion, offset_on_sphere
from flight.real_autopilot.physics_port import PhysicsPort
from flight.real_autopilot.preflight import Preflight, Talk, version_text
from flight.real_autopilot.servo_map import load_servo_map
from flight.real_autopilot.start_rail import RailEnd, motion_on_rail, rail_end
from flight.real_autopilot.uploaded_mission import uploaded_mission
from flight.simulation.airborne import FDM_HZ, Airborne, Start
from flight.simulation.flight_setup import FlightSetup
from flight.simulation.local_map import Ground
from flight.simulation.simulate import Progress, SimulatedFlight, Sink, fly_to_end
from flight.simulation.workspace import READ_FIELDS
from world.errors import FlightError
from world.frames import to_geo
from world.terrain import Heights

# From where the aircraft flies by itself to the first waypoint: at least so far (m), and for so long (s).
RUN_IN, RUN_IN_SECONDS = 500.0, 20.0
# An aircraft that has not passed the first waypoint after so much longer (s) is judged from where it is.
_LOST = 40.0
# Frames of the exchange from one look at the link to the next: a tenth of a second.
_LOOK = 12
_MOTION = (
    *("latitude", "longitude", "amsl", "velocity_north", "velocity_east", "velocity_down", "roll", "pitch", "yaw"),
    *("roll_rate", "pitch_rate", "yaw_rate", "airspeed"),
)


@dataclass(frozen=True, slots=True)
class FlownBy:
    """Which autopilot flew.

    version: what it calls itself.
    sha256: of its program, hex.
    parameters: by name, what it was given over its own defaults, as it has them.
    changed: those of them that a person's file changed.
    unused: those of the person's file that it does not know, or that belong to other hardware.
    """

    version: str
    sha256: str
    parameters: Mapping[str, float]
    changed: Mapping[str, float]
    unused: tuple[str, ...]


class AutopilotFlight(Airborne):
    """One flight of a real autopilot; a context manager, after which its program and its files are gone.

    binary: its program.  own: a person's parameters, over the aircraft's.
    flown_by: known once it is made.

    The track begins where the aircraft passes the first waypoint, and the turbulence with it, as in our own flights.
    Before that it flies `RUN_IN` m straight and level in the mean wind, and before that it stands on a rail.

    Raises FlightError, in one line that names the program, for one that does not start, does not understand us, does
    not know where it is, refuses the mission, or ends.
    """

    def __init__(
        self, setup: FlightSetup, aircraft: Aircraft, binary: Path, own: Mapping[str, float] | None = None
    ) -> None:
        self.binary = binary
        digest = check_binary(binary)
        servos = load_servo_map(aircraft)
        given = autopilot_parameters(setup, aircraft, servos, own or {})
        # The program has an estimator of its own, with its own error.
        super().__init__(setup := replace(setup, nav="perfect"), aircraft, load_gains(aircraft))
        self._servos, self._setup = servos, setup
        start = self._start(setup)
        self._run_in_length = max(RUN_IN, RUN_IN_SECONDS * start.airspeed)
        self._rail = self._make_rail(setup, start)
        self._disturb(setup)
        self._time = 0.0
        self._frames = 0
        self._begun = False
        home = uploaded_mission(setup).home
        self._origin = (math.radians(home.lat_deg), math.radians(home.lon_deg), home.alt)
        with contextlib.ExitStack() as stack:
            self._port = stack.enter_context(contextlib.closing(PhysicsPort()))
            self._link = stack.enter_context(contextlib.closing(AutopilotLink()))
            place = (home.lat_deg, home.lon_deg, home.alt, math.degrees(self._rail.yaw) % 360.0)
            self._process = stack.enter_context(
                AutopilotProcess(binary, place, dict(given.given), self._port.port, self._link.port)
            )
            self._port.watch = self._process.watch
            self._preflight = Preflight(self._link, lambda: self._time)
            with self._named():
                self._converse(self._preflight.meet(given.given))
            self.flown_by = self._identity(digest, given)
            self._stack = stack.pop_all()

    def __enter__(self) -> "AutopilotFlight":
        """Return the flight itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the program, and remove what it has left."""
        self._stack.close()

    def keep_log(self, target: Path) -> bool:
        """End the program in order and move its own log (.BIN) to a file; whether there was one."""
        self._process.end(self._serve_once)
        return self._process.keep_log(target)

    def prepare(self) -> None:
        """Have the autopilot settle, take the mission and fly to the first waypoint."""
        with self._named():
            self._converse(self._preflight.prepare(uploaded_mission(self._setup)))
            self._push()
            self._make_loops()
            self._run_in()

    @contextlib.contextmanager
    def _named(self) -> Iterator[None]:
        """Name the program in what goes wrong with it."""
        try:
            yield
        except FlightError as error:
            raise FlightError(f"{self.binary}: {error}") from error

    def _identity(self, digest: str, given: AutopilotParameters) -> FlownBy:
        news = self._link.news
        known = {name: news.parameters.get(name, value) for name, value in given.given.items()}
        unknown = tuple(name for name in given.changed if name not in news.parameters)
        return FlownBy(
            version=version_text(news.texts, news.version),
            sha256=digest,
            parameters={name: value for name, value in sorted(known.items()) if name in news.parameters},
            changed={name: value for name, value in sorted(given.changed.items()) if name in news.parameters},
            unused=tuple(sorted({*given.unused, *unknown})),
        )

    def _make_rail(self, setup: FlightSetup, start: Start) -> RailEnd:
        """Trim the aircraft where it is let go: before the first waypoint, straight and level."""
        points = setup.route.waypoints
        step = points[1, :2] - points[0, :2]
        back = points[0, :2] - step / np.hypot(*step) * self._run_in_length
        lat, lon = (float(value) for value in to_geo(setup.scenario.origin, *back))
        begin = replace(start, lat_deg=lat, lon_deg=lon, slope=0.0, ground=min(0.0, start.amsl - 1000.0))
        self._trim(setup.mission.source, begin)
        return rail_end(self.fdm.read(), start.wind)

    def _converse(self, talk: Talk) -> None:
        """Hold the aircraft at rest while a conversation lasts."""
        while True:
            for _ in range(_LOOK):
                self._on_rail(0.0)
            self._link.poll()
            try:
                next(talk)
            except StopIteration:
                return

    def _push(self) -> None:
        for k in range(1, math.ceil(self._rail.push_time * FDM_HZ) + 1):
            self._on_rail(k / FDM_HZ)

    def _on_rail(self, pushed: float) -> None:
        """One frame of the exchange on the rail."""
        packet = self._port.receive()
        self._workspace.commands[:] = self._servos.commands(packet.pulses)
        self._time += 1.0 / FDM_HZ
        self._port.answer(encode_motion(motion_on_rail(self._rail, self._time, pushed, self._origin)))

    def _make_loops(self) -> None:
        """Bind what flies a number of ticks: without ground and turbulence before the first waypoint, and with both."""
        access = self.fdm.loop_access()
        work, space = self._work, self._workspace
        work.state_factors = access.factors[0]
        work.scale_above, work.scale_below = (tuple(scales) for scales in zip(*access.scales, strict=True))
        self._exchange = self._make_exchange()
        read = [access.getters[field] for field in READ_FIELDS]
        gusts, ground = access.setters[4:7], access.setters[7]
        readings, output = space.readings, space.output.tolist

        def make(heights: Heights, known: bool) -> Callable[[int], int]:
            tick: Callable[[], int] = partial(autopilot_tick, space.block, heights)

            def fly(count: int) -> int:
                for _ in range(count):
                    self._take()
                    readings[:] = [getter() for getter in read]
                    if status := tick():
                        return status
                    *_, north, east, down, under = output()
                    gusts[0](north)
                    gusts[1](east)
                    gusts[2](down)
                    if known:
                        ground(under)
                    self._exchange()
                    for _ in range(self._steps - 1):
                        self._take()
                        self._exchange()
                return 0

            return fly

        self._loop = make(self._ground.heights, self._ground.known)
        self._run_in_loop = make(Ground(None).heights, False)

    def _take(self) -> None:
        """Wait for the next frame, and set the controls as it asks."""
        commands = self._servos.commands(self._port.receive().pulses)
        self._workspace.commands[:] = commands
        self.fdm.write(commands)

    def _make_exchange(self) -> Callable[[], None]:
        """Make what steps JSBSim once and tells the autopilot how the aircraft moves then."""
        access = self.fdm.loop_access()
        read = [(access.getters[name], float(access.factors[name][0])) for name in _MOTION]
        force, run, answer = self.fdm.specific_force, access.run, self._port.answer
        lat0, lon0, amsl0 = self._origin

        def exchange() -> None:
            run()
            self._time += 1.0 / FDM_HZ
            self._frames += 1
            lat, lon, amsl, vn, ve, vd, roll, pitch, yaw, p, q, r, airspeed = [get() * factor for get, factor in read]
            north, east = offset_on_sphere(lat, lon, lat0, lon0)
            answer(
                encode_motion(
                    (self._time, p, q, r, *force(), north, east, amsl0 - amsl, roll, pitch, yaw, vn, ve, vd, airspeed)
                )
            )
            if self._frames % _LOOK == 0:
                self._look()

        return exchange

    def _look(self) -> None:
        """Take in what the autopilot tells, above all which item it flies."""
        self._link.poll()
        self._workspace.on_last_leg[0] = self._link.news.mission_item >= self._last_item

    def _run_in(self) -> None:
        """Fly to the first waypoint in the mean wind, over no ground; what goes wrong on the way ends it early."""
        self._last_item = len(uploaded_mission(self._setup).items)
        wind, timing = self._work.wind, self._work.timing
        w20, wind.w20 = wind.w20, 0.0
        most = (RUN_IN_SECONDS + self._run_in_length / self._rail.ground_speed + _LOST) / self.dt
        for _ in range(int(most)):
            timing.row = 0
            if self._run_in_loop(1) or self.memory.distance >= 0.0:
                break
        wind.w20 = w20
        timing.tick = timing.row = 0
        self._work.air.energy = 0.0
        self.memory.piece = 0

    def _fly(self, count: int) -> int:
        with self._named():
            return self._loop(count)

    def _serve_once(self) -> bool:
        """Answer one more frame on the spot, for a program that is about to end."""
        try:
            self._port.receive()
        except FlightError:
            return False
        self._exchange()
        return True


def fly_autopilot(
    setup: FlightSetup,
    aircraft: Aircraft,
    binary: Path,
    own: Mapping[str, float] | None = None,
    *,
    sink: Sink | None = None,
    progress: Progress | None = None,
    log: Path | None = None,
) -> tuple[SimulatedFlight, FlownBy]:
    """Fly a setup with a real autopilot, from its boot to its end; arguments as of `AutopilotFlight` and `simulate`.

    log: where the autopilot's own log (.BIN) is kept.
    """
    with AutopilotFlight(setup, aircraft, binary, own) as flight:
        flight.prepare()
        flown = fly_to_end(flight, sink, progress)
        if log is not None:
            flight.keep_log(log)
        return flown, flight.flown_by
