"""How near to a waypoint counts as having reached it, and how far from the legs a flight may go."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight.ardupilot.lateral_law import turn_distance
from flight.ardupilot.pilot import true_by_equivalent
from flight.guidance.navigation_error import ERRORS
from flight.simulation.flight_setup import FlightSetup
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.tolerances import CLOSER, NAVIGATION_SIGMAS, PASS

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


def reach(demands: RouteDemands, i: int) -> Reach:
    """What counts as having reached waypoint i: the mission's own radius, else that of whoever flies.

    ArduPlane turns to the next leg at WP_RADIUS from a right angle or a sharper corner and at a share of it from a
    gentler one, and at the mission's end at all of it.
    """
    setup, own = demands.setup, float(demands.fly_by_offset[i]) + PASS
    stated = float(setup.route.acceptance[i])
    tolerance = position_error(setup) + CLOSER[setup.scenario.wind.turbulence]
    if stated > 0.0:
        return Reach(stated, "mission", tolerance)
    if setup.parameters is not None:
        factor = float(true_by_equivalent(float(demands.points[i, 2])))
        turn = abs(float(demands.turns[i])) if 0 < i < demands.legs else math.pi
        return Reach(
            float(turn_distance(0.0, turn, setup.parameters.wp_radius, math.inf, factor)), "autopilot", tolerance
        )
    return Reach(own, "fly-over" if setup.route.fly_over[i] else "fly-by path", 0.0)


def position_error(setup: FlightSetup) -> float:
    """How far (m) the aircraft may be from where its autopilot takes it to be: three standard deviations of an axis."""
    return NAVIGATION_SIGMAS * ERRORS[setup.nav][0]


def corner_depths(demands: RouteDemands) -> Floats:
    """How far from the legs the turn at each waypoint leads by itself, (w,) m.

    A fly-by arc passes R (1 - cos(turn / 2)) inside the legs.  A fly-over waypoint is passed on the course of the leg
    before it, and the arc from there swings R (1 - cos(turn)) beyond the next leg.
    """
    turns = np.abs(demands.turns)
    share = np.where(demands.setup.route.fly_over, 1.0 - np.cos(turns), 1.0 - np.cos(0.5 * turns))
    return np.where(np.isfinite(demands.radius), demands.radius, 0.0) * share


def corridor_limit(demands: RouteDemands, leg: int) -> tuple[float, str]:
    """Half width of the corridor along a leg, m, and whose it is.

    A corridor that the scenario does not state is wide enough for the turns at the leg's ends, as they are planned.
    """
    half = demands.setup.corridor
    if demands.setup.scenario.limits.corridor_m is not None:
        return half, "scenario"
    turning = float(corner_depths(demands)[leg : leg + 2].max()) + PASS
    if turning > half:
        return turning, "fly-by path"
    return half, "default" if demands.setup.parameters is None else "autopilot"


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
