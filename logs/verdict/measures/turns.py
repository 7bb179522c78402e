"""Measure how each turn was flown: angle, bank, radius, overshoot, and where the aircraft settled."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flight.simulation.track import ROLL
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.slopes import leg_course
from logs.verdict.measures.track_alignment import AlignedTrack, closest_approaches, project_onto_leg
from logs.verdict.tolerances import SETTLING_WATCH_TIME_S
from world.arrays import Floats


@dataclass(frozen=True, slots=True)
class TurnMeasure:
    """Measured turn; a field is None if the turn was not flown, or if there is nothing to measure.

    angle, tolerance: course change and its tolerance, rad.
    is_fitted: True if the courses of both legs are least-squares fits.
    peak_bank: maximum bank, rad.
    held_bank: maximum one-second mean of the bank, rad.
    radius: minimum radius over one second, m.
    overshoot: maximum distance outside the arc, and after the arc outside the next leg, m.
    settled_distance: mean distance from the next leg in the last second before its end, m.
    min_distance: minimum horizontal distance from the waypoint, m.
    full_circles: number of full circles flown in addition to the planned turn.
    is_complete: True if the flight went on after the turn.
    pass_time: time of the closest approach to the waypoint, s; None if the flight was measured along planfly's arcs.
    overrun: distance past the next leg's end at that time, m; 0 if the flight joined the next leg.
    """

    angle: float | None = None
    tolerance: float | None = None
    is_fitted: bool = False
    peak_bank: float | None = None
    held_bank: float | None = None
    radius: float | None = None
    overshoot: float | None = None
    settled_distance: float | None = None
    min_distance: float | None = None
    full_circles: int = 0
    is_complete: bool = False
    pass_time: float | None = None
    overrun: float = 0.0


def measure_turns(requirements: RouteRequirements, aligned: AlignedTrack, *, follows_arcs: bool) -> list[TurnMeasure]:
    """Measure the turn at every inner waypoint, in order.

    follows_arcs: True for a flight along planfly's fly-by arcs; False to measure overshoot and minimum distance
        relative to the corner of the two legs.

    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.measures.route_requirements import route_requirements
    >>> from logs.verdict.measures.track_alignment import align_track
    >>> log = example_log()
    >>> requirements = route_requirements(log.setup)
    >>> measures = measure_turns(requirements, align_track(requirements, log.track), follows_arcs=False)
    >>> len(measures) == requirements.legs - 1, measures[0].min_distance < 60.0
    (True, True)
    """
    measures = [measure_turn(requirements, aligned, waypoint) for waypoint in range(1, requirements.legs)]
    return measures if follows_arcs else _with_closest_approaches(requirements, aligned, measures)


def measure_turn(requirements: RouteRequirements, aligned: AlignedTrack, waypoint: int) -> TurnMeasure:
    """Measure the turn at an inner waypoint along its arc.

    All fields have their defaults if a leg was not flown.
    """
    if not aligned.has_flown(waypoint - 1) or not aligned.has_flown(waypoint):
        return TurnMeasure()
    track = aligned.track
    first, middle, last = (int(aligned.rows[k]) for k in (waypoint - 1, waypoint, waypoint + 1))
    position = track.position[first : last + 1]
    distance_along_before, _ = project_onto_leg(requirements, waypoint - 1, position)
    distance_along, lateral_offset = project_onto_leg(requirements, waypoint, position)
    entry_row = _first_row(
        distance_along_before >= requirements.runs[waypoint - 1] - requirements.length_before[waypoint], middle - first
    )
    is_after_waypoint = np.arange(first, last + 1) >= middle
    exit_row = _first_row(is_after_waypoint & (distance_along >= requirements.length_after[waypoint]), last - first)
    # A next turn that needs more than the rest of the leg gets half of the leg, because it has the fault.
    next_turn_length = min(
        float(requirements.length_before[waypoint + 1]),
        max(0.5 * requirements.runs[waypoint], requirements.runs[waypoint] - requirements.length_after[waypoint]),
    )
    end_row = _first_row(
        is_after_waypoint & (distance_along >= requirements.runs[waypoint] - next_turn_length), last - first
    )
    rows_around = aligned.rows_around(first + entry_row, first + max(entry_row, exit_row), 1.0)
    # Largest one-second mean of the bank, or the mean over less than a second, and smallest radius over one second.
    bank, radius = np.abs(track.attitude[rows_around, ROLL].astype(np.float64)), math.inf
    held_bank, time = float(bank.mean()), track.time[rows_around]
    ticks = int(np.searchsorted(time, time[0] + 1.0))
    if 1 <= ticks < time.size:
        bank_sums = np.concatenate([[0.0], np.cumsum(bank)])
        held_bank = float(((bank_sums[ticks:] - bank_sums[:-ticks]) / ticks).max())
        course, distance_run = aligned.course[rows_around], aligned.distance_run[rows_around]
        lengths = np.maximum(distance_run[ticks:] - distance_run[:-ticks], 1e-6)
        max_curvature = float((np.abs(course[ticks:] - course[:-ticks]) / lengths).max())
        radius = 1.0 / max_curvature if max_curvature > 1e-9 else math.inf
    # Neither course is known if its leg was flown too little.
    angle, tolerance, is_fitted = None, None, False
    course_before, course_after = (leg_course(requirements, aligned, leg) for leg in (waypoint - 1, waypoint))
    if course_before is not None and course_after is not None:
        angle = abs(math.remainder(course_after.value - course_before.value, 2.0 * math.pi))
        tolerance = course_before.tolerance + course_after.tolerance
        is_fitted = course_before.is_fitted and course_after.is_fitted
    is_watched = np.arange(position.shape[0]) <= max(exit_row, end_row)
    is_watched &= track.time[first : last + 1] <= track.time[first + exit_row] + SETTLING_WATCH_TIME_S
    course_change = abs(float(aligned.course[first + exit_row] - aligned.course[first + entry_row]))
    time = aligned.track.time[first : first + end_row + 1]
    start = int(np.searchsorted(time, time[-1] - 1.0))
    rows = np.arange(start, end_row + 1)
    rows = rows[distance_along[rows] >= requirements.length_after[waypoint]]
    settled_distance = float(np.abs(lateral_offset[rows]).mean()) if rows.size else float(abs(lateral_offset[end_row]))
    return TurnMeasure(
        angle=angle,
        tolerance=tolerance,
        is_fitted=is_fitted,
        peak_bank=None if math.isnan(held_bank) else float(np.abs(track.attitude[rows_around, ROLL]).max()),
        held_bank=None if math.isnan(held_bank) else held_bank,
        radius=radius,
        overshoot=_arc_overshoot(
            requirements,
            waypoint,
            position[is_watched],
            distance_along_before[is_watched],
            distance_along[is_watched],
            lateral_offset[is_watched],
        ),
        settled_distance=settled_distance,
        min_distance=float(closest_approaches(position, requirements.points[waypoint])[0].min()),
        full_circles=max(0, round((course_change - abs(float(requirements.turns[waypoint]))) / (2.0 * math.pi))),
        is_complete=bool(aligned.passed[waypoint + 1] or end_row < last - first or exit_row < last - first),
    )


def _first_row(mask: NDArray[np.bool_], default: int) -> int:
    """Return the first row at which a mask is True, or `default` if there is none."""
    row = int(np.argmax(mask))
    return row if mask[row] else default


def _arc_overshoot(
    requirements: RouteRequirements,
    waypoint: int,
    position: Floats,
    distance_along_before: Floats,
    distance_along: Floats,
    lateral_offset: Floats,
) -> float | None:
    """Return the overshoot of a turn: the largest distance outside its arc or its next leg, m.

    It is at least 0.  Return None if the turn has no fly-by arc.

    waypoint: index of the waypoint.
    position: positions of the track at the turn, m, (n, 3).
    distance_along_before, distance_along: their distances along the leg before and along the leg after the waypoint, m.
    lateral_offset: their offsets from the leg after the waypoint, m, positive to the right.
    """
    if requirements.setup.route.fly_over[waypoint] or not math.isfinite(requirements.length_before[waypoint]):
        return None
    turn_sign = math.copysign(1.0, requirements.turns[waypoint])
    ux, uy = requirements.leg_unit(waypoint - 1)
    center = (
        requirements.points[waypoint, :2]
        - requirements.length_before[waypoint] * np.array([ux, uy])
        + turn_sign * requirements.radius[waypoint] * np.array([uy, -ux])
    )
    has_started = np.maximum.accumulate(
        distance_along_before >= requirements.runs[waypoint - 1] - requirements.length_before[waypoint]
    )
    is_in_arc = has_started & (distance_along < requirements.length_after[waypoint])
    distance_outside = np.where(has_started & ~is_in_arc, -turn_sign * lateral_offset, 0.0)
    center_offset = position[is_in_arc, :2] - center
    distance_outside[is_in_arc] = np.hypot(center_offset[:, 0], center_offset[:, 1]) - requirements.radius[waypoint]
    return max(0.0, float(distance_outside.max())) if distance_outside.size else 0.0


# ----------------------------------------------------------------------
# Corners of an imported flight: closest approach to the waypoint, and overshoot beyond the next leg.
#
# The autopilot of an imported flight does not follow planfly's arcs.  It turns when it considers the waypoint reached.
# So its corners are compared with the waypoint and the next leg.

# Fraction of the next leg over which a corner is examined; the next corner may begin after it.
NEXT_LEG_FRACTION = 0.7


def _with_closest_approaches(
    requirements: RouteRequirements, aligned: AlignedTrack, measures: Sequence[TurnMeasure]
) -> list[TurnMeasure]:
    """Return the turn measures relative to the corner instead of the arc.

    Overshoot and minimum distance are replaced.

    measures: measures of the turns at all inner waypoints, in order.

    The overshoot is the maximum distance from the next leg on the outside of the turn, up to `NEXT_LEG_FRACTION` of
    that leg or the closest approach to the next waypoint, whichever is sooner.  It is None if the aircraft was already
    beyond the end of that leg.
    """
    track_time, rows = aligned.track.time, aligned.rows
    # Time and distance of the closest approach to each waypoint; the times never decrease.
    nearest_passes: list[tuple[float, float]] = []
    start_time = float(track_time[0])
    for k in range(len(rows)):
        # The search ends at the row of the next waypoint that has a later row.
        later_rows = rows[k + 1 :][track_time[rows[k + 1 :]] > max(float(track_time[rows[k]]), start_time)]
        end_time = float(track_time[later_rows[0]] if later_rows.size else track_time[-1])
        times, positions = _track_between(aligned, start_time, end_time)
        distances, fractions = closest_approaches(positions, requirements.points[k])
        row = int(np.argmin(distances))
        start_time = float(times[row] + fractions[row] * (times[row + 1] - times[row]))
        nearest_passes.append((start_time, float(distances[row])))
    passed_turns = []
    for k, measure in enumerate(measures, 1):
        time, distance = nearest_passes[k]
        overshoot, overrun = None, 0.0
        earliest_time, later_passes = time + aligned.tick, nearest_passes[k + 1 :]
        next_time = next((later for later, _ in later_passes if later > earliest_time), float(track_time[-1]))
        leg_length, positions = float(requirements.runs[k]), _track_between(aligned, time, next_time)[1]
        distance_along, lateral_offset = project_onto_leg(requirements, k, positions)
        rows_past = np.flatnonzero(distance_along >= NEXT_LEG_FRACTION * leg_length)
        end_row = int(rows_past[0]) if rows_past.size else len(distance_along)
        outside_offset = -math.copysign(1.0, float(requirements.turns[k])) * lateral_offset
        if distance_along[0] > leg_length:
            # The aircraft was already beyond the end of the next leg.
            overrun = float(distance_along[0]) - leg_length
        else:
            overshoot = max(0.0, float(outside_offset[: max(1, end_row)].max()))
        if overshoot is not None and 0 < end_row < len(distance_along):
            # Interpolate to the exact end: rows may be a second apart.
            along_before, along = distance_along[end_row - 1 : end_row + 1].tolist()
            offset_before, offset = outside_offset[end_row - 1 : end_row + 1].tolist()
            fraction = (NEXT_LEG_FRACTION * leg_length - along_before) / (along - along_before)
            overshoot = max(overshoot, offset_before + fraction * (offset - offset_before))
        measured_pass = replace(measure, overshoot=overshoot, min_distance=distance, pass_time=time, overrun=overrun)
        passed_turns.append(measured_pass)
    return passed_turns


def _track_between(aligned: AlignedTrack, start: float, end: float) -> tuple[Floats, Floats]:
    """Return times, s, (n,), and positions, m, (n, 3), of the track between two times, s.

    The ends are interpolated.
    """
    time = aligned.track.time
    times = np.concatenate([[start], time[(time > start) & (time < end)], [end]])
    return times, np.column_stack([np.interp(times, time, aligned.track.position[:, j]) for j in range(3)])
