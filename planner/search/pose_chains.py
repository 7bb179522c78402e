"""Construct paths of a few straight legs from one point and course to another, also with laps.

The legs of a path must be long enough for its turns, and the path must gain or lose a height. `candidate_chains` lists
candidates on the map, `measure_path` computes their lengths and checks the legs, and `climb_altitudes` and
`descent_altitudes` compute the altitudes of the corners.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from world.arrays import Floats
from world.geometry import leg_courses, leg_runs

# East and north, m.
MapPoint = tuple[float, float]
# Function that returns the steepest slope (m per m) on a course (rad).
SlopeOnCourse = Callable[[float], float]

# Sharpest turn of a path, rad.
MAX_TURN_RAD = math.radians(120.0)
# Step of the turns in a table of turn lengths, from 0 on, rad.
TURN_STEP_RAD = math.radians(15.0)
# Number of turns in a table of turn lengths.
TURN_STEP_COUNT = 11
# Maximum fraction of a leg that its turns may occupy; the rest is needed to settle on the leg.
MAX_TURN_FRACTION = 0.95
# Cost of a turn of one radian, m of path length; the cost grows with the square of the turn.
_TURN_COST_M = 250.0
# Lengths of the last leg, in radii of the tightest turn.
_LAST_LEG_RADII = (3.0, 4.0, 5.5, 8.0)
# Lengths of the leg to a corner near the beginning, in radii of the tightest turn.
_FIRST_LEG_RADII = (3.0, 5.0, 8.0, 14.0)
# Lengths of a base leg across the line of the last leg, in radii of the tightest turn.
_BASE_LEG_RADII = (4.5, 8.0)
# Number of directions of the leg to a corner near the beginning.
_FIRST_DIRECTION_COUNT = 16
# Directions from the end of a base leg back to its start, relative to the final course, rad.
_BASE_LEG_TURNS_RAD = tuple(math.radians(side * turn) for side in (-1, 1) for turn in (60.0, 90.0, 120.0))
# Side of a lap, in radii of the tightest turn.
LAP_SIDE_RADII = 5.5
# Maximum number of laps.
MAX_LAPS = 8


def candidate_chains(
    start: MapPoint, course: float, end: MapPoint, end_course: float, turn_radius: float, laps: int
) -> Iterator[list[MapPoint]]:
    """Yield candidates for a path from `start` to `end`, as lists of corners.

    The path is a departure or an approach.

    course, end_course: course of the leg before `start`, and of the leg after `end`, rad.
    turn_radius: radius of the tightest turn, m.
    laps: number of square laps before the other corners.

    The path is flown from `start` over the corners to `end`. After its laps it has no corner or one near the start, and
    up to two before the end: on the extended last leg, and on a base leg across it.
    """
    # Square laps to the right and to the left, which begin and end at `start`.
    lap_chains: list[list[MapPoint]] = [] if laps else [[]]
    for cross_course in (course + 0.5 * math.pi, course - 0.5 * math.pi) if laps else ():
        side = LAP_SIDE_RADII * turn_radius
        ahead_corner = _offset_point(start, course, side)
        far_corner = _offset_point(ahead_corner, cross_course, side)
        cross_corner = _offset_point(start, cross_course, side)
        lap_chains.append([ahead_corner, far_corner, cross_corner, start] * laps)
    last_corners = [_offset_point(end, end_course, -radii * turn_radius) for radii in _LAST_LEG_RADII]
    short_ends: list[list[MapPoint]] = [[], *([last_corner] for last_corner in last_corners)]
    base_ends = [
        [_offset_point(last_corner, end_course + turn, radii * turn_radius), last_corner]
        for last_corner in last_corners[1:3]
        for turn in _BASE_LEG_TURNS_RAD
        for radii in _BASE_LEG_RADII
    ]
    first_corners = [
        [_offset_point(start, 2.0 * math.pi * k / _FIRST_DIRECTION_COUNT, radii * turn_radius)]
        for radii in _FIRST_LEG_RADII
        for k in range(_FIRST_DIRECTION_COUNT)
    ]
    for lap_corners in lap_chains:
        for end_corners in (*short_ends, *base_ends):
            yield [*lap_corners, *end_corners]
        for first_corner in first_corners:
            for end_corners in short_ends:
                yield [*lap_corners, *first_corner, *end_corners]
        for first_corner in first_corners[1 : 3 * _FIRST_DIRECTION_COUNT : 2]:
            for end_corners in base_ends:
                yield [*lap_corners, *first_corner, *end_corners]


def _offset_point(point: MapPoint, course: float, distance: float) -> MapPoint:
    """Return the map point at a distance (m) from a point on a course (rad)."""
    return point[0] + distance * math.sin(course), point[1] + distance * math.cos(course)


class TurnLengths(NamedTuple):
    """Lengths (m) that turns take up of the legs before and after their corner.

    Entry k is for a turn of k times `TURN_STEP_RAD`.
    """

    before: tuple[float, ...]
    after: tuple[float, ...]

    def lengths(self, turn: float) -> tuple[float, float]:
        """Return the lengths that a turn (rad) takes up before and after its corner, m.

        They are interpolated in the table. A turn beyond the end of the table gets about the lengths of the table's
        sharpest turn.
        """
        # Just before the last entry, so that an entry follows.
        position = min(turn / TURN_STEP_RAD, len(self.before) - 1.001)
        index = int(position)
        fraction = position - index
        return (
            self.before[index] + fraction * (self.before[index + 1] - self.before[index]),
            self.after[index] + fraction * (self.after[index + 1] - self.after[index]),
        )


def arc_turn_lengths(radius: float) -> TurnLengths:
    """Return the table of turn lengths for arcs of a radius (m): the lengths of their tangents.

    >>> [round(length) for length in arc_turn_lengths(150.0).lengths(math.radians(90.0))]
    [150, 150]
    """
    tangents = tuple(radius * math.tan(0.5 * TURN_STEP_RAD * k) for k in range(TURN_STEP_COUNT))
    return TurnLengths(tangents, tangents)


class PathMeasures(NamedTuple):
    """Horizontal measures of a path.

    length: m.
    cost: length plus a cost of sharp turns, whose arcs are shorter, and therefore steeper, than the legs.
    max_turn: sharpest turn, rad.
    max_fraction: largest fraction of a leg that its turns take up.
    """

    length: float
    cost: float
    max_turn: float
    max_fraction: float

    @property
    def fits(self) -> bool:
        """True if no turn is too sharp and every leg is long enough for the turns at its ends."""
        return self.max_turn <= MAX_TURN_RAD and self.max_fraction <= MAX_TURN_FRACTION


def measure_path(points: Sequence[MapPoint], turn_lengths: TurnLengths) -> PathMeasures:
    """Measure the length and the turns of a path, and how much of each leg its turns take up.

    points: east and north of the path, m; plain numbers for speed, because tens of thousands of paths are measured.

    The measurement ends at a turn that is too sharp, and at two points less than 1 m apart: such a path has the cost
    inf and does not fit.

    >>> measure_path([(0.0, 0.0), (0.0, 1000.0), (1000.0, 1000.0)], arc_turn_lengths(150.0)).fits
    True
    >>> measure_path([(0.0, 0.0), (0.0, 1000.0), (1000.0, 1000.0)], arc_turn_lengths(990.0)).fits
    False
    """
    length = max_turn = max_fraction = squared_turns = occupied_length = east = north = leg_length = 0.0
    for k in range(len(points) - 1):
        next_east, next_north = points[k + 1][0] - points[k][0], points[k + 1][1] - points[k][1]
        next_length = math.hypot(next_east, next_north)
        if next_length < 1.0:
            return PathMeasures(length, math.inf, math.pi, math.inf)
        if k:
            turn = abs(math.atan2(east * next_north - north * next_east, east * next_east + north * next_north))
            if turn > MAX_TURN_RAD:
                return PathMeasures(length, math.inf, turn, math.inf)
            max_turn, squared_turns = max(max_turn, turn), squared_turns + turn * turn
            length_before, length_after = turn_lengths.lengths(turn)
            max_fraction = max(max_fraction, (occupied_length + length_before) / leg_length)
            occupied_length = length_after
        length = length + next_length
        east = next_east
        north = next_north
        leg_length = next_length
    max_fraction = max(max_fraction, occupied_length / leg_length) if leg_length else math.inf
    return PathMeasures(length, length + _TURN_COST_M * squared_turns, max_turn, max_fraction)


def climb_altitudes(
    points: Sequence[MapPoint], start_altitude: float, climb: SlopeOnCourse, min_altitude: float, end_altitude: float
) -> Floats:
    """Compute the altitude at each point of a path that climbs as steeply as allowed, (n,) m AMSL.

    points: (n) east and north of the path, m.
    start_altitude: altitude at the first point, m.
    climb: function that returns the climb slope on a course.
    min_altitude: minimum altitude except at the end, m.
    end_altitude: final altitude, which is not exceeded, m; the last altitude is lower if the path is too short.

    >>> climb_altitudes([(0.0, 0.0), (0.0, 500.0), (0.0, 1500.0)], 0.0, lambda course: 0.1, 20.0, 100.0).tolist()
    [20.0, 50.0, 100.0]
    """
    point_array = np.array(points)
    climbs = [
        climb(course) * leg_length
        for course, leg_length in zip(leg_courses(point_array), leg_runs(point_array), strict=True)
    ]
    reachable_altitudes = start_altitude + np.concatenate([[0.0], np.cumsum(climbs)])
    altitudes = np.maximum(min_altitude, np.minimum(reachable_altitudes, end_altitude))
    altitudes[-1] = min(end_altitude, reachable_altitudes[-1])
    return altitudes


def descent_altitudes(
    points: Sequence[MapPoint], start_altitude: float, climb: SlopeOnCourse, dive: SlopeOnCourse, end_altitude: float
) -> Floats:
    """Compute the altitudes (n,) of a path that descends as late, or climbs as early, as possible, m AMSL.

    points: (n) east and north of the path, m.
    start_altitude, end_altitude: m AMSL.
    climb, dive: functions that return the tangent of the steepest slope on a course.

    If the path is too short for the change of altitude, the first altitude is lower than requested (in a descent), or
    the last one is (in a climb).

    >>> descent_altitudes([(0.0, 0.0), (0.0, 500.0), (0.0, 1500.0)], 200.0, lambda _: 0.1, lambda _: 0.1, 50.0).tolist()
    [200.0, 150.0, 50.0]
    """
    point_array = np.array(points)
    if end_altitude > start_altitude:
        return climb_altitudes(points, start_altitude, climb, start_altitude, end_altitude)
    descents = [
        dive(course) * leg_length
        for course, leg_length in zip(leg_courses(point_array), leg_runs(point_array), strict=True)
    ]
    reachable_altitudes = end_altitude + np.concatenate([np.cumsum(descents[::-1])[::-1], [0.0]])
    return np.minimum(start_altitude, reachable_altitudes)
