"""Build the mission that an autopilot gets to fly, from the items of the route and one extra waypoint.

In a flight from air to air, take-off and landing items become waypoints where the route has them.
An extra waypoint, 1 km straight on after the last, keeps the autopilot on its course to the route's end: it accepts a
waypoint a radius early, and returns to launch after the last one. A mission that ends with an RTL has the RTL at its
end, or before the landing sequence that follows it, and its rally points are uploaded too. An unlimited loiter at the
mission's end is uploaded unchanged; planfly ends the flight after a minute and one lap of it. An autopilot that
loiters indefinitely about the last waypoint gets no extra waypoint either.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import Command, Frame, Home, MissionItem, is_navigation, round_to_grid
from flight.mission.itinerary import NO_ITEM, stated_loiter
from flight.mission.route import Route, ends_at_plain_waypoint
from flight.simulation.setup import FlightSetup
from world.arrays import Floats
from world.frames import GeoOrigin, to_geo

# Distance from the end of the route to the extra waypoint after it, m.
EXTRA_WAYPOINT_DISTANCE_M = 1000.0
# Height of the start above home, m, if the mission has no home, or a home near the start's altitude.
_HOME_BELOW_START_M = 100.0
# Minimum altitude difference between the start and home, m: within 10 m of home ArduPlane limits the throttle, as
# before a take-off.
_MIN_HOME_DISTANCE_M = 15.0
_KEPT_COMMANDS = (Command.DO_JUMP, Command.DO_JUMP_TAG, Command.JUMP_TAG, Command.DO_CHANGE_SPEED, Command.DO_SET_HOME)


@dataclass(frozen=True, slots=True)
class UploadedMission:
    """Mission as it is uploaded to the autopilot.

    home: home position; alt is AMSL.
    items: items numbered from 1; the last item is the extra waypoint, or the item that ends the autopilot's mission.
    rally: rally points for an RTL, numbered from 0; empty without an RTL.
    last: number of the item at which the last leg begins; 0 for the last item.
    """

    home: Home
    items: tuple[MissionItem, ...]
    rally: tuple[MissionItem, ...] = ()
    last: int = 0


def make_uploaded_mission(setup: FlightSetup) -> UploadedMission:
    """Build the mission that is uploaded for a setup; its altitudes are AMSL, except at rally points.

    A mission that begins and ends on the ground is uploaded unchanged. Raises ValueError for a setup that
    simulates only a take-off, only a landing, or both without a home.
    """
    if setup.ground_phases:
        # The mission as in its file; a home without an altitude gets the altitude of the ground.
        home, mission = setup.mission.home, setup.mission
        if home is None or setup.ground_phases.take_off is None or setup.ground_phases.approach is None:
            raise ValueError("a mission from the ground to the ground needs a home, a take-off and a landing")
        if math.isnan(home.alt):
            home = replace(home, alt=setup.ground_phases.take_off.home_altitude)
        unchanged_items = []
        for item in mission.items:
            p1, p2, p3, p4 = (0.0 if math.isnan(value) else value for value in item.params)
            unchanged_items.append(replace(item, params=(p1, p2, p3, p4)))
        last_number = next(
            number for number, item in enumerate(unchanged_items, 1) if item.seq == setup.ground_phases.approach.item
        )
        return UploadedMission(home, _renumber(unchanged_items), mission.rally, last_number)
    route, origin = setup.route, setup.scenario.origin
    items: list[MissionItem] = []
    has_landing = route.rtl_start is not None and route.rtl_end <= route.legs
    for item in setup.mission.items:
        waypoint_indices = np.flatnonzero(route.items == item.seq)
        if item.command == Command.NAV_RETURN_TO_LAUNCH:
            items += [item] if waypoint_indices.size else []
        elif waypoint_indices.size:
            items.append(_item_with_position(item, route, waypoint_indices, origin, items))
        elif item.command in _KEPT_COMMANDS or (has_landing and item.command == Command.DO_LAND_START):
            items.append(item)
    if not any(item.has_position for item in items):
        # Waypoints and speed changes for a route whose mission has no items with positions.
        items = []
        speed = math.nan
        for index, point in enumerate(route.positions):
            items.append(_make_waypoint(len(items) + 1, point, float(route.points["acceptance_radius"][index]), origin))
            if index < route.legs and route.leg_airspeeds[index] != speed:
                speed = float(route.leg_airspeeds[index])
                change = (0.0, speed, -1.0, 0.0)
                items.append(
                    MissionItem(len(items) + 1, int(Command.DO_CHANGE_SPEED), int(Frame.MISSION), change, 0.0, 0.0, 0.0)
                )
    elif route.items[-1] == NO_ITEM and items[-1].command != Command.NAV_LOITER_UNLIM:
        items.append(_make_waypoint(items[-1].seq + 1, route.positions[-1], 0.0, origin))
    if (route.rtl_start is not None and not has_landing) or items[-1].command == Command.NAV_LOITER_UNLIM:
        return UploadedMission(_home_for_upload(setup), _renumber(items), setup.mission.rally)
    if setup.autopilot.loiters.ends_in_circle and ends_at_plain_waypoint(route, setup.mission):
        return UploadedMission(_home_for_upload(setup), _renumber(items))
    # The extra waypoint lies straight on after the last leg, at that leg's final altitude.
    east, north, _ = route.positions[-1] - route.positions[-2]
    scale = EXTRA_WAYPOINT_DISTANCE_M / math.hypot(east, north)
    items.append(
        _make_waypoint(
            items[-1].seq + 1, route.positions[-1] + np.array([scale * east, scale * north, 0.0]), 0.0, origin
        )
    )
    return UploadedMission(_home_for_upload(setup), _renumber(items), setup.mission.rally if has_landing else ())


def _item_with_position(
    item: MissionItem,
    route: Route,
    waypoint_indices: NDArray[np.intp],
    origin: GeoOrigin,
    earlier_items: list[MissionItem],
) -> MissionItem:
    """Return a navigation item for the upload.

    A loiter keeps its parameters; other items become waypoints.

    waypoint_indices: waypoints of the route that belong to the item.
    earlier_items: items that are uploaded before this item; a loiter without a position is placed at the last position
        of these items.
    """
    position = route.positions[waypoint_indices[-1]]
    loiter = stated_loiter(item)
    if loiter is None:
        waypoint = _make_waypoint(
            item.seq, position, float(route.points["acceptance_radius"][waypoint_indices[-1]]), origin
        )
        if item.command != Command.NAV_WAYPOINT:
            return waypoint
        hold, _, pass_by, yaw = (0.0 if math.isnan(value) else value for value in item.params)
        return replace(waypoint, params=(hold, waypoint.params[1], pass_by, yaw))
    lat, lon = item.lat_deg, item.lon_deg
    if not item.has_position:
        center_item = next(
            earlier_item
            for earlier_item in reversed(earlier_items)
            if earlier_item.has_position and is_navigation(earlier_item.command)
        )
        lat, lon = center_item.lat_deg, center_item.lon_deg
    p1, p2, p3, p4 = (0.0 if math.isnan(value) else value for value in item.params)
    return MissionItem(item.seq, int(item.command), int(Frame.GLOBAL), (p1, p2, p3, p4), lat, lon, float(position[2]))


def _make_waypoint(seq: int, point: Floats, acceptance: float, origin: GeoOrigin) -> MissionItem:
    """Return a plain waypoint with a number at a point of the route.

    seq: number of the item.
    point: east, north and altitude, (3,) m.
    acceptance: acceptance radius, m.
    origin: geographic position of east 0 and north 0.
    """
    lat, lon = to_geo(origin, point[0], point[1])
    position = (round_to_grid(float(lat)), round_to_grid(float(lon)), float(point[2]))
    return MissionItem(seq, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0, acceptance, 0.0, 0.0), *position)


def _renumber(items_in_order: list[MissionItem]) -> tuple[MissionItem, ...]:
    """Return copies of the items, numbered from 1.

    A jump leads to its target, or to the next remaining item if the target is not among the items.
    """
    items = []
    for number, item in enumerate(items_in_order, 1):
        params = item.params
        if item.command == Command.DO_JUMP:
            target = next(
                (candidate for candidate, later_item in enumerate(items_in_order, 1) if later_item.seq >= params[0]),
                len(items_in_order),
            )
            params = (float(target), *params[1:])
        items.append(replace(item, seq=number, params=params))
    return tuple(items)


def _home_for_upload(setup: FlightSetup) -> Home:
    """Return the mission's home, or the start's position, at an altitude that allows full throttle.

    Near the altitude of home ArduPlane would limit the throttle as before a take-off. A mission with an RTL keeps its
    own home, because the RTL measures altitudes from home.
    """
    start = setup.route.positions[0]
    home = setup.mission.home
    if home is None:
        lat, lon = to_geo(setup.scenario.origin, start[0], start[1])
        home = Home(round_to_grid(float(lat)), round_to_grid(float(lon)), math.nan)
    if setup.route.rtl_loiter is not None and not math.isnan(home.alt):
        return home
    is_near = math.isnan(home.alt) or abs(home.alt - start[2]) < _MIN_HOME_DISTANCE_M
    return replace(home, alt=float(start[2]) - _HOME_BELOW_START_M) if is_near else home
