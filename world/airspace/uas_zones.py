"""Read UAS geographical zones as published by European authorities.

The formats are EUROCAE ED-269 JSON and ED-318 GeoJSON.

ED-269: features with a list of volumes, each a polygon or a circle between two limits.  ED-318: GeoJSON features whose
geometries have a `layer`, and points an `extent`; its schema is public (https://github.com/UASGeoZones/ED-318).  Spain
(ENAIRE) moves ED-318 entries of a zone to its own tables, `UASZone` and `verticalLayer`, or writes the layer and the
times among the properties.  In both formats a zone without a restriction is open to all and is skipped.
"""

import math
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

from world.airspace.zone_entries import published_entries
from world.airspace.zone_times import WEEKDAYS, Period, parse_time
from world.errors import ScenarioError

# An upper limit from this value on (m or ft) means no upper limit, as Swiss and other files write it.
_UNLIMITED_VALUE = 99_999.0
_UNITS = {"M": "M", "FT": "FT"}
_DATUMS = ("AGL", "AMSL", "WGS84", "SFC")
_NO_RESTRICTION = "NO_RESTRICTION"
# Keys of a zone's times that Spain writes among the properties.
_PERIOD_KEYS = ("startDateTime", "endDateTime", "day", "startTime", "endTime", "startEvent", "endEvent")
# Shift from local time to UTC in the easternmost time zone, for a start date without an offset.
_EARLIEST_UTC_SHIFT = timedelta(hours=-14)
# Shift from local time to UTC in the westernmost time zone, for an end date without an offset.
_LATEST_UTC_SHIFT = timedelta(hours=12)

_FoundZone = tuple[str, dict[str, Any] | str]


def is_ed269(data: Mapping[str, Any]) -> bool:
    """Return True if JSON data is in ED-269 format: its first feature has a list of volumes.

    >>> is_ed269({"features": [{"geometry": [{"horizontalProjection": {}}]}]}), is_ed269({"features": []})
    (True, False)
    """
    features = _feature_list(data)
    first = features[0] if isinstance(features, list) and features else None
    return isinstance(first, dict) and isinstance(first.get("geometry"), list)


def is_ed318(feature: Any) -> bool:
    """Return True if a GeoJSON feature is in ED-318 format: it has a variant and a type of restriction.

    >>> is_ed318({"properties": {"type": "PROHIBITED", "variant": "COMMON"}}), is_ed318({"properties": None})
    (True, False)
    """
    properties = feature.get("properties") if isinstance(feature, dict) else None
    return isinstance(properties, dict) and {"type", "variant"} <= _zone_properties(properties).keys()


def _zone_properties(properties: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the properties of a zone; its own table `UASZone`, if any, is merged into them."""
    zone = properties.get("UASZone")
    return {**properties, **zone} if isinstance(zone, dict) else properties


def ed269_zones(data: Mapping[str, Any], source: str) -> Iterator[_FoundZone]:
    """Yield the location of each volume in an ED-269 file, and its [[zones]] entries.

    A skipped volume has the reason in place of the entries.

    A zone without a restriction is skipped.

    Raises ScenarioError for an invalid volume.
    """
    key = "features" if "features" in data else "UASZoneList"
    for k, feature in enumerate(_feature_list(data)):
        location = f"{key}[{k}]"
        volumes = feature.get("geometry") if isinstance(feature, dict) else None
        if not isinstance(volumes, list) or not volumes:
            raise _value_error(source, location, "geometry", "expected a list of volumes")
        name = _one_line_name(feature.get("name")) or _one_line_name(feature.get("identifier")) or f"zone {k + 1}"
        location += f" ({name})"
        if (restriction := _upper_word(feature.get("restriction"))) == _NO_RESTRICTION:
            yield location, restriction
            continue
        time_entries = (
            {"times": times} if (times := _period_texts(feature.get("applicability"), f"{source}: {location}")) else {}
        )
        for number, volume in enumerate(volumes, 1):
            place = f"{source}: {location}"
            shape = volume.get("horizontalProjection") if isinstance(volume, dict) else None
            if not isinstance(shape, dict):
                raise _value_error(place, "", "horizontalProjection", "expected a polygon or a circle")
            unit, limits = volume.get("uomDimensions"), {}
            for end in ("lower", "upper"):
                datum = volume.get(f"{end}VerticalReference")
                limits[f"{end}Limit"] = _parse_limit(volume.get(f"{end}Limit"), unit, datum, end, place)
            entries = published_entries(limits, place)
            shape_type = _upper_word(shape.get("type"))
            if shape_type == "POLYGON":
                entries |= {"rings_deg": _parse_rings(shape.get("coordinates"), place)}
            elif shape_type == "CIRCLE":
                entries |= _circle_entries(shape.get("center"), shape.get("radius"), place)
            else:
                raise _value_error(place, "", "horizontalProjection.type", "allowed Polygon, Circle")
            label = f"{name} {number}/{len(volumes)}" if len(volumes) > 1 else name
            yield location, {**entries, "name": label, **time_entries}


def _feature_list(data: Mapping[str, Any]) -> Any:
    """Return the list of features of an ED-269 file, under either of its two names."""
    return data.get("features") if "features" in data else data.get("UASZoneList")


def ed318_zones(feature: Mapping[str, Any], location: str, index: int, source: str) -> Iterator[_FoundZone]:
    """Yield the location of each layer of an ED-318 feature, and its [[zones]] entries.

    A skipped layer has the reason in place of the entries.

    location: location of the feature in the file, for messages.
    index: index of the feature, from 0.

    A feature without a restriction is skipped.
    """
    properties = _zone_properties(feature["properties"])
    name = _one_line_name(properties.get("name")) or _one_line_name(properties.get("identifier")) or f"zone {index + 1}"
    location = f"{location} ({name})"
    if (restriction := _upper_word(properties["type"])) == _NO_RESTRICTION:
        yield location, restriction
        return
    applicability = properties.get("limitedApplicability")
    if applicability is None and any(properties.get(key) for key in _PERIOD_KEYS):
        applicability = [{**properties, "schedule": [properties]}]
    times = _period_texts(applicability, f"{source}: {location}")
    time_entries = {"times": times} if times else {}
    vertical_layer = properties.get("verticalLayer")
    geometries = list(_flatten_geometries(feature.get("geometry")))
    for k, geometry in enumerate(geometries, 1):
        label = f"{name} {k}/{len(geometries)}" if len(geometries) > 1 else name
        for entries in _ed318_layer(
            geometry, vertical_layer if isinstance(vertical_layer, dict) else properties, f"{source}: {location}"
        ):
            yield location, {**entries, "name": label, **time_entries}


def _flatten_geometries(geometry: Any) -> Iterator[Any]:
    """Yield a geometry itself, or every geometry of a (possibly nested) collection."""
    parts = geometry.get("geometries") if isinstance(geometry, dict) else None
    if isinstance(parts, list):
        for part in parts:
            yield from _flatten_geometries(part)
    else:
        yield geometry


def _ed318_layer(geometry: Any, default_layer: Mapping[str, Any], source: str) -> Iterator[dict[str, Any]]:
    """Yield the [[zones]] entries of each part of an ED-318 geometry.

    default_layer: table with the vertical limits, for a geometry without its own table ``layer``.
    """
    geometry = geometry if isinstance(geometry, dict) else {}
    layer = geometry.get("layer")
    layer = layer if isinstance(layer, dict) else default_layer
    unit = layer.get("uom") or layer.get("UOM") or "m"
    limits = {
        f"{limit_name}Limit": _parse_limit(
            layer.get(limit_name), unit, layer.get(f"{limit_name}Reference"), limit_name, source
        )
        for limit_name in ("lower", "upper")
    }
    entries = published_entries(limits, source)
    geometry_type, coordinates = geometry.get("type"), geometry.get("coordinates")
    if geometry_type == "Polygon":
        yield entries | {"rings_deg": _parse_rings(coordinates, source)}
    elif geometry_type == "MultiPolygon" and isinstance(coordinates, list):
        for part in coordinates:
            yield entries | {"rings_deg": _parse_rings(part, source)}
    elif geometry_type == "Point":
        extent = geometry.get("extent")
        extent = extent if isinstance(extent, dict) else {}
        if _upper_word(extent.get("subType")) != "CIRCLE":
            raise _value_error(source, "", "geometry.extent", "a point is the centre of a Circle")
        yield entries | _circle_entries(coordinates, extent.get("radius"), source)
    else:
        raise _value_error(source, "", "geometry.type", "allowed Polygon, MultiPolygon, Point, GeometryCollection")


# ----------------------------------------------------------------------
# Parts that both formats share: limits, shapes, names and times of activity.


def _parse_limit(value: Any, unit: Any, datum: Any, limit_name: str, source: str) -> dict[str, Any] | None:
    """Convert a vertical limit to openAIP's form: value, unit and referenceDatum; None for no limit.

    value, unit, datum: values of the file.
    limit_name: "lower" or "upper", for messages.

    Raises ScenarioError for invalid values.
    """
    if value is None or value == "":
        return None
    try:
        height = float(value)
    except (TypeError, ValueError, OverflowError):
        height = math.nan
    # An infinite upper limit means no limit.
    if not height > -math.inf:
        raise _value_error(source, "", f"{limit_name} limit", "expected a number")
    if limit_name == "upper" and height >= _UNLIMITED_VALUE:
        return None
    if _upper_word(unit) not in _UNITS:
        raise _value_error(source, "", "unit of its limits", f"allowed {', '.join(_UNITS)}")
    if _upper_word(datum) not in _DATUMS:
        raise _value_error(source, "", f"vertical reference of its {limit_name} limit", f"allowed {', '.join(_DATUMS)}")
    return {"value": height, "unit": _UNITS[_upper_word(unit)], "referenceDatum": _upper_word(datum)}


def _parse_rings(coordinates: Any, source: str) -> list[list[list[float]]]:
    """Convert a polygon's coordinates to rings of [latitude, longitude].

    Raises ScenarioError for invalid values.
    """
    try:
        rings = [[[float(corner[1]), float(corner[0])] for corner in ring] for ring in coordinates]
    except (TypeError, ValueError, IndexError, KeyError, OverflowError) as error:
        raise _value_error(source, "", "coordinates", "expected lists of [longitude, latitude]") from error
    if not rings:
        raise _value_error(source, "", "coordinates", "expected at least one ring")
    return rings


def _circle_entries(centre: Any, radius: Any, source: str) -> dict[str, float]:
    """Return the [[zones]] entries of a circle. Raises ScenarioError for invalid values."""
    try:
        return {"lat_deg": float(centre[1]), "lon_deg": float(centre[0]), "radius_m": float(radius)}
    except (TypeError, ValueError, IndexError, KeyError, OverflowError) as error:
        raise _value_error(source, "", "circle", "expected a centre [longitude, latitude] and a radius, m") from error


def _one_line_name(value: Any) -> str:
    """Return a zone's name in one line of up to 80 characters; "" for anything but text.

    From a list of texts by language, the first English text is taken, or else the first text.
    """
    if isinstance(value, list):
        texts = [
            text_entry
            for text_entry in value
            if isinstance(text_entry, dict) and isinstance(text_entry.get("text"), str)
        ]
        english_texts = [text_entry for text_entry in texts if str(text_entry.get("lang")).startswith("en")]
        value = (english_texts or texts or [{"text": ""}])[0]["text"]
    if not isinstance(value, str):
        return ""
    return "".join(character for character in value if character.isprintable()).strip()[:80]


def _upper_word(value: Any) -> str:
    """Return a word in capitals; "" for anything but text."""
    return value.strip().upper() if isinstance(value, str) else ""


def _period_texts(applicability: Any, source: str) -> list[str]:
    """Return the periods in which a zone is active, as texts of a [[zones]] table.

    The result is empty for a zone that is always active.

    applicability: value of the file, a list of periods with schedules; None for always.
    """
    if applicability is None:
        return []
    if not isinstance(applicability, list) or not all(isinstance(entry, dict) for entry in applicability):
        raise _value_error(source, "", "applicability", "expected a list of periods")
    periods: list[Period] = []
    for entry in applicability:
        try:
            start = _parse_moment(entry.get("startDateTime"), _EARLIEST_UTC_SHIFT)
            end = _parse_moment(entry.get("endDateTime"), _LATEST_UTC_SHIFT)
            if _upper_word(entry.get("permanent")) == "YES":
                start = end = None
            schedule = entry.get("schedule") or entry.get("dailyPeriod") or [{}]
            periods += [_daily_period(start, end, day_entry) for day_entry in schedule]
        except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
            allowed = "expected dates and times in ISO 8601 format, and days MON to SUN or ANY"
            raise _value_error(source, "", "applicability", allowed) from error
    if any(period == Period() for period in periods):
        return []
    return [period.text() for period in periods]


def _parse_moment(value: Any, extreme_offset: timedelta) -> datetime | None:
    """Parse a date and time; return it in UTC, or None for an empty value.

    extreme_offset: shift from local time to UTC that is assumed for a time without a UTC offset: the shift of the
        time zone that makes the period longest.
    """
    if value is None or value == "":
        return None
    moment = datetime.fromisoformat(value)
    return moment.replace(tzinfo=UTC) + extreme_offset if moment.tzinfo is None else parse_time(value)


def _daily_period(start: datetime | None, end: datetime | None, schedule_entry: Mapping[str, Any]) -> Period:
    """Convert one entry of a schedule (days of the week, and hours) to a period of activity.

    start, end: first and last time of the schedule; None if unknown.
    schedule_entry: keys day, startTime and endTime, as the file states them.

    Hours that are stated by sunrise or sunset, or without a UTC offset, become the whole day.
    """
    stated_days = schedule_entry.get("day") or []
    day_names = [_upper_word(day) for day in ([stated_days] if isinstance(stated_days, str) else stated_days)]
    days = frozenset() if "ANY" in day_names else frozenset(WEEKDAYS.index(day) for day in day_names)
    times = [schedule_entry.get(key) for key in ("startTime", "endTime")]
    first_minute, last_minute = _minute_of_day(times[0]), _minute_of_day(times[1], rounds_up=True)
    if first_minute is None or last_minute is None:
        # A day in another time zone overlaps the previous and the next day in UTC.
        day_steps = (-1, 0, 1) if any(times) else (0,)
        return Period(start, end, frozenset((day + day_step) % 7 for day in days for day_step in day_steps))
    day_shift, first_minute = divmod(first_minute, 24 * 60)
    last_minute -= day_shift * 24 * 60
    if not 0 <= last_minute <= 24 * 60:
        last_minute %= 24 * 60
    return Period(start, end, frozenset((day + day_shift) % 7 for day in days), first_minute, last_minute)


def _minute_of_day(value: Any, *, rounds_up: bool = False) -> int | None:
    """Convert a time of day to minutes after 00:00 UTC; None if it is empty or has no UTC offset.

    rounds_up: True to round a part of a minute up.

    The result is negative for a time on the previous day in UTC, and above 1,440 for a time on the next day.
    """
    if value is None or value == "":
        return None
    time = datetime.fromisoformat(f"2000-01-01T{value}")
    offset = time.utcoffset()
    if offset is None:
        return None
    has_fraction = rounds_up and (time.second or time.microsecond)
    return time.hour * 60 + time.minute + bool(has_fraction) - int(offset.total_seconds() // 60)


def _value_error(source: str, location: str, field: str, allowed: str) -> ScenarioError:
    """Return the error for a field at a location of a file; ``location`` is "" if ``source`` includes it."""
    label = f"{source}: {location}" if location else source
    return ScenarioError(f"{label}: {field}: {allowed}", file=source, field=field, allowed=allowed)
