"""What a flown track meets on its way: the ground under each of its segments, and the spheres it passes through.

The formulas are the world's; here they are only run along a track, exactly per segment, at any sampling rate.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from logs.verdict.tolerances import FARTHEST, TOUCH
from world.frames import PolyMapRecord
from world.geometry import sphere_window
from world.kernels import compiled
from world.terrain import Heights, Terrain, segment_clearance

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Passage:
    """One stay inside a sphere: from, to (s); closest: m from its centre; whole: left again before the track's end."""

    start: float
    end: float
    closest: float
    closest_time: float
    whole: bool


def segment_clearances(terrain: Terrain, position: Floats) -> tuple[Floats, Floats]:
    """Smallest height above ground on each segment of a track, m, and the fraction of it where that is.

    position: (t, 3).  Returns (t - 1,) twice; NaN where the segment leaves the terrain's data or is not a number.
    """
    return _clearances(terrain.heights, terrain.to_pixel.record, np.ascontiguousarray(position))


def passages(time: Floats, position: Floats, centre: Floats, radius: float) -> list[Passage]:
    """Stays of a track inside a sphere, in order.

    time: (t,) s.  position: (t, 3).  centre: (3,).  A point on the surface is inside.
    """
    if not radius > 0.0 or _far(position, centre, radius):
        return []
    closest, enter, leave = _windows(np.ascontiguousarray(position), np.ascontiguousarray(centre), float(radius))
    step = np.diff(time)
    found: list[Passage] = []
    for k in np.flatnonzero(leave > enter).tolist():
        start, end = time[k] + enter[k] * step[k], time[k] + leave[k] * step[k]
        last = k == len(step) - 1 and leave[k] >= 1.0
        here = Passage(float(start), float(end), float(closest[k]), float(time[k]), not last)
        if found and start - found[-1].end <= TOUCH:
            before = found.pop()
            nearer = here if here.closest < before.closest else before
            here = Passage(before.start, here.end, nearer.closest, nearer.closest_time, here.whole)
        found.append(here)
    return found


def _far(position: Floats, centre: Floats, radius: float) -> bool:
    """Whether the box around the track stays outside the sphere's box."""
    good = position[np.isfinite(position).all(axis=1)]
    if not len(good):
        return True
    return bool((good.min(axis=0) > centre + radius).any() or (good.max(axis=0) < centre - radius).any())


@compiled
def _clearances(
    heights: Heights, to_pixel: PolyMapRecord, position: Floats
) -> tuple[Floats, Floats]:  # pragma: no cover
    count = max(0, position.shape[0] - 1)
    low = np.full(count, math.nan)
    at = np.zeros(count)
    for k in range(count):
        if np.abs(position[k : k + 2]).max() <= FARTHEST:
            low[k], at[k] = segment_clearance(heights, to_pixel, position[k], position[k + 1])
    return low, at


@compiled
def _windows(position: Floats, centre: Floats, radius: float) -> tuple[Floats, Floats, Floats]:  # pragma: no cover
    count = position.shape[0] - 1
    closest = np.full(count, math.inf)
    enter = np.zeros(count)
    leave = np.zeros(count)
    for k in range(count):
        if np.abs(position[k : k + 2]).max() <= FARTHEST:
            closest[k], enter[k], leave[k] = sphere_window(position[k], position[k + 1], centre, radius)
    return closest, enter, leave
