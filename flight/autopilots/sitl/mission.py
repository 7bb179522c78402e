"""The mission that an autopilot is given to fly: the items that the route is made of, and one place more.

What a flight from air to air cannot hold is made a waypoint where the route has it: a take-off, a landing.  A place
more, 1 km straight on after the last, keeps the autopilot on its course to the route's end: it takes a waypoint as
reached a radius early, and returns to launch after the last.  A mission that ends with a return to launch has that at
its end, or before the landing sequence that it goes on to, and its rally points go with it; one that ends with a loiter
without end has that, of which the flight's own clock counts a minute.  An autopilot that circles about the last
waypoint without end has no place more, either.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flight.mission.ground_ways import GroundWays
from flight.mission.items import Command, Frame, Home, MissionItem, is_navigation, on_grid
from flight.mission.itinerary import loiter_of
from flight.mission.route import Route, goes_no_further
from flight.simulation.setup import FlightSetup
from world.frames import GeoOrigin, to_geo

Floats = NDArray[np.float64]

# From the end of the route to the place more, m.
STRAIGHT_ON = 1000.0
# Home stands this far (m) below the start where the mission has none, and where its own is nearer than `_NEAR` (m) to
# the start's height: within 10 m of home ArduPlane holds the throttle back, as before a take-off.
_BELOW, _NEAR = 100.0, 15.0
_KEPT = (Command.DO_JUMP, Command.DO_JUMP_TAG, Command.JUMP_TAG, Command.DO_CHANGE_SPEED, Command.DO_SET_HOME)


@dataclass(frozen=True, slots=True)
class UploadedMission:
    """What goes to the autopilot.

    home: its home; alt is AMSL.
    items: numbered from 1; the last is the place more, or what the autopilot ends its mission with.
    rally: the points that a return may go to, numbered from 0; none without a return.
    last: number of the item with which the last leg begins; 0 for the last of them.
    """

    home: Home
    items: tuple[MissionItem, ...]
    rally: tuple[MissionItem, ...] = ()
    last: int = 0


def uploaded_mission(setup: FlightSetup) -> UploadedMission:
    """The mission of a setup as the autopilot gets it, all heights above mean sea level but those of rally points.

    From the ground to the ground it is the mission itself.
    """
    if setup.ground_ways:
        return _itself(setup, setup.ground_ways)
    route, origin = setup.route, setup.scenario.origin
    kept: list[MissionItem] = []
    lands = route.return_from >= 0 and route.return_until <= route.legs
    for item in setup.mission.items:
        rows = np.flatnonzero(route.items == item.seq)
        if item.command == Command.NAV_RETURN_TO_LAUNCH:
            kept += [item] if rows.size else []
        elif rows.size:
            kept.append(_place(item, route, rows, origin, kept))
        elif item.command in _KEPT or (lands and item.command == Command.DO_LAND_START):
            kept.append(item)
    if not any(item.has_position for item in kept):
        kept = _of_route(route, origin)
    elif route.items[-1] == -1 and kept[-1].command != Command.NAV_LOITER_UNLIM:
        kept.append(_waypoint(kept[-1].seq + 1, route.waypoints[-1], 0.0, origin))
    if (route.return_from >= 0 and not lands) or kept[-1].command == Command.NAV_LOITER_UNLIM:
        return UploadedMission(_home(setup), _renumbered(kept), setup.mission.rally)
    if setup.autopilot.loiter_rules.ends_in_circle and goes_no_further(route, setup.mission):
        return UploadedMission(_home(setup), _renumbered(kept))
    kept.append(_waypoint(kept[-1].seq + 1, _straight_on(route), 0.0, origin))
    return UploadedMission(_home(setup), _renumbered(kept), setup.mission.rally if lands else ())


def _itself(setup: FlightSetup, ways: GroundWays) -> UploadedMission:
    """The mission as its file has it, from its home; without a height that is the ground's there."""
    home, mission = setup.mission.home, setup.mission
    if home is None or ways.take_off is None or ways.approach is None:
        raise ValueError("a mission from the ground to the ground has a home, a take-off and a landing")
    if math.isnan(home.alt):
        home = replace(home, alt=ways.take_off.base)
    known = []
    for item in mission.items:
        p1, p2, p3, p4 = (0.0 if math.isnan(value) else value for value in item.params)
        known.append(replace(item, params=(p1, p2, p3, p4)))
    last = next(k for k, item in enumerate(known, 1) if item.seq == ways.approach.item)
    return UploadedMission(home, _renumbered(known), mission.rally, last)


def _place(
    item: MissionItem, route: Route, rows: NDArray[np.intp], origin: GeoOrigin, before: list[MissionItem]
) -> MissionItem:
    """A place of the mission: a loiter about its own centre, anything else as a waypoint where the route has it."""
    last = route.waypoints[rows[-1]]
    loiter = loiter_of(item)
    if loiter is None:
        return _waypoint(item.seq, last, float(route.acceptance[rows[-1]]), origin)
    lat, lon = item.lat_deg, item.lon_deg
    if not item.has_position:
        centre = next(place for place in reversed(before) if place.has_position and is_navigation(place.command))
        lat, lon = centre.lat_deg, centre.lon_deg
    p1, p2, p3, p4 = (0.0 if math.isnan(value) else value for value in item.params)
    return MissionItem(item.seq, int(item.command), int(Frame.GLOBAL), (p1, p2, p3, p4), lat, lon, float(last[2]))


def _of_route(route: Route, origin: GeoOrigin) -> list[MissionItem]:
    """Items of a route that was made without a mission: its waypoints, and its speeds where they change."""
    items: list[MissionItem] = []
    speed = math.nan
    for k, point in enumerate(route.waypoints):
        items.append(_waypoint(len(items) + 1, point, float(route.acceptance[k]), origin))
        if k < len(route.airspeed) and route.airspeed[k] != speed:
            speed = float(route.airspeed[k])
            change = (0.0, speed, -1.0, 0.0)
            items.append(
                MissionItem(len(items) + 1, int(Command.DO_CHANGE_SPEED), int(Frame.MISSION), change, 0.0, 0.0, 0.0)
            )
    return items


def _waypoint(seq: int, point: Floats, acceptance: float, origin: GeoOrigin) -> MissionItem:
    lat, lon = to_geo(origin, point[0], point[1])
    place = (on_grid(float(lat)), on_grid(float(lon)), float(point[2]))
    return MissionItem(seq, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0, acceptance, 0.0, 0.0), *place)


def _straight_on(route: Route) -> Floats:
    east, north, _ = route.waypoints[-1] - route.waypoints[-2]
    step = STRAIGHT_ON / math.hypot(east, north)
    further: Floats = route.waypoints[-1] + np.array([step * east, step * north, 0.0])
    return further


def _renumbered(kept: list[MissionItem]) -> tuple[MissionItem, ...]:
    """Items numbered from 1, jumps to the first that was kept from their target on."""
    items = []
    for number, item in enumerate(kept, 1):
        params = item.params
        if item.command == Command.DO_JUMP:
            target = next((k for k, other in enumerate(kept, 1) if other.seq >= params[0]), len(kept))
            params = (float(target), *params[1:])
        items.append(replace(item, seq=number, params=params))
    return tuple(items)


def _home(setup: FlightSetup) -> Home:
    """The mission's home, or the start's place; at a height that lets the motor run from the start.

    A return to launch counts its heights from home: there it is the mission's.
    """
    start = setup.route.waypoints[0]
    home = setup.mission.home
    if home is None:
        lat, lon = to_geo(setup.scenario.origin, start[0], start[1])
        home = Home(on_grid(float(lat)), on_grid(float(lon)), math.nan)
    if setup.route.return_to is not None and not math.isnan(home.alt):
        return home
    near = math.isnan(home.alt) or abs(home.alt - start[2]) < _NEAR
    return replace(home, alt=float(start[2]) - _BELOW) if near else home
