"""The text of a track file: of a size that can be read, and without the traps of XML."""

import re
import zipfile
import zlib
from pathlib import Path

from world.errors import LogError

# A track of a day at ten points a second takes less.
MOST_BYTES = 256 * 2**20
# A document type can hold entities that grow without bound, or that name other files.
_DOCUMENT_TYPE = re.compile(r"<!(DOCTYPE|ENTITY)", re.IGNORECASE)


def track_text(path: Path, *, xml: bool) -> str:
    """The text of a file, bytes that are no UTF-8 replaced.

    Of a zipped file (`.kmz`) it is that of its first `.kml`.  Raises LogError for a file of more than `MOST_BYTES`, and
    for XML with a document type.
    """
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise LogError(f"{path}: {size:,} bytes: at most {MOST_BYTES:,} are read of a track", file=path)
    text = _bytes_of(path).decode("utf-8-sig", errors="replace")
    if xml and _DOCUMENT_TYPE.search(text):
        raise LogError(
            f"{path}: a document type: none is expected in a track, and entities are not expanded", file=path
        )
    return text


def _bytes_of(path: Path) -> bytes:
    if not zipfile.is_zipfile(path):
        return path.read_bytes()
    try:
        with zipfile.ZipFile(path) as archive:
            # Google Earth has one, doc.kml, and reads the first of several (OGC 12-007, "KMZ").
            entry = next((one for one in archive.infolist() if one.filename.lower().endswith(".kml")), None)
            if entry is None:
                raise LogError(f"{path}: a zipped file without a .kml in it", file=path)
            with archive.open(entry) as file:
                # What it claims to hold is not what it holds.
                data = file.read(MOST_BYTES + 1)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError) as error:
        why = " ".join(str(error).split())[:120]
        raise LogError(f"{path}: a zipped file that cannot be read: {why}", file=path) from error
    if len(data) > MOST_BYTES:
        message = f"{path}: more than {MOST_BYTES:,} bytes unpacked: at most as many are read of a track"
        raise LogError(message, file=path)
    return data
