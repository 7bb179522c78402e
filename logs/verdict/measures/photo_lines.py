"""How much of a survey's photo line was flown as photos need it: on the line, level, at its height, camera on."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight.mission.surveys import PhotoLine, Survey
from flight.simulation.track import ROLL
from logs.verdict.measures.acceptance import position_error, reach
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.tolerances import (
    PHOTO_ASIDE,
    PHOTO_BANK,
    PHOTO_COURSE,
    PHOTO_HEIGHT,
    PHOTO_HEIGHT_LEAST,
    PHOTO_STEP,
)

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class LineMeasure:
    """One photo line as flown; all shares are of its length, and make 1 together.

    length: m.
    good: share that can be used.  Of the rest, by what it lacks first:
    away: not flown along, or too far beside the line.  banked, high, dark: along the line, but banked too much; then
    too far off its height over ground; then without the camera.
    late, early: m from its begin to the first good place, and from the last good place to its end.
    aside: greatest distance from the line where it was flown along, m; off: greatest height off, m, above positive.
    photos, missed: as planned, and those of them that were not taken; 0 where the way between photos is not stated.
    allowed_aside: m.  allowed_off: least height off that is allowed anywhere along it, m.
    lost: stretches that cannot be used, each from and to, m from its begin.
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


class _Axis:
    """A line laid straight: how far along and beside it places are."""

    def __init__(self, points: Floats, line: PhotoLine) -> None:
        """Points: (w, 3) of the route."""
        self.corners = points[line.first : line.last + 1]
        step = self.corners[-1, :2] - self.corners[0, :2]
        self.length = float(np.hypot(*step))
        self.east, self.north = step / max(self.length, 1e-9)
        self.along, self._bends = self._laid(self.corners)

    def _laid(self, places: Floats) -> tuple[Floats, Floats]:
        off = places[:, :2] - self.corners[0, :2]
        return off[:, 0] * self.east + off[:, 1] * self.north, off[:, 0] * self.north - off[:, 1] * self.east

    def of(self, places: Floats) -> tuple[Floats, Floats]:
        """Distance along the line and to the right of it, m, of places (n, 2 or 3)."""
        along, across = self._laid(places)
        return along, across - np.interp(along, self.along, self._bends)

    def at(self, along: Floats) -> Floats:
        """Places (n, 3) m on the line, at these distances along it."""
        return np.stack([np.interp(along, self.along, self.corners[:, axis]) for axis in range(3)], axis=1)


def allowed_aside(requirements: RouteRequirements, survey: Survey) -> float:
    """How far beside its line a photo may be taken, m."""
    return PHOTO_ASIDE * survey.spacing + position_error(requirements.setup)


def measure_line(
    requirements: RouteRequirements, aligned: AlignedTrack, survey: Survey, line: PhotoLine
) -> LineMeasure | None:
    """Measure a photo line on a flown track; None where no row was flown between its neighbours."""
    axis = _Axis(requirements.points, line)
    window = _window(requirements, aligned, line)
    if window.stop - window.start < 2 or not aligned.passed[line.begins]:
        return None
    position = aligned.track.position[window]
    along, across = axis.of(position)
    course = math.atan2(axis.east, axis.north)
    turned = np.abs(np.angle(np.exp(1j * (aligned.course[window] - course))))
    ahead = turned <= PHOTO_COURSE
    limit = allowed_aside(requirements, survey)
    off, allowed = _heights_off(requirements, axis, position, along)
    needed = {
        "away": np.abs(across) <= limit,
        "banked": np.abs(aligned.track.attitude[window, ROLL]) <= PHOTO_BANK,
        "high": np.abs(off) <= allowed,
        "dark": _camera_on(requirements, line, position, along, ahead, axis.length),
    }
    good, state, lost = np.ones(0, dtype=np.bool_), ahead, {}
    for name, fulfilled in needed.items():
        state = state & fulfilled
        before = float(good.mean()) if good.size else 1.0
        good = _cells(along, state, axis.length)
        lost[name] = before - float(good.mean())
    found = np.flatnonzero(good)
    step = axis.length / len(good)
    over = ahead & (along >= 0.0) & (along <= axis.length)
    photos, missed = _photos(line, _cells(along, ahead & needed["away"] & needed["dark"], axis.length), axis.length)
    return LineMeasure(
        length=axis.length,
        good=float(good.mean()),
        **lost,
        late=float(found[0] * step) if found.size else axis.length,
        early=float((len(good) - 1 - found[-1]) * step) if found.size else axis.length,
        aside=float(np.abs(across[over]).max(initial=0.0)),
        off=float(max(off[over], key=abs, default=0.0)),
        photos=photos,
        missed=missed,
        allowed_aside=limit,
        allowed_off=float(allowed.min(initial=math.inf)),
        lost=_stretches(~good, step),
    )


def _stretches(cells: Flags, step: float) -> tuple[tuple[float, float], ...]:
    """Runs of cells that are set, each from and to, m."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], cells.astype(int), [0]]))) * step
    return tuple((float(low), float(high)) for low, high in zip(edges[::2], edges[1::2], strict=True))


def _window(requirements: RouteRequirements, aligned: AlignedTrack, line: PhotoLine) -> slice:
    """Rows from the waypoint before the line's straight run to the one behind it."""
    first, last = max(0, line.begins - 1), min(requirements.legs, line.ends + 1)
    return slice(int(aligned.rows[first]), int(aligned.rows[last]) + 1)


def _heights_off(
    requirements: RouteRequirements, axis: _Axis, position: Floats, along: Floats
) -> tuple[Floats, Floats]:
    """By how much each row is off the planned height over ground, m, and by how much it may be.

    Without terrain: off the planned height, with what is allowed of the height over home.
    """
    planned = axis.at(along)
    ground = requirements.setup.scenario.terrain
    if ground is None:
        home = requirements.setup.mission.home
        base = float(requirements.points[:, 2].min()) if home is None else home.alt
        return position[:, 2] - planned[:, 2], np.maximum(PHOTO_HEIGHT_LEAST, PHOTO_HEIGHT * (planned[:, 2] - base))
    asked = planned[:, 2] - ground.height(planned[:, 0], planned[:, 1])
    flown = position[:, 2] - ground.height(position[:, 0], position[:, 1])
    return flown - asked, np.maximum(PHOTO_HEIGHT_LEAST, PHOTO_HEIGHT * asked)


def _camera_on(
    requirements: RouteRequirements, line: PhotoLine, position: Floats, along: Floats, ahead: Flags, length: float
) -> Flags:
    """Whether the camera is on at each row: from where the line's first waypoint counts as reached to its last's.

    Of a mission that does not switch its camera there it always is.  ahead: whether each row flies along the line.
    """
    follows, rows = requirements.setup.autopilot.follows_path, np.arange(len(along))

    def reached(waypoint: int, from_along: float, after: int = 0) -> int:
        away = np.hypot(*(position[:, :2] - requirements.points[waypoint, :2]).T)
        # Who follows a path is at a waypoint where the path passes it.
        near = 0.0 if follows else reach(requirements, waypoint).radius
        there = np.flatnonzero(((away <= near) | (along >= from_along)) & ahead & (rows >= after))
        return int(there[0]) if there.size else len(along)

    begins = reached(line.first, 0.0) if line.switched_on else 0
    ends = reached(line.last, length, begins) if line.switched_off else len(along)
    return (rows >= begins) & (rows <= ends)


def _cells(along: Floats, state: Flags, length: float) -> Flags:
    """Which steps of a line lie between two rows in a state."""
    count = max(1, math.ceil(length / PHOTO_STEP))
    both = state[:-1] & state[1:] & (np.diff(along) > 0.0)
    edges = np.clip(along / length * count, 0.0, count)
    begin, end = np.floor(edges[:-1]).astype(int)[both], np.ceil(edges[1:]).astype(int)[both]
    marks = np.zeros(count + 1, dtype=np.int64)
    np.add.at(marks, begin, 1)
    np.add.at(marks, end, -1)
    return np.cumsum(marks[:-1]) > 0


def _photos(line: PhotoLine, taken: Flags, length: float) -> tuple[int, int]:
    """How many photos a line has, and how many of them fall on steps on which none is taken."""
    if line.photo <= 0.0:
        return 0, 0
    count = int(length / line.photo) + 1
    steps = np.minimum((np.arange(count) * line.photo / length * len(taken)).astype(int), len(taken) - 1)
    return count, int(np.count_nonzero(~taken[steps]))
