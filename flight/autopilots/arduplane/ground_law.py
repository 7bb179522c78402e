"""Run one compiled tick of ArduPlane's take-off or landing.

In the air the law is `flight.autopilots.arduplane.law`. Take-off and landing use the same law with other parameters
and demands:

Take-off (ArduPlane/takeoff.cpp, `Plane::verify_takeoff` in commands_logic.cpp): the wings are level until the ground
speed has been above 5 m/s (in 4.6 for two seconds). Then the aircraft holds a heading: the course over the ground at
that time, less the yaw since the launch. The throttle is open. The pitch controls the airspeed, but is never below the
pitch of the item. The bank is limited to LEVEL_ROLL_LIMIT up to TKOFF_LVL_ALT, and unrestricted from three times that
height. The take-off ends above the item's altitude, or TKOFF_PLIM_SEC after leveling off began. The next leg begins at
the aircraft, and follows no line.

Landing (libraries/AP_Landing/AP_Landing_Slope.cpp): the aircraft follows the extended line to the landing point, on the
glide of `flight.autopilots.arduplane.landing`. The approach stage begins when the aircraft is lined up, or at once
after a NAV_LOITER_TO_ALT; until then the airspeed is AIRSPEED_CRUISE. From then on the flare may begin: below
LAND_FLARE_ALT, or LAND_FLARE_SEC before the ground at the current sink rate on the second half of the line, or beyond
the landing point. In the flare the motor is off, the bank is at most LEVEL_ROLL_LIMIT, and the pitch at least
LAND_PITCH_DEG. The pitch controls the sink rate to TECS_LAND_SINK, as far as TECS_LAND_SPDWGT weights altitude over
airspeed. ArduPlane's real touchdown sink rate is known less well: see `docs/measured.md`.
"""

import math

import numpy as np

from flight.autopilots.arduplane.law import (
    ARDUPILOT_MEMORY,
    NAVIGATION_TICK_S,
    control_as_ardupilot,
    control_attitude,
    initialise_memory,
    update_terrain_lookahead,
)
from flight.autopilots.arduplane.navigator import keep_turn_side
from flight.autopilots.arduplane.parameters import ARDUPILOT_PARAMETERS
from flight.autopilots.arduplane.tecs import (
    airspeed_target,
    update_tecs,
)
from flight.dynamics.instructions import Code
from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.guidance.lateral_reference_laws import l1_acceleration, l1_angles, l1_integrate, l1_length
from flight.guidance.path import find_on_path
from flight.simulation.tick import (
    COMPLETED,
    END_BATTERY_EMPTY,
    END_OVERBANK,
    END_TIPPED_OVER,
    GROUND,
    LOSS_OF_CONTROL_BANK_RAD,
    NO_MOTOR,
    NOT_A_NUMBER,
    PATH_ROW,
    STALLED,
    WORKSPACE,
    WORKSPACE_NUMBERS,
    advance_model,
    airborne_end_code,
    begin_tick,
    end_tick,
    read_state,
)
from world.arrays import Floats, Heights
from world.geometry import wrap
from world.kernels import Record, Records, compiled, inner, record_dtype

# Maximum number of points of an aircraft that may touch the ground: JSBSim's own models have up to 19.
MAX_CONTACT_POINTS = 24
# Stages of a flight, in order: the take-off ...
TAKING_OFF = 0
# ... the legs of the mission ...
IN_AIR = 1
# ... the landing leg before the approach stage ...
ON_GLIDE = 2
# ... the approach stage ...
APPROACHING = 3
# ... and the flare.
FLARING = 4
GROUND_STATE = record_dtype(
    ("stage", np.int64),  # in a landing `type_slope_stage`
    ("has_landing", np.bool_),  # True if the flight ends on the ground
    ("is_on_runway", np.bool_),  # True for a take-off from a runway, which the aircraft may touch
    ("has_lifted_off", np.bool_),
    ("has_touched_down", np.bool_),  # True once it touched down
    "time",  # s since the release
    # Points that may touch the ground: m forward, right and down of the center of gravity.
    ("contact", np.float64, (MAX_CONTACT_POINTS, 3)),
    ("is_support", np.int64, (MAX_CONTACT_POINTS,)),  # 1 for a point on which the aircraft stands, else 0
    ("contacts", np.int64),
    ("touches_ground", np.bool_),
    ("is_tipped", np.bool_),  # True if the lowest touching point is not one on which the aircraft stands
    "turnover_speed",  # m/s, ground speed above which a tipped aircraft ends the flight
    "rest_time",  # s at rest
    # Take-off.
    "motor_start",  # s, time of the motor start
    "throttle_slew",  # fraction of the throttle range, 1/s
    "takeoff_throttle",  # 0..1, throttle
    "home_up",  # m AMSL, of home
    "takeoff_end_altitude",  # m AMSL, end of the take-off (`auto_state.takeoff_altitude_rel_cm` over home)
    "launch_up",  # m AMSL, of the launch
    "takeoff_pitch",  # rad, minimum of the climb (`auto_state.takeoff_pitch_cd`)
    ("leg", np.int64),  # leg after the take-off
    "time_at_course_speed",  # s since the ground speed was first above `_COURSE_SPEED_MPS`
    "yaw",  # rad, at the launch
    ("is_heading_held", np.bool_),
    "heading",  # rad, heading that is held (`steer_state.hold_course_cd`)
    # m below the end altitude at which leveling off began; 0 before
    # (`auto_state.height_below_takeoff_to_level_off_cm`).
    "leveling_height",
    "leveling_start",  # s since the release (`takeoff_state.level_off_start_time_ms`)
    ("rotation_complete", np.bool_),  # `auto_state.rotation_complete`
    "max_airspeed",  # m/s, maximum equivalent airspeed since the launch (`auto_state.highest_airspeed`)
    # Landing.
    ("landing_leg", np.int64),
    "east",  # m, of the landing point
    "north",
    "up",  # m AMSL
    "glide_start_altitude",  # m AMSL, of the waypoint before the landing point
    "slope",
    "flare_height",  # m above the landing point, start of the flare
    "flare_distance",  # m before the landing point, start of the flare
    "airspeed",  # m/s, equivalent
    "entry_sink",  # m/s, sink rate at the start of the flare (`_hgt_rate_at_flare_entry`)
    "entry_height",  # m above the landing point, at the start of the flare (`_hgt_at_start_of_flare`)
    ("approaches_at_once", np.bool_),  # True if a loiter to an altitude precedes the landing
    ("flares_by_demand", np.bool_),  # True if the flare begins with the demanded sink rate, False with the flown one
    # m AMSL, altitude demand of the flare that continues the glide's demand (`_flare_hgt_dem_adj`).
    "flare_adjusted",
    # m AMSL, altitude demand of the flare that continues the flown altitude (`_flare_hgt_dem_ideal`).
    "flare_ideal",
)
ARDUPLANE_GROUND = record_dtype(
    ("memory", ARDUPILOT_MEMORY),
    ("parameters", ARDUPILOT_PARAMETERS),
    ("stage_parameters", ARDUPILOT_PARAMETERS),  # parameters of the current stage
    ("ground", GROUND_STATE),
)
GROUND_NUMBERS = ARDUPLANE_GROUND.itemsize // 8

# Ground speed above which the course is known, m/s (GPS_GND_CRS_MIN_SPD).
_COURSE_SPEED_MPS = 5.0
# Time above that speed after which the heading is held, s; 4.7 holds it at once.
_HEADING_HOLD_DELAY_S = 2.0
# Product of L1's frequency and NAVL1_PERIOD: sqrt(2) pi.
_HEADING_GAIN = 4.4428
# Lowest pitch of a rotation after TKOFF_ROTATE_SPD, rad.
_MIN_ROTATION_PITCH_RAD = math.radians(5.0)
# A take-off levels off only above this height over home, m.
_MIN_LEVELING_HEIGHT_M = 10.0
# A take-off levels off only at more than this climb rate, m/s.
_MIN_LEVELING_CLIMB_RATE_MPS = 0.1
# The approach begins within this angle of the landing line, rad ...
_LINE_UP_ANGLE_RAD = math.radians(10.0)
# ... and within this cross-track distance, m.
_LINE_UP_CROSS_TRACK_M = 5.0
# The approach also begins past this fraction of the line, within that angle and below the start of the glide ...
_APPROACH_START_FRACTION = 0.15
# ... and past this fraction in any case.
_APPROACH_LATEST_FRACTION = 0.5
# Distance beyond the aircraft to which the landing line is extended, m.
_LINE_EXTENSION_M = 200.0
# First ground contact closer to the landing point than this is a touchdown, m.
_TOUCHDOWN_DISTANCE_M = 150.0
# The aircraft is at rest below this ground speed, m/s ...
_STOPPED_SPEED_MPS = 0.2
# ... for this time, s.
_STOPPED_TIME_S = 5.0
# Time after which a motor that has not started on a runway is assumed never to start, s.
_MOTOR_START_TIMEOUT_S = 10.0


@compiled
def ground_tick(block: Floats, heights: Heights) -> int:
    """Advance the flight in the block of a `flight.simulation.tick.Workspace` by one tick.

    Return the code of the flight's end, a key of `flight.simulation.tick.ENDS`, or 0 if the flight continues.
    """
    path_begins = WORKSPACE_NUMBERS + GROUND_NUMBERS
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    arduplane = block[WORKSPACE_NUMBERS:path_begins].view(ARDUPLANE_GROUND)[0]
    path: Record = block[path_begins:].view(PATH_ROW)
    settings, ground, memory = work.settings, arduplane.ground, arduplane.memory
    if not begin_tick(work, heights):
        return NOT_A_NUMBER
    ground.time = work.timing.tick * work.timing.dt
    waypoints = path.waypoint[: settings.waypoints]
    pieces = path.piece[: settings.pieces]
    update_ground_contact(work.state, work.place.clearance, ground)
    if ground.stage == TAKING_OFF:
        _tick_take_off(work, arduplane, waypoints, pieces)
    elif ground.stage == IN_AIR:
        update_terrain_lookahead(work, heights, waypoints, arduplane.parameters, memory)
        control_as_ardupilot(
            work.state,
            work.estimated,
            pieces,
            path.node[: settings.nodes],
            waypoints,
            work.gains,
            work.memory,
            arduplane.parameters,
            memory,
            work.commands,
            work.timing.dt,
        )
        if ground.has_landing and memory.leg >= ground.landing_leg:
            ground.stage = ON_GLIDE
            ground.approaches_at_once = waypoints[memory.leg].loiters_to_altitude
    else:
        find_on_path(work.estimated, pieces, work.memory)
        _tick_landing(work, arduplane, waypoints[memory.leg + 1])
    end_tick(work, block)
    return end_status(work, ground)


@compiled
def ground_loop(
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
        status = ground_tick(block, heights)
        if status != 0:
            return status
        advance_model(block, frames[0], numbers, code, contacts, frictions)
    return 0


@inner
def update_ground_contact(state: Record, clearance: float, ground: Record) -> None:
    """Update the flags that show whether the aircraft touches the ground and whether it has tipped over.

    The aircraft has tipped over if it does not stand on the lowest of its points that touch the ground. The ground is
    level, as in JSBSim.

    state: a `flight.dynamics.state.STATE` record.
    clearance: height of the center of gravity above ground, m.
    ground: a `GROUND_STATE` record.
    """
    ground.touches_ground, ground.is_tipped = False, False
    lowest_depth = clearance
    sin_pitch, cos_pitch = math.sin(state.pitch), math.cos(state.pitch)
    for k in range(ground.contacts):
        contact = ground.contact[k]
        depth = (
            cos_pitch * (math.sin(state.roll) * contact[1] + math.cos(state.roll) * contact[2]) - sin_pitch * contact[0]
        )
        if depth >= lowest_depth:
            # The lowest touching point decides whether the aircraft is tipped, because skids may sink into the ground.
            lowest_depth, ground.touches_ground, ground.is_tipped = depth, True, ground.is_support[k] == 0


@inner
def end_status(work: Record, ground: Record) -> int:
    """Return the code of the flight's end, or 0 if the flight continues.

    The codes are the keys of `flight.simulation.tick.ENDS`.

    work: a `flight.simulation.tick.WORKSPACE` record.
    ground: a `GROUND_STATE` record, filled by this control law or from the flight of ArduPlane's program.

    Ground contact ends the flight on the legs of the mission, after lift-off, and far from the landing point. Near the
    landing point it is a touchdown: the flight is complete once the aircraft has been at rest for `_STOPPED_TIME_S`.
    Take-off and landing also end if the aircraft banks too far or tips over, and with an empty battery in the air.
    A take-off ends if the motor does not start, and a landing if the aircraft stalls before the flare.
    """
    state, ground_speed = work.state, math.hypot(work.true.velocity_east, work.true.velocity_north)
    is_battery_empty = work.air.energy >= work.settings.battery
    if ground.stage == IN_AIR:
        return GROUND if ground.touches_ground else airborne_end_code(work)
    if abs(state.roll) > LOSS_OF_CONTROL_BANK_RAD:
        return END_OVERBANK
    if ground.is_tipped and ground_speed > ground.turnover_speed:
        return END_TIPPED_OVER
    if ground.stage == TAKING_OFF:
        if ground.touches_ground and (ground.has_lifted_off or not ground.is_on_runway):
            return GROUND
        if ground.is_on_runway and ground.motor_start > ground.time and ground.time > _MOTOR_START_TIMEOUT_S:
            return NO_MOTOR
        return END_BATTERY_EMPTY if is_battery_empty else 0
    if ground.touches_ground and not ground.has_touched_down:
        if math.hypot(ground.east - work.true.east, ground.north - work.true.north) > _TOUCHDOWN_DISTANCE_M:
            return GROUND
        ground.has_touched_down = True
    if ground.touches_ground and ground_speed < _STOPPED_SPEED_MPS:
        ground.rest_time += work.timing.dt
        return COMPLETED if ground.rest_time >= _STOPPED_TIME_S else 0
    ground.rest_time = 0.0
    if not ground.touches_ground and ground.stage < FLARING and state.airspeed < work.settings.min_airspeed:
        return STALLED
    return END_BATTERY_EMPTY if is_battery_empty and not ground.touches_ground else 0


# ----------------------------------------------------------------------
# Take-off.


@inner
def _tick_take_off(work: Record, arduplane: Record, waypoints: Records, pieces: Records) -> None:
    """Set the commands for one tick of the take-off; begin the first leg once the take-off is complete.

    Navigation and TECS run every `NAVIGATION_TICK_S`, the attitude controllers in each tick. The take-off is complete
    above its end altitude, or once the aircraft has leveled.

    work: state, commands and settings of the flight, a `WORKSPACE` record; updated.
    arduplane: parameters and internal states of the control law and of take-off and landing; updated.
    waypoints: `WAYPOINT` records of the route, (w,).
    pieces: pieces of the reference path.
    """
    state = work.state
    estimated = work.estimated
    ground = arduplane.ground
    memory = arduplane.memory
    dt, stage_parameters = work.timing.dt, arduplane.stage_parameters
    eas2tas = eas_to_tas_ratio(estimated.up)
    # The track is measured against the path only after the take-off.
    work.memory.leg, work.memory.distance = ground.leg, pieces[0].start
    work.memory.cross_track, work.memory.height_error = 0.0, 0.0
    if not memory.is_initialised:
        initialise_memory(state, estimated, waypoints, work.memory, arduplane.parameters, memory)
        ground.yaw = state.yaw
    ground.max_airspeed = max(ground.max_airspeed, state.airspeed / eas2tas)
    ground.has_lifted_off = ground.has_lifted_off or (
        ground.is_on_runway and estimated.up > ground.launch_up + 2.0 and not ground.touches_ground
    )
    memory.time_to_update -= dt
    if memory.time_to_update < 0.5 * dt:
        memory.time_to_update += NAVIGATION_TICK_S
        _demand_heading(state, estimated, arduplane.parameters, ground, memory)
        memory.altitude_demand_in, memory.altitude_demand_limited = estimated.up, estimated.up
        memory.altitude_demand, memory.climb_rate_demand = estimated.up, 0.0
        memory.max_climb_scaler, memory.max_sink_scaler = 1.0, 1.0
        roll_error = abs(memory.roll_demand - state.roll)
        _set_take_off_parameters(estimated, arduplane.parameters, stage_parameters, ground, roll_error)
        target_airspeed = min(
            stage_parameters.airspeed_max, max(stage_parameters.airspeed_min, waypoints[ground.leg].airspeed)
        )
        work.memory.speed_command = target_airspeed * eas2tas
        update_tecs(state, estimated, stage_parameters, memory, target_airspeed * eas2tas, eas2tas, NAVIGATION_TICK_S)
        _limit_rotation_pitch(estimated, arduplane.parameters, ground, memory)
    throttle_demand = ground.takeoff_throttle if ground.time >= ground.motor_start else 0.0
    max_step = ground.throttle_slew * dt
    throttle = min(work.commands.throttle + max_step, max(work.commands.throttle - max_step, throttle_demand))
    memory.throttle_demand = throttle
    control_attitude(state, estimated, work.gains, work.memory, stage_parameters, memory, eas2tas, work.commands, dt)
    if estimated.up > ground.takeoff_end_altitude or _is_leveled(arduplane.parameters, ground):
        _begin_first_leg(estimated, waypoints, pieces, work.memory, ground, memory)


@inner
def _is_leveled(parameters: Record, ground: Record) -> bool:
    """Return True once the aircraft has leveled off for TKOFF_PLIM_SEC at the end of a take-off.

    Follows `Plane::check_takeoff_timeout_level_off`.

    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    ground: state of take-off and landing, a `GROUND_STATE` record.
    """
    return ground.leveling_height > 0.0 and ground.time - ground.leveling_start > parameters.takeoff_leveling


@inner
def _limit_rotation_pitch(estimated: Record, parameters: Record, ground: Record, memory: Record) -> None:
    """Limit the pitch demand until the aircraft has rotated, if TKOFF_ROTATE_SPD is set.

    Below TKOFF_ROTATE_SPD the pitch demand is TKOFF_GND_PITCH. Above it, the pitch limit grows with the ground speed,
    from at least five degrees, until the ground speed exceeds AIRSPEED_CRUISE. Follows `Plane::takeoff_calc_pitch`.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    ground: state of the take-off; the end of the rotation is stored in it.
    memory: `ARDUPILOT_MEMORY` record; its pitch demand (rad) is limited.
    """
    if ground.rotation_complete:
        return
    ground_speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    if ground.max_airspeed < parameters.takeoff_rotation:
        memory.pitch_demand = parameters.takeoff_ground_pitch
    elif parameters.takeoff_rotation > 0.0 and ground_speed <= parameters.airspeed_cruise:
        pitch = max(_MIN_ROTATION_PITCH_RAD, ground_speed / parameters.airspeed_cruise * ground.takeoff_pitch)
        memory.pitch_demand = min(ground.takeoff_pitch, pitch)
    else:
        ground.rotation_complete = True


@inner
def _set_take_off_parameters(
    estimated: Record, parameters: Record, stage_parameters: Record, ground: Record, roll_error: float
) -> None:
    """Set the take-off's control parameters: fixed pitch, airspeed by pitch, bank limit by height.

    Follows `Plane::takeoff_calc_pitch`, `Plane::get_takeoff_pitch_min_cd` and `Plane::takeoff_calc_roll`.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    stage_parameters: copy of the parameters in which the limits of the take-off are set.
    ground: state of the take-off: its pitch and launch altitude, m AMSL; the start of the leveling is stored in it.
    roll_error: magnitude of demanded roll minus roll, rad; a large error reduces the pitch.
    """
    stage_parameters.tecs_speed_weight = 2.0
    stage_parameters.tecs_pitch_min = 0.0
    # Near its end the take-off levels off: the minimum pitch is reduced once the climb would reach the end altitude
    # within TKOFF_PLIM_SEC.
    remaining_height, leveling_fraction = ground.takeoff_end_altitude - estimated.up, 1.0
    if ground.leveling_height > 0.0:
        leveling_fraction = min(1.0, max(0.0, remaining_height / ground.leveling_height))
    elif (
        remaining_height <= parameters.takeoff_leveling * estimated.velocity_up
        and remaining_height > 0.0
        and estimated.velocity_up > _MIN_LEVELING_CLIMB_RATE_MPS
        and estimated.up - ground.home_up >= _MIN_LEVELING_HEIGHT_M
    ):
        ground.leveling_height, ground.leveling_start = remaining_height, ground.time
    stage_parameters.pitch_limit_min = ground.takeoff_pitch * leveling_fraction
    if parameters.stall_prevention > 0.0:
        stage_parameters.pitch_limit_min *= math.cos(min(0.5 * math.pi, roll_error)) ** 2
    # The minimum pitch is also the maximum: no observed take-off exceeded it, because TECS's integrators stay wound up.
    stage_parameters.pitch_limit_max = stage_parameters.pitch_limit_min
    level_height, height = parameters.takeoff_level_height, estimated.up - ground.launch_up
    fraction = min(1.0, max(0.0, (height - level_height) / (2.0 * level_height))) if level_height > 0.0 else 1.0
    min_roll_limit = min(parameters.level_roll_limit, parameters.roll_limit)
    stage_parameters.roll_limit = min_roll_limit + fraction * (parameters.roll_limit - min_roll_limit)


@inner
def _demand_heading(state: Record, estimated: Record, parameters: Record, ground: Record, memory: Record) -> None:
    """Set the lateral acceleration demand that holds the take-off heading; 0 until the heading is known.

    The heading is known after some time at a minimum ground speed. Follows `AP_L1_Control::update_heading_hold`.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    ground: state of the take-off; its heading is set once it is known.
    memory: `ARDUPILOT_MEMORY` record; its lateral acceleration (m/s^2) is set.
    """
    ground_speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    if ground.time_at_course_speed > 0.0 or ground_speed > _COURSE_SPEED_MPS:
        ground.time_at_course_speed += NAVIGATION_TICK_S
    delay = 0.0 if parameters.is_4_7 else _HEADING_HOLD_DELAY_S
    if not ground.is_heading_held and ground.time_at_course_speed > 0.0 and ground.time_at_course_speed >= delay:
        ground.is_heading_held = True
        course = math.atan2(estimated.velocity_east, estimated.velocity_north)
        ground.heading = course - wrap(state.yaw - ground.yaw)
    memory.lateral_acceleration = 0.0
    if ground.is_heading_held:
        heading_error = min(0.5 * math.pi, max(-0.5 * math.pi, wrap(ground.heading - state.yaw)))
        memory.lateral_acceleration = (
            2.0 * math.sin(heading_error) * ground_speed * _HEADING_GAIN / parameters.navl1_period
        )


@inner
def _begin_first_leg(
    estimated: Record, waypoints: Records, pieces: Records, guidance: Record, ground: Record, memory: Record
) -> None:
    """Begin the leg after the take-off at the aircraft's position.

    The aircraft flies straight to the end of the leg, without a line to follow (`Plane::set_next_WP`).

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    waypoints: `WAYPOINT` records of the route, (w,); the leg's end is marked as flown to without a line.
    pieces: pieces of the reference path; the guidance advances to the first one of the leg.
    guidance: `GUIDANCE_MEMORY` record; its piece is updated.
    ground: state of take-off and landing; its stage becomes `IN_AIR`.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record; updated.
    """
    ground.stage = IN_AIR
    memory.leg = ground.leg
    memory.from_east, memory.from_north, memory.from_up = estimated.east, estimated.north, estimated.up
    memory.from_item_height = 0.0
    waypoints[ground.leg + 1].without_crosstrack = True
    # Advance to the first piece of that leg.
    while pieces[guidance.piece].leg < ground.leg and guidance.piece + 1 < pieces.shape[0]:
        guidance.piece += 1


# ----------------------------------------------------------------------
# Landing.


@inner
def _tick_landing(work: Record, arduplane: Record, landing_point: Record) -> None:
    """Set the commands for one tick of the landing.

    Navigation and TECS run every `NAVIGATION_TICK_S`, the attitude controllers in each tick. In the flare the throttle
    closes at its slew rate.

    work: state, commands and settings of the flight, a `WORKSPACE` record; updated.
    arduplane: parameters and internal states of the control law and of take-off and landing; updated.
    landing_point: record of `flight.guidance.lateral_reference_laws.WAYPOINT` for the landing point.
    """
    state = work.state
    estimated = work.estimated
    ground = arduplane.ground
    memory = arduplane.memory
    dt, stage_parameters = work.timing.dt, arduplane.stage_parameters
    eas2tas = eas_to_tas_ratio(estimated.up)
    work.memory.is_finished = False
    memory.time_to_update -= dt
    if memory.time_to_update < 0.5 * dt:
        memory.time_to_update += NAVIGATION_TICK_S
        line_position = _follow_line_to_point(estimated, arduplane.parameters, ground, memory)
        _update_stage(estimated, arduplane.parameters, ground, memory, line_position)
        _demand_glide(estimated, arduplane.parameters, ground, memory, line_position[0])
        _set_landing_parameters(estimated, arduplane.parameters, stage_parameters, ground, line_position[1])
        commanded_airspeed = ground.airspeed if ground.stage > ON_GLIDE else arduplane.parameters.airspeed_cruise
        target_airspeed = airspeed_target(
            state, estimated, commanded_airspeed, landing_point, stage_parameters, memory, eas2tas
        )
        work.memory.speed_command = target_airspeed * eas2tas
        if ground.stage == FLARING:
            # The flare ignores underspeed, which begins only at full throttle.
            memory.throttle_demand = 0.0
        update_tecs(state, estimated, stage_parameters, memory, target_airspeed * eas2tas, eas2tas, NAVIGATION_TICK_S)
    work.memory.height_error = estimated.up - memory.altitude_demand
    previous_throttle = work.commands.throttle
    control_attitude(state, estimated, work.gains, work.memory, stage_parameters, memory, eas2tas, work.commands, dt)
    if ground.stage == FLARING:
        throttle_slew = arduplane.parameters.throttle_slew
        # Without a slew limit the throttle closes at once.
        work.commands.throttle = max(0.0, previous_throttle - throttle_slew * dt) if throttle_slew > 0.0 else 0.0


@inner
def _follow_line_to_point(
    estimated: Record, parameters: Record, ground: Record, memory: Record
) -> tuple[float, float, float, float]:
    """Set the lateral acceleration demand that follows the extended line to the landing point.

    Follows `AP_L1_Control::update_waypoint`.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    ground: state of the landing, with the landing point.
    memory: `ARDUPILOT_MEMORY` record with the start of the line; its demand and L1's integrator are updated.

    Return the remaining distance along the line (m), the fraction of the line already flown, the magnitude of L1's
    angle (`_last_Nu`, rad), and the magnitude of the cross-track error (m).
    """
    leg_e, leg_n = ground.east - memory.from_east, ground.north - memory.from_north
    line_length = max(1e-6, math.hypot(leg_e, leg_n))
    unit_e, unit_n = leg_e / line_length, leg_n / line_length
    offset_e, offset_n = estimated.east - memory.from_east, estimated.north - memory.from_north
    distance_along, cross_track = offset_e * unit_e + offset_n * unit_n, offset_e * unit_n - offset_n * unit_e
    extended_length = math.hypot(offset_e, offset_n) + _LINE_EXTENSION_M
    ground_speed = max(0.1, math.hypot(estimated.velocity_east, estimated.velocity_north))
    l1_distance = l1_length(ground_speed, parameters.navl1_period, parameters.navl1_damping)
    angle, aim_angle = l1_angles(
        estimated,
        memory.from_east,
        memory.from_north,
        memory.from_east + extended_length * unit_e,
        memory.from_north + extended_length * unit_n,
        l1_distance,
    )
    memory.cross_track_integrator = l1_integrate(
        aim_angle, memory.cross_track_integrator, parameters.navl1_xtrack_i, NAVIGATION_TICK_S
    )
    if not math.isnan(aim_angle):
        angle += aim_angle + memory.cross_track_integrator
    angle = keep_turn_side(estimated, angle, ground.east, ground.north, memory)
    memory.lateral_acceleration = l1_acceleration(angle, ground_speed, l1_distance, parameters.navl1_damping)
    return line_length - distance_along, distance_along / line_length, abs(angle), abs(cross_track)


@inner
def _update_stage(
    estimated: Record,
    parameters: Record,
    ground: Record,
    memory: Record,
    line_position: tuple[float, float, float, float],
) -> None:
    """Begin the approach stage or the flare once its condition is met.

    The approach begins once the aircraft is lined up, in any case after half of the line. The flare begins at a height,
    or at a time before the ground, or past the landing point. Follows `AP_Landing::type_slope_verify_land`.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    ground: state of the landing; its stage and the entry into the flare are set.
    memory: `ARDUPILOT_MEMORY` record with the altitude and climb rate demands.
    line_position: remaining distance (m), flown fraction, angle (rad) and cross-track error (m) on the line to the
        landing point, as `_follow_line_to_point` returns them.
    """
    _, fraction, line_angle, cross_track = line_position
    height, sink_rate = estimated.up - ground.up, -estimated.velocity_up
    if ground.stage == ON_GLIDE:
        is_lined_up = line_angle < _LINE_UP_ANGLE_RAD
        is_below_glide_start = (
            fraction > _APPROACH_START_FRACTION and is_lined_up and estimated.up < ground.glide_start_altitude
        )
        if (
            (fraction >= 0.0 and is_lined_up and cross_track < _LINE_UP_CROSS_TRACK_M)
            or is_below_glide_start
            or fraction > _APPROACH_LATEST_FRACTION
            or ground.approaches_at_once
        ):
            ground.stage = APPROACHING
    if ground.stage == FLARING:
        return
    flare_height_reached = height <= parameters.flare_height
    flare_time_reached = (
        parameters.flare_time > 0.0
        and height <= sink_rate * parameters.flare_time
        and fraction > _APPROACH_LATEST_FRACTION
    )
    if (ground.stage == APPROACHING and (flare_height_reached or flare_time_reached)) or fraction >= 1.0:
        ground.stage = FLARING
        ground.entry_sink = -memory.climb_rate_demand if ground.flares_by_demand else sink_rate
        ground.entry_height = height
        ground.flare_adjusted, ground.flare_ideal = memory.altitude_demand, estimated.up


@inner
def _demand_glide(
    estimated: Record, parameters: Record, ground: Record, memory: Record, remaining_distance: float
) -> None:
    """Set the altitude and climb rate demands on the glide or in the flare.

    In the flare the sink rate changes gradually to TECS_LAND_SINK.

    Follows `AP_Landing::type_slope_setup_landing_glide_slope` and `AP_TECS::_update_height_demand`.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    ground: state of the landing; its altitudes in the flare are updated.
    memory: `ARDUPILOT_MEMORY` record; its demands are set.
    remaining_distance: distance to the landing point along the line, m; negative beyond it.
    """
    memory.max_climb_scaler, memory.max_sink_scaler = 1.0, 1.0
    if ground.stage < FLARING:
        ground_speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
        glide_altitude = ground.up + ground.flare_height + ground.slope * (remaining_distance - ground.flare_distance)
        memory.altitude_demand = min(ground.glide_start_altitude, glide_altitude)
        memory.climb_rate_demand = -ground.slope * ground_speed if glide_altitude < ground.glide_start_altitude else 0.0
    else:
        height, entry_height = estimated.up - ground.up, ground.entry_height
        fraction = 1.0
        if entry_height > parameters.flare_holdoff:
            fraction = min(1.0, max(0.0, (entry_height - height) / (entry_height - parameters.flare_holdoff)))
        final_sink = parameters.landing_sink + parameters.landing_sink_change * max(0.0, -remaining_distance)
        memory.climb_rate_demand = -ground.entry_sink * (1.0 - fraction) - final_sink * fraction
        ground.flare_adjusted += memory.climb_rate_demand * NAVIGATION_TICK_S
        ground.flare_ideal += memory.climb_rate_demand * NAVIGATION_TICK_S
        # As in `AP_TECS::_update_height_demand` since 4.6.3.
        memory.altitude_demand = ground.flare_adjusted * (1.0 - fraction) + ground.flare_ideal * fraction
    memory.altitude_demand_in, memory.altitude_demand_limited = memory.altitude_demand, memory.altitude_demand


@inner
def _set_landing_parameters(
    estimated: Record, parameters: Record, stage_parameters: Record, ground: Record, line_fraction: float
) -> None:
    """Set the control parameters for the current stage of the landing in ``stage_parameters``.

    line_fraction: fraction of the line to the landing point that is already flown.
    estimated: estimated position and velocity over the ground, a `MOTION` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    ground: state of take-off and landing, a `GROUND_STATE` record.
    """
    stage_parameters.tecs_time = parameters.landing_time
    stage_parameters.airspeed_min = parameters.airspeed_min
    stage_parameters.tecs_pitch_damping = parameters.tecs_pitch_damping
    speed_weight = parameters.landing_speed_weight
    if speed_weight < 0.0:
        speed_weight = parameters.tecs_speed_weight * (1.0 - min(1.0, max(0.0, line_fraction)))
    stage_parameters.tecs_speed_weight = speed_weight
    stage_parameters.roll_limit, stage_parameters.pitch_limit_max = parameters.roll_limit, parameters.pitch_limit_max
    pitch_min = parameters.pitch_limit_min
    if parameters.tecs_pitch_min < 0.0:
        pitch_min = max(pitch_min, parameters.tecs_pitch_min)
    stage_parameters.tecs_pitch_min = 0.0
    if ground.stage == FLARING:
        stage_parameters.roll_limit = min(parameters.roll_limit, parameters.level_roll_limit)
        stage_parameters.tecs_pitch_damping = parameters.flare_damping
        if parameters.is_4_7 and parameters.airspeed_stall > 0.0:
            # `AP_TECS::_update_speed`, `Plane::calc_airspeed_errors`.
            stage_parameters.airspeed_min = parameters.airspeed_stall
        flare_progress = min(1.0, max(0.0, 1.0 - (estimated.up - ground.up) / max(0.1, ground.entry_height)))
        pitch_min = (1.0 - flare_progress) * pitch_min + flare_progress * max(pitch_min, parameters.landing_pitch)
        if parameters.landing_pitch_max != 0.0:
            stage_parameters.tecs_pitch_max = parameters.landing_pitch_max
            stage_parameters.pitch_limit_max = parameters.landing_pitch_max
    stage_parameters.pitch_limit_min = pitch_min
