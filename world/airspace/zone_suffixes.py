"""The suffixes of files of zones, apart from their readers: ``--help`` imports this, and no library of geometry."""

GEOPACKAGE = ".gpkg"
SUFFIXES = (".geojson", ".json", ".kml", ".openair", ".txt", GEOPACKAGE)
