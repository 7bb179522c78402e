"""The text of a track file: of a size that can be read, and without the traps of XML."""

import re
from pathlib import Path

from world.errors import LogError

# A track of a day at ten points a second takes less.
MOST_BYTES = 256 * 2**20
# A document type can hold entities that grow without bound, or that name other files.
_DOCUMENT_TYPE = re.compile(r"<!(DOCTYPE|ENTITY)", re.IGNORECASE)


def track_text(path: Path, *, xml: bool) -> str:
    """The text of a file, bytes that are no UTF-8 replaced.

    Raises LogError for a file of more than `MOST_BYTES`, and for XML with a document type.
    """
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise LogError(f"{path}: {size:,} bytes: at most {MOST_BYTES:,} are read of a track", file=path)
    text = path.read_bytes().decode("utf-8-sig", errors="replace")
    if xml and _DOCUMENT_TYPE.search(text):
        raise LogError(
            f"{path}: a document type: none is expected in a track, and entities are not expanded", file=path
        )
    return text
