"""Simulate an RTL with a point mass in about 2 ms, at least 100 times faster than JSBSim.

The control law is the compiled code of `flight.autopilots.arduplane.law`: L1 to the target, the slope or the climb, and
TECS with its limits. It controls a `flight.autopilots.point_mass.PointMass`, whose bank and pitch follow
their demands with the lags of ArduPlane's controllers. The minimum clearance is within 7 m of the minimum clearances
of 38 flights of ArduPlane (`tests/flight/autopilots/arduplane/test_rtl_point_mass.py`).

After an engine failure the control law does not know that there is no thrust: it demands full throttle and slows down
to underspeed (`flight.autopilots.arduplane.tecs.detect_underspeed`). From then on it holds the minimum airspeed, and
dives onto its slope where it meets the slope. Fourteen such flights of ArduPlane are reproduced as well
(`tests/flight/autopilots/arduplane/test_engine_out.py`).
"""

import math
from collections.abc import Sequence

import numpy as np

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.law import (
    ARDUPILOT_MEMORY,
    INITIAL_SKE_INTEGRATOR,
    NAVIGATION_TICK_S,
    PITCH_LAG_RATIO,
    ROLL_LAG_RATIO,
    update_height_demand,
)
from flight.autopilots.arduplane.navigator import LANDING_JOIN_ALTITUDE_TOLERANCE_M, is_past_finish_line, navigate_legs
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane.tecs import (
    airspeed_target,
    limited_nav_roll,
    update_tecs,
    wind_up_ste_integrator,
)
from flight.autopilots.point_mass import PointMass, advance_point_mass, angle_of_attack, excess_power
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
    ENGINE_FAILURE_REACTION_S,
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
from flight.guidance.lateral_reference_laws import WAYPOINT
from flight.guidance.navigation_error import MOTION
from flight.mission.return_path import LandingStart, ReturnTarget
from flight.simulation.tick import RTL_ARRIVAL_LOITER_RADII
from world.arrays import Floats, Heights
from world.frames import PolyMapRecord
from world.geometry import wrap
from world.kernels import Record, Records, compiled, inner, record_dtype

# Climb at the start of a flight, as in a go-around.
CLIMB = record_dtype(
    ("is_required", np.bool_),
    "top",  # m AMSL, altitude above which the climb ends
    "throttle",  # 0..1, throttle of the climb
    "slew",  # fraction of the throttle range, 1/s
)
NO_CLIMB: Record = np.zeros(1, CLIMB)[0]

# Bank above which an aircraft without thrust is treated as turning, rad.
_TURN_BANK_RAD = math.radians(5.0)
# Lag with which the airspeed settles in such a turn, s.
_TURN_AIRSPEED_LAG_S = 8.0
# Interval between stored positions, ticks; 1 s.
STORED_EVERY_TICKS = 10


def fly_returns(
    parameters: ArduPilotParameters,
    starts: Records,
    targets: Sequence[ReturnTarget],
    aircraft: PointMass,
    environment: ReturnEnvironment,
    *,
    store_positions: bool = False,
    abort_limits: tuple[Floats, Floats] | None = None,
    engine_out: bool = False,
) -> SimulatedReturns:
    """Simulate the RTL from each of n starts to its target.

    starts: (n,) of `flight.autopilots.simulated_returns.RETURN_START`.
    targets: n targets; the RTL continues to the landing sequence of its target up to its end or first loiter.
    aircraft: point mass of the aircraft in the wind.
    environment: terrain and kill spheres from which the clearances are measured.
    store_positions: True to store the positions.
    abort_limits: heights above ground, (n,), and distances outside spheres, (n,), m, below which an RTL is aborted.
    engine_out: True after an engine failure: the aircraft flies on for `ENGINE_FAILURE_REACTION_S`, and the RTL ends at
        its loiter.

    >>> from aircraft.catalog import load_aircraft
    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> from flight.autopilots.point_mass import make_point_mass
    >>> from flight.autopilots.simulated_returns import RETURN_START, make_return_environment
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from world.scenario import load_scenario
    >>> from world.wind import Wind
    >>> scenario, aerosonde = load_scenario("jacksboro"), load_aircraft("aerosonde")
    >>> start = np.zeros(1, RETURN_START)
    >>> start["up"], start["velocity_north"] = 1000.0, 26.0
    >>> result = fly_returns(
    ...     ArduPilotParameters.load(aerosonde).changed(RTL_RADIUS=120.0),
    ...     start,
    ...     [ReturnTarget((0.0, 4000.0, 900.0), "home", "", 4000.0)],
    ...     make_point_mass(aerosonde, load_envelope(aerosonde), 25.0, Wind()),
    ...     make_return_environment(scenario),
    ... ).results[0]
    >>> int(result["outcome"]) == RETURN_ARRIVED, bool(140.0 < result["arrival_time"] < 160.0)
    (True, True)
    """
    stages = [_make_stages(target, parameters, aircraft, engine_out) for target in targets]
    if engine_out:
        stages = [np.concatenate([waypoint_ahead(start), route]) for start, route in zip(starts, stages, strict=True)]
    timeouts = [rtl_timeout(start, route, aircraft) for start, route in zip(starts, stages, strict=True)]
    record = parameters.record()
    min_clearances, min_distances = abort_limits or (np.full(len(starts), -math.inf),) * 2
    results, positions = make_return_arrays(timeouts, store_positions=store_positions)
    tracks = []
    for k, timeout in enumerate(timeouts):
        fly_stages(
            starts[k],
            stages[k],
            record,
            record,
            NO_CLIMB,
            *aircraft.tables,
            environment.heights,
            environment.to_pixel,
            environment.spheres,
            environment.radii,
            environment.known,
            timeout,
            float(min_clearances[k]),
            float(min_distances[k]),
            engine_out,
            positions,
            results[k],
        )
        if store_positions:
            tracks.append(positions[: int(results[k]["position_count"])].copy())
    return SimulatedReturns(results, tuple(tracks))


def _make_stages(
    target: ReturnTarget, parameters: ArduPilotParameters, aircraft: PointMass, engine_out: bool
) -> Records:
    """Return the successive targets of an RTL, as n `WAYPOINT` records.

    `WAYPOINT` is defined in `flight.guidance.lateral_reference_laws`. The first target is the RTL loiter, unless the
    RTL flies straight to a landing sequence. The other targets are the stops of the sequence, up to its first loiter.
    The landing itself is not simulated, so an RTL whose sequence begins with the landing ends at its loiter. After an
    engine failure, an RTL ends at its loiter or at the start of the sequence.
    """
    stops: Sequence[LandingStart] = ()
    if target.landing is not None and engine_out:
        stops = (target.landing,) if target.straight else ()
    elif target.landing is not None and not target.landing.is_landing:
        stops = truncate_at_first_loiter((target.landing, *target.landing.next_stops))
    stages: Records = np.zeros((not target.straight) + len(stops), WAYPOINT)
    stages["airspeed"], stages["min_ground_speed"] = aircraft.record.airspeed, parameters.ground_speed_min
    if not target.straight:
        first_stage = stages[0]
        first_stage.centre_east, first_stage.centre_north, first_stage.up = target.position
        first_stage.loiter_radius, first_stage.slope_base = parameters.return_radius, target.slope_base
        first_stage.east, first_stage.north, first_stage.is_rtl = *target.position[:2], True
    for stage, stop in zip(stages[len(stages) - len(stops) :], stops, strict=True):
        fill_stage(stage, stop, parameters)
        # The first leg of an RTL to a landing sequence follows no line, as after any mode change.
        stage.without_crosstrack = stop is target.landing
    return stages


def truncate_at_first_loiter(stops: Sequence[LandingStart]) -> Sequence[LandingStart]:
    """Return the stops of a landing sequence up to its first loiter.

    The exit from the loiter is not simulated.

    >>> stops = [LandingStart(k, (0.0, 0.0, 50.0), (0.0, 0.0, 50.0), is_loiter=k == 2) for k in (1, 2, 3)]
    >>> [stop.item for stop in truncate_at_first_loiter(stops)]
    [1, 2]
    """
    loiter_indices = [k for k, stop in enumerate(stops) if stop.is_loiter]
    return stops[: loiter_indices[0] + 1] if loiter_indices else stops


def fill_stage(stage: Record, stop: LandingStart, parameters: ArduPilotParameters) -> None:
    """Fill a stage's record from a stop of a landing sequence: a waypoint, or the center of a loiter."""
    stage.east, stage.north, stage.up = stage.centre_east, stage.centre_north, stage.up = stop.position
    stage.pass_by, stage.home_up = stop.pass_by, stop.home_up
    # The turn to the next leg is unknown: use a right angle, as at a mission's end.
    stage.turn = 0.5 * math.pi
    stage.loiter_radius = (stop.radius or parameters.loiter_radius) if stop.is_loiter else 0.0


# Length of a leg on the current course, m, long enough never to be flown to its end.
_STRAIGHT_LEG_LENGTH_M = 10_000.0


def waypoint_ahead(start: Record) -> Records:
    """Return a waypoint far ahead of a start, on its course and slope, as one `WAYPOINT` record, (1,)."""
    waypoint: Records = np.zeros(1, WAYPOINT)
    ground_speed = max(1.0, math.hypot(start["velocity_east"], start["velocity_north"]))
    for axis, velocity in (("east", "velocity_east"), ("north", "velocity_north"), ("up", "velocity_up")):
        waypoint[axis] = start[axis] + _STRAIGHT_LEG_LENGTH_M * start[velocity] / ground_speed
    return waypoint


def rtl_timeout(start: Record, stages: Records, aircraft: PointMass) -> float:
    """Return the timeout of an RTL, s, from the distances and altitude changes between its stages.

    Each leg is flown against the strongest wind, but at 5 m/s or more over the ground, with a lap of the loiter at its
    end. The altitude changes by 2 m/s. The sum is multiplied by `TIMEOUT_RATIO`, and `TIMEOUT_BASE_S` is added.

    start: position of the start, a `RETURN_START` record.
    stages: `WAYPOINT` records of the RTL's stages, (n,).
    aircraft: point mass of the aircraft in the wind.
    """
    min_ground_speed = max(5.0, aircraft.record.airspeed - aircraft.record.max_wind)
    east = start["east"]
    north = start["north"]
    altitude = start["up"]
    seconds = 0.0
    for end in stages:
        distance = math.hypot(end["east"] - east, end["north"] - north)
        lap_length = 2.0 * math.pi * RTL_ARRIVAL_LOITER_RADII * abs(end["loiter_radius"])
        seconds += (distance + lap_length) / min_ground_speed + abs(end["up"] - altitude) / 2.0
        east, north, altitude = end["east"], end["north"], end["up"]
    return float(TIMEOUT_BASE_S + TIMEOUT_RATIO * seconds)


@compiled
def fly_stages(
    start: Record,
    stages: Records,
    parameters: Record,
    climb_parameters: Record,
    climb: Record,
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
    engine_out: bool,
    positions: Floats,
    result: Record,
) -> None:
    """Simulate the flight from stage to stage for up to ``timeout`` s; fill ``positions`` and ``result``.

    start, stages: `RETURN_START` record, and successive targets, loiters or waypoints, as `WAYPOINT` records (n,).
    climb, climb_parameters: the climb at the start and its parameters. engine_out: True if the engine failed there.
    aircraft to field, heights to has_terrain: `PointMass`, `ReturnEnvironment`. positions: (t, 3), m, one row a second.
    min_clearance, min_distance: height above ground and distance outside spheres, m, below which the flight is aborted.
    """
    spaced, progress_records = np.zeros(6, WAYPOINT), np.zeros(1, LOITER_PROGRESS)  # Spaced as in `strided_waypoints`.
    waypoints, loiter = spaced[::2], progress_records[0]
    motions, states, memories = np.zeros(1, MOTION), np.zeros(1, STATE), np.zeros(1, ARDUPILOT_MEMORY)
    target, estimated, state, memory = waypoints[1], motions[0], states[0], memories[0]
    initialise_outcome(start, estimated, has_terrain, result)
    _load_stage(stages, 0, waypoints, estimated, memory)
    _initialise_memory(start, parameters, aircraft, excesses, field, state, memory)
    pitch, path_angle, dt = state.pitch, state.pitch - state.alpha, NAVIGATION_TICK_S
    roll_fraction, pitch_fraction, path_fraction = _lag_fractions(parameters, dt)
    stage, energy, max_roll_change = 0, 0.0, parameters.roll_rate_max * dt
    for tick in range(int(timeout / dt)):
        time = tick * dt
        if tick % STORED_EVERY_TICKS == 0:
            store_position(estimated, positions, result)
        eas2tas, is_last = eas_to_tas_ratio(estimated.up), stage + 1 == stages.shape[0]
        distance = math.hypot(estimated.east - target.centre_east, estimated.north - target.centre_north)
        radius = RTL_ARRIVAL_LOITER_RADII * abs(target.loiter_radius) * eas2tas * eas2tas
        if is_last and distance < max(LOITER_CAPTURE_RADIUS_M, radius) and math.isnan(result.arrival_time):
            result.arrival_time, result.arrival_altitude = time, estimated.up
            # Without an engine the aircraft descends in circles there.
            result.outcome = RETURN_ARRIVED if engine_out else result.outcome
        update_clearances(estimated, time, heights, to_pixel, spheres, radii, has_terrain, result)
        if result.outcome != RETURN_TIMEOUT:
            break
        if result.clearance < min_clearance or result.sphere_distance < min_distance:
            result.outcome = RETURN_ABORTED
            break
        if _is_stage_complete(
            estimated, target, memory, loiter, climb, engine_out and stage == 0, stage == 0, time, is_last, radius, dt
        ):
            if is_last:
                result.outcome = RETURN_ARRIVED
                break
            stage += 1
            _load_stage(stages, stage, waypoints, estimated, memory)
        state.pitch, glides = pitch, engine_out and stage > 0
        if climb.is_required and stage == 0:
            _demand_climb(state, estimated, climb_parameters, memory, climb, target.airspeed, eas2tas, dt)
        else:
            _update_demands(state, estimated, waypoints, parameters, memory, aircraft, excesses, eas2tas, glides, dt)
        nav_roll = limited_nav_roll(memory.lateral_acceleration, state.pitch, state.airspeed / eas2tas, parameters)
        state.roll += min(max_roll_change, max(-max_roll_change, roll_fraction * (nav_roll - state.roll)))
        pitch += pitch_fraction * (memory.pitch_demand + parameters.pitch_trim - pitch)
        path_angle += path_fraction * (pitch - angle_of_attack(state, aircraft) - path_angle)
        throttle = 0.0 if engine_out else memory.throttle_demand
        energy += dt * advance_point_mass(estimated, state, path_angle, throttle, aircraft, excesses, power, field, dt)
    if result.clearance <= 0.0:
        result.outcome = RETURN_GROUND_IMPACT
    # Compiled code frees an array after its last use, and a record that views it does not keep it alive.
    are_arrays_alive = motions.size + states.size + memories.size + progress_records.size + spaced.size == 10
    result.energy = energy / 3600.0 if aircraft.has_power and are_arrays_alive else math.nan


@inner
def _lag_fractions(parameters: Record, dt: float) -> tuple[float, float, float]:
    """Return the fractions by which roll, pitch and path angle approach their demands in one tick.

    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    dt: duration of a tick, s.
    """
    return (
        1.0 - math.exp(-dt / (ROLL_LAG_RATIO * parameters.roll_time)),
        1.0 - math.exp(-dt / (PITCH_LAG_RATIO * parameters.pitch_time)),
        1.0 - math.exp(-dt / PATH_LAG_S),
    )


@inner
def _is_stage_complete(
    estimated: Record,
    target: Record,
    memory: Record,
    loiter: Record,
    climb: Record,
    is_before_reaction: bool,
    is_first_stage: bool,
    time: float,
    is_last_stage: bool,
    arrival_radius: float,
    dt: float,
) -> bool:
    """Return True if the current stage is complete.

    A stage is the flight straight ahead before the engine failure is noticed, the climb, or the leg to the target.

    target: end of the leg, a `WAYPOINT` record.
    loiter: progress around the loiter, a record of `flight.autopilots.return_steps.LOITER_PROGRESS`.
    climb: the climb at the start, a `CLIMB` record.
    is_before_reaction: True while the engine failure is not yet noticed and the aircraft flies straight on.
    is_first_stage, is_last_stage: True for the first stage and for the last one.
    time: time since the start, s.
    arrival_radius: distance from the center, m, within which the aircraft has arrived at the loiter.
    estimated: position and velocity over the ground, a `MOTION` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record.
    dt: duration of a tick, s.
    """
    if is_before_reaction:
        return time >= ENGINE_FAILURE_REACTION_S
    if climb.is_required and is_first_stage:
        # The climb lasts at least one tick.
        return time > 0.0 and estimated.up > climb.top
    # The leg ends at the waypoint. A loiter before a landing sequence is complete as soon as the aircraft is on its
    # circle and near the target altitude; the last one after one lap and `ENDLESS_LOITER_TIME_S`.
    if target.loiter_radius == 0.0:
        return memory.leg > 0
    altitude_error = abs(estimated.up - target.up)
    if not is_last_stage:
        return memory.reached_loiter_target and altitude_error < LANDING_JOIN_ALTITUDE_TOLERANCE_M
    return advance_loiter(estimated, target, loiter, arrival_radius, dt)


@inner
def _demand_climb(
    state: Record,
    estimated: Record,
    climb_parameters: Record,
    memory: Record,
    climb: Record,
    airspeed_demand: float,
    eas2tas: float,
    dt: float,
) -> None:
    """Demand a climb straight ahead: level wings, a fixed pitch, and increasing throttle.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground, a `MOTION` record.
    climb_parameters: `ARDUPILOT_PARAMETERS` record, both of whose pitch limits are the pitch of the climb.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record; updated.
    climb: throttle of the climb and the rate at which it increases, a `CLIMB` record.
    airspeed_demand: equivalent airspeed, m/s.
    eas2tas: ratio of true to equivalent airspeed.
    dt: duration of a tick, s.
    """
    memory.lateral_acceleration = 0.0
    memory.altitude_demand_in = estimated.up
    memory.altitude_demand_limited = estimated.up
    memory.altitude_demand = estimated.up
    memory.climb_rate_demand, memory.max_climb_scaler, memory.max_sink_scaler = 0.0, 1.0, 1.0
    previous_throttle = memory.throttle_demand
    seb_integrator = memory.seb_integrator
    ske_integrator = memory.ske_integrator
    memory.tas_demand = airspeed_demand * eas2tas
    update_tecs(state, estimated, climb_parameters, memory, airspeed_demand * eas2tas, eas2tas, dt)
    wind_up_ste_integrator(climb_parameters, memory)
    # The pitch integrators do not change: `AP_TECS::_update_pitch` starts them from the minimum pitch here.
    memory.seb_integrator, memory.ske_integrator = seb_integrator, ske_integrator
    memory.throttle_demand = max(previous_throttle, min(climb.throttle, previous_throttle + climb.slew * dt))


@inner
def _load_stage(stages: Records, index: int, waypoints: Records, estimated: Record, memory: Record) -> None:
    """Start the leg to the stage with the given index.

    The leg starts at the previous stage. It starts at the aircraft if there is no previous stage, or if the aircraft is
    already past the leg's end. Waypoints 1 and 2 both become a copy of the stage: once `navigate_legs` begins the leg
    to waypoint 2, the stage is reached.

    stages: `WAYPOINT` records of the RTL's stages.
    waypoints: three `WAYPOINT` records that the navigator follows; the last two are overwritten.
    estimated: position and velocity over the ground, a `MOTION` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record; updated.
    """
    stage, is_previous_reached = stages[index], memory.leg > 0
    for k in range(1, 3):
        target = waypoints[k]
        target.east = stage.east
        target.north = stage.north
        target.turn = stage.turn
        target.airspeed = stage.airspeed
        target.centre_east = stage.centre_east
        target.centre_north = stage.centre_north
        target.up = stage.up
        target.loiter_radius = stage.loiter_radius
        target.is_rtl = stage.is_rtl
        target.slope_base = stage.slope_base
        target.without_crosstrack = stage.without_crosstrack
        target.pass_by, target.min_ground_speed, target.home_up = stage.pass_by, stage.min_ground_speed, stage.home_up
    memory.from_east, memory.from_north, memory.from_up = estimated.east, estimated.north, estimated.up
    if is_previous_reached and not is_past_finish_line(
        estimated, stages[index - 1].east, stages[index - 1].north, stage.east, stage.north
    ):
        memory.from_east = stages[index - 1].east
        memory.from_north = stages[index - 1].north
        memory.from_up = stages[index - 1].up
    if stage.loiter_radius == 0.0 and index + 1 < stages.shape[0]:
        next_stage = stages[index + 1]
        course = math.atan2(stage.east - memory.from_east, stage.north - memory.from_north)
        turn = abs(wrap(math.atan2(next_stage.east - stage.east, next_stage.north - stage.north) - course))
        waypoints[1].turn, waypoints[2].turn = turn, turn
    memory.leg, memory.sloped_leg, memory.reached_loiter_target, memory.cross_track_integrator = 0, 0, False, 0.0


@inner
def _initialise_memory(
    start: Record,
    parameters: Record,
    aircraft: Record,
    excess_table: Floats,
    field: Floats,
    state: Record,
    memory: Record,
) -> None:
    """Set the state from the motion over the ground.

    The internal state of the control law is set as after a long steady flight.

    Follows `flight.autopilots.arduplane.law.initialise_memory`, which assumes level flight. In a climb or descent the
    input of the altitude demand is ahead of the aircraft by the lag of the demand.

    start: position, velocity, bank and time of the start, a `RETURN_START` record.
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    aircraft, excess_table, field: record, excess power and wind field of a `PointMass`.
    state: `STATE` record to fill.
    memory: `ARDUPILOT_MEMORY` record to fill.
    """
    initialise_state(start, aircraft, field, state)
    climb_rate = start.velocity_up
    memory.is_initialised = True
    memory.altitude_demand, memory.climb_rate_demand = start.up, climb_rate
    memory.altitude_demand_in = memory.altitude_demand_limited = (
        start.up + climb_rate * parameters.tecs_height_demand_time
    )
    memory.max_climb_scaler, memory.max_sink_scaler = 1.0, 1.0
    memory.airspeed_smoothed = memory.tas = memory.tas_demand = state.airspeed
    memory.pitch_demand = state.pitch - parameters.pitch_trim
    memory.ske_integrator = INITIAL_SKE_INTEGRATOR
    memory.seb_integrator = (
        memory.pitch_demand * state.airspeed * GRAVITY - GRAVITY * climb_rate - INITIAL_SKE_INTEGRATOR
    )
    throttle = steady_throttle(start, state, aircraft, excess_table)
    memory.throttle_demand, memory.last_throttle_demand = throttle, parameters.throttle_cruise
    memory.ste_integrator = throttle - parameters.throttle_cruise


@inner
def _update_demands(
    state: Record,
    estimated: Record,
    waypoints: Records,
    parameters: Record,
    memory: Record,
    aircraft: Record,
    excess_table: Floats,
    eas2tas: float,
    is_gliding: bool,
    dt: float,
) -> None:
    """Update the demands for bank, altitude, throttle and pitch on the leg to ``waypoints[1]``.

    TECS sets throttle and pitch; only in a turn without an engine does the pitch hold the airspeed of a gliding turn.

    excess_table: specific excess power, m/s, `PointMass.excess`.
    eas2tas: ratio of true to equivalent airspeed.
    is_gliding: True while the aircraft flies its RTL without an engine.
    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    estimated: position and velocity over the ground, a `MOTION` record.
    waypoints: `WAYPOINT` records, (w,).
    parameters: ArduPlane's parameters, an `ARDUPILOT_PARAMETERS` record.
    memory: internal state of the control law, an `ARDUPILOT_MEMORY` record.
    aircraft: the point mass, a `POINT_MASS` record.
    dt: duration of a tick, s.
    """
    target = waypoints[1]
    navigate_legs(estimated, waypoints[: 2 if target.loiter_radius != 0.0 else 3], parameters, memory, eas2tas, dt)
    if memory.reached_loiter_target and not target.is_rtl:
        # On a loiter of the mission the loiter's altitude applies at once (`Plane::update_loiter`).
        memory.from_up = target.up
    update_height_demand(estimated, target, parameters, memory, dt)
    airspeed_demand = airspeed_target(state, estimated, target.airspeed, target, parameters, memory, eas2tas)
    # In a gliding turn the pitch holds the airspeed, multiplied by the square root of the load factor, so that the
    # angle of attack stays the same. In six of eight ArduPlane flights, the aircraft held its airspeed in this way and
    # lost 55 m in the turn back. In the other two, which had been sinking before, it held its altitude, slowed down,
    # and lost half as much. The worse case is simulated.
    seb_integrator, ske_integrator = memory.seb_integrator, memory.ske_integrator
    update_tecs(state, estimated, parameters, memory, airspeed_demand * eas2tas, eas2tas, dt)
    if not is_gliding or abs(state.roll) < _TURN_BANK_RAD:
        return
    memory.seb_integrator, memory.ske_integrator = seb_integrator, ske_integrator
    tan_bank = math.tan(state.roll)
    drag = aircraft.induced / state.airspeed * tan_bank * tan_bank
    sink = drag - excess_power(excess_table, 0.0, state.airspeed, estimated.up, aircraft)
    acceleration_demand = (
        airspeed_demand * eas2tas / math.sqrt(math.cos(state.roll)) - state.airspeed
    ) / _TURN_AIRSPEED_LAG_S
    path_angle = -math.asin(min(0.5, max(-0.5, sink / state.airspeed + acceleration_demand / GRAVITY)))
    memory.pitch_demand = path_angle + angle_of_attack(state, aircraft) - parameters.pitch_trim
