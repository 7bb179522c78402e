"""Find surveys in a route, which consist of parallel photo lines and the turn-arounds between them.

No mission item marks a survey: QGroundControl's survey and Mission Planner's grid are waypoints, with items that switch
the camera between them. Surveys are therefore found by their geometry, whichever program wrote them: three or more
parallel runs at equal spacing that follow each other with short links. A run is straight, or bends as its neighbors do,
as the runs of QGroundControl's corridor scan.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flight.mission.items import Command, Mission, SurveyPlan, is_navigation
from flight.mission.route import Route
from world.arrays import Floats
from world.geometry import leg_courses, leg_runs

# Largest course difference between a leg and the first leg of its straight run, rad.
_MAX_RUN_BEND_RAD = math.radians(3.0)
# Runs are parallel if their courses agree within this angle in either direction, rad.
_PARALLEL_TOLERANCE_RAD = math.radians(10.0)
# Largest change of the spacing along two parallel runs, as a ratio to the spacing: it excludes the link between two
# lines and the spokes of a hub, which touch.
_MAX_SPACING_CHANGE_RATIO = 0.5
# Smallest distance between neighboring lines, m.
_MIN_LINE_SPACING_M = 1.0
# Smallest overlap of neighboring lines, as a fraction of the shorter line.
_MIN_OVERLAP_FRACTION = 0.5
# Smallest length of a line, m.
_MIN_LINE_LENGTH_M = 10.0
# Largest number of straight runs in a turn-around.
_MAX_TURN_AROUND_RUNS = 12
# Largest length of a turn-around, as a ratio to the longer of its two lines.
_MAX_TURN_AROUND_RATIO = 2.0
# A turn-around up to this length is accepted in any case, m: lines at the tip of a field are short.
_SHORT_TURN_AROUND_M = 250.0
# A parallel run is not a line if both conditions hold: a later run is nearer than this ratio of its distance,
_NEARER_LINE_RATIO = 0.5
# and it is shorter than this ratio of that later run.
_STUB_LENGTH_RATIO = 0.2
# A line between two lines of another survey, shorter than this ratio of both, is a turn-around of that survey.
_TURN_AROUND_LENGTH_RATIO = 0.5
# Largest ratio between the spacings, and between the lengths, of successive run pairs of lines that bend.
_SPACING_RATIO_LIMIT = 2.0
# Smallest number of legs in a straight run that has a lead at either end.
_MIN_LEGS_WITH_LEADS = 3
# Tolerance for equal leads, m.
_LEAD_LENGTH_TOLERANCE_M = 1.0
# Smallest number of lines with different lateral positions in a survey: there and back is not a survey.
_MIN_LINES = 3
# The same number for lines with the camera on.
_MIN_LINES_WITH_PHOTOS = 2
# A gap smaller than this fraction of both its neighbors is no gap, but one line flown twice.
_DUPLICATE_LINE_FRACTION = 0.2
# Tolerance for equal distances between photos, m: ground stations write this distance in single precision.
_PHOTO_SPACING_TOLERANCE_M = 0.01


class PhotoLine(NamedTuple):
    """A line along which photos are taken.

    first, last: index of its first and last waypoint; its own legs are first to last - 1.
    begins, ends: index of the first and last waypoint of the run it is part of, which may extend beyond the line.
    photo: distance between photos, m; 0 if no item states it.
    switched_on, switched_off: True if its first waypoint switches the camera on, and its last one switches it off.
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
    """Parallel photo lines in flying order.

    lines: three or more; two if photos are taken along them.
    course: course of the first leg of the first line, rad.
    offsets: offset of each line to the right of the first line, m.
    spacing: median gap between neighboring lines, m.
    """

    lines: tuple[PhotoLine, ...]
    course: float
    offsets: tuple[float, ...]
    spacing: float

    @property
    def first(self) -> int:
        """Index of the waypoint at which the survey begins."""
        return self.lines[0].first

    @property
    def last(self) -> int:
        """Index of the waypoint at which the survey ends."""
        return self.lines[-1].last

    def line(self, number: int) -> PhotoLine:
        """Return the line with this number in flying order."""
        return self.lines[number]

    def has_leg(self, leg: int) -> bool:
        """Return True if a leg belongs to the survey.

        The entry to the first line and the exit of the last line are included.
        """
        return self.lines[0].begins - 1 <= leg <= self.lines[-1].ends

    def takes_photos(self) -> bool:
        """Return True if items of the mission switch the camera on its lines."""
        return any(line.switched_on or line.switched_off or line.photo > 0.0 for line in self.lines)

    def turn_arounds(self) -> list[tuple[int, int]]:
        """Return the waypoints at which each turn-around begins and ends."""
        return [(one.last, other.first) for one, other in zip(self.lines[:-1], self.lines[1:], strict=True)]

    def ways_onto_lines(self) -> list[tuple[int, int]]:
        """Return the turn-arounds, the entry to the first line and the exit of the last line.

        Each is a pair of waypoints, between which the autopilot chooses the path.
        """
        into, out = self.lines[0], self.lines[-1]
        return [(into.begins, into.first), *self.turn_arounds(), (out.last, out.ends)]


class LineAxis:
    """Along-track and cross-track coordinates of a line, which is extended straight beyond both ends."""

    def __init__(self, corners: Floats) -> None:
        """Set up the axis of a line through corners (k, 2 or 3) m, k at least 2."""
        self.corners = corners
        step = np.diff(corners[:, :2], axis=0)
        self._runs = np.hypot(*step.T)
        self._units = step / np.maximum(self._runs, 1e-9)[:, None]
        self.along = np.concatenate([[0.0], np.cumsum(self._runs)])
        self.length = float(self.along[-1])

    def of(self, places: Floats) -> tuple[Floats, Floats, Floats]:
        """Project points (n, 2 or 3) on the line.

        Return their distances along the line and to its right, m, and the line's course there, rad.
        """
        nearest = np.full(len(places), np.inf)
        out = np.zeros((3, len(places)))
        for k, (unit, run) in enumerate(zip(self._units, self._runs, strict=True)):
            along, across = _along_and_right(places[:, :2] - self.corners[k, :2], math.atan2(unit[0], unit[1]))
            low = -math.inf if k == 0 else 0.0
            high = math.inf if k == len(self._runs) - 1 else run
            away = np.hypot(along - np.clip(along, low, high), across)
            here = away < nearest
            nearest[here] = away[here]
            out[0, here], out[1, here] = self.along[k] + along[here], across[here]
            out[2, here] = math.atan2(unit[0], unit[1])
        return out[0], out[1], out[2]

    def at(self, along: Floats) -> Floats:
        """Return the points (n, 2 or 3) m on the line at given distances along it."""
        columns = [np.interp(along, self.along, self.corners[:, axis]) for axis in range(self.corners.shape[1])]
        return np.stack(columns, axis=1)


def camera_spacing(mission: Mission, route: Route) -> Floats:
    """Return the distance between photos on the leg that begins at each waypoint, (w,) m.

    It is 0 with the camera off, and NaN if the camera is on without a stated distance. Items after a waypoint's item
    switch the camera as soon as the waypoint is reached. If several items lead to a waypoint by jumps, the legs to it
    are assigned to the waypoint's own item.
    """
    flown = set(route.items.tolist())
    switched, on, here = dict[int, float](), 0.0, None
    for item in mission.items:
        if is_navigation(item.command):
            # An item that is flown without a place of its own belongs to the place before it.
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
    """Return the survey settings that the mission's author stored for a survey, or None if there are none.

    They are identified by the distance between photos. If no stored survey, or more than one, has that distance, the
    settings for any survey are returned.
    """
    photo = survey.lines[0].photo
    same = {
        one
        for one in mission.survey_plans
        if one.photo is not None and abs(one.photo - photo) <= _PHOTO_SPACING_TOLERANCE_M
    }
    if len(same) == 1:
        return same.pop()
    return next((one for one in mission.survey_plans if one.photo is None), None)


def find_surveys(route: Route, camera: Floats, turn_arounds: Sequence[tuple[float, float]] = ()) -> tuple[Survey, ...]:
    """Find the surveys of a route, in flying order.

    camera: (w,) from `camera_spacing`.
    turn_arounds: what a ground station states: pairs of the distance between photos, m, and how far lines extend beyond
        their photos, m.

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
        # If items switch the camera, only a run with the camera on can be a line.
        found = [(first, last) for first, last in found if (camera[first:last] != 0.0).any()]
    runs = _Runs(route.waypoints, found)
    while at < len(found):
        chain = _find_chain(runs, at)
        survey = _make_survey(runs, chain, camera, turn_arounds)
        if survey is None:
            at += 1
            continue
        surveys.append(survey)
        at = chain[-1][1] + 1
    return tuple(surveys)


def _straight_runs(route: Route) -> list[tuple[int, int]]:
    """Return the first and last waypoint of each straight run.

    Corners of a loiter, take-off, landing and return to launch are not runs.
    """
    courses, arcs, end = leg_courses(route.waypoints), route.arcs, len(route.waypoints) - 1
    last = route.return_from if route.return_from >= 0 else end
    lands, takes_off = math.isfinite(route.landing_ground), math.isfinite(route.takeoff_ground)
    runs, first = [], 0
    for k in range(1, last + 1):
        turned = abs(math.remainder(float(courses[min(k, end - 1)] - courses[first]), 2.0 * math.pi))
        if k < last and turned <= _MAX_RUN_BEND_RAD and arcs[k] == 0.0:
            continue
        on_ground = (takes_off and first == 0) or (lands and k == end)
        if not on_ground and (arcs[first] == 0.0 or arcs[k] == 0.0):
            runs.append((first, k))
        first = k
    return runs


# ----------------------------------------------------------------------
# Assign runs to the lines of one survey. A line is one straight run, or several successive runs.


# Index of the first and last run of a line.
_Line = tuple[int, int]


class _Runs:
    """Straight runs of a route in flying order, addressed by index.

    Results for pairs of runs are cached: each pair is looked up again from every possible start of a survey, and a
    mission whose items are flown a hundred times has as many starts.
    """

    def __init__(self, points: Floats, runs: Sequence[tuple[int, int]]) -> None:
        """Set up for points (w, 3) m, and runs given by their first and last waypoints."""
        self.points, self.runs = points, runs
        self._distances = np.concatenate([[0.0], np.cumsum(leg_runs(points))]).tolist()
        self._spacings = dict[tuple[int, int], float | None]()
        self._following = dict[int, list[int]]()
        self._midpoints = dict[_Line, Floats]()

    def ends(self, line: _Line) -> tuple[int, int]:
        """Return the first and last waypoint of a line."""
        return self.runs[line[0]][0], self.runs[line[1]][1]

    def length(self, line: _Line) -> float:
        """Return the length of the path along a line, m."""
        first, last = self.ends(line)
        return float(self._distances[last] - self._distances[first])

    def midpoint(self, line: _Line) -> Floats:
        """Return the midpoint of a line, (2 or 3,) m."""
        if line not in self._midpoints:
            first, last = self.ends(line)
            axis = LineAxis(self.points[first : last + 1])
            self._midpoints[line] = axis.at(np.array([0.5 * axis.length]))[0]
        return self._midpoints[line]

    def starts_at_previous_end(self, run: int) -> bool:
        """Return True if a run begins where the previous run ends."""
        return self.runs[run - 1][1] == self.runs[run][0]

    def spacing(self, one: int, other: int) -> float | None:
        """Return the distance between two runs, m, or None if they are not parallel neighbors."""
        if (one, other) not in self._spacings:
            self._spacings[one, other] = _apart(self.points, self.runs[one], self.runs[other])
        return self._spacings[one, other]

    def following(self, here: int) -> list[int]:
        """Return the runs that can be the next line after a run, or its first part, in flying order."""
        if here not in self._following:
            self._following[here] = self._search_following(here)
        return self._following[here]

    def _search_following(self, here: int) -> list[int]:
        found, own = list[tuple[int, float, float]](), self.length((here, here))
        for after in range(here + 1, min(len(self.runs), here + 2 + _MAX_TURN_AROUND_RUNS)):
            between = self._distances[self.runs[after][0]] - self._distances[self.runs[here][1]]
            length = self.length((after, after))
            spacing = self.spacing(here, after)
            if spacing is None or between > max(_MAX_TURN_AROUND_RATIO * max(own, length), _SHORT_TURN_AROUND_M):
                continue
            found.append((after, spacing, length))
        # A leg of a turn-around may be parallel to lines too, but it is far from them, and short.
        return [
            after
            for after, spacing, length in found
            if not any(
                k > after and near < _NEARER_LINE_RATIO * spacing and length < _STUB_LENGTH_RATIO * long
                for k, near, long in found
            )
        ]


def _find_chain(runs: _Runs, start: int) -> list[_Line]:
    """Return the lines of a survey that begins with a run, or slightly before or after it."""
    chain = _follow_lines(runs, start)
    if len(chain) > 1:
        # The entry to the first line may be parallel to the second line.
        others = (_follow_lines(runs, other) for other in range(start, chain[1][0]))
        chain = max(others, key=lambda one: (len(one), sum(map(runs.length, one))))
    while len(chain) > _MIN_LINES_WITH_PHOTOS:
        # The last line may be a turn-around of the next survey, whose lines are perpendicular.
        (_, before), last = chain[-2:]
        if not any(_is_turn_around(_follow_lines(runs, other), last, runs) for other in range(before + 1, last[0])):
            break
        chain.pop()
    return chain


def _is_turn_around(chain: Sequence[_Line], line: _Line, runs: _Runs) -> bool:
    """Return True if a line is only a turn-around between two longer lines of a survey."""
    between = [pair for pair in pairwise(chain) if pair[0][1] < line[0] and line[1] < pair[1][0]]
    own = runs.length(line)
    return len(chain) >= _MIN_LINES and any(
        own < _TURN_AROUND_LENGTH_RATIO * min(map(runs.length, pair)) for pair in between
    )


def _follow_lines(runs: _Runs, start: int) -> list[_Line]:
    """Return the lines that follow each other from a run on; the first line may begin before that run."""
    chain = [(start, start)]
    while True:
        first, here = chain[-1]
        for after in runs.following(here):
            bends = 0
            while (len(chain) == 1 or here - bends > first) and _stay_parallel(runs, here, after, bends + 1):
                bends += 1
            if len(chain) == 1:
                chain = [(here - bends, here)]
            elif bends < here - first:
                continue
            chain.append((after, after + bends))
            break
        else:
            return chain


def _stay_parallel(runs: _Runs, here: int, after: int, bends: int) -> bool:
    """Return True if two lines joined by a turn-around are still parallel ``bends`` runs away from it."""
    one, other = here - bends, after + bends
    if (
        one < 0
        or other >= len(runs.runs)
        or not (runs.starts_at_previous_end(one + 1) and runs.starts_at_previous_end(other))
    ):
        return False
    wide, own = runs.spacing(here, after), runs.spacing(one, other)
    lengths = [_run_geometry(runs.points, runs.runs[k])[2] for k in (one, other)]
    return (
        wide is not None
        and own is not None
        and max(wide, own) <= _SPACING_RATIO_LIMIT * min(wide, own)
        and max(lengths) <= _SPACING_RATIO_LIMIT * min(lengths)
    )


def _apart(points: Floats, one: tuple[int, int], other: tuple[int, int]) -> float | None:
    """Return the distance between two runs, m, or None if they are not parallel neighbors."""
    start, course, length = _run_geometry(points, one)
    along, across = _along_and_right(points[[other[0], other[1]], :2] - start, course)
    run = float(np.hypot(*(points[other[1], :2] - points[other[0], :2])))
    shorter, spacing = min(length, run), abs(float(across.mean()))
    if shorter < _MIN_LINE_LENGTH_M or abs(along[1] - along[0]) < math.cos(_PARALLEL_TOLERANCE_RAD) * run:
        return None
    shared = min(length, float(along.max())) - max(0.0, float(along.min()))
    if (
        shared < _MIN_OVERLAP_FRACTION * shorter
        or spacing < _MIN_LINE_SPACING_M
        or abs(float(across[1] - across[0])) > _MAX_SPACING_CHANGE_RATIO * spacing
    ):
        return None
    return spacing


# ----------------------------------------------------------------------
# Build a survey from its lines.


def _make_survey(
    runs: _Runs, chain: Sequence[_Line], camera: Floats, turn_arounds: Sequence[tuple[float, float]]
) -> Survey | None:
    """Build the survey of some lines; return None if too few of them have lateral positions of their own."""
    points, (begins, ends) = runs.points, runs.ends(chain[0])
    offsets = LineAxis(points[begins : ends + 1]).of(np.array([runs.midpoint(line) for line in chain]))[1]
    gaps = _line_gaps(np.sort(offsets))
    if len(gaps) + 1 < (_MIN_LINES_WITH_PHOTOS if camera.any() else _MIN_LINES):
        return None
    lines = tuple(_camera_part(runs.ends(line), camera) for line in chain)
    if len(gaps) + 1 < _MIN_LINES and not all(line.photo > 0.0 for line in lines):
        return None
    # A camera that is off between lines shows where they begin.
    on = any((camera[line.first : line.last] != 0.0).any() for line in lines)
    between = pairwise(lines)
    if not on or all((camera[one.last : other.first] != 0.0).all() for one, other in between):
        lines = _without_leads(points, lines, turn_arounds)
    course = _run_geometry(points, (begins, begins + 1))[1]
    return Survey(lines, course, tuple((offsets - offsets[0]).tolist()), float(np.median(gaps)))


def _line_gaps(places: Floats) -> list[float]:
    """Return the gaps (m) between lines at sorted positions (n,) m, ignoring lines flown twice."""
    gaps = [float(gap) for gap in np.diff(places) if gap >= _MIN_LINE_SPACING_M]
    neighbors = [[gaps[k] for k in (i - 1, i + 1) if 0 <= k < len(gaps)] for i in range(len(gaps))]
    return [
        gap for gap, near in zip(gaps, neighbors, strict=True) if not near or gap > _DUPLICATE_LINE_FRACTION * min(near)
    ]


def _camera_part(run: tuple[int, int], camera: Floats) -> PhotoLine:
    """Return the part of a run on which the camera is on, or the whole run if it is never on."""
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
    """Return the lines without their lead-in and lead-out legs, where the camera does not separate them.

    Leads have the length that the ground station states. If it states none, end legs are leads if all lines have
    equally long ones, since a turn-around has one length.
    """
    for photo, lead in turn_arounds:
        if abs(photo - lines[0].photo) <= _PHOTO_SPACING_TOLERANCE_M and lead > 0.0:
            shorter = tuple(_without_lead(points, line, lead) for line in lines)
            # The mission may have been changed since the ground station wrote that length.
            if shorter != lines:
                return shorter
    lengths = leg_runs(points)
    if any(line.ends - line.begins < _MIN_LEGS_WITH_LEADS for line in lines):
        return lines
    # Waypoints at equal distances along a line are not leads.
    if all(
        line.last - line.first > 1 and np.ptp(lengths[line.first :][:2]) <= _LEAD_LENGTH_TOLERANCE_M for line in lines
    ):
        return lines
    into, *_, out = lines
    leads = [lengths[line.first] for line in lines[1:]] + [lengths[line.last - 1] for line in lines[:-1]]
    if float(np.ptp(leads)) > _LEAD_LENGTH_TOLERANCE_M:
        return lines
    # The entry to the first line and the exit of the last may be longer than the other leads, so find a lead as long as
    # the others there; or use the camera, which goes on at the first line's photos and off after the last line's
    # photos.
    alike = np.abs(lengths - np.median(leads)) <= _LEAD_LENGTH_TOLERANCE_M
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
    """Shorten a line to the waypoints at a distance ``lead`` (m) from the ends of its run.

    Keep an end that has no such waypoint.
    """
    inner = range(line.first + 1, line.last)
    tolerance = max(_LEAD_LENGTH_TOLERANCE_M, 0.01 * lead)

    def points_at_lead_distance(end: int) -> list[int]:
        return [i for i in inner if abs(math.dist(points[i, :2], points[end, :2]) - lead) <= tolerance]

    into, out = points_at_lead_distance(line.begins), points_at_lead_distance(line.ends)
    first = into[0] if into and line.first == line.begins else line.first
    last = out[-1] if out and line.last == line.ends else line.last
    return line._replace(first=first, last=last) if first < last else line


def _run_geometry(points: Floats, run: tuple[int, int]) -> tuple[Floats, float, float]:
    """Return the start of a run (2,) m, its course from start to end, rad, and its length, m."""
    start, end = points[run[0], :2], points[run[1], :2]
    step = end - start
    return start, math.atan2(step[0], step[1]), float(np.hypot(*step))


def _along_and_right(off: Floats, course: float) -> tuple[Floats, Floats]:
    """Return the distances along a course and to the right of it, m, of offsets (n, 2)."""
    east, north = math.sin(course), math.cos(course)
    return off[:, 0] * east + off[:, 1] * north, off[:, 0] * north - off[:, 1] * east
