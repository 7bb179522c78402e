"""What files of zones say beside their shapes: kind, floor and ceiling, as entries of a [[zones]] table."""

import math
from collections.abc import Mapping
from typing import Any

from world.errors import ScenarioError

# An entry that is none of a table: the zone is of a file that its reader cannot correct, an authority's, so that an
# outline that crosses itself is taken as the area it encloses.
PUBLISHED = "published"
# Another: its limits stand the wrong way round in the file.
UPSIDE_DOWN = "upside_down"
# And another: its upper limit leaves no height to keep out of, and is not taken.
NO_BAND = "no_band"
# Keys that mean what they mean in a scenario file.
_OWN = ("kind", "floor_amsl_m", "floor_agl_m", "ceiling_amsl_m", "ceiling_agl_m", "radius_m")
# A property that begins so and is none of ours, nor another's that is read, may be one of ours misspelt.
_LIKE_OURS = ("floor", "ceiling", "radius")
# openAIP's limits: the API's keys and numbers, and the keys and names of its converters from OpenAir and AIXM.
# https://docs.openaip.net, and the results in https://github.com/openAIP/openaip-openair-parser
_LIMITS = {"lowerLimit": "floor", "lowerCeiling": "floor", "upperLimit": "ceiling", "upperCeiling": "ceiling"}
_UNITS = {0: 1.0, "M": 1.0, 1: 0.3048, "FT": 0.3048, 6: 30.48, "FL": 30.48}
_DATUMS = {
    0: "agl", "GND": "agl", "AGL": "agl", "SFC": "agl", 1: "amsl", "MSL": "amsl", 2: "standard", "STD": "standard",
    "AMSL": "amsl", "WGS84": "ellipsoid",
}  # fmt: skip
# m.  A flight level is a pressure, not a height: between a low of 965 hPa and a high of 1,060 at the sea it lies up to
# this far below or above where it is at 1,013.25 hPa (27 ft per hPa, ICAO Doc 7488).
FLIGHT_LEVEL_ERROR = 400.0
# m.  Mean sea level lies between 107 m below and 86 m above the ellipsoid of WGS84 (EGM2008): what is so high above the
# ellipsoid is at most 86 m lower, and 107 m higher, above the sea.
GEOID_HIGHEST, GEOID_LOWEST = 86.0, -107.0
# What is no height above mean sea level, in words, and by how much one of them can lie below or above it, m.
_LOOSE = {
    "standard": ("a flight level", FLIGHT_LEVEL_ERROR, FLIGHT_LEVEL_ERROR),
    "ellipsoid": ("a height above the ellipsoid", GEOID_HIGHEST, -GEOID_LOWEST),
}
# m.  Heights that a table takes: no flight is beyond them.
_LOWEST, _HIGHEST = -500.0, 9000.0
# The FAA's limits in its open data (Class Airspace, Special Use Airspace): LOWER_VAL, LOWER_UOM, LOWER_CODE, and UPPER.
_FAA = {"LOWER": "lowerLimit", "UPPER": "upperLimit"}
# A value that is not applicable there.
_FAA_NONE = -9998.0


def zone_entries(properties: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Entries of a [[zones]] table that a zone's properties state; an exclusion where no kind is stated.

    A flight level bounds an exclusion by the height that it is within `FLIGHT_LEVEL_ERROR` of, and a height above the
    ellipsoid by those that it can be above the sea, on the safe side.  Raises ScenarioError for a limit that is none,
    for either of them on an inclusion, and for a property that looks like one of ours and is not.

    >>> zone_entries({"lowerLimit": {"value": 0, "unit": 1, "referenceDatum": 0}, "ceiling_agl_m": 90.0}, "a file")
    {'kind': 'exclusion', 'ceiling_agl_m': 90.0}
    """
    entries: dict[str, Any] = {"kind": "exclusion"}
    for key, value in {**_faa_limits(properties, source), **properties}.items():
        if value is None:
            continue
        if key in _LIMITS:
            entries |= _limit(value, key, properties.get("kind"), source)
        elif key in _OWN:
            entries[key] = value
        elif key.lower().startswith(_LIKE_OURS):
            raise ScenarioError.at(source, key, value, f"unknown; known are {', '.join(_OWN)}", shown="")
    if entries.get("floor_amsl_m") == _HIGHEST:
        # All of it is above every flight.
        entries.pop("ceiling_amsl_m", None)
    return entries


def published_entries(limits: Mapping[str, Any], source: str) -> dict[str, Any]:
    """As `zone_entries`, of limits that an authority states, marked `PUBLISHED`.

    In authorities' files some limits leave no height to keep out of.  A lower limit above the upper one (both above the
    sea, or both above ground) is taken for the upper, and the other way round, and marked `UPSIDE_DOWN`.  An upper
    limit of 0 or below may stand for none, or for the lower one: the zone is one of all heights.  An upper limit that
    equals the lower one is not taken.  Zones of both kinds are marked `NO_BAND`.

    >>> high, low = ({"value": feet, "unit": "FT", "referenceDatum": "MSL"} for feet in (1000, 500))
    >>> published_entries({"lowerLimit": high, "upperLimit": low}, "a file")["ceiling_amsl_m"]
    304.8
    >>> published_entries({"lowerLimit": high, "upperLimit": high}, "a file")
    {'kind': 'exclusion', 'floor_amsl_m': 304.8, 'published': True, 'no_band': True}
    """
    lower, upper = limits.get("lowerLimit"), limits.get("upperLimit")
    low, high = _compared(lower), _compared(upper)
    if high is not None and (high[1] <= 0.0 or low == high):
        entries = zone_entries({**limits, "upperLimit": None}, source)
        if high[1] <= 0.0:
            entries = {key: value for key, value in entries.items() if not key.startswith("floor")}
        return {**entries, PUBLISHED: True, NO_BAND: True}
    if low is None or high is None or low[0] != high[0] or low < high:
        return {**zone_entries(limits, source), PUBLISHED: True}
    turned = {**limits, "lowerLimit": upper, "upperLimit": lower}
    return {**zone_entries(turned, source), PUBLISHED: True, UPSIDE_DOWN: True}


def _compared(limit: Any) -> tuple[bool, float] | None:
    """Whether a limit counts from the ground, and its height, m; None where `_limit` refuses it, or there is none."""
    if not isinstance(limit, dict):
        return None
    try:
        return _DATUMS[limit["referenceDatum"]] == "agl", round(limit["value"] * _UNITS[limit["unit"]], 3)
    except (KeyError, TypeError):
        return None


def _faa_limits(properties: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Limits as the FAA writes them, as openAIP's."""
    found = {}
    for side, key in _FAA.items():
        if (value := properties.get(f"{side}_VAL")) is None:
            continue
        try:
            height = float(value)
        except (TypeError, ValueError) as error:
            raise ScenarioError.at(source, f"{side}_VAL", value, "a number is expected", shown="") from error
        if height != _FAA_NONE:
            unit, datum = properties.get(f"{side}_UOM"), properties.get(f"{side}_CODE")
            found[key] = {"value": height, "unit": unit, "referenceDatum": datum}
    return found


def _limit(value: Any, key: str, kind: Any, source: str) -> dict[str, float]:
    """The entry that one of openAIP's limits comes to; none for the ground as a floor."""
    if not isinstance(value, dict):
        allowed = "a table of value, unit and referenceDatum is expected"
        raise ScenarioError.at(source, key, value, allowed, shown="")
    height, unit, datum = value.get("value"), value.get("unit"), value.get("referenceDatum")
    if isinstance(height, bool) or not isinstance(height, int | float) or not math.isfinite(height):
        raise ScenarioError.at(source, f"{key}.value", height, "a number is expected", shown="")
    # A list, say, is not even looked for.
    if not isinstance(unit, int | str) or unit not in _UNITS:
        allowed = f"allowed {', '.join(map(str, _UNITS))}"
        raise ScenarioError.at(source, f"{key}.unit", unit, allowed, shown="")
    if not isinstance(datum, int | str) or datum not in _DATUMS:
        allowed = f"allowed {', '.join(map(str, _DATUMS))}"
        raise ScenarioError.at(source, f"{key}.referenceDatum", datum, allowed, shown="")
    side, metres, counted = _LIMITS[key], round(height * _UNITS[unit], 3), _DATUMS[datum]
    if counted == "agl" and metres <= 0.0:
        if side == "floor":
            return {}
        raise ScenarioError.at(source, key, value, "above 0 is expected: nothing lies below the ground", shown="")
    if _UNITS[unit] == _UNITS["FL"]:
        counted = "standard"
    if counted in _LOOSE:
        words, below, above = _LOOSE[counted]
        if kind == "inclusion":
            allowed = f"{words} bounds no inclusion; give a height in metres above mean sea level"
            raise ScenarioError.at(source, key, value, allowed, shown="")
        counted, metres = "amsl", metres + (above if side == "ceiling" else -below)
    return {f"{side}_{counted}_m": min(_HIGHEST, max(_LOWEST, metres))}
