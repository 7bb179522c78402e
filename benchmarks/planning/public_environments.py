"""Generate the environments of Darlan and others, and compute their two objectives.

Darlan, Ajani, Paul and Mallipeddi, "A multi-objective benchmark for UAV path planning with baseline results", Swarm and
Evolutionary Computation 96, 2025.  `make_environment` follows the published procedure for a city, a suburb and
mountains, each without and with a no-fly zone.  The seeds of the published maps are not stated, so that these cannot be
generated again; `read_environment` reads the files ``problems/terrainStruct_*.mat`` of their repository
(github.com/Anomaly33/UAV-Path-Planning-Benchmark), which has no licence.

A map has 200 x 200 cells, and heights have the same unit as cells.  The variables are east and north of the inner
control points of a cubic B-spline, whose 201 places are the path.  The height of a place is that of the highest of the
four cells around it, plus a safe height; where the path would be steeper than 60 degrees, its lower places are raised.
The published program raises them by random steps; here by the least amount, so that the same variables always have the
same objectives.  Both ends are exempt, as there.  The objectives are length and mean height, both to be minimised.  A
turn of more than 105 degrees between two steps of the path is not allowed.
"""

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline
from scipy.io import loadmat

from world.arrays import Floats
from world.kernels import compiled

# Side of a map, in cells.
MAP_CELLS = 200
# Number of places of a path.
PLACE_COUNT = 201
# Steepest slope between two places of a path.
MAX_SLOPE = math.tan(math.radians(60.0))
# Largest turn between two steps of a path, rad.
MAX_TURN_RAD = math.radians(105.0)
# Shortest step that has a direction, in cells: several control points in one place give shorter ones.
SHORTEST_STEP_CELLS = 1e-6
# Half of the range of a first control point about its place on the diagonal, in cells.
FIRST_RANGE_CELLS = 20.0
# Heights of buildings in a city, lowest and highest, in cells.
CITY_HEIGHTS_CELLS = (1, 305)
# Sides of buildings in a city, shortest and longest, in cells.
CITY_SIDES_CELLS = (3, 15)
# Heights of houses in a suburb, lowest and highest, in cells.
SUBURB_HEIGHTS_CELLS = (5, 20)
# Sides of houses in a suburb, shortest and longest, in cells.
SUBURB_SIDES_CELLS = (10, 10)
# Radii of peaks, smallest and largest, in cells.
PEAK_RADII_CELLS = (15, 30)
# Factor on the undulations of the mountains' ground.
UNDULATION_CELLS = 8.0
# Height of a no-fly zone above the highest mountain, in cells.
ZONE_ABOVE_PEAKS_CELLS = 10.0


@dataclass(frozen=True, slots=True)
class Environment:
    """Map with the ends of a path, in cells.

    ground: heights (200, 200); a row is north, a column east, both counted from 1.
    end_height: height of the end of the path, which is at (200, 200); the start is on the ground at (1, 1).
    safe_height: height of a path above the ground.
    control_count: number of control points, both ends included.
    """

    name: str
    ground: Floats
    end_height: float
    safe_height: float
    control_count: int

    @property
    def lower(self) -> Floats:
        """Lower bounds (d,): east and north of each inner control point."""
        return np.full(2 * (self.control_count - 2), 1.0)

    @property
    def upper(self) -> Floats:
        """Upper bounds (d,)."""
        return np.full(2 * (self.control_count - 2), float(MAP_CELLS))

    def tracks(self, vectors: Floats) -> Floats:
        """Return the places (n, 201, 2) of the paths of vectors (n, d)."""
        points = np.empty((len(vectors), self.control_count, 2))
        points[:, 0], points[:, -1] = 1.0, float(MAP_CELLS)
        points[:, 1:-1] = np.clip(vectors, 1.0, float(MAP_CELLS)).reshape(len(vectors), -1, 2)
        return np.asarray(np.clip(spline_basis(self.control_count) @ points, 1.0, float(MAP_CELLS)))

    def scores(self, vectors: Floats) -> tuple[Floats, Floats]:
        """Return the objectives (n, 2) of vectors (n, d), and the excess of their turns (n,), rad."""
        return self.score(self.tracks(vectors))

    def score(self, tracks: Floats) -> tuple[Floats, Floats]:
        """Return objectives (n, 2) of paths with places (n, 201, 2), and excess of their turns (n,), rad."""
        rows = score_tracks(tracks, self.ground, self.safe_height, self.end_height)
        return rows[:, :2], rows[:, 2]

    def first_vectors(self, count: int, rng: np.random.Generator) -> Floats:
        """Draw vectors (count, d) near the diagonal, as the published program does.

        Each point is ahead of the last one.
        """
        vectors = np.empty((count, self.control_count - 2, 2))
        for vector in vectors:
            previous = np.ones(2)
            for number in range(2, self.control_count):
                point = np.full(2, -math.inf)
                while (point < previous).any():
                    along = number * MAP_CELLS / self.control_count
                    point = along + rng.uniform(-FIRST_RANGE_CELLS, FIRST_RANGE_CELLS, 2)
                previous = point
                vector[number - 2] = np.clip(point, 1.0, float(MAP_CELLS))
        return vectors.reshape(count, -1)


@cache
def spline_basis(control_count: int) -> Floats:
    """Return the weights (201, n) of control points of a cubic B-spline.

    The spline begins and ends at the outer points.
    """
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, control_count - 2), np.ones(3)])
    return np.asarray(BSpline.design_matrix(np.linspace(0.0, 1.0, PLACE_COUNT), knots, 3).toarray())


@compiled
def path_heights(track: Floats, ground: Floats, safe_height: float, end_height: float) -> Floats:
    """Return the heights (w,) of a path with places (w, 2).

    They are the lowest above the ground that are not too steep; the first and the last height are those of the ends.
    """
    count = track.shape[0]
    heights = np.empty(count)
    for k in range(count):
        west, south = math.floor(track[k, 0]) - 1, math.floor(track[k, 1]) - 1
        east, north = math.ceil(track[k, 0]) - 1, math.ceil(track[k, 1]) - 1
        highest = max(max(ground[south, west], ground[south, east]), max(ground[north, west], ground[north, east]))
        heights[k] = highest + safe_height
    for k in range(2, count - 1):
        step = math.hypot(track[k, 0] - track[k - 1, 0], track[k, 1] - track[k - 1, 1])
        heights[k] = max(heights[k], heights[k - 1] - MAX_SLOPE * step)
    for k in range(count - 3, 0, -1):
        step = math.hypot(track[k, 0] - track[k + 1, 0], track[k, 1] - track[k + 1, 1])
        heights[k] = max(heights[k], heights[k + 1] - MAX_SLOPE * step)
    heights[0], heights[count - 1] = ground[0, 0], end_height
    return heights


@compiled
def score_tracks(tracks: Floats, ground: Floats, safe_height: float, end_height: float) -> Floats:
    """Return length, mean height and excess of the turns, rad, of paths (n, w, 2), as rows (n, 3)."""
    rows = np.zeros((tracks.shape[0], 3))
    for n in range(tracks.shape[0]):
        track = tracks[n]
        heights = path_heights(track, ground, safe_height, end_height)
        rows[n, 1] = heights.mean()
        for k in range(1, track.shape[0]):
            east, north = track[k, 0] - track[k - 1, 0], track[k, 1] - track[k - 1, 1]
            rows[n, 0] += math.sqrt(east * east + north * north + (heights[k] - heights[k - 1]) ** 2)
            before_east, before_north = track[k - 1, 0] - track[k - 2, 0], track[k - 1, 1] - track[k - 2, 1]
            shortest = min(math.hypot(east, north), math.hypot(before_east, before_north))
            if 2 < k < track.shape[0] - 1 and shortest > SHORTEST_STEP_CELLS:
                along = before_east * east + before_north * north
                turn = abs(math.atan2(before_east * north - before_north * east, along))
                rows[n, 2] += max(0.0, turn - MAX_TURN_RAD)
    return rows


def scale_to(heights: Floats, highest: float) -> Floats:
    """Return heights scaled so that they range from 0 to `highest`."""
    return (heights - heights.min()) / (heights.max() - heights.min()) * highest


def zone_cells(east: float, north: float, radius: float) -> Floats:
    """Return the cells (200, 200) of a no-fly zone as a mask."""
    cells = np.arange(1.0, MAP_CELLS + 1.0)
    return np.asarray(np.hypot(cells - east, cells[:, None] - north) <= radius)


def place_buildings(
    ground: Floats,
    zone: Floats,
    count: int,
    sides: tuple[int, int],
    heights: tuple[int, int],
    rng: np.random.Generator,
) -> None:
    """Place buildings on the ground, outside a zone; each stands on the mean height of its cells.

    sides, heights: smallest and largest side, and height above that mean, in cells.
    """
    for _ in range(count):
        width, depth = rng.integers(sides[0], sides[1] + 1, 2)
        height = float(rng.integers(heights[0], heights[1] + 1))
        while True:
            west, south = rng.integers(0, MAP_CELLS - width + 1), rng.integers(0, MAP_CELLS - depth + 1)
            site = (slice(south, south + depth), slice(west, west + width))
            if not zone[site].any():
                break
        ground[site] = ground[site].mean() + height


def make_city(buildings: int, zone_radius: float, rng: np.random.Generator, *, name: str) -> Environment:
    """Make a city with a no-fly zone in its middle; a radius below 0 gives none."""
    cells = np.arange(1.0, MAP_CELLS + 1.0)
    waves = [np.sin(0.1 * k * cells) for k in range(1, 5)]
    ground = sum(np.outer(wave, wave) * 0.5**k for k, wave in enumerate(waves))
    ground = scale_to(np.asarray(ground), 0.1 * CITY_HEIGHTS_CELLS[1])
    zone = zone_cells(0.5 * MAP_CELLS, 0.5 * MAP_CELLS, zone_radius)
    ground[zone] = 400.0
    place_buildings(ground, zone, buildings, CITY_SIDES_CELLS, CITY_HEIGHTS_CELLS, rng)
    return Environment(name, ground, 100.0, 90.0, 7)


def make_suburb(buildings: int, zone_radius: float, rng: np.random.Generator, *, name: str) -> Environment:
    """Make a suburb with a no-fly zone in its middle; a radius below 0 gives none."""
    cells = np.arange(1.0, MAP_CELLS + 1.0)
    slow, fast = np.sin(0.005 * cells), np.sin(0.03 * cells)
    ground = scale_to(slow + slow[:, None] + 0.5 * np.outer(fast, fast), 2.0 * SUBURB_HEIGHTS_CELLS[1])
    zone = zone_cells(0.5 * MAP_CELLS, 0.5 * MAP_CELLS, zone_radius)
    ground[zone] = 60.0
    place_buildings(ground, zone, buildings, SUBURB_SIDES_CELLS, SUBURB_HEIGHTS_CELLS, rng)
    return Environment(name, ground, 40.0, 5.0, 7 if zone_radius < 0.0 else 10)


def make_mountains(peaks: int, zone_radius: float, rng: np.random.Generator, *, name: str) -> Environment:
    """Make mountains with a no-fly zone north-east of their middle; a radius below 0 gives none."""
    cells = np.arange(1.0, MAP_CELLS + 1.0)
    waves = [np.sin(rate * cells) for rate in (0.03, 0.07, 0.1)]
    ground = np.asarray(sum(np.outer(wave, wave) * 0.5**k for k, wave in enumerate(waves)))
    ground = UNDULATION_CELLS * (ground + 0.1 * rng.random(ground.shape))
    has_zone = zone_radius >= 0.0
    highest, edge = (400.0, 20) if has_zone else (300.0, 17)
    for _ in range(peaks):
        east, north = rng.integers(edge, MAP_CELLS - edge + 1, 2)
        radius = float(rng.integers(PEAK_RADII_CELLS[0], PEAK_RADII_CELLS[1] + 1))
        distances = np.hypot(cells - east, cells[:, None] - north)
        bump = highest * np.exp(-(distances**2) / (2.0 * (0.5 * radius) ** 2))
        ground += np.where(distances <= radius, bump, 0.0)
    ground = scale_to(ground, highest)
    middle = 0.5 * MAP_CELLS + MAP_CELLS / 3.5
    ground[zone_cells(middle, middle, zone_radius)] = highest + ZONE_ABOVE_PEAKS_CELLS
    return Environment(name, ground, 1.0, 10.0, 7)


def make_environments(seed: int) -> list[Environment]:
    """Make the six environments of the published programs.

    They have the numbers of buildings and peaks, and the zones, of these programs.
    """
    kinds = (
        ("city", make_city, 120, -1.0),
        ("city, zone", make_city, 100, 20.0),
        ("suburb", make_suburb, 120, -1.0),
        ("suburb, zone", make_suburb, 110, 20.0),
        ("mountains", make_mountains, 200, -1.0),
        ("mountains, zone", make_mountains, 200, 25.0),
    )
    return [
        make(count, radius, np.random.default_rng([seed, number]), name=name)
        for number, (name, make, count, radius) in enumerate(kinds)
    ]


def read_environment(path: Path) -> Environment:
    """Read a published map, a file ``terrainStruct_NAME.mat``."""
    table = loadmat(path, squeeze_me=True)["terrainStruct"][()]
    ground = np.ascontiguousarray(table["H"], dtype=np.float64)
    name = path.stem.removeprefix("terrainStruct_")
    return Environment(name, ground, float(table["end"][2]), float(table["safeH"]), int(table["n"]))
