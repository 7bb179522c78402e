"""Find starting points of a seeded search.

These are the straight line, grid routes, other sides, and routes that turn back.

Waypoints are fitted to one grid route after another, and the paths are improved; the best becomes the seed of the
population. A grid estimates the length of a route past an obstacle only as well as it resolves gaps. Grids with reduced
obstacles therefore propose one route for each choice of sides, and shortening decides which are safe and short.

A path in the straight frame cannot turn back. If it contains no safe path, or only a long one, a lattice search finds a
route that may turn back or circle to climb; paths in a frame along this route are fitted and improved in the same way.
"""

import itertools
import math
from contextlib import suppress

import numpy as np

from planner.airspace.zone_limits import is_limited
from planner.evaluation.certify import certify
from planner.evaluation.encoding import (
    require_frames,
    rotated_frame,
    rotated_vectors,
    route_encoding,
    sample_route,
)
from planner.evaluation.problem import ProblemArrays
from planner.plan import Certificate, Violation
from planner.search.search_state import (
    LOW_BUFFER_M,
    Search,
    SearchEnded,
    are_safe,
    best_first,
    with_low_buffer,
    with_narrow_margins,
)
from planner.seeding.airspace_grids import airspace_routes
from planner.seeding.grids import GridRoute, grid_routes
from planner.seeding.lattice import (
    MAX_EXPANDED,
    MAX_GUIDED_EXPANDED,
    ceiling_route,
    lattice_route,
    make_lattice,
    turning_step,
)
from planner.seeding.shortening import resample, shorten_path
from planner.seeding.side_routes import close_places, optimistic_grid, side_routes
from planner.seeding.waypoint_fitting import CLOSE_FIT, QUICK_FIT, fit_points, fit_waypoints
from world.arrays import Floats
from world.geometry import leg_runs, path_length

# Maximum evaluations of the pattern search on a quickly fitted path.
QUICK_SEARCH_EVALUATIONS = 50
# Maximum evaluations of the pattern search on a seed.
SEED_SEARCH_EVALUATIONS = 300
# Factor on both numbers of evaluations below a maximum height above ground, where few moves stay within the band.
BAND_EFFORT_FACTOR = 3
# Number of routes followed once a path is safe; after them other sides are tried.
MAX_FOLLOWED_ROUTES = 2


def try_straight_line(search: Search) -> bool:
    """Try the straight line; return True if it is safe, which ends the search, because no path is shorter.

    Encodings other than "rotated" do not try it, and return False.
    """
    if search.encoding.name != "rotated":
        return False
    vectors = search.straight_vectors()
    if are_safe(search.score(vectors)[0]):
        search.evaluate(vectors)
        return search.meets_goal(search.best_certified()[1])
    # Equal legs are the longest possible between ends close together. They are tried only if nothing but short legs
    # violates a constraint: the certificate allows shorter legs than scores.
    vectors = search.straight_vectors(has_equal_legs=True)
    scores = search.score(vectors)[0]
    scores[Violation.TURN] = 0.0
    path = np.ascontiguousarray(search.encoding.decode(vectors)[0])
    if not (are_safe(scores) and search.keep_if_finished(path, certify(search.problem, path))):
        return False
    search.evaluate(vectors)
    return True


def starting_vectors(search: Search, grids: tuple[tuple[int, int], ...], previous: Floats | None) -> Floats:
    """Return the vectors from which a search starts, (n, d): one seed and the previous path, if any.

    grids: number of stages and number of routes of each grid.
    previous: older path (w, 3), or None.

    Seeds are the archive's best path and paths that are fitted to routes over the grids. Only the seed with the best
    result after improvement is used, because a distribution that is fitted to several routes describes none of them.
    The seed is returned in its form before the improvement: afterwards it is so close to every limit that hardly any
    sample around it is feasible.

    There are no vectors for an encoding other than "rotated", nor for an algorithm that is not seeded and has no
    previous path.
    """
    encoding, space, waypoint_count = search.encoding, search.problem.space, search.encoding.waypoints
    if encoding.name != "rotated" or (not search.algorithm.seeded and previous is None):
        return np.empty((0, encoding.lower.size))
    frame, starts = rotated_frame(space.start, space.destination), list(search.archive.vectors[:1])
    previous_vectors = [] if previous is None else list(rotated_vectors(space, encoding, previous[None]))
    starts += previous_vectors
    improved_scores = [search.improve(vector, SEED_SEARCH_EVALUATIONS) for vector in starts]
    airspace = search.problem.search.airspace
    effort_factor = BAND_EFFORT_FACTOR if math.isfinite(airspace.max_height) else 1
    is_among_zones = is_limited(airspace)
    # Among zones `search_other_sides` does not apply: all routes are followed.
    max_followed = math.inf if is_among_zones else MAX_FOLLOWED_ROUTES
    if search.can_shorten and search.algorithm.optimiser == "waypoints":
        max_followed = 0
    for index, route in enumerate(_list_routes(search, grids) if search.algorithm.seeded else ()):
        if search.must_end() or search.first_safe_found() or (index >= max_followed and search.best_is_safe()):
            break
        path = fit_waypoints(search.problem.search, frame, route.points, waypoint_count)
        starts.append(rotated_vectors(space, encoding, path[None])[0])
        improved_scores.append(search.improve(starts[-1], SEED_SEARCH_EVALUATIONS * effort_factor))
    if not starts:
        return np.empty((0, encoding.lower.size))
    order = best_first(np.array(improved_scores))
    return np.array([starts[order[0]], *previous_vectors])


def _list_routes(search: Search, grids: tuple[tuple[int, int], ...]) -> list[GridRoute]:
    """Return the routes over the grids, best first.

    grids: as in `starting_vectors`.

    The order is by the scores of paths that are quickly fitted to the routes; each of these paths is inserted into the
    archive at once. As soon as a path is safe, and if routes may be shortened, the following routes are only shortened
    and are not returned.
    """
    encoding, space, data = search.encoding, search.problem.space, search.problem.search
    if search.progress is not None:
        search.progress(search.done, search.done + search.problem.scenario.planner.generations, "grid routes")
    frame = rotated_frame(space.start, space.destination)
    span = (float(encoding.lower[1::3].min()), float(encoding.upper[1::3].max()))
    candidates, scores = [], []
    should_shorten = search.can_shorten and search.algorithm.optimiser == "waypoints" and not search.first_safe
    is_among_zones = is_limited(data.airspace)
    routes = (
        airspace_routes(data, frame, span, grids, search.check_stop)
        if is_among_zones
        else grid_routes(data, frame, span, grids, search.check_stop)
    )
    for route in routes:
        if should_shorten and search.has_safe():
            search.shorten(resample(frame.to_world(route.points), encoding.waypoints))
            if search.must_end():
                break
            continue
        candidates.append(route)
        fitted_path = fit_waypoints(data, frame, route.points, encoding.waypoints, QUICK_FIT)
        vectors = rotated_vectors(space, encoding, fitted_path[None])
        scores.append(search.evaluate(vectors)[0])
        if not search.first_safe_found():
            scores[-1] = search.improve(vectors[0], QUICK_SEARCH_EVALUATIONS)
        if search.must_end() or search.first_safe_found():
            break
    if not candidates:
        return []
    return [candidates[k] for k in best_first(np.array(scores))]


# --- Other sides of the obstacles ---

# Size of the area of highest ground, as a fraction of a step.
GROUND_SPREAD_STEPS = 0.2
# Grids: number of stages, reduction of the spheres, and spacing across as a fraction of a step. A route runs at up to
# 63 degrees to the direct line: a smaller angle would block paths near the ends. The most optimistic grid comes first:
# the later one is closed where shortening has found its routes' gaps too narrow.
GRIDS = ((50, 0.5, 2.0 / 3.0), (50, 0.2, 2.0 / 3.0))
# Finer grids, with steeper and with more courses, used if no path is safe or the best path is long, as there is much to
# gain.
FINER_GRIDS = ((80, 0.7, 1.0), (80, 0.3, 0.5))
# Excess over the straight line above which a path is long, as a fraction.
LONG_PATH_EXCESS_FRACTION = 0.06
# Steps of routes at the altitude of the ceiling, m; they are tried together with the finer grids, as they may turn
# back.
CEILING_STEPS = (250.0, 150.0, 100.0)
# Depths to which routes at the ceiling may enter missiles' spheres, m.
CEILING_DEPTHS_M = (15.0, 40.0)
# Average distance from an earlier path below which a path is not tried again, m.
SAME_PATH_DISTANCE_M = 20.0
# Maximum number of routes per grid.
MAX_ROUTES = 8
# Maximum cost of a route relative to the best path. With few courses, grid routes are some percent too long.
MAX_COST_RATIO = 1.08
# Maximum cost of a route relative to the straight line if no path is safe.
MAX_DETOUR_RATIO = 1.8
# Excess over the straight line, as a fraction, below which no other side is tried.
MIN_DETOUR_FRACTION = 0.004
# Maximum repetitions of shortening from equidistant waypoints.
MAX_REPEATS = 3
# Minimum gain for another repetition, as a fraction of the length.
MIN_GAIN_FRACTION = 2e-5


def search_other_sides(search: Search) -> None:
    """Shorten the best path, and routes past other sides of the obstacles; keep what is safe and shorter.

    Other sides are not tried if there are zones or a maximum height, or if the best path is hardly longer than the
    straight line. More grids are tried if the best path is long or none is safe.
    """
    if not len(search.archive.scores):
        # A search needs a result, even if the grids have no route.
        search.evaluate(search.straight_vectors())
    if search.can_shorten and search.has_safe():
        shorten_best(search)
    length = search.length_ratio() if search.has_safe() else MAX_DETOUR_RATIO
    if is_limited(search.problem.search.airspace) or length < 1.0 + MIN_DETOUR_FRACTION:
        return
    tried_paths = _try_grids(search, GRIDS)
    if not search.has_safe() or search.length_ratio() > 1.0 + LONG_PATH_EXCESS_FRACTION:
        tried_paths += _try_grids(search, FINER_GRIDS)
        # Routes at the altitude of the ceiling, one for each step of the lattice and for each depth by which it may
        # enter missiles' spheres. A route close to an earlier one is left out.
        frame = rotated_frame(search.problem.space.start, search.problem.space.destination)
        ceiling_paths: list[Floats] = []
        for step, depth in itertools.product(CEILING_STEPS, CEILING_DEPTHS_M):
            if search.must_end():
                break
            data = _close_narrow_places(search, step, step + depth)
            route = ceiling_route(data, frame, step, depth, search.check_stop)
            if not len(route):
                continue
            path = resample(route, search.encoding.waypoints)
            distances = [np.sqrt(((path - other) ** 2).sum(axis=1)).mean() for other in ceiling_paths]
            if min(distances, default=math.inf) > SAME_PATH_DISTANCE_M:
                ceiling_paths.append(path)
                search.shorten(path)
        tried_paths += ceiling_paths
    if not search.has_safe():
        # No path is safe with the usual margins: shorten the tried ones with narrow margins.
        usual_problem = search.problem
        search.problem = with_narrow_margins(usual_problem)
        try:
            for path in tried_paths:
                if search.must_end():
                    break
                search.shorten(path)
        finally:
            # Also restored if the search is interrupted, which raises SearchEnded.
            search.problem = usual_problem


def _try_grids(search: Search, grids: tuple[tuple[int, float, float], ...]) -> list[Floats]:
    """Shorten the routes that grids propose past other sides of obstacles; return the routes (w, 3).

    grids: as in `GRIDS`: number of stages, reduction of the spheres, and spacing across as a fraction of a step.

    Places where a shortened path remains too close to a missile are closed in later grids.
    """
    encoding, space, data = search.encoding, search.problem.space, search.problem.search
    frame = rotated_frame(space.start, space.destination)
    span = (float(encoding.lower[1::3].min()), float(encoding.upper[1::3].max()))
    tried_paths: list[Floats] = []
    for stages, shrink, ratio in grids:
        grid = optimistic_grid(data, frame, span, stages, shrink=shrink, spread=GROUND_SPREAD_STEPS, ratio=ratio)
        step = frame.length / grid.stages
        closed_data = _close_narrow_places(search, step, (1.0 + shrink) * step - data.kill_margin)
        for route in side_routes(closed_data, frame, grid, _max_route_cost(search), MAX_ROUTES, search.check_stop):
            if route.cost > _max_route_cost(search):
                break
            if search.must_end():
                return tried_paths
            tried_paths.append(resample(frame.to_world(route.points), encoding.waypoints))
            search.shorten(tried_paths[-1])
    return tried_paths


def _max_route_cost(search: Search) -> float:
    """Return the cost, m, above which a route of a grid is not shortened.

    It is a little more than the length of the best safe path, or a multiple of the straight line without such a path.
    """
    ratio = MAX_COST_RATIO * search.length_ratio() if search.has_safe() else MAX_DETOUR_RATIO
    return ratio * math.dist(search.problem.space.start, search.problem.space.destination)


def _close_narrow_places(search: Search, step: float, kill_radius: float) -> ProblemArrays:
    """Return the data of a search with a sphere at each narrow place, which keeps grid routes out of it.

    step: step of the grid or lattice, m; a place within a step of a closed place is not closed again.
    kill_radius: radius of the sphere that closes a place, m. It is large enough that no route steps over the sphere.

    Narrow places are those where a shortened path has come too close to a missile.
    """
    data, places = search.problem.search, list[Floats]()
    for place in search.narrow_places:
        if all(math.dist(place, other) > step for other in places):
            places.append(place)
    return close_places(data, np.array(places), kill_radius) if places else data


def shorten_best(search: Search) -> None:
    """Shorten the archive's best path; then repeat with equal legs while this makes the path shorter."""
    search.shorten(search.encoding.decode(search.archive.vectors[:1])[0])
    for _ in range(MAX_REPEATS):
        if search.shortest is None or search.must_end():
            return
        previous_length = path_length(search.shortest[0])
        search.shorten(resample(search.shortest[0], search.encoding.waypoints))
        search.shorten(search.shortest[0])
        if path_length(search.shortest[0]) > (1.0 - MIN_GAIN_FRACTION) * previous_length:
            return


# --- Routes that turn back ---

# Length of a safe path relative to the straight line above which a path that turns back may be shorter.
LONG_DETOUR_RATIO = 1.25
# Smallest number of waypoints of a path that may turn back: two turns lead away from the straight line, and two back.
MIN_TURNING_WAYPOINTS = 6
# Lattice steps as fractions of the step that turns require, tried until a path is safe.
LATTICE_STEP_FRACTIONS = (1.0, 0.6)
# Maximum length of a followed route as a fraction of the best safe path.
MAX_ROUTE_FRACTION = 0.99
# Number of pattern searches that improve a path along a route before shortening.
FIRST_SEARCH_COUNT = 4
# Evaluations of each of these pattern searches.
FIRST_SEARCH_EVALUATIONS = 500
# Evaluations of the pattern search after each move of all waypoints.
LATER_SEARCH_EVALUATIONS = 600
# Scales of the moves of all waypoints relative to the moves of fitting.
MOVE_SCALES = (1.0, 0.5, 0.25, 0.12)
# Rounds of each move.
MOVE_ROUNDS = 4
# Additional margins, m, with which a path is shortened and followed if no shortened path is certified.
FOLLOWED_MARGINS_M = (2.0, 5.0, 2.0)


def may_turn_back(search: Search, certificate: Certificate) -> bool:
    """Return True if a path that turns back may be better than the best path along the straight line.

    certificate: certificate of the best path along the straight line.

    This may be the case if that path is not safe or is long. It is not tried with too few waypoints, with an algorithm
    without seeds, with an encoding other than "rotated", or if the search must end.
    """
    if not search.algorithm.seeded or search.encoding.name != "rotated" or search.must_end():
        return False
    if search.encoding.waypoints < MIN_TURNING_WAYPOINTS:
        return False
    if not search.meets_goal(certificate):
        return True
    return search.length_ratio() > LONG_DETOUR_RATIO


def search_turning_back(search: Search, best: tuple[Floats, Certificate]) -> tuple[Floats, Certificate]:
    """Search for a path along a route that may turn back; return the better of it and `best`.

    best: best path so far, with its certificate.

    The route is found on a lattice of places and courses. If no path along it is safe, a second search on the lattice
    follows, with a better estimate of the remaining length, and with a lower buffer above the ground if the usual
    buffer is high.
    """
    best, is_complete = _search_lattices(search, best, is_guided=False)
    usual_problem, has_high_buffer = search.problem, search.problem.search.buffer > LOW_BUFFER_M
    if search.meets_goal(best[1]) or search.must_end() or (is_complete and not has_high_buffer):
        return best
    search.problem = with_low_buffer(usual_problem) if has_high_buffer else usual_problem
    try:
        return _search_lattices(search, best, is_guided=True)[0]
    finally:
        search.problem = usual_problem


def _search_lattices(
    search: Search, best: tuple[Floats, Certificate], *, is_guided: bool
) -> tuple[tuple[Floats, Certificate], bool]:
    """Search along the cheapest routes over lattices, from coarse to fine, until a path is safe.

    best: best path so far, with its certificate.
    is_guided: True for an estimate of the remaining length that knows obstacles and slopes, so that the search reaches
        further with the same number of states.

    Returns the better of the new path and `best`, with its certificate, and True if the lattices did not use up the
    number of states that may be visited.
    """
    data, space = search.problem.search, search.problem.space
    frame, step = rotated_frame(space.start, space.destination), turning_step(data)
    lattices = [make_lattice(data, frame, step_fraction * step) for step_fraction in LATTICE_STEP_FRACTIONS]
    remaining_states = MAX_GUIDED_EXPANDED if is_guided else MAX_EXPANDED
    for index, step_fraction in enumerate(LATTICE_STEP_FRACTIONS):
        # If memory limits the step, a smaller step gives the same lattice again.
        if remaining_states <= 0 or search.must_end() or lattices[index] in lattices[:index]:
            break
        # If no path along a coarse route is safe, a guided search finds a finer route with fewer states.
        if index and not is_guided and len(search.lattice_routes[0, False][0]) and not search.meets_goal(best[1]):
            break
        key = index, is_guided
        try:
            if key not in search.lattice_routes:
                search.lattice_routes[key] = lattice_route(
                    data, frame, step_fraction * step, search.check_stop, remaining_states, is_guided=is_guided
                )
        except SearchEnded:
            break
        route, expanded_count = search.lattice_routes[key]
        remaining_states -= expanded_count
        # A path cannot follow a route with more points than it has waypoints.
        if not len(route) or len(route) > search.encoding.waypoints:
            continue
        is_safe = search.meets_goal(best[1])
        if is_safe and path_length(route) > MAX_ROUTE_FRACTION * path_length(best[0]):
            break
        path, certificate, is_shortened = _search_along_route(search, route)
        if not search.meets_goal(certificate):
            # The route itself may be safe, with its points as waypoints.
            route_path = halve_longest_legs(route, search.encoding.waypoints)
            route_certificate = certify(search.problem, route_path)
            if search.meets_goal(route_certificate):
                path, certificate = route_path, route_certificate
        if search.meets_goal(certificate) and (not is_safe or path_length(path) < path_length(best[0])):
            best = (path, certificate) if is_shortened else _follow_shortened(search, (path, certificate))
            break
        if not is_safe and (certificate.ok, certificate.kill_distance) > (
            best[1].ok,
            best[1].kill_distance,
        ):
            best = path, certificate
    return best, remaining_states > 0


def halve_longest_legs(path: Floats, count: int) -> Floats:
    """Halve the longest leg of a path (w, 3) repeatedly until it has `count` waypoints; return the path."""
    waypoints = [np.asarray(point, dtype=np.float64) for point in path]
    while len(waypoints) < count:
        longest_leg = int(np.argmax(leg_runs(np.array(waypoints))))
        waypoints.insert(longest_leg + 1, 0.5 * (waypoints[longest_leg] + waypoints[longest_leg + 1]))
    return np.array(waypoints)


def _follow_shortened(search: Search, best: tuple[Floats, Certificate]) -> tuple[Floats, Certificate]:
    """Shorten the best path, safe or not, and search for a safe path along the result.

    This is done with several margins in turn. Returns the best safe path found if it is shorter than `best`, otherwise
    `best`, each with its certificate.
    """
    if not search.can_shorten:
        return best
    for extra_margin in FOLLOWED_MARGINS_M:
        if search.must_end():
            break
        path = resample(best[0], search.encoding.waypoints)
        route, evaluations = shorten_path(search.problem.search, path, extra_margin=extra_margin, corners_too=True)
        search.evaluations += evaluations
        path, certificate, _ = _search_along_route(search, route)
        if search.meets_goal(certificate) and path_length(path) < path_length(best[0]):
            best = path, certificate
    return best


def _search_along_route(search: Search, route: Floats) -> tuple[Floats, Certificate, bool]:
    """Search for a path along a route (k, 3), with one waypoint on each piece of the route.

    Waypoints are fitted to the route, improved and shortened in a separate search, with frames along the route. Returns
    the best path, its certificate, and True if shortening found a finished path.
    """
    waypoints = search.encoding.waypoints
    piece_ends, _ = sample_route(route, waypoints - 1)
    encoding = route_encoding(search.problem.space, piece_ends[:, :2])
    inner_search = Search(
        search.problem,
        search.algorithm,
        encoding,
        search.rng,
        search.progress,
        search.stop_condition,
        search.first_safe,
        search.required_distance,
        search.improved,
        evaluations=search.evaluations,
    )
    frames = require_frames(encoding)
    # Candidates for each inner waypoint lie on its piece of the route, in the waypoints' frames.
    count = encoding.waypoints - 2
    dense_points, _ = sample_route(route, count * (CLOSE_FIT.candidates + 1) + 1)
    point_rows = np.arange(count)[:, None] * (CLOSE_FIT.candidates + 1) + 1 + np.arange(CLOSE_FIT.candidates)
    points = frames.to_frame(dense_points[point_rows].transpose(1, 0, 2)).transpose(1, 0, 2)
    points[..., 0] = np.clip(points[..., 0], frames.edges[:-1, None], frames.edges[1:, None])
    path = fit_points(inner_search.problem.search, frames, points, CLOSE_FIT)
    vector = np.clip(frames.to_frame(path[1:-1]).ravel(), encoding.lower, encoding.upper)
    with suppress(SearchEnded):
        _improve_and_shorten(inner_search, vector, (path, route))
    search.evaluations, search.end_reason = inner_search.evaluations, inner_search.end_reason
    return *inner_search.best_path(), inner_search.shortest is not None


def _improve_and_shorten(search: Search, vector: Floats, routes: tuple[Floats, ...]) -> None:
    """Improve the path of a vector (d,); then shorten the best path and some routes (k, 3).

    The results are in the archive and in `search.shortest`.
    """
    search.evaluate(vector[None])
    for _ in range(FIRST_SEARCH_COUNT):
        if search.must_end() or search.first_safe_found():
            return
        search.improve(search.archive.vectors[0], FIRST_SEARCH_EVALUATIONS)
    for scale in MOVE_SCALES:
        if search.must_end() or search.first_safe_found():
            return
        search.move_and_improve(search.archive.vectors[0], MOVE_ROUNDS, scale, LATER_SEARCH_EVALUATIONS)
    if search.can_shorten:
        for route in routes:
            search.shorten(resample(route, search.encoding.waypoints))
        shorten_best(search)
