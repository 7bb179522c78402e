"""The graded judge: how far a path misses its constraints, along the whole of it, and how long missiles reach it.

It looks at every leg, and at the arcs and parabolas with which a flight cuts the corners, where these could come out
differently.  Steps over the ground grow with the height above it: ground can rise no faster than its steepest slope.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.compiled import compiled
from planner.cells import Cells, cell_at, grid_of
from planner.corners import ARC_STEP, blend_reach, corner
from planner.criteria import POINTS
from planner.legs import Gauge, constraints, make_gauge, measure_corners, measure_legs, required_clearance
from planner.rules import CORNER_SLACK, Rules
from world.frames import polymap
from world.geometry import window_exposure
from world.terrain import pixel_height

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Heights = NDArray[np.float32]
Pixels = tuple[float, float, float, float]

# Height above the required clearance that steps over the ground leave unseen, m: corners may use it.
SEEN = 10.0
# Violation of a sample without known ground, m.
UNKNOWN = 1000.0


@compiled
def terrain_excess(
    heights: Heights,
    clear: Floats,
    ends: Pixels,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Depth below the required clearance along a-b, summed over samples (m x km), and the least height above it.

    ends: columns and rows of a and b.  clear: of `pack_clearance`.  The least height is right up to `SEEN`; above that
    it says no more than "at least `SEEN`".
    """
    col, row, across, down, rise = ends[0], ends[1], ends[2] - ends[0], ends[3] - ends[1], bz - az
    run = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
    step = 1.0 / max(1.0, math.ceil(run / clear[8]))
    # Fastest loss of height above ground, m for the whole segment.
    per_fall = 1.0 / (clear[9] * run + abs(rise) + 1e-9)
    need, whole = clear[0] + clear[1], clear[10] > 0.0
    depth, least, f = 0.0, math.inf, 0.0
    while True:
        ground = pixel_height(heights, col + f * across, row + f * down)
        if not whole:
            need = required_clearance(clear, ax + f * (bx - ax), ay + f * (by - ay))
        gap = az + f * rise - ground - need if ground == ground else -UNKNOWN
        least = min(least, gap)
        if gap < 0.0:
            depth -= gap
        if f >= 1.0:
            break
        f = min(1.0, f + max(step, (gap - SEEN) * per_fall))
    return depth * max(run, 1.0) * step / 1000.0, least


@compiled
def pixels(to_pixel: Floats, ax: float, ay: float, bx: float, by: float) -> Pixels:  # pragma: no cover - compiled
    """Columns and rows of both ends of a segment."""
    col0, row0 = polymap(to_pixel, ax, ay)
    col1, row1 = polymap(to_pixel, bx, by)
    return col0, row0, col1, row1


@compiled
def kill_density(
    threats: Floats,
    cells: Cells,
    margin: float,
    seen: Ints,
    stamp: int,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Mean kill density over the segment a-b, radii grown by the margin, and distance to the nearest such sphere, m.

    cells: the rules' missiles.  The distance is right up to `CORNER_SLACK`.  seen (m,), stamp: scratch; units seen
    with this stamp are left out.
    """
    dx, dy, dz = bx - ax, by - ay, bz - az
    run2 = dx * dx + dy * dy
    length2 = run2 + dz * dz
    west, south, per_metre, cols, rows = grid_of(cells)
    table, units = cells.table, cells.units
    pieces = int(max(1.0, math.ceil(math.sqrt(run2) * per_metre)))
    dose, gap, before = 0.0, CORNER_SLACK, -1
    for piece in range(pieces + 1):
        f = piece / pieces
        cell = cell_at(west, south, per_metre, cols, rows, ax + f * dx, ay + f * dy)
        if cell == before:
            continue
        before = cell
        for entry in range(table[cell, 0], table[cell, 0] + table[cell, 1]):
            k = np.uintp(units[entry])
            if seen[k] == stamp:
                continue
            seen[k] = stamp
            x, y, z = ax - threats[k, 0], ay - threats[k, 1], az - threats[k, 2]
            radius = threats[k, 3] + margin
            along, start2 = dx * x + dy * y + dz * z, x * x + y * y + z * z
            nearest = min(1.0, max(0.0, -along / length2)) if length2 > 0.0 else 0.0
            closest2 = max(0.0, start2 + 2.0 * nearest * along + nearest * nearest * length2)
            if closest2 < (radius + CORNER_SLACK) * (radius + CORNER_SLACK):
                gap = min(gap, math.sqrt(closest2) - radius)
                if closest2 < radius * radius:
                    dose += _dose(along, start2, length2, radius, threats[k, 4])
    return dose, gap


@compiled
def _dose(along: float, start2: float, length2: float, radius: float, scale: float) -> float:  # pragma: no cover
    """Mean kill density of a segment that enters a sphere; see `window_exposure`."""
    if length2 < 1e-12:
        return window_exposure(0.0, 1.0, length2, along, start2, scale)
    middle = -along / length2
    half = math.sqrt(max(0.0, middle * middle - (start2 - radius * radius) / length2))
    enter, leave = max(0.0, middle - half), min(1.0, middle + half)
    return window_exposure(enter, leave, length2, along, start2, scale) if leave > enter else 0.0


class Bench(NamedTuple):
    """Scratch for judging one path after another: legs, corners, gaps of each leg, units seen, and the last stamp."""

    legs: Floats
    corners: Floats
    gaps: Floats
    seen: Ints
    stamp: Ints


@compiled
def make_bench(rules: Rules, count: int) -> Bench:  # pragma: no cover - compiled
    """Scratch for paths of `count` waypoints."""
    seen = np.zeros(rules.threats.shape[0], dtype=np.int64)
    shape = count - 1
    return Bench(np.empty((shape, 4)), np.zeros((count, 2)), np.empty((shape, 2)), seen, np.zeros(1, dtype=np.int64))


@compiled
def score_path(
    rules: Rules, gauge: Gauge, bench: Bench, paths: Floats, n: int, missed: Floats, objectives: Floats
) -> None:  # pragma: no cover - compiled
    """Judge path n of (n, w, 3): rows n of missed (n, 4), which must be 0, and of objectives."""
    # Arrays are taken out of the rules once: handing the rules on costs more than a leg's whole judgement.
    heights, to_pixel, threats, missiles = rules.heights, rules.to_pixel, rules.threats, rules.missiles
    clear, margin = gauge.clear, rules.kill_margin
    legs, corners, gaps, seen, stamp = bench.legs, bench.corners, bench.gaps, bench.seen, bench.stamp[0]
    count = paths.shape[1]
    measure_legs(paths, n, legs)
    measure_corners(rules, gauge, paths, n, legs, corners)
    constraints(rules, gauge, paths, n, legs, corners, True, missed)
    length, kill = 0.0, 0.0
    after = polymap(to_pixel, paths[n, 0, 0], paths[n, 0, 1])
    for i in range(count - 1):
        stamp += 1
        x, y, z = paths[n, i, 0], paths[n, i, 1], paths[n, i, 2]
        x2, y2, z2 = paths[n, i + 1, 0], paths[n, i + 1, 1], paths[n, i + 1, 2]
        before = after
        after = polymap(to_pixel, x2, y2)
        ends = (before[0], before[1], after[0], after[1])
        depth, gaps[i, 0] = terrain_excess(heights, clear, ends, x, y, z, x2, y2, z2)
        dose, gaps[i, 1] = kill_density(threats, missiles, margin, seen, stamp, x, y, z, x2, y2, z2)
        missed[n, 2] += depth
        kill += dose * legs[i, 3]
        length += legs[i, 3]
    for i in range(1, count - 1):
        low, close, radius = _corner_matters(rules, gauge, paths, n, i, legs, corners, gaps)
        if low or close:
            stamp, dose = _judge_corner(rules, clear, paths, n, i, radius, low, close, seen, stamp, missed)
            kill += dose
    bench.stamp[0] = stamp
    objectives[n, 0] = length / gauge.straight
    objectives[n, 1] = kill * POINTS * (count - 1) / length


@compiled
def graded_scores(rules: Rules, paths: Floats) -> tuple[Floats, Floats]:  # pragma: no cover - compiled
    """Graded violations (n, 4) and objectives (n, 4) of paths (n, w, 3), along legs and fly-by arcs.

    Of the objectives length ratio and kill exposure: the mean density along the path times the paper's number of
    points, so that it compares with its sum.  Detection and height stay 0: here they would decide between paths of
    the same length to the last digit only.
    """
    number, count, _ = paths.shape
    missed = np.zeros((number, 4))
    objectives = np.zeros((number, 4))
    gauge = make_gauge(rules)
    bench = make_bench(rules, count)
    for n in range(number):
        score_path(rules, gauge, bench, paths, n, missed, objectives)
    return missed, objectives


@compiled
def _arc_radius(room: bool, legs: Floats, corners: Floats, i: int) -> float:  # pragma: no cover - compiled
    """Radius of the arc at waypoint i: 0 where a number alone limits turns and a leg there is too short for its two.

    As `corners.corner_radii`, of which the ends have no arc.
    """
    radius: float = corners[i, 1]
    if math.isinf(corners[i, 0]):
        return 0.0
    if not room:
        last = legs.shape[0]
        before = corners[i - 1, 0] if i > 1 else 0.0
        after = corners[i + 1, 0] if i < last - 1 else 0.0
        if corners[i, 0] + before > legs[i - 1, 2] or corners[i, 0] + after > legs[i, 2]:
            return 0.0
    return radius


@compiled
def _corner_matters(
    rules: Rules, gauge: Gauge, paths: Floats, n: int, i: int, legs: Floats, corners: Floats, gaps: Floats
) -> tuple[bool, bool, float]:  # pragma: no cover - compiled
    """Whether ground and missiles may be closer to the flown corner at waypoint i than to its legs; its arc's radius.

    They are not where the legs stay further from them than the corner departs from the legs: sideways by at most
    R(1/cos(theta/2) - 1) and a chord's rise, downwards by the crest that is cut.
    """
    radius = 0.0 if rules.fly_over else _arc_radius(rules.room, legs, corners, i)
    tangent = corners[i, 0] if radius > 0.0 else 0.0
    before, after = max(legs[i - 1, 2], 1e-6), max(legs[i, 2], 1e-6)
    slope_in, slope_out = (paths[n, i, 2] - paths[n, i - 1, 2]) / before, (paths[n, i + 1, 2] - paths[n, i, 2]) / after
    crest = max(0.0, slope_in - slope_out)
    reach = blend_reach(rules.aircraft, paths[n, i, 2])
    aside = math.sqrt(radius * radius + tangent * tangent) - radius
    aside += min(aside, radius * (1.0 - math.cos(0.5 * ARC_STEP)))
    drop = 0.5 * tangent * crest + 0.25 * crest * crest * reach + aside * max(abs(slope_in), abs(slope_out))
    if aside + drop < 0.01:
        return False, False, radius
    ground, missile = min(gaps[i - 1, 0], gaps[i, 0]), min(gaps[i - 1, 1], gaps[i, 1])
    return ground < drop + gauge.clear[9] * aside, missile < drop + aside, radius


@compiled
def _judge_corner(
    rules: Rules,
    clear: Floats,
    paths: Floats,
    n: int,
    i: int,
    radius: float,
    low: bool,
    close: bool,
    seen: Ints,
    stamp: int,
    missed: Floats,
) -> tuple[int, float]:  # pragma: no cover - compiled
    """Add what the flown corner at waypoint i violates; return the stamp used last and its kill density x length."""
    arc = corner(rules, paths[n, i - 1], paths[n, i], paths[n, i + 1], radius)
    kill = 0.0
    for k in range(arc.shape[0] - 1):
        x, y, z, x2, y2, z2 = arc[k, 0], arc[k, 1], arc[k, 2], arc[k + 1, 0], arc[k + 1, 1], arc[k + 1, 2]
        if low:
            ends = pixels(rules.to_pixel, x, y, x2, y2)
            depth, _ = terrain_excess(rules.heights, clear, ends, x, y, z, x2, y2, z2)
            missed[n, 2] += depth
        if close:
            stamp += 1
            dose, _ = kill_density(rules.threats, rules.missiles, rules.kill_margin, seen, stamp, x, y, z, x2, y2, z2)
            kill += dose * math.sqrt((x2 - x) ** 2 + (y2 - y) ** 2 + (z2 - z) ** 2)
    return stamp, kill
