"""Read a forecast of the wind: NetCDF, GRIB, or the JSON of Open-Meteo.

NetCDF and GRIB are read by xarray.  Variables are recognised by their CF standard names, and by the names that weather
services use for them.  Winds on pressure levels need the geopotential height of these levels; winds at heights above
ground are placed above the model's ground if the file has it, and otherwise above the ground at the mission's start.
"""

import functools
import gc
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from world.arrays import Floats
from world.errors import ForecastError
from world.extras import require_extra
from world.files import missing_text
from world.forecast.forecast import Box, Forecast
from world.forecast.grib_process import read_in_process
from world.forecast.levels import LevelGroup, LevelKind, merge_levels
from world.forecast.open_meteo import read_open_meteo
from world.forecast.regrid import near_nodes, regrid, regular_axes, rotate_to_north
from world.forecast.units import (
    GEOPOTENTIAL_UNITS,
    GRAVITY_STANDARD,
    HEIGHT_UNITS,
    MAX_WIND_MPS,
    PRESSURE_UNITS,
    SPEED_UNITS,
    unit_factor,
)

# Numbers that mark missing values in files that do not declare them; larger ones are no winds.
FILL_VALUES = (-99.0, -99.9, 99.9)
# Largest distance between two nodes between which the wind is interpolated, deg.  Global reanalyses have 2.5.
MAX_SPACING_DEG = 3.0
# Largest number of nodes around a mission, over all times, levels and members.
MAX_NODES = 20_000_000

_U_NAME = re.compile(r"^(u|u(\d+)m?|(\d+)u|ugrd.*|uwnd|u_component_of_wind.*|u-component.*|wind_u)$", re.IGNORECASE)
_V_NAME = re.compile(r"^(v|v(\d+)m?|(\d+)v|vgrd.*|vwnd|v_component_of_wind.*|v-component.*|wind_v)$", re.IGNORECASE)
# Height of a wind above ground, m, as its name states it: u10, 10u, u80m, UGRD_10maboveground.  Another number may be a
# pressure, as in u850 and u200.
_HEIGHT_IN_NAME = re.compile(r"^[uv]?(10|100)[uv]?$|(?:^[uv]|_)(\d+)_?m(?:_?above_?ground)?$", re.IGNORECASE)
_EAST_NAMES = ("eastward_wind", "x_wind")
_NORTH_NAMES = ("northward_wind", "y_wind")
_MEMBER_DIMS = ("number", "member", "realization", "ensemble", "ens", "ensemble_member")
# Besides names that begin with "geopotential".
_HEIGHT_NAMES = {"gh", "z", "hgt", "height_above_sea_level"}
_GROUND_NAMES = {"orog", "orography", "zsfc", "surface_altitude", "hsurf", "topography", "surface_geopotential"}


def read_forecast(path: Path, box: Box, ground_amsl: float) -> Forecast:
    """Read the part of a forecast file that is needed for the wind in a box around a mission.

    ground_amsl: altitude of the ground at the mission's start, m AMSL. Heights above ground are measured from it if the
        file does not state the ground of its model.

    Raises ForecastError, in one line, for a file that is missing or damaged, or that lacks a required variable. Raises
    MissingExtraError if xarray or cfgrib is not installed.
    """
    if not path.is_file():
        raise ForecastError(f"{path}: {missing_text(path)}", file=str(path))
    status = path.stat()
    return _read_cached(path, (status.st_mtime_ns, status.st_size), box, ground_amsl)


@functools.lru_cache(maxsize=4)
def _read_cached(path: Path, version: tuple[int, int], box: Box, ground_amsl: float) -> Forecast:
    """Read a forecast, and cache it.

    version: time of the last change and size of the file, a part of the cache's key.
    box, ground_amsl: as for `read_forecast`.
    """
    try:
        with path.open("rb") as file:
            start = file.read(64)
    except OSError as error:
        raise ForecastError(f"{path}: cannot be read: {error.strerror}", file=str(path)) from error
    if start.lstrip()[:1] in (b"{", b"["):
        return read_open_meteo(path, ground_amsl)
    if start.startswith(b"GRIB"):
        require_extra("grib")
        return read_in_process(path, box, ground_amsl)
    if not start.startswith((b"\x89HDF", b"CDF")):
        allowed = "expected NetCDF, GRIB, or the JSON of Open-Meteo"
        raise ForecastError(f"{path}: not a forecast: {allowed}", file=str(path), allowed=allowed)
    require_extra("forecast")
    import xarray

    engine = "h5netcdf" if start.startswith(b"\x89HDF") else "scipy"
    dataset = _call_library(
        path, lambda: xarray.open_dataset(path, engine=engine, decode_times=False, decode_timedelta=False)
    )
    return _ForecastReader(path, box, ground_amsl).read([dataset])


def read_grib(path: Path, box: Box, ground_amsl: float) -> Forecast:
    """Read a GRIB file in this process; call `world.forecast.grib_process.read_in_process` instead.

    box, ground_amsl: as for `read_forecast`.
    """
    import cfgrib

    arguments = {"indexpath": "", "errors": "raise"}
    datasets = _call_library(path, lambda: list(cfgrib.open_datasets(str(path), backend_kwargs=arguments)))
    return _ForecastReader(path, box, ground_amsl).read(datasets)


def _call_library(path: Path, function: Callable[[], Any]) -> Any:
    """Call a function of a library, without its warnings, and return its result.

    Libraries raise errors of many kinds for a damaged file. Each of them is raised as a ForecastError with the first
    line of its text.
    """
    hook = sys.unraisablehook
    # Objects of files that could not be opened fail when they are closed, and Python would print the error.
    sys.unraisablehook = lambda _: None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return function()
    except Exception as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0][:150]
        # Close such objects now, while the hook is replaced. It takes 0.3 s in a large process.
        gc.collect()
    finally:
        sys.unraisablehook = hook
    raise ForecastError(f"{path}: damaged or incomplete: {reason}", file=str(path))


class _ForecastReader:
    """Reader of the wind in the xarray datasets of one file.

    Its methods share the axes of the result: times, latitudes and longitudes.

    path: the file.
    box: area around the mission.
    ground_amsl: ground at the mission's start, m AMSL.
    """

    def __init__(self, path: Path, box: Box, ground_amsl: float) -> None:
        self.path, self.box, self.ground_amsl = path, box, ground_amsl
        self.times = self.latitudes = self.longitudes = np.empty(0)
        self.ground: Floats | None = None

    def _error(self, field: str, allowed: str) -> ForecastError:
        """Make the error about a variable of the file; ``allowed`` states the expected values."""
        return ForecastError(f"{self.path}: {field}: {allowed}", file=str(self.path), field=field, allowed=allowed)

    def read(self, datasets: Sequence[Any]) -> Forecast:
        """Return the forecast in the datasets of a file.

        Raises ForecastError if it lacks a required variable, and for a calendar that is not supported.
        """
        import xarray

        # Datasets in which all times are datetime64 and all coordinates are loaded.
        decoded = []
        for dataset in datasets:
            for name, variable in dataset.variables.items():
                calendar = variable.attrs.get("calendar")
                if calendar not in (None, "standard", "gregorian", "proleptic_gregorian"):
                    allowed = "allowed standard, gregorian, proleptic_gregorian"
                    raise self._error(str(name), f"calendar {calendar!r}: {allowed}")
            decode = functools.partial(xarray.decode_cf, dataset, decode_timedelta=False)
            decoded.append(_call_library(self.path, decode))
            for name in decoded[-1].coords:
                _call_library(self.path, decoded[-1].variables[name].load)
        pairs = [pair for dataset in decoded for pair in self._wind_pairs(dataset)]
        if not pairs:
            raise self._error("wind", "missing: no pair of an eastward and a northward wind was found")
        # Axes of the result: the grid of the first variable, and the times common to all variables.
        arrays = [pair[0] for pair in pairs]
        times = [self._valid_times(array)[1] for array in arrays]
        common = functools.reduce(np.intersect1d, times)
        if not len(common):
            raise self._error("time", "the levels have no time in common")
        self.times = common
        self.latitudes, self.longitudes = self._axes_around_box(arrays[0])
        self.ground = self._read_ground(decoded)
        groups = [self._read_level_group(decoded, *pair) for pair in pairs]
        members = {len(group.velocities) for group in groups} - {1}
        if len(members) > 1:
            stated = " and ".join(map(str, sorted(members)))
            raise self._error("members", f"{stated}: expected the same number of members at all levels")
        ground_source = ""
        if any(group.kind == "height" for group in groups):
            ground_source = "of the forecast's model" if self.ground is not None else "at the mission's start"
        altitudes, velocities = merge_levels(groups, self.ground, self.ground_amsl)
        return Forecast(
            source=self.path.name,
            issued=self._find_issue_time(decoded),
            times=self.times,
            latitudes=self.latitudes,
            longitudes=self.longitudes,
            altitudes=altitudes,
            velocities=velocities,
            ground=ground_source,
        )

    # ------------------------------------------------------------------
    # Times.

    def _valid_times(self, array: Any) -> tuple[str | None, Floats]:
        """Return the name of a variable's time dimension, and its times in s since 1970.

        The name is None for a variable with a single time. Raises ForecastError without a usable time coordinate.
        """
        times = _time_coordinates(array)
        for name in ("valid_time", *array.dims, "time", *times):
            coordinate = times.get(str(name))
            if coordinate is None or (name != "valid_time" and coordinate.ndim == 0 and "step" in array.dims):
                continue
            if coordinate.ndim > 1:
                raise self._error(str(name), "the file has several issue times; only one is allowed")
            seconds = (coordinate.values.reshape(-1) - np.datetime64(0, "s")) / np.timedelta64(1, "s")
            if not np.isfinite(seconds).all() or (np.diff(seconds) <= 0.0).any():
                raise self._error(str(name), "the times are not in ascending order")
            return (str(coordinate.dims[0]) if coordinate.ndim else None), seconds.astype(np.float64)
        raise self._error("time", f"missing for {array.name}: a coordinate in hours or seconds since a date is needed")

    def _find_issue_time(self, decoded: Sequence[Any]) -> datetime | None:
        """Return the time at which the forecast was issued, or None if the file does not state it.

        decoded: datasets of the file, with decoded times. An analysis of several times has no time of issue.
        """
        for dataset in decoded:
            for name, variable in dataset.variables.items():
                is_issue = variable.attrs.get("standard_name") == "forecast_reference_time"
                is_grib_time = name == "time" and "valid_time" in dataset.variables
                if (is_issue or is_grib_time) and np.issubdtype(variable.dtype, np.datetime64) and variable.size == 1:
                    seconds = (variable.values.reshape(-1)[0] - np.datetime64(0, "s")) / np.timedelta64(1, "s")
                    if np.isfinite(seconds):
                        return datetime.fromtimestamp(float(seconds), UTC)
        return None

    # ------------------------------------------------------------------
    # Axes.

    def _lat_lon_coordinates(self, array: Any) -> tuple[Any, Any]:
        """Return the latitude and longitude coordinates of a variable. Raises ForecastError if one is missing."""
        coordinates = []
        for standard_name, names in (("latitude", ("lat", "latitude")), ("longitude", ("lon", "longitude"))):
            for name, coordinate in array.coords.items():
                if coordinate.attrs.get("standard_name") == standard_name or str(name).lower() in names:
                    coordinates.append(coordinate)
                    break
            else:
                raise self._error(standard_name, f"missing for {array.name}")
        return coordinates[0], coordinates[1]

    def _axes_around_box(self, array: Any) -> tuple[Floats, Floats]:
        """Return the latitudes and longitudes of a variable's nodes around the box, in ascending order, deg.

        For a grid with two-dimensional coordinates, they are the axes of the regular grid to interpolate to. Raises
        ForecastError if the box is outside the grid.
        """
        latitude, longitude = self._lat_lon_coordinates(array)
        if latitude.ndim == 2:
            # Grids with two-dimensional coordinates are interpolated to a regular grid.
            axes = regular_axes(latitude.values, longitude.values, self.box)
            if axes is None:
                raise self._error("latitude, longitude", "the mission is outside the forecast's grid")
            return axes
        rows, columns = self._node_indices(latitude, longitude)
        center = 0.5 * (self.box.west + self.box.east)
        wrapped_longitudes = center + (longitude.values.reshape(-1) - center + 180.0) % 360.0 - 180.0
        return latitude.values.reshape(-1)[rows].astype(np.float64), wrapped_longitudes[columns].astype(np.float64)

    def _node_indices(self, latitude: Any, longitude: Any) -> tuple[Any, Any]:
        """Return the indices of the rows and columns of nodes around the box.

        They are in order of ascending latitude and longitude.

        latitude, longitude: coordinates of the file's regular grid.

        Raises ForecastError if the grid is unsuitable, or if its nodes around the box are too far apart.
        """
        center = 0.5 * (self.box.west + self.box.east)
        wrapped_longitudes = center + (longitude.values.reshape(-1).astype(np.float64) - center + 180.0) % 360.0 - 180.0
        indices = []
        for name, values, low, high in (
            ("latitude", latitude.values.reshape(-1).astype(np.float64), self.box.south, self.box.north),
            ("longitude", wrapped_longitudes, self.box.west, self.box.east),
        ):
            if len(values) < 2:
                raise self._error(name, "only one grid node; expected at least two around the mission")
            if not np.isfinite(values).all() or (name == "latitude" and np.abs(values).max() > 90.0):
                raise self._error(name, "expected numbers of degrees")
            steps = np.diff(values)
            if name == "latitude" and not ((steps > 0.0).all() or (steps < 0.0).all()):
                raise self._error(name, "neither ascending nor descending")
            order = np.argsort(values, kind="stable")
            ordered = values[order]
            if (np.diff(ordered) <= 0.0).any():
                raise self._error(name, "two nodes at the same place")
            first = max(0, int(np.searchsorted(ordered, low, side="right")) - 1)
            last = min(len(ordered), int(np.searchsorted(ordered, high, side="left")) + 1)
            first, last = min(first, len(ordered) - 2), max(last, 2)
            selected = slice(first, max(last, first + 2))
            # The first and last node of a file that does not cover all longitudes are not neighbours.
            gap = float(np.diff(ordered[selected]).max())
            if gap > MAX_SPACING_DEG:
                raise self._error(
                    name, f"nodes {gap:.3g}° apart around the mission: allowed up to {MAX_SPACING_DEG:g}°"
                )
            indices.append(order[selected])
        return indices[0], indices[1]

    # ------------------------------------------------------------------
    # Winds.

    def _read_ground(self, datasets: Sequence[Any]) -> Floats | None:
        """Return the altitude of the ground in the forecast's model, (y, x) m AMSL; None if not stated."""
        for dataset in datasets:
            for name, array in dataset.data_vars.items():
                # The ground has no level, and is the same at all times and for all members.
                is_surface = array.attrs.get("GRIB_typeOfLevel") == "surface" and _is_height(name, array)
                is_named = bool(_names_of(name, array) & _GROUND_NAMES)
                if not (is_surface or is_named) or self._find_level(array, name) is not None:
                    continue
                times = [coordinate.dims for coordinate in _time_coordinates(array).values()]
                dims = {*(dim for names in times for dim in names), *(dim for dim in array.dims if dim in _MEMBER_DIMS)}
                first = array.isel(dict.fromkeys(dims, 0), drop=True)
                heights: Floats = self._read_values(first.drop_vars(_time_coordinates(first)))[0, 0, ..., 0]
                if not np.isfinite(heights).all():
                    raise self._error(str(name), "values are missing around the mission")
                return heights * self._height_factor(array)
        return None

    def _height_factor(self, array: Any) -> float:
        """Return the factor that converts a height or a geopotential to m.

        Raises ForecastError for other units.
        """
        units = array.attrs.get("units")
        factor = unit_factor(units, HEIGHT_UNITS)
        if factor is None and str(units).replace(" ", "") in GEOPOTENTIAL_UNITS:
            factor = 1.0 / GRAVITY_STANDARD
        if factor is None:
            raise self._error(str(array.name), f"units {units!r}: allowed m, gpm, m2 s-2")
        return factor

    def _wind_pairs(self, dataset: Any) -> Iterator[tuple[Any, Any]]:
        """Yield each eastward wind of a dataset with its northward wind, whose name has v in place of u.

        A single eastward and a single northward wind belong together whatever their names are.
        Raises an error for a wind without its other component, and for components of different dimensions.
        """
        variables = dataset.data_vars.items()
        east = {str(name): array for name, array in variables if _is_component(name, array, _U_NAME, _EAST_NAMES)}
        north = {str(name): array for name, array in variables if _is_component(name, array, _V_NAME, _NORTH_NAMES)}
        for name, array in east.items():
            partners = [north_name for north_name in north if _partner_key(north_name, "v") == _partner_key(name, "u")]
            if not partners and len(east) == len(north) == 1:
                partners = list(north)
            if not partners:
                raise self._error(name, "the northward wind that belongs to it is missing")
            partner = north.pop(partners[0])
            if set(partner.dims) != set(array.dims):
                raise self._error(str(partner.name), f"its dimensions differ from those of {name}")
            yield array, partner
        if north:
            raise self._error(next(iter(north)), "the eastward wind that belongs to it is missing")

    def _find_level(self, array: Any, name: Any) -> tuple[LevelKind, str | None, Floats] | None:
        """Return the kind of a variable's levels, their dimension, and their values; None without levels.

        name: name of the variable, which may state a height above ground.

        The dimension is None for a single level. The values are hPa, m above ground or m AMSL.
        """
        for coordinate_name, coordinate in array.coords.items():
            kind = self._level_kind(str(coordinate_name), coordinate)
            if kind is None or coordinate.ndim > 1:
                continue
            units = PRESSURE_UNITS if kind == "pressure" else HEIGHT_UNITS
            factor = unit_factor(coordinate.attrs.get("units"), units)
            if factor is None:
                stated = coordinate.attrs.get("units")
                raise self._error(str(coordinate_name), f"units {stated!r}: allowed {', '.join(sorted(units))}")
            values = coordinate.values.reshape(-1).astype(np.float64) * factor
            return kind, (str(coordinate.dims[0]) if coordinate.ndim else None), values
        if match := _HEIGHT_IN_NAME.search(str(name)):
            return "height", None, np.array([float(match[1] or match[2])])
        return None

    @staticmethod
    def _level_kind(name: str, coordinate: Any) -> LevelKind | None:
        """Return the kind of level that a coordinate states, or None if it states no level."""
        standard_name, lower = str(coordinate.attrs.get("standard_name", "")), name.lower()
        units = coordinate.attrs.get("units")
        texts = " ".join((lower, standard_name, str(coordinate.attrs.get("long_name", "")))).lower()
        if standard_name == "air_pressure" or lower.startswith(("isobaric", "plev", "pressure")):
            return "pressure"
        if lower in ("level", "lev") and unit_factor(units, PRESSURE_UNITS) is not None:
            return "pressure"
        if "ellipsoid" in texts:
            return None
        is_above_sea = "sea" in texts or "msl" in texts or standard_name == "height_above_geopotential_datum"
        if standard_name == "altitude" or lower in ("altitude", "alt"):
            return "altitude"
        if standard_name.startswith("height") or lower.startswith("height"):
            return "altitude" if is_above_sea else "height"
        return None

    def _read_level_group(self, datasets: Sequence[Any], east: Any, north: Any) -> LevelGroup:
        """Read the wind of one pair of variables, with the altitudes or heights of its levels.

        datasets: datasets of the file, in which the heights of pressure levels are looked up.
        east, north: variables of the eastward and the northward wind.

        Levels without any value around the mission are left out. Raises ForecastError for a level with only some
        values, for no level at all, and for winds that are not plausible.
        """
        level = self._find_level(east, east.name)
        if level is None:
            raise self._error(
                str(east.name), "its level is not stated; expected a pressure, a height above ground or an altitude"
            )
        kind, dim, values = level
        components = []
        for array in (east, north):
            factor = unit_factor(array.attrs.get("units"), SPEED_UNITS)
            if factor is None:
                stated = array.attrs.get("units")
                raise self._error(str(array.name), f"units {stated!r}: allowed {', '.join(sorted(SPEED_UNITS))}")
            components.append(self._read_values(array, dim) * factor)
        velocities = np.stack(components, axis=-1)
        attributes = east.attrs
        if attributes.get("standard_name") == "x_wind" or attributes.get("GRIB_uvRelativeToGrid") == 1:
            # The components are along the axes of the grid, not along east and north.
            latitude, longitude = self._lat_lon_coordinates(east)
            # A regular grid has its axes along east and north.
            if latitude.ndim == 2:
                rotate_to_north(velocities, latitude.values, longitude.values, self.latitudes, self.longitudes)
        shape = velocities.shape[1:-1]
        altitudes = np.broadcast_to(
            self._pressure_level_altitudes(datasets, east) if kind == "pressure" else values, shape
        )
        is_missing = ~np.isfinite(velocities).all(axis=(0, -1)) | ~np.isfinite(altitudes)
        is_used = ~is_missing.all(axis=(0, 1, 2))
        if not is_used.any():
            raise self._error(str(east.name), "no value around the mission")
        if is_missing[..., is_used].any():
            t, *_, k = (int(index) for index in np.argwhere(is_missing & is_used)[0])
            time = datetime.fromtimestamp(float(self.times[t]), UTC)
            unit = {"pressure": "hPa", "height": "m above ground", "altitude": "m"}[kind]
            raise self._error(
                f"{east.name}, {north.name}",
                f"values are missing around the mission, the first at {values[k]:g} {unit}, {time:%Y-%m-%d %H:%M} UTC",
            )
        for fill in FILL_VALUES:
            if (velocities[..., is_used, :] == fill).any():
                stated = f"values of {fill:g} around the mission: a fill value that the file does not declare"
                raise self._error(f"{east.name}, {north.name}", stated)
        if np.abs(velocities[..., is_used, :]).max() > MAX_WIND_MPS:
            largest = float(np.abs(velocities[..., is_used, :]).max())
            raise self._error(f"{east.name}, {north.name}", f"{largest:.4g} m/s: allowed up to {MAX_WIND_MPS:g} m/s")
        return LevelGroup(kind, np.ascontiguousarray(altitudes[..., is_used]), velocities[..., is_used, :])

    def _pressure_level_altitudes(self, datasets: Sequence[Any], wind: Any) -> Floats:
        """Return the altitudes of a wind's pressure levels, (t, y, x, k) m AMSL, from the geopotential height.

        wind: a wind variable of the dataset.

        Raises ForecastError if no dataset contains the geopotential height of these levels.
        """
        wind_level = self._find_level(wind, wind.name)
        for dataset in datasets:
            for name, array in dataset.data_vars.items():
                if not _is_height(name, array):
                    continue
                level = self._find_level(array, name)
                if level is None or wind_level is None or level[0] != "pressure":
                    continue
                if not np.array_equal(level[2], wind_level[2]):
                    raise self._error(str(name), f"its pressure levels differ from those of {wind.name}")
                heights: Floats = self._read_values(array, level[1]).mean(axis=0) * self._height_factor(array)
                rises = np.diff(heights[..., np.argsort(-level[2])], axis=-1)
                if (rises <= 0.0).any():
                    raise self._error(
                        str(name), "the heights of its levels do not increase from high pressure to low pressure"
                    )
                return heights
        raise self._error(
            str(wind.name), "the geopotential height of its pressure levels is missing (gh, HGT, z): add it to the file"
        )

    def _read_values(self, array: Any, level_dim: str | None = None) -> Floats:
        """Return the values of a variable around the box at the common times, (m, t, y, x, k).

        level_dim: name of the dimension of the levels; None for a single level.

        m is the number of members, and t is 1 for a variable without times. Raises ForecastError for another grid.
        """
        latitude, longitude = self._lat_lon_coordinates(array)
        axes = self._axes_around_box(array)
        if any(not np.array_equal(*pair) for pair in zip(axes, (self.latitudes, self.longitudes), strict=True)):
            raise self._error(str(array.name), "its grid differs from the grid of the other variables")
        time_dim = None
        if _time_coordinates(array):
            time_dim, times = self._valid_times(array)
            if not np.isin(self.times, times).all():
                raise self._error(str(array.name), "its times differ from the times of the winds")
            if time_dim is not None:
                array = array.isel({time_dim: np.flatnonzero(np.isin(times, self.times))})
        member_dim = next((str(dim) for dim in array.dims if str(dim) in _MEMBER_DIMS), None)
        grid_dims = [
            *(str(dim) for dim in latitude.dims),
            *(str(dim) for dim in longitude.dims if dim not in latitude.dims),
        ]
        known_dims = {time_dim, member_dim, level_dim, *grid_dims}
        unknown_dims = [str(dim) for dim in array.dims if dim not in known_dims]
        if any(array.sizes[dim] > 1 for dim in unknown_dims):
            raise self._error(
                str(array.name), f"dimension {unknown_dims[0]!r} is not known: allowed time, level, member and place"
            )
        array = array.isel(dict.fromkeys(unknown_dims, 0))
        if latitude.ndim == 1:
            nodes = self._node_indices(latitude, longitude)
        else:
            nodes = near_nodes(latitude.values, longitude.values, self.latitudes, self.longitudes)
        array = array.isel(dict(zip(grid_dims, nodes, strict=True)))
        if array.size > MAX_NODES:
            raise self._error(str(array.name), f"{array.size:,} values around the mission: allowed up to {MAX_NODES:,}")
        array = _call_library(self.path, array.load)
        for dim, name in ((member_dim, "_member"), (time_dim, "_time"), (level_dim, "_level")):
            array = array.expand_dims(name) if dim is None else array.rename({dim: name})
        values = array.transpose("_member", "_time", *grid_dims, "_level").values.astype(np.float64)
        if latitude.ndim == 2:
            node_indices = np.ix_(*nodes)
            values = regrid(values, latitude.values[node_indices], longitude.values[node_indices], *axes)
        return values


# ----------------------------------------------------------------------
# Names of variables.


def _names_of(name: Any, array: Any) -> set[str]:
    """Return the names by which a variable may be identified, in lower case."""
    stated = (name, array.attrs.get("standard_name"), array.attrs.get("GRIB_shortName"))
    return {str(text).lower() for text in stated if text is not None}


def _time_coordinates(array: Any) -> dict[str, Any]:
    """Return the coordinates of a variable that are times, by name; the time of issue is left out."""
    return {
        str(name): coordinate
        for name, coordinate in array.coords.items()
        if np.issubdtype(coordinate.dtype, np.datetime64)
        and coordinate.attrs.get("standard_name") != "forecast_reference_time"
    }


def _is_component(name: Any, array: Any, pattern: re.Pattern[str], standard_names: tuple[str, ...]) -> bool:
    """Return True if a variable is a component of the wind.

    The CF standard name decides, or else the variable's own name.

    pattern: names of the component in files without standard names.
    standard_names: standard names of the component.
    """
    standard_name = str(array.attrs.get("standard_name", ""))
    is_other_quantity = standard_name not in ("", "unknown") and "wind" not in standard_name
    return standard_name in standard_names or (pattern.match(str(name)) is not None and not is_other_quantity)


def _is_height(name: Any, array: Any) -> bool:
    """Return True if a variable is a geopotential or a geopotential height."""
    return any(text in _HEIGHT_NAMES or text.startswith("geopotential") for text in _names_of(name, array))


def _partner_key(name: str, letter: str) -> str:
    """Return the name of a wind component without its axis.

    Both components of a wind have the same key.

    letter: letter of the axis, "u" or "v".

    >>> _partner_key("u10", "u") == _partner_key("v10", "v")
    True
    """
    lower = name.lower()
    for words in (("eastward", "northward"), ("x_wind", "y_wind")):
        lower = lower.replace(words[0], "").replace(words[1], "")
    return re.sub(rf"(^|(?<=[_\d])){letter}", "", lower, count=1)
