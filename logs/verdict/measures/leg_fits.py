"""Course and slope of flown legs, by least squares where a leg is long enough."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.track_alignment import AlignedTrack, along_across

Floats = NDArray[np.float64]

# Ends of a leg that are left out of a fit, beyond the turns' tangents, m.
CLEAR_OF_TURN = 100.0
# Shortest piece of a leg that a course, a slope is fitted to, m.
SHORTEST_COURSE = 60.0
SHORTEST_SLOPE = 100.0
# Shortest time that a slope is measured over, s: shorter ones over-read by degrees.
SHORTEST_TIME = 4.0
# What a fit in calm air cannot resolve, and the most that unsteadiness may add (rad).
_FLOOR = math.radians(0.02)
_SLOPE_FLOOR = math.radians(0.1)
_MOST = math.radians(0.5)
# Uncertainty of a course, a slope that was not fitted, rad.
ROUGH_COURSE = math.radians(0.75)
ROUGH_SLOPE = math.radians(0.5)


@dataclass(frozen=True, slots=True)
class Fit:
    """A measured angle (rad), its tolerance (rad), the run it was measured over (m), and whether by least squares."""

    value: float
    tolerance: float
    run: float
    fitted: bool


def fit_line(x: Floats, y: Floats) -> tuple[float, float]:
    """Slope of the least-squares line of y on x, and the RMS of what it leaves.  x is not all one value."""
    dx, dy = x - x.mean(), y - y.mean()
    slope = float((dx * dy).sum() / (dx * dx).sum())
    return slope, float(np.sqrt(np.mean((dy - slope * dx) ** 2)))


def straight_span(shape: RouteDemands, leg: int, clear: float, *, level: bool = False) -> tuple[float, float]:
    """Where on a leg (m from its start) the turns at its ends are over, and ``clear`` metres further in.

    level: the blends of slope are to be over too.
    """
    start, end = (clear, clear)
    if level:
        start, end = max(clear, float(shape.blend[leg]) + 20.0), max(clear, float(shape.blend[leg + 1]) + 20.0)
    low = shape.after[leg] + (start if leg > 0 else min(clear, 20.0))
    return low, shape.runs[leg] - shape.before[leg + 1] - (end if leg + 1 < shape.legs else 0.0)


def leg_course(shape: RouteDemands, flown: AlignedTrack, leg: int) -> Fit | None:
    """Course that a leg was flown on; None where too little of it was flown."""
    if not flown.flew(leg):
        return None
    rows = flown.leg_rows(leg)
    along, across = along_across(shape, leg, flown.track.position[rows])
    low, high = straight_span(shape, leg, CLEAR_OF_TURN)
    inside = (along >= low) & (along <= high)
    if inside.sum() >= 20 and np.ptp(along[inside]) >= SHORTEST_COURSE:
        bend, rest = fit_line(along[inside], across[inside])
        run = float(np.ptp(along[inside]))
        return Fit(shape.courses[leg] + math.atan(bend), _unsteady(_FLOOR, rest, run), run, True)
    # A short leg: the mean course between its turns, over a second at least.
    low, high = straight_span(shape, leg, 0.0)
    between = np.flatnonzero((along >= low) & (along <= high))
    if not between.size:
        middle = 0.5 * (low + high) if math.isfinite(low) and math.isfinite(high) else 0.5 * float(shape.runs[leg])
        between = np.array([np.argmin(np.abs(along - middle))])
    first, last = rows.start + int(between[0]), rows.start + int(between[-1])
    if flown.track.time[last] - flown.track.time[first] < 1.0:
        wide = flown.around(first, last, 0.5)
        first, last = wide.start, wide.stop - 1
    # In the frame of the course column, which is unwrapped, so that a full circle shows.
    return Fit(float(flown.course[first : last + 1].mean()), ROUGH_COURSE, float(np.ptp(along)), False)


def leg_slope(shape: RouteDemands, flown: AlignedTrack, leg: int) -> Fit | None:
    """Slope that a leg was flown at; None where less than a second of it was flown."""
    if not flown.flew(leg):
        return None
    rows = flown.leg_rows(leg)
    position = flown.track.position[rows]
    along, _ = along_across(shape, leg, position)
    low, high = straight_span(shape, leg, CLEAR_OF_TURN, level=True)
    inside = (along >= low) & (along <= high)
    if inside.sum() >= 20 and np.ptp(along[inside]) >= SHORTEST_SLOPE:
        rise, rest = fit_line(along[inside], position[inside, 2])
        run = float(np.ptp(along[inside]))
        return Fit(math.atan(rise), _unsteady(_SLOPE_FLOOR, rest, run), run, True)
    time = flown.track.time[rows]
    if time[-1] - time[0] < 1.0:
        return None
    # A short leg: the least-squares slope of at least four seconds about its middle, or of all there is of it.
    middle = float(np.interp(0.5 * shape.runs[leg], np.maximum.accumulate(along), time))
    start = min(max(middle - 0.5 * SHORTEST_TIME, float(time[0])), max(float(time[0]), float(time[-1]) - SHORTEST_TIME))
    window = (time >= start) & (time <= start + SHORTEST_TIME)
    run_at = flown.distance_run[rows][window]
    if run_at.size < 2 or np.ptp(run_at) < 1.0:
        return None
    rise, _ = fit_line(run_at, position[window, 2])
    return Fit(math.atan(rise), ROUGH_SLOPE, float(np.ptp(run_at)), False)


def _unsteady(floor: float, rest: float, run: float) -> float:
    """Tolerance of a fitted angle: what is left beside the line, at the ends of the run, turns it this far."""
    return min(floor + math.atan2(2.0 * rest, run), _MOST)
