"""How each turn was flown: angle, bank, radius, overshoot, and where the aircraft settled."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from logs.verdict.measures.leg_fits import leg_course
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.track_alignment import AlignedTrack, along_across, approaches

Floats = NDArray[np.float64]

# After its arc a turn is watched for this long at most, s.
_WATCHED = 10.0


@dataclass(frozen=True, slots=True)
class TurnMeasure:
    """How one turn was flown; None where it was not, or where there is nothing to measure.

    angle, tolerance, peak_bank, held_bank (mean over a second): rad.  radius (least over a second), overshoot (past the
    arc, on its outside), settled (mean distance from the next leg in the last second before its end), passed (least
    distance from the waypoint): m.  full_circles: whole turns flown beyond the corner's own.  over: the flight got past
    the turn.
    """

    angle: float | None = None
    tolerance: float | None = None
    fitted: bool = False
    peak_bank: float | None = None
    held_bank: float | None = None
    radius: float | None = None
    overshoot: float | None = None
    settled: float | None = None
    passed: float | None = None
    full_circles: int = 0
    over: bool = False


def measure_turn(shape: RouteDemands, flown: AlignedTrack, i: int) -> TurnMeasure:
    """Measure the turn at inner waypoint i."""
    if not flown.flew(i - 1) or not flown.passed[i] or flown.rows[i + 1] <= flown.rows[i]:
        return TurnMeasure()
    track = flown.track
    first, middle, last = (int(flown.rows[k]) for k in (i - 1, i, i + 1))
    position = track.position[first : last + 1]
    before, _ = along_across(shape, i - 1, position)
    along, across = along_across(shape, i, position)
    entry = _first(before >= shape.runs[i - 1] - shape.before[i], middle - first)
    leaving = np.arange(first, last + 1) >= middle
    leave = _first(leaving & (along >= shape.after[i]), last - first)
    # A neighbour that asks for more than the leg has gets half of it: it is at fault, not this turn.
    room = min(float(shape.before[i + 1]), max(0.5 * shape.runs[i], shape.runs[i] - shape.after[i]))
    end = _first(leaving & (along >= shape.runs[i] - room), last - first)
    around = flown.around(first + entry, first + max(entry, leave), 1.0)
    held, radius = _second_by_second(flown, around)
    angle, tolerance, fitted = _angle(shape, flown, i)
    watched = np.arange(position.shape[0]) <= max(leave, end)
    watched &= track.time[first : last + 1] <= track.time[first + leave] + _WATCHED
    turned = abs(float(flown.course[first + leave] - flown.course[first + entry]))
    return TurnMeasure(
        angle=angle,
        tolerance=tolerance,
        fitted=fitted,
        peak_bank=float(np.abs(track.attitude[around, 0]).max()),
        held_bank=held,
        radius=radius,
        overshoot=_overshoot(shape, i, position[watched], before[watched], along[watched], across[watched]),
        settled=_settled(shape, flown, i, first, end, along, across),
        passed=float(approaches(position, shape.points[i])[0].min()),
        full_circles=max(0, round((turned - abs(float(shape.turns[i]))) / (2.0 * math.pi))),
        over=bool(flown.passed[i + 1] or end < last - first or leave < last - first),
    )


def _first(mask: NDArray[np.bool_], otherwise: int) -> int:
    found = int(np.argmax(mask))
    return found if mask[found] else otherwise


def _angle(shape: RouteDemands, flown: AlignedTrack, i: int) -> tuple[float | None, float | None, bool]:
    into, out = leg_course(shape, flown, i - 1), leg_course(shape, flown, i)
    if into is None or out is None:
        return None, None, False
    change = abs(math.remainder(out.value - into.value, 2.0 * math.pi))
    return change, into.tolerance + out.tolerance, into.fitted and out.fitted


def _second_by_second(flown: AlignedTrack, rows: slice) -> tuple[float, float]:
    """Largest mean bank over a second (rad) and least radius over a second (m; inf for no turn)."""
    time = flown.track.time[rows]
    bank = np.abs(flown.track.attitude[rows, 0].astype(np.float64))
    ticks = int(np.searchsorted(time, time[0] + 1.0))
    if ticks < 1 or ticks >= time.size:
        return float(bank.mean()), math.inf
    total = np.concatenate([[0.0], np.cumsum(bank)])
    held = float(((total[ticks:] - total[:-ticks]) / ticks).max())
    course, run = flown.course[rows], flown.distance_run[rows]
    bend = np.abs(course[ticks:] - course[:-ticks]) / np.maximum(run[ticks:] - run[:-ticks], 1e-6)
    sharpest = float(bend.max())
    return held, 1.0 / sharpest if sharpest > 1e-9 else math.inf


def _overshoot(
    shape: RouteDemands, i: int, position: Floats, before: Floats, along: Floats, across: Floats
) -> float | None:
    """Largest distance outside the arc, and outside the next leg after it, m; 0 where always within."""
    if shape.setup.route.fly_over[i] or not math.isfinite(shape.before[i]):
        return None
    side = math.copysign(1.0, shape.turns[i])
    ux, uy = shape.leg_unit(i - 1)
    centre = shape.points[i, :2] - shape.before[i] * np.array([ux, uy]) + side * shape.radius[i] * np.array([uy, -ux])
    started = np.maximum.accumulate(before >= shape.runs[i - 1] - shape.before[i])
    in_arc = started & (along < shape.after[i])
    outside = np.where(started & ~in_arc, -side * across, 0.0)
    off = position[in_arc, :2] - centre
    outside[in_arc] = np.hypot(off[:, 0], off[:, 1]) - shape.radius[i]
    return max(0.0, float(outside.max())) if outside.size else 0.0


def _settled(
    shape: RouteDemands, flown: AlignedTrack, i: int, first: int, end: int, along: Floats, across: Floats
) -> float:
    """Mean distance from the next leg's line in its last second before the next turn, or there, m."""
    time = flown.track.time[first : first + end + 1]
    start = int(np.searchsorted(time, time[-1] - 1.0))
    rows = np.arange(start, end + 1)
    rows = rows[along[rows] >= shape.after[i]]
    if rows.size:
        return float(np.abs(across[rows]).mean())
    return float(abs(across[end]))
