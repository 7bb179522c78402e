"""Ways of few straight legs from a place and course to another: direct, by a few corners, and in laps.

A way has to hold its turns and to gain or lose a height.  `chains` lists candidates across the ground, `measure` says
how long they are and whether legs are as long as their turns, and `risen` and `fallen` give the heights of corners.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from world.geometry import leg_courses, leg_runs

Floats = NDArray[np.float64]
# East and north, m.
Spot = tuple[float, float]
# Steepest slope (m per m) on a course (rad).
Slope = Callable[[float], float]

# Turns sharper than this are not laid out, rad.
SHARPEST = math.radians(120.0)
# Share of a leg that its turns may take: the rest is to settle in.
TURN_SHARE = 0.85
# m of way that a turn of one radian is worth, and one of two radians four times.
_SHARP_COST = 250.0
# Lengths in radii of the tightest turn: of the last leg; of the first beside it; of a leg across the last one's line.
_LAST, _FIRST, _BASE = (3.0, 4.0, 5.5, 8.0), (3.0, 5.0, 8.0, 14.0), (4.5, 8.0)
_DIRECTIONS, _ACROSS = 16, tuple(math.radians(side * turn) for side in (-1, 1) for turn in (60.0, 90.0, 120.0))
# Length of a lap's side, in radii, and how many laps there are at most.
LAP_SIDE, MOST_LAPS = 5.5, 8


def chains(begin: Spot, course: float, end: Spot, end_course: float, radius: float, laps: int) -> Iterator[list[Spot]]:
    """Corners between two places: none, one beside the beginning, and one or two before the end; after so many laps.

    course: of the leg that leads to the beginning, end_course: of the one that leads on from the end, rad.
    radius: of the tightest turn, m.
    """
    heads: list[list[Spot]] = [[]]
    if laps:
        heads = [_laps(begin, course, side * LAP_SIDE * radius, laps) for side in (1.0, -1.0)]
    befores = [_moved(end, end_course, -share * radius) for share in _LAST]
    tails: list[list[Spot]] = [[], *([before] for before in befores)]
    bases = [
        [_moved(before, end_course + turn, share * radius), before]
        for before in befores[1:3]
        for turn in _ACROSS
        for share in _BASE
    ]
    firsts = [
        [_moved(begin, 2.0 * math.pi * k / _DIRECTIONS, share * radius)] for share in _FIRST for k in range(_DIRECTIONS)
    ]
    for head in heads:
        for tail in (*tails, *bases):
            yield [*head, *tail]
        for first in firsts:
            for tail in tails:
                yield [*head, *first, *tail]
        for first in firsts[1 : 3 * _DIRECTIONS : 2]:
            for tail in bases:
                yield [*head, *first, *tail]


def _laps(begin: Spot, course: float, side: float, laps: int) -> list[Spot]:
    """Corners of squares that go on from a place on its course and come back to it; to the left of a negative side."""
    across = course + math.copysign(0.5 * math.pi, side)
    ahead = _moved(begin, course, abs(side))
    corner = _moved(ahead, across, abs(side))
    back = _moved(begin, across, abs(side))
    return [ahead, corner, back, begin] * laps


def _moved(spot: Spot, course: float, run: float) -> Spot:
    return spot[0] + run * math.sin(course), spot[1] + run * math.cos(course)


class Measured(NamedTuple):
    """A way across the ground.

    length: m.  cost: length, and more for sharp turns: their arcs are shorter, and steeper, than the legs they cut.
    sharpest: turn, rad.  fullest: share of a leg that its turns take, at most.
    """

    length: float
    cost: float
    sharpest: float
    fullest: float

    @property
    def fits(self) -> bool:
        """Whether no turn is too sharp, and each leg holds the arcs at its ends."""
        return self.sharpest <= SHARPEST and self.fullest <= TURN_SHARE


def measure(spots: Sequence[Spot], radius: float) -> Measured:
    """Measure a way whose turns are flown with a radius, m.  In plain numbers: there are tens of thousands of ways.

    >>> measure([(0.0, 0.0), (0.0, 1000.0), (1000.0, 1000.0)], 150.0).fits
    True
    >>> measure([(0.0, 0.0), (0.0, 1000.0), (1000.0, 1000.0)], 900.0).fits
    False
    """
    length = sharpest = fullest = turns = before = east = north = run = 0.0
    for k in range(len(spots) - 1):
        to_east, to_north = spots[k + 1][0] - spots[k][0], spots[k + 1][1] - spots[k][1]
        to_run = math.hypot(to_east, to_north)
        if to_run < 1.0:
            return Measured(length, math.inf, math.pi, math.inf)
        turn = 0.0
        if k:
            turn = abs(math.atan2(east * to_north - north * to_east, east * to_east + north * to_north))
            sharpest, turns = max(sharpest, turn), turns + turn * turn
            tangent = radius * math.tan(0.5 * min(turn, 3.0))
            fullest, before = max(fullest, (before + tangent) / run), tangent
        length, east, north, run = length + to_run, to_east, to_north, to_run
    fullest = max(fullest, before / run) if run else math.inf
    return Measured(length, length + _SHARP_COST * turns, sharpest, fullest)


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
