"""Measure how each leg was climbed or descended.

Measures are slope, altitude error, throttle, and climb and sink ability.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY, ground_slope
from flight.simulation.track import PITCH, THROTTLE
from logs.verdict.measures.ground_following import demanded_altitudes, follows_ground
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack, project_onto_leg
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
    MIN_COURSE_STRETCH_M,
    MIN_SLOPE_STRETCH_M,
    MIN_STRETCH_TIME_S,
    PITCH_LIMIT_TOLERANCE_RAD,
    ROUGH_COURSE_ERROR_RAD,
    ROUGH_SLOPE_ERROR_RAD,
    SATURATED_FRACTION,
    SATURATED_THROTTLE_FRACTION,
    SATURATED_TIME_S,
    SLOPE_ERROR_FLOOR_RAD,
    TURN_EXCLUSION_M,
    ZERO_CURRENT_A,
)
from world.arrays import Flags, Floats

# ----------------------------------------------------------------------
# Course and slope of flown legs, by least squares if a leg is long enough.


@dataclass(frozen=True, slots=True)
class LegFit:
    """Measured course or slope of a leg.

    value, tolerance: course or slope, and its tolerance, rad.
    length: distance over which it was measured, m.
    is_fitted: True if fitted by least squares over a long enough piece; the value of a short leg is rough.
    """

    value: float
    tolerance: float
    length: float
    is_fitted: bool


def fit_line(x: Floats, y: Floats) -> tuple[float, float]:
    """Fit a line y(x) by least squares; return its slope and the RMS residual.

    x, y: (n,); x must not be constant.
    """
    dx, dy = x - x.mean(), y - y.mean()
    slope = float((dx * dy).sum() / (dx * dx).sum())
    return slope, float(np.sqrt(np.mean((dy - slope * dx) ** 2)))


def straight_span(
    requirements: RouteRequirements, leg: int, clearance: float, *, excludes_blends: bool = False
) -> tuple[float, float]:
    """Return start and end of the straight part of a leg between its turns, m from the leg's start.

    The end is before the start if the leg has no such part.

    clearance: distance kept from the turns, m.
    excludes_blends: if True, the blends are excluded, too: the parts next to the turns where the slope still changes.
    """
    start_clearance, end_clearance = clearance, clearance
    if excludes_blends:
        start_clearance, end_clearance = (
            max(clearance, float(blend) + BLEND_EXCLUSION_M) for blend in requirements.blend[leg : leg + 2]
        )
    span_start = requirements.length_after[leg] + (start_clearance if leg > 0 else min(clearance, BLEND_EXCLUSION_M))
    return span_start, requirements.runs[leg] - requirements.length_before[leg + 1] - (
        end_clearance if leg + 1 < requirements.legs else 0.0
    )


def leg_course(requirements: RouteRequirements, aligned: AlignedTrack, leg: int) -> LegFit | None:
    """Return a leg's flown course, or None if the leg was not flown.

    If the leg is too short for a fit, its course is the mean over at least one second, with a larger tolerance.
    """
    if not aligned.has_flown(leg):
        return None
    rows = aligned.leg_rows(leg)
    distance_along, lateral_offset = project_onto_leg(requirements, leg, aligned.track.position[rows])
    span_start, span_end = straight_span(requirements, leg, TURN_EXCLUSION_M)
    is_inside = (distance_along >= span_start) & (distance_along <= span_end)
    # A fit needs at least 20 rows.
    if is_inside.sum() >= 20 and np.ptp(distance_along[is_inside]) >= MIN_COURSE_STRETCH_M:
        cross_slope, residual = fit_line(distance_along[is_inside], lateral_offset[is_inside])
        distance = float(np.ptp(distance_along[is_inside]))
        return LegFit(
            requirements.courses[leg] + math.atan(cross_slope),
            _angle_tolerance(COURSE_ERROR_FLOOR_RAD, residual, distance),
            distance,
            is_fitted=True,
        )
    # The course of a short leg is the mean between its turns, over at least one second.
    span_start, span_end = straight_span(requirements, leg, 0.0)
    indices = np.flatnonzero((distance_along >= span_start) & (distance_along <= span_end))
    if not indices.size:
        midpoint = (
            0.5 * (span_start + span_end)
            if math.isfinite(span_start) and math.isfinite(span_end)
            else 0.5 * float(requirements.runs[leg])
        )
        indices = np.array([np.argmin(np.abs(distance_along - midpoint))])
    first, last = rows.start + int(indices[0]), rows.start + int(indices[-1])
    margin = 0.5 if aligned.track.time[last] - aligned.track.time[first] < 1.0 else 0.0
    # The course column is unwrapped, so a full circle shows as a course change of 360 degrees.
    return LegFit(
        float(aligned.course[aligned.rows_around(first, last, margin)].mean()),
        ROUGH_COURSE_ERROR_RAD,
        float(np.ptp(distance_along)),
        is_fitted=False,
    )


def leg_slope(requirements: RouteRequirements, aligned: AlignedTrack, leg: int) -> LegFit | None:
    """Return a leg's flown slope, or None if less than a second or less than a metre of the leg was flown.

    The slope of a leg that is too short for a fit between its blends has a larger tolerance.  Blends are the parts next
    to the turns on which the slope changes.
    """
    if not aligned.has_flown(leg):
        return None
    rows = aligned.leg_rows(leg)
    position = aligned.track.position[rows]
    distance_along, _ = project_onto_leg(requirements, leg, position)
    span_start, span_end = straight_span(requirements, leg, TURN_EXCLUSION_M, excludes_blends=True)
    is_inside = (distance_along >= span_start) & (distance_along <= span_end)
    # A fit needs at least 20 rows.
    if is_inside.sum() >= 20 and np.ptp(distance_along[is_inside]) >= MIN_SLOPE_STRETCH_M:
        slope, residual = fit_line(distance_along[is_inside], position[is_inside, 2])
        distance = float(np.ptp(distance_along[is_inside]))
        return LegFit(
            math.atan(slope), _angle_tolerance(SLOPE_ERROR_FLOOR_RAD, residual, distance), distance, is_fitted=True
        )
    time = aligned.track.time[rows]
    if time[-1] - time[0] < 1.0:
        return None
    # The slope of a short leg is fitted over `MIN_STRETCH_TIME_S` around its midpoint, or over the whole leg.
    middle_time = float(np.interp(0.5 * requirements.runs[leg], np.maximum.accumulate(distance_along), time))
    start = min(
        max(middle_time - 0.5 * MIN_STRETCH_TIME_S, float(time[0])),
        max(float(time[0]), float(time[-1]) - MIN_STRETCH_TIME_S),
    )
    is_in_window = (time >= start) & (time <= start + MIN_STRETCH_TIME_S)
    distance_run = aligned.distance_run[rows][is_in_window]
    if distance_run.size < 2 or np.ptp(distance_run) < 1.0:
        return None
    slope, _ = fit_line(distance_run, position[is_in_window, 2])
    return LegFit(math.atan(slope), ROUGH_SLOPE_ERROR_RAD, float(np.ptp(distance_run)), is_fitted=False)


def _angle_tolerance(floor: float, residual: float, distance: float) -> float:
    """Return the tolerance (rad) of an angle fitted over a distance (m) with an RMS residual (m).

    The tolerance is `floor` (rad) plus the angle of a line that deviates by twice the RMS residual over the distance.
    It is at most `MAX_UNSTEADINESS_RAD`.
    """
    return min(floor + math.atan2(2.0 * residual, distance), MAX_UNSTEADINESS_RAD)


@dataclass(frozen=True, slots=True)
class Ability:
    """Steepest climb or descent that the aircraft showed at a throttle limit.

    slope: slope over the ground at the leg's commanded airspeed in the mean wind, rad; positive in the direction that
        the leg needs, up or down.
    error: standard error of the slope, rad.
    duration: time at the throttle limit over which the slope was measured, s.
    """

    slope: float
    error: float
    duration: float

    def exceeds(self, leg_slope: float) -> bool:
        """Return True if the ability exceeds a leg's slope (rad) by more than its own error."""
        return self.slope - ABILITY_SIGMAS * self.error > abs(leg_slope)


@dataclass(frozen=True, slots=True)
class SlopeMeasure:
    """Measured climb or descent of one leg; a field is None if it could not be measured.

    slope: measured slope over the ground.
    height_error: largest distance above the leg's line, or above the height over the ground that the leg follows, m;
        negative below.
    is_short: True if no part of the leg is clear of the blends.
    full_throttle_time, idle_throttle_time: time with the throttle at its limits, s.
    speed_loss, speed_gain: largest mean airspeed error below and above the command over `SATURATED_TIME_S` seconds at
        these limits, m/s, without the part that a gust explains.
    pitch_limit_time: time with the pitch at the autopilot's upper limit, s.
    ability: the aircraft's ability at the throttle limit that the leg needs, if the flight reached that limit.
    is_finished: True if the leg was flown to its end.
    """

    slope: LegFit | None = None
    height_error: float | None = None
    is_short: bool = False
    full_throttle_time: float = 0.0
    idle_throttle_time: float = 0.0
    speed_loss: float = 0.0
    speed_gain: float = 0.0
    pitch_limit_time: float = 0.0
    ability: Ability | None = None
    is_finished: bool = False


def measure_slope(requirements: RouteRequirements, aligned: AlignedTrack, leg: int) -> SlopeMeasure:
    """Measure the climb or descent on a leg; all fields have their defaults if the leg was not flown."""
    if not aligned.has_flown(leg):
        return SlopeMeasure()
    rows = aligned.leg_rows(leg)
    # Largest altitude error: from the leg's line outside the blends, or between the turns if the leg has only blends.
    # A leg that follows the ground is compared with its demanded height above known ground, between the turns.
    position, is_over_ground = aligned.track.position[rows], follows_ground(requirements, leg)
    distance_along, _ = project_onto_leg(requirements, leg, position)
    span_start, span_end = straight_span(requirements, leg, TURN_EXCLUSION_M, excludes_blends=True)
    is_inside = (distance_along >= span_start) & (distance_along <= span_end)
    is_short = not is_over_ground and not is_inside.any()
    if is_over_ground or is_short:
        span_start, span_end = straight_span(requirements, leg, 0.0)
        is_inside = (distance_along >= span_start) & (distance_along <= span_end)
    demanded = requirements.points[leg, 2] + distance_along[is_inside] * math.tan(requirements.slopes[leg])
    if is_over_ground:
        demanded = demanded_altitudes(requirements, leg, position[is_inside])
    errors = position[is_inside, 2] - demanded
    errors = errors[np.isfinite(errors)] if is_over_ground else errors
    height_error = float(errors[np.argmax(np.abs(errors))]) if errors.size else None
    track, steady = aligned.track, steady_rows(requirements, aligned, leg)
    full_time = idle_time = speed_loss = speed_gain = 0.0
    if steady.stop - steady.start >= 2:
        is_at_full, is_at_idle = _rows_at_limits(requirements, aligned, steady)
        full_time, idle_time = float(is_at_full.sum() * aligned.tick), float(is_at_idle.sum() * aligned.tick)
        commanded = float(requirements.route.leg_airspeeds[leg])
        error = track.airspeed[steady].astype(np.float64) - commanded
        # A gust along the track changes the airspeed but not the energy.  An airspeed error is therefore no larger than
        # the error that the aircraft would have in the mean wind.
        mean_wind = requirements.setup.scenario.wind_velocities(track.position[steady], track.time[steady])
        east, north = (track.velocity[steady, :2] - mean_wind[:, :2]).T
        up = track.velocity[steady, 2].astype(np.float64)
        gust_free_error = np.asarray(np.sqrt(east**2 + north**2 + up**2)) - commanded
        lift_gain = aligned.lift_gain[steady]
        speed_deficit = np.minimum(-error, -gust_free_error) - np.maximum(0.0, -lift_gain)
        speed_excess = np.minimum(error, gust_free_error) - np.maximum(0.0, lift_gain)
        # A log may lack the airspeed in some rows.
        is_known = np.isfinite(speed_deficit) & np.isfinite(speed_excess)
        row_count = max(1, round(SATURATED_TIME_S / aligned.tick))
        speed_loss = _max_mean_in_mask(is_at_full & is_known, np.where(is_known, speed_deficit, 0.0), row_count)
        speed_gain = _max_mean_in_mask(is_at_idle & is_known, np.where(is_known, speed_excess, 0.0), row_count)
    # Time with the pitch at the autopilot's upper limit, s; an imported flight has no such limit.
    pitch_limit_time = 0.0
    if requirements.setup.imported_log is None:
        pitch = track.attitude[rows, PITCH]
        min_pitch = requirements.setup.autopilot.speeds.max_pitch - PITCH_LIMIT_TOLERANCE_RAD
        pitch_limit_time = float((pitch >= min_pitch).sum() * aligned.tick)
    return SlopeMeasure(
        slope=leg_slope(requirements, aligned, leg),
        height_error=height_error,
        is_short=is_short,
        full_throttle_time=full_time,
        idle_throttle_time=idle_time,
        speed_loss=speed_loss,
        speed_gain=speed_gain,
        pitch_limit_time=pitch_limit_time,
        ability=measure_ability(requirements, aligned, leg),
        is_finished=bool(aligned.passed[leg + 1]),
    )


def steady_rows(requirements: RouteRequirements, aligned: AlignedTrack, leg: int) -> slice:
    """Return the rows of a leg after the change to its commanded airspeed; may be empty."""
    rows = aligned.leg_rows(leg)
    speeds = requirements.route.leg_airspeeds
    change = abs(float(speeds[leg] - speeds[leg - 1])) if leg else 0.0
    start = float(aligned.track.time[rows.start]) + change / MAX_STEADY_ACCELERATION_MPS2
    return slice(max(rows.start, int(np.searchsorted(aligned.track.time, start))), rows.stop)


def _rows_at_limits(requirements: RouteRequirements, aligned: AlignedTrack, rows: slice) -> tuple[Flags, Flags]:
    """Return masks of the rows with full throttle and of the rows with idle throttle, (n,) each.

    Full throttle means the autopilot's upper throttle limit.  If the aircraft's motor does not brake, rows without
    motor current also have idle throttle.
    """
    track = aligned.track
    throttle = track.controls[rows, THROTTLE]
    is_full = throttle >= FULL_THROTTLE_FRACTION * requirements.setup.autopilot.speeds.max_throttle
    is_idle = throttle <= IDLE_THROTTLE_FRACTION
    if not requirements.setup.envelope.motor_braking and aligned.draws_current:
        is_idle |= (track.current[rows] <= ZERO_CURRENT_A) & ~is_full
    return is_full, is_idle


def measure_ability(requirements: RouteRequirements, aligned: AlignedTrack, leg: int) -> Ability | None:
    """Measure the steepest climb or descent that the aircraft can fly at the throttle limit on a leg.

    The limit is full throttle in a climb and idle throttle in a descent.  Return None if the throttle was at the limit
    for too short a time, or if the standard error is too large.

    The excess of thrust over drag corresponds to the climb rate v_up + v . a / g, with the velocity v relative to the
    air and the acceleration a over the ground.  This is exact in any gust, because lift does no work.  A plane is
    fitted to the climb rate over airspeed and altitude, and evaluated at the commanded airspeed and the highest
    altitude, where an aircraft climbs least.
    """
    rows = steady_rows(requirements, aligned, leg)
    track, sign = aligned.track, 1.0 if requirements.slopes[leg] >= 0.0 else -1.0
    if rows.stop - rows.start < 3:
        return None
    is_at_full, is_at_idle = _rows_at_limits(requirements, aligned, rows)
    max_throttle = requirements.setup.autopilot.speeds.max_throttle
    is_at_full &= track.controls[rows, THROTTLE] >= SATURATED_THROTTLE_FRACTION * max_throttle
    distance_along, _ = project_onto_leg(requirements, leg, track.position[rows])
    span_start, span_end = straight_span(requirements, leg, 0.0)
    # Rows that are saturated, as are all rows of the settling time before them.
    is_saturated = is_at_full if sign > 0.0 else is_at_idle
    row_numbers = np.arange(is_saturated.size)
    is_measured = np.asarray(
        row_numbers - np.maximum.accumulate(np.where(is_saturated, -1, row_numbers))
        > round(ABILITY_SETTLING_S / aligned.tick)
    )
    is_measured &= (distance_along >= span_start) & (distance_along <= span_end)
    velocity = track.velocity[rows].astype(np.float64)
    air_velocity = velocity - track.wind[rows]
    # A log may lack the wind in some rows.
    is_measured &= np.isfinite(air_velocity).all(axis=1)
    duration = float(is_measured.sum() * aligned.tick)
    if duration < ABILITY_WINDOW_S:
        return None
    acceleration = np.gradient(velocity, track.time[rows], axis=0)
    climb_rate = (air_velocity[:, 2] + (air_velocity * acceleration).sum(axis=1) / GRAVITY)[is_measured]
    commanded_speed = float(requirements.route.leg_airspeeds[leg])
    altitude = track.position[rows, 2][is_measured]
    top_altitude = float(altitude.max())
    excess_speed = np.sqrt((air_velocity[is_measured] ** 2).sum(axis=1)) - commanded_speed
    # The altitude is in units of 100 m, so that both regressors are of similar size.
    rate_fit = _fit_plane_at_origin(
        climb_rate, excess_speed, 0.01 * (altitude - top_altitude), duration / ABILITY_SAMPLE_INTERVAL_S
    )
    if rate_fit is None:
        return None
    tailwind, crosswind = requirements.wind_on(leg).components_on_course(float(requirements.courses[leg]), top_altitude)
    # The slope at the fitted climb rate, and the slope at a climb rate that is one standard error higher.
    slopes = [
        ground_slope(math.asin(min(1.0, max(-1.0, value / commanded_speed))), commanded_speed, tailwind, crosswind)
        for value in (rate_fit[0], rate_fit[0] + rate_fit[1])
    ]
    error = abs(slopes[1] - slopes[0])
    # The comparison with a NaN error is False, so the result is then None.
    return Ability(sign * slopes[0], error, duration) if error <= MAX_ABILITY_STD_ERROR_RAD else None


def _fit_plane_at_origin(value: Floats, x: Floats, y: Floats, sample_count: float) -> tuple[float, float] | None:
    """Fit a plane value(x, y); return its value at x = y = 0 and the standard error of this value.

    Return None if the data do not determine the plane.  A y that hardly varies is left out of the fit.
    sample_count: number of independent samples among the values.
    """
    columns = [np.ones_like(x), x] + ([y] if np.ptp(y) > 1e-3 else [])
    design_matrix = np.column_stack(columns)
    moments = design_matrix.T @ design_matrix / len(x)
    if np.linalg.cond(moments) > MAX_CONDITION_NUMBER:
        return None
    inverse = np.linalg.inv(moments)
    coefficients = inverse @ (design_matrix.T @ value) / len(x)
    residuals = value - design_matrix @ coefficients
    return float(coefficients[0]), math.sqrt(
        float((residuals.var() + CLIMB_RATE_RESOLUTION_MPS**2) * inverse[0, 0]) / sample_count
    )


def _max_mean_in_mask(mask: NDArray[np.bool_], value: Floats, width: int) -> float:
    """Return the largest mean of `value` over `width` consecutive rows of which most have a True `mask`.

    "Most" means at least the fraction `SATURATED_FRACTION`.  Return 0 without such rows, or if the mean is negative.
    """
    if mask.size < width:
        return 0.0
    sums = np.concatenate([[0.0], np.cumsum(value)])
    counts = np.concatenate([[0], np.cumsum(mask)])
    means = (sums[width:] - sums[:-width]) / width
    is_mostly_in_mask = counts[width:] - counts[:-width] >= SATURATED_FRACTION * width
    return max(0.0, float(means[is_mostly_in_mask].max())) if is_mostly_in_mask.any() else 0.0
