"""The flown ways from the ground and to it: where a mission's take-off begins and ends, and where its landing does.

A take-off is flown where the scenario says how the aircraft is launched and the mission begins with a take-off item; a
landing where the scenario has a strip and the mission ends with a landing item.  Everything else begins and ends in the
air.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import Command, Mission, MissionItem
from flight.mission.itinerary import LANDING_NOTE
from flight.mission.placing import home_place
from flight.mission.route import Route, part_of_route
from world.airfield import LandingStrip, Launch
from world.scenario import Scenario

Floats = NDArray[np.float64]

# Pitch (rad) that a take-off item without one climbs at: ArduPlane's own where the first number is 0.
USUAL_PITCH = math.radians(4.0)
# So high a catapult's rail begins over the ground, and so high a hand lets go, m.
_RAIL, _HAND = 1.0, 1.8


@dataclass(frozen=True, slots=True)
class TakeOff:
    """A take-off that is flown.

    launch: the scenario's.
    item: the mission item's number.
    home: (3,) m, on the ground there.
    course: of the launch, rad on the map.
    top: height at which it ends, m AMSL; base: home's, that the autopilot counts from.
    pitch: least of the climb, rad.
    waypoint: of the route, from which the mission goes on.
    speed: where the launch ends, over the ground, m/s.  acceleration: along it, m/s^2; 0 of a runway.
    """

    launch: Launch
    item: int
    home: Floats
    course: float
    top: float
    base: float
    pitch: float
    waypoint: int
    speed: float
    acceleration: float

    def release(self) -> tuple[Floats, Floats]:
        """Where the aircraft leaves rail or hand, and its velocity: (3,) m and m/s, east, north, up.

        Of a runway the place is the ground, for whoever knows how high the aircraft stands.
        """
        launch, along = self.launch, np.array([math.sin(self.course), math.cos(self.course)])
        if launch.method == "runway":
            return self.home.copy(), np.zeros(3)
        level, rise = math.cos(launch.incline), math.sin(launch.incline)
        run = launch.run if launch.method == "catapult" else 0.0
        above = _RAIL + run * rise if launch.method == "catapult" else _HAND
        place = np.array([*(self.home[:2] + run * level * along), self.home[2] + above])
        return place, self.speed * np.array([*(level * along), rise])

    def described(self) -> str:
        """How it begins, in words."""
        how = {"catapult": "from a catapult", "hand": "by hand", "runway": "on a runway"}[self.launch.method]
        course = math.degrees(self.course) % 360.0
        return (
            f"NAV_TAKEOFF (item {self.item}): launched {how} at home, {self.home[2]:.1f} m AMSL, on course"
            f" {course:.0f} degrees; the first leg begins above {self.top:.1f} m AMSL"
        )


@dataclass(frozen=True, slots=True)
class Approach:
    """A landing that is flown.

    strip: the scenario's.
    item: the mission item's number.
    leg: of the route, the last: it leads to the landing point.
    point: (3,) m, the landing point at the height that the mission states.
    course: of the landing, rad.  run: length of the leg, m.  begin: height at its beginning, m AMSL.
    tail_wind: m/s on that course at the landing point.
    base: height of home, m AMSL; the landing point's of a mission without one.
    """

    strip: LandingStrip
    item: int
    leg: int
    point: Floats
    course: float
    run: float
    begin: float
    tail_wind: float
    base: float

    def place(self, position: Floats) -> tuple[Floats, Floats]:
        """How far beyond the landing point, and to the right of its course, positions (n, 3) are, (n,) m."""
        return _along_aside(position, self.point, self.course)

    def on_strip(self, position: Floats) -> tuple[Floats, Floats]:
        """How far along the strip beyond its middle, and aside of that line, positions (n, 3) are, (n,) m.

        The strip lies where the scenario has it, along its stated course, or along the landing's where none is stated.
        A landing against the stated course is one along the same strip.
        """
        axis = self.course if self.strip.course is None else self.strip.course
        if math.cos(self.course - axis) < 0.0:
            axis += math.pi
        return _along_aside(position, np.array([self.strip.east, self.strip.north]), axis)


def _along_aside(position: Floats, begin: Floats, course: float) -> tuple[Floats, Floats]:
    """How far positions (n, 3) are ahead of a place on a course (rad), and to the right of it, (n,) m."""
    east, north = position[..., 0] - begin[0], position[..., 1] - begin[1]
    sin, cos = math.sin(course), math.cos(course)
    return east * sin + north * cos, east * cos - north * sin


@dataclass(frozen=True, slots=True)
class GroundWays:
    """What of a flight is flown from the ground and to it; None for what is not.

    notes: why a launch or a strip of the scenario is not flown, in sentences.
    """

    take_off: TakeOff | None = None
    approach: Approach | None = None
    notes: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """Whether any of it is flown."""
        return self.take_off is not None or self.approach is not None


def find_ground_ways(scenario: Scenario, mission: Mission, route: Route, slowest: float) -> GroundWays:
    """What of a mission is flown from the ground and to it in a scenario, whose route this is.

    slowest: of level flight, m/s, by which a launch goes that states no speed.

    >>> from world.scenario import load_scenario
    >>> bool(find_ground_ways(load_scenario("tight"), Mission(None, ()), None, 15.0))
    False
    """
    no_start = no_end = ""
    take_off = approach = None
    if scenario.launch is not None:
        take_off, no_start = _find_take_off(scenario, mission, route, slowest)
    if scenario.landing is not None:
        approach, no_end = _find_approach(scenario, mission, route)
    return GroundWays(take_off, approach, tuple(note for note in (no_start, no_end) if note))


def _find_take_off(scenario: Scenario, mission: Mission, route: Route, slowest: float) -> tuple[TakeOff | None, str]:
    """The take-off, or why none is flown."""
    launch, base = scenario.launch, home_place(mission, scenario.origin, scenario.terrain)
    items = {item.seq: item for item in mission.items if item.command == Command.NAV_TAKEOFF}
    numbers = route.items.tolist()
    first = next((k for k, seq in enumerate(numbers) if seq >= 0), 0)
    if launch is None or not items or numbers[first] not in items:
        return None, "[launch]: the mission does not begin with a NAV_TAKEOFF: its flight begins in the air"
    if base is None:
        return None, "[launch]: the mission has no home to take off from: its flight begins in the air"
    if first + 1 >= len(numbers):
        return None, "[launch]: nothing comes after the take-off: it is not flown"
    item, here = items[numbers[first]], np.array([base.east, base.north])
    ground = scenario.terrain.height(*here) if scenario.terrain is not None else base.up
    if math.isnan(ground):
        return None, "[launch]: the ground at home is not known: the flight begins in the air"
    # Where the take-off item has a place of its own, ArduPlane does not go there: the next item is the first place.
    ahead = route.waypoints[first + 1, :2] - here
    course = launch.course if launch.course is not None else math.atan2(ahead[0], ahead[1])
    home = np.array([*here, float(ground)])
    top, pitch = float(route.waypoints[first, 2]), climb_pitch(item)
    speed, pushed = launch.release_speed(slowest), launch.acceleration(slowest)
    return TakeOff(launch, item.seq, home, course, top, base.up, pitch, first, speed, pushed), ""


def climb_pitch(item: MissionItem) -> float:
    """Least pitch of the climb that a take-off item asks for, rad."""
    pitch = item.params[0]
    return math.radians(pitch) if pitch > 0.0 else USUAL_PITCH


def _find_approach(scenario: Scenario, mission: Mission, route: Route) -> tuple[Approach | None, str]:
    """The landing, or why none is flown."""
    strip, last = scenario.landing, route.legs
    items = {item.seq: item for item in mission.items if item.command == Command.NAV_LAND}
    if strip is None or not items or int(route.items[last]) not in items or last < 2:
        reason = "the mission does not end with two places and a NAV_LAND at a third"
        return None, f"[landing]: {reason}: its flight ends in the air"
    up = route.landing_ground
    begin, end = route.waypoints[last - 1], route.waypoints[last]
    if math.isnan(up):
        return None, "[landing]: the height of the landing point is not known: the flight ends in the air"
    if begin[2] <= up:
        return None, "[landing]: the approach begins no higher than the landing point: the flight ends in the air"
    step = end[:2] - begin[:2]
    course, run = math.atan2(step[0], step[1]), float(np.hypot(*step))
    point = np.array([end[0], end[1], up])
    wind, home = scenario.wind.along(course, up)[0], home_place(mission, scenario.origin, scenario.terrain)
    base = up if home is None else home.up
    return Approach(strip, int(route.items[last]), last - 1, point, course, run, float(begin[2]), wind, base), ""


def airborne_route(route: Route, ways: GroundWays, begun: Floats | None) -> Route:
    """The part of a route that is flown in the air, of which the usual rules judge.

    begun: (3,) m, where the take-off ended and the first leg begins; None for where the route begins.
    Without the leg to the landing point; numbers of legs and waypoints stay.
    """
    points = np.array(route.waypoints)
    if ways.take_off is not None and begun is not None:
        points[: ways.take_off.waypoint + 1] = begun
        # Waypoints before it are none of the flight's: each a little before the next, so that legs have a length.
        for k in range(ways.take_off.waypoint - 1, -1, -1):
            step = points[k + 1, :2] - points[k + 2, :2]
            points[k, :2] += step / max(1e-6, float(np.hypot(*step)))
    moved = replace(route, waypoints=points, notes=flown_notes(route, ways))
    return moved if ways.approach is None or ways.approach.leg < 1 else part_of_route(moved, 0, ways.approach.leg)


def shown_waypoints(route: Route, ways: GroundWays) -> Floats:
    """A route's waypoints (w, 3) m as pictures and tables show them: with the ends that are flown on the ground there.

    The route itself begins at the height where a take-off ends, and its leg to a landing point is level.
    """
    points = np.array(route.waypoints)
    if ways.take_off is not None:
        points[ways.take_off.waypoint, 2] = ways.take_off.home[2]
    if ways.approach is not None:
        points[ways.approach.leg + 1, 2] = ways.approach.point[2]
    return points


def flown_notes(route: Route, ways: GroundWays) -> tuple[str, ...]:
    """A route's notes without that of a landing which is flown."""
    if ways.approach is None:
        return route.notes
    return tuple(note for note in route.notes if LANDING_NOTE not in note)
