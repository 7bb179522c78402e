"""Course and slope of flown legs, by least squares where a leg is long enough."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.track_alignment import AlignedTrack, along_across
from logs.verdict.tolerances import (
    CLEAR_OF_BLEND,
    CLEAR_OF_TURN,
    COURSE_FLOOR,
    MOST_UNSTEADY,
    ROUGH_COURSE,
    ROUGH_SLOPE,
    SHORTEST_COURSE,
    SHORTEST_SLOPE,
    SHORTEST_TIME,
    SLOPE_FLOOR,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LegFit:
    """A measured course or slope of a leg.

    value, tolerance: rad.
    run: m that it was measured over.
    fitted: by least squares over a long enough piece; a short leg's is rough.
    """

    value: float
    tolerance: float
    run: float
    fitted: bool


def fit_line(x: Floats, y: Floats) -> tuple[float, float]:
    """Slope of the least-squares line of y on x, and the RMS of what it leaves.  x is not all one value."""
    dx, dy = x - x.mean(), y - y.mean()
    slope = float((dx * dy).sum() / (dx * dx).sum())
    return slope, float(np.sqrt(np.mean((dy - slope * dx) ** 2)))


def straight_span(demands: RouteDemands, leg: int, clear: float, *, level: bool = False) -> tuple[float, float]:
    """Where on a leg (m from its start) the turns at its ends are over, and ``clear`` metres further in.

    level: the blends of slope are to be over too.
    """
    start, end = clear, clear
    if level:
        start, end = (max(clear, float(blend) + CLEAR_OF_BLEND) for blend in demands.blend[leg : leg + 2])
    low = demands.after[leg] + (start if leg > 0 else min(clear, CLEAR_OF_BLEND))
    return low, demands.runs[leg] - demands.before[leg + 1] - (end if leg + 1 < demands.legs else 0.0)


def leg_course(demands: RouteDemands, aligned: AlignedTrack, leg: int) -> LegFit | None:
    """Course that a leg was flown on; None where too little of it was flown."""
    if not aligned.flew(leg):
        return None
    rows = aligned.leg_rows(leg)
    along, across = along_across(demands, leg, aligned.track.position[rows])
    low, high = straight_span(demands, leg, CLEAR_OF_TURN)
    inside = (along >= low) & (along <= high)
    if inside.sum() >= 20 and np.ptp(along[inside]) >= SHORTEST_COURSE:
        bend, rest = fit_line(along[inside], across[inside])
        run = float(np.ptp(along[inside]))
        return LegFit(demands.courses[leg] + math.atan(bend), _unsteady(COURSE_FLOOR, rest, run), run, True)
    # A short leg: the mean course between its turns, over a second at least.
    low, high = straight_span(demands, leg, 0.0)
    between = np.flatnonzero((along >= low) & (along <= high))
    if not between.size:
        middle = 0.5 * (low + high) if math.isfinite(low) and math.isfinite(high) else 0.5 * float(demands.runs[leg])
        between = np.array([np.argmin(np.abs(along - middle))])
    first, last = rows.start + int(between[0]), rows.start + int(between[-1])
    if aligned.track.time[last] - aligned.track.time[first] < 1.0:
        wide = aligned.around(first, last, 0.5)
        first, last = wide.start, wide.stop - 1
    # In the frame of the course column, which is unwrapped, so that a full circle shows.
    return LegFit(float(aligned.course[first : last + 1].mean()), ROUGH_COURSE, float(np.ptp(along)), False)


def leg_slope(demands: RouteDemands, aligned: AlignedTrack, leg: int) -> LegFit | None:
    """Slope that a leg was flown at; None where less than a second of it was flown."""
    if not aligned.flew(leg):
        return None
    rows = aligned.leg_rows(leg)
    position = aligned.track.position[rows]
    along, _ = along_across(demands, leg, position)
    low, high = straight_span(demands, leg, CLEAR_OF_TURN, level=True)
    inside = (along >= low) & (along <= high)
    if inside.sum() >= 20 and np.ptp(along[inside]) >= SHORTEST_SLOPE:
        rise, rest = fit_line(along[inside], position[inside, 2])
        run = float(np.ptp(along[inside]))
        return LegFit(math.atan(rise), _unsteady(SLOPE_FLOOR, rest, run), run, True)
    time = aligned.track.time[rows]
    if time[-1] - time[0] < 1.0:
        return None
    # A short leg: the least-squares slope of at least four seconds about its middle, or of all there is of it.
    middle = float(np.interp(0.5 * demands.runs[leg], np.maximum.accumulate(along), time))
    start = min(max(middle - 0.5 * SHORTEST_TIME, float(time[0])), max(float(time[0]), float(time[-1]) - SHORTEST_TIME))
    window = (time >= start) & (time <= start + SHORTEST_TIME)
    run_at = aligned.distance_run[rows][window]
    if run_at.size < 2 or np.ptp(run_at) < 1.0:
        return None
    rise, _ = fit_line(run_at, position[window, 2])
    return LegFit(math.atan(rise), ROUGH_SLOPE, float(np.ptp(run_at)), False)


def _unsteady(floor: float, rest: float, run: float) -> float:
    """Tolerance of a fitted angle: what is left beside the line, at the ends of the run, turns it this far."""
    return min(floor + math.atan2(2.0 * rest, run), MOST_UNSTEADY)
