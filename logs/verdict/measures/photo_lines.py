"""Measure the usable part of each photo line, and the overlap of a survey's photos."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import OVER_HOME, Camera, Command, Mission
from flight.mission.surveys import LineAxis, PhotoLine, Survey, camera_spacing, survey_plan
from flight.simulation.track import ROLL, YAW
from logs.verdict.measures.acceptance import acceptance_limit, position_error
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.tolerances import (
    MAX_PHOTO_BANK_RAD,
    MAX_PHOTO_COURSE_ERROR_RAD,
    MIN_PHOTO_HEIGHT_ERROR_M,
    PHOTO_COVERAGE_FRACTION,
    PHOTO_HEIGHT_FRACTION,
    PHOTO_OFFSET_FRACTION,
    PHOTO_OVERLAP_TOLERANCE,
    PHOTO_STEP_M,
)
from world.arrays import Flags, Floats


@dataclass(frozen=True, slots=True)
class LineMeasure:
    """One photo line as flown.

    length: m.
    usable, off_line, banked, off_height, camera_off, unknown: fractions of the length, which add up to 1.  A part that
        is not usable belongs to the first condition that it fails.  off_line: not flown along, or too far to the side.
        banked: too much bank.  off_height: too large a height error.  unknown: no other fault, but the terrain data do
        not cover the ground, so the height error is unknown.
    lost_at_start, lost_at_end: lost length at either end of the line, m; an unknown part is not lost.
    max_lateral_offset: maximum distance to the side of the line, m.
    max_height_error: maximum height error, m, positive above; NaN if unknown everywhere.
    planned_photo_count, missed_photo_count: number of planned photos, and how many of them are missed, also because the
        camera is too slow; both 0 if no distance between photos is stated.  No photo is missed if one is taken at each
        planned position, or shifted by less than the distance between two photos.
    taken_photo_count: number of photos that the camera takes on the line, counted from where it is switched on.
    lateral_tolerance: tolerance of the lateral offset, m.
    min_height_tolerance: smallest height tolerance anywhere along the line, m.
    lost_spans, unknown_spans: start and end of each lost part and of each unknown part, m from the line's start.
    """

    length: float
    usable: float
    off_line: float
    banked: float
    off_height: float
    camera_off: float
    lost_at_start: float
    lost_at_end: float
    max_lateral_offset: float
    max_height_error: float
    planned_photo_count: int
    missed_photo_count: int
    lateral_tolerance: float
    min_height_tolerance: float
    lost_spans: tuple[tuple[float, float], ...] = ()
    unknown: float = 0.0
    unknown_spans: tuple[tuple[float, float], ...] = ()
    taken_photo_count: int = 0

    @property
    def ok(self) -> bool | None:
        """True if enough of the line is usable, False if not, None if unknown ground decides."""
        return is_covered(self.usable, self.unknown)


def is_covered(usable: float, unknown: float) -> bool | None:
    """Return True if enough of a photo line is usable, False if not, None if unknown parts decide.

    usable, unknown: fractions of the length of the line.

    >>> is_covered(0.96, 0.04), is_covered(0.9, 0.0), is_covered(0.4, 0.6), is_covered(0.4, 0.5)
    (True, False, None, False)
    """
    if usable >= PHOTO_COVERAGE_FRACTION:
        return True
    return None if usable + unknown >= PHOTO_COVERAGE_FRACTION else False


def lateral_tolerance(requirements: RouteRequirements, survey: Survey) -> float:
    """Return how far to the side of a photo line a photo may be taken, m.

    The navigation error is included.
    """
    return PHOTO_OFFSET_FRACTION * survey.spacing + position_error(requirements.setup)


@dataclass(frozen=True, slots=True)
class _LineRows:
    """Rows of the track on which a photo line may have been flown.

    axis: the line.
    track_rows: range of the n rows in the track.
    position: m, (n, 3).
    along, across: distance along the line and to its side, m, (n,).
    crab: angle from the line to the nose, rad, clockwise positive, (n,).
    is_ahead: True for each row that flies along the line, (n,).
    height_error, height_tolerance: error from the planned height above ground, and its tolerance, m, (n,).
    conditions: for each cause of loss, a mask (n,) that is True for the rows without this cause.
    """

    axis: LineAxis
    track_rows: slice
    position: Floats
    along: Floats
    across: Floats
    crab: Floats
    is_ahead: Flags
    height_error: Floats
    height_tolerance: Floats
    conditions: dict[str, Flags]


def _line_rows(
    requirements: RouteRequirements, aligned: AlignedTrack, survey: Survey, line: PhotoLine
) -> _LineRows | None:
    """Return the rows on which a photo line may have been flown.

    Return None if it was not reached or has only one row.
    """
    axis = LineAxis(requirements.points[line.first : line.last + 1])
    # From the waypoint before the line and its leads to the waypoint after them.
    first, last = max(0, line.begins - 1), min(requirements.legs, line.ends + 1)
    window = slice(int(aligned.rows[first]), int(aligned.rows[last]) + 1)
    if window.stop - window.start < 2 or not aligned.passed[line.begins]:
        return None
    position = aligned.track.position[window]
    along, across, course = axis.project(position)
    course_error = np.abs(np.angle(np.exp(1j * (aligned.course[window] - course))))
    crab = np.angle(np.exp(1j * (aligned.track.attitude[window, YAW] - course)))
    is_ahead = course_error <= MAX_PHOTO_COURSE_ERROR_RAD
    # Error from the planned height above ground, and its tolerance, m.
    planned_height = heights_over_ground(requirements, axis.points_at(along))
    height_error = heights_over_ground(requirements, position) - planned_height
    height_tolerance = np.maximum(MIN_PHOTO_HEIGHT_ERROR_M, PHOTO_HEIGHT_FRACTION * planned_height)
    conditions = {
        "off_line": np.abs(across) <= lateral_tolerance(requirements, survey),
        "banked": np.abs(aligned.track.attitude[window, ROLL]) <= MAX_PHOTO_BANK_RAD,
        # An unknown height error (NaN) does not count as too large; the condition "unknown" handles it.
        "off_height": ~(np.abs(height_error) > height_tolerance),
        "camera_off": _camera_on_rows(requirements, aligned, line, axis, window, is_ahead),
        "unknown": np.isfinite(height_error),
    }
    return _LineRows(axis, window, position, along, across, crab, is_ahead, height_error, height_tolerance, conditions)


def measure_line(
    requirements: RouteRequirements, aligned: AlignedTrack, survey: Survey, line: PhotoLine
) -> LineMeasure | None:
    """Measure a photo line on a flown track; return None if it was not reached or has only one row.

    The line is divided into steps of about `PHOTO_STEP_M`.  The conditions of a usable photo are applied to each step
    one after another; the first condition that a step fails is the cause of its loss.
    """
    rows = _line_rows(requirements, aligned, survey, line)
    if rows is None:
        return None
    length, along, is_ahead = rows.axis.length, rows.along, rows.is_ahead
    is_good, meets_conditions, lost_fractions = np.ones(1, dtype=np.bool_), is_ahead, {}
    for name, is_met in rows.conditions.items():
        meets_conditions, is_kept = meets_conditions & is_met, is_good
        is_good = _line_steps(along, meets_conditions, length)
        lost_fractions[name] = float(is_kept.mean()) - float(is_good.mean())
    # `is_kept` now marks the steps that are usable or unknown, because the last condition is "unknown".
    kept_steps = np.flatnonzero(is_kept)
    step = length / len(is_good)
    is_on_line = is_ahead & (along >= 0.0) & (along <= length)
    height_errors = rows.height_error[is_on_line & rows.conditions["unknown"]]
    is_taken = _line_steps(along, is_ahead & rows.conditions["off_line"] & rows.conditions["camera_off"], length)
    step_middles = (np.arange(len(is_taken)) + 0.5) * step
    order = np.argsort(along[is_ahead])
    speeds = np.hypot(*aligned.track.velocity[rows.track_rows, :2].T)[is_ahead][order]
    spacing = _photo_spacing(
        requirements.setup.mission,
        line.photo,
        np.interp(step_middles, along[is_ahead][order], speeds) if speeds.size else np.zeros(len(step_middles)),
    )
    # Photos taken on the line, up to `PHOTO_STEP_M` beyond its ends.
    photo_rows = _photo_rows(requirements, aligned, range(line.first, line.last)) - rows.track_rows.start
    photo_rows = photo_rows[(photo_rows >= 0) & (photo_rows < len(rows.along))]
    is_between_ends = (rows.along >= -PHOTO_STEP_M) & (rows.along <= rows.axis.length + PHOTO_STEP_M)
    is_on_photo_line = rows.is_ahead & rows.conditions["off_line"] & is_between_ends
    taken_photo_count = int(np.count_nonzero(is_on_photo_line[photo_rows]))
    planned_photo_count, missed_photo_count = _count_photos(line, is_taken, length, spacing)
    if missed_photo_count:
        # A camera that is switched on too early or too late also shifts the photos along the line.
        missed_photo_count = max(missed_photo_count, planned_photo_count - taken_photo_count)
    return LineMeasure(
        length=length,
        usable=float(is_good.mean()),
        **lost_fractions,
        lost_at_start=float(kept_steps[0] * step) if kept_steps.size else length,
        lost_at_end=float((len(is_good) - 1 - kept_steps[-1]) * step) if kept_steps.size else length,
        max_lateral_offset=float(np.abs(rows.across[is_on_line]).max(initial=0.0)),
        max_height_error=float(max(height_errors, key=abs, default=math.nan if is_on_line.any() else 0.0)),
        planned_photo_count=planned_photo_count,
        missed_photo_count=missed_photo_count,
        lateral_tolerance=lateral_tolerance(requirements, survey),
        min_height_tolerance=float(np.fmin.reduce(rows.height_tolerance, initial=math.inf)),
        lost_spans=_runs_of_set_steps(~is_kept, step),
        unknown_spans=_runs_of_set_steps(is_kept & ~is_good, step),
        taken_photo_count=taken_photo_count,
    )


def _runs_of_set_steps(is_set: Flags, step_length: float) -> tuple[tuple[float, float], ...]:
    """Return the start and end (m) of each run of consecutive steps for which `is_set` is True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], is_set.astype(int), [0]]))) * step_length
    return tuple((float(start), float(end)) for start, end in zip(edges[::2], edges[1::2], strict=True))


def line_distances(axis: LineAxis) -> Floats:
    """Return the distances along a planned photo line at which it is judged, m, (n,).

    These are both ends, and steps between them.

    A step is at most `PHOTO_STEP_M`.
    """
    return np.linspace(0.0, axis.length, max(2, math.ceil(axis.length / PHOTO_STEP_M) + 1))


def heights_over_ground(requirements: RouteRequirements, positions: Floats) -> Floats:
    """Return the heights of positions (n, 3) above ground, m, (n,); NaN where the ground is unknown.

    Without terrain, heights are above home, or above the route's lowest waypoint if there is no home.
    """
    terrain, home = requirements.setup.scenario.terrain, requirements.setup.mission.home
    if terrain is not None:
        return positions[:, 2] - terrain.height(positions[:, 0], positions[:, 1])
    return positions[:, 2] - (float(requirements.points[:, 2].min()) if home is None else home.alt)


def _camera_on_rows(
    requirements: RouteRequirements,
    aligned: AlignedTrack,
    line: PhotoLine,
    axis: LineAxis,
    track_rows: slice,
    is_ahead: Flags,
) -> Flags:
    """Return a mask (n,): True for each of n consecutive rows of the track in which the camera is on.

    axis: axis of the line, onto which positions are projected.
    track_rows: range of the n rows in the track.
    is_ahead: True for each row in which the aircraft flies along the line.

    The camera is on between two rows: the row that reaches the waypoint where the mission switches it on, and the row
    that reaches the waypoint where it is switched off.  Both waypoints may lie beyond the line's ends, and either may
    be missing.
    """
    position = aligned.track.position[track_rows]
    rows, distance_along = np.arange(len(position)), axis.project(position)[0]

    def first_row_at(waypoint: int, first_row: int = 0) -> int:
        """Return the first row, from `first_row` on, that reaches or passes a waypoint."""
        point = requirements.points[waypoint]
        distances = np.hypot(*(position[:, :2] - point[:2]).T)
        is_at_waypoint = (distances <= _switch_radii(requirements, aligned, waypoint, track_rows)) | (
            distance_along >= axis.project(point[None])[0][0]
        )
        indices = np.flatnonzero(is_at_waypoint & is_ahead & (rows >= first_row))
        return int(indices[0]) if indices.size else len(distance_along)

    on_row = first_row_at(line.camera_on_at) if line.camera_on_at >= 0 else 0
    off_row = first_row_at(line.camera_off_at, on_row) if line.camera_off_at >= 0 else len(distance_along)
    return (rows >= on_row) & (rows <= off_row)


def _switch_radii(
    requirements: RouteRequirements, aligned: AlignedTrack, waypoint: int, track_rows: slice
) -> Floats | float:
    """Return the distance before a waypoint at which its items switch the camera, m.

    The items follow the waypoint in the mission.

    The distance is 0 at a gate, which is passed at its plane, and for an autopilot that follows a path.  If it depends
    on the ground speed, it is an array with a distance for each row of `track_rows`.
    """
    turns = requirements.setup.autopilot.turns
    if turns.follows_path or _is_gate(requirements, waypoint):
        return 0.0
    if turns.radii_at is not None:
        return turns.radii_at(np.hypot(*aligned.track.velocity[track_rows, :2].T))
    return acceptance_limit(requirements, waypoint)[0]


def planned_switch_radius(requirements: RouteRequirements, waypoint: int) -> float:
    """Return the distance before a waypoint at which its items switch the camera, m.

    It applies to the planned path; the items follow the waypoint in the mission.

    The distance is 0 at a gate, and for an autopilot that follows a path.
    """
    turns = requirements.setup.autopilot.turns
    if turns.follows_path or _is_gate(requirements, waypoint):
        return 0.0
    if turns.radii_at is not None:
        leg = max(0, waypoint - 1)
        return float(turns.radii_at(requirements.ground_speed[leg : leg + 1])[0])
    return acceptance_limit(requirements, waypoint)[0]


def _is_gate(requirements: RouteRequirements, waypoint: int) -> bool:
    """Return True if a waypoint of the route is a gate (CONDITION_GATE)."""
    seq = int(requirements.setup.route.items[waypoint])
    return any(item.seq == seq and item.command == Command.CONDITION_GATE for item in requirements.setup.mission.items)


def _line_steps(along: Floats, is_set: Flags, length: float) -> Flags:
    """Convert a mask of the track's rows to a mask of a photo line's steps of about `PHOTO_STEP_M`.

    A step is True if the track touches it between two consecutive rows for which `is_set` is True.
    along: distance of each row along the line, m, (n,).
    is_set: mask of the rows, (n,).
    length: length of the line, m.
    """
    count = max(1, math.ceil(length / PHOTO_STEP_M))
    in_both = is_set[:-1] & is_set[1:] & (np.diff(along) > 0.0)
    edges = np.clip(along / length * count, 0.0, count)
    first_steps = np.floor(edges[:-1]).astype(int)[in_both]
    end_steps = np.ceil(edges[1:]).astype(int)[in_both]
    marks = np.zeros(count + 1, dtype=np.int64)
    np.add.at(marks, first_steps, 1)
    np.add.at(marks, end_steps, -1)
    return np.cumsum(marks[:-1]) > 0


def _count_photos(line: PhotoLine, is_taken: Flags, length: float, spacing: Floats) -> tuple[int, int]:
    """Return the number of planned photos on a line, and how many of them are missed.

    Both are 0 for a line that states no distance between photos.

    is_taken: True for each step of the line on which the camera takes photos, (n,).
    length: length of the line, m.
    spacing: distance between photos that the camera achieves on each step, m, (n,).
    """
    if line.photo <= 0.0:
        return 0, 0
    count, step_count = int(length / line.photo) + 1, len(is_taken)
    photos_before_edge = np.concatenate([[0.0], np.cumsum(length / step_count / spacing)])
    # A deficit of a millionth of a photo is rounding.
    numbers = np.arange(int(photos_before_edge[-1] + 1e-6) + 1)
    steps = np.minimum(np.interp(numbers, photos_before_edge, np.arange(step_count + 1)).astype(int), step_count - 1)
    return count, count - int(np.count_nonzero(is_taken[steps]))


def _photo_spacing(mission: Mission, photo_spacing: float, speeds: Floats) -> Floats:
    """Return the distance between photos that the camera achieves at each ground speed, m, (n,).

    It is longer than the stated distance if the camera needs more time between two photos.

    photo_spacing: distance between photos that the items state, m.
    speeds: m/s, (n,).
    """
    plan = survey_plan(mission, photo_spacing)
    interval = 0.0 if plan is None or plan.camera is None else plan.camera.interval
    return np.maximum(photo_spacing, interval * speeds)


def _switch_row(requirements: RouteRequirements, aligned: AlignedTrack, waypoint: int) -> int:
    """Return the row of the track in which the items after a waypoint take effect and switch the camera.

    At a gate it is the first row behind the gate's plane.  Otherwise it is the first row within the distance from
    `_switch_radii`, or the row that passes the waypoint if there is none.
    """
    first, last = int(aligned.rows[max(0, waypoint - 1)]), int(aligned.rows[waypoint]) + 1
    offsets = aligned.track.position[first:last, :2] - requirements.points[waypoint, :2]
    if _is_gate(requirements, waypoint) and waypoint < requirements.legs:
        course = requirements.points[waypoint + 1, :2] - requirements.points[waypoint, :2]
        rows_before = np.flatnonzero(offsets @ course < 0.0)
        return min(last - 1, first + int(rows_before[-1]) + 1) if rows_before.size else last - 1
    switch_radii = _switch_radii(requirements, aligned, waypoint, slice(first, last))
    indices = np.flatnonzero(np.hypot(*offsets.T) <= switch_radii)
    return first + int(indices[0]) if indices.size else last - 1


def count_flight_photos(requirements: RouteRequirements, aligned: AlignedTrack) -> int:
    """Return the number of photos that the camera takes on a whole flight, on and between the photo lines."""
    return len(_photo_rows(requirements, aligned, range(requirements.legs)))


def _photo_rows(requirements: RouteRequirements, aligned: AlignedTrack, legs: range) -> NDArray[np.int64]:
    """Return the row of the track in which the camera takes each photo on some legs, (n,).

    Neighbouring legs with the same distance between photos are included, because the camera measures this distance from
    the place where it was switched on and took its first photo.  Legs for which no distance is stated, and legs that
    the flight has not reached, have no photos.
    """
    setup, track, photo_rows = requirements.setup, aligned.track, [np.empty(0, dtype=np.int64)]
    spacings = camera_spacing(setup.mission, setup.route)[:-1].tolist()
    for spacing, group in itertools.groupby(range(len(spacings)), spacings.__getitem__):
        group_legs = list(group)
        # The comparison is also False for a distance of NaN.
        if not spacing > 0.0 or not aligned.passed[group_legs[0]] or set(legs).isdisjoint(group_legs):
            continue
        rows = slice(
            *(_switch_row(requirements, aligned, waypoint) for waypoint in (group_legs[0], group_legs[-1] + 1))
        )
        if rows.stop - rows.start < 2:
            continue
        lengths = np.hypot(*np.diff(track.position[rows, :2], axis=0).T)
        speeds = np.hypot(*track.velocity[rows, :2].T)[1:]
        photos_before_row = np.cumsum(lengths / _photo_spacing(setup.mission, spacing, speeds))
        # A deficit of a millionth of a photo is rounding.
        numbers = np.arange(int(photos_before_row[-1] + 1e-6) + 1)
        photo_rows.append(rows.start + np.searchsorted(np.concatenate([[0.0], photos_before_row]), numbers - 1e-6))
    return np.concatenate(photo_rows)


# ----------------------------------------------------------------------
# Overlap of photos.  A photo is a rectangle on level ground below the aircraft, sized by its height above ground there;
# the aircraft's tilt is ignored.


# The common area of two photos is summed over a grid with this many steps along each side of a photo.
_AREA_STEPS = 400
# Largest error of the common area, as a fraction of a photo.
_AREA_ERROR = 0.003


@dataclass(frozen=True, slots=True)
class OverlapMeasure:
    """Minimum overlap of a survey's usable photos, as fractions of a photo; 0 for a gap between them.

    camera: the camera that takes them.
    front: overlap with the next photo on the line; None if the distance between photos is not stated, or none is
        usable.
    line, photo_spacing, height, is_camera_limited: for the minimum front overlap: number of the line from 0, distance
        between photos, m, height above ground, m, and True if the camera cannot take photos at shorter intervals.
    side: overlap with the photos of the neighbouring line, where both lines run side by side; a line of which too much
        is lost is compared only if no two others are neighbours. None if no two usable lines are next to each other.
    line_pair, line_spacing, side_height: for the minimum side overlap: numbers of both lines, distance between them, m,
        and height above ground, m.
    side_crabs: crab angles of both lines there, rad.
    max_crab: largest crab angle at the usable photos, from the line to the nose, rad; 0 for a planned path.
    min_height, max_height: heights above ground of the usable photos, m; NaN if none is usable.
    unusable_fraction, unknown_fraction: fractions of the length of all lines where no overlap is judged, because no
        photo is usable, or because the terrain data do not cover the ground.
    relief: difference between the highest and the lowest ground below the usable photos, m; 0 unless all lines are
        planned at one altitude.
    planned_height: planned height of the lines above the ground, or above home, m; 0 if the mission states none.
    """

    camera: Camera
    front: float | None = None
    line: int = -1
    photo_spacing: float = math.nan
    height: float = math.nan
    is_camera_limited: bool = False
    side: float | None = None
    line_pair: tuple[int, int] = (-1, -1)
    line_spacing: float = math.nan
    side_height: float = math.nan
    side_crabs: tuple[float, float] = (0.0, 0.0)
    max_crab: float = 0.0
    min_height: float = math.nan
    max_height: float = math.nan
    unusable_fraction: float = 0.0
    unknown_fraction: float = 0.0
    relief: float = 0.0
    planned_height: float = 0.0

    @property
    def is_lost_by_relief(self) -> bool:
        """True if overlaps are too small because lines at one altitude do not follow the terrain.

        At the planned height, or at the middle of the flown heights, these overlaps would be large enough.
        """
        height = self.planned_height or 0.5 * (self.min_height + self.max_height)
        if not self.relief > PHOTO_HEIGHT_FRACTION * height:
            return False
        overlaps = (
            (self.front, self.camera.front, self.photo_spacing, self.camera.along),
            (self.side, self.camera.side, self.line_spacing, self.camera.across),
        )
        needed_heights = [
            distance / (width * (1.0 - required + PHOTO_OVERLAP_TOLERANCE))
            for overlap, required, distance, width in overlaps
            if overlap is not None and required is not None and overlap < required - PHOTO_OVERLAP_TOLERANCE
        ]
        return bool(needed_heights) and max(needed_heights) <= height

    @property
    def needed_photo_spacing(self) -> float | None:
        """Largest photo spacing with the required front overlap for the lowest photos, m; None if unknown."""
        if self.front is None or self.camera.front is None:
            return None
        return (1.0 - self.camera.front) * self.camera.along * self.min_height

    @property
    def needed_line_spacing(self) -> float | None:
        """Largest line spacing with the required side overlap for the lowest photos, m; None if unknown."""
        if self.side is None or self.camera.side is None:
            return None
        return (1.0 - self.camera.side) * self.camera.across * self.min_height

    @property
    def side_area(self) -> float:
        """Common area of the two photos with the minimum side overlap, turned by their crab angles.

        It is a fraction of a photo, and 0 if the side overlap is unknown.
        """
        return _common_area(self.camera, self.line_spacing, self.side_height, self.side_crabs)

    @property
    def is_side_unknown(self) -> bool:
        """True if the side overlap is large enough, but the common area of the turned photos is not."""
        if self.side is None or self.camera.side is None:
            return False
        limit = self.camera.side - PHOTO_OVERLAP_TOLERANCE
        return self.side_area < limit - _AREA_ERROR and self.side >= limit

    @property
    def front_gap(self) -> float:
        """Gap between the photos with the minimum front overlap, m; 0 if they touch."""
        return max(0.0, self.photo_spacing - self.camera.along * self.height)

    @property
    def side_gap(self) -> float:
        """Gap between the photos with the minimum side overlap, m; 0 if they touch."""
        return max(0.0, self.line_spacing - self.camera.across * self.side_height)

    @property
    def ground_sampling(self) -> tuple[float, float] | None:
        """Smallest and largest distance on the ground between two pixels of a photo, m; None if unknown."""
        if not self.camera.pixels_across or not math.isfinite(self.min_height):
            return None
        scale = self.camera.across / self.camera.pixels_across
        return scale * self.min_height, scale * self.max_height


# Largest difference of the planned altitudes of lines at one altitude, m.
_LEVEL_LINES_M = 1.0
# Maximum distance of neighbouring lines, in spacings of the survey: one line may be missing between them.
_MAX_NEIGHBOR_SPACINGS = 2.5
# Maximum distance of lines at one lateral position, such as the two parts of a line across a notch, in spacings.
_SAME_POSITION_SPACINGS = 0.2


class _Strip(NamedTuple):
    """Points of a photo line, with a flag for usable points.

    positions: m, (n, 3).
    heights: heights above ground, m, (n,).
    speeds: ground speeds, m/s, (n,).
    crabs: crab angles, rad, (n,).
    is_usable: True for usable points, (n,).
    usable_fraction, unknown_fraction: fractions of the line's length with usable points, and over unknown ground.
    """

    positions: Floats
    heights: Floats
    speeds: Floats
    crabs: Floats
    is_usable: Flags
    usable_fraction: float = 1.0
    unknown_fraction: float = 0.0


def measure_overlap(
    requirements: RouteRequirements, aligned: AlignedTrack | None, survey: Survey
) -> OverlapMeasure | None:
    """Measure how much a survey's photos overlap, as flown, or as planned if ``aligned`` is None.

    Return None if no camera is known.
    """
    first_line = next(iter(survey.lines))
    plan = survey_plan(requirements.setup.mission, first_line.photo)
    if plan is None or plan.camera is None:
        return None
    strips = [_line_strip(requirements, aligned, survey, line) for line in survey.lines]
    kept_strips = [
        None if strip is None or is_covered(strip.usable_fraction, strip.unknown_fraction) is False else strip
        for strip in strips
    ]
    lengths = [LineAxis(requirements.points[line.first : line.last + 1]).length for line in survey.lines]
    unknown_fractions = [0.0 if strip is None else strip.unknown_fraction for strip in strips]
    kept_fractions = [0.0 if strip is None else strip.usable_fraction + strip.unknown_fraction for strip in strips]
    used_heights = [strip.heights[strip.is_usable] for strip in strips if strip is not None]
    heights = np.concatenate(used_heights) if used_heights else np.empty(0)
    altitudes = np.concatenate([requirements.points[line.first : line.last + 1, 2] for line in survey.lines])
    start_seq = int(requirements.route.items[first_line.first])
    heights_above_home = (
        item.alt for item in requirements.setup.mission.items if item.seq == start_seq and item.frame in OVER_HOME
    )
    measure = OverlapMeasure(
        plan.camera,
        planned_height=plan.height or next(heights_above_home, 0.0),
        unusable_fraction=1.0 - float(np.average(kept_fractions, weights=lengths)),
        unknown_fraction=float(np.average(unknown_fractions, weights=lengths)),
    )
    if heights.size:
        grounds = [(strip.positions[:, 2] - strip.heights)[strip.is_usable] for strip in strips if strip is not None]
        relief = float(np.ptp(np.concatenate(grounds))) if float(np.ptp(altitudes)) <= _LEVEL_LINES_M else 0.0
        max_crab = max(float(np.abs(strip.crabs[strip.is_usable]).max(initial=0.0)) for strip in strips if strip)
        measure = replace(
            measure, min_height=float(heights.min()), max_height=float(heights.max()), max_crab=max_crab, relief=relief
        )
    measure = _with_side_overlap(measure, requirements, survey, kept_strips)
    if measure.side is None:
        # No two sufficiently usable lines are neighbours: use the usable parts of all lines.
        measure = _with_side_overlap(measure, requirements, survey, strips)
    # The lowest front overlap, between successive photos on a line.
    lowest_overlap = math.inf
    for number, (line, strip) in enumerate(zip(survey.lines, strips, strict=True)):
        if strip is None or line.photo <= 0.0 or not strip.is_usable.any():
            continue
        spacing = np.maximum(line.photo, plan.camera.interval * strip.speeds)[strip.is_usable]
        heights = strip.heights[strip.is_usable]
        overlaps = _overlaps(spacing, plan.camera.along, heights)
        lowest_index = int(np.argmin(overlaps))
        if overlaps[lowest_index] < lowest_overlap:
            lowest_overlap = float(overlaps[lowest_index])
            measure = replace(
                measure,
                front=max(0.0, lowest_overlap),
                line=number,
                photo_spacing=float(spacing[lowest_index]),
                height=max(0.0, float(heights[lowest_index])),
                is_camera_limited=bool(spacing[lowest_index] > line.photo),
            )
    return measure


def _line_strip(
    requirements: RouteRequirements, aligned: AlignedTrack | None, survey: Survey, line: PhotoLine
) -> _Strip | None:
    """Return the points of a photo line, as flown, or as planned if ``aligned`` is None.

    Return None if the line was not flown.  A point is usable if the ground below it is known and, on a flown line, if
    all conditions for a usable photo are met there.
    """
    if aligned is None:
        axis = LineAxis(requirements.points[line.first : line.last + 1])
        along = line_distances(axis)
        legs = np.clip(np.searchsorted(axis.along, along, "right") - 1, 0, len(axis.along) - 2) + line.first
        positions, speeds = axis.points_at(along), requirements.ground_speed[legs]
        heights = heights_over_ground(requirements, positions)
        is_known = np.isfinite(heights)
        known_fraction = float(is_known.mean())
        return _Strip(positions, heights, speeds, np.zeros(len(along)), is_known, known_fraction, 1.0 - known_fraction)
    rows = _line_rows(requirements, aligned, survey, line)
    if rows is None:
        return None
    meets_known_conditions = rows.is_ahead & np.all(
        [met for name, met in rows.conditions.items() if name != "unknown"], axis=0
    )
    meets_conditions = meets_known_conditions & rows.conditions["unknown"]
    possible_fraction, usable_fraction = (
        float(_line_steps(rows.along, is_met, rows.axis.length).mean())
        for is_met in (meets_known_conditions, meets_conditions)
    )
    is_usable = meets_conditions & (rows.along >= 0.0) & (rows.along <= rows.axis.length)
    speeds = np.hypot(*aligned.track.velocity[rows.track_rows, :2].T)
    heights = heights_over_ground(requirements, rows.position)
    unknown_fraction = possible_fraction - usable_fraction
    return _Strip(rows.position, heights, speeds, rows.crab, is_usable, usable_fraction, unknown_fraction)


def _overlaps(distances: Floats, width: float, heights: Floats) -> Floats:
    """Return the overlap of each pair of neighbouring photos, (n,); negative for a gap.

    The overlap is a fraction of a photo.

    distances: distance between the two photos, m, (n,).
    width: width of a photo in the direction of this distance, as a multiple of the height.
    heights: heights above ground, m, (n,).
    """
    return 1.0 - distances / (width * np.maximum(heights, 1e-9))


def _with_side_overlap(
    measure: OverlapMeasure, requirements: RouteRequirements, survey: Survey, strips: Sequence[_Strip | None]
) -> OverlapMeasure:
    """Return a copy of the measure with the minimum side overlap between photos of neighbouring lines.

    All lines are projected onto the first line and divided into the same steps along it.  From one side of the survey
    to the other, each line is compared at every step with the previous line that covers this step.

    Two lines are neighbours if they run side by side, no other line lies between them (not even a lost one), and their
    distance is at most `_MAX_NEIGHBOR_SPACINGS`.  A larger distance spans a notch in the survey's area.

    strips: points of each line of the survey; None for a line that was not flown or is not used.
    """
    # Rank of each line from one side of the survey to the other; lines at about the same offset share a rank.
    offsets, ranks = np.array(survey.offsets), np.zeros(len(survey.lines), dtype=np.int64)
    lateral_order = np.argsort(offsets)
    ranks[lateral_order[1:]] = np.cumsum(np.diff(offsets[lateral_order]) > _SAME_POSITION_SPACINGS * survey.spacing)
    corners = [requirements.points[line.first : line.last + 1] for line in survey.lines]
    axis = LineAxis(corners[0])
    end_distances = [axis.project(corner_points)[0] for corner_points in corners]
    min_along = min(float(along.min()) for along in end_distances)
    length = max(float(along.max()) for along in end_distances) - min_along
    count = max(1, math.ceil(length / PHOTO_STEP_M))
    step_middles = (np.arange(count) + 0.5) * length / count
    # The previous line at each step: offset (m), height above ground (m), crab angle (rad) and number.
    previous_line, lowest_overlap = np.full((4, count), np.nan), math.inf
    for number in lateral_order.tolist():
        strip, along = strips[number], end_distances[number] - min_along
        on_line = (step_middles >= along.min()) & (step_middles <= along.max())
        this_line = np.full((4, count), np.nan)
        this_line[3, on_line] = number
        if strip is not None and strip.is_usable.any():
            point_along, across, _ = axis.project(strip.positions)
            is_forward = along[-1] >= along[0]
            is_flown_usably = _line_steps(
                (point_along - min_along) if is_forward else length - (point_along - min_along), strip.is_usable, length
            )
            is_used = on_line & (is_flown_usably if is_forward else is_flown_usably[::-1])
            order = np.argsort(point_along[strip.is_usable])
            for row, values in enumerate((across, strip.heights, strip.crabs)):
                line_values = np.interp(
                    step_middles, (point_along[strip.is_usable] - min_along)[order], values[strip.is_usable][order]
                )
                this_line[row] = np.where(is_used, line_values, np.nan)
        gaps = np.abs(this_line[0] - previous_line[0])
        heights = 0.5 * (this_line[1] + previous_line[1])
        previous_numbers = np.nan_to_num(previous_line[3], nan=number).astype(int)
        is_neighbor = (ranks[number] - ranks[previous_numbers] == 1) & (
            np.abs(offsets[number] - offsets[previous_numbers]) <= _MAX_NEIGHBOR_SPACINGS * survey.spacing
        )
        overlaps = np.where(is_neighbor, _overlaps(gaps, measure.camera.across, heights), np.nan)
        if np.isfinite(overlaps).any():
            lowest_index = int(np.nanargmin(overlaps))
            if overlaps[lowest_index] < lowest_overlap:
                lowest_overlap = float(overlaps[lowest_index])
                measure = replace(
                    measure,
                    side=max(0.0, lowest_overlap),
                    line_pair=(int(previous_line[3, lowest_index]), number),
                    line_spacing=float(gaps[lowest_index]),
                    side_height=max(0.0, float(heights[lowest_index])),
                    side_crabs=(float(this_line[2, lowest_index]), float(previous_line[2, lowest_index])),
                )
        previous_line[:, on_line] = this_line[:, on_line]
    return measure


def _common_area(camera: Camera, distance: float, height: float, crabs: tuple[float, float]) -> float:
    """Return the common area of two turned photos side by side, within `_AREA_ERROR`.

    The area is a fraction of a photo.

    distance: distance between the photos, across the lines, m.
    height: height above ground of both, m.
    crabs: angle of each photo to the lines, rad.  Photos of lines in opposite directions may be compared, because a
        photo covers the same ground if it is turned by 180 degrees.

    >>> camera = Camera(across=5.0, along=2.0)
    >>> [round(_common_area(camera, 200.0, 100.0, crabs), 2) for crabs in ((0.0, 0.0), (0.5236, 0.5236))]
    [0.6, 0.33]
    """
    steps = (np.arange(_AREA_STEPS) + 0.5) / _AREA_STEPS - 0.5
    across, along = np.meshgrid(steps * camera.across * height, steps * camera.along * height)
    turn = crabs[1] - crabs[0]
    # From the axes of the first photo to those of the second, whose center is at `distance` across the lines.
    x = across * math.cos(turn) - along * math.sin(turn) - distance * math.cos(crabs[1])
    y = across * math.sin(turn) + along * math.cos(turn) - distance * math.sin(crabs[1])
    return float(((2.0 * np.abs(x) <= camera.across * height) & (2.0 * np.abs(y) <= camera.along * height)).mean())
