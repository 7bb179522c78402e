"""How far gusts move an aircraft up or down that cannot climb or sink as fast as they do."""

from world.wind import W20, Turbulence

# Standard deviations of a gust that one in a hundred exceeds, and how long it is taken to last, s.  Of 303 flights of
# planfly's guidance in moderate turbulence (scenarios 4000 to 4599 and 12000 to 12299 of
# `benchmarks.plans_and_verdicts`, three streams each) one leg in a hundred came down by 34 m with 0.3 to 1.2 m/s of
# climb unused, 28 with 1.4, 21 with 1.8 and 9 with 3.5.  Of 132 legs of ArduPlane with 1.3 to 1.6 m/s of sink unused
# (two streams, from 16000) three in a hundred came up by 18 m and one by 34, of 54 with 2 to 2.5 none by 19.
_SIGMAS, _LASTS = 2.33, 12.0
# Where less than this many standard deviations are left, several gusts add up, and it is moved by what one standard
# deviation moves it in this time, s: of 64 legs of ArduPlane with 0.4 to 0.7 m/s left one came up by 93 m.
LEAST_SIGMAS = 0.6
_LASTS_WITH_LESS = 60.0


def gust_deviation(turbulence: Turbulence) -> float:
    """Standard deviation of the vertical gusts near the ground, m/s (MIL-F-8785C).

    >>> round(gust_deviation("moderate"), 2)
    1.54
    """
    return 0.1 * W20[turbulence]


def height_in_gusts(rate: float, turbulence: Turbulence) -> float:
    """How far (m) a gust that one in a hundred exceeds moves an aircraft, which works against it at a rate (m/s).

    >>> round(height_in_gusts(2.0, "moderate"), 1), height_in_gusts(4.0, "moderate"), height_in_gusts(0.0, "none")
    (19.1, 0.0, 0.0)
    """
    return _LASTS * max(0.0, _SIGMAS * gust_deviation(turbulence) - rate)


def height_in_updrafts(sink: float, turbulence: Turbulence) -> float:
    """How far (m) updrafts lift an aircraft whose autopilot keeps its airspeed, by the sink (m/s) that it has unused.

    >>> round(height_in_updrafts(2.0, "moderate"), 1), round(height_in_updrafts(0.5, "moderate"), 1)
    (19.1, 92.4)
    """
    deviation = gust_deviation(turbulence)
    if sink < LEAST_SIGMAS * deviation:
        return _LASTS_WITH_LESS * deviation
    return height_in_gusts(sink, turbulence)
