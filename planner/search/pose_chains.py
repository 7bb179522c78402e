"""Construct paths of a few straight legs from one place and course to another, also with laps.

The legs of a path must hold its turns, and the path must gain or lose a height.  `chains` lists horizontal candidates,
`measure` computes their lengths and checks that the legs hold the turns, and `risen` and `fallen` give the altitudes of
the corners.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from world.arrays import Floats
from world.geometry import leg_courses, leg_runs

# East and north, m.
Spot = tuple[float, float]
# Steepest slope (m per m) on a course (rad).
Slope = Callable[[float], float]

# Sharpest turn of a path, rad.
SHARPEST = math.radians(120.0)
# Step of the turns in a table of turn lengths, from 0 on, rad.
STEP = math.radians(15.0)
# Number of turns in a table of turn lengths.
STEPS = 11
# Largest fraction of a leg that its turns may take; the rest is needed to settle on the leg.
TURN_SHARE = 0.95
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
LAP_SIDE = 5.5
# Maximum number of laps.
MAX_LAPS = 8


def chains(begin: Spot, course: float, end: Spot, end_course: float, radius: float, laps: int) -> Iterator[list[Spot]]:
    """Yield lists of corners between two places, either empty or with one near the start and one or two before the end.

    course, end_course: course of the leg before the beginning, and of the leg after the end, rad.
    radius: radius of the tightest turn, m.  laps: number of laps before these corners.
    """
    heads: list[list[Spot]] = [[]]
    if laps:
        heads = [_lap_corners(begin, course, side * LAP_SIDE * radius, laps) for side in (1.0, -1.0)]
    befores = [_move(end, end_course, -share * radius) for share in _LAST_LEG_RADII]
    tails: list[list[Spot]] = [[], *([before] for before in befores)]
    bases = [
        [_move(before, end_course + turn, share * radius), before]
        for before in befores[1:3]
        for turn in _BASE_LEG_TURNS_RAD
        for share in _BASE_LEG_RADII
    ]
    firsts = [
        [_move(begin, 2.0 * math.pi * k / _FIRST_DIRECTION_COUNT, share * radius)]
        for share in _FIRST_LEG_RADII
        for k in range(_FIRST_DIRECTION_COUNT)
    ]
    for head in heads:
        for tail in (*tails, *bases):
            yield [*head, *tail]
        for first in firsts:
            for tail in tails:
                yield [*head, *first, *tail]
        for first in firsts[1 : 3 * _FIRST_DIRECTION_COUNT : 2]:
            for tail in bases:
                yield [*head, *first, *tail]


def _lap_corners(begin: Spot, course: float, side: float, laps: int) -> list[Spot]:
    """Return the corners of square laps that begin and end at a place on its course; left-hand if side < 0."""
    across = course + math.copysign(0.5 * math.pi, side)
    ahead = _move(begin, course, abs(side))
    corner = _move(ahead, across, abs(side))
    back = _move(begin, across, abs(side))
    return [ahead, corner, back, begin] * laps


def _move(spot: Spot, course: float, run: float) -> Spot:
    return spot[0] + run * math.sin(course), spot[1] + run * math.cos(course)


class TurnLengths(NamedTuple):
    """Lengths of leg (m) that turns take before and after their corners, for turns from 0 in steps of `STEP`."""

    before: tuple[float, ...]
    after: tuple[float, ...]

    def of(self, turn: float) -> tuple[float, float]:
        """Return the lengths before and after the corner of a turn (rad), m."""
        place = min(turn / STEP, len(self.before) - 1.001)
        k = int(place)
        u = place - k
        return (
            self.before[k] + u * (self.before[k + 1] - self.before[k]),
            self.after[k] + u * (self.after[k + 1] - self.after[k]),
        )


def arc_lengths(radius: float) -> TurnLengths:
    """Return the turn lengths of arcs of the given radius (m), which are the lengths of their tangents.

    >>> [round(length) for length in arc_lengths(150.0).of(math.radians(90.0))]
    [150, 150]
    """
    tangents = tuple(radius * math.tan(0.5 * STEP * k) for k in range(STEPS))
    return TurnLengths(tangents, tangents)


class Measured(NamedTuple):
    """Horizontal measures of a path.

    length: m.  cost: length plus a cost of sharp turns, as their arcs are shorter, and so steeper, than the legs.
    sharpest: sharpest turn, rad.
    fullest: largest fraction of a leg that its turns take up.
    """

    length: float
    cost: float
    sharpest: float
    fullest: float

    @property
    def fits(self) -> bool:
        """True if no turn is too sharp, and each leg is long enough for the turns at its ends."""
        return self.sharpest <= SHARPEST and self.fullest <= TURN_SHARE


def measure(spots: Sequence[Spot], turning: TurnLengths) -> Measured:
    """Measure a path with plain numbers, because it is called for tens of thousands of paths.

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
    return Measured(length, length + _TURN_COST_M * turns, sharpest, fullest)


def risen(spots: Sequence[Spot], low: float, climb: Slope, floor: float, end: float) -> Floats:
    """Return the altitudes at n places of a path that climbs as steeply as allowed, (n,) m.

    low: altitude at the first place, m.
    floor: minimum altitude except at the end, m.
    end: final altitude, which is not exceeded, m; the last altitude is lower if the path is too short.

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
    """Return the altitudes at n places of a path between two altitudes that descends late or climbs early, (n,) m.

    The first or the last altitude differs from the requested one if the path is too short.

    >>> fallen([(0.0, 0.0), (0.0, 500.0), (0.0, 1500.0)], 200.0, lambda _: 0.1, lambda _: 0.1, 50.0).tolist()
    [200.0, 150.0, 50.0]
    """
    points = np.array(spots)
    if end > high:
        return risen(spots, high, climb, high, end)
    falls = [dive(course) * run for course, run in zip(leg_courses(points), leg_runs(points), strict=True)]
    left = end + np.concatenate([np.cumsum(falls[::-1])[::-1], [0.0]])
    return np.minimum(high, left)
