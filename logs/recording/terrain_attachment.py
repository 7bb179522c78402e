"""The terrain inside a log: exact heights, packed without loss, and how they lie on the map.

A height is stored as the difference of its float32 bits from those of its western neighbour, the four bytes of all
differences in planes, compressed with zstd.
"""

import json
import math
from typing import Annotated, Any

import numpy as np
import zstandard
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from logs.recording.attachment_names import TERRAIN_FILE, heights_name
from world.errors import LogError
from world.frames import MOST_TERMS, PolyMap
from world.raster import MOST_PIXELS
from world.scenario_file import first_fault
from world.terrain import Terrain

TERRAIN_SCHEMA = "planfly.terrain/1"
_ENCODING = "float32 bits, difference to the west modulo 2^32, byte planes (low first), zstd"
_PART_PIXELS = 4 * 2**20


_Finite = Annotated[float, Field(allow_inf_nan=False)]


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    file_schema: Annotated[str, Field(alias="schema", pattern=f"^{TERRAIN_SCHEMA}$")] = TERRAIN_SCHEMA
    encoding: Annotated[str, Field(max_length=200)] = _ENCODING
    rows: Annotated[int, Field(ge=2)]
    cols: Annotated[int, Field(ge=2, le=_PART_PIXELS)]
    spacing_m: Annotated[_Finite, Field(gt=0.0)]
    source: str
    sha256: str
    datum: str
    vertical_error_m: float | None
    map_to_pixel: Annotated[
        list[list[Annotated[float, Field(allow_inf_nan=False)]]], Field(min_length=4, max_length=2 + 2 * MOST_TERMS)
    ]
    map_residual_pixels: float
    parts: list[str]


def pack_terrain(terrain: Terrain) -> dict[str, bytes]:
    """Pack the terrain as attachments, bytes by name: `TERRAIN_FILE`, and the heights in parts."""
    rows, cols = terrain.heights.shape
    parts = {}
    for k, (first, last) in enumerate(_row_blocks(rows, cols)):
        parts[heights_name(k)] = _pack(terrain.heights[first:last])
    file = _File(
        rows=rows,
        cols=cols,
        spacing_m=terrain.spacing,
        source=terrain.source,
        sha256=terrain.sha256,
        datum=terrain.datum,
        vertical_error_m=terrain.vertical_error,
        map_to_pixel=terrain.to_pixel.rows().tolist(),
        map_residual_pixels=terrain.to_pixel.residual,
        parts=list(parts),
    )
    text = json.dumps(file.model_dump(by_alias=True), indent=1)
    return {TERRAIN_FILE: text.encode(), **parts}


def unpack_terrain(attachments: dict[str, bytes], source: str) -> Terrain:
    """Rebuild the packed terrain, bit for bit.

    attachments: what `pack_terrain` gave, among others.  source: names the log in messages.  Raises LogError for
    heights that are missing, damaged or of another size, and for a map that is none.
    """
    try:
        file = _File.model_validate_json(attachments[TERRAIN_FILE])
    except ValidationError as error:
        raise LogError(**first_fault(error).at(source, TERRAIN_FILE)) from error
    if file.rows * file.cols > MOST_PIXELS:
        raise LogError(
            f"{source}: {TERRAIN_FILE}: {file.rows} x {file.cols} pixels: at most {MOST_PIXELS:,} are read", file=source
        )
    blocks = _row_blocks(file.rows, file.cols)
    if len(blocks) != len(file.parts) or any(name not in attachments for name in file.parts):
        message = f"{source}: {TERRAIN_FILE}: parts: {len(blocks)} are expected, each in the log"
        raise LogError(message, file=source, field="parts", value=len(file.parts))
    heights = np.empty((file.rows, file.cols), dtype=np.float32)
    for name, (first, last) in zip(file.parts, blocks, strict=True):
        heights[first:last] = _unpack(attachments[name], last - first, file.cols, f"{source}: {name}")
    rows = _coefficients(file.map_to_pixel, source)
    return Terrain(
        heights=heights,
        to_pixel=PolyMap.from_rows(rows, file.map_residual_pixels),
        spacing=file.spacing_m,
        source=file.source,
        sha256=file.sha256,
        datum=file.datum,
        vertical_error=file.vertical_error_m,
    )


def _row_blocks(rows: int, cols: int) -> list[tuple[int, int]]:
    step = max(1, _PART_PIXELS // cols)
    return [(first, min(rows, first + step)) for first in range(0, rows, step)]


def _pack(heights: NDArray[np.float32]) -> bytes:
    bits = np.ascontiguousarray(heights, dtype="<f4").view("<u4")
    bits = np.diff(bits, axis=1, prepend=np.zeros((len(bits), 1), dtype="<u4"))
    planes = np.ascontiguousarray(bits.reshape(-1, 1).view(np.uint8).T)
    return bytes(zstandard.ZstdCompressor(level=3).compress(planes.tobytes()))


def _unpack(data: bytes, rows: int, cols: int, where: str) -> NDArray[Any]:
    size = rows * cols * 4
    try:
        # A reader, not decompress(): the size that the frame declares is not to be believed.
        raw = zstandard.ZstdDecompressor(max_window_size=2**27).stream_reader(data).read(size + 1)
    except zstandard.ZstdError as error:
        raise LogError(f"{where}: cannot be decompressed: {error}", file=where) from error
    if len(raw) != size:
        raise LogError(f"{where}: {rows} x {cols} heights are expected: the size differs", file=where)
    bits = np.ascontiguousarray(np.frombuffer(raw, np.uint8).reshape(4, -1).T).view("<u4").reshape(rows, cols)
    return np.cumsum(bits, axis=1, dtype=np.uint32).astype("<u4").view("<f4")


def _coefficients(rows: list[list[float]], source: str) -> NDArray[np.float64]:
    size = len(rows[0])
    if len(rows) != 2 + 2 * size or any(len(row) != size for row in rows) or size < 2:
        found = f"{len(rows)} rows of {size}"
        raise LogError.at(f"{source}: {TERRAIN_FILE}", "map_to_pixel", found, "2 + 2n rows of n are expected")
    if not (math.fabs(rows[1][0]) > 0.0 and math.fabs(rows[1][1]) > 0.0):
        shown = f"half-widths {rows[1][:2]}"
        raise LogError.at(f"{source}: {TERRAIN_FILE}", "map_to_pixel", rows[1][:2], "not above 0", shown=shown)
    return np.array(rows)
