"""Simulate PX4's fixed-wing controllers in compiled code: navigation, guidance, TECS and attitude.

Attitude control uses planfly's inner loops (`flight.guidance.inner_loops`) with the lags of PX4's controllers, whose
gains are tuned to the aircraft and are not part of this model.
"""

import math

import numpy as np

from flight.autopilots.px4.lateral import roll_setpoint
from flight.autopilots.px4.navigator import find_target, is_last_target, navigate
from flight.autopilots.px4.parameters import PX4_PARAMETERS
from flight.autopilots.px4.tecs import update_tecs
from flight.dynamics.instructions import Code
from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.guidance.inner_loops import follow_roll, steer_elevator
from flight.guidance.path import find_on_path, pass_sharp_corners, profile_at
from flight.simulation.tick import (
    NOT_A_NUMBER,
    PATH_ROW,
    WORKSPACE,
    WORKSPACE_NUMBERS,
    advance_model,
    airborne_end_code,
    begin_tick,
    end_tick,
    read_state,
    update_end_loiter,
    update_rtl_loiter,
)
from world.arrays import Floats, Heights
from world.kernels import Record, Records, compiled, inner, record_dtype

# Internal state of PX4's controllers, kept from tick to tick.
PX4_MEMORY = record_dtype(
    ("is_initialised", np.bool_),  # True once a tick was flown
    # Navigation.
    ("leg", np.int64),  # current leg, from waypoint `leg` to `leg + 1`
    "from_east",  # m, start of the leg's line
    "from_north",
    "from_up",  # m, start of the leg's altitude slope
    "min_distance_to_end",  # m, minimum distance to the leg's end on this leg (`_min_current_sp_distance_xy`)
    "time_since_reached",  # s since the leg's end was reached
    "leg_start_altitude",  # m, altitude of the aircraft at the start of the leg
    ("rim_reached", np.bool_),  # True once the rim of a loiter to an altitude was reached
    ("is_loitering", np.bool_),  # True while the aircraft follows a circle
    ("is_in_rtl", np.bool_),  # True during an RTL; from_east, from_north and from_up are then where the RTL began
    ("rtl_climb_complete", np.bool_),  # True once the return altitude is reached
    ("mission_finished", np.bool_),  # True once the mission's last waypoint was reached
    "time_at_mission_end",  # s since the mission's end was reached
    # Lateral.
    "lateral_acceleration",  # m/s^2 to the right, setpoint
    "min_airspeed",  # m/s, required for the minimum ground speed; 0 if not required
    "roll_setpoint",  # rad
    # Altitude and speed.
    "altitude_setpoint",  # m, on the leg
    "altitude_reference",  # m, follows the setpoint (`AltitudeReferenceState::alt`)
    "altitude_rate_reference",  # m/s (`AltitudeReferenceState::alt_rate`)
    "tas",  # m/s, filtered true airspeed (`TECSAirspeedFilter`)
    "tas_rate",  # m/s^2 (`TECSAirspeedFilter`)
    "tas_setpoint",  # m/s, after the rate limit (`Setpoint::tas_setpoint`)
    "ste_rate",  # m^2/s^3, filtered (`_ste_rate_estimate_filter`)
    "pitch_integrator",  # rad, integrator of the SEB rate error (`_pitch_integ_state`)
    "throttle_integrator",  # 0..1, integrator of the STE rate error (`_throttle_integ_state`)
    "pitch_setpoint",  # rad above the trim pitch (`_pitch_setpoint`)
    "throttle_setpoint",  # 0..1 (`_throttle_setpoint`)
)
# PX4's part of a `flight.simulation.tick.Workspace`.
PX4 = record_dtype(("memory", PX4_MEMORY), ("parameters", PX4_PARAMETERS))
PX4_NUMBERS = PX4.itemsize // 8

# Lag of the roll behind its setpoint, as a ratio to FW_R_TC. From the overshoots of PX4's flights of the Aerosonde,
# whose aileron feed-forward (FW_RR_FF) gives more than a roll rate needs.
ROLL_LAG_RATIO = 0.65
# Lag of the pitch behind its setpoint, as a ratio to FW_P_TC.
PITCH_LAG_RATIO = 1.0
# Timeout at a mission's end, s: to reach the last altitude, or to fly once around the last waypoint.
MISSION_END_TIMEOUT_S = 300.0


@compiled
def px4_tick(block: Floats, heights: Heights) -> int:
    """Advance the flight in the block of a `flight.simulation.tick.Workspace` by one tick.

    Return the code of the flight's end, a key of `flight.simulation.tick.ENDS`, or 0 if the flight continues.
    """
    path_begins = WORKSPACE_NUMBERS + PX4_NUMBERS
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    px4 = block[WORKSPACE_NUMBERS:path_begins].view(PX4)[0]
    path: Record = block[path_begins:].view(PATH_ROW)
    settings = work.settings
    if not begin_tick(work, heights):
        return NOT_A_NUMBER
    # PX4's wind estimate is slow and contains no gusts.
    air, place = work.air, work.place
    wind_east = air.wind_east * place.north_cos + air.wind_north * place.north_sin
    wind_north = air.wind_north * place.north_cos - air.wind_east * place.north_sin
    control_as_px4(
        work.state,
        work.estimated,
        path.piece[: settings.pieces],
        path.node[: settings.nodes],
        path.waypoint[: settings.waypoints],
        wind_east,
        wind_north,
        work.gains,
        work.memory,
        px4.parameters,
        px4.memory,
        work.commands,
        work.timing.dt,
    )
    end_tick(work, block)
    return airborne_end_code(work)


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
    """Fly up to ``count`` ticks with a compiled model, and return the code of the flight's end.

    The code is 0 if the flight continues, otherwise a key of `flight.simulation.tick.ENDS`.

    block: block of a `flight.simulation.tick.Workspace`, with state, settings and path of the flight; updated.
    heights: ground heights of the terrain by pixel, m.
    frames, numbers, code, contacts, frictions: arrays of a `flight.dynamics.compiled_model.CompiledModel`: state of the
        motion, registers, instructions, landing-gear contacts and scratch for their friction.
    """
    for _ in range(count):
        read_state(block, numbers, code)
        status = px4_tick(block, heights)
        if status != 0:
            return status
        advance_model(block, frames[0], numbers, code, contacts, frictions)
    return 0


@inner
def control_as_px4(
    state: Record,
    estimated: Record,
    pieces: Records,
    nodes: Records,
    waypoints: Records,
    wind_east: float,
    wind_north: float,
    gains: Record,
    guidance: Record,
    parameters: Record,
    memory: Record,
    commands: Record,
    dt: float,
) -> None:
    """Compute the commands for one tick of ``dt`` seconds, and update ``guidance`` and ``memory``.

    wind_east, wind_north: velocity of the air, m/s.
    guidance: state of the inner loops and progress on the path, a `GUIDANCE_MEMORY` record.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: internal state of the control law, a `PX4_MEMORY` record.
    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    pieces, nodes: course and altitude profile of the reference path, arrays of a `FlyByPath`.
    waypoints: `WAYPOINT` records of the route, (w,).
    gains: gains of the inner loops, a `GAINS` record.
    commands: `COMMANDS` record to fill.

    PX4 does not use the path; the track is only measured against it.
    """
    find_on_path(estimated, pieces, guidance)
    guidance.height_error = estimated.up - profile_at(nodes, guidance.distance)[0]
    eas_to_tas = eas_to_tas_ratio(estimated.up)
    if not memory.is_initialised:
        _initialise_memory(state, estimated, waypoints, guidance, parameters, memory, eas_to_tas)
    commanded_airspeed = min(parameters.airspeed_max, max(parameters.airspeed_min, waypoints[memory.leg].airspeed))
    # Guidance gets the true airspeed; from 1.17 on it gets the equivalent airspeed, which it treats as true airspeed.
    airspeed_scale = eas_to_tas if parameters.uses_switch_distance else 1.0
    navigate(estimated, waypoints, wind_east, wind_north, commanded_airspeed * airspeed_scale, parameters, memory, dt)
    # Skip the rest of a loiter that PX4 left earlier than the path does, and do not end the mission early.
    while pieces[guidance.piece].leg < memory.leg - 1 and guidance.piece + 1 < pieces.shape[0]:
        guidance.piece += 1
    pass_sharp_corners(pieces, guidance, memory.leg)
    guidance.is_finished = guidance.is_finished and is_last_target(waypoints, memory)
    airspeed_setpoint = max(commanded_airspeed, memory.min_airspeed / airspeed_scale)
    guidance.speed_command = min(parameters.airspeed_max, airspeed_setpoint) * eas_to_tas
    if memory.is_in_rtl:
        update_rtl_loiter(estimated, waypoints[memory.leg + 1], guidance, dt)
    elif find_target(waypoints, memory) + 1 >= waypoints.shape[0]:
        _end_mission(estimated, waypoints[waypoints.shape[0] - 1], guidance, parameters, memory, dt)
    update_roll_setpoint(parameters, memory, dt)
    update_tecs(state, estimated, parameters, memory, airspeed_setpoint, eas_to_tas, dt)
    _control_attitude(state, estimated, gains, guidance, parameters, memory, commands, dt)


@inner
def update_roll_setpoint(parameters: Record, memory: Record, dt: float) -> None:
    """Move the roll setpoint towards the bank for the lateral acceleration, at a limited rate.

    The limit is FW_PN_R_SLEW_MAX; 0 is no limit.

    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: internal state of the control law, a `PX4_MEMORY` record.
    dt: duration of a tick, s.
    """
    max_roll_step = parameters.roll_slew_rate * dt
    limited_roll = roll_setpoint(memory.lateral_acceleration, parameters)
    memory.roll_setpoint = (
        min(memory.roll_setpoint + max_roll_step, max(memory.roll_setpoint - max_roll_step, limited_roll))
        if max_roll_step > 0.0
        else limited_roll
    )


@inner
def _end_mission(
    estimated: Record, last_waypoint: Record, guidance: Record, parameters: Record, memory: Record, dt: float
) -> None:
    """End the flight once PX4 has passed the last waypoint near its altitude, or after a timeout.

    If PX4 loiters indefinitely at the mission's end (`MissionBase::setEndOfMissionItems`), the flight ends after one
    lap of that loiter. A loiter before the last waypoint, in which PX4 corrects the altitude, does not end the flight.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    last_waypoint: `WAYPOINT` record; at a loiter the flight is not ended here.
    guidance: `GUIDANCE_MEMORY` record, whose end of the flight is set.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: internal state of the control law, a `PX4_MEMORY` record; updated.
    dt: duration of a tick, s.
    """
    has_arrived = (
        memory.time_at_mission_end > 0.0 or guidance.is_finished or memory.is_loitering or memory.mission_finished
    )
    if not has_arrived or last_waypoint.loiter_radius != 0.0:
        return
    memory.time_at_mission_end += dt
    if memory.mission_finished:
        update_end_loiter(estimated, guidance, dt)
        is_over = guidance.is_finished
    else:
        # An aircraft that loiters at the mission's end has not missed the route.
        guidance.is_in_rtl = True
        is_over = (
            not last_waypoint.is_mission_end
            and guidance.is_finished
            and abs(estimated.up - last_waypoint.up) <= parameters.altitude_acceptance_radius
        )
    guidance.is_finished = is_over or memory.time_at_mission_end > MISSION_END_TIMEOUT_S


@inner
def _initialise_memory(
    state: Record,
    estimated: Record,
    waypoints: Records,
    guidance: Record,
    parameters: Record,
    memory: Record,
    eas_to_tas: float,
) -> None:
    """Initialise the control law's internal state for steady flight at the first waypoint.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    waypoints: `WAYPOINT` records of the route, (w,).
    guidance: `GUIDANCE_MEMORY` record, which states the throttle of level flight.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: `PX4_MEMORY` record to initialise.
    eas_to_tas: ratio of true to equivalent airspeed.
    """
    memory.is_initialised = True
    memory.from_east, memory.from_north, memory.from_up = waypoints[0].east, waypoints[0].north, waypoints[0].up
    memory.min_distance_to_end = math.inf
    memory.leg_start_altitude = estimated.up
    memory.altitude_setpoint = estimated.up
    memory.altitude_reference = estimated.up
    memory.tas = state.airspeed
    memory.tas_setpoint = state.airspeed
    # Start with the trim of level flight, as after a long flight.
    memory.pitch_setpoint = state.alpha - parameters.pitch_trim
    memory.pitch_integrator = memory.pitch_setpoint
    memory.throttle_setpoint = guidance.trim_throttle
    throttle_trim = min(parameters.throttle_max, max(parameters.throttle_min, parameters.throttle_trim * eas_to_tas))
    memory.throttle_integrator = guidance.trim_throttle - throttle_trim


@inner
def _control_attitude(
    state: Record,
    estimated: Record,
    gains: Record,
    guidance: Record,
    parameters: Record,
    memory: Record,
    commands: Record,
    dt: float,
) -> None:
    """Drive roll and pitch to their setpoints with the lags of PX4's controllers; set the throttle.

    The roll rate is limited by PX4's parameter (0 for no limit) and by the aircraft's roll rate and acceleration.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    gains: gains of the inner loops, a `GAINS` record.
    guidance: state of the inner loops and progress on the path, a `GUIDANCE_MEMORY` record; updated.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: `PX4_MEMORY` record with the setpoints.
    commands: `COMMANDS` record to fill.
    dt: duration of a tick, s.
    """
    previous_roll_rate = guidance.bank_rate
    roll_rate = (memory.roll_setpoint - guidance.bank) / (ROLL_LAG_RATIO * parameters.roll_time_constant)
    if parameters.roll_rate_max > 0.0:
        roll_rate = min(parameters.roll_rate_max, max(-parameters.roll_rate_max, roll_rate))
    roll_rate = min(gains.roll_rate_max, max(-gains.roll_rate_max, roll_rate))
    max_change = gains.roll_acceleration_max * dt
    roll_rate = previous_roll_rate + min(max_change, max(-max_change, roll_rate - previous_roll_rate))
    follow_roll(
        state,
        gains,
        guidance,
        commands,
        guidance.bank + roll_rate * dt,
        roll_rate,
        (roll_rate - previous_roll_rate) / dt,
        dt,
    )
    pitch_rate = (memory.pitch_setpoint + parameters.pitch_trim - state.pitch) / (
        PITCH_LAG_RATIO * parameters.pitch_time_constant
    )
    pitch_rate = min(_MAX_PITCH_RATE_RADPS, max(-_MAX_PITCH_RATE_RADPS, pitch_rate))
    steer_elevator(state, gains, guidance, commands, estimated.velocity_up, state.airspeed * pitch_rate)
    commands.throttle = memory.throttle_setpoint


# Limit of the pitch rate, rad/s: the default of FW_P_RMAX_POS and FW_P_RMAX_NEG.
_MAX_PITCH_RATE_RADPS = math.radians(60.0)
