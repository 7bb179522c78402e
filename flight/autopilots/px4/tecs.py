"""Implement PX4's TECS: throttle from the STE rate, and pitch from the SEB rate.

The specific energy balance (SEB) weighs altitude against speed.

Follows PX4's `src/lib/tecs/TECS.cpp` and its parameter reference (FW_T_*). The Total Energy Control System is by
Lambregts (AIAA 83-2239). Energies are per kilogram, their rates m^2/s^3. Speeds are true airspeeds.
"""

import math

from aircraft.envelope import GRAVITY
from world.kernels import Record, inner

# Fraction of the maximum energy rates that a change of speed may use.
_SPEED_RATE_FRACTION = 0.5
# Maximum rate of the airspeed setpoint, m/s^2.
_AIRSPEED_SLEW_MPS2 = 1.0
# Airspeed difference below FW_AIRSPD_MIN at which underspeed begins, as a fraction of FW_AIRSPD_TRIM. The underspeed
# ratio rises from 0 to 1 over the same difference below that airspeed.
_UNDERSPEED_FRACTION = 0.15


@inner
def update_altitude_reference(parameters: Record, memory: Record, dt: float) -> None:
    """Move the altitude reference towards the altitude setpoint (`TECSAltitudeReferenceModel`).

    The reference climbs at most at FW_T_CLMB_R_SP and sinks at most at FW_T_SINK_R_SP. It decelerates at
    FW_T_VERT_ACC, early enough not to overshoot the setpoint.

    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: internal state of the control law, a `PX4_MEMORY` record.
    dt: duration of a tick, s.
    """
    altitude_error = memory.altitude_setpoint - memory.altitude_reference
    rate_towards_setpoint = min(
        math.sqrt(2.0 * parameters.vertical_acceleration_limit * abs(altitude_error)), abs(altitude_error) / dt
    )
    max_climb_rate = min(parameters.target_climb_rate, parameters.max_climb_rate)
    max_sink_rate = min(parameters.target_sink_rate, parameters.max_sink_rate)
    rate_setpoint = min(max_climb_rate, max(-max_sink_rate, math.copysign(rate_towards_setpoint, altitude_error)))
    max_change = parameters.vertical_acceleration_limit * dt
    memory.altitude_rate_reference = min(
        memory.altitude_rate_reference + max_change, max(memory.altitude_rate_reference - max_change, rate_setpoint)
    )
    memory.altitude_reference += memory.altitude_rate_reference * dt


@inner
def update_airspeed_filter(measured_tas: float, parameters: Record, memory: Record, dt: float) -> None:
    """Update the airspeed filter with a measured true airspeed, m/s (`TECSAirspeedFilter`).

    The filter is a Kalman filter of airspeed and airspeed rate with constant gains. The measured rate of change of the
    airspeed is 0, as in PX4.

    measured_tas: m/s.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: `PX4_MEMORY` record; its true airspeed (m/s) and airspeed rate (m/s^2) are updated.
    dt: duration of a tick, s.
    """
    tas_error, tas_rate_error = measured_tas - memory.tas, -memory.tas_rate
    memory.tas += (
        memory.tas_rate + parameters.kalman_gain_00 * tas_error + parameters.kalman_gain_01 * tas_rate_error
    ) * dt
    memory.tas = max(1.0, memory.tas)
    memory.tas_rate += (parameters.kalman_gain_10 * tas_error + parameters.kalman_gain_11 * tas_rate_error) * dt


@inner
def update_tecs(
    state: Record,
    estimated: Record,
    parameters: Record,
    memory: Record,
    airspeed_setpoint: float,
    eas_to_tas: float,
    dt: float,
) -> None:
    """Update the throttle and pitch setpoints for the altitude setpoint and an airspeed setpoint.

    The throttle controls the total energy, the pitch its distribution between altitude and airspeed.
    Follows `TECS::update` and `TECSControl::update`, with `_calcAltitudeControlOutput` and
    `_calcAirspeedControlOutput`. The setpoint of the SKE rate follows from the airspeed setpoint
    (`_calcSpecificEnergyRates`).

    state: a record of `flight.dynamics.state.STATE`.
    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    airspeed_setpoint: equivalent airspeed, m/s.
    eas_to_tas: ratio of true to equivalent airspeed.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: internal state of the control law, a `PX4_MEMORY` record.
    dt: duration of a tick, s.
    """
    update_altitude_reference(parameters, memory, dt)
    update_airspeed_filter(state.airspeed, parameters, memory, dt)
    tas = memory.tas
    # `adapt_airspeed_setpoint`: a setpoint outside the airspeed limits moves to the limit at once, and otherwise at a
    # limited rate. In a bank the minimum airspeed grows as the square root of the load factor.
    min_airspeed = parameters.airspeed_min / math.sqrt(max(0.1, math.cos(memory.roll_setpoint)))
    tas_min, tas_max = min_airspeed * eas_to_tas, parameters.airspeed_max * eas_to_tas
    step = _AIRSPEED_SLEW_MPS2 * eas_to_tas * dt
    tas_setpoint = min(memory.tas_setpoint + step, max(memory.tas_setpoint - step, airspeed_setpoint * eas_to_tas))
    memory.tas_setpoint = min(tas_max, max(tas_min, tas_setpoint))
    # In thin air the aircraft sinks faster at idle (`PerformanceModel::getMinimumSinkRate`).
    min_sink_rate = parameters.min_sink_rate * eas_to_tas
    ste_rate_max, ste_rate_min = GRAVITY * parameters.max_climb_rate, -GRAVITY * min_sink_rate
    altitude_rate_setpoint = (memory.altitude_reference - estimated.up) / parameters.altitude_time_constant
    altitude_rate_setpoint += parameters.altitude_rate_feedforward * memory.altitude_rate_reference
    altitude_rate_setpoint = min(parameters.max_climb_rate, max(-parameters.max_sink_rate, altitude_rate_setpoint))
    tas_rate_setpoint = (memory.tas_setpoint - tas) / parameters.airspeed_time_constant
    tas_rate_per_ste_rate = _SPEED_RATE_FRACTION / tas
    tas_rate_setpoint = min(
        tas_rate_per_ste_rate * ste_rate_max, max(tas_rate_per_ste_rate * ste_rate_min, tas_rate_setpoint)
    )
    underspeed_ratio = detect_underspeed(tas / eas_to_tas, parameters)
    ske_rate_setpoint = memory.tas_setpoint * tas_rate_setpoint
    _calc_pitch_control(estimated, parameters, memory, altitude_rate_setpoint, ske_rate_setpoint, underspeed_ratio, dt)
    _calc_throttle_control(
        state,
        estimated,
        parameters,
        memory,
        altitude_rate_setpoint,
        ske_rate_setpoint,
        underspeed_ratio,
        min_sink_rate,
        eas_to_tas,
        dt,
    )


@inner
def detect_underspeed(equivalent_airspeed: float, parameters: Record) -> float:
    """Return the underspeed ratio, 0..1: the priority of airspeed over altitude (`_detectUnderspeed`).

    The ratio is 0 above the underspeed threshold and rises to 1 below it.

    equivalent_airspeed: m/s.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    """
    ramp_width = _UNDERSPEED_FRACTION * parameters.airspeed_trim
    start_airspeed = max(0.0, parameters.airspeed_min - ramp_width)
    full_airspeed = max(0.0, start_airspeed - ramp_width)
    return 1.0 - min(1.0, max(0.0, (equivalent_airspeed - full_airspeed) / max(1e-3, start_airspeed - full_airspeed)))


@inner
def _calc_pitch_control(
    estimated: Record,
    parameters: Record,
    memory: Record,
    altitude_rate_setpoint: float,
    ske_rate_setpoint: float,
    underspeed_ratio: float,
    dt: float,
) -> None:
    """Set the pitch setpoint from the setpoint of the SEB rate.

    The SEB rate is the balance between the rates of potential and kinetic energy. Follows
    `TECSControl::_updateSpeedAltitudeWeights`, `_calcPitchControlSebRate`, `_calcPitchControlUpdate` and
    `_calcPitchControlOutput`.

    estimated: position and velocity over the ground as the navigation estimates them, a `MOTION` record.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: internal state of the control law, a `PX4_MEMORY` record; updated.
    altitude_rate_setpoint: m/s.
    ske_rate_setpoint: rate of the specific kinetic energy, m^2/s^3.
    underspeed_ratio: 0 in normal flight to 1 in full underspeed, in which the pitch controls only the airspeed.
    dt: duration of a tick, s.
    """
    tas = memory.tas
    speed_weight = parameters.pitch_speed_weight * (1.0 - underspeed_ratio) + 2.0 * underspeed_ratio
    ske_weighting, spe_weighting = speed_weight, 2.0 - speed_weight
    seb_rate_setpoint = GRAVITY * altitude_rate_setpoint * spe_weighting - ske_rate_setpoint * ske_weighting
    seb_rate_error = seb_rate_setpoint - (
        GRAVITY * estimated.velocity_up * spe_weighting - tas * memory.tas_rate * ske_weighting
    )
    seb_rate_per_pitch = tas * GRAVITY
    pitch_max = parameters.pitch_limit_max - parameters.pitch_trim
    pitch_min = parameters.pitch_limit_min - parameters.pitch_trim
    increment = seb_rate_error * parameters.integrator_gain_pitch / seb_rate_per_pitch * dt
    # With the setpoint at a limit the integrator may only move away from the limit.
    if memory.pitch_setpoint >= pitch_max:
        increment = min(0.0, increment)
    elif memory.pitch_setpoint <= pitch_min:
        increment = max(0.0, increment)
    memory.pitch_integrator += increment
    pitch = (
        seb_rate_error * parameters.pitch_damping_gain + parameters.seb_rate_feedforward * seb_rate_setpoint
    ) / seb_rate_per_pitch + memory.pitch_integrator
    pitch = min(pitch_max, max(pitch_min, pitch))
    max_step = parameters.vertical_acceleration_limit / tas * dt
    memory.pitch_setpoint = min(memory.pitch_setpoint + max_step, max(memory.pitch_setpoint - max_step, pitch))


@inner
def _calc_throttle_control(
    state: Record,
    estimated: Record,
    parameters: Record,
    memory: Record,
    altitude_rate_setpoint: float,
    ske_rate_setpoint: float,
    underspeed_ratio: float,
    min_sink_rate: float,
    eas_to_tas: float,
    dt: float,
) -> None:
    """Set the throttle setpoint from the setpoint of the STE rate, the rate of the total energy.

    Follows `TECSControl::_calcThrottleControlSteRate`, `_calcThrottleControlUpdate` and `_calcThrottleControlOutput`.

    altitude_rate_setpoint: m/s.
    ske_rate_setpoint: rate of the kinetic energy, m^2/s^3.
    min_sink_rate: sink rate at idle throttle, m/s.
    underspeed_ratio: 0 in normal flight to 1 in full underspeed.
    eas_to_tas: ratio of true to equivalent airspeed.
    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: estimated position and velocity over the ground, a `MOTION` record.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: internal state of the control law, a `PX4_MEMORY` record.
    dt: duration of a tick, s.
    """
    ste_rate_max, ste_rate_min = GRAVITY * parameters.max_climb_rate, -GRAVITY * min_sink_rate
    load_factor_correction = parameters.load_factor_correction * (1.0 / max(0.1, math.cos(state.roll)) - 1.0)
    ste_rate_setpoint = min(
        ste_rate_max,
        max(ste_rate_min, GRAVITY * altitude_rate_setpoint + ske_rate_setpoint + load_factor_correction),
    )
    ste_rate = GRAVITY * estimated.velocity_up + memory.tas * memory.tas_rate
    memory.ste_rate += (ste_rate - memory.ste_rate) * dt / (dt + parameters.ste_rate_time_constant)
    ste_rate_error, ste_rate_span = ste_rate_setpoint - memory.ste_rate, ste_rate_max - ste_rate_min
    # In thin air level flight needs more throttle.
    throttle_trim = min(parameters.throttle_max, max(parameters.throttle_min, parameters.throttle_trim * eas_to_tas))
    if ste_rate_setpoint >= 0.0:
        throttle = throttle_trim + ste_rate_setpoint * (parameters.throttle_max - throttle_trim) / ste_rate_max
    else:
        throttle = throttle_trim + ste_rate_setpoint * (throttle_trim - parameters.throttle_min) / -ste_rate_min
    increment = ste_rate_error * parameters.integrator_gain_throttle / ste_rate_span * (1.0 - underspeed_ratio) * dt
    # With the setpoint at a limit the integrator may only move away from the limit.
    if memory.throttle_setpoint >= parameters.throttle_max:
        increment = min(0.0, increment)
    if memory.throttle_setpoint <= parameters.throttle_min:
        increment = max(0.0, increment)
    memory.throttle_integrator += increment
    throttle += ste_rate_error * parameters.throttle_damping_gain / ste_rate_span + memory.throttle_integrator
    throttle += underspeed_ratio * (parameters.throttle_max - throttle)
    throttle = min(parameters.throttle_max, max(parameters.throttle_min, throttle))
    if parameters.throttle_slew_rate > 0.0:
        max_step = parameters.throttle_slew_rate * (parameters.throttle_max - parameters.throttle_min) * dt
        throttle = min(memory.throttle_setpoint + max_step, max(memory.throttle_setpoint - max_step, throttle))
    memory.throttle_setpoint = throttle
