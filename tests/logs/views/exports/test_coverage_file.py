"""The coverage as a GeoTIFF: read back with its values, and at the places that its projection states."""

import math

import numpy as np
import pytest
import rasterio
from rasterio.io import MemoryFile
from rasterio.warp import transform

from logs.verdict.measures.link_coverage import FlightHeight, LinkCoverage
from logs.views.exports.coverage_file import NO_MARGIN_DB, coverage_geotiff
from world.frames import GeoOrigin, to_geo


# Beside the 180th meridian the cells lie on both sides of it.
@pytest.mark.parametrize("origin", [GeoOrigin(36.3, -84.2), GeoOrigin(-17.0, 179.999)])
def test_a_cell_has_its_margin_and_its_place(origin: GeoOrigin) -> None:
    margin = np.array([[1.0, -2.5, math.nan], [4.0, 5.0, 6.0]])
    coverage = LinkCoverage(-300.0, 1000.0, 200.0, FlightHeight(100.0, True), margin, np.isnan(margin))
    with rasterio.Env(), MemoryFile(coverage_geotiff(coverage, origin)) as memory, memory.open() as file:
        values = file.read(1)
        assert (file.nodata, file.units) == (NO_MARGIN_DB, ("dB",))
        # Rows run from north to south.
        assert values.tolist() == [[4.0, 5.0, 6.0], [1.0, -2.5, NO_MARGIN_DB]]
        x, y = file.xy(1, 0)
        lon, lat = (values[0] for values in transform(file.crs, "EPSG:4326", [x], [y]))
    # Centre of the south-western cell: 200 m west and 1100 m north of the origin.
    expected_lat, expected_lon = (float(value) for value in to_geo(origin, -200.0, 1100.0))
    assert (lat, lon) == pytest.approx((expected_lat, expected_lon), abs=1e-7)
