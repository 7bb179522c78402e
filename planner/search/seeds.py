"""What a seeded search starts from: the straight line where it is safe, or routes over grids, fitted and improved."""

import math
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from planner.airspace.zone_limits import is_limited
from planner.evaluation.encoding import Encoding, along_route, frames_of, rotated_frame, rotated_vectors, spread_over
from planner.plan import Certificate
from planner.search.search_state import Search, SearchEnded, best_first, safe
from planner.seeding.airspace_grids import airspace_routes
from planner.seeding.grids import GridRoute, grid_routes
from planner.seeding.lattice import lattice_route, turning_step
from planner.seeding.shortening import evenly
from planner.seeding.side_routes import optimistic_grid, side_routes
from planner.seeding.waypoint_fitting import CLOSE, QUICK, fit_points, fit_waypoints
from world.geometry import path_length

Floats = NDArray[np.float64]


# Evaluations that a quick path and each seed are improved with by a pattern search, at most.
QUICK_SEARCH, SEED_SEARCH = 50, 300
# Times as many for seeds where a path has to stay in a band of heights above ground: hardly a move keeps to it.
BAND_EFFORT = 3
# Routes that are followed once a path is safe: other sides are looked for next (`planner.search.seeds`).
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


# ----------------------------------------------------------------------
# Other sides of the obstacles: routes that the cheapest grid routes do not take, each shortened.
#
# A grid says which side is shorter only as well as it sees gaps.  So grids that see obstacles smaller than they are
# propose a route for each choice of sides, and each is shortened: what comes of it is safe and short, or it is not,
# and only then is it known what the side is worth.

# Stages of the grids; shares of a step by which they look at the ground, have places across, and see spheres smaller.
STAGES, SPREAD, RATIO, SHRINKS = 50, 0.2, 1.0 / 3.0, (0.2, 0.5)
# Routes of one grid, and what they may cost: over the best path, or where none is safe over the straight line.  Grids
# know few courses, and their routes are longer by some percent.
MAX_ROUTES, SLACK, MAX_DETOUR = 8, 1.08, 1.8
# A best path that is longer than the straight line by less than this share has no other side worth looking for.
MIN_DETOUR = 0.004
# Of a path shortened again, from waypoints at equal distances: times, and the least gain for another, as a share.
AGAIN, MIN_GAIN = 3, 2e-5


def search_other_sides(search: Search) -> None:
    """Shorten the best path, and routes on other sides than its own."""
    if search.shortens and search.has_safe():
        shorten_best(search)
    encoding, space, data = search.encoding, search.problem.space, search.problem.search
    frame = rotated_frame(space.start, space.destination)
    straight, found_one = math.dist(space.start, space.destination), search.has_safe()
    length = search.length_ratio() if found_one else MAX_DETOUR
    if is_limited(data.airspace) or length < 1.0 + MIN_DETOUR:
        return
    span = (float(encoding.lower[1::3].min()), float(encoding.upper[1::3].max()))
    for shrink in SHRINKS:
        grid = optimistic_grid(data, frame, span, STAGES, shrink=shrink, spread=SPREAD, ratio=RATIO)
        bound = straight * (SLACK * search.length_ratio() if search.has_safe() else MAX_DETOUR)
        for route in side_routes(data, frame, grid, bound, MAX_ROUTES):
            if search.over():
                return
            search.shorten(evenly(frame.restore(route.points), encoding.waypoints))


def shorten_best(search: Search) -> None:
    """Shorten the archive's best path, and the shortest again from waypoints at equal distances while that helps."""
    search.shorten(search.encoding.decode(search.archive.vectors[:1])[0])
    for _ in range(AGAIN):
        if search.shortest is None or search.over():
            return
        before = path_length(search.shortest[0])
        search.shorten(evenly(search.shortest[0], search.encoding.waypoints))
        search.shorten(search.shortest[0])
        if path_length(search.shortest[0]) > (1.0 - MIN_GAIN) * before:
            return


# ----------------------------------------------------------------------
# Paths that turn back, or go round to climb: searched for in a frame that follows a route, where a straight one
# fails.
#
# The straight frame holds no path that gets further from the destination along the line to it.  A lattice search
# finds a route that may; a frame along that route then holds paths about it, and they are fitted and tightened as
# elsewhere.

# A safe path this many times as long as the straight line may be longer than one that turns back.
LONG_WAY = 1.25
# Routes are over lattices of these steps, as shares of the step that turns need, until one is safe.
STEPS = (1.0, 0.6)
# A route is followed if it is shorter than this share of the best safe path.
WORTH = 0.99
# Searches at first, and evaluations of each and after each move of all waypoints, that a path along a route is improved
# with before it is shortened; and these moves, each of so many rounds, as shares of the first that fit it.
FIRST_SEARCHES, FIRST_SEARCH, LATER_SEARCH = 4, 500, 600
MOVES, ROUNDS = (1.0, 0.5, 0.25, 0.12), 4


def may_turn_back(search: Search, certificate: Certificate) -> bool:
    """Whether a path that turns back is to be looked for: the straight frame held no safe one, or a long one."""
    if not search.algorithm.seeded or search.encoding.name != "rotated" or search.over():
        return False
    if not search.finished(certificate):
        return True
    return search.length_ratio() > LONG_WAY


def search_turning_back(search: Search, found: tuple[Floats, Certificate]) -> tuple[Floats, Certificate]:
    """The path (w, 3) along a route that may turn back and its certificate, if that is better; else what was found."""
    data, space = search.problem.search, search.problem.space
    frame, step = rotated_frame(space.start, space.destination), turning_step(data)
    for share in STEPS:
        if search.over():
            break
        try:
            route = lattice_route(data, frame, share * step, search.pause)
        except SearchEnded:
            break
        if not len(route):
            continue
        safe_already = search.finished(found[1])
        if safe_already and path_length(route) > WORTH * path_length(found[0]):
            break
        path, certificate = _search_along(search, route)
        if search.finished(certificate) and (not safe_already or path_length(path) < path_length(found[0])):
            return path, certificate
        if not safe_already and (certificate.ok, certificate.kill_distance) > (found[1].ok, found[1].kill_distance):
            found = path, certificate
    return found


def _search_along(search: Search, route: Floats) -> tuple[Floats, Certificate]:
    """The best path that was found in a frame along a route (k, 3), and its certificate."""
    waypoints = search.encoding.waypoints
    pieces, _ = spread_over(route, waypoints - 1)
    encoding = along_route(search.problem.space, pieces[:, :2])
    inner = Search(
        search.problem, search.algorithm, encoding, search.rng, search.progress, search.stop, search.first_safe,
        search.wanted, search.improved, evaluations=search.evaluations,
    )  # fmt: skip
    path = fit_points(inner.problem.search, frames_of(encoding), _places(route, encoding), CLOSE)
    vector = np.clip(frames_of(encoding).rotate(path[1:-1]).ravel(), encoding.lower, encoding.upper)
    with suppress(SearchEnded):
        _improve_along(inner, vector, (path, route))
    search.evaluations, search.ended = inner.evaluations, inner.ended
    return inner.best_path()


def _improve_along(inner: Search, vector: Floats, ways: tuple[Floats, ...]) -> None:
    """Work on the path of a vector (d,), then shorten it and ways (k, 3): a bound climb either may end short of."""
    inner.evaluate(vector[None])
    for _ in range(FIRST_SEARCHES):
        if inner.over() or inner.safe_already():
            return
        inner.improve(inner.archive.vectors[0], FIRST_SEARCH)
    for scale in MOVES:
        if inner.over() or inner.safe_already():
            return
        inner.tighten(inner.archive.vectors[0], ROUNDS, scale, LATER_SEARCH)
    if inner.shortens:
        for way in ways:
            inner.shorten(evenly(way, inner.encoding.waypoints))
        shorten_best(inner)


def _places(route: Floats, encoding: Encoding) -> Floats:
    """Places (w - 2, places, 3) on a route (k, 3), those of each waypoint in its frame: within its piece of the way."""
    count = encoding.waypoints - 2
    dense, _ = spread_over(route, count * (CLOSE.places + 1) + 1)
    rows = np.arange(count)[:, None] * (CLOSE.places + 1) + 1 + np.arange(CLOSE.places)
    frames = frames_of(encoding)
    places = frames.rotate(dense[rows].transpose(1, 0, 2)).transpose(1, 0, 2)
    places[..., 0] = np.clip(places[..., 0], frames.edges[:-1, None], frames.edges[1:, None])
    return places
