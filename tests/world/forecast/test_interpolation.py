"""The wind at random places of each format of forecasts, compared with xarray's own interpolation of the file."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from tests.world.made.forecast_files import (
    HEIGHTS,
    HOURS,
    ISSUED,
    LATITUDES,
    LONGITUDES,
    grib_messages,
    import_cfgrib,
    open_meteo_answer,
    wind_dataset,
    write_grib,
    write_json,
    write_netcdf,
)
from world.arrays import Floats
from world.forecast.forecast import Box
from world.forecast.read_forecast import read_forecast
from world.forecast.wind_field import WindField

DEPARTURE = datetime.fromisoformat(ISSUED).replace(tzinfo=UTC)
BOX = Box(45.81, 7.72, 46.19, 8.28)
SHAPE = (len(HOURS), len(HEIGHTS), len(LATITUDES), len(LONGITUDES))
COUNT = 1000
TOLERANCE_MPS = 1e-6


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(5)


def random_places(random: np.random.Generator, low: float, high: float) -> tuple[Floats, ...]:
    """Return seconds after the first time, latitudes, longitudes and altitudes within the box."""
    return (
        random.uniform(0.0, 3.0 * 3600.0, COUNT),
        random.uniform(BOX.south, BOX.north, COUNT),
        random.uniform(BOX.west, BOX.east, COUNT),
        random.uniform(low, high, COUNT),
    )


def field_of(path: Path, ground_amsl: float = 0.0) -> WindField:
    return read_forecast(path, BOX, ground_amsl).field_from(DEPARTURE)


def points(**coordinates: Any) -> dict[str, xarray.DataArray]:
    """Return coordinates at which xarray interpolates point by point."""
    return {name: xarray.DataArray(values, dims="point") for name, values in coordinates.items()}


def times_after(seconds: Floats) -> Any:
    return np.datetime64(ISSUED, "ns") + (seconds * 1e9).round().astype("timedelta64[ns]")


@pytest.mark.parametrize("kind", ["height", "altitude"])
@pytest.mark.parametrize("rows", [slice(None), slice(None, None, -1)], ids=["ascending", "descending"])
def test_netcdf_with_levels_in_metres(kind: str, rows: slice, tmp_path: Path, random: np.random.Generator) -> None:
    u, v = random.normal(0.0, 8.0, (2, *SHAPE))
    dataset = wind_dataset(u, v, kind=kind, latitudes=LATITUDES[rows])
    path = write_netcdf(tmp_path / "a.nc", dataset)
    ground = 250.0 if kind == "height" else 0.0
    # Below the lowest and above the highest level too, where the wind of that level applies.
    seconds, latitudes, longitudes, altitudes = random_places(random, ground - 20.0, ground + 900.0)
    with xarray.open_dataset(path, engine="h5netcdf") as read:
        levels = np.clip(altitudes - ground, HEIGHTS[0], HEIGHTS[-1])
        expected = read.interp(
            points(time=times_after(seconds), latitude=latitudes, longitude=longitudes, **{kind: levels}),
            assume_sorted=False,
        )
        found = field_of(path, ground).velocities_at(seconds, latitudes, longitudes, altitudes)
        np.testing.assert_allclose(found[:, 0], expected.u.values, rtol=0.0, atol=TOLERANCE_MPS)
        np.testing.assert_allclose(found[:, 1], expected.v.values, rtol=0.0, atol=TOLERANCE_MPS)


def interpolate_columns(
    winds: xarray.Dataset, name: str, places: dict[str, xarray.DataArray], altitudes: Floats
) -> tuple[Floats, Floats]:
    """Interpolate u, v and the level's altitude gh by xarray on each level, and then over gh by numpy.

    name: dimension of the levels.
    """
    columns = winds.interp(places).transpose("point", name)
    found = []
    for wind in (columns.u.values, columns.v.values):
        rows = zip(columns.gh.values, wind, altitudes, strict=True)
        found.append(np.array([np.interp(altitude, heights, values) for heights, values, altitude in rows]))
    return found[0], found[1]


def test_grib_on_pressure_levels_with_geopotential_height(tmp_path: Path, random: np.random.Generator) -> None:
    levels = (1000.0, 925.0, 850.0, 700.0)
    heights = np.array([110.0, 780.0, 1500.0, 3000.0])[:, np.newaxis, np.newaxis] + random.normal(0.0, 40.0, SHAPE)
    u, v = random.normal(0.0, 8.0, (2, *SHAPE))
    dataset = wind_dataset(u, v, kind="pressure", levels=levels, heights=heights, latitudes=LATITUDES[::-1])
    path = write_grib(tmp_path / "a.grib2", grib_messages(dataset))
    parts = import_cfgrib().open_datasets(str(path), backend_kwargs={"indexpath": ""})
    read = parts[0].assign({name: array for part in parts for name, array in part.data_vars.items()})
    # Packed: what counts is what the file states.
    assert np.abs(read.u.values - u).max() < 1e-3
    seconds, latitudes, longitudes, altitudes = random_places(random, 0.0, 3200.0)
    places = points(step=(seconds * 1e9).round().astype("timedelta64[ns]"), latitude=latitudes, longitude=longitudes)
    expected = interpolate_columns(read[["u", "v", "gh"]].astype(np.float64), "isobaricInhPa", places, altitudes)
    found = field_of(path).velocities_at(seconds, latitudes, longitudes, altitudes)
    np.testing.assert_allclose(found, np.column_stack(expected), rtol=0.0, atol=TOLERANCE_MPS)


@pytest.mark.parametrize("kind", ["height", "pressure"])
def test_open_meteo_on_a_grid(kind: str, tmp_path: Path, random: np.random.Generator) -> None:
    """Each place states its own ground, or the geopotential heights of its levels."""
    u, v = random.normal(0.0, 8.0, (2, *SHAPE))
    if kind == "height":
        elevations = random.uniform(100.0, 600.0, SHAPE[2:])
        levels = HEIGHTS
        heights = np.broadcast_to(np.array(levels)[:, np.newaxis, np.newaxis] + elevations, SHAPE)
        dataset = wind_dataset(u, v)
    else:
        elevations = np.full(SHAPE[2:], 200.0)
        levels = (1000.0, 925.0, 850.0, 700.0)
        heights = np.array([110.0, 780.0, 1500.0, 3000.0])[:, np.newaxis, np.newaxis] + random.normal(0.0, 40.0, SHAPE)
        dataset = wind_dataset(u, v, kind=kind, levels=levels, heights=heights)
    answers = [
        open_meteo_answer(dataset, latitude, longitude, float(elevations[row, column]))
        for column, longitude in enumerate(LONGITUDES.tolist())
        for row, latitude in enumerate(LATITUDES.tolist())
    ]
    path = write_json(tmp_path / "a.json", answers)
    seconds, latitudes, longitudes, altitudes = random_places(random, 0.0, 3200.0)
    places = points(time=times_after(seconds), latitude=latitudes, longitude=longitudes)
    winds = wind_dataset(u, v, kind="pressure", levels=levels, heights=heights)
    expected = interpolate_columns(winds, "isobaricInhPa", places, altitudes)
    found = field_of(path).velocities_at(seconds, latitudes, longitudes, altitudes)
    np.testing.assert_allclose(found, np.column_stack(expected), rtol=0.0, atol=TOLERANCE_MPS)


# Each changes how a file states the same winds.
STATED_OTHERWISE: dict[str, Callable[[xarray.Dataset], xarray.Dataset]] = {
    "knots": lambda one: one.assign(
        {n: (one[n] / 0.514444444444).assign_attrs(one[n].attrs | {"units": "knots"}) for n in "uv"}
    ),
    "longitudes of 0 to 360": lambda one: one.assign_coords(
        longitude=(one.longitude % 360.0).assign_attrs(one.longitude.attrs)
    ),
    "level last": lambda one: one.transpose("time", "latitude", "longitude", "height"),
    "levels in descending order": lambda one: one.isel(height=slice(None, None, -1)),
    "levels in km": lambda one: one.assign_coords(
        height=(one.height / 1000.0).assign_attrs({"standard_name": "height", "units": "km"})
    ),
    "by name alone": lambda one: one.assign({n: one[n].assign_attrs({"units": "m/s"}, standard_name="") for n in "uv"}),
}


@pytest.mark.parametrize("name", STATED_OTHERWISE)
def test_the_same_winds_stated_otherwise(name: str, tmp_path: Path, random: np.random.Generator) -> None:
    dataset = wind_dataset(*random.normal(0.0, 8.0, (2, *SHAPE)))
    plain = field_of(write_netcdf(tmp_path / "plain.nc", dataset))
    other = field_of(write_netcdf(tmp_path / "other.nc", STATED_OTHERWISE[name](dataset)))
    places = random_places(random, 0.0, 900.0)
    found = other.velocities_at(*places)
    np.testing.assert_allclose(found, plain.velocities_at(*places), rtol=0.0, atol=TOLERANCE_MPS * 10.0)
