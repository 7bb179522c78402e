"""How near to a waypoint counts as having reached it, and how far from the legs a flight may go."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flight.guidance.navigation_error import ERRORS
from flight.mission.route import Route
from flight.simulation.setup import FlightSetup
from logs.verdict.measures.route_requirements import (
    RouteRequirements,
    performance_tables,
    slope_limit,
    tighter_turn,
    turn_requirements,
)
from logs.verdict.tolerances import (
    CLOSER,
    FLY_OVER_SWING_RATIO,
    KINK_SHARE,
    KINK_WAYPOINTS,
    NAVIGATION_SIGMAS,
    PASS,
    PLAN_TOLERANCE,
    STEP,
    SWING,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Reach:
    """What counts as having reached a waypoint.

    radius: m.
    source: "mission" for a stated acceptance radius, "autopilot" for that of the autopilot, "fly-over", or "fly-by
    path" for how near the path itself passes.
    tolerance: by how much the radius may be missed, m: navigation's error, and what gusts move an aircraft.
    """

    radius: float
    source: str
    tolerance: float


def reach(requirements: RouteRequirements, i: int) -> Reach:
    """What counts as having reached waypoint i: the mission's own radius, else that of whoever flies.

    ArduPlane turns to the next leg at WP_RADIUS from a right angle or a sharper corner and at a share of it from a
    gentler one, and at the mission's end, and where a return to launch begins, at all of it.
    """
    setup, own = requirements.setup, float(requirements.fly_by_offset[i]) + PASS
    stated = float(setup.route.acceptance[i])
    tolerance = position_error(setup) + CLOSER[setup.scenario.wind.turbulence]
    if stated > 0.0:
        return Reach(stated, "mission", tolerance)
    if not setup.autopilot.follows_path:
        inside = 0 < i < requirements.legs and i != setup.route.return_from
        turn = abs(float(requirements.turns[i])) if inside else math.pi
        return Reach(setup.autopilot.turn_distance(turn, float(requirements.points[i, 2])), "autopilot", tolerance)
    return Reach(own, "fly-over" if setup.route.fly_over[i] else "fly-by path", 0.0)


def position_error(setup: FlightSetup) -> float:
    """How far (m) the aircraft may be from where its autopilot takes it to be: three standard deviations of an axis."""
    return NAVIGATION_SIGMAS * ERRORS[setup.nav][0]


def corner_depths(requirements: RouteRequirements) -> Floats:
    """How far from the legs the turn at each waypoint leads by itself, (w,) m.

    A fly-by arc passes R (1 - cos(turn / 2)) inside the legs.  A fly-over waypoint is passed on the course of the leg
    before it, and the arc from there swings R (1 - cos(turn)) beyond the next leg.
    """
    turns = np.abs(requirements.turns)
    share = np.where(requirements.setup.route.fly_over, 1.0 - np.cos(turns), 1.0 - np.cos(0.5 * turns))
    return np.where(np.isfinite(requirements.radius), requirements.radius, 0.0) * share


def corridor_limit(requirements: RouteRequirements, leg: int) -> tuple[float, str]:
    """Half width of the corridor along a leg, m, and whose it is.

    A corridor that the scenario does not state is wide enough for the turns at the leg's ends, as they are planned; and
    at a loiter for all of its circle and a turn back beside it, where whoever flies joins and leaves that about its
    middle.
    """
    half = requirements.setup.corridor
    if requirements.setup.scenario.limits.corridor_m is not None:
        return half, "scenario"
    ends = slice(leg, leg + 2)
    depths = corner_depths(requirements)[ends]
    source = requirements.setup.source
    radius_is_known = source is None or source.aircraft_known
    if radius_is_known and not requirements.setup.autopilot.follows_path:
        # The autopilot may turn as late as at the waypoint.  Without a named aircraft the turn radius is a guess.
        radius = np.where(requirements.setup.route.arcs[ends] == 0.0, requirements.radius[ends], 0.0)
        swings = np.where(np.isfinite(radius), radius, 0.0) * (1.0 - np.cos(requirements.turns[ends]))
        depths = np.maximum(depths, FLY_OVER_SWING_RATIO * swings)
    turning = float(depths.max()) + PASS
    if requirements.setup.autopilot.loiter_rules.at_middle:
        arcs, tightest = requirements.setup.route.arcs[ends], requirements.tightest[ends]
        back = float(np.where(np.isfinite(tightest), tightest, 0.0).max())
        # A circle too tight for the bank leads as far as the bank limit makes it swing, whatever its radius.
        wide = float(arcs.max())
        across = wide + (SWING * back if wide < back else wide + back) + PASS
        if arcs.any() and across > max(turning, half):
            return across, "circle"
    if turning > half:
        return turning, "fly-by path"
    return half, "default" if requirements.setup.autopilot.follows_path else "autopilot"


def farthest_from_legs(points: Floats, legs: Floats) -> tuple[float, int]:
    """The greatest horizontal distance of some points from the nearest of some legs, m, and the row of that point.

    points: (n, 3).  legs: (k + 1, 3), the ends of k legs in a row.

    >>> legs = np.array([[0.0, 0.0, 0.0], [0.0, 100.0, 0.0], [100.0, 100.0, 0.0]])
    >>> farthest_from_legs(np.array([[5.0, 50.0, 0.0], [30.0, 60.0, 0.0], [50.0, 93.0, 0.0]]), legs)
    (30.0, 1)
    """
    nearest2 = np.full(len(points), math.inf)
    for start, end in zip(legs[:-1, :2], legs[1:, :2], strict=True):
        step, away = end - start, points[:, :2] - start
        along = np.clip(away @ step / max(float(step @ step), 1e-12), 0.0, 1.0)
        rest = away - along[:, None] * step
        nearest2 = np.minimum(nearest2, (rest * rest).sum(axis=1))
    row = int(np.argmax(nearest2))
    return math.sqrt(float(nearest2[row])), row


# ----------------------------------------------------------------------
# Corners and steps that no aircraft has to fly as they are drawn, because the way without them is as good as the same.
#
# A sidestep of a few metres has two right angles and no room for either; the straight way past it is within metres of
# both.  A step of a few metres in a level path is a cliff; a climb that begins a little early is within its height.


def negligible_kink(requirements: RouteRequirements, i: int) -> float | None:
    """How near (m) a flyable way passes a corner that is none itself; None where there is no such way.

    The way leaves out the waypoint and up to `KINK_WAYPOINTS` - 1 of its neighbours, passes each of them within
    `KINK_SHARE` of the corridor, and has room for the turns at its own ends.
    """
    most, circles = KINK_SHARE * requirements.setup.corridor, requirements.setup.route.arcs > 0.0
    for count in range(1, KINK_WAYPOINTS + 1):
        for first in range(max(1, i - count + 1), min(i, requirements.legs - count) + 1):
            last = first + count - 1
            chord = requirements.points[[first - 1, last + 1]]
            away, _ = farthest_from_legs(requirements.points[first : last + 1], chord)
            apart = math.dist(chord[0, :2], chord[1, :2]) > 0.0
            if away <= most and apart and not circles[first : last + 1].any() and _has_room(requirements, first, last):
                return away
    return None


def _has_room(requirements: RouteRequirements, first: int, last: int) -> bool:
    """Whether the route without the waypoints first..last has room for the turns where it leaves them out."""
    # Two waypoints beyond the ends of the gap: what their turns take of the legs counts.
    start, stop = max(0, first - 4), min(len(requirements.points), last + 5)
    near = _part(requirements.setup.route, np.r_[start:first, last + 1 : stop])
    made = turn_requirements(near, performance_tables(near, requirements.limits))
    for new, old in ((first - 1 - start, first - 1), (first - start, last + 1)):
        if not 0 < old < requirements.legs:
            continue
        limit, _ = tighter_turn(requirements, old, float(made.limit[new]))
        if abs(float(made.turns[new])) > limit + PLAN_TOLERANCE:
            return False
    return True


def _part(route: Route, kept: NDArray[np.int64]) -> Route:
    """A route of some of its waypoints, each leg at the speed of the old one that begins where it does."""
    names = ("waypoints", "acceptance", "fly_over", "items", "arcs", "above_ground")
    return replace(route, airspeed=route.airspeed[kept[:-1]], **{name: getattr(route, name)[kept] for name in names})


def step(requirements: RouteRequirements, leg: int) -> float | None:
    """Height (m, positive) of the step that a leg beyond its slope limit is part of; None for one higher than `STEP`.

    All that is too steep on the whole, with this leg in it, is one step: a staircase is as high as its stairs together.
    """
    limit, _ = slope_limit(requirements, leg)
    sign = 1.0 if requirements.slopes[leg] >= 0.0 else -1.0
    rises = sign * np.diff(requirements.points[:, 2])
    highest = float(rises[leg])
    for first in range(leg, max(-1, leg - KINK_WAYPOINTS), -1):
        for last in range(leg, min(requirements.legs, leg + KINK_WAYPOINTS)):
            rise, run = float(rises[first : last + 1].sum()), float(requirements.runs[first : last + 1].sum())
            if math.atan2(rise, run) > limit + PLAN_TOLERANCE:
                highest = max(highest, rise)
    return highest if highest <= STEP else None
