"""Find surveys in a route, which consist of parallel photo lines and the turn-arounds between them.

No mission item marks a survey: QGroundControl's survey and Mission Planner's grid are waypoints, with items that switch
the camera between them, for PX4 also at gates (CONDITION_GATE). Surveys are therefore found by their geometry,
whichever program wrote them: three or more parallel runs at equal spacing with short links between them. A run is
straight, or bends like its neighbors, as in QGroundControl's corridor scan.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from aircraft.envelope import ground_speed
from flight.mission.items import AMSL, Command, Mission, SurveyPlan, is_navigation
from flight.mission.route import Route
from world.arrays import Floats
from world.geometry import leg_courses, leg_runs
from world.wind import Wind

# Maximum course difference between a leg and the first leg of its straight run, rad.
_MAX_RUN_BEND_RAD = math.radians(3.0)
# Maximum course difference of parallel runs, in either direction, rad.
_PARALLEL_TOLERANCE_RAD = math.radians(10.0)
# Maximum change of the spacing along two parallel runs, as a ratio to the spacing: it excludes the link between two
# lines and the spokes of a hub, which touch.
_MAX_SPACING_CHANGE_RATIO = 0.5
# Minimum distance between neighboring lines, m.
_MIN_LINE_SPACING_M = 1.0
# Minimum overlap of neighboring lines, as a fraction of the shorter line.
_MIN_OVERLAP_FRACTION = 0.5
# Minimum length of a line, m.
_MIN_LINE_LENGTH_M = 10.0
# Maximum number of straight runs in a turn-around.
_MAX_TURN_AROUND_RUNS = 12
# Maximum length of a turn-around, as a ratio to the longer of its two lines.
_MAX_TURN_AROUND_RATIO = 2.0
# Length up to which any turn-around is accepted, m: lines at the tip of a field are short.
_SHORT_TURN_AROUND_M = 250.0
# A parallel run is not a line if a later run is nearer than this fraction of the distance to the parallel run,
_NEARER_LINE_RATIO = 0.5
# and the parallel run is shorter than this fraction of the later run.
_STUB_LENGTH_RATIO = 0.2
# A line between two lines of another survey is a turn-around of that survey if shorter than this fraction of both.
_TURN_AROUND_LENGTH_RATIO = 0.5
# Maximum ratio between the spacings, and between the lengths, of successive run pairs of lines that bend.
_SPACING_RATIO_LIMIT = 2.0
# Minimum number of legs in a straight run with a lead at each end.
_MIN_LEGS_WITH_LEADS = 3
# Tolerance for equal leads, m.
_LEAD_LENGTH_TOLERANCE_M = 1.0
# Minimum number of lines with different lateral positions in a survey: a flight there and back is no survey.
_MIN_LINES = 3
# The same minimum, if the camera is on along the lines.
_MIN_LINES_WITH_PHOTOS = 2
# A gap that is smaller than this fraction of both neighboring gaps separates two flights along one line.
_DUPLICATE_LINE_FRACTION = 0.2
# Ratio up to which a trigger distance may differ from the camera's settings without a note.
_STATED_SPACING_TOLERANCE = 0.02
# Ratio up to which the height of a survey's items may differ from the camera's settings without a note.
_STATED_HEIGHT_TOLERANCE = 0.02
# Tolerance for equal distances between photos, m: ground stations write this distance in single precision.
_PHOTO_SPACING_TOLERANCE_M = 0.01


class PhotoLine(NamedTuple):
    """A line along which photos are taken.

    first, last: index of the line's first and last waypoint; the legs of the line are first to last - 1.
    begins, ends: index of the first and last waypoint of the straight run that contains the line; leads may make it
        longer than the line.
    photo: distance between photos, m; 0 if no item states a distance.
    camera_on_at, camera_off_at: index of the waypoint of the run that switches the camera on, and of the waypoint that
        switches it off; -1 if none does.
    """

    first: int
    last: int
    begins: int
    ends: int
    photo: float = 0.0
    camera_on_at: int = -1
    camera_off_at: int = -1


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
        """Index of the waypoint at which the survey starts."""
        return self.lines[0].first

    @property
    def last(self) -> int:
        """Index of the waypoint at which the survey ends."""
        return self.lines[-1].last

    def line(self, number: int) -> PhotoLine:
        """Return a line by its number in flying order, from 0; negative numbers count from the last line."""
        return self.lines[number]

    def has_leg(self, leg: int) -> bool:
        """Return True if a leg belongs to the survey.

        The leg to the first line and the leg after the last line also belong to it.
        """
        return self.lines[0].begins - 1 <= leg <= self.lines[-1].ends

    def takes_photos(self) -> bool:
        """Return True if the mission's items trigger or switch the camera on at least one line."""
        return any(line.camera_on_at >= 0 or line.camera_off_at >= 0 or line.photo > 0.0 for line in self.lines)

    def turn_arounds(self) -> list[tuple[int, int]]:
        """Return the indices of the first and last waypoint of each turn-around between two lines."""
        return [(line.last, following.first) for line, following in zip(self.lines[:-1], self.lines[1:], strict=True)]

    def transitions(self) -> list[tuple[int, int]]:
        """Return the indices of the first and last waypoint of the entry, each turn-around, and the exit.

        The entry leads to the first line, and the exit leads away from the last line. Between the two waypoints of a
        pair the autopilot chooses the path.
        """
        first_line, last_line = self.lines[0], self.lines[-1]
        return [(first_line.begins, first_line.first), *self.turn_arounds(), (last_line.last, last_line.ends)]


class LineAxis:
    """Along-track and cross-track coordinates relative to a line that continues straight beyond both ends.

    along: (k,) m, distance of each corner along the line from the first corner.
    length: length of the line, m.
    """

    def __init__(self, corners: Floats) -> None:
        """Set up the axis of a line from its k corners, (k, 2) or (k, 3) m; k is at least 2."""
        self.corners = corners
        leg_vectors = np.diff(corners[:, :2], axis=0)
        self._lengths = np.hypot(*leg_vectors.T)
        self._directions = leg_vectors / np.maximum(self._lengths, 1e-9)[:, None]
        self.along = np.concatenate([[0.0], np.cumsum(self._lengths)])
        self.length = float(self.along[-1])

    def project(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Project points (n, 2 or 3), m, onto the nearest leg of the line.

        Return three arrays (n,): the along-track distances, m, the cross-track distances (right positive), m, and the
        course of the nearest leg, rad.
        """
        min_distance = np.full(len(points), np.inf)
        coordinates = np.zeros((3, len(points)))
        for index, (direction, length) in enumerate(zip(self._directions, self._lengths, strict=True)):
            offsets, course = points[:, :2] - self.corners[index, :2], math.atan2(direction[0], direction[1])
            east, north = math.sin(course), math.cos(course)
            along = offsets[:, 0] * east + offsets[:, 1] * north
            right = offsets[:, 0] * north - offsets[:, 1] * east
            min_along = -math.inf if index == 0 else 0.0
            max_along = math.inf if index == len(self._lengths) - 1 else length
            distance = np.hypot(along - np.clip(along, min_along, max_along), right)
            is_nearer = distance < min_distance
            min_distance[is_nearer] = distance[is_nearer]
            coordinates[0, is_nearer] = self.along[index] + along[is_nearer]
            coordinates[1, is_nearer] = right[is_nearer]
            coordinates[2, is_nearer] = course
        return coordinates[0], coordinates[1], coordinates[2]

    def points_at(self, along: Floats) -> Floats:
        """Return the points at distances (n,) m along the line, (n, 2 or 3) m.

        The points have as many columns as the corners. A distance beyond an end of the line gives that end.
        """
        columns = [np.interp(along, self.along, self.corners[:, axis]) for axis in range(self.corners.shape[1])]
        return np.stack(columns, axis=1)


def camera_spacing(mission: Mission, route: Route) -> Floats:
    """Return the distance between photos on the leg that follows each of the route's w waypoints, m, (w,).

    The distance is 0 with the camera off, and NaN if the camera is on and no item states the distance. Items that
    follow the item of a waypoint or gate switch the camera as soon as the aircraft is at this waypoint or gate.
    """
    route_items = set(route.items.tolist())
    spacing_after, spacing, waypoint_seq = dict[int, float](), 0.0, None
    for item in mission.items:
        if is_navigation(item.command):
            # An item without a waypoint of its own belongs to the previous waypoint.
            waypoint_seq = item.seq if item.seq in route_items else waypoint_seq
        elif item.command == Command.CONDITION_GATE and item.seq in route_items:
            waypoint_seq = item.seq
        elif item.command == Command.DO_SET_CAM_TRIGG_DIST:
            spacing = max(0.0, item.params[0]) if math.isfinite(item.params[0]) else 0.0
        elif item.command in (Command.IMAGE_START_CAPTURE, Command.VIDEO_START_CAPTURE):
            spacing = math.nan
        elif item.command in (Command.IMAGE_STOP_CAPTURE, Command.VIDEO_STOP_CAPTURE):
            spacing = 0.0
        if waypoint_seq is not None:
            spacing_after[waypoint_seq] = spacing
    spacings, current_spacing = np.zeros(len(route.items)), 0.0
    for i, seq in enumerate(route.items.tolist()):
        current_spacing = spacing_after.get(seq, current_spacing)
        spacings[i] = current_spacing
    return spacings


def survey_plan(mission: Mission, photo_spacing: float) -> SurveyPlan | None:
    """Return the settings of a survey that the ground station stored in the mission, or None.

    The settings are identified by the survey's distance between photos. If no settings have this distance, or if
    several different ones have it, the result is the first settings without a distance, or None without such settings.

    photo_spacing: distance between photos of the survey, m.
    """
    matching_plans = {
        plan
        for plan in mission.survey_plans
        if plan.photo is not None and abs(plan.photo - photo_spacing) <= _PHOTO_SPACING_TOLERANCE_M
    }
    if len(matching_plans) == 1:
        return matching_plans.pop()
    return next((plan for plan in mission.survey_plans if plan.photo is None), None)


def camera_notes(
    mission: Mission, route: Route, wind: Wind, airspeed_factor: Callable[[float], float]
) -> tuple[str, ...]:
    """Return notes on trigger distances and heights that contradict the camera's settings or abilities.

    airspeed_factor: function that returns the ratio of true airspeed to the route's airspeeds at an altitude, m AMSL.
    """
    notes, spacings, courses = [], camera_spacing(mission, route)[:-1], leg_courses(route.positions)
    for plan in dict.fromkeys(mission.survey_plans):
        photo_spacing = plan.photo or 0.0
        legs = np.flatnonzero(np.abs(spacings - photo_spacing) <= _PHOTO_SPACING_TOLERANCE_M).tolist()
        if photo_spacing <= 0.0 or not legs:
            continue
        text = f"a survey triggers the camera every {photo_spacing:.4g} m"
        if plan.stated_photo and abs(plan.stated_photo / photo_spacing - 1.0) > _STATED_SPACING_TOLERANCE:
            stated_text = f"{plan.stated_photo:.4g} m (AdjustedFootprintFrontal)"
            notes.append(f"{text}, but the settings of its camera in the file state {stated_text}")
        seqs = {int(seq) for leg in legs for seq in route.items[leg : leg + 2]}
        heights = {item.alt for item in mission.items if item.seq in seqs and item.frame not in AMSL}
        farthest_height = max(heights, key=lambda height: abs(height - plan.height), default=plan.height)
        if plan.height and abs(farthest_height / plan.height - 1.0) > _STATED_HEIGHT_TOLERANCE:
            notes.append(
                f"the camera's settings of a survey in the file state a height of {plan.height:.4g} m"
                f" (DistanceToSurface), but its items state {farthest_height:.4g} m"
            )
        if plan.camera is None or plan.camera.interval <= 0.0:
            continue
        # The highest ground speed in the mean wind; NaN if none of the courses can be held.
        speeds = []
        for leg in legs:
            altitude = float(route.positions[leg : leg + 2, 2].mean())
            tailwind, crosswind = wind.components_on_course(float(courses[leg]), altitude)
            airspeed = float(route.leg_airspeeds[leg]) * airspeed_factor(altitude)
            speeds.append(ground_speed(airspeed, tailwind, crosswind))
        speed = max((speed for speed in speeds if not math.isnan(speed)), default=math.nan)
        if photo_spacing < plan.camera.interval * speed:
            notes.append(
                f"the camera takes one photo per {plan.camera.interval:g} s; the trigger distance of"
                f" {photo_spacing:.4g} m requires one every {photo_spacing / speed:.2f} s at {speed:.1f} m/s over the"
                " ground"
            )
    return tuple(notes)


def with_photo_spacing(mission: Mission, survey: Survey, spacing: float) -> Mission:
    """Return the mission with another distance between a survey's photos, in its items and settings.

    spacing: new distance, m.
    """

    def has_spacing(value: float | None) -> bool:
        """Return True if a value is the distance between photos of the survey."""
        return value is not None and abs(value - survey.lines[0].photo) <= _PHOTO_SPACING_TOLERANCE_M

    return replace(
        mission,
        items=tuple(
            replace(item, params=(spacing, *item.params[1:]))
            if item.command == Command.DO_SET_CAM_TRIGG_DIST and has_spacing(item.params[0])
            else item
            for item in mission.items
        ),
        survey_plans=tuple(
            replace(plan, photo=spacing, stated_photo=0.0) if has_spacing(plan.photo) else plan
            for plan in mission.survey_plans
        ),
    )


def find_surveys(route: Route, camera: Floats, turn_arounds: Sequence[tuple[float, float]] = ()) -> tuple[Survey, ...]:
    """Find the surveys of a route, in flying order.

    camera: distance between photos on each leg, (w,) m, from `camera_spacing`.
    turn_arounds: two distances for each survey of the ground station: between photos, and from a line's first or last
        photo to the end of its straight run, m.

    >>> from flight.mission.route import route_points
    >>> lines = [[0, 0], [0, 900], [60, 900], [60, 0], [120, 0], [120, 900]]
    >>> points = np.array([[*place, 100.0] for place in lines], dtype=float)
    >>> route = Route(route_points(points, 15.0, item=np.arange(1, 7)), "")
    >>> [survey] = find_surveys(route, np.zeros(6))
    >>> [(line.first, line.last) for line in survey.lines], survey.offsets, survey.spacing
    ([(0, 1), (2, 3), (4, 5)], (0.0, 60.0, 120.0), 60.0)
    """
    run_bounds, surveys, run_index = _straight_runs(route), list[Survey](), 0
    if camera.any():
        # If items switch the camera, only a run with the camera on can be a line.
        run_bounds = [(first, last) for first, last in run_bounds if (camera[first:last] != 0.0).any()]
    runs = _Runs(route.positions, run_bounds)
    while run_index < len(run_bounds):
        chain = _find_chain(runs, run_index)
        survey = _make_survey(runs, chain, camera, turn_arounds)
        if survey is None:
            run_index += 1
            continue
        surveys.append(survey)
        run_index = chain[-1][1] + 1
    return tuple(surveys)


def _straight_runs(route: Route) -> list[tuple[int, int]]:
    """Return the first and last waypoint index of each straight run: successive legs on one course.

    The legs of a take-off, a landing, a loiter and an RTL are left out.
    """
    courses, arcs, end = leg_courses(route.positions), route.arc_radii, route.legs
    last = end if route.rtl_start is None else route.rtl_start
    has_landing, has_takeoff = route.landing_ground is not None, route.takeoff_ground is not None
    runs, first = [], 0
    for index in range(1, last + 1):
        course_change = abs(math.remainder(float(courses[min(index, end - 1)] - courses[first]), 2.0 * math.pi))
        if index < last and course_change <= _MAX_RUN_BEND_RAD and arcs[index] == 0.0:
            continue
        is_ground_leg = (has_takeoff and first == 0) or (has_landing and index == end)
        if not is_ground_leg and (arcs[first] == 0.0 or arcs[index] == 0.0):
            runs.append((first, index))
        first = index
    return runs


# ----------------------------------------------------------------------
# Assign runs to the lines of one survey. A line is one straight run, or several successive runs.


# Index of the first and last run of a line.
_Line = tuple[int, int]


class _Runs:
    """Straight runs of a route in flying order, addressed by index.

    A line of a survey is one run or several successive runs, given by the indices of its first and last run. Results
    for pairs of runs are cached, because each pair is looked up from every possible start of a survey.
    """

    def __init__(self, points: Floats, runs: Sequence[tuple[int, int]]) -> None:
        """Store waypoints (w, 3) m, and runs, each as the indices of its first and last waypoint."""
        self.points, self.runs = points, runs
        self._distances = np.concatenate([[0.0], np.cumsum(leg_runs(points))]).tolist()
        # Positions, directions and lengths are plain numbers: computing with arrays of two elements takes ten times as
        # long.
        self._positions: list[list[float]] = points[:, :2].tolist()
        steps = np.array([points[last, :2] - points[first, :2] for first, last in runs]).reshape(-1, 2)
        self._directions = [(math.sin(course), math.cos(course)) for course in itertools.starmap(math.atan2, steps)]
        self.run_lengths: list[float] = np.hypot(*steps.T).tolist()
        self._spacings = dict[tuple[int, int], float | None]()
        self._next_lines = dict[int, list[int]]()
        self._midpoints = dict[_Line, Floats]()

    def ends(self, line: _Line) -> tuple[int, int]:
        """Return the index of the first and last waypoint of a line."""
        return self.runs[line[0]][0], self.runs[line[1]][1]

    def length(self, line: _Line) -> float:
        """Return the length of the path along a line, m."""
        first, last = self.ends(line)
        return float(self._distances[last] - self._distances[first])

    def midpoint(self, line: _Line) -> Floats:
        """Return the midpoint of the path along a line, (3,) m."""
        if line not in self._midpoints:
            first, last = self.ends(line)
            axis = LineAxis(self.points[first : last + 1])
            self._midpoints[line] = axis.points_at(np.array([0.5 * axis.length]))[0]
        return self._midpoints[line]

    def starts_at_previous_end(self, run: int) -> bool:
        """Return True if a run begins where the previous run ends."""
        return self.runs[run - 1][1] == self.runs[run][0]

    def spacing(self, run: int, other_run: int) -> float | None:
        """Return the distance between two runs (m); None if they cannot be neighboring lines.

        Neighboring lines are parallel, overlap, and are far enough apart.
        """
        if (run, other_run) not in self._spacings:
            self._spacings[run, other_run] = self._compute_spacing(run, other_run)
        return self._spacings[run, other_run]

    def _compute_spacing(self, run: int, other_run: int) -> float | None:
        """Return the distance between two runs (m) without using the cache; None if they cannot be neighbors."""
        length, other_length = self.run_lengths[run], self.run_lengths[other_run]
        min_length = min(length, other_length)
        if min_length < _MIN_LINE_LENGTH_M:
            return None
        # Along-track and cross-track (right positive) distances of the other run's ends from the run's start, m.
        start_east, start_north = self._positions[self.runs[run][0]]
        course_east, course_north = self._directions[run]
        along, right = [], []
        for waypoint in self.runs[other_run]:
            east, north = self._positions[waypoint]
            east, north = east - start_east, north - start_north
            along.append(east * course_east + north * course_north)
            right.append(east * course_north - north * course_east)
        if abs(along[1] - along[0]) < math.cos(_PARALLEL_TOLERANCE_RAD) * other_length:
            return None
        spacing = abs(0.5 * (right[0] + right[1]))
        overlap = min(length, max(along)) - max(0.0, min(along))
        if (
            overlap < _MIN_OVERLAP_FRACTION * min_length
            or spacing < _MIN_LINE_SPACING_M
            or abs(right[1] - right[0]) > _MAX_SPACING_CHANGE_RATIO * spacing
        ):
            return None
        return spacing

    def next_lines(self, run: int) -> list[int]:
        """Return the runs with which the next line after a run may start, in flying order."""
        if run not in self._next_lines:
            self._next_lines[run] = self._find_next_lines(run)
        return self._next_lines[run]

    def _find_next_lines(self, run: int) -> list[int]:
        """Return the runs with which the next line after a run may start, without using the cache."""
        candidates, run_length = list[tuple[int, float, float]](), self.length((run, run))
        for next_run in range(run + 1, min(len(self.runs), run + 2 + _MAX_TURN_AROUND_RUNS)):
            link_length = self._distances[self.runs[next_run][0]] - self._distances[self.runs[run][1]]
            length = self.length((next_run, next_run))
            spacing = self.spacing(run, next_run)
            if spacing is None or link_length > max(
                _MAX_TURN_AROUND_RATIO * max(run_length, length), _SHORT_TURN_AROUND_M
            ):
                continue
            candidates.append((next_run, spacing, length))
        # A leg of a turn-around may be parallel to the lines, too, but it is short and farther away than the next line.
        return [
            next_run
            for next_run, spacing, length in candidates
            if not any(
                other_run > next_run
                and other_spacing < _NEARER_LINE_RATIO * spacing
                and length < _STUB_LENGTH_RATIO * other_length
                for other_run, other_spacing, other_length in candidates
            )
        ]


def _find_chain(runs: _Runs, start: int) -> list[_Line]:
    """Return the lines of the survey that starts near a run, in flying order.

    start: index of the run. The first line may start before it, if the line bends, or after it, if this run only leads
        to the survey.

    Of the possible first lines, the one with the most lines after it is chosen, then the one with the longest lines. A
    last line that is only a turn-around of the next survey is omitted.
    """
    chain = _follow_lines(runs, start)
    if len(chain) > 1:
        # The entry to the first line may be parallel to the second line.
        chains = (_follow_lines(runs, first_run) for first_run in range(start, chain[1][0]))
        chain = max(chains, key=lambda lines: (len(lines), sum(map(runs.length, lines))))
    while len(chain) > _MIN_LINES_WITH_PHOTOS:
        # The last line may be a turn-around of the next survey, whose lines are perpendicular.
        (_, previous_run), last_line = chain[-2:]
        next_chains = (_follow_lines(runs, first_run) for first_run in range(previous_run + 1, last_line[0]))
        if not any(
            before[1] < last_line[0]
            and last_line[1] < after[0]
            and runs.length(last_line) < _TURN_AROUND_LENGTH_RATIO * min(runs.length(before), runs.length(after))
            for next_chain in next_chains
            if len(next_chain) >= _MIN_LINES
            for before, after in pairwise(next_chain)
        ):
            break
        chain.pop()
    return chain


def _follow_lines(runs: _Runs, start: int) -> list[_Line]:
    """Return the successive parallel lines that start at a run, in flying order.

    The first line may begin before this run, if it bends. A bend makes one line of several runs; the runs of the next
    line then bend likewise. Only the first line is returned if no later run can be the next line.
    """
    chain = [(start, start)]
    while True:
        first_run, last_run = chain[-1]
        for next_run in runs.next_lines(last_run):
            bend_count = 0
            while (len(chain) == 1 or last_run - bend_count > first_run) and _are_parallel(
                runs, last_run, next_run, bend_count + 1
            ):
                bend_count += 1
            if len(chain) == 1:
                chain = [(last_run - bend_count, last_run)]
            elif bend_count < last_run - first_run:
                continue
            chain.append((next_run, next_run + bend_count))
            break
        else:
            return chain


def _are_parallel(runs: _Runs, run: int, next_run: int, bend_count: int) -> bool:
    """Return True if two bent lines are also parallel in runs farther from the turn-around between them.

    run, next_run: last run of the first line, and first run of the second line.
    bend_count: number of bends between the turn-around and the runs that are compared.
    """
    run_before, run_after = run - bend_count, next_run + bend_count
    if (
        run_before < 0
        or run_after >= len(runs.runs)
        or not (runs.starts_at_previous_end(run_before + 1) and runs.starts_at_previous_end(run_after))
    ):
        return False
    spacing, bent_spacing = runs.spacing(run, next_run), runs.spacing(run_before, run_after)
    lengths = [runs.run_lengths[run_before], runs.run_lengths[run_after]]
    return (
        spacing is not None
        and bent_spacing is not None
        and max(spacing, bent_spacing) <= _SPACING_RATIO_LIMIT * min(spacing, bent_spacing)
        and max(lengths) <= _SPACING_RATIO_LIMIT * min(lengths)
    )


# ----------------------------------------------------------------------
# Build a survey from its lines.


def _make_survey(
    runs: _Runs, chain: Sequence[_Line], camera: Floats, turn_arounds: Sequence[tuple[float, float]]
) -> Survey | None:
    """Build a survey from successive lines; return None if they have too few different lateral positions.

    `_MIN_LINES` positions are needed, or `_MIN_LINES_WITH_PHOTOS` if photos are taken on every line.
    camera: distance between photos on each leg, (w,) m.
    turn_arounds: two distances for each survey of the ground station; see `find_surveys`.
    """
    points, (run_start, run_end) = runs.points, runs.ends(chain[0])
    midpoints = np.array([runs.midpoint(line) for line in chain])
    _, offsets, _ = LineAxis(points[run_start : run_end + 1]).project(midpoints)
    # Gaps between lines; a line flown twice is one line.
    all_gaps = [float(gap) for gap in np.diff(np.sort(offsets)) if gap >= _MIN_LINE_SPACING_M]
    gaps = []
    for k, gap in enumerate(all_gaps):
        adjacent = [*all_gaps[max(0, k - 1) : k], *all_gaps[k + 1 : k + 2]]
        if not adjacent or gap > _DUPLICATE_LINE_FRACTION * min(adjacent):
            gaps.append(gap)
    if len(gaps) + 1 < (_MIN_LINES_WITH_PHOTOS if camera.any() else _MIN_LINES):
        return None
    lines = tuple(_make_photo_line(runs.ends(line), camera) for line in chain)
    if len(gaps) + 1 < _MIN_LINES and not all(line.photo > 0.0 for line in lines):
        return None
    # A camera that is off between lines shows where they start.
    has_photos = any((camera[line.first : line.last] != 0.0).any() for line in lines)
    line_pairs = pairwise(lines)
    if not has_photos or all((camera[line.last : following.first] != 0.0).all() for line, following in line_pairs):
        lines = _remove_leads(points, lines, turn_arounds)
    # The first line may begin after the start of its run, which can contain the way to the survey.
    first_leg = points[lines[0].first + 1, :2] - points[lines[0].first, :2]
    course = math.atan2(*first_leg)
    return Survey(lines, course, tuple((offsets - offsets[0]).tolist()), float(np.median(gaps)))


def _make_photo_line(run: tuple[int, int], camera: Floats) -> PhotoLine:
    """Return the part of a run with the camera on, as a line; the whole run if the camera is never on.

    run: indices of the first and last waypoint.
    camera: distance between photos on the leg after each waypoint, (w,) m; 0 with the camera off.
    """
    first_waypoint, last_waypoint = run
    photo_legs = np.flatnonzero(camera[first_waypoint:last_waypoint] != 0.0)
    if not photo_legs.size:
        return PhotoLine(first_waypoint, last_waypoint, *run)
    first_waypoint, last_waypoint = run[0] + int(photo_legs[0]), run[0] + int(photo_legs[-1]) + 1
    was_off = first_waypoint == 0 or camera[first_waypoint - 1] == 0.0
    return PhotoLine(
        first_waypoint,
        last_waypoint,
        *run,
        float(np.nan_to_num(camera[first_waypoint])),
        first_waypoint if was_off else -1,
        last_waypoint if camera[last_waypoint] == 0.0 else -1,
    )


def _remove_leads(
    points: Floats, lines: tuple[PhotoLine, ...], turn_arounds: Sequence[tuple[float, float]]
) -> tuple[PhotoLine, ...]:
    """Return the lines without their lead-in and lead-out legs; unchanged if no such legs are found.

    turn_arounds: two distances for each survey of the ground station: between photos, and of a lead, m.

    A lead is a leg before a line's first photo or after its last photo. Its length is the length that the ground
    station stores. Without a stored length, the first and last legs are leads if they have the same length on all
    lines, because all turn-arounds of a survey have one length.
    """
    for photo_spacing, lead in turn_arounds:
        if abs(photo_spacing - lines[0].photo) <= _PHOTO_SPACING_TOLERANCE_M and lead > 0.0:
            tolerance, shortened = max(_LEAD_LENGTH_TOLERANCE_M, 0.01 * lead), []
            for line in lines:
                # The inner waypoints at the length of a lead from the start, and from the end of the line's run.
                from_start, from_end = (
                    [
                        i
                        for i in range(line.first + 1, line.last)
                        if abs(math.dist(points[i, :2], points[end, :2]) - lead) <= tolerance
                    ]
                    for end in (line.begins, line.ends)
                )
                first = from_start[0] if from_start and line.first == line.begins else line.first
                last = from_end[-1] if from_end and line.last == line.ends else line.last
                # A line of which no leg would remain is unchanged.
                shortened.append(line._replace(first=first, last=last) if first < last else line)
            # If no line changes, the mission was edited after the ground station stored the length.
            if tuple(shortened) != lines:
                return tuple(shortened)
    lengths = leg_runs(points)
    if any(line.ends - line.begins < _MIN_LEGS_WITH_LEADS for line in lines):
        return lines
    # Waypoints at equal distances along a line are not leads.
    if all(
        line.last - line.first > 1 and np.ptp(lengths[line.first :][:2]) <= _LEAD_LENGTH_TOLERANCE_M for line in lines
    ):
        return lines
    first_line, *_, last_line = lines
    leads = [lengths[line.first] for line in lines[1:]] + [lengths[line.last - 1] for line in lines[:-1]]
    if float(np.ptp(leads)) > _LEAD_LENGTH_TOLERANCE_M:
        return lines
    # The entry to the first line and the exit of the last line may be longer than the other leads. If the camera is
    # switched there, the line already ends there. If not, find a leg there with the length of the other leads.
    is_lead = np.abs(lengths - np.median(leads)) <= _LEAD_LENGTH_TOLERANCE_M
    candidate_starts = np.flatnonzero(is_lead[first_line.first : first_line.last - 1]) + first_line.first + 1
    candidate_ends = np.flatnonzero(is_lead[last_line.first + 1 : last_line.last]) + last_line.first + 1
    first_waypoints = [first_line.first] if first_line.first > first_line.begins else candidate_starts.tolist()
    last_waypoints = [last_line.last] if last_line.last < last_line.ends else candidate_ends.tolist()
    if not (first_waypoints and last_waypoints):
        return lines
    inner_lines = [line._replace(first=line.first + 1, last=line.last - 1) for line in lines]
    inner_lines[0] = inner_lines[0]._replace(first=first_waypoints[0])
    inner_lines[-1] = inner_lines[-1]._replace(last=last_waypoints[-1])
    return tuple(inner_lines)
