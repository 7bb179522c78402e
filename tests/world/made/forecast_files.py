"""Forecast files made by tests: NetCDF, GRIB and the JSON of Open-Meteo, of winds that the test states."""

import importlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from numpy.typing import ArrayLike

from world.arrays import Floats

# Time of issue, and the first time of a made forecast.
ISSUED = "2026-05-01T06:00"
# Nodes around 46 N, 8 E, deg.
LATITUDES = np.linspace(45.8, 46.2, 5)
LONGITUDES = np.linspace(7.7, 8.3, 7)
HOURS = (0.0, 1.0, 2.0, 3.0)
# m.
HEIGHTS = (10.0, 100.0, 300.0, 800.0)
_KINDS = {
    "height": ("height", {"standard_name": "height", "units": "m"}),
    "altitude": ("altitude", {"standard_name": "altitude", "units": "m"}),
    "pressure": ("isobaricInhPa", {"standard_name": "air_pressure", "units": "hPa"}),
}


def times_of(hours: Sequence[float]) -> Any:
    """Return times so many hours after the first time."""
    return np.datetime64(ISSUED, "ns") + (np.asarray(hours) * 3600.0e9).astype("timedelta64[ns]")


def wind_dataset(
    u: ArrayLike,
    v: ArrayLike,
    *,
    kind: str = "height",
    levels: Sequence[float] = HEIGHTS,
    hours: Sequence[float] = HOURS,
    latitudes: Floats = LATITUDES,
    longitudes: Floats = LONGITUDES,
    heights: ArrayLike | None = None,
) -> xarray.Dataset:
    """Return a dataset of winds u and v (m/s), which broadcast to (time, level, latitude, longitude).

    kind: "height", "altitude" or "pressure".
    levels: m or hPa.
    heights: geopotential heights of pressure levels, m.
    """
    name, attributes = _KINDS[kind]
    dims = ("time", name, "latitude", "longitude")
    shape = (len(hours), len(levels), len(latitudes), len(longitudes))
    variables = {
        "u": (dims, np.broadcast_to(u, shape).astype(np.float64), {"units": "m s-1", "standard_name": "eastward_wind"}),
        "v": (
            dims,
            np.broadcast_to(v, shape).astype(np.float64),
            {"units": "m s-1", "standard_name": "northward_wind"},
        ),
    }
    if heights is not None:
        values = np.broadcast_to(heights, shape).astype(np.float64)
        variables["gh"] = (dims, values, {"units": "m", "standard_name": "geopotential_height"})
    return xarray.Dataset(
        variables,
        {
            "time": ("time", times_of(hours), {"standard_name": "time"}),
            name: (name, np.asarray(levels, dtype=np.float64), attributes),
            "latitude": ("latitude", latitudes, {"standard_name": "latitude", "units": "degrees_north"}),
            "longitude": ("longitude", longitudes, {"standard_name": "longitude", "units": "degrees_east"}),
        },
    )


def write_netcdf(path: Path, dataset: xarray.Dataset, **encoding: Mapping[str, Any]) -> Path:
    """Write a dataset as NetCDF 4; encoding: of variables."""
    hours = {"units": f"hours since {ISSUED.replace('T', ' ')}:00", "dtype": "float64"}
    times = {str(name): hours for name in dataset.variables if dataset[name].dtype.kind == "M"}
    dataset.to_netcdf(path, engine="h5netcdf", encoding=times | encoding)
    return path


# ----------------------------------------------------------------------
# GRIB.


def import_cfgrib() -> Any:
    """Import cfgrib, after the modules whose libraries eccodes brings in other versions for all that follows it."""
    for name in ("pyproj", "rasterio", "sqlite3"):
        importlib.import_module(name)
    return importlib.import_module("cfgrib")


_PARAMETERS = {
    # Discipline, category and number of each variable.
    "u": (0, 2, 2),
    "v": (0, 2, 3),
    "gh": (0, 3, 5),
    "orog": (0, 3, 5),
    "z": (0, 3, 4),
}
_SURFACES = {"height": 103, "altitude": 102, "pressure": 100, "surface": 1}


def grib_message(
    name: str,
    values: Floats,
    *,
    kind: str,
    level: float,
    hour: float,
    grid: Mapping[str, Any],
    bits: int = 24,
    **keys: Any,
) -> bytes:
    """Return a GRIB 2 message of one variable on one level.

    name: "u", "v", "gh", "orog" or "z".
    values: (y, x) in the order of the grid's scanning.
    kind: "height", "altitude", "pressure" or "surface".
    level: m or hPa.
    hour: time of forecast, a whole number.
    grid: keys of the grid, as `regular_grid` makes them.
    keys: other keys of eccodes.
    """
    import_cfgrib()
    import eccodes

    handle = eccodes.codes_grib_new_from_samples("GRIB2")
    discipline, category, number = _PARAMETERS[name]
    surface = _SURFACES[kind]
    stated = {
        "centre": "kwbc",
        "dataDate": int(ISSUED[:10].replace("-", "")),
        "dataTime": int(ISSUED[11:13] + ISSUED[14:16]),
        **({"productDefinitionTemplateNumber": 1, "typeOfEnsembleForecast": 3} if "perturbationNumber" in keys else {}),
        "indicatorOfUnitOfTimeRange": 1,
        "forecastTime": int(hour),
        "discipline": discipline,
        "parameterCategory": category,
        "parameterNumber": number,
        "typeOfFirstFixedSurface": surface,
        "scaleFactorOfFirstFixedSurface": 0,
        "scaledValueOfFirstFixedSurface": int(level * 100.0 if kind == "pressure" else level),
        **grid,
        "bitsPerValue": bits,
        **keys,
    }
    for key, value in stated.items():
        eccodes.codes_set(handle, key, value)
    eccodes.codes_set_values(handle, np.ascontiguousarray(values, dtype=np.float64).ravel())
    data = eccodes.codes_get_message(handle)
    eccodes.codes_release(handle)
    return bytes(data)


def regular_grid(latitudes: Floats, longitudes: Floats) -> dict[str, Any]:
    """Return the keys of a regular grid whose rows and columns are in the order of these nodes, deg."""
    return {
        "gridType": "regular_ll",
        "Ni": len(longitudes),
        "Nj": len(latitudes),
        "latitudeOfFirstGridPointInDegrees": float(latitudes[0]),
        "latitudeOfLastGridPointInDegrees": float(latitudes[-1]),
        "longitudeOfFirstGridPointInDegrees": float(longitudes[0] % 360.0),
        "longitudeOfLastGridPointInDegrees": float(longitudes[-1] % 360.0),
        "iDirectionIncrementInDegrees": float(abs(longitudes[1] - longitudes[0])),
        "jDirectionIncrementInDegrees": float(abs(latitudes[1] - latitudes[0])),
        "jScansPositively": int(latitudes[1] > latitudes[0]),
    }


def grib_messages(dataset: xarray.Dataset, **keys: Any) -> list[bytes]:
    """Return the messages of a dataset of `wind_dataset`, whose levels are of one kind."""
    kind, name = next((kind, name) for kind, (name, _) in _KINDS.items() if name in dataset.dims)
    grid = regular_grid(dataset.latitude.values, dataset.longitude.values)
    hours = (dataset.time.values - np.datetime64(ISSUED)) / np.timedelta64(1, "h")
    return [
        grib_message(str(variable), array.values[t, k], kind=kind, level=float(level), hour=hour, grid=grid, **keys)
        for variable, array in dataset.data_vars.items()
        for t, hour in enumerate(hours)
        for k, level in enumerate(dataset[name].values)
    ]


def write_grib(path: Path, *messages: Sequence[bytes]) -> Path:
    """Write lists of messages into one file."""
    path.write_bytes(b"".join(message for group in messages for message in group))
    return path


# ----------------------------------------------------------------------
# Open-Meteo.


def open_meteo_answer(
    dataset: xarray.Dataset, latitude: float, longitude: float, elevation: float | None = 0.0
) -> dict[str, Any]:
    """Return Open-Meteo's answer for a node of a dataset with levels of the kind "height" or "pressure"."""
    node = dataset.sel(latitude=latitude, longitude=longitude)
    is_pressure = "isobaricInhPa" in dataset.dims
    hourly: dict[str, Any] = {"time": [str(time)[:16] for time in dataset.time.values]}
    units = {"time": "iso8601"}
    for k, level in enumerate(dataset["isobaricInhPa" if is_pressure else "height"].values):
        suffix = f"{level:.0f}{'hPa' if is_pressure else 'm'}"
        u, v = node.u.values[:, k], node.v.values[:, k]
        hourly[f"wind_speed_{suffix}"] = np.hypot(u, v).tolist()
        hourly[f"wind_direction_{suffix}"] = (np.degrees(np.arctan2(-u, -v)) % 360.0).tolist()
        units |= {f"wind_speed_{suffix}": "m/s", f"wind_direction_{suffix}": "°"}
        if is_pressure:
            hourly[f"geopotential_height_{suffix}"] = node.gh.values[:, k].tolist()
            units[f"geopotential_height_{suffix}"] = "m"
    stated = {} if elevation is None else {"elevation": elevation}
    return {
        "latitude": latitude,
        "longitude": longitude,
        **stated,
        "utc_offset_seconds": 0,
        "timezone": "GMT",
        "hourly_units": units,
        "hourly": hourly,
    }


def write_json(path: Path, content: Any) -> Path:
    """Write JSON."""
    path.write_text(json.dumps(content), encoding="utf-8")
    return path
