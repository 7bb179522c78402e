"""From a mission to the route that is flown: map positions and heights above mean sea level."""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import Limits
from flight.mission.arc_misses import arc_misses
from flight.mission.items import AMSL, OVER_HOME, TAKEOFFS, Home, Mission, command_name
from flight.mission.itinerary import Itinerary, ItineraryStop, make_itinerary
from flight.mission.loiter_circles import PLAIN_SLOPE, OwnRadius, PlacedStop, SpiralSlopes, lay_circles
from flight.mission.notes import Notes
from flight.mission.route import Route
from world.errors import MissionError
from world.frames import GeoOrigin, to_geo, to_map
from world.geometry import leg_courses
from world.scenario_tables import MAP_EXTENT
from world.terrain import Terrain

Floats = NDArray[np.float64]

# Positions nearer to each other than this (m) are one.
SAME_PLACE = 1.0
# Horizontal length of a vertical leg, m: a metre of height on it is 89.4 degrees.
VERTICAL_STEP = 0.01
# Heights (m AMSL) that a flight may be asked to keep.
LOWEST, HIGHEST = -500.0, 9000.0
# Radius of a loiter that states none (m, PX4's default), if the aircraft can turn as tightly, this much tighter.
DEFAULT_RADIUS = 80.0
OVER_TIGHTEST = 1.1
# A spiral climbs and sinks with this share of the aircraft's limits in straight flight.
SPIRAL_SHARE = 0.6
# A home that is further than this (m) from the ground at its place is worth a note.
_HOME_ERROR = 30.0


def make_route(
    mission: Mission,
    origin: GeoOrigin,
    terrain: Terrain | None,
    default_airspeed: float,
    fly_over: bool,
    limits: Limits | None = None,
    *,
    vertical_legs: bool = False,
) -> Route:
    """Route of a mission on the map about ``origin``.

    terrain: None where none is known; heights above terrain are then an error.
    default_airspeed: m/s until the mission sets one (a `.plan` file's cruiseSpeed, a station's estimate, sets none).
    fly_over: whether waypoints are flown through instead of by; one whose arc would miss its acceptance always is.
    limits: the aircraft's, for these arcs, the radius of a loiter that states none (None takes 80 m), and the slope of
        a spiral (5 %).
    vertical_legs: whether a place straight above or below the one before is a leg of `VERTICAL_STEP` m, not an error.

    Without TAKEOFF the route starts at the first position item; with one, over home at that item's height.  Every leg
    has a horizontal length of at least `SAME_PLACE`, or `VERTICAL_STEP` if vertical.  Raises MissionError, naming the
    item, for what cannot be placed, and for a mission of fewer than two positions.

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
    itinerary = make_itinerary(mission, default_airspeed)
    notes = Notes()
    heights = _Heights(mission.source, itinerary, origin, terrain, notes)
    kept = _placed_stops(mission.source, itinerary, origin, heights, vertical_legs)
    points = lay_circles(mission.source, kept, notes, _own_radius(limits), _spiral_slopes(limits))
    if len(points) < 2:
        raise MissionError(f"{mission.source}: {len(points)} place to fly to: at least two different ones are expected")
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
        started=_started(itinerary, stops[0], origin, waypoints),
        notes=itinerary.notes + notes.lines(),
        arcs=arcs,
        endless=itinerary.endless,
        takeoff_ground=math.nan if itinerary.takeoff is None else heights.ground_at_home(),
        landing_ground=heights.touchdown(itinerary),
    )


def _note_cruise_speed(mission: Mission, airspeed: float, first: ItineraryStop, notes: Notes) -> None:
    """Note a cruiseSpeed other than the default airspeed (m/s), if that is flown to the first stop."""
    if mission.cruise_speed not in (None, airspeed) and first.airspeed == airspeed:
        notes.add(
            f"cruiseSpeed {mission.cruise_speed:g} m/s is the ground station's estimate and no command:"
            f" started at {airspeed:g} m/s"
        )


def _placed_stops(
    source: str, itinerary: Itinerary, origin: GeoOrigin, heights: "_Heights", vertical_legs: bool
) -> list[PlacedStop]:
    """Stops on the map, without those at the position of the one before."""
    notes = heights.notes
    flat = _on_map(source, itinerary.stops, origin)
    kept: list[PlacedStop] = []
    for stop, (east, north) in zip(itinerary.stops, flat, strict=True):
        last = float(kept[-1].position[2]) if kept else math.nan
        new = PlacedStop(stop, np.array([east, north, heights.amsl(stop, float(east), float(north), last)]))
        circles = stop.loiter is not None or bool(kept and kept[-1].stop.loiter is not None)
        if kept and not circles and math.dist(kept[-1].position[:2], new.position[:2]) < SAME_PLACE:
            if vertical_legs and _is_vertical(kept[-1], new):
                kept.append(PlacedStop(stop, _step_aside(kept, new.position)))
                continue
            kept[-1] = PlacedStop(_merge(source, kept[-1], new, notes), kept[-1].position)
        else:
            kept.append(new)
    return kept


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


def _name(stop: ItineraryStop) -> str:
    return f"item {stop.item}" if stop.item >= 0 else "home"


def _on_map(source: str, stops: tuple[ItineraryStop, ...], origin: GeoOrigin) -> Floats:
    """East and north of each stop, (n, 2) m."""
    east, north = to_map(origin, [stop.lat_deg for stop in stops], [stop.lon_deg for stop in stops])
    points = np.stack([east, north], axis=1)
    far = ~(np.abs(points) <= MAP_EXTENT).all(axis=1)
    if far.any():
        stop = stops[int(np.argmax(far))]
        raise MissionError(
            f"{source}: {_name(stop)}: latitude {stop.lat_deg:.7f}, longitude {stop.lon_deg:.7f}: more than"
            f" {MAP_EXTENT / 1000:.0f} km from the map's origin at {origin.lat_deg:.5f}, {origin.lon_deg:.5f}"
            " (columns swapped, or a sign lost?)"
        )
    return points


class _Heights:
    """Heights above mean sea level of heights in any frame."""

    def __init__(
        self, source: str, itinerary: Itinerary, origin: GeoOrigin, terrain: Terrain | None, notes: Notes
    ) -> None:
        self.source = source
        self.origin = origin
        self.terrain = terrain
        self.notes = notes
        self.home = itinerary.home
        self._home_amsl: float | None = None

    def amsl(self, stop: ItineraryStop, east: float, north: float, last: float) -> float:
        """Height of a stop; ``last``: the one before, NaN at the first."""
        if math.isnan(stop.alt):
            if math.isnan(last):
                raise MissionError(f"{self.source}: {_name(stop)}: no altitude, and none before to keep")
            return last
        if stop.frame in AMSL:
            height = stop.alt
        elif stop.frame in OVER_HOME:
            height = self._over_home(stop) + stop.alt
        else:
            height = self._ground(stop, east, north) + stop.alt
        if not LOWEST <= height <= HIGHEST:
            raise MissionError(
                f"{self.source}: {_name(stop)}: {height:.1f} m AMSL: allowed {LOWEST:.0f}..{HIGHEST:.0f}"
            )
        return height

    def _ground(self, stop: ItineraryStop, east: float, north: float) -> float:
        asked = f"{self.source}: {_name(stop)}: height above terrain (frame {stop.frame})"
        if self.terrain is None:
            raise MissionError(f"{asked}: no terrain is given to count from")
        under = float(self.terrain.height(east, north))
        if math.isnan(under):
            raise MissionError(f"{asked}: {self.terrain.source} has no data there")
        return under

    def _over_home(self, stop: ItineraryStop) -> float:
        if self._home_amsl is None:
            self._home_amsl = self._find_home(stop, self.home)
        return self._home_amsl

    def touchdown(self, itinerary: Itinerary) -> float:
        """Height of the place to land at; NaN for none, none stated, and none to compare with the place before it."""
        stop = itinerary.landing
        if stop is None or math.isnan(stop.alt):
            return math.nan
        known = stop.frame in AMSL or self.terrain is not None
        if stop.frame in OVER_HOME:
            before = itinerary.stops[-2].frame if len(itinerary.stops) > 1 else stop.frame
            known = known or not math.isnan(self.home.alt) or before in OVER_HOME
        east, north = to_map(self.origin, stop.lat_deg, stop.lon_deg)
        return self.amsl(stop, float(east), float(north), math.nan) if known else math.nan

    def ground_at_home(self) -> float:
        """Height of the ground at home, NaN where it is not known."""
        home = self.home
        if self.terrain is not None:
            east, north = to_map(self.origin, home.lat_deg, home.lon_deg)
            if abs(float(east)) <= MAP_EXTENT and abs(float(north)) <= MAP_EXTENT:
                return float(self.terrain.height(east, north))
        return math.nan

    def _find_home(self, stop: ItineraryStop, home: Home) -> float:
        under = self.ground_at_home()
        if not math.isnan(home.alt):
            if abs(home.alt - under) > _HOME_ERROR:
                unset = "" if home.alt else "; ground stations write 0 where no home was set"
                self.notes.add(
                    f"home is at {home.alt:.1f} m AMSL, and the ground there at {under:.1f} m:"
                    f" heights over home count from the former{unset}"
                )
            return home.alt
        if math.isnan(under):
            self.notes.add("no home height, and no terrain to take one from: heights over home count from 0 m AMSL")
            return 0.0
        self.notes.add(
            f"no home height: taken as the ground at {home.lat_deg:.7f}, {home.lon_deg:.7f}, {under:.1f} m AMSL"
        )
        return under


def _is_vertical(kept: PlacedStop, new: PlacedStop) -> bool:
    """Whether a stop is straight above or below the one before, and no take-off's."""
    return abs(float(new.position[2] - kept.position[2])) >= SAME_PLACE and new.stop.command not in TAKEOFFS


def _step_aside(kept: list[PlacedStop], point: Floats) -> Floats:
    """Position `VERTICAL_STEP` m further on the course to the last one, or east of it, at the height of a point."""
    course = math.pi / 2.0
    if len(kept) > 1:
        course = float(leg_courses(np.array([kept[-2].position, kept[-1].position]))[0])
    east, north, _ = kept[-1].position
    return np.array([east + VERTICAL_STEP * math.sin(course), north + VERTICAL_STEP * math.cos(course), point[2]])


def _merge(source: str, kept: PlacedStop, new: PlacedStop, notes: Notes) -> ItineraryStop:
    """Leave out a stop at the place of the one before it; returns the one before, under its number."""
    before, after = kept.stop, new.stop
    climb = float(new.position[2] - kept.position[2])
    if abs(climb) >= SAME_PLACE:
        side = "above" if climb > 0.0 else "below"
        if after.command not in TAKEOFFS:
            raise MissionError(
                f"{source}: {_name(after)}: {abs(climb):.1f} m straight {side} {_name(before)}:"
                " no fixed wing flies that; places differ by 1 m or more across the ground, or in nothing"
            )
        notes.add(f"the {abs(climb):.0f} m to climb or sink on the spot are flown on the leg that follows", after.item)
    else:
        notes.add(f"at the place of {_name(before)}: merged with it", after.item)
    return before if before.item >= 0 else after


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
