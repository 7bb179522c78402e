"""Check the quantities of a log against each other, to find wrong signs, frames, units and clocks."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from logs.importers.columns.clock_shift import correlate
from logs.importers.columns.column_log import ColumnLog, Series
from world.arrays import Floats
from world.errors import LogError

# Interval of the grid on which quantities are compared, s; rates are means over it.
_STEP_S = 0.5
# Shortest pause between samples of the ground speed that shows that the recorder stopped, s.
_MIN_GAP_S = 5.0
# Ground speed above which the aircraft flies, m/s.
_FLYING_MPS = 6.0
# Minimum absolute correlation at which two measurements clearly agree or contradict each other.
_CLEAR_CORRELATION = 0.6
# Largest ratio between two measurements of one quantity, in either direction.  The ratio of ft/s to km/h is 1.10, of
# mph to kt 1.15, and of km/h to kt 1.85.
_MAX_RATIO = 1.25
# Shifts at which two measurements of one quantity are compared, s.
_SHIFTS_S = np.arange(-5.0, 5.01, 0.25)
# Shortest shift that is reported as a delay, s; receivers and estimators lag inertial sensors by up to 0.3 s.
_LATE_S = 0.5
# Minimum correlation at the best shift for a delay to be reported.
_SHIFTED_CORRELATION = 0.8
# Largest ratio of the unexplained variance at the best shift to the one without a shift, for a delay to be reported.
_SHIFTED_RESIDUAL = 0.5
# Time after which a sensor that repeats one value is stuck, s.
_FROZEN_S = 20.0
# That time for coarsely rounded values, as a multiple of the 95th percentile of the times between changes.
_FROZEN_RUNS = 10.0
# Smallest mean wind whose direction is checked, m/s.
_CLEAR_WIND_MPS = 2.5
# Accepted range of the logged wind's component along the wind that follows from ground velocity, airspeed and heading,
# relative to that wind.
_WIND_RATIO_RANGE = (0.4, 1.7)
# Smallest number of rows in flight that are compared.
_MIN_ROWS = 40
# Range of the median specific force along the axis down in flight, m/s^2; a circle at 60 degrees of bank has -19.6.
_FORCE_RANGE_MPS2 = (-20.0, -4.0)
# Limit of the absolute mean of exp(i angle), which is 1 for a constant angle and about 0 for an angle that takes all
# values.  A larger mean of course minus heading shows that both turn together; a larger mean of the heading shows that
# the flight has no turns.
_CLEAR_ALIGNMENT = 0.7
# Largest mean angle between heading and ground course, rad.
_MAX_HEADING_DIFFERENCE_RAD = math.radians(50.0)
# Gravity, m/s^2.
_GRAVITY_MPS2 = 9.80665
# Interval over which positions are compared with velocities, s; a position that is rounded to 11 m (four decimals of a
# degree) still shows the velocity.
_PLACE_STEP_S = 2.0
# Quantities whose noise never stops in flight; a latitude, an altitude or a ground speed can stay constant.
_SENSORS = (
    *("roll", "pitch", "yaw", "roll_rate", "pitch_rate", "yaw_rate", "airspeed", "current"),
    *("acceleration_forward", "acceleration_right", "acceleration_down"),
)
# A quantity must follow the partner of its pair if one of them has a larger standard deviation than this, SI units and
# rad.  The lateral acceleration is not listed: in a turn without sideslip it is less than the noise of a receiver's
# velocities.
_LEAST_MOTIONS = {
    **dict.fromkeys(("roll_rate", "pitch_rate", "yaw_rate"), math.radians(1.0)),
    **dict.fromkeys(("velocity_north", "velocity_east", "velocity_down"), 1.0),
    **dict.fromkeys(("acceleration_forward", "acceleration_down"), 1.0),
}
# Minimum correlation of these quantities with their partners.
_LEAST_CORRELATION = 0.5
# Largest ratio between the airspeed and the airspeed from ground velocity and heading; air density and position error
# explain a ratio of 1.2.
_MAX_AIRSPEED_RATIO = 1.35
# Smallest median airspeed in flight, m/s.
_MIN_AIRSPEED_MPS = 2.0
# Smallest range of a throttle that moves, as a fraction.
_MIN_THROTTLE_RANGE = 0.01
# Smallest range of the current, from its 5th to its 95th percentile, that only the throttle can cause, A.
_MIN_CURRENT_RANGE_A = 3.0
_EARTH_RADIUS_M = 6_371_008.8


class _Pair(NamedTuple):
    """A logged quantity, and the values that other logged quantities (its partner) give for it.

    quantity: the quantity that is checked.
    partner: name of the other quantities in messages, such as "the change of altitude".
    series: values of the quantity.
    expected: values that follow from the partner, at the times of the grid, (n,).
    exact: True if both must be equal, False if they only vary together.
    simultaneous: True if both vary at the same time, False if one follows the other with a delay.
    """

    quantity: str
    partner: str
    series: Series
    expected: Floats
    exact: bool = True
    simultaneous: bool = True


def check_signs_and_units(log: ColumnLog) -> None:
    """Raise LogError for the first quantity of a log that contradicts the others.

    The message names the key of the table to check.  Nothing is checked for a log with too few rows in flight.
    """
    grid = _make_flying_grid(log)
    if len(grid) < _MIN_ROWS:
        return
    for quantity in _SENSORS:
        if quantity in log.table.columns and all(entry.value is None for entry in log.table.columns[quantity]):
            _check_not_frozen(log, quantity, grid)
    for pair in _list_pairs(log, grid):
        _check_pair(log, pair, grid)
    if log.has("acceleration_down"):
        force = float(np.median(_average_on_grid(log.series("acceleration_down"), grid)))
        low, high = _FORCE_RANGE_MPS2
        if not low <= force <= high:
            entry = log.table.columns["acceleration_down"][0]
            hint = "check sign and frame" if -high <= force <= -low else f"check unit ({entry.unit}) and scale"
            allowed = f"expected {low:g} to {high:g} m/s2 (specific force down, -9.8 at rest): {hint}"
            raise LogError.at(
                log.table_path, "columns.acceleration_down", f"{entry.column} is {force:.3g} m/s2 in flight", allowed
            )
    if log.has("yaw") and (velocity := _find_ground_velocity(log, grid)) is not None:
        # The heading is far from the ground course, or turns in the opposite direction.
        course, yaw = np.angle(velocity), _average_on_grid(log.series("yaw"), grid, wraps=True)
        same, reversed_yaw = (complex(np.mean(np.exp(1j * (course - sign * yaw)))) for sign in (1.0, -1.0))
        difference = math.degrees(math.atan2(same.imag, same.real))
        message = ""
        if abs(same) > _CLEAR_ALIGNMENT and abs(math.radians(difference)) > _MAX_HEADING_DIFFERENCE_RAD:
            message = f"differs by {difference:.0f} deg from the ground course on average"
        elif abs(reversed_yaw) > _CLEAR_ALIGNMENT > abs(same):
            message = "turns opposite to the ground course"
        if message:
            raise _make_contradiction_error(log, "yaw", message, "check sign, frame and offset")
    if log.has("throttle", "current"):
        throttle, current = (_average_on_grid(log.series(name), grid) for name in ("throttle", "current"))
        low, high = np.percentile(current, [5.0, 95.0]).tolist()
        if np.ptp(throttle) < _MIN_THROTTLE_RANGE and high - low > _MIN_CURRENT_RANGE_A:
            message = f"stays at {throttle[0]:.3g} in flight while the current goes from {low:.3g} to {high:.3g} A"
            raise _make_contradiction_error(log, "throttle", message, "check the column")
    if log.has("airspeed"):
        _check_airspeed(log, grid)
    for pair in _list_pairs(log, grid):
        _check_delay(log, pair, grid)


def _make_flying_grid(log: ColumnLog) -> Floats:
    """Return the times of a regular grid at which the aircraft flies and the log has rows, s, (n,).

    The grid is empty for a log that has neither the ground velocity nor the ground speed.
    """
    if log.has("velocity_north", "velocity_east"):
        north, east = log.series("velocity_north"), log.series("velocity_east")
        speed = Series(north.time, np.hypot(north.values, np.interp(north.time, *_select_finite_rows(east))))
    elif log.has("ground_speed"):
        speed = log.series("ground_speed")
    else:
        return np.zeros(0)
    time, values = _select_finite_rows(speed)
    if len(time) < 2:
        return np.zeros(0)
    grid = np.arange(time[0], time[-1], _STEP_S)
    next_rows = np.clip(np.searchsorted(time, grid, side="right"), 1, len(time) - 1)
    is_recorded = time[next_rows] - time[next_rows - 1] < _MIN_GAP_S
    return np.asarray(grid[is_recorded & (np.interp(grid, time, values) > _FLYING_MPS)])


def _select_finite_rows(series: Series) -> tuple[Floats, Floats]:
    """Return the times (s) and the values of the rows of a series that have a finite value."""
    is_known = np.isfinite(series.values)
    return series.time[is_known], series.values[is_known]


def _average_on_grid(series: Series, grid: Floats, *, wraps: bool = False) -> Floats:
    """Return the mean of a series over an interval of `_STEP_S` around each time of a grid, (n,).

    For an interval without rows, it is the interpolated value.

    wraps: True for an angle that jumps at full turns; the jumps are removed.
    """
    time, values = _select_finite_rows(series)
    values = np.unwrap(values) if wraps else values
    sums = np.concatenate([[0.0], np.cumsum(values)])
    start_rows, end_rows = (np.searchsorted(time, grid + side * 0.5 * _STEP_S) for side in (-1.0, 1.0))
    means = (sums[end_rows] - sums[start_rows]) / np.maximum(1, end_rows - start_rows)
    return np.asarray(np.where(end_rows > start_rows, means, np.interp(grid, time, values)))


def _differentiate_on_grid(series: Series, grid: Floats, *, wraps: bool = False, step: float = _STEP_S) -> Floats:
    """Return the rate of change of a series at each time of a grid, per second, (n,).

    wraps: True for an angle that jumps at full turns; the jumps are removed.
    step: interval around each time over which the rate is computed, s.
    """
    time, values = _select_finite_rows(series)
    values = np.unwrap(values) if wraps else values
    later, earlier = (np.interp(grid + side * 0.5 * step, time, values) for side in (1.0, -1.0))
    return np.asarray((later - earlier) / step)


def _list_pairs(log: ColumnLog, grid: Floats) -> Iterator[_Pair]:
    """Yield a pair for each quantity that other quantities of the log determine; see `_Pair`."""
    if log.has("velocity_down", "altitude"):
        sink = -_differentiate_on_grid(log.series("altitude"), grid)
        yield _Pair("velocity_down", "the change of altitude", log.series("velocity_down"), sink)
    if log.has("latitude", "longitude", "velocity_north", "velocity_east"):
        latitude = log.series("latitude")
        north = _differentiate_on_grid(latitude, grid, step=_PLACE_STEP_S) * _EARTH_RADIUS_M
        yield _Pair("velocity_north", "the change of latitude", log.series("velocity_north"), north)
        east = _differentiate_on_grid(log.series("longitude"), grid, wraps=True, step=_PLACE_STEP_S) * _EARTH_RADIUS_M
        east = east * np.cos(_average_on_grid(latitude, grid))
        yield _Pair("velocity_east", "the change of longitude", log.series("velocity_east"), east)
    if log.has("roll", "pitch", "yaw"):
        # Each body rate follows from the change of the angles, and the turn rate from roll.
        angles = {name: log.series(name) for name in ("roll", "pitch", "yaw")}
        roll, pitch, yaw = (_average_on_grid(series, grid, wraps=True) for series in angles.values())
        roll_change, pitch_change, yaw_change = (
            _differentiate_on_grid(series, grid, wraps=True) for series in angles.values()
        )
        rates = {
            "roll_rate": roll_change - yaw_change * np.sin(pitch),
            "pitch_rate": pitch_change * np.cos(roll) + yaw_change * np.cos(pitch) * np.sin(roll),
            "yaw_rate": yaw_change * np.cos(pitch) * np.cos(roll) - pitch_change * np.sin(roll),
        }
        for name, values in rates.items():
            if log.has(name):
                yield _Pair(name, "the change of roll, pitch and yaw", log.series(name), values)
        yield _Pair("roll", "the turn rate from yaw", angles["roll"], yaw_change, exact=False, simultaneous=False)
    if log.has("throttle", "current"):
        current = _average_on_grid(log.series("current"), grid)
        yield _Pair("throttle", "the current", log.series("throttle"), current, exact=False)
    if log.has("pitch", "altitude"):
        climb = _differentiate_on_grid(log.series("altitude"), grid)
        yield _Pair("pitch", "the change of altitude", log.series("pitch"), climb, exact=False, simultaneous=False)
    if (triangle := _fit_wind_triangle(log, grid)) is not None:
        air = np.abs(triangle.velocity - triangle.wind)
        yield _Pair("airspeed", "ground velocity and heading", log.series("airspeed"), air, exact=False)
    # The accelerations come last, because a wrong velocity or attitude contradicts all of them.
    if log.has("roll", "pitch", "yaw", "velocity_north", "velocity_east", "velocity_down"):
        # Specific force in body axes: the rate of change of the velocity minus gravity.
        north, east, down = (
            _differentiate_on_grid(log.series(f"velocity_{axis}"), grid) for axis in ("north", "east", "down")
        )
        forward = north * np.cos(yaw) + east * np.sin(yaw)
        right = east * np.cos(yaw) - north * np.sin(yaw)
        down = down - _GRAVITY_MPS2
        pitched_down = forward * np.sin(pitch) + down * np.cos(pitch)
        forces = {
            "acceleration_forward": forward * np.cos(pitch) - down * np.sin(pitch),
            "acceleration_right": right * np.cos(roll) + pitched_down * np.sin(roll),
            "acceleration_down": pitched_down * np.cos(roll) - right * np.sin(roll),
        }
        for name, values in forces.items():
            if log.has(name):
                yield _Pair(name, "the change of velocity, and the attitude", log.series(name), values)


def _find_ground_velocity(log: ColumnLog, grid: Floats) -> NDArray[np.complex128] | None:
    """Return the ground velocity at the times of a grid as north + i east, m/s, (n,).

    Return None if the log lacks it.
    """
    if log.has("velocity_north", "velocity_east"):
        north, east = (_average_on_grid(log.series(f"velocity_{axis}"), grid) for axis in ("north", "east"))
        return np.asarray(north + 1j * east)
    if log.has("ground_speed", "ground_course"):
        course = _average_on_grid(log.series("ground_course"), grid, wraps=True)
        return np.asarray(_average_on_grid(log.series("ground_speed"), grid) * np.exp(1j * course))
    return None


class _Triangle(NamedTuple):
    """A triangle of ground velocity, air velocity and wind; complex numbers are north + i east.

    velocity: ground velocity, m/s, (n,).
    factor: factor by which the logged airspeed must be multiplied for the best fit.
    wind: velocity of the mean wind, m/s.
    """

    velocity: NDArray[np.complex128]
    factor: float
    wind: complex


def _fit_wind_triangle(log: ColumnLog, grid: Floats) -> _Triangle | None:
    """Fit the factor and the wind in: ground velocity = factor * airspeed along the heading + wind.

    Return None if the log lacks one of these quantities, or if the airspeed is constant at 0.  Return None also for a
    flight without turns, because only turns distinguish the wind from an error of the airspeed.
    """
    velocity = _find_ground_velocity(log, grid)
    if velocity is None or not log.has("airspeed", "yaw"):
        return None
    direction = np.exp(1j * _average_on_grid(log.series("yaw"), grid, wraps=True))
    if abs(direction.mean()) > _CLEAR_ALIGNMENT:
        return None
    air_velocity = _average_on_grid(log.series("airspeed"), grid) * direction
    air_deviation = air_velocity - air_velocity.mean()
    if not air_deviation.any():
        return None
    factor = float(np.real(np.vdot(air_deviation, velocity)) / np.real(np.vdot(air_deviation, air_deviation)))
    return _Triangle(velocity, factor, complex(velocity.mean() - factor * air_velocity.mean()))


def _make_contradiction_error(log: ColumnLog, quantity: str, message: str, hint: str) -> LogError:
    """Return the error for a quantity that contradicts the others.

    message: what the quantity's column does, after the name of the column.
    hint: what to check in the table.
    """
    field = f"columns.{quantity}"
    text = f"{log.table_path}: {field}: {log.column(quantity)} {message}: {hint}"
    return LogError(text, file=log.table_path, field=field, allowed=hint)


def _check_not_frozen(log: ColumnLog, quantity: str, grid: Floats) -> None:
    """Raise LogError if a sensor repeats one value for too long in flight.

    A current of 0 A is accepted, because the motor may be idle.
    """
    time, values = _select_finite_rows(log.series(quantity))
    is_in_flight = (time >= grid[0]) & (time <= grid[-1])
    time, values = time[is_in_flight], values[is_in_flight]
    if len(time) < 2:
        return
    firsts = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0.0) + 1])
    # A run of equal values ends at its last sample, because the values in a gap of the log are unknown.
    lasts = np.append(firsts[1:] - 1, len(time) - 1)
    durations = time[lasts] - time[firsts]
    limit = max(_FROZEN_S, _FROZEN_RUNS * float(np.quantile(durations, 0.95))) if len(durations) > 1 else _FROZEN_S
    for k in np.flatnonzero(durations > limit).tolist():
        start = float(time[firsts[k]])
        end = float(time[min(lasts[k] + 1, len(time) - 1)])
        flight_time = np.count_nonzero((grid > start) & (grid < end)) * _STEP_S
        if flight_time > limit and not (quantity == "current" and values[firsts[k]] == 0.0):
            hint = "expected a sensor that works; leave its cells empty, or read another part of the log (span_s)"
            raise _make_contradiction_error(
                log, quantity, f"is stuck at one value from {start:.6g} to {end:.6g} s, in flight", hint
            )


def _check_pair(log: ColumnLog, pair: _Pair, grid: Floats) -> None:
    """Raise LogError if a quantity contradicts the values that its partner gives for it.

    It contradicts them if both vary in opposite directions, do not correlate although they move, or differ by a factor
    although they should be equal.

    With errors in both measurements, the factor lies between r c and r / c, where r is the ratio of the standard
    deviations and c the correlation (Frisch 1934).
    """
    values = _average_on_grid(pair.series, grid, wraps=pair.quantity == "yaw")
    correlation = correlate(values, pair.expected)
    if correlation < -_CLEAR_CORRELATION:
        message = f"varies opposite to {pair.partner} (correlation {correlation:.2f})"
        raise _make_contradiction_error(log, pair.quantity, message, "check sign and frame")
    moves = max(float(values.std()), float(pair.expected.std())) > _LEAST_MOTIONS.get(pair.quantity, math.inf)
    if moves and correlation < _LEAST_CORRELATION:
        message = f"does not follow {pair.partner} (correlation {correlation:.2f})"
        raise _make_contradiction_error(log, pair.quantity, message, "check column, clock and rows without a value")
    if pair.exact and correlation > _LEAST_CORRELATION:
        ratio = float(np.std(values) / np.std(pair.expected))
        if ratio * correlation > _MAX_RATIO or ratio / correlation < 1.0 / _MAX_RATIO:
            hint = f"check unit ({log.unit(pair.quantity)}) and scale"
            raise _make_contradiction_error(log, pair.quantity, f"is {ratio:.3g} times {pair.partner}", hint)


def _check_delay(log: ColumnLog, pair: _Pair, grid: Floats) -> None:
    """Raise LogError if a quantity leads or lags its partner by `_LATE_S` or more.

    The delay is the shift with the best correlation, if that is clearly better than without a shift.  It is ignored if
    the shifted quantity must equal its partner but varies more or less, because both then show different motions.
    Pairs that are not simultaneous, and short flights, are not checked.
    """
    is_inner = (grid > grid[0] - _SHIFTS_S[0]) & (grid < grid[-1] - _SHIFTS_S[-1])
    if not pair.simultaneous or np.count_nonzero(is_inner) < _MIN_ROWS:
        return
    expected, inner_grid = pair.expected[is_inner], grid[is_inner]
    correlations = [
        correlate(_average_on_grid(pair.series, inner_grid + shift), expected) for shift in _SHIFTS_S.tolist()
    ]
    best, unshifted = max(correlations), correlations[len(correlations) // 2]
    shift = float(_SHIFTS_S[int(np.argmax(correlations))])
    is_better = 1.0 - best * best < _SHIFTED_RESIDUAL * (1.0 - unshifted * unshifted)
    ratio = float(np.std(_average_on_grid(pair.series, inner_grid + shift)) / max(1e-12, float(np.std(expected))))
    if pair.exact and not 1.0 / _MAX_RATIO <= ratio <= _MAX_RATIO:
        return
    if best > _SHIFTED_CORRELATION and is_better and abs(shift) >= _LATE_S:
        message = f"{'lags' if shift > 0.0 else 'leads'} {pair.partner} by {abs(shift):g} s"
        raise _make_contradiction_error(log, pair.quantity, message, "check its clock (offset_s)")


def _check_airspeed(log: ColumnLog, grid: Floats) -> None:
    """Raise LogError if the airspeed is near zero in flight, or contradicts ground velocity and heading.

    Contradictions are found only in a flight with turns.  There, LogError is also raised if the logged wind contradicts
    the wind that follows from ground velocity, airspeed and heading.
    """
    airspeed, column = _average_on_grid(log.series("airspeed"), grid), log.column("airspeed")
    if np.median(airspeed) < _MIN_AIRSPEED_MPS:
        allowed = f"expected more than {_MIN_AIRSPEED_MPS:g} m/s: check column and unit"
        shown = f"{column} is {np.median(airspeed):.3g} m/s in flight"
        raise LogError.at(log.table_path, "columns.airspeed", shown, allowed)
    triangle = _fit_wind_triangle(log, grid)
    if triangle is None:
        return
    if not 1.0 / _MAX_AIRSPEED_RATIO <= triangle.factor <= _MAX_AIRSPEED_RATIO:
        message = f"is {1.0 / triangle.factor:.3g} times the airspeed that follows from ground velocity and heading"
        raise _make_contradiction_error(log, "airspeed", message, f"check unit ({log.unit('airspeed')}) and scale")
    if abs(triangle.wind) > _CLEAR_WIND_MPS:
        # A log may state the wind by components, by speed and direction, or twice by both.
        winds: list[tuple[str, complex]] = []
        if log.has("wind_north", "wind_east"):
            north, east = (_average_on_grid(log.series(f"wind_{axis}"), grid) for axis in ("north", "east"))
            winds.append(("wind_north", complex(float(np.mean(north)), float(np.mean(east)))))
        if log.has("wind_speed", "wind_direction"):
            speed = _average_on_grid(log.series("wind_speed"), grid)
            direction = _average_on_grid(log.series("wind_direction"), grid, wraps=True)
            winds.append(("wind_direction", complex(-np.mean(speed * np.exp(1j * direction)))))
        for quantity, wind in winds:
            wind_ratio = (wind / triangle.wind).real
            low, high = _WIND_RATIO_RANGE
            if not low <= wind_ratio <= high:
                message = f"states {wind_ratio:.2g} times the wind that follows from airspeed, heading and velocity"
                raise _make_contradiction_error(log, quantity, message, "check unit and frame (from, to)")
