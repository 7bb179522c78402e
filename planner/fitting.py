"""Waypoints along a grid's route: a dynamic programme over places near it, in which whole legs are judged."""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.compiled import compiled
from planner.encoding import Frame
from planner.ground import pixels, terrain_excess
from planner.legs import Gauge, make_gauge, slope_excess
from planner.missiles import kill_density
from planner.rules import Rules

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Cost of a m inside a kill sphere, of a m of depth x km, and of a unit of slope excess, in m of path.
KILL_COST = 40.0
DEPTH_COST = 2e4
SLOPE_COST = 1e6


@compiled
def leg_cost(rules: Rules, gauge: Gauge, a: Floats, b: Floats) -> float:  # pragma: no cover - compiled
    """Cost of one leg, in m of path: its length and what it violates."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    run = math.sqrt(dx * dx + dy * dy)
    length = math.sqrt(dx * dx + dy * dy + (b[2] - a[2]) ** 2)
    ux, uy = (dx / run, dy / run) if run > 0.0 else (0.0, 0.0)
    steep = slope_excess(rules, gauge, ux, uy, run, a[2], b[2])
    ends = pixels(rules.to_pixel, a[0], a[1], b[0], b[1])
    depth = terrain_excess(rules.heights, rules.steep, gauge.clear, ends, a[0], a[1], a[2], b[0], b[1], b[2])
    total = length + SLOPE_COST * steep + DEPTH_COST * depth
    kill, _, _ = kill_density(rules.missiles, rules.kill_margin, 0.0, a[0], a[1], a[2], b[0], b[1], b[2], 0.0, 0.0)
    if kill > 0.0:
        total += KILL_COST * length * min(1.0, 0.1 + kill)
    return total


@compiled
def _choose(rules: Rules, candidates: Floats) -> Ints:  # pragma: no cover - compiled
    """Which of the candidates (w, c, 3) world m to take at each waypoint, so that the legs cost least."""
    count, width, _ = candidates.shape
    came = np.zeros((count, width), dtype=np.int64)
    cost = np.full(width, np.inf)
    cost[0] = 0.0
    gauge = make_gauge(rules)
    least = np.empty(width)
    for i in range(1, count):
        after = np.full(width, np.inf)
        for k in range(width if i < count - 1 else 1):
            b = candidates[i, k]
            for j in range(width):
                a = candidates[i - 1, j]
                # No leg costs less than its length.
                least[j] = cost[j] + math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
            # The most promising first: the first without violations ends it.
            while True:
                j = int(np.argmin(least))
                if least[j] >= after[k]:
                    break
                least[j] = np.inf
                total = cost[j] + leg_cost(rules, gauge, candidates[i - 1, j], b)
                if total < after[k]:
                    after[k] = total
                    came[i, k] = j
        cost = after
    out = np.zeros(count, dtype=np.int64)
    for i in range(count - 1, 0, -1):
        out[i - 1] = came[i, out[i]]
    return out


def fit_waypoints(rules: Rules, frame: Frame, route: Floats, waypoints: int, rounds: int = 2) -> Floats:
    """Waypoints (w, 3) world m along a route (s, 3) in rotated axes, one an interval, tight as whole legs allow."""
    edges = np.linspace(0.0, frame.length, waypoints - 1)
    shares = np.linspace(0.1, 0.9, 9)
    height = 20.0
    candidates = np.empty((waypoints, shares.size * 3, 3))
    for i in range(waypoints - 2):
        along = edges[i] + shares * (edges[i + 1] - edges[i])
        points = np.column_stack([along, *(np.interp(along, route[:, 0], route[:, axis]) for axis in (1, 2))])
        for k, lift in enumerate((0.0, height, 3.0 * height)):
            candidates[i + 1, k * shares.size : (k + 1) * shares.size] = points + np.array([0.0, 0.0, lift])
    chosen = _pick(rules, frame, candidates)
    span = edges[1] - edges[0]
    offsets = np.array([[a, b, c] for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)], dtype=np.float64)
    reach = np.array([0.25 * span, 0.2 * span, 40.0])
    for _ in range(rounds):
        candidates = np.repeat(chosen[:, None, :], len(offsets), axis=1)
        candidates[1:-1] += offsets * reach
        low, high = edges[:-1, None], edges[1:, None]
        candidates[1:-1, :, 0] = np.clip(candidates[1:-1, :, 0], low, high)
        candidates[1:-1, :, 2] = np.clip(candidates[1:-1, :, 2], rules.floor, rules.ceiling)
        chosen = _pick(rules, frame, candidates)
        reach *= 0.7
    return frame.restore(chosen)


def _pick(rules: Rules, frame: Frame, candidates: Floats) -> Floats:
    """Chosen candidates (w, 3), in rotated axes, the ends fixed."""
    candidates[0], candidates[-1] = frame.rotate(rules.start), frame.rotate(rules.destination)
    chosen = _choose(rules, np.ascontiguousarray(frame.restore(candidates)))
    return candidates[np.arange(len(candidates)), chosen]
