"""Implement the steps of a simulated RTL that all autopilots share.

These are its start, its clearances and its loiter.
"""

import math

import numpy as np

from flight.autopilots.point_mass import angle_of_attack, excess_power, wind_at
from flight.autopilots.simulated_returns import (
    MAX_IMPACT_DEPTH_M,
    RETURN_GROUND_IMPACT,
    RETURN_OFF_TERRAIN,
    RETURN_RESULT,
    RETURN_TIMEOUT,
)
from flight.mission.itinerary import ENDLESS_LOITER_TIME_S
from flight.simulation.tick import RTL_ARRIVAL_ALTITUDE_TOLERANCE_M, RTL_ARRIVAL_RADIUS_M
from world.arrays import Floats, Heights
from world.frames import PolyMapRecord
from world.geometry import wrap
from world.kernels import Record, Records, inner, record_dtype
from world.terrain import ground_height

# Lag of the flight path behind the pitch, s: the time in which lift turns the velocity of a small aircraft.
PATH_LAG_S = 0.4
# Progress around the RTL loiter since the aircraft captured it at the target altitude.
LOITER_PROGRESS = record_dtype(
    "seconds",  # s since the capture
    "turned",  # rad flown around the center since then, positive to the right
    "bearing",  # rad, bearing from the center, at the last tick
)


def make_return_arrays(timeouts: list[float], *, store_positions: bool) -> tuple[Records, Floats]:
    """Make the array for the results of n RTLs, and the array for the positions of one RTL.

    timeouts: timeout of each RTL, s, (n,).
    store_positions: False for an array of positions without rows.
    Returns zeros: (n,) of `RETURN_RESULT`, and (t, 3), m.
    """
    position_count = int(max(timeouts, default=0.0)) + 2 if store_positions else 0
    return np.zeros(len(timeouts), RETURN_RESULT), np.zeros((position_count, 3))


@inner
def initialise_outcome(start: Record, estimated: Record, has_terrain: bool, result: Record) -> None:  # pragma: no cover
    """Move ``estimated`` to the start of an RTL, and reset clearances, arrival and energy in ``result``.

    start: position and velocity of the start, a `RETURN_START` record.
    estimated: position and velocity over the ground, a `MOTION` record to fill.
    has_terrain: True if the terrain is known; otherwise the clearances stay NaN.
    result: `RETURN_RESULT` record to fill.
    """
    estimated.east, estimated.north, estimated.up = start.east, start.north, start.up
    estimated.velocity_east, estimated.velocity_north = start.velocity_east, start.velocity_north
    estimated.velocity_up = start.velocity_up
    result.clearance = result.clearance_before_arrival = math.inf if has_terrain else math.nan
    result.threat = -1
    result.sphere_distance, result.distance_before_arrival = math.inf, math.inf
    result.arrival_time = math.nan
    result.arrival_altitude = math.nan
    result.energy = 0.0
    result.outcome = RETURN_TIMEOUT
    result.position_count = 0


@inner
def initialise_state(start: Record, aircraft: Record, field: Floats, state: Record) -> None:
    """Set the point mass's time, wind, airspeed and attitude from the ground velocity at the start.

    start: position, velocity, bank and time of the start, a `RETURN_START` record.
    aircraft: a record of `POINT_MASS`.
    field: packed wind field of a `PointMass`; empty for none.
    state: `STATE` record to fill.
    """
    state.time = start.time
    state.wind_east, state.wind_north = wind_at(start, start.time, aircraft, field)
    air_east, air_north = start.velocity_east - state.wind_east, start.velocity_north - state.wind_north
    climb_rate = start.velocity_up
    state.airspeed = max(1.0, math.hypot(math.hypot(air_east, air_north), climb_rate))
    state.yaw, state.roll = math.atan2(air_east, air_north), start.roll
    state.alpha = angle_of_attack(state, aircraft)
    state.pitch = math.asin(min(1.0, max(-1.0, climb_rate / state.airspeed))) + state.alpha


@inner
def steady_throttle(start: Record, state: Record, aircraft: Record, excess_table: Floats) -> float:
    """Return the throttle (0..1) that holds the climb rate of an RTL's start, in steps of 0.01.

    start: position and velocity of the start, a `RETURN_START` record.
    state: `STATE` record with the airspeed.
    aircraft: a record of `POINT_MASS`.
    excess_table: specific excess power, m/s, `PointMass.excess`.
    """
    throttle = 1.0
    while (
        throttle > 0.0 and excess_power(excess_table, throttle, state.airspeed, start.up, aircraft) > start.velocity_up
    ):
        throttle -= 0.01
    return throttle


@inner
def store_position(estimated: Record, positions: Floats, result: Record) -> None:
    """Append the present position to the stored positions, unless the array is full.

    estimated: position and velocity over the ground, a `MOTION` record.
    result: `RETURN_RESULT` record, which is updated.
    """
    row = result.position_count
    if row < positions.shape[0]:
        positions[row, 0], positions[row, 1], positions[row, 2] = estimated.east, estimated.north, estimated.up
        result.position_count += 1


@inner
def advance_loiter(estimated: Record, target: Record, loiter: Record, arrival_radius: float, dt: float) -> bool:
    """Update the progress around the last loiter of an RTL; return True once the loiter is complete.

    The loiter begins once the aircraft is near the center and near the target altitude. It is complete after one lap
    and `flight.mission.itinerary.ENDLESS_LOITER_TIME_S`.

    target: waypoint of the loiter, a `WAYPOINT` record.
    loiter: progress around the loiter, a record of `LOITER_PROGRESS`.
    arrival_radius: distance from the center, m, within which the aircraft has arrived at the loiter.
    dt: s since the last call.
    estimated: position and velocity over the ground, a `MOTION` record.
    """
    offset_e, offset_n = estimated.east - target.centre_east, estimated.north - target.centre_north
    bearing = math.atan2(offset_e, offset_n)
    if loiter.seconds > 0.0:
        loiter.turned += wrap(bearing - loiter.bearing)
    loiter.bearing = bearing
    if loiter.seconds > 0.0 or (
        math.hypot(offset_e, offset_n) < max(RTL_ARRIVAL_RADIUS_M, arrival_radius)
        and abs(estimated.up - target.up) < RTL_ARRIVAL_ALTITUDE_TOLERANCE_M
    ):
        loiter.seconds += dt
    return loiter.seconds > ENDLESS_LOITER_TIME_S and abs(loiter.turned) >= 2.0 * math.pi


@inner
def update_clearances(
    estimated: Record,
    time: float,
    heights: Heights,
    to_pixel: PolyMapRecord,
    spheres: Floats,
    radii: Floats,
    has_terrain: bool,
    result: Record,
) -> None:
    """Update the duration, the minimum height above ground and the minimum distance from kill spheres.

    The minima before the arrival are stored separately, and so are time and place of the minimum height. Distances are
    measured from the surface of a sphere. The RTL ends where there are no elevation data, or once the aircraft is
    `MAX_IMPACT_DEPTH_M` below the ground.

    time: time since the start, s.
    heights, to_pixel: ground heights, m, and the map from east and north to column and row.
    spheres, radii: centers (m, 3) and radii (m,) of the kill spheres, m; a radius of 0 stands for none.
    has_terrain: True if the terrain is known.
    estimated: position and velocity over the ground, a `MOTION` record.
    result: `RETURN_RESULT` record, which is updated.
    """
    result.end_time = time
    for m in range(spheres.shape[0]):
        radius = radii[m]
        if radius <= 0.0:
            continue
        offset_e = estimated.east - spheres[m, 0]
        offset_n = estimated.north - spheres[m, 1]
        offset_up = estimated.up - spheres[m, 2]
        sphere_distance = math.sqrt(offset_e * offset_e + offset_n * offset_n + offset_up * offset_up) - radius
        if sphere_distance < result.sphere_distance:
            result.sphere_distance, result.threat, result.threat_time = sphere_distance, m, time
        if math.isnan(result.arrival_time):
            result.distance_before_arrival = min(result.distance_before_arrival, sphere_distance)
    if not has_terrain:
        return
    clearance = estimated.up - ground_height(heights, to_pixel, estimated.east, estimated.north)
    if math.isnan(clearance):
        result.outcome = RETURN_OFF_TERRAIN
        return
    if clearance < result.clearance:
        if result.clearance > 0.0:
            if math.isnan(result.arrival_time):
                result.clearance_before_arrival = clearance
            result.clearance_time = time
            result.clearance_east = estimated.east
            result.clearance_north = estimated.north
            result.clearance_up = estimated.up
        result.clearance = clearance
    if clearance <= -MAX_IMPACT_DEPTH_M:
        result.outcome, result.end_time = RETURN_GROUND_IMPACT, result.clearance_time
