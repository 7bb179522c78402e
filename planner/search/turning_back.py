"""Paths that turn back, or go round to climb: searched for in a frame that follows a route, where a straight one fails.

The straight frame holds no path that gets further from the destination along the line to it.  A lattice search finds a
route that may; a frame along that route then holds paths about it, and they are fitted and tightened as elsewhere.
"""

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.encoding import Encoding, along_route, frames_of, rotated_frame
from planner.frames.waypoint_frames import spread_over
from planner.plan import Certificate
from planner.search.other_sides import shorten_best
from planner.search.search_state import Search, SearchEnded
from planner.seeding.lattice_routes import lattice_route, turning_step
from planner.seeding.path_shortening import evenly
from planner.seeding.waypoint_fitting import CLOSE, fit_points
from world.geometry import path_length

Floats = NDArray[np.float64]

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
