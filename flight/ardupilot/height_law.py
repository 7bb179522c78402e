"""How ArduPlane keeps heights and speeds: the height demand along a leg, and TECS, which weighs energies.

TECS (Total Energy Control System) gives the throttle what total energy is missing, and the pitch angle what is amiss in
its balance between height and speed; the idea is Lambregts' (AIAA 83-2239).  What its parameters mean is from
ArduPilot's documentation (ardupilot.org, Plane, "TECS ... Tuning Guide" and the parameter list); how they combine was
found by regression of ArduPlane 4.6's flight logs (messages TECS, TEC2, TEC3), whose pitch demands these formulas give
to eight digits.

Energies are of a kilogram, m^2/s^2; their rates m^2/s^3.  Speeds are true airspeeds.
"""

import math

from aircraft.envelope import GRAVITY
from flight.ardupilot.lateral_law import least_airspeed, wanted_bank
from world.kernels import Record, compiled

# What ArduPlane reads by what is true: its sensor's noise adds to the pressure's mean.  Measured in logs of 20 flights
# of ArduPlane 4.6 in planfly's physics, in still air as in turbulence: 1.0024 to 1.0030.
AIRSPEED_READING = 1.0027
# Of what the sensor reads, so much is taken over ten times a second, and used at the next turn: so ArduPlane's airspeed
# (CTUN.As) follows the readings (ARSP.Airspeed) in its logs.
_READING_SHARE = 0.3
# Of the rate of total energy, for the throttle's damping: smoothed over this long, s.
_RATE_LAG = 0.5
# Damping of the filter that makes an airspeed of the measured one and the acceleration.
_FILTER_DAMPING = 1.414
# How far beyond the pitch limits the integral may ask, rad, and beyond the throttle's.
_PITCH_SPARE, _THROTTLE_SPARE = math.radians(5.0), 0.1
# Of the range of pitch (either way) and of throttle, what the integrals of speed and energy may take.
_SPEED_SHARE, _THROTTLE_SHARE = 0.25, 0.5
# Of the greatest rate of energy, what a change of speed may take.
_SPEED_CHANGE_SHARE = 0.5
# So near to full throttle the demand touches it now and then, by the noise of airspeed and acceleration that it is made
# of: three standard deviations.  Climbs that take all the throttle there is hang on this: with 0.003 to 0.005 the least
# clearances of 20 flights of ArduPlane are met within 1.2 m; without it one of them is 9 m off.
_NEARLY = 0.003
# Below this share of AIRSPEED_MIN, with the throttle all but full, speed comes before height.
_UNDERSPEED, _ALL_BUT_FULL = 0.9, 0.95


@compiled
def demand_height(
    estimated: Record, b: Record, parameters: Record, own: Record, dt: float
) -> None:  # pragma: no cover - compiled
    """Demand the height that the present leg asks for here, within the limits of its rate and with its lag.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    b: the leg's end, of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    parameters, own: as `flight.ardupilot.lateral_law.navigate_legs` takes them.
    """
    target = _leg_height(estimated, b, parameters, own)
    share = dt / (dt + parameters.tecs_height_demand_time)
    # What the aircraft cannot follow is not asked of it: the demand waits, and its rate is brought down meanwhile.
    cannot_climb, cannot_sink = own.held > 0 and own.height_rate > 0.0, own.held < 0 and own.height_rate < 0.0
    own.climb_share += share * ((0.0 if cannot_climb else 1.0) - own.climb_share)
    own.sink_share += share * ((0.0 if cannot_sink else 1.0) - own.sink_share)
    if cannot_climb:
        target = min(target, own.height_asked)
    if cannot_sink:
        target = max(target, own.height_asked)
    own.height_asked = target
    climb = parameters.tecs_climb_max * own.climb_share * dt
    sink = parameters.tecs_sink_max * own.sink_share * dt
    own.height_limited += min(climb, max(-sink, target - own.height_limited))
    behind = own.height_limited - own.height_demand
    own.height_demand += share * behind
    own.height_rate = behind / max(dt, parameters.tecs_height_demand_time)


@compiled
def _leg_height(estimated: Record, b: Record, parameters: Record, own: Record) -> float:  # pragma: no cover - compiled
    """Height on the leg's slope at the aircraft's place along it; that of its end where it is flown as a step."""
    end: float = b.up
    rise = end - own.from_up
    leg_e, leg_n = b.east - own.from_east, b.north - own.from_north
    run = max(1e-6, leg_e * leg_e + leg_n * leg_n)
    along = ((estimated.east - own.from_east) * leg_e + (estimated.north - own.from_north) * leg_n) / run
    if abs(rise) < parameters.glide_slope_min or rise == 0.0 or along >= 1.0:
        return end
    left = 1.0 - max(0.0, along)
    height: float = end - rise * left
    here: float = estimated.up
    above = parameters.glide_slope_threshold
    if above <= 0.0 or rise <= 0.0 or here <= height + above:
        return height
    # So high above a slope that climbs it is drawn anew, from here to its end.
    rest = end - here
    if rest < parameters.glide_slope_min:
        own.from_up = end
        return end
    own.from_up = end - rest / left
    return here


@compiled
def _estimate_airspeed(
    state: Record, estimated: Record, parameters: Record, own: Record, dt: float
) -> None:  # pragma: no cover - compiled
    """Airspeed and its rate: the acceleration along the nose for what is quick, the measured airspeed for the rest.

    An accelerometer along the nose, with gravity's share taken out, feels how the velocity over the ground changes, up
    and down too: where a climb begins, that is more than the speed gains.
    """
    level = math.cos(state.pitch)
    gained = (estimated.velocity_east - own.last_velocity_east) * math.sin(state.yaw) * level
    gained += (estimated.velocity_north - own.last_velocity_north) * math.cos(state.yaw) * level
    gained += (estimated.velocity_up - own.last_velocity_up) * math.sin(state.pitch)
    gained = gained / dt if own.flown else 0.0
    own.flown = True
    own.last_velocity_east, own.last_velocity_north = estimated.velocity_east, estimated.velocity_north
    own.last_velocity_up = estimated.velocity_up
    frequency = parameters.tecs_speed_frequency
    error = own.airspeed_read - own.airspeed
    own.airspeed_read += _READING_SHARE * (AIRSPEED_READING * state.airspeed - own.airspeed_read)
    own.airspeed_drift += error * frequency * frequency * dt
    own.airspeed = max(3.0, own.airspeed + (gained + own.airspeed_drift + error * frequency * _FILTER_DAMPING) * dt)
    own.acceleration_mean += (gained - own.acceleration_mean) * dt / (dt + parameters.tecs_time)
    own.acceleration = gained - own.acceleration_mean


@compiled
def weigh_energies(
    state: Record, estimated: Record, parameters: Record, own: Record, airspeed: float, factor: float, dt: float
) -> None:  # pragma: no cover - compiled
    """Throttle and pitch demands for the height demand and an airspeed (m/s, true), into `own`.

    state: a record of `flight.dynamics.state.STATE`.  factor: true by equivalent airspeed.  The others are as
    `demand_height` takes them.
    """
    _estimate_airspeed(state, estimated, parameters, own, dt)
    speed = own.airspeed
    slowest = least_airspeed(wanted_bank(own.side_acceleration, state.pitch, parameters), parameters) * factor
    # What it cannot climb now, full throttle does not give.
    most = GRAVITY * parameters.tecs_climb_max * own.climb_share
    least = -GRAVITY * parameters.tecs_sink_min
    full = own.throttle_demand >= _ALL_BUT_FULL * parameters.throttle_max
    under = speed < _UNDERSPEED * slowest and full
    wanted = slowest if under else max(slowest, airspeed)
    change = wanted - own.airspeed_demand
    most_change = _SPEED_CHANGE_SHARE * most / speed * dt
    least_change = _SPEED_CHANGE_SHARE * least / speed * dt
    own.airspeed_demand = max(slowest, own.airspeed_demand + min(most_change, max(least_change, change)))
    high = GRAVITY * (own.height_demand - estimated.up)
    fast = 0.5 * (own.airspeed_demand * own.airspeed_demand - speed * speed)
    slack = max(0.0, 0.5 * (speed * speed - slowest * slowest))
    fastest = parameters.airspeed_max * factor
    room = min(0.0, 0.5 * (speed * speed - fastest * fastest))
    climbing, gaining = GRAVITY * estimated.velocity_up, speed * own.acceleration
    limited = min(slack, max(room, high))
    _set_throttle(state, parameters, own, high, limited + fast, climbing + gaining, most, least, dt)
    if under:
        own.throttle_demand = parameters.throttle_max
    _set_pitch(state, parameters, own, high, fast, climbing, gaining, under, dt)


@compiled
def _set_throttle(
    state: Record, parameters: Record, own: Record, high: float, missing: float, rate: float, most: float,
    least: float, dt: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Throttle for the total energy that is missing (m^2/s^2), which changes at a rate (m^2/s^3).

    high: potential energy that is missing.  most, least: rates of energy at full and at least throttle.
    """
    lowest, highest = max(0.0, parameters.throttle_min), parameters.throttle_max
    per_throttle = (most - least) / (highest - parameters.throttle_min)
    wanted = min(most, max(least, high / parameters.tecs_time))
    own.energy_rate_error += (wanted - rate - own.energy_rate_error) * dt / (dt + _RATE_LAG)
    tilt = math.sin(state.roll) * math.cos(state.pitch)
    drag = parameters.tecs_roll_to_throttle * (1.0 / max(0.1, 1.0 - tilt * tilt) - 1.0)
    throttle = parameters.throttle_cruise + (wanted + drag) / per_throttle
    gain = 1.0 / (parameters.tecs_time * per_throttle)
    throttle += gain * (missing + parameters.tecs_throttle_damping * own.energy_rate_error)
    amplitude = _THROTTLE_SHARE * (highest - lowest)
    high_end = min(amplitude, max(-amplitude, highest - throttle + _THROTTLE_SPARE))
    low_end = min(amplitude, max(-amplitude, parameters.throttle_min - throttle - _THROTTLE_SPARE))
    own.throttle_sum += gain * parameters.tecs_integral * missing * dt
    own.throttle_sum = min(high_end, max(low_end, own.throttle_sum))
    if parameters.throttle_slew > 0.0:
        step = parameters.throttle_slew * (highest - lowest) * dt
        throttle = min(own.throttle_before + step, max(own.throttle_before - step, throttle))
    own.throttle_before = throttle
    throttle += own.throttle_sum
    own.throttle_demand = min(highest, max(lowest, throttle))
    own.held = 1 if throttle >= highest - _NEARLY else (-1 if throttle <= parameters.throttle_min else 0)


@compiled
def _set_pitch(
    state: Record, parameters: Record, own: Record, high: float, fast: float, climbing: float, gaining: float,
    under: bool, dt: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Pitch angle for the balance between potential energy and speed's.

    high, fast: potential and kinetic energy that are missing.  climbing, gaining: their rates.
    """
    speed_weight = 1.0 if under else min(1.0, parameters.tecs_speed_weight)
    height_weight = 0.0 if under else min(1.0, 2.0 - parameters.tecs_speed_weight)
    top = parameters.pitch_limit_max
    if parameters.tecs_pitch_max > 0.0:
        top = min(top, parameters.tecs_pitch_max)
    bottom = parameters.pitch_limit_min
    if parameters.tecs_pitch_min < 0.0:
        bottom = max(bottom, parameters.tecs_pitch_min)
    per_angle = own.airspeed * GRAVITY
    wanted = height_weight * (high / parameters.tecs_time + GRAVITY * own.height_rate)
    wanted -= speed_weight * fast / parameters.tecs_time
    asked = wanted
    wanted = min(GRAVITY * parameters.tecs_climb_max, max(-GRAVITY * parameters.tecs_sink_max, asked))
    amiss = wanted - (height_weight * climbing - speed_weight * gaining)
    total = wanted + parameters.tecs_pitch_damping * amiss
    own.speed_sum -= speed_weight * fast / parameters.tecs_time * dt
    most = _SPEED_SHARE * (top - bottom) * per_angle
    own.speed_sum = min(most, max(-most, own.speed_sum))
    own.balance_sum += parameters.tecs_integral * amiss * dt
    highest = (top + _PITCH_SPARE) * per_angle - total - own.speed_sum
    lowest = (bottom - _PITCH_SPARE) * per_angle - total - own.speed_sum
    own.balance_sum = min(highest, max(lowest, own.balance_sum))
    pitch = (total + own.balance_sum + own.speed_sum) / per_angle
    if pitch > top or asked > wanted:
        own.held = 1
    elif pitch < bottom or asked < wanted:
        own.held = -1
    pitch = min(top, max(bottom, pitch))
    step = parameters.tecs_vertical_acceleration / own.airspeed * dt
    own.pitch_demand = min(own.pitch_demand + step, max(own.pitch_demand - step, pitch))
