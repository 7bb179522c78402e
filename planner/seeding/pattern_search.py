"""A local search that tightens one path: moves of one waypoint and of stretches, kept while they help.

A pattern search after Hooke and Jeeves (1961) over hat-shaped moves of several widths.  A search by samples finds the
way round the obstacles; the last percent of its length this finds with fewer evaluations.
"""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.encoding import Encoding, rotated_frame
from planner.evaluation.graded_scores import Bench, make_bench, score_path
from planner.evaluation.leg_constraints import Gauge, make_gauge
from planner.evaluation.problem_arrays import Rules
from world.kernels import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Prices of violations, in length ratios: a unit of turn (rad), slope, terrain (m x km), bounds (m), and of exposure.
PRICES = np.array([2.0, 20.0, 0.5, 1.0, 5.0])
# Price of any exposure at all: what a missile hardly reaches has next to none.
REACHED = 0.002
# First steps, as shares of the interval between waypoints: along, across; and up, m.
FIRST_ALONG, FIRST_ACROSS, FIRST_UP = 0.2, 0.15, 25.0
# Smallest share of its first step that a move is tried with.
LEAST = 0.002


def polish(rules: Rules, encoding: Encoding, vector: Floats, evaluations: int) -> tuple[Floats, int]:
    """Tighten a path of the rotated encoding.

    vector: (d,).  evaluations: the most to make.  Returns the best vectors found (k, d), which are one that meets the
    constraints, if any was seen, and the one of the least merit; and the evaluations made.
    """
    frame = rotated_frame(rules.start, rules.destination)
    inner = encoding.waypoints - 2
    span = frame.length / inner
    packed = np.array([*frame.origin, *frame.direction])
    moves, axes = _hats(inner)
    steps = np.array([FIRST_ALONG * span, FIRST_ACROSS * span, FIRST_UP])[axes]
    start = np.array(vector, dtype=np.float64)
    found, fit, made = _search(rules, packed, encoding.lower, encoding.upper, start, moves, steps, evaluations)
    return found[:1] if fit else found[1:] if math.isinf(found[0, 0]) else found, int(made)


@cache
def _hats(inner: int) -> tuple[Floats, Ints]:
    """Moves (k, 3 inner), hats of 1, 2, 4, ... waypoints to either side, and the axis (k,) along which each is."""
    rows: list[Floats] = []
    axes: list[int] = []
    place = np.arange(inner, dtype=np.float64)
    width = 1
    while width <= max(1, inner // 2):
        for centre in np.arange(0.0, inner, max(1.0, width / 2)):
            hat = np.maximum(0.0, 1.0 - np.abs(place - centre) / width)
            for axis in range(3):
                if axis == 0 and width > 1:
                    continue
                move = np.zeros((inner, 3))
                move[:, axis] = hat
                rows.append(move.ravel())
                axes.append(axis)
        width *= 2
    return np.array(rows), np.array(axes)


@compiled
def _merit(
    rules: Rules,
    gauge: Gauge,
    bench: Bench,
    packed: Floats,
    vector: Floats,
    path: Floats,
    missed: Floats,
    objectives: Floats,
) -> tuple[float, bool]:  # pragma: no cover - compiled
    """Length ratio and the price of what is violated; whether nothing is."""
    for i in range(path.shape[1] - 2):
        along, across = vector[3 * i], vector[3 * i + 1]
        path[0, i + 1, 0] = packed[0] + packed[2] * along - packed[3] * across
        path[0, i + 1, 1] = packed[1] + packed[3] * along + packed[2] * across
        path[0, i + 1, 2] = vector[3 * i + 2]
    missed[:] = 0.0
    score_path(rules, gauge, bench, path, 0, missed, objectives)
    price, fit = PRICES[4] * objectives[0, 1], True
    if objectives[0, 1] > 0.0:
        price += REACHED
        fit = False
    for k in range(4):
        price += PRICES[k] * missed[0, k]
        fit = fit and missed[0, k] == 0.0
    return objectives[0, 0] + price, fit


@compiled
def _search(
    rules: Rules,
    packed: Floats,
    lower: Floats,
    upper: Floats,
    start: Floats,
    moves: Floats,
    steps: Floats,
    most: int,
) -> tuple[Floats, bool, int]:  # pragma: no cover - compiled
    """Rows (2, d): the best that meets the constraints (inf if none) and the least merit; whether they are one."""
    inner = start.size // 3
    gauge, bench = make_gauge(rules), make_bench(rules, inner + 2)
    path, missed, objectives = np.empty((1, inner + 2, 3)), np.zeros((1, 4)), np.zeros((1, 4))
    path[0, 0], path[0, inner + 1] = rules.start, rules.destination
    found = np.full((2, start.size), np.inf)
    here, trial, before = start.copy(), start.copy(), start.copy()
    best, fit = _merit(rules, gauge, bench, packed, here, path, missed, objectives)
    shortest = best if fit else math.inf
    if fit:
        found[0] = here
    made = 1
    first = steps.copy()
    while made < most:
        moved = False
        alive = False
        before[:] = here
        # The last turn of a round goes on as far as the whole round went.
        for k in range(moves.shape[0] + 1):
            if made >= most or (k < moves.shape[0] and abs(steps[k]) < LEAST * first[k]):
                continue
            better = False
            for _ in range(2):
                for d in range(start.size):
                    step = steps[k] * moves[k, d] if k < moves.shape[0] else here[d] - before[d]
                    trial[d] = min(upper[d], max(lower[d], here[d] + step))
                merit, fit = _merit(rules, gauge, bench, packed, trial, path, missed, objectives)
                made += 1
                if fit and merit < shortest:
                    shortest = merit
                    found[0] = trial
                if merit < best:
                    best, better = merit, True
                    here[:] = trial
                    break
                if k == moves.shape[0]:
                    break
                steps[k] = -steps[k]
            if k < moves.shape[0]:
                steps[k] *= 1.5 if better else 0.5
                alive = True
            moved = moved or better
        if not alive:
            break
    found[1] = here
    return found, shortest <= best, made
