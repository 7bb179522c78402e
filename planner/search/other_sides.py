"""Other sides of the obstacles: routes that the cheapest grid routes do not take, each shortened.

A grid says which side is shorter only as well as it sees gaps.  So grids that see obstacles smaller than they are
propose a route for each choice of sides, and each is shortened: what comes of it is safe and short, or it is not, and
only then is it known what the side is worth.
"""

import math

from planner.airspace.airspace_arrays import is_limited
from planner.evaluation.encoding import rotated_frame
from planner.search.search_state import Search
from planner.seeding.path_shortening import evenly
from planner.seeding.side_routes import optimistic_grid, side_routes
from world.geometry import path_length

# Stages of the grids; shares of a step by which they look at the ground, have places across, and see spheres smaller.
STAGES, SPREAD, RATIO, SHRINKS = 50, 0.2, 1.0 / 3.0, (0.2, 0.5)
# Routes of one grid, and what they may cost: over the best path, or where none is safe over the straight line.  Grids
# know few courses, and their routes are longer by some percent.
MOST_ROUTES, SLACK, MOST_DETOUR = 8, 1.08, 1.8
# A best path that is longer than the straight line by less than this share has no other side worth looking for.
LEAST_DETOUR = 0.004
# Of a path shortened again, from waypoints at equal distances: times, and the least gain for another, as a share.
AGAIN, LEAST_GAIN = 3, 2e-5


def search_other_sides(search: Search) -> None:
    """Shorten the best path, and routes on other sides than its own."""
    if search.shortens and search.has_safe():
        shorten_best(search)
    encoding, space, data = search.encoding, search.problem.space, search.problem.search
    frame = rotated_frame(space.start, space.destination)
    straight, found_one = math.dist(space.start, space.destination), search.has_safe()
    length = search.length_ratio() if found_one else MOST_DETOUR
    if is_limited(data.airspace) or length < 1.0 + LEAST_DETOUR:
        return
    span = (float(encoding.lower[1::3].min()), float(encoding.upper[1::3].max()))
    for shrink in SHRINKS:
        grid = optimistic_grid(data, frame, span, STAGES, shrink=shrink, spread=SPREAD, ratio=RATIO)
        bound = straight * (SLACK * search.length_ratio() if search.has_safe() else MOST_DETOUR)
        for route in side_routes(data, frame, grid, bound, MOST_ROUTES):
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
        if path_length(search.shortest[0]) > (1.0 - LEAST_GAIN) * before:
            return
