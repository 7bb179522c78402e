"""ArduPlane's law, compiled: what it keeps, the bank it takes, its height demand, TECS, and one tick of it all."""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.navigator import navigate_legs, target_of
from flight.autopilots.arduplane.parameters import ARDUPILOT_PARAMETERS
from flight.guidance.equivalent_airspeed import true_by_equivalent
from flight.guidance.inner_loops import follow_roll, steer_elevator
from flight.guidance.path import find_on_path, leave_sharp_corners, profile
from flight.mission.itinerary import UNLIMITED
from flight.simulation.tick import (
    FAR,
    NOT_A_NUMBER,
    PATH_ROW,
    WORKSPACE,
    WORKSPACE_NUMBERS,
    begin_tick,
    end_return,
    end_tick,
)
from world.frames import polymap
from world.kernels import Record, Records, compiled, inner, record_dtype
from world.terrain import Heights, pixel_height

Floats = NDArray[np.float64]

# ----------------------------------------------------------------------
# What ArduPlane's laws keep from tick to tick.

ARDUPILOT_MEMORY = record_dtype(
    "clock",  # s until the navigation's next turn
    ("begun", np.bool_),  # whether a tick was flown
    # Lateral.
    ("leg", np.int64),  # that is flown, from waypoint `leg` to `leg + 1`
    "from_east",  # m, where the leg's line begins
    "from_north",
    "from_up",  # m, where its slope begins
    "cross_track_sum",  # rad, L1's integral
    ("on_circle", np.bool_),  # whether a loiter's circle is followed, not just approached
    ("loitering", np.bool_),  # whether it was, of this loiter: from then on it counts
    "stayed",  # s since then
    "circled",  # rad around its middle since then, in its direction
    "bearing",  # rad, from its middle, the last time
    ("at_height", np.bool_),  # whether its height was reached, or given up
    "next_look",  # rad around at which it is looked at whether the height still changes
    "up_before",  # m, height at the last such look
    ("over", np.bool_),  # whether its turns, seconds or height are done
    "waited",  # rad around since then
    ("left_for", np.int64),  # the leg that the last loiter was left for, 0 for none
    ("returning", np.bool_),  # whether it returns to launch; from_east, from_north and from_up are then where it began
    ("climbed", np.bool_),  # whether it has climbed what it has to before it turns
    "side_acceleration",  # m/s^2 to the right, as last demanded
    "roll_demand",  # rad
    # Height.
    "ground",  # m AMSL, of the terrain here
    "rise_ahead",  # m, by which a leg above ground has to be flown higher for the terrain ahead
    ("ground_leg", np.int64),  # leg above ground that is flown, plus one; 0 before there was any
    "from_above_ground",  # m, height above ground at which that leg began
    "height_asked",  # m, of the leg, or as it was when the aircraft could follow it no longer
    "height_limited",  # m, the same within its rate limits
    "height_demand",  # m, and after its lag
    "height_rate",  # m/s, of the height demand
    "climb_share",  # 0..1, of the greatest rates that are demanded
    "sink_share",
    ("held", np.int64),  # 1 with throttle or pitch at its upper limit, -1 at its lower
    ("under", np.bool_),  # whether it is too slow, and speed comes before height until its height is reached
    "since_slow",  # s since it was as slow as that begins at
    # Airspeed.
    ("flown", np.bool_),  # whether there is a velocity of before
    "last_velocity_east",  # m/s, when it navigated last
    "last_velocity_north",
    "last_velocity_up",
    "airspeed_read",  # m/s, smoothed
    "airspeed",  # m/s, of the measured one and the acceleration
    "airspeed_drift",  # m/s^2, what the acceleration leaves out
    "acceleration",  # m/s^2, along the nose, without its mean
    "acceleration_mean",
    "airspeed_demand",  # m/s, within its rate limits
    # Energy.
    "energy_rate_error",  # m^2/s^3, smoothed
    "throttle_before",  # 0..1, the last without its integral
    "throttle_sum",  # 0..1, integral of the total energy that is missing
    "balance_sum",  # m^2/s^3, integral of what is amiss in the balance
    "speed_sum",  # m^2/s^3, integral of the kinetic energy that is too much
    "pitch_demand",  # rad, without the trim
    "throttle_demand",  # 0..1
)
# What it keeps in a `flight.simulation.tick.Workspace`.
ARDUPLANE = record_dtype(("memory", ARDUPILOT_MEMORY), ("parameters", ARDUPILOT_PARAMETERS))
ARDUPLANE_NUMBERS = ARDUPLANE.itemsize // 8


# ----------------------------------------------------------------------
# The bank that a side acceleration takes, within what the parameters and the airspeed allow.

# Least that the roll limit is narrowed to by low airspeed, rad.
_MIN_ROLL_LIMIT = math.radians(25.0)


@inner
def wanted_bank(side_acceleration: float, pitch: float, parameters: Record) -> float:  # pragma: no cover - compiled
    """Bank for a side acceleration (m/s^2), within ROLL_LIMIT_DEG, rad.  pitch: rad."""
    level = math.cos(min(math.radians(60.0), max(-math.radians(60.0), pitch)))
    wanted = math.atan(side_acceleration / (GRAVITY * level))
    within: float = min(parameters.roll_limit, max(-parameters.roll_limit, wanted))
    return within


@inner
def min_airspeed(bank: float, parameters: Record) -> float:  # pragma: no cover - compiled
    """Least airspeed that is flown in a wanted bank (rad), equivalent, m/s: AIRSPEED_MIN, for the load in the bank.

    A bank of phi takes 1 / sqrt(cos phi) of the least airspeed.
    """
    load = math.sqrt(math.cos(min(math.radians(85.0), abs(bank)))) if parameters.stall_prevention > 0.0 else 1.0
    slowest: float = parameters.airspeed_min / load
    return slowest


@inner
def stall_bank(airspeed: float, slowest: float) -> float:  # pragma: no cover - compiled
    """Bank that an airspeed bears without a stall, rad: 25 degrees at the least.

    airspeed, slowest: what is flown and the least of straight flight, both equivalent or both true, m/s.
    """
    spare = max(1.0, airspeed / slowest)
    bank: float = max(_MIN_ROLL_LIMIT, math.acos(min(1.0, 1.0 / (spare * spare))))
    return bank


@inner
def roll_demand(
    side_acceleration: float, pitch: float, airspeed: float, parameters: Record
) -> float:  # pragma: no cover - compiled
    """Bank for a side acceleration (m/s^2), within ROLL_LIMIT_DEG and what the airspeed bears without a stall, rad.

    pitch: rad.  airspeed: equivalent, m/s.
    """
    wanted = wanted_bank(side_acceleration, pitch, parameters)
    if parameters.stall_prevention <= 0.0:
        return wanted
    limit = stall_bank(airspeed, parameters.airspeed_min)
    demanded: float = min(limit, max(-limit, wanted))
    return demanded


# ----------------------------------------------------------------------
# How ArduPlane keeps heights and speeds: the height demand along a leg, and TECS, which weighs energies.
#
# TECS (Total Energy Control System) gives the throttle what total energy is missing, and the pitch angle what is amiss
# in its balance between height and speed; the idea is Lambregts' (AIAA 83-2239).  What its parameters mean is from
# ArduPilot's documentation (ardupilot.org, Plane, "TECS ... Tuning Guide" and the parameter list); how they combine was
# found by regression of ArduPlane 4.6's flight logs (messages TECS, TEC2, TEC3), whose pitch demands these formulas
# give to eight digits.
#
# Energies are of a kilogram, m^2/s^2; their rates m^2/s^3.  Speeds are true airspeeds.

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
# Until the height is reached, or the airspeed is above this share of AIRSPEED_MIN, s after it was so low.
_FAST_AGAIN, _AFTER = 1.15, 3.0


@inner
def demand_height(
    estimated: Record, b: Record, parameters: Record, own: Record, dt: float
) -> None:  # pragma: no cover - compiled
    """Demand the height that the present leg asks for here, within the limits of its rate and with its lag.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    b: the leg's end, of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    parameters, own: as `flight.autopilots.arduplane.navigator.navigate_legs` takes them.
    """
    if b.returns:
        target = _return_height(estimated, b, parameters, own)
    elif b.over_ground:
        target = _height_over_ground(estimated, b, parameters, own)
    else:
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


@inner
def _leg_height(estimated: Record, b: Record, parameters: Record, own: Record) -> float:  # pragma: no cover - compiled
    """Height on the leg's slope at the aircraft's place along it; that of its end where it is flown as a step.

    The slope of a leg to a loiter leads to its middle; on its circle its height counts.
    """
    end: float = b.up
    if own.on_circle:
        return end
    rise = end - own.from_up
    end_e, end_n = target_of(b)
    leg_e, leg_n = end_e - own.from_east, end_n - own.from_north
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


@inner
def _height_over_ground(
    estimated: Record, b: Record, parameters: Record, own: Record
) -> float:  # pragma: no cover - compiled
    """Return the altitude that a leg above ground asks for here, m AMSL.

    The height above ground changes evenly along the leg, or at once where it changes by less than GLIDE_SLOPE_MIN; what
    the terrain ahead rises by beyond half of the greatest climb is added (`Plane::set_offset_altitude_location`,
    `set_target_altitude_proportion`, `relative_target_altitude_cm`, `lookahead_adjustment` in ArduPlane/altitude.cpp).
    """
    end, here = b.above_ground, estimated.up - own.ground
    if own.ground_leg != own.leg + 1:
        own.ground_leg, own.from_above_ground = own.leg + 1, here
    end_e, end_n = target_of(b)
    leg_e, leg_n = end_e - own.from_east, end_n - own.from_north
    run = max(1e-6, leg_e * leg_e + leg_n * leg_n)
    along = ((estimated.east - own.from_east) * leg_e + (estimated.north - own.from_north) * leg_n) / run
    change = end - own.from_above_ground
    if own.on_circle or along >= 1.0 or abs(change) < parameters.glide_slope_min:
        height: float = own.ground + end + own.rise_ahead
        return height
    left = 1.0 - max(0.0, along)
    height = end - change * left
    if change > 0.0 and 0.0 < parameters.glide_slope_threshold < here - height:
        # Above a climb by more than the threshold, the climb is drawn again from here.
        rest = end - here if end - here >= parameters.glide_slope_min else 0.0
        own.from_above_ground, height = end - rest / left, end - rest
    asked: float = own.ground + height + max(0.0, own.rise_ahead + min(0.0, change))
    return asked


@inner
def look_ahead(
    work: Record, heights: Heights, waypoints: Records, parameters: Record, own: Record
) -> None:  # pragma: no cover
    """Note the ground below the aircraft and how far the terrain ahead rises above the climb, on a leg above ground.

    As `AP_Terrain::lookahead` with half of TECS_CLMB_MAX as the climb: every TERRAIN_SPACING towards the waypoint, up
    to it and up to TERRAIN_LOOKAHD.  Ground that is not known changes nothing.
    work: a record of `flight.simulation.tick.WORKSPACE`.
    """
    b = waypoints[own.leg + 1]
    if not b.over_ground or own.clock - work.timing.dt >= 0.5 * work.timing.dt:
        return
    here, place = work.estimated, work.place.ground
    own.ground = own.ground if math.isnan(place) else place
    own.rise_ahead = 0.0
    speed = math.hypot(here.velocity_east, here.velocity_north)
    end_e, end_n = target_of(b)
    distance = math.hypot(end_e - here.east, end_n - here.north)
    reach = min(distance, parameters.terrain_lookahead)
    if own.on_circle or reach <= 0.0 or speed < 1.0:
        return
    step = parameters.terrain_spacing
    climb = 0.5 * parameters.tecs_climb_max / speed * step
    step_e, step_n = step * (end_e - here.east) / distance, step * (end_n - here.north) / distance
    for k in range(1, math.ceil(reach / step) + 1):
        column, row = polymap(work.pixel_map, here.east + k * step_e, here.north + k * step_n)
        rise = pixel_height(heights, column, row) - own.ground - k * climb
        if rise > own.rise_ahead:
            own.rise_ahead = rise


@inner
def _return_height(
    estimated: Record, b: Record, parameters: Record, own: Record
) -> float:  # pragma: no cover - compiled
    """Height that a return asks for: on a straight slope down to its target, or at once up to it, m.

    The slope is that of the line from where it began to the middle of the circle; on the circle the target's height
    counts (`Plane::setup_glide_slope`, `Mode::update_target_altitude`).  Down to a rally point it is drawn as if the
    point's height over home were one above the sea, and flown no higher than it began
    (`Plane::set_offset_altitude_location`, `Plane::constrain_target_altitude_location`; seen in 20 flights).
    """
    end: float = b.up
    fall = own.from_up - end
    drawn = fall + b.slope_base
    if own.on_circle or fall <= 0.0 or abs(drawn) < parameters.glide_slope_min:
        return end
    leg_e, leg_n = b.centre_east - own.from_east, b.centre_north - own.from_north
    run = max(1e-6, leg_e * leg_e + leg_n * leg_n)
    along = ((estimated.east - own.from_east) * leg_e + (estimated.north - own.from_north) * leg_n) / run
    height: float = min(own.from_up, end + drawn * (1.0 - min(1.0, max(0.0, along))))
    return height


@inner
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


@inner
def is_underspeed(
    estimated: Record, parameters: Record, own: Record, slowest: float, dt: float
) -> bool:  # pragma: no cover - compiled
    """Whether speed comes before height (`AP_TECS::_detect_underspeed`).  slowest: AIRSPEED_MIN, true, m/s.

    An aircraft whose engine has stopped is so until it meets a slope that leads down: it glides at AIRSPEED_MIN, and
    does not come to be as slow again (seen in 14 flights).
    """
    slow = own.airspeed < _UNDERSPEED * slowest
    own.since_slow = 0.0 if slow else own.since_slow + dt
    if own.under and own.airspeed >= _FAST_AGAIN * slowest and own.since_slow > _AFTER:
        own.under = False
    full = own.throttle_demand >= _ALL_BUT_FULL * parameters.throttle_max
    own.under = (slow and full) or (own.under and estimated.up < own.height_demand)
    under: bool = own.under
    return under


@inner
def update_tecs(
    state: Record, estimated: Record, parameters: Record, own: Record, airspeed: float, factor: float, dt: float
) -> None:  # pragma: no cover - compiled
    """Throttle and pitch demands for the height demand and an airspeed (m/s, true), into `own`.

    state: a record of `flight.dynamics.state.STATE`.  factor: true by equivalent airspeed.  The others are as
    `demand_height` takes them.
    """
    _estimate_airspeed(state, estimated, parameters, own, dt)
    speed = own.airspeed
    slowest = min_airspeed(wanted_bank(own.side_acceleration, state.pitch, parameters), parameters) * factor
    # What it cannot climb now, full throttle does not give.
    max_rate = GRAVITY * parameters.tecs_climb_max * own.climb_share
    min_rate = -GRAVITY * parameters.tecs_sink_min
    under = is_underspeed(estimated, parameters, own, slowest, dt)
    wanted = slowest if under else max(slowest, airspeed)
    change = wanted - own.airspeed_demand
    max_change = _SPEED_CHANGE_SHARE * max_rate / speed * dt
    min_change = _SPEED_CHANGE_SHARE * min_rate / speed * dt
    own.airspeed_demand = max(slowest, own.airspeed_demand + min(max_change, max(min_change, change)))
    high = GRAVITY * (own.height_demand - estimated.up)
    fast = 0.5 * (own.airspeed_demand * own.airspeed_demand - speed * speed)
    slack = max(0.0, 0.5 * (speed * speed - slowest * slowest))
    fastest = parameters.airspeed_max * factor
    margin = min(0.0, 0.5 * (speed * speed - fastest * fastest))
    climbing, gaining = GRAVITY * estimated.velocity_up, speed * own.acceleration
    limited = min(slack, max(margin, high))
    _set_throttle(state, parameters, own, high, limited + fast, climbing + gaining, max_rate, min_rate, dt)
    if under:
        own.throttle_demand = parameters.throttle_max
    _set_pitch(state, parameters, own, high, fast, climbing, gaining, under, dt)


@inner
def _set_throttle(
    state: Record, parameters: Record, own: Record, high: float, missing: float, rate: float, max_rate: float,
    min_rate: float, dt: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Throttle for the total energy that is missing (m^2/s^2), which changes at a rate (m^2/s^3).

    high: potential energy that is missing.  max_rate, min_rate: rates of energy at full and at idle throttle.
    """
    lowest, highest = max(0.0, parameters.throttle_min), parameters.throttle_max
    per_throttle = (max_rate - min_rate) / (highest - parameters.throttle_min)
    wanted = min(max_rate, max(min_rate, high / parameters.tecs_time))
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


@inner
def wind_up_throttle(parameters: Record, own: Record) -> None:  # pragma: no cover - compiled
    """Leave the throttle's integral where it asks for full throttle, as after each turn of a climb-out.

    `AP_TECS::_update_throttle_with_airspeed` sets it so while it takes off or aborts a landing; the throttle stays open
    for a while after that.
    """
    lowest, highest = max(0.0, parameters.throttle_min), parameters.throttle_max
    amplitude = _THROTTLE_SHARE * (highest - lowest)
    own.throttle_sum = min(amplitude, max(-amplitude, highest - own.throttle_before + _THROTTLE_SPARE))


@inner
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
    limit = _SPEED_SHARE * (top - bottom) * per_angle
    own.speed_sum = min(limit, max(-limit, own.speed_sum))
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


# ----------------------------------------------------------------------
# One tick of ArduPlane: ten times a second it navigates and weighs energies, and at each tick follows its attitude.
#
# Attitudes are followed through planfly's inner loops (`flight.guidance.inner_loops`), as late as ArduPlane's
# controllers follow them, whose gains are tuned to the aircraft and are no part of the law.

# ArduPlane navigates and updates its height and speed law so often, s (its scheduler's table: 10 Hz).
NAVIGATION_TICK = 0.1
# A bank follows its demand so much later than RLL2SRV_TCONST says, as a share of it; and a pitch angle.
ROLL_LAG = 0.84
PITCH_LAG = 1.1
# TECS's two integrals of the pitch balance each other, and no steady flight tells how large they are; what came before
# the first waypoint has left this in the one of speed, m^2/s^3 (12 to 39, 27 on average, in 18 flights of ArduPlane).
SPEED_SUM = 27.0
_FASTEST_PITCH = math.radians(40.0)


@compiled
def arduplane_tick(block: Floats, heights: Heights) -> int:  # pragma: no cover - compiled
    """One tick on the block of a `flight.simulation.tick.Workspace`: a key of its `ENDS`, or 0 to fly on."""
    path_begins = WORKSPACE_NUMBERS + ARDUPLANE_NUMBERS
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    own = block[WORKSPACE_NUMBERS:path_begins].view(ARDUPLANE)[0]
    path: Record = block[path_begins:].view(PATH_ROW)
    settings = work.settings
    if not begin_tick(work, heights):
        return NOT_A_NUMBER
    look_ahead(work, heights, path.waypoint[: settings.waypoints], own.parameters, own.memory)
    fly_as_ardupilot(
        work.state, work.estimated, path.piece[: settings.pieces], path.node[: settings.nodes],
        path.waypoint[: settings.waypoints], work.gains, work.memory, own.parameters, own.memory,
        work.commands, work.timing.dt,
    )  # fmt: skip
    return end_tick(work)


@inner
def fly_as_ardupilot(
    state: Record,
    estimated: Record,
    pieces: Records,
    nodes: Records,
    waypoints: Records,
    gains: Record,
    memory: Record,
    parameters: Record,
    own: Record,
    commands: Record,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """One tick of ``dt`` seconds: fill the commands, and the memories for the next one.

    parameters: a record of `flight.autopilots.arduplane.parameters.ARDUPILOT_PARAMETERS`.
    own: of `flight.autopilots.arduplane.law.ARDUPILOT_MEMORY`.
    The others are as `flight.autopilots.planfly.law.guide` takes them; the path is what the track is measured against,
    and no part of the law.
    """
    find_on_path(estimated, pieces, memory)
    b = waypoints[own.leg + 1]
    if b.circle != 0.0 and not b.returns:
        # A loiter is over by ArduPlane's own account; what circles at a mission's end has not missed it.
        last = b.stop == waypoints[-1].stop
        # A height that it gave up to reach is one that it has missed.
        memory.returning = last and (not b.to_height or abs(estimated.up - b.up) <= FAR)
        stays = b.stays == math.inf and own.stayed > UNLIMITED
        memory.done = last and (own.over or stays)
    if own.returning and waypoints[waypoints.shape[0] - 1].returns:
        end_return(estimated, waypoints[own.leg + 1], memory, dt)
    memory.height_error = estimated.up - profile(nodes, memory.distance)[0]
    if memory.done and b.to_height:
        memory.height_error = estimated.up - b.up
    factor = true_by_equivalent(estimated.up)
    if not own.begun:
        begin_law(state, estimated, waypoints, memory, parameters, own)
    own.clock -= dt
    if own.clock < 0.5 * dt:
        own.clock += NAVIGATION_TICK
        navigate_legs(estimated, waypoints, parameters, own, factor, NAVIGATION_TICK)
        # Where a loiter was left sooner than the path does, the rest of it is not flown.
        while pieces[memory.piece].leg < own.left_for - 1 and memory.piece + 1 < pieces.shape[0]:
            memory.piece += 1
        leave_sharp_corners(pieces, memory, own.leg)
        demand_height(estimated, waypoints[own.leg + 1], parameters, own, NAVIGATION_TICK)
        wanted = min(parameters.airspeed_max, max(parameters.airspeed_min, waypoints[own.leg].airspeed))
        memory.speed_command = wanted * factor
        update_tecs(state, estimated, parameters, own, wanted * factor, factor, NAVIGATION_TICK)
    follow_attitude(state, estimated, gains, memory, parameters, own, factor, commands, dt)


@inner
def begin_law(
    state: Record, estimated: Record, waypoints: Records, memory: Record, parameters: Record, own: Record
) -> None:  # pragma: no cover - compiled
    """Take over in steady flight at the first waypoint."""
    own.begun = True
    own.from_east, own.from_north, own.from_up = waypoints[0].east, waypoints[0].north, waypoints[0].up
    own.height_asked = estimated.up
    own.height_limited = estimated.up
    own.height_demand = estimated.up
    own.climb_share, own.sink_share = 1.0, 1.0
    own.airspeed_read = state.airspeed
    own.airspeed = state.airspeed
    own.airspeed_demand = state.airspeed
    # As it has flown before: what level flight here takes is known.
    own.pitch_demand = state.alpha - parameters.pitch_trim
    own.speed_sum = SPEED_SUM
    own.balance_sum = own.pitch_demand * state.airspeed * GRAVITY - SPEED_SUM
    own.throttle_demand = memory.trim_throttle
    own.throttle_before = parameters.throttle_cruise
    own.throttle_sum = memory.trim_throttle - parameters.throttle_cruise


@inner
def follow_attitude(
    state: Record,
    estimated: Record,
    gains: Record,
    memory: Record,
    parameters: Record,
    own: Record,
    factor: float,
    commands: Record,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """Roll and pitch to their demands, each with the lag of ArduPlane's controllers; throttle as it is demanded."""
    own.roll_demand = roll_demand(own.side_acceleration, state.pitch, state.airspeed / factor, parameters)
    before = memory.bank_rate
    rate = (own.roll_demand - memory.bank) / (ROLL_LAG * parameters.roll_time)
    rate = min(gains.roll_rate_max, max(-gains.roll_rate_max, rate))
    limit = gains.roll_acceleration_max * dt
    rate = before + min(limit, max(-limit, rate - before))
    follow_roll(state, gains, memory, commands, memory.bank + rate * dt, rate, (rate - before) / dt, dt)
    # Of the rudder the ailerons' share alone: nothing takes the sideslip out of a turn, which is so much wider.
    commands.rudder = -parameters.rudder_mix * commands.aileron
    pitch_rate = (own.pitch_demand + parameters.pitch_trim - state.pitch) / (PITCH_LAG * parameters.pitch_time)
    pitch_rate = min(_FASTEST_PITCH, max(-_FASTEST_PITCH, pitch_rate))
    steer_elevator(state, gains, memory, commands, estimated.velocity_up, state.airspeed * pitch_rate)
    commands.throttle = own.throttle_demand
