"""How each leg was climbed or descended: slope, height, throttle, and what the aircraft showed that it can."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY, ground_slope
from logs.verdict.measures.leg_fits import CLEAR_OF_TURN, Fit, leg_slope, straight_span
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.track_alignment import AlignedTrack, along_across
from world.kernels import compiled

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Flags = NDArray[np.bool_]

# Throttle at a limit for this long in one leg (s), with the mean airspeed of as long off, is not flyable: a moment's
# saturation is normal.
SATURATED = 5.0
# Air that rises takes speed up with it on a held slope, by g w/V, until drag has eaten it up: about this long, s.  What
# the air explains is not held against the slope.
_SPEED_MEMORY = 12.0
# Share of a window that counts as "at the limit throughout".
_THROUGHOUT = 0.8
# Throttle and battery current (A) that count as at a limit.
_FULL, _IDLE, _NO_CURRENT = 0.99, 0.01, 0.02
# What an aircraft can is seen at its whole throttle alone: 1 % of the Aerosonde's is 0.6 degrees of climb.
_ALL_OF_IT = 0.999
# What an aircraft can is measured over at least this long (s), this long after the throttle came to its limit (s), by
# numbers that are independent after about this long (s); and what speed and acceleration are known to, m/s of climb.
_SHOWN_OVER, _SETTLED_AFTER, _INDEPENDENT, _KNOWN_TO = 1.5, 0.5, 0.5, 0.02
# Moments of a plane beyond this condition number do not determine it.
_SINGULAR = 1e7
# Standard errors that a measured ability may be out by.
SURE = 3.0
# A measured ability with a larger standard error than this (rad) says nothing.
_UNSURE = math.radians(0.3)
# After a change of commanded speed the aircraft is given this to accelerate, m/s^2.
ACCELERATION = 0.5


@dataclass(frozen=True, slots=True)
class Shown:
    """The steepest climb, or dive, that the aircraft showed at a throttle limit.

    slope: over the ground, at the leg's commanded airspeed in the mean wind, rad, positive in the direction of the
    leg.  error: its standard error, rad.  seconds: how long it was seen.
    """

    slope: float
    error: float
    seconds: float

    def covers(self, planned: float) -> bool:
        """Whether it is more, beyond its own error, than a leg's slope (rad) asks."""
        return self.slope - SURE * self.error > abs(planned)


@dataclass(frozen=True, slots=True)
class SlopeMeasure:
    """How one leg was climbed or descended; None where it was not.

    slope: see `Fit`.  height_error: largest distance above (negative: below) the leg's line, m; short: no place on the
    leg is clear of the blends.  at_full, at_idle: s with the throttle at its limits.  slow, fast: the largest 5 s mean
    of airspeed below, above the command meanwhile, as far as no gust explains it, m/s (0 for none).  shown: what the
    aircraft could at the throttle limit that the leg asks for, where the flight came to it.  finished: the leg was
    flown to its end.
    """

    slope: Fit | None = None
    height_error: float | None = None
    short: bool = False
    at_full: float = 0.0
    at_idle: float = 0.0
    slow: float = 0.0
    fast: float = 0.0
    shown: Shown | None = None
    finished: bool = False


def measure_slope(shape: RouteDemands, flown: AlignedTrack, leg: int) -> SlopeMeasure:
    """Measure the slope of a leg as flown."""
    if not flown.flew(leg):
        return SlopeMeasure()
    rows = flown.leg_rows(leg)
    error, short = _height_error(shape, leg, flown.track.position[rows])
    full, idle, slow, fast = _saturation(shape, flown, leg)
    return SlopeMeasure(
        slope=leg_slope(shape, flown, leg),
        height_error=error,
        short=short,
        at_full=full,
        at_idle=idle,
        slow=slow,
        fast=fast,
        shown=measure_ability(shape, flown, leg),
        finished=bool(flown.passed[leg + 1]),
    )


def _height_error(shape: RouteDemands, leg: int, position: Floats) -> tuple[float | None, bool]:
    """Largest signed distance from the leg's line where it is clear of blends, m, and whether nothing is."""
    along, _ = along_across(shape, leg, position)
    low, high = straight_span(shape, leg, CLEAR_OF_TURN, level=True)
    inside = (along >= low) & (along <= high)
    short = not inside.any()
    if short:
        low, high = straight_span(shape, leg, 0.0)
        inside = (along >= low) & (along <= high)
        if not inside.any():
            return None, True
    line = shape.points[leg, 2] + along[inside] * math.tan(shape.slopes[leg])
    off = position[inside, 2] - line
    return float(off[np.argmax(np.abs(off))]), short


def steady_rows(shape: RouteDemands, flown: AlignedTrack, leg: int) -> slice:
    """Rows of a leg after the aircraft has had time to take up its commanded speed; empty for a leg as short."""
    rows = flown.leg_rows(leg)
    speeds = shape.setup.route.airspeed
    change = abs(float(speeds[leg] - speeds[leg - 1])) if leg else 0.0
    start = float(flown.track.time[rows.start]) + change / ACCELERATION
    return slice(max(rows.start, int(np.searchsorted(flown.track.time, start))), rows.stop)


def _saturation(shape: RouteDemands, flown: AlignedTrack, leg: int) -> tuple[float, float, float, float]:
    """Seconds at full and idle throttle, and the speed lost and gained meanwhile, as `SlopeMeasure` has them."""
    rows = steady_rows(shape, flown, leg)
    track = flown.track
    if rows.stop - rows.start < 2:
        return 0.0, 0.0, 0.0, 0.0
    tick = flown.tick()
    full, idle = _at_limits(shape, flown, rows)
    commanded = float(shape.setup.route.airspeed[leg])
    error = track.airspeed[rows].astype(np.float64) - commanded
    # A gust along the track changes the airspeed without any energy, so it has to be off without the gust as well.
    steady = _speed_in_mean_wind(shape, flown, rows) - commanded
    width = max(1, round(SATURATED / tick))
    lifted = lifted_speed(flown.track.time, flown.track.airspeed, flown.track.wind[:, 2], rows.stop)[rows]
    slow = _mean_while(full, np.minimum(-error, -steady) - np.maximum(0.0, -lifted), width)
    fast = _mean_while(idle, np.minimum(error, steady) - np.maximum(0.0, lifted), width)
    return float(full.sum() * tick), float(idle.sum() * tick), slow, fast


def _at_limits(shape: RouteDemands, flown: AlignedTrack, rows: slice) -> tuple[Flags, Flags]:
    """Which rows have the throttle at full, and which at idle."""
    track = flown.track
    throttle = track.controls[rows, 3]
    full = throttle >= _FULL
    idle = throttle <= _IDLE
    # An aircraft that burns fuel draws no current at all.
    if not shape.setup.envelope.motor_braking and track.current.any():
        idle |= (track.current[rows] <= _NO_CURRENT) & ~full
    return full, idle


def measure_ability(shape: RouteDemands, flown: AlignedTrack, leg: int) -> Shown | None:
    """What the aircraft could at the throttle limit that a leg asks for: full to climb, idle to dive.

    Thrust less drag gives an aircraft the climb rate v_up + v . a / g, where v is its velocity relative to the air and
    a its acceleration over the ground: exact in any gust, for lift does no work.  A least-squares plane over airspeed
    and height gives it at the commanded airspeed, at the highest place where it was seen, where an aircraft can least.
    """
    rows = steady_rows(shape, flown, leg)
    track, sign = flown.track, 1.0 if shape.slopes[leg] >= 0.0 else -1.0
    if rows.stop - rows.start < 3:
        return None
    full, idle = _at_limits(shape, flown, rows)
    full &= track.controls[rows, 3] >= _ALL_OF_IT
    along, _ = along_across(shape, leg, track.position[rows])
    low, high = straight_span(shape, leg, 0.0)
    use = _held_for(full if sign > 0.0 else idle, round(_SETTLED_AFTER / flown.tick()))
    use &= (along >= low) & (along <= high)
    seconds = float(use.sum() * flown.tick())
    if seconds < _SHOWN_OVER:
        return None
    velocity = track.velocity[rows].astype(np.float64)
    air = velocity - track.wind[rows]
    push = np.gradient(velocity, track.time[rows], axis=0)
    rate = (air[:, 2] + (air * push).sum(axis=1) / GRAVITY)[use]
    commanded, up = float(shape.setup.route.airspeed[leg]), track.position[rows, 2][use]
    top = float(up.max())
    faster = np.sqrt((air[use] ** 2).sum(axis=1)) - commanded
    fit = _plane_at_origin(rate, faster, 0.01 * (up - top), seconds / _INDEPENDENT)
    if fit is None:
        return None
    tail, cross = shape.setup.scenario.wind.along(float(shape.courses[leg]), top)
    slopes = [
        ground_slope(math.asin(min(1.0, max(-1.0, value / commanded))), commanded, tail, cross)
        for value in (fit[0], fit[0] + fit[1])
    ]
    error = abs(slopes[1] - slopes[0])
    # Written so that NaN says nothing.
    return Shown(sign * slopes[0], error, seconds) if error <= _UNSURE else None


def _held_for(mask: Flags, count: int) -> Flags:
    """Rows of ``mask`` that the ``count`` rows before are in as well."""
    row = np.arange(mask.size)
    return np.asarray(row - np.maximum.accumulate(np.where(mask, -1, row)) > count)


def _plane_at_origin(value: Floats, x: Floats, y: Floats, independent: float) -> tuple[float, float] | None:
    """Value at x = y = 0 of the least-squares plane, and its standard error; None where it is not determined."""
    columns = [np.ones_like(x), x] + ([y] if np.ptp(y) > 1e-3 else [])
    table = np.column_stack(columns)
    moments = table.T @ table / len(x)
    if np.linalg.cond(moments) > _SINGULAR:
        return None
    inverse = np.linalg.inv(moments)
    found = inverse @ (table.T @ value) / len(x)
    rest = value - table @ found
    return float(found[0]), math.sqrt(float((rest.var() + _KNOWN_TO**2) * inverse[0, 0]) / independent)


def _speed_in_mean_wind(shape: RouteDemands, flown: AlignedTrack, rows: slice) -> Floats:
    """Speed that the air would see without gusts, m/s."""
    wind, track = shape.setup.scenario.wind, flown.track
    mean = np.array([wind.at(float(up)) for up in track.position[rows, 2]]).reshape(-1, 2)
    east, north = track.velocity[rows, 0] - mean[:, 0], track.velocity[rows, 1] - mean[:, 1]
    return np.asarray(np.sqrt(east**2 + north**2 + track.velocity[rows, 2].astype(np.float64) ** 2))


@compiled
def lifted_speed(time: Floats, airspeed: Singles, rising: Singles, stop: int) -> Floats:  # pragma: no cover - compiled
    """Airspeed gained from rising air (m/s) in rows 0..stop, as it fades, for an aircraft that holds its path."""
    out = np.zeros(stop)
    for k in range(1, stop):
        step = time[k] - time[k - 1]
        gain = GRAVITY * rising[k] / max(10.0, airspeed[k])
        out[k] = (out[k - 1] + gain * step) / (1.0 + step / _SPEED_MEMORY)
    return out


def _mean_while(mask: NDArray[np.bool_], value: Floats, width: int) -> float:
    """Largest mean of ``value`` over ``width`` rows of which most are in ``mask``; 0 where there are none."""
    if mask.size < width:
        return 0.0
    total = np.concatenate([[0.0], np.cumsum(value)])
    count = np.concatenate([[0], np.cumsum(mask)])
    means = (total[width:] - total[:-width]) / width
    held = count[width:] - count[:-width] >= _THROUGHOUT * width
    return max(0.0, float(means[held].max())) if held.any() else 0.0
