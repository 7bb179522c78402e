"""Straight lead-in and lead-out legs that give a route the courses its scenario asks for at its ends."""

import math
from dataclasses import replace

import numpy as np

from aircraft.path_limits import Limits
from flight.mission.route import Route
from world.geometry import leg_courses, wrap
from world.scenario import Scenario

# Length of these legs beyond what the turn itself uses, m: the aircraft is level and on course again by then.
END_LEG_LENGTH = 100.0
# An end within this of the scenario's is the scenario's, m.
_SAME = 1.0
# A course that differs by less than this needs no turn, rad.
_STRAIGHT = math.radians(0.5)


def with_end_courses(route: Route, scenario: Scenario, limits: Limits) -> Route:
    """Start a route on the scenario's start course, and end it on its destination course.

    A level lead-in leg before the first waypoint, or lead-out leg after the last, is as long as the turn's tangent and
    `END_LEG_LENGTH`: so the turn onto the first leg, or off the last, is flown and judged as any other.  A route whose
    scenario asks for no course, or that ends elsewhere, stays as it is.

    >>> from types import SimpleNamespace
    >>> from world.scenario import load_scenario
    >>> scenario = replace(load_scenario("tight"), start_course=0.0)  # north, and the route goes east
    >>> limits = SimpleNamespace(turn_radius=lambda *_: 110.0)  # all that is asked of the aircraft's limits
    >>> ends = np.array([scenario.start, scenario.destination])
    >>> route = Route(ends, np.array([25.0]), np.zeros(2), np.zeros(2, dtype=bool), np.array([1, 2]), "no TAKEOFF")
    >>> longer = with_end_courses(route, scenario, limits)
    >>> longer.waypoints.round().tolist()
    [[0.0, -210.0, 75.0], [0.0, 0.0, 75.0], [2600.0, 0.0, 75.0]]
    >>> longer.started
    "no TAKEOFF; on the scenario's start course, from a lead-in leg of 210 m"
    """
    points, courses = route.waypoints, leg_courses(route.waypoints)
    lead_in = lead_out = None
    if scenario.start_course is not None and math.dist(points[0], scenario.start) < _SAME:
        lead_in = _lead_point(points[0], scenario.start_course, float(courses[0]), limits, -1.0)
    if scenario.destination_course is not None and math.dist(points[-1], scenario.destination) < _SAME:
        lead_out = _lead_point(points[-1], scenario.destination_course, float(courses[-1]), limits, 1.0)
    head = 0 if lead_in is None else 1
    tail = 0 if lead_out is None else 1
    if not head + tail:
        return route
    started = route.started
    if lead_in is not None:
        length = math.dist(lead_in[:2], points[0][:2])
        started += f"; on the scenario's start course, from a lead-in leg of {length:.0f} m"
    # Radii at the ends of the mission say nothing of turns that it does not have.
    acceptance = np.array(route.acceptance)
    acceptance[:head], acceptance[len(acceptance) - tail :] = 0.0, 0.0
    chain = [point for point in (lead_in, *points, lead_out) if point is not None]
    return replace(
        route,
        waypoints=np.array(chain),
        airspeed=np.pad(route.airspeed, (head, tail), mode="edge"),
        acceptance=np.pad(acceptance, (head, tail)),
        fly_over=np.pad(route.fly_over, (head, tail), mode="edge"),
        items=np.pad(route.items, (head, tail), constant_values=-1),
        arcs=np.pad(route.arcs, (head, tail)),
        started=started,
    )


def _lead_point(point: np.ndarray, course: float, leg: float, limits: Limits, side: float) -> np.ndarray | None:
    """Other end of the lead-in (side -1) or lead-out leg (side 1) at an end of the route; None where no turn is due.

    point: (3,) m.  course: that the scenario asks for; leg: of the route's first or last leg, rad.
    """
    turn = abs(float(wrap(course - leg)))
    if turn < _STRAIGHT:
        return None
    radius = limits.turn_radius(*((course, leg) if side < 0.0 else (leg, course)), float(point[2]))
    # A reversal has no tangent; twice the radius shows it as the sharp corner that it is.
    tangent_length = radius * min(math.tan(min(turn, math.radians(170.0)) / 2.0), 2.0)
    step = side * ((tangent_length if math.isfinite(tangent_length) else 0.0) + END_LEG_LENGTH)
    return point + step * np.array([math.sin(course), math.cos(course), 0.0])
