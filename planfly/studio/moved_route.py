"""Update the route of a mission after a few waypoints were moved.

Rows of the previous route are replaced.

Laying out all items of a long mission takes longer than judging the legs around one item.
"""

import math
from dataclasses import replace

import numpy as np

from flight.mission.items import AMSL, OVER_HOME, OVER_TERRAIN, PLACES, Command, Mission, MissionItem
from flight.mission.placing import MAX_ALTITUDE_M, MIN_ALTITUDE_M
from flight.mission.route import Route, fly_over_waypoints
from planfly.workflow.uav import Uav
from world.frames import to_map
from world.scenario import Scenario
from world.scenario_tables import MAP_EXTENT

# Maximum number of items that a drag changes.
_MAX_MOVED_ITEMS = 8
# Distance between successive waypoints below which they may be merged, or offset from each other, m.
_MERGE_DISTANCE_M = 2.0
# Tolerance between a position computed alone and in an array, m, because the last digits of a sine differ.
_POSITION_TOLERANCE_M = 1e-6
# Commands with which a position item may not correspond to exactly one row of the route.
_IRREGULAR_COMMANDS = frozenset(
    {Command.DO_JUMP, Command.DO_JUMP_TAG, Command.DO_SET_HOME, Command.CONDITION_GATE, Command.NAV_RETURN_TO_LAUNCH}
)


def update_moved_route(
    route: Route, previous_mission: Mission, mission: Mission, scenario: Scenario, uav: Uav
) -> Route | None:
    """Return the route after moves of a few waypoints; None if the whole route must be computed again.

    The whole route must be computed again if a move may change more than the waypoint itself.  This is so next to
    loiters, merged waypoints and waypoints without an altitude, and for routes with jumps, gates, RTL, landings, or
    courses at the ends.  It is also so if more than `_MAX_MOVED_ITEMS` items changed.

    route: route of `previous_mission`, the mission before the moves.
    mission: the mission after the moves.
    """
    if len(previous_mission.items) != len(mission.items):
        return None
    pairs = [
        (old_item, new_item)
        for old_item, new_item in zip(previous_mission.items, mission.items, strict=True)
        if old_item is not new_item
    ]
    if len(pairs) > _MAX_MOVED_ITEMS or not _has_one_stop_per_item(route, mission, scenario):
        return None
    rows = {seq: row for row, seq in enumerate(route.items.tolist())}
    waypoint_seqs = {item.seq for item in mission.items if item.command == Command.NAV_WAYPOINT}
    rules = uav.autopilot.route_rules
    points, changed_rows = route.points.copy(), set[int]()
    positions = points["position"]
    for old_item, new_item in pairs:
        # A move changes only the position and the acceptance radius of a waypoint.
        params = (*old_item.params[:1], new_item.params[1], *old_item.params[2:])
        lat, lon, alt = new_item.lat_deg, new_item.lon_deg, new_item.alt
        is_waypoint = new_item.command == Command.NAV_WAYPOINT and old_item.has_position and new_item.has_position
        if not is_waypoint or replace(old_item, lat_deg=lat, lon_deg=lon, alt=alt, params=params) != new_item:
            return None
        row = rows[new_item.seq]
        old_position = _map_position(old_item, previous_mission, scenario)
        new_position = _map_position(new_item, mission, scenario)
        neighbours = [k for k in (row - 1, row + 1) if 0 <= k <= route.legs]
        if old_position is None or new_position is None:
            return None
        if math.dist(old_position, positions[row]) > _POSITION_TOLERANCE_M:
            return None
        if any(int(route.items[k]) not in waypoint_seqs or route.arc_radii[k] for k in neighbours):
            return None
        positions[row] = new_position
        if not math.isnan(points["above_ground"][row]):
            points["above_ground"][row] = new_item.alt
        points["acceptance_radius"][row] = min(max(0.0, new_item.params[1]), rules.acceptance_limit)
        changed_rows |= {row, *neighbours}
    # Waypoints that are close to each other may be merged.
    if any(
        math.dist(array[row - 1, :2], array[row, :2]) < _MERGE_DISTANCE_M
        for array in (positions, route.positions)
        for row in changed_rows
        if row
    ):
        return None
    must_fly_over = fly_over_waypoints(points, uav.limits, rules.turn_distance)
    points["fly_over"] = np.where(route.arc_radii > 0.0, False, scenario.flight.fly_over | must_fly_over)
    return replace(route, points=points)


def _has_one_stop_per_item(route: Route, mission: Mission, scenario: Scenario) -> bool:
    """Return True if each item with a position is exactly one stop of the route, with its own altitude."""
    if any(value is not None for value in (route.rtl_start, route.direct_landing_start, route.landing_ground)):
        return False
    if scenario.start_course is not None or scenario.destination_course is not None:
        return False
    flown_seqs = set(route.items.tolist())
    return not any(
        item.command in _IRREGULAR_COMMANDS
        or (item.command in PLACES and (item.seq not in flown_seqs or math.isnan(item.alt)))
        for item in mission.items
    )


def _map_position(item: MissionItem, mission: Mission, scenario: Scenario) -> tuple[float, float, float] | None:
    """Return east, north and altitude of a waypoint, m.

    Returns None if the position depends on other items or is off the map.
    """
    map_east, map_north = to_map(scenario.origin, [item.lat_deg], [item.lon_deg])
    east, north, home, altitude = float(map_east[0]), float(map_north[0]), mission.home, math.nan
    if item.frame in AMSL:
        altitude = item.alt
    elif item.frame in OVER_HOME and home is not None:
        altitude = home.alt + item.alt
    elif item.frame in OVER_TERRAIN and scenario.terrain is not None:
        altitude = float(scenario.terrain.height(east, north)) + item.alt
    is_valid = MIN_ALTITUDE_M <= altitude <= MAX_ALTITUDE_M and max(abs(east), abs(north)) <= MAP_EXTENT
    return (east, north, altitude) if is_valid else None
