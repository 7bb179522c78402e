"""One tick of a flight from the ground to the ground that ArduPlane itself steers: its phases, and how it ends.

The phases are those of `flight.autopilots.arduplane.ground_law`, and so is how a flight ends in each.  What the program
does of them it says only of its mission's items: the rest is found by places and heights.
"""

import math

import numpy as np
from numpy.typing import NDArray

from flight.autopilots.arduplane.ground_law import (
    APPROACHING,
    ARDUPLANE_GROUND,
    FLARING,
    GROUND_NUMBERS,
    IN_AIR,
    TAKING_OFF,
    ended,
    feel,
)
from flight.autopilots.sitl.flight import place_on_path
from flight.simulation.tick import (
    NOT_A_NUMBER,
    PATH_ROW,
    WORKSPACE,
    WORKSPACE_NUMBERS,
    begin_tick,
    fill_tick,
)
from world.kernels import Record, compiled, inner
from world.terrain import Heights

Floats = NDArray[np.float64]

# An aircraft on a runway has lifted off so high over where it stood, m.
_LIFTED = 2.0
# It may be slow in its flare, which begins no higher over the landing point than this many of the glide's flare
# heights, or than this, m.
_FLARES, _LOW = 2.0, 6.0


@compiled
def program_ground_tick(block: Floats, heights: Heights) -> int:  # pragma: no cover - compiled
    """Do a tick on the block of a `flight.simulation.tick.Workspace`, as a law's tick does.

    The commands that stand in it are the program's.
    """
    path_begins = WORKSPACE_NUMBERS + GROUND_NUMBERS
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    own = block[WORKSPACE_NUMBERS:path_begins].view(ARDUPLANE_GROUND)[0]
    path: Record = block[path_begins:].view(PATH_ROW)
    settings, memory, ground = work.settings, work.memory, own.ground
    if not begin_tick(work, heights):
        return NOT_A_NUMBER
    ground.time = work.timing.tick * work.timing.dt
    feel(work.state, work.place.clearance, ground)
    place_on_path(work.true, path.piece[: settings.pieces], path.node[: settings.nodes], memory)
    memory.speed_command = path.waypoint[memory.leg].airspeed
    memory.done = False
    find_phase(work.true, ground, settings.on_last_leg)
    fill_tick(work)
    return ended(work, ground)


@inner
def find_phase(true: Record, ground: Record, on_last_leg: bool) -> None:  # pragma: no cover - compiled
    """Go on to the next phase when its time has come.

    true: of `flight.guidance.navigation_error.MOTION`.  ground: of
    `flight.autopilots.arduplane.ground_law.GROUND_STATE`.  on_last_leg: whether the program flies to its landing.
    """
    if ground.stage == TAKING_OFF:
        ground.lifted = ground.lifted or (ground.rolls and true.up > ground.low + _LIFTED and not ground.touches)
        if true.up > ground.top:
            ground.stage = IN_AIR
    elif ground.stage == IN_AIR:
        if on_last_leg:
            ground.stage = APPROACHING
    elif ground.stage < FLARING:
        off_e, off_n = true.east - ground.east, true.north - ground.north
        past = off_e * true.velocity_east + off_n * true.velocity_north > 0.0 and math.hypot(off_e, off_n) < 500.0
        if past or true.up - ground.up <= max(_LOW, _FLARES * ground.flare_height):
            ground.stage = FLARING
