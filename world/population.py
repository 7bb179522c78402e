"""Read a population raster, and find the population density in an area.

Rasters of two kinds are common: people per cell (GHS-POP in Mollweide, WorldPop in degrees), and people per km2. The
area of a cell is its area on the ellipsoid, computed by projecting its corners onto an equal-area cylinder.
"""

import math
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from world.arrays import Flags, Floats
from world.errors import PlanflyError
from world.frames import GeoOrigin, crs_transformer, is_geographic, to_equal_area, to_geo, to_map
from world.gdal_raster import GUARD, MAX_BLOCK_PIXELS, METRES, clear_unwritten, first_error_line, open_dataset
from world.raster_file import longitude_near, one_line

PopulationUnit = Literal["per-cell", "per-km2"]
# Upper limits of the population densities of SORA 2.5, main body, table 2, people per km2.
DENSITY_LIMITS_PER_KM2 = (5.0, 50.0, 500.0, 5000.0, 50_000.0)
# Highest density that a raster may have, people per km2: the densest cells of 100 m hold some 200,000.
_MAX_DENSITY_PER_KM2 = 1e6
# Largest number of cells that are read.
_MAX_CELLS = 4_000_000
# Spacing of the points of an outline that is converted to the raster's reference system, m.
_OUTLINE_SPACING_M = 50.0
# Ratio of an area's size in the raster to its size on the map above which the raster tears the area apart.
_MAX_STRETCH = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """Population in an area.

    source: file of the raster.
    known_fraction: fraction of the area's cells that have data; the area's cells are all cells that it touches.
    max_density, mean_density: highest and mean density of these cells, people per km2.
    max_position: latitude and longitude of the centre of the densest cell, degrees.
    max_place: east and north of this centre on the map, m.
    cell_size: square root of the mean area of the cells, m.
    bands: areas on the map with densities in each band of `DENSITY_LIMITS_PER_KM2`, also around the area: the band's
        number, from 0 below the first limit, and its area.
    """

    source: str
    known_fraction: float
    max_density: float
    mean_density: float
    max_position: tuple[float, float]
    max_place: tuple[float, float]
    cell_size: float
    bands: tuple[tuple[int, BaseGeometry], ...] = ()

    @property
    def is_complete(self) -> bool:
        """True if every cell of the area has data."""
        return self.known_fraction == 1.0


def density_band(density: float) -> int:
    """Return the number of the band of a population density (people per km2).

    The bands lie between the limits of SORA 2.5.

    Band 0 is below 5 people per km2, and band 5 starts at 50,000 people per km2.

    >>> density_band(4.9), density_band(5.0), density_band(60_000.0)
    (0, 1, 5)
    """
    return int(np.searchsorted(DENSITY_LIMITS_PER_KM2, density, side="right"))


def format_density(density: float) -> str:
    """Format a population density, people per km2.

    >>> format_density(30_000.0), format_density(299.94), format_density(3.0)
    ('30,000 people/km²', '299.9 people/km²', '3 people/km²')
    """
    return f"{density:,.0f} people/km²" if density >= 1000.0 else f"{density:,.4g} people/km²"


def read_population(file: Path, unit: PopulationUnit, origin: GeoOrigin, area: BaseGeometry) -> Population:
    """Read the population in an area from a GeoTIFF.

    unit: unit of the raster's numbers, "per-cell" or "per-km2".
    origin: origin of the map.
    area: polygons on the map, m.

    Raises PlanflyError for a file that is not a population raster, that has no data in the area, or that has a cell
    with an implausible density there.
    """
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning, RasterioError

    if not file.is_file():
        raise PlanflyError(f"{file}: no such file", file=file)
    try:
        with warnings.catch_warnings(), rasterio.Env(**GUARD):
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with open_dataset(file, "GTiff") as source:
                _check_source(file, source, unit)
                window = _Window.around(file, source, origin, area)
                values = window.read(source)
    except (RasterioError, ValueError, TypeError, OSError) as error:
        raise PlanflyError(
            f"{file}: not a readable population raster (GeoTIFF): {first_error_line(error)}", file=file
        ) from error
    cell_areas = window.cell_areas_km2()
    densities = values / cell_areas if unit == "per-cell" else values
    is_inside = window.touched_cells()
    is_bad = is_inside & ((densities < 0.0) | (densities > _MAX_DENSITY_PER_KM2))
    if is_bad.any():
        row, column = (int(index[0]) for index in np.nonzero(is_bad))
        lat, lon = window.cell_centre(row, column)
        density = float(densities[row, column])
        allowed = f"at latitude {lat:.5f}, longitude {lon:.5f}: allowed 0..{_MAX_DENSITY_PER_KM2:,.0f} people per km2"
        if density < 0.0:
            allowed += "; does the file state its NoData value?"
        elif unit == "per-cell":
            allowed += "; for a raster of densities the population unit is per-km2"
        raise PlanflyError.at(file, "population density", density, allowed, shown=f"{density:.6g}")
    known = is_inside & np.isfinite(densities)
    if not known.any():
        raise PlanflyError(f"{file}: no data in the ground risk buffer; {window.coverage_text()}", file=file)
    densest = np.unravel_index(int(np.argmax(np.where(known, densities, -1.0))), densities.shape)
    lat, lon = window.cell_centre(int(densest[0]), int(densest[1]))
    east, north = to_map(origin, lat, lon)
    return Population(
        source=str(file),
        known_fraction=float(known.sum() / is_inside.sum()),
        max_density=float(densities[densest]),
        mean_density=float(np.average(densities[known], weights=cell_areas[known])),
        max_position=(lat, lon),
        max_place=(float(east), float(north)),
        cell_size=1000.0 * math.sqrt(float(cell_areas[known].mean())),
        bands=window.density_bands(densities),
    )


def _check_source(file: Path, source: Any, unit: PopulationUnit) -> None:
    """Raise PlanflyError unless an open raster can be a population raster.

    It needs one band of numbers, a position on Earth, and people as its unit.
    """
    number_kind = np.dtype(source.dtypes[0]).kind
    if source.count != 1 or number_kind not in "iuf":
        allowed = "a population raster has 1 band of numbers"
        raise PlanflyError.at(file, "bands", source.count, allowed, shown=f"{source.count} of kind {number_kind!r}")
    block_pixels = math.prod(source.block_shapes[0])
    if block_pixels > MAX_BLOCK_PIXELS:
        allowed = f"at most {MAX_BLOCK_PIXELS:,} are read at once; save the file with tiles"
        raise PlanflyError.at(file, "pixels of a block", block_pixels, allowed, shown=f"{block_pixels:,}")
    if source.crs is None or source.transform.is_identity or source.transform.determinant == 0.0:
        raise PlanflyError(f"{file}: no coordinate reference system and position are stated", file=file)
    stated = (source.units[0] or "").lower()
    if stated in METRES or (unit == "per-cell" and "km" in stated):
        expected = "expected people per cell, or people per km2 with the population unit per-km2"
        raise PlanflyError.at(file, "unit", stated, expected)


def _transformed(grid: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Return x and y (numbers or arrays) transformed by an affine transformation of rasterio."""
    return grid.a * x + grid.b * y + grid.c, grid.d * x + grid.e * y + grid.f


@dataclass(frozen=True, slots=True, eq=False)
class _Window:
    """Window of a raster around an area; it may reach beyond the raster.

    transform: from columns and rows of the window to coordinates of the raster's reference system.
    shape: number of rows and columns.
    first: row and column of the raster at which the window starts; negative beyond the raster's edge.
    source_shape: number of rows and columns of the raster.
    source_transform: as `transform`, but from columns and rows of the raster.
    outline: area in the raster's reference system.
    transformer: from WGS84 to the raster's reference system.
    origin: origin of the map.
    """

    transform: Any
    shape: tuple[int, int]
    first: tuple[int, int]
    source_shape: tuple[int, int]
    source_transform: Any
    outline: BaseGeometry
    transformer: Any
    origin: GeoOrigin

    @classmethod
    def around(cls, file: Path, source: Any, origin: GeoOrigin, area: BaseGeometry) -> "_Window":
        """Make the window of an open raster that encloses an area on the map.

        Raises PlanflyError if the raster's reference system is unknown or tears the area apart, or if the window is too
        large.
        """
        wkt = source.crs.to_wkt(version="WKT2_2019")
        try:
            transformer = crs_transformer(wkt)
        except ValueError as error:
            raise PlanflyError(f"{file}: its reference system cannot be read: {one_line(error)}", file=file) from error
        grid, rows, columns = source.transform, source.height, source.width
        middle_longitude, _ = _transformed(grid, columns / 2, rows / 2)
        in_degrees = is_geographic(wkt)

        def to_raster(points: Floats) -> Floats:
            """Convert map positions, (n, 2), to coordinates in the raster's reference system."""
            lat, lon = to_geo(origin, points[:, 0], points[:, 1])
            x, y = transformer.transform(lon, lat)
            return np.column_stack([longitude_near(np.asarray(x), middle_longitude) if in_degrees else x, y])

        outline = shapely.transform(shapely.segmentize(area, _OUTLINE_SPACING_M), to_raster)
        bounds = np.array(outline.bounds)
        spans = (bounds[2:] - bounds[:2]) if np.isfinite(bounds).all() else np.full(2, math.inf)
        map_bounds = np.array(area.bounds)
        largest_span = 180.0 if in_degrees else _MAX_STRETCH * float((map_bounds[2:] - map_bounds[:2]).max())
        if not spans.max() < largest_span:
            raise PlanflyError(
                f"{file}: the ground risk buffer lies across the edge of the raster's reference system, such as the"
                " antimeridian; convert the raster to a local reference system",
                file=file,
            )
        corners = shapely.get_coordinates(shapely.box(*bounds))
        column, row = _transformed(~grid, corners[:, 0], corners[:, 1])
        left, top = math.floor(column.min()), math.floor(row.min())
        shape = (max(1, math.ceil(row.max()) - top), max(1, math.ceil(column.max()) - left))
        if math.prod(shape) > _MAX_CELLS:
            message = f"{file}: the ground risk buffer has {math.prod(shape):,} cells; at most {_MAX_CELLS:,} are read"
            raise PlanflyError(message, file=file)
        # Transformation of the same grid for columns and rows that are counted from the window's first cell.
        west, north = _transformed(grid, left, top)
        transform = type(grid)(grid.a, grid.b, west, grid.d, grid.e, north)
        return cls(transform, shape, (top, left), (rows, columns), grid, outline, transformer, origin)

    def read(self, source: Any) -> Floats:
        """Read the numbers of the window; NaN beyond the raster, and for cells without data."""
        (top, left), (rows, columns) = self.first, self.shape
        values = np.full(self.shape, math.nan)
        first_row, last_row = max(0, top), min(self.source_shape[0], top + rows)
        first_column, last_column = max(0, left), min(self.source_shape[1], left + columns)
        if first_row >= last_row or first_column >= last_column:
            return values
        part = source.read(1, window=((first_row, last_row), (first_column, last_column)), masked=True)
        numbers = np.ma.filled(part.astype(np.float64), np.nan) * source.scales[0] + source.offsets[0]
        if source.nodata is None:
            clear_unwritten(source, numbers, first_row, first_column)
        numbers[~np.isfinite(numbers)] = math.nan
        values[first_row - top : last_row - top, first_column - left : last_column - left] = numbers
        return values

    def touched_cells(self) -> Flags:
        """Return a mask (rows, columns), True for the cells that the area touches."""
        from rasterio.features import geometry_mask

        return np.asarray(
            geometry_mask([self.outline], self.shape, self.transform, all_touched=True, invert=True), dtype=np.bool_
        )

    def to_lon_lat(self, columns: Floats, rows: Floats) -> tuple[Floats, Floats]:
        """Convert columns and rows of the window to longitudes and latitudes, deg.

        Integers are corners of cells.
        """
        lon, lat = self.transformer.transform(*_transformed(self.transform, columns, rows), direction="INVERSE")
        return np.asarray(lon), np.asarray(lat)

    def cell_areas_km2(self) -> Floats:
        """Return the areas of the cells on the ellipsoid, km2, (rows, columns)."""
        columns, rows = np.meshgrid(np.arange(self.shape[1] + 1.0), np.arange(self.shape[0] + 1.0))
        lon, lat = self.to_lon_lat(columns, rows)
        x, y = to_equal_area(self.origin, lat, lon)
        # Half the cross product of the diagonals.
        down_x, down_y = x[1:, 1:] - x[:-1, :-1], y[1:, 1:] - y[:-1, :-1]
        up_x, up_y = x[:-1, 1:] - x[1:, :-1], y[:-1, 1:] - y[1:, :-1]
        return np.asarray(0.5e-6 * np.abs(down_x * up_y - down_y * up_x))

    def cell_centre(self, row: int, column: int) -> tuple[float, float]:
        """Return the latitude and longitude of a cell's centre, degrees; the cell is given in the window."""
        lon, lat = self.to_lon_lat(np.array([column + 0.5]), np.array([row + 0.5]))
        return float(lat[0]), float(longitude_near(float(lon[0]), 0.0))

    def coverage_text(self) -> str:
        """Return the range of latitudes and longitudes that the raster covers, as text for a message."""
        rows, columns = self.source_shape
        x, y = _transformed(self.source_transform, np.array([0, columns, 0, columns]), np.array([0, 0, rows, rows]))
        lon, lat = (np.asarray(values) for values in self.transformer.transform(x, y, direction="INVERSE"))
        if not np.isfinite([lon, lat]).all():
            return "the file lies elsewhere"
        return f"the file covers latitude {lat.min():.3f}..{lat.max():.3f}, longitude {lon.min():.3f}..{lon.max():.3f}"

    def density_bands(self, densities: Floats) -> tuple[tuple[int, BaseGeometry], ...]:
        """Return (band number, area on the map, m) for each density band in the window, lowest first.

        densities: people per km2, (rows, columns); NaN for cells without data, which are in no band.
        """
        from rasterio.features import shapes

        bands = np.searchsorted(DENSITY_LIMITS_PER_KM2, densities, side="right").astype(np.int16)
        areas: dict[int, list[BaseGeometry]] = {}
        for outline, band in shapes(bands, mask=np.isfinite(densities), transform=self.transform):
            areas.setdefault(int(band), []).append(shapely.geometry.shape(outline))

        def to_plane(points: Floats) -> Floats:
            """Convert coordinates in the raster's reference system, (n, 2), to map positions."""
            lon, lat = self.transformer.transform(points[:, 0], points[:, 1], direction="INVERSE")
            return np.column_stack(to_map(self.origin, lat, lon))

        return tuple((band, shapely.transform(shapely.MultiPolygon(areas[band]), to_plane)) for band in sorted(areas))
