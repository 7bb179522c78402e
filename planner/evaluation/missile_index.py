"""Missiles by where they stand, and what a line past them is exposed to."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from world.geometry import window_exposure
from world.kernels import compiled_views, inlined

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Classes of missiles by radius, at most; and missiles a cell, on the mean.
MOST_CLASSES = 8
A_CELL = 2.0


class Missiles(NamedTuple):
    """Missiles in the order of the cells that they stand in, so that those near a line are read in runs.

    units: (m, 5) east, north, up, kill radius and scale, of those with a radius.  classes: (k, 7) of missiles alike in
    radius, each with a grid of its own: west and south of it, cells a metre, columns, rows, where its cells begin in
    `first`, and the largest radius.  first: (c,) where the units of each cell begin, and after each class's cells where
    the last one's end.
    """

    units: Floats
    classes: Floats
    first: Ints


def make_missiles(threats: Floats, side: float | None = None) -> Missiles:
    """Missiles of threats (m, 5 or more): east, north, up, kill radius and scale.

    side: of a cell, m; None for `A_CELL` missiles a cell.
    """
    units = threats[threats[:, 3] > 0.0, :5]
    # Alike: within a factor of two, as long as there are not too many classes.
    largest = float(units[:, 3].max(initial=1.0))
    alike = np.minimum(MOST_CLASSES - 1, np.floor(np.log2(largest / units[:, 3]))).astype(np.int64)
    ordered, classes, first = [units[:0]], [], [np.zeros(0, dtype=np.int64)]
    cells, before = 0, 0
    for number in np.unique(alike):
        own = units[alike == number]
        low, high = own[:, :2].min(axis=0), own[:, :2].max(axis=0)
        area = float(np.prod(np.maximum(high - low, 1.0)))
        per_metre = 1.0 / (math.sqrt(A_CELL * area / len(own)) if side is None else side)
        cols, rows = (int(size * per_metre) + 1 for size in high - low)
        place = ((own[:, :2] - low) * per_metre).astype(np.int64)
        cell = np.minimum(place[:, 1], rows - 1) * cols + np.minimum(place[:, 0], cols - 1)
        order = np.argsort(cell, kind="stable")
        ordered.append(own[order])
        first.append(before + np.searchsorted(cell[order], np.arange(cols * rows + 1)))
        classes.append([low[0], low[1], per_metre, cols, rows, cells, own[:, 3].max()])
        cells, before = cells + cols * rows + 1, before + len(own)
    arrays = np.concatenate(ordered), np.array(classes).reshape(-1, 7), np.concatenate(first)
    for array in arrays:
        array.setflags(write=False)
    return Missiles(*arrays)


@compiled_views
def kill_density(
    missiles: Missiles,
    margin: float,
    slack: float,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
    first: float,
    last: float,
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Mean kill density over the segment a-b, radii grown by the margin, and distances to the nearest such sphere, m.

    first, last: lengths (m) at a and at b: the distances are from there, and right up to the slack.
    """
    dx, dy, dz = bx - ax, by - ay, bz - az
    length2 = dx * dx + dy * dy + dz * dz
    inverse, slant = 1.0 / length2 if length2 > 0.0 else 0.0, 1.0 / dy if abs(dy) > 1e-9 else 0.0
    units, starts = missiles.units, missiles.first
    dose, near_a, near_b = 0.0, math.inf, math.inf
    for kind in range(missiles.classes.shape[0]):
        west, south, per_metre = missiles.classes[kind, 0], missiles.classes[kind, 1], missiles.classes[kind, 2]
        cols, rows, base = missiles.classes[kind, 3], missiles.classes[kind, 4], int(missiles.classes[kind, 5])
        # A hair more, for what rounding would leave out.
        reach = missiles.classes[kind, 6] + margin + slack + 1e-6
        side = 1.0 / per_metre
        lowest = _cell((min(ay, by) - reach - south) * per_metre, rows)
        for row in range(max(0, lowest), min(int(rows), _cell((max(ay, by) + reach - south) * per_metre, rows) + 1)):
            # The part of the segment from which something in this row of cells is in reach.
            north = south + row * side - ay
            f, g = (north - reach) * slant, (north + side + reach) * slant
            f, g = (f, g) if f < g else (g, f)
            f, g = (f if f > 0.0 else 0.0, g if g < 1.0 else 1.0) if slant != 0.0 else (0.0, 1.0)
            x, x2 = ax + f * dx - west, ax + g * dx - west
            x, x2 = (x, x2) if x < x2 else (x2, x)
            left, right = _cell((x - reach) * per_metre, cols), _cell((x2 + reach) * per_metre, cols)
            if right < 0 or left >= cols:
                continue
            here = base + row * int(cols)
            for entry in range(starts[here + max(0, left)], starts[here + min(int(cols) - 1, right) + 1]):
                k = np.uintp(entry)
                x, y, z = ax - units[k, 0], ay - units[k, 1], az - units[k, 2]
                radius = units[k, 3] + margin
                along, start2 = dx * x + dy * y + dz * z, x * x + y * y + z * z
                closest2 = _closest2(-along * inverse, 0.0, 1.0, along, start2, length2)
                if closest2 < (radius + slack) * (radius + slack):
                    length = math.sqrt(length2)
                    until, since = first / max(length, first), 1.0 - last / max(length, last)
                    one = _closest2(-along * inverse, 0.0, until, along, start2, length2)
                    two = _closest2(-along * inverse, since, 1.0, along, start2, length2)
                    near_a, near_b = min(near_a, math.sqrt(one) - radius), min(near_b, math.sqrt(two) - radius)
                    if closest2 < radius * radius:
                        dose += _dose(along, start2, length2, radius, units[k, 4])
    return dose, near_a, near_b


@inlined
def _cell(place: float, count: float) -> int:  # pragma: no cover - compiled
    """Number of the cell along one axis; -1 and `count` stand for what is outside."""
    inside = place if place > -1.0 else -1.0
    number: int = math.floor(inside if inside < count else count)
    return number


@inlined
def _closest2(
    nearest: float, low: float, high: float, along: float, start2: float, length2: float
) -> float:  # pragma: no cover - compiled
    """Squared distance from a point to the part low..high (fractions) of a segment.

    nearest: fraction of the whole line that is nearest to it.  along, start2, length2: see `window_exposure`.
    """
    f = nearest if nearest < high else high
    f = f if f > low else low
    return max(0.0, start2 + f * (2.0 * along + f * length2))


@compiled_views
def _dose(along: float, start2: float, length2: float, radius: float, scale: float) -> float:  # pragma: no cover
    """Mean kill density of a segment that enters a sphere; see `window_exposure`."""
    if length2 < 1e-12:
        return window_exposure(0.0, 1.0, length2, along, start2, scale)
    middle = -along / length2
    half = math.sqrt(max(0.0, middle * middle - (start2 - radius * radius) / length2))
    enter, leave = max(0.0, middle - half), min(1.0, middle + half)
    return window_exposure(enter, leave, length2, along, start2, scale) if leave > enter else 0.0
