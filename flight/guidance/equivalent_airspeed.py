"""True airspeed by equivalent airspeed, which is what airspeed sensors measure and autopilots are told in."""

from world.kernels import compiled

# The international standard atmosphere below 11 km: temperature falls by this share of sea level's a metre, and density
# with that power of the temperature.
_LAPSE, _DENSITY_POWER = 2.25577e-5, 4.25588
# Highest that the ratio is worked out for, m.
_HIGHEST = 11_000.0


@compiled
def true_by_equivalent(amsl: float) -> float:  # pragma: no cover - compiled
    """True airspeed by equivalent airspeed in the standard atmosphere at a height, m; 1.05 at 1,000 m."""
    ratio: float = (1.0 - _LAPSE * min(_HIGHEST, amsl)) ** (-0.5 * _DENSITY_POWER)
    return ratio
