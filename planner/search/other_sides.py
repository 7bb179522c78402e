"""Other sides of the obstacles: routes that the cheapest grid routes do not take, fitted and worked on.

A grid says which side is shorter only as well as it sees gaps.  So a grid that sees obstacles smaller than they are
proposes a route for each choice of sides; each gets a path and a little work, and those that are promising more of it,
also while they still violate something: what is shorter and nearly safe is worth more than what is safe already.
"""

import math

import numpy as np
from numpy.typing import NDArray

from planner.airspace.airspace_arrays import is_limited
from planner.evaluation.encoding import rotated_frame, rotated_vectors
from planner.search.score_table import LENGTH
from planner.search.search_state import Search
from planner.seeding.pattern_search import merits, search_patterns
from planner.seeding.side_routes import optimistic_grid, side_routes
from planner.seeding.waypoint_fitting import QUICK, fit_waypoints, tighten

Floats = NDArray[np.float64]

# Stages of the grids; shares of a step by which they look at the ground, have places across, and see spheres smaller.
STAGES, SPREAD, RATIO, SHRINKS = 50, 0.2, 1.0 / 3.0, (0.2, 0.5)
# Routes of one grid, and what they may cost: over the best path, or where none is safe over the straight line.  Grids
# know few courses, and their routes are longer by some percent.
MOST_ROUTES, SLACK, MOST_DETOUR = 4, 1.08, 1.8
# Paths that go on into each round of work; the rounds and the first move with which it moves all their waypoints, the
# evaluations of its pattern search, and how much a price may be above the length of the best path, as shares of the
# straight line.
ROUNDS = ((4, 1.0, 150, math.inf), (1, 0.5, 500, 0.005))
TIGHTENING = 2
# A best path that is longer than the straight line by less than this share has no other side worth looking for.
LEAST_DETOUR = 0.004
# Paths whose waypoints are nearer to each other than this on average, as a share of the straight line, are one.
SAME = 0.004


def search_other_sides(search: Search) -> None:
    """Follow routes on other sides than those of the best path; the archive takes what comes of them."""
    encoding, space, data = search.encoding, search.problem.space, search.problem.search
    frame = rotated_frame(space.start, space.destination)
    straight, found_one = math.dist(space.start, space.destination), has_safe(search)
    length = float(search.archive.scores[0][LENGTH]) if found_one else MOST_DETOUR
    if is_limited(data.airspace) or length < 1.0 + LEAST_DETOUR:
        return
    bound = straight * (SLACK * length if found_one else MOST_DETOUR)
    span = (float(encoding.lower[1::3].min()), float(encoding.upper[1::3].max()))
    paths = []
    for shrink in SHRINKS:
        grid = optimistic_grid(data, frame, span, STAGES, shrink=shrink, spread=SPREAD, ratio=RATIO)
        for route in side_routes(data, frame, grid, bound, MOST_ROUTES):
            if search.over():
                return
            path = fit_waypoints(data, frame, route.points, encoding.waypoints, QUICK)
            paths.append(rotated_vectors(space, encoding, path[None])[0])
    if paths:
        _work_on(search, np.array(paths), list(search.archive.vectors[:1]) if found_one else [])


def has_safe(search: Search) -> bool:
    """Whether a path is known that violates nothing and is exposed to no missile."""
    return len(search.archive.scores) > 0 and search.best_is_safe()


def _work_on(search: Search, vectors: Floats, known: list[Floats]) -> None:
    """Rounds of work on paths, fewer in each.

    known: vectors (d,) of paths that have been worked on.
    """
    prices = merits(search.score(vectors))
    for count, scale, evaluations, above in ROUNDS:
        worked = []
        for row in _promising(search, vectors, prices, count, above, known):
            if search.over():
                return
            worked.append(_worked_on(search, vectors[row], scale, evaluations))
        if not worked:
            return
        vectors = np.array([item[0] for item in worked])
        prices = np.array([item[1] for item in worked])


def _promising(
    search: Search, vectors: Floats, prices: Floats, count: int, above: float, known: list[Floats]
) -> list[int]:
    """Rows of the cheapest paths, up to `count`, near neither each other nor the known ones, and not much dearer."""
    near = SAME * math.dist(search.problem.space.start, search.problem.space.destination)
    most = search.archive.scores[0][LENGTH] + above if has_safe(search) else math.inf
    seen = list(known)
    chosen: list[int] = []
    for row in np.argsort(prices, kind="stable"):
        if len(chosen) == count or prices[row] > most:
            break
        places = vectors[row].reshape(-1, 3)[:, 1:]
        if all(np.abs(places - other.reshape(-1, 3)[:, 1:]).max(axis=1).mean() >= near for other in seen):
            seen.append(vectors[row])
            chosen.append(int(row))
    return chosen


def _worked_on(search: Search, vector: Floats, scale: float, evaluations: int) -> tuple[Floats, float]:
    """The cheapest path that work on one came to, and its price; the archive takes those that are safe too."""
    data = search.problem.search
    vector, spent = tighten(data, search.encoding, vector, TIGHTENING, scale)
    found, made = search_patterns(data, search.encoding, vector, evaluations)
    scores = search.evaluate(found)
    search.evaluations += made - len(found) + spent
    prices = merits(scores)
    row = int(np.argmin(prices))
    return found[row], float(prices[row])
