"""Measure how much of a photo line was flown usably for photos, and how much its photos overlap."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from flight.mission.items import Camera
from flight.mission.surveys import LineAxis, PhotoLine, Survey, survey_plan
from flight.simulation.track import ROLL
from logs.verdict.measures.acceptance import position_error, reach
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.tolerances import (
    MAX_PHOTO_BANK_RAD,
    MAX_PHOTO_COURSE_ERROR_RAD,
    MIN_PHOTO_HEIGHT_ERROR_M,
    PHOTO_HEIGHT_FRACTION,
    PHOTO_OFFSET_FRACTION,
    PHOTO_STEP_M,
)
from world.arrays import Flags, Floats


@dataclass(frozen=True, slots=True)
class LineMeasure:
    """One photo line as flown.

    length: m.
    good, away, banked, high, dark: fractions of the length, which add up to 1.  good is usable; the others are unusable
        by the first condition that fails.  away: not flown along, or too far to the side.  banked: too much bank.
        high: too large a height error.  dark: camera off.
    late, early: distance from the line's start to the first usable place, and from the last usable place to its end, m.
    aside: greatest distance to the side where the line was flown along, m.  off: greatest height error, m, positive
        above.
    photos, missed: number of planned photos, and of those not taken; 0 if the distance between photos is not stated.
    allowed_aside: tolerance of aside, m.  allowed_off: smallest height tolerance anywhere along the line, m.
    lost: start and end of each unusable stretch, m from the line's start.
    """

    length: float
    good: float
    away: float
    banked: float
    high: float
    dark: float
    late: float
    early: float
    aside: float
    off: float
    photos: int
    missed: int
    allowed_aside: float
    allowed_off: float
    lost: tuple[tuple[float, float], ...] = ()


def allowed_aside(requirements: RouteRequirements, survey: Survey) -> float:
    """Return the distance to the side of its line at which a photo may still be taken, m."""
    return PHOTO_OFFSET_FRACTION * survey.spacing + position_error(requirements.setup)


@dataclass(frozen=True, slots=True)
class _LineRows:
    """Rows on which a line may have been flown.

    position: (n, 3) m.  along, across: relative to the line, m.  ahead: True for each row that flies along it.
    off, allowed: error from the planned height above ground, and its tolerance, m.
    conditions: True for each row that meets a condition of a photo, by the name of the loss if it is not met.
    """

    axis: LineAxis
    window: slice
    position: Floats
    along: Floats
    across: Floats
    ahead: Flags
    off: Floats
    allowed: Floats
    conditions: dict[str, Flags]


def _line_rows(
    requirements: RouteRequirements, aligned: AlignedTrack, survey: Survey, line: PhotoLine
) -> _LineRows | None:
    axis = LineAxis(requirements.points[line.first : line.last + 1])
    window = _row_window(requirements, aligned, line)
    if window.stop - window.start < 2 or not aligned.passed[line.begins]:
        return None
    position = aligned.track.position[window]
    along, across, course = axis.of(position)
    course_error = np.abs(np.angle(np.exp(1j * (aligned.course[window] - course))))
    is_ahead = course_error <= MAX_PHOTO_COURSE_ERROR_RAD
    height_error, height_tolerance = _height_errors(requirements, axis, position, along)
    conditions = {
        "away": np.abs(across) <= allowed_aside(requirements, survey),
        "banked": np.abs(aligned.track.attitude[window, ROLL]) <= MAX_PHOTO_BANK_RAD,
        "high": np.abs(height_error) <= height_tolerance,
        "dark": _camera_on(requirements, line, position, along, is_ahead, axis.length),
    }
    return _LineRows(axis, window, position, along, across, is_ahead, height_error, height_tolerance, conditions)


def measure_line(
    requirements: RouteRequirements, aligned: AlignedTrack, survey: Survey, line: PhotoLine
) -> LineMeasure | None:
    """Measure a photo line on a flown track; return None if no row lies between the neighbouring waypoints."""
    rows = _line_rows(requirements, aligned, survey, line)
    if rows is None:
        return None
    length, along, is_ahead = rows.axis.length, rows.along, rows.ahead
    is_good, meets_conditions, lost_fractions = np.ones(0, dtype=np.bool_), is_ahead, {}
    for name, is_met in rows.conditions.items():
        meets_conditions = meets_conditions & is_met
        previous_fraction = float(is_good.mean()) if is_good.size else 1.0
        is_good = _line_steps(along, meets_conditions, length)
        lost_fractions[name] = previous_fraction - float(is_good.mean())
    good_steps = np.flatnonzero(is_good)
    step = length / len(is_good)
    is_on_line = is_ahead & (along >= 0.0) & (along <= length)
    photos, missed = _count_photos(
        line, _line_steps(along, is_ahead & rows.conditions["away"] & rows.conditions["dark"], length), length
    )
    return LineMeasure(
        length=length,
        good=float(is_good.mean()),
        **lost_fractions,
        late=float(good_steps[0] * step) if good_steps.size else length,
        early=float((len(is_good) - 1 - good_steps[-1]) * step) if good_steps.size else length,
        aside=float(np.abs(rows.across[is_on_line]).max(initial=0.0)),
        off=float(max(rows.off[is_on_line], key=abs, default=0.0)),
        photos=photos,
        missed=missed,
        allowed_aside=allowed_aside(requirements, survey),
        allowed_off=float(rows.allowed.min(initial=math.inf)),
        lost=_set_runs(~is_good, step),
    )


def _set_runs(cells: Flags, step: float) -> tuple[tuple[float, float], ...]:
    """Return the start and end of each run of set cells, m."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], cells.astype(int), [0]]))) * step
    return tuple((float(start), float(end)) for start, end in zip(edges[::2], edges[1::2], strict=True))


def _row_window(requirements: RouteRequirements, aligned: AlignedTrack, line: PhotoLine) -> slice:
    """Return the rows from the waypoint before the line's straight run to the waypoint after it."""
    first, last = max(0, line.begins - 1), min(requirements.legs, line.ends + 1)
    return slice(int(aligned.rows[first]), int(aligned.rows[last]) + 1)


def _height_errors(
    requirements: RouteRequirements, axis: LineAxis, position: Floats, along: Floats
) -> tuple[Floats, Floats]:
    """Return each row's error from the planned height above ground, and its tolerance, m."""
    planned = over_ground(requirements, axis.at(along))
    tolerance = np.maximum(MIN_PHOTO_HEIGHT_ERROR_M, PHOTO_HEIGHT_FRACTION * planned)
    return over_ground(requirements, position) - planned, tolerance


def over_ground(requirements: RouteRequirements, positions: Floats) -> Floats:
    """Return the heights of places (n, 3) above ground, m, (n,).

    Without terrain, heights are above home, or above the route's lowest waypoint if there is no home.
    """
    terrain, home = requirements.setup.scenario.terrain, requirements.setup.mission.home
    if terrain is not None:
        return positions[:, 2] - terrain.height(positions[:, 0], positions[:, 1])
    return positions[:, 2] - (float(requirements.points[:, 2].min()) if home is None else home.alt)


def _camera_on(
    requirements: RouteRequirements, line: PhotoLine, position: Floats, along: Floats, ahead: Flags, length: float
) -> Flags:
    """Return True for each row at which the camera is on.

    ahead: True for each row that flies along the line.

    The camera is on from reaching the line's first waypoint to reaching its last waypoint.  It is always on if the
    mission does not switch it on this line.
    """
    follows_path, rows = requirements.setup.autopilot.follows_path, np.arange(len(along))

    def reached(waypoint: int, min_along: float, first_row: int = 0) -> int:
        distances = np.hypot(*(position[:, :2] - requirements.points[waypoint, :2]).T)
        # An autopilot that follows a path is at a waypoint where the path passes it.
        radius = 0.0 if follows_path else reach(requirements, waypoint).radius
        indices = np.flatnonzero(((distances <= radius) | (along >= min_along)) & ahead & (rows >= first_row))
        return int(indices[0]) if indices.size else len(along)

    on_row = reached(line.first, 0.0) if line.switched_on else 0
    off_row = reached(line.last, length, on_row) if line.switched_off else len(along)
    return (rows >= on_row) & (rows <= off_row)


def _line_steps(along: Floats, is_set: Flags, length: float) -> Flags:
    """Return True for each step of a line that lies between two consecutive rows at which `is_set` is True."""
    count = max(1, math.ceil(length / PHOTO_STEP_M))
    in_both = is_set[:-1] & is_set[1:] & (np.diff(along) > 0.0)
    edges = np.clip(along / length * count, 0.0, count)
    first_steps, end_steps = np.floor(edges[:-1]).astype(int)[in_both], np.ceil(edges[1:]).astype(int)[in_both]
    marks = np.zeros(count + 1, dtype=np.int64)
    np.add.at(marks, first_steps, 1)
    np.add.at(marks, end_steps, -1)
    return np.cumsum(marks[:-1]) > 0


def _count_photos(line: PhotoLine, taken: Flags, length: float) -> tuple[int, int]:
    """Return the number of planned photos on a line, and the number of photos that were missed."""
    if line.photo <= 0.0:
        return 0, 0
    count = int(length / line.photo) + 1
    steps = np.minimum((np.arange(count) * line.photo / length * len(taken)).astype(int), len(taken) - 1)
    return count, int(np.count_nonzero(~taken[steps]))


# ----------------------------------------------------------------------
# Overlap of photos.  A photo is a rectangle on level ground below the aircraft, sized by its height above ground there;
# the aircraft's tilt is ignored.


@dataclass(frozen=True, slots=True)
class OverlapMeasure:
    """Minimum overlap of a survey's usable photos, as fractions of a photo.

    camera: the camera that takes them.
    front: overlap with the next photo on the line; None if the distance between photos is not stated, or none is
        usable.
    line, apart, height, slow: of the minimum front overlap: the line's number from 0, the distance between photos, m,
        the height above ground, m, and True if the camera cannot take photos any sooner.
    side: overlap with the photos of the neighbouring line; None if no two usable lines are next to each other.
    pair, between, heights: of the minimum side overlap: both lines' numbers, the distance between them, m, and the
        height above ground, m.
    """

    camera: Camera
    front: float | None = None
    line: int = -1
    apart: float = math.nan
    height: float = math.nan
    slow: bool = False
    side: float | None = None
    pair: tuple[int, int] = (-1, -1)
    between: float = math.nan
    heights: float = math.nan


class _Strip(NamedTuple):
    """Points of a photo line, with a flag for usable points.

    places: (n, 3) m.  heights: above ground, (n,) m.  speeds: over ground, (n,) m/s.
    """

    places: Floats
    heights: Floats
    speeds: Floats
    usable: Flags


def measure_overlap(
    requirements: RouteRequirements, aligned: AlignedTrack | None, survey: Survey
) -> OverlapMeasure | None:
    """Measure how much a survey's photos overlap, as flown, or as planned if ``aligned`` is None.

    Return None if no camera is known.
    """
    plan = survey_plan(requirements.setup.mission, survey)
    if plan is None or plan.camera is None:
        return None
    strips = [_line_strip(requirements, aligned, survey, line) for line in survey.lines]
    return _with_front_overlap(
        _with_side_overlap(OverlapMeasure(plan.camera), requirements, survey, strips), survey, strips
    )


def _line_strip(
    requirements: RouteRequirements, aligned: AlignedTrack | None, survey: Survey, line: PhotoLine
) -> _Strip | None:
    """Return a line as flown, or as planned; None if it was not flown."""
    if aligned is None:
        axis = LineAxis(requirements.points[line.first : line.last + 1])
        along = np.linspace(0.0, axis.length, max(2, math.ceil(axis.length / PHOTO_STEP_M) + 1))
        legs = np.clip(np.searchsorted(axis.along, along, "right") - 1, 0, len(axis.along) - 2) + line.first
        places, speeds = axis.at(along), requirements.ground_speed[legs]
        return _Strip(places, over_ground(requirements, places), speeds, np.ones(len(along), dtype=np.bool_))
    rows = _line_rows(requirements, aligned, survey, line)
    if rows is None:
        return None
    usable = rows.ahead & (rows.along >= 0.0) & (rows.along <= rows.axis.length)
    for is_met in rows.conditions.values():
        usable = usable & is_met
    speeds = np.hypot(*aligned.track.velocity[rows.window, :2].T)
    return _Strip(rows.position, over_ground(requirements, rows.position), speeds, usable)


def _with_front_overlap(measure: OverlapMeasure, survey: Survey, strips: Sequence[_Strip | None]) -> OverlapMeasure:
    """Return the measure with the minimum overlap along the lines."""
    camera = measure.camera
    for number, (line, strip) in enumerate(zip(survey.lines, strips, strict=True)):
        if strip is None or line.photo <= 0.0 or not strip.usable.any():
            continue
        spacing = np.maximum(line.photo, camera.interval * strip.speeds)[strip.usable]
        heights = strip.heights[strip.usable]
        overlaps = 1.0 - spacing / (camera.along * np.maximum(heights, 1e-9))
        worst = int(np.argmin(overlaps))
        if measure.front is None or overlaps[worst] < measure.front:
            metres, is_slow = float(spacing[worst]), bool(spacing[worst] > line.photo)
            measure = replace(
                measure,
                front=float(overlaps[worst]),
                line=number,
                apart=metres,
                height=float(heights[worst]),
                slow=is_slow,
            )
    return measure


def _with_side_overlap(
    measure: OverlapMeasure, requirements: RouteRequirements, survey: Survey, strips: Sequence[_Strip | None]
) -> OverlapMeasure:
    """Return the measure with the minimum overlap between neighbouring lines."""
    corners = [requirements.points[line.first : line.last + 1] for line in survey.lines]
    axis = LineAxis(corners[0])
    ends = [axis.of(places)[0] for places in corners]
    min_along = min(float(along.min()) for along in ends)
    length = max(float(along.max()) for along in ends) - min_along
    count = max(1, math.ceil(length / PHOTO_STEP_M))
    step_middles = (np.arange(count) + 0.5) * length / count
    previous_line = np.full((4, count), np.nan)
    for number in np.argsort(survey.offsets).tolist():
        strip, along = strips[number], ends[number] - min_along
        on_line = (step_middles >= along.min()) & (step_middles <= along.max())
        this_line = np.full((4, count), np.nan)
        this_line[3, on_line] = number
        if strip is not None and strip.usable.any():
            point_along, across, _ = axis.of(strip.places)
            is_forward = along[-1] >= along[0]
            cells = _line_steps(
                (point_along - min_along) if is_forward else length - (point_along - min_along), strip.usable, length
            )
            is_used = on_line & (cells if is_forward else cells[::-1])
            order = np.argsort(point_along[strip.usable])
            for row, values in enumerate((across, strip.heights)):
                line_values = np.interp(
                    step_middles, (point_along[strip.usable] - min_along)[order], values[strip.usable][order]
                )
                this_line[row] = np.where(is_used, line_values, np.nan)
        gaps, heights = np.abs(this_line[0] - previous_line[0]), 0.5 * (this_line[1] + previous_line[1])
        overlaps = 1.0 - gaps / (measure.camera.across * np.maximum(heights, 1e-9))
        if np.isfinite(overlaps).any():
            worst = int(np.nanargmin(overlaps))
            if measure.side is None or overlaps[worst] < measure.side:
                pair = (int(previous_line[3, worst]), number)
                measure = replace(
                    measure,
                    side=float(overlaps[worst]),
                    pair=pair,
                    between=float(gaps[worst]),
                    heights=float(heights[worst]),
                )
        previous_line[:, on_line] = this_line[:, on_line]
    return measure
