"""Compute planfly's guidance in compiled code: from the aircraft's state to the four commands.

There are three lateral laws. Planfly's own is a second-order cross-track law with curvature feed-forward about the
offset path that a rolling aircraft can follow; it counters gusts by bank, and by a skid at the bank limit. L1 flies
along the legs, as in ArduPlane. The vector field of Beard and McLain flies along the fly-by path, whose arcs are its
fillets. The laws share bank limit, vertical channel and inner loops (`flight.guidance.inner_loops`), so that flights
differ only by the lateral law. No law uses the wind, because all use the velocity over the ground. The time step is
an argument.
"""

import math

from aircraft.envelope import GRAVITY
from aircraft.tracking import density_factor
from flight.dynamics.instructions import Code
from flight.guidance.inner_loops import follow_roll, steer_elevator, step_roll_model
from flight.guidance.lateral_reference_laws import (
    DEFAULT_ACCEPTANCE_RADIUS_M,
    field_course,
    has_reached_leg_end,
    l1_acceleration,
    l1_angles,
    l1_integrate,
    l1_length,
)
from flight.guidance.path import find_on_path, max_curvature, mean_curvature, profile_at
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
)
from world.arrays import Floats, Heights
from world.geometry import wrap
from world.kernels import Record, Records, compiled, inner
from world.scenario_tables import Guidance

# Value of `memory.lateral_law` for planfly's own law.
CROSS_TRACK = 0
# Value of `memory.lateral_law` for L1.
L1 = 1
# Value of `memory.lateral_law` for the vector field.
VECTOR_FIELD = 2
# Lateral laws by their names in a scenario's `[flight] guidance`.
LAWS: dict[Guidance, int] = {"path": CROSS_TRACK, "l1": L1, "vector-field": VECTOR_FIELD}
# Time constant of the energy rate, s.
_ENERGY_LAG_S = 1.0
# Time constant of the airspeed without its gusts, s.
_AIRSPEED_LAG_S = 2.0
# Multiple of the stall speed with level wings below which speed has priority over altitude immediately.
SAFE_SPEED_RATIO = 1.2
# The same multiple of the stall speed at the current bank; it gives the higher airspeed above 33 degrees of bank.
# The wing can then give 1.44 or 1.21 times the lift that it needs: a margin for gusts. With 1.2 in turns as well, an
# Aerosonde with 30 % more drag strayed 0.56 m instead of 0.16 m in one of 20 winds of moderate turbulence.
BANKED_SAFE_SPEED_RATIO = 1.1
# Lower limit of the bank's cosine in the load factor, as in `steer_elevator`, which demands no more lift.
_MIN_BANK_COSINE = 0.4
# Time in which the climb limit restores a low airspeed, s.
_SPEED_RECOVERY_TIME_S = 3.0
# Angle between the nose and the course at which the guidance no longer banks to turn the nose further away, rad.
_NOSE_LIMIT_RAD = math.radians(80.0)
# Bank allowed per rad between the nose and that angle, rad/rad; beyond that angle, opposite bank per rad of excess.
# With a bank limit of 40 degrees, full bank is allowed up to 70 degrees, and full opposite bank is demanded from 90.
# The nose settles there with a time constant of V / (4 g), 0.4 s for the Zagi at 15 m/s, which rolls within 0.25 s.
_BANK_PER_NOSE_ANGLE_RATIO = 4.0
# Fraction of the lateral acceleration at maximum bank that an arc may require before the aircraft slows down for it.
ARC_ACCELERATION_FRACTION = 0.95
# Lowest ground speed with which the lateral law computes, m/s.
_MIN_GROUND_SPEED_MPS = 5.0
# Lowest airspeed with which the longitudinal law computes, m/s.
_MIN_AIRSPEED_MPS = 8.0
# Largest cross-track error at which its integrator changes, m.
_MAX_INTEGRATED_CROSS_TRACK_M = 20.0
# Limit of the integrator of the cross-track error to either side, m s.
_MAX_CROSS_TRACK_INTEGRAL = 40.0
# Limit of the integrator of the vector field's course error to either side, rad s.
_MAX_COURSE_INTEGRAL = 1.0
# Largest climb rate to correct an altitude error, up or down, m/s.
_MAX_CLIMB_CORRECTION_MPS = 4.0
# Largest upward acceleration that is demanded, m/s^2.
_MAX_UPWARD_ACCELERATION_MPS2 = 8.0
# Largest downward acceleration that is demanded, m/s^2.
_MAX_DOWNWARD_ACCELERATION_MPS2 = 6.0
# Largest altitude error at which its integrator changes, m.
_MAX_INTEGRATED_HEIGHT_ERROR_M = 5.0
# Limit of the integrator of the altitude error to either side, m s.
_MAX_ALTITUDE_INTEGRAL = 5.0
# Limit of the integrator of the airspeed error to either side, m.
_MAX_SPEED_INTEGRAL_M = 60.0
# Longest tick for which the full lead of a correction is used, s.
FULL_LEAD_TICK_S = 1.0 / 60.0


@compiled
def planfly_tick(block: Floats, heights: Heights) -> int:
    """Advance the flight in the block of a `flight.simulation.tick.Workspace` by one tick.

    Return the code of the flight's end, a key of `flight.simulation.tick.ENDS`, or 0 if the flight continues.
    """
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    path: Record = block[WORKSPACE_NUMBERS:].view(PATH_ROW)
    settings = work.settings
    if not begin_tick(work, heights):
        return NOT_A_NUMBER
    guide(
        work.state,
        work.estimated,
        path.piece[: settings.pieces],
        path.node[: settings.nodes],
        path.waypoint[: settings.waypoints],
        work.gains,
        work.memory,
        work.commands,
        work.timing.dt,
    )
    end_tick(work, block)
    return airborne_end_code(work)


@compiled
def planfly_loop(
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
        status = planfly_tick(block, heights)
        if status != 0:
            return status
        advance_model(block, frames[0], numbers, code, contacts, frictions)
    return 0


@inner
def guide(
    state: Record,
    estimated: Record,
    pieces: Records,
    nodes: Records,
    waypoints: Records,
    gains: Record,
    memory: Record,
    commands: Record,
    dt: float,
) -> None:
    """Compute the commands for one tick of ``dt`` s, and update the guidance's internal state.

    state: a `flight.dynamics.state.STATE` record.
    estimated: a `flight.guidance.navigation_error.MOTION` record.
    pieces, nodes: arrays of a `flight.guidance.path.FlyByPath`.
    waypoints: `flight.guidance.lateral_reference_laws.WAYPOINT` records, (w,).
    gains: a `flight.guidance.gains.GAINS` record.
    memory: a `flight.guidance.inner_loops.GUIDANCE_MEMORY` record.
    commands: a `flight.dynamics.state.COMMANDS` record.
    dt: duration of a tick, s.
    """
    course = find_on_path(estimated, pieces, memory)
    memory.speed_command = waypoints[memory.leg].airspeed
    if memory.lateral_law == L1:
        # The next leg begins once L1 has reached the waypoint.
        speed = max(0.1, math.hypot(estimated.velocity_east, estimated.velocity_north))
        damping = gains.l1_damping
        l1_distance = l1_length(speed, gains.l1_period, damping)
        leg = memory.l1_leg
        start, end = waypoints[leg], waypoints[leg + 1]
        turn_distance = end.acceptance if end.acceptance > 0.0 else DEFAULT_ACCEPTANCE_RADIUS_M
        if leg + 2 < waypoints.shape[0] and has_reached_leg_end(estimated, start, end, l1_distance, turn_distance):
            leg += 1
            memory.l1_leg = leg
        start, end = waypoints[leg], waypoints[leg + 1]
        velocity_angle, aim_angle = l1_angles(estimated, start.east, start.north, end.east, end.north, l1_distance)
        memory.l1_integrator = l1_integrate(aim_angle, memory.l1_integrator, gains.l1_integral, dt)
        if not math.isnan(aim_angle):
            velocity_angle += aim_angle + memory.l1_integrator
        pitch = min(1.0, max(-1.0, state.pitch))
        acceleration = l1_acceleration(velocity_angle, speed, l1_distance, damping)
        bank_demand = math.atan(acceleration / (GRAVITY * math.cos(pitch)))
        bank = min(memory.max_bank, max(-memory.max_bank, bank_demand))
    elif memory.lateral_law == VECTOR_FIELD:
        # The bank for the arc plus a PI law on the course error, whose integrator is frozen at the bank limit.
        speed, curvature = math.hypot(estimated.velocity_east, estimated.velocity_north), pieces[memory.piece].curvature
        course_demand = field_course(
            course, memory.cross_track, curvature, gains.field_approach, gains.field_path, gains.field_orbit
        )
        course_error = wrap(course_demand - math.atan2(estimated.velocity_east, estimated.velocity_north))
        bank_demand = (
            math.atan(speed * speed * curvature / GRAVITY)
            + gains.field_course * course_error
            + gains.field_course_integral * memory.course_integrator
        )
        bank = min(memory.max_bank, max(-memory.max_bank, bank_demand))
        if bank == bank_demand:
            memory.course_integrator = min(
                _MAX_COURSE_INTEGRAL, max(-_MAX_COURSE_INTEGRAL, memory.course_integrator + course_error * dt)
            )
    else:
        bank = _cross_track_bank_command(state, estimated, pieces, gains, memory, course, dt)
    follow_altitude_profile(state, estimated, nodes, gains, memory, commands, course, dt)
    steer_bank(state, gains, memory, commands, bank, dt)


@inner
def _cross_track_bank_command(
    state: Record,
    estimated: Record,
    pieces: Records,
    gains: Record,
    memory: Record,
    course: float,
    dt: float,
) -> float:
    """Return the bank command of planfly's lateral law, rad.

    The command is a feed-forward of the path's curvature plus a correction of the cross-track error. The sideslip
    setpoint and the maximum ground speed for the arcs ahead are set as well.

    state, estimated: true attitude, airspeed and rates, a `STATE` record, and estimated motion, a `MOTION` record.
    pieces: straight and circular pieces of the reference path.
    gains, memory: gains of the control law, and its `GUIDANCE_MEMORY` record, which is updated.
    course: course of the path at the aircraft, rad.
    dt: duration of a tick, s.
    """
    speed = max(_MIN_GROUND_SPEED_MPS, math.hypot(estimated.velocity_east, estimated.velocity_north))
    ground_course = math.atan2(estimated.velocity_east, estimated.velocity_north)
    course_error = wrap(ground_course - course)
    # The horizontal lift is perpendicular to the heading, but the demanded acceleration is perpendicular to the course.
    drift = wrap(ground_course - state.yaw)
    crab = max(0.5, math.cos(drift))
    piece, distance = memory.piece, memory.distance
    # In a crosswind the turn changes the ground speed: predict the ground speed at the time at which the bank acts.
    future_speed = speed + gains.turn_lead * GRAVITY * math.tan(memory.bank) * math.sin(drift)
    start = distance + speed * max(0.0, gains.turn_lead - 0.5 * gains.turn_smoothing)
    turn_acceleration = (
        future_speed * future_speed * mean_curvature(pieces, piece, start, start + speed * gains.turn_smoothing)
    )
    offset_correction = _roll_offset_correction(
        pieces[piece].curvature, gains, memory, turn_acceleration, speed, crab, dt
    )
    correction = _lateral_correction(state, estimated, gains, memory, speed, course_error, crab, dt)
    # The bank lags, so the correction leads. A longer tick itself adds lag: with the full lead the aircraft would
    # oscillate in roll (45 degrees of bank at 30 Hz in moderate turbulence; 38 with half of it).
    correction_rate = (correction - memory.smoothed_correction) / gains.push_smoothing
    memory.smoothed_correction += correction_rate * min(dt, gains.push_smoothing)
    correction += offset_correction + gains.push_lead * min(1.0, (FULL_LEAD_TICK_S / dt) ** 2) * correction_rate
    lift_acceleration = GRAVITY + memory.slope_acceleration
    bank_demand = math.atan((turn_acceleration + correction) / (lift_acceleration * crab))
    # Do not turn the nose too far from the course: at `_NOSE_LIMIT_RAD` it is almost perpendicular to the course, and
    # turning further would not help against a crosswind; the aircraft would turn through 360 degrees. The result is
    # continuous in both angles unless the nose points straight back. A bank that already turns the nose back towards
    # the course fast enough is not changed.
    nose_angle = wrap(state.yaw - course)
    side = math.copysign(1.0, nose_angle)
    nose_limit = max(-memory.max_bank, _BANK_PER_NOSE_ANGLE_RATIO * (_NOSE_LIMIT_RAD - abs(nose_angle)))
    bank_demand = side * min(side * bank_demand, nose_limit)
    bank: float = min(memory.max_bank, max(-memory.max_bank, bank_demand))
    max_path_curvature = max_curvature(pieces, piece, distance, distance + speed * gains.arc_slowing_time)
    memory.max_arc_speed = math.sqrt(
        ARC_ACCELERATION_FRACTION * GRAVITY * math.tan(memory.max_bank) / max(1e-9, max_path_curvature)
    )
    # A limited skid, whose side force points into the turn, adds acceleration that the bank limit does not allow.
    missing_acceleration = lift_acceleration * (math.tan(bank_demand) - math.tan(bank))
    sideslip = missing_acceleration / max(1.0, gains.side_per_sideslip * _pressure_ratio(state, gains))
    memory.sideslip = -min(gains.sideslip_max, max(-gains.sideslip_max, sideslip))
    if bank == bank_demand and abs(memory.cross_track) < _MAX_INTEGRATED_CROSS_TRACK_M:
        memory.cross_track_integrator = min(
            _MAX_CROSS_TRACK_INTEGRAL,
            max(-_MAX_CROSS_TRACK_INTEGRAL, memory.cross_track_integrator + memory.cross_track * dt),
        )
    return bank


@inner
def _roll_offset_correction(
    curvature: float, gains: Record, memory: Record, turn_acceleration: float, speed: float, crab: float, dt: float
) -> float:
    """Return the acceleration to the right that corrects the offset from rolling at arcs, m/s^2.

    The offset arises because the aircraft needs time to roll into an arc and out of it.

    An aircraft needs time to change its bank, so it leaves the path where the curvature changes in a step. A model of
    the roll predicts this offset (m, positive to the right), and stores it in ``memory.roll_offset``: the lateral law
    follows the path with this offset. The returned acceleration brings the predicted offset back to 0.

    curvature: curvature of the path at the aircraft, 1/m.
    turn_acceleration: acceleration to the right for the path ahead, m/s^2.
    speed: ground speed, m/s.
    crab: cosine of the angle between heading and ground course.
    gains: gains of the control law and of the aircraft, a `GAINS` record.
    memory: `GUIDANCE_MEMORY` record; the predicted bank and offset are updated.
    dt: duration of a tick, s.
    """
    memory.path_bank, memory.path_bank_rate, _ = step_roll_model(
        math.atan(turn_acceleration / (GRAVITY * crab)), memory.path_bank, memory.path_bank_rate, gains, dt
    )
    frequency = gains.aside_frequency
    correction: float = -frequency * (2.0 * memory.roll_offset_rate + frequency * memory.roll_offset)
    memory.roll_offset_rate += (
        GRAVITY * math.tan(memory.path_bank) * crab - speed * speed * curvature + correction
    ) * dt
    memory.roll_offset += memory.roll_offset_rate * dt
    return correction


@inner
def _lateral_correction(
    state: Record,
    estimated: Record,
    gains: Record,
    memory: Record,
    speed: float,
    course_error: float,
    crab: float,
    dt: float,
) -> float:
    """Return the acceleration to the right that corrects cross-track errors and disturbances, m/s^2.

    The law has two loops: the cross-track error gives a demanded cross-track rate, and the error of this rate gives the
    acceleration. Two terms are subtracted, each times its gain: the integrator of the cross-track error, and the
    measured acceleration that neither lift nor ailerons explain.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    gains: gains of the inner loops, a `GAINS` record.
    memory: internal state of the guidance, a `GUIDANCE_MEMORY` record; updated.
    speed: ground speed, m/s.
    course_error: ground course minus course of the path, rad.
    crab: cosine of the angle between heading and ground course.
    dt: duration of a tick, s.
    """
    frequency = gains.cross_track_frequency
    rate_gain = 2.0 * gains.cross_track_damping * frequency
    max_cross_track_rate = speed * math.sin(gains.intercept)
    cross_track_rate_demand = min(
        max_cross_track_rate,
        max(-max_cross_track_rate, -(memory.cross_track - memory.roll_offset) * frequency * frequency / rate_gain),
    )
    # Flying away from the course is treated as flying perpendicular to it, because the sine would decrease again.
    is_flying_away = abs(course_error) > 0.5 * math.pi
    cross_track_rate = math.copysign(speed, course_error) if is_flying_away else speed * math.sin(course_error)
    correction: float = rate_gain * (cross_track_rate_demand - (cross_track_rate - memory.roll_offset_rate))
    correction -= gains.cross_track_integral * memory.cross_track_integrator
    # The smoothed acceleration to the right that neither lift nor ailerons cause, m/s^2. The estimate starts at the
    # second tick, because it needs the previous velocity.
    if memory.last_velocity_east != 0.0 or memory.last_velocity_north != 0.0:
        change_east = estimated.velocity_east - memory.last_velocity_east
        change_north = estimated.velocity_north - memory.last_velocity_north
        lateral_change = change_east * estimated.velocity_north - change_north * estimated.velocity_east
        lift_acceleration = (GRAVITY + (estimated.velocity_up - memory.last_velocity_up) / dt) * math.tan(state.roll)
        aileron_acceleration = gains.side_per_aileron * _pressure_ratio(state, gains) * state.aileron
        estimate = lateral_change / (speed * dt) - (lift_acceleration + aileron_acceleration) * crab
        memory.unexplained_acceleration += (estimate - memory.unexplained_acceleration) * min(1.0, dt / gains.side_lag)
    memory.last_velocity_east = estimated.velocity_east
    memory.last_velocity_north = estimated.velocity_north
    memory.last_velocity_up = estimated.velocity_up
    correction -= gains.side_gain * memory.unexplained_acceleration
    return correction


@inner
def _pressure_ratio(state: Record, gains: Record) -> float:
    """Return the ratio of the dynamic pressure to the dynamic pressure at the reference airspeed.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    gains: gains of the control law and of the aircraft, a `GAINS` record.
    """
    return (state.airspeed / gains.reference_airspeed) ** 2


@inner
def follow_altitude_profile(
    state: Record,
    estimated: Record,
    nodes: Records,
    gains: Record,
    memory: Record,
    commands: Record,
    course: float,
    dt: float,
) -> None:
    """Set the elevator to follow the path's altitude profile, and the throttle to hold the airspeed.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    nodes: altitude profile of the reference path.
    gains: gains of the inner loops, a `GAINS` record.
    memory: internal state of the guidance, a `GUIDANCE_MEMORY` record; updated.
    commands: `COMMANDS` record to fill.
    course: course of the path at the aircraft, rad.
    dt: duration of a tick, s.
    """
    airspeed = max(_MIN_AIRSPEED_MPS, state.airspeed)
    speed_along = max(1.0, estimated.velocity_east * math.sin(course) + estimated.velocity_north * math.cos(course))
    path_altitude, slope, _ = profile_at(nodes, memory.distance)
    _, slope_ahead, slope_rate = profile_at(nodes, memory.distance + speed_along * gains.slope_lead)
    height_error = estimated.up - path_altitude
    memory.height_error = height_error
    climb_rate = estimated.velocity_up
    frequency = gains.height_frequency
    rate_gain = 2.0 * gains.height_damping * frequency
    climb_rate_demand = slope * speed_along
    climb_rate_correction = min(
        _MAX_CLIMB_CORRECTION_MPS,
        max(-_MAX_CLIMB_CORRECTION_MPS, -height_error * frequency * frequency / rate_gain),
    )
    memory.slope_acceleration = slope_rate * speed_along * speed_along
    acceleration_demand = memory.slope_acceleration + rate_gain * (
        climb_rate_demand + climb_rate_correction - climb_rate
    )
    acceleration_demand -= gains.height_integral * memory.altitude_integrator
    max_acceleration = _max_upward_acceleration(state, estimated, gains, memory, commands, airspeed, rate_gain, dt)
    is_limited = acceleration_demand > max_acceleration
    acceleration_demand = min(
        _MAX_UPWARD_ACCELERATION_MPS2,
        max(-_MAX_DOWNWARD_ACCELERATION_MPS2, min(acceleration_demand, max_acceleration)),
    )
    if not is_limited and abs(height_error) < _MAX_INTEGRATED_HEIGHT_ERROR_M:
        memory.altitude_integrator = min(
            _MAX_ALTITUDE_INTEGRAL, max(-_MAX_ALTITUDE_INTEGRAL, memory.altitude_integrator + height_error * dt)
        )
    steer_elevator(state, gains, memory, commands, climb_rate, acceleration_demand)
    # The throttle: a feed-forward from the trim of level flight and the slope ahead, and a PI feedback of the airspeed
    # error. In and before an arc the ground speed is limited as well, as far as the airspeed allows.
    airspeed_error = memory.speed_command - airspeed
    if memory.max_arc_speed > 0.0:
        ground_speed_excess = math.hypot(estimated.velocity_east, estimated.velocity_north) - memory.max_arc_speed
        airspeed_error = min(airspeed_error, max(-ground_speed_excess, airspeed_error - gains.arc_slowing_max))
    feed_forward = memory.trim_throttle + gains.throttle_per_slope * slope_ahead * speed_along / airspeed
    throttle_demand = feed_forward + gains.speed_gain * airspeed_error + gains.speed_integral * memory.speed_integrator
    commands.throttle = min(1.0, max(0.0, throttle_demand))
    # The integrator is frozen while the throttle is saturated. Below the throttle at which thrust begins, which
    # increases with airspeed, it would wind up.
    idle_throttle = gains.throttle_idle * airspeed / gains.reference_airspeed
    if (throttle_demand < 1.0 or airspeed_error < 0.0) and (throttle_demand > idle_throttle or airspeed_error > 0.0):
        memory.speed_integrator = min(
            _MAX_SPEED_INTEGRAL_M, max(-_MAX_SPEED_INTEGRAL_M, memory.speed_integrator + airspeed_error * dt)
        )


@inner
def _max_upward_acceleration(
    state: Record,
    estimated: Record,
    gains: Record,
    memory: Record,
    commands: Record,
    airspeed: float,
    rate_gain: float,
    dt: float,
) -> float:
    """Return the maximum upward acceleration that the aircraft's energy allows, m/s^2.

    At constant airspeed the aircraft can climb at a rate equal to its specific excess power at full throttle. Above its
    minimum airspeed, it may climb faster. Below its minimum airspeed, it must climb more slowly, or descend, to regain
    speed. Near the stall the measured airspeed, gusts included, replaces the filtered airspeed, because a gust can
    stall the aircraft within a second. In a steep turn this protection starts at a higher airspeed, because the stall
    speed grows with the square root of the load factor.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    gains: gains of the inner loops, a `GAINS` record.
    memory: `GUIDANCE_MEMORY` record; its filtered airspeed and energy rate are updated.
    commands: `COMMANDS` record with the throttle of the last tick.
    airspeed: m/s.
    rate_gain: acceleration per error of the climb rate, 1/s.
    dt: duration of a tick, s.
    """
    climb_rate = estimated.velocity_up
    if memory.last_airspeed < 0.0:
        memory.last_airspeed = airspeed
        memory.filtered_airspeed = airspeed
        memory.energy_height_rate = climb_rate
    energy_rate = climb_rate + airspeed * (airspeed - memory.last_airspeed) / (dt * GRAVITY)
    memory.last_airspeed = airspeed
    memory.energy_height_rate += (energy_rate - memory.energy_height_rate) * dt / _ENERGY_LAG_S
    memory.filtered_airspeed += (airspeed - memory.filtered_airspeed) * dt / _AIRSPEED_LAG_S
    unused_climb = (1.0 - commands.throttle) / max(1e-3, gains.throttle_per_slope) * airspeed
    stall_speed = memory.stall_speed * density_factor(estimated.up)
    load_factor = 1.0 / max(_MIN_BANK_COSINE, math.cos(state.roll))
    stall_multiple = max(SAFE_SPEED_RATIO, BANKED_SAFE_SPEED_RATIO * math.sqrt(load_factor))
    safe_airspeed = min(memory.speed_command, stall_multiple * stall_speed)
    min_airspeed = max(safe_airspeed, memory.speed_command - gains.slow_margin)
    airspeed_excess = min(memory.filtered_airspeed - min_airspeed, airspeed - safe_airspeed)
    max_climb_rate = (
        memory.energy_height_rate + unused_climb + airspeed_excess * airspeed / (GRAVITY * _SPEED_RECOVERY_TIME_S)
    )
    return rate_gain * (max_climb_rate - climb_rate)


@inner
def steer_bank(state: Record, gains: Record, memory: Record, commands: Record, bank: float, dt: float) -> None:
    """Set the aileron from a bank command, and the rudder for coordination and yaw damping.

    A roll model answers the bank command as a critically damped oscillator within the limits of roll rate and roll
    acceleration, so it never overshoots. `follow_roll` makes the aircraft follow the model.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    gains: gains of the inner loops, a `GAINS` record.
    memory: `GUIDANCE_MEMORY` record; bank and bank rate of the roll model are updated.
    commands: `COMMANDS` record, whose aileron and rudder are set.
    bank: bank command, rad.
    dt: duration of a tick, s.
    """
    bank, roll_rate, roll_acceleration = step_roll_model(bank, memory.bank, memory.bank_rate, gains, dt)
    follow_roll(state, gains, memory, commands, bank, roll_rate, roll_acceleration, dt)
