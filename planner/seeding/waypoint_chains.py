"""Find the best path through each of many candidate waypoints, by dynamic programming over legs.

A path's length and most of its violations are sums over its legs, so the best of all combinations of candidates, one
per interval, is found without enumerating them: forward from the start and backward from the destination, as messages
along a chain (Pearl, "Probabilistic Reasoning in Intelligent Systems", 1988, section 4.3: max-product on a chain).
Turns depend on two legs; each is priced on the best partial path so far, which is an approximation.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from planner.evaluation.corners import CORNER, measure_corner
from planner.evaluation.leg_constraints import PrecomputedLimits, precompute_limits
from planner.evaluation.problem import ProblemArrays, clearance_at, required_clearance
from planner.evaluation.threat_index import kill_density
from planner.seeding.waypoint_fitting import COST_ROUNDING_M, penalised_leg_cost
from world.arrays import Flags, Floats, Ints
from world.frames import polymap
from world.kernels import Records, compiled, inlined, inner
from world.terrain import pixel_height

# Cost, in m of path, per rad above the turn limit, or per 100 m by which a leg is too short for its turn.
TURN_COST = 2e4
# Fraction of a leg that each of its two turns may take.
TURN_LENGTH_FRACTION = 0.475
# Legs evaluated between two calls of `check_stop`: at most some 20 ms on a slow processor.
LEGS_PER_CHECK = 2_500
# Larger than any number of legs.
ALL_LEGS = 2**62
# Progress: direction, next waypoint and candidate, and number of legs evaluated.
_CURSOR = np.dtype([(name, np.int64) for name in ("step", "waypoint", "candidate", "legs")])


class _Sweeps(NamedTuple):
    """Best partial paths to each of k candidates of w waypoints: from the start, and from the destination.

    forward: (w, k) cost of the best path from the start to each candidate, m; inf if none is known.
    before: (w, k) previous candidate on this path.
    backward: (w, k) cost of the best path from each candidate to the destination, m.
    after: (w, k) next candidate on this path.
    """

    forward: Floats
    before: Ints
    backward: Floats
    after: Ints


class WaypointChains(NamedTuple):
    """Best path through each of k candidates of w waypoints.

    cost: (w, k) cost of the best path through each candidate, in m of path; inf if none is within the bound.
    before, after: (w, k) previous and next candidate on that path.
    legs: number of legs evaluated.
    """

    cost: Floats
    before: Ints
    after: Ints
    legs: int

    def path_through(self, waypoint: int, candidate: int) -> Ints:
        """Return the indices of the candidates on the best path through a given candidate, (w,)."""
        out = np.empty(len(self.cost), dtype=np.int64)
        out[waypoint] = candidate
        for i in range(waypoint, 0, -1):
            out[i - 1] = self.before[i, out[i]]
        for i in range(waypoint, len(self.cost) - 1):
            out[i + 1] = self.after[i, out[i]]
        return out


def waypoint_chains(
    data: ProblemArrays,
    candidates: Floats,
    bound: float,
    check_stop: Callable[[], None] = lambda: None,
    max_legs: int = ALL_LEGS,
) -> WaypointChains:
    """Find the best path through each candidate position of each waypoint.

    candidates: (w, k, 3) m; only the first candidate of each end is used.
    bound: upper limit on the cost of a path, m; paths above it are dropped, which saves time.
    check_stop: called after every `LEGS_PER_CHECK` legs; an exception raised there stops the work.
    max_legs: maximum number of legs to evaluate; if it is not sufficient, all costs are inf.
    """
    count, width, _ = candidates.shape
    legs = np.zeros((count - 1, width, width))
    forward, backward = np.full((count, width), np.inf), np.full((count, width), np.inf)
    forward[0, 0], backward[-1, 0] = 0.0, 0.0
    before, after = np.zeros((count, width), dtype=np.int64), np.zeros((count, width), dtype=np.int64)
    sweeps, cursor = _Sweeps(forward, before, backward, after), np.zeros(1, dtype=_CURSOR)
    cursor["step"], cursor["waypoint"] = 1, 1
    evaluated_legs = 0
    while not _advance_sweeps(
        data, candidates, legs, bound, sweeps, cursor, min(LEGS_PER_CHECK, max_legs - evaluated_legs)
    ):
        check_stop()
        evaluated_legs = int(cursor["legs"][0])
        if evaluated_legs >= max_legs:
            return WaypointChains(np.full((count, width), np.inf), before, after, evaluated_legs)
    return WaypointChains(_costs_through(data, candidates, bound, sweeps), before, after, int(cursor["legs"][0]))


@compiled
def _advance_sweeps(
    data: ProblemArrays, candidates: Floats, legs: Floats, bound: float, sweeps: _Sweeps, cursor: Records, max_legs: int
) -> bool:
    """Continue both sweeps until `max_legs` legs are evaluated; return True if both are complete.

    The forward sweep extends partial paths from the start, waypoint by waypoint. Then the backward sweep extends
    partial paths from the destination.

    candidates: (w, k, 3) m.
    legs: (w - 1, k, k) costs of legs: [i, j, m] is the leg from candidate j of waypoint i to candidate m of the next.
        They are filled when needed: 0 is unknown, and a negative number -x means that the cost is at least x.
    bound: upper limit on the cost of a path, m.
    sweeps: costs and neighbours of the partial paths; updated.
    cursor: a `_CURSOR` record (1,), at which the sweeps continue.
    """
    count, width, _ = candidates.shape
    limits, corners = precompute_limits(data), np.zeros(1, dtype=CORNER)
    position, lower_bounds = cursor[0], np.empty(width)
    previous_legs = position.legs
    while position.waypoint >= 0:
        waypoint, step = position.waypoint, position.step
        cost, link = (sweeps.forward, sweeps.before) if step > 0 else (sweeps.backward, sweeps.after)
        open_ends = np.flatnonzero(cost[waypoint - step] < np.inf)
        while position.candidate < (width if 0 < waypoint < count - 1 else 1):
            if position.legs - previous_legs >= max_legs:
                return False
            candidate = position.candidate
            # Lower bound on the cost of the rest of a path through this candidate.
            remaining_cost = (
                _distance(candidates[waypoint, candidate], candidates[-1][0])
                if step > 0
                else sweeps.forward[waypoint, candidate]
            )
            position.legs += _extend_paths(
                data,
                limits,
                candidates,
                waypoint,
                candidate,
                step,
                cost,
                link,
                bound - remaining_cost,
                legs,
                open_ends,
                lower_bounds,
                corners,
            )
            position.candidate += 1
        position.candidate = 0
        position.waypoint += step
        if position.waypoint == count:
            position.waypoint, position.step = count - 2, -1
    return True


@compiled
def _costs_through(data: ProblemArrays, candidates: Floats, bound: float, sweeps: _Sweeps) -> Floats:
    """Return the cost of the best path through each candidate, (w, k); inf above the bound.

    The cost includes the turn at the candidate.

    candidates: (w, k, 3) k candidates of each waypoint, m.
    bound: upper limit on the cost of a path, m.
    sweeps: costs of the best paths to and from each candidate, and the candidates before and after it on these paths.
    """
    limits, corners = precompute_limits(data), np.zeros(1, dtype=CORNER)
    cost = sweeps.forward + sweeps.backward
    for i in range(1, candidates.shape[0] - 1):
        for k in range(candidates.shape[1]):
            if cost[i, k] < np.inf:
                previous_waypoint = candidates[i - 1, sweeps.before[i, k]]
                next_waypoint = candidates[i + 1, sweeps.after[i, k]]
                cost[i, k] += _corner_cost(data, limits, previous_waypoint, candidates[i, k], next_waypoint, corners)
                cost[i, k] = cost[i, k] if cost[i, k] <= bound else np.inf
    return cost


@inner
def _extend_paths(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    candidates: Floats,
    i: int,
    k: int,
    step: int,
    cost: Floats,
    link: Ints,
    max_cost: float,
    legs: Floats,
    open_ends: Ints,
    lower_bounds: Floats,
    corners: Records,
) -> int:
    """Find the cheapest partial path to candidate k of waypoint i; return the number of legs evaluated.

    step: 1 for paths from the start, -1 for paths from the destination. candidates: (w, k, 3) m.
    cost, link: (w, k) cost and neighbouring candidate of each partial path; updated for the candidate.
    max_cost: upper limit on the cost of a partial path. legs: costs of legs, as in `_advance_sweeps`; updated.
    open_ends: candidates of the previous waypoint with a partial path. lower_bounds, corners: working memory.
    """
    previous, evaluated_count, point = i - step, 0, candidates[i, k]
    if not max_cost > 0.0 or open_ends.size == 0:
        return 0
    for m in range(open_ends.size):
        # A leg costs at least its length.
        lower_bounds[m] = cost[previous, open_ends[m]] + _distance(candidates[previous, open_ends[m]], point)
    while True:
        # Best lower bound first, so that few legs are evaluated: a leg without violations ends the search.
        m = _lowest_index(lower_bounds, open_ends.size)
        j, lower_bound = open_ends[m], lower_bounds[m]
        if not lower_bound < min(cost[i, k], max_cost):
            return evaluated_count
        lower_bounds[m] = np.inf
        turn_cost = 0.0
        if 0 < previous < candidates.shape[0] - 1:
            far_point = candidates[previous - step, link[previous, j]]
            first_point, last_point = (far_point, point) if step > 0 else (point, far_point)
            turn_cost = _corner_cost(data, limits, first_point, candidates[previous, j], last_point, corners)
        if not lower_bound + turn_cost < min(cost[i, k], max_cost):
            continue
        first_candidate, second_candidate = (j, k) if step > 0 else (k, j)
        leg = legs[min(i, previous), first_candidate, second_candidate]
        if leg <= 0.0:
            evaluated_count += 1 if leg == 0.0 else 0
            if not cost[previous, j] - leg + turn_cost < min(cost[i, k], max_cost):
                continue
            max_leg_cost = min(cost[i, k], max_cost) - cost[previous, j] - turn_cost + COST_ROUNDING_M
            leg = penalised_leg_cost(
                data,
                limits,
                candidates[min(i, previous), first_candidate],
                candidates[max(i, previous), second_candidate],
                max_leg_cost,
            )
            legs[min(i, previous), first_candidate, second_candidate] = leg if leg <= max_leg_cost else -leg
        total = cost[previous, j] + leg + turn_cost
        if total < min(cost[i, k], max_cost):
            cost[i, k], link[i, k] = total, j


@inlined
def _lowest_index(values: Floats, count: int) -> int:
    """Return the index of the lowest of the first `count` values."""
    lowest_index = 0
    for k in range(1, count):
        lowest_index = k if values[k] < values[lowest_index] else lowest_index
    return lowest_index


@inlined
def _distance(start: Floats, end: Floats) -> float:
    """Return the distance between two points (3,), m."""
    return math.sqrt((end[0] - start[0]) ** 2 + (end[1] - start[1]) ** 2 + (end[2] - start[2]) ** 2)


@inner
def _corner_cost(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    previous_waypoint: Floats,
    waypoint: Floats,
    next_waypoint: Floats,
    corners: Records,
) -> float:
    """Return the cost of a turn that is too sharp, or whose legs are too short, m of path.

    It is 0 for other turns.

    previous_waypoint, waypoint, next_waypoint: (3,) m.
    corners: working memory, one `CORNER` record.

    Each 100 m of missing leg length cost as much as an excess of 1 rad, up to 10 rad. A corner at a leg without length
    costs as much as 1 rad.
    """
    ux = waypoint[0] - previous_waypoint[0]
    uy = waypoint[1] - previous_waypoint[1]
    vx = next_waypoint[0] - waypoint[0]
    vy = next_waypoint[1] - waypoint[1]
    first_length, second_length = math.sqrt(ux * ux + uy * uy), math.sqrt(vx * vx + vy * vy)
    if first_length == 0.0 or second_length == 0.0:
        return TURN_COST
    turn = math.atan2(abs(ux * vy - uy * vx), ux * vx + uy * vy)
    turn_excess = max(0.0, turn - data.max_turn)
    if data.legs_hold_turns:
        corner = corners[0]
        measure_corner(
            data.aircraft,
            data.tracking,
            limits.wind,
            True,
            ux / first_length,
            uy / first_length,
            vx / second_length,
            vy / second_length,
            waypoint[2],
            corner,
        )
        missing_length = max(0.0, corner.before - TURN_LENGTH_FRACTION * first_length) + max(
            0.0, corner.after - TURN_LENGTH_FRACTION * second_length
        )
        turn_excess += min(10.0, missing_length / 100.0)
    return TURN_COST * turn_excess


@compiled
def free_points(data: ProblemArrays, points: Floats) -> Flags:
    """Return a mask (n,) of the points that are on the map, above the clearance and outside kill spheres.

    points: (n, 3) m.

    >>> from planfly.workflow.uav import load_uav
    >>> from planner.evaluation.problem import make_problem
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("hard-07")
    >>> data = make_problem(scenario, load_uav(scenario).limits).search
    >>> unit = scenario.threats.position[0]
    >>> free_points(data, np.array([scenario.start, unit + [0.0, 0.0, 50.0], [-5000.0, 0.0, 300.0]])).tolist()
    [True, False, False]
    """
    required = required_clearance(data)
    is_free = np.zeros(points.shape[0], dtype=np.bool_)
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        if not (data.west <= x <= data.east and data.south <= y <= data.north):
            continue
        column, row = polymap(data.to_pixel, x, y)
        # This form treats NaN as not free.
        if not z > pixel_height(data.heights, column, row) + clearance_at(required, x, y):
            continue
        exposure, _, _ = kill_density(data.missiles, data.kill_margin, 0.0, x, y, z, x, y, z, 0.0, 0.0, 0.0, 0.0)
        is_free[k] = exposure == 0.0
    return is_free
