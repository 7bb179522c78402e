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
from flight.autopilots.sitl.conversation import ConversationStep
from flight.autopilots.sitl.exchange import (
    FRAME_HZ,
    POLL_INTERVAL_FRAMES,
    PUSH_ACCELERATION_MPS2,
    Lockstep,
    RailEnd,
    rail_end,
)
from flight.autopilots.sitl.link import AutopilotLink
from flight.autopilots.sitl.mission import make_uploaded_mission
from flight.autopilots.sitl.process import AutopilotProcess
from flight.guidance.gains import load_gains
from flight.guidance.path import profile_at, project
from flight.mission.ground_phases import TakeOff
from flight.mission.itinerary import ENDLESS_LOITER_TIME_S
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import (
    GROUND_TIME_ALLOWANCE_S,
    Ground,
    Release,
    default_gear,
    find_release,
    release_aircraft,
)
from flight.simulation.tick import (
    NOT_A_NUMBER,
    PATH_ROW,
    RTL_ARRIVAL_LOITER_RADII,
    RTL_ARRIVAL_RADIUS_M,
    WORKSPACE,
    WORKSPACE_NUMBERS,
    airborne_end_code,
    begin_tick,
    end_tick,
    update_end_loiter,
    update_rtl_loiter,
)
from world.arrays import Floats, Heights
from world.errors import CrashError, FlightError
from world.frames import to_geo
from world.kernels import Record, Records, compiled, inner

# ----------------------------------------------------------------------
# One tick of a flight that an autopilot's program controls: wind, position along the path, and one row of the track.


# Number of path pieces ahead, the current one included, on which the aircraft may be.
_SEARCHED_PIECES = 4


@compiled
def autopilot_tick(block: Floats, heights: Heights) -> int:
    """Advance the flight in the block of a `flight.simulation.tick.Workspace` by one tick.

    Return the code of the flight's end, or 0 if the flight continues. The program has already set the commands in the
    block.

    The flight may be complete once the program reports that it flies to its last item. Usually it completes where the
    aircraft passes the end of the path. An RTL completes in its loiter. An unlimited loiter completes after
    `ENDLESS_LOITER_TIME_S` and one lap, and a loiter about the last waypoint after one lap.
    """
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    path: Record = block[WORKSPACE_NUMBERS:].view(PATH_ROW)
    settings, memory = work.settings, work.memory
    if not begin_tick(work, heights):
        return NOT_A_NUMBER
    place_on_path(work.true, path.piece[: settings.pieces], path.node[: settings.nodes], memory)
    memory.speed_command = path.waypoint[memory.leg].airspeed
    last_waypoint = path.waypoint[settings.waypoints - 1]
    previous_waypoint = path.waypoint[settings.waypoints - 2]
    if last_waypoint.is_rtl and settings.on_last_leg:
        update_rtl_loiter(work.true, last_waypoint, memory, work.timing.dt)
    elif settings.on_last_leg and previous_waypoint.loiter_radius != 0.0 and previous_waypoint.loiter_time == math.inf:
        update_endless_loiter(work.true, previous_waypoint, memory, work.timing.dt)
    elif settings.on_last_leg and last_waypoint.is_mission_end:
        update_end_loiter(work.true, memory, work.timing.dt)
    elif settings.on_last_leg:
        cross_track, distance_past = distances_from_route_end(work.true, path.waypoint[: settings.waypoints])
        memory.is_finished = distance_past >= 0.0
        # An aircraft that loiters at the mission's end has not missed the route, at any distance from the center.
        memory.is_in_rtl = previous_waypoint.loiter_radius != 0.0 and previous_waypoint.stop == last_waypoint.stop
        if memory.is_finished:
            memory.cross_track = cross_track
    end_tick(work, block)
    return airborne_end_code(work)


@inner
def place_on_path(true: Record, pieces: Records, nodes: Records, memory: Record) -> None:  # pragma: no cover
    """Set leg, distance, cross-track error and altitude error from the nearest piece of the path.

    The values are set in ``memory``. The search starts at the piece of the previous tick. Later pieces that lead
    against the aircraft's motion are skipped, because the two legs of an out-and-back route lie on one line.

    true: a record of `flight.guidance.navigation_error.MOTION`.
    """
    nearest_piece = memory.piece
    min_distance = math.inf
    distance = 0.0
    cross_track = 0.0
    for candidate in range(memory.piece, min(memory.piece + _SEARCHED_PIECES, pieces.shape[0])):
        piece = pieces[candidate]
        piece_distance, piece_cross_track, course = project(piece, true.east, true.north)
        if (
            candidate > memory.piece
            and true.velocity_east * math.sin(course) + true.velocity_north * math.cos(course) < 0.0
        ):
            continue
        overrun = max(0.0, -piece_distance, piece_distance - piece.length)
        if math.hypot(piece_cross_track, overrun) < min_distance:
            nearest_piece, min_distance = candidate, math.hypot(piece_cross_track, overrun)
            distance, cross_track = piece.start + piece_distance, piece_cross_track
    memory.piece = nearest_piece
    memory.distance = distance
    memory.cross_track = cross_track
    memory.leg = pieces[nearest_piece].leg + (1 if distance > pieces[nearest_piece].leg_change else 0)
    memory.height_error = true.up - profile_at(nodes, distance)[0]


@inner
def update_endless_loiter(true: Record, corner: Record, memory: Record, dt: float) -> None:
    """Update the time and angle flown on an unlimited loiter, and finish the flight when it is complete.

    The loiter is complete after `ENDLESS_LOITER_TIME_S` and one lap. Time and angle are counted from the moment when
    the aircraft is near the circle and moves mainly around the center, in the loiter's direction. From then on they are
    counted at any distance from the center.

    true: a record of `flight.guidance.navigation_error.MOTION`.
    corner: a corner of the circle, of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    memory: a record of `flight.guidance.inner_loops.GUIDANCE_MEMORY`; `loiter_time` is the time on the loiter, s, and
        `loiter_angle` the angle flown around its center, rad.
    dt: duration of a tick, s.
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
        memory.loiter_angle += tangential_speed / distance * dt
    # An aircraft that loiters at the mission's end has not missed the route, at any distance from the center.
    memory.is_in_rtl = True
    memory.is_finished = memory.loiter_time > ENDLESS_LOITER_TIME_S and memory.loiter_angle >= 2.0 * math.pi


@inner
def distances_from_route_end(true: Record, waypoints: Records) -> tuple[float, float]:
    """Return the distance to the right of the last leg, and the distance past its end, m.

    They are negative to the left of the leg and before its end.

    true: position of the aircraft, a `MOTION` record.
    waypoints: `WAYPOINT` records of the route, (w,).
    """
    start, end = waypoints[waypoints.shape[0] - 2], waypoints[waypoints.shape[0] - 1]
    length = math.hypot(end.east - start.east, end.north - start.north)
    east, north = (end.east - start.east) / length, (end.north - start.north) / length
    offset_east, offset_north = true.east - end.east, true.north - end.north
    return offset_east * north - offset_north * east, offset_east * east + offset_north * north


# Minimum distance from the release to the first waypoint, m.
MIN_RUN_IN_DISTANCE_M = 500.0
# Minimum time from the release to the first waypoint, s. After the release the aircraft rises by 4 m and then sinks by
# 6 m, because TECS integrated errors on the rail. In the stored flights the altitude error was up to 2.2 m 20 s after
# the release, more at higher altitudes and in stronger winds, and the flights agreed with the simulated control law to
# 0.5 m 5 s later.
MIN_RUN_IN_TIME_S = 40.0
# The run-in ends after twice the minimum time and this time, s: the flight is then judged from the aircraft's position.
_RUN_IN_TIMEOUT_S = 40.0


def launch_rail(release_state: Release, take_off: TakeOff) -> RailEnd:
    """Return the rail of a launch; for a runway, a rail of length 0, because the aircraft starts at rest."""
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
        push_acceleration=take_off.acceleration or PUSH_ACCELERATION_MPS2,
    )


class SitlFlight(ProgramFlight):
    """One flight of an autopilot's program; a context manager that ends it and removes its files.

    binary: file of the program.

    A flight that starts in the air stands on a rail until the autopilot is ready, then flies at least
    `MIN_RUN_IN_DISTANCE_M` straight and level in the mean wind. The track and the turbulence begin where the aircraft
    passes the first waypoint, as in planfly's own flights. The track of a flight from the ground begins at the end of
    the launch, or at rest on the runway, and its mission is uploaded unchanged. The GNSS position has the error of the
    setup's navigation.

    Raises FlightError, in one line that names the program, if the program does not start, uses another version of the
    physics interface, has no position estimate, refuses the mission, or ends.
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
        # The aircraft is trimmed on a rail: for a take-off the rail of the launch, or else one that ends before the
        # first waypoint, where the aircraft is released straight and level.
        self._release: Release | None = None
        start, points, take_off = self.start, setup.route.positions, self._ground_phases.take_off
        if take_off is not None:
            self._start_trimmed(setup.mission.source, start)
            self._release = find_release(setup, self.map, self._ground, self.fdm.aircraft, take_off)
            self._rail = launch_rail(self._release, take_off)
        else:
            first_leg = points[1, :2] - points[0, :2]
            release_position = points[0, :2] - first_leg / np.hypot(*first_leg) * max(
                MIN_RUN_IN_DISTANCE_M, MIN_RUN_IN_TIME_S * start.airspeed
            )
            lat, lon = (float(value) for value in to_geo(setup.scenario.origin, *release_position))
            release_start = replace(start, lat_deg=lat, lon_deg=lon, slope=0.0, ground=min(0.0, start.amsl - 1000.0))
            self._start_trimmed(setup.mission.source, release_start)
            self._rail = rail_end(self.fdm.read(), start.wind)
        self._mission = make_uploaded_mission(setup)
        if self._law is not None:
            self.max_ticks += int(GROUND_TIME_ALLOWANCE_S / self.dt)
            self._law.initialise(self.guidance_memory, self._workspace.law_record)
        # Compiled here, while no autopilot waits for it.
        tick = self._ground_tick if self._ground_phases else autopilot_tick
        tick(self._workspace.block.copy(), self._ground.heights)

    @property
    def _ground_tick(self) -> Tick:
        """Compiled function for one tick of a flight that starts on the ground.

        Programs that fly take-offs override this; for all others, it raises ValueError.
        """
        raise ValueError(f"the program of {self.setup.autopilot.title} flies no take-off: its flights start in the air")

    @property
    @abstractmethod
    def last_item(self) -> int:
        """Number of the mission's last item in the program."""

    @property
    def _is_ending(self) -> bool:
        """True if the program reports that it flies to the last item of its mission."""
        return self._link.reported.mission_item >= self.last_item

    @abstractmethod
    def _prepare_program(self) -> None:
        """Upload and start the mission on the rail, then push the aircraft to the rail's end."""

    def __enter__(self) -> Self:
        """Return the flight itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the program, and remove its files."""
        self._stack.close()

    @property
    def autopilot_time(self) -> float:
        """Autopilot time since its boot, s."""
        return self._lockstep.time

    def prepare(self) -> None:
        """Upload and start the mission, and bring the aircraft to the first waypoint or to its launch.

        Raises FlightError, see the class.
        """
        with self._name_program_in_errors():
            self._prepare_program()
        with self._name_program_in_errors(CrashError):
            if self._release is None:
                # Fly to the first waypoint in the mean wind, without turbulence and without ground. The run-in ends
                # before the waypoint if a tick ends the flight, or at a timeout.
                work, timing, steps = self._work, self._work.timing, self._steps
                self._set_unit_factors()
                tick = partial(autopilot_tick, self._workspace.block, Ground(None).heights)
                loop = self._lockstep.make_loop(tick, steps, gusts=self._windy, ground=False)
                saved_settings = work.wind.w20, work.settings.navigation_sigma
                work.wind.w20 = work.settings.navigation_sigma = 0.0
                for _ in range(round((2.0 * MIN_RUN_IN_TIME_S + _RUN_IN_TIMEOUT_S) / self.dt)):
                    timing.row = 0
                    if loop(1) or self.guidance_memory.distance >= 0.0:
                        break
                work.wind.w20, work.settings.navigation_sigma = saved_settings
                timing.tick = timing.row = 0
                work.air.energy = 0.0
                self.guidance_memory.piece = 0
                self._make_loop(autopilot_tick)
            else:
                # The simulated motion starts at the end of the launch, or at rest on the runway.
                self._set_unit_factors()
                commands = tuple(float(command) for command in self._workspace.commands)
                self._work.commands = release_aircraft(
                    self.fdm, self._release, (commands[0], commands[1], commands[2], commands[3])
                )
                self._work.air.wind_north, self._work.air.wind_east = self._release.wind[:2]
                self._make_loop(self._ground_tick)

    def _push(self, start_fraction: float = 0.0, end_fraction: float = 1.0) -> None:
        """Accelerate the aircraft along the rail from one fraction of the push time to another, each 0 to 1."""
        frames = math.ceil(self._rail.push_time * FRAME_HZ)
        for k in range(math.ceil(start_fraction * frames) + 1, math.ceil(end_fraction * frames) + 1):
            self._lockstep.step_on_rail(self._rail, k / FRAME_HZ)

    def save_log(self, target: Path) -> bool:
        """End the program cleanly and move its log to the file ``target``; return True if there was a log."""
        self._process.end(self._answer_frame)
        return self._process.save_log(target)

    @contextlib.contextmanager
    def _name_program_in_errors(self, error_class: type[FlightError] = FlightError) -> Iterator[None]:
        """Convert each FlightError in this context to an ``error_class`` that names the program's file."""
        try:
            yield
        except FlightError as error:
            is_named = str(error).startswith(str(self._binary))
            raise error_class.from_error(error, "" if is_named else self._binary) from error

    def _hold_on_rail_during(self, step: ConversationStep) -> None:
        """Hold the aircraft at rest on the rail during a step of the conversation with the program."""
        while True:
            for _ in range(POLL_INTERVAL_FRAMES):
                self._lockstep.step_on_rail(self._rail)
            try:
                next(step)
            except StopIteration:
                return

    def _poll_link(self) -> None:
        """Read the autopilot's messages, and store for the next tick whether the program flies its last leg."""
        self._link.poll()
        self._workspace.on_last_leg[0] = self._is_ending

    def _apply_gnss_error(self) -> None:
        """Set the error of the GNSS position while the aircraft stands on the rail."""
        settings, navigation = self._work.settings, self._work.navigation
        scale = settings.navigation_sigma * math.sqrt(2.0)
        east, north, up = (scale * navigation.second).tolist()
        self._lockstep.error = (north, east, up, 0.0, 0.0, 0.0)

    def _set_unit_factors(self) -> None:
        """Copy the factors between JSBSim's units and SI units into the workspace, for the compiled ticks.

        Each value of the state has one factor. Each output has two factors: for positive values, and for other values.
        """
        access = self.fdm.loop_access()
        self._work.state_factors = access.factors[0]
        self._work.scale_positive, self._work.scale_negative = (
            tuple(scales) for scales in zip(*access.scales, strict=True)
        )

    def _make_loop(self, tick: Tick) -> None:
        """Replace the loop by a loop that uses a compiled tick, flies over the terrain, and records the track."""
        bound_tick = partial(tick, self._workspace.block, self._ground.heights)
        tick_with_gnss_error = partial(self._tick, bound_tick, bool(self._work.settings.navigation_sigma))
        self._loop = self._lockstep.make_loop(
            tick_with_gnss_error, self._steps, gusts=self._windy, ground=self._ground.known
        )

    def _tick(self, tick: "partial[int]", has_gnss_error: bool) -> int:
        """Run one tick, and update the GNSS error (if any) of the next frames; return the end code or 0."""
        status = tick()
        if has_gnss_error:
            east, north, up, velocity_east, velocity_north, velocity_up = self._workspace.navigation_error()
            self._lockstep.error = (north, east, up, velocity_north, velocity_east, velocity_up)
        return status

    def _fly_ticks(self, count: int) -> int:
        """Fly up to ``count`` ticks; errors of the program name its file."""
        with self._name_program_in_errors(CrashError):
            return self._loop(count)

    def _answer_frame(self) -> bool:
        """Answer one more frame of a program that is about to end; return False if the program has ended."""
        try:
            self._lockstep.answer_frame()
        except FlightError:
            return False
        return True
