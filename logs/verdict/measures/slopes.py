"""Measure how each leg was climbed or descended: slope, height, throttle, and the ability shown."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY, ground_slope
from flight.simulation.track import THROTTLE
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack, along_across
from logs.verdict.tolerances import (
    ABILITY_SAMPLE_INTERVAL_S,
    ABILITY_SETTLING_S,
    ABILITY_SIGMAS,
    ABILITY_WINDOW_S,
    BLEND_EXCLUSION_M,
    CLIMB_RATE_RESOLUTION_MPS,
    COURSE_ERROR_FLOOR_RAD,
    FULL_THROTTLE_FRACTION,
    IDLE_THROTTLE_FRACTION,
    MAX_ABILITY_STD_ERROR_RAD,
    MAX_CONDITION_NUMBER,
    MAX_STEADY_ACCELERATION_MPS2,
    MAX_UNSTEADINESS_RAD,
    MIN_AIRBORNE_AIRSPEED_MPS,
    MIN_COURSE_STRETCH_M,
    MIN_SLOPE_STRETCH_M,
    MIN_STRETCH_TIME_S,
    ROUGH_COURSE_ERROR_RAD,
    ROUGH_SLOPE_ERROR_RAD,
    SATURATED_FRACTION,
    SATURATED_THROTTLE_FRACTION,
    SATURATED_TIME_S,
    SLOPE_ERROR_FLOOR_RAD,
    SPEED_MEMORY_S,
    TURN_EXCLUSION_M,
    ZERO_CURRENT_A,
)
from world.arrays import Flags, Floats, Singles
from world.kernels import compiled

# ----------------------------------------------------------------------
# Course and slope of flown legs, by least squares if a leg is long enough.


@dataclass(frozen=True, slots=True)
class LegFit:
    """A measured course or slope of a leg.

    value, tolerance: rad.
    run: m over which it was measured.
    fitted: by least squares over a long enough piece; the value of a short leg is rough.
    """

    value: float
    tolerance: float
    run: float
    fitted: bool


def fit_line(x: Floats, y: Floats) -> tuple[float, float]:
    """Return the slope of the least-squares line of y on x, and the RMS of its residuals.  x must vary."""
    dx, dy = x - x.mean(), y - y.mean()
    slope = float((dx * dy).sum() / (dx * dx).sum())
    return slope, float(np.sqrt(np.mean((dy - slope * dx) ** 2)))


def straight_span(
    requirements: RouteRequirements, leg: int, clear: float, *, level: bool = False
) -> tuple[float, float]:
    """Return the span of a leg (m from its start) that lies clear of the turns at its ends.

    clear: distance kept from the turns, m.
    level: exclude the blends of slope too.
    """
    start, end = clear, clear
    if level:
        start, end = (max(clear, float(blend) + BLEND_EXCLUSION_M) for blend in requirements.blend[leg : leg + 2])
    low = requirements.after[leg] + (start if leg > 0 else min(clear, BLEND_EXCLUSION_M))
    return low, requirements.runs[leg] - requirements.before[leg + 1] - (end if leg + 1 < requirements.legs else 0.0)


def leg_course(requirements: RouteRequirements, aligned: AlignedTrack, leg: int) -> LegFit | None:
    """Return the course on which a leg was flown, or None if too little of it was flown."""
    if not aligned.flew(leg):
        return None
    rows = aligned.leg_rows(leg)
    along, across = along_across(requirements, leg, aligned.track.position[rows])
    low, high = straight_span(requirements, leg, TURN_EXCLUSION_M)
    inside = (along >= low) & (along <= high)
    if inside.sum() >= 20 and np.ptp(along[inside]) >= MIN_COURSE_STRETCH_M:
        bend, rest = fit_line(along[inside], across[inside])
        run = float(np.ptp(along[inside]))
        return LegFit(
            requirements.courses[leg] + math.atan(bend), _angle_tolerance(COURSE_ERROR_FLOOR_RAD, rest, run), run, True
        )
    # A short leg: the mean course between its turns, over at least a second.
    low, high = straight_span(requirements, leg, 0.0)
    between = np.flatnonzero((along >= low) & (along <= high))
    if not between.size:
        middle = (
            0.5 * (low + high) if math.isfinite(low) and math.isfinite(high) else 0.5 * float(requirements.runs[leg])
        )
        between = np.array([np.argmin(np.abs(along - middle))])
    first, last = rows.start + int(between[0]), rows.start + int(between[-1])
    if aligned.track.time[last] - aligned.track.time[first] < 1.0:
        wide = aligned.around(first, last, 0.5)
        first, last = wide.start, wide.stop - 1
    # In the frame of the course column, which is unwrapped, so that a full circle shows.
    return LegFit(float(aligned.course[first : last + 1].mean()), ROUGH_COURSE_ERROR_RAD, float(np.ptp(along)), False)


def leg_slope(requirements: RouteRequirements, aligned: AlignedTrack, leg: int) -> LegFit | None:
    """Return the slope at which a leg was flown, or None if less than a second of it was flown."""
    if not aligned.flew(leg):
        return None
    rows = aligned.leg_rows(leg)
    position = aligned.track.position[rows]
    along, _ = along_across(requirements, leg, position)
    low, high = straight_span(requirements, leg, TURN_EXCLUSION_M, level=True)
    inside = (along >= low) & (along <= high)
    if inside.sum() >= 20 and np.ptp(along[inside]) >= MIN_SLOPE_STRETCH_M:
        rise, rest = fit_line(along[inside], position[inside, 2])
        run = float(np.ptp(along[inside]))
        return LegFit(math.atan(rise), _angle_tolerance(SLOPE_ERROR_FLOOR_RAD, rest, run), run, True)
    time = aligned.track.time[rows]
    if time[-1] - time[0] < 1.0:
        return None
    # A short leg: the least-squares slope of at least four seconds about its midpoint, or of the whole leg if shorter.
    middle = float(np.interp(0.5 * requirements.runs[leg], np.maximum.accumulate(along), time))
    start = min(
        max(middle - 0.5 * MIN_STRETCH_TIME_S, float(time[0])),
        max(float(time[0]), float(time[-1]) - MIN_STRETCH_TIME_S),
    )
    window = (time >= start) & (time <= start + MIN_STRETCH_TIME_S)
    run_at = aligned.distance_run[rows][window]
    if run_at.size < 2 or np.ptp(run_at) < 1.0:
        return None
    rise, _ = fit_line(run_at, position[window, 2])
    return LegFit(math.atan(rise), ROUGH_SLOPE_ERROR_RAD, float(np.ptp(run_at)), False)


def _angle_tolerance(floor: float, rest: float, run: float) -> float:
    """Return the tolerance of a fitted angle: residuals at the ends of the run rotate the line."""
    return min(floor + math.atan2(2.0 * rest, run), MAX_UNSTEADINESS_RAD)


@dataclass(frozen=True, slots=True)
class Ability:
    """Steepest climb, or dive, that the aircraft showed at a throttle limit.

    slope: over the ground, at the leg's commanded airspeed in the mean wind, rad, positive in the direction of the leg.
    error: standard error of the slope, rad.
    seconds: duration over which it was seen.
    """

    slope: float
    error: float
    seconds: float

    def covers(self, planned: float) -> bool:
        """Return True if the ability exceeds a leg's slope (rad) by more than its own error."""
        return self.slope - ABILITY_SIGMAS * self.error > abs(planned)


@dataclass(frozen=True, slots=True)
class SlopeMeasure:
    """Measured climb or descent of one leg; None in a field if the leg was not flown.

    slope: as fitted.
    height_error: m, largest distance above (negative: below) the leg's line.
    short: True if no part of the leg is clear of the blends.
    at_full, at_idle: s with the throttle at its limits.
    slow, fast: m/s, the largest mean airspeed error below and above the command over `SATURATED_TIME_S` seconds at
        those limits, without the part that a gust explains; 0 for none.
    ability: the aircraft's ability at the throttle limit that the leg needs, if the flight reached that limit.
    finished: the leg was flown to its end.
    """

    slope: LegFit | None = None
    height_error: float | None = None
    short: bool = False
    at_full: float = 0.0
    at_idle: float = 0.0
    slow: float = 0.0
    fast: float = 0.0
    ability: Ability | None = None
    finished: bool = False


def measure_slope(requirements: RouteRequirements, aligned: AlignedTrack, leg: int) -> SlopeMeasure:
    """Measure the slope of a leg as flown."""
    if not aligned.flew(leg):
        return SlopeMeasure()
    rows = aligned.leg_rows(leg)
    error, short = _height_error(requirements, leg, aligned.track.position[rows])
    full, idle, slow, fast = _saturation_times(requirements, aligned, leg)
    return SlopeMeasure(
        slope=leg_slope(requirements, aligned, leg),
        height_error=error,
        short=short,
        at_full=full,
        at_idle=idle,
        slow=slow,
        fast=fast,
        ability=measure_ability(requirements, aligned, leg),
        finished=bool(aligned.passed[leg + 1]),
    )


def _height_error(requirements: RouteRequirements, leg: int, position: Floats) -> tuple[float | None, bool]:
    """Return the largest signed distance from the leg's line, m, and whether no part is clear of blends."""
    along, _ = along_across(requirements, leg, position)
    low, high = straight_span(requirements, leg, TURN_EXCLUSION_M, level=True)
    inside = (along >= low) & (along <= high)
    short = not inside.any()
    if short:
        low, high = straight_span(requirements, leg, 0.0)
        inside = (along >= low) & (along <= high)
        if not inside.any():
            return None, True
    line = requirements.points[leg, 2] + along[inside] * math.tan(requirements.slopes[leg])
    off = position[inside, 2] - line
    return float(off[np.argmax(np.abs(off))]), short


def steady_rows(requirements: RouteRequirements, aligned: AlignedTrack, leg: int) -> slice:
    """Return the rows of a leg after the time needed to reach its commanded speed; may be empty."""
    rows = aligned.leg_rows(leg)
    speeds = requirements.route.airspeed
    change = abs(float(speeds[leg] - speeds[leg - 1])) if leg else 0.0
    start = float(aligned.track.time[rows.start]) + change / MAX_STEADY_ACCELERATION_MPS2
    return slice(max(rows.start, int(np.searchsorted(aligned.track.time, start))), rows.stop)


def _saturation_times(
    requirements: RouteRequirements, aligned: AlignedTrack, leg: int
) -> tuple[float, float, float, float]:
    """Return seconds at full and idle throttle, and the speed lost and gained, as in `SlopeMeasure`."""
    rows = steady_rows(requirements, aligned, leg)
    track = aligned.track
    if rows.stop - rows.start < 2:
        return 0.0, 0.0, 0.0, 0.0
    tick = aligned.tick
    full, idle = _rows_at_limits(requirements, aligned, rows)
    commanded = float(requirements.route.airspeed[leg])
    error = track.airspeed[rows].astype(np.float64) - commanded
    # A gust along the track changes the airspeed without any energy, so it has to be off without the gust as well.
    steady = _speed_in_mean_wind(requirements, aligned, rows) - commanded
    width = max(1, round(SATURATED_TIME_S / tick))
    lifted = lifted_speed(aligned.track.time, aligned.track.airspeed, aligned.track.wind[:, 2], rows.stop)[rows]
    slower = np.minimum(-error, -steady) - np.maximum(0.0, -lifted)
    faster = np.minimum(error, steady) - np.maximum(0.0, lifted)
    # A log may lack the airspeed at some rows.
    known = np.isfinite(slower) & np.isfinite(faster)
    slow = _largest_mean_within(full & known, np.where(known, slower, 0.0), width)
    fast = _largest_mean_within(idle & known, np.where(known, faster, 0.0), width)
    return float(full.sum() * tick), float(idle.sum() * tick), slow, fast


def _rows_at_limits(requirements: RouteRequirements, aligned: AlignedTrack, rows: slice) -> tuple[Flags, Flags]:
    """Return masks of the rows with full throttle and of the rows with idle throttle."""
    track = aligned.track
    throttle = track.controls[rows, THROTTLE]
    full = throttle >= FULL_THROTTLE_FRACTION
    idle = throttle <= IDLE_THROTTLE_FRACTION
    # An aircraft that burns fuel draws no current at all.
    if not requirements.setup.envelope.motor_braking and track.current.any():
        idle |= (track.current[rows] <= ZERO_CURRENT_A) & ~full
    return full, idle


def measure_ability(requirements: RouteRequirements, aligned: AlignedTrack, leg: int) -> Ability | None:
    """Measure the aircraft's ability at the throttle limit that a leg needs: full to climb, idle to dive.

    Thrust less drag gives an aircraft the climb rate v_up + v . a / g, where v is its velocity relative to the air and
    a its acceleration over the ground: exact in any gust, because lift does no work.  A least-squares plane over
    airspeed and altitude gives it at the commanded airspeed and the greatest altitude at which it was seen, where an
    aircraft climbs least.
    """
    rows = steady_rows(requirements, aligned, leg)
    track, sign = aligned.track, 1.0 if requirements.slopes[leg] >= 0.0 else -1.0
    if rows.stop - rows.start < 3:
        return None
    full, idle = _rows_at_limits(requirements, aligned, rows)
    full &= track.controls[rows, THROTTLE] >= SATURATED_THROTTLE_FRACTION
    along, _ = along_across(requirements, leg, track.position[rows])
    low, high = straight_span(requirements, leg, 0.0)
    use = _rows_after(full if sign > 0.0 else idle, round(ABILITY_SETTLING_S / aligned.tick))
    use &= (along >= low) & (along <= high)
    velocity = track.velocity[rows].astype(np.float64)
    air = velocity - track.wind[rows]
    # A log may lack the wind at some rows.
    use &= np.isfinite(air).all(axis=1)
    seconds = float(use.sum() * aligned.tick)
    if seconds < ABILITY_WINDOW_S:
        return None
    push = np.gradient(velocity, track.time[rows], axis=0)
    rate = (air[:, 2] + (air * push).sum(axis=1) / GRAVITY)[use]
    commanded, up = float(requirements.route.airspeed[leg]), track.position[rows, 2][use]
    top = float(up.max())
    faster = np.sqrt((air[use] ** 2).sum(axis=1)) - commanded
    fit = _plane_at_origin(rate, faster, 0.01 * (up - top), seconds / ABILITY_SAMPLE_INTERVAL_S)
    if fit is None:
        return None
    tail, cross = requirements.setup.scenario.wind.along(float(requirements.courses[leg]), top)
    slopes = [
        ground_slope(math.asin(min(1.0, max(-1.0, value / commanded))), commanded, tail, cross)
        for value in (fit[0], fit[0] + fit[1])
    ]
    error = abs(slopes[1] - slopes[0])
    # Written so that NaN gives None.
    return Ability(sign * slopes[0], error, seconds) if error <= MAX_ABILITY_STD_ERROR_RAD else None


def _rows_after(mask: Flags, count: int) -> Flags:
    """Return the rows of ``mask`` whose ``count`` preceding rows are in the mask too."""
    row = np.arange(mask.size)
    return np.asarray(row - np.maximum.accumulate(np.where(mask, -1, row)) > count)


def _plane_at_origin(value: Floats, x: Floats, y: Floats, independent: float) -> tuple[float, float] | None:
    """Return the least-squares plane's value at x = y = 0 and its standard error, or None if singular."""
    columns = [np.ones_like(x), x] + ([y] if np.ptp(y) > 1e-3 else [])
    table = np.column_stack(columns)
    moments = table.T @ table / len(x)
    if np.linalg.cond(moments) > MAX_CONDITION_NUMBER:
        return None
    inverse = np.linalg.inv(moments)
    found = inverse @ (table.T @ value) / len(x)
    rest = value - table @ found
    return float(found[0]), math.sqrt(float((rest.var() + CLIMB_RATE_RESOLUTION_MPS**2) * inverse[0, 0]) / independent)


def _speed_in_mean_wind(requirements: RouteRequirements, aligned: AlignedTrack, rows: slice) -> Floats:
    """Return the airspeed that the aircraft would have without gusts, m/s."""
    wind, track = requirements.setup.scenario.wind, aligned.track
    mean = wind.at_each(np.ascontiguousarray(track.position[rows, 2]))
    east, north = track.velocity[rows, 0] - mean[:, 0], track.velocity[rows, 1] - mean[:, 1]
    return np.asarray(np.sqrt(east**2 + north**2 + track.velocity[rows, 2].astype(np.float64) ** 2))


@compiled
def lifted_speed(time: Floats, airspeed: Singles, rising: Singles, stop: int) -> Floats:
    """Return the airspeed gained from rising air in rows 0..stop by an aircraft that holds its path, m/s.

    The gain fades with time.
    """
    out = np.zeros(stop)
    for k in range(1, stop):
        step = time[k] - time[k - 1]
        gain = GRAVITY * rising[k] / max(MIN_AIRBORNE_AIRSPEED_MPS, airspeed[k])
        # A log may lack the airspeed or the wind at some rows.
        gain = gain if math.isfinite(gain) else 0.0
        out[k] = (out[k - 1] + gain * step) / (1.0 + step / SPEED_MEMORY_S)
    return out


def _largest_mean_within(mask: NDArray[np.bool_], value: Floats, width: int) -> float:
    """Return the largest mean of ``value`` over ``width`` rows that are mostly in ``mask``; 0 if there are none."""
    if mask.size < width:
        return 0.0
    total = np.concatenate([[0.0], np.cumsum(value)])
    count = np.concatenate([[0], np.cumsum(mask)])
    means = (total[width:] - total[:-width]) / width
    held = count[width:] - count[:-width] >= SATURATED_FRACTION * width
    return max(0.0, float(means[held].max())) if held.any() else 0.0
