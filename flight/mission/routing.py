"""From a mission's places to the route that is flown, with circles and spirals that its aircraft can fly."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import Limits
from flight.mission.arc_misses import arc_misses
from flight.mission.items import Mission, command_name
from flight.mission.itinerary import Itinerary, ItineraryStop
from flight.mission.loiter_circles import PLAIN_SLOPE, OwnRadius, PlacedStop, SpiralSlopes, lay_circles
from flight.mission.notes import Notes
from flight.mission.placing import PlacedMission, place_stops
from flight.mission.route import Route
from world.errors import MissionError
from world.frames import GeoOrigin, to_geo
from world.geometry import leg_courses
from world.terrain import Terrain

Floats = NDArray[np.float64]

# Radius of a loiter that states none (m, PX4's default), if the aircraft can turn as tightly, this much tighter.
DEFAULT_RADIUS = 80.0
OVER_TIGHTEST = 1.1
# A spiral climbs and sinks with this share of the aircraft's limits in straight flight.
SPIRAL_SHARE = 0.6


def make_route(
    mission: Mission,
    origin: GeoOrigin,
    terrain: Terrain | None,
    default_airspeed: float,
    fly_over: bool,
    limits: Limits | None = None,
) -> Route:
    """Route of a mission on the map about ``origin``: `place_stops`, then `lay_route`.

    terrain: None where none is known; heights above terrain are then an error.
    default_airspeed: m/s until the mission sets one (a `.plan` file's cruiseSpeed, a station's estimate, sets none).
    fly_over: whether waypoints are flown through instead of by; one whose arc would miss its acceptance always is.
    limits: the aircraft's, for these arcs, the radius of a loiter that states none (None takes 80 m), and the slope of
        a spiral (5 %).

    Without TAKEOFF the route starts at the first position item; with one, over home at that item's height.  Every leg
    has a horizontal length of at least `flight.mission.placing.SAME_PLACE`.  Raises MissionError, naming the item, for
    what cannot be placed, and for a mission of fewer than two positions.

    >>> from flight.mission.items import Command, Frame, MissionItem
    >>> items = [
    ...     MissionItem(k, Command.NAV_WAYPOINT, Frame.GLOBAL, (0.0,) * 4, lat, -84.2, 700.0)
    ...     for k, lat in enumerate((36.50, 36.51, 36.52), 1)
    ... ]
    >>> route = make_route(Mission(None, tuple(items)), GeoOrigin(36.5, -84.2), None, 25.0, fly_over=False)
    >>> route.waypoints.round().tolist()
    [[0.0, 0.0, 700.0], [0.0, 1110.0, 700.0], [0.0, 2219.0, 700.0]]
    >>> route.started
    'no TAKEOFF: starts trimmed at the first position, item 1: 36.5000000, ... 700.0 m AMSL, on course 0 degrees'
    """
    return lay_route(place_stops(mission, origin, terrain), default_airspeed, fly_over, limits)


def lay_route(placed: PlacedMission, default_airspeed: float, fly_over: bool, limits: Limits | None = None) -> Route:
    """Route through the places of a mission; arguments as of `make_route`.

    Raises MissionError for fewer than two places, and for a loiter too wide or too long to lay out.

    >>> from flight.mission.items import Command, Frame, MissionItem
    >>> items = [MissionItem(k, Command.NAV_WAYPOINT, Frame.GLOBAL, (0.0,) * 4, 36.5 + k, 8.0, 700.0) for k in (0, 1)]
    >>> placed = place_stops(Mission(None, tuple(items)), GeoOrigin(36.5, 8.0), None)
    >>> lay_route(placed, 25.0, fly_over=False).airspeed.tolist()
    [25.0]
    """
    mission, notes = placed.mission, Notes()
    kept = [_with_airspeed(place, default_airspeed) for place in placed.stops]
    points = lay_circles(mission.source, kept, notes, _own_radius(limits), _spiral_slopes(limits))
    if len(points) < 2:
        raise MissionError(
            f"{mission.source}: {len(points)} place to fly to: at least two different ones are expected",
            file=mission.source,
        )
    stops = [point.stop for point in points]
    waypoints = np.array([point.position for point in points])
    arcs = np.array([point.arc for point in points])
    airspeed = np.array([stop.airspeed for stop in stops[1:]])
    acceptance = np.array([stop.acceptance for stop in stops])
    _note_cruise_speed(mission, default_airspeed, stops[1], notes)
    return Route(
        waypoints=waypoints,
        airspeed=airspeed,
        acceptance=acceptance,
        fly_over=np.where(arcs > 0.0, False, fly_over | arc_misses(waypoints, airspeed, acceptance, limits)),
        items=np.array([stop.item for stop in stops], dtype=np.int64),
        started=_started(placed.itinerary, stops[0], placed.origin, waypoints),
        notes=placed.itinerary.notes + placed.notes + notes.lines(),
        arcs=arcs,
        endless=placed.itinerary.endless,
        takeoff_ground=placed.takeoff_ground,
        landing_ground=placed.landing_ground,
    )


def _with_airspeed(place: PlacedStop, default: float) -> PlacedStop:
    """A place with the default airspeed (m/s) where the mission sets none."""
    if not math.isnan(place.stop.airspeed):
        return place
    return PlacedStop(replace(place.stop, airspeed=default), place.position)


def _note_cruise_speed(mission: Mission, airspeed: float, first: ItineraryStop, notes: Notes) -> None:
    """Note a cruiseSpeed other than the default airspeed (m/s), if that is flown to the first stop."""
    if mission.cruise_speed not in (None, airspeed) and first.airspeed == airspeed:
        notes.add(
            f"cruiseSpeed {mission.cruise_speed:g} m/s is the ground station's estimate and no command:"
            f" started at {airspeed:g} m/s"
        )


def _own_radius(limits: Limits | None) -> OwnRadius:
    """Radius of a loiter that states none: a tenth over the bank limit's in this wind, in whole tens of metres."""

    def radius(airspeed: float, up: float) -> float:
        if limits is None:
            return DEFAULT_RADIUS
        tightest = max(limits.turn_radius(course, course + math.pi, up, airspeed) for course in (0.0, math.pi))
        if not math.isfinite(tightest):
            return DEFAULT_RADIUS
        return max(DEFAULT_RADIUS, math.ceil(OVER_TIGHTEST * tightest / 10.0) * 10.0)

    return radius


def _spiral_slopes(limits: Limits | None) -> SpiralSlopes:
    """Slopes of a spiral: a share of the aircraft's limits on the worst course around it."""

    def slopes(airspeed: float, up: float) -> tuple[float, float]:
        if limits is None:
            return PLAIN_SLOPE, PLAIN_SLOPE
        found = []
        for k, most in enumerate((limits.max_climb, limits.max_dive)):
            limit = min(limits.slopes(course, up, airspeed)[k] for course in np.arange(8) * (math.pi / 4.0))
            least = min(limit, math.inf if most is None else most)
            # An aircraft that cannot climb at all gets a plain spiral, and the slope rule says so.
            found.append(SPIRAL_SHARE * math.tan(least) if 0.0 < least < 1.5 else PLAIN_SLOPE)
        return found[0], found[1]

    return slopes


def _started(itinerary: Itinerary, first: ItineraryStop, origin: GeoOrigin, waypoints: Floats) -> str:
    course = math.degrees(float(leg_courses(waypoints)[0])) % 360.0
    lat, lon = first.lat_deg, first.lon_deg
    if first.loiter is not None:
        lat, lon = (float(value) for value in to_geo(origin, waypoints[0, 0], waypoints[0, 1]))
    where = f"{lat:.7f}, {lon:.7f}, {waypoints[0, 2]:.1f} m AMSL, on course {course:.0f} degrees"
    item = itinerary.takeoff
    name = "no TAKEOFF" if item is None else f"{command_name(item.command)} (item {item.seq})"
    if first.loiter is not None:
        return f"{name}: starts trimmed in the air on the circle of item {first.item}: {where}"
    if item is not None:
        over = "home" if itinerary.has_home else "the first position, as there is no home,"
        return f"{name}: starts trimmed in the air over {over} at that item's height: {where}"
    return f"{name}: starts trimmed at the first position, item {first.item}: {where}"
