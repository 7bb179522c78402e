"""The slope rule: can each leg be climbed or descended at its speed, and was it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.compiled import compiled
from aircraft.envelope import GRAVITY
from logs.fits import CLEAR_OF_TURN, Fit, leg_slope, straight_span
from logs.flown import Flown, along_across
from logs.route_shape import RouteShape
from logs.rules_turn import PLAN_TOLERANCE
from logs.verdict import Finding, make_finding
from world.limits import arc_slope
from world.wind import W20

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

# A leg passes if its fitted slope is within this (rad) of the plan, beside the fit's own tolerance, and its height
# within this (m) of the leg's line, away from the blends at its ends; more where there is no such place.
OFF_SLOPE = math.radians(0.5)
OFF_HEIGHT = 10.0
OFF_HEIGHT_SHORT = 15.0
# A leg within this (rad) of level.
LEVEL = math.radians(0.5)
# Throttle at a limit for this long in one leg (s), with the mean airspeed of as long off by this (m/s, and a gust's
# standard deviation in turbulence), is not flyable: a moment's saturation is normal.
SATURATED = 5.0
OFF_SPEED = 1.0
# Air that rises takes speed up with it on a held slope, by g w/V, until drag has eaten it up: about this long, s.  What
# the air explains is not held against the slope.
_SPEED_MEMORY = 12.0
# Standard deviation of the gust along the track, as a share of the wind at 6 m (MIL-F-8785C: 0.1 high up to 0.2 at the
# ground).
GUST_SHARE = 0.15
# Share of a window that counts as "at the limit throughout".
_THROUGHOUT = 0.8
# Throttle and battery current (A) that count as at a limit.
_FULL, _IDLE, _NO_CURRENT = 0.99, 0.01, 0.02
# After a change of commanded speed the aircraft is given this to accelerate, m/s^2.
ACCELERATION = 0.5


@dataclass(frozen=True, slots=True)
class SlopeMeasure:
    """How one leg was climbed or descended; None where it was not.

    slope: see `Fit`.  height_error: largest distance above (negative: below) the leg's line, m; short: no place on the
    leg is clear of the blends.  at_full, at_idle: s with the throttle at its limits.  slow, fast: the largest 5 s mean
    of airspeed below, above the command meanwhile, as far as no gust explains it, m/s (0 for none).  finished: the leg
    was flown to its end.
    """

    slope: Fit | None = None
    height_error: float | None = None
    short: bool = False
    at_full: float = 0.0
    at_idle: float = 0.0
    slow: float = 0.0
    fast: float = 0.0
    finished: bool = False


def slope_findings(shape: RouteShape, flown: Flown | None, *, geometric: bool = False) -> list[Finding]:
    """Judge each leg; ``geometric`` judges the route alone, without a flight."""
    out = []
    for leg in range(shape.legs):
        measure = None if geometric else SlopeMeasure()
        if flown is not None:
            measure = measure_slope(shape, flown, leg)
        out.append(_judge(shape, leg, measure))
    return out


def slope_limit(shape: RouteShape, leg: int) -> tuple[float, str]:
    """Tighter limit on a leg's climb or, for a leg that falls, dive: rad, positive, and whose it is."""
    rising = shape.slopes[leg] >= 0.0
    fixed = shape.limits.max_climb if rising else shape.limits.max_dive
    aircraft = float((shape.climb if rising else shape.dive)[leg])
    if fixed is not None and fixed <= aircraft:
        return fixed, "scenario"
    return aircraft, "aircraft" if math.isfinite(aircraft) else "none"


def measure_slope(shape: RouteShape, flown: Flown, leg: int) -> SlopeMeasure:
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
        finished=bool(flown.passed[leg + 1]),
    )


def _height_error(shape: RouteShape, leg: int, position: Floats) -> tuple[float | None, bool]:
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


def steady_rows(shape: RouteShape, flown: Flown, leg: int) -> slice:
    """Rows of a leg after the aircraft has had time to take up its commanded speed; empty for a leg as short."""
    rows = flown.leg_rows(leg)
    speeds = shape.setup.route.airspeed
    change = abs(float(speeds[leg] - speeds[leg - 1])) if leg else 0.0
    start = float(flown.track.time[rows.start]) + change / ACCELERATION
    return slice(max(rows.start, int(np.searchsorted(flown.track.time, start))), rows.stop)


def _saturation(shape: RouteShape, flown: Flown, leg: int) -> tuple[float, float, float, float]:
    """Seconds at full and idle throttle, and the speed lost and gained meanwhile, as `SlopeMeasure` has them."""
    rows = steady_rows(shape, flown, leg)
    track = flown.track
    if rows.stop - rows.start < 2:
        return 0.0, 0.0, 0.0, 0.0
    tick = flown.tick()
    throttle = track.controls[rows, 3]
    full = throttle >= _FULL
    idle = throttle <= _IDLE
    # An aircraft that burns fuel draws no current at all.
    if not shape.setup.envelope.motor_braking and track.current.any():
        idle |= (track.current[rows] <= _NO_CURRENT) & ~full
    commanded = float(shape.setup.route.airspeed[leg])
    error = track.airspeed[rows].astype(np.float64) - commanded
    # A gust along the track changes the airspeed without any energy, so it has to be off without the gust as well.
    steady = _speed_in_mean_wind(shape, flown, rows) - commanded
    width = max(1, round(SATURATED / tick))
    lifted = _lifted(flown.track.time, flown.track.airspeed, flown.track.wind[:, 2], rows.stop)[rows]
    slow = _mean_while(full, np.minimum(-error, -steady) - np.maximum(0.0, -lifted), width)
    fast = _mean_while(idle, np.minimum(error, steady) - np.maximum(0.0, lifted), width)
    return float(full.sum() * tick), float(idle.sum() * tick), slow, fast


def _speed_in_mean_wind(shape: RouteShape, flown: Flown, rows: slice) -> Floats:
    """Speed that the air would see without gusts, m/s."""
    wind, track = shape.setup.scenario.wind, flown.track
    speed = np.maximum(0.0, wind.speed + wind.gradient * (track.position[rows, 2] - wind.reference_amsl))
    east = track.velocity[rows, 0] + speed * math.sin(wind.from_course)
    north = track.velocity[rows, 1] + speed * math.cos(wind.from_course)
    return np.asarray(np.sqrt(east**2 + north**2 + track.velocity[rows, 2].astype(np.float64) ** 2))


@compiled
def _lifted(time: Floats, airspeed: Singles, rising: Singles, stop: int) -> Floats:  # pragma: no cover - compiled
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


def _judge(shape: RouteShape, leg: int, measure: SlopeMeasure | None) -> Finding:
    planned = float(shape.slopes[leg])
    limit, source = slope_limit(shape, leg)
    sign = 1.0 if planned >= 0.0 else -1.0
    if abs(planned) <= LEVEL and not _in_envelope(shape, leg):
        # A level leg at a speed that the aircraft cannot fly fails by its speed, not by its slope.
        limit = max(limit, LEVEL)
    wrong = [_too_steep(shape, leg, limit, source)] if abs(planned) > limit + PLAN_TOLERANCE else []
    wrong += _steep_arc(shape, leg, limit)
    facts = [f"slope {math.degrees(planned):+.2f}°"]
    fit: Fit | None = None
    method = "route"
    if measure is not None:
        said, faults = _evidence(shape, leg, measure, limit)
        facts += said
        wrong += faults
        fit = measure.slope
        method = "not flown"
        if fit is not None:
            how = "least squares" if fit.fitted else "least squares, short leg,"
            method = f"{how} over {fit.run:.0f} m"
    ok: bool | None = not wrong
    if measure is not None and not measure.finished:
        facts.append("the flight did not get to its end")
        ok = None if ok else False
    text = "; ".join(facts)
    judged = planned if fit is None else fit.value
    return make_finding(
        "slope",
        f"leg {leg}",
        ok=ok,
        reason="; ".join(wrong) + (f" ({text})" if measure is not None else "") if wrong else text,
        planned=math.degrees(planned),
        flown=None if fit is None else math.degrees(fit.value),
        limit=math.degrees(sign * limit),
        source=source,
        tolerance=math.degrees(PLAN_TOLERANCE if fit is None else fit.tolerance),
        margin=math.degrees(limit - sign * judged),
        unit="deg",
        method=method,
    )


def _steep_arc(shape: RouteShape, leg: int, limit: float) -> list[str]:
    """What the fly-by arc at a leg's end asks beyond its limit, where that costs or gives more than `OFF_SPEED`.

    The arc is shorter than its two tangents and so steeper than the legs.  What the aircraft cannot climb or sink there
    it takes from its speed or adds to it: g dh / V.
    """
    i = leg + 1
    turn, reach = abs(float(shape.turns[i])), float(shape.before[i])
    if i == shape.legs or not math.isfinite(limit) or not 0.0 < reach < min(shape.runs[leg : leg + 2]):
        return []
    if shape.setup.route.fly_over[i] or shape.setup.route.arcs[i] > 0.0:
        return []
    tan_in, tan_out = math.tan(shape.slopes[leg]), math.tan(shape.slopes[i])
    tangent = arc_slope(tan_in, tan_out, reach, float(shape.radius[i]))
    if tangent * (1.0 if shape.slopes[leg] >= 0.0 else -1.0) <= 0.0:
        return []
    length = float(shape.radius[i]) * turn
    beyond = (abs(tangent) - math.tan(limit)) * length
    speed = float(shape.setup.route.airspeed[leg])
    if limit <= 0.0 or GRAVITY * beyond / speed <= OFF_SPEED:
        return []
    verb = "climbs" if tangent > 0.0 else "falls"
    return [
        f"the arc at {shape.waypoint(i)} {verb} {math.degrees(math.atan(abs(tangent))):.1f}° for {length:.0f} m, "
        f"{beyond:.0f} m beyond the {math.degrees(limit):.1f}° that the aircraft can"
    ]


def _in_envelope(shape: RouteShape, leg: int) -> bool:
    low, high = shape.setup.envelope.level_speeds(float(shape.points[leg, 2]))
    return low <= float(shape.setup.route.airspeed[leg]) <= high


def _too_steep(shape: RouteShape, leg: int, limit: float, source: str) -> str:
    planned = float(shape.slopes[leg])
    verb = "climbs" if planned >= 0.0 else "falls"
    says = f"leg {leg} {verb} {math.degrees(abs(planned)):.1f}° for {_distance(float(shape.runs[leg]))}"
    if source == "scenario":
        return f"{says}; the scenario allows {math.degrees(limit):.1f}°"
    speed = float(shape.setup.route.airspeed[leg])
    up = float(max(shape.points[leg, 2], shape.points[leg + 1, 2]))
    at = f"at {speed:.0f} m/s and {up:.0f} m"
    if limit <= 0.0:
        return f"{says}; {at} the aircraft has no steady flight on this course"
    wind = shape.setup.scenario.wind
    tail, cross = wind.along(float(shape.courses[leg]), up)
    if math.hypot(tail, cross) < 0.5:
        return f"{says}; {at} the aircraft can {math.degrees(limit):.1f}° in calm air"
    calm = shape.setup.envelope.slope_limits(speed, up)[0 if planned >= 0.0 else 1]
    blows = f"{abs(tail):.0f} m/s {'tailwind' if tail > 0.0 else 'headwind'}"
    if abs(cross) > abs(tail):
        blows = f"{abs(cross):.0f} m/s crosswind"
    calm_text = f"{math.degrees(calm):.1f}°" if math.isfinite(calm) else "nothing"
    return f"{says}; {at} the aircraft can {calm_text} in calm air but {math.degrees(limit):.1f}° in this {blows}"


def _distance(metres: float) -> str:
    return f"{metres / 1000.0:.1f} km" if metres >= 1000.0 else f"{metres:.0f} m"


def _evidence(shape: RouteShape, leg: int, measure: SlopeMeasure, limit: float) -> tuple[list[str], list[str]]:
    """Flown evidence in words, and what of it is not good enough."""
    said, wrong = [], []
    planned = float(shape.slopes[leg])
    sign = 1.0 if planned >= 0.0 else -1.0
    fit = measure.slope
    if fit is not None:
        said.append(f"flown {math.degrees(fit.value):+.2f}°")
        if sign * fit.value > limit + fit.tolerance:
            wrong.append(f"flown {math.degrees(fit.value):+.1f}°, beyond {math.degrees(limit):.1f}°")
        if fit.fitted and abs(fit.value - planned) > OFF_SLOPE + fit.tolerance:
            wrong.append(f"flown at {math.degrees(fit.value):+.1f}° instead of {math.degrees(planned):+.1f}°")
    if measure.height_error is not None:
        said.append(f"height within {abs(measure.height_error):.1f} m of the leg")
        if abs(measure.height_error) > (OFF_HEIGHT_SHORT if measure.short else OFF_HEIGHT):
            where = "above" if measure.height_error > 0.0 else "below"
            wrong.append(f"{abs(measure.height_error):.0f} m {where} the leg")
    most = OFF_SPEED + GUST_SHARE * W20[shape.setup.scenario.wind.turbulence]
    for name, held, off, word in (
        ("full", measure.at_full, measure.slow, "slow"),
        ("idle", measure.at_idle, measure.fast, "fast"),
    ):
        if held >= 1.0:
            said.append(f"throttle at {name} for {held:.0f} s")
        if held >= SATURATED and off > most:
            wrong.append(f"throttle at {name} for {held:.0f} s and {off:.1f} m/s too {word}")
    return said, wrong
