"""Judge the geometry of the legs and corners near a moved item.

The result is the same as for the whole route.

A window is a judged part of the route.

The judged part of the route covers all legs and corners that a move can change, and the threats and zones entered
there. Requirements on the whole flight, such as energy, stall and bounds, are judged only with the whole route.
"""

from dataclasses import dataclass, replace

import numpy as np

from flight.mission.items import Mission
from flight.mission.route import Route, part_of_route, route_points
from flight.mission.surveys import camera_spacing
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.rules.registry import run_rules
from planfly.studio.edit_context import EditContext
from planfly.studio.moved_route import update_moved_route
from world.geometry import leg_runs

# Distance along the legs within which the move of an item can change the verdict, m.  The route is judged for twice
# this distance, and the outer half is discarded, because the end of the judged part is not the end of the route.
MOVE_REACH_M = 450.0
# Minimum number of legs within which a move can change the verdict.
MOVE_REACH_LEGS = 4
# Maximum number of times that a route may pass an item; if it passes more often, the whole route is judged.
_MAX_PASSES = 6
# Length of the legs appended beyond the end of a part, m.
_APPENDED_LEG_LENGTH_M = 3_000.0


@dataclass(frozen=True, slots=True)
class Window:
    """A judged part of a route, near a moved item.

    first, last: first and last waypoint of the legs and corners with a result, as numbers in the whole route.
    start: number of the waypoint at which the part starts; it starts before `first`.
    requirements, findings: results for the part; their leg and corner numbers are relative to ``start``.
    """

    first: int
    last: int
    start: int
    requirements: RouteRequirements
    findings: tuple[Finding, ...]


def judge_windows(
    context: EditContext, mission: Mission, index: int, previous_setup: FlightSetup | None = None
) -> tuple[Route, tuple[Window, ...]]:
    """Judge the parts of a mission's route near a moved item.

    Return the whole route and the judged parts (windows).

    The whole route is judged as one part if the move may change all of it, if it may contain surveys, or if the parts
    together would be as long as the route.

    index: index of the moved item in the mission's list.
    previous_setup: setup before the move, from whose route the new route is updated; None if unknown.
    Raises MissionError for a mission without a valid route.
    """
    route = None
    if previous_setup is not None:
        route = update_moved_route(
            previous_setup.route,
            previous_setup.mission,
            mission,
            context.scenario,
            context.uav_for_mission(mission),
        )
    if route is None:
        route = context.route(mission)
    rows = np.flatnonzero(route.items == mission.items[index].seq)
    # The lines of a survey are found from the whole route; landing sequences and returns depend on the whole route.
    may_contain_survey = context.scenario.limits.surveys == "lines" or bool(camera_spacing(mission, route).any())
    has_returns = route.rtl_start is not None or route.direct_landing_start is not None
    is_whole = may_contain_survey or has_returns or not len(rows)
    # First and last waypoint of each span that the move may change: a span around each run of consecutive waypoints.
    # Overlapping spans are merged.
    spans: list[tuple[int, int]] = []
    if not is_whole:
        for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
            span = _extend_span(route, int(run[0]), int(run[-1]))
            if spans and span[0] <= spans[-1][1] + 2 * MOVE_REACH_LEGS:
                span = spans.pop()[0], span[1]
            spans.append(span)
        judged_legs = sum(last - first + 2 * MOVE_REACH_LEGS for first, last in spans)
        is_whole = len(spans) > _MAX_PASSES or judged_legs >= route.legs
    if is_whole:
        return route, (_judge_window(context.part_setup(mission, route), 0, route.legs, 0),)
    windows = []
    for first, last in spans:
        start, end = _extend_span(route, first, last)
        part = part_of_route(route, start, end)
        reaches_route_end = end == route.legs
        if start or not reaches_route_end:
            part, added_count = _add_extreme_legs(context, route, part, before_part=reaches_route_end)
            start -= added_count
        windows.append(_judge_window(context.part_setup(mission, part), first, last, start))
    return route, tuple(windows)


def _add_extreme_legs(context: EditContext, route: Route, part: Route, *, before_part: bool) -> tuple[Route, int]:
    """Extend a part of a route by the legs with the most extreme conditions of the whole route.

    These are the highest airspeeds and the strongest wind.

    Returns the extended part, and the number of waypoints added before the part.

    The judged duration of a change of slope depends on the highest airspeeds and the strongest wind of the whole route.
    Legs with these values are therefore added in a straight line at the part's end that is inside the route.

    before_part: True to add the legs before the part, because the part ends at the end of the route.
    """
    altitudes, wind = route.positions[:, 2], context.scenario.wind
    leg_altitudes = 0.5 * (altitudes[1:] + altitudes[:-1])
    speeds = context.uav.autopilot.speeds
    true_airspeed = route.leg_airspeeds * np.array(
        [speeds.true_airspeed_factor(altitude) if speeds.equivalent else 1.0 for altitude in leg_altitudes.tolist()]
    )
    legs = list(dict.fromkeys([int(np.argmax(route.leg_airspeeds)), int(np.argmax(true_airspeed))]))
    windiest_altitude = float(
        max(dict.fromkeys(altitudes.tolist()), key=lambda altitude: float(np.hypot(*wind.velocity_at(altitude))))
    )
    added_altitudes = np.array([windiest_altitude, *(leg_altitudes[leg] for leg in legs for _ in range(2))])
    leg_airspeeds = np.array([speed for leg in legs for speed in (route.leg_airspeeds[leg], route.leg_airspeeds[leg])])
    count = len(added_altitudes)
    end, neighbour = (0, 1) if before_part else (-1, -2)
    direction = part.positions[end, :2] - part.positions[neighbour, :2]
    if not direction.any():
        direction = np.array([0.0, 1.0])
    steps = _APPENDED_LEG_LENGTH_M * np.arange(1.0, count + 1.0)[:, None] * direction / float(np.hypot(*direction))
    positions = np.column_stack([part.positions[end, :2] + steps, added_altitudes])
    # The first appended leg keeps the airspeed at the end of the part.  Each further leg has the airspeed for the pair
    # of altitudes at its ends.
    added_airspeeds = np.concatenate([part.leg_airspeeds[end : end + 1 or None], leg_airspeeds])
    if before_part:
        added_points = route_points(positions[::-1], added_airspeeds[:0:-1], stop=np.arange(count))
        points = np.concatenate([added_points, part.points])
        points["airspeed"][count], points["stop"][count:] = added_airspeeds[0], part.stops + count
    else:
        stops = part.stops.max() + 1 + np.arange(count)
        added_points = route_points(positions, added_airspeeds[1:], stop=stops)
        added_points["airspeed"][0] = added_airspeeds[0]
        points = np.concatenate([part.points, added_points])
    return replace(part, points=points), count if before_part else 0


def _judge_window(setup: FlightSetup, first: int, last: int, start: int) -> Window:
    """Judge the legs and corners between two waypoints of a route.

    setup: setup of a part of the route that contains these waypoints.
    first, last: numbers of the two waypoints in the whole route.
    start: number of the part's first waypoint in the whole route.
    """
    requirements = replace(route_requirements(setup), zone_check_legs=(first - start, last - start - 1))
    findings = []
    for finding in run_rules(requirements, None, geometric=True, includes_whole_flight=False):
        # Findings on a leg or corner of the window, or on any violated threat or zone.
        place = finding.place
        is_violation = finding.ok is False and place.kind in ("missile", "exclusion", "inclusion")
        is_in_window = (
            place.kind in ("leg", "waypoint")
            and place.index is not None
            and first <= place.index + start < last + (place.kind == "waypoint")
        )
        if is_violation or is_in_window:
            findings.append(finding)
    return Window(first, last, start, requirements, tuple(findings))


def _extend_span(route: Route, first: int, last: int) -> tuple[int, int]:
    """Return first and last waypoint of a span extended to both sides.

    It is extended by at least `MOVE_REACH_M` and `MOVE_REACH_LEGS`.

    The extension ends at the ends of the route.  A loiter is included completely or not at all.

    first, last: first and last waypoint of the span before the extension.
    """
    distance = np.concatenate([[0.0], np.cumsum(leg_runs(route.positions))])
    start = min(
        first - MOVE_REACH_LEGS, int(np.searchsorted(distance, distance[first] - MOVE_REACH_M, side="right")) - 1
    )
    end = max(last + MOVE_REACH_LEGS, int(np.searchsorted(distance, distance[last] + MOVE_REACH_M)))
    start, end = max(0, start), min(route.legs, end)
    while start and (route.stops[start] == route.stops[start - 1] or route.arc_radii[start]):
        start -= 1
    while end < route.legs and (route.stops[end] == route.stops[end + 1] or route.arc_radii[end]):
        end += 1
    return start, end
