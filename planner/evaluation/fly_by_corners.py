"""Corners as a flight takes them: fly-by arcs, and the parabolas that blend slopes."""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import BLEND_ACCELERATION, PerformanceTable, turn_tangents, wind_speed_at
from planner.evaluation.problem_arrays import ProblemArrays
from world.geometry import turning_angle
from world.kernels import compiled, inlined

Floats = NDArray[np.float64]

# Chords of a corner's arc: at most this angle each; on a 160 m radius the arc leaves its chord by 1.4 m.
ARC_STEP = math.radians(15.0)


@inlined
def half_blend_length(aircraft: PerformanceTable, amsl: float) -> float:  # pragma: no cover - compiled
    """Half the length of the parabola that blends two slopes, m per unit of their difference, with the wind behind."""
    speed = aircraft.airspeed + wind_speed_at(aircraft, amsl)
    length: float = speed * speed / (2.0 * BLEND_ACCELERATION)
    return length


@compiled
def fly_by_vertices(
    aircraft: PerformanceTable, before: Floats, at: Floats, after: Floats, radius: float
) -> Floats:  # pragma: no cover - compiled
    """Vertices (k, 3) of the way that a flight takes past the waypoint `at`; see `blended_vertices`."""
    return blended_vertices(half_blend_length(aircraft, at[2]), before, at, after, radius)


@compiled
def blended_vertices(
    blend: float, before: Floats, at: Floats, after: Floats, radius: float
) -> Floats:  # pragma: no cover - compiled
    """Vertices (k, 3) of the way that a flight takes past the waypoint `at`, at least as low as the flight.

    They are: a point on the leg where the blend of heights begins, the fly-by arc of this radius from tangent point to
    tangent point, and a point on the next leg where the blend ends.  Height is even along the arc; where the slope
    breaks downwards a parabola cuts the crest by change x half-length / 4, and the vertices are lowered by that.
    Without a radius, or where a leg is shorter than the tangent, the arc is the waypoint itself.

    blend: of `half_blend_length`.
    """
    run_before = math.hypot(at[0] - before[0], at[1] - before[1])
    run_after = math.hypot(after[0] - at[0], after[1] - at[1])
    if run_before < 1e-6 or run_after < 1e-6:
        return at.copy().reshape((1, 3))
    turn = turning_angle(before[0], before[1], at[0], at[1], after[0], after[1])
    tangent = radius * math.tan(0.5 * turn) if 1e-6 < turn < math.pi - 1e-6 else 0.0
    if tangent > min(run_before, run_after):
        tangent = 0.0
    ux, uy = (at[0] - before[0]) / run_before, (at[1] - before[1]) / run_before
    vx, vy = (after[0] - at[0]) / run_after, (after[1] - at[1]) / run_after
    slope_in, slope_out = (at[2] - before[2]) / run_before, (after[2] - at[2]) / run_after
    chords = math.ceil(turn / ARC_STEP) if tangent > 0.0 else 0
    arc = radius * turn if chords > 0 else 0.0
    low, high = at[2] - tangent * slope_in, at[2] + tangent * slope_out
    slope = (high - low) / arc if chords > 0 else slope_out
    available_in, available_out = 0.5 * (run_before - tangent), 0.5 * (run_after - tangent)
    beside = 0.5 * arc if chords > 0 else min(available_in, available_out)
    available_in, available_out = min(available_in, beside), min(available_out, beside)
    half_in = min(abs(slope_in - slope) * blend, available_in)
    half_out = min(abs(slope - slope_out) * blend, available_out) if chords > 0 else half_in
    deviation_in = 0.25 * max(0.0, slope_in - slope) * half_in
    deviation_out = 0.25 * max(0.0, slope - slope_out) * half_out
    out = np.empty((chords + 3, 3))
    _set(out, 0, at[0] - ux * (tangent + half_in), at[1] - uy * (tangent + half_in), low - half_in * slope_in)
    side = 1.0 if ux * vy - uy * vx >= 0.0 else -1.0
    for k in range(chords + 1):
        f = k / chords if chords > 0 else 0.0
        ahead, aside = radius * math.sin(f * turn) - tangent, side * radius * (1.0 - math.cos(f * turn))
        lowered = deviation_in + f * (deviation_out - deviation_in)
        east, north = at[0] + ux * ahead - uy * aside, at[1] + uy * ahead + ux * aside
        _set(out, k + 1, east, north, low + f * (high - low) - lowered)
    away = tangent + half_out
    _set(out, chords + 2, at[0] + vx * away, at[1] + vy * away, high + half_out * slope_out)
    return out


@compiled
def legs_about(
    before: Floats, at: Floats, after: Floats, length_before: float, length_after: float
) -> Floats:  # pragma: no cover - compiled
    """The legs before and after the waypoint `at`, as far as these lengths (m), as vertices (3, 3)."""
    out = np.empty((3, 3))
    for row, other, length in ((0, before, length_before), (2, after, length_after)):
        run = math.hypot(at[0] - other[0], at[1] - other[1])
        share = min(1.0, length / max(run, 1e-6))
        for axis in range(3):
            out[row, axis] = at[axis] + share * (other[axis] - at[axis])
    out[1] = at
    return out


@inlined
def _set(out: Floats, row: int, east: float, north: float, up: float) -> None:  # pragma: no cover - compiled
    out[row, 0] = east
    out[row, 1] = north
    out[row, 2] = up


@compiled
def fly_by_radii(data: ProblemArrays, path: Floats) -> Floats:  # pragma: no cover - compiled
    """Radius (m) of the fly-by arc at each waypoint (w,); 0 at the ends and where the path goes straight on.

    Where a number alone limits turns, a leg may be shorter than its two turns.  Nothing flies those arcs, so there
    are none: the corners are evaluated as drawn, and the flight shows what the aircraft makes of them.  A fly-over
    passes outside its corner, and has none either.
    """
    if data.fly_over:
        return np.zeros(path.shape[0])
    tangents = turn_tangents(data.aircraft, path)
    count = path.shape[0]
    fits = np.ones(count, dtype=np.bool_)
    if not data.legs_hold_turns:
        for i in range(count - 1):
            if tangents[i] + tangents[i + 1] > math.hypot(path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1]):
                fits[i] = False
                fits[i + 1] = False
    radii = np.zeros(count)
    for i in range(1, count - 1):
        if not fits[i]:
            continue
        turn = turning_angle(path[i - 1, 0], path[i - 1, 1], path[i, 0], path[i, 1], path[i + 1, 0], path[i + 1, 1])
        half = math.tan(0.5 * min(turn, math.pi - 1e-6))
        radii[i] = tangents[i] / half if half > 1e-9 and not math.isinf(tangents[i]) else 0.0
    return radii
