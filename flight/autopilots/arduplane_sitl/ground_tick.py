"""Run one tick of an ArduPlane SITL flight from the ground to the ground, with its phases and its end.

The phases of a flight, and the events that end it, are defined in `flight.autopilots.arduplane.ground_law`. The
program reports only the number of the mission item; the phases follow from position and altitude.
"""

import math

from flight.autopilots.arduplane.ground_law import (
    APPROACHING,
    ARDUPLANE_GROUND,
    FLARING,
    GROUND_NUMBERS,
    IN_AIR,
    TAKING_OFF,
    end_status,
    update_ground_contact,
)
from flight.autopilots.sitl.flight import place_on_path
from flight.simulation.tick import (
    NOT_A_NUMBER,
    PATH_ROW,
    WORKSPACE,
    WORKSPACE_NUMBERS,
    begin_tick,
    end_tick,
)
from world.arrays import Floats, Heights
from world.kernels import Record, compiled, inner

# Height above its standing position at which an aircraft on a runway has lifted off, m.
_LIFT_OFF_HEIGHT_M = 2.0
# The aircraft is past the landing point if it flies away from it within this distance, m.
_MAX_PASSING_DISTANCE_M = 500.0
# From the start of the flare a low airspeed is no stall. The flare is taken to begin below this multiple of the
# glide's flare height above the landing point ...
_MAX_FLARE_HEIGHT_RATIO = 2.0
# ... or below this height, m.
_MIN_FLARE_HEIGHT_M = 6.0


@compiled
def program_ground_tick(block: Floats, heights: Heights) -> int:
    """Advance the flight in the block of a `flight.simulation.tick.Workspace` by one tick.

    Return the code of the flight's end, or 0 if the flight continues. The program has already set the commands in the
    block.
    """
    path_begins = WORKSPACE_NUMBERS + GROUND_NUMBERS
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    arduplane = block[WORKSPACE_NUMBERS:path_begins].view(ARDUPLANE_GROUND)[0]
    path: Record = block[path_begins:].view(PATH_ROW)
    settings, memory, ground = work.settings, work.memory, arduplane.ground
    if not begin_tick(work, heights):
        return NOT_A_NUMBER
    ground.time = work.timing.tick * work.timing.dt
    update_ground_contact(work.state, work.place.clearance, ground)
    place_on_path(work.true, path.piece[: settings.pieces], path.node[: settings.nodes], memory)
    memory.speed_command = path.waypoint[memory.leg].airspeed
    memory.is_finished = False
    update_phase(work.true, ground, settings.on_last_leg)
    end_tick(work, block)
    return end_status(work, ground)


@inner
def update_phase(true: Record, ground: Record, on_last_leg: bool) -> None:
    """Change to the next phase of the flight when its condition is met.

    The conditions are lift-off, the end of the climb, the last item, and the flare.

    true: a `flight.guidance.navigation_error.MOTION` record.
    ground: a `flight.autopilots.arduplane.ground_law.GROUND_STATE` record.
    on_last_leg: True if the program flies to its landing point.
    """
    if ground.stage == TAKING_OFF:
        ground.has_lifted_off = ground.has_lifted_off or (
            ground.is_on_runway and true.up > ground.launch_up + _LIFT_OFF_HEIGHT_M and not ground.touches_ground
        )
        if true.up > ground.takeoff_end_altitude:
            ground.stage = IN_AIR
    elif ground.stage == IN_AIR:
        if on_last_leg:
            ground.stage = APPROACHING
    elif ground.stage < FLARING:
        offset_east, offset_north = true.east - ground.east, true.north - ground.north
        is_past = (
            offset_east * true.velocity_east + offset_north * true.velocity_north > 0.0
            and math.hypot(offset_east, offset_north) < _MAX_PASSING_DISTANCE_M
        )
        if is_past or true.up - ground.up <= max(_MIN_FLARE_HEIGHT_M, _MAX_FLARE_HEIGHT_RATIO * ground.flare_height):
            ground.stage = FLARING
