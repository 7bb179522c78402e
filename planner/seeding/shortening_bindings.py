"""What constrains a path near where it is: missiles, the ground, slopes and turns, as shortening takes them."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.height_lags import HEIGHT_LAG, measure_lags
from planner.evaluation.leg_constraints import PrecomputedLimits, precompute_limits, slope_limits
from planner.evaluation.leg_geometry import (
    CORNER,
    LEG,
    courses_at,
    measure_corner,
    measure_corners,
    measure_legs,
    roll_length,
    turn_length,
)
from planner.evaluation.problem_arrays import ProblemArrays
from world.kernels import Records, compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Spheres are constraints of the legs that come so near their surface, m.
NEAR = 250.0
# Least turn, rad, that what a turn takes of its legs is measured at; the greatest counts as this, whose half's tangent
# is large enough; and the most that a turn takes of a leg, m.
LEAST_TURN, GREATEST_TURN, LONGEST_NEED = 0.2, 3.0, 1e4


class Bindings(NamedTuple):
    """What constrains a path of w waypoints in one round, as seen where the round began.

    pairs: (p, 2) a leg and the missile near it; wide: (p,) distance (m) wanted of its middle.
    samples: of the ground on each leg; low: (w - 1,) m wanted above it beside the clearance.
    climb, dive: (w - 1,) tangents.  before, after: (w,) length of the legs (m) that a turn takes, over the tangent of
    half of it.  roll: (w - 1,) m of a leg between turns of opposite sides.
    turns_in_legs: whether legs must hold their turns.
    """

    pairs: Ints
    wide: Floats
    samples: int
    low: Floats
    climb: Floats
    dive: Floats
    before: Floats
    after: Floats
    roll: Floats
    turns_in_legs: bool


@compiled
def bindings(data: ProblemArrays, path: Floats, samples: int, spare: float) -> Bindings:  # pragma: no cover - compiled
    """What constrains a path (w, 3) near where it is; spare: m by which spheres and ground are kept further away."""
    limits = precompute_limits(data)
    count = path.shape[0] - 1
    legs, corners, lags = np.zeros(count, dtype=LEG), np.zeros(count + 1, dtype=CORNER), np.zeros(count, HEIGHT_LAG)
    measure_legs(path, legs)
    measure_corners(data, limits.wind, path, legs, corners)
    if data.tracking.strays:
        measure_lags(data.tracking, data.aircraft, limits.wind, path, legs, lags)
    low, climb, dive, roll = np.zeros(count), np.zeros(count), np.zeros(count), np.zeros(count)
    for i in range(count):
        steepest, deepest = slope_limits(data, path[i], path[i + 1])
        climb[i], dive[i] = math.tan(steepest), math.tan(deepest)
        low[i] = spare + lags[i].most
        if data.legs_hold_turns and not data.fly_over:
            up = min(path[i, 2], path[i + 1, 2])
            roll[i] = roll_length(data.aircraft, legs, corners, i, up, limits.wind)
    before, after = np.zeros(count + 1), np.zeros(count + 1)
    if data.legs_hold_turns:
        _turn_shares(data, limits, path, legs, before, after)
    pairs, wide = _near_missiles(data, path, corners, lags, spare)
    return Bindings(pairs, wide, samples, low, climb, dive, before, after, roll, data.legs_hold_turns)


@compiled
def _turn_shares(
    data: ProblemArrays, limits: PrecomputedLimits, path: Floats, legs: Records, before: Floats, after: Floats
) -> None:  # pragma: no cover - compiled
    """Fill what turns take of the legs before and after them, over the tangents of half of them, (w,)."""
    corners = np.zeros(1, dtype=CORNER)
    for i in range(path.shape[0]):
        ux, uy, vx, vy = courses_at(data, legs, i)
        cross, dot = ux * vy - uy * vx, ux * vx + uy * vy
        turn = math.atan2(abs(cross), dot)
        if i in (0, path.shape[0] - 1) and turn == 0.0:
            continue
        if turn < LEAST_TURN:
            turn = LEAST_TURN
            sine = math.sin(turn) if cross >= 0.0 else -math.sin(turn)
            vx, vy = ux * math.cos(turn) - uy * sine, uy * math.cos(turn) + ux * sine
        measure_corner(data.aircraft, data.tracking, limits.wind, True, ux, uy, vx, vy, path[i, 2], corners[0])
        share = math.tan(0.5 * min(turn, GREATEST_TURN))
        before[i], after[i] = min(LONGEST_NEED, corners[0].before) / share, min(LONGEST_NEED, corners[0].after) / share
        if data.fly_over:
            before[i], after[i] = 0.0, min(LONGEST_NEED, turn_length(True, corners, 0)) / share


@compiled
def _near_missiles(
    data: ProblemArrays, path: Floats, corners: Records, lags: Records, spare: float
) -> tuple[Ints, Floats]:  # pragma: no cover - compiled
    """Legs and the missiles near them (p, 2), and the distances (p,) wanted from the middles of these, m."""
    missiles = data.missiles.missiles
    pairs, wide = [(0, 0) for _ in range(0)], [0.0 for _ in range(0)]
    for k in range(missiles.shape[0]):
        missile = missiles[k]
        for i in range(path.shape[0] - 1):
            ax, ay, az = path[i, 0] - missile.east, path[i, 1] - missile.north, path[i, 2] - missile.up
            dx, dy, dz = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1], path[i + 1, 2] - path[i, 2]
            length2 = max(1e-6, dx * dx + dy * dy + dz * dz)
            share = min(1.0, max(0.0, -(ax * dx + ay * dy + az * dz) / length2))
            away = math.sqrt((ax + share * dx) ** 2 + (ay + share * dy) ** 2 + (az + share * dz) ** 2)
            if away > missile.radius + data.kill_margin + NEAR:
                continue
            length = math.sqrt(length2)
            aside = 0.0
            if share * length < corners[i].after:
                aside = corners[i].excursion
            if (1.0 - share) * length < corners[i + 1].before:
                aside = max(aside, corners[i + 1].excursion)
            lag = max(lags[i].most, -lags[i].least) * abs(az + share * dz) / max(away, 1.0)
            pairs.append((i, k))
            wide.append(missile.radius + data.kill_margin + spare + aside + lag)
    out, wanted = np.zeros((len(pairs), 2), dtype=np.int64), np.zeros(len(pairs))
    for p in range(len(pairs)):
        out[p, 0], out[p, 1] = pairs[p]
        wanted[p] = wide[p]
    return out, wanted


@compiled
def constraints_of(bound: Bindings) -> int:  # pragma: no cover - compiled
    """How many constraints `lagrangian` has."""
    legs = bound.low.size
    count: int = bound.pairs.shape[0] + legs * (bound.samples + 4) + legs + 1
    return count


@compiled
def carried(old: Bindings, multipliers: Floats, new: Bindings) -> Floats:  # pragma: no cover - compiled
    """Multipliers for new bindings: those of the pairs of leg and missile that were there, and of all that has none."""
    out, many, before = np.zeros(constraints_of(new)), new.pairs.shape[0], old.pairs.shape[0]
    out[many:] = multipliers[before:]
    k = 0
    for p in range(many):
        # Both are in the order of missiles, and of legs.
        while k < before and (
            old.pairs[k, 1] < new.pairs[p, 1]
            or (old.pairs[k, 1] == new.pairs[p, 1] and old.pairs[k, 0] < new.pairs[p, 0])
        ):
            k += 1
        if k < before and old.pairs[k, 0] == new.pairs[p, 0] and old.pairs[k, 1] == new.pairs[p, 1]:
            out[p] = multipliers[k]
    return out
