"""Suffixes of files of zones, in a module of their own so that ``--help`` imports no geometry library."""

GEOPACKAGE = ".gpkg"
SUFFIXES = (".geojson", ".json", ".kml", ".openair", ".txt", GEOPACKAGE)
