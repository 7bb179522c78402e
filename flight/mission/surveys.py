"""Surveys in a route: photo lines that lie side by side, and the turn-arounds between them.

Nobody marks them in a mission: QGroundControl's survey and Mission Planner's grid are waypoints, with items that switch
the camera between them.  So they are found by their form, whoever made them: three runs or more that lie beside each
other at one distance, and follow each other with little between them.  A run is straight, or bends as its neighbours
do, as those of QGroundControl's corridor scan.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import Command, Mission, SurveyPlan, is_navigation
from flight.mission.route import Route
from world.geometry import leg_courses, leg_runs

Floats = NDArray[np.float64]

# Legs are one straight run while their courses stay within this of its first leg's, rad.
_STRAIGHT = math.radians(3.0)
# Runs are parallel, either way round, within this, rad, and while the distance between them changes by no more than
# this share of it: the link between two lines, and spokes of one hub, touch.
_PARALLEL = math.radians(10.0)
_EVEN = 0.5
# Neighbouring lines are at least this far apart, m, and lie beside each other over this share of the shorter one.
_APART = 1.0
_BESIDE = 0.5
# A line has at least this length, m.
_SHORTEST = 10.0
# A turn-around has at most this many straight runs.  It is at most this many times as long as the longer of its lines,
# or has at most this length, m: lines at the tip of a field are short.
_RUNS_BETWEEN = 12
_LONGEST_BETWEEN, _SHORT_BETWEEN = 2.0, 250.0
# A run beside another is no line where one behind it is nearer than this share of its distance and it is shorter than
# this share of that one.
_NEARER, _STUB = 0.5, 0.2
# A line that is shorter than this share of both lines of another survey, between which it lies, is a turn-around there.
_STUB_TURN = 0.5
# Where lines bend, the runs beside each other are that, and their distance as that of the runs before, within this
# factor.
_ALIKE = 2.0
# A straight run with a lead at either end has so many legs or more; leads are equally long to within this, m.
_LEGS_WITH_LEADS = 3
_SAME_LEAD = 1.0
# Fewer lines than these make no survey, by their places to the side: there and back is none, but with the camera on.
_FEWEST, _FEWEST_WITH_PHOTOS = 3, 2
# A gap below this share of both its neighbours is none: a line that is flown twice.
_TWICE = 0.2
# m.  Items state the way between photos to this; ground stations write it in single precision.
_SAME_PHOTO = 0.01


class PhotoLine(NamedTuple):
    """A line along which photos are taken.

    first, last: its first and last waypoint; legs first to last - 1 are its own.
    begins, ends: those of the run that it is part of, which may go on beyond it.
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
    """Photo lines beside each other, in flying order.

    lines: three or more; two where photos are taken along them.
    course: of the first leg of the first, rad.
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

    def line(self, number: int) -> PhotoLine:
        """One of its lines, in flying order."""
        return self.lines[number]

    def has_leg(self, leg: int) -> bool:
        """Whether a leg belongs to it, its ways onto the first line and off the last included."""
        return self.lines[0].begins - 1 <= leg <= self.lines[-1].ends

    def takes_photos(self) -> bool:
        """Whether items of the mission switch the camera on its lines."""
        return any(line.switched_on or line.switched_off or line.photo > 0.0 for line in self.lines)

    def turn_arounds(self) -> list[tuple[int, int]]:
        """Waypoints at which each turn-around begins and ends: the end of a line, and the begin of the next."""
        return [(one.last, other.first) for one, other in zip(self.lines[:-1], self.lines[1:], strict=True)]

    def ways_onto_lines(self) -> list[tuple[int, int]]:
        """Its turn-arounds, and what is as much the autopilot's own: the way onto the first line and off the last."""
        into, out = self.lines[0], self.lines[-1]
        return [(into.begins, into.first), *self.turn_arounds(), (out.last, out.ends)]


class LineAxis:
    """A line laid out: how far along and beside it places are.  Beyond its ends it goes on straight."""

    def __init__(self, corners: Floats) -> None:
        """Corners: (k, 2 or 3) m, two or more."""
        self.corners = corners
        step = np.diff(corners[:, :2], axis=0)
        self._runs = np.hypot(*step.T)
        self._units = step / np.maximum(self._runs, 1e-9)[:, None]
        self.along = np.concatenate([[0.0], np.cumsum(self._runs)])
        self.length = float(self.along[-1])

    def of(self, places: Floats) -> tuple[Floats, Floats, Floats]:
        """Distance along the line, distance to its right, m, and its course there, rad, of places (n, 2 or 3)."""
        nearest = np.full(len(places), np.inf)
        out = np.zeros((3, len(places)))
        for k, (unit, run) in enumerate(zip(self._units, self._runs, strict=True)):
            along, across = _laid_beside(places[:, :2] - self.corners[k, :2], math.atan2(unit[0], unit[1]))
            low = -math.inf if k == 0 else 0.0
            high = math.inf if k == len(self._runs) - 1 else run
            away = np.hypot(along - np.clip(along, low, high), across)
            here = away < nearest
            nearest[here] = away[here]
            out[0, here], out[1, here] = self.along[k] + along[here], across[here]
            out[2, here] = math.atan2(unit[0], unit[1])
        return out[0], out[1], out[2]

    def at(self, along: Floats) -> Floats:
        """Places (n, 2 or 3) m on the line, at these distances along it."""
        columns = [np.interp(along, self.along, self.corners[:, axis]) for axis in range(self.corners.shape[1])]
        return np.stack(columns, axis=1)


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


def survey_plan(mission: Mission, survey: Survey) -> SurveyPlan | None:
    """What the mission's author kept of a survey, which is known by the way between its photos; None for nothing.

    Where several of one way between photos differ, nobody knows whose it is.
    """
    photo = survey.lines[0].photo
    same = {one for one in mission.survey_plans if one.photo is not None and abs(one.photo - photo) <= _SAME_PHOTO}
    if len(same) == 1:
        return same.pop()
    return next((one for one in mission.survey_plans if one.photo is None), None)


def find_surveys(route: Route, camera: Floats, turn_arounds: Sequence[tuple[float, float]] = ()) -> tuple[Survey, ...]:
    """The surveys of a route, in flying order.

    camera: (w,) of `camera_spacing`.
    turn_arounds: what a ground station says: by way between photos, m, how far lines go on beyond their photos, m.

    >>> lines = [[0, 0], [0, 900], [60, 900], [60, 0], [120, 0], [120, 900]]
    >>> points = np.array([[*place, 100.0] for place in lines], dtype=float)
    >>> flown_through = np.zeros(6, dtype=bool)
    >>> route = Route(points, np.full(5, 15.0), np.zeros(6), flown_through, np.arange(1, 7), "")
    >>> [survey] = find_surveys(route, np.zeros(6))
    >>> [(line.first, line.last) for line in survey.lines], survey.offsets, survey.spacing
    ([(0, 1), (2, 3), (4, 5)], (0.0, 60.0, 120.0), 60.0)
    """
    found, surveys, at = _straight_runs(route), list[Survey](), 0
    if camera.any():
        # Where items switch the camera, a line is where it is on.
        found = [(first, last) for first, last in found if (camera[first:last] != 0.0).any()]
    runs = _Runs(route.waypoints, found)
    while at < len(found):
        chain = _chain(runs, at)
        survey = _survey(runs, chain, camera, turn_arounds)
        if survey is None:
            at += 1
            continue
        surveys.append(survey)
        at = chain[-1][1] + 1
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


# ----------------------------------------------------------------------
# Which runs are lines of one survey.  A line is one straight run, or several that follow each other.


# First and last run of a line.
_Line = tuple[int, int]


class _Runs:
    """The straight runs of a route, in flying order, by their numbers.

    What is asked of two of them is kept: each is asked again from wherever a survey may begin, and a mission whose
    items are flown a hundred times has as many places for that.
    """

    def __init__(self, points: Floats, runs: Sequence[tuple[int, int]]) -> None:
        """Points: (w, 3) m.  Runs: their first and last waypoints."""
        self.points, self.runs = points, runs
        self._sofar = np.concatenate([[0.0], np.cumsum(leg_runs(points))]).tolist()
        self._aparts = dict[tuple[int, int], float | None]()
        self._following = dict[int, list[int]]()
        self._middles = dict[_Line, Floats]()

    def ends(self, line: _Line) -> tuple[int, int]:
        """First and last waypoint of a line."""
        return self.runs[line[0]][0], self.runs[line[1]][1]

    def length(self, line: _Line) -> float:
        """Way along a line, m."""
        first, last = self.ends(line)
        return float(self._sofar[last] - self._sofar[first])

    def middle(self, line: _Line) -> Floats:
        """The place (2 or 3,) m half way along a line."""
        if line not in self._middles:
            first, last = self.ends(line)
            axis = LineAxis(self.points[first : last + 1])
            self._middles[line] = axis.at(np.array([0.5 * axis.length]))[0]
        return self._middles[line]

    def touch(self, run: int) -> bool:
        """Whether a run begins where the one before it ends."""
        return self.runs[run - 1][1] == self.runs[run][0]

    def apart(self, one: int, other: int) -> float | None:
        """How far two runs are apart, m; None where they do not lie beside each other."""
        if (one, other) not in self._aparts:
            self._aparts[one, other] = _apart(self.points, self.runs[one], self.runs[other])
        return self._aparts[one, other]

    def following(self, here: int) -> list[int]:
        """Runs that may be, or begin, the line after one, in flying order."""
        if here not in self._following:
            self._following[here] = self._find_following(here)
        return self._following[here]

    def _find_following(self, here: int) -> list[int]:
        found, own = list[tuple[int, float, float]](), self.length((here, here))
        for after in range(here + 1, min(len(self.runs), here + 2 + _RUNS_BETWEEN)):
            between = self._sofar[self.runs[after][0]] - self._sofar[self.runs[here][1]]
            length = self.length((after, after))
            apart = self.apart(here, after)
            if apart is None or between > max(_LONGEST_BETWEEN * max(own, length), _SHORT_BETWEEN):
                continue
            found.append((after, apart, length))
        # A leg of a turn-around may lie beside lines, too: far beside them, and short.
        return [
            after
            for after, apart, length in found
            if not any(k > after and near < _NEARER * apart and length < _STUB * long for k, near, long in found)
        ]


def _chain(runs: _Runs, start: int) -> list[_Line]:
    """The lines of a survey that begins with a run, or a little before or behind it."""
    chain = _follow(runs, start)
    if len(chain) > 1:
        # The way to a first line may lie beside the second.
        others = (_follow(runs, other) for other in range(start, chain[1][0]))
        chain = max(others, key=lambda one: (len(one), sum(map(runs.length, one))))
    while len(chain) > _FEWEST_WITH_PHOTOS:
        # The last may be a turn-around of the next survey, whose lines lie across.
        (_, before), last = chain[-2:]
        if not any(_turns(_follow(runs, other), last, runs) for other in range(before + 1, last[0])):
            break
        chain.pop()
    return chain


def _turns(chain: Sequence[_Line], line: _Line, runs: _Runs) -> bool:
    """Whether a line is but a turn-around between two longer ones of a survey."""
    between = [pair for pair in pairwise(chain) if pair[0][1] < line[0] and line[1] < pair[1][0]]
    own = runs.length(line)
    return len(chain) >= _FEWEST and any(own < _STUB_TURN * min(map(runs.length, pair)) for pair in between)


def _follow(runs: _Runs, start: int) -> list[_Line]:
    """The lines that follow each other from a run on, the first of which may begin before it."""
    chain = [(start, start)]
    while True:
        first, here = chain[-1]
        for after in runs.following(here):
            bends = 0
            while (len(chain) == 1 or here - bends > first) and _go_on(runs, here, after, bends + 1):
                bends += 1
            if len(chain) == 1:
                chain = [(here - bends, here)]
            elif bends < here - first:
                continue
            chain.append((after, after + bends))
            break
        else:
            return chain


def _go_on(runs: _Runs, here: int, after: int, bends: int) -> bool:
    """Whether two lines that turn around between two runs go on beside each other, so many bends away from there."""
    one, other = here - bends, after + bends
    if one < 0 or other >= len(runs.runs) or not (runs.touch(one + 1) and runs.touch(other)):
        return False
    wide, own = runs.apart(here, after), runs.apart(one, other)
    lengths = [_line(runs.points, runs.runs[k])[2] for k in (one, other)]
    return (
        wide is not None
        and own is not None
        and max(wide, own) <= _ALIKE * min(wide, own)
        and max(lengths) <= _ALIKE * min(lengths)
    )


def _apart(points: Floats, one: tuple[int, int], other: tuple[int, int]) -> float | None:
    """How far two runs are apart, m; None where they do not lie beside each other."""
    start, course, length = _line(points, one)
    along, across = _laid_beside(points[[other[0], other[1]], :2] - start, course)
    run = float(np.hypot(*(points[other[1], :2] - points[other[0], :2])))
    shorter, apart = min(length, run), abs(float(across.mean()))
    if shorter < _SHORTEST or abs(along[1] - along[0]) < math.cos(_PARALLEL) * run:
        return None
    shared = min(length, float(along.max())) - max(0.0, float(along.min()))
    if shared < _BESIDE * shorter or apart < _APART or abs(float(across[1] - across[0])) > _EVEN * apart:
        return None
    return apart


# ----------------------------------------------------------------------
# A survey of its lines.


def _survey(
    runs: _Runs, chain: Sequence[_Line], camera: Floats, turn_arounds: Sequence[tuple[float, float]]
) -> Survey | None:
    """The survey of some lines; None where too few of them are at places of their own."""
    points, (begins, ends) = runs.points, runs.ends(chain[0])
    offsets = LineAxis(points[begins : ends + 1]).of(np.array([runs.middle(line) for line in chain]))[1]
    gaps = _gaps(np.sort(offsets))
    if len(gaps) + 1 < (_FEWEST_WITH_PHOTOS if camera.any() else _FEWEST):
        return None
    lines = tuple(_photo_line(runs.ends(line), camera) for line in chain)
    if len(gaps) + 1 < _FEWEST and not all(line.photo > 0.0 for line in lines):
        return None
    # A camera that is off between lines tells where they begin.
    on = any((camera[line.first : line.last] != 0.0).any() for line in lines)
    between = pairwise(lines)
    if not on or all((camera[one.last : other.first] != 0.0).all() for one, other in between):
        lines = _without_leads(points, lines, turn_arounds)
    course = _line(points, (begins, begins + 1))[1]
    return Survey(lines, course, tuple((offsets - offsets[0]).tolist()), float(np.median(gaps)))


def _gaps(places: Floats) -> list[float]:
    """Distances between lines at these places (n,) m, in rising order, but for lines that are flown twice."""
    gaps = [float(gap) for gap in np.diff(places) if gap >= _APART]
    beside = [[gaps[k] for k in (i - 1, i + 1) if 0 <= k < len(gaps)] for i in range(len(gaps))]
    return [gap for gap, near in zip(gaps, beside, strict=True) if not near or gap > _TWICE * min(near)]


def _photo_line(run: tuple[int, int], camera: Floats) -> PhotoLine:
    """The part of a run on which the camera is on; all of it where it never is."""
    first, last = run
    on = np.flatnonzero(camera[first:last] != 0.0)
    if not on.size:
        return PhotoLine(first, last, *run)
    first, last = run[0] + int(on[0]), run[0] + int(on[-1]) + 1
    was_off = first == 0 or camera[first - 1] == 0.0
    return PhotoLine(first, last, *run, float(np.nan_to_num(camera[first])), was_off, bool(camera[last] == 0.0))


def _without_leads(
    points: Floats, lines: tuple[PhotoLine, ...], turn_arounds: Sequence[tuple[float, float]]
) -> tuple[PhotoLine, ...]:
    """The lines without the legs that lead into them and out of them, where the camera does not tell them apart.

    They are as long as the ground station says, or else leads where those of all lines are equally long: a turn-around
    has one length.
    """
    for photo, lead in turn_arounds:
        if abs(photo - lines[0].photo) <= _SAME_PHOTO and lead > 0.0:
            shorter = tuple(_without_lead(points, line, lead) for line in lines)
            # A mission may have been changed since.
            if shorter != lines:
                return shorter
    lengths = leg_runs(points)
    if any(line.ends - line.begins < _LEGS_WITH_LEADS for line in lines):
        return lines
    # Waypoints at equal distances along a line are no leads.
    if all(line.last - line.first > 1 and np.ptp(lengths[line.first :][:2]) <= _SAME_LEAD for line in lines):
        return lines
    into, *_, out = lines
    leads = [lengths[line.first] for line in lines[1:]] + [lengths[line.last - 1] for line in lines[:-1]]
    if float(np.ptp(leads)) > _SAME_LEAD:
        return lines
    # The way onto the first line and off the last may be longer, so that a lead like the others is looked for; or the
    # camera tells, which goes on with the first line's photos and off with the last's.
    alike = np.abs(lengths - np.median(leads)) <= _SAME_LEAD
    begins = np.flatnonzero(alike[into.first : into.last - 1]) + into.first + 1
    ends = np.flatnonzero(alike[out.first + 1 : out.last]) + out.first + 1
    first = [into.first] if into.first > into.begins else begins.tolist()
    last = [out.last] if out.last < out.ends else ends.tolist()
    if not (first and last):
        return lines
    inner = [line._replace(first=line.first + 1, last=line.last - 1) for line in lines]
    inner[0] = inner[0]._replace(first=first[0])
    inner[-1] = inner[-1]._replace(last=last[-1])
    return tuple(inner)


def _without_lead(points: Floats, line: PhotoLine, lead: float) -> PhotoLine:
    """A line between the waypoints that are so far (m) from the ends of its run; an end without one stays."""
    inner = range(line.first + 1, line.last)
    near = max(_SAME_LEAD, 0.01 * lead)

    def from_end(end: int) -> list[int]:
        return [i for i in inner if abs(math.dist(points[i, :2], points[end, :2]) - lead) <= near]

    into, out = from_end(line.begins), from_end(line.ends)
    first = into[0] if into and line.first == line.begins else line.first
    last = out[-1] if out and line.last == line.ends else line.last
    return line._replace(first=first, last=last) if first < last else line


def _line(points: Floats, run: tuple[int, int]) -> tuple[Floats, float, float]:
    """Where a run begins (2,), its course from end to end, rad, and its length, m."""
    start, end = points[run[0], :2], points[run[1], :2]
    step = end - start
    return start, math.atan2(step[0], step[1]), float(np.hypot(*step))


def _laid_beside(off: Floats, course: float) -> tuple[Floats, Floats]:
    """Distances along a course and to the right of it, m, of places (n, 2)."""
    east, north = math.sin(course), math.cos(course)
    return off[:, 0] * east + off[:, 1] * north, off[:, 0] * north - off[:, 1] * east
