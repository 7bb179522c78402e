"""Find reference paths of fresh instances: screen all sides of a fine lattice, and polish the best paths.

Like the planner, the reference keeps the certificate's distance from missiles wherever any of its paths does.

`benchmarks.planning.lattice_search.lattice_routes` proposes hundreds of combinations of sides of the missiles
(the planner: some 15), without a frame, without stages and with all heights; then the paths found are cut and joined
with each other.  Each is shortened in a millisecond or two, by the planner's own shortening but with the
certificate's margins, which are smaller than the margins of the planner's search. If limits are in degrees, the
shortest are polished by SciPy's SLSQP (`benchmarks.planning.smooth_search`), which shares nothing with the planner.
"""

import math
from dataclasses import replace

import numpy as np

from benchmarks.planning.lattice_search import lattice_routes
from benchmarks.planning.smooth_search import Programme
from benchmarks.task import Task, is_safe
from planner.evaluation.certify import required_kill_distance
from planner.evaluation.problem import SEARCH_KILL_MARGIN_M
from planner.seeding.shortening import resample, shorten_path
from world.arrays import Floats

# Number of lattice routes.
ROUTE_COUNT = 400
# Additional margins with which each route is shortened, m.
MARGINS = (0.1, 2.0, 5.0)
# Number of shortest paths that are polished.
POLISHED = 5
# Smallest difference in length between distinct paths, as a fraction.
APART = 1e-4
# Margin of the search in addition to the certificate's margins, m.
SPARE = 0.5
# Number of paths that are cut and joined with each other.
POOL = 12
# Rounds of joining.
ROUNDS = 2
# Distance within which paths can be joined, m.
NEAR = 300.0


def reference_search(task: Task) -> tuple[float, Floats | None]:
    """Return length ratio and waypoints (w, 3) of the best certified path; inf and None without one.

    Paths closer to missiles than the planner's goal allows count only if all paths are.
    """
    # Nearly the certificate's margins in the search; the planner's own margins are larger.
    problem, certified, search = task.problem, task.problem.certified, task.problem.search
    tight = search._replace(
        kill_margin=certified.kill_margin + (search.kill_margin - SEARCH_KILL_MARGIN_M) + SPARE,
        buffer=min(search.buffer, certified.buffer + SPARE),
        start_buffer=min(search.start_buffer, certified.start_buffer + SPARE),
        destination_buffer=min(search.destination_buffer, certified.destination_buffer + SPARE),
    )
    task = replace(task, problem=replace(problem, search=tight))
    routes, best = lattice_routes(task, ROUTE_COUNT), (math.inf, None)
    for kill_distance in (required_kill_distance(task.problem), 0.0):
        best = best if best[1] is not None else _best_of_routes(task, routes, kill_distance)
    return best


def _best_of_routes(task: Task, routes: list[Floats], kill_distance: float) -> tuple[float, Floats | None]:
    """Return length ratio and waypoints of the best path near routes.

    The path keeps a distance from missiles, m.
    """
    pool = [found for route in routes if (found := _screened(task, route, kill_distance)) is not None]
    for _ in range(ROUNDS):
        pool = _distinct(pool)[:POOL]
        joined = [
            found
            for route in _joined([path for _, path in pool])
            if (found := _screened(task, route, kill_distance)) is not None
        ]
        if not joined or min(joined, key=lambda item: item[0])[0] >= pool[0][0]:
            break
        pool += joined
    pool = _distinct(pool)
    best: tuple[float, Floats | None] = pool[0] if pool else (math.inf, None)
    # The programme supports only limits in degrees.
    programme = None if task.problem.search.legs_hold_turns else Programme(task)
    if programme is None:
        return best
    for _, path in pool[:POLISHED]:
        shorter = programme.shortened(path)
        ratio = task.length_ratio(shorter)
        if ratio < best[0] and _is_certified(task, shorter, kill_distance):
            best = ratio, shorter
    return best


def _is_certified(task: Task, path: Floats, kill_distance: float) -> bool:
    """Return True if a path (w, 3) is safe and keeps a distance from missiles, m."""
    certificate = task.certificate(path)
    return is_safe(certificate) and certificate.kill_distance >= kill_distance


def _screened(task: Task, route: Floats, kill_distance: float) -> tuple[float, Floats] | None:
    """Shorten a route (k, 3); return length ratio and waypoints, or None if the result is not certified.

    kill_distance: required distance from missiles, m.
    """
    for margin in MARGINS:
        path = resample(route, task.encoding.waypoints)
        for _ in range(2):
            path, _ = shorten_path(task.problem.search, path, extra_margin=margin)
            if _is_certified(task, path, kill_distance):
                again, _ = shorten_path(task.problem.search, resample(path, len(path)), extra_margin=margin)
                shorter = task.length_ratio(again) < task.length_ratio(path)
                path = again if shorter and _is_certified(task, again, kill_distance) else path
                return task.length_ratio(path), path
    return None


def _distinct(pool: list[tuple[float, Floats]]) -> list[tuple[float, Floats]]:
    """Return the paths of different length, shortest first."""
    out: list[tuple[float, Floats]] = []
    for ratio, path in sorted(pool, key=lambda item: item[0]):
        if not out or ratio > (1.0 + APART) * out[-1][0]:
            out.append((ratio, path))
    return out


def _joined(paths: list[Floats]) -> list[Floats]:
    """Return paths that follow one path to a place near another path, and the other path from there on."""
    out = []
    for one in paths:
        for other in paths:
            if one is other:
                continue
            a, b = resample(one, 100), resample(other, 100)
            gaps = np.sqrt(((a[:, None] - b[None]) ** 2).sum(axis=2))
            near = gaps.min(axis=1) < NEAR
            # Once for each stretch along which they are near each other, but not before the first or after the last
            # one.
            middles = [
                int(run.mean()) for run in np.split(np.arange(100), np.flatnonzero(np.diff(near)) + 1) if near[run[0]]
            ]
            out += [np.concatenate([a[: at + 1], b[int(gaps[at].argmin()) + 1 :]]) for at in middles[1:-1]]
    return out
