"""One tick of a flight that another program steers: place the state on the path, make the wind, fill a row."""

import math

import numpy as np
from numpy.typing import NDArray

from flight.guidance.navigation_error import navigate
from flight.guidance.path_kernels import Records, profile, project
from flight.simulation.tick import NOT_A_NUMBER, finish_tick, flight_status, sense
from flight.simulation.workspace import PATH_ROW, WORKSPACE, WORKSPACE_NUMBERS
from world.kernels import Record, compiled
from world.terrain import Heights

Floats = NDArray[np.float64]

# Pieces of the path ahead among which the aircraft may be.
_AHEAD = 4


@compiled
def autopilot_tick(block: Floats, heights: Heights) -> int:  # pragma: no cover - compiled
    """Do a tick on the block of a `flight.simulation.workspace.Workspace`, as `flight.simulation.tick.tick` does.

    The commands that stand in it are the other program's.  The flight completes where it passes the end of the path,
    once the program says that it has nothing before it but that.
    """
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    path: Record = block[WORKSPACE_NUMBERS:].view(PATH_ROW)
    settings, memory = work.settings, work.memory
    if not sense(work, heights):
        return NOT_A_NUMBER
    noise = work.noise[work.timing.row].navigation
    navigate(
        work.true, work.estimated, work.navigation, noise, settings.navigation_sigma, settings.navigation_time,
        work.timing.dt,
    )  # fmt: skip
    place_on_path(work.true, path.piece[: settings.pieces], path.node[: settings.nodes], memory)
    memory.speed_command = path.waypoint[memory.leg].airspeed
    if settings.on_last_leg:
        across, beyond = beyond_end(work.true, path.waypoint[: settings.waypoints])
        memory.done = beyond >= 0.0
        if memory.done:
            memory.cross_track = across
    finish_tick(work)
    return flight_status(work)


@compiled
def place_on_path(true: Record, pieces: Records, nodes: Records, memory: Record) -> None:  # pragma: no cover
    """Fill leg, distance, cross-track and height error of the memory: the nearest of the pieces from the last one on.

    true: a record of `flight.guidance.navigation_error.MOTION`.
    """
    k, least, distance, aside = memory.piece, math.inf, 0.0, 0.0
    for i in range(memory.piece, min(memory.piece + _AHEAD, pieces.shape[0])):
        piece = pieces[i]
        along, cross, _ = project(piece, true.east, true.north)
        outside = max(0.0, -along, along - piece.length)
        if math.hypot(cross, outside) < least:
            k, least = i, math.hypot(cross, outside)
            distance, aside = piece.start + along, cross
    memory.piece = k
    memory.distance = distance
    memory.cross_track = aside
    memory.leg = pieces[k].leg + (1 if distance > pieces[k].leg_change else 0)
    memory.height_error = true.up - profile(nodes, distance)[0]


@compiled
def beyond_end(true: Record, waypoints: Records) -> tuple[float, float]:  # pragma: no cover - compiled
    """How far right of the last leg (m), and how far past its end, the aircraft is."""
    a, b = waypoints[waypoints.shape[0] - 2], waypoints[waypoints.shape[0] - 1]
    length = math.hypot(b.east - a.east, b.north - a.north)
    east, north = (b.east - a.east) / length, (b.north - a.north) / length
    de, dn = true.east - b.east, true.north - b.north
    return de * north - dn * east, de * east + dn * north
