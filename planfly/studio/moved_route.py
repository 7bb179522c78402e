"""Update the route of a mission after a few waypoints were moved, by replacing rows of the previous route.

Laying out all items of a long mission takes longer than judging the legs around one item.
"""

import math
from dataclasses import replace

import numpy as np

from flight.mission.items import AMSL, OVER_HOME, OVER_TERRAIN, PLACES, Command, Mission, MissionItem
from flight.mission.placing import HIGHEST, LOWEST
from flight.mission.route import Route, fly_over_waypoints
from planfly.workflow.airframe import Airframe
from world.arrays import Floats
from world.frames import to_map
from world.scenario import Scenario
from world.scenario_tables import MAP_EXTENT

# Maximum number of items that a drag changes.
_MAX_MOVED_ITEMS = 8
# Distance between successive waypoints below which they may be merged, or offset from each other, m.
_MERGE_DISTANCE_M = 2.0
# Tolerance between a place computed alone and in an array, m, because the last digits of a sine differ.
_PLACE_TOLERANCE_M = 1e-6
# Commands because of which a place of a mission may not correspond to exactly one row of the route.
_IRREGULAR_COMMANDS = frozenset(
    {Command.DO_JUMP, Command.DO_JUMP_TAG, Command.DO_SET_HOME, Command.CONDITION_GATE, Command.NAV_RETURN_TO_LAUNCH}
)


def moved_route(route: Route, before: Mission, now: Mission, scenario: Scenario, frame: Airframe) -> Route | None:
    """Return the route after a few waypoints were moved, or None if it has to be laid out again.

    It has to be laid out again if a move may change more than the row of the waypoint.  This is so next to loiters,
    merged places and kept altitudes, and with jumps, gates, returns, landings and courses at the ends.

    route: route of the previous mission.
    """
    if len(before.items) != len(now.items):
        return None
    pairs = [(old, new) for old, new in zip(before.items, now.items, strict=True) if old is not new]
    if (
        len(pairs) > _MAX_MOVED_ITEMS
        or not all(_is_move_of_waypoint(*pair) for pair in pairs)
        or not _is_plain(route, now, scenario)
    ):
        return None
    rows = {seq: row for row, seq in enumerate(route.items.tolist())}
    waypoints = {one.seq for one in now.items if one.command == Command.NAV_WAYPOINT}
    rules = frame.autopilot.route_rules
    points, acceptance, changed = np.array(route.waypoints), np.array(route.acceptance), set[int]()
    for old, new in pairs:
        row, was, place = rows[new.seq], _map_place(old, before, scenario), _map_place(new, now, scenario)
        neighbours = [k for k in (row - 1, row + 1) if 0 <= k <= route.legs]
        if was is None or place is None or math.dist(was, points[row]) > _PLACE_TOLERANCE_M:
            return None
        if any(int(route.items[k]) not in waypoints or route.arcs[k] for k in neighbours):
            return None
        points[row], acceptance[row] = place, min(max(0.0, new.params[1]), rules.acceptance_limit)
        changed |= {row, *neighbours}
    if any(_is_near(one, k) for one in (points, route.waypoints) for k in changed if k):
        return None
    over = fly_over_waypoints(points, route.airspeed, acceptance, frame.limits, rules.turn_distance)
    fly_over = np.where(route.arcs > 0.0, False, scenario.flight.fly_over | over)
    return replace(route, waypoints=points, acceptance=acceptance, fly_over=fly_over)


def _is_move_of_waypoint(old: MissionItem, new: MissionItem) -> bool:
    """Return True if a waypoint differs only in its place and its acceptance radius."""
    params = (*old.params[:1], new.params[1], *old.params[2:])
    same = replace(old, lat_deg=new.lat_deg, lon_deg=new.lon_deg, alt=new.alt, params=params) == new
    return same and new.command == Command.NAV_WAYPOINT and old.has_position and new.has_position


def _is_plain(route: Route, mission: Mission, scenario: Scenario) -> bool:
    """Return True if each place of a mission is one stop of its route, with an altitude independent of other places."""
    if route.return_from >= 0 or route.straight_to >= 0 or math.isfinite(route.landing_ground):
        return False
    if scenario.start_course is not None or scenario.destination_course is not None:
        return False
    flown = set(route.items.tolist())
    return not any(
        one.command in _IRREGULAR_COMMANDS or (one.command in PLACES and (one.seq not in flown or math.isnan(one.alt)))
        for one in mission.items
    )


def _map_place(item: MissionItem, mission: Mission, scenario: Scenario) -> tuple[float, float, float] | None:
    """Return east, north and altitude of a waypoint, m, or None if it depends on other items or is off the map."""
    x, y = to_map(scenario.origin, [item.lat_deg], [item.lon_deg])
    east, north, home, up = float(x[0]), float(y[0]), mission.home, math.nan
    if item.frame in AMSL:
        up = item.alt
    elif item.frame in OVER_HOME and home is not None:
        up = home.alt + item.alt
    elif item.frame in OVER_TERRAIN and scenario.terrain is not None:
        up = float(scenario.terrain.height(east, north)) + item.alt
    known = LOWEST <= up <= HIGHEST and max(abs(east), abs(north)) <= MAP_EXTENT
    return (east, north, up) if known else None


def _is_near(points: Floats, row: int) -> bool:
    """Return True if a waypoint is so near to the previous one that both may be merged."""
    return math.dist(points[row - 1, :2], points[row, :2]) < _MERGE_DISTANCE_M
