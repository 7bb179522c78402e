"""A tile of 10,000 x 10,000 pixels is read by windows: what a plan's area does not need is never in memory."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from rasterio.windows import Window

from tests.soak import SOAK, at_most
from tests.world.made.elevation_files import from_origin

SIDE, PITCH = 10_000, 1.0 / 3600.0
WEST, NORTH = 8.0, 48.0
TILE = 512

# In a process of its own, whose memory is only this: MB more at the most, CPU s, and heights at three places.
_READ = """
import json, resource, sys, time
import numpy as np
from world.frames import GeoOrigin, to_map
from world.raster import open_raster, read_terrain

def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

path, half = sys.argv[1], float(sys.argv[2])
origin = GeoOrigin(48.0 - 5000 / 3600, 8.0 + 5000 / 3600)
# The libraries' own memory, and what they make at the first file.
warm = open_raster(sys.argv[3])
read_terrain(warm, warm.centre, [[-100.0, 100.0]] * 2, 50.0)
before, began = peak(), time.process_time()
raster = open_raster(path)
terrain = read_terrain(raster, origin, [[-half, half]] * 2, 200.0)
after, spent = peak(), time.process_time() - began
lat, lon = np.full(2, 48.0 - 5000.5 / 3600), 8.0 + np.array([5000.5, 5051.5]) / 3600
east, north = to_map(origin, lat, lon)
print(json.dumps([after - before, spent, terrain.heights.size, terrain.height(east, north).tolist()]))
"""


def height_of(rows: NDArray[Any], columns: NDArray[Any]) -> NDArray[np.int16]:
    """The made ground, m: steps of 10 m every 50 columns and every 80 rows."""
    return (10 * (columns // 50) + rows // 80).astype(np.int16)


def write_tile(path: Path, side: int) -> Path:
    """A tiled, compressed GeoTIFF, written a row of blocks at a time."""
    profile: dict[str, Any] = {"driver": "GTiff", "height": side, "width": side, "count": 1, "dtype": "int16"}
    profile |= {"tiled": True, "blockxsize": TILE, "blockysize": TILE, "compress": "deflate", "zlevel": 1}
    columns = np.arange(side)[None, :]
    with rasterio.open(path, "w", **profile, crs="EPSG:4326", transform=from_origin(WEST, NORTH, PITCH, PITCH)) as out:
        for row in range(0, side, TILE):
            rows = np.arange(row, min(row + TILE, side))[:, None]
            out.write(height_of(rows, columns), 1, window=Window(0, row, side, len(rows)))
    return path


@pytest.fixture(scope="module")
def tiles(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("tiles")
    return write_tile(folder / "large.tif", SIDE), write_tile(folder / "small.tif", 600)


def read(tiles: tuple[Path, Path], half: float) -> tuple[float, float, int, list[float]]:
    command = [sys.executable, "-c", _READ, str(tiles[0]), str(half), str(tiles[1])]
    more, spent, pixels, heights = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    return more, spent, pixels, heights


def test_an_area_of_twenty_kilometres_takes_a_few_megabytes(tiles: tuple[Path, Path]) -> None:
    """The whole tile is 200 MB as it is stored, and 400 MB as heights."""
    more, spent, pixels, heights = read(tiles, 10_000.0)
    assert 600_000 < pixels < 700_000
    assert more < 40.0
    assert spent < at_most(1.0)
    # Pixel centres: (5000, 5000), and 51 columns to the east.
    assert heights == pytest.approx([1062.0, 1072.0], abs=0.05)


@pytest.mark.skipif(not SOAK, reason="a small part of it is read above: in make soak")
def test_a_quarter_of_the_tile_takes_no_more_than_its_heights_and_marks(tiles: tuple[Path, Path]) -> None:
    """The heights' own memory, flags of the same number of pixels, and what is unpacked at a time."""
    more, spent, pixels, _ = read(tiles, 54_000.0)
    assert pixels > 15_000_000
    own = 4.0 * pixels / 2**20
    assert more < 2.5 * own + 150.0
    assert spent < at_most(6.0)
