"""Implement PX4's TECS, with throttle from the STE rate and pitch from the balance of altitude and speed (SEB rate).

Follows PX4's `src/lib/tecs/TECS.cpp` and its parameter reference (FW_T_*).  The Total Energy Control System is by
Lambregts (AIAA 83-2239).  Energies are per kilogram, their rates m^2/s^3.  Speeds are true airspeeds.
"""

import math

from aircraft.envelope import GRAVITY
from world.kernels import Record, inner

# Fraction of the maximum energy rates that a change of speed may use.
_SPEED_RATE_FRACTION = 0.5
# Limit of the rate of the airspeed demand, m/s^2.
_AIRSPEED_SLEW_MPS2 = 1.0
# Underspeed begins this fraction of FW_AIRSPD_TRIM below FW_AIRSPD_MIN, and is complete as far again below that.
_UNDERSPEED_FRACTION = 0.15


@inner
def update_altitude_reference(parameters: Record, own: Record, dt: float) -> None:
    """Move the altitude reference towards the setpoint, within its limits (`TECSAltitudeReferenceModel`).

    It climbs by at most FW_T_CLMB_R_SP, sinks by at most FW_T_SINK_R_SP, and decelerates in time with FW_T_VERT_ACC.
    """
    altitude_error = own.height_asked - own.height_reference
    rate = min(math.sqrt(2.0 * parameters.vertical_acceleration * abs(altitude_error)), abs(altitude_error) / dt)
    climb = min(parameters.climb_reference, parameters.climb_max)
    sink = min(parameters.sink_reference, parameters.sink_max)
    rate_demand = min(climb, max(-sink, math.copysign(rate, altitude_error)))
    max_change = parameters.vertical_acceleration * dt
    own.height_rate = min(own.height_rate + max_change, max(own.height_rate - max_change, rate_demand))
    own.height_reference += own.height_rate * dt


@inner
def estimate_airspeed(measured_airspeed: float, parameters: Record, own: Record, dt: float) -> None:
    """Update the airspeed filter with a measured airspeed (m/s) (`TECSAirspeedFilter`).

    The measured rate is taken as 0, as in PX4.
    """
    airspeed_error, airspeed_rate_error = measured_airspeed - own.airspeed, -own.airspeed_rate
    own.airspeed += (
        own.airspeed_rate + parameters.speed_by_speed * airspeed_error + parameters.speed_by_rate * airspeed_rate_error
    ) * dt
    own.airspeed = max(1.0, own.airspeed)
    own.airspeed_rate += (
        parameters.rate_by_speed * airspeed_error + parameters.rate_by_rate * airspeed_rate_error
    ) * dt


@inner
def update_tecs(
    state: Record,
    estimated: Record,
    parameters: Record,
    own: Record,
    airspeed_setpoint: float,
    airspeed_factor: float,
    dt: float,
) -> None:
    """Update the throttle and pitch demands for the altitude setpoint and an airspeed, into ``own``.

    state: a record of `flight.dynamics.state.STATE`.  estimated: of `flight.guidance.navigation_error.MOTION`.
    airspeed_setpoint: equivalent airspeed, m/s.  airspeed_factor: ratio of true to equivalent airspeed.
    """
    update_altitude_reference(parameters, own, dt)
    estimate_airspeed(state.airspeed, parameters, own, dt)
    speed = own.airspeed
    # In a bank the minimum airspeed grows as the root of the load factor.
    min_airspeed = parameters.airspeed_min / math.sqrt(max(0.1, math.cos(own.roll_demand)))
    true_setpoint = min(parameters.airspeed_max, max(min_airspeed, airspeed_setpoint)) * airspeed_factor
    step = _AIRSPEED_SLEW_MPS2 * dt
    own.airspeed_demand = min(own.airspeed_demand + step, max(own.airspeed_demand - step, true_setpoint))
    max_rate, min_rate = GRAVITY * parameters.climb_max, -GRAVITY * parameters.sink_min
    climb_rate = (own.height_reference - estimated.up) / parameters.height_time
    climb_rate += parameters.height_rate_share * own.height_rate
    climb_rate = min(parameters.climb_max, max(-parameters.sink_max, climb_rate))
    acceleration = (own.airspeed_demand - speed) / parameters.speed_time
    rate_fraction = _SPEED_RATE_FRACTION / speed
    acceleration = min(rate_fraction * max_rate, max(rate_fraction * min_rate, acceleration))
    underspeed_ratio = underspeed(speed / airspeed_factor, parameters)
    _set_pitch(estimated, parameters, own, climb_rate, acceleration, underspeed_ratio, dt)
    _set_throttle(state, estimated, parameters, own, climb_rate, acceleration, underspeed_ratio, airspeed_factor, dt)


@inner
def underspeed(airspeed: float, parameters: Record) -> float:
    """Return the underspeed ratio (0..1), which is the priority of speed over altitude (`_detectUnderspeed`).

    airspeed: equivalent, m/s.
    """
    ramp = _UNDERSPEED_FRACTION * parameters.airspeed_trim
    start = max(0.0, parameters.airspeed_min - ramp)
    full = max(0.0, start - ramp)
    return 1.0 - min(1.0, max(0.0, (airspeed - full) / max(1e-3, start - full)))


@inner
def _set_pitch(
    estimated: Record,
    parameters: Record,
    own: Record,
    climb_rate: float,
    acceleration: float,
    underspeed_ratio: float,
    dt: float,
) -> None:
    """Set the pitch demand from the SEB rate of a climb rate (m/s) and an acceleration (m/s^2)."""
    speed = own.airspeed
    weight = parameters.speed_weight * (1.0 - underspeed_ratio) + 2.0 * underspeed_ratio
    # Clip both weights at 1: a weight above 1 then lowers the other instead of raising the loop gain.
    ske_weight, spe_weight = min(1.0, max(0.0, weight)), min(1.0, max(0.0, 2.0 - weight))
    rate_demand = GRAVITY * climb_rate * spe_weight - speed * acceleration * ske_weight
    rate_error = rate_demand - (GRAVITY * estimated.velocity_up * spe_weight - speed * own.airspeed_rate * ske_weight)
    rate_per_pitch = speed * GRAVITY
    pitch_max, pitch_min = (
        parameters.pitch_limit_max - parameters.pitch_trim,
        parameters.pitch_limit_min - parameters.pitch_trim,
    )
    increment = rate_error * parameters.pitch_integral * dt
    pitch = (
        rate_error * parameters.pitch_damping + parameters.balance_share * rate_demand + own.balance_sum
    ) / rate_per_pitch
    # In saturation the integrator may only move away from the limit.
    if not ((pitch >= pitch_max and increment > 0.0) or (pitch <= pitch_min and increment < 0.0)):
        own.balance_sum += increment
        pitch += increment / rate_per_pitch
    pitch = min(pitch_max, max(pitch_min, pitch))
    max_step = parameters.vertical_acceleration / speed * dt
    own.pitch_demand = min(own.pitch_demand + max_step, max(own.pitch_demand - max_step, pitch))


@inner
def _set_throttle(
    state: Record,
    estimated: Record,
    parameters: Record,
    own: Record,
    climb_rate: float,
    acceleration: float,
    underspeed_ratio: float,
    airspeed_factor: float,
    dt: float,
) -> None:
    """Set the throttle demand from the STE rate of a climb rate (m/s) and an acceleration (m/s^2)."""
    max_rate, min_rate = GRAVITY * parameters.climb_max, -GRAVITY * parameters.sink_min
    roll_drag = parameters.roll_to_throttle * (1.0 / max(0.1, math.cos(state.roll)) - 1.0)
    rate_demand = min(max_rate, max(min_rate, GRAVITY * climb_rate + own.airspeed * acceleration + roll_drag))
    ste_rate = GRAVITY * estimated.velocity_up + own.airspeed * own.airspeed_rate
    own.energy_rate += (ste_rate - own.energy_rate) * dt / (dt + parameters.energy_rate_time)
    rate_error, span = rate_demand - own.energy_rate, max_rate - min_rate
    # In thin air level flight needs more throttle.
    trim = min(parameters.throttle_max, max(parameters.throttle_min, parameters.throttle_trim * airspeed_factor))
    if rate_demand >= 0.0:
        throttle = trim + rate_demand * (parameters.throttle_max - trim) / max_rate
    else:
        throttle = trim + rate_demand * (trim - parameters.throttle_min) / -min_rate
    throttle += rate_error * parameters.throttle_damping / span + own.throttle_sum
    increment = rate_error * parameters.throttle_integral / span * dt
    is_full, is_idle = throttle >= parameters.throttle_max, throttle <= parameters.throttle_min
    if not ((is_full and increment > 0.0) or (is_idle and increment < 0.0)):
        own.throttle_sum += increment
        throttle += increment
    throttle += underspeed_ratio * (parameters.throttle_max - throttle)
    throttle = min(parameters.throttle_max, max(parameters.throttle_min, throttle))
    if parameters.throttle_slew > 0.0:
        step = parameters.throttle_slew * (parameters.throttle_max - parameters.throttle_min) * dt
        throttle = min(own.throttle_demand + step, max(own.throttle_demand - step, throttle))
    own.throttle_demand = throttle
