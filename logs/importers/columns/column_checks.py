"""Hold the quantities of a table of columns against each other: signs, frames and units that contradict the motion."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from logs.importers.columns.column_log import ColumnLog, Series
from world.arrays import Floats
from world.errors import LogError

# Interval of the grid on which quantities are compared, s; rates are means over it.
_STEP_S = 0.5
# Ground speed above which the aircraft flies, m/s.
_FLYING_MPS = 6.0
# Correlation beyond which two measurements of one quantity agree, or contradict each other.
_CLEAR_CORRELATION = 0.6
# Largest ratio of two measurements of one quantity, in either direction.
_MAX_RATIO = 2.5
# Least number of rows in flight that are compared.
_MIN_ROWS = 40
# Range of the median specific force along the axis down in flight, m/s^2; a circle at 60 degrees of bank has -19.6.
_FORCE_RANGE_MPS2 = (-20.0, -4.0)
# Least mean alignment of heading and ground course, or of the reversed heading, that shows which one is right.
_CLEAR_ALIGNMENT = 0.7
# Largest mean angle between heading and ground course, rad.
_MAX_HEADING_DIFFERENCE_RAD = math.radians(50.0)
# Quantities that must follow the change of the attitude.
_ANGULAR_RATES = ("roll_rate", "pitch_rate", "yaw_rate")
# Least correlation of an angular rate with the change of the attitude, if both move by `_MIN_RATE_SD_RAD_S`.
_LEAST_RATE_CORRELATION = 0.3
_MIN_RATE_SD_RAD_S = math.radians(1.0)
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
    values, expected: (n,).  exact: true if both measure the same, and not only move together.
    """

    quantity: str
    partner: str
    values: Floats
    expected: Floats
    exact: bool = True


def check_signs_and_units(log: ColumnLog) -> None:
    """Raise LogError for the first quantity that contradicts the others, with the key of the table to look at."""
    grid = _flying_grid(log)
    if len(grid) < _MIN_ROWS:
        return
    for pair in _pairs(log, grid):
        _check_pair(log, pair)
    if log.has("acceleration_down"):
        _check_force(log, float(np.median(_on_grid(log.series("acceleration_down"), grid))))
    if log.has("yaw"):
        _check_heading(log, grid)
    if log.has("throttle", "current"):
        _check_throttle(log, grid)
    if log.has("airspeed"):
        _check_airspeed(log, grid)


def _flying_grid(log: ColumnLog) -> Floats:
    """Return times at which the aircraft flew, (n,); none if neither velocity nor ground speed tells."""
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
    return np.asarray(grid[np.interp(grid, time, values) > _FLYING_MPS])


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


def _change(series: Series, grid: Floats, *, turning: bool = False) -> Floats:
    """Return the rate of change of a series over the intervals around the times of a grid."""
    time, values = _known(series)
    values = np.unwrap(values) if turning else values
    later, earlier = (np.interp(grid + side * 0.5 * _STEP_S, time, values) for side in (1.0, -1.0))
    return np.asarray((later - earlier) / _STEP_S)


def _pairs(log: ColumnLog, grid: Floats) -> Iterator[_Pair]:
    if log.has("roll", "pitch", "yaw"):
        angles = {name: log.series(name) for name in ("roll", "pitch", "yaw")}
        roll, pitch = (_on_grid(angles[name], grid) for name in ("roll", "pitch"))
        roll_change, pitch_change, yaw_change = (_change(series, grid, turning=True) for series in angles.values())
        expected = {
            "roll_rate": roll_change - yaw_change * np.sin(pitch),
            "pitch_rate": pitch_change * np.cos(roll) + yaw_change * np.cos(pitch) * np.sin(roll),
            "yaw_rate": yaw_change * np.cos(pitch) * np.cos(roll) - pitch_change * np.sin(roll),
        }
        for name, values in expected.items():
            if log.has(name):
                yield _Pair(name, "the change of roll, pitch and yaw", _on_grid(log.series(name), grid), values)
        yield _Pair("roll", "the turn that yaw shows", roll, yaw_change, exact=False)
    if log.has("velocity_down", "altitude"):
        sink = -_change(log.series("altitude"), grid)
        yield _Pair("velocity_down", "the change of altitude", _on_grid(log.series("velocity_down"), grid), sink)
    if log.has("latitude", "longitude", "velocity_north", "velocity_east"):
        latitude = log.series("latitude")
        north = _change(latitude, grid) * _EARTH_RADIUS_M
        yield _Pair("velocity_north", "the change of latitude", _on_grid(log.series("velocity_north"), grid), north)
        east = _change(log.series("longitude"), grid) * _EARTH_RADIUS_M * np.cos(_on_grid(latitude, grid))
        yield _Pair("velocity_east", "the change of longitude", _on_grid(log.series("velocity_east"), grid), east)
    if log.has("throttle", "current"):
        throttle, current = (_on_grid(log.series(name), grid) for name in ("throttle", "current"))
        yield _Pair("throttle", "the current", throttle, current, exact=False)
    if log.has("pitch", "altitude"):
        climb = _change(log.series("altitude"), grid)
        yield _Pair("pitch", "the change of altitude", _on_grid(log.series("pitch"), grid), climb, exact=False)


def _check_pair(log: ColumnLog, pair: _Pair) -> None:
    """Raise LogError if two measurements run against each other, or differ by a factor."""
    values, expected = pair.values - pair.values.mean(), pair.expected - pair.expected.mean()
    size = float(np.sqrt((values @ values) * (expected @ expected)))
    correlation = float(values @ expected) / size if size > 0.0 else 0.0
    field, column = f"columns.{pair.quantity}", log.column(pair.quantity)
    if correlation < -_CLEAR_CORRELATION:
        hint = "check sign and frame"
        message = f"{column} runs against {pair.partner} (correlation {correlation:.2f}): {hint}"
        raise LogError(f"{log.table_path}: {field}: {message}", file=log.table_path, field=field, allowed=hint)
    both_move = min(float(values.std()), float(expected.std())) > _MIN_RATE_SD_RAD_S
    if pair.quantity in _ANGULAR_RATES and both_move and correlation < _LEAST_RATE_CORRELATION:
        hint = "check column and clock"
        message = f"{column} does not follow {pair.partner} (correlation {correlation:.2f}): {hint}"
        raise LogError(f"{log.table_path}: {field}: {message}", file=log.table_path, field=field, allowed=hint)
    if pair.exact and correlation > _CLEAR_CORRELATION:
        ratio = float(np.std(values) / np.std(expected))
        if not 1.0 / _MAX_RATIO <= ratio <= _MAX_RATIO:
            hint = f"check unit ({log.unit(pair.quantity)}) and scale"
            message = f"{column} is {ratio:.3g} times {pair.partner}: {hint}"
            raise LogError(f"{log.table_path}: {field}: {message}", file=log.table_path, field=field, allowed=hint)


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
    if not log.has("yaw", "velocity_north", "velocity_east"):
        return
    direction = np.exp(1j * _on_grid(log.series("yaw"), grid, turning=True))
    if abs(direction.mean()) > _CLEAR_ALIGNMENT:
        return
    # Ground velocity is a factor times the airspeed along the heading, plus the wind.
    velocity = _on_grid(log.series("velocity_north"), grid) + 1j * _on_grid(log.series("velocity_east"), grid)
    air = airspeed * direction
    air, velocity = air - air.mean(), velocity - velocity.mean()
    factor = float(np.real(np.vdot(air, velocity)) / np.real(np.vdot(air, air)))
    if not 1.0 / _MAX_AIRSPEED_RATIO <= factor <= _MAX_AIRSPEED_RATIO:
        hint = f"check unit ({log.unit('airspeed')}) and scale"
        shown = f"{column} is {1.0 / factor:.3g} times the airspeed of ground velocity and heading"
        raise LogError.at(log.table_path, "columns.airspeed", shown, hint)


def _check_throttle(log: ColumnLog, grid: Floats) -> None:
    """Raise LogError for a throttle that stays where it is while the current changes."""
    throttle, current = (_on_grid(log.series(name), grid) for name in ("throttle", "current"))
    low, high = np.percentile(current, [5.0, 95.0]).tolist()
    if np.ptp(throttle) < _MIN_THROTTLE_RANGE and high - low > _MIN_CURRENT_RANGE_A:
        hint = "check the column"
        message = f"{log.column('throttle')} stays at {throttle[0]:.3g} in flight, and the current goes from {low:.3g}"
        field = "columns.throttle"
        raise LogError(
            f"{log.table_path}: {field}: {message} to {high:.3g} A: {hint}",
            file=log.table_path,
            field=field,
            allowed=hint,
        )


def _check_heading(log: ColumnLog, grid: Floats) -> None:
    """Raise LogError if the heading is not that of the ground course, or runs against it."""
    if log.has("velocity_north", "velocity_east"):
        east, north = (_on_grid(log.series(f"velocity_{axis}"), grid) for axis in ("east", "north"))
        course = np.arctan2(east, north)
    elif log.has("ground_course"):
        course = _on_grid(log.series("ground_course"), grid, turning=True)
    else:
        return
    yaw = _on_grid(log.series("yaw"), grid, turning=True)
    same, reversed_yaw = (complex(np.mean(np.exp(1j * (course - sign * yaw)))) for sign in (1.0, -1.0))
    difference = math.degrees(math.atan2(same.imag, same.real))
    column = log.column("yaw")
    text = ""
    if abs(same) > _CLEAR_ALIGNMENT and abs(math.radians(difference)) > _MAX_HEADING_DIFFERENCE_RAD:
        text = f"{column} differs by {difference:.0f} deg from the ground course on average"
    elif abs(reversed_yaw) > _CLEAR_ALIGNMENT > abs(same):
        text = f"{column} turns against the ground course"
    if text:
        hint = "check sign, frame and offset"
        raise LogError(
            f"{log.table_path}: columns.yaw: {text}: {hint}", file=log.table_path, field="columns.yaw", allowed=hint
        )
