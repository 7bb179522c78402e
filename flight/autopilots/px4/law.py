"""PX4's law, compiled: what it keeps from tick to tick, and one tick of navigation, guidance, energies and attitude.

Attitudes are followed through planfly's inner loops (`flight.guidance.inner_loops`), as late as PX4's controllers
follow them, whose gains are tuned to the aircraft and are no part of the law.
"""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from flight.autopilots.px4.lateral import wanted_bank
from flight.autopilots.px4.navigator import flown_to, is_last, navigate
from flight.autopilots.px4.parameters import PX4_PARAMETERS
from flight.autopilots.px4.tecs import update_tecs
from flight.guidance.equivalent_airspeed import true_by_equivalent
from flight.guidance.inner_loops import follow_roll, steer_elevator
from flight.guidance.path import find_on_path, leave_sharp_corners, profile
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
from world.kernels import Record, Records, compiled, inner, record_dtype
from world.terrain import Heights

Floats = NDArray[np.float64]

# What PX4's law keeps from tick to tick.
PX4_MEMORY = record_dtype(
    ("begun", np.bool_),  # whether a tick was flown
    # Navigation.
    ("leg", np.int64),  # number of the leg that is flown, from waypoint `leg` to `leg + 1`
    "from_east",  # m, where the leg's line begins
    "from_north",
    "from_up",  # m, where its slope begins
    "nearest",  # m, the smallest distance to the leg's end so far
    "reached_for",  # s since its end was reached
    "begun_up",  # m, where the aircraft was when the leg began
    ("at_rim", np.bool_),  # whether the rim of a loiter to a height was reached
    ("circling", np.bool_),  # whether a circle is followed now
    ("returning", np.bool_),  # whether it returns to launch; from_east, from_north and from_up are then where it began
    ("climbed", np.bool_),  # whether it is at the height that it returns at
    ("finished", np.bool_),  # whether the mission's last waypoint was reached
    "waited",  # s at the mission's end
    # Lateral.
    "side_acceleration",  # m/s^2 to the right, as demanded
    "airspeed_for_ground",  # m/s, that the least ground speed takes; 0 for none
    "roll_demand",  # rad
    # Height and speed.
    "height_asked",  # m, of the leg
    "height_reference",  # m, led to it
    "height_rate",  # m/s, of the reference
    "airspeed",  # m/s, smoothed
    "airspeed_rate",  # m/s^2
    "airspeed_demand",  # m/s, within its rate
    "energy_rate",  # m^2/s^3, of the total energy, smoothed
    "balance_sum",  # m^2/s^3, integral of what is amiss in the balance
    "throttle_sum",  # 0..1, integral of the energy rate that is missing
    "pitch_demand",  # rad, without the trim
    "throttle_demand",  # 0..1
)
# What it keeps in a `flight.simulation.tick.Workspace`.
PX4 = record_dtype(("memory", PX4_MEMORY), ("parameters", PX4_PARAMETERS))
PX4_NUMBERS = PX4.itemsize // 8

# A bank follows its demand so much later than FW_R_TC says, as a share of it, and a pitch angle: by the overshoots of
# PX4's flights of the Aerosonde, whose ailerons are fed forward what a roll rate takes and more (FW_RR_FF).
ROLL_LAG = 0.65
PITCH_LAG = 1.0
# A mission whose last height is not reached by then, or that is not once around its last waypoint, is over, s.
LONGEST_WAIT = 300.0


@compiled
def px4_tick(block: Floats, heights: Heights) -> int:  # pragma: no cover - compiled
    """One tick on the block of a `flight.simulation.tick.Workspace`: a key of its `ENDS`, or 0 to fly on."""
    path_begins = WORKSPACE_NUMBERS + PX4_NUMBERS
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    own = block[WORKSPACE_NUMBERS:path_begins].view(PX4)[0]
    path: Record = block[path_begins:].view(PATH_ROW)
    settings = work.settings
    if not begin_tick(work, heights):
        return NOT_A_NUMBER
    # PX4's estimate of the wind is slow: gusts are no part of it.
    air, place = work.air, work.place
    wind_east = air.wind_east * place.north_cos + air.wind_north * place.north_sin
    wind_north = air.wind_north * place.north_cos - air.wind_east * place.north_sin
    fly_as_px4(
        work.state, work.estimated, path.piece[: settings.pieces], path.node[: settings.nodes],
        path.waypoint[: settings.waypoints], wind_east, wind_north, work.gains, work.memory, own.parameters,
        own.memory, work.commands, work.timing.dt,
    )  # fmt: skip
    return end_tick(work)


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
) -> None:  # pragma: no cover - compiled
    """One tick of ``dt`` seconds: fill the commands, and the memories for the next one.

    wind: the way the air moves, m/s.
    parameters: a record of `flight.autopilots.px4.parameters.PX4_PARAMETERS`.
    own: of `flight.autopilots.px4.law.PX4_MEMORY`.
    The others are as `flight.autopilots.planfly.law.guide` takes them; the path is what the track is measured against,
    and no part of the law.
    """
    find_on_path(estimated, pieces, memory)
    memory.height_error = estimated.up - profile(nodes, memory.distance)[0]
    factor = true_by_equivalent(estimated.up)
    if not own.begun:
        _begin(state, estimated, waypoints, memory, parameters, own, factor)
    commanded = min(parameters.airspeed_max, max(parameters.airspeed_min, waypoints[own.leg].airspeed))
    # Guidance is told the true airspeed, and from 1.17 on the equivalent one as if it were that.
    told = factor if parameters.anticipates else 1.0
    navigate(estimated, waypoints, wind_east, wind_north, commanded * told, parameters, own, dt)
    # Where PX4 left a circle sooner than the path does, the rest of it is not flown; nor is it over before its time.
    while pieces[memory.piece].leg < own.leg - 1 and memory.piece + 1 < pieces.shape[0]:
        memory.piece += 1
    leave_sharp_corners(pieces, memory, own.leg)
    memory.done = memory.done and is_last(waypoints, own)
    wanted = max(commanded, own.airspeed_for_ground / told)
    memory.speed_command = min(parameters.airspeed_max, wanted) * factor
    if own.returning:
        end_return(estimated, waypoints[own.leg + 1], memory, dt)
    elif flown_to(waypoints, own) + 1 >= waypoints.shape[0]:
        _end_mission(estimated, waypoints[waypoints.shape[0] - 1], memory, parameters, own, dt)
    step = parameters.roll_slew * dt
    bank = wanted_bank(own.side_acceleration, parameters)
    own.roll_demand = min(own.roll_demand + step, max(own.roll_demand - step, bank)) if step > 0.0 else bank
    update_tecs(state, estimated, parameters, own, wanted, factor, dt)
    _follow(state, estimated, gains, memory, parameters, own, commands, dt)


@inner
def _end_mission(
    estimated: Record, b: Record, memory: Record, parameters: Record, own: Record, dt: float
) -> None:  # pragma: no cover - compiled
    """End the flight past the last waypoint b, at its height, or not for as long as is waited for it.

    Where the mission goes no further, PX4 circles there without end (`MissionBase::setEndOfMissionItems`): the flight
    goes onto it and once around.  A circle that is begun before the waypoint, and left at once because the height is
    there, does not end it.
    """
    here = own.waited > 0.0 or memory.done or own.circling or own.finished
    if not here or b.circle != 0.0:
        return
    own.waited += dt
    if own.finished:
        end_around(estimated, memory, dt)
        ended = memory.done
    else:
        # What circles at the end has not missed it.
        memory.returning = True
        ended = not b.ends and memory.done and abs(estimated.up - b.up) <= parameters.height_acceptance
    memory.done = ended or own.waited > LONGEST_WAIT


@inner
def _begin(
    state: Record, estimated: Record, waypoints: Records, memory: Record, parameters: Record, own: Record, factor: float
) -> None:  # pragma: no cover - compiled
    """Take over in steady flight at the first waypoint."""
    own.begun = True
    own.from_east, own.from_north, own.from_up = waypoints[0].east, waypoints[0].north, waypoints[0].up
    own.nearest = math.inf
    own.begun_up = estimated.up
    own.height_asked = estimated.up
    own.height_reference = estimated.up
    own.airspeed = state.airspeed
    own.airspeed_demand = state.airspeed
    # As it has flown before: what level flight here takes is known.
    own.pitch_demand = state.alpha - parameters.pitch_trim
    own.balance_sum = own.pitch_demand * state.airspeed * GRAVITY
    own.throttle_demand = memory.trim_throttle
    trim = min(parameters.throttle_max, max(parameters.throttle_min, parameters.throttle_trim * factor))
    own.throttle_sum = memory.trim_throttle - trim


@inner
def _follow(
    state: Record,
    estimated: Record,
    gains: Record,
    memory: Record,
    parameters: Record,
    own: Record,
    commands: Record,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """Roll and pitch to their demands, each with the lag of PX4's controllers; throttle as it is demanded."""
    before = memory.bank_rate
    rate = (own.roll_demand - memory.bank) / (ROLL_LAG * parameters.roll_time)
    if parameters.roll_rate_max > 0.0:
        rate = min(parameters.roll_rate_max, max(-parameters.roll_rate_max, rate))
    rate = min(gains.roll_rate_max, max(-gains.roll_rate_max, rate))
    limit = gains.roll_acceleration_max * dt
    rate = before + min(limit, max(-limit, rate - before))
    follow_roll(state, gains, memory, commands, memory.bank + rate * dt, rate, (rate - before) / dt, dt)
    pitch_rate = (own.pitch_demand + parameters.pitch_trim - state.pitch) / (PITCH_LAG * parameters.pitch_time)
    pitch_rate = min(_FASTEST_PITCH, max(-_FASTEST_PITCH, pitch_rate))
    steer_elevator(state, gains, memory, commands, estimated.velocity_up, state.airspeed * pitch_rate)
    commands.throttle = own.throttle_demand


# FW_P_RMAX_POS and _NEG by default, rad/s.
_FASTEST_PITCH = math.radians(60.0)
