"""Compute ArduPlane's deviation from the legs of a plan.

Corners are simulated in the horizontal plane with ArduPlane's own guidance.

Each corner is flown in still air, at a constant ground speed, by `flight.autopilots.arduplane.law` and the lag of its
bank, to find the acceptance radius with the least deviation. For wind, the excursion in still air at the highest
ground speed on the leg is taken, increased by `WIND_SPREAD`.
"""

import math
from functools import lru_cache

import numpy as np

from aircraft.envelope import GRAVITY
from aircraft.tracking import SPEED_RATIOS, TURNS, TrackingError
from flight.autopilots.arduplane.law import (
    ARDUPILOT_MEMORY,
    NAVIGATION_TICK_S,
    ROLL_LAG_RATIO,
)
from flight.autopilots.arduplane.navigator import MAX_ACCEPTANCE_M, navigate_legs
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane.tecs import (
    limited_nav_roll,
)
from flight.guidance.lateral_reference_laws import strided_waypoints
from flight.guidance.navigation_error import ERRORS, MOTION
from world.arrays import Floats
from world.kernels import Record, Records, compiled, field_names, inner, record_dtype
from world.scenario_tables import Navigation
from world.wind import Turbulence

# A corner is complete once the aircraft stays this close to the next leg, m ...
_SETTLED_CROSS_TRACK_M = 2.0
# ... for this time, s.
_SETTLED_TIME_S = 8.0
# Length of the legs on both sides of a corner, m; the flights end there at the latest.
_LEG_LENGTH_M = 4000.0
# Fraction of the second leg after which a simulation ends at the latest.
_MAX_DISTANCE_FRACTION = 0.75
# Time after which a simulation ends at the latest, s.
_TIMEOUT_S = 120.0
# Distance before the earliest turn at which the flights begin, m.
_RUN_IN_M = 200.0
# Number of acceptance radii that are tried in one round.
_ACCEPTANCES_PER_ROUND = 9
# Number of rounds; each round after the first searches around the best radius of the previous round.
_SEARCH_ROUNDS = 2
# Minimum acceptance radius, m, also for a straight leg: navigation errors and gusts stay within it.
MIN_ACCEPTANCE_M = 15.0
# Margin for wind: factor on the excursion in still air at the highest ground speed, and addition to that factor for a
# turn of 90 degrees. In 200 corners of 15 to 90 degrees at 25 m/s, with 5 and 10 m/s of wind from any direction, the
# factor was at most 1.17 up to 45 degrees, 1.22 at 60 degrees and 1.54 at 90 degrees.
WIND_SPREAD = 1.1, 0.5
# Margin for navigation errors, in standard deviations.
_NAVIGATION_SIGMAS = 3.0
# ArduPlane's cross-track deviation on straight legs in light turbulence, without navigation errors, m.
_CROSS_TRACK_M = 2.0
# ArduPlane's deviation from its lagged altitude in light turbulence, without navigation errors, m.
_ALTITUDE_ERROR_M = 3.0
# Fraction of TECS_CLMB_MAX that a plan uses, by turbulence. In a climb at full throttle the altitude demand is frozen
# and its rate fades to 0: with larger fractions the Aerosonde was 8 to 60 m below its lagged altitude after a climb of
# 200 m; with these fractions the error hardly exceeds the error of a climb at 2 m/s in the same gusts (four streams).
_CLIMB_FRACTIONS = {"none": 0.9, "light": 0.65, "moderate": 0.45}
# The same fraction of TECS_SINK_MAX.
_SINK_FRACTIONS = {"none": 0.9, "light": 0.81, "moderate": 0.72}
# Fraction of the aircraft's own climb rate that a plan uses if thin air reduces that rate below TECS_CLMB_MAX: with 0.9
# in light turbulence a downdraft of 40 s took an Aerosonde at 2,900 m 2 m below its clearance; with 0.8 at least 13 m
# remained in seven streams.
_OWN_CLIMB_FRACTIONS = {"none": 1.0, "light": 0.8, "moderate": 0.7}


def tracking_error(
    parameters: ArduPilotParameters,
    airspeed: float,
    nav: Navigation,
    *,
    fly_over: bool = False,
    turbulence: Turbulence = "none",
) -> TrackingError:
    """Return ArduPlane's deviations from the legs of a plan, which the plan must allow for.

    airspeed: equivalent airspeed, m/s.
    nav: accuracy of navigation.
    fly_over: True if ArduPlane flies on to each waypoint before it turns.
    turbulence: turbulence of the wind; in gusts less throttle remains for a climb.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> parameters = ArduPilotParameters.defaults().changed(AIRSPEED_MIN=18.0, AIRSPEED_MAX=31.0)
    >>> error = tracking_error(parameters, 25.0, "gnss")
    >>> error.lag, error.step, 40.0 < error.corner_acceptance(math.radians(30.0), 25.0) < 60.0
    (3.0, 15.0, True)
    """
    acceptance, excursion, before, after = _corner_tables(parameters, airspeed, fly_over)
    navigation_error = _NAVIGATION_SIGMAS * ERRORS[nav][0]
    return TrackingError(
        airspeed=airspeed,
        acceptance=acceptance,
        excursion=excursion,
        before=before,
        after=after,
        across=math.hypot(_CROSS_TRACK_M, navigation_error),
        up=math.hypot(_ALTITUDE_ERROR_M, navigation_error),
        lag=parameters.tecs_height_demand_time,
        step=parameters.altitude_slope_min,
        climb_rate=_CLIMB_FRACTIONS[turbulence] * parameters.tecs_climb_max,
        sink_rate=_SINK_FRACTIONS[turbulence] * parameters.tecs_sink_max,
        own_climb_share=_OWN_CLIMB_FRACTIONS[turbulence],
    )


# Tracking of a corner, m: acceptance radius, greatest distance from the legs, affected length of each leg.
CORNER_TRACKING = record_dtype("acceptance", "excursion", "before", "after")


@lru_cache(maxsize=8)
def _corner_tables(
    parameters: ArduPilotParameters, airspeed: float, fly_over: bool
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return four tables on corners, m: acceptance radius, excursion, affected length before and after.

    Each table has one row per turn of `TURNS` and one column per speed of `SPEED_RATIOS`. The excursion is the greatest
    distance from the legs, including the margin for wind. The affected lengths are parts of the legs before and after
    the corner.
    """
    corners = np.zeros((TURNS.size, SPEED_RATIOS.size), CORNER_TRACKING)
    record, speeds = parameters.record(), SPEED_RATIOS * airspeed
    _measure_corners(record, airspeed, TURNS, speeds, fly_over, corners, strided_waypoints(3))
    factor, right_angle_margin = WIND_SPREAD
    corners["excursion"] *= (factor + right_angle_margin * (TURNS / (0.5 * math.pi)) ** 2)[:, None]
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
    fly_over: bool,
    corners: Records,
    waypoints: Records,
) -> None:
    """Fill the `CORNER_TRACKING` record of each corner, by turn angle (rows) and ground speed (columns).

    For each corner, search for the acceptance radius with the smallest excursion: simulate the corner with evenly
    spaced radii, then with closer ones around the best radius. With ``fly_over`` the radius has no effect, and one
    corner is simulated. A turn of 0 gets the smallest radius without a simulation.

    airspeed: equivalent airspeed, m/s.
    turn_angles: rad.
    ground_speeds: m/s.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    corners: `CORNER_TRACKING` records (turns, speeds) to fill.
    waypoints: scratch, three `WAYPOINT` records.
    """
    for i in range(turn_angles.size):
        for j in range(ground_speeds.size):
            corner = corners[i, j]
            if turn_angles[i] == 0.0:
                corner.acceptance = MIN_ACCEPTANCE_M
                continue
            min_acceptance, max_acceptance = MIN_ACCEPTANCE_M, MAX_ACCEPTANCE_M
            best_acceptance, min_excursion = min_acceptance, math.inf
            for _ in range(1 if fly_over else _SEARCH_ROUNDS):
                step = (max_acceptance - min_acceptance) / (_ACCEPTANCES_PER_ROUND - 1)
                for k in range(1 if fly_over else _ACCEPTANCES_PER_ROUND):
                    acceptance = math.floor(min_acceptance + k * step)
                    corner_flight = _fly_corner(
                        parameters, airspeed, turn_angles[i], ground_speeds[j], acceptance, fly_over, waypoints
                    )
                    if corner_flight[0] < min_excursion:
                        best_acceptance, min_excursion = acceptance, corner_flight[0]
                        corner.excursion, corner.after = corner_flight
                min_acceptance = max(MIN_ACCEPTANCE_M, best_acceptance - step)
                max_acceptance = min(MAX_ACCEPTANCE_M, best_acceptance + step)
            corner.acceptance = best_acceptance
            corner.before = 0.0 if fly_over else best_acceptance


@inner
def _fly_corner(
    parameters: Record,
    airspeed: float,
    turn_angle: float,
    ground_speed: float,
    acceptance: float,
    fly_over: bool,
    waypoints: Records,
) -> tuple[float, float]:
    """Simulate one corner; return the excursion and the settling distance, m.

    The excursion is the maximum distance from the nearer leg. The settling distance is measured along the second leg;
    beyond it the aircraft stays within `_SETTLED_CROSS_TRACK_M` of the leg. The first leg leads north to the origin.
    airspeed, ground_speed: equivalent airspeed and ground speed, m/s. turn_angle: rad, to the right.
    acceptance: acceptance radius, m. waypoints: scratch, three `WAYPOINT` records, whose positions are overwritten.
    """
    motions, memories = np.zeros(1, MOTION), np.zeros(1, ARDUPILOT_MEMORY)
    estimated, memory = motions[0], memories[0]
    east, north = math.sin(turn_angle), math.cos(turn_angle)
    waypoints[0].north = -_LEG_LENGTH_M
    waypoints[1].turn, waypoints[1].acceptance, waypoints[1].fly_over = turn_angle, acceptance, fly_over
    waypoints[2].east, waypoints[2].north = _LEG_LENGTH_M * east, _LEG_LENGTH_M * north
    memory.from_north = -_LEG_LENGTH_M
    # The aircraft crosses the acceptance radius halfway between two updates, which is the average case.
    tick_length = ground_speed * NAVIGATION_TICK_S
    estimated.north = -acceptance - (math.floor(_RUN_IN_M / tick_length) + 0.5) * tick_length
    lag = ROLL_LAG_RATIO * parameters.roll_time
    decay = math.exp(-NAVIGATION_TICK_S / lag)
    course, lateral_acceleration, time, excursion, settled_distance, distance_along = 0.0, 0.0, 0.0, 0.0, 0.0, -1.0
    while distance_along < _MAX_DISTANCE_FRACTION * _LEG_LENGTH_M and time < _TIMEOUT_S:
        estimated.velocity_east = ground_speed * math.sin(course)
        estimated.velocity_north = ground_speed * math.cos(course)
        navigate_legs(estimated, waypoints, parameters, memory, 1.0, NAVIGATION_TICK_S)
        acceleration_demand = GRAVITY * math.tan(
            limited_nav_roll(memory.lateral_acceleration, 0.0, airspeed, parameters)
        )
        # The exact solution of the lag, and the displacement on the mean course.
        course_change = (
            acceleration_demand * NAVIGATION_TICK_S + (lateral_acceleration - acceleration_demand) * lag * (1.0 - decay)
        ) / ground_speed
        lateral_acceleration = acceleration_demand + (lateral_acceleration - acceleration_demand) * decay
        estimated.east += tick_length * math.sin(course + 0.5 * course_change)
        estimated.north += tick_length * math.cos(course + 0.5 * course_change)
        course += course_change
        time += NAVIGATION_TICK_S
        distance_along = estimated.east * east + estimated.north * north
        corner_distance = math.hypot(estimated.east, estimated.north)
        first_leg_distance = abs(estimated.east) if estimated.north < 0.0 else corner_distance
        second_leg_distance = (
            abs(estimated.east * north - estimated.north * east) if distance_along > 0.0 else corner_distance
        )
        excursion = max(excursion, min(first_leg_distance, second_leg_distance))
        if memory.leg == 1 and second_leg_distance > _SETTLED_CROSS_TRACK_M:
            settled_distance = max(0.0, distance_along)
        if memory.leg == 1 and distance_along > settled_distance + _SETTLED_TIME_S * ground_speed:
            break
    # Compiled code frees an array after its last use, and a record that views it does not keep it alive.
    if motions.size + memories.size != 2:
        return math.nan, math.nan
    return excursion, settled_distance
