"""Forecasts as the weather services write them, and how each states its levels, times, members and grid."""

import subprocess
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
import xarray
from numpy.typing import ArrayLike

from tests.world.made.forecast_files import (
    HEIGHTS,
    HOURS,
    ISSUED,
    LATITUDES,
    LONGITUDES,
    grib_message,
    grib_messages,
    open_meteo_answer,
    regular_grid,
    wind_dataset,
    write_grib,
    write_json,
    write_netcdf,
)
from world.arrays import Floats
from world.errors import ForecastError
from world.forecast.forecast import Box, Forecast
from world.forecast.read_forecast import read_forecast

DEPARTURE = datetime.fromisoformat(ISSUED).replace(tzinfo=UTC)
BOX = Box(45.95, 7.95, 46.05, 8.05)
# Winds that differ at each level, and geopotential heights of pressure levels.
LEVELS = (1000.0, 925.0, 850.0)
LEVEL_HEIGHTS = np.array([120.0, 780.0, 1500.0])
EASTWARD = np.array([3.0, 6.0, 9.0])
NORTHWARD = np.array([-1.0, -2.0, -4.0])


def by_level(values: ArrayLike) -> Floats:
    return np.asarray(values, dtype=np.float64)[:, np.newaxis, np.newaxis]


def wind_at(
    forecast: Forecast, altitude: float, hours: float = 0.0, member: int = 0, **place: float
) -> Sequence[float]:
    """Return the wind at a place, 46 N, 8 E by default."""
    field = forecast.field_from(DEPARTURE, member)
    place = {"latitude": 46.0, "longitude": 8.0} | place
    found: list[float] = field.velocities_at(3600.0 * hours, place["latitude"], place["longitude"], altitude)[
        0
    ].tolist()
    return found


def pressure_dataset(**changes: Any) -> xarray.Dataset:
    return wind_dataset(
        by_level(EASTWARD),
        by_level(NORTHWARD),
        kind="pressure",
        **{"levels": LEVELS, "heights": by_level(LEVEL_HEIGHTS)} | changes,
    )


# ----------------------------------------------------------------------
# As the services write them.


def test_gfs(tmp_path: Path) -> None:
    """Descending latitudes, longitudes of 0 to 360, pressure levels, and 10 m above the ground that the file states."""
    latitudes, longitudes = np.arange(50.0, 41.9, -0.25), np.arange(0.0, 360.0, 0.25)
    upper = pressure_dataset(latitudes=latitudes, longitudes=longitudes, hours=(0.0, 3.0))
    surface = wind_dataset(1.5, -0.5, levels=(10.0,), latitudes=latitudes, longitudes=longitudes, hours=(0.0, 3.0))
    ground = np.full((len(latitudes), len(longitudes)), 60.0)
    orography = grib_message(
        "orog", ground, kind="surface", level=0.0, hour=0.0, grid=regular_grid(latitudes, longitudes)
    )
    path = write_grib(tmp_path / "gfs.grib2", grib_messages(upper), grib_messages(surface), [orography])
    forecast = read_forecast(path, BOX, 999.0)
    assert (forecast.issued, forecast.ground) == (DEPARTURE, "of the forecast's model")
    assert forecast.first_time == DEPARTURE
    assert forecast.latitudes.tolist() == [45.75, 46.0, 46.25]
    # 70 m AMSL is 10 m above the ground; 95 m is half of the way to 1000 hPa at 120 m.
    assert wind_at(forecast, 70.0) == pytest.approx([1.5, -0.5], abs=1e-4)
    assert wind_at(forecast, 95.0) == pytest.approx([2.25, -0.75], abs=1e-4)
    assert wind_at(forecast, 1140.0) == pytest.approx([7.5, -3.0], abs=1e-4)


def test_the_geopotential_of_a_surface_is_the_models_ground(tmp_path: Path) -> None:
    """650 gpm: 70 m above the model's ground is 720 m AMSL, whatever the ground at the start."""
    winds = wind_dataset(np.array([4.0, 8.0])[:, None, None], 0.0, levels=(20.0, 120.0), hours=(0.0, 3.0))
    ground = np.full((len(winds.latitude), len(winds.longitude)), 650.0 * 9.80665)
    grid = regular_grid(winds.latitude.values, winds.longitude.values)
    surface = grib_message("z", ground, kind="surface", level=0.0, hour=0.0, grid=grid)
    forecast = read_forecast(write_grib(tmp_path / "z.grib2", grib_messages(winds), [surface]), BOX, 500.0)
    assert forecast.ground == "of the forecast's model"
    assert wind_at(forecast, 720.0) == pytest.approx([6.0, 0.0], abs=1e-3)


def test_levels_inside_the_ground_have_the_wind_at_10_m(tmp_path: Path) -> None:
    upper = pressure_dataset(hours=(0.0, 3.0))
    surface = wind_dataset(1.5, -0.5, levels=(10.0,), hours=(0.0, 3.0))
    path = write_grib(tmp_path / "alps.grib2", grib_messages(upper), grib_messages(surface))
    forecast = read_forecast(path, BOX, 700.0)
    assert forecast.ground == "at the mission's start"
    assert wind_at(forecast, 200.0) == pytest.approx([1.5, -0.5], abs=1e-4)
    assert wind_at(forecast, 710.0) == pytest.approx([1.5, -0.5], abs=1e-4)
    assert wind_at(forecast, 745.0) == pytest.approx([3.75, -1.25], abs=1e-3)


LAMBERT = {
    "gridType": "lambert",
    "shapeOfTheEarth": 6,
    "Nx": 41,
    "Ny": 31,
    "DxInMetres": 3000,
    "DyInMetres": 3000,
    "LaDInDegrees": 38.5,
    "LoVInDegrees": 262.5,
    "Latin1InDegrees": 38.5,
    "Latin2InDegrees": 38.5,
    "jScansPositively": 1,
}


@pytest.mark.parametrize("longitude", [-120.0, -97.5, -75.0])
def test_hrrr(longitude: float, tmp_path: Path) -> None:
    """A uniform true wind, stored along the axes of a Lambert grid: these are turned by up to 14 degrees here."""
    to_map = pyproj.Proj(proj="lcc", lat_0=38.5, lon_0=-97.5, lat_1=38.5, lat_2=38.5, R=6371229.0)
    x, y = to_map(longitude, 38.0)
    columns, rows = np.meshgrid(x + 3000.0 * (np.arange(41) - 20), y + 3000.0 * (np.arange(31) - 15))
    corner = to_map(float(columns[0, 0]), float(rows[0, 0]), inverse=True)
    node_longitudes, node_latitudes = to_map(columns, rows, inverse=True)
    # Map course of true north, by a step to the north.
    step_x, step_y = to_map(node_longitudes, node_latitudes + 1e-4)
    turn = np.arctan2(step_x - columns, step_y - rows)
    assert abs(np.degrees(turn).mean()) == pytest.approx(abs(longitude + 97.5) * np.sin(np.radians(38.5)), abs=0.1)
    true_u, true_v = 8.0, -5.0
    grid = LAMBERT | {
        "latitudeOfFirstGridPointInDegrees": corner[1],
        "longitudeOfFirstGridPointInDegrees": corner[0] % 360.0,
        "uvRelativeToGrid": 1,
    }
    winds = {
        "u": true_u * np.cos(turn) + true_v * np.sin(turn),
        "v": true_v * np.cos(turn) - true_u * np.sin(turn),
    }
    messages = [
        grib_message(name, values, kind="height", level=level, hour=hour, grid=grid)
        for name, values in winds.items()
        for hour in (0.0, 1.0)
        for level in (10.0, 80.0)
    ]
    path = write_grib(tmp_path / "hrrr.grib2", messages)
    forecast = read_forecast(path, Box(37.9, longitude - 0.15, 38.1, longitude + 0.15), 0.0)
    assert 2.5 < forecast.grid_km < 3.5
    velocities = forecast.velocities.reshape(-1, 2)
    assert np.abs(velocities - [true_u, true_v]).max() < 0.05
    # Without the flag they are along true east and north already.
    plain = [
        grib_message(
            name, np.full_like(turn, value), kind="height", level=level, hour=0.0, grid=grid | {"uvRelativeToGrid": 0}
        )
        for name, value in (("u", true_u), ("v", true_v))
        for level in (10.0, 80.0)
    ]
    other = read_forecast(
        write_grib(tmp_path / "true.grib2", plain), Box(37.9, longitude - 0.15, 38.1, longitude + 0.15), 0.0
    )
    assert np.abs(other.velocities.reshape(-1, 2) - [true_u, true_v]).max() < 1e-3


def test_wind_on_a_projected_grid_follows_its_nodes(tmp_path: Path) -> None:
    """A wind that is linear in latitude and longitude is linear between any three nodes."""
    longitudes, latitudes = np.meshgrid(np.linspace(7.5, 8.5, 12), np.linspace(45.6, 46.4, 10))
    longitudes = longitudes + 0.3 * (latitudes - 46.0)
    winds = 5.0 + 20.0 * (latitudes - 46.0) - 4.0 * (longitudes - 8.0)
    dims = ("time", "height", "y", "x")
    dataset = xarray.Dataset(
        {
            name: (dims, np.broadcast_to(factor * winds, (1, 2, 10, 12)), {"units": "m/s", "standard_name": standard})
            for name, factor, standard in (("u", 1.0, "eastward_wind"), ("v", -2.0, "northward_wind"))
        },
        {
            "time": ("time", wind_dataset(0, 0).time.values[:1]),
            "height": ("height", [10.0, 100.0], {"units": "m", "standard_name": "height"}),
            "lat": (("y", "x"), latitudes, {"standard_name": "latitude"}),
            "lon": (("y", "x"), longitudes, {"standard_name": "longitude"}),
        },
    )
    forecast = read_forecast(write_netcdf(tmp_path / "a.nc", dataset), BOX, 0.0)
    # 5 + 0.6 + 0.08.
    assert wind_at(forecast, 50.0, latitude=46.03, longitude=7.98) == pytest.approx([5.68, -11.36], abs=1e-9)


def test_icon_and_arome(tmp_path: Path) -> None:
    """A regular grid with levels above ground, whose components are said to be relative to the grid."""
    dataset = wind_dataset(by_level([2.0, 4.0, 6.0, 8.0]), by_level([0.0, 1.0, 2.0, 3.0]))
    path = write_grib(tmp_path / "icon.grib2", grib_messages(dataset, uvRelativeToGrid=1))
    forecast = read_forecast(path, BOX, 300.0)
    assert forecast.facts(DEPARTURE).highest_amsl == 1100.0
    assert wind_at(forecast, 500.0) == pytest.approx([5.0, 1.5], abs=1e-4)


def era5_dataset() -> xarray.Dataset:
    dataset = pressure_dataset().rename(time="valid_time", isobaricInhPa="pressure_level", gh="z")
    dataset["z"] = (dataset.z * 9.80665).assign_attrs(units="m**2 s**-2", standard_name="geopotential")
    for name in ("u", "v"):
        dataset[name].attrs["units"] = "m s**-1"
    dataset.pressure_level.attrs.update(units="hPa")
    dataset = dataset.assign_coords(number=((), 0, {"standard_name": "realization"}))
    return dataset.assign_coords(expver=("valid_time", np.array(["0001"] * len(HOURS), dtype=object)))


def test_era5_with_packed_values(tmp_path: Path) -> None:
    packing = {"dtype": "int16", "scale_factor": 0.001, "add_offset": 5.0, "_FillValue": -32767}
    geopotential = {"dtype": "int16", "scale_factor": 0.5, "add_offset": 8000.0, "_FillValue": -32767}
    path = write_netcdf(tmp_path / "era5.nc", era5_dataset(), u=packing, v=packing, z=geopotential)
    forecast = read_forecast(path, BOX, 0.0)
    assert forecast.issued is None
    assert forecast.altitudes[0, 0, 0].tolist() == pytest.approx(LEVEL_HEIGHTS.tolist(), abs=0.03)
    assert wind_at(forecast, 1500.0) == pytest.approx([9.0, -4.0], abs=1e-3)


def test_era5_as_grib_of_several_analyses_has_no_time_of_issue(tmp_path: Path) -> None:
    days = [grib_messages(pressure_dataset(hours=(0.0,)), dataTime=time) for time in (600, 700, 800)]
    forecast = read_forecast(write_grib(tmp_path / "era5.grib2", *days), BOX, 0.0)
    assert forecast.issued is None
    assert (forecast.times - DEPARTURE.timestamp()).tolist() == [0.0, 3600.0, 7200.0]


def ensemble_dataset() -> xarray.Dataset:
    members = [wind_dataset(5.0 + k, -k).expand_dims(number=[k]) for k in range(3)]
    return xarray.concat(members, "number")


def test_an_ensemble_as_netcdf(tmp_path: Path) -> None:
    forecast = read_forecast(write_netcdf(tmp_path / "ens.nc", ensemble_dataset()), BOX, 0.0)
    assert forecast.members == 3
    assert [wind_at(forecast, 50.0, member=k) for k in range(3)] == [[5.0, 0.0], [6.0, -1.0], [7.0, -2.0]]
    assert "3 members" in forecast.facts(DEPARTURE).describe()


def test_an_ensemble_as_grib(tmp_path: Path) -> None:
    groups = [
        grib_messages(wind_dataset(5.0 + k, -k), perturbationNumber=k, numberOfForecastsInEnsemble=3) for k in range(3)
    ]
    forecast = read_forecast(write_grib(tmp_path / "ens.grib2", *groups), BOX, 0.0)
    assert forecast.members == 3
    assert wind_at(forecast, 50.0, member=2) == pytest.approx([7.0, -2.0], abs=1e-4)


_AFTER_GRIB = """
import sys
from pathlib import Path
from world.forecast.forecast import Box
from world.forecast.read_forecast import read_forecast
read_forecast(Path(sys.argv[1]), Box(45.95, 7.95, 46.05, 8.05), 0.0)
import pyproj, rasterio, sqlite3
from rasterio.warp import transform
print(round(pyproj.Transformer.from_crs(4326, 32632, always_xy=True).transform(9.0, 0.0)[0]))
print(round(transform("EPSG:4326", "EPSG:32632", [9.0], [0.0])[0][0]))
print(sqlite3.sqlite_version)
"""


def test_what_is_imported_after_a_grib_file_keeps_its_libraries(tmp_path: Path) -> None:
    """Eccodes brings other versions of PROJ and SQLite for all that is loaded after it."""
    path = write_grib(tmp_path / "a.grib2", grib_messages(pressure_dataset()))
    done = subprocess.run(
        [sys.executable, "-c", _AFTER_GRIB, str(path)],
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        check=False,
    )
    plain = subprocess.run(
        [sys.executable, "-c", "import sqlite3; print(sqlite3.sqlite_version)"],
        capture_output=True,
        text=True,
        check=True,
    )
    # At the middle of the zone, 500 km of false easting.
    assert (done.returncode, done.stdout.split()) == (0, ["500000", "500000", plain.stdout.strip()]), done.stderr


# ----------------------------------------------------------------------
# The antimeridian, and the meridian of Greenwich.


@pytest.mark.parametrize("longitudes", [np.arange(0.0, 360.0, 0.5), np.arange(-180.0, 180.0, 0.5)], ids=["0", "-180"])
@pytest.mark.parametrize("center", [179.9, -179.9, 180.0, 0.1, 359.9])
def test_a_mission_at_the_end_of_the_grids_longitudes(center: float, longitudes: Floats, tmp_path: Path) -> None:
    """A wind of one period around the Earth has no step anywhere."""
    u = 10.0 * np.cos(np.radians(longitudes))
    v = 10.0 * np.sin(np.radians(longitudes))
    path = write_netcdf(tmp_path / "a.nc", wind_dataset(u, v, longitudes=longitudes))
    forecast = read_forecast(path, Box(45.9, center - 0.3, 46.1, center + 0.3), 0.0)
    for longitude in (center - 0.3, center, center + 0.3, center - 360.0, center + 360.0):
        angle = np.radians(longitude)
        # Linear between nodes 0.5 degrees apart: (0.25 degrees)^2 / 2 of 10 m/s.
        assert wind_at(forecast, 50.0, longitude=longitude) == pytest.approx(
            [10.0 * np.cos(angle), 10.0 * np.sin(angle)], abs=1e-4
        )


def test_places_of_open_meteo_on_both_sides_of_the_antimeridian(tmp_path: Path) -> None:
    longitudes = np.array([179.5, 180.0, 180.5])
    dataset = wind_dataset(longitudes - 180.0, 0.0, longitudes=longitudes)
    answers = [
        open_meteo_answer(dataset, latitude, longitude) | {"longitude": (longitude + 180.0) % 360.0 - 180.0}
        for latitude in LATITUDES.tolist()
        for longitude in longitudes.tolist()
    ]
    forecast = read_forecast(write_json(tmp_path / "a.json", answers), Box(45.9, 179.8, 46.1, 180.2), 0.0)
    assert wind_at(forecast, 50.0, longitude=-179.75) == pytest.approx([0.25, 0.0], abs=1e-9)
    assert wind_at(forecast, 50.0, longitude=179.75) == pytest.approx([-0.25, 0.0], abs=1e-9)


# ----------------------------------------------------------------------
# Levels by name and by text.


@pytest.mark.parametrize(
    ("u", "v", "height"),
    [
        ("u10", "v10", 10.0),
        ("10u", "10v", 10.0),
        ("U100", "V100", 100.0),
        ("u80m", "v80m", 80.0),
        ("UGRD_10maboveground", "VGRD_10maboveground", 10.0),
        ("u_component_of_wind_80m_above_ground", "v_component_of_wind_80m_above_ground", 80.0),
    ],
)
def test_a_height_in_the_name(u: str, v: str, height: float, tmp_path: Path) -> None:
    dataset = wind_dataset(3.0, 4.0, levels=(10.0,)).isel(height=0, drop=True).rename(u=u, v=v)
    dataset = dataset.assign({name: dataset[name].assign_attrs(standard_name="") for name in (u, v)})
    forecast = read_forecast(write_netcdf(tmp_path / "a.nc", dataset), BOX, 50.0)
    assert forecast.altitudes.ravel()[0] == 50.0 + height


@pytest.mark.parametrize(("u", "v"), [("u850", "v850"), ("UGRD_850mb", "VGRD_850mb"), ("u200", "v200"), ("u", "v")])
def test_another_number_in_a_name_is_no_height(u: str, v: str, tmp_path: Path) -> None:
    dataset = wind_dataset(3.0, 4.0, levels=(10.0,)).isel(height=0, drop=True).rename(u=u, v=v)
    with pytest.raises(ForecastError, match=f"{u}: its level is not stated"):
        read_forecast(write_netcdf(tmp_path / "a.nc", dataset), BOX, 50.0)


@pytest.mark.parametrize(
    ("name", "attributes", "is_amsl"),
    [
        ("height", {"standard_name": "height"}, False),
        ("height_above_ground", {}, False),
        ("heightAboveGround", {"long_name": "height above the surface"}, False),
        ("height_above_mean_sea_level", {}, True),
        ("height", {"long_name": "Height above mean sea level"}, True),
        ("altitude", {}, True),
        ("lev", {"standard_name": "altitude"}, True),
        ("heightAboveSea", {}, True),
        ("height", {"standard_name": "height_above_reference_ellipsoid"}, None),
        ("lev", {}, None),
        ("z", {"long_name": "model level"}, None),
    ],
)
def test_levels_in_metres_are_above_ground_or_above_the_sea(
    name: str, attributes: dict[str, str], is_amsl: bool | None, tmp_path: Path
) -> None:
    dataset = wind_dataset(3.0, 4.0).rename(height=name)
    dataset[name].attrs = {"units": "m", **attributes}
    path = write_netcdf(tmp_path / "a.nc", dataset)
    if is_amsl is None:
        with pytest.raises(ForecastError, match="u: its level is not stated"):
            read_forecast(path, BOX, 50.0)
    else:
        lowest = read_forecast(path, BOX, 50.0).altitudes.min()
        assert lowest == HEIGHTS[0] + (0.0 if is_amsl else 50.0)


def test_levels_above_ground_follow_the_ground_that_the_file_states(tmp_path: Path) -> None:
    dataset = wind_dataset(by_level([1.0, 2.0, 3.0, 4.0]), 0.0)
    ground = 100.0 * np.arange(7.0) + np.zeros((5, 1))
    for units, factor in (("m", 1.0), ("m2 s-2", 9.80665)):
        stated = dataset.assign(orog=(("latitude", "longitude"), ground * factor, {"units": units}))
        path = write_netcdf(tmp_path / f"{units[:2]}.nc", stated)
        forecast = read_forecast(path, BOX, 5000.0)
        # The node at 7.9 E is 200 m AMSL.
        assert forecast.altitudes[0, 0, 0].tolist() == pytest.approx([210.0, 300.0, 500.0, 1000.0])
    # Stated at each time, it is the ground at the first.
    moving = dataset.assign(
        orog=(("time", "latitude", "longitude"), np.stack([ground + 50.0 * k for k in range(4)]), {"units": "m"})
    )
    forecast = read_forecast(write_netcdf(tmp_path / "moving.nc", moving), BOX, 5000.0)
    assert forecast.altitudes[:, 0, 0, 0].tolist() == pytest.approx([210.0] * 4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda ground: np.where(ground == ground[2, 3], np.nan, ground), "orog: values are missing"),
        (lambda ground: ground[:, :6], "its grid differs"),
    ],
)
def test_a_ground_that_cannot_be_used(change: Any, words: str, tmp_path: Path) -> None:
    ground = change(100.0 * np.arange(7.0) + 10.0 * np.arange(5.0)[:, np.newaxis])
    dims = ("latitude", "longitude") if ground.shape[1] == 7 else ("lat2", "lon2")
    stated = wind_dataset(1.0, 0.0).assign(orog=(dims, ground, {"units": "m"}))
    if dims[0] == "lat2":
        stated = stated.assign_coords(
            lat2=("lat2", LATITUDES, {"standard_name": "latitude"}),
            lon2=("lon2", LONGITUDES[:6] + 0.05, {"standard_name": "longitude"}),
        )
    with pytest.raises(ForecastError, match=words):
        read_forecast(write_netcdf(tmp_path / "a.nc", stated), BOX, 0.0)


# ----------------------------------------------------------------------
# Times.


def test_the_time_of_issue_is_not_the_time_of_the_wind(tmp_path: Path) -> None:
    """Whatever the coordinates are called, and in whatever order they are."""
    dataset = wind_dataset(np.array([1.0, 2.0, 3.0, 4.0])[:, np.newaxis, np.newaxis, np.newaxis], 0.0)
    issue = ((), np.datetime64(ISSUED, "ns"), {"standard_name": "forecast_reference_time"})
    for name in ("reftime", "a_time_of_issue"):
        stated = dataset.rename(time="time1").assign_coords({name: issue})
        forecast = read_forecast(write_netcdf(tmp_path / f"{name}.nc", stated), BOX, 0.0)
        assert forecast.issued == DEPARTURE
        assert wind_at(forecast, 50.0, 1.5) == pytest.approx([2.5, 0.0])


def test_levels_with_other_times_share_what_they_have(tmp_path: Path) -> None:
    upper = grib_messages(pressure_dataset(hours=(0.0, 3.0, 6.0)))
    surface = grib_messages(wind_dataset(1.5, -0.5, levels=(10.0,), hours=(0.0, 1.0, 2.0, 3.0)))
    forecast = read_forecast(write_grib(tmp_path / "a.grib2", upper, surface), BOX, 0.0)
    assert (forecast.times - DEPARTURE.timestamp()).tolist() == [0.0, 3.0 * 3600.0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda one: one.assign(gh=one.gh.isel(time=slice(0, 2)).rename(time="other")), "gh"),
        (
            lambda one: one.assign(gh=one.gh.isel(isobaricInhPa=slice(0, 2)).rename(isobaricInhPa="plev")),
            "gh: its pres",
        ),
    ],
)
def test_geopotential_heights_of_other_times_or_levels(change: Any, words: str, tmp_path: Path) -> None:
    with pytest.raises(ForecastError, match=words):
        read_forecast(write_netcdf(tmp_path / "a.nc", change(pressure_dataset())), BOX, 0.0)


def test_geopotential_heights_of_fewer_times_than_the_winds(tmp_path: Path) -> None:
    for hours in ((0.0,), (0.0, 2.0)):
        winds = grib_messages(pressure_dataset()[["u", "v"]])
        heights = grib_messages(pressure_dataset(hours=hours)[["gh"]])
        with pytest.raises(ForecastError, match="gh: its times differ from the times of the winds"):
            read_forecast(write_grib(tmp_path / "a.grib2", winds, heights), BOX, 0.0)


def test_geopotential_heights_without_a_time_hold_always(tmp_path: Path) -> None:
    dataset = pressure_dataset()
    dataset = dataset.assign(gh=dataset.gh.isel(time=0, drop=True))
    forecast = read_forecast(write_netcdf(tmp_path / "a.nc", dataset), BOX, 0.0)
    assert wind_at(forecast, 1140.0, 2.0) == pytest.approx([7.5, -3.0])


# ----------------------------------------------------------------------
# Missing values.


def test_values_missing_outside_the_missions_box_do_not_matter(tmp_path: Path) -> None:
    u = np.full((4, 4, 5, 7), 3.0)
    u[:, :, 0, :] = u[:, :, :, 6] = np.nan
    forecast = read_forecast(write_netcdf(tmp_path / "a.nc", wind_dataset(u, 4.0)), BOX, 0.0)
    assert wind_at(forecast, 50.0) == [3.0, 4.0]


def test_a_level_that_is_missing_throughout_is_left_out(tmp_path: Path) -> None:
    u = np.full((4, 4, 5, 7), 3.0)
    u[:, 1] = np.nan
    forecast = read_forecast(write_netcdf(tmp_path / "a.nc", wind_dataset(u, 4.0)), BOX, 0.0)
    assert forecast.altitudes[0, 0, 0].tolist() == [10.0, 300.0, 800.0]
