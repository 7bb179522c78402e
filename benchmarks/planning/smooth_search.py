"""Find shortest safe paths with a lattice and SciPy's SLSQP, as a reference independent of the planner's search.

Routes on different sides of the missiles are from `benchmarks.planning.lattice_search.lattice_routes`, Dijkstra's
algorithm over the whole map.  Each is then shortened as a nonlinear programme over the positions of all waypoints, with
derivatives: lengths of legs, distances of legs to spheres, slopes, turns, heights above ground.  Waypoints are not
bound to a frame or to intervals, and neither the pattern search nor the dynamic programme of the planner is used.  The
result keeps the margins of the planner's own search, and is accepted only if it is certified.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from benchmarks.planning.lattice_search import lattice_routes
from benchmarks.task import Task, is_safe
from planner.search.plan_path import plan_path
from world.arrays import Floats, Ints

# Unit of the programme's variables, m.
UNIT = 100.0
# Distance to a sphere within which a leg is constrained by it, m.
NEAR = 500.0
# Height above ground below which a leg is constrained by the ground, m.
NEAR_GROUND = 80.0
# Number of ground samples on a leg.
SAMPLES = 32
# Height above ground in addition to the margin, m.
SPARE = 1.0
# Number of rounds, each with the constraints near its start.
ROUNDS = 4
# Steps of a round.
STEPS = 60
# Shortest leg, m.
SHORTEST = 25.0
# Number of lattice routes that are shortened for each problem.
ROUTE_COUNT = 16
# Number of plans without grids that are shortened for each problem.
PLANS = 1
# Offset of waypoints to the side of a route, m.
BESIDE = 60.0
# Step of the differences for the slope of the ground, m.
DIFFERENCE = 5.0


@dataclass(frozen=True, slots=True)
class Near:
    """Constraints that matter near a path.

    legs, spheres: indices of the n pairs of a leg and a sphere that is near it, (n,) each.
    ground_legs, ground_shares: leg and position (fraction of the leg) of the m samples near the ground, (m,) each.
    """

    legs: Ints
    spheres: Ints
    ground_legs: Ints
    ground_shares: Floats


class Programme:
    """Nonlinear programme of the shortest path with a fixed number of waypoints."""

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
        """Return the waypoints (w, 3), m, of variables (3 (w - 2),)."""
        return np.concatenate([[self.start], UNIT * x.reshape(-1, 3), [self.destination]])

    def length(self, x: Floats) -> tuple[float, Floats]:
        """Return the length in units, and its gradient."""
        legs = np.diff(self.path(x), axis=0)
        lengths = np.sqrt((legs**2).sum(axis=1))
        unit = legs / lengths[:, None]
        return float(lengths.sum() / UNIT), (unit[:-1] - unit[1:]).ravel()

    def near(self, x: Floats) -> Near:
        """Select the constraints that matter near the path of variables (3 (w - 2),)."""
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
        """Measure n pairs of a leg and a sphere at the point of the leg that is nearest to the sphere.

        Returns the distances of the legs from the spheres, m, (n,), the positions of these points as fractions of their
        legs, (n,), and the unit vectors from the centres of the spheres to these points, (n, 3).
        """
        a, along = path[legs], path[legs + 1] - path[legs]
        to = self.centres[spheres] - a
        share = np.clip((to * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        off = share[:, None] * along - to
        distance = np.sqrt((off**2).sum(axis=1))
        return distance - self.radii[spheres], share, off / np.maximum(distance, 1e-6)[:, None]

    def _heights(self, path: Floats, legs: Ints, shares: Floats) -> tuple[Floats, Floats]:
        """Return the heights of points on legs above the required height, m, and their positions (n, 3)."""
        points = path[legs] + shares[:, None] * (path[legs + 1] - path[legs])
        assert self.terrain is not None
        ground = self.terrain.height(points[:, 0], points[:, 1])
        return points[:, 2] - np.where(np.isnan(ground), 1e4, ground) - self.above, points

    def constraints(self, x: Floats, near: Near) -> tuple[Floats, Floats]:
        """Return the constraints' values (c,) and their derivatives (c, 3 w).

        A value is in units or cosines, and 0 or more if the constraint is met.
        """
        path = self.path(x)
        count = len(path) - 1
        values, rows = [], []
        distance, share, normal = self._sphere_distances(path, near.legs, near.spheres)
        values.append(distance)
        rows.append(self._on_legs(count, near.legs, (1.0 - share)[:, None] * normal, share[:, None] * normal))
        height, points = self._heights(path, near.ground_legs, near.ground_shares)
        values.append(height)
        # Slope of the ground, by central differences.
        assert self.terrain is not None
        ground, east, north = self.terrain.height, points[:, 0], points[:, 1]
        by_east = ground(east + DIFFERENCE, north) - ground(east - DIFFERENCE, north)
        by_north = ground(east, north + DIFFERENCE) - ground(east, north - DIFFERENCE)
        ground_slope = np.nan_to_num(np.column_stack([by_east, by_north]) / (2.0 * DIFFERENCE))
        slope = np.column_stack([-ground_slope, np.ones(len(points))])
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
        # Cosines of the turns, scaled by a unit of length.
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
        """Return derivatives (n, 3 w) of values that each depend on the two ends of a leg."""
        out = np.zeros((len(legs), count + 1, 3))
        rows = np.arange(len(legs))
        out[rows, legs] += of_first
        out[rows, legs + 1] += of_second
        return out.reshape(len(legs), 3 * (count + 1))

    def shortened(self, path: Floats) -> Floats:
        """Shorten a path (w, 3) with SLSQP."""
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


def evenly(route: Floats, count: int) -> Floats:
    """Return waypoints (count, 3) at equal distances along a route (k, 3)."""
    runs = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(route, axis=0) ** 2).sum(axis=1)))])
    at = np.linspace(0.0, runs[-1], count)
    return np.column_stack([np.interp(at, runs, route[:, axis]) for axis in range(3)])


def smooth_search(task: Task, route_count: int = ROUTE_COUNT, plans: int = PLANS) -> tuple[float, Floats | None]:
    """Return length ratio and waypoints (w, 3) of the best certified path; inf and None without one.

    route_count: number of lattice routes to shorten, each from waypoints at equal distances and from others next to
        them.
    plans: number of plans of the algorithm without grids (`fda`) to shorten, too, for sides that the lattice misses.
    """
    programme, count = Programme(task), task.encoding.waypoints
    rng = np.random.default_rng(1)
    starts = []
    for route in lattice_routes(task)[:route_count]:
        even = evenly(route, count)
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
