"""Implement ArduPlane's control law as compiled code: internal state, altitude demand, and one tick."""

import math

import numpy as np

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.navigator import navigate_legs, target_position
from flight.autopilots.arduplane.parameters import ARDUPILOT_PARAMETERS, IMMEDIATE_CLIMB
from flight.autopilots.arduplane.tecs import airspeed_target, limited_nav_roll, update_tecs
from flight.dynamics.instructions import Code
from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.guidance.inner_loops import follow_roll, steer_elevator
from flight.guidance.path import find_on_path, pass_sharp_corners, profile_at
from flight.mission.itinerary import ENDLESS_LOITER_TIME_S
from flight.simulation.tick import (
    MISSED_ROUTE_DISTANCE_M,
    NOT_A_NUMBER,
    PATH_ROW,
    WORKSPACE,
    WORKSPACE_NUMBERS,
    advance_model,
    airborne_end_code,
    begin_tick,
    end_tick,
    read_state,
    update_rtl_loiter,
)
from world.arrays import Floats, Heights
from world.frames import polymap
from world.kernels import Record, Records, compiled, inner, record_dtype
from world.terrain import pixel_height

# ----------------------------------------------------------------------
# Internal state of ArduPlane's control law, kept from tick to tick.

ARDUPILOT_MEMORY = record_dtype(
    "time_to_update",  # s until the next navigation update
    ("is_initialised", np.bool_),  # True once a tick was flown
    # Lateral: `AP_L1_Control`, `Plane::loiter` and `Plane::rtl`.
    ("leg", np.int64),  # current leg, from waypoint `leg` to `leg + 1`
    "from_east",  # m, start of the leg's line (`prev_WP_loc`)
    "from_north",
    "from_up",  # m, start of its altitude slope
    "from_item_height",  # m, height above terrain of the item at its start; 0 if that is no item above terrain
    "cross_track_integrator",  # rad, L1's cross-track integrator (`_L1_xtrack_i`)
    ("reached_loiter_target", np.bool_),  # True while the loiter is followed, not just approached (`_WPcircle`)
    ("loiter_started", np.bool_),  # True once this loiter was captured (`loiter.start_time_ms` is set)
    "loiter_time",  # s since the capture (compared with `loiter.time_max_ms`)
    "loiter_angle_sum",  # rad around the center since the capture, in the loiter's direction (`loiter.sum_cd`)
    "old_loiter_bearing",  # rad, from the center at the last update (`loiter.old_target_bearing_cd`: to the center)
    ("reached_target_altitude", np.bool_),  # True once reached, or abandoned (`loiter.reached_target_alt`)
    "next_sum_lap",  # rad around the loiter at which progress in altitude is checked next (`loiter.next_sum_lap_cd`)
    "start_lap_altitude",  # m, altitude at the last such check (`loiter.start_lap_alt_cm`)
    ("loiter_complete", np.bool_),  # True once the loiter's turns, time or altitude are done
    "exit_wait_angle",  # rad around the loiter since it was complete
    ("leg_after_loiter", np.int64),  # leg that followed the last loiter, 0 if none
    ("is_in_rtl", np.bool_),  # True during an RTL; from_east, from_north and from_up are then where the RTL began
    ("rtl_climb_complete", np.bool_),  # True once the climb that precedes the turn to home is done (`rtl.done_climb`)
    "l1_angle",  # rad, last angle of L1 to its aim, positive if the aircraft must turn left (`-_last_Nu`)
    "lateral_acceleration",  # m/s^2 to the right, the last demand (`_latAccDem`)
    "roll_demand",  # rad (`nav_roll_cd`)
    # Altitude: `Plane::target_altitude` and `AP_TECS::_update_height_demand`.
    "terrain_altitude",  # m AMSL, terrain at the aircraft
    "lookahead_rise",  # m, rise of the terrain ahead, from `AP_Terrain::lookahead`
    ("terrain_leg", np.int64),  # current leg above terrain, plus one; 0 before the first
    ("sloped_leg", np.int64),  # current leg with a slope between altitudes, plus one; 0 before the first
    "from_height_above_terrain",  # m, height above terrain at the start of the leg above terrain
    "altitude_offset",  # m, height above terrain to gain on that leg at its start (`target_altitude.offset_cm`)
    "altitude_demand_in",  # m, demand of the leg, frozen while the aircraft cannot follow it (`_hgt_dem_in`)
    "altitude_demand_limited",  # m, the same after the rate limit (`_hgt_dem_rate_ltd`)
    "altitude_demand",  # m, the same after the rate limit and the lag (`_hgt_dem`)
    "climb_rate_demand",  # m/s, rate of the altitude demand (`_hgt_rate_dem`)
    "max_climb_scaler",  # 0..1, fraction of the maximum climb rate that is demanded (`_max_climb_scaler`)
    "max_sink_scaler",  # 0..1, fraction of the maximum sink rate that is demanded (`_max_sink_scaler`)
    # 1 with throttle or pitch at its upper limit, -1 at its lower limit (`_thr_clip_status`, `_SEBdot_dem_clip`).
    ("saturation", np.int64),
    ("is_throttle_saturated", np.bool_),  # True with the throttle at its upper limit (`_thr_clip_status`)
    ("bad_descent", np.bool_),  # True while the demanded airspeed is too high for the aircraft (`_flags.badDescent`)
    # True while speed has priority over altitude, until the altitude demand is reached (`_flags.underspeed`).
    ("underspeed", np.bool_),
    "time_above_underspeed_threshold",  # s since the airspeed was last below it (from `_underspeed_start_ms`)
    # Airspeed: `AP_TECS::_update_speed`, `_update_speed_demand` and `Plane::calc_gndspeed_undershoot`.
    ("has_last_velocity", np.bool_),  # True once there is a previous velocity
    "last_velocity_east",  # m/s, at the last update
    "last_velocity_north",
    "last_velocity_up",
    "airspeed_smoothed",  # m/s, smoothed sensor reading (logged as `CTUN.As`)
    "tas",  # m/s, filtered from the reading and the acceleration (`_TAS_state`)
    "tas_rate_correction",  # m/s^2, correction of the acceleration by the filter (`_integDTAS_state`)
    "tas_rate",  # m/s^2, along the nose, mean removed (`_vel_dot` without `_vel_dot_lpf`)
    "tas_rate_mean",  # m/s^2 (`_vel_dot_lpf`)
    "tas_demand",  # m/s, within its rate limits (`_TAS_dem_adj`)
    "tas_rate_demand_mean",  # m/s^2, smoothed rate of the demand (`_TAS_rate_dem_lpf`)
    "tas_max_drop",  # m/s, by which the maximum airspeed is lowered while the throttle is saturated (from `_TASmax`)
    # m/s, equivalent, last raise of the airspeed for a minimum ground speed (`groundspeed_undershoot`).
    "ground_speed_undershoot",
    # Energy: `AP_TECS::_update_throttle_with_airspeed` and `_update_pitch`.
    "ste_rate_error",  # m^2/s^3, STE rate error, smoothed (`_STEdotErrLast`)
    "last_throttle_demand",  # 0..1, last throttle without its integrator (`_last_throttle_dem`)
    "ste_integrator",  # 0..1, STE integrator (`_integTHR_state`)
    "seb_integrator",  # m^2/s^3, SEB integrator (`_integSEBdot`)
    "ske_integrator",  # m^2/s^3, SKE integrator, positive when too fast (`_integKE`)
    "pitch_demand",  # rad, without the trim (`_pitch_dem`)
    "throttle_demand",  # 0..1 (`_throttle_dem`)
)
# ArduPlane's part of a `flight.simulation.tick.Workspace`.
ARDUPLANE = record_dtype(("memory", ARDUPILOT_MEMORY), ("parameters", ARDUPILOT_PARAMETERS))
ARDUPLANE_NUMBERS = ARDUPLANE.itemsize // 8


# ----------------------------------------------------------------------
# Altitude demand along a leg.

# An RTL that climbs before its turn demands this much more than the climb, m.
_RTL_CLIMB_EXTRA_M = 10.0


@inner
def update_height_demand(estimated: Record, target: Record, parameters: Record, memory: Record, dt: float) -> None:
    """Update the altitude demand for the current leg; it has a limited rate and lags its target.

    While throttle or pitch is at its limit, the target does not move further away from the aircraft. Follows
    `AP_TECS::_update_height_demand`.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    target: the leg's end, a record of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record; updated.
    dt: duration of a tick, s.
    """
    if target.is_rtl:
        altitude_target = _rtl_altitude(estimated, target, parameters, memory)
    elif target.follows_terrain:
        altitude_target = _terrain_following_altitude_demand(estimated, target, parameters, memory)
    else:
        altitude_target = _leg_altitude(estimated, target, parameters, memory)
    lag_fraction = dt / (dt + parameters.tecs_height_demand_time)
    # In saturation the input of the demand is frozen, and the limits of the climb and sink rates fade to 0.
    cannot_climb = memory.saturation > 0 and memory.climb_rate_demand > 0.0
    cannot_sink = memory.saturation < 0 and memory.climb_rate_demand < 0.0
    memory.max_climb_scaler += lag_fraction * ((0.0 if cannot_climb else 1.0) - memory.max_climb_scaler)
    memory.max_sink_scaler += lag_fraction * ((0.0 if cannot_sink else 1.0) - memory.max_sink_scaler)
    if cannot_climb:
        altitude_target = min(altitude_target, memory.altitude_demand_in)
    if cannot_sink:
        altitude_target = max(altitude_target, memory.altitude_demand_in)
    memory.altitude_demand_in = altitude_target
    max_climb = parameters.tecs_climb_max * memory.max_climb_scaler * dt
    max_sink = parameters.tecs_sink_max * memory.max_sink_scaler * dt
    memory.altitude_demand_limited += min(max_climb, max(-max_sink, altitude_target - memory.altitude_demand_limited))
    altitude_lag = memory.altitude_demand_limited - memory.altitude_demand
    memory.altitude_demand += lag_fraction * altitude_lag
    memory.climb_rate_demand = altitude_lag / max(dt, parameters.tecs_height_demand_time)


@inner
def _leg_altitude(estimated: Record, target: Record, parameters: Record, memory: Record) -> float:
    """Return the altitude demand on a leg at the aircraft's position, m AMSL.

    Usually the demand follows the slope from the leg's start to its end; on a leg to a loiter the slope ends at the
    loiter's center. The demand is the altitude of the leg's end in three cases: the altitude changes in a step or only
    a little; the aircraft is on a loiter; and, in 4.7, the aircraft climbs at a low height above home. Follows
    `Plane::set_target_altitude_proportion`.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    target: end of the leg, a `WAYPOINT` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: `ARDUPILOT_MEMORY` record with the start of the leg; the altitude of the start changes if the slope does.
    """
    end_altitude: float = target.up
    if memory.sloped_leg != memory.leg + 1:
        memory.sloped_leg = memory.leg + 1
        # A descent follows a slope. A climb is a step if FLIGHT_OPTIONS demands immediate climbs, and in 4.6 also if
        # the leg begins at a low height above home (`Plane::setup_glide_slope`, in 4.7 `setup_alt_slope`).
        begins_low = not parameters.is_4_7 and estimated.up - target.home_up <= parameters.climb_slope_height
        is_step = begins_low or int(parameters.flight_options) & IMMEDIATE_CLIMB != 0
        if end_altitude - estimated.up >= 0.0 and is_step:
            memory.from_up = end_altitude
    if memory.reached_loiter_target:
        return end_altitude
    altitude_change = end_altitude - memory.from_up
    end_e, end_n = target_position(target)
    leg_e, leg_n = end_e - memory.from_east, end_n - memory.from_north
    leg_length_squared = max(1e-6, leg_e * leg_e + leg_n * leg_n)
    progress = (
        (estimated.east - memory.from_east) * leg_e + (estimated.north - memory.from_north) * leg_n
    ) / leg_length_squared
    if abs(altitude_change) < parameters.altitude_slope_min or altitude_change == 0.0 or progress >= 1.0:
        return end_altitude
    if parameters.is_4_7 and altitude_change > 0.0 and estimated.up - target.home_up < parameters.climb_slope_height:
        return end_altitude
    remaining_fraction = 1.0 - max(0.0, progress)
    slope_altitude: float = end_altitude - altitude_change * remaining_fraction
    if memory.from_item_height != 0.0:
        # `Plane::constrain_target_altitude_location` compares the numbers of both ends: it takes the height above
        # terrain of an item for an altitude AMSL, so that a descent from there is usually a step.
        lower, upper = min(memory.from_item_height, end_altitude), max(memory.from_item_height, end_altitude)
        return min(upper, max(lower, slope_altitude))
    current_altitude: float = estimated.up
    slope_threshold = parameters.altitude_slope_threshold
    if slope_threshold <= 0.0 or altitude_change <= 0.0 or current_altitude <= slope_altitude + slope_threshold:
        return slope_altitude
    # If the aircraft is above a climbing slope by more than the threshold, the slope starts again at the aircraft.
    remaining_change = end_altitude - current_altitude
    if remaining_change < parameters.altitude_slope_min:
        memory.from_up = end_altitude
        return end_altitude
    memory.from_up = end_altitude - remaining_change / remaining_fraction
    return current_altitude


@inner
def _terrain_following_altitude_demand(estimated: Record, target: Record, parameters: Record, memory: Record) -> float:
    """Return the altitude demand (m AMSL) at the aircraft's position on a leg that follows the terrain.

    The demanded height above ground changes linearly along the leg, from the height above ground of the leg's start
    (`Plane::set_target_altitude_proportion_terrain`). If the terrain ahead rises faster than the aircraft climbs at
    half of its maximum climb rate, the excess height is added to the demand. A descent of the leg reduces this excess
    (`lookahead_adjustment` in ArduPlane/altitude.cpp). On a loiter the demand is the height above ground of the
    loiter. In the update in which a leg begins, the demand does not change.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    target: end of the leg, a `WAYPOINT` record, with its height above ground.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: `ARDUPILOT_MEMORY` record with the ground altitude at the aircraft and the terrain lookahead.
    """
    if memory.terrain_leg != memory.leg + 1:
        # The leg began in this update: `update_terrain_lookahead` has not yet looked up the ground at its start.
        return memory.altitude_demand_in
    if memory.reached_loiter_target:
        return memory.terrain_altitude + target.above_ground
    end_e, end_n = target_position(target)
    leg_e, leg_n = end_e - memory.from_east, end_n - memory.from_north
    leg_length_squared = max(1e-6, leg_e * leg_e + leg_n * leg_n)
    progress = (
        (estimated.east - memory.from_east) * leg_e + (estimated.north - memory.from_north) * leg_n
    ) / leg_length_squared
    height_demand = memory.from_height_above_terrain + min(1.0, max(0.0, progress)) * (
        target.above_ground - memory.from_height_above_terrain
    )
    return memory.terrain_altitude + height_demand + max(0.0, memory.lookahead_rise + min(0.0, memory.altitude_offset))


@inner
def update_terrain_lookahead(
    work: Record, heights: Heights, waypoints: Records, parameters: Record, memory: Record
) -> None:  # pragma: no cover
    """Update the ground altitude and the terrain lookahead, on a leg that follows the terrain.

    The lookahead is the height by which the terrain ahead exceeds what the aircraft can climb. The first update of a
    leg also stores the height above ground of the leg's start. As in `AP_Terrain::lookahead`, the terrain is sampled
    every TERRAIN_SPACING towards the waypoint, up to the waypoint or TERRAIN_LOOKAHD, and the climb rate is half of
    TECS_CLMB_MAX. Samples of unknown ground are ignored.

    work: estimated position and ground altitude, a record of `flight.simulation.tick.WORKSPACE`.
    heights: ground heights of the terrain by pixel, m.
    waypoints: `WAYPOINT` records of the route, (w,).
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record; updated.
    """
    target = waypoints[memory.leg + 1]
    # Before the first update of the control law, the start of the first leg is not set.
    if (
        not memory.is_initialised
        or not target.follows_terrain
        or memory.time_to_update - work.timing.dt >= 0.5 * work.timing.dt
    ):
        return
    estimated, ground_altitude = work.estimated, work.place.ground
    memory.terrain_altitude = memory.terrain_altitude if math.isnan(ground_altitude) else ground_altitude
    if memory.terrain_leg != memory.leg + 1:
        memory.terrain_leg = memory.leg + 1
        column, row = polymap(work.pixel_map, memory.from_east, memory.from_north)
        from_ground = pixel_height(heights, column, row)
        memory.from_height_above_terrain = memory.from_up - (
            memory.terrain_altitude if math.isnan(from_ground) else from_ground
        )
        height_gain = target.above_ground - (estimated.up - memory.terrain_altitude)
        memory.altitude_offset = height_gain if abs(height_gain) >= parameters.altitude_slope_min else 0.0
    memory.lookahead_rise = 0.0
    ground_speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    end_e, end_n = target_position(target)
    distance = math.hypot(end_e - estimated.east, end_n - estimated.north)
    lookahead_distance = min(distance, parameters.terrain_lookahead)
    if memory.reached_loiter_target or lookahead_distance <= 0.0 or ground_speed < 1.0:
        return
    step = parameters.terrain_spacing
    climb_per_step = 0.5 * parameters.tecs_climb_max / ground_speed * step
    step_e, step_n = step * (end_e - estimated.east) / distance, step * (end_n - estimated.north) / distance
    for k in range(1, math.ceil(lookahead_distance / step) + 1):
        column, row = polymap(work.pixel_map, estimated.east + k * step_e, estimated.north + k * step_n)
        rise = pixel_height(heights, column, row) - memory.terrain_altitude - k * climb_per_step
        if rise > memory.lookahead_rise:
            memory.lookahead_rise = rise


@inner
def _rtl_altitude(estimated: Record, rtl: Record, parameters: Record, memory: Record) -> float:
    """Return the altitude demand of an RTL, m AMSL.

    A descent follows a straight slope from the start of the RTL to the center of its loiter. A climb demands the
    target's altitude at once, and so does the loiter (`Plane::setup_glide_slope`, `Mode::update_target_altitude`).
    ArduPlane computes the slope to a rally point as if the point's altitude above home were an altitude AMSL. The
    demand never exceeds the altitude at which the RTL began (`Plane::set_offset_altitude_location`,
    `Plane::constrain_target_altitude_location`; seen in 20 flights). During the climb before the turn, the demand is
    above both the start and the target (`Plane::update_alt`).

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    rtl: loiter at the RTL's end, a `WAYPOINT` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: `ARDUPILOT_MEMORY` record with the position at which the RTL began.
    """
    end_altitude: float = rtl.up
    if not memory.rtl_climb_complete:
        return max(memory.from_up, end_altitude) + parameters.rtl_climb_min + _RTL_CLIMB_EXTRA_M
    descent = memory.from_up - end_altitude
    slope_descent = descent + rtl.slope_base
    if memory.reached_loiter_target or descent <= 0.0 or abs(slope_descent) < parameters.altitude_slope_min:
        return end_altitude
    leg_e, leg_n = rtl.centre_east - memory.from_east, rtl.centre_north - memory.from_north
    leg_length_squared = max(1e-6, leg_e * leg_e + leg_n * leg_n)
    progress = (
        (estimated.east - memory.from_east) * leg_e + (estimated.north - memory.from_north) * leg_n
    ) / leg_length_squared
    return min(memory.from_up, end_altitude + slope_descent * (1.0 - min(1.0, max(0.0, progress))))


# ----------------------------------------------------------------------
# One tick of ArduPlane: navigation and TECS run ten times a second, attitude control at every tick.
#
# Attitude control uses planfly's inner loops (`flight.guidance.inner_loops`) with the lags of ArduPlane's controllers,
# whose gains are tuned to the aircraft and are not part of this model.

# Interval between updates of navigation and TECS, s (ArduPlane's scheduler table: 10 Hz).
NAVIGATION_TICK_S = 0.1
# Lag of the bank behind its demand, as a ratio to RLL2SRV_TCONST.
ROLL_LAG_RATIO = 0.84
# Lag of the pitch behind its demand, as a ratio to PTCH2SRV_TCONST.
PITCH_LAG_RATIO = 1.1
# Initial value of the SKE integrator, m^2/s^3. The two pitch integrators balance each other, so steady flight does not
# determine it; the flight before the first waypoint has left 12 to 39, 27 on average, in 18 flights of ArduPlane.
INITIAL_SKE_INTEGRATOR = 27.0
# Limit of the pitch rate, rad/s.
_MAX_PITCH_RATE_RADPS = math.radians(40.0)


@compiled
def arduplane_tick(block: Floats, heights: Heights) -> int:
    """Advance the flight in the block of a `flight.simulation.tick.Workspace` by one tick.

    Return the code of the flight's end, a key of `flight.simulation.tick.ENDS`, or 0 if the flight continues.
    """
    path_begins = WORKSPACE_NUMBERS + ARDUPLANE_NUMBERS
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    arduplane = block[WORKSPACE_NUMBERS:path_begins].view(ARDUPLANE)[0]
    path: Record = block[path_begins:].view(PATH_ROW)
    settings = work.settings
    if not begin_tick(work, heights):
        return NOT_A_NUMBER
    update_terrain_lookahead(work, heights, path.waypoint[: settings.waypoints], arduplane.parameters, arduplane.memory)
    control_as_ardupilot(
        work.state,
        work.estimated,
        path.piece[: settings.pieces],
        path.node[: settings.nodes],
        path.waypoint[: settings.waypoints],
        work.gains,
        work.memory,
        arduplane.parameters,
        arduplane.memory,
        work.commands,
        work.timing.dt,
    )
    end_tick(work, block)
    return airborne_end_code(work)


@compiled
def arduplane_loop(
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
        status = arduplane_tick(block, heights)
        if status != 0:
            return status
        advance_model(block, frames[0], numbers, code, contacts, frictions)
    return 0


@inner
def control_as_ardupilot(
    state: Record,
    estimated: Record,
    pieces: Records,
    nodes: Records,
    waypoints: Records,
    gains: Record,
    guidance: Record,
    parameters: Record,
    memory: Record,
    commands: Record,
    dt: float,
) -> None:
    """Compute the commands for one tick of ``dt`` s, and update the records ``guidance`` and ``memory``.

    ArduPlane's navigation and TECS run every `NAVIGATION_TICK_S`, its attitude controllers in each tick. ArduPlane does
    not use the path: the track is only measured against it. ``guidance`` records the end of the last loiter or RTL.

    state, estimated: true attitude, airspeed and rates, a `STATE` record, and estimated motion, a `MOTION` record.
    pieces, nodes: course and altitude profile of the reference path, arrays of a `FlyByPath`.
    waypoints: `WAYPOINT` records of the route, (w,).
    gains, guidance: gains of the inner loops, and a `GUIDANCE_MEMORY` record with their state and the progress on the
        path.
    parameters, memory: ArduPlane's parameters, and the internal state of its law, an `ARDUPILOT_MEMORY` record.
    commands: `COMMANDS` record to fill.
    """
    find_on_path(estimated, pieces, guidance)
    target = waypoints[memory.leg + 1]
    if target.loiter_radius != 0.0 and not target.is_rtl:
        # ArduPlane's own logic ends a loiter; an aircraft that loiters at the mission's end has not missed the route.
        is_last = target.stop == waypoints[-1].stop
        # If ArduPlane ends the loiter without reaching its altitude, the route is missed.
        guidance.is_in_rtl = is_last and (
            not target.loiters_to_altitude or abs(estimated.up - target.up) <= MISSED_ROUTE_DISTANCE_M
        )
        # An unlimited loiter is flown for a minute and at least one lap.
        has_flown_enough = memory.loiter_time > ENDLESS_LOITER_TIME_S and memory.loiter_angle_sum >= 2.0 * math.pi
        loiters_forever = target.loiter_time == math.inf and has_flown_enough
        guidance.is_finished = is_last and (memory.loiter_complete or loiters_forever)
    if memory.is_in_rtl and waypoints[waypoints.shape[0] - 1].is_rtl:
        update_rtl_loiter(estimated, waypoints[memory.leg + 1], guidance, dt)
    guidance.height_error = estimated.up - profile_at(nodes, guidance.distance)[0]
    if guidance.is_finished and target.loiters_to_altitude:
        guidance.height_error = estimated.up - target.up
    eas2tas = eas_to_tas_ratio(estimated.up)
    if not memory.is_initialised:
        initialise_memory(state, estimated, waypoints, guidance, parameters, memory)
    memory.time_to_update -= dt
    if memory.time_to_update < 0.5 * dt:
        memory.time_to_update += NAVIGATION_TICK_S
        navigate_legs(estimated, waypoints, parameters, memory, eas2tas, NAVIGATION_TICK_S)
        # Skip the rest of a loiter that ArduPlane left earlier than the path does.
        while pieces[guidance.piece].leg < memory.leg_after_loiter - 1 and guidance.piece + 1 < pieces.shape[0]:
            guidance.piece += 1
        pass_sharp_corners(pieces, guidance, memory.leg)
        update_height_demand(estimated, waypoints[memory.leg + 1], parameters, memory, NAVIGATION_TICK_S)
        commanded_airspeed, target = waypoints[memory.leg].airspeed, waypoints[memory.leg + 1]
        target_airspeed = airspeed_target(state, estimated, commanded_airspeed, target, parameters, memory, eas2tas)
        guidance.speed_command = target_airspeed * eas2tas
        update_tecs(state, estimated, parameters, memory, target_airspeed * eas2tas, eas2tas, NAVIGATION_TICK_S)
    control_attitude(state, estimated, gains, guidance, parameters, memory, eas2tas, commands, dt)


@inner
def initialise_memory(
    state: Record, estimated: Record, waypoints: Records, guidance: Record, parameters: Record, memory: Record
) -> None:
    """Initialise the control law's internal state for steady flight at the first waypoint.

    Follows `AP_TECS::_initialise_states`.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    waypoints: `WAYPOINT` records of the route, (w,).
    guidance: `GUIDANCE_MEMORY` record, which states the throttle of level flight.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: `ARDUPILOT_MEMORY` record to initialise.
    """
    memory.is_initialised = True
    memory.from_east, memory.from_north, memory.from_up = waypoints[0].east, waypoints[0].north, waypoints[0].up
    memory.altitude_demand_in = estimated.up
    memory.altitude_demand_limited = estimated.up
    memory.altitude_demand = estimated.up
    memory.max_climb_scaler, memory.max_sink_scaler = 1.0, 1.0
    memory.airspeed_smoothed = state.airspeed
    memory.tas = state.airspeed
    memory.tas_demand = state.airspeed
    # Start with the trim of level flight here, as if the aircraft had flown before.
    memory.pitch_demand = state.alpha - parameters.pitch_trim
    memory.ske_integrator = INITIAL_SKE_INTEGRATOR
    memory.seb_integrator = memory.pitch_demand * state.airspeed * GRAVITY - INITIAL_SKE_INTEGRATOR
    memory.throttle_demand = guidance.trim_throttle
    memory.last_throttle_demand = parameters.throttle_cruise
    memory.ste_integrator = guidance.trim_throttle - parameters.throttle_cruise


@inner
def control_attitude(
    state: Record,
    estimated: Record,
    gains: Record,
    guidance: Record,
    parameters: Record,
    memory: Record,
    eas2tas: float,
    commands: Record,
    dt: float,
) -> None:
    """Drive roll and pitch to their demands with the lags of ArduPlane's controllers; set the throttle.

    Follows `Plane::stabilize_roll`, `Plane::stabilize_pitch` and `Plane::set_servos`.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    gains: gains of the inner loops, a `GAINS` record.
    guidance: state of the inner loops and progress on the path, a `GUIDANCE_MEMORY` record; updated.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record; updated.
    eas2tas: ratio of true to equivalent airspeed.
    commands: `COMMANDS` record to fill.
    dt: duration of a tick, s.
    """
    memory.roll_demand = limited_nav_roll(
        memory.lateral_acceleration, state.pitch, state.airspeed / eas2tas, parameters
    )
    previous_roll_rate = guidance.bank_rate
    roll_rate = (memory.roll_demand - guidance.bank) / (ROLL_LAG_RATIO * parameters.roll_time)
    roll_rate_max = min(gains.roll_rate_max, parameters.roll_rate_max)
    roll_rate = min(roll_rate_max, max(-roll_rate_max, roll_rate))
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
    # The rudder gets only its mix with the ailerons: the sideslip of a turn remains and widens the turn.
    commands.rudder = -parameters.rudder_mix * commands.aileron
    pitch_rate = (memory.pitch_demand + parameters.pitch_trim - state.pitch) / (PITCH_LAG_RATIO * parameters.pitch_time)
    pitch_rate = min(_MAX_PITCH_RATE_RADPS, max(-_MAX_PITCH_RATE_RADPS, pitch_rate))
    steer_elevator(state, gains, guidance, commands, estimated.velocity_up, state.airspeed * pitch_rate)
    commands.throttle = memory.throttle_demand
