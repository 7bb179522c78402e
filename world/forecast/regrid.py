"""Interpolate a forecast on a grid of its own projection to a regular grid of latitude and longitude."""

from typing import Any

import numpy as np

from world.arrays import Floats

# Degrees of latitude per metre, for the distance between nodes.
_DEGREE_M = 111_200.0


def _near_longitudes(longitudes: Floats, box: Any) -> Floats:
    """Return longitudes within half a turn of a box, deg."""
    center = 0.5 * (box.west + box.east)
    near: Floats = center + (longitudes.astype(np.float64) - center + 180.0) % 360.0 - 180.0
    return near


def regular_axes(latitudes: Floats, longitudes: Floats, box: Any) -> tuple[Floats, Floats] | None:
    """Return latitudes and longitudes of a regular grid around a box, with the distance of the grid's own nodes.

    latitudes, longitudes: (r, c) deg, of the nodes.
    box: south, west, north and east.

    Return None if the box is not inside the grid.
    """
    near = _near_longitudes(longitudes, box)
    scale = np.cos(np.radians(0.5 * (box.south + box.north)))
    spacing = float(np.median(np.hypot(np.diff(latitudes, axis=1), np.diff(near, axis=1) * scale)))
    rows = np.arange(box.south - spacing, box.north + 2.0 * spacing, spacing)
    columns = np.arange(box.west - spacing / scale, box.east + 2.0 * spacing / scale, spacing / scale)
    is_inside = (latitudes.min() <= rows[0] and rows[-1] <= latitudes.max() and near.min() <= columns[0]) and columns[
        -1
    ] <= near.max()
    return (rows, columns) if is_inside else None


def regrid(values: Floats, latitudes: Floats, longitudes: Floats, rows: Floats, columns: Floats) -> Floats:
    """Interpolate values linearly to a regular grid.

    values: (m, t, r, c, k) at nodes (r, c).
    latitudes, longitudes: (r, c) deg.
    rows, columns: (y,), (x,) deg.

    Return (m, t, y, x, k); NaN outside the nodes.
    """
    from scipy.interpolate import LinearNDInterpolator

    center = 0.5 * (columns[0] + columns[-1])
    near = center + (longitudes.astype(np.float64) - center + 180.0) % 360.0 - 180.0
    margin = 3.0 * (rows[1] - rows[0])
    is_close = (np.abs(latitudes - 0.5 * (rows[0] + rows[-1])) <= 0.5 * (rows[-1] - rows[0]) + margin) & (
        np.abs(near - center)
        <= 0.5 * (columns[-1] - columns[0]) + margin * (columns[1] - columns[0]) / (rows[1] - rows[0])
    )
    members, times, _, _, levels = values.shape
    nodes = np.moveaxis(values, (2, 3), (0, 1))[is_close].reshape(int(is_close.sum()), -1)
    interpolator = LinearNDInterpolator(np.column_stack([latitudes[is_close], near[is_close]]), nodes)
    grid_rows, grid_columns = np.meshgrid(rows, columns, indexing="ij")
    found = interpolator(grid_rows, grid_columns).reshape(len(rows), len(columns), members, times, levels)
    return np.ascontiguousarray(np.moveaxis(found, (0, 1), (2, 3)))


def rotate_to_north(velocities: Floats, latitudes: Floats, longitudes: Floats, rows: Floats, columns: Floats) -> None:
    """Rotate winds along the axes of a projected grid to east and north, in place.

    velocities: (m, t, y, x, k, 2) m/s on the regular grid, along the projected grid's columns and rows.
    latitudes, longitudes: (r, c) deg, of the projected grid's nodes.
    """
    center = 0.5 * (columns[0] + columns[-1])
    near = center + (longitudes.astype(np.float64) - center + 180.0) % 360.0 - 180.0
    # East and north of a step along a row of the grid, m.
    north = np.gradient(latitudes.astype(np.float64), axis=1) * _DEGREE_M
    east = np.gradient(near, axis=1) * _DEGREE_M * np.cos(np.radians(latitudes))
    length = np.hypot(east, north)
    directions = np.stack([east / length, north / length], axis=-1)[np.newaxis, np.newaxis]
    found = regrid(directions, latitudes, longitudes, rows, columns)[0, 0]
    cos, sin = found[..., 0][..., np.newaxis], found[..., 1][..., np.newaxis]
    along, across = velocities[..., 0].copy(), velocities[..., 1].copy()
    velocities[..., 0] = along * cos - across * sin
    velocities[..., 1] = along * sin + across * cos
