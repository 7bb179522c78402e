"""Measure how each turn was flown: angle, bank, radius, overshoot, and where the aircraft settled."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flight.simulation.track import ROLL
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.slopes import leg_course
from logs.verdict.measures.track_alignment import AlignedTrack, along_across, approaches
from logs.verdict.tolerances import SETTLING_WATCH_TIME_S
from world.arrays import Floats

# ----------------------------------------------------------------------
# Corners of an imported flight: the nearest pass, and how far past the new leg the flight went.
#
# The autopilot of an imported flight knows nothing of planfly's arcs: it turns where it considers the waypoint reached.
# So its corners are measured against known quantities: the waypoint and the next leg.

# Fraction of the next leg over which a corner is examined: by its end the next corner has begun.
OF_NEXT_LEG = 0.7


@dataclass(frozen=True, slots=True)
class CornerPass:
    """Measured pass of one waypoint.

    time: s, of the nearest pass.  nearest: m, horizontal distance from the waypoint then.
    overshoot: m past the next leg, on the outside of the turn, from there to `OF_NEXT_LEG` of that leg, or to the next
        waypoint's pass if that is sooner; None if the next leg was not joined.
    beyond: m past the next leg's end at the nearest pass, if the leg was not joined.
    """

    time: float
    nearest: float
    overshoot: float | None
    beyond: float = 0.0


def corner_passes(requirements: RouteRequirements, aligned: AlignedTrack) -> tuple[CornerPass, ...]:
    """Measure how each waypoint of a route was passed, in route order: each after the one before it.

    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.measures.route_requirements import route_requirements
    >>> from logs.verdict.measures.track_alignment import align_track
    >>> log = example_log()
    >>> requirements = route_requirements(log.setup)
    >>> passes = corner_passes(requirements, align_track(requirements, log.track))
    >>> len(passes) == requirements.legs + 1, passes[1].nearest < 60.0
    (True, True)
    """
    found = _nearest_passes(requirements, aligned)
    times, tick = [time for time, _ in found], aligned.tick
    out = []
    for k, (time, nearest) in enumerate(found):
        overshoot, beyond = None, 0.0
        if 0 < k < requirements.legs:
            later = next((other for other in times[k + 1 :] if other > time + tick), float(aligned.track.time[-1]))
            overshoot, beyond = _corner_overshoot(requirements, aligned, k, time, later)
        out.append(CornerPass(time, nearest, overshoot, beyond))
    return tuple(out)


def _nearest_passes(requirements: RouteRequirements, aligned: AlignedTrack) -> list[tuple[float, float]]:
    """Return the time (s) and distance (m) of each waypoint's nearest pass, in order of time."""
    time, rows = aligned.track.time, aligned.rows
    out: list[tuple[float, float]] = []
    begin = float(time[0])
    for k in range(len(rows)):
        # Waypoints that share a row do not bound each other.
        later = rows[k + 1 :][time[rows[k + 1 :]] > max(float(time[rows[k]]), begin)]
        moments, place = _track_between(aligned, begin, float(time[later[0]] if later.size else time[-1]))
        away, fraction = approaches(place, requirements.points[k])
        nearest = int(np.argmin(away))
        begin = float(moments[nearest] + fraction[nearest] * (moments[nearest + 1] - moments[nearest]))
        out.append((begin, float(away[nearest])))
    return out


def _track_between(aligned: AlignedTrack, start: float, end: float) -> tuple[Floats, Floats]:
    """Return times between `start` and `end`, s, (n,), and the positions of the flight at these times, m, (n, 3)."""
    time = aligned.track.time
    moments = np.concatenate([[start], time[(time > start) & (time < end)], [end]])
    return moments, np.column_stack([np.interp(moments, time, aligned.track.position[:, j]) for j in range(3)])


def _corner_overshoot(
    requirements: RouteRequirements, aligned: AlignedTrack, k: int, start: float, end: float
) -> tuple[float | None, float]:
    """Return the overshoot at a waypoint (or None), and how far past the leg's end the flight was, m."""
    run = float(requirements.runs[k])
    along, across = along_across(requirements, k, _track_between(aligned, start, end)[1])
    if along[0] > run:
        return None, float(along[0]) - run
    outside = -math.copysign(1.0, float(requirements.turns[k])) * across
    gone = np.flatnonzero(along >= OF_NEXT_LEG * run)
    until = int(gone[0]) if gone.size else len(along)
    if 0 < until < len(along):
        # Interpolate to the exact end: rows may be a second apart.
        share = (OF_NEXT_LEG * run - along[until - 1]) / (along[until] - along[until - 1])
        last = outside[until - 1] + share * (outside[until] - outside[until - 1])
        return max(0.0, float(last), float(outside[:until].max())), 0.0
    return max(0.0, float(outside[: max(1, until)].max())), 0.0


@dataclass(frozen=True, slots=True)
class TurnMeasure:
    """Measured turn; None in a field if the turn was not flown, or there is nothing to measure.

    angle, tolerance: rad, of the course change.
    fitted: the courses of both legs are fits.
    peak_bank: rad.
    held_bank: rad, the largest mean over a second.
    radius: m, the least over a second.
    overshoot: m past the arc, on its outside.
    settled: m, mean distance from the next leg in the last second before its end.
    passed: m, least distance from the waypoint.
    full_circles: whole turns flown beyond the corner's own.
    over: True if the flight got past the turn.
    corner: for an imported flight, the measured pass of the waypoint; ``overshoot`` and ``passed`` are then taken from
    it.
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
    corner: CornerPass | None = None


def measure_turns(requirements: RouteRequirements, aligned: AlignedTrack) -> list[TurnMeasure]:
    """Measure the turn at every inner waypoint, in order."""
    measures = [measure_turn(requirements, aligned, i) for i in range(1, requirements.legs)]
    if requirements.setup.source is None:
        return measures
    corners = corner_passes(requirements, aligned)[1:-1]
    return [
        replace(measure, overshoot=corner.overshoot, passed=corner.nearest, corner=corner)
        for measure, corner in zip(measures, corners, strict=True)
    ]


def measure_turn(requirements: RouteRequirements, aligned: AlignedTrack, i: int) -> TurnMeasure:
    """Measure the turn at inner waypoint i."""
    if not aligned.flew(i - 1) or not aligned.flew(i):
        return TurnMeasure()
    track = aligned.track
    first, middle, last = (int(aligned.rows[k]) for k in (i - 1, i, i + 1))
    position = track.position[first : last + 1]
    before, _ = along_across(requirements, i - 1, position)
    along, across = along_across(requirements, i, position)
    entry = _first_row(before >= requirements.runs[i - 1] - requirements.before[i], middle - first)
    leaving = np.arange(first, last + 1) >= middle
    leave = _first_row(leaving & (along >= requirements.after[i]), last - first)
    # A neighbour that needs more than the leg has gets half of it: the neighbour is at fault, not this turn.
    ahead = min(
        float(requirements.before[i + 1]), max(0.5 * requirements.runs[i], requirements.runs[i] - requirements.after[i])
    )
    end = _first_row(leaving & (along >= requirements.runs[i] - ahead), last - first)
    around = aligned.around(first + entry, first + max(entry, leave), 1.0)
    held, radius = _bank_and_radius(aligned, around)
    angle, tolerance, fitted = _course_change(requirements, aligned, i)
    watched = np.arange(position.shape[0]) <= max(leave, end)
    watched &= track.time[first : last + 1] <= track.time[first + leave] + SETTLING_WATCH_TIME_S
    turned = abs(float(aligned.course[first + leave] - aligned.course[first + entry]))
    return TurnMeasure(
        angle=angle,
        tolerance=tolerance,
        fitted=fitted,
        peak_bank=None if math.isnan(held) else float(np.abs(track.attitude[around, ROLL]).max()),
        held_bank=None if math.isnan(held) else held,
        radius=radius,
        overshoot=_arc_overshoot(requirements, i, position[watched], before[watched], along[watched], across[watched]),
        settled=_settled_distance(requirements, aligned, i, first, end, along, across),
        passed=float(approaches(position, requirements.points[i])[0].min()),
        full_circles=max(0, round((turned - abs(float(requirements.turns[i]))) / (2.0 * math.pi))),
        over=bool(aligned.passed[i + 1] or end < last - first or leave < last - first),
    )


def _first_row(mask: NDArray[np.bool_], otherwise: int) -> int:
    found = int(np.argmax(mask))
    return found if mask[found] else otherwise


def _course_change(
    requirements: RouteRequirements, aligned: AlignedTrack, i: int
) -> tuple[float | None, float | None, bool]:
    into, out = leg_course(requirements, aligned, i - 1), leg_course(requirements, aligned, i)
    if into is None or out is None:
        return None, None, False
    change = abs(math.remainder(out.value - into.value, 2.0 * math.pi))
    return change, into.tolerance + out.tolerance, into.fitted and out.fitted


def _bank_and_radius(aligned: AlignedTrack, rows: slice) -> tuple[float, float]:
    """Return the largest mean bank (rad) and the smallest radius (m; inf without a turn), each over a second."""
    time = aligned.track.time[rows]
    bank = np.abs(aligned.track.attitude[rows, ROLL].astype(np.float64))
    ticks = int(np.searchsorted(time, time[0] + 1.0))
    if ticks < 1 or ticks >= time.size:
        return float(bank.mean()), math.inf
    total = np.concatenate([[0.0], np.cumsum(bank)])
    held = float(((total[ticks:] - total[:-ticks]) / ticks).max())
    course, run = aligned.course[rows], aligned.distance_run[rows]
    bend = np.abs(course[ticks:] - course[:-ticks]) / np.maximum(run[ticks:] - run[:-ticks], 1e-6)
    sharpest = float(bend.max())
    return held, 1.0 / sharpest if sharpest > 1e-9 else math.inf


def _arc_overshoot(
    requirements: RouteRequirements, i: int, position: Floats, before: Floats, along: Floats, across: Floats
) -> float | None:
    """Return the largest distance outside the arc and then outside the next leg, m; 0 if it was never outside."""
    if requirements.setup.route.fly_over[i] or not math.isfinite(requirements.before[i]):
        return None
    side = math.copysign(1.0, requirements.turns[i])
    ux, uy = requirements.leg_unit(i - 1)
    centre = (
        requirements.points[i, :2]
        - requirements.before[i] * np.array([ux, uy])
        + side * requirements.radius[i] * np.array([uy, -ux])
    )
    started = np.maximum.accumulate(before >= requirements.runs[i - 1] - requirements.before[i])
    in_arc = started & (along < requirements.after[i])
    outside = np.where(started & ~in_arc, -side * across, 0.0)
    off = position[in_arc, :2] - centre
    outside[in_arc] = np.hypot(off[:, 0], off[:, 1]) - requirements.radius[i]
    return max(0.0, float(outside.max())) if outside.size else 0.0


def _settled_distance(
    requirements: RouteRequirements, aligned: AlignedTrack, i: int, first: int, end: int, along: Floats, across: Floats
) -> float:
    """Return the mean distance from the next leg's line in the last second before the next turn, m.

    If the turn uses the whole leg, return the distance at the end of the leg.
    """
    time = aligned.track.time[first : first + end + 1]
    start = int(np.searchsorted(time, time[-1] - 1.0))
    rows = np.arange(start, end + 1)
    rows = rows[along[rows] >= requirements.after[i]]
    if rows.size:
        return float(np.abs(across[rows]).mean())
    return float(abs(across[end]))
