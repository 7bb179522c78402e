"""Measure zones and the maximum height above ground.

The search uses violations, and the certificate margins.

A search adds two amounts to a path's scores, both in m·km: the depth of its legs in zones (to bounds), and their height
above the maximum height above ground (to terrain). The paper's scores count pieces of legs instead. Each leg is first
tested as a whole with the largest lateral deviation of the flight, corners included, and cut into parts only if that
test fails. A certificate measures the margins of every piece of the path.
"""

import math

import numpy as np

from planner.airspace.zone_distances import ZONE_MARGIN, measure_zone_margin, zone_penetration
from planner.evaluation.certify_kernels import END_DISTANCE_M, TRACKED_PIECE, required_buffer, tracked_pieces
from planner.evaluation.corners import ARC_STEP, blended_vertices, fly_by_radii, half_blend_length
from planner.evaluation.paper_scores import POINTS_PER_LEG
from planner.evaluation.problem import ProblemArrays, RequiredClearance, required_headroom
from planner.evaluation.terrain_clearance import clearance_deficit, lag_at, segment_pixels
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
# Sagitta of an arc over its chord, as a fraction of the radius.
_SAGITTA = 1.0 - math.cos(0.5 * ARC_STEP)
# Maximum number of pieces of one arc.
_MAX_PIECES = math.ceil(math.pi / ARC_STEP) + 2


@compiled
def airspace_pieces(data: ProblemArrays, waypoints: Floats) -> Records:
    """Measure the distance to zones and the height above ground of each piece of a path (w, 3).

    Returns `AIRSPACE_PIECE` records, first of its legs, then of its corners. The pieces are those of `tracked_pieces`
    for an autopilot with tracking error, and otherwise legs and chords of arcs.
    """
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
            out[k].height = _max_height_above_ground(data, piece)
            ends = space.start_buffer, space.destination_buffer
            out[k].buffer = required_buffer(data, space.buffer, ends, piece.begin, piece.end)
    return out


@inner
def _pieces_without_tracking_error(data: ProblemArrays, waypoints: Floats) -> Records:
    """Cut a path (w, 3) without tracking error into its legs and the chords of its arcs.

    Returns `TRACKED_PIECE` records, first of the legs. A chord lies below the flown arc; its deviations to the side and
    above enclose the arc.
    """
    leg_count, radii = waypoints.shape[0] - 1, fly_by_radii(data, waypoints)
    pieces = np.zeros(leg_count + leg_count * _MAX_PIECES, dtype=TRACKED_PIECE)
    for i in range(leg_count):
        pieces[i].number = i
        copy_into(pieces[i].begin, waypoints[i])
        copy_into(pieces[i].end, waypoints[i + 1])
    piece_count = leg_count
    mirrored = waypoints.copy()
    for i in range(leg_count + 1):
        mirrored[i, 2] = -waypoints[i, 2]
    for i in range(1, leg_count):
        blend = half_blend_length(data.aircraft, waypoints[i, 2])
        lower_vertices = blended_vertices(blend, waypoints[i - 1], waypoints[i], waypoints[i + 1], radii[i])
        # The mirrored path gives an upper bound on the flown height.
        upper_vertices = blended_vertices(blend, mirrored[i - 1], mirrored[i], mirrored[i + 1], radii[i])
        for k in range(max(1, lower_vertices.shape[0] - 1)):
            next_row, piece = min(k + 1, lower_vertices.shape[0] - 1), pieces[piece_count]
            piece.of_corner, piece.number = True, i
            copy_into(piece.begin, lower_vertices[k])
            copy_into(piece.end, lower_vertices[next_row])
            piece.above = max(
                0.0,
                -upper_vertices[k, 2] - lower_vertices[k, 2],
                -upper_vertices[next_row, 2] - lower_vertices[next_row, 2],
            )
            piece.lateral_begin, piece.lateral_end = radii[i] * _SAGITTA, radii[i] * _SAGITTA
            piece_count += 1
    return pieces[:piece_count]


@inner
def _max_height_above_ground(data: ProblemArrays, piece: Record) -> float:
    """Return the greatest height above ground of a flight along a piece, m; NaN off the terrain.

    piece: `TRACKED_PIECE` record, with the tracking error by which the flight may be above or beside the piece.
    """
    dx, dy = piece.end[0] - piece.begin[0], piece.end[1] - piece.begin[1]
    horizontal_length, max_height = max(1e-9, math.hypot(dx, dy)), -math.inf
    offset_start, offset_end = np.empty(3), np.empty(3)
    for side in (0.0, -1.0, 1.0):
        for end, point, lateral in (
            (offset_start, piece.begin, piece.lateral_begin),
            (offset_end, piece.end, piece.lateral_end),
        ):
            end[0] = point[0] + side * lateral * dy / horizontal_length
            end[1] = point[1] - side * lateral * dx / horizontal_length
            end[2] = -(point[2] + piece.above)
        negated_height, _ = segment_clearance(data.airspace.depths, data.to_pixel, offset_start, offset_end)
        max_height = (
            math.nan if math.isnan(negated_height) or math.isnan(max_height) else max(max_height, -negated_height)
        )
    return max_height


# --- Violations for the search ---

# Distances from the start of a leg, in lag lengths, at which the leg is cut to follow the decay of its altitude lag.
_LAG_CUTS = (0.0, 1.0, 2.5)
# Lines offset from a leg by more than this (m) are tested separately.
_MIN_OFFSET_M = 0.5


@inner
def add_airspace_violations(
    data: ProblemArrays,
    path: Floats,
    legs: Records,
    corners: Records,
    flown_corners: Records,
    lags: Records,
    violations: Record,
) -> None:
    """Add a path's violations of zones and of the maximum height to a `VIOLATIONS` record, m·km.

    path: (w, 3) m. legs, lags: `LEG` and `HEIGHT_LAG` records of the legs.
    corners, flown_corners: `CORNER` and `FLOWN_CORNER` records of the corners, as planned and as flown.

    Zone penetration is added to the field `bounds`, and height above the maximum height to the field `terrain`.

    Each leg is first tested for zones as a whole, with the largest deviation of the flight anywhere along it. Only if
    it is then in a zone, its parts are measured: the two ends, the middle, and the parts near the corners, each with
    its own deviation.
    """
    has_zones, has_max_height = data.airspace.zones.required.shape[0] > 0, data.airspace.max_height < math.inf
    required = required_headroom(data)
    begin, end = np.empty(3), np.empty(3)
    last_leg, across = legs.shape[0] - 1, float(data.tracking.across)
    for i in range(last_leg + 1):
        offset_before, offset_after = float(flown_corners[i].fly_by_offset), float(flown_corners[i + 1].fly_by_offset)
        below, above = float(lags[i].max_below), -float(lags[i].min_below)
        if has_max_height:
            violations.terrain += _leg_excess_height(data, required, path[i], path[i + 1], lags[i], across)
        max_offset = max(offset_before, offset_after)
        if has_zones and _leg_zone_penetration(data, path[i], path[i + 1], across + max_offset, below, above) > 0.0:
            first_fraction = min(1.0, END_DISTANCE_M / max(legs[i].run, 1e-6)) if i == 0 else 0.0
            last_fraction = max(first_fraction, 1.0 - END_DISTANCE_M / max(legs[i].run, 1e-6)) if i == last_leg else 1.0
            # The tracking error does not apply near the fixed ends.
            for fraction, end_fraction, lateral in (
                (0.0, first_fraction, 0.0),
                (first_fraction, last_fraction, across),
                (last_fraction, 1.0, 0.0),
            ):
                if end_fraction > fraction:
                    _cut_segment(path[i], path[i + 1], fraction, end_fraction, begin, end)
                    violations.bounds += _leg_zone_penetration(data, begin, end, lateral, below, above)
        else:
            max_offset = 0.0
        for corner_offset, length, fraction in (
            (offset_before, corners[i].after, 0.0),
            (offset_after, corners[i + 1].before, 1.0),
        ):
            if corner_offset <= 0.0:
                continue
            corner_fraction = min(1.0, length / max(legs[i].run, 1e-6))
            cut_begin, cut_end = max(0.0, fraction - corner_fraction), min(1.0, fraction + corner_fraction)
            _cut_segment(path[i], path[i + 1], cut_begin, cut_end, begin, end)
            if has_zones and max_offset > 0.0:
                violations.bounds += _leg_zone_penetration(data, begin, end, across + corner_offset, below, above)
            if has_max_height:
                extra_height = max(0.0, -lag_at(lags[i], fraction), -lag_at(lags[i], abs(fraction - corner_fraction)))
                violations.terrain += _swath_excess_height(
                    data, required, begin, end, across + corner_offset, extra_height, math.inf
                )


@inner
def airspace_excess(
    data: ProblemArrays, start: Floats, end: Floats, below: float, above: float, max_excess: float
) -> float:
    """Return how much a leg violates zones and the maximum height: depth times length, m·km.

    The result is the depth of the leg in zones plus its height above the maximum height, integrated along the leg.

    start, end: (3,) ends of the leg, m.
    below, above: vertical tracking error, m.
    max_excess: value above which the integration stops; the result is then a lower bound, m·km.
    """
    total, across = 0.0, float(data.tracking.across)
    if data.airspace.zones.required.shape[0] > 0:
        total += _leg_zone_penetration(data, start, end, across, below, above)
    if data.airspace.max_height < math.inf:
        total += _swath_excess_height(data, required_headroom(data), start, end, across, above, max_excess - total)
    return total


@inner
def _leg_zone_penetration(
    data: ProblemArrays, start: Floats, end: Floats, lateral: float, below: float, above: float
) -> float:
    """Return the depth of a leg in zones that the tracking error enlarges, times the leg's length, m·km.

    start, end: (3,) ends of the leg, m.
    lateral, below, above: tracking error, m.
    """
    zones = data.airspace.zones
    return zone_penetration(zones, data.heights, data.to_pixel, data.sample_spacing, start, end, lateral, below, above)


@inner
def _leg_excess_height(
    data: ProblemArrays,
    required: RequiredClearance,
    leg_start: Floats,
    leg_end: Floats,
    lag: Record,
    half_width: float,
) -> float:
    """Return the height of a leg above the maximum height above ground, integrated along the leg, m·km.

    required: the maximum height, expressed as a clearance by `required_headroom`.
    leg_start, leg_end: (3,) m.
    lag: `HEIGHT_LAG` record of the leg; a height above the leg, by which the aircraft lags in a descent, adds to the
        excess.
    half_width: half width of the examined ground strip below the leg, m.

    Lag and half width are ignored for an autopilot without tracking error.
    """
    if not data.tracking.has_error:
        return _swath_excess_height(data, required, leg_start, leg_end, 0.0, 0.0, math.inf)
    total, start, end = 0.0, np.empty(3), np.empty(3)
    # The lag decays exponentially along the leg. The leg is cut at fixed multiples of the decay length, and each part
    # gets the largest height above the leg at its two ends.
    for k in range(len(_LAG_CUTS)):
        begin_fraction = min(1.0, _LAG_CUTS[k] / max(1e-9, lag.decay))
        end_fraction = min(1.0, _LAG_CUTS[k + 1] / max(1e-9, lag.decay)) if k + 1 < len(_LAG_CUTS) else 1.0
        if end_fraction > begin_fraction:
            _cut_segment(leg_start, leg_end, begin_fraction, end_fraction, start, end)
            above = max(0.0, -lag_at(lag, begin_fraction), -lag_at(lag, end_fraction))
            total += _swath_excess_height(data, required, start, end, half_width, above, math.inf)
    return total


@inner
def _swath_excess_height(
    data: ProblemArrays,
    required: RequiredClearance,
    start: Floats,
    end: Floats,
    lateral: float,
    above: float,
    max_excess: float,
) -> float:
    """Return the height of a strip along a line above the maximum height, integrated along the line, m·km.

    Three lines are measured: the line itself, and one line at the distance `lateral` on each side. The largest of the
    three results is returned.

    required: the maximum height, expressed as a clearance by `required_headroom`.
    start, end: (3,) ends of the line, m.
    lateral: half width of the strip that the flight may use, m.
    above: largest height of the aircraft above the line, m.
    max_excess: value above which the computation stops, m·km; the result is then a lower bound.
    """
    horizontal_length = max(1e-9, math.hypot(end[0] - start[0], end[1] - start[1]))
    east, north = lateral * (end[1] - start[1]) / horizontal_length, -lateral * (end[0] - start[0]) / horizontal_length
    largest_excess = 0.0
    for side in (0.0, -1.0, 1.0):
        if side != 0.0 and lateral < _MIN_OFFSET_M:
            break
        x = start[0] + side * east
        y = start[1] + side * north
        x2 = end[0] + side * east
        y2 = end[1] + side * north
        ends = segment_pixels(data.to_pixel, x, y, x2, y2)
        depths, bounds = data.airspace.depths, data.slope_bounds
        excess = clearance_deficit(depths, bounds, required, above, ends, x, y, -start[2], x2, y2, -end[2], max_excess)
        largest_excess = max(largest_excess, excess)
        if largest_excess > max_excess:
            break
    return largest_excess


@inlined
def _cut_segment(
    leg_start: Floats, leg_end: Floats, begin_fraction: float, end_fraction: float, start: Floats, end: Floats
) -> None:  # pragma: no cover
    """Fill `start` and `end` with the ends of a part of a leg, between two fractions of the leg's length.

    leg_start, leg_end: (3,) ends of the leg, m.
    begin_fraction, end_fraction: 0 to 1.
    start, end: (3,) arrays to fill, m.
    """
    for axis in range(3):
        start[axis] = leg_start[axis] + begin_fraction * (leg_end[axis] - leg_start[axis])
        end[axis] = leg_start[axis] + end_fraction * (leg_end[axis] - leg_start[axis])


def count_airspace_violations(data: ProblemArrays, paths: Floats) -> Ints:
    """Count the pieces of each path that violate a zone or the maximum height, (n,).

    paths: (n, w, 3) m.

    There are six pieces per leg, as the paper (Yang, Tang and Lozano, CEC 2014) has six points per leg, but no zones.
    Each piece is tested along its full length, because a path could pass through a zone between two points.

    >>> from planfly.workflow.uav import load_uav
    >>> from planner.evaluation.problem import make_problem
    >>> from world.scenario import load_scenario
    >>> from world.scenario import with_zones
    >>> from world.scenario_tables import ZoneTable
    >>> mill = ZoneTable(name="mill", kind="exclusion", east_m=1300.0, north_m=0.0, radius_m=100.0)
    >>> scenario = with_zones(load_scenario("tight"), [mill], "mills")
    >>> problem = make_problem(scenario, load_uav(scenario).limits)
    >>> count_airspace_violations(problem.search, np.stack([scenario.start, scenario.destination])[None])
    array([2])
    """
    return _count_pieces(data, np.ascontiguousarray(paths))


@compiled
def _count_pieces(data: ProblemArrays, paths: Floats) -> Ints:
    """Implement `count_airspace_violations` for contiguous paths (n, w, 3)."""
    path_count, waypoints, _ = paths.shape
    counts = np.zeros(path_count, np.int64)
    piece_start, piece_end = np.empty(3), np.empty(3)
    for k in range(path_count):
        for i in range(waypoints - 1):
            for piece in range(POINTS_PER_LEG):
                for axis in range(3):
                    step = paths[k, i + 1, axis] - paths[k, i, axis]
                    piece_start[axis] = paths[k, i, axis] + step * piece / POINTS_PER_LEG
                    piece_end[axis] = paths[k, i, axis] + step * (piece + 1) / POINTS_PER_LEG
                if airspace_excess(data, piece_start, piece_end, 0.0, 0.0, math.inf) > 0.0:
                    counts[k] += 1
    return counts
