"""Place a mission's stops on the map, and build a scenario around a mission file without one."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flight.mission.items import (
    AMSL,
    LANDINGS,
    OVER_HOME,
    PLACES,
    TAKEOFFS,
    Command,
    Home,
    Mission,
    MissionItem,
    Notes,
)
from flight.mission.itinerary import (
    Itinerary,
    Loiter,
    OpenItem,
    RoutePoint,
    make_itinerary,
    pass_by_distance,
    stated_loiter,
)
from flight.mission.return_path import LandingStart, ReturnPoint
from world.arrays import Floats
from world.errors import MissionError, TerrainError
from world.frames import GeoOrigin, to_geo, to_map
from world.geometry import leg_courses
from world.raster import coverage_text, open_raster, read_terrain
from world.raster_file import RasterFile
from world.scenario import GROUND_BUFFER, Scenario, scenario_from_spec
from world.scenario_tables import MAP_EXTENT, AreaTable, EndTable, FlightTable, OriginTable, ScenarioFile, TerrainTable
from world.terrain import Terrain

# Horizontal distance below which two positions are treated as the same, m.
SAME_POSITION_DISTANCE_M = 1.0
# Horizontal length of a vertical leg, m: one meter of height on it is a slope of 89.4 degrees.
VERTICAL_LEG_LENGTH_M = 0.01
# Minimum altitude of a flight, m AMSL.
MIN_ALTITUDE_M = -500.0
# Maximum altitude of a flight, m AMSL.
MAX_ALTITUDE_M = 9000.0
# Maximum difference between home's altitude and the ground there without a note, m: nine in ten heights of the usual
# elevation files are within 9 m of the truth.
HOME_ALTITUDE_TOLERANCE_M = 10.0


class PlacedLanding(NamedTuple):
    """A landing sequence of a mission to which an RTL may continue.

    start: start of the sequence.
    stops: stops in flying order, the landing last.
    ground: altitude of the landing point, m; None if unknown.
    notes: parts that are not flown as written.
    open_items: items that leave the verdict undecided.
    """

    start: LandingStart
    stops: tuple[RoutePoint, ...]
    ground: float | None
    notes: tuple[str, ...] = ()
    open_items: tuple[OpenItem, ...] = ()


@dataclass(frozen=True, slots=True)
class PlacedMission:
    """Stops of a mission on the map about ``origin``, with altitudes AMSL.

    stops: stops in flying order; a stop at the position of the previous stop is merged with it.
    notes: notes on the placing, after the itinerary's notes.
    takeoff_ground: altitude of the ground at home, m; None if unknown, or if the mission has no take-off.
    landing_ground: altitude of the landing point, m; None if unknown, or if the mission has no landing.
    return_points: home, at the reference altitude of heights above home, and then the rally points; empty if the
        mission does not end with an RTL.
    landings: landing sequences to which an RTL may continue, and that are simulated.
    landing_starts: starts of all landing sequences, including those to which no RTL continues.
    home_up: altitude of the mission's home, m AMSL: stated, or the ground there; NaN if unknown.
    """

    mission: Mission
    origin: GeoOrigin
    itinerary: Itinerary
    stops: tuple[RoutePoint, ...]
    notes: tuple[str, ...]
    takeoff_ground: float | None
    landing_ground: float | None
    return_points: tuple[ReturnPoint, ...] = ()
    landings: tuple[PlacedLanding, ...] = ()
    landing_starts: tuple[LandingStart, ...] = ()
    home_up: float = math.nan


def place_stops(
    mission: Mission,
    origin: GeoOrigin,
    terrain: Terrain | None,
    *,
    itinerary: Itinerary | None = None,
    vertical_legs: bool = False,
    resets_jump_counters: bool = False,
) -> PlacedMission:
    """Place the stops of a mission's itinerary on the map about ``origin``, with altitudes AMSL.

    terrain: None if unknown; heights above terrain are then an error.
    itinerary: the mission's itinerary; None to make it.
    vertical_legs: True to accept a position straight above or below the previous one. It is placed
        `VERTICAL_LEG_LENGTH_M` away; the verdict's slope rule judges the vertical leg. False to raise an error for
        such a position.
    resets_jump_counters: see `flight.mission.itinerary.make_itinerary`.

    In the result successive stops are at least `SAME_POSITION_DISTANCE_M` apart horizontally; on a vertical leg they
    are `VERTICAL_LEG_LENGTH_M` apart. Raises MissionError, which names the item, if a stop cannot be placed.

    >>> from flight.mission.items import Command, Frame, MissionItem
    >>> items = [MissionItem(k, Command.NAV_WAYPOINT, Frame.GLOBAL, (0.0,) * 4, 36.5, 8.0, 700.0) for k in (1, 2)]
    >>> placed = place_stops(Mission(None, tuple(items)), GeoOrigin(36.5, 8.0), None)
    >>> len(placed.stops), placed.notes
    (1, ('item 2: merged with item 1, which has the same position',))
    """
    notes = Notes()
    if itinerary is None:
        itinerary = make_itinerary(mission, resets_jump_counters=resets_jump_counters)
    heights = _AltitudeConverter(mission.source, itinerary.home, origin, terrain, notes)
    stops = _place_stops(mission.source, itinerary, origin, heights, vertical_legs)
    ground_at_home = heights.ground_at_home()
    takeoff_ground = None if itinerary.takeoff is None or math.isnan(ground_at_home) else ground_at_home
    landing_ground = heights.landing_altitude(itinerary)
    return_mission, return_heights, home = mission, heights, itinerary.last_home or itinerary.home
    if home is not itinerary.home:
        # An RTL and its landing sequence use the home of the last DO_SET_HOME.
        return_mission = replace(mission, home=home)
        return_heights = _AltitudeConverter(mission.source, home, origin, terrain, notes)
    return_points = (
        _place_return_points(return_mission, home, origin, return_heights) if itinerary.ends_with_rtl else ()
    )
    numbered_starts = tuple(_landing_starts(return_mission, origin, return_heights)) if itinerary.ends_with_rtl else ()
    landings = _place_landings(return_mission, origin, return_heights, numbered_starts)
    return PlacedMission(
        mission,
        origin,
        itinerary,
        tuple(stops),
        notes.lines(),
        takeoff_ground,
        landing_ground,
        return_points,
        landings,
        tuple(start for _, start in numbered_starts),
        heights.known_home_altitude(),
    )


def return_points(mission: Mission, origin: GeoOrigin, terrain: Terrain | None) -> tuple[ReturnPoint, ...]:
    """Return home and the rally points of a mission on the map, home first; () without a home.

    Raises MissionError, which names the rally point, if it is beyond the maximum extent of the map.

    >>> from flight.mission.items import Command, Frame, MissionItem
    >>> items = (MissionItem(1, Command.NAV_WAYPOINT, Frame.GLOBAL, (0.0,) * 4, 36.5, 8.0, 700.0),)
    >>> return_points(Mission(Home(36.5, 8.0, 300.0), items), GeoOrigin(36.5, 8.0), None)[0].up
    300.0
    """
    if mission.home is None:
        return ()
    heights = _AltitudeConverter(mission.source, mission.home, origin, terrain, Notes())
    return _place_return_points(mission, mission.home, origin, heights)


def home_point(mission: Mission, origin: GeoOrigin, terrain: Terrain | None) -> ReturnPoint | None:
    """Return a mission's home on the map, or None if the mission has no home.

    Unlike `return_points`, this does not check the rally points.

    >>> home_point(Mission(Home(36.5, 8.0, 300.0), ()), GeoOrigin(36.5, 8.0), None).up
    300.0
    """
    points = return_points(replace(mission, rally=()), origin, terrain)
    return points[0] if points else None


def landing_starts(mission: Mission, origin: GeoOrigin, terrain: Terrain | None) -> tuple[LandingStart, ...]:
    """Return the starts of a mission's landing sequences: the first position after each DO_LAND_START.

    A mission without a home has no landing sequences, because there is nowhere to return to. A start without a stated
    altitude has the altitude of home.

    >>> from flight.mission.items import Command, Frame, MissionItem
    >>> start = MissionItem(1, Command.DO_LAND_START, Frame.MISSION, (0.0,) * 4, 0.0, 0.0, 0.0)
    >>> land = MissionItem(2, Command.NAV_LAND, Frame.GLOBAL_RELATIVE_ALT, (0.0,) * 4, 36.5, 8.0, 10.0)
    >>> landing_starts(Mission(Home(36.5, 8.0, 300.0), (start, land)), GeoOrigin(36.5, 8.0), None)[0][:2]
    (2, (0.0, 0.0, 310.0))
    """
    if mission.home is None:
        return ()
    heights = _AltitudeConverter(mission.source, mission.home, origin, terrain, Notes())
    return tuple(start for _, start in _landing_starts(mission, origin, heights))


def _landing_starts(
    mission: Mission, origin: GeoOrigin, heights: "_AltitudeConverter"
) -> Iterator[tuple[int, LandingStart]]:
    """Yield the list index of each DO_LAND_START with the start of its landing sequence.

    heights: converter that has the mission's home.

    A DO_LAND_START is left out if no position follows it.
    """
    for index, mark in enumerate(mission.items):
        first_item = next((item for item in mission.items[index + 1 :] if _is_navigation_target(item)), None)
        if mark.command != Command.DO_LAND_START or first_item is None:
            continue
        start = _landing_stop(first_item, origin, heights)
        next_stops = _stops_to_landing(mission.items[index + 1 :], origin, heights)[1:]
        mark_position = _item_position(mark, origin, heights) if mark.has_position else start.position
        touchdown = next((item for item in mission.items[index + 1 :] if item.command in LANDINGS), None)
        landing = (
            None if touchdown is None or not touchdown.has_position else _item_position(touchdown, origin, heights)
        )
        yield index, start._replace(reference_position=mark_position, next_stops=next_stops, landing=landing)


def _place_landings(
    mission: Mission,
    origin: GeoOrigin,
    heights: "_AltitudeConverter",
    numbered_starts: Sequence[tuple[int, LandingStart]],
) -> tuple[PlacedLanding, ...]:
    """Return the landing sequences of a mission that can be simulated after an RTL.

    numbered_starts: list index of each DO_LAND_START with the start of its sequence.

    A sequence is left out if it begins with the landing, or if it cannot be placed on the map.
    """
    landings = []
    for index, start in numbered_starts:
        if start.is_landing:
            continue
        try:
            itinerary = make_itinerary(replace(mission, items=mission.items[index:]))
            stops = _place_stops(mission.source, itinerary, origin, heights, vertical_legs=False)
        except MissionError:
            continue
        if itinerary.landing is not None and len(stops) > 1:
            landings.append(
                PlacedLanding(
                    start, tuple(stops), heights.landing_altitude(itinerary), itinerary.notes, itinerary.open_items
                )
            )
    return tuple(landings)


def landing_sequence(
    mission: Mission, origin: GeoOrigin, terrain: Terrain | None, first: int
) -> tuple[LandingStart, ...]:
    """Return the stops of a landing sequence from an item up to the landing, without the landing.

    first: number (seq) of the item with which the sequence starts.

    The result is empty for a mission without a home.

    >>> from flight.mission.items import Command, Frame, MissionItem
    >>> over, none = int(Frame.GLOBAL_RELATIVE_ALT), (0.0,) * 4
    >>> line_up = [MissionItem(k, Command.NAV_WAYPOINT, over, none, 36.5, 8.0 + 0.01 * k, 60.0) for k in (3, 4)]
    >>> land = MissionItem(5, Command.NAV_LAND, over, none, 36.5, 8.0, 0.0)
    >>> mission = Mission(Home(36.5, 8.0, 300.0), (*line_up, land))
    >>> [one.item for one in landing_sequence(mission, GeoOrigin(36.5, 8.0), None, 3)]
    [3, 4]
    """
    if mission.home is None:
        return ()
    heights = _AltitudeConverter(mission.source, mission.home, origin, terrain, Notes())
    return _stops_to_landing([item for item in mission.items if item.seq >= first], origin, heights)


def _stops_to_landing(
    items: Sequence[MissionItem], origin: GeoOrigin, heights: "_AltitudeConverter"
) -> tuple[LandingStart, ...]:
    """Return the stops of the items with a position before the first landing item."""
    stops = []
    for item in items:
        if item.command in LANDINGS:
            break
        if _is_navigation_target(item):
            stops.append(_landing_stop(item, origin, heights))
    return tuple(stops)


def _is_navigation_target(item: MissionItem) -> bool:
    """Return True if the aircraft flies to the item's position."""
    return item.command in PLACES | LANDINGS and item.has_position


def _item_position(item: MissionItem, origin: GeoOrigin, heights: "_AltitudeConverter") -> tuple[float, float, float]:
    """Return an item's map position (east, north, up AMSL, m), at home's altitude if it states none."""
    stop = RoutePoint(item.seq, item.command, item.lat_deg, item.lon_deg, item.alt, item.frame, math.nan)
    east, north = project_stops(heights.source, (stop,), origin)[0].tolist()
    return east, north, heights.stop_altitude(stop, east, north, heights.home_amsl())


def _landing_stop(item: MissionItem, origin: GeoOrigin, heights: "_AltitudeConverter") -> LandingStart:
    """Return a stop of a landing sequence: its position, its loiter if any, and the altitude of home.

    The field ``next_stops`` is empty, and the distance to the sequence is measured to the item's position.
    """
    position, loiter = _item_position(item, origin, heights), stated_loiter(item)
    stated = loiter or Loiter(0.0)
    return LandingStart(
        *(item.seq, position, position, loiter is not None, stated.radius),
        is_landing=item.command in LANDINGS,
        pass_by=pass_by_distance(item),
        home_up=heights.known_home_altitude(),
        to_altitude=stated.to_altitude,
        exits_on_course=stated.exits_on_course,
        exits_on_tangent=stated.exits_on_tangent,
    )


def landing_positions(mission: Mission, origin: GeoOrigin) -> tuple[tuple[int, float, float], ...]:
    """Return the item number, east and north (m) of each landing item with a position.

    >>> from flight.mission.items import Command, Frame, MissionItem
    >>> land = MissionItem(2, Command.NAV_LAND, Frame.GLOBAL_RELATIVE_ALT, (0.0,) * 4, 36.5, 8.0, 10.0)
    >>> landing_positions(Mission(None, (land,)), GeoOrigin(36.5, 8.0))
    ((2, 0.0, 0.0),)
    """
    positions = []
    for item in mission.items:
        if item.command in LANDINGS and item.has_position:
            stop = RoutePoint(item.seq, item.command, item.lat_deg, item.lon_deg, item.alt, item.frame, math.nan)
            east, north = project_stops(mission.source, (stop,), origin)[0].tolist()
            positions.append((item.seq, float(east), float(north)))
    return tuple(positions)


def rally_stops(mission: Mission) -> tuple[RoutePoint, ...]:
    """Return a mission's rally points as stops; a point at 0, 0 is ignored, as in ArduPlane.

    >>> from flight.mission.items import Frame, MissionItem
    >>> point = MissionItem(0, 5100, Frame.GLOBAL_RELATIVE_ALT, (0.0,) * 4, 36.5, 8.0, 90.0)
    >>> [(stop.lat_deg, stop.alt) for stop in rally_stops(Mission(None, (), rally=(point,)))]
    [(36.5, 90.0)]
    """
    return tuple(
        RoutePoint(item.seq, item.command, item.lat_deg, item.lon_deg, item.alt, item.frame, math.nan)
        for item in mission.rally
        if item.has_position
    )


def _place_return_points(
    mission: Mission, home: Home, origin: GeoOrigin, heights: "_AltitudeConverter"
) -> tuple[ReturnPoint, ...]:
    """Return home and the rally points on the map, home first.

    heights: converter that has this home.

    Raises MissionError, which names the rally point, if it is beyond the maximum extent of the map.
    """
    east, north = to_map(origin, home.lat_deg, home.lon_deg)
    launch = ReturnPoint(float(east), float(north), heights.home_amsl())
    return_points = [launch]
    stops = rally_stops(mission)
    numbers = [number for number, item in enumerate(mission.rally, 1) if item.has_position]
    rally_positions = project_stops(mission.source, stops, origin).tolist()
    for number, stop, (point_east, point_north) in zip(numbers, stops, rally_positions, strict=True):
        # Ground stations always write a rally point's height; a point without height gets home's altitude.
        up = heights.stop_altitude(stop, point_east, point_north, launch.up)
        base = launch.up if stop.frame in OVER_HOME else 0.0
        return_points.append(ReturnPoint(point_east, point_north, up, base, number))
    return tuple(return_points)


def _place_stops(
    source: str, itinerary: Itinerary, origin: GeoOrigin, heights: "_AltitudeConverter", vertical_legs: bool
) -> list[RoutePoint]:
    """Return an itinerary's stops on the map.

    Successive stops at the same position are merged into one.

    heights: converter that also receives the notes.
    vertical_legs: True to accept a position straight above or below the previous one; see `place_stops`.
    """
    notes = heights.notes
    map_positions = project_stops(source, itinerary.stops, origin)
    placed_stops: list[RoutePoint] = []
    for stop, (east, north) in zip(itinerary.stops, map_positions.tolist(), strict=True):
        previous_altitude = placed_stops[-1].map_position[2] if placed_stops else math.nan
        placed_stop = stop.placed_at((east, north, heights.stop_altitude(stop, east, north, previous_altitude)))
        is_loiter_or_return = stop.loiter is not None or bool(placed_stops and placed_stops[-1].loiter is not None)
        is_loiter_or_return = is_loiter_or_return or stop.command == Command.NAV_RETURN_TO_LAUNCH
        if (
            placed_stops
            and not is_loiter_or_return
            and math.dist(placed_stops[-1].map_position[:2], placed_stop.map_position[:2]) < SAME_POSITION_DISTANCE_M
        ):
            is_vertical = abs(placed_stop.map_position[2] - previous_altitude) >= SAME_POSITION_DISTANCE_M
            if vertical_legs and is_vertical and stop.command not in TAKEOFFS:
                # The end of a vertical leg lies `VERTICAL_LEG_LENGTH_M` from its start, on the course of the last leg,
                # or to the east without a leg.
                last_positions, course = [placed.map_position for placed in placed_stops[-2:]], math.pi / 2.0
                if len(last_positions) > 1:
                    course = float(leg_courses(np.array(last_positions))[0])
                east = last_positions[-1][0] + VERTICAL_LEG_LENGTH_M * math.sin(course)
                north = last_positions[-1][1] + VERTICAL_LEG_LENGTH_M * math.cos(course)
                placed_stops.append(stop.placed_at((east, north, placed_stop.map_position[2])))
                continue
            merged_stop = _merge_stops(source, placed_stops[-1], placed_stop, notes)
            placed_stops[-1] = merged_stop.placed_at(placed_stops[-1].map_position)
        else:
            placed_stops.append(placed_stop)
    return placed_stops


def project_stops(source: str, stops: tuple[RoutePoint, ...], origin: GeoOrigin) -> Floats:
    """Return east and north of each stop on the map about an origin, (n, 2) m.

    source: name of the mission in errors.

    Raises MissionError, which names the item, if a stop is beyond the maximum extent of the map.
    """
    east, north = to_map(origin, [stop.lat_deg for stop in stops], [stop.lon_deg for stop in stops])
    points = np.stack([east, north], axis=1)
    is_outside = ~(np.abs(points) <= MAP_EXTENT).all(axis=1)
    if is_outside.any():
        stop = stops[int(np.argmax(is_outside))]
        raise MissionError(
            f"{source}: {_stop_name(stop)}: latitude {stop.lat_deg:.7f}, longitude {stop.lon_deg:.7f}: more than"
            f" {MAP_EXTENT / 1000:.0f} km from the map's origin at {origin.lat_deg:.5f}, {origin.lon_deg:.5f}"
            " (columns swapped, or a sign lost?)",
            file=source,
            field=_stop_name(stop),
            value=(stop.lat_deg, stop.lon_deg),
        )
    return points


class _AltitudeConverter:
    """Converter of altitudes in the frame of their item to altitudes AMSL, for one home and one terrain."""

    def __init__(self, source: str, home: Home, origin: GeoOrigin, terrain: Terrain | None, notes: Notes) -> None:
        self.source = source
        self.origin = origin
        self.terrain = terrain
        self.notes = notes
        self.home = home
        self._home_amsl: float | None = None

    def stop_altitude(self, stop: RoutePoint, east: float, north: float, previous_altitude: float) -> float:
        """Return the altitude of a stop, m AMSL.

        A stop without an altitude keeps the altitude of the previous stop.

        previous_altitude: altitude of the previous stop, m AMSL; NaN for the first stop.
        """
        if math.isnan(stop.alt):
            if math.isnan(previous_altitude):
                message = f"{self.source}: {_stop_name(stop)}: no altitude, and no earlier item has one to keep"
                raise MissionError(message, file=self.source, field="altitude")
            return previous_altitude
        if stop.frame in AMSL:
            altitude = stop.alt
        elif stop.frame in OVER_HOME:
            altitude = self.home_amsl() + stop.alt
        else:
            terrain = self.terrain
            ground = math.nan if terrain is None else float(terrain.height(east, north))
            if math.isnan(ground):
                position_text = f"latitude {stop.lat_deg:.5f}, longitude {stop.lon_deg:.5f}"
                request = f"{_stop_name(stop)}: height above terrain (frame {stop.frame}) at {position_text}"
                no_terrain_text = "requires terrain; name an elevation file (--terrain)"
                reason = no_terrain_text if terrain is None else f"{terrain.source} has no data there"
                message = f"{self.source}: {request}: {reason}"
                raise MissionError(message, file=self.source, field="frame", value=stop.frame)
            altitude = ground + stop.alt
        if not MIN_ALTITUDE_M <= altitude <= MAX_ALTITUDE_M:
            allowed = f"allowed {MIN_ALTITUDE_M:.0f}..{MAX_ALTITUDE_M:.0f}"
            raise MissionError.at(self.source, _stop_name(stop), altitude, allowed, shown=f"{altitude:.1f} m AMSL")
        return altitude

    def home_amsl(self) -> float:
        """Return home's altitude, m AMSL: as stated, otherwise the ground at home, otherwise 0.

        Heights above home are measured from this altitude. It is determined only once, with a note if it is not stated
        or is far from the ground at home.
        """
        if self._home_amsl is not None:
            return self._home_amsl
        home, ground = self.home, self.ground_at_home()
        if not math.isnan(home.alt):
            if abs(home.alt - ground) > HOME_ALTITUDE_TOLERANCE_M:
                hint = "" if home.alt else ". Ground stations write 0 if no home was set"
                shift_text = f"{abs(home.alt - ground):.0f} m {'lower' if home.alt > ground else 'higher'}"
                self.notes.add(
                    f"home is at {home.alt:.1f} m AMSL, but the ground there is at {ground:.1f} m AMSL, {shift_text}."
                    " Heights above home are measured from home's altitude. After arming on that ground they are"
                    f" {shift_text} than here. For a launch from that ground, set home to {ground:.1f} m AMSL{hint}"
                )
        elif math.isnan(ground):
            self.notes.add(
                "home has no altitude, and there is no terrain, so heights above home are measured from 0 m AMSL"
            )
            ground = 0.0
        else:
            self.notes.add(
                "home has no altitude, so the altitude of the ground there is used:"
                f" {ground:.1f} m AMSL at {home.lat_deg:.7f}, {home.lon_deg:.7f}"
            )
        self._home_amsl = ground if math.isnan(home.alt) else home.alt
        return self._home_amsl

    def landing_altitude(self, itinerary: Itinerary) -> float | None:
        """Return the altitude of the landing point, m AMSL; None if unknown.

        If the landing point states a height above home, its altitude is known only if the terrain or the altitude of
        home is known, or if the previous stop also states a height above home.
        """
        stop = itinerary.landing
        if stop is None or math.isnan(stop.alt):
            return None
        is_known = stop.frame in AMSL or self.terrain is not None
        if stop.frame in OVER_HOME:
            previous_frame = itinerary.stops[-2].frame if len(itinerary.stops) > 1 else stop.frame
            is_known = is_known or not math.isnan(self.home.alt) or previous_frame in OVER_HOME
        east, north = to_map(self.origin, stop.lat_deg, stop.lon_deg)
        return self.stop_altitude(stop, float(east), float(north), math.nan) if is_known else None

    def ground_at_home(self) -> float:
        """Return the altitude of the ground at home, m AMSL; NaN if unknown."""
        home = self.home
        if self.terrain is not None:
            east, north = to_map(self.origin, home.lat_deg, home.lon_deg)
            if abs(float(east)) <= MAP_EXTENT and abs(float(north)) <= MAP_EXTENT:
                return float(self.terrain.height(east, north))
        return math.nan

    def known_home_altitude(self) -> float:
        """Return the altitude of home, or of the ground at home, m AMSL; NaN if both are unknown."""
        return self.ground_at_home() if math.isnan(self.home.alt) else self.home.alt


def _merge_stops(source: str, previous: RoutePoint, stop: RoutePoint, notes: Notes) -> RoutePoint:
    """Merge a stop with the previous stop at the same horizontal position, and add a note.

    The result is the previous stop, or the new stop if the previous stop has no mission item. Raises MissionError if
    the stop is straight above or below the previous stop, unless the stop is a take-off.
    """
    climb = stop.map_position[2] - previous.map_position[2]
    if abs(climb) >= SAME_POSITION_DISTANCE_M:
        direction = "above" if climb > 0.0 else "below"
        if stop.command not in TAKEOFFS:
            raise MissionError(
                f"{source}: {_stop_name(stop)}: {abs(climb):.1f} m straight {direction}"
                f" {_stop_name(previous)}:"
                " no fixed-wing aircraft can fly that; two positions must be identical, or at least 1 m apart over the"
                " ground",
                file=source,
                field=_stop_name(stop),
            )
        notes.add(
            f"no aircraft climbs or sinks on the spot, so these {abs(climb):.0f} m are flown on the next leg", stop.item
        )
    else:
        notes.add(f"merged with {_stop_name(previous)}, which has the same position", stop.item)
    return previous if previous.item >= 0 else stop


def _stop_name(stop: RoutePoint) -> str:
    """Return the name of a stop in messages."""
    if stop.command == Command.NAV_RALLY_POINT:
        return f"rally point {stop.item + 1}"
    return f"item {stop.item}" if stop.item >= 0 else "home"


# ----------------------------------------------------------------------
# A scenario around a mission file that came without one.

# Margin of the area around the mission's positions, and of the ceiling above its highest, m.
AREA_MARGIN_M = 2000.0
# Largest distance between home and the first position, m: ground stations write a default position if no home was set,
# so that a more distant home does not belong to the mission.
_MAX_HOME_DISTANCE_M = 100_000.0


@dataclass(frozen=True, slots=True)
class ImpliedScenario:
    """Scenario built around a mission, and the placed mission."""

    scenario: Scenario
    placed: PlacedMission


def implied_scenario(
    mission: Mission, terrain_path: str | None, flight: FlightTable | None = None, *, vertical_legs: bool = False
) -> ImpliedScenario:
    """Build a scenario around a mission that has none: an area, no threats, and default limits.

    The scenario's ``external`` is True.

    terrain_path: an elevation file or a built-in name; None for no terrain.
    flight: the scenario's [flight] table; None for the defaults.
    vertical_legs: see `place_stops`.

    The area is the bounding box of the mission's positions and loiters, home and rally points, with a margin of 2 km. A
    home or rally point more than 100 km from the start of the mission is left out.

    Start and destination are the first and last positions of the mission. A scenario requires them to be above the
    ground, so they are raised to 1 m above it if necessary. The route and its verdict keep the mission's altitudes.

    Raises MissionError if the mission cannot be placed on the map. Raises TerrainError if the ground is unknown at all
    positions of the mission.

    >>> from flight.mission.items import Command, Frame, MissionItem
    >>> items = [
    ...     MissionItem(k, Command.NAV_WAYPOINT, Frame.GLOBAL, (0.0,) * 4, lat, -84.2, 700.0)
    ...     for k, lat in enumerate((36.50, 36.51), 1)
    ... ]
    >>> scenario = implied_scenario(Mission(None, tuple(items)), terrain_path=None).scenario
    >>> scenario.external, scenario.bounds.round().tolist()
    (True, [[-2000.0, 2000.0], [-2000.0, 3110.0]])
    """
    itinerary = make_itinerary(mission)
    origin = mission_origin(mission, itinerary.stops)
    points = project_stops(mission.source, itinerary.stops, origin)
    # The area, (2, 2) [[west, east], [south, north]]. A return flies to home or a rally point from anywhere on the
    # route.
    targets = [(stop.lat_deg, stop.lon_deg) for stop in rally_stops(mission)]
    targets += [] if mission.home is None else [(mission.home.lat_deg, mission.home.lon_deg)]
    targets_on_map = np.stack(to_map(origin, *np.reshape(targets, (-1, 2)).T), axis=1)
    is_near = np.hypot(*(targets_on_map - points[0]).T) <= _MAX_HOME_DISTANCE_M
    positions = np.vstack([points, targets_on_map[is_near]])
    margin = AREA_MARGIN_M + max(0.0 if stop.loiter is None else abs(stop.loiter.radius) for stop in itinerary.stops)
    area = np.stack([positions.min(axis=0) - margin, positions.max(axis=0) + margin], axis=1)
    area = np.clip(area, -MAP_EXTENT, MAP_EXTENT)
    terrain, terrain_table = None, TerrainTable(kind="none")
    if terrain_path is not None:
        raster, (lat, lon) = open_raster(terrain_path), to_geo(origin, *points.T)
        if _covers_any(raster, lat, lon):
            terrain = read_terrain(raster, origin, area, GROUND_BUFFER)
        if terrain is None or not np.isfinite(terrain.height(points[:, 0], points[:, 1])).any():
            raise _coverage_error(terrain_path, raster, lat, lon)
        path = str(Path(terrain_path).resolve()) if Path(terrain_path).is_file() else terrain_path
        terrain_table = TerrainTable(kind="dem", path=path, sha256=terrain.sha256)
    placed_mission = place_stops(mission, origin, terrain, itinerary=itinerary, vertical_legs=vertical_legs)
    stop_positions = [stop.map_position for stop in placed_mission.stops]
    highest = max(up for _, _, up in stop_positions)
    highest = highest if terrain is None else max(highest, float(np.nanmax(terrain.heights)))
    start, destination = (
        EndTable(
            east_m=east,
            north_m=north,
            amsl_m=up if terrain is None else max(up, float(terrain.height(east, north)) + 1.0),
        )
        for east, north, up in (stop_positions[0], stop_positions[-1])
    )
    file_name = re.split(r"[/\\]", mission.source)[-1]
    name = "".join(character if character.isprintable() else "?" for character in file_name)
    spec = ScenarioFile(
        name=name[:100] or "mission",
        description="Made around a mission that came without a scenario",
        origin=OriginTable(lat_deg=origin.lat_deg, lon_deg=origin.lon_deg),
        terrain=terrain_table,
        area=AreaTable(
            east_m=area[0].tolist(),
            north_m=area[1].tolist(),
            ceiling_amsl_m=min(highest + AREA_MARGIN_M, MAX_ALTITUDE_M),
        ),
        start=start,
        destination=destination,
        flight=flight or FlightTable(aircraft_by_default=True),
    )
    return ImpliedScenario(scenario_from_spec(spec, mission.source, ground=terrain, external=True), placed_mission)


def mission_origin(mission: Mission, stops: tuple[RoutePoint, ...]) -> GeoOrigin:
    """Return the map origin for a mission without a scenario: home, or the mission's first position.

    stops: stops of the mission's itinerary.

    Home is used if it is within 100 km of the first position. Raises MissionError beyond 89 degrees of latitude.
    """
    first_stop = stops[0]
    positions = [item for item in mission.items if item.has_position and item.seq >= first_stop.item]
    lat, lon = (positions[0].lat_deg, positions[0].lon_deg) if positions else (first_stop.lat_deg, first_stop.lon_deg)
    if abs(lat) > 89.0:
        allowed = "a mission is flown within -89..89 degrees"
        message = f"{mission.source}: latitude {lat:.7f}: {allowed}"
        raise MissionError(message, file=mission.source, field="latitude", value=lat, allowed=allowed)
    origin = GeoOrigin(lat, lon)
    home = mission.home
    if home is not None and abs(home.lat_deg) <= 89.0:
        east, north = to_map(origin, home.lat_deg, home.lon_deg)
        if math.hypot(float(east), float(north)) <= _MAX_HOME_DISTANCE_M:
            origin = GeoOrigin(home.lat_deg, home.lon_deg)
    return origin


def _coverage_error(path: str, raster: RasterFile, lat: Floats, lon: Floats) -> TerrainError:
    """Return the error for an elevation file that has no data at any position of a mission.

    path: elevation file or built-in name.
    lat, lon: positions of the mission's stops, degrees, (n,).
    """
    positions_text = f"latitude {lat.min():.4f}..{lat.max():.4f}, longitude {lon.min():.4f}..{lon.max():.4f}"
    swap_text = (
        ". With latitude and longitude swapped, the mission would lie in this terrain"
        if _covers_any(raster, lon, lat)
        else ""
    )
    return TerrainError(
        f"{path}: no data at any position of the mission, which flies to {positions_text};"
        f" the terrain covers {coverage_text(raster)}{swap_text}",
        file=path,
    )


def _covers_any(raster: RasterFile, lat: Floats, lon: Floats) -> bool:
    """Return True if a raster covers at least one of the positions; lat, lon: degrees, (n,)."""
    (cols, rows), (row_count, col_count) = raster.to_pixels(lon, lat), raster.shape
    # False for a position that the file's coordinate system cannot express (NaN or inf).
    return bool(((cols >= 0.0) & (cols <= col_count - 1.0) & (rows >= 0.0) & (rows <= row_count - 1.0)).any())
