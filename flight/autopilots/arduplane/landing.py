"""Compute ArduPlane's landing glide and the height of its go-around.

From the waypoint before the landing point ArduPlane flies a straight slope to the start of the flare. The height of
the flare is the sink rate of the slope times LAND_FLARE_SEC, at most twice LAND_FLARE_ALT; its length is the distance
flown while the sink rate falls to TECS_LAND_SINK. Follows
`AP_Landing::type_slope_setup_landing_glide_slope` and `type_slope_get_target_airspeed_cm`
(libraries/AP_Landing/AP_Landing_Slope.cpp) in ArduPlane 4.6.
"""

from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.parts import LandingGlide

# Limit of the flare's length, as a fraction of the distance from the waypoint to the landing point.
_MAX_FLARE_FRACTION = 0.5
# Lower limit of the ground speed in the computation of the glide, m/s.
_MIN_GROUND_SPEED_MPS = 0.5
# Lower limit of the mean sink rate in the flare, m/s.
_MIN_SINK_MPS = 0.1
# Default height of a go-around above home, m, if neither the landing item nor a take-off states one.
_GO_AROUND_HEIGHT_M = 30.0


def landing_airspeed(parameters: ArduPilotParameters, tail_wind: float) -> float:
    """Return the equivalent airspeed on the landing glide, m/s.

    The airspeed is TECS_LAND_ARSPD, or by default midway between AIRSPEED_MIN and AIRSPEED_CRUISE. It is increased in a
    head wind, but never exceeds AIRSPEED_CRUISE.

    tail_wind: m/s, negative for a head wind.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> default = ArduPilotParameters.defaults()  # minimum 9, cruise 12
    >>> [landing_airspeed(default, wind) for wind in (3.0, 0.0, -2.0, -8.0)]
    [10.5, 10.5, 11.5, 12.0]
    >>> landing_airspeed(ArduPilotParameters.defaults().changed(TECS_LAND_ARSPD=14.0), 0.0)
    12.0
    """
    cruise, stated_airspeed = parameters.airspeed_cruise, parameters.landing_airspeed
    calm_airspeed = stated_airspeed if stated_airspeed >= 0.0 else 0.5 * (cruise + parameters.airspeed_min)
    return min(calm_airspeed + parameters.landing_head_wind * max(0.0, -tail_wind), cruise)


def landing_glide(height: float, distance: float, ground_speed: float, parameters: ArduPilotParameters) -> LandingGlide:
    """Return ArduPlane's glide from the last waypoint to the landing point.

    height: height of the waypoint above the landing point, m.
    distance: distance of the waypoint from the landing point, m.
    ground_speed: m/s.

    From a height of 54 m over 600 m at 20 m/s the sink rate is 1.8 m/s. The flare starts 2 s above the ground, at
    3.6 m. It lasts 3.6 / (0.125 + 0.9) s, in which the aircraft flies 70 m.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> glide = landing_glide(54.0, 600.0, 20.0, ArduPilotParameters.defaults())
    >>> [round(number, 3) for number in glide]
    [0.095, 3.6, 70.244]

    The mean sink rate in the flare is at least 0.1 m/s, also with TECS_LAND_SINK 0.05 m/s. A flare of 1 m, which is
    twice LAND_FLARE_ALT, then takes 10 s.

    >>> gentle = ArduPilotParameters.defaults().changed(TECS_LAND_SINK=0.05, LAND_FLARE_AIM=100.0, LAND_FLARE_ALT=0.5)
    >>> [round(landing_glide(54.0, 600.0, 20.0, gentle)[k], 3) for k in (1, 2)]
    [1.0, 200.0]
    """
    speed = max(_MIN_GROUND_SPEED_MPS, ground_speed)
    sink_rate = height * speed / distance
    flare_height = parameters.flare_time * sink_rate or parameters.flare_height
    if parameters.flare_height > 0.0:
        flare_height = min(flare_height, 2.0 * parameters.flare_height)
    mean_sink = parameters.flare_weight * parameters.landing_sink + (1.0 - parameters.flare_weight) * sink_rate
    flare_distance = min(speed * flare_height / max(_MIN_SINK_MPS, mean_sink), _MAX_FLARE_FRACTION * distance)
    return LandingGlide((height - flare_height) / (distance - flare_distance), flare_height, flare_distance)


def go_around_height(stated_height: float, takeoff_height: float) -> float:
    """Return the height of a go-around above home, m.

    The landing item states the height. Otherwise the height of the take-off applies, or 30 m without a take-off.

    stated_height: height that the landing item states, m; 0 if it states none.
    takeoff_height: height of the take-off item above home, m; 0 without a take-off.

    >>> go_around_height(50.0, 80.0), go_around_height(0.0, 80.0), go_around_height(0.0, 0.0)
    (50.0, 80.0, 30.0)
    """
    return next((height for height in (stated_height, takeoff_height) if height > 0.0), _GO_AROUND_HEIGHT_M)
