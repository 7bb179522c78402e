"""The elevation files that are read, and those that we ship: lists that the command line's help reads, too.

`world.raster.open_raster` opens them.
"""

from typing import NamedTuple


class ElevationFormat(NamedTuple):
    """A kind of elevation file.

    name: in messages.
    suffix: of its files, in lower case.
    begins: what its files begin with, one of these; none for a kind that is known by its suffix alone.
    """

    name: str
    suffix: str
    begins: tuple[bytes, ...]


# All that are read: by what a file begins with (four bytes, for two may be a height), else by its suffix.
FORMATS = (
    ElevationFormat("a GeoTIFF", ".tif", (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")),
    ElevationFormat("an SRTM .hgt", ".hgt", ()),
    ElevationFormat("an .npz with `elevation`", ".npz", (b"PK\x03\x04",)),
)
SUFFIXES = tuple(known.suffix for known in FORMATS)
# A list of such files, of which only their names are read (`world.elevation_tiles`).
VIRTUAL = ".vrt"
# Tiles of one terrain at most.
MAX_TILES = 100
# Elevation that we ship, by name: files of `world/elevation`, whose README says where they are from.
EMBEDDED = {"jacksboro": "jacksboro.npz"}
