"""Convert the kind, floor and ceiling of a zone in a file to entries of a [[zones]] table."""

import math
from collections.abc import Mapping
from typing import Any

from world.errors import ScenarioError

# Three marks among the entries of a zone that are not keys of a [[zones]] table.
# The zone is from an authority's file, which the user cannot correct: a self-crossing outline is taken as the area it
# encloses.
PUBLISHED = "published"
# The lower and upper limits are swapped in the file.
UPSIDE_DOWN = "upside_down"
# The upper limit leaves an empty vertical band and is ignored.
NO_BAND = "no_band"
# Keys with the same meaning as in a scenario file.
_SCENARIO_KEYS = ("kind", "floor_amsl_m", "floor_agl_m", "ceiling_amsl_m", "ceiling_agl_m", "radius_m")
# An unknown property with one of these prefixes is probably a misspelt key of a scenario file.
_SCENARIO_KEY_PREFIXES = ("floor", "ceiling", "radius")
# Limits in openAIP's form: keys and codes of the API, and keys and names of its converters from OpenAir and AIXM.
# https://docs.openaip.net, and the results in https://github.com/openAIP/openaip-openair-parser
_LIMITS = {"lowerLimit": "floor", "lowerCeiling": "floor", "upperLimit": "ceiling", "upperCeiling": "ceiling"}
_UNITS = {0: 1.0, "M": 1.0, 1: 0.3048, "FT": 0.3048, 6: 30.48, "FL": 30.48}
_DATUMS = {
    0: "agl",
    "GND": "agl",
    "AGL": "agl",
    "SFC": "agl",
    1: "amsl",
    "MSL": "amsl",
    2: "standard",
    "STD": "standard",
    "AMSL": "amsl",
    "WGS84": "ellipsoid",
}
# Largest difference between a flight level (a pressure altitude) and its altitude at 1,013.25 hPa, m, for sea-level
# pressures of 965 to 1,060 hPa (27 ft per hPa, ICAO Doc 7488).
FLIGHT_LEVEL_ERROR = 400.0
# Highest mean sea level above the WGS84 ellipsoid (EGM2008), m.
GEOID_HIGHEST = 86.0
# Lowest mean sea level, relative to the WGS84 ellipsoid (EGM2008), m.
GEOID_LOWEST = -107.0
# Datums other than mean sea level: name in messages, and the largest distance below and above the stated AMSL value, m.
_INEXACT_DATUMS = {
    "standard": ("a flight level", FLIGHT_LEVEL_ERROR, FLIGHT_LEVEL_ERROR),
    "ellipsoid": ("a height above the ellipsoid", GEOID_HIGHEST, -GEOID_LOWEST),
}
# Lowest altitude of a [[zones]] table, m AMSL, below every flight.
_LOWEST_AMSL_M = -500.0
# Highest altitude of a [[zones]] table, m AMSL, above every flight.
_HIGHEST_AMSL_M = 9000.0
# The FAA's limits in its open data (Class Airspace, Special Use Airspace): LOWER_VAL, LOWER_UOM, LOWER_CODE, and UPPER.
_FAA_LIMIT_KEYS = {"LOWER": "lowerLimit", "UPPER": "upperLimit"}
# FAA value for "not applicable".
_FAA_NOT_APPLICABLE = -9998.0


def zone_entries(properties: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Convert a zone's properties to the entries of a [[zones]] table.

    A zone without a kind is an exclusion.

    A limit that is a flight level or a height above the ellipsoid becomes an altitude. Its error enlarges the
    exclusion: `FLIGHT_LEVEL_ERROR` for a flight level, and the range of geoid heights for the ellipsoid.

    Raises ScenarioError for such a limit of an inclusion, for an invalid limit, and for an unknown property that looks
    like a key of a scenario file.

    >>> zone_entries({"lowerLimit": {"value": 0, "unit": 1, "referenceDatum": 0}, "ceiling_agl_m": 90.0}, "a file")
    {'kind': 'exclusion', 'ceiling_agl_m': 90.0}
    """
    entries: dict[str, Any] = {"kind": "exclusion"}
    # The FAA's properties LOWER_VAL, LOWER_UOM, LOWER_CODE (and UPPER) in openAIP's form.
    faa_limits = {}
    for limit_name, key in _FAA_LIMIT_KEYS.items():
        if (value := properties.get(f"{limit_name}_VAL")) is None:
            continue
        try:
            height = float(value)
        except (TypeError, ValueError) as error:
            raise ScenarioError.at(source, f"{limit_name}_VAL", value, "expected a number", shown="") from error
        if height != _FAA_NOT_APPLICABLE:
            unit, datum = properties.get(f"{limit_name}_UOM"), properties.get(f"{limit_name}_CODE")
            faa_limits[key] = {"value": height, "unit": unit, "referenceDatum": datum}
    for key, value in {**faa_limits, **properties}.items():
        if value is None:
            continue
        if key in _LIMITS:
            entries |= _limit_entry(value, key, properties.get("kind"), source)
        elif key in _SCENARIO_KEYS:
            entries[key] = value
        elif key.lower().startswith(_SCENARIO_KEY_PREFIXES):
            raise ScenarioError.at(source, key, value, f"unknown; known are {', '.join(_SCENARIO_KEYS)}", shown="")
    if entries.get("floor_amsl_m") == _HIGHEST_AMSL_M:
        # The whole zone is above every flight.
        entries.pop("ceiling_amsl_m", None)
    return entries


def published_entries(limits: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Convert the limits of an authority's zone as `zone_entries` does, and correct them.

    The entries are marked as `PUBLISHED`.

    Limits that leave no vertical band are corrected:
    - A lower limit above the upper limit (both AMSL, or both above ground) is swapped with it; mark `UPSIDE_DOWN`.
    - An upper limit of 0 or below may mean no limit or the lower limit: extend the zone to all heights; mark `NO_BAND`.
    - An upper limit equal to the lower limit is ignored; mark `NO_BAND`.

    >>> high, low = ({"value": feet, "unit": "FT", "referenceDatum": "MSL"} for feet in (1000, 500))
    >>> published_entries({"lowerLimit": high, "upperLimit": low}, "a file")["ceiling_amsl_m"]
    304.8
    >>> published_entries({"lowerLimit": high, "upperLimit": high}, "a file")
    {'kind': 'exclusion', 'floor_amsl_m': 304.8, 'published': True, 'no_band': True}
    """
    lower, upper = limits.get("lowerLimit"), limits.get("upperLimit")
    comparable_lower, comparable_upper = _comparable_limit(lower), _comparable_limit(upper)
    if comparable_upper is not None and (comparable_upper[1] <= 0.0 or comparable_lower == comparable_upper):
        entries = zone_entries({**limits, "upperLimit": None}, source)
        if comparable_upper[1] <= 0.0:
            entries = {key: value for key, value in entries.items() if not key.startswith("floor")}
        return {**entries, PUBLISHED: True, NO_BAND: True}
    if (
        comparable_lower is None
        or comparable_upper is None
        or comparable_lower[0] != comparable_upper[0]
        or comparable_lower < comparable_upper
    ):
        return {**zone_entries(limits, source), PUBLISHED: True}
    swapped = {**limits, "lowerLimit": upper, "upperLimit": lower}
    return {**zone_entries(swapped, source), PUBLISHED: True, UPSIDE_DOWN: True}


def _comparable_limit(limit: Any) -> tuple[bool, float] | None:
    """Return a limit as (is above ground, value in m), which can be compared; None for an invalid limit.

    limit: limit in openAIP's form.
    """
    if not isinstance(limit, dict):
        return None
    try:
        return _DATUMS[limit["referenceDatum"]] == "agl", round(limit["value"] * _UNITS[limit["unit"]], 3)
    except (KeyError, TypeError):
        return None


def _limit_entry(value: Any, key: str, kind: Any, source: str) -> dict[str, float]:
    """Convert a limit in openAIP's form to an entry of a [[zones]] table, such as {"ceiling_agl_m": 90.0}.

    key: property that states the limit.
    kind: kind of the zone, "inclusion" or "exclusion".

    A floor at the ground needs no entry. Raises ScenarioError for an invalid limit.
    """
    if not isinstance(value, dict):
        allowed = "expected an object with value, unit and referenceDatum"
        raise ScenarioError.at(source, key, value, allowed, shown="")
    height, unit, datum = value.get("value"), value.get("unit"), value.get("referenceDatum")
    if isinstance(height, bool) or not isinstance(height, int | float) or not math.isfinite(height):
        raise ScenarioError.at(source, f"{key}.value", height, "expected a number", shown="")
    # A list, for example, is not hashable and cannot be looked up.
    if not isinstance(unit, int | str) or unit not in _UNITS:
        allowed = f"allowed {', '.join(map(str, _UNITS))}"
        raise ScenarioError.at(source, f"{key}.unit", unit, allowed, shown="")
    if not isinstance(datum, int | str) or datum not in _DATUMS:
        allowed = f"allowed {', '.join(map(str, _DATUMS))}"
        raise ScenarioError.at(source, f"{key}.referenceDatum", datum, allowed, shown="")
    limit_name, height_m, datum_name = _LIMITS[key], round(height * _UNITS[unit], 3), _DATUMS[datum]
    if datum_name == "agl" and height_m <= 0.0:
        if limit_name == "floor":
            return {}
        raise ScenarioError.at(source, key, value, "expected a value above 0: nothing lies below the ground", shown="")
    if _UNITS[unit] == _UNITS["FL"]:
        datum_name = "standard"
    if datum_name in _INEXACT_DATUMS:
        datum_text, max_below, max_above = _INEXACT_DATUMS[datum_name]
        if kind == "inclusion":
            allowed = f"{datum_text} cannot bound an inclusion; give a height in metres above mean sea level"
            raise ScenarioError.at(source, key, value, allowed, shown="")
        datum_name, height_m = "amsl", height_m + (max_above if limit_name == "ceiling" else -max_below)
    return {f"{limit_name}_{datum_name}_m": min(_HIGHEST_AMSL_M, max(_LOWEST_AMSL_M, height_m))}
