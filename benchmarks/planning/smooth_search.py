"""Shortest safe paths by a lattice and SciPy's SLSQP: an independent reference that shares no search with the planner.

Ways on different sides of the missiles come from `benchmarks.planning.lattice_search.lattice_ways`, Dijkstra's
algorithm over the whole map.  Each is then shortened as a nonlinear programme over the positions of all waypoints, with
derivatives: lengths of legs, distances of legs to spheres, slopes, turns, heights above ground.  No frame, no interval
binds a waypoint, and neither pattern search nor dynamic programme of the planner takes part.  What comes of it keeps
the margins that the planner's own search keeps, and counts only if it is certified.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from benchmarks.planning.lattice_search import lattice_ways
from benchmarks.task import Task, is_safe
from planner.search.plan_path import plan_path

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Length of a unit of the programme's variables, m; legs whose distance to a sphere or height above ground is less than
# this are constrained by it, m; samples of the ground on a leg, and what is kept above it beside the margin, m.
UNIT, NEAR, NEAR_GROUND, SAMPLES, SPARE = 100.0, 500.0, 80.0, 32, 1.0
# Rounds, each with the constraints near its start; steps of each; and the shortest leg, m.
ROUNDS, STEPS, SHORTEST = 4, 60, 25.0
# Ways and plans without grids that are shortened of each problem; how far waypoints are moved beside a way, m.
WAYS, PLANS, BESIDE = 16, 1, 60.0
# Step of the differences that the ground's slopes are taken by, m.
DIFFERENCE = 5.0


@dataclass(frozen=True, slots=True)
class Near:
    """Constraints that are near a path: legs and spheres (n,) in pairs, legs and shares (m,) of ground samples."""

    legs: Ints
    spheres: Ints
    ground_legs: Ints
    ground_shares: Floats


class Programme:
    """The shortest path of so many waypoints as a nonlinear programme."""

    def __init__(self, task: Task) -> None:
        data = task.problem.search
        self.task, self.terrain = task, task.scenario.terrain
        self.start, self.destination = np.array(data.start), np.array(data.destination)
        threats = task.scenario.threats
        armed = threats.kill_radius > 0.0
        self.centres, self.radii = threats.position[armed], threats.kill_radius[armed] + data.kill_margin
        self.above = data.clearance + data.buffer + SPARE
        self.climb, self.dive = (math.tan(angle - data.angle_margin) for angle in (data.max_climb, data.max_dive))
        self.cosine = math.cos(data.max_turn)
        self.low = np.array([data.west, data.south, data.floor])
        self.high = np.array([data.east, data.north, data.ceiling])

    def path(self, x: Floats) -> Floats:
        """Waypoints (w, 3), m, of variables (3 (w - 2),)."""
        return np.concatenate([[self.start], UNIT * x.reshape(-1, 3), [self.destination]])

    def length(self, x: Floats) -> tuple[float, Floats]:
        """Length in units, and its gradient."""
        legs = np.diff(self.path(x), axis=0)
        lengths = np.sqrt((legs**2).sum(axis=1))
        unit = legs / lengths[:, None]
        return float(lengths.sum() / UNIT), (unit[:-1] - unit[1:]).ravel()

    def near(self, x: Floats) -> Near:
        """The constraints near a path."""
        path = self.path(x)
        count = len(path) - 1
        legs, spheres = (one.ravel() for one in np.indices((count, len(self.radii))))
        distance, _, _ = self._sphere_distances(path, legs, spheres)
        close = distance < NEAR
        ground_legs, k = (one.ravel() for one in np.indices((count, SAMPLES)))
        shares = (k + 1.0) / (SAMPLES + 1.0)
        low = self._heights(path, ground_legs, shares)[0] < NEAR_GROUND
        return Near(legs[close], spheres[close], ground_legs[low], shares[low])

    def _sphere_distances(self, path: Floats, legs: Ints, spheres: Ints) -> tuple[Floats, Floats, Floats]:
        """Distance (n,) of legs to spheres' surfaces, m; the nearest points' shares of the legs, and unit normals."""
        a, along = path[legs], path[legs + 1] - path[legs]
        to = self.centres[spheres] - a
        share = np.clip((to * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        off = share[:, None] * along - to
        distance = np.sqrt((off**2).sum(axis=1))
        return distance - self.radii[spheres], share, off / np.maximum(distance, 1e-6)[:, None]

    def _heights(self, path: Floats, legs: Ints, shares: Floats) -> tuple[Floats, Floats]:
        """What points on legs are above the height wanted, m, and their positions (n, 3)."""
        points = path[legs] + shares[:, None] * (path[legs + 1] - path[legs])
        assert self.terrain is not None
        ground = self.terrain.height(points[:, 0], points[:, 1])
        return points[:, 2] - np.where(np.isnan(ground), 1e4, ground) - self.above, points

    def constraints(self, x: Floats, near: Near) -> tuple[Floats, Floats]:
        """Values (c,), at least 0 where they hold, in units or cosines; and their derivatives (c, 3 w)."""
        path = self.path(x)
        count = len(path) - 1
        values, rows = [], []
        distance, share, normal = self._sphere_distances(path, near.legs, near.spheres)
        values.append(distance)
        rows.append(self._on_legs(count, near.legs, (1.0 - share)[:, None] * normal, share[:, None] * normal))
        height, points = self._heights(path, near.ground_legs, near.ground_shares)
        values.append(height)
        slope = np.column_stack([-self._ground_slope(points), np.ones(len(points))])
        share = near.ground_shares[:, None]
        rows.append(self._on_legs(count, near.ground_legs, (1.0 - share) * slope, share * slope))
        legs, every = np.diff(path, axis=0), np.arange(count)
        run = np.hypot(legs[:, 0], legs[:, 1])
        unit = np.column_stack([legs[:, :2] / run[:, None], np.zeros(count)])
        up = np.array([0.0, 0.0, 1.0])
        for tangent, sign in ((self.climb, 1.0), (self.dive, -1.0)):
            values.append(tangent * run - sign * legs[:, 2])
            change = tangent * unit - sign * up
            rows.append(self._on_legs(count, every, -change, change))
        values.append(run - SHORTEST)
        rows.append(self._on_legs(count, every, -unit, unit))
        # Cosines of the turns, in units as if a leg were so long.
        before, after = unit[:-1], unit[1:]
        cosine = (before * after).sum(axis=1)
        values.append(UNIT * (cosine - self.cosine))
        of_before = UNIT * (after - cosine[:, None] * before) / run[:-1, None]
        of_after = UNIT * (before - cosine[:, None] * after) / run[1:, None]
        turns = np.arange(count - 1)
        rows.append(
            self._on_legs(count, turns, -of_before, of_before) + self._on_legs(count, turns + 1, -of_after, of_after)
        )
        return np.concatenate(values) / UNIT, np.concatenate(rows)[:, 3:-3]

    @staticmethod
    def _on_legs(count: int, legs: Ints, of_first: Floats, of_second: Floats) -> Floats:
        """Derivatives (n, 3 w) of values that depend on the two ends of a leg each."""
        out = np.zeros((len(legs), count + 1, 3))
        rows = np.arange(len(legs))
        out[rows, legs] += of_first
        out[rows, legs + 1] += of_second
        return out.reshape(len(legs), 3 * (count + 1))

    def _ground_slope(self, points: Floats) -> Floats:
        """Slope of the ground (n, 2) at points, by central differences."""
        assert self.terrain is not None
        east, north = points[:, 0], points[:, 1]
        by_east = self.terrain.height(east + DIFFERENCE, north) - self.terrain.height(east - DIFFERENCE, north)
        by_north = self.terrain.height(east, north + DIFFERENCE) - self.terrain.height(east, north - DIFFERENCE)
        return np.nan_to_num(np.column_stack([by_east, by_north]) / (2.0 * DIFFERENCE))

    def shortened(self, path: Floats) -> Floats:
        """A path (w, 3) that is as short as SLSQP makes it from this one."""
        x = path[1:-1].ravel() / UNIT
        box = [
            (low / UNIT, high / UNIT)
            for _ in range(len(path) - 2)
            for low, high in zip(self.low, self.high, strict=True)
        ]
        length = math.inf
        for _ in range(ROUNDS):
            near = self.near(x)
            held = {
                "type": "ineq",
                "fun": lambda v, near=near: self.constraints(v, near)[0],
                "jac": lambda v, near=near: self.constraints(v, near)[1],
            }
            options = {"maxiter": STEPS, "ftol": 1e-6}
            x = minimize(self.length, x, jac=True, bounds=box, constraints=held, method="SLSQP", options=options).x
            before, length = length, self.length(x)[0]
            if abs(before - length) < 1e-4 * length and self.constraints(x, self.near(x))[0].min() > -1e-4:
                break
        return self.path(x)


def evenly(way: Floats, count: int) -> Floats:
    """Waypoints (count, 3) at equal distances along a way (k, 3)."""
    runs = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(way, axis=0) ** 2).sum(axis=1)))])
    at = np.linspace(0.0, runs[-1], count)
    return np.column_stack([np.interp(at, runs, way[:, axis]) for axis in range(3)])


def smooth_search(task: Task, ways: int = WAYS, plans: int = PLANS) -> tuple[float, Floats | None]:
    """Length ratio and waypoints (w, 3) of the best certified path that is found; inf and None for none.

    ways: of the lattice that are shortened, each from waypoints at equal distances and from others beside them.
    plans: of the algorithm without grids (`fda`) that are shortened too: other sides than the lattice sees.
    """
    programme, count = Programme(task), task.encoding.waypoints
    rng = np.random.default_rng(1)
    starts = []
    for way in lattice_ways(task)[:ways]:
        even = evenly(way, count)
        uneven = even.copy()
        uneven[1:-1, :2] += rng.normal(0.0, BESIDE, (count - 2, 2))
        starts += [even, uneven]
    for seed in range(1, plans + 1):
        plan = plan_path(task.scenario, task.problem.limits, seed=seed, algorithm="fda")
        starts += [plan.waypoints, evenly(plan.waypoints, count)]
    best: tuple[float, Floats | None] = (math.inf, None)
    for start in starts:
        found = programme.shortened(start)
        ratio = task.length_ratio(found)
        if ratio < best[0] and is_safe(task.certificate(found)):
            best = ratio, found
    return best
