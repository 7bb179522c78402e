"""Store compiled kernels in files that begin with a digest.

A kernel whose file is damaged is compiled again.

Numba loads its files unchecked: a cut file ends the process with a traceback, and a flipped bit in machine code with a
segmentation fault.
"""

import contextlib
import hashlib
import itertools
import pickle
from pathlib import Path
from typing import Any

from numba.core.caching import IndexDataCacheFile
from numba.core.serialize import dumps

# Size of the digest at the beginning of a file, bytes.
_DIGEST_BYTES = 32


class CheckedCacheFiles(IndexDataCacheFile):
    """Cache files of one kernel: an index, and data files with machine code.

    There is a data file for each combination of argument types.

    Each file begins with a digest. A file that is missing, damaged or unreadable is treated as empty. The digest of a
    data file covers the argument types, too.
    """

    def __init__(self, folder: str, base: str, stamp: Any) -> None:
        super().__init__(folder, base, stamp)  # type: ignore[no-untyped-call]
        self._folder = Path(folder)

    def load(self, key: Any) -> Any:
        """Return the machine code for a key (the argument types), or None if it is not saved or is damaged."""
        name = self._load_index().get(key)
        return None if name is None else _read_checked(self._folder / name, repr(key))

    def save(self, key: Any, data: Any) -> None:
        """Save the machine code for a key; if this fails, the next process compiles the kernel again."""
        with contextlib.suppress(OSError):
            forms = self._load_index()
            if key not in forms:
                used_names = set(forms.values())
                forms[key] = next(name for name in map(self._data_name, itertools.count(1)) if name not in used_names)
                self._write(self._folder / self._index_name, "", (self._version, self._source_stamp, forms))
            self._write(self._folder / forms[key], repr(key), data)

    def _load_index(self) -> dict[Any, str]:
        """Return the names of the data files by key; empty if the index is missing or outdated."""
        version, stamp, forms = _read_checked(self._folder / self._index_name, "") or (None, None, {})
        return forms if (version, stamp) == (self._version, self._source_stamp) else {}

    def _write(self, path: Path, label: str, data: Any) -> None:
        """Write a digest and an object to a file; the digest covers the object and a label."""
        content = dumps(data)  # type: ignore[no-untyped-call]
        with self._open_for_write(path) as file:
            file.write(_compute_digest(label, content) + content)


def use_checked_files(dispatcher: Any) -> None:
    """Make numba cache a kernel in files with a digest, `CheckedCacheFiles`."""
    cache = dispatcher._cache
    cache_file = cache._cache_file
    cache._cache_file = CheckedCacheFiles(cache.cache_path, cache._impl.filename_base, cache_file._source_stamp)


def _read_checked(path: Path, label: str) -> Any:
    """Return the object in a file; None if the file cannot be read or its digest does not match.

    label: text that is included in the digest.
    """
    try:
        content = path.read_bytes()
    except OSError:
        return None
    stated_digest, content = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
    return pickle.loads(content) if stated_digest == _compute_digest(label, content) else None


def _compute_digest(label: str, content: bytes) -> bytes:
    """Return the digest of a label and a content."""
    # BLAKE2 takes a third of the time of SHA-256 where the processor has no instructions for SHA-256.
    digest = hashlib.blake2b(label.encode() + b"\0", digest_size=_DIGEST_BYTES)
    digest.update(content)
    return digest.digest()
