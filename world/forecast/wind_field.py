"""Wind that varies in time, height and place, interpolated between the nodes of a forecast's grid.

The interpolation is linear in time, latitude and longitude on every level, of the level's altitude and of the wind
alike, and then linear in altitude between the two levels around the aircraft.  Beyond the first and the last node of an
axis, and below the lowest and above the highest level, the value at that node or level applies.
"""

import bisect
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from world.arrays import Floats
from world.kernels import compiled, inner

# Index of each count at the start of a packed field.
_TIME_COUNT = 0
_ROW_COUNT = 1
_COLUMN_COUNT = 2
_LEVEL_COUNT = 3
# Number of these counts.
_HEADER_SIZE = 4
# Index of each number of a node.
_ALTITUDE = 0
_EAST = 1
_NORTH = 2
# Numbers of a node in a packed field: altitude, east, north.
_NODE_SIZE = 3
# Largest number of numbers in a packed field of one flight: 160 MB.
MAX_FIELD_NUMBERS = 20_000_000


@dataclass(frozen=True, eq=False, slots=True)
class WindField:
    """Wind at the nodes of a grid.

    times: (t,) s, ascending, from any epoch.
    latitudes: (y,) deg, ascending.
    longitudes: (x,) deg, ascending.
    altitudes: (t, y, x, k) m AMSL of each level, ascending along the last axis.
    velocities: (t, y, x, k, 2) m/s, east and north, direction of air motion.
    """

    times: Floats
    latitudes: Floats
    longitudes: Floats
    altitudes: Floats
    velocities: Floats

    def __eq__(self, other: object) -> bool:
        """Return True if the other field has the same numbers."""
        return isinstance(other, WindField) and np.array_equal(self.packed(), other.packed())

    def __hash__(self) -> int:
        """Return a hash of the field's numbers."""
        return hash(self.packed().tobytes())

    def packed(self) -> Floats:
        """Return the field as one array of numbers, which `interpolate_field` reads.

        The array contains the four counts (t, y, x, k), then the times, the latitudes and the longitudes, and then the
        altitude, east wind and north wind of each node.
        """
        nodes = np.concatenate([self.altitudes[..., np.newaxis], self.velocities], axis=-1)
        axes = (self.times, self.latitudes, self.longitudes)
        return np.concatenate([np.array(self.altitudes.shape, dtype=np.float64), *axes, nodes.ravel()])

    @classmethod
    def unpacked(cls, numbers: Floats, count: int) -> "WindField":
        """Make a field from the numbers of `packed`.

        count: expected length of ``numbers``.

        Raises ValueError for another length, or if the numbers are not a wind field.
        """
        if numbers.size != count or count < _HEADER_SIZE or not np.isfinite(numbers).all():
            raise ValueError("not a wind field")
        shape = tuple(int(value) for value in numbers[:_HEADER_SIZE])
        axes_end = _HEADER_SIZE + sum(shape[:3])
        if min(shape) < 1 or axes_end + _NODE_SIZE * math.prod(shape) != count:
            raise ValueError("not a wind field")
        times, latitudes, longitudes = np.split(numbers[_HEADER_SIZE:axes_end], np.cumsum(shape[:2]))
        nodes = numbers[axes_end:].reshape(*shape, _NODE_SIZE)
        is_ascending = all((np.diff(axis) > 0.0).all() for axis in (times, latitudes, longitudes))
        if not is_ascending or (np.diff(nodes[..., _ALTITUDE], axis=-1) < 0.0).any():
            raise ValueError("not a wind field")
        return cls(times, latitudes, longitudes, nodes[..., _ALTITUDE].copy(), nodes[..., _EAST:].copy())

    def interpolate(
        self, seconds: ArrayLike, latitudes: ArrayLike, longitudes: ArrayLike, altitudes: ArrayLike
    ) -> Floats:
        """Return the wind at n points, m/s, east and north, and the altitude at which it applies, (n, 3).

        seconds: times of the points, s, (n,) or one value like all arguments.
        latitudes, longitudes: deg.
        altitudes: m AMSL.

        The resulting altitude (m AMSL) is the point's altitude, limited to the levels of the field at the point.
        """
        points = (seconds, latitudes, longitudes, altitudes)
        arrays = np.broadcast_arrays(*(np.atleast_1d(np.asarray(values, dtype=np.float64)) for values in points))
        return _interpolate_points(self.packed(), *(np.ascontiguousarray(array) for array in arrays))

    def velocities_at(
        self, seconds: ArrayLike, latitudes: ArrayLike, longitudes: ArrayLike, altitudes: ArrayLike
    ) -> Floats:
        """Return the wind at n points, m/s, (n, 2) east and north; arguments as for `interpolate`."""
        return self.interpolate(seconds, latitudes, longitudes, altitudes)[:, :2]

    def between(self, start: float, end: float) -> "WindField":
        """Return the field with only the times needed to interpolate the wind from `start` to `end` (s)."""
        times: Sequence[float] = self.times.tolist()
        first = max(0, bisect.bisect_right(times, start) - 1)
        last = min(len(times), bisect.bisect_left(times, end) + 1)
        rows = slice(first, max(last, first + 1))
        return WindField(self.times[rows], self.latitudes, self.longitudes, self.altitudes[rows], self.velocities[rows])


@inner
def _bracket(field: Floats, start: int, count: int, value: float) -> tuple[int, float]:
    """Find the two neighbouring nodes of an axis between which a value lies.

    Returns the index of the first of them, and the fraction of the step from it to the second. A value beyond an end is
    moved to that end.

    field: packed field; the axis is ``field[start : start + count]``, in ascending order.
    """
    low, high = 0, count - 1
    if high == 0 or value <= field[start]:
        return 0, 0.0
    if value >= field[start + high]:
        return high - 1, 1.0
    while high - low > 1:
        middle = (low + high) // 2
        if field[start + middle] <= value:
            low = middle
        else:
            high = middle
    return low, (value - field[start + low]) / (field[start + high] - field[start + low])


@inner
def _interpolate_level_value(
    field: Floats, corner: int, steps: tuple[int, int, int], fractions: tuple[float, float, float], number: int
) -> float:
    """Interpolate a level's altitude or wind component between eight nodes.

    The interpolation is linear in time, latitude and longitude.

    field: numbers of a packed field.
    corner: index in ``field`` of the first node of the cell, on this level.
    steps: differences of the index to the next node in time, latitude and longitude; 0 on an axis of one node.
    fractions: position in the cell along these axes, 0..1.
    number: offset of the value in a node: `_ALTITUDE`, `_EAST` or `_NORTH`.
    """
    total = 0.0
    for time in range(2):
        time_weight = fractions[0] if time else 1.0 - fractions[0]
        for row in range(2):
            row_weight = time_weight * (fractions[1] if row else 1.0 - fractions[1])
            for column in range(2):
                weight = row_weight * (fractions[2] if column else 1.0 - fractions[2])
                if weight > 0.0:
                    node = corner + time * steps[0] + row * steps[1] + column * steps[2]
                    total += weight * field[node + number]
    return total


@inner
def interpolate_field(
    field: Floats, seconds: float, latitude: float, longitude: float, altitude: float
) -> tuple[float, float, float]:
    """Return the wind at a point of a packed field, m/s, east and north, and its altitude.

    The altitude is that at which the wind applies, m AMSL.

    The resulting altitude is the point's altitude, limited to the levels there.

    field: `WindField.packed`.
    seconds: time, s, from the same epoch as the field's times.
    latitude, longitude: deg; the longitude may differ by multiples of 360 deg.
    altitude: m AMSL.
    """
    times, rows = int(field[_TIME_COUNT]), int(field[_ROW_COUNT])
    columns, levels = int(field[_COLUMN_COUNT]), int(field[_LEVEL_COUNT])
    rows_begin = _HEADER_SIZE + times
    columns_begin = rows_begin + rows
    nodes_begin = columns_begin + columns
    # Shift the longitude by whole turns to within 180 degrees of the field's middle.
    offset = longitude - 0.5 * (field[columns_begin] + field[nodes_begin - 1])
    if abs(offset) > 180.0:
        longitude -= 360.0 * round(offset / 360.0)
    time, time_fraction = _bracket(field, _HEADER_SIZE, times, seconds)
    row, row_fraction = _bracket(field, rows_begin, rows, latitude)
    column, column_fraction = _bracket(field, columns_begin, columns, longitude)
    column_step = levels * _NODE_SIZE
    row_step = columns * column_step
    time_step = rows * row_step
    corner = nodes_begin + time * time_step + row * row_step + column * column_step
    steps = (
        time_step if times > 1 else 0,
        row_step if rows > 1 else 0,
        column_step if columns > 1 else 0,
    )
    fractions = (time_fraction, row_fraction, column_fraction)
    low = _interpolate_level_value(field, corner, steps, fractions, _ALTITUDE)
    level = 0
    fraction = 0.0
    if levels > 1 and altitude > low:
        high = low
        while level < levels - 1:
            high = _interpolate_level_value(field, corner + (level + 1) * _NODE_SIZE, steps, fractions, _ALTITUDE)
            if high >= altitude:
                break
            low = high
            level += 1
        fraction = (altitude - low) / (high - low) if level < levels - 1 else 0.0
        altitude = min(altitude, high)
    else:
        altitude = low
    below = corner + level * _NODE_SIZE
    east = _interpolate_level_value(field, below, steps, fractions, _EAST)
    north = _interpolate_level_value(field, below, steps, fractions, _NORTH)
    if fraction > 0.0:
        east += fraction * (_interpolate_level_value(field, below + _NODE_SIZE, steps, fractions, _EAST) - east)
        north += fraction * (_interpolate_level_value(field, below + _NODE_SIZE, steps, fractions, _NORTH) - north)
    return east, north, altitude


@compiled
def _interpolate_points(
    field: Floats, seconds: Floats, latitudes: Floats, longitudes: Floats, altitudes: Floats
) -> Floats:
    """Return the wind at n points by `interpolate_field`, (n, 3).

    The columns are east and north, m/s, and the altitude, m AMSL.

    The altitude is the one to which the wind applies: the point's altitude, limited to the levels of the field.
    """
    winds = np.empty((seconds.size, 3))
    for k in range(seconds.size):
        east, north, altitude = interpolate_field(field, seconds[k], latitudes[k], longitudes[k], altitudes[k])
        winds[k, 0], winds[k, 1], winds[k, 2] = east, north, altitude
    return winds


# ----------------------------------------------------------------------
# The mean profile of a field: what the planner and the limits of the verdict are computed with.

# Heights above a place to which the mean profile around it is fitted, m.
PROFILE_HEIGHTS_M = np.linspace(-100.0, 300.0, 9)
# Number of altitudes of a mission to which its mean profile is fitted.
_PROFILE_POINTS = 9
# Largest gradient of a mean profile, 1/s: the range of a scenario's [wind] gradient.
_MAX_GRADIENT = 0.05
# A field that differs from its mean wind by less than this everywhere is the same everywhere, m/s.
UNIFORM_TOLERANCE_MPS = 1e-4


@dataclass(frozen=True, slots=True)
class MeanProfile:
    """Wind of one direction whose speed is linear in altitude.

    speed: m/s at the reference altitude.
    from_course: direction that the wind blows from, rad, 0..2 pi.
    gradient: 1/s.
    """

    speed: float
    from_course: float
    gradient: float

    def velocities_at(self, heights: Floats) -> Floats:
        """Return the wind, m/s, at heights above the reference altitude (m).

        A new last axis has east and north.
        """
        speeds = self.speed + self.gradient * heights
        return np.stack([-speeds * math.sin(self.from_course), -speeds * math.cos(self.from_course)], axis=-1)


def without_levels_above(field: WindField, amsl: float) -> WindField:
    """Return a field without levels that are not needed up to an altitude (m AMSL).

    They are the levels that are above this altitude everywhere, except for the lowest of them.
    """
    lowest = field.altitudes.min(axis=(0, 1, 2))
    count = min(len(lowest), int((lowest <= amsl).sum()) + 1)
    return replace(
        field,
        altitudes=np.ascontiguousarray(field.altitudes[..., :count]),
        velocities=np.ascontiguousarray(field.velocities[..., :count, :]),
    )


def fit_profile_line(heights: Floats, samples: Floats) -> MeanProfile:
    """Fit a mean profile, whose speed is linear in height, to winds at several heights.

    heights: (h,) m above the reference altitude.
    samples: (h, 2) m/s, east and north.

    Each component is a least-squares line over height. Speed and direction are rounded to 1e-5 m/s and 1e-5 degrees.
    """
    offsets = heights - heights.mean()
    slope = offsets @ samples / (offsets @ offsets)
    east, north = samples.mean(axis=0) - heights.mean() * slope
    speed = round(math.hypot(east, north), 5)
    if speed == 0.0:
        return MeanProfile(0.0, 0.0, 0.0)
    from_course = math.radians(round(math.degrees(math.atan2(-east, -north)) % 360.0, 5) % 360.0)
    gradient = -(slope[0] * math.sin(from_course) + slope[1] * math.cos(from_course))
    return MeanProfile(speed, from_course, round(min(_MAX_GRADIENT, max(-_MAX_GRADIENT, float(gradient))), 9))


def fit_mean_profile(
    field: WindField,
    seconds: float,
    latitude: float,
    longitude: float,
    reference_amsl: float,
    altitudes: tuple[float, float],
) -> MeanProfile:
    """Fit the mean profile of a wind field at a time (s on the field's axis) and a place (deg).

    reference_amsl: altitude of the profile's speed, m AMSL.
    altitudes: lowest and highest altitude of the mission, between which the profile is fitted, m AMSL.

    The gradient is limited so that the line of the profile has a speed of at least 0 at all nodes. A flight never uses
    a profile speed below 0, and adds the deviation of the field from the profile.
    """
    points = np.linspace(*altitudes, _PROFILE_POINTS)
    ones = np.ones(points.size)
    samples = field.velocities_at(seconds * ones, latitude * ones, longitude * ones, points)
    profile = fit_profile_line(points - reference_amsl, samples)
    gradient = limit_gradient(profile.gradient, profile.speed, field.altitudes - reference_amsl)
    return replace(profile, gradient=gradient)


def limit_gradient(gradient: float, speed: float, heights: Floats) -> float:
    """Limit the gradient of a mean profile (1/s) so that its speed is at least 0 at all heights.

    speed: m/s at height 0.
    heights: heights above the reference altitude, m, of any shape.

    The gradient is also limited to +-`_MAX_GRADIENT`.
    """
    lowest, highest = min(-1.0, float(heights.min())), max(1.0, float(heights.max()))
    limited = max(min(_MAX_GRADIENT, max(-_MAX_GRADIENT, gradient), speed / -lowest), -speed / highest)
    # Nine decimals, rounded towards 0.
    return math.trunc(limited * 1e9) / 1e9


def subtract_profile(field: WindField, profile: MeanProfile, reference_amsl: float) -> WindField | None:
    """Return the deviation of a wind field from its mean profile.

    Returns None if the profile describes the whole wind: it has no gradient, and the deviations are negligible.
    """
    deviations = field.velocities - profile.velocities_at(field.altitudes - reference_amsl)
    if profile.gradient == 0.0 and float(np.abs(deviations).max()) < UNIFORM_TOLERANCE_MPS:
        return None
    return WindField(field.times, field.latitudes, field.longitudes, field.altitudes, deviations)
