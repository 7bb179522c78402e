"""Compute PX4's deviation from the legs of a plan.

Horizontal turns are simulated with PX4's own guidance.

Each turn is simulated in still air, at a constant ground speed, with `flight.autopilots.px4.navigator` and the lag of
the roll. For wind, the excursion in still air at the highest ground speed on the leg is increased by `WIND_SPREAD`.
"""

import math
from functools import lru_cache

import numpy as np

from aircraft.envelope import GRAVITY
from aircraft.tracking import SPEED_RATIOS, TURNS, TrackingError
from flight.autopilots.px4.lateral import roll_setpoint
from flight.autopilots.px4.law import PX4_MEMORY, ROLL_LAG_RATIO
from flight.autopilots.px4.navigator import acceptance_radius_at, navigate
from flight.autopilots.px4.parameters import Px4Parameters
from flight.guidance.lateral_reference_laws import strided_waypoints
from flight.guidance.navigation_error import ERRORS, MOTION
from world.arrays import Floats
from world.kernels import Record, Records, compiled, field_names, inner, record_dtype
from world.scenario_tables import Navigation
from world.wind import W20, Turbulence

# A turn is complete once the aircraft stays this close to the next leg, m ...
_SETTLED_CROSS_TRACK_M = 2.0
# ... for this time, s.
_SETTLED_TIME_S = 8.0
# Length of the legs before and after a turn, m.
_LEG_LENGTH_M = 4000.0
# Fraction of the second leg after which a simulation ends at the latest.
_MAX_DISTANCE_FRACTION = 0.75
# Time after which a simulation ends at the latest, s.
_TIMEOUT_S = 120.0
# Distance before the earliest turn at which the simulations begin, m.
_RUN_IN_M = 200.0
# Time step of the simulations, s.
_TIME_STEP_S = 0.05
# Margin for wind: factor on the excursion in still air, and addition to that factor for a turn of 90 degrees. Measured
# on ArduPlane's turns in wind (`flight.autopilots.arduplane.tracking_error`), whose guidance does not use the wind as
# PX4's does.
WIND_SPREAD = 1.1, 0.5
# Margin for navigation errors, in standard deviations.
_NAVIGATION_SIGMAS = 3.0
# Cross-track deviation on straight legs in light turbulence, without navigation errors, m.
_CROSS_TRACK_M = 2.0
# Deviation from the lagged altitude in light turbulence, without navigation errors, m.
_ALTITUDE_ERROR_M = 3.0
# Fraction of FW_T_CLMB_R_SP and FW_T_SINK_R_SP that a plan uses, by turbulence. PX4 flies slopes steeper than planned,
# because they end a loiter radius early, and it circles if the altitude is not reached at a waypoint.
_RATE_FRACTIONS = {"none": 0.8, "light": 0.7, "moderate": 0.6}
# The same fraction of the aircraft's own climb and sink rates: a gust that lasts as long as a leg reduces them, and PX4
# circles if it reaches a waypoint more than NAV_FW_ALT_RAD from its altitude. In light turbulence the Zagi's slopes
# over 4 km at 0.9 of its rates ended in circles in 2 (up) and 6 (down) of 6 streams, at 0.6 (0.7 less the margin of
# plans) in none and 1. In still air it flew 0.98 of them within 6 m: no margin is needed there.
_OWN_RATE_FRACTIONS = _RATE_FRACTIONS | {"none": 1.0}

# Standard deviation of the altitude in moderate turbulence with sufficient climb and sink rates, m: 3.7 computed from
# PX4's TECS and Dryden's gusts at 15 to 27 m/s; 3.7 (Aerosonde) and 4.2 (Ultra Stick) in 84 flights.
_ALTITUDE_SIGMA_MODERATE_M = 4.0
# Assumed duration of a gust that exceeds the aircraft's reserve of climb or sink rate, s: with it 74 of 1,860
# waypoints in 186 flights of four aircraft are expected to be passed more than 10 m from their altitudes, and 58 were.
_GUST_DURATION_S = 6.0


def tracking_error(
    parameters: Px4Parameters,
    airspeed: float,
    nav: Navigation,
    *,
    turbulence: Turbulence = "none",
) -> TrackingError:
    """Return PX4's deviations from the legs of a plan, which the plan must allow for.

    airspeed: equivalent airspeed, m/s.
    nav: accuracy of navigation.
    turbulence: turbulence of the wind.

    >>> from flight.autopilots.px4.parameters import Px4Parameters
    >>> error = tracking_error(Px4Parameters.defaults("1.16"), 25.0, "gnss")
    >>> round(error.lag, 3), error.corner_acceptance(math.radians(30.0), 25.0)
    (3.5, 56.0)
    """
    acceptance, excursion, before, after = _corner_tables(parameters, airspeed)
    navigation_error = _NAVIGATION_SIGMAS * ERRORS[nav][0]
    return TrackingError(
        airspeed=airspeed,
        acceptance=acceptance,
        excursion=excursion,
        before=before,
        after=after,
        across=math.hypot(_CROSS_TRACK_M, navigation_error),
        up=math.hypot(_ALTITUDE_ERROR_M, navigation_error),
        lag=(1.0 - parameters["FW_T_HRATE_FF"]) * parameters["FW_T_ALT_TC"],
        step=0.0,
        climb_rate=_RATE_FRACTIONS[turbulence] * min(parameters["FW_T_CLMB_R_SP"], parameters["FW_T_CLMB_MAX"]),
        sink_rate=_RATE_FRACTIONS[turbulence] * min(parameters["FW_T_SINK_R_SP"], parameters["FW_T_SINK_MAX"]),
        own_climb_share=_OWN_RATE_FRACTIONS[turbulence],
        own_sink_share=_OWN_RATE_FRACTIONS[turbulence],
    )


def altitude_miss_probability(
    acceptance: float, climb_reserve: float, sink_reserve: float, turbulence: Turbulence
) -> float:
    """Return the probability that gusts carry an aircraft beyond its altitude tolerance at a waypoint.

    acceptance: altitude tolerance (NAV_FW_ALT_RAD), m.
    climb_reserve, sink_reserve: climb and sink rates that the aircraft does not use, m/s. A draft that exceeds these
        rates moves the aircraft away until the draft ends.

    The result is 0 for any turbulence other than moderate.

    >>> round(altitude_miss_probability(10.0, 4.0, 4.0, "moderate"), 3)
    0.013
    >>> altitude_miss_probability(10.0, 4.0, 4.0, "light")
    0.0
    """
    if turbulence != "moderate":
        return 0.0
    # Near the ground the deviation of vertical gusts is a tenth of the wind at 20 ft (MIL-F-8785C).
    gust_sigma, drift_rate = 0.1 * W20[turbulence], acceptance / _GUST_DURATION_S
    return (
        2.0 * _exceedance_probability(acceptance / _ALTITUDE_SIGMA_MODERATE_M)
        + _exceedance_probability((climb_reserve + drift_rate) / gust_sigma)
        + _exceedance_probability((sink_reserve + drift_rate) / gust_sigma)
    )


def _exceedance_probability(deviations: float) -> float:
    """Return the probability that a normal variable exceeds its mean by some standard deviations."""
    return 0.5 * math.erfc(deviations / math.sqrt(2.0))


# Tracking of a turn, m: acceptance radius, maximum distance from the legs, affected lengths before and after.
CORNER_TRACKING = record_dtype("acceptance", "excursion", "before", "after")


@lru_cache(maxsize=8)
def _corner_tables(parameters: Px4Parameters, airspeed: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Return four tables on corners, m: acceptance radius, excursion, affected length before and after.

    Each table has one row per turn of `TURNS` and one column per speed of `SPEED_RATIOS`. The excursion is the greatest
    distance from the legs, including the margin for wind. The affected lengths are parts of the legs before and after
    the corner.
    """
    corners = np.zeros((TURNS.size, SPEED_RATIOS.size), CORNER_TRACKING)
    _measure_corners(parameters.record(), airspeed, TURNS, SPEED_RATIOS * airspeed, corners, strided_waypoints(3))
    excursion_factor, right_angle_margin = WIND_SPREAD
    corners["excursion"] *= (excursion_factor + right_angle_margin * (TURNS / (0.5 * math.pi)) ** 2)[:, None]
    # Rounded because plans must be the same on every machine, and sines differ between libraries.
    acceptance, excursion, before, after = (corners[name].round(2) for name in field_names(CORNER_TRACKING))
    for table in (acceptance, excursion, before, after):
        table.setflags(write=False)
    return acceptance, excursion, before, after


@compiled
def _measure_corners(
    parameters: Record,
    airspeed: float,
    turn_angles: Floats,
    ground_speeds: Floats,
    corners: Records,
    waypoints: Records,
) -> None:
    """Fill the `CORNER_TRACKING` record of each corner, by turn angle (rows) and ground speed (columns).

    Each corner is simulated once, with PX4's own acceptance radius; a turn of 0 is not simulated.

    airspeed: equivalent airspeed, m/s.
    turn_angles: rad.
    ground_speeds: m/s.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    corners: `CORNER_TRACKING` records (turns, speeds) to fill.
    waypoints: scratch, three `WAYPOINT` records.
    """
    for i in range(turn_angles.size):
        for j in range(ground_speeds.size):
            corner = corners[i, j]
            corner.acceptance = acceptance_radius_at(ground_speeds[j], parameters)
            if turn_angles[i] > 0.0:
                corner.before = corner.acceptance
                corner.excursion, corner.after = _fly_corner(
                    parameters, airspeed, turn_angles[i], ground_speeds[j], waypoints
                )


@inner
def _fly_corner(
    parameters: Record, airspeed: float, turn: float, ground_speed: float, waypoints: Records
) -> tuple[float, float]:
    """Simulate one corner; return the excursion and the settling distance, m.

    The excursion is the maximum distance from the nearer leg. The settling distance is measured along the second leg;
    beyond it the aircraft stays within `_SETTLED_CROSS_TRACK_M` of the leg. The first leg leads north to the origin.

    airspeed: equivalent airspeed, m/s.
    turn: rad, to the right.
    ground_speed: m/s.
    waypoints: scratch, three `WAYPOINT` records of fly-by waypoints; their positions are overwritten.
    """
    motions, controller_states = np.zeros(1, MOTION), np.zeros(1, PX4_MEMORY)
    estimated, controller_state = motions[0], controller_states[0]
    east, north = math.sin(turn), math.cos(turn)
    waypoints[0].north = -_LEG_LENGTH_M
    waypoints[2].east, waypoints[2].north = _LEG_LENGTH_M * east, _LEG_LENGTH_M * north
    controller_state.from_north, controller_state.min_distance_to_end = -_LEG_LENGTH_M, math.inf
    step_length = ground_speed * _TIME_STEP_S
    estimated.north = -acceptance_radius_at(ground_speed, parameters) - _RUN_IN_M
    lag = ROLL_LAG_RATIO * parameters.roll_time_constant
    decay = math.exp(-_TIME_STEP_S / lag)
    course = 0.0
    lateral_acceleration = 0.0
    time = 0.0
    excursion = 0.0
    settled_distance = 0.0
    distance_along = -1.0
    while distance_along < _MAX_DISTANCE_FRACTION * _LEG_LENGTH_M and time < _TIMEOUT_S:
        estimated.velocity_east, estimated.velocity_north = (
            ground_speed * math.sin(course),
            ground_speed * math.cos(course),
        )
        navigate(estimated, waypoints, 0.0, 0.0, airspeed, parameters, controller_state, _TIME_STEP_S)
        acceleration_demand = GRAVITY * math.tan(roll_setpoint(controller_state.lateral_acceleration, parameters))
        # The exact solution of the lag, and the displacement on the mean course.
        course_change = (
            acceleration_demand * _TIME_STEP_S + (lateral_acceleration - acceleration_demand) * lag * (1.0 - decay)
        ) / ground_speed
        lateral_acceleration = acceleration_demand + (lateral_acceleration - acceleration_demand) * decay
        estimated.east += step_length * math.sin(course + 0.5 * course_change)
        estimated.north += step_length * math.cos(course + 0.5 * course_change)
        course += course_change
        time += _TIME_STEP_S
        distance_along = estimated.east * east + estimated.north * north
        corner_distance = math.hypot(estimated.east, estimated.north)
        first_leg_distance = abs(estimated.east) if estimated.north < 0.0 else corner_distance
        second_leg_distance = (
            abs(estimated.east * north - estimated.north * east) if distance_along > 0.0 else corner_distance
        )
        excursion = max(excursion, min(first_leg_distance, second_leg_distance))
        if controller_state.leg == 1 and second_leg_distance > _SETTLED_CROSS_TRACK_M:
            settled_distance = max(0.0, distance_along)
        if controller_state.leg == 1 and distance_along > settled_distance + _SETTLED_TIME_S * ground_speed:
            break
    # Compiled code frees an array after its last use, and a record that views it does not keep it alive.
    if motions.size + controller_states.size != 2:
        return math.nan, math.nan
    return excursion, settled_distance
