"""A return to launch within a millisecond: ArduPlane's law steers a point mass, and not an aircraft in JSBSim.

The law is that of `flight.autopilots.arduplane.law`, compiled code and all: L1 to the target, the slope or the climb,
TECS with its limits.  What it steers is a `flight.autopilots.arduplane.point_mass.PointMass`, whose bank and pitch
follow their demands with the lags of ArduPlane's controllers.  A return takes two milliseconds so, a hundredth and less
of a flight in JSBSim, and its least clearance is within 7 m of 38 flights of ArduPlane itself
(`tests/flight/autopilots/arduplane/test_swift_return.py`).

Without its engine the law does not know that there is no thrust: it asks for all of it, slows down until it is too slow
(`flight.autopilots.arduplane.law.is_underspeed`), holds its least airspeed from then on, and dives onto its slope where
it meets that.  Fourteen such flights of ArduPlane are met as well
(`tests/flight/autopilots/arduplane/test_engine_out.py`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.law import (
    ARDUPILOT_MEMORY,
    NAVIGATION_TICK,
    PITCH_LAG,
    ROLL_LAG,
    SPEED_SUM,
    demand_height,
    roll_demand,
    update_tecs,
    wind_up_throttle,
)
from flight.autopilots.arduplane.navigator import JOINS_WITHIN, navigate_legs, past_line
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane.point_mass import PointMass, angle_of_attack, excess_power, move_on
from flight.dynamics.state import STATE
from flight.guidance.equivalent_airspeed import true_by_equivalent
from flight.guidance.lateral_reference_laws import WAYPOINT
from flight.guidance.navigation_error import MOTION
from flight.mission.itinerary import UNLIMITED
from flight.mission.return_path import LandingStart, ReturnCircle
from flight.simulation.tick import AT_HEIGHT, NEAR, WIDER
from world.frames import POLYMAP, PolyMapRecord
from world.geometry import wrap
from world.kernels import Record, Records, compiled, inner, read_only, record_dtype
from world.scenario import Scenario
from world.terrain import Heights, ground_height
from world.wind import mean_wind_speed

Floats = NDArray[np.float64]

# How far round its circle a return is, since it came there and to its height.
_CIRCLING = record_dtype(
    "seconds",
    "turned",  # rad, positive to the right
    "bearing",  # rad, from its middle, at the last tick
)

# Where a return begins: places and velocities in map axes, m and m/s over the ground; bank, rad.
RETURN_START = record_dtype("east", "north", "up", "velocity_east", "velocity_north", "velocity_up", "roll")

# A climb that a flight begins with, as a landing's go-around does.
CLIMB = record_dtype(
    ("climbs", np.bool_),
    "top",  # m AMSL, above which it ends
    "throttle",  # 0..1, which it opens to
    "slew",  # of the throttle's range, 1/s
)
NO_CLIMB: Record = np.zeros(1, CLIMB)[0]

# How a return ended: at its landing sequence, or in its circle for `flight.mission.itinerary.UNLIMITED` s and once all
# around it at its height; in the ground; off the elevation data; neither in three times the time that its way takes; or
# below the least that was asked of it.
CIRCLED, HIT, OFF_GROUND, NEVER, CUT = 1, 2, 3, 4, 5
# What is told of a return.  Heights above ground and distances outside kill spheres, m; -1 for no threat.
RETURN_FLOWN = record_dtype(
    ("ended", np.int64),
    "seconds",  # to its end
    "to_circle",  # s, when it is first within `AT_CIRCLE` of its target; NaN for never
    "circle_up",  # m, its height then
    "clearance",  # least, over all of it; of one that hits, `DEEPEST` below the ground at the most
    "clearance_time",  # of one that hits, where it does so first
    "clearance_east",
    "clearance_north",
    "clearance_up",
    "clearance_before",  # least, before it came to its circle
    "outside",  # least distance outside any kill sphere
    ("threat", np.int64),
    "threat_time",
    "outside_before",  # before it came to its circle
    "energy",  # Wh, NaN where the envelope knows no power
    ("rows", np.int64),  # of the way that was kept
)
# Nearer to its target than this (m), or than `flight.simulation.tick.WIDER` of its radii, a return is at its circle: as
# far as flights of ArduPlane were compared.
AT_CIRCLE = 200.0
# A return that hits the ground is flown on until it is so deep in it (m): by how much it hit is known then, and what a
# return that barely does so would meet after that.
DEEPEST = 10.0
# Every so many ticks a place of the way is kept, 1 s.
KEPT_EVERY = 10
# The flight path follows the pitch so late, s: the time in which lift turns the velocity of a small aircraft.
_PATH_LAG = 0.4
# A return that takes this many times as long as its way and its climb is given up, and so many s at least.
_TOO_LONG, _SPARE = 3.0, 600.0
# Without thrust an aircraft that is banked by more than this (rad) comes to the airspeed of its turn with this lag (s).
_TURNS, _SPEED_LAG = math.radians(5.0), 8.0
# After its engine has stopped an aircraft flies on for this long before it turns back, s: so long did those that
# ArduPlane's flights were measured with.
REACTION = 3.0


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What a return can meet, for compiled code.

    heights, to_pixel: of the terrain; one pixel without data where none is known.
    spheres, radii: (m, 3) middles and (m,) radii of kill spheres, m; a radius of 0 is none.
    known: whether there is a terrain.
    """

    heights: Heights
    to_pixel: PolyMapRecord
    spheres: Floats
    radii: Floats
    known: bool


@dataclass(frozen=True, slots=True)
class SwiftReturns:
    """Returns that were flown.

    flown: (n,) of `RETURN_FLOWN`.
    ways: n arrays (t, 3) of places a second apart, m; empty where none were kept.
    """

    flown: Records
    ways: tuple[Floats, ...] = ()


def surroundings(scenario: Scenario) -> Surroundings:
    """Ground and kill spheres of a scenario."""
    threats, terrain = scenario.threats, scenario.terrain
    spheres, radii = threats.position.reshape(-1, 3), threats.kill_radius
    if terrain is None:
        nothing: Heights = np.full((2, 2), np.nan, dtype=np.float32)
        return Surroundings(read_only(nothing), np.zeros(1, POLYMAP)[0], spheres, radii, False)
    return Surroundings(terrain.heights, terrain.to_pixel.record, spheres, radii, True)


def fly_returns(
    starts: Records,
    targets: Sequence[ReturnCircle | None],
    parameters: ArduPilotParameters,
    aircraft: PointMass,
    around: Surroundings,
    *,
    landings: Sequence[LandingStart | None] = (),
    keep: bool = False,
    least: tuple[Floats, Floats] | None = None,
    engine_out: bool = False,
) -> SwiftReturns:
    """Fly a return from each of n starts.

    starts: (n,) of `RETURN_START`.
    targets: n circles, where each of them goes; None for one that goes straight to its landing sequence.
    landings: n landing sequences that they go on to, up to the line-up or a loiter, None for none; or none at all.
    keep: whether their ways are kept.
    least: (n,) heights above ground and (n,) distances outside spheres, m, below which a return need not be flown on.
    engine_out: whether the engine has stopped: it flies on for `REACTION` s, and its circle ends it.

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
    >>> int(flown["ended"]) == CIRCLED, bool(140.0 < flown["to_circle"] < 160.0)
    (True, True)
    """
    stages = [
        _stages(target, landing, parameters, aircraft)
        for target, landing in zip(targets, landings or [None] * len(targets), strict=True)
    ]
    if engine_out:
        stages = [np.concatenate([straight_on(start), ends]) for start, ends in zip(starts, stages, strict=True)]
    flown = np.zeros(len(starts), RETURN_FLOWN)
    times = [most_seconds(start, ends, aircraft) for start, ends in zip(starts, stages, strict=True)]
    way = np.zeros((int(max(times, default=0.0)) + 2 if keep else 0, 3))
    ways, law = [], parameters.record()
    floor, apart = (np.full(len(starts), -math.inf),) * 2 if least is None else least
    for k, ends in enumerate(stages):
        fly_stages(
            starts[k], ends, law, law, NO_CLIMB, aircraft.record, aircraft.excess, aircraft.power, around.heights,
            around.to_pixel, around.spheres, around.radii, around.known, times[k],
            float(floor[k]), float(apart[k]), engine_out, way, flown[k],
        )  # fmt: skip
        if keep:
            ways.append(way[: int(flown[k]["rows"])].copy())
    return SwiftReturns(flown, tuple(ways))


def _stages(
    target: ReturnCircle | None, landing: LandingStart | None, parameters: ArduPilotParameters, aircraft: PointMass
) -> Records:
    """(n,) of `flight.guidance.lateral_reference_laws.WAYPOINT`: what a return flies to, one after the other.

    A place of a landing sequence is a waypoint, or the middle of a loiter that the mission asks for, which is the last.
    """
    places = until_circle(() if landing is None else (landing, *landing.onward))
    stages: Records = np.zeros((target is not None) + len(places), WAYPOINT)
    stages["airspeed"] = aircraft.record.airspeed
    if target is not None:
        first = stages[0]
        first.centre_east, first.centre_north, first.up, first.circle, first.slope_base = target
        first.east, first.north, first.returns = target.east, target.north, True
    for stage, place in zip(stages[len(stages) - len(places) :], places, strict=True):
        fill_stage(stage, place, parameters)
        # A return's first leg to land is flown along no line, as after any change of mode.
        stage.straight = place is landing
    return stages


def until_circle(places: Sequence[LandingStart]) -> Sequence[LandingStart]:
    """The places of a landing sequence up to the first that is a loiter: when that is left, no point mass knows.

    >>> spots = [LandingStart(k, (0.0, 0.0, 50.0), (0.0, 0.0, 50.0), circles=k == 2) for k in (1, 2, 3)]
    >>> [one.item for one in until_circle(spots)]
    [1, 2]
    """
    circles = [k for k, one in enumerate(places) if one.circles]
    return places[: circles[0] + 1] if circles else places


def fill_stage(stage: Record, landing: LandingStart, parameters: ArduPilotParameters) -> None:
    """Make a place of a landing sequence what is flown to: a waypoint, or the middle of a loiter."""
    stage.east, stage.north, stage.up = stage.centre_east, stage.centre_north, stage.up = landing.place
    # Nothing says how its next leg turns: as at a mission's end, it is a right angle.
    stage.turn = 0.5 * math.pi
    stage.circle = (landing.radius or parameters.loiter_radius) if landing.circles else 0.0


# How far away the end of a leg is that is not flown to its end, m.
_ON = 10_000.0


def straight_on(start: Record) -> Records:
    """(1,) of `flight.guidance.lateral_reference_laws.WAYPOINT`: far ahead on a start's course and slope."""
    ahead: Records = np.zeros(1, WAYPOINT)
    over = max(1.0, math.hypot(start["velocity_east"], start["velocity_north"]))
    for axis, velocity in (("east", "velocity_east"), ("north", "velocity_north"), ("up", "velocity_up")):
        ahead[axis] = start[axis] + _ON * start[velocity] / over
    return ahead


def most_seconds(start: Record, stages: Records, aircraft: PointMass) -> float:
    """After how long a return is given up, s."""
    slowest = max(5.0, aircraft.record.airspeed - aircraft.record.wind_speed)
    east, north, up, seconds = start["east"], start["north"], start["up"], 0.0
    for end in stages:
        distance = math.hypot(end["east"] - east, end["north"] - north)
        around = 2.0 * math.pi * WIDER * abs(end["circle"])
        seconds += (distance + around) / slowest + abs(end["up"] - up) / 2.0
        east, north, up = end["east"], end["north"], end["up"]
    return float(_SPARE + _TOO_LONG * seconds)


@compiled
def fly_stages(
    start: Record, stages: Records, parameters: Record, staged: Record, climb: Record, aircraft: Record, excess: Floats,
    power: Floats, heights: Heights, to_pixel: PolyMapRecord, spheres: Floats, radii: Floats, known: bool, most: float,
    floor: float, apart: float, engine_out: bool, way: Floats, out: Record,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Fly from one stage to the next for ``most`` s at the longest, and fill in what is told of it.

    climb: whether the first stage is a climb, and how far.  staged: the parameters of that climb.
    """
    # As `waypoint_column` has them.  A circle is flown until the return is over: no leg comes after it.
    spaced, turns = np.zeros(6, WAYPOINT), np.zeros(1, _CIRCLING)
    waypoints, circling = spaced[::2], turns[0]
    motions, states, memories = np.zeros(1, MOTION), np.zeros(1, STATE), np.zeros(1, ARDUPILOT_MEMORY)
    b, estimated, state, own = waypoints[1], motions[0], states[0], memories[0]
    _begin(start, estimated, known, out)
    _fly_to(stages, 0, waypoints, estimated, own)
    _take_over(start, parameters, aircraft, excess, state, own)
    pitch, angle, dt = state.pitch, state.pitch - state.alpha, NAVIGATION_TICK
    roll_share = 1.0 - math.exp(-dt / (ROLL_LAG * parameters.roll_time))
    pitch_share = 1.0 - math.exp(-dt / (PITCH_LAG * parameters.pitch_time))
    path_share = 1.0 - math.exp(-dt / _PATH_LAG)
    stage, used = 0, 0.0
    for tick in range(int(most / dt)):
        time = tick * dt
        if tick % KEPT_EVERY == 0:
            _keep(estimated, way, out)
        factor = true_by_equivalent(estimated.up)
        is_last = stage + 1 == stages.shape[0]
        distance = math.hypot(estimated.east - b.centre_east, estimated.north - b.centre_north)
        wide = WIDER * abs(b.circle) * factor * factor
        if is_last and distance < max(AT_CIRCLE, wide):
            _arrive(estimated, time, engine_out, out)
        out.seconds = time
        _look(estimated, time, heights, to_pixel, spheres, radii, known, out)
        if out.ended == NEVER and (out.clearance < floor or out.outside < apart):
            out.ended = CUT
        if out.ended != NEVER:
            break
        if _goes_on(estimated, b, own, circling, climb, engine_out and stage == 0, stage == 0, time, is_last, wide, dt):
            if is_last:
                out.ended = CIRCLED
                break
            stage += 1
            _fly_to(stages, stage, waypoints, estimated, own)
        state.pitch, unpowered = pitch, engine_out and stage > 0
        if climb.climbs and stage == 0:
            _climb(state, estimated, staged, own, climb, b.airspeed, factor, dt)
        else:
            _demand(state, estimated, waypoints, parameters, own, aircraft, excess, factor, unpowered, dt)
        banked = roll_demand(own.side_acceleration, state.pitch, state.airspeed / factor, parameters)
        state.roll += roll_share * (banked - state.roll)
        pitch += pitch_share * (own.pitch_demand + parameters.pitch_trim - pitch)
        angle += path_share * (pitch - angle_of_attack(state, aircraft) - angle)
        throttle = 0.0 if engine_out else own.throttle_demand
        used += dt * move_on(estimated, state, angle, throttle, aircraft, excess, power, dt)
    if out.clearance <= 0.0:
        out.ended = HIT
    # Compiled code frees an array after its last use, and a record of it does not count as one.
    held = motions.size + states.size + memories.size + turns.size + spaced.size == 10
    out.energy = used / 3600.0 if aircraft.has_power and held else math.nan


@inner
def _keep(here: Record, way: Floats, out: Record) -> None:  # pragma: no cover - compiled
    """Keep a place of the way while there is room."""
    if out.rows < way.shape[0]:
        way[out.rows, 0], way[out.rows, 1], way[out.rows, 2] = here.east, here.north, here.up
        out.rows += 1


@inner
def _arrive(here: Record, time: float, engine_out: bool, out: Record) -> None:  # pragma: no cover - compiled
    """Note when it is first at its circle, and how high."""
    if math.isnan(out.to_circle):
        out.to_circle, out.circle_up = time, here.up
        if engine_out:
            # What it does there is to come down in circles.
            out.ended = CIRCLED


@inner
def _goes_on(
    here: Record, b: Record, own: Record, circling: Record, climb: Record, waits: bool, is_first: bool, time: float,
    is_last: bool, wide: float, dt: float,
) -> bool:  # pragma: no cover - compiled  # fmt: skip
    """Whether the next stage begins.  waits: whether it flies straight on, until the engine is seen to stand."""
    if waits:
        late: bool = time >= REACTION
        return late
    if climb.climbs and is_first:
        # It is found to be so high no sooner than it climbs.
        high: bool = time > 0.0 and here.up > climb.top
        return high
    through: bool = _is_through(here, b, own, circling, is_last, wide, dt)
    return through


@inner
def _climb(
    state: Record, motion: Record, staged: Record, own: Record, climb: Record, wanted: float, factor: float, dt: float
) -> None:  # pragma: no cover - compiled
    """Demand a climb straight ahead: wings level, the pitch of its parameters, and the throttle opened.

    wanted: airspeed, equivalent, m/s.
    """
    own.side_acceleration = 0.0
    own.height_asked, own.height_limited, own.height_demand = motion.up, motion.up, motion.up
    own.height_rate, own.climb_share, own.sink_share = 0.0, 1.0, 1.0
    before, balance, speed = own.throttle_demand, own.balance_sum, own.speed_sum
    own.airspeed_demand = wanted * factor
    update_tecs(state, motion, staged, own, wanted * factor, factor, dt)
    wind_up_throttle(staged, own)
    # The pitch's integrals start from its least here (`AP_TECS::_update_pitch`): what it is raised by is not in them.
    own.balance_sum, own.speed_sum = balance, speed
    own.throttle_demand = max(before, min(climb.throttle, before + climb.slew * dt))


@inner
def _is_through(
    here: Record, b: Record, own: Record, circling: Record, is_last: bool, wide: float, dt: float
) -> bool:  # pragma: no cover - compiled
    """Whether a stage of a return is over: its waypoint is reached, its last circle flown, or left for what follows.

    b: its waypoint.  wide: m from its middle within which it is at its circle.  dt: s since it was asked last.
    """
    if b.circle == 0.0:
        reached: bool = own.leg > 0
        return reached
    high = abs(here.up - b.up)
    if not is_last:
        joins: bool = own.on_circle and high < JOINS_WITHIN
        return joins
    off_e, off_n = here.east - b.centre_east, here.north - b.centre_north
    bearing = math.atan2(off_e, off_n)
    if circling.seconds > 0.0:
        circling.turned += wrap(bearing - circling.bearing)
    circling.bearing = bearing
    if circling.seconds > 0.0 or (math.hypot(off_e, off_n) < max(NEAR, wide) and high < AT_HEIGHT):
        circling.seconds += dt
    around: bool = circling.seconds > UNLIMITED and abs(circling.turned) >= 2.0 * math.pi
    return around


@inner
def _begin(start: Record, estimated: Record, known: bool, out: Record) -> None:  # pragma: no cover
    """Fill in where it begins, and what is told before anything was flown."""
    estimated.east, estimated.north, estimated.up = start.east, start.north, start.up
    estimated.velocity_east, estimated.velocity_north = start.velocity_east, start.velocity_north
    estimated.velocity_up = start.velocity_up
    out.clearance = out.clearance_before = math.inf if known else math.nan
    out.threat = -1
    out.outside, out.outside_before = math.inf, math.inf
    out.to_circle, out.circle_up, out.energy, out.ended, out.rows = math.nan, math.nan, 0.0, NEVER, 0


@inner
def _fly_to(
    stages: Records, at: int, waypoints: Records, estimated: Record, own: Record
) -> None:  # pragma: no cover - compiled
    """Make a stage the next two waypoints, on a leg from here; from the waypoint before where that was reached."""
    stage, reached = stages[at], own.leg > 0
    for k in range(1, 3):
        b = waypoints[k]
        b.east, b.north, b.turn, b.airspeed = stage.east, stage.north, stage.turn, stage.airspeed
        b.centre_east, b.centre_north, b.up, b.circle = stage.centre_east, stage.centre_north, stage.up, stage.circle
        b.returns, b.slope_base, b.straight = stage.returns, stage.slope_base, stage.straight
    own.from_east, own.from_north, own.from_up = estimated.east, estimated.north, estimated.up
    if reached and not past_line(estimated, stages[at - 1].east, stages[at - 1].north, stage.east, stage.north):
        own.from_east, own.from_north, own.from_up = stages[at - 1].east, stages[at - 1].north, stages[at - 1].up
    if stage.circle == 0.0 and at + 1 < stages.shape[0]:
        after, course = stages[at + 1], math.atan2(stage.east - own.from_east, stage.north - own.from_north)
        turn = abs(wrap(math.atan2(after.east - stage.east, after.north - stage.north) - course))
        waypoints[1].turn, waypoints[2].turn = turn, turn
    own.leg, own.on_circle, own.cross_track_sum = 0, False, 0.0


@inner
def _take_over(
    start: Record, parameters: Record, aircraft: Record, excess: Floats, state: Record, own: Record
) -> None:  # pragma: no cover - compiled
    """Fill the state from what flies over the ground, and the law's memory as after a long steady flight of it.

    As `flight.autopilots.arduplane.law.begin_law` takes over, but on a slope: the height asked for is ahead by its lag.
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
    own.speed_sum = SPEED_SUM
    own.balance_sum = own.pitch_demand * state.airspeed * GRAVITY - GRAVITY * climb - SPEED_SUM
    throttle = 1.0
    while throttle > 0.0 and excess_power(excess, throttle, state.airspeed, start.up, aircraft) > climb:
        throttle -= 0.01
    own.throttle_demand, own.throttle_before = throttle, parameters.throttle_cruise
    own.throttle_sum = throttle - parameters.throttle_cruise


@inner
def _demand(
    state: Record, estimated: Record, waypoints: Records, parameters: Record, own: Record, aircraft: Record,
    excess: Floats, factor: float, unpowered: bool, dt: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Demand what the law asks for on the way to the second waypoint: side acceleration, height, throttle and pitch."""
    b = waypoints[1]
    navigate_legs(estimated, waypoints[: 2 if b.circle != 0.0 else 3], parameters, own, factor, dt)
    if own.on_circle and not b.returns:
        # On a loiter the height of its item is flown at once (`Plane::update_loiter`).
        own.from_up = b.up
    demand_height(estimated, b, parameters, own, dt)
    wanted = min(parameters.airspeed_max, max(parameters.airspeed_min, b.airspeed))
    _weigh_energies(state, estimated, parameters, own, aircraft, excess, wanted, factor, unpowered, dt)


@inner
def _weigh_energies(
    state: Record, motion: Record, parameters: Record, own: Record, aircraft: Record, excess: Floats, wanted: float,
    factor: float, unpowered: bool, dt: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Demand throttle and pitch by TECS, but in a turn without thrust the pitch that brings it to an airspeed.

    wanted: airspeed, equivalent, m/s.  In a bank it grows as the root of the load, at the same angle of attack.
    Of eight flights of ArduPlane six turned back so, and lost 55 m in their turn; the other two, which had been sinking
    before, held their height and slowed down, which costs half of that.  What is worse stands for both.
    """
    balance, speed = own.balance_sum, own.speed_sum
    update_tecs(state, motion, parameters, own, wanted * factor, factor, dt)
    if not unpowered or abs(state.roll) < _TURNS:
        return
    own.balance_sum, own.speed_sum = balance, speed
    tilt = math.tan(state.roll)
    drag = aircraft.induced / state.airspeed * tilt * tilt
    sink = drag - excess_power(excess, 0.0, state.airspeed, motion.up, aircraft)
    faster = (wanted * factor / math.sqrt(math.cos(state.roll)) - state.airspeed) / _SPEED_LAG
    path = -math.asin(min(0.5, max(-0.5, sink / state.airspeed + faster / GRAVITY)))
    own.pitch_demand = path + angle_of_attack(state, aircraft) - parameters.pitch_trim


@inner
def _look(
    here: Record,
    time: float,
    heights: Heights,
    to_pixel: PolyMapRecord,
    spheres: Floats,
    radii: Floats,
    known: bool,
    out: Record,
) -> None:  # pragma: no cover - compiled
    """Note how high above ground a place is and how far outside each sphere; whether the return ends there."""
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
        out.ended = OFF_GROUND
        return
    if clearance < out.clearance:
        if out.clearance > 0.0:
            if math.isnan(out.to_circle):
                out.clearance_before = clearance
            out.clearance_time = time
            out.clearance_east, out.clearance_north, out.clearance_up = here.east, here.north, here.up
        out.clearance = clearance
    if clearance <= -DEEPEST:
        out.ended, out.seconds = HIT, out.clearance_time
