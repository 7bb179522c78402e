"""Measure the clearance of legs.

Measured are the depth below the required clearance, and the smallest heights near waypoints.

Height is sampled along a leg. The steps grow with the height above the required clearance, because the ground cannot
rise faster than its steepest slope nearby; near the ground they are the sample spacing. An autopilot that follows the
height demand with a lag flies below or above its legs, and that deviation is added to the required height.
"""

import math

import numpy as np

from aircraft.envelope import ground_speed
from aircraft.path_limits import PerformanceTable, true_airspeed, wind_speed_at
from planner.evaluation.corners import Wind
from planner.evaluation.problem import RequiredClearance, SlopeBounds, clearance_at
from world.arrays import Floats, Heights, Ints
from world.frames import PolyMapRecord, polymap
from world.kernels import Record, Records, inlined, inner
from world.terrain import TILE_PIXELS, pixel_height

# --- Height lag ---

# The height follows its demand as a first-order lag of `TrackingError.lag` seconds: on a long climb it is lag x climb
# rate low, and as much high on a descent; after a change of slope the difference decays over the lag's length and is
# carried into the next leg. A leg whose change of height is below a step is demanded at its final height from its
# beginning. ArduPlane's TECS behaves like this (ardupilot.org, Plane, TECS_HDEM_TCONST; ALT_SLOPE_MIN).

# Distance of the aircraft below a leg at the fraction f of the leg, m: steady + slant (1 - f) + transient E(f x decay),
# where E(x) is about exp(-x).  max_below and min_below are its largest and smallest value on the leg, or 0.
HEIGHT_LAG = np.dtype(
    [(name, np.float64) for name in ("steady", "slant", "transient", "decay", "max_below", "min_below")]
)


@inlined
def _remaining_fraction(lengths: float) -> float:
    """Return the fraction of a lag that remains after some lag lengths: a bound above exp(-lengths)."""
    # Four terms of exp(x), because a library's exponential rounds differently on different machines.
    return 1.0 / (1.0 + lengths * (1.0 + lengths * (0.5 + lengths / 6.0)))


@inlined
def lag_length(
    tracking: Record, aircraft: PerformanceTable, east: float, north: float, amsl: float, wind: Wind
) -> float:
    """Return the distance over the ground that the aircraft covers during the autopilot's altitude lag, m.

    tracking: tracking error of the autopilot, with the lag, s.
    east, north: unit course.
    amsl: altitude, m.
    wind: downwind unit vector.

    On a course that cannot be held in the wind, the airspeed takes the place of the ground speed.
    """
    (wx, wy), wind_speed, airspeed = wind, wind_speed_at(aircraft, amsl), true_airspeed(aircraft, amsl)
    speed_over_ground = ground_speed(
        airspeed, wind_speed * (east * wx + north * wy), wind_speed * (east * wy - north * wx)
    )
    # A course that cannot be held against the wind has no plan either.
    length: float = tracking.lag * (airspeed if math.isnan(speed_over_ground) else speed_over_ground)
    return max(1e-6, length)


@inlined
def set_lag(
    tracking: Record, length: float, horizontal_length: float, altitude_change: float, below: float, lag: Record
) -> float:
    """Fill the `HEIGHT_LAG` record of a leg; return the distance of the aircraft below the leg's end, m.

    tracking: tracking error of the autopilot, with the step, m.
    length: lag length (`lag_length`), m.
    horizontal_length, altitude_change: horizontal length and altitude change of the leg, m.
    below: distance of the aircraft below the start of the leg, m.
    lag: the record to fill.

    On a leg with a slope the lag approaches a constant distance. If the altitude changes by less than the autopilot's
    step, the autopilot demands the final altitude from the beginning of the leg.
    """
    lag.steady, lag.slant = length * altitude_change / max(horizontal_length, 1e-6), 0.0
    if abs(altitude_change) < tracking.step:
        lag.steady, lag.slant = 0.0, -altitude_change
    lag.transient = below - lag.steady - lag.slant
    lag.decay = horizontal_length / length
    end_below: float = lag.steady + lag.transient * _remaining_fraction(lag.decay)
    lag.max_below, lag.min_below = max(0.0, below, end_below, lag.slant), min(0.0, below, end_below, lag.slant)
    return end_below


@inner
def compute_height_lags(
    tracking: Record, aircraft: PerformanceTable, wind: Wind, path: np.ndarray, legs: Records, lags: Records
) -> None:
    """Compute the altitude lag of the aircraft on each leg of a path (w, 3).

    There is no lag at the start of the path.

    tracking: tracking error of the autopilot.
    wind: downwind unit vector.
    legs: filled `LEG` records (w - 1,) of the path.
    lags: `HEIGHT_LAG` records to fill, (w - 1,).
    """
    below = 0.0
    for i in range(legs.shape[0]):
        leg, altitude_change = legs[i], path[i + 1, 2] - path[i, 2]
        length = lag_length(tracking, aircraft, leg.east, leg.north, path[i, 2], wind)
        below = set_lag(tracking, length, leg.run, altitude_change, below, lags[i])


@inlined
def lag_at(lag: Record, fraction: float) -> float:
    """Return the distance of the aircraft below a leg at a fraction of the leg, m; negative above the leg.

    lag: `HEIGHT_LAG` record of the leg.
    """
    return lag.steady + lag.slant * (1.0 - fraction) + lag.transient * _remaining_fraction(fraction * lag.decay)


# --- Terrain samples ---

# Columns and rows of both ends of a segment.
Pixels = tuple[float, float, float, float]

# Below this height above the required clearance (m) samples are at their closest spacing; corners rely on it.
NEAR_GROUND_HEIGHT_M = 10.0
# Violation of a sample where the ground is unknown, m.
UNKNOWN_GROUND_DEPTH_M = 1000.0
# State of sampling a leg.
TERRAIN_LEG = np.dtype(
    [
        # Pixel of its beginning, and the step to its end.
        ("column", np.float64),
        ("row", np.float64),
        ("column_step", np.float64),
        ("row_step", np.float64),
        # Fractions of the leg: spacing of samples near the ground; the next sample; the limits up to which and from
        # which a sample counts as near the beginning and near the end.
        ("min_step", np.float64),
        ("next_fraction", np.float64),
        ("beginning", np.float64),
        ("ending", np.float64),
        # Sum of depths below the required clearance, m·km; and smallest heights above it near both ends, m.
        ("depth", np.float64),
        ("height_at_beginning", np.float64),
        ("height_at_end", np.float64),
    ]
)


@inlined
def _take_sample(
    heights: Heights,
    tiles: Heights,
    tile_side: float,
    growth: float,
    column: float,
    row: float,
    up: float,
    required_height: float,
    max_further_height: float,
    horizontal_length: float,
    altitude_change: float,
    min_step: float,
) -> tuple[float, float]:
    """Return the height of a point above the required clearance, and the step to the next point.

    The points lie on a line. The higher the point, the longer the step, because the ground rises by no more than its
    steepest slope.

    heights: ground heights by pixel, m.
    tiles, tile_side: upper bound on the ground's slope (m per m) within `tile_side` m of each tile of the raster.
    growth: largest slope of the required height, m per m.
    column, row, up: raster position and altitude of the point.
    required_height: required clearance, m.
    max_further_height: largest additional height that the aircraft can need further along the line, m.
    horizontal_length, altitude_change: horizontal length and altitude change of the whole line, m.
    min_step: minimum spacing of samples, as a fraction of the line.

    The height is in m. The step is the fraction of the line to the next point that has to be sampled.
    """
    ground = pixel_height(heights, column, row)
    excess_height = up - ground - required_height if ground == ground else -UNKNOWN_GROUND_DEPTH_M
    i = min(max(int(row) // TILE_PIXELS, 0), tiles.shape[0] - 1)
    j = min(max(int(column) // TILE_PIXELS, 0), tiles.shape[1] - 1)
    # Fastest loss of height above ground, m per length of the line.
    max_fall = (tiles[np.uintp(i), np.uintp(j)] + growth) * horizontal_length + abs(altitude_change) + 1e-9
    next_step = (excess_height - max_further_height - NEAR_GROUND_HEIGHT_M) / max_fall
    tile_step = tile_side / (horizontal_length + 1e-9)
    next_step = next_step if next_step < tile_step else tile_step
    return excess_height, next_step if next_step > min_step else min_step


@inlined
def clearance_deficit(
    heights: Heights,
    slope_bounds: SlopeBounds,
    required: RequiredClearance,
    extra_height: float,
    ends: Pixels,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
    max_excess: float,
) -> float:
    """Return the clearance deficit of the line a-b, integrated along the line, m·km.

    The deficit is the depth below the required clearance.

    heights: ground heights by pixel, m.
    slope_bounds: steepest slopes of the ground near each pixel, which set the steps between samples.
    required: required clearance, with the spacing of samples near the ground.
    extra_height: additional height that is required on this line, m.
    ends: columns and rows of a and b.
    ax, ay, az, bx, by, bz: east, north and altitude of the two ends, m.
    max_excess: deficit above which the integration stops; the result is then a lower bound, m·km.
    """
    column, row, last_column, last_row = ends
    column_step, row_step = last_column - column, last_row - row
    altitude_change = bz - az
    horizontal_length = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
    min_step = 1.0 / max(1.0, math.ceil(horizontal_length / required.sample_spacing))
    tiles, tile_side, growth = slope_bounds.tiles, slope_bounds.tile_side, required.growth
    required_height = required.clearance + required.buffer + extra_height
    scale = max(horizontal_length, 1.0) * min_step / 1000.0
    depth, fraction, max_depth = 0.0, 0.0, max_excess / scale
    while True:
        if not required.same_everywhere:
            required_height = (
                clearance_at(required, ax + fraction * (bx - ax), ay + fraction * (by - ay)) + extra_height
            )
        x, y, up = column + fraction * column_step, row + fraction * row_step, az + fraction * altitude_change
        excess_height, next_step = _take_sample(
            heights,
            tiles,
            tile_side,
            growth,
            x,
            y,
            up,
            required_height,
            0.0,
            horizontal_length,
            altitude_change,
            min_step,
        )
        depth -= excess_height if excess_height < 0.0 else 0.0
        if fraction >= 1.0 or depth > max_depth:
            break
        fraction = min(1.0, fraction + next_step)
    return float(depth * max(horizontal_length, 1.0) * min_step / 1000.0)


@inlined
def _start_sampling(
    to_pixel: PolyMapRecord, sample_spacing: float, path: Floats, legs: Records, extents: Floats, terrain_legs: Records
) -> None:
    """Fill `TERRAIN_LEG` records (w - 1,) with their state before the first sample.

    to_pixel: map from east and north to column and row.
    sample_spacing: spacing of samples near the ground, m.
    path: (w, 3) m.
    legs: filled `LEG` records (w - 1,) of the path.
    extents: (w,) distance from each waypoint within which the flight leaves the legs, m.
    terrain_legs: the records to fill.
    """
    start = path[0]
    column, row = polymap(to_pixel, start[0], start[1])
    for i in range(legs.shape[0]):
        end_column, end_row = polymap(to_pixel, path[i + 1, 0], path[i + 1, 1])
        horizontal_length = legs[i].run
        min_step = 1.0 / max(1.0, math.ceil(horizontal_length / sample_spacing))
        leg = terrain_legs[i]
        leg.column, leg.row = column, row
        leg.column_step, leg.row_step = end_column - column, end_row - row
        leg.min_step, leg.next_fraction = min_step, 0.0
        # A sample represents the steps before and after it.
        per_metre = 1.0 / max(horizontal_length, 1e-9)
        leg.beginning = extents[i] * per_metre + min_step
        leg.ending = 1.0 - extents[i + 1] * per_metre - min_step
        leg.depth, leg.height_at_beginning, leg.height_at_end = 0.0, math.inf, math.inf
        column, row = end_column, end_row


@inner
def sample_terrain(
    heights: Heights,
    slope_bounds: SlopeBounds,
    to_pixel: PolyMapRecord,
    required: RequiredClearance,
    path: Floats,
    legs: Records,
    extents: Floats,
    lags: Records,
    terrain_legs: Records,
    unfinished: Ints,
) -> None:
    """Fill the `TERRAIN_LEG` record of each leg of a path (w, 3): its depth and its smallest heights.

    legs, lags: filled `LEG` and `HEIGHT_LAG` records (w - 1,) of the path. terrain_legs: (w - 1,) records to fill.
    extents: (w,) distance within which a point is near a waypoint, m. unfinished: (w - 1,) working memory.

    Depths and heights are measured from the required clearance. The smallest heights are exact up to
    `NEAR_GROUND_HEIGHT_M`, and lower bounds above it. The legs are sampled in turn, one sample of each at a time,
    because the next sample of a leg depends on its last one; the processor can work on several legs at once.
    """
    count = legs.shape[0]
    _start_sampling(to_pixel, required.sample_spacing, path, legs, extents, terrain_legs)
    for i in range(count):
        unfinished[i] = i
    tiles, tile_side, growth = slope_bounds.tiles, slope_bounds.tile_side, required.growth
    required_height = required.clearance + required.buffer
    while count > 0:
        remaining_count = 0
        for entry in range(count):
            k = np.uintp(unfinished[entry])
            leg = terrain_legs[k]
            fraction, min_step = leg.next_fraction, leg.min_step
            up, altitude_change = path[k, 2], path[k + np.uintp(1), 2] - path[k, 2]
            if not required.same_everywhere:
                dx, dy = path[k + np.uintp(1), 0] - path[k, 0], path[k + np.uintp(1), 1] - path[k, 1]
                required_height = clearance_at(required, path[k, 0] + fraction * dx, path[k, 1] + fraction * dy)
            x, y = leg.column + fraction * leg.column_step, leg.row + fraction * leg.row_step
            # The flight may be below the leg by the altitude lag.
            below, further_height = 0.0, 0.0
            if lags[k].max_below > 0.0:
                below = max(0.0, lag_at(lags[k], fraction))
                further_height = lags[k].max_below - below
            excess_height, next_step = _take_sample(
                heights,
                tiles,
                tile_side,
                growth,
                x,
                y,
                up + fraction * altitude_change,
                required_height + below,
                further_height,
                legs[k].run,
                altitude_change,
                min_step,
            )
            leg.depth -= excess_height if excess_height < 0.0 else 0.0
            gap_at_beginning = excess_height if fraction <= leg.beginning else math.inf
            gap_at_end = excess_height if fraction >= leg.ending else math.inf
            leg.height_at_beginning = (
                gap_at_beginning if gap_at_beginning < leg.height_at_beginning else leg.height_at_beginning
            )
            leg.height_at_end = gap_at_end if gap_at_end < leg.height_at_end else leg.height_at_end
            unfinished[remaining_count] = np.int64(k)
            remaining_count += 1 if fraction < 1.0 else 0
            leg.next_fraction = fraction + next_step if fraction + next_step < 1.0 else 1.0
        count = remaining_count
    for i in range(legs.shape[0]):
        terrain_legs[i].depth *= max(legs[i].run, 1.0) * terrain_legs[i].min_step / 1000.0


@inlined
def segment_pixels(to_pixel: PolyMapRecord, ax: float, ay: float, bx: float, by: float) -> Pixels:  # pragma: no cover
    """Return the pixel coordinates of the ends of a segment: column and row of a, then of b.

    to_pixel: map from east and north to column and row.
    ax, ay, bx, by: east and north of the two ends, m.
    """
    column_a, row_a = polymap(to_pixel, ax, ay)
    column_b, row_b = polymap(to_pixel, bx, by)
    return column_a, row_a, column_b, row_b
