"""What a seeded search starts from: the straight line where it is safe, or routes over grids, fitted and improved."""

import math

import numpy as np
from numpy.typing import NDArray

from planner.airspace.airspace_arrays import is_limited
from planner.evaluation.encoding import rotated_frame, rotated_vectors
from planner.search.score_table import best_first, safe
from planner.search.search_state import Search
from planner.seeding.airspace_routes import airspace_routes
from planner.seeding.grid_routes import GridRoute, grid_routes
from planner.seeding.path_shortening import evenly
from planner.seeding.waypoint_fitting import QUICK, fit_waypoints

Floats = NDArray[np.float64]

# Evaluations that a quick path and each seed are improved with by a pattern search, at most.
QUICK_SEARCH, SEED_SEARCH = 50, 300
# Times as many for seeds where a path has to stay in a band of heights above ground: hardly a move keeps to it.
BAND_EFFORT = 3
# Routes that are followed once a path is safe: other sides are looked for next (`planner.search.other_sides`).
FOLLOWED = 2


def straight_line(search: Search) -> bool:
    """Whether the straight line is a safe path: no path is shorter, and there is nothing to search for."""
    encoding, space = search.encoding, search.problem.space
    if encoding.name != "rotated":
        return False
    edges = encoding.lower[0::3], encoding.upper[0::3]
    share = 0.5 * (edges[0] + edges[1]) / edges[1][-1]
    path = space.start + np.concatenate([[0.0], share, [1.0]])[:, None] * (space.destination - space.start)
    vectors = rotated_vectors(space, encoding, path[None])
    scores = search.score(vectors)
    if not safe(scores[0]):
        return False
    search.evaluate(vectors)
    return search.finished(search.best_certified()[1])


def starting_vectors(search: Search, grids: tuple[tuple[int, int], ...], previous: Floats | None) -> Floats:
    """Vectors (n, d) that a search starts from: the seed that comes out best when improved, and the older path.

    Marginals over several routes at once fit none of them: one leads.  It leads as it was: improved it stands so close
    to every limit that hardly a sample near it keeps them.
    """
    encoding, space, waypoints = search.encoding, search.problem.space, search.encoding.waypoints
    if encoding.name != "rotated" or (not search.algorithm.seeded and previous is None):
        return np.empty((0, encoding.lower.size))
    frame, starts = rotated_frame(space.start, space.destination), list(search.archive.vectors[:1])
    older = [] if previous is None else list(rotated_vectors(space, encoding, previous[None]))
    starts += older
    improved_scores = [search.improve(vector, SEED_SEARCH) for vector in starts]
    airspace = search.problem.search.airspace
    effort = BAND_EFFORT if math.isfinite(airspace.max_height) else 1
    # Among zones no other sides are looked for: all the routes are followed.
    followed = math.inf if is_limited(airspace) else FOLLOWED
    if search.shortens and search.algorithm.optimiser == "waypoints":
        followed = 0
    for number, route in enumerate(_routes(search, grids) if search.algorithm.seeded else ()):
        if search.over() or search.safe_already() or (number >= followed and search.best_is_safe()):
            break
        path = fit_waypoints(search.problem.search, frame, route.points, waypoints)
        starts.append(rotated_vectors(space, encoding, path[None])[0])
        improved_scores.append(search.improve(starts[-1], SEED_SEARCH * effort))
    if not starts:
        return np.empty((0, encoding.lower.size))
    order = best_first(np.array(improved_scores))
    return np.array([starts[order[0]], *older])


def _routes(search: Search, grids: tuple[tuple[int, int], ...]) -> list[GridRoute]:
    """The grids' routes; the archive takes a path that is quickly fitted to each as soon as it is found.

    Those with the best such paths come first.
    """
    encoding, space, data = search.encoding, search.problem.space, search.problem.search
    if search.progress is not None:
        search.progress(search.done, search.done + search.problem.scenario.planner.generations, "grid routes")
    frame = rotated_frame(space.start, space.destination)
    span = (float(encoding.lower[1::3].min()), float(encoding.upper[1::3].max()))
    found, scores = [], []
    followed_free = search.shortens and search.algorithm.optimiser == "waypoints" and not search.first_safe
    routes = airspace_routes if is_limited(data.airspace) else grid_routes
    for route in routes(data, frame, span, grids):
        if followed_free and search.has_safe():
            search.shorten(evenly(frame.restore(route.points), encoding.waypoints))
            if search.over():
                break
            continue
        found.append(route)
        path = fit_waypoints(data, frame, route.points, encoding.waypoints, QUICK)
        vectors = rotated_vectors(space, encoding, path[None])
        scores.append(search.evaluate(vectors)[0])
        if not search.safe_already():
            scores[-1] = search.improve(vectors[0], QUICK_SEARCH)
        if search.over() or search.safe_already():
            break
    if not found:
        return []
    return [found[k] for k in best_first(np.array(scores))]
