"""Units in which forecasts state winds and levels."""

from collections.abc import Mapping

# Standard gravity, by which geopotential is divided to give geopotential height, m/s^2.
GRAVITY_STANDARD = 9.80665
# Fastest wind that a forecast may state, m/s: faster winds are an error of units.
MAX_WIND_MPS = 150.0
# Factors to m/s.
SPEED_UNITS: Mapping[str, float] = {"m/s": 1.0, "knots": 1852.0 / 3600.0, "km/h": 1.0 / 3.6, "mph": 0.44704}
# Factors to m.
HEIGHT_UNITS: Mapping[str, float] = {"m": 1.0, "km": 1000.0, "ft": 0.3048}
# Units of geopotential, without spaces.
GEOPOTENTIAL_UNITS = ("m2s-2", "m**2s**-2", "m^2/s^2", "m2/s2", "m^2s^-2", "J/kg", "Jkg-1", "Jkg**-1")
# Factors to hPa.
PRESSURE_UNITS: Mapping[str, float] = {"hPa": 1.0, "Pa": 0.01}
# Factors to degrees.
DIRECTION_UNITS: Mapping[str, float] = {"°": 1.0, "deg": 1.0, "degrees": 1.0}

# Other spellings of these units, without spaces and in lower case.
_SPELLINGS = {
    "ms-1": "m/s",
    "ms**-1": "m/s",
    "ms^-1": "m/s",
    "m.s-1": "m/s",
    "ms": "m/s",
    "meterspersecond": "m/s",
    "metersecond-1": "m/s",
    "kn": "knots",
    "kt": "knots",
    "kts": "knots",
    "knot": "knots",
    "mp/h": "mph",
    "kmh": "km/h",
    "kmh-1": "km/h",
    "kmh**-1": "km/h",
    "gpm": "m",
    "meter": "m",
    "meters": "m",
    "metre": "m",
    "metres": "m",
    "feet": "ft",
    "foot": "ft",
    "millibar": "hPa",
    "millibars": "hPa",
    "mb": "hPa",
    "mbar": "hPa",
    "hectopascals": "hPa",
    "hpa": "hPa",
    "pa": "Pa",
}


def unit_factor(units: object, factors: Mapping[str, float]) -> float | None:
    """Return the factor from a unit, in any known spelling, to the unit with the factor 1.

    Return None for other units.

    factors: factors by unit, such as `SPEED_UNITS`.

    >>> unit_factor("m s**-1", SPEED_UNITS), unit_factor("kt", SPEED_UNITS), unit_factor("K", SPEED_UNITS)
    (1.0, 0.5144444444444445, None)
    """
    text = str(units).replace(" ", "")
    return factors.get(text, factors.get(_SPELLINGS.get(text.lower(), "")))
