"""How far PX4 strays from the legs of a plan with its parameters: corners flown by its own law on the plane.

Each corner is flown in still air, at a constant ground speed, by `flight.autopilots.px4.navigator` and the lag of the
bank.  In wind, the still air's excursion at the highest ground speed on the way is the measure, and `WIND_SPREAD` more.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from aircraft.tracking import SPEED_SHARES, TURNS, TrackingError
from flight.autopilots.px4.lateral import wanted_bank
from flight.autopilots.px4.law import PX4_MEMORY, ROLL_LAG
from flight.autopilots.px4.navigator import navigate, reach_radius
from flight.autopilots.px4.parameters import Px4Parameters
from flight.guidance.lateral_reference_laws import waypoint_column
from flight.guidance.navigation_error import ERRORS, MOTION
from world.kernels import Record, Records, compiled, field_names, inner, record_dtype
from world.scenario_tables import Navigation
from world.wind import W20, Turbulence

Floats = NDArray[np.float64]

# A corner counts as left where the aircraft stays this near to the next leg (m) for so long (s).
_SETTLED, _STAYS = 2.0, 8.0
# From a corner the legs reach this far, m; flights end there at the latest, and begin so far before they may turn.
_LEG, _BEFORE = 4000.0, 200.0
# Time step of these flights, s.
_STEP = 0.05
# What is left for the wind, as a share of still air's excursion, and more of it at a right angle: what it made of
# ArduPlane's corners (`flight.autopilots.arduplane.tracking_error`), which knows no wind as PX4's guidance does.
WIND_SPREAD = 1.1, 0.5
# Of navigation's standard deviation, what is left room for.
_SIGMAS = 3.0
# Beside straight legs and from its lagged height in light turbulence, navigation left out, m.
_ACROSS, _UP = 2.0, 3.0
# Of FW_T_CLMB_R_SP and FW_T_SINK_R_SP, the share that a plan asks for, by turbulence: slopes are flown steeper than
# they are drawn, for they are done a loiter's radius early, and what is missing at a waypoint is circled for.
_SHARE = {"none": 0.8, "light": 0.7, "moderate": 0.6}
# The same of what the aircraft itself can climb and sink: a gust that lasts as long as a leg leaves less of it, and
# where PX4 comes to a waypoint more than NAV_FW_ALT_RAD off its height, it circles. In light turbulence the Zagi's
# slopes over 4 km at 0.9 of it ended in circles in 2 (up) and 6 (down) of 6 streams, at 0.6 (0.7 less the margin of
# plans) in none and 1. In still air it flew 0.98 of it within 6 m: nothing is left there.
_SLOPE_SHARE = _SHARE | {"none": 1.0}

# Standard deviation of the height in moderate turbulence where the aircraft has enough in hand, m: 3.7 of PX4's law
# and Dryden's gusts worked out at 15 to 27 m/s, 3.7 (Aerosonde) and 4.2 (Ultra Stick) in 84 flights.
_THROWN = 4.0
# What a gust beyond what the aircraft has in hand is taken to last, s: with it 74 of 1,860 waypoints in 186 flights of
# four aircraft are expected to be passed more than 10 m off their heights, and 58 were.
_GUST_LASTS = 6.0


def tracking_error(
    parameters: Px4Parameters,
    airspeed: float,
    nav: Navigation,
    *,
    turbulence: Turbulence = "none",
) -> TrackingError:
    """What a plan leaves free for PX4 with these parameters, at an equivalent airspeed (m/s).

    nav: how well it knows where it is.  turbulence: of the wind.

    >>> from flight.autopilots.px4.parameters import Px4Parameters
    >>> error = tracking_error(Px4Parameters.defaults("1.16"), 25.0, "gnss")
    >>> round(error.lag, 3), error.corner_acceptance(math.radians(30.0), 25.0)
    (3.5, 56.0)
    """
    acceptance, excursion, before, after = _corners(parameters, airspeed)
    known = _SIGMAS * ERRORS[nav][0]
    made = parameters
    return TrackingError(
        airspeed=airspeed,
        acceptance=acceptance,
        excursion=excursion,
        before=before,
        after=after,
        across=math.hypot(_ACROSS, known),
        up=math.hypot(_UP, known),
        lag=(1.0 - made["FW_T_HRATE_FF"]) * made["FW_T_ALT_TC"],
        step=0.0,
        climb_rate=_SHARE[turbulence] * min(made["FW_T_CLMB_R_SP"], made["FW_T_CLMB_MAX"]),
        sink_rate=_SHARE[turbulence] * min(made["FW_T_SINK_R_SP"], made["FW_T_SINK_MAX"]),
        own_climb_share=_SLOPE_SHARE[turbulence],
        own_sink_share=_SLOPE_SHARE[turbulence],
    )


def off_height_chance(acceptance: float, climb: float, sink: float, turbulence: Turbulence) -> float:
    """Chance (0..1) that gusts have an aircraft further from a waypoint's height than it may be where it arrives there.

    acceptance: NAV_FW_ALT_RAD, m.  climb, sink: what the aircraft has in hand, m/s: an up- or downdraft that exceeds it
    carries the aircraft off until it ends.  Looked at in moderate turbulence alone, 0 in any other.

    >>> round(off_height_chance(10.0, 4.0, 4.0, "moderate"), 3), off_height_chance(10.0, 4.0, 4.0, "light")
    (0.013, 0.0)
    """
    if turbulence != "moderate":
        return 0.0
    gust, more = 0.1 * W20[turbulence], acceptance / _GUST_LASTS
    return 2.0 * _beyond(acceptance / _THROWN) + _beyond((climb + more) / gust) + _beyond((sink + more) / gust)


def _beyond(deviations: float) -> float:
    """Chance of a normal variable beyond this many standard deviations, to one side."""
    return 0.5 * math.erfc(deviations / math.sqrt(2.0))


# How a corner is tracked, m: turned at which distance, how far from its legs, along how much of each.
CORNER_TRACKING = record_dtype("acceptance", "excursion", "before", "after")


@lru_cache(maxsize=8)
def _corners(parameters: Px4Parameters, airspeed: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Tables (turns, speeds) of acceptance, excursion, and lengths of the legs before and after, m."""
    corners = np.zeros((TURNS.size, SPEED_SHARES.size), CORNER_TRACKING)
    _fill(parameters.record(), airspeed, TURNS, SPEED_SHARES * airspeed, corners, waypoint_column(3))
    share, more = WIND_SPREAD
    corners["excursion"] *= (share + more * (TURNS / (0.5 * math.pi)) ** 2)[:, None]
    # Plans are the same on every machine, and a library's sines are not.
    acceptance, excursion, before, after = (corners[name].round(2) for name in field_names(CORNER_TRACKING))
    for table in (acceptance, excursion, before, after):
        table.setflags(write=False)
    return acceptance, excursion, before, after


@compiled
def _fill(
    parameters: Record, airspeed: float, turns: Floats, speeds: Floats, corners: Records, waypoints: Records
) -> None:  # pragma: no cover - compiled
    """Fill `CORNER_TRACKING` records (turns, speeds) by flights along three waypoints."""
    for i in range(turns.size):
        for j in range(speeds.size):
            corner = corners[i, j]
            corner.acceptance = reach_radius(speeds[j], parameters)
            if turns[i] > 0.0:
                corner.before = corner.acceptance
                corner.excursion, corner.after = _fly_corner(parameters, airspeed, turns[i], speeds[j], waypoints)


@inner
def _fly_corner(
    parameters: Record, airspeed: float, turn: float, speed: float, waypoints: Records
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Furthest from the two legs, and how far along the second one until it stays near to it, m.

    The first leg leads north to the origin.  turn: rad, to the right.  speed: over the ground, m/s.
    """
    motions, memories = np.zeros(1, MOTION), np.zeros(1, PX4_MEMORY)
    estimated, own = motions[0], memories[0]
    east, north = math.sin(turn), math.cos(turn)
    waypoints[0].north = -_LEG
    waypoints[2].east, waypoints[2].north = _LEG * east, _LEG * north
    own.from_north, own.nearest = -_LEG, math.inf
    way = speed * _STEP
    estimated.north = -reach_radius(speed, parameters) - _BEFORE
    lag = ROLL_LAG * parameters.roll_time
    left = math.exp(-_STEP / lag)
    course, side, clock, furthest, settled, along = 0.0, 0.0, 0.0, 0.0, 0.0, -1.0
    while along < 0.75 * _LEG and clock < 120.0:
        estimated.velocity_east, estimated.velocity_north = speed * math.sin(course), speed * math.cos(course)
        navigate(estimated, waypoints, 0.0, 0.0, airspeed, parameters, own, _STEP)
        wanted = GRAVITY * math.tan(wanted_bank(own.side_acceleration, parameters))
        # The lag to the letter, and the way on the mean course.
        turned = (wanted * _STEP + (side - wanted) * lag * (1.0 - left)) / speed
        side = wanted + (side - wanted) * left
        estimated.east += way * math.sin(course + 0.5 * turned)
        estimated.north += way * math.cos(course + 0.5 * turned)
        course += turned
        clock += _STEP
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
