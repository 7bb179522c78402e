"""Fly an autopilot's program in lockstep with planfly's physics."""

import contextlib
import math
from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Self

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.contacts import find_contacts
from flight.autopilots.parts import Tick
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
from flight.simulation.start import Release, default_gear, find_release, release
from flight.simulation.tick import (
    NOT_A_NUMBER,
    PATH_ROW,
    RTL_ARRIVAL_LOITER_RADII,
    RTL_ARRIVAL_RADIUS_M,
    WORKSPACE,
    WORKSPACE_NUMBERS,
    begin_tick,
    end_around,
    end_return,
    end_tick,
)
from world.arrays import Floats, Heights
from world.errors import CrashError, FlightError
from world.frames import to_geo
from world.kernels import Record, Records, compiled, inner

# ----------------------------------------------------------------------
# One tick of a flight under another program's control: find the state on the path, make the wind, fill a row.


# Number of path pieces ahead, the current one included, on which the aircraft may be.
_SEARCHED_PIECES = 4


@compiled
def autopilot_tick(block: Floats, heights: Heights) -> int:
    """Run a tick on the block of a `flight.simulation.tick.Workspace`, as the tick of a control law does.

    The autopilot's program has set the commands in the block.  The flight completes where it passes the end of the
    path, once the program reports that only this end lies ahead; an RTL completes in its loiter, a loiter without end
    after `UNLIMITED`, and a mission whose last waypoint is circled about completes after one lap.
    """
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    path: Record = block[WORKSPACE_NUMBERS:].view(PATH_ROW)
    settings, memory = work.settings, work.memory
    if not begin_tick(work, heights):
        return NOT_A_NUMBER
    place_on_path(work.true, path.piece[: settings.pieces], path.node[: settings.nodes], memory)
    memory.speed_command = path.waypoint[memory.leg].airspeed
    last = path.waypoint[settings.waypoints - 1]
    previous = path.waypoint[settings.waypoints - 2]
    if last.is_rtl and settings.on_last_leg:
        end_return(work.true, last, memory, work.timing.dt)
    elif settings.on_last_leg and previous.loiter_radius != 0.0 and previous.loiter_time == math.inf:
        end_circling(work.true, previous, memory, work.timing.dt)
    elif settings.on_last_leg and last.is_mission_end:
        end_around(work.true, memory, work.timing.dt)
    elif settings.on_last_leg:
        cross_track, distance_past = beyond_end(work.true, path.waypoint[: settings.waypoints])
        memory.is_finished = distance_past >= 0.0
        # An aircraft that loiters at the mission's end, however wide, has not missed the route.
        memory.is_in_rtl = previous.loiter_radius != 0.0 and previous.stop == last.stop
        if memory.is_finished:
            memory.cross_track = cross_track
    return end_tick(work)


@inner
def place_on_path(true: Record, pieces: Records, nodes: Records, memory: Record) -> None:  # pragma: no cover
    """Fill leg, distance, cross-track and altitude error of the memory from the nearest path piece.

    The search starts at the last piece.  It skips pieces against the direction of flight, because both directions of an
    out-and-back leg lie on one line.

    true: a record of `flight.guidance.navigation_error.MOTION`.
    """
    nearest_piece, min_distance, distance, cross_track = memory.piece, math.inf, 0.0, 0.0
    for candidate in range(memory.piece, min(memory.piece + _SEARCHED_PIECES, pieces.shape[0])):
        piece = pieces[candidate]
        along_piece, cross_track_there, course = project(piece, true.east, true.north)
        if (
            candidate > memory.piece
            and true.velocity_east * math.sin(course) + true.velocity_north * math.cos(course) < 0.0
        ):
            continue
        overrun = max(0.0, -along_piece, along_piece - piece.length)
        if math.hypot(cross_track_there, overrun) < min_distance:
            nearest_piece, min_distance = candidate, math.hypot(cross_track_there, overrun)
            distance, cross_track = piece.start + along_piece, cross_track_there
    memory.piece = nearest_piece
    memory.distance = distance
    memory.cross_track = cross_track
    memory.leg = pieces[nearest_piece].leg + (1 if distance > pieces[nearest_piece].leg_change else 0)
    memory.height_error = true.up - profile(nodes, distance)[0]


@inner
def end_circling(true: Record, corner: Record, memory: Record, dt: float) -> None:
    """Update the time on a loiter without end, and end the flight after `UNLIMITED`.

    The time runs from where the aircraft, near the circle, first flies around its center in its direction faster than
    towards it or away from it; from then on it runs however wide the circle is flown.

    true: a record of `flight.guidance.navigation_error.MOTION`.
    corner: a corner of the circle, of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    memory: a record of `flight.guidance.inner_loops.GUIDANCE_MEMORY`; its `loiter_time` is the time, s.
    """
    offset_east, offset_north = true.east - corner.centre_east, true.north - corner.centre_north
    distance = max(0.1, math.hypot(offset_east, offset_north))
    radial_speed = (true.velocity_east * offset_east + true.velocity_north * offset_north) / distance
    clockwise_speed = (true.velocity_east * offset_north - true.velocity_north * offset_east) / distance
    tangential_speed = math.copysign(1.0, corner.loiter_radius) * clockwise_speed
    if memory.loiter_time > 0.0 or (
        distance < max(RTL_ARRIVAL_RADIUS_M, RTL_ARRIVAL_LOITER_RADII * abs(corner.loiter_radius))
        and tangential_speed > abs(radial_speed)
    ):
        memory.loiter_time += dt
    # An aircraft that loiters at the mission's end, however wide, has not missed it.
    memory.is_in_rtl = True
    memory.is_finished = memory.loiter_time > UNLIMITED


@inner
def beyond_end(true: Record, waypoints: Records) -> tuple[float, float]:
    """Return the distance to the right of the last leg, and the distance past its end, m."""
    a, b = waypoints[waypoints.shape[0] - 2], waypoints[waypoints.shape[0] - 1]
    length = math.hypot(b.east - a.east, b.north - a.north)
    east, north = (b.east - a.east) / length, (b.north - a.north) / length
    offset_east, offset_north = true.east - b.east, true.north - b.north
    return offset_east * north - offset_north * east, offset_east * east + offset_north * north


# Minimum distance from the release to the first waypoint, m.
RUN_IN = 500.0
# Minimum time from the release to the first waypoint, s.  After the release the aircraft rises by 4 m and sinks by 6 m,
# as TECS was wound up on the rail; after 20 s the stored flights reached the first waypoint up to 2.2 m low or high
# (the higher and the windier the more), and were within 0.5 m of their law another 5 s later.
RUN_IN_SECONDS = 40.0
# Timeout of the run-in, s beyond twice that time: then the flight is judged from where the aircraft is.
_RUN_IN_TIMEOUT_S = 40.0


def launch_rail(release_state: Release, take_off: TakeOff) -> RailEnd:
    """Return the rail of a launch, or a rail of no length on a runway."""
    north, east, _ = release_state.velocity
    roll, pitch, yaw = release_state.attitude
    lat, lon = (math.radians(value) for value in release_state.position[:2])
    return RailEnd(
        *(
            lat,
            lon,
            release_state.position[2],
            roll,
            pitch,
            yaw,
            yaw,
            math.hypot(north, east),
            release_state.wind[0],
            release_state.wind[1],
        ),
        incline=take_off.launch.incline,
        push=take_off.acceleration or PUSH,
    )


class SitlFlight(ProgramFlight):
    """One flight of an autopilot's program; a context manager that ends it and removes its files.

    binary: the program.

    The track begins where the aircraft passes the first waypoint, and the turbulence with it, as in planfly's own
    flights.  Before that it flies `RUN_IN` m straight and level in the mean wind, and before that it stands on a
    rail.  A flight from the ground begins at the end of the launch, or at rest on the runway, and the mission is
    uploaded unchanged.  Its GNSS position has the error of the setup's navigation.

    Raises FlightError, in one line that names the program, if the program does not start, does not understand the
    exchange, finds no position, refuses the mission, or ends.
    """

    _link: AutopilotLink
    _process: AutopilotProcess
    _lockstep: Lockstep
    _stack: contextlib.ExitStack

    def __init__(self, setup: FlightSetup, aircraft: Aircraft, binary: Path) -> None:
        self._binary, self._ground_phases, gear = binary, setup.ground_phases, None
        ground_law = setup.autopilot.ground.control_law
        if self._ground_phases and ground_law is not None:
            gear = default_gear(self._ground_phases)
            self._law = ground_law(self._ground_phases, aircraft, find_contacts(aircraft, gear))
        super().__init__(setup, aircraft, load_gains(aircraft), gear=gear)
        self._release: Release | None = None
        self._rail = self._trim_on_rail(setup)
        self._start_disturbances(setup)
        self._mission = uploaded_mission(setup)
        if self._law is not None:
            self.max_ticks += int(GROUND_PATIENCE / self.dt)
            self._law.initialise(self.memory, self._workspace.own)
        # Compiled here, while no autopilot waits for it.
        tick = self._ground_tick if self._ground_phases else autopilot_tick
        tick(self._workspace.block.copy(), self._ground.heights)

    @property
    def _ground_tick(self) -> Tick:
        """Compiled function for one tick of a flight from the ground; only if the program flies one."""
        raise ValueError(f"{self.setup.autopilot.title} is put into the air on a rail")

    @property
    @abstractmethod
    def last_item(self) -> int:
        """Number of the mission's last item in the program."""

    @property
    def _is_ending(self) -> bool:
        """True if the program reports that only the end of its mission lies ahead."""
        return self._link.news.mission_item >= self.last_item

    @abstractmethod
    def _prepare_program(self) -> None:
        """Make the program settle and accept the mission; the aircraft is on the rail, and finally at its end."""

    def __enter__(self) -> Self:
        """Return the flight itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the program, and remove its files."""
        self._stack.close()

    @property
    def exchanged(self) -> float:
        """Autopilot time since its boot, s."""
        return self._lockstep.time

    def prepare(self) -> None:
        """Let the autopilot settle and accept the mission, and fly the aircraft to the first waypoint.

        For a take-off, launch the aircraft instead. Raises FlightError, see the class.
        """
        with self._errors_name_program():
            self._prepare_program()
        with self._errors_name_program(CrashError):
            if self._release is None:
                self._fly_to_first_waypoint()
            else:
                self._begin_at_release(self._release)

    def _push(self, first: float = 0.0, last: float = 1.0) -> None:
        """Push the aircraft along the rail, from one fraction of the push time to another."""
        frames = math.ceil(self._rail.push_time * FRAME_HZ)
        for k in range(math.ceil(first * frames) + 1, math.ceil(last * frames) + 1):
            self._lockstep.hold(self._rail, k / FRAME_HZ)

    def keep_log(self, target: Path) -> bool:
        """End the program in order, and move its own log to a file; return True if there was a log."""
        self._process.end(self._answer_frame)
        return self._process.keep_log(target)

    @contextlib.contextmanager
    def _errors_name_program(self, error_class: type[FlightError] = FlightError) -> Iterator[None]:
        """Raise errors of the program in this context as errors of one kind that name the program."""
        try:
            yield
        except FlightError as error:
            is_named = str(error).startswith(str(self._binary))
            raise error_class.from_error(error, "" if is_named else self._binary) from error

    def _trim_on_rail(self, setup: FlightSetup) -> RailEnd:
        """Trim the aircraft at its release, straight and level before the first waypoint, and return its rail.

        For a take-off, return the rail of the launch.
        """
        start, points = self._find_start(setup), setup.route.waypoints
        if self._ground_phases.take_off is not None:
            self._start_trimmed(setup.mission.source, start)
            aircraft = self.fdm.aircraft
            self._release = find_release(setup, self.map, self._ground, aircraft, self._ground_phases.take_off)
            return launch_rail(self._release, self._ground_phases.take_off)
        first_leg = points[1, :2] - points[0, :2]
        release_position = points[0, :2] - first_leg / np.hypot(*first_leg) * max(
            RUN_IN, RUN_IN_SECONDS * start.airspeed
        )
        lat, lon = (float(value) for value in to_geo(setup.scenario.origin, *release_position))
        release_start = replace(start, lat_deg=lat, lon_deg=lon, slope=0.0, ground=min(0.0, start.amsl - 1000.0))
        self._start_trimmed(setup.mission.source, release_start)
        return rail_end(self.fdm.read(), start.wind)

    def _hold_during(self, talk: Talk) -> None:
        """Hold the aircraft at rest during a conversation."""
        while True:
            for _ in range(LOOK_FRAMES):
                self._lockstep.hold(self._rail)
            try:
                next(talk)
            except StopIteration:
                return

    def _poll_link(self) -> None:
        """Read the autopilot's messages, and update whether its last leg is flown."""
        self._link.poll()
        self._workspace.on_last_leg[0] = self._is_ending

    def _apply_gnss_error(self) -> None:
        """Set the GNSS position error of the start."""
        settings, navigation = self._work.settings, self._work.navigation
        scale = settings.navigation_sigma * math.sqrt(2.0)
        east, north, up = (scale * navigation.second).tolist()
        self._lockstep.error = (north, east, up, 0.0, 0.0, 0.0)

    def _begin_at_release(self, release_state: Release) -> None:
        """Begin at the end of the rail or the throw, with the program's controls, or at rest on a runway."""
        self._set_unit_factors()
        commands = tuple(float(command) for command in self._workspace.commands)
        self._work.commands = release(self.fdm, release_state, (commands[0], commands[1], commands[2], commands[3]))
        self._work.air.wind_north, self._work.air.wind_east = release_state.wind[:2]
        self._make_loop(self._ground_tick)

    def _set_unit_factors(self) -> None:
        access = self.fdm.loop_access()
        self._work.state_factors = access.factors[0]
        self._work.scale_above, self._work.scale_below = (tuple(scales) for scales in zip(*access.scales, strict=True))

    def _make_loop(self, tick: Tick) -> None:
        """Continue the flight with a tick that is recorded, over the terrain."""
        bound_tick = partial(tick, self._workspace.block, self._ground.heights)
        tick_with_gnss_error = partial(self._tick, bound_tick, bool(self._work.settings.navigation_sigma))
        self._loop = self._lockstep.make_loop(
            tick_with_gnss_error, self._steps, gusts=self._windy, ground=self._ground.known
        )

    def _fly_to_first_waypoint(self) -> None:
        """Fly to the first waypoint in the mean wind, without ground; an end of the flight ends the run-in early."""
        work, timing, steps = self._work, self._work.timing, self._steps
        self._set_unit_factors()
        tick = partial(autopilot_tick, self._workspace.block, Ground(None).heights)
        loop = self._lockstep.make_loop(tick, steps, gusts=self._windy, ground=False)
        saved_settings = work.wind.w20, work.settings.navigation_sigma
        work.wind.w20 = work.settings.navigation_sigma = 0.0
        for _ in range(round((2.0 * RUN_IN_SECONDS + _RUN_IN_TIMEOUT_S) / self.dt)):
            timing.row = 0
            if loop(1) or self.memory.distance >= 0.0:
                break
        work.wind.w20, work.settings.navigation_sigma = saved_settings
        timing.tick = timing.row = 0
        work.air.energy = 0.0
        self.memory.piece = 0
        self._make_loop(autopilot_tick)

    def _tick(self, tick: "partial[int]", has_gnss_error: bool) -> int:
        """Run a tick, and set the GNSS error after it."""
        status = tick()
        if has_gnss_error:
            east, north, up, velocity_east, velocity_north, velocity_up = self._workspace.navigation_error()
            self._lockstep.error = (north, east, up, velocity_north, velocity_east, velocity_up)
        return status

    def _fly_ticks(self, count: int) -> int:
        with self._errors_name_program(CrashError):
            return self._loop(count)

    def _answer_frame(self) -> bool:
        """Answer one more frame of a program that is about to end; return False if it has ended."""
        try:
            self._lockstep.serve()
        except FlightError:
            return False
        return True
