"""Map frames: the azimuthal equidistant plane about an origin.

Conversions have fast polynomial approximations.

World axes are ``east, north, up``: east and north in the AEQD plane on WGS84, up the height above mean sea level.
Altitude is separate from the map, so that the curvature of the Earth does not affect it.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from world.arrays import Floats
from world.kernels import compiled, inlined
from world.least_squares import least_squares

if TYPE_CHECKING:
    from pyproj import Proj, Transformer


# Number of terms along each axis of the largest polynomial of a `PolyMap`, of degree 9.
MAX_TERMS = 10
# A polynomial map of the plane.  With a and b the position relative to the centre in half-widths of the rectangle, its
# components are the sums of u[i, j] * a**i * b**j and of v[i, j] * a**i * b**j over i + j < size.
POLYMAP = np.dtype(
    [
        ("centre_x", np.float64),
        ("centre_y", np.float64),
        ("half_x", np.float64),
        ("half_y", np.float64),
        ("size", np.int64),
        ("u", np.float64, (MAX_TERMS, MAX_TERMS)),
        ("v", np.float64, (MAX_TERMS, MAX_TERMS)),
    ],
    align=True,
)
# One record of that dtype.  Compiled code reads its fields as attributes, which numpy's static type does not declare.
PolyMapRecord = Any


@dataclass(frozen=True, slots=True)
class GeoOrigin:
    """Origin of a map: the point on WGS84 where east = north = 0."""

    lat_deg: float
    lon_deg: float


@lru_cache(maxsize=32)
def _make_projection(origin: GeoOrigin) -> "Proj":
    """Make the azimuthal equidistant projection about an origin."""
    # Imported here and below, as pyproj imports an HTTP client, and a scenario in metres needs neither.
    from pyproj import Proj

    return Proj(proj="aeqd", lat_0=origin.lat_deg, lon_0=origin.lon_deg, ellps="WGS84")


def to_map(origin: GeoOrigin, lat_deg: ArrayLike, lon_deg: ArrayLike) -> tuple[Floats, Floats]:
    """Convert latitudes and longitudes in degrees to east and north in metres, arrays of the same shape.

    >>> east, north = to_map(GeoOrigin(46.0, 8.0), [46.0, 46.01], [8.01, 8.0])
    >>> east.round(1).tolist(), north.round(1).tolist()
    ([774.6, 0.0], [0.0, 1111.5])
    """
    return transform_points(
        _make_projection(origin), np.asarray(lon_deg, dtype=np.float64), np.asarray(lat_deg, dtype=np.float64)
    )


def to_geo(origin: GeoOrigin, east: ArrayLike, north: ArrayLike) -> tuple[Floats, Floats]:
    """Convert east and north in metres to latitude and longitude in degrees, arrays of the same shape.

    >>> lat, lon = to_geo(GeoOrigin(46.0, 8.0), 0.0, 10_000.0)
    >>> float(lat.round(6)), float(lon.round(6))
    (46.089967, 8.0)
    """
    inverse = partial(_make_projection(origin), inverse=True)
    lon, lat = transform_points(inverse, np.asarray(east, dtype=np.float64), np.asarray(north, dtype=np.float64))
    return lat, lon


def to_equal_area(origin: GeoOrigin, lat_deg: Floats, lon_deg: Floats) -> tuple[Floats, Floats]:
    """Convert latitudes and longitudes in degrees to an equal-area plane; return x and y, m.

    >>> x, y = to_equal_area(GeoOrigin(0.0, 8.0), np.array([0.0, 90.0]), np.array([188.0, 8.0]))
    >>> bool(abs(4.0 * abs(x[0] * y[1]) / 5.10065621724e14 - 1.0) < 1e-9)
    True
    """
    from pyproj import Proj

    return transform_points(Proj(proj="cea", lon_0=origin.lon_deg, ellps="WGS84"), lon_deg, lat_deg)


def transform_points(transform: Callable[..., Any], x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Call a transformation of pyproj on the coordinates of points.

    The results have the shape of the arguments.

    For one point, pyproj would lose the shape of the array, and NumPy before 2.4 would warn.

    >>> transform_points(lambda x, y: (x + 1.0, y), np.array([1.0]), np.array([2.0]))
    (array([2.]), array([2.]))
    """
    if x.shape == y.shape and x.size == 1:
        first, second = transform(x.item(), y.item())
        return np.full(x.shape, first), np.full(x.shape, second)
    first, second = transform(x, y)
    return np.asarray(first), np.asarray(second)


def crs_transformer(crs: str) -> "Transformer":
    """Return a transformer from WGS84 longitude and latitude (deg) to x and y of a CRS (reference system).

    Heights must not be transformed with it, because PROJ without a geoid grid silently returns them unchanged. Raises
    ValueError for a CRS that PROJ does not know.
    """
    from pyproj import CRS, Transformer
    from pyproj.exceptions import ProjError

    try:
        return Transformer.from_crs(CRS.from_epsg(4326), CRS.from_user_input(crs), always_xy=True)
    except ProjError as error:
        raise ValueError(str(error)) from error


def height_unit(crs: str) -> tuple[str, float]:
    """Return the name of a CRS's height unit, and the length of this unit, m.

    The result is ("metre", 1) for a CRS without heights. Raises ValueError for a CRS that PROJ does not know.
    """
    from pyproj import CRS
    from pyproj.exceptions import ProjError

    try:
        axes = CRS.from_user_input(crs).axis_info
    except ProjError as error:
        raise ValueError(str(error)) from error
    return next(
        ((axis.unit_name, axis.unit_conversion_factor) for axis in axes if axis.direction in ("up", "down")),
        ("metre", 1.0),
    )


def crs_to_wkt(crs: str, *, with_height: bool = False) -> str:
    """Convert the name of a CRS that PROJ knows, such as "EPSG:4326", to well-known text.

    with_height: True to add the height above the ellipsoid to a two-dimensional CRS.
    """
    from pyproj import CRS

    system = CRS.from_user_input(crs)
    return str((system.to_3d() if with_height else system).to_wkt())


def is_geographic(crs: str) -> bool:
    """Return True if a CRS uses degrees of longitude and latitude.

    >>> is_geographic("EPSG:4326+5773"), is_geographic("EPSG:32632")
    (True, False)
    """
    from pyproj import CRS

    return bool(CRS.from_user_input(crs).is_geographic)


@dataclass(frozen=True, slots=True)
class PolyMap:
    """Polynomial approximation of a smooth map of the plane over a rectangle.

    record: the polynomial, of dtype `POLYMAP`, in the form that compiled functions take.
    residual: the largest error at check points between the nodes, in the unit of the result.
    """

    record: PolyMapRecord = field(repr=False)
    residual: float

    def __post_init__(self) -> None:
        """Replace the record by a read-only copy."""
        locked = np.array([self.record], dtype=POLYMAP)
        locked.setflags(write=False)
        object.__setattr__(self, "record", locked[0])

    def __call__(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """Return both components of the map at positions, in the common shape of x and y."""
        xs, ys = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        components = _evaluate_polymap(self.record, xs.ravel(), ys.ravel())
        return components[0].reshape(xs.shape), components[1].reshape(xs.shape)

    def to_rows(self) -> Floats:
        """Return the polynomial as rows of numbers, (2 + 2n, n), as a log stores it; `from_rows` reads them.

        Row 0 starts with the centre, and row 1 with the half-widths. The next n rows are the coefficients of the first
        component u, and the last n rows are the coefficients of the second component v.
        """
        record, size = self.record, int(self.record["size"])
        rows = np.zeros((2 + 2 * size, size))
        rows[0, :2] = record["centre_x"], record["centre_y"]
        rows[1, :2] = record["half_x"], record["half_y"]
        rows[2:] = np.concatenate([record["u"][:size, :size], record["v"][:size, :size]])
        return rows

    @staticmethod
    def from_rows(rows: Floats, residual: float) -> "PolyMap":
        """Make a map from the rows that `to_rows` returned.

        residual: largest error of the polynomial, in the unit of the result.
        """
        size = rows.shape[1]
        return PolyMap(_make_record(rows[0, :2], rows[1, :2], rows[2 : 2 + size], rows[2 + size :]), residual)


def _make_record(centre: Floats, half_widths: Floats, u: Floats, v: Floats) -> PolyMapRecord:
    """Make a record of `POLYMAP`, a polynomial map over a rectangle.

    centre, half_widths: centre and half-widths of the rectangle, (2,) each.
    u, v: coefficients of the two components of the map, (n, n) each.
    """
    size = len(u)
    record = np.zeros(1, dtype=POLYMAP)[0]
    record["centre_x"], record["centre_y"] = centre
    record["half_x"], record["half_y"] = half_widths
    record["size"] = size
    record["u"][:size, :size], record["v"][:size, :size] = u, v
    return record


def fit_polymap(
    function: Callable[[Floats, Floats], tuple[Floats, Floats]], bounds: ArrayLike, tolerance: float
) -> PolyMap:
    """Fit a polynomial to a function over a rectangle, to within a tolerance.

    bounds: the rectangle, [[x0, x1], [y0, y1]].

    The degree is increased from 1 to 9 until the largest error at points between the fitted nodes is within the
    tolerance. If no degree is sufficient, the best polynomial is returned; its residual is its largest error.

    >>> copy = fit_polymap(lambda x, y: (x * y, x + y), [[0.0, 2.0], [0.0, 4.0]], 1e-9)
    >>> u, v = copy(1.0, 3.0)
    >>> round(float(u), 9), round(float(v), 9), copy.residual < 1e-9
    (3.0, 4.0, True)
    """
    (x0, x1), (y0, y1) = np.asarray(bounds, dtype=np.float64)
    centre = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
    half_widths = np.array([max((x1 - x0) / 2, 1e-9), max((y1 - y0) / 2, 1e-9)])

    def node_grid(count: int) -> tuple[Floats, Floats]:
        """Return the coordinates of a grid of Chebyshev nodes over [-1, 1] x [-1, 1], (count^2,) each."""
        nodes = np.cos(np.pi * (np.arange(count) + 0.5) / count)
        u, v = np.meshgrid(nodes, nodes)
        return u.ravel(), v.ravel()

    def function_values(u: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Return the function's values at points of the unit square."""
        return function(centre[0] + half_widths[0] * u, centre[1] + half_widths[1] * v)

    nodes_u, nodes_v = node_grid(14)
    check_u, check_v = node_grid(23)
    node_values, check_values = function_values(nodes_u, nodes_v), function_values(check_u, check_v)
    best_map: PolyMap | None = None
    for size in range(2, MAX_TERMS + 1):
        powers = [(i, j) for i, j in itertools.product(range(size), repeat=2) if i + j < size]
        basis = np.stack([nodes_u**i * nodes_v**j for i, j in powers], axis=1)
        blocks = np.zeros((2, size, size))
        for block, values in zip(blocks, node_values, strict=True):
            solution = least_squares(basis, np.asarray(values, dtype=np.float64))
            for (i, j), coefficient in zip(powers, solution, strict=True):
                block[i, j] = coefficient
        record = _make_record(centre, half_widths, *blocks)
        check_results = _evaluate_polymap(
            record, centre[0] + half_widths[0] * check_u, centre[1] + half_widths[1] * check_v
        )
        residual = max(float(np.max(np.abs(check_results[k] - check_values[k]))) for k in range(2))
        if best_map is None or residual < best_map.residual:
            best_map = PolyMap(record, residual)
        if residual <= tolerance:
            break
    if best_map is None:  # pragma: no cover - the loop always runs
        raise ValueError("no polynomial was fitted")
    return best_map


@inlined
def polymap(record: PolyMapRecord, x: float, y: float) -> tuple[float, float]:
    """Evaluate both components of a polynomial map at one point (x, y), by Horner's scheme.

    record: a record of `POLYMAP`.
    """
    a = (x - record.centre_x) / record.half_x
    b = (y - record.centre_y) / record.half_y
    u = 0.0
    v = 0.0
    for i in range(record.size - 1, -1, -1):
        row_u = 0.0
        row_v = 0.0
        for j in range(record.size - 1 - i, -1, -1):
            row_u = row_u * b + record.u[i, j]
            row_v = row_v * b + record.v[i, j]
        u = u * a + row_u
        v = v * a + row_v
    return u, v


@compiled
def _evaluate_polymap(record: PolyMapRecord, x: Floats, y: Floats) -> Floats:
    """Return both components of a polynomial map at n points, (2, n)."""
    components = np.empty((2, x.size))
    for k in range(x.size):
        components[0, k], components[1, k] = polymap(record, x[k], y[k])
    return components
