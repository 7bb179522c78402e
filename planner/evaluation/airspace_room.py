"""What a whole path keeps from zones and from the greatest height above ground: the compiled part of a certificate."""

import math

import numpy as np
from numpy.typing import NDArray

from planner.airspace.zone_distances import ZONE_ROOM, measure_zone_room
from planner.evaluation.certify_kernels import buffer_on
from planner.evaluation.fly_by_corners import ARC_STEP, blended_vertices, fly_by_radii, half_blend_length
from planner.evaluation.problem_arrays import ProblemArrays
from planner.evaluation.strayed_pieces import STRAYED_PIECE, strayed_pieces
from world.kernels import Record, Records, compiled
from world.terrain import segment_clearance

Floats = NDArray[np.float64]

# What a piece of a leg, or of the way about a corner, by its number, keeps: its room to zones; its greatest height
# above ground (m, NaN off the terrain, -inf where it does not matter), and the buffer wanted below what is allowed (m).
AIRSPACE_PIECE = np.dtype(
    [
        ("of_corner", np.bool_),
        ("number", np.int64),
        ("zones", ZONE_ROOM),
        ("height", np.float64),
        ("buffer", np.float64),
    ],
    align=True,
)
# Of an arc's radius, how far it is from its chords.
_SAGITTA = 1.0 - math.cos(0.5 * ARC_STEP)
# Pieces of one arc, at most.
_MOST_PIECES = math.ceil(math.pi / ARC_STEP) + 2


@compiled
def airspace_pieces(data: ProblemArrays, waypoints: Floats) -> Records:  # pragma: no cover - compiled
    """`AIRSPACE_PIECE` records of the legs of a path (w, 3), and then of its corners."""
    pieces = strayed_pieces(data, waypoints) if data.tracking.strays else _held_pieces(data, waypoints)
    out = np.zeros(pieces.size, dtype=AIRSPACE_PIECE)
    space, beside = data.airspace, np.zeros(2)
    for k in range(pieces.size):
        piece = pieces[k]
        beside[0], beside[1] = piece.beside_begin, piece.beside_end
        measure_zone_room(
            space.zones,
            data.heights,
            space.depths,
            data.to_pixel,
            piece.begin,
            piece.end,
            beside,
            piece.below,
            piece.above,
            out[k].zones,
        )
        out[k].of_corner, out[k].number, out[k].height = piece.of_corner, piece.number, -math.inf
        if space.max_height < math.inf:
            out[k].height = _greatest_height(data, piece)
            ends = space.start_buffer, space.destination_buffer
            out[k].buffer = buffer_on(data, space.buffer, ends, piece.begin, piece.end)
    return out


@compiled
def _held_pieces(data: ProblemArrays, waypoints: Floats) -> Records:  # pragma: no cover - compiled
    """`STRAYED_PIECE` records of a path that is held: of its legs, and of the chords of its arcs."""
    last, radii = waypoints.shape[0] - 1, fly_by_radii(data, waypoints)
    out = np.zeros(last + last * _MOST_PIECES, dtype=STRAYED_PIECE)
    for i in range(last):
        out[i].number = i
        out[i].begin[:], out[i].end[:] = waypoints[i], waypoints[i + 1]
    made = last
    mirrored = waypoints.copy()
    mirrored[:, 2] = -waypoints[:, 2]
    for i in range(1, last):
        blend = half_blend_length(data.aircraft, waypoints[i, 2])
        low = blended_vertices(blend, waypoints[i - 1], waypoints[i], waypoints[i + 1], radii[i])
        # The same from below: nowhere lower than this is as high as the flight.
        high = blended_vertices(blend, mirrored[i - 1], mirrored[i], mirrored[i + 1], radii[i])
        for k in range(max(1, low.shape[0] - 1)):
            after, piece = min(k + 1, low.shape[0] - 1), out[made]
            piece.of_corner, piece.number = True, i
            piece.begin[:], piece.end[:] = low[k], low[after]
            piece.above = max(0.0, -high[k, 2] - low[k, 2], -high[after, 2] - low[after, 2])
            piece.beside_begin, piece.beside_end = radii[i] * _SAGITTA, radii[i] * _SAGITTA
            made += 1
    return out[:made]


@compiled
def _greatest_height(data: ProblemArrays, piece: Record) -> float:  # pragma: no cover - compiled
    """Greatest height above ground along a piece and beside it, m; NaN off the terrain."""
    dx, dy = piece.end[0] - piece.begin[0], piece.end[1] - piece.begin[1]
    run, most = max(1e-9, math.hypot(dx, dy)), -math.inf
    a, b = np.empty(3), np.empty(3)
    for side in (0.0, -1.0, 1.0):
        for end, at, beside in ((a, piece.begin, piece.beside_begin), (b, piece.end, piece.beside_end)):
            end[0] = at[0] + side * beside * dy / run
            end[1] = at[1] - side * beside * dx / run
            end[2] = -(at[2] + piece.above)
        least, _ = segment_clearance(data.airspace.depths, data.to_pixel, a, b)
        most = math.nan if math.isnan(least) or math.isnan(most) else max(most, -least)
    return most
