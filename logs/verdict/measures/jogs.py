"""Corners and steps that no aircraft has to fly as they are drawn, because the way without them is as good as the same.

A sidestep of a few metres has two right angles and no room for either; the straight way past it is within metres of
both.  A step of a few metres in a level path is a cliff; a climb that begins a little early is within its height.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flight.mission.route import Route
from logs.verdict.measures.acceptance import farthest_from_legs
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.tighter_limits import slope_limit, tighter_turn
from logs.verdict.measures.turn_demands import performance_tables, turn_demands
from logs.verdict.tolerances import JOG_SHARE, JOG_WAYPOINTS, PLAN_TOLERANCE, STEP

Floats = NDArray[np.float64]


def jog(demands: RouteDemands, i: int) -> float | None:
    """How near (m) a flyable way passes a corner that is none itself; None where there is no such way.

    The way leaves out the waypoint and up to `JOG_WAYPOINTS` - 1 of its neighbours, passes each of them within
    `JOG_SHARE` of the corridor, and has room for the turns at its own ends.
    """
    most, circles = JOG_SHARE * demands.setup.corridor, demands.setup.route.arcs > 0.0
    for count in range(1, JOG_WAYPOINTS + 1):
        for first in range(max(1, i - count + 1), min(i, demands.legs - count) + 1):
            last = first + count - 1
            chord = demands.points[[first - 1, last + 1]]
            away, _ = farthest_from_legs(demands.points[first : last + 1], chord)
            apart = math.dist(chord[0, :2], chord[1, :2]) > 0.0
            if away <= most and apart and not circles[first : last + 1].any() and _has_room(demands, first, last):
                return away
    return None


def _has_room(demands: RouteDemands, first: int, last: int) -> bool:
    """Whether the route without the waypoints first..last has room for the turns where it leaves them out."""
    # Two waypoints beyond the ends of the gap: what their turns take of the legs counts.
    start, stop = max(0, first - 4), min(len(demands.points), last + 5)
    near = _part(demands.setup.route, np.r_[start:first, last + 1 : stop])
    made = turn_demands(near, performance_tables(near, demands.limits))
    for new, old in ((first - 1 - start, first - 1), (first - start, last + 1)):
        if not 0 < old < demands.legs:
            continue
        limit, _ = tighter_turn(demands, old, float(made.limit[new]))
        if abs(float(made.turns[new])) > limit + PLAN_TOLERANCE:
            return False
    return True


def _part(route: Route, kept: NDArray[np.int64]) -> Route:
    """A route of some of its waypoints, each leg at the speed of the old one that begins where it does."""
    names = ("waypoints", "acceptance", "fly_over", "items", "arcs")
    return replace(route, airspeed=route.airspeed[kept[:-1]], **{name: getattr(route, name)[kept] for name in names})


def step(demands: RouteDemands, leg: int) -> float | None:
    """Height (m, positive) of the step that a leg beyond its slope limit is part of; None for one higher than `STEP`.

    All that is too steep on the whole, with this leg in it, is one step: a staircase is as high as its stairs together.
    """
    limit, _ = slope_limit(demands, leg)
    sign = 1.0 if demands.slopes[leg] >= 0.0 else -1.0
    rises = sign * np.diff(demands.points[:, 2])
    highest = float(rises[leg])
    for first in range(leg, max(-1, leg - JOG_WAYPOINTS), -1):
        for last in range(leg, min(demands.legs, leg + JOG_WAYPOINTS)):
            rise, run = float(rises[first : last + 1].sum()), float(demands.runs[first : last + 1].sum())
            if math.atan2(rise, run) > limit + PLAN_TOLERANCE:
                highest = max(highest, rise)
    return highest if highest <= STEP else None
