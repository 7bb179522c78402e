"""Read a forecast in the JSON of Open-Meteo's API.

It has hourly winds at heights above ground and on pressure levels.
"""

import re
from collections.abc import Mapping
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from world.arrays import Floats
from world.errors import ForecastError
from world.files import json_value, read_small_file
from world.forecast.forecast import Forecast
from world.forecast.levels import LevelGroup, LevelKind, merge_levels
from world.forecast.units import DIRECTION_UNITS, HEIGHT_UNITS, MAX_WIND_MPS, SPEED_UNITS, unit_factor

# Largest size of a file, bytes.
MAX_BYTES = 50_000_000
# Number that no value reaches, in any unit.
_MAX_NUMBER = 1e9
_SPEED_NAME = re.compile(r"^wind_?speed_(\d+)(m|hPa)$")


class _Place(NamedTuple):
    """Winds at one place.

    latitude, longitude: deg.
    times: (t,) s since 1970.
    altitudes: (t, k) m AMSL, ascending.
    velocities: (t, k, 2) m/s.
    """

    latitude: float
    longitude: float
    times: Floats
    altitudes: Floats
    velocities: Floats


def read_open_meteo(path: Path, ground_amsl: float) -> Forecast:
    """Read a forecast of Open-Meteo for one place, or for several places on a regular grid.

    ground_amsl: ground at the mission's start, m AMSL, for a file without `elevation`.

    Raises ForecastError, in one line, for a file without the required variables.
    """
    try:
        content = json_value(read_small_file(path, MAX_BYTES, "forecast", ForecastError))
    except ValueError as error:
        raise ForecastError(f"{path}: damaged or incomplete: not JSON: {str(error)[:100]}", file=str(path)) from error
    entries = content if isinstance(content, list) else [content]
    for entry in entries:
        if isinstance(entry, dict) and entry.get("error") and "hourly" in entry:
            raise _make_error(
                path, "error", f"the service answered with an error: {str(entry.get('reason', ''))[:100]}"
            )
    if not entries or not all(isinstance(entry, dict) for entry in entries):
        raise _make_error(path, "hourly", "expected the answer of Open-Meteo's API, one object or a list of objects")
    places = [_read_place(path, entry, ground_amsl) for entry in entries]
    first = places[0]
    latitudes = np.unique([place.latitude for place in places])
    # Longitudes within 180 degrees of the first place, because a grid may extend over the antimeridian.
    place_longitudes = [
        first.longitude + (place.longitude - first.longitude + 180.0) % 360.0 - 180.0 for place in places
    ]
    longitudes = np.unique(place_longitudes)
    if len(latitudes) * len(longitudes) != len(places) or any(
        place.altitudes.shape != first.altitudes.shape or not np.array_equal(place.times, first.times)
        for place in places
    ):
        raise _make_error(
            path, "latitude, longitude", "several places must form a regular grid, with the same times and levels"
        )
    order = np.lexsort((place_longitudes, [place.latitude for place in places]))
    shape = (len(latitudes), len(longitudes))
    altitudes = np.stack([places[k].altitudes for k in order], axis=1).reshape(
        len(first.times), *shape, first.altitudes.shape[-1]
    )
    velocities = np.stack([places[k].velocities for k in order], axis=1).reshape(*altitudes.shape, 2)
    if len(places) > 1 and min(shape) < 2:
        raise _make_error(
            path, "latitude, longitude", "several places must form a grid of at least two rows and two columns"
        )
    has_elevation = all("elevation" in entry for entry in entries)
    return Forecast(
        source=path.name,
        issued=None,
        times=first.times,
        latitudes=latitudes,
        longitudes=longitudes,
        altitudes=altitudes,
        velocities=velocities[np.newaxis],
        ground="of the forecast's model" if has_elevation else "at the mission's start",
    )


def _make_error(path: Path, field: str, allowed: str) -> ForecastError:
    """Make the error about a field of a file; ``allowed`` states the expected values."""
    return ForecastError(f"{path}: {field}: {allowed}", file=str(path), field=field, allowed=allowed)


def _read_place(path: Path, entry: dict[str, Any], ground_amsl: float) -> _Place:
    """Read the winds at one place of Open-Meteo's answer.

    entry: JSON object of the place.
    ground_amsl: altitude of the ground, m, if the object states no elevation.

    Raises ForecastError for missing or invalid values.
    """
    hourly, units = entry.get("hourly"), entry.get("hourly_units")
    if not isinstance(hourly, dict) or not isinstance(units, dict):
        reason = f": {entry['reason']}" if isinstance(entry.get("reason"), str) else ""
        raise _make_error(path, "hourly", f"hourly winds and hourly_units are missing{reason[:200]}")
    latitude = _read_number(path, entry, "latitude", -90.0, 90.0)
    longitude = _read_number(path, entry, "longitude", -180.0, 360.0)
    ground = _read_number(path, entry, "elevation", -500.0, 9000.0) if "elevation" in entry else ground_amsl
    times = _read_times(path, hourly, units, entry)
    # Names of the variables of each level: wind speed, wind direction, and geopotential height ("" for a level at a
    # height above ground).
    all_levels = []
    for match in filter(None, map(_SPEED_NAME.match, hourly)):
        name, level = match.group(), f"{match.group(1)}{match.group(2)}"
        directions = [text for text in (f"wind_direction_{level}", f"winddirection_{level}") if text in hourly]
        if not directions:
            raise _make_error(path, f"hourly.wind_direction_{level}", f"missing, although {name} is there")
        height = "" if match.group(2) == "m" else f"geopotential_height_{level}"
        if height and height not in hourly:
            raise _make_error(path, f"hourly.{height}", f"missing, although {name} is there")
        all_levels.append((name, directions[0], height))
    # The values of a level that a model does not have are null at all times.
    null_names = {
        name
        for name, values in hourly.items()
        if isinstance(values, list) and values and all(value is None for value in values)
    }
    levels = [names for names in all_levels if null_names.isdisjoint(filter(None, names))]
    if not levels:
        allowed = "no wind: wind_speed_10m and wind_direction_10m, or speed and direction of other levels, are needed"
        raise _make_error(path, "hourly", allowed)
    # Times up to the last one at which all columns have a value. A model that ends before the requested days has
    # null at all later times.
    columns = [hourly[name] for level in levels for name in level if name]
    count = len(times)
    lists = [values for values in columns if isinstance(values, list) and len(values) == count]
    while count > 0 and any(values[count - 1] is None for values in lists):
        count -= 1
    groups = []
    for speed_name, direction_name, height_name in levels:
        speeds = _read_column(path, hourly, units, speed_name, count, SPEED_UNITS)
        if (speeds < 0.0).any() or (speeds > MAX_WIND_MPS).any():
            shown = f"{speeds.min():.4g} to {speeds.max():.4g} m/s"
            raise _make_error(path, f"hourly.{speed_name}", f"{shown}: allowed 0..{MAX_WIND_MPS:g} m/s")
        courses = np.radians(_read_column(path, hourly, units, direction_name, count, DIRECTION_UNITS))
        kind: LevelKind = "pressure" if height_name else "height"
        if height_name:
            heights = _read_column(path, hourly, units, height_name, count, HEIGHT_UNITS)
        else:
            heights = np.full(count, float(re.findall(r"\d+", speed_name)[0]))
        winds = np.stack([-speeds * np.sin(courses), -speeds * np.cos(courses)], axis=-1)
        groups.append(LevelGroup(kind, heights.reshape(-1, 1, 1, 1), winds.reshape(1, -1, 1, 1, 1, 2)))
    altitudes, velocities = merge_levels(groups, None, ground)
    return _Place(latitude, longitude, times[:count], altitudes[:, 0, 0], velocities[0, :, 0, 0])


def _read_times(path: Path, hourly: dict[str, Any], units: dict[str, Any], entry: dict[str, Any]) -> Floats:
    """Return the times of the hourly variables, (t,) s since 1970 in UTC.

    entry: object of the place, whose UTC offset applies to times without one.

    Raises ForecastError for missing, invalid or unordered times.
    """
    values = hourly.get("time")
    if not isinstance(values, list) or not values:
        raise _make_error(path, "hourly.time", "missing: a list of times is needed")
    try:
        if units.get("time") == "unixtime":
            times = np.array([float(value) for value in values])
        else:
            zone = timezone(
                timedelta(seconds=_read_number(path, entry, "utc_offset_seconds", -86_399.0, 86_399.0, 0.0))
            )
            read_times = [datetime.fromisoformat(value) for value in values]
            times = np.array([(time if time.tzinfo else time.replace(tzinfo=zone)).timestamp() for time in read_times])
    except (TypeError, ValueError, OverflowError, AttributeError):
        raise _make_error(path, "hourly.time", "allowed ISO 8601 times, or unixtime") from None
    if not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        raise _make_error(path, "hourly.time", "the times are not in ascending order")
    return times


def _read_number(
    path: Path, entry: dict[str, Any], name: str, low: float, high: float, default: float | None = None
) -> float:
    """Return a number of an entry by its name, or the default if it is missing.

    Raises ForecastError if it is missing without a default, or not between ``low`` and ``high``.
    """
    value = entry.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise _make_error(path, name, f"{str(value)[:40]}: allowed {low:g}..{high:g}")
    return float(value)


def _read_column(
    path: Path, hourly: dict[str, Any], units: dict[str, Any], name: str, count: int, factors: Mapping[str, float]
) -> Floats:
    """Return the first values of one hourly variable, (count,), converted by the factor of its unit.

    units: unit of each variable.
    factors: factor of each allowed unit; the factor of the resulting unit is 1.

    Raises ForecastError for an unknown unit, and for values that are missing or not numbers.
    """
    factor = unit_factor(units.get(name), factors)
    if factor is None:
        raise _make_error(path, f"hourly_units.{name}", f"{units.get(name)!r}: allowed {', '.join(sorted(factors))}")
    values = hourly[name]
    if not isinstance(values, list) or len(values) != len(hourly["time"]):
        raise _make_error(path, f"hourly.{name}", f"expected {len(hourly['time'])} values, one for each time")
    values = values[:count]
    if not values:
        raise _make_error(path, f"hourly.{name}", "no values")
    for k, value in enumerate(values):
        if isinstance(value, bool) or not isinstance(value, int | float) or not -_MAX_NUMBER < value < _MAX_NUMBER:
            raise _make_error(path, f"hourly.{name}", f"value number {k + 1} is {repr(value)[:40]}; expected a number")
    return np.array(values, dtype=np.float64) * factor
