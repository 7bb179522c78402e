"""Draw the terrain of a map with shaded heights and contours as WebP, for a light or a dark page.

A contour is drawn from the difference between a pixel's height and the nearest level, divided by the slope. This gives
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

# Pixels along the longer side of the picture.
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
    """Terrain altitudes that the page shows at the pointer.

    east, north: ranges of the grid, m.
    heights: altitudes in rows from south to north, m AMSL; NaN if unknown.
    """

    east: Range
    north: Range
    heights: NDArray[np.float32]


def sample_ground_grid(terrain: Terrain, east: Range, north: Range) -> GroundGrid:
    """Return a grid of terrain altitudes for the page, with `_GRID_SIZE` values along the longer side.

    east, north: ranges of the map, m.
    """
    heights = _sample_heights(terrain, east, north, _GRID_SIZE)
    return GroundGrid(east, north, heights.astype(np.float32))


def draw_ground(terrain: Terrain, east: Range, north: Range, *, dark: bool) -> bytes:
    """Draw terrain and its contours, north up; return the picture as WebP.

    east, north: ranges of the map, m.
    dark: True for dark colours.
    """
    heights = _sample_heights(terrain, east, north, _PICTURE_PIXELS)
    is_known = np.isfinite(heights)
    unknown = np.array(theme.rgba("unknown", dark=dark)[:3])
    if not is_known.any():
        picture = np.broadcast_to(unknown, (*heights.shape, 3))
        return _to_webp(picture)
    min_height, max_height = float(heights[is_known].min()), float(heights[is_known].max())
    pixel_size = (north[1] - north[0]) / (heights.shape[0] - 1)
    # The colour of each altitude, in a palette that extends over the heights of the map, at least over 1 m.
    ramp = np.array([theme.rgb(text) for text in (theme.GROUND_DARK if dark else theme.GROUND)])
    fraction = (heights - min_height) / (max(max_height, min_height + 1.0) - min_height)
    ramp_position = np.nan_to_num(fraction) * (len(ramp) - 1)
    picture = np.stack([np.interp(ramp_position, np.arange(len(ramp)), ramp[:, k]) for k in range(3)], axis=-1)
    if max_height - min_height >= 1.0:
        picture *= relief(heights, pixel_size, max_height - min_height)[..., None]
        # Contours, every fifth contour bold.
        step = nice_step(max_height - min_height, _MAX_CONTOURS)
        filled_heights = np.nan_to_num(heights, nan=float(np.nanmean(heights)))
        slope = np.hypot(*np.gradient(filled_heights))
        ink = np.array(theme.rgba("contour", dark=dark)[:3])
        for spacing, half_width in ((step, 0.5), (step * _BOLD_STRIDE, 0.8)):
            level = filled_heights / spacing
            pixel_distance = np.abs(level - np.round(level)) * spacing / np.maximum(slope, 1e-6)
            # Draw no contour on flat ground, even if its height is near a level.
            coverage = np.clip(half_width + 0.5 - pixel_distance, 0.0, 1.0) * np.clip(slope / (0.02 * step), 0.0, 1.0)
            opacity = (_CONTOUR_OPACITY * coverage)[..., None]
            picture = picture * (1.0 - opacity) + ink * opacity
    picture[~is_known] = unknown
    return _to_webp(picture)


def _sample_heights(terrain: Terrain, east: Range, north: Range, pixels: int) -> Floats:
    """Return terrain altitudes on a grid (rows, columns), m AMSL, with the southern row first.

    Unknown altitudes are NaN.

    east, north: ranges of the map, m.
    pixels: number of values along the longer side.
    """
    width, height = east[1] - east[0], north[1] - north[0]
    longer_side = max(width, height)
    columns, rows = (max(2, round(pixels * length / longer_side)) for length in (width, height))
    return np.asarray(terrain.height(np.linspace(*east, columns)[None, :], np.linspace(*north, rows)[:, None]))


def _to_webp(picture: Floats) -> bytes:
    """Encode a picture as WebP.

    picture: colours from 0 to 1, (rows, columns, 3), with the southern row first.
    """
    pixels = np.round(np.clip(picture[::-1], 0.0, 1.0) * 255.0).astype(np.uint8)
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "WEBP", quality=_WEBP_QUALITY, method=2)
    return stream.getvalue()
