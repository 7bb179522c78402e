"""The compiled loop's record of a flight, and what each tick does whoever steers.

A tick takes the state to SI and to the map, looks up the ground and makes the navigation's error (`begin_tick`); an
autopilot's law then fills the commands; the tick ends with the next wind, a row of the track and what to set in JSBSim
(`end_tick`).  Every autopilot has a compiled tick of its own, made of these two and its law.
"""

import math
from typing import Any

import numpy as np
from numba import literal_unroll
from numpy.typing import NDArray

from flight.dynamics.state import COMMANDS, STATE
from flight.guidance.equivalent_airspeed import true_by_equivalent
from flight.guidance.gains import GAINS, Gains
from flight.guidance.inner_loops import GUIDANCE_MEMORY
from flight.guidance.lateral_reference_laws import WAYPOINT
from flight.guidance.navigation_error import MOTION, NAVIGATION_LAGS, navigate
from flight.guidance.path import NODE, PIECE, FlyByPath, Records
from flight.mission.itinerary import UNLIMITED
from flight.simulation.track import AILERON, ELEVATOR, RUDDER, THROTTLE, TRACK_ROW
from flight.simulation.turbulence import GUST_FILTERS, step_gusts
from world.frames import POLYMAP, polymap
from world.geometry import wrap
from world.kernels import Record, compiled, field_names, inner, record_dtype
from world.terrain import Heights, pixel_height
from world.wind import mean_wind_speed

Floats = NDArray[np.float64]


# ----------------------------------------------------------------------
# All that the compiled tick works on: one record, and one table of the path.
#
# Each array that is passed to compiled code costs as much as a hundred sums.


# What is read of JSBSim each tick: the state but for time and wind, which are known without asking.
READ_FIELDS = field_names(STATE)[: field_names(STATE).index("time")]
# Ticks that are flown at a time, at most.
BLOCK_TICKS = 60
# Mean wind and gust, true north, east and down; ground below; battery.
AIR = record_dtype(
    "wind_north",  # m/s, the way the air moves
    "wind_east",
    "gust_north",
    "gust_east",
    "gust_down",
    "ground",  # m, the last that was known
    "energy",  # Wh used
)
# What a tick finds where the aircraft is.
PLACE = record_dtype(
    "north_cos",  # of the map course of true north
    "north_sin",
    "ground",  # m AMSL, NaN where it is unknown
    "clearance",  # m above it
)
MEAN_WIND = record_dtype(
    "speed",  # m/s at the reference height
    "cos",  # of the map course that it blows to
    "sin",
    "gradient",  # 1/s
    "reference_amsl",  # m
    "w20",  # m/s, turbulence's wind at 20 ft
)
TIMING = record_dtype(
    ("tick", np.int64),  # ticks flown
    ("row", np.int64),  # row of the block that is filled next
    "dt",  # s
)
SETTINGS = record_dtype(
    "slowest",  # m/s, slower is a departure
    "battery",  # Wh; a flight that has used as much ends
    "navigation_sigma",  # m
    "navigation_time",  # s
    "middle",  # rad, longitude of the local map's middle
    ("pieces", np.int64),  # rows of the path's table that have one
    ("nodes", np.int64),
    ("waypoints", np.int64),
    ("on_last_leg", np.bool_),  # of a flight that another program steers, by its own account
)
# The i-th piece, node and waypoint of a path beside each other.
PATH_ROW = record_dtype(("piece", PIECE), ("node", NODE), ("waypoint", WAYPOINT))
# What is set in JSBSim after a tick.
OUTPUT = record_dtype(*field_names(COMMANDS), "gust_north", "gust_east", "gust_down", "ground")
# Unit normals of a tick.
NOISE = record_dtype(("turbulence", np.float64, (3,)), ("navigation", np.float64, (3,)))
WORKSPACE = record_dtype(
    ("state", STATE),
    ("state_factors", STATE),  # take what JSBSim gives to SI
    ("true", MOTION),
    ("estimated", MOTION),
    ("commands", COMMANDS),
    ("air", AIR),
    ("place", PLACE),
    ("wind", MEAN_WIND),
    ("gusts", GUST_FILTERS),
    ("navigation", NAVIGATION_LAGS),
    ("memory", GUIDANCE_MEMORY),
    ("gains", GAINS),
    ("timing", TIMING),
    ("settings", SETTINGS),
    ("position_map", POLYMAP),  # latitude and longitude to east and north
    ("north_map", POLYMAP),  # latitude and longitude to the map course of true north
    ("pixel_map", POLYMAP),  # east and north to column and row of the terrain
    ("output", OUTPUT),  # in JSBSim's units
    ("scale_above", OUTPUT),  # take an SI value above zero to JSBSim's
    ("scale_below", OUTPUT),  # and one that is not
    ("noise", NOISE, (BLOCK_TICKS,)),
    ("rows", TRACK_ROW, (BLOCK_TICKS,)),
)
# As many float64 as it takes the place of.
WORKSPACE_NUMBERS = WORKSPACE.itemsize // 8


class Workspace:
    """One flight's record and path, in one block of memory, and plain views of what passes to and from JSBSim.

    Numba looks at the type of each argument of a call, at a record's for twice as long as at an array's of numbers: so
    all of it comes to compiled code as one block.

    block: (n,) numbers: the workspace's, those that the autopilot's law keeps, and the path's.
    array: (1,) of `WORKSPACE`, for compiled code.
    record: its one record, for Python.
    own: the record that the law keeps, None for none.
    path: of `PATH_ROW`, as many as there are pieces, nodes or waypoints.
    readings: (n,) the state's `READ_FIELDS`.
    output: (n,) the fields of `OUTPUT`.
    commands: (4,) the fields of `flight.dynamics.state.COMMANDS`.
    on_last_leg: (1,) of the workspace's settings.
    ticks_flown, rows_filled: (1,) of the workspace's timing.
    turbulence, navigation: (BLOCK_TICKS, 3) the noise of each.
    rows: (BLOCK_TICKS,) of the track.
    """

    def __init__(
        self, gains: Gains, path: FlyByPath, waypoints: Records, own: np.dtype[np.record] | None = None
    ) -> None:
        parts = {"piece": path.pieces, "node": path.nodes, "waypoint": waypoints}
        rows_of_path = max(map(len, parts.values()))
        path_begins = WORKSPACE_NUMBERS + (0 if own is None else own.itemsize // 8)
        self.block: Floats = np.zeros(path_begins + rows_of_path * PATH_ROW.itemsize // 8)
        self.array: Records = self.block[:WORKSPACE_NUMBERS].view(WORKSPACE)
        self.path: Records = self.block[path_begins:].view(PATH_ROW)
        self.own: Record = None if own is None else self.block[WORKSPACE_NUMBERS:path_begins].view(own)[0]
        self.record: Record = self.array[0]
        self.record.gains = gains.record()
        for name, rows in parts.items():
            self.path[name][: len(rows)] = rows
            setattr(self.record.settings, f"{name}s", len(rows))
        self.readings = self._numbers("state", len(READ_FIELDS))
        self.output = self._numbers("output", len(field_names(OUTPUT)))
        self.commands = self._numbers("commands", len(field_names(COMMANDS)))
        self._true, self._estimated = (self._numbers(name, len(field_names(MOTION))) for name in ("true", "estimated"))
        # Made once: numpy takes microseconds for each field of a record that Python asks for.
        self.ticks_flown: NDArray[np.int64] = self.array["timing"]["tick"]
        self.rows_filled: NDArray[np.int64] = self.array["timing"]["row"]
        self.on_last_leg: NDArray[np.bool_] = self.array["settings"]["on_last_leg"]
        self.turbulence: Floats = self.array["noise"]["turbulence"][0]
        self.navigation: Floats = self.array["noise"]["navigation"][0]
        self.rows: Records = self.array["rows"][0]

    def navigation_error(self) -> list[float]:
        """The estimated motion less the true one: the fields of `flight.guidance.navigation_error.MOTION`."""
        error: list[float] = (self._estimated - self._true).tolist()
        return error

    def _numbers(self, field: str, count: int) -> Floats:
        """The first numbers of a field, as an array that shares its memory."""
        fields: Any = WORKSPACE.fields
        return np.frombuffer(self.array, np.float64, count, fields[field][1])


STEEPEST_BANK = math.radians(75.0)
# What a tick returns, and how the flight ended by then.
COMPLETED, NOT_A_NUMBER, GROUND, BANKED, STALLED, MISSED, EMPTY = 1, 2, 3, 4, 5, 6, 7
NO_MOTOR, TIPPED = 8, 9
# A flight that passes the end of its route further than this from it, m, has missed it.
FAR = 100.0
# A return to launch has come to its circle within this distance of the middle, m, or `WIDER` of its radii, and to its
# height, m.  A circle of 60 m cannot be flown at 26 m/s and 30 degrees of bank: ArduPlane gets up to 260 m from its
# middle.
NEAR, WIDER, AT_HEIGHT = 300.0, 1.3, 20.0
# However its circles are flown, it is over after so many times the time that it is to circle, and that once around
# takes, at this ground speed, m/s.
MAX_CIRCLES, _SLOW = 5.0, 10.0
# A mission that ends in a circle about its last waypoint is flown until the course has turned by this, rad: a quarter
# of a turn onto the circle, and once around.
AROUND_END = 2.5 * math.pi
ENDS = {
    COMPLETED: "completed",
    NOT_A_NUMBER: "loss of control: the state is not a number",
    GROUND: "ground contact",
    BANKED: "loss of control: bank beyond 75 degrees",
    STALLED: "loss of control: airspeed below the stall",
    MISSED: "missed: passed the end of the route more than 100 m from it",
    EMPTY: "nothing is left in the battery or the tank",
    NO_MOTOR: "not launched: the motor never started",
    TIPPED: "ground contact: not on its belly or wheels",
}
_STATE, _OUTPUT = field_names(STATE), field_names(OUTPUT)


@inner
def begin_tick(work: Record, heights: Heights) -> bool:  # pragma: no cover - compiled
    """Take the state as JSBSim gave it, in its units, and estimate the motion; False where the state is no number.

    work: a record of `WORKSPACE`.  heights: of the terrain.
    """
    settings, timing = work.settings, work.timing
    if not _sense(work, heights):
        return False
    navigate(
        work.true, work.estimated, work.navigation, work.noise[timing.row].navigation,
        settings.navigation_sigma, settings.navigation_time, timing.dt,
    )  # fmt: skip
    return True


@inner
def _sense(work: Record, heights: Heights) -> bool:  # pragma: no cover - compiled
    """Take the state to SI and to the map, and look up the ground; False where the state is no number.

    Fills the state, the true motion and the place, of a record of `flight.simulation.tick.WORKSPACE`.
    """
    state, true, air, settings, place = work.state, work.true, work.air, work.settings, work.place
    if not _to_si(state, work.state_factors):
        return False
    state.wind_north, state.wind_east = air.wind_north + air.gust_north, air.wind_east + air.gust_east
    state.wind_down = air.gust_down
    # About the local map's middle, so that a flight may cross the 180th meridian.
    state.longitude = settings.middle + wrap(state.longitude - settings.middle)
    # Map course of true north.
    north, _ = polymap(work.north_map, state.latitude, state.longitude)
    cos, sin = math.cos(north), math.sin(north)
    state.yaw = wrap(state.yaw + north)
    true.east, true.north = polymap(work.position_map, state.latitude, state.longitude)
    true.up = state.amsl
    true.velocity_east = state.velocity_east * cos + state.velocity_north * sin
    true.velocity_north = state.velocity_north * cos - state.velocity_east * sin
    true.velocity_up = -state.velocity_down
    column, row = polymap(work.pixel_map, true.east, true.north)
    place.north_cos, place.north_sin = cos, sin
    place.ground = pixel_height(heights, column, row)
    place.clearance = true.up - place.ground
    return True


@inner
def end_tick(work: Record) -> int:  # pragma: no cover - compiled
    """Make the next wind, fill a row of the track, count the tick, and state what to set in JSBSim, in its units.

    Returns a key of `ENDS`, or 0 to fly on.
    """
    fill_tick(work)
    return status_in_air(work)


@inner
def status_in_air(work: Record) -> int:  # pragma: no cover - compiled
    """How a flight in the air ends by now: a key of `ENDS`, or 0 to fly on."""
    settings, air = work.settings, work.air
    return _status(work.state, work.memory, work.place.clearance, settings.slowest, air.energy >= settings.battery)


@inner
def fill_tick(work: Record) -> None:  # pragma: no cover - compiled
    """Make the next wind, fill a row of the track, count the tick, and state what to set in JSBSim, in its units."""
    state, true, air, timing, place = work.state, work.true, work.air, work.timing, work.place
    cos, sin = place.north_cos, place.north_sin
    row = work.rows[timing.row]
    turbulence = work.noise[timing.row].turbulence
    _blow(state, work.wind, work.gusts, turbulence, place.clearance, true.up, cos, sin, air, timing.dt)
    air.ground = place.ground if not math.isnan(place.ground) else air.ground
    air.energy += state.power * timing.dt / 3600.0
    _fill(row, state, true, work.commands, work.memory, timing.tick * timing.dt, air.energy, place.clearance)
    _fill_wind(row, state, cos, sin)
    timing.tick += 1
    timing.row += 1
    _output(work.output, work.commands, air, work.scale_above, work.scale_below)


@inner
def end_return(motion: Record, b: Record, memory: Record, dt: float) -> None:  # pragma: no cover - compiled
    """Note how long a return to launch has circled at its end; it ends the flight as an end of the path does.

    For an autopilot that returns by a law of its own, and need not follow the path: it ends where the path does once it
    has come to its circle and was all around it at its height, and after `longest_circling` at the latest.

    motion: a record of `flight.guidance.navigation_error.MOTION`.
    b: any waypoint of the way back, a record of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    memory: of `flight.guidance.inner_loops.GUIDANCE_MEMORY`.
    """
    memory.returning = True
    off_e, off_n = motion.east - b.centre_east, motion.north - b.centre_north
    factor = true_by_equivalent(motion.up)
    radius = abs(b.circle) * factor * factor
    there = math.hypot(off_e, off_n) < max(NEAR, WIDER * radius)
    bearing = math.atan2(off_e, off_n)
    if memory.circled > 0.0:
        memory.turned += wrap(bearing - memory.bearing)
    memory.bearing = bearing
    if memory.circled > 0.0 or (there and abs(motion.up - b.up) < AT_HEIGHT):
        memory.circled += dt
    around = abs(memory.turned) >= 2.0 * math.pi
    memory.done = (memory.done and around and memory.circled > UNLIMITED) or memory.circled > longest_circling(radius)


@inner
def end_around(motion: Record, memory: Record, dt: float) -> None:  # pragma: no cover - compiled
    """Note how far the course has turned since a mission's last waypoint was reached; past `AROUND_END` it ends.

    By the course, and not by the bearing from the waypoint: where the circle is narrower than the aircraft can turn,
    it flies loops beside the waypoint, and its bearing may go around in one of them or not until the third.

    motion: a record of `flight.guidance.navigation_error.MOTION`.
    memory: of `flight.guidance.inner_loops.GUIDANCE_MEMORY`.
    """
    # However wide it circles, it has not missed the mission's end.
    memory.returning = True
    course = math.atan2(motion.velocity_east, motion.velocity_north)
    if memory.circled > 0.0:
        memory.turned += wrap(course - memory.bearing)
    memory.circled += dt
    memory.bearing = course
    memory.done = abs(memory.turned) >= AROUND_END


@compiled
def longest_circling(radius: float) -> float:  # pragma: no cover - compiled
    """After how long in its circle (m) a return is over, however that was flown, s."""
    longest: float = MAX_CIRCLES * max(UNLIMITED, 2.0 * math.pi * abs(radius) / _SLOW)
    return longest


@inner
def _to_si(state: Record, factors: Record) -> bool:  # pragma: no cover - compiled
    """Take the state to SI; False where it has a NaN or an infinity."""
    total = 0.0
    for name in literal_unroll(_STATE):
        value = state[name] * factors[name]
        state[name] = value
        total += value * 0.0
    return total == 0.0


@inner
def _status(
    state: Record, memory: Record, clearance: float, slowest: float, empty: bool
) -> int:  # pragma: no cover - compiled
    if clearance <= 0.0:
        return GROUND
    if abs(state.roll) > STEEPEST_BANK:
        return BANKED
    if state.airspeed < slowest:
        return STALLED
    if memory.done:
        near = memory.returning or (abs(memory.cross_track) <= FAR and abs(memory.height_error) <= FAR)
        return COMPLETED if near else MISSED
    return EMPTY if empty else 0


@inner
def _output(
    output: Record, commands: Record, air: Record, above: Record, below: Record
) -> None:  # pragma: no cover - compiled
    """What to set in JSBSim, in its units."""
    output.elevator, output.aileron = commands.elevator, commands.aileron
    output.rudder, output.throttle = commands.rudder, commands.throttle
    # All that blows is set as a gust: three properties a tick, not six.
    output.gust_north, output.gust_east = air.wind_north + air.gust_north, air.wind_east + air.gust_east
    output.gust_down, output.ground = air.gust_down, air.ground
    for name in literal_unroll(_OUTPUT):
        output[name] *= above[name] if output[name] > 0.0 else below[name]


@inner
def _blow(
    state: Record, wind: Record, gusts: Record, noise: Floats, clearance: float, up: float, turn_cos: float,
    turn_sin: float, air: Record, dt: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Mean wind at this height and the next gust, true north, east and down, into ``air``."""
    speed = mean_wind_speed(wind.speed, wind.gradient, wind.reference_amsl, up)
    # The angle less the map course of true north.
    cos = wind.cos * turn_cos + wind.sin * turn_sin
    sin = wind.sin * turn_cos - wind.cos * turn_sin
    air.wind_north, air.wind_east = speed * cos, speed * sin
    if wind.w20 > 0.0:
        # Over unknown ground the scales of 300 m and above hold.
        height = clearance if not math.isnan(clearance) else 1000.0
        along, across, down = step_gusts(gusts, noise, wind.w20, height, state.airspeed, dt)
        air.gust_north = along * cos - across * sin
        air.gust_east = along * sin + across * cos
        air.gust_down = down


@inner
def _fill(
    row: Record, state: Record, true: Record, commands: Record, memory: Record, time: float,
    energy: float, clearance: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """One row of the track, a record of `flight.simulation.track.TRACK_ROW`, but for the wind."""
    row.time = time
    # Element by element: assigning a whole array checks shapes.
    position, velocity, attitude, rates = row.position, row.velocity, row.attitude, row.rates
    position[0], position[1], position[2] = true.east, true.north, true.up
    velocity[0], velocity[1], velocity[2] = true.velocity_east, true.velocity_north, true.velocity_up
    attitude[0], attitude[1], attitude[2] = state.roll, state.pitch, state.yaw
    rates[0], rates[1], rates[2] = state.roll_rate, state.pitch_rate, state.yaw_rate
    row.airspeed = state.airspeed
    flow, controls, commanded = row.flow, row.controls, row.commands
    flow[0], flow[1] = state.alpha, state.beta
    controls[ELEVATOR], controls[AILERON], controls[RUDDER] = state.elevator, state.aileron, state.rudder
    controls[THROTTLE] = state.throttle
    commanded[ELEVATOR], commanded[AILERON], commanded[RUDDER] = commands.elevator, commands.aileron, commands.rudder
    commanded[THROTTLE] = commands.throttle
    row.load_factor = state.load_factor
    row.current = state.current
    row.energy = energy
    row.leg = memory.leg
    row.cross_track = memory.cross_track
    row.height_error = memory.height_error
    row.speed_command = memory.speed_command
    row.clearance = clearance


@inner
def _fill_wind(row: Record, state: Record, cos: float, sin: float) -> None:  # pragma: no cover - compiled
    """The row's wind in map axes.  cos, sin: of the map course of true north."""
    wind = row.wind
    wind[0] = state.wind_east * cos + state.wind_north * sin
    wind[1] = state.wind_north * cos - state.wind_east * sin
    wind[2] = -state.wind_down
