"""Find hazards near a loiter that may be flown wider than drawn.

If a loiter is too tight for the bank limit, an autopilot that steers to its center and then orbits as tightly as it can
may be anywhere within `LOITER_SWING_RADII` radii of the bank limit from the center, depending on the direction of
arrival.  The drawn circle alone therefore does not show which hazards the aircraft may meet.
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

# Minimum number of rings along which a disc is checked.  With more rings, their distance is the terrain's spacing.
_MIN_RINGS = 24
# Maximum number of rings along which a disc is checked.
_MAX_RINGS = 120
# Altitude step in which a climbing spiral is checked, m.
_STEP_M = 20.0
# Maximum number of altitudes at which a climbing spiral is checked.
_MAX_LEVELS = 12


def find_hazards(
    requirements: RouteRequirements, center: Floats, min_altitude: float, max_altitude: float, reach: float
) -> list[str]:
    """Describe the hazards within reach of a flight around a center.

    Hazards are the ground, missiles, zones and the area's edges.

    Return one text for each hazard; [] if there are none.

    center: east and north, m, (2,).
    min_altitude, max_altitude: minimum and maximum altitude of the flight, m AMSL.
    reach: maximum horizontal distance of the aircraft from the center, m.
    """
    scenario = requirements.setup.scenario
    edge_hazards = []
    if not scenario.external:
        edge_distance = min(
            float(min(coordinate - min_edge, max_edge - coordinate))
            for coordinate, (min_edge, max_edge) in zip(center, scenario.bounds, strict=True)
        )
        edge_hazards = ["the area's edge is in reach"] if edge_distance < reach - ROUNDING_M else []
    # Missiles whose sphere overlaps the disc between the altitudes; the threats of a mission without a scenario are
    # unknown.
    missile_hazards = []
    if not scenario.external:
        threats = scenario.threats
        for number, threat in enumerate(scenario.spec.threats):
            radius, (east, north, up) = float(threats.kill_radius[number]), threats.position[number]
            horizontal_distance = max(0.0, math.hypot(east - center[0], north - center[1]) - reach)
            if (
                radius > 0.0
                and math.hypot(horizontal_distance, max(0.0, min_altitude - up, up - max_altitude)) <= radius
            ):
                missile_hazards.append(f"missile {threat_label(threat.name or '', number)} is in range")
    # Ground that is unknown, too close below, or too far below for a height limit.
    ground_hazards, terrain, limits = [], scenario.terrain, requirements.limits
    if terrain is not None:
        rings, to_pixel = _ring_points(center, reach, terrain.spacing), terrain.to_pixel.record
        clearances, _ = path_clearance(terrain.heights, to_pixel, _points_at_altitude(rings, min_altitude))
        # The clearance of segments over unknown ground is NaN.
        if np.isnan(clearances).any():
            ground_hazards.append("the terrain is unknown")
        clearance = float(np.nanmin(clearances, initial=math.inf))
        if clearance < limits.min_clearance - CLEARANCE_TOLERANCE_M:
            ground_text = f"only {clearance:.0f} m below" if clearance >= 0.0 else f"{-clearance:.0f} m above"
            ground_hazards.append(f"the ground is {ground_text} ({limits.min_clearance:.0f} m are required)")
        max_height_limit = scenario.limits.max_height_m
        if max_height_limit is not None:
            # With ground and path turned upside down, the minimum clearance is the maximum height above ground.
            inverted_points = _points_at_altitude(rings, -max_altitude)
            inverted_clearances, _ = path_clearance(-terrain.heights, to_pixel, inverted_points)
            max_height = -float(np.nanmin(inverted_clearances, initial=math.inf))
            if max_height > max_height_limit + HEIGHT_TOLERANCE_M:
                height_text = f"{max_height:.0f} m below, more than the {max_height_limit:.0f} m allowed"
                ground_hazards.append(f"the ground is {height_text}")
    return [
        *ground_hazards,
        *missile_hazards,
        *_zone_hazards(requirements, center, min_altitude, max_altitude, reach),
        *edge_hazards,
    ]


def end_loiter_hazards(requirements: RouteRequirements) -> tuple[float, list[str]] | None:
    """Return the reach (m) of the loiter after the last waypoint, and texts on the hazards within reach.

    The reach is the aircraft's maximum distance from that waypoint; inf if the wind is too strong for a loiter.  Return
    None if the mission does not end at a plain waypoint, or if the autopilot does not loiter there.
    """
    setup, rules = requirements.setup, requirements.setup.autopilot.loiters
    if not rules.ends_in_circle or not ends_at_plain_waypoint(setup.route, setup.mission):
        return None
    altitude = float(requirements.points[-1, 2])
    speed = float(requirements.route.leg_airspeeds[-1])
    min_radius = max(
        requirements.limits.turn_radius(course, course + math.pi, altitude, speed) for course in (0.0, math.pi)
    )
    reach = LOITER_SWING_RADII * max(abs(rules.radius), min_radius)
    if not math.isfinite(reach):
        return reach, ["the wind is too strong to fly this circle"]
    return reach, find_hazards(requirements, requirements.points[-1, :2], altitude, altitude, reach)


def _zone_hazards(
    requirements: RouteRequirements, center: Floats, min_altitude: float, max_altitude: float, reach: float
) -> list[str]:
    """Describe the zones that a flight within `reach` (m) of a center may violate.

    Zones whose ground is unknown are included.

    The zones are checked along rings at several altitudes from `min_altitude` to `max_altitude` (m AMSL).
    center: east and north, m, (2,).
    """
    airspace = requirements.airspace
    if not airspace.zones:
        return []
    terrain = requirements.setup.scenario.terrain
    rings, zone_numbers = _ring_points(center, reach, 0.0), set[int]()
    level_count = (
        1
        if max_altitude - min_altitude < ROUNDING_M
        else min(_MAX_LEVELS, 2 + int((max_altitude - min_altitude) / _STEP_M))
    )
    for altitude in np.linspace(min_altitude, max_altitude, level_count):
        # Straight moves between the points; each lasts one second.
        points = _points_at_altitude(rings, float(altitude))
        steps = np.diff(points, axis=0)
        lengths = np.hypot(steps[:, 0], steps[:, 1])
        moves: Records = np.zeros(len(steps), MOVE)
        for axis, name in enumerate(("east", "north", "up")):
            moves[name] = points[:-1, axis]
        for axis, name in enumerate(("course_east", "course_north")):
            moves[name] = np.divide(steps[:, axis], lengths, out=np.zeros_like(lengths), where=lengths > 0.0)
        moves["length"], moves["climb"] = lengths, steps[:, 2]
        moves["time"], moves["lasts"] = np.arange(len(steps)), 1.0
        visits = path_zones(moves, airspace.records, terrain)
        zone_numbers |= {
            number
            for number in range(len(airspace.zones))
            if visits[number].depth > ROUNDING_M or visits[number].unknown
        }
    return [
        f"{airspace.zones[number].kind} zone {airspace.zones[number].name or number} may be violated"
        for number in sorted(zone_numbers)
    ]


def _ring_points(center: Floats, reach: float, spacing: float) -> Floats:
    """Return points on concentric rings that cover the disc of radius `reach` around a center, m, (n, 2).

    spacing: desired distance between rings, m.  The number of rings is limited to `_MIN_RINGS` to `_MAX_RINGS`; a
        spacing of 0 gives `_MIN_RINGS`.
    """
    count = min(_MAX_RINGS, max(_MIN_RINGS, math.ceil(reach / spacing) if spacing > 0.0 else _MIN_RINGS))
    # A polygon circumscribed about its circle leaves no gap between the last ring and the reach.
    last_ring = Cylinder(float(center[0]), float(center[1]), reach / math.cos(math.pi / CIRCLE_CORNERS))
    return np.linspace(center, zone_rings(Zone("", "exclusion", last_ring))[0], count + 1).reshape(-1, 2)


def _points_at_altitude(positions: Floats, altitude: float) -> Floats:
    """Return positions (n, 2) as points (n, 3) at one altitude, m."""
    return np.column_stack([positions, np.full(len(positions), altitude)])
