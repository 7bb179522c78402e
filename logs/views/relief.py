"""Shade the ground of a map by light from the north-west, to show relief."""

import numpy as np

from world.arrays import Floats


def relief(heights: Floats, spacing: float, span: float) -> Floats:
    """Return the brightness of ground lit from the north-west: 0.55 in shade to 1.0 in light.

    The result is (rows, columns).  Unknown heights (NaN) are replaced by the mean height.

    heights: heights on a grid, m, (rows, columns); rows from south to north, columns from west to east.
    spacing: distance between rows, and between columns, m.
    span: difference between the lowest and the highest height, m.

    >>> slope = np.arange(3.0)[None, :] * np.ones((3, 1))
    >>> bool(relief(-slope, 1.0, 2.0).mean() < relief(slope, 1.0, 2.0).mean())  # falls to the east, then rises
    True
    """
    filled = np.where(np.isfinite(heights), heights, np.nanmean(heights))
    up_north, up_east = np.gradient(filled, spacing)
    # Exaggerate gentle terrain, so that its ridges show.
    gain = float(np.clip(600.0 / span, 0.5, 4.0))
    slope_e, slope_n = gain * up_east, gain * up_north
    # Cosine of the angle between the ground's normal and a light 45 degrees high in the north-west.
    light = (0.5 * slope_e - 0.5 * slope_n + 0.707) / np.sqrt(1.0 + slope_e**2 + slope_n**2)
    return np.asarray(np.clip(0.96 + 0.42 * (light - 0.707), 0.55, 1.0))
