"""The bytes of a log without its size in memory: mapped, and let go of again piece by piece."""

import mmap
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]

# Bytes that are looked at before they are let go of.
PIECE = 16 * 2**20


class MappedFile:
    """A file's bytes as an array.

    data: (n,) of them.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "a.BIN"
    ...     count = path.write_bytes(b"abc")
    ...     bytes(MappedFile(path).data)
    b'abc'
    """

    def __init__(self, path: Path) -> None:
        with path.open("rb") as file:
            self._map = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self.data: Bytes = np.frombuffer(self._map, np.uint8)

    def let_go(self) -> None:
        """Give back what the system holds of the file in memory; it is read anew where it is looked at again."""
        # Windows has no such call, and counts mapped pages otherwise.
        if hasattr(self._map, "madvise"):
            self._map.madvise(mmap.MADV_DONTNEED)


def pieces(size: int, let_go: Callable[[], None]) -> Iterator[int]:
    """Ends of pieces of so many bytes, the last of them all; after each the file is let go of.

    >>> list(pieces(3, lambda: None)), list(pieces(PIECE + 1, lambda: None)) == [PIECE, PIECE + 1]
    ([3], True)
    """
    end = 0
    while end < size:
        end = min(size, end + PIECE)
        yield end
        let_go()
