"""The exchange with an autopilot in lockstep: its servo outputs move the controls, and it is told what came of it."""

import math
import struct
from collections.abc import Callable

from flight.dynamics.fdm import Fdm, LoopAccess
from flight.dynamics.state import Commands
from flight.mission.items import Home
from flight.real_autopilot.json_physics import encode_motion, offset_on_sphere
from flight.real_autopilot.physics_port import PhysicsPort
from flight.real_autopilot.servo_map import ServoMap
from flight.real_autopilot.start_rail import RailEnd, motion_on_rail
from flight.simulation.workspace import READ_FIELDS, Workspace

# Of JSBSim and of the autopilot's simulated sensors: one frame is one step.
FRAME_HZ = 120.0
# Frames from one look at the link to the next: a tenth of a second.
LOOK_FRAMES = 12
_MOTION = (
    *("latitude", "longitude", "amsl", "velocity_north", "velocity_east", "velocity_down", "roll", "pitch", "yaw"),
    *("roll_rate", "pitch_rate", "yaw_rate", "airspeed"),
)
_NO_ERROR = (0.0,) * 6


class Lockstep:
    """One aircraft's exchange with an autopilot, frame by frame.

    home: what positions count from.
    look: called every `LOOK_FRAMES` frames.
    time: of the exchange, s.
    error: what its satellites mistake, m and m/s: north, east, up, and the same of the velocity.
    """

    def __init__(
        self,
        port: PhysicsPort,
        servos: ServoMap,
        fdm: Fdm,
        workspace: Workspace,
        home: Home,
        look: Callable[[], None],
    ) -> None:
        self._port, self._servos, self._fdm, self._workspace = port, servos, fdm, workspace
        self._home = (math.radians(home.lat_deg), math.radians(home.lon_deg), home.alt)
        self._look = look
        self._frame = 0
        self.error = _NO_ERROR
        access = fdm.loop_access()
        self._access: LoopAccess = access
        self._motion = [(access.getters[name], float(access.factors[name][0])) for name in _MOTION]

    @property
    def time(self) -> float:
        """Time of the exchange, s."""
        return self._frame / FRAME_HZ

    def hold(self, rail: RailEnd, pushed: float = 0.0) -> None:
        """One frame on the rail, ``pushed`` s after the push began."""
        self._workspace.commands[:] = self._take()
        motion = motion_on_rail(rail, self._next_time(), pushed, self._home)
        north, east, up, v_north, v_east, v_up = self.error
        self._port.answer(
            encode_motion(
                motion._replace(
                    north=motion.north + north,
                    east=motion.east + east,
                    down=motion.down - up,
                    velocity_north=motion.velocity_north + v_north,
                    velocity_east=motion.velocity_east + v_east,
                    velocity_down=motion.velocity_down - v_up,
                )
            )
        )

    def step(self) -> None:
        """One frame of flight on the controls that are set: JSBSim steps, and the autopilot is told."""
        self._access.run()
        lat, lon, amsl, vn, ve, vd, roll, pitch, yaw, p, q, r, airspeed = [
            get() * factor for get, factor in self._motion
        ]
        home_lat, home_lon, home_amsl = self._home
        north, east = offset_on_sphere(lat, lon, home_lat, home_lon)
        dn, de, du, dvn, dve, dvu = self.error
        self._port.answer(
            encode_motion(
                (
                    *(self._next_time(), p, q, r, *self._fdm.specific_force()),
                    *(north + dn, east + de, home_amsl - amsl - du),
                    *(roll, pitch, yaw, vn + dvn, ve + dve, vd - dvu, airspeed),
                )
            )
        )

    def make_loop(self, tick: Callable[[], int], steps: int, *, gusts: bool, ground: bool) -> Callable[[int], int]:
        """Make what flies up to a number of ticks and returns the last one's status, as `flight.simulation.loop` does.

        tick: `flight.real_autopilot.autopilot_tick.autopilot_tick` on the workspace.  steps: frames of a tick.
        gusts, ground: whether the tick's are set in JSBSim.
        """
        space, fdm, take, step = self._workspace, self._fdm, self._take, self.step
        read = [self._access.getters[field] for field in READ_FIELDS]
        pack: Callable[..., None] = struct.Struct(f"{len(READ_FIELDS)}d").pack_into
        pack_commands: Callable[..., None] = struct.Struct("4d").pack_into
        readings, asked, output = space.readings, space.commands, space.output.tolist
        *_, set_north, set_east, set_down, set_ground = self._access.setters

        def fly(count: int) -> int:
            for _ in range(count):
                commands = take()
                pack_commands(asked, 0, *commands)
                pack(readings, 0, *[getter() for getter in read])
                if status := tick():
                    return status
                *_, north, east, down, under = output()
                if gusts:
                    set_north(north)
                    set_east(east)
                    set_down(down)
                if ground:
                    set_ground(under)
                fdm.write(commands)
                step()
                for _ in range(steps - 1):
                    fdm.write(take())
                    step()
            return 0

        return fly

    def serve(self) -> None:
        """Answer one more frame, with the controls as the autopilot asks."""
        self._fdm.write(self._take())
        self.step()

    def _take(self) -> Commands:
        """Wait for the next frame: the controls that it asks for."""
        return self._servos.commands(self._port.receive().pulses)

    def _next_time(self) -> float:
        self._frame += 1
        if self._frame % LOOK_FRAMES == 0:
            self._look()
        return self._frame / FRAME_HZ
