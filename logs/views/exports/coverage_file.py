"""Export the coverage of a radio link as a GeoTIFF."""

import numpy as np

from logs.verdict.measures.link_coverage import LinkCoverage
from world.frames import GeoOrigin
from world.gdal_raster import geotiff_bytes

# Value of a cell without a margin.
NO_MARGIN_DB = -9999.0


def coverage_geotiff(coverage: LinkCoverage, origin: GeoOrigin) -> bytes:
    """Encode the link margin of each cell of a coverage map, dB, as a GeoTIFF file.

    Its projection is azimuthal equidistant, centred on `origin`.  Cells whose ground is unknown or above the aircraft
    have the value `NO_MARGIN_DB`.
    """
    margin = np.where(np.isfinite(coverage.margin), coverage.margin, NO_MARGIN_DB).astype(np.float32)
    side, north = coverage.side, coverage.south + coverage.side * len(margin)
    grid = (side, 0.0, coverage.west, 0.0, -side, north)
    projection = f"+proj=aeqd +lat_0={origin.lat_deg} +lon_0={origin.lon_deg} +datum=WGS84 +units=m +no_defs"
    return geotiff_bytes(np.ascontiguousarray(margin[::-1]), grid, projection, NO_MARGIN_DB, unit="dB")
