"""Which waypoints a fly-by arc would miss: by more than the acceptance radius that the mission states there."""

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import Limits, turn_radius_between
from world.geometry import fly_by_offset, leg_courses, signed_turns

Floats = NDArray[np.float64]


def arc_misses(points: Floats, airspeed: Floats, acceptance: Floats, limits: Limits | None) -> NDArray[np.bool_]:
    """Whether the arc at the bank limit passes each waypoint beyond its acceptance radius, (w,).

    points: (w, 3) m.  airspeed: (w - 1,) m/s.  acceptance: (w,) m, 0 where none is stated, which no arc misses.
    limits: None where they are not known, and so no arc.
    A corner of ``turn`` is passed at R(1/cos(turn/2) - 1): at 25 m/s and 30 degrees of bank, R is 110 m, by 46 m at 90
    degrees, and by 110 m at 120.

    >>> from types import SimpleNamespace
    >>> from aircraft.path_limits import PerformanceTable
    >>> nothing = np.zeros(2)
    >>> table = PerformanceTable(25.0, 0.57735, 0.0, 0.0, 0.0, 0.0, 0.0, nothing, nothing, nothing)
    >>> limits = SimpleNamespace(performance=lambda airspeed: table)
    >>> corner = np.array([[0.0, 0.0, 500.0], [0.0, 1000.0, 500.0], [1000.0, 1000.0, 500.0]])
    >>> [arc_misses(corner, np.full(2, 25.0), np.array([0.0, m, 0.0]), limits).tolist()[1] for m in (0.0, 45.0, 46.0)]
    [False, True, False]
    """
    out = np.zeros(len(points), dtype=np.bool_)
    if limits is None:
        return out
    courses, turns = leg_courses(points), np.abs(signed_turns(points))
    tables = {float(speed): limits.performance(float(speed)) for speed in set(airspeed.tolist())}
    for i in np.flatnonzero(acceptance[1:-1] > 0.0) + 1:
        table = tables[float(max(airspeed[i - 1], airspeed[i]))]
        radius = turn_radius_between(table, courses[i - 1], courses[i], points[i, 2])
        # Where the wind leaves no way along a leg there is no arc to miss with.
        out[i] = np.isfinite(radius) and fly_by_offset(float(turns[i - 1]), float(radius)) > acceptance[i]
    return out
