"""What files of zones say beside their shapes: kind, floor and ceiling, as entries of a [[zones]] table."""

from collections.abc import Mapping
from typing import Any

from world.errors import ScenarioError

# Keys that mean what they mean in a scenario file.
_OWN = ("kind", "floor_amsl_m", "floor_agl_m", "ceiling_amsl_m", "ceiling_agl_m", "radius_m")
# A property that begins so and is none of ours, nor another's that is read, may be one of ours misspelt.
_LIKE_OURS = ("floor", "ceiling", "radius")
# openAIP's limits: the API's keys and numbers, and the keys and names of its converters from OpenAir and AIXM.
# https://docs.openaip.net, and the results in https://github.com/openAIP/openaip-openair-parser
_LIMITS = {"lowerLimit": "floor", "lowerCeiling": "floor", "upperLimit": "ceiling", "upperCeiling": "ceiling"}
_UNITS = {0: 1.0, "M": 1.0, 1: 0.3048, "FT": 0.3048, 6: 30.48, "FL": 30.48}
_DATUMS = {0: "agl", "GND": "agl", 1: "amsl", "MSL": "amsl", 2: "standard", "STD": "standard"}
# m.  A flight level is a pressure, not a height: between a low of 965 hPa and a high of 1,060 at the sea it lies up to
# this far below or above where it is at 1,013.25 hPa (27 ft per hPa, ICAO Doc 7488).
FLIGHT_LEVEL_ERROR = 400.0


def zone_entries(properties: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Entries of a [[zones]] table that a zone's properties state; an exclusion where no kind is stated.

    A flight level bounds an exclusion by the height that it is within `FLIGHT_LEVEL_ERROR` of, on the safe side.
    Raises ScenarioError for a limit that is none, for a flight level of an inclusion, and for a property that looks
    like one of ours and is not.

    >>> zone_entries({"lowerLimit": {"value": 0, "unit": 1, "referenceDatum": 0}, "ceiling_agl_m": 90.0}, "a file")
    {'kind': 'exclusion', 'ceiling_agl_m': 90.0}
    """
    entries: dict[str, Any] = {"kind": "exclusion"}
    for key, value in properties.items():
        if value is None:
            continue
        if key in _LIMITS:
            entries |= _limit(value, key, properties.get("kind"), source)
        elif key in _OWN:
            entries[key] = value
        elif key.lower().startswith(_LIKE_OURS):
            raise ScenarioError.at(source, key, value, f"unknown; known are {', '.join(_OWN)}", shown="")
    return entries


def _limit(value: Any, key: str, kind: Any, source: str) -> dict[str, float]:
    """The entry that one of openAIP's limits comes to; none for the ground as a floor."""
    if not isinstance(value, dict):
        allowed = "a table of value, unit and referenceDatum is expected"
        raise ScenarioError.at(source, key, value, allowed, shown="")
    height, unit, datum = value.get("value"), value.get("unit"), value.get("referenceDatum")
    if isinstance(height, bool) or not isinstance(height, int | float):
        raise ScenarioError.at(source, f"{key}.value", height, "a number is expected", shown="")
    # A list, say, is not even looked for.
    if not isinstance(unit, int | str) or unit not in _UNITS:
        allowed = f"allowed {', '.join(map(str, _UNITS))}"
        raise ScenarioError.at(source, f"{key}.unit", unit, allowed, shown="")
    if not isinstance(datum, int | str) or datum not in _DATUMS:
        allowed = f"allowed {', '.join(map(str, _DATUMS))}"
        raise ScenarioError.at(source, f"{key}.referenceDatum", datum, allowed, shown="")
    side, metres, counted = _LIMITS[key], round(height * _UNITS[unit], 3), _DATUMS[datum]
    if side == "floor" and counted == "agl" and metres <= 0.0:
        return {}
    if counted == "standard" or _UNITS[unit] == _UNITS["FL"]:
        if kind == "inclusion":
            allowed = "a flight level bounds no inclusion; give a height in metres"
            raise ScenarioError.at(source, key, value, allowed, shown="")
        # Beyond the heights that a table takes there is no flight to bound.
        wider = metres + (FLIGHT_LEVEL_ERROR if side == "ceiling" else -FLIGHT_LEVEL_ERROR)
        return {f"{side}_amsl_m": min(9000.0, max(-500.0, wider))}
    return {f"{side}_{counted}_m": metres}
