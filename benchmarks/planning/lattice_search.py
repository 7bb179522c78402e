"""An independent search for the shortest safe path: a lattice over the whole map in three dimensions, and many starts.

It shares no frame, no intervals and no populations with the planner: Dijkstra's algorithm from both ends over a lattice
of east, north and height gives the length of the best way through every place; ways through places that lie
on different sides of the missiles are then fitted and tightened one by one, with a budget no planner has.  So it sees
the other side of an obstacle, a way over one and a way under it, wherever the lattice has a gap.
"""

import heapq
import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from benchmarks.task import Task, is_safe, scalar
from planner.evaluation.encoding import rotated_frame, rotated_vectors
from planner.seeding.pattern_search import search_patterns
from planner.seeding.waypoint_chains import free_points
from planner.seeding.waypoint_fitting import fit_waypoints, tighten

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Between the lattice's places, m; and steps that climb or sink so many layers at most.
PITCH, LAYER, MAX_LAYERS = 66.0, 20.0, 4
# Steps on the map: to the eight neighbours, and a knight's.
STEPS = np.array([(i, j) for i in range(-2, 3) for j in range(-2, 3) if math.gcd(i, j) == 1])
# Ways that are tightened, and how much longer than the best on the lattice they may be.
WAYS, LONGER = 40, 1.3
# Rounds of tightening a way, the first move of each, and evaluations of its pattern search.
SCALES = (1.0, 0.6, 1.0, 0.5, 0.25, 0.5, 0.25, 0.12, 0.06)
PATTERNS = 1500


class Lattice(NamedTuple):
    """Places of a lattice: which are open (columns, rows, layers), and the position of the first, m."""

    open: Flags
    west: float
    south: float
    bottom: float


def make_lattice(task: Task) -> Lattice:
    """The lattice of a problem's map, from its floor to its ceiling; the ceiling is a layer."""
    data = task.problem.search
    columns, rows = int((data.east - data.west) / PITCH) + 1, int((data.north - data.south) / PITCH) + 1
    layers = int((data.ceiling - max(0.0, data.floor)) / LAYER) + 1
    bottom = data.ceiling - (layers - 1) * LAYER
    east, north, up = np.meshgrid(
        data.west + PITCH * np.arange(columns),
        data.south + PITCH * np.arange(rows),
        bottom + LAYER * np.arange(layers),
        indexing="ij",
    )
    places = np.stack([east, north, up], axis=-1)
    free = free_points(data, places.reshape(-1, 3)).reshape(places.shape[:3])
    return Lattice(free, data.west, data.south, bottom)


@njit
def _lengths(free: Flags, steps: Ints, home: Ints, climb: float, dive: float, forward: bool) -> Floats:
    """Length of the shortest way between home and each open place, m: Dijkstra's algorithm.

    climb, dive: tangents.  forward: from home, or to it.
    """
    columns, rows, layers = free.shape
    out = np.full(free.shape, np.inf)
    out[home[0], home[1], home[2]] = 0.0
    heap = [(0.0, home[0], home[1], home[2])]
    while heap:
        length, i, j, k = heapq.heappop(heap)
        if length > out[i, j, k]:
            continue
        for s in range(steps.shape[0]):
            x, y = i + steps[s, 0], j + steps[s, 1]
            if x < 0 or y < 0 or x >= columns or y >= rows:
                continue
            run = PITCH * math.sqrt(steps[s, 0] ** 2 + steps[s, 1] ** 2)
            up = min(MAX_LAYERS, int((climb if forward else dive) * run / LAYER))
            down = min(MAX_LAYERS, int((dive if forward else climb) * run / LAYER))
            for z in range(max(0, k - down), min(layers - 1, k + up) + 1):
                if not free[x, y, z]:
                    continue
                total = length + math.sqrt(run * run + (LAYER * (z - k)) ** 2)
                if total < out[x, y, z]:
                    out[x, y, z] = total
                    heapq.heappush(heap, (total, x, y, z))
    return out


@njit
def _descend(lengths: Floats, steps: Ints, place: Ints, climb: float, dive: float, forward: bool) -> Ints:
    """Places (n, 3) from one down to the home of `_lengths`."""
    out = [(place[0], place[1], place[2])]
    columns, rows, layers = lengths.shape
    i, j, k = place
    while lengths[i, j, k] > 0.0:
        best, to = np.inf, (i, j, k)
        for s in range(steps.shape[0]):
            x, y = i + steps[s, 0], j + steps[s, 1]
            if x < 0 or y < 0 or x >= columns or y >= rows:
                continue
            run = PITCH * math.sqrt(steps[s, 0] ** 2 + steps[s, 1] ** 2)
            up = min(MAX_LAYERS, int((dive if forward else climb) * run / LAYER))
            down = min(MAX_LAYERS, int((climb if forward else dive) * run / LAYER))
            for z in range(max(0, k - down), min(layers - 1, k + up) + 1):
                total = lengths[x, y, z] + math.sqrt(run * run + (LAYER * (z - k)) ** 2)
                if total < best:
                    best, to = total, (x, y, z)
        if not lengths[to] < lengths[i, j, k]:
            break
        i, j, k = to
        out.append(to)
    return np.array(out)


def lattice_ways(task: Task) -> list[Floats]:
    """Ways (n, 3) world m on different sides of the missiles, shortest first; none where the lattice is closed."""
    data, lattice = task.problem.search, make_lattice(task)
    climb, dive = math.tan(data.max_climb - data.angle_margin), math.tan(data.max_dive - data.angle_margin)
    first = np.array([lattice.west, lattice.south, lattice.bottom])
    pitch = np.array([PITCH, PITCH, LAYER])
    ends = [np.rint((end - first) / pitch).astype(np.int64) for end in (data.start, data.destination)]
    for end in ends:
        lattice.open[tuple(end)] = True
    from_start = _lengths(lattice.open, STEPS, ends[0], climb, dive, True)
    to_end = _lengths(lattice.open, STEPS, ends[1], climb, dive, False)
    through = from_start + to_end
    if not through.min() < math.inf:
        return []
    places = np.argwhere(through <= LONGER * through.min())
    order = np.argsort(through[tuple(places.T)], kind="stable")
    ways: dict[bytes, Floats] = {}
    # Places are looked at thinned out: those beside each other share their way.
    for place in places[order]:
        if (place % 3).any() and len(ways):
            continue
        before = _descend(from_start, STEPS, place, climb, dive, True)
        after = _descend(to_end, STEPS, place, climb, dive, False)
        way = first + pitch * np.concatenate([before[::-1], after[1:]])
        way[0], way[-1] = data.start, data.destination
        sides = _sides(task, way)
        ways.setdefault(sides, way)
        if len(ways) >= WAYS:
            break
    return list(ways.values())


def _sides(task: Task, way: Floats) -> bytes:
    """On which side of each missile a way passes: left, right, or above and below it."""
    data = task.problem.search
    frame = rotated_frame(data.start, data.destination)
    units, points = frame.rotate(task.scenario.threats.position), frame.rotate(way)
    order = np.argsort(points[:, 0], kind="stable")
    across = np.interp(units[:, 0], points[order, 0], points[order, 1]) - units[:, 1]
    over = np.abs(across) < 0.5 * task.scenario.threats.kill_radius
    return bytes(np.where(over, 2, across > 0.0).astype(np.uint8))


def lattice_search(task: Task) -> tuple[float, Floats | None]:
    """Length ratio and waypoints (w, 3) of the best certified path that is found; inf and None for none."""
    data, encoding = task.problem.search, task.encoding
    frame = rotated_frame(data.start, data.destination)
    best: tuple[float, Floats | None] = (math.inf, None)
    for way in lattice_ways(task):
        points = frame.rotate(way)
        # The encoding holds no way that turns back: what does is flattened where it does.
        points[:, 0] = np.maximum.accumulate(points[:, 0])
        path = fit_waypoints(data, frame, points, encoding.waypoints)
        vector = rotated_vectors(task.problem.space, encoding, path[None])[0]
        for scale in SCALES:
            vector, _ = tighten(data, encoding, vector, 4, scale)
            found, _ = search_patterns(data, encoding, vector, PATTERNS)
            vector = found[int(np.argmin(scalar(*task.scores(found))))]
            made = encoding.decode(vector[None])[0]
            ratio = task.length_ratio(made)
            if ratio < best[0] and is_safe(task.certificate(made)):
                best = ratio, made
    return best
