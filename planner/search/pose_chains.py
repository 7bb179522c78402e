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
# Turns that lengths are known at, rad: from none in steps, so many of them.
STEP, STEPS = math.radians(15.0), 11
# Share of a leg that its turns may take: the rest is to settle in.
TURN_SHARE = 0.95
# m of way that a turn of one radian is worth, and one of two radians four times.
_SHARP_COST = 250.0
# Lengths in radii of the tightest turn: of the last leg; of the first beside it; of a leg across the last one's line.
_LAST, _FIRST, _BASE = (3.0, 4.0, 5.5, 8.0), (3.0, 5.0, 8.0, 14.0), (4.5, 8.0)
_DIRECTIONS, _ACROSS = 16, tuple(math.radians(side * turn) for side in (-1, 1) for turn in (60.0, 90.0, 120.0))
# Length of a lap's side, in radii, and how many laps there are at most.
LAP_SIDE, MAX_LAPS = 5.5, 8


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


class TurnLengths(NamedTuple):
    """Lengths of leg (m) that turns take before and after their corners: at turns in steps of `STEP`, from none on."""

    before: tuple[float, ...]
    after: tuple[float, ...]

    def of(self, turn: float) -> tuple[float, float]:
        """Before and after the corner of a turn, rad."""
        place = min(turn / STEP, len(self.before) - 1.001)
        k = int(place)
        u = place - k
        return (
            self.before[k] + u * (self.before[k + 1] - self.before[k]),
            self.after[k] + u * (self.after[k + 1] - self.after[k]),
        )


def arc_lengths(radius: float) -> TurnLengths:
    """What the tangents of arcs of a radius (m) take.

    >>> [round(length) for length in arc_lengths(150.0).of(math.radians(90.0))]
    [150, 150]
    """
    tangents = tuple(radius * math.tan(0.5 * STEP * k) for k in range(STEPS))
    return TurnLengths(tangents, tangents)


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
        """Whether no turn is too sharp, and each leg holds the turns at its ends."""
        return self.sharpest <= SHARPEST and self.fullest <= TURN_SHARE


def measure(spots: Sequence[Spot], turning: TurnLengths) -> Measured:
    """Measure a way.  In plain numbers: there are tens of thousands of ways.

    >>> measure([(0.0, 0.0), (0.0, 1000.0), (1000.0, 1000.0)], arc_lengths(150.0)).fits
    True
    >>> measure([(0.0, 0.0), (0.0, 1000.0), (1000.0, 1000.0)], arc_lengths(990.0)).fits
    False
    """
    length = sharpest = fullest = turns = taken = east = north = run = 0.0
    for k in range(len(spots) - 1):
        to_east, to_north = spots[k + 1][0] - spots[k][0], spots[k + 1][1] - spots[k][1]
        to_run = math.hypot(to_east, to_north)
        if to_run < 1.0:
            return Measured(length, math.inf, math.pi, math.inf)
        if k:
            turn = abs(math.atan2(east * to_north - north * to_east, east * to_east + north * to_north))
            sharpest, turns = max(sharpest, turn), turns + turn * turn
            before, after = turning.of(turn)
            fullest, taken = max(fullest, (taken + before) / run), after
        length, east, north, run = length + to_run, to_east, to_north, to_run
    fullest = max(fullest, taken / run) if run else math.inf
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
