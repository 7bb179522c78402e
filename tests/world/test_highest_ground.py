"""The highest ground of cells against surfaces laid out by scipy, and against what is plain."""

import math

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from world.arrays import Floats
from world.frames import fit_polymap
from world.highest_ground import highest_in_cells
from world.terrain import Terrain, make_gridded_terrain


def rough(spacing: float, turned: float, seed: int) -> tuple[Terrain, Floats, Floats]:
    """Ground of random heights up to 60 m, on a raster that is turned by so many degrees and begins at odd metres.

    Besides, its lines of pixels and its heights by them.
    """
    heights = np.random.default_rng(seed).uniform(0.0, 60.0, (40, 40)).astype(np.float32)
    angle = math.radians(turned)

    def to_pixel(east: Floats, north: Floats) -> tuple[Floats, Floats]:
        across, up = east - 17.0, north + 11.0
        col = (across * math.cos(angle) + up * math.sin(angle)) / spacing + 20.0
        return col, (up * math.cos(angle) - across * math.sin(angle)) / spacing + 20.0

    half = 10.0 * spacing
    made = fit_polymap(to_pixel, [[-half, half], [-half, half]], 1e-9)
    return Terrain(heights, made, spacing, "made", "", "mean sea level"), np.arange(40.0), heights.astype(np.float64)


@pytest.mark.parametrize(("spacing", "cell"), [(30.0, 45.0), (30.0, 20.0), (50.0, 25.0), (5.0, 20.0)])
@pytest.mark.parametrize("turned", [0.0, 2.0, 40.0])
def test_it_is_the_highest_of_the_surface(spacing: float, cell: float, turned: float) -> None:
    """Looked at by scipy every 40th of a cell: never lower than any place, and no higher than the steepest step."""
    terrain, line, heights = rough(spacing, turned, 3)
    found = highest_in_cells(terrain, -2.0 * cell, -2.0 * cell, cell, 4, 4)
    surface = RegularGridInterpolator((line, line), heights)
    parts = 40
    for i in range(4):
        for j in range(4):
            easts = (j - 2.0 + np.arange(parts + 1)[None, :] / parts) * cell + np.zeros((parts + 1, 1))
            norths = (i - 2.0 + np.arange(parts + 1)[:, None] / parts) * cell + np.zeros((1, parts + 1))
            col, row = terrain.to_pixel(easts.ravel(), norths.ravel())
            sampled = float(surface(np.stack([row, col], axis=1)).max())
            # Half a step off in both directions, on the steepest ground there can be.
            assert sampled - 1e-4 <= found[i, j] <= sampled + 60.0 * math.sqrt(2.0) * cell / parts / spacing


def test_a_crest_between_the_places_of_cells_is_as_high_as_it_is() -> None:
    """Pixels of 30 m, a crest of 60 m along one row of them, cells of 45 m that begin 17 m beside it."""
    line = np.arange(-300.0, 301.0, 30.0)
    terrain = make_gridded_terrain(
        np.where(line[:, None] == 0.0, 60.0, 0.0) + 0.0 * line, line, line, source="made", sha256="", datum=""
    )
    found = highest_in_cells(terrain, -100.0, -17.0 - 45.0, 45.0, 3, 4)
    # Below it the first row ends 17 m beside it: 13 of 30 m up.
    assert found[0] == pytest.approx(np.full(4, 60.0 * 13.0 / 30.0), abs=1e-3)
    assert found[1] == pytest.approx(np.full(4, 60.0), abs=1e-3)
    # 28 m beyond it the last begins: 2 of 30 m up.
    assert found[2] == pytest.approx(np.full(4, 60.0 * 2.0 / 30.0), abs=1e-3)


def test_a_single_pixel_of_a_fine_file_is_found() -> None:
    line = np.arange(0.0, 201.0, 1.0)
    heights = np.zeros((line.size, line.size))
    heights[93, 107] = 80.0
    found = highest_in_cells(
        make_gridded_terrain(heights, line, line, source="made", sha256="", datum=""), 0.0, 0.0, 20.0, 10, 10
    )
    assert found[4, 5] == 80.0
    assert np.count_nonzero(found) == 1


def test_a_cell_with_a_gap_in_its_data_is_not_known() -> None:
    line = np.arange(0.0, 201.0, 10.0)
    heights = np.zeros((line.size, line.size))
    heights[7, 7] = np.nan
    found = highest_in_cells(
        make_gridded_terrain(heights, line, line, source="made", sha256="", datum=""), -40.0, 0.0, 40.0, 4, 4
    )
    # Beyond the data, and about 70 m east, 70 m north: squares with that pixel end where the cells beside begin.
    assert np.isnan(found[:, 0]).all()
    assert math.isnan(found[1, 2])
    assert found[0, 1] == found[3, 3] == 0.0
