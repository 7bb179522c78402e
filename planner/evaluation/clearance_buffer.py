"""The height above ground that a path needs: the required clearance, and a buffer that fixed ends may not have."""

import math
from typing import NamedTuple

from planner.evaluation.problem_arrays import ProblemArrays
from world.kernels import compiled, inlined

# Growth of the clearance buffer away from an end that starts without it, m per m.
BUFFER_GROWTH = 0.05


class RequiredClearance(NamedTuple):
    """What height above ground is required where; lengths in m.

    clearance: required everywhere; buffer: on top of it, away from the ends.
    start_east, start_north, destination_east, destination_north: the ends.
    start_buffer, destination_buffer: what the ends leave of the buffer.
    same_everywhere: whether they leave all of it.
    growth: what the buffer alone adds to the ground's slope, m per m.
    steepest_loss: fastest loss of height above what is required, m per m.
    sample_pitch: between samples of the terrain.
    """

    clearance: float
    buffer: float
    start_east: float
    start_north: float
    start_buffer: float
    destination_east: float
    destination_north: float
    destination_buffer: float
    same_everywhere: bool
    growth: float
    steepest_loss: float
    sample_pitch: float


@compiled
def required_clearance(data: ProblemArrays) -> RequiredClearance:  # pragma: no cover - compiled
    """What clearance a problem requires."""
    return _required(data, data.clearance, data.buffer, data.start_buffer, data.destination_buffer)


@compiled
def required_below(data: ProblemArrays) -> RequiredClearance:  # pragma: no cover - compiled
    """What a problem's greatest height above ground requires where heights of path and ground change their signs."""
    space = data.airspace
    return _required(data, -space.max_height, space.buffer, space.start_buffer, space.destination_buffer)


@inlined
def _required(
    data: ProblemArrays, clearance: float, buffer: float, start_buffer: float, destination_buffer: float
) -> RequiredClearance:  # pragma: no cover - compiled
    same_everywhere = min(start_buffer, destination_buffer) >= buffer
    growth = 0.0 if same_everywhere else BUFFER_GROWTH
    return RequiredClearance(
        clearance,
        buffer,
        data.start[0],
        data.start[1],
        start_buffer,
        data.destination[0],
        data.destination[1],
        destination_buffer,
        same_everywhere,
        growth,
        data.slope_bounds.steepest + growth,
        data.sample_pitch,
    )


@inlined
def clearance_at(required: RequiredClearance, east: float, north: float) -> float:  # pragma: no cover - compiled
    """Height above ground that a path needs here, m: the buffer grows from what the fixed ends leave of it."""
    # Without branches, so that a loop over many places becomes vector instructions: an end that leaves the whole
    # buffer takes nothing from it anywhere.
    dx, dy = east - required.start_east, north - required.start_north
    keep = required.start_buffer + BUFFER_GROWTH * math.sqrt(dx * dx + dy * dy)
    dx, dy = east - required.destination_east, north - required.destination_north
    other = required.destination_buffer + BUFFER_GROWTH * math.sqrt(dx * dx + dy * dy)
    keep = other if other < keep else keep
    keep = keep if keep < required.buffer else required.buffer
    need: float = required.clearance + keep
    return need
