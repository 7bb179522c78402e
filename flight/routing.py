"""From a mission to the route that is flown: map positions and heights above mean sea level."""

import math

import numpy as np
from numpy.typing import NDArray

from flight.itinerary import Itinerary, Notes, Stop, plan_stops
from flight.mission import AMSL, OVER_HOME, TAKEOFFS, Home, Mission, command_name
from flight.route import Route
from world.errors import MissionError
from world.frames import GeoOrigin, to_map
from world.geometry import leg_courses
from world.scenario_file import MAP_REACH
from world.terrain import Terrain

Floats = NDArray[np.float64]

# Places nearer to each other than this (m) are one place.
SAME_PLACE = 1.0
# Heights (m AMSL) that a flight may be asked to keep.
LOWEST, HIGHEST = -500.0, 9000.0
# A home that is further than this (m) from the ground at its place is worth a note.
_HOME_ERROR = 30.0


def make_route(
    mission: Mission, origin: GeoOrigin, terrain: Terrain | None, default_airspeed: float, fly_over: bool
) -> Route:
    """Route of a mission in the map about ``origin``.

    terrain: None where none is known; heights above terrain are then an error.  default_airspeed: m/s until the
    mission sets one (a `.plan` file's cruiseSpeed is its ground station's estimate and sets none).  fly_over: whether
    waypoints are flown through instead of by.

    Without TAKEOFF the route starts at the first position item; with one, over home at that item's height.  Every leg
    has a horizontal length of at least `SAME_PLACE`.  Raises MissionError, naming the item, for what cannot be placed,
    and for a mission of fewer than two places.
    """
    itinerary = plan_stops(mission, default_airspeed)
    notes = Notes()
    heights = _Heights(mission.source, itinerary, origin, terrain, notes)
    flat = _on_map(mission.source, itinerary.stops, origin)
    kept: list[tuple[Stop, Floats]] = []
    for stop, (east, north) in zip(itinerary.stops, flat, strict=True):
        last = float(kept[-1][1][2]) if kept else math.nan
        point = np.array([east, north, heights.amsl(stop, float(east), float(north), last)])
        if kept and math.dist(kept[-1][1][:2], point[:2]) < SAME_PLACE:
            kept[-1] = (_merge(mission.source, kept[-1], (stop, point), notes), kept[-1][1])
        else:
            kept.append((stop, point))
    if len(kept) < 2:
        raise MissionError(f"{mission.source}: {len(kept)} place to fly to: at least two different ones are expected")
    stops = [stop for stop, _ in kept]
    waypoints = np.array([point for _, point in kept])
    if mission.cruise_speed not in (None, default_airspeed) and stops[1].airspeed == default_airspeed:
        notes.add(
            f"cruiseSpeed {mission.cruise_speed:g} m/s is the ground station's estimate and no command:"
            f" started at {default_airspeed:g} m/s"
        )
    return Route(
        waypoints=waypoints,
        airspeed=np.array([stop.airspeed for stop in stops[1:]]),
        acceptance=np.array([stop.acceptance for stop in stops]),
        fly_over=np.full(len(stops), fly_over),
        items=np.array([stop.item for stop in stops], dtype=np.int64),
        started=_started(itinerary, stops[0], waypoints),
        notes=itinerary.notes + notes.lines(),
    )


def _name(stop: Stop) -> str:
    return f"item {stop.item}" if stop.item >= 0 else "home"


def _on_map(source: str, stops: tuple[Stop, ...], origin: GeoOrigin) -> Floats:
    """East and north of each stop, (n, 2) m."""
    east, north = to_map(origin, [stop.lat_deg for stop in stops], [stop.lon_deg for stop in stops])
    points = np.stack([east, north], axis=1)
    far = ~(np.abs(points) <= MAP_REACH).all(axis=1)
    if far.any():
        stop = stops[int(np.argmax(far))]
        raise MissionError(
            f"{source}: {_name(stop)}: latitude {stop.lat_deg:.7f}, longitude {stop.lon_deg:.7f}: more than"
            f" {MAP_REACH / 1000:.0f} km from the map's origin at {origin.lat_deg:.5f}, {origin.lon_deg:.5f}"
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

    def amsl(self, stop: Stop, east: float, north: float, last: float) -> float:
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

    def _ground(self, stop: Stop, east: float, north: float) -> float:
        asked = f"{self.source}: {_name(stop)}: height above terrain (frame {stop.frame})"
        if self.terrain is None:
            raise MissionError(f"{asked}: no terrain is given to count from")
        under = float(self.terrain.height(east, north))
        if math.isnan(under):
            raise MissionError(f"{asked}: {self.terrain.source} has no data there")
        return under

    def _over_home(self, stop: Stop) -> float:
        if self._home_amsl is None:
            self._home_amsl = self._find_home(stop, self.home)
        return self._home_amsl

    def _find_home(self, stop: Stop, home: Home) -> float:
        under = math.nan
        if self.terrain is not None:
            east, north = to_map(self.origin, home.lat_deg, home.lon_deg)
            if abs(float(east)) <= MAP_REACH and abs(float(north)) <= MAP_REACH:
                under = float(self.terrain.height(east, north))
        if not math.isnan(home.alt):
            if abs(home.alt - under) > _HOME_ERROR:
                self.notes.add(
                    f"home is at {home.alt:.1f} m AMSL, and the ground there at {under:.1f} m:"
                    " heights over home count from the former"
                )
            return home.alt
        if math.isnan(under):
            self.notes.add("no home height, and no terrain to take one from: heights over home count from 0 m AMSL")
            return 0.0
        self.notes.add(
            f"no home height: taken as the ground at {home.lat_deg:.7f}, {home.lon_deg:.7f}, {under:.1f} m AMSL"
        )
        return under


def _merge(source: str, kept: tuple[Stop, Floats], new: tuple[Stop, Floats], notes: Notes) -> Stop:
    """Leave out a stop at the place of the one before it; returns the one before, under its number."""
    before, after = kept[0], new[0]
    climb = float(new[1][2] - kept[1][2])
    if abs(climb) >= SAME_PLACE:
        side = "above" if climb > 0.0 else "below"
        if not (before.loiters or after.loiters or after.command in TAKEOFFS):
            raise MissionError(
                f"{source}: {_name(after)}: {abs(climb):.1f} m straight {side} {_name(before)}:"
                " no fixed wing flies that; places differ by 1 m or more across the ground, or in nothing"
            )
        notes.add(f"the {abs(climb):.0f} m to climb or sink on the spot are flown on the leg that follows", after.item)
    else:
        notes.add(f"at the place of {_name(before)}: merged with it", after.item)
    return before if before.item >= 0 else after


def _started(itinerary: Itinerary, first: Stop, waypoints: Floats) -> str:
    course = math.degrees(float(leg_courses(waypoints)[0])) % 360.0
    where = f"{first.lat_deg:.7f}, {first.lon_deg:.7f}, {waypoints[0, 2]:.1f} m AMSL, on course {course:.0f} degrees"
    item = itinerary.takeoff
    if item is not None:
        name = command_name(item.command)
        over = "home" if itinerary.has_home else "the first position, as there is no home,"
        return f"{name} (item {item.seq}): starts trimmed in the air over {over} at that item's height: {where}"
    return f"no TAKEOFF: starts trimmed at the first position, item {first.item}: {where}"
