"""Clean the positions of a log: remove clock jumps, sort the rows, and remove and count faulty rows.

No rows are added.  First backward jumps of the clock are removed, then rows are sorted, then positions that no aircraft
can have reached are removed.
"""

import math
from dataclasses import dataclass

import numpy as np

from flight.simulation.setup import Gap, RowFaults
from flight.simulation.track import MAX_TIME_S
from logs.importers.raw_log import LogSeries
from world.arrays import Flags, Floats

# ----------------------------------------------------------------------
# The clock: permanent jumps back are removed, and late rows are sorted.

# Largest lag behind the latest time that a row out of order can have, s; a clock that stays farther behind has jumped.
MAX_CLOCK_LAG_S = 1.0
# Number of successive late rows that show that the clock jumped.
MIN_LATE_ROWS = 8


@dataclass(frozen=True, slots=True)
class SteadyClock:
    """Times of a log's rows after the backward jumps of its clock were removed.

    time: times of the rows, s, (n,); the times after each jump are shifted.
    jumps: time of the last row before each jump, s, on the clock without jumps.
    """

    time: Floats
    jumps: tuple[float, ...]


def remove_clock_jumps(time: Floats, usual_step: float = 0.1) -> SteadyClock:
    """Remove the backward jumps of a log's clock from the times of its rows.

    A row is late if its time is more than `MAX_CLOCK_LAG_S` before the latest time so far.  If `MIN_LATE_ROWS` rows in
    sequence, or all rows to the end, are late, the clock has been reset.  The first row after the reset is then moved
    to `usual_step` after the latest row before it, and all later rows are shifted by the same time.  A single row out
    of order, also at the end, keeps its time.

    time: times of the rows in the order of the file, s, (n,).
    usual_step: assumed time between the last row before a jump and the first row after it, s.

    >>> remove_clock_jumps(np.array([10.0, 11.0, *range(2, 14)]), usual_step=1.0).time.tolist()
    [10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0, 19.0, 20.0, 21.0, 22.0, 23.0]
    >>> float(remove_clock_jumps(np.array([10.0, 11.0, 5.0, *range(12, 24)])).time[2])
    5.0
    """
    shifted = np.array(time, dtype=np.float64)
    jumps: list[float] = []
    begin = 0
    while begin < shifted.size:
        latest = np.maximum.accumulate(shifted[begin:])
        for jump in np.flatnonzero(shifted[begin:] < latest - MAX_CLOCK_LAG_S).tolist():
            following = shifted[begin + jump : begin + jump + MIN_LATE_ROWS]
            if following.size > 1 and (following < latest[jump - 1] - MAX_CLOCK_LAG_S).all():
                break
        else:
            break
        begin += jump
        jumps.append(float(latest[jump - 1]))
        shifted[begin:] += latest[jump - 1] + usual_step - shifted[begin]
    return SteadyClock(shifted, tuple(jumps))


# ----------------------------------------------------------------------
# Positions, gaps and glitches.

# Longest pause between rows that is not a gap, s.
MAX_STEP_S = 1.0
# Longest pause that is not a gap, in median steps between rows; the longer of both limits applies.
MAX_STEP_RATIO = 1.5
# A position that is reached and left at a higher speed than `GLITCH_SPEED_RATIO` times the usual speed plus this speed
# (m/s) is a glitch.  GPS receivers jump by kilometers, and no aircraft gains this speed between two rows.
GLITCH_SPEED_MPS = 60.0
# Factor of the usual speed in the test for glitches.
GLITCH_SPEED_RATIO = 3.0
# Greatest number of successive rows of a glitch; more rows are a new position.
MAX_GLITCH_ROWS = 20
# A pause longer than this without a corresponding distance is a clock jump, s.
MIN_CLOCK_JUMP_S = 5.0
# Largest distance that an aircraft travels during a clock jump, in usual steps.
MAX_JUMP_STEPS = 6.0
# Minimum usual speed in the test for clock jumps, m/s: positions of an aircraft at rest show no clock jump.
MIN_MOVING_SPEED_MPS = 5.0
# Length of a degree of latitude, m, on a sphere of the mean radius of WGS 84.
DEGREE_LENGTH_M = math.radians(1.0) * 6_371_008.8
# Lowest altitude that is accepted, m.
_MIN_ALTITUDE_M = -1000.0
# Highest altitude that is accepted, m.
_MAX_ALTITUDE_M = 50_000.0


@dataclass(frozen=True, slots=True)
class CleanPositions:
    """The positions of a vehicle, cleaned and in order of time.

    time: increasing times, s, (n,).
    lat, lon: latitude and longitude, degrees, (n,).
    up: altitude, m, (n,); NaN if not in the log.
    faults: number of corrected faults of each kind.
    gaps: long pauses between rows, see `find_gaps`.
    shifts: (start, shift), s, of each removed forward jump of the clock: all times from `start` on, on the log's clock,
        are moved back by `shift`.
    """

    time: Floats
    lat: Floats
    lon: Floats
    up: Floats
    faults: RowFaults
    gaps: tuple[Gap, ...]
    shifts: tuple[tuple[float, float], ...] = ()

    def to_steady_clock(self, time: Floats) -> Floats:
        """Convert times on the log's clock to the clock without forward jumps, s, (n,)."""
        shifted = np.array(time, dtype=np.float64)
        for start, shift in self.shifts:
            shifted[np.asarray(time) >= start] -= shift
        return shifted


def clean_positions(series: LogSeries, earlier_jumps: tuple[float, ...] = ()) -> CleanPositions:
    """Sort the rows of a log's positions, remove faulty rows, and count the faults.

    Faulty rows are: rows without a valid time, position or altitude; rows with the time of an earlier row; glitches;
    small groups of rows whose times are far from all others.  Forward jumps of the clock are removed, but not the rows
    after them.

    series: latitude and longitude (degrees) and altitude (m), (n, 3).
    earlier_jumps: times of the clock jumps that the reader of the log has already removed, s; they are added to the
        faults.

    >>> rows = np.array([[46.0, 8.0, 500.0], [46.0002, 8.0, 500.0], [46.0002, 8.0, 500.0], [47.0, 8.0, 500.0]])
    >>> more = np.array([[46.0004 + 0.0002 * k, 8.0, 500.0] for k in range(4)])
    >>> time = np.array([0.0, 1.0, 1.0, 1.5, 2.0, 3.0, 4.0, 9.0])
    >>> found = clean_positions(LogSeries("POS", time, np.concatenate([rows, more])))
    >>> found.time.tolist(), found.faults.doubled, found.faults.glitches, found.gaps
    ([0.0, 1.0, 2.0, 3.0, 4.0, 9.0], 1, 1, (Gap(start=4.0, end=9.0),))
    """
    time, values = series.time, series.values
    # A position at latitude 0 and longitude 0 is invalid.
    latitude, longitude, altitude = values.T
    with np.errstate(invalid="ignore"):
        has_position = (
            (np.abs(latitude) <= 90.0) & (np.abs(longitude) <= 180.0) & ((latitude != 0.0) | (longitude != 0.0))
        )
        # A row without altitude is unusable, unless no row has one.
        has_valid_altitude = ~np.isfinite(altitude) | ((altitude > _MIN_ALTITUDE_M) & (altitude < _MAX_ALTITUDE_M))
        is_known = np.isfinite(altitude) if np.isfinite(altitude).any() else np.ones(altitude.size, bool)
        is_usable = np.asarray((time >= 0.0) & (time < 1e9) & has_position & has_valid_altitude & is_known)
    unusable = int(is_usable.size - is_usable.sum())
    time, values = time[is_usable], values[is_usable]
    order = np.argsort(time, kind="stable")
    # Count the rows that follow a row with a later time.
    unordered = int((time < np.maximum.accumulate(time)).sum()) if time.size else 0
    time, values = time[order], values[order]
    is_new = np.concatenate([[True], np.diff(time) > 0.0]) if time.size else np.zeros(0, bool)
    duplicates = int(is_new.size - is_new.sum())
    time, values = time[is_new], values[is_new]
    is_glitch = _find_glitches(time, values)
    time, values = time[~is_glitch], values[~is_glitch]
    # The rows of small groups, whose times are far from all other times, are left out. A pause of more than
    # `MAX_TIME_S` separates two groups.
    groups = np.cumsum(np.concatenate([[0], np.diff(time) > MAX_TIME_S])) if time.size else np.zeros(0, np.int64)
    counts = np.bincount(groups)
    is_in_group = np.asarray((counts >= min(MIN_LATE_ROWS, int(counts.max(initial=0))))[groups])
    time, shifts = _remove_forward_jumps(time[is_in_group], values[is_in_group])
    is_in_range = time < MAX_TIME_S
    time, values = time[is_in_range], values[is_in_group][is_in_range]
    unusable += is_in_group.size - time.size
    jumps = tuple(sorted((*earlier_jumps, *(start for start, _ in shifts))))
    faults = RowFaults(duplicates, unordered, unusable, int(is_glitch.sum()), jumps)
    lat, lon, up = values.T if len(values) else np.zeros((3, 0))
    return CleanPositions(time, lat.copy(), lon.copy(), up.copy(), faults, find_gaps(time), shifts)


def find_gaps(time: Floats) -> tuple[Gap, ...]:
    """Return the gaps between rows.

    A gap is a pause longer than both `MAX_STEP_S` and `MAX_STEP_RATIO` median steps.

    time: increasing times of the rows, s, (n,).
    """
    if time.size < 2:
        return ()
    steps = np.diff(time)
    max_step = max(MAX_STEP_S, MAX_STEP_RATIO * float(np.median(steps)))
    # The tolerance covers rounding: exactly a second between rows is not a gap.
    return tuple(Gap(float(time[k]), float(time[k + 1])) for k in np.flatnonzero(steps > max_step + 1e-6))


def measure_steps(lat: Floats, lon: Floats) -> Floats:
    """Return the distances between successive positions, m, (n - 1,), also across the antimeridian.

    lat, lon: latitude and longitude of each position, degrees, (n,).
    """
    north = np.diff(lat) * DEGREE_LENGTH_M
    east = (np.diff(lon) + 180.0) % 360.0 - 180.0
    return np.hypot(north, east * DEGREE_LENGTH_M * np.cos(np.radians(0.5 * (lat[1:] + lat[:-1]))))


def _find_glitches(time: Floats, values: Floats) -> Flags:
    """Find glitches: rows far from the path of the vehicle.  Return a mask (n,), True for their rows.

    A glitch begins with a leap that no vehicle can fly and ends with a second leap, after which the vehicle is at a
    position that it could have reached from the last row before the glitch.  It has at most `MAX_GLITCH_ROWS` rows.
    The first or the last row is also a glitch if a leap separates it from the others.  Fewer than five rows have none.

    time: increasing times, s, (n,).
    values: latitude and longitude (degrees) and altitude (m), (n, 3).
    """
    is_glitch = np.zeros(time.size, bool)
    if time.size < 5:
        return is_glitch
    lat, lon, up = values.T
    steps = np.diff(time)
    speed = measure_steps(lat, lon) / np.maximum(steps, 1e-3)
    max_speed = GLITCH_SPEED_MPS + GLITCH_SPEED_RATIO * float(np.median(speed))
    rise = np.abs(np.diff(up)) / np.maximum(steps, 1e-3)
    leaps = np.flatnonzero((speed > max_speed) | (np.nan_to_num(rise) > max_speed))
    k = 0
    while k < leaps.size:
        # A glitch begins with one leap and ends with a later leap back to the path.
        first_leap = int(leaps[k])
        for return_leap in leaps[k + 1 :].tolist():
            if return_leap - first_leap > MAX_GLITCH_ROWS:
                break
            second = return_leap + 1
            pair = [first_leap, second]
            distance = float(measure_steps(values[pair, 0], values[pair, 1])[0])
            height_change = abs(float(values[second, 2] - values[first_leap, 2]))
            duration = float(time[second] - time[first_leap])
            is_reachable = max(distance, 0.0 if math.isnan(height_change) else height_change) <= max_speed * duration
            if is_reachable:
                is_glitch[first_leap + 1 : return_leap + 1] = True
                k = int(np.searchsorted(leaps, return_leap))
                break
        else:
            if first_leap == 0:
                is_glitch[0] = True
            elif first_leap == time.size - 2:
                is_glitch[-1] = True
        k += 1
    return is_glitch


def _remove_forward_jumps(time: Floats, values: Floats) -> tuple[Floats, tuple[tuple[float, float], ...]]:
    """Remove forward jumps of the clock.

    They are long time steps in which a moving vehicle hardly changed its position.  Return the shifted times, s, (n,),
    and the shifts as in `CleanPositions.shifts`.  The times of fewer than 20 rows are not changed.

    time: increasing times, s, (n,).
    values: latitude and longitude (degrees) and altitude (m), (n, 3).
    """
    shifts: list[tuple[float, float]] = []
    if time.size < 20:
        return time, ()
    steps = np.diff(time)
    distances = measure_steps(values[:, 0], values[:, 1])
    usual_step = float(np.median(steps))
    for k in np.flatnonzero(steps > max(MIN_CLOCK_JUMP_S, 2.0 * MAX_JUMP_STEPS * usual_step)).tolist():
        neighbours = slice(max(0, k - 5), k + 6)
        is_ordinary = steps[neighbours] <= MAX_JUMP_STEPS * usual_step
        if is_ordinary.sum() < 4:
            continue
        speed = float((distances[neighbours][is_ordinary] / steps[neighbours][is_ordinary]).min())
        if speed > MIN_MOVING_SPEED_MPS and distances[k] <= speed * MAX_JUMP_STEPS * usual_step:
            shifts.append((float(time[k + 1]), float(steps[k] - usual_step)))
    shifted = time.copy()
    for start, shift in shifts:
        shifted[time >= start] -= shift
    return shifted, tuple(shifts)
