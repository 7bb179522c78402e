"""Compute the destinations in reach of a glide, and the altitude that is left there.

The aircraft flies on for a moment, turns to the path to the destination, and glides.  The path comes from a backward
search (`logs.verdict.returns.glide_map`) that ignores turns.  Therefore the turn is simulated first, to either side, in
the wind at the start: at the bank that the autopilot commands and the airspeed allows, with the higher speed and sink
rate that the load factor of this bank causes.  Neither the altitude that the excess speed over the glide speed would
give back nor the altitude needed to reach the speed of the turn is included.
"""

import math

import numpy as np

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.tecs import (
    MIN_ROLL_LIMIT_RAD,
    load_factor_roll_limit,
)
from flight.autopilots.point_mass import PointMass, excess_power, wind_at
from flight.autopilots.simulated_returns import ENGINE_FAILURE_REACTION_S, ReturnEnvironment
from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from logs.verdict.returns.glide_map import GlideAltitudes, GlideMap, glide_steps
from world.arrays import Codes, Floats
from world.geometry import wrap
from world.kernels import Record, Records, compiled, inner, record_dtype
from world.wind import mean_wind_speed

# Course step of a simulated turn, rad.
_TURN_STEP_RAD = math.radians(10.0)
# Largest number of steps of a turn.
_MAX_TURN_STEPS = 40
# Number of steps along the path ahead over which the course of the path is measured.
_LOOKAHEAD_STEPS = 6
# State of the aircraft in a turn: position, m, and course, rad.
_TURN_STATE = record_dtype("east", "north", "up", "course")
# Glide and grid of the map for compiled code: equivalent airspeed, m/s; bank, rad; south-western cell and cell side, m.
_GLIDER = record_dtype("airspeed", "bank", "west", "south", "cell")


def remaining_glide_altitudes(
    starts: Records,
    glide_altitudes: GlideAltitudes,
    aircraft: PointMass,
    environment: ReturnEnvironment,
    airspeed: float,
    bank: float,
) -> tuple[Floats, Codes]:
    """Return the altitude left at each start's best destination, m, and its cell, (n,) each.

    starts: (n,) of dtype `flight.autopilots.simulated_returns.RETURN_START`.
    glide_altitudes: result of the backward search from the destinations.
    airspeed: equivalent airspeed of the glide, m/s.
    bank: bank of the turn, rad; limited to the bank that the airspeed allows.

    The altitude is negative if the destination is out of reach, and -inf if no path leads to one.  The cell is a flat
    index into the map, row by row, as in `logs.verdict.returns.glide_map.GlideAltitudes`; -1 without a path.
    """
    altitude_left = np.full(len(starts), -math.inf)
    reached_cells = np.full(len(starts), -1, dtype=np.int32)
    grid = glide_altitudes.grid
    glider: Record = np.zeros(1, _GLIDER)[0]
    glider.airspeed, glider.bank = airspeed, bank
    glider.west, glider.south, glider.cell = grid.west, grid.south, grid.cell
    _fill_altitudes_left(
        starts,
        environment.spheres,
        environment.radii,
        grid.floor,
        glide_altitudes.min_altitude,
        glide_altitudes.destination,
        glide_altitudes.next_step,
        glide_steps()[0],
        glider,
        aircraft.record,
        aircraft.excess,
        aircraft.field,
        altitude_left,
        reached_cells,
    )
    return altitude_left, reached_cells


def cell_position(grid: GlideMap, cell: int) -> tuple[float, float, float]:
    """Return the center of a cell: east, north and ground altitude, m.

    cell: flat index into the map, row by row.
    """
    row, column = divmod(cell, grid.floor.shape[1])
    return (*grid.cell_center(row, column), float(grid.ground[row, column]))


# After the reaction time the aircraft turns left or right, in steps of `_TURN_STEP_RAD`, until it heads along the path
# that the glide map stores for its cell.  Its altitude there, less the minimum altitude of the cell, is the altitude
# left.  The better of the two turns is taken.
#
# The starts are of dtype `flight.autopilots.simulated_returns.RETURN_START`.  spheres, radii: centres, m, (s, 3), and
# radii, m, (s,), of the kill spheres.  floor: lowest altitude allowed in each cell, m.  min_altitude, destination,
# next_step: see `GlideAltitudes`; step_records: step of each index in `next_step`, in cells.  aircraft, excess_table,
# field: point mass, its excess power by throttle and airspeed, and the wind field.
@compiled
def _fill_altitudes_left(
    starts: Records,
    spheres: Floats,
    radii: Floats,
    floor: Floats,
    min_altitude: Floats,
    destination: Codes,
    next_step: Codes,
    step_records: Records,
    glider: Record,
    aircraft: Record,
    excess_table: Floats,
    field: Floats,
    altitude_left: Floats,
    reached_cells: Codes,
) -> None:
    """Fill `altitude_left` (m) and `reached_cells` for each start.

    A left and a right turn to a glide are simulated.
    """
    state_array = np.zeros(1, _TURN_STATE)
    state = state_array[0]
    max_speed = aircraft.first_airspeed + (excess_table.shape[1] - 1) * aircraft.airspeed_step
    for n in range(starts.shape[0]):
        start = starts[n]
        wind, wind_east, wind_north = _wind_at_start(start, aircraft, field)
        air_east, air_north = start.velocity_east - wind_east, start.velocity_north - wind_north
        min_speed = glider.airspeed * eas_to_tas_ratio(start.up)
        speed = max(min_speed, math.hypot(air_east, air_north))
        bank = min(glider.bank, load_factor_roll_limit(speed, min_speed, MIN_ROLL_LIMIT_RAD))
        tan_bank = math.tan(bank)
        level_sink = -excess_power(excess_table, 0.0, speed, start.up, aircraft)
        # The turn is flown at the same angle of attack: the load makes it faster, up to the airspeed limit.
        turn_speed = max(speed, min(speed / math.sqrt(math.cos(bank)), max_speed))
        turn_sink = aircraft.induced / turn_speed * tan_bank * tan_bank - excess_power(
            excess_table, 0.0, turn_speed, start.up, aircraft
        )
        step_duration = _TURN_STEP_RAD * turn_speed / (GRAVITY * tan_bank)
        # Upper bound of the height lost per meter to the center of a neighbouring cell, on any course.
        sink = -excess_power(excess_table, 0.0, min_speed, start.up, aircraft)
        center_slope = sink / max(1.0, 0.95 * min_speed - wind)
        for turn_sign in (-1.0, 1.0):
            yaw = math.atan2(air_east, air_north)
            state.east = start.east + ENGINE_FAILURE_REACTION_S * start.velocity_east
            state.north = start.north + ENGINE_FAILURE_REACTION_S * start.velocity_north
            state.up = start.up - ENGINE_FAILURE_REACTION_S * max(level_sink, -start.velocity_up)
            previous_turn = 0.0
            for step in range(_MAX_TURN_STEPS):
                ground_east, ground_north = (
                    turn_speed * math.sin(yaw) + wind_east,
                    turn_speed * math.cos(yaw) + wind_north,
                )
                state.course = math.atan2(ground_east, ground_north)
                if not _is_clear(state, floor, spheres, radii, glider):
                    break
                cell_altitude_left, i, j = _best_cell(state, min_altitude, center_slope, glider)
                remaining_turn = (
                    _remaining_turn(state, i, j, turn_sign, next_step, step_records, glider)
                    if cell_altitude_left > -math.inf
                    else previous_turn
                )
                # The path ahead changes during a turn, so one step may overshoot the path's course by more than a step.
                has_passed = (
                    0.0 < previous_turn <= 2.0 * _TURN_STEP_RAD and -2.0 * _TURN_STEP_RAD <= remaining_turn < 0.0
                )
                if step + 1 == _MAX_TURN_STEPS or (
                    cell_altitude_left > -math.inf
                    and (has_passed or -_TURN_STEP_RAD <= remaining_turn <= 0.5 * _TURN_STEP_RAD)
                ):
                    if cell_altitude_left > altitude_left[n]:
                        altitude_left[n], reached_cells[n] = cell_altitude_left, destination[i, j]
                    break
                previous_turn = remaining_turn
                state.east += step_duration * ground_east
                state.north += step_duration * ground_north
                state.up -= step_duration * turn_sink
                yaw += turn_sign * _TURN_STEP_RAD
    # This use keeps the array alive: compiled code frees an array after its last use, even if its records are in use.
    if state_array.size != 1:
        altitude_left[:] = math.nan


@inner
def _wind_at_start(start: Record, aircraft: Record, field: Floats) -> tuple[float, float, float]:
    """Return the wind at a start, m/s: its speed, and its components to the east and to the north."""
    east, north = wind_at(start, start.time, aircraft, field)
    if field.size:
        return math.hypot(east, north), east, north
    speed = mean_wind_speed(aircraft.wind_speed, aircraft.wind_gradient, aircraft.wind_reference, start.up)
    return speed, east, north


@inner
def _is_clear(state: Record, floor: Floats, spheres: Floats, radii: Floats, glider: Record) -> bool:
    """Return True if the aircraft is on the map, not below the cell's floor and outside kill spheres.

    floor: lowest altitude allowed in each cell of the map, m, (rows, columns).
    spheres, radii: centres, m, (s, 3), and radii, m, (s,), of the threats' kill spheres.
    """
    i = round((state.north - glider.south) / glider.cell)
    j = round((state.east - glider.west) / glider.cell)
    if not (0 <= i < floor.shape[0] and 0 <= j < floor.shape[1]) or not state.up >= floor[i, j]:
        return False
    for m in range(spheres.shape[0]):
        east_offset = state.east - spheres[m, 0]
        north_offset = state.north - spheres[m, 1]
        up_offset = state.up - spheres[m, 2]
        if east_offset * east_offset + north_offset * north_offset + up_offset * up_offset < radii[m] * radii[m]:
            return False
    return True


@inner
def _best_cell(state: Record, min_altitude: Floats, slope: float, glider: Record) -> tuple[float, int, int]:
    """Return the largest altitude left, m, and the row and column of the cell in which it is left.

    The aircraft's cell and its neighbours are compared.  The altitude left is the altitude above the cell's minimum
    altitude after a glide to the cell's center.  Neighbours are included because a cell's center may lie in a sphere
    even if the aircraft does not.

    slope: height lost per meter of distance to a cell's center.
    """
    row = round((state.north - glider.south) / glider.cell)
    column = round((state.east - glider.west) / glider.cell)
    best_altitude_left, best_row, best_column = -math.inf, row, column
    for i in range(max(0, row - 1), min(min_altitude.shape[0], row + 2)):
        for j in range(max(0, column - 1), min(min_altitude.shape[1], column + 2)):
            east_offset = glider.west + j * glider.cell - state.east
            north_offset = glider.south + i * glider.cell - state.north
            altitude_left = state.up - min_altitude[i, j] - slope * math.hypot(east_offset, north_offset)
            if altitude_left > best_altitude_left:
                best_altitude_left, best_row, best_column = altitude_left, i, j
    return best_altitude_left, best_row, best_column


@inner
def _remaining_turn(
    state: Record, i: int, j: int, turn_sign: float, next_step: Codes, step_records: Records, glider: Record
) -> float:
    """Return the course change until the aircraft heads along the path ahead of a cell, rad.

    The path ahead is `_LOOKAHEAD_STEPS` steps of the glide map.  The course change is negative if the turn has overshot
    its course.  It is 0 within two cells of the end of the path.

    i, j: row and column of the cell.
    turn_sign: 1 for a turn to the right, -1 to the left.
    next_step, step_records: index of the next step from each cell, and step of each index in cells.
    """
    for _ in range(_LOOKAHEAD_STEPS):
        step_index = next_step[i, j]
        if step_index < 0:
            break
        i += step_records[step_index].north
        j += step_records[step_index].east
    east_offset = glider.west + j * glider.cell - state.east
    north_offset = glider.south + i * glider.cell - state.north
    if math.hypot(east_offset, north_offset) < 2.0 * glider.cell:
        return 0.0
    return turn_sign * wrap(math.atan2(east_offset, north_offset) - state.course)
