"""Implement ArduPlane's control law as compiled code, with its memory, bank and altitude demands, TECS and a tick."""

import math

import numpy as np

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.navigator import navigate_legs, target_of
from flight.autopilots.arduplane.parameters import ARDUPILOT_PARAMETERS, FULL_LOAD_FACTOR_LIMIT, IMMEDIATE_CLIMB
from flight.dynamics.instructions import Code
from flight.guidance.equivalent_airspeed import true_by_equivalent
from flight.guidance.inner_loops import follow_roll, steer_elevator
from flight.guidance.path import find_on_path, leave_sharp_corners, profile
from flight.mission.itinerary import UNLIMITED
from flight.simulation.compiled_loop import advance_model, read_state
from flight.simulation.tick import (
    MISSED_ROUTE_DISTANCE_M,
    NOT_A_NUMBER,
    PATH_ROW,
    WORKSPACE,
    WORKSPACE_NUMBERS,
    begin_tick,
    end_return,
    end_tick,
)
from world.arrays import Floats, Heights
from world.frames import polymap
from world.kernels import Record, Records, compiled, inner, record_dtype
from world.terrain import pixel_height

# ----------------------------------------------------------------------
# Memory of ArduPlane's control law from tick to tick.

ARDUPILOT_MEMORY = record_dtype(
    "clock",  # s until the next navigation update
    ("begun", np.bool_),  # True once a tick was flown
    # Lateral.
    ("leg", np.int64),  # current leg, from waypoint `leg` to `leg + 1`
    "from_east",  # m, start of the leg's line
    "from_north",
    "from_up",  # m, start of its altitude slope
    "cross_track_integrator",  # rad, L1's cross-track integrator
    ("on_circle", np.bool_),  # True while the loiter is followed, not just approached
    ("loitering", np.bool_),  # True once this loiter was captured: its turns and time are measured from then on
    "stayed",  # s since the capture
    "circled",  # rad around the center since the capture, positive in the direction of the loiter
    "bearing",  # rad, bearing from the center at the last update
    ("at_height", np.bool_),  # True once the loiter's altitude was reached, or given up
    "next_look",  # rad around the loiter at which the altitude is next checked for progress
    "up_before",  # m, altitude at the last such check
    ("over", np.bool_),  # True once the loiter's turns, time or altitude are done
    "waited",  # rad around the loiter since then
    ("left_for", np.int64),  # leg that followed the last loiter, 0 if none
    ("returning", np.bool_),  # True during an RTL; from_east, from_north and from_up are then where the RTL began
    ("climbed", np.bool_),  # True once the climb that precedes the turn to home is done
    "side_acceleration",  # m/s^2 to the right, the last demand
    "roll_demand",  # rad
    # Altitude.
    "ground",  # m AMSL, terrain at the aircraft
    "rise_ahead",  # m, added to the altitude of a leg above terrain because of the terrain ahead
    ("terrain_leg", np.int64),  # current leg above terrain, plus one; 0 before the first
    ("sloped_leg", np.int64),  # current leg with a slope between altitudes, plus one; 0 before the first
    "from_above_ground",  # m, height above ground where the line of the leg above terrain begins
    "lookahead_offset",  # m, height above ground to gain on that leg as it began; a descent reduces the lookahead
    "height_asked",  # m, altitude setpoint of the leg, frozen while the aircraft cannot follow it
    "height_limited",  # m, the same after the rate limit
    "height_demand",  # m, the same after the rate limit and the lag
    "height_rate",  # m/s, rate of the altitude demand
    "climb_share",  # 0..1, fraction of the maximum climb and sink rates that is demanded
    "sink_share",
    ("saturation", np.int64),  # saturation: 1 with throttle or pitch at its upper limit, -1 at its lower limit
    ("underspeed", np.bool_),  # underspeed: speed has priority over altitude until the altitude demand is reached
    "since_slow",  # s since the airspeed was last below the underspeed threshold
    # Airspeed.
    ("flown", np.bool_),  # True once there is a previous velocity
    "last_velocity_east",  # m/s, at the last update
    "last_velocity_north",
    "last_velocity_up",
    "airspeed_read",  # m/s, smoothed sensor reading
    "airspeed",  # m/s, filtered from the reading and the acceleration
    "airspeed_drift",  # m/s^2, correction of the acceleration by the filter
    "acceleration",  # m/s^2, along the nose, mean removed
    "acceleration_mean",
    "airspeed_demand",  # m/s, within its rate limits
    "ground_speed_rise",  # m/s, equivalent, by which the airspeed was last raised for a minimum ground speed
    # Energy.
    "ste_rate_error",  # m^2/s^3, STE rate error, smoothed
    "throttle_before",  # 0..1, last throttle without its integrator
    "ste_integrator",  # 0..1, STE integrator
    "seb_integrator",  # m^2/s^3, SEB integrator
    "ske_integrator",  # m^2/s^3, SKE integrator, positive when too fast
    "pitch_demand",  # rad, without the trim
    "throttle_demand",  # 0..1
)
# ArduPlane's part of a `flight.simulation.tick.Workspace`.
ARDUPLANE = record_dtype(("memory", ARDUPILOT_MEMORY), ("parameters", ARDUPILOT_PARAMETERS))
ARDUPLANE_NUMBERS = ARDUPLANE.itemsize // 8


# ----------------------------------------------------------------------
# Bank demand for a lateral acceleration, within the limits of the parameters and the airspeed.

# Lower bound of the bank limit when low airspeed reduces it, rad.
MIN_ROLL_LIMIT_RAD = math.radians(25.0)


@inner
def demanded_bank(side_acceleration: float, pitch: float, parameters: Record) -> float:
    """Return the bank for a side acceleration (m/s^2), within ROLL_LIMIT_DEG, rad.

    pitch: rad.
    """
    level = math.cos(min(math.radians(60.0), max(-math.radians(60.0), pitch)))
    wanted = math.atan(side_acceleration / (GRAVITY * level))
    return min(parameters.roll_limit, max(-parameters.roll_limit, wanted))


@inner
def min_airspeed(bank: float, parameters: Record) -> float:
    """Return the minimum equivalent airspeed in a demanded bank (rad), m/s.

    It is AIRSPEED_MIN divided by the root of cos bank, for the load factor of the turn; or, if AIRSPEED_STALL is
    stated, AIRSPEED_STALL divided by that root, but at least AIRSPEED_MIN (`AP_TECS::_update_speed`).
    """
    if parameters.stall_prevention <= 0.0:
        return parameters.airspeed_min
    load_root = 1.0 / math.sqrt(math.cos(min(math.radians(85.0), abs(bank))))
    if parameters.airspeed_stall > 0.0:
        return max(parameters.airspeed_min, parameters.airspeed_stall * load_root)
    return parameters.airspeed_min * load_root


@inner
def stall_bank(airspeed: float, slowest: float, least: float) -> float:
    """Return the bank that an airspeed allows without a stall, rad, but at least a given bank.

    airspeed, slowest: flown airspeed and minimum airspeed of straight flight, both equivalent or both true, m/s.
    least: rad.
    """
    speed_ratio = max(1.0, airspeed / slowest)
    return max(least, math.acos(min(1.0, 1.0 / (speed_ratio * speed_ratio))))


@inner
def roll_demand(side_acceleration: float, pitch: float, airspeed: float, parameters: Record) -> float:
    """Return the bank for a side acceleration (m/s^2), limited by ROLL_LIMIT_DEG and the stall, rad.

    pitch: rad.  airspeed: equivalent, m/s.
    """
    wanted = demanded_bank(side_acceleration, pitch, parameters)
    if parameters.stall_prevention <= 0.0:
        return wanted
    slowest, least = parameters.airspeed_min, MIN_ROLL_LIMIT_RAD
    if parameters.is_4_7:
        # `Plane::apply_load_factor_roll_limits`.
        if parameters.airspeed_stall > 0.0:
            slowest = parameters.airspeed_stall
            if int(parameters.flight_options) & FULL_LOAD_FACTOR_LIMIT:
                least = 0.0
        least = max(least, parameters.level_roll_limit)
    limit = stall_bank(airspeed, slowest, least)
    return min(limit, max(-limit, wanted))


# ----------------------------------------------------------------------
# Altitude and speed control: the altitude demand along a leg, and TECS.
#
# TECS (Total Energy Control System, Lambregts, AIAA 83-2239) sets throttle from the error in total energy, and pitch
# from the error in the balance between potential and kinetic energy.  The meaning of its parameters is from ArduPilot's
# documentation (ardupilot.org, Plane, "TECS ... Tuning Guide" and the parameter list).  The formulas were found by
# regression of ArduPlane 4.6's flight logs (messages TECS, TEC2, TEC3); they reproduce the logged pitch demands to
# eight digits.
#
# Energies are per kilogram, m^2/s^2; their rates m^2/s^3.  Speeds are true airspeeds.  Names as in AP_TECS: SPE and SKE
# are potential and kinetic energy, STE their sum, SEB their balance.

# Ratio of ArduPlane's airspeed reading to the true airspeed: the sensor noise raises the mean pressure.  Measured in
# logs of 20 flights of ArduPlane 4.6 in planfly's physics: 1.0024 to 1.0030, in still air and in turbulence alike.
AIRSPEED_READING = 1.0027
# Fraction of a new sensor reading (ARSP.Airspeed) that enters ArduPlane's airspeed (CTUN.As), ten times a second, for
# use at the next update.  From ArduPlane's logs.
_READING_FRACTION = 0.3
# Time constant of the smoothed STE rate error for throttle damping, s.
_STE_RATE_LAG_S = 0.5
# Damping ratio of the complementary filter that combines the airspeed reading and the acceleration.
_FILTER_DAMPING_RATIO = 1.414
# How far the SEB integrator may demand beyond the pitch limits, rad.
_PITCH_OVERSHOOT_RAD = math.radians(5.0)
# How far the STE integrator may demand beyond the throttle limits, 0..1.
_THROTTLE_OVERSHOOT_FRACTION = 0.1
# Limit of the SKE integrator, as a fraction of the pitch range in either direction.
_SKE_INTEGRATOR_FRACTION = 0.25
# Limit of the STE integrator, as a fraction of the throttle range.
_STE_INTEGRATOR_FRACTION = 0.5
# Fraction of the maximum energy rate that a change of airspeed may use.
_SPEED_RATE_FRACTION = 0.5
# Band below full throttle in which the demand is treated as saturated, 0..1.  Noise of airspeed and acceleration makes
# the demand touch the limit now and then: the band is three standard deviations.  Climbs at full throttle depend on it:
# with 0.003 to 0.005 the least clearances of 20 ArduPlane flights are met within 1.2 m; without it one is 9 m off.
_SATURATION_BAND_FRACTION = 0.003
# A rise of the airspeed for a minimum ground speed falls no less than this, m/s.
_GROUND_SPEED_HYSTERESIS_MPS = 1.2
# An RTL that climbs before its turn demands this much more than the climb, m.
_RTL_CLIMB_EXTRA_M = 10.0
# Underspeed begins below this ratio of airspeed to AIRSPEED_MIN ...
_UNDERSPEED_RATIO = 0.9
# ... with the throttle at or above this fraction of its maximum.
_FULL_THROTTLE_FRACTION = 0.95
# Underspeed ends when the altitude demand is reached, or at this ratio of airspeed to AIRSPEED_MIN ...
_UNDERSPEED_EXIT_RATIO = 1.15
# ... this long after the airspeed rose above the underspeed threshold, s.
_UNDERSPEED_EXIT_DELAY_S = 3.0


@inner
def demand_height(estimated: Record, b: Record, parameters: Record, own: Record, dt: float) -> None:
    """Update the altitude demand for the current leg, with its rate limit and its lag.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    b: the leg's end, of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    parameters, own: as `flight.autopilots.arduplane.navigator.navigate_legs` takes them.
    """
    if b.returns:
        target = _return_altitude(estimated, b, parameters, own)
    elif b.over_ground:
        target = _leg_altitude_above_terrain(estimated, b, parameters, own)
    else:
        target = _leg_altitude(estimated, b, parameters, own)
    share = dt / (dt + parameters.tecs_height_demand_time)
    # In saturation the setpoint is frozen, and the rate of the demand fades out.
    cannot_climb, cannot_sink = (
        own.saturation > 0 and own.height_rate > 0.0,
        own.saturation < 0 and own.height_rate < 0.0,
    )
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
    lag = own.height_limited - own.height_demand
    own.height_demand += share * lag
    own.height_rate = lag / max(dt, parameters.tecs_height_demand_time)


@inner
def _climbs_at_once(up: float, rise: float, b: Record, parameters: Record) -> bool:
    """Return True if a leg that begins at an altitude (m AMSL) is a step, not a slope.

    rise: height of the leg's end above the aircraft, m.  b: the leg's end.

    It is a step unless it leads down, if every climb is one, and in 4.6 if it begins low over home
    (`Plane::setup_glide_slope`, in 4.7 `setup_alt_slope`).
    """
    if rise < 0.0:
        return False
    if int(parameters.flight_options) & IMMEDIATE_CLIMB:
        return True
    return not parameters.is_4_7 and up - b.home_up <= parameters.climb_slope_height


@inner
def _leg_altitude(estimated: Record, b: Record, parameters: Record, own: Record) -> float:
    """Return the altitude on the leg's slope at the aircraft, or of the leg's end if the leg is a step.

    The slope of a leg to a loiter leads to the loiter's center; on the loiter the loiter's altitude applies.  In 4.7
    the altitude of the leg's end also applies in a climb while the aircraft is low over home
    (`Plane::set_target_altitude_proportion`).
    """
    end: float = b.up
    if own.sloped_leg != own.leg + 1:
        own.sloped_leg = own.leg + 1
        if _climbs_at_once(estimated.up, end - estimated.up, b, parameters):
            own.from_up = end
    if own.on_circle:
        return end
    altitude_change = end - own.from_up
    end_e, end_n = target_of(b)
    leg_e, leg_n = end_e - own.from_east, end_n - own.from_north
    run = max(1e-6, leg_e * leg_e + leg_n * leg_n)
    progress = ((estimated.east - own.from_east) * leg_e + (estimated.north - own.from_north) * leg_n) / run
    if abs(altitude_change) < parameters.altitude_slope_min or altitude_change == 0.0 or progress >= 1.0:
        return end
    if parameters.is_4_7 and altitude_change > 0.0 and estimated.up - b.home_up < parameters.climb_slope_height:
        return end
    remaining = 1.0 - max(0.0, progress)
    altitude: float = end - altitude_change * remaining
    here: float = estimated.up
    threshold = parameters.altitude_slope_threshold
    if threshold <= 0.0 or altitude_change <= 0.0 or here <= altitude + threshold:
        return altitude
    # This far above a slope that climbs, the slope is redrawn from here to its end.
    remaining_change = end - here
    if remaining_change < parameters.altitude_slope_min:
        own.from_up = end
        return end
    own.from_up = end - remaining_change / remaining
    return here


@inner
def _leg_altitude_above_terrain(estimated: Record, b: Record, parameters: Record, own: Record) -> float:
    """Return the altitude setpoint of a leg above terrain at the aircraft, m AMSL.

    The height above ground changes linearly along the leg, whatever the change, from the height of the leg's start
    above the ground there (`Plane::set_target_altitude_proportion_terrain`).  Rise of the terrain ahead beyond half of
    the maximum climb is added, less the leg's descent (`lookahead_adjustment` in ArduPlane/altitude.cpp).
    """
    if own.terrain_leg != own.leg + 1:
        # The leg began in this update: the ground at its start is looked up before the next update.
        return own.height_asked
    if own.on_circle:
        return own.ground + b.above_ground
    end_e, end_n = target_of(b)
    leg_e, leg_n = end_e - own.from_east, end_n - own.from_north
    run = max(1e-6, leg_e * leg_e + leg_n * leg_n)
    progress = ((estimated.east - own.from_east) * leg_e + (estimated.north - own.from_north) * leg_n) / run
    height = own.from_above_ground + min(1.0, max(0.0, progress)) * (b.above_ground - own.from_above_ground)
    return own.ground + height + max(0.0, own.rise_ahead + min(0.0, own.lookahead_offset))


@inner
def look_ahead(
    work: Record, heights: Heights, waypoints: Records, parameters: Record, own: Record
) -> None:  # pragma: no cover
    """Update the ground below the aircraft and the terrain lookahead on a leg above terrain.

    At the first update of a leg, note the height above ground of its begin.  The lookahead follows
    `AP_Terrain::lookahead` with half of TECS_CLMB_MAX as the climb: one sample every TERRAIN_SPACING towards the
    waypoint, no further than the waypoint or TERRAIN_LOOKAHD.  Samples of unknown ground change nothing.
    work: a record of `flight.simulation.tick.WORKSPACE`.
    """
    b = waypoints[own.leg + 1]
    # Before the first update of the law, the begin of the first leg is not set.
    if not own.begun or not b.over_ground or own.clock - work.timing.dt >= 0.5 * work.timing.dt:
        return
    here, place = work.estimated, work.place.ground
    own.ground = own.ground if math.isnan(place) else place
    if own.terrain_leg != own.leg + 1:
        own.terrain_leg = own.leg + 1
        column, row = polymap(work.pixel_map, own.from_east, own.from_north)
        from_ground = pixel_height(heights, column, row)
        own.from_above_ground = own.from_up - (own.ground if math.isnan(from_ground) else from_ground)
        gain = b.above_ground - (here.up - own.ground)
        own.lookahead_offset = gain if abs(gain) >= parameters.altitude_slope_min else 0.0
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
def _return_altitude(estimated: Record, b: Record, parameters: Record, own: Record) -> float:
    """Return the altitude setpoint of an RTL, m, on a straight slope in a descent, or the target's altitude in a climb.

    The slope leads from where the RTL began to the center of its loiter; on the loiter the target's altitude applies
    (`Plane::setup_glide_slope`, `Mode::update_target_altitude`).  The slope down to a rally point is computed as if the
    point's altitude above home were an altitude AMSL, and never exceeds the altitude at which the RTL began
    (`Plane::set_offset_altitude_location`, `Plane::constrain_target_altitude_location`; seen in 20 flights).  Until the
    climb that precedes the turn is done, the demand lies above the start and the target (`Plane::update_alt`).
    """
    end: float = b.up
    if not own.climbed:
        return max(own.from_up, end) + parameters.rtl_climb_min + _RTL_CLIMB_EXTRA_M
    fall = own.from_up - end
    slope_fall = fall + b.slope_base
    if own.on_circle or fall <= 0.0 or abs(slope_fall) < parameters.altitude_slope_min:
        return end
    leg_e, leg_n = b.centre_east - own.from_east, b.centre_north - own.from_north
    run = max(1e-6, leg_e * leg_e + leg_n * leg_n)
    progress = ((estimated.east - own.from_east) * leg_e + (estimated.north - own.from_north) * leg_n) / run
    return min(own.from_up, end + slope_fall * (1.0 - min(1.0, max(0.0, progress))))


@inner
def _estimate_airspeed(state: Record, estimated: Record, parameters: Record, own: Record, dt: float) -> None:
    """Estimate airspeed and its rate with a complementary filter of acceleration and airspeed.

    The acceleration along the nose gives the fast changes, and the measured airspeed gives the slow changes.  An
    accelerometer along the nose, with gravity removed, measures changes of the velocity over the ground, including its
    vertical part: at the start of a climb that is more than the airspeed gains.
    """
    level = math.cos(state.pitch)
    acceleration = (estimated.velocity_east - own.last_velocity_east) * math.sin(state.yaw) * level
    acceleration += (estimated.velocity_north - own.last_velocity_north) * math.cos(state.yaw) * level
    acceleration += (estimated.velocity_up - own.last_velocity_up) * math.sin(state.pitch)
    acceleration = acceleration / dt if own.flown else 0.0
    own.flown = True
    own.last_velocity_east, own.last_velocity_north = estimated.velocity_east, estimated.velocity_north
    own.last_velocity_up = estimated.velocity_up
    frequency = parameters.tecs_speed_frequency
    error = own.airspeed_read - own.airspeed
    own.airspeed_read += _READING_FRACTION * (AIRSPEED_READING * state.airspeed - own.airspeed_read)
    own.airspeed_drift += error * frequency * frequency * dt
    own.airspeed = max(
        3.0, own.airspeed + (acceleration + own.airspeed_drift + error * frequency * _FILTER_DAMPING_RATIO) * dt
    )
    own.acceleration_mean += (acceleration - own.acceleration_mean) * dt / (dt + parameters.tecs_time)
    own.acceleration = acceleration - own.acceleration_mean


@inner
def is_underspeed(estimated: Record, parameters: Record, own: Record, slowest: float, dt: float) -> bool:
    """Return True while speed has priority over altitude (`AP_TECS::_detect_underspeed`).

    slowest: AIRSPEED_MIN as a true airspeed, m/s.

    After an engine failure underspeed lasts until the aircraft meets a slope that leads down: it glides at
    AIRSPEED_MIN, and does not become as slow again (seen in 14 flights).
    """
    is_slow = own.airspeed < _UNDERSPEED_RATIO * slowest
    own.since_slow = 0.0 if is_slow else own.since_slow + dt
    if (
        own.underspeed
        and own.airspeed >= _UNDERSPEED_EXIT_RATIO * slowest
        and own.since_slow > _UNDERSPEED_EXIT_DELAY_S
    ):
        own.underspeed = False
    is_full_throttle = own.throttle_demand >= _FULL_THROTTLE_FRACTION * parameters.throttle_max
    own.underspeed = (is_slow and is_full_throttle) or (own.underspeed and estimated.up < own.height_demand)
    return own.underspeed


@inner
def airspeed_target(
    state: Record, estimated: Record, stated: float, b: Record, parameters: Record, own: Record, factor: float
) -> float:
    """Return the equivalent airspeed to fly for a stated one, raised for a minimum ground speed, within limits, m/s.

    b: the leg's end, with the minimum ground speed.

    What the ground speed along the heading lacks is added to the measured airspeed.  The rise is in whole m/s, and
    falls only if it is to fall by more than a hysteresis (`Plane::calc_airspeed_errors`,
    `Plane::calc_gndspeed_undershoot`).
    """
    wanted = stated
    if b.min_ground_speed > 0.0:
        ahead = estimated.velocity_east * math.sin(state.yaw) + estimated.velocity_north * math.cos(state.yaw)
        needed = (own.airspeed_read + b.min_ground_speed - ahead) / factor
        rise = float(math.floor(max(0.0, needed - stated) + 0.5))
        if rise >= own.ground_speed_rise or own.ground_speed_rise - rise >= _GROUND_SPEED_HYSTERESIS_MPS:
            own.ground_speed_rise = rise
        wanted += own.ground_speed_rise
    return min(parameters.airspeed_max, max(parameters.airspeed_min, wanted))


@inner
def update_tecs(
    state: Record, estimated: Record, parameters: Record, own: Record, airspeed: float, factor: float, dt: float
) -> None:
    """Update the throttle and pitch demands for the altitude demand and an airspeed (m/s, true).

    state: a record of `flight.dynamics.state.STATE`.  factor: ratio of true to equivalent airspeed.  The other
    parameters are those of `demand_height`.
    """
    _estimate_airspeed(state, estimated, parameters, own, dt)
    speed = own.airspeed
    slowest = min_airspeed(demanded_bank(own.side_acceleration, state.pitch, parameters), parameters) * factor
    # Where the aircraft fails to climb as demanded, full throttle is assumed to give less.
    max_rate = GRAVITY * parameters.tecs_climb_max * own.climb_share
    min_rate = -GRAVITY * parameters.tecs_sink_min
    underspeed = is_underspeed(estimated, parameters, own, slowest, dt)
    wanted = slowest if underspeed else max(slowest, airspeed)
    change = wanted - own.airspeed_demand
    max_change = _SPEED_RATE_FRACTION * max_rate / speed * dt
    min_change = _SPEED_RATE_FRACTION * min_rate / speed * dt
    own.airspeed_demand = max(slowest, own.airspeed_demand + min(max_change, max(min_change, change)))
    spe_error = GRAVITY * (own.height_demand - estimated.up)
    ske_error = 0.5 * (own.airspeed_demand * own.airspeed_demand - speed * speed)
    max_spe_error = max(0.0, 0.5 * (speed * speed - slowest * slowest))
    fastest = parameters.airspeed_max * factor
    min_spe_error = min(0.0, 0.5 * (speed * speed - fastest * fastest))
    spe_rate, ske_rate = GRAVITY * estimated.velocity_up, speed * own.acceleration
    limited_spe_error = min(max_spe_error, max(min_spe_error, spe_error))
    _set_throttle(
        state, parameters, own, spe_error, limited_spe_error + ske_error, spe_rate + ske_rate, max_rate, min_rate, dt
    )
    if underspeed:
        own.throttle_demand = parameters.throttle_max
    _set_pitch(state, parameters, own, spe_error, ske_error, spe_rate, ske_rate, underspeed, dt)


@inner
def _set_throttle(
    state: Record,
    parameters: Record,
    own: Record,
    spe_error: float,
    ste_error: float,
    ste_rate: float,
    max_rate: float,
    min_rate: float,
    dt: float,
) -> None:
    """Set the throttle demand from the STE error (m^2/s^2) and the STE rate (m^2/s^3).

    Follows `AP_TECS::_update_throttle_with_airspeed`.

    spe_error: m^2/s^2.
    max_rate, min_rate: STE rates at full and at idle throttle, m^2/s^3.
    """
    lowest, highest = max(0.0, parameters.throttle_min), parameters.throttle_max
    rate_per_throttle = (max_rate - min_rate) / (highest - parameters.throttle_min)
    rate_demand = min(max_rate, max(min_rate, spe_error / parameters.tecs_time))
    own.ste_rate_error += (rate_demand - ste_rate - own.ste_rate_error) * dt / (dt + _STE_RATE_LAG_S)
    tilt = math.sin(state.roll) * math.cos(state.pitch)
    roll_drag = parameters.tecs_roll_to_throttle * (1.0 / max(0.1, 1.0 - tilt * tilt) - 1.0)
    throttle = parameters.throttle_cruise + (rate_demand + roll_drag) / rate_per_throttle
    gain = 1.0 / (parameters.tecs_time * rate_per_throttle)
    throttle += gain * (ste_error + parameters.tecs_throttle_damping * own.ste_rate_error)
    limit = _STE_INTEGRATOR_FRACTION * (highest - lowest)
    integrator_max = min(limit, max(-limit, highest - throttle + _THROTTLE_OVERSHOOT_FRACTION))
    integrator_min = min(limit, max(-limit, parameters.throttle_min - throttle - _THROTTLE_OVERSHOOT_FRACTION))
    own.ste_integrator += gain * parameters.tecs_integral * ste_error * dt
    own.ste_integrator = min(integrator_max, max(integrator_min, own.ste_integrator))
    if parameters.throttle_slew > 0.0:
        step = parameters.throttle_slew * (highest - lowest) * dt
        throttle = min(own.throttle_before + step, max(own.throttle_before - step, throttle))
    own.throttle_before = throttle
    throttle += own.ste_integrator
    own.throttle_demand = min(highest, max(lowest, throttle))
    own.saturation = (
        1 if throttle >= highest - _SATURATION_BAND_FRACTION else (-1 if throttle <= parameters.throttle_min else 0)
    )


@inner
def wind_up_throttle(parameters: Record, own: Record) -> None:
    """Set the STE integrator to its value at full throttle, as ArduPlane does at every update of a climb-out.

    `AP_TECS::_update_throttle_with_airspeed` does so during take-off and an aborted landing; the throttle stays open
    for a while after that.
    """
    lowest, highest = max(0.0, parameters.throttle_min), parameters.throttle_max
    limit = _STE_INTEGRATOR_FRACTION * (highest - lowest)
    own.ste_integrator = min(limit, max(-limit, highest - own.throttle_before + _THROTTLE_OVERSHOOT_FRACTION))


@inner
def _set_pitch(
    state: Record,
    parameters: Record,
    own: Record,
    spe_error: float,
    ske_error: float,
    spe_rate: float,
    ske_rate: float,
    underspeed: bool,
    dt: float,
) -> None:
    """Set the pitch demand from the balance between potential and kinetic energy.

    Follows `AP_TECS::_update_pitch`.  spe_error, ske_error: m^2/s^2.  spe_rate, ske_rate: m^2/s^3.
    """
    ske_weight = 1.0 if underspeed else min(1.0, parameters.tecs_speed_weight)
    spe_weight = 0.0 if underspeed else min(1.0, 2.0 - parameters.tecs_speed_weight)
    pitch_max = parameters.pitch_limit_max
    if parameters.tecs_pitch_max > 0.0:
        pitch_max = min(pitch_max, parameters.tecs_pitch_max)
    pitch_min = parameters.pitch_limit_min
    if parameters.tecs_pitch_min < 0.0:
        pitch_min = max(pitch_min, parameters.tecs_pitch_min)
    rate_per_pitch = own.airspeed * GRAVITY
    rate_demand = spe_weight * (spe_error / parameters.tecs_time + GRAVITY * own.height_rate)
    rate_demand -= ske_weight * ske_error / parameters.tecs_time
    unlimited = rate_demand
    rate_demand = min(GRAVITY * parameters.tecs_climb_max, max(-GRAVITY * parameters.tecs_sink_max, unlimited))
    seb_rate_error = rate_demand - (spe_weight * spe_rate - ske_weight * ske_rate)
    total_demand = rate_demand + parameters.tecs_pitch_damping * seb_rate_error
    own.ske_integrator -= ske_weight * ske_error / parameters.tecs_time * dt
    limit = _SKE_INTEGRATOR_FRACTION * (pitch_max - pitch_min) * rate_per_pitch
    own.ske_integrator = min(limit, max(-limit, own.ske_integrator))
    own.seb_integrator += parameters.tecs_integral * seb_rate_error * dt
    integrator_max = (pitch_max + _PITCH_OVERSHOOT_RAD) * rate_per_pitch - total_demand - own.ske_integrator
    integrator_min = (pitch_min - _PITCH_OVERSHOOT_RAD) * rate_per_pitch - total_demand - own.ske_integrator
    own.seb_integrator = min(integrator_max, max(integrator_min, own.seb_integrator))
    pitch = (total_demand + own.seb_integrator + own.ske_integrator) / rate_per_pitch
    if pitch > pitch_max or unlimited > rate_demand:
        own.saturation = 1
    elif pitch < pitch_min or unlimited < rate_demand:
        own.saturation = -1
    pitch = min(pitch_max, max(pitch_min, pitch))
    step = parameters.tecs_vertical_acceleration / own.airspeed * dt
    own.pitch_demand = min(own.pitch_demand + step, max(own.pitch_demand - step, pitch))


# ----------------------------------------------------------------------
# One tick of ArduPlane: navigation and TECS run ten times a second, attitude control at every tick.
#
# Attitude control uses planfly's inner loops (`flight.guidance.inner_loops`) with the lags of ArduPlane's controllers,
# whose gains are tuned to the aircraft and do not belong to the law.

# Interval between updates of navigation and TECS, s (ArduPlane's scheduler table: 10 Hz).
NAVIGATION_TICK = 0.1
# Lag of the bank behind its demand, as a ratio to RLL2SRV_TCONST.
ROLL_LAG = 0.84
# Lag of the pitch behind its demand, as a ratio to PTCH2SRV_TCONST.
PITCH_LAG = 1.1
# Initial value of the SKE integrator, m^2/s^3.  The two pitch integrators balance each other, so steady flight does not
# determine it; the flight before the first waypoint has left 12 to 39, 27 on average, in 18 flights of ArduPlane.
INITIAL_SKE_INTEGRATOR = 27.0
# Limit of the pitch rate, rad/s.
_MAX_PITCH_RATE_RADPS = math.radians(40.0)


@compiled
def arduplane_tick(block: Floats, heights: Heights) -> int:
    """Advance the block of a `flight.simulation.tick.Workspace` by one tick.

    Return a key of its `ENDS`, or 0 to fly on.
    """
    path_begins = WORKSPACE_NUMBERS + ARDUPLANE_NUMBERS
    work = block[:WORKSPACE_NUMBERS].view(WORKSPACE)[0]
    own = block[WORKSPACE_NUMBERS:path_begins].view(ARDUPLANE)[0]
    path: Record = block[path_begins:].view(PATH_ROW)
    settings = work.settings
    if not begin_tick(work, heights):
        return NOT_A_NUMBER
    look_ahead(work, heights, path.waypoint[: settings.waypoints], own.parameters, own.memory)
    fly_as_ardupilot(
        work.state,
        work.estimated,
        path.piece[: settings.pieces],
        path.node[: settings.nodes],
        path.waypoint[: settings.waypoints],
        work.gains,
        work.memory,
        own.parameters,
        own.memory,
        work.commands,
        work.timing.dt,
    )
    return end_tick(work)


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
    """Fly up to a number of ticks with a `flight.dynamics.compiled_model.CompiledModel`, and return the last status."""
    for _ in range(count):
        read_state(block, numbers, code)
        status = arduplane_tick(block, heights)
        if status != 0:
            return status
        advance_model(block, frames[0], numbers, code, contacts, frictions)
    return 0


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
) -> None:
    """Fill the commands for one tick of ``dt`` seconds, and update the memories.

    parameters: a record of `flight.autopilots.arduplane.parameters.ARDUPILOT_PARAMETERS`.
    own: a `flight.autopilots.arduplane.law.ARDUPILOT_MEMORY` record.  The other parameters are those of
    `flight.autopilots.planfly.law.guide`.  The path is only the reference against which the track is measured; the law
    does not use it.
    """
    find_on_path(estimated, pieces, memory)
    b = waypoints[own.leg + 1]
    if b.circle != 0.0 and not b.returns:
        # ArduPlane's own logic ends a loiter; an aircraft that loiters at the mission's end has not missed the route.
        last = b.stop == waypoints[-1].stop
        # An altitude that ArduPlane gave up to reach is a missed altitude.
        memory.returning = last and (not b.to_height or abs(estimated.up - b.up) <= MISSED_ROUTE_DISTANCE_M)
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
        # Skip the rest of a loiter that was left earlier than the path has it.
        while pieces[memory.piece].leg < own.left_for - 1 and memory.piece + 1 < pieces.shape[0]:
            memory.piece += 1
        leave_sharp_corners(pieces, memory, own.leg)
        demand_height(estimated, waypoints[own.leg + 1], parameters, own, NAVIGATION_TICK)
        stated, b = waypoints[own.leg].airspeed, waypoints[own.leg + 1]
        wanted = airspeed_target(state, estimated, stated, b, parameters, own, factor)
        memory.speed_command = wanted * factor
        update_tecs(state, estimated, parameters, own, wanted * factor, factor, NAVIGATION_TICK)
    follow_attitude(state, estimated, gains, memory, parameters, own, factor, commands, dt)


@inner
def begin_law(
    state: Record, estimated: Record, waypoints: Records, memory: Record, parameters: Record, own: Record
) -> None:
    """Initialise the law in steady flight at the first waypoint."""
    own.begun = True
    own.from_east, own.from_north, own.from_up = waypoints[0].east, waypoints[0].north, waypoints[0].up
    own.height_asked = estimated.up
    own.height_limited = estimated.up
    own.height_demand = estimated.up
    own.climb_share, own.sink_share = 1.0, 1.0
    own.airspeed_read = state.airspeed
    own.airspeed = state.airspeed
    own.airspeed_demand = state.airspeed
    # Start with the trim of level flight here, as if the aircraft had flown before.
    own.pitch_demand = state.alpha - parameters.pitch_trim
    own.ske_integrator = INITIAL_SKE_INTEGRATOR
    own.seb_integrator = own.pitch_demand * state.airspeed * GRAVITY - INITIAL_SKE_INTEGRATOR
    own.throttle_demand = memory.trim_throttle
    own.throttle_before = parameters.throttle_cruise
    own.ste_integrator = memory.trim_throttle - parameters.throttle_cruise


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
) -> None:
    """Drive roll and pitch to their demands with the lags of ArduPlane's controllers, and set throttle."""
    own.roll_demand = roll_demand(own.side_acceleration, state.pitch, state.airspeed / factor, parameters)
    before = memory.bank_rate
    rate = (own.roll_demand - memory.bank) / (ROLL_LAG * parameters.roll_time)
    rate = min(gains.roll_rate_max, max(-gains.roll_rate_max, rate))
    limit = gains.roll_acceleration_max * dt
    rate = before + min(limit, max(-limit, rate - before))
    follow_roll(state, gains, memory, commands, memory.bank + rate * dt, rate, (rate - before) / dt, dt)
    # The rudder gets only its mix with the ailerons: the sideslip of a turn remains and widens the turn.
    commands.rudder = -parameters.rudder_mix * commands.aileron
    pitch_rate = (own.pitch_demand + parameters.pitch_trim - state.pitch) / (PITCH_LAG * parameters.pitch_time)
    pitch_rate = min(_MAX_PITCH_RATE_RADPS, max(-_MAX_PITCH_RATE_RADPS, pitch_rate))
    steer_elevator(state, gains, memory, commands, estimated.velocity_up, state.airspeed * pitch_rate)
    commands.throttle = own.throttle_demand
