"""Check paths from the ground and to the ground against terrain, missile spheres and zones."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flight.mission.items import TAKEOFFS, Command, MissionItem
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.path_moves import straight_moves
from logs.verdict.measures.path_sweeps import path_spheres
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.zone_visits import path_zones
from logs.verdict.places import Place
from logs.verdict.tolerances import ROUNDING_M
from logs.verdict.wording import place_text
from world.airspace.zone_kernels import zone_records
from world.arrays import Floats
from world.terrain import Terrain

# Pairs of a distance (m from the path's start, increasing) and the altitude there (m AMSL).
Profile = list[tuple[float, float]]

# Length of the pieces in which a path's clearance is computed, m.  A gap in the elevation data makes only the pieces
# over the gap unknown.
_PIECE_LENGTH_M = 100.0


class GroundPath(NamedTuple):
    """Path from or to the ground.

    points: east, north and up, m, (n, 3).
    distance: horizontal distance of each point along the path, m, (n,).
    """

    points: Floats
    distance: Floats

    def between(self, first: float, last: float) -> "GroundPath":
        """Return the part of the path between two distances from its start, m."""
        inner_distances = self.distance[(self.distance > first) & (self.distance < last)]
        distances = np.concatenate([[first], inner_distances, [max(first, last)]])
        return GroundPath(
            np.stack([np.interp(distances, self.distance, self.points[:, k]) for k in range(3)], axis=1), distances
        )


def track_path(track: Track) -> GroundPath:
    """Return a flown track as a path: its positions, and their horizontal distances along the track."""
    position = np.asarray(track.position, dtype=np.float64)
    step = np.diff(position[:, :2], axis=0)
    return GroundPath(position, np.concatenate([[0.0], np.cumsum(np.hypot(step[:, 0], step[:, 1]))]))


def straight_path(start: Sequence[float] | Floats, course: float, profile: Profile) -> GroundPath:
    """Return a path on one course (rad) from a start (east and north, m), with the altitudes of a profile."""
    distance, up = np.array(profile, dtype=np.float64).T
    east = start[0] + distance * math.sin(course)
    north = start[1] + distance * math.cos(course)
    return GroundPath(np.stack([east, north, up], axis=1), distance)


def min_path_clearance(terrain: Terrain, path: GroundPath) -> tuple[float, float]:
    """Return a path's minimum height above ground, m, and its distance along the path, m.

    The height is NaN if part of the ground is not known, unless the path hits known ground.
    """
    first, last = float(path.distance[0]), float(path.distance[-1])
    cuts = np.linspace(first, last, max(2, math.ceil((last - first) / _PIECE_LENGTH_M) + 1))
    distances = np.union1d(cuts, path.distance)
    points = np.stack([np.interp(distances, path.distance, path.points[:, k]) for k in range(3)], axis=1)
    clearances = [terrain.clearance(*points[k : k + 2]) for k in range(len(distances) - 1)]
    heights = np.array([clearance for clearance, _ in clearances])
    # `argmin` returns the first NaN if there is one, so unknown ground takes precedence.
    k = int(np.nanargmin(heights)) if (heights < 0.0).any() else int(np.argmin(heights))
    return float(heights[k]), float(distances[k] + clearances[k][1] * (distances[k + 1] - distances[k]))


def hazard_on_path(requirements: RouteRequirements, path: GroundPath) -> str:
    """Return the name of a missile sphere or zone that a path violates, or "" if it violates none.

    If it violates several, the missile with the lowest number is named, or else the zone with the lowest number.  Zones
    that the path violates from its start, and inclusion zones with a floor, are ignored.
    """
    scenario, airspace = requirements.setup.scenario, requirements.airspace
    if not scenario.external:
        threats = scenario.threats
        sphere_visits = path_spheres(
            path.points, path.distance, threats.position, threats.kill_radius, threats.kill_scale
        )
        for missile in np.flatnonzero(sphere_visits.time_inside > 0.0).tolist():
            return place_text(Place("missile", missile, name=scenario.spec.threats[missile].name or ""))
    zone_numbers = [
        zone_number for zone_number, zone in enumerate(airspace.zones) if zone.kind == "exclusion" or zone.floor is None
    ]
    if zone_numbers:
        records = zone_records([airspace.zones[zone_number] for zone_number in zone_numbers])
        zone_visits = path_zones(straight_moves(path.points, path.distance), records, scenario.terrain)
        for zone_number, visit in zip(zone_numbers, zone_visits, strict=True):
            if visit.depth > ROUNDING_M and visit.entry_time > 0.0:
                return place_text(airspace.place(zone_number))
    return ""


# ----------------------------------------------------------------------
# The mission items at which paths from and to the ground begin and end.


def has_ground_paths(requirements: RouteRequirements) -> bool:
    """Return True if the paths from and to the ground can be judged.

    This needs terrain data and a flight that was not imported, and for a plan made by planfly, planned ground phases.
    """
    setup = requirements.setup
    has_ground_phases = setup.plan is None or setup.plan.procedures is not None
    return setup.scenario.terrain is not None and has_ground_phases and setup.imported_log is None


def takeoff_item(setup: FlightSetup) -> tuple[int, MissionItem | None]:
    """Return the index of the first waypoint with a mission item, and the take-off item.

    The item is None if it is no take-off.

    The index is 0 if no waypoint has an item.
    """
    route = setup.route
    first = next((k for k, seq in enumerate(route.items.tolist()) if seq >= 0), 0)
    items = [item for item in setup.mission.items if item.seq == int(route.items[first])]
    return first, items[0] if items and items[0].command in TAKEOFFS else None


def landing_item(setup: FlightSetup) -> tuple[int, MissionItem] | None:
    """Return the index of the last waypoint that belongs to a NAV_LAND, and this item.

    Return None if no waypoint after the first belongs to a NAV_LAND.
    """
    landings = {item.seq: item for item in setup.mission.items if item.command == Command.NAV_LAND}
    landing_waypoints = [
        (k, landings[seq]) for k, seq in enumerate(setup.route.items.tolist()) if k and seq in landings
    ]
    return landing_waypoints[-1] if landing_waypoints else None


def first_landing_leg(setup: FlightSetup, landing: int, final_leg: int) -> int:
    """Return the first leg of a landing: from DO_LAND_START, or else the leg before the final approach.

    The landing begins with the leg that leads to the first waypoint after the last DO_LAND_START before the landing.

    landing: number of the landing's item.
    final_leg: leg of the final approach.
    """
    starts = [item.seq for item in setup.mission.items if item.command == Command.DO_LAND_START and item.seq < landing]
    later_waypoints = np.flatnonzero(setup.route.items > max(starts)) if starts else np.zeros(0)
    return max(0, int(later_waypoints[0]) - 1 if later_waypoints.size else final_leg - 1)
