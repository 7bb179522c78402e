"""Search the shortest safe path independently, on a three-dimensional lattice over the whole map, with many starts.

It shares no frame, no intervals and no populations with the planner: Dijkstra's algorithm from both ends over a lattice
of east, north and altitude gives the length of the best route through every place; routes on different sides of the
missiles are then fitted and tightened one by one, with a larger budget than any planner.  So it finds routes around
either side of an obstacle, over it and under it, wherever the lattice has a gap.
"""

import heapq
import math
from typing import NamedTuple

import numpy as np
from numba import njit

from benchmarks.task import Task, is_safe, scalar
from planner.evaluation.encoding import rotated_frame, rotated_vectors
from planner.evaluation.leg_constraints import slope_limits
from planner.evaluation.problem import ProblemArrays
from planner.seeding.pattern_search import search_patterns
from planner.seeding.waypoint_chains import free_points
from planner.seeding.waypoint_fitting import fit_waypoints, move_all_waypoints
from world.arrays import Flags, Floats, Ints

# Spacing of the lattice's places, m.
PITCH = 66.0
# Largest distance between layers, m; it is reduced so that the longest steps can climb one layer.
LAYER = 20.0
# Smallest distance between layers, m.
LEAST_LAYER = 6.0
# Maximum number of layers that a step climbs or descends.
MAX_LAYERS = 4
# Steps on the map: to the eight neighbours, and knight's moves.
STEPS = np.array([(i, j) for i in range(-2, 3) for j in range(-2, 3) if math.gcd(i, j) == 1])
# Number of routes that are tightened.
ROUTE_COUNT = 40
# Largest length of a route relative to the best on the lattice.
LONGER = 1.3
# Scale of the first move in each round of tightening a route.
SCALES = (1.0, 0.6, 1.0, 0.5, 0.25, 0.5, 0.25, 0.12, 0.06)
# Evaluations of the pattern search of each round.
PATTERNS = 1500


class Lattice(NamedTuple):
    """Places of a lattice.

    open: True for open places, (columns, rows, layers).
    layer: distance between layers, m.
    west, south, bottom: position of the first place, m.
    """

    open: Flags
    layer: float
    west: float
    south: float
    bottom: float


def make_lattice(task: Task) -> Lattice:
    """Make the lattice of a problem's map, from its floor to its ceiling; the ceiling is a layer."""
    data = task.problem.search
    columns, rows = int((data.east - data.west) / PITCH) + 1, int((data.north - data.south) / PITCH) + 1
    layer = min(LAYER, max(LEAST_LAYER, 0.99 * min(_gentlest(data)) * PITCH * float(np.hypot(*STEPS.T).max())))
    layers = int((data.ceiling - max(0.0, data.floor)) / layer) + 1
    bottom = data.ceiling - (layers - 1) * layer
    east, north, up = np.meshgrid(
        data.west + PITCH * np.arange(columns),
        data.south + PITCH * np.arange(rows),
        bottom + layer * np.arange(layers),
        indexing="ij",
    )
    places = np.stack([east, north, up], axis=-1)
    free = free_points(data, places.reshape(-1, 3)).reshape(places.shape[:3])
    return Lattice(free, layer, data.west, data.south, bottom)


class Tree(NamedTuple):
    """Shortest routes between one place and all others of a lattice; arrays are flat.

    lengths: length of the route to each place, m; inf without a route.
    parents: number of the next place on the route from each place towards the first one; -1 without one.
    classes: number that tells routes apart by the sides on which they pass the missiles: the sum of a random weight for
        each missile and side.
    """

    lengths: Floats
    parents: Ints
    classes: Ints


@njit
def _tree(
    free: Flags,
    layer: float,
    steps: Ints,
    home: Ints,
    climb: float,
    dive: float,
    forward: bool,
    units: Floats,
    weights: Ints,
) -> tuple[Floats, Ints, Ints]:
    """Compute the `Tree` of a lattice by Dijkstra's algorithm.

    free: True at open places, (columns, rows, layers); a place has the number (column * rows + row) * layers + layer.
    layer: distance between layers, m.
    steps: steps on the map in columns and rows, (s, 2).
    home: column, row and layer of the place where the routes begin or end.
    climb, dive: tangents of the steepest climb and dive.
    forward: True for routes from home, False for routes to it.
    units, weights: data of the missiles, from `_units`.
    """
    columns, rows, layers = free.shape
    lengths, parents = np.full(free.size, np.inf), np.full(free.size, -1)
    classes, done = np.zeros(free.size, dtype=np.int64), np.zeros(free.size, dtype=np.bool_)
    first = (home[0] * rows + home[1]) * layers + home[2]
    lengths[first] = 0.0
    heap = [(0.0, first)]
    while heap:
        length, place = heapq.heappop(heap)
        if done[place]:
            continue
        done[place] = True
        i, j, k = place // (rows * layers), place // layers % rows, place % layers
        before = parents[place]
        if before >= 0:
            x, y = before // (rows * layers), before // layers % rows
            change = _passed(x, y, i, j, units, weights)
            classes[place] = classes[before] + (change if forward else -change)
        for s in range(steps.shape[0]):
            x, y = i + steps[s, 0], j + steps[s, 1]
            if x < 0 or y < 0 or x >= columns or y >= rows:
                continue
            run = PITCH * math.sqrt(steps[s, 0] ** 2 + steps[s, 1] ** 2)
            up = min(MAX_LAYERS, int((climb if forward else dive) * run / layer))
            down = min(MAX_LAYERS, int((dive if forward else climb) * run / layer))
            for z in range(max(0, k - down), min(layers - 1, k + up) + 1):
                if not free[x, y, z]:
                    continue
                total, to = length + math.sqrt(run * run + (layer * (z - k)) ** 2), (x * rows + y) * layers + z
                if total < lengths[to]:
                    lengths[to], parents[to] = total, place
                    heapq.heappush(heap, (total, to))
    return lengths, parents, classes


@njit
def _passed(a: int, b: int, c: int, d: int, units: Floats, weights: Ints) -> int:
    """Sum the weights of the missiles that a step from column a, row b to column c, row d passes.

    A step passes a missile if it crosses the line through the missile that is perpendicular to the course from start to
    destination.  The weight depends on the side on which it passes, and is negative if it passes against the course.
    """
    total = 0
    for m in range(units.shape[0]):
        along, across, radius = units[m, 0], units[m, 1], units[m, 2]
        before, after = units[m, 3] * a + units[m, 4] * b - along, units[m, 3] * c + units[m, 4] * d - along
        if (before < 0.0) == (after < 0.0):
            continue
        share = before / (before - after)
        aside = units[m, 3] * (b + share * (d - b)) - units[m, 4] * (a + share * (c - a)) - across
        weight = weights[m, 1] if abs(aside) < 0.5 * radius else weights[m, 0] if aside > 0.0 else 0
        total += weight if after > before else -weight
    return total


@njit
def _trace(parents: Ints, place: int) -> Ints:
    """Return the flat places from one place to the home of a `Tree`."""
    out = [place]
    while parents[out[-1]] >= 0:
        out.append(parents[out[-1]])
    return np.array(out)


def _units(task: Task, lattice: Lattice) -> tuple[Floats, Ints]:
    """Return the arguments `units` (m, 5) and `weights` (m, 2) of `_tree`, a row for each missile.

    The columns of `units` are the missile's place along and across the course from start to destination, and its
    radius, all in steps of the lattice, then cosine and sine of the course.  The columns of `weights` are random
    numbers for a route that passes the missile on its left, and for one that passes near its middle, over or under it.
    """
    frame = rotated_frame(task.problem.search.start, task.problem.search.destination)
    threats = task.scenario.threats
    east, north = ((threats.position[:, axis] - low) / PITCH for axis, low in enumerate((lattice.west, lattice.south)))
    cosine, sine = (np.full(len(east), value) for value in (frame.cosine, frame.sine))
    along, across = cosine * east + sine * north, cosine * north - sine * east
    weights = np.random.default_rng(1).integers(1, 2**55, (len(east), 2))
    return np.column_stack([along, across, threats.kill_radius / PITCH, cosine, sine]), weights


def _gentlest(data: ProblemArrays) -> tuple[float, float]:
    """Return the tangents of the climb and dive limits at the start's altitude.

    They are the smallest over all courses.
    """
    courses = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)
    ends = data.start + 100.0 * np.column_stack([np.sin(courses), np.cos(courses), np.zeros(16)])
    slopes = np.array([slope_limits(data, np.array(data.start), end) for end in ends])
    climb, dive = np.tan(slopes.min(axis=0)).tolist()
    return climb, dive


def lattice_routes(task: Task, most: int = ROUTE_COUNT) -> list[Floats]:
    """Return routes (n, 3), m, that pass the missiles on different sides, shortest first.

    Each route joins the shortest route from the start to some place and the shortest route from there to the
    destination.  Of all such routes that pass every missile on the same side, only the shortest is returned.  The list
    is empty if no route leads to the destination.
    """
    data, lattice = task.problem.search, make_lattice(task)
    climb, dive = _gentlest(data)
    first = np.array([lattice.west, lattice.south, lattice.bottom])
    pitch = np.array([PITCH, PITCH, lattice.layer])
    ends = [np.rint((end - first) / pitch).astype(np.int64) for end in (data.start, data.destination)]
    for end in ends:
        lattice.open[tuple(end)] = True
    sides = _units(task, lattice)
    trees = [Tree(*_tree(lattice.open, lattice.layer, STEPS, end, climb, dive, end is ends[0], *sides)) for end in ends]
    through = trees[0].lengths + trees[1].lengths
    if not through.min() < math.inf:
        return []
    places = np.flatnonzero(through <= LONGER * through.min())
    places = places[np.argsort(through[places], kind="stable")]
    _, firsts = np.unique(trees[0].classes[places] + trees[1].classes[places], return_index=True)
    routes = []
    for place in places[np.sort(firsts)[:most]]:
        before, after = (_trace(tree.parents, place) for tree in trees)
        cells = np.unravel_index(np.concatenate([before[::-1], after[1:]]), lattice.open.shape)
        route = first + pitch * np.column_stack(cells)
        route[0], route[-1] = data.start, data.destination
        routes.append(route)
    return routes


def lattice_search(task: Task) -> tuple[float, Floats | None]:
    """Return length ratio and waypoints (w, 3) of the best certified path; inf and None without one."""
    data, encoding = task.problem.search, task.encoding
    frame = rotated_frame(data.start, data.destination)
    best: tuple[float, Floats | None] = (math.inf, None)
    for route in lattice_routes(task):
        points = frame.to_frame(route)
        # The encoding cannot represent a route that turns back, so that such parts are flattened.
        points[:, 0] = np.maximum.accumulate(points[:, 0])
        path = fit_waypoints(data, frame, points, encoding.waypoints)
        vector = rotated_vectors(task.problem.space, encoding, path[None])[0]
        for scale in SCALES:
            vector, _ = move_all_waypoints(data, encoding, vector, 4, scale)
            found, _ = search_patterns(data, encoding, vector, PATTERNS)
            vector = found[int(np.argmin(scalar(*task.scores(found))))]
            made = encoding.decode(vector[None])[0]
            ratio = task.length_ratio(made)
            if ratio < best[0] and is_safe(task.certificate(made)):
                best = ratio, made
    return best
