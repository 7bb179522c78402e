"""Simulate an RTL with a point mass in about 2 ms, at least 100 times faster than JSBSim.

The law is the compiled code of `flight.autopilots.arduplane.law`: L1 to the target, the slope or the climb, and TECS
with its limits.  It controls a `flight.autopilots.arduplane.point_mass.PointMass`, whose bank and pitch follow their
demands with the lags of ArduPlane's controllers.  The least clearance is within 7 m of 38 flights of ArduPlane itself
(`tests/flight/autopilots/arduplane/test_rtl_point_mass.py`).

After an engine failure the law does not know that there is no thrust: it demands full throttle, slows down until it is
in underspeed (`flight.autopilots.arduplane.law.is_underspeed`), holds its minimum airspeed from then on, and dives onto
its slope where it meets the slope.  Fourteen such flights of ArduPlane are reproduced as well
(`tests/flight/autopilots/arduplane/test_engine_out.py`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.law import (
    ARDUPILOT_MEMORY,
    INITIAL_SKE_INTEGRATOR,
    NAVIGATION_TICK,
    PITCH_LAG,
    ROLL_LAG,
    airspeed_target,
    demand_height,
    roll_demand,
    update_tecs,
    wind_up_throttle,
)
from flight.autopilots.arduplane.navigator import LANDING_JOIN_ALTITUDE_TOLERANCE_M, navigate_legs, past_line
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane.point_mass import PointMass, angle_of_attack, excess_power, move_on
from flight.dynamics.state import STATE
from flight.guidance.equivalent_airspeed import true_by_equivalent
from flight.guidance.lateral_reference_laws import WAYPOINT
from flight.guidance.navigation_error import MOTION
from flight.mission.itinerary import UNLIMITED
from flight.mission.return_path import LandingStart, ReturnCircle
from flight.simulation.tick import RTL_ARRIVAL_ALTITUDE_TOLERANCE_M, RTL_ARRIVAL_LOITER_RADII, RTL_ARRIVAL_RADIUS_M
from world.arrays import Floats, Heights
from world.frames import POLYMAP, PolyMapRecord
from world.geometry import wrap
from world.kernels import Record, Records, compiled, inner, read_only, record_dtype
from world.scenario import Scenario
from world.terrain import ground_height
from world.wind import mean_wind_speed

# Progress around the RTL loiter since the aircraft captured it at the target altitude.
_LOITER_PROGRESS = record_dtype(
    "seconds",
    "turned",  # rad, positive to the right
    "bearing",  # rad, bearing from the center, at the last tick
)

# Start of an RTL: position in map axes, m; velocity over the ground, m/s; bank, rad.
RETURN_START = record_dtype("east", "north", "up", "velocity_east", "velocity_north", "velocity_up", "roll")

# Climb at the start of a flight, as in a go-around.
CLIMB = record_dtype(
    ("climbs", np.bool_),
    "top",  # m AMSL, altitude above which it ends
    "throttle",  # 0..1, throttle of the climb
    "slew",  # fraction of the throttle range, 1/s
)
NO_CLIMB: Record = np.zeros(1, CLIMB)[0]

# End of an RTL: it reached its landing sequence, or flew its loiter at the target altitude once around and for
# `flight.mission.itinerary.UNLIMITED` s.
RETURN_ARRIVED = 1
# End of an RTL: it hit the ground.
RETURN_GROUND_IMPACT = 2
# End of an RTL: it left the elevation data.
RETURN_OFF_TERRAIN = 3
# End of an RTL: it timed out.
RETURN_TIMEOUT = 4
# End of an RTL: it fell below the caller's least clearance or distance.
RETURN_ABORTED = 5
# Outcome of one simulated RTL.  Heights above ground and distances outside kill spheres in m; threat -1 if none.
RETURN_RESULT = record_dtype(
    ("ended", np.int64),
    "seconds",  # to its end
    "to_circle",  # s, first time within `LOITER_CAPTURE_RADIUS_M` of its target; NaN if it never is
    "circle_up",  # m, its altitude then
    "clearance",  # least of the whole RTL; after ground contact at most `DEEPEST` below the ground
    "clearance_time",  # after ground contact: the time of the first contact
    "clearance_east",
    "clearance_north",
    "clearance_up",
    "clearance_before",  # least before it arrived at its loiter
    "outside",  # least distance outside any kill sphere
    ("threat", np.int64),
    "threat_time",
    "outside_before",  # least before it arrived at its loiter
    "energy",  # Wh, NaN if the envelope has no power data
    ("rows", np.int64),  # number of stored positions
)
# An RTL has arrived at its loiter within this distance of its target (m), or within
# `flight.simulation.tick.RTL_ARRIVAL_LOITER_RADII` of its radii.  Flights of ArduPlane were compared up to there.
LOITER_CAPTURE_RADIUS_M = 200.0
# An RTL that hits the ground is continued to this depth (m), to know by how much it hits, and what an RTL that barely
# hits would meet after that.
DEEPEST = 10.0
# Interval between stored positions, ticks; 1 s.
KEPT_EVERY = 10
# Lag of the flight path behind the pitch, s: the time in which lift turns the velocity of a small aircraft.
_PATH_LAG_S = 0.4
# An RTL times out after this multiple of the nominal time for its distance and climb ...
_TIMEOUT_RATIO = 3.0
# ... plus this time, s.
_TIMEOUT_BASE_S = 600.0
# Bank above which an aircraft without thrust is treated as turning, rad.
_TURN_BANK_RAD = math.radians(5.0)
# Lag with which it settles at the airspeed of that turn, s.
_TURN_AIRSPEED_LAG_S = 8.0
# Delay from engine failure to the turn back, s; the delay used in the ArduPlane reference flights.
ENGINE_FAILURE_REACTION_S = 3.0


@dataclass(frozen=True, slots=True)
class ReturnEnvironment:
    """Terrain and threats that an RTL can meet, for compiled code.

    heights, to_pixel: of the terrain; one pixel without data if there is no terrain.
    spheres, radii: (m, 3) centers and (m,) radii of kill spheres, m; a radius of 0 stands for no sphere.
    known: True if there is a terrain.
    """

    heights: Heights
    to_pixel: PolyMapRecord
    spheres: Floats
    radii: Floats
    known: bool


@dataclass(frozen=True, slots=True)
class SwiftReturns:
    """Simulated RTLs.

    flown: (n,) of `RETURN_RESULT`.
    ways: n arrays (t, 3) of positions at intervals of 1 s, m; empty if they were not stored.
    """

    flown: Records
    ways: tuple[Floats, ...] = ()


def surroundings(scenario: Scenario) -> ReturnEnvironment:
    """Return the terrain and the kill spheres of a scenario."""
    threats, terrain = scenario.threats, scenario.terrain
    spheres, radii = threats.position.reshape(-1, 3), threats.kill_radius
    if terrain is None:
        nothing: Heights = np.full((2, 2), np.nan, dtype=np.float32)
        return ReturnEnvironment(read_only(nothing), np.zeros(1, POLYMAP)[0], spheres, radii, False)
    return ReturnEnvironment(terrain.heights, terrain.to_pixel.record, spheres, radii, True)


def fly_returns(
    starts: Records,
    targets: Sequence[ReturnCircle | None],
    parameters: ArduPilotParameters,
    aircraft: PointMass,
    around: ReturnEnvironment,
    *,
    landings: Sequence[LandingStart | None] = (),
    keep: bool = False,
    least: tuple[Floats, Floats] | None = None,
    engine_out: bool = False,
) -> SwiftReturns:
    """Simulate an RTL from each of n starts.

    starts: (n,) of `RETURN_START`.
    targets: n loiters, the target of each start; None to go straight to the landing sequence.
    landings: n landing sequences to join afterwards, up to the line-up or a loiter, None for no sequence; or empty.
    keep: True to store the positions.
    least: (n,) heights above ground and (n,) distances outside spheres, m, below which an RTL is aborted.
    engine_out: True after an engine failure: the aircraft flies on for `ENGINE_FAILURE_REACTION_S` s, and ends at its
    loiter.

    >>> from aircraft.catalog import load_aircraft
    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> from flight.autopilots.arduplane.point_mass import point_mass
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from world.scenario import load_scenario
    >>> from world.wind import Wind
    >>> scenario, aerosonde = load_scenario("jacksboro"), load_aircraft("aerosonde")
    >>> start = np.zeros(1, RETURN_START)
    >>> start["up"], start["velocity_north"] = 1000.0, 26.0
    >>> flown = fly_returns(
    ...     start,
    ...     [ReturnCircle(0.0, 4000.0, 900.0, 120.0)],
    ...     ArduPilotParameters.load(aerosonde),
    ...     point_mass(aerosonde, load_envelope(aerosonde), 25.0, Wind()),
    ...     surroundings(scenario),
    ... ).flown[0]
    >>> int(flown["ended"]) == RETURN_ARRIVED, bool(140.0 < flown["to_circle"] < 160.0)
    (True, True)
    """
    stages = [
        _make_stages(target, landing, parameters, aircraft)
        for target, landing in zip(targets, landings or [None] * len(targets), strict=True)
    ]
    if engine_out:
        stages = [np.concatenate([straight_on(start), ends]) for start, ends in zip(starts, stages, strict=True)]
    flown = np.zeros(len(starts), RETURN_RESULT)
    times = [rtl_timeout(start, ends, aircraft) for start, ends in zip(starts, stages, strict=True)]
    way = np.zeros((int(max(times, default=0.0)) + 2 if keep else 0, 3))
    ways, law = [], parameters.record()
    floor, apart = (np.full(len(starts), -math.inf),) * 2 if least is None else least
    for k, ends in enumerate(stages):
        fly_stages(
            starts[k],
            ends,
            law,
            law,
            NO_CLIMB,
            aircraft.record,
            aircraft.excess,
            aircraft.power,
            around.heights,
            around.to_pixel,
            around.spheres,
            around.radii,
            around.known,
            times[k],
            float(floor[k]),
            float(apart[k]),
            engine_out,
            way,
            flown[k],
        )
        if keep:
            ways.append(way[: int(flown[k]["rows"])].copy())
    return SwiftReturns(flown, tuple(ways))


def _make_stages(
    target: ReturnCircle | None, landing: LandingStart | None, parameters: ArduPilotParameters, aircraft: PointMass
) -> Records:
    """Return the successive targets of an RTL as `flight.guidance.lateral_reference_laws.WAYPOINT` records, (n,).

    A place of a landing sequence is a waypoint, or the center of a loiter of the mission, which is the last target.
    """
    places = truncate_at_first_loiter(() if landing is None else (landing, *landing.onward))
    stages: Records = np.zeros((target is not None) + len(places), WAYPOINT)
    stages["airspeed"], stages["min_ground_speed"] = aircraft.record.airspeed, parameters.ground_speed_min
    if target is not None:
        first = stages[0]
        first.centre_east, first.centre_north, first.up, first.circle, first.slope_base = target
        first.east, first.north, first.returns = target.east, target.north, True
    for stage, place in zip(stages[len(stages) - len(places) :], places, strict=True):
        fill_stage(stage, place, parameters)
        # The first leg of an RTL to the landing follows no line, as after any change of mode.
        stage.straight = place is landing
    return stages


def truncate_at_first_loiter(places: Sequence[LandingStart]) -> Sequence[LandingStart]:
    """Return the places of a landing sequence up to the first loiter.

    A point mass cannot say when the loiter is left.

    >>> spots = [LandingStart(k, (0.0, 0.0, 50.0), (0.0, 0.0, 50.0), circles=k == 2) for k in (1, 2, 3)]
    >>> [one.item for one in truncate_at_first_loiter(spots)]
    [1, 2]
    """
    circles = [k for k, one in enumerate(places) if one.circles]
    return places[: circles[0] + 1] if circles else places


def fill_stage(stage: Record, landing: LandingStart, parameters: ArduPilotParameters) -> None:
    """Fill a stage with a place of a landing sequence, which is a waypoint or the center of a loiter."""
    stage.east, stage.north, stage.up = stage.centre_east, stage.centre_north, stage.up = landing.place
    stage.pass_by, stage.home_up = landing.pass_by, landing.home_up
    # The turn to its next leg is unknown: use a right angle, as at a mission's end.
    stage.turn = 0.5 * math.pi
    stage.circle = (landing.radius or parameters.loiter_radius) if landing.circles else 0.0


# Length of a leg that is not flown to its end, m.
_STRAIGHT_LEG_LENGTH_M = 10_000.0


def straight_on(start: Record) -> Records:
    """Return a waypoint far ahead on course and slope, as `flight.guidance.lateral_reference_laws.WAYPOINT` (1,)."""
    ahead: Records = np.zeros(1, WAYPOINT)
    over = max(1.0, math.hypot(start["velocity_east"], start["velocity_north"]))
    for axis, velocity in (("east", "velocity_east"), ("north", "velocity_north"), ("up", "velocity_up")):
        ahead[axis] = start[axis] + _STRAIGHT_LEG_LENGTH_M * start[velocity] / over
    return ahead


def rtl_timeout(start: Record, stages: Records, aircraft: PointMass) -> float:
    """Return the timeout of an RTL, s."""
    slowest = max(5.0, aircraft.record.airspeed - aircraft.record.wind_speed)
    east, north, up, seconds = start["east"], start["north"], start["up"], 0.0
    for end in stages:
        distance = math.hypot(end["east"] - east, end["north"] - north)
        around = 2.0 * math.pi * RTL_ARRIVAL_LOITER_RADII * abs(end["circle"])
        seconds += (distance + around) / slowest + abs(end["up"] - up) / 2.0
        east, north, up = end["east"], end["north"], end["up"]
    return float(_TIMEOUT_BASE_S + _TIMEOUT_RATIO * seconds)


@compiled
def fly_stages(
    start: Record,
    stages: Records,
    parameters: Record,
    staged: Record,
    climb: Record,
    aircraft: Record,
    excess: Floats,
    power: Floats,
    heights: Heights,
    to_pixel: PolyMapRecord,
    spheres: Floats,
    radii: Floats,
    known: bool,
    most: float,
    floor: float,
    apart: float,
    engine_out: bool,
    way: Floats,
    out: Record,
) -> None:
    """Fly from stage to stage for at most ``most`` s, and fill in the outcome.

    climb: True if the first stage is a climb, and its final altitude.  staged: the parameters of that climb.
    """
    # The same spacing as in `waypoint_column`.  A loiter is flown until the RTL is over: no leg follows it.
    spaced, turns = np.zeros(6, WAYPOINT), np.zeros(1, _LOITER_PROGRESS)
    waypoints, circling = spaced[::2], turns[0]
    motions, states, memories = np.zeros(1, MOTION), np.zeros(1, STATE), np.zeros(1, ARDUPILOT_MEMORY)
    b, estimated, state, own = waypoints[1], motions[0], states[0], memories[0]
    _initialise_outcome(start, estimated, known, out)
    _load_stage(stages, 0, waypoints, estimated, own)
    _initialise_law(start, parameters, aircraft, excess, state, own)
    pitch, angle, dt = state.pitch, state.pitch - state.alpha, NAVIGATION_TICK
    roll_share = 1.0 - math.exp(-dt / (ROLL_LAG * parameters.roll_time))
    pitch_share = 1.0 - math.exp(-dt / (PITCH_LAG * parameters.pitch_time))
    path_share = 1.0 - math.exp(-dt / _PATH_LAG_S)
    stage, used = 0, 0.0
    for tick in range(int(most / dt)):
        time = tick * dt
        if tick % KEPT_EVERY == 0:
            _store_position(estimated, way, out)
        factor = true_by_equivalent(estimated.up)
        is_last = stage + 1 == stages.shape[0]
        distance = math.hypot(estimated.east - b.centre_east, estimated.north - b.centre_north)
        wide = RTL_ARRIVAL_LOITER_RADII * abs(b.circle) * factor * factor
        if is_last and distance < max(LOITER_CAPTURE_RADIUS_M, wide):
            _record_arrival(estimated, time, engine_out, out)
        out.seconds = time
        _update_clearances(estimated, time, heights, to_pixel, spheres, radii, known, out)
        if out.ended == RETURN_TIMEOUT and (out.clearance < floor or out.outside < apart):
            out.ended = RETURN_ABORTED
        if out.ended != RETURN_TIMEOUT:
            break
        if _is_stage_complete(
            estimated, b, own, circling, climb, engine_out and stage == 0, stage == 0, time, is_last, wide, dt
        ):
            if is_last:
                out.ended = RETURN_ARRIVED
                break
            stage += 1
            _load_stage(stages, stage, waypoints, estimated, own)
        state.pitch, unpowered = pitch, engine_out and stage > 0
        if climb.climbs and stage == 0:
            _demand_climb(state, estimated, staged, own, climb, b.airspeed, factor, dt)
        else:
            _update_demands(state, estimated, waypoints, parameters, own, aircraft, excess, factor, unpowered, dt)
        banked = roll_demand(own.side_acceleration, state.pitch, state.airspeed / factor, parameters)
        state.roll += roll_share * (banked - state.roll)
        pitch += pitch_share * (own.pitch_demand + parameters.pitch_trim - pitch)
        angle += path_share * (pitch - angle_of_attack(state, aircraft) - angle)
        throttle = 0.0 if engine_out else own.throttle_demand
        used += dt * move_on(estimated, state, angle, throttle, aircraft, excess, power, dt)
    if out.clearance <= 0.0:
        out.ended = RETURN_GROUND_IMPACT
    # Compiled code frees an array after its last use, and a record that views it does not keep it alive.
    held = motions.size + states.size + memories.size + turns.size + spaced.size == 10
    out.energy = used / 3600.0 if aircraft.has_power and held else math.nan


@inner
def _store_position(here: Record, way: Floats, out: Record) -> None:
    """Store a position unless the array is full."""
    if out.rows < way.shape[0]:
        way[out.rows, 0], way[out.rows, 1], way[out.rows, 2] = here.east, here.north, here.up
        out.rows += 1


@inner
def _record_arrival(here: Record, time: float, engine_out: bool, out: Record) -> None:
    """Record time and altitude of the first arrival at the loiter."""
    if math.isnan(out.to_circle):
        out.to_circle, out.circle_up = time, here.up
        if engine_out:
            # Without an engine it comes down in circles there.
            out.ended = RETURN_ARRIVED


@inner
def _is_stage_complete(
    here: Record,
    b: Record,
    own: Record,
    circling: Record,
    climb: Record,
    waits: bool,
    is_first: bool,
    time: float,
    is_last: bool,
    wide: float,
    dt: float,
) -> bool:
    """Return True if the next stage begins.

    waits: True while the aircraft flies straight on, until the engine failure is noticed.
    """
    if waits:
        return time >= ENGINE_FAILURE_REACTION_S
    if climb.climbs and is_first:
        # The climb ends no earlier than it has begun.
        return time > 0.0 and here.up > climb.top
    return _is_target_reached(here, b, own, circling, is_last, wide, dt)


@inner
def _demand_climb(
    state: Record, motion: Record, staged: Record, own: Record, climb: Record, wanted: float, factor: float, dt: float
) -> None:
    """Demand a climb straight ahead, with level wings, the pitch of its parameters, and increasing throttle.

    wanted: equivalent airspeed, m/s.
    """
    own.side_acceleration = 0.0
    own.height_asked, own.height_limited, own.height_demand = motion.up, motion.up, motion.up
    own.height_rate, own.climb_share, own.sink_share = 0.0, 1.0, 1.0
    before, balance, speed = own.throttle_demand, own.seb_integrator, own.ske_integrator
    own.airspeed_demand = wanted * factor
    update_tecs(state, motion, staged, own, wanted * factor, factor, dt)
    wind_up_throttle(staged, own)
    # The pitch integrators stay: `AP_TECS::_update_pitch` starts them from the minimum pitch here, so what the minimum
    # adds does not enter them.
    own.seb_integrator, own.ske_integrator = balance, speed
    own.throttle_demand = max(before, min(climb.throttle, before + climb.slew * dt))


@inner
def _is_target_reached(
    here: Record, b: Record, own: Record, circling: Record, is_last: bool, wide: float, dt: float
) -> bool:
    """Return True once a waypoint is reached, the last loiter is flown, or a loiter is left for the landing.

    b: its waypoint.  wide: distance from the center, m, within which the aircraft has arrived at the loiter.
    dt: s since the last call.
    """
    if b.circle == 0.0:
        return own.leg > 0
    high = abs(here.up - b.up)
    if not is_last:
        return own.on_circle and high < LANDING_JOIN_ALTITUDE_TOLERANCE_M
    off_e, off_n = here.east - b.centre_east, here.north - b.centre_north
    bearing = math.atan2(off_e, off_n)
    if circling.seconds > 0.0:
        circling.turned += wrap(bearing - circling.bearing)
    circling.bearing = bearing
    if circling.seconds > 0.0 or (
        math.hypot(off_e, off_n) < max(RTL_ARRIVAL_RADIUS_M, wide) and high < RTL_ARRIVAL_ALTITUDE_TOLERANCE_M
    ):
        circling.seconds += dt
    return circling.seconds > UNLIMITED and abs(circling.turned) >= 2.0 * math.pi


@inner
def _initialise_outcome(start: Record, estimated: Record, known: bool, out: Record) -> None:  # pragma: no cover
    """Fill in the start, and the outcome before the flight."""
    estimated.east, estimated.north, estimated.up = start.east, start.north, start.up
    estimated.velocity_east, estimated.velocity_north = start.velocity_east, start.velocity_north
    estimated.velocity_up = start.velocity_up
    out.clearance = out.clearance_before = math.inf if known else math.nan
    out.threat = -1
    out.outside, out.outside_before = math.inf, math.inf
    out.to_circle, out.circle_up, out.energy, out.ended, out.rows = math.nan, math.nan, 0.0, RETURN_TIMEOUT, 0


@inner
def _load_stage(stages: Records, at: int, waypoints: Records, estimated: Record, own: Record) -> None:
    """Set both waypoints to a stage; its leg begins here, or at the last waypoint if that was reached."""
    stage, reached = stages[at], own.leg > 0
    for k in range(1, 3):
        b = waypoints[k]
        b.east, b.north, b.turn, b.airspeed = stage.east, stage.north, stage.turn, stage.airspeed
        b.centre_east, b.centre_north, b.up, b.circle = stage.centre_east, stage.centre_north, stage.up, stage.circle
        b.returns, b.slope_base, b.straight = stage.returns, stage.slope_base, stage.straight
        b.pass_by, b.min_ground_speed, b.home_up = stage.pass_by, stage.min_ground_speed, stage.home_up
    own.from_east, own.from_north, own.from_up = estimated.east, estimated.north, estimated.up
    if reached and not past_line(estimated, stages[at - 1].east, stages[at - 1].north, stage.east, stage.north):
        own.from_east, own.from_north, own.from_up = stages[at - 1].east, stages[at - 1].north, stages[at - 1].up
    if stage.circle == 0.0 and at + 1 < stages.shape[0]:
        after, course = stages[at + 1], math.atan2(stage.east - own.from_east, stage.north - own.from_north)
        turn = abs(wrap(math.atan2(after.east - stage.east, after.north - stage.north) - course))
        waypoints[1].turn, waypoints[2].turn = turn, turn
    own.leg, own.sloped_leg, own.on_circle, own.cross_track_integrator = 0, 0, False, 0.0


@inner
def _initialise_law(
    start: Record, parameters: Record, aircraft: Record, excess: Floats, state: Record, own: Record
) -> None:
    """Fill the state from the motion over the ground, and the law's memory as after a long steady flight.

    Follows `flight.autopilots.arduplane.law.begin_law`, but on a slope: the altitude setpoint leads by its lag.
    """
    wind = mean_wind_speed(aircraft.wind_speed, aircraft.wind_gradient, aircraft.wind_reference, start.up)
    air_east = start.velocity_east - wind * aircraft.wind_east
    air_north = start.velocity_north - wind * aircraft.wind_north
    climb = start.velocity_up
    state.airspeed = max(1.0, math.hypot(math.hypot(air_east, air_north), climb))
    state.yaw, state.roll = math.atan2(air_east, air_north), start.roll
    state.alpha = angle_of_attack(state, aircraft)
    state.pitch = math.asin(min(1.0, max(-1.0, climb / state.airspeed))) + state.alpha
    own.begun = True
    own.height_demand, own.height_rate = start.up, climb
    own.height_asked = own.height_limited = start.up + climb * parameters.tecs_height_demand_time
    own.climb_share, own.sink_share = 1.0, 1.0
    own.airspeed_read = own.airspeed = own.airspeed_demand = state.airspeed
    own.pitch_demand = state.pitch - parameters.pitch_trim
    own.ske_integrator = INITIAL_SKE_INTEGRATOR
    own.seb_integrator = own.pitch_demand * state.airspeed * GRAVITY - GRAVITY * climb - INITIAL_SKE_INTEGRATOR
    throttle = 1.0
    while throttle > 0.0 and excess_power(excess, throttle, state.airspeed, start.up, aircraft) > climb:
        throttle -= 0.01
    own.throttle_demand, own.throttle_before = throttle, parameters.throttle_cruise
    own.ste_integrator = throttle - parameters.throttle_cruise


@inner
def _update_demands(
    state: Record,
    estimated: Record,
    waypoints: Records,
    parameters: Record,
    own: Record,
    aircraft: Record,
    excess: Floats,
    factor: float,
    unpowered: bool,
    dt: float,
) -> None:
    """Update the demands of bank, altitude, throttle and pitch on the leg to the second waypoint."""
    b = waypoints[1]
    navigate_legs(estimated, waypoints[: 2 if b.circle != 0.0 else 3], parameters, own, factor, dt)
    if own.on_circle and not b.returns:
        # On a loiter of the mission its altitude applies at once (`Plane::update_loiter`).
        own.from_up = b.up
    demand_height(estimated, b, parameters, own, dt)
    wanted = airspeed_target(state, estimated, b.airspeed, b, parameters, own, factor)
    _demand_throttle_and_pitch(state, estimated, parameters, own, aircraft, excess, wanted, factor, unpowered, dt)


@inner
def _demand_throttle_and_pitch(
    state: Record,
    motion: Record,
    parameters: Record,
    own: Record,
    aircraft: Record,
    excess: Floats,
    wanted: float,
    factor: float,
    unpowered: bool,
    dt: float,
) -> None:
    """Demand throttle and pitch by TECS, or in a turn without thrust the pitch for an airspeed.

    wanted: equivalent airspeed, m/s.  In a bank it grows as the root of the load factor, at the same angle of attack.
    Of eight flights of ArduPlane six turned back so, and lost 55 m in their turn; the other two, which had been sinking
    before, held their altitude and slowed down, which costs half of that.  The worse case stands for both.
    """
    balance, speed = own.seb_integrator, own.ske_integrator
    update_tecs(state, motion, parameters, own, wanted * factor, factor, dt)
    if not unpowered or abs(state.roll) < _TURN_BANK_RAD:
        return
    own.seb_integrator, own.ske_integrator = balance, speed
    tilt = math.tan(state.roll)
    drag = aircraft.induced / state.airspeed * tilt * tilt
    sink = drag - excess_power(excess, 0.0, state.airspeed, motion.up, aircraft)
    faster = (wanted * factor / math.sqrt(math.cos(state.roll)) - state.airspeed) / _TURN_AIRSPEED_LAG_S
    path = -math.asin(min(0.5, max(-0.5, sink / state.airspeed + faster / GRAVITY)))
    own.pitch_demand = path + angle_of_attack(state, aircraft) - parameters.pitch_trim


@inner
def _update_clearances(
    here: Record,
    time: float,
    heights: Heights,
    to_pixel: PolyMapRecord,
    spheres: Floats,
    radii: Floats,
    known: bool,
    out: Record,
) -> None:
    """Update the clearances above ground and outside each sphere, and end the RTL where they demand it."""
    for m in range(spheres.shape[0]):
        radius = radii[m]
        if radius <= 0.0:
            continue
        off_e, off_n, off_u = here.east - spheres[m, 0], here.north - spheres[m, 1], here.up - spheres[m, 2]
        outside = math.sqrt(off_e * off_e + off_n * off_n + off_u * off_u) - radius
        if outside < out.outside:
            out.outside, out.threat, out.threat_time = outside, m, time
        if math.isnan(out.to_circle):
            out.outside_before = min(out.outside_before, outside)
    if not known:
        return
    clearance = here.up - ground_height(heights, to_pixel, here.east, here.north)
    if math.isnan(clearance):
        out.ended = RETURN_OFF_TERRAIN
        return
    if clearance < out.clearance:
        if out.clearance > 0.0:
            if math.isnan(out.to_circle):
                out.clearance_before = clearance
            out.clearance_time = time
            out.clearance_east, out.clearance_north, out.clearance_up = here.east, here.north, here.up
        out.clearance = clearance
    if clearance <= -DEEPEST:
        out.ended, out.seconds = RETURN_GROUND_IMPACT, out.clearance_time
