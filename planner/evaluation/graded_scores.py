"""The graded judge: how far a path misses its constraints, along the whole of it, and how long missiles reach it.

It looks at every leg, and at the arcs and parabolas with which a flight cuts the corners, where these could come out
differently.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import PerformanceTable
from planner.evaluation.fly_by_corners import ARC_STEP, blend_reach, corner_past
from planner.evaluation.leg_constraints import Gauge, constraints, make_gauge, measure_corners, measure_legs
from planner.evaluation.missile_index import Missiles, kill_density
from planner.evaluation.paper_scores import POINTS
from planner.evaluation.problem_arrays import CORNER_SLACK, Rules, Steep
from planner.evaluation.terrain_clearance import DEPTH, GROUND_A, GROUND_B, LINE, pixels, sound, terrain_excess
from world.frames import PolyMapRecord
from world.kernels import compiled, compiled_views, inlined

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Heights = NDArray[np.float32]

# Rise of an arc above its chord, as a share of its radius.
CHORD_RISE = 1.0 - math.cos(0.5 * ARC_STEP)
# Columns of `Bench.bends`.
RADIUS, DROP, ASIDE, REACH, WATCH = 0, 1, 2, 3, 4


class Bench(NamedTuple):
    """Scratch for judging one path after another.

    legs, corners: measured.  bends: (w, 5) of `_measure_bends`.  lines: (w - 1, `LINE`) of `sound`, asked: (w - 1,)
    legs that it has not finished.  gaps: (w - 1, 2) distance from missiles near both ends of each leg.
    """

    legs: Floats
    corners: Floats
    bends: Floats
    lines: Floats
    gaps: Floats
    asked: Ints


@compiled
def make_bench(rules: Rules, count: int) -> Bench:  # pragma: no cover - compiled
    """Scratch for paths of `count` waypoints."""
    return Bench(
        np.empty((count - 1, 4)),
        np.zeros((count, 2)),
        np.zeros((count, 5)),
        np.empty((count - 1, LINE)),
        np.empty((count - 1, 2)),
        np.empty(count - 1, dtype=np.int64),
    )


@compiled
def score_path(
    rules: Rules, gauge: Gauge, bench: Bench, paths: Floats, n: int, missed: Floats, objectives: Floats
) -> None:  # pragma: no cover - compiled
    """Judge path n of (n, w, 3): rows n of missed (n, 4), which must be 0, and of objectives."""
    # Arrays are taken out of the rules once: handing the rules on costs more than a leg's whole judgement.
    heights, to_pixel, missiles = rules.heights, rules.to_pixel, rules.missiles
    steep, table, clear, margin = rules.steep, rules.aircraft, gauge.clear, rules.kill_margin
    legs, corners, bends, lines, gaps = bench.legs, bench.corners, bench.bends, bench.lines, bench.gaps
    asked = bench.asked
    count = paths.shape[1]
    measure_legs(paths, n, legs)
    measure_corners(rules, gauge, paths, n, legs, corners)
    constraints(rules, gauge, paths, n, legs, corners, True, missed)
    _measure_bends(table, rules.room, rules.fly_over, paths, n, legs, corners, bends)
    sound(heights, steep, to_pixel, clear, paths, n, legs, bends[:, REACH], lines, asked)
    length, kill = 0.0, 0.0
    for i in range(count - 1):
        x, y, z = paths[n, i, 0], paths[n, i, 1], paths[n, i, 2]
        x2, y2, z2 = paths[n, i + 1, 0], paths[n, i + 1, 1], paths[n, i + 1, 2]
        slack = max(bends[i, WATCH], bends[i + 1, WATCH])
        dose, gaps[i, 0], gaps[i, 1] = kill_density(
            missiles, margin, slack, x, y, z, x2, y2, z2, bends[i, REACH], bends[i + 1, REACH]
        )
        missed[n, 2] += lines[i, DEPTH]
        kill += dose * legs[i, 3]
        length += legs[i, 3]
    for i in range(1, count - 1):
        drop, aside = bends[i, DROP], bends[i, ASIDE]
        low = min(lines[i - 1, GROUND_B], lines[i, GROUND_A]) < drop + clear[9] * aside
        close = drop + aside > CORNER_SLACK or min(gaps[i - 1, 1], gaps[i, 0]) < drop + aside
        if drop + aside < 0.01 or not (low or close):
            continue
        arc = corner_past(table, paths[n, i - 1], paths[n, i], paths[n, i + 1], bends[i, RADIUS])
        if low:
            missed[n, 2] += _corner_depth(heights, steep, to_pixel, clear, arc)
        if close:
            kill += _corner_kill(missiles, margin, arc)
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


@inlined
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


@compiled_views
def _measure_bends(
    table: PerformanceTable,
    room: bool,
    fly_over: bool,
    paths: Floats,
    n: int,
    legs: Floats,
    corners: Floats,
    out: Floats,
) -> None:  # pragma: no cover - compiled
    """Fill out (w, 5): radius of the flown arc at each waypoint, and how far the flown corner departs from the legs, m.

    Downwards it is by the crest that is cut, and sideways by at most R(1/cos(theta/2) - 1) and a chord's rise; and it
    does so within `REACH` of the waypoint: within the tangent and half the arc, or the blend of heights.  `WATCH`: how
    far from the legs missiles matter to it, 0 where it is judged in any case.
    """
    slope_out = (paths[n, 1, 2] - paths[n, 0, 2]) / max(legs[0, 2], 1e-6)
    for i in range(1, legs.shape[0]):
        radius = 0.0 if fly_over else _arc_radius(room, legs, corners, i)
        tangent = corners[i, 0] if radius > 0.0 else 0.0
        slope_in = slope_out
        slope_out = (paths[n, i + 1, 2] - paths[n, i, 2]) / max(legs[i, 2], 1e-6)
        crest = max(0.0, slope_in - slope_out)
        reach = blend_reach(table, paths[n, i, 2])
        aside = math.sqrt(radius * radius + tangent * tangent) - radius
        aside += min(aside, radius * CHORD_RISE)
        out[i, RADIUS] = radius
        out[i, DROP] = 0.5 * tangent * crest + 0.25 * crest * crest * reach + aside * max(abs(slope_in), abs(slope_out))
        out[i, ASIDE] = aside
        out[i, REACH] = 2.0 * tangent if tangent > 0.0 else abs(slope_in - slope_out) * reach
        out[i, WATCH] = aside + out[i, DROP] if aside + out[i, DROP] <= CORNER_SLACK else 0.0


@compiled_views
def _corner_depth(
    heights: Heights, steep: Steep, to_pixel: PolyMapRecord, clear: Floats, arc: Floats
) -> float:  # pragma: no cover - compiled
    """Depth below the required clearance along a flown corner (k, 3), m x km."""
    total = 0.0
    for k in range(arc.shape[0] - 1):
        x, y, z, x2, y2, z2 = arc[k, 0], arc[k, 1], arc[k, 2], arc[k + 1, 0], arc[k + 1, 1], arc[k + 1, 2]
        ends = pixels(to_pixel, x, y, x2, y2)
        total += terrain_excess(heights, steep, clear, ends, x, y, z, x2, y2, z2)
    return total


@compiled_views
def _corner_kill(missiles: Missiles, margin: float, arc: Floats) -> float:  # pragma: no cover - compiled
    """Kill density x length along a flown corner (k, 3)."""
    total = 0.0
    for k in range(arc.shape[0] - 1):
        x, y, z, x2, y2, z2 = arc[k, 0], arc[k, 1], arc[k, 2], arc[k + 1, 0], arc[k + 1, 1], arc[k + 1, 2]
        dose, _, _ = kill_density(missiles, margin, 0.0, x, y, z, x2, y2, z2, 0.0, 0.0)
        total += dose * math.sqrt((x2 - x) ** 2 + (y2 - y) ** 2 + (z2 - z) ** 2)
    return total
