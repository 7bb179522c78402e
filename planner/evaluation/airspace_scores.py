"""Zones and the maximum height above ground: violations for the search, margins for the certificate.

A search adds to a path's scores how deep its legs penetrate zones (bounds) and how far they exceed the maximum height
above ground (terrain), both in m x km; the paper's scores count pieces of legs instead. Each leg is first tested as a
whole with the largest lateral deviation of the flight, corners included, and cut into parts only where that test fails.
A certificate measures the distance from each zone and the maximum height above ground of every piece of the path.
"""

import math

import numpy as np

from planner.airspace.zone_distances import ZONE_MARGIN, measure_zone_margin, zone_excess
from planner.evaluation.certify_kernels import ENDS, TRACKED_PIECE, required_buffer, tracked_pieces
from planner.evaluation.corners import ARC_STEP, blended_vertices, fly_by_radii, half_blend_length
from planner.evaluation.paper_scores import POINTS
from planner.evaluation.problem import ProblemArrays, RequiredClearance, required_headroom
from planner.evaluation.terrain_clearance import lag_at, segment_pixels, terrain_excess
from world.arrays import Floats, Ints
from world.kernels import Record, Records, compiled, copy_into, inlined, inner
from world.terrain import segment_clearance

# --- Margins for the certificate ---


# Margins of one piece of a leg or of a corner, with its number: its margin to zones; its greatest height above ground
# (m, NaN off the terrain, -inf if no maximum applies); and the buffer required below that maximum (m).
AIRSPACE_PIECE = np.dtype(
    [
        ("of_corner", np.bool_),
        ("number", np.int64),
        ("zones", ZONE_MARGIN),
        ("height", np.float64),
        ("buffer", np.float64),
    ],
    align=True,
)
# Sagitta of an arc over its chord, as a share of the radius.
_SAGITTA = 1.0 - math.cos(0.5 * ARC_STEP)
# Maximum number of pieces of one arc.
_MAX_PIECES = math.ceil(math.pi / ARC_STEP) + 2


@compiled
def airspace_pieces(data: ProblemArrays, waypoints: Floats) -> Records:
    """Return `AIRSPACE_PIECE` records for the legs of a path (w, 3), followed by those for its corners."""
    pieces = (
        tracked_pieces(data, waypoints) if data.tracking.has_error else _pieces_without_tracking_error(data, waypoints)
    )
    out = np.zeros(pieces.size, dtype=AIRSPACE_PIECE)
    space, lateral = data.airspace, np.zeros(2)
    for k in range(pieces.size):
        piece = pieces[k]
        lateral[0], lateral[1] = piece.lateral_begin, piece.lateral_end
        measure_zone_margin(
            space.zones,
            data.heights,
            space.depths,
            data.to_pixel,
            piece.begin,
            piece.end,
            lateral,
            piece.below,
            piece.above,
            out[k].zones,
        )
        out[k].of_corner, out[k].number, out[k].height = piece.of_corner, piece.number, -math.inf
        if space.max_height < math.inf:
            out[k].height = _greatest_height(data, piece)
            ends = space.start_buffer, space.destination_buffer
            out[k].buffer = required_buffer(data, space.buffer, ends, piece.begin, piece.end)
    return out


@inner
def _pieces_without_tracking_error(data: ProblemArrays, waypoints: Floats) -> Records:
    """Return `TRACKED_PIECE` records for a path without tracking error, first its legs, then the chords of its arcs."""
    last, radii = waypoints.shape[0] - 1, fly_by_radii(data, waypoints)
    out = np.zeros(last + last * _MAX_PIECES, dtype=TRACKED_PIECE)
    for i in range(last):
        out[i].number = i
        copy_into(out[i].begin, waypoints[i])
        copy_into(out[i].end, waypoints[i + 1])
    made = last
    mirrored = waypoints.copy()
    for i in range(last + 1):
        mirrored[i, 2] = -waypoints[i, 2]
    for i in range(1, last):
        blend = half_blend_length(data.aircraft, waypoints[i, 2])
        low = blended_vertices(blend, waypoints[i - 1], waypoints[i], waypoints[i + 1], radii[i])
        # The same for the mirrored path: an upper bound on the flown height.
        high = blended_vertices(blend, mirrored[i - 1], mirrored[i], mirrored[i + 1], radii[i])
        for k in range(max(1, low.shape[0] - 1)):
            after, piece = min(k + 1, low.shape[0] - 1), out[made]
            piece.of_corner, piece.number = True, i
            copy_into(piece.begin, low[k])
            copy_into(piece.end, low[after])
            piece.above = max(0.0, -high[k, 2] - low[k, 2], -high[after, 2] - low[after, 2])
            piece.lateral_begin, piece.lateral_end = radii[i] * _SAGITTA, radii[i] * _SAGITTA
            made += 1
    return out[:made]


@inner
def _greatest_height(data: ProblemArrays, piece: Record) -> float:
    """Return the maximum height above ground along a piece and on both sides of it, m, or NaN off the terrain."""
    dx, dy = piece.end[0] - piece.begin[0], piece.end[1] - piece.begin[1]
    run, greatest = max(1e-9, math.hypot(dx, dy)), -math.inf
    a, b = np.empty(3), np.empty(3)
    for side in (0.0, -1.0, 1.0):
        for end, at, lateral in ((a, piece.begin, piece.lateral_begin), (b, piece.end, piece.lateral_end)):
            end[0] = at[0] + side * lateral * dy / run
            end[1] = at[1] - side * lateral * dx / run
            end[2] = -(at[2] + piece.above)
        mirrored, _ = segment_clearance(data.airspace.depths, data.to_pixel, a, b)
        greatest = math.nan if math.isnan(mirrored) or math.isnan(greatest) else max(greatest, -mirrored)
    return greatest


# --- Violations for the search ---

# Where a leg is cut because its height lags, in lag lengths.
_LAG_CUTS = (0.0, 1.0, 2.5)
# Lines offset from a leg by more than this (m) are tested separately.
_MIN_OFFSET = 0.5


@inner
def add_airspace_violations(
    data: ProblemArrays,
    path: Floats,
    legs: Records,
    corners: Records,
    flown: Records,
    lags: Records,
    violations: Record,
) -> None:
    """Add zone penetration (bounds) and excess height (terrain) of a path (w, 3) to a `VIOLATIONS` record, m x km.

    legs, corners, flown, lags: measurements of the path.
    """
    zoned, topped = data.airspace.zones.required.shape[0] > 0, data.airspace.max_height < math.inf
    required = required_headroom(data)
    a, b = np.empty(3), np.empty(3)
    last = legs.shape[0] - 1
    across = float(data.tracking.across)
    for i in range(last + 1):
        before, after = float(flown[i].fly_by_offset), float(flown[i + 1].fly_by_offset)
        below, above = float(lags[i].max_below), -float(lags[i].min_below)
        if topped:
            violations.terrain += _leg_excess_height(data, required, path[i], path[i + 1], legs[i], lags[i], across)
        wide = max(before, after)
        if zoned and _leg_zone_penetration(data, path[i], path[i + 1], across + wide, below, above) > 0.0:
            first = min(1.0, ENDS / max(legs[i].run, 1e-6)) if i == 0 else 0.0
            final = max(first, 1.0 - ENDS / max(legs[i].run, 1e-6)) if i == last else 1.0
            for share, until, lateral in ((0.0, first, 0.0), (first, final, across), (final, 1.0, 0.0)):
                if until > share:
                    _cut_segment(path[i], path[i + 1], share, until, a, b)
                    violations.bounds += _leg_zone_penetration(data, a, b, lateral, below, above)
        else:
            wide = 0.0
        for width, length, share in ((before, corners[i].after, 0.0), (after, corners[i + 1].before, 1.0)):
            if width <= 0.0:
                continue
            part = min(1.0, length / max(legs[i].run, 1e-6))
            _cut_segment(path[i], path[i + 1], max(0.0, share - part), min(1.0, share + part), a, b)
            if zoned and wide > 0.0:
                violations.bounds += _leg_zone_penetration(data, a, b, across + width, below, above)
            if topped:
                more = max(0.0, -lag_at(lags[i], share), -lag_at(lags[i], abs(share - part)))
                violations.terrain += _swath_excess_height(data, required, a, b, across + width, more, math.inf)


@inner
def airspace_excess(data: ProblemArrays, a: Floats, b: Floats, below: float, above: float, enough: float) -> float:
    """Return the zone penetration and the excess height above ground of a leg, each integrated along the leg, m x km.

    below, above: vertical tracking error, m.
    enough: value beyond which the integration stops.
    """
    total, across = 0.0, float(data.tracking.across)
    if data.airspace.zones.required.shape[0] > 0:
        total += _leg_zone_penetration(data, a, b, across, below, above)
    if data.airspace.max_height < math.inf:
        total += _swath_excess_height(data, required_headroom(data), a, b, across, above, enough - total)
    return total


@inner
def _leg_zone_penetration(
    data: ProblemArrays, a: Floats, b: Floats, lateral: float, below: float, above: float
) -> float:
    zones = data.airspace.zones
    return zone_excess(zones, data.heights, data.to_pixel, data.sample_pitch, a, b, lateral, below, above)


@inner
def _leg_excess_height(
    data: ProblemArrays, required: RequiredClearance, a: Floats, b: Floats, leg: Record, lag: Record, across: float
) -> float:
    """Return a leg's excess over the maximum height above ground, height lag included, m x km."""
    if not data.tracking.has_error:
        return _swath_excess_height(data, required, a, b, 0.0, 0.0, math.inf)
    total, one, two = 0.0, np.empty(3), np.empty(3)
    for k in range(len(_LAG_CUTS)):
        share = min(1.0, _LAG_CUTS[k] / max(1e-9, lag.decay))
        until = min(1.0, _LAG_CUTS[k + 1] / max(1e-9, lag.decay)) if k + 1 < len(_LAG_CUTS) else 1.0
        if until > share:
            _cut_segment(a, b, share, until, one, two)
            above = max(0.0, -lag_at(lag, share), -lag_at(lag, until))
            total += _swath_excess_height(data, required, one, two, across, above, math.inf)
    return total


@inner
def _swath_excess_height(
    data: ProblemArrays, required: RequiredClearance, a: Floats, b: Floats, lateral: float, above: float, enough: float
) -> float:
    """Return the largest excess over the maximum height, among a line and the lines offset to both sides, m x km.

    If the excess is larger than `enough`, return a lower bound that is larger than `enough`, too.
    """
    run = max(1e-9, math.hypot(b[0] - a[0], b[1] - a[1]))
    east, north = lateral * (b[1] - a[1]) / run, -lateral * (b[0] - a[0]) / run
    largest = 0.0
    for side in (0.0, -1.0, 1.0):
        if side != 0.0 and lateral < _MIN_OFFSET:
            break
        x, y, x2, y2 = a[0] + side * east, a[1] + side * north, b[0] + side * east, b[1] + side * north
        ends = segment_pixels(data.to_pixel, x, y, x2, y2)
        depths, bounds = data.airspace.depths, data.slope_bounds
        excess = terrain_excess(depths, bounds, required, above, ends, x, y, -a[2], x2, y2, -b[2], enough)
        largest = max(largest, excess)
        if largest > enough:
            break
    return largest


@inlined
def _cut_segment(
    a: Floats, b: Floats, share: float, until: float, one: Floats, two: Floats
) -> None:  # pragma: no cover
    """Fill `one` and `two` with the ends of the part of a-b between two fractions of its length."""
    for axis in range(3):
        one[axis] = a[axis] + share * (b[axis] - a[axis])
        two[axis] = a[axis] + until * (b[axis] - a[axis])


def airspace_counts(data: ProblemArrays, paths: Floats) -> Ints:
    """Count the leg pieces, six per leg, that violate a zone or the maximum height in each path (n, w, 3), (n,).

    The paper counts points, six per leg, and has no zones; a path could pass through a zone between two points, so
    pieces are tested along their full length.

    >>> from planfly.workflow.airframe import load_airframe
    >>> from planner.evaluation.problem import make_problem
    >>> from world.scenario import load_scenario
    >>> from world.scenario import with_zones
    >>> from world.scenario_tables import ZoneTable
    >>> mill = ZoneTable(name="mill", kind="exclusion", east_m=1300.0, north_m=0.0, radius_m=100.0)
    >>> scenario = with_zones(load_scenario("tight"), [mill], "mills")
    >>> problem = make_problem(scenario, load_airframe(scenario).limits)
    >>> airspace_counts(problem.search, np.stack([scenario.start, scenario.destination])[None])
    array([2])
    """
    return _count_pieces(data, np.ascontiguousarray(paths))


@compiled
def _count_pieces(data: ProblemArrays, paths: Floats) -> Ints:
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
                if airspace_excess(data, a, b, 0.0, 0.0, math.inf) > 0.0:
                    counts[k] += 1
    return counts
