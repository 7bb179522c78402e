"""The paper's four constraints and four objectives, compiled, for many paths at once.

Two judges share the constraints on waypoints and legs.  `paper_scores` looks at the paper's six points a leg
(eq. 5-11).  `graded_scores` looks along the whole path, the arcs that cut its corners included, and says how far
a constraint is missed instead of how often.
"""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.compiled import compiled
from planner.corners import corner, corner_radii
from planner.rules import Rules
from world.frames import polymap
from world.geometry import CLOSEST, segment_exposure, sphere_window, turning_angle
from world.limits import aircraft_slopes, turn_tangents
from world.terrain import pixel_height

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Dividing points a leg (eq. 6).
POINTS = 6
# Leg left over between its two turns: this share of the leg, and this length (m) or what small turns use of it.
ROOM_SHARE = 0.05
ROOM_LENGTH = 20.0
# Growth of the clearance reserve away from an end that starts without it, m per m.
RESERVE_GROWTH = 0.05


@compiled
def extended(rules: Rules, path: Floats) -> Floats:  # pragma: no cover - compiled
    """Path with a far point before the start and after the destination, on the courses asked for there.

    Without such a course the point lies on the leg's own line, and the turn at the end is none.
    """
    count = path.shape[0]
    out = np.empty((count + 2, 3))
    out[1:-1] = path
    for end, at, other, course, sign in (
        (0, 0, 1, rules.start_course, -1.0),
        (count + 1, count - 1, count - 2, rules.destination_course, 1.0),
    ):
        out[end] = path[at]
        if math.isnan(course):
            out[end, :2] = 2.0 * path[at, :2] - path[other, :2]
        else:
            out[end, 0] += sign * 1e4 * math.sin(course)
            out[end, 1] += sign * 1e4 * math.cos(course)
    return out


@compiled
def slope_limits(rules: Rules, a: Floats, b: Floats) -> tuple[float, float]:  # pragma: no cover - compiled
    """Steepest climb and dive of the leg a-b, rad: the tightest at its ends and its middle height, spare taken off."""
    climb, dive = rules.climb, rules.dive
    if math.isnan(climb) or math.isnan(dive):
        course = math.atan2(b[0] - a[0], b[1] - a[1])
        up, down = math.inf, math.inf
        for part in (0.0, 0.5, 1.0):
            one, two = aircraft_slopes(rules.aircraft, course, a[2] + part * (b[2] - a[2]))
            up, down = min(up, one), min(down, two)
        if math.isnan(climb):
            climb = up
        if math.isnan(dive):
            dive = down
    return climb - rules.spare, dive - rules.spare


@compiled
def slope_excess(rules: Rules, a: Floats, b: Floats) -> float:  # pragma: no cover - compiled
    """How far the leg a-b is too steep, as m of height per m of run; 0 where it is not (eq. 3-4)."""
    run = math.hypot(b[0] - a[0], b[1] - a[1])
    rise = b[2] - a[2]
    climb, dive = slope_limits(rules, a, b)
    over = max(0.0, rise - math.tan(climb) * run, -rise - math.tan(dive) * run)
    return float(over / max(run, 1.0))


@compiled
def settling_room(need: float, run: float) -> float:  # pragma: no cover - compiled
    """Length of a leg (m) that stays straight between its turns, so that the first has settled; need: what they use."""
    return ROOM_SHARE * run + min(ROOM_LENGTH, need)


@compiled
def constraints(rules: Rules, path: Floats, counts: Ints, graded: Floats) -> None:  # pragma: no cover - compiled
    """Add the turn, slope and bounds violations of a path (w, 3) to counts (4,) and graded (4,).

    Turn also counts, where room is asked for, each leg that is shorter than its two turns (eq. 1-4, 7).
    """
    way = extended(rules, path)
    last = way.shape[0] - 2
    for i in range(1, last + 1):
        turn = turning_angle(way[i - 1, 0], way[i - 1, 1], way[i, 0], way[i, 1], way[i + 1, 0], way[i + 1, 1])
        if turn > rules.max_turn:
            counts[0] += 1
            graded[0] += turn - rules.max_turn
        over = max(0.0, rules.bounds[0, 0] - way[i, 0], way[i, 0] - rules.bounds[0, 1])
        over = max(over, rules.bounds[1, 0] - way[i, 1], way[i, 1] - rules.bounds[1, 1])
        over = max(over, rules.floor - way[i, 2], way[i, 2] - rules.ceiling)
        if over > 0.0:
            counts[3] += 1
            graded[3] += over
    if rules.room:
        tangents = turn_tangents(rules.aircraft, way)
        for i in range(1, last):
            need = tangents[i] + tangents[i + 1]
            run = math.hypot(way[i + 1, 0] - way[i, 0], way[i + 1, 1] - way[i, 1])
            short = need + settling_room(need, run) - run
            if need > 0.0 and short > 0.0:
                counts[0] += 1
                graded[0] += min(10.0, short / 100.0)
    for i in range(1, last):
        over = slope_excess(rules, way[i], way[i + 1])
        if over > 0.0:
            counts[1] += 1
            graded[1] += over


@compiled
def required_clearance(rules: Rules, east: float, north: float) -> float:  # pragma: no cover - compiled
    """Height above ground that a path needs here, m: the reserve grows from what the fixed ends leave of it."""
    keep = rules.reserve
    if rules.start_slack < keep:
        away = math.hypot(east - rules.start[0], north - rules.start[1])
        keep = min(keep, rules.start_slack + RESERVE_GROWTH * away)
    if rules.destination_slack < keep:
        away = math.hypot(east - rules.destination[0], north - rules.destination[1])
        keep = min(keep, rules.destination_slack + RESERVE_GROWTH * away)
    return rules.clearance + keep


@compiled
def _paper_point(
    units: Floats, east: float, north: float, up: float, ground: float, need: float, counts: Ints, objectives: Floats
) -> float:  # pragma: no cover - compiled
    """Judge one dividing point (eq. 5, 9, 10); return its height above ground, 0 if below."""
    if not up > ground + need:
        counts[2] += 1
    for k in range(units.shape[0]):
        d2 = (east - units[k, 0]) ** 2 + (north - units[k, 1]) ** 2 + (up - units[k, 2]) ** 2
        for column in (3, 5):
            # No missile, or no radar, is a radius of 0.
            if d2 <= units[k, column] ** 2 and units[k, column] > 0.0:
                objectives[column // 2] += units[k, column + 1] ** 4 / max(d2, CLOSEST * CLOSEST) ** 2
    return max(0.0, up - ground) if ground == ground else 0.0


@compiled
def paper_scores(rules: Rules, paths: Floats) -> tuple[Ints, Floats]:  # pragma: no cover - compiled
    """Judge paths (n, w, 3) on six points a leg and the destination: counts (n, 4), objectives (n, 4) (eq. 1-11).

    A waypoint is taken to the raster once; between waypoints a leg counts as straight in pixels.
    """
    number, count, _ = paths.shape
    counts = np.zeros((number, 4), dtype=np.int64)
    objectives = np.zeros((number, 4))
    unused = np.zeros(4)
    whole = min(rules.start_slack, rules.destination_slack) >= rules.reserve
    need = rules.clearance + rules.reserve
    units, heights = rules.threats, rules.heights
    shortest = straight(rules)
    for n in range(number):
        path = paths[n]
        constraints(rules, path, counts[n], unused)
        length = 0.0
        col1, row1 = polymap(rules.to_pixel, path[0, 0], path[0, 1])
        for i in range(count - 1):
            a, b = path[i], path[i + 1]
            col0, row0 = col1, row1
            col1, row1 = polymap(rules.to_pixel, b[0], b[1])
            length += math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
            # A departure: eq. 6 never reaches the destination, which is the seventh point of the last leg.
            for j in range(POINTS + (i == count - 2)):
                f = j / POINTS
                east, north, up = a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]), a[2] + f * (b[2] - a[2])
                ground = pixel_height(heights, col0 + f * (col1 - col0), row0 + f * (row1 - row0))
                if not whole:
                    need = required_clearance(rules, east, north)
                above = _paper_point(units, east, north, up, ground, need, counts[n], objectives[n])
                if j < POINTS:
                    objectives[n, 3] += above / POINTS
        objectives[n, 0] = length / shortest
    return counts, objectives


@compiled
def straight(rules: Rules) -> float:  # pragma: no cover - compiled
    """Straight distance from start to destination in three dimensions, m."""
    total = 0.0
    for k in range(3):
        total += (rules.destination[k] - rules.start[k]) ** 2
    return math.sqrt(total)


@compiled
def terrain_excess(rules: Rules, a: Floats, b: Floats) -> tuple[float, float]:  # pragma: no cover - compiled
    """Depth below the required clearance along a-b, summed over samples (m x km), and the mean height."""
    col0, row0 = polymap(rules.to_pixel, a[0], a[1])
    col1, row1 = polymap(rules.to_pixel, b[0], b[1])
    run = math.hypot(b[0] - a[0], b[1] - a[1])
    pieces = max(1, math.ceil(run / rules.pitch))
    depth = 0.0
    total = 0.0
    heights = rules.heights
    need = rules.clearance + rules.reserve
    whole = min(rules.start_slack, rules.destination_slack) >= rules.reserve
    up, rise, across, down = a[2], b[2] - a[2], col1 - col0, row1 - row0
    for k in range(pieces + 1):
        f = k / pieces
        ground = pixel_height(heights, col0 + f * across, row0 + f * down)
        if math.isnan(ground):
            depth += 1000.0
            continue
        above = up + f * rise - ground
        if not whole:
            need = required_clearance(rules, a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]))
        depth += max(0.0, need - above)
        total += max(0.0, above)
    return depth * max(run, 1.0) / pieces / 1000.0, total / (pieces + 1)


@compiled
def exposures(rules: Rules, a: Floats, b: Floats) -> tuple[float, float]:  # pragma: no cover - compiled
    """Mean over the segment a-b of the kill and detection densities; kill radii grow by the margin."""
    kill = 0.0
    seen = 0.0
    for k in range(rules.threats.shape[0]):
        unit = rules.threats[k]
        if unit[3] > 0.0:
            _, dose = segment_exposure(a, b, unit[:3], unit[3] + rules.kill_margin, unit[4])
            kill += dose
        if unit[5] > 0.0:
            _, dose = segment_exposure(a, b, unit[:3], unit[5], unit[6])
            seen += dose
    return kill, seen


@compiled
def graded_scores(rules: Rules, paths: Floats) -> tuple[Floats, Floats]:  # pragma: no cover - compiled
    """Graded violations (n, 4) and objectives (n, 4) of paths (n, w, 3), along legs and fly-by arcs.

    Exposures and height are means along the path times the paper's number of points, so that they compare with
    its sums.
    """
    number, count, _ = paths.shape
    graded = np.zeros((number, 4))
    objectives = np.zeros((number, 4))
    unused = np.zeros(4, dtype=np.int64)
    for n in range(number):
        path = paths[n]
        constraints(rules, path, unused, graded[n])
        radii = corner_radii(rules, path)
        length = 0.0
        for i in range(count - 1):
            length += _add_segment(rules, path[i], path[i + 1], graded[n], objectives[n])
        for i in range(1, count - 1):
            arc = corner(rules, path[i - 1], path[i], path[i + 1], radii[i])
            for k in range(max(1, arc.shape[0] - 1)):
                _add_arc(rules, arc[k], arc[min(k + 1, arc.shape[0] - 1)], graded[n], objectives[n])
        for column in (1, 2):
            objectives[n, column] *= POINTS * (count - 1) / length
        objectives[n, 3] *= (count - 1) / length
        objectives[n, 0] = length / straight(rules)
    return graded, objectives


@compiled
def _add_segment(
    rules: Rules, a: Floats, b: Floats, graded: Floats, objectives: Floats
) -> float:  # pragma: no cover - compiled
    length = math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
    depth, above = terrain_excess(rules, a, b)
    kill, seen = exposures(rules, a, b)
    graded[2] += depth
    objectives[1] += kill * length
    objectives[2] += seen * length
    objectives[3] += above * length
    return length


@compiled
def _add_arc(rules: Rules, a: Floats, b: Floats, graded: Floats, objectives: Floats) -> None:  # pragma: no cover
    depth, _ = terrain_excess(rules, a, b)
    graded[2] += depth
    length = math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
    for k in range(rules.threats.shape[0]):
        unit = rules.threats[k]
        if unit[3] > 0.0:
            near, _, _ = sphere_window(a, b, unit[:3], unit[3] + rules.kill_margin)
            if near <= unit[3] + rules.kill_margin:
                _, dose = segment_exposure(a, b, unit[:3], unit[3] + rules.kill_margin, unit[4])
                objectives[1] += dose * length
