"""Limit ArduPlane's bank and airspeed, and demand throttle and pitch by TECS, as compiled code.

`flight.autopilots.arduplane.law` and `flight.autopilots.arduplane.parameters` define the records of internal state and
parameters.
"""

import math

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.parameters import FULL_LOAD_FACTOR_LIMIT
from world.kernels import Record, inner

# ----------------------------------------------------------------------
# Bank demand for a lateral acceleration, within the limits of the parameters and the airspeed.

# Lower bound of the bank limit when low airspeed reduces it, rad.
MIN_ROLL_LIMIT_RAD = math.radians(25.0)


@inner
def nav_roll(lateral_acceleration: float, pitch: float, parameters: Record) -> float:
    """Return the bank (rad) for a lateral acceleration (m/s^2), limited to ROLL_LIMIT_DEG.

    Follows `AP_L1_Control::nav_roll_cd`.

    pitch: rad.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    """
    # ArduPlane limits the pitch to 60 degrees here.
    cos_pitch = math.cos(min(math.radians(60.0), max(-math.radians(60.0), pitch)))
    bank = math.atan(lateral_acceleration / (GRAVITY * cos_pitch))
    return min(parameters.roll_limit, max(-parameters.roll_limit, bank))


@inner
def min_airspeed(bank: float, parameters: Record) -> float:
    """Return the minimum equivalent airspeed at a demanded bank (rad), m/s (`AP_TECS::_update_speed`).

    The minimum is AIRSPEED_MIN times the square root of the turn's load factor. If AIRSPEED_STALL is stated, the
    minimum is AIRSPEED_STALL times this root, but at least AIRSPEED_MIN. Without stall prevention the minimum is
    AIRSPEED_MIN.

    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    """
    if parameters.stall_prevention <= 0.0:
        return parameters.airspeed_min
    # The bank is limited to 85 degrees, to keep the load factor finite.
    load_factor_root = 1.0 / math.sqrt(math.cos(min(math.radians(85.0), abs(bank))))
    if parameters.airspeed_stall > 0.0:
        return max(parameters.airspeed_min, parameters.airspeed_stall * load_factor_root)
    return parameters.airspeed_min * load_factor_root


@inner
def load_factor_roll_limit(airspeed: float, min_level_airspeed: float, min_bank: float) -> float:
    """Return the maximum bank (rad) at which the aircraft does not stall, but at least ``min_bank``.

    airspeed: m/s.
    min_level_airspeed: minimum airspeed in straight flight, m/s; both airspeeds are equivalent, or both are true.
    min_bank: rad.
    """
    speed_ratio = max(1.0, airspeed / min_level_airspeed)
    return max(min_bank, math.acos(min(1.0, 1.0 / (speed_ratio * speed_ratio))))


@inner
def limited_nav_roll(lateral_acceleration: float, pitch: float, airspeed: float, parameters: Record) -> float:
    """Return the bank for a lateral acceleration (m/s^2), limited by ROLL_LIMIT_DEG and by the stall; rad.

    The limit by the stall grows with the airspeed. It applies only with stall prevention.

    Follows `Plane::calc_nav_roll` and `Plane::update_load_factor`.

    pitch: rad.
    airspeed: equivalent, m/s.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    """
    bank = nav_roll(lateral_acceleration, pitch, parameters)
    if parameters.stall_prevention <= 0.0:
        return bank
    min_level_airspeed, min_bank = parameters.airspeed_min, MIN_ROLL_LIMIT_RAD
    if parameters.is_4_7:
        # `Plane::apply_load_factor_roll_limits`.
        if parameters.airspeed_stall > 0.0:
            min_level_airspeed = parameters.airspeed_stall
            if int(parameters.flight_options) & FULL_LOAD_FACTOR_LIMIT:
                min_bank = 0.0
        min_bank = max(min_bank, parameters.level_roll_limit)
    roll_limit = load_factor_roll_limit(airspeed, min_level_airspeed, min_bank)
    return min(roll_limit, max(-roll_limit, bank))


# ----------------------------------------------------------------------
# Airspeed and altitude by TECS.
#
# TECS (Total Energy Control System, Lambregts, AIAA 83-2239) sets throttle from the error in total energy, and pitch
# from the error in the balance between potential and kinetic energy. The meaning of its parameters is from ArduPilot's
# documentation (ardupilot.org, Plane, "TECS ... Tuning Guide" and the parameter list). The formulas of throttle and
# pitch were found by regression of ArduPlane 4.6's flight logs (messages TECS, TEC2, TEC3); they reproduce the logged
# pitch demands to eight digits. The limits of the airspeed demand, bad descent and the fading of saturated integrators
# are rules of libraries/AP_TECS/AP_TECS.cpp (4.6.3), rewritten here.
#
# Energies are per kilogram, m^2/s^2; their rates m^2/s^3. Speeds are true airspeeds. Names as in AP_TECS: SPE and SKE
# are potential and kinetic energy, STE their sum, SEB their balance.

# Ratio of ArduPlane's airspeed reading to the true airspeed: the sensor noise raises the mean pressure. Measured in
# logs of 20 flights of ArduPlane 4.6 in planfly's physics: 1.0024 to 1.0030, in still air and in turbulence alike.
AIRSPEED_READING = 1.0027
# Fraction of a new sensor reading (ARSP.Airspeed) that enters ArduPlane's airspeed (CTUN.As), ten times a second, for
# use at the next update. From ArduPlane's logs.
_READING_FRACTION = 0.3
# Time constant of the smoothed STE rate error for throttle damping, s.
_STE_RATE_LAG_S = 0.5
# Damping ratio of the complementary filter that combines the airspeed reading and the acceleration.
_FILTER_DAMPING_RATIO = 1.414
# Pitch by which the SEB integrator may exceed the pitch limits, rad.
_PITCH_OVERSHOOT_RAD = math.radians(5.0)
# Throttle by which the STE integrator may exceed the throttle limits, 0..1.
_THROTTLE_OVERSHOOT_FRACTION = 0.1
# Limit of the SKE integrator, as a fraction of the pitch range in either direction.
_SKE_INTEGRATOR_FRACTION = 0.25
# Limit of the STE integrator, as a fraction of the throttle range.
_STE_INTEGRATOR_FRACTION = 0.5
# Fraction of the maximum energy rate that a rise of the airspeed may use.
_SPEED_RATE_FRACTION = 0.5
# Fraction of the maximum rate of energy loss that a fall of the airspeed may use.
_SPEED_LOSS_FRACTION = 0.9
# A bad descent begins above this STE error, m^2/s^2 ...
_BAD_DESCENT_ERROR_M2PS2 = 200.0
# ... with the throttle at or above this fraction of its maximum.
_BAD_DESCENT_THROTTLE_FRACTION = 0.9
# Maximum change of the SEB integrator in one update, as a fraction of its range.
_SEB_INTEGRATOR_STEP_FRACTION = 0.1
# Band below full throttle in which the demand is treated as saturated, 0..1. Noise of airspeed and acceleration makes
# the demand touch the limit now and then: the band is three standard deviations. Climbs at full throttle depend on it:
# with 0.003 to 0.005 the least clearances of 20 ArduPlane flights are met within 1.2 m; without it one is 9 m off.
_SATURATION_BAND_FRACTION = 0.003
# Smallest reduction of an airspeed increase for a minimum ground speed, m/s; a smaller reduction is not applied.
_GROUND_SPEED_HYSTERESIS_MPS = 1.2
# Underspeed begins below this ratio of airspeed to AIRSPEED_MIN ...
_UNDERSPEED_RATIO = 0.9
# ... with the throttle at or above this fraction of its maximum.
_FULL_THROTTLE_FRACTION = 0.95
# Underspeed ends when the altitude demand is reached, or at this ratio of airspeed to AIRSPEED_MIN ...
_UNDERSPEED_EXIT_RATIO = 1.15
# ... this long after the airspeed rose above the underspeed threshold, s.
_UNDERSPEED_EXIT_DELAY_S = 3.0


@inner
def _update_speed(state: Record, estimated: Record, parameters: Record, memory: Record, dt: float) -> None:
    """Update the estimates of airspeed and airspeed rate with a complementary filter.

    Follows `AP_TECS::update_50hz` for the acceleration and `AP_TECS::_update_speed` for the filter.

    The fast changes come from the acceleration along the nose, the slow changes from the measured airspeed. With
    gravity removed, an accelerometer along the nose measures the change of the velocity over the ground, including its
    vertical component. At the start of a climb, this change is larger than the change of the airspeed.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: `ARDUPILOT_MEMORY` record; its airspeeds (m/s, true) and airspeed rates (m/s^2) are updated.
    dt: duration of a tick, s.
    """
    cos_pitch = math.cos(state.pitch)
    acceleration = (estimated.velocity_east - memory.last_velocity_east) * math.sin(state.yaw) * cos_pitch
    acceleration += (estimated.velocity_north - memory.last_velocity_north) * math.cos(state.yaw) * cos_pitch
    acceleration += (estimated.velocity_up - memory.last_velocity_up) * math.sin(state.pitch)
    acceleration = acceleration / dt if memory.has_last_velocity else 0.0
    memory.has_last_velocity = True
    memory.last_velocity_east, memory.last_velocity_north = estimated.velocity_east, estimated.velocity_north
    memory.last_velocity_up = estimated.velocity_up
    filter_frequency = parameters.tecs_speed_frequency
    airspeed_error = memory.airspeed_smoothed - memory.tas
    memory.airspeed_smoothed += _READING_FRACTION * (AIRSPEED_READING * state.airspeed - memory.airspeed_smoothed)
    memory.tas_rate_correction += airspeed_error * filter_frequency * filter_frequency * dt
    memory.tas = max(
        3.0,
        memory.tas
        + (acceleration + memory.tas_rate_correction + airspeed_error * filter_frequency * _FILTER_DAMPING_RATIO) * dt,
    )
    memory.tas_rate_mean += (acceleration - memory.tas_rate_mean) * dt / (dt + parameters.tecs_time)
    memory.tas_rate = acceleration - memory.tas_rate_mean


@inner
def detect_underspeed(estimated: Record, parameters: Record, memory: Record, tas_min: float, dt: float) -> bool:
    """Update the underspeed flag, and return it: True while airspeed has priority over altitude.

    The flag is set below `_UNDERSPEED_RATIO` times the minimum airspeed at full throttle. It lasts until the aircraft
    is at its altitude demand again, or has been fast enough for some time. Follows `AP_TECS::_detect_underspeed`.

    After an engine failure, underspeed lasts until the altitude demand has descended to the gliding aircraft. From then
    on the aircraft glides at AIRSPEED_MIN, which is above the underspeed threshold (seen in 14 flights).

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record; updated.
    tas_min: AIRSPEED_MIN as a true airspeed, m/s.
    dt: duration of a tick, s.
    """
    is_slow = memory.tas < _UNDERSPEED_RATIO * tas_min
    memory.time_above_underspeed_threshold = 0.0 if is_slow else memory.time_above_underspeed_threshold + dt
    if (
        memory.underspeed
        and memory.tas >= _UNDERSPEED_EXIT_RATIO * tas_min
        and memory.time_above_underspeed_threshold > _UNDERSPEED_EXIT_DELAY_S
    ):
        memory.underspeed = False
    is_full_throttle = memory.throttle_demand >= _FULL_THROTTLE_FRACTION * parameters.throttle_max
    memory.underspeed = (is_slow and is_full_throttle) or (memory.underspeed and estimated.up < memory.altitude_demand)
    return memory.underspeed


@inner
def airspeed_target(
    state: Record,
    estimated: Record,
    commanded_airspeed: float,
    waypoint: Record,
    parameters: Record,
    memory: Record,
    eas2tas: float,
) -> float:
    """Return the target equivalent airspeed, m/s, increased if the ground speed is below its minimum.

    The increase of the commanded airspeed is the shortfall of the ground speed along the heading, rounded to whole m/s.
    The increase rises at once, but falls only in steps of at least `_GROUND_SPEED_HYSTERESIS_MPS`. The result is
    limited to AIRSPEED_MIN..AIRSPEED_MAX. Follows `Plane::calc_airspeed_errors` and `Plane::calc_gndspeed_undershoot`.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    commanded_airspeed: equivalent airspeed, m/s.
    waypoint: end of the leg, which states the minimum ground speed, m/s; 0 for none.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record; updated.
    eas2tas: ratio of true to equivalent airspeed.
    """
    target_airspeed = commanded_airspeed
    if waypoint.min_ground_speed > 0.0:
        forward_ground_speed = estimated.velocity_east * math.sin(state.yaw) + estimated.velocity_north * math.cos(
            state.yaw
        )
        required_airspeed = (memory.airspeed_smoothed + waypoint.min_ground_speed - forward_ground_speed) / eas2tas
        undershoot = float(math.floor(max(0.0, required_airspeed - commanded_airspeed) + 0.5))
        if (
            undershoot >= memory.ground_speed_undershoot
            or memory.ground_speed_undershoot - undershoot >= _GROUND_SPEED_HYSTERESIS_MPS
        ):
            memory.ground_speed_undershoot = undershoot
        target_airspeed += memory.ground_speed_undershoot
    return min(parameters.airspeed_max, max(parameters.airspeed_min, target_airspeed))


@inner
def update_tecs(
    state: Record, estimated: Record, parameters: Record, memory: Record, tas_target: float, eas2tas: float, dt: float
) -> None:
    """Update the throttle and pitch demands that hold the altitude demand and a target airspeed.

    The throttle controls the total energy, the pitch its distribution between altitude and airspeed. In underspeed and
    in a bad descent the target is the minimum airspeed.

    Follows `AP_TECS::update_pitch_throttle`: `_update_speed`, `_detect_underspeed`, `_update_speed_demand`,
    `_update_energies`, `_update_throttle_with_airspeed` and `_update_pitch`.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record; updated.
    tas_target: target true airspeed, m/s.
    eas2tas: ratio of true to equivalent airspeed.
    dt: duration of a tick, s.

    SPE, SKE and STE are the specific potential, kinetic and total energy, m^2/s^2.
    """
    _update_speed(state, estimated, parameters, memory, dt)
    tas = memory.tas
    tas_min = min_airspeed(nav_roll(memory.lateral_acceleration, state.pitch, parameters), parameters) * eas2tas
    # If the aircraft cannot climb as demanded, a lower STE rate is assumed at full throttle.
    ste_rate_max = GRAVITY * parameters.tecs_climb_max * memory.max_climb_scaler
    ste_rate_min = -GRAVITY * parameters.tecs_sink_min
    # The maximum true airspeed falls towards AIRSPEED_CRUISE while the throttle is saturated, and rises again
    # afterwards. With this rule `AP_TECS::_update_speed` slows down an aircraft that cannot climb at its maximum
    # airspeed.
    tas_max = parameters.airspeed_max * eas2tas
    saturated_rate = ste_rate_min if memory.is_throttle_saturated else ste_rate_max
    tas_max_change = _SPEED_RATE_FRACTION * saturated_rate / max(memory.tas, parameters.airspeed_min * eas2tas) * dt
    max_drop = max(0.0, tas_max - parameters.airspeed_cruise * eas2tas)
    memory.tas_max_drop = min(max_drop, max(0.0, memory.tas_max_drop - tas_max_change))
    tas_max = max(tas_min, tas_max - memory.tas_max_drop)
    is_underspeed = detect_underspeed(estimated, parameters, memory, tas_min, dt)
    limited_tas_target = tas_min if is_underspeed or memory.bad_descent else min(tas_max, max(tas_min, tas_target))
    ske_rate_demand = _update_speed_demand(parameters, memory, limited_tas_target, tas_min, tas_max, eas2tas, dt)
    spe_error = GRAVITY * (memory.altitude_demand - estimated.up)
    ske_error = 0.5 * (memory.tas_demand * memory.tas_demand - tas * tas)
    max_spe_error = max(0.0, 0.5 * (tas * tas - tas_min * tas_min))
    min_spe_error = min(0.0, 0.5 * (tas * tas - tas_max * tas_max))
    spe_rate, ske_rate = GRAVITY * estimated.velocity_up, tas * memory.tas_rate
    limited_spe_error = min(max_spe_error, max(min_spe_error, spe_error))
    ste_error, ste_rate = limited_spe_error + ske_error, spe_rate + ske_rate
    ste_rate_demand = min(ste_rate_max, max(ste_rate_min, spe_error / parameters.tecs_time + ske_rate_demand))
    _update_throttle(state, parameters, memory, ste_rate_demand, ste_error, ste_rate, ste_rate_max, ste_rate_min, dt)
    if is_underspeed:
        memory.throttle_demand = parameters.throttle_max
    # A bad descent: the aircraft sinks at full throttle because the demanded airspeed is too high. It lasts until the
    # STE error is no longer positive.
    is_full = memory.throttle_demand >= _BAD_DESCENT_THROTTLE_FRACTION * parameters.throttle_max
    begins_bad_descent = ste_error > _BAD_DESCENT_ERROR_M2PS2 and ste_rate < 0.0 and is_full
    continues_bad_descent = memory.bad_descent and ste_error > 0.0
    memory.bad_descent = not is_underspeed and (continues_bad_descent or begins_bad_descent)
    _update_pitch(state, parameters, memory, spe_error, ske_error, spe_rate, ske_rate, is_underspeed, dt)


@inner
def _update_speed_demand(
    parameters: Record,
    memory: Record,
    tas_target: float,
    tas_min: float,
    tas_max: float,
    eas2tas: float,
    dt: float,
) -> float:
    """Move the airspeed demand towards a target, and return the demanded SKE rate, m^2/s^3.

    SKE is the specific kinetic energy. Follows `AP_TECS::_update_speed_demand`. A rise of the airspeed may use half of
    the energy rate of a climb at TECS_CLMB_MAX. A fall may use nine tenths of the energy rate of a descent: at
    TECS_SINK_MIN at AIRSPEED_CRUISE, at TECS_SINK_MAX at the maximum airspeed, and interpolated in between. The
    demanded SKE rate fades during a long change of airspeed, because the mean rate of the change is subtracted.

    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record; updated.
    tas_target, tas_min, tas_max: true airspeeds, m/s.
    eas2tas: ratio of true to equivalent airspeed.
    dt: duration of a tick, s.
    """
    tas, tas_cruise = memory.tas, parameters.airspeed_cruise * eas2tas
    fraction = 1.0 if tas_max <= tas_cruise else min(1.0, max(0.0, (tas - tas_cruise) / (tas_max - tas_cruise)))
    cruise_loss = GRAVITY * parameters.tecs_sink_min / tas_cruise
    max_loss = GRAVITY * parameters.tecs_sink_max / tas_max
    rate_max = _SPEED_RATE_FRACTION * GRAVITY * parameters.tecs_climb_max * memory.max_climb_scaler / tas
    rate_min = -_SPEED_LOSS_FRACTION * (cruise_loss + fraction * (max_loss - cruise_loss))
    rate = min(rate_max, max(rate_min, (tas_target - memory.tas_demand) / dt))
    memory.tas_rate_demand_mean += (rate - memory.tas_rate_demand_mean) * dt / (dt + parameters.tecs_time)
    memory.tas_demand = min(tas_max, max(tas_min, memory.tas_demand + rate * dt))
    return tas * (rate - memory.tas_rate_demand_mean)


@inner
def _update_throttle(
    state: Record,
    parameters: Record,
    memory: Record,
    ste_rate_demand: float,
    ste_error: float,
    ste_rate: float,
    ste_rate_max: float,
    ste_rate_min: float,
    dt: float,
) -> None:
    """Set the throttle demand from an STE rate demand, the STE error and the STE rate.

    The demand is the sum of the throttle for the demanded rate, a correction proportional to the error, damping of the
    rate, and an integral of the error.

    Follows `AP_TECS::_update_throttle_with_airspeed`.

    ste_error: error of the specific total energy (STE), m^2/s^2.
    ste_rate_demand, ste_rate: m^2/s^3.
    ste_rate_max, ste_rate_min: STE rates at full and at idle throttle, m^2/s^3.
    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record.
    dt: duration of a tick, s.
    """
    # There is no reverse thrust (`Plane::apply_throttle_limits`).
    throttle_min, throttle_max = max(0.0, parameters.throttle_min), parameters.throttle_max
    ste_rate_per_throttle = (ste_rate_max - ste_rate_min) / (throttle_max - throttle_min)
    memory.ste_rate_error += (ste_rate_demand - ste_rate - memory.ste_rate_error) * dt / (dt + _STE_RATE_LAG_S)
    # Additional drag in a bank needs more throttle.
    tilt = math.sin(state.roll) * math.cos(state.pitch)
    roll_compensation = parameters.tecs_roll_to_throttle * (1.0 / max(0.1, 1.0 - tilt * tilt) - 1.0)
    throttle = parameters.throttle_cruise + (ste_rate_demand + roll_compensation) / ste_rate_per_throttle
    throttle_per_ste = 1.0 / (parameters.tecs_time * ste_rate_per_throttle)
    throttle += throttle_per_ste * (ste_error + parameters.tecs_throttle_damping * memory.ste_rate_error)
    # The integrator may exceed what saturates the throttle only by a small overshoot.
    integrator_limit = _STE_INTEGRATOR_FRACTION * (throttle_max - throttle_min)
    integrator_max = min(
        integrator_limit, max(-integrator_limit, throttle_max - throttle + _THROTTLE_OVERSHOOT_FRACTION)
    )
    integrator_min = min(
        integrator_limit, max(-integrator_limit, throttle_min - throttle - _THROTTLE_OVERSHOOT_FRACTION)
    )
    memory.ste_integrator += throttle_per_ste * parameters.tecs_integral * ste_error * dt
    memory.ste_integrator = min(integrator_max, max(integrator_min, memory.ste_integrator))
    if parameters.throttle_slew > 0.0:
        max_step = parameters.throttle_slew * (throttle_max - throttle_min) * dt
        throttle = min(memory.last_throttle_demand + max_step, max(memory.last_throttle_demand - max_step, throttle))
    memory.last_throttle_demand = throttle
    throttle += memory.ste_integrator
    memory.throttle_demand = min(throttle_max, max(throttle_min, throttle))
    memory.is_throttle_saturated = throttle >= throttle_max - _SATURATION_BAND_FRACTION
    memory.saturation = 1 if memory.is_throttle_saturated else (-1 if throttle <= throttle_min else 0)


@inner
def wind_up_ste_integrator(parameters: Record, memory: Record) -> None:
    """Set the STE integrator to its value at full throttle, as ArduPlane does during a climb-out.

    `AP_TECS::_update_throttle_with_airspeed` does so at every update of a take-off and of an aborted landing. Therefore
    the throttle stays open for a while afterwards.

    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record.
    """
    throttle_min, throttle_max = max(0.0, parameters.throttle_min), parameters.throttle_max
    integrator_limit = _STE_INTEGRATOR_FRACTION * (throttle_max - throttle_min)
    memory.ste_integrator = min(
        integrator_limit,
        max(-integrator_limit, throttle_max - memory.last_throttle_demand + _THROTTLE_OVERSHOOT_FRACTION),
    )


@inner
def _update_pitch_integrators(
    parameters: Record,
    memory: Record,
    seb_rate_demand_total: float,
    seb_change: float,
    ske_change: float,
    pitch_min: float,
    pitch_max: float,
    dt: float,
) -> None:
    """Update the SEB and SKE integrators of the pitch demand.

    If the pitch demand is beyond a limit and the change would move it further, both integrators fade instead. Follows
    `AP_TECS::_update_pitch`.

    seb_rate_demand_total: SEB rate demand without integrators, m^2/s^3.
    seb_change, ske_change: changes of the integrators in this update, m^2/s^3.
    pitch_min, pitch_max: rad.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record.
    dt: duration of a tick, s.
    """
    seb_rate_per_pitch = memory.tas * GRAVITY
    seb_max = (pitch_max + _PITCH_OVERSHOOT_RAD) * seb_rate_per_pitch - seb_rate_demand_total
    seb_min = (pitch_min - _PITCH_OVERSHOOT_RAD) * seb_rate_per_pitch - seb_rate_demand_total
    max_change = _SEB_INTEGRATOR_STEP_FRACTION * (seb_max - seb_min)
    change = min(max_change, max(-max_change, seb_change))
    integrators = memory.seb_integrator + change + memory.ske_integrator
    pitch = (seb_rate_demand_total + integrators) / seb_rate_per_pitch
    if (pitch > pitch_max and change > 0.0) or (pitch < pitch_min and change < 0.0):
        fade = 1.0 - dt / (dt + parameters.tecs_time)
        memory.seb_integrator *= fade
        memory.ske_integrator *= fade
    else:
        memory.seb_integrator += change
        memory.ske_integrator += ske_change
    memory.seb_integrator = min(seb_max, max(seb_min, memory.seb_integrator))
    ske_limit = _SKE_INTEGRATOR_FRACTION * (pitch_max - pitch_min) * seb_rate_per_pitch
    memory.ske_integrator = min(ske_limit, max(-ske_limit, memory.ske_integrator))


@inner
def _update_pitch(
    state: Record,
    parameters: Record,
    memory: Record,
    spe_error: float,
    ske_error: float,
    spe_rate: float,
    ske_rate: float,
    is_underspeed: bool,
    dt: float,
) -> None:
    """Set the pitch demand from the balance of potential and kinetic energy.

    Follows `AP_TECS::_update_pitch`. SEB is the specific energy balance: potential minus kinetic energy, each weighted.

    state: attitude and airspeed of the aircraft, a `STATE` record.
    parameters, memory: ArduPlane's parameters, and the internal state of its control law, which is updated.
    spe_error, ske_error: errors of the specific potential and kinetic energy, m^2/s^2.
    spe_rate, ske_rate: rates of the specific potential and kinetic energy, m^2/s^3.
    is_underspeed: True to use the pitch only to regain airspeed.
    dt: duration of a tick, s.
    """
    ske_weight = 1.0 if is_underspeed else min(1.0, parameters.tecs_speed_weight)
    spe_weight = 0.0 if is_underspeed else min(1.0, 2.0 - parameters.tecs_speed_weight)
    pitch_max = parameters.pitch_limit_max
    if parameters.tecs_pitch_max > 0.0:
        pitch_max = min(pitch_max, parameters.tecs_pitch_max)
    pitch_min = parameters.pitch_limit_min
    if parameters.tecs_pitch_min < 0.0:
        pitch_min = max(pitch_min, parameters.tecs_pitch_min)
    # Demanded SEB rate: from the errors of potential and kinetic energy, within the climb and sink limits.
    seb_rate_per_pitch = memory.tas * GRAVITY
    seb_rate_demand = spe_weight * (spe_error / parameters.tecs_time + GRAVITY * memory.climb_rate_demand)
    seb_rate_demand -= ske_weight * ske_error / parameters.tecs_time
    unlimited_seb_rate_demand = seb_rate_demand
    seb_rate_demand = min(
        GRAVITY * parameters.tecs_climb_max, max(-GRAVITY * parameters.tecs_sink_max, unlimited_seb_rate_demand)
    )
    seb_rate_error = seb_rate_demand - (spe_weight * spe_rate - ske_weight * ske_rate)
    seb_rate_demand_total = seb_rate_demand + parameters.tecs_pitch_damping * seb_rate_error
    _update_pitch_integrators(
        parameters,
        memory,
        seb_rate_demand_total,
        parameters.tecs_integral * seb_rate_error * dt,
        -ske_weight * ske_error / parameters.tecs_time * dt,
        pitch_min,
        pitch_max,
        dt,
    )
    pitch = (seb_rate_demand_total + memory.seb_integrator + memory.ske_integrator) / seb_rate_per_pitch
    if pitch > pitch_max or unlimited_seb_rate_demand > seb_rate_demand:
        memory.saturation = 1
    elif pitch < pitch_min or unlimited_seb_rate_demand < seb_rate_demand:
        memory.saturation = -1
    pitch = min(pitch_max, max(pitch_min, pitch))
    max_step = parameters.tecs_vertical_acceleration / memory.tas * dt
    memory.pitch_demand = min(memory.pitch_demand + max_step, max(memory.pitch_demand - max_step, pitch))
