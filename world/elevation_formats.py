"""Formats of elevation files, and elevation files that planfly ships.

The module has no imports that would slow the help.

`world.raster.open_raster` opens them.
"""

from typing import NamedTuple


class ElevationFormat(NamedTuple):
    """Format of elevation files.

    name: name in messages.
    suffix: file suffix, in lower case.
    begins: possible first bytes of a file; empty for a format that only the suffix identifies.
    """

    name: str
    suffix: str
    begins: tuple[bytes, ...]


# All formats: identified by the first four bytes of a file (two bytes may be a height), or else by the suffix.
FORMATS = (
    ElevationFormat("a GeoTIFF", ".tif", (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")),
    ElevationFormat("an SRTM .hgt", ".hgt", ()),
    ElevationFormat("an .npz with `elevation`", ".npz", (b"PK\x03\x04",)),
)
SUFFIXES = tuple(known.suffix for known in FORMATS)
# Suffix of a list of such files, of which only the names are read (`world.elevation_tiles`).
VIRTUAL = ".vrt"
# Maximum number of tiles of one terrain.
MAX_TILES = 100
# Elevation files that planfly ships, by name; the README of `world/elevation` states their sources.
EMBEDDED = {"jacksboro": "jacksboro.npz"}
