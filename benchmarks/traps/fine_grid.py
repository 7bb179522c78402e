"""Find shortest routes on the map by a fine grid, many courses and taut strings, as a reference for plans out of traps.

A place is open if some height between floor and ceiling clears the ground there.  Turns, slopes and tracking errors are
ignored, so that no flight reaches the length; the length of a climb is added by simple sums.
``python -m benchmarks.traps.fine_grid`` prints the table of the embedded ``trap-*`` scenarios, planned for an autopilot
without tracking error, as in the grid, and for ArduPlane, whose corners and climbs need room.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from aircraft.path_limits import Limits
from planfly.workflow.uav import load_uav
from planner.evaluation.leg_constraints import slope_limits
from planner.evaluation.problem import make_problem
from planner.search.plan_path import plan_path
from world.arrays import Flags, Floats
from world.scenario import Scenario, embedded_names, load_scenario

# Spacing of places, m.
PITCH = 50.0
# Largest step along an axis, in places.
REACH = 5
# Spacing of ground samples on a string, m.
SAMPLE = 10.0


def is_open(scenario: Scenario, places: Floats) -> Flags:
    """Return True for places (n, 2) on the map where the ceiling clears the ground."""
    terrain = scenario.terrain
    assert terrain is not None
    lowest = terrain.height(places[:, 0], places[:, 1]) + scenario.limits.min_clearance_m
    found = (lowest <= scenario.ceiling) & (places >= scenario.bounds[:, 0]).all(axis=1)
    return np.asarray(found & (places <= scenario.bounds[:, 1]).all(axis=1))


def string_is_open(scenario: Scenario, a: Floats, b: Floats) -> bool:
    """Return True if the whole line a-b on the map is open."""
    count = max(2, math.ceil(math.dist(a, b) / SAMPLE) + 1)
    return bool(is_open(scenario, np.linspace(a, b, count)).all())


def shortest_on_map(scenario: Scenario) -> Floats:
    """Return the points of a nearly shortest route on the map from start to destination, m, (k, 2).

    The route is the shortest on a grid, pulled taut.  Without a route the result is empty, (0, 2).
    """
    (west, east), (south, north) = scenario.bounds
    start, destination = scenario.start[:2], scenario.destination[:2]
    x = np.arange(start[0] - PITCH * math.floor((start[0] - west) / PITCH), east, PITCH)
    y = np.arange(start[1] - PITCH * math.floor((start[1] - south) / PITCH), north, PITCH)
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    free = is_open(scenario, grid.reshape(-1, 2)).reshape(grid.shape[:2])
    number = np.arange(free.size).reshape(free.shape)
    begins, ends, lengths = [], [], []
    for i in range(-REACH, REACH + 1):
        for j in range(-REACH, REACH + 1):
            if math.gcd(i, j) != 1:
                continue
            passes = np.ones_like(free)
            for share in np.linspace(0.0, 1.0, 2 * max(abs(i), abs(j)) + 1):
                passes &= _shifted(free, round(share * i), round(share * j))
            begins.append(number[passes])
            ends.append((number + i * number.shape[1] + j)[passes])
            lengths.append(np.full(len(begins[-1]), PITCH * math.hypot(i, j)))
    table = np.concatenate(lengths), (np.concatenate(begins), np.concatenate(ends))
    first, last = (int(np.argmin(((grid - end) ** 2).sum(axis=2))) for end in (start, destination))
    _, before = dijkstra(csr_array(table, shape=(free.size, free.size)), indices=first, return_predecessors=True)
    if before[last] < 0:
        return np.empty((0, 2))
    path = [last]
    while path[-1] != first:
        path.append(int(before[path[-1]]))
    points = grid.reshape(-1, 2)[path[::-1]]
    points[0], points[-1] = start, destination
    # Pull the route taut. Each step is cut into pieces first, so that corners can move.
    for _ in range(3):
        dense = np.concatenate([np.linspace(a, b, 9)[:-1] for a, b in pairwise(points)] + [points[-1:]])
        kept, here = [dense[0]], 0
        while here < len(dense) - 1:
            here = next(
                k
                for k in range(len(dense) - 1, here, -1)
                if k == here + 1 or string_is_open(scenario, dense[here], dense[k])
            )
            kept.append(dense[here])
        points = np.array(kept)
    return points


def _shifted(free: Flags, i: int, j: int) -> Flags:
    """Return the grid of flags shifted by i rows and j columns; False beyond the map."""
    out = np.zeros_like(free)
    rows, columns = free.shape
    a, b = slice(max(0, -i), min(rows, rows - i)), slice(max(0, -j), min(columns, columns - j))
    c, d = slice(max(0, i), min(rows, rows + i)), slice(max(0, j), min(columns, columns + j))
    out[a, b] = free[c, d]
    return out


def map_length(points: Floats) -> float:
    """Return the length of a route (k, 2) or of a path (k, 3) on the map, m."""
    steps = np.diff(points[:, :2], axis=0)
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def climbing_length(scenario: Scenario, path: Floats, climb: float, margin: float = 0.0) -> float:
    """Return the smallest length on the map of a route (k, 2) that climbs at most `climb` (a tangent).

    The ground at each place must be cleared when it is reached; a missing height is gained by a longer path before it.
    margin: height above the scenario's clearance, m.
    """
    terrain = scenario.terrain
    assert terrain is not None
    count = max(2, math.ceil(map_length(path) / SAMPLE))
    runs = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    at = np.linspace(0.0, runs[-1], count)
    places = np.column_stack([np.interp(at, runs, path[:, axis]) for axis in range(2)])
    lowest = terrain.height(places[:, 0], places[:, 1]) + scenario.limits.min_clearance_m + margin
    need = (lowest - scenario.start[2]) / climb
    return map_length(path) + max(0.0, float((need - at).max()))


def length_within(scenario: Scenario, limits: Limits, path: Floats) -> float:
    """Return the smallest length on the map of a route (k, 2).

    The route keeps within the slopes and the clearance of certificates.

    The slope is the harmonic mean of the slopes from the altitude of the start to the highest place on the route.
    """
    terrain, data = scenario.terrain, make_problem(scenario, limits).certified
    assert terrain is not None
    places = np.concatenate([np.linspace(a, b, 100) for a, b in pairwise(path)])
    highest = float(terrain.height(places[:, 0], places[:, 1]).max()) + data.clearance + data.buffer
    level, ahead = np.array([0.0, 0.0, 0.0]), np.array([1000.0, 0.0, 0.0])
    slopes = []
    for amsl in np.linspace(scenario.start[2], max(highest, scenario.start[2]), 50):
        level[2] = ahead[2] = amsl
        slopes.append(math.tan(slope_limits(data, level, ahead)[0]))
    return climbing_length(scenario, path, 1.0 / float(np.mean(1.0 / np.array(slopes))), data.buffer)


def measure(autopilot: str, seed: int = 1) -> dict[str, float]:
    """Print the lengths of default plans of the ``trap-*`` scenarios relative to the grid's lengths.

    The last column is relative to the length of the same route within the limits of certificates (`length_within`).

    autopilot: autopilot of the plans, a name of a scenario's ``[flight] autopilot``.
    """
    ratios = {}
    for name in embedded_names():
        if not name.startswith("trap-"):
            continue
        scenario = load_scenario(name)
        scenario = replace(scenario, flight=scenario.flight.model_copy(update={"autopilot": autopilot}))
        limits = load_uav(scenario).limits
        plan = plan_path(scenario, limits, seed=seed)
        path = shortest_on_map(scenario)
        level = 0.5 * (scenario.start[2] + scenario.ceiling)
        climb = max(limits.slopes(course, level)[0] for course in np.linspace(0.0, 2.0 * math.pi, 16))
        reference = climbing_length(scenario, path, math.tan(climb))
        ratios[name] = map_length(plan.waypoints) / reference
        length, within = map_length(plan.waypoints), length_within(scenario, limits, path)
        print(
            f"  {autopilot:<11}{name:<13}{'safe' if plan.safe else 'NOT SAFE':<9}{length:8.0f} m"
            f"{reference:8.0f} m  {ratios[name]:.3f}  {length / within:.3f}"
        )
    return ratios


if __name__ == "__main__":
    for planned_for in ("planfly", "ardupilot"):
        measure(planned_for)
