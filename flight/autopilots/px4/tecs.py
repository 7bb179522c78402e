"""PX4's TECS: throttle for what total energy is missing, pitch for what is amiss between height and speed.

Facts of PX4's `src/lib/tecs/TECS.cpp` and its parameter reference (FW_T_*).  The total energy control system is
Lambregts' (AIAA 83-2239).  Energies are of a kilogram: rates of them m^2/s^3.  Speeds are true airspeeds.
"""

import math

from aircraft.envelope import GRAVITY
from world.kernels import Record, inner

# Of the greatest rates of energy, what a change of speed may ask for.
_SPEED_CHANGE_SHARE = 0.5
# An airspeed is changed by so much a second at most, m/s^2.
_SPEED_SLEW = 1.0
# So far (of FW_AIRSPD_TRIM) below FW_AIRSPD_MIN speed begins to come before height, and does wholly by as much more.
_UNDERSPEED = 0.15


@inner
def lead_height(parameters: Record, own: Record, dt: float) -> None:  # pragma: no cover - compiled
    """Lead the reference height to the height that is asked for, within its rates and acceleration.

    It climbs by FW_T_CLMB_R_SP and sinks by FW_T_SINK_R_SP at most, and brakes in time, with FW_T_VERT_ACC.
    """
    missing = own.height_asked - own.height_reference
    rate = min(math.sqrt(2.0 * parameters.vertical_acceleration * abs(missing)), abs(missing) / dt)
    climb = min(parameters.climb_reference, parameters.climb_max)
    sink = min(parameters.sink_reference, parameters.sink_max)
    wanted = min(climb, max(-sink, math.copysign(rate, missing)))
    change = parameters.vertical_acceleration * dt
    own.height_rate = min(own.height_rate + change, max(own.height_rate - change, wanted))
    own.height_reference += own.height_rate * dt


@inner
def estimate_airspeed(
    measured: float, parameters: Record, own: Record, dt: float
) -> None:  # pragma: no cover - compiled
    """Smooth the measured airspeed (m/s): its measured rate counts as 0, as PX4 has it."""
    off, rate_off = measured - own.airspeed, -own.airspeed_rate
    own.airspeed += (own.airspeed_rate + parameters.speed_by_speed * off + parameters.speed_by_rate * rate_off) * dt
    own.airspeed = max(1.0, own.airspeed)
    own.airspeed_rate += (parameters.rate_by_speed * off + parameters.rate_by_rate * rate_off) * dt


@inner
def update_tecs(
    state: Record, estimated: Record, parameters: Record, own: Record, wanted: float, factor: float, dt: float
) -> None:  # pragma: no cover - compiled
    """Throttle and pitch demands for the height that is asked for and an airspeed, into ``own``.

    state: a record of `flight.dynamics.state.STATE`.  estimated: of `flight.guidance.navigation_error.MOTION`.
    wanted: equivalent airspeed, m/s.  factor: true by equivalent airspeed.
    """
    lead_height(parameters, own, dt)
    estimate_airspeed(state.airspeed, parameters, own, dt)
    speed = own.airspeed
    # In a bank the least airspeed grows with the root of the load.
    slowest = parameters.airspeed_min / math.sqrt(max(0.1, math.cos(own.roll_demand)))
    asked = min(parameters.airspeed_max, max(slowest, wanted)) * factor
    step = _SPEED_SLEW * dt
    own.airspeed_demand = min(own.airspeed_demand + step, max(own.airspeed_demand - step, asked))
    max_rate, min_rate = GRAVITY * parameters.climb_max, -GRAVITY * parameters.sink_min
    climb = (own.height_reference - estimated.up) / parameters.height_time
    climb += parameters.height_rate_share * own.height_rate
    climb = min(parameters.climb_max, max(-parameters.sink_max, climb))
    gain = (own.airspeed_demand - speed) / parameters.speed_time
    share = _SPEED_CHANGE_SHARE / speed
    gain = min(share * max_rate, max(share * min_rate, gain))
    under = underspeed(speed / factor, parameters)
    _set_pitch(estimated, parameters, own, climb, gain, under, dt)
    _set_throttle(state, estimated, parameters, own, climb, gain, under, factor, dt)


@inner
def underspeed(airspeed: float, parameters: Record) -> float:  # pragma: no cover - compiled
    """Share (0..1) to which speed comes before height.  airspeed: equivalent, m/s."""
    ramp = _UNDERSPEED * parameters.airspeed_trim
    begins = max(0.0, parameters.airspeed_min - ramp)
    whole = max(0.0, begins - ramp)
    share: float = 1.0 - min(1.0, max(0.0, (airspeed - whole) / max(1e-3, begins - whole)))
    return share


@inner
def _set_pitch(
    estimated: Record, parameters: Record, own: Record, climb: float, gain: float, under: float, dt: float
) -> None:  # pragma: no cover - compiled
    """Pitch angle for the balance of a climb rate (m/s) and an acceleration (m/s^2) that are demanded."""
    speed = own.airspeed
    weight = parameters.speed_weight * (1.0 - under) + 2.0 * under
    # Beyond the middle, 1, one of the two counts for less, and the other for no more.
    speed_weight, height_weight = min(1.0, max(0.0, weight)), min(1.0, max(0.0, 2.0 - weight))
    wanted = GRAVITY * climb * height_weight - speed * gain * speed_weight
    amiss = wanted - (GRAVITY * estimated.velocity_up * height_weight - speed * own.airspeed_rate * speed_weight)
    per_angle = speed * GRAVITY
    top, bottom = parameters.pitch_limit_max - parameters.pitch_trim, parameters.pitch_limit_min - parameters.pitch_trim
    grows = amiss * parameters.pitch_integral * dt
    angle = (amiss * parameters.pitch_damping + parameters.balance_share * wanted + own.balance_sum) / per_angle
    # At a limit the integral only leaves it.
    if not ((angle >= top and grows > 0.0) or (angle <= bottom and grows < 0.0)):
        own.balance_sum += grows
        angle += grows / per_angle
    angle = min(top, max(bottom, angle))
    step = parameters.vertical_acceleration / speed * dt
    own.pitch_demand = min(own.pitch_demand + step, max(own.pitch_demand - step, angle))


@inner
def _set_throttle(
    state: Record, estimated: Record, parameters: Record, own: Record, climb: float, gain: float, under: float,
    factor: float, dt: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Throttle for the rate of total energy that a climb rate (m/s) and an acceleration (m/s^2) take."""
    max_rate, min_rate = GRAVITY * parameters.climb_max, -GRAVITY * parameters.sink_min
    drag = parameters.roll_to_throttle * (1.0 / max(0.1, math.cos(state.roll)) - 1.0)
    wanted = min(max_rate, max(min_rate, GRAVITY * climb + own.airspeed * gain + drag))
    rate = GRAVITY * estimated.velocity_up + own.airspeed * own.airspeed_rate
    own.energy_rate += (rate - own.energy_rate) * dt / (dt + parameters.energy_rate_time)
    amiss, span = wanted - own.energy_rate, max_rate - min_rate
    # In thin air level flight takes more of the throttle.
    trim = min(parameters.throttle_max, max(parameters.throttle_min, parameters.throttle_trim * factor))
    if wanted >= 0.0:
        throttle = trim + wanted * (parameters.throttle_max - trim) / max_rate
    else:
        throttle = trim + wanted * (trim - parameters.throttle_min) / -min_rate
    throttle += amiss * parameters.throttle_damping / span + own.throttle_sum
    grows = amiss * parameters.throttle_integral / span * dt
    full, idle = throttle >= parameters.throttle_max, throttle <= parameters.throttle_min
    if not ((full and grows > 0.0) or (idle and grows < 0.0)):
        own.throttle_sum += grows
        throttle += grows
    throttle += under * (parameters.throttle_max - throttle)
    throttle = min(parameters.throttle_max, max(parameters.throttle_min, throttle))
    if parameters.throttle_slew > 0.0:
        step = parameters.throttle_slew * (parameters.throttle_max - parameters.throttle_min) * dt
        throttle = min(own.throttle_demand + step, max(own.throttle_demand - step, throttle))
    own.throttle_demand = throttle
