"""Zones and the greatest height above ground as the paper's algorithms take a constraint: a count of violations."""

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.airspace_scores import airspace_excess
from planner.evaluation.paper_scores import POINTS
from planner.evaluation.problem_arrays import ProblemArrays
from world.kernels import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def airspace_counts(data: ProblemArrays, paths: Floats) -> Ints:
    """How many pieces of the legs of paths (n, w, 3), six a leg, are in a zone or too high over the ground; (n,).

    The paper counts places, six a leg, and has no zones; between two places a path could pass through one.  Pieces
    are looked at all along.

    >>> from planfly.airframe import load_airframe
    >>> from planner.evaluation.problem import make_problem
    >>> from world.scenario import load_scenario
    >>> from world.scenario_variants import with_zones
    >>> from world.airspace.zone_tables import ZoneTable
    >>> mill = ZoneTable(name="mill", kind="exclusion", east_m=1300.0, north_m=0.0, radius_m=100.0)
    >>> scenario = with_zones(load_scenario("tight"), [mill], "mills")
    >>> problem = make_problem(scenario, load_airframe(scenario).limits)
    >>> airspace_counts(problem.search, np.stack([scenario.start, scenario.destination])[None])
    array([2])
    """
    return _count_pieces(data, np.ascontiguousarray(paths))


@compiled
def _count_pieces(data: ProblemArrays, paths: Floats) -> Ints:  # pragma: no cover - compiled
    number, waypoints, _ = paths.shape
    counts = np.zeros(number, np.int64)
    a, b = np.empty(3), np.empty(3)
    for k in range(number):
        for i in range(waypoints - 1):
            for piece in range(POINTS):
                for axis in range(3):
                    step = paths[k, i + 1, axis] - paths[k, i, axis]
                    a[axis] = paths[k, i, axis] + step * piece / POINTS
                    b[axis] = paths[k, i, axis] + step * (piece + 1) / POINTS
                if airspace_excess(data, a, b, 0.0, 0.0) > 0.0:
                    counts[k] += 1
    return counts
