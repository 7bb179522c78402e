"""Hold the quantities of a table of columns against each other: signs, frames and units that contradict the motion."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from logs.importers.columns.column_log import ColumnLog, Series
from world.arrays import Floats
from world.errors import LogError

# Interval of the grid on which quantities are compared, s; rates are means over it.
_STEP_S = 0.5
# Least time between samples of the ground speed in which the recorder stopped, s.
_MIN_GAP_S = 5.0
# Ground speed above which the aircraft flies, m/s.
_FLYING_MPS = 6.0
# Correlation beyond which two measurements of one quantity agree, or contradict each other.
_CLEAR_CORRELATION = 0.6
# Largest ratio of two measurements of one quantity, in either direction; that of ft/s to km/h is 1.10, of mph to kt
# 1.15, and of km/h to kt 1.85.
_MAX_RATIO = 1.25
# Shifts at which two measurements of one quantity are compared, s.
_SHIFTS_S = np.arange(-5.0, 5.01, 0.25)
# Least shift that is a late signal; receivers and estimators are later than inertial sensors by up to 0.3 s.
_LATE_S = 0.5
# Least correlation of a signal that is compared at other times.
_SHIFTED_CORRELATION = 0.8
# Share of the unexplained variance that is left at the time that is right.
_SHIFTED_RESIDUAL = 0.5
# Least duration for which a sensor that works never repeats a value, s.
_FROZEN_S = 20.0
# The same, as a multiple of the 95th percentile of the times between changes of coarsely rounded values.
_FROZEN_RUNS = 10.0
# Least mean wind whose direction is checked, m/s.
_CLEAR_WIND_MPS = 2.5
# Range of the logged wind along the wind of the velocities, as a fraction of it.
_WIND_RATIO_RANGE = (0.4, 1.7)
# Least number of rows in flight that are compared.
_MIN_ROWS = 40
# Range of the median specific force along the axis down in flight, m/s^2; a circle at 60 degrees of bank has -19.6.
_FORCE_RANGE_MPS2 = (-20.0, -4.0)
# Least mean alignment of heading and ground course, or of the reversed heading, that shows which one is right.
_CLEAR_ALIGNMENT = 0.7
# Largest mean angle between heading and ground course, rad.
_MAX_HEADING_DIFFERENCE_RAD = math.radians(50.0)
# Gravity, m/s^2.
_GRAVITY_MPS2 = 9.80665
# Interval over which positions are compared with velocities, s; a place that is rounded to 11 m (four decimals of a
# degree) still shows the velocity.
_PLACE_STEP_S = 2.0
# Sensors whose noise never rests in flight; a latitude, an altitude or a speed over ground can stay.
_SENSORS = (
    *("roll", "pitch", "yaw", "roll_rate", "pitch_rate", "yaw_rate", "airspeed", "current"),
    *("acceleration_forward", "acceleration_right", "acceleration_down"),
)
# Least standard deviation of quantities that must follow their partners, SI units and rad; the lateral acceleration of
# a turn without sideslip is less than the noise of a receiver's velocities.
_LEAST_MOTIONS = {
    **dict.fromkeys(("roll_rate", "pitch_rate", "yaw_rate"), math.radians(1.0)),
    **dict.fromkeys(("velocity_north", "velocity_east", "velocity_down"), 1.0),
    **dict.fromkeys(("acceleration_forward", "acceleration_down"), 1.0),
}
# Least correlation of these with their partners.
_LEAST_CORRELATION = 0.5
# Largest ratio of the airspeed and that of ground velocity and heading; density and position error explain 1.2.
_MAX_AIRSPEED_RATIO = 1.35
# Least median airspeed in flight, m/s.
_MIN_AIRSPEED_MPS = 2.0
# Least range of a throttle that moves.
_MIN_THROTTLE_RANGE = 0.01
# Least range of the current, 5 to 95 %, that only a throttle changes, A.
_MIN_CURRENT_RANGE_A = 3.0
_EARTH_RADIUS_M = 6_371_008.8


class _Pair(NamedTuple):
    """Two measurements of one quantity.

    quantity: the quantity that is checked.  partner: the quantities that it is held against, for people.
    series: of the quantity.  expected: (n,) by the partner, on the grid.
    exact: true if both measure the same, and not only move together.
    at_once: true if both move at the same time.
    """

    quantity: str
    partner: str
    series: Series
    expected: Floats
    exact: bool = True
    at_once: bool = True


def check_signs_and_units(log: ColumnLog) -> None:
    """Raise LogError for the first quantity that contradicts the others, with the key of the table to look at."""
    grid = _flying_grid(log)
    if len(grid) < _MIN_ROWS:
        return
    for quantity in _SENSORS:
        if quantity in log.table.columns and all(entry.value is None for entry in log.table.columns[quantity]):
            _check_not_frozen(log, quantity, grid)
    for pair in _pairs(log, grid):
        _check_pair(log, pair, grid)
    if log.has("acceleration_down"):
        _check_force(log, float(np.median(_on_grid(log.series("acceleration_down"), grid))))
    if log.has("yaw"):
        _check_heading(log, grid)
    if log.has("throttle", "current"):
        _check_throttle(log, grid)
    if log.has("airspeed"):
        _check_airspeed(log, grid)
    for pair in _pairs(log, grid):
        _check_delay(log, pair, grid)


def _flying_grid(log: ColumnLog) -> Floats:
    """Return recorded times in flight, (n,); none if neither velocity nor ground speed tells them."""
    if log.has("velocity_north", "velocity_east"):
        north, east = log.series("velocity_north"), log.series("velocity_east")
        speed = Series(north.time, np.hypot(north.values, np.interp(north.time, *_known(east))))
    elif log.has("ground_speed"):
        speed = log.series("ground_speed")
    else:
        return np.zeros(0)
    time, values = _known(speed)
    if len(time) < 2:
        return np.zeros(0)
    grid = np.arange(time[0], time[-1], _STEP_S)
    after = np.clip(np.searchsorted(time, grid, side="right"), 1, len(time) - 1)
    recorded = time[after] - time[after - 1] < _MIN_GAP_S
    return np.asarray(grid[recorded & (np.interp(grid, time, values) > _FLYING_MPS)])


def _known(series: Series) -> tuple[Floats, Floats]:
    finite = np.isfinite(series.values)
    return series.time[finite], series.values[finite]


def _on_grid(series: Series, grid: Floats, *, turning: bool = False) -> Floats:
    """Return means of a series over the intervals around the times of a grid."""
    time, values = _known(series)
    values = np.unwrap(values) if turning else values
    sums = np.concatenate([[0.0], np.cumsum(values)])
    begin, end = (np.searchsorted(time, grid + side * 0.5 * _STEP_S) for side in (-1.0, 1.0))
    means = (sums[end] - sums[begin]) / np.maximum(1, end - begin)
    return np.asarray(np.where(end > begin, means, np.interp(grid, time, values)))


def _change(series: Series, grid: Floats, *, turning: bool = False, step: float = _STEP_S) -> Floats:
    """Return the rate of change of a series over intervals of `step`, s, around the times of a grid."""
    time, values = _known(series)
    values = np.unwrap(values) if turning else values
    later, earlier = (np.interp(grid + side * 0.5 * step, time, values) for side in (1.0, -1.0))
    return np.asarray((later - earlier) / step)


def _pairs(log: ColumnLog, grid: Floats) -> Iterator[_Pair]:
    if log.has("velocity_down", "altitude"):
        sink = -_change(log.series("altitude"), grid)
        yield _Pair("velocity_down", "the change of altitude", log.series("velocity_down"), sink)
    if log.has("latitude", "longitude", "velocity_north", "velocity_east"):
        latitude = log.series("latitude")
        north = _change(latitude, grid, step=_PLACE_STEP_S) * _EARTH_RADIUS_M
        yield _Pair("velocity_north", "the change of latitude", log.series("velocity_north"), north)
        east = _change(log.series("longitude"), grid, turning=True, step=_PLACE_STEP_S) * _EARTH_RADIUS_M
        east = east * np.cos(_on_grid(latitude, grid))
        yield _Pair("velocity_east", "the change of longitude", log.series("velocity_east"), east)
    if log.has("roll", "pitch", "yaw"):
        yield from _attitude_pairs(log, grid)
    if log.has("throttle", "current"):
        current = _on_grid(log.series("current"), grid)
        yield _Pair("throttle", "the current", log.series("throttle"), current, exact=False)
    if log.has("pitch", "altitude"):
        climb = _change(log.series("altitude"), grid)
        yield _Pair("pitch", "the change of altitude", log.series("pitch"), climb, exact=False, at_once=False)
    if (triangle := _velocity_triangle(log, grid)) is not None:
        air = np.abs(triangle.velocity - triangle.wind)
        yield _Pair("airspeed", "ground velocity and heading", log.series("airspeed"), air, exact=False)
    # Last, as a wrong velocity or attitude contradicts all accelerations.
    yield from _force_pairs(log, grid)


def _attitude_pairs(log: ColumnLog, grid: Floats) -> Iterator[_Pair]:
    """Yield the pairs of angular rates with the change of attitude, and of the bank with the turn."""
    angles = {name: log.series(name) for name in ("roll", "pitch", "yaw")}
    roll, pitch = (_on_grid(angles[name], grid, turning=True) for name in ("roll", "pitch"))
    roll_change, pitch_change, yaw_change = (_change(series, grid, turning=True) for series in angles.values())
    expected = {
        "roll_rate": roll_change - yaw_change * np.sin(pitch),
        "pitch_rate": pitch_change * np.cos(roll) + yaw_change * np.cos(pitch) * np.sin(roll),
        "yaw_rate": yaw_change * np.cos(pitch) * np.cos(roll) - pitch_change * np.sin(roll),
    }
    for name, values in expected.items():
        if log.has(name):
            yield _Pair(name, "the change of roll, pitch and yaw", log.series(name), values)
    yield _Pair("roll", "the turn that yaw shows", angles["roll"], yaw_change, exact=False, at_once=False)


def _force_pairs(log: ColumnLog, grid: Floats) -> Iterator[_Pair]:
    """Yield the pairs of accelerations with the change of velocity, less gravity, in the axes of the body."""
    if not log.has("roll", "pitch", "yaw", "velocity_north", "velocity_east", "velocity_down"):
        return
    roll, pitch, yaw = (_on_grid(log.series(name), grid, turning=True) for name in ("roll", "pitch", "yaw"))
    north, east, down = (_change(log.series(f"velocity_{axis}"), grid) for axis in ("north", "east", "down"))
    ahead = north * np.cos(yaw) + east * np.sin(yaw)
    right = east * np.cos(yaw) - north * np.sin(yaw)
    down = down - _GRAVITY_MPS2
    across = ahead * np.sin(pitch) + down * np.cos(pitch)
    forces = {
        "acceleration_forward": ahead * np.cos(pitch) - down * np.sin(pitch),
        "acceleration_right": right * np.cos(roll) + across * np.sin(roll),
        "acceleration_down": across * np.cos(roll) - right * np.sin(roll),
    }
    for name, values in forces.items():
        if log.has(name):
            yield _Pair(name, "the change of velocity, and the attitude", log.series(name), values)


def _ground_velocity(log: ColumnLog, grid: Floats) -> NDArray[np.complex128] | None:
    """Return the ground velocity (n,), north and east as a complex number, m/s; None if the log has none."""
    if log.has("velocity_north", "velocity_east"):
        north, east = (_on_grid(log.series(f"velocity_{axis}"), grid) for axis in ("north", "east"))
        return np.asarray(north + 1j * east)
    if log.has("ground_speed", "ground_course"):
        course = _on_grid(log.series("ground_course"), grid, turning=True)
        return np.asarray(_on_grid(log.series("ground_speed"), grid) * np.exp(1j * course))
    return None


class _Triangle(NamedTuple):
    """Triangle of ground velocity, heading and airspeed; complex numbers are north and east.

    velocity: (n,) ground velocity, m/s.  factor: of the airspeed that fits best.  wind: mean wind, m/s.
    """

    velocity: NDArray[np.complex128]
    factor: float
    wind: complex


def _velocity_triangle(log: ColumnLog, grid: Floats) -> _Triangle | None:
    """Return the triangle; None without its quantities, or without turns, which tell wind and airspeed apart."""
    velocity = _ground_velocity(log, grid)
    if velocity is None or not log.has("airspeed", "yaw"):
        return None
    direction = np.exp(1j * _on_grid(log.series("yaw"), grid, turning=True))
    if abs(direction.mean()) > _CLEAR_ALIGNMENT:
        return None
    air = _on_grid(log.series("airspeed"), grid) * direction
    centred = air - air.mean()
    if not centred.any():
        return None
    factor = float(np.real(np.vdot(centred, velocity)) / np.real(np.vdot(centred, centred)))
    return _Triangle(velocity, factor, complex(velocity.mean() - factor * air.mean()))


def _correlate(values: Floats, expected: Floats) -> float:
    values, expected = values - values.mean(), expected - expected.mean()
    size = float(np.sqrt((values @ values) * (expected @ expected)))
    return float(values @ expected) / size if size > 0.0 else 0.0


def _contradiction(log: ColumnLog, quantity: str, message: str, hint: str) -> LogError:
    """Return the error of a quantity that contradicts the others."""
    field = f"columns.{quantity}"
    text = f"{log.table_path}: {field}: {log.column(quantity)} {message}: {hint}"
    return LogError(text, file=log.table_path, field=field, allowed=hint)


def _check_not_frozen(log: ColumnLog, quantity: str, grid: Floats) -> None:
    """Raise LogError for a sensor that repeats one value in flight; a current of zero is an idle motor."""
    time, values = _known(log.series(quantity))
    inside = (time >= grid[0]) & (time <= grid[-1])
    time, values = time[inside], values[inside]
    if len(time) < 2:
        return
    firsts = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0.0) + 1])
    # A run ends at its last sample: a gap in the log is not a value that stays.
    lasts = np.append(firsts[1:] - 1, len(time) - 1)
    durations = time[lasts] - time[firsts]
    limit = max(_FROZEN_S, _FROZEN_RUNS * float(np.quantile(durations, 0.95))) if len(durations) > 1 else _FROZEN_S
    for k in np.flatnonzero(durations > limit).tolist():
        begin, end = float(time[firsts[k]]), float(time[min(lasts[k] + 1, len(time) - 1)])
        flown = np.count_nonzero((grid > begin) & (grid < end)) * _STEP_S
        if flown > limit and not (quantity == "current" and values[firsts[k]] == 0.0):
            hint = "expected a sensor that works; leave its cells empty, or read a part (span_s)"
            raise _contradiction(log, quantity, f"keeps one value from {begin:.6g} to {end:.6g} s, in flight", hint)


def _check_pair(log: ColumnLog, pair: _Pair, grid: Floats) -> None:
    """Raise LogError if two measurements run against each other, or differ by a factor.

    Errors of either measurement put the factor between r c and r / c, with the ratio r of the deviations and the
    correlation c (Frisch 1934).
    """
    values = _on_grid(pair.series, grid, turning=pair.quantity == "yaw")
    correlation = _correlate(values, pair.expected)
    if correlation < -_CLEAR_CORRELATION:
        message = f"runs against {pair.partner} (correlation {correlation:.2f})"
        raise _contradiction(log, pair.quantity, message, "check sign and frame")
    moves = max(float(values.std()), float(pair.expected.std())) > _LEAST_MOTIONS.get(pair.quantity, math.inf)
    if moves and correlation < _LEAST_CORRELATION:
        message = f"does not follow {pair.partner} (correlation {correlation:.2f})"
        raise _contradiction(log, pair.quantity, message, "check column, clock and rows without a value")
    if pair.exact and correlation > _LEAST_CORRELATION:
        ratio = float(np.std(values) / np.std(pair.expected))
        if ratio * correlation > _MAX_RATIO or ratio / correlation < 1.0 / _MAX_RATIO:
            hint = f"check unit ({log.unit(pair.quantity)}) and scale"
            raise _contradiction(log, pair.quantity, f"is {ratio:.3g} times {pair.partner}", hint)


def _check_delay(log: ColumnLog, pair: _Pair, grid: Floats) -> None:
    """Raise LogError if a measurement comes earlier or later than its partner, by the shift with the best correlation.

    Two measurements of one quantity whose sizes differ at that shift are not the same motion.
    """
    inner = (grid > grid[0] - _SHIFTS_S[0]) & (grid < grid[-1] - _SHIFTS_S[-1])
    if not pair.at_once or np.count_nonzero(inner) < _MIN_ROWS:
        return
    expected = pair.expected[inner]
    correlations = [_correlate(_on_grid(pair.series, grid[inner] + shift), expected) for shift in _SHIFTS_S.tolist()]
    best, now = max(correlations), correlations[len(correlations) // 2]
    shift = float(_SHIFTS_S[int(np.argmax(correlations))])
    is_better = 1.0 - best * best < _SHIFTED_RESIDUAL * (1.0 - now * now)
    ratio = float(np.std(_on_grid(pair.series, grid[inner] + shift)) / max(1e-12, float(np.std(expected))))
    if pair.exact and not 1.0 / _MAX_RATIO <= ratio <= _MAX_RATIO:
        return
    if best > _SHIFTED_CORRELATION and is_better and abs(shift) >= _LATE_S:
        message = f"comes {abs(shift):g} s {'after' if shift > 0.0 else 'before'} {pair.partner}"
        raise _contradiction(log, pair.quantity, message, "check its clock (offset_s)")


def _check_force(log: ColumnLog, force: float) -> None:
    low, high = _FORCE_RANGE_MPS2
    if not low <= force <= high:
        entry = log.table.columns["acceleration_down"][0]
        hint = "check sign and frame" if -high <= force <= -low else f"check unit ({entry.unit}) and scale"
        allowed = f"expected {low:g} to {high:g} m/s2 (specific force down, -9.8 at rest): {hint}"
        raise LogError.at(
            log.table_path, "columns.acceleration_down", f"{entry.column} is {force:.3g} m/s2 in flight", allowed
        )


def _check_airspeed(log: ColumnLog, grid: Floats) -> None:
    """Raise LogError for an airspeed that is zero in flight, or not that of ground velocity and heading."""
    airspeed, column = _on_grid(log.series("airspeed"), grid), log.column("airspeed")
    if np.median(airspeed) < _MIN_AIRSPEED_MPS:
        allowed = f"expected more than {_MIN_AIRSPEED_MPS:g} m/s: check column and unit"
        shown = f"{column} is {np.median(airspeed):.3g} m/s in flight"
        raise LogError.at(log.table_path, "columns.airspeed", shown, allowed)
    triangle = _velocity_triangle(log, grid)
    if triangle is None:
        return
    if not 1.0 / _MAX_AIRSPEED_RATIO <= triangle.factor <= _MAX_AIRSPEED_RATIO:
        message = f"is {1.0 / triangle.factor:.3g} times the airspeed of ground velocity and heading"
        raise _contradiction(log, "airspeed", message, f"check unit ({log.unit('airspeed')}) and scale")
    if abs(triangle.wind) > _CLEAR_WIND_MPS:
        for quantity, wind in _logged_winds(log, grid):
            along = (wind / triangle.wind).real
            low, high = _WIND_RATIO_RANGE
            if not low <= along <= high:
                message = f"states {along:.2g} times the wind of airspeed, heading and ground velocity"
                raise _contradiction(log, quantity, message, "check unit and frame (from, to)")


def _logged_winds(log: ColumnLog, grid: Floats) -> Iterator[tuple[str, complex]]:
    """Yield the mean wind of each pair of quantities that states it, north and east, m/s."""
    if log.has("wind_north", "wind_east"):
        north, east = (float(np.mean(_on_grid(log.series(f"wind_{axis}"), grid))) for axis in ("north", "east"))
        yield "wind_north", complex(north, east)
    if log.has("wind_speed", "wind_direction"):
        origin = _on_grid(log.series("wind_direction"), grid, turning=True)
        yield "wind_direction", complex(-np.mean(_on_grid(log.series("wind_speed"), grid) * np.exp(1j * origin)))


def _check_throttle(log: ColumnLog, grid: Floats) -> None:
    """Raise LogError for a throttle that stays where it is while the current changes."""
    throttle, current = (_on_grid(log.series(name), grid) for name in ("throttle", "current"))
    low, high = np.percentile(current, [5.0, 95.0]).tolist()
    if np.ptp(throttle) < _MIN_THROTTLE_RANGE and high - low > _MIN_CURRENT_RANGE_A:
        message = f"stays at {throttle[0]:.3g} in flight, and the current goes from {low:.3g} to {high:.3g} A"
        raise _contradiction(log, "throttle", message, "check the column")


def _check_heading(log: ColumnLog, grid: Floats) -> None:
    """Raise LogError if the heading is not that of the ground course, or runs against it."""
    velocity = _ground_velocity(log, grid)
    if velocity is None:
        return
    course, yaw = np.angle(velocity), _on_grid(log.series("yaw"), grid, turning=True)
    same, reversed_yaw = (complex(np.mean(np.exp(1j * (course - sign * yaw)))) for sign in (1.0, -1.0))
    difference = math.degrees(math.atan2(same.imag, same.real))
    message = ""
    if abs(same) > _CLEAR_ALIGNMENT and abs(math.radians(difference)) > _MAX_HEADING_DIFFERENCE_RAD:
        message = f"differs by {difference:.0f} deg from the ground course on average"
    elif abs(reversed_yaw) > _CLEAR_ALIGNMENT > abs(same):
        message = "turns against the ground course"
    if message:
        raise _contradiction(log, "yaw", message, "check sign, frame and offset")
