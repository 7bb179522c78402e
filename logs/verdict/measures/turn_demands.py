"""What a route's turns take of their legs, and the sharpest turn that fits beside its neighbours."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import (
    Limits,
    PerformanceTable,
    downwind,
    fly_over_run,
    roll_reversal_length,
    turn_radius_between,
)
from flight.mission.route import Route
from logs.verdict.tolerances import U_TURN
from world.geometry import leg_courses, leg_runs, signed_turns, tangent_length

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TurnDemands:
    """A route's turns, for w waypoints.

    turns: (w,) rad, positive to the right, 0 at the ends.
    tightest: (w,) m, radius of the arc at the bank limit.
    radius: (w,) m, of the arc that is flown: the same, or a loiter's.
    before, after: (w,) m of leg that the turn uses on either side, inf for a U-turn.
    reversal: (w - 1,) m of leg that the roll from a turn into one the other way round uses.
    limit: (w,) rad, the sharpest turn there that fits both legs beside the neighbouring turns.
    """

    turns: Floats
    tightest: Floats
    radius: Floats
    before: Floats
    after: Floats
    reversal: Floats
    limit: Floats


def performance_tables(route: Route, limits: Limits) -> dict[float, PerformanceTable]:
    """The aircraft's performance at each airspeed of a route, m/s."""
    return {float(speed): limits.performance(float(speed)) for speed in route.airspeed}


def turn_demands(route: Route, tables: dict[float, PerformanceTable]) -> TurnDemands:
    """Work out what each turn takes, by the aircraft's performance at the route's airspeeds."""
    points = np.asarray(route.waypoints, dtype=np.float64)
    courses, runs, count = leg_courses(points), leg_runs(points), len(points)
    turns = np.zeros(count)
    if count > 2:
        turns[1:-1] = signed_turns(points)
    tightest, radius, before, after = (np.zeros(count) for _ in range(4))
    for i in range(1, count - 1):
        speed = float(max(route.airspeed[i - 1], route.airspeed[i]))
        tightest[i] = turn_radius_between(tables[speed], courses[i - 1], courses[i], points[i, 2])
        radius[i] = route.arcs[i] or tightest[i]
        before[i], after[i] = turn_lengths(abs(float(turns[i])), float(radius[i]), bool(route.fly_over[i]))
    reversal = _reversals(route, tables, courses, turns, radius, points[:, 2])
    limit = _sharpest_turns(route, runs, tightest, before, after, reversal)
    return TurnDemands(turns, tightest, radius, before, after, reversal, limit)


def turn_lengths(turn: float, radius: float, fly_over: bool) -> tuple[float, float]:
    """Length of leg (m) that a turn (rad) uses before and after its waypoint; a fly-over only after it."""
    if turn < 1e-9:
        return 0.0, 0.0
    if fly_over:
        return 0.0, radius * fly_over_run(turn)
    if turn > U_TURN:
        return math.inf, math.inf
    tangent = tangent_length(turn, radius)
    return tangent, tangent


def _reversals(
    route: Route, tables: dict[float, PerformanceTable], courses: Floats, turns: Floats, radius: Floats, up: Floats
) -> Floats:
    """Length of each leg that the roll from one bank into the other uses, (w - 1,) m; 0 between turns of one side."""
    out = np.zeros(len(courses))
    for leg in range(1, len(courses) - 1):
        flown_by = not route.fly_over[leg : leg + 2].any() and np.isfinite(radius[leg : leg + 2]).all()
        if turns[leg] * turns[leg + 1] < 0.0 and flown_by:
            table = tables[float(route.airspeed[leg])]
            ux, uy = math.sin(courses[leg]), math.cos(courses[leg])
            lower = float(min(up[leg], up[leg + 1]))
            out[leg] = roll_reversal_length(table, ux, uy, lower, radius[leg], radius[leg + 1], *downwind(table))
    return out


def available_lengths(runs: Floats, before: Floats, after: Floats, reversal: Floats, i: int) -> tuple[float, float]:
    """Lengths (m) of the legs before and after waypoint i that its turn may use.

    Of a leg too short for its two turns the one that takes more than half of it is at fault, or both are: half of each
    leg is left to a turn in any case.
    """
    return (
        max(runs[i - 1] - after[i - 1], 0.5 * runs[i - 1]) - reversal[i - 1],
        max(runs[i] - before[i + 1], 0.5 * runs[i]) - reversal[i],
    )


def _sharpest_turns(
    route: Route, runs: Floats, tightest: Floats, before: Floats, after: Floats, reversal: Floats
) -> Floats:
    """Sharpest turn at each waypoint that fits its legs beside the neighbouring turns, (w,) rad."""
    out = np.full(len(tightest), math.pi)
    for i in range(1, len(tightest) - 1):
        if not math.isfinite(tightest[i]):
            out[i] = 0.0
            continue
        behind, ahead = available_lengths(runs, before, after, reversal, i)
        if route.fly_over[i]:
            out[i] = _sharpest_fly_over(ahead / tightest[i])
        else:
            out[i] = 2.0 * math.atan(min(behind, ahead) / tightest[i])
    return out


def _sharpest_fly_over(radii: float) -> float:
    """Sharpest fly-over turn (rad) that needs at most this many radii of leg, by bisection."""
    low, high = 0.0, math.pi
    if fly_over_run(high) <= radii:
        return high
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fly_over_run(middle) <= radii else (low, middle)
    return low
