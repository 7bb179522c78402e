"""The paper's four constraints and four objectives, compiled, for many paths at once.

`paper_scores` looks at the paper's six points a leg (eq. 5-11).  `planner.graded` looks along the whole path and
says how far a constraint is missed instead of how often; both share what `planner.legs` asks of waypoints and legs.
"""

import numpy as np
from numpy.typing import NDArray

from aircraft.compiled import compiled
from planner.cells import Short, cell_at, grid_of
from planner.legs import Gauge, constraints, make_gauge, measure_corners, measure_legs
from planner.reserve import required_clearance
from planner.rules import Rules
from world.frames import polymap
from world.geometry import CLOSEST
from world.terrain import pixel_height

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Dividing points a leg (eq. 6).
POINTS = 6


@compiled
def _squared(threats: Floats) -> Floats:  # pragma: no cover - compiled
    """Threats (m, 7) as a point is compared with them, (m, 7): position, r^2 and scale^4 of missile and radar."""
    out = threats.copy()
    for k in range(out.shape[0]):
        for column in (3, 5):
            radius, scale = threats[k, column], threats[k, column + 1]
            # A radius of 0 is no weapon, and no square is below this.
            out[k, column] = radius * radius if radius > 0.0 else -1.0
            out[k, column + 1] = scale * scale * scale * scale
    return out


@compiled
def _point_exposures(
    squared: Floats, units: Short, first: int, last: int, east: float, north: float, up: float
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Kill and detection exposure of one point to units[first:last] (eq. 9, 10)."""
    kill, seen = 0.0, 0.0
    for entry in range(first, last):
        k = np.uintp(units[entry])
        dx, dy, dz = east - squared[k, 0], north - squared[k, 1], up - squared[k, 2]
        d2 = dx * dx + dy * dy + dz * dz
        closest2 = max(d2, CLOSEST * CLOSEST)
        share = 1.0 / (closest2 * closest2)
        # By multiplication: whether a radius is passed cannot be guessed, and a wrong guess costs more.
        kill += squared[k, 4] * share * (1.0 if d2 <= squared[k, 3] else 0.0)
        seen += squared[k, 6] * share * (1.0 if d2 <= squared[k, 5] else 0.0)
    return kill, seen


@compiled
def _judge_points(
    rules: Rules, gauge: Gauge, squared: Floats, paths: Floats, n: int, missed: Floats, objectives: Floats
) -> None:  # pragma: no cover - compiled
    """Add what the dividing points of path n say of terrain, exposure and height (eq. 5, 9-11).

    A waypoint is taken to the raster once; between waypoints a leg counts as straight in pixels.
    """
    # Arrays are taken out of the rules once: handing the rules on costs more than a point's whole judgement.
    heights, to_pixel = rules.heights, rules.to_pixel
    first, units = rules.near.first, rules.near.units
    west, south, per_metre, cols, rows = grid_of(rules.near)
    clear, last = gauge.clear, paths.shape[1] - 1
    whole = clear[10] > 0.0
    below, kill, seen, height = 0, 0.0, 0.0, 0.0
    need = rules.clearance + rules.reserve
    col1, row1 = polymap(to_pixel, paths[n, 0, 0], paths[n, 0, 1])
    for i in range(last):
        x, y, z = paths[n, i, 0], paths[n, i, 1], paths[n, i, 2]
        dx, dy, dz = paths[n, i + 1, 0] - x, paths[n, i + 1, 1] - y, paths[n, i + 1, 2] - z
        col0, row0 = col1, row1
        col1, row1 = polymap(to_pixel, x + dx, y + dy)
        # A departure: eq. 6 never reaches the destination, which is the seventh point of the last leg.
        for j in range(POINTS + (i == last - 1)):
            f = j * (1.0 / POINTS)
            east, north, up = x + f * dx, y + f * dy, z + f * dz
            ground = pixel_height(heights, col0 + f * (col1 - col0), row0 + f * (row1 - row0))
            if not whole:
                need = required_clearance(clear, east, north)
            # Written so that NaN is below.
            below += 0 if up > ground + need else 1
            height += up - ground if up > ground and j < POINTS else 0.0
            cell = cell_at(west, south, per_metre, cols, rows, east, north)
            one, two = _point_exposures(squared, units, first[cell], first[cell + 1], east, north, up)
            kill += one
            seen += two
    missed[n, 2] += below
    objectives[n, 1] = kill
    objectives[n, 2] = seen
    objectives[n, 3] = height / POINTS


@compiled
def paper_scores(rules: Rules, paths: Floats) -> tuple[Ints, Floats]:  # pragma: no cover - compiled
    """Judge paths (n, w, 3) on six points a leg and the destination: counts (n, 4), objectives (n, 4) (eq. 1-11)."""
    number, count, _ = paths.shape
    missed = np.zeros((number, 4))
    objectives = np.zeros((number, 4))
    gauge = make_gauge(rules)
    squared = _squared(rules.threats)
    legs, corners = np.empty((count - 1, 4)), np.zeros((count, 2))
    for n in range(number):
        measure_legs(paths, n, legs)
        if rules.room:
            measure_corners(rules, gauge, paths, n, legs, corners)
        constraints(rules, gauge, paths, n, legs, corners, False, missed)
        _judge_points(rules, gauge, squared, paths, n, missed, objectives)
        length = 0.0
        for i in range(count - 1):
            length += legs[i, 3]
        objectives[n, 0] = length / gauge.straight
    return missed.astype(np.int64), objectives
