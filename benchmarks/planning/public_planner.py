"""Plan paths for the problems of Shehadeh and Kudela with the parts of planfly's planner.

The default planner finds sides of obstacles on a grid, and then samples the waypoints around it, where a dynamic
programme joins the samples in every combination (`planner.optimisers.niche_sampling`).  `plan_public` does the same
with the cost of `benchmarks.planning.public_instances`: a lattice of positions, generations of samples, and a Gaussian
with full covariance (`planner.optimisers.multistart`) for the rest of the budget.

It is not a black-box method: it reads the threats and the ground, and knows that the cost is a sum over legs but for
turns.  A leg that is computed counts as 1/11 of an evaluation, because a path has eleven legs, so that the budget is
the same amount of work.
"""

import itertools
import math
from collections.abc import Callable

import numpy as np

from benchmarks.planning.public_instances import (
    END_HEIGHT_M,
    HALF_RANGE_RAD,
    HEIGHT_WEIGHT,
    LENGTH_WEIGHT,
    MAX_HEIGHT_M,
    PLACES_PER_LEG,
    WAYPOINT_COUNT,
    PublicInstance,
    elevation_below,
    threat_cost,
)
from planner.optimisers.multistart import Gaussian
from planner.optimisers.niche_sampling import NicheSampling
from world.arrays import Floats, Ints
from world.kernels import compiled

# Fraction of the budget for the legs of both lattices.
LATTICE_FRACTION = 0.4
# Fraction of the budget for the legs of the generations of samples.
SAMPLE_FRACTION = 0.4
# Number of generations of samples.
GENERATION_COUNT = 15
# Standard deviation of the last generation of samples, in cells.
LAST_DEVIATION_CELLS = 0.5
# Standard deviation of heights in a generation of samples, in m for each cell of the deviation of positions.
HEIGHT_DEVIATION_PER_CELL = 0.5
# Height above the ground that a rise aims at, m.
HEIGHT_MARGIN_M = 0.1
# Standard deviation of the first Gaussian, as a fraction of the box.
GAUSSIAN_DEVIATION = 0.003
# Samples in a generation of a Gaussian.
GAUSSIAN_POPULATION = 20


@compiled
def needed_rise(leg: Floats, ground: Floats, rises: Floats) -> float:
    """Return the rise of the ends of a leg (2, 4), m, that keeps its places above the ground.

    The rise is infinite if the leg leaves the map, or if neither end can rise as needed.

    rises: 1 for an end that can rise, and 0 for the start and the end of the path.
    """
    rise = 0.0
    for k in range(PLACES_PER_LEG):
        share = k / (PLACES_PER_LEG - 1)
        east, north = leg[0, 0] + share * (leg[1, 0] - leg[0, 0]), leg[0, 1] + share * (leg[1, 1] - leg[0, 1])
        deficit = elevation_below(east, north, ground) - leg[0, 3] - share * (leg[1, 3] - leg[0, 3])
        if deficit >= 0.0:
            lift = (1.0 - share) * rises[0] + share * rises[1]
            rise = max(rise, (deficit + HEIGHT_MARGIN_M) / lift) if lift > 0.0 else math.inf
    return rise


@compiled
def leg_costs(
    froms: Floats, tos: Floats, ground: Floats, threats: Floats, limits: Floats, rises: Floats
) -> tuple[Floats, Floats, int]:
    """Return the costs of legs between places (n, 3) and (m, 3), and the number of computed legs.

    A place is east, north and height above ground.

    limits: longest leg in cells, the middle of the range of bearings, rad, and the highest rise, m; a longer leg
    costs infinity, as does a leg outside the range or steeper than 45 degrees that does not lead to the path's end.
    rises: see `needed_rise`.

    Returns the costs (n, m) without the ground, the costs with the rise that clears the ground, and the number.
    """
    plain, clear = np.full((len(froms), len(tos)), np.inf), np.full((len(froms), len(tos)), np.inf)
    computed, leg = 0, np.empty((2, 4))
    for i in range(len(froms)):
        for j in range(len(tos)):
            east, north, up = tos[j, 0] - froms[i, 0], tos[j, 1] - froms[i, 1], tos[j, 2] - froms[i, 2]
            level = math.hypot(east, north)
            if math.hypot(level, up) > limits[0] or (rises[1] > 0.0 and abs(up) > level):
                continue
            turn = math.atan2(east, north) - limits[1]
            if rises[1] > 0.0 and level > 0.0 and abs(math.atan2(math.sin(turn), math.cos(turn))) > HALF_RANGE_RAD:
                continue
            for k in range(2):
                place = froms[i] if k == 0 else tos[j]
                leg[k, 0], leg[k, 1] = place[0], place[1]
                leg[k, 3] = place[2] + ground[int(np.rint(place[1])) - 1, int(np.rint(place[0])) - 1]
            computed += 1
            heights = HEIGHT_WEIGHT * abs(tos[j, 2] - END_HEIGHT_M)
            plain[i, j] = LENGTH_WEIGHT * math.hypot(level, leg[1, 3] - leg[0, 3]) + threat_cost(leg, threats) + heights
            rise = needed_rise(leg, ground, rises)
            if rise <= limits[2]:
                clear[i, j] = plain[i, j] + HEIGHT_WEIGHT * rise
    return plain, clear, computed


def find_cheapest(layers: list[Floats]) -> tuple[Ints, list[Floats]]:
    """Find the cheapest chain that has one of n samples at each waypoint, by dynamic programming.

    layers: costs of the legs: from the start to each sample of the first waypoint, (1, n); then between all samples of
        each pair of waypoints, (n, n); then from each sample of the last waypoint to the end, (n, 1).

    Returns the sample of each waypoint in the cheapest chain, (w,), and for each waypoint the costs of the best chains
    through each of its samples, (n,).
    """
    forward = [layers[0][0]]
    for table in layers[1:-1]:
        forward.append((forward[-1][:, None] + table).min(axis=0))
    backward = [layers[-1][:, 0]]
    for table in layers[-2:0:-1]:
        backward.insert(0, (table + backward[0]).min(axis=1))
    through = [f + b for f, b in zip(forward, backward, strict=True)]
    chain = [int(np.argmin(through[-1]))]
    for k in range(len(forward) - 2, -1, -1):
        chain.insert(0, int(np.argmin(forward[k] + layers[k + 1][:, chain[0]])))
    return np.array(chain), through


def find_highest(places: Floats, ground: Floats, reach: int) -> Floats:
    """Return the highest place on the map within a number of cells of each place (n, 2)."""
    rows, columns = ground.shape
    highest = places.copy()
    for k, (east, north) in enumerate(places.astype(np.int64)):
        west, south = max(1, east - reach), max(1, north - reach)
        window = ground[south - 1 : min(rows - 1, north + reach), west - 1 : min(columns - 1, east + reach)]
        row, column = np.unravel_index(int(np.argmax(window)), window.shape)
        highest[k] = west + column, south + row
    return highest


class PublicPlan:
    """Search of the path of one instance.

    costs: function that returns the costs (n,) of vectors (n, 30), and counts them.
    """

    def __init__(self, instance: PublicInstance, costs: Callable[[Floats], Floats], rng: np.random.Generator) -> None:
        self._instance, self._costs, self._rng = instance, costs, rng
        self._middle = 0.5 * (instance.lower[2] + instance.upper[2])
        self._start, self._end = instance.start[None].copy(), instance.end[None].copy()
        self.legs = 0
        self.is_clear = True

    def _legs(self, froms: Floats, tos: Floats, max_rise: float = 0.0) -> tuple[Floats, Floats]:
        """Return the costs of legs without and with the ground; only the leg to the end may leave the box."""
        longest = math.inf if tos is self._end else float(self._instance.upper[0])
        rises = np.array([float(froms is not self._start), float(tos is not self._end)])
        limits = np.array([longest, self._middle, max_rise])
        plain, clear, computed = leg_costs(froms, tos, self._instance.ground, self._instance.threats, limits, rises)
        self.legs += computed
        return plain, clear

    def search_lattices(self, spacing: float) -> Floats:
        """Return the cheapest path (w, 3) on two lattices with a spacing in cells.

        The places of one lattice are the centres of its cells, those of the other the highest places near them.
        Also sets `is_clear`: True if the path clears the ground.
        """
        ground = self._instance.ground
        rows, columns = ground.shape
        axis_east = np.round(np.linspace(1.0, columns - 1.0, max(3, round(columns / spacing))))
        axis_north = np.round(np.linspace(1.0, rows - 1.0, max(3, round(rows / spacing))))
        centres: Floats = np.stack(np.meshgrid(axis_east, axis_north), axis=2).reshape(-1, 2).astype(np.float64)
        # Paths without regard for the ground, and clear of it: cost, True if clear, and path.
        candidates: list[tuple[float, bool, Floats]] = []
        for map_places in (centres, find_highest(centres, ground, int(0.5 * spacing))):
            places = np.insert(map_places, 2, END_HEIGHT_M, axis=1)
            first, middle, last = (
                self._legs(froms, tos, MAX_HEIGHT_M - END_HEIGHT_M)
                for froms, tos in ((self._start, places), (places, places), (places, self._end))
            )
            for kind in (0, 1):
                chain, through = find_cheapest([first[kind], *[middle[kind]] * (WAYPOINT_COUNT - 1), last[kind]])
                if not np.isfinite(through[0]).any():
                    continue
                path = places[chain].copy()
                if kind == 1:
                    # Waypoints rise as much as their legs need.
                    level, raised = (
                        np.array([first[k][0, chain[0]], *middle[k][chain[:-1], chain[1:]], last[k][chain[-1], 0]])
                        for k in (0, 1)
                    )
                    rises = (raised - level) / HEIGHT_WEIGHT
                    path[:, 2] += np.maximum(rises[:-1], rises[1:])
                candidates.append((float(self._costs(self.encode(path)[None])[0]), kind == 1, path))
        _, self.is_clear, path = min(candidates, key=lambda candidate: candidate[:2])
        return path

    def sample(self, path: Floats, count: int, deviation: float) -> Floats:
        """Improve a path (w, 3) by generations of samples of every waypoint, and return the best vector (30,)."""
        rows, columns = self._instance.ground.shape
        lowest, highest = (1.0, 1.0, END_HEIGHT_M), (columns - 1.0, rows - 1.0, MAX_HEIGHT_M)
        boxes = np.tile(lowest, (WAYPOINT_COUNT, 1)), np.tile(highest, (WAYPOINT_COUNT, 1))
        niches = NicheSampling(*boxes, lambda samples, _: np.ones(len(samples), dtype=bool), self._rng)
        shrinking = (LAST_DEVIATION_CELLS / deviation) ** (1.0 / (GENERATION_COUNT - 1))
        kind, elite, costs = int(self.is_clear), path, np.zeros((WAYPOINT_COUNT, 1))
        samples = path[:, None]
        best, least = self.encode(path), math.inf
        for generation in range(GENERATION_COUNT):
            spread = deviation * shrinking**generation * np.array([1.0, 1.0, HEIGHT_DEVIATION_PER_CELL])
            samples = niches.draw_next(samples, costs, count, spread, np.inf, elite)
            layers = [
                self._legs(self._start, samples[0])[kind],
                *(self._legs(froms, tos)[kind] for froms, tos in itertools.pairwise(samples)),
                self._legs(samples[-1], self._end)[kind],
            ]
            chain, through = find_cheapest(layers)
            costs = np.stack(through)
            if np.isfinite(costs).any():
                elite = samples[np.arange(WAYPOINT_COUNT), chain]
            vector = self.encode(elite)
            value = float(self._costs(vector[None])[0])
            if value < least:
                best, least = vector, value
        return best

    def encode(self, path: Floats) -> Floats:
        """Return the vector (30,) of a path (w, 3)."""
        steps = np.diff(np.concatenate([self._start, path]), axis=0)
        level = np.hypot(steps[:, 0], steps[:, 1])
        turn = np.where(level > 0.0, np.arctan2(steps[:, 0], steps[:, 1]) - self._middle, 0.0)
        bearing = self._middle + np.angle(np.exp(1j * turn))
        vector = np.stack([np.hypot(level, steps[:, 2]), np.arctan2(steps[:, 2], level), bearing], axis=1).ravel()
        return np.clip(vector, self._instance.lower, self._instance.upper)

    def refine(self, vector: Floats, spent: Callable[[], int], budget: int) -> None:
        """Search around a vector (30,) with Gaussians until the budget is spent.

        Each Gaussian starts from the best vector so far.
        """
        lower, width = self._instance.lower, self._instance.upper - self._instance.lower
        best, least = (vector - lower) / width, math.inf
        deviation = GAUSSIAN_DEVIATION
        while spent() < budget:
            search = Gaussian(best, deviation, GAUSSIAN_POPULATION)
            while not search.is_done and spent() < budget:
                points = search.draw(self._rng)
                values = self._costs(lower + points * width)
                order = np.argsort(values)
                if values[order[0]] < least:
                    best, least = points[order[0]].copy(), float(values[order[0]])
                search.update(points, values[:, None], _rank_values, self._rng.random(len(points)))
            deviation = GAUSSIAN_DEVIATION * 10.0 ** self._rng.uniform(-1.0, 1.0)


def _rank_values(scores: Floats) -> Ints:
    """Return the ranks (n,) of scores (n, 1); equal scores share the smallest rank."""
    return np.searchsorted(np.sort(scores[:, 0]), scores[:, 0])


def plan_public(
    instance: PublicInstance, costs: Callable[[Floats], Floats], budget: int, rng: np.random.Generator
) -> None:
    """Search the path of an instance within a budget of evaluations, legs included.

    costs: function that returns the costs (n,) of vectors (n, 30), and keeps the smallest one.
    """
    evaluated = 0

    def counted(vectors: Floats) -> Floats:
        """Return the costs of vectors, and count the evaluations."""
        nonlocal evaluated
        evaluated += len(vectors)
        return costs(vectors)

    plan = PublicPlan(instance, counted, rng)
    legs_per_path = WAYPOINT_COUNT + 1
    rows, columns = instance.ground.shape
    # Legs of one of the two lattices: one for each pair of places within a quarter of a circle.
    pairs = rows * columns * 0.25 * math.pi * float(instance.upper[0]) ** 2
    spacing = (pairs / (0.5 * LATTICE_FRACTION * legs_per_path * budget)) ** 0.25
    path = plan.search_lattices(spacing)
    sample_legs = SAMPLE_FRACTION * legs_per_path * budget / GENERATION_COUNT
    best = plan.sample(path, max(4, int(math.sqrt(sample_legs / (WAYPOINT_COUNT - 1)))), 0.5 * spacing)
    plan.refine(best, lambda: evaluated + plan.legs // legs_per_path, budget)
