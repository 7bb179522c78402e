"""The ground under a path: how deep legs are below the clearance that is wanted, and how high above it.

Steps over the ground grow with the height above it: ground can rise no faster than its steepest slope about there.
"""

import math

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.clearance_reserve import required_clearance
from planner.evaluation.problem_arrays import Steep
from world.frames import PolyMapRecord, polymap
from world.kernels import compiled_views, inlined
from world.terrain import TILE, pixel_height

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Heights = NDArray[np.float32]
Pixels = tuple[float, float, float, float]

# Height above the required clearance that steps over the ground leave unseen, m: corners may use it.
SEEN = 10.0
# Violation of a sample without known ground, m.
UNKNOWN = 1000.0
# Columns that `sound` is asked for, of `LINE`.
DEPTH, GROUND_A, GROUND_B = 8, 9, 10
LINE = 11


@inlined
def _look(
    heights: Heights,
    slopes: Heights,
    reach: float,
    clear: Floats,
    col: float,
    row: float,
    up: float,
    need: float,
    run: float,
    rise: float,
    step: float,
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Height above the required clearance at a place of a line, and the share of the line that needs no look after it.

    run, rise: of the whole line, m.  step: share from one sample to the next where the ground is near.
    """
    ground = pixel_height(heights, col, row)
    gap = up - ground - need if ground == ground else -UNKNOWN
    i, j = min(max(int(row) // TILE, 0), slopes.shape[0] - 1), min(max(int(col) // TILE, 0), slopes.shape[1] - 1)
    # Fastest loss of height above ground, m for the whole line.
    fall = (slopes[np.uintp(i), np.uintp(j)] + clear[11]) * run + abs(rise) + 1e-9
    ahead, known = (gap - SEEN) / fall, reach / (run + 1e-9)
    ahead = ahead if ahead < known else known
    return gap, ahead if ahead > step else step


@compiled_views
def terrain_excess(
    heights: Heights,
    steep: Steep,
    clear: Floats,
    ends: Pixels,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
) -> float:  # pragma: no cover - compiled
    """Depth below the required clearance along a-b, summed over samples (m x km).

    ends: columns and rows of a and b.  steep: of the rules.  clear: of `pack_clearance`.
    """
    col, row, across, down, rise = ends[0], ends[1], ends[2] - ends[0], ends[3] - ends[1], bz - az
    run = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
    step = 1.0 / max(1.0, math.ceil(run / clear[8]))
    slopes, reach = steep.slopes, steep.reach
    need, whole = clear[0] + clear[1], clear[10] > 0.0
    depth, f = 0.0, 0.0
    while True:
        if not whole:
            need = required_clearance(clear, ax + f * (bx - ax), ay + f * (by - ay))
        gap, ahead = _look(
            heights, slopes, reach, clear, col + f * across, row + f * down, az + f * rise, need, run, rise, step
        )
        depth -= gap if gap < 0.0 else 0.0
        if f >= 1.0:
            break
        f = min(1.0, f + ahead)
    return float(depth * max(run, 1.0) * step / 1000.0)


@compiled_views
def sound(
    heights: Heights,
    steep: Steep,
    to_pixel: PolyMapRecord,
    clear: Floats,
    paths: Floats,
    n: int,
    legs: Floats,
    near: Floats,
    lines: Floats,
    asked: Ints,
) -> None:  # pragma: no cover - compiled
    """Do the same for all legs of path n: fill lines with depths, and with the least heights near both ends.

    near: (w,) how far from each waypoint that is, m.  lines: (w - 1, 11).  asked: (w - 1,) scratch.

    The least heights are right up to `SEEN`; above that they say no more than "at least `SEEN`".  In rounds, a sample
    of each leg: the next one of the same leg would wait for what this one finds.
    """
    count = legs.shape[0]
    after = polymap(to_pixel, paths[n, 0, 0], paths[n, 0, 1])
    for i in range(count):
        before = after
        after = polymap(to_pixel, paths[n, i + 1, 0], paths[n, i + 1, 1])
        run = legs[i, 2]
        step = 1.0 / max(1.0, math.ceil(run / clear[8]))
        lines[i, 0], lines[i, 1] = before[0], before[1]
        lines[i, 2], lines[i, 3] = after[0] - before[0], after[1] - before[1]
        lines[i, 4], lines[i, 5] = step, 0.0
        # A sample stands for the step that follows it, and for the one before.
        per_metre = 1.0 / max(run, 1e-9)
        lines[i, 6] = near[i] * per_metre + step
        lines[i, 7] = 1.0 - near[i + 1] * per_metre - step
        lines[i, DEPTH], lines[i, GROUND_A], lines[i, GROUND_B] = 0.0, math.inf, math.inf
        asked[i] = i
    slopes, reach = steep.slopes, steep.reach
    need, whole = clear[0] + clear[1], clear[10] > 0.0
    while count > 0:
        left = 0
        for entry in range(count):
            leg = np.uintp(asked[entry])
            f, step = lines[leg, 5], lines[leg, 4]
            up, rise = paths[n, leg, 2], paths[n, leg + np.uintp(1), 2] - paths[n, leg, 2]
            if not whole:
                dx, dy = (
                    paths[n, leg + np.uintp(1), 0] - paths[n, leg, 0],
                    paths[n, leg + np.uintp(1), 1] - paths[n, leg, 1],
                )
                need = required_clearance(clear, paths[n, leg, 0] + f * dx, paths[n, leg, 1] + f * dy)
            col, row = lines[leg, 0] + f * lines[leg, 2], lines[leg, 1] + f * lines[leg, 3]
            gap, ahead = _look(heights, slopes, reach, clear, col, row, up + f * rise, need, legs[leg, 2], rise, step)
            lines[leg, DEPTH] -= gap if gap < 0.0 else 0.0
            at_a, at_b = gap if f <= lines[leg, 6] else math.inf, gap if f >= lines[leg, 7] else math.inf
            lines[leg, GROUND_A] = at_a if at_a < lines[leg, GROUND_A] else lines[leg, GROUND_A]
            lines[leg, GROUND_B] = at_b if at_b < lines[leg, GROUND_B] else lines[leg, GROUND_B]
            asked[left] = np.int64(leg)
            left += 1 if f < 1.0 else 0
            lines[leg, 5] = f + ahead if f + ahead < 1.0 else 1.0
        count = left
    for i in range(legs.shape[0]):
        lines[i, DEPTH] *= max(legs[i, 2], 1.0) * lines[i, 4] / 1000.0


@inlined
def pixels(
    to_pixel: PolyMapRecord, ax: float, ay: float, bx: float, by: float
) -> Pixels:  # pragma: no cover - compiled
    """Columns and rows of both ends of a segment."""
    col0, row0 = polymap(to_pixel, ax, ay)
    col1, row1 = polymap(to_pixel, bx, by)
    return col0, row0, col1, row1
