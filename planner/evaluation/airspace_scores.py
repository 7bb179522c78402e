"""What the airspace adds to the scores: depths in zones, and above the greatest height over the ground; or counts.

A leg is looked at with the widest that a flight may be beside it, its corners' included; only where that is not enough,
in parts.
"""

import math

import numpy as np
from numpy.typing import NDArray

from planner.airspace.zone_depths import zone_excess
from planner.evaluation.clearance_buffer import RequiredClearance, required_below
from planner.evaluation.height_lags import below_at
from planner.evaluation.paper_scores import POINTS
from planner.evaluation.problem_arrays import ProblemArrays
from planner.evaluation.strayed_pieces import ENDS
from planner.evaluation.terrain_clearance import segment_pixels, terrain_excess
from world.kernels import Record, Records, compiled, inlined

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Where a leg is cut for the lag of its height, in lengths of the lag.
_LAG_CUTS = (0.0, 1.0, 2.5)
# A line further beside a leg than this (m) is looked at by itself.
_BESIDE = 0.5


@compiled
def add_airspace_violations(
    data: ProblemArrays,
    path: Floats,
    legs: Records,
    corners: Records,
    flown: Records,
    lags: Records,
    violations: Record,
) -> None:  # pragma: no cover - compiled
    """Add to a `VIOLATIONS` record how deep a path (w, 3) is in zones (bounds), and how far too high (terrain), m x km.

    legs, corners, flown, lags: of the path, as measured.
    """
    zoned, topped = data.airspace.zones.kept.shape[0] > 0, data.airspace.max_height < math.inf
    required = required_below(data)
    a, b = np.empty(3), np.empty(3)
    last = legs.shape[0] - 1
    across = float(data.tracking.across)
    for i in range(last + 1):
        before, after = float(flown[i].fly_by_offset), float(flown[i + 1].fly_by_offset)
        below, above = float(lags[i].most), -float(lags[i].least)
        if topped:
            violations.terrain += _too_high(data, required, path[i], path[i + 1], legs[i], lags[i], across)
        wide = max(before, after)
        if zoned and _zone_excess(data, path[i], path[i + 1], across + wide, below, above) > 0.0:
            first = min(1.0, ENDS / max(legs[i].run, 1e-6)) if i == 0 else 0.0
            final = max(first, 1.0 - ENDS / max(legs[i].run, 1e-6)) if i == last else 1.0
            for share, until, beside in ((0.0, first, 0.0), (first, final, across), (final, 1.0, 0.0)):
                if until > share:
                    _cut(path[i], path[i + 1], share, until, a, b)
                    violations.bounds += _zone_excess(data, a, b, beside, below, above)
        else:
            wide = 0.0
        for width, length, share in ((before, corners[i].after, 0.0), (after, corners[i + 1].before, 1.0)):
            if width <= 0.0:
                continue
            part = min(1.0, length / max(legs[i].run, 1e-6))
            _cut(path[i], path[i + 1], max(0.0, share - part), min(1.0, share + part), a, b)
            if zoned and wide > 0.0:
                violations.bounds += _zone_excess(data, a, b, across + width, below, above)
            if topped:
                more = max(0.0, -below_at(lags[i], share), -below_at(lags[i], abs(share - part)))
                violations.terrain += _beside_too_high(data, required, a, b, across + width, more)


@compiled
def airspace_excess(
    data: ProblemArrays, a: Floats, b: Floats, below: float, above: float
) -> float:  # pragma: no cover - compiled
    """How deep a leg by itself is in zones, and how far too high over the ground, summed along it: m x km.

    below, above: how far from the leg a flight may be, m.
    """
    total, across = 0.0, float(data.tracking.across)
    if data.airspace.zones.kept.shape[0] > 0:
        total += _zone_excess(data, a, b, across, below, above)
    if data.airspace.max_height < math.inf:
        total += _beside_too_high(data, required_below(data), a, b, across, above)
    return total


@compiled
def _zone_excess(
    data: ProblemArrays, a: Floats, b: Floats, beside: float, below: float, above: float
) -> float:  # pragma: no cover - compiled
    zones = data.airspace.zones
    return zone_excess(zones, data.heights, data.to_pixel, data.sample_pitch, a, b, beside, below, above)


@compiled
def _too_high(
    data: ProblemArrays, required: RequiredClearance, a: Floats, b: Floats, leg: Record, lag: Record, across: float
) -> float:  # pragma: no cover - compiled
    """How far a leg is too high over the ground, summed along it: m x km."""
    if not data.tracking.strays:
        return _beside_too_high(data, required, a, b, 0.0, 0.0)
    total, one, two = 0.0, np.empty(3), np.empty(3)
    for k in range(len(_LAG_CUTS)):
        share = min(1.0, _LAG_CUTS[k] / max(1e-9, lag.decay))
        until = min(1.0, _LAG_CUTS[k + 1] / max(1e-9, lag.decay)) if k + 1 < len(_LAG_CUTS) else 1.0
        if until > share:
            _cut(a, b, share, until, one, two)
            above = max(0.0, -below_at(lag, share), -below_at(lag, until))
            total += _beside_too_high(data, required, one, two, across, above)
    return total


@compiled
def _beside_too_high(
    data: ProblemArrays, required: RequiredClearance, a: Floats, b: Floats, beside: float, above: float
) -> float:  # pragma: no cover - compiled
    """The most that a line and those beside it are too high over the ground, summed along them: m x km."""
    run = max(1e-9, math.hypot(b[0] - a[0], b[1] - a[1]))
    east, north = beside * (b[1] - a[1]) / run, -beside * (b[0] - a[0]) / run
    most = 0.0
    for side in (0.0, -1.0, 1.0):
        if side != 0.0 and beside < _BESIDE:
            break
        x, y, x2, y2 = a[0] + side * east, a[1] + side * north, b[0] + side * east, b[1] + side * north
        ends = segment_pixels(data.to_pixel, x, y, x2, y2)
        depths, bounds = data.airspace.depths, data.slope_bounds
        most = max(most, terrain_excess(depths, bounds, required, above, ends, x, y, -a[2], x2, y2, -b[2]))
    return most


@inlined
def _cut(a: Floats, b: Floats, share: float, until: float, one: Floats, two: Floats) -> None:  # pragma: no cover
    """Fill in the ends of the part of a-b between two shares of it."""
    for axis in range(3):
        one[axis] = a[axis] + share * (b[axis] - a[axis])
        two[axis] = a[axis] + until * (b[axis] - a[axis])


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
