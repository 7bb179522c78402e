"""The continuous check of a finished path: every leg and every fly-by arc, not six points a leg."""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import arc_slope, turn_tangents
from planner.evaluation.clearance_reserve import RESERVE_GROWTH
from planner.evaluation.fly_by_corners import corner, corner_radii
from planner.evaluation.leg_constraints import (
    CERTIFIED_LEG,
    make_gauge,
    measure_corners,
    measure_legs,
    roll_need,
    settling_room,
    slope_limits,
    turn_need,
)
from planner.evaluation.problem import SPARE, Problem
from planner.evaluation.problem_arrays import Rules
from planner.plan import Certificate
from world.geometry import leg_runs, leg_slopes, turning_angles
from world.kernels import compiled
from world.terrain import segment_clearance

Floats = NDArray[np.float64]

# Rounding of a waypoint on a limit, rad and m.
_EPSILON = 1e-9


def certify(problem: Problem, waypoints: Floats) -> Certificate:
    """Check a path (w, 3) exactly: turns, room for turns, slopes, clearance, map and missiles.

    Clearance is exact for the bilinear terrain on the legs, and on the chords of the arcs that a fly-by turn
    cuts at each corner; the distance to missiles is that of the same pieces to the spheres.
    """
    rules = problem.certified
    problems: list[str] = []
    turn, room = _turns(rules, waypoints, problems)
    slope = _slopes(rules, waypoints, problems)
    clearance = _clearance(rules, waypoints, problems)
    bounds = _bounds(rules, waypoints, problems)
    return Certificate(turn, room, slope, clearance, bounds, kill_distance(rules, waypoints), tuple(problems))


def kill_distance(rules: Rules, waypoints: Floats) -> float:
    """Distance from the path to the surface of the nearest missile sphere, m: negative inside, inf without any."""
    return float(_kill_distance(rules, np.ascontiguousarray(waypoints)))


@compiled
def _kill_distance(rules: Rules, waypoints: Floats) -> float:  # pragma: no cover - compiled
    nearest = math.inf
    last = waypoints.shape[0] - 1
    for i in range(last):
        nearest = min(nearest, _segment_distance(rules.threats, waypoints[i], waypoints[i + 1], nearest))
    radii = corner_radii(rules, waypoints)
    for i in range(1, last):
        arc = corner(rules, waypoints[i - 1], waypoints[i], waypoints[i + 1], radii[i])
        for k in range(max(1, arc.shape[0] - 1)):
            nearest = _segment_distance(rules.threats, arc[k], arc[min(k + 1, arc.shape[0] - 1)], nearest)
    return nearest


@compiled
def _segment_distance(threats: Floats, a: Floats, b: Floats, nearest: float) -> float:  # pragma: no cover - compiled
    """Distance from a-b to the nearest missile sphere's surface, or `nearest` if that is less."""
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    length2 = dx * dx + dy * dy + dz * dz
    for k in range(threats.shape[0]):
        if threats[k, 3] <= 0.0:
            continue
        x, y, z = a[0] - threats[k, 0], a[1] - threats[k, 1], a[2] - threats[k, 2]
        along = dx * x + dy * y + dz * z
        f = min(1.0, max(0.0, -along / length2)) if length2 > 0.0 else 0.0
        # From the point itself: differences of squares lose digits.
        x, y, z = x + f * dx, y + f * dy, z + f * dz
        nearest = min(nearest, math.sqrt(x * x + y * y + z * z) - threats[k, 3])
    return nearest


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


def _turns(rules: Rules, waypoints: Floats, problems: list[str]) -> tuple[float, float]:
    way = extended(rules, waypoints)
    allowed = rules.max_turn if rules.room else rules.max_turn + SPARE
    margins = allowed - turning_angles(way)
    spare = 0.0 if rules.room else SPARE
    for i, margin in enumerate(margins):
        if margin < spare - _EPSILON:
            turned, most = math.degrees(allowed - margin), math.degrees(allowed - spare)
            problems.append(f"waypoint {i}: turns {turned:.1f} deg, allowed {most:.1f} deg")
    room = math.inf
    for i, run in enumerate(leg_runs(waypoints)):
        if run < CERTIFIED_LEG:
            problems.append(f"leg {i}: {run:.1f} m long, at least {CERTIFIED_LEG:g} m are wanted")
    if rules.room:
        for i, (run, need, roll) in enumerate(zip(leg_runs(waypoints), *turn_needs(rules, waypoints), strict=True)):
            if need == 0.0:
                continue
            room = min(room, float(run - need - roll))
            settle = settling_room(float(need), float(run)) + roll
            if need + settle > run + _EPSILON:
                problems.append(f"leg {i}: {run:.0f} m long, its turns need {need:.0f} m and {settle:.0f} m to settle")
    return float(margins.min(initial=math.inf)), room


@compiled
def turn_needs(rules: Rules, waypoints: Floats) -> tuple[Floats, Floats]:  # pragma: no cover - compiled
    """Length of each leg (w - 1,) that its turns use, and that the roll from one to the other uses, m."""
    count = waypoints.shape[0]
    legs, corners = np.empty((count - 1, 4)), np.zeros((count, 2))
    needs, rolls = np.zeros(count - 1), np.zeros(count - 1)
    gauge, paths = make_gauge(rules), waypoints.copy().reshape((1, count, 3))
    measure_legs(paths, 0, legs)
    measure_corners(rules, gauge, paths, 0, legs, corners)
    for i in range(count - 1):
        needs[i] = turn_need(rules, legs, corners, i)
        if not rules.fly_over:
            up = min(waypoints[i, 2], waypoints[i + 1, 2])
            rolls[i] = roll_need(rules.aircraft, legs, corners, i, up, gauge.wind_east, gauge.wind_north)
    return needs, rolls


def _arc_slopes(rules: Rules, waypoints: Floats, problems: list[str]) -> float:
    """Slopes along the arcs, which are shorter than the legs that they replace; the least margin, rad."""
    least = math.inf
    if not rules.room or rules.fly_over or not (math.isnan(rules.climb) or math.isnan(rules.dive)):
        return least
    radii, tangents = corner_radii(rules, waypoints), turn_tangents(rules.aircraft, waypoints)
    rises = np.tan(leg_slopes(waypoints))
    for i in range(1, len(waypoints) - 1):
        if tangents[i] <= 0.0 or radii[i] <= 0.0:
            continue
        slope = math.atan(arc_slope(rises[i - 1], rises[i], tangents[i], radii[i]))
        flat = np.array([0.0, 0.0, waypoints[i, 2]])
        for before, after in ((i - 1, i), (i, i + 1)):
            step = np.append((waypoints[after] - waypoints[before])[:2], waypoints[i, 2])
            climb, dive = slope_limits(rules, flat, step)
            inside = min(climb - slope, dive + slope)
            least = min(least, inside + rules.spare)
            if inside < -_EPSILON:
                word, limit = ("climbs", climb) if slope > 0 else ("sinks", dive)
                steep, most = math.degrees(abs(slope)), math.degrees(limit)
                problems.append(f"turn at waypoint {i}: {word} {steep:.1f} deg along its arc, allowed {most:.1f} deg")
                break
    return least


def _slopes(rules: Rules, waypoints: Floats, problems: list[str]) -> float:
    least = _arc_slopes(rules, waypoints, problems)
    for i, (slope, (climb, dive)) in enumerate(zip(leg_slopes(waypoints), _leg_limits(rules, waypoints), strict=True)):
        inside = min(climb - slope, dive + slope)
        least = min(least, inside + rules.spare)
        if inside < -_EPSILON:
            word, limit = ("climbs", climb) if slope > 0 else ("sinks", dive)
            steep, most = math.degrees(abs(slope)), math.degrees(limit)
            problems.append(f"leg {i}: {word} {steep:.1f} deg, allowed {most:.1f} deg")
    return float(least)


@compiled
def _leg_limits(rules: Rules, waypoints: Floats) -> Floats:  # pragma: no cover - compiled
    """Steepest climb and dive (w - 1, 2) of each leg, rad."""
    out = np.empty((waypoints.shape[0] - 1, 2))
    for i in range(out.shape[0]):
        out[i, 0], out[i, 1] = slope_limits(rules, waypoints[i], waypoints[i + 1])
    return out


def _clearance(rules: Rules, waypoints: Floats, problems: list[str]) -> float:
    least = math.inf
    low: dict[str, float] = {}
    for turn, place, height, reserve in _heights(rules, waypoints):
        if height - rules.clearance >= reserve - _EPSILON:
            least = min(least, height - rules.clearance) if not math.isnan(least) else least
            continue
        name = f"turn at waypoint {place:.0f}" if turn else f"leg {place:.0f}"
        if math.isnan(height):
            low[name] = least = math.nan
            continue
        margin = float(height) - rules.clearance
        least = min(least, margin) if not math.isnan(least) else least
        if not low.get(name, math.inf) <= margin:
            low[name] = margin
    for name, margin in low.items():
        if math.isnan(margin):
            problems.append(f"{name}: leaves the terrain that is known")
        else:
            wanted = f"{rules.clearance:g} m and {rules.reserve:g} m in reserve wanted"
            problems.append(f"{name}: {margin + rules.clearance:.1f} m above ground at its lowest, {wanted}")
    return float(least)


@compiled
def _heights(rules: Rules, waypoints: Floats) -> Floats:  # pragma: no cover - compiled
    """Segments of the path and then of its fly-by arcs, one a row.

    Columns: 1 for an arc's; number of the leg or waypoint; least height above ground, NaN off the terrain; reserve
    wanted.
    """
    last = waypoints.shape[0] - 1
    radii = corner_radii(rules, waypoints)
    out = np.empty((last, 4))
    for i in range(last):
        _height(rules, waypoints[i], waypoints[i + 1], 0.0, i, out[i])
    for i in range(1, last):
        arc = corner(rules, waypoints[i - 1], waypoints[i], waypoints[i + 1], radii[i])
        rows = np.empty((max(1, arc.shape[0] - 1), 4))
        for k in range(rows.shape[0]):
            _height(rules, arc[k], arc[min(k + 1, arc.shape[0] - 1)], 1.0, i, rows[k])
        out = np.concatenate((out, rows))
    return out


@compiled
def _height(rules: Rules, a: Floats, b: Floats, turn: float, place: int, out: Floats) -> None:  # pragma: no cover
    out[0], out[1] = turn, place
    out[2], _ = segment_clearance(rules.heights, rules.to_pixel, a, b)
    out[3] = _reserve(rules, a, b)


@compiled
def _reserve(rules: Rules, a: Floats, b: Floats) -> float:  # pragma: no cover - compiled
    """Reserve wanted on a piece: fixed ends may have less, and it grows from where the piece is nearest to them.

    It grows half as fast as a search asks, for what lies between the search's samples.
    """
    reserve = rules.reserve
    for end, slack in ((rules.start, rules.start_slack), (rules.destination, rules.destination_slack)):
        if slack < reserve:
            dx, dy, x, y = b[0] - a[0], b[1] - a[1], a[0] - end[0], a[1] - end[1]
            run2 = dx * dx + dy * dy
            f = min(1.0, max(0.0, -(dx * x + dy * y) / run2)) if run2 > 0.0 else 0.0
            away = math.sqrt((x + f * dx) ** 2 + (y + f * dy) ** 2)
            reserve = min(reserve, slack + 0.5 * RESERVE_GROWTH * away)
    return reserve


def _bounds(rules: Rules, waypoints: Floats, problems: list[str]) -> float:
    low = np.array([rules.bounds[0, 0], rules.bounds[1, 0], rules.floor])
    high = np.array([rules.bounds[0, 1], rules.bounds[1, 1], rules.ceiling])
    margins = np.minimum(waypoints - low, high - waypoints).min(axis=1)
    problems.extend(
        f"waypoint {i}: {-margins[i]:.1f} m outside the area, floor or ceiling"
        for i in np.nonzero(margins < -_EPSILON)[0]
    )
    return float(margins.min())
