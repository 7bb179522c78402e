"""Generate the UAV path planning problems of Shehadeh and Kudela, and compute their cost.

Shehadeh and Kudela, "Benchmarking global optimization techniques for unmanned aerial vehicle path planning", Expert
Systems with Applications 2025, arXiv:2501.14503.  The 56 published instances are a file on Zenodo (12793991).
`make_instances` does not read it: it generates instances by the published procedure, as the package metaevobox 2.0.2
(BSD-3) does in its mode "custom".  With the seed 3849 of that package the instances equal the package's instances, so
they are not the 56 terrains that the paper chose out of 5,000 generated ones.

A terrain has 900 x 900 cells; a path has ten waypoints between start and end.  Each waypoint has three variables: its
distance from the previous waypoint, the climb angle of the leg, and its bearing.  Heights of waypoints are relative to
the ground below them, and limited to 100 to 200 m.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import LinearNDInterpolator

from world.arrays import Floats
from world.kernels import compiled

# Seed of the package's instances.
PACKAGE_SEED = 3849
# Number of instances: the first half has 15 threats, the second half 30.
INSTANCE_COUNT = 56
# Number of waypoints between start and end.
WAYPOINT_COUNT = 10
# Side of the terrain, in cells.
MAP_CELLS = 900
# Number of refinements of the terrain; each adds three points to each point.
REFINEMENT_COUNT = 8
# Mean elevation of the first points of the terrain, m.
MEAN_ELEVATION_M = 130.0
# Height of start and end above ground, m.
END_HEIGHT_M = 150.0
# Lowest height of a waypoint above ground, m.
MIN_HEIGHT_M = 100.0
# Highest height of a waypoint above ground, m.
MAX_HEIGHT_M = 200.0
# Half of the range of climb angles, and of bearings, rad.
HALF_RANGE_RAD = 0.25 * math.pi
# Size of the vehicle, in cells.
VEHICLE_SIZE_CELLS = 1.0
# Width of the danger zone around a threat, in cells.
DANGER_ZONE_CELLS = 10.0
# Cost of a leg through a threat, and of a path through the ground.
COLLISION_COST = 1e4
# Weight of the length.
LENGTH_WEIGHT = 5.0
# Weight of the deviation of a height from the middle of its range.
HEIGHT_WEIGHT = 10.0
# Angle above which a turn, or a change of climb angle, adds its degrees to the cost, degrees.
ANGLE_LIMIT_DEG = 45.0
# Number of places of a leg, ends included, that are compared with the ground.
PLACES_PER_LEG = 12


@dataclass(frozen=True, slots=True)
class PublicInstance:
    """Terrain with threats, a start and an end.

    ground: elevations (rows, columns), m; a row is north, a column east, both counted from 1.
    threats: east, north, height and radius (n, 4), in cells; the cost ignores the height.
    start, end: east and north, in cells, and height above ground, m, (3,).
    """

    ground: Floats
    threats: Floats
    start: Floats
    end: Floats

    @property
    def lower(self) -> Floats:
        """Lower bounds (30,): distance, climb angle and bearing of each waypoint."""
        return np.tile([0.0, -HALF_RANGE_RAD, self._bearing() - HALF_RANGE_RAD], WAYPOINT_COUNT)

    @property
    def upper(self) -> Floats:
        """Upper bounds (30,)."""
        longest = 2.0 * float(np.linalg.norm(self.end - self.start)) / WAYPOINT_COUNT
        return np.tile([longest, HALF_RANGE_RAD, self._bearing() + HALF_RANGE_RAD], WAYPOINT_COUNT)

    def _bearing(self) -> float:
        """Angle of the straight line, rad, counted from east.

        The published cost counts bearings from north.
        """
        return math.atan2(self.end[1] - self.start[1], self.end[0] - self.start[0])

    def costs(self, vectors: Floats) -> Floats:
        """Return the costs (n,) of vectors (n, 30), in the order of the bounds."""
        vectors = np.ascontiguousarray(vectors, dtype=np.float64)
        return np.asarray(vector_costs(vectors, self.ground, self.threats, self.start, self.end))


@compiled
def decode_path(vector: Floats, ground: Floats, start: Floats, end: Floats) -> Floats:
    """Return the path (w, 4) of a vector: east, north, height above ground and elevation of each waypoint."""
    count = vector.size // 3
    path = np.empty((count + 2, 4))
    path[0, :3], path[count + 1, :3] = start, end
    for k in range(count):
        distance, climb, bearing = vector[3 * k], vector[3 * k + 1], vector[3 * k + 2]
        level = distance * math.cos(climb)
        east = path[k, 0] + level * math.sin(bearing)
        north = path[k, 1] + level * math.cos(bearing)
        path[k + 1, 0] = min(max(east, 1.0), float(ground.shape[1]))
        path[k + 1, 1] = min(max(north, 1.0), float(ground.shape[0]))
        path[k + 1, 2] = min(max(path[k, 2] + distance * math.sin(climb), MIN_HEIGHT_M), MAX_HEIGHT_M)
    for k in range(count + 2):
        path[k, 3] = path[k, 2] + ground[int(np.rint(path[k, 1])) - 1, int(np.rint(path[k, 0])) - 1]
    return path


@compiled
def threat_cost(path: Floats, threats: Floats) -> float:
    """Return the cost of all legs of a path (w, 4) near or in threats.

    A leg costs `COLLISION_COST` for each threat that it touches.  For each other threat it costs the number of cells by
    which it is nearer than `DANGER_ZONE_CELLS`.
    """
    total = 0.0
    for i in range(path.shape[0] - 1):
        east, north = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1]
        squared = east * east + north * north
        for k in range(threats.shape[0]):
            to_east, to_north = threats[k, 0] - path[i, 0], threats[k, 1] - path[i, 1]
            share = min(1.0, max(0.0, (to_east * east + to_north * north) / squared)) if squared > 0.0 else 0.0
            away = math.hypot(to_east - share * east, to_north - share * north) - threats[k, 3] - VEHICLE_SIZE_CELLS
            if away < 0.0:
                total += COLLISION_COST
            else:
                total += max(0.0, DANGER_ZONE_CELLS - away)
    return total


@compiled
def angle_cost(path: Floats) -> float:
    """Return the sum of the turns, and changes of climb angle, of a path (w, 4) above the limit, degrees.

    A leg without a horizontal part takes the direction of the last leg that has one, or of the next.
    """
    total, legs = 0.0, path.shape[0] - 1
    for i in range(legs - 1):
        a, b = i, i + 1
        while a > 0 and path[a + 1, 0] == path[a, 0] and path[a + 1, 1] == path[a, 1]:
            a -= 1
        while b < legs - 1 and path[b + 1, 0] == path[b, 0] and path[b + 1, 1] == path[b, 1]:
            b += 1
        a_east, a_north = path[a + 1, 0] - path[a, 0], path[a + 1, 1] - path[a, 1]
        b_east, b_north = path[b + 1, 0] - path[b, 0], path[b + 1, 1] - path[b, 1]
        turn = math.atan2(abs(a_east * b_north - a_north * b_east), a_east * b_east + a_north * b_north)
        before = math.atan2(path[i + 1, 3] - path[i, 3], math.hypot(a_east, a_north))
        bend = abs(math.atan2(path[i + 2, 3] - path[i + 1, 3], math.hypot(b_east, b_north)) - before)
        for angle in (math.degrees(turn), math.degrees(bend)):
            if angle > ANGLE_LIMIT_DEG:
                total += angle
    return total


@compiled
def elevation_below(east: float, north: float, ground: Floats) -> float:
    """Return the bilinear elevation of the ground at a position; infinity outside the ground.

    The ground is read one cell to the east and north of the place, as in the package.
    """
    rows, columns = ground.shape
    if east > columns - 1.0 or north > rows - 1.0:
        return math.inf
    column, row = min(int(east), columns - 2), min(int(north), rows - 2)
    u, v = east - column, north - row
    south = (1.0 - u) * ground[row, column] + u * ground[row, column + 1]
    further = (1.0 - u) * ground[row + 1, column] + u * ground[row + 1, column + 1]
    return (1.0 - v) * south + v * further


@compiled
def is_above_ground(path: Floats, ground: Floats) -> bool:
    """Return True if all sampled places of a path (w, 4) are above the ground."""
    for i in range(path.shape[0] - 1):
        for k in range(PLACES_PER_LEG):
            share = k / (PLACES_PER_LEG - 1)
            east = path[i, 0] + share * (path[i + 1, 0] - path[i, 0])
            north = path[i, 1] + share * (path[i + 1, 1] - path[i, 1])
            altitude = path[i, 3] + share * (path[i + 1, 3] - path[i, 3])
            if altitude <= elevation_below(east, north, ground):
                return False
    return True


@compiled
def vector_costs(vectors: Floats, ground: Floats, threats: Floats, start: Floats, end: Floats) -> Floats:
    """Return the costs (n,) of vectors (n, 3 w): length, threats, heights, angles and ground."""
    costs = np.empty(vectors.shape[0])
    for k in range(costs.size):
        path = decode_path(vectors[k], ground, start, end)
        length, heights = 0.0, 0.0
        for i in range(path.shape[0] - 1):
            east, north, up = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1], path[i + 1, 3] - path[i, 3]
            length += math.sqrt(east * east + north * north + up * up)
        for i in range(1, path.shape[0] - 1):
            heights += abs(path[i, 2] - 0.5 * (MIN_HEIGHT_M + MAX_HEIGHT_M))
        costs[k] = LENGTH_WEIGHT * length + threat_cost(path, threats) + HEIGHT_WEIGHT * heights + angle_cost(path)
        if not is_above_ground(path, ground):
            costs[k] += COLLISION_COST
    return costs


def make_instances(seed: int, count: int, folder: Path) -> list[PublicInstance]:
    """Generate the instances of a seed, or read them from a folder that keeps them.

    An instance takes some seconds, nearly all of them for the triangulation of 65,000 to 262,000 points.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rng, instances = np.random.RandomState(seed), []
    for number in range(count):
        file = folder / f"seed-{seed}-{number}-of-{count}.npz"
        if file.exists():
            with np.load(file) as stored:
                fields = {name: stored[name] for name in ("ground", "threats", "start", "end")}
                gauss = int(stored["has_gauss"]), float(stored["gauss"])
                rng.set_state(("MT19937", stored["state"], int(stored["position"]), *gauss))
            instances.append(PublicInstance(**fields))
            continue
        instance = make_instance(rng, 15 if number < 0.5 * count else 30)
        _, state, position, has_gauss, next_gauss = rng.get_state()
        np.savez(
            file,
            ground=instance.ground,
            threats=instance.threats,
            start=instance.start,
            end=instance.end,
            state=state,
            position=position,
            has_gauss=has_gauss,
            gauss=next_gauss,
        )
        instances.append(instance)
    return instances


def make_instance(rng: np.random.RandomState, threat_count: int, cells: int = MAP_CELLS) -> PublicInstance:
    """Generate an instance with a number of threats, on a terrain of cells x cells.

    A start nearer to a threat than its danger zone is drawn again, with the end; the end alone is not checked.
    """
    roughness = rng.rand() * 600.0 - 200.0
    roughness_deviation = rng.rand() * 800.0 + 100.0
    ground = make_terrain(rng, roughness, roughness_deviation, cells)
    draws = rng.rand(threat_count, 4)
    radius = np.round(cells / 15.0 + draws[:, 3] * cells / 30.0)
    offset = np.minimum(radius, 0.1 * cells)
    east, north = np.round(offset + draws[:, 0] * 0.7 * cells), np.round(offset + draws[:, 1] * 0.9 * cells)
    height = np.round(ground[north.astype(int), east.astype(int)] - 10.0 + draws[:, 2] * 40.0)
    threats = np.stack([east, north, height, radius], axis=1)
    reach = radius + VEHICLE_SIZE_CELLS + DANGER_ZONE_CELLS
    while True:
        # Drawn in the package's order: east of start and end, north of start and end.
        start_east, end_east, start_north, end_north = 0.02 + 0.17 * rng.rand(4)
        start = np.round(np.array([start_east, start_north]) * cells)
        end = np.round((1.0 - np.array([end_east, end_north])) * cells)
        if (np.hypot(east - start[0], north - start[1]) > reach).all():
            return PublicInstance(ground, threats, np.append(start, END_HEIGHT_M), np.append(end, END_HEIGHT_M))


def make_terrain(
    rng: np.random.RandomState,
    roughness: float,
    roughness_deviation: float,
    cells: int = MAP_CELLS,
    refinements: int = REFINEMENT_COUNT,
) -> Floats:
    """Generate elevations (cells, cells) from one to four random points, each of which gets children.

    In each of the refinements every point gets three children at random places around it.  A child has the
    interpolated roughness and elevation of its place, and random additions that halve from one refinement to the next;
    the addition to its elevation is proportional to its roughness and its distance.
    """
    count = rng.randint(low=1, high=5)
    x, y = rng.randn(count), rng.randn(count)
    elevation = roughness * rng.randn(count) + MEAN_ELEVATION_M
    rough = roughness_deviation * rng.randn(count) + roughness
    for level in range(1, refinements + 1):
        spread, scale = 0.75**level, 0.5**level
        angle = 2.0 * math.pi * rng.rand(3 * x.size)
        radius = spread * (rng.rand(3 * x.size) + 1.0)
        child_x = np.repeat(x, 3) + radius * np.cos(angle)
        child_y = np.repeat(y, 3) + radius * np.sin(angle)
        both = _interpolate(x, y, np.stack([rough, elevation], axis=1), child_x, child_y)
        child_rough = both[:, 0] + scale * roughness_deviation * rng.randn(angle.size)
        child_elevation = both[:, 1] + scale / spread * radius * child_rough * rng.randn(angle.size)
        x, y = np.concatenate([x, child_x]), np.concatenate([y, child_y])
        rough, elevation = np.concatenate([rough, child_rough]), np.concatenate([elevation, child_elevation])
    x, y = (x - np.median(x)) / np.std(x), (y - np.median(y)) / np.std(y)
    east, north = np.meshgrid(np.linspace(-1.0, 1.0, cells), np.linspace(-1.0, 1.0, cells))
    ground = _interpolate(x, y, elevation[:, None], east.ravel(), north.ravel())
    return np.ascontiguousarray(ground.reshape(cells, cells))


def _interpolate(x: Floats, y: Floats, values: Floats, new_x: Floats, new_y: Floats) -> Floats:
    """Interpolate values (n, c) at points linearly in their triangulation, which has 0 at far corners."""
    corners = 100.0 * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
    places = np.concatenate([corners, np.stack([x, y], axis=1)])
    known = np.concatenate([np.zeros((4, values.shape[1])), values])
    return np.asarray(LinearNDInterpolator(places, known)(new_x, new_y))
