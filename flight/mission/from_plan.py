"""Convert a plan to a mission with a speed change, followed by waypoints with altitudes AMSL."""

import math

import numpy as np

from aircraft.envelope import GRAVITY, ground_speed
from aircraft.tracking import TrackingError, air_density_factor
from flight.mission.items import Command, Frame, Home, Mission, MissionItem, round_to_grid
from planner.plan import Plan
from planner.procedures import DepartureAndApproach
from world.arrays import Floats
from world.frames import GeoOrigin, to_geo
from world.geometry import leg_courses, turning_angles, wrap
from world.scenario import Scenario
from world.wind import W20

# Margin added to the fly-by offset of a waypoint, m; equal to the tolerance of the verdict's waypoint rule.
ACCEPTANCE_TOLERANCE_M = 10.0
# Minimum pitch of a take-off, degrees: the first parameter of NAV_TAKEOFF. With 10 ArduPlane's Aerosonde climbed at 5
# m/s and 26 m/s from a catapult of 20 m/s; with 15 at 6 m/s and 24 m/s.
LAUNCH_PITCH_DEG = 12.0
# Largest turn for which the fly-by offset at the highest ground speed is computed, rad.
_MAX_OFFSET_TURN_RAD = math.radians(150.0)
# Largest turn for which the fly-by offset in a gust is computed, rad: a U-turn has no fly-by arc.
_MAX_ARC_TURN_RAD = math.radians(179.0)


def plan_mission(
    plan: Plan, airspeed: float, max_bank: float, source: str = "plan", tracking: TrackingError | None = None
) -> Mission:
    """Convert a plan to a mission, with the plan's departure and approach, if any.

    airspeed: m/s.
    max_bank: rad.
    source: name of the mission in messages.
    tracking: tracking error of the autopilot; None if unknown.

    Home is the scenario's home, or the ground below the start. A mission with a departure starts with NAV_TAKEOFF at
    home. A mission with an approach ends with DO_LAND_START, two waypoints of the final approach, and NAV_LAND. The
    first parameter of NAV_LAND is the go-around height above home. The scenario's rally points are included.

    Positions are rounded to the 1e-7 degree grid of MISSION_ITEM_INT, and altitudes to whole millimeters. Therefore
    every file format states the same numbers. The rounding moves a waypoint by less than 8 mm on the map.

    Each waypoint states an acceptance radius: see `acceptance_radii`. PX4 uses its own radius for fixed-wing aircraft.

    >>> from planner.plan import Certificate
    >>> from world.scenario import load_scenario
    >>> scenario, certificate = load_scenario("tight"), Certificate(*np.zeros(6), problems=())
    >>> points = np.array([[0.0, 0.0, 75.0], [1000.0, 0.0, 75.0], [2000.0, 1000.0, 75.0]])
    >>> plan = Plan(
    ...     scenario, points, np.zeros(4, dtype=int), np.zeros(4), certificate, seed=1, algorithm="umda",
    ...     evaluations=0, history=np.zeros((1, 3)),
    ... )
    >>> mission = plan_mission(plan, airspeed=25.0, max_bank=math.radians(30.0))
    >>> [(item.command, item.params[1]) for item in mission.items]  # speed, then acceptance radii
    [(178, 25.0), (16, 10.0), (16, 20.0), (16, 10.0)]
    """
    procedures = plan.procedures or DepartureAndApproach()
    # The navigation items, from above home to the landing point; the landing has the altitude of the last waypoint of
    # the final approach.
    parts = [plan.waypoints]
    if (climb := procedures.climb) is not None:
        parts = [np.append(climb.home[:2], climb.up)[None], climb.waypoints, *parts]
    if (descent := procedures.descent) is not None:
        above_landing = np.append(descent.point[:2], descent.final_waypoints[-1, 2])
        parts = [*parts, descent.waypoints, descent.final_waypoints, above_landing[None]]
    points = np.concatenate(parts)
    radii = acceptance_radii(plan.scenario, points, airspeed, max_bank, tracking)
    # Home is the scenario's home, or the ground below the start; the start itself if the ground is unknown.
    scenario = plan.scenario
    home_position = scenario.home if scenario.home is not None else plan.waypoints[0]
    home_lat, home_lon = to_geo(scenario.origin, home_position[:1], home_position[1:2])
    terrain = scenario.terrain
    ground = math.nan if terrain is None else float(terrain.height(home_position[0], home_position[1]))
    home_altitude = _round_to_thousandths(float(home_position[2]) if math.isnan(ground) else ground)
    home = Home(round_to_grid(float(home_lat[0])), round_to_grid(float(home_lon[0])), home_altitude)
    builder = _ItemBuilder(plan.scenario.origin)
    if procedures.climb is not None:
        takeoff_position = np.append(procedures.climb.home[:2], procedures.climb.up)
        builder.add(Command.NAV_TAKEOFF, (LAUNCH_PITCH_DEG, 0.0, 0.0, 0.0), takeoff_position)
    builder.add(Command.DO_CHANGE_SPEED, (0.0, _round_to_thousandths(airspeed), -1.0, 0.0))
    first_waypoint = 0 if procedures.climb is None else 1
    end_waypoint = len(points) if procedures.descent is None else len(points) - 3
    for index in range(first_waypoint, end_waypoint):
        builder.add(Command.NAV_WAYPOINT, (0.0, float(radii[index]), 0.0, 0.0), points[index])
    if procedures.descent is not None:
        builder.add(Command.DO_LAND_START, (0.0,) * 4)
        for index in (end_waypoint, end_waypoint + 1):
            builder.add(Command.NAV_WAYPOINT, (0.0, float(radii[index]), 0.0, 0.0), points[index])
        builder.add(Command.NAV_LAND, (procedures.descent.go_around, 0.0, 0.0, 0.0), procedures.descent.point)
    # Rally points have heights above home, as ground stations write them.
    rally = []
    for number, (east, north, up) in enumerate([] if scenario.returns is None else scenario.returns.rally.tolist()):
        lat, lon = (round_to_grid(float(value)) for value in to_geo(scenario.origin, east, north))
        frame, height = int(Frame.GLOBAL_RELATIVE_ALT), _round_to_thousandths(up - home.alt)
        rally.append(MissionItem(number, int(Command.NAV_RALLY_POINT), frame, (0.0,) * 4, lat, lon, height))
    return Mission(
        home=home,
        items=tuple(builder.items),
        rally=tuple(rally),
        cruise_speed=_round_to_thousandths(airspeed),
        source=source,
    )


class _ItemBuilder:
    """Builder of a list of mission items, numbered from 1, from positions on the map."""

    def __init__(self, origin: GeoOrigin) -> None:
        self.items: list[MissionItem] = []
        self._origin = origin

    def add(self, command: Command, params: tuple[float, float, float, float], position: Floats | None = None) -> None:
        """Append a mission item; its altitude is AMSL.

        params: the first four parameters of the command.
        position: east, north, up on the map, (3,) m; None for a command without a position.
        """
        frame = Frame.MISSION
        lat = 0.0
        lon = 0.0
        up = 0.0
        if position is not None:
            frame, up = Frame.GLOBAL, _round_to_thousandths(float(position[2]))
            lat, lon = (round_to_grid(float(value)) for value in to_geo(self._origin, position[0], position[1]))
        self.items.append(MissionItem(len(self.items) + 1, int(command), int(frame), params, lat, lon, up))


def acceptance_radii(
    scenario: Scenario, points: Floats, airspeed: float, max_bank: float, tracking: TrackingError | None
) -> Floats:
    """Return the acceptance radius of each position of a planned mission, (w,) whole m.

    points: (w, 3) m, in flying order.
    airspeed: m/s.
    max_bank: rad.
    tracking: tracking error of the autopilot; None if unknown.

    The radius is the distance at which a fly-by turn passes its waypoint, R(1/cos(turn/2) - 1), plus
    `ACCEPTANCE_TOLERANCE_M`, rounded up. R is the turn radius at this airspeed and bank with the scenario's wind from
    behind. If the wider arc in a gust passes the waypoint at a greater distance, the radius is that distance. With this
    acceptance radius no arc of the flight misses its waypoint. If the tracking error of the autopilot is known, the
    radius is the one with the smallest error, because ArduPlane turns to the next leg at that distance before a
    waypoint.
    """
    if tracking is not None:
        # Each radius is for the highest ground speed in the turn at its waypoint.
        radii = np.full(len(points), tracking.corner_acceptance(0.0, airspeed))
        speeds = corner_speeds(scenario, points, airspeed)
        for index, (turn, speed) in enumerate(zip(turning_angles(points), speeds, strict=True), 1):
            radii[index] = tracking.corner_acceptance(float(turn), speed)
        return np.round(radii)
    wind = max(math.hypot(*scenario.wind.velocity_at(float(amsl))) for amsl in points[:, 2])
    turns, lateral_acceleration = turning_angles(points), GRAVITY * math.tan(max_bank)
    radii = np.full(len(points), ACCEPTANCE_TOLERANCE_M)
    radii[1:-1] += _fly_by_offsets(
        np.minimum(turns, _MAX_OFFSET_TURN_RAD), (airspeed + wind) ** 2 / lateral_acceleration
    )
    # In a gust the arc is wider. The limit on the turn keeps the offset finite.
    gust = 0.1 * W20[scenario.wind.turbulence]
    arc_offsets = _fly_by_offsets(
        np.minimum(turns, _MAX_ARC_TURN_RAD), (airspeed + wind + gust) ** 2 / lateral_acceleration
    )
    radii[1:-1] = np.maximum(radii[1:-1], arc_offsets)
    return np.ceil(radii - 1e-6)


def _fly_by_offsets(turns: Floats, radius: float) -> Floats:
    """Return the distance between corner and fly-by arc for each turn (rad), m.

    radius: radius of the arcs, m.
    """
    return np.asarray(radius * (1.0 / np.cos(turns / 2.0) - 1.0))


def corner_speeds(scenario: Scenario, points: Floats, airspeed: float) -> list[float]:
    """Return the highest ground speed in the turn at each of the w - 2 corners of a path, m/s.

    points: path, (w, 3) m.
    airspeed: equivalent airspeed, m/s.

    Five courses of each turn are checked. If the wind is too strong for all of them, the result is the true airspeed.
    """
    courses, speeds = leg_courses(points), []
    for i in range(1, len(points) - 1):
        altitude = float(points[i, 2])
        east, north = scenario.wind.velocity_at(altitude)
        true_airspeed = airspeed * air_density_factor(altitude)
        turn_courses = courses[i - 1] + wrap(courses[i] - courses[i - 1]) * np.linspace(0.0, 1.0, 5)
        ground_speeds = [
            ground_speed(
                true_airspeed,
                east * math.sin(course) + north * math.cos(course),
                east * math.cos(course) - north * math.sin(course),
            )
            for course in turn_courses.tolist()
        ]
        # The ground speed is NaN on a course on which the wind is too strong.
        speeds.append(max((value for value in ground_speeds if value > 0.0), default=true_airspeed))
    return speeds


def _round_to_thousandths(value: float) -> float:
    """Round a number to a multiple of 0.001."""
    return round(value * 1e3) / 1e3
