"""Compute the altitude gain or loss from gusts that exceed an aircraft's climb or sink rate."""

from world.wind import W20, Turbulence

# Gust with an exceedance probability of 1 %, in standard deviations.
_GUST_SIGMAS = 2.33
# Assumed duration of that gust, s. In 303 flights of planfly's guidance in moderate turbulence (scenarios 4000 to 4599
# and 12000 to 12299 of `benchmarks.plans_and_verdicts`, three streams each) one leg in a hundred sank by 34 m with 0.3
# to 1.2 m/s of spare climb rate, by 28 m with 1.4 m/s, by 21 m with 1.8 m/s and by 9 m with 3.5 m/s. Of 132 legs of
# ArduPlane with 1.3 to 1.6 m/s of spare sink rate (two streams, from 16000) three in a hundred rose by 18 m and one by
# 34 m; of 54 legs with 2 to 2.5 m/s none rose by 19 m.
_GUST_DURATION_S = 12.0
# Spare rate below which several gusts add up, in standard deviations.
MIN_SPARE_RATE_SIGMAS = 0.6
# Time for which the aircraft then drifts at one standard deviation of the gust, s: of 64 legs of ArduPlane with 0.4 to
# 0.7 m/s of spare rate one leg rose by 93 m.
_LOW_RATE_DURATION_S = 60.0


def gust_deviation(turbulence: Turbulence) -> float:
    """Return the standard deviation of vertical gusts near the ground, m/s (MIL-F-8785C).

    It is a tenth of the wind speed at 20 ft that defines the turbulence.

    >>> round(gust_deviation("moderate"), 2)
    1.54
    """
    return 0.1 * W20[turbulence]


def gust_displacement(opposing_rate: float, turbulence: Turbulence) -> float:
    """Return the vertical displacement by a gust, m, that is exceeded with a probability of 1 %.

    opposing_rate: climb or sink rate with which the aircraft opposes the gust, m/s.

    >>> round(gust_displacement(2.0, "moderate"), 1), gust_displacement(4.0, "moderate"), gust_displacement(0.0, "none")
    (19.1, 0.0, 0.0)
    """
    return _GUST_DURATION_S * max(0.0, _GUST_SIGMAS * gust_deviation(turbulence) - opposing_rate)


def updraft_altitude_gain(sink_reserve: float, turbulence: Turbulence) -> float:
    """Return the altitude (m) that an aircraft gains in updrafts if its autopilot holds the airspeed.

    sink_reserve: sink rate that the aircraft does not use, m/s.

    >>> round(updraft_altitude_gain(2.0, "moderate"), 1), round(updraft_altitude_gain(0.5, "moderate"), 1)
    (19.1, 92.4)
    """
    deviation = gust_deviation(turbulence)
    if sink_reserve < MIN_SPARE_RATE_SIGMAS * deviation:
        return _LOW_RATE_DURATION_S * deviation
    return gust_displacement(sink_reserve, turbulence)
