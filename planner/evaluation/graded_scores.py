"""Score how much a path violates each constraint along its whole length, and its kill exposure.

The paper counts violations at six points per leg. These scores measure violations along every leg instead, so that a
search can reduce them step by step. A corner is evaluated as flown, with its arc and parabolas or with the autopilot's
tracking error, wherever that could change the result. `graded_scores` evaluates many paths in one call; `score_path`
evaluates one path from other kernels.
"""

import math
from typing import NamedTuple

import numpy as np

from aircraft.path_limits import PerformanceTable
from planner.evaluation.airspace_scores import add_airspace_violations
from planner.evaluation.corners import (
    ARC_STEP,
    CORNER,
    LEG,
    fly_by_vertices,
    half_blend_length,
    leg_parts_at_corner,
    measure_corners,
    measure_legs,
)
from planner.evaluation.leg_constraints import PrecomputedLimits, add_leg_violations, precompute_limits
from planner.evaluation.paper_scores import POINTS_PER_LEG
from planner.evaluation.problem import OBJECTIVES, VIOLATIONS, ProblemArrays, RequiredClearance, SlopeBounds, as_columns
from planner.evaluation.terrain_clearance import (
    HEIGHT_LAG,
    TERRAIN_LEG,
    clearance_deficit,
    compute_height_lags,
    lag_at,
    sample_terrain,
    segment_pixels,
)
from planner.evaluation.threat_index import MissileIndex, kill_density
from world.arrays import Floats, Heights, Ints
from world.frames import PolyMapRecord
from world.kernels import Record, Records, compiled, inlined, inner

# A flown corner that departs from the legs by more than this (m) is always evaluated.
CORNER_TOLERANCE_M = 30.0
# Sagitta of an arc over its chord, as a fraction of its radius.
CHORD_RISE = 1.0 - math.cos(0.5 * ARC_STEP)
# Departure of a flown corner from the legs, m: radius of its arc, and largest departures downwards and sideways.
FLOWN_CORNER = np.dtype(
    [
        ("radius", np.float64),
        ("blend_deviation", np.float64),
        ("fly_by_offset", np.float64),
        # Distance from the legs within which missiles matter; 0 if the corner is always evaluated.
        ("missile_distance", np.float64),
    ],
    align=True,
)
# Distance of missiles from both ends of a leg, m.
MISSILE_GAP = np.dtype([("at_beginning", np.float64), ("at_end", np.float64)], align=True)


class PathScratch(NamedTuple):
    """Working memory for scoring one path of w waypoints; reused for the next path.

    legs: `LEG` records (w - 1,). corners: `CORNER` records (w,).
    flown: `FLOWN_CORNER` records (w,).
    extents: (w,) distance from each waypoint within which the flight leaves the legs, m.
    terrain_legs: `TERRAIN_LEG` records (w - 1,). unfinished: (w - 1,) legs that still have samples to take.
    gaps: `MISSILE_GAP` records (w - 1,).
    lags: `HEIGHT_LAG` records (w - 1,).
    """

    legs: Records
    corners: Records
    flown: Records
    extents: Floats
    terrain_legs: Records
    unfinished: Ints
    gaps: Records
    lags: Records


@inner
def make_scratch(count: int) -> PathScratch:
    """Return scratch memory for evaluating paths of `count` waypoints."""
    return PathScratch(
        np.zeros(count - 1, dtype=LEG),
        np.zeros(count, dtype=CORNER),
        np.zeros(count, dtype=FLOWN_CORNER),
        np.zeros(count),
        np.zeros(count - 1, dtype=TERRAIN_LEG),
        np.zeros(count - 1, dtype=np.int64),
        np.zeros(count - 1, dtype=MISSILE_GAP),
        np.zeros(count - 1, dtype=HEIGHT_LAG),
    )


@inner
def score_path(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    scratch: PathScratch,
    path: Floats,
    violations: Record,
    objectives: Record,
) -> None:
    """Score a path: add its violations, and fill its objectives.

    data: the planning problem.
    limits: limits that are precomputed from the problem.
    scratch: working memory for a path of w waypoints.
    path: (w, 3) m.
    violations: `VIOLATIONS` record, all 0 before the call.
    objectives: `OBJECTIVES` record to fill.
    """
    score_legs(data, limits, scratch, path, violations, objectives)
    score_ground(data, limits, scratch, path, violations)
    score_missiles(data, limits, scratch, path, violations, objectives)
    score_airspace(data, scratch, path, violations)


@inner
def score_legs(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    scratch: PathScratch,
    path: Floats,
    violations: Record,
    objectives: Record,
) -> None:
    """Add the violations of legs and turns, and set the length ratio: the first part of `score_path`.

    scratch: legs, corners and height lags are stored here; the other parts of `score_path` read them.
    objectives: the kill exposure is set to 0; `score_missiles` sets it later.
    """
    legs = scratch.legs
    corners = scratch.corners
    flown_corners = scratch.flown
    extents = scratch.extents
    lags = scratch.lags
    aircraft = data.aircraft
    measure_legs(path, legs)
    measure_corners(data, limits.wind, path, legs, corners)
    add_leg_violations(data, limits, path, legs, corners, True, violations)
    if data.tracking.has_error:
        compute_height_lags(data.tracking, aircraft, limits.wind, path, legs, lags)
        # The flown corners have the tracking error's excursion.
        for i in range(1, corners.shape[0] - 1):
            flown, excursion = flown_corners[i], corners[i].excursion
            flown.radius, flown.blend_deviation, flown.fly_by_offset = 0.0, 0.0, excursion
            flown.missile_distance = excursion if excursion <= CORNER_TOLERANCE_M else 0.0
            extents[i] = max(corners[i].before, corners[i].after)
    else:
        _measure_arcs(aircraft, data.legs_hold_turns, data.fly_over, path, legs, corners, flown_corners, extents)
    length = 0.0
    for i in range(legs.shape[0]):
        length += legs[i].length
    objectives.length_ratio, objectives.kill_exposure = length / limits.straight_distance, 0.0


@inner
def score_ground(
    data: ProblemArrays, limits: PrecomputedLimits, scratch: PathScratch, path: Floats, violations: Record
) -> None:
    """Add the missing clearance above ground along the legs: the second part of `score_path`.

    scratch: legs and lags of the path from `score_legs`; its records of terrain samples are overwritten.
    path: (w, 3) m.
    violations: `VIOLATIONS` record, to whose terrain violation the missing clearance is added.
    """
    legs, terrain_legs = scratch.legs, scratch.terrain_legs
    sample_terrain(
        data.heights,
        data.slope_bounds,
        data.to_pixel,
        limits.required,
        path,
        legs,
        scratch.extents,
        scratch.lags,
        terrain_legs,
        scratch.unfinished,
    )
    for i in range(legs.shape[0]):
        violations.terrain += terrain_legs[i].depth


@inner
def score_missiles(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    scratch: PathScratch,
    path: Floats,
    violations: Record,
    objectives: Record,
) -> None:
    """Set the kill exposure, and add missing clearance at corners: the third part of `score_path`.

    scratch: legs, corners, ground samples and lags of the path from `score_legs` and `score_ground`; its missile gaps
        are overwritten.
    path: (w, 3) m.
    violations: `VIOLATIONS` record, to whose terrain violation the missing clearance of flown corners is added.
    objectives: `OBJECTIVES` record, whose kill exposure is set.

    A corner is examined as flown only if it is near ground or missiles, or deviates by more than `CORNER_TOLERANCE_M`
    from its legs.
    """
    # Take arrays out of the data once, because passing the data on costs more than evaluating a leg.
    heights, to_pixel, missiles = data.heights, data.to_pixel, data.missiles
    slope_bounds, aircraft, required, margin = data.slope_bounds, data.aircraft, limits.required, data.kill_margin
    legs, corners, flown_corners, extents = scratch.legs, scratch.corners, scratch.flown, scratch.extents
    terrain_legs, gaps, lags = scratch.terrain_legs, scratch.gaps, scratch.lags
    count, length, kill_sum = path.shape[0], 0.0, 0.0
    for i in range(count - 1):
        x, y, z = path[i, 0], path[i, 1], path[i, 2]
        x2, y2, z2 = path[i + 1, 0], path[i + 1, 1], path[i + 1, 2]
        gap_distance = max(flown_corners[i].missile_distance, flown_corners[i + 1].missile_distance)
        below, above = lags[i].max_below, -lags[i].min_below
        exposure, at_beginning, at_end = kill_density(
            missiles, margin, gap_distance, x, y, z, x2, y2, z2, extents[i], extents[i + 1], below, above
        )
        gaps[i].at_beginning, gaps[i].at_end = at_beginning, at_end
        kill_sum += exposure * legs[i].length
        length += legs[i].length
    for i in range(1, count - 1):
        vertical_drop, lateral_offset = flown_corners[i].blend_deviation, flown_corners[i].fly_by_offset
        min_height = min(terrain_legs[i - 1].height_at_end, terrain_legs[i].height_at_beginning)
        is_near_ground = min_height < vertical_drop + required.steepest_loss * lateral_offset
        is_near_missile = (
            vertical_drop + lateral_offset > CORNER_TOLERANCE_M
            or min(gaps[i - 1].at_end, gaps[i].at_beginning) < vertical_drop + lateral_offset
        )
        # A deviation below 1 cm is ignored.
        if vertical_drop + lateral_offset < 0.01 or not (is_near_ground or is_near_missile):
            continue
        if data.tracking.has_error:
            vertices = leg_parts_at_corner(path[i - 1], path[i], path[i + 1], corners[i].before, corners[i].after)
            below, above = _max_lag_near(lags[i], legs[i], corners[i])
            extra_height, missile_margin = below + slope_bounds.steepest * lateral_offset, margin + lateral_offset
        else:
            vertices = fly_by_vertices(aircraft, path[i - 1], path[i], path[i + 1], flown_corners[i].radius)
            below, above, extra_height, missile_margin = 0.0, 0.0, 0.0, margin
        if is_near_ground:
            violations.terrain += _corner_clearance_deficit(
                heights, slope_bounds, to_pixel, required, extra_height, vertices
            )
        if is_near_missile:
            kill_sum += _corner_exposure(missiles, missile_margin, vertices, below, above)
    objectives.kill_exposure = kill_sum * POINTS_PER_LEG * (count - 1) / length


@inner
def score_airspace(data: ProblemArrays, scratch: PathScratch, path: Floats, violations: Record) -> None:
    """Add the violations of zones and of the maximum height above ground: the last part of `score_path`.

    scratch: legs, corners and lags of the path from `score_legs`.
    path: (w, 3) m.
    violations: `VIOLATIONS` record to which the violations are added.
    """
    if data.airspace.zones.required.shape[0] > 0 or data.airspace.max_height < math.inf:
        add_airspace_violations(data, path, scratch.legs, scratch.corners, scratch.flown, scratch.lags, violations)


def graded_scores(data: ProblemArrays, paths: Floats) -> tuple[Floats, Floats]:
    """Return the graded violations (n, 4) and objectives (n, 4) of paths (n, w, 3).

    The legs and the flown corners are scored along their whole length. The columns of the violations are those of
    `planner.plan.Violation`: turns (rad, plus missing leg lengths in units of 100 m), slopes (m per m), terrain (m x
    km) and bounds (m). The columns of the objectives are those of `planner.plan.Objective`.

    The kill exposure is the mean density along the path times the paper's number of points, which makes it comparable
    with the paper's sum. Detection and height stay 0, because they would only decide between paths of exactly the same
    length.
    """
    violations, objectives = np.zeros(len(paths), dtype=VIOLATIONS), np.zeros(len(paths), dtype=OBJECTIVES)
    # A plan's own path is read-only, which would compile another kernel.
    _score_paths(data, np.require(paths, requirements=["C", "W"]), violations, objectives)
    return as_columns(violations), as_columns(objectives)


@compiled
def _score_paths(data: ProblemArrays, paths: Floats, violations: Records, objectives: Records) -> None:
    """Score paths: add their violations, and fill their objectives.

    paths: (n, w, 3) m.
    violations: `VIOLATIONS` records (n,) of zeros, to which the violations are added.
    objectives: `OBJECTIVES` records (n,) to fill.
    """
    limits = precompute_limits(data)
    scratch = make_scratch(paths.shape[1])
    for n in range(paths.shape[0]):
        score_path(data, limits, scratch, paths[n], violations[n], objectives[n])


@inlined
def _arc_radius(legs_hold_turns: bool, legs: Records, corners: Records, i: int) -> float:
    """Return the radius of the fly-by arc at waypoint i, m; 0 if the turn cannot be flown.

    legs_hold_turns: True if legs must be as long as their turns, so that none is too short.
    legs, corners: filled `LEG` records (w - 1,) and `CORNER` records (w,) of the path.

    If only the angle of turns is limited, the radius is also 0 next to a leg that is too short for its two turns.
    `planner.evaluation.corners.fly_by_radii` gives the radii of a whole path.
    """
    radius: float = corners[i].radius
    if math.isinf(corners[i].tangent):
        return 0.0
    if not legs_hold_turns:
        leg_count = legs.shape[0]
        tangent_before = corners[i - 1].tangent if i > 1 else 0.0
        tangent_after = corners[i + 1].tangent if i < leg_count - 1 else 0.0
        if corners[i].tangent + tangent_before > legs[i - 1].run or corners[i].tangent + tangent_after > legs[i].run:
            return 0.0
    return radius


@inner
def _measure_arcs(
    aircraft: PerformanceTable,
    legs_hold_turns: bool,
    fly_over: bool,
    path: Floats,
    legs: Records,
    corners: Records,
    flown: Records,
    extents: Floats,
) -> None:
    """Fill `FLOWN_CORNER` records (w,) and extents (w,) for corners that are flown without tracking error.

    The flight deviates from the legs downwards, because parabolas blend the slopes. It deviates sideways by at most
    R(1/cos(theta/2) - 1) plus the sagitta of a chord. It does so within two tangent lengths of the waypoint, or within
    the blend if there is no arc.

    legs_hold_turns: True if legs must be as long as their turns.
    fly_over: True for fly-over waypoints, which have no arc before them.
    path: (w, 3) m.
    legs, corners: filled `LEG` records (w - 1,) and `CORNER` records (w,) of the path.
    flown: `FLOWN_CORNER` records (w,) to fill.
    extents: (w,) array to fill: distance from each waypoint within which the flight leaves the legs, m.
    """
    start, second = path[0], path[1]
    slope_out = (second[2] - start[2]) / max(legs[0].run, 1e-6)
    for i in range(1, legs.shape[0]):
        radius = 0.0 if fly_over else _arc_radius(legs_hold_turns, legs, corners, i)
        tangent = corners[i].tangent if radius > 0.0 else 0.0
        slope_in = slope_out
        slope_out = (path[i + 1, 2] - path[i, 2]) / max(legs[i].run, 1e-6)
        crest = max(0.0, slope_in - slope_out)
        blend = half_blend_length(aircraft, path[i, 2])
        lateral_offset = math.sqrt(radius * radius + tangent * tangent) - radius
        lateral_offset += min(lateral_offset, radius * CHORD_RISE)
        vertical_drop = (
            0.5 * tangent * crest + 0.25 * crest * crest * blend + lateral_offset * max(abs(slope_in), abs(slope_out))
        )
        flown[i].radius, flown[i].blend_deviation, flown[i].fly_by_offset = radius, vertical_drop, lateral_offset
        flown[i].missile_distance = (
            lateral_offset + vertical_drop if lateral_offset + vertical_drop <= CORNER_TOLERANCE_M else 0.0
        )
        extents[i] = 2.0 * tangent if tangent > 0.0 else abs(slope_in - slope_out) * blend


@inlined
def _max_lag_near(lag: Record, leg: Record, corner: Record) -> tuple[float, float]:
    """Return the largest deviations below and above the leg after a corner, near the corner, m.

    lag, leg: `HEIGHT_LAG` and `LEG` records of the leg after the corner.
    corner: `CORNER` record, with the length that the turn takes of this leg.
    """
    start_lag, settled_lag = lag_at(lag, 0.0), lag_at(lag, min(1.0, corner.after / max(leg.run, 1e-6)))
    return max(0.0, start_lag, settled_lag), max(0.0, -start_lag, -settled_lag)


@inner
def _corner_clearance_deficit(
    heights: Heights,
    slope_bounds: SlopeBounds,
    to_pixel: PolyMapRecord,
    required: RequiredClearance,
    extra_height: float,
    vertices: Floats,
) -> float:
    """Return the missing clearance along a flown turn, integrated along its chords, m·km.

    heights, slope_bounds: ground heights by pixel, m, and steepest slopes of the ground.
    to_pixel: map from east and north to column and row.
    required: required clearance.
    extra_height: height that is required in addition to the clearance, m.
    vertices: (k, 3) points of the turn, m.
    """
    total = 0.0
    for k in range(vertices.shape[0] - 1):
        x, y, z = vertices[k, 0], vertices[k, 1], vertices[k, 2]
        x2, y2, z2 = vertices[k + 1, 0], vertices[k + 1, 1], vertices[k + 1, 2]
        ends = segment_pixels(to_pixel, x, y, x2, y2)
        total += clearance_deficit(heights, slope_bounds, required, extra_height, ends, x, y, z, x2, y2, z2, math.inf)
    return total


@inner
def _corner_exposure(missiles: MissileIndex, margin: float, vertices: Floats, below: float, above: float) -> float:
    """Return the kill density along a flown corner, integrated over its length, m.

    margin: distance that is added to the radii of the spheres, m.
    vertices: (k, 3) points of the corner, m.
    below, above: largest distance of the aircraft below and above the corner, from its tracking error, m.
    """
    total = 0.0
    for k in range(vertices.shape[0] - 1):
        x, y, z = vertices[k, 0], vertices[k, 1], vertices[k, 2]
        x2, y2, z2 = vertices[k + 1, 0], vertices[k + 1, 1], vertices[k + 1, 2]
        exposure, _, _ = kill_density(missiles, margin, 0.0, x, y, z, x2, y2, z2, 0.0, 0.0, below, above)
        total += exposure * math.sqrt((x2 - x) ** 2 + (y2 - y) ** 2 + (z2 - z) ** 2)
    return total
