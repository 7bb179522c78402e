"""Convert equivalent airspeed, which sensors measure and autopilots use, to true airspeed."""

from world.kernels import compiled

# Relative temperature decrease per meter in the standard atmosphere below 11 km, 1/m.
_LAPSE_PER_M = 2.25577e-5
# Power of the relative temperature in the relative density.
_DENSITY_POWER = 4.25588
# Largest altitude of this model, m.
_MAX_ALTITUDE_M = 11_000.0


@compiled
def eas_to_tas_ratio(amsl: float) -> float:
    """Return the ratio of true to equivalent airspeed in the standard atmosphere at an altitude (m AMSL).

    The ratio is 1.05 at 1,000 m.
    """
    return (1.0 - _LAPSE_PER_M * min(_MAX_ALTITUDE_M, amsl)) ** (-0.5 * _DENSITY_POWER)
