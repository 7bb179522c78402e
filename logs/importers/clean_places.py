"""The places of a log in order: rows that are doubled, late or impossible are dropped and counted, none is made up.

First the clock is made steady, then rows are sorted, then places that no aircraft can have been at are taken out.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight.simulation.setup import Gap, RowFaults
from flight.simulation.track import LATEST
from logs.importers.raw_log import LogSeries

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


# ----------------------------------------------------------------------
# The clock: jumps back for good are taken out, and rows that came late find their place.

# A clock that is behind by this (s) over this many rows in a row has jumped; less is a row out of order.
BEHIND, ROWS_BEHIND = 1.0, 8


@dataclass(frozen=True, slots=True)
class SteadyClock:
    """Times as a steady clock would have them.

    time: (n,) s, those after a jump moved on.
    jumps: s, of the steady clock, at which the clock went back for good.
    """

    time: Floats
    jumps: tuple[float, ...]


def steady_clock(time: Floats, usual: float = 0.1) -> SteadyClock:
    """Times (n,) of a log's rows in the order of the file, without jumps back.

    A clock that goes back and stays there has been set anew: what follows is moved on, so that it comes ``usual`` s
    after what was before.  A row that alone is out of order keeps its time.

    >>> steady_clock(np.array([10.0, 11.0, *range(2, 14)]), usual=1.0).time.tolist()
    [10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0, 19.0, 20.0, 21.0, 22.0, 23.0]
    >>> float(steady_clock(np.array([10.0, 11.0, 5.0, *range(12, 24)])).time[2])
    5.0
    """
    moved = np.array(time, dtype=np.float64)
    jumps: list[float] = []
    begin = 0
    while begin < moved.size:
        latest = np.maximum.accumulate(moved[begin:])
        behind = np.flatnonzero(moved[begin:] < latest - BEHIND)
        jump = _first_for_good(behind, moved[begin:], latest)
        if jump < 0:
            break
        at = begin + jump
        jumps.append(float(latest[jump - 1]))
        moved[at:] += latest[jump - 1] + usual - moved[at]
        begin = at
    return SteadyClock(moved, tuple(jumps))


def _first_for_good(behind: Ints, time: Floats, latest: Floats) -> int:
    """The first row from which on as many rows are behind as make a jump, or all to the end; -1 for none."""
    for k in behind.tolist():
        until = min(k + ROWS_BEHIND, time.size)
        if until - k >= min(ROWS_BEHIND, 2) and (time[k:until] < latest[k - 1] - BEHIND).all():
            return int(k)
    return -1


# ----------------------------------------------------------------------
# Places, gaps and glitches.

# A pause between rows longer than this (s), or than so many usual steps where rows are rarer, is a gap.
LONGEST_STEP, USUAL_STEPS = 1.0, 1.5
# A place that takes this much (m/s) more than so many times the usual speed to get to and back from is none: GPS
# receivers jump by kilometres, and no aircraft gains as much between two rows.
GLITCH_SPEED, GLITCH_TIMES = 60.0, 3.0
# As many rows in a row may be out of place; more is a new place.
GLITCH_ROWS = 20
# A pause (s) over which the aircraft went no further than in this many usual steps is the clock's.
JUMP, JUMP_STEPS = 5.0, 6.0
# Below this speed (m/s) nothing is said of it: an aircraft on the ground goes nowhere in any time.
MOVING = 5.0
# m on a degree of latitude, on the sphere of WGS 84's mean radius.
DEGREE = math.radians(1.0) * 6_371_008.8
_LOWEST, _HIGHEST = -1000.0, 50_000.0


@dataclass(frozen=True, slots=True)
class Places:
    """Where the vehicle was, in order.

    time: (n,) s, increasing.  lat, lon: (n,) degrees.  up: (n,) m, NaN where the log has none.
    faults: what was put right, in numbers.
    gaps: pauses.
    shifts: times from which on, and seconds by which, the log's clock was moved back to take out its jumps.
    """

    time: Floats
    lat: Floats
    lon: Floats
    up: Floats
    faults: RowFaults
    gaps: tuple[Gap, ...]
    shifts: tuple[tuple[float, float], ...] = ()

    def on_clock(self, time: Floats) -> Floats:
        """Times of the log's clock on the clock without jumps."""
        moved = np.array(time, dtype=np.float64)
        for start, seconds in self.shifts:
            moved[np.asarray(time) >= start] -= seconds
        return moved


def clean_places(series: LogSeries, earlier_jumps: tuple[float, ...] = ()) -> Places:
    """Put rows of latitude, longitude and height in order.

    earlier_jumps: of the clock, that the reader has taken out already.

    >>> rows = np.array([[46.0, 8.0, 500.0], [46.0002, 8.0, 500.0], [46.0002, 8.0, 500.0], [47.0, 8.0, 500.0]])
    >>> more = np.array([[46.0004 + 0.0002 * k, 8.0, 500.0] for k in range(4)])
    >>> time = np.array([0.0, 1.0, 1.0, 1.5, 2.0, 3.0, 4.0, 9.0])
    >>> found = clean_places(LogSeries("POS", time, np.concatenate([rows, more])))
    >>> found.time.tolist(), found.faults.doubled, found.faults.glitches, found.gaps
    ([0.0, 1.0, 2.0, 3.0, 4.0, 9.0], 1, 1, (Gap(start=4.0, end=9.0),))
    """
    time, values = series.time, series.values
    good = _usable(time, values)
    unusable = int(good.size - good.sum())
    time, values = time[good], values[good]
    order = np.argsort(time, kind="stable")
    # A row that came after one of a later time.
    unordered = int((time < np.maximum.accumulate(time)).sum()) if time.size else 0
    time, values = time[order], values[order]
    fresh = np.concatenate([[True], np.diff(time) > 0.0]) if time.size else np.zeros(0, bool)
    doubled = int(fresh.size - fresh.sum())
    time, values = time[fresh], values[fresh]
    out = _glitches(time, values)
    time, values = time[~out], values[~out]
    near = _near_others(time)
    time, shifts = _without_jumps(time[near], values[near])
    held = time < LATEST
    time, values = time[held], values[near][held]
    unusable += near.size - time.size
    jumps = tuple(sorted((*earlier_jumps, *(start for start, _ in shifts))))
    faults = RowFaults(doubled, unordered, unusable, int(out.sum()), jumps)
    lat, lon, up = values.T if len(values) else np.zeros((3, 0))
    return Places(time, lat.copy(), lon.copy(), up.copy(), faults, find_gaps(time), shifts)


def find_gaps(time: Floats) -> tuple[Gap, ...]:
    """Pauses between rows (n,) s."""
    if time.size < 2:
        return ()
    steps = np.diff(time)
    most = max(LONGEST_STEP, USUAL_STEPS * float(np.median(steps)))
    # A hair more, so that a second between rows is none whatever its last bit.
    return tuple(Gap(float(time[k]), float(time[k + 1])) for k in np.flatnonzero(steps > most + 1e-6))


def metres_between(lat: Floats, lon: Floats) -> Floats:
    """Distance from each place (n,) to the next, m: (n - 1,), across the 180th meridian where that is shorter."""
    north = np.diff(lat) * DEGREE
    east = (np.diff(lon) + 180.0) % 360.0 - 180.0
    return np.hypot(north, east * DEGREE * np.cos(np.radians(0.5 * (lat[1:] + lat[:-1]))))


def _usable(time: Floats, values: Floats) -> Flags:
    lat, lon, up = values.T
    with np.errstate(invalid="ignore"):
        placed = (np.abs(lat) <= 90.0) & (np.abs(lon) <= 180.0) & ((lat != 0.0) | (lon != 0.0))
        # A log without heights has none at all; a height that is none is another matter.
        high = ~np.isfinite(up) | ((up > _LOWEST) & (up < _HIGHEST))
        known = np.isfinite(up) if np.isfinite(up).any() else np.ones(up.size, bool)
        return np.asarray((time >= 0.0) & (time < 1e9) & placed & high & known)


def _glitches(time: Floats, values: Floats) -> Flags:
    """Rows that the vehicle cannot have been at, for it was elsewhere before and after."""
    out = np.zeros(time.size, bool)
    if time.size < 5:
        return out
    lat, lon, up = values.T
    steps = np.diff(time)
    speed = metres_between(lat, lon) / np.maximum(steps, 1e-3)
    most = GLITCH_SPEED + GLITCH_TIMES * float(np.median(speed))
    rise = np.abs(np.diff(up)) / np.maximum(steps, 1e-3)
    leaps = np.flatnonzero((speed > most) | (np.nan_to_num(rise) > most))
    k = 0
    while k < leaps.size:
        # Gone at one leap and back at one of the next.
        begin = int(leaps[k])
        for back in leaps[k + 1 :].tolist():
            if back - begin > GLITCH_ROWS:
                break
            if _near(time, values, begin, back + 1, most):
                out[begin + 1 : back + 1] = True
                k = int(np.searchsorted(leaps, back))
                break
        else:
            if begin == 0:
                out[0] = True
            elif begin == time.size - 2:
                out[-1] = True
        k += 1
    return out


def _near(time: Floats, values: Floats, one: int, other: int, most: float) -> bool:
    pair = [one, other]
    away = float(metres_between(values[pair, 0], values[pair, 1])[0])
    rise = abs(float(values[other, 2] - values[one, 2]))
    seconds = float(time[other] - time[one])
    return max(away, 0.0 if math.isnan(rise) else rise) <= most * seconds


def _near_others(time: Floats) -> Flags:
    """Rows, by their times in order (n,), that are not a few alone, further from all others than a log can hold."""
    parts = np.cumsum(np.concatenate([[0], np.diff(time) > LATEST])) if time.size else np.zeros(0, np.int64)
    counts = np.bincount(parts)
    return np.asarray((counts >= min(ROWS_BEHIND, int(counts.max(initial=0))))[parts])


def _without_jumps(time: Floats, values: Floats) -> tuple[Floats, tuple[tuple[float, float], ...]]:
    """Times without jumps forward: pauses in which a vehicle on the move got no further than in a usual step."""
    shifts: list[tuple[float, float]] = []
    if time.size < 20:
        return time, ()
    steps = np.diff(time)
    away = metres_between(values[:, 0], values[:, 1])
    usual = float(np.median(steps))
    for k in np.flatnonzero(steps > max(JUMP, 2.0 * JUMP_STEPS * usual)).tolist():
        around = slice(max(0, k - 5), k + 6)
        ordinary = steps[around] <= JUMP_STEPS * usual
        if ordinary.sum() < 4:
            continue
        speed = float((away[around][ordinary] / steps[around][ordinary]).min())
        if speed > MOVING and away[k] <= speed * JUMP_STEPS * usual:
            shifts.append((float(time[k + 1]), float(steps[k] - usual)))
    moved = time.copy()
    for start, seconds in shifts:
        moved[time >= start] -= seconds
    return moved, tuple(shifts)
