"""Missiles by where they stand, and what a line past them is exposed to."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from world.geometry import window_exposure
from world.kernels import Records, compiled, inlined

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Classes of missiles by radius, at most; and missiles a cell, on the mean.
MOST_CLASSES = 8
MISSILES_A_CELL = 2.0
# A missile: its position, kill radius and scale, m.
MISSILE = np.dtype([(name, np.float64) for name in ("east", "north", "up", "radius", "scale")])
# Missiles alike in radius, with a grid of their own: west and south of it (m), cells a metre, columns and rows, where
# its cells begin in `MissileIndex.first`, and the largest radius (m).
MISSILE_CLASS = np.dtype(
    [
        ("west", np.float64),
        ("south", np.float64),
        ("cells_per_metre", np.float64),
        ("columns", np.int64),
        ("rows", np.int64),
        ("first_cell", np.int64),
        ("largest_radius", np.float64),
    ]
)


class MissileIndex(NamedTuple):
    """Missiles in the order of the cells that they stand in, so that those near a line are read one after the other.

    missiles: `MISSILE` records (m,), of those with a radius.
    classes: `MISSILE_CLASS` records (k,).
    first: (c,) where the missiles of each cell begin, and after each class's cells where the last one's end.
    """

    missiles: Records
    classes: Records
    first: Ints


def make_missile_index(threats: Records, side: float | None = None) -> MissileIndex:
    """Missiles of records with fields east, north, up, kill_radius and kill_scale (m).

    side: of a cell, m; None for `MISSILES_A_CELL` missiles a cell.
    """
    armed = threats[threats["kill_radius"] > 0.0]
    missiles = np.zeros(len(armed), dtype=MISSILE)
    for name, source in zip(MISSILE.names or (), ("east", "north", "up", "kill_radius", "kill_scale"), strict=True):
        missiles[name] = armed[source]
    # Alike: within a factor of two, as long as there are not too many classes.
    largest = float(missiles["radius"].max(initial=1.0))
    alike = np.minimum(MOST_CLASSES - 1, np.floor(np.log2(largest / missiles["radius"]))).astype(np.int64)
    ordered, classes, first = [missiles[:0]], [], [np.zeros(0, dtype=np.int64)]
    cells, before = 0, 0
    for number in np.unique(alike):
        own = missiles[alike == number]
        place = np.stack([own["east"], own["north"]], axis=1)
        low, high = place.min(axis=0), place.max(axis=0)
        area = float(np.prod(np.maximum(high - low, 1.0)))
        per_metre = 1.0 / (math.sqrt(MISSILES_A_CELL * area / len(own)) if side is None else side)
        columns, rows = (int(size * per_metre) + 1 for size in high - low)
        steps = ((place - low) * per_metre).astype(np.int64)
        cell = np.minimum(steps[:, 1], rows - 1) * columns + np.minimum(steps[:, 0], columns - 1)
        order = np.argsort(cell, kind="stable")
        ordered.append(own[order])
        first.append(before + np.searchsorted(cell[order], np.arange(columns * rows + 1)))
        classes.append((low[0], low[1], per_metre, columns, rows, cells, own["radius"].max()))
        cells, before = cells + columns * rows + 1, before + len(own)
    arrays = np.concatenate(ordered), np.array(classes, dtype=MISSILE_CLASS), np.concatenate(first)
    for array in arrays:
        array.setflags(write=False)
    return MissileIndex(*arrays)


@compiled
def kill_density(
    index: MissileIndex,
    margin: float,
    within: float,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
    first: float,
    last: float,
    below: float,
    above: float,
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Mean kill density over the segment a-b, radii grown by the margin, and distances to the nearest such sphere, m.

    first, last: lengths (m) at a and at b: the distances are from there, and right if they are less than `within`.
    below, above: how far below and above the segment a flight may be, m.
    """
    dx, dy, dz = bx - ax, by - ay, bz - az
    length2 = dx * dx + dy * dy + dz * dz
    inverse, slant = 1.0 / length2 if length2 > 0.0 else 0.0, 1.0 / dy if abs(dy) > 1e-9 else 0.0
    missiles, starts = index.missiles, index.first
    dose, near_a, near_b = 0.0, math.inf, math.inf
    for number in range(index.classes.shape[0]):
        kind = index.classes[number]
        per_metre, columns, rows = kind.cells_per_metre, kind.columns, kind.rows
        # A hair more, for what rounding would leave out.
        radius, side = kind.largest_radius + margin + within + 1e-6, 1.0 / per_metre
        lowest = _cell((min(ay, by) - radius - kind.south) * per_metre, rows)
        highest = _cell((max(ay, by) + radius - kind.south) * per_metre, rows)
        for row in range(max(0, lowest), min(rows, highest + 1)):
            # The part of the segment from which something in this row of cells may be near.
            north = kind.south + row * side - ay
            f, g = _part((north - radius) * slant, (north + side + radius) * slant) if slant != 0.0 else (0.0, 1.0)
            x, x2 = ax + f * dx - kind.west, ax + g * dx - kind.west
            x, x2 = (x, x2) if x < x2 else (x2, x)
            left, right = _cell((x - radius) * per_metre, columns), _cell((x2 + radius) * per_metre, columns)
            if right < 0 or left >= columns:
                continue
            here = kind.first_cell + row * columns
            for entry in range(starts[here + max(0, left)], starts[here + min(columns - 1, right) + 1]):
                missile = missiles[np.uintp(entry)]
                x, y, z = ax - missile.east, ay - missile.north, az - missile.up
                grown = missile.radius + margin
                if below > 0.0 or above > 0.0:
                    z = _nearer(z, dz * min(1.0, max(0.0, -(dx * x + dy * y + dz * z) * inverse)), below, above)
                along, start2 = dx * x + dy * y + dz * z, x * x + y * y + z * z
                closest2 = _closest2(-along * inverse, 0.0, 1.0, along, start2, length2)
                if closest2 < (grown + within) * (grown + within):
                    length = math.sqrt(length2)
                    until, since = first / max(length, first), 1.0 - last / max(length, last)
                    one = _closest2(-along * inverse, 0.0, until, along, start2, length2)
                    two = _closest2(-along * inverse, since, 1.0, along, start2, length2)
                    near_a, near_b = min(near_a, math.sqrt(one) - grown), min(near_b, math.sqrt(two) - grown)
                    if closest2 < grown * grown:
                        dose += _dose(along, start2, length2, grown, missile.scale)
    return dose, near_a, near_b


@inlined
def _part(f: float, g: float) -> tuple[float, float]:  # pragma: no cover - compiled
    """Fractions of a line in order, and within it."""
    f, g = (f, g) if f < g else (g, f)
    return f if f > 0.0 else 0.0, g if g < 1.0 else 1.0


@inlined
def _nearer(z: float, rise: float, below: float, above: float) -> float:  # pragma: no cover - compiled
    """Height of a segment's beginning over a missile, m, where its nearest place comes as near as the flight may.

    rise: of the segment up to that place.
    """
    over = z + rise
    shift = min(over, below) if over > 0.0 else max(over, -above)
    return z - shift


@inlined
def _cell(place: float, count: int) -> int:  # pragma: no cover - compiled
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


@inlined
def _dose(along: float, start2: float, length2: float, radius: float, scale: float) -> float:  # pragma: no cover
    """Mean kill density of a segment that enters a sphere; see `window_exposure`."""
    if length2 < 1e-12:
        return window_exposure(0.0, 1.0, length2, along, start2, scale)
    middle = -along / length2
    half = math.sqrt(max(0.0, middle * middle - (start2 - radius * radius) / length2))
    enter, leave = max(0.0, middle - half), min(1.0, middle + half)
    return window_exposure(enter, leave, length2, along, start2, scale) if leave > enter else 0.0
