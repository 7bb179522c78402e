"""Simulate PX4's RTL with a point mass in some milliseconds.

The control law is the compiled code of the simulated PX4: its navigator, NPFG and TECS. It controls a
`flight.autopilots.point_mass.PointMass`, whose bank and pitch follow their setpoints with the lags of PX4's
controllers.

An RTL goes to a loiter over home or a rally point (PX4's `src/modules/navigator/rtl_direct.cpp`), or to the landing
sequence of the mission (`rtl_direct_mission_land.cpp`). On the way to the sequence the aircraft climbs first as in any
RTL; then it flies the items of the sequence, loiters to an altitude as loiters and all others as plain waypoints. Such
an RTL is simulated up to the last item before the landing.
"""

import math
from collections.abc import Sequence

import numpy as np

from aircraft.envelope import GRAVITY
from flight.autopilots.point_mass import PointMass, advance_point_mass, angle_of_attack
from flight.autopilots.px4.law import PITCH_LAG_RATIO, PX4_MEMORY, ROLL_LAG_RATIO, update_roll_setpoint
from flight.autopilots.px4.navigator import climb_before_return, navigate
from flight.autopilots.px4.parameters import Px4Parameters
from flight.autopilots.px4.tecs import update_tecs
from flight.autopilots.return_steps import (
    LOITER_PROGRESS,
    PATH_LAG_S,
    advance_loiter,
    initialise_outcome,
    initialise_state,
    make_return_arrays,
    steady_throttle,
    store_position,
    update_clearances,
)
from flight.autopilots.simulated_returns import (
    LOITER_CAPTURE_RADIUS_M,
    RETURN_ABORTED,
    RETURN_ARRIVED,
    RETURN_GROUND_IMPACT,
    RETURN_TIMEOUT,
    TIMEOUT_BASE_S,
    TIMEOUT_RATIO,
    ReturnEnvironment,
    SimulatedReturns,
)
from flight.dynamics.state import STATE
from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.guidance.lateral_reference_laws import strided_waypoints
from flight.guidance.navigation_error import MOTION
from flight.mission.return_path import ReturnTarget
from flight.simulation.tick import RTL_ARRIVAL_LOITER_RADII
from world.arrays import Floats, Heights
from world.frames import PolyMapRecord
from world.kernels import Record, Records, compiled, inner

# Duration of a tick, s.
_TICK_S = 0.1
# Interval between stored positions, ticks; 1 s.
_STORED_EVERY_TICKS = 10


def fly_returns(
    parameters: Px4Parameters,
    starts: Records,
    targets: Sequence[ReturnTarget],
    aircraft: PointMass,
    environment: ReturnEnvironment,
    *,
    store_positions: bool = False,
    abort_limits: tuple[Floats, Floats] | None = None,
    engine_out: bool = False,
) -> SimulatedReturns:
    """Simulate the RTL from each of n starts to its target, at FW_AIRSPD_TRIM.

    starts: (n,) of `flight.autopilots.simulated_returns.RETURN_START`.
    targets: n targets; an RTL ends in the loiter of its target, or at the leg to the landing.
    aircraft: point mass of the aircraft in the wind.
    environment: terrain and kill spheres from which the clearances are measured.
    store_positions: True to store the flown positions.
    abort_limits: heights above ground, (n,), and distances outside spheres, (n,), m, below which an RTL is aborted.

    >>> from aircraft.catalog import load_aircraft
    >>> from flight.autopilots.point_mass import make_point_mass
    >>> from flight.autopilots.simulated_returns import RETURN_START, make_return_environment
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from world.scenario import load_scenario
    >>> from world.wind import Wind
    >>> scenario, aerosonde = load_scenario("jacksboro"), load_aircraft("aerosonde")
    >>> start = np.zeros(1, RETURN_START)
    >>> start["up"], start["velocity_north"] = 1000.0, 26.0
    >>> result = fly_returns(
    ...     Px4Parameters.load(aerosonde),
    ...     start,
    ...     [ReturnTarget((0.0, 4000.0, 900.0), "home", "", 4000.0, transit_altitude=1000.0)],
    ...     make_point_mass(aerosonde, load_envelope(aerosonde), 25.0, Wind()),
    ...     make_return_environment(scenario),
    ... ).results[0]
    >>> int(result["outcome"]) == RETURN_ARRIVED, bool(140.0 < result["arrival_time"] < 160.0)
    (True, True)
    """
    if engine_out:
        raise ValueError("PX4's RTL without an engine is not simulated")
    routes = [_make_route(start, target, parameters) for start, target in zip(starts, targets, strict=True)]
    timeouts = [
        _rtl_timeout(start, target, parameters, aircraft) for start, target in zip(starts, targets, strict=True)
    ]
    record = parameters.record()
    min_clearances, min_distances = abort_limits or (np.full(len(starts), -math.inf),) * 2
    results, positions = make_return_arrays(timeouts, store_positions=store_positions)
    tracks = []
    for k, timeout in enumerate(timeouts):
        fly_rtl(
            starts[k],
            routes[k],
            targets[k].transit_altitude,
            record,
            *aircraft.tables,
            environment.heights,
            environment.to_pixel,
            environment.spheres,
            environment.radii,
            environment.known,
            timeout,
            float(min_clearances[k]),
            float(min_distances[k]),
            positions,
            results[k],
        )
        if store_positions:
            tracks.append(positions[: int(results[k]["position_count"])].copy())
    return SimulatedReturns(results, tuple(tracks))


def _make_route(start: Record, target: ReturnTarget, parameters: Px4Parameters) -> Records:
    """Return the waypoints of an RTL: its start and its loiter, or its start and a landing sequence.

    A landing sequence consists of its stops and the landing.
    """
    stops = () if target.landing is None else (target.landing, *target.landing.next_stops)
    route = strided_waypoints(2 if target.landing is None else len(stops) + 2)
    route["airspeed"], route["stop"] = parameters["FW_AIRSPD_TRIM"], np.arange(len(route))
    route[0].east, route[0].north, route[0].up = start["east"], start["north"], start["up"]
    last_waypoint = route[-1]
    if target.landing is None:
        last_waypoint.centre_east, last_waypoint.centre_north, last_waypoint.up = (
            last_waypoint.east,
            last_waypoint.north,
            last_waypoint.up,
        ) = target.position
        last_waypoint.loiter_radius, last_waypoint.is_rtl = parameters["RTL_LOITER_RAD"], True
        return route
    for waypoint, stop in zip(route[1:-1], stops, strict=True):
        # A stop is a loiter to an altitude, or a plain waypoint.
        waypoint.east, waypoint.north, waypoint.up = stop.position
        if stop.to_altitude:
            waypoint.centre_east, waypoint.centre_north, _ = stop.position
            waypoint.loiter_radius = stop.radius or parameters["NAV_LOITER_RAD"]
            waypoint.loiters_to_altitude = True
            waypoint.exits_on_course, waypoint.exits_on_tangent = stop.exits_on_course, stop.exits_on_tangent
        # A waypoint of a landing is reached at any altitude (`MissionBase::isLanding`), except the first one.
        waypoint.ignores_altitude = not stop.to_altitude and stop is not target.landing
    route[-2].precedes_landing = True
    last_waypoint.east, last_waypoint.north, last_waypoint.up = target.landing.landing or target.position
    return route


def _rtl_timeout(start: Record, target: ReturnTarget, parameters: Px4Parameters, aircraft: PointMass) -> float:
    """Return the timeout of an RTL, s, from the distances and altitude changes between its waypoints.

    Each leg is flown against the strongest wind, with one lap of the loiter at its end. Its climb or descent follows at
    the setpoint of the climb or sink rate. The sum is multiplied by `TIMEOUT_RATIO`, and `TIMEOUT_BASE_S` is added.

    start: position of the start, a `RETURN_START` record.
    target: target of the RTL, with its landing sequence if it has one.
    aircraft: point mass of the aircraft in the wind.
    """
    min_ground_speed = max(5.0, aircraft.record.airspeed - aircraft.record.max_wind)
    climb_rate = min(parameters["FW_T_CLMB_R_SP"], parameters["FW_T_CLMB_MAX"])
    sink_rate = min(parameters["FW_T_SINK_R_SP"], parameters["FW_T_SINK_MAX"])
    stops = () if target.landing is None else target.landing.next_stops
    east, north, altitude = float(start["east"]), float(start["north"]), target.transit_altitude
    seconds = max(0.0, altitude - float(start["up"])) / climb_rate
    for position in (target.position, *(stop.position for stop in stops)):
        lap_length = 2.0 * math.pi * RTL_ARRIVAL_LOITER_RADII * abs(parameters["RTL_LOITER_RAD"])
        seconds += (math.hypot(position[0] - east, position[1] - north) + lap_length) / min_ground_speed
        seconds += max(0.0, altitude - position[2]) / sink_rate + max(0.0, position[2] - altitude) / climb_rate
        east, north, altitude = position
    return float(TIMEOUT_BASE_S + TIMEOUT_RATIO * seconds)


@compiled
def fly_rtl(
    start: Record,
    waypoints: Records,
    transit_altitude: float,
    parameters: Record,
    aircraft: Record,
    excesses: Floats,
    power: Floats,
    field: Floats,
    heights: Heights,
    to_pixel: PolyMapRecord,
    spheres: Floats,
    radii: Floats,
    has_terrain: bool,
    timeout: float,
    min_clearance: float,
    min_distance: float,
    positions: Floats,
    result: Record,
) -> None:
    """Simulate an RTL for up to ``timeout`` s, and fill the `RETURN_RESULT` ``result``.

    start, waypoints: `RETURN_START` record; `WAYPOINT` records of the start, then the loiter or the landing sequence.
    transit_altitude: altitude to which an RTL to a landing sequence climbs first, m AMSL.
    min_clearance, min_distance: height above ground and distance outside spheres, m, below which the RTL is aborted.
    positions: array (t, 3), m, to fill with one position per second until it is full.
    aircraft, excesses, power, field: record and tables of a `flight.autopilots.point_mass.PointMass`.
    heights, to_pixel, spheres, radii, has_terrain: a `flight.autopilots.simulated_returns.ReturnEnvironment`.
    """
    motions, states, memories = np.zeros(1, MOTION), np.zeros(1, STATE), np.zeros(1, PX4_MEMORY)
    progress_records = np.zeros(1, LOITER_PROGRESS)
    estimated, state, memory, loiter = motions[0], states[0], memories[0], progress_records[0]
    target = waypoints[waypoints.shape[0] - 1]
    initialise_outcome(start, estimated, has_terrain, result)
    _initialise_memory(start, waypoints, parameters, aircraft, excesses, field, state, memory)
    pitch, path_angle, dt, energy = state.pitch, state.pitch - state.alpha, _TICK_S, 0.0
    lands, has_begun = not target.is_rtl, False
    for tick in range(int(timeout / dt)):
        time = tick * dt
        if tick % _STORED_EVERY_TICKS == 0:
            store_position(estimated, positions, result)
        radius = RTL_ARRIVAL_LOITER_RADII * abs(target.loiter_radius) * eas_to_tas_ratio(estimated.up) ** 2
        # An RTL to a loiter arrives over its destination; an RTL to a landing when it begins the leg to the landing.
        if lands:
            has_arrived = has_begun and memory.leg + 2 >= waypoints.shape[0]
        else:
            distance = math.hypot(estimated.east - target.centre_east, estimated.north - target.centre_north)
            has_arrived = memory.rtl_climb_complete and distance < max(LOITER_CAPTURE_RADIUS_M, radius)
        if has_arrived and math.isnan(result.arrival_time):
            result.arrival_time, result.arrival_altitude = time, estimated.up
        update_clearances(estimated, time, heights, to_pixel, spheres, radii, has_terrain, result)
        if result.outcome == RETURN_TIMEOUT:
            if result.clearance < min_clearance or result.sphere_distance < min_distance:
                result.outcome = RETURN_ABORTED
            elif has_arrived if lands else advance_loiter(estimated, target, loiter, radius, dt):
                result.outcome = RETURN_ARRIVED
        if result.outcome != RETURN_TIMEOUT:
            break
        state.pitch = pitch
        has_begun = _update_setpoints(
            state, estimated, waypoints, transit_altitude, parameters, memory, lands, has_begun, dt
        )
        pitch, path_angle = _follow_setpoints(state, parameters, memory, aircraft, pitch, path_angle, dt)
        throttle = memory.throttle_setpoint
        energy += dt * advance_point_mass(estimated, state, path_angle, throttle, aircraft, excesses, power, field, dt)
    if result.clearance <= 0.0:
        result.outcome = RETURN_GROUND_IMPACT
    # Compiled code frees an array after its last use, and a record that views it does not keep it alive.
    are_arrays_alive = motions.size + states.size + memories.size + progress_records.size == 4
    result.energy = energy / 3600.0 if aircraft.has_power and are_arrays_alive else math.nan


@inner
def _update_setpoints(
    state: Record,
    estimated: Record,
    waypoints: Records,
    transit_altitude: float,
    parameters: Record,
    memory: Record,
    lands: bool,
    has_begun_sequence: bool,
    dt: float,
) -> bool:
    """Set the setpoints of bank, pitch and throttle for one tick.

    Return True once an RTL to a landing flies the landing sequence instead of the climb before it.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground, a `MOTION` record.
    waypoints: `WAYPOINT` records (w,): the start, then the loiter or the landing sequence.
    transit_altitude: altitude to which an RTL to a landing sequence climbs first, m AMSL.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: `PX4_MEMORY` record, which receives the setpoints.
    lands: True for an RTL to a landing sequence.
    has_begun_sequence: True once the aircraft flies this sequence.
    dt: duration of a tick, s.
    """
    wind_east, wind_north = state.wind_east, state.wind_north
    eas_to_tas = eas_to_tas_ratio(estimated.up)
    # Guidance gets the true airspeed; from 1.17 on it gets the equivalent airspeed, which it treats as true airspeed.
    airspeed_scale = eas_to_tas if parameters.uses_switch_distance else 1.0
    airspeed = min(parameters.airspeed_max, max(parameters.airspeed_min, waypoints[memory.leg].airspeed))
    is_climbing = (
        lands
        and not has_begun_sequence
        and climb_before_return(
            estimated, transit_altitude, wind_east, wind_north, airspeed * airspeed_scale, parameters, memory
        )
    )
    if lands and not is_climbing and not has_begun_sequence:
        # Begin the leg to the first stop. After a climb it begins at the center of the loiter in which the aircraft
        # climbed. Without a climb PX4 has no previous setpoint, and the leg begins at the altitude of its end.
        start, first_stop = waypoints[0], waypoints[1]
        has_climbed = start.up < transit_altitude - parameters.altitude_acceptance_radius
        memory.from_east, memory.from_north = start.east, start.north
        memory.from_up = transit_altitude if has_climbed else first_stop.up
        memory.leg, memory.leg_start_altitude, memory.min_distance_to_end = 0, estimated.up, math.inf
        memory.is_loitering, memory.rim_reached, memory.time_since_reached = False, False, 0.0
    if not is_climbing:
        navigate(estimated, waypoints, wind_east, wind_north, airspeed * airspeed_scale, parameters, memory, dt)
    update_roll_setpoint(parameters, memory, dt)
    airspeed_setpoint = max(airspeed, memory.min_airspeed / airspeed_scale)
    update_tecs(state, estimated, parameters, memory, airspeed_setpoint, eas_to_tas, dt)
    return lands and not is_climbing


@inner
def _follow_setpoints(
    state: Record, parameters: Record, memory: Record, aircraft: Record, pitch: float, path_angle: float, dt: float
) -> tuple[float, float]:
    """Let the bank follow its setpoint; return the pitch and path angle after a tick, rad.

    Bank, pitch and path angle follow as first-order lags: the bank its setpoint, within PX4's roll rate; the pitch its
    setpoint; and the path angle the pitch minus the angle of attack.

    state: `STATE` record; its roll is updated.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    memory: `PX4_MEMORY` record with the setpoints.
    aircraft: a `POINT_MASS` record.
    pitch, path_angle: values before the tick, rad.
    dt: duration of a tick, s.
    """
    roll_change = (1.0 - math.exp(-dt / (ROLL_LAG_RATIO * parameters.roll_time_constant))) * (
        memory.roll_setpoint - state.roll
    )
    if parameters.roll_rate_max > 0.0:
        roll_change = min(parameters.roll_rate_max * dt, max(-parameters.roll_rate_max * dt, roll_change))
    state.roll += roll_change
    pitch_fraction = 1.0 - math.exp(-dt / (PITCH_LAG_RATIO * parameters.pitch_time_constant))
    pitch += pitch_fraction * (memory.pitch_setpoint + parameters.pitch_trim - pitch)
    path_fraction = 1.0 - math.exp(-dt / PATH_LAG_S)
    path_angle += path_fraction * (pitch - angle_of_attack(state, aircraft) - path_angle)
    return pitch, path_angle


@inner
def _initialise_memory(
    start: Record,
    waypoints: Records,
    parameters: Record,
    aircraft: Record,
    excesses: Floats,
    field: Floats,
    state: Record,
    memory: Record,
) -> None:
    """Set the state of the point mass, and the law's internal state as after a long steady flight.

    The steady flight may be a climb, in which the altitude reference is ahead of the aircraft by the lag of TECS.

    start: position, velocity, bank and time of the start, a `RETURN_START` record.
    waypoints: `WAYPOINT` records (w,) of the RTL, of which the first is the start.
    parameters: PX4's parameters, a `PX4_PARAMETERS` record.
    aircraft, excesses, field: record, excess power and wind field of a `PointMass`.
    state: `STATE` record to fill.
    memory: `PX4_MEMORY` record to fill.
    """
    initialise_state(start, aircraft, field, state)
    climb_rate, eas_to_tas = start.velocity_up, eas_to_tas_ratio(start.up)
    memory.is_initialised = True
    memory.from_east, memory.from_north, memory.from_up = waypoints[0].east, waypoints[0].north, waypoints[0].up
    memory.min_distance_to_end = math.inf
    memory.leg_start_altitude = memory.altitude_setpoint = start.up
    lag = parameters.altitude_time_constant * (1.0 - parameters.altitude_rate_feedforward)
    memory.altitude_reference, memory.altitude_rate_reference = start.up + lag * climb_rate, climb_rate
    memory.tas = memory.tas_setpoint = state.airspeed
    memory.roll_setpoint = start.roll
    memory.pitch_setpoint = state.pitch - parameters.pitch_trim
    memory.pitch_integrator = memory.pitch_setpoint - parameters.seb_rate_feedforward * climb_rate / state.airspeed
    memory.ste_rate = GRAVITY * climb_rate
    memory.throttle_setpoint = steady_throttle(start, state, aircraft, excesses)
    throttle_trim = min(parameters.throttle_max, max(parameters.throttle_min, parameters.throttle_trim * eas_to_tas))
    if climb_rate >= 0.0:
        throttle = throttle_trim + climb_rate * (parameters.throttle_max - throttle_trim) / parameters.max_climb_rate
    else:
        min_sink_rate = parameters.min_sink_rate * eas_to_tas
        throttle = throttle_trim + climb_rate * (throttle_trim - parameters.throttle_min) / min_sink_rate
    memory.throttle_integrator = memory.throttle_setpoint - throttle
