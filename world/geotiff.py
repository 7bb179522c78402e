"""GeoTIFF files of heights: their directory, their blocks and their place on Earth, and writing one.

Read are files of TIFF and BigTIFF (Adobe 1992, "TIFF Revision 6.0"; Adobe 2002, "Photoshop TIFF technical notes", for
the predictor of numbers with a point) in strips and tiles, stored as they are or packed by deflate, LZW, LZMA or
Zstandard, whose reference system has a code of EPSG (OGC 19-008r4, "GeoTIFF").  Anything else is told as
`UnreadTiff`: GDAL reads it, where it is installed.  GDAL would be a fifth of what planfly installs.
"""

import io
import lzma
import math
import re
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple
from xml.etree import ElementTree

import numpy as np
import zstandard
from numpy.typing import NDArray

from world.elevation_tiles import Affine
from world.kernels import compiled

Values = NDArray[Any]


class BadTiffError(ValueError):
    """A file that is no TIFF, or a damaged one."""


class UnreadTiffError(Exception):
    """A GeoTIFF of a kind that is not read here; the text says which."""


# ----------------------------------------------------------------------
# The directory: numbers and texts by the number of a tag.

# Types of values: numpy's, by TIFF's number.
_TYPES = {
    1: "u1", 2: "S1", 3: "u2", 4: "u4", 6: "i1", 7: "u1", 8: "i2", 9: "i4", 11: "f4", 12: "f8", 13: "u4", 16: "u8",
    17: "i8", 18: "u8",
}  # fmt: skip
# Directories that are looked at, for the mask that one may be of the first.
_MAX_DIRECTORIES = 32
(_SUBFILE, _WIDTH, _LENGTH, _BITS, _COMPRESSION, _FILL, _STRIPS, _SAMPLES, _ROWS, _STRIP_SIZES) = (
    254, 256, 257, 258, 259, 266, 273, 277, 278, 279,
)  # fmt: skip
_PREDICTOR, _TILE_WIDTH, _TILE_LENGTH, _TILES, _TILE_SIZES, _FORMAT = 317, 322, 323, 324, 325, 339
_SCALE, _TIE_POINTS, _MATRIX, _KEYS, _METADATA, _NODATA = 33550, 33922, 34264, 34735, 42112, 42113
_MASK = 4


class _Directory:
    """A directory of a file: where the values of its tags lie."""

    def __init__(self, file: BinaryIO, size: int, order: str, big: bool, at: int) -> None:
        self._file, self._size, self._order = file, size, order
        count_size, entry, word = (8, 20, "Q") if big else (2, 12, "I")
        count = struct.unpack(order + ("Q" if big else "H"), self._bytes(at, count_size))[0]
        entries = self._bytes(at + count_size, count * entry + struct.calcsize(word))
        self.next: int = struct.unpack(order + word, entries[count * entry :])[0]
        self._entries: dict[int, tuple[int, int, int]] = {}
        room = 8 if big else 4
        for k in range(count):
            tag, kind, length = struct.unpack_from(order + "HH" + word, entries, k * entry)
            bytes_each = np.dtype(_TYPES[kind]).itemsize if kind in _TYPES else 8
            inside = at + count_size + k * entry + entry - room
            where = inside
            if length * bytes_each > room:
                where = struct.unpack_from(order + word, entries, k * entry + entry - room)[0]
            self._entries.setdefault(tag, (kind, length, where))

    def _bytes(self, at: int, count: int) -> bytes:
        if not 0 <= at <= at + count <= self._size:
            raise BadTiffError("its directory reaches beyond the file's end")
        self._file.seek(at)
        found = self._file.read(count)
        if len(found) < count:
            raise BadTiffError("its directory reaches beyond the file's end")
        return found

    def values(self, tag: int) -> Values | None:
        """The numbers of a tag, (n,); None where it is missing."""
        if tag not in self._entries:
            return None
        kind, length, where = self._entries[tag]
        if kind not in _TYPES:
            raise BadTiffError(f"tag {tag} is of type {kind}")
        dtype = np.dtype(_TYPES[kind]).newbyteorder("<" if self._order == "<" else ">")
        return np.frombuffer(self._bytes(where, length * dtype.itemsize), dtype)

    def number(self, tag: int, default: int = 0) -> int:
        """The first number of a tag, or what it is where the tag is missing."""
        values = self.values(tag)
        return default if values is None or not values.size or values.dtype.kind == "S" else int(values[0])

    def text(self, tag: int) -> str:
        """The text of a tag; "" where it is missing."""
        values = self.values(tag)
        return "" if values is None else values.tobytes().partition(b"\0")[0].decode("utf-8", "replace").strip()

    def floats(self, tag: int, count: int) -> list[float]:
        """So many numbers of a tag; none where it has another number of them."""
        values = self.values(tag)
        if values is None or values.size != count or values.dtype.kind == "S":
            return []
        return [float(value) for value in values]


def _directories(file: BinaryIO, size: int) -> tuple[_Directory, bool]:
    """The first directory of a file, and whether another one is the mask of its pixels."""
    head = file.read(16)
    order = {b"II": "<", b"MM": ">"}.get(head[:2])
    if order is None or len(head) < 8 or (version := struct.unpack(order + "H", head[2:4])[0]) not in (42, 43):
        raise BadTiffError("it does not begin as one")
    big = version == 43
    if big and (len(head) < 16 or struct.unpack(order + "HH", head[4:8]) != (8, 0)):
        raise BadTiffError("it does not begin as one")
    at = struct.unpack(order + "Q", head[8:16])[0] if big else struct.unpack(order + "I", head[4:8])[0]
    first = _Directory(file, size, order, big, at)
    seen, following = {at}, first.next
    while following and following not in seen and len(seen) < _MAX_DIRECTORIES:
        seen.add(following)
        other = _Directory(file, size, order, big, following)
        if other.number(_SUBFILE) & _MASK:
            return first, True
        following = other.next
    return first, False


# ----------------------------------------------------------------------
# The file as a grid of heights.


class Blocks(NamedTuple):
    """Strips or tiles: rows and columns of one, how many stand beside each other, and where their bytes lie."""

    rows: int
    cols: int
    across: int
    offsets: Values
    sizes: Values


@dataclass(frozen=True, slots=True)
class GeoTiff:
    """A file whose directory was read.

    shape: (rows, cols).  bands: how many.  dtype: of a number as stored.
    transform: from columns and rows of pixel corners; None where it is not stated.
    crs: the reference system, "EPSG:32632" or "EPSG:4326+5773"; None where none is stated.
    vertical_unit: EPSG's code of the heights' unit, where it is stated beside the reference system; 0 elsewhere.
    scale, offset: of numbers to heights.  unit: of the band; "" where none is stated.
    tags: texts of the file and of its first band, by name.
    """

    path: Path
    shape: tuple[int, int]
    bands: int
    dtype: np.dtype[Any]
    transform: Affine | None
    crs: str | None
    vertical_unit: int
    blocks: Blocks
    scale: float
    offset: float
    unit: str
    tags: tuple[tuple[str, str], ...]
    _compression: int
    _predictor: int
    _nodata: float | None

    def read(self, top: int, bottom: int, left: int, right: int) -> NDArray[np.float32]:
        """Heights of rows and columns, half-open; NaN where there is no data.

        Raises BadTiffError for a block that cannot be unpacked, and OSError.
        """
        heights = np.full((bottom - top, right - left), np.nan, np.float32)
        high, wide = self.blocks.rows, self.blocks.cols
        with self.path.open("rb") as file:
            for down in range(top // high, (bottom - 1) // high + 1):
                for across in range(left // wide, (right - 1) // wide + 1):
                    block = self._block(file, down, across)
                    if block is None:
                        continue
                    r0, c0 = down * high, across * wide
                    rows = slice(max(top, r0), min(bottom, r0 + len(block)))
                    cols = slice(max(left, c0), min(right, c0 + wide))
                    part = self._heights(block[rows.start - r0 : rows.stop - r0, cols.start - c0 : cols.stop - c0])
                    heights[rows.start - top : rows.stop - top, cols.start - left : cols.stop - left] = part
        return heights

    def span(self, down: int, across: int) -> tuple[int, int] | None:
        """Bytes [begin, end) of a block; None for one that is not there, and has no data."""
        k = down * self.blocks.across + across
        begin, size = int(self.blocks.offsets[k]), int(self.blocks.sizes[k])
        return (begin, begin + size) if begin and size else None

    def _block(self, file: BinaryIO, down: int, across: int) -> Values | None:
        """Numbers of a block, as stored; None for one that is not there."""
        span = self.span(down, across)
        if span is None:
            return None
        # The last strip is as high as what is left; what a tile holds below the last row is none of the grid's.
        rows = min(self.blocks.rows, self.shape[0] - down * self.blocks.rows)
        count = rows * self.blocks.cols * self.dtype.itemsize
        if span[1] > file.seek(0, io.SEEK_END):
            raise BadTiffError("a block reaches beyond the file's end")
        file.seek(span[0])
        packed = file.read(span[1] - span[0])
        data = _unpacked(packed, self._compression, count)
        if len(data) < count:
            raise BadTiffError("a block has too few bytes")
        return _predicted(np.frombuffer(data, np.uint8, count), (rows, self.blocks.cols), self.dtype, self._predictor)

    def _heights(self, stored: Values) -> NDArray[np.float32]:
        # What a damaged file holds need not be numbers.
        with np.errstate(all="ignore"):
            whole = stored.astype(np.float64) * self.scale + self.offset
            if self._nodata is not None:
                whole[stored == _as_stored(self._nodata, stored.dtype)] = np.nan
            return whole.astype(np.float32)


def _as_stored(value: float, dtype: np.dtype[Any]) -> Any:
    """A number as an array of this type holds it; one that it cannot hold equals none of its own."""
    if dtype.kind == "f":
        return dtype.type(value)
    limits = np.iinfo(dtype)
    return dtype.type(value) if value.is_integer() and limits.min <= value <= limits.max else math.nan


def read_geotiff(path: Path) -> GeoTiff:
    """The directory of a file.  Raises BadTiffError, UnreadTiffError and OSError."""
    with path.open("rb") as file:
        size = path.stat().st_size
        directory, masked = _directories(file, size)
        if masked:
            raise UnreadTiffError("a mask of pixels")
        rows, cols = directory.number(_LENGTH), directory.number(_WIDTH)
        blocks = _blocks(directory, rows, cols)
        dtype, compression = _dtype(directory), directory.number(_COMPRESSION, 1)
        predictor = directory.number(_PREDICTOR, 1)
        _refuse_packing(compression, predictor, dtype)
        crs, unit, point = _reference_system(directory)
        tags, roles = _metadata(directory.text(_METADATA))
        nodata = directory.text(_NODATA)
        return GeoTiff(
            path, (rows, cols), directory.number(_SAMPLES, 1), dtype, _transform(directory, point=point),
            crs, unit, blocks, _number(roles.get("scale", "1")), _number(roles.get("offset", "0")),
            roles.get("unittype", ""), tags, compression, predictor, _number(nodata) if nodata else None,
        )  # fmt: skip


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise BadTiffError(f"{text[:40]!r} is no number") from None


def _dtype(directory: _Directory) -> np.dtype[Any]:
    bits, kind = directory.number(_BITS, 1), {1: "u", 2: "i", 3: "f", 4: "u", 6: "c"}.get(directory.number(_FORMAT, 1))
    if kind is None or bits not in ({"f": (16, 32, 64), "c": (64, 128)}.get(kind) or (8, 16, 32, 64)):
        raise UnreadTiffError(f"numbers of {bits} bits")
    if directory.number(_FILL, 1) != 1:
        raise UnreadTiffError("bits in the order of fax machines")
    return np.dtype(f"{directory._order}{kind}{bits // 8}")


def _blocks(directory: _Directory, rows: int, cols: int) -> Blocks:
    if not (0 < rows < 2**31 and 0 < cols < 2**31):
        raise BadTiffError(f"it has {rows} rows and {cols} columns")
    tiles = directory.values(_TILES)
    if tiles is not None:
        high, wide = directory.number(_TILE_LENGTH), directory.number(_TILE_WIDTH)
        sizes = directory.values(_TILE_SIZES)
    else:
        tiles, sizes = directory.values(_STRIPS), directory.values(_STRIP_SIZES)
        high, wide = min(directory.number(_ROWS, rows), rows), cols
    if tiles is None or sizes is None or high <= 0 or wide <= 0:
        raise BadTiffError("it has no blocks")
    across, down = -(-cols // wide), -(-rows // high)
    if min(tiles.size, sizes.size) < across * down or tiles.dtype.kind != "u" or sizes.dtype.kind != "u":
        raise BadTiffError(f"it has fewer than {across * down:,} blocks")
    return Blocks(high, wide, across, tiles, sizes)


def _metadata(text: str) -> tuple[tuple[tuple[str, str], ...], dict[str, str]]:
    """What GDAL notes in XML: texts of the file and of its first band by name, and of the band by their meaning."""
    if not text:
        return (), {}
    # Entities could grow a small file without end.
    if re.search(r"<!(DOCTYPE|ENTITY)", text, re.IGNORECASE):
        raise BadTiffError("its metadata declare a document type")
    try:
        items = ElementTree.fromstring(text).findall("Item")  # what could grow was refused above
    except ElementTree.ParseError as error:
        raise BadTiffError(f"its metadata are no XML: {error}") from None
    first = [item for item in items if item.get("sample", "0") == "0" and item.get("domain", "") == ""]
    tags = tuple((item.get("name", ""), item.text or "") for item in first if item.get("role") is None)
    return tags, {item.get("role", ""): (item.text or "").strip() for item in first if item.get("role")}


# ----------------------------------------------------------------------
# Blocks of numbers.

# TIFF's numbers of how blocks are packed.
_STORED, _LZW, _DEFLATE, _OLD_DEFLATE, _LZMA, _ZSTD = 1, 5, 8, 32946, 34925, 50000


def _refuse_packing(compression: int, predictor: int, dtype: np.dtype[Any]) -> None:
    """Raise UnreadTiffError for blocks that are not unpacked here."""
    if compression not in (_STORED, _LZW, _DEFLATE, _OLD_DEFLATE, _LZMA, _ZSTD):
        raise UnreadTiffError(f"blocks packed by method {compression}")
    if predictor not in (1, 2) and not (predictor == 3 and dtype.kind == "f"):
        raise UnreadTiffError(f"predictor {predictor} of {dtype.name}")


def _unpacked(packed: bytes, compression: int, count: int) -> bytes:
    """So many bytes of a block, or fewer where there are no more, however many the packed ones claim."""
    try:
        if compression == _STORED:
            return packed
        if compression in (_DEFLATE, _OLD_DEFLATE):
            return zlib.decompressobj().decompress(packed, count)
        if compression == _LZMA:
            return lzma.LZMADecompressor().decompress(packed, count)
        if compression == _ZSTD:
            with zstandard.ZstdDecompressor().stream_reader(packed) as stream:
                return stream.read(count)
    except (zlib.error, lzma.LZMAError, zstandard.ZstdError, EOFError) as error:
        raise BadTiffError(f"a block cannot be unpacked: {error}") from error
    return _unpacked_lzw(packed, count)


# Codes of LZW that are no string: the table begins anew, and the block is over.
_CLEAR, _END, _FIRST = 256, 257, 258


def _unpacked_lzw(packed: bytes, count: int) -> bytes:
    """Bytes of a block packed by LZW (TIFF Revision 6.0, section 13); codes of old files run the other way."""
    if packed[:2] == b"\0\1":
        raise BadTiffError("a block is packed by the LZW of before 1993")
    out = np.zeros(count, np.uint8)
    # Bits are taken from three bytes at a time.
    size = _unpack_lzw(np.frombuffer(packed + b"\0\0", np.uint8), out)
    if size < 0:
        raise BadTiffError("a block cannot be unpacked: a code of LZW is not in its table")
    return out[:size].tobytes()


@compiled
def _unpack_lzw(packed: NDArray[np.uint8], out: NDArray[np.uint8]) -> int:  # pragma: no cover - compiled
    """Fill ``out``; return how many bytes there are, or -1 for a code that stands for none.

    packed: with two bytes more than there are.
    Each string of the table has been written before: it is known by where, and how long it is.
    """
    begins, sizes = np.zeros(4097, np.int64), np.zeros(4097, np.int64)
    at, bit, width, following, last, last_size = 0, 0, 9, _FIRST, -1, 0
    while at < out.size and bit + width <= 8 * (packed.size - 2):
        k = bit >> 3
        bits = (np.int64(packed[k]) << 16) | (np.int64(packed[k + 1]) << 8) | np.int64(packed[k + 2])
        code = (bits >> (24 - (bit & 7) - width)) & ((1 << width) - 1)
        bit += width
        if code == _END:
            break
        if code == _CLEAR:
            width, following, last = 9, _FIRST, -1
            continue
        if last >= 0 and following < 4096:
            # The last string, and the first byte of this one, which is written behind it.
            begins[following], sizes[following] = last, last_size + 1
            following += 1
        size = 1
        if code < _CLEAR:
            out[at] = code
        elif code < following:
            size = sizes[code]
            for i in range(min(size, out.size - at)):
                out[at + i] = out[begins[code] + i]
        else:
            return -1
        last, last_size = at, size
        at += size
        # One code earlier than it has to be, as the first writers did.
        if following >= (1 << width) - 1 and width < 12:
            width += 1
    return min(at, out.size)


def _predicted(data: NDArray[np.uint8], shape: tuple[int, int], dtype: np.dtype[Any], predictor: int) -> Values:
    """Numbers (rows, cols) of a block's bytes, which a predictor may hold as differences along the rows."""
    rows, cols = shape
    if predictor == 1:
        return data.view(dtype).reshape(shape)
    if predictor == 2:
        whole = data.view(np.dtype(f"{dtype.byteorder}u{dtype.itemsize}")).reshape(shape)
        summed = np.cumsum(whole, axis=1, dtype=whole.dtype.newbyteorder("="))
        return summed.view(dtype.newbyteorder("="))
    planes = np.cumsum(data.reshape(rows, -1), axis=1, dtype=np.uint8).reshape(rows, dtype.itemsize, cols)
    return np.ascontiguousarray(planes.transpose(0, 2, 1)).view(dtype.newbyteorder(">")).reshape(shape)


# ----------------------------------------------------------------------
# The place on Earth.

_MODEL, _RASTER, _GEODETIC, _ANGLES, _PROJECTED, _LENGTHS, _VERTICAL, _VERTICAL_UNIT = (
    1024, 1025, 2048, 2054, 3072, 3076, 4096, 4099,
)  # fmt: skip
_PROJECTED_MODEL, _GEOGRAPHIC_MODEL, _IS_POINT = 1, 2, 2
_USER_DEFINED, _METRE, _DEGREES = 32767, 9001, (9102, 9122)
# Ellipsoids and datums, which files of before 2019 state in place of a vertical system's code.
_OLD_VERTICAL = range(5001, 5200)
_TO_WGS84 = 2062


def _transform(directory: _Directory, *, point: bool) -> Affine | None:
    """point: whether numbers stand for the corners of the grid that is stated, not for the squares between."""
    matrix = directory.floats(_MATRIX, 16)
    scale, tie = directory.floats(_SCALE, 3), directory.floats(_TIE_POINTS, 6)
    if scale and tie:
        if scale[2] not in (0.0, 1.0) or tie[2] or tie[5]:
            raise UnreadTiffError("heights scaled by the place that is stated")
        # Rows go south, whatever the sign of their height.
        a, e = scale[0], -abs(scale[1])
        found = Affine(a, 0.0, tie[3] - tie[0] * a, 0.0, e, tie[4] - tie[1] * e)
    elif matrix:
        found = Affine(*(matrix[k] for k in (0, 1, 3, 4, 5, 7)))
    else:
        return None
    if not all(map(math.isfinite, found)):
        raise BadTiffError("its place is no number")
    if point:
        found = found._replace(c=found.c - (found.a + found.b) / 2, f=found.f - (found.d + found.e) / 2)
    return found


def _reference_system(directory: _Directory) -> tuple[str | None, int, bool]:
    """The reference system, the vertical unit's code, and whether pixels stand for points."""
    values = directory.values(_KEYS)
    if values is None or values.size < 4:
        return None, 0, False
    rows = values[4 : 4 * (1 + min(int(values[3]), values.size // 4 - 1))].astype(np.int64).reshape(-1, 4).tolist()
    # Numbers that stand in the key itself; others lie elsewhere.
    keys = {key: value for key, where, _, value in rows if where == 0}
    if _TO_WGS84 in (row[0] for row in rows):
        raise UnreadTiffError("a reference system that is shifted")
    model = keys.get(_MODEL)
    if model is None:
        return None, 0, False
    code = keys.get({_PROJECTED_MODEL: _PROJECTED, _GEOGRAPHIC_MODEL: _GEODETIC}.get(model, -1), _USER_DEFINED)
    if code == _USER_DEFINED:
        raise UnreadTiffError("a reference system without a code of EPSG")
    vertical = keys.get(_VERTICAL, 0)
    if vertical == _USER_DEFINED or vertical in _OLD_VERTICAL:
        raise UnreadTiffError("heights without a code of EPSG")
    text = f"EPSG:{code}" if vertical in (0, code) else f"EPSG:{code}+{vertical}"
    _refuse_other_units(text, keys, model)
    return text, keys.get(_VERTICAL_UNIT, 0), keys.get(_RASTER) == _IS_POINT


def _refuse_other_units(text: str, keys: dict[int, int], model: int) -> None:
    """Raise UnreadTiffError where a file states a reference system by its code, and then other units."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        axis = CRS.from_user_input(text).axis_info[0]
    except (CRSError, IndexError) as error:
        raise UnreadTiffError(f"{text}, which PROJ does not know") from error
    stated = keys.get(_LENGTHS if model == _PROJECTED_MODEL else _ANGLES)
    known = {int(axis.unit_code or 0), *(_DEGREES if int(axis.unit_code or 0) in _DEGREES else ())}
    if stated is not None and stated not in known:
        raise UnreadTiffError(f"{text} in a unit of its own")


# ----------------------------------------------------------------------
# Writing.

_STRIP_ROWS = 64


def geotiff_bytes(heights: NDArray[np.float32], transform: Sequence[float], crs: str, nodata: float) -> bytes:
    """A GeoTIFF of heights in metres, packed by deflate.

    transform: affine coefficients (a, b, c, d, e, f).  crs: as pyproj takes it.
    Raises UnreadTiffError for a reference system without a code of EPSG.
    """
    rows, cols = heights.shape
    strips = [_packed(heights[row : row + _STRIP_ROWS]) for row in range(0, rows, _STRIP_ROWS)]
    a, b, c, d, e, f = transform
    if b or d or e > 0.0:
        placed = [(_MATRIX, "d", (a, b, 0.0, c, d, e, 0.0, f, *[0.0] * 7, 1.0))]
    else:
        placed = [(_SCALE, "d", (a, -e, 0.0)), (_TIE_POINTS, "d", (0.0, 0.0, 0.0, c, f, 0.0))]
    unit = '<GDALMetadata><Item name="UNITTYPE" sample="0" role="unittype">m</Item></GDALMetadata>'
    entries: list[tuple[int, str, tuple[Any, ...]]] = [
        (_WIDTH, "I", (cols,)), (_LENGTH, "I", (rows,)), (_BITS, "H", (32,)), (_COMPRESSION, "H", (_DEFLATE,)),
        (262, "H", (1,)), (_STRIPS, "I", (0,) * len(strips)), (_SAMPLES, "H", (1,)), (_ROWS, "I", (_STRIP_ROWS,)),
        (_STRIP_SIZES, "I", tuple(map(len, strips))), (284, "H", (1,)), (_PREDICTOR, "H", (3,)), (_FORMAT, "H", (3,)),
        *placed, (_KEYS, "H", _keys(crs)), (_METADATA, "s", (unit.encode() + b"\0",)),
        (_NODATA, "s", (f"{nodata:g}".encode() + b"\0",)),
    ]  # fmt: skip
    # What a tag states in more than four bytes lies behind the directory, and the strips behind that.
    beyond = 8 + 2 + 12 * len(entries) + 4
    packed = {tag: _tag_bytes(kind, values) for tag, kind, values in entries}
    first = beyond + sum(len(data) + len(data) % 2 for data in packed.values() if len(data) > 4)
    begins = np.cumsum([first, *map(len, strips[:-1])]).tolist()
    packed[_STRIPS] = _tag_bytes("I", tuple(begins))
    directory, behind = struct.pack("<4sIH", b"II*\0", 8, len(entries)), b""
    for tag, kind, values in sorted(entries):
        data = packed[tag]
        count = len(data) if kind == "s" else len(values)
        where = data.ljust(4, b"\0")
        if len(data) > 4:
            where = struct.pack("<I", beyond + len(behind))
            behind += data + bytes(len(data) % 2)
        directory += struct.pack("<HHI", tag, {"H": 3, "I": 4, "d": 12, "s": 2}[kind], count) + where
    return b"".join([directory, bytes(4), behind, *strips])


def _tag_bytes(kind: str, values: tuple[Any, ...]) -> bytes:
    return bytes(values[0]) if kind == "s" else struct.pack(f"<{len(values)}{kind}", *values)


def _packed(heights: NDArray[np.float32]) -> bytes:
    """A strip as differences of bytes along the rows, the highest bytes of all numbers first."""
    rows = len(heights)
    planes = heights.astype(">f4").view(np.uint8).reshape(rows, -1, 4).transpose(0, 2, 1).reshape(rows, -1)
    return zlib.compress(np.diff(planes, axis=1, prepend=np.uint8(0)).astype(np.uint8).tobytes(), 6)


def _keys(crs: str) -> tuple[int, ...]:
    """The directory of keys of a reference system that has a code."""
    from pyproj import CRS

    system = CRS.from_user_input(crs)
    parts = [part.to_epsg() for part in system.sub_crs_list] if system.is_compound else [system.to_epsg()]
    codes = [code for code in parts if code is not None]
    if len(codes) < len(parts):
        raise UnreadTiffError("a reference system without a code of EPSG")
    model = _GEOGRAPHIC_MODEL if system.is_geographic else _PROJECTED_MODEL
    keys = {_MODEL: model, _RASTER: 1, (_GEODETIC if system.is_geographic else _PROJECTED): codes[0]}
    keys |= {_VERTICAL: codes[1]} if len(codes) > 1 else {}
    flat = [number for key, value in sorted(keys.items()) for number in (key, 0, 1, value)]
    return (1, 1, 1, len(keys), *flat)
