"""A plan as a mission: speed, then waypoints above mean sea level in the world's frame."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY, ground_speed
from aircraft.tracking import TrackingError, air_density_factor
from flight.mission.items import Command, Frame, Home, Mission, MissionItem, on_grid
from planner.ground_ways import GroundWays
from planner.plan import Plan
from world.frames import GeoOrigin, to_geo
from world.geometry import leg_courses, turning_angles, wrap
from world.scenario import Scenario
from world.wind import W20

Floats = NDArray[np.float64]

# Added to the fly-by offset of a waypoint, m: the tolerance of the verdict's waypoint rule.
ACCEPTANCE_TOLERANCE = 10.0
# Least pitch of a take-off, degrees: the first number of NAV_TAKEOFF.  With 10 ArduPlane's Aerosonde climbed at 5 m/s
# and 26 m/s from a catapult of 20 m/s; with 15 at 6 m/s and 24 m/s.
LAUNCH_PITCH = 12.0
# Sharpest turn whose arc has that on top, and the sharpest that has an arc at all, rad.
_SHARPEST, _U_TURN = math.radians(150.0), math.radians(179.0)


def plan_mission(
    plan: Plan, airspeed: float, max_bank: float, source: str = "plan", tracking: TrackingError | None = None
) -> Mission:
    """Mission of a plan: it starts at the first waypoint and ends at the last, or on the ground where the plan does.

    airspeed: m/s.  max_bank: rad.  Home is the scenario's, or the ground below the start.  A plan with ways from and to
    the ground begins with NAV_TAKEOFF at home and ends with DO_LAND_START, two places to line up at and NAV_LAND, whose
    first number is the height over home of a go-around.  The scenario's rally points come with it.

    Positions are put on the 1e-7 degree grid of MISSION_ITEM_INT and heights on whole millimetres, so every form of the
    mission carries the same numbers; that moves a waypoint by less than 8 mm on the map.

    The acceptance radius is the fly-by offset, how far a turn at this speed and bank, in the scenario's wind from
    behind, passes from its waypoint, R(1/cos(theta/2) - 1), and `ACCEPTANCE_TOLERANCE` more, up to a whole metre: no
    arc of the flight misses it.  PX4 has its own on fixed wings.  An autopilot of which it is known how it tracks its
    legs gets the radius with which it strays least from them: ArduPlane turns to the next leg that far before a
    waypoint.

    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> points = np.array([[0.0, 0.0, 75.0], [1000.0, 0.0, 75.0], [2000.0, 1000.0, 75.0]])
    >>> plan = Plan(
    ...     scenario, points, np.zeros(4, dtype=int), np.zeros(4), certificate=None, seed=1, algorithm="umda",
    ...     evaluations=0, history=np.zeros((1, 3)),
    ... )
    >>> mission = plan_mission(plan, airspeed=25.0, max_bank=math.radians(30.0))
    >>> [(item.command, item.params[1]) for item in mission.items]  # speed, then acceptance radii
    [(178, 25.0), (16, 10.0), (16, 20.0), (16, 10.0)]
    """
    ways = plan.ways or GroundWays()
    points = _way(plan, ways)
    radii = acceptance_radii(plan.scenario, points, airspeed, max_bank, tracking)
    home = _home(plan)
    builder = _Items(plan.scenario.origin)
    if ways.climb is not None:
        builder.add(Command.NAV_TAKEOFF, (LAUNCH_PITCH, 0.0, 0.0, 0.0), np.append(ways.climb.home[:2], ways.climb.up))
    builder.add(Command.DO_CHANGE_SPEED, (0.0, _milli(airspeed), -1.0, 0.0))
    first = 0 if ways.climb is None else 1
    last = len(points) if ways.descent is None else len(points) - 3
    for k in range(first, last):
        builder.add(Command.NAV_WAYPOINT, (0.0, float(radii[k]), 0.0, 0.0), points[k])
    if ways.descent is not None:
        builder.add(Command.DO_LAND_START, (0.0,) * 4)
        for k in (last, last + 1):
            builder.add(Command.NAV_WAYPOINT, (0.0, float(radii[k]), 0.0, 0.0), points[k])
        builder.add(Command.NAV_LAND, (ways.descent.go_around, 0.0, 0.0, 0.0), ways.descent.point)
    returns = plan.scenario.returns
    rally = () if returns is None else tuple(_rally(plan.scenario.origin, returns.rally, home))
    return Mission(home=home, items=tuple(builder.items), rally=rally, cruise_speed=_milli(airspeed), source=source)


class _Items:
    """Mission items in the making, in the world's frame."""

    def __init__(self, origin: GeoOrigin) -> None:
        self.items: list[MissionItem] = []
        self._origin = origin

    def add(self, command: Command, params: tuple[float, float, float, float], place: Floats | None = None) -> None:
        """Add an item; place: (3,) m, None for a command without one."""
        frame, lat, lon, up = Frame.MISSION, 0.0, 0.0, 0.0
        if place is not None:
            frame, up = Frame.GLOBAL, _milli(float(place[2]))
            lat, lon = (on_grid(float(value)) for value in to_geo(self._origin, place[0], place[1]))
        self.items.append(MissionItem(len(self.items) + 1, int(command), int(frame), params, lat, lon, up))


def _way(plan: Plan, ways: GroundWays) -> Floats:
    """All that is flown to, (w, 3) m: from over home, and to the landing point at the height of the line-up."""
    parts = [plan.waypoints]
    if (up := ways.climb) is not None:
        parts = [np.append(up.home[:2], up.up)[None], up.waypoints, *parts]
    if (down := ways.descent) is not None:
        over = np.append(down.point[:2], down.line_up[-1, 2])
        parts = [*parts, down.waypoints, down.line_up, over[None]]
    return np.concatenate(parts)


def _home(plan: Plan) -> Home:
    """The scenario's home, or the ground below the start; of a start over unknown ground its own height."""
    scenario, first = plan.scenario, plan.waypoints[0]
    place = scenario.home if scenario.home is not None else first
    lat, lon = to_geo(scenario.origin, place[:1], place[1:2])
    under = math.nan if scenario.terrain is None else float(scenario.terrain.height(place[0], place[1]))
    up = float(place[2]) if math.isnan(under) else under
    return Home(on_grid(float(lat[0])), on_grid(float(lon[0])), _milli(up))


def _rally(origin: GeoOrigin, points: Floats, home: Home) -> Iterator[MissionItem]:
    """Rally points (n, 3) m as items, at heights over home, as ground stations write them."""
    for number, (east, north, up) in enumerate(points.tolist()):
        lat, lon = to_geo(origin, east, north)
        place = on_grid(float(lat)), on_grid(float(lon)), _milli(up - home.alt)
        yield MissionItem(number, int(Command.NAV_RALLY_POINT), int(Frame.GLOBAL_RELATIVE_ALT), (0.0,) * 4, *place)


def acceptance_radii(
    scenario: Scenario, points: Floats, airspeed: float, max_bank: float, tracking: TrackingError | None
) -> Floats:
    """The acceptance radius at each place that a planned mission flies to, (w,) m, whole; as of `plan_mission`.

    points: (w, 3) m, in flying order.
    """
    if tracking is not None:
        return _turn_distances(scenario, points, airspeed, tracking)
    wind = max(math.hypot(*scenario.wind.at(float(amsl))) for amsl in points[:, 2])
    turns, pull = turning_angles(points), GRAVITY * math.tan(max_bank)
    radii = np.full(len(points), ACCEPTANCE_TOLERANCE)
    radii[1:-1] += _offsets(np.minimum(turns, _SHARPEST), (airspeed + wind) ** 2 / pull)
    # Arcs are drawn with room for a gust; one sharper than these passes where it passes, and a U-turn's at infinity.
    gust = 0.1 * W20[scenario.wind.turbulence]
    arcs = _offsets(np.minimum(turns, _U_TURN), (airspeed + wind + gust) ** 2 / pull)
    radii[1:-1] = np.maximum(radii[1:-1], arcs)
    return np.ceil(radii - 1e-6)


def _offsets(turns: Floats, radius: float) -> Floats:
    """How far arcs of this radius (m) pass from the corners of these turns (rad), m."""
    return np.asarray(radius * (1.0 / np.cos(turns / 2.0) - 1.0))


def _turn_distances(scenario: Scenario, points: Floats, airspeed: float, tracking: TrackingError) -> Floats:
    """(w,) m, whole: for each corner at the highest ground speed on the way from one course to the other."""
    radii = np.full(len(points), tracking.corner_acceptance(0.0, airspeed))
    speeds = corner_speeds(scenario, points, airspeed)
    for i, (turn, fastest) in enumerate(zip(turning_angles(points), speeds, strict=True), 1):
        radii[i] = tracking.corner_acceptance(float(turn), fastest)
    return np.round(radii)


def corner_speeds(scenario: Scenario, points: Floats, airspeed: float) -> list[float]:
    """Highest ground speed (m/s) at each corner of a path (w, 3), from one course to the other, w - 2 of them.

    airspeed: equivalent, m/s; where a course cannot be held, the true one counts.
    """
    courses, speeds = leg_courses(points), []
    for i in range(1, len(points) - 1):
        up = float(points[i, 2])
        east, north = scenario.wind.at(up)
        speed = airspeed * air_density_factor(up)
        between = courses[i - 1] + wrap(courses[i] - courses[i - 1]) * np.linspace(0.0, 1.0, 5)
        over_ground = [
            ground_speed(speed, east * math.sin(c) + north * math.cos(c), east * math.cos(c) - north * math.sin(c))
            for c in between.tolist()
        ]
        # NaN, where a course cannot be held, is no speed.
        speeds.append(max((v for v in over_ground if v > 0.0), default=speed))
    return speeds


def _milli(value: float) -> float:
    """Double nearest to whole thousandths."""
    return round(value * 1e3) / 1e3
