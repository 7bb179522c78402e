"""Surveys in a route: photo lines that lie side by side, and the turn-arounds between them.

Nobody marks them in a mission: QGroundControl's survey and Mission Planner's grid are waypoints, with items that switch
the camera between them.  So they are found by their form, whoever made them: three straight runs or more that are
parallel, lie beside each other, and follow each other with little between them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import Command, Mission, is_navigation
from flight.mission.route import Route
from world.geometry import leg_courses, leg_runs

Floats = NDArray[np.float64]

# Legs are one straight run while their courses stay within this of its first leg's, rad.
_STRAIGHT = math.radians(3.0)
# Runs are parallel, either way round, within this, rad.
_PARALLEL = math.radians(10.0)
# Neighbouring lines are at least this far apart, m, and lie beside each other over this share of the shorter one.
_APART = 1.0
_BESIDE = 0.5
# A turn-around has at most this many straight runs, and is at most this many times as long as the longer of its lines.
_RUNS_BETWEEN = 4
_LONGEST_BETWEEN = 2.0
# A straight run with a lead at either end has so many legs or more; leads are equally long to within this, m.
_LEGS_WITH_LEADS = 3
_SAME_LEAD = 1.0
# Fewer lines than these make no survey, by their places to the side: there and back is none.
_FEWEST = 3


class PhotoLine(NamedTuple):
    """A line along which photos are taken.

    first, last: its first and last waypoint; legs first to last - 1 are its own.
    begins, ends: those of the straight run that it is part of, which may go on beyond it.
    photo: m of way between photos, 0 where no item states it.
    switched_on, switched_off: whether its first waypoint switches the camera on, and its last one switches it off.
    """

    first: int
    last: int
    begins: int
    ends: int
    photo: float = 0.0
    switched_on: bool = False
    switched_off: bool = False


@dataclass(frozen=True, slots=True)
class Survey:
    """Parallel photo lines, in flying order.

    lines: three or more.
    course: of the first, rad.
    offsets: of each to the right of the first, m.
    spacing: between neighbours, m: the median gap between lines that lie beside each other.
    """

    lines: tuple[PhotoLine, ...]
    course: float
    offsets: tuple[float, ...]
    spacing: float

    @property
    def first(self) -> int:
        """The waypoint at which it begins."""
        return self.lines[0].first

    @property
    def last(self) -> int:
        """The waypoint at which it ends."""
        return self.lines[-1].last

    def takes_photos(self) -> bool:
        """Whether items of the mission switch the camera on its lines."""
        return any(line.switched_on or line.switched_off or line.photo > 0.0 for line in self.lines)

    def turn_arounds(self) -> list[tuple[int, int]]:
        """Waypoints at which each turn-around begins and ends: the end of a line, and the begin of the next."""
        return [(one.last, other.first) for one, other in zip(self.lines[:-1], self.lines[1:], strict=True)]


def camera_spacing(mission: Mission, route: Route) -> Floats:
    """Way between photos (w,) on the leg that begins at each waypoint, m: 0 without the camera, NaN where not stated.

    The camera is switched by the items that stand behind a waypoint's, as soon as that is reached.  The legs to a
    waypoint that several items lead to by jumps are those of its item.
    """
    flown = set(route.items.tolist())
    switched, on, here = dict[int, float](), 0.0, None
    for item in mission.items:
        if is_navigation(item.command):
            # What is flown at no place of its own belongs to the place before.
            here = item.seq if item.seq in flown else here
        elif item.command == Command.DO_SET_CAM_TRIGG_DIST:
            on = max(0.0, item.params[0]) if math.isfinite(item.params[0]) else 0.0
        elif item.command in (Command.IMAGE_START_CAPTURE, Command.VIDEO_START_CAPTURE):
            on = math.nan
        elif item.command in (Command.IMAGE_STOP_CAPTURE, Command.VIDEO_STOP_CAPTURE):
            on = 0.0
        if here is not None:
            switched[here] = on
    out, held = np.zeros(len(route.items)), 0.0
    for i, seq in enumerate(route.items.tolist()):
        held = switched.get(seq, held)
        out[i] = held
    return out


def find_surveys(route: Route, camera: Floats) -> tuple[Survey, ...]:
    """The surveys of a route, in flying order.

    camera: (w,) of `camera_spacing`.

    >>> lines = [[0, 0], [0, 900], [60, 900], [60, 0], [120, 0], [120, 900]]
    >>> points = np.array([[*place, 100.0] for place in lines], dtype=float)
    >>> flown_through = np.zeros(6, dtype=bool)
    >>> route = Route(points, np.full(5, 15.0), np.zeros(6), flown_through, np.arange(1, 7), "")
    >>> [survey] = find_surveys(route, np.zeros(6))
    >>> [(line.first, line.last) for line in survey.lines], survey.offsets, survey.spacing
    ([(0, 1), (2, 3), (4, 5)], (0.0, 60.0, 120.0), 60.0)
    """
    runs, surveys, at = _straight_runs(route), [], 0
    if camera.any():
        # Where items switch the camera, a line is where it is on.
        runs = [(first, last) for first, last in runs if (camera[first:last] != 0.0).any()]
    while at < len(runs):
        chain = _chain(route.waypoints, runs, at)
        survey = _survey(route.waypoints, [runs[k] for k in chain], camera) if len(chain) >= _FEWEST else None
        if survey is None:
            at += 1
            continue
        surveys.append(survey)
        at = chain[-1] + 1
    return tuple(surveys)


def _straight_runs(route: Route) -> list[tuple[int, int]]:
    """First and last waypoint of each straight run; a circle's corners, take-off, landing and a return are none."""
    courses, arcs, end = leg_courses(route.waypoints), route.arcs, len(route.waypoints) - 1
    last = route.return_from if route.return_from >= 0 else end
    lands, takes_off = math.isfinite(route.landing_ground), math.isfinite(route.takeoff_ground)
    runs, first = [], 0
    for k in range(1, last + 1):
        turned = abs(math.remainder(float(courses[min(k, end - 1)] - courses[first]), 2.0 * math.pi))
        if k < last and turned <= _STRAIGHT and arcs[k] == 0.0:
            continue
        on_ground = (takes_off and first == 0) or (lands and k == end)
        if not on_ground and (arcs[first] == 0.0 or arcs[k] == 0.0):
            runs.append((first, k))
        first = k
    return runs


def _chain(points: Floats, runs: Sequence[tuple[int, int]], start: int) -> list[int]:
    """Runs that follow each other as lines of a survey, from this one on."""
    chain, sofar = [start], np.concatenate([[0.0], np.cumsum(leg_runs(points))])
    while True:
        here = chain[-1]
        for after in range(here + 1, min(len(runs), here + 2 + _RUNS_BETWEEN)):
            between = float(sofar[runs[after][0]] - sofar[runs[here][1]])
            longer = max(float(sofar[runs[k][1]] - sofar[runs[k][0]]) for k in (here, after))
            if between <= _LONGEST_BETWEEN * longer and _beside(points, runs[here], runs[after]):
                chain.append(after)
                break
        else:
            return chain


def _beside(points: Floats, one: tuple[int, int], other: tuple[int, int]) -> bool:
    """Whether two runs are parallel and lie beside each other, and not in one line."""
    start, course, length = _line(points, one)
    along, across = _laid_beside(points[[other[0], other[1]], :2] - start, course)
    run = float(np.hypot(*(points[other[1], :2] - points[other[0], :2])))
    shorter = min(length, run)
    if shorter <= 0.0 or abs(along[1] - along[0]) < math.cos(_PARALLEL) * run:
        return False
    shared = min(length, float(along.max())) - max(0.0, float(along.min()))
    return shared >= _BESIDE * shorter and abs(float(across.mean())) >= _APART


def _survey(points: Floats, runs: Sequence[tuple[int, int]], camera: Floats) -> Survey | None:
    """The survey of some lines; None where too few of them are at places of their own."""
    start, course, _ = _line(points, runs[0])
    middles = np.array([0.5 * (points[first, :2] + points[last, :2]) for first, last in runs]) - start
    offsets = _laid_beside(middles, course)[1]
    places = np.sort(offsets)
    gaps = np.diff(places)
    apart = gaps[gaps >= _APART]
    if len(apart) + 1 < _FEWEST:
        return None
    lines = tuple(_photo_line(run, camera) for run in runs)
    if all((line.first, line.last) == (line.begins, line.ends) for line in lines):
        lines = _without_leads(points, lines)
    return Survey(lines, course, tuple((offsets - offsets[0]).tolist()), float(np.median(apart)))


def _photo_line(run: tuple[int, int], camera: Floats) -> PhotoLine:
    """The part of a straight run on which the camera is on; all of it where it never is."""
    first, last = run
    on = np.flatnonzero(camera[first:last] != 0.0)
    if not on.size:
        return PhotoLine(first, last, *run)
    first, last = run[0] + int(on[0]), run[0] + int(on[-1]) + 1
    was_off = first == 0 or camera[first - 1] == 0.0
    return PhotoLine(first, last, *run, float(np.nan_to_num(camera[first])), was_off, bool(camera[last] == 0.0))


def _without_leads(points: Floats, lines: tuple[PhotoLine, ...]) -> tuple[PhotoLine, ...]:
    """The lines without the legs that lead into them and out of them, where the camera does not tell them apart.

    They are leads where those of all lines are equally long: a turn-around has one length.
    """
    lengths = leg_runs(points)
    if any(line.last - line.first < _LEGS_WITH_LEADS for line in lines):
        return lines
    # Waypoints at equal distances along a line are no leads.
    if all(abs(float(lengths[line.first] - lengths[line.first + 1])) <= _SAME_LEAD for line in lines):
        return lines
    for end in ([line.first for line in lines], [line.last - 1 for line in lines]):
        leads = lengths[end]
        if float(np.ptp(leads)) > _SAME_LEAD:
            return lines
    return tuple(line._replace(first=line.first + 1, last=line.last - 1) for line in lines)


def _line(points: Floats, run: tuple[int, int]) -> tuple[Floats, float, float]:
    """Where a run begins (2,), its course from end to end, rad, and its length, m."""
    start, end = points[run[0], :2], points[run[1], :2]
    step = end - start
    return start, math.atan2(step[0], step[1]), float(np.hypot(*step))


def _laid_beside(off: Floats, course: float) -> tuple[Floats, Floats]:
    """Distances along a course and to the right of it, m, of places (n, 2)."""
    east, north = math.sin(course), math.cos(course)
    return off[:, 0] * east + off[:, 1] * north, off[:, 0] * north - off[:, 1] * east
