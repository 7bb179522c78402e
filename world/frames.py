"""Map frames: the azimuthal equidistant plane about an origin, and fast polynomial copies of any frame change.

World axes are ``east, north, up``: east and north in the AEQD plane on WGS84, up the height above mean sea
level, kept apart from the map so that Earth curvature never leaks into altitude.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from world.kernels import compiled, compiled_views

if TYPE_CHECKING:
    from pyproj import Proj, Transformer

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class GeoOrigin:
    """The point on WGS84 where east = north = 0."""

    lat_deg: float
    lon_deg: float


@lru_cache(maxsize=32)
def _aeqd(origin: GeoOrigin) -> "Proj":
    # Imported here, and below: it brings an HTTP client along, and a scenario in metres needs none of it.
    from pyproj import Proj

    return Proj(proj="aeqd", lat_0=origin.lat_deg, lon_0=origin.lon_deg, ellps="WGS84")


def to_map(origin: GeoOrigin, lat_deg: ArrayLike, lon_deg: ArrayLike) -> tuple[Floats, Floats]:
    """East and north in metres of geodetic positions in degrees; any shape, the same shape back."""
    east, north = _aeqd(origin)(np.asarray(lon_deg, dtype=np.float64), np.asarray(lat_deg, dtype=np.float64))
    return np.asarray(east), np.asarray(north)


def to_geo(origin: GeoOrigin, east: ArrayLike, north: ArrayLike) -> tuple[Floats, Floats]:
    """Latitude and longitude in degrees of map positions in metres; any shape, the same shape back."""
    lon, lat = _aeqd(origin)(np.asarray(east, dtype=np.float64), np.asarray(north, dtype=np.float64), inverse=True)
    return np.asarray(lat), np.asarray(lon)


def crs_transformer(crs: str) -> "Transformer":
    """Make the transformer from WGS84 (longitude, latitude in degrees) to the horizontal part of a CRS.

    Heights are never passed through: without a geoid grid PROJ would return them unchanged, in silence.
    Raises ValueError for a CRS that PROJ does not know.
    """
    from pyproj import CRS, Transformer
    from pyproj.exceptions import ProjError

    try:
        return Transformer.from_crs(CRS.from_epsg(4326), CRS.from_user_input(crs), always_xy=True)
    except ProjError as error:
        raise ValueError(str(error)) from error


def height_unit(crs: str) -> tuple[str, float]:
    """Name of a CRS' unit of height and its length in m; ("metre", 1) where it has none.

    Raises ValueError for a CRS that PROJ does not know.
    """
    from pyproj import CRS
    from pyproj.exceptions import ProjError

    try:
        axes = CRS.from_user_input(crs).axis_info
    except ProjError as error:
        raise ValueError(str(error)) from error
    return next(
        ((a.unit_name, a.unit_conversion_factor) for a in axes if a.direction in ("up", "down")), ("metre", 1.0)
    )


@dataclass(frozen=True, slots=True)
class PolyMap:
    """A smooth map of the plane, as a polynomial fitted to it over a rectangle.

    packed: (2 + 2n, n) float64: row 0 starts with the centre, row 1 with the half-widths of the rectangle,
    then two (n, n) blocks of coefficients, u and v, of the scaled x**i * y**j with i + j < n.
    residual: the largest error seen at check points between the nodes, in the unit of the result.
    """

    packed: Floats
    residual: float

    def __post_init__(self) -> None:
        """Lock the coefficients."""
        packed = np.array(self.packed, dtype=np.float64)
        packed.setflags(write=False)
        object.__setattr__(self, "packed", packed)

    def __call__(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """Both components at arrays of positions."""
        xs, ys = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        out = _polymap_many(self.packed, xs.ravel(), ys.ravel())
        return out[0].reshape(xs.shape), out[1].reshape(xs.shape)


def fit_polymap(
    function: Callable[[Floats, Floats], tuple[Floats, Floats]], bounds: ArrayLike, tolerance: float
) -> PolyMap:
    """Polynomial copy of ``function`` over ``bounds`` [[x0, x1], [y0, y1]], exact to ``tolerance``.

    The degree grows from 1 to 9 until the largest error at points between the fitted nodes is within the
    tolerance; the best one is returned in any case, with its residual.
    """
    (x0, x1), (y0, y1) = np.asarray(bounds, dtype=np.float64)
    centre = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
    half = np.array([max((x1 - x0) / 2, 1e-9), max((y1 - y0) / 2, 1e-9)])

    def grid(count: int) -> tuple[Floats, Floats]:
        nodes = np.cos(np.pi * (np.arange(count) + 0.5) / count)
        u, v = np.meshgrid(nodes, nodes)
        return u.ravel(), v.ravel()

    def targets(u: Floats, v: Floats) -> tuple[Floats, Floats]:
        return function(centre[0] + half[0] * u, centre[1] + half[1] * v)

    nodes_u, nodes_v = grid(14)
    check_u, check_v = grid(23)
    wanted, checked = targets(nodes_u, nodes_v), targets(check_u, check_v)
    best: PolyMap | None = None
    for size in range(2, 11):
        powers = [(i, j) for i, j in itertools.product(range(size), repeat=2) if i + j < size]
        basis = np.stack([nodes_u**i * nodes_v**j for i, j in powers], axis=1)
        packed = np.zeros((2 + 2 * size, size))
        packed[0, :2], packed[1, :2] = centre, half
        for block, values in enumerate(wanted):
            solution = _least_squares(basis, np.ascontiguousarray(values, dtype=np.float64))
            for (i, j), coefficient in zip(powers, solution, strict=True):
                packed[2 + block * size + i, j] = coefficient
        got = _polymap_many(packed, centre[0] + half[0] * check_u, centre[1] + half[1] * check_v)
        residual = max(float(np.max(np.abs(got[k] - checked[k]))) for k in range(2))
        if best is None or residual < best.residual:
            best = PolyMap(packed, residual)
        if residual <= tolerance:
            break
    if best is None:  # pragma: no cover - the loop always runs
        raise ValueError("no polynomial was fitted")
    return best


@compiled
def _least_squares(basis: Floats, values: Floats) -> Floats:  # pragma: no cover - compiled
    """Coefficients (k,) that bring basis (n, k) closest to values (n,): modified Gram-Schmidt."""
    # By hand: LAPACK rounds as the machine has it, and a plan must not depend on the machine.
    count, size = basis.shape
    q, r = basis.copy(), np.zeros((size, size + 1))
    rest = values.copy()
    for k in range(size):
        norm = 0.0
        for n in range(count):
            norm += q[n, k] * q[n, k]
        for j in range(k + 1, size + 1):
            dot = 0.0
            for n in range(count):
                dot += q[n, k] * (q[n, j] if j < size else rest[n])
            r[k, j] = dot / norm
            for n in range(count):
                if j < size:
                    q[n, j] -= r[k, j] * q[n, k]
                else:
                    rest[n] -= r[k, j] * q[n, k]
    out = np.zeros(size)
    for k in range(size - 1, -1, -1):
        out[k] = r[k, size]
        for j in range(k + 1, size):
            out[k] -= r[k, j] * out[j]
    return out


@compiled_views
def polymap(packed: Floats, x: float, y: float) -> tuple[float, float]:  # pragma: no cover - compiled
    """Both components of a packed `PolyMap` at one point."""
    return polymap_within(packed, packed.shape[1], x, y)


@compiled_views
def polymap_within(packed: Floats, size: int, x: float, y: float) -> tuple[float, float]:  # pragma: no cover - compiled
    """Do the same with a `PolyMap` of this size in the first columns of a wider table (Horner's scheme)."""
    a = (x - packed[0, 0]) / packed[1, 0]
    b = (y - packed[0, 1]) / packed[1, 1]
    u = 0.0
    v = 0.0
    for i in range(size - 1, -1, -1):
        row_u = 0.0
        row_v = 0.0
        for j in range(size - 1 - i, -1, -1):
            row_u = row_u * b + packed[2 + i, j]
            row_v = row_v * b + packed[2 + size + i, j]
        u = u * a + row_u
        v = v * a + row_v
    return u, v


@compiled
def _polymap_many(packed: Floats, x: Floats, y: Floats) -> Floats:  # pragma: no cover - compiled
    out = np.empty((2, x.size))
    for k in range(x.size):
        out[0, k], out[1, k] = polymap(packed, x[k], y[k])
    return out
