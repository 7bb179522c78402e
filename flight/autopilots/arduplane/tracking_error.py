"""How far ArduPlane strays from the legs of a plan with its parameters: corners flown by its own law on the plane.

Each corner is flown in still air, at a constant ground speed, by `flight.autopilots.arduplane.law` and the lag of its
bank, and the acceptance radius with which it strays least is looked for.  In wind, the still air's excursion at the
highest ground speed on the way is the measure; `WIND_SPREAD` is how much more the wind made of it.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from aircraft.tracking import SPEED_SHARES, TURNS, TrackingError
from flight.autopilots.arduplane.law import (
    ARDUPILOT_MEMORY,
    NAVIGATION_TICK,
    ROLL_LAG,
    roll_demand,
)
from flight.autopilots.arduplane.navigator import MAX_ACCEPTANCE, navigate_legs
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.guidance.lateral_reference_laws import waypoint_column
from flight.guidance.navigation_error import ERRORS, MOTION
from world.kernels import Record, Records, compiled, field_names, inner, record_dtype
from world.scenario_tables import Navigation
from world.wind import Turbulence

Floats = NDArray[np.float64]

# A corner counts as left where the aircraft stays this near to the next leg (m) for so long (s).
_SETTLED, _STAYS = 2.0, 8.0
# From a corner the legs reach this far, m; flights end there at the latest, and begin so far before they may turn.
_LEG, _BEFORE = 4000.0, 200.0
# Acceptances that are tried: so many, and again about the best.
_TRIED, _ROUNDS = 9, 2
# Least acceptance, m: that of a straight leg, which navigation and gusts leave it far inside.
MIN_ACCEPTANCE = 15.0
# What wind made of still air's excursion at the highest ground speed: of 200 corners of 15 to 90 degrees at 25 m/s, in
# 5 and 10 m/s from anywhere, at most 1.17 up to 45 degrees, 1.22 at 60 and 1.54 at 90.
WIND_SPREAD = 1.1, 0.5
# Of navigation's standard deviation, what is left room for.
_SIGMAS = 3.0
# How far ArduPlane was beside straight legs in light turbulence, m, and from its lagged height, navigation left out.
_ACROSS, _UP = 2.0, 3.0
# Of TECS_CLMB_MAX and TECS_SINK_MAX, the share that a plan asks for, by turbulence.  Where a climb takes all the
# throttle there is, the height demand waits, and its rate is brought down: 200 m of climb at more than this left the
# Aerosonde 8 to 60 m below its lagged height, at this hardly further than the same gusts do at 2 m/s (four streams).
_CLIMB_SHARE = {"none": 0.9, "light": 0.65, "moderate": 0.45}
_SINK_SHARE = {"none": 0.9, "light": 0.81, "moderate": 0.72}
# Of what the aircraft itself can climb, where thin air leaves it less than that: at 0.9 of it in light turbulence a
# downdraft of 40 s took an Aerosonde at 2,900 m 2 m below its clearance; at 0.8 seven streams left 13 m and more.
_OWN_CLIMB_SHARE = {"none": 1.0, "light": 0.8, "moderate": 0.7}


def tracking_error(
    parameters: ArduPilotParameters,
    airspeed: float,
    nav: Navigation,
    *,
    fly_over: bool = False,
    turbulence: Turbulence = "none",
) -> TrackingError:
    """What a plan leaves free for ArduPlane with these parameters, at an equivalent airspeed (m/s).

    nav: how well it knows where it is.  fly_over: whether it flies on to each waypoint before it turns.
    turbulence: of the wind; gusts leave less of the throttle for a climb.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> parameters = ArduPilotParameters.defaults().changed(AIRSPEED_MIN=18.0, AIRSPEED_MAX=31.0)
    >>> error = tracking_error(parameters, 25.0, "gnss")
    >>> error.lag, error.step, 40.0 < error.corner_acceptance(math.radians(30.0), 25.0) < 60.0
    (3.0, 15.0, True)
    """
    acceptance, excursion, before, after = _corners(parameters, airspeed, fly_over)
    known = _SIGMAS * ERRORS[nav][0]
    return TrackingError(
        airspeed=airspeed,
        acceptance=acceptance,
        excursion=excursion,
        before=before,
        after=after,
        across=math.hypot(_ACROSS, known),
        up=math.hypot(_UP, known),
        lag=parameters.tecs_height_demand_time,
        step=parameters.glide_slope_min,
        climb_rate=_CLIMB_SHARE[turbulence] * parameters.tecs_climb_max,
        sink_rate=_SINK_SHARE[turbulence] * parameters.tecs_sink_max,
        own_climb_share=_OWN_CLIMB_SHARE[turbulence],
    )


# How a corner is tracked, m: by which acceptance, how far from its legs, along how much of each.
CORNER_TRACKING = record_dtype("acceptance", "excursion", "before", "after")


@lru_cache(maxsize=8)
def _corners(parameters: ArduPilotParameters, airspeed: float, fly_over: bool) -> tuple[Floats, Floats, Floats, Floats]:
    """Tables (turns, speeds) of acceptance, excursion, and lengths of the legs before and after, m."""
    corners = np.zeros((TURNS.size, SPEED_SHARES.size), CORNER_TRACKING)
    record, speeds = parameters.record(), SPEED_SHARES * airspeed
    _fill(record, airspeed, TURNS, speeds, fly_over, corners, waypoint_column(3))
    share, more = WIND_SPREAD
    corners["excursion"] *= (share + more * (TURNS / (0.5 * math.pi)) ** 2)[:, None]
    # Plans are the same on every machine, and a library's sines are not.
    acceptance, excursion, before, after = (corners[name].round(2) for name in field_names(CORNER_TRACKING))
    for table in (acceptance, excursion, before, after):
        table.setflags(write=False)
    return acceptance, excursion, before, after


@compiled
def _fill(
    parameters: Record,
    airspeed: float,
    turns: Floats,
    speeds: Floats,
    fly_over: bool,
    corners: Records,
    waypoints: Records,
) -> None:  # pragma: no cover - compiled
    """Fill `CORNER_TRACKING` records (turns, speeds) by flights along three waypoints."""
    for i in range(turns.size):
        for j in range(speeds.size):
            corner = corners[i, j]
            if turns[i] == 0.0:
                corner.acceptance = MIN_ACCEPTANCE
                continue
            low, high = MIN_ACCEPTANCE, MAX_ACCEPTANCE
            best, nearest = low, math.inf
            for _ in range(1 if fly_over else _ROUNDS):
                step = (high - low) / (_TRIED - 1)
                for k in range(1 if fly_over else _TRIED):
                    acceptance = math.floor(low + k * step)
                    flown = _fly_corner(parameters, airspeed, turns[i], speeds[j], acceptance, fly_over, waypoints)
                    if flown[0] < nearest:
                        best, nearest = acceptance, flown[0]
                        corner.excursion, corner.after = flown
                low, high = max(MIN_ACCEPTANCE, best - step), min(MAX_ACCEPTANCE, best + step)
            corner.acceptance = best
            corner.before = 0.0 if fly_over else best


@inner
def _fly_corner(
    parameters: Record,
    airspeed: float,
    turn: float,
    speed: float,
    acceptance: float,
    fly_over: bool,
    waypoints: Records,
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Furthest from the two legs, and how far along the second one until it stays near to it, m.

    The first leg leads north to the origin.  turn: rad, to the right.  speed: over the ground, m/s.
    """
    motions, memories = np.zeros(1, MOTION), np.zeros(1, ARDUPILOT_MEMORY)
    estimated, own = motions[0], memories[0]
    east, north = math.sin(turn), math.cos(turn)
    waypoints[0].north = -_LEG
    waypoints[1].turn, waypoints[1].acceptance, waypoints[1].fly_over = turn, acceptance, fly_over
    waypoints[2].east, waypoints[2].north = _LEG * east, _LEG * north
    own.from_north = -_LEG
    # Between two of its looks the waypoint comes within the acceptance: in the middle, which is what they come to.
    tick = speed * NAVIGATION_TICK
    estimated.north = -acceptance - (math.floor(_BEFORE / tick) + 0.5) * tick
    lag = ROLL_LAG * parameters.roll_time
    left = math.exp(-NAVIGATION_TICK / lag)
    course, side, clock, furthest, settled, along = 0.0, 0.0, 0.0, 0.0, 0.0, -1.0
    while along < 0.75 * _LEG and clock < 120.0:
        estimated.velocity_east, estimated.velocity_north = speed * math.sin(course), speed * math.cos(course)
        navigate_legs(estimated, waypoints, parameters, own, 1.0, NAVIGATION_TICK)
        wanted = GRAVITY * math.tan(roll_demand(own.side_acceleration, 0.0, airspeed, parameters))
        # The lag to the letter, and the way on the mean course.
        turned = (wanted * NAVIGATION_TICK + (side - wanted) * lag * (1.0 - left)) / speed
        side = wanted + (side - wanted) * left
        estimated.east += tick * math.sin(course + 0.5 * turned)
        estimated.north += tick * math.cos(course + 0.5 * turned)
        course += turned
        clock += NAVIGATION_TICK
        along = estimated.east * east + estimated.north * north
        away = math.hypot(estimated.east, estimated.north)
        first = abs(estimated.east) if estimated.north < 0.0 else away
        second = abs(estimated.east * north - estimated.north * east) if along > 0.0 else away
        furthest = max(furthest, min(first, second))
        if own.leg == 1 and second > _SETTLED:
            settled = max(0.0, along)
        if own.leg == 1 and along > settled + _STAYS * speed:
            break
    # Compiled code frees an array after its last use, and a record of it does not count as one.
    if motions.size + memories.size != 2:
        return math.nan, math.nan
    return furthest, settled
