"""The graded judge: how far a path misses its constraints, along the whole of it, and how long missiles reach it.

It looks at every leg, and at the arcs and parabolas with which a flight cuts the corners, where these could come out
differently.  Steps over the ground grow with the height above it: ground can rise no faster than its steepest slope.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.compiled import compiled, compiled_views, inlined
from planner.cells import Missiles
from planner.corners import ARC_STEP, blend_reach, corner_past
from planner.criteria import POINTS
from planner.legs import Gauge, constraints, make_gauge, measure_corners, measure_legs
from planner.reserve import required_clearance
from planner.rules import CORNER_SLACK, Rules, Steep
from world.frames import polymap
from world.geometry import window_exposure
from world.terrain import TILE, pixel_height

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Heights = NDArray[np.float32]
Pixels = tuple[float, float, float, float]

# Height above the required clearance that steps over the ground leave unseen, m: corners may use it.
SEEN = 10.0
# Rise of an arc above its chord, as a share of its radius.
CHORD_RISE = 1.0 - math.cos(0.5 * ARC_STEP)
# Columns of `Bench.bends`.
RADIUS, DROP, ASIDE, REACH, WATCH = 0, 1, 2, 3, 4
# Columns of `Bench.lines` that `_sound` is asked for.
DEPTH, GROUND_A, GROUND_B = 8, 9, 10
# Violation of a sample without known ground, m.
UNKNOWN = 1000.0


@inlined
def _look(
    heights: Heights,
    slopes: Heights,
    reach: float,
    clear: Floats,
    col: float,
    row: float,
    up: float,
    need: float,
    run: float,
    rise: float,
    step: float,
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Height above the required clearance at a place of a line, and the share of the line that needs no look after it.

    run, rise: of the whole line, m.  step: share from one sample to the next where the ground is near.
    """
    ground = pixel_height(heights, col, row)
    gap = up - ground - need if ground == ground else -UNKNOWN
    tiles_down, tiles_across = np.int64(slopes.shape[0] - 1), np.int64(slopes.shape[1] - 1)
    i, j = np.int64(row) // TILE, np.int64(col) // TILE
    i, j = i if i < tiles_down else tiles_down, j if j < tiles_across else tiles_across
    i, j = i if i > 0 else 0, j if j > 0 else 0
    # Fastest loss of height above ground, m for the whole line.
    fall = (slopes[np.uintp(i), np.uintp(j)] + clear[11]) * run + abs(rise) + 1e-9
    ahead, known = (gap - SEEN) / fall, reach / (run + 1e-9)
    ahead = ahead if ahead < known else known
    return gap, ahead if ahead > step else step


@compiled_views
def terrain_excess(
    heights: Heights,
    steep: Steep,
    clear: Floats,
    ends: Pixels,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
) -> float:  # pragma: no cover - compiled
    """Depth below the required clearance along a-b, summed over samples (m x km).

    ends: columns and rows of a and b.  steep: of the rules.  clear: of `pack_clearance`.
    """
    col, row, across, down, rise = ends[0], ends[1], ends[2] - ends[0], ends[3] - ends[1], bz - az
    run = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
    step = 1.0 / max(1.0, math.ceil(run / clear[8]))
    slopes, reach = steep.slopes, steep.reach
    need, whole = clear[0] + clear[1], clear[10] > 0.0
    depth, f = 0.0, 0.0
    while True:
        if not whole:
            need = required_clearance(clear, ax + f * (bx - ax), ay + f * (by - ay))
        gap, ahead = _look(
            heights, slopes, reach, clear, col + f * across, row + f * down, az + f * rise, need, run, rise, step
        )
        depth -= gap if gap < 0.0 else 0.0
        if f >= 1.0:
            return depth * max(run, 1.0) * step / 1000.0
        f = min(1.0, f + ahead)


@compiled_views
def _sound(
    heights: Heights,
    steep: Steep,
    to_pixel: Floats,
    clear: Floats,
    paths: Floats,
    n: int,
    legs: Floats,
    bends: Floats,
    lines: Floats,
    asked: Ints,
) -> None:  # pragma: no cover - compiled
    """Do the same for all legs of path n: fill lines with depths, and with the least heights near both ends.

    The least heights are right up to `SEEN`; above that they say no more than "at least `SEEN`".  In rounds, a sample
    of each leg: the next one of the same leg would wait for what this one finds.
    """
    count = legs.shape[0]
    after = polymap(to_pixel, paths[n, 0, 0], paths[n, 0, 1])
    for i in range(count):
        before = after
        after = polymap(to_pixel, paths[n, i + 1, 0], paths[n, i + 1, 1])
        run = legs[i, 2]
        step = 1.0 / max(1.0, math.ceil(run / clear[8]))
        lines[i, 0], lines[i, 1] = before[0], before[1]
        lines[i, 2], lines[i, 3] = after[0] - before[0], after[1] - before[1]
        lines[i, 4], lines[i, 5] = step, 0.0
        # A sample stands for the step that follows it, and for the one before.
        per_metre = 1.0 / max(run, 1e-9)
        lines[i, 6] = bends[i, REACH] * per_metre + step
        lines[i, 7] = 1.0 - bends[i + 1, REACH] * per_metre - step
        lines[i, DEPTH], lines[i, GROUND_A], lines[i, GROUND_B] = 0.0, math.inf, math.inf
        asked[i] = i
    slopes, reach = steep.slopes, steep.reach
    need, whole = clear[0] + clear[1], clear[10] > 0.0
    while count > 0:
        left = 0
        for entry in range(count):
            i = np.uintp(asked[entry])
            f, step = lines[i, 5], lines[i, 4]
            up, rise = paths[n, i, 2], paths[n, i + np.uintp(1), 2] - paths[n, i, 2]
            if not whole:
                dx, dy = paths[n, i + np.uintp(1), 0] - paths[n, i, 0], paths[n, i + np.uintp(1), 1] - paths[n, i, 1]
                need = required_clearance(clear, paths[n, i, 0] + f * dx, paths[n, i, 1] + f * dy)
            col, row = lines[i, 0] + f * lines[i, 2], lines[i, 1] + f * lines[i, 3]
            gap, ahead = _look(heights, slopes, reach, clear, col, row, up + f * rise, need, legs[i, 2], rise, step)
            lines[i, DEPTH] -= gap if gap < 0.0 else 0.0
            at_a, at_b = gap if f <= lines[i, 6] else math.inf, gap if f >= lines[i, 7] else math.inf
            lines[i, GROUND_A] = at_a if at_a < lines[i, GROUND_A] else lines[i, GROUND_A]
            lines[i, GROUND_B] = at_b if at_b < lines[i, GROUND_B] else lines[i, GROUND_B]
            asked[left] = np.int64(i)
            left += 1 if f < 1.0 else 0
            lines[i, 5] = f + ahead if f + ahead < 1.0 else 1.0
        count = left
    for i in range(legs.shape[0]):
        lines[i, DEPTH] *= max(legs[i, 2], 1.0) * lines[i, 4] / 1000.0


@inlined
def pixels(to_pixel: Floats, ax: float, ay: float, bx: float, by: float) -> Pixels:  # pragma: no cover - compiled
    """Columns and rows of both ends of a segment."""
    col0, row0 = polymap(to_pixel, ax, ay)
    col1, row1 = polymap(to_pixel, bx, by)
    return col0, row0, col1, row1


@compiled_views
def kill_density(
    missiles: Missiles,
    margin: float,
    slack: float,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
    first: float,
    last: float,
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Mean kill density over the segment a-b, radii grown by the margin, and distances to the nearest such sphere, m.

    first, last: lengths (m) at a and at b: the distances are from there, and right up to the slack.
    """
    dx, dy, dz = bx - ax, by - ay, bz - az
    length2 = dx * dx + dy * dy + dz * dz
    inverse, slant = 1.0 / length2 if length2 > 0.0 else 0.0, 1.0 / dy if abs(dy) > 1e-9 else 0.0
    units, starts = missiles.units, missiles.first
    dose, near_a, near_b = 0.0, math.inf, math.inf
    for kind in range(missiles.classes.shape[0]):
        west, south, per_metre = missiles.classes[kind, 0], missiles.classes[kind, 1], missiles.classes[kind, 2]
        cols, rows, base = missiles.classes[kind, 3], missiles.classes[kind, 4], int(missiles.classes[kind, 5])
        # A hair more, for what rounding would leave out.
        reach = missiles.classes[kind, 6] + margin + slack + 1e-6
        side = 1.0 / per_metre
        lowest = _cell((min(ay, by) - reach - south) * per_metre, rows)
        for row in range(max(0, lowest), min(int(rows), _cell((max(ay, by) + reach - south) * per_metre, rows) + 1)):
            # The part of the segment from which something in this row of cells is in reach.
            north = south + row * side - ay
            f, g = (north - reach) * slant, (north + side + reach) * slant
            f, g = (f, g) if f < g else (g, f)
            f, g = (f if f > 0.0 else 0.0, g if g < 1.0 else 1.0) if slant != 0.0 else (0.0, 1.0)
            x, x2 = ax + f * dx - west, ax + g * dx - west
            x, x2 = (x, x2) if x < x2 else (x2, x)
            left, right = _cell((x - reach) * per_metre, cols), _cell((x2 + reach) * per_metre, cols)
            if right < 0 or left >= cols:
                continue
            here = base + row * int(cols)
            for entry in range(starts[here + max(0, left)], starts[here + min(int(cols) - 1, right) + 1]):
                k = np.uintp(entry)
                x, y, z = ax - units[k, 0], ay - units[k, 1], az - units[k, 2]
                radius = units[k, 3] + margin
                along, start2 = dx * x + dy * y + dz * z, x * x + y * y + z * z
                closest2 = _closest2(-along * inverse, 0.0, 1.0, along, start2, length2)
                if closest2 < (radius + slack) * (radius + slack):
                    length = math.sqrt(length2)
                    until, since = first / max(length, first), 1.0 - last / max(length, last)
                    one = _closest2(-along * inverse, 0.0, until, along, start2, length2)
                    two = _closest2(-along * inverse, since, 1.0, along, start2, length2)
                    near_a, near_b = min(near_a, math.sqrt(one) - radius), min(near_b, math.sqrt(two) - radius)
                    if closest2 < radius * radius:
                        dose += _dose(along, start2, length2, radius, units[k, 4])
    return dose, near_a, near_b


@inlined
def _cell(place: float, count: float) -> int:  # pragma: no cover - compiled
    """Number of the cell along one axis; -1 and `count` stand for what is outside."""
    inside = place if place > -1.0 else -1.0
    return math.floor(inside if inside < count else count)


@inlined
def _closest2(
    nearest: float, low: float, high: float, along: float, start2: float, length2: float
) -> float:  # pragma: no cover - compiled
    """Squared distance from a point to the part low..high (fractions) of a segment.

    nearest: fraction of the whole line that is nearest to it.  along, start2, length2: see `window_exposure`.
    """
    f = nearest if nearest < high else high
    f = f if f > low else low
    return max(0.0, start2 + f * (2.0 * along + f * length2))


@compiled_views
def _dose(along: float, start2: float, length2: float, radius: float, scale: float) -> float:  # pragma: no cover
    """Mean kill density of a segment that enters a sphere; see `window_exposure`."""
    if length2 < 1e-12:
        return window_exposure(0.0, 1.0, length2, along, start2, scale)
    middle = -along / length2
    half = math.sqrt(max(0.0, middle * middle - (start2 - radius * radius) / length2))
    enter, leave = max(0.0, middle - half), min(1.0, middle + half)
    return window_exposure(enter, leave, length2, along, start2, scale) if leave > enter else 0.0


class Bench(NamedTuple):
    """Scratch for judging one path after another.

    legs, corners: measured.  bends: (w, 5) of `_measure_bends`.  lines: (w - 1, 11) of `_sound`, asked: (w - 1,) legs
    that it has not finished.  gaps: (w - 1, 2) distance from missiles near both ends of each leg.
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
        np.empty((count - 1, 11)),
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
    steep, packed, clear, margin = rules.steep, rules.aircraft, gauge.clear, rules.kill_margin
    legs, corners, bends, lines, gaps = bench.legs, bench.corners, bench.bends, bench.lines, bench.gaps
    asked = bench.asked
    count = paths.shape[1]
    measure_legs(paths, n, legs)
    measure_corners(rules, gauge, paths, n, legs, corners)
    constraints(rules, gauge, paths, n, legs, corners, True, missed)
    _measure_bends(packed, rules.room, rules.fly_over, paths, n, legs, corners, bends)
    _sound(heights, steep, to_pixel, clear, paths, n, legs, bends, lines, asked)
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
        arc = corner_past(packed, paths[n, i - 1], paths[n, i], paths[n, i + 1], bends[i, RADIUS])
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
    packed: Floats, room: bool, fly_over: bool, paths: Floats, n: int, legs: Floats, corners: Floats, out: Floats
) -> None:  # pragma: no cover - compiled
    """Fill out (w, 5): radius of the flown arc at each waypoint, and how far the flown corner departs from the legs, m.

    Downwards it is by the crest that is cut, and sideways by at most R(1/cos(theta/2) - 1) and a chord's rise; and it
    does so within `REACH` of the waypoint: within the tangent and half the arc, or the blend of heights.  WATCH: how far
    from the legs missiles matter to it, 0 where it is judged in any case.
    """
    slope_out = (paths[n, 1, 2] - paths[n, 0, 2]) / max(legs[0, 2], 1e-6)
    for i in range(1, legs.shape[0]):
        radius = 0.0 if fly_over else _arc_radius(room, legs, corners, i)
        tangent = corners[i, 0] if radius > 0.0 else 0.0
        slope_in = slope_out
        slope_out = (paths[n, i + 1, 2] - paths[n, i, 2]) / max(legs[i, 2], 1e-6)
        crest = max(0.0, slope_in - slope_out)
        reach = blend_reach(packed, paths[n, i, 2])
        aside = math.sqrt(radius * radius + tangent * tangent) - radius
        aside += min(aside, radius * CHORD_RISE)
        out[i, RADIUS] = radius
        out[i, DROP] = 0.5 * tangent * crest + 0.25 * crest * crest * reach + aside * max(abs(slope_in), abs(slope_out))
        out[i, ASIDE] = aside
        out[i, REACH] = 2.0 * tangent if tangent > 0.0 else abs(slope_in - slope_out) * reach
        out[i, WATCH] = aside + out[i, DROP] if aside + out[i, DROP] <= CORNER_SLACK else 0.0


@compiled_views
def _corner_depth(
    heights: Heights, steep: Steep, to_pixel: Floats, clear: Floats, arc: Floats
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
