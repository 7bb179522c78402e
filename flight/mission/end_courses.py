"""Straight run-in and run-out that give a route the courses its scenario asks for at its ends."""

import math
from dataclasses import replace

import numpy as np

from aircraft.path_limits import Limits
from flight.mission.route import Route
from world.geometry import leg_courses, wrap
from world.scenario import Scenario

# Beyond what the turn itself uses, m: room to settle.
SETTLE = 100.0
# An end within this of the scenario's is the scenario's, m.
_SAME = 1.0
# A course that differs by less than this needs no turn, rad.
_STRAIGHT = math.radians(0.5)


def with_end_courses(route: Route, scenario: Scenario, limits: Limits) -> Route:
    """Start a route on the scenario's start course, and end it on its destination course.

    A level run-in before the first waypoint, or run-out after the last, as long as the turn and `SETTLE` need: so the
    turn onto the first leg, or off the last, is flown and judged as any other.  Other routes stay as they are.
    """
    points, courses = route.waypoints, leg_courses(route.waypoints)
    before = after = None
    if scenario.start_course is not None and math.dist(points[0], scenario.start) < _SAME:
        before = _end(points[0], scenario.start_course, float(courses[0]), limits, -1.0)
    if scenario.destination_course is not None and math.dist(points[-1], scenario.destination) < _SAME:
        after = _end(points[-1], scenario.destination_course, float(courses[-1]), limits, 1.0)
    head = 0 if before is None else 1
    tail = 0 if after is None else 1
    if not head + tail:
        return route
    started = route.started
    if before is not None:
        length = math.dist(before[:2], points[0][:2])
        started += f"; on the scenario's start course, from a run-in of {length:.0f} m"
    chain = [point for point in (before, *points, after) if point is not None]
    return replace(
        route,
        waypoints=np.array(chain),
        airspeed=np.pad(route.airspeed, (head, tail), mode="edge"),
        acceptance=np.pad(route.acceptance, (head, tail)),
        fly_over=np.pad(route.fly_over, (head, tail), mode="edge"),
        items=np.pad(route.items, (head, tail), constant_values=-1),
        arcs=np.pad(route.arcs, (head, tail)),
        started=started,
    )


def _end(point: np.ndarray, course: float, leg: float, limits: Limits, side: float) -> np.ndarray | None:
    turn = abs(float(wrap(course - leg)))
    if turn < _STRAIGHT:
        return None
    radius = limits.turn_radius(*((course, leg) if side < 0.0 else (leg, course)), float(point[2]))
    # A reversal has no tangent; twice the radius shows it as the sharp corner that it is.
    reach = radius * min(math.tan(min(turn, math.radians(170.0)) / 2.0), 2.0)
    step = side * ((reach if math.isfinite(reach) else 0.0) + SETTLE)
    return point + step * np.array([math.sin(course), math.cos(course), 0.0])
