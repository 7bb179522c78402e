"""A plan as a mission: speed, then waypoints above mean sea level in the world's frame."""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY, ground_speed
from aircraft.tracking import TrackingError, air_density_factor
from flight.mission.items import Command, Frame, Home, Mission, MissionItem, on_grid
from planner.plan import Plan
from world.frames import to_geo
from world.geometry import leg_courses, turning_angles, wrap
from world.wind import W20

Floats = NDArray[np.float64]

# Added to the fly-by offset of a waypoint, m: the tolerance of the verdict's waypoint rule.
ACCEPTANCE_TOLERANCE = 10.0
# Sharpest turn whose arc has that on top, and the sharpest that has an arc at all, rad.
_SHARPEST, _U_TURN = math.radians(150.0), math.radians(179.0)


def plan_mission(
    plan: Plan, airspeed: float, max_bank: float, source: str = "plan", tracking: TrackingError | None = None
) -> Mission:
    """Mission of a plan: it starts at the first waypoint and ends at the last.

    airspeed: m/s.  max_bank: rad.  Home is the ground below the start.  Positions are put on the 1e-7 degree grid of
    MISSION_ITEM_INT and heights on whole millimetres, so every form of the mission carries the same numbers; that moves
    a waypoint by less than 8 mm on the map.

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
    points = plan.waypoints
    lat, lon = to_geo(plan.scenario.origin, points[:, 0], points[:, 1])
    radii = _acceptance(plan, airspeed, max_bank) if tracking is None else _turn_distances(plan, airspeed, tracking)
    items = [
        MissionItem(
            1, int(Command.DO_CHANGE_SPEED), int(Frame.MISSION), (0.0, _milli(airspeed), -1.0, 0.0), 0.0, 0.0, 0.0
        )
    ]
    items += [
        MissionItem(
            k + 2,
            int(Command.NAV_WAYPOINT),
            int(Frame.GLOBAL),
            (0.0, float(radii[k]), 0.0, 0.0),
            on_grid(float(lat[k])),
            on_grid(float(lon[k])),
            _milli(float(points[k, 2])),
        )
        for k in range(len(points))
    ]
    first = items[1]
    under = math.nan
    if plan.scenario.terrain is not None:
        under = float(plan.scenario.terrain.height(points[0, 0], points[0, 1]))
    home = Home(first.lat_deg, first.lon_deg, first.alt if math.isnan(under) else _milli(under))
    return Mission(home=home, items=tuple(items), cruise_speed=_milli(airspeed), source=source)


def _acceptance(plan: Plan, airspeed: float, max_bank: float) -> Floats:
    """(w,) m, whole."""
    wind = max(math.hypot(*plan.scenario.wind.at(float(amsl))) for amsl in plan.waypoints[:, 2])
    turns, pull = turning_angles(plan.waypoints), GRAVITY * math.tan(max_bank)
    radii = np.full(len(plan.waypoints), ACCEPTANCE_TOLERANCE)
    radii[1:-1] += _offsets(np.minimum(turns, _SHARPEST), (airspeed + wind) ** 2 / pull)
    # Arcs are drawn with room for a gust; one sharper than these passes where it passes, and a U-turn's at infinity.
    gust = 0.1 * W20[plan.scenario.wind.turbulence]
    arcs = _offsets(np.minimum(turns, _U_TURN), (airspeed + wind + gust) ** 2 / pull)
    radii[1:-1] = np.maximum(radii[1:-1], arcs)
    return np.ceil(radii - 1e-6)


def _offsets(turns: Floats, radius: float) -> Floats:
    """How far arcs of this radius (m) pass from the corners of these turns (rad), m."""
    return np.asarray(radius * (1.0 / np.cos(turns / 2.0) - 1.0))


def _turn_distances(plan: Plan, airspeed: float, tracking: TrackingError) -> Floats:
    """(w,) m, whole: for each corner at the highest ground speed on the way from one course to the other."""
    turns, courses = turning_angles(plan.waypoints), leg_courses(plan.waypoints)
    radii = np.full(len(plan.waypoints), tracking.corner_acceptance(0.0, airspeed))
    for i, turn in enumerate(turns, 1):
        up = float(plan.waypoints[i, 2])
        east, north = plan.scenario.wind.at(up)
        speed = airspeed * air_density_factor(up)
        between = courses[i - 1] + wrap(courses[i] - courses[i - 1]) * np.linspace(0.0, 1.0, 5)
        over_ground = [
            ground_speed(speed, east * math.sin(c) + north * math.cos(c), east * math.cos(c) - north * math.sin(c))
            for c in between.tolist()
        ]
        # NaN, where a course cannot be held, is no speed.
        fastest = max((v for v in over_ground if v > 0.0), default=speed)
        radii[i] = tracking.corner_acceptance(float(turn), fastest)
    return np.round(radii)


def _milli(value: float) -> float:
    """Double nearest to whole thousandths."""
    return round(value * 1e3) / 1e3
