"""Compute the places to which a flying aircraft can glide.

It flies on for a moment, turns to the path there, and glides.  The path comes from a backward search
(`logs.verdict.returns.glide_map`) that ignores turns.  So the turn is flown first, to either side, in the mean wind:
at the bank that the autopilot commands and the airspeed allows, at the higher speed and sink that the load factor of
that bank causes.  Neither the altitude that the excess speed over the glide speed would give back nor the altitude
needed to reach the speed of the turn is included.
"""

import math

import numpy as np

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.law import stall_bank
from flight.autopilots.arduplane.point_mass import PointMass, excess_power
from flight.autopilots.arduplane.rtl_point_mass import ENGINE_FAILURE_REACTION_S, ReturnEnvironment
from flight.guidance.equivalent_airspeed import true_by_equivalent
from logs.verdict.returns.glide_map import GlideMap, Needs, steps
from world.arrays import Codes, Floats
from world.geometry import wrap
from world.kernels import Record, Records, compiled, inner, record_dtype
from world.wind import mean_wind_speed

# Step in which a turn is checked, rad.
_TURN_STEP_RAD = math.radians(10.0)
# Largest number of steps of a turn.
_MAX_TURN_STEPS = 40
# Number of steps along the path ahead after which its course is measured.
_LOOKAHEAD_STEPS = 6
# State at the end of a turn: m, and rad.
_TURNING = record_dtype("east", "north", "up", "course")
# The glider, for compiled code: equivalent airspeed, m/s, and bank, rad.
_GLIDER = record_dtype("airspeed", "bank", "west", "south", "cell")


def heights_left(
    starts: Records, needs: Needs, aircraft: PointMass, around: ReturnEnvironment, airspeed: float, bank: float
) -> tuple[Floats, Codes]:
    """Return each start's altitude above the minimum from which a place can be reached, m, (n,), and that place.

    starts: (n,) of `flight.autopilots.arduplane.rtl_point_mass.RETURN_START`.  airspeed: of the glide, equivalent, m/s.
    bank: of the turn, rad; limited to the bank that the airspeed allows.  The altitude left is negative if the place is
    out of reach, -inf if no path leads there.  The place is a cell of the map, numbered through all rows, as in
    `logs.verdict.returns.glide_map.Needs`.
    """
    left, reached = np.full(len(starts), -math.inf), np.full(len(starts), -1, dtype=np.int32)
    made = needs.made
    glider: Record = np.zeros(1, _GLIDER)[0]
    glider.airspeed, glider.bank = airspeed, bank
    glider.west, glider.south, glider.cell = made.west, made.south, made.cell
    _look_ahead(
        starts,
        around.spheres,
        around.radii,
        made.floor,
        needs.need,
        needs.origin,
        needs.onward,
        steps()[0],
        glider,
        aircraft.record,
        aircraft.excess,
        left,
        reached,
    )
    return left, reached


def place_of(made: GlideMap, cell: int) -> tuple[float, float, float]:
    """Return east, north and ground altitude of a cell that is numbered through all rows, m."""
    row, column = divmod(cell, made.floor.shape[1])
    return (*made.middle(row, column), float(made.ground[row, column]))


@compiled
def _look_ahead(
    starts: Records,
    spheres: Floats,
    radii: Floats,
    floor: Floats,
    need: Floats,
    origin: Codes,
    onward: Codes,
    moves: Records,
    glider: Record,
    aircraft: Record,
    excess: Floats,
    left: Floats,
    reached: Codes,
) -> None:
    """Fill `left` and `reached` for each start, with the better of the turns to both sides."""
    turnings = np.zeros(1, _TURNING)
    here = turnings[0]
    fastest = aircraft.slowest + (excess.shape[1] - 1) * aircraft.speed_step
    for n in range(starts.shape[0]):
        start = starts[n]
        wind = mean_wind_speed(aircraft.wind_speed, aircraft.wind_gradient, aircraft.wind_reference, start.up)
        wind_east, wind_north = wind * aircraft.wind_east, wind * aircraft.wind_north
        air_east, air_north = start.velocity_east - wind_east, start.velocity_north - wind_north
        slowest = glider.airspeed * true_by_equivalent(start.up)
        speed = max(slowest, math.hypot(air_east, air_north))
        bank = min(glider.bank, stall_bank(speed, slowest))
        tilt = math.tan(bank)
        straight = -excess_power(excess, 0.0, speed, start.up, aircraft)
        # The turn is flown at the same angle of attack: the load makes it faster, but no faster than the airspeed
        # limit.
        fast = max(speed, min(speed / math.sqrt(math.cos(bank)), fastest))
        sink = aircraft.induced / fast * tilt * tilt - excess_power(excess, 0.0, fast, start.up, aircraft)
        lasts = _TURN_STEP_RAD * fast / (GRAVITY * tilt)
        # Height loss to the center of a neighbouring cell, whatever the course.
        worst = -excess_power(excess, 0.0, slowest, start.up, aircraft) / max(1.0, 0.95 * slowest - wind)
        for side in (-1.0, 1.0):
            yaw = math.atan2(air_east, air_north)
            here.east = start.east + ENGINE_FAILURE_REACTION_S * start.velocity_east
            here.north = start.north + ENGINE_FAILURE_REACTION_S * start.velocity_north
            here.up = start.up - ENGINE_FAILURE_REACTION_S * max(straight, -start.velocity_up)
            before = 0.0
            for part in range(_MAX_TURN_STEPS):
                over_east, over_north = fast * math.sin(yaw) + wind_east, fast * math.cos(yaw) + wind_north
                here.course = math.atan2(over_east, over_north)
                if not _is_clear(here, floor, spheres, radii, glider):
                    break
                spare, i, j = _best_cell(here, need, worst, glider)
                rest = _remaining_turn(here, i, j, side, onward, moves, glider) if spare > -math.inf else before
                # The path ahead changes during a turn, so that one step may overshoot its course by more than that
                # step.
                passed = 0.0 < before <= 2.0 * _TURN_STEP_RAD and -2.0 * _TURN_STEP_RAD <= rest < 0.0
                if part + 1 == _MAX_TURN_STEPS or (
                    spare > -math.inf and (passed or -_TURN_STEP_RAD <= rest <= 0.5 * _TURN_STEP_RAD)
                ):
                    if spare > left[n]:
                        left[n], reached[n] = spare, origin[i, j]
                    break
                before = rest
                here.east += lasts * over_east
                here.north += lasts * over_north
                here.up -= lasts * sink
                yaw += side * _TURN_STEP_RAD
    # Compiled code frees an array after its last use, and use of a record of it does not keep it alive.
    if turnings.size != 1:
        left[:] = math.nan


@inner
def _is_clear(here: Record, floor: Floats, spheres: Floats, radii: Floats, glider: Record) -> bool:
    """Return True if a place is on the map, above the ground's margin, and outside every kill sphere."""
    i, j = round((here.north - glider.south) / glider.cell), round((here.east - glider.west) / glider.cell)
    if not (0 <= i < floor.shape[0] and 0 <= j < floor.shape[1]) or not here.up >= floor[i, j]:
        return False
    for m in range(spheres.shape[0]):
        off_e, off_n, off_u = here.east - spheres[m, 0], here.north - spheres[m, 1], here.up - spheres[m, 2]
        if off_e * off_e + off_n * off_n + off_u * off_u < radii[m] * radii[m]:
            return False
    return True


@inner
def _best_cell(here: Record, need: Floats, worst: float, glider: Record) -> tuple[float, int, int]:
    """Return the remaining altitude, row and column of the best cell among a place's cell and its neighbours.

    A cell's center may lie in a sphere that the place itself is outside of.  worst: height lost per metre to a center.
    """
    row, column = round((here.north - glider.south) / glider.cell), round((here.east - glider.west) / glider.cell)
    best, at_row, at_column = -math.inf, row, column
    for i in range(max(0, row - 1), min(need.shape[0], row + 2)):
        for j in range(max(0, column - 1), min(need.shape[1], column + 2)):
            away_east = glider.west + j * glider.cell - here.east
            away_north = glider.south + i * glider.cell - here.north
            spare = here.up - need[i, j] - worst * math.hypot(away_east, away_north)
            if spare > best:
                best, at_row, at_column = spare, i, j
    return best, at_row, at_column


@inner
def _remaining_turn(here: Record, i: int, j: int, side: float, onward: Codes, moves: Records, glider: Record) -> float:
    """Return the remaining turn to the path's course at a cell, rad; negative if overshot, 0 at the path's end."""
    for _ in range(_LOOKAHEAD_STEPS):
        m = onward[i, j]
        if m < 0:
            break
        i += moves[m].north
        j += moves[m].east
    away_east = glider.west + j * glider.cell - here.east
    away_north = glider.south + i * glider.cell - here.north
    if math.hypot(away_east, away_north) < 2.0 * glider.cell:
        return 0.0
    return side * wrap(math.atan2(away_east, away_north) - here.course)
