"""Numba kernels, compiled once per version of the sources.

Numba's own cache looks at the file a kernel stands in, not at the kernels and constants that it takes from other
files: after an edit or an upgrade of those it would go on running old code.  Here the cache lies in the user's
cache folder under a hash of all sources that kernels are made of, so that any change compiles anew.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from platformdirs import user_cache_dir

_Kernel = TypeVar("_Kernel", bound=Callable[..., Any])
_ROOMS = ("aircraft", "world", "planner", "flight", "logs")


def _sources_hash() -> str:
    root = Path(__file__).parent.parent
    digest = hashlib.sha256()
    for room in _ROOMS:
        for file in sorted((root / room).glob("*.py")):
            digest.update(file.name.encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


# Numba fills its settings in when it is imported, and states no types for them.  The folder is read when a kernel is
# decorated; one that the user has set stays.
_settings: Any = numba.config
if not _settings.CACHE_DIR:
    _settings.CACHE_DIR = str(Path(user_cache_dir("planfly")) / f"kernels-{_sources_hash()}")


def compiled(kernel: _Kernel) -> _Kernel:
    """Compile a function of numbers and arrays to machine code on first use, and keep it.

    Division is that of IEEE 754, as in NumPy: a test for zero at each division costs a judge a third of its time.
    """
    return cast("_Kernel", numba.njit(cache=True, error_model="numpy")(kernel))
