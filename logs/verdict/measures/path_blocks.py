"""Consecutive moves of a path in blocks, compiled: what a block keeps clear of, none of its moves has to be asked."""

import math

import numpy as np
from numpy.typing import NDArray

from logs.verdict.measures.path_moves import move_point
from world.frames import PolyMapRecord, polymap
from world.kernels import Record, Records, compiled, record_dtype

Heights = NDArray[np.float32]

# Consecutive moves: their box on the map, their least and greatest height, and the steepest ground below them, m per m.
BLOCK = record_dtype("west", "east", "south", "north", "low", "high", "steepest")
# Moves of a block.
BLOCK_MOVES = 64


@compiled
def move_blocks(
    moves: Records, heights: Heights, to_pixel: PolyMapRecord, pitch: float, above_ground: bool
) -> Records:  # pragma: no cover - compiled
    """(b,) of `BLOCK`; the ground is looked at where a zone counts from it."""
    blocks = np.zeros((moves.shape[0] + BLOCK_MOVES - 1) // BLOCK_MOVES, BLOCK)
    for b in range(blocks.shape[0]):
        block = blocks[b]
        block.west, block.south, block.low = math.inf, math.inf, math.inf
        block.east, block.north, block.high = -math.inf, -math.inf, -math.inf
        for k in range(b * BLOCK_MOVES, min(moves.shape[0], (b + 1) * BLOCK_MOVES)):
            move = moves[k]
            east, north, up = move_point(move, 0.5)
            # No point of a move is further from its middle than half its length.
            half = 0.5 * move.length
            lift = 0.5 * abs(move.climb) + 1.25 * abs(move.bend)
            block.west, block.east = min(block.west, east - half), max(block.east, east + half)
            block.south, block.north = min(block.south, north - half), max(block.north, north + half)
            block.low, block.high = min(block.low, up - lift), max(block.high, up + lift)
        if above_ground:
            block.steepest = _steepest(block, heights, to_pixel, pitch)
    return blocks


@compiled
def _steepest(
    block: Record, heights: Heights, to_pixel: PolyMapRecord, pitch: float
) -> float:  # pragma: no cover - compiled
    """Steepest slope that the bilinear ground can have under a block, m per m; NaN adds nothing."""
    rows, cols = heights.shape
    west, south = polymap(to_pixel, block.west, block.south)
    east, north = polymap(to_pixel, block.east, block.north)
    # The map's axes may be turned against the raster's: both diagonals' ends.
    left, upper = polymap(to_pixel, block.west, block.north)
    right, lower = polymap(to_pixel, block.east, block.south)
    first_col, last_col = min(west, east, left, right), max(west, east, left, right)
    first_row, last_row = min(south, north, upper, lower), max(south, north, upper, lower)
    if not (last_col >= 0.0 and first_col <= cols - 1 and last_row >= 0.0 and first_row <= rows - 1):
        return 0.0
    steepest = 0.0
    for i in range(max(0, int(first_row) - 1), min(rows - 1, int(last_row) + 2)):
        for j in range(max(0, int(first_col) - 1), min(cols - 1, int(last_col) + 2)):
            over = max(abs(heights[i, j + 1] - heights[i, j]), abs(heights[i + 1, j + 1] - heights[i + 1, j]))
            down = max(abs(heights[i + 1, j] - heights[i, j]), abs(heights[i + 1, j + 1] - heights[i, j + 1]))
            steep = over * over + down * down
            # NaN compares as less.
            if steep > steepest:
                steepest = steep
    # A hair more, for what single precision rounds.
    return math.sqrt(steepest) / pitch * (1.0 + 1e-6)
