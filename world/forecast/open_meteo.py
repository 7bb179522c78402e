"""Read the forecast of Open-Meteo's API: hourly winds at heights above ground and on pressure levels, as JSON."""

import json
import math
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from world.arrays import Floats
from world.errors import ForecastError
from world.files import read_small_file
from world.forecast.forecast import Forecast
from world.forecast.levels import LevelGroup, LevelKind, merge_levels
from world.forecast.units import DIRECTION_UNITS, HEIGHT_UNITS, SPEED_UNITS, unit_factor

# Largest size of a file, bytes.
MAX_BYTES = 50_000_000
_SPEED_NAME = re.compile(r"^wind_?speed_(\d+)(m|hPa)$")


class _Place(NamedTuple):
    """Winds at one place.

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
    """Read a forecast of one place, or of several places on a regular grid.

    ground_amsl: ground at the mission's start, m AMSL, for a file without `elevation`.

    Raises ForecastError, in one line, for a file that lacks what is needed.
    """
    try:
        content = json.loads(read_small_file(path, MAX_BYTES, "forecast", ForecastError))
    except (ValueError, RecursionError) as error:
        raise ForecastError(f"{path}: damaged or incomplete: not JSON: {str(error)[:100]}", file=str(path)) from error
    entries = content if isinstance(content, list) else [content]
    if not entries or not all(isinstance(entry, dict) for entry in entries):
        raise _fault(path, "hourly", "expected the answer of Open-Meteo's API, one object or a list of objects")
    places = [_read_place(path, entry, ground_amsl) for entry in entries]
    latitudes = np.unique([place.latitude for place in places])
    longitudes = np.unique([place.longitude for place in places])
    first = places[0]
    if len(latitudes) * len(longitudes) != len(places) or any(
        place.altitudes.shape != first.altitudes.shape or not np.array_equal(place.times, first.times)
        for place in places
    ):
        raise _fault(
            path, "latitude, longitude", "several places must form a regular grid, with the same times and levels"
        )
    order = np.lexsort(([place.longitude for place in places], [place.latitude for place in places]))
    shape = (len(latitudes), len(longitudes))
    altitudes = np.stack([places[k].altitudes for k in order], axis=1).reshape(
        len(first.times), *shape, first.altitudes.shape[-1]
    )
    velocities = np.stack([places[k].velocities for k in order], axis=1).reshape(*altitudes.shape, 2)
    steps = np.diff(latitudes) if len(latitudes) > 1 else np.diff(longitudes)
    if len(places) > 1 and min(shape) < 2:
        raise _fault(
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
        grid_km=float(steps.mean()) * 111.2 if len(places) > 1 else 0.0,
        ground="of the forecast's model" if has_elevation else "at the mission's start",
    )


def _fault(path: Path, field: str, allowed: str) -> ForecastError:
    """Return the error for a field of a file."""
    return ForecastError(f"{path}: {field}: {allowed}", file=str(path), field=field, allowed=allowed)


def _read_place(path: Path, entry: dict[str, Any], ground_amsl: float) -> _Place:
    """Read the winds at one place."""
    hourly, units = entry.get("hourly"), entry.get("hourly_units")
    if not isinstance(hourly, dict) or not isinstance(units, dict):
        reason = f": {entry['reason']}" if isinstance(entry.get("reason"), str) else ""
        raise _fault(path, "hourly", f"hourly winds and hourly_units are missing{reason[:200]}")
    latitude = _number(path, entry, "latitude", -90.0, 90.0)
    longitude = _number(path, entry, "longitude", -180.0, 360.0)
    ground = _number(path, entry, "elevation", -500.0, 9000.0) if "elevation" in entry else ground_amsl
    times = _read_times(path, hourly, units, entry)
    count = _count_complete_times(hourly, len(times))
    groups = []
    for name in hourly:
        if (match := _SPEED_NAME.match(name)) is None:
            continue
        level = f"{match.group(1)}{match.group(2)}"
        direction = next(
            (text for text in (f"wind_direction_{level}", f"winddirection_{level}") if text in hourly), None
        )
        if direction is None:
            raise _fault(path, f"hourly.wind_direction_{level}", f"missing, although {name} is there")
        speeds = _column(path, hourly, units, name, count, SPEED_UNITS)
        if (speeds < 0.0).any() or (speeds > 150.0).any():
            raise _fault(path, f"hourly.{name}", "allowed 0..150 m/s")
        courses = np.radians(_column(path, hourly, units, direction, count, DIRECTION_UNITS))
        kind: LevelKind = "height" if match.group(2) == "m" else "pressure"
        heights = np.full(count, float(match.group(1)))
        if kind == "pressure":
            if f"geopotential_height_{level}" not in hourly:
                raise _fault(path, f"hourly.geopotential_height_{level}", f"missing, although {name} is there")
            heights = _column(path, hourly, units, f"geopotential_height_{level}", count, HEIGHT_UNITS)
        winds = np.stack([-speeds * np.sin(courses), -speeds * np.cos(courses)], axis=-1)
        groups.append(LevelGroup(kind, heights.reshape(-1, 1, 1, 1), winds.reshape(1, -1, 1, 1, 1, 2)))
    if not groups:
        raise _fault(
            path, "hourly", "no wind: wind_speed_10m and wind_direction_10m, or those of other levels, are needed"
        )
    altitudes, velocities = merge_levels(groups, None, ground)
    return _Place(latitude, longitude, times[:count], altitudes[:, 0, 0], velocities[0, :, 0, 0])


def _count_complete_times(hourly: dict[str, Any], count: int) -> int:
    """Return the number of times up to the last time at which no wind is null.

    A model that ends before the requested days has null at all later times.
    """
    columns = [
        values
        for name, values in hourly.items()
        if name.startswith(("wind", "geopotential_height")) and isinstance(values, list) and len(values) == count
    ]
    while count > 0 and any(column[count - 1] is None for column in columns):
        count -= 1
    return count


def _number(path: Path, entry: dict[str, Any], name: str, low: float, high: float) -> float:
    """Return a number of an entry."""
    value = entry.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise _fault(path, name, f"allowed {low:g}..{high:g}")
    return float(value)


def _read_times(path: Path, hourly: dict[str, Any], units: dict[str, Any], entry: dict[str, Any]) -> Floats:
    """Return the times, (t,) s since 1970 in UTC."""
    values = hourly.get("time")
    if not isinstance(values, list) or not values:
        raise _fault(path, "hourly.time", "missing: a list of times is needed")
    try:
        if units.get("time") == "unixtime":
            times = np.array([float(value) for value in values])
        else:
            offset = float(entry.get("utc_offset_seconds", 0.0))
            times = np.array(
                [datetime.fromisoformat(value).replace(tzinfo=UTC).timestamp() - offset for value in values]
            )
    except (TypeError, ValueError, OverflowError, AttributeError):
        raise _fault(path, "hourly.time", "allowed ISO 8601 times, or unixtime") from None
    if not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        raise _fault(path, "hourly.time", "the times are not in ascending order")
    return times


def _column(
    path: Path, hourly: dict[str, Any], units: dict[str, Any], name: str, count: int, factors: Mapping[str, float]
) -> Floats:
    """Return the values of one hourly variable in the first of the units of `factors`, (t,)."""
    factor = unit_factor(units.get(name), factors)
    if factor is None:
        raise _fault(path, f"hourly_units.{name}", f"{units.get(name)!r}: allowed {', '.join(sorted(factors))}")
    values = hourly[name]
    if not isinstance(values, list) or len(values) != len(hourly["time"]):
        raise _fault(path, f"hourly.{name}", f"allowed {len(hourly['time'])} values, one for each time")
    values = values[:count]
    if not values:
        raise _fault(path, f"hourly.{name}", "no values")
    for k, value in enumerate(values):
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise _fault(path, f"hourly.{name}", f"value {k + 1} is {value!r}: a number is needed")
    return np.array(values, dtype=np.float64) * factor
