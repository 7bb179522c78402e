"""Fit waypoints to a route by dynamic programming over candidate points.

Whole legs are evaluated.

`fit_points` chooses one candidate per interval so that the sum of leg costs is smallest, then repeats this with
candidates around each chosen waypoint and shrinking moves. `move_all_waypoints` applies the same moves to a path of the
rotated encoding. Turns are not part of the cost.
"""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from planner.evaluation.airspace_scores import airspace_excess
from planner.evaluation.encoding import Encoding, RotatedFrame, WaypointFrames, require_frames, straight_frames
from planner.evaluation.leg_constraints import PrecomputedLimits, precompute_limits, slope_excess
from planner.evaluation.problem import ProblemArrays
from planner.evaluation.terrain_clearance import clearance_deficit, lag_length, segment_pixels
from planner.evaluation.threat_index import kill_density
from planner.seeding.grids import KILL_COST
from world.arrays import Floats, Ints
from world.kernels import compiled, inner

# Cost of depth, in m of path per m·km.
DEPTH_COST = 2e4
# Cost of slope excess, in m of path per unit of slope.
SLOPE_COST = 1e6
# Added to the upper limit of a leg's cost, m: more than the rounding error of a difference of costs.
COST_ROUNDING_M = 1e-3


@inner
def penalised_leg_cost(data: ProblemArrays, limits: PrecomputedLimits, a: Floats, b: Floats, max_cost: float) -> float:
    """Return the length of the leg a-b plus the cost of its violations, m of path.

    a, b: ends of the leg, (3,) m.
    max_cost: cost above which the evaluation ends; the result is then a lower bound.
    """
    dx, dy = b[0] - a[0], b[1] - a[1]
    horizontal_length = math.sqrt(dx * dx + dy * dy)
    length = math.sqrt(dx * dx + dy * dy + (b[2] - a[2]) ** 2)
    ux, uy = (dx / horizontal_length, dy / horizontal_length) if horizontal_length > 0.0 else (0.0, 0.0)
    excess_slope = slope_excess(data, limits, ux, uy, horizontal_length, a[2], b[2])
    total = length + SLOPE_COST * excess_slope
    if total > max_cost:
        return total
    ends = segment_pixels(data.to_pixel, a[0], a[1], b[0], b[1])
    depth_below = (
        _max_depth_below_leg(data, limits, ux, uy, horizontal_length, a[2], b[2]) if data.tracking.has_error else 0.0
    )
    total += DEPTH_COST * clearance_deficit(
        data.heights,
        data.slope_bounds,
        limits.required,
        max(0.0, depth_below),
        ends,
        a[0],
        a[1],
        a[2],
        b[0],
        b[1],
        b[2],
        (max_cost - total + COST_ROUNDING_M) / DEPTH_COST,
    )
    if total > max_cost:
        return total
    exposure, _, _ = kill_density(
        data.missiles,
        data.kill_margin,
        0.0,
        a[0],
        a[1],
        a[2],
        b[0],
        b[1],
        b[2],
        0.0,
        0.0,
        max(0.0, depth_below),
        max(0.0, -depth_below),
    )
    if exposure > 0.0:
        # At least a tenth of the full cost, so that even a slight exposure is avoided.
        total += KILL_COST * length * min(1.0, 0.1 + exposure)
    if total > max_cost:
        return total
    if data.airspace.zones.required.shape[0] > 0 or data.airspace.max_height < math.inf:
        max_depth = (max_cost - total + COST_ROUNDING_M) / DEPTH_COST
        total += DEPTH_COST * airspace_excess(data, a, b, max(0.0, depth_below), max(0.0, -depth_below), max_depth)
    return total


@inner
def _max_depth_below_leg(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    east: float,
    north: float,
    horizontal_length: float,
    start_altitude: float,
    end_altitude: float,
) -> float:
    """Return the largest distance of the aircraft below a long leg, m; negative if it flies above the leg.

    east, north: unit course of the leg.
    horizontal_length: m.
    start_altitude, end_altitude: m AMSL.

    The altitude lags by the lag length times the slope. On a leg whose altitude changes by less than the autopilot's
    step, the final altitude is demanded from the start; the aircraft then flies at that altitude, and differs from the
    leg by the whole change.
    """
    altitude_change = end_altitude - start_altitude
    if abs(altitude_change) < data.tracking.step:
        return -altitude_change
    length = lag_length(data.tracking, data.aircraft, east, north, start_altitude, limits.wind)
    return length * altitude_change / max(horizontal_length, 1e-6)


@compiled
def _choose_candidates(data: ProblemArrays, candidates: Floats) -> tuple[Ints, int]:
    """Choose a candidate (w, c, 3) for each waypoint, so that the sum of the leg costs is smallest.

    Dynamic programming, waypoint by waypoint: of all paths to a candidate only the cheapest is kept. The first
    candidates of both ends are used.

    Returns the indices of the chosen candidates (w,) and the number of legs evaluated.
    """
    count, width, _ = candidates.shape
    parents = np.zeros((count, width), dtype=np.int64)
    cost = np.full(width, np.inf)
    cost[0] = 0.0
    limits = precompute_limits(data)
    lower_bounds, evaluated = np.empty(width), 0
    for i in range(1, count):
        next_cost = np.full(width, np.inf)
        for k in range(width if i < count - 1 else 1):
            b = candidates[i, k]
            for j in range(width):
                a = candidates[i - 1, j]
                # A leg costs at least its length.
                lower_bounds[j] = cost[j] + math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
            # Best lower bound first: a leg without violations ends the search.
            while True:
                j = int(np.argmin(lower_bounds))
                if lower_bounds[j] >= next_cost[k]:
                    break
                lower_bounds[j] = np.inf
                evaluated += 1
                max_cost = next_cost[k] - cost[j] + COST_ROUNDING_M
                total = cost[j] + penalised_leg_cost(data, limits, candidates[i - 1, j], b, max_cost)
                if total < next_cost[k]:
                    next_cost[k] = total
                    parents[i, k] = j
        cost = next_cost
    chosen = np.zeros(count, dtype=np.int64)
    for i in range(count - 1, 0, -1):
        chosen[i - 1] = parents[i, chosen[i]]
    return chosen, evaluated


@dataclass(frozen=True, slots=True)
class WaypointFit:
    """Effort of fitting waypoints to a route.

    candidates: number of candidates along each interval.
    lifts: heights above the route at which each candidate is tried, m.
    rounds: number of times that every waypoint may move.
    diagonal: True if moves lead to all 26 neighbours, not just the 6 along the axes.
    """

    candidates: int
    lifts: tuple[float, ...]
    rounds: int
    diagonal: bool


# Initial moves of a waypoint: fractions of the interval along and across, and m up.
FIRST_MOVES = (0.25, 0.2, 40.0)
# Reduction of the moves per round.
MOVE_FACTOR = 0.7
# Reduction of the moves in the last rounds.
LAST_MOVE_FACTOR = 0.6
CLOSE_FIT = WaypointFit(9, (0.0, 20.0, 60.0), 2, diagonal=True)
QUICK_FIT = WaypointFit(5, (0.0, 20.0, 60.0), 2, diagonal=False)
# Steps to the 26 neighbours and to the point itself, along, across and up.
_NEIGHBOURS = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
_AXIS_NEIGHBOURS = _NEIGHBOURS[np.abs(_NEIGHBOURS).sum(axis=1) <= 1.0]


def fit_waypoints(
    data: ProblemArrays, frame: RotatedFrame, route: Floats, waypoints: int, fit: WaypointFit = CLOSE_FIT
) -> Floats:
    """Fit waypoints to a route, one per interval of the rotated frame; return the path, (w, 3) m.

    route: (s, 3) along, across and up in the frame, m.
    waypoints: number w of waypoints.
    fit: effort.
    """
    edges = np.linspace(0.0, frame.length, waypoints - 1)
    interval = edges[1] - edges[0]
    # Candidates keep a tenth of the interval from both of its ends, so that neighbours stay apart.
    fractions = np.linspace(0.1, 0.9, fit.candidates)
    along = edges[:-1, None] + fractions * interval
    points = np.stack([along, *(np.interp(along, route[:, 0], route[:, axis]) for axis in (1, 2))], axis=-1)
    return fit_points(data, straight_frames(*frame[:4], edges), points, fit)


def fit_points(data: ProblemArrays, frames: WaypointFrames, points: Floats, fit: WaypointFit = CLOSE_FIT) -> Floats:
    """Choose waypoints among candidate points, move them locally, and return the path (w, 3), m.

    frames: origin and rotation of the frame in which each waypoint moves.
    points: (w - 2, k, 3) candidates of each inner waypoint, in the frame of the waypoint, m.
    fit: heights by which the candidates are also lifted, m, and the pattern of the moves.

    The path includes both ends, and is in world positions.
    """
    inner_count, width, _ = points.shape
    candidates = np.zeros((inner_count + 2, width * len(fit.lifts), 3))
    candidates[1:-1] = np.tile(points, (1, len(fit.lifts), 1))
    candidates[1:-1, :, 2] += np.repeat(fit.lifts, width)
    chosen, _ = _pick_candidates(data, frames, candidates)
    steps = _NEIGHBOURS if fit.diagonal else _AXIS_NEIGHBOURS
    moved, _ = _move_waypoints(data, frames, chosen, steps, fit.rounds, np.array(FIRST_MOVES), MOVE_FACTOR)
    return _candidates_to_world(frames, moved[:, None])[:, 0]


def move_all_waypoints(
    data: ProblemArrays, encoding: Encoding, vector: Floats, rounds: int, scale: float
) -> tuple[Floats, int]:
    """Shorten a path of the rotated encoding by moving all its waypoints at once.

    vector: the path, (d,).
    rounds: number of times that all waypoints may move.
    scale: size of the first moves relative to `FIRST_MOVES`.

    The cost of single legs is evaluated; turns have no cost. Returns the new vector and the equivalent number of path
    evaluations.
    """
    frames = require_frames(encoding)
    path = np.zeros((encoding.waypoints, 3))
    path[1:-1] = frames.to_frame(encoding.decode(vector[None])[0, 1:-1])
    chosen, legs = _move_waypoints(
        data, frames, path, _NEIGHBOURS, rounds, scale * np.array(FIRST_MOVES), LAST_MOVE_FACTOR
    )
    return np.clip(chosen[1:-1].ravel(), encoding.lower, encoding.upper), math.ceil(legs / (encoding.waypoints - 1))


def _move_waypoints(
    data: ProblemArrays,
    frames: WaypointFrames,
    waypoints: Floats,
    steps: Floats,
    rounds: int,
    moves: Floats,
    shrink: float,
) -> tuple[Floats, int]:
    """Move waypoints (w, 3) in their frames; return the moved waypoints and the number of legs evaluated.

    In each round every waypoint may take one of `steps`, and the combination with the lowest sum of leg costs is
    chosen. The steps become smaller from round to round.

    steps: (c, 3) directions in which a waypoint may move: -1, 0 or 1 along, across and up; (0, 0, 0) to stay.
    rounds: number of rounds.
    moves: (3,) length of the first steps along and across, as fractions of an interval, and up, m.
    shrink: factor on the steps after each round.
    """
    legs = 0
    min_along, max_along = frames.edges[:-1, None], frames.edges[1:, None]
    interval = frames.edges[-1] / (len(waypoints) - 2)
    moves = moves * [interval, interval, 1.0]
    for _ in range(rounds):
        candidates = np.repeat(waypoints[:, None, :], len(steps), axis=1)
        candidates[1:-1] += steps * moves
        candidates[1:-1, :, 0] = np.clip(candidates[1:-1, :, 0], min_along, max_along)
        candidates[1:-1, :, 2] = np.clip(candidates[1:-1, :, 2], data.floor, data.ceiling)
        waypoints, leg_count = _pick_candidates(data, frames, candidates)
        legs += leg_count
        moves = moves * shrink
    return waypoints, legs


def _pick_candidates(data: ProblemArrays, frames: WaypointFrames, candidates: Floats) -> tuple[Floats, int]:
    """Choose the candidate of each waypoint for which the sum of the leg costs is smallest.

    frames: origin and rotation of the frame in which each waypoint moves.
    candidates: (w, k, 3) candidates in these frames, m; the ends are overwritten with the fixed ends.

    Returns the chosen candidates, (w, 3) in their frames, and the number of legs evaluated.
    """
    inner_count = len(candidates) - 2
    # An end has the frame of the waypoint next to it.
    for end, point, neighbour_index in ((0, data.start, 0), (-1, data.destination, inner_count - 1)):
        candidates[end] = frames.to_frame(np.tile(point, (inner_count, 1)))[neighbour_index]
    chosen_indices, leg_count = _choose_candidates(data, np.ascontiguousarray(_candidates_to_world(frames, candidates)))
    return candidates[np.arange(len(candidates)), chosen_indices], int(leg_count)


def _candidates_to_world(frames: WaypointFrames, candidates: Floats) -> Floats:
    """Convert candidates (w, c, 3) in their frames to world positions, (w, c, 3) m.

    The start and the destination are given in the frame of the waypoint next to them.
    """
    rows = np.clip(np.arange(len(candidates)) - 1, 0, len(candidates) - 3)
    east, north, cosine, sine = (values[rows] for values in frames[:4])
    row_frames = WaypointFrames(east, north, cosine, sine, frames.edges)
    return np.asarray(row_frames.to_world(candidates.transpose(1, 0, 2)).transpose(1, 0, 2))
