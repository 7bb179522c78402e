"""Measure the legs and corners of a path, and the shape in which a corner is flown.

Legs and corners are measured once per path and shared by all scores. A turn takes a length of the legs before and after
it: the tangent of its fly-by arc, or more where the autopilot needs it. As flown, a corner is an arc with parabolas
that blend the slopes of the two legs; `blended_vertices` encloses it from below by straight lines.
"""

import math

import numpy as np

from aircraft.envelope import GRAVITY
from aircraft.path_limits import (
    BLEND_ACCELERATION,
    PerformanceTable,
    corner_tangent,
    fly_over_run,
    roll_reversal_length,
    true_airspeed,
    turn_tangents,
    wind_speed_at,
)
from aircraft.tracking import corner_deviation
from planner.evaluation.problem import ProblemArrays
from world.arrays import Floats
from world.geometry import turning_angle
from world.kernels import Record, Records, compiled, compiled_inline, copy_into, inlined, inner

# --- Measurements of legs and corners ---

# East and north components of the downwind unit vector.
Wind = tuple[float, float]

# A leg: its unit course (0, 0 for none), horizontal length and length in three dimensions, m.
LEG = np.dtype([("east", np.float64), ("north", np.float64), ("run", np.float64), ("length", np.float64)])
# A corner, m: tangent length and radius of its fly-by arc; lengths of the legs before and after it that the turn takes,
# the autopilot's settling included; and the largest distance of the flight from the legs.
CORNER = np.dtype([(name, np.float64) for name in ("tangent", "radius", "before", "after", "excursion")])

# Straight part of a leg between its two turns: fraction of the leg.
SETTLING_FRACTION = 0.05
# Upper limit on its additional length, which is the length of small turns, m.
SETTLING_LENGTH_M = 20.0


@inlined
def measure_legs(path: Floats, legs: Records) -> None:
    """Measure the legs of a path (w, 3), and fill its `LEG` records (w - 1,)."""
    for i in range(legs.shape[0]):
        dx, dy = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1]
        dz = path[i + 1, 2] - path[i, 2]
        horizontal_length = math.sqrt(dx * dx + dy * dy)
        legs[i].east = dx / horizontal_length if horizontal_length > 0.0 else 0.0
        legs[i].north = dy / horizontal_length if horizontal_length > 0.0 else 0.0
        legs[i].run = horizontal_length
        legs[i].length = math.sqrt(dx * dx + dy * dy + dz * dz)


@inner
def measure_corners(data: ProblemArrays, wind: Wind, path: Floats, legs: Records, corners: Records) -> None:
    """Measure the turns of a path, and fill its `CORNER` records.

    wind: downwind unit vector.
    path: (w, 3) m.
    legs: filled `LEG` records (w - 1,) of the path.
    corners: `CORNER` records (w,) to fill.

    At the first and the last waypoint the turn is from or to the prescribed end course. There is no turn without one,
    and none at a leg without length.
    """
    aircraft, tracking = data.aircraft, data.tracking
    leg_count: int = legs.shape[0]
    for i in range(1, leg_count):
        ux = legs[i - 1].east
        uy = legs[i - 1].north
        vx = legs[i].east
        vy = legs[i].north
        is_turning = (ux != 0.0 or uy != 0.0) and (vx != 0.0 or vy != 0.0)
        measure_corner(aircraft, tracking, wind, is_turning, ux, uy, vx, vy, path[i, 2], corners[i])
    for i, end_course in ((0, data.start_course), (leg_count, data.destination_course)):
        ux, uy, vx, vy = courses_at_waypoint(data, legs, i)
        is_turning = not math.isnan(end_course) and legs[min(i, leg_count - 1)].run > 0.0
        measure_corner(aircraft, tracking, wind, is_turning, ux, uy, vx, vy, path[i, 2], corners[i])


@inner
def measure_corner(
    aircraft: PerformanceTable,
    tracking: Record,
    wind: Wind,
    is_turning: bool,
    ux: float,
    uy: float,
    vx: float,
    vy: float,
    amsl: float,
    corner: Record,
) -> None:
    """Measure the turn from the unit course u to the unit course v, and fill its `CORNER` record.

    aircraft: performance, with the bank limit and the wind.
    tracking: tracking error of the autopilot; it can lengthen the parts of the legs that the turn takes.
    wind: downwind unit vector.
    is_turning: False for a waypoint without a turn; all values are then 0.
    ux, uy, vx, vy: east and north of the courses before and after the turn.
    amsl: altitude of the turn, m.
    corner: the record to fill.
    """
    tangent, radius, excursion = 0.0, 0.0, 0.0
    if is_turning:
        tangent, radius = corner_tangent(aircraft, ux, uy, vx, vy, amsl, wind[0], wind[1])
    before, after = tangent, tangent
    if tracking.has_error and 0.0 < tangent < math.inf:
        turn = math.atan2(abs(ux * vy - uy * vx), ux * vx + uy * vy)
        # The highest ground speed in the turn, for which the radius of the arc was computed.
        speed = math.sqrt(radius * GRAVITY * aircraft.tan_max_bank)
        excursion, length_before, length_after = corner_deviation(tracking, turn, speed)
        before, after = max(tangent, length_before), max(tangent, length_after)
    corner.tangent, corner.radius = tangent, radius
    corner.before, corner.after, corner.excursion = before, after, excursion


@inlined
def courses_at_waypoint(data: ProblemArrays, legs: Records, i: int) -> tuple[float, float, float, float]:
    """Return the unit courses before and after waypoint i.

    The result is east and north of the course before, then east and north of the course after. Inside the path these
    are the courses of the two legs. Before the start and after the destination it is the prescribed course, or
    the course of the only leg if none is prescribed.
    """
    leg_count = legs.shape[0]
    leg_after, leg_before = min(i, leg_count - 1), max(i - 1, 0)
    ux = legs[leg_before].east
    uy = legs[leg_before].north
    vx = legs[leg_after].east
    vy = legs[leg_after].north
    if i == 0 and not math.isnan(data.start_course):
        ux, uy = math.sin(data.start_course), math.cos(data.start_course)
    if i == leg_count and not math.isnan(data.destination_course):
        vx, vy = math.sin(data.destination_course), math.cos(data.destination_course)
    return ux, uy, vx, vy


@compiled_inline
def settling_length(turn_lengths: float, horizontal_length: float) -> float:
    """Return the straight length that a leg needs between its two turns, where the aircraft settles, m.

    turn_lengths: sum of the lengths that both turns take up, m.
    horizontal_length: length of the leg, m.
    """
    return SETTLING_FRACTION * horizontal_length + min(SETTLING_LENGTH_M, turn_lengths)


@inlined
def turn_length(fly_over: bool, corners: Records, i: int) -> float:
    """Return the length of leg i that its two turns take up, m.

    A fly-over turn takes up only the leg after it, where its track returns to the leg.

    fly_over: True for fly-over waypoints.
    corners: filled `CORNER` records (w,) of the path.
    """
    if not fly_over:
        return corners[i].after + corners[i + 1].before
    if corners[i].tangent <= 0.0:
        return 0.0
    if math.isinf(corners[i].tangent):
        return math.inf
    rejoin_length: float = corners[i].radius * fly_over_run(2.0 * math.atan(corners[i].tangent / corners[i].radius))
    return max(rejoin_length, corners[i].after) if corners[i].excursion > 0.0 else rejoin_length


@inner
def roll_length(aircraft: PerformanceTable, legs: Records, corners: Records, i: int, amsl: float, wind: Wind) -> float:
    """Return the length of leg i that the aircraft needs to roll between opposite turns at its ends, m.

    legs, corners: filled `LEG` records (w - 1,) and `CORNER` records (w,) of the path.
    amsl: altitude of the leg, m.
    wind: downwind unit vector.

    The length is 0 on the first and the last leg, between two turns to the same side, and next to a turn that cannot be
    flown.
    """
    if i == 0 or i == legs.shape[0] - 1 or corners[i].tangent <= 0.0 or corners[i + 1].tangent <= 0.0:
        return 0.0
    ux, uy = legs[i].east, legs[i].north
    turn_in, turn_out = legs[i - 1].east * uy - legs[i - 1].north * ux, ux * legs[i + 1].north - uy * legs[i + 1].east
    if turn_in * turn_out >= 0.0 or math.isinf(corners[i].tangent + corners[i + 1].tangent):
        return 0.0
    return roll_reversal_length(aircraft, ux, uy, amsl, corners[i].radius, corners[i + 1].radius, wind[0], wind[1])


# --- Flown shape of a corner ---

# Maximum angle of a chord of an arc; at a radius of 160 m the arc deviates from such a chord by 1.4 m.
ARC_STEP = math.radians(15.0)


@inlined
def half_blend_length(aircraft: PerformanceTable, amsl: float) -> float:
    """Return half the length of the parabola that blends two slopes, m per unit of slope change.

    For a change of slope of 0.1 the parabola begins 0.1 times this length before the corner, and ends as far after it.
    A full tailwind is assumed.

    amsl: altitude of the corner, m.
    """
    speed = true_airspeed(aircraft, amsl) + wind_speed_at(aircraft, amsl)
    return speed * speed / (2.0 * BLEND_ACCELERATION)


@inner
def fly_by_vertices(
    aircraft: PerformanceTable, previous: Floats, waypoint: Floats, next_waypoint: Floats, radius: float
) -> Floats:
    """Return vertices (k, 3) that enclose the flight past `waypoint` from below, m.

    previous, waypoint, next_waypoint: (3,) m.
    radius: radius of the fly-by arc, m.

    The corner is flown as an arc with parabolas that blend the slopes of the two legs; `blended_vertices` describes the
    vertices. The length of the blend is computed at the altitude of the waypoint.
    """
    return blended_vertices(half_blend_length(aircraft, waypoint[2]), previous, waypoint, next_waypoint, radius)


@inner
def blended_vertices(blend: float, previous: Floats, waypoint: Floats, next_waypoint: Floats, radius: float) -> Floats:
    """Return vertices (k, 3) that enclose the flight past `waypoint` from below, m.

    blend: half length of the parabola that blends two slopes (`half_blend_length`), m per unit of slope change.
    previous, waypoint, next_waypoint: (3,) m.
    radius: radius of the fly-by arc, m; 0 for none.

    The first vertex is where the blend of slopes begins on the leg, the last one is where it ends on the next leg. The
    vertices between lie on the arc, and their height changes linearly. Where the slope decreases, the flight cuts the
    crest by (slope change) x (half length of the blend) / 4, and the vertices are lowered by this amount. Without a
    radius, or if a leg is shorter than the tangent, the waypoint takes the place of the arc.
    """
    length_before = math.hypot(waypoint[0] - previous[0], waypoint[1] - previous[1])
    length_after = math.hypot(next_waypoint[0] - waypoint[0], next_waypoint[1] - waypoint[1])
    if length_before < 1e-6 or length_after < 1e-6:
        return waypoint.copy().reshape((1, 3))
    turn = turning_angle(previous[0], previous[1], waypoint[0], waypoint[1], next_waypoint[0], next_waypoint[1])
    tangent = radius * math.tan(0.5 * turn) if 1e-6 < turn < math.pi - 1e-6 else 0.0
    if tangent > min(length_before, length_after):
        tangent = 0.0
    ux, uy = (waypoint[0] - previous[0]) / length_before, (waypoint[1] - previous[1]) / length_before
    vx, vy = (next_waypoint[0] - waypoint[0]) / length_after, (next_waypoint[1] - waypoint[1]) / length_after
    slope_in = (waypoint[2] - previous[2]) / length_before
    slope_out = (next_waypoint[2] - waypoint[2]) / length_after
    chord_count = math.ceil(turn / ARC_STEP) if tangent > 0.0 else 0
    arc_length = radius * turn if chord_count > 0 else 0.0
    # Heights at the tangent points, and the slope between them: along the arc, or of the next leg without an arc.
    start_height, end_height = waypoint[2] - tangent * slope_in, waypoint[2] + tangent * slope_out
    slope = (end_height - start_height) / arc_length if chord_count > 0 else slope_out
    # A blend takes up at most half of the straight part of its leg, and half of the arc.
    available_in, available_out = 0.5 * (length_before - tangent), 0.5 * (length_after - tangent)
    half_limit = 0.5 * arc_length if chord_count > 0 else min(available_in, available_out)
    available_in, available_out = min(available_in, half_limit), min(available_out, half_limit)
    half_in = min(abs(slope_in - slope) * blend, available_in)
    half_out = min(abs(slope - slope_out) * blend, available_out) if chord_count > 0 else half_in
    deviation_in = 0.25 * max(0.0, slope_in - slope) * half_in
    deviation_out = 0.25 * max(0.0, slope - slope_out) * half_out
    vertices = np.empty((chord_count + 3, 3))
    _set_vertex(
        vertices,
        0,
        waypoint[0] - ux * (tangent + half_in),
        waypoint[1] - uy * (tangent + half_in),
        start_height - half_in * slope_in,
    )
    side = 1.0 if ux * vy - uy * vx >= 0.0 else -1.0
    for k in range(chord_count + 1):
        fraction = k / chord_count if chord_count > 0 else 0.0
        along, offset = radius * math.sin(fraction * turn) - tangent, side * radius * (1.0 - math.cos(fraction * turn))
        deviation = deviation_in + fraction * (deviation_out - deviation_in)
        east, north = waypoint[0] + ux * along - uy * offset, waypoint[1] + uy * along + ux * offset
        _set_vertex(vertices, k + 1, east, north, start_height + fraction * (end_height - start_height) - deviation)
    end_distance = tangent + half_out
    _set_vertex(
        vertices,
        chord_count + 2,
        waypoint[0] + vx * end_distance,
        waypoint[1] + vy * end_distance,
        end_height + half_out * slope_out,
    )
    return vertices


@inner
def leg_parts_at_corner(
    previous: Floats, waypoint: Floats, next_waypoint: Floats, length_before: float, length_after: float
) -> Floats:
    """Return the parts of both legs next to `waypoint` as three vertices, (3, 3) m.

    The vertices are a point on the leg before the waypoint, the waypoint, and a point on the leg after it.

    previous, waypoint, next_waypoint: (3,) m.
    length_before, length_after: lengths of the two parts, m. A part ends with its leg if the leg is shorter.
    """
    vertices = np.empty((3, 3))
    for row, neighbour, length in ((0, previous, length_before), (2, next_waypoint, length_after)):
        horizontal_length = math.hypot(waypoint[0] - neighbour[0], waypoint[1] - neighbour[1])
        fraction = min(1.0, length / max(horizontal_length, 1e-6))
        for axis in range(3):
            vertices[row, axis] = waypoint[axis] + fraction * (neighbour[axis] - waypoint[axis])
    copy_into(vertices[1], waypoint)
    return vertices


@inlined
def _set_vertex(out: Floats, row: int, east: float, north: float, up: float) -> None:
    """Set a row of vertices to a position.

    out: (k, 3) array of vertices, m.
    row: index of the row.
    east, north, up: m.
    """
    out[row, 0] = east
    out[row, 1] = north
    out[row, 2] = up


@compiled
def fly_by_radii(data: ProblemArrays, path: Floats) -> Floats:
    """Return the radius of the fly-by arc at each waypoint, m, (w,); 0 where there is no arc.

    There is no arc at the ends, without a turn, and at a fly-over turn, which passes outside its corner. Nor is there
    one next to a leg that is shorter than its two turns, which is possible if turns are limited only by a maximum
    angle. The corners of such a leg are evaluated as drawn, and the simulated flight shows how the aircraft flies them.
    """
    if data.fly_over:
        return np.zeros(path.shape[0])
    tangents = turn_tangents(data.aircraft, path)
    count = path.shape[0]
    arc_fits = np.ones(count, dtype=np.bool_)
    if not data.legs_hold_turns:
        for i in range(count - 1):
            if tangents[i] + tangents[i + 1] > math.hypot(path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1]):
                arc_fits[i] = False
                arc_fits[i + 1] = False
    radii = np.zeros(count)
    for i in range(1, count - 1):
        if not arc_fits[i]:
            continue
        turn = turning_angle(path[i - 1, 0], path[i - 1, 1], path[i, 0], path[i, 1], path[i + 1, 0], path[i + 1, 1])
        half_turn_tangent = math.tan(0.5 * min(turn, math.pi - 1e-6))
        radii[i] = tangents[i] / half_turn_tangent if half_turn_tangent > 1e-9 and not math.isinf(tangents[i]) else 0.0
    return radii
