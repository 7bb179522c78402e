"""Find the take-off and the landing of a mission that are simulated, with their starts and ends.

A take-off is flown if the scenario states how the aircraft is launched and the mission starts with a take-off item; a
landing is flown if the scenario has a strip and the mission ends with a landing item. All other flights start and end
in the air.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from flight.mission.items import Command, Mission, MissionItem
from flight.mission.itinerary import LANDING_NOTE
from flight.mission.placing import home_point
from flight.mission.route import Route, part_of_route
from world.airfield import LandingStrip, Launch, strip_slopes
from world.arrays import Floats
from world.geometry import leg_courses
from world.scenario import Scenario

# Climb pitch of a take-off item without a pitch, rad: ArduPlane's pitch for a first parameter of 0.
DEFAULT_CLIMB_PITCH = math.radians(4.0)
# Height above ground of the start of a catapult's rail, m.
_RAIL_HEIGHT_M = 1.0
# Height above ground at which a hand launch releases the aircraft, m.
_HAND_RELEASE_HEIGHT_M = 1.8


@dataclass(frozen=True, slots=True, eq=False)
class TakeOff:
    """A take-off that is simulated.

    launch: the scenario's launch.
    item: number of the mission item.
    home: (3,) m, on the ground.
    course: launch course, rad on the map.
    end_altitude: altitude at the end of the take-off, m AMSL.
    home_altitude: altitude of home, m AMSL, above which the autopilot measures heights.
    pitch: minimum climb pitch, rad.
    waypoint: index of the route's waypoint at which the mission continues.
    speed: ground speed at the end of the launch, m/s.
    acceleration: acceleration along the launch, m/s^2; 0 for a runway.
    """

    launch: Launch
    item: int
    home: Floats
    course: float
    end_altitude: float
    home_altitude: float
    pitch: float
    waypoint: int
    speed: float
    acceleration: float

    def release_state(self) -> tuple[Floats, Floats]:
        """Return the position (m) and the velocity (m/s) at the end of the launch, each (3,) east, north, up.

        The release is the end of the rail, the throw of a hand launch, or the start of a runway. On a runway the
        position is on the ground, and the caller adds the height of the standing aircraft.
        """
        launch, direction = self.launch, np.array([math.sin(self.course), math.cos(self.course)])
        if launch.method == "runway":
            return self.home.copy(), np.zeros(3)
        cos_incline, sin_incline = math.cos(launch.incline), math.sin(launch.incline)
        rail_length = launch.effective_length if launch.method == "catapult" else 0.0
        height = _RAIL_HEIGHT_M + rail_length * sin_incline if launch.method == "catapult" else _HAND_RELEASE_HEIGHT_M
        position = np.array([*(self.home[:2] + rail_length * cos_incline * direction), self.home[2] + height])
        return position, self.speed * np.array([*(cos_incline * direction), sin_incline])

    def description(self) -> str:
        """Describe the take-off in one line: item, launch method, home, course and end altitude."""
        throw_text = f"{self.speed:.1f} m/s after {self.launch.effective_length:.1f} m, {self.acceleration:.1f} m/s²"
        method_texts = {"catapult": "from a catapult", "hand": f"by hand ({throw_text})", "runway": "on a runway"}
        course = math.degrees(self.course) % 360.0
        return (
            f"NAV_TAKEOFF (item {self.item}): launched {method_texts[self.launch.method]} at home,"
            f" {self.home[2]:.1f} m AMSL, on course {course:.0f} degrees;"
            f" the first leg begins above {self.end_altitude:.1f} m AMSL"
        )


@dataclass(frozen=True, slots=True, eq=False)
class Approach:
    """A landing that is simulated.

    strip: the scenario's landing strip.
    item: number of the mission item.
    leg: index of the route's last leg, which leads to the landing point.
    point: landing point at the altitude that the mission states, (3,) m.
    course: landing course, rad.
    length: length of the leg, m.
    start_altitude: altitude at the start of the leg, m AMSL.
    tail_wind: tail wind at the landing point on the landing course, m/s.
    home_altitude: altitude of home, m AMSL; the landing point's altitude if the mission has no home.
    """

    strip: LandingStrip
    item: int
    leg: int
    point: Floats
    course: float
    length: float
    start_altitude: float
    tail_wind: float
    home_altitude: float

    def distances_from_landing_point(self, position: Floats) -> tuple[Floats, Floats]:
        """Return along-track and cross-track distances of positions (n, 3) from the landing point, m.

        Both have shape (n,). They are positive past the landing point, and to the right of the landing course.
        """
        return _track_offsets(position, self.point, self.course)

    def distances_from_strip_center(self, position: Floats) -> tuple[Floats, Floats]:
        """Return along-track and cross-track distances of positions (n, 3) from the strip's center, m.

        The track is the strip's stated course, or the landing course if no course is stated. A landing against the
        stated course uses the same strip.
        """
        axis = self.course if self.strip.course is None else self.strip.course
        if math.cos(self.course - axis) < 0.0:
            axis += math.pi
        return _track_offsets(position, np.array([self.strip.east, self.strip.north]), axis)


def _track_offsets(position: Floats, start: Floats, course: float) -> tuple[Floats, Floats]:
    """Return along-track and cross-track distances of positions (n, 3) from a start point, m.

    course: course of the track, rad.
    """
    east, north = position[..., 0] - start[0], position[..., 1] - start[1]
    sin, cos = math.sin(course), math.cos(course)
    return east * sin + north * cos, east * cos - north * sin


@dataclass(frozen=True, slots=True)
class GroundPhases:
    """Take-off and landing of a flight; None for one that is not simulated.

    notes: reasons why a launch or a strip of the scenario is not flown, in sentences.
    """

    take_off: TakeOff | None = None
    approach: Approach | None = None
    notes: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """Return True if a take-off or a landing is simulated."""
        return self.take_off is not None or self.approach is not None


def find_ground_phases(scenario: Scenario, mission: Mission, route: Route, min_airspeed: float) -> GroundPhases:
    """Find the take-off and the landing of a mission that a flight in a scenario simulates.

    min_airspeed: minimum level-flight speed, m/s, which sets the launch speed if the scenario states none.

    >>> from world.scenario import load_scenario
    >>> bool(find_ground_phases(load_scenario("tight"), Mission(None, ()), None, 15.0))
    False
    """
    take_off_problem = approach_problem = ""
    take_off = approach = None
    if scenario.launch is not None:
        take_off, take_off_problem = _find_take_off(scenario, mission, route, min_airspeed)
    if scenario.landing is not None:
        approach, approach_problem = _find_approach(scenario, mission, route)
    return GroundPhases(take_off, approach, tuple(note for note in (take_off_problem, approach_problem) if note))


def _find_take_off(
    scenario: Scenario, mission: Mission, route: Route, min_airspeed: float
) -> tuple[TakeOff | None, str]:
    """Return the take-off to simulate and "", or None and the reason why no take-off is simulated.

    min_airspeed: minimum level-flight speed, m/s, which sets the launch speed if the scenario states none.
    """
    launch, mission_home = scenario.launch, home_point(mission, scenario.origin, scenario.terrain)
    items = {item.seq: item for item in mission.items if item.command == Command.NAV_TAKEOFF}
    route_items = route.items.tolist()
    index = next((k for k, seq in enumerate(route_items) if seq >= 0), 0)
    if launch is None or not items or route_items[index] not in items:
        return None, "[launch]: the mission does not begin with a NAV_TAKEOFF, so its flight begins in the air"
    if mission_home is None:
        return None, "[launch]: the mission has no home to take off from, so its flight begins in the air"
    if index + 1 >= len(route_items):
        return None, "[launch]: the mission has no waypoint after the take-off, so the take-off is not flown"
    item, home_position = items[route_items[index]], np.array([mission_home.east, mission_home.north])
    ground = scenario.terrain.height(*home_position) if scenario.terrain is not None else mission_home.up
    if math.isnan(ground):
        return None, "[launch]: the terrain at home is unknown, so the flight begins in the air"
    # ArduPlane does not fly to the position of a take-off item: the next item is the first one.
    first_leg = route.positions[index + 1, :2] - home_position
    course = launch.course if launch.course is not None else math.atan2(first_leg[0], first_leg[1])
    home = np.array([*home_position, float(ground)])
    end_altitude, pitch = float(route.positions[index, 2]), climb_pitch(item)
    speed, acceleration = launch.release_speed(min_airspeed), launch.acceleration(min_airspeed)
    return TakeOff(launch, item.seq, home, course, end_altitude, mission_home.up, pitch, index, speed, acceleration), ""


def climb_pitch(item: MissionItem) -> float:
    """Return the minimum climb pitch of a take-off item, rad.

    It is `DEFAULT_CLIMB_PITCH` if the item states none.
    """
    pitch = item.params[0]
    return math.radians(pitch) if pitch > 0.0 else DEFAULT_CLIMB_PITCH


def _find_approach(scenario: Scenario, mission: Mission, route: Route) -> tuple[Approach | None, str]:
    """Return the landing to simulate and "", or None and the reason why no landing is simulated."""
    strip, last_leg = scenario.landing, route.legs
    items = {item.seq: item for item in mission.items if item.command == Command.NAV_LAND}
    if strip is None or not items or int(route.items[last_leg]) not in items or last_leg < 2:
        reason = "the mission does not end with two waypoints and a NAV_LAND at a third position"
        return None, f"[landing]: {reason}: its flight ends in the air"
    ground = route.landing_ground
    leg_start, leg_end = route.positions[last_leg - 1], route.positions[last_leg]
    if ground is None:
        return None, "[landing]: the altitude of the landing point is unknown, so the flight ends in the air"
    if leg_start[2] <= ground:
        return None, "[landing]: the approach does not begin above the landing point, so the flight ends in the air"
    final_leg = leg_end[:2] - leg_start[:2]
    course, length = math.atan2(final_leg[0], final_leg[1]), float(np.hypot(*final_leg))
    point = np.array([leg_end[0], leg_end[1], ground])
    tail_wind = scenario.wind.components_on_course(course, ground)[0]
    home = home_point(mission, scenario.origin, scenario.terrain)
    home_altitude = ground if home is None else home.up
    item, start_altitude = int(route.items[last_leg]), float(leg_start[2])
    return Approach(strip, item, last_leg - 1, point, course, length, start_altitude, tail_wind, home_altitude), ""


def airborne_route(route: Route, ground_phases: GroundPhases, first_leg_start: Floats | None) -> Route:
    """Return the part of a route between take-off and landing, for the rules that judge flight in the air.

    ground_phases: take-off and landing that are simulated.
    first_leg_start: point at which the take-off ends and the first leg starts, (3,) m; None to keep the first waypoint.

    The waypoints before the end of the take-off are moved to the start of the first leg, 1 m apart. The leg to the
    landing point is omitted. The numbers of the other legs and waypoints do not change.
    """
    points = np.array(route.positions)
    if ground_phases.take_off is not None and first_leg_start is not None:
        points[: ground_phases.take_off.waypoint + 1] = first_leg_start
        # Earlier waypoints are not flown. Place each 1 m before the next, so that every leg has a length.
        for index in range(ground_phases.take_off.waypoint - 1, -1, -1):
            next_leg = points[index + 1, :2] - points[index + 2, :2]
            points[index, :2] += next_leg / max(1e-6, float(np.hypot(*next_leg)))
    moved_route = replace(route.with_fields(position=points), notes=route_notes(route, ground_phases))
    return (
        moved_route
        if ground_phases.approach is None or ground_phases.approach.leg < 1
        else part_of_route(moved_route, 0, ground_phases.approach.leg)
    )


def display_waypoints(route: Route, ground_phases: GroundPhases) -> Floats:
    """Return a route's waypoints for pictures and tables, (w, 3) m.

    The first and last waypoints are on the ground where the take-off or landing is simulated.
    The route itself starts at the altitude at which a take-off ends, and its leg to a landing point is level.
    """
    points = np.array(route.positions)
    if ground_phases.take_off is not None:
        # The flight starts at home, even if the take-off item has a position of its own.
        points[0, 2] = ground_phases.take_off.home[2]
    if ground_phases.approach is not None:
        points[ground_phases.approach.leg + 1, 2] = ground_phases.approach.point[2]
    return points


def route_notes(route: Route, ground_phases: GroundPhases) -> tuple[str, ...]:
    """Return a route's notes; if the landing is simulated, leave out the note that it is not flown."""
    if ground_phases.approach is None:
        return route.notes
    return tuple(note for note in route.notes if LANDING_NOTE not in note)


def landing_slopes(mission: Mission, route: Route, scenario: Scenario) -> tuple[float, float] | None:
    """Return the ground slopes along and across the final landing leg, m per m; NaN if unknown.

    Returns None if the mission does not end with a landing, or if the scenario defines a landing strip.
    """
    last_item = int(route.items[-1])
    has_landing = any(item.seq == last_item and item.command == Command.NAV_LAND for item in mission.items)
    if scenario.landing is not None or not has_landing:
        return None
    if scenario.terrain is None:
        return math.nan, math.nan
    east, north = route.positions[-1, :2].tolist()
    return strip_slopes(scenario.terrain, LandingStrip(east, north), float(leg_courses(route.positions)[-1]))
