"""Ways of few straight legs from a place and course to another: direct, by one or two corners, and in laps.

A way has to hold its turns and to gain or lose a height.  `chains` lists candidates across the ground, `turns_fit` says
whether legs are as long as their turns, and `risen` and `fallen` give the heights of their corners.
"""

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from world.geometry import leg_courses, leg_runs, turning_angles

Floats = NDArray[np.float64]
# East and north, m.
Spot = tuple[float, float]
# Steepest slope (m per m) on a course (rad).
Slope = Callable[[float], float]

# Turns sharper than this are not laid out, rad.
SHARPEST = math.radians(120.0)
# Share of a leg that its turns may take: the rest is to settle in.
TURN_SHARE = 0.85
# Lengths of the last leg, and of the first beside it, in radii of the tightest turn.
_LAST, _FIRST = (3.0, 4.0, 5.5, 8.0), (3.0, 5.0, 8.0, 14.0)
_DIRECTIONS = 16
# Length of a lap's side, in radii, and how many laps there are at most.
LAP_SIDE, MOST_LAPS = 5.5, 8


def chains(begin: Spot, course: float, end: Spot, end_course: float, radius: float, laps: int) -> Iterator[list[Spot]]:
    """Corners between two places, nearest ideas first; each begins with so many laps about its beginning.

    course: of the leg that leads to the beginning, end_course: of the one that leads on from the end, rad.
    radius: of the tightest turn, m.
    """
    heads: list[list[Spot]] = [[]]
    if laps:
        heads = [_laps(begin, course, side * LAP_SIDE * radius, laps) for side in (1.0, -1.0)]
    befores = [_moved(end, end_course, -share * radius) for share in _LAST]
    for head in heads:
        yield head
        for before in befores:
            yield [*head, before]
        for share in _FIRST:
            for k in range(_DIRECTIONS):
                aside = _moved(begin, 2.0 * math.pi * k / _DIRECTIONS, share * radius)
                yield [*head, aside]
                for before in befores:
                    yield [*head, aside, before]


def _laps(begin: Spot, course: float, side: float, laps: int) -> list[Spot]:
    """Corners of squares that go on from a place on its course and come back to it; to the left of a negative side."""
    across = course + math.copysign(0.5 * math.pi, side)
    ahead = _moved(begin, course, abs(side))
    corner = _moved(ahead, across, abs(side))
    back = _moved(begin, across, abs(side))
    return [ahead, corner, back, begin] * laps


def _moved(spot: Spot, course: float, run: float) -> Spot:
    return spot[0] + run * math.sin(course), spot[1] + run * math.cos(course)


def turns_fit(spots: Sequence[Spot], radius: float) -> bool:
    """Whether no turn is too sharp, and each leg holds the arcs (of this radius, m) at its ends.

    >>> turns_fit([(0.0, 0.0), (0.0, 1000.0), (1000.0, 1000.0)], 150.0)
    True
    >>> turns_fit([(0.0, 0.0), (0.0, 1000.0), (1000.0, 1000.0)], 900.0)
    False
    """
    points = np.array(spots)
    turns = turning_angles(points)
    if turns.size and float(turns.max()) > SHARPEST:
        return False
    tangents = np.concatenate([[0.0], radius * np.tan(0.5 * turns), [0.0]])
    return bool((tangents[1:] + tangents[:-1] <= TURN_SHARE * leg_runs(points)).all())


def risen(spots: Sequence[Spot], low: float, climb: Slope, floor: float, end: float) -> Floats:
    """Heights (n,) m at n places on a way that climbs from a height at the first one as steeply as it may.

    low: at the first place.  floor: nowhere lower but at the end.  end: height that is not passed, and where the way
    ends, m; the last height is below it where the way is too short.

    >>> risen([(0.0, 0.0), (0.0, 500.0), (0.0, 1500.0)], 0.0, lambda course: 0.1, 20.0, 100.0).tolist()
    [20.0, 50.0, 100.0]
    """
    points = np.array(spots)
    rises = [climb(course) * run for course, run in zip(leg_courses(points), leg_runs(points), strict=True)]
    reached = low + np.concatenate([[0.0], np.cumsum(rises)])
    heights = np.maximum(floor, np.minimum(reached, end))
    heights[-1] = min(end, reached[-1])
    return heights


def fallen(spots: Sequence[Spot], high: float, climb: Slope, dive: Slope, end: float) -> Floats:
    """Heights (n,) m at n places on a way from a height to another, as late down as it may, or as early up.

    The first or the last height differs from what is asked for where the way is too short.

    >>> fallen([(0.0, 0.0), (0.0, 500.0), (0.0, 1500.0)], 200.0, lambda _: 0.1, lambda _: 0.1, 50.0).tolist()
    [200.0, 150.0, 50.0]
    """
    points = np.array(spots)
    if end > high:
        return risen(spots, high, climb, high, end)
    falls = [dive(course) * run for course, run in zip(leg_courses(points), leg_runs(points), strict=True)]
    left = end + np.concatenate([np.cumsum(falls[::-1])[::-1], [0.0]])
    return np.minimum(high, left)
