"""A flight that an autopilot's program steers in lockstep with our physics."""

import contextlib
import math
from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import Aircraft
from aircraft.contacts import contacts_of
from flight.autopilots.autopilot import Autopilot, Tick
from flight.autopilots.program import ProgramFlight
from flight.autopilots.sitl.conversation import Talk
from flight.autopilots.sitl.exchange import FRAME_HZ, LOOK_FRAMES, PUSH, Lockstep, RailEnd, rail_end
from flight.autopilots.sitl.link import AutopilotLink
from flight.autopilots.sitl.mission import uploaded_mission
from flight.autopilots.sitl.process import AutopilotProcess
from flight.guidance.gains import load_gains
from flight.guidance.path import profile, project
from flight.mission.ground_ways import TakeOff
from flight.mission.itinerary import UNLIMITED
from flight.simulation.local_map import Ground
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import GROUND_PATIENCE
from flight.simulation.start import Release, find_release, gear_of, release
from flight.simulation.tick import (
    NEAR,
    NOT_A_NUMBER,
    PATH_ROW,
    WIDER,
    WORKSPACE,
    WORKSPACE_NUMBERS,
    begin_tick,
    end_around,
    end_return,
    end_tick,
)
from world.errors import CrashError, FlightError
from world.frames import to_geo
from world.kernels import Record, Records, compiled, inner
from world.terrain import Heights

Floats = NDArray[np.float64]


# ----------------------------------------------------------------------
# One tick of a flight that another program steers: place the state on the path, make the wind, fill a row.


# Pieces of the path ahead among which the aircraft may be.
_AHEAD = 4


@compiled
def autopilot_tick(block: Floats, heights: Heights) -> int:  # pragma: no cover - compiled
    """Do a tick on the block of a `flight.simulation.tick.Workspace`, as a law's tick does.

    The commands that stand in it are the other program's.  The flight completes where it passes the end of the path,
    once the program says that it has nothing before it but that; a return to launch completes in its circle, a loiter
    without end after `UNLIMITED` on its own, and a mission whose last waypoint is circled about once around that.
    """
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    path: Record = block[WORKSPACE_NUMBERS:].view(PATH_ROW)
    settings, memory = work.settings, work.memory
    if not begin_tick(work, heights):
        return NOT_A_NUMBER
    place_on_path(work.true, path.piece[: settings.pieces], path.node[: settings.nodes], memory)
    memory.speed_command = path.waypoint[memory.leg].airspeed
    last = path.waypoint[settings.waypoints - 1]
    before = path.waypoint[settings.waypoints - 2]
    if last.returns and settings.on_last_leg:
        end_return(work.true, last, memory, work.timing.dt)
    elif settings.on_last_leg and before.circle != 0.0 and before.stays == math.inf:
        end_circling(work.true, before, memory, work.timing.dt)
    elif settings.on_last_leg and last.ends:
        end_around(work.true, memory, work.timing.dt)
    elif settings.on_last_leg:
        across, beyond = beyond_end(work.true, path.waypoint[: settings.waypoints])
        memory.done = beyond >= 0.0
        # What circles at a mission's end, as wide as it can, has not missed it.
        memory.returning = before.circle != 0.0 and before.stop == last.stop
        if memory.done:
            memory.cross_track = across
    return end_tick(work)


@inner
def place_on_path(true: Record, pieces: Records, nodes: Records, memory: Record) -> None:  # pragma: no cover
    """Fill leg, distance, cross-track and height error of the memory, by the nearest piece from the last one on.

    A piece that leads the other way than the aircraft flies is not begun: the way back of an out-and-back leg lies on
    the way out.
    true: a record of `flight.guidance.navigation_error.MOTION`.
    """
    k, nearest, distance, aside = memory.piece, math.inf, 0.0, 0.0
    for i in range(memory.piece, min(memory.piece + _AHEAD, pieces.shape[0])):
        piece = pieces[i]
        along, cross, course = project(piece, true.east, true.north)
        if i > memory.piece and true.velocity_east * math.sin(course) + true.velocity_north * math.cos(course) < 0.0:
            continue
        outside = max(0.0, -along, along - piece.length)
        if math.hypot(cross, outside) < nearest:
            k, nearest = i, math.hypot(cross, outside)
            distance, aside = piece.start + along, cross
    memory.piece = k
    memory.distance = distance
    memory.cross_track = aside
    memory.leg = pieces[k].leg + (1 if distance > pieces[k].leg_change else 0)
    memory.height_error = true.up - profile(nodes, distance)[0]


@inner
def end_circling(true: Record, b: Record, memory: Record, dt: float) -> None:  # pragma: no cover - compiled
    """Count how long a loiter without end was circled, and end the flight after `UNLIMITED`.

    Seconds count from where the aircraft, near the circle, first flies around its middle in its direction more than to
    it or from it; from then on they count however wide the circle is flown.

    true: a record of `flight.guidance.navigation_error.MOTION`.
    b: a corner of the circle, of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    memory: of `flight.guidance.inner_loops.GUIDANCE_MEMORY`; its `circled` are the seconds.
    """
    out_e, out_n = true.east - b.centre_east, true.north - b.centre_north
    away = max(0.1, math.hypot(out_e, out_n))
    outwards = (true.velocity_east * out_e + true.velocity_north * out_n) / away
    clockwise = (true.velocity_east * out_n - true.velocity_north * out_e) / away
    around = math.copysign(1.0, b.circle) * clockwise
    if memory.circled > 0.0 or (away < max(NEAR, WIDER * abs(b.circle)) and around > abs(outwards)):
        memory.circled += dt
    # As wide as it is flown it has not missed the mission's end.
    memory.returning = True
    memory.done = memory.circled > UNLIMITED


@inner
def beyond_end(true: Record, waypoints: Records) -> tuple[float, float]:  # pragma: no cover - compiled
    """How far right of the last leg (m), and how far past its end, the aircraft is."""
    a, b = waypoints[waypoints.shape[0] - 2], waypoints[waypoints.shape[0] - 1]
    length = math.hypot(b.east - a.east, b.north - a.north)
    east, north = (b.east - a.east) / length, (b.north - a.north) / length
    de, dn = true.east - b.east, true.north - b.north
    return de * north - dn * east, de * east + dn * north


# From where the aircraft flies by itself to the first waypoint: at least so far (m), and for so long (s).  Let go, it
# rises by 4 m and sinks by 6, for TECS was wound up on the rail; after 20 s the kept flights came to the first waypoint
# up to 2.2 m low or high (the higher and the windier the more), and were within 0.5 m of their law another 5 s later.
RUN_IN, RUN_IN_SECONDS = 500.0, 40.0
# An aircraft that has not passed the first waypoint after so much longer (s) is judged from where it is.
_LOST = 40.0


def launch_rail(begin: Release, take_off: TakeOff) -> RailEnd:
    """The rail of a launch, or of none where the aircraft stands on its runway."""
    north, east, _ = begin.velocity
    roll, pitch, yaw = begin.attitude
    lat, lon = (math.radians(value) for value in begin.place[:2])
    return RailEnd(
        *(lat, lon, begin.place[2], roll, pitch, yaw, yaw, math.hypot(north, east), begin.wind[0], begin.wind[1]),
        incline=take_off.launch.incline,
        push=take_off.acceleration or PUSH,
    )


class SitlFlight(ProgramFlight):
    """One flight of an autopilot's program; a context manager, after which the program and its files are gone.

    binary: the program.

    The track begins where the aircraft passes the first waypoint, and the turbulence with it, as in our own flights.
    Before that it flies `RUN_IN` m straight and level in the mean wind, and before that it stands on a rail.  From the
    ground it begins where the launch ends, or where it stands on its runway, and the mission goes up as it is.
    It takes its place from satellites with the error of the setup's navigation.

    Raises FlightError, in one line that names the program, for one that does not start, does not understand us, does
    not know where it is, refuses the mission, or ends.
    """

    _link: AutopilotLink
    _process: AutopilotProcess
    _lockstep: Lockstep
    _stack: contextlib.ExitStack

    def __init__(self, setup: FlightSetup, aircraft: Aircraft, binary: Path) -> None:
        self._binary, self._ways, gear = binary, setup.ground_ways, None
        if self._ways:
            gear = gear_of(self._ways)
            self._from_ground = setup.autopilot.from_ground(self._ways, aircraft, contacts_of(aircraft, gear))
        super().__init__(setup, aircraft, load_gains(aircraft), gear=gear)
        self._release: Release | None = None
        self._rail = self._make_rail(setup)
        self._disturb(setup)
        self._mission = uploaded_mission(setup)
        if self._ways:
            self.max_ticks += int(GROUND_PATIENCE / self.dt)
            self._from_ground.begin(self.memory, self._workspace.own)
        # Compiled here, where no autopilot waits for it.
        tick = self._ground_tick if self._ways else autopilot_tick
        tick(self._workspace.block.copy(), self._ground.heights)

    def _law(self, setup: FlightSetup) -> Autopilot:
        return self._from_ground if self._ways else setup.autopilot

    @property
    def _ground_tick(self) -> Tick:
        """One tick of a flight from the ground to the ground; only of a program that flies one."""
        raise ValueError(f"{self.setup.autopilot.title} is put into the air on a rail")

    @property
    @abstractmethod
    def last_item(self) -> int:
        """The number by which the program knows the mission's last item."""

    @property
    def _is_ending(self) -> bool:
        """Whether by the program's own account nothing but the end of its mission lies before it."""
        return self._link.news.mission_item >= self.last_item

    @abstractmethod
    def _get_ready(self) -> None:
        """Have the program settle and take the mission; the aircraft is on the rail, and at its end at last."""

    def __enter__(self) -> Self:
        """Return the flight itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the program, and remove what it has left."""
        self._stack.close()

    @property
    def exchanged(self) -> float:
        """Seconds of the autopilot's time that have passed since its boot."""
        return self._lockstep.time

    def prepare(self) -> None:
        """Have the autopilot settle, take the mission and fly to the first waypoint.  Raises as the class does.

        From the ground it is launched instead, or left to roll.
        """
        with self._named():
            self._get_ready()
        with self._named(CrashError):
            if self._release is None:
                self._run_in()
            else:
                self._let_go(self._release)

    def _push(self, first: float = 0.0, last: float = 1.0) -> None:
        """Push the aircraft along the rail, from one share of the time that takes to another."""
        frames = math.ceil(self._rail.push_time * FRAME_HZ)
        for k in range(math.ceil(first * frames) + 1, math.ceil(last * frames) + 1):
            self._lockstep.hold(self._rail, k / FRAME_HZ)

    def keep_log(self, target: Path) -> bool:
        """End the program in order, and move its own log to a file; whether there was one."""
        self._process.end(self._serve)
        return self._process.keep_log(target)

    @contextlib.contextmanager
    def _named(self, kind: type[FlightError] = FlightError) -> Iterator[None]:
        """Name the program in what goes wrong with it, as an error of this kind."""
        try:
            yield
        except FlightError as error:
            named = str(error).startswith(str(self._binary))
            raise kind.from_error(error, "" if named else self._binary) from error

    def _make_rail(self, setup: FlightSetup) -> RailEnd:
        """Trim the aircraft where it is let go: before the first waypoint, straight and level, over no ground.

        From the ground the rail is the launch's.
        """
        start, points = self._start(setup), setup.route.waypoints
        if self._ways.take_off is not None:
            self._trim(setup.mission.source, start)
            aircraft = self.fdm.aircraft
            self._release = find_release(setup, self.map, self._ground, aircraft, self._ways.take_off)
            return launch_rail(self._release, self._ways.take_off)
        step = points[1, :2] - points[0, :2]
        back = points[0, :2] - step / np.hypot(*step) * max(RUN_IN, RUN_IN_SECONDS * start.airspeed)
        lat, lon = (float(value) for value in to_geo(setup.scenario.origin, *back))
        begin = replace(start, lat_deg=lat, lon_deg=lon, slope=0.0, ground=min(0.0, start.amsl - 1000.0))
        self._trim(setup.mission.source, begin)
        return rail_end(self.fdm.read(), start.wind)

    def _converse(self, talk: Talk) -> None:
        """Hold the aircraft at rest while a conversation lasts."""
        while True:
            for _ in range(LOOK_FRAMES):
                self._lockstep.hold(self._rail)
            try:
                next(talk)
            except StopIteration:
                return

    def _look(self) -> None:
        """Take in what the autopilot tells, above all which item it flies."""
        self._link.poll()
        self._workspace.on_last_leg[0] = self._is_ending

    def _apply_gnss_error(self) -> None:
        """Have the satellites mistake the place by as much as they do at the start."""
        settings, navigation = self._work.settings, self._work.navigation
        scale = settings.navigation_sigma * math.sqrt(2.0)
        east, north, up = (scale * navigation.second).tolist()
        self._lockstep.error = (north, east, up, 0.0, 0.0, 0.0)

    def _let_go(self, begin: Release) -> None:
        """Begin where rail or hand let go, with the controls as the program has set them, or at rest on a runway."""
        self._scale()
        commands = tuple(float(one) for one in self._workspace.commands)
        self._work.commands = release(self.fdm, begin, (commands[0], commands[1], commands[2], commands[3]))
        self._work.air.wind_north, self._work.air.wind_east = begin.wind[:2]
        self._make_loop(self._ground_tick)

    def _scale(self) -> None:
        access = self.fdm.loop_access()
        self._work.state_factors = access.factors[0]
        self._work.scale_above, self._work.scale_below = (tuple(one) for one in zip(*access.scales, strict=True))

    def _make_loop(self, tick: Tick) -> None:
        """Have the flight go on by a tick that is recorded, over its ground."""
        made = partial(tick, self._workspace.block, self._ground.heights)
        own = partial(self._tick, made, bool(self._work.settings.navigation_sigma))
        self._loop = self._lockstep.make_loop(own, self._steps, gusts=self._windy, ground=self._ground.known)

    def _run_in(self) -> None:
        """Fly to the first waypoint in the mean wind, over no ground; what goes wrong on the way ends it early."""
        work, timing, steps = self._work, self._work.timing, self._steps
        self._scale()
        tick = partial(autopilot_tick, self._workspace.block, Ground(None).heights)
        loop = self._lockstep.make_loop(tick, steps, gusts=self._windy, ground=False)
        kept = work.wind.w20, work.settings.navigation_sigma
        work.wind.w20 = work.settings.navigation_sigma = 0.0
        for _ in range(round((2.0 * RUN_IN_SECONDS + _LOST) / self.dt)):
            timing.row = 0
            if loop(1) or self.memory.distance >= 0.0:
                break
        work.wind.w20, work.settings.navigation_sigma = kept
        timing.tick = timing.row = 0
        work.air.energy = 0.0
        self.memory.piece = 0
        self._make_loop(autopilot_tick)

    def _tick(self, tick: "partial[int]", mistaken: bool) -> int:
        """A tick, and what the satellites mistake by then."""
        status = tick()
        if mistaken:
            east, north, up, v_east, v_north, v_up = self._workspace.navigation_error()
            self._lockstep.error = (north, east, up, v_north, v_east, v_up)
        return status

    def _fly(self, count: int) -> int:
        with self._named(CrashError):
            return self._loop(count)

    def _serve(self) -> bool:
        """Answer one more frame of a program that is about to end; false where it has ended."""
        try:
            self._lockstep.serve()
        except FlightError:
            return False
        return True
