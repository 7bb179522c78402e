"""Implement PX4's control law as compiled code, with its memory and a tick of navigation, guidance, TECS and attitude.

Attitude control uses planfly's inner loops (`flight.guidance.inner_loops`) with the lags of PX4's controllers, whose
gains are tuned to the aircraft and do not belong to the law.
"""

import math

import numpy as np

from aircraft.envelope import GRAVITY
from flight.autopilots.px4.lateral import bank_demand
from flight.autopilots.px4.navigator import flown_to, is_last, navigate
from flight.autopilots.px4.parameters import PX4_PARAMETERS
from flight.autopilots.px4.tecs import update_tecs
from flight.dynamics.instructions import Code
from flight.guidance.equivalent_airspeed import true_by_equivalent
from flight.guidance.inner_loops import follow_roll, steer_elevator
from flight.guidance.path import find_on_path, leave_sharp_corners, profile
from flight.simulation.compiled_loop import advance_model, read_state
from flight.simulation.tick import (
    NOT_A_NUMBER,
    PATH_ROW,
    WORKSPACE,
    WORKSPACE_NUMBERS,
    begin_tick,
    end_around,
    end_return,
    end_tick,
)
from world.arrays import Floats, Heights
from world.kernels import Record, Records, compiled, inner, record_dtype

# Memory of PX4's control law from tick to tick.
PX4_MEMORY = record_dtype(
    ("begun", np.bool_),  # True once a tick was flown
    # Navigation.
    ("leg", np.int64),  # current leg, from waypoint `leg` to `leg + 1`
    "from_east",  # m, start of the leg's line
    "from_north",
    "from_up",  # m, start of its altitude slope
    "nearest",  # m, smallest distance to the leg's end on this leg
    "reached_for",  # s since its end was reached
    "begun_up",  # m, altitude of the aircraft at the start of the leg
    ("at_rim", np.bool_),  # True once the rim of a loiter to an altitude was reached
    ("circling", np.bool_),  # True while a circle is followed
    ("returning", np.bool_),  # True during an RTL; from_east, from_north and from_up are then where the RTL began
    ("climbed", np.bool_),  # True once the return altitude is reached
    ("finished", np.bool_),  # True once the mission's last waypoint was reached
    "waited",  # s at the mission's end
    # Lateral.
    "side_acceleration",  # m/s^2 to the right, the demand
    "airspeed_for_ground",  # m/s, needed for the minimum ground speed; 0 if not needed
    "roll_demand",  # rad
    # Altitude and speed.
    "height_asked",  # m, altitude setpoint of the leg
    "height_reference",  # m, altitude reference that follows the setpoint
    "height_rate",  # m/s, of the reference
    "airspeed",  # m/s, smoothed
    "airspeed_rate",  # m/s^2
    "airspeed_demand",  # m/s, after the rate limit
    "energy_rate",  # m^2/s^3, STE rate, smoothed
    "balance_sum",  # m^2/s^3, SEB rate integrator
    "throttle_sum",  # 0..1, STE rate integrator
    "pitch_demand",  # rad, without the trim
    "throttle_demand",  # 0..1
)
# PX4's part of a `flight.simulation.tick.Workspace`.
PX4 = record_dtype(("memory", PX4_MEMORY), ("parameters", PX4_PARAMETERS))
PX4_NUMBERS = PX4.itemsize // 8

# Lag of the bank behind its demand, as a ratio to FW_R_TC.  From the overshoots of PX4's flights of the Aerosonde,
# whose aileron feed-forward (FW_RR_FF) gives more than a roll rate needs.
ROLL_LAG = 0.65
# Lag of the pitch behind its demand, as a ratio to FW_P_TC.
PITCH_LAG = 1.0
# Timeout at a mission's end, s: for reaching the last altitude, or for one lap around the last waypoint.
LONGEST_WAIT = 300.0


@compiled
def px4_tick(block: Floats, heights: Heights) -> int:
    """Advance the block of a `flight.simulation.tick.Workspace` by one tick.

    Return a key of its `ENDS`, or 0 to fly on.
    """
    path_begins = WORKSPACE_NUMBERS + PX4_NUMBERS
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    own = block[WORKSPACE_NUMBERS:path_begins].view(PX4)[0]
    path: Record = block[path_begins:].view(PATH_ROW)
    settings = work.settings
    if not begin_tick(work, heights):
        return NOT_A_NUMBER
    # PX4's wind estimate is slow: it contains no gusts.
    air, place = work.air, work.place
    wind_east = air.wind_east * place.north_cos + air.wind_north * place.north_sin
    wind_north = air.wind_north * place.north_cos - air.wind_east * place.north_sin
    fly_as_px4(
        work.state,
        work.estimated,
        path.piece[: settings.pieces],
        path.node[: settings.nodes],
        path.waypoint[: settings.waypoints],
        wind_east,
        wind_north,
        work.gains,
        work.memory,
        own.parameters,
        own.memory,
        work.commands,
        work.timing.dt,
    )
    return end_tick(work)


@compiled
def px4_loop(
    block: Floats,
    heights: Heights,
    frames: Records,
    numbers: Floats,
    code: Code,
    contacts: Records,
    frictions: Records,
    count: int,
) -> int:
    """Fly up to a number of ticks with a `flight.dynamics.compiled_model.CompiledModel`, and return the last status."""
    for _ in range(count):
        read_state(block, numbers, code)
        status = px4_tick(block, heights)
        if status != 0:
            return status
        advance_model(block, frames[0], numbers, code, contacts, frictions)
    return 0


@inner
def fly_as_px4(
    state: Record,
    estimated: Record,
    pieces: Records,
    nodes: Records,
    waypoints: Records,
    wind_east: float,
    wind_north: float,
    gains: Record,
    memory: Record,
    parameters: Record,
    own: Record,
    commands: Record,
    dt: float,
) -> None:
    """Fill the commands for one tick of ``dt`` seconds, and update the memories.

    wind: velocity of the air, m/s.
    parameters: a record of `flight.autopilots.px4.parameters.PX4_PARAMETERS`.
    own: a record of `flight.autopilots.px4.law.PX4_MEMORY`.
    The other parameters are those of `flight.autopilots.planfly.law.guide`.

    The path is only the reference against which the track is measured; the law does not use it.
    """
    find_on_path(estimated, pieces, memory)
    memory.height_error = estimated.up - profile(nodes, memory.distance)[0]
    airspeed_factor = true_by_equivalent(estimated.up)
    if not own.begun:
        _initialise_law(state, estimated, waypoints, memory, parameters, own, airspeed_factor)
    commanded_airspeed = min(parameters.airspeed_max, max(parameters.airspeed_min, waypoints[own.leg].airspeed))
    # Guidance gets the true airspeed; from 1.17 on it gets the equivalent airspeed and takes it for true.
    airspeed_scale = airspeed_factor if parameters.anticipates else 1.0
    navigate(estimated, waypoints, wind_east, wind_north, commanded_airspeed * airspeed_scale, parameters, own, dt)
    # Skip the rest of a loiter that PX4 left earlier than the path has it, and do not end the mission early.
    while pieces[memory.piece].leg < own.leg - 1 and memory.piece + 1 < pieces.shape[0]:
        memory.piece += 1
    leave_sharp_corners(pieces, memory, own.leg)
    memory.done = memory.done and is_last(waypoints, own)
    airspeed_setpoint = max(commanded_airspeed, own.airspeed_for_ground / airspeed_scale)
    memory.speed_command = min(parameters.airspeed_max, airspeed_setpoint) * airspeed_factor
    if own.returning:
        end_return(estimated, waypoints[own.leg + 1], memory, dt)
    elif flown_to(waypoints, own) + 1 >= waypoints.shape[0]:
        _end_mission(estimated, waypoints[waypoints.shape[0] - 1], memory, parameters, own, dt)
    max_step = parameters.roll_slew * dt
    demand = bank_demand(own.side_acceleration, parameters)
    own.roll_demand = (
        min(own.roll_demand + max_step, max(own.roll_demand - max_step, demand)) if max_step > 0.0 else demand
    )
    update_tecs(state, estimated, parameters, own, airspeed_setpoint, airspeed_factor, dt)
    _follow_attitude(state, estimated, gains, memory, parameters, own, commands, dt)


@inner
def _end_mission(
    estimated: Record, last_waypoint: Record, memory: Record, parameters: Record, own: Record, dt: float
) -> None:
    """End the flight once it is past the last waypoint and at its altitude, or after a timeout.

    At the mission's end PX4 loiters without end (`MissionBase::setEndOfMissionItems`): the flight joins that loiter
    and flies it once around.  A circle that begins before the waypoint, and is left at once because the altitude is
    reached, does not end the flight.
    """
    has_arrived = own.waited > 0.0 or memory.done or own.circling or own.finished
    if not has_arrived or last_waypoint.circle != 0.0:
        return
    own.waited += dt
    if own.finished:
        end_around(estimated, memory, dt)
        ended = memory.done
    else:
        # An aircraft that loiters at the mission's end has not missed the route.
        memory.returning = True
        ended = (
            not last_waypoint.ends
            and memory.done
            and abs(estimated.up - last_waypoint.up) <= parameters.height_acceptance
        )
    memory.done = ended or own.waited > LONGEST_WAIT


@inner
def _initialise_law(
    state: Record,
    estimated: Record,
    waypoints: Records,
    memory: Record,
    parameters: Record,
    own: Record,
    airspeed_factor: float,
) -> None:
    """Initialise the law in steady flight at the first waypoint."""
    own.begun = True
    own.from_east, own.from_north, own.from_up = waypoints[0].east, waypoints[0].north, waypoints[0].up
    own.nearest = math.inf
    own.begun_up = estimated.up
    own.height_asked = estimated.up
    own.height_reference = estimated.up
    own.airspeed = state.airspeed
    own.airspeed_demand = state.airspeed
    # Start with the trim of level flight here, as if the aircraft had flown before.
    own.pitch_demand = state.alpha - parameters.pitch_trim
    own.balance_sum = own.pitch_demand * state.airspeed * GRAVITY
    own.throttle_demand = memory.trim_throttle
    trim = min(parameters.throttle_max, max(parameters.throttle_min, parameters.throttle_trim * airspeed_factor))
    own.throttle_sum = memory.trim_throttle - trim


@inner
def _follow_attitude(
    state: Record,
    estimated: Record,
    gains: Record,
    memory: Record,
    parameters: Record,
    own: Record,
    commands: Record,
    dt: float,
) -> None:
    """Drive roll and pitch to their demands with the lags of PX4's controllers, and set throttle."""
    previous_rate = memory.bank_rate
    rate = (own.roll_demand - memory.bank) / (ROLL_LAG * parameters.roll_time)
    if parameters.roll_rate_max > 0.0:
        rate = min(parameters.roll_rate_max, max(-parameters.roll_rate_max, rate))
    rate = min(gains.roll_rate_max, max(-gains.roll_rate_max, rate))
    max_change = gains.roll_acceleration_max * dt
    rate = previous_rate + min(max_change, max(-max_change, rate - previous_rate))
    follow_roll(state, gains, memory, commands, memory.bank + rate * dt, rate, (rate - previous_rate) / dt, dt)
    pitch_rate = (own.pitch_demand + parameters.pitch_trim - state.pitch) / (PITCH_LAG * parameters.pitch_time)
    pitch_rate = min(_MAX_PITCH_RATE_RADPS, max(-_MAX_PITCH_RATE_RADPS, pitch_rate))
    steer_elevator(state, gains, memory, commands, estimated.velocity_up, state.airspeed * pitch_rate)
    commands.throttle = own.throttle_demand


# Limit of the pitch rate, rad/s: the default of FW_P_RMAX_POS and FW_P_RMAX_NEG.
_MAX_PITCH_RATE_RADPS = math.radians(60.0)
