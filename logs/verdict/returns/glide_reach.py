"""What a flying aircraft can glide to: it flies on for a moment, turns to the way that leads there, and glides.

The way there is that of a search backwards (`logs.verdict.returns.glide_map`), which knows no turns.  So the turn is
flown first, to either side, in the mean wind: banked as far as its autopilot banks and its airspeed bears, as much
faster as the load in that bank makes it, with the sink of that.  What its speed above that of the glide would give back
is not counted, nor what it takes to get as fast as the turn.
"""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.law import stall_bank
from flight.autopilots.arduplane.point_mass import PointMass, excess_power
from flight.autopilots.arduplane.swift_return import REACTION, Surroundings
from flight.guidance.equivalent_airspeed import true_by_equivalent
from logs.verdict.returns.glide_map import GlideMap, Needs, steps
from world.geometry import wrap
from world.kernels import Record, Records, compiled, inner, record_dtype
from world.wind import mean_wind_speed

Floats = NDArray[np.float64]
Codes = NDArray[np.int32]

# How finely a turn is looked at, rad, and how far it goes round at the most.
_PART, _PARTS = math.radians(10.0), 40
# Steps of the way ahead whose end tells its course.
_AHEAD = 6
# Where a turn has led: m, and rad.
_TURNING = record_dtype("east", "north", "up", "course")
# The glider, for compiled code: airspeed, equivalent, m/s, and bank, rad.
_GLIDER = record_dtype("airspeed", "bank", "west", "south", "cell")


def heights_left(
    starts: Records, needs: Needs, aircraft: PointMass, around: Surroundings, airspeed: float, bank: float
) -> tuple[Floats, Codes]:
    """What is left (n,) of each start's height over the least from which a place is reached, m, and that place.

    starts: (n,) of `flight.autopilots.arduplane.swift_return.RETURN_START`.  airspeed: of the glide, equivalent, m/s.
    bank: of the turn, rad; only what the airspeed bears of it is flown.  What is left is negative where the place is
    out of reach, -inf where no way leads there.  The place is a cell of the map, counted through all rows, as in
    `logs.verdict.returns.glide_map.Needs`.
    """
    left, reached = np.full(len(starts), -math.inf), np.full(len(starts), -1, dtype=np.int32)
    made = needs.made
    glider: Record = np.zeros(1, _GLIDER)[0]
    glider.airspeed, glider.bank = airspeed, bank
    glider.west, glider.south, glider.cell = made.west, made.south, made.cell
    _look_ahead(
        starts, around.spheres, around.radii, made.floor, needs.need, needs.origin, needs.onward, steps()[0], glider,
        aircraft.record, aircraft.excess, left, reached,
    )  # fmt: skip
    return left, reached


def place_of(made: GlideMap, cell: int) -> tuple[float, float, float]:
    """East, north and ground height of a cell that is counted through all rows, m."""
    row, column = divmod(cell, made.floor.shape[1])
    return (*made.middle(row, column), float(made.ground[row, column]))


@compiled
def _look_ahead(
    starts: Records, spheres: Floats, radii: Floats, floor: Floats, need: Floats, origin: Codes, onward: Codes,
    moves: Records, glider: Record, aircraft: Record, excess: Floats, left: Floats, reached: Codes,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Fill what is left and what is reached, for each start the better of both turns."""
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
        # In the turn it flies at the same angle of attack, which the load makes faster, but no faster than it may.
        fast = max(speed, min(speed / math.sqrt(math.cos(bank)), fastest))
        sink = aircraft.induced / fast * tilt * tilt - excess_power(excess, 0.0, fast, start.up, aircraft)
        lasts = _PART * fast / (GRAVITY * tilt)
        # To the middle of a cell beside, whatever the course.
        worst = -excess_power(excess, 0.0, slowest, start.up, aircraft) / max(1.0, 0.95 * slowest - wind)
        for side in (-1.0, 1.0):
            yaw = math.atan2(air_east, air_north)
            here.east = start.east + REACTION * start.velocity_east
            here.north = start.north + REACTION * start.velocity_north
            here.up = start.up - REACTION * max(straight, -start.velocity_up)
            before = 0.0
            for part in range(_PARTS):
                over_east, over_north = fast * math.sin(yaw) + wind_east, fast * math.cos(yaw) + wind_north
                here.course = math.atan2(over_east, over_north)
                if not _is_clear(here, floor, spheres, radii, glider):
                    break
                spare, i, j = _best_cell(here, need, worst, glider)
                rest = _rest_of_turn(here, i, j, side, onward, moves, glider) if spare > -math.inf else before
                # The way ahead changes on a turn, so that a part may go past it by more than that part.
                passed = 0.0 < before <= 2.0 * _PART and -2.0 * _PART <= rest < 0.0
                if part + 1 == _PARTS or (spare > -math.inf and (passed or -_PART <= rest <= 0.5 * _PART)):
                    if spare > left[n]:
                        left[n], reached[n] = spare, origin[i, j]
                    break
                before = rest
                here.east += lasts * over_east
                here.north += lasts * over_north
                here.up -= lasts * sink
                yaw += side * _PART
    # Compiled code frees an array after its last use, and a record of it does not count as one.
    if turnings.size != 1:
        left[:] = math.nan


@inner
def _is_clear(
    here: Record, floor: Floats, spheres: Floats, radii: Floats, glider: Record
) -> bool:  # pragma: no cover - compiled
    """Whether a place is above the margin over the ground, on the map, and outside every kill sphere."""
    i, j = round((here.north - glider.south) / glider.cell), round((here.east - glider.west) / glider.cell)
    if not (0 <= i < floor.shape[0] and 0 <= j < floor.shape[1]) or not here.up >= floor[i, j]:
        return False
    for m in range(spheres.shape[0]):
        off_e, off_n, off_u = here.east - spheres[m, 0], here.north - spheres[m, 1], here.up - spheres[m, 2]
        if off_e * off_e + off_n * off_n + off_u * off_u < radii[m] * radii[m]:
            return False
    return True


@inner
def _best_cell(
    here: Record, need: Floats, worst: float, glider: Record
) -> tuple[float, int, int]:  # pragma: no cover - compiled
    """Of the cell of a place and those beside it the one from which most is left: what is left, row and column.

    A cell's middle may lie in a sphere that the place itself is outside of.  worst: height lost per metre to a middle.
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
def _rest_of_turn(
    here: Record, i: int, j: int, side: float, onward: Codes, moves: Records, glider: Record
) -> float:  # pragma: no cover - compiled
    """What is left of a turn to the way that leads on from a cell, rad; negative beyond it, 0 at the way's end."""
    for _ in range(_AHEAD):
        m = onward[i, j]
        if m < 0:
            break
        i += moves[m].north
        j += moves[m].east
    away_east = glider.west + j * glider.cell - here.east
    away_north = glider.south + i * glider.cell - here.north
    if math.hypot(away_east, away_north) < 2.0 * glider.cell:
        return 0.0
    rest: float = side * wrap(math.atan2(away_east, away_north) - here.course)
    return rest
