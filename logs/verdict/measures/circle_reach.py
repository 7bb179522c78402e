"""Find hazards within reach of a loiter that is flown wider than drawn.

If a loiter is too tight for the bank limit, an autopilot that steers to its center and then orbits as tightly as it can
may be anywhere within `LOITER_SWING_RADII` radii of the bank limit from the center, depending on the direction of
arrival.  The drawn circle therefore does not tell which hazards are within reach.
"""

import math

import numpy as np

from flight.mission.route import ends_at_plain_waypoint
from logs.verdict.measures.path_moves import MOVE
from logs.verdict.measures.path_sweeps import path_clearance
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.zone_visits import path_zones
from logs.verdict.tolerances import CLEARANCE_TOLERANCE_M, HEIGHT_TOLERANCE_M, LOITER_SWING_RADII, ROUNDING_M
from world.airspace.zones import Cylinder, Zone
from world.airspace.zones_on_map import CIRCLE_CORNERS, zone_rings
from world.arrays import Floats
from world.kernels import Records
from world.threats import threat_label

# Minimum number of rings along which a disc is checked; between the limits there is one per step of the terrain raster.
_MIN_RINGS = 24
# Maximum number of rings along which a disc is checked.
_MAX_RINGS = 120
# Altitude step in which a climbing spiral is checked, m.
_STEP_M = 20.0
# Maximum number of altitudes at which a climbing spiral is checked.
_MAX_LEVELS = 12


def hazards_within(requirements: RouteRequirements, middle: Floats, low: float, high: float, reach: float) -> list[str]:
    """Describe the hazards to which a flight within a distance of a place could come too close.

    middle: east and north of the place, m, (2,).
    low, high: minimum and maximum altitude of the flight, m AMSL.
    reach: distance from the place, m.
    """
    return [
        *_ground_hazards(requirements, middle, low, high, reach),
        *_missile_hazards(requirements, middle, low, high, reach),
        *_zone_hazards(requirements, middle, low, high, reach),
        *_area_hazards(requirements, middle, reach),
    ]


def end_loiter_hazards(requirements: RouteRequirements) -> tuple[float, list[str]] | None:
    """Return the reach of the loiter at a mission's end, m, and descriptions of the hazards within reach.

    Return None if the autopilot does not loiter there, or if the mission continues.
    """
    setup, rules = requirements.setup, requirements.setup.autopilot.loiter_rules
    if not rules.ends_in_circle or not ends_at_plain_waypoint(setup.route, setup.mission):
        return None
    up, speed = float(requirements.points[-1, 2]), float(requirements.route.airspeed[-1])
    held = max(requirements.limits.turn_radius(course, course + math.pi, up, speed) for course in (0.0, math.pi))
    reach = LOITER_SWING_RADII * max(abs(rules.radius), held)
    if not math.isfinite(reach):
        return reach, ["the wind is too strong to fly this circle"]
    return reach, hazards_within(requirements, requirements.points[-1, :2], up, up, reach)


def _ground_hazards(
    requirements: RouteRequirements, middle: Floats, low: float, high: float, reach: float
) -> list[str]:
    ground, limits = requirements.setup.scenario.terrain, requirements.setup.scenario.limits
    if ground is None:
        return []
    rings = _ring_points(middle, reach, ground.spacing)
    above, _ = path_clearance(ground.heights, ground.to_pixel.record, _points_at(rings, low))
    found = []
    # Points outside the known terrain are NaN.
    if np.isnan(above).any():
        found.append("the terrain is not known")
    least = float(np.nanmin(above, initial=math.inf))
    if least < requirements.limits.min_clearance - CLEARANCE_TOLERANCE_M:
        found.append(f"the ground is only {least:.0f} m below")
    if limits.max_height_m is not None:
        # The greatest height above ground is the least height above ground of the same world upside down.
        under, _ = path_clearance(-ground.heights, ground.to_pixel.record, _points_at(rings, -high))
        most = -float(np.nanmin(under, initial=math.inf))
        if most > limits.max_height_m + HEIGHT_TOLERANCE_M:
            found.append(f"the ground is {most:.0f} m below, more than the {limits.max_height_m:.0f} m allowed")
    return found


def _missile_hazards(
    requirements: RouteRequirements, middle: Floats, low: float, high: float, reach: float
) -> list[str]:
    scenario = requirements.setup.scenario
    if scenario.external:
        return []
    threats, found = scenario.threats, []
    for m, table in enumerate(scenario.spec.threats):
        radius, (east, north, up) = float(threats.kill_radius[m]), threats.position[m]
        horizontal = max(0.0, math.hypot(east - middle[0], north - middle[1]) - reach)
        if radius > 0.0 and math.hypot(horizontal, max(0.0, low - up, up - high)) <= radius:
            found.append(f"the missile {threat_label(table.name or '', m)} reaches it")
    return found


def _zone_hazards(requirements: RouteRequirements, middle: Floats, low: float, high: float, reach: float) -> list[str]:
    airspace = requirements.airspace
    if not airspace.zones:
        return []
    terrain = requirements.setup.scenario.terrain
    rings, found = _ring_points(middle, reach, 0.0), set[int]()
    levels = 1 if high - low < ROUNDING_M else min(_MAX_LEVELS, 2 + int((high - low) / _STEP_M))
    for up in np.linspace(low, high, levels):
        visits = path_zones(_moves(_points_at(rings, float(up))), airspace.records, terrain)
        found |= {z for z in range(len(airspace.zones)) if visits[z].depth > ROUNDING_M or visits[z].unknown}
    return [f"{airspace.zones[z].kind} zone {airspace.zones[z].name or z} may be violated" for z in sorted(found)]


def _area_hazards(requirements: RouteRequirements, middle: Floats, reach: float) -> list[str]:
    scenario = requirements.setup.scenario
    if scenario.external:
        return []
    inside = min(float(min(at - low, high - at)) for at, (low, high) in zip(middle, scenario.bounds, strict=True))
    return ["the area ends"] if inside < reach - ROUNDING_M else []


def _ring_points(middle: Floats, reach: float, spacing: float) -> Floats:
    """Return points on rings around a center out to the reach, about a raster step apart, m, (n, 2)."""
    count = min(_MAX_RINGS, max(_MIN_RINGS, math.ceil(reach / spacing) if spacing > 0.0 else _MIN_RINGS))
    # A polygon circumscribed about its circle leaves no gap between the last ring and the reach.
    last = Cylinder(float(middle[0]), float(middle[1]), reach / math.cos(math.pi / CIRCLE_CORNERS))
    return np.linspace(middle, zone_rings(Zone("", "exclusion", last))[0], count + 1).reshape(-1, 2)


def _points_at(places: Floats, up: float) -> Floats:
    """Return places (n, 2) at one altitude as points (n, 3) m."""
    return np.column_stack([places, np.full(len(places), up)])


def _moves(points: Floats) -> Records:
    """Return straight moves of one second each from each of n points to the next, (n - 1,) of `MOVE`."""
    step = np.diff(points, axis=0)
    run = np.hypot(step[:, 0], step[:, 1])
    moves: Records = np.zeros(len(step), MOVE)
    for axis, name in enumerate(("east", "north", "up")):
        moves[name] = points[:-1, axis]
    for axis, name in enumerate(("course_east", "course_north")):
        moves[name] = np.divide(step[:, axis], run, out=np.zeros_like(run), where=run > 0.0)
    moves["length"], moves["climb"] = run, step[:, 2]
    moves["time"], moves["lasts"] = np.arange(len(step)), 1.0
    return moves
