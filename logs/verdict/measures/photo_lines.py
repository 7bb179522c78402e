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
    """One photo line as flown; all shares are fractions of its length, and add up to 1.

    length: m.
    good: usable share.  The other shares are divided by the first requirement that they fail:
    away: not flown along, or too far to the side of the line.  banked, high, dark: along the line, but banked too much;
        then too far off its height above ground; then without the camera.
    late, early: m from the line's start to the first good place, and from the last good place to its end.
    aside: greatest distance from the line where it was flown along, m; off: greatest height error, m, above positive.
    photos, missed: number planned, and how many of them were not taken; 0 if the distance between photos is not stated.
    allowed_aside: m.  allowed_off: smallest height tolerance anywhere along the line, m.
    lost: stretches that cannot be used, each from and to, m from the line's start.
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
class _Rows:
    """Rows on which a line may have been flown.

    position: (n, 3) m.  along, across: relative to the line, m.  ahead: True for each row that flies along it.
    off, allowed: m, error from the planned height above ground, and its tolerance.
    needed: requirements of a photo, by the name of the loss if they are not met.
    """

    axis: LineAxis
    window: slice
    position: Floats
    along: Floats
    across: Floats
    ahead: Flags
    off: Floats
    allowed: Floats
    needed: dict[str, Flags]


def _line_rows(requirements: RouteRequirements, aligned: AlignedTrack, survey: Survey, line: PhotoLine) -> _Rows | None:
    axis = LineAxis(requirements.points[line.first : line.last + 1])
    window = _row_window(requirements, aligned, line)
    if window.stop - window.start < 2 or not aligned.passed[line.begins]:
        return None
    position = aligned.track.position[window]
    along, across, course = axis.of(position)
    turned = np.abs(np.angle(np.exp(1j * (aligned.course[window] - course))))
    ahead = turned <= MAX_PHOTO_COURSE_ERROR_RAD
    off, allowed = _height_errors(requirements, axis, position, along)
    needed = {
        "away": np.abs(across) <= allowed_aside(requirements, survey),
        "banked": np.abs(aligned.track.attitude[window, ROLL]) <= MAX_PHOTO_BANK_RAD,
        "high": np.abs(off) <= allowed,
        "dark": _camera_on(requirements, line, position, along, ahead, axis.length),
    }
    return _Rows(axis, window, position, along, across, ahead, off, allowed, needed)


def measure_line(
    requirements: RouteRequirements, aligned: AlignedTrack, survey: Survey, line: PhotoLine
) -> LineMeasure | None:
    """Measure a photo line on a flown track; return None if no row lies between the neighbouring waypoints."""
    rows = _line_rows(requirements, aligned, survey, line)
    if rows is None:
        return None
    length, along, ahead = rows.axis.length, rows.along, rows.ahead
    good, state, lost = np.ones(0, dtype=np.bool_), ahead, {}
    for name, fulfilled in rows.needed.items():
        state = state & fulfilled
        before = float(good.mean()) if good.size else 1.0
        good = _line_steps(along, state, length)
        lost[name] = before - float(good.mean())
    found = np.flatnonzero(good)
    step = length / len(good)
    over = ahead & (along >= 0.0) & (along <= length)
    photos, missed = _count_photos(
        line, _line_steps(along, ahead & rows.needed["away"] & rows.needed["dark"], length), length
    )
    return LineMeasure(
        length=length,
        good=float(good.mean()),
        **lost,
        late=float(found[0] * step) if found.size else length,
        early=float((len(good) - 1 - found[-1]) * step) if found.size else length,
        aside=float(np.abs(rows.across[over]).max(initial=0.0)),
        off=float(max(rows.off[over], key=abs, default=0.0)),
        photos=photos,
        missed=missed,
        allowed_aside=allowed_aside(requirements, survey),
        allowed_off=float(rows.allowed.min(initial=math.inf)),
        lost=_set_runs(~good, step),
    )


def _set_runs(cells: Flags, step: float) -> tuple[tuple[float, float], ...]:
    """Return the start and end of each run of set cells, m."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], cells.astype(int), [0]]))) * step
    return tuple((float(low), float(high)) for low, high in zip(edges[::2], edges[1::2], strict=True))


def _row_window(requirements: RouteRequirements, aligned: AlignedTrack, line: PhotoLine) -> slice:
    """Return the rows from the waypoint before the line's straight run to the waypoint after it."""
    first, last = max(0, line.begins - 1), min(requirements.legs, line.ends + 1)
    return slice(int(aligned.rows[first]), int(aligned.rows[last]) + 1)


def _height_errors(
    requirements: RouteRequirements, axis: LineAxis, position: Floats, along: Floats
) -> tuple[Floats, Floats]:
    """Return each row's error from the planned height above ground, and the tolerance of the error, m."""
    planned = over_ground(requirements, axis.at(along))
    allowed = np.maximum(MIN_PHOTO_HEIGHT_ERROR_M, PHOTO_HEIGHT_FRACTION * planned)
    return over_ground(requirements, position) - planned, allowed


def over_ground(requirements: RouteRequirements, places: Floats) -> Floats:
    """Return the heights of places (n, 3) above ground, m, (n,).

    Without terrain, heights are above home, or above the route's lowest waypoint if there is no home.
    """
    ground, home = requirements.setup.scenario.terrain, requirements.setup.mission.home
    if ground is not None:
        return places[:, 2] - ground.height(places[:, 0], places[:, 1])
    return places[:, 2] - (float(requirements.points[:, 2].min()) if home is None else home.alt)


def _camera_on(
    requirements: RouteRequirements, line: PhotoLine, position: Floats, along: Floats, ahead: Flags, length: float
) -> Flags:
    """Return True for each row at which the camera is on.

    ahead: True for each row that flies along the line.

    The camera is on from reaching the line's first waypoint to reaching its last waypoint.  It is always on if the
    mission does not switch it on this line.
    """
    follows, rows = requirements.setup.autopilot.follows_path, np.arange(len(along))

    def reached(waypoint: int, from_along: float, after: int = 0) -> int:
        away = np.hypot(*(position[:, :2] - requirements.points[waypoint, :2]).T)
        # An autopilot that follows a path is at a waypoint where the path passes it.
        near = 0.0 if follows else reach(requirements, waypoint).radius
        indices = np.flatnonzero(((away <= near) | (along >= from_along)) & ahead & (rows >= after))
        return int(indices[0]) if indices.size else len(along)

    begins = reached(line.first, 0.0) if line.switched_on else 0
    ends = reached(line.last, length, begins) if line.switched_off else len(along)
    return (rows >= begins) & (rows <= ends)


def _line_steps(along: Floats, state: Flags, length: float) -> Flags:
    """Return True for each step of a line that lies between two consecutive rows at which `state` is True."""
    count = max(1, math.ceil(length / PHOTO_STEP_M))
    both = state[:-1] & state[1:] & (np.diff(along) > 0.0)
    edges = np.clip(along / length * count, 0.0, count)
    begin, end = np.floor(edges[:-1]).astype(int)[both], np.ceil(edges[1:]).astype(int)[both]
    marks = np.zeros(count + 1, dtype=np.int64)
    np.add.at(marks, begin, 1)
    np.add.at(marks, end, -1)
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
    line, apart, height, slow: where that is: the line's number from 0, m between photos, m above ground, and True if
        the camera cannot take them any sooner.
    side: overlap with the photos of the neighbouring line; None if no two usable lines are next to each other.
    pair, between, heights: where that is: both lines' numbers, m between them, m above ground.
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
    for fulfilled in rows.needed.values():
        usable = usable & fulfilled
    speeds = np.hypot(*aligned.track.velocity[rows.window, :2].T)
    return _Strip(rows.position, over_ground(requirements, rows.position), speeds, usable)


def _with_front_overlap(measure: OverlapMeasure, survey: Survey, strips: Sequence[_Strip | None]) -> OverlapMeasure:
    """Return the measure with its fields for the minimum overlap along the lines filled in."""
    camera = measure.camera
    for number, (line, strip) in enumerate(zip(survey.lines, strips, strict=True)):
        if strip is None or line.photo <= 0.0 or not strip.usable.any():
            continue
        apart = np.maximum(line.photo, camera.interval * strip.speeds)[strip.usable]
        heights = strip.heights[strip.usable]
        shares = 1.0 - apart / (camera.along * np.maximum(heights, 1e-9))
        k = int(np.argmin(shares))
        if measure.front is None or shares[k] < measure.front:
            metres, slow = float(apart[k]), bool(apart[k] > line.photo)
            measure = replace(
                measure, front=float(shares[k]), line=number, apart=metres, height=float(heights[k]), slow=slow
            )
    return measure


def _with_side_overlap(
    measure: OverlapMeasure, requirements: RouteRequirements, survey: Survey, strips: Sequence[_Strip | None]
) -> OverlapMeasure:
    """Return the measure with its fields for the minimum overlap across neighbouring lines filled in."""
    corners = [requirements.points[line.first : line.last + 1] for line in survey.lines]
    axis = LineAxis(corners[0])
    ends = [axis.of(places)[0] for places in corners]
    low = min(float(along.min()) for along in ends)
    length = max(float(along.max()) for along in ends) - low
    count = max(1, math.ceil(length / PHOTO_STEP_M))
    middles = (np.arange(count) + 0.5) * length / count
    last = np.full((4, count), np.nan)
    for number in np.argsort(survey.offsets).tolist():
        strip, along = strips[number], ends[number] - low
        here = (middles >= along.min()) & (middles <= along.max())
        now = np.full((4, count), np.nan)
        now[3, here] = number
        if strip is not None and strip.usable.any():
            at, across, _ = axis.of(strip.places)
            forth = along[-1] >= along[0]
            cells = _line_steps((at - low) if forth else length - (at - low), strip.usable, length)
            used = here & (cells if forth else cells[::-1])
            order = np.argsort(at[strip.usable])
            for row, values in enumerate((across, strip.heights)):
                own = np.interp(middles, (at[strip.usable] - low)[order], values[strip.usable][order])
                now[row] = np.where(used, own, np.nan)
        gaps, heights = np.abs(now[0] - last[0]), 0.5 * (now[1] + last[1])
        shares = 1.0 - gaps / (measure.camera.across * np.maximum(heights, 1e-9))
        if np.isfinite(shares).any():
            k = int(np.nanargmin(shares))
            if measure.side is None or shares[k] < measure.side:
                pair = (int(last[3, k]), number)
                measure = replace(
                    measure, side=float(shares[k]), pair=pair, between=float(gaps[k]), heights=float(heights[k])
                )
        last[:, here] = now[:, here]
    return measure
