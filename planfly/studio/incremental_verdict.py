"""Judge the geometry of the legs and corners near a moved item, with the same result as for the whole route.

The judged part of the route covers everything that a move can change, with the threats and zones that it enters.
Requirements on the whole flight, such as energy, stall and bounds, are left to the whole verdict.
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
from planfly.studio.edit_context import EditContext
from planfly.studio.moved_route import moved_route
from world.geometry import leg_runs

# Distance along the legs within which a move can change the verdict, m.  The route is judged for twice this distance,
# and the outer half is discarded, because the end of the part is not the end of the route.
REACH = 450.0
# Minimum number of legs within which a move can change the verdict.
LEGS = 4
# Maximum number of times that a route may pass an item; if it passes more often, the whole route is judged.
_MAX_PASSES = 6
# Length of the legs appended beyond the end of a part, m.
_APPENDED_LEG_LENGTH_M = 3_000.0


@dataclass(frozen=True, slots=True)
class Window:
    """Judged legs and corners of a route.

    first, last: waypoints of the route between which legs and corners are judged, both included.
    begin: the waypoint of the whole route at which the part starts.
    requirements, findings: results for the part, whose numbers start at ``begin``.
    """

    first: int
    last: int
    begin: int
    requirements: RouteRequirements
    findings: tuple[Finding, ...]


def judge_windows(
    desk: EditContext, mission: Mission, index: int, before: FlightSetup | None = None
) -> tuple[Route, tuple[Window, ...]]:
    """Judge windows around an item, or the whole route if this is necessary or no slower.

    Returns the route and the windows.

    index: index of the item in the mission's list.
    before: setup before the move, if known.
    Raises MissionError for a mission without a valid route.
    """
    route = None
    if before is not None:
        route = moved_route(before.route, before.mission, mission, desk.scenario, desk.airframe)
    if route is None:
        route = desk.route(mission)
    spans = None if _may_survey(desk, mission, route) else _affected_spans(route, mission.items[index].seq)
    if spans is None:
        return route, (_judge_window(desk.part(mission, route), 0, route.legs, 0),)
    windows = []
    for first, last in spans:
        begin, end = _grown_span(route, first, last)
        part = part_of_route(route, begin, end)
        ahead = end == route.legs
        if begin or not ahead:
            part, added = _with_extreme_legs(desk, route, part, ahead=ahead)
            begin -= added
        windows.append(_judge_window(desk.part(mission, part), first, last, begin))
    return route, tuple(windows)


def _may_survey(desk: EditContext, mission: Mission, route: Route) -> bool:
    """Return True if the mission may contain surveys, whose lines are found from the whole route."""
    return desk.scenario.limits.surveys == "lines" or bool(camera_spacing(mission, route).any())


def _with_extreme_legs(desk: EditContext, route: Route, part: Route, *, ahead: bool) -> tuple[Route, int]:
    """Add the fastest legs of the whole route to a part; return the extended part and the number of legs before it.

    The duration of a change of slope is computed from the highest airspeeds and the strongest wind of a whole route.
    Legs with these values are therefore added straight on beyond that end of the part that is not an end of the route.

    ahead: True to put the legs before the part, whose end is the end of the route.
    """
    up, wind = route.waypoints[:, 2], desk.scenario.wind
    middle = 0.5 * (up[1:] + up[:-1])
    true = route.airspeed * np.array([_speed_factor(desk, float(one)) for one in middle])
    legs = list(dict.fromkeys([int(np.argmax(route.airspeed)), int(np.argmax(true))]))
    windy = float(max(dict.fromkeys(up.tolist()), key=lambda one: float(np.hypot(*wind.at(one)))))
    heights = np.array([windy, *(middle[leg] for leg in legs for _ in range(2))])
    speeds = np.array([speed for leg in legs for speed in (route.airspeed[leg], route.airspeed[leg])])
    count = len(heights)
    end, neighbour = (0, 1) if ahead else (-1, -2)
    direction = part.waypoints[end, :2] - part.waypoints[neighbour, :2]
    if not direction.any():
        direction = np.array([0.0, 1.0])
    steps = _APPENDED_LEG_LENGTH_M * np.arange(1.0, count + 1.0)[:, None] * direction / float(np.hypot(*direction))
    points = np.column_stack([part.waypoints[end, :2] + steps, heights])
    # The first appended leg keeps the airspeed at the end of the part.  Each further leg has the airspeed for the pair
    # of altitudes at its ends.
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


def _speed_factor(desk: EditContext, amsl: float) -> float:
    """Return the ratio of true airspeed to commanded airspeed at an altitude."""
    autopilot = desk.airframe.autopilot
    return autopilot.airspeed_factor(amsl) if autopilot.equivalent_airspeeds else 1.0


def _judge_window(setup: FlightSetup, first: int, last: int, begin: int) -> Window:
    requirements = replace(route_requirements(setup), zone_check_legs=(first - begin, last - begin - 1))
    findings = tuple(item for item in place_findings(requirements) if _is_within(item, first - begin, last - begin))
    return Window(first, last, begin, requirements, findings)


def _is_within(item: Finding, first: int, last: int) -> bool:
    """Return True for a finding on a leg or corner from `first` to `last`, or on a violated threat or zone."""
    place = item.place
    if item.ok is False and place.kind in ("missile", "exclusion", "inclusion"):
        return True
    if place.index is None or place.kind not in ("leg", "waypoint"):
        return False
    return first <= place.index < last + (place.kind == "waypoint")


def _affected_spans(route: Route, seq: int) -> list[tuple[int, int]] | None:
    """Return the spans of waypoints that a move of an item may change, as (first, last), or None for the whole route.

    Overlapping spans are merged.  Landing sequences and returns depend on the whole route.
    """
    own = np.flatnonzero(route.items == seq)
    if not len(own) or route.return_from >= 0 or route.straight_to >= 0:
        return None
    spans: list[tuple[int, int]] = []
    for first, last in _consecutive_runs(own):
        span = _grown_span(route, first, last)
        if spans and span[0] <= spans[-1][1] + 2 * LEGS:
            span = spans.pop()[0], span[1]
        spans.append(span)
    judged = sum(last - first + 2 * LEGS for first, last in spans)
    return None if len(spans) > _MAX_PASSES or judged >= route.legs else spans


def _consecutive_runs(own: np.ndarray) -> Iterator[tuple[int, int]]:
    """Yield the first and the last number of each run of consecutive numbers."""
    for run in np.split(own, np.flatnonzero(np.diff(own) > 1) + 1):
        yield int(run[0]), int(run[-1])


def _grown_span(route: Route, first: int, last: int) -> tuple[int, int]:
    """Return a span extended by at least `REACH` and `LEGS` on both sides, without cutting a loiter."""
    along = np.concatenate([[0.0], np.cumsum(leg_runs(route.waypoints))])
    begin = min(first - LEGS, int(np.searchsorted(along, along[first] - REACH, side="right")) - 1)
    end = max(last + LEGS, int(np.searchsorted(along, along[last] + REACH)))
    begin, end = max(0, begin), min(route.legs, end)
    while begin and (route.stops[begin] == route.stops[begin - 1] or route.arcs[begin]):
        begin -= 1
    while end < route.legs and (route.stops[end] == route.stops[end + 1] or route.arcs[end]):
        end += 1
    return begin, end
