"""Define a flight's record for the compiled loop, and the parts of a tick that all autopilots share.

A tick converts the state to SI units and to the map, looks up the ground and adds the navigation error (`begin_tick`);
then an autopilot's control law fills in the commands; the tick ends with the next wind, a row of the track and the
outputs to JSBSim (`end_tick`), and in the air `airborne_end_code` decides when the flight ends. Every autopilot has a
compiled tick of its own, which consists of these parts and its control law, and a compiled loop of such ticks, which
reads the state (`read_state`) and steps the compiled model (`advance_model`).
"""

import math
from typing import Any

import numpy as np
from numba import literal_unroll
from numpy.typing import NDArray

from flight.dynamics.compiled_frame import CODE_END, READS_START, STEPS, WRITES_START, step
from flight.dynamics.instructions import Code
from flight.dynamics.state import COMMANDS, STATE
from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.guidance.gains import GAINS, Gains
from flight.guidance.inner_loops import GUIDANCE_MEMORY
from flight.guidance.lateral_reference_laws import WAYPOINT
from flight.guidance.navigation_error import MOTION, NAVIGATION_LAGS, estimate_motion
from flight.guidance.path import NODE, PIECE, FlyByPath
from flight.mission.itinerary import ENDLESS_LOITER_TIME_S
from flight.simulation.track import AILERON, ELEVATOR, RUDDER, THROTTLE, TRACK_ROW
from flight.simulation.turbulence import GUST_FILTERS, step_gusts
from world.arrays import Floats, Heights
from world.forecast.wind_field import WindField, interpolate_field
from world.frames import POLYMAP, polymap
from world.geometry import wrap
from world.kernels import Record, Records, compiled, field_names, inner, record_dtype
from world.terrain import pixel_height
from world.wind import mean_wind_speed

# ----------------------------------------------------------------------
# Data of the compiled tick: one record, and one table with the path.
#
# Each array passed to compiled code costs as much as a hundred additions.


# Fields of the state that are read from JSBSim each tick; time and wind are already known.
READ_FIELDS = field_names(STATE)[: field_names(STATE).index("time")]
# Maximum number of ticks per call of compiled code.
BLOCK_TICKS = 600
# Mean wind and gust, true north, east and down; ground altitude below; battery energy.
AIR = record_dtype(
    "wind_north",  # m/s, direction of air motion
    "wind_east",
    "gust_north",
    "gust_east",
    "gust_down",
    "ground",  # m AMSL, the last known value
    "energy",  # Wh used
)
# Map and ground data at the aircraft's position.
PLACE = record_dtype(
    "north_cos",  # of the grid convergence, the map course of true north
    "north_sin",
    "ground",  # m AMSL, NaN where it is unknown
    "clearance",  # m above that ground
)
# Mean wind and turbulence of the scenario.
MEAN_WIND = record_dtype(
    "speed",  # m/s at the reference height
    "cos",  # of the map course that the wind blows to
    "sin",
    "gradient",  # 1/s
    "reference_amsl",  # m
    "w20",  # m/s, turbulence's wind at 20 ft
    "start_time",  # s, time of the first tick on the field's axis of time
)
# Time and rows of the flight.
TIMING = record_dtype(
    ("tick", np.int64),  # number of ticks flown
    ("row", np.int64),  # index of the next row of the block
    "dt",  # s
)
# Constants of the flight.
SETTINGS = record_dtype(
    "min_airspeed",  # m/s, airspeed below which control is lost
    "battery",  # Wh; the flight ends once it has used this energy
    "navigation_sigma",  # m
    "navigation_time",  # s
    "center_longitude",  # rad, longitude of the local map's center
    ("pieces", np.int64),  # number of path table rows that hold a piece
    ("nodes", np.int64),
    ("waypoints", np.int64),
    ("field", np.int64),  # index in the block of the packed wind field; 0 for a wind without a field
    ("on_last_leg", np.bool_),  # for a flight by an external program, as the program reports
)
# The i-th piece, node and waypoint of a path in one row.
PATH_ROW = record_dtype(("piece", PIECE), ("node", NODE), ("waypoint", WAYPOINT))
# Values to set in JSBSim after a tick.
OUTPUT = record_dtype(*field_names(COMMANDS), "gust_north", "gust_east", "gust_down", "ground")
# Unit normal random numbers of a tick.
NOISE = record_dtype(("turbulence", np.float64, (3,)), ("navigation", np.float64, (3,)))
# All data of a tick except the path.
WORKSPACE = record_dtype(
    ("state", STATE),
    ("state_factors", STATE),  # factors from JSBSim's units to SI
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
    ("position_map", POLYMAP),  # from latitude and longitude to east and north
    ("north_map", POLYMAP),  # from latitude and longitude to the map course of true north
    ("pixel_map", POLYMAP),  # from east and north to column and row of the terrain
    ("output", OUTPUT),  # in JSBSim's units
    ("scale_positive", OUTPUT),  # factors from SI to JSBSim's units for values above zero
    ("scale_negative", OUTPUT),  # factors from SI to JSBSim's units for other values
    ("noise", NOISE, (BLOCK_TICKS,)),
    ("rows", TRACK_ROW, (BLOCK_TICKS,)),
)
# Size of the workspace in float64 numbers.
WORKSPACE_NUMBERS = WORKSPACE.itemsize // 8


class Workspace:
    """Record and path of one flight in one block of memory.

    It has views of the data that JSBSim reads and writes.

    Numba checks the type of each argument of a call, and takes twice as long for a record as for an array of numbers.
    Therefore all data is passed to compiled code as one block.

    block: (n,) numbers of the workspace, of the control law's own record, of the path, and of the wind field.
    array: (1,) of `WORKSPACE`, for compiled code.
    record: its one record, for Python.
    law_record: the control law's own record, or None.
    path: records of `PATH_ROW`; their number is the largest of the numbers of pieces, nodes and waypoints.
    readings: (n,) the state's `READ_FIELDS`.
    output: (n,) the fields of `OUTPUT`.
    commands: (4,) the fields of `flight.dynamics.state.COMMANDS`.
    on_last_leg: (1,) of the workspace's settings.
    ticks_flown, rows_filled: (1,) of the workspace's timing.
    turbulence, navigation: random numbers for the turbulence and for the navigation error, (BLOCK_TICKS, 3) each.
    rows: (BLOCK_TICKS,) rows of the track.
    """

    def __init__(
        self,
        gains: Gains,
        path: FlyByPath,
        waypoints: Records,
        law_dtype: np.dtype[np.record] | None = None,
        field: WindField | None = None,
    ) -> None:
        """Lay out the block: workspace record, control law's record, path table, and packed wind field.

        waypoints: records of `flight.guidance.lateral_reference_laws.WAYPOINT`.
        law_dtype: type of the control law's record; None for no such record.
        field: wind field of a forecast; None without a forecast.
        """
        path_tables = {"piece": path.pieces, "node": path.nodes, "waypoint": waypoints}
        path_row_count = max(map(len, path_tables.values()))
        path_offset = WORKSPACE_NUMBERS + (0 if law_dtype is None else law_dtype.itemsize // 8)
        packed_field = np.empty(0) if field is None else field.packed()
        # The path's records are a view of the rest of the block, so the field takes a whole number of them.
        numbers_per_row = PATH_ROW.itemsize // 8
        field_offset = path_offset + path_row_count * numbers_per_row
        self.block: Floats = np.zeros(field_offset + math.ceil(packed_field.size / numbers_per_row) * numbers_per_row)
        self.block[field_offset : field_offset + packed_field.size] = packed_field
        self.array: Records = self.block[:WORKSPACE_NUMBERS].view(WORKSPACE)
        self.path: Records = self.block[path_offset:field_offset].view(PATH_ROW)
        law_numbers = self.block[WORKSPACE_NUMBERS:path_offset]
        self.law_record: Record = None if law_dtype is None else law_numbers.view(law_dtype)[0]
        self.record: Record = self.array[0]
        self.record.gains = gains.record()
        self.record.settings.field = 0 if field is None else field_offset
        for name, rows in path_tables.items():
            self.path[name][: len(rows)] = rows
            setattr(self.record.settings, f"{name}s", len(rows))
        self.readings = self._field_numbers("state", len(READ_FIELDS))
        self.output = self._field_numbers("output", len(field_names(OUTPUT)))
        self.commands = self._field_numbers("commands", len(field_names(COMMANDS)))
        self._true, self._estimated = (
            self._field_numbers(name, len(field_names(MOTION))) for name in ("true", "estimated")
        )
        # Created once, because numpy takes microseconds for each access to a record's field from Python.
        self.ticks_flown: NDArray[np.int64] = self.array["timing"]["tick"]
        self.rows_filled: NDArray[np.int64] = self.array["timing"]["row"]
        self.on_last_leg: NDArray[np.bool_] = self.array["settings"]["on_last_leg"]
        self.turbulence: Floats = self.array["noise"]["turbulence"][0]
        self.navigation: Floats = self.array["noise"]["navigation"][0]
        self.rows: Records = self.array["rows"][0]

    def navigation_error(self) -> list[float]:
        """Return the estimated minus the true motion, in `flight.guidance.navigation_error.MOTION` order."""
        return (self._estimated - self._true).tolist()

    def _field_numbers(self, field: str, count: int) -> Floats:
        """Return the first ``count`` numbers of a record's field, as an array that shares its memory."""
        fields: Any = WORKSPACE.fields
        return np.frombuffer(self.array, np.float64, count, fields[field][1])


# Bank beyond which control is lost, rad.
LOSS_OF_CONTROL_BANK_RAD = math.radians(75.0)
# Return values of a tick that ends the flight: the end of the route was reached.
COMPLETED = 1
# The state is not a number.
NOT_A_NUMBER = 2
# The aircraft touched the ground.
GROUND = 3
# The bank exceeded `LOSS_OF_CONTROL_BANK_RAD`.
END_OVERBANK = 4
# The airspeed fell below the stall.
STALLED = 5
# The end of the route was passed at more than `MISSED_ROUTE_DISTANCE_M` from it.
END_MISSED_ROUTE = 6
# The battery or the tank is empty.
END_BATTERY_EMPTY = 7
# The motor never started.
NO_MOTOR = 8
# The aircraft touched the ground with something other than belly or wheels.
END_TIPPED_OVER = 9
# Lateral or vertical distance from the end of the route beyond which a flight that passes the end has missed it, m.
MISSED_ROUTE_DISTANCE_M = 100.0
# Distance from the center at which an RTL has arrived at its loiter, m. A loiter of 60 m cannot be flown at 26 m/s and
# 30 degrees of bank: ArduPlane flies up to 260 m from its center.
RTL_ARRIVAL_RADIUS_M = 300.0
# The same distance as a multiple of the loiter radius; the larger one applies.
RTL_ARRIVAL_LOITER_RADII = 1.3
# Altitude tolerance of this arrival, m.
RTL_ARRIVAL_ALTITUDE_TOLERANCE_M = 20.0
# Abort the RTL loiter after this multiple of its nominal duration, which is at least one full circle.
LOITER_TIMEOUT_FACTOR = 5.0
# Ground speed assumed for that circle, m/s.
_CIRCLING_SPEED_MPS = 10.0
# Course change after which a loiter about a mission's last waypoint ends, rad: a quarter turn onto the loiter, and one
# full circle.
END_LOITER_ANGLE_RAD = 2.5 * math.pi
# Texts for the ends of a flight.
ENDS = {
    COMPLETED: "completed",
    NOT_A_NUMBER: "loss of control: the state is not a number",
    GROUND: "ground contact",
    END_OVERBANK: "loss of control: bank beyond 75 degrees",
    STALLED: "loss of control: airspeed below the stall",
    END_MISSED_ROUTE: "missed: passed the end of the route more than 100 m to one side of it, above it or below it",
    END_BATTERY_EMPTY: "nothing is left in the battery or the tank",
    NO_MOTOR: "not launched: the motor never started",
    END_TIPPED_OVER: "ground contact: not on its belly or wheels",
}
# Names of the fields of `STATE`.
_STATE_FIELDS = field_names(STATE)
# Names of the fields of `OUTPUT`.
_OUTPUT_FIELDS = field_names(OUTPUT)


@inner
def begin_tick(workspace: Record, heights: Heights) -> bool:
    """Convert the state to SI units and map axes, look up the ground, and estimate the motion.

    Return False if a value of the state is not finite.

    workspace: a record of `WORKSPACE`; its fields ``state``, ``true``, ``place`` and ``estimated`` are set.
    heights: altitudes of the terrain, m, (rows, columns).
    """
    state = workspace.state
    true = workspace.true
    air = workspace.air
    settings = workspace.settings
    place = workspace.place
    timing = workspace.timing
    if not _to_si(state, workspace.state_factors):
        return False
    state.wind_north, state.wind_east = air.wind_north + air.gust_north, air.wind_east + air.gust_east
    state.wind_down = air.gust_down
    # Relative to the local map's center, so that a flight may cross the 180th meridian.
    state.longitude = settings.center_longitude + wrap(state.longitude - settings.center_longitude)
    # Map course of true north.
    north_course, _ = polymap(workspace.north_map, state.latitude, state.longitude)
    cos, sin = math.cos(north_course), math.sin(north_course)
    state.yaw = wrap(state.yaw + north_course)
    true.east, true.north = polymap(workspace.position_map, state.latitude, state.longitude)
    true.up = state.amsl
    true.velocity_east = state.velocity_east * cos + state.velocity_north * sin
    true.velocity_north = state.velocity_north * cos - state.velocity_east * sin
    true.velocity_up = -state.velocity_down
    column, row = polymap(workspace.pixel_map, true.east, true.north)
    place.north_cos, place.north_sin = cos, sin
    place.ground = pixel_height(heights, column, row)
    place.clearance = true.up - place.ground
    estimate_motion(
        true,
        workspace.estimated,
        workspace.navigation,
        workspace.noise[timing.row].navigation,
        settings.navigation_sigma,
        settings.navigation_time,
        timing.dt,
    )
    return True


@inner
def end_tick(workspace: Record, block: Floats) -> None:
    """Advance the wind, fill a row of the track, count the tick, and set the outputs in JSBSim's units.

    block: block of the `Workspace`, which contains the wind field.
    """
    state = workspace.state
    true = workspace.true
    air = workspace.air
    timing = workspace.timing
    place = workspace.place
    cos, sin = place.north_cos, place.north_sin
    turbulence = workspace.noise[timing.row].turbulence
    wind, gusts, height = workspace.wind, workspace.gusts, place.clearance
    if workspace.settings.field > 0:
        # A forecast's wind is the mean wind plus the deviation that its field states, both along true north.
        east, north, altitude = interpolate_field(
            block[workspace.settings.field :],
            wind.start_time + timing.tick * timing.dt,
            math.degrees(state.latitude),
            math.degrees(state.longitude),
            true.up,
        )
        _update_wind(state, wind, gusts, turbulence, height, altitude, 1.0, 0.0, air, timing.dt)
        air.wind_north += north
        air.wind_east += east
    else:
        _update_wind(state, wind, gusts, turbulence, height, true.up, cos, sin, air, timing.dt)
    air.ground = place.ground if not math.isnan(place.ground) else air.ground
    air.energy += state.power * timing.dt / 3600.0
    _fill_row(workspace.rows[timing.row], workspace)
    timing.tick += 1
    timing.row += 1
    _set_output(workspace.output, workspace.commands, air, workspace.scale_positive, workspace.scale_negative)


@inner
def airborne_end_code(workspace: Record) -> int:
    """Return the code of the first condition that ends an airborne flight; 0 if it continues.

    The codes are the keys of `ENDS`.

    The conditions are, in this order, ground contact, bank, stall, end of the route, and empty battery.
    """
    state, memory = workspace.state, workspace.memory
    # The clearance is NaN over unknown ground.
    if workspace.place.clearance <= 0.0:
        return GROUND
    if abs(state.roll) > LOSS_OF_CONTROL_BANK_RAD:
        return END_OVERBANK
    if state.airspeed < workspace.settings.min_airspeed:
        return STALLED
    if memory.is_finished:
        is_near = memory.is_in_rtl or (
            abs(memory.cross_track) <= MISSED_ROUTE_DISTANCE_M and abs(memory.height_error) <= MISSED_ROUTE_DISTANCE_M
        )
        return COMPLETED if is_near else END_MISSED_ROUTE
    return END_BATTERY_EMPTY if workspace.air.energy >= workspace.settings.battery else 0


@inner
def update_rtl_loiter(motion: Record, waypoint: Record, memory: Record, dt: float) -> None:
    """Update the progress of an RTL around its loiter, and end the flight once the loiter is complete.

    This is for autopilots that fly an RTL by their own control law or program. They do not follow a line, so the
    cross-track error is NaN. The loiter is complete after a full circle and
    `flight.mission.itinerary.ENDLESS_LOITER_TIME_S`. Both are counted from the moment at which the aircraft has reached
    the loiter and its altitude. The loiter also ends after `rtl_loiter_timeout`.

    motion: a record of `flight.guidance.navigation_error.MOTION`.
    waypoint: any waypoint of the RTL, a record of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    memory: a record of `flight.guidance.inner_loops.GUIDANCE_MEMORY`.
    """
    memory.is_in_rtl, memory.cross_track = True, math.nan
    offset_east, offset_north = motion.east - waypoint.centre_east, motion.north - waypoint.centre_north
    airspeed_factor = eas_to_tas_ratio(motion.up)
    radius = abs(waypoint.loiter_radius) * airspeed_factor * airspeed_factor
    is_near = math.hypot(offset_east, offset_north) < max(RTL_ARRIVAL_RADIUS_M, RTL_ARRIVAL_LOITER_RADII * radius)
    bearing = math.atan2(offset_east, offset_north)
    if memory.loiter_time > 0.0:
        memory.loiter_angle += wrap(bearing - memory.bearing)
    memory.bearing = bearing
    if memory.loiter_time > 0.0 or (is_near and abs(motion.up - waypoint.up) < RTL_ARRIVAL_ALTITUDE_TOLERANCE_M):
        memory.loiter_time += dt
    is_full_circle = abs(memory.loiter_angle) >= 2.0 * math.pi
    memory.is_finished = (
        is_full_circle and memory.loiter_time > ENDLESS_LOITER_TIME_S
    ) or memory.loiter_time > rtl_loiter_timeout(radius)


@inner
def update_end_loiter(motion: Record, memory: Record, dt: float) -> None:
    """Update the course change in the loiter at a mission's end.

    The flight ends at `END_LOITER_ANGLE_RAD`.

    The course is used instead of the bearing from the waypoint. An aircraft that cannot fly the loiter's radius flies
    loops next to the waypoint, and the bearing may then turn by 360 degrees in one loop or in three.

    motion: a record of `flight.guidance.navigation_error.MOTION`.
    memory: a record of `flight.guidance.inner_loops.GUIDANCE_MEMORY`.
    """
    # The flight does not miss the mission's end, however wide the aircraft flies the loiter.
    memory.is_in_rtl = True
    course = math.atan2(motion.velocity_east, motion.velocity_north)
    if memory.loiter_time > 0.0:
        memory.loiter_angle += wrap(course - memory.bearing)
    memory.loiter_time += dt
    memory.bearing = course
    memory.is_finished = abs(memory.loiter_angle) >= END_LOITER_ANGLE_RAD


@compiled
def rtl_loiter_timeout(radius: float) -> float:
    """Return the time after which a flight ends on its RTL loiter, s.

    radius: radius of the loiter, m, of either sign.
    """
    return LOITER_TIMEOUT_FACTOR * max(ENDLESS_LOITER_TIME_S, 2.0 * math.pi * abs(radius) / _CIRCLING_SPEED_MPS)


@inner
def _to_si(state: Record, factors: Record) -> bool:
    """Convert the state to SI units in place; return False if a value is NaN or infinite."""
    total = 0.0
    for name in literal_unroll(_STATE_FIELDS):
        value = state[name] * factors[name]
        state[name] = value
        total += value * 0.0
    return total == 0.0


@inner
def _set_output(output: Record, commands: Record, air: Record, scale_positive: Record, scale_negative: Record) -> None:
    """Set the values for JSBSim, in JSBSim's units: commands, mean wind plus gust, and ground altitude.

    output: record of `OUTPUT`, which is set.
    scale_positive, scale_negative: factors from SI to JSBSim's units, for values above zero and for other values.
    """
    output.elevator, output.aileron = commands.elevator, commands.aileron
    output.rudder, output.throttle = commands.rudder, commands.throttle
    # Mean wind is set as part of the gust: three properties a tick instead of six.
    output.gust_north, output.gust_east = air.wind_north + air.gust_north, air.wind_east + air.gust_east
    output.gust_down, output.ground = air.gust_down, air.ground
    for name in literal_unroll(_OUTPUT_FIELDS):
        output[name] *= scale_positive[name] if output[name] > 0.0 else scale_negative[name]


@inner
def _update_wind(
    state: Record,
    wind: Record,
    gusts: Record,
    noise: Floats,
    height_above_ground: float,
    up: float,
    convergence_cos: float,
    convergence_sin: float,
    air: Record,
    dt: float,
) -> None:
    """Write the mean wind and the next gust at the aircraft's position into the record ``air``.

    The components are along true north, east and down. The mean wind has no vertical component. Without turbulence
    (`wind.w20` is 0) the gust in the record does not change.

    wind: record of `MEAN_WIND`.
    gusts, noise: state of the gust filters, and random numbers of the tick.
    height_above_ground, up: height and altitude of the aircraft, m; the height is NaN over unknown ground.
    convergence_cos, convergence_sin: cosine and sine of the grid convergence, the map course of true north.
    """
    speed = mean_wind_speed(wind.speed, wind.gradient, wind.reference_amsl, up)
    # The wind's map course minus the map course of true north.
    cos = wind.cos * convergence_cos + wind.sin * convergence_sin
    sin = wind.sin * convergence_cos - wind.cos * convergence_sin
    air.wind_north, air.wind_east = speed * cos, speed * sin
    if wind.w20 > 0.0:
        # Over unknown ground use the turbulence scales for more than 300 m.
        gust_height = height_above_ground if not math.isnan(height_above_ground) else 1000.0
        gust_downwind, gust_crosswind, gust_down = step_gusts(gusts, noise, wind.w20, gust_height, state.airspeed, dt)
        air.gust_north = gust_downwind * cos - gust_crosswind * sin
        air.gust_east = gust_downwind * sin + gust_crosswind * cos
        air.gust_down = gust_down


@inner
def _fill_row(row: Record, workspace: Record) -> None:
    """Fill a `flight.simulation.track.TRACK_ROW` record from a record of `WORKSPACE`, in map axes."""
    state, true, memory = workspace.state, workspace.true, workspace.memory
    commands, place = workspace.commands, workspace.place
    row.time = workspace.timing.tick * workspace.timing.dt
    # Element by element: assigning a whole array would check shapes.
    position = row.position
    velocity = row.velocity
    attitude = row.attitude
    rates = row.rates
    position[0], position[1], position[2] = true.east, true.north, true.up
    velocity[0], velocity[1], velocity[2] = true.velocity_east, true.velocity_north, true.velocity_up
    attitude[0], attitude[1], attitude[2] = state.roll, state.pitch, state.yaw
    rates[0], rates[1], rates[2] = state.roll_rate, state.pitch_rate, state.yaw_rate
    row.airspeed = state.airspeed
    flow, controls, commands_row = row.flow, row.controls, row.commands
    flow[0], flow[1] = state.alpha, state.beta
    controls[ELEVATOR], controls[AILERON], controls[RUDDER] = state.elevator, state.aileron, state.rudder
    controls[THROTTLE] = state.throttle
    commands_row[ELEVATOR] = commands.elevator
    commands_row[AILERON] = commands.aileron
    commands_row[RUDDER] = commands.rudder
    commands_row[THROTTLE] = commands.throttle
    row.load_factor = state.load_factor
    row.current = state.current
    row.energy = workspace.air.energy
    row.leg = memory.leg
    row.cross_track = memory.cross_track
    row.height_error = memory.height_error
    row.speed_command = memory.speed_command
    row.clearance = place.clearance
    wind = row.wind
    wind[0] = state.wind_east * place.north_cos + state.wind_north * place.north_sin
    wind[1] = state.wind_north * place.north_cos - state.wind_east * place.north_sin
    wind[2] = -state.wind_down


# ----------------------------------------------------------------------
# Exchange of the state and the commands of a tick with the compiled model, within the compiled loop of a control law.

_WORKSPACE_FIELDS: Any = WORKSPACE.fields
# Indices of the first numbers of the state and of the outputs in a workspace's block.
_STATE_OFFSET = int(_WORKSPACE_FIELDS["state"][1]) // 8
_OUTPUT_OFFSET = int(_WORKSPACE_FIELDS["output"][1]) // 8


@inner
def read_state(block: Floats, registers: Floats, code: Code) -> None:
    """Copy the state of the compiled model to the block of a workspace, in JSBSim's units.

    block: numbers of the flight's workspace.
    registers: values of the compiled model.
    code: program of the compiled model, which lists the registers to read.
    """
    first_read = code[READS_START]
    for k in range(code[WRITES_START] - first_read):
        block[_STATE_OFFSET + k] = registers[code[first_read + k]]


@inner
def advance_model(
    block: Floats, frame: Record, registers: Floats, code: Code, contacts: Records, frictions: Records
) -> None:
    """Copy the autopilot's outputs to the compiled model's registers, and step the model to the next tick.

    block: numbers of the flight's workspace, which contain the outputs in JSBSim's units.
    registers, code: values and program of the compiled model.
    """
    first_write = code[WRITES_START]
    for k in range(code[CODE_END] - first_write):
        registers[code[first_write + k]] = block[_OUTPUT_OFFSET + k]
    for _ in range(code[STEPS]):
        step(frame, registers, code, contacts, frictions)
