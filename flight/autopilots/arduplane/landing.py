"""How ArduPlane lands: the glide that it lays out at the waypoint before the landing point, and its go-around.

From that waypoint it flies a straight slope to a point before and above the landing point, where the flare is to begin:
so high that the slope's sink takes LAND_FLARE_SEC to the ground, but no higher than twice LAND_FLARE_ALT, and so far
before the point as it flies over the ground while the sink falls to TECS_LAND_SINK.  The law is that of
`AP_Landing::type_slope_setup_landing_glide_slope` and `type_slope_get_target_airspeed_cm`
(libraries/AP_Landing/AP_Landing_Slope.cpp) in ArduPlane 4.6.
"""

from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.autopilot import LandingGlide

# The flare begins on the second half of the way at the earliest.
_LATEST_HALF = 0.5
# Slower over the ground than this it does not count itself, and slower than this it does not sink in its flare, m/s.
_SLOWEST, _MIN_SINK = 0.5, 0.1
# Height over home that a go-around climbs to where neither the landing item nor a take-off says one, m.
_GO_AROUND = 30.0


def landing_airspeed(parameters: ArduPilotParameters, tail_wind: float) -> float:
    """Equivalent airspeed on the glide, m/s: between minimum and cruise, faster against the wind up to the cruise's.

    No landing is faster than the cruise, whatever TECS_LAND_ARSPD says.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> default = ArduPilotParameters.defaults()  # minimum 9, cruise 12
    >>> [landing_airspeed(default, wind) for wind in (3.0, 0.0, -2.0, -8.0)]
    [10.5, 10.5, 11.5, 12.0]
    >>> landing_airspeed(ArduPilotParameters.defaults().changed(TECS_LAND_ARSPD=14.0), 0.0)
    12.0
    """
    cruise, stated = parameters.airspeed_cruise, parameters.landing_airspeed
    base = stated if stated >= 0.0 else 0.5 * (cruise + parameters.airspeed_min)
    return min(base + parameters.landing_head_wind * max(0.0, -tail_wind), cruise)


def landing_glide(height: float, run: float, ground_speed: float, parameters: ArduPilotParameters) -> LandingGlide:
    """The glide to a landing point from a waypoint so high over it and so far before it, m.

    ground_speed: m/s.

    At 20 m/s over 600 m the sink from 54 m is 1.8 m/s, and the flare's two seconds 3.6 m; the flare lasts
    3.6 / (0.125 + 0.9) s, which is 70 m of way.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> glide = landing_glide(54.0, 600.0, 20.0, ArduPilotParameters.defaults())
    >>> [round(number, 3) for number in glide]
    [0.095, 3.6, 70.244]

    A flare at TECS_LAND_SINK alone, 0.05 m/s, counts as one at 0.1: 1 m, twice LAND_FLARE_ALT, takes 10 s.

    >>> gentle = ArduPilotParameters.defaults().changed(TECS_LAND_SINK=0.05, LAND_FLARE_AIM=100.0, LAND_FLARE_ALT=0.5)
    >>> [round(landing_glide(54.0, 600.0, 20.0, gentle)[k], 3) for k in (1, 2)]
    [1.0, 200.0]
    """
    speed = max(_SLOWEST, ground_speed)
    sink = height * speed / run
    aim = parameters.flare_time * sink or parameters.flare_height
    if parameters.flare_height > 0.0:
        aim = min(aim, 2.0 * parameters.flare_height)
    mean = parameters.flare_weight * parameters.landing_sink + (1.0 - parameters.flare_weight) * sink
    away = min(speed * aim / max(_MIN_SINK, mean), _LATEST_HALF * run)
    return LandingGlide((height - aim) / (run - away), aim, away)


def go_around_height(asked: float, takeoff: float) -> float:
    """Height over home that a go-around climbs to, m: the landing item's, or the take-off's, or 30 m.

    >>> go_around_height(50.0, 80.0), go_around_height(0.0, 80.0), go_around_height(0.0, 0.0)
    (50.0, 80.0, 30.0)
    """
    return next((height for height in (asked, takeoff) if height > 0.0), _GO_AROUND)
