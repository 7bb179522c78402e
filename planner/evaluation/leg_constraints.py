"""What every judge asks of waypoints and legs: turns and room for them, slopes, and the map."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import (
    PerformanceTable,
    arc_slope,
    corner_tangent,
    downwind,
    fly_over_run,
    roll_reversal_length,
    slopes_along,
    wind_speed_at,
)
from planner.evaluation.clearance_reserve import pack_clearance
from planner.evaluation.problem_arrays import Rules
from world.kernels import compiled, compiled_views, inlined

Floats = NDArray[np.float64]

# Leg left over between its two turns: this share of the leg, and this length (m) or what small turns use of it.
ROOM_SHARE = 0.05
ROOM_LENGTH = 20.0
# No roll from one turn into the next takes more, m: at 60 degrees of bank and 90 m/s over the ground.
MOST_ROLL = 50.0
# Shortest leg that a graded judge and the certificate let pass, m.
LEAST_LEG, CERTIFIED_LEG = 10.0, 5.0


class Gauge(NamedTuple):
    """What is worked out once for many paths.

    cos_turn: of the largest turn.  wind_east, wind_north: unit vector downwind.  climb, dive: tangents that no leg may
    exceed, or, where the aircraft limits them, that every leg may use.  straight: m from start to destination.
    clear: of `planner.evaluation.clearance_reserve.pack_clearance`.
    """

    cos_turn: float
    wind_east: float
    wind_north: float
    climb: float
    dive: float
    by_aircraft: bool
    straight: float
    clear: Floats


@compiled
def make_gauge(rules: Rules) -> Gauge:  # pragma: no cover - compiled
    """Work out what holds for all paths under these rules."""
    east, north = downwind(rules.aircraft)
    climb, dive = rules.climb, rules.dive
    by_aircraft = math.isnan(climb) or math.isnan(dive)
    if math.isnan(climb):
        climb = _least_slope(rules, rules.aircraft.climb)
    if math.isnan(dive):
        dive = _least_slope(rules, rules.aircraft.descent)
    return Gauge(
        # A turn cannot exceed half a circle, whatever rounding says.
        math.cos(rules.max_turn) if rules.max_turn < math.pi else -2.0,
        east,
        north,
        math.tan(climb - rules.spare),
        math.tan(dive - rules.spare),
        by_aircraft,
        straight(rules),
        pack_clearance(rules),
    )


@compiled_views
def _least_slope(rules: Rules, angles: Floats) -> float:  # pragma: no cover - compiled
    """Slope (rad) that the aircraft can do on any course between floor and ceiling; -1 for none.

    angles: of the aircraft's table, to climb or to sink.  Least with the strongest wind behind.
    """
    table = rules.aircraft
    wind = max(wind_speed_at(table, rules.floor), wind_speed_at(table, rules.ceiling))
    angle = math.inf
    for k in range(angles.size):
        angle = min(angle, angles[k])
    if not angle > 0.0 or wind >= 0.99 * table.airspeed * math.cos(angle):
        return -1.0
    return math.atan2(table.airspeed * math.sin(angle), table.airspeed * math.cos(angle) + wind)


@compiled_views
def _leg_limits(
    rules: Rules, ux: float, uy: float, low: float, high: float, wx: float, wy: float
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Steepest climb and dive, rad, on the unit course u from one height to another; w: downwind."""
    climb, dive = rules.climb, rules.dive
    if math.isnan(climb) or math.isnan(dive):
        up, down = math.inf, math.inf
        for part in (0.0, 0.5, 1.0):
            one, two = slopes_along(rules.aircraft, ux * wx + uy * wy, ux * wy - uy * wx, low + part * (high - low))
            up, down = min(up, one), min(down, two)
        if math.isnan(climb):
            climb = up
        if math.isnan(dive):
            dive = down
    return climb - rules.spare, dive - rules.spare


@compiled_views
def slope_limits(rules: Rules, a: Floats, b: Floats) -> tuple[float, float]:  # pragma: no cover - compiled
    """Steepest climb and dive of the leg a-b, rad: the tightest at its ends and its middle height, spare taken off."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    run = math.sqrt(dx * dx + dy * dy)
    wx, wy = downwind(rules.aircraft)
    ux, uy = (dx / run, dy / run) if run > 0.0 else (0.0, 1.0)
    return _leg_limits(rules, ux, uy, a[2], b[2], wx, wy)


@compiled_views
def slope_excess(
    rules: Rules, gauge: Gauge, ux: float, uy: float, run: float, low: float, high: float
) -> float:  # pragma: no cover - compiled
    """How far a leg is too steep, as m of height per m of run; 0 where it is not (eq. 3-4).

    u: its unit course.  run: m.  low, high: heights of its ends.
    """
    rise = high - low
    over = max(0.0, rise - gauge.climb * run, -rise - gauge.dive * run)
    if gauge.by_aircraft and (over > 0.0 or min(low, high) < rules.floor or max(low, high) > rules.ceiling):
        climb, dive = _leg_limits(rules, ux, uy, low, high, gauge.wind_east, gauge.wind_north)
        over = max(0.0, rise - math.tan(climb) * run, -rise - math.tan(dive) * run)
    return over / max(run, 1.0)


@inlined
def settling_room(need: float, run: float) -> float:  # pragma: no cover - compiled
    """Length of a leg (m) that stays straight between its turns, so that the first has settled; need: what they use."""
    return ROOM_SHARE * run + min(ROOM_LENGTH, need)


@compiled_views
def measure_legs(paths: Floats, n: int, legs: Floats) -> None:  # pragma: no cover - compiled
    """Fill legs (w - 1, 4) of path n: unit course (east, north; 0 for none), run and length, m."""
    for i in range(legs.shape[0]):
        dx, dy = paths[n, i + 1, 0] - paths[n, i, 0], paths[n, i + 1, 1] - paths[n, i, 1]
        dz = paths[n, i + 1, 2] - paths[n, i, 2]
        run = math.sqrt(dx * dx + dy * dy)
        legs[i, 0] = dx / run if run > 0.0 else 0.0
        legs[i, 1] = dy / run if run > 0.0 else 0.0
        legs[i, 2] = run
        legs[i, 3] = math.sqrt(dx * dx + dy * dy + dz * dz)


@compiled_views
def measure_corners(
    rules: Rules, gauge: Gauge, paths: Floats, n: int, legs: Floats, corners: Floats
) -> None:  # pragma: no cover - compiled
    """Fill corners (w, 2) of path n: length of leg that its arc takes on either side and the arc's radius, m."""
    table, wx, wy = rules.aircraft, gauge.wind_east, gauge.wind_north
    last = legs.shape[0]
    for i in range(1, last):
        ux, uy, vx, vy = legs[i - 1, 0], legs[i - 1, 1], legs[i, 0], legs[i, 1]
        corners[i, 0], corners[i, 1] = 0.0, 0.0
        if (ux != 0.0 or uy != 0.0) and (vx != 0.0 or vy != 0.0):
            corners[i, 0], corners[i, 1] = corner_tangent(table, ux, uy, vx, vy, paths[n, i, 2], wx, wy)
    for i, asked in ((0, rules.start_course), (last, rules.destination_course)):
        corners[i, 0], corners[i, 1] = 0.0, 0.0
        if not math.isnan(asked) and legs[min(i, last - 1), 2] > 0.0:
            ux, uy, vx, vy = _courses(rules, legs, i)
            corners[i, 0], corners[i, 1] = corner_tangent(table, ux, uy, vx, vy, paths[n, i, 2], wx, wy)


@compiled_views
def _courses(rules: Rules, legs: Floats, i: int) -> tuple[float, float, float, float]:  # pragma: no cover - compiled
    """Unit courses before and after waypoint i; at the ends those asked for, else the leg's own."""
    last = legs.shape[0]
    after, before = min(i, last - 1), max(i - 1, 0)
    ux, uy, vx, vy = legs[before, 0], legs[before, 1], legs[after, 0], legs[after, 1]
    if i == 0 and not math.isnan(rules.start_course):
        ux, uy = math.sin(rules.start_course), math.cos(rules.start_course)
    if i == last and not math.isnan(rules.destination_course):
        vx, vy = math.sin(rules.destination_course), math.cos(rules.destination_course)
    return ux, uy, vx, vy


@inlined
def _over_turn(
    cosine: float, largest: float, ux: float, uy: float, vx: float, vy: float
) -> float:  # pragma: no cover - compiled
    """How far the turn between two unit courses exceeds the largest, rad; 0 where it does not (eq. 1-2)."""
    dot = ux * vx + uy * vy
    if dot >= cosine or (ux == 0.0 and uy == 0.0) or (vx == 0.0 and vy == 0.0):
        return 0.0
    # A hair above zero, so that what is over is counted.
    return max(1e-12, math.atan2(abs(ux * vy - uy * vx), dot) - largest)


@compiled_views
def constraints(
    rules: Rules, gauge: Gauge, paths: Floats, n: int, legs: Floats, corners: Floats, graded: bool, missed: Floats
) -> None:  # pragma: no cover - compiled
    """Add the turn, slope and bounds violations of path n to missed (N, 4): counts, or how far each is missed.

    Turn also takes, where room is asked for, each leg that is shorter than its two turns (eq. 1-4, 7).
    legs, corners: measured.
    """
    last = legs.shape[0]
    for i in range(1, last):
        over = _over_turn(gauge.cos_turn, rules.max_turn, legs[i - 1, 0], legs[i - 1, 1], legs[i, 0], legs[i, 1])
        missed[n, 0] += _weight(over, graded)
    for i, asked in ((0, rules.start_course), (last, rules.destination_course)):
        if not math.isnan(asked):
            ux, uy, vx, vy = _courses(rules, legs, i)
            missed[n, 0] += _weight(_over_turn(gauge.cos_turn, rules.max_turn, ux, uy, vx, vy), graded)
    west, east, south, north = rules.bounds[0, 0], rules.bounds[0, 1], rules.bounds[1, 0], rules.bounds[1, 1]
    floor, ceiling = rules.floor, rules.ceiling
    for i in range(last + 1):
        x, y, z = paths[n, i, 0], paths[n, i, 1], paths[n, i, 2]
        missed[n, 3] += _weight(max(0.0, west - x, x - east, south - y, y - north, floor - z, z - ceiling), graded)
    if rules.room:
        for i in range(last):
            need, run = turn_need(rules, legs, corners, i), legs[i, 2]
            short = need + settling_room(need, run) - run if need > 0.0 else 0.0
            if short > -MOST_ROLL and not rules.fly_over:
                up = min(paths[n, i, 2], paths[n, i + 1, 2])
                short += roll_need(rules.aircraft, legs, corners, i, up, gauge.wind_east, gauge.wind_north)
            missed[n, 0] += _weight(min(10.0, max(0.0, short / 100.0)), graded)
    for i in range(last):
        # Two waypoints in one place have no course between them, and would make two sharp turns none.
        missed[n, 0] += max(0.0, LEAST_LEG - legs[i, 2]) / 100.0 if graded else 0.0
        rise, run = paths[n, i + 1, 2] - paths[n, i, 2], legs[i, 2]
        over = max(0.0, rise - gauge.climb * run, -rise - gauge.dive * run) / max(run, 1.0)
        if gauge.by_aircraft:
            over = slope_excess(rules, gauge, legs[i, 0], legs[i, 1], run, paths[n, i, 2], paths[n, i + 1, 2])
        missed[n, 1] += _weight(over, graded)
    if gauge.by_aircraft and rules.room and not rules.fly_over:
        _steep_arcs(rules, gauge, paths, n, legs, corners, graded, missed)


@compiled_views
def _steep_arcs(
    rules: Rules, gauge: Gauge, paths: Floats, n: int, legs: Floats, corners: Floats, graded: bool, missed: Floats
) -> None:  # pragma: no cover - compiled
    """Add the arcs of path n that are too steep for the aircraft to missed (N, 4)."""
    for i in range(1, legs.shape[0]):
        missed[n, 1] += _weight(_arc_excess(rules, gauge, paths, n, i, legs, corners), graded)


@compiled_views
def turn_need(rules: Rules, legs: Floats, corners: Floats, i: int) -> float:  # pragma: no cover - compiled
    """Length of leg i that its two turns use, m: of a fly-over only the one at its beginning, on the way back to it."""
    if not rules.fly_over:
        need: float = corners[i, 0] + corners[i + 1, 0]
        return need
    if corners[i, 0] <= 0.0:
        return 0.0
    if math.isinf(corners[i, 0]):
        return math.inf
    run: float = corners[i, 1] * fly_over_run(2.0 * math.atan(corners[i, 0] / corners[i, 1]))
    return run


@compiled
def roll_need(
    table: PerformanceTable, legs: Floats, corners: Floats, i: int, amsl: float, wx: float, wy: float
) -> float:  # pragma: no cover - compiled
    """Length of leg i that the roll from its first fly-by turn into its second uses, m; 0 for turns of one side.

    table: of the aircraft.  w: downwind.
    """
    if i == 0 or i == legs.shape[0] - 1 or corners[i, 0] <= 0.0 or corners[i + 1, 0] <= 0.0:
        return 0.0
    ux, uy = legs[i, 0], legs[i, 1]
    into, onward = legs[i - 1, 0] * uy - legs[i - 1, 1] * ux, ux * legs[i + 1, 1] - uy * legs[i + 1, 0]
    if into * onward >= 0.0 or math.isinf(corners[i, 0] + corners[i + 1, 0]):
        return 0.0
    room: float = roll_reversal_length(table, ux, uy, amsl, corners[i, 1], corners[i + 1, 1], wx, wy)
    return room


@compiled_views
def _arc_excess(
    rules: Rules, gauge: Gauge, paths: Floats, n: int, i: int, legs: Floats, corners: Floats
) -> float:  # pragma: no cover - compiled
    """How far the arc at waypoint i is steeper than the aircraft can fly on either course, m per m."""
    rise_in = (paths[n, i, 2] - paths[n, i - 1, 2]) / max(legs[i - 1, 2], 1.0)
    rise_out = (paths[n, i + 1, 2] - paths[n, i, 2]) / max(legs[i, 2], 1.0)
    slope = arc_slope(rise_in, rise_out, corners[i, 0], corners[i, 1])
    if -gauge.dive <= slope <= gauge.climb:
        return 0.0
    over = 0.0
    for leg in (i - 1, i):
        climb, dive = _leg_limits(
            rules, legs[leg, 0], legs[leg, 1], paths[n, i, 2], paths[n, i, 2], gauge.wind_east, gauge.wind_north
        )
        over = max(over, slope - math.tan(climb), -slope - math.tan(dive))
    return over


@inlined
def _weight(over: float, graded: bool) -> float:  # pragma: no cover - compiled
    """What a constraint missed by `over` adds: that, or one."""
    if graded:
        return over
    return 1.0 if over > 0.0 else 0.0


@compiled
def straight(rules: Rules) -> float:  # pragma: no cover - compiled
    """Straight distance from start to destination in three dimensions, m."""
    total = 0.0
    for k in range(3):
        total += (rules.destination[k] - rules.start[k]) ** 2
    return math.sqrt(total)
