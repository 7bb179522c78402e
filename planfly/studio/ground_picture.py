"""Draw the terrain of a map with shaded heights and contours as WebP, for a light or a dark page.

A contour is drawn from the difference between a pixel's height and the nearest level, divided by the slope.  This gives
lines of even width without a library that traces contours.
"""

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from logs import theme
from logs.views.charts import nice_step
from logs.views.relief import relief
from world.arrays import Floats
from world.terrain import Terrain

Range = tuple[float, float]

# Pixels of the longer side.
_PICTURE_PIXELS = 1_400
# Maximum number of contours.
_MAX_CONTOURS = 16
# Every n-th contour is bold.
_BOLD_STRIDE = 5
# Opacity of a contour.
_CONTOUR_OPACITY = 0.38
# Number of heights along the longer side of the grid, from which the page shows the height below the pointer.
_GRID_SIZE = 220
_WEBP_QUALITY = 82


@dataclass(frozen=True, slots=True)
class GroundGrid:
    """Heights for the page, m, in rows from south to north; NaN if unknown.

    east, north: ranges of the grid, m.
    """

    east: Range
    north: Range
    heights: NDArray[np.float32]


def ground_grid(terrain: Terrain, east: Range, north: Range) -> GroundGrid:
    """Return a coarse grid of the terrain heights of a map."""
    heights = _sample_heights(terrain, east, north, _GRID_SIZE)
    return GroundGrid(east, north, heights.astype(np.float32))


def ground_picture(terrain: Terrain, east: Range, north: Range, *, dark: bool) -> bytes:
    """Return a picture of the terrain of a map as WebP, north up."""
    heights = _sample_heights(terrain, east, north, _PICTURE_PIXELS)
    known = np.isfinite(heights)
    unknown = np.array(theme.rgba("unknown", dark=dark)[:3])
    if not known.any():
        picture = np.broadcast_to(unknown, (*heights.shape, 3))
        return _to_webp(picture)
    low, high = float(heights[known].min()), float(heights[known].max())
    pitch = (north[1] - north[0]) / (heights.shape[0] - 1)
    picture = _tint_by_height(heights, low, max(high, low + 1.0), dark=dark)
    if high - low >= 1.0:
        picture *= relief(heights, pitch, high - low)[..., None]
        picture = _draw_contours(picture, heights, nice_step(high - low, _MAX_CONTOURS), dark=dark)
    picture[~known] = unknown
    return _to_webp(picture)


def _sample_heights(terrain: Terrain, east: Range, north: Range, pixels: int) -> Floats:
    width, height = east[1] - east[0], north[1] - north[0]
    longer = max(width, height)
    columns, rows = (max(2, round(pixels * side / longer)) for side in (width, height))
    return np.asarray(terrain.height(np.linspace(*east, columns)[None, :], np.linspace(*north, rows)[:, None]))


def _tint_by_height(heights: Floats, low: float, high: float, *, dark: bool) -> Floats:
    """Return the color of each height, 0 to 1, (rows, columns, 3)."""
    ramp = np.array([theme.rgb(text) for text in (theme.GROUND_DARK if dark else theme.GROUND)])
    share = np.nan_to_num((heights - low) / (high - low)) * (len(ramp) - 1)
    return np.stack([np.interp(share, np.arange(len(ramp)), ramp[:, k]) for k in range(3)], axis=-1)


def _draw_contours(picture: Floats, heights: Floats, step: float, *, dark: bool) -> Floats:
    """Return a picture with contours drawn over it, bold at every fifth level."""
    filled = np.nan_to_num(heights, nan=float(np.nanmean(heights)))
    slope = np.hypot(*np.gradient(filled))
    ink = np.array(theme.rgba("contour", dark=dark)[:3])
    for spacing, half_width, strength in ((step, 0.5, _CONTOUR_OPACITY), (step * _BOLD_STRIDE, 0.8, _CONTOUR_OPACITY)):
        away = np.abs(filled / spacing - np.round(filled / spacing)) * spacing / np.maximum(slope, 1e-6)
        # Draw no contour on flat ground, even if its height is near a level.
        covered = np.clip(half_width + 0.5 - away, 0.0, 1.0) * np.clip(slope / (0.02 * step), 0.0, 1.0)
        share = (strength * covered)[..., None]
        picture = picture * (1.0 - share) + ink * share
    return picture


def _to_webp(picture: Floats) -> bytes:
    pixels = np.round(np.clip(picture[::-1], 0.0, 1.0) * 255.0).astype(np.uint8)
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "WEBP", quality=_WEBP_QUALITY, method=2)
    return out.getvalue()
