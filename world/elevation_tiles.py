"""Join several elevation files into one raster.

The tiles are in a folder, in a GDAL virtual raster (.vrt) or in a list.

All tiles lie on one grid: the same reference system, the same pitch, and pixels that coincide where tiles overlap.
Ground that no tile covers is a gap.  This module only reads the names of the files of a virtual raster: GDAL's driver
would open everything that it names, including servers and commands, with any driver.
"""

import hashlib
import math
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from world.elevation_formats import MAX_TILES, SUFFIXES, VIRTUAL
from world.errors import TerrainError
from world.raster_file import RasterFile, is_ground, shift_grid

# Largest size of the file of a virtual raster, bytes.
_MAX_BYTES = 4 * 2**20
# Elements with which a virtual raster changes the heights of its files.
_ALTERING_ELEMENTS = ("ScaleRatio", "ScaleOffset", "LUT", "Kernel", "PixelFunctionType")
# Largest offset of a tile from the grid of the first tile, pixels.
MAX_GRID_OFFSET_PIXELS = 0.01


def tile_files(path: Path) -> list[Path] | None:
    """Return the elevation files in a folder or virtual raster, sorted by name; None for any other path.

    Raises TerrainError for a folder without elevation files, and for a virtual raster that cannot be read.
    """
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES and file.is_file())
        if not files:
            raise TerrainError(f"{path}: a folder without an elevation file ({', '.join(SUFFIXES)})", file=path)
    elif path.suffix.lower() == VIRTUAL:
        files = _source_files(path)
    else:
        return None
    if len(files) > MAX_TILES:
        allowed = f"at most {MAX_TILES} tiles are read; give a folder with only the needed tiles"
        raise TerrainError.at(path, "tiles", len(files), allowed)
    return files


def _source_files(path: Path) -> list[Path]:
    """Return the files to which a virtual raster (.vrt) refers, sorted by name.

    Raises TerrainError for an invalid .vrt, for one that computes heights, and for files outside its folder.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise TerrainError(f"{path}: a virtual raster has at most {_MAX_BYTES:,} bytes", file=path)
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise TerrainError(f"{path}: cannot be read: {error}", file=path) from error
    # Entities could name other files, or expand a small file without limit.
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise TerrainError(
            f"{path}: declares a document type (DOCTYPE), which is not allowed in a virtual raster", file=path
        )
    try:
        root = ElementTree.fromstring(text)  # entities, which could expand, were refused above
    except ElementTree.ParseError as error:
        raise TerrainError(f"{path}: not a virtual raster: {error}", file=path) from error
    sources = [element for element in root.iter("SourceFilename") if element.text]
    if root.tag != "VRTDataset" or not sources:
        raise TerrainError(f"{path}: not a virtual raster of other files: SourceFilename is missing", file=path)
    for element in root.iter():
        computing_element = element.get("subClass") or (element.tag if element.tag in _ALTERING_ELEMENTS else None)
        if computing_element is not None:
            raise TerrainError(
                f"{path}: {computing_element} computes pixels: only a plain mosaic of files is read", file=path
            )
    files, folder = [], os.path.normpath(path.parent.absolute())
    for element in sources:
        name = str(element.text).strip()
        if name.startswith("/vsi") or "://" in name or Path(name).suffix.lower() not in SUFFIXES:
            allowed = f"only local {', '.join(SUFFIXES)} files are read"
            raise TerrainError.at(path, "SourceFilename", name, allowed)
        file = Path(os.path.normpath(Path(folder, name)))
        if not file.is_relative_to(folder):
            allowed = f"expected files in the folder of {path.name} or below"
            raise TerrainError.at(path, "SourceFilename", name, allowed)
        files.append(path.parent / file.relative_to(folder))
    return sorted(set(files))


def join_tiles(tiles: Sequence[RasterFile], name: str) -> RasterFile:
    """Join tiles into one raster.

    name: name of the raster in messages.

    Where tiles overlap, the heights of the first tile with data are used. Raises TerrainError for tiles that are not on
    one grid, or that have different reference systems.
    """
    first = tiles[0]
    if len(tiles) == 1:
        return replace(first, name=name)
    # Row and column of each tile's first pixel on the grid of the first tile.
    positions = []
    for tile in tiles:
        if tile.crs != first.crs:
            allowed = f"all tiles need the reference system of {first.name}"
            raise TerrainError(f"{tile.name}: another reference system; {allowed}", file=tile.name, allowed=allowed)
        last_row, last_col = tile.shape[0] - 1.0, tile.shape[1] - 1.0
        lon, lat = tile.to_lon_lat(np.array([0.0, last_col]), np.array([0.0, last_row]))
        col, row = first.to_pixels(lon, lat)
        top_row, left_col = round(float(row[0])), round(float(col[0]))
        offset = max(
            math.hypot(col[0] - left_col, row[0] - top_row),
            math.hypot(col[1] - left_col - last_col, row[1] - top_row - last_row),
        )
        if not offset <= MAX_GRID_OFFSET_PIXELS:
            allowed = "resample both to one grid (gdalwarp)"
            shown = f"its pixel grid is offset by {offset:.3g} pixels from the grid of {first.name}"
            raise TerrainError(f"{tile.name}: {shown}: {allowed}", file=tile.name, allowed=allowed)
        positions.append((top_row, left_col))
    top, left = (min(position[k] for position in positions) for k in (0, 1))
    rows = max(row + tile.shape[0] for (row, _), tile in zip(positions, tiles, strict=True)) - top
    cols = max(col + tile.shape[1] for (_, col), tile in zip(positions, tiles, strict=True)) - left
    offsets = [(row - top, col - left) for row, col in positions]

    def read(r0: int, r1: int, c0: int, c1: int) -> NDArray[np.float32]:
        """Return the heights of rows r0 to r1 - 1 and columns c0 to c1 - 1.

        Each height is from the first tile with data.
        """
        block = np.full((r1 - r0, c1 - c0), np.nan, dtype=np.float32)
        for (row, col), tile in zip(offsets, tiles, strict=True):
            first_row, last_row = max(r0, row), min(r1, row + tile.shape[0])
            first_col, last_col = max(c0, col), min(c1, col + tile.shape[1])
            if first_row < last_row and first_col < last_col:
                block_part = block[first_row - r0 : last_row - r0, first_col - c0 : last_col - c0]
                is_empty = ~is_ground(block_part)
                if is_empty.any():
                    block_part[is_empty] = tile.read(first_row - row, last_row - row, first_col - col, last_col - col)[
                        is_empty
                    ]
        return block

    def to_pixels(
        lon: NDArray[np.float64], lat: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the pixel coordinates (columns, rows) of positions in all tiles."""
        col, row = first.to_pixels(lon, lat)
        return col - left, row - top

    corners = np.concatenate([tile.corners for tile in tiles])
    digest = hashlib.sha256("".join(tile.sha256 for tile in tiles).encode("ascii")).hexdigest()
    return replace(
        first,
        name=name,
        shape=(rows, cols),
        to_pixels=to_pixels,
        to_lon_lat=lambda col, row: first.to_lon_lat(col + left, row + top),
        corners=corners,
        sha256=digest,
        read=read,
        grid=shift_grid(first.grid, top, left),
    )
