"""The glide's footprint: bands of the least height above ground, as outlines of the cells that are in them."""

import numpy as np
import shapely

from logs.verdict.returns.glide_footprint import BANDS, GlideFootprint, Part
from logs.verdict.returns.glide_map import GlideMap

CELL = 50.0


def cone(ground: float = 0.0, half: int = 100) -> GlideFootprint:
    """A glide of 10 : 1 to the middle of a plane, 30 m above ground, flat but for a square about the middle."""
    line = CELL * np.arange(-half, half + 1)
    away = np.hypot(line[None, :], line[:, None])
    level, sky = np.full(away.shape, ground), np.full(away.shape, np.inf)
    made = GlideMap(float(line[0]), float(line[0]), CELL, level, level + 30.0, sky, -sky)
    flat = np.maximum(np.abs(line[None, :]), np.abs(line[:, None])) > 500.0
    return GlideFootprint(made, ground + 30.0 + away / 10.0, flat)


def shape(parts: tuple[Part, ...]) -> shapely.Geometry:
    return shapely.union_all([shapely.Polygon(part[0], part[1:]) for part in parts])


def test_a_band_is_the_ring_of_its_heights() -> None:
    """30 m + r / 10 up to 150, 300 and 600 m: discs of 1.2, 2.7 and 5.7 km."""
    for ground in (0.0, 700.0):
        bands = cone(ground, half=90).bands()
        assert [band.max_height for band in bands] == list(BANDS)
        inner = 0.0
        for band, outer in zip(bands[:2], (1200.0, 2700.0), strict=True):
            area = shape(band.parts).area
            assert abs(area - np.pi * (outer**2 - inner**2)) < 0.01 * area
            inner = outer
        assert len(bands[0].parts[0]) == 1
        assert len(bands[1].parts[0]) == 2


def test_nothing_is_in_a_band_that_needs_more_however_large_the_cells() -> None:
    """201 cells a side are shown as blocks of 2, each as bad as the worst of its cells."""
    disc = shapely.Point(0.0, 0.0).buffer(1200.0, 64)
    near = shape(cone().bands()[0].parts)
    assert near.difference(disc).area < 0.02 * disc.area
    assert shape(cone(half=90).bands()[0].parts).area >= near.area


def test_outlines_run_anticlockwise_holes_clockwise_and_close() -> None:
    outline, hole = cone().bands()[1].parts[0]
    assert shapely.LinearRing(outline).is_ccw
    assert not shapely.LinearRing(hole).is_ccw
    assert (outline[0] == outline[-1]).all()


def test_only_what_is_asked_for_is_shown() -> None:
    found = cone()
    cut = shape(found.landings((0.0, 2000.0), (-1000.0, 1000.0)))
    low_e, low_n, high_e, high_n = cut.bounds
    assert (low_e, low_n) >= (-CELL, -1000.0 - CELL)
    assert (high_e, high_n) <= (2000.0 + CELL, 1000.0 + CELL)
    assert not cut.contains(shapely.Point(100.0, 100.0))
    assert cut.contains(shapely.Point(900.0, 100.0))
    assert found.landings((9000.0, 9500.0), (0.0, 100.0)) == ()
    assert found.bands((9000.0, 9500.0), (0.0, 100.0)) == ()


def test_where_no_way_leads_or_the_ground_is_not_known_there_is_no_band() -> None:
    found = cone()
    found.min_altitude[:, :100] = np.inf
    found.grid.ground[:, 101:] = np.nan
    assert all(shape(band.parts).area < 2.0 * 200.0 * CELL * CELL * 2.0 for band in found.bands())
