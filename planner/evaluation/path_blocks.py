"""Blocks of paths side by side: their scratch, rows of numbers with one a path, and the places of a leg in it."""

import numpy as np
from numpy.typing import NDArray

from world.frames import PolyMapRecord
from world.kernels import Record, inlined

Floats = NDArray[np.float64]

# Paths side by side: as many as leave a block's scratch in the fastest cache.
BLOCK = 128


def _rows(kind: type[np.generic], *names: str) -> list[tuple[str, type[np.generic], tuple[int]]]:
    return [(name, kind, (BLOCK,)) for name in names]


# A place of each path: position (m) and pixel.
_PLACE = np.dtype(_rows(np.float64, "east", "north", "up", "column", "row"), align=True)
# What is summed along a path.
_SUMS = np.dtype(
    _rows(np.float64, "below", "height", "kill", "detection", "turns", "slopes", "outside", "length"), align=True
)
BLOCK_SCRATCH = np.dtype(
    [
        # Both ends of a leg, the step between them, and a point of it.
        ("begin", _PLACE),
        ("end", _PLACE),
        ("step", _PLACE),
        ("point", _PLACE),
        # A leg's run, and the east, north and run of the one before it, m.
        *_rows(np.float64, "run", "east_before", "north_before", "run_before"),
        ("sums", _SUMS),
        # The ground at a point and the clearance wanted there, m.
        *_rows(np.float64, "ground", "need"),
        # The place within a pixel; within the map, from -1 to 1; and the row of a polynomial.
        *_rows(np.float64, "u", "v", "x", "y", "inner"),
        # Heights of the pixels about a point.
        *_rows(np.float32, "top_left", "top_right", "low_left", "low_right"),
        # A pixel or a cell, where a cell's units begin and how many there are, and the paths in question.
        *_rows(np.int64, "index", "first", "count", "asked"),
    ],
    align=True,
)


@inlined
def clear_sums(sums: Record) -> None:  # pragma: no cover - compiled
    """Begin all sums with 0."""
    for b in range(BLOCK):
        sums.below[b], sums.height[b], sums.kill[b], sums.detection[b] = 0.0, 0.0, 0.0, 0.0
        sums.turns[b], sums.slopes[b], sums.outside[b], sums.length[b] = 0.0, 0.0, 0.0, 0.0


@inlined
def copy_place(place: Record, out: Record, size: int) -> None:  # pragma: no cover - compiled
    """Copy one place of each path to another."""
    for b in range(size):
        out.east[b], out.north[b], out.up[b] = place.east[b], place.north[b], place.up[b]
        out.column[b], out.row[b] = place.column[b], place.row[b]


@inlined
def subtract_places(end: Record, begin: Record, size: int, out: Record) -> None:  # pragma: no cover - compiled
    """Fill in the step from one place of each path to another."""
    for b in range(size):
        out.east[b] = end.east[b] - begin.east[b]
        out.north[b] = end.north[b] - begin.north[b]
        out.up[b] = end.up[b] - begin.up[b]
        out.column[b] = end.column[b] - begin.column[b]
        out.row[b] = end.row[b] - begin.row[b]


@inlined
def divide_legs(
    begin: Record, step: Record, share: float, size: int, out: Record
) -> None:  # pragma: no cover - compiled
    """Fill in the point of each path's leg that lies this share of the step from its beginning."""
    for b in range(size):
        out.east[b] = begin.east[b] + share * step.east[b]
        out.north[b] = begin.north[b] + share * step.north[b]
        out.up[b] = begin.up[b] + share * step.up[b]
        out.column[b] = begin.column[b] + share * step.column[b]
        out.row[b] = begin.row[b] + share * step.row[b]


@inlined
def load_waypoints(
    to_pixel: PolyMapRecord, paths: Floats, begin: int, i: int, size: int, block: Record
) -> None:  # pragma: no cover - compiled
    """Fill in waypoint i of each path, and take it to the raster: `polymap`, for all of them at once."""
    end, x, y, inner = block.end, block.x, block.y, block.inner
    east, north, up = end.east, end.north, end.up
    for b in range(size):
        east[b] = paths[begin + b, i, 0]
        north[b] = paths[begin + b, i, 1]
        up[b] = paths[begin + b, i, 2]
    middle_x, middle_y, half_x, half_y = to_pixel.centre_x, to_pixel.centre_y, to_pixel.half_x, to_pixel.half_y
    for b in range(size):
        x[b] = (east[b] - middle_x) / half_x
        y[b] = (north[b] - middle_y) / half_y
    _horner(to_pixel.u, to_pixel.size, size, x, y, inner, end.column)
    _horner(to_pixel.v, to_pixel.size, size, x, y, inner, end.row)


@inlined
def _horner(
    coefficients: Floats, terms: int, size: int, x: Floats, y: Floats, inner: Floats, out: Floats
) -> None:  # pragma: no cover - compiled
    """Fill out with the sum of coefficients[i, j] x^i y^j, i + j < terms, of each path; inner is scratch."""
    for b in range(size):
        out[b] = 0.0
    for i in range(terms - 1, -1, -1):
        for b in range(size):
            inner[b] = 0.0
        for j in range(terms - 1 - i, -1, -1):
            coefficient = coefficients[i, j]
            for b in range(size):
                inner[b] = inner[b] * y[b] + coefficient
        for b in range(size):
            out[b] = out[b] * x[b] + inner[b]
