"""The ground of a map as a picture: shaded heights and contours as WebP, for a light page and for a dark one.

Contours are drawn by how far a pixel's height is from the nearest level, over how fast it changes there: lines of even
width without a library that traces them.
"""

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from logs import theme
from logs.views.charts import nice_step
from logs.views.relief import relief
from world.terrain import Terrain

Floats = NDArray[np.float64]
Range = tuple[float, float]

# Pixels of the longer side; contours at most, and every so many a bold one; strength of a line.
_PIXELS, _CONTOURS, _BOLD, _STRENGTH = 1_400, 16, 5, 0.38
# Heights of the grid that the page reads below the pointer, of the longer side.
_GRID = 220
_QUALITY = 82


@dataclass(frozen=True, slots=True)
class GroundGrid:
    """Heights for the page: rows from south to north, m; NaN where they are not known.

    east, north: of its corners, m.
    """

    east: Range
    north: Range
    heights: NDArray[np.float32]


def ground_grid(terrain: Terrain, east: Range, north: Range) -> GroundGrid:
    """Heights below a map, coarse."""
    heights = _sampled(terrain, east, north, _GRID)
    return GroundGrid(east, north, heights.astype(np.float32))


def ground_picture(terrain: Terrain, east: Range, north: Range, *, dark: bool) -> bytes:
    """The ground below a map as WebP, north up."""
    heights = _sampled(terrain, east, north, _PIXELS)
    known = np.isfinite(heights)
    unknown = np.array(theme.rgba("unknown", dark=dark)[:3])
    if not known.any():
        picture = np.broadcast_to(unknown, (*heights.shape, 3))
        return _webp(picture)
    low, high = float(heights[known].min()), float(heights[known].max())
    pitch = (north[1] - north[0]) / (heights.shape[0] - 1)
    picture = _tinted(heights, low, max(high, low + 1.0), dark=dark)
    if high - low >= 1.0:
        picture *= relief(heights, pitch, high - low)[..., None]
        picture = _contoured(picture, heights, nice_step(high - low, _CONTOURS), dark=dark)
    picture[~known] = unknown
    return _webp(picture)


def _sampled(terrain: Terrain, east: Range, north: Range, pixels: int) -> Floats:
    width, height = east[1] - east[0], north[1] - north[0]
    longer = max(width, height)
    columns, rows = (max(2, round(pixels * side / longer)) for side in (width, height))
    return np.asarray(terrain.height(np.linspace(*east, columns)[None, :], np.linspace(*north, rows)[:, None]))


def _tinted(heights: Floats, low: float, high: float, *, dark: bool) -> Floats:
    """Colours by height, (rows, columns, 3), 0 to 1."""
    ramp = np.array([theme.rgb(text) for text in (theme.GROUND_DARK if dark else theme.GROUND)])
    share = np.nan_to_num((heights - low) / (high - low)) * (len(ramp) - 1)
    return np.stack([np.interp(share, np.arange(len(ramp)), ramp[:, k]) for k in range(3)], axis=-1)


def _contoured(picture: Floats, heights: Floats, step: float, *, dark: bool) -> Floats:
    """A picture with contours over it, bold at every fifth level."""
    filled = np.nan_to_num(heights, nan=float(np.nanmean(heights)))
    slope = np.hypot(*np.gradient(filled))
    ink = np.array(theme.rgba("contour", dark=dark)[:3])
    for spacing, half_width, strength in ((step, 0.5, _STRENGTH), (step * _BOLD, 0.8, _STRENGTH)):
        away = np.abs(filled / spacing - np.round(filled / spacing)) * spacing / np.maximum(slope, 1e-6)
        # Level ground is no line, however near to a level it lies.
        covered = np.clip(half_width + 0.5 - away, 0.0, 1.0) * np.clip(slope / (0.02 * step), 0.0, 1.0)
        share = (strength * covered)[..., None]
        picture = picture * (1.0 - share) + ink * share
    return picture


def _webp(picture: Floats) -> bytes:
    pixels = np.round(np.clip(picture[::-1], 0.0, 1.0) * 255.0).astype(np.uint8)
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "WEBP", quality=_QUALITY, method=2)
    return out.getvalue()
