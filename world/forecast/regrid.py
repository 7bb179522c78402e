"""Interpolate a forecast on a grid of its own projection to a regular grid of latitude and longitude."""

from typing import Any

import numpy as np

from world.arrays import Floats, Ints


def _near_longitudes(longitudes: Floats, west: float, east: float) -> Floats:
    """Return longitudes (deg) shifted by whole turns to within 180 degrees of a mean.

    The mean is that of ``west`` and ``east``.
    """
    center = 0.5 * (west + east)
    wrapped_longitudes: Floats = center + (longitudes.astype(np.float64) - center + 180.0) % 360.0 - 180.0
    return wrapped_longitudes


def regular_axes(latitudes: Floats, longitudes: Floats, box: Any) -> tuple[Floats, Floats] | None:
    """Return latitudes and longitudes (deg) of a regular grid around a box.

    The grid has the spacing of a given grid.

    latitudes, longitudes: nodes of the given grid, (r, c) deg.
    box: `world.forecast.forecast.Box`.

    Returns None if the box is not inside the grid.
    """
    wrapped_longitudes = _near_longitudes(longitudes, box.west, box.east)
    scale = np.cos(np.radians(0.5 * (box.south + box.north)))
    spacing = float(np.median(np.hypot(np.diff(latitudes, axis=1), np.diff(wrapped_longitudes, axis=1) * scale)))
    rows = np.arange(box.south - spacing, box.north + 2.0 * spacing, spacing)
    columns = np.arange(box.west - spacing / scale, box.east + 2.0 * spacing / scale, spacing / scale)
    is_inside = latitudes.min() <= rows[0] and rows[-1] <= latitudes.max()
    is_inside &= wrapped_longitudes.min() <= columns[0] and columns[-1] <= wrapped_longitudes.max()
    return (rows, columns) if is_inside else None


def near_nodes(latitudes: Floats, longitudes: Floats, rows: Floats, columns: Floats) -> tuple[Ints, Ints]:
    """Return the indices of the rows and columns of a projected grid that surround a regular grid.

    Nodes up to three steps outside the regular grid are included.

    latitudes, longitudes: (r, c) deg, of the projected grid's nodes.
    rows, columns: (y,), (x,) deg, of the regular grid.
    """
    wrapped_longitudes = _near_longitudes(longitudes, columns[0], columns[-1])
    row_margin, column_margin = 3.0 * (rows[1] - rows[0]), 3.0 * (columns[1] - columns[0])
    is_near = (latitudes >= rows[0] - row_margin) & (latitudes <= rows[-1] + row_margin)
    is_near &= (wrapped_longitudes >= columns[0] - column_margin) & (wrapped_longitudes <= columns[-1] + column_margin)
    return np.flatnonzero(is_near.any(axis=1)), np.flatnonzero(is_near.any(axis=0))


def regrid(values: Floats, latitudes: Floats, longitudes: Floats, rows: Floats, columns: Floats) -> Floats:
    """Interpolate values linearly from the nodes of a projected grid to a regular grid.

    values: (m, t, r, c, k), at the nodes (r, c) of the projected grid.
    latitudes, longitudes: (r, c) deg, of these nodes.
    rows, columns: latitudes (y,) and longitudes (x,) of the regular grid, deg.

    Returns the values at the nodes of the regular grid, (m, t, y, x, k); NaN outside the projected grid.
    """
    from scipy.interpolate import LinearNDInterpolator

    wrapped_longitudes = _near_longitudes(longitudes, columns[0], columns[-1])
    members, times, _, _, levels = values.shape
    nodes = np.moveaxis(values, (2, 3), (0, 1)).reshape(latitudes.size, -1)
    interpolator = LinearNDInterpolator(np.column_stack([latitudes.ravel(), wrapped_longitudes.ravel()]), nodes)
    grid_rows, grid_columns = np.meshgrid(rows, columns, indexing="ij")
    grid_values = interpolator(grid_rows, grid_columns).reshape(len(rows), len(columns), members, times, levels)
    return np.ascontiguousarray(np.moveaxis(grid_values, (0, 1), (2, 3)))


def rotate_to_north(velocities: Floats, latitudes: Floats, longitudes: Floats, rows: Floats, columns: Floats) -> None:
    """Rotate winds from the axes of a projected grid to east and north, in place.

    velocities: (m, t, y, x, k, 2) m/s on the regular grid: components along the rows and along the columns of the
        projected grid.
    latitudes, longitudes: (r, c) deg, of the projected grid's nodes.
    rows, columns: latitudes (y,) and longitudes (x,) of the regular grid, deg.
    """
    wrapped_longitudes = _near_longitudes(longitudes, columns[0], columns[-1])
    # East and north of a step along a row of the grid, degrees of latitude.
    north = np.gradient(latitudes.astype(np.float64), axis=1)
    east = np.gradient(wrapped_longitudes, axis=1) * np.cos(np.radians(latitudes))
    length = np.hypot(east, north)
    nodes = np.ix_(*near_nodes(latitudes, longitudes, rows, columns))
    directions = np.stack([east / length, north / length], axis=-1)[nodes][np.newaxis, np.newaxis]
    row_directions = regrid(directions, latitudes[nodes], longitudes[nodes], rows, columns)[0, 0]
    cos, sin = row_directions[..., 0][..., np.newaxis], row_directions[..., 1][..., np.newaxis]
    along, across = velocities[..., 0].copy(), velocities[..., 1].copy()
    velocities[..., 0] = along * cos - across * sin
    velocities[..., 1] = along * sin + across * cos
