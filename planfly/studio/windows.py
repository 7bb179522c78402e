"""The geometric verdict on the legs and corners about a moved item: the same as the whole one's, at any length.

A part of the route is judged that reaches beyond what a move can change, with the threats and zones that it enters.
What is asked of the whole flight, energy, stall and bounds, waits for the whole verdict.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from flight.mission.items import Mission
from flight.mission.route import Route, part_of_route
from flight.mission.surveys import camera_spacing
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding
from logs.verdict.judge_geometry import place_findings
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from planfly.studio.desk import Desk
from planfly.studio.moved_route import moved_route
from world.geometry import leg_runs

# What a move can change reaches so far along the legs, m, and over so many of them; as much again is judged around it
# and left out, because its end is not the route's.
REACH, LEGS = 450.0, 4
# A route that passes an item more often is judged as a whole.
_MOST_PASSES = 6
# Between the places beyond a part's end, m.
_APART = 3_000.0


@dataclass(frozen=True, slots=True)
class Window:
    """Judged legs and corners of a route.

    first, last: waypoints of the route between which legs and corners are judged, both included.
    begin: the waypoint of the whole route that the part's first has the number of.
    requirements, findings: of the part, which counts from ``begin``.
    """

    first: int
    last: int
    begin: int
    requirements: RouteRequirements
    findings: tuple[Finding, ...]


def judge_windows(
    desk: Desk, mission: Mission, index: int, before: FlightSetup | None = None
) -> tuple[Route, tuple[Window, ...]]:
    """The windows about an item of a mission, and the route; one of all where that is as quick, or has to be judged.

    index: of the item in the mission's list.  before: of the mission in which it was not moved yet, if that is known.
    Raises MissionError for a mission that cannot be laid out.
    """
    route = None
    if before is not None:
        route = moved_route(before.route, before.mission, mission, desk.scenario, desk.airframe)
    if route is None:
        route = desk.route(mission)
    spans = None if _may_survey(desk, mission, route) else _spans(route, mission.items[index].seq)
    if spans is None:
        return route, (_judged(desk.part(mission, route), 0, route.legs, 0),)
    windows = []
    for first, last in spans:
        begin, end = _grown(route, first, last)
        part = part_of_route(route, begin, end)
        ahead = end == route.legs
        if begin or not ahead:
            part, added = _with_fastest(desk, route, part, ahead=ahead)
            begin -= added
        windows.append(_judged(desk.part(mission, part), first, last, begin))
    return route, tuple(windows)


def _may_survey(desk: Desk, mission: Mission, route: Route) -> bool:
    """Whether there may be surveys, whose lines are found from all of the route."""
    return desk.scenario.limits.surveys == "lines" or bool(camera_spacing(mission, route).any())


def _with_fastest(desk: Desk, route: Route, part: Route, *, ahead: bool) -> tuple[Route, int]:
    """A part of a route with what is fastest of the whole beyond its end, and how many waypoints that adds before it.

    How long a change of slope takes is reckoned all along a route by its highest airspeeds and its strongest wind: legs
    at these, straight on beyond the end that is not the route's own, have them counted in the part.
    ahead: whether they come before the part, whose end is the route's.
    """
    up, wind = route.waypoints[:, 2], desk.scenario.wind
    middle = 0.5 * (up[1:] + up[:-1])
    true = route.airspeed * np.array([_speed_factor(desk, float(one)) for one in middle])
    legs = list(dict.fromkeys([int(np.argmax(route.airspeed)), int(np.argmax(true))]))
    windy = float(max(dict.fromkeys(up.tolist()), key=lambda one: float(np.hypot(*wind.at(one)))))
    heights = np.array([windy, *(middle[leg] for leg in legs for _ in range(2))])
    speeds = np.array([speed for leg in legs for speed in (route.airspeed[leg], route.airspeed[leg])])
    count = len(heights)
    end, beside = (0, 1) if ahead else (-1, -2)
    way = part.waypoints[end, :2] - part.waypoints[beside, :2]
    if not way.any():
        way = np.array([0.0, 1.0])
    steps = _APART * np.arange(1.0, count + 1.0)[:, None] * way / float(np.hypot(*way))
    points = np.column_stack([part.waypoints[end, :2] + steps, heights])
    # The first of them joins the part at the airspeed there; each pair of heights has its leg's airspeed between.
    onward = np.concatenate([part.airspeed[end : end + 1 or None], speeds])
    order = slice(None, None, -1) if ahead else slice(None)

    def joined(mine: np.ndarray, more: np.ndarray) -> np.ndarray:
        return np.concatenate([more[order], mine] if ahead else [mine, more])

    stops = part.stops.max() + 1 + np.arange(count)
    made = replace(
        part,
        waypoints=joined(part.waypoints, points),
        airspeed=joined(part.airspeed, onward),
        acceptance=joined(part.acceptance, np.zeros(count)),
        fly_over=joined(part.fly_over, np.zeros(count, dtype=np.bool_)),
        items=joined(part.items, np.full(count, -1)),
        arcs=joined(part.arcs, np.zeros(count)),
        above_ground=joined(part.above_ground, np.full(count, np.nan)),
        stops=np.concatenate([np.arange(count), part.stops + count]) if ahead else joined(part.stops, stops),
    )
    return made, count if ahead else 0


def _speed_factor(desk: Desk, amsl: float) -> float:
    """True airspeed by the airspeed that is commanded at a height."""
    autopilot = desk.airframe.autopilot
    return autopilot.airspeed_factor(amsl) if autopilot.equivalent_airspeeds else 1.0


def _judged(setup: FlightSetup, first: int, last: int, begin: int) -> Window:
    requirements = replace(route_requirements(setup), zones_on=(first - begin, last - begin - 1))
    findings = tuple(item for item in place_findings(requirements) if _within(item, first - begin, last - begin))
    return Window(first, last, begin, requirements, findings)


def _within(item: Finding, first: int, last: int) -> bool:
    """Whether a finding is of a leg or a corner between two waypoints, or of a threat or zone that is violated.

    A corner at either end counts.
    """
    place = item.place
    if item.ok is False and place.kind in ("missile", "exclusion", "inclusion"):
        return True
    if place.index is None or place.kind not in ("leg", "waypoint"):
        return False
    return first <= place.index < last + (place.kind == "waypoint")


def _spans(route: Route, seq: int) -> list[tuple[int, int]] | None:
    """First and last waypoint of what a move of an item may change, merged where they meet; None for the whole.

    Landing sequences and returns are found from where the route is.
    """
    own = np.flatnonzero(route.items == seq)
    if not len(own) or route.return_from >= 0 or route.straight_to >= 0:
        return None
    spans: list[tuple[int, int]] = []
    for first, last in _runs(own):
        span = _grown(route, first, last)
        if spans and span[0] <= spans[-1][1] + 2 * LEGS:
            span = spans.pop()[0], span[1]
        spans.append(span)
    judged = sum(last - first + 2 * LEGS for first, last in spans)
    return None if len(spans) > _MOST_PASSES or judged >= route.legs else spans


def _runs(own: np.ndarray) -> Iterator[tuple[int, int]]:
    """First and last of each row of numbers without a gap."""
    for run in np.split(own, np.flatnonzero(np.diff(own) > 1) + 1):
        yield int(run[0]), int(run[-1])


def _grown(route: Route, first: int, last: int) -> tuple[int, int]:
    """Waypoints at least `REACH` and `LEGS` further on either side; no circle is cut."""
    along = np.concatenate([[0.0], np.cumsum(leg_runs(route.waypoints))])
    begin = min(first - LEGS, int(np.searchsorted(along, along[first] - REACH, side="right")) - 1)
    end = max(last + LEGS, int(np.searchsorted(along, along[last] + REACH)))
    begin, end = max(0, begin), min(route.legs, end)
    while begin and (route.stops[begin] == route.stops[begin - 1] or route.arcs[begin]):
        begin -= 1
    while end < route.legs and (route.stops[end] == route.stops[end + 1] or route.arcs[end]):
        end += 1
    return begin, end
