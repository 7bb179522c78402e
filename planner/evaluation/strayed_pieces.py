"""Straight pieces of a path with how far its autopilot may be from each: what the certificate looks at."""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import downwind
from planner.evaluation.fly_by_corners import legs_about
from planner.evaluation.height_lags import HEIGHT_LAG, below_at, measure_lags
from planner.evaluation.leg_geometry import CORNER, LEG, measure_corners, measure_legs
from planner.evaluation.problem_arrays import ProblemArrays
from world.kernels import Record, Records, compiled

Floats = NDArray[np.float64]

# A piece of a leg, or of a leg near the corner at a waypoint, by its number: its ends; how far a flight may be beside
# both of them, beside the piece at most, below it and above it, m.
STRAYED_PIECE = np.dtype(
    [
        ("of_corner", np.bool_),
        ("number", np.int64),
        ("begin", np.float64, (3,)),
        ("end", np.float64, (3,)),
        ("beside_begin", np.float64),
        ("beside_end", np.float64),
        ("beside", np.float64),
        ("below", np.float64),
        ("above", np.float64),
    ],
    align=True,
)
# Where legs are cut, in lengths of the height's lag: it has all but decayed after four.
_CUTS = (0.5, 1.0, 2.0, 4.0)
# From a fixed end, where the flight is where the plan is, this far (m) until it strays in full.
ENDS = 100.0


@compiled
def strayed_pieces(data: ProblemArrays, waypoints: Floats) -> Records:  # pragma: no cover - compiled
    """`STRAYED_PIECE` records of the legs of a path (w, 3), and then of its corners."""
    count = waypoints.shape[0]
    legs, corners = np.zeros(count - 1, dtype=LEG), np.zeros(count, dtype=CORNER)
    lags, wind, across = np.zeros(count - 1, dtype=HEIGHT_LAG), downwind(data.aircraft), data.tracking.across
    measure_legs(waypoints, legs)
    measure_corners(data, wind, waypoints, legs, corners)
    measure_lags(data.tracking, data.aircraft, wind, waypoints, legs, lags)
    out = np.zeros((count - 1) * (len(_CUTS) + 3) + 2 * count, dtype=STRAYED_PIECE)
    made = 0
    for i in range(count - 1):
        cuts, share = _cuts(lags[i].decay, legs[i].run), 0.0
        for after in cuts:
            if after <= share:
                continue
            piece = out[made]
            _cut(waypoints[i], waypoints[i + 1], share, after, piece)
            piece.number = i
            piece.beside_begin, piece.beside_end = _beside(data, piece.begin, across), _beside(data, piece.end, across)
            _set_below(lags[i], share, after, piece)
            piece.beside = max(piece.beside_begin, piece.beside_end)
            share = after
            made += 1
    for i in range(1, count - 1):
        if corners[i].excursion <= 0.0:
            continue
        about = legs_about(waypoints[i - 1], waypoints[i], waypoints[i + 1], corners[i].before, corners[i].after)
        wide = across + corners[i].excursion
        for k in range(2):
            piece = out[made]
            _cut(about[k], about[k + 1], 0.0, 1.0, piece)
            piece.of_corner, piece.number = True, i
            piece.beside_begin, piece.beside_end, piece.beside = wide, wide, wide
            if k == 0:
                share = 1.0 - min(1.0, corners[i].before / max(1e-6, legs[i - 1].run))
                _set_below(lags[i - 1], share, 1.0, piece)
            else:
                _set_below(lags[i], 0.0, min(1.0, corners[i].after / max(1e-6, legs[i].run)), piece)
            made += 1
    return out[:made]


@compiled
def _cuts(decay: float, run: float) -> Floats:  # pragma: no cover - compiled
    """Shares of a leg at which its pieces end, increasing; the last is 1."""
    cuts = np.ones(len(_CUTS) + 3)
    for k in range(len(_CUTS)):
        cuts[k] = min(1.0, _CUTS[k] / max(1e-9, decay))
    end = min(1.0, ENDS / max(1e-9, run))
    cuts[len(_CUTS)], cuts[len(_CUTS) + 1] = end, 1.0 - end
    return np.sort(cuts)


@compiled
def _cut(a: Floats, b: Floats, share: float, after: float, piece: Record) -> None:  # pragma: no cover - compiled
    """Fill in the ends of the part of a-b between two shares of it."""
    for axis in range(3):
        piece.begin[axis] = a[axis] + share * (b[axis] - a[axis])
        piece.end[axis] = a[axis] + after * (b[axis] - a[axis])


@compiled
def _set_below(lag: Record, share: float, after: float, piece: Record) -> None:  # pragma: no cover - compiled
    """Fill in how far below and above the piece between two shares of a leg a flight may be."""
    one, two = below_at(lag, share), below_at(lag, after)
    piece.below, piece.above = max(0.0, one, two), max(0.0, -one, -two)


@compiled
def _beside(data: ProblemArrays, place: Floats, across: float) -> float:  # pragma: no cover - compiled
    """How far beside a place of the path a flight may be, m: less near the fixed ends."""
    away = min(
        math.hypot(place[0] - data.start[0], place[1] - data.start[1]),
        math.hypot(place[0] - data.destination[0], place[1] - data.destination[1]),
    )
    return across * min(1.0, away / ENDS)
